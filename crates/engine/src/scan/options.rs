//! The options of a scan.

use super::{Order, Profile};
use crate::medium::Environment;
use cloud::PointOptions;
use cloud::{BoxAxes, BoxTime, FieldSet, Frame};
use emitter::Trajectory;
use ground::builder;
use ground::error::{Error, Result};
use model::material::ReflectanceSource;
use std::sync::Arc;

builder! {
    /// How to scan; every option has a working default: `ScanOptions::default().seed(7).organised(true)`.
    #[derive(Clone, Debug)]
    pub struct ScanOptions, listed in OPTIONS {
        /// Columns to compute.
        pub fields: FieldSet = FieldSet::default(),
        /// Seed of all random draws.
        pub seed: u64 = 0,
        /// Frame index; it changes the random draws and fills the `frame` column.
        pub frame: u32 = 0,
        /// Number of the strip (flight line, station), which LAS stores as point source id; 0: none.
        pub strip: u16 = 0,
        /// Time at which the scan starts, s since the start of the run; patterns that do not repeat continue with it.
        pub start_time: f64 = 0.0,
        /// Time of the trajectory at which the scan starts, s; `None`: `start_time`.
        pub trajectory_time: Option<f64> = None,
        /// Where the sensor is taken to be over time, on the clock that pulses are stamped with
        /// ([`NavigationSolution::sensor`](emitter::NavigationSolution)): points in the world are those that processing
        /// with this trajectory gives, while `true_x`, `true_y` and `true_z` stay where they are; `None`: its trajectory.
        /// For LiDARs and depth cameras; points in [`Frame::Sensor`] do not depend on it.
        pub estimated_trajectory: Option<Arc<Trajectory>> = None,
        /// By how much the clock that pulses are stamped with is late, s: in the column `time`, and where
        /// `estimated_trajectory` is looked up.
        pub clock_offset: f64 = 0.0,
        /// Freeze the scene during the scan, as it is at the start: for comparison with simulators that do so.
        pub freeze: bool = false,
        /// Time from one frame to the next, s, over which scene flow is measured; `None`: the sensor's period.
        pub frame_period: Option<f64> = None,
        /// Keep misses, so that every beam has a row.
        pub organised: bool = false,
        /// Coordinates of the output points.
        pub coordinates: Frame = Frame::World,
        /// Order of the points.
        pub order: Order = Order::Beam,
        /// Transform points to one time, the start of the scan: moving objects are where they were then, with all
        /// points on them, however late these were hit, and [`Frame::Sensor`] is the sensor's frame at that time. This
        /// applies to positions and normals; the other columns, including `true_x`, `true_y` and `true_z`, give the
        /// state when the beam fired. Not for sonars.
        pub deskew: bool = false,
        /// Axes of the boxes around labelled instances; `None`: no boxes. For boxes all beams are traced once more.
        pub boxes: Option<BoxAxes> = None,
        /// Time at which boxes hold.
        pub box_time: BoxTime = BoxTime::Scan,
        /// Whether boxes also give their extent in the sensor's image
        /// ([`InstanceBox::image`](cloud::boxes::InstanceBox::image)), for which every triangle is processed.
        pub image_boxes: bool = false,
        /// Model set.
        pub profile: Profile = Profile::Physical,
        /// Source of the reflectance if the material does not give it; `None`: as the profile defines (`physical`:
        /// library, `paper`: luminance, `blainder`: alpha).
        pub reflectance_source: Option<ReflectanceSource> = None,
        /// Objects whose mask shares a bit with this are seen.
        pub mask: u32 = u32::MAX,
        /// Greatest number of mirrors and glass faces on a path of light.
        pub specular_depth: u8 = 10,
        /// Wall-clock time that the scan may take, s, above 0: beams of as many rays as it takes ([`SubRays::Adaptive`])
        /// get no more than fit into it, at least one, as found by scanning a few beams first. The result is, to the bit,
        /// that of `beam.sub_rays: {adaptive: N}` with N from [`PointCloud::most_rays`]; other sensors take what they
        /// take. `None`: no limit.
        ///
        /// [`SubRays::Adaptive`]: crate::SubRays::Adaptive
        /// [`PointCloud::most_rays`]: cloud::PointCloud::most_rays
        pub time_budget: Option<f64> = None,
        /// What is between sensor and surfaces; it must be valid, see [`Environment::check`].
        pub environment: Environment = Environment::default(),
    }
}

impl From<&ScanOptions> for PointOptions {
    fn from(options: &ScanOptions) -> Self {
        let ScanOptions { fields, coordinates, organised, frame, strip, .. } = *options;
        PointOptions { fields, coordinates, organised, frame, strip }
    }
}

impl ScanOptions {
    /// Time of the trajectory at which the scan starts, s.
    pub(crate) fn start_on_trajectory(&self) -> f64 {
        self.trajectory_time.unwrap_or(self.start_time)
    }

    /// Checks that a scan along `trajectory` is possible, in an environment that is checked elsewhere: for light once,
    /// when it is prepared.
    pub(super) fn check(&self, trajectory: &Trajectory) -> Result<()> {
        let start = trajectory.at(self.start_on_trajectory());
        if !(start.position.is_finite() && start.orientation.is_finite()) {
            let (place, turned) = (start.position.to_array(), start.orientation.to_array());
            let found = format!("at {place:?} with the quaternion {turned:?}");
            return Err(Error::invalid("pose", found, "finite numbers, a quaternion that is not 0"));
        }
        if self.clock_offset.abs() > 1e9 || self.clock_offset.is_nan() {
            return Err(Error::invalid("clock_offset", self.clock_offset, "-1e9 to 1e9 s"));
        }
        for (name, time) in [("frame_period", self.frame_period), ("time_budget", self.time_budget)] {
            if let Some(time) = time.filter(|time| !(*time > 0.0 && *time <= 1e9)) {
                return Err(Error::invalid(name, time, "above 0, up to 1e9 s"));
            }
        }
        if self.organised && self.order == Order::Time {
            return Err(Error::invalid(
                "order",
                "time",
                "beam for an organised cloud, whose rows and columns are beams",
            ));
        }
        Ok(())
    }
}
