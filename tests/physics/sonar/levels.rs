//! How loud surfaces are.

use super::*;
use echocast::emitter::lobe::{Piston, Shape as LobeShape};
use echocast::material::Sediment;
use echocast::medium::{Absorption, Fluid, Sea, SoundRay};
use glam::DQuat;
use std::f64::consts::{FRAC_PI_2, PI};

const HEIGHT: f64 = 20.0;

/// Directions around an axis along `y`: those `sine` off the plane across it, rotated by an angle about it from
/// straight down; `dOmega = d(sine) d(angle)`.
fn turned(sine: f64, angle: f64) -> DVec3 {
    let level = (1.0 - sine * sine).sqrt();
    DVec3::new(level * angle.sin(), sine, -level * angle.cos())
}

/// Integral of `value` over sine and angle.
fn integral(sines: [f64; 2], angles: [f64; 2], value: impl Fn(f64, f64) -> f64) -> f64 {
    const STEPS: usize = 1500;
    let middle = |[low, high]: [f64; 2], index: usize| low + (index as f64 + 0.5) * (high - low) / STEPS as f64;
    let cells = (0..STEPS * STEPS).map(|at| value(middle(sines, at / STEPS), middle(angles, at % STEPS)));
    cells.sum::<f64>() * (sines[1] - sines[0]) * (angles[1] - angles[0]) / (STEPS * STEPS) as f64
}

/// Energy that a beam hears of a flat bottom of Lambert's law with mu 0.1, dB, times bandwidths: the sonar equation
/// over all directions. `power`: of sending and hearing at a direction of [`turned`].
fn bottom_energy(sines: [f64; 2], angles: [f64; 2], power: impl Fn(f64, f64) -> f64) -> f64 {
    let heard = |sine: f64, angle: f64| {
        let grazing = -turned(sine, angle).z;
        if grazing <= HEIGHT / 100.0 {
            return 0.0;
        }
        let range = HEIGHT / grazing;
        power(sine, angle) * 0.1 * grazing / (range * range)
    };
    220.0 + db(integral(sines, angles, heard))
}

/// The same, from a ping.
fn heard_energy(ping: &Ping, beam: usize, resolution: f64) -> f64 {
    let sum: f64 = ping.levels(beam).iter().map(|&level| power(level.into())).sum();
    db(sum * ping.layout().bin_m / resolution)
}

