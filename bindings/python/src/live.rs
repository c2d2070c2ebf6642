//! Scenes that change from scan to scan.

use crate::argument::{self, Argument};
use crate::array::numbers;
use crate::cloud::PointCloud;
use crate::error::{BindingError, BindingResult, no_pickle};
use crate::material::{MaterialLike, Matter};
use crate::mesh::{Mesh, VertexArray, mesh};
use crate::options::ScanRequest;
use crate::ping::{Ping, ping};
use crate::place::{Pose, affine, path, times_of, transform};
use crate::radar::{RadarFrame, radar_frame};
use crate::scene::{Scene, scan};
use crate::sensor::Instrument;
use echocast::radar::RadarRecord;
use echocast::scene::Object;
use echocast::{Engine, ObjectId};
use glam::{DAffine3, DVec3};
use numpy::PyReadonlyArray3;
use numpy::ndarray::{ArrayView3, Ix3};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::{PyDict, PyMapping};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A scene whose objects can be added, removed, changed and moved between scans, and move during scans.
///
/// `scene`: the objects it begins with, all fixed until they are moved. `threads`: number of threads that build and
/// scan it; None: all cores. Objects are identified by numbers, which `add`, `add_scene` and `find` return; the number
/// of a removed one is not used again, and using it is an ArgumentError. Threads may share it: each call waits for
/// earlier ones; scans run in parallel, each of the scene as it was when the scan began.
///
/// >>> live = ec.LiveScene()
/// >>> square = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], dtype=np.float32)
/// >>> door = live.add(square, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32), pose=(4, 0, 0))
/// >>> for x in (4, 6):
/// ...     live.set_pose(door, (x, 0, 0))
/// ...     print(round(float(np.median(live.scan("velodyne_vlp16", at=(0, 0, 0)).x))))
/// 4
/// 6
#[pyclass(frozen, module = "echocast")]
pub struct LiveScene(Mutex<EditedScene>);

/// A scene, and what is known of those of its objects that were given as arrays.
struct EditedScene {
    scene: echocast::LiveScene,
    given: HashMap<u64, ArrayObject>,
}

/// An object that was given as arrays. Far from 0, 0, 0, where float32 is coarse, the vertices of its mesh are relative
/// to a point among them, while its poses are those of the vertices as they were given.
#[derive(Clone, Default)]
struct ArrayObject {
    middle: DVec3,
    /// Its motion as it was given; empty if it does not move.
    motion: Vec<(f64, DAffine3)>,
}

impl EditedScene {
    /// Adds all objects of `scene`; returns their numbers.
    fn add_scene(&mut self, scene: &Scene) -> echocast::Result<Vec<u64>> {
        let added: Vec<u64> = self.scene.add_scene(&scene.scene)?.into_iter().map(ObjectId::to_u64).collect();
        let middles = scene.middles.iter().map(|&middle| ArrayObject { middle, ..ArrayObject::default() });
        self.given.extend(added.iter().copied().zip(middles));
        Ok(added)
    }

    /// Adds an object whose mesh has its vertices relative to `middle`; returns its number.
    fn add(&mut self, mut object: Object, middle: DVec3, fixed: bool) -> echocast::Result<u64> {
        object.world_from_object *= DAffine3::from_translation(middle);
        let added = if fixed { self.scene.add_fixed(object) } else { self.scene.add(object) }?.to_u64();
        self.given.insert(added, ArrayObject { middle, ..ArrayObject::default() });
        Ok(added)
    }

    fn middle(&self, object: u64) -> DVec3 {
        self.given.get(&object).map_or(DVec3::ZERO, |given| given.middle)
    }

    fn set_pose(&mut self, object: u64, pose: DAffine3) -> echocast::Result<()> {
        self.scene.set_pose(ObjectId::from_u64(object), pose * DAffine3::from_translation(self.middle(object)))?;
        self.given.entry(object).or_default().motion.clear();
        Ok(())
    }

    fn set_motion(&mut self, object: u64, motion: Vec<(f64, DAffine3)>) -> echocast::Result<()> {
        let shift = DAffine3::from_translation(self.middle(object));
        let keys: Vec<_> = motion.iter().map(|&(time, pose)| (time, pose * shift)).collect();
        self.scene.set_motion(ObjectId::from_u64(object), &keys)?;
        self.given.entry(object).or_default().motion = motion;
        Ok(())
    }

