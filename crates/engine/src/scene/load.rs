//! A scene from its files.

use super::identity::{Identifier, Identity, InstanceKey};
use super::label::Given;
use super::pattern::{self, matches};
use super::{
    Ancestor, CacheFile, Camera, LabelRules, Labels, MaterialRules, Mesh, NameTable, Object, Part, Texture, UpAxis,
};
use glam::{DAffine3, DVec3};
use ground::builder;
use ground::error::{Error, Result};
use ground::read::yaml::{Document, one_or_more_words};
use ground::report::Report;
use ground::shown;
use model::material::Material;
use model::material::TextureBudget;
use model::motion::{Motion, Timeline};
use model::{RawObject, RawScene, corners, surrounding, within_reach};
use robots::{GeometryUse, Robot, RobotOptions};
use scene_files::{self, FileOptions, SceneFormat, gltf};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Every scene format that can be read: those of scenes, then those of robots.
pub const FORMATS: &[SceneFormat] = &{
    let (scenes, of_robots) = (scene_files::FORMATS, robots::ROBOT_FORMATS);
    let mut all = [scenes[0]; scene_files::FORMATS.len() + robots::ROBOT_FORMATS.len()];
    let mut next = 1;
    while next < all.len() {
        all[next] = if next < scenes.len() { scenes[next] } else { of_robots[next - scenes.len()] };
        next += 1;
    }
    all
};

builder! {
    /// How to read a scene file.
    #[derive(Clone, Debug, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct LoadOptions {
        /// Up axis of formats that do not specify it (OBJ, PLY, STL). glTF is always y up, and FBX files specify it.
        pub up: UpAxis = UpAxis::Z,
        /// Metres per unit of formats that do not specify it (OBJ, PLY, STL).
        pub scale: f64 = 1.0,
        /// Names to numbers and patterns to names.
        pub labels: LabelRules = LabelRules::default(),
        /// Maximum memory for the images of all materials together, MiB: four bytes per pixel.
        pub texture_limit_mib: u64 = 1024,
        /// Name of the animation to play; `None`: all of them at once.
        pub animation: Option<String> = None,
        /// Whether each animation and each cache restarts at the time of its last key or sample, numbered files after
        /// the last; if not, what they move keeps its last state. In YAML `loop`.
        #[serde(rename = "loop")]
        pub looped: bool = false,
        /// Whether buffers, images and material files may be outside the folder of the scene file that names them, or
        /// be named by absolute path. If so, an untrusted scene can pull in any file that the user may read.
        pub allow_outside_paths: bool = false,
        /// Which geometry of the links of robots (URDF, SDF, MJCF) is read.
        pub geometry: GeometryUse = GeometryUse::Visual,
        /// Positions of the joints of robots by name, radians or metres; all others are at rest.
        pub joints: BTreeMap<String, f64> = BTreeMap::new(),
        /// Folders of packages and models, in which what robots name (`package://`, `model://`, paths) may be besides
        /// their own folder.
        pub model_paths: Vec<PathBuf> = Vec::new(),
        /// Object name pattern (`*` and `?`) to the file that describes how the object's shape changes; the longest
        /// matching pattern wins. In YAML relative to the working folder, in a label file to that file's folder.
        pub caches: BTreeMap<String, CacheFile> = BTreeMap::new(),
        /// What surfaces are made of; these rules are applied after those of the label file.
        pub materials: MaterialRules = MaterialRules::default(),
        /// Patterns (`*` and `?`) of the names of objects, or of their ancestor nodes, to leave out, in addition to
        /// those of the label file.
        #[serde(deserialize_with = "one_or_more_words")]
        pub hide: Vec<String> = Vec::new(),
    }
}

