//! Light that goes on: over mirrors, through glass and water, to what is seen in them.
//!
//! A beam that meets such a surface becomes a tree of paths. Each path is a straight piece after another; at a smooth
//! surface it divides into a reflected and a refracted one, and wherever a surface sends light back diffusely there is
//! an echo, whose light returns the same way. The paths of a block of beams are traced together, generation by
//! generation.

use super::{Air, Contribution, Glint, Wanted};
use crate::ground::cause::Cause;
use crate::ground::lanes::{LANES, RayBatch};
use crate::material::{Optics, Reflectances, fresnel};
use crate::trace::{HitBatch, Tables};
use glam::Vec3;

/// How far paths are followed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathLimits {
    /// Most specular events of a path.
    pub depth: u8,
    /// Least part of the light, there and back, that is followed.
    pub least: f32,
    /// Whether ranges are sums of lengths rather than of travel times.
    pub geometric: bool,
    /// Whether the incidence on what is seen in a mirror matters.
    pub cosine_after: bool,
    /// How the instrument sees itself in what it meets head-on, if it does.
    pub glint: Option<Glint>,
    /// Whether glass is that of the paper's program: seen itself where it is met within 2 degrees of head-on, elsewhere
    /// with a first face alone, the others letting everything pass. Total reflection, for which the program has no
    /// number, stays.
    pub glass_of_the_program: bool,
}

/// Cosine of the 2 degrees within which the paper's program sees glass itself.
const PROGRAM_COS: f32 = 0.999_390_8;

/// Bodies that a path is within, outermost first: object and material of their surfaces.
#[derive(Clone, Copy, Debug, Default)]
struct Inside {
    bodies: [(u32, u32); Inside::MOST],
    count: u8,
}

impl Inside {
    /// Deeper nesting is taken for an open mesh.
    const MOST: usize = 4;

    fn material(&self) -> Option<u32> {
        self.bodies[..usize::from(self.count)].last().map(|&(_, material)| material)
    }

    /// On the other side of the surface of `body`.
    fn through(mut self, body: (u32, u32)) -> Inside {
        let count = usize::from(self.count);
        match self.bodies[..count].iter().rposition(|&known| known == body) {
            Some(place) => {
                self.bodies.copy_within(place + 1..count, place);
                self.count -= 1;
            }
            None if count < Inside::MOST => {
                self.bodies[count] = body;
                self.count += 1;
            }
            None => {}
        }
        self
    }
}

/// A path that is still under way.
#[derive(Clone, Copy, Debug)]
struct Path {
    origin: Vec3,
    direction: Vec3,
    way: Way,
}

/// How a path came to where it is.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// Range so far as the instrument takes it, m.
    range: f32,
    /// Length so far that light spreads over, m.
    spread: f32,
    /// Way so far, m.
    length: f32,
    /// Optical depth of weather so far.
    depth: f32,
    /// Part of the light that is left, one way.
    part: f32,
    /// What it is within: a row of [`Follower::insides`].
    inside: u32,
    lane: u8,
    bounces: u8,
    cause: Cause,
}

impl Way {
    /// Where all begin, that of `lane`.
    fn start(lane: usize) -> Way {
        Way {
            range: 0.0,
            spread: 0.0,
            length: 0.0,
            depth: 0.0,
            part: 1.0,
            inside: OUTSIDE,
            lane: lane as u8,
            bounces: 0,
            cause: Cause::Surface,
        }
    }

    /// The same through glass, or seen in a mirror still.
    fn through(self) -> Way {
        Way { cause: if self.cause == Cause::Surface { Cause::Glass } else { self.cause }, ..self }
    }
}

/// Row of [`Follower::insides`] for what is within no body.
const OUTSIDE: u32 = 0;

/// An echo at the end of a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathEcho {
    pub lane: usize,
    /// Range as the instrument takes it, m.
    pub range: f32,
    /// Effective reflectance of a surface at that range that would send back as much, apart from incidence.
    pub reflectance: f32,
    /// Cosine of the incidence angle, 1 where it does not matter.
    pub cos_incidence: f32,
    pub cause: Cause,
    pub bounces: u8,
    /// Lane of its hit.
    pub hit: usize,
}

/// Memory of a block to follow paths in.
pub(crate) struct Follower {
    paths: Next,
    next: Next,
    /// What paths are within; the first row is none.
    insides: Vec<Inside>,
    rays: RayBatch,
    hits: HitBatch,
    surfaces: Contribution,
}

