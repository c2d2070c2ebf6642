//! Boxes around labelled instances.

use crate::error::no_pickle;
use crate::place::Pose;
use echocast::InstanceBox;
use pyo3::prelude::*;

/// The box around an instance at the time that it was scanned or that `box_time` requests, in the axes of the cloud.
/// `PointCloud.boxes` lists them.
///
/// >>> square = np.array([[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2]], dtype=np.float32)
/// >>> sign = {"vertices": square, "triangles": np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)}
/// >>> scene = ec.Scene.from_objects([{**sign, "name": "stop", "category": "sign", "pose": (4, 0, 0)}])
/// >>> (box,) = scene.scan("velodyne_vlp16", at=(0, 0, 1), boxes=True).boxes
/// >>> box.name, box.category, box.center, box.size
/// ('stop', 'sign', [4.0, 0.0, 1.0], [0.0, 2.0, 2.0])
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
    /// Its centre, m, in the axes of the cloud, not relative to `PointCloud.origin`.
    #[getter]
    fn center(&self) -> [f64; 3] {
        self.found.pose.position.to_array()
    }

    /// Lengths along its x, y and z axes, m.
    #[getter]
    fn size(&self) -> [f64; 3] {
        self.found.size.to_array()
    }

    /// Rotation from its axes to those of the cloud: x, y, z, w.
    #[getter]
    fn quaternion(&self) -> [f64; 4] {
        self.found.pose.orientation.to_array()
    }

    /// Its centre and rotation.
    #[getter]
    fn pose(&self) -> Pose {
        Pose(self.found.pose)
    }

    /// Its eight corners, m: a list of x, y, z.
    #[getter]
    fn corners(&self) -> [[f64; 3]; 8] {
        self.found.corners().map(|corner| corner.to_array())
    }

    /// Velocity of its centre over the ground, m/s: x, y, z.
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

    /// Number of the object across all frames, as in the column `track_id`.
    #[getter]
    fn track_id(&self) -> u32 {
        self.found.track_id
    }

    /// Number of the scan.
    #[getter]
    fn frame(&self) -> u32 {
        self.found.frame
    }

    /// Time for which the box is valid, s.
    #[getter]
    fn time(&self) -> f64 {
        self.found.time
    }

    /// Number of points on it.
    #[getter]
    fn points(&self) -> u32 {
        self.found.points
    }

    /// Visible fraction, 0 to 1: of the beams that would hit it if it were alone, the share that does.
    #[getter]
    fn visible(&self) -> f64 {
        self.found.visible
    }

    /// Left, top, right and bottom of the whole instance in the sensor's image, pixels, including what is hidden, if
    /// `image_boxes` were requested and it is in front of a camera; else None.
    #[getter]
    fn image(&self) -> Option<[f64; 4]> {
        self.found.image
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("a Box", "its PointCloud can, with all its boxes")
    }

    fn __repr__(&self) -> String {
        let ([x, y, z], [length, width, height]) = (self.center(), self.size());
        format!(
            "<Box {} {:?} at ({x:.2}, {y:.2}, {z:.2}), {length:.2} x {width:.2} x {height:.2} m, {} points>",
            self.found.instance_id, self.name, self.found.points
        )
    }
}
