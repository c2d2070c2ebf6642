//! Scenes that change from scan to scan.

use crate::array::rows;
use crate::cloud::PointCloud;
use crate::error::{Failure, Outcome};
use crate::options::Asked;
use crate::place::Pose;
use crate::scene::{Scene, mesh, scan};
use crate::sensor::Instrument;
use echocast::scene::Object;
use echocast::{Engine, ObjectId};
use glam::{DAffine3, DMat4};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A scene whose objects move, change, come and go between scans.
///
/// LiveScene(scene=None, *, threads=None)
///
/// Objects are numbers, which `add`, `add_scene` and `find` give. One thread at a time changes or scans it.
#[pyclass(frozen, module = "echocast")]
pub struct LiveScene(Mutex<echocast::LiveScene>);

/// A placement: a pose, or a 4 x 4 matrix (world from object), float64.
#[derive(FromPyObject)]
enum Placement<'py> {
    Pose(Pose),
    Matrix(PyReadonlyArray2<'py, f64>),
    Position([f64; 3]),
}

impl Placement<'_> {
    fn transform(&self) -> Outcome<DAffine3> {
        match self {
            Placement::Pose(Pose(pose)) => Ok(DAffine3::from_rotation_translation(pose.orientation, pose.position)),
            Placement::Position(position) => Ok(DAffine3::from_translation((*position).into())),
            Placement::Matrix(matrix) => {
                let matrix = matrix.as_array();
                if (matrix.nrows(), matrix.ncols()) != (4, 4) {
                    let found = format!("{} x {}", matrix.nrows(), matrix.ncols());
                    return Err(Failure::argument("pose", found, "a Pose, a position, or a matrix of 4 x 4"));
                }
                let columns = std::array::from_fn(|column| std::array::from_fn(|row| matrix[[row, column]]));
                Ok(DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns)))
            }
        }
    }
}

impl LiveScene {
    fn lock(&self) -> MutexGuard<'_, echocast::LiveScene> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl LiveScene {
    #[new]
    #[pyo3(signature = (scene = None, *, threads = None))]
    fn new(py: Python<'_>, scene: Option<Bound<'_, Scene>>, threads: Option<usize>) -> Outcome<LiveScene> {
        let engine = threads.map_or_else(Engine::new, Engine::with_threads)?;
        let mut live = echocast::LiveScene::new(&engine);
        if let Some(scene) = scene {
            let scene = &scene.get().scene;
            py.detach(|| live.add_scene(scene))?;
        }
        Ok(LiveScene(Mutex::new(live)))
    }

    /// Adds all objects of `scene`; returns their numbers.
    fn add_scene(&self, py: Python<'_>, scene: Bound<'_, Scene>) -> Outcome<Vec<u64>> {
        let scene = &scene.get().scene;
        let added = py.detach(|| self.lock().add_scene(scene))?;
        Ok(added.into_iter().map(ObjectId::to_u64).collect())
    }

    /// Adds a mesh: `vertices`, n x 3 float32, m; `triangles`, m x 3 uint32. Returns the number of the object.
    #[pyo3(signature = (vertices, triangles, *, pose = None, name = "mesh", category = 0, instance = 0))]
    fn add(
        &self,
        vertices: PyReadonlyArray2<'_, f32>,
        triangles: PyReadonlyArray2<'_, u32>,
        pose: Option<Placement<'_>>,
        name: &str,
        category: u32,
        instance: u32,
    ) -> Outcome<u64> {
        let mut object = Object::new(name, mesh(name, &vertices, &triangles)?);
        (object.category_id, object.instance_id) = (category, instance);
        if let Some(pose) = pose {
            object.world_from_object = pose.transform()?;
        }
        Ok(self.lock().add(object)?.to_u64())
    }

    /// Removes an object.
    fn remove(&self, object: u64) -> Outcome<()> {
        Ok(self.lock().remove(ObjectId::from_u64(object))?)
    }

    /// The number of the object called `name`.
    fn find(&self, name: &str) -> Outcome<u64> {
        Ok(self.lock().find(name)?.to_u64())
    }

    /// Places an object: a Pose, x, y and z, or a matrix of 4 x 4, float64.
    fn set_pose(&self, object: u64, pose: Placement<'_>) -> Outcome<()> {
        let pose = pose.transform()?;
        Ok(self.lock().set_pose(ObjectId::from_u64(object), pose)?)
    }

    /// Moves the vertices of an object: n x 3 float32, as many as it has.
    fn set_vertices(&self, object: u64, vertices: PyReadonlyArray2<'_, f32>) -> Outcome<()> {
        let positions = rows::<_, 3>("vertices", &vertices)?;
        Ok(self.lock().set_vertices(ObjectId::from_u64(object), positions.into(), None)?)
    }

    /// Lets what moves by itself be where it is at `time`, s, during scans of `length`, s.
    #[pyo3(signature = (time, length = 0.0))]
    fn set_time(&self, time: f64, length: f64) -> Outcome<()> {
        Ok(self.lock().set_time(time, length)?)
    }

    /// What `sensor` sees now; as `Scene.scan`.
    #[pyo3(signature = (sensor, **options))]
    fn scan(&self, py: Python<'_>, sensor: Instrument<'_>, options: Option<&Bound<'_, PyDict>>) -> Outcome<PointCloud> {
        let sensor = sensor.sensor()?;
        let asked = Asked::of(options, &sensor)?;
        let built = py.detach(|| self.lock().commit())?;
        scan(py, &built, &sensor, &asked)
    }

    fn __repr__(&self) -> String {
        let live = self.lock();
        format!("<LiveScene: {} objects, {} triangles>", live.objects().count(), live.triangle_count())
    }
}