/// The next generation of paths. Those of neighbours go on side by side when what is reflected and what is refracted do
/// not take turns.
#[derive(Default)]
struct Next {
    reflected: Vec<Path>,
    refracted: Vec<Path>,
}

/// A path at a surface that it meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meeting {
    pub surface: u32,
    pub cause: Cause,
    pub bounces: u8,
    pub place: Vec3,
    pub cos_incidence: f32,
    /// Range so far as the instrument takes it, m.
    pub range: f32,
    /// Part of the light that is left, one way.
    pub part: f32,
    /// Optical depth of weather so far, one way.
    pub depth: f32,
}

/// A sink for the echoes of a block's paths.
pub(crate) trait PathEchoes {
    /// Light, as `rho_eff / R^2` in 1/m^2, that an echo of `lane` must exceed to matter.
    fn least(&self, lane: usize) -> f32;

    /// Takes `echo`, whose surface is among `hits` and `surfaces`.
    fn take(&mut self, echo: &PathEcho, hits: &HitBatch, surfaces: &Contribution);

    /// Is told where paths lead.
    fn meet(&mut self, _: Meeting) {}
}

/// The echo of each beam that is preferred so far.
pub(crate) struct Chosen {
    /// How much it is wanted; the rule is the caller's.
    pub strength: [f32; LANES],
    pub hits: HitBatch,
    pub surfaces: Contribution,
    pub cause: [u8; LANES],
    pub bounces: [u8; LANES],
}

impl Default for Chosen {
    fn default() -> Self {
        Chosen {
            strength: [f32::NEG_INFINITY; LANES],
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
            cause: [0; LANES],
            bounces: [0; LANES],
        }
    }
}

/// Of the echoes of each beam only the one that is preferred.
pub(crate) struct Preferred<'a, F> {
    pub chosen: &'a mut Chosen,
    /// How much an echo is wanted, if at all.
    pub prefer: F,
    /// Least `rho_eff / R^2` that is detected anywhere, 1/m^2.
    pub least_power: f32,
    /// Whether the strongest is preferred, with `rho_eff / R^2` as its strength.
    pub strongest: bool,
}

impl<F: Fn(&PathEcho) -> Option<f32>> PathEchoes for Preferred<'_, F> {
    fn least(&self, lane: usize) -> f32 {
        if self.strongest { self.least_power.max(self.chosen.strength[lane]) } else { self.least_power }
    }

    fn take(&mut self, echo: &PathEcho, hits: &HitBatch, surfaces: &Contribution) {
        let (lane, chosen) = (echo.lane, &mut *self.chosen);
        if let Some(strength) = (self.prefer)(echo)
            && strength > chosen.strength[lane]
        {
            chosen.strength[lane] = strength;
            chosen.hits.take(lane, hits, echo.hit);
            chosen.surfaces.take(lane, surfaces, echo.hit);
            chosen.hits.range[lane] = echo.range;
            chosen.surfaces.reflectance[lane] = echo.reflectance;
            chosen.surfaces.cos_incidence[lane] = echo.cos_incidence;
            (chosen.cause[lane], chosen.bounces[lane]) = (echo.cause as u8, echo.bounces);
        }
    }
}

/// What paths are followed through.
pub(crate) struct Surroundings<'a> {
    pub scene: &'a Tables,
    pub reflectances: &'a Reflectances,
    pub mask: u32,
    pub smooth: bool,
    pub wanted: Wanted,
    pub limits: PathLimits,
    /// Farthest range of each beam, m.
    pub range_max: &'a [f32; LANES],
    /// Weather on the way.
    pub air: Option<&'a Air>,
}

impl Default for Follower {
    fn default() -> Self {
        Follower {
            paths: Next::default(),
            next: Next::default(),
            insides: vec![Inside::default()],
            rays: RayBatch::default(),
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
        }
    }
}

