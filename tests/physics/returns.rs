//! Beams of several rays, and beams with several returns.

use super::{assert_near, scan};
use echocast::scene::Material;
use echocast::{BuiltScene, Cause, Environment, PointCloud, Pose, ScanOptions, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape, one_beam};
use glam::DVec3;

/// A board of 0.5 across the x axis at `near` m that covers everything left of `edge` m, and a wall at `far` m.
fn edge(near: f64, edge: f64, far: f64) -> BuiltScene {
    edge_of(near, edge, far, 0.5)
}

fn edge_of(near: f64, edge: f64, far: f64, reflectance: f64) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.5);
    scene.stand(Shape::quad([near, edge, -2.0].into(), 4.0 * DVec3::Y, 4.0 * DVec3::Z), Some(paint));
    let paint = scene.reflector(reflectance as f32);
    scene.stand(Shape::plate(DVec3::X * far, -DVec3::X, 5.0), Some(paint));
    scene.finish().build().unwrap()
}

fn look(scene: &BuiltScene, sections: &str, frame: u32) -> PointCloud {
    scan(scene, &one_beam(sections), ScanOptions::default().frame(frame))
}

fn sections(sub_rays: impl std::fmt::Display, returns: &str) -> String {
    format!(
        "beam: {{divergence_mrad: [3.0, 1.5], exit_diameter_mm: 12, pulse_ns: 5, sub_rays: {sub_rays}}}\n\
         returns: {returns}\nintensity: {{encoding: reflectivity}}"
    )
}

/// The light of the board in front is `(1 + erf(sqrt 2 x0/w))/2` of the beam's, that of the wall behind the rest.
#[test]
fn an_edge_divides_the_beam() {
    let w = f64::hypot(6e-3, 1.5e-3 * 10.0);
    for (sub_rays, most) in [(64, 0.06), (256, 0.025)] {
        let sections = sections(sub_rays, "{mode: all}");
        // Values of the error function.
        for (x0, expected) in [(0.25, 0.691_462), (0.5, 0.841_345), (-0.5, 1.0 - 0.841_345), (1.0, 0.977_250)] {
            let built = edge(10.0, -x0 * w, 30.0);
            for frame in 0..20 {
                let c = look(&built, &sections, frame).into_columns();
                let near = if c.range()[0] < 20.0 { c.intensity()[0] } else { 0.0 };
                assert_near("share of the board", f64::from(near) / 0.5, expected, most);
                let all: f32 = c.intensity().iter().sum();
                // Where a few rays get past, their echo counts too; nothing is lost or gained.
                assert_near("light", all.into(), 0.5, 2e-6);
            }
        }
    }
}

/// Beams of as many rays as it takes divide as those of 64 do, from a fraction of the rays: all else is computed from the
/// triangles that these show.
#[test]
fn few_rays_divide_the_beam_as_many() {
    // Lying on its side, so that the rim of the footprint that is looked at is beyond the edge.
    let rolled = Trajectory::fixed(Pose::default().with_rpy_deg(90.0, 0.0, 0.0));
    let w = f64::hypot(6e-3, 0.75e-3 * 10.0);
    let sensor = one_beam(&sections("adaptive", "{mode: all}"));
    for (x0, expected) in [(0.25, 0.691_462), (0.5, 0.841_345), (1.0, 0.977_250)] {
        let built = edge(10.0, -x0 * w, 30.0);
        for frame in 0..20 {
            let cloud = built.scan(&sensor, &rolled, &ScanOptions::default().frame(frame)).unwrap();
            assert!((4..32).contains(&cloud.rays), "{} rays", cloud.rays);
            let c = cloud.into_columns();
            let near = if c.range()[0] < 20.0 { c.intensity()[0] } else { 0.0 };
            assert_near("share of the board", f64::from(near) / 0.5, expected, 0.06);
            assert_near("light", c.intensity().iter().sum::<f32>().into(), 0.5, 2e-6);
        }
    }
}

