use super::{assert_near, scan};
use echocast::material::Reflectance;
use echocast::scene::Material;
use echocast::{BuiltScene, Cause, Environment, PointCloud, Pose, Profile, ScanOptions, Trajectory};
use echocast_tests::reference::{Random, SceneBuilder, Shape, Table, one_beam, raster, sensor};
use glam::{DAffine3, DVec3};

fn mirror(reflectance: f32) -> Material {
    let reflectance = Some(Reflectance::Constant(reflectance));
    Material::default().name("mirror").reflectance(reflectance).metallic(1.0).roughness(0.0)
}

fn glass(ior: f32) -> Material {
    Material::default().name("glass").transmission(1.0).roughness(0.0).ior(ior)
}

/// How far from their line, m, rays go on that start slightly off a surface 4 m away, which they must not meet again;
/// and two steps of single precision at 10 m, by which processors differ.
const BESIDE: f64 = 2.6e-5;

/// A quadrilateral around `centre`, across `normal`.
fn plate(centre: [f64; 3], normal: [f64; 3], half: f64) -> Shape {
    Shape::plate(centre.into(), DVec3::from(normal).normalize(), half)
}

/// A wall of `reflectance` and other objects, all across the x axis or not.
fn scene(wall: Option<(Shape, f32)>, others: Vec<(Shape, Material)>) -> BuiltScene {
    let mut scene = SceneBuilder::new();
    if let Some((shape, reflectance)) = wall {
        let paint = scene.reflector(reflectance);
        scene.stand(shape, Some(paint));
    }
    for (shape, material) in others {
        let material = scene.material(material);
        scene.stand(shape, Some(material));
    }
    scene.finish().build().unwrap()
}

fn look(scene: &BuiltScene, sections: &str) -> PointCloud {
    scan(scene, &one_beam(sections), ScanOptions::default())
}

/// The mirror of the paper's figure 2 a: the target is seen behind it, along the beam, attenuated twice by the mirror.
#[test]
fn a_mirror_shows_what_it_faces() {
    let half = 0.5f64.sqrt();
    let wall = (plate([5.0, 7.0, 0.0], [0.0, -1.0, 0.0], 2.0), 0.5);
    let built = scene(Some(wall), vec![(plate([5.0, 0.0, 0.0], [-half, half, 0.0], 1.0), mirror(0.9))]);
    let cloud = look(&built, "intensity: {encoding: power}");
    let c = cloud.columns();
    assert_eq!((cloud.len(), c.cause()[0], c.bounces()[0]), (1, Cause::Mirror as u8, 1));
    assert_near("x", c.x()[0].into(), 12.0, 2e-4);
    assert_near("y", c.y()[0].into(), 0.0, 1e-6);
    assert_near("range", c.range()[0].into(), 12.0, 2e-4);
    assert_near("P_n", c.intensity()[0].into(), 8.952_47e-4, 5e-8);
    // The label is the wall's, the first surface is the mirror.
    assert_eq!(cloud.labels.category.name(c.category_id()[0]), cloud.labels.category.name(1));
    assert_ne!(c.first_category_id()[0], c.category_id()[0]);
    assert_near("normal", c.normal_y()[0].into(), -1.0, 1e-6);
    // Where the mirror faces nothing, nothing is seen.
    let empty = scene(None, vec![(plate([5.0, 0.0, 0.0], [-half, half, 0.0], 1.0), mirror(0.9))]);
    assert_eq!(look(&empty, "").len(), 0);
}

