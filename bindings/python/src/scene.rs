//! Scenes that do not change.

use crate::argument::{self, Argument, class, one_of, wrong_type};
use crate::array::numbers;
use crate::cloud::PointCloud;
use crate::error::{BindingError, BindingResult, no_pickle};
use crate::material::{MaterialLike, Matter};
use crate::mesh::{VertexArray, mesh};
use crate::options::{ScanRequest, warn};
use crate::ping::{Ping, Pings, ping, pings};
use crate::place::transform;
use crate::radar::{RadarFrame, radar_frame};
use crate::sensor::{Instrument, options_text};
use echocast::generate::Generate;
use echocast::radar::RadarRecord;
use echocast::scene::{Mesh, NameTable, Object};
use echocast::{BuiltScene, LoadOptions, why_nothing};
use glam::{DAffine3, DVec3};
use numpy::ndarray::Ix1;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PySequence, PyString};
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// A static scene: objects of triangles with labels and materials, z up, m.
///
/// `load`, `from_arrays`, `from_objects`, `from_mesh` and `generate` make one. It is built for tracing at the first
/// scan. Any number of threads may scan it. A `LiveScene` has objects that are added, removed and moved.
///
/// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
/// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"), seed=7)
/// >>> bool(cloud.range.max() < 15)
/// True
#[pyclass(frozen, module = "echocast")]
pub struct Scene {
    pub scene: echocast::Scene,
    /// For each object that was given as arrays, the point that the vertices of its mesh are relative to.
    pub middles: Vec<DVec3>,
    built: OnceLock<BuiltScene>,
}

class! { Scene, "a Scene" }

impl Scene {
    pub fn of(scene: echocast::Scene) -> Scene {
        Scene { scene, middles: Vec::new(), built: OnceLock::new() }
    }

    /// Makes a scene whose instances are named after the first of their objects, whose materials are numbered, and
    /// whose objects have their vertices relative to `middles`.
    fn numbered(mut scene: echocast::Scene, middles: Vec<DVec3>) -> Scene {
        let objects = scene.objects.iter().rev();
        scene.labels.instance = objects.map(|object| (object.instance_id, object.name.clone())).collect();
        let materials =
            scene.objects.iter().flat_map(|object| &object.mesh.parts).filter_map(|part| part.material.as_ref());
        scene.labels.material = NameTable::number(materials.map(|material| material.name.clone()), &BTreeMap::new());
        Scene { middles, ..Scene::of(scene) }
    }

    /// Its acceleration structure, which the first call builds.
    fn built(&self, py: Python<'_>) -> BindingResult<BuiltScene> {
        if let Some(built) = self.built.get() {
            return Ok(built.clone());
        }
        let built = py.detach(|| self.scene.build())?;
        Ok(self.built.get_or_init(|| built).clone())
    }
}

/// A file, or several that form one scene.
enum ScenePaths {
    One(PathBuf),
    Several(Vec<PathBuf>),
}

one_of! { ScenePaths: One | Several; "the path of a file, or a list of paths" }

/// Meshes made so far, by their vertices, triangles and material: arrays that are passed twice share one mesh.
type MeshCache = HashMap<(ArgumentIdentity, ArgumentIdentity, Option<Matter>), (Arc<Mesh>, DVec3)>;

/// The identity of an argument while it exists: for an array its memory, for others the object itself.
#[derive(PartialEq, Eq, Hash)]
enum ArgumentIdentity {
    /// Address, shape, strides and type.
    Array(usize, Vec<usize>, Vec<isize>, String),
    Thing(usize),
}

impl ArgumentIdentity {
    fn of(value: &Bound<'_, PyAny>) -> PyResult<ArgumentIdentity> {
        let Ok(array) = value.cast::<PyUntypedArray>() else {
            return Ok(ArgumentIdentity::Thing(value.as_ptr() as usize));
        };
        let address = array.getattr("ctypes")?.getattr("data")?.extract()?;
        let kind = array.dtype().str()?.to_string();
        Ok(ArgumentIdentity::Array(address, array.shape().to_vec(), array.strides().to_vec(), kind))
    }
}

