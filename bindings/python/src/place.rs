//! Poses and trajectories.

use crate::argument::{self, Argument};
use crate::array::{numbers, owned, rows};
use crate::error::{BindingError, BindingResult};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use numpy::ndarray::{ArrayView2, Ix1, Ix2, IxDyn};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// Position and orientation of a sensor or an object in the world: x forward, y left, z up.
///
/// `position`: x, y, z, m, by default 0, 0, 0; or the whole pose, as a 4 x 4 matrix that rotates and translates (world
/// from sensor). `rpy_deg`: roll, pitch and yaw in degrees, first about x, then about y, then about z. `quaternion`: x,
/// y, z, w, as in ROS, of any length but 0. One of the two, or neither: along the axes of the world. ArgumentError for
/// both, for either with a matrix, for matrices that scale, shear or mirror, and for numbers that are not finite. Poses
/// are equal if their numbers are, and can be pickled.
///
/// >>> pose = ec.Pose((1, 2, 1.8), rpy_deg=(0, 0, 90))
/// >>> pose.position
/// [1.0, 2.0, 1.8]
/// >>> ahead = np.array(pose.matrix) @ [1, 0, 0, 1]  # 1 m ahead of it
/// >>> [round(float(place), 3) for place in ahead]
/// [1.0, 3.0, 1.8, 1.0]
/// >>> ec.Pose(pose.matrix).position
/// [1.0, 2.0, 1.8]
#[pyclass(frozen, eq, from_py_object, module = "echocast")]
#[derive(Clone, Copy, PartialEq)]
pub struct Pose(pub echocast::Pose);

