//! Boxes around what is labelled.

use crate::place::Pose;
use echocast::InstanceBox;
use pyo3::prelude::*;

/// The box around an instance as it was when the scan started, in the frame of the cloud.
#[pyclass(frozen, name = "Box", module = "echocast")]
pub struct PyBox {
    found: InstanceBox,
    /// Name of the instance; "" without one.
    #[pyo3(get)]
    name: String,
    /// Name of its category; "" without one.
    #[pyo3(get)]
    category: String,
}

impl PyBox {
    /// Boxes of `cloud`.
    pub fn all(cloud: &echocast::PointCloud) -> Vec<PyBox> {
        let (instances, categories) = (&cloud.labels.instance, &cloud.labels.category);
        let of = |found: &InstanceBox| PyBox {
            found: *found,
            name: instances.name(found.instance_id).unwrap_or_default().to_owned(),
            category: categories.name(found.category_id).unwrap_or_default().to_owned(),
        };
        cloud.boxes.iter().flatten().map(of).collect()
    }
}

#[pymethods]
impl PyBox {
    /// Its middle, m.
    #[getter]
    fn center(&self) -> [f64; 3] {
        self.found.pose.position.to_array()
    }

    /// Lengths along its axes, m.
    #[getter]
    fn size(&self) -> [f64; 3] {
        self.found.size.to_array()
    }

    /// Rotation from its axes: x, y, z, w.
    #[getter]
    fn quaternion(&self) -> [f64; 4] {
        self.found.pose.orientation.to_array()
    }

    /// Its middle and rotation.
    #[getter]
    fn pose(&self) -> Pose {
        Pose(self.found.pose)
    }

    /// Eight corners, m.
    #[getter]
    fn corners(&self) -> [[f64; 3]; 8] {
        self.found.corners().map(|corner| corner.to_array())
    }

    /// How fast its middle moves over the ground, m/s.
    #[getter]
    fn velocity(&self) -> [f64; 3] {
        self.found.velocity.to_array()
    }

    /// Number of the instance, as in the column `instance_id`.
    #[getter]
    fn instance_id(&self) -> u32 {
        self.found.instance_id
    }

    /// Number of its category, as in the column `category_id`; 0: unlabelled.
    #[getter]
    fn category_id(&self) -> u32 {
        self.found.category_id
    }

    /// Number of the object over all frames, as in the column `track_id`.
    #[getter]
    fn track_id(&self) -> u32 {
        self.found.track_id
    }

    /// Frame of the scan.
    #[getter]
    fn frame(&self) -> u32 {
        self.found.frame
    }

    /// When the scan started, s: the box holds then.
    #[getter]
    fn time(&self) -> f64 {
        self.found.time
    }

    /// Number of points on it.
    #[getter]
    fn points(&self) -> u32 {
        self.found.points
    }

    /// How much of it is not hidden, 0 to 1.
    #[getter]
    fn visible(&self) -> f64 {
        self.found.visible
    }

    /// Left, top, right and bottom, pixels, of all of it in the sensor's image, whatever hides it, if the scan was asked for
    /// `image_boxes`; else None.
    #[getter]
    fn image(&self) -> Option<[f64; 4]> {
        self.found.image
    }

    fn __repr__(&self) -> String {
        let ([x, y, z], [length, width, height]) = (self.center(), self.size());
        format!(
            "<Box {} {:?} at ({x:.2}, {y:.2}, {z:.2}), {length:.2} x {width:.2} x {height:.2} m, {} points>",
            self.found.instance_id, self.name, self.found.points
        )
    }
}
