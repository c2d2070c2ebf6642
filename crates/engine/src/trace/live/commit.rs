//! From the objects of a scene to Embree's structure and the tables behind its ids.

use super::LiveScene;
use super::object::{Attachment, Live, Slot, lives};
use super::origin::{local_origin, warn_of_far_objects};
use super::placed::{EmbreeObject, PlacedObject};
use crate::scene::{Object, Scene};
use crate::trace::driving::MOST_BYTES;
use crate::trace::engine::embree_error;
use crate::trace::instances::ObjectExtent;
use crate::trace::structure::{TracedScenes, attach, columns};
use crate::trace::{BuiltScene, Engine, SharedSurfaces, Surfaces, Tables};
use embree4::{CommittedScene, Instance, Pace, Quality};
use glam::{DAffine3, DVec3, Mat3};
use ground::error::Result;
use ground::math::cofactors;
use ground::report::Report;
use model::Mesh;
use model::material::Material;
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

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

/// The fixed objects, built.
pub(super) struct FixedObjects {
    /// Slots of those built together, in the order of their geometries.
    together: Vec<u32>,
    scene: CommittedScene,
    /// That scene as an untransformed instance, so that other instances can be placed alongside it.
    instance: Instance,
}

/// What stands, built: the fixed objects and others beside them.
pub(super) struct StandingObjects {
    /// With their geometry ids.
    instances: Vec<(u32, Instance)>,
    scene: CommittedScene,
}

