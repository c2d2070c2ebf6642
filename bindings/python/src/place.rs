//! Where sensors are.

use crate::array::rows;
use crate::error::{Failure, Outcome};
use glam::{DAffine3, DMat4};
use numpy::PyReadonlyArray2;
use numpy::ndarray::ArrayView2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Place and orientation of a sensor or an object in the world: x forward, y left, z up.
///
/// `position`: x, y, z, m, by default 0, 0, 0. `rpy_deg`: roll, pitch and yaw in degrees, the first about x, then about
/// y, then about z. `quaternion`: x, y, z, w, as in ROS, of any length but 0. One of the two, or none: along the axes
/// of the world. ArgumentError for both, and for what is not finite. Poses are equal if their numbers are, and pickle.
///
/// >>> pose = ec.Pose((1, 2, 1.8), rpy_deg=(0, 0, 90))
/// >>> pose.position
/// [1.0, 2.0, 1.8]
/// >>> ahead = np.array(pose.matrix) @ [1, 0, 0, 1]  # 1 m ahead of it
/// >>> [round(float(place), 3) for place in ahead]
/// [1.0, 3.0, 1.8, 1.0]
#[pyclass(frozen, eq, from_py_object, module = "echocast")]
#[derive(Clone, Copy, PartialEq)]
pub struct Pose(pub echocast::Pose);

#[pymethods]
impl Pose {
    #[new]
    #[pyo3(
        signature = (position = [0.0; 3], *, rpy_deg = None, quaternion = None),
        text_signature = "(position=(0.0, 0.0, 0.0), *, rpy_deg=None, quaternion=None)"
    )]
    fn new(position: [f64; 3], rpy_deg: Option<[f64; 3]>, quaternion: Option<[f64; 4]>) -> Outcome<Pose> {
        let [x, y, z] = position;
        let pose = echocast::Pose::at(x, y, z);
        let pose = match (rpy_deg, quaternion) {
            (None, None) => pose,
            (Some([roll, pitch, yaw]), None) => pose.with_rpy_deg(roll, pitch, yaw),
            (None, Some([x, y, z, w])) => pose.with_quaternion(x, y, z, w),
            (Some(_), Some(_)) => {
                return Err(Failure::argument("quaternion", "there beside rpy_deg", "one of the two"));
            }
        };
        if !(pose.position.is_finite() && (pose.orientation.length() - 1.0).abs() < 1e-6) {
            return Err(Failure::argument("pose", "not finite, or its quaternion has no length", "finite numbers"));
        }
        Ok(Pose(pose))
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

/// The path of a sensor: poses at rising times, between them linear in position and slerp in orientation.
///
/// `times`: n, s, at least one. `positions`: n x 3 float64, m. `quaternions`: n x 4 float64, x, y, z, w; None: along
/// the axes of the world. ArgumentError for other shapes, times that do not rise and what is not finite, TypeError for
/// other types.
///
/// >>> path = ec.Trajectory([0.0, 2.0], np.array([[0.0, 0, 1.8], [10, 0, 1.8]]))
/// >>> path.at(0.5).position
/// [2.5, 0.0, 1.8]
/// >>> path.span
/// (0.0, 2.0)
#[pyclass(frozen, from_py_object, module = "echocast")]
#[derive(Clone)]
pub struct Trajectory(pub echocast::Trajectory);

#[pymethods]
impl Trajectory {
    #[new]
    #[pyo3(signature = (times, positions, quaternions = None))]
    fn new(
        times: Vec<f64>,
        positions: PyReadonlyArray2<'_, f64>,
        quaternions: Option<PyReadonlyArray2<'_, f64>>,
    ) -> Outcome<Trajectory> {
        let positions = counted::<3>("positions", &positions, times.len())?;
        let quaternions = match quaternions {
            Some(array) => counted::<4>("quaternions", &array, times.len())?,
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
    fn load(path: PathBuf) -> Outcome<Trajectory> {
        Ok(Trajectory(echocast::Trajectory::load(path)?))
    }

    /// The pose at `time`, s; before the first pose the first, after the last the last.
    fn at(&self, time: f64) -> Pose {
        Pose(self.0.at(time))
    }

    /// Times of the first and the last pose, s.
    #[getter]
    fn span(&self) -> (f64, f64) {
        self.0.span()
    }
}

/// The rows of `array`, of which there must be `count`.
fn counted<const N: usize>(name: &str, array: &PyReadonlyArray2<'_, f64>, count: usize) -> Outcome<Vec<[f64; N]>> {
    let (height, width) = array.as_array().dim();
    if (height, width) != (count, N) {
        let found = format!("{height} x {width}");
        return Err(Failure::argument(name, found, format!("{count} x {N}, a row for each time")));
    }
    rows(name, array)
}

/// Where a scan is made from: a pose, a position, or a trajectory.
#[derive(FromPyObject)]
pub enum Place {
    Pose(Pose),
    Trajectory(Trajectory),
    Position([f64; 3]),
}

impl Place {
    pub fn path(self) -> echocast::Trajectory {
        match self {
            Place::Pose(Pose(pose)) => echocast::Trajectory::fixed(pose),
            Place::Trajectory(Trajectory(path)) => path,
            Place::Position([x, y, z]) => echocast::Trajectory::fixed(echocast::Pose::at(x, y, z)),
        }
    }
}

/// A placement: a pose, or a 4 x 4 matrix (world from object), float64.
#[derive(FromPyObject)]
pub enum Placement<'py> {
    Pose(Pose),
    Matrix(PyReadonlyArray2<'py, f64>),
    Position([f64; 3]),
}

impl Placement<'_> {
    pub fn transform(&self) -> Outcome<DAffine3> {
        match self {
            Placement::Pose(Pose(pose)) => Ok(DAffine3::from_rotation_translation(pose.orientation, pose.position)),
            Placement::Position(position) => Ok(DAffine3::from_translation((*position).into())),
            Placement::Matrix(matrix) => {
                let matrix = matrix.as_array();
                if (matrix.nrows(), matrix.ncols()) != (4, 4) {
                    let found = format!("{} x {}", matrix.nrows(), matrix.ncols());
                    return Err(Failure::argument("pose", found, "a Pose, a position, or a matrix of 4 x 4"));
                }
                Ok(affine(matrix))
            }
        }
    }
}

/// The transform of a matrix of 4 x 4.
pub fn affine(matrix: ArrayView2<f64>) -> DAffine3 {
    let columns = std::array::from_fn(|column| std::array::from_fn(|row| matrix[[row, column]]));
    DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns))
}
