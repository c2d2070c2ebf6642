//! Which echoes are strong enough to be reported.

use super::{Blooming, RangeCurve, Statistical};
use echocast_kernels::light;
use ground::error::Result;
use ground::lanes::LANES;
use ground::read::bounds::{ABOVE_ZERO, Bounds, FARTHEST_M, check_rows, rising_rows};
use ground::read::yaml;
use ground::rng::{Draw, Rng};
use serde::{Deserialize, Deserializer, Serialize};

/// `detection`: which echoes an instrument detects. Its keys are on the same level as those of the model.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DetectionSpec {
    /// The model.
    #[serde(flatten)]
    pub model: Detection,
    /// Fraction of the light of an echo that each channel uses, 0 to 1, relative to the channel that the model
    /// describes; one per channel, or none if all are equal.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub channel_efficiency: Vec<f64>,
    /// Received power above which the reported intensity does not rise, in multiples of the detection threshold, 1 to
    /// 1e12; no limit by default. Needs a model of `radar_equation` or `statistical`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub saturation: Option<f64>,
    /// Light of bright returns that leaks into the beams around them; none by default. Also needs such a model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blooming: Option<Blooming>,
    /// What part of an echo is timed. Unless that is the peak, this also needs such a model, and a pulse.
    pub timing: Timing,
}

/// What part of an echo an instrument times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Timing {
    /// Its peak, or a constant fraction of it: its strength does not matter.
    #[default]
    Peak,
    /// Where it rises above the detection threshold: the stronger the echo, the shorter the range.
    LeadingEdge,
}

impl<'de> Deserialize<'de> for DetectionSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        struct ReceiverKeys {
            #[serde(default)]
            channel_efficiency: Vec<f64>,
            saturation: Option<f64>,
            blooming: Option<Blooming>,
            #[serde(default)]
            timing: Timing,
        }
        let (beside, model) =
            yaml::split_keys(deserializer, &["channel_efficiency", "saturation", "blooming", "timing"])?;
        let ReceiverKeys { channel_efficiency, saturation, blooming, timing } = beside.read()?;
        Ok(DetectionSpec { model: model.read()?, channel_efficiency, saturation, blooming, timing })
    }
}

/// A point of a reflectivity limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitPoint {
    /// Reflectivity that is just not detected, 0..1.
    pub reflectance: f64,
    /// Range, m.
    pub at_m: f64,
}

/// Detection model of an instrument.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "model", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Detection {
    /// Every echo is reported.
    #[default]
    None,
    /// Hard-target radar equation, calibrated by one data-sheet line: a head-on Lambert target of `reflectance` that
    /// fills the beam is just detected at `at_m` in clear air.
    RadarEquation {
        /// Reflectance of the data-sheet target, 0..1.
        reflectance: f64,
        /// Its greatest range, m.
        at_m: f64,
    },
    /// The linear limit of the paper's system: between the two points the reflectivity that is just not detected rises
    /// linearly with range; everything nearer than `lower` is detected.
    ReflectivityLimit {
        /// Near point.
        lower: LimitPoint,
        /// Far point.
        upper: LimitPoint,
    },
    /// A reflectivity limit of many points: linear between them, constant nearer than the first and beyond the last.
    Table {
        /// The points, in ascending range, 1 to 1000.
        points: Vec<LimitPoint>,
    },
    /// Detection with a probability that depends on the noise.
    Statistical(Statistical),
}

impl<'de> Deserialize<'de> for Detection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct LinearLimit {
            lower: LimitPoint,
            upper: LimitPoint,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct LimitTable {
            points: Vec<LimitPoint>,
        }
        let (word, section) = yaml::split_tag(deserializer, "model")?;
        Ok(match word.as_str() {
            "none" => {
                section.end()?;
                Detection::None
            }
            "radar_equation" => {
                let LimitPoint { reflectance, at_m } = section.read()?;
                Detection::RadarEquation { reflectance, at_m }
            }
            "reflectivity_limit" => {
                let LinearLimit { lower, upper } = section.read()?;
                Detection::ReflectivityLimit { lower, upper }
            }
            "table" => {
                let LimitTable { points } = section.read()?;
                Detection::Table { points }
            }
            "statistical" => Detection::Statistical(section.read()?),
            _ => {
                let known = &["none", "radar_equation", "reflectivity_limit", "table", "statistical"];
                return Err(section.unknown(&word, known));
            }
        })
    }
}