impl LiveScene {
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
        let origin = self.choose_origin();
        let fixed = self.fixed_objects(origin)?;
        self.place_others(origin)?;
        let structure = self.structure(&fixed)?;
        let surfaces = match self.surfaces.take() {
            Some(surfaces) => surfaces,
            None => Arc::new(SharedSurfaces::new(self.new_surfaces(&fixed))),
        };
        let movers = self.of_each(&fixed, |thing| match thing {
            EmbreeObject::Moving(_, mover) => Some(mover.clone()),
            EmbreeObject::Still(_) | EmbreeObject::Resting(..) => None,
        });
        let resting = self.of_each(&fixed, |thing| match thing {
            EmbreeObject::Resting(_, driving) => Some(driving.clone()),
            EmbreeObject::Still(_) | EmbreeObject::Moving(..) => None,
        });
        let may_move = !movers.is_empty() || !resting.is_empty();
        let mut report = Report::default();
        warn_of_far_objects(&self.slots, origin, &mut report);
        let order = || in_order(&self.slots, &fixed);
        let tables = Tables {
            engine: self.engine.clone(),
            structure,
            packet_width: self.engine.device().packet_width(),
            origin,
            normal_matrices: order().map(|(_, live)| normal_matrix(&live.object)).collect(),
            extents: order().map(|(_, live)| ObjectExtent::new(&live.object, live.bounds)).collect(),
            movers,
            resting,
            span: (may_move && self.time.length > 0.0).then_some(self.time),
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

    fn choose_origin(&mut self) -> DVec3 {
        match self.origin {
            Some(origin) => origin,
            // Without objects there is nothing to choose from.
            None if self.lives().next().is_none() => DVec3::ZERO,
            None => *self.origin.insert(local_origin(&self.slots)),
        }
    }

    /// The fixed objects, built now if they have changed.
    fn fixed_objects(&mut self, origin: DVec3) -> Result<Arc<FixedObjects>> {
        let fixed = match self.fixed.take() {
            Some(fixed) => fixed,
            None => {
                // The order of objects may depend on which are built together.
                self.surfaces = None;
                Arc::new(self.build_fixed(origin)?)
            }
        };
        Ok(self.fixed.insert(fixed).clone())
    }

    /// Builds the fixed objects whose mesh is not shared in one scene; the others are placed like free ones.
    fn build_fixed(&mut self, origin: DVec3) -> Result<FixedObjects> {
        let mut uses: HashMap<*const Mesh, usize> = HashMap::new();
        for (_, live) in self.lives().filter(|(_, live)| !matches!(live.place, Attachment::Free)) {
            *uses.entry(Arc::as_ptr(&live.object.mesh)).or_default() += 1;
        }
        let mut scene = embree4::Scene::new(self.engine.device(), Quality::Medium).map_err(embree_error)?;
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
        let instance = Instance::new(&scene, columns(&DAffine3::IDENTITY), u32::MAX).map_err(embree_error)?;
        Ok(FixedObjects { together, scene, instance })
    }

    /// Places the objects that are not built together, unless they are where they were.
    fn place_others(&mut self, origin: DVec3) -> Result<()> {
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
        Ok(())
    }

    /// What is traced. Geometry 0 is the fixed objects together, the others have the numbers of their order.
    fn structure(&mut self, fixed: &FixedObjects) -> Result<TracedScenes> {
        let (mut standing, mut moving) = (vec![(0, fixed.instance.clone())], Vec::new());
        for (id, (slot, _)) in (1..).zip(in_order(&self.slots, fixed).skip(fixed.together.len())) {
            match &self.placed[&slot].thing {
                EmbreeObject::Still(instance) | EmbreeObject::Resting(instance, _) => {
                    standing.push((id, instance.clone()));
                }
                EmbreeObject::Moving(custom, _) => moving.push((id, custom.clone())),
            }
        }
        let of_moving = (!moving.is_empty()).then(|| {
            let mut scene = embree4::Scene::new(self.engine.device(), Quality::Medium).map_err(embree_error)?;
            moving.iter().try_for_each(|(id, custom)| scene.attach_shape(custom, *id)).map_err(embree_error)?;
            self.engine.commit(scene, moving.len(), Pace::Now).map(|scene| (scene, moving.len()))
        });
        Ok(TracedScenes::new(self.standing(fixed, standing)?, of_moving.transpose()?))
    }

    /// The fixed objects alone, or together with others: that of the last commit, if they are the same.
    fn standing(&mut self, fixed: &FixedObjects, instances: Vec<(u32, Instance)>) -> Result<CommittedScene> {
        if instances.len() == 1 {
            self.standing = None;
            return Ok(fixed.scene.clone());
        }
        if let Some(known) = self.standing.as_ref().filter(|known| known.instances == instances) {
            return Ok(known.scene.clone());
        }
        let mut scene = embree4::Scene::new(self.engine.device(), Quality::Medium).map_err(embree_error)?;
        instances.iter().try_for_each(|(id, instance)| scene.attach_instance(instance, *id)).map_err(embree_error)?;
        let scene = self.engine.commit(scene, instances.len(), Pace::Now)?;
        self.standing = Some(Arc::new(StandingObjects { instances, scene: scene.clone() }));
        Ok(scene)
    }

    /// What the ids of hits mean.
    fn new_surfaces(&self, fixed: &FixedObjects) -> Surfaces {
        let turned = |slot| self.placed.get(&slot).is_some_and(|placed| placed.turned);
        let look = |slot: u32, material: &Arc<Material>| {
            let of = |slot| self.looks.get(&(slot, Arc::as_ptr(material) as usize));
            of(Some(slot)).or_else(|| of(None)).map(|[_, look]| look.clone())
        };
        let looks = (!self.looks.is_empty()).then_some(&look as &dyn Fn(u32, &Arc<Material>) -> _);
        let order = || in_order(&self.slots, fixed);
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
        surfaces
    }

    /// What `of` finds of each object; empty if it finds nothing of any.
    fn of_each<T>(&self, fixed: &FixedObjects, of: impl Fn(&EmbreeObject) -> Option<T>) -> Vec<Option<T>> {
        let all = in_order(&self.slots, fixed).map(|(slot, _)| of(&self.placed.get(&slot)?.thing));
        let all: Vec<Option<T>> = all.collect();
        if all.iter().any(Option::is_some) { all } else { Vec::new() }
    }
}

/// The objects in the order of their rows: those built together, then the others.
fn in_order<'s>(slots: &'s [Slot], fixed: &'s FixedObjects) -> impl Iterator<Item = (u32, &'s Live)> {
    let together = fixed.together.iter().filter_map(|&slot| Some((slot, slots[slot as usize].live.as_deref()?)));
    together.chain(lives(slots).filter(|(_, live)| !live.place.is_together()))
}

/// The matrix from an object's normals to the world's, up to length (scaled to unit size against underflow).
fn normal_matrix(object: &Object) -> Mat3 {
    let cofactors = cofactors(&object.world_from_object.matrix3);
    let size = cofactors.x_axis.abs().max(cofactors.y_axis.abs()).max(cofactors.z_axis.abs()).max_element();
    let scale = if size > 0.0 { 1.0 / size } else { 0.0 };
    // A mirrored object's cofactors point its normals inwards; surfaces are two-sided, so this does not matter.
    (cofactors * scale).as_mat3()
}
