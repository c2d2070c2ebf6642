//! A scene that is edited while it is scanned: from objects to Embree's structure and the tables behind its ids.

mod commit;
mod labels;
mod object;
mod origin;
mod placed;
mod robot;
mod to_scene;

pub use object::ObjectId;
pub use robot::LiveRobot;

use super::{BuiltScene, Engine, SharedSurfaces};
use crate::scene::{Object, Scene};
use commit::{FixedObjects, StandingObjects};
use glam::{DAffine3, DVec3};
use ground::array::Array;
use ground::error::{Error, Result};
use ground::pose::Pose;
use labels::{Renumbered, name_instance, name_material};
use model::material::Material;
use model::motion::{Cache, Deformation, Span, Timeline};
use model::{Camera, Labels, NameTable, beyond_reach, surrounding, within_reach};
use object::{Attachment, Live, Slot, boxes, check_parts, check_pose, gone, lives, staged};
use placed::PlacedObject;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::{fmt, mem};

/// A scene that changes. [`LiveScene::commit`] produces what is scanned, a [`BuiltScene`] that never changes: any
/// number of threads may scan it while the next one is prepared.
///
/// Objects that may move are placed individually, so that a commit after moving them costs a few microseconds per
/// object, whatever the size of their meshes. Fixed objects with a mesh of their own are built together, which makes
/// them as fast to trace as possible; adding, removing or changing a fixed object, or moving it for the first time,
/// rebuilds all of them.
///
/// A clone shares what both have in common and costs about as much as copying the list of objects.
#[derive(Clone)]
pub struct LiveScene {
    engine: Engine,
    slots: Vec<Slot>,
    free: Vec<u32>,
    cameras: Vec<Camera>,
    labels: Arc<Labels>,
    /// World position of Embree's (0, 0, 0); `None`: chosen by the next commit.
    origin: Option<DVec3>,
    /// The time of the next scans.
    time: Span,
    /// Tolerance on the position of deforming surfaces, m.
    tolerance: f64,
    /// `None`: fixed objects have changed.
    fixed: Option<Arc<FixedObjects>>,
    /// What stood at the last commit.
    standing: Option<Arc<StandingObjects>>,
    /// Objects placed by themselves, by slot, unless they have moved.
    placed: HashMap<u32, PlacedObject>,
    /// Materials that replace others, on one object (by slot) or on all; keyed by the address of the replaced material,
    /// which nothing else can have as long as it is kept here.
    looks: HashMap<(Option<u32>, usize), [Arc<Material>; 2]>,
    /// `None`: objects have been added, removed or relabelled.
    surfaces: Option<Arc<SharedSurfaces>>,
    /// `None`: something has changed.
    built: Option<BuiltScene>,
}

impl fmt::Debug for LiveScene {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("LiveScene").field("objects", &self.objects().count()).finish_non_exhaustive()
    }
}

impl LiveScene {
    /// A scene without objects.
    pub fn new(engine: &Engine) -> LiveScene {
        LiveScene {
            engine: engine.clone(),
            slots: Vec::new(),
            free: Vec::new(),
            cameras: Vec::new(),
            labels: Arc::default(),
            origin: None,
            time: Span { start: 0.0, length: 0.0 },
            tolerance: 1e-3,
            fixed: None,
            standing: None,
            placed: HashMap::new(),
            looks: HashMap::new(),
            surfaces: None,
            built: None,
        }
    }

    /// The engine that builds and scans it.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Sets the world position, metres, that the single-precision coordinates of clouds are relative to. Without it the
    /// first commit chooses: the world's own origin for scenes within a kilometre of it, else the position of the
    /// middle triangle. Coordinates more than 8 km from it lose more than half a millimetre.
    ///
    /// # Errors
    /// A position that is not finite or beyond 1e18 m.
    pub fn set_origin(&mut self, origin: DVec3) -> Result<()> {
        if !within_reach(&origin) {
            return Err(Error::invalid("origin", origin, "finite numbers from -1e18 to 1e18"));
        }
        self.origin = Some(origin);
        self.placed.clear();
        (self.fixed, self.built) = (None, None);
        Ok(())
    }

