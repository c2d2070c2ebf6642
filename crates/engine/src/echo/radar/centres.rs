//! Scatterer centres: echoes of one target that a radar cannot tell apart, joined into one.
//!
//! The parts of a corner and the facets of a ball are far more than the cells that they return into. Where ranges, range
//! rates and directions differ by small fractions of what the radar resolves, amplitudes are added; phases stay those of
//! the parts.

use super::echoes::{RadarEcho, RadarEchoes, RadarRoute};
use glam::Vec3;

/// Parts of a cell within which echoes are joined: the phase of none is off by more than 0.1 rad at either end of the band
/// or of the array, and half as much on average.
const PARTS: f64 = 16.0;

/// What echoes are joined within: steps in range, m, range rate, m/s, and the sines of directions to the left and up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CentreGrid {
    range: f64,
    rate: f32,
    sines: [f32; 2],
}

/// Buffers of [`CentreGrid::join`].
#[derive(Default)]
pub(crate) struct CentreMemory {
    order: Vec<(u128, u32)>,
    joined: RadarEchoes,
}

impl CentreGrid {
    /// For a radar that resolves `range`, m, `rate`, m/s, and the sines `beam` to the left and up.
    pub fn new(range: f64, rate: f64, beam: [f64; 2]) -> CentreGrid {
        CentreGrid {
            range: range / PARTS,
            rate: (rate / PARTS) as f32,
            sines: beam.map(|width| (width / PARTS).max(1e-4) as f32),
        }
    }

    /// Joins the echoes of one target, which all take the same mirrors.
    pub fn join(&self, echoes: &mut RadarEchoes, memory: &mut CentreMemory) {
        let CentreMemory { order, joined } = memory;
        order.clear();
        order.extend((0..echoes.route.len()).map(|at| (self.bin(echoes, at), at as u32)));
        order.sort_unstable();
        if !order.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return;
        }
        joined.clear();
        for centre in order.chunk_by(|a, b| a.0 == b.0) {
            joined.push(centre_of(echoes, centre));
        }
        std::mem::swap(echoes, joined);
    }

    /// A number that echoes share which are joined.
    fn bin(&self, echoes: &RadarEchoes, at: usize) -> u128 {
        let paths = &echoes.paths;
        let [tx, rx] = [paths.tx_direction[at], paths.rx_direction[at]];
        let mut bin = match echoes.route[at] {
            RadarRoute::Direct => 0,
            RadarRoute::Out => 1,
            RadarRoute::Back => 2,
            RadarRoute::Both => 3,
        };
        // What is ahead and what is behind have the same sines.
        bin = bin << 2 | u128::from(tx[0] < 0.0) << 1 | u128::from(rx[0] < 0.0);
        let mut add = |place: f64, bits: u32| {
            let most = (1_i64 << bits) - 1;
            let step = (place.floor() as i64 + (1 << (bits - 1))).clamp(0, most);
            bin = bin << bits | step as u128;
        };
        add(paths.range[at] / self.range, 28);
        add((paths.range_rate[at] / self.rate).into(), 24);
        for [_, y, z] in [tx, rx] {
            add((y / self.sines[0]).into(), 16);
            add((z / self.sines[1]).into(), 16);
        }
        bin
    }
}

/// The sum of some echoes, which is at their mean range and direction, weighted with their powers, and of the strongest.
fn centre_of(echoes: &RadarEchoes, members: &[(u128, u32)]) -> RadarEcho {
    let first = members[0].1 as usize;
    if members.len() == 1 {
        return echoes.one(first);
    }
    let mut strongest = (-1.0, first);
    let (mut weight, mut range, mut rate) = (0.0, 0.0, 0.0);
    let mut sum = num_complex::Complex32::ZERO;
    let mut ends = [(Vec3::ZERO, 0.0_f32); 2];
    for &(_, at) in members {
        let at = at as usize;
        let echo = echoes.one(at);
        let power = echo.amplitude.norm_sqr();
        if power > strongest.0 {
            strongest = (power, at);
        }
        weight += power;
        sum += echo.amplitude;
        range += f64::from(power) * echo.range;
        rate += power * echo.range_rate;
        for (end, own) in ends.iter_mut().zip([echo.tx, echo.rx]) {
            end.0 += own.0 * power;
            end.1 += own.1 * power;
        }
    }
    let whole = echoes.one(strongest.1);
    // Beyond what numbers can hold: any of them is as good.
    if !weight.is_finite() || weight <= 0.0 {
        return RadarEcho { amplitude: sum, ..whole };
    }
    let [tx, rx] = ends.map(|(direction, distance)| (direction.normalize_or_zero(), distance / weight));
    RadarEcho { range: range / f64::from(weight), range_rate: rate / weight, amplitude: sum, tx, rx, ..whole }
}