/// What is seen in a mirror is the mirror image of where the light goes, for any mirror and wall.
#[test]
fn points_in_a_mirror_are_virtual_images() {
    let random = &mut Random::new(8);
    let mut seen = 0;
    for _ in 0..100 {
        let (at, normal) = (DVec3::X * random.between(2.0, 30.0), random.direction());
        let (place, facing) = (at + random.in_cube(20.0), random.direction());
        let wall = (Shape::plate(place, facing, 30.0), 0.5);
        let built = scene(Some(wall), vec![(Shape::plate(at, normal, 1.0), mirror(1.0))]);
        let cloud = look(&built, "");
        // The beam reflected at the mirror, up to the wall.
        let turned = DVec3::X - 2.0 * normal.x * normal;
        let length = facing.dot(place - at) / facing.dot(turned);
        // Distant walls are met at a low angle; a wall in front of the mirror hides it.
        if cloud.is_empty() || cloud.columns().cause()[0] != Cause::Mirror as u8 || length > 100.0 {
            continue;
        }
        let met = at + length * turned;
        let image = met - 2.0 * (met - at).dot(normal) * normal;
        let slope = 1.0 / (facing.dot(turned) * normal.x).abs();
        let off = (cloud.position(0) - image).length();
        assert!(off < 2e-6 * (at.x + length) * slope, "{off} m off, {slope}");
        seen += 1;
    }
    assert!(seen > 20, "{seen}");
}

