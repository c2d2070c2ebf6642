//! A plan of a scene: the view from above, with coordinates and cameras, for choosing the position of a sensor.

use super::canvas::{GROUND, Picture, TEXT};
use super::legend::{self, counted, round_down};
use super::paint::{Legend, Paint};
use super::points::{Points, quantile};
use super::splat::{SAMPLES, Splats};
use super::top::{Map, scale_bar};
use super::{ColorBy, Page, canvas, font};
use cloud::PointCloud;
use engine::scene::{Camera, Scene};
use engine::trace::{Below, BuiltScene, MapRaster};
use glam::{DVec3, Vec2};
use ground::report::Report;
use std::collections::BTreeMap;

/// Bodies and walls that the plan cuts through.
const CUT: canvas::Color = [0xb9, 0xbc, 0xc2];
/// Samples along a side of the coarse raster by which a ceiling is found.
const COARSE: usize = 64;
/// Thickness of the layer that holds a ceiling, m, and the least fraction of the scene that it covers.
const LAYER: f32 = 0.3;
const COVER: f32 = 0.6;
/// Least height of a room, m.
const ROOM: f32 = 1.5;
/// Height above the floor at which a plan of rooms is cut, m, or this fraction of the room's height if that is less:
/// above tables and through doors.
const EYES: f32 = 1.5;
const PART: f32 = 0.6;

/// The plan of `scene`, `built` from it; empty if there is nothing in it.
pub(super) fn draw(scene: &Scene, built: &BuiltScene, page: &Page) -> Picture {
    let Some((low, high)) = scene.bounds() else { return page.empty("no triangles") };
    let [low, high] = [low, high].map(|end| (end - built.origin()).as_vec3());
    let map = Map::around(low.truncate(), high.truncate(), page);
    let cut = cut(built, [low.truncate(), high.truncate()], high.z + 1.0);
    let raster = map.raster(SAMPLES);
    let below = built.below(&raster, cut.unwrap_or(high.z + 1.0));
    let walls = cut.map(|at| built.walls(&map.raster(1), at));

    let cloud = cloud(scene, built, &raster, &below);
    let points = Points::new(&cloud, &mut Report::default());
    if points.count == 0 {
        return page.empty("no triangles");
    }
    // A single category carries no information.
    let color = if scene.labels.category.ids.len() > 1 { ColorBy::Label } else { ColorBy::Height };
    let paint = Paint::new(&cloud, &points, color, &mut Report::default());
    let mut picture = Picture::new(map.width, map.height, GROUND);
    surfaces(&mut picture, &map, &points, &paint);
    if let Some(walls) = walls {
        let width = map.width as usize;
        for (pixel, wall) in walls.into_iter().enumerate() {
            let [x, y] = [pixel % width, pixel / width];
            // The first sample of a pixel represents it.
            if wall || below[SAMPLES as usize * (y * raster.width + x)].cut {
                picture.fill([x as u32, y as u32], [1, 1], CUT, 1.0);
            }
        }
    }

    let unit = round_down(f64::from(map.width as f32 / map.zoom) / 8.0);
    let height = |at: Vec2| height(&raster, &below, built.origin(), at);
    grid(&mut picture, &map, unit, built.origin(), height, page);
    let outside = draw_cameras(&mut picture, &map, &scene.cameras, built.origin(), page);
    scale_bar(&mut picture, map.zoom, unit, page);

    let mut notes = vec![format!("lines every {}, heights z at their crossings", super::top::length(unit))];
    if let Some(cut) = cut {
        notes.push(format!("cut open at z = {:.1} m, below the ceiling", f64::from(cut) + built.origin().z));
    }
    if outside > 0 {
        notes.push(format!("{} outside of the picture", counted(outside, "camera")));
    }
    let legend = match paint.legend() {
        Legend::Names(_) => legend::draw(&objects_of(scene, paint.legend()), page),
        scale => legend::draw(scale, page),
    };
    let cameras = match scene.cameras.len() {
        0 => "no cameras".to_owned(),
        count => counted(count, "camera"),
    };
    let title = format!("Plan by {}, {cameras}", paint.name());
    page.compose(&title, &notes.join("; "), &picture, &legend)
}

