//! Rays of sound, compared with BELLHOP, another solver and closed forms.

use super::assert_near;
use echocast::Environment;
use echocast::medium::{RayEvent, RayPoint, SoundRay, Water};
use echocast_tests::reference::Table;

fn water(profile: &str) -> Water {
    let yaml = format!("water: {{absorption: none, profile: {profile}}}");
    Environment::from_yaml(&yaml).unwrap().water.unwrap()
}

const ISO: &str = "{constant: {speed_m_s: 1500}}";
/// 0.5 m/s slower with every metre of depth.
const GRADIENT: &str = "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 1000, speed_m_s: 1000}]}";
const LAYERS: &str = "{layers: [{depth_m: 0, speed_m_s: 1520, density_kg_m3: 1024}, {depth_m: 10, speed_m_s: 1500, \
    density_kg_m3: 1025}, {depth_m: 25, speed_m_s: 1487, density_kg_m3: 1026}, {depth_m: 45, speed_m_s: 1475, \
    density_kg_m3: 1027}, {depth_m: 70, speed_m_s: 1490, density_kg_m3: 1027.5}, {depth_m: 95, speed_m_s: 1510, \
    density_kg_m3: 1028}]}";

fn unphysical(profile: &str) -> Water {
    let yaml = format!("water: {{absorption: none, allow_unphysical: true, profile: {profile}}}");
    Environment::from_yaml(&yaml).unwrap().water.unwrap()
}

/// The layers with ramps of 0.2 m instead of jumps.
fn ramps() -> Water {
    let layers = [(0.0, 1520.0), (10.0, 1500.0), (25.0, 1487.0), (45.0, 1475.0), (70.0, 1490.0), (95.0, 1510.0)];
    let mut rows = vec![(0.0, 1520.0)];
    for pair in layers.windows(2) {
        rows.extend([(pair[1].0 - 0.1, pair[0].1), (pair[1].0 + 0.1, pair[1].1)]);
    }
    rows.push((200.0, 1510.0));
    let rows: Vec<String> = rows.iter().map(|(z, c)| format!("{{depth_m: {z}, speed_m_s: {c}}}")).collect();
    water(&format!("{{cast: [{}]}}", rows.join(", ")))
}

/// The next touch of surface or bottom.
fn touch(ray: &mut SoundRay) -> Option<(RayPoint, RayEvent)> {
    loop {
        let found = ray.next_event()?;
        if matches!(found.1, RayEvent::Surface | RayEvent::Bottom) {
            return Some(found);
        }
    }
}

/// Follows the launches of a table of touches and compares range and time, by the names of two columns.
fn compare(text: &str, water: &Water, start: f64, bottom: f64, [range, time]: [&str; 2], [metres, seconds]: [f64; 2]) {
    let table = Table::parse(text, ',');
    let (mut ray, mut launch) = (None, f64::NAN);
    for row in 0..table.len() {
        let angle = table.number(row, "launch_angle_deg");
        if angle != launch {
            launch = angle;
            ray = Some(SoundRay::new(water, 1000.0, start, angle, bottom).unwrap());
        }
        let what = format!("{angle} deg, touch {}", table.text(row, "event"));
        let (point, event) = touch(ray.as_mut().unwrap()).unwrap_or_else(|| panic!("{what}: there is none"));
        assert_eq!(event == RayEvent::Surface, table.text(row, "kind") == "surface", "{what}");
        assert_near(&format!("{what}: range"), point.distance_m, table.number(row, range), metres);
        assert_near(&format!("{what}: time"), point.time_s, table.number(row, time), seconds);
        if range == "range_closed_m" {
            let grazing = point.grazing.abs().to_degrees();
            assert_near(&format!("{what}: angle"), grazing, table.number(row, "grazing_deg"), 1e-5);
        }
    }
    assert!(table.len() > 60, "{}", table.len());
}

#[test]
fn straight_rays_touch_where_others_have_them() {
    let table = include_str!("../data/sonar/iso_events.csv");
    compare(table, &water(ISO), 50.0, 200.0, ["range_closed_m", "time_closed_s"], [2e-6, 2e-9]);
    compare(table, &water(ISO), 50.0, 200.0, ["range_bellhop_m", "time_pelagic_s"], [1e-3, 1e-6]);
}

