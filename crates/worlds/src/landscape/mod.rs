//! A landscape: hills eroded by water, trees, bushes, grass and rocks, a path and a stream.

mod course;
mod drainage;
mod ground;
mod heights;
mod plants;
mod relief;
mod scatter;
mod sites;
mod species;
mod terrain;
#[cfg(test)]
mod tests;
mod tree;

use super::glb::{Glb, Look, Placement};
use super::noise::GradientNoise;
use super::{GeneratedScene, within};
use ::ground::builder;
use ::ground::error::{Error, Result};
use course::Course;
use glam::{DQuat, DVec2, DVec3, EulerRot};
use heights::HeightRaster;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::PathBuf;
use terrain::Terrain;

/// Maximum number of triangles of the ground.
const MOST_TRIANGLES: f64 = 10e6;
/// Default maximum number of triangles of the ground.
const USUAL_TRIANGLES: f64 = 1e6;
/// Finest cells by default, m.
const USUAL_CELL: f64 = 0.5;
/// Maximum number of each kind of plant or rock.
const MOST_OBJECTS: f64 = 1e6;

builder! {
    /// Parameters of a landscape about the z axis: woodland on hills, or on a height map.
    ///
    /// The land is ridged multifractal noise along a valley that descends towards -x, eroded by streams and soil creep.
    /// Objects have the categories `terrain` (parts `turf`, `soil`, `rock` where it is steep, `sand` beside the
    /// stream), `path`, `water`, `tree` and `bush` (parts `trunk`, `branch` and `leaf`), `grass` and `rock`. Trees are
    /// oaks, birches, spruces and dead trees, three of each kind, grown after Weber & Penn (1995). Every tree, bush and
    /// rock is an instance, as is each patch of [`Landscape::TUFTS`] tufts of grass. Plants and rocks keep off the path
    /// and out of the stream.
    ///
    /// The path winds from the low end of x to the high one; the stream runs where most water drains from the land. The
    /// camera node `Lidar` is 1.8 m above the path (without one, above the ground), near the middle where trees are
    /// farthest away, and looks along the path or along x; `Overview` looks down on everything from the low corner of x
    /// and y.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Landscape {
        /// Extent along x and y, 10 to 10 000 m; that of the height map if its file gives the spacing of its samples.
        pub size_m: [f64; 2] = [100.0, 100.0],
        /// Spacing of the grid. `None`: 0.5 m or as fine as a million triangles allow; with a height map, its samples.
        pub cell_m: Option<f64> = None,
        /// Height of the highest point above the lowest, 0 to 5000 m, before the stream is carved; not used with a
        /// height map.
        pub relief_m: f64 = 12.0,
        /// Trees per hectare, 0 to 5000.
        pub trees_per_ha: f64 = 300.0,
        /// Bushes per hectare, 0 to 5000.
        pub bushes_per_ha: f64 = 200.0,
        /// Rocks of 0.2 to 2 m per hectare, 0 to 5000.
        pub rocks_per_ha: f64 = 100.0,
        /// Tufts of grass per square metre of turf, 0 to 30.
        pub grass_per_m2: f64 = 10.0,
        /// Whether there is a path.
        pub path: bool = true,
        /// Whether there is a stream, if the land has room for one.
        pub stream: bool = true,
        /// Heights from a file.
        pub height_map: Option<HeightMap> = None,
    }
}

builder! {
    /// A file of heights: a PNG of 16 bits, a GeoTIFF in metres or an ESRI ASCII grid, up to 25 million samples.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct HeightMap {
        /// The file; its kind is recognised by its contents.
        pub file: PathBuf,
        /// Heights of black and white in a PNG, m; not for files that hold metres.
        #[serde(default)]
        pub range_m: Option<[f64; 2]>,
    }
}

/// The land with its path and stream.
struct Land {
    terrain: Terrain,
    path: Option<Course>,
    stream: Option<Course>,
    /// Where the soil is bare.
    cover: GradientNoise,
}

impl HeightMap {
    /// The heights in `file`.
    pub fn new(file: impl Into<PathBuf>) -> HeightMap {
        HeightMap { file: file.into(), range_m: None }
    }
}

impl Landscape {
    /// Number of tufts of a patch of grass.
    pub const TUFTS: usize = sites::TUFTS;

    /// The landscape of the paper that this library builds on (Reitmann, Neumann & Jung 2021, Sensors 21, 2144, section
    /// 3.1 and figure 4a): hills with grass, trees, rocks and stones, without path or water. Its trees follow the same
    /// model, that of Weber & Penn.
    pub fn paper() -> Self {
        Landscape {
            relief_m: 15.0,
            trees_per_ha: 120.0,
            bushes_per_ha: 0.0,
            rocks_per_ha: 200.0,
            grass_per_m2: 12.0,
            path: false,
            stream: false,
            ..Landscape::default()
        }
    }

