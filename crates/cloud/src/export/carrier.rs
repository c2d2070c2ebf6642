//! What a bag holds of the carrier of its sensor: clock, IMU and odometry, at rates of their own.

use super::bag::{BagFile, McapChannel};
use crate::messages::cdr::Stamp;
use crate::messages::{BagMotion, BagTopic, write_imu, write_odometry};
use emitter::Imu;
use glam::DVec3;
use ground::pose::{self, Pose};
use std::io;

/// Names of frames (ROS enhancement proposal 105): where odometry starts, the carrier and the IMU on it.
pub(super) const ODOM: &str = "odom";
pub(super) const BASE: &str = "base_link";
pub(super) const IMU: &str = "imu_link";

/// Messages per second, as simulators and wheel odometry publish them.
const ODOMETRY_HZ: f64 = 50.0;
const CLOCK_HZ: f64 = 100.0;

/// Longest time between two frames, s, a day: more would be frames that were placed apart by mistake, and would fill the disk.
const LONGEST_GAP_S: f64 = 86_400.0;

/// The messages of a carrier, those of a moment before the frame that starts then.
pub(super) struct CarrierTopics {
    motion: BagMotion,
    streams: Vec<CarrierStream>,
}

/// A topic.
struct CarrierStream {
    channel: McapChannel,
    kind: StreamKind,
    /// Number of its next message; the first of a run, at time 0, is 0.
    next: i64,
}

enum StreamKind {
    Clock,
    Imu(Box<Imu>),
    Odometry,
}

impl StreamKind {
    fn rate_hz(&self) -> f64 {
        match self {
            StreamKind::Clock => CLOCK_HZ,
            StreamKind::Imu(imu) => imu.model().rate_hz(),
            StreamKind::Odometry => ODOMETRY_HZ,
        }
    }
}

impl CarrierStream {
    /// When its next message is, s.
    fn time(&self) -> f64 {
        self.next as f64 / self.kind.rate_hz()
    }
}

impl CarrierTopics {
    /// Those among `topics`, from the time `start`, s, on.
    pub fn new(bag: &mut BagFile, motion: &BagMotion, topics: &[BagTopic], start: f64) -> io::Result<CarrierTopics> {
        let mut streams = Vec::new();
        // The clock first: it announces the time.
        for (topic, name, message) in [
            (BagTopic::Clock, "/clock", "rosgraph_msgs/Clock"),
            (BagTopic::Imu, "/imu", "sensor_msgs/Imu"),
            (BagTopic::Odom, "/odom", "nav_msgs/Odometry"),
        ] {
            let kind = match topic {
                _ if !topics.contains(&topic) => continue,
                BagTopic::Clock => StreamKind::Clock,
                BagTopic::Imu => StreamKind::Imu(Box::new(Imu::new(motion.imu, motion.seed))),
                _ => StreamKind::Odometry,
            };
            // Slightly early is on time: numbers are rounded.
            let next = (start * kind.rate_hz() - 1e-6).ceil() as i64;
            streams.push(CarrierStream { channel: bag.topic(name, message)?, kind, next });
        }
        Ok(CarrierTopics { motion: motion.clone(), streams })
    }

    /// Writes the messages before the time `end`, s.
    pub fn write_before(&mut self, bag: &mut BagFile, end: f64) -> io::Result<()> {
        let CarrierTopics { motion, streams } = self;
        let mut gaps = streams.iter().map(|stream| end - stream.time());
        if let Some(gap) = gaps.find(|gap| !gap.is_finite() || *gap > LONGEST_GAP_S) {
            let reason =
                format!("frames are {gap:.0} s apart; allowed with messages of the carrier: {LONGEST_GAP_S} s");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        while let Some(stream) = streams.iter_mut().min_by(|a, b| a.time().total_cmp(&b.time())) {
            let time = stream.time();
            if time >= end {
                break;
            }
            let stamp = Stamp::of(time);
            let mut message = bag.message();
            match &mut stream.kind {
                StreamKind::Clock => message.time(stamp),
                StreamKind::Imu(imu) => write_imu(&mut message, &imu.sample(&motion.carrier, stream.next), IMU)?,
                StreamKind::Odometry => {
                    let path = motion.estimate.as_ref().unwrap_or(&motion.carrier);
                    write_odometry(&mut message, &path.odometry(time), ODOM, BASE)?;
                }
            }
            bag.send(&mut stream.channel, stamp, message)?;
            stream.next += 1;
        }
        Ok(())
    }

    /// Writes the rest, up to the end of a last frame that starts at `start`, s.
    pub fn write_rest(&mut self, bag: &mut BagFile, start: f64) -> io::Result<()> {
        self.write_before(bag, start + self.motion.scan_time)
    }

    /// Pose of the sensor on the carrier.
    pub fn mount(&self) -> &Pose {
        &self.motion.mount
    }

    /// Pose of the carrier of a sensor at `sensor`.
    pub fn under(&self, sensor: &Pose) -> Pose {
        let Pose { position, orientation } = self.motion.mount;
        let back = orientation.conjugate();
        let inverse = Pose { position: DVec3::ZERO - back * position, orientation: back };
        pose::on(sensor, &inverse)
    }
}
