//! The driver: one scan, step by step.

mod bare;
mod boxes;
mod light;
mod nothing;
mod options;
mod printed;
mod radar;
mod sound;

pub use ground::profile::Profile;
pub use nothing::why_nothing;
pub use options::ScanOptions;
pub use radar::RadarRecord;

use crate::sensor::{Sensor, SensorKind};
use crate::trace::BuiltScene;
use cloud::{Field, FieldSet, Frame, PointCloud, Records};
use emitter::Trajectory;
use emitter::trajectory::Georeference;
use glam::DVec3;
use ground::error::{Error, Result};
use ground::named;
use std::ops::ControlFlow;

/// Checks that `profile` is the physical one; `allowed` states why no other is.
fn check_physical(profile: Profile, allowed: &str) -> Result<()> {
    if profile.is_paper() { Err(Error::invalid("profile", profile.name(), allowed)) } else { Ok(()) }
}

/// Checks that `sensor` requests no points in one plane unless `profile` supports them.
fn check_flat(profile: Profile, sensor: &Sensor) -> Result<()> {
    if sensor.flat().is_none() || profile.is_program() {
        return Ok(());
    }
    Err(Error::invalid("pattern.flat", "given", format!("with profile blainder only, not {}", profile.name())))
}

/// Order of the points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Order {
    /// By ascending frame, beam and return.
    #[default]
    Beam,
    /// By ascending time, as drivers publish.
    Time,
}

named! { Order: Beam "beam", Time "time" }

/// A callback that gets the fraction of the work that is done, 0 to 1, and returns whether to continue.
pub type Progress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

impl BuiltScene {
    /// Scans once with `sensor` along `trajectory`. For a sonar, returns the points of one ping
    /// ([`Ping::cloud`](cloud::ping::Ping::cloud)).
    ///
    /// # Errors
    /// A pose that is not finite, an organised cloud ordered by time or with several returns per beam, the errors of
    /// [`Sensor::beams_at`], no memory for the columns; for sonars as [`BuiltScene::ping`].
    pub fn scan(&self, sensor: &Sensor, trajectory: &Trajectory, options: &ScanOptions) -> Result<PointCloud> {
        let mut cloud = PointCloud::default();
        self.scan_into(sensor, trajectory, options, &mut cloud)?;
        Ok(cloud)
    }

    /// [`BuiltScene::scan`] into the memory of `cloud`. After the first few of their kind, scans in beam order of
    /// LiDARs and depth cameras allocate nothing, whatever the sensor, in any weather and in front of mirrors and
    /// glass; with a profile other than the physical one, or boxes around instances, they allocate some small blocks, a
    /// ping of a sonar up to 20 ([`BuiltScene::ping_into`] reuses memory). Threads, including the calling one, keep
    /// their working memory until they end; sensors keep what they prepared for the last 16 environments.
    ///
    /// # Errors
    /// As [`BuiltScene::scan`]. `cloud` is unchanged if the pose or the options are wrong; if there is no memory, it is
    /// empty.
    pub fn scan_into(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
    ) -> Result<()> {
        self.scan_watched(sensor, trajectory, options, cloud, None)
    }

    /// [`BuiltScene::scan_into`] that reports how far it is to `progress`, on this thread, several times in a long
    /// scan; for a sonar, whose scan is one ping, before and after it.
    ///
    /// # Errors
    /// As [`BuiltScene::scan_into`], and [`Error::Cancelled`] if `progress` returns to stop; `cloud` is then empty.
    pub fn scan_with_progress(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
        progress: Progress,
    ) -> Result<()> {
        self.scan_watched(sensor, trajectory, options, cloud, Some(progress))
    }

    fn scan_watched(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
        progress: Option<Progress>,
    ) -> Result<()> {
        if options.boxes.is_none() {
            self.scan_points(sensor, trajectory, options, cloud, progress)?;
            cloud.boxes = None;
            place_on_earth(cloud, trajectory);
            return Ok(());
        }
        // Before anything is scanned into the cloud, which stays as it is if the sensor has no image.
        if options.image_boxes {
            sensor.image_grid()?;
        }
        // Boxes count the points of each instance, and require their times.
        let fields = options.fields.with(Field::InstanceId).with(Field::Time);
        let counted = ScanOptions { fields, ..options.clone() };
        self.scan_points(sensor, trajectory, &counted, cloud, progress)?;
        let done = self.boxes(sensor, trajectory, options, cloud).and_then(|boxes| {
            cloud.boxes = Some(boxes);
            place_on_earth(cloud, trajectory);
            cloud.fields = options.fields;
            cloud.columns.resize(options.fields, cloud.len)
        });
        if done.is_err() {
            *cloud = PointCloud::default();
        }
        done
    }

