//! The cloud from above, without perspective: a map.

use super::boxes::{self, BoxEdges};
use super::canvas::{GRID, GROUND, Picture, TEXT};
use super::cutaway::Cutaway;
use super::legend::{counted, round_down};
use super::paint::Paint;
use super::points::{Points, robust_span};
use super::splat::{self, SplatStamp, Splats};
use super::{Page, font};
use engine::trace::MapRaster;
use glam::{Vec2, Vec3};

/// Position and scale of the map in the world.
pub(super) struct Map {
    /// World position of the top left corner, metres.
    pub corner: Vec2,
    /// Pixels per metre.
    pub zoom: f32,
    pub width: u32,
    pub height: u32,
}

impl Map {
    fn new(points: &Points<'_>, page: &Page) -> Map {
        let along = |axis: usize| {
            let mut values: Vec<f32> = points.scene.iter().map(|position| position[axis]).collect();
            let [low, high] = robust_span(&mut values, 0.005);
            // The sensor belongs on the map unless that makes the scene too small.
            let (first, last) = (low.min(points.sensor[axis]), high.max(points.sensor[axis]));
            if last - first < 1.7 * (high - low) { [first, last] } else { [low, high] }
        };
        let [x, y] = [along(0), along(1)];
        Map::around(Vec2::new(x[0], y[0]), Vec2::new(x[1], y[1]), page)
    }

    /// A map of the area between `low` and `high`, with a margin.
    pub(super) fn around(low: Vec2, high: Vec2, page: &Page) -> Map {
        let centre = low.midpoint(high);
        // Even a line needs an extent.
        let size = 1.06 * (high - low).max(Vec2::splat(1e-3));
        let width = page.inner();
        let height = (width as f32 * (size.y / size.x).clamp(0.42, 0.68)) as u32;
        let pixels = Vec2::new(width as f32, height as f32);
        let zoom = (pixels / size).min_element();
        Map { corner: centre + Vec2::new(-0.5, 0.5) * pixels / zoom, zoom, width, height }
    }

    /// The map as a raster, with `samples` along each side of a pixel.
    pub(super) fn raster(&self, samples: u32) -> MapRaster {
        let step = 1.0 / (self.zoom * samples as f32);
        let corner = self.corner + 0.5 * Vec2::new(step, -step);
        let [width, height] = [self.width, self.height].map(|pixels| (pixels * samples) as usize);
        MapRaster { corner: corner.into(), step, width, height }
    }

    /// Pixels from the top left corner, y down.
    pub(super) fn project(&self, position: Vec3) -> Vec2 {
        (position.truncate() - self.corner) * Vec2::new(self.zoom, -self.zoom)
    }

    pub(super) fn shows(&self, at: Vec2) -> bool {
        at.x >= 0.0 && at.y >= 0.0 && at.x < self.width as f32 && at.y < self.height as f32
    }
}

/// The map of `points`; what it leaves out is added to `notes`.
pub(super) fn draw(
    points: &Points<'_>,
    paint: &Paint<'_>,
    outlines: &[BoxEdges],
    page: &Page,
    notes: &mut Vec<String>,
) -> Picture {
    let map = Map::new(points, page);
    let mut picture = Picture::new(map.width, map.height, GROUND);
    // A round length that suits scale bar and grid.
    let unit = round_down(f64::from(map.width as f32 / map.zoom) / 6.0);
    grid(&mut picture, &map, unit, page);

    let ceiling = Cutaway::new(points).ceiling;
    let stamp = SplatStamp::disc(splat::diameter(points.count, &picture, 3.5 * page.scale));
    let splats = Splats::new(map.width, map.height);
    let outside = points.count_rows(|row| {
        let Some(position) = points.get(row) else { return false };
        if position.z > ceiling && points.cause(row).has_surface() {
            return false;
        }
        let at = map.project(position);
        // Higher is nearer to the viewer.
        splats.put(at, &stamp, -position.z, row);
        !map.shows(at)
    });
    // A step of 2 % of the map's height gives the maximum darkening.
    let step = 0.02 * map.height as f32 / map.zoom;
    splats.draw(&mut picture, paint, |depth| depth / step);
    boxes::draw(&mut picture, outlines, page, |edge| [edge.map(|end| map.project(end))]);

    let sensor = map.project(points.sensor);
    if map.shows(sensor) {
        let ahead = map.project(points.sensor + points.orientation * Vec3::X);
        picture.sensor_mark(sensor, ahead, 8.0 * page.scale);
    }
    scale_bar(&mut picture, map.zoom, unit, page);

    if ceiling.is_finite() {
        notes.push(format!("cut open under the ceiling at z = {:.1} m", f64::from(ceiling) + points.height_origin));
    }
    if outside > 0 {
        notes.push(format!("{} outside of the picture", counted(outside, "point")));
    }
    picture
}

/// Faint lines every `unit` metres from the centre of the map.
fn grid(picture: &mut Picture, map: &Map, unit: f64, page: &Page) {
    let step = unit as f32 * map.zoom;
    let thickness = page.px(1.0);
    let lines = |size: u32| {
        let first = (size as f32 / 2.0).rem_euclid(step);
        (0..).map(move |i| first + i as f32 * step).take_while(move |&at| at < size as f32).map(|at| at as u32)
    };
    for x in lines(map.width) {
        picture.fill([x, 0], [thickness, map.height], GRID, 1.0);
    }
    for y in lines(map.height) {
        picture.fill([0, y], [map.width, thickness], GRID, 1.0);
    }
}