    /// Generates the scene.
    ///
    /// # Errors
    /// A parameter outside its range, more than 10 million triangles in the ground or a million objects of a kind; the
    /// message names the field. A height map that cannot be read; the message names the file.
    pub fn scene(&self, seed: u64) -> Result<GeneratedScene> {
        let mut details = Vec::new();
        let land = self.land(seed, &mut details)?;
        self.check_counts(land.terrain.size)?;
        let mut glb = Glb::default();
        ground::add(&mut glb, &land);
        let sites = scatter::sites(self, &land, seed);
        plants::add(&mut glb, &land, &sites, seed);
        for (name, place) in land.cameras(&sites.trees) {
            let camera = glb.camera(name, place);
            glb.root(camera);
        }
        for (what, density, sites) in [
            ("trees", self.trees_per_ha, &sites.trees),
            ("bushes", self.bushes_per_ha, &sites.bushes),
            ("rocks", self.rocks_per_ha, &sites.rocks),
        ] {
            let (found, requested) = (sites.len(), land.count(density));
            if found < requested {
                details.push(format!("room for {found} of {requested} {what}"));
            }
        }
        details.push("cameras Lidar, Overview".to_owned());
        glb.finish(details).map_err(|size| {
            let name = if self.cell_m.is_some() { "cell_m" } else { "size_m" };
            Error::invalid(name, format!("too much for a GLB: {size}"), "larger cells or less land")
        })
    }

    /// The ground with path and stream; adds its description to `details`.
    fn land(&self, seed: u64, details: &mut Vec<String>) -> Result<Land> {
        within("relief_m", self.relief_m, 0.0, 5000.0)?;
        let mut terrain = match &self.height_map {
            Some(map) => self.mapped(map, details)?,
            None => {
                let cells = self.cells(self.size_m, self.cell_m)?;
                relief::terrain(self.size_m, cells, self.relief_m, seed)
            }
        };
        let ([x, y], [columns, rows], [low, high]) = (terrain.size, terrain.cells, terrain.height_range());
        let shown = format!("land of {x} x {y} m, {low:.1} to {high:.1} m high, {columns} x {rows} cells");
        details.insert(0, shown);
        let stream = Some(()).filter(|()| self.stream).and_then(|()| course::stream(&terrain));
        let path = self.path.then(|| course::path(&terrain, stream.as_ref(), seed));
        if let Some(path) = &path {
            course::level(&mut terrain, path);
            details.push(format!("path of {:.0} m", path.length()));
        }
        if let Some(stream) = &stream {
            course::carve(&mut terrain, stream);
            details.push(format!("stream of {:.0} m", stream.length()));
        } else if self.stream {
            details.push("no stream: too little water converges".to_owned());
        }
        let cover = ground::cover(terrain.size, terrain.widest(), seed);
        Ok(Land { terrain, path, stream, cover })
    }

    /// The ground of a height map.
    fn mapped(&self, map: &HeightMap, details: &mut Vec<String>) -> Result<Terrain> {
        let raster = HeightRaster::read(map)?;
        let spaces = [raster.columns - 1, raster.rows() - 1];
        let size = raster.step.map_or(self.size_m, |step| std::array::from_fn(|axis| step[axis] * spaces[axis] as f64));
        let cells = match self.cell_m {
            None => {
                checked_size(size)?;
                if 2.0 * spaces[0] as f64 * spaces[1] as f64 > MOST_TRIANGLES {
                    let finest = finest_cell(size[0], size[1]);
                    let allowed = format!("{finest:.4} or more: the ground has at most 10 million triangles");
                    return Err(Error::invalid("cell_m", "that of the height map", allowed));
                }
                spaces
            }
            Some(_) => self.cells(size, self.cell_m)?,
        };
        let [columns, rows] = [raster.columns, raster.rows()];
        let filled = match raster.filled {
            0 => String::new(),
            filled => format!(", {filled} without a height filled from neighbours"),
        };
        details.push(format!("heights of {columns} x {rows} samples{filled}"));
        Ok(Terrain::from_heights(size, cells, |x, y| raster.at([x / size[0] + 0.5, y / size[1] + 0.5])))
    }

