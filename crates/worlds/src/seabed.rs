//! A lake bed for sonar: sand, gravel and mud with boulders, wrecks, pipes, mines and sea grass on it, and a swarm of
//! fish above.

use super::bed::{Bed, Ground, Ripples, SOILS};
use super::glb::{Glb, Look, Placement, Primitive};
use super::model::{Model, ring, single};
use super::noise::Dice;
use super::shapes::{ClosedShape, direction};
use super::{GeneratedScene, within};
use glam::{DQuat, DVec2, DVec3, EulerRot};
use ground::builder;
use ground::error::{Error, Result};
use ground::rng::Draw;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

/// Triangles of a bed without a specified cell size, and their maximum number.
const USUAL_TRIANGLES: f64 = 30_000.0;
const MOST_TRIANGLES: f64 = 10e6;
/// Least number of cells per ripple: with fewer, the ripples alias.
const CELLS_PER_RIPPLE: f64 = 3.0;

builder! {
    /// Parameters of a lake bed. The water surface is at z = 0, the bed around z = -`depth_m`, centred on the z axis.
    ///
    /// Objects have the categories `seabed`, `boulder`, `wreck`, `pipe`, `mine`, `seagrass` and `fish`. The bed has the
    /// parts `sand`, `gravel` and `mud`, a boulder has `rock`, a wreck `hull`, `cabin` and `mast`, a pipe `pipe` and
    /// `joint`, a mine `mine` and `horn`. The fish are children of the node `Swarm`, which an animation moves along -x.
    /// The camera node `Sonar` is at the low end of x, 1 m below the surface (less in less than 4 m of water), and
    /// looks along x.
    ///
    /// Objects are smaller than usual if the water is shallow or the bed small, so that they stay below the surface and
    /// on the bed.
    #[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Seabed {
        /// Extent along x and y, 1 to 10 000 m.
        pub size_m: [f64; 2] = [60.0, 40.0],
        /// Mean depth of the bed below the surface, 0.5 to 11 000 m.
        pub depth_m: f64 = 12.0,
        /// Spacing of the grid. `None`: as fine as about 30 000 triangles allow, or as the requested `ripples` need.
        pub cell_m: Option<f64> = None,
        /// Ripples of the sand. `None`: those of [`Ripples::default`] if the cells are fine enough to show them, else
        /// none.
        pub ripples: Option<Ripples> = None,
        /// Boulders of 0.3 to 1.5 m, up to 10 000.
        pub boulders: u32 = 20,
        /// Sunken boats of 7 to 9 m, up to 100.
        pub wrecks: u32 = 1,
        /// Fish of about 0.4 m, up to 10 000.
        pub fish: u32 = 60,
        /// Pipes 0.3 to 0.8 m in diameter across the bed, up to 20.
        pub pipes: u32 = 0,
        /// Mines on the bed, up to 1000: in turn a cylinder of 2 m, a ball of 1 m with horns and a blunt cone of 1 m.
        pub mines: u32 = 0,
        /// Patches of sea grass of 2 to 5 m, up to 200; blades of 0.3 to 0.6 m.
        pub seagrass: u32 = 0,
    }
}

impl Seabed {
    /// Generates the scene.
    ///
    /// # Errors
    /// A parameter outside its range, more than 10 million triangles in the bed; the message names the field.
    pub fn scene(&self, seed: u64) -> Result<GeneratedScene> {
        let ground = self.ground()?;
        let [cells_x, cells_y] = ground.cells;
        let ripples = ground.ripples;
        let bed = Bed::new(ground, seed);
        let [low, high] = bed.height_range();
        let mut made = SeabedFile::default();
        made.add_bed(&bed);
        made.add_boulders(self, &bed, seed);
        made.add_wrecks(self, &bed, seed);
        made.add_pipes(self, &bed, seed);
        made.add_mines(self, &bed, seed);
        made.add_seagrass(self, &bed, seed);
        made.add_swarm(self, seed);
        let sonar = self.sonar();
        let camera = made.glb.camera("Sonar", Placement { at: sonar, ..Placement::HERE });
        made.glb.root(camera);

        let ripples = match ripples {
            Some(Ripples { wavelength_m, height_m, .. }) => format!("ripples {height_m} m high every {wavelength_m} m"),
            None => "no ripples".to_owned(),
        };
        let [x, y] = self.size_m;
        let mut details = vec![
            format!("bed of {x} x {y} m, {:.2} to {:.2} m deep, {cells_x} x {cells_y} cells, {ripples}", -high, -low),
            format!("camera Sonar at {},{},{} looking along x", sonar.x, sonar.y, sonar.z),
        ];
        details.extend(made.swimming);
        let too_large = |size: String| Error::invalid("cell_m", format!("too small for a GLB: {size}"), "larger cells");
        made.glb.finish(details).map_err(too_large)
    }