impl Detection {
    /// Checks that the values of this model are within their allowed ranges, and that its ranges rise.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let mut point = |name: &str, LimitPoint { reflectance, at_m }: LimitPoint| {
            bounds.within(format_args!("detection.{name}.reflectance"), reflectance, 0.0, 1.0)?;
            bounds.within(format_args!("detection.{name}.at_m"), at_m, 0.0, FARTHEST_M)
        };
        match *self {
            Detection::None => Ok(()),
            Detection::RadarEquation { reflectance, at_m } => {
                bounds.number("detection.reflectance", reflectance, [ABOVE_ZERO, 1.0], "above 0, at most 1")?;
                bounds.within("detection.at_m", at_m, 1e-3, FARTHEST_M)
            }
            Detection::ReflectivityLimit { lower, upper } => {
                point("lower", lower)?;
                point("upper", upper)?;
                bounds.rising(("detection.lower.at_m", lower.at_m), ("detection.upper.at_m", upper.at_m))
            }
            Detection::Table { ref points } => {
                check_rows("detection.points", points.len())?;
                for (index, &limit) in points.iter().enumerate() {
                    point(&format!("points[{index}]"), limit)?;
                }
                rising_rows(bounds, "detection.points", points.iter().map(|point| point.at_m))
            }
            Detection::Statistical(Statistical { reflectance, at_m, probability, tnr, bandwidth_mhz, sunlight }) => {
                bounds.number("detection.reflectance", reflectance, [ABOVE_ZERO, 1.0], "above 0, at most 1")?;
                bounds.within("detection.at_m", at_m, 1e-3, FARTHEST_M)?;
                bounds.within("detection.probability", probability, 0.5, 0.999)?;
                bounds.within("detection.tnr", tnr, 1.0, 100.0)?;
                bounds.within("detection.bandwidth_mhz", bandwidth_mhz, 0.0, 1e5)?;
                sunlight.map_or(Ok(()), |sunlight| sunlight.check(bounds))
            }
        }
    }
}

/// A detection model prepared for one scan.
#[derive(Clone, Debug, PartialEq)]
pub enum Threshold {
    /// Every echo.
    Open,
    /// Echoes with `rho_eff / R^2 >= k`, 1/m^2.
    Calibrated { k: f32 },
    /// Echoes with `rho_eff > limit + slope (R - from)` where `R >= from`, all nearer ones.
    Linear { from: f32, limit: f32, slope: f32 },
    /// The paper's program: `rho_eff > limit + slope R` where `R >= from`, `rho_eff > 0` nearer (it omits the `- from`
    /// of the model it cites).
    LinearBlainder { from: f32, limit: f32, slope: f32 },
    /// Echoes with `rho_eff` above the curve.
    Table(RangeCurve),
    /// Echoes that reach `level` including their noise: `rho_eff / (R^2 unit) + sigma N(0, 1) >= level`.
    Statistical {
        /// `rho_eff / R^2` of an echo as strong as the noise in darkness, 1/m^2.
        unit: f32,
        /// Threshold relative to that.
        level: f32,
        /// Noise relative to that in darkness.
        sigma: f32,
        /// Ratio of threshold to noise in darkness.
        tnr: f32,
    },
}

impl Threshold {
    /// For pulses of a wavelength, nm, and a width, ns. `blainder`: the linear limit as computed by the paper's
    /// program; the program has no randomness, so the data-sheet line of a statistical detector is its limit.
    pub fn new(detection: &Detection, (wavelength_nm, pulse_ns): (f64, f64), blainder: bool) -> Self {
        match *detection {
            Detection::None => Threshold::Open,
            Detection::RadarEquation { reflectance, at_m } => {
                Threshold::Calibrated { k: (reflectance / (at_m * at_m)) as f32 }
            }
            Detection::Statistical(Statistical { reflectance, at_m, .. }) if blainder => {
                Threshold::Calibrated { k: (reflectance / (at_m * at_m)) as f32 }
            }
            Detection::Statistical(ref receiver) => {
                let sigma = receiver.noise_in_light(wavelength_nm, pulse_ns);
                let tracks_noise = receiver.sunlight.is_some_and(|sun| sun.adaptive);
                Threshold::Statistical {
                    unit: (receiver.reflectance / (receiver.at_m * receiver.at_m) / receiver.reference_snr()) as f32,
                    level: (receiver.tnr * if tracks_noise { sigma } else { 1.0 }) as f32,
                    sigma: sigma as f32,
                    tnr: receiver.tnr as f32,
                }
            }
            Detection::ReflectivityLimit { lower, upper } => {
                let slope = ((upper.reflectance - lower.reflectance) / (upper.at_m - lower.at_m)) as f32;
                let (from, limit) = (lower.at_m as f32, lower.reflectance as f32);
                if blainder {
                    Threshold::LinearBlainder { from, limit, slope }
                } else {
                    Threshold::Linear { from, limit, slope }
                }
            }
            Detection::Table { ref points } => {
                Threshold::Table(RangeCurve::new(points.iter().map(|point| (point.at_m, point.reflectance))))
            }
        }
    }