    /// Adds the objects of a scene file, all fixed, its cameras and the names of its labels, and returns the objects in
    /// order. In a scene with labels, a known name keeps its number here, and any other name keeps its number from the
    /// file if that is free; instances are numbered on from the greatest named number.
    ///
    /// # Errors
    /// As [`LiveScene::add`]; in that case no object is added.
    pub fn add_scene(&mut self, scene: &Scene) -> Result<Vec<ObjectId>> {
        let mut boxes = HashMap::new();
        for object in &scene.objects {
            let bounds = *boxes.entry(Arc::as_ptr(&object.mesh)).or_insert_with(|| object.mesh.bounds());
            check_pose(&object.name, bounds, &object.world_from_object)?;
        }
        let last = self.labels.instance.ids.last().copied().unwrap_or(0);
        let most =
            scene.objects.iter().map(|object| object.instance_id).chain(scene.labels.instance.ids.last().copied());
        if most.max().unwrap_or(0).checked_add(last).is_none() {
            let allowed = "one after which the numbers of the file still fit";
            return Err(Error::invalid("the greatest instance number", last, allowed));
        }
        let labels = Arc::make_mut(&mut self.labels);
        let numbers = Renumbered::absorbing(labels, &scene.labels);
        let NameTable { ids, names } = &scene.labels.instance;
        labels.instance.ids.extend(ids.iter().map(|id| id + last));
        labels.instance.names.extend_from_slice(names);
        self.cameras.extend_from_slice(&scene.cameras);
        let objects = scene.objects.iter().map(|object| {
            let bounds = boxes[&Arc::as_ptr(&object.mesh)];
            let object = Object {
                category_id: numbers.category(object),
                part_ids: numbers.parts(object),
                instance_id: if object.instance_id == 0 { 0 } else { object.instance_id + last },
                ..object.clone()
            };
            let timeline = object.motion.is_some().then(|| scene.timeline.clone());
            let (object, timeline) = staged(object, timeline);
            let place = if timeline.is_some() { Attachment::Free } else { Attachment::Fixed { together: false } };
            self.insert(object, bounds, place, timeline)
        });
        Ok(objects.collect())
    }

    /// Adds an object that may move.
    ///
    /// # Errors
    /// A pose that is not finite or reaches beyond 1e18 m; part numbers that are not as many as the parts.
    pub fn add(&mut self, object: Object) -> Result<ObjectId> {
        self.add_at(object, Attachment::Free)
    }

    /// Adds an object that stays where it is.
    ///
    /// # Errors
    /// As [`LiveScene::add`].
    pub fn add_fixed(&mut self, object: Object) -> Result<ObjectId> {
        self.add_at(object, Attachment::Fixed { together: false })
    }

    fn add_at(&mut self, object: Object, place: Attachment) -> Result<ObjectId> {
        let bounds = object.mesh.bounds();
        check_pose(&object.name, bounds, &object.world_from_object)?;
        check_parts(&object.mesh, &object.part_ids)?;
        let labels = Arc::make_mut(&mut self.labels);
        name_instance(labels, object.instance_id, &object.name);
        let parts = object.mesh.parts.iter().filter_map(|part| part.material.as_ref());
        for material in parts.chain(&object.material) {
            name_material(labels, material);
        }
        Ok(self.insert(Object { motion: None, ..object }, bounds, place, None))
    }

    fn insert(
        &mut self,
        object: Object,
        bounds: Option<[[f32; 3]; 2]>,
        place: Attachment,
        timeline: Option<Arc<Timeline>>,
    ) -> ObjectId {
        if let Attachment::Fixed { .. } = place {
            self.fixed = None;
        }
        (self.surfaces, self.built) = (None, None);
        let slot = self.free.pop().unwrap_or_else(|| {
            self.slots.push(Slot::default());
            self.slots.len() as u32 - 1
        });
        let entry = &mut self.slots[slot as usize];
        entry.generation += 1;
        entry.live = Some(Arc::new(Live { object, timeline, bounds, place, moved: true, known: Default::default() }));
        ObjectId { slot, generation: entry.generation }
    }