impl LoadOptions {
    /// Reads options from YAML: the fields of this type, `up` as `y`, `z`, `x`, `-x`, `-y` or `-z`, and `labels`, with
    /// the contents of a label file or what [`LabelRules::open`] takes.
    ///
    /// # Errors
    /// An invalid entry, with its line, its key and the most similar known key; a label file that cannot be read.
    pub fn from_yaml(text: &str) -> Result<LoadOptions> {
        const ORIGIN: &str = "load options";
        let document = Document::parse(ORIGIN, text)?;
        let mut keys = document.value().clone();
        // A name refers to a file, which has its own errors.
        let named = keys.get("labels").and_then(|labels| labels.as_str()).map(LabelRules::open).transpose()?;
        if named.is_some() {
            keys.as_object_mut().map(|keys| keys.shift_remove("labels"));
        }
        let options: LoadOptions = document.read_at("", &keys)?;
        options.labels.check(&document, "labels")?;
        options.materials.check(&document, "materials")?;
        Ok(LoadOptions { labels: named.unwrap_or(options.labels), ..options })
    }

    /// The options for readers of files.
    pub(crate) fn of_files(&self) -> FileOptions<'_> {
        FileOptions {
            up: self.up,
            scale: self.scale,
            animation: self.animation.as_deref(),
            looped: self.looped,
            allow_outside_paths: self.allow_outside_paths,
            keeps_sources: self.all_caches().next().is_some(),
            ignores_axes: false,
        }
    }

    /// The options for readers of robots.
    pub(crate) fn of_robots(&self) -> RobotOptions {
        RobotOptions::default()
            .geometry(self.geometry)
            .model_paths(self.model_paths.clone())
            .allow_outside_paths(self.allow_outside_paths)
            .joints(self.joints.clone())
    }
}

/// A scene ready to be built; see the module's guarantees.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Scene {
    /// Objects, each placing one mesh.
    pub objects: Vec<Object>,
    /// All surface materials, whether used by a part or not.
    pub materials: Vec<Arc<Material>>,
    /// Camera nodes, places for a sensor.
    pub cameras: Vec<Camera>,
    /// Names of the label numbers.
    pub labels: Labels,
    /// All motion; objects and cameras are placed as at time 0.
    pub timeline: Arc<Timeline>,
    /// Names of the file's animations, played or not.
    pub animations: Vec<String>,
    /// Time of the last key of each animation, s.
    pub animation_lengths: Vec<f64>,
    /// Names of the joints of robots that take one position.
    pub joints: Vec<String>,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    /// For each object that rules have left out, the name that they matched.
    pub hidden: Vec<String>,
    /// Warnings of the reader.
    pub report: Report,
}

impl Scene {
    /// Reads a scene file; the format is chosen by the extension (see [`FORMATS`](super::FORMATS)).
    ///
    /// # Errors
    /// A missing or damaged file, a feature that is not supported, nothing to scan; a cache that does not fit its
    /// object. The message states file and place.
    pub fn load(path: impl AsRef<Path>) -> Result<Scene> {
        Scene::load_with(path, &LoadOptions::default())
    }