    /// Checks all parameters and divides the bed into cells.
    pub(super) fn ground(&self) -> Result<Ground> {
        for length in self.size_m {
            within("size_m", length, 1.0, 10_000.0)?;
        }
        within("depth_m", self.depth_m, 0.5, 11_000.0)?;
        within("boulders", self.boulders.into(), 0.0, 10_000.0)?;
        within("wrecks", self.wrecks.into(), 0.0, 100.0)?;
        within("fish", self.fish.into(), 0.0, 10_000.0)?;
        let highest = self.depth_m / 20.0;
        within("pipes", self.pipes.into(), 0.0, 20.0)?;
        within("mines", self.mines.into(), 0.0, 1000.0)?;
        within("seagrass", self.seagrass.into(), 0.0, 200.0)?;
        if let Some(Ripples { wavelength_m, height_m, direction_deg }) = self.ripples {
            within("ripples.direction_deg", direction_deg.unwrap_or(0.0), -360.0, 360.0)?;
            within("ripples.wavelength_m", wavelength_m, 0.01, 100.0)?;
            within("ripples.height_m", height_m, 0.0, highest.min(wavelength_m / 2.0))?;
        }

        let [x, y] = self.size_m;
        let requested = self.ripples.filter(|ripples| ripples.height_m > 0.0);
        let usual = (2.0 * x * y / USUAL_TRIANGLES).sqrt();
        // One cell more than needed: not all cells are as wide as requested.
        let for_ripples = requested.map_or(f64::INFINITY, |ripples| ripples.wavelength_m / (CELLS_PER_RIPPLE + 1.0));
        let cell = self.cell_m.unwrap_or(usual.min(for_ripples));
        let finest = finest_cell(x, y);
        if !(finest..=x.min(y)).contains(&cell) {
            let most = format!("a bed of {x} x {y} m has at most 10 million triangles");
            return Err(match requested {
                Some(ripples) if self.cell_m.is_none() => Error::invalid(
                    "ripples.wavelength_m",
                    ripples.wavelength_m,
                    format!("{:.3} or more: {most}", (CELLS_PER_RIPPLE + 1.0) * finest + 0.0005),
                ),
                _ => Error::invalid("cell_m", cell, format!("{:.4} to {}: {most}", finest + 0.00005, x.min(y))),
            });
        }
        let cells = [x, y].map(|length| (length / cell - 1e-9).ceil().max(1.0));
        let widest = (x / cells[0]).max(y / cells[1]);
        let shown = |ripples: &Ripples| CELLS_PER_RIPPLE * widest <= ripples.wavelength_m * (1.0 + 1e-9);
        if let Some(ripples) = requested.filter(|ripples| !shown(ripples)) {
            let allowed = format!("{:.3} or more, three cells of {widest:.3} m", CELLS_PER_RIPPLE * widest);
            return Err(Error::invalid("ripples.wavelength_m", ripples.wavelength_m, allowed));
        }
        let usual = Ripples { height_m: highest.min(Ripples::default().height_m), ..Ripples::default() };
        let natural = Some(usual).filter(|ripples| self.ripples.is_none() && shown(ripples));
        Ok(Ground {
            size: self.size_m,
            depth: self.depth_m,
            cells: cells.map(|cells| cells as usize),
            ripples: requested.or(natural),
        })
    }

