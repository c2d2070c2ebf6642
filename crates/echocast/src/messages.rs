//! Messages of ROS 2, made from clouds and trajectories: serialised bytes, as a middleware sends them and bags store them.

#[doc(inline)]
pub use cloud::ScanLine;
#[doc(inline)]
pub use cloud::messages::{BagMotion, BagOptions, BagTopic, ScanMessage, clock, definition, imu, odometry};
