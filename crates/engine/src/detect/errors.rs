//! All measurement errors of an instrument: each step of a scan gets those of its quantity from here.

use super::{AzimuthError, Doppler, EncoderScale, IntensityError, Noise, RangeError, Returns, Threshold, WeakDropout};
use echocast_kernels::measure;
use ground::lanes::{LANES, MISS};
use ground::rng::{Draw, Rng};
use ground::units::seconds_from_us;

/// The errors of one scan.
#[derive(Debug)]
pub struct Errors {
    range: RangeError,
    intensity: Option<IntensityError>,
    azimuth: Option<AzimuthError>,
    /// Standard deviation of the beams' true directions about the reported ones, rad.
    pub pointing_sigma: f32,
    /// The scale error of the encoder of scan angles.
    pub(crate) encoder: Option<EncoderScale>,
    /// Standard deviation of the reported time, s.
    time_sigma: f64,
    doppler: Option<Doppler>,
    dropout: f32,
    dropout_weak: Option<WeakDropout>,
    /// Whether anything has errors, pointing included.
    pub any: bool,
}

impl Errors {
    /// For an instrument with this `noise` and its errors of `range`, which measures velocities as `doppler` specifies,
    /// or not at all; `across`: it counts scan angles across, from straight down.
    pub fn new(
        noise: &Noise,
        range: RangeError,
        threshold: &Threshold,
        doppler: Option<Doppler>,
        across: bool,
    ) -> Errors {
        Errors {
            range,
            intensity: IntensityError::new(noise, threshold),
            azimuth: AzimuthError::new(noise),
            pointing_sigma: noise.pointing_sigma_deg.to_radians() as f32,
            encoder: EncoderScale::new(noise.encoder_scale_ppm, across),
            time_sigma: seconds_from_us(noise.time_sigma_us),
            doppler,
            dropout: noise.dropout as f32,
            dropout_weak: noise.dropout_weak,
            any: *noise != Noise::default(),
        }
    }

    /// Whether light may matter although it is not reported: returns are lost depending on their strength.
    pub(crate) fn depend_on_light(&self) -> bool {
        self.dropout_weak.is_some()
    }

    /// Whether reported azimuths differ from the true ones.
    pub(crate) fn turn_beams(&self) -> bool {
        self.azimuth.is_some()
    }

    /// Measured ranges, m, of returns whose ranges without errors would be `formed`; `in_proportion` is the standard
    /// deviation over range that rain adds. Sets `flicker`, the factor on the light of each return in the reported
    /// intensity, if requested.
    pub fn measure(
        &self,
        rng: &Rng,
        returns: &Returns,
        formed: &[f32; LANES],
        in_proportion: f32,
        measured: &mut [f32; LANES],
        flicker: Option<&mut [f32; LANES]>,
    ) {
        let count = returns.beams.len();
        let measured = &mut measured[..count];
        if let (Some(error), Some(factors)) = (self.intensity, flicker) {
            let factors = &mut factors[..count];
            rng.normal_pairs(returns.beams, returns.numbers, Draw::RangeJitter, measured, factors);
            error.factors(&returns.rho_eff[..count], &returns.range[..count], factors);
        } else if self.range.draws() {
            rng.normals(returns.beams, returns.numbers, Draw::RangeJitter, measured);
        }
        self.range.measure(returns.channels, &returns.rho_eff[..count], &formed[..count], measured);
        if in_proportion > 0.0 {
            let mut noise = [0.0; LANES];
            rng.normals(returns.beams, returns.numbers, Draw::RainRange, &mut noise[..count]);
            measure::add_in_proportion(measured, returns.range, &noise, in_proportion);
        }
        self.range.round(measured);
    }

    /// Whether intensities have errors.
    pub(crate) fn flicker(&self) -> bool {
        self.intensity.is_some()
    }

    /// Whether the instrument measures radial velocities.
    pub(crate) fn measures_doppler(&self) -> bool {
        self.doppler.is_some()
    }

    /// Turns the true radial velocities of returns, m/s, into measured ones, NaN if the instrument measures none;
    /// `false_alarm` states which of them are false alarms.
    pub fn shift(
        &self,
        rng: &Rng,
        returns: &Returns,
        false_alarm: impl Fn(usize) -> bool,
        velocity: &mut [f32; LANES],
    ) {
        match &self.doppler {
            Some(doppler) => doppler.measure(rng, returns, false_alarm, velocity),
            None => velocity.fill(f32::NAN),
        }
    }

    /// Removes the surfaces of returns that are lost.
    pub fn lose(&self, rng: &Rng, returns: &Returns, surface: &mut [u32; LANES]) {
        let count = returns.beams.len();
        let mut chance = [0.0; LANES];
        if self.dropout > 0.0 {
            rng.uniforms(returns.beams, returns.numbers, Draw::Dropout, &mut chance[..count]);
            measure::lose(&chance[..count], self.dropout, surface);
        }
        if let Some(weak) = &self.dropout_weak {
            rng.uniforms(returns.beams, returns.numbers, Draw::WeakDropout, &mut chance[..count]);
            for lane in 0..count {
                if chance[lane] < weak.probability(returns.rho_eff[lane]) {
                    surface[lane] = MISS;
                }
            }
        }
    }

    /// By how much, rad, counter-clockwise, `beams` in the directions `x`, `y` (sensor frame) are reported off their
    /// true azimuth.
    pub fn turn(&self, rng: &Rng, beams: &[u32], [x, y]: [&[f32]; 2], turn: &mut [f32]) {
        if let Some(error) = &self.azimuth {
            // All returns of a beam share one direction.
            rng.normals(beams, &[0; LANES][..beams.len()], Draw::AzimuthJitter, turn);
            error.turn(x, y, turn);
        }
    }

    /// Adds the errors of the times, s, of firings.
    pub(crate) fn delay(&self, rng: &Rng, firings: impl Iterator<Item = u32>, times: &mut [f64]) {
        if self.time_sigma > 0.0 {
            for (time, firing) in times.iter_mut().zip(firings) {
                *time += self.time_sigma * f64::from(rng.normal(firing, Draw::TimeJitter, 0));
            }
        }
    }
}