    /// Removes an object.
    ///
    /// # Errors
    /// As [`LiveScene::object`].
    pub fn remove(&mut self, id: ObjectId) -> Result<()> {
        let live = self.live(id)?;
        let number = live.object.instance_id;
        self.discard_built(id);
        (self.surfaces, self.built) = (None, None);
        self.looks.retain(|(slot, _), _| *slot != Some(id.slot));
        let slot = &mut self.slots[id.slot as usize];
        slot.live = None;
        // A slot whose generations are used up stays empty.
        if slot.generation < u32::MAX {
            self.free.push(id.slot);
        }
        if number != 0 && !self.objects().any(|(_, object)| object.instance_id == number) {
            Arc::make_mut(&mut self.labels).instance.remove(number);
        }
        Ok(())
    }

    /// Whether [`LiveScene::set_pose`] would accept a pose.
    ///
    /// # Errors
    /// As [`LiveScene::set_pose`].
    pub fn check_pose(&self, id: ObjectId, world_from_object: &DAffine3) -> Result<()> {
        let live = self.slot(id)?;
        check_pose(&live.object.name, live.bounds, world_from_object)
    }

    /// Moves an object to another pose. A fixed one may move from now on. Vertices that move by themselves (caches,
    /// morph targets, [`LiveScene::set_vertex_motion`]) continue to do so there; a skin is left in its rest pose.
    ///
    /// # Errors
    /// As [`LiveScene::object`]; a pose that is not finite or reaches beyond 1e18 m, in which case it stays where it
    /// is.
    pub fn set_pose(&mut self, id: ObjectId, world_from_object: DAffine3) -> Result<()> {
        let live = self.live(id)?;
        check_pose(&live.object.name, live.bounds, &world_from_object)?;
        live.object.world_from_object = world_from_object;
        match live.own_shape() {
            None => (live.object.motion, live.timeline) = (None, None),
            Some(shape) => live.hang(Timeline::standing(world_from_object), Some(shape)),
        }
        live.moved = true;
        self.detach(id);
        Ok(())
    }

    /// Moves an object during subsequent scans through `keys`, times in s (those of [`ScanOptions::start_time`] and of
    /// the beams) and poses, with linear motion and uniform rotation between them; before the first and after the last
    /// it is at rest. [`LiveScene::set_time`] selects which part of it the next scans see.
    ///
    /// [`ScanOptions::start_time`]: crate::scan::ScanOptions::start_time
    ///
    /// # Errors
    /// As [`LiveScene::set_pose`]; no key; times that are not finite or decrease; a pose that is not a rotation and
    /// scaling along the object's axes. In that case it moves as before.
    pub fn set_motion(&mut self, id: ObjectId, keys: &[(f64, DAffine3)]) -> Result<()> {
        let live = self.live(id)?;
        for (_, pose) in keys {
            check_pose(&live.object.name, live.bounds, pose)?;
        }
        let timeline = Timeline::through(keys)?;
        live.hang(timeline, live.own_shape());
        live.moved = true;
        self.detach(id);
        Ok(())
    }