/// Two equally strong echoes of 5 ns have one maximum up to 2 sigma = 0.637 m.
#[test]
fn echoes_join_within_the_pulse() {
    let sections = sections(256, "{mode: all}");
    for frame in 0..10 {
        let equal = |far: f64| edge_of(10.0, 0.0, far, 0.5 * (far / 10.0).powi(2));
        let joined = look(&equal(10.6), &sections, frame);
        let c = joined.columns();
        assert_eq!((joined.len(), c.cause()[0]), (1, Cause::Mixed as u8));
        assert!((10.1..10.5).contains(&c.range()[0]), "{}", c.range()[0]);
        assert_eq!(c.true_range()[0], c.range()[0]);
        let apart = look(&equal(10.7), &sections, frame);
        let c = apart.columns();
        assert_eq!((apart.len(), c.return_number(), c.return_count()), (2, &[1, 2][..], &[2, 2][..]));
        assert_eq!(c.beam(), [0, 0]);
        assert!((c.range()[0] - 10.0).abs() < 0.25 && (c.range()[1] - 10.7).abs() < 0.25, "{:?}", c.range());
    }
    let far = look(&edge(10.0, 0.0, 13.0), &sections, 0);
    assert_eq!(far.columns().cause(), [Cause::Surface as u8; 2]);
    assert_near("near", far.columns().range()[0].into(), 10.0, 1e-4);
    assert_near("far", far.columns().range()[1].into(), 13.0, 1e-4);
}

/// A fan over posts before a wall, and a floor: adaptive beams have nearly all the second returns and mixed points that 64
/// rays for every beam have (of a post that takes less than one of 16 rays some miss the return), and the power of oblique
/// surfaces, for which they send one ray.
#[test]
fn adaptive_beams_find_what_many_rays_do() {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.4);
    scene.stand(Shape::plate(DVec3::new(0.0, 0.0, -1.5), DVec3::Z, 60.0), Some(paint));
    scene.stand(Shape::plate(DVec3::X * 25.0, -DVec3::X, 60.0), Some(paint));
    for post in -12..=12 {
        let y = 0.9 * f64::from(post);
        // The nearer ones have an echo of their own, the others share that of the wall.
        for (x, y) in [(12.0, y), (24.6, 1.7 * y)] {
            let (low, high) = (DVec3::new(x, y, -1.5), DVec3::new(x + 0.05, y + 0.06 + 0.005 * y.abs(), 1.0));
            scene.stand(Shape::cuboid(low, high), Some(paint));
        }
    }
    let built = scene.finish().build().unwrap();
    let sensor = |sub_rays: &str| {
        let text = format!(
            "{{name: fan, kind: lidar, pattern: {{type: raster, azimuth: {{fov_deg: 80, step_deg: 0.2}}, elevation: \
             {{fov_deg: 20, step_deg: 1.3}}}}, range: {{min_m: 0.5, max_m: 100}}, beam: {{divergence_mrad: [3.0, 1.5], \
             pulse_ns: 5, sub_rays: {sub_rays}}}, returns: {{mode: all}}, intensity: {{encoding: reflectivity}}, \
             detection: {{model: radar_equation, reflectance: 0.1, at_m: 80}}}}"
        );
        echocast::Sensor::from_yaml(&text, "").unwrap()
    };
    let [one, all, ours] =
        ["1", "64", "adaptive"].map(|sub_rays| scan(&built, &sensor(sub_rays), ScanOptions::default()));
    let beams = |cloud: &PointCloud, is: &dyn Fn(usize) -> bool| -> std::collections::BTreeSet<u32> {
        (0..cloud.len()).filter(|&row| is(row)).map(|row| cloud.columns().beam()[row]).collect()
    };
    for what in ["second returns", "mixed points"] {
        let [one, all, ours] = [&one, &all, &ours].map(|cloud| {
            let c = cloud.columns();
            beams(cloud, &|row| match what {
                "second returns" => c.return_count()[row] > 1,
                _ => c.cause()[row] == Cause::Mixed as u8,
            })
        });
        let found = all.intersection(&ours).count() as f64 / all.len() as f64;
        assert!(all.len() > 20 && one.is_empty() && found >= 0.92, "{what}: {found} of {}", all.len());
        let own = ours.difference(&all).count() as f64 / all.len() as f64;
        assert!(own <= 0.05, "{what} of their own: {own}");
    }
    // Where both see the floor alone: it is oblique, and its echo lower than that of one ray.
    let floor = |cloud: &PointCloud| -> std::collections::BTreeMap<u32, f64> {
        let c = cloud.columns();
        (0..cloud.len())
            .filter(|&row| {
                c.return_count()[row] == 1 && c.cause()[row] == Cause::Surface as u8 && c.normal_z()[row] > 0.9
            })
            .map(|row| (c.beam()[row], f64::from(c.intensity()[row])))
            .collect()
    };
    let [one, all, ours] = [&one, &all, &ours].map(floor);
    let (mut lowest, mut compared, mut astray) = (1.0f64, 0, 0);
    for (beam, all) in &all {
        if let (Some(one), Some(ours)) = (one.get(beam), ours.get(beam)) {
            astray += usize::from((ours / all - 1.0).abs() > 0.02);
            lowest = lowest.min(ours / one);
            compared += 1;
        }
    }
    // Of some the wall has a part too small to be called mixed.
    assert!(100 * astray < compared, "{astray} of {compared}");
    assert!(compared > 1000 && lowest < 0.97, "{compared} beams, lowest {lowest}");
}

