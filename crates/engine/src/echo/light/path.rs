//! Light that continues by mirrors and through glass and water, to what is seen in them.
//!
//! A beam that hits such a surface becomes a tree of paths. Each path is a chain of straight segments; at a smooth
//! surface it splits into a reflected and a refracted one, and wherever a surface scatters light back there is an echo,
//! whose light returns along the same path. The paths of a block of beams are traced together, generation by
//! generation.

use super::{Air, Contribution, Glint, MirrorImage, RequestedQuantities};
use crate::trace::{HitBatch, Sight, Tables};
use echocast_kernels::boundary::{self, Meetings, Onward};
use glam::Vec3;
use ground::cause::Cause;
use ground::lanes::{LANES, MISS, RayBatch};
use ground::profile::Profile;
use model::material::{Optics, Reflectances};

/// How far paths are traced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathLimits {
    /// Most specular events on a path.
    pub depth: u8,
    /// Least fraction of the light, two-way, that is traced.
    pub least: f32,
    /// Whether ranges are sums of lengths rather than of travel times.
    pub geometric: bool,
    /// Whether the incidence on surfaces seen in a mirror matters.
    pub cosine_after: bool,
    /// How the instrument sees its own reflection at normal incidence, if at all.
    pub glint: Option<Glint>,
    /// Whether glass behaves as in the paper's program: it is itself detected within 2 degrees of normal incidence;
    /// elsewhere only its first face reflects, and the other faces transmit everything. Total internal reflection, for
    /// which the program has no value, is kept.
    pub glass_of_the_program: bool,
}

impl PathLimits {
    /// For a scan in `profile` of paths with up to `depth` specular events.
    pub fn new(profile: Profile, depth: u8, glint: Option<Glint>) -> PathLimits {
        PathLimits {
            depth,
            least: 1e-6,
            geometric: profile.is_paper(),
            cosine_after: !profile.is_program(),
            glint: glint.filter(|_| !profile.is_paper()),
            glass_of_the_program: profile.is_program(),
        }
    }
}

/// Cosine of the 2 degrees within which the paper's program detects glass itself.
const PROGRAM_COS: f32 = 0.999_390_8;

/// Bodies that a path is inside, outermost first: object and material of their surfaces.
#[derive(Clone, Copy, Debug, Default)]
struct Inside {
    bodies: [(u32, u32); Inside::MOST],
    count: u8,
}

impl Inside {
    /// Deeper nesting is treated as an open mesh.
    const MOST: usize = 4;

    fn material(&self) -> Option<u32> {
        self.bodies[..usize::from(self.count)].last().map(|&(_, material)| material)
    }

    /// The bodies on the other side of the surface of `body`.
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

/// A path still in progress.
#[derive(Clone, Copy, Debug)]
struct LightPath {
    origin: Vec3,
    direction: Vec3,
    way: Way,
}

/// State of a path where it is.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// Range so far as the instrument measures it, m.
    range: f32,
    /// Length so far over which light spreads, m.
    spread: f32,
    /// Path length so far, m.
    length: f32,
    /// Optical depth of weather so far.
    depth: f32,
    /// Fraction of the light that is left, one way.
    part: f32,
    /// The bodies that it is inside: a row of [`Follower::insides`].
    inside: u32,
    /// Apparent motion of what is at its end: a row of [`Follower::images`].
    image: u32,
    lane: u8,
    bounces: u8,
    cause: Cause,
}

impl Way {
    /// The start of all paths, for `lane`.
    fn start(lane: usize) -> Way {
        Way {
            range: 0.0,
            spread: 0.0,
            length: 0.0,
            depth: 0.0,
            part: 1.0,
            inside: OUTSIDE,
            image: DIRECT,
            lane: lane as u8,
            bounces: 0,
            cause: Cause::Surface,
        }
    }

    /// The same through glass, unless it is already seen in a mirror.
    fn through(self) -> Way {
        Way { cause: if self.cause == Cause::Surface { Cause::Glass } else { self.cause }, ..self }
    }
}

/// Row of [`Follower::insides`] for outside all bodies.
const OUTSIDE: u32 = 0;

/// Row of [`Follower::images`] for what is seen directly.
const DIRECT: u32 = 0;

/// An echo at the end of a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathEcho {
    pub lane: usize,
    /// Range as the instrument measures it, m.
    pub range: f32,
    /// Effective reflectance of a surface at that range that would return as much, apart from incidence.
    pub reflectance: f32,
    /// Cosine of the incidence angle, 1 where it does not matter.
    pub cos_incidence: f32,
    pub cause: Cause,
    pub bounces: u8,
    /// Lane of its hit.
    pub hit: usize,
    /// Its apparent motion: a row of [`Follower::image`].
    pub image: u32,
}