    /// Moves the vertices of an object during subsequent scans through `keys`, times in s as those of
    /// [`LiveScene::set_motion`] and positions in the object's frame, with linear motion between them; before the first
    /// and after the last they are at rest. Its triangles stay the same and are flat-shaded. When called repeatedly,
    /// each time with the next part of a simulation, it builds only what the next scan needs.
    ///
    /// # Errors
    /// As [`LiveScene::object`]; no key; times that are not finite or not increasing; a number of vertices that differs
    /// from the number before; a coordinate that is not finite or beyond 1e18; a mesh whose parts do not share their
    /// vertices. In that case it moves as before.
    pub fn set_vertex_motion(&mut self, id: ObjectId, keys: &[(f64, Array<[f32; 3]>)]) -> Result<()> {
        let live = self.live(id)?;
        let times: Vec<f64> = keys.iter().map(|(time, _)| *time).collect();
        if let Some(index) = (0..times.len()).find(|&k| !times[k].is_finite() || k > 0 && times[k] <= times[k - 1]) {
            return Err(Error::invalid(format!("time of key {index}"), times[index], "finite times that rise"));
        }
        let Some((_, first)) = keys.first() else { return Err(Error::invalid("keys", "none", "at least one")) };
        // A mesh that has moved before keeps the tree that its rays traverse.
        let known = live.object.motion.as_ref().and_then(|motion| motion.shape.clone());
        let known = known.filter(|shape| shape.cache.as_ref().is_some_and(|cache| !cache.is_read()));
        let vertices = live.object.mesh.parts[0].positions.len();
        for (index, (_, positions)) in keys.iter().enumerate() {
            if positions.len() != vertices {
                let (what, allowed) = (format!("positions of key {index}"), format!("as many as before, {vertices}"));
                return Err(Error::invalid(what, positions.len(), allowed));
            }
            if let Some(vertex) = beyond_reach(positions) {
                let what = format!("vertex {vertex} of key {index}");
                return Err(Error::invalid(what, format!("{:?}", positions[vertex]), "-1e18 to 1e18"));
            }
        }
        let samples = keys.iter().map(|(_, positions)| positions.clone()).collect();
        let cache = Cache::held(times, samples);
        let shape = match known {
            Some(known) => Deformation { cache: Some(Arc::new(cache)), ..(*known).clone() },
            None => {
                let mesh = live.object.mesh.with_vertices(first.clone(), None)?;
                let shape = Deformation::baked(mesh.parts.len(), first, cache);
                (live.bounds, live.object.mesh, live.object.sequence) = (mesh.bounds(), Arc::new(mesh), None);
                self.surfaces = None;
                shape
            }
        };
        let live = self.live(id)?;
        match &mut live.object.motion {
            Some(motion) => motion.shape = Some(Arc::new(shape)),
            None => live.hang(Timeline::standing(live.object.world_from_object), Some(Arc::new(shape))),
        }
        live.moved = true;
        self.detach(id);
        Ok(())
    }

    /// Sets the time of the next scans, s: everything that moves by itself does so from `start` to `start + length`.
    /// With a `length` of 0 it is frozen where it is at `start`, whatever the time of a scan. A new scene is frozen at
    /// time 0.
    ///
    /// # Errors
    /// A time that is not finite; a negative length.
    pub fn set_time(&mut self, start: f64, length: f64) -> Result<()> {
        if !start.is_finite() {
            return Err(Error::invalid("start", start, "a finite number"));
        }
        if !(0.0..1e9).contains(&length) {
            return Err(Error::invalid("length", length, "0 to 1e9 s"));
        }
        let before = mem::replace(&mut self.time, Span { start, length });
        if before == self.time {
            return Ok(());
        }
        for (slot, entry) in (0..).zip(&mut self.slots) {
            let Some(live) = &mut entry.live else { continue };
            let (Some(timeline), Some(motion)) = (&live.timeline, &live.object.motion) else { continue };
            let (from, to) = (start.min(before.start), (start + length).max(before.start + before.length));
            let same = live.object.sequence.as_ref().is_none_or(|sequence| sequence.stays(from, to));
            if !(same && motion.stays(timeline, from, to)) {
                let live = Arc::make_mut(live);
                if let Some(placed) = self.placed.remove(&slot) {
                    live.remember(&placed);
                }
                live.moved = true;
            }
            // The snapshot also states the time of objects at rest.
            self.built = None;
        }
        if self.objects().any(|(_, object)| object.materials().any(|material| material.changes.is_some())) {
            (self.surfaces, self.built) = (None, None);
        }
        Ok(())
    }