    /// Divides the ground into cells.
    fn cells(&self, size: [f64; 2], cell: Option<f64>) -> Result<[usize; 2]> {
        checked_size(size)?;
        let [x, y] = size;
        let cell = cell.unwrap_or_else(|| USUAL_CELL.max((2.0 * x * y / USUAL_TRIANGLES).sqrt()));
        let (finest, widest) = (finest_cell(x, y), x.min(y) / 4.0);
        if !(finest..=widest).contains(&cell) {
            let most = format!("land of {x} x {y} m has at most 10 million triangles");
            return Err(Error::invalid("cell_m", cell, format!("{:.4} to {widest}: {most}", finest + 0.00005)));
        }
        Ok(size.map(|length| (length / cell - 1e-9).ceil().max(1.0) as usize))
    }

    fn check_counts(&self, [x, y]: [f64; 2]) -> Result<()> {
        let (area, tufts) = (x * y, sites::TUFTS as f64);
        for (name, density, most, unit) in [
            ("trees_per_ha", self.trees_per_ha, 5000.0, 1e4),
            ("bushes_per_ha", self.bushes_per_ha, 5000.0, 1e4),
            ("rocks_per_ha", self.rocks_per_ha, 5000.0, 1e4),
            ("grass_per_m2", self.grass_per_m2, 30.0, tufts),
        ] {
            let fit = MOST_OBJECTS * unit / area;
            if density > fit && (0.0..=most).contains(&density) {
                let allowed = format!("0 to {fit:.3}: land of {x} x {y} m has at most a million of a kind");
                return Err(Error::invalid(name, density, allowed));
            }
            within(name, density, 0.0, most)?;
        }
        Ok(())
    }
}

impl Land {
    /// Number of objects at this density per hectare.
    fn count(&self, per_ha: f64) -> usize {
        let [x, y] = self.terrain.size;
        (per_ha * x * y / 1e4).round() as usize
    }

    fn cameras(&self, trees: &[sites::Site]) -> [(&'static str, Placement); 2] {
        let terrain = &self.terrain;
        let apart = |at: DVec2| trees.iter().map(|tree| tree.at.distance(at)).fold(f64::INFINITY, f64::min);
        let stations = self.path.as_ref().map(|path| path.stations.as_slice()).unwrap_or_default();
        let middle = stations.get(stations.len() / 3..stations.len() * 2 / 3).unwrap_or_default();
        // Where trees are farthest away.
        let clearest = middle.windows(2).max_by(|a, b| apart(a[0].at).total_cmp(&apart(b[0].at)));
        let along = clearest.map(|pair| (pair[0].at, pair[1].at - pair[0].at));
        let (at, ahead) = along.unwrap_or_else(|| {
            let reach = DVec2::from(terrain.size).min(DVec2::splat(100.0)) / 40.0;
            let around = (0..49).map(|i| DVec2::new((i % 7 - 3).into(), (i / 7 - 3).into()) * reach);
            let dry = around.filter(|&at| self.clearance(at) > 1.0);
            (dry.max_by(|&a, &b| apart(a).total_cmp(&apart(b))).unwrap_or_default(), DVec2::X)
        });
        let stands = DVec3::new(at.x, at.y, terrain.height(at.x, at.y) + 1.8);
        let facing = DQuat::from_rotation_z(ahead.y.atan2(ahead.x));
        let [x, y] = terrain.size;
        let [_, high] = terrain.height_range();
        let corner = DVec3::new(-0.5 * x, -0.5 * y, f64::from(high) + 0.25 * x.hypot(y));
        let down = f64::atan2(corner.z - terrain.height(0.0, 0.0), corner.truncate().length());
        let overview = DQuat::from_euler(EulerRot::ZYX, y.atan2(x), down, 0.0);
        [
            ("Lidar", Placement { at: stands, turned: facing, ..Placement::HERE }),
            ("Overview", Placement { at: corner, turned: overview, ..Placement::HERE }),
        ]
    }
}

fn checked_size(size: [f64; 2]) -> Result<()> {
    size.into_iter().try_for_each(|length| within("size_m", length, 10.0, 10_000.0))
}

/// Smallest cell with which `x` times `y` m have at most [`MOST_TRIANGLES`]: the root c of 2 (x / c + 1) (y / c + 1) =
/// most, as one cell per side may be partial.
fn finest_cell(x: f64, y: f64) -> f64 {
    ((x + y) + ((x + y).powi(2) + 2.0 * (MOST_TRIANGLES - 2.0) * x * y).sqrt()) / (MOST_TRIANGLES - 2.0)
}

/// A material with this reflectance at 905 nm. Several may share a name, which is that of the part.
fn material(glb: &mut Glb, name: &str, look: Look, color: [f32; 3], reflectance: f64) -> usize {
    glb.material(name, look, color, json!({ "reflectance": reflectance }))
}