    /// Scale, at most 1, of objects that at full size need `depth` m of water and a bed of `size` m.
    fn shrinkage(&self, depth: f64, size: f64) -> f64 {
        (self.depth_m / depth).min(self.size_m[0] / size).min(self.size_m[1] / size).min(1.0)
    }

    fn sonar(&self) -> DVec3 {
        DVec3::new(-self.size_m[0] / 2.0, 0.0, -(self.depth_m / 4.0).min(1.0))
    }
}

/// Smallest cell with which a bed of `x` times `y` m has at most [`MOST_TRIANGLES`]: the root c of 2 (x / c + 1) (y /
/// c + 1) = most, as one cell per side may be partial.
fn finest_cell(x: f64, y: f64) -> f64 {
    ((x + y) + ((x + y).powi(2) + 2.0 * (MOST_TRIANGLES - 2.0) * x * y).sqrt()) / (MOST_TRIANGLES - 2.0)
}

/// The file under construction.
#[derive(Default)]
struct SeabedFile {
    glb: Glb,
    /// What to report about the swarm.
    swimming: Option<String>,
    /// Materials of objects made from a [`Model`].
    materials: Vec<(&'static str, usize)>,
    /// Occupied circles: centre and radius.
    taken: Vec<(DVec2, f64)>,
}

/// Lambert's constant of a fish's skin, dB: with it, a fish 0.4 m long has, seen from above, about the target strength
/// of fish with a closed swim bladder at 38 kHz, 20 log10(L / cm) - 67.4 dB re 1 m^2 (Foote 1987, J. Acoust. Soc. Am.
/// 82).
pub(super) const FISH_MU_DB: f64 = -16.0;

/// Colours and reflectances are our own plausible choices. The sediments of the material key `sound` define how the
/// ground scatters sound.
fn material(glb: &mut Glb, name: &str) -> usize {
    let sediment = |name: &str| json!({ "law": "sediment", "name": name });
    let (color, reflectance, sound) = match name {
        "sand" => ([0.50, 0.38, 0.21], 0.25, sediment("medium_sand")),
        "gravel" => ([0.28, 0.26, 0.23], 0.2, sediment("sandy_gravel")),
        "mud" => ([0.10, 0.075, 0.045], 0.1, sediment("silt")),
        "rock" => ([0.19, 0.19, 0.20], 0.2, sediment("rock")),
        "hull" => ([0.22, 0.07, 0.03], 0.15, Value::Null),
        "cabin" => ([0.55, 0.55, 0.50], 0.4, Value::Null),
        "mast" => ([0.25, 0.16, 0.08], 0.25, Value::Null),
        "pipe" => ([0.16, 0.16, 0.15], 0.2, Value::Null),
        "joint" => ([0.10, 0.09, 0.08], 0.15, Value::Null),
        "mine" => ([0.07, 0.075, 0.07], 0.15, Value::Null),
        "horn" => ([0.30, 0.24, 0.12], 0.3, Value::Null),
        "blade" => ([0.05, 0.14, 0.03], 0.2, json!({ "law": "lambert", "mu_db": -20 })),
        _ => ([0.40, 0.46, 0.52], 0.3, json!({ "law": "lambert", "mu_db": FISH_MU_DB })),
    };
    let mut extras = json!({ "reflectance": reflectance });
    if sound != Value::Null {
        extras["sound"] = sound;
    }
    let look = if name == "blade" { Look::Sheet } else { Look::Matt };
    glb.material(name, look, color, extras)
}

impl SeabedFile {
    fn add_bed(&mut self, bed: &Bed) {
        let (positions, normals) = bed.vertices();
        let triangles = bed.triangles();
        let parts: Vec<Primitive> = SOILS
            .iter()
            .zip(&triangles)
            .map(|(name, triangles)| Primitive { triangles, material: material(&mut self.glb, name) })
            .collect();
        let mesh = self.glb.mesh("Seabed", &positions, Some(&normals), &parts);
        let node = self.glb.object("Seabed", "seabed", mesh, Placement::HERE);
        self.glb.root(node);
    }

