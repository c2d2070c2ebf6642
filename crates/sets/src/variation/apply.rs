//! Applies rules to the scene of a sample.

use super::spot::{Patches, Point};
use super::{
    Align, MOST_PLACED, MoveRule, Otherwise, PlaceRule, PlaceSpec, RemoveRule, Rule, RuleTarget, SCALES, Spot,
    SwapRule, What,
};
use crate::assets::{Assets, ModelFile};
use crate::draw::{Address, Draws};
use crate::lock;
use crate::random::{Random, choose};
use crate::room::Solid;
use engine::scene::{Ancestor, LabelRules, Mesh, matches};
use engine::trace::{LiveScene, ObjectId};
use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::shown;
use model::material::Material;
use rand_distr::{Distribution as _, StandardUniform};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// An object of the scene of a sample.
#[derive(Clone, Debug)]
struct Thing {
    id: ObjectId,
    name: Arc<str>,
    category: Arc<str>,
    /// Its instance number; 0: none.
    number: u32,
    /// Its ancestor nodes in the scene's file; none for what a rule has placed.
    ancestors: Arc<[Ancestor]>,
    mesh: Arc<Mesh>,
    world_from_object: DAffine3,
    solid: Solid,
}

/// What groups objects: they are below the same node, or were placed as one instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Bond {
    Node(u32),
    Instance(u32),
    /// An object by itself.
    Object(ObjectId),
}

/// Objects that are changed as one.
#[derive(Clone, Debug)]
struct Group {
    name: Arc<str>,
    category: Arc<str>,
    /// Instance number of the first of them.
    number: u32,
    /// Their indices in the list of all things.
    members: Vec<usize>,
    solid: Solid,
}

/// The objects of a scene, and the surfaces that objects are placed on.
#[derive(Debug)]
pub(crate) struct Units {
    things: Vec<Arc<Thing>>,
    patches: Mutex<HashMap<(RuleTarget, u64), Arc<Patches>>>,
}

impl Units {
    /// The objects of `live`.
    pub fn new(live: &LiveScene) -> Units {
        let labels = live.labels();
        let categories: HashMap<u32, Arc<str>> =
            labels.category.iter().map(|(number, name)| (number, name.into())).collect();
        let things = live.objects().filter_map(|(id, object)| {
            let category = categories.get(&object.category_id).cloned().unwrap_or_default();
            Some(Arc::new(Thing {
                id,
                name: object.name.as_str().into(),
                category,
                number: object.instance_id,
                ancestors: object.ancestors.clone(),
                mesh: object.mesh.clone(),
                world_from_object: object.world_from_object,
                solid: solid_of(&object.mesh, &object.world_from_object)?,
            }))
        });
        Units { things: things.collect(), patches: Mutex::default() }
    }

    /// The objects that `target` matches.
    pub fn ids<'u>(&'u self, target: &'u RuleTarget) -> impl Iterator<Item = ObjectId> + 'u {
        self.things.iter().filter(|thing| thing.bond(target).is_some()).map(|thing| thing.id)
    }

    /// Names of the objects, for messages.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.things.iter().map(|thing| &*thing.name)
    }

    /// The surfaces of `target` in `live`.
    ///
    /// # Errors
    /// As [`Patches::new`].
    pub fn patches(&self, live: &LiveScene, target: &RuleTarget, steepest_deg: f64, key: &str) -> Result<Arc<Patches>> {
        let name = (target.clone(), steepest_deg.to_bits());
        if let Some(known) = lock(&self.patches).get(&name) {
            return Ok(known.clone());
        }
        let made = Arc::new(Patches::new(live, target, steepest_deg, key)?);
        Ok(lock(&self.patches).entry(name).or_insert(made).clone())
    }
}

/// An upright box around a mesh, with its heading.
fn solid_of(mesh: &Mesh, world_from_object: &DAffine3) -> Option<Solid> {
    let place = &world_from_object.matrix3;
    let axes = DMat3::from_rotation_z(heading(place));
    // If the mesh is upright, its own box has the same sides.
    let tilt = place.z_axis.truncate().length() + place.row(2).truncate().length();
    if tilt <= 1e-9 * place.z_axis.length() {
        return Solid::around(axes, model::corners(mesh.bounds()?, world_from_object).into_iter());
    }
    Solid::around(axes, mesh.world_points(world_from_object))
}