/// A scene seen from above.
pub(super) struct MapBase<'m> {
    pub picture: Picture,
    /// A round length that suits scale bar and grid, m.
    pub unit: f64,
    /// Draws lines at round coordinates, with heights at their crossings.
    pub grid: Box<dyn Fn(&mut Picture) + 'm>,
}

/// What `scene`, `built` from it, looks like from above, by height; `None`: there is nothing in it.
pub(super) fn base<'m>(scene: &Scene, built: &'m BuiltScene, map: &'m Map, page: &'m Page) -> Option<MapBase<'m>> {
    let (_, high) = scene.bounds()?;
    let raster = map.raster(SAMPLES);
    let below = built.below(&raster, (high - built.origin()).as_vec3().z + 1.0);
    let cloud = cloud(scene, built, &raster, &below);
    let points = Points::new(&cloud, &mut Report::default());
    if points.count == 0 {
        return None;
    }
    let mut picture = Picture::new(map.width, map.height, GROUND);
    let paint = Paint::new(&cloud, &points, ColorBy::Height, &mut Report::default());
    surfaces(&mut picture, map, &points, &paint);
    let unit = round_down(f64::from(map.width as f32 / map.zoom) / 8.0);
    let draw_grid = move |picture: &mut Picture| {
        grid(picture, map, unit, built.origin(), |at| height(&raster, &below, built.origin(), at), page);
    };
    Some(MapBase { picture, unit, grid: Box::new(draw_grid) })
}

/// Draws the surfaces of `points`, which are those of the map, darker at steps.
fn surfaces(picture: &mut Picture, map: &Map, points: &Points, paint: &Paint) {
    let splats = Splats::new(map.width, map.height);
    splats.fill(|x, y, [width, _]| {
        let row = y * width + x;
        points.get(row).map(|position| (-position.z, row))
    });
    let step = 0.02 * map.height as f32 / map.zoom;
    splats.draw(picture, paint, |depth| depth / step);
}

/// Height of the surface at a pixel, m.
fn height(raster: &MapRaster, below: &[Below], origin: DVec3, at: Vec2) -> Option<f64> {
    let [column, row] = (at * SAMPLES as f32).to_array().map(|place| place as usize);
    let seen = below.get(row * raster.width + column).filter(|below| below.z.is_finite() && !below.cut)?;
    Some(f64::from(seen.z) + origin.z)
}

/// Height at which to cut through a scene whose top is a ceiling, m; `None` if it has none. A ceiling is a level layer
/// over most of the scene, with rooms below it.
fn cut(built: &BuiltScene, [low, high]: [Vec2; 2], top: f32) -> Option<f32> {
    let step = (high - low).max_element() / COARSE as f32;
    let count = |size: f32| ((size / step) as usize).max(1);
    let corner = Vec2::new(low.x, high.y) + 0.5 * Vec2::new(step, -step);
    let raster = MapRaster { corner: corner.into(), step, width: count(high.x - low.x), height: count(high.y - low.y) };
    let median = |seen: &[Below]| {
        let mut heights: Vec<f32> = seen.iter().map(|below| below.z).filter(|z| z.is_finite()).collect();
        (!heights.is_empty()).then(|| (quantile(&mut heights, 0.5), heights))
    };
    let (layer, heights) = median(&built.below(&raster, top))?;
    let level = heights.iter().filter(|&&z| (z - layer).abs() < 0.5 * LAYER).count();
    if (level as f32) < COVER * heights.len() as f32 {
        return None;
    }
    let mut from = layer - 0.5 * LAYER;
    let mut seen = built.below(&raster, from);
    // Inside a slab, its underside is found first.
    if 2 * seen.iter().filter(|below| below.cut).count() > seen.len() {
        let (underside, _) = median(&seen)?;
        from = underside - 0.05;
        seen = built.below(&raster, from);
    }
    let (floor, heights) = median(&seen)?;
    let room = from - floor;
    let rooms = room >= ROOM && heights.len() as f32 >= COVER * level as f32;
    rooms.then(|| floor + EYES.min(PART * room))
}