/// Keys of a dict that describes an object, the fields of `ObjectKeys`.
const OBJECT_KEYS: &str = "vertices, triangles, name, pose, category, instance, material";

/// The contents of a dict that describes an object.
struct ObjectKeys<'py> {
    vertices: Bound<'py, PyAny>,
    triangles: Bound<'py, PyAny>,
    name: String,
    pose: Option<Bound<'py, PyAny>>,
    category: Option<Category>,
    instance: Option<u32>,
    material: Option<MaterialLike<'py>>,
}

impl<'py> ObjectKeys<'py> {
    /// Converts item `place` of a list.
    fn of(place: usize, object: &Bound<'py, PyAny>) -> BindingResult<Self> {
        let Ok(keys) = object.cast::<PyMapping>() else {
            return Err(wrong_type(&format!("object {place}"), object, &format!("a dict with keys of {OBJECT_KEYS}")));
        };
        for key in keys.keys()? {
            let known = |key: &str| OBJECT_KEYS.split(", ").any(|known| known == key);
            if !key.extract::<&str>().is_ok_and(known) {
                return Err(BindingError::argument(format!("a key of object {place}"), key.repr()?, OBJECT_KEYS));
            }
        }
        let needed = |key: &str| {
            let missing = || PyKeyError::new_err(format!("object {place} has no {key:?}; needed: vertices, triangles"));
            item(keys, key)?.ok_or_else(|| BindingError::from(missing()))
        };
        let at = |key: &str| format!("{key} of object {place}");
        Ok(ObjectKeys {
            vertices: needed("vertices")?,
            triangles: needed("triangles")?,
            name: value(keys, "name", at)?.unwrap_or_else(|| "mesh".to_owned()),
            pose: value(keys, "pose", at)?,
            category: value(keys, "category", at)?,
            instance: value(keys, "instance", at)?,
            material: value(keys, "material", at)?,
        })
    }
}

/// The value of `key` in `keys`. A KeyError means that there is none; other errors come from the mapping itself.
fn item<'py>(keys: &Bound<'py, PyMapping>, key: &str) -> BindingResult<Option<Bound<'py, PyAny>>> {
    match keys.get_item(key) {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.is_instance_of::<PyKeyError>(keys.py()) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The value of `key`, which `name` names in errors, if there is one that is not None.
fn value<'py, T: for<'a> Argument<'a, 'py>>(
    keys: &Bound<'py, PyMapping>,
    key: &str,
    name: impl Fn(&str) -> String,
) -> BindingResult<Option<T>> {
    item(keys, key)?.filter(|value| !value.is_none()).map(|value| T::of(&name(key), &value)).transpose()
}

/// The argument `objects`: a list of dicts.
struct ObjectDicts<'py>(Vec<Bound<'py, PyAny>>);

impl<'py> Argument<'_, 'py> for ObjectDicts<'py> {
    fn of(name: &str, value: &Bound<'py, PyAny>) -> BindingResult<Self> {
        let list = value.cast::<PySequence>().ok().filter(|_| !value.is_instance_of::<PyString>());
        let Some(list) = list else { return Err(wrong_type(name, value, "a list of dicts, one for each object")) };
        Ok(ObjectDicts(list.try_iter()?.collect::<PyResult<_>>()?))
    }
}

/// A category by its number or name.
enum Category {
    Number(u32),
    Name(String),
}

one_of! { Category: Number | Name; "a name, or a number from 0 to 4294967295" }