/// Direction of the x axis about z, rad.
fn heading(turned: &DMat3) -> f64 {
    let ahead = turned.x_axis;
    if ahead.truncate().length() > 1e-9 * ahead.length() { ahead.y.atan2(ahead.x) } else { 0.0 }
}

impl Thing {
    /// What groups it with others for `target`; `None` if that does not match it. An object pattern selects everything
    /// below the outermost node with a matching name; a category, everything below the outermost node that assigns it.
    fn bond(&self, target: &RuleTarget) -> Option<(Bond, Arc<str>)> {
        let fits = |pattern: &Option<String>, name: &str| pattern.as_ref().is_none_or(|it| matches(it, name));
        if !fits(&target.category, &self.category) {
            return None;
        }
        let is = |node: &&Ancestor| match &target.object {
            Some(pattern) => matches(pattern, &node.name),
            None => node.category.as_ref() == Some(&self.category),
        };
        if let Some(node) = self.ancestors.iter().find(is) {
            let name = if node.name.is_empty() { &self.name } else { &node.name };
            return Some((Bond::Node(node.node), name.clone()));
        }
        // Objects that are named individually are changed individually.
        let whole = self.ancestors.is_empty() || target.object.is_none();
        let bond = if whole && self.number != 0 { Bond::Instance(self.number) } else { Bond::Object(self.id) };
        fits(&target.object, &self.name).then(|| (bond, self.name.clone()))
    }
}

/// The scene of a sample while rules are applied to it.
pub(crate) struct SampleScene<'s> {
    pub live: LiveScene,
    things: Vec<Arc<Thing>>,
    /// Instances that are no longer where they were; neither are their surfaces.
    gone: HashSet<u32>,
    /// What was drawn.
    pub drawn: Vec<Value>,
    /// Warnings about objects that found no room.
    pub notes: Vec<String>,
    /// The scene that the sample starts from.
    base: (&'s LiveScene, &'s Units),
    assets: &'s Assets,
    labels: &'s LabelRules,
    /// Base folder of relative file names.
    folder: &'s Path,
}

