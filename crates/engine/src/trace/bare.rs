//! The yardstick for speed: Embree alone, on the rays of a scan.

use super::{BuiltScene, Tables};
use echocast_kernels::measure;
use embree4::{Coherence, INVALID, Packet};
use ground::lanes::{CHUNK, LANES, RayBatch};
use rayon::prelude::*;

/// A bare loop over the fastest Embree call, on the same committed scene and the same rays as a scan: the upper bound.
/// It stores 48 bytes a ray (position, range, normal, u, v, three ids) and does nothing else; rays are prepared
/// beforehand.
pub struct BareLoop<'a> {
    scene: &'a Tables,
    coherent: bool,
    /// Whether the rays of a block have different origins.
    spread: bool,
    /// World directions, range limits; a block of [`LANES`] rays each.
    rays: Vec<RayBatch>,
    hits: Vec<BareHits>,
    /// Number of valid rays in each block.
    counts: Vec<usize>,
}

/// 48 bytes a ray.
#[derive(Clone)]
struct BareHits {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
    range: [f32; LANES],
    normal_x: [f32; LANES],
    normal_y: [f32; LANES],
    normal_z: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
    triangle: [u32; LANES],
    geometry: [u32; LANES],
    instance: [u32; LANES],
}

impl BareHits {
    const ZERO: BareHits = BareHits {
        x: [0.0; LANES],
        y: [0.0; LANES],
        z: [0.0; LANES],
        range: [0.0; LANES],
        normal_x: [0.0; LANES],
        normal_y: [0.0; LANES],
        normal_z: [0.0; LANES],
        u: [0.0; LANES],
        v: [0.0; LANES],
        triangle: [0; LANES],
        geometry: [0; LANES],
        instance: [0; LANES],
    };
}

impl<'a> BareLoop<'a> {
    /// For `rays`, in blocks with `counts` valid rays; `coherent`: neighbours in a block are neighbours in angle;
    /// `spread`: the rays of a block have different origins.
    #[doc(hidden)]
    pub fn of(scene: &'a BuiltScene, [coherent, spread]: [bool; 2], rays: Vec<RayBatch>, counts: Vec<usize>) -> Self {
        let hits = vec![BareHits::ZERO; rays.len()];
        BareLoop { scene: &scene.0, coherent, spread, rays, hits, counts }
    }

    /// Traces all rays once.
    pub fn run(&mut self) {
        let (scene, coherent, spread) = (self.scene, self.coherent, self.spread);
        let blocks = CHUNK / LANES;
        let chunks = self.rays.par_chunks(blocks).zip(self.counts.par_chunks(blocks));
        chunks.zip(self.hits.par_chunks_mut(blocks)).for_each(|((rays, counts), hits)| {
            let chunk = BareChunk { scene, coherent, spread, counts, rays, hits };
            match scene.packet_width {
                16 => chunk.run::<16>(),
                8 => chunk.run::<8>(),
                _ => chunk.run::<4>(),
            }
        });
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

struct BareChunk<'a> {
    scene: &'a Tables,
    coherent: bool,
    spread: bool,
    counts: &'a [usize],
    rays: &'a [RayBatch],
    hits: &'a mut [BareHits],
}

impl BareChunk<'_> {
    fn run<const W: usize>(self) {
        let coherence = if self.coherent { Coherence::Coherent } else { Coherence::Incoherent };
        let mut packet = Packet::<W>::new();
        for ((rays, out), &count) in self.rays.iter().zip(self.hits).zip(self.counts) {
            let mut valid = [-1; W];
            packet.org_x = [rays.org_x[0]; W];
            packet.org_y = [rays.org_y[0]; W];
            packet.org_z = [rays.org_z[0]; W];
            for first in (0..count).step_by(W) {
                let lanes = first..first + W;
                if self.spread {
                    packet.org_x.copy_from_slice(&rays.org_x[lanes.clone()]);
                    packet.org_y.copy_from_slice(&rays.org_y[lanes.clone()]);
                    packet.org_z.copy_from_slice(&rays.org_z[lanes.clone()]);
                }
                packet.dir_x.copy_from_slice(&rays.dir_x[lanes.clone()]);
                packet.dir_y.copy_from_slice(&rays.dir_y[lanes.clone()]);
                packet.dir_z.copy_from_slice(&rays.dir_z[lanes.clone()]);
                packet.tfar.copy_from_slice(&rays.range_max[lanes.clone()]);
                packet.geom_id = [INVALID; W];
                packet.inst_id = [INVALID; W];
                if first + W > count {
                    valid[count - first..].fill(0);
                }
                self.scene.structure.intersect(&valid, &mut packet, coherence);
                out.range[lanes.clone()].copy_from_slice(&packet.tfar);
                out.normal_x[lanes.clone()].copy_from_slice(&packet.ng_x);
                out.normal_y[lanes.clone()].copy_from_slice(&packet.ng_y);
                out.normal_z[lanes.clone()].copy_from_slice(&packet.ng_z);
                out.u[lanes.clone()].copy_from_slice(&packet.u);
                out.v[lanes.clone()].copy_from_slice(&packet.v);
                out.triangle[lanes.clone()].copy_from_slice(&packet.prim_id);
                out.geometry[lanes.clone()].copy_from_slice(&packet.geom_id);
                out.instance[lanes].copy_from_slice(&packet.inst_id);
            }
            measure::place(&rays.org_x, &rays.dir_x, &out.range, &mut out.x);
            measure::place(&rays.org_y, &rays.dir_y, &out.range, &mut out.y);
            measure::place(&rays.org_z, &rays.dir_z, &out.range, &mut out.z);
        }
    }
}