    /// [`Scene::load`] with options.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Scene> {
        Scene::load_all(&[path], options)
    }

    /// Reads several scene files as they are into one scene: one world, one numbering of the labels.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_all<P: AsRef<Path>>(paths: &[P], options: &LoadOptions) -> Result<Scene> {
        if paths.is_empty() {
            return Err(Error::invalid("scene files", "none", "at least one"));
        }
        let mut images = TextureBudget::new(options.texture_limit_mib);
        let scenes: Vec<Scene> =
            paths.iter().map(|path| Scene::read(path.as_ref(), options, &mut images)).collect::<Result<_>>()?;
        Scene::merge(scenes, &options.labels).finished(options)
    }

    /// Reads the bytes of a `.glb` file, or of a `.gltf` file whose buffers and images are data URIs.
    ///
    /// # Errors
    /// As [`Scene::load`]; messages say `glTF data` instead of the path. Also a URI that refers to a file.
    pub fn from_glb_bytes(bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
        let origin = Path::new("glTF data");
        let mut images = TextureBudget::new(options.texture_limit_mib);
        let raw = gltf::read_bytes(bytes, origin, None, &options.of_files(), &mut images)?;
        Scene::assemble(raw, options).checked(origin)?.finished(options)
    }

    /// The scene of a robot, which was read from `path`, with all positions of its joints.
    pub(crate) fn of_robot(robot: &Robot, path: &Path, positions: &[f64], options: &LoadOptions) -> Result<Scene> {
        let mut images = TextureBudget::new(options.texture_limit_mib);
        let raw = robot.scene(path, positions, &options.of_robots(), &mut images)?;
        Scene::assemble(raw, options).checked(path)?.finished(options)
    }

    /// Reads one scene file by itself.
    pub(super) fn read(path: &Path, options: &LoadOptions, images: &mut TextureBudget) -> Result<Scene> {
        if !FORMATS.iter().any(|format| format.reads(path)) {
            let endings: Vec<String> =
                FORMATS.iter().flat_map(|format| format.extensions).map(|ending| format!(".{ending}")).collect();
            let (what, instead) = (shown::path(path), format!("scenes are read from {}", endings.join(", ")));
            return Err(Error::Unsupported { what: format!("{what}: scene format"), instead });
        }
        let raw = if robots::is_robot(path) {
            robots::read_scene(path, &options.of_robots(), images)?
        } else {
            scene_files::read(path, &options.of_files(), images)?
        };
        Scene::assemble(raw, options).checked(path)
    }

    /// This scene, which was made in memory, without the objects that `options` hide, with other materials where they
    /// name any: what else they say is about files. Labels are those of the objects.
    ///
    /// # Errors
    /// Nothing left to scan.
    #[doc(hidden)]
    pub fn with_options(mut self, options: &LoadOptions) -> Result<Scene> {
        let hidden = |name: &str| options.hide.iter().any(|pattern| matches(pattern, name));
        let (left_out, kept) = self.objects.into_iter().partition(|object| hidden(&object.name));
        self.objects = kept;
        let left_out: Vec<Object> = left_out;
        self.hidden = left_out.into_iter().map(|object| object.name).collect();
        self.finished(options)
    }

    /// This scene, as read from `origin`, if it has anything to scan.
    pub(super) fn checked(self, origin: &Path) -> Result<Scene> {
        if self.triangle_count() == 0 && self.hidden.is_empty() {
            return Err(Error::parse(origin, "", "no triangle to scan: the file holds no mesh with area"));
        }
        self.check_reach(origin)?;
        Ok(self)
    }

    /// Checks that no object, as it was read from `origin`, is too far away.
    pub(super) fn check_reach(&self, origin: &Path) -> Result<()> {
        for (object, corners) in self.object_boxes() {
            if let Some(corner) = corners.iter().find(|corner| !within_reach(corner)) {
                let message = format!("it reaches to {:?} in the world; allowed: -1e18 to 1e18", corner.to_array());
                return Err(Error::parse(origin, format!("object {:?}", object.name), message));
            }
        }
        Ok(())
    }

    /// This scene if it has the animation that `options` name, with its caches, and warnings about rules that have no
    /// effect in it.
    fn finished(mut self, options: &LoadOptions) -> Result<Scene> {
        if let Some(name) = options.animation.as_ref().filter(|name| !self.animations.contains(name)) {
            return Err(Error::missing("animation", name, &self.animations));
        }
        if let Some(name) = options.joints.keys().find(|name| !self.joints.contains(name)) {
            return Err(Error::missing("joint", name, &self.joints));
        }
        if self.triangle_count() == 0 {
            let patterns = [options.hide.as_slice(), &options.labels.hide].concat().join(", ");
            return Err(Error::invalid("hide", patterns, "patterns that leave something to scan"));
        }
        options.labels.idle(&self).into_iter().for_each(|warning| self.report.warn(warning));
        for pattern in &options.hide {
            if !self.hidden.iter().any(|name| matches(pattern, name)) {
                let names: Vec<&str> = self.objects.iter().map(|object| object.name.as_str()).collect();
                let near = pattern::near(pattern, &names);
                self.report.warn(format!("hide: no object's name matches {:?}{near}", shown::name(pattern)));
            }
        }
        for (what, rules) in
            [("label rules: surfaces", &options.labels.surfaces), ("material rules", &options.materials)]
        {
            for pattern in self.apply(rules, what)? {
                let names: Vec<&str> = self.materials.iter().map(|material| material.name.as_str()).collect();
                let near = pattern::near(&pattern, &names);
                self.report.warn(format!("{what}: no material's name matches {:?}{near}", shown::name(&pattern)));
            }
        }
        self.hollow().into_iter().chain(self.unseen()).for_each(|warning| self.report.warn(warning));
        self.with_caches(options)
    }

    /// Sentences about materials that let light through closed bodies but give them no volume.
    fn hollow(&self) -> Vec<String> {
        let mut bodies: BTreeMap<&str, usize> = BTreeMap::new();
        let parts = self.meshes().into_iter().flat_map(|mesh| &mesh.parts);
        for part in parts {
            let Some(material) = &part.material else { continue };
            let thin = material.pane_m.is_none() && material.thickness_m == 0.0;
            if material.transmission > 0.0 && thin && part.is_closed() {
                *bodies.entry(&material.name).or_default() += 1;
            }
        }
        let wording = |(name, number)| {
            format!(
                "material {:?}: {} with a closed surface {} light through, but {} no volume (KHR_materials_volume, \
                 thickness_m): each face is treated as an infinitely thin pane, which does not bend light; in the profile \
                 blainder, as a boundary",
                shown::name(name),
                shown::count(number, "part"),
                if number == 1 { "lets" } else { "let" },
                if number == 1 { "has" } else { "have" },
            )
        };
        bodies.into_iter().map(wording).collect()
    }

    /// A sentence about used materials that rays always pass through.
    fn unseen(&self) -> Option<String> {
        let parts = self.meshes().into_iter().flat_map(|mesh| &mesh.parts);
        let unseen = parts
            .filter_map(|part| part.material.as_ref())
            .filter(|material| material.is_clear() && material.changes.is_none());
        let names: BTreeSet<String> = unseen.map(|material| material.name.clone()).collect();
        (!names.is_empty()).then(|| {
            let names = shown::some_of(&names.into_iter().collect::<Vec<_>>());
            format!(
                "materials that are not visible at all, since their alpha is 0 or below the cutoff: {names}; \
                     `alpha: solid` in a material rule shows them"
            )
        })
    }

    /// Every object with a non-empty mesh, and the corners of its box in the world.
    pub(crate) fn object_boxes(&self) -> impl Iterator<Item = (&Object, [DVec3; 8])> {
        let mut boxes = HashMap::new();
        self.objects.iter().filter_map(move |object| {
            let bounds = (*boxes.entry(Arc::as_ptr(&object.mesh)).or_insert_with(|| object.mesh.bounds()))?;
            Some((object, corners(bounds, &object.world_from_object)))
        })
    }

    /// The corners of all triangles in the world.
    #[doc(hidden)]
    pub fn world_points(&self) -> impl Iterator<Item = DVec3> {
        self.objects.iter().flat_map(|object| object.mesh.world_points(&object.world_from_object))
    }

    /// Whether anything in it moves or changes over time.
    pub fn is_moving(&self) -> bool {
        self.objects.iter().any(|object| object.motion.is_some())
            || self.materials.iter().any(|material| material.changes.is_some())
    }

    /// Number of triangles, each mesh counted as often as it is placed.
    pub fn triangle_count(&self) -> usize {
        self.objects.iter().map(|object| object.mesh.triangle_count()).sum()
    }

    /// The meshes of the objects, each once, in their order.
    pub fn meshes(&self) -> Vec<&Arc<Mesh>> {
        once(self.objects.iter().map(|object| &object.mesh))
    }

    /// The images of the materials, each once, in their order.
    pub fn textures(&self) -> Vec<&Arc<Texture>> {
        let uses = self.materials.iter().flat_map(|material| material.images());
        once(uses.map(|use_| &use_.texture))
    }

    /// World-space box around all objects, metres; `None` for an empty scene.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        surrounding(self.object_boxes().flat_map(|(_, corners)| corners))
    }

    /// Instances that appear to be a sky: named so, or around all the rest and several times as large. They return
    /// light, which no sky does: [`LoadOptions::hide`] leaves them out.
    pub fn skies(&self) -> Vec<u32> {
        /// How much larger than the rest, along each axis.
        const LARGER: f64 = 4.0;
        let is_called_so = |object: &Object| {
            let category = self.labels.category.name(object.category_id).unwrap_or_default();
            let instance = self.labels.instance.name(object.instance_id).unwrap_or_default();
            [category, instance, &object.name].into_iter().any(|name| matches("sky*", name) || matches("*_sky*", name))
        };
        let boxes =
            self.object_boxes().filter_map(|(object, corners)| Some((object, surrounding(corners.into_iter())?)));
        let (mut skies, rest): (Vec<_>, Vec<_>) = boxes.partition(|(object, _)| is_called_so(object));
        let volume = |(low, high): &(DVec3, DVec3)| (*high - *low).element_product();
        let largest = rest.iter().max_by(|(_, a), (_, b)| volume(a).total_cmp(&volume(b)));
        if let Some((object, (low, high))) = largest {
            let others = rest.iter().filter(|(other, _)| other.instance_id != object.instance_id);
            if let Some((inner_low, inner_high)) = surrounding(others.flat_map(|(_, (low, high))| [*low, *high])) {
                let around = inner_low.cmpge(*low).all() && inner_high.cmple(*high).all();
                if around && (*high - *low).cmpge(LARGER * (inner_high - inner_low)).all() {
                    skies.push((*object, (*low, *high)));
                }
            }
        }
        let mut ids: Vec<u32> = skies.into_iter().map(|(object, _)| object.instance_id).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    /// The camera node called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn camera(&self, name: &str) -> Result<&Camera> {
        Camera::find(&self.cameras, name)
    }
}