/// The visible surfaces, as points.
fn cloud(scene: &Scene, built: &BuiltScene, raster: &MapRaster, below: &[Below]) -> PointCloud {
    let mut cloud = PointCloud { len: below.len(), origin: built.origin(), ..PointCloud::default() };
    cloud.sensor_pose.position = built.origin();
    cloud.labels = std::sync::Arc::new(scene.labels.clone());
    for (index, seen) in below.iter().enumerate() {
        let [x, y] = raster.place(index);
        cloud.columns.x.push(x);
        cloud.columns.y.push(y);
        cloud.columns.z.push(if seen.cut { f32::NAN } else { seen.z });
        cloud.columns.category_id.push(seen.category_id);
    }
    cloud
}

/// Lines at round coordinates of the world, with their values, and the heights where they cross.
fn grid(picture: &mut Picture, map: &Map, unit: f64, origin: DVec3, height: impl Fn(Vec2) -> Option<f64>, page: &Page) {
    let decimals = (-unit.log10().floor()).max(0.0) as usize;
    let number = |value: f64| format!("{:.decimals$}", value + 0.0);
    // Multiples of the unit between two ends.
    let lines = |ends: [f64; 2]| {
        let first = (ends[0] / unit).ceil() as i64;
        let last = (ends[1] / unit).floor() as i64;
        (first..=last).map(|line| line as f64 * unit).collect::<Vec<_>>()
    };
    let size = Vec2::new(map.width as f32, map.height as f32) / map.zoom;
    let corner = map.corner.as_dvec2() + origin.truncate();
    let xs = lines([corner.x, corner.x + f64::from(size.x)]);
    let ys = lines([corner.y - f64::from(size.y), corner.y]);
    let across = |x: f64| (x - corner.x) as f32 * map.zoom;
    let down = |y: f64| (corner.y - y) as f32 * map.zoom;
    let thickness = page.px(1.0);
    xs.iter().for_each(|&x| picture.fill([across(x) as u32, 0], [thickness, map.height], TEXT, 0.16));
    ys.iter().for_each(|&y| picture.fill([0, down(y) as u32], [map.width, thickness], TEXT, 0.16));
    let (capitals, small) = (page.text(), 0.8 * page.text());
    for &x in &xs {
        for &y in &ys {
            let at = Vec2::new(across(x), down(y));
            if let Some(z) = height(at) {
                // Adding zero turns -0 into 0.
                let words = format!("{:.1}", (10.0 * z).round() / 10.0 + 0.0);
                picture.text_over(&words, at + Vec2::new(0.5 * small, 1.6 * small), small, TEXT);
            }
        }
    }
    for &x in &xs {
        let words = number(x);
        let start = Vec2::new(across(x) - 0.5 * font::width(&words, capitals), 1.7 * capitals);
        picture.text_over(&words, start, capitals, TEXT);
    }
    for &y in ys.iter().filter(|&&y| down(y) > 4.0 * capitals) {
        picture.text_over(&number(y), Vec2::new(0.7 * capitals, down(y) + 0.5 * capitals), capitals, TEXT);
    }
}

/// Marks the cameras, with name and height where there is room; returns how many are outside of the picture.
fn draw_cameras(picture: &mut Picture, map: &Map, cameras: &[Camera], origin: DVec3, page: &Page) -> usize {
    let (size, capitals) = (8.0 * page.scale, page.text());
    let mut taken: Vec<[Vec2; 2]> = Vec::new();
    let mut outside = 0;
    let mut names = Vec::new();
    for camera in cameras {
        let place = (camera.pose.position - origin).as_vec3();
        let at = map.project(place);
        if !map.shows(at) {
            outside += 1;
            continue;
        }
        picture.sensor_mark(at, map.project(place + camera.pose.rotation().x_axis.as_vec3()), size);
        taken.push([at - 1.5 * size, at + 1.5 * size]);
        names.push((at, format!("{} z {:.1}", camera.name, camera.pose.position.z)));
    }
    for (at, words) in names {
        let room = Vec2::new(font::width(&words, capitals), 1.4 * capitals);
        let right = Vec2::new(2.0 * size, -0.5 * room.y);
        let left = Vec2::new(-2.0 * size - room.x, -0.5 * room.y);
        // Beside the mark, or as near above or below it as there is room.
        let shifts = (0..8).flat_map(|step| [1.0, -1.0].map(|sign| Vec2::new(0.0, sign * step as f32 * room.y)));
        let free = shifts.flat_map(|shift| [at + right + shift, at + left + shift]).find(|&corner| {
            let inside = corner.x >= 0.0 && corner.x + room.x < map.width as f32;
            inside && taken.iter().all(|[low, high]| corner.cmpge(*high).any() || (corner + room).cmple(*low).any())
        });
        let Some(corner) = free else { continue };
        taken.push([corner, corner + room]);
        picture.text_over(&words, corner + Vec2::new(0.0, 1.2 * capitals), capitals, TEXT);
    }
    outside
}

