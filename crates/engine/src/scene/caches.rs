//! Files that change the shapes of objects: vertex caches and numbered scene files.
//!
//! Their coordinates are those that the scene file has for the mesh: in glTF the mesh's own, y up; in OBJ, PLY and STL
//! the file's, to which [`LoadOptions::up`] and [`LoadOptions::scale`] apply as they do to the scene file. From
//! Blender, PC2 with its default settings ("Convert to Y-up", object space) therefore fits the glTF export. The OBJ
//! export is in world coordinates: it needs PC2 with "Export into Worldspace", and with "Convert to Y-up" if the OBJ
//! file is y up; or MDD, which is always in world coordinates and z up.

use super::pattern::{best_of, matches};
use super::{LoadOptions, Scene, Sequence};
use glam::{DAffine3, DVec3};
use ground::array::Array;
use ground::builder;
use ground::error::{Error, Result};
use ground::shown;
use model::motion::{Cache, Deformation, Motion, Node, Rest, SHORTEST_ROUND_S};
use model::{Mesh, Part};
use scene_files::FORMATS;
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum number of vertices; those that parts share exist once for each part when the object is traced.
const MOST_VERTICES: usize = 200_000_000;

builder! {
    /// The file that describes how the shape of an object changes over time.
    #[derive(Clone, Debug, PartialEq, Serialize)]
    pub struct CacheFile {
        /// A vertex cache (`.mdd`, `.pc2`), or the first of numbered scene files (`water_0001.obj`), each a shape of
        /// its own.
        pub file: PathBuf,
        /// Frames per second of PC2 and of numbered files; defaults to 24. MDD files hold seconds.
        pub fps: Option<f64>,
    }
}

impl CacheFile {
    /// `file`, at its own frame rate.
    pub fn new(file: impl Into<PathBuf>) -> CacheFile {
        CacheFile { file: file.into(), fps: None }
    }
}

impl<'de> Deserialize<'de> for CacheFile {
    /// A file name, or a section of keys.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct CacheKeys {
            file: PathBuf,
            fps: Option<f64>,
        }
        struct NameOrKeys;

        impl<'de> Visitor<'de> for NameOrKeys {
            type Value = CacheFile;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a file name or a section of keys")
            }
            fn visit_str<E: de::Error>(self, file: &str) -> Result<CacheFile, E> {
                Ok(CacheFile { file: file.into(), fps: None })
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CacheFile, A::Error> {
                let CacheKeys { file, fps } = CacheKeys::deserialize(MapAccessDeserializer::new(map))?;
                Ok(CacheFile { file, fps })
            }
        }
        deserializer.deserialize_any(NameOrKeys)
    }
}

impl LoadOptions {
    /// The caches of these options and of the label file, by pattern; those of the options win.
    pub(super) fn all_caches(&self) -> impl Iterator<Item = (&str, &CacheFile)> {
        let labels = self.labels.caches.iter().filter(|(pattern, _)| !self.caches.contains_key(*pattern));
        self.caches.iter().chain(labels).map(|(pattern, cache)| (pattern.as_str(), cache))
    }
}

/// A mesh that is bound to a file; objects that share a mesh and a file share this.
struct Bound {
    /// The mesh before; it is kept so that its address is not reused.
    _from: Arc<Mesh>,
    /// The mesh at time 0.
    mesh: Arc<Mesh>,
    changes: ShapeChange,
}

enum ShapeChange {
    Shape(Arc<Deformation>),
    Sequence(Arc<Sequence>),
}