/// Draws a scale bar of the length `unit`, at `zoom` pixels per metre, in the bottom left corner, and the directions of
/// x and y.
pub(super) fn scale_bar(picture: &mut Picture, zoom: f32, unit: f64, page: &Page) {
    let capitals = page.text();
    let start = Vec2::new(2.0 * capitals, picture.height as f32 - 2.0 * capitals);
    let end = start + Vec2::new(unit as f32 * zoom, 0.0);
    let up = Vec2::new(0.0, -0.45 * capitals);
    let bar = [[start, end], [start + up, start - up], [end + up, end - up]];
    picture.stroke(&bar, 0.32 * capitals, GROUND, 0.75);
    picture.stroke(&bar, 0.08 * capitals, TEXT, 1.0);
    let words = length(unit);
    let left = start.x.midpoint(end.x) - font::width(&words, capitals) / 2.0;
    picture.text_over(&words, Vec2::new(left, start.y - 0.8 * capitals), capitals, TEXT);

    let corner = Vec2::new(picture.width as f32 - 6.0 * capitals, start.y);
    for (direction, name) in [(Vec2::X, "x"), (Vec2::NEG_Y, "y")] {
        let tip = corner + 2.6 * capitals * direction;
        let side = 0.35 * capitals * direction.perp();
        let back = tip - 0.6 * capitals * direction;
        let arrow = [[corner, tip], [tip, back + side], [tip, back - side]];
        picture.stroke(&arrow, 0.32 * capitals, GROUND, 0.75);
        picture.stroke(&arrow, 0.08 * capitals, TEXT, 1.0);
        let middle = tip + 0.9 * capitals * direction;
        let start = middle + Vec2::new(-0.5 * font::width(name, capitals), 0.35 * capitals);
        picture.text_over(name, start, capitals, TEXT);
    }
}

/// `metres`, a round length, with a unit that needs few digits.
pub(super) fn length(metres: f64) -> String {
    let (value, unit) = match metres {
        m if m >= 1000.0 => (m / 1000.0, "km"),
        m if m >= 0.995 => (m, "m"),
        m if m >= 0.009_95 => (m * 100.0, "cm"),
        m => (m * 1000.0, "mm"),
    };
    if value >= 0.995 { format!("{value:.0} {unit}") } else { format!("{value:.1e} {unit}") }
}

#[cfg(test)]
mod tests {
    use super::super::{ColorBy, PreviewOptions, View, palette, render};
    use super::*;
    use cloud::PointCloud;
    use ground::report::Report;

    /// Points every 5 cm on a floor 10 m x 5 m with its corner at the origin, category 1, and on a table 1 m x 1 m at
    /// 7, 3, category 2.
    fn scene() -> PointCloud {
        let mut cloud = PointCloud::default();
        let mut push = |[x, y, z]: [f32; 3], category| {
            cloud.columns.x.push(x);
            cloud.columns.y.push(y);
            cloud.columns.z.push(z);
            cloud.columns.category_id.push(category);
        };
        for i in 0..=200 {
            for j in 0..=100 {
                let [x, y] = [i as f32 / 20.0, j as f32 / 20.0];
                let table = (7.0..8.0).contains(&x) && (3.0..4.0).contains(&y);
                if table {
                    push([x, y, 0.7], 2);
                }
                push([x, y, 0.0], 1);
            }
        }
        cloud.len = cloud.columns.x.len();
        cloud
    }

    fn picture(cloud: &PointCloud) -> Picture {
        let options = PreviewOptions { view: View::Top, width: 800, ..PreviewOptions::default() };
        render(cloud, &options, &mut Report::default()).unwrap()
    }

    #[test]
    fn points_lie_where_the_map_says_and_the_highest_wins() {
        let cloud = scene();
        let points = Points::new(&cloud, &mut Report::default());
        let page = Page::new(800);
        let map = Map::new(&points, &page);
        let picture = picture(&cloud);
        let at = |x, y| {
            let at = map.project(Vec3::new(x, y, 0.0));
            picture.pixel(page.margin() + at.x as u32, page.panel_top() + at.y as u32)
        };
        assert_eq!(at(7.5, 3.5), palette::category(2));
        assert_eq!(at(3.0, 3.5), palette::category(1));
        assert_eq!(at(7.5, 1.0), palette::category(1));
        assert_eq!(at(4.3, 5.11), GROUND);
        // y runs up, x to the right, and the whole width is used.
        assert!(map.project(Vec3::Y).y < map.project(Vec3::ZERO).y);
        let used = (map.project(10.0 * Vec3::X) - map.project(Vec3::ZERO)).x / map.width as f32;
        assert!((0.9..0.96).contains(&used), "{used}");
    }

    #[test]
    fn few_far_points_do_not_shrink_the_scene() {
        let mut cloud = scene();
        let near = Map::new(&Points::new(&cloud, &mut Report::default()), &Page::new(800)).zoom;
        for row in 0..10 {
            cloud.columns.x[row * 1000] = 500.0 * row as f32;
        }
        let points = Points::new(&cloud, &mut Report::default());
        let zoom = Map::new(&points, &Page::new(800)).zoom;
        assert!((zoom / near - 1.0).abs() < 0.02, "{zoom} {near}");
        let mut notes = Vec::new();
        let paint = Paint::new(&cloud, &points, ColorBy::Height, &mut Report::default());
        draw(&points, &paint, &[], &Page::new(800), &mut notes);
        assert_eq!(notes, ["9 points outside of the picture"]);
    }

    #[test]
    fn lengths_have_fitting_units() {
        let words = [2000.0, 50.0, 1.0, 0.2, 0.005].map(length);
        assert_eq!(words, ["2 km", "50 m", "1 m", "20 cm", "5 mm"]);
    }
}