#[pymethods]
impl Pose {
    #[new]
    #[pyo3(
        signature = (position = PoseLike::Point(DVec3::ZERO), *, rpy_deg = None, quaternion = None),
        text_signature = "(position=(0.0, 0.0, 0.0), *, rpy_deg=None, quaternion=None)"
    )]
    fn new(
        #[pyo3(from_py_with = argument::position)] position: PoseLike,
        #[pyo3(from_py_with = argument::rpy_deg)] rpy_deg: Option<[f64; 3]>,
        #[pyo3(from_py_with = argument::quaternion)] quaternion: Option<[f64; 4]>,
    ) -> BindingResult<Pose> {
        let given = ("rpy_deg", rpy_deg.is_some(), "quaternion", quaternion.is_some());
        let at = match position {
            PoseLike::Point(at) => at,
            // It includes the rotation.
            whole => match given {
                (_, false, _, false) => return whole.rigid("position").map(Pose),
                (name, true, ..) | (_, _, name, _) => {
                    return Err(BindingError::argument(name, "there beside a pose or matrix", "one of the two"));
                }
            },
        };
        let pose = echocast::Pose::at(at.x, at.y, at.z);
        let pose = match (rpy_deg, quaternion) {
            (None, None) => pose,
            (Some([roll, pitch, yaw]), None) => pose.with_rpy_deg(roll, pitch, yaw),
            (None, Some([x, y, z, w])) => pose.with_quaternion(x, y, z, w),
            (Some(_), Some(_)) => {
                return Err(BindingError::argument("quaternion", "given in addition to rpy_deg", "one of the two"));
            }
        };
        let wrong =
            |name: &str, found: &[f64], allowed: &str| Err(BindingError::argument(name, format!("{found:?}"), allowed));
        if !pose.position.is_finite() {
            return wrong("position", &at.to_array(), "finite numbers");
        }
        if (pose.orientation.length() - 1.0).abs() < 1e-6 {
            return Ok(Pose(pose));
        }
        match (rpy_deg, quaternion) {
            (Some(angles), _) => wrong("rpy_deg", &angles, "finite numbers"),
            (None, turned) => wrong("quaternion", &turned.unwrap_or_default(), "finite numbers that are not all 0"),
        }
    }

    /// x, y and z in the world, m.
    #[getter]
    fn position(&self) -> [f64; 3] {
        self.0.position.to_array()
    }

    /// Orientation as x, y, z, w, of length 1.
    #[getter]
    fn quaternion(&self) -> [f64; 4] {
        self.0.orientation.to_array()
    }

    /// The 4 x 4 matrix, as a list of rows, that takes coordinates of the sensor or object to those of the world.
    #[getter]
    fn matrix(&self) -> [[f64; 4]; 4] {
        let columns = self.0.rotation().to_cols_array_2d();
        let position = self.0.position.to_array();
        let row = |row: usize| [columns[0][row], columns[1][row], columns[2][row], position[row]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(([f64; 3],), Bound<'py, PyDict>)> {
        let keywords = PyDict::new(py);
        keywords.set_item("quaternion", self.quaternion())?;
        Ok(((self.position(),), keywords))
    }

    fn __repr__(&self) -> String {
        let ([x, y, z], [qx, qy, qz, qw]) = (self.position(), self.quaternion());
        format!("Pose(({x}, {y}, {z}), quaternion=({qx}, {qy}, {qz}, {qw}))")
    }
}

/// The path of a sensor: poses at rising times, interpolated linearly in position and by slerp in orientation.
///
/// `times`: n numbers, s, at least one. `positions`: n x 3, m. `quaternions`: n x 4, x, y, z, w; None: along the axes
/// of the world. Arrays or lists of numbers, which are copied. ArgumentError for other shapes, times that do not rise
/// and numbers that are not finite, TypeError for anything but numbers. Trajectories can be pickled.
///
/// >>> path = ec.Trajectory([0, 2], [[0, 0, 1.8], [10, 0, 1.8]])
/// >>> path.at(0.5).position
/// [2.5, 0.0, 1.8]
/// >>> path.span
/// (0.0, 2.0)
#[pyclass(frozen, from_py_object, module = "echocast")]
#[derive(Clone)]
pub struct Trajectory(pub echocast::Trajectory);

/// The columns of a trajectory: times, positions and quaternions.
type TrajectoryKeys<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

#[pymethods]
impl Trajectory {
    #[new]
    #[pyo3(signature = (times, positions, quaternions = None))]
    fn new(
        times: &Bound<'_, PyAny>,
        positions: &Bound<'_, PyAny>,
        quaternions: Option<&Bound<'_, PyAny>>,
    ) -> BindingResult<Trajectory> {
        let times = times_of(times)?;
        let positions = counted::<3>("positions", positions, times.len())?;
        let quaternions = match quaternions {
            Some(array) => counted::<4>("quaternions", array, times.len())?,
            None => vec![[0.0, 0.0, 0.0, 1.0]; times.len()],
        };
        let pose = |([x, y, z], [qx, qy, qz, qw]): ([f64; 3], [f64; 4])| {
            echocast::Pose::at(x, y, z).with_quaternion(qx, qy, qz, qw)
        };
        let poses = positions.into_iter().zip(quaternions).map(pose);
        Ok(Trajectory(echocast::Trajectory::new(times.into_iter().zip(poses).collect())?))
    }

    /// Reads a file: TUM text, lines of `t x y z qx qy qz qw`, or CSV with a header, s and m.
    ///
    /// >>> with open("drive.txt", "w") as file:
    /// ...     print("0 0 0 1.8 0 0 0 1\n2 10 0 1.8 0 0 0 1", file=file)
    /// >>> ec.Trajectory.load("drive.txt").span
    /// (0.0, 2.0)
    #[staticmethod]
    fn load(#[pyo3(from_py_with = argument::path)] path: PathBuf) -> BindingResult<Trajectory> {
        Ok(Trajectory(echocast::Trajectory::load(path)?))
    }

    /// The pose at `time`, s; before the first pose the first, after the last the last.
    fn at(&self, #[pyo3(from_py_with = argument::time)] time: f64) -> Pose {
        Pose(self.0.at(time))
    }

    /// What an IMU on it measures, as a `sensor_msgs/Imu` in the frame `frame_id`: serialised bytes (CDR, little endian).
    /// `number`: that of the measurement, from time 0 on, at the rate of the IMU. `imu`: "xsens_mti10", 100 a second,
    /// "vectornav_vn200", 200, or "ideal", 200 without errors. Errors are functions of `seed` and `number`. ArgumentError for
    /// another IMU.
    ///
    /// >>> still = ec.Trajectory([0], [[0, 0, 1]])
    /// >>> message = still.imu_message(7, imu="ideal", frame_id="imu")
    /// >>> [float(number) for number in np.frombuffer(message, "<f8", 3, offset=220)]  # m/s2
    /// [0.0, 0.0, 9.80665]
    #[pyo3(signature = (number, *, imu = "xsens_mti10", seed = 0, frame_id = "imu_link"))]
    fn imu_message<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::number)] number: u32,
        #[pyo3(from_py_with = argument::imu)] imu: &str,
        #[pyo3(from_py_with = argument::seed)] seed: u64,
        #[pyo3(from_py_with = argument::frame_id)] frame_id: &str,
    ) -> BindingResult<Bound<'py, PyBytes>> {
        let model = crate::sensor::named("imu", imu)?;
        let sample = echocast::emitter::Imu::new(model, seed).sample(&self.0, number.into());
        Ok(PyBytes::new(py, &echocast::messages::imu(&sample, frame_id)?))
    }

    /// Pose and velocities at `time`, s, as a `nav_msgs/Odometry`: serialised bytes (CDR, little endian); the pose is in the
    /// frame `frame_id`, the twist in the frame `child_frame_id` of what moves.
    ///
    /// >>> path = ec.Trajectory([0, 2], [[0, 0, 1.8], [10, 0, 1.8]])
    /// >>> message = path.odometry_message(0.5)
    /// >>> float(np.frombuffer(message, "<f8", 1, offset=388)[0])  # m/s ahead
    /// 5.0
    #[pyo3(signature = (time, *, frame_id = "odom", child_frame_id = "base_link"))]
    fn odometry_message<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::time)] time: f64,
        #[pyo3(from_py_with = argument::frame_id)] frame_id: &str,
        #[pyo3(from_py_with = argument::child_frame_id)] child_frame_id: &str,
    ) -> BindingResult<Bound<'py, PyBytes>> {
        let bytes = echocast::messages::odometry(&self.0.odometry(time), frame_id, child_frame_id)?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Times of the first and the last pose, s.
    #[getter]
    fn span(&self) -> (f64, f64) {
        self.0.span()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, TrajectoryKeys<'py>)> {
        let (py, keys) = (slf.py(), slf.get().0.clone().into_keys());
        let count = keys.len();
        let times = owned(py, keys.iter().map(|(time, _)| *time).collect(), &[count])?;
        let positions = keys.iter().flat_map(|(_, pose)| pose.position.to_array()).collect();
        let turned = keys.iter().flat_map(|(_, pose)| pose.orientation.to_array()).collect();
        let columns = (times, owned(py, positions, &[count, 3])?, owned(py, turned, &[count, 4])?);
        Ok((slf.get_type().into_any(), columns))
    }

    fn __repr__(&self) -> String {
        let (first, last) = self.0.span();
        format!("<Trajectory: {} poses, {first} to {last} s>", self.0.clone().into_keys().len())
    }
}

