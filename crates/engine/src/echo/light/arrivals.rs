//! The light that arrives along the beams of a block: from what their rays hit, from what they see in mirrors and
//! through glass, from the air, and from bright surfaces beside them.

use super::signal::{BeamSignal, pulse_at};
use super::{AirEcho, AirEchoes, BeamRays, Contribution, Contributor, Meeting, PathEcho, PathEchoes};
use crate::trace::HitBatch;
use glam::Vec3;
use ground::cause::Cause;
use ground::lanes::{LANES, MEDIUM};

/// Where an arrival comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Provenance {
    pub cause: Cause,
    /// Mirrors and faces of glass on its path.
    pub bounces: u8,
    pub cos_incidence: f32,
    /// Row of the surface that returns it; [`MEDIUM`] for the air.
    pub surface: u32,
    /// Row of the first surface on its path.
    pub first: u32,
    pub triangle: u32,
    pub uv: [f32; 2],
    pub normal: Vec3,
    /// Its apparent motion: a row of [`Follower::image`](super::Follower::image), 0 for what is seen directly.
    pub image: u32,
}

impl Provenance {
    /// That of an echo of no surface.
    pub(crate) fn of_no_surface(cause: Cause) -> Provenance {
        Provenance {
            cause,
            bounces: 0,
            cos_incidence: 1.0,
            surface: MEDIUM,
            first: MEDIUM,
            triangle: 0,
            uv: [0.0; 2],
            normal: Vec3::NAN,
            image: 0,
        }
    }

    /// That of the surface hit at `lane` of `hits`.
    pub(crate) fn of_hit(hits: &HitBatch, lane: usize, cos_incidence: f32) -> Provenance {
        Provenance {
            cause: Cause::Surface,
            bounces: 0,
            cos_incidence,
            surface: hits.surface[lane],
            first: hits.surface[lane],
            triangle: hits.triangle[lane],
            uv: [hits.u[lane], hits.v[lane]],
            normal: hits.normal(lane),
            image: 0,
        }
    }

    /// That of what ray `ray` of the beam at `lane` hits.
    pub(crate) fn of_ray(rays: &BeamRays, lane: usize, ray: u32) -> Option<Provenance> {
        let met = rays.get(ray, lane)?;
        Some(Provenance::of_hit(&met.batch.hits, met.lane, met.cos_incidence()))
    }
}

/// End of the chain of a beam's arrivals.
const NONE: u32 = u32::MAX;

/// Bit of the source of a part of a signal that comes from what a ray of the beam hits directly; the other bits are the
/// number of the ray, as in [`BeamRays::get`].
const DIRECT: u32 = 1 << 31;

/// The arrivals of a block of beams from elsewhere than the surfaces that their rays hit, in columns: from mirrors,
/// glass, the air and beside a beam. They are chained beam by beam as they are found.
pub(crate) struct Arrivals {
    /// Range as the instrument measures it, m.
    pub range: Vec<f32>,
    /// Light, `rho_eff T / R^2` in 1/m^2, of the part of the beam that it comes from.
    pub power: Vec<f32>,
    pub provenance: Vec<Provenance>,
    /// The one before in its chain, or [`NONE`].
    before: Vec<u32>,
    /// Last of the chain of each beam.
    last: [u32; LANES],
    /// Parts of the signal of the beam that is received.
    bundles: Vec<Bundle>,
}

/// A part of a signal from one surface.
struct Bundle {
    surface: u32,
    /// Range of what was added first, m; all is close to it.
    first: f32,
    power: f32,
    /// Sum of power times range beyond the first.
    moment: f32,
    /// Power of the strongest ray, and its number.
    most: f32,
    ray: u32,
}

/// Where a piece of a signal comes from.
#[derive(Clone, Copy)]
pub(crate) enum PieceSource<'a> {
    /// What this ray of the beam hits.
    Ray(u32),
    Other(&'a Provenance),
}

