//! The rays of a ping, chunk by chunk, and the echoes that they find.

use super::plan::PingPlan;
use crate::echo::{Echoes, Insonification, TubeShare, grid};
use crate::trace::{Goal, Launch, SoundTracer, Stand, TracerMemory, TubeHit};

/// Rays per task: a constant, so that results cannot depend on the number of threads.
pub(super) const CHUNK: usize = 2048;

/// The echoes of one chunk.
#[derive(Default)]
pub(super) struct RayChunk {
    pub echoes: Echoes,
    hits: Vec<TubeHit>,
    shares: Vec<TubeShare>,
}

/// Rays of one chunk and their echoes, compiled for the vector instructions of this machine.
pub(super) struct RayTask<'a, 'p> {
    pub plan: &'a PingPlan<'p>,
    pub tracer: &'a SoundTracer<'a>,
    pub insonification: &'a Insonification<'a>,
    pub number: usize,
    pub chunk: &'a mut RayChunk,
    pub memory: &'a mut TracerMemory,
}

impl RayTask<'_, '_> {
    /// Traces the rays of the chunk, and computes their echoes.
    pub fn run(self) {
        let RayTask { plan, tracer, insonification, number, chunk, memory } = self;
        let transducer = &*plan.transducer;
        let launch = Launch {
            directions: transducer.direction.each_ref().map(|axis| &axis[..]),
            rotation: plan.rotation(),
            place: plan.place(),
        };
        let rays = number * CHUNK..((number + 1) * CHUNK).min(transducer.rays());
        chunk.echoes.arrivals.clear();
        let Echoes { arrivals, direct, .. } = &mut chunk.echoes;
        tracer.trace(&launch, rays, memory, arrivals);
        direct.clear();
        if plan.acoustics.bounces > 0 {
            let (sound, surfaces) = (&plan.backscatter, &plan.scene.surfaces);
            let whole = |row: u32| sound.is_whole(surfaces, row);
            tracer.direct(&launch, whole, memory, arrivals, direct);
        }
        insonification.answer(&mut chunk.echoes);
        chunk.echoes.gather(transducer, plan.layout.bins);
    }

    /// Computes the echoes of `goals` rather than rays.
    pub fn look_at(self, goals: &[Goal]) {
        let RayTask { plan, tracer, insonification, chunk, memory, .. } = self;
        let (sound, surfaces) = (&plan.backscatter, &plan.scene.surfaces);
        let direct = &mut chunk.echoes.direct;
        direct.clear();
        tracer.sight(plan.place(), goals, |row| sound.is_whole(surfaces, row), memory, direct);
        insonification.answer_targets(&mut chunk.echoes);
        chunk.echoes.gather(&plan.transducer, plan.layout.bins);
    }

    /// Computes the echo of a body by tubes of its own.
    pub fn cover(self, stand: &Stand) {
        let RayTask { plan, tracer, insonification, chunk, memory, .. } = self;
        let RayChunk { echoes, hits, shares } = chunk;
        let grid = |sides| grid(stand, plan.wavelength(), sides);
        let smooth = |row| plan.backscatter.smooth(&plan.scene.surfaces, row).is_some();
        match tracer.cover(plan.place(), stand, grid, &smooth, memory, hits) {
            Some(way) => insonification.answer_body(&way, hits, shares, echoes),
            None => echoes.clear(),
        }
        echoes.gather(&plan.transducer, plan.layout.bins);
    }
}