/// For all patterns: side-scan, multibeam, imaging, and single beams, round and high.
#[test]
fn all_patterns_hear_the_energy_of_a_flat_bottom() {
    let scene = flat(100.0);
    let wavelength = 1500.0 / 450e3;
    let line = |width: f64| Lobe::Width(width).at(wavelength);
    let hear = |sensor: &Sensor| ping(&scene, sensor, Pose::at(0.0, 0.0, HEIGHT), &options(water("")));

    let swath = sonar("type: multibeam, beams: 5, swath_deg: 100, along_deg: 2, across_deg: 3, rays: 512", "");
    let found = hear(&swath);
    let (sent, heard) = (line(2.0), line(3.0));
    for (beam, degrees) in [50f64, 25.0, 0.0, -25.0, -50.0].into_iter().enumerate() {
        let axis = degrees.to_radians().sin();
        // Along the track is `turned`'s y, and its x to port.
        let power = |sine: f64, angle: f64| {
            sent.amplitude(sine).powi(2) * heard.amplitude(turned(sine, angle).x - axis).powi(2)
        };
        // The energy of omitted sidelobes that see the bottom straight down.
        let expected = bottom_energy([-0.3, 0.3], [-1.4, 1.4], power);
        assert_near(&format!("beam {beam} of a swath"), heard_energy(&found, beam, 0.05), expected, 0.2);
    }

    let fan =
        sonar("type: imaging, beams: 3, fov_deg: 60, beam_deg: 2, vertical_deg: 20, tilt_deg: 40, rays: 8192", "");
    let found = hear(&fan);
    let vertical = line(20.0);
    for (beam, degrees) in [30f64, 0.0, -30.0].into_iter().enumerate() {
        let axis = degrees.to_radians().sin();
        let power = |sine: f64, angle: f64| {
            line(2.0).amplitude(sine - axis).powi(2) * vertical.amplitude((angle - 50f64.to_radians()).sin()).powi(4)
        };
        let expected = bottom_energy([axis - 0.3, axis + 0.3], [-FRAC_PI_2, FRAC_PI_2], power);
        assert_near(&format!("beam {beam} of a fan"), heard_energy(&found, beam, 0.05), expected, 0.2);
    }

    let high = sonar("type: single_beam, beam_deg: 3, vertical_deg: 30, tilt_deg: 30", "");
    let power = |sine: f64, angle: f64| {
        line(3.0).amplitude(sine).powi(4) * line(30.0).amplitude((angle - 60f64.to_radians()).sin()).powi(4)
    };
    let expected = bottom_energy([-0.3, 0.3], [-FRAC_PI_2, FRAC_PI_2], power);
    assert_near("a high beam", heard_energy(&hear(&high), 0, 0.05), expected, 0.15);

    let wide = sonar("type: single_beam, beam_deg: 90, vertical_deg: 30, tilt_deg: 60, rays: 4096", "");
    let power = |sine: f64, angle: f64| {
        line(90.0).amplitude(sine).powi(4) * line(30.0).amplitude((angle - 30f64.to_radians()).sin()).powi(4)
    };
    let expected = bottom_energy([-0.999, 0.999], [-FRAC_PI_2, FRAC_PI_2], power);
    assert_near("a wide beam", heard_energy(&hear(&wide), 0, 0.05), expected, 0.2);

    for tilt in [90.0, 50.0f64] {
        let round = sonar(&format!("type: single_beam, beam_deg: 10, tilt_deg: {tilt}, rays: 4096"), "");
        let lobe = Lobe::from_yaml("{shape: piston, width_deg: 10}").unwrap().at(wavelength);
        let (sin, cos) = tilt.to_radians().sin_cos();
        let axis = DVec3::new(cos, 0.0, -sin);
        let power = |sine: f64, angle: f64| {
            let direction = turned(sine, angle);
            let along = direction.dot(axis);
            if along > 0.0 { lobe.amplitude(direction.cross(axis).length()).powi(4) } else { 0.0 }
        };
        let expected = bottom_energy([-0.9, 0.9], [-FRAC_PI_2, FRAC_PI_2], power);
        assert_near(&format!("a round beam at {tilt}"), heard_energy(&hear(&round), 0, 0.05), expected, 0.15);
    }
}

/// Energy that falls into each bin of `length` m, likewise.
/// Sonars that hear with another lobe than they send with: the product of both counts.
#[test]
fn sending_and_hearing_have_lobes_of_their_own() {
    let scene = flat(100.0);
    let hear = |sensor: &Sensor| ping(&scene, sensor, Pose::at(0.0, 0.0, HEIGHT), &options(water("")));
    let wavelength = 1500.0 / 450e3;
    // Over the sine, and over the solid angle about an axis.
    let two_way = |sent: &Lobe, heard: &Lobe, round: bool| -> f64 {
        let (sent, heard) = (sent.at(wavelength), heard.at(wavelength));
        let steps = 40_000;
        let step = 0.4 / f64::from(steps);
        let part = |index: i32| {
            let sine = (f64::from(index) + 0.5) * step;
            (sent.amplitude(sine) * heard.amplitude(sine)).powi(2) * if round { sine } else { 1.0 } * step
        };
        (0..steps).map(part).sum()
    };
    let [half, two] = [0.5, 2.0].map(Lobe::Width);
    let [alike, apart] = ["", "pattern.heard_along_deg=2"].map(|more| hear(&sidescan(more)));
    let louder = db(two_way(&half, &two, false) / two_way(&half, &half, false));
    for range in [25.0, 40.0, 60.0] {
        let found = level(&apart, 0, range, 0.5) - level(&alike, 0, range, 0.5);
        assert_near(&format!("side-scan at {range} m"), found, louder, 0.1);
    }
    let single = |more: &str| heard_energy(&hear(&sonar("type: single_beam, beam_deg: 6, rays: 4096", more)), 0, 0.05);
    let [wide, narrow] = [6.0, 3.0].map(|width| Lobe::Shape(LobeShape::Piston(Piston::Width(width))));
    let expected = db(two_way(&wide, &narrow, true) / two_way(&wide, &wide, true));
    assert_near("echo sounder", single("pattern.heard_deg=3") - single(""), expected, 0.2);
}