impl Scene {
    /// This scene with the caches of `options` bound to its objects.
    ///
    /// # Errors
    /// A pattern that no object's name matches; a file that cannot be read or does not fit.
    pub(super) fn with_caches(mut self, options: &LoadOptions) -> Result<Scene> {
        let caches: BTreeMap<&str, &CacheFile> = options.all_caches().collect();
        for pattern in caches.keys() {
            let names = || self.objects.iter().map(|object| object.name.as_str());
            if !names().any(|name| matches(pattern, name)) {
                return Err(Error::missing("object", pattern, names()));
            }
        }
        if caches.is_empty() {
            return Ok(self);
        }
        let mut bound: HashMap<(&str, *const Mesh), Bound> = HashMap::new();
        let timeline = Arc::make_mut(&mut self.timeline);
        for object in &mut self.objects {
            let Some((pattern, cache)) =
                best_of(caches.iter().map(|(pattern, cache)| (*pattern, *cache)), &object.name)
            else {
                continue;
            };
            let key = (pattern, Arc::as_ptr(&object.mesh));
            let Bound { mesh, changes, .. } = match bound.entry(key) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => new.insert(bind(pattern, cache, &object.name, &object.mesh, options)?),
            };
            object.mesh = mesh.clone();
            if object.motion.as_mut().is_some_and(|motion| motion.shape.take().is_some()) {
                let file = shown::path(&cache.file);
                let warning = format!("{file}: object {:?}: its skin and morph targets are not used", object.name);
                self.report.warn(warning);
            }
            match changes {
                ShapeChange::Sequence(sequence) => {
                    object.sequence = Some(sequence.clone());
                    object.part_ids.truncate(1);
                }
                ShapeChange::Shape(shape) => {
                    let motion = object.motion.get_or_insert_with(|| {
                        let rest = Rest::Whole(object.world_from_object);
                        timeline.nodes.push(Node { rest, ..Node::default() });
                        let node = timeline.nodes.len() - 1;
                        Motion { node, node_from_object: DAffine3::IDENTITY, shape: None }
                    });
                    motion.shape = Some(shape.clone());
                }
            }
        }
        self.check_reach(Path::new("caches"))?;
        Ok(self)
    }
}

/// Opens `cache` for `mesh`, that of the object `name`.
fn bind(pattern: &str, cache: &CacheFile, name: &str, mesh: &Arc<Mesh>, options: &LoadOptions) -> Result<Bound> {
    let CacheFile { file, fps } = cache;
    if let Some(fps) = fps.filter(|fps| !(*fps > 0.0 && fps.is_finite())) {
        return Err(Error::invalid(format!("caches.{pattern}.fps"), fps, "numbers above 0"));
    }
    let from = mesh.clone();
    let is_cache =
        file.extension().is_some_and(|ending| ["mdd", "pc2"].iter().any(|known| ending.eq_ignore_ascii_case(known)));
    if is_cache {
        let fault = |message: String| Error::parse(file, format!("object {name:?}"), message);
        let cache = Cache::open(file, *fps)?;
        let order = order(&cache, mesh).map_err(fault)?;
        let origin = mesh.source.as_ref().map_or(DVec3::ZERO, |source| source.origin);
        let mut cache = cache.placed(order, origin);
        let last = cache.times.last().copied().filter(|&last| options.looped && last > 0.0);
        if let Some(short) = last.filter(|&last| last < SHORTEST_ROUND_S) {
            let message = format!("it ends after {short} s; allowed to be repeated: {SHORTEST_ROUND_S} s and more");
            return Err(Error::parse(file, "", message));
        }
        cache.period = last;
        let mut positions = Vec::new();
        cache.at(0.0, &mut positions)?;
        let mesh = shared(mesh, positions.into()).map_err(fault)?;
        let shape = Deformation::baked(mesh.parts.len(), &mesh.parts[0].positions, cache);
        return Ok(Bound { _from: from, mesh: Arc::new(mesh), changes: ShapeChange::Shape(Arc::new(shape)) });
    }
    if !FORMATS.iter().any(|format| format.reads(file)) {
        let allowed = format!("caches in .mdd and .pc2, and in numbered scene files, {}", scene_files::extensions());
        return Err(Error::invalid(format!("caches.{pattern}"), shown::path(file), allowed));
    }
    let sequence = Sequence::open(file, *fps, mesh, options)?;
    let mesh = sequence.load(0)?;
    Ok(Bound { _from: from, mesh, changes: ShapeChange::Sequence(Arc::new(sequence)) })
}

/// Which vertex of `cache` each vertex of `mesh` is, part after part, with vertices that parts share once; `None`: the
/// order is the same.
fn order(cache: &Cache, mesh: &Mesh) -> Result<Option<Vec<u32>>, String> {
    let vertices = cache.vertices();
    let fault = |found: usize, more: &str| {
        Err(format!("the file has {vertices} vertices, the object {found}{more}; allowed: the same number"))
    };
    let Some(source) = &mesh.source else {
        let found = starts(mesh).1;
        if found == vertices {
            return Ok(None);
        }
        return fault(
            found,
            " (glTF exporters split vertices at seams: bake from the imported mesh, or use OBJ for the scene)",
        );
    };
    let used = || source.vertices.iter().flatten().copied();
    let first = used().min().unwrap_or(0);
    let own = (used().max().unwrap_or(0) - first) as usize + 1;
    let first = match vertices {
        _ if vertices == own => first,
        _ if vertices == source.count => 0,
        _ if own == source.count => return fault(own, ""),
        _ => return fault(own, &format!(" (its file {})", source.count)),
    };
    Ok(Some(used().map(|vertex| vertex - first).collect()))
}

