//! Which echoes pass: those that are strong enough for the receiver, and at a range that it reports.

use super::Threshold;
use echocast_kernels::measure;
use emitter::BeamTable;
use ground::lanes::LANES;
use ground::rng::Rng;

/// Number of the echo of the nearest surface that a beam hits directly, in whose noise it is detected. Others are
/// numbered by their range ([`numbered`]), so that echoes of the air do not change the draws of surfaces.
pub const NEAREST: u32 = 0;

/// Number of another echo, from `range` m.
pub fn numbered(range: f32) -> u32 {
    range.to_bits()
}

/// The gate of a scan.
pub(crate) struct Gate<'a> {
    pub threshold: &'a Threshold,
    pub rng: Rng,
    /// Nearest and farthest range that is reported where the table of beams has no limits, m.
    pub range: [f32; 2],
    pub beams: &'a BeamTable,
}

impl Gate<'_> {
    /// Nearest and farthest range that is reported for `beam`, m.
    pub fn limits(&self, beam: u32) -> [f32; 2] {
        let [low, high] = self.range;
        let of = |limits: &[f32], otherwise: f32| limits.get(beam as usize).copied().unwrap_or(otherwise);
        [of(&self.beams.range_min, low), of(&self.beams.range_max, high)]
    }

    /// Least `rho_eff / R^2` that is ever detected, 1/m^2; 0 where the model defines none.
    pub(crate) fn least_power(&self) -> f32 {
        self.threshold.faintest()
    }

    /// Whether `echo`, a number, of `beam` with the effective reflectance `rho_eff` from `range` m is strong enough.
    pub(crate) fn detects(&self, beam: u32, echo: u32, rho_eff: f32, range: f32) -> bool {
        self.threshold.detects(rho_eff, range, self.threshold.noise(&self.rng, beam, echo))
    }

    /// Whether it passes: it is strong enough, and its range is reported.
    pub fn passes(&self, beam: u32, echo: u32, rho_eff: f32, range: f32) -> bool {
        let [low, high] = self.limits(beam);
        (low..=high).contains(&range) && self.detects(beam, echo, rho_eff, range)
    }

    /// [`Gate::detects`] of the nearest surface of each of `beams`, one per lane. What is `settled` has been detected in
    /// its own noise, and only light that is dimmed since then removes it.
    pub(crate) fn detects_all(
        &self,
        beams: &[u32],
        rho_eff: &[f32; LANES],
        range: &[f32; LANES],
        settled: Option<&[bool; LANES]>,
    ) -> [bool; LANES] {
        let (mut noise, mut detected) = ([0.0; LANES], [true; LANES]);
        self.threshold.noises(&self.rng, beams, &mut noise[..beams.len()]);
        if let Some(settled) = settled {
            for lane in 0..LANES {
                if settled[lane] {
                    noise[lane] = f32::INFINITY;
                }
            }
        }
        self.threshold.detect(rho_eff, range, &noise, &mut detected);
        detected
    }

    /// Removes from `surface` what `beams`, one per lane, hit at `ranges` that are not reported.
    pub fn limit(&self, beams: &[u32], ranges: &[f32; LANES], surface: &mut [u32; LANES]) {
        if self.beams.range_min.is_empty() && self.beams.range_max.is_empty() {
            let [low, high] = self.range;
            return measure::limit(ranges, low, high, surface);
        }
        let (mut low, mut high) = ([0.0; LANES], [0.0; LANES]);
        for (lane, &beam) in beams.iter().enumerate() {
            [low[lane], high[lane]] = self.limits(beam);
        }
        measure::limit_each(ranges, &low, &high, surface);
    }
}
