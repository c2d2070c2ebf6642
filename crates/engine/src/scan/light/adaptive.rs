//! Beams of as many rays as it takes: in rounds, until the rays of a round show nothing new.

use super::gather::Gatherer;
use super::plan::ScanPlan;
use super::rounds::{Evidence, GoingOn, Rounds};
use crate::detect::ReturnMode;
use crate::echo::{Batch, Follower, HitTriangle, PathArrivals, RequestedQuantities, TracedRay};
use crate::sensor::{Adaptive, Signals};
use crate::trace::{Cover, Holes};
use emitter::{ROUND, SubRayFan};
use ground::lanes::{LANES, RayBatch, boxed};

/// Least rays of a beam that meets a mirror, glass or holes: what is behind is not known to be the same for all rays
/// that meet it.
const LEAST_OF_DIVIDED: u32 = 32;

/// Least rays of a beam that can have several echoes; where only the strongest matters, of one that meets several
/// surfaces.
const LEAST_OF_SEVERAL: u32 = 16;

impl Gatherer {
    /// Traces rays of `count` beams, each until they show nothing new. `rays` is a buffer for them.
    pub(super) fn meet_in_rounds(
        &mut self,
        scan: &ScanPlan,
        (signals, adaptive): (&Signals, &Adaptive),
        rays: &mut RayBatch,
        evidence: &[Evidence],
    ) {
        let Some(footprint) = &signals.footprint else { return };
        let (count, each) = (evidence.len(), footprint.count());
        let mut rounds = self.rounds.take().unwrap_or_else(boxed);
        let sigma = self.found.waveform.sigma();
        let off = scan.receiver.off_surface(sigma);
        self.rays.patch_up(each, &self.beams.range_max[..count]);
        rounds.fans.resize_with(LANES, SubRayFan::default);
        let scene = scan.world.scene;
        let only_strongest = signals.rule.mode == ReturnMode::Strongest && scan.receiver.camera().is_none();
        for (lane, evidence) in evidence.iter().enumerate() {
            footprint.fan(&self.across, &self.beams, lane, &mut rounds.fans[lane]);
            for &(surface, triangle) in evidence.seen() {
                let seen = HitTriangle { surface, triangle, is_solid: scan.is_solid(surface) };
                self.rays.patchworks[lane].know(scene, seen, &rounds.fans[lane], self.beams.time[lane]);
            }
        }
        let Rounds { active, news, divided, kept, .. } = &mut *rounds;
        active.clear();
        active.extend((0..count).map(|lane| lane as u8));
        news.resize(LANES, false);
        divided.clear();
        divided.resize(LANES, false);
        *kept = 0;
        let mut batch = 0;
        while !rounds.active.is_empty() {
            let mut active = std::mem::take(&mut rounds.active);
            let mut rest = &active[..];
            while !rest.is_empty() {
                let sent = self.send_round(scan, &mut rounds, rays, rest, (batch, off));
                rest = &rest[sent..];
                batch += 1;
            }
            active.retain(|&lane| {
                let lane = usize::from(lane);
                let (patchwork, shows_news) = (&self.rays.patchworks[lane], std::mem::take(&mut rounds.news[lane]));
                let several = !(only_strongest && patchwork.is_one_surface());
                let is_unsure = several && patchwork.traced() < LEAST_OF_SEVERAL
                    || rounds.divided[lane] && patchwork.traced() < LEAST_OF_DIVIDED;
                let is_left = shows_news && !(only_strongest && patchwork.is_decided(sigma));
                (is_unsure || is_left) && patchwork.traced() < scan.most_adaptive
            });
            rounds.active = active;
        }
        self.plain.clear();
        for lane in 0..count {
            self.rays.patchworks[lane].settle(&rounds.fans[lane], &adaptive.near);
            self.plain.join(&self.rays, lane, sigma);
        }
        for going_on in &rounds.going_on[..rounds.kept] {
            self.go_on(scan, going_on);
        }
        self.rounds = Some(rounds);
    }

