//! Scenes that do not change.

use crate::array::rows;
use crate::cloud::PointCloud;
use crate::error::{Failure, Outcome};
use crate::options::Asked;
use crate::ping::{Ping, Pings, ping, pings};
use crate::place::Placement;
use crate::sensor::{Instrument, options_text};
use echocast::generate::Generate;
use echocast::scene::{Mesh, NameTable, Object, Part};
use echocast::{BuiltScene, LoadOptions};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// A scene that was loaded, or made of arrays: z up, metres.
///
/// `Scene.load("street.glb")`, `Scene.from_arrays(vertices, triangles)`. It is built for tracing at the first scan. Any
/// number of threads may scan it.
#[pyclass(frozen, module = "echocast")]
pub struct Scene {
    pub scene: echocast::Scene,
    built: OnceLock<BuiltScene>,
}

impl Scene {
    pub fn of(scene: echocast::Scene) -> Scene {
        Scene { scene, built: OnceLock::new() }
    }

    /// It, whose instances are called as the first of their objects.
    fn numbered(mut scene: echocast::Scene) -> Scene {
        let objects = scene.objects.iter().rev();
        scene.labels.instance = table(objects.map(|object| (object.instance_id, object.name.clone())).collect());
        Scene::of(scene)
    }

    /// Its structure, which the first to ask for it builds.
    fn built(&self, py: Python<'_>) -> Outcome<BuiltScene> {
        if let Some(built) = self.built.get() {
            return Ok(built.clone());
        }
        let built = py.detach(|| self.scene.build())?;
        Ok(self.built.get_or_init(|| built).clone())
    }
}

/// Names of label numbers; 0 has none.
fn table(mut names: BTreeMap<u32, String>) -> NameTable {
    names.remove(&0);
    let (ids, names) = names.into_iter().unzip();
    NameTable { ids, names }
}

/// A file, or several that are one scene.
#[derive(FromPyObject)]
enum Files {
    One(PathBuf),
    Several(Vec<PathBuf>),
}

/// A mesh of `triangles`, n x 3 indices of `vertices`, m x 3 metres.
pub fn mesh(
    name: &str,
    vertices: &PyReadonlyArray2<'_, f32>,
    triangles: &PyReadonlyArray2<'_, u32>,
) -> Outcome<Arc<Mesh>> {
    let positions = rows::<_, 3>("vertices", vertices)?;
    let triangles = rows::<_, 3>("triangles", triangles)?;
    let part = Part { positions: positions.into(), triangles: triangles.into(), ..Part::default() };
    Ok(Arc::new(Mesh::new(name, vec![part])?))
}

/// What a dict says of an object.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct ObjectKeys<'py> {
    vertices: PyReadonlyArray2<'py, f32>,
    triangles: PyReadonlyArray2<'py, u32>,
    #[pyo3(default = "mesh".to_owned())]
    name: String,
    #[pyo3(default)]
    pose: Option<Placement<'py>>,
    #[pyo3(default)]
    category: Option<Category>,
    #[pyo3(default)]
    instance: Option<u32>,
}

/// A category by its number or name.
#[derive(FromPyObject)]
enum Category {
    Number(u32),
    Name(String),
}

#[pymethods]
impl Scene {
    /// Reads a scene file, or several as one: glTF, OBJ, PLY, STL or FBX.
    ///
    /// `options`: those of the section `scene` of a scenario, such as `up="y"`, `scale=0.001`, `labels="rules.yaml"`,
    /// `hide=["Sky*"]`.
    #[staticmethod]
    #[pyo3(signature = (files, **options))]
    fn load(py: Python<'_>, files: Files, options: Option<&Bound<'_, PyDict>>) -> Outcome<Scene> {
        let options = match options {
            Some(keys) => LoadOptions::from_yaml(&options_text(keys)?)?,
            None => LoadOptions::default(),
        };
        let files = match files {
            Files::One(file) => vec![file],
            Files::Several(files) => files,
        };
        Ok(Scene::of(py.detach(|| echocast::Scene::load_all(&files, &options))?))
    }