    /// The noise in which an echo of `beam` is detected, a standard normal number; 0 where noise plays no part. `echo`
    /// distinguishes the echoes of a beam.
    pub fn noise(&self, rng: &Rng, beam: u32, echo: u32) -> f32 {
        match self {
            Threshold::Statistical { .. } => rng.normal(beam, Draw::Detection, echo),
            _ => 0.0,
        }
    }

    /// [`Threshold::noise`] of echo 0 of each of `beams`.
    pub fn noises(&self, rng: &Rng, beams: &[u32], out: &mut [f32]) {
        match self {
            Threshold::Statistical { .. } => rng.normals(beams, &[0; LANES][..beams.len()], Draw::Detection, out),
            _ => out.fill(0.0),
        }
    }

    /// Whether an echo of effective reflectance `rho_eff` from `range` m is detected in `noise`.
    pub(crate) fn detects(&self, rho_eff: f32, range: f32, noise: f32) -> bool {
        match *self {
            Threshold::Open => true,
            Threshold::Calibrated { k } => rho_eff >= k * range * range,
            Threshold::Linear { from, limit, slope } => range < from || rho_eff > limit + slope * (range - from),
            Threshold::LinearBlainder { .. } => rho_eff > self.limit_of_the_program(range),
            Threshold::Table(ref limit) => rho_eff > limit.at(range),
            Threshold::Statistical { unit, level, sigma, .. } => {
                let least = (level - sigma * noise).max(least_snr(level, sigma));
                rho_eff >= unit * least * range * range
            }
        }
    }

    /// The least effective reflectance that is detected at `range` m, without noise; `None`: any.
    pub(crate) fn least(&self, range: f32) -> Option<f32> {
        let least = match *self {
            Threshold::Open => return None,
            Threshold::Calibrated { k } => k * range * range,
            Threshold::Linear { from, limit, slope } => {
                if range < from {
                    return None;
                }
                limit + slope * (range - from)
            }
            Threshold::LinearBlainder { .. } => self.limit_of_the_program(range),
            Threshold::Table(ref limit) => limit.at(range),
            Threshold::Statistical { unit, level, .. } => unit * level * range * range,
        };
        Some(least).filter(|&least| least > 0.0)
    }

    /// [`Threshold::detects`] of each lane.
    pub(crate) fn detect(
        &self,
        rho_eff: &[f32; LANES],
        range: &[f32; LANES],
        noise: &[f32; LANES],
        seen: &mut [bool; LANES],
    ) {
        match *self {
            Threshold::Calibrated { k } => light::over_square(k, rho_eff, range, seen),
            Threshold::Linear { from, limit, slope } => light::over_line(from, limit, slope, rho_eff, range, seen),
            Threshold::Statistical { unit, level, sigma, .. } => {
                light::over_noise(unit, level, sigma, least_snr(level, sigma), rho_eff, range, noise, seen);
            }
            Threshold::Open | Threshold::LinearBlainder { .. } | Threshold::Table(_) => {
                for lane in 0..LANES {
                    seen[lane] = self.detects(rho_eff[lane], range[lane], noise[lane]);
                }
            }
        }
    }

    /// The effective reflectance that an echo from `range` m must exceed in the paper's program.
    pub(crate) fn limit_of_the_program(&self, range: f32) -> f32 {
        match *self {
            Threshold::LinearBlainder { from, limit, slope } if range >= from => limit + slope * range,
            Threshold::Calibrated { k } => k * range * range,
            Threshold::Table(ref limit) => limit.at(range),
            _ => 0.0,
        }
    }

    /// Least `rho_eff / R^2` that is ever detected, 1/m^2, where the model defines one.
    pub(crate) fn least_power(&self) -> Option<f64> {
        match *self {
            Threshold::Calibrated { k } => Some(k.into()),
            Threshold::Statistical { unit, level, sigma, .. } => Some((unit * least_snr(level, sigma)).into()),
            _ => None,
        }
    }

    /// [`Threshold::least_power`]; 0 where the model defines none.
    pub(crate) fn faintest(&self) -> f32 {
        self.least_power().unwrap_or(0.0) as f32
    }

    /// `rho_eff / R^2` at the threshold, in darkness, 1/m^2, where the model defines one.
    pub fn power(&self) -> Option<f32> {
        match *self {
            Threshold::Calibrated { k } => Some(k),
            Threshold::Statistical { unit, tnr, .. } => Some(unit * tnr),
            _ => None,
        }
    }

