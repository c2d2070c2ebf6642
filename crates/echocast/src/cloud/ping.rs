//! What a sonar records: pings of beams and range bins.

use crate::cells::{Layout, Sounding, Track};
use crate::cloud::{Column, Columns, Field, FieldSet};
use crate::ground::error::{Error, Result};
use crate::ground::pose::Pose;
use crate::scene::Labels;
use glam::DVec3;
use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// What a ping can hold for each cell: its level in `intensity`, and properties of the strongest scatterer in it. Where
/// nothing scatters, numbers are NaN and labels 0.
///
/// | column | meaning in a cell |
/// |---|---|
/// | `intensity` | echo level with noise, dB re 1 uPa |
/// | `category_id` to `material_id`, `red` to `blue` | labels and colour of the scatterer; 0 for sea surface and water |
/// | `true_x` to `true_z`, `true_range` | where the scatterer is, and the length of the path there, m; the mean if there are two paths |
/// | `time` | when the echo arrives, s since the start of the run |
/// | `cos_incidence`, `normal_x` to `normal_z` | incidence of the sound on it |
/// | `azimuth`, `elevation` | direction in which the sound left, sensor frame, rad; for sound that left via reflections but returns directly, the direction from which it returns |
/// | `cause`, `bounces` | surface (0), sea surface (10), either via reflections (9) or noise alone (7), and number of reflections on the path; with two paths, on the one that has any |
pub const CELL_FIELDS: [Field; 28] = [
    Field::Intensity,
    Field::CategoryId,
    Field::PartId,
    Field::InstanceId,
    Field::MaterialId,
    Field::Time,
    Field::Azimuth,
    Field::Elevation,
    Field::Red,
    Field::Green,
    Field::Blue,
    Field::NormalX,
    Field::NormalY,
    Field::NormalZ,
    Field::CosIncidence,
    Field::TrueX,
    Field::TrueY,
    Field::TrueZ,
    Field::TrueRange,
    Field::Cause,
    Field::Bounces,
    Field::VelocityX,
    Field::VelocityY,
    Field::VelocityZ,
    Field::RadialVelocity,
    Field::FlowX,
    Field::FlowY,
    Field::FlowZ,
];

/// Memory that is kept in a ping for the next ping made in its place.
#[derive(Default)]
pub(crate) struct Spare(Option<Box<dyn Any + Send + Sync>>);

impl Spare {
    /// The memory that was kept, or new memory.
    pub(crate) fn take<T: Any + Send + Sync + Default>(&mut self) -> Box<T> {
        self.0.take().and_then(|kept| kept.downcast().ok()).unwrap_or_default()
    }

    pub(crate) fn keep<T: Any + Send + Sync>(&mut self, memory: Box<T>) {
        self.0 = Some(memory);
    }
}

impl Clone for Spare {
    /// A copy gets memory of its own when a ping is made in its place.
    fn clone(&self) -> Self {
        Spare::default()
    }
}

impl fmt::Debug for Spare {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Spare")
    }
}

/// One ping: beams x bins cells, row `beam * bins + bin`.
#[derive(Clone, Debug, Default)]
pub struct Ping {
    /// Number of the ping.
    pub number: u32,
    /// When it was sent, s since the start of the run.
    pub time: f64,
    /// Where the sonar was then: `world_from_sensor`.
    pub pose: Pose,
    /// What it has in common with other pings of its sonar.
    pub layout: Arc<Layout>,
    /// World position of `true_x`, `true_y`, `true_z` 0, metres.
    pub origin: DVec3,
    /// One row per cell; columns that were not requested are empty.
    pub cells: Columns,
    /// Which columns are present.
    pub fields: FieldSet,
    /// The depths that beams report; empty for side-scan and imaging sonars, whose points are their cells.
    pub soundings: Vec<Sounding>,
    /// Its velocity relative to the bottom; `None`: the sonar is not a Doppler velocity log.
    pub bottom_track: Option<Track>,
    /// Its velocity relative to a layer of water; `None`: it tracks none.
    pub water_track: Option<Track>,
    /// Names of the numbers in the label columns.
    pub labels: Arc<Labels>,
    pub(crate) memory: Spare,
}

impl Ping {
    /// Levels of a beam, dB re 1 uPa, bin by bin.
    ///
    /// # Panics
    /// If there is no such beam.
    pub fn levels(&self, beam: usize) -> &[f32] {
        let bins = self.layout.bins;
        &self.cells.intensity[beam * bins..(beam + 1) * bins]
    }

    /// Where a sounding is in the world, m: along a straight beam at its reported range.
    ///
    /// # Panics
    /// If there is no such beam.
    pub fn sounding_place(&self, sounding: &Sounding) -> DVec3 {
        let axis = self.layout.axis(sounding.beam as usize);
        self.pose.position + self.pose.orientation * (f64::from(sounding.range) * axis)
    }

    /// Where a sounding is in the world, m, by a ray through the assumed profile of sound speeds, as in survey
    /// programs; as [`Ping::sounding_place`] where that ray leaves the water.
    ///
    /// # Panics
    /// If there is no such beam.
    pub fn corrected_place(&self, sounding: &Sounding) -> DVec3 {
        if sounding.corrected.is_nan() {
            return self.sounding_place(sounding);
        }
        sounding.corrected.as_dvec3() + self.origin
    }

