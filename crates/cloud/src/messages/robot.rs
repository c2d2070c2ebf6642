//! Messages of what carries a sensor: `sensor_msgs/Imu`, `nav_msgs/Odometry`, `rosgraph_msgs/Clock`.

use super::cdr::{CdrWriter, Stamp};
use super::whole;
use emitter::{ImuSample, OdometrySample};
use glam::DQuat;
use ground::error::Result;
use std::io;

/// A `sensor_msgs/Imu` as serialised bytes, with the encoding's four-byte header: in the frame `frame_id` of the IMU; the
/// orientation, which an IMU does not measure, is the identity with -1 as the first covariance.
///
/// # Errors
/// A `frame_id` that is too long for a message; no memory.
pub fn imu(sample: &ImuSample, frame_id: &str) -> Result<Vec<u8>> {
    whole(|message| write_imu(message, sample, frame_id))
}

/// A `nav_msgs/Odometry` as serialised bytes: the pose in the frame `frame_id`, the twist in the frame `child_frame_id` of
/// what moves; covariances are 0.
///
/// # Errors
/// A name of a frame that is too long for a message; no memory.
pub fn odometry(sample: &OdometrySample, frame_id: &str, child_frame_id: &str) -> Result<Vec<u8>> {
    whole(|message| write_odometry(message, sample, frame_id, child_frame_id))
}

/// A `rosgraph_msgs/Clock` as serialised bytes, at `time`, s.
pub fn clock(time: f64) -> Vec<u8> {
    let mut message = CdrWriter::new(Vec::new());
    message.time(Stamp::of(time));
    message.bytes()
}

pub(crate) fn write_imu(message: &mut CdrWriter, sample: &ImuSample, frame: &str) -> io::Result<()> {
    let diagonal = |variance: f64| [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance];
    let [turn, force] = sample.variances.map(diagonal);
    message.header(Stamp::of(sample.time), frame)?;
    message.quaternion(DQuat::IDENTITY);
    // As sensor_msgs/Imu wants it where there is no estimate.
    message.f64s(&[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    message.vector(sample.angular_velocity);
    message.f64s(&turn);
    message.vector(sample.specific_force);
    message.f64s(&force);
    Ok(())
}

pub(crate) fn write_odometry(
    message: &mut CdrWriter,
    sample: &OdometrySample,
    frame: &str,
    child: &str,
) -> io::Result<()> {
    message.header(Stamp::of(sample.time), frame)?;
    message.text(child)?;
    message.pose(&sample.pose);
    message.f64s(&[0.0; 36]);
    message.vector(sample.linear_velocity);
    message.vector(sample.angular_velocity);
    message.f64s(&[0.0; 36]);
    Ok(())
}