    /// Makes a scene of one mesh: `vertices`, n x 3 float32, m; `triangles`, m x 3 uint32, indices of vertices.
    ///
    /// `categories`: a number for each triangle (uint32), or None; `names`: a dict from number to name.
    #[staticmethod]
    #[pyo3(signature = (vertices, triangles, *, categories = None, names = None, name = "mesh"))]
    fn from_arrays(
        vertices: PyReadonlyArray2<'_, f32>,
        triangles: PyReadonlyArray2<'_, u32>,
        categories: Option<PyReadonlyArray1<'_, u32>>,
        names: Option<BTreeMap<u32, String>>,
        name: &str,
    ) -> Outcome<Scene> {
        let mut scene = echocast::Scene::default();
        let names = names.unwrap_or_default();
        scene.labels.category = table(names.clone());
        let whole = mesh(name, &vertices, &triangles)?;
        let Some(categories) = categories else {
            scene.objects.push(Object { instance_id: 1, ..Object::new(name, whole) });
            return Ok(Scene::numbered(scene));
        };
        let categories = categories.as_array();
        let part = &whole.parts[0];
        if categories.len() != part.triangles.len() {
            let allowed = format!("{}, one for each triangle", part.triangles.len());
            return Err(Failure::argument("categories", format!("{} numbers", categories.len()), allowed));
        }
        let mut kinds: Vec<u32> = categories.iter().copied().collect();
        kinds.sort_unstable();
        kinds.dedup();
        for (place, &category_id) in kinds.iter().enumerate() {
            let mine = part.triangles.iter().zip(categories.iter()).filter(|(_, kind)| **kind == category_id);
            let triangles: Vec<[u32; 3]> = mine.map(|(triangle, _)| *triangle).collect();
            let part = Part { positions: part.positions.clone(), triangles: triangles.into(), ..Part::default() };
            let name = names.get(&category_id).cloned().unwrap_or_else(|| format!("{name} {category_id}"));
            let mesh = Arc::new(Mesh::new(name.clone(), vec![part])?);
            let object = Object { category_id, instance_id: place as u32 + 1, ..Object::new(name, mesh) };
            scene.objects.push(object);
        }
        Ok(Scene::numbered(scene))
    }

    /// Makes a scene of objects, a dict for each: `vertices` and `triangles` as for `from_arrays`; `name`; `pose`, a Pose, a
    /// position or a matrix of 4 x 4; `category`, a name, or a number that `names` names; `instance`, a number, by default
    /// one of its own.
    #[staticmethod]
    #[pyo3(signature = (objects, *, names = None))]
    fn from_objects(objects: Vec<ObjectKeys<'_>>, names: Option<BTreeMap<u32, String>>) -> Outcome<Scene> {
        let fixed = names.unwrap_or_default().into_iter().filter(|(id, _)| *id > 0);
        let fixed: BTreeMap<String, u32> = fixed.map(|(id, name)| (name, id)).collect();
        let named = objects.iter().filter_map(|object| match &object.category {
            Some(Category::Name(name)) => Some(name.clone()),
            _ => None,
        });
        // Numbers that objects have are not for names without one.
        let mut taken = fixed.clone();
        for object in &objects {
            if let Some(Category::Number(number)) = object.category
                && !fixed.values().any(|&known| known == number)
            {
                taken.insert(format!("\0{number}"), number);
            }
        }
        let mut scene = echocast::Scene::default();
        scene.labels.category = NameTable::number(named.chain(fixed.into_keys()), &taken);
        for (place, keys) in objects.into_iter().enumerate() {
            let mut object = Object::new(keys.name.as_str(), mesh(&keys.name, &keys.vertices, &keys.triangles)?);
            object.instance_id = keys.instance.unwrap_or(place as u32 + 1);
            object.category_id = match keys.category {
                Some(Category::Number(number)) => number,
                Some(Category::Name(name)) => scene.labels.category.id(&name),
                None => 0,
            };
            if let Some(pose) = keys.pose {
                object.world_from_object = pose.transform()?;
            }
            scene.objects.push(object);
        }
        Ok(Scene::numbered(scene))
    }