    /// Traces the next round of rays of the beams in `lanes`, with the number `batch`; sets the news of those that
    /// show something new, more than `off` m off what is known. Returns how many of the beams were served.
    fn send_round(
        &mut self,
        scan: &ScanPlan,
        rounds: &mut Rounds,
        rays: &mut RayBatch,
        lanes: &[u8],
        (batch, off): (usize, f32),
    ) -> usize {
        let each = self.rays.each;
        let (mut beams, mut chosen, mut parts, mut count) = ([0; LANES], [0; LANES], [0.0; LANES], 0);
        let mut sent = 0;
        for &lane in lanes {
            if count + ROUND > LANES {
                break;
            }
            sent += 1;
            let SubRayFan { origin: [ox, oy, oz], direction: [dx, dy, dz] } = &rounds.fans[usize::from(lane)];
            let beam = usize::from(lane);
            for point in self.rays.patchworks[beam].choose(scan.most_adaptive) {
                (rays.org_x[count], rays.org_y[count], rays.org_z[count]) = (ox[point], oy[point], oz[point]);
                (rays.dir_x[count], rays.dir_y[count], rays.dir_z[count]) = (dx[point], dy[point], dz[point]);
                (rays.range_max[count], rays.time[count]) = (self.beams.range_max[beam], self.beams.time[beam]);
                rays.beam[count] = self.beams.beam[beam];
                (beams[count], chosen[count]) = (lane, point as u8);
                parts[count] = self.efficiency[beam] / each as f32;
                count += 1;
            }
        }
        // Rays of one beam are coherent, whatever the scan pattern.
        self.meet(scan, (rays, true), batch, count, &parts);
        for lane in 0..count {
            let (beam, point) = (beams[lane], usize::from(chosen[lane]));
            let Batch { hits, power, .. } = &self.rays.batches[batch];
            let (surface, goes_on) =
                (hits.surface[lane], scan.world.paths.is_some() && scan.goes_on(hits.surface[lane]));
            let traced = TracedRay {
                seen: HitTriangle { surface, triangle: hits.triangle[lane], is_solid: scan.is_solid(surface) },
                ray: (batch as u32, lane as u32),
                range: hits.range[lane],
                time: rays.time[lane],
                place: rays.origin(lane) + rays.direction(lane) * hits.range[lane],
                facet: hits.facet(lane),
                power: if goes_on { 0.0 } else { power[lane] },
            };
            let patchwork = &mut self.rays.patchworks[usize::from(beam)];
            let fan = &rounds.fans[usize::from(beam)];
            let (patch, is_new) = patchwork.take(scan.world.scene, point, &traced, fan, off);
            rounds.news[usize::from(beam)] |= is_new;
            let has_holes = scan.world.scene.surfaces.has_holes && hits.veil[lane] <= hits.range[lane];
            rounds.divided[usize::from(beam)] |= goes_on || has_holes;
            if goes_on {
                let (store, to) = rounds.keep(rays, hits, &self.surfaces, lane, beam);
                rounds.going_on[store].patches[to] = patch;
            }
        }
        sent
    }

    /// Follows light that continues from surfaces, each ray as the part of its patch.
    fn go_on(&mut self, scan: &ScanPlan, from: &GoingOn) {
        let Some(limits) = scan.world.paths else { return };
        let GoingOn { rays, hits, surfaces, beams, patches, count } = from;
        let mut parts = [0.0; LANES];
        for lane in 0..*count {
            let beam = usize::from(beams[lane]);
            let patch = &self.rays.patchworks[beam].patches[patches[lane] as usize];
            parts[lane] = self.efficiency[beam] * patch.points_per_ray() / self.rays.each as f32;
        }
        let lanes: [u8; LANES] = std::array::from_fn(|lane| lane as u8);
        let Gatherer { arrivals, follower, log, .. } = self;
        let requested = RequestedQuantities { colors: false, reflectance: true };
        let around = scan.surroundings(scan.world.air, limits, requested, rays);
        let least_power = scan.least_power_of_paths();
        let first = &hits.surface;
        let mut echoes = PathArrivals { arrivals, parts: &parts, beams, least_power, first, log: log.as_mut() };
        let follower: &mut Follower = follower.get_or_insert_with(boxed);
        follower.begin(rays, hits, surfaces, &lanes[..*count]);
        follower.follow(&around, &mut echoes);
    }
}

impl ScanPlan<'_> {
    /// Whether every ray that meets a `surface`, a row or [`MISS`](ground::lanes::MISS), is stopped by it.
    fn is_solid(&self, surface: u32) -> bool {
        let row = self.world.scene.surfaces.rows.get(surface as usize);
        row.is_some_and(|row| match row.holes {
            Holes::Nowhere => true,
            Holes::Cut => false,
            Holes::Between => matches!(self.world.sight.cover, Cover::Reflecting),
        })
    }
}
