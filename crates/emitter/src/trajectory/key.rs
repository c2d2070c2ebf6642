//! Poses at times, and how they become poses of the world.

use super::georeference::{Geographic, Georeference};
use glam::DVec3;
use ground::builder;
use ground::crs::{Crs, TransverseMercator};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::report::Report;

/// A time, s, and a pose.
pub(super) type TimedPose = (f64, Pose);

/// The pose with a unit quaternion, or what is wrong with a key after the one at time `before`.
pub(super) fn check_key(before: Option<f64>, time: f64, pose: Pose) -> Result<Pose, String> {
    if !(time.is_finite() && pose.position.is_finite() && pose.orientation.is_finite()) {
        return Err("a number that is not finite".into());
    }
    if let Some(before) = before.filter(|before| *before >= time) {
        return Err(format!("time {time} s after {before} s: times must rise"));
    }
    let length = pose.orientation.length();
    if !(1e-6..1e6).contains(&length) {
        return Err(format!("a quaternion of length {length}: it must be near 1"));
    }
    Ok(Pose { orientation: pose.orientation.normalize(), ..pose })
}

builder! {
    /// How to read a trajectory.
    #[derive(Clone, Debug, PartialEq)]
    pub struct TrajectoryOptions {
        /// Coordinate system of the world, into which latitudes and longitudes are projected; `None`: the UTM zone of WGS 84
        /// of the first pose, for files that have these.
        pub crs: Option<Crs> = None,
        /// Coordinates of the world's origin in that system, m: they are subtracted from eastings and northings, also of
        /// projected places, and from coordinates of HELIOS++. Those of TUM text and of columns x, y, z are the world's.
        pub offset: DVec3 = DVec3::ZERO,
        /// GPS week in which the times of the file count from its start; `None`: unknown.
        pub gps_week: Option<u16> = None,
    }
}

impl TrajectoryOptions {
    /// How the world lies on the Earth, if they say so.
    ///
    /// # Errors
    /// As [`Georeference::new`].
    pub(super) fn georeference(&self) -> Result<Option<Georeference>> {
        self.crs.clone().map(|crs| Georeference::new(crs, self.offset)).transpose()
    }
}

/// Keys as they are read one after the other.
pub(super) struct KeyReader<'o> {
    options: &'o TrajectoryOptions,
    /// How the world lies on the Earth, and its projection, once they are needed or known.
    world: Option<(Georeference, Option<TransverseMercator>)>,
    pub keys: Vec<TimedPose>,
}

impl<'o> KeyReader<'o> {
    pub fn new(options: &'o TrajectoryOptions) -> Result<KeyReader<'o>> {
        let georeferenced = options.georeference()?;
        // Without a system, too, the offset must be a number.
        Georeference::new(Crs::parse("local")?, options.offset)?;
        Ok(KeyReader { options, world: georeferenced.map(|world| (world, None)), keys: Vec::new() })
    }

    /// Time of the last key, s.
    pub fn last_time(&self) -> Option<f64> {
        self.keys.last().map(|key| key.0)
    }

    /// Adds a pose of the world, or says what is wrong with it.
    pub fn add(&mut self, time: f64, pose: Pose) -> Result<(), String> {
        let pose = check_key(self.last_time(), time, pose)?;
        self.keys.push((time, pose));
        Ok(())
    }

    /// Adds a pose in the coordinate system that the world's origin has an offset in, or says what is wrong with it.
    pub fn add_in_grid(&mut self, time: f64, pose: Pose) -> Result<(), String> {
        self.add(time, Pose { position: pose.position - self.options.offset, ..pose })
    }

    /// Prepares for places: they need a coordinate system with a projection, and where none is given, the UTM zone of
    /// the `first` is taken, which `report` says.
    pub fn prepare(&mut self, first: &Geographic, report: &mut Report) -> Result<()> {
        let world = match self.world.take() {
            Some((world, _)) => world,
            None => {
                let crs = Crs::utm_at(first.latitude, first.longitude)?;
                report.warn(format!(
                    "latitudes and longitudes are projected into {} ({}), the zone of the first pose; give another \
                     coordinate system with crs",
                    crs.name(),
                    crs.code().unwrap_or_default()
                ));
                Georeference::new(crs, self.options.offset)?
            }
        };
        let projection = world.projection()?;
        self.world = Some((world, Some(projection)));
        Ok(())
    }

    /// Adds a place, once [`KeyReader::prepare`] was called, or says what is wrong with it.
    pub fn add_place(&mut self, time: f64, place: &Geographic) -> Result<(), String> {
        let Some((world, Some(projection))) = &self.world else { return Err("a place without a projection".into()) };
        let pose = world.pose(projection, place)?;
        let pose = check_key(self.last_time(), time, pose)?;
        self.keys.push((time, pose));
        Ok(())
    }

    /// The keys, and how the world lies on the Earth, if that is known.
    pub fn finish(self) -> (Vec<TimedPose>, Option<Georeference>) {
        (self.keys, self.world.map(|(world, _)| world))
    }
}

/// An error in the file called `origin` as a whole.
pub(super) fn fault(origin: &str, place: impl Into<String>, message: impl Into<String>) -> Error {
    Error::Parse { origin: origin.to_owned(), place: place.into(), message: message.into() }
}
