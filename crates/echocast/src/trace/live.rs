//! A scene that is edited while it is scanned: from objects to Embree's structure and the tables behind its ids.

use super::deforming::Known;
use super::instances::ObjectExtent;
use super::mover::{DrivingMotion, MOST_BYTES, Mover};
use super::{BuiltScene, Engine, Surfaces, Tables};
use crate::ground::array::Array;
use crate::ground::error::{Error, Result};
use crate::ground::math::cofactors;
use crate::ground::pose::Pose;
use crate::ground::report::Report;
use crate::material::Material;
use crate::model::{Camera, Labels, Mesh, NameTable, beyond_reach, corners, surrounding, within_reach};
use crate::motion::{Cache, Deformation, Motion, Span, Timeline};
use crate::scene::{Object, Scene};
use embree4::{CommittedScene, Custom, Instance, Pace, Quality};
use glam::{DAffine3, DVec3, Mat3};
use std::collections::HashMap;
use std::sync::{Arc, OnceLock, PoisonError};
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
    fixed: Option<Arc<Fixed>>,
    /// Objects placed by themselves, by slot, unless they have moved.
    placed: HashMap<u32, PlacedObject>,
    /// Materials that replace others, on one object (by slot) or on all; keyed by the address of the replaced material,
    /// which nothing else can have as long as it is kept here.
    looks: HashMap<(Option<u32>, usize), [Arc<Material>; 2]>,
    /// `None`: objects have been added, removed or relabelled.
    surfaces: Option<Arc<Surfaces>>,
    /// `None`: something has changed.
    built: Option<BuiltScene>,
}

/// Identifies an object of a [`LiveScene`]; never reused, even after the object has been removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectId {
    slot: u32,
    generation: u32,
}

impl ObjectId {
    /// As one number, never 0.
    pub fn to_u64(self) -> u64 {
        u64::from(self.generation) << 32 | u64::from(self.slot)
    }

    /// The id that [`ObjectId::to_u64`] turned into this number; a number that belongs to no object is detected on use.
    pub fn from_u64(number: u64) -> ObjectId {
        ObjectId { slot: number as u32, generation: (number >> 32) as u32 }
    }
}

#[derive(Clone, Default)]
struct Slot {
    /// Counted from 1, incremented with every object.
    generation: u32,
    live: Option<Arc<Live>>,
}

#[derive(Clone)]
struct Live {
    object: Object,
    /// The timeline that moves it, if it moves by itself.
    timeline: Option<Arc<Timeline>>,
    /// Bounding box of its mesh.
    bounds: Option<[[f32; 3]; 2]>,
    place: Attachment,
    /// Whether it has been placed or moved since the last commit.
    moved: bool,
    /// Its shape in the last scans.
    known: Known,
}

/// How an object appears in Embree's structure.
#[derive(Clone)]
enum Attachment {
    /// Together with the other fixed objects, if possible; known once those are built.
    Fixed { together: bool },
    /// By itself.
    Free,
}

/// The fixed objects, built.
struct Fixed {
    /// Slots of those built together, in the order of their geometries.
    together: Vec<u32>,
    scene: CommittedScene,
    /// That scene as an untransformed instance, so that other instances can be placed alongside it.
    instance: Instance,
}

#[derive(Clone)]
struct PlacedObject {
    thing: EmbreeObject,
    /// Whether its normals come in the mesh's frame.
    turned: bool,
}

impl PlacedObject {
    /// Memory used by its motion.
    fn bytes(&self) -> usize {
        match &self.thing {
            EmbreeObject::Still(_) | EmbreeObject::Resting(..) => 0,
            EmbreeObject::Moving(_, mover) => mover.bytes(),
        }
    }
}

/// An object in Embree's structure.
#[derive(Clone)]
enum EmbreeObject {
    Still(Instance),
    /// At rest during the current time span.
    Resting(Instance, Arc<DrivingMotion>),
    /// Moving, or hidden.
    Moving(Custom, Arc<Mover>),
}

impl Mesh {
    /// Builds what objects with this mesh need to be traced, which otherwise happens when the first of them is
    /// committed. This can be done on any thread while scenes are edited, and leaves a core free for committing them.
    ///
    /// # Errors
    /// Embree's: out of memory.
    pub fn prepare(&self, engine: &Engine) -> Result<()> {
        self.structure_by(engine, Pace::Aside).map(drop)
    }