/// The shared values of `all`, each once.
fn once<'a, T>(all: impl Iterator<Item = &'a Arc<T>>) -> Vec<&'a Arc<T>> {
    let mut seen = HashSet::new();
    all.filter(|one| seen.insert(Arc::as_ptr(one))).collect()
}

/// An object whose labels are names, yet to be numbered.
pub(super) struct NamedObject {
    pub(super) name: String,
    pub(super) mesh: Arc<Mesh>,
    pub(super) world_from_object: DAffine3,
    pub(super) up: UpAxis,
    pub(super) category: String,
    /// One for each part of the mesh; empty = unlabelled.
    pub(super) parts: Vec<String>,
    pub(super) instance: InstanceKey,
    /// Name of the instance.
    pub(super) instance_name: String,
    pub(super) motion: Option<Motion>,
    pub(super) ancestors: Arc<[Ancestor]>,
}

impl Scene {
    /// The scene of a file without hidden objects; every object and part gets its label numbers.
    pub(crate) fn assemble(raw: RawScene, options: &LoadOptions) -> Scene {
        let RawScene { mut objects, materials, cameras, timeline, .. } = raw;
        let mut scene = Scene {
            materials,
            cameras,
            timeline: Arc::new(timeline),
            animations: raw.animations,
            animation_lengths: raw.animation_lengths,
            joints: raw.joints,
            degenerate_triangles: raw.degenerate_triangles,
            report: raw.report,
            ..Scene::default()
        };
        let rules = &options.labels;
        let hidden = |name: &str| options.hide.iter().chain(&rules.hide).any(|pattern| matches(pattern, name));
        objects.retain(|object| {
            let above = object.ancestors.iter().map(|node| &*node.name);
            let known = std::iter::once(object.name.as_str()).chain(above).find(|name| hidden(name));
            scene.hidden.extend(known.map(str::to_owned));
            known.is_none()
        });
        let mut given = [Given::new("categories", rules), Given::new("parts", rules)];
        for object in &mut objects {
            let [category, part] = &mut given;
            object.category = object.category.take().map(|text| category.name(text));
            object.part = object.part.take().map(|text| part.name(text));
        }
        let mut identifier = Identifier::new(rules);
        let named: Vec<NamedObject> = objects
            .into_iter()
            .enumerate()
            .map(|(place, object)| {
                let Identity { category, instance, name: instance_name } = identifier.identify(&object, place);
                if object.category.as_ref() != Some(&category) {
                    given[0].meet(&category);
                }
                NamedObject {
                    category,
                    parts: object
                        .mesh
                        .parts
                        .iter()
                        .map(|part| part_name(part, &object, rules, &mut given[1]))
                        .collect(),
                    instance,
                    instance_name,
                    name: object.name,
                    mesh: object.mesh,
                    world_from_object: object.world_from_object,
                    up: object.up,
                    motion: object.motion,
                    ancestors: object.ancestors,
                }
            })
            .collect();
        identifier.contradictions().into_iter().for_each(|warning| scene.report.warn(warning));
        given.iter().flat_map(Given::wording).for_each(|warning| scene.report.warn(warning));
        scene.number(named, rules, given.map(|given| given.numbers))
    }