impl Default for Arrivals {
    fn default() -> Self {
        Arrivals {
            range: Vec::new(),
            power: Vec::new(),
            provenance: Vec::new(),
            before: Vec::new(),
            last: [NONE; LANES],
            bundles: Vec::new(),
        }
    }
}

impl Arrivals {
    pub fn clear(&mut self) {
        self.range.clear();
        self.power.clear();
        self.provenance.clear();
        self.before.clear();
        self.last = [NONE; LANES];
    }

    /// Adds what arrives along the beam at `lane` from elsewhere than the surfaces that its rays hit.
    pub fn add(&mut self, lane: usize, range: f32, power: f32, provenance: Provenance) {
        self.before.push(self.last[lane]);
        self.last[lane] = self.range.len() as u32;
        self.range.push(range);
        self.power.push(power);
        self.provenance.push(provenance);
    }

    /// Whether the beam at `lane` has arrivals other than from the surfaces that its rays hit.
    pub(crate) fn has_others(&self, lane: usize) -> bool {
        self.last[lane] != NONE
    }

    /// All that arrives along the beam at `lane`, as its signal, the nearest first. Rays that hit one surface within
    /// `width` m of range are merged; with a negative width every ray is a piece of its own. `sigma`: standard deviation of the pulse, m.
    pub(crate) fn receive(
        &mut self,
        rays: &BeamRays,
        lane: usize,
        [width, sigma]: [f32; 2],
        received: &mut BeamSignal,
    ) {
        received.clear();
        if rays.is_patched {
            rays.patchworks[lane].receive([2.0 * width, sigma], DIRECT, received);
        } else {
            self.bundles.clear();
            for (ray, met) in rays.of_beam(lane) {
                let (surface, power) = (met.surface(), met.power());
                if power > 0.0 {
                    self.bundle(surface, ray, [met.range(), power], width);
                }
            }
            for bundle in &self.bundles {
                received.push(bundle.first + bundle.moment / bundle.power, bundle.power, bundle.ray | DIRECT);
            }
        }
        let mut row = self.last[lane];
        while row != NONE {
            received.push(self.range[row as usize], self.power[row as usize], row);
            row = self.before[row as usize];
        }
        received.sort();
    }

    /// Adds what a ray hits.
    fn bundle(&mut self, surface: u32, ray: u32, [range, power]: [f32; 2], width: f32) {
        let near = |bundle: &&mut Bundle| bundle.surface == surface && (range - bundle.first).abs() <= width;
        match self.bundles.iter_mut().find(near) {
            Some(bundle) => {
                bundle.power += power;
                bundle.moment += power * (range - bundle.first);
                if power > bundle.most {
                    (bundle.most, bundle.ray) = (power, ray);
                }
            }
            None => self.bundles.push(Bundle { surface, first: range, power, moment: 0.0, most: power, ray }),
        }
    }

    /// Range, power and provenance of all of a block.
    pub fn all(&self) -> impl Iterator<Item = (f32, f32, &Provenance)> {
        (self.range.iter().zip(&self.power).zip(&self.provenance)).map(|((&range, &power), from)| (range, power, from))
    }