/// A metal by its index: 89.0411 % for 2 + 8i head-on, there and back.
#[test]
fn metals_reflect_by_their_index() {
    let metal = mirror(1.0).ior(2.0).extinction_index(8.0);
    // Head-on the mirror shows what is behind the sensor.
    let built = scene(
        Some((plate([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0), 0.5)),
        vec![(plate([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0), metal)],
    );
    let cloud = look(&built, "");
    assert_near("intensity", cloud.columns().intensity()[0].into(), 0.5 * 0.890_411f64.powi(2), 1e-6);
    assert_near("range", cloud.columns().range()[0].into(), 13.0, 2e-4);
}

/// Metals at every angle, gold and copper among them, whose index is below 1: the target behind the sensor, or beside the
/// mirror, is seen in it.
#[test]
fn metals_follow_their_table() {
    let table = Table::parse(include_str!("../data/fresnel_conductor.csv"), ',');
    assert_eq!(table.len(), 30);
    let mut below_one = 0;
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let (n, k, degrees) = (number("n"), number("k"), number("theta_i_deg"));
        // At grazing incidence no beam meets it.
        if degrees > 89.0 {
            continue;
        }
        below_one += usize::from(n < 1.0);
        let text = format!("name: metal\nmetallic: 1\nroughness: 0\nreflectance: 1\nior: {n}\nextinction_index: {k}");
        let metal = Material::from_yaml(&text).unwrap();
        let (sin, cos) = degrees.to_radians().sin_cos();
        let normal = DVec3::new(-cos, sin, 0.0);
        // From the mirror, 5 m away, light goes on to a wall 8 m farther.
        let mirrored = DVec3::X + 2.0 * cos * normal;
        let wall = Shape::plate(5.0 * DVec3::X + 8.0 * mirrored, -mirrored, 0.5);
        let cloud = look(&scene(Some((wall, 0.5)), vec![(Shape::plate(5.0 * DVec3::X, normal, 20.0), metal)]), "");
        let expected = 0.5 * number("R_unpolarised").powi(2);
        assert_near(&format!("row {row}"), cloud.columns().intensity()[0].into(), expected, 2e-6);
    }
    assert!(below_one > 5);
}

/// In the paper's program each face of a transmitting mesh is one boundary, with or without a volume: light that enters
/// a single sheet at 45 degrees stays bent, by 45 - asin(sin 45 / 1.5) = 16.874 degrees.
#[test]
fn the_program_knows_no_panes() {
    let (sin, cos) = 45f64.to_radians().sin_cos();
    let bent = 45.0 - (sin / 1.5).asin().to_degrees();
    let wall = || Some((plate([10.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5));
    for material in [glass(1.5), glass(1.5).thickness_m(0.01), glass(1.5).pane_m(0.004)] {
        let sheet = (plate([4.0, 0.0, 0.0], [-cos, sin, 0.0], 3.0), material);
        let options = ScanOptions::default().profile(Profile::Blainder);
        let c = scan(&scene(wall(), vec![sheet]), &one_beam(""), options).into_columns();
        assert_near("range", c.range()[0].into(), 4.0 + 6.0 / bent.to_radians().cos(), 1e-4);
        assert_eq!(c.cause()[0], Cause::Glass as u8);
    }
}

/// Single sheets: what is left behind a pane, with all echoes between its faces, and how much later it arrives.
#[test]
fn panes_follow_their_table() {
    let table = Table::parse(include_str!("../data/pane.csv"), ',');
    assert!(table.len() > 20);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let (n, thickness, theta) = (number("n"), number("thickness_m"), number("theta_i_deg").to_radians());
        let absorption = number("absorption_1_per_m");
        let material = (glass(n as f32))
            .pane_m(thickness as f32)
            .attenuation_distance_m(if absorption > 0.0 { 1.0 / absorption as f32 } else { f32::INFINITY })
            .attenuation_color(if absorption > 0.0 { [(-1f32).exp(); 3] } else { [1.0; 3] });
        let pane = plate([4.0, 0.0, 0.0], [-theta.cos(), theta.sin(), 0.0], 3.0);
        let built = scene(Some((plate([10.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.5), 0.5)), vec![(pane, material.clone())]);
        let cloud = look(&built, "returns: {mode: strongest}");
        let c = cloud.columns();
        assert_eq!((cloud.len(), c.cause()[0]), (1, Cause::Glass as u8), "row {row}");
        let factor = number("two_way_incoherent_s_p_mean");
        // Energy falls with the paraxial distance, in which the path through glass counts 1/n; ranges with n.
        let way = thickness / (theta.sin() / n).asin().cos();
        let spread = 10.0 + number("range_extra_geometric_m") - way + way / n;
        let expected = factor * ((10.0 + number("range_extra_optical_m")) / spread).powi(2);
        assert_near("intensity", f64::from(c.intensity()[0]) / 0.5, expected, 2e-5);
        assert_near("range", c.range()[0].into(), 10.0 + number("range_extra_optical_m"), 2e-5);
        let paper = ScanOptions::default().profile(Profile::Paper);
        let paper = scan(&built, &one_beam(""), paper);
        assert_near("length", paper.columns().range()[0].into(), 10.0 + number("range_extra_geometric_m"), 2e-5);
        // The beam continues beside its line: a wall that leans by 45 degrees is met that much earlier.
        let leaning = (plate([10.0, 0.0, 0.0], [-1.0, 1.0, 0.0], 0.5), 0.5);
        let pane = plate([4.0, 0.0, 0.0], [-theta.cos(), theta.sin(), 0.0], 3.0);
        let beside = look(&scene(Some(leaning), vec![(pane, material)]), "").columns().range()[0];
        let shift = number("lateral_shift_m");
        assert_near("shift", f64::from(c.range()[0] - beside), shift, BESIDE);
    }
}

/// A pane of 4 mm that the scene has as a body, with two faces: what passes both, without the echoes between them, and
/// how far it is displaced from its line. Computed with numpy for an index of 1.5: incidence, transmission, shift in
/// mm.
#[test]
fn panes_that_are_bodies_pass_light_face_by_face() {
    for (degrees, passed, shift_mm, surplus_mm) in [
        (0.0f64, 0.921_600f64, 0.0, 2.0),
        (30.0, 0.918_679, 0.775_255, 2.192_75),
        (45.0, 0.902_044, 1.316_569, 2.463_08),
        (60.0, 0.829_581, 2.049_888, 2.898_98),
        (75.0, 0.557_919, 2.992_320, 3.555_13),
    ] {
        let sin = degrees.to_radians().sin();
        let look_at = |wall: Shape| {
            let material = glass(1.5).thickness_m(0.004).group_index(1.5);
            let mut scene = SceneBuilder::new();
            let paint = scene.reflector(0.5);
            scene.stand(wall, Some(paint));
            let material = scene.material(material);
            let pane = Shape::cuboid(DVec3::new(0.0, -3.0, -3.0), DVec3::new(0.004, 3.0, 3.0));
            let mesh = scene.mesh([(pane, Some(material))]);
            let turn = DAffine3::from_rotation_z(-degrees.to_radians());
            scene.place(mesh, DAffine3::from_translation(4.0 * DVec3::X) * turn);
            look(&scene.finish().build().unwrap(), "returns: {mode: strongest}").into_columns()
        };
        let c = look_at(plate([10.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.5));
        assert_eq!((c.cause()[0], c.bounces()[0]), (Cause::Glass as u8, 2));
        let range = 10.0 + 1e-3 * surplus_mm;
        assert_near("range", c.range()[0].into(), range, 2e-5);
        // Light spreads over the path in air, and over 1/n of that in glass.
        let way = 0.004 / (1.0 - (sin / 1.5).powi(2)).sqrt();
        let spread = range - 1.5 * way + way / 1.5;
        let expected = 0.5 * passed * passed * (range / spread).powi(2);
        assert_near("intensity", c.intensity()[0].into(), expected, 2e-5 * expected);
        let leaning = look_at(plate([10.0, 0.0, 0.0], [-1.0, 1.0, 0.0], 0.5));
        assert_near("shift", f64::from(c.range()[0] - leaning.range()[0]), 1e-3 * shift_mm, 2.0 * BESIDE);
    }
}

/// A boundary between two media, each a body: a wall where its reflected light goes and one where its refracted light
/// goes, both leaning by 45 degrees so that their ranges reveal the direction.
#[test]
fn boundaries_follow_their_table() {
    let table = Table::parse(include_str!("../data/fresnel_dielectric.csv"), ',');
    assert_eq!(table.len(), 174);
    let (mut reflected, mut refracted) = (0, 0);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let (n1, n2, degrees) = (number("n1"), number("n2"), number("theta_i_deg"));
        // At grazing incidence no beam meets it.
        if degrees == 90.0 {
            continue;
        }
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (normal, along) = (DVec3::new(-cos, sin, 0.0), DVec3::new(sin, cos, 0.0));
        let at = 5.0 * DVec3::X;
        // The light left behind the wall of `n1`, which the beam enters head-on at 1 m.
        let entered = 1.0 - ((n1 - 1.0) / (n1 + 1.0)).powi(2);
        // Reflectance or transmittance from a wall `length` m away in `direction`; `outside` of that in air.
        let part = |direction: DVec3, length: f64, index: f64, outside: f64| {
            let across = DVec3::Z.cross(direction);
            let wall = (Shape::plate(at + length * direction, (across - direction).normalize(), 0.1), 0.5);
            let body = |ior: f64| (glass(ior as f32)).thickness_m(1.0).group_index(1.0);
            let mut others = vec![(Shape::plate(at, normal, 40.0), body(n2))];
            if n1 > 1.0 {
                others.push((Shape::plate(DVec3::X, -DVec3::X, 0.01), body(n1).name("bath")));
            }
            // Not what the boundary of the bath reflects, and nothing after a second pass to and fro.
            let [low, high] = [4.9 + length, 5.1 + length];
            let sections = format!("intensity: {{encoding: power}}\nrange: {{min_m: {low}, max_m: {high}}}");
            let cloud = look(&scene(Some(wall), others), &sections);
            if cloud.is_empty() {
                return 0.0;
            }
            assert_near(&format!("range of row {row}"), cloud.columns().range()[0].into(), 5.0 + length, 4e-5);
            let spread = 1.0 + 4.0 / n1 + (length - outside) / index + outside;
            let two_way = f64::from(cloud.columns().intensity()[0]) * std::f64::consts::PI * spread * spread;
            (two_way / (0.5 * 0.5f64.sqrt())).sqrt() / entered
        };
        // Near the critical angle single precision does not determine the refracted direction.
        let theta_t: f64 = table.text(row, "theta_t_deg(nan=TIR)").parse().unwrap();
        let tolerance = if theta_t > 80.0 { 5e-5 } else { 1e-5 };
        // Head-on light leaves through the wall of `n1` again.
        let leaves = degrees < 0.5 && n1 > 1.0;
        let back = cos * normal + sin * along;
        let found = part(back, 8.0, n1, if leaves { 4.0 } else { 0.0 }) / if leaves { entered } else { 1.0 };
        assert_near(&format!("R of row {row}"), found, number("R_unpolarised"), tolerance);
        reflected += 1;
        if theta_t.is_nan() {
            assert_eq!(part(-normal, 4.0, n2, 0.0) + part(DVec3::X, 4.0, n2, 0.0), 0.0, "row {row}");
            continue;
        }
        let (sin, cos) = theta_t.to_radians().sin_cos();
        // Where a range tells a direction to 1e-5 that single precision does not know.
        if theta_t < 88.0 {
            let found = part(sin * along - cos * normal, 4.0, n2, 0.0);
            assert_near(&format!("T of row {row}"), found, number("T_unpolarised"), tolerance);
            refracted += 1;
        }
    }
    assert_eq!((reflected, refracted), (168, 142));
}

/// Light in the reverse direction through a prism of tinted glass takes as long and loses as much.
#[test]
fn light_goes_back_as_it_came() {
    let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let side = |p: [f64; 2], q: [f64; 2]| {
        let [p, q] = [p, q].map(|[x, y]| corner(x, y, -1.0));
        Shape::quad(p, q - p, 2.0 * DVec3::Z)
    };
    let [a, b, c] = [[4.0, -1.0], [6.0, -1.0], [5.0, 2.0]];
    let prism = side(a, b).and(side(b, c)).and(side(c, a));
    let tint = glass(1.51).thickness_m(1.0).group_index(1.53).attenuation_distance_m(3.0).attenuation_color([0.7; 3]);
    let through = |wall: Shape, pose: Pose| {
        let built = scene(Some((wall, 0.5)), vec![(prism.clone(), tint.clone())]);
        let sections = "intensity: {encoding: power}\nreturns: {mode: strongest}";
        let cloud = super::scan_at(&built, &one_beam(sections), pose, ScanOptions::default());
        assert_eq!((cloud.len(), cloud.columns().cause()[0], cloud.columns().bounces()[0]), (1, Cause::Glass as u8, 2));
        (f64::from(cloud.columns().range()[0]), f64::from(cloud.columns().intensity()[0]))
    };
    // The path of the beam along x, by Snell's law at both sides.
    let refract = |d: DVec3, n: DVec3, q: f64| {
        let cos = -d.dot(n);
        q * d + (q * cos - (1.0 - q * q * (1.0 - cos * cos)).sqrt()) * n
    };
    let normal = |p: [f64; 2], q: [f64; 2]| DVec3::new(q[1] - p[1], p[0] - q[0], 0.0).normalize();
    let meet = |o: DVec3, d: DVec3, p: [f64; 2], n: DVec3| o + d * ((corner(p[0], p[1], 0.0) - o).dot(n) / d.dot(n));
    let (entry, exit) = (normal(c, a), normal(b, c));
    let inside = refract(DVec3::X, entry, 1.0 / 1.51);
    let first = meet(DVec3::ZERO, DVec3::X, a, entry);
    let second = meet(first, inside, b, exit);
    let out = refract(inside, -exit, 1.51);
    let end = second + 6.0 * out;
    let there = through(Shape::plate(end, -out, 0.5), Pose::IDENTITY);
    let yaw = (-out.y).atan2(-out.x).to_degrees();
    let back =
        through(Shape::plate(DVec3::ZERO, DVec3::X, 0.5), Pose::at(end.x, end.y, end.z).with_rpy_deg(0.0, 0.0, yaw));
    assert_near("range", back.0, there.0, 2e-5);
    assert_near("power", back.1 / there.1, 1.0, 2e-5);
    assert!(there.1 < 0.9 * 0.5 / (std::f64::consts::PI * there.0 * there.0), "glass takes its part");
}

/// No more of a beam's light is in transit after an event than before it: among mirrors, half-mirrors, panes and bodies
/// of all kinds.
#[test]
fn light_never_becomes_more() {
    let random = &mut Random::new(21);
    let (mut events, mut nearly_all) = (0, 0);
    for _ in 0..12 {
        let mut builder = SceneBuilder::new();
        for kind in 0..10 {
            let base = glass(1.5).name(format!("kind {kind}")).dirt(0.02 * random.unit() as f32);
            let material = match kind {
                0 => mirror(random.unit() as f32),
                1 => mirror(1.0),
                2 => base.metallic(0.5).roughness(0.1).transmission(0.0),
                3 => mirror(1.0).ior(2.0).extinction_index(8.0),
                4 => base.pane_m(0.01),
                5 => base.pane_m(0.0).metallic(0.3),
                6 => base.thickness_m(1.0).ior(random.between(1.0, 2.5) as f32),
                7 => base.thickness_m(1.0).ior(1.33).dirt(0.0),
                8 => base.thickness_m(1.0).attenuation_distance_m(1.0).attenuation_color([0.5; 3]),
                _ => base.thickness_m(1.0).transmission(0.6).metallic(0.2).roughness(0.05),
            };
            let material = builder.material(material);
            let shape = if kind < 6 { Shape::plate(DVec3::ZERO, DVec3::X, 2.0) } else { Shape::sphere(1.0, 12) };
            let mesh = builder.mesh([(shape, Some(material))]);
            for _ in 0..3 {
                let place = DAffine3::from_translation(random.in_cube(5.0));
                builder.place(mesh, place * DAffine3::from_quat(random.rotation()));
            }
        }
        let paint = builder.reflector(0.5);
        builder.stand(Shape::cuboid(DVec3::splat(-9.0), DVec3::splat(9.0)), Some(paint));
        let built = builder.finish().build().unwrap();
        let sensor = sensor(&raster(3, 8, 2.5));
        for beam in 0..24 {
            let text =
                built.explain(&sensor, &Trajectory::fixed(Pose::IDENTITY), &ScanOptions::default(), beam).unwrap();
            // Light left after each number of events; the last one listed may be incomplete.
            let mut left = vec![0.0; 12];
            let mut lines = 0;
            for line in text.lines().filter(|line| line.ends_with("of the light is left")) {
                let words: Vec<&str> = line.split_whitespace().collect();
                let [after, part] = [words[1], words[words.len() - 6]];
                left[after.parse::<usize>().unwrap()] += part.parse::<f64>().unwrap();
                lines += 1;
            }
            let complete = left.iter().rposition(|&part| part > 0.0).unwrap_or(0).max(1) - usize::from(lines == 48);
            for pair in left[..=complete].windows(2) {
                // To the digits printed.
                assert!(pair[1] <= pair[0] + 48.0 * 5e-5, "{left:?}\n{text}");
                nearly_all += usize::from(pair[1] > 0.9 * pair[0] && pair[0] > 0.1);
                events += 1;
            }
        }
    }
    assert!(events > 500 && nearly_all > 50, "{events} {nearly_all}");
}

/// A pane without thickness shifts and delays nothing, in front of a leaning wall; without an index it does nothing at
/// all.
#[test]
fn an_endlessly_thin_pane_only_dims() {
    let (sin, cos) = 45f64.to_radians().sin_cos();
    for (ior, passed) in [(1.5, 0.823_274), (1.0, 1.0)] {
        for pane_m in [None, Some(0.0)] {
            let pane = (plate([4.0, 0.0, 0.0], [-cos, sin, 0.0], 3.0), glass(ior).pane_m(pane_m));
            let wall = Some((plate([10.0, 0.0, 0.0], [-0.8, 0.6, 0.0], 5.0), 0.5));
            let c = look(&scene(wall, vec![pane]), "").into_columns();
            assert_near("range", c.range()[0].into(), 10.0, BESIDE);
            assert_near("intensity", c.intensity()[0].into(), 0.5 * 0.8 * passed, 1e-6);
        }
    }
}

/// A body of glass with an inside: entered and left, with the delay of its index.
#[test]
fn bodies_of_glass_delay_and_dim() {
    for (ior, group) in [(1.5f32, None), (1.5, Some(1.52f32))] {
        let body = Shape::cuboid(DVec3::new(3.0, -1.0, -1.0), DVec3::new(5.0, 1.0, 1.0));
        let material = glass(ior).thickness_m(1.0).group_index(group);
        let built = scene(Some((plate([10.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5)), vec![(body, material)]);
        let c = look(&built, "").into_columns();
        let range = 10.0 + 2.0 * (f64::from(group.unwrap_or(ior)) - 1.0);
        assert_near("range", c.range()[0].into(), range, 2e-4);
        assert_eq!((c.cause()[0], c.bounces()[0]), (Cause::Glass as u8, 2));
        // Twice through two faces; light spreads over 8 m + 2 m / n.
        let spread = 8.0 + 2.0 / f64::from(ior);
        let expected = 0.5 * 0.96f64.powi(4) * (range / spread).powi(2);
        assert_near("intensity", c.intensity()[0].into(), expected, 1e-4);
    }
}

/// Water shows its bed a third deeper than it is; bodies in bodies are left in any order.
#[test]
fn water_shows_its_bed_deeper() {
    let water = glass(1.33).thickness_m(1.0);
    let basin = Shape::cuboid(DVec3::new(4.0, -9.0, -9.0), DVec3::new(8.0, 9.0, 9.0));
    let built = scene(Some((plate([7.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5)), vec![(basin, water.clone())]);
    assert_near("range", look(&built, "").columns().range()[0].into(), 4.0 + 3.0 * 1.33, 2e-4);

    let ice = glass(1.31).name("ice").thickness_m(1.0);
    let cube = Shape::cuboid(DVec3::new(5.0, -0.5, -0.5), DVec3::new(6.0, 0.5, 0.5));
    let basin = Shape::cuboid(DVec3::new(4.0, -9.0, -9.0), DVec3::new(8.0, 9.0, 9.0));
    let wall = (plate([7.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5);
    let built = scene(Some(wall), vec![(basin, water), (cube, ice)]);
    let c = look(&built, "").into_columns();
    assert_near("range", c.range()[0].into(), 4.0 + 2.0 * 1.33 + 1.31, 3e-4);
    assert_eq!(c.bounces()[0], 3);
}

/// A right-angled prism turns the beam by total reflection and takes light from it only at its legs.
#[test]
fn a_prism_turns_the_beam_by_total_reflection() {
    let [a, b, c] = [[5.0, -1.0], [5.0, 1.0], [7.0, 1.0]];
    let at = |[x, y]: [f64; 2], z: f64| DVec3::new(x, y, z);
    let side =
        |p: [f64; 2], q: [f64; 2]| Shape::quad(at(p, -1.0), at(q, -1.0) - at(p, -1.0), DVec3::new(0.0, 0.0, 2.0));
    let prism = side(a, b).and(side(b, c)).and(side(c, a));
    let material = glass(1.5).thickness_m(1.0);
    // From the leg x = 5 to the long side x - y = 6, and up through the leg y = 1 to the wall y = 4.
    let wall = (plate([6.0, 4.0, 0.0], [0.0, -1.0, 0.0], 2.0), 0.5);
    let built = scene(Some(wall), vec![(prism, material)]);
    let c = look(&built, "").into_columns();
    assert_eq!((c.bounces()[0], c.cause()[0]), (3, Cause::Mirror as u8));
    assert_near("range", c.range()[0].into(), 5.0 + 1.5 * 2.0 + 3.0, 3e-4);
    let spread: f64 = 5.0 + 2.0 / 1.5 + 3.0;
    assert_near("intensity", c.intensity()[0].into(), 0.5 * 0.96f64.powi(4) * (11.0 / spread).powi(2), 1e-4);
}

/// Light between two mirrors comes to an end.
#[test]
fn mirrors_that_face_each_other_end() {
    let mirrors = || {
        vec![
            (plate([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0), mirror(1.0)),
            (plate([-5.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0), mirror(1.0)),
        ]
    };
    assert_eq!(look(&scene(None, mirrors()), "").len(), 0);
    // A wall beside the second mirror is met after as many bounces as the depth allows, and no more.
    let tilted = |depth| {
        let mut mirrors = mirrors();
        mirrors[0].0 = plate([5.0, 0.0, 0.0], [-1.0, 0.01, 0.0], 3.0);
        let built = scene(Some((plate([-6.0, 0.0, 0.0], [1.0, 0.0, 0.0], 9.0), 0.5)), mirrors);
        scan(&built, &one_beam(""), ScanOptions::default().specular_depth(depth))
    };
    let deep = tilted(10);
    assert_eq!((deep.len(), deep.columns().bounces()[0]), (1, 5));
    assert!(tilted(deep.columns().bounces()[0] - 1).is_empty() && tilted(deep.columns().bounces()[0]).len() == 1);
    assert_eq!(ScanOptions::default().specular_depth, 10);
    // So does light of which less than a millionth is left, there and back.
    for (leaves, seen) in [(1.01e-3, 1), (0.99e-3, 0)] {
        let behind = (plate([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0), 0.5);
        let built = scene(Some(behind), vec![(plate([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0), mirror(leaves))]);
        assert_eq!(look(&built, "").len(), seen, "{leaves}");
    }
}

/// Rough metals are partly mirrors, and semi-transparent surfaces are visible themselves.
#[test]
fn between_mirror_and_diffuse() {
    let wall = || Some((plate([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0), 0.8));
    let rough = |roughness| mirror(0.5).roughness(roughness);
    let intensity = |material, mode: &str| {
        let built = scene(wall(), vec![(plate([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0), material)]);
        let c = look(&built, &format!("returns: {{mode: {mode}}}")).into_columns();
        (f64::from(c.intensity()[0]), c.cause()[0])
    };
    let part = 0.75f64.powi(4);
    let (own, cause) = intensity(rough(0.25), "first");
    assert_eq!(cause, Cause::Surface as u8);
    assert_near("itself", own, 0.5 * (1.0 - part), 1e-6);
    let (seen, cause) = intensity(rough(0.25), "last");
    assert_eq!(cause, Cause::Mirror as u8);
    assert_near("in it", seen, 0.8 * (0.5 * part).powi(2), 1e-6);
    assert_near("rough", intensity(rough(1.0), "strongest").0, 0.5, 1e-6);
}

/// Weather covers the whole folded path, but not inside glass.
#[test]
fn weather_dims_the_folded_way() {
    let half = 0.5f64.sqrt();
    let wall = (plate([5.0, 7.0, 0.0], [0.0, -1.0, 0.0], 2.0), 0.5);
    let built = scene(Some(wall), vec![(plate([5.0, 0.0, 0.0], [-half, half, 0.0], 1.0), mirror(1.0))]);
    for (yaml, length) in [
        ("{rain: {rate_mm_h: 50, drops: false}}", 12.0),
        ("{rain: {rate_mm_h: 50, drops: false, start_m: 4, length_m: 3}}", 3.0),
        ("{rain: {rate_mm_h: 50, drops: false, box: {min_m: [3, 2, -1], max_m: [9, 4, 1]}}}", 2.0),
    ] {
        let environment = Environment::from_yaml(yaml).unwrap();
        let alpha = environment.rain[0].what.extinction(Default::default());
        let cloud = scan(&built, &one_beam(""), ScanOptions::default().environment(environment));
        assert_near(yaml, cloud.columns().intensity()[0].into(), 0.5 * (-2.0 * alpha * length).exp(), 1e-5);
    }
}

/// What cannot be detected after the mirror is absent.
#[test]
fn the_threshold_holds_behind_mirrors() {
    let half = 0.5f64.sqrt();
    let seen = |leaves: f32| {
        let wall = (plate([5.0, 7.0, 0.0], [0.0, -1.0, 0.0], 2.0), 0.5);
        let built = scene(Some(wall), vec![(plate([5.0, 0.0, 0.0], [-half, half, 0.0], 1.0), mirror(leaves))]);
        look(&built, "detection: {model: radar_equation, reflectance: 0.5, at_m: 15}").len()
    };
    // (12 / 15)^2 = 0.64 = 0.8^2.
    assert_eq!((seen(0.801), seen(0.799)), (1, 0));
}