impl Follower {
    /// Follows the light of those of the first `count` rays whose surface does not stop it; `echoes` takes what comes
    /// back, from the surface itself too. `rays`, `hits` and `surfaces` are the rays' own, normals on their side.
    pub(crate) fn follow(
        &mut self,
        around: &Surroundings,
        rays: &RayBatch,
        hits: &HitBatch,
        surfaces: &Contribution,
        count: usize,
        echoes: &mut impl PathEchoes,
    ) {
        self.insides.truncate(1);
        for lane in 0..count {
            let Some(optics) = optics(around, hits, lane).filter(|optics| optics.goes_on()) else { continue };
            let path = Path { origin: rays.origin(lane), direction: rays.direction(lane), way: Way::start(lane) };
            arrive(around, &path, optics, (hits, surfaces, lane), (&mut self.next, &mut self.insides), echoes);
        }
        while !(self.next.reflected.is_empty() && self.next.refracted.is_empty()) {
            std::mem::swap(&mut self.paths, &mut self.next);
            // What is refracted first: behind it is mostly what is strongest.
            let Next { reflected, refracted } = std::mem::take(&mut self.paths);
            let [refracted, reflected] = [refracted, reflected].map(|mut paths| {
                paths.retain(|Path { way, .. }| {
                    // The most that a surface right there could send back.
                    let square = way.spread * way.spread;
                    let own = around.limits.glint.map_or(0.0, |glint| glint.greatest_power(way.spread) * square);
                    way.part * way.part * around.reflectances.greatest.max(own) > echoes.least(way.lane.into()) * square
                });
                paths.chunks(LANES).for_each(|paths| self.step(around, paths, echoes));
                paths.clear();
                paths
            });
            // Their memory is used again.
            self.paths = Next { reflected, refracted };
        }
    }

    /// Traces up to [`LANES`] paths.
    fn step(&mut self, around: &Surroundings, paths: &[Path], echoes: &mut impl PathEchoes) {
        for (lane, path) in paths.iter().enumerate() {
            (self.rays.org_x[lane], self.rays.org_y[lane], self.rays.org_z[lane]) = path.origin.into();
            (self.rays.dir_x[lane], self.rays.dir_y[lane], self.rays.dir_z[lane]) = path.direction.into();
            self.rays.range_max[lane] = (around.range_max[usize::from(path.way.lane)] - path.way.range).max(0.0);
        }
        // Neighbours come from neighbours on the same surface, mostly: packets as for beams take two thirds of the
        // time.
        self.hits.trace(around.scene, &self.rays, paths.len(), true, around.mask);
        self.surfaces.face(around.scene, &self.rays, &mut self.hits, paths.len(), around.smooth);
        let (surfaces, reflectances) = (&around.scene.surfaces, around.reflectances);
        self.surfaces.look_up(surfaces, reflectances, &self.hits, paths.len(), around.wanted);
        for (lane, path) in paths.iter().enumerate() {
            if let Some(optics) = optics(around, &self.hits, lane) {
                let at = (&self.hits, &self.surfaces, lane);
                arrive(around, path, optics, at, (&mut self.next, &mut self.insides), echoes);
            }
        }
    }
}

/// The optics of what a ray hits.
fn optics<'a>(around: &Surroundings<'a>, hits: &HitBatch, lane: usize) -> Option<&'a Optics> {
    around.scene.surfaces.optics(around.reflectances, hits.surface[lane])
}