    /// Sets the tolerance on the position of deforming surfaces during a scan, m: 1 mm in a new scene. Rays see linear
    /// motion between steps; there are as many steps as the tolerance requires.
    ///
    /// # Errors
    /// A distance that is not above 0, or beyond 1 km.
    pub fn set_motion_tolerance(&mut self, tolerance: f64) -> Result<()> {
        if !(tolerance > 0.0 && tolerance <= 1e3) {
            return Err(Error::invalid("motion tolerance", tolerance, "above 0, up to 1000 m"));
        }
        self.tolerance = tolerance;
        for (slot, entry) in (0..).zip(&mut self.slots) {
            let bends = |live: &Live| live.object.motion.as_ref().is_some_and(|motion| motion.shape.is_some());
            if entry.live.as_deref().is_some_and(bends) {
                self.placed.remove(&slot);
                self.built = None;
            }
        }
        Ok(())
    }

    /// Gives the vertices of an object new positions, and optionally shading normals: it gets a mesh of its own,
    /// optimised for build speed, with the same triangles.
    ///
    /// # Errors
    /// As [`LiveScene::object`] and [`Mesh::new`](crate::scene::Mesh::new); a number of vertices that differs from the number before; a mesh
    /// whose parts do not share their vertices. In that case the object stays as it is.
    pub fn set_vertices(
        &mut self,
        id: ObjectId,
        positions: Array<[f32; 3]>,
        normals: Option<Array<[f32; 3]>>,
    ) -> Result<()> {
        let live = self.live(id)?;
        let mesh = live.object.mesh.with_vertices(positions, normals)?;
        let bounds = mesh.bounds();
        check_pose(&live.object.name, bounds, &live.object.world_from_object)?;
        (live.object.mesh, live.bounds, live.object.sequence) = (Arc::new(mesh), bounds, None);
        if let Some(motion) = &mut live.object.motion {
            motion.shape = None;
        }
        live.moved = true;
        self.detach(id);
        self.surfaces = None;
        Ok(())
    }

    /// Sets the labels of an object: its category, its instance number, and the number of each part of its mesh.
    ///
    /// # Errors
    /// As [`LiveScene::object`]; part numbers that are not as many as the parts.
    pub fn set_labels(&mut self, id: ObjectId, category_id: u32, instance_id: u32, part_ids: &[u32]) -> Result<()> {
        let live = self.live(id)?;
        check_parts(&live.object.mesh, part_ids)?;
        live.object.category_id = category_id;
        live.object.part_ids = part_ids.to_vec();
        let before = mem::replace(&mut live.object.instance_id, instance_id);
        if before != instance_id {
            let name = live.object.name.clone();
            let others = self.objects().any(|(_, object)| object.instance_id == before);
            let labels = Arc::make_mut(&mut self.labels);
            name_instance(labels, instance_id, &name);
            if !others {
                labels.instance.remove(before);
            }
        }
        (self.surfaces, self.built) = (None, None);
        Ok(())
    }

    /// Sets which scans see an object: those whose mask shares a bit with `mask`.
    ///
    /// # Errors
    /// As [`LiveScene::object`].
    pub fn set_mask(&mut self, id: ObjectId, mask: u32) -> Result<()> {
        let live = self.live(id)?;
        live.object.mask = mask;
        self.discard_built(id);
        self.built = None;
        Ok(())
    }

    /// Gives an object one material instead of those of its mesh, or with `None` those of its mesh again.
    ///
    /// # Errors
    /// As [`LiveScene::object`].
    pub fn set_material(&mut self, id: ObjectId, material: Option<Arc<Material>>) -> Result<()> {
        self.live(id)?.object.material = material.clone();
        if let Some(material) = material {
            name_material(Arc::make_mut(&mut self.labels), &material);
        }
        (self.surfaces, self.built) = (None, None);
        Ok(())
    }