/// Buffers for tracing the paths of a block.
pub(crate) struct Follower {
    paths: NextPaths,
    next: NextPaths,
    /// The bodies that paths are inside; the first row: none.
    insides: Vec<Inside>,
    /// Apparent motion of what paths lead to; the first row: seen directly.
    images: Vec<MirrorImage>,
    rays: RayBatch,
    hits: HitBatch,
    surfaces: Contribution,
    at: Meetings,
    /// The paths that continue from there.
    mirrored: Onward,
    refracted: Onward,
}

/// The next generation of paths. Paths of neighbouring beams stay side by side if reflected and refracted ones do not
/// alternate.
#[derive(Default)]
struct NextPaths {
    reflected: Vec<LightPath>,
    refracted: Vec<LightPath>,
}

/// A path at a surface that it hits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meeting {
    pub surface: u32,
    pub cause: Cause,
    pub bounces: u8,
    pub place: Vec3,
    pub cos_incidence: f32,
    /// Range so far as the instrument measures it, m.
    pub range: f32,
    /// Fraction of the light that is left, one way.
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

    /// Called for each surface that a path hits.
    fn meet(&mut self, _: Meeting) {}
}

/// What paths are traced through.
pub(crate) struct Surroundings<'a> {
    pub scene: &'a Tables,
    pub reflectances: &'a Reflectances,
    pub sight: Sight,
    pub smooth: bool,
    pub requested: RequestedQuantities,
    /// Whether apparent motion is required.
    pub motion: bool,
    pub limits: PathLimits,
    /// The beams: their maximum ranges and their times.
    pub beams: &'a RayBatch,
    /// Weather along the path.
    pub air: Option<&'a Air>,
}

impl Default for Follower {
    fn default() -> Self {
        Follower {
            paths: NextPaths::default(),
            next: NextPaths::default(),
            insides: vec![Inside::default()],
            images: vec![MirrorImage::DIRECT],
            rays: RayBatch::default(),
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
            at: Meetings::default(),
            mirrored: Onward::default(),
            refracted: Onward::default(),
        }
    }
}

impl Follower {
    /// Starts with the rays of `lanes`, whose surfaces do not stop their light. `rays`, `hits` and `surfaces` are those
    /// of the beams, with normals on the sensor's side.
    pub fn begin(&mut self, rays: &RayBatch, hits: &HitBatch, surfaces: &Contribution, lanes: &[u8]) {
        self.rays.gather(rays, lanes);
        self.hits.gather(hits, lanes);
        self.surfaces.gather(surfaces, lanes);
        self.paths.reflected.extend(lanes.iter().map(|&lane| usize::from(lane)).map(|lane| {
            let (origin, direction) = (rays.origin(lane), rays.direction(lane));
            LightPath { origin, direction, way: Way::start(lane) }
        }));
    }

    /// Discards the images of previous beams.
    pub(crate) fn forget_images(&mut self) {
        self.images.truncate(1);
    }

    /// Apparent motion of an echo, by [`PathEcho::image`].
    pub fn image(&self, row: u32) -> &MirrorImage {
        &self.images[row as usize]
    }

    /// Traces the light; `echoes` receives what returns, including from the first surfaces.
    pub fn follow(&mut self, around: &Surroundings, echoes: &mut impl PathEchoes) {
        self.insides.truncate(1);
        let mut first = std::mem::take(&mut self.paths.reflected);
        self.arrive(around, &first, echoes);
        first.clear();
        self.paths.reflected = first;
        let limits = &around.limits;
        while !(self.next.reflected.is_empty() && self.next.refracted.is_empty()) {
            std::mem::swap(&mut self.paths, &mut self.next);
            // Refracted paths first: the strongest echo is mostly behind the surface.
            let NextPaths { reflected, refracted } = std::mem::take(&mut self.paths);
            let [refracted, reflected] = [refracted, reflected].map(|mut paths| {
                paths.retain(|LightPath { way, .. }| {
                    // The most that a surface right there could return.
                    let square = way.spread * way.spread;
                    let (light, least) = (way.part * way.part, echoes.least(way.lane.into()) * square);
                    let own = || limits.glint.map_or(0.0, |glint| glint.greatest_power(way.spread) * square);
                    light * around.reflectances.greatest > least || light * own() > least
                });
                paths.chunks(LANES).for_each(|paths| self.step(around, paths, echoes));
                paths.clear();
                paths
            });
            // Their memory is reused.
            self.paths = NextPaths { reflected, refracted };
        }
    }