fn bin_levels(
    length: f64,
    bins: usize,
    frame: &dyn Fn(f64, f64) -> DVec3,
    [sines, angles]: [f64; 2],
    power: impl Fn(f64, f64) -> f64,
) -> Vec<f64> {
    /// So fine over the angle that distant bins have several steps.
    const STEPS: [usize; 2] = [600, 12_000];
    let mut sums = vec![0.0; bins];
    let middle = |half: f64, index: usize, steps: usize| half * ((2 * index + 1) as f64 / steps as f64 - 1.0);
    for at in 0..STEPS[0] * STEPS[1] {
        let (sine, angle) = (middle(sines, at / STEPS[1], STEPS[0]), middle(angles, at % STEPS[1], STEPS[1]));
        let grazing = -frame(sine, angle).z;
        if grazing > 0.05 {
            let range = HEIGHT / grazing;
            if let Some(sum) = sums.get_mut((range / length) as usize) {
                *sum += power(sine, angle) * 0.1 * grazing / (range * range);
            }
        }
    }
    let cell = 4.0 * sines * angles / (STEPS[0] * STEPS[1]) as f64;
    sums.into_iter().map(|sum| 220.0 + db(sum * cell)).collect()
}

/// A bottom that slopes across the beam: ranges change across it as much as along it.
#[test]
fn single_beams_leave_no_gaps_on_slopes() {
    let scene = flat(100.0);
    let wavelength = 1500.0 / 450e3;
    let line = |width: f64| Lobe::Width(width).at(wavelength);
    let piston = Lobe::from_yaml("{shape: piston, width_deg: 12}").unwrap().at(wavelength);
    for rays in [1024, 16384] {
        for (beam, extents) in [("beam_deg: 3, vertical_deg: 30", [0.1, 0.7]), ("beam_deg: 12", [0.35, 0.35])] {
            for roll in [0.0, 35.0, 80.0f64] {
                let sensor = sonar(&format!("type: single_beam, {beam}, tilt_deg: 40, rays: {rays}"), "");
                // About the beam's axis.
                let axis = DVec3::new(40f64.to_radians().cos(), 0.0, -40f64.to_radians().sin());
                let turn = DQuat::from_axis_angle(axis, roll.to_radians());
                let pose = Pose { position: DVec3::Z * HEIGHT, orientation: turn };
                let found = ping(&scene, &sensor, pose, &options(water("")));
                let up = DVec3::new(-axis.z, 0.0, axis.x);
                let frame = |sine: f64, angle: f64| {
                    let level = (1.0 - sine * sine).sqrt();
                    turn * (DVec3::Y * sine + (axis * angle.cos() + up * angle.sin()) * level)
                };
                let power = |sine: f64, angle: f64| match beam {
                    "beam_deg: 12" => {
                        let ahead = (1.0 - sine * sine).sqrt() * angle.cos();
                        piston.amplitude((1.0 - ahead * ahead).max(0.0).sqrt()).powi(4)
                    }
                    _ => line(3.0).amplitude(sine).powi(4) * line(30.0).amplitude(angle.sin()).powi(4),
                };
                let bin = found.layout().bin_m;
                let expected = bin_levels(bin, found.layout().bins, &frame, extents, power);
                let most = expected.iter().copied().fold(f64::MIN, f64::max);
                let mut worst = [0f64; 2];
                for (&level, expected) in found.levels(0).iter().zip(expected) {
                    if expected > most - 6.0 {
                        let off = f64::from(level) - expected - db(0.05 / bin);
                        worst = [worst[0].min(off), worst[1].max(off)];
                    }
                }
                let most = if rays == 1024 { 2.0 } else { 1.0 };
                assert!(-most < worst[0] && worst[1] < most, "{beam}, {rays} rays, rolled by {roll}: {worst:?} dB");
            }
        }
    }
}