    fn add_boulders(&mut self, seabed: &Seabed, bed: &Bed, seed: u64) {
        /// Number of shapes of boulders; rotated and stretched, all boulders differ.
        const SHAPES: u32 = 8;
        /// Random stream of the shapes, separate from those of the boulders.
        const SHAPE_DICE: u32 = 1 << 31;
        if seabed.boulders == 0 {
            return;
        }
        let rock = material(&mut self.glb, "rock");
        let shapes: Vec<(ClosedShape, usize)> = (0..SHAPES.min(seabed.boulders))
            .map(|number| {
                let shape = ClosedShape::rock(&mut Dice::new(seed, Draw::Boulder, SHAPE_DICE + number));
                let part = Primitive { triangles: &shape.triangles, material: rock };
                let mesh = self.glb.mesh(&format!("Boulder_{}", number + 1), &shape.positions(), None, &[part]);
                (shape, mesh)
            })
            .collect();
        let largest = 1.5 * seabed.shrinkage(4.0, 10.0);
        for number in 0..seabed.boulders {
            let mut dice = Dice::new(seed, Draw::Boulder, number);
            let (shape, mesh) = &shapes[number as usize % shapes.len()];
            // Log-uniform: as many between 0.3 and 0.6 m as between 0.6 and 1.2 m.
            let size = largest * f64::powf(0.2, dice.unit());
            let [x, y] = seabed.size_m.map(|length| dice.between(-0.5, 0.5) * (length - 2.0 * size));
            let (yaw, pitch, roll) = (dice.between(0.0, TAU), dice.between(-0.4, 0.4), dice.between(-0.4, 0.4));
            let mut place = Placement {
                at: DVec3::new(x, y, 0.0),
                turned: DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll),
                scale: DVec3::new(1.0, dice.between(0.7, 1.0), dice.between(0.5, 0.8)) * (size / 2.0),
            };
            let height = place.scale.z * 2.0;
            place.at.z = resting_height(bed, &shape.vertices, &place) - height * dice.between(0.15, 0.45);
            self.taken.push((place.at.truncate(), size / 2.0));
            let node = self.glb.object(&format!("Boulder_{:04}", number + 1), "boulder", *mesh, place);
            self.glb.root(node);
        }
    }

    fn add_wrecks(&mut self, seabed: &Seabed, bed: &Bed, seed: u64) {
        if seabed.wrecks == 0 {
            return;
        }
        let (boat, [hull, cabin]) = boat();
        let (below, rest) = boat.triangles.split_at(hull);
        let (above, top) = rest.split_at(cabin);
        let parts: Vec<Primitive> = [("hull", below), ("cabin", above), ("mast", top)]
            .map(|(name, triangles)| Primitive { triangles, material: material(&mut self.glb, name) })
            .into();
        let mesh = self.glb.mesh("Wreck", &boat.positions(), None, &parts);
        let usual = seabed.shrinkage(10.0, 20.0);
        let mut places: Vec<DVec3> = Vec::new();
        for number in 0..seabed.wrecks {
            let mut dice = Dice::new(seed, Draw::Wreck, number);
            let scale = usual * dice.between(0.8, 1.0);
            // Of several candidates, the one farthest from the other wrecks.
            let mut chance = || {
                let [x, y] = seabed.size_m.map(|length| dice.between(-0.5, 0.5) * (length - 10.0 * scale));
                DVec3::new(x, y, 0.0)
            };
            let farness = |at: &DVec3| places.iter().map(|other| at.distance(*other)).fold(f64::INFINITY, f64::min);
            let chances: [DVec3; 8] = std::array::from_fn(|_| chance());
            let at = chances.into_iter().reduce(|best, at| if farness(&at) > farness(&best) { at } else { best });
            let at = at.unwrap_or_default();
            let side = if dice.unit() < 0.5 { -1.0 } else { 1.0 };
            let (yaw, trim, heel) =
                (dice.between(0.0, TAU), dice.between(-0.08, 0.08), side * dice.between(0.12, 0.45));
            let lie = DQuat::from_rotation_arc(DVec3::Z, bed.normal(at.x, at.y, 8.0 * scale));
            let mut place = Placement {
                at,
                turned: (lie * DQuat::from_euler(EulerRot::ZYX, yaw, trim, heel)).normalize(),
                scale: DVec3::splat(scale),
            };
            place.at.z = resting_height(bed, &boat.vertices, &place) - scale * dice.between(0.4, 0.7);
            places.push(at);
            self.taken.push((at.truncate(), 4.5 * scale));
            let node = self.glb.object(&format!("Wreck_{:02}", number + 1), "wreck", mesh, place);
            self.glb.root(node);
        }
    }

