//! Messages of ROS 2, made from clouds and trajectories: serialised as a middleware sends them and bags store them (CDR, little
//! endian, with the four-byte header of its encoding). A publisher of serialised messages takes them as they are.

pub(crate) mod cdr;
mod laser;
mod livox;
mod options;
mod robot;
mod types;

pub use options::{BagMotion, BagOptions, BagTopic};
pub use robot::{clock, imu, odometry};
#[cfg(feature = "mcap")]
pub(crate) use robot::{write_imu, write_odometry};
pub use types::definition;

use super::{Field, FieldSet, PointCloud};
use cdr::{CdrWriter, Stamp};
use ground::error::{Error, Result};
use ground::named;
use laser::LaserMessage;
use std::io;

/// A message with a whole scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ScanMessage {
    /// The range of the first return of each beam of a LiDAR with a single ring.
    LaserScan,
    /// The ranges of all returns, likewise.
    MultiEchoLaserScan,
    /// Points as Livox's driver publishes them in its own format.
    LivoxCustom,
}

named! { ScanMessage: LaserScan "sensor_msgs/LaserScan", MultiEchoLaserScan "sensor_msgs/MultiEchoLaserScan",
LivoxCustom "livox_ros_driver2/CustomMsg" }

impl ScanMessage {
    /// The columns that [`PointCloud::message`] needs to be exact.
    pub fn columns(self) -> FieldSet {
        match self {
            ScanMessage::LaserScan | ScanMessage::MultiEchoLaserScan => {
                [Field::Range, Field::Intensity, Field::ReturnNumber, Field::Beam].into_iter().collect()
            }
            ScanMessage::LivoxCustom => livox::COLUMNS.into_iter().collect(),
        }
    }
}

impl PointCloud {
    /// The cloud, that of one frame, as a serialised message of ROS 2, in the frame `frame_id` of the sensor.
    ///
    /// Ranges of a `LaserScan` are those of the points, at the angles of the beams ([`PointCloud::scan_line`]), in the order
    /// of their firing: a sensor that turns clockwise has a negative `angle_increment`. A beam without a return has the
    /// range +inf and the intensity 0. The stamp is the time of the first beam, whether it has a return or not. Without the
    /// column `beam` beams are found by `azimuth`, else by the points; without `range`, ranges are the distances of the
    /// points. Points of a `CustomMsg` are in the frame of the sensor at the start of the scan, which is its `timebase`.
    ///
    /// ```
    /// # use echocast::messages::ScanMessage;
    /// # use echocast::{Pose, Scene, ScanOptions, Sensor, Trajectory};
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("flat.glb");
    /// # echocast::generate::Indoor::default().rooms([1, 1]).scene(7)?.write(&path)?;
    /// # let scene = Scene::load(&path)?.build()?;
    /// let hokuyo = Sensor::preset("hokuyo_ust10lx")?;
    /// let options = ScanOptions::default().fields(ScanMessage::LaserScan.columns());
    /// let cloud = scene.scan(&hokuyo, &Trajectory::fixed(Pose::at(0.0, 0.0, 1.0)), &options)?;
    /// let bytes = cloud.message(ScanMessage::LaserScan, "laser")?;
    /// # Ok::<(), echocast::Error>(())
    /// ```
    ///
    /// # Errors
    /// For a `LaserScan` a cloud of another sensor, of several frames, or one whose points have neither a range nor a
    /// position; for a `CustomMsg` a column of [`ScanMessage::columns`] that was not computed, and times more than 4.29 s
    /// after the start; more than 4,294,967,295 bytes; no memory.
    pub fn message(&self, message: ScanMessage, frame_id: &str) -> Result<Vec<u8>> {
        match message {
            ScanMessage::LaserScan | ScanMessage::MultiEchoLaserScan => {
                let scan = LaserMessage::of(self)?;
                whole(|bytes| scan.write(bytes, message, frame_id))
            }
            ScanMessage::LivoxCustom => {
                let stamp = Stamp::of(self.begins());
                livox::check(self, stamp)?;
                whole(|bytes| livox::write(bytes, self, stamp, frame_id))
            }
        }
    }

    /// Writes `message` as [`PointCloud::message`] does, and returns its stamp; times of a `CustomMsg` that do not fit are
    /// clamped.
    #[cfg(feature = "mcap")]
    pub(crate) fn write_message(
        &self,
        message: ScanMessage,
        frame_id: &str,
        bytes: &mut CdrWriter,
    ) -> io::Result<Stamp> {
        if message == ScanMessage::LivoxCustom {
            let stamp = Stamp::of(self.begins());
            livox::write(bytes, self, stamp, frame_id)?;
            return Ok(stamp);
        }
        let scan = LaserMessage::of(self).map_err(io::Error::other)?;
        scan.write(bytes, message, frame_id)?;
        Ok(scan.stamp)
    }

    /// Whether the times of its points are too late for a `CustomMsg`.
    #[cfg(feature = "mcap")]
    pub(crate) fn is_late_for_livox(&self) -> bool {
        livox::beyond(self, Stamp::of(self.begins())).is_some()
    }
}

/// The bytes that `write` writes.
fn whole(write: impl FnOnce(&mut CdrWriter) -> io::Result<()>) -> Result<Vec<u8>> {
    let mut message = CdrWriter::new(Vec::new());
    write(&mut message).map_err(|error| Error::invalid("the message", error, "one of less than 4 GiB"))?;
    Ok(message.bytes())
}