    /// Traces up to [`LANES`] paths.
    fn step(&mut self, around: &Surroundings, paths: &[LightPath], echoes: &mut impl PathEchoes) {
        for (lane, path) in paths.iter().enumerate() {
            (self.rays.org_x[lane], self.rays.org_y[lane], self.rays.org_z[lane]) = path.origin.into();
            (self.rays.dir_x[lane], self.rays.dir_y[lane], self.rays.dir_z[lane]) = path.direction.into();
            let beam = usize::from(path.way.lane);
            self.rays.range_max[lane] = (around.beams.range_max[beam] - path.way.range).max(0.0);
            self.rays.time[lane] = around.beams.time[beam];
            self.rays.beam[lane] = around.beams.beam[beam];
        }
        // Neighbours mostly come from neighbours on the same surface: coherent packets as for beams take two thirds of
        // the time.
        self.hits.trace(around.scene, &self.rays, paths.len(), true, around.sight);
        self.surfaces.face(around.scene, &self.rays, &mut self.hits, paths.len(), around.smooth);
        let (surfaces, reflectances) = (&around.scene.surfaces, around.reflectances);
        self.surfaces.look_up(surfaces, reflectances, &self.hits, 0..paths.len(), around.requested);
        self.arrive(around, paths, echoes);
    }

    /// Processes `paths` at the surfaces of the first lanes: their echoes, and the paths that continue.
    fn arrive(&mut self, around: &Surroundings, paths: &[LightPath], echoes: &mut impl PathEchoes) {
        let limits = &around.limits;
        let mut inside = [OUTSIDE; LANES];
        self.read_surfaces(around, paths, &mut inside);
        let Follower { next, rays, hits, surfaces, at, mirrored, refracted, images, .. } = self;
        boundary::arrive(at, rays.origins(), rays.directions(), &hits.range, paths.len());
        let (normals, facets) = ([&hits.normal_x, &hits.normal_y, &hits.normal_z], hits.facet.each_ref());
        let (cos, simple) = (&surfaces.cos_incidence, limits.glass_of_the_program);
        boundary::divide(at, rays.directions(), normals, facets, cos, simple, paths.len(), mirrored, refracted);
        let (mut surface, mut met) = (MISS, None);
        for (lane, LightPath { origin, direction, mut way }) in paths.iter().copied().enumerate() {
            if hits.surface[lane] != surface {
                surface = hits.surface[lane];
                met = optics(around, surface);
            }
            let Some(optics) = met else { continue };
            if let Some(air) = around.air.filter(|_| way.inside == OUTSIDE) {
                // Weather is only outside of bodies.
                way.depth += air.depth(origin, direction, way.length, hits.range[lane]);
            }
            let (range, spread, part, cos) = (at.range[lane], at.spread[lane], at.part[lane], cos[lane]);
            echoes.meet(Meeting {
                surface,
                cause: way.cause,
                bounces: way.bounces,
                place: Vec3::from(at.place.each_ref().map(|axis| axis[lane])),
                cos_incidence: cos,
                range,
                part,
                depth: way.depth,
            });
            let mut answer = |reflectance: f32| {
                let air = if way.depth > 0.0 { (-2.0 * way.depth).exp() } else { 1.0 };
                let farther = range / spread;
                let echo = PathEcho {
                    lane: way.lane.into(),
                    range,
                    reflectance: reflectance * part * part * air * farther * farther,
                    cos_incidence: if way.bounces > 0 && !limits.cosine_after { 1.0 } else { cos },
                    cause: way.cause,
                    bounces: way.bounces,
                    hit: lane,
                    image: way.image,
                };
                echoes.take(&echo, hits, surfaces);
            };
            if optics.diffuse > 0.0 || optics.dirt > 0.0 {
                answer(surfaces.reflectance[lane] * optics.diffuse + optics.dirt);
            }
            if sees_itself(limits, optics, &way, cos) {
                answer(surfaces.reflectance[lane]);
            }
            let share = at.reflected[lane];
            if share > 0.0
                && let Some(glint) = limits.glint
            {
                let rho_eff = glint.rho_eff(share, at.angle[lane], spread);
                if rho_eff > 0.0 {
                    answer(rho_eff / cos);
                }
            }
            let onward = Way { bounces: way.bounces + 1, ..way };
            let go = |list: &mut Vec<LightPath>, on: &Onward, way: Way| {
                let part = on.part[lane];
                if part * part >= limits.least {
                    let (range, spread, length) = (on.range[lane], on.spread[lane], on.length[lane]);
                    list.push(LightPath {
                        origin: Vec3::from(on.origin.each_ref().map(|axis| axis[lane])),
                        direction: Vec3::from(on.direction.each_ref().map(|axis| axis[lane])),
                        way: Way { range, spread, length, part, ..way },
                    });
                }
            };
            let [behind, beyond] = if around.motion {
                let time = rays.time[lane];
                let uv = [hits.u[lane], hits.v[lane]];
                let movement = around.scene.movement(None, surface, hits.triangle[lane], uv, time);
                let velocity = movement.map_or(Vec3::ZERO, |movement| movement.velocity);
                let onward = Vec3::from(refracted.direction.each_ref().map(|axis| axis[lane]));
                let image = images[way.image as usize];
                let seen = [image.in_mirror(hits.normal(lane), velocity), image.through(direction, onward)];
                seen.map(|image| {
                    images.push(image);
                    images.len() as u32 - 1
                })
            } else {
                [DIRECT; 2]
            };
            go(&mut next.reflected, mirrored, Way { cause: Cause::Mirror, image: behind, ..onward });
            go(&mut next.refracted, refracted, Way { inside: inside[lane], image: beyond, ..onward.through() });
        }
    }