    /// `rho_eff / R^2` of an echo as strong as the noise, 1/m^2, where the model defines or suggests one.
    pub(crate) fn noise_power(&self) -> Option<f64> {
        match *self {
            Threshold::Calibrated { k } => Some(f64::from(k) / USUAL_TNR),
            Threshold::Statistical { unit, sigma, .. } => Some((unit * sigma).into()),
            _ => None,
        }
    }

    /// `rho_eff / R^2` of an echo whose signal-to-noise ratio is the threshold's, 1/m^2, where the model defines it.
    pub fn unit(&self) -> Option<f32> {
        match *self {
            Threshold::Calibrated { k } => Some(k),
            Threshold::Statistical { unit, sigma, tnr, .. } => Some(unit * sigma * tnr),
            _ => None,
        }
    }
}

/// Ratio of threshold to noise of instruments whose data sheet gives only a limit: a usual choice against false alarms.
const USUAL_TNR: f64 = 5.0;

/// Ratio of signal to the noise in darkness below which no echo is searched for: four sigma below the threshold, where
/// one in 30,000 would be detected, and at least half as strong as the noise.
fn least_snr(level: f32, sigma: f32) -> f32 {
    (level - 4.0 * sigma).max(0.5 * sigma)
}

#[cfg(test)]
mod tests {
    use super::super::Sunlight;
    use super::*;

    fn limit(r_min: f64, d_min: f64, r_max: f64, d_max: f64) -> Detection {
        Detection::ReflectivityLimit {
            lower: LimitPoint { reflectance: r_min, at_m: d_min },
            upper: LimitPoint { reflectance: r_max, at_m: d_max },
        }
    }

    const PULSE: (f64, f64) = (905.0, 5.0);

