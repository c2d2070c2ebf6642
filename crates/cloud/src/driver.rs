//! The ROS 2 drivers of LiDARs.

use ground::named;
use serde::{Deserialize, Serialize};

/// A ROS 2 driver, with its own numbering of the rings of a sensor and its own layout of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Driver {
    /// velodyne_pointcloud, points `XYZIRT`.
    Velodyne,
    /// ouster_ros, points `original`.
    Ouster,
    /// HesaiLidar_ROS_2.0.
    Hesai,
    /// rslidar_sdk, points `XYZIRT`.
    Robosense,
    /// livox_ros_driver2.
    Livox,
    /// The drivers of Autoware, for the LiDARs of several makers; they call rings channels. No sensor has it as its own
    /// driver.
    #[serde(skip_deserializing)]
    Autoware,
}

named! { Driver: Velodyne "velodyne", Ouster "ouster", Hesai "hesai", Robosense "robosense", Livox "livox", Autoware "autoware" }