#[test]
fn levels_depend_neither_on_bins_nor_on_rays_mesh_or_seed() {
    let scene = flat(100.0);
    let pose = Pose::at(0.0, 0.0, HEIGHT);
    let check = |what: &str, ping: &Ping, resolutions: f64, tolerance: f64| {
        for range in [25.0, 40.0, 60.0, 90.0] {
            let expected = flat_level(HEIGHT, range) + db(resolutions);
            assert_near(&format!("level at {range} m, {what}"), level(ping, 0, range, 0.5), expected, tolerance);
        }
    };
    // Bins of a tenth of the resolution to ten of it, compressed and not.
    for (kind, resolutions) in [("bandwidth_khz: 15", 1.0), ("pulse_ms: 0.1", 1.5), ("pulse_ms: 1", 15.0)] {
        for bin in [0.004, 0.02, 0.0375, 0.05, 0.06, 0.1, 0.13, 0.5] {
            let mut sensor = sidescan("");
            let sound = format!(
                "{{frequency_khz: 450, source_level_db: 220, noise_level_db: -200, speckle: off, bin_m: {bin}, {kind}}}"
            );
            sensor.set("acoustics", &sound).unwrap();
            let found = ping(&scene, &sensor, pose, &options(water("")));
            // Sidelobes beyond the fourth, 0.1 dB, are left out.
            check(&format!("bins of {bin} m, {kind}"), &found, resolutions, 0.2);
        }
    }
    for rays in [512, 1024, 16384] {
        let sensor = sidescan(&format!("pattern.rays={rays}"));
        check(&format!("{rays} rays"), &ping(&scene, &sensor, pose, &options(water(""))), 1.0, 0.15);
    }
    let fine = ping(&flat(2.0), &sidescan(""), pose, &options(water("")));
    check("fine mesh", &fine, 1.0, 0.15);
    let first = ping(&scene, &sidescan(""), pose, &options(water("")));
    let other = ping(&scene, &sidescan(""), pose, &options(water("")).seed(5));
    for (bin, (a, b)) in first.levels(0).iter().zip(other.levels(0)).enumerate() {
        // Only noise has a seed.
        assert!(a == b || a.max(*b) < -100.0, "bin {bin}: {a} {b}");
    }
    for (bin, (a, b)) in first.levels(0).iter().zip(fine.levels(0)).enumerate() {
        assert!((a - b).abs() < 1e-2 || a.max(*b) < 0.0, "bin {bin}: {a} {b} on the fine mesh");
    }
}