    /// Replaces `material` of meshes by `look`, on one object or on all; what is set for one object takes precedence.
    /// Nothing is rebuilt.
    ///
    /// # Errors
    /// As [`LiveScene::object`].
    #[doc(hidden)]
    pub fn set_look(&mut self, id: Option<ObjectId>, material: &Arc<Material>, look: Arc<Material>) -> Result<()> {
        id.map_or(Ok(()), |id| self.slot(id).map(drop))?;
        name_material(Arc::make_mut(&mut self.labels), &look);
        let key = (id.map(|id| id.slot), Arc::as_ptr(material) as usize);
        self.looks.insert(key, [material.clone(), look]);
        (self.surfaces, self.built) = (None, None);
        Ok(())
    }

    /// Detaches a fixed object, so that it can be moved, removed or replaced without rebuilding the others.
    ///
    /// # Errors
    /// As [`LiveScene::object`].
    #[doc(hidden)]
    pub fn unfix(&mut self, id: ObjectId) -> Result<()> {
        self.slot(id)?;
        self.detach(id);
        Ok(())
    }

    /// Applies the world transform `moved` to an object and to all of its motion.
    ///
    /// # Errors
    /// As [`LiveScene::set_pose`].
    #[doc(hidden)]
    pub fn move_by(&mut self, id: ObjectId, moved: &DAffine3) -> Result<()> {
        let live = self.live(id)?;
        let world_from_object = *moved * live.object.world_from_object;
        check_pose(&live.object.name, live.bounds, &world_from_object)?;
        live.object.world_from_object = world_from_object;
        if let (Some(timeline), Some(motion)) = (&live.timeline, live.object.motion.take()) {
            let mut whole = Timeline::standing(*moved);
            let shift = whole.hang(timeline);
            live.timeline = Some(Arc::new(whole));
            live.object.motion = Some(motion.shifted(shift));
        }
        live.moved = true;
        self.detach(id);
        Ok(())
    }

    /// Adds the objects of a model, which may move, as one instance with this number, name and, if given, category;
    /// `world_from_model` places them.
    ///
    /// # Errors
    /// As [`LiveScene::add`]; in that case no object is added.
    #[doc(hidden)]
    pub fn add_model(
        &mut self,
        model: &Scene,
        world_from_model: &DAffine3,
        (name, number): (&str, u32),
        category: Option<&str>,
    ) -> Result<Vec<ObjectId>> {
        for object in &model.objects {
            check_pose(&object.name, object.mesh.bounds(), &(*world_from_model * object.world_from_object))?;
        }
        let labels = Arc::make_mut(&mut self.labels);
        name_instance(labels, number, name);
        let given = category.map(|category| labels.category.numbered(category));
        let numbers = Renumbered::absorbing(labels, &model.labels);
        let mut timeline = Timeline::standing(*world_from_model);
        let shift = timeline.hang(&model.timeline);
        let timeline = Arc::new(timeline);
        let ids = model.objects.iter().map(|object| {
            let bounds = object.mesh.bounds();
            let object = Object {
                world_from_object: *world_from_model * object.world_from_object,
                category_id: given.unwrap_or_else(|| numbers.category(object)),
                part_ids: numbers.parts(object),
                instance_id: number,
                motion: object.motion.clone().map(|motion| motion.shifted(shift)),
                ..object.clone()
            };
            let timeline = object.motion.is_some().then(|| timeline.clone());
            let (object, timeline) = staged(object, timeline);
            self.insert(object, bounds, Attachment::Free, timeline)
        });
        Ok(ids.collect())
    }

    /// Gives the categories that label rules name their ASPRS classes: models may be placed with a category of their own.
    #[doc(hidden)]
    pub fn classify(&mut self, las_class: &BTreeMap<String, u8>) {
        let labels = Arc::make_mut(&mut self.labels);
        let of = |(id, name): (u32, &str)| Some((id, *las_class.get(name)?));
        let classes: Vec<(u32, u8)> = labels.category.iter().filter_map(of).collect();
        labels.las_class.extend(classes);
    }