impl<'s> SampleScene<'s> {
    pub fn new(
        base: (&'s LiveScene, &'s Units),
        assets: &'s Assets,
        labels: &'s LabelRules,
        folder: &'s Path,
    ) -> SampleScene<'s> {
        let (live, things) = (base.0.clone(), base.1.things.clone());
        let (gone, drawn, notes) = (HashSet::new(), Vec::new(), Vec::new());
        SampleScene { live, things, gone, drawn, notes, base, assets, labels, folder }
    }

    /// Applies `rule`, which is at `key` of the file; `models` are the files it names.
    ///
    /// # Errors
    /// A file that cannot be read; no room, if the rule is to fail then.
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

    /// The groups that `target` matches, each with its address.
    fn groups(&self, target: &RuleTarget, address: &Address) -> Vec<(Group, Address)> {
        let mut groups: Vec<Group> = Vec::new();
        let mut known: HashMap<Bond, usize> = HashMap::new();
        for (index, thing) in self.things.iter().enumerate() {
            let Some((bond, name)) = thing.bond(target) else { continue };
            let place = *known.entry(bond).or_insert(groups.len());
            if place == groups.len() {
                let (category, number, solid) = (thing.category.clone(), thing.number, thing.solid);
                groups.push(Group { name, category, number, members: Vec::new(), solid });
            }
            groups[place].members.push(index);
        }
        let mut seen: HashMap<Arc<str>, usize> = HashMap::new();
        let addressed = groups.into_iter().map(|mut group| {
            let corners = group.members.iter().flat_map(|&index| self.things[index].solid.corners());
            group.solid = Solid::around(group.solid.axes, corners).unwrap_or(group.solid);
            // Names may repeat.
            let count = seen.entry(group.name.clone()).or_default();
            *count += 1;
            let address = address.of(&group.name).at(*count - 1);
            (group, address)
        });
        addressed.collect()
    }

    fn remove(&mut self, rule: &RemoveRule, name: &str, address: &Address) -> Result<()> {
        let mut left = HashSet::new();
        for (group, address) in self.groups(&rule.remove, address) {
            if happens(&rule.chance, &address) {
                self.note(name, &group.name, Map::new());
                left.extend(group.members);
            }
        }
        self.take_away(&left)
    }

    /// Removes the things at these indices.
    fn take_away(&mut self, places: &HashSet<usize>) -> Result<()> {
        for &index in places {
            let thing = self.things[index].clone();
            self.live.remove(thing.id)?;
            self.gone.insert(thing.number);
        }
        let mut index = 0;
        self.things.retain(|_| {
            index += 1;
            !places.contains(&(index - 1))
        });
        Ok(())
    }

    fn swap(&mut self, rule: &SwapRule, name: &str, models: &[(PathBuf, f64)], address: &Address) -> Result<()> {
        let mut swapped = Vec::new();
        let mut places = HashSet::new();
        for (group, address) in self.groups(&rule.swap, address) {
            if !happens(&rule.chance, &address) {
                continue;
            }
            let model = self.model(models, &address)?;
            let scale = if rule.fit { group.solid.half.z / model.solid.half.z.max(1e-9) } else { 1.0 };
            let turned = DQuat::from_rotation_z(heading(&group.solid.axes));
            let (foot, own) = (group.solid.foot(), model.solid.foot() * scale);
            let placed = DAffine3::from_scale_rotation_translation(DVec3::splat(scale), turned, foot - turned * own);
            let mut values = Map::new();
            values.insert("model".into(), self.named(&model).into());
            self.note(name, &group.name, values);
            places.extend(group.members.iter().copied());
            swapped.push((group, model, placed));
        }
        self.take_away(&places)?;
        for (group, model, placed) in swapped {
            let category = Some(&*group.category).filter(|category| !category.is_empty());
            let number = if group.number == 0 { self.live.next_instance() } else { group.number };
            self.add(&model, &placed, (&group.name, number), category)?;
        }
        Ok(())
    }

    fn shift(&mut self, rule: &MoveRule, name: &str, key: &str, address: &Address) -> Result<()> {
        let patches = self.surfaces(rule.to.as_ref(), &format!("{key}.to.on"))?;
        for (group, address) in self.groups(&rule.moved, address) {
            if rule.chance.as_ref().is_some_and(|chance| !happens(chance, &address)) {
                continue;
            }
            let foot = group.solid.foot();
            let mut values = Map::new();
            let mut found = None;
            for attempt in 0..rule.tries {
                let address = address.at(attempt as usize);
                let by = rule.by_m.as_ref().map_or(DVec3::ZERO, |by| by.vector(&address.of("by_m")).into());
                let (turned, turn) = turn(rule.turn_deg.as_ref(), &address);
                let (scale, factor) = scale(rule.scale.as_ref(), key, &address)?;
                let point = match &rule.to {
                    Some(place) => place.draw(patches.as_deref(), &address.of("to")),
                    None => Some(Point { at: foot, normal: DVec3::Z, heading: 0.0, instance: None }),
                };
                let Some(point) = point else { continue };
                if point.instance.is_some_and(|number| self.gone.contains(&number)) {
                    continue;
                }
                let heading = if rule.to.is_some() && rule.to.as_ref().is_some_and(|place| place.along.is_some()) {
                    DQuat::from_rotation_z(point.heading - heading(&group.solid.axes))
                } else {
                    DQuat::IDENTITY
                };
                let mut target = Point { at: point.at + by, ..point };
                if rule.to.is_none() && (rule.clearance_m.is_some() || rule.align == Align::Slope) {
                    // It stays where it is now, on the ground there, which may slope.
                    let from = target.at + DVec3::Z * (2.0 * group.solid.half.z);
                    if let Some(below) = self.below(from, &group.members) {
                        target = Point { at: target.at, heading: target.heading, ..below };
                    }
                }
                let stands = rule.drop || rule.to.as_ref().is_some_and(|place| place.on.is_some());
                let about = |at: &Point| {
                    let things = group.members.iter().map(|&index| &self.things[index]);
                    let points = things.flat_map(|thing| thing.mesh.world_points(&thing.world_from_object));
                    stood(at, rule.align, [heading, turned], scale, foot, stands.then_some(points))
                };
                let settled = self.settled(&group.solid, target, rule.drop, &group.members, about);
                let Some((moved, point)) = settled else { continue };
                let solid = group.solid.moved(&moved);
                let members = &group.members;
                if rule.clearance_m.is_none_or(|free| self.has_room(&solid, free, rule.align, &point, members)) {
                    let position = moved.transform_point3(foot);
                    values.insert("moved_m".into(), json!((position - foot).to_array()));
                    record_placement(&mut values, position, &moved, (turned, turn), factor);
                    found = Some(moved);
                    break;
                }
            }
            match found {
                Some(moved) => self.move_group(&group.members, &moved)?,
                None => {
                    self.no_room(rule.otherwise, key, &group.name, rule.tries)?;
                    values.insert("skipped".into(), true.into());
                }
            }
            self.note(name, &group.name, values);
        }
        Ok(())
    }

    fn move_group(&mut self, members: &[usize], moved: &DAffine3) -> Result<()> {
        for &index in members {
            let thing = Arc::make_mut(&mut self.things[index]);
            self.live.move_by(thing.id, moved)?;
            thing.world_from_object = *moved * thing.world_from_object;
            thing.solid = thing.solid.moved(moved);
            self.gone.insert(thing.number);
        }
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
        let count = rule.count.whole(&address.of("count")).max(0);
        if count > MOST_PLACED as i64 {
            return Err(Error::invalid(format!("{key}.count"), count, format!("0 to {MOST_PLACED}")));
        }
        for number in 0..count as usize {
            let address = address.at(number);
            let model = self.model(models, &address)?;
            let stem = model.path.file_stem().unwrap_or_default().to_string_lossy();
            let called = format!("{}_{}", rule.call.as_deref().unwrap_or(&stem), number + 1);
            let mut values = Map::new();
            values.insert("model".into(), self.named(&model).into());
            let mut found = None;
            for attempt in 0..rule.tries {
                let address = address.at(attempt as usize);
                let (turned, turn) = turn(rule.turn_deg.as_ref(), &address);
                let (scale, factor) = scale(rule.scale.as_ref(), key, &address)?;
                let Some(point) = rule.at.draw(patches.as_deref(), &address.of("at")) else { continue };
                if point.instance.is_some_and(|number| self.gone.contains(&number)) {
                    continue;
                }
                // Its own origin, but at the height of its lowest corner.
                let foot = DVec3::Z * model.solid.foot().z;
                let stands = rule.drop || rule.at.on.is_some();
                let about = |at: &Point| {
                    let heading = DQuat::from_rotation_z(at.heading);
                    stood(at, rule.align, [heading, turned], scale, foot, stands.then(|| model.scene.world_points()))
                };
                let settled = self.settled(&model.solid, point, rule.drop, &[], about);
                let Some((placed, point)) = settled else { continue };
                let solid = model.solid.moved(&placed);
                if rule.overlap || self.has_room(&solid, rule.clearance_m, rule.align, &point, &[]) {
                    record_placement(&mut values, placed.transform_point3(foot), &placed, (turned, turn), factor);
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
                    self.no_room(rule.otherwise, key, &called, rule.tries)?;
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
            let Some(point) = patches.draw(spot.within.as_ref(), &address.of("on")) else { continue };
            if point.instance.is_some_and(|number| self.gone.contains(&number)) {
                continue;
            }
            let height = spot.height_m.as_ref().map_or(0.0, |height| height.number(&address.of("height_m")));
            let position = point.at + DVec3::Z * height;
            let (turned, turn) = turn(spot.turn_deg.as_ref(), &address);
            let room = Solid { centre: position, axes: DMat3::IDENTITY, half: DVec3::splat(spot.clearance_m) };
            if spot.clearance_m == 0.0 || self.is_free(&room, None, &[]) {
                let mut values = Map::new();
                values.insert("position_m".into(), json!(position.to_array()));
                values.extend(turn.map(|turn| ("turn_deg".to_owned(), turn)));
                self.note(KEY, KEY, values);
                return Ok(Pose { position, orientation: aligned(spot.align, point.normal) * turned });
            }
        }
        let found = format!("no place with {:.3} m of clearance in {} tries", spot.clearance_m, spot.tries);
        Err(Error::invalid(KEY, found, "a smaller clearance_m, more tries, other surfaces, a larger box"))
    }

    fn look(&mut self, rule: &super::LookRule, name: &str, address: &Address) -> Result<()> {
        // By name of the material, each material once.
        let mut used: BTreeMap<&str, Vec<&Arc<Material>>> = BTreeMap::new();
        let parts = self.things.iter().flat_map(|thing| &thing.mesh.parts);
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
                        // Materials of one name look the same.
                        drawn.extend((k == 0).then(|| ((*known).to_owned(), values)));
                    }
                }
            }
            Some(target) => {
                for (group, address) in self.groups(target, address) {
                    let things = || group.members.iter().map(|&index| &self.things[index]);
                    let own: HashSet<*const Material> = things()
                        .flat_map(|thing| &thing.mesh.parts)
                        .filter_map(|part| part.material.as_ref().map(Arc::as_ptr))
                        .collect();
                    for material in used.values().flatten().filter(|material| own.contains(&Arc::as_ptr(material))) {
                        let mut values = Vec::new();
                        let look =
                            Arc::new(rule.of_material(material, &address.of(&material.name), open, &mut values)?);
                        drawn.push((format!("{}: {}", group.name, material.name), values));
                        looks.extend(things().map(|thing| (Some(thing.id), (*material).clone(), look.clone())));
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

    /// Adds a model as an instance.
    fn add(
        &mut self,
        model: &ModelFile,
        world_from_model: &DAffine3,
        (name, number): (&str, u32),
        category: Option<&str>,
    ) -> Result<()> {
        let ids = self.live.add_model(&model.scene, world_from_model, (name, number), category)?;
        let own = |number: u32| model.scene.labels.category.name(number).unwrap_or_default();
        for (object, id) in model.scene.objects.iter().zip(ids) {
            let world_from_object = *world_from_model * object.world_from_object;
            let Some(solid) = solid_of(&object.mesh, &world_from_object) else { continue };
            self.things.push(Arc::new(Thing {
                id,
                name: name.into(),
                category: category.unwrap_or_else(|| own(object.category_id)).into(),
                number,
                ancestors: Arc::default(),
                mesh: object.mesh.clone(),
                world_from_object,
                solid,
            }));
        }
        Ok(())
    }

    /// One of the models, drawn by weight.
    fn model(&self, models: &[(PathBuf, f64)], address: &Address) -> Result<Arc<ModelFile>> {
        self.assets.model(choose::<PathBuf>(models, &address.of("model")), self.labels)
    }

    /// Path of a model relative to the scenario's folder, wherever that is.
    fn named(&self, model: &ModelFile) -> String {
        shown::path(model.path.strip_prefix(self.folder).unwrap_or(&model.path))
    }

    fn surfaces(&self, place: Option<&PlaceSpec>, key: &str) -> Result<Option<Arc<Patches>>> {
        let Some(PlaceSpec { on: Some(target), steepest_deg, .. }) = place else { return Ok(None) };
        self.base.1.patches(self.base.0, target, *steepest_deg, key).map(Some)
    }

    /// How an object with the box `solid` is moved by `about` to `point` or, if it drops, onto what is below; and where
    /// it then stands. `None` if there is nothing below.
    fn settled(
        &self,
        solid: &Solid,
        point: Point,
        drop: bool,
        except: &[usize],
        about: impl Fn(&Point) -> DAffine3,
    ) -> Option<(DAffine3, Point)> {
        if !drop {
            return Some((about(&point), point));
        }
        let from = point.at.with_z(solid.moved(&about(&point)).top());
        let point = Point { heading: point.heading, ..self.below(from, except)? };
        Some((about(&point), point))
    }

    /// The place on the highest surface below `from`, ignoring the things at `except`.
    fn below(&self, from: DVec3, except: &[usize]) -> Option<Point> {
        let near = |thing: &Thing| {
            let reach = thing.solid.half.length();
            (thing.solid.centre - from).truncate().length() <= reach && thing.solid.centre.z - reach <= from.z
        };
        let others = self.things.iter().enumerate().filter(|(index, thing)| near(thing) && !except.contains(index));
        let found = others.filter_map(|(_, thing)| {
            let (z, normal) = self.assets.room.below(&thing.mesh, &thing.world_from_object, from)?;
            Some(Point { at: from.with_z(z), normal, heading: 0.0, instance: Some(thing.number) })
        });
        found.max_by(|a, b| a.at.z.total_cmp(&b.at.z))
    }

    /// Whether an object with the box `solid` that stands at `point` has a clearance of `free` m, ignoring the things
    /// at `except`. It may reach only into what it stands on, and only as far as an upright box on a slope must.
    fn has_room(&self, solid: &Solid, free: f64, align: Align, point: &Point, except: &[usize]) -> bool {
        let [level, sloping] = [Align::Slope, align].map(|align| solid.widened(free, lift(solid, align, point.normal)));
        self.is_free(&level, point.instance.map(|ground| (ground, &sloping)), except)
    }

    /// Whether nothing reaches into `solid`, ignoring the things at `except`; the instance `ground` is tested with a
    /// box of its own.
    fn is_free(&self, solid: &Solid, ground: Option<(u32, &Solid)>, except: &[usize]) -> bool {
        !self.things.iter().enumerate().any(|(index, thing)| {
            let solid = ground.filter(|(number, _)| *number == thing.number).map_or(solid, |(_, own)| own);
            thing.solid.meets(solid)
                && !except.contains(&index)
                && self.assets.room.meets(&thing.mesh, &thing.world_from_object, solid)
        })
    }

    fn no_room(&mut self, otherwise: Otherwise, key: &str, object: &str, tries: u32) -> Result<()> {
        match otherwise {
            Otherwise::Skip => {
                self.notes.push(format!("{key}: no room for {object:?} in {tries} tries: left out"));
                Ok(())
            }
            Otherwise::Fail => Err(Error::invalid(
                key,
                format!("a rule that finds no room for {object:?} in {tries} tries"),
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

/// A drawn rotation: about z, or roll, pitch and yaw; and the drawn value.
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

/// Placement of an object that stands on its `foot` at `point`, with its `heading` and the rotation `turned`. If its
/// `points` are given and it is tipped over, it is raised until the lowest of them is level with `point`.
fn stood(
    point: &Point,
    align: Align,
    [heading, turned]: [DQuat; 2],
    scale: DVec3,
    foot: DVec3,
    points: Option<impl Iterator<Item = DVec3>>,
) -> DAffine3 {
    let up = aligned(align, point.normal);
    let placed = DAffine3::from_translation(point.at)
        * DAffine3::from_scale_rotation_translation(scale, up * heading * turned, DVec3::ZERO)
        * DAffine3::from_translation(-foot);
    let turned_over = (turned * DVec3::Z).z < 1.0 - 1e-12;
    match points.filter(|_| turned_over) {
        Some(points) => {
            let up = up * DVec3::Z;
            let lowest = points.map(|point| placed.transform_point3(point).dot(up)).fold(f64::INFINITY, f64::min);
            DAffine3::from_translation(up * (point.at.dot(up) - lowest)) * placed
        }
        None => placed,
    }
}

/// Records where and how an object is `placed`; the whole orientation only if a slope or a line has changed it from the
/// drawn one.
fn record_placement(
    values: &mut Map<String, Value>,
    position: DVec3,
    placed: &DAffine3,
    (turned, turn): (DQuat, Option<Value>),
    factor: Option<Value>,
) {
    let (_, whole, _) = placed.to_scale_rotation_translation();
    let as_drawn = whole.dot(turned).abs() >= 1.0 - 1e-12;
    values.insert("position_m".into(), json!(position.to_array()));
    values.extend(turn.map(|turn| ("turn_deg".to_owned(), turn)));
    values.extend((!as_drawn).then(|| ("orientation_xyzw".to_owned(), json!(whole.to_array()))));
    values.extend(factor.map(|factor| ("scale".to_owned(), factor)));
}

/// A drawn scale: one factor, or one for each axis; and the drawn value.
///
/// # Errors
/// A factor out of range: some distributions are unbounded.
fn scale(random: Option<&Random>, key: &str, address: &Address) -> Result<(DVec3, Option<Value>)> {
    let Some(random) = random else { return Ok((DVec3::ONE, None)) };
    let value = random.draw(&address.of("scale"));
    let factor = |k: usize| value.get(k).and_then(Value::as_f64).unwrap_or(1.0);
    let factors = value.as_f64().map_or_else(|| DVec3::new(factor(0), factor(1), factor(2)), DVec3::splat);
    let [low, high] = SCALES;
    if !factors.to_array().iter().all(|factor| (low..=high).contains(factor)) {
        return Err(Error::invalid(format!("{key}.scale"), value, format!("{low:e} to {high:e}")));
    }
    Ok((factors, Some(value)))
}

/// Rotates z to the upright direction of an object.
fn aligned(align: Align, normal: DVec3) -> DQuat {
    match align {
        Align::Up => DQuat::IDENTITY,
        Align::Slope => DQuat::from_rotation_arc(DVec3::Z, normal),
    }
}

/// How far the lowest part of a box may reach into the ground that it stands on: the lower edges of an upright box on a
/// slope do so.
fn lift(solid: &Solid, align: Align, normal: DVec3) -> f64 {
    /// Even on level ground.
    const LEAST_M: f64 = 0.02;
    let slope = match align {
        Align::Slope => 0.0,
        Align::Up => normal.truncate().length() / normal.z.max(1e-3),
    };
    LEAST_M + slope * solid.half.truncate().length()
}