#[pymethods]
impl Scene {
    /// Reads a scene file: glTF, OBJ, PLY, STL, FBX, COLLADA, or a robot (URDF, SDF, MJCF); or several, in a list, as one scene.
    ///
    /// `options`: keys of the section `scene` of a scenario:
    ///
    /// * `labels`: a label file, its contents as a dict, or the name of built-in rules: "street", "forest",
    ///   "semantic_kitti".
    /// * `hide`: name patterns of objects to leave out: `["Sky*"]`.
    /// * `materials`: materials of surfaces by name pattern: `{"Wall*": {"reflectance": 0.3}}`.
    /// * `up`: which axis points up in files that do not define it (OBJ, PLY, STL): "y", "z", "x", "-x", "-y" or "-z".
    /// * `scale`: metres per unit of these files.
    /// * `joints`: positions of joints of robots by name, radians or metres: `{"elbow": 0.5}`.
    /// * `geometry`: which geometry of robots is read: "visual" or "collision".
    /// * `model_paths`: folders of packages and models that robots name.
    /// * `animation`, `loop`, `caches`, `texture_limit_mib`, `allow_outside_paths`: as in a scenario; file names are
    ///   relative to the working folder.
    ///
    /// NotFoundError for a missing file, FormatError for a broken one and for unknown options.
    ///
    /// >>> with open("tent.obj", "w") as file:
    /// ...     print("o tent\nv -1 -1 0\nv 1 -1 0\nv 0 0 2\nf 1 2 3", file=file)
    /// >>> tent = ec.Scene.load("tent.obj", up="z", labels={"objects": {"tent*": "tent"}})
    /// >>> tent.objects, list(tent.categories.values())
    /// (['tent'], ['tent'])
    #[staticmethod]
    #[pyo3(signature = (files, **options))]
    fn load(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::files)] files: ScenePaths,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<Scene> {
        let options = match options {
            Some(keys) => LoadOptions::from_yaml(&options_text(keys)?)?,
            None => LoadOptions::default(),
        };
        let files = match files {
            ScenePaths::One(file) => vec![file],
            ScenePaths::Several(files) => files,
        };
        Ok(Scene::of(py.detach(|| echocast::Scene::load_all(&files, &options))?))
    }

    /// A scene of one mesh: `vertices`, n x 3, m; `triangles`, m x 3, indices of vertices.
    ///
    /// `categories`: m numbers from 0, one for each triangle; the triangles of a number form an object. `names`: names
    /// of these numbers, a dict. `name`: that of the object, if there are no categories. `material`: a Material, or
    /// what `Material` takes. Arrays of any type of number and lists are copied, those of
    /// float32 and uint32 fastest; vertices in float64 stay precise far from 0, 0, 0. ArgumentError for other shapes
    /// and for numbers that are not finite, TypeError for anything but numbers.
    ///
    /// >>> floor = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], dtype=np.float32)
    /// >>> triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    /// >>> numbers = np.array([40, 40], dtype=np.uint32)
    /// >>> scene = ec.Scene.from_arrays(floor, triangles, categories=numbers, names={40: "road"})
    /// >>> scene.scan("velodyne_vlp16", at=(0, 0, 1.8)).categories
    /// {40: 'road'}
    #[staticmethod]
    #[pyo3(signature = (vertices, triangles, *, categories = None, names = None, name = "mesh", material = None))]
    fn from_arrays(
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        categories: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = argument::names)] names: Option<BTreeMap<u32, String>>,
        #[pyo3(from_py_with = argument::name)] name: &str,
        #[pyo3(from_py_with = argument::material)] material: Option<MaterialLike<'_>>,
    ) -> BindingResult<Scene> {
        let mut scene = echocast::Scene::default();
        let names = names.unwrap_or_default();
        scene.labels.category = names.iter().map(|(&id, name)| (id, name)).collect();
        let material = material.as_ref().map(Matter::of).transpose()?;
        let vertices = VertexArray::of(vertices)?;
        let middle = vertices.middle(DVec3::ZERO);
        let world_from_object = DAffine3::from_translation(middle);
        let whole = mesh(name, vertices.about(middle), triangles, material.as_ref())?;
        let Some(categories) = categories else {
            scene.objects.push(Object::new(name, whole).instance_id(1).world_from_object(world_from_object));
            return Ok(Scene::numbered(scene, vec![middle]));
        };
        let categories = numbers::<u32, Ix1>("categories", categories, "one for each triangle:")?;
        let categories = categories.as_array();
        let part = &whole.parts[0];
        if categories.len() != part.triangles.len() {
            let allowed = format!("{}, one for each triangle", part.triangles.len());
            return Err(BindingError::argument("categories", format!("{} numbers", categories.len()), allowed));
        }
        let mut kinds: Vec<u32> = categories.iter().copied().collect();
        kinds.sort_unstable();
        kinds.dedup();
        for (place, &category_id) in kinds.iter().enumerate() {
            let mine = part.triangles.iter().zip(categories.iter()).filter(|(_, kind)| **kind == category_id);
            let triangles: Vec<[u32; 3]> = mine.map(|(triangle, _)| *triangle).collect();
            let part = part.clone().triangles(triangles.into());
            let name = names.get(&category_id).cloned().unwrap_or_else(|| format!("{name} {category_id}"));
            let mesh = Arc::new(Mesh::new(name.clone(), vec![part])?);
            let object = Object::new(name, mesh);
            let object =
                object.category_id(category_id).instance_id(place as u32 + 1).world_from_object(world_from_object);
            scene.objects.push(object);
        }
        let middles = vec![middle; scene.objects.len()];
        Ok(Scene::numbered(scene, middles))
    }

    /// A scene of objects, a dict for each: `vertices` and `triangles` as for `from_arrays`; `name`; `pose`, a Pose, x,
    /// y, z, or a 4 x 4 matrix (world from object); `category`, a name, or a number that `names` may name; `instance`,
    /// a number from 1, by default its own; `material`, as for `from_arrays`. Only vertices and triangles are required,
    /// KeyError without them; ArgumentError for other keys. Objects with the same two arrays and the same material
    /// share a mesh.
    ///
    /// >>> square = np.array([[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2]], dtype=np.float32)
    /// >>> mesh = {"vertices": square, "triangles": np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)}
    /// >>> signs = [{**mesh, "name": f"sign {x}", "pose": (x, 0, 0), "category": "sign"} for x in (4, 8)]
    /// >>> scene = ec.Scene.from_objects(signs)
    /// >>> scene.objects, scene.categories
    /// (['sign 4', 'sign 8'], {1: 'sign'})
    #[staticmethod]
    #[pyo3(signature = (objects, *, names = None))]
    fn from_objects(
        #[pyo3(from_py_with = argument::objects)] objects: ObjectDicts<'_>,
        #[pyo3(from_py_with = argument::names)] names: Option<BTreeMap<u32, String>>,
    ) -> BindingResult<Scene> {
        let objects = objects.0.iter().enumerate().map(|(place, keys)| ObjectKeys::of(place, keys));
        let objects = objects.collect::<BindingResult<Vec<_>>>()?;
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
        let (mut meshes, mut middles) = (MeshCache::new(), Vec::new());
        for (number, keys) in objects.into_iter().enumerate() {
            let material = keys.material.as_ref().map(Matter::of).transpose()?;
            let given = (ArgumentIdentity::of(&keys.vertices)?, ArgumentIdentity::of(&keys.triangles)?, material);
            let (made, middle) = match meshes.entry(given) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    let vertices = VertexArray::of(&keys.vertices)?;
                    let middle = vertices.middle(DVec3::ZERO);
                    let made = mesh(&keys.name, vertices.about(middle), &keys.triangles, new.key().2.as_ref())?;
                    new.insert((made, middle))
                }
            };
            let mut object = Object::new(keys.name.as_str(), made.clone());
            object.instance_id = keys.instance.unwrap_or(number as u32 + 1);
            object.category_id = match keys.category {
                Some(Category::Number(number)) => number,
                Some(Category::Name(name)) => scene.labels.category.id(&name),
                None => 0,
            };
            let placed = keys.pose.as_ref().map_or(Ok(DAffine3::IDENTITY), transform)?;
            object.world_from_object = placed * DAffine3::from_translation(*middle);
            scene.objects.push(object);
            middles.push(*middle);
        }
        Ok(Scene::numbered(scene, middles))
    }

    /// A scene made from a trimesh.Trimesh or trimesh.Scene, an Open3D TriangleMesh, or a list of them.
    ///
    /// `up`: "z", "-z", "y", "-y", "x" or "-x", which of its axes points up; by default "z". `scale`: metres per unit,
    /// above 0; by default 1. `category`: that of meshes without a "category" in their metadata; by default their name
    /// without the number at its end. ArgumentError for anything but meshes.
    ///
    /// >>> import types
    /// >>> wall = types.SimpleNamespace(vertices=[[3, -1, 0], [3, 1, 0], [3, 0, 2]], faces=[[0, 1, 2]])
    /// >>> ec.Scene.from_mesh(wall, category="wall").categories  # anything with vertices and faces
    /// {1: 'wall'}
    #[staticmethod]
    #[pyo3(signature = (mesh, **options))]
    fn from_mesh<'py>(mesh: &Bound<'py, PyAny>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        mesh.py().import("echocast._meshes")?.getattr("scene")?.call((mesh,), options)
    }

    /// Generates a scene, always the same for the same arguments: "street", "landscape", "indoor" or "seabed".
    ///
    /// `seed`: 0 to 2^64 - 1. `path`: a .glb file to save it to. `options`: keys of `scene.generate` of a scenario,
    /// such as `blocks=[3, 2]` for a street and `rooms=[1, 1]` for a flat; FormatError for unknown ones, with the
    /// nearest.
    ///
    /// >>> flat = ec.Scene.generate("indoor", seed=3, rooms=[2, 1], path="flat.glb")
    /// >>> sorted(flat.cameras)
    /// ['Camera_1', 'Camera_2', 'Scanner']
    /// >>> ec.Scene.load("flat.glb").triangles == flat.triangles
    /// True
    #[staticmethod]
    #[pyo3(signature = (kind, *, seed = 0, path = None, **options))]
    fn generate(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::kind)] kind: &str,
        #[pyo3(from_py_with = argument::seed)] seed: u64,
        #[pyo3(from_py_with = argument::path)] path: Option<PathBuf>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<Scene> {
        let keys = PyDict::new(py);
        keys.set_item(kind, options.cloned().unwrap_or_else(|| PyDict::new(py)))?;
        keys.set_item("seed", seed)?;
        let generator = Generate::from_yaml(&options_text(&keys)?)?;
        let scene = py.detach(|| {
            let made = generator.scene(Path::new(""))?;
            if let Some(path) = path {
                made.write(path)?;
            }
            made.load(&LoadOptions::default())
        })?;
        Ok(Scene::of(scene))
    }

    /// Scans the scene with `sensor`, a Sensor or what `Sensor` takes, and returns a cloud; for a sonar, the points of
    /// a ping.
    ///
    /// All other arguments are keywords; None means the default:
    ///
    /// * `at`: where the sensor is: a Pose, such as that of a camera of the scene; x, y and z, m; a 4 x 4 matrix, world
    ///   from sensor; or a Trajectory, along which it moves during the scan. Default: at 0, 0, 0, along the axes of the
    ///   world, with a UserWarning.
    /// * `fields`: columns, a list or a string with commas, of the names that `PointCloud` lists. "default" stands for
    ///   those that the sensor has by default, "all" for all, "velocity" and "flow" for three each. Default: "default".
    /// * `seed`: of all random draws, 0 to 2^64 - 1. Default: 0.
    /// * `frame`: number of the scan, 0 to 2^32 - 1; each has its own random numbers. Default: 0.
    /// * `strip`: number of the flight line or station, 0 to 65535; 0: none. Default: 0.
    /// * `start_time`: when it starts, s since the start of the run; patterns that do not repeat continue with it.
    ///   Default: 0.
    /// * `trajectory_time`: time of the trajectory at which it starts, s. Default: `start_time`.
    /// * `estimated_trajectory`: Trajectory with which points in the world are placed, as processing would; `true_x`, `true_y`
    ///   and `true_z` stay the truth; for LiDARs and depth cameras. Default: that of `at`.
    /// * `clock_offset`: by how much pulses are stamped late, s: the column `time`, and where `estimated_trajectory` is
    ///   looked up. Default: 0.
    /// * `freeze`: True freezes the scene during the scan, as it is at the start. Default: False.
    /// * `frame_period`: s, above 0, up to 1e9: time from frame to frame, over which scene flow is measured; for
    ///   `pings`, from ping to ping. Default: the sensor's period.
    /// * `organised`: True keeps beams without a return, with NaN and 0, so that each beam has its point: for sensors
    ///   with one return per beam, in the order "beam". Default: False.
    /// * `coordinates`: axes of positions, normals and boxes, "world" or "sensor". Default: "world".
    /// * `order`: of points, "beam" or "time". Default: "beam".
    /// * `deskew`: True brings points to one time, the start of the scan: moving objects are where they were then, and
    ///   the axes "sensor" are the sensor's at that time. The columns `time` and `true_x`, `true_y`, `true_z` stay as
    ///   they are. Not for sonars. Default: False.
    /// * `boxes`: boxes around labelled instances, for which beams are traced once more: True or "object", along the
    ///   axes of each object; "frame", along those of the cloud. Default: False.
    /// * `box_time`: time for which boxes are valid: "scan", for each the mean time of its points, which with `deskew`
    ///   is the start; "start" or "end" of the scan. Default: "scan".
    /// * `image_boxes`: True adds the extent of the whole object in the sensor's image to boxes and annotations.
    ///   Default: False.
    /// * `profile`: "physical"; "paper", equations as printed in the paper; "blainder", as computed by the paper's
    ///   program. Default: "physical".
    /// * `reflectance_source`: source of the reflectance that a material does not give: "library", "luminance" or
    ///   "alpha". Default: "library"; for the profiles "paper" and "blainder", "luminance" and "alpha".
    /// * `mask`: 32 bits; objects whose own mask, by default all bits, shares one with it are seen. Default: all bits.
    /// * `specular_depth`: most mirrors and faces of glass along a path of light, 0 to 255. Default: 10.
    /// * `time_budget`: wall-clock time that the scan may take, s, above 0, up to 1e9: beams of as many rays as it takes
    ///   ("adaptive") get no more than fit into it, at least one; `most_rays` of the cloud is how many. Default: no
    ///   limit.
    /// * `environment`: an Environment, or what `Environment` takes. Default: clear air, for sonars water.
    /// * `progress`: called with the fraction that is done, 0 to 1; if it returns False the scan ends with a
    ///   CancelledError. True shows a bar in terminals and notebooks. Default: None.
    ///
    /// ArgumentError for values that are not allowed, TypeError for wrong types and unknown keywords. A cloud without
    /// points causes a UserWarning with possible reasons. Ctrl-C ends the scan.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> options = {"at": room.camera("Scanner"), "organised": True, "fields": "default,normal_z"}
    /// >>> cloud = room.scan("velodyne_vlp16", seed=7, environment={"fog": {"visibility_m": 50}}, **options)
    /// >>> cloud.organised[0], "normal_z" in cloud.fields
    /// (16, True)
    #[pyo3(signature = (sensor, **options))]
    fn scan(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<PointCloud> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras())?;
        scan(py, &self.built(py)?, &request, || self.scene.bounds())
    }

    /// Explains what happens to beam `beam` of a scan, step by step with numbers: where it goes, what it hits, what
    /// returns, and which part of that is detected and reported. The column `beam` of a cloud has the number. Keywords
    /// as for `scan`.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> print(room.explain("velodyne_vlp16", 0, at=room.camera("Scanner")).splitlines()[0])
    /// beam 0: row 0, column 0, channel 0, ring 0, fired 0.000000000 s after the start
    #[pyo3(signature = (sensor, beam, **options))]
    fn explain(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        #[pyo3(from_py_with = argument::beam)] beam: u32,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<String> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras())?;
        let built = self.built(py)?;
        Ok(py.detach(|| built.explain(&request.sensor, &request.path, &request.options, beam))?)
    }

    /// A ping of a sonar: levels in range bins for each beam. Keywords as for `Scene.scan`; ArgumentError for a sensor
    /// that is not a sonar.
    ///
    /// >>> lake = ec.Scene.generate("seabed", seed=3)
    /// >>> ping = lake.ping("sbes_200", at=lake.camera("Sonar"))
    /// >>> ping.levels.shape == (1, len(ping.ranges))
    /// True
    #[pyo3(signature = (sensor, **options))]
    fn ping(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<Ping> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras())?;
        ping(py, &self.built(py)?, &request)
    }

    /// `count` pings of a sonar, in order along its trajectory. Keywords as for `Scene.scan`; `frame` and `start_time`
    /// are those of the first, `progress` is called after each. ArgumentError for more pings than the memory of the
    /// machine holds.
    ///
    /// >>> lake = ec.Scene.generate("seabed", seed=3)
    /// >>> survey = ec.Trajectory([0.0, 10.0], np.array([[-15.0, 0, -2], [5, 0, -2]]))
    /// >>> pings = lake.pings("sbes_200", 3, at=survey)
    /// >>> len(pings), pings[2].time == 2 * ec.Sensor("sbes_200").period
    /// (3, True)
    #[pyo3(signature = (sensor, count, **options))]
    fn pings(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        #[pyo3(from_py_with = argument::count)] count: u32,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<Pings> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras())?;
        pings(py, &self.built(py)?, &request, count)
    }

    /// A frame of a radar: the cube with `cube`, what the converters sampled with `samples`, from which the cube is then
    /// made, and the detections. Of a rotating radar, a turn: the polar image. Other keywords as for `Scene.scan`, without
    /// boxes; ArgumentError for a sensor that is not a radar.
    ///
    /// >>> street = ec.Scene.generate("street", seed=3)
    /// >>> frame = street.radar_frame("ti_awr1843", at=(0, 0, 0.5), seed=7)
    /// >>> bool((np.diff(frame.velocity) > 0).all()), frame.samples is None
    /// (True, True)
    #[pyo3(signature = (sensor, *, cube = true, samples = false, **options))]
    fn radar_frame(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
        #[pyo3(from_py_with = argument::cube)] cube: bool,
        #[pyo3(from_py_with = argument::samples)] samples: bool,
        options: Option<&Bound<'_, PyDict>>,
    ) -> BindingResult<RadarFrame> {
        let request = ScanRequest::of(py, sensor, options, || self.cameras())?;
        radar_frame(py, &self.built(py)?, &request, RadarRecord { cube, samples })
    }

    /// End of the last motion of the scene itself, s; 0 if nothing moves. `LiveScene.set_time` plays it.
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

    /// The pose of a sensor at the camera node called `name`; ArgumentError if there is none, with the nearest names.
    fn camera(&self, #[pyo3(from_py_with = argument::name)] name: &str) -> BindingResult<crate::place::Pose> {
        Ok(crate::place::Pose(self.scene.camera(name)?.pose))
    }

    /// Number of triangles.
    #[getter]
    fn triangles(&self) -> usize {
        self.scene.triangle_count()
    }

    /// Lowest and highest x, y, z, m; None if it is empty.
    #[getter]
    fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        self.scene.bounds().map(|(low, high)| (low.to_array(), high.to_array()))
    }

    /// Warnings of the reader of its files, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scene.report.warnings.clone()
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle(
            "a Scene",
            "let each process load its file, or make the scene from its arrays; a Scenario can, as it only names files",
        )
    }

    fn __repr__(&self) -> String {
        format!("<Scene: {} objects, {} triangles>", self.scene.objects.len(), self.scene.triangle_count())
    }
}

/// Scans `built` as requested; warns if there are no points. `bounds` are those of the scene.
pub fn scan(
    py: Python<'_>,
    built: &BuiltScene,
    request: &ScanRequest,
    bounds: impl FnOnce() -> Option<(DVec3, DVec3)>,
) -> BindingResult<PointCloud> {
    let ScanRequest { sensor, path, options, .. } = request;
    let cloud = request.run(py, |progress| {
        let mut cloud = echocast::PointCloud::default();
        built.scan_with_progress(sensor, path, options, &mut cloud, progress)?;
        Ok(cloud)
    })?;
    if cloud.return_rows().next().is_none() {
        let start = cloud.sensor_pose.position;
        warn(py, &why_nothing(bounds(), sensor, start, &options.environment))?;
    }
    Ok(PointCloud::of(cloud))
}
