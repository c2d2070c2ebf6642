//! The driver: one scan, step by step.

use crate::cloud::{FieldSet, Frame, PointCloud};
use crate::emitter::Trajectory;
use crate::error::Result;
use crate::material::ReflectanceSource;
use crate::sensor::Sensor;
use crate::trace::BuiltScene;

/// Which model set a scan follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Physics as we know it.
    #[default]
    Physical,
    /// The equations of the paper as printed.
    Paper,
    /// What the paper's program computes.
    Blainder,
}

/// Order of the points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Rising frame, beam, return.
    #[default]
    Beam,
    /// Rising time, as drivers publish.
    Time,
}

/// How to scan; every setting has a working default.
#[derive(Clone, Debug)]
pub struct ScanOptions {
    /// Columns to compute.
    pub fields: FieldSet,
    /// Seed of all random draws.
    pub seed: u64,
    /// Frame index; it changes the random draws and fills the `frame` column.
    pub frame: u32,
    /// Time at which the scan starts, s since the start of the run.
    pub start_time: f64,
    /// Keep misses, so that every beam has its row.
    pub organised: bool,
    /// Coordinates of the output points.
    pub coordinates: Frame,
    /// Order of the points.
    pub order: Order,
    /// Model set.
    pub profile: Profile,
    /// Where reflectance comes from when the material does not say; `None`: as the profile has it
    /// (`blainder`: alpha, the others: luminance).
    pub reflectance_source: Option<ReflectanceSource>,
    /// Worker threads; `None`: rayon's global pool (all cores).
    pub threads: Option<usize>,
}

impl Default for ScanOptions {
    fn default() -> Self {
        ScanOptions {
            fields: FieldSet::default(),
            seed: 0,
            frame: 0,
            start_time: 0.0,
            organised: false,
            coordinates: Frame::World,
            order: Order::Beam,
            profile: Profile::Physical,
            reflectance_source: None,
            threads: None,
        }
    }
}

impl ScanOptions {
    /// The same with `seed`.
    #[must_use]
    pub fn seed(self, seed: u64) -> Self {
        ScanOptions { seed, ..self }
    }

    /// The same with `fields`.
    #[must_use]
    pub fn fields(self, fields: FieldSet) -> Self {
        ScanOptions { fields, ..self }
    }
}

impl BuiltScene {
    /// Scans once with `sensor` along `trajectory`.
    ///
    /// # Errors
    /// When memory for the columns cannot be had.
    pub fn scan(&self, sensor: &Sensor, trajectory: &Trajectory, options: &ScanOptions) -> Result<PointCloud> {
        let mut cloud = PointCloud::default();
        self.scan_into(sensor, trajectory, options, &mut cloud)?;
        Ok(cloud)
    }

    /// [`BuiltScene::scan`] into the memory of `cloud`, whose old content is lost.
    ///
    /// # Errors
    /// As [`BuiltScene::scan`].
    pub fn scan_into(
        &self,
        _sensor: &Sensor,
        _trajectory: &Trajectory,
        _options: &ScanOptions,
        _cloud: &mut PointCloud,
    ) -> Result<()> {
        todo!()
    }
}