    /// Fills `self.at` with the state of `paths` before the surfaces of the first lanes, and with those surfaces: in
    /// runs, as neighbours mostly hit the same. `inside`: the bodies that they are inside of behind these surfaces.
    fn read_surfaces(&mut self, around: &Surroundings, paths: &[LightPath], inside: &mut [u32; LANES]) {
        let limits = &around.limits;
        let Follower { insides, hits, surfaces, at, .. } = self;
        let of = |material: u32| &around.reflectances.optics[material as usize];
        // Range and spread per length, and absorption.
        let through = |body: &Optics| {
            let (slower, nearer) = if limits.geometric { (1.0, 1.0) } else { (body.group_index, 1.0 / body.index) };
            [slower, nearer, body.absorption]
        };
        let mut start = 0;
        while start < paths.len() {
            let (surface, before) = (hits.surface[start], paths[start].way.inside);
            let same = |lane: usize| hits.surface[lane] == surface && paths[lane].way.inside == before;
            let mut end = start + 1;
            while end < paths.len() && same(end) {
                end += 1;
            }
            let run = start..end;
            let within = if before == OUTSIDE { None } else { insides[before as usize].material().map(of) };
            let fill = |columns: &mut [[f32; LANES]; 3], values: [f32; 3]| {
                columns.iter_mut().zip(values).for_each(|(column, value)| column[run.clone()].fill(value));
            };
            fill(&mut at.through, within.map_or([1.0, 1.0, 0.0], through));
            let (mut index, mut pane, mut partly) = (1.0, -1.0, 1.0);
            let optics = optics(around, surface);
            if let Some(optics) = optics
                && optics.clear > 0.0
            {
                if let Some(thickness) = optics.sheet {
                    (index, pane) = (optics.index, thickness);
                    fill(&mut at.within, through(optics));
                    inside[run.clone()].fill(before);
                } else {
                    let row = &around.scene.surfaces.rows[surface as usize];
                    let behind = insides[before as usize].through((row.object, row.material));
                    let own = within.map_or(1.0, |body| body.index);
                    index = behind.material().map_or(1.0, |material| of(material).index) / own;
                    fill(&mut at.within, behind.material().map_or([1.0, 1.0, 0.0], |material| through(of(material))));
                    partly = if limits.glass_of_the_program && within.is_some() { 0.0 } else { 1.0 };
                    if behind.count > 0 {
                        inside[run.clone()].fill(insides.len() as u32);
                        insides.push(behind);
                    }
                }
            }
            at.index[run.clone()].fill(index);
            at.pane[run.clone()].fill(pane);
            at.partly[run.clone()].fill(partly);
            for lane in run {
                let way = &paths[lane].way;
                (at.range[lane], at.spread[lane], at.length[lane]) = (way.range, way.spread, way.length);
                at.part[lane] = way.part;
                let cos = surfaces.cos_incidence[lane];
                (at.mirrored[lane], at.clear[lane]) = match optics {
                    Some(optics) if way.bounces < limits.depth && !sees_itself(limits, optics, way, cos) => {
                        (optics.mirrored_at(cos), optics.clear)
                    }
                    _ => (0.0, 0.0),
                };
            }
            start = end;
        }
    }
}

/// The optics of a surface, a row or [`MISS`].
fn optics<'a>(around: &Surroundings<'a>, surface: u32) -> Option<&'a Optics> {
    around.scene.surfaces.optics(around.reflectances, surface)
}

/// Whether glass is itself detected, near normal incidence, as in the paper's program.
fn sees_itself(limits: &PathLimits, optics: &Optics, way: &Way, cos: f32) -> bool {
    limits.glass_of_the_program && optics.clear > 0.0 && way.inside == OUTSIDE && cos >= PROGRAM_COS
}