    fn mesh(&mut self, name: &str, model: &Model) -> usize {
        let mut parts = Vec::new();
        for (part, triangles) in &model.parts {
            let known = self.materials.iter().find(|(known, _)| known == part).map(|(_, index)| *index);
            let material = known.unwrap_or_else(|| {
                let index = material(&mut self.glb, part);
                self.materials.push((part, index));
                index
            });
            parts.push(Primitive { triangles, material });
        }
        self.glb.mesh(name, &single(&model.vertices), None, &parts)
    }

    /// Distance of a position from the objects already on the bed, negative inside them.
    fn clearance(&self, at: DVec2) -> f64 {
        self.taken.iter().map(|(middle, radius)| at.distance(*middle) - radius).fold(f64::INFINITY, f64::min)
    }

    /// Of several candidates, the one farthest from all objects.
    fn free_place(&self, mut chance: impl FnMut() -> DVec2) -> DVec2 {
        const CHANCES: usize = 24;
        let mut best = chance();
        for _ in 1..CHANCES {
            let at = chance();
            if self.clearance(at) > self.clearance(best) {
                best = at;
            }
        }
        best
    }

    /// Pipes from one side of the bed to the other.
    fn add_pipes(&mut self, seabed: &Seabed, bed: &Bed, seed: u64) {
        /// Distances between rings of vertices, and between joints.
        const STEP: f64 = 0.8;
        const PIECE: f64 = 12.0;
        const SIDES: usize = 20;
        const CHANCES: usize = 16;
        /// Length and thickness of a joint, in radii.
        const JOINT: [f64; 2] = [1.5, 1.15];
        let scale = seabed.shrinkage(4.0, 10.0);
        for number in 0..seabed.pipes {
            let mut dice = Dice::new(seed, Draw::Pipe, number);
            let radius = scale * dice.between(0.15, 0.4);
            let axis = dice.below(2);
            let half = seabed.size_m[axis] / 2.0 - 2.0 * radius;
            let aside = seabed.size_m[1 - axis] / 2.0 - 2.0 * radius;
            let steps = (2.0 * half / (STEP * scale)).ceil().max(2.0) as u32;
            let along = |step: u32| half * (2.0 * f64::from(step) / f64::from(steps) - 1.0);
            let way = |[from, to, bend, phase]: [f64; 4], along: f64| {
                let part = (along / half + 1.0) / 2.0;
                let bent = (from + (to - from) * part + bend * (1.5 * PI * part + phase).sin()).clamp(-aside, aside);
                if axis == 0 { DVec2::new(along, bent) } else { DVec2::new(bent, along) }
            };
            // From end to end, with a bend in between; of several candidates, the one with the greatest clearance from
            // other objects.
            let ways: [[f64; 4]; CHANCES] = std::array::from_fn(|_| {
                let [from, to] = [0; 2].map(|_| dice.between(-0.85, 0.85) * aside);
                [from, to, dice.between(0.02, 0.06) * half, dice.between(0.0, TAU)]
            });
            let clear = |shape: &[f64; 4]| {
                (0..=steps).map(|step| self.clearance(way(*shape, along(step)))).fold(f64::INFINITY, f64::min)
            };
            let chosen = ways.into_iter().reduce(|best, shape| if clear(&shape) > clear(&best) { shape } else { best });
            let way = |along: f64| way(chosen.unwrap_or_default(), along);
            // A pipe is stiff: it follows the bed averaged over some metres, sunk in by a third.
            let height = |along: f64| {
                let near = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|step| {
                    let at = way((along + step * scale).clamp(-half, half));
                    bed.height(at.x, at.y)
                });
                near.iter().sum::<f64>() / near.len() as f64 + radius / 3.0
            };
            let place = |along: f64| way(along).extend(height(along));
            let mut model = Model::default();
            let line: Vec<(DVec3, f64)> = (0..=steps).map(|step| (place(along(step)), radius)).collect();
            model.tube("pipe", &line, SIDES);
            for joint in 1..(2.0 * half / (PIECE * scale)).ceil() as u32 {
                let middle = -half + PIECE * scale * f64::from(joint);
                let ends = [-0.5, 0.5].map(|side| (place(middle + side * JOINT[0] * radius), JOINT[1] * radius));
                model.tube("joint", &ends, SIDES);
            }
            self.taken.extend(line.iter().map(|(at, radius)| (at.truncate(), *radius)));
            let name = format!("Pipe_{:02}", number + 1);
            let mesh = self.mesh(&name, &model);
            let node = self.glb.object(&name, "pipe", mesh, Placement::HERE);
            self.glb.root(node);
        }
    }

    fn add_mines(&mut self, seabed: &Seabed, bed: &Bed, seed: u64) {
        if seabed.mines == 0 {
            return;
        }
        let kinds = [cylinder(), horned_ball(), blunt_cone()];
        let meshes: Vec<usize> = kinds
            .iter()
            .take(seabed.mines as usize)
            .enumerate()
            .map(|(kind, model)| self.mesh(["Cylinder", "HornedBall", "BluntCone"][kind], model))
            .collect();
        let scale = seabed.shrinkage(6.0, 10.0);
        for number in 0..seabed.mines {
            let mut dice = Dice::new(seed, Draw::Mine, number);
            let kind = number as usize % kinds.len();
            let at = self.free_place(|| {
                DVec2::from(seabed.size_m.map(|length| dice.between(-0.5, 0.5) * (length - 3.0 * scale)))
            });
            self.taken.push((at, scale));
            let at = at.extend(0.0);
            let lie = DQuat::from_rotation_arc(DVec3::Z, bed.normal(at.x, at.y, 2.0 * scale));
            let turned = (lie * DQuat::from_rotation_z(dice.between(0.0, TAU))).normalize();
            let mut place = Placement { at, turned, scale: DVec3::splat(scale) };
            place.at.z = resting_height(bed, &kinds[kind].vertices, &place) - scale * dice.between(0.08, 0.15);
            let node = self.glb.object(&format!("Mine_{:04}", number + 1), "mine", meshes[kind], place);
            self.glb.root(node);
        }
    }

    fn add_seagrass(&mut self, seabed: &Seabed, bed: &Bed, seed: u64) {
        /// Number of different tufts, and tufts per square metre of a patch.
        const TUFTS: u32 = 4;
        const DENSITY: f64 = 6.0;
        /// Random stream of the shapes, separate from those of the patches.
        const SHAPE_DICE: u32 = 1 << 31;
        if seabed.seagrass == 0 {
            return;
        }
        let tufts: Vec<usize> = (0..TUFTS)
            .map(|number| {
                let tuft = tuft(&mut Dice::new(seed, Draw::Seagrass, SHAPE_DICE + number));
                self.mesh(&format!("Tuft_{}", number + 1), &tuft)
            })
            .collect();
        let scale = seabed.shrinkage(4.0, 10.0);
        let mut count = 0;
        for number in 0..seabed.seagrass {
            let mut dice = Dice::new(seed, Draw::Seagrass, number);
            let radius = scale * dice.between(1.0, 2.5);
            let middle = self.free_place(|| {
                DVec2::from(seabed.size_m.map(|length| dice.between(-0.5, 0.5) * (length - 2.0 * radius - scale)))
            });
            self.taken.push((middle, radius));
            for _ in 0..(DENSITY * PI * (radius / scale).powi(2)).round() as u32 {
                // Dense in the middle, sparse at the edge.
                let (sin, cos) = dice.between(0.0, TAU).sin_cos();
                let out = radius * dice.unit().powf(0.7);
                let [x, y] = [middle.x + out * cos, middle.y + out * sin];
                let place = Placement {
                    at: DVec3::new(x, y, bed.height(x, y) - 0.03 * scale),
                    turned: DQuat::from_rotation_z(dice.between(0.0, TAU)),
                    scale: DVec3::splat(scale * dice.between(0.7, 1.2)),
                };
                let tuft = tufts[dice.below(tufts.len())];
                count += 1;
                let node = self.glb.object(&format!("Seagrass_{count:04}"), "seagrass", tuft, place);
                self.glb.root(node);
            }
        }
    }

    fn add_swarm(&mut self, seabed: &Seabed, seed: u64) {
        /// Half the length, width and height of a fish 1 m long.
        const BODY: DVec3 = DVec3::new(0.5, 0.075, 0.125);
        /// Volume of water per fish, m^3.
        const ROOM: f64 = 0.6;
        /// Speed of the swarm, m/s.
        const SPEED: f64 = 1.0;
        if seabed.fish == 0 {
            return;
        }
        let skin = material(&mut self.glb, "fish");
        let mut body = ClosedShape::ball(1);
        let normals: Vec<[f32; 3]> =
            body.vertices.iter().map(|v| (v / BODY).normalize().as_vec3().to_array()).collect();
        body.vertices.iter_mut().for_each(|vertex| *vertex *= BODY);
        let part = Primitive { triangles: &body.triangles, material: skin };
        let mesh = self.glb.mesh("Fish", &body.positions(), Some(&normals), &[part]);

        let scale = seabed.shrinkage(4.0, 10.0);
        let [x, y] = seabed.size_m;
        // The swarm is a flat ellipsoid, about half as wide as long.
        let shape = DVec3::new(2.0, 1.0, 0.6);
        let radius = (f64::from(seabed.fish) * ROOM / (4.0 / 3.0 * PI * shape.element_product())).cbrt() * scale;
        let extent = (shape * radius).min(DVec3::new(0.15 * x, 0.2 * y, 0.1 * seabed.depth_m));
        let fish: Vec<usize> = (0..seabed.fish)
            .map(|number| {
                let mut dice = Dice::new(seed, Draw::Fish, number);
                let at = direction(&mut dice) * dice.unit().cbrt() * extent;
                let (yaw, pitch) = (PI + dice.between(-0.15, 0.15), dice.between(-0.1, 0.1));
                let place = Placement {
                    at,
                    turned: DQuat::from_euler(EulerRot::ZYX, yaw, pitch, 0.0),
                    scale: DVec3::splat(scale * dice.between(0.34, 0.46)),
                };
                self.glb.object(&format!("Fish_{:04}", number + 1), "fish", mesh, place)
            })
            .collect();

        let mut dice = Dice::new(seed, Draw::Fish, u32::MAX);
        let way = (0.4 * x).min(30.0);
        let from = DVec3::new(way / 2.0, dice.between(-0.2, 0.2) * y, -seabed.depth_m / 2.0);
        let swarm = self.glb.group("Swarm", Placement { at: from, ..Placement::HERE }, &fish);
        self.glb.root(swarm);
        let seconds = way / SPEED;
        let times = self.glb.times(&[0.0, seconds]);
        let places = self.glb.places(times, &[from, from - DVec3::X * way]);
        self.glb.animate(swarm, "translation", places);
        self.glb.animation("Swarm");
        self.swimming = Some(format!("animation Swarm: {way:.1} m along -x in {seconds:.1} s"));
    }
}

