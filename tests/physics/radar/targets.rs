//! Cross-sections of meshes against closed forms.

use super::*;
use echocast_tests::reference::Random;

/// Reported and true cross-section of the only target, dBsm.
fn cross_sections(shape: Shape, more: &str) -> [f64; 2] {
    let cloud = scan(&scene([(shape, METAL)]), &radar(more), &options());
    let (row, c) = (first(&cloud), cloud.columns());
    [c.rcs()[row].into(), c.true_rcs()[row].into()]
}

/// Rings of a sphere whose facets are within a hundredth of a wavelength of it: what is flat returns as what is flat.
fn rings(radius: f64) -> u32 {
    (12.6 * (radius / WAVELENGTH).sqrt()).ceil() as u32
}

/// `pi r^2`, however the triangles lie.
#[test]
fn spheres_return_the_area_of_their_shadow() {
    let mut random = Random::new(3);
    for radius in [0.05, 0.1, 0.2, 0.4] {
        for _ in 0..4 {
            let place = DVec3::new(40.0, random.between(-10.0, 10.0), random.between(-5.0, 5.0));
            let place = DAffine3::from_rotation_translation(random.rotation(), place);
            let [_, found] = cross_sections(placed(Shape::sphere(radius, rings(radius)), place), "radar.power_dbm=60");
            assert_near(&format!("sphere of {radius} m, dBsm"), found, db(PI * radius * radius), 1.0);
        }
    }
}

/// Mie's series of conducting spheres at 77 GHz, over `pi r^2`, where `k r` is above 10.
#[test]
fn spheres_return_what_the_series_says() {
    for (radius, ratio) in [(0.01, 0.940_284), (0.05, 0.998_344), (0.1, 1.000_12)] {
        let sphere = placed(Shape::sphere(radius, rings(radius)), DAffine3::from_translation(DVec3::X * 20.0));
        let [_, found] = cross_sections(sphere, "radar.power_dbm=70");
        assert_near(&format!("sphere of {radius} m, dBsm"), found, db(ratio * PI * radius * radius), 1.0);
    }
}

/// `k r L^2` broadside, of a length at which 100 m are far away.
#[test]
fn cylinders_return_their_closed_form() {
    let (radius, length, around) = (0.05, 0.2, 180);
    let mut shape = Shape { normals: Some(Vec::new()), ..Shape::default() };
    for index in 0..around {
        let angle = 2.0 * PI * f64::from(index) / f64::from(around);
        let normal = DVec3::new(angle.cos(), angle.sin(), 0.0);
        for end in [-0.5, 0.5] {
            let at = radius * normal + end * length * DVec3::Z + 100.0 * DVec3::X;
            shape.positions.push(at.as_vec3().to_array());
            shape.normals.get_or_insert_default().push(normal.as_vec3().to_array());
        }
        let [a, b] = [2 * index, 2 * ((index + 1) % around)];
        shape.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
    }
    let [_, found] = cross_sections(shape, "radar.power_dbm=60");
    let area = 2.0 * PI / WAVELENGTH * radius * length * length;
    assert_near("cylinder, dBsm", found, db(area), 1.0);
}

/// Check values of plates and corners of 0.1 m, by what the radar reports.
#[test]
fn plates_and_corners_are_reported_as_they_are() {
    let range = 43.0;
    let (sin, half) = (0.1 * 0.5f64.sqrt(), 0.05);
    let at = DVec3::X * range;
    let dihedral = [-1.0, 1.0]
        .map(|side| Shape::quad(at - half * DVec3::Z, DVec3::new(-sin, side * sin, 0.0), 0.1 * DVec3::Z))
        .into_iter()
        .reduce(Shape::and)
        .unwrap();
    for (name, shape, dbsm) in [
        ("plate", Shape::plate(at, DVec3::NEG_X, half), 19.185_50),
        ("dihedral", dihedral, 22.195_80),
        ("trihedral", trihedral(0.1, at), 14.414_29),
    ] {
        let [reported, truth] = cross_sections(shape, "");
        assert_near(&format!("{name}: RCS"), reported, dbsm, 0.5);
        assert_near(&format!("{name}: true RCS"), truth, dbsm, 0.3);
    }
}

/// The echo of a large plate is that of the radar's mirror image, `lambda / (8 pi R)` in amplitude: of 9.95 m with beams
/// of 8 degrees, which leave the edges in the dark.
#[test]
fn large_plates_are_mirrors() {
    let range = 17.0 * STEP;
    let beams = "radar.array.tx_pattern={azimuth_deg:8,elevation_deg:8} \
                 radar.array.rx_pattern={azimuth_deg:8,elevation_deg:8}";
    let plate = Shape::plate(DVec3::X * range, DVec3::NEG_X, 2.0);
    let cube = cube(&scene([(plate, METAL)]), &radar(beams), &options());
    let image = (1e-3 * 10f64.powf(4.2)).sqrt() * WAVELENGTH / (8.0 * PI * range);
    // ITU-R P.2040-3: metal reflects 0.998151 of the power.
    let amplitude = cell(&cube, range, 0.0).sqrt() / (0.998_151f64.sqrt() * image);
    assert_near("amplitude over that of the image", amplitude, 1.0, 1e-3);
}
