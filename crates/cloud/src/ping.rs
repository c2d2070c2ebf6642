//! What a sonar records: pings of beams and range bins.

use crate::cells::{Layout, Sounding, Track};
use crate::{Column, Columns, Field, FieldSet, Slices};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::pose::Pose;
use model::Labels;
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
pub struct Spare(Option<Box<dyn Any + Send + Sync>>);

impl Spare {
    /// The memory that was kept, or new memory.
    pub fn take<T: Any + Send + Sync + Default>(&mut self) -> Box<T> {
        self.0.take().and_then(|kept| kept.downcast().ok()).unwrap_or_default()
    }

    /// Keeps `memory` until [`Spare::take`] asks for it, in place of any kept before.
    pub fn keep<T: Any + Send + Sync>(&mut self, memory: Box<T>) {
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

/// One ping: beams x bins cells, row [`Layout::cell`]; a cube with one more axis where these are resolved by Doppler.
#[derive(Clone, Debug, Default)]
pub struct Ping {
    /// Number of the ping.
    pub number: u32,
    /// When it was sent, s since the start of the run.
    pub time: f64,
    /// Where the sonar was then: `world_from_sensor`.
    pub pose: Pose,
    /// What it has in common with other pings of its sonar: beams, bins and the levels of noise.
    #[doc(hidden)]
    pub layout: Arc<Layout>,
    /// World position of `true_x`, `true_y`, `true_z` 0, metres.
    pub origin: DVec3,
    /// Each is empty or has a row for each cell of the layout.
    #[doc(hidden)]
    pub cells: Columns,
    /// Which columns of `cells` are present.
    #[doc(hidden)]
    pub fields: FieldSet,
    /// Of beams and cells of the layout.
    #[doc(hidden)]
    pub soundings: Vec<Sounding>,
    /// Its velocity relative to the bottom; `None`: the sonar is not a Doppler velocity log.
    pub bottom_track: Option<Track>,
    /// Its velocity relative to a layer of water; `None`: it tracks none.
    pub water_track: Option<Track>,
    /// Names of the numbers in the label columns.
    pub labels: Arc<Labels>,
    /// Buffers that the next ping made in its place reuses.
    #[doc(hidden)]
    pub memory: Spare,
}

impl Ping {
    /// A ping of zeros with this layout and the columns `fields`, for pings from elsewhere: [`Ping::cells_mut`] fills it.
    ///
    /// # Errors
    /// A layout without cells, with numbers that are not finite, or columns that are not as long as it has bins; no
    /// memory.
    pub fn new(layout: Arc<Layout>, fields: FieldSet) -> Result<Ping> {
        layout.check()?;
        let mut ping = Ping { layout, fields, ..Ping::default() };
        ping.cells.resize(fields, ping.layout.cells())?;
        Ok(ping)
    }

    /// What it has in common with other pings of its sonar.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// One row per cell; columns that were not requested are empty.
    pub fn cells(&self) -> &Columns {
        &self.cells
    }

    /// Which columns are present.
    pub fn fields(&self) -> FieldSet {
        self.fields
    }

    /// The depths that beams report; empty for side-scan and imaging sonars, whose points are their cells.
    pub fn soundings(&self) -> &[Sounding] {
        &self.soundings
    }

    /// The cells, to change values in place.
    pub fn cells_mut(&mut self) -> Slices<'_> {
        self.cells.slices(0, self.layout.cells())
    }

    /// Replaces the soundings.
    ///
    /// # Errors
    /// A sounding of a beam or cell that the ping does not have.
    pub fn set_soundings(&mut self, soundings: Vec<Sounding>) -> Result<()> {
        let (beams, cells) = (self.layout.beams(), self.layout.cells());
        if soundings.iter().any(|sounding| sounding.beam as usize >= beams || sounding.cell as usize >= cells) {
            let found = "with a sounding of a beam or cell that it does not have";
            return Err(Error::invalid("ping", found, format!("{beams} beams and {cells} cells")));
        }
        self.soundings = soundings;
        Ok(())
    }

    /// Levels of a beam, dB re 1 uPa, bin by bin.
    ///
    /// # Panics
    /// If there is no such beam.
    pub fn levels(&self, beam: usize) -> &[f32] {
        &self.cells.intensity[self.layout.cell(beam, 0, 0)..self.layout.cell(beam + 1, 0, 0)]
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

    /// Checks that it has levels, and a pose. `name` is that of the ping, for errors.
    #[doc(hidden)]
    pub fn check(&self, name: &str) -> Result<()> {
        if self.layout.cells() == 0 {
            let found = format!("made of {} beams with {} bins", self.layout.beams(), self.layout.bins);
            return Err(Error::invalid(name, found, "1 to 4294967294 cells"));
        }
        if !self.fields.contains(Field::Intensity) {
            return Err(Error::invalid("columns of a ping", "a set without intensity", "a set with intensity"));
        }
        if !(self.pose.position.is_finite() && self.pose.orientation.is_finite()) {
            return Err(Error::invalid(name, "sent from a pose that is not a number", "finite poses"));
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
    /// Of one layout, origin, set of columns and labels.
    #[doc(hidden)]
    pub pings: Vec<Ping>,
}

impl IntoIterator for Pings {
    type Item = Ping;
    type IntoIter = std::vec::IntoIter<Ping>;

    fn into_iter(self) -> Self::IntoIter {
        self.pings.into_iter()
    }
}

impl Pings {
    /// All of them, in the order in which they were sent.
    pub fn all(&self) -> &[Ping] {
        &self.pings
    }

    /// Makes the first ping anew with `make`, in its memory, and removes the others. If that fails they remain, unless
    /// the first has lost its cells: then all are removed.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn refill<E>(
        &mut self,
        make: impl FnOnce(&mut Ping) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        if self.pings.is_empty() {
            self.pings.push(Ping::default());
        }
        let made = make(&mut self.pings[0]);
        if made.is_ok() {
            self.pings.truncate(1);
        } else if self.pings[0].layout.cells() == 0 {
            self.pings.clear();
        }
        made
    }

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
    #[doc(hidden)]
    pub fn check(&self) -> Result<&Layout> {
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
    #[doc(hidden)]
    pub fn interval(&self, index: usize) -> f64 {
        let first = index.min(self.pings.len().saturating_sub(2));
        self.pings.get(first..first + 2).map_or(0.0, |pair| pair[1].time - pair[0].time)
    }

    /// What all pings have in common; `None` if there are none.
    pub fn layout(&self) -> Option<&Layout> {
        self.pings.first().map(|ping| &*ping.layout)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_and_soundings_are_those_of_the_layout() {
        let fields = FieldSet::EMPTY.with(Field::Intensity);
        let layout = Layout::default().axes(vec![[0.0; 2]; 2]).bins(3).threshold_db(vec![0.0; 3]);
        let error = Ping::new(layout.clone().into(), fields).unwrap_err().to_string();
        assert_eq!(error, "tvg_db is 0 numbers long; allowed: the 3 bins of a beam");
        let mut ping = Ping::new(layout.tvg_db(vec![0.0; 3]).into(), fields).unwrap();
        ping.cells_mut().intensity[5] = 7.0;
        assert_eq!(ping.levels(1), [0.0, 0.0, 7.0]);
        let sounding = Sounding { beam: 1, cell: 6, ..Sounding::default() };
        let error = ping.set_soundings(vec![sounding]).unwrap_err().to_string();
        assert!(error.ends_with("allowed: 2 beams and 6 cells") && ping.soundings().is_empty(), "{error}");
        let mut pings = Pings::default();
        assert!(pings.refill(|_| Err("no cells")).is_err() && pings.all().is_empty());
        pings.push(ping.clone()).unwrap();
        pings.push(ping.clone()).unwrap();
        assert!(pings.refill(|_| Err("as before")).is_err() && pings.all().len() == 2);
        pings
            .refill(|first| {
                first.number = 9;
                Ok::<(), ()>(())
            })
            .unwrap();
        assert_eq!(pings.into_iter().map(|ping| ping.number).collect::<Vec<_>>(), [9]);
    }
}
