//! A survey over its scene, seen from above: area, swaths, strips and the way between them.

use super::canvas::{Color, GROUND, Picture, TEXT};
use super::legend::counted;
use super::paint::{Legend, LegendEntry};
use super::plan::{MapBase, base};
use super::top::{Map, length, scale_bar};
use super::{Page, font, legend};
use ::survey::SurveyPlan;
use engine::scene::Scene;
use engine::trace::BuiltScene;
use glam::{DVec2, DVec3, Vec2};

/// Strips, and what they cover.
const STRIP: Color = [0xff, 0xd1, 0x4d];
const SWATH: Color = [0x4d, 0xb6, 0xff];
/// The way from strip to strip.
const WAY: Color = [0xff, 0x7a, 0x59];

/// The survey `plan` over `scene`, `built` from it.
pub(super) fn draw(scene: &Scene, built: &BuiltScene, plan: &SurveyPlan, page: &Page) -> Picture {
    let Some((low, high)) = scene.bounds() else { return page.empty("no triangles") };
    let keys = plan.trajectory.clone().into_keys();
    let places = keys.iter().map(|(_, pose)| pose.position.truncate());
    let (low, high) =
        places.fold((low.truncate(), high.truncate()), |(low, high), place| (low.min(place), high.max(place)));
    let origin = built.origin().truncate();
    let map = Map::around((low - origin).as_vec2(), (high - origin).as_vec2(), page);
    let Some(MapBase { mut picture, unit, grid }) = base(scene, built, &map, page) else {
        return page.empty("no triangles");
    };
    // The scene recedes behind what is planned.
    picture.fill([0, 0], [map.width, map.height], GROUND, 0.35);
    let at = |place: DVec2| map.project((place - origin).as_vec2().extend(0.0));
    for strip in plan.strips.iter().filter(|strip| strip.length_m > 0.0) {
        band(&mut picture, swath_corners(strip.start_m, strip.end_m, plan.beside_m).map(at), SWATH, 0.16);
    }
    grid(&mut picture);
    for (a, b) in plan.area.iter().zip(plan.area.iter().cycle().skip(1)) {
        picture.line(&[at(*a), at(*b)], 0.8 * page.scale, TEXT);
    }
    draw_way(&mut picture, &keys, plan, &at, page);
    let (radius, capitals) = (1.6 * page.scale, page.text());
    let mut taken: Vec<Vec2> = Vec::new();
    for strip in &plan.strips {
        let [start, end] = [strip.start_m, strip.end_m].map(|place| at(place.truncate()));
        if strip.length_m == 0.0 {
            picture.sensor_mark(start, start + Vec2::X, 6.0 * page.scale);
        }
        // Its number beside its start, where there is room.
        let words = strip.strip.to_string();
        let back = (start - end).normalize_or(Vec2::NEG_Y);
        let middle = start + 1.3 * capitals * back;
        let corner = middle + Vec2::new(-0.5 * font::width(&words, capitals), 0.5 * capitals);
        let free = taken.iter().all(|known| known.distance(middle) > 2.2 * capitals);
        if free && map.shows(corner) && map.shows(corner + Vec2::new(font::width(&words, capitals), -capitals)) {
            taken.push(middle);
            picture.text_over(&words, corner, capitals, TEXT);
        }
        if start.distance(end) > 6.0 * radius {
            let tip = start.lerp(end, 0.5);
            let side = 3.0 * radius * back.perp();
            let wings = [[tip, tip + 4.0 * radius * back + side], [tip, tip + 4.0 * radius * back - side]];
            picture.stroke(&wings, 0.7 * radius, STRIP, 1.0);
        }
    }
    scale_bar(&mut picture, map.zoom, unit, page);
    let entry = |name: &str, color: Color, count: usize| LegendEntry { name: name.into(), color, count };
    let between = plan.strips.len().saturating_sub(1);
    let mut entries = vec![entry("strips", STRIP, plan.strips.len()), entry("turns", WAY, between)];
    if plan.swath_m > 0.0 {
        entries.insert(1, entry("swaths", SWATH, plan.strips.len()));
    }
    let title = format!("Plan of {}", counted(plan.strips.len(), "strip"));
    let mut notes = vec![format!("lines every {}", length(unit))];
    if plan.swath_m > 0.0 {
        notes.insert(0, format!("swath {:.0} m", plan.swath_m));
    }
    page.compose(&title, &notes.join("; "), &picture, &legend::draw(&Legend::Names(entries), page))
}