/// Height at which a shape with these vertices, placed at z = 0, just touches the bed.
fn resting_height(bed: &Bed, vertices: &[DVec3], place: &Placement) -> f64 {
    let gap = |vertex: &DVec3| {
        let at = place.apply(*vertex);
        at.z - bed.height(at.x, at.y)
    };
    -vertices.iter().map(gap).fold(f64::INFINITY, f64::min)
}

/// A boat 9 m long, its keel on z = 0, bow along x: hull, cabin and mast, and the number of triangles of hull and
/// cabin. Cabin and mast reach into the hull, so that no faces coincide.
fn boat() -> (ClosedShape, [usize; 2]) {
    let mut boat = ClosedShape::default();
    let bottom = [[-4.3, -1.0], [2.5, -1.0], [3.6, 0.0], [2.5, 1.0], [-4.3, 1.0]];
    let deck = [[-4.5, -1.5], [2.5, -1.5], [4.5, 0.0], [2.5, 1.5], [-4.5, 1.5]];
    boat.add_prism(bottom.map(|[x, y]| DVec3::new(x, y, 0.0)), deck.map(|[x, y]| DVec3::new(x, y, 1.6)));
    let hull = boat.triangles.len();
    boat.add_box(DVec3::new(-3.5, -1.0, 1.5), DVec3::new(-0.8, 1.0, 2.9));
    let cabin = boat.triangles.len() - hull;
    boat.add_box(DVec3::new(0.9, -0.1, 1.5), DVec3::new(1.1, 0.1, 4.0));
    (boat, [hull, cabin])
}