/// On a plain wall many rays see the same as one.
#[test]
fn a_wall_across_the_beam_is_one_echo() {
    let built = super::target(0.5, 40.0, 0.0);
    for sub_rays in [1, 2, 19, 64] {
        let c = look(&built, &sections(sub_rays, "{mode: strongest}"), 3).into_columns();
        assert_near("range", c.range()[0].into(), 40.0, 2e-4);
        assert_near("intensity", c.intensity()[0].into(), 0.5, 2e-5);
        assert_eq!((c.cause()[0], c.return_count()[0]), (Cause::Surface as u8, 1));
        assert_near("x", c.x()[0].into(), 40.0, 2e-4);
        assert_near("y", c.y()[0].into(), 0.0, 1e-6);
    }
}

/// A surface tilted by 75 degrees at 100 m under a half angle of 1.5 mrad: the echo's sigma grows from 2.12330 to
/// 2.82760 ns, and its peak falls in proportion.
#[test]
fn tilted_surfaces_stretch_the_echo() {
    let built = super::target(0.5, 100.0, 75.0);
    let sections = "beam: {divergence_mrad: 3, exit_diameter_mm: 0, pulse_ns: 5, sub_rays: 512}\nreturns: {mode: all}";
    let cos = 75f64.to_radians().cos();
    for frame in 0..5 {
        let cloud = look(&built, sections, frame);
        let c = cloud.columns();
        assert_eq!((cloud.len(), c.cause()[0]), (1, Cause::Surface as u8));
        assert_near("range", c.range()[0].into(), 100.0, 5e-3);
        assert_near("peak", f64::from(c.intensity()[0]) / (0.5 * cos), 2.123_30 / 2.827_60, 0.01);
    }
}

/// Ground at 40 m under 2.6 degrees: its echo is many pulses long, but a single one.
#[test]
fn grazed_ground_is_one_echo() {
    let (range, grazing) = (40.0, 2.6f64.to_radians());
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.5);
    let normal = DVec3::new(-grazing.sin(), 0.0, grazing.cos());
    scene.stand(Shape::plate(range * DVec3::X, normal, 200.0), Some(paint));
    let built = scene.finish().build().unwrap();
    // Half angle 2.5 mrad: w = 0.1 m, so that the ranges spread by w/2 / tan(2.6 deg) = 1.101 m around a pulse of
    // 0.318275 m.
    let expected = 0.5 * grazing.sin() * 0.318_275 / f64::hypot(0.318_275, 0.05 / grazing.tan());
    for (sub_rays, range_error, peak_error) in [(19, 0.3, 0.15), (64, 0.15, 0.06), (256, 0.1, 0.02)] {
        let sections = format!(
            "beam: {{divergence_mrad: 5, exit_diameter_mm: 0, pulse_ns: 5, sub_rays: {sub_rays}}}\nreturns: {{mode: all}}"
        );
        for frame in 0..8 {
            let cloud = look(&built, &sections, frame);
            let c = cloud.columns();
            assert_eq!((cloud.len(), c.cause()[0]), (1, Cause::Surface as u8), "{sub_rays}");
            // Nearer parts return more: the echo comes 0.06 m early.
            assert_near("range", c.range()[0].into(), range, range_error);
            assert_near("peak", f64::from(c.intensity()[0]) / expected, 1.0, peak_error);
        }
    }
}