/// Corners of what a strip covers on level ground; `beside`: to the right (negative) and to the left, m.
fn swath_corners(start: DVec3, end: DVec3, beside: [f64; 2]) -> [DVec2; 4] {
    let (start, end) = (start.truncate(), end.truncate());
    let left = (end - start).normalize_or(DVec2::X).perp();
    [start + left * beside[0], start + left * beside[1], end + left * beside[1], end + left * beside[0]]
}

/// Draws the way of the platform: strips bright, turns thin.
fn draw_way(
    picture: &mut Picture,
    keys: &[(f64, ground::pose::Pose)],
    plan: &SurveyPlan,
    at: &dyn Fn(DVec2) -> Vec2,
    page: &Page,
) {
    let on_strip = |time: f64| {
        let after = plan.strips.partition_point(|strip| strip.from_s <= time);
        after.checked_sub(1).is_some_and(|index| time < plan.strips[index].to_s)
    };
    // Strips are drawn over turns.
    for drawn in [false, true] {
        for ends in keys.windows(2) {
            let on = on_strip(0.5 * (ends[0].0 + ends[1].0));
            if on == drawn {
                let [a, b] = [ends[0].1, ends[1].1].map(|pose| at(pose.position.truncate()));
                let (radius, color) = if on { (1.3, STRIP) } else { (0.7, WAY) };
                picture.line(&[a, b], radius * page.scale, color);
            }
        }
    }
}

/// Blends `color` over a convex shape with four corners, clipped to the picture.
fn band(picture: &mut Picture, corners: [Vec2; 4], color: Color, opacity: f32) {
    let (low, high) = corners
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), corner| (low.min(corner.y), high.max(corner.y)));
    let sides = [[0, 1], [1, 2], [2, 3], [3, 0]].map(|[a, b]| [corners[a], corners[b]]);
    // Casts saturate.
    for y in low.max(0.0) as u32..high.clamp(0.0, picture.height as f32).ceil() as u32 {
        let middle = y as f32 + 0.5;
        let crossed = sides.iter().filter(|[a, b]| (a.y <= middle) != (b.y <= middle));
        let xs = crossed.map(|[a, b]| a.x + (middle - a.y) / (b.y - a.y) * (b.x - a.x));
        let [left, right] = xs.fold([f32::INFINITY, f32::NEG_INFINITY], |[left, right], x| [left.min(x), right.max(x)]);
        let (left, right) = (left.max(0.0).round() as u32, right.clamp(0.0, picture.width as f32).round() as u32);
        if right > left {
            picture.fill([left, y], [right - left, 1], color, opacity);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A band covers as many pixels as its area, also where it is turned; outside of the picture nothing happens.
    #[test]
    fn bands_cover_their_area() {
        for angle in [0.0_f32, 0.4, 1.2] {
            let mut picture = Picture::new(200, 200, [0; 3]);
            let (middle, along) = (Vec2::splat(100.0), Vec2::from_angle(angle));
            let corner = |x: f32, y: f32| middle + x * along + y * along.perp();
            band(
                &mut picture,
                [corner(-60.0, -20.0), corner(-60.0, 20.0), corner(60.0, 20.0), corner(60.0, -20.0)],
                [200; 3],
                1.0,
            );
            let covered = picture.pixels.iter().filter(|&&byte| byte == 200).count() / 3;
            assert!(covered.abs_diff(120 * 40) < 200, "{covered}");
        }
        let mut picture = Picture::new(10, 10, [0; 3]);
        band(
            &mut picture,
            [Vec2::splat(-9.0), Vec2::new(-9.0, -3.0), Vec2::splat(-3.0), Vec2::new(-3.0, -9.0)],
            [9; 3],
            1.0,
        );
        assert!(picture.pixels.iter().all(|&byte| byte == 0));
    }
}
