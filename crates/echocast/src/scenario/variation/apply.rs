//! Rules at work on the scene of a sample.

use super::room::Solid;
use super::spot::{Patches, Point};
use super::{Align, MoveRule, Otherwise, Place, PlaceRule, RemoveRule, Rule, Spot, SwapRule, Target, What};
use crate::ground::error::{Error, Result};
use crate::ground::pose::Pose;
use crate::ground::shown;
use crate::material::Material;
use crate::scenario::assets::{Assets, Model};
use crate::scenario::draw::{Address, Draws};
use crate::scenario::random::{Random, choose};
use crate::scene::{LabelRules, Mesh, matches};
use crate::trace::{LiveScene, ObjectId};
use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};
use rand_distr::{Distribution as _, StandardUniform};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// What is moved as one: the objects of an instance.
#[derive(Clone, Debug)]
pub(in crate::scenario) struct Unit {
    name: String,
    /// Names of its objects.
    names: Vec<String>,
    category: String,
    /// Its instance number; 0: none.
    number: u32,
    things: Vec<Thing>,
    solid: Solid,
}

#[derive(Clone, Debug)]
struct Thing {
    id: ObjectId,
    mesh: Arc<Mesh>,
    world_from_object: DAffine3,
}

/// The units of a scene, and the surfaces that things are placed on.
#[derive(Debug)]
pub(in crate::scenario) struct Units {
    units: Vec<Arc<Unit>>,
    patches: Mutex<HashMap<(Target, u64), Arc<Patches>>>,
}

impl Units {
    /// Those of `live`.
    pub fn new(live: &LiveScene) -> Units {
        let mut units: Vec<Unit> = Vec::new();
        let mut known: HashMap<u32, usize> = HashMap::new();
        for (id, object) in live.objects() {
            let thing = Thing { id, mesh: object.mesh.clone(), world_from_object: object.world_from_object };
            let place = known.get(&object.instance_id).copied().filter(|_| object.instance_id != 0);
            let Some(place) = place else {
                known.insert(object.instance_id, units.len());
                units.push(Unit {
                    name: object.name.clone(),
                    names: vec![object.name.clone()],
                    category: live.labels().category.name(object.category_id).unwrap_or("").to_owned(),
                    number: object.instance_id,
                    things: vec![thing],
                    solid: Solid { centre: DVec3::ZERO, axes: DMat3::IDENTITY, half: DVec3::ZERO },
                });
                continue;
            };
            units[place].names.push(object.name.clone());
            units[place].things.push(thing);
        }
        let units = units.into_iter().filter_map(|mut unit| {
            unit.solid = unit.measured()?;
            Some(Arc::new(unit))
        });
        Units { units: units.collect(), patches: Mutex::default() }
    }

    /// The objects that `target` names.
    pub fn ids<'u>(&'u self, target: &'u Target) -> impl Iterator<Item = ObjectId> + 'u {
        self.units.iter().filter(|unit| unit.is(target)).flat_map(|unit| unit.things.iter().map(|thing| thing.id))
    }

    /// What units are called, for messages.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.units.iter().map(|unit| unit.name.as_str())
    }

    /// The surfaces of `target` in `live`.
    ///
    /// # Errors
    /// As [`Patches::new`].
    pub fn patches(&self, live: &LiveScene, target: &Target, steepest_deg: f64, key: &str) -> Result<Arc<Patches>> {
        let lock = || self.patches.lock().unwrap_or_else(PoisonError::into_inner);
        let name = (target.clone(), steepest_deg.to_bits());
        if let Some(known) = lock().get(&name) {
            return Ok(known.clone());
        }
        let made = Arc::new(Patches::new(live, target, steepest_deg, key)?);
        Ok(lock().entry(name).or_insert(made).clone())
    }
}

impl Unit {
    fn is(&self, target: &Target) -> bool {
        let names = std::iter::once(self.name.as_str()).chain(self.names.iter().map(String::as_str));
        target.takes(names, &self.category)
    }

    /// An upright box around it, turned as its first object is.
    fn measured(&self) -> Option<Solid> {
        let ahead = self.things.first()?.world_from_object.matrix3.x_axis;
        let axes = DMat3::from_rotation_z(if ahead.truncate().length() > 1e-9 { ahead.y.atan2(ahead.x) } else { 0.0 });
        let corners = self
            .things
            .iter()
            .filter_map(|thing| Some(crate::scene::corners(thing.mesh.bounds()?, &thing.world_from_object)));
        Solid::around(axes, corners.flatten())
    }

