//! Directions of the electric field.

use super::*;

/// Two faces at right angles turn a field that is at 45 degrees to their fold to the other diagonal: nothing of it is
/// received; along or across the fold all of it is.
#[test]
fn dihedrals_at_45_degrees_cross_the_field() {
    let (sin, half) = (0.1 * 0.5f64.sqrt(), 0.05);
    let faces = [-1.0, 1.0]
        .map(|side| Shape::quad(-half * DVec3::Z, DVec3::new(-sin, side * sin, 0.0), 0.1 * DVec3::Z))
        .into_iter()
        .reduce(Shape::and)
        .unwrap();
    for polarisation in ["vertical", "horizontal"] {
        let sensor = radar(&format!("radar.array.polarisation={polarisation} radar.power_dbm=60"));
        let power = |roll: f64| {
            let place = DQuat::from_rotation_x(roll.to_radians());
            let place = DAffine3::from_rotation_translation(place, DVec3::X * 70.0 * STEP);
            cell(&cube(&scene([(placed(faces.clone(), place), METAL)]), &sensor, &options()), 70.0 * STEP, 0.0)
        };
        let upright = power(0.0);
        assert_near("level over upright, dB", db(power(90.0) / upright), 0.0, 0.2);
        let crossed = db(power(45.0) / upright);
        assert!(crossed < -20.0, "{polarisation}: {crossed} dB");
        assert_near("at 22.5 degrees, dB", db(power(22.5) / upright), 20.0 * 45f64.to_radians().cos().log10(), 0.5);
    }
}

/// A ball over concrete, by the ground both ways at 66.4 degrees from the normal, the pseudo-Brewster angle: level waves
/// are reflected as Fresnel says with `5.24 - j0.32243` (ITU-R P.2040-3), upright ones hardly at all.
#[test]
fn upright_waves_see_no_ground_at_the_brewster_angle() {
    let height: f64 = 10.0;
    let distance = 2.0 * height * 66.4f64.to_radians().tan();
    let ground = Shape::quad(DVec3::new(-20.0, -40.0, -height), 120.0 * DVec3::X, 80.0 * DVec3::Y);
    let ball = placed(Shape::sphere(0.1, 120), DAffine3::from_translation(DVec3::X * distance));
    let echoes = |polarisation: &str| {
        let more = format!("radar.array.polarisation={polarisation} radar.power_dbm=90 pattern.elevation_deg=[-40,40]");
        let objects = [(ground.clone(), "law: itu, material: concrete"), (ball.clone(), METAL)];
        let cube = cube(&scene(objects), &radar(&more), &options());
        let near = |range: f64| {
            let at = |offset: f64| cell(&cube, range - 0.1 + offset * STEP, 0.0);
            at(-0.5).max(at(0.0)).max(at(0.5))
        };
        let folded = distance.hypot(2.0 * height);
        [near(distance), near(0.5 * (distance + folded)), near(folded)]
    };
    let [direct, once, twice] = echoes("horizontal");
    let reflected = fresnel_s(66.4);
    let spread = 40.0 * (distance / distance.hypot(2.0 * height)).log10();
    assert_near("by the ground twice, level, dB", db(twice / direct), 2.0 * db(reflected) + spread, 1.5);
    // The ways there and back by the ground are two of the same length.
    assert_near("by the ground once, level, dB", db(once / direct), db(4.0 * reflected) + 0.5 * spread, 1.5);
    let [direct, once, twice] = echoes("vertical");
    assert!(db(once / direct) < -15.0 && db(twice / direct) < -25.0, "{} {}", db(once / direct), db(twice / direct));
}

/// `|(cos - sqrt(eta - sin^2)) / (cos + sqrt(eta - sin^2))|^2` of concrete at 77 GHz (ITU-R P.2040-3 eq. 31a).
fn fresnel_s(degrees: f64) -> f64 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (re, im): (f64, f64) = (5.24 - sin * sin, -0.322_43);
    let size = re.hypot(im);
    let (a, b) = (((size + re) / 2.0).sqrt(), ((size - re) / 2.0).sqrt());
    ((cos - a).powi(2) + b * b) / ((cos + a).powi(2) + b * b)
}