    /// Least reflectivity that `threshold` detects at `range`, by bisection.
    fn least(threshold: &Threshold, range: f32) -> f64 {
        let (mut low, mut high) = (-0.1f32, 2.0f32);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            if threshold.detects(middle, range, 0.0) { high = middle } else { low = middle }
        }
        f64::from(high)
    }

    /// Maximum ranges of a calibrated threshold in clear air (0.8 at 200 m): sqrt(rho / K).
    #[test]
    fn the_radar_equation_sees_as_far_as_the_data_sheet_line_says() {
        let threshold = Threshold::new(&Detection::RadarEquation { reflectance: 0.8, at_m: 200.0 }, PULSE, false);
        for (rho, range) in [(0.1f32, 70.711f32), (0.8, 200.0)] {
            assert!(threshold.detects(rho, range * 0.9999, 0.0));
            assert!(!threshold.detects(rho, range * 1.0001, 0.0));
        }
        assert!((0.8 / (threshold.unit().unwrap() * 100.0 * 100.0) - 4.0).abs() < 1e-6);
    }

    /// The preset 0.5 at 50 m to 0.9 at 120 m, and what the paper's program makes of it.
    #[test]
    fn linear_limits_follow_their_tables() {
        let generic = limit(0.5, 50.0, 0.9, 120.0);
        let (right, blainder) = (Threshold::new(&generic, PULSE, false), Threshold::new(&generic, PULSE, true));
        for (range, expected, program) in
            [(50.0, 0.5, 0.785_714_286), (60.0, 0.557_142_857, 0.842_857_143), (120.0, 0.9, 1.185_714_29)]
        {
            assert!((least(&right, range) - expected).abs() < 1e-6);
            assert!((least(&blainder, range) - program).abs() < 1e-6);
        }
        assert!(right.detects(0.0, 49.9, 0.0), "everything nearer than the lower point is detected");
        assert!(!blainder.detects(0.0, 49.9, 0.0) && blainder.detects(1e-3, 49.9, 0.0));
    }
    /// The rising line of the two points above as a table: the same between them, constant outside.
    #[test]
    fn a_table_is_linear_between_its_points() {
        let point = |reflectance, at_m| LimitPoint { reflectance, at_m };
        let detection = Detection::Table { points: vec![point(0.5, 50.0), point(0.9, 120.0), point(0.1, 130.0)] };
        for threshold in [Threshold::new(&detection, PULSE, false), Threshold::new(&detection, PULSE, true)] {
            for (range, expected) in
                [(0.0, 0.5), (50.0, 0.5), (60.0, 0.557_142_857), (120.0, 0.9), (125.0, 0.5), (1e4, 0.1)]
            {
                assert!((least(&threshold, range) - expected).abs() < 1e-6, "{range}");
                assert_eq!(threshold.limit_of_the_program(range), expected as f32);
            }
        }
        let threshold = Threshold::new(&detection, PULSE, false);
        assert_eq!((threshold.least_power(), threshold.unit()), (None, None));
    }

    fn statistical(tnr: f64, sunlight: Option<Sunlight>) -> Detection {
        let (reflectance, at_m, probability) = (0.8, 100.0, 0.9);
        Detection::Statistical(Statistical { reflectance, at_m, probability, tnr, bandwidth_mhz: 0.0, sunlight })
    }

    /// Fraction of a million echoes that is detected.
    fn share(threshold: &Threshold, rho_eff: f32, range: f32) -> f64 {
        let (rng, mut noise, mut seen) = (Rng::new(4, 2), [0.0; LANES], 0);
        for block in 0..4000 {
            let beams: [u32; LANES] = std::array::from_fn(|lane| block * LANES as u32 + lane as u32);
            threshold.noises(&rng, &beams, &mut noise);
            seen += noise.iter().filter(|&&noise| threshold.detects(rho_eff, range, noise)).count();
        }
        seen as f64 / (4000 * LANES) as f64
    }

    /// `Phi(SNR - TNR)`, computed with scipy; within three standard errors.
    #[test]
    fn noise_decides_with_the_probability_of_the_normal_distribution() {
        for (snr, tnr, p) in [(6.0, 5.0, 0.841_345), (8.0, 6.0, 0.977_250), (5.0, 5.0, 0.5), (2.0, 4.0, 0.022_750)] {
            let threshold = Threshold::new(&statistical(tnr, None), PULSE, false);
            let Threshold::Statistical { unit, .. } = threshold else { panic!() };
            let range = 60.0;
            let found = share(&threshold, snr * unit * range * range, range);
            assert!((found - p).abs() < 3.0 * (p * (1.0 - p) / 1.024e6f64).sqrt(), "{snr} {tnr}: {found}");
        }
        // The data-sheet line itself, and what is never detected.
        let threshold = Threshold::new(&statistical(5.0, None), PULSE, false);
        assert!((share(&threshold, 0.8, 100.0) - 0.9).abs() < 3.0 * (0.09f64 / 1.024e6).sqrt());
        assert_eq!((share(&threshold, 0.8, 30.0), share(&threshold, 0.0, 30.0)), (1.0, 0.0));
        let least = threshold.least_power().unwrap() as f32;
        assert!(!threshold.detects(least * 0.999, 1.0, 5.7) && threshold.detects(least * 1.001, 1.0, 5.7));
        // In the paper's program the line is the limit.
        let program = Threshold::new(&statistical(5.0, None), PULSE, true);
        assert_eq!(program, Threshold::new(&Detection::RadarEquation { reflectance: 0.8, at_m: 100.0 }, PULSE, true));
    }

    /// A threshold that follows the sun's noise shortens the range by its square root; a fixed one keeps the range of
    /// one half.
    #[test]
    fn sunlight_shortens_the_range_or_blurs_it() {
        let sun = |adaptive| {
            let sun = "{pulse_uj: 0.003, aperture_mm: 20, field_of_view_mrad: [3, 1.5], filter_nm: 40}";
            Sunlight { adaptive, ..yaml::from_str("sun", sun).unwrap() }
        };
        let threshold = |sunlight| Threshold::new(&statistical(5.0, sunlight), PULSE, false);
        let (dark, tracks_noise, fixed) = (threshold(None), threshold(Some(sun(true))), threshold(Some(sun(false))));
        let (Threshold::Statistical { sigma, .. }, rho) = (tracks_noise.clone(), 0.8) else { panic!() };
        assert!(sigma > 1.2 && sigma < 2.0, "{sigma}");
        // Where one half is detected: SNR = TNR.
        let half = 100.0 * (6.281_552_f32 / 5.0).sqrt();
        let error = 3.0 * (0.25f64 / 1.024e6).sqrt();
        for (threshold, range) in [(&dark, half), (&tracks_noise, half / sigma.sqrt()), (&fixed, half)] {
            let found = share(threshold, rho, range);
            assert!((found - 0.5).abs() < error, "{threshold:?} {found}");
        }
        assert!(share(&fixed, rho, 1.1 * half) > share(&dark, rho, 1.1 * half) + 10.0 * error);
        // The timing noise follows the ratio to the actual noise.
        let snr = |threshold: &Threshold| rho / (threshold.unit().unwrap() * half * half);
        assert!((snr(&dark) - 1.0).abs() < 1e-5 && (snr(&fixed) * sigma - 1.0).abs() < 1e-5);
        assert_eq!(snr(&fixed), snr(&tracks_noise));
    }
}
