//! Noise that looks like an echo.

use super::{Detection, Threshold};
use ground::lanes::LANES;
use ground::rng::{Draw, Rng};
use ground::units::SPEED_OF_LIGHT;

/// Most false alarms drawn for one beam, nearest first.
const MOST_ALARMS: u32 = 64;

/// False alarms of a statistical detector: where its noise alone crosses the threshold. They are uniform over range.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FalseAlarms {
    /// Mean number per metre of range.
    per_m: f32,
    /// `rho_eff / R^2` of an echo as strong as the noise in darkness, 1/m^2.
    unit: f32,
    /// Threshold and noise relative to that.
    level: f32,
    sigma: f32,
}

impl FalseAlarms {
    /// For a receiver with `detection`, prepared as `threshold`; none where its noise is unknown.
    pub fn new(detection: &Detection, threshold: &Threshold) -> Option<FalseAlarms> {
        let (Detection::Statistical(receiver), &Threshold::Statistical { unit, level, sigma, .. }) =
            (detection, threshold)
        else {
            return None;
        };
        let per_s = rate(receiver.bandwidth_mhz * 1e6, f64::from(level / sigma));
        let per_m = (per_s * 2.0 / SPEED_OF_LIGHT) as f32;
        (per_m > 0.0).then_some(FalseAlarms { per_m, unit, level, sigma })
    }

    /// Probability that a beam has one or more within `length` m.
    fn some(&self, length: f32) -> f32 {
        1.0 - (-self.per_m * length).exp()
    }

    /// Reports the false alarms of all `beams`, by index into `beams`, as [`FalseAlarms::of_beam`] does; `limits` gives
    /// the reported ranges of a beam, `farthest` the greatest for all, m.
    pub(crate) fn of_beams(
        &self,
        rng: &Rng,
        beams: &[u32],
        farthest: f32,
        limits: impl Fn(u32) -> [f32; 2],
        mut report: impl FnMut(usize, f32, f32),
    ) {
        let mut chance = [0.0; LANES];
        rng.uniforms(beams, &[0; LANES][..beams.len()], Draw::FalseAlarm, &mut chance[..beams.len()]);
        let some = self.some(farthest);
        for (lane, &beam) in beams.iter().enumerate().filter(|&(lane, _)| chance[lane] < some) {
            let [from, to] = limits(beam);
            self.of_beam(rng, beam, [from, to.min(farthest)], |range, rho_eff| report(lane, range, rho_eff));
        }
    }

    /// Reports the false alarms of `beam` from `from` to `to` m: range, m, ascending, and effective reflectance of an
    /// equally strong surface there. There is one if the first number of [`Draw::FalseAlarm`] is below
    /// [`FalseAlarms::some`].
    fn of_beam(&self, rng: &Rng, beam: u32, [from, to]: [f32; 2], mut report: impl FnMut(f32, f32)) {
        let mut range = from;
        for alarm in 0..MOST_ALARMS {
            let [gap, amplitude, ..] = rng.four(beam, Draw::FalseAlarm, alarm);
            // Exponential gaps: a Poisson number of alarms, uniform over range.
            range -= (1.0 - gap).ln() / self.per_m;
            if range >= to {
                return;
            }
            // Rice: peaks of the noise above the threshold, A = sqrt(TNR^2 - 2 ln u).
            let noise = self.sigma * self.sigma * -2.0 * (1.0 - amplitude).ln();
            report(range, self.unit * (self.level * self.level + noise).sqrt() * range * range);
        }
    }
}

/// False alarms per second of noise through an ideal low-pass of `bandwidth` Hz, at a threshold-to-noise ratio `tnr`
/// (Rice 1945, level crossings of a Gaussian process): `B / sqrt 3 exp(-TNR^2 / 2)`.
fn rate(bandwidth: f64, tnr: f64) -> f64 {
    bandwidth / 3f64.sqrt() * (-tnr * tnr / 2.0).exp()
}

#[cfg(test)]
mod tests {
    use super::super::Statistical;
    use super::*;

    fn alarms(bandwidth_mhz: f64, tnr: f64) -> Option<FalseAlarms> {
        let receiver =
            Statistical { reflectance: 0.1, at_m: 100.0, probability: 0.9, tnr, bandwidth_mhz, sunlight: None };
        let detection = Detection::Statistical(receiver);
        FalseAlarms::new(&detection, &Threshold::new(&detection, (905.0, 5.0), false))
    }

    /// 100 MHz; TNR, alarms per second and per shot over 200 m. Computed with numpy.
    #[test]
    fn false_alarms_are_as_many_as_level_crossings() {
        for (tnr, per_s, per_shot) in [(4.0, 19_367.9, 0.025_841_8), (5.0, 215.158, 2.870_76e-4)] {
            assert!((rate(100e6, tnr) / per_s - 1.0).abs() < 5e-6);
            let alarms = alarms(100.0, tnr).unwrap();
            assert!((f64::from(alarms.per_m) * 200.0 / per_shot - 1.0).abs() < 5e-6);
            assert!((f64::from(alarms.some(200.0)) - (1.0 - (-per_shot).exp())).abs() < 1e-6);
        }
        assert!(alarms(0.0, 5.0).is_none());
        assert!(FalseAlarms::new(&Detection::None, &Threshold::Open).is_none());
    }

    /// Number, range and amplitude: a Poisson number, uniform over the gate, Rayleigh above the threshold.
    #[test]
    fn alarms_are_spread_as_noise_is() {
        let (alarms, rng) = (alarms(1000.0, 4.0).unwrap(), Rng::new(3, 1));
        let beams = 40_000;
        let mean = f64::from(alarms.per_m) * 150.0;
        let (mut count, mut places, mut squares) = (0.0, 0.0, 0.0);
        for beam in 0..beams {
            let mut first = [0.0];
            rng.uniforms(&[beam], &[0], Draw::FalseAlarm, &mut first);
            let mut any = false;
            alarms.of_beam(&rng, beam, [50.0, 200.0], |range, rho_eff| {
                assert!((50.0..200.0).contains(&range));
                let amplitude = f64::from(rho_eff / (range * range) / alarms.unit);
                assert!(amplitude > 4.0 - 1e-5);
                (any, count) = (true, count + 1.0);
                (places, squares) = (places + f64::from(range), squares + (amplitude * amplitude - 16.0) / 2.0);
            });
            assert_eq!(any, first[0] < alarms.some(150.0), "beam {beam}");
        }
        // Three standard errors: of a Poisson number, of a uniform distribution, of an exponential one.
        let expected = mean * f64::from(beams);
        assert!((count - expected).abs() < 3.0 * expected.sqrt(), "{count} {expected}");
        assert!((places / count - 125.0).abs() < 3.0 * 150.0 / (12.0 * count).sqrt(), "{}", places / count);
        assert!((squares / count - 1.0).abs() < 3.0 / count.sqrt(), "{}", squares / count);
    }

    #[test]
    fn however_much_noise_there_is_alarms_end() {
        let mut count = 0;
        alarms(1e5, 1.0).unwrap().of_beam(&Rng::new(0, 0), 0, [0.0, 1e9], |_, _| count += 1);
        assert_eq!(count, MOST_ALARMS);
    }
}