#[test]
fn spreading_and_absorption_are_those_of_the_law() {
    let scene = flat(100.0);
    let hear = |water: &str| {
        let yaml =
            format!("water: {{surface_z_m: 50, wind_m_s: 0, profile: {{constant: {{speed_m_s: 1500}}}}, {water}}}");
        ping(&scene, &sidescan(""), Pose::at(0.0, 0.0, HEIGHT), &options(Environment::from_yaml(&yaml).unwrap()))
    };
    for (law, loss) in [
        ("ray_tube", (|r| 40.0 * f64::log10(r)) as fn(f64) -> f64),
        ("spherical", |r| 40.0 * r.log10()),
        ("practical", |r| 30.0 * r.log10()),
        ("cylindrical", |r| 20.0 * r.log10()),
        ("hybrid, spreading_from_m: 40", |r| 40.0 * r.min(40.0).log10() + 20.0 * (r / 40.0).max(1.0).log10()),
    ] {
        let found = hear(&format!("absorption: none, spreading: {law}"));
        for range in [25.0, 35.0, 60.0, 90.0] {
            let expected = flat_level(HEIGHT, range) + 40.0 * range.log10() - loss(range);
            assert_near(&format!("{law} at {range} m"), level(&found, 0, range, 0.25), expected, 0.1);
        }
    }
    for (name, law) in [("francois_garrison", Absorption::FrancoisGarrison), ("thorp", Absorption::Thorp)] {
        let found = hear(&format!("absorption: {name}"));
        // At the middle of the path: it hardly changes over 20 m.
        let rate = law.db_per_km(450e3, 10.0, 35.0, 8.0, 40.0) * 1e-3;
        for range in [25.0, 35.0, 60.0, 90.0] {
            let expected = flat_level(HEIGHT, range) - 2.0 * rate * range;
            assert_near(&format!("{name} at {range} m"), level(&found, 0, range, 0.25), expected, 0.1);
        }
    }
}

/// Reported range and level of the ray that leaves at a grazing angle, from its neighbours.
fn bent(environment: &Environment, degrees: f64, loss: f64) -> (f64, f64) {
    let water = environment.water.as_ref().unwrap();
    let at = |degrees: f64| {
        let mut ray = SoundRay::new(water, 450e3, 30.0, degrees, 50.0).unwrap();
        loop {
            let (point, event) = ray.next_event().unwrap();
            if event == echocast::medium::RayEvent::Bottom {
                return point;
            }
        }
    };
    let step = 1e-3;
    let (here, before, after) = (at(degrees), at(degrees - step), at(degrees + step));
    let slope = |low: f64, high: f64| ((high - low) / (2.0 * step).to_radians()).abs();
    let start = degrees.to_radians();
    // Area that a steradian covers across the ray.
    let tube = here.distance_m / start.cos() * slope(before.distance_m, after.distance_m) * here.grazing.sin();
    let believed = 1500.0;
    let spread = believed * slope(before.time_s, after.time_s);
    let wavelength = 1500.0 / 450e3;
    let (along, vertical) = (Lobe::Width(0.5).at(wavelength), Lobe::Width(50.0).at(wavelength));
    let steps = 20_000;
    let width: f64 = (0..steps)
        .map(|i| along.amplitude(((f64::from(i) + 0.5) * 0.2 / f64::from(steps) - 0.1).sin()).powi(4) * 0.2)
        .sum::<f64>()
        / f64::from(steps);
    let beam = vertical.amplitude((start - 30f64.to_radians()).sin()).powi(4);
    // A sonar at 1500 m/s. What lands on the footprint of d(omega) is p^2 dA = (c / c0) d(omega), and returns over the
    // same tube: p^2 = (c / c0) / tube, both ways the same (reciprocity).
    let speeds = here.speed_m_s / 1500.0;
    let power = 0.1 * here.grazing.sin() * beam * width * 0.05 / spread * speeds * speeds / tube;
    (believed * here.time_s, 220.0 + db(power) - 2.0 * (here.loss_db - loss))
}