/// A mine along x, 2 m long: a cylinder with rounded ends.
fn cylinder() -> Model {
    const RADIUS: f64 = 0.265;
    let mut mine = Model::default();
    let outline = [(-1.0, 0.15), (-0.95, 0.24), (-0.85, RADIUS), (0.85, RADIUS), (0.95, 0.24), (1.0, 0.15)];
    mine.tube("mine", &outline.map(|(x, radius)| (DVec3::new(x, 0.0, RADIUS), radius)), 24);
    mine
}

/// A ball of 1 m with horns on its upper half.
fn horned_ball() -> Model {
    const RADIUS: f64 = 0.5;
    const HORN: f64 = 0.14;
    let mut mine = Model::default();
    let middle = DVec3::Z * RADIUS;
    mine.add_placed(
        "mine",
        &ClosedShape::ball(3),
        &Placement { at: middle, scale: DVec3::splat(RADIUS), ..Placement::HERE },
    );
    let mut horn = |out: DVec3| {
        let at = |length: f64, radius: f64| (middle + out * length, radius);
        mine.tube("horn", &[at(RADIUS - 0.02, 0.035), at(RADIUS + HORN, 0.03), at(RADIUS + HORN + 0.02, 0.015)], 8);
    };
    horn(DVec3::Z);
    for (up, count) in [(0.75_f64, 5), (0.15, 6)] {
        for number in 0..count {
            let (sin, cos) = (f64::from(number) / f64::from(count) * TAU).sin_cos();
            let aside = (1.0 - up * up).sqrt();
            horn(DVec3::new(aside * cos, aside * sin, up));
        }
    }
    mine
}

