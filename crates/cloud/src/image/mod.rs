//! Images of what sensors report: of sonar pings the waterfall, mosaic, fan and depth map, each with its labels; of
//! radars range by Doppler and polar images; of cameras and other optical sensors whose beams form rows the
//! [`RangeImage`], and what it shows of each instance.
//!
//! Images of pings are made only from what a sonar reports, as its own software would make them: the scene is not used.
//! Levels are drawn with the sonar's time-varied gain. The pings are not changed.

mod altitude;
mod annotation;
mod fan;
mod grid;
mod layer;
mod layers;
mod mosaic;
mod pixels;
mod radar;
pub mod range_image;
mod soundings;
#[cfg(test)]
pub mod synthetic;
mod waterfall;

pub use altitude::altitudes;
pub use annotation::{Annotation, Runs, annotations, masks, runs_text};
pub use fan::{fan, turning_fan};
pub use layer::Layer;
pub use layers::Layers;
pub use mosaic::{Overlap, mosaic};
pub use mosaic::{fitting as fitting_mosaic, heading};
pub use radar::{polar, polar_fan, range_doppler};
pub use range_image::RangeImage;
pub use soundings::depth_map;
pub use soundings::fitting_cell as fitting_depth_cell;
pub use waterfall::middle_beam as waterfall_beam;
pub use waterfall::waterfall;

use crate::cells::SonarView;
use crate::{Column, Field, Ping, Pings};
use echocast_memory::tried;
use ground::error::{Error, Result};
use ground::named;
use model::Labels;
use std::sync::Arc;

/// Kind of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageKind {
    /// A row for each ping, the first at the top.
    Waterfall,
    /// What the sonar saw, from above: x to the right, y up.
    Mosaic,
    /// What one ping, or one turn of a beam, of a sonar saw, laid out by beam and range.
    Fan,
    /// Height of the bed from soundings, seen from above: x to the right, y up.
    DepthMap,
    /// Power in the cube of a radar: a column for each velocity, receding to the right, the farthest range at the top.
    RangeDoppler,
    /// Power in the polar image of a radar: a row for each azimuth, clockwise.
    Polar,
    /// The same laid out by azimuth and range, ahead up.
    PolarFan,
}

impl ImageKind {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            ImageKind::Waterfall => "waterfall",
            ImageKind::Mosaic => "mosaic",
            ImageKind::Fan => "fan",
            ImageKind::DepthMap => "depth_map",
            ImageKind::RangeDoppler => "range_doppler",
            ImageKind::Polar => "polar",
            ImageKind::PolarFan => "polar_fan",
        }
    }
}

/// The range over which side-scan images are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImageRange {
    /// Slant range as reported, including the water below the sonar.
    #[default]
    Slant,
    /// Distance over a flat bed, `sqrt(slant^2 - altitude^2)`, with the altitude by [`altitudes`]; the water is
    /// removed.
    Ground,
}

named! { ImageRange: Slant "slant", Ground "ground" }

/// Pixels, their labels, and their positions.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Image {
    /// What it is.
    pub kind: ImageKind,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row from the top: echo level with time-varied gain, dB re 1 uPa; of a radar power at the receiver, dBm;
    /// for a depth map height, world z, m. NaN where there is nothing.
    pub values: Vec<f32>,
    /// The label columns of the pings, pixel by pixel like `values`.
    pub layers: Vec<LabelLayer>,
    /// Coordinates of the pixels.
    pub place: Place,
    /// Names of the numbers in `layers`.
    pub labels: Arc<Labels>,
}

/// Label numbers of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct LabelLayer {
    /// Which label.
    pub field: Field,
    /// A number for each pixel; 0 where there is nothing or no label.
    pub ids: Vec<u32>,
}

/// Coordinates of an image's pixels: the middle of column `c`, row `r` is `first + [c, r] * step`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Coordinates of the middle of the top left pixel.
    pub first: [f64; 2],
    /// From column to column, and from row to row.
    pub step: [f64; 2],
    /// What the coordinates are, with their unit: `across, m` (starboard is positive) and `ping` (index) of a
    /// waterfall; `x, m` and `y, m` of maps, in the world; `right, m` and `ahead, m` or `up, m` of a fan, from the
    /// instrument; `velocity, m/s`, receding, `range, m` and `azimuth, rad`, clockwise, of a radar.
    pub axes: [&'static str; 2],
}

impl Image {
    /// Coordinates of the middle of a pixel.
    pub fn coordinates(&self, column: usize, row: usize) -> [f64; 2] {
        let Place { first, step, .. } = self.place;
        [first[0] + column as f64 * step[0], first[1] + row as f64 * step[1]]
    }