#[test]
fn rays_bend_in_a_gradient_as_others_have_them() {
    let table = include_str!("../data/sonar/grad_neg_events.csv");
    let water = unphysical(GRADIENT);
    compare(table, &water, 50.0, 200.0, ["range_closed_m", "time_closed_s"], [1e-5, 1e-8]);
    compare(table, &water, 50.0, 200.0, ["range_bellhop_m", "time_pelagic_s"], [1e-3, 1e-6]);
}

#[test]
fn rays_pass_layers_as_others_have_them() {
    let table = include_str!("../data/sonar/layers6_events.csv");
    compare(table, &water(LAYERS), 55.0, 120.0, ["range_ideal_m", "time_ideal_s"], [1e-5, 1e-8]);
    compare(table, &ramps(), 55.0, 120.0, ["range_bellhop_m", "time_pelagic_s"], [1e-3, 1e-6]);
    compare(table, &ramps(), 55.0, 120.0, ["range_closed_m", "time_closed_s"], [1e-5, 1e-8]);
}

/// Depth and time along the path.
#[test]
fn paths_are_those_of_others() {
    for (text, water, start, bottom) in [
        (include_str!("../data/sonar/grad_neg_paths.csv"), unphysical(GRADIENT), 50.0, 200.0),
        (include_str!("../data/sonar/layers6_paths.csv"), ramps(), 55.0, 120.0),
    ] {
        let table = Table::parse(text, ',');
        let (mut ray, mut launch) = (None, f64::NAN);
        for row in 0..table.len() {
            let [angle, range, depth, time] =
                ["launch_angle_deg", "range_m", "depth_m", "time_s"].map(|column| table.number(row, column));
            if angle != launch {
                launch = angle;
                ray = Some(SoundRay::new(&water, 1000.0, start, angle, bottom).unwrap());
            }
            let ray = ray.as_mut().unwrap();
            let point = loop {
                match ray.point_at(range) {
                    Some(point) => break point,
                    None => ray.next_slab().unwrap_or_else(|| panic!("{angle} deg does not get to {range} m")),
                }
            };
            // BELLHOP steps to just beyond a boundary.
            let tolerance = 1e-3 + 1e-6 * range;
            assert_near(&format!("{angle} deg at {range} m: depth"), point.depth_m, depth, tolerance);
            assert_near(&format!("{angle} deg at {range} m: time"), point.time_s, time, 1e-6);
        }
        assert!(table.len() > 500, "{}", table.len());
    }
}

#[test]
fn layers_transmit_and_reflect_as_snell_and_eq_13_say() {
    let table = Table::parse(include_str!("../data/sonar/layers6_ideal_snell.csv"), ',');
    let (mut ray, mut launch) = (None, f64::NAN);
    for row in 0..table.len() {
        let angle = table.number(row, "launch_angle_deg");
        if angle != launch {
            launch = angle;
            ray = Some(SoundRay::new(&water(LAYERS), 1000.0, 55.0, angle, 120.0).unwrap());
        }
        let what = format!("{angle} deg, event {}", table.text(row, "event"));
        let (point, event) = ray.as_mut().unwrap().next_event().unwrap();
        let kind = table.text(row, "kind");
        match (event, kind) {
            (RayEvent::Boundary(alpha), "transmit") => {
                assert_near(&format!("{what}: alpha"), alpha, table.number(row, "alpha_eq13_this_interface"), 1e-6);
            }
            (RayEvent::TotalReflection, "total_reflection")
            | (RayEvent::Surface, "surface")
            | (RayEvent::Bottom, "bottom") => {
                assert_near(&format!("{what}: loss"), point.loss_db, table.number(row, "loss_dB_one_way"), 1e-6);
            }
            other => panic!("{what}: {other:?}"),
        }
        assert_near(&format!("{what}: range"), point.distance_m, table.number(row, "range_m"), 1e-6);
        assert_near(&format!("{what}: depth"), point.depth_m, table.number(row, "depth_m"), 1e-6);
        assert_near(&format!("{what}: time"), point.time_s, table.number(row, "time_s"), 1e-8);
        let grazing = point.grazing.abs().to_degrees();
        assert_near(&format!("{what}: angle"), grazing, table.number(row, "grazing_before_deg"), 1e-6);
    }
}