    /// `places`, in one frame or several, for each vertex of the mesh of `object`: where corners have attributes of their
    /// own, several vertices are at one place.
    fn of_mesh(&self, object: u64, places: Vec<[f32; 3]>) -> echocast::Result<Vec<[f32; 3]>> {
        let mesh = &self.scene.object(ObjectId::from_u64(object))?.mesh;
        let source = mesh.source.as_ref().filter(|_| self.given.contains_key(&object));
        let Some(source) = source.filter(|source| places.len().is_multiple_of(source.count)) else { return Ok(places) };
        let of_frame =
            |frame: &[[f32; 3]]| source.vertices[0].iter().map(|&place| frame[place as usize]).collect::<Vec<_>>();
        Ok(places.chunks_exact(source.count).flat_map(of_frame).collect())
    }

    /// Gives an object `vertices` by `set`, which receives them relative to the point that its mesh should use.
    fn set_vertices(
        &mut self,
        object: u64,
        vertices: VertexArray,
        set: impl FnOnce(&mut echocast::LiveScene, ObjectId, Vec<[f32; 3]>) -> echocast::Result<()>,
    ) -> echocast::Result<()> {
        let id = ObjectId::from_u64(object);
        let before = self.middle(object);
        // Vertices that a file moves cannot be made relative to another point.
        let middle = if self.given.contains_key(&object) { vertices.middle(before) } else { before };
        let places = self.of_mesh(object, vertices.about(middle))?;
        set(&mut self.scene, id, places)?;
        let Some(given) = self.given.get_mut(&object).filter(|_| middle != before) else { return Ok(()) };
        given.middle = middle;
        if given.motion.is_empty() {
            let placed = self.scene.object(id)?.world_from_object * DAffine3::from_translation(middle - before);
            self.scene.set_pose(id, placed)
        } else {
            let motion = given.motion.clone();
            self.set_motion(object, motion)
        }
    }
}

