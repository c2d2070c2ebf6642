//! The light that arrives along the beams of a block: from what their rays hit, from what they see in mirrors and
//! through glass, from the air, and from bright surfaces beside them.

use super::{AirEcho, AirEchoes, BeamRays, Contribution, Meeting, PathEcho, PathEchoes, Pulselet};
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
    /// Which ray of the beam hits its surface directly; `None` if none does.
    pub ray: Option<u32>,
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
            ray: None,
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
            ray: None,
            image: 0,
        }
    }

    /// That of what ray `ray` of the beam at `lane` hits.
    pub(crate) fn of_ray(rays: &BeamRays, lane: usize, ray: u32) -> Option<Provenance> {
        let met = rays.get(ray, lane)?;
        let hit = Provenance::of_hit(&met.batch.hits, met.lane, met.cos_incidence());
        Some(Provenance { ray: Some(ray), ..hit })
    }
}

/// End of the chain of a beam's arrivals.
const NONE: u32 = u32::MAX;

/// The arrivals of a block of beams, in columns. Those from mirrors, glass, the air and beside a beam are chained beam
/// by beam as they are found; those from the surfaces that rays hit directly are added beam by beam, by
/// [`Arrivals::receive`], only where a beam is more than one plain echo.
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
    /// For arrivals that represent several rays of the beam that is received: range of the first ray, sum of power
    /// times range beyond that, power of the strongest ray.
    bundles: Vec<[f32; 3]>,
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

    fn push(&mut self, range: f32, power: f32, provenance: Provenance, before: u32) {
        self.range.push(range);
        self.power.push(power);
        self.provenance.push(provenance);
        self.before.push(before);
    }

    /// Adds what arrives along the beam at `lane` from elsewhere than the surfaces that its rays hit.
    pub fn add(&mut self, lane: usize, range: f32, power: f32, provenance: Provenance) {
        let before = self.last[lane];
        self.last[lane] = self.range.len() as u32;
        self.push(range, power, provenance, before);
    }

    /// Whether the beam at `lane` has arrivals other than from the surfaces that its rays hit.
    pub(crate) fn has_others(&self, lane: usize) -> bool {
        self.last[lane] != NONE
    }

    /// All that arrives along the beam at `lane`, as the parts of its signal, whose sources are rows of these columns:
    /// first from the surfaces that its `rays` hit, in the order of the rays. Rays that hit one surface within `width`
    /// m of range are merged; with a negative width every ray is an arrival of its own.
    pub(crate) fn receive(&mut self, rays: &BeamRays, lane: usize, width: f32, parts: &mut Vec<Pulselet>) {
        parts.clear();
        self.bundles.clear();
        let start = self.range.len();
        for (ray, met) in (0..).zip(rays.of_beam(lane)) {
            let (surface, range, power) = (met.surface(), met.range(), met.power());
            if power <= 0.0 {
                continue;
            }
            let near = |(provenance, [first, ..]): (&Provenance, &[f32; 3])| {
                provenance.surface == surface && (range - first).abs() <= width
            };
            let known = self.provenance[start..].iter().zip(&self.bundles).position(near);
            let strongest = match known {
                Some(index) => {
                    let [first, moment, most] = &mut self.bundles[index];
                    self.power[start + index] += power;
                    *moment += power * (range - *first);
                    let is_strongest = power > *most;
                    *most = most.max(power);
                    is_strongest.then_some(start + index)
                }
                None => {
                    self.push(range, power, Provenance::of_no_surface(Cause::Surface), NONE);
                    self.bundles.push([range, 0.0, power]);
                    Some(self.range.len() - 1)
                }
            };
            if let (Some(row), Some(provenance)) = (strongest, Provenance::of_ray(rays, lane, ray)) {
                self.provenance[row] = provenance;
            }
        }
        for (row, [first, moment, _]) in (start..).zip(&self.bundles) {
            self.range[row] = first + moment / self.power[row];
        }
        parts.extend((start..self.range.len()).map(|row| self.part(row as u32)));
        let mut row = self.last[lane];
        while row != NONE {
            parts.push(self.part(row));
            row = self.before[row as usize];
        }
    }

    /// Range, power and provenance of what arrives from elsewhere than the surfaces that rays hit, of a block that is
    /// one beam.
    pub fn others(&self) -> impl Iterator<Item = (f32, f32, &Provenance)> {
        let rows = (0..).zip(&self.provenance).filter(|(_, from)| from.ray.is_none());
        rows.map(|(row, from): (usize, _)| (self.range[row], self.power[row], from))
    }

    fn part(&self, row: u32) -> Pulselet {
        Pulselet { range: self.range[row as usize], power: self.power[row as usize], source: row }
    }

    /// Provenance of a part of a signal.
    pub(crate) fn provenance(&self, source: u32) -> &Provenance {
        &self.provenance[source as usize]
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
    pub arrivals: &'a mut Arrivals,
    pub rays: &'a BeamRays,
    /// Fraction of the light that the channel of each beam uses.
    pub efficiency: &'a [f32; LANES],
}

impl AirEchoes for AirArrivals<'_> {
    fn end(&self, lane: usize) -> f32 {
        self.rays.of_beam(lane).map(|met| met.end()).fold(0.0, f32::max)
    }

    fn least(&self, _: usize) -> f32 {
        0.0
    }

    fn take(&mut self, lane: usize, echo: AirEcho, cause: Cause) -> bool {
        // Rays that surfaces stop before do not get there.
        let on = self.rays.of_beam(lane).filter(|met| met.end() > echo.range).count();
        let share = on as f32 / self.rays.each as f32;
        let power = echo.rho_eff * share * self.efficiency[lane] / (echo.range * echo.range);
        if power > 0.0 {
            self.arrivals.add(lane, echo.range, power, Provenance::of_no_surface(cause));
        }
        power > 0.0
    }
}