/// Where the vertices of each part begin when those of all parts are one list, with those that parts share once; and
/// the length of the list.
fn starts(mesh: &Mesh) -> (Vec<usize>, usize) {
    let (mut known, mut length) = (HashMap::new(), 0);
    let starts = mesh.parts.iter().map(|part| {
        let vertices = part.positions.len();
        *known.entry((part.positions.as_ptr(), vertices)).or_insert_with(|| {
            length += vertices;
            length - vertices
        })
    });
    (starts.collect(), length)
}

/// `mesh` with all `positions` in one list that its parts share, flat-shaded: normals differ from shape to shape.
fn shared(mesh: &Mesh, positions: Array<[f32; 3]>) -> Result<Mesh, String> {
    let (starts, vertices) = starts(mesh);
    let most = MOST_VERTICES / mesh.parts.len();
    if vertices > most {
        let parts = mesh.parts.len();
        return Err(format!("it has {vertices} vertices in {parts} parts; allowed: {most} with so many parts"));
    }
    fn spread<T: Copy + Default + Send + Sync + 'static>(own: &Array<T>, start: usize, vertices: usize) -> Array<T> {
        if own.len() == vertices {
            return own.clone();
        }
        let mut all = vec![T::default(); vertices];
        all[start..][..own.len()].copy_from_slice(own);
        all.into()
    }
    let parts = mesh.parts.iter().zip(&starts).map(|(part, &start)| {
        let triangles = match start as u32 {
            0 => part.triangles.clone(),
            start => {
                part.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + start)).collect::<Vec<_>>().into()
            }
        };
        Part::default()
            .positions(positions.clone())
            .uvs(part.uvs.as_ref().map(|own| spread(own, start, vertices)))
            .alphas(part.alphas.as_ref().map(|own| spread(own, start, vertices)))
            .triangles(triangles)
            .material(part.material.clone())
    });
    let mesh = Mesh::new(mesh.name.clone(), parts.collect()).map_err(|error| error.to_string())?;
    Ok(mesh.changing())
}

#[cfg(test)]
mod tests {
    use super::*;
    use model::motion::Timeline;
    use std::fs;

    /// The bytes of a PC2 file that starts at frame 0, with one frame between samples.
    fn pc2(samples: &[&[[f32; 3]]]) -> Vec<u8> {
        let mut bytes = b"POINTCACHE2\0".to_vec();
        bytes.extend([1, samples[0].len() as i32].map(i32::to_le_bytes).as_flattened());
        bytes.extend([0.0f32, 1.0].map(f32::to_le_bytes).as_flattened());
        bytes.extend((samples.len() as i32).to_le_bytes());
        bytes.extend(samples.iter().copied().flatten().flatten().flat_map(|number| number.to_le_bytes()));
        bytes
    }

    struct Folder(tempfile::TempDir);

    impl Folder {
        fn new() -> Folder {
            Folder(tempfile::tempdir().unwrap())
        }

        fn path(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
            fs::write(self.path(name), bytes).unwrap();
            self.path(name)
        }

        /// Options with `caches`.
        fn options(&self, caches: &[(&str, &str)]) -> LoadOptions {
            let caches =
                caches.iter().map(|(name, file)| (name.to_string(), CacheFile { file: self.path(file), fps: None }));
            LoadOptions { caches: caches.collect(), ..LoadOptions::default() }
        }

        fn load(&self, scene: &str, caches: &[(&str, &str)]) -> Result<Scene> {
            Scene::load_with(self.path(scene), &self.options(caches))
        }

        #[track_caller]
        fn error(&self, scene: &str, caches: &[(&str, &str)]) -> String {
            self.plain(self.load(scene, caches).unwrap_err())
        }

        fn plain(&self, error: Error) -> String {
            error.to_string().replace(&format!("{}/", self.0.path().display()), "")
        }
    }

    /// World positions of the corners of every triangle of an object with the shape given by `positions`.
    fn world(timeline: &Timeline, object: &super::super::Object, positions: &[[f32; 3]], time: f64) -> Vec<[DVec3; 3]> {
        let motion = object.motion.as_ref().unwrap();
        let place = timeline.world_from_node(motion.node, time) * motion.node_from_object;
        let corner = |vertex: u32| place.transform_point3(DVec3::from(positions[vertex as usize].map(f64::from)));
        object.mesh.parts.iter().flat_map(|part| part.triangles.iter().map(|t| t.map(corner))).collect()
    }

    fn shape(scene: &Scene, object: usize) -> &Arc<Deformation> {
        scene.objects[object].motion.as_ref().unwrap().shape.as_ref().unwrap()
    }

