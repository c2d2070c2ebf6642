use super::{assert_near, scan};
use echocast::material::Reflectance;
use echocast::scene::Material;
use echocast::{BuiltScene, Cause, Environment, PointCloud, Profile, ScanOptions};
use echocast_tests::reference::{SceneBuilder, Shape, Table, one_beam};
use glam::DVec3;

fn mirror(reflectance: f32) -> Material {
    let reflectance = Some(Reflectance::Constant(reflectance));
    Material { name: "mirror".into(), reflectance, metallic: 1.0, roughness: 0.0, ..Material::default() }
}

fn glass(ior: f32) -> Material {
    Material { name: "glass".into(), transmission: 1.0, roughness: 0.0, ior, ..Material::default() }
}

/// A quadrilateral around `centre`, across `normal`.
fn plate(centre: [f64; 3], normal: [f64; 3], half: f64) -> Shape {
    Shape::plate(centre.into(), DVec3::from(normal).normalize(), half)
}

/// A wall of `reflectance` and other things, all across the x axis or not.
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

/// The mirror of the paper's figure 2 a: the target is seen behind it, along the beam, with what the mirror leaves taken
/// twice.
#[test]
fn a_mirror_shows_what_it_faces() {
    let half = 0.5f64.sqrt();
    let wall = (plate([5.0, 7.0, 0.0], [0.0, -1.0, 0.0], 2.0), 0.5);
    let built = scene(Some(wall), vec![(plate([5.0, 0.0, 0.0], [-half, half, 0.0], 1.0), mirror(0.9))]);
    let cloud = look(&built, "intensity: {encoding: power}");
    let c = &cloud.columns;
    assert_eq!((cloud.len, c.cause[0], c.bounces[0]), (1, Cause::Mirror as u8, 1));
    assert_near("x", c.x[0].into(), 12.0, 2e-4);
    assert_near("y", c.y[0].into(), 0.0, 1e-6);
    assert_near("range", c.range[0].into(), 12.0, 2e-4);
    assert_near("P_n", c.intensity[0].into(), 8.952_47e-4, 5e-8);
    // The label is the wall's, the first surface is the mirror.
    assert_eq!(cloud.labels.category.name(c.category_id[0]), cloud.labels.category.name(1));
    assert_ne!(c.first_category_id[0], c.category_id[0]);
    assert_near("normal", c.normal_y[0].into(), -1.0, 1e-6);
    // Where the mirror faces nothing there is nothing.
    let empty = scene(None, vec![(plate([5.0, 0.0, 0.0], [-half, half, 0.0], 1.0), mirror(0.9))]);
    assert_eq!(look(&empty, "").len, 0);
}