/// The names of `legend` with the numbers of objects.
fn objects_of(scene: &Scene, legend: &Legend) -> Legend {
    let mut objects: BTreeMap<&str, usize> = BTreeMap::new();
    for object in &scene.objects {
        *objects.entry(scene.labels.category.name(object.category_id).unwrap_or("unlabelled")).or_default() += 1;
    }
    let Legend::Names(entries) = legend else { return legend.clone() };
    let mut entries = entries.clone();
    for entry in &mut entries {
        entry.count = objects.remove(entry.name.as_str()).unwrap_or_default();
    }
    // The entry that sums up the others is last, and is not the name of a category.
    if let Some(rest) = entries.last_mut().filter(|rest| rest.count == 0) {
        rest.count = objects.values().sum();
    }
    Legend::Names(entries)
}

#[cfg(test)]
mod tests {
    use super::*;
    use worlds::{Indoor, Street};

    fn loaded(generated: &worlds::GeneratedScene) -> (Scene, BuiltScene) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scene.glb");
        generated.write(&file).unwrap();
        let scene = Scene::load(&file).unwrap();
        let built = scene.build().unwrap();
        (scene, built)
    }

    fn ends(scene: &Scene, built: &BuiltScene) -> [glam::Vec3; 2] {
        let (low, high) = scene.bounds().unwrap();
        [low, high].map(|end| (end - built.origin()).as_vec3())
    }

    #[test]
    fn rooms_are_cut_open_and_streets_are_not() {
        let indoor = Indoor::default().height_m(2.6);
        for (ceiling, expected) in [(true, true), (false, false)] {
            let (scene, built) = loaded(&indoor.clone().ceiling(ceiling).scene(1).unwrap());
            let [low, high] = ends(&scene, &built);
            let at = cut(&built, [low.truncate(), high.truncate()], high.z + 1.0);
            assert_eq!(at.is_some(), expected, "{at:?}");
            if let Some(at) = at {
                let z = f64::from(at) + built.origin().z;
                assert!((1.3..1.7).contains(&z), "{z}");
                // Walls are cut, rooms are not.
                let raster = Map::around(low.truncate(), high.truncate(), &Page::new(320)).raster(1);
                let walls = built.walls(&raster, at).iter().filter(|&&wall| wall).count() as f32;
                assert!((0.01..0.2).contains(&(walls / raster.points() as f32)), "{walls} of {}", raster.points());
            }
        }
        let (scene, built) = loaded(&Street::default().scene(1).unwrap());
        let [low, high] = ends(&scene, &built);
        assert_eq!(cut(&built, [low.truncate(), high.truncate()], high.z + 1.0), None);
    }

    #[test]
    fn a_plan_shows_what_is_where() {
        let (scene, built) = loaded(&Street::default().scene(1).unwrap());
        let page = Page::new(800);
        let picture = draw(&scene, &built, &page);
        let [low, high] = ends(&scene, &built);
        let map = Map::around(low.truncate(), high.truncate(), &page);
        let id = |name| scene.labels.category.id(name);
        let near =
            |color: canvas::Color, target: canvas::Color| color.iter().zip(target).all(|(a, b)| a.abs_diff(b) < 20);
        let count = |target| {
            let inside = |x: u32, y: u32| picture.pixel(page.margin() + x, page.panel_top() + y);
            (0..map.width * map.height).filter(|at| near(inside(at % map.width, at / map.width), target)).count()
        };
        for name in ["road", "building", "car"] {
            assert!(count(super::super::palette::category(id(name))) > 100, "{name}");
        }
        // Every camera is marked.
        for camera in &scene.cameras {
            let at = map.project((camera.pose.position - built.origin()).as_vec3());
            let color = picture.pixel(page.margin() + at.x as u32, page.panel_top() + at.y as u32);
            assert!(near(color, TEXT), "{color:?}");
        }
        // An empty scene is not an error.
        assert_eq!(draw(&Scene::default(), &built, &page), page.empty("no triangles"));
    }
}