#[test]
fn a_boundary_without_contrast_changes_nothing() {
    let layers =
        "{layers: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 30, speed_m_s: 1500}, {depth_m: 80, speed_m_s: 1500}]}";
    for angle in [-70.0, -20.0, 5.0, 60.0] {
        let mut plain = SoundRay::new(&water(ISO), 1000.0, 50.0, angle, 200.0).unwrap();
        let mut layered = SoundRay::new(&water(layers), 1000.0, 50.0, angle, 200.0).unwrap();
        for _ in 0..4 {
            let (a, b) = (touch(&mut plain).unwrap().0, touch(&mut layered).unwrap().0);
            assert_near("range", b.distance_m, a.distance_m, 1e-9);
            assert_near("time", b.time_s, a.time_s, 1e-12);
            assert_near("spreading", b.spreading_db, a.spreading_db, 1e-9);
            assert_eq!(b.loss_db, 0.0);
        }
    }
}

/// Along the reverse path sound takes the same time.
#[test]
fn reversed_rays_take_the_same_time() {
    for profile in [GRADIENT, LAYERS] {
        for angle in [20.0, 45.0, 75.0] {
            let water = unphysical(profile);
            let mut there = SoundRay::new(&water, 1000.0, 50.0, angle, 110.0).unwrap();
            let (end, _) = touch(&mut there).unwrap();
            let back_angle = -end.grazing.to_degrees();
            let mut back = SoundRay::new(&water, 1000.0, 110.0, back_angle, 110.0).unwrap();
            let point = loop {
                if let Some(point) = back.point_at(end.distance_m) {
                    break point;
                }
                back.next_slab().unwrap();
            };
            assert_near("depth", point.depth_m, 50.0, 1e-6);
            assert_near("time", point.time_s, end.time_s, 1e-10);
        }
    }
}

/// Spreading by the ray tube agrees with neighbouring rays, and is spherical without gradient.
#[test]
fn tubes_are_as_wide_as_their_neighbours_are_apart() {
    let mut ray = SoundRay::new(&water(ISO), 1000.0, 50.0, 30.0, 200.0).unwrap();
    let (point, _) = touch(&mut ray).unwrap();
    assert_near("spherical", point.spreading_db, 20.0 * 300f64.log10(), 1e-9);
    for (water, bottom) in [(unphysical(GRADIENT), 200.0), (ramps(), 120.0), (water(LAYERS), 120.0)] {
        for (angle, touches) in [(35.0, 1), (-50.0, 2), (60.0, 3)] {
            let at = |angle: f64| {
                let mut ray = SoundRay::new(&water, 1000.0, 50.0, angle, bottom).unwrap();
                let start = ray.point().speed_m_s;
                for _ in 1..touches {
                    touch(&mut ray);
                }
                (touch(&mut ray).unwrap().0, start)
            };
            let step = 1e-3;
            let (point, start) = at(angle);
            let apart = (at(angle + step).0.distance_m - at(angle - step).0.distance_m) / (2.0 * step).to_radians();
            // I / I(1 m) = cos(start) / (r |dr/d start| sin(end)); pressure by the speeds.
            let intensity = angle.to_radians().cos() / (point.distance_m * apart.abs() * point.grazing.sin().abs());
            let expected = -10.0 * (intensity * point.speed_m_s / start).log10();
            assert_near(&format!("{angle} deg"), point.spreading_db, expected, 1e-4);
        }
    }
}

/// A level ray spreads equally whether it starts at a row in the middle of a line or beside it.
#[test]
fn level_rays_spread_from_the_rows_of_a_cast() {
    let cast =
        "{cast: [{depth_m: 0, speed_m_s: 1520}, {depth_m: 100, speed_m_s: 1500}, {depth_m: 200, speed_m_s: 1480}]}";
    for angle in [0.0, 1e-7, -1e-7, 1e-4, -1e-4] {
        for depth in [99.999, 100.0, 100.001] {
            let mut ray = SoundRay::new(&water(cast), 1000.0, depth, angle, 300.0).unwrap();
            let point = loop {
                match ray.point_at(200.0) {
                    Some(point) => break point,
                    None => ray.next_slab().unwrap(),
                }
            };
            let what = format!("{angle} deg at {depth} m");
            assert_near(&what, point.spreading_db, 20.0 * 200f64.log10(), 0.1);
        }
    }
}