    /// Index in `values` of the pixel at the coordinates `at`; `None` outside.
    pub fn index(&self, at: [f64; 2]) -> Option<usize> {
        let Place { first, step, .. } = self.place;
        let [column, row] = [0, 1].map(|axis| ((at[axis] - first[axis]) / step[axis] + 0.5).floor());
        let inside = (0.0..self.width as f64).contains(&column) && (0.0..self.height as f64).contains(&row);
        inside.then(|| row as usize * self.width + column as usize)
    }

    /// Label numbers of the column `field`; `None` if the pings have none.
    pub fn layer(&self, field: Field) -> Option<&[u32]> {
        self.layers.iter().find(|layer| layer.field == field).map(|layer| layer.ids.as_slice())
    }

    /// Checks the lengths of `values` and `layers`: they are public, so they may disagree.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        let pixels = self.width.checked_mul(self.height);
        let lengths = std::iter::once(self.values.len()).chain(self.layers.iter().map(|layer| layer.ids.len()));
        match { lengths }.find(|&length| Some(length) != pixels) {
            None => Ok(()),
            Some(length) => Err(Error::invalid(
                "image",
                format!("made of {length} values"),
                format!("a value for each of its {} x {} pixels", self.width, self.height),
            )),
        }
    }
}

/// The cell that a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PixelSource {
    /// Index of its ping.
    ping: u32,
    /// Its cell.
    cell: u32,
}

impl PixelSource {
    /// A pixel without a cell.
    const NONE: PixelSource = PixelSource { ping: u32::MAX, cell: u32::MAX };
}

/// `count` times `value`.
///
/// # Errors
/// Out of memory.
fn filled<T: Clone>(count: usize, value: T) -> Result<Vec<T>> {
    let mut values = Vec::new();
    refill(&mut values, count, value)?;
    Ok(values)
}

/// Replaces the content of `values` by `count` times `value`, in its memory if that is enough.
///
/// # Errors
/// Out of memory.
fn refill<T: Clone>(values: &mut Vec<T>, count: usize, value: T) -> Result<()> {
    values.clear();
    tried(|| values.try_reserve_exact(count)).map_err(|_| Error::Memory(format!("an image of {count} pixels")))?;
    values.resize(count, value);
    Ok(())
}

/// The columns that are layers of images of pings.
pub const LAYERS: [Field; 4] = [Field::CategoryId, Field::PartId, Field::InstanceId, Field::MaterialId];

/// The label columns of `pings` at the cells `sources`.
fn layers(pings: &[Ping], sources: &[PixelSource]) -> Result<Vec<LabelLayer>> {
    let mut layers = Vec::new();
    for field in LAYERS {
        if !pings.iter().all(|ping| ping.fields.contains(field)) {
            continue;
        }
        let mut ids = filled(sources.len(), 0)?;
        for (id, source) in ids.iter_mut().zip(sources) {
            if *source != PixelSource::NONE
                && let Column::U32(column) = pings[source.ping as usize].column(field)
            {
                *id = column[source.cell as usize];
            }
        }
        layers.push(LabelLayer { field, ids });
    }
    Ok(layers)
}

/// Levels of `pings` at the cells `sources`, with time-varied gain.
fn levels(pings: &[Ping], sources: &[PixelSource]) -> Result<Vec<f32>> {
    let mut values = filled(sources.len(), f32::NAN)?;
    for (value, source) in values.iter_mut().zip(sources) {
        if *source != PixelSource::NONE {
            *value = level(&pings[source.ping as usize], source.cell as usize);
        }
    }
    Ok(values)
}

/// Level of a cell with time-varied gain, dB re 1 uPa.
fn level(ping: &Ping, cell: usize) -> f32 {
    ping.cells.intensity[cell] + ping.layout.tvg_db[cell % ping.layout.bins]
}

/// An image of the cells `sources`.
fn of_sources(
    kind: ImageKind,
    pings: &[Ping],
    [width, height]: [usize; 2],
    sources: &[PixelSource],
    place: Place,
) -> Result<Image> {
    let labels = pings.first().map(|ping| Arc::clone(&ping.labels)).unwrap_or_default();
    let (values, layers) = (levels(pings, sources)?, layers(pings, sources)?);
    Ok(Image { kind, width, height, values, layers, place, labels })
}

/// Checks that `pings` are of one of the `allowed` kinds, from which `what` can be made.
fn check_view(pings: &Pings, what: &str, allowed: &[SonarView], words: &str) -> Result<SonarView> {
    let view = pings.check()?.view;
    if !allowed.contains(&view) {
        return Err(Error::invalid(what, format!("requested for a {} sonar", view.name()), words));
    }
    Ok(view)
}

/// Drawn width of beams without a neighbour, rad: 2 degrees, as for a mechanically scanning sonar.
const LONE_SECTOR: f64 = 0.035;

/// The median of `values`; 0 if empty.
fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
