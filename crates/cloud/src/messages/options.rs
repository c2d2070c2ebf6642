//! What a bag holds besides points.

use super::ScanMessage;
use crate::{Driver, FieldSet, PointCloud, ScanLine};
use emitter::{ImuModel, Trajectory};
use ground::builder;
use ground::error::{Error, Result};
use ground::named;
use ground::pose::Pose;
use std::sync::Arc;

/// What can be chosen for a bag; transforms, boxes, the images of a camera, the detections of a radar and the legend are in
/// every bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BagTopic {
    /// `/points`: `sensor_msgs/PointCloud2` in the layout of a driver.
    Points,
    /// `/scan`: `sensor_msgs/LaserScan`.
    Scan,
    /// `/echoes`: `sensor_msgs/MultiEchoLaserScan`, on the topic of the driver urg_node.
    Echoes,
    /// `/livox/lidar`: `livox_ros_driver2/CustomMsg`, on the topic of the driver.
    Livox,
    /// `/imu`: `sensor_msgs/Imu`.
    Imu,
    /// `/odom`: `nav_msgs/Odometry`.
    Odom,
    /// `/clock`: `rosgraph_msgs/Clock`.
    Clock,
}

named! { BagTopic: Points "points", Scan "scan", Echoes "echoes", Livox "livox", Imu "imu", Odom "odom", Clock "clock" }

impl BagTopic {
    /// The message with a whole scan that it has, if it has one.
    pub fn message(self) -> Option<ScanMessage> {
        match self {
            BagTopic::Scan => Some(ScanMessage::LaserScan),
            BagTopic::Echoes => Some(ScanMessage::MultiEchoLaserScan),
            BagTopic::Livox => Some(ScanMessage::LivoxCustom),
            BagTopic::Points | BagTopic::Imu | BagTopic::Odom | BagTopic::Clock => None,
        }
    }

    /// Whether it is about what carries the sensor.
    pub fn is_of_motion(self) -> bool {
        matches!(self, BagTopic::Imu | BagTopic::Odom | BagTopic::Clock)
    }

    /// What a bag of a sensor with such a `driver` and such a `line` holds by default: points, which alone have labels; the
    /// `LaserScan` of a single ring, with all echoes if there may be several; the `CustomMsg` of a Livox, which odometry
    /// packages read, though its driver publishes a `PointCloud2` unless a launch file tells it otherwise.
    pub fn of_sensor(driver: Option<Driver>, line: Option<ScanLine>) -> Vec<BagTopic> {
        let mut topics = vec![BagTopic::Points];
        if let Some(line) = line {
            topics.push(BagTopic::Scan);
            topics.extend((line.returns > 1).then_some(BagTopic::Echoes));
        }
        topics.extend((driver == Some(Driver::Livox)).then_some(BagTopic::Livox));
        topics
    }

    /// The columns that the messages of `topics` are made of, besides those of points.
    pub fn columns(topics: &[BagTopic]) -> FieldSet {
        let messages = topics.iter().filter_map(|topic| topic.message());
        messages.fold(FieldSet::EMPTY, |columns, message| columns.union(message.columns()))
    }
}

builder! {
    /// What a bag holds. The default: what suits the sensor, without messages of its carrier.
    #[derive(Clone, Debug)]
    pub struct BagOptions {
        /// The topics; `None`: those of [`BagTopic::of_sensor`], as far as the cloud has the columns.
        pub topics: Option<Vec<BagTopic>> = None,
        /// What carries the sensor: needed for its topics.
        pub motion: Option<BagMotion> = None,
    }
}

/// How the carrier of a sensor moves while a bag is recorded.
#[derive(Clone, Debug)]
pub struct BagMotion {
    /// Its path, on which the IMU is, with its axes.
    pub carrier: Arc<Trajectory>,
    /// The path that odometry reports; `None`: the true one.
    pub estimate: Option<Arc<Trajectory>>,
    /// Pose of the sensor on the carrier.
    pub mount: Pose,
    /// The IMU.
    pub imu: ImuModel,
    /// Seed of its errors.
    pub seed: u64,
    /// How long the last frame takes, s: messages go on until its end.
    pub scan_time: f64,
}

impl BagOptions {
    /// The topics of a bag that begins with `first`.
    ///
    /// # Errors
    /// A topic that it cannot have.
    #[cfg_attr(not(feature = "mcap"), expect(dead_code, reason = "only bags have topics"))]
    pub(crate) fn topics_of(&self, first: &PointCloud, driver: Option<Driver>) -> Result<Vec<BagTopic>> {
        let has = |topic: &BagTopic| {
            let needed = topic.message().map_or(FieldSet::EMPTY, ScanMessage::columns);
            needed.iter().all(|info| first.column(info.field).len() == first.len)
        };
        let Some(topics) = &self.topics else {
            let mut topics = BagTopic::of_sensor(driver, first.scan_line);
            topics.retain(|topic| *topic != BagTopic::Livox || has(topic));
            return Ok(topics);
        };
        let refused = |topic: &&BagTopic| match topic {
            BagTopic::Scan | BagTopic::Echoes => first.scan_line.is_none(),
            BagTopic::Livox => !has(topic),
            BagTopic::Imu | BagTopic::Odom | BagTopic::Clock => self.motion.is_none(),
            BagTopic::Points => false,
        };
        match topics.iter().find(refused) {
            Some(topic) => {
                let allowed = match topic.message() {
                    Some(ScanMessage::LivoxCustom) => "clouds with intensity, return_number, ring and time",
                    Some(_) => "clouds of a LiDAR with a single ring",
                    None => "bags with the motion of what carries the sensor",
                };
                Err(Error::invalid("topics", format!("with {}", topic.name()), allowed))
            }
            None => Ok(topics.clone()),
        }
    }
}