/// A metal by its index: 89.0411 % of 2 + 8i head-on, there and back.
#[test]
fn metals_reflect_by_their_index() {
    let metal = Material { ior: 2.0, extinction_index: 8.0, ..mirror(1.0) };
    // Head-on the mirror shows what is behind the sensor.
    let built = scene(
        Some((plate([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0), 0.5)),
        vec![(plate([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0), metal)],
    );
    let cloud = look(&built, "");
    assert_near("intensity", cloud.columns.intensity[0].into(), 0.5 * 0.890_411f64.powi(2), 1e-6);
    assert_near("range", cloud.columns.range[0].into(), 13.0, 2e-4);
}

/// Single sheets: what is left behind a pane, with all echoes between its faces, and how much later it comes.
#[test]
fn panes_follow_their_table() {
    let table = Table::parse(include_str!("../data/pane.csv"), ',');
    assert!(table.len() > 20);
    for row in 0..table.len() {
        let number = |column| table.number(row, column);
        let (n, thickness, theta) = (number("n"), number("thickness_m"), number("theta_i_deg").to_radians());
        let absorption = number("absorption_1_per_m");
        let material = Material {
            pane_m: Some(thickness as f32),
            attenuation_distance_m: if absorption > 0.0 { 1.0 / absorption as f32 } else { f32::INFINITY },
            attenuation_color: if absorption > 0.0 { [(-1f32).exp(); 3] } else { [1.0; 3] },
            ..glass(n as f32)
        };
        let pane = plate([4.0, 0.0, 0.0], [-theta.cos(), theta.sin(), 0.0], 3.0);
        let built = scene(Some((plate([10.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.5), 0.5)), vec![(pane, material)]);
        let cloud = look(&built, "returns: {mode: strongest}");
        let c = &cloud.columns;
        assert_eq!((cloud.len, c.cause[0]), (1, Cause::Glass as u8), "row {row}");
        let factor = number("two_way_incoherent_s_p_mean");
        // Energy falls with the paraxial distance, in which the way through glass counts 1/n; ranges with n.
        let way = thickness / (theta.sin() / n).asin().cos();
        let spread = 10.0 + number("range_extra_geometric_m") - way + way / n;
        let expected = factor * ((10.0 + number("range_extra_optical_m")) / spread).powi(2);
        assert_near("intensity", f64::from(c.intensity[0]) / 0.5, expected, 2e-5);
        assert_near("range", c.range[0].into(), 10.0 + number("range_extra_optical_m"), 2e-5);
        let paper = ScanOptions { profile: Profile::Paper, ..ScanOptions::default() };
        let paper = scan(&built, &one_beam(""), paper);
        assert_near("length", paper.columns.range[0].into(), 10.0 + number("range_extra_geometric_m"), 2e-5);
    }
}

/// A pane without thickness shifts and delays nothing.
#[test]
fn an_endlessly_thin_pane_only_dims() {
    let built = scene(
        Some((plate([10.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5)),
        vec![(plate([4.0, 0.0, 0.0], [-1.0, 0.6, 0.0], 3.0), glass(1.5))],
    );
    let cloud = look(&built, "");
    assert_near("range", cloud.columns.range[0].into(), 10.0, 1e-5);
    assert!(cloud.columns.intensity[0] < 0.45 && cloud.columns.intensity[0] > 0.35);
}

/// A body of glass with an inside: entered and left, later by what its index says.
#[test]
fn bodies_of_glass_delay_and_dim() {
    for (ior, group) in [(1.5f32, None), (1.5, Some(1.52f32))] {
        let body = Shape::cuboid(DVec3::new(3.0, -1.0, -1.0), DVec3::new(5.0, 1.0, 1.0));
        let material = Material { thickness_m: 1.0, group_index: group, ..glass(ior) };
        let built = scene(Some((plate([10.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5)), vec![(body, material)]);
        let c = look(&built, "").columns;
        let range = 10.0 + 2.0 * (f64::from(group.unwrap_or(ior)) - 1.0);
        assert_near("range", c.range[0].into(), range, 2e-4);
        assert_eq!((c.cause[0], c.bounces[0]), (Cause::Glass as u8, 2));
        // Twice through two faces; light spreads over 8 m + 2 m / n.
        let spread = 8.0 + 2.0 / f64::from(ior);
        let expected = 0.5 * 0.96f64.powi(4) * (range / spread).powi(2);
        assert_near("intensity", c.intensity[0].into(), expected, 1e-4);
    }
}

/// Water shows its bed a third deeper than it is; bodies in bodies are left in any order.
#[test]
fn water_shows_its_bed_deeper() {
    let water = Material { thickness_m: 1.0, ..glass(1.33) };
    let basin = Shape::cuboid(DVec3::new(4.0, -9.0, -9.0), DVec3::new(8.0, 9.0, 9.0));
    let built = scene(Some((plate([7.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5)), vec![(basin, water.clone())]);
    assert_near("range", look(&built, "").columns.range[0].into(), 4.0 + 3.0 * 1.33, 2e-4);

    let ice = Material { name: "ice".into(), thickness_m: 1.0, ..glass(1.31) };
    let cube = Shape::cuboid(DVec3::new(5.0, -0.5, -0.5), DVec3::new(6.0, 0.5, 0.5));
    let basin = Shape::cuboid(DVec3::new(4.0, -9.0, -9.0), DVec3::new(8.0, 9.0, 9.0));
    let wall = (plate([7.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 5.0), 0.5);
    let built = scene(Some(wall), vec![(basin, water), (cube, ice)]);
    let c = look(&built, "").columns;
    assert_near("range", c.range[0].into(), 4.0 + 2.0 * 1.33 + 1.31, 3e-4);
    assert_eq!(c.bounces[0], 3);
}

/// A right-angled prism turns the beam by total reflection and takes nothing from it but at its legs.
#[test]
fn a_prism_turns_the_beam_by_total_reflection() {
    let [a, b, c] = [[5.0, -1.0], [5.0, 1.0], [7.0, 1.0]];
    let at = |[x, y]: [f64; 2], z: f64| DVec3::new(x, y, z);
    let side =
        |p: [f64; 2], q: [f64; 2]| Shape::quad(at(p, -1.0), at(q, -1.0) - at(p, -1.0), DVec3::new(0.0, 0.0, 2.0));
    let prism = side(a, b).and(side(b, c)).and(side(c, a));
    let material = Material { thickness_m: 1.0, ..glass(1.5) };
    // From the leg x = 5 to the long side x - y = 6, and up through the leg y = 1 to the wall y = 4.
    let wall = (plate([6.0, 4.0, 0.0], [0.0, -1.0, 0.0], 2.0), 0.5);
    let built = scene(Some(wall), vec![(prism, material)]);
    let c = look(&built, "").columns;
    assert_eq!((c.bounces[0], c.cause[0]), (3, Cause::Mirror as u8));
    assert_near("range", c.range[0].into(), 5.0 + 1.5 * 2.0 + 3.0, 3e-4);
    let spread: f64 = 5.0 + 2.0 / 1.5 + 3.0;
    assert_near("intensity", c.intensity[0].into(), 0.5 * 0.96f64.powi(4) * (11.0 / spread).powi(2), 1e-4);
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
    assert_eq!(look(&scene(None, mirrors()), "").len, 0);
    // A wall beside the second mirror is met after as many bounces as the depth allows, and no more.
    let tilted = |depth| {
        let mut mirrors = mirrors();
        mirrors[0].0 = plate([5.0, 0.0, 0.0], [-1.0, 0.01, 0.0], 3.0);
        let built = scene(Some((plate([-6.0, 0.0, 0.0], [1.0, 0.0, 0.0], 9.0), 0.5)), mirrors);
        scan(&built, &one_beam(""), ScanOptions { specular_depth: depth, ..ScanOptions::default() })
    };
    let deep = tilted(10);
    assert_eq!((deep.len, deep.columns.bounces[0]), (1, 5));
    assert!(tilted(deep.columns.bounces[0] - 1).len == 0 && tilted(deep.columns.bounces[0]).len == 1);
}

/// Rough metals are mirrors for a part, and half-transparent surfaces show themselves too.
#[test]
fn between_mirror_and_diffuse() {
    let wall = || Some((plate([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0), 0.8));
    let rough = |roughness| Material { roughness, ..mirror(0.5) };
    let intensity = |material, mode: &str| {
        let built = scene(wall(), vec![(plate([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], 1.0), material)]);
        let c = look(&built, &format!("returns: {{mode: {mode}}}")).columns;
        (f64::from(c.intensity[0]), c.cause[0])
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

/// Weather lies on the whole folded way, and not within glass.
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
        let cloud = scan(&built, &one_beam(""), ScanOptions { environment, ..ScanOptions::default() });
        assert_near(yaml, cloud.columns.intensity[0].into(), 0.5 * (-2.0 * alpha * length).exp(), 1e-5);
    }
}

/// What cannot be detected after the mirror is not there.
#[test]
fn the_threshold_holds_behind_mirrors() {
    let half = 0.5f64.sqrt();
    let seen = |leaves: f32| {
        let wall = (plate([5.0, 7.0, 0.0], [0.0, -1.0, 0.0], 2.0), 0.5);
        let built = scene(Some(wall), vec![(plate([5.0, 0.0, 0.0], [-half, half, 0.0], 1.0), mirror(leaves))]);
        look(&built, "detection: {model: radar_equation, reflectance: 0.5, at_m: 15}").len
    };
    // (12 / 15)^2 = 0.64 = 0.8^2.
    assert_eq!((seen(0.801), seen(0.799)), (1, 0));
}