/// A cloud of dust in front of a wall: both are seen, each with its cause.
#[test]
fn dust_and_what_is_behind_it_are_two_returns() {
    let built = super::target(0.5, 30.0, 0.0);
    let dust = "{dust: {radius_um: 50, per_m3: 1e6, start_m: 5, length_m: 12.5}}";
    for sub_rays in [1, 19] {
        let sections =
            sections(sub_rays, "{mode: dual}") + "\ndetection: {model: radar_equation, reflectance: 0.1, at_m: 100}";
        let options = ScanOptions::default().environment(Environment::from_yaml(dust).unwrap());
        let cloud = scan(&built, &one_beam(&sections), options);
        let c = cloud.columns();
        // The wall is the strongest and the last, so the first of the two is the dust.
        assert_eq!(c.cause(), [Cause::Dust as u8, Cause::Surface as u8]);
        assert_eq!((c.category_id()[0], c.return_count()[0]), (0, 2));
        assert_near("dust", c.range()[0].into(), 5.5, 0.1);
        assert_near("wall", c.range()[1].into(), 30.0, 2e-4);
        assert_near("intensity", c.intensity()[1].into(), 0.5 * (-2.0f64 * 7.853_98e-3 * 12.5).exp(), 1e-5);
    }
}

/// Half a mirror, half a painted surface: its own echo and that of what it shows.
#[test]
fn half_a_mirror_gives_two_returns() {
    let half = 0.5f64.sqrt();
    let mut scene = SceneBuilder::new();
    let wall = scene.reflector(0.5);
    scene.stand(Shape::plate([5.0, 7.0, 0.0].into(), -DVec3::Y, 2.0), Some(wall));
    let mirror = scene.material(Material::default().metallic(0.5).roughness(0.0));
    scene.stand(Shape::plate([5.0, 0.0, 0.0].into(), DVec3::new(-half, half, 0.0), 1.0), Some(mirror));
    let built = scene.finish().build().unwrap();
    for sub_rays in [1, 19] {
        let cloud = look(&built, &sections(sub_rays, "{mode: all}"), 0);
        let c = cloud.columns();
        assert_eq!(c.cause(), [Cause::Surface as u8, Cause::Mirror as u8]);
        assert_eq!((c.bounces(), c.return_number()), (&[0, 1][..], &[1, 2][..]));
        // A few rays lie on a tilted surface slightly to one side.
        assert_near("near", c.range()[0].into(), 5.0, 2e-3);
        assert_near("far", c.range()[1].into(), 12.0, 2e-3);
        assert_ne!(c.instance_id()[0], c.instance_id()[1]);
        assert_eq!(c.first_instance_id(), [c.instance_id()[0]; 2]);
    }
}

/// An echo reported twice, and one reported alone in another mode, have the same errors.
#[test]
fn errors_belong_to_the_echo() {
    let built = super::target(0.5, 20.0, 0.0);
    let noise = "\nnoise: {range_sigma_m: 0.1, azimuth_sigma_deg: 0.1}";
    let of = |mode: &str| look(&built, &(sections(1, &format!("{{mode: {mode}}}")) + noise), 5).into_columns();
    let (alone, twice, all) = (of("strongest"), of("dual"), of("all"));
    assert_eq!((twice.return_number(), twice.return_count()), (&[1, 2][..], &[2, 2][..]));
    assert_eq!(twice.range(), [alone.range()[0]; 2]);
    assert_eq!((all.range(), all.x(), all.azimuth()), (alone.range(), alone.x(), alone.azimuth()));
    assert!((alone.range()[0] - 20.0).abs() > 1e-3);
}