    /// Makes a scene of a trimesh.Trimesh or trimesh.Scene, an Open3D TriangleMesh, or a list of them.
    ///
    /// `up`: "z", "-z", "y", …: which of its axes points up; `scale`: metres per unit; `category`: of meshes that have none
    /// in their metadata, which else is their name.
    #[staticmethod]
    #[pyo3(signature = (mesh, **options))]
    fn from_mesh<'py>(mesh: &Bound<'py, PyAny>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        mesh.py().import("echocast._meshes")?.getattr("scene")?.call((mesh,), options)
    }

    /// Generates a scene: "street", "landscape", "indoor" or "seabed".
    ///
    /// `options`: those of the section `scene.generate` of a scenario, such as `blocks=[3, 2]`; `path`: a .glb file that
    /// keeps it.
    #[staticmethod]
    #[pyo3(signature = (kind, *, seed = 0, path = None, **options))]
    fn generate(
        py: Python<'_>,
        kind: &str,
        seed: u64,
        path: Option<PathBuf>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Outcome<Scene> {
        let keys = PyDict::new(py);
        keys.set_item(kind, options.cloned().unwrap_or_else(|| PyDict::new(py)))?;
        keys.set_item("seed", seed)?;
        let wanted = Generate::from_yaml(&options_text(&keys)?)?;
        let scene = py.detach(|| {
            let made = wanted.scene(Path::new(""))?;
            if let Some(path) = path {
                made.write(path)?;
            }
            made.load(&LoadOptions::default())
        })?;
        Ok(Scene::of(scene))
    }

    /// What `sensor` sees: a cloud. For a sonar, the points of a ping.
    ///
    /// Keyword arguments: `at` (a Pose, x, y and z in metres, or a Trajectory), `seed`, `fields` (names of columns),
    /// `frame`, `start_time` (s), `organised`, `coordinates` ("world" or "sensor"), `order` ("beam" or "time"), `boxes`,
    /// `profile`, `environment`, `progress` (called with 0 to 1; returning False stops it) and others that the stubs list.
    #[pyo3(signature = (sensor, **options))]
    fn scan(&self, py: Python<'_>, sensor: Instrument<'_>, options: Option<&Bound<'_, PyDict>>) -> Outcome<PointCloud> {
        let sensor = sensor.sensor()?;
        let asked = Asked::of(options, &sensor)?;
        let built = self.built(py)?;
        scan(py, &built, &sensor, &asked)
    }

    /// A ping of a sonar: levels in range bins for each beam. Keyword arguments as those of `scan`.
    #[pyo3(signature = (sensor, **options))]
    fn ping(&self, py: Python<'_>, sensor: Instrument<'_>, options: Option<&Bound<'_, PyDict>>) -> Outcome<Ping> {
        let sensor = sensor.sensor()?;
        ping(py, &self.built(py)?, &sensor, &Asked::of(options, &sensor)?)
    }

    /// `count` pings of a sonar, one after the other along its trajectory. Keyword arguments as those of `scan`; `frame` and
    /// `start_time` are those of the first.
    #[pyo3(signature = (sensor, count, **options))]
    fn pings(
        &self,
        py: Python<'_>,
        sensor: Instrument<'_>,
        count: u32,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Outcome<Pings> {
        let sensor = sensor.sensor()?;
        pings(py, &self.built(py)?, &sensor, &Asked::of(options, &sensor)?, count)
    }

    /// When the last of what moves by itself ends, s; 0 if nothing does. `LiveScene.set_time` lets it move.
    #[getter]
    fn end_time(&self) -> f64 {
        self.scene.timeline.end()
    }

    /// Names of the animations of its file, with their lengths, s.
    #[getter]
    fn animations(&self) -> Vec<(String, f64)> {
        self.scene.animations.iter().cloned().zip(self.scene.animation_lengths.iter().copied()).collect()
    }

    /// Names of the objects.
    #[getter]
    fn objects(&self) -> Vec<String> {
        self.scene.objects.iter().map(|object| object.name.clone()).collect()
    }

    /// Names of the categories by their numbers.
    #[getter]
    fn categories(&self) -> BTreeMap<u32, String> {
        self.scene.labels.category.iter().map(|(id, name)| (id, name.to_owned())).collect()
    }

    /// Names of the camera nodes.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        self.scene.cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    /// The pose of a sensor at the camera node called `name`.
    fn camera(&self, name: &str) -> Outcome<crate::place::Pose> {
        Ok(crate::place::Pose(self.scene.camera(name)?.pose))
    }

    /// Number of triangles.
    #[getter]
    fn triangles(&self) -> usize {
        self.scene.triangle_count()
    }

    /// Lowest and highest coordinates, m; None if it is empty.
    #[getter]
    fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        self.scene.bounds().map(|(low, high)| (low.to_array(), high.to_array()))
    }

    /// What the reader noticed.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scene.report.warnings.clone()
    }

    fn __repr__(&self) -> String {
        format!("<Scene: {} objects, {} triangles>", self.scene.objects.len(), self.scene.triangle_count())
    }
}

/// Scans `built` as was asked for.
pub fn scan(py: Python<'_>, built: &BuiltScene, sensor: &echocast::Sensor, asked: &Asked) -> Outcome<PointCloud> {
    let cloud = asked.run(py, |progress| {
        let mut cloud = echocast::PointCloud::default();
        built.scan_with_progress(sensor, &asked.path, &asked.options, &mut cloud, progress)?;
        Ok(cloud)
    })?;
    Ok(PointCloud::of(cloud))
}