    /// A copy with only the columns in `fields`, and the level.
    #[must_use]
    pub fn with(&self, fields: FieldSet) -> Ping {
        let fields: FieldSet =
            self.fields.iter().map(|info| info.field).filter(|&field| fields.contains(field)).collect();
        let fields = fields.with(Field::Intensity);
        Ping {
            layout: self.layout.clone(),
            cells: self.cells.with(fields),
            fields,
            soundings: self.soundings.clone(),
            labels: self.labels.clone(),
            memory: Spare::default(),
            ..*self
        }
    }

    /// Checks that it is consistent: every column has the right length, every number is valid. They are all public, so
    /// they may disagree. `name` is that of the ping, for errors.
    pub(crate) fn check(&self, name: &str) -> Result<()> {
        let wrong = |found: String, allowed: &str| Err(Error::invalid(name, found, allowed));
        let layout = &*self.layout;
        let cells = layout.axes.len().checked_mul(layout.bins).filter(|&cells| 0 < cells && cells < u32::MAX as usize);
        let Some(cells) = cells else {
            let found = format!("made of {} beams with {} bins", layout.axes.len(), layout.bins);
            return wrong(found, "1 to 4294967294 cells");
        };
        if !(layout.bin_m.is_finite() && layout.bin_m > 0.0) {
            return Err(Error::invalid("bin_m", layout.bin_m, "a length above 0"));
        }
        for (name, value) in [("believed_speed", layout.believed_speed), ("surface_z", layout.surface_z)] {
            if !value.is_finite() {
                return Err(Error::invalid(name, value, "a number"));
            }
        }
        if !layout.axes.iter().flatten().all(|angle| angle.is_finite()) {
            return Err(Error::invalid("axes", "not a number", "azimuth and elevation of each beam, rad"));
        }
        for (name, values) in [("threshold_db", &layout.threshold_db), ("tvg_db", &layout.tvg_db)] {
            if values.len() != layout.bins {
                let allowed = format!("the {} bins of a beam", layout.bins);
                return Err(Error::invalid(name, format!("{} numbers long", values.len()), allowed));
            }
        }
        if !self.fields.contains(Field::Intensity) {
            return Err(Error::invalid("columns of a ping", "a set without intensity", "a set with intensity"));
        }
        if let Some(info) = self.fields.iter().find(|info| self.column(info.field).len() != cells) {
            let found = format!("with {} rows of {}", self.column(info.field).len(), info.name);
            return wrong(found, &format!("its {cells} cells"));
        }
        if !(self.pose.position.is_finite() && self.pose.orientation.is_finite()) {
            return wrong("sent from a pose that is not a number".to_owned(), "finite poses");
        }
        if self.soundings.iter().any(|s| s.beam as usize >= layout.axes.len() || s.cell as usize >= cells) {
            let found = "with a sounding of a beam or cell that it does not have".to_owned();
            return wrong(found, &format!("{} beams and {cells} cells", layout.axes.len()));
        }
        Ok(())
    }

    /// Whether it can be in the same [`Pings`] as `other`.
    fn is_beside(&self, other: &Ping) -> bool {
        let same_layout = Arc::ptr_eq(&self.layout, &other.layout) || self.layout == other.layout;
        let same_labels = Arc::ptr_eq(&self.labels, &other.labels) || self.labels == other.labels;
        same_layout && same_labels && self.origin == other.origin && self.fields == other.fields
    }

    /// Column `field`, one row per cell; empty if it was not requested.
    pub fn column(&self, field: Field) -> Column<'_> {
        self.cells.get(field)
    }
}

/// Pings of one sonar, one after the other.
#[derive(Clone, Debug, Default)]
pub struct Pings {
    /// In the order in which they were sent.
    pub pings: Vec<Ping>,
}

impl Pings {
    /// Adds a ping, without the memory that it keeps for the next one made in its place.
    ///
    /// # Errors
    /// A ping with another layout, origin, set of columns or labels.
    pub fn push(&mut self, mut ping: Ping) -> Result<()> {
        if self.pings.first().is_some_and(|first| !first.is_beside(&ping)) {
            let found = "of another layout, origin, set of columns or labels";
            return Err(Error::invalid("ping", found, "pings of one sonar in one scene"));
        }
        ping.memory = Spare::default();
        self.pings.push(ping);
        Ok(())
    }

    /// What all pings have in common, if each is consistent and they fit together.
    pub(crate) fn check(&self) -> Result<&Layout> {
        let Some(first) = self.pings.first() else {
            return Err(Error::invalid("pings", "an empty list", "at least one ping"));
        };
        for (index, ping) in self.pings.iter().enumerate() {
            ping.check(&format!("ping {index}"))?;
            if !first.is_beside(ping) {
                let found = "of another layout, origin, set of columns or labels than the first";
                return Err(Error::invalid(format!("ping {index}"), found, "pings of one sonar in one scene"));
            }
        }
        Ok(&first.layout)
    }

    /// Seconds from ping `index` to the next, for the last from the one before; 0 for a single ping.
    pub(crate) fn interval(&self, index: usize) -> f64 {
        let first = index.min(self.pings.len().saturating_sub(2));
        self.pings.get(first..first + 2).map_or(0.0, |pair| pair[1].time - pair[0].time)
    }

    /// What all pings have in common; `None` if there are none.
    pub fn layout(&self) -> Option<&Layout> {
        self.pings.first().map(|ping| &*ping.layout)
    }
}