    /// Numbers the labels of `objects`, which become this scene's; `numbers` are those that categories and parts have
    /// already.
    pub(super) fn number(
        mut self,
        objects: Vec<NamedObject>,
        rules: &LabelRules,
        numbers: [BTreeMap<String, u32>; 2],
    ) -> Scene {
        let category = NameTable::number(objects.iter().map(|object| object.category.clone()), &numbers[0]);
        let part = NameTable::number(objects.iter().flat_map(|object| object.parts.iter().cloned()), &numbers[1]);
        let material = NameTable::number(self.materials.iter().map(|m| m.name.clone()), &BTreeMap::new());
        let class = |(id, name)| Some((id, *rules.las_class.get(name)?));
        let las_class = category.iter().filter_map(class).collect();

        // Instances are numbered in sorted order of their names; equal names keep the file's order.
        let mut known = HashSet::new();
        let mut order: Vec<&NamedObject> = objects.iter().filter(|object| known.insert(object.instance)).collect();
        order.sort_by_key(|object| &object.instance_name);
        let instance_ids: HashMap<InstanceKey, u32> = order.iter().map(|object| object.instance).zip(1..).collect();
        let instance = NameTable {
            ids: (1..=order.len() as u32).collect(),
            names: order.iter().map(|object| object.instance_name.clone()).collect(),
        };

        let (category_ids, part_ids) = (category.to_map(), part.to_map());
        let number = |ids: &HashMap<&str, u32>, name: &str| ids.get(name).copied().unwrap_or(0);
        self.objects = objects
            .into_iter()
            .map(|object| Object {
                category_id: number(&category_ids, &object.category),
                part_ids: object.parts.iter().map(|name| number(&part_ids, name)).collect(),
                name: object.name,
                mesh: object.mesh,
                world_from_object: object.world_from_object,
                up: object.up,
                instance_id: instance_ids[&object.instance],
                mask: u32::MAX,
                material: None,
                motion: object.motion,
                ancestors: object.ancestors,
                sequence: None,
            })
            .collect();
        self.labels = Labels::default().category(category).part(part).material(material);
        self.labels = std::mem::take(&mut self.labels).instance(instance).las_class(las_class);
        self
    }
}

/// Name of a part of an object.
fn part_name(part: &Part, object: &RawObject, rules: &LabelRules, given: &mut Given) -> String {
    let material = part.material_name();
    if let Some(ruled) = rules.part(material) {
        given.meet(ruled);
        return ruled.to_owned();
    }
    let own = part.material.as_ref().and_then(|material| material.part.clone());
    own.map(|text| given.name(text)).or_else(|| object.part.clone()).unwrap_or_else(|| {
        given.meet(material);
        material.to_owned()
    })
}