/// A blunt cone of 1 m on its base.
fn blunt_cone() -> Model {
    let mut mine = Model::default();
    let rings = [(0.0, 0.5), (0.06, 0.5), (0.4, 0.27), (0.47, 0.2)];
    let rings = rings.map(|(z, radius)| ring(28, |sin, cos| DVec3::new(radius * cos, radius * sin, z)));
    mine.loft(&rings, [Some("mine"); 2], |_, _| "mine");
    mine
}

/// A tuft of blades.
fn tuft(dice: &mut Dice) -> Model {
    const BLADES: u32 = 14;
    let mut tuft = Model::default();
    for _ in 0..BLADES {
        let (sin, cos) = dice.between(0.0, TAU).sin_cos();
        let out = DVec3::new(cos, sin, 0.0);
        let foot = out * dice.between(0.0, 0.16);
        let (length, lean) = (dice.between(0.3, 0.5), dice.between(0.05, 0.25));
        let half = out.cross(DVec3::Z) * 0.006;
        let bend = foot + out * lean * 0.4 + DVec3::Z * length * 0.6;
        let tip = foot + out * lean + DVec3::Z * length;
        tuft.polygon("blade", &[foot - half, foot + half, bend + half, bend - half]);
        tuft.polygon("blade", &[bend - half, bend + half, tip]);
    }
    tuft
}
