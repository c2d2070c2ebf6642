//! The signal that a beam receives, as the pulses that it consists of.

use echocast_kernels::math::exp_negative;
use echocast_kernels::signal;
use emitter::SubRayFan;

/// A piece of the signal: the pulses that one source returns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pulselet {
    /// Mean range, m.
    pub range: f32,
    /// Sum of peak powers, 1/m^2.
    pub power: f32,
    /// Where it comes from, as numbered by the caller.
    pub source: u32,
    /// Least and greatest range of its pulses, m.
    pub ends: [f32; 2],
    /// The first of its pulses, and how many it has.
    first: u32,
    count: u32,
}

/// All pieces of a signal.
#[derive(Debug)]
pub(crate) struct BeamSignal {
    pub pieces: Vec<Pulselet>,
    /// Ranges, m, and peak powers, 1/m^2, of all pulses, piece after piece.
    ranges: Vec<f32>,
    powers: Vec<f32>,
}

/// What a pulse of a peak `power`, 1/m^2, at a `range`, m, contributes at the range `at`, m, 1/m^2; `scale`: one over its
/// standard deviation, 1/m.
pub(crate) fn pulse_at(range: f32, power: f32, at: f32, scale: f32) -> f32 {
    let x = (range - at) * scale;
    power * exp_negative(0.5 * x * x)
}

impl Default for BeamSignal {
    /// With memory for what rays hit directly, so that it grows only for what else arrives.
    fn default() -> Self {
        let most = 2 * SubRayFan::MOST;
        BeamSignal {
            pieces: Vec::with_capacity(most),
            ranges: Vec::with_capacity(most),
            powers: Vec::with_capacity(most),
        }
    }
}

impl BeamSignal {
    pub fn clear(&mut self) {
        self.pieces.clear();
        self.ranges.clear();
        self.powers.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Adds a piece of one pulse.
    pub fn push(&mut self, range: f32, power: f32, source: u32) {
        self.push_pulses(source, [range, power], [range; 2], std::iter::once(range), power);
    }

    /// Adds a piece with a mean range, m, and the power of all, 1/m^2, between `ends`, m, of pulses at `ranges` that
    /// have the power `each`.
    pub fn push_pulses(
        &mut self,
        source: u32,
        [range, power]: [f32; 2],
        ends: [f32; 2],
        ranges: impl Iterator<Item = f32>,
        each: f32,
    ) {
        let first = self.ranges.len();
        self.ranges.extend(ranges);
        self.powers.resize(self.ranges.len(), each);
        let count = (self.ranges.len() - first) as u32;
        self.pieces.push(Pulselet { range, power, source, ends, first: first as u32, count });
    }

    /// Sorts its pieces by where they begin, the nearest first.
    pub fn sort(&mut self) {
        // Bits of ranges, which are not negative, have their order.
        let key = |piece: &Pulselet| u64::from(piece.ends[0].to_bits()) << 32 | u64::from(piece.source);
        self.pieces.sort_unstable_by_key(key);
    }

    /// Ranges, m, and powers, 1/m^2, of all pulses.
    pub fn pulses(&self) -> [&[f32]; 2] {
        [&self.ranges, &self.powers]
    }

    /// Ranges, m, and powers, 1/m^2, of the pulses of a `piece`.
    pub fn pulses_of(&self, piece: &Pulselet) -> [&[f32]; 2] {
        let of = piece.first as usize..(piece.first + piece.count) as usize;
        [&self.ranges[of.clone()], &self.powers[of]]
    }

    /// What a `piece` contributes at the range `at`, m, 1/m^2; `scale`: one over the standard deviation of the pulse,
    /// 1/m.
    pub fn light_at(&self, piece: &Pulselet, at: f32, scale: f32) -> f32 {
        let [ranges, powers] = self.pulses_of(piece);
        if let (&[range], &[power]) = (ranges, powers) {
            return pulse_at(range, power, at, scale);
        }
        let [light, ..] = signal::pull(ranges, powers, at, scale);
        light
    }
}