    /// Direction of its box about z, rad.
    fn heading(&self) -> f64 {
        let ahead = self.solid.axes.x_axis;
        ahead.y.atan2(ahead.x)
    }
}

/// The scene of a sample while rules are applied to it.
pub(in crate::scenario) struct Stand<'s> {
    pub live: LiveScene,
    units: Vec<Arc<Unit>>,
    /// Instances that are no longer where they were, with their surfaces.
    gone: HashSet<u32>,
    /// What was drawn.
    pub drawn: Vec<Value>,
    /// What found no room.
    pub notes: Vec<String>,
    /// The scene that the sample starts from.
    base: (&'s LiveScene, &'s Units),
    assets: &'s Assets,
    labels: &'s LabelRules,
    /// Where relative names of files start.
    folder: &'s Path,
}

impl<'s> Stand<'s> {
    pub fn new(
        base: (&'s LiveScene, &'s Units),
        assets: &'s Assets,
        labels: &'s LabelRules,
        folder: &'s Path,
    ) -> Stand<'s> {
        let (live, units) = (base.0.clone(), base.1.units.clone());
        let (gone, drawn, notes) = (HashSet::new(), Vec::new(), Vec::new());
        Stand { live, units, gone, drawn, notes, base, assets, labels, folder }
    }

    /// Applies `rule`, the one at `key` of the file; `models` are the files it names.
    ///
    /// # Errors
    /// A file that cannot be read, no room where that is to fail.
    pub fn apply(&mut self, rule: &Rule, key: &str, models: &[(PathBuf, f64)], draws: &Draws) -> Result<()> {
        let address = draws.of(&rule.name);
        match &rule.what {
            What::Set(_) => Ok(()),
            What::Remove(it) => self.remove(it, &rule.name, &address),
            What::Swap(it) => self.swap(it, &rule.name, models, &address),
            What::Move(it) => self.shift(it, &rule.name, key, &address),
            What::Place(it) => self.place(it, &rule.name, key, models, &address),
            What::Look(it) => self.look(it, &rule.name, &address),
        }
    }

    /// The places in `units` of those that `target` names, each with its address.
    fn targets(&self, target: &Target, address: &Address) -> Vec<(usize, Address)> {
        let mut seen: HashMap<&str, usize> = HashMap::new();
        let named = self.units.iter().enumerate().filter(|(_, unit)| unit.is(target));
        named
            .map(|(index, unit)| {
                // Names may repeat.
                let count = seen.entry(&unit.name).or_default();
                *count += 1;
                (index, address.of(&unit.name).at(*count - 1))
            })
            .collect()
    }

    fn remove(&mut self, rule: &RemoveRule, name: &str, address: &Address) -> Result<()> {
        let mut left = Vec::new();
        for (index, address) in self.targets(&rule.remove, address) {
            if happens(&rule.chance, &address) {
                self.note(name, &self.units[index].name.clone(), Map::new());
                left.push(index);
            }
        }
        self.take_away(&left)
    }

    /// Takes the units at these places away.
    fn take_away(&mut self, places: &[usize]) -> Result<()> {
        for &index in places {
            let unit = self.units[index].clone();
            unit.things.iter().try_for_each(|thing| self.live.remove(thing.id))?;
            self.gone.insert(unit.number);
        }
        let mut index = 0;
        self.units.retain(|_| {
            index += 1;
            !places.contains(&(index - 1))
        });
        Ok(())
    }

    fn swap(&mut self, rule: &SwapRule, name: &str, models: &[(PathBuf, f64)], address: &Address) -> Result<()> {
        let mut swapped = Vec::new();
        for (index, address) in self.targets(&rule.swap, address) {
            if !happens(&rule.chance, &address) {
                continue;
            }
            let unit = self.units[index].clone();
            let model = self.model(models, &address)?;
            let scale = if rule.fit { unit.solid.half.z / model.solid.half.z.max(1e-9) } else { 1.0 };
            let turned = DQuat::from_rotation_z(unit.heading());
            let (foot, own) = (unit.solid.foot(), model.solid.foot() * scale);
            let placed = DAffine3::from_scale_rotation_translation(DVec3::splat(scale), turned, foot - turned * own);
            let mut values = Map::new();
            values.insert("model".into(), shown::path(&model.path).into());
            self.note(name, &unit.name, values);
            swapped.push((index, model, placed));
        }
        let places: Vec<usize> = swapped.iter().map(|(index, ..)| *index).collect();
        let units: Vec<Arc<Unit>> = places.iter().map(|&index| self.units[index].clone()).collect();
        self.take_away(&places)?;
        for ((_, model, placed), unit) in swapped.into_iter().zip(units) {
            let category = Some(unit.category.as_str()).filter(|category| !category.is_empty());
            let number = if unit.number == 0 { self.live.next_instance() } else { unit.number };
            self.add(&model, &placed, (&unit.name, number), category)?;
        }
        Ok(())
    }

    fn shift(&mut self, rule: &MoveRule, name: &str, key: &str, address: &Address) -> Result<()> {
        let patches = self.surfaces(rule.to.as_ref(), &format!("{key}.to.on"))?;
        for (index, address) in self.targets(&rule.moved, address) {
            if rule.chance.as_ref().is_some_and(|chance| !happens(chance, &address)) {
                continue;
            }
            let unit = self.units[index].clone();
            let foot = unit.solid.foot();
            let mut values = Map::new();
            let mut found = None;
            for attempt in 0..rule.tries {
                let address = address.at(attempt as usize);
                let by = rule.by_m.as_ref().map_or(DVec3::ZERO, |by| by.vector(&address.of("by_m")).into());
                let (turned, turn) = turn(rule.turn_deg.as_ref(), &address);
                let (scale, factor) = scale(rule.scale.as_ref(), &address);
                let point = match &rule.to {
                    Some(place) => place.draw(patches.as_deref(), &address.of("to")),
                    None => Point { at: foot, normal: DVec3::Z, heading: 0.0, instance: None },
                };
                if point.instance.is_some_and(|number| self.gone.contains(&number)) {
                    continue;
                }
                let heading = if rule.to.is_some() && rule.to.as_ref().is_some_and(|place| place.along.is_some()) {
                    DQuat::from_rotation_z(point.heading - unit.heading())
                } else {
                    DQuat::IDENTITY
                };
                let target = Point { at: point.at + by, ..point };
                let about = |at: &Point| {
                    let turned = aligned(rule.align, at.normal) * heading * turned;
                    DAffine3::from_translation(at.at)
                        * DAffine3::from_scale_rotation_translation(scale, turned, DVec3::ZERO)
                        * DAffine3::from_translation(-foot)
                };
                let settled = self.settled(&unit.solid, target, rule.drop, Some(index), about);
                let Some((moved, normal)) = settled else { continue };
                let lifted = lift(&unit.solid.moved(&moved), rule.align, normal);
                let is_free = rule
                    .clearance_m
                    .is_none_or(|free| self.is_free(&unit.solid.moved(&moved).widened(free, lifted), Some(index)));
                if is_free {
                    values.insert("moved_m".into(), json!((moved.transform_point3(foot) - foot).to_array()));
                    values.extend(turn.map(|turn| ("turn_deg".to_owned(), turn)));
                    values.extend(factor.map(|factor| ("scale".to_owned(), factor)));
                    found = Some(moved);
                    break;
                }
            }
            match found {
                Some(moved) => self.move_unit(index, &moved)?,
                None => {
                    self.no_room(rule.otherwise, key, &format!("{:?} finds no room", unit.name), rule.tries)?;
                    values.insert("skipped".into(), true.into());
                }
            }
            self.note(name, &unit.name, values);
        }
        Ok(())
    }

    fn move_unit(&mut self, index: usize, moved: &DAffine3) -> Result<()> {
        let unit = Arc::make_mut(&mut self.units[index]);
        for thing in &mut unit.things {
            self.live.move_by(thing.id, moved)?;
            thing.world_from_object = *moved * thing.world_from_object;
        }
        unit.solid = unit.solid.moved(moved);
        self.gone.insert(unit.number);
        Ok(())
    }

    fn place(
        &mut self,
        rule: &PlaceRule,
        name: &str,
        key: &str,
        models: &[(PathBuf, f64)],
        address: &Address,
    ) -> Result<()> {
        let patches = self.surfaces(Some(&rule.at), &format!("{key}.at.on"))?;
        let count = rule.count.whole(&address.of("count")).max(0) as usize;
        for number in 0..count {
            let address = address.at(number);
            let model = self.model(models, &address)?;
            let stem = model.path.file_stem().unwrap_or_default().to_string_lossy();
            let called = format!("{}_{}", rule.call.as_deref().unwrap_or(&stem), number + 1);
            let mut values = Map::new();
            values.insert("model".into(), shown::path(&model.path).into());
            let mut found = None;
            for attempt in 0..rule.tries {
                let address = address.at(attempt as usize);
                let (turned, turn) = turn(rule.turn_deg.as_ref(), &address);
                let (scale, factor) = scale(rule.scale.as_ref(), &address);
                let point = rule.at.draw(patches.as_deref(), &address.of("at"));
                if point.instance.is_some_and(|number| self.gone.contains(&number)) {
                    continue;
                }
                // Its own origin, but as low as its lowest corner.
                let foot = DVec3::Z * model.solid.foot().z;
                let about = |at: &Point| {
                    let turned = aligned(rule.align, at.normal) * DQuat::from_rotation_z(at.heading) * turned;
                    DAffine3::from_translation(at.at)
                        * DAffine3::from_scale_rotation_translation(scale, turned, DVec3::ZERO)
                        * DAffine3::from_translation(-foot)
                };
                let settled = self.settled(&model.solid, point, rule.drop, None, about);
                let Some((placed, normal)) = settled else { continue };
                let solid = model.solid.moved(&placed);
                let lifted = lift(&solid, rule.align, normal);
                if rule.overlap || self.is_free(&solid.widened(rule.clearance_m, lifted), None) {
                    values.insert("position_m".into(), json!(placed.transform_point3(foot).to_array()));
                    values.extend(turn.map(|turn| ("turn_deg".to_owned(), turn)));
                    values.extend(factor.map(|factor| ("scale".to_owned(), factor)));
                    found = Some(placed);
                    break;
                }
            }
            match found {
                Some(placed) => {
                    let number = self.live.next_instance();
                    self.add(&model, &placed, (&called, number), rule.category.as_deref())?;
                }
                None => {
                    self.no_room(rule.otherwise, key, &format!("{called:?} finds no room"), rule.tries)?;
                    values.insert("skipped".into(), true.into());
                }
            }
            self.note(name, &called, values);
        }
        Ok(())
    }

    /// A pose for the carrier of the sensors.
    ///
    /// # Errors
    /// No such surfaces; no room on them.
    pub fn spot(&mut self, spot: &Spot, draws: &Draws) -> Result<Pose> {
        const KEY: &str = "trajectory";
        let address = draws.of(KEY);
        let patches = self.base.1.patches(self.base.0, &spot.on, spot.steepest_deg, "trajectory.on")?;
        for attempt in 0..spot.tries {
            let address = address.at(attempt as usize);
            let point = patches.draw(&address.of("on"));
            if point.instance.is_some_and(|number| self.gone.contains(&number)) {
                continue;
            }
            let height = spot.height_m.as_ref().map_or(0.0, |height| height.number(&address.of("height_m")));
            let position = point.at + DVec3::Z * height;
            let (turned, turn) = turn(spot.turn_deg.as_ref(), &address);
            let room = Solid { centre: position, axes: DMat3::IDENTITY, half: DVec3::splat(spot.clearance_m) };
            if spot.clearance_m == 0.0 || self.is_free(&room, None) {
                let mut values = Map::new();
                values.insert("position_m".into(), json!(position.to_array()));
                values.extend(turn.map(|turn| ("turn_deg".to_owned(), turn)));
                self.note(KEY, KEY, values);
                return Ok(Pose { position, orientation: aligned(spot.align, point.normal) * turned });
            }
        }
        let found = format!("no free place {:.3} m around in {} tries", spot.clearance_m, spot.tries);
        Err(Error::invalid(KEY, found, "a smaller clearance_m, more tries, other surfaces"))
    }

    fn look(&mut self, rule: &super::LookRule, name: &str, address: &Address) -> Result<()> {
        // By the name of the material; each once.
        let mut used: BTreeMap<&str, Vec<&Arc<Material>>> = BTreeMap::new();
        let parts = self.units.iter().flat_map(|unit| &unit.things).flat_map(|thing| &thing.mesh.parts);
        for material in parts.filter_map(|part| part.material.as_ref()).filter(|it| matches(&rule.look, &it.name)) {
            let alike = used.entry(&material.name).or_default();
            if !alike.iter().any(|known| Arc::ptr_eq(known, material)) {
                alike.push(material);
            }
        }
        let mut looks = Vec::new();
        let folder = self.folder;
        let assets = self.assets;
        let open = |file: &str| assets.image(&folder.join(file));
        let mut drawn = Vec::new();
        match &rule.of {
            None => {
                for (known, materials) in &used {
                    for (k, material) in materials.iter().enumerate() {
                        let mut values = Vec::new();
                        let look = rule.of_material(material, &address.of(known), open, &mut values)?;
                        looks.push((None, (*material).clone(), Arc::new(look)));
                        // Those of one name look the same.
                        drawn.extend((k == 0).then(|| ((*known).to_owned(), values)));
                    }
                }
            }
            Some(target) => {
                for (index, address) in self.targets(target, address) {
                    let unit = &self.units[index];
                    let own: HashSet<*const Material> = unit
                        .things
                        .iter()
                        .flat_map(|thing| &thing.mesh.parts)
                        .filter_map(|part| part.material.as_ref().map(Arc::as_ptr))
                        .collect();
                    for material in used.values().flatten().filter(|material| own.contains(&Arc::as_ptr(material))) {
                        let mut values = Vec::new();
                        let look =
                            Arc::new(rule.of_material(material, &address.of(&material.name), open, &mut values)?);
                        drawn.push((format!("{}: {}", unit.name, material.name), values));
                        looks.extend(
                            unit.things.iter().map(|thing| (Some(thing.id), (*material).clone(), look.clone())),
                        );
                    }
                }
            }
        }
        for (what, values) in drawn {
            let values = values.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
            self.note(name, &what, values);
        }
        looks.into_iter().try_for_each(|(id, material, look)| self.live.set_look(id, &material, look))
    }

    /// Adds a model as a unit of its own.
    fn add(
        &mut self,
        model: &Model,
        world_from_model: &DAffine3,
        (name, number): (&str, u32),
        category: Option<&str>,
    ) -> Result<()> {
        let ids = self.live.add_model(&model.scene, world_from_model, (name, number), category)?;
        let things = model.scene.objects.iter().zip(ids).map(|(object, id)| Thing {
            id,
            mesh: object.mesh.clone(),
            world_from_object: *world_from_model * object.world_from_object,
        });
        let own = || {
            let first = model.scene.objects.first()?;
            model.scene.labels.category.name(first.category_id).map(str::to_owned)
        };
        self.units.push(Arc::new(Unit {
            name: name.to_owned(),
            names: Vec::new(),
            category: category.map(str::to_owned).or_else(own).unwrap_or_default(),
            number,
            things: things.collect(),
            solid: model.solid.moved(world_from_model),
        }));
        Ok(())
    }

    /// One of the models, by their weights.
    fn model(&self, models: &[(PathBuf, f64)], address: &Address) -> Result<Arc<Model>> {
        self.assets.model(choose::<PathBuf>(models, &address.of("model")), self.labels)
    }

    fn surfaces(&self, place: Option<&Place>, key: &str) -> Result<Option<Arc<Patches>>> {
        let Some(Place { on: Some(target), steepest_deg, .. }) = place else { return Ok(None) };
        self.base.1.patches(self.base.0, target, *steepest_deg, key).map(Some)
    }

    /// How something with the box `solid` is moved to `point` by `about`; if it drops, to what is below that; and the normal of what
    /// it stands on. `None`: there is nothing below.
    fn settled(
        &self,
        solid: &Solid,
        point: Point,
        drop: bool,
        except: Option<usize>,
        about: impl Fn(&Point) -> DAffine3,
    ) -> Option<(DAffine3, DVec3)> {
        if !drop {
            return Some((about(&point), point.normal));
        }
        let from = point.at.with_z(solid.moved(&about(&point)).top());
        let (z, normal) = self.below(from, except)?;
        Some((about(&Point { at: point.at.with_z(z), normal, ..point }), normal))
    }

    /// Height of the highest surface below `from`, and its normal, except that of the unit at `except`.
    fn below(&self, from: DVec3, except: Option<usize>) -> Option<(f64, DVec3)> {
        let near = |unit: &Unit| {
            let reach = unit.solid.half.length();
            (unit.solid.centre - from).truncate().length() <= reach && unit.solid.centre.z - reach <= from.z
        };
        let others = self.units.iter().enumerate().filter(|(index, unit)| Some(*index) != except && near(unit));
        let things = others.flat_map(|(_, unit)| &unit.things);
        let found = things.filter_map(|thing| self.assets.room.below(&thing.mesh, &thing.world_from_object, from));
        found.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Whether nothing reaches into `solid`, except the unit at `except`.
    fn is_free(&self, solid: &Solid, except: Option<usize>) -> bool {
        let others = self.units.iter().enumerate().filter(|(index, _)| Some(*index) != except);
        !others.filter(|(_, unit)| unit.solid.meets(solid)).any(|(_, unit)| {
            unit.things.iter().any(|thing| self.assets.room.meets(&thing.mesh, &thing.world_from_object, solid))
        })
    }

    fn no_room(&mut self, otherwise: Otherwise, key: &str, what: &str, tries: u32) -> Result<()> {
        match otherwise {
            Otherwise::Skip => {
                self.notes.push(format!("{key}: {what} in {tries} tries: left out"));
                Ok(())
            }
            Otherwise::Fail => Err(Error::invalid(
                key,
                format!("{what} in {tries} tries"),
                "more tries, a smaller clearance_m, or `otherwise: skip`",
            )),
        }
    }

    fn note(&mut self, rule: &str, object: &str, values: Map<String, Value>) {
        let mut entry = Map::new();
        entry.insert("rule".into(), rule.into());
        entry.insert("object".into(), object.into());
        entry.extend(values);
        self.drawn.push(Value::Object(entry));
    }
}