#[test]
fn levels_in_bending_water_are_those_of_ray_tubes() {
    let scene = flat(100.0);
    for profile in [
        // Slower, and faster, with depth; then layers, whose boundaries cause losses.
        "{cast: [{depth_m: 0, speed_m_s: 1530}, {depth_m: 30, speed_m_s: 1500}, {depth_m: 60, speed_m_s: 1400}]}",
        "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 30, speed_m_s: 1500}, {depth_m: 60, speed_m_s: 1560}]}",
        "{layers: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 36, speed_m_s: 1440}]}",
        "{layers: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 36, speed_m_s: 1400, density_kg_m3: 1100}, {depth_m: 42, \
         speed_m_s: 1600}]}",
    ] {
        let yaml = format!(
            "water: {{surface_z_m: 50, wind_m_s: 0, absorption: none, assumed_speed_m_s: 1500, profile: {profile}}}"
        );
        let environment = Environment::from_yaml(&yaml).unwrap();
        let found = ping(&scene, &sidescan(""), Pose::at(0.0, 0.0, HEIGHT), &options(environment.clone()));
        for degrees in [60.0, 45.0, 30.0, 24.0] {
            let (range, expected) = bent(&environment, degrees, 0.0);
            let what = format!("{degrees} degrees, {range} m, {profile}");
            assert_near(&what, level(&found, 0, range, 0.25), expected, 0.06);
        }
    }
}

#[test]
fn a_boundary_without_contrast_changes_no_level() {
    let scene = flat(100.0);
    let hear = |profile: &str| {
        let yaml = format!("water: {{surface_z_m: 50, wind_m_s: 0, absorption: none, profile: {profile}}}");
        ping(&scene, &sidescan(""), Pose::at(0.0, 0.0, HEIGHT), &options(Environment::from_yaml(&yaml).unwrap()))
    };
    let without = hear("{constant: {speed_m_s: 1500}}");
    let row = |depth: f64, speed: f64| format!("{{depth_m: {depth}, speed_m_s: {speed}}}");
    let many: Vec<String> = (0..10).map(|row_| row(f64::from(row_) * 5.0, 1500.0)).collect();
    // Below the bottom the water differs, so that rays are followed layer by layer.
    for profile in [
        format!("{{layers: [{}]}}", many.join(", ")),
        format!("{{layers: [{}, {}]}}", many.join(", "), row(60.0, 1450.0)),
        format!("{{layers: [{}, {}]}}", row(0.0, 1500.0), row(60.0, 1450.0)),
        format!("{{cast: [{}, {}, {}]}}", row(0.0, 1500.0), row(60.0, 1500.0), row(90.0, 1450.0)),
    ] {
        let with = hear(&profile);
        for (bin, (a, b)) in without.levels(0).iter().zip(with.levels(0)).enumerate() {
            // A ray at the edge of a bin may fall to either side.
            let range = without.layout().range(bin);
            assert!((a - b).abs() < 2e-2 || a.max(*b) < 0.0, "{profile}: {a} {b} at {range} m");
        }
        for range in [25.0, 50.0, 75.0, 95.0] {
            let expected = level(&without, 0, range, 1.0);
            assert_near(&format!("{profile}, {range} m"), level(&with, 0, range, 1.0), expected, 1e-3);
        }
    }
}

/// What a boundary reflects is missing, there and back.
#[test]
fn a_boundary_takes_what_it_reflects_both_ways() {
    let scene = flat(100.0);
    let sensor = sonar("type: single_beam, beam_deg: 2, rays: 256", "");
    for density in [1026.0, 1100.0, 1400.0] {
        let profile = format!(
            "{{layers: [{{depth_m: 0, speed_m_s: 1500, density_kg_m3: 1000}}, {{depth_m: 40, speed_m_s: 1500, \
             density_kg_m3: {density}}}]}}"
        );
        let yaml = format!("water: {{surface_z_m: 50, wind_m_s: 0, absorption: none, profile: {profile}}}");
        let hear = |environment| {
            heard_energy(&ping(&scene, &sensor, Pose::at(0.0, 0.0, HEIGHT), &options(environment)), 0, 0.05)
        };
        let (without, with) = (hear(water("")), hear(Environment::from_yaml(&yaml).unwrap()));
        let left = Fluid::new(1000.0, 1500.0).transmittance(&Fluid::new(density, 1500.0), 1.0);
        assert_near(&format!("loss of {density} kg/m^3"), with - without, 2.0 * db(left), 2e-3);
    }
}