    /// Its ray-tracing structure, built now if the engine does not have it yet.
    pub(super) fn structure_by(&self, engine: &Engine, pace: Pace) -> Result<CommittedScene> {
        let mut built = self.structure.built.lock().unwrap_or_else(PoisonError::into_inner);
        match &*built {
            Some(scene) if scene.is_of(engine.device()) => Ok(scene.clone()),
            _ => {
                let quality = if self.structure.changing { Quality::Low } else { Quality::Medium };
                let scene = mesh_scene(engine, self, quality, None, pace)?;
                Ok(built.insert(scene).clone())
            }
        }
    }
}

impl Scene {
    /// Builds the ray-tracing structure with all cores.
    ///
    /// # Errors
    /// Embree's: out of memory, library too old or too new.
    pub fn build(&self) -> Result<BuiltScene> {
        self.build_with(&Engine::new()?)
    }

    /// [`Scene::build`] with the threads of `engine`, which also scan the scene.
    ///
    /// # Errors
    /// As [`Scene::build`].
    pub fn build_with(&self, engine: &Engine) -> Result<BuiltScene> {
        let mut live = LiveScene::new(engine);
        live.add_scene(self)?;
        live.commit()
    }
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
        entry.live = Some(Arc::new(Live { object, timeline, bounds, place, moved: true, known: Known::default() }));
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
    /// [`ScanOptions::start_time`]: crate::ScanOptions::start_time
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
    /// As [`LiveScene::object`] and [`Mesh::new`]; a number of vertices that differs from the number before; a mesh
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
    pub(crate) fn set_look(
        &mut self,
        id: Option<ObjectId>,
        material: &Arc<Material>,
        look: Arc<Material>,
    ) -> Result<()> {
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
    pub(crate) fn unfix(&mut self, id: ObjectId) -> Result<()> {
        self.slot(id)?;
        self.detach(id);
        Ok(())
    }

    /// Applies the world transform `moved` to an object and to all of its motion.
    ///
    /// # Errors
    /// As [`LiveScene::set_pose`].
    pub(crate) fn move_by(&mut self, id: ObjectId, moved: &DAffine3) -> Result<()> {
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
    pub(crate) fn add_model(
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

    /// An unused number for another instance.
    pub(crate) fn next_instance(&self) -> u32 {
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

    /// Builds what has changed and returns the current scene, to be scanned.
    ///
    /// # Errors
    /// Embree's: out of memory.
    pub fn commit(&mut self) -> Result<BuiltScene> {
        if let Some(built) = &self.built {
            return Ok(built.clone());
        }
        let built = self.build()?;
        self.built = Some(built.clone());
        Ok(built)
    }

    fn build(&mut self) -> Result<BuiltScene> {
        let origin = match self.origin {
            Some(origin) => origin,
            // Without objects there is nothing to choose from.
            None if self.lives().next().is_none() => DVec3::ZERO,
            None => *self.origin.insert(local_origin(&self.slots)),
        };
        let fixed = match self.fixed.take() {
            Some(fixed) => fixed,
            None => {
                // The order of objects may depend on which are built together.
                self.surfaces = None;
                Arc::new(self.build_fixed(origin)?)
            }
        };
        let fixed = self.fixed.insert(fixed).clone();
        for live in self.slots.iter_mut().filter_map(|slot| slot.live.as_mut()).filter(|live| live.moved) {
            Arc::make_mut(live).follow(self.time.start);
        }
        let mut left = MOST_BYTES.saturating_sub(self.placed.values().map(PlacedObject::bytes).sum());
        for (slot, entry) in (0..).zip(&mut self.slots) {
            let Some(live) = &mut entry.live else { continue };
            if !live.place.is_together() && !self.placed.contains_key(&slot) {
                let placed = Arc::make_mut(live).place(&self.engine, origin, self.time, self.tolerance, left)?;
                left = left.saturating_sub(placed.bytes());
                if !placed.turned {
                    self.surfaces = None;
                }
                self.placed.insert(slot, placed);
            }
        }

        let order = || {
            let apart = lives(&self.slots).filter(|(_, live)| !live.place.is_together());
            let together =
                fixed.together.iter().filter_map(|&slot| Some((slot, self.slots[slot as usize].live.as_deref()?)));
            together.chain(apart)
        };
        let committed = if self.placed.is_empty() {
            fixed.scene.clone()
        } else {
            let mut top = embree4::Scene::new(self.engine.device(), Quality::Medium)?;
            top.attach_instance(&fixed.instance)?;
            for (slot, _) in order().skip(fixed.together.len()) {
                match &self.placed[&slot].thing {
                    EmbreeObject::Still(instance) | EmbreeObject::Resting(instance, _) => {
                        top.attach_instance(instance)?
                    }
                    EmbreeObject::Moving(custom, _) => top.attach_shape(custom)?,
                };
            }
            self.engine.commit(top, self.placed.len(), Pace::Now)?
        };
        let surfaces = match &self.surfaces {
            Some(surfaces) => surfaces.clone(),
            None => {
                let turned = |slot| self.placed.get(&slot).is_some_and(|placed| placed.turned);
                let look = |slot: u32, material: &Arc<Material>| {
                    let of = |slot| self.looks.get(&(slot, Arc::as_ptr(material) as usize));
                    of(Some(slot)).or_else(|| of(None)).map(|[_, look]| look.clone())
                };
                let looks = (!self.looks.is_empty()).then_some(&look as &dyn Fn(u32, &Arc<Material>) -> _);
                let objects = order().map(|(slot, live)| (slot, &live.object, turned(slot)));
                // Materials are those at the middle of a scan.
                let time = self.time.start + 0.5 * self.time.length;
                let mut surfaces = Surfaces::new(objects, looks, self.labels.clone(), time);
                let rows = |live: &Live| live.object.mesh.parts.len() as u32;
                let mut row = order().take(fixed.together.len()).map(|(_, live)| rows(live)).sum();
                surfaces.first_row.push(0);
                for (_, live) in order().skip(fixed.together.len()) {
                    surfaces.first_row.push(row);
                    row += rows(live);
                }
                Arc::new(surfaces)
            }
        };
        let (mut movers, mut resting) = (Vec::new(), Vec::new());
        for (slot, _) in order() {
            let (mover, rests) = match self.placed.get(&slot).map(|placed| &placed.thing) {
                None | Some(EmbreeObject::Still(_)) => (None, None),
                Some(EmbreeObject::Resting(_, driving)) => (None, Some(driving.clone())),
                Some(EmbreeObject::Moving(_, mover)) => (Some(mover.clone()), None),
            };
            movers.push(mover);
            resting.push(rests);
        }
        let moves = movers.iter().any(Option::is_some);
        let rests = resting.iter().any(Option::is_some);
        let normal_matrices = order().map(|(_, live)| normal_matrix(&live.object)).collect();
        let extents = order().map(|(_, live)| ObjectExtent::new(&live.object, live.bounds)).collect();
        let mut report = Report::default();
        warn_of_far_objects(&self.slots, origin, &mut report);
        let device = self.engine.device();
        let tables = Tables {
            engine: self.engine.clone(),
            committed,
            packet_width: device.packet_width(),
            origin,
            normal_matrices,
            extents,
            movers: if moves { movers } else { Vec::new() },
            resting: if rests { resting } else { Vec::new() },
            span: ((moves || rests) && self.time.length > 0.0).then_some(self.time),
            surfaces: surfaces.clone(),
            report,
            bodies: OnceLock::new(),
        };
        self.surfaces = Some(surfaces);
        for slot in &mut self.slots {
            if let Some(live) = slot.live.as_mut().filter(|live| live.moved) {
                Arc::make_mut(live).moved = false;
            }
        }
        Ok(BuiltScene(Arc::new(tables)))
    }

    /// Builds the fixed objects whose mesh is not shared in one scene; the others are placed like free ones.
    fn build_fixed(&mut self, origin: DVec3) -> Result<Fixed> {
        let mut uses: HashMap<*const Mesh, usize> = HashMap::new();
        for (_, live) in self.lives().filter(|(_, live)| !matches!(live.place, Attachment::Free)) {
            *uses.entry(Arc::as_ptr(&live.object.mesh)).or_default() += 1;
        }
        let mut scene = embree4::Scene::new(self.engine.device(), Quality::Medium)?;
        let (mut together, mut triangles) = (Vec::new(), 0);
        for (slot, live) in
            self.slots.iter_mut().enumerate().filter_map(|(slot, entry)| Some((slot, entry.live.as_mut()?)))
        {
            if matches!(live.place, Attachment::Free) {
                continue;
            }
            let live = Arc::make_mut(live);
            let Attachment::Fixed { together: is_together } = &mut live.place else { continue };
            let local_from_object = DAffine3::from_translation(-origin) * live.object.world_from_object;
            // An object scaled flat cannot be an instance: rays could not be transformed to its frame.
            *is_together =
                uses[&Arc::as_ptr(&live.object.mesh)] == 1 || !embree4::is_invertible(&columns(&local_from_object));
            if *is_together {
                self.placed.remove(&(slot as u32));
                together.push(slot as u32);
                triangles += live.object.mesh.triangle_count();
                attach(&mut scene, &self.engine, &live.object.mesh, live.object.mask, Some(&local_from_object))?;
            }
        }
        let scene = self.engine.commit(scene, triangles, Pace::Now)?;
        let instance = Instance::new(&scene, columns(&DAffine3::IDENTITY), u32::MAX)?;
        Ok(Fixed { together, scene, instance })
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

/// Attaches an object whose mesh is one of a sequence to a node, even if that does not move.
fn staged(object: Object, timeline: Option<Arc<Timeline>>) -> (Object, Option<Arc<Timeline>>) {
    if object.sequence.is_none() || timeline.is_some() {
        return (object, timeline);
    }
    let timeline = Timeline::standing(object.world_from_object);
    let motion = Motion { node: 0, node_from_object: DAffine3::IDENTITY, shape: None };
    (Object { motion: Some(motion), ..object }, Some(Arc::new(timeline)))
}

impl Attachment {
    fn is_together(&self) -> bool {
        matches!(self, Attachment::Fixed { together: true })
    }
}

fn lives(slots: &[Slot]) -> impl Iterator<Item = (u32, &Live)> {
    (0..).zip(slots).filter_map(|(slot, entry)| Some((slot, entry.live.as_deref()?)))
}

fn gone(id: ObjectId) -> Error {
    Error::invalid("object", format!("{:#x}", id.to_u64()), "objects of this scene that have not been removed")
}

fn check_pose(name: &str, bounds: Option<[[f32; 3]; 2]>, world_from_object: &DAffine3) -> Result<()> {
    let corners = corners(bounds.unwrap_or_default(), world_from_object);
    match corners.iter().find(|corner| !within_reach(corner)) {
        None if world_from_object.is_finite() => Ok(()),
        corner => Err(Error::invalid(
            format!("pose of object {name:?}"),
            corner.map_or("not finite".into(), |corner| format!("such that it reaches to {:?} m", corner.to_array())),
            "finite numbers, positions from -1e18 to 1e18 m",
        )),
    }
}

/// Label numbers that differ from those in the scene that the objects come from.
struct Renumbered {
    categories: HashMap<u32, u32>,
    parts: HashMap<u32, u32>,
}

impl Renumbered {
    /// Merges the names of categories, parts and materials from `other` into `labels`.
    fn absorbing(labels: &mut Labels, other: &Labels) -> Renumbered {
        labels.material.absorb(&other.material);
        let (categories, parts) = (labels.category.absorb(&other.category), labels.part.absorb(&other.part));
        let numbers = Renumbered { categories, parts };
        labels.las_class.extend(other.las_class.iter().map(|(&id, &class)| (numbers.category_of(id), class)));
        numbers
    }

    fn category(&self, object: &Object) -> u32 {
        self.category_of(object.category_id)
    }

    fn category_of(&self, id: u32) -> u32 {
        self.categories.get(&id).copied().unwrap_or(id)
    }

    fn parts(&self, object: &Object) -> Vec<u32> {
        object.part_ids.iter().map(|id| self.parts.get(id).copied().unwrap_or(*id)).collect()
    }
}

fn check_parts(mesh: &Mesh, part_ids: &[u32]) -> Result<()> {
    match mesh.parts.len() {
        parts if parts == part_ids.len() => Ok(()),
        parts => Err(Error::invalid("part numbers", part_ids.len(), format!("one for each part of the mesh, {parts}"))),
    }
}

/// Names an instance number, if both are given and it has no name yet.
fn name_instance(labels: &mut Labels, number: u32, name: &str) {
    if !name.is_empty() && labels.instance.name(number).is_none() {
        labels.instance.set(number, name);
    }
}

/// Gives the name of a material a number, if it has none yet.
fn name_material(labels: &mut Labels, material: &Material) {
    labels.material.numbered(&material.name);
}

impl Live {
    /// The deformation that it keeps at any pose: all but a skin, whose joints are in the world.
    fn own_shape(&self) -> Option<Arc<Deformation>> {
        self.object.motion.as_ref()?.shape.clone().filter(|shape| shape.skin.is_none())
    }

    /// Attaches it to the only node of `timeline`.
    fn hang(&mut self, timeline: Timeline, shape: Option<Arc<Deformation>>) {
        self.object.motion = Some(Motion { node: 0, node_from_object: DAffine3::IDENTITY, shape });
        self.timeline = Some(Arc::new(timeline));
    }

    /// Keeps the shapes known from `placed`, which is being replaced.
    fn remember(&mut self, placed: &PlacedObject) {
        if let EmbreeObject::Moving(_, mover) = &placed.thing {
            self.known.moments.extend_from_slice(mover.moments());
        }
    }

    /// Sets the pose at `time`, s, of an object that moves by itself.
    fn follow(&mut self, time: f64) {
        if let (Some(timeline), Some(motion)) = (&self.timeline, &self.object.motion) {
            self.object.world_from_object = timeline.world_from_node(motion.node, time) * motion.node_from_object;
        }
    }

    /// Places it individually for the span `time`, with its motion in at most `most_bytes`.
    fn place(
        &mut self,
        engine: &Engine,
        origin: DVec3,
        time: Span,
        tolerance: f64,
        most_bytes: usize,
    ) -> Result<PlacedObject> {
        let object = &self.object;
        let [start, end] = [time.start, time.start + time.length];
        let mut resting = None;
        if let (Some(timeline), Some(motion)) = (&self.timeline, &object.motion) {
            let rests = motion.shape.is_none()
                && object.sequence.is_none()
                && timeline.stays(motion.node, start, end)
                && timeline.is_visible(motion.node, start);
            let (timeline, motion, mesh) = (timeline.clone(), motion.clone(), object.mesh.clone());
            let (name, sequence) = (object.name.clone(), object.sequence.clone());
            let driving = DrivingMotion { name, timeline, motion, mesh, sequence, tolerance, origin };
            if !rests {
                let mover = Arc::new(Mover::new(engine, driving, time, &mut self.known, most_bytes)?);
                let custom = Custom::new(engine.device(), mover.clone(), object.mask)?;
                return Ok(PlacedObject { thing: EmbreeObject::Moving(custom, mover), turned: true });
            }
            resting = Some(Arc::new(driving));
        }
        let thing = |instance| match resting {
            Some(driving) => EmbreeObject::Resting(instance, driving),
            None => EmbreeObject::Still(instance),
        };
        let local_from_object = DAffine3::from_translation(-origin) * object.world_from_object;
        let matrix = columns(&local_from_object);
        if embree4::is_invertible(&matrix) {
            let of = object.mesh.structure_by(engine, Pace::Now)?;
            return Ok(PlacedObject { thing: thing(Instance::new(&of, matrix, object.mask)?), turned: true });
        }
        // Scaled flat, it gets a mesh of its own in world coordinates.
        let of = mesh_scene(engine, &object.mesh, Quality::Low, Some(&local_from_object), Pace::Now)?;
        let instance = Instance::new(&of, columns(&DAffine3::IDENTITY), object.mask)?;
        Ok(PlacedObject { thing: thing(instance), turned: false })
    }
}

fn mesh_scene(
    engine: &Engine,
    mesh: &Mesh,
    quality: Quality,
    transform: Option<&DAffine3>,
    pace: Pace,
) -> Result<CommittedScene> {
    let mut scene = embree4::Scene::new(engine.device(), quality)?;
    attach(&mut scene, engine, mesh, u32::MAX, transform)?;
    engine.commit(scene, mesh.triangle_count(), pace)
}

/// Adds the parts of `mesh` to `scene`, one geometry each.
fn attach(
    scene: &mut embree4::Scene,
    engine: &Engine,
    mesh: &Mesh,
    mask: u32,
    transform: Option<&DAffine3>,
) -> Result<()> {
    for part in &mesh.parts {
        let device = engine.device();
        let triangles = &part.triangles;
        let mesh = match transform {
            None => embree4::Mesh::new(device, part.positions.iter().copied(), triangles, mask)?,
            Some(transform) => {
                let positions = part
                    .positions
                    .iter()
                    .map(|p| transform.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array());
                embree4::Mesh::new(device, positions, triangles, mask)?
            }
        };
        scene.attach_mesh(&mesh)?;
    }
    Ok(())
}

/// Scenes within this distance of the world's origin keep it as their own, so that coordinates stay as in the file: an
/// f32 step there is 0.06 mm.
const NEAR_ORIGIN_M: f64 = 1000.0;

/// Farther from the scene's origin than this, coordinates lose more than half a millimetre.
const FAR_M: f64 = 8192.0;

/// Objects that have a box, and its corners in the world.
fn boxes(slots: &[Slot]) -> impl Iterator<Item = (&Live, [DVec3; 8])> {
    lives(slots).filter_map(|(_, live)| Some((live, corners(live.bounds?, &live.object.world_from_object))))
}

/// The world's origin where the scene is near it, else the place of the middle triangle, in whole metres: a stray
/// object far from all others does not pull it away.
fn local_origin(slots: &[Slot]) -> DVec3 {
    if boxes(slots).all(|(_, corners)| reach(&corners, DVec3::ZERO) <= NEAR_ORIGIN_M) {
        return DVec3::ZERO;
    }
    let weight = |live: &Live| live.object.mesh.triangle_count();
    let half = boxes(slots).map(|(live, _)| weight(live)).sum::<usize>() / 2;
    let middle = |axis: usize| {
        // The first and the last corner of a box are opposite.
        let centre = |corners: [DVec3; 8]| corners[0].midpoint(corners[7])[axis];
        let mut centres: Vec<_> = boxes(slots).map(|(live, corners)| (centre(corners), weight(live))).collect();
        centres.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut before = 0;
        let found = centres.iter().find(|(_, weight)| {
            before += weight;
            before > half
        });
        found.map_or(0.0, |(centre, _)| centre.round())
    };
    DVec3::new(middle(0), middle(1), middle(2))
}

/// Greatest coordinate of `corners` relative to `origin`, m.
fn reach(corners: &[DVec3; 8], origin: DVec3) -> f64 {
    corners.iter().map(|corner| (*corner - origin).abs().max_element()).fold(0.0, f64::max)
}

fn warn_of_far_objects(slots: &[Slot], origin: DVec3, report: &mut Report) {
    let moved = boxes(slots).filter(|(live, _)| live.moved);
    let far = moved.map(|(live, corners)| (live, reach(&corners, origin)));
    let farthest = far.filter(|(_, reach)| *reach > FAR_M).max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((live, reach)) = farthest {
        let km = reach / 1000.0;
        // Spacing of f32 numbers of this size.
        let step_mm = 1000.0 * 2f64.powi(reach.log2().floor() as i32 - 23);
        report.warn(format!(
            "object {:?} reaches {km:.0} km from the scene's origin at {:.0},{:.0},{:.0}: coordinates there are rounded to \
             {step_mm:.1} mm",
            live.object.name, origin.x, origin.y, origin.z,
        ));
    }
}

/// A transform in Embree's form: column by column, single precision.
fn columns(m: &DAffine3) -> [f32; 12] {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    std::array::from_fn(|k| columns[k / 3][k % 3] as f32)
}

/// The matrix from an object's normals to the world's, up to length (scaled to unit size against underflow).
fn normal_matrix(object: &Object) -> Mat3 {
    let cofactors = cofactors(&object.world_from_object.matrix3);
    let size = cofactors.x_axis.abs().max(cofactors.y_axis.abs()).max(cofactors.z_axis.abs()).max_element();
    let scale = if size > 0.0 { 1.0 / size } else { 0.0 };
    // A mirrored object's cofactors point its normals inwards; surfaces are two-sided, so this does not matter.
    (cofactors * scale).as_mat3()
}