    fn cached(scene: &Scene, object: usize, time: f64) -> Vec<[DVec3; 3]> {
        let mut positions = Vec::new();
        shape(scene, object).cache.as_ref().unwrap().at(time, &mut positions).unwrap();
        world(&scene.timeline, &scene.objects[object], &positions, time)
    }

    /// Two objects far from the origin; the second has a seam, vertices in another order than faces use them, and two
    /// materials.
    const OBJ: &str = "o Post\nv 1000 0 0\nv 1001 0 0\nv 1000 0 9\nf 1 2 3\n\
        o Flag\nv 1000 10 5\nv 1002 10 5\nv 1002 10 6\nv 1000 10 6\nv 1000 10 9\nvt 0 0\nvt 1 1\n\
        usemtl red\nf 7/1 5/1 4/2\nusemtl blue\nf 4/1 7/2 6/2\nf 8 7 6\n";

    #[test]
    fn caches_repeat_if_requested() {
        let folder = Folder::new();
        folder.write("yard.obj", OBJ);
        let [low, high] = [0.0, 4.0].map(|z| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z + 1.0]]);
        folder.write("post.pc2", pc2(&[&low, &high]));
        for number in 1..=3 {
            folder.write(&format!("w{number}.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
        }
        let load = |fps| {
            let mut options =
                LoadOptions { looped: true, ..folder.options(&[("Post", "post.pc2"), ("Flag", "w1.obj")]) };
            options.caches.values_mut().for_each(|cache| cache.fps = Some(fps));
            Scene::load_with(folder.path("yard.obj"), &options)
        };
        let scene = load(2.0).unwrap();
        assert_eq!([0.25, 0.75, 7.75].map(|time| cached(&scene, 0, time)[0][0].z), [2.0; 3]);
        let sequence = scene.objects[1].sequence.as_ref().unwrap();
        assert_eq!([0.0, 1.4, 1.5, 2.0, 7.0, -0.5].map(|time| sequence.at(time)), [0, 2, 0, 1, 2, 2]);
        assert_eq!(
            folder.plain(load(1e4).unwrap_err()),
            "post.pc2: it ends after 0.0001 s; allowed to be repeated: 0.001 s and more"
        );
    }

    #[test]
    fn obj_vertices_are_found_again_whatever_their_order() {
        let folder = Folder::new();
        folder.write("yard.obj", OBJ);
        let rest: Vec<[f32; 3]> = vec![
            [1000.0, 10.0, 5.0],
            [1002.0, 10.0, 5.0],
            [1002.0, 10.0, 6.0],
            [1000.0, 10.0, 6.0],
            [1000.0, 10.0, 9.0],
        ];
        let moved: Vec<[f32; 3]> = rest.iter().map(|[x, y, z]| [x + z, *y + 24.0, -z]).collect();
        folder.write("flag.pc2", pc2(&[&rest, &moved]));
        let plain = folder.load("yard.obj", &[]).unwrap();
        for (up, scale) in [(super::super::UpAxis::Z, 1.0), (super::super::UpAxis::Y, 0.25)] {
            let options = |caches: &[(&str, &str)]| LoadOptions { up, scale, ..folder.options(caches) };
            let plain = Scene::load_with(folder.path("yard.obj"), &options(&[])).unwrap();
            let scene = Scene::load_with(folder.path("yard.obj"), &options(&[("F*g", "flag.pc2")])).unwrap();
            assert!(scene.objects[0].motion.is_none() && scene.objects[0].sequence.is_none());
            assert_eq!(scene.triangle_count(), plain.triangle_count());
            let before: Vec<[DVec3; 3]> = plain.objects[1]
                .mesh
                .parts
                .iter()
                .flat_map(|part| {
                    let place = plain.objects[1].world_from_object;
                    part.triangles.iter().map(move |t| {
                        t.map(|v| place.transform_point3(DVec3::from(part.positions[v as usize].map(f64::from))))
                    })
                })
                .collect();
            let world = |p: DVec3| if up == super::super::UpAxis::Y { DVec3::new(p.x, -p.z, p.y) } else { p };
            let file = |p: DVec3| if up == super::super::UpAxis::Y { DVec3::new(p.x, p.z, -p.y) } else { p };
            assert_eq!(cached(&scene, 1, 0.0), before);
            for (now, before) in cached(&scene, 1, 1.0 / 24.0).iter().flatten().zip(before.iter().flatten()) {
                let p = file(*before / scale);
                let target_value = world(DVec3::new(p.x + p.z, p.y + 24.0, -p.z)) * scale;
                assert!(now.distance(target_value) < 1e-4, "{now} {target_value}");
            }
        }
        // Its two parts share their vertices, and seams keep their texture coordinates.
        let mesh = &folder.load("yard.obj", &[("Flag", "flag.pc2")]).unwrap().objects[1].mesh;
        assert!(mesh.structure.changing && mesh.parts.len() == 2);
        assert!(mesh.parts[0].positions.is(&mesh.parts[1].positions) && mesh.parts[0].normals.is_none());
        assert!(plain.objects[1].mesh.source.is_none(), "sources are kept only if requested");
        // A cache may also hold all vertices of the file.
        let all: Vec<[f32; 3]> = (0..8).map(|k| [k as f32, 0.0, (k * k) as f32]).collect();
        folder.write("all.pc2", pc2(&[&all]));
        let scene = folder.load("yard.obj", &[("Flag", "all.pc2"), ("Post", "all.pc2")]).unwrap();
        let corners = [cached(&scene, 0, 0.0)[0], cached(&scene, 1, 0.0)[0]].map(|t| t.map(|p| p.x));
        assert_eq!(corners, [[0.0, 1.0, 2.0], [6.0, 4.0, 3.0]]);
        assert_eq!((scene.timeline.nodes.len(), scene.timeline.is_still()), (2, true));
    }

    #[test]
    fn texture_coordinates_stay_with_their_vertices() {
        let mut image = Vec::new();
        png::Encoder::new(&mut image, 1, 1).write_header().unwrap().write_image_data(&[9]).unwrap();
        let folder = Folder::new();
        folder.write("p.png", image);
        folder.write("m.mtl", "newmtl plain\nnewmtl red\nmap_Kd p.png\n");
        folder.write(
            "a.obj",
            "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0.5\n\
             usemtl plain\nf 1/2 2/2 3/2\nusemtl red\nf 4/1 3/2 2/1\n",
        );
        folder.write("a.pc2", pc2(&[&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]]));
        let [plain, scene] = [&[][..], &[("a", "a.pc2")]].map(|caches| folder.load("a.obj", caches).unwrap());
        let corners = |scene: &Scene| {
            let part = &scene.objects[0].mesh.parts[1];
            part.triangles.iter().flatten().map(|&v| part.uvs.as_ref().unwrap()[v as usize]).collect::<Vec<_>>()
        };
        assert_eq!(corners(&scene), corners(&plain));
        assert!(scene.objects[0].mesh.parts[0].uvs.is_none());
        scene.build().unwrap();
    }

    /// A file whose node `Flag` has a mesh of two primitives, three and four vertices, and is translated and rotated;
    /// another node has the same mesh.
    fn glb() -> Vec<u8> {
        let positions: [[f32; 3]; 7] = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 2.0, 0.0],
            [1.0, 2.0, 0.0],
            [0.0, 3.0, 0.0],
            [1.0, 3.0, 0.0],
        ];
        let indices: [u32; 6] = [0, 1, 2, 1, 3, 2];
        let bin: Vec<u8> = bytemuck::cast_slice(positions.as_flattened())
            .iter()
            .chain(bytemuck::cast_slice::<u32, u8>(&indices))
            .copied()
            .collect();
        let json = serde_json::json!({
            "asset": {"version": "2.0"},
            "nodes": [
                {"name": "Flag", "mesh": 0, "translation": [5, 0, 0], "rotation": [0, 0.5f32.sqrt(), 0, 0.5f32.sqrt()]},
                {"name": "Flag.001", "mesh": 0},
            ],
            "meshes": [{"name": "Cloth", "primitives": [
                {"attributes": {"POSITION": 0}},
                {"attributes": {"POSITION": 1}, "indices": 2},
            ]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
                {"bufferView": 0, "byteOffset": 36, "componentType": 5126, "type": "VEC3", "count": 4},
                {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 6},
            ],
            "bufferViews": [
                {"buffer": 0, "byteLength": 84}, {"buffer": 0, "byteOffset": 84, "byteLength": 24},
            ],
            "buffers": [{"byteLength": bin.len()}],
        });
        let mut json = json.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((28 + json.len() as u32 + bin.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &bin)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }

    #[test]
    fn gltf_objects_keep_their_place_and_the_file_its_axes() {
        let folder = Folder::new();
        folder.write("yard.glb", glb());
        let flat: Vec<[f32; 3]> = (0..7).map(|k| [k as f32, (k % 3) as f32, 7.0]).collect();
        let high: Vec<[f32; 3]> = flat.iter().map(|[x, y, z]| [*x, y + 2.0, *z]).collect();
        folder.write("flag.pc2", pc2(&[&flat, &high]));
        let scene = folder.load("yard.glb", &[("Flag", "flag.pc2")]).unwrap();
        assert!(scene.objects[1].motion.is_none());
        assert_eq!(scene.objects[1].mesh.parts[0].positions[1], [1.0, 0.0, 0.0]);
        // A quarter turn about y takes (x, y, z) to (z, y, -x); then 5 along x, then z up.
        let place = |[x, y, z]: [f32; 3]| DVec3::new(f64::from(z) + 5.0, f64::from(x), f64::from(y));
        for (time, target_value) in [(0.0, &flat), (2.0, &high)] {
            let corners: Vec<usize> = vec![0, 1, 2, 3, 4, 5, 4, 6, 5];
            for (found, vertex) in cached(&scene, 0, time).into_iter().flatten().zip(corners) {
                assert!(found.distance(place(target_value[vertex])) < 1e-6, "{time} {vertex} {found}");
            }
        }
        let (low, _) = scene.bounds().unwrap();
        assert!((low.x - 0.0).abs() < 1e-6 && scene.objects[0].mesh.parts[0].positions[6] == flat[6]);
        scene.build().unwrap();
        // Objects with the same mesh and the same file share the result.
        let scene = folder.load("yard.glb", &[("Flag*", "flag.pc2")]).unwrap();
        assert!(Arc::ptr_eq(&scene.objects[0].mesh, &scene.objects[1].mesh));
        assert!(Arc::ptr_eq(shape(&scene, 0), shape(&scene, 1)) && scene.timeline.nodes.len() == 2);
        // The longer pattern counts, and the two are separate.
        folder.write("other.pc2", pc2(&[&high]));
        let scene = folder.load("yard.glb", &[("Flag*", "flag.pc2"), ("Flag.001", "other.pc2")]).unwrap();
        assert_eq!([0, 1].map(|k| scene.objects[k].mesh.parts[0].positions[0][1]), [0.0, 2.0]);
    }

    #[test]
    fn what_moves_keeps_its_node_and_loses_its_skin() {
        let folder = Folder::new();
        folder.write("yard.glb", glb());
        let flat: Vec<[f32; 3]> = (0..7).map(|k| [k as f32, (k % 3) as f32, 7.0]).collect();
        folder.write("flag.pc2", pc2(&[&flat]));
        let mut scene = folder.load("yard.glb", &[]).unwrap();
        let timeline = Timeline { nodes: vec![Node::default(), Node::default()] };
        scene.timeline = Arc::new(timeline);
        let old =
            Deformation { vertices: Arc::default(), weights: vec![1.0], weights_track: None, skin: None, cache: None };
        let node_from_object = DAffine3::from_translation(DVec3::X);
        scene.objects[0].motion = Some(Motion { node: 1, node_from_object, shape: Some(Arc::new(old)) });
        let scene = scene.with_caches(&folder.options(&[("Flag*", "flag.pc2")])).unwrap();
        let motion = scene.objects[0].motion.as_ref().unwrap();
        assert_eq!((motion.node, motion.node_from_object), (1, node_from_object));
        assert!(motion.shape.as_ref().unwrap().cache.is_some() && motion.shape.as_ref().unwrap().weights.is_empty());
        assert_eq!(scene.timeline.nodes.len(), 3);
        let [warning] = &scene.report.warnings[..] else { panic!("{:?}", scene.report.warnings) };
        assert!(warning.ends_with("flag.pc2: object \"Flag\": its skin and morph targets are not used"), "{warning}");
    }

    #[test]
    fn mismatches_are_reported() {
        let folder = Folder::new();
        folder.write("yard.glb", glb());
        folder.write("yard.obj", OBJ);
        folder.write("six.pc2", pc2(&[&[[0.0; 3]; 6]]));
        folder.write("five.mdd", "");
        assert_eq!(
            folder.error("yard.glb", &[("Flag", "six.pc2")]),
            "six.pc2: object \"Flag\": the file has 6 vertices, the object 7 (glTF exporters split vertices at seams: \
             bake from the imported mesh, or use OBJ for the scene); allowed: the same number"
        );
        assert_eq!(
            folder.error("yard.obj", &[("Flag", "six.pc2")]),
            "six.pc2: object \"Flag\": the file has 6 vertices, the object 5 (its file 8); allowed: the same number"
        );
        assert_eq!(folder.error("yard.obj", &[("Fleg", "six.pc2")]), "there is no object named \"Fleg\"; near: Flag");
        assert!(folder.error("yard.obj", &[("Flag", "gone.pc2")]).starts_with("gone.pc2: No such file"));
        assert!(folder.error("yard.obj", &[("Flag", "five.mdd")]).starts_with("five.mdd: is 0 bytes long"));
        assert_eq!(
            folder.error("yard.obj", &[("Flag", "water_1.abc")]),
            format!(
                "caches.Flag is water_1.abc; allowed: caches in .mdd and .pc2, and in numbered scene files, {}",
                scene_files::extensions()
            )
        );
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut options = folder.options(&[("Flag", "six.pc2")]);
            options.caches.values_mut().for_each(|cache| cache.fps = Some(fps));
            let error = Scene::load_with(folder.path("yard.obj"), &options).unwrap_err().to_string();
            assert_eq!(error, format!("caches.Flag.fps is {fps}; allowed: numbers above 0"));
        }
        let far: Vec<[f32; 3]> = (0..5).map(|k| [1e18, (k * k) as f32, k as f32]).collect();
        folder.write("far.pc2", pc2(&[&far]));
        let options = LoadOptions { scale: 10.0, ..folder.options(&[("Flag", "far.pc2")]) };
        let error = Scene::load_with(folder.path("yard.obj"), &options).unwrap_err().to_string();
        assert!(error.starts_with("caches: object \"Flag\": it reaches to ["), "{error}");
    }

    #[test]
    fn numbered_files_replace_the_mesh_one_after_another() {
        let folder = Folder::new();
        folder.write("yard.obj", OBJ);
        folder.write("yard.glb", glb());
        // Two objects; the textures of their materials do not matter.
        folder.write(
            "water_0009.obj",
            "mtllib gone.mtl\nv 1000 9 0\nv 1001 9 0\nv 1000 9 2\nv 1000 8 0\nvn 0 1 1\nusemtl gone\n\
             o a\nf 1//1 2//1 3//1\no b\nf 1 2 4\nf 1 2 2\n",
        );
        folder.write("water_0010.obj", "v 1000 9 0\nv 1001 9 0\nv 1000 9 3\nf 1 2 3\n");
        folder.write("water_0011.glb", glb());
        folder.write("water_11.obj", "");
        let scene = folder.load("yard.obj", &[("Flag", "water_0009.obj")]).unwrap();
        let plain = folder.load("yard.obj", &[]).unwrap();
        let object = &scene.objects[1];
        let sequence = object.sequence.as_ref().unwrap();
        assert_eq!(sequence.times().collect::<Vec<_>>(), [0.0, 1.0 / 24.0]);
        assert!(object.motion.is_none() && object.category_id == plain.objects[1].category_id);
        assert_eq!((object.part_ids.as_slice(), object.mesh.parts.len()), (&plain.objects[1].part_ids[..1], 1));
        let part = &object.mesh.parts[0];
        assert!(part.normals.is_none() && object.mesh.structure.changing);
        assert_eq!((part.material_name(), part.triangles.len()), ("red", 2));
        let top = |mesh: &Mesh| {
            let [_, high] = mesh.bounds().unwrap();
            object.world_from_object.transform_point3(DVec3::from(high.map(f64::from)))
        };
        assert_eq!(top(&object.mesh), DVec3::new(1001.0, 9.0, 2.0));
        let later = sequence.load(sequence.at(0.05)).unwrap();
        assert_eq!((top(&later), later.name.as_str()), (DVec3::new(1001.0, 9.0, 3.0), "Flag"));
        assert!(Arc::ptr_eq(&later, &sequence.load(1).unwrap()), "it is read once");
        assert!(sequence.load(2).unwrap_err().to_string().ends_with("allowed: 0 to 1"));
        scene.build().unwrap();

        // Binary glTF: y up in the file, like the mesh that it replaces; objects are where their nodes are.
        let scene = folder.load("yard.glb", &[("Flag", "water_0011.glb")]).unwrap();
        let found = scene.objects[0].mesh.bounds().unwrap();
        for (found, target_value) in found.as_flattened().iter().zip([0.0, 0.0, -1.0, 5.0, 3.0, 0.0]) {
            assert!((found - target_value).abs() < 1e-6, "{found} {target_value}");
        }
        assert_eq!(scene.objects[0].mesh.triangle_count(), 6);
    }

    #[test]
    fn each_file_holds_until_the_next() {
        let folder = Folder::new();
        folder.write("yard.obj", OBJ);
        for number in 1..=60 {
            folder.write(&format!("w{number}.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
        }
        for fps in [24.0, 49.0, 30000.0 / 1001.0, 0.1] {
            let mut options = folder.options(&[("Flag", "w1.obj")]);
            options.caches.values_mut().for_each(|cache| cache.fps = Some(fps));
            let scene = Scene::load_with(folder.path("yard.obj"), &options).unwrap();
            let sequence = scene.objects[1].sequence.as_ref().unwrap();
            assert_eq!(sequence.times().len(), 60);
            for (index, time) in sequence.times().enumerate() {
                assert_eq!(sequence.at(time), index);
                assert_eq!(sequence.at(time.next_down()), index.saturating_sub(1));
            }
            assert_eq!([-5.0, 1e300, f64::NAN].map(|time| sequence.at(time)), [0, 59, 0]);
        }
    }

    #[test]
    fn numbered_files_have_no_gap_and_no_fault() {
        let folder = Folder::new();
        folder.write("yard.obj", OBJ);
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n";
        for name in ["w_01.obj", "w_02.obj", "w_04.obj", "w_05.obj", "water.obj", "n99999999999.obj"] {
            folder.write(name, triangle);
        }
        let error = |file| folder.error("yard.obj", &[("Flag", file)]);
        assert_eq!(
            error("w_01.obj"),
            "w_03.obj: is missing, while \"w_04.obj\" is there; allowed: numbers without a gap"
        );
        assert!(folder.load("yard.obj", &[("Flag", "w_04.obj")]).is_ok());
        assert!(error("w_03.obj").starts_with("w_03.obj: No such file"));
        assert_eq!(
            error("water.obj"),
            "water.obj: is named \"water.obj\"; allowed: a number before the ending, as in water_0001.obj"
        );
        assert!(error("n99999999999.obj").ends_with("as in water_0001.obj"));
        folder.write("e_1.obj", "v 0 0 0\n");
        assert!(error("e_1.obj").starts_with("e_1.obj: the file holds no face"));
        folder.write("g_1.glb", "glTF");
        assert!(error("g_1.glb").starts_with("g_1.glb: "));
        folder.write("d_1.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
        assert_eq!(error("d_1.obj"), "d_1.obj: no triangle to scan: the file holds no mesh with area");
        // A later file is read when its time comes.
        folder.write("l_1.obj", triangle);
        folder.write("l_2.obj", "f 1 2 3\n");
        let scene = folder.load("yard.obj", &[("Flag", "l_1.obj")]).unwrap();
        let error = scene.objects[1].sequence.as_ref().unwrap().load(1).unwrap_err();
        assert!(folder.plain(error).starts_with("l_2.obj: line 1"));
    }

    #[test]
    fn files_are_named_in_yaml() {
        let folder = Folder::new();
        folder.write("yard.obj", OBJ);
        fs::create_dir(folder.path("baked")).unwrap();
        folder.write("baked/flag.pc2", pc2(&[&[[0.0, 1.0, 0.0], [1.0; 3], [2.0; 3], [3.0; 3], [4.0; 3]]]));
        folder.write("w_1.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
        let labels = folder.write("l.yaml", "caches: {Flag: baked/flag.pc2, Post: {file: w_1.obj, fps: 25}}");
        let labels = super::super::LabelRules::load(labels).unwrap();
        assert_eq!(labels.caches["Post"], CacheFile { file: folder.path("w_1.obj"), fps: Some(25.0) });
        let options = LoadOptions { labels, ..LoadOptions::default() };
        let scene = Scene::load_with(folder.path("yard.obj"), &options).unwrap();
        assert!(scene.objects[0].sequence.is_some() && shape(&scene, 1).cache.is_some());
        // Options take precedence over the label file.
        let caches = folder.options(&[("Flag", "w_1.obj")]).caches;
        let scene = Scene::load_with(folder.path("yard.obj"), &LoadOptions { caches, ..options }).unwrap();
        assert!(scene.objects[1].sequence.is_some() && scene.objects[1].motion.is_none());

        let options = LoadOptions::from_yaml("{up: y, caches: {Flag: a.pc2, 'W*': {file: b_1.obj}}}").unwrap();
        assert_eq!(options.caches["Flag"], CacheFile { file: "a.pc2".into(), fps: None });
        let error = |text| LoadOptions::from_yaml(text).unwrap_err().to_string();
        assert_eq!(
            error("caches: {Flag: 3}"),
            "load options: line 1: caches.Flag: invalid type: integer `3`, expected a file name or a section of keys"
        );
        assert_eq!(
            error("caches: {Flag: {file: a.pc2, rate: 3}}"),
            "load options: line 1: caches.Flag.rate: unknown key \"rate\"; allowed: file, fps"
        );
        assert_eq!(error("caches: {Flag: {fps: 3}}"), "load options: line 1: caches.Flag: the key `file` is missing");
    }
}