#[test]
fn surfaces_differ_by_their_laws() {
    let sensor = sidescan("");
    let lambert = ping(&flat(100.0), &sensor, Pose::at(0.0, 0.0, HEIGHT), &options(water("")));
    let mut laws = vec![
        Sound::Facet { mu_db: -15.0, slope_sigma_deg: 10.0, reflection_loss_db: 9.0 },
        Sound::Gsab { a_db: -5.0, b_deg: 5.0, c_db: -20.0, d: 1.5, e_db: -18.0, f_deg: 20.0 },
    ];
    laws.extend(Sediment::ALL.map(|name| Sound::Sediment { name }));
    for law in laws {
        let found = ping(&bottom(law.clone(), 100.0), &sensor, Pose::at(0.0, 0.0, HEIGHT), &options(water("")));
        for range in [26.0, 30.0, 50.0, 80.0] {
            let sine: f64 = HEIGHT / range;
            let expected = db(law.backscatter(sine, 450e3) / (0.1 * sine * sine));
            let difference = level(&found, 0, range, 0.25) - level(&lambert, 0, range, 0.25);
            assert_near(&format!("{law:?} at {range} m"), difference, expected, 0.05);
        }
    }
    // Straight down facets are mirrors, R / (8 pi s^2) over mu.
    let sounder = sonar("type: single_beam, beam_deg: 1, rays: 256", "");
    let facet = Sound::Facet { mu_db: -10.0, slope_sigma_deg: 10.0, reflection_loss_db: 9.0 };
    let below = |scene: &BuiltScene| {
        heard_energy(&ping(scene, &sounder, Pose::at(0.0, 0.0, HEIGHT), &options(water(""))), 0, 0.05)
    };
    let slope = 10f64.to_radians().tan();
    let expected = db(1.0 + power(-9.0) / (8.0 * PI * slope * slope) / 0.1);
    assert_near("facets straight down", below(&bottom(facet, 100.0)) - below(&flat(100.0)), expected, 0.05);
    assert!(expected > 3.0);
}

/// Upwards, at the depth of the sonar, and nowhere else.
#[test]
fn the_sea_surface_is_heard_at_the_depth_of_the_sonar() {
    let environment = |wind: f64| {
        let profile = "profile: {constant: {speed_m_s: 1500}}";
        let yaml = format!("water: {{surface_z_m: 50, absorption: none, wind_m_s: {wind}, {profile}}}");
        Environment::from_yaml(&yaml).unwrap()
    };
    let up = sonar("type: single_beam, beam_deg: 1, tilt_deg: -90, rays: 512", "acoustics.source_level_db=220");
    for wind in [2.0, 10.0] {
        let found = ping(&nothing(), &up, Pose::at(0.0, 0.0, 30.0), &options(environment(wind)));
        let depth = found.soundings()[0].range;
        assert_near("depth of the sonar", depth.into(), 20.0, 0.03);
        let cell = found.soundings()[0].cell as usize;
        let c = found.cells();
        assert_eq!((c.cause()[cell], c.category_id()[cell], c.instance_id()[cell], c.bounces()[cell]), (10, 0, 0, 0));
        assert_near("height of what is heard", (f64::from(c.true_z()[cell])) + found.origin.z, 50.0, 1e-3);
        assert_near("normal", c.normal_z()[cell].into(), -1.0, 1e-6);
        // Like a bottom of the same strength straight up: 1 degree changes nothing.
        let (law, lambert) = (Sea { wind_m_s: wind }.backscatter(1.0, 450e3), 0.1);
        let down = set(up.clone(), "pattern.tilt_deg=90");
        let below = ping(&flat(100.0), &down, Pose::at(0.0, 0.0, 20.0), &options(water("")));
        let found = heard_energy(&found, 0, 0.05);
        assert_near(&format!("{wind} m/s"), found - heard_energy(&below, 0, 0.05), db(law / lambert), 0.1);
        assert!(below.cells().cause().iter().all(|&cause| cause != 10));
    }
}