    /// Where the piece of a signal with this `source` comes from.
    pub(crate) fn source(&self, source: u32) -> PieceSource<'_> {
        match source & DIRECT {
            0 => PieceSource::Other(&self.provenance[source as usize]),
            _ => PieceSource::Ray(source & !DIRECT),
        }
    }

    /// What contributes to the echo at `at` m of the beam at `lane`, whose signal is `received`: what pieces within
    /// `reach` m, or the rays that are merged in them, contribute there. `scale`: one over the standard deviation of the
    /// pulse, 1/m. None to a plain beam, which has no signal.
    pub(crate) fn contributors(
        &self,
        rays: &BeamRays,
        lane: usize,
        received: &BeamSignal,
        [at, reach, scale]: [f32; 3],
    ) -> impl Iterator<Item = Contributor> + Clone {
        let is_near = move |[low, high]: [f32; 2]| low <= at + reach && high >= at - reach;
        let pieces = (received.pieces.iter())
            .filter(move |piece| is_near(piece.ends) && (rays.is_patched || piece.source & DIRECT == 0))
            .map(move |piece| Contributor {
                source: piece.source,
                range: piece.range,
                light: received.light_at(piece, at, scale),
            });
        let is_merged = !rays.is_patched && !received.is_empty();
        let alone = (rays.of_beam(lane))
            .filter(move |(_, met)| is_merged && met.power() > 0.0 && is_near([met.range(); 2]))
            .map(move |(ray, met)| Contributor {
                source: ray | DIRECT,
                range: met.range(),
                light: pulse_at(met.range(), met.power(), at, scale),
            });
        pieces.chain(alone)
    }
}

/// Arrivals from what the rays of a batch see in mirrors and through glass.
pub(crate) struct PathArrivals<'a> {
    pub arrivals: &'a mut Arrivals,
    /// Fraction of its beam's light that each ray represents, including the efficiency of the beam's channel.
    pub parts: &'a [f32; LANES],
    /// The lanes of the rays' beams.
    pub beams: &'a [u8; LANES],
    pub least_power: f32,
    /// The surfaces that the rays hit.
    pub first: &'a [u32; LANES],
    /// Receives the surfaces that paths hit, if requested.
    pub log: Option<&'a mut Vec<Meeting>>,
}

impl PathEchoes for PathArrivals<'_> {
    fn least(&self, _: usize) -> f32 {
        self.least_power
    }

    fn take(&mut self, echo: &PathEcho, hits: &HitBatch, _: &Contribution) {
        let power = echo.reflectance * echo.cos_incidence * self.parts[echo.lane] / (echo.range * echo.range);
        if power > 0.0 {
            let provenance = Provenance {
                cause: echo.cause,
                bounces: echo.bounces,
                first: self.first[echo.lane],
                image: echo.image,
                ..Provenance::of_hit(hits, echo.hit, echo.cos_incidence)
            };
            self.arrivals.add(usize::from(self.beams[echo.lane]), echo.range, power, provenance);
        }
    }

    fn meet(&mut self, meeting: Meeting) {
        if let Some(log) = &mut self.log {
            log.push(meeting);
        }
    }
}

/// Arrivals from the air in front of what the rays of a beam hit.
pub(crate) struct AirArrivals<'a> {
    arrivals: &'a mut Arrivals,
    rays: &'a BeamRays,
    /// Fraction of the light that the channel of each beam uses.
    efficiency: &'a [f32; LANES],
    /// Range of the farthest place that a ray of each beam gets to, m.
    end: [f32; LANES],
}

impl<'a> AirArrivals<'a> {
    /// Of the first `count` beams.
    pub fn new(
        arrivals: &'a mut Arrivals,
        rays: &'a BeamRays,
        efficiency: &'a [f32; LANES],
        count: usize,
    ) -> AirArrivals<'a> {
        let mut end = [0.0; LANES];
        for lane in 0..count {
            end[lane] = rays.end(lane);
        }
        AirArrivals { arrivals, rays, efficiency, end }
    }
}

impl AirEchoes for AirArrivals<'_> {
    fn end(&self) -> &[f32; LANES] {
        &self.end
    }

    fn least(&self) -> &[f32; LANES] {
        &[0.0; LANES]
    }

    fn take(&mut self, lane: usize, echo: AirEcho, cause: Cause) -> bool {
        // Rays that surfaces stop before do not get there.
        let share = self.rays.part_beyond(lane, echo.range);
        let power = echo.rho_eff * share * self.efficiency[lane] / (echo.range * echo.range);
        if power > 0.0 {
            self.arrivals.add(lane, echo.range, power, Provenance::of_no_surface(cause));
        }
        power > 0.0
    }
}