    /// An unused number for another instance.
    #[doc(hidden)]
    pub fn next_instance(&self) -> u32 {
        let last = self.objects().map(|(_, object)| object.instance_id).max().unwrap_or(0);
        last.max(self.labels.instance.ids.last().copied().unwrap_or(0)).saturating_add(1)
    }

    /// Names of the label numbers.
    pub fn labels(&self) -> &Labels {
        &self.labels
    }

    /// Names a number of a label column: `category`, `part` or `instance`; the names are part of every file written.
    ///
    /// # Errors
    /// Any other table; the number 0, which means unlabelled.
    pub fn name_label(&mut self, table: &str, number: u32, name: &str) -> Result<()> {
        if number == 0 {
            return Err(Error::invalid("number", 0, "1 to 4294967295: 0 means unlabelled"));
        }
        let labels = Arc::make_mut(&mut self.labels);
        match table {
            "category" => labels.category.set(number, name),
            "part" => labels.part.set(number, name),
            "instance" => labels.instance.set(number, name),
            _ => return Err(Error::invalid("table", format!("{table:?}"), "category, part, instance")),
        }
        (self.surfaces, self.built) = (None, None);
        Ok(())
    }

    /// An object in its current state.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for an object that has been removed or belongs to another scene.
    pub fn object(&self, id: ObjectId) -> Result<&Object> {
        self.slot(id).map(|live| &live.object)
    }

    /// All objects.
    pub fn objects(&self) -> impl Iterator<Item = (ObjectId, &Object)> {
        self.lives()
            .map(|(slot, live)| (ObjectId { slot, generation: self.slots[slot as usize].generation }, &live.object))
    }

    /// The first object called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn find(&self, name: &str) -> Result<ObjectId> {
        let found = self.objects().find(|(_, object)| object.name == name).map(|(id, _)| id);
        found.ok_or_else(|| Error::missing("object", name, self.objects().map(|(_, object)| &object.name)))
    }

    /// The camera nodes of the added scenes.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Pose of the camera node called `name` of an added scene.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn camera(&self, name: &str) -> Result<Pose> {
        Camera::find(&self.cameras, name).map(|camera| camera.pose)
    }

    /// Triangles of all objects.
    pub fn triangle_count(&self) -> usize {
        self.objects().map(|(_, object)| object.mesh.triangle_count()).sum()
    }

    /// World-space box around all objects, metres; `None` without any.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        surrounding(boxes(&self.slots).flat_map(|(_, corners)| corners))
    }

    /// Makes an object movable, because it has been moved.
    fn detach(&mut self, id: ObjectId) {
        self.discard_built(id);
        if let Some(live) =
            self.slots[id.slot as usize].live.as_mut().filter(|live| !matches!(live.place, Attachment::Free))
        {
            Arc::make_mut(live).place = Attachment::Free;
        }
        self.built = None;
    }

    /// Discards what has been built for an object.
    fn discard_built(&mut self, id: ObjectId) {
        let Some(live) = &mut self.slots[id.slot as usize].live else { return };
        if !matches!(live.place, Attachment::Free) {
            self.fixed = None;
        }
        if let Some(placed) = self.placed.remove(&id.slot) {
            Arc::make_mut(live).remember(&placed);
            if !placed.turned {
                self.surfaces = None;
            }
        }
    }

    fn slot(&self, id: ObjectId) -> Result<&Live> {
        let slot = self.slots.get(id.slot as usize).filter(|slot| slot.generation == id.generation);
        slot.and_then(|slot| slot.live.as_deref()).ok_or_else(|| gone(id))
    }

    fn live(&mut self, id: ObjectId) -> Result<&mut Live> {
        let slot = self.slots.get_mut(id.slot as usize).filter(|slot| slot.generation == id.generation);
        slot.and_then(|slot| slot.live.as_mut()).map(Arc::make_mut).ok_or_else(|| gone(id))
    }

    fn lives(&self) -> impl Iterator<Item = (u32, &Live)> {
        lives(&self.slots)
    }
}