impl LiveScene {
    /// Locks it once all earlier calls have ended; until then other threads of Python continue.
    fn lock(&self, py: Python<'_>) -> MutexGuard<'_, EditedScene> {
        self.0.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// Names of its camera nodes.
    fn cameras(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).scene.cameras().iter().map(|camera| camera.name.clone()).collect()
    }

    /// Does `work` with it, detached from the interpreter.
    fn detached<T: Send>(&self, py: Python<'_>, work: impl Send + FnOnce(&mut EditedScene) -> T) -> T {
        py.detach(|| work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

#[pymethods]
impl LiveScene {
    #[new]
    #[pyo3(signature = (scene = None, *, threads = None))]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::scene)] scene: Option<Bound<'_, Scene>>,
        #[pyo3(from_py_with = argument::threads)] threads: Option<usize>,
    ) -> BindingResult<LiveScene> {
        let engine = threads.map_or_else(Engine::new, Engine::with_threads)?;
        let mut live = EditedScene { scene: echocast::LiveScene::new(&engine), given: HashMap::new() };
        if let Some(scene) = scene {
            let scene = scene.get();
            py.detach(|| live.add_scene(scene))?;
        }
        Ok(LiveScene(Mutex::new(live)))
    }

    /// Adds all objects of `scene`, its cameras and the names of its labels; returns the numbers of the objects.
    fn add_scene(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::scene)] scene: Bound<'_, Scene>,
    ) -> BindingResult<Vec<u64>> {
        let scene = scene.get();
        Ok(self.detached(py, |live| live.add_scene(scene))?)
    }

    /// Adds a mesh and returns the number of the object: `vertices`, n x 3, m; `triangles`, m x 3, indices of vertices.
    /// Arrays of any type of number and lists are copied, those of float32 and uint32 fastest; vertices in float64 stay
    /// precise far from 0, 0, 0.
    ///
    /// `pose`: a Pose, x, y, z, or a 4 x 4 matrix (world from object); None: at 0, 0, 0. `category` and `instance`: its
    /// label numbers, 0: unlabelled. `material`: as for `Scene.from_arrays`. `mask`: 32 bits; scans whose own `mask`
    /// shares one with these see it. `fixed`: True for one that does not move; scenes of many such objects are traced
    /// faster. Errors as for `Scene.from_arrays`.
    #[pyo3(signature = (vertices, triangles, *, pose = None, name = "mesh", category = 0, instance = 0, material = None, mask = 0xFFFF_FFFF, fixed = false))]
    #[allow(clippy::too_many_arguments)]
    fn add(
        &self,
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        pose: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = argument::name)] name: &str,
        #[pyo3(from_py_with = argument::category)] category: u32,
        #[pyo3(from_py_with = argument::instance)] instance: u32,
        #[pyo3(from_py_with = argument::material)] material: Option<MaterialLike<'_>>,
        #[pyo3(from_py_with = argument::mask)] mask: u32,
        #[pyo3(from_py_with = argument::fixed)] fixed: bool,
    ) -> BindingResult<u64> {
        let material = material.as_ref().map(Matter::of).transpose()?;
        let vertices = VertexArray::of(vertices)?;
        let middle = vertices.middle(DVec3::ZERO);
        let mut object = Object::new(name, mesh(name, vertices.about(middle), triangles, material.as_ref())?);
        (object.category_id, object.instance_id, object.mask) = (category, instance, mask);
        if let Some(pose) = pose {
            object.world_from_object = transform(pose)?;
        }
        Ok(self.lock(py).add(object, middle, fixed)?)
    }

    /// Adds an object with the mesh `mesh`, a Mesh, and returns its number. Objects of one Mesh share its memory.
    ///
    /// `parts`: label numbers of its parts, one for each material of the mesh; None: unlabelled. Other keywords as for
    /// `add`; None as `name`: that of the mesh.
    #[pyo3(signature = (mesh, *, pose = None, name = None, category = 0, instance = 0, parts = None, mask = 0xFFFF_FFFF, fixed = false))]
    #[allow(clippy::too_many_arguments)]
    fn add_mesh(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::mesh)] mesh: Bound<'_, Mesh>,
        pose: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = argument::name)] name: Option<&str>,
        #[pyo3(from_py_with = argument::category)] category: u32,
        #[pyo3(from_py_with = argument::instance)] instance: u32,
        #[pyo3(from_py_with = argument::parts)] parts: Option<Vec<u32>>,
        #[pyo3(from_py_with = argument::mask)] mask: u32,
        #[pyo3(from_py_with = argument::fixed)] fixed: bool,
    ) -> BindingResult<u64> {
        let Mesh { mesh: shape, middle, material_of, materials } = mesh.get();
        let mut object = Object::new(name.unwrap_or(&shape.name), shape.clone());
        (object.category_id, object.instance_id, object.mask) = (category, instance, mask);
        if let Some(parts) = parts {
            if parts.len() != *materials {
                let allowed = format!("{materials}, one for each material");
                return Err(BindingError::argument("parts", format!("{} numbers", parts.len()), allowed));
            }
            object.part_ids = material_of.iter().map(|&material| parts[material]).collect();
        }
        if let Some(pose) = pose {
            object.world_from_object = transform(pose)?;
        }
        Ok(self.lock(py).add(object, *middle, fixed)?)
    }

    /// Adds an object that shares the mesh and material of `object`, and returns its number: for many identical
    /// objects, this takes a fraction of the memory. Keywords as for `add`; None as `name`, `category` or `mask`: that
    /// of `object`.
    #[pyo3(signature = (object, *, pose = None, name = None, category = None, instance = 0, mask = None, fixed = false))]
    #[allow(clippy::too_many_arguments)]
    fn add_copy(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::object)] object: u64,
        pose: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = argument::name)] name: Option<&str>,
        #[pyo3(from_py_with = argument::category)] category: Option<u32>,
        #[pyo3(from_py_with = argument::instance)] instance: u32,
        #[pyo3(from_py_with = argument::mask)] mask: Option<u32>,
        #[pyo3(from_py_with = argument::fixed)] fixed: bool,
    ) -> BindingResult<u64> {
        let mut live = self.lock(py);
        let mut copy = live.scene.object(ObjectId::from_u64(object))?.clone();
        copy.name = name.map_or(copy.name, str::to_owned);
        copy.category_id = category.unwrap_or(copy.category_id);
        copy.instance_id = instance;
        copy.mask = mask.unwrap_or(copy.mask);
        copy.world_from_object = pose.map_or(Ok(DAffine3::IDENTITY), transform)?;
        let middle = live.middle(object);
        Ok(live.add(copy, middle, fixed)?)
    }

    /// What it is now as a Scene: objects with their motion, labels, and camera nodes. `cameras`: further ones, a dict
    /// with the place of each by its name: as `at` of `scan`.
    ///
    /// >>> live = ec.LiveScene(ec.Scene.generate("indoor", rooms=[1, 1]))
    /// >>> path = ec.Trajectory([0, 2], [[1, 1, 1], [2, 1, 1]])
    /// >>> live.to_scene(cameras={"Rover": path}).camera("Rover").position
    /// [1.0, 1.0, 1.0]
    #[pyo3(signature = (*, cameras = None))]
    fn to_scene(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::cameras)] cameras: Option<Bound<'_, PyMapping>>,
    ) -> BindingResult<Scene> {
        let mut paths = Vec::new();
        for item in cameras.map(|cameras| cameras.items()).transpose()?.iter().flatten() {
            let (name, place): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
            paths.push((Argument::of("a name in cameras", &name)?, path("cameras", &place)?));
        }
        Ok(Scene::of(self.lock(py).scene.to_scene(&paths)?))
    }

    /// Removes an object.
    fn remove(&self, py: Python<'_>, #[pyo3(from_py_with = argument::object)] object: u64) -> BindingResult<()> {
        let mut live = self.lock(py);
        live.scene.remove(ObjectId::from_u64(object))?;
        live.given.remove(&object);
        Ok(())
    }

    /// The number of the first object called `name`; ArgumentError if there is none, with the nearest names.
    fn find(&self, py: Python<'_>, #[pyo3(from_py_with = argument::name)] name: &str) -> BindingResult<u64> {
        Ok(self.lock(py).scene.find(name)?.to_u64())
    }

    /// Places an object: a Pose, x, y, z, or a 4 x 4 matrix (world from object).
    fn set_pose(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::object)] object: u64,
        pose: &Bound<'_, PyAny>,
    ) -> BindingResult<()> {
        let pose = transform(pose)?;
        Ok(self.lock(py).set_pose(object, pose)?)
    }

    /// Sets the positions of the vertices of an object: n x 3, m, as many as it has. Copied, as by `add`.
    fn set_vertices(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::object)] object: u64,
        vertices: &Bound<'_, PyAny>,
    ) -> BindingResult<()> {
        let vertices = VertexArray::of(vertices)?;
        let set = |live: &mut echocast::LiveScene, id, places: Vec<_>| live.set_vertices(id, places.into(), None);
        Ok(self.lock(py).set_vertices(object, vertices, set)?)
    }

    /// Sets the motion of an object: `poses`, n x 4 x 4 (world from object), at `times`, n, s, which never decrease;
    /// interpolated linearly in position and by slerp in rotation; before and after them it stands still. `set_time`
    /// selects the part of it that scans see.
    ///
    /// >>> live = ec.LiveScene()
    /// >>> square = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], dtype=np.float32)
    /// >>> door = live.add(square, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32))
    /// >>> poses = np.stack([np.eye(4), np.eye(4)])
    /// >>> poses[:, 0, 3] = 4, 8  # x, m
    /// >>> live.set_motion(door, [0.0, 1.0], poses)
    /// >>> live.set_time(0.5)
    /// >>> round(float(np.median(live.scan("velodyne_vlp16", at=(0, 0, 0)).x)))
    /// 6
    fn set_motion(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::object)] object: u64,
        times: &Bound<'_, PyAny>,
        poses: &Bound<'_, PyAny>,
    ) -> BindingResult<()> {
        let times = times_of(times)?;
        let poses = numbers::<f64, Ix3>("poses", poses, "n x 4 x 4")?;
        let poses = poses.as_array();
        if poses.dim() != (times.len(), 4, 4) {
            let (count, rows, columns) = poses.dim();
            let allowed = format!("{} x 4 x 4, a matrix for each time", times.len());
            return Err(BindingError::argument("poses", format!("{count} x {rows} x {columns}"), allowed));
        }
        let poses = poses.outer_iter().map(|pose| affine("poses", pose)).collect::<BindingResult<Vec<_>>>()?;
        Ok(self.lock(py).set_motion(object, times.into_iter().zip(poses).collect())?)
    }

    /// Sets the motion of the vertices of an object: `vertices`, n x m x 3, m, as many as it has, at `times`, n, s,
    /// which rise; in straight lines between them. `set_time` selects the part of it that scans see.
    fn set_vertex_motion(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::object)] object: u64,
        times: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
    ) -> BindingResult<()> {
        let times = times_of(times)?;
        let check = |(count, points, columns): (usize, usize, usize)| {
            let allowed = || format!("{} x m x 3, vertices for each time", times.len());
            let found = || format!("{count} x {points} x {columns}");
            let fits = (count, columns) == (times.len(), 3);
            if fits { Ok(()) } else { Err(BindingError::argument("vertices", found(), allowed())) }
        };
        let vertices = if let Ok(single) = vertices.extract::<PyReadonlyArray3<'_, f32>>() {
            check(single.as_array().dim())?;
            VertexArray::Single(all(single.as_array()))
        } else {
            let double = numbers::<f64, Ix3>("vertices", vertices, "n x m x 3")?;
            check(double.as_array().dim())?;
            VertexArray::Double(all(double.as_array()).into_iter().map(DVec3::from_array).collect())
        };
        let set = |live: &mut echocast::LiveScene, id, places: Vec<[f32; 3]>| {
            let frames = places.chunks_exact((places.len() / times.len().max(1)).max(1));
            let keys = times.iter().zip(frames).map(|(&time, frame)| (time, frame.to_vec().into()));
            live.set_vertex_motion(id, &keys.collect::<Vec<_>>())
        };
        Ok(self.lock(py).set_vertices(object, vertices, set)?)
    }

    /// Gives an object another category and instance, numbers; 0: unlabelled.
    #[pyo3(signature = (object, *, category, instance))]
    fn set_labels(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::object)] object: u64,
        #[pyo3(from_py_with = argument::category)] category: u32,
        #[pyo3(from_py_with = argument::instance)] instance: u32,
    ) -> BindingResult<()> {
        let (mut live, object) = (self.lock(py), ObjectId::from_u64(object));
        let parts = live.scene.object(object)?.part_ids.clone();
        Ok(live.scene.set_labels(object, category, instance, &parts)?)
    }

    /// Names a number, from 1, in the label `table`: "category", "part" or "instance".
    fn name_label(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::table)] table: &str,
        #[pyo3(from_py_with = argument::number)] number: u32,
        #[pyo3(from_py_with = argument::name)] name: &str,
    ) -> BindingResult<()> {
        Ok(self.lock(py).scene.name_label(table, number, name)?)
    }

    /// Numbers and names of its objects.
    #[getter]
    fn objects(&self, py: Python<'_>) -> std::collections::BTreeMap<u64, String> {
        self.lock(py).scene.objects().map(|(id, object)| (id.to_u64(), object.name.clone())).collect()
    }

    /// The pose of a sensor at the camera node called `name`, now; ArgumentError if there is none, with the nearest
    /// names.
    fn camera(&self, py: Python<'_>, #[pyo3(from_py_with = argument::name)] name: &str) -> BindingResult<Pose> {
        Ok(Pose(self.lock(py).scene.camera(name)?))
    }

    /// Sets the time span of the scans that follow: everything that moves by itself has its motion from `time` to
    /// `time + length`, s. With a `length` of 0 it stands still as it is at `time`. A new scene stands still at 0.
    #[pyo3(signature = (time, length = 0.0))]
    fn set_time(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::time)] time: f64,
        #[pyo3(from_py_with = argument::length)] length: f64,
    ) -> BindingResult<()> {
        Ok(self.lock(py).scene.set_time(time, length)?)
    }

    /// Scans the scene as it is now and returns a cloud. Keywords as for `Scene.scan`.
    #[pyo3(signature = (sensor, **options))]
    fn scan(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<PointCloud> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras(py))?;
        let built = self.detached(py, |live| live.scene.commit())?;
        scan(py, &built, &request, || self.lock(py).scene.bounds())
    }

    /// Explains what happens to beam `beam` of a scan of the scene as it is now, as `Scene.explain` does.
    #[pyo3(signature = (sensor, beam, **options))]
    fn explain(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        #[pyo3(from_py_with = argument::beam)] beam: u32,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<String> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras(py))?;
        let built = self.detached(py, |live| live.scene.commit())?;
        Ok(py.detach(|| built.explain(&request.sensor, &request.path, &request.options, beam))?)
    }

    /// A ping of a sonar in the scene as it is now. Keywords as for `Scene.scan`.
    #[pyo3(signature = (sensor, **options))]
    fn ping(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<Ping> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras(py))?;
        let built = self.detached(py, |live| live.scene.commit())?;
        ping(py, &built, &request)
    }

    /// A frame of a radar in the scene as it is now, as `Scene.radar_frame`.
    #[pyo3(signature = (sensor, *, cube = true, samples = false, **options))]
    fn radar_frame(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        #[pyo3(from_py_with = argument::cube)] cube: bool,
        #[pyo3(from_py_with = argument::samples)] samples: bool,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<RadarFrame> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras(py))?;
        let built = self.detached(py, |live| live.scene.commit())?;
        radar_frame(py, &built, &request, RadarRecord { cube, samples })
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("a LiveScene", "let each process make one, from a file or arrays; PointCloud, Sensor and Pose can")
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let live = &self.lock(py).scene;
        format!("<LiveScene: {} objects, {} triangles>", live.objects().count(), live.triangle_count())
    }
}

/// All rows of `vertices`, n x m x 3, one after the other.
fn all<T: Copy>(vertices: ArrayView3<T>) -> Vec<[T; 3]> {
    vertices.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect()
}