fn happens(chance: &Random, address: &Address) -> bool {
    let unit: f64 = StandardUniform.sample(&mut address.of("whether").stream());
    unit < chance.number(&address.of("chance"))
}

/// A drawn turn: about z, or roll, pitch and yaw; and what was drawn.
fn turn(random: Option<&Random>, address: &Address) -> (DQuat, Option<Value>) {
    let Some(random) = random else { return (DQuat::IDENTITY, None) };
    let value = random.draw(&address.of("turn_deg"));
    let angle = |k: usize| value.get(k).and_then(Value::as_f64).unwrap_or(0.0).to_radians();
    let turned = match value.as_f64() {
        Some(yaw) => DQuat::from_rotation_z(yaw.to_radians()),
        None => DQuat::from_euler(EulerRot::ZYX, angle(2), angle(1), angle(0)),
    };
    (turned, Some(value))
}

/// A drawn size: one factor, or one for each axis; and what was drawn.
fn scale(random: Option<&Random>, address: &Address) -> (DVec3, Option<Value>) {
    let Some(random) = random else { return (DVec3::ONE, None) };
    let value = random.draw(&address.of("scale"));
    let factor = |k: usize| value.get(k).and_then(Value::as_f64).unwrap_or(1.0);
    let factors = value.as_f64().map_or_else(|| DVec3::new(factor(0), factor(1), factor(2)), DVec3::splat);
    (factors, Some(value))
}

/// Turns z to where things stand up.
fn aligned(align: Align, normal: DVec3) -> DQuat {
    match align {
        Align::Up => DQuat::IDENTITY,
        Align::Slope => DQuat::from_rotation_arc(DVec3::Z, normal),
    }
}

/// How much of the lowest part of a box may reach into the ground that it stands on: what is upright on a slope does so
/// by its lower edges.
fn lift(solid: &Solid, align: Align, normal: DVec3) -> f64 {
    /// Even on even ground.
    const LEAST_M: f64 = 0.02;
    let slope = match align {
        Align::Slope => 0.0,
        Align::Up => normal.truncate().length() / normal.z.max(1e-3),
    };
    LEAST_M + slope * solid.half.truncate().length()
}