/// The argument `times`.
pub fn times_of(times: &Bound<'_, PyAny>) -> BindingResult<Vec<f64>> {
    Ok(numbers::<f64, Ix1>("times", times, "n")?.as_array().to_vec())
}

/// The rows of the argument `name`, of which there must be `count`.
fn counted<const N: usize>(name: &str, array: &Bound<'_, PyAny>, count: usize) -> BindingResult<Vec<[f64; N]>> {
    let allowed = format!("{count} x {N}, a row for each time");
    let array = numbers::<f64, Ix2>(name, array, &allowed)?;
    let (height, width) = array.as_array().dim();
    if (height, width) != (count, N) {
        return Err(BindingError::argument(name, format!("{height} x {width}"), allowed));
    }
    rows(name, &array)
}

/// Where a scan is made from, the argument `at`.
pub fn path(name: &str, at: &Bound<'_, PyAny>) -> BindingResult<echocast::Trajectory> {
    if let Ok(Trajectory(path)) = at.extract() {
        return Ok(path);
    }
    let placed = PoseLike::read(name, at, "a Pose, a Trajectory, x, y and z, or a matrix of 4 x 4")?;
    Ok(echocast::Trajectory::fixed(placed.rigid(name)?))
}

/// Where an object is, the argument `pose`: world from object.
pub fn transform(pose: &Bound<'_, PyAny>) -> BindingResult<DAffine3> {
    Ok(match PoseLike::of("pose", pose)? {
        PoseLike::Point(at) => DAffine3::from_translation(at),
        PoseLike::Pose(pose) => DAffine3::from_rotation_translation(pose.orientation, pose.position),
        PoseLike::Matrix(placed) => placed,
    })
}