    fn scan_points(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
        mut progress: Option<Progress>,
    ) -> Result<()> {
        if !sensor.kind().is_optical() && options.estimated_trajectory.is_some() {
            let allowed = "for LiDARs and depth cameras, whose beams have a time each";
            return Err(Error::invalid("estimated_trajectory", format!("given for a {}", sensor.kind()), allowed));
        }
        if sensor.kind() == SensorKind::Radar {
            if options.deskew {
                return Err(Error::invalid("deskew", true, "false for radars, whose detections are of one moment"));
            }
            if progress.as_mut().is_some_and(|progress| progress(0.0).is_break()) {
                *cloud = PointCloud::default();
                return Err(Error::Cancelled);
            }
            self.scan_radar(sensor, trajectory, options, cloud)?;
            let _ = progress.map(|progress| progress(1.0));
            return Ok(());
        }
        if sensor.kind().makes_pings() {
            if options.deskew {
                return Err(Error::invalid("deskew", true, "false for sonars, whose pings have one pose each"));
            }
            if progress.as_mut().is_some_and(|progress| progress(0.0).is_break()) {
                *cloud = PointCloud::default();
                return Err(Error::Cancelled);
            }
            match options.profile {
                Profile::Physical => self.scan_sound(sensor, trajectory, options, cloud)?,
                _ => self.scan_printed(sensor, trajectory, options, cloud)?,
            }
            // A finished ping is not discarded.
            let _ = progress.map(|progress| progress(1.0));
            return Ok(());
        }
        self.scan_light(sensor, trajectory, options, cloud, progress)
    }

    /// Explains what happens to beam `beam` of such a scan, step by step with numbers: where it goes, what it hits,
    /// what returns, and which part of that is detected and reported. For a sonar, explains the ray of the beam's echo,
    /// layer by layer, and the terms of the sonar equation; in the profiles of the paper and its program `beam` is a
    /// ray of their fan. For a radar, `beam` is the number of a detection: explains the terms of the radar equation, and
    /// its strongest paths with their powers, phases and bounces.
    ///
    /// # Errors
    /// As [`BuiltScene::scan`], and a beam that does not exist.
    pub fn explain(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        beam: u32,
    ) -> Result<String> {
        let options = ScanOptions { organised: false, order: Order::Beam, fields: FieldSet::all(), ..options.clone() };
        options.check(trajectory)?;
        options.environment.check()?;
        if sensor.kind().makes_pings() {
            return match options.profile {
                Profile::Physical => self.explain_ping(sensor, trajectory, &options, beam),
                _ => self.explain_printed(sensor, trajectory, &options, beam),
            };
        }
        if sensor.kind() == SensorKind::Radar {
            check_physical(options.profile, "physical, the only one with radars")?;
            return self.explain_radar(sensor, trajectory, &options, beam);
        }
        self.explain_light(sensor, trajectory, &options, beam)
    }
}

/// Says in `cloud`, which was scanned along `trajectory`, what its times count from, and where its world lies on the Earth.
fn place_on_earth(cloud: &mut PointCloud, trajectory: &Trajectory) {
    /// A GPS week, s, and what standard GPS time is adjusted by (ASPRS LAS Specification 1.4 R15, table 4), s.
    const WEEK: f64 = 604_800.0;
    const ADJUSTMENT: f64 = 1e9;
    let since_epoch = trajectory.gps_week().map_or(0.0, |week| f64::from(week) * WEEK - ADJUSTMENT);
    cloud.time_zero = trajectory.time_zero() + since_epoch;
    let standard_time = trajectory.gps_week().is_some();
    let georeference = trajectory.georeference().filter(|_| cloud.frame == Frame::World);
    cloud.earth_offset = georeference.map_or(DVec3::ZERO, Georeference::offset);
    let records = Records::of_crs(georeference.map(Georeference::crs), standard_time);
    // Mostly as before.
    if *cloud.records != records {
        cloud.records = records.into();
    }
}
