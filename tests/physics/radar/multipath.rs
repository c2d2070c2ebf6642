//! Grounds, walls and corners.

use super::*;

/// A smooth road of metal at z = `height`.
fn road(height: f64) -> Shape {
    Shape::quad(DVec3::new(-50.0, -100.0, height), 400.0 * DVec3::X, 200.0 * DVec3::Y)
}

/// Check values: radar and target 0.5 m above a road that reflects level waves with -1: minima of the power at 64.2072
/// and 42.8016 m, a maximum at 51.3640 m, of 12.04 dB more than without a road.
#[test]
fn roads_take_and_give_where_they_should() {
    let sensor = radar("radar.array.polarisation=horizontal radar.power_dbm=90");
    let power = |range: f64, with_road: bool| {
        let target = (Shape::plate(DVec3::X * range, DVec3::NEG_X, 0.002), METAL);
        let road = with_road.then(|| (road(-0.5), METAL));
        let cube = cube(&scene(road.into_iter().chain([target])), &sensor, &options());
        cell(&cube, range, 0.0).max(cell(&cube, range + 0.4 * STEP, 0.0)).max(cell(&cube, range - 0.4 * STEP, 0.0))
    };
    for minimum in [64.2072, 42.8016] {
        let ranges: Vec<f64> = (-12..=12).map(|index| minimum + 0.25 * f64::from(index)).collect();
        let powers: Vec<f64> = ranges.iter().map(|&range| power(range, true)).collect();
        let least = (0..ranges.len()).min_by(|&a, &b| powers[a].total_cmp(&powers[b])).unwrap();
        assert_near("range of the minimum, m", ranges[least], minimum, STEP);
        let depth = db(powers[least] / powers.iter().copied().fold(0.0, f64::max));
        assert!(depth < -10.0, "{depth} dB at {minimum} m");
    }
    let gain = db(power(51.364, true) / power(51.364, false));
    assert_near("gain at a maximum, dB", gain, 12.041, 0.5);
}

/// From 10 m above a road, a ball 11 m above it 24 m away: itself, and below the road its image, each at its place.
#[test]
fn targets_are_seen_in_the_ground() {
    let sensor =
        radar(&format!("{SQUARE} pattern.elevation_deg=[-60,20] radar.power_dbm=50 radar.detection.method=os"));
    let ball = placed(Shape::sphere(0.1, 24), DAffine3::from_translation(DVec3::new(24.0, 0.0, 1.0)));
    let cloud = scan(&scene([(road(-10.0), METAL), (ball, METAL)]), &sensor, &options());
    let c = cloud.columns();
    let [direct, folded] = [24f64.hypot(1.0), 24f64.hypot(21.0)];
    for (range, kind) in
        [(direct, PathType::Direct), (0.5 * (direct + folded), PathType::Ground), (folded, PathType::Ground)]
    {
        // The near side of the ball.
        let near =
            |row: usize| (f64::from(c.range()[row]) - (range - 0.1)).abs() < 0.5 * STEP && c.instance_id()[row] == 2;
        let row = strongest(&cloud, near).unwrap_or_else(|| panic!("nothing at {range} m: {:?}", c.range()));
        assert_eq!(path(&cloud, row), kind, "{range} m");
    }
    let row = strongest(&cloud, |row| (f64::from(c.range()[row]) - folded).abs() < STEP).unwrap();
    assert_near("elevation of the image", c.elevation()[row].into(), -(21f64 / 24.0).atan(), 0.03);
    assert_near("true range", c.true_range()[row].into(), direct, 0.2);
}

/// A ball 30 m ahead beside a wall 10 m to the left: its ghost is 20 m to the left.
#[test]
fn walls_show_ghosts_at_the_image() {
    let wall = Shape::quad(DVec3::new(0.0, 10.0, -2.0), 60.0 * DVec3::X, 8.0 * DVec3::Z);
    let ball = placed(Shape::sphere(0.3, 110), DAffine3::from_translation(DVec3::X * 30.0));
    let sensor = radar(&format!("{SQUARE} radar.power_dbm=50 radar.detection.method=os"));
    let cloud = scan(&scene([(wall, METAL), (ball, METAL)]), &sensor, &options());
    let of_target = |row: usize| cloud.columns().instance_id()[row] == 2;
    let target = strongest(&cloud, of_target).expect("the target");
    assert_eq!(path(&cloud, target), PathType::Direct);
    let c = cloud.columns();
    let image = 30f64.hypot(20.0) - 0.3;
    let near = |row: usize| (f64::from(c.range()[row]) - image).abs() < STEP;
    let ghost = strongest(&cloud, |row| path(&cloud, row) == PathType::Wall && of_target(row) && near(row));
    let ghost = ghost.unwrap_or_else(|| panic!("no ghost at {image} m: {:?} {:?}", c.range(), c.path()));
    assert_near("range", c.range()[ghost].into(), image, 0.15);
    assert_near("azimuth", c.azimuth()[ghost].into(), (20f64 / 30.0).atan(), 0.03);
    assert_near("true range", c.true_range()[ghost].into(), 30.0, 0.4);
    assert!(c.bounces()[ghost] > 0);
}