/// A place, in any form in which it can be given.
#[derive(Clone, Copy)]
pub enum PoseLike {
    Point(DVec3),
    Pose(echocast::Pose),
    Matrix(DAffine3),
}

impl Argument<'_, '_> for PoseLike {
    fn of(name: &str, value: &Bound<'_, PyAny>) -> BindingResult<Self> {
        PoseLike::read(name, value, "a Pose, x, y and z, or a matrix of 4 x 4")
    }
}

impl PoseLike {
    /// Converts the argument `name`, which may be what is `allowed`.
    fn read(name: &str, value: &Bound<'_, PyAny>, allowed: &str) -> BindingResult<PoseLike> {
        if let Ok(Pose(pose)) = value.extract() {
            return Ok(PoseLike::Pose(pose));
        }
        if let Ok(point) = value.extract::<[f64; 3]>() {
            return Ok(PoseLike::Point(point.into()));
        }
        let array = numbers::<f64, IxDyn>(name, value, allowed)?;
        if let Ok(matrix) = array.extract::<PyReadonlyArray2<'_, f64>>()
            && matrix.shape() == [4, 4]
        {
            return Ok(PoseLike::Matrix(affine(name, matrix.as_array())?));
        }
        if let ([3], Ok(point)) = (array.shape(), array.extract::<PyReadonlyArray1<'_, f64>>()) {
            let point = point.as_array();
            return Ok(PoseLike::Point(DVec3::new(point[0], point[1], point[2])));
        }
        let shape: Vec<String> = array.shape().iter().map(usize::to_string).collect();
        let plain = match array.shape() {
            [1] => " number",
            [_] => " numbers",
            _ => "",
        };
        Err(BindingError::argument(name, shape.join(" x ") + plain, allowed))
    }

    /// The pose of an object that keeps its size, given as the argument `name`.
    fn rigid(self, name: &str) -> BindingResult<echocast::Pose> {
        let placed = match self {
            PoseLike::Point(at) => return Ok(echocast::Pose::at(at.x, at.y, at.z)),
            PoseLike::Pose(pose) => return Ok(pose),
            PoseLike::Matrix(placed) => placed,
        };
        if !placed.is_finite() {
            return Err(BindingError::argument(name, "a matrix with numbers that are not finite", "finite numbers"));
        }
        let turned = placed.matrix3;
        // Numbers in float32 pass, too.
        if !(turned.transpose() * turned).abs_diff_eq(DMat3::IDENTITY, 1e-5) || turned.determinant() < 0.0 {
            let found = "a matrix that scales, shears or mirrors";
            return Err(BindingError::argument(name, found, "one that turns and moves: a sensor keeps its size"));
        }
        Ok(echocast::Pose { position: placed.translation, orientation: DQuat::from_mat3(&turned).normalize() })
    }
}

/// The transform of a 4 x 4 matrix, given as the argument `name`.
pub fn affine(name: &str, matrix: ArrayView2<f64>) -> BindingResult<DAffine3> {
    let last: [f64; 4] = std::array::from_fn(|column| matrix[[3, column]]);
    if last != [0.0, 0.0, 0.0, 1.0] {
        let found = format!("a matrix whose last row is {last:?}");
        return Err(BindingError::argument(name, found, "0, 0, 0, 1 there; the place is in the last column"));
    }
    let columns = std::array::from_fn(|column| std::array::from_fn(|row| matrix[[row, column]]));
    Ok(DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns)))
}