/// Many returns of many beams: in order, counted, and none but those of the hits.
#[test]
fn returns_come_beam_by_beam() {
    let built = edge(10.0, 0.0, 14.0);
    let yaml = "{name: a, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 60, step_deg: 0.05}, \
                elevation: {fov_deg: 4, step_deg: 1}}, beam: {divergence_mrad: 3, pulse_ns: 5, sub_rays: 7}, \
                returns: {mode: all, max: 3}, noise: {dropout: 0.1}, range: {max_m: 20}}";
    let mut sensor = echocast::Sensor::from_yaml(yaml, "").unwrap();
    let cloud = scan(&built, &sensor, ScanOptions::default());
    let c = cloud.columns();
    assert!(c.beam().windows(2).all(|pair| pair[0] <= pair[1]));
    let mut doubles = 0;
    let mut row = 0;
    while row < cloud.len() {
        let count = usize::from(c.return_count()[row]);
        let beam = c.beam()[row];
        let same = c.beam()[row..].iter().take_while(|&&other| other == beam).count();
        assert_eq!((same, count), (count, same));
        for number in 0..count {
            assert_eq!(usize::from(c.return_number()[row + number]), number + 1);
        }
        doubles += usize::from(count > 1);
        row += count;
    }
    // Five lines of beams pass the edge, a few of each with rays on both sides.
    assert!((5..200).contains(&doubles), "{doubles}");
    // Every beam has its row in an organised cloud, so it has one return.
    let organised = ScanOptions::default().organised(true);
    let error = built.scan(&sensor, &Trajectory::fixed(Pose::IDENTITY), &organised).unwrap_err().to_string();
    assert_eq!(
        error,
        "organised is 3 returns per beam; allowed: one return per beam (returns.mode: strongest, first, last or second)"
    );
    sensor.set("returns.mode", "last").unwrap();
    let cloud = scan(&built, &sensor, organised);
    assert_eq!(cloud.len(), sensor.beams().len());
    assert!(cloud.columns().range().iter().any(|range| range.is_nan()));
}

/// The explanation of a beam: the path over the mirror, the weather on it, and the reported echo.
#[test]
fn a_beam_is_explained_step_by_step() {
    let half = 0.5f64.sqrt();
    let mut scene = SceneBuilder::new();
    let wall = scene.reflector(0.5);
    scene.stand(Shape::plate([5.0, 7.0, 0.0].into(), -DVec3::Y, 2.0), Some(wall));
    let mirror = Material::default().name("silver").metallic(1.0).roughness(0.0);
    let mirror = scene.material(mirror);
    scene.stand(Shape::plate([5.0, 0.0, 0.0].into(), DVec3::new(-half, half, 0.0), 1.0), Some(mirror));
    let built = scene.finish().build().unwrap();
    let sensor = one_beam("beam: {pulse_ns: 5}\ndetection: {model: radar_equation, reflectance: 0.1, at_m: 100}");
    let options =
        ScanOptions::default().environment(Environment::from_yaml("{clear_air: {visibility_m: 2000}}").unwrap());
    let trajectory = Trajectory::fixed(Pose::IDENTITY);
    let text = built.explain(&sensor, &trajectory, &options, 0).unwrap();
    for expected in [
        "beam 0: row 0, column 0, channel 0",
        "azimuth 0.0000 deg",
        "material silver) at 5.0000 m, incidence 45.00 deg",
        "  1 hits ",
        "    weather: optical depth 0.00678, two-way transmittance 0.9865",
        "    light continues from there",
        "after 0 events: ",
        "after 1 event in a mirror",
        ", range 12.0000 m, incidence 0.0",
        "echoes, of which those of 1.0000e-5 /m^2 and more are detected",
        "  12.0000 m",
        "reported",
        "  returns.mode: strongest\n",
        "1 of 1: range 12.0000 m (+0.0 mm)",
        ", cause mirror, at",
    ] {
        assert!(text.contains(expected), "{expected} is not in\n{text}");
    }
    let error = built.explain(&sensor, &trajectory, &options, 1).unwrap_err().to_string();
    assert_eq!(error, "beam is 1; allowed: 0 to 0");
}