/// `path` meets the surface of a lane: its echo, and the paths that go on.
fn arrive(
    around: &Surroundings,
    path: &Path,
    optics: &Optics,
    (hits, surfaces, lane): (&HitBatch, &Contribution, usize),
    (next, insides): (&mut Next, &mut Vec<Inside>),
    echoes: &mut impl PathEchoes,
) {
    let limits = &around.limits;
    let of = |material: u32| &around.reflectances.optics[material as usize];
    let Path { origin, direction, mut way } = *path;
    let length = hits.range[lane];
    let within = if way.inside == OUTSIDE { None } else { insides[way.inside as usize].material().map(of) };
    if let Some(body) = within {
        let (slower, nearer) = if limits.geometric { (1.0, 1.0) } else { (body.group_index, 1.0 / body.index) };
        way.range += length * slower;
        way.spread += length * nearer;
        way.part *= body.left_after(length);
    } else {
        way.range += length;
        way.spread += length;
        // Weather is outside.
        way.depth += around.air.map_or(0.0, |air| air.depth(origin, direction, way.length, length));
    }
    way.length += length;
    let cos = surfaces.cos_incidence[lane];
    let place = origin + direction * length;
    echoes.meet(Meeting {
        surface: hits.surface[lane],
        cause: way.cause,
        bounces: way.bounces,
        place,
        cos_incidence: cos,
        range: way.range,
        part: way.part,
        depth: way.depth,
    });
    let mut answer = |reflectance: f32| {
        let air = if way.depth > 0.0 { (-2.0 * way.depth).exp() } else { 1.0 };
        let farther = way.range / way.spread;
        let echo = PathEcho {
            lane: way.lane.into(),
            range: way.range,
            reflectance: reflectance * way.part * way.part * air * farther * farther,
            cos_incidence: if way.bounces > 0 && !limits.cosine_after { 1.0 } else { cos },
            cause: way.cause,
            bounces: way.bounces,
            hit: lane,
        };
        echoes.take(&echo, hits, surfaces);
    };
    if optics.diffuse > 0.0 || optics.dirt > 0.0 {
        answer(surfaces.reflectance[lane] * optics.diffuse + optics.dirt);
    }
    if limits.glass_of_the_program && optics.clear > 0.0 && within.is_none() && cos >= PROGRAM_COS {
        return answer(surfaces.reflectance[lane]);
    }
    if way.bounces >= limits.depth || !optics.goes_on() {
        return;
    }
    let normal = hits.normal(lane);
    // At the rim of a smooth body the shading normal may look away; nothing goes on from there.
    if normal.dot(direction) >= 0.0 {
        return;
    }
    // Off the surface by what single precision leaves open there.
    let off = 2e-5 + 1e-6 * place.abs().max_element();
    let onward = Way { bounces: way.bounces + 1, ..way };
    let go = |list: &mut Vec<Path>, origin: Vec3, direction: Vec3, way: Way| {
        if way.part * way.part >= limits.least {
            // What `off` takes from the way.
            let skipped = off * normal.dot(direction).abs();
            let (range, spread, length) = (way.range + skipped, way.spread + skipped, way.length + skipped);
            list.push(Path { origin, direction, way: Way { range, spread, length, ..way } });
        }
    };
    // A metal's share and that of glass go the same way.
    let mut reflect = |share: f32| {
        if let Some(glint) = limits.glint {
            // Near head-on the difference of the directions is the angle, and exact where the cosine is 1 all over.
            let rho_eff = glint.rho_eff(share, (normal + direction).length(), way.spread);
            if rho_eff > 0.0 {
                answer(rho_eff / cos);
            }
        }
        let mirrored = Way { cause: Cause::Mirror, part: way.part * share, ..onward };
        go(&mut next.reflected, place + normal * off, fresnel::reflected(direction, normal), mirrored);
    };
    let mirrored = optics.mirrored_at(cos);
    if optics.clear == 0.0 {
        return reflect(mirrored);
    }
    if let Some(thickness) = optics.sheet {
        let (face, cos_t) = fresnel::dielectric(cos, optics.index);
        let through = thickness / cos_t;
        let (reflected, passed) = if limits.glass_of_the_program {
            (face, 1.0 - face)
        } else {
            fresnel::plate(cos, cos_t, optics.index, optics.left_after(through))
        };
        reflect(mirrored + optics.clear * reflected);
        // The pane reaches from the sheet backwards; light goes on from its other face.
        let (slower, nearer) = if limits.geometric { (1.0, 1.0) } else { (optics.group_index, 1.0 / optics.index) };
        let behind = place + fresnel::refracted(direction, normal, optics.index, cos_t) * through - normal * off;
        let on = Way {
            range: way.range + through * slower,
            spread: way.spread + through * nearer,
            part: way.part * optics.clear * passed,
            ..onward.through()
        };
        return go(&mut next.refracted, behind, direction, on);
    }
    let surface = &around.scene.surfaces.rows[hits.surface[lane] as usize];
    let inside = insides[way.inside as usize].through((surface.object, surface.material));
    let index = within.map_or(1.0, |body| body.index);
    let beyond = inside.material().map_or(1.0, |material| of(material).index);
    let m = beyond / index;
    let (mut reflected, cos_t) = fresnel::dielectric(cos, m);
    if limits.glass_of_the_program && within.is_some() && reflected < 1.0 {
        reflected = 0.0;
    }
    reflect(mirrored + optics.clear * reflected);
    if reflected < 1.0 {
        let row = if inside.count == 0 { OUTSIDE } else { insides.len() as u32 };
        if row != OUTSIDE {
            insides.push(inside);
        }
        let on = Way { inside: row, part: way.part * optics.clear * (1.0 - reflected), ..onward.through() };
        go(&mut next.refracted, place - normal * off, fresnel::refracted(direction, normal, m, cos_t), on);
    }
}