/// Straight up and down, and nearly so, in a gradient: `ln(c2 / c1) / g`.
#[test]
fn vertical_rays_take_the_time_of_the_logarithm() {
    let water = unphysical(GRADIENT);
    for angle in [-90.0, -89.999_999, -89.9999, -89.99, 90.0, 89.999_999, 89.9999] {
        let mut ray = SoundRay::new(&water, 1000.0, 300.0, angle, 600.0).unwrap();
        let (point, _) = touch(&mut ray).unwrap();
        let end = if angle < 0.0 { 1500.0 } else { 1200.0 };
        let expected = (1350f64 / end).ln().abs() / 0.5;
        let slant = angle.to_radians().sin().abs();
        assert_near(&format!("{angle} deg: time"), point.time_s, expected / slant, 1e-8);
    }
    assert!(SoundRay::new(&water, 1000.0, 0.0, 10.0, 0.0).is_err());
}

/// Where sound is slowest a level ray is held from above and below.
#[test]
fn level_rays_run_along_the_axis_of_a_duct() {
    let duct =
        "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 100, speed_m_s: 1480}, {depth_m: 300, speed_m_s: 1500}]}";
    let mut ray = SoundRay::new(&water(duct), 1000.0, 100.0, 0.0, 250.0).unwrap();
    let mut slabs = 0;
    let point = loop {
        match ray.point_at(50e3) {
            Some(point) => break point,
            None => ray.next_slab().unwrap(),
        }
        slabs += 1;
        assert!(slabs < 10);
    };
    assert_near("depth", point.depth_m, 100.0, 1e-9);
    assert_near("time", point.time_s, 50e3 / 1480.0, 1e-9);
    assert_near("angle", point.grazing, 0.0, 1e-12);
    assert!(ray.next_event().is_none());
    // A degree off it oscillates: up at 0.2 1/s and down at 0.1 1/s, over chords of 2 c tan(g) / gradient.
    let mut ray = SoundRay::new(&water(duct), 1000.0, 100.0, 1.0, 250.0).unwrap();
    let tangent = 1f64.to_radians().tan();
    let period = 2.0 * 1480.0 * tangent * (1.0 / 0.2 + 1.0 / 0.1);
    for _ in 0..20 {
        ray.next_slab().unwrap();
    }
    assert_near("ten swings", ray.point().distance_m, 10.0 * period, 1e-6);
    // Along the surface and the bottom, towards which they bend, rays make no progress.
    let up = "{cast: [{depth_m: 0, speed_m_s: 1480}, {depth_m: 200, speed_m_s: 1500}]}";
    assert!(SoundRay::new(&water(up), 1000.0, 0.0, 0.0, 200.0).unwrap().next_event().is_none());
    let down = "{cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 200, speed_m_s: 1480}]}";
    assert!(SoundRay::new(&water(down), 1000.0, 200.0, 0.0, 200.0).unwrap().next_event().is_none());
}

/// Rows of a cast, and the depths where absorption is cut, leave rounding errors that are not layers.
#[test]
fn rows_of_a_cast_are_no_boundaries() {
    let rows: Vec<String> = (0..40)
        .map(|i| {
            let depth = 37.3 * f64::from(i);
            format!("{{depth_m: {depth}, speed_m_s: {}}}", 1500.1 + 0.7 * (f64::from(i) * 1.3).sin())
        })
        .collect();
    let yaml = format!("water: {{profile: {{cast: [{}]}}}}", rows.join(", "));
    let water = Environment::from_yaml(&yaml).unwrap().water.unwrap();
    for angle in [-60.0, -20.0, 10.0, 45.0, 80.0] {
        let mut ray = SoundRay::new(&water, 1000.0, 30.0, angle, 1400.0).unwrap();
        for _ in 0..6 {
            let (_, event) = ray.next_event().unwrap();
            assert!(matches!(event, RayEvent::Surface | RayEvent::Bottom), "{angle} deg: {event:?}");
        }
    }
}
