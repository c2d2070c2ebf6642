//! Sensors: a scan pattern, a beam and a receiver, read from YAML or taken from a preset.

use crate::bounds::{ABOVE_ZERO, Bounds, Parameter};
use crate::detect::{
    Detection, DetectionSpec, LimitPoint, Noise, RangeError, ReturnMode, ReturnRule, Statistical, Sunlight, Threshold,
    Timing, WeakDropout,
};
use crate::echo::{Cone, Glint, IntensityEncoding, Pulse, PulseShape, Receiver, texture};
use crate::emitter::pattern::Pattern;
use crate::emitter::{BeamTable, Footprint, Pose, Transducer};
use crate::error::{Error, Result};
use crate::ping::SonarView;
use crate::presets;
use crate::scan::Signals;
use crate::shown;
use crate::sonar::AcousticsSpec;
use crate::tof::{Camera, TofSpec};
use crate::yaml::{self, Document};
use serde::de::{self, Deserializer, SeqAccess, Visitor};
use serde::ser::{SerializeStruct, Serializer};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::{fmt, fs};

/// A sensor file: what each key of its YAML means. What is left out is ideal. Written, a sonar is without the sections of
/// light (`beam`, `detection`, `returns`, `noise`, `intensity`), which its file must not fill.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSpec {
    /// Name, as a preset also the name of its file.
    pub name: String,
    /// Name for people.
    #[serde(default)]
    pub title: String,
    /// What it measures with.
    pub kind: SensorKind,
    /// Where the numbers come from.
    #[serde(default)]
    pub source: String,
    /// Where its beams point and when they fire.
    pub pattern: Pattern,
    /// A single beam.
    #[serde(default)]
    pub beam: BeamSpec,
    /// Ranges that it reports.
    #[serde(default)]
    pub range: RangeSpec,
    /// Which echoes it sees.
    #[serde(default)]
    pub detection: DetectionSpec,
    /// Which echoes of a beam it reports.
    #[serde(default)]
    pub returns: ReturnsSpec,
    /// Errors of what it measures.
    #[serde(default)]
    pub noise: Noise,
    /// What it reports as intensity.
    #[serde(default)]
    pub intensity: IntensitySpec,
    /// What is particular to a depth camera.
    #[serde(default)]
    pub tof: Option<TofSpec>,
    /// What is particular to a sonar.
    #[serde(default)]
    pub acoustics: Option<AcousticsSpec>,
    /// Figures of the maker that the pattern is tested against.
    #[serde(default)]
    pub expect: Option<Expectations>,
}

impl Serialize for SensorSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let SensorSpec {
            name,
            title,
            kind,
            source,
            pattern,
            beam,
            range,
            detection,
            returns,
            noise,
            intensity,
            tof,
            acoustics,
            expect,
        } = self;
        let of_light = *kind != SensorKind::Sonar;
        let mut keys = serializer.serialize_struct("SensorSpec", 14)?;
        keys.serialize_field("name", name)?;
        if !title.is_empty() {
            keys.serialize_field("title", title)?;
        }
        keys.serialize_field("kind", kind)?;
        if !source.is_empty() {
            keys.serialize_field("source", source)?;
        }
        keys.serialize_field("pattern", pattern)?;
        if of_light {
            keys.serialize_field("beam", beam)?;
        }
        keys.serialize_field("range", range)?;
        if of_light {
            keys.serialize_field("detection", detection)?;
            keys.serialize_field("returns", returns)?;
            keys.serialize_field("noise", noise)?;
            keys.serialize_field("intensity", intensity)?;
        }
        if let Some(tof) = tof {
            keys.serialize_field("tof", tof)?;
        }
        if let Some(acoustics) = acoustics {
            keys.serialize_field("acoustics", acoustics)?;
        }
        if let Some(expect) = expect {
            keys.serialize_field("expect", expect)?;
        }
        keys.end()
    }
}

/// What a sensor measures with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    /// Pulses of light, beam by beam.
    Lidar,
    /// A depth camera.
    Tof,
    /// Pings of sound.
    Sonar,
}

impl fmt::Display for SensorKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            SensorKind::Lidar => "lidar",
            SensorKind::Tof => "tof",
            SensorKind::Sonar => "sonar",
        })
    }
}

/// `beam`: light and shape of a single beam.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BeamSpec {
    /// Wavelength, nm, 200 to 20000.
    pub wavelength_nm: f64,
    /// Full divergence at 1/e^2, horizontal and vertical, mrad, at least 0; one number stands for both.
    #[serde(deserialize_with = "number_or_pair")]
    pub divergence_mrad: [f64; 2],
    /// Full width of the pulse at half of its greatest power, ns, at least 0.
    pub pulse_ns: f64,
    /// Power of the pulse over time.
    pub pulse_shape: PulseShape,
    /// Diameter of the beam where it leaves the instrument, mm, 0 to 1000.
    pub exit_diameter_mm: f64,
    /// Diameter of the receiver's opening, mm, above 0, at most 1000. With it, smooth surfaces that are met head-on throw
    /// the instrument's own light back at it; without it that is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aperture_mm: Option<f64>,
    /// Ranges below which the receiver sees nothing of its own beam and from which it sees all of it, m; in between
    /// linear. It decides how near fog shows.
    pub overlap_m: [f64; 2],
    /// Rays that stand for a beam, 1 to 1024: one along its axis, or as many over its footprint (of a depth camera:
    /// over the pixel), which then meet edges and slopes as the beam does.
    pub sub_rays: u32,
}

impl Default for BeamSpec {
    fn default() -> Self {
        BeamSpec {
            wavelength_nm: 905.0,
            divergence_mrad: [0.0; 2],
            pulse_ns: 0.0,
            pulse_shape: PulseShape::Gaussian,
            exit_diameter_mm: 12.0,
            aperture_mm: None,
            overlap_m: [0.5, 2.0],
            sub_rays: 1,
        }
    }
}

/// `range`: ranges that are reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RangeSpec {
    /// Nearest, m, at least 0.
    pub min_m: f64,
    /// Farthest, m, above the nearest; none is no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_m: Option<f64>,
    /// Step of the reported range, m; 0 is none.
    pub resolution_m: f64,
}

/// `returns`: which echoes of a beam are reported.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReturnsSpec {
    /// Which echoes.
    pub mode: ReturnMode,
    /// Greatest number of them in mode `all`, 1 to 255.
    pub max: u8,
    /// Of echoes nearer to each other than this only the strongest is reported, m, at least 0.
    pub separation_m: f64,
}

impl Default for ReturnsSpec {
    fn default() -> Self {
        ReturnsSpec { mode: ReturnMode::Strongest, max: 5, separation_m: 0.0 }
    }
}

/// `intensity`: what is reported as intensity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IntensitySpec {
    /// How received energy becomes a number.
    pub encoding: IntensityEncoding,
}

/// `expect`: figures that a test draws the pattern against. They do not change a scan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Expectations {
    /// Beams of a scan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beams: Option<u64>,
    /// Channels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<u64>,
    /// Columns of the range image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns: Option<u64>,
    /// Lowest and highest elevation, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<[f64; 2]>,
    /// Angle from column to column, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_step_deg: Option<f64>,
    /// Points per second.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points_per_s: Option<f64>,
    /// Angle between the outermost beams of a sonar, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swath_deg: Option<f64>,
    /// Range resolution of a sonar in water of 1500 m/s, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resolution_m: Option<f64>,
    /// Where the figures come from: `data sheet`, or `computed` from the pattern's own numbers.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub source: String,
}

/// Reads `x` as `[x, x]`, or a pair.
fn number_or_pair<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 2], D::Error> {
    struct NumberOrPair;

    impl<'de> Visitor<'de> for NumberOrPair {
        type Value = [f64; 2];

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a number or a pair of numbers")
        }
        fn visit_i64<E>(self, value: i64) -> Result<[f64; 2], E> {
            Ok([value as f64; 2])
        }
        fn visit_u64<E>(self, value: u64) -> Result<[f64; 2], E> {
            Ok([value as f64; 2])
        }
        fn visit_f64<E>(self, value: f64) -> Result<[f64; 2], E> {
            Ok([value; 2])
        }
        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<[f64; 2], A::Error> {
            Deserialize::deserialize(de::value::SeqAccessDeserializer::new(seq))
        }
    }
    deserializer.deserialize_any(NumberOrPair)
}

/// Farthest range that makes sense anywhere here, m.
const FARTHEST_M: f64 = 1e9;

/// Finest step of ranges, m.
const FINEST_M: f64 = 1e-6;

impl SensorSpec {
    /// Whether all values are within what is allowed.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the key.
    pub fn check(&self) -> Result<()> {
        self.check_with(&mut Bounds::none())
    }

    /// [`SensorSpec::check`] that shows all numbers that have bounds to `bounds`.
    fn check_with(&self, bounds: &mut Bounds) -> Result<()> {
        if self.name.is_empty() {
            return Err(Error::invalid("name", "empty", "a word"));
        }
        self.pattern.check_with(bounds)?;
        let SensorSpec { beam, range, returns, noise, .. } = self;
        bounds.within("range.min_m", range.min_m, 0.0, FARTHEST_M)?;
        bounds.number(
            "range.max_m",
            range.max_m,
            [ABOVE_ZERO, FARTHEST_M],
            format_args!("above 0, at most {FARTHEST_M}"),
        )?;
        bounds.rising(("range.min_m", range.min_m), ("range.max_m", range.max_m))?;
        if self.kind == SensorKind::Sonar {
            return self.check_sonar(bounds);
        }
        if self.pattern.is_of_sound() {
            return Err(Error::invalid("pattern.type", "that of a sonar", "with kind: sonar only"));
        }
        if self.acoustics.is_some() {
            return Err(Error::invalid("acoustics", "given", "with kind: sonar only"));
        }
        bounds.within("beam.wavelength_nm", beam.wavelength_nm, 200.0, 20_000.0)?;
        bounds.within("beam.divergence_mrad[0]", beam.divergence_mrad[0], 0.0, 1000.0)?;
        bounds.within("beam.divergence_mrad[1]", beam.divergence_mrad[1], 0.0, 1000.0)?;
        bounds.within("beam.pulse_ns", beam.pulse_ns, 0.0, 1e9)?;
        bounds.within("beam.exit_diameter_mm", beam.exit_diameter_mm, 0.0, 1000.0)?;
        bounds.number("beam.aperture_mm", beam.aperture_mm, [ABOVE_ZERO, 1000.0], "above 0, at most 1000")?;
        let [near, far] = beam.overlap_m;
        bounds.within("beam.overlap_m[0]", near, 0.0, 1000.0)?;
        bounds.number("beam.overlap_m[1]", far, [ABOVE_ZERO, 1000.0], "above 0, at most 1000")?;
        bounds.rising(("beam.overlap_m[0]", near), ("beam.overlap_m[1]", far))?;
        bounds.within("beam.sub_rays", f64::from(beam.sub_rays), 1.0, 1024.0)?;
        let tof = self.tof.as_ref();
        for (key, one_ray) in [
            ("tof.second_eye_m", tof.is_some_and(|tof| tof.second_eye_m.is_some())),
            ("tof.multipath_rays", tof.is_some_and(|tof| tof.multipath_rays > 0)),
        ] {
            if one_ray && beam.sub_rays > 1 {
                return Err(Error::invalid("beam.sub_rays", beam.sub_rays, format!("1 with {key}")));
            }
        }
        if beam.pulse_ns == 0.0 && tof.is_none() && (beam.sub_rays > 1 || beam.divergence_mrad != [0.0; 2]) {
            let because = if beam.sub_rays > 1 { "beam.sub_rays above 1" } else { "a beam.divergence_mrad" };
            let allowed = format!("above 0 with {because}: without a pulse echoes of one beam do not join");
            return Err(Error::invalid("beam.pulse_ns", beam.pulse_ns, allowed));
        }
        // Finer than a micrometre, single precision overflows.
        let steps = format!("0, or {FINEST_M} to {FARTHEST_M}");
        bounds.number("range.resolution_m", range.resolution_m, [0.0, FARTHEST_M], &steps)?;
        if range.resolution_m > 0.0 && range.resolution_m < FINEST_M {
            return Err(Error::invalid("range.resolution_m", range.resolution_m, steps));
        }
        bounds.within("returns.max", f64::from(returns.max), 1.0, u8::MAX.into())?;
        bounds.within("returns.separation_m", returns.separation_m, 0.0, FARTHEST_M)?;
        self.detection.model.check(bounds)?;
        noise.check(bounds)?;
        let saturation = self.detection.saturation;
        bounds.within("detection.saturation", saturation, 1.0, 1e12)?;
        let blooming = &self.detection.blooming;
        if let Some(blooming) = blooming {
            bounds.within("detection.blooming.weight", blooming.weight, 0.0, 1.0)?;
            let allowed = "above 0, at most 90";
            bounds.number("detection.blooming.width_deg", blooming.width_deg, [ABOVE_ZERO, 90.0], allowed)?;
            bounds.within("detection.blooming.floor", blooming.floor, 0.0, 1.0)?;
            if self.tof.is_some() {
                return Err(Error::invalid("detection.blooming", "given", "without a tof section only"));
            }
        }
        for (index, &efficiency) in self.detection.channel_efficiency.iter().enumerate() {
            bounds.within(format_args!("detection.channel_efficiency[{index}]"), efficiency, 0.0, 1.0)?;
        }
        if !matches!(self.detection.model, Detection::RadarEquation { .. } | Detection::Statistical(_)) {
            if let Some(saturation) = saturation {
                let allowed = "a value with detection.model: radar_equation or statistical";
                return Err(Error::invalid("detection.saturation", saturation, allowed));
            }
            if blooming.is_some() {
                let allowed = "with detection.model: radar_equation or statistical only";
                return Err(Error::invalid("detection.blooming", "given", allowed));
            }
            if self.detection.timing != Timing::Peak {
                let allowed = "peak, or with detection.model: radar_equation or statistical";
                return Err(Error::invalid("detection.timing", "leading_edge", allowed));
            }
            let allowed = "0, or above with detection.model: radar_equation or statistical";
            bounds.number("noise.range_snr_sigma_m", noise.range_snr_sigma_m, [0.0; 2], allowed)?;
        }
        let needs_pulse = |bounds: &mut Bounds, because: &str| {
            bounds.number("beam.pulse_ns", beam.pulse_ns, [ABOVE_ZERO, 1e9], format_args!("above 0 with {because}"))
        };
        if blooming.is_some() {
            // Light of many bright places is one echo only within a pulse.
            needs_pulse(bounds, "detection.blooming")?;
        }
        if self.detection.timing != Timing::Peak {
            needs_pulse(bounds, "detection.timing: leading_edge")?;
        }
        if let Detection::Statistical(Statistical { bandwidth_mhz, sunlight, .. }) = self.detection.model {
            if range.max_m.is_none() {
                // False alarms come anywhere up to there.
                let allowed = "0, or above with range.max_m";
                bounds.number("detection.bandwidth_mhz", bandwidth_mhz, [0.0; 2], allowed)?;
            }
            if sunlight.is_some() {
                needs_pulse(bounds, "detection.sunlight")?;
            }
        }
        match &self.tof {
            Some(_) if self.kind != SensorKind::Tof => Err(Error::invalid("tof", "given", "with kind: tof only")),
            Some(tof) => tof.check(&self.pattern, bounds),
            None => Ok(()),
        }
    }

    /// The part of [`SensorSpec::check_with`] that is about sonars.
    fn check_sonar(&self, bounds: &mut Bounds) -> Result<()> {
        let Some(acoustics) = &self.acoustics else {
            return Err(Error::invalid("acoustics", "missing", "a section with kind: sonar"));
        };
        if !self.pattern.is_of_sound() {
            let allowed = "sidescan, multibeam, imaging or single_beam with kind: sonar";
            return Err(Error::invalid("pattern.type", "that of another kind of sensor", allowed));
        }
        let SensorSpec { beam, range, detection, returns, noise, intensity, .. } = self;
        for (key, given) in [
            ("beam", *beam != BeamSpec::default()),
            ("detection", *detection != DetectionSpec::default()),
            ("returns", *returns != ReturnsSpec::default()),
            ("noise", *noise != Noise::default()),
            ("intensity", *intensity != IntensitySpec::default()),
            ("tof", self.tof.is_some()),
        ] {
            if given {
                return Err(Error::invalid(key, "given", "with other kinds than sonar; a sonar has acoustics"));
            }
        }
        let allowed = "0 with kind: sonar, whose range bins are acoustics.bin_m long";
        bounds.number("range.resolution_m", range.resolution_m, [0.0; 2], allowed)?;
        if range.max_m.is_none() {
            return Err(Error::invalid("range.max_m", "missing", "a value with kind: sonar: how long it listens"));
        }
        let steers = matches!(self.pattern, Pattern::Multibeam(_) | Pattern::Imaging(_));
        if acoustics.array_speed_m_s.is_some() && !steers {
            let allowed = "with pattern.type: multibeam or imaging only, which steer beams";
            return Err(Error::invalid("acoustics.array_speed_m_s", "given", allowed));
        }
        acoustics.check(bounds)?;
        /// Eight bytes each.
        const MOST_HEARINGS: f64 = 2e8;
        let hearings = Transducer::hearings_of(&self.pattern, 1500.0 / acoustics.frequency());
        if hearings > MOST_HEARINGS {
            let found = format!("too many for these beams, which overlap: {hearings:.1e} of beams that hear a ray");
            let allowed = format!("{MOST_HEARINGS:.0e} with fewer rays or beams, or narrower ones");
            return Err(Error::invalid("pattern.rays", found, allowed));
        }
        Ok(())
    }

    /// Turns `document` into a checked description.
    fn read(document: &Document) -> Result<SensorSpec> {
        let spec: SensorSpec = document.read()?;
        spec.check().map_err(|error| document.locate(error))?;
        Ok(spec)
    }
}

impl Noise {
    fn check(&self, bounds: &mut Bounds) -> Result<()> {
        for (name, value, least, most) in [
            ("range_offset_m", self.range_offset_m, -FARTHEST_M, FARTHEST_M),
            ("range_offset_percent", self.range_offset_percent, -100.0, 1000.0),
            ("range_mean_m", self.range_mean_m, -FARTHEST_M, FARTHEST_M),
            ("range_sigma_m", self.range_sigma_m, 0.0, FARTHEST_M),
            ("range_sigma_per_m", self.range_sigma_per_m, 0.0, 1.0),
            ("range_snr_sigma_m", self.range_snr_sigma_m, 0.0, FARTHEST_M),
            ("channel_bias_sigma_m", self.channel_bias_sigma_m, 0.0, FARTHEST_M),
            ("channel_gain_sigma", self.channel_gain_sigma, 0.0, 1.0),
            ("instrument", self.instrument.into(), 0.0, u32::MAX.into()),
            ("temperature_m_per_k", self.temperature_m_per_k, -1000.0, 1000.0),
            ("temperature_offset_k", self.temperature_offset_k, -1000.0, 1000.0),
            ("azimuth_sigma_deg", self.azimuth_sigma_deg, 0.0, 10.0),
            ("pointing_sigma_deg", self.pointing_sigma_deg, 0.0, 10.0),
            ("time_sigma_us", self.time_sigma_us, 0.0, 1e9),
            ("dropout", self.dropout, 0.0, 1.0),
        ] {
            bounds.within(format_args!("noise.{name}"), value, least, most)?;
        }
        let (finest, steps) = (1e-4, "0, or 0.0001 to 10");
        bounds.number("noise.azimuth_step_deg", self.azimuth_step_deg, [0.0, 10.0], steps)?;
        if self.azimuth_step_deg > 0.0 && self.azimuth_step_deg < finest {
            return Err(Error::invalid("noise.azimuth_step_deg", self.azimuth_step_deg, steps));
        }
        if !self.range_table.is_empty() {
            check_rows("noise.range_table", self.range_table.len())?;
        }
        for (index, point) in self.range_table.iter().enumerate() {
            let key = |name: &str| format!("noise.range_table[{index}].{name}");
            bounds.within(key("at_m"), point.at_m, 0.0, FARTHEST_M)?;
            bounds.within(key("mean_m"), point.mean_m, -FARTHEST_M, FARTHEST_M)?;
            bounds.within(key("sigma_m"), point.sigma_m, 0.0, FARTHEST_M)?;
        }
        rising_rows(bounds, "noise.range_table", self.range_table.iter().map(|point| point.at_m))?;
        if let Some(WeakDropout { below, at_zero }) = self.dropout_weak {
            bounds.number("noise.dropout_weak.below", below, [ABOVE_ZERO, 1000.0], "above 0, at most 1000")?;
            bounds.within("noise.dropout_weak.at_zero", at_zero, 0.0, 1.0)?;
        }
        Ok(())
    }
}

impl Detection {
    fn check(&self, bounds: &mut Bounds) -> Result<()> {
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

impl Sunlight {
    fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let [wide, high] = self.field_of_view_mrad;
        // No instrument is near these; the ratio of two of them stays far from the ends of what numbers can be.
        for (name, value, least, most) in [
            ("pulse_uj", self.pulse_uj, 1e-6, 1e6),
            ("aperture_mm", self.aperture_mm, 0.01, 1e4),
            ("field_of_view_mrad[0]", wide, 1e-3, 1000.0),
            ("field_of_view_mrad[1]", high, 1e-3, 1000.0),
            ("filter_nm", self.filter_nm, 1e-3, 1e4),
            ("efficiency", self.efficiency, 0.0, 1.0),
            ("quantum_efficiency", self.quantum_efficiency, 0.0, 1.0),
            ("excess_noise", self.excess_noise, 1.0, 100.0),
            ("irradiance_w_m2_nm", self.irradiance_w_m2_nm, 0.0, 1000.0),
            ("reflectance", self.reflectance, 0.0, 1.0),
            ("incidence_deg", self.incidence_deg, 0.0, 90.0),
        ] {
            bounds.within(format_args!("detection.sunlight.{name}"), value, least, most)?;
        }
        Ok(())
    }
}

/// That the table at `key` has some rows, and not too many for every beam to look at.
fn check_rows(key: &str, rows: usize) -> Result<()> {
    const MOST: usize = 1000;
    if (1..=MOST).contains(&rows) {
        return Ok(());
    }
    Err(Error::invalid(key, format!("a list of {rows}"), format!("1 to {MOST} points")))
}

/// That the `at_m` of the table at `key` rise from row to row.
fn rising_rows(bounds: &mut Bounds, key: &str, at_m: impl Iterator<Item = f64> + Clone) -> Result<()> {
    let row = |index: usize| format!("{key}[{index}].at_m");
    at_m.clone()
        .zip(at_m.skip(1))
        .enumerate()
        .try_for_each(|(index, (near, far))| bounds.rising((row(index), near), (row(index + 1), far)))
}

/// Whether a sonar must not fill the section that `key` is in.
fn is_of_light(key: &str) -> bool {
    let section = key.split(['.', '[']).next().unwrap_or_default();
    ["beam", "detection", "returns", "noise", "intensity", "tof"].contains(&section)
}

/// Whether a sensor file could have a number at `key`, where `tree` has nothing.
fn takes_numbers(mut tree: Value, key: &str) -> bool {
    yaml::set(&mut tree, key, "1").is_ok() && Document::from_value(key, tree).read::<SensorSpec>().is_ok()
}

/// A preset that ships with the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PresetInfo {
    /// Name for [`Sensor::preset`].
    pub name: String,
    /// Name for people.
    pub title: String,
    /// What it measures with.
    pub kind: SensorKind,
    /// Group: `lidar`, `tof`, `sonar`, `paper`.
    pub folder: String,
}

/// Transducers, each with the wavelength, m, and the ratio of sound speeds that it was made for.
type Transducers = Vec<(f64, f64, Arc<Transducer>)>;

/// A depth sensor, ready to scan.
#[derive(Clone, Debug)]
pub struct Sensor {
    spec: SensorSpec,
    /// Where relative file names in it start.
    folder: PathBuf,
    pub(crate) beams: Arc<BeamTable>,
    /// One more than the greatest channel of a beam.
    pub(crate) channels: usize,
    pub(crate) wavelength_nm: f64,
    pub(crate) range_min_m: f64,
    pub(crate) range_max_m: f64,
    pub(crate) range_resolution_m: f64,
    pub(crate) detection: DetectionSpec,
    pub(crate) noise: Noise,
    pub(crate) intensity: IntensityEncoding,
    pub(crate) camera: Option<Camera>,
    /// Quantiles of the texture of what a sonar hears; empty: none.
    pub(crate) texture: Arc<[f32]>,
    /// What a sonar sends and hears, for the wavelengths that it has been used at; shared with copies.
    transducers: Arc<Mutex<Transducers>>,
}

impl Sensor {
    /// The preset called `name`.
    ///
    /// # Errors
    /// [`crate::Error::Missing`] with near names.
    pub fn preset(name: &str) -> Result<Sensor> {
        match presets::sensors().find(|preset| preset.name == name) {
            Some(preset) => Sensor::from_document(&Document::parse(preset.path, preset.text)?, Path::new("")),
            None => Err(Error::missing("sensor preset", name, presets::sensors().map(|preset| preset.name))),
        }
    }

    /// The preset called `name` (or `FOLDER/NAME`), or the sensor file of that name.
    ///
    /// # Errors
    /// As [`Sensor::preset`] and [`Sensor::load`].
    pub fn open(name: impl AsRef<Path>) -> Result<Sensor> {
        let path = name.as_ref();
        let is_yaml = path.extension().is_some_and(|ending| ending == "yaml" || ending == "yml");
        // What is no regular file is told, rather than that there is no such preset.
        let is_file = fs::metadata(path).is_ok_and(|found| !found.is_dir());
        if is_yaml || is_file {
            return Sensor::load(path);
        }
        let name = shown::path(path);
        let mut presets = presets::sensors();
        match name.split_once('/') {
            Some((folder, preset)) if presets.any(|p| p.folder == folder && p.name == preset) => Sensor::preset(preset),
            _ => Sensor::preset(&name),
        }
    }

    /// All presets, by folder and name.
    pub fn presets() -> Vec<PresetInfo> {
        /// The keys that a list shows; the others are left unread.
        #[derive(Deserialize)]
        struct Head {
            title: String,
            kind: SensorKind,
        }
        presets::sensors()
            .map(|preset| {
                let Head { title, kind } =
                    yaml::from_str(preset.path, preset.text).expect("presets that are compiled in can be read");
                PresetInfo { name: preset.name.to_owned(), title, kind, folder: preset.folder.to_owned() }
            })
            .collect()
    }

    /// Reads a sensor file.
    ///
    /// # Errors
    /// File, line and key of what is wrong, with the nearest known key.
    pub fn load(path: impl AsRef<Path>) -> Result<Sensor> {
        let path = path.as_ref();
        Sensor::from_document(&Document::load(path)?, path.parent().unwrap_or(Path::new("")))
    }

    /// Reads the text of a sensor file; names of other files in it start at `folder`.
    ///
    /// # Errors
    /// As [`Sensor::load`].
    pub fn from_yaml(text: &str, folder: impl AsRef<Path>) -> Result<Sensor> {
        Sensor::from_document(&Document::parse("YAML text", text)?, folder.as_ref())
    }

    fn from_document(document: &Document, folder: &Path) -> Result<Sensor> {
        let mut spec = SensorSpec::read(document)?;
        spec.pattern.resolve(folder, None);
        let beams = spec.pattern.beams(0.0).map_err(|error| document.locate(error))?;
        Sensor::new(spec, folder.to_owned(), Arc::new(beams)).map_err(|error| document.locate(error))
    }

    /// A sensor of a checked description.
    ///
    /// # Errors
    /// Not as many numbers by channel as there are channels.
    fn new(spec: SensorSpec, folder: PathBuf, beams: Arc<BeamTable>) -> Result<Sensor> {
        let channels = beams.channel.iter().max().map_or(0, |&channel| usize::from(channel) + 1);
        let numbers = spec.detection.channel_efficiency.len();
        if numbers != 0 && numbers != channels {
            let (found, allowed) =
                (format!("a list of {numbers}"), format!("as many as there are channels ({channels})"));
            return Err(Error::invalid("detection.channel_efficiency", found, allowed));
        }
        Ok(Sensor {
            wavelength_nm: spec.beam.wavelength_nm,
            range_min_m: spec.range.min_m,
            range_max_m: spec.range.max_m.unwrap_or(f64::INFINITY),
            range_resolution_m: spec.range.resolution_m,
            detection: spec.detection.clone(),
            noise: spec.noise.clone(),
            intensity: spec.intensity.encoding,
            camera: spec.tof.as_ref().map(|tof| Camera::new(tof, &spec.pattern)),
            texture: spec.acoustics.as_ref().and_then(|it| it.texture_shape).map_or_else(|| Arc::from([]), texture),
            transducers: Arc::default(),
            spec,
            folder,
            beams,
            channels,
        })
    }

    /// Its detection model made ready; `blainder`: as the paper's program has it.
    pub(crate) fn threshold(&self, blainder: bool) -> Threshold {
        Threshold::new(&self.detection.model, (self.wavelength_nm, self.spec.beam.pulse_ns), blainder)
    }

    /// How it receives, with `threshold` in place of its detection model.
    pub(crate) fn receiver(&self, threshold: Threshold) -> Receiver {
        let beam = &self.spec.beam;
        Receiver {
            pulse: Pulse::new(beam.pulse_shape, beam.pulse_ns),
            overlap: beam.overlap_m,
            cone: Cone {
                start: beam.exit_diameter_mm * 1e-3,
                divergence: beam.divergence_mrad.map(|mrad| mrad * 1e-3),
            },
            threshold,
            range_min: self.range_min_m,
            range_max: match &*self.beams.range_max {
                [] => self.range_max_m,
                limits => limits.iter().copied().fold(0.0, f32::max).into(),
            },
        }
    }

    /// Sound, transmitter and receiver.
    ///
    /// # Errors
    /// A sensor that is no sonar.
    pub fn acoustics(&self) -> Result<&AcousticsSpec> {
        let kind = self.kind();
        self.spec.acoustics.as_ref().ok_or_else(|| Error::invalid("kind of the sensor", kind, "sonar, which pings"))
    }

    /// What pictures its pings make.
    pub(crate) fn sonar_view(&self) -> SonarView {
        match self.spec.pattern {
            Pattern::Sidescan(_) => SonarView::Sidescan,
            Pattern::Multibeam(_) => SonarView::Swath,
            Pattern::Imaging(_) => SonarView::Fan,
            _ => SonarView::Single,
        }
    }

    /// Where a sonar at `pose` looks at ping `number`: beams that turn look elsewhere with each.
    pub(crate) fn turned(&self, pose: Pose, number: u32) -> Pose {
        match &self.spec.pattern {
            Pattern::SingleBeam(beam) => {
                let turn = glam::DQuat::from_rotation_z(beam.azimuth_deg(number).to_radians());
                Pose { orientation: pose.orientation * turn, ..pose }
            }
            _ => pose,
        }
    }

    /// What a sonar sends and hears at `wavelength` m, where sound is `ratio` times as fast as its beamformer believes. Of
    /// wavelengths that hardly differ one stands for all.
    pub(crate) fn transducer(&self, wavelength: f64, ratio: f64) -> Arc<Transducer> {
        /// Steps of the wavelength and of the ratio, as a part of them: beams turn with the ratio.
        const STEPS: [f64; 2] = [1e-3, 1e-4];
        /// A sonar that goes up and down meets a few; it must not fill the memory.
        const MOST: usize = 16;
        let step = |value: f64, step: f64| ((value.ln() / step).round() * step).exp();
        let (wavelength, ratio) = (step(wavelength, STEPS[0]), step(ratio, STEPS[1]));
        let mut known = self.transducers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., found)) = known.iter().find(|known| (known.0, known.1) == (wavelength, ratio)) {
            return found.clone();
        }
        let made = Transducer::new(&self.spec.pattern, wavelength, ratio).unwrap_or_default();
        if known.len() == MOST {
            known.remove(0);
        }
        known.push((wavelength, ratio, Arc::new(made)));
        known[known.len() - 1].2.clone()
    }

    /// Rays of one scan: as many as beams, but of a sonar, whose beams many rays stand for.
    pub fn ray_count(&self) -> usize {
        if self.spec.acoustics.is_some() { self.rays().len() } else { self.beams.len() }
    }

    /// The rays that stand for its beams, where each beam is no ray of its own: of a sonar in water of 1500 m/s.
    pub(crate) fn rays(&self) -> Cow<'_, BeamTable> {
        let Some(acoustics) = &self.spec.acoustics else { return Cow::Borrowed(&self.beams) };
        let transducer = self.transducer(1500.0 / acoustics.frequency(), 1.0);
        let [dir_x, dir_y, dir_z] = transducer.direction.clone();
        let rays = dir_x.len();
        Cow::Owned(BeamTable {
            rows: 1,
            columns: rays as u32,
            dir_x,
            dir_y,
            dir_z,
            time: vec![0.0; rays],
            channel: vec![0; rays],
            ..BeamTable::clone(&self.beams)
        })
    }

    /// How what its beams send back makes returns.
    pub(crate) fn signals(&self) -> Signals {
        let SensorSpec { beam, returns, .. } = &self.spec;
        // A pixel has one range.
        let mode = if self.spec.tof.is_some() { ReturnMode::Strongest } else { returns.mode };
        let rule = ReturnRule { mode, max: returns.max.into(), separation: returns.separation_m as f32 };
        let footprint = (beam.sub_rays > 1).then(|| match &self.spec.pattern {
            Pattern::Pinhole(camera) if self.spec.kind == SensorKind::Tof => {
                Footprint::of_pixel(beam.sub_rays as usize, camera.pixel())
            }
            _ => {
                let divergence = beam.divergence_mrad.map(|mrad| mrad * 1e-3);
                Footprint::new(beam.sub_rays as usize, beam.exit_diameter_mm * 1e-3, divergence)
            }
        });
        Signals { footprint, sigma: Pulse::new(beam.pulse_shape, beam.pulse_ns).sigma(), rule }
    }

    /// The errors of its ranges.
    pub(crate) fn range_error(&self, threshold: Threshold) -> RangeError {
        let BeamSpec { pulse_shape, pulse_ns, .. } = self.spec.beam;
        let edge_sigma = match self.detection.timing {
            Timing::Peak => 0.0,
            Timing::LeadingEdge => Pulse::new(pulse_shape, pulse_ns).sigma(),
        };
        RangeError::new(&self.noise, self.range_resolution_m, self.channels, edge_sigma, threshold)
    }

    /// How it sees itself in smooth surfaces, if it does. Of an elliptic beam the round one of the same area stands for it;
    /// where many rays make up the beam, each of them is a line.
    pub(crate) fn glint(&self) -> Option<Glint> {
        let beam = &self.spec.beam;
        let [horizontal, vertical] = beam.divergence_mrad;
        let width = if beam.sub_rays > 1 { 0.0 } else { 1.0 };
        beam.aperture_mm.map(|diameter| Glint {
            start: (0.5e-3 * beam.exit_diameter_mm * width) as f32,
            divergence: (0.5e-3 * (horizontal * vertical).sqrt() * width) as f32,
            opening: (0.5e-3 * diameter) as f32,
        })
    }

    /// Which echoes of a beam it reports.
    pub(crate) fn return_mode(&self) -> ReturnMode {
        self.spec.returns.mode
    }

    /// An ideal lidar with beams of your own: no noise, no threshold, no range limit but the table's.
    ///
    /// # Errors
    /// As [`BeamTable::check`].
    pub fn from_beams(name: impl Into<String>, mut beams: BeamTable) -> Result<Sensor> {
        beams.check()?;
        beams.normalize();
        let spec = SensorSpec {
            name: name.into(),
            title: String::new(),
            kind: SensorKind::Lidar,
            source: String::new(),
            pattern: Pattern::Custom,
            beam: BeamSpec::default(),
            range: RangeSpec::default(),
            detection: DetectionSpec::default(),
            returns: ReturnsSpec::default(),
            noise: Noise::default(),
            intensity: IntensitySpec::default(),
            tof: None,
            acoustics: None,
            expect: None,
        };
        spec.check()?;
        Sensor::new(spec, PathBuf::new(), Arc::new(beams))
    }

    /// Changes one parameter: `key` is its path in the YAML (`noise.range_sigma_m`, `pattern.resolution[0]`), `value`
    /// is YAML too, a number, a word, a list or a whole section; `null` takes an optional key away. On an error the
    /// sensor stays as it was.
    ///
    /// # Errors
    /// An unknown key (with near ones), a wrong type, a value out of range, a pattern that cannot be drawn.
    pub fn set(&mut self, key: &str, value: &str) -> Result<()> {
        let mut tree = self.tree()?;
        yaml::set(&mut tree, key, value)?;
        let document = Document::from_value(yaml::assignment(key, value), tree);
        let mut spec = SensorSpec::read(&document)?;
        spec.pattern.resolve(&self.folder, Some(&self.spec.pattern));
        let beams = if spec.pattern == self.spec.pattern {
            self.beams.clone()
        } else {
            Arc::new(spec.pattern.beams(0.0).map_err(|error| document.locate(error))?)
        };
        *self = Sensor::new(spec, self.folder.clone(), beams).map_err(|error| document.locate(error))?;
        Ok(())
    }

    /// A numeric parameter by its path in the YAML, as [`Sensor::set`] takes it, and the bounds of its key. Within them
    /// `set` may still refuse a value where several keys must fit together: too many beams, steps that two keys say
    /// differently, a `range.resolution_m` between 0 and a micrometre.
    ///
    /// # Errors
    /// [`Error::Missing`] with near keys; [`Error::InvalidParameter`] for the key of a word, a list or a section.
    pub fn parameter(&self, key: &str) -> Result<Parameter> {
        let tree = self.tree()?;
        let mut bounds = Bounds::of(key);
        self.spec.check_with(&mut bounds)?;
        let value = match yaml::lookup(&tree, key) {
            Some(Value::Number(number)) => number.as_f64().unwrap_or(f64::NAN),
            Some(other) => {
                let found = match other {
                    Value::Array(_) => "a list",
                    Value::Object(_) => "a section of keys",
                    _ => "a word",
                };
                return Err(Error::invalid(
                    key,
                    found,
                    "the keys of numbers, such as range.min_m or pattern.fov_deg[0]",
                ));
            }
            None if yaml::same_path(key, "range.max_m") => f64::INFINITY,
            None if !(self.kind() == SensorKind::Sonar && is_of_light(key)) && takes_numbers(tree.clone(), key) => {
                f64::NAN
            }
            None => {
                let known: BTreeSet<String> = yaml::numbers(&tree).into_iter().chain(bounds.keys).collect();
                return Err(Error::missing("numeric parameter", key, known));
            }
        };
        Ok(Parameter { value, min: bounds.min, max: bounds.max })
    }

    /// Its description as a tree of values.
    fn tree(&self) -> Result<Value> {
        serde_json::to_value(&self.spec).map_err(|error| Error::Internal(error.to_string()))
    }

    /// Its description, with every key that has a value.
    pub fn to_yaml(&self) -> Result<String> {
        yaml::to_string(&self.spec)
    }

    /// Its description.
    pub fn spec(&self) -> &SensorSpec {
        &self.spec
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.spec.name
    }

    /// Its name for people; may be empty.
    pub fn title(&self) -> &str {
        &self.spec.title
    }

    /// What it measures with.
    pub fn kind(&self) -> SensorKind {
        self.spec.kind
    }

    /// Where its numbers come from; may be empty.
    pub fn source(&self) -> &str {
        &self.spec.source
    }

    /// Figures of the maker that its pattern is tested against.
    pub fn expectations(&self) -> Option<&Expectations> {
        self.spec.expect.as_ref()
    }

    /// The beams of one scan; of a pattern that does not repeat, those of the scan that starts at time 0.
    pub fn beams(&self) -> &BeamTable {
        &self.beams
    }

    /// The beams of the scan that starts at `start_time`, s: as many in every scan, drawn anew if the pattern does not
    /// repeat.
    ///
    /// # Errors
    /// A start that is not finite, a beam that a prism reflects totally, no memory.
    pub fn beams_at(&self, start_time: f64) -> Result<Arc<BeamTable>> {
        if start_time == 0.0 || self.spec.pattern.repeats() {
            return Ok(self.beams.clone());
        }
        self.spec.pattern.beams(start_time).map(Arc::new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINIMAL: &str = "
name: mini
kind: lidar
pattern:
  type: spinning
  azimuth: {fov_deg: 90, rate_hz: 10, step_deg: 1}
  elevation: {fov_deg: 10, step_deg: 1}
";

    fn message(text: &str) -> String {
        Sensor::from_yaml(text, "").unwrap_err().to_string()
    }

    #[test]
    fn what_is_left_out_is_ideal() {
        let sensor = Sensor::from_yaml(MINIMAL, "").unwrap();
        assert_eq!((sensor.name(), sensor.kind(), sensor.beams().len()), ("mini", SensorKind::Lidar, 91 * 11));
        assert_eq!((sensor.range_min_m, sensor.range_max_m, sensor.range_resolution_m), (0.0, f64::INFINITY, 0.0));
        assert_eq!(
            (sensor.wavelength_nm, &sensor.detection, &sensor.noise),
            (905.0, &DetectionSpec::default(), &Noise::default())
        );
        assert_eq!(sensor.intensity, IntensityEncoding::Reflectivity);
    }

    #[test]
    fn presets_are_found_by_name() {
        let sensor = Sensor::preset("velodyne_vlp32c").unwrap();
        assert_eq!((sensor.name(), sensor.beams().rows), ("velodyne_vlp32c", 32));
        assert_eq!(sensor.range_max_m, 200.0);
        assert_eq!(sensor.detection.model, Detection::RadarEquation { reflectance: 0.8, at_m: 200.0 });
        let error = Sensor::preset("velodyne_vlp32").unwrap_err().to_string();
        assert!(
            error.starts_with("there is no sensor preset named \"velodyne_vlp32\"; near: velodyne_vlp32c"),
            "{error}"
        );
        assert_eq!(Sensor::presets().len(), presets::sensors().count());
    }

    #[test]
    fn errors_name_line_and_key() {
        let cases = [
            ("noise: {range_sigma: 1}", "line 8: noise.range_sigma: unknown key \"range_sigma\"; near: range_sigma_m"),
            ("nois: {}", "line 8: nois: unknown key \"nois\"; near: noise; allowed: name, title, kind"),
            (
                "noise:\n  range_sigma_m: lots",
                "line 9: noise.range_sigma_m: invalid type: string \"lots\", expected a number",
            ),
            ("noise:\n  range_sigma_m: -1", "line 9: noise.range_sigma_m: is -1; allowed: 0 to 1000000000"),
            ("noise:\n  range_sigma_m: .nan", "line 9: "),
            ("noise:\n  range_sigma_per_m: 2", "line 9: noise.range_sigma_per_m: is 2; allowed: 0 to 1"),
            (
                "noise:\n  instrument: -1",
                "line 9: noise.instrument: invalid value: integer `-1`, expected a whole number",
            ),
            (
                "noise:\n  range_table: [{at_m: 3, sigma_m: 0.1}, {at_m: 2, sigma_m: 0.1}]",
                "line 9: noise.range_table[1].at_m: is 2; allowed: above noise.range_table[0].at_m (3)",
            ),
            (
                "noise:\n  range_table:\n    - {at_m: 3, sigma_m: -0.1}",
                "line 10: noise.range_table[0].sigma_m: is -0.1; allowed: 0 to",
            ),
            ("noise:\n  range_table: [{at_m: 3}]", "line 9: noise.range_table[0]: the key `sigma_m` is missing"),
            (
                "noise:\n  dropout_weak: {below: 0, at_zero: 0.4}",
                "line 9: noise.dropout_weak.below: is 0; allowed: above 0, at most 1000",
            ),
            ("noise: {dropout_weak: 0.4}", "line 8: noise.dropout_weak: invalid type"),
            ("noise: {azimuth_step_deg: 11}", "line 8: noise.azimuth_step_deg: is 11; allowed: 0, or 0.0001 to 10"),
            (
                "noise: {azimuth_step_deg: 1e-9}",
                "line 8: noise.azimuth_step_deg: is 0.000000001; allowed: 0, or 0.0001 to",
            ),
            ("noise: {pointing_sigma_deg: -1}", "line 8: noise.pointing_sigma_deg: is -1; allowed: 0 to 10"),
            ("noise:\n  range_snr_sigma_m: 1", "line 9: noise.range_snr_sigma_m: is 1; allowed: 0, or above with"),
            ("range: {min_m: 5, max_m: 4}", "line 8: range.max_m: is 4; allowed: above range.min_m (5)"),
            ("returns: {mode: best}", "line 8: returns.mode: unknown value \"best\"; allowed: strongest, first, last"),
            (
                "returns: {max: 256}",
                "line 8: returns.max: invalid value: integer `256`, expected a whole number from 0 to 255",
            ),
            (
                "detection:\n  model: radar_equation\n  reflectance: 2\n  at_m: 1",
                "line 10: detection.reflectance: is 2; allowed: above 0, at most 1",
            ),
            (
                "detection:\n  model: radar_equation\n  reflectance: x\n  at_m: 1",
                "line 10: detection.reflectance: invalid type: string \"x\"",
            ),
            ("detection:\n  model: radar_equation\n  reflectance: 1", "line 8: detection: the key `at_m` is missing"),
            (
                "detection:\n  model: radar_equation\n  reflectance: 1\n  at_n: 1",
                "line 11: detection.at_n: unknown key \"at_n\"; near: at_m",
            ),
            ("detection: {model: radar}", "line 8: detection.model: unknown value \"radar\"; near: radar_equation"),
            ("detection: {reflectance: 1}", "line 8: detection: the key `model` is missing"),
            (
                "detection: {model: reflectivity_limit, lower: {reflectance: 0, at_m: 5}, upper: {reflectance: 1, at_m: 5}}",
                "line 8: detection.upper.at_m: is 5; allowed: above detection.lower.at_m (5)",
            ),
            (
                "beam: {divergence_mrad: 3}",
                "line 8: beam.pulse_ns: is 0; allowed: above 0 with a beam.divergence_mrad: without a pulse",
            ),
            ("beam: {sub_rays: 19}", "line 8: beam.pulse_ns: is 0; allowed: above 0 with beam.sub_rays above 1"),
            ("beam: {sub_rays: 0}", "line 8: beam.sub_rays: is 0; allowed: 1 to 1024"),
            ("returns: {mode: both}", "line 8: returns.mode: unknown value \"both\"; allowed: strongest, first, last"),
            ("detection: {model: table}", "line 8: detection: the key `points` is missing"),
            ("detection: {model: table, points: []}", "line 8: detection.points: is a list of 0; allowed: 1 to 1000"),
            (
                "detection:\n  model: table\n  points:\n    - {reflectance: 0.1, at_m: 5}\n    - {reflectance: 0.2, at_m: 5}",
                "line 12: detection.points[1].at_m: is 5; allowed: above detection.points[0].at_m (5)",
            ),
            (
                "detection:\n  model: table\n  points:\n    - {reflectance: 1.1, at_m: 5}",
                "line 11: detection.points[0].reflectance: is 1.1; allowed: 0 to 1",
            ),
            (
                "detection:\n  model: table\n  points:\n    - {reflectance: 0.1, range_m: 5}",
                "line 11: detection.points[0].range_m: unknown key \"range_m\"",
            ),
            (
                "detection: {model: statistical, reflectance: 0.1, at_m: 9}",
                "line 8: detection: the key `tnr` is missing",
            ),
            (
                "detection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 0.5}",
                "line 8: detection.tnr: is 0.5; allowed: 1 to 100",
            ),
            (
                "detection: {model: statistical, reflectance: 0, at_m: 9, tnr: 5}",
                "line 8: detection.reflectance: is 0; allowed: above 0, at most 1",
            ),
            (
                "detection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 5, probability: 1}",
                "line 8: detection.probability: is 1; allowed: 0.5 to 0.999",
            ),
            (
                "detection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 5, bandwidth_mhz: 100}",
                "line 8: detection.bandwidth_mhz: is 100; allowed: 0, or above with range.max_m",
            ),
            (
                "detection:\n  model: statistical\n  reflectance: 0.1\n  at_m: 9\n  tnr: 5\n  sunlight: {pulse_uj: 1}",
                "line 13: detection.sunlight: the key `aperture_mm` is missing",
            ),
            (
                "beam: {pulse_ns: 5}\ndetection:\n  model: statistical\n  reflectance: 0.1\n  at_m: 9\n  tnr: 5\n  \
                 sunlight: {pulse_uj: 1, aperture_mm: 20, field_of_view_mrad: [3, 0], filter_nm: 20}",
                "line 14: detection.sunlight.field_of_view_mrad[1]: is 0; allowed: 0.001 to 1000",
            ),
            (
                "beam: {pulse_ns: 0}\ndetection: {model: statistical, reflectance: 0.1, at_m: 9, tnr: 5, sunlight: \
                 {pulse_uj: 1, aperture_mm: 20, field_of_view_mrad: [3, 3], filter_nm: 20}}",
                "line 8: beam.pulse_ns: is 0; allowed: above 0 with detection.sunlight",
            ),
            (
                "detection: {model: none, channel_efficiency: [1, 0.5]}",
                "line 8: detection.channel_efficiency: is a list of 2; allowed: as many as there are channels (11)",
            ),
            (
                "detection:\n  model: none\n  channel_efficiency: [1, 1.5]",
                "line 10: detection.channel_efficiency[1]: is 1.5; allowed: 0 to 1",
            ),
            (
                "detection:\n  model: none\n  channel_efficiency: all",
                "line 10: detection.channel_efficiency: invalid type: string \"all\", expected a list",
            ),
            (
                "detection:\n  model: none\n  saturation: 100",
                "line 10: detection.saturation: is 100; allowed: a value with detection.model: radar_equation or",
            ),
            (
                "detection: {model: none, timing: leading_edge}",
                "line 8: detection.timing: is leading_edge; allowed: peak, or with detection.model: radar_equation or",
            ),
            (
                "beam: {pulse_ns: 0}\ndetection: {model: radar_equation, reflectance: 0.1, at_m: 9, timing: leading_edge}",
                "line 8: beam.pulse_ns: is 0; allowed: above 0 with detection.timing: leading_edge",
            ),
            (
                "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, timing: edge}",
                "line 8: detection.timing: unknown value \"edge\"; near: leading_edge; allowed: peak, leading_edge",
            ),
            (
                "detection: {model: none, blooming: {weight: 0.1, width_deg: 1}}",
                "line 8: detection.blooming: is given; allowed: with detection.model: radar_equation or statistical only",
            ),
            (
                "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, blooming: {weight: 0.1, width_deg: 1}}",
                "line 2: beam.pulse_ns: is 0; allowed: above 0 with detection.blooming",
            ),
            (
                "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, blooming: {weight: 2, width_deg: 1}}",
                "line 8: detection.blooming.weight: is 2; allowed: 0 to 1",
            ),
            (
                "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, blooming: {weight: 0.1, width_deg: 0}}",
                "line 8: detection.blooming.width_deg: is 0; allowed: above 0, at most 90",
            ),
            (
                "detection: {model: radar_equation, reflectance: 0.1, at_m: 9, saturation: 0.5}",
                "line 8: detection.saturation: is 0.5; allowed: 1 to 1000000000000",
            ),
            ("beam: {aperture_mm: 0}", "line 8: beam.aperture_mm: is 0; allowed: above 0, at most 1000"),
            ("beam: {divergence_mrad: [1, 2, 3]}", "line 8: beam.divergence_mrad"),
            (
                "beam: {divergence_mrad: wide}",
                "line 8: beam.divergence_mrad: invalid type: string \"wide\", expected a number or a pair of numbers",
            ),
            ("name: again", "line 8: duplicate"),
            ("title: [", "line 8: unclosed bracket"),
            ("noise:", "line 8: noise: invalid type: null, expected a section of keys"),
        ];
        for (text, expected) in cases {
            let error = message(&format!("{MINIMAL}{text}\n"));
            assert!(
                error.starts_with(&format!("YAML text: {expected}")),
                "{text}\n  gives {error}\n  not   {expected}"
            );
        }
    }

    #[test]
    fn errors_of_depth_cameras_name_line_and_key() {
        const CAMERA: &str = "name: mini\nkind: tof\npattern: {type: pinhole, resolution: [4, 4], fov_deg: [60, 60]}\n";
        let cases = [
            ("{frequency_mhz: 20}", "tof.frequency_mhz: unknown key \"frequency_mhz\"; near: frequencies_mhz"),
            ("{frequencies_mhz: 20}", "tof.frequencies_mhz: invalid type: integer `20`"),
            ("{frequencies_mhz: [20, 0]}", "tof.frequencies_mhz[1]: is 0; allowed: 0.1 to 10000"),
            ("{frequencies_mhz: [20.0001]}", "tof.frequencies_mhz[0]: is 20.0001; allowed: whole kHz"),
            ("{frequencies_mhz: [1, 2, 3, 4]}", "tof.frequencies_mhz: is a list of 4; allowed: up to 3"),
            (
                "{frequencies_mhz: [100, 20.001]}",
                "tof.frequencies_mhz: is [100.0, 20.001], the highest 100000 times their common divisor; allowed: at most",
            ),
            ("{wiggle_residual: 2}", "tof.wiggle_residual: is 2; allowed: 0 to 1"),
            ("{inconsistency_m: 0.1}", "tof.inconsistency_m: is given; allowed: with tof.frequencies_mhz only"),
            (
                "{shot_noise: {sigma_m: 0.01, reflectance: 0.5, at_m: 1}}",
                "tof.shot_noise: is given; allowed: with tof.frequencies_mhz only",
            ),
            ("{shot_noise: {sigma_m: 0.01}}", "tof.shot_noise: the key `reflectance` is missing"),
            (
                "{frequencies_mhz: [20], shot_noise: {sigma_m: 0, reflectance: 0.5, at_m: 1}}",
                "tof.shot_noise.sigma_m: is 0; allowed: 0.000000001 to 1000",
            ),
            (
                "{saturation: {reflectance: 0, at_m: 1}}",
                "tof.saturation.reflectance: is 0; allowed: above 0, at most 1",
            ),
            ("{vignetting: cos3}", "tof.vignetting: unknown value \"cos3\"; near: cos4"),
            (
                "{illumination: [{angle_deg: 5, value: 1}, {angle_deg: 5, value: 0}]}",
                "tof.illumination[1].angle_deg: is 5; allowed: above tof.illumination[0].angle_deg (5)",
            ),
            ("{depth_noise: {model: khosh}}", "tof.depth_noise.model: unknown value \"khosh\"; near: khoshelham"),
            ("{depth_noise: {model: nguyen, sigma_m: 1}}", "tof.depth_noise.sigma_m: unknown key \"sigma_m\""),
            (
                "{depth_noise: {model: disparity, sigma_px: 0.1}}",
                "tof.depth_noise.model: is disparity; allowed: with tof.second_eye_m only",
            ),
            (
                "{depth_noise: {model: polynomial, sigma_m: [0, 1001, 0]}}",
                "tof.depth_noise.sigma_m[1]: is 1001; allowed: -1000 to 1000",
            ),
            ("{lateral_sigma_px: 11}", "tof.lateral_sigma_px: is 11; allowed: 0 to 10"),
            ("{multipath_rays: 8}", "tof.multipath_rays: is given; allowed: with tof.frequencies_mhz only"),
            ("{multipath_rays: 257}", "tof.multipath_rays: is 257; allowed: 0 to 256"),
            (
                "{second_eye_m: [0, 0, 0]}",
                "tof.second_eye_m: is where the camera is; allowed: 1e-6 m or more beside it",
            ),
        ];
        for (section, expected) in cases {
            let error = message(&format!("{CAMERA}tof: {section}\n"));
            let expected = format!("YAML text: line 4: {expected}");
            assert!(error.starts_with(&expected), "{section}\n  gives {error}\n  not   {expected}");
        }
        assert!(message(&format!("{MINIMAL}tof: {{}}\n")).contains("tof: is given; allowed: with kind: tof only"));
        let spinning = MINIMAL.replace("lidar", "tof");
        let error = message(&format!("{spinning}tof: {{lateral_sigma_px: 1}}\n"));
        assert!(error.contains("tof.lateral_sigma_px: is given; allowed: with pattern.type: pinhole only"), "{error}");
    }

    #[test]
    fn errors_in_patterns_name_line_and_key() {
        let cases = [
            (
                "azimuth: {fov_deg: 90,",
                "azimuth: {fov: 90,",
                "line 6: pattern.azimuth.fov: unknown key \"fov\"; near: fov_deg",
            ),
            ("step_deg: 1}\n  e", "step_deg: 0}\n  e", "line 6: pattern.azimuth.step_deg: is 0; allowed: above 0"),
            ("fov_deg: 90, ", "", "line 6: pattern.azimuth: the key `fov_deg` is missing"),
            (
                "rate_hz: 10",
                "rate_hz: fast",
                "line 6: pattern.azimuth.rate_hz: invalid type: string \"fast\", expected a number",
            ),
            ("fov_deg: 90", "fov_deg: 361", "line 6: pattern.azimuth.fov_deg: is 361; allowed: above 0, at most 360"),
            (
                "step_deg: 1}\n  e",
                "step_deg: 1e-9}\n  e",
                "line 6: pattern.azimuth: is 11 x 90000000001 beams; allowed: at most",
            ),
            (
                ", step_deg: 1}\n  e",
                "}\n  e",
                "line 6: pattern.azimuth.step_deg: is missing; allowed: it, or pattern.cycle_us",
            ),
            ("fov_deg: 10", "fov_deg: 190", "line 7: pattern.elevation.fov_deg: is 190; allowed: above 0, at most 180"),
            (
                "type: spinning",
                "type: spining",
                "line 5: pattern.type: unknown value \"spining\"; near: spinning; allowed:",
            ),
            ("type: spinning", "type: custom", "line 5: pattern.type: is custom; allowed: spinning, raster"),
            ("  type: spinning\n", "", "line 4: pattern: the key `type` is missing"),
            (
                "elevation: {fov_deg: 10, step_deg: 1}",
                "channels: {}",
                "line 7: pattern.channels.elevation_deg: is a list of 0; allowed: 1 to",
            ),
            (
                "elevation: {fov_deg: 10, step_deg: 1}",
                "channels: {elevation_deg: [1, 91]}",
                "line 7: pattern.channels.elevation_deg[1]: is 91; allowed: -90 to 90",
            ),
            (
                "elevation: {fov_deg: 10, step_deg: 1}",
                "channels:\n    elevation_deg:\n      [1,\n      up]",
                "line 10: pattern.channels.elevation_deg[1]: invalid type: string \"up\"",
            ),
            (
                "elevation: {fov_deg: 10, step_deg: 1}",
                "channels: {elevation_deg: [1, 2], fire_time_us: [1]}",
                "line 7: pattern.channels.fire_time_us: is a list of 1; allowed: as many as elevation_deg (2)",
            ),
            ("kind: lidar", "kind: radar", "line 3: kind: unknown value \"radar\"; allowed: lidar, tof, sonar"),
        ];
        for (old, new, expected) in cases {
            assert!(MINIMAL.contains(old), "{old}");
            let error = message(&MINIMAL.replace(old, new));
            assert!(error.starts_with(&format!("YAML text: {expected}")), "{new}\n  gives {error}\n  not   {expected}");
        }
        let risley = "{type: risley, pulse_rate_hz: 10, prisms: [{wedge_deg: 9, ior: 1.5, rpm: 60, first_face: flat}]}";
        let risley = format!("name: mini\nkind: lidar\npattern: {risley}");
        Sensor::from_yaml(&risley, "").unwrap();
        let cases = [
            ("wedge_deg: 9", "wedge_deg: 61", "pattern.prisms[0].wedge_deg: is 61; allowed: -60 to 60"),
            ("ior: 1.5", "ior: 0.9", "pattern.prisms[0].ior: is 0.9; allowed: 1 to 4"),
            ("rpm: 60", "rpm: 1e7", "pattern.prisms[0].rpm: is 10000000; allowed: -1000000 to 1000000"),
            ("rpm: 60", "rpm: 60, phase_deg: 400", "pattern.prisms[0].phase_deg: is 400; allowed: -360 to 360"),
            ("rpm", "rpn", "pattern.prisms[0].rpn: unknown key \"rpn\"; near: rpm"),
            (
                "first_face: flat",
                "first_face: round",
                "pattern.prisms[0].first_face: unknown value \"round\"; allowed: flat",
            ),
            (", first_face: flat", "", "pattern.prisms[0]: the key `first_face` is missing"),
            ("pulse_rate_hz: 10", "pulse_rate_hz: 0", "pattern.pulse_rate_hz: is 0; allowed: above 0"),
            (
                "pulse_rate_hz: 10",
                "pulse_rate_hz: 1e10",
                "pattern.pulse_rate_hz: is 1 x 1000000000 beams; allowed: at most",
            ),
            (
                "prisms: [{wedge_deg: 9, ior: 1.5, rpm: 60, first_face: flat}]",
                "prisms: []",
                "pattern.prisms: is a list of 0; allowed: 1 to 8",
            ),
            (
                "pulse_rate_hz",
                "line_elevation_deg: [0, 46], pulse_rate_hz",
                "pattern.line_elevation_deg[1]: is 46; allowed: -45 to 45",
            ),
            ("wedge_deg: 9", "wedge_deg: 50", "pattern.prisms: is prisms that reflect beams totally; allowed: wedges"),
        ];
        for (old, new, expected) in cases {
            assert!(risley.contains(old), "{old}");
            let error = message(&risley.replace(old, new));
            assert!(error.starts_with(&format!("YAML text: line 3: {expected}")), "{new}\n  gives {error}");
        }
        assert_eq!(message(""), "YAML text: line 1: invalid type: null, expected a section of keys");
    }

    #[test]
    fn errors_of_sonars_name_line_and_key() {
        const SONAR: &str = "\
name: mini
kind: sonar
pattern: {type: sidescan}
acoustics: {frequency_khz: 450, bandwidth_khz: 30}
range: {max_m: 50}
";
        Sensor::from_yaml(SONAR, "").unwrap();
        let acoustics = "acoustics: {frequency_khz: 450, bandwidth_khz: 30}\n";
        let cases = [
            (acoustics, "", "line 1: acoustics: is missing; allowed: a section with kind: sonar"),
            ("frequency_khz: 450, ", "", "line 4: acoustics: the key `frequency_khz` is missing"),
            (
                "30}",
                "0}",
                "line 4: acoustics.bandwidth_khz: is 0; allowed: above 0, at most twice acoustics.frequency_khz",
            ),
            ("30}", "901}", "line 4: acoustics.bandwidth_khz: is 901; allowed: above 0, at most twice"),
            (
                ", bandwidth_khz: 30",
                "",
                "line 4: acoustics.bandwidth_khz: is missing; allowed: the one or acoustics.pulse_ms",
            ),
            ("bandwidth_khz: 30", "pulse_ms: 0.001", "line 4: acoustics.pulse_ms: is 0.001; allowed: at least 0.00111"),
            (
                "frequency_khz",
                "frequency_hz",
                "line 4: acoustics.frequency_hz: unknown key \"frequency_hz\"; near: frequency_khz",
            ),
            ("30}", "30, bounces: 9}", "line 4: acoustics.bounces: is 9; allowed: 0 to 8"),
            ("30}", "30, speckle: on}", "line 4: acoustics.speckle: unknown value \"on\"; allowed: frozen, off"),
            ("30}", "30, array_speed_m_s: 1480}", "line 4: acoustics.array_speed_m_s: is given; allowed: with pattern"),
            ("bandwidth_khz: 30", "pulse_ms: 1, taper: hamming", "line 4: acoustics.taper: is given; allowed: with ac"),
            ("sidescan", "sidescan, down_fov_deg: 90, step_deg: 2, rays: 9", "line 3: pattern.rays: is 9; allowed: no"),
            (
                "sidescan",
                "multibeam, beams: 4000, swath_deg: 9, rays: 1001",
                "line 3: pattern.rays: is 1001; allowed: ",
            ),
            (
                "sidescan",
                "multibeam, beams: 4000, swath_deg: 120, across_deg: 90, rays: 1000",
                "line 3: pattern.rays: is too many for these beams, which overlap: 1.6e10 of beams that hear a ray",
            ),
            ("30}", "30, tvg: {spreading: 61}}", "line 4: acoustics.tvg.spreading: is 61; allowed: 0 to 60"),
            ("range: {max_m: 50}\n", "", "line 1: range.max_m: is missing; allowed: a value with kind: sonar"),
            (
                "max_m: 50",
                "max_m: 50, resolution_m: 0.1",
                "line 5: range.resolution_m: is 0.1; allowed: 0 with kind: sonar, whose range bins are acoustics.bin_m",
            ),
            ("range", "beam: {pulse_ns: 5}\nrange", "line 5: beam: is given; allowed: with other kinds than sonar"),
            (
                "range",
                "detection: {model: none, timing: leading_edge}\nrange",
                "line 5: detection: is given; allowed: with",
            ),
            ("range", "returns: {mode: all}\nrange", "line 5: returns: is given; allowed: with other kinds than sonar"),
            ("range", "noise: {dropout: 0.1}\nrange", "line 5: noise: is given; allowed: with other kinds than sonar"),
            ("range", "intensity: {encoding: power}\nrange", "line 5: intensity: is given; allowed: with other"),
            (
                "range",
                "tof: {frequencies_mhz: [20]}\nrange",
                "line 5: tof: is given; allowed: with other kinds than sonar",
            ),
            ("kind: sonar", "kind: lidar", "line 3: pattern.type: is that of a sonar; allowed: with kind: sonar only"),
            (
                "{type: sidescan}",
                "{type: raster, azimuth: {fov_deg: 9, step_deg: 1}, elevation: {fov_deg: 9, step_deg: 1}}",
                "line 3: pattern.type: is that of another kind of sensor; allowed: sidescan, multibeam, imaging or",
            ),
            ("sidescan", "sidescann", "line 3: pattern.type: unknown value \"sidescann\"; near: sidescan"),
            ("sidescan", "sidescan, down_fov_deg: 90", "line 3: pattern.step_deg: is missing; allowed: a value with"),
            (
                "sidescan",
                "sidescan, step_deg: 1",
                "line 3: pattern.step_deg: is 1; allowed: with pattern.down_fov_deg only",
            ),
            ("sidescan", "sidescan, sides: left", "line 3: pattern.sides: unknown value \"left\"; allowed: both, port"),
            ("sidescan", "sidescan, tilt_deg: 91", "line 3: pattern.tilt_deg: is 91; allowed: 0 to 90"),
            (
                "sidescan",
                "sidescan, along_deg: wide",
                "line 3: pattern.along_deg: invalid type: string \"wide\", expected",
            ),
            ("sidescan", "multibeam, beams: 1, swath_deg: 120", "line 3: pattern.beams: is 1; allowed: 2 to 4096"),
            (
                "sidescan",
                "multibeam, beams: 9, swath_deg: 171",
                "line 3: pattern.swath_deg: is 171; allowed: above 0, at",
            ),
            (
                "sidescan",
                "imaging, beams: 9, fov_deg: 181",
                "line 3: pattern.fov_deg: is 181; allowed: above 0, at most",
            ),
            ("sidescan", "imaging, beams: 9", "line 3: pattern: the key `fov_deg` is missing"),
            ("sidescan", "single_beam, beam_deg: 0", "line 3: pattern.beam_deg: is 0; allowed: 0.001 to 180"),
            (
                "sidescan",
                "single_beam, beam_deg: 3, turn: {fov_deg: 361, step_deg: 1}",
                "line 3: pattern.turn.fov_deg: is 361; allowed: above 0, at most 360",
            ),
        ];
        for (old, new, expected) in cases {
            assert!(SONAR.contains(old), "{old}");
            let error = message(&SONAR.replacen(old, new, 1));
            assert!(error.starts_with(&format!("YAML text: {expected}")), "{new}\n  gives {error}\n  not   {expected}");
        }
        let error = message(&format!("{MINIMAL}acoustics: {{frequency_khz: 450, bandwidth_khz: 30}}\n"));
        assert_eq!(error, "YAML text: line 8: acoustics: is given; allowed: with kind: sonar only");
    }

    #[test]
    fn sonars_show_nothing_of_light() {
        let mut sensor = Sensor::preset("sss_450").unwrap();
        let text = sensor.to_yaml().unwrap();
        let sections: Vec<_> = text.lines().filter(|line| !line.starts_with(' ')).collect();
        let names: Vec<_> = sections.iter().map(|line| line.split(':').next().unwrap_or_default()).collect();
        assert_eq!(names, ["name", "title", "kind", "source", "pattern", "range", "acoustics", "expect"], "{text}");
        for key in ["noise.range_sigma_m", "beam.sub_rays", "detection.saturation", "tof.second_eye_m[0]"] {
            let error = sensor.parameter(key).unwrap_err().to_string();
            assert!(error.starts_with(&format!("there is no numeric parameter named {key:?}")), "{error}");
        }
        assert!(sensor.parameter("acoustics.bin_m").unwrap().value.is_nan());
        let error = sensor.set("noise.range_sigma_m", "1").unwrap_err().to_string();
        assert!(error.starts_with("noise.range_sigma_m=1: noise: is given; allowed: with other kinds"), "{error}");
        assert_eq!(sensor.to_yaml().unwrap(), text);
        sensor.set("acoustics.bin_m", "0.1").unwrap();
        sensor.set("pattern.along_deg", "1").unwrap();
        assert_eq!(sensor.parameter("acoustics.bin_m").unwrap(), Parameter { value: 0.1, min: 1e-3, max: 1000.0 });
        // The band lies around the frequency, and half a period is the shortest pulse.
        assert_eq!(sensor.parameter("acoustics.bandwidth_khz").unwrap().max, 900.0);
        assert_eq!(sensor.parameter("acoustics.frequency_khz").unwrap().min, 15.0);
        sensor.set("acoustics.bandwidth_khz", "null").unwrap();
        assert_eq!(sensor.parameter("acoustics.pulse_ms").unwrap().min, 1.0 / 900.0);
    }

    #[test]
    fn parameters_are_set_by_path() {
        let mut sensor = Sensor::preset("velodyne_vlp32c").unwrap();
        let beams = sensor.beams.clone();
        sensor.set("noise.range_sigma_m", "0").unwrap();
        assert_eq!(sensor.noise.range_sigma_m, 0.0);
        sensor.set("range.max_m", "null").unwrap();
        assert_eq!(sensor.range_max_m, f64::INFINITY);
        sensor.set("range.max_m", "50").unwrap();
        sensor.set("detection.model", "none").unwrap();
        assert_eq!((sensor.range_max_m, &sensor.detection.model), (50.0, &Detection::None));
        assert!(Arc::ptr_eq(&beams, &sensor.beams), "the pattern is not drawn again");
        sensor.set("pattern.azimuth.rate_hz", "20").unwrap();
        assert_eq!((sensor.beams().columns, sensor.beams().period), (904, 0.05));
        sensor.set("pattern.channels.elevation_deg[0]", "-30").unwrap();
        assert!((sensor.beams().dir_z[0] + 0.5).abs() < 1e-7);
    }

    #[test]
    fn a_wrong_setting_changes_nothing() {
        let mut sensor = Sensor::preset("velodyne_vlp32c").unwrap();
        let before = sensor.to_yaml().unwrap();
        let cases = [
            (
                "noise.range_sigma",
                "0",
                "noise.range_sigma=0: noise.range_sigma: unknown key \"range_sigma\"; near: range_sigma_m",
            ),
            (
                "noise.range_sigma_m",
                "x",
                "noise.range_sigma_m=x: noise.range_sigma_m: invalid type: string \"x\", expected a number",
            ),
            ("noise.range_sigma_m", "-1", "noise.range_sigma_m=-1: noise.range_sigma_m: is -1; allowed: 0 to"),
            ("noise.range_sigma_m", "[", "noise.range_sigma_m=[: line 1: "),
            (
                "noise.range_sigma_m.x",
                "1",
                "noise.range_sigma_m.x=1: noise.range_sigma_m has no key \"x\": it is not a section",
            ),
            (
                "beam.divergence_mrad[2]",
                "1",
                "beam.divergence_mrad[2]=1: beam.divergence_mrad[2] is past the end of the list of 2",
            ),
            ("noise[0]", "1", "noise[0]=1: noise is not a list"),
            ("noise..x", "1", "noise..x=1: the key has an empty part"),
            ("", "1", "=1: the key has an empty part"),
            ("noise.range_sigma_m", " ", "noise.range_sigma_m= : has no value; `null` takes a key away"),
            ("noise.rnage_sigma_m", "null", "noise.rnage_sigma_m=null: noise.rnage_sigma_m: unknown key"),
            (
                "range.resolution_m",
                "1e-7",
                "range.resolution_m=1e-7: range.resolution_m: is 0.0000001; allowed: 0, or 0.000001 to",
            ),
            ("weather.rain", "1", "weather.rain=1: weather: unknown key \"weather\""),
            ("pattern.type", "raster", "pattern.type=raster: pattern: the key `azimuth` is missing"),
            (
                "pattern.azimuth.step_deg",
                "0.4",
                "pattern.azimuth.step_deg=0.4: pattern.azimuth.step_deg: is 0.4; allowed: one of",
            ),
            ("kind", "sonar", "kind=sonar: acoustics: is missing; allowed: a section with kind: sonar"),
        ];
        for (key, value, expected) in cases {
            let error = sensor.set(key, value).unwrap_err().to_string();
            assert!(error.starts_with(expected), "{key}={value}\n  gives {error}\n  not   {expected}");
        }
        assert_eq!(sensor.to_yaml().unwrap(), before);
    }

    #[test]
    fn parameters_lie_within_bounds_that_hold() {
        for preset in presets::sensors() {
            let sensor = Sensor::preset(preset.name).unwrap();
            let tree = sensor.tree().unwrap();
            let keys = yaml::numbers(&tree);
            // A sonar is said by fewer.
            let least = if sensor.kind() == SensorKind::Sonar { 12 } else { 16 };
            assert!(keys.len() >= least, "{keys:?}");
            for key in keys {
                let number = yaml::lookup(&tree, &key).unwrap();
                let Parameter { value, min, max } = sensor.parameter(&key).unwrap();
                assert_eq!(Some(value), number.as_f64());
                assert!(min <= value && value <= max, "{}: {key} {value} {min} {max}", preset.name);
                assert_eq!(min.is_finite() && max.is_finite(), !key.starts_with("expect."), "{key}");
                let outside = if number.is_u64() { [min - 1.0, max + 1.0] } else { [min.next_down(), max.next_up()] };
                for value in outside.into_iter().filter(|value| value.abs() < 1e300) {
                    let text = if number.is_u64() { format!("{value}") } else { format!("{value:e}") };
                    assert!(sensor.clone().set(&key, &text).is_err(), "{}: {key}={text}", preset.name);
                }
            }
        }
    }

    #[test]
    fn what_is_called_allowed_is() {
        for preset in presets::sensors() {
            let sensor = Sensor::preset(preset.name).unwrap();
            let keys = yaml::numbers(&sensor.tree().unwrap());
            // Other patterns take their time.
            for key in keys.iter().filter(|key| !key.starts_with("pattern.")) {
                let Parameter { min, max, .. } = sensor.parameter(key).unwrap();
                for value in [min, max, 0.5 * (min + max), -1.0, 0.0, 1e-9, 1.0, 2000.0, 1e12, 1e300] {
                    let Err(error) = sensor.clone().set(key, &format!("{value:e}")) else { continue };
                    let error = error.to_string();
                    let Some((_, allowed)) = error.split_once("; allowed: ") else { continue };
                    // `1 to 5`, and `0, or 1 to 5`; others have words.
                    let ranges = allowed.split(", or ").map(|range| range.split_once(" to ").unwrap_or((range, range)));
                    let within = |(low, high): (&str, &str)| match (low.parse::<f64>(), high.parse::<f64>()) {
                        (Ok(low), Ok(high)) => (low..=high).contains(&value),
                        _ => false,
                    };
                    assert!(!ranges.into_iter().any(within), "{}: {error}", preset.name);
                }
            }
        }
    }

    #[test]
    fn bounds_follow_the_other_keys() {
        let mut sensor = Sensor::from_yaml(MINIMAL, "").unwrap();
        let bounds = |sensor: &Sensor, key: &str| {
            let Parameter { min, max, .. } = sensor.parameter(key).unwrap();
            (min, max)
        };
        assert_eq!(bounds(&sensor, "noise.range_snr_sigma_m"), (0.0, 0.0));
        assert_eq!(
            sensor.parameter("range.max_m").unwrap(),
            Parameter { value: f64::INFINITY, min: ABOVE_ZERO, max: 1e9 }
        );
        sensor.set("range", "{min_m: 2, max_m: 5}").unwrap();
        assert_eq!(bounds(&sensor, "range.max_m"), (2f64.next_up(), 1e9));
        assert_eq!(bounds(&sensor, "range.min_m"), (0.0, 5f64.next_down()));
        sensor.set("range.min_m", &format!("{:e}", 5f64.next_down())).unwrap();
        sensor.set("range.max_m", "5").unwrap();
        sensor.set("detection", "{model: radar_equation, reflectance: 1, at_m: 9}").unwrap();
        assert_eq!(bounds(&sensor, "noise.range_snr_sigma_m"), (0.0, 1e9));
        assert_eq!(bounds(&sensor, "detection.reflectance"), (ABOVE_ZERO, 1.0));
        let limits = "{model: reflectivity_limit, lower: {reflectance: 0, at_m: 3}, upper: {reflectance: 1, at_m: 9}}";
        sensor.set("detection", limits).unwrap();
        assert_eq!(bounds(&sensor, "detection.upper.at_m"), (3f64.next_up(), 1e9));
        assert_eq!(bounds(&sensor, "detection.lower.at_m"), (0.0, 9f64.next_down()));
        assert_eq!(bounds(&sensor, "returns.max"), (1.0, 255.0));
        let yaml = "{name: a, kind: tof, pattern: {type: pinhole, resolution: [640, 480], fov_deg: [90, 60]}}";
        let camera = Sensor::from_yaml(yaml, "").unwrap();
        assert_eq!(bounds(&camera, "pattern.resolution[1]"), (1.0, 100_000.0));
        assert_eq!(bounds(&camera, "pattern.fov_deg[0]"), (ABOVE_ZERO, 180f64.next_down()));
    }

    #[test]
    fn parameters_are_numbers_that_there_are() {
        let sensor = Sensor::preset("velodyne_vlp32c").unwrap();
        // A key that stands for another, one that the file leaves out, one without bounds.
        assert_eq!(sensor.parameter("pattern.channels.elevation_deg[00]").unwrap().min, -90.0);
        let step = sensor.parameter("pattern.azimuth.step_deg").unwrap();
        assert!(step.value.is_nan() && (step.min, step.max) == (1e-9, 1e12), "{step:?}");
        let points = sensor.parameter("expect.points_per_s").unwrap();
        assert_eq!((points.min, points.max), (f64::NEG_INFINITY, f64::INFINITY));
        let mine = Sensor::from_yaml(MINIMAL, "").unwrap();
        assert!(mine.parameter("expect.beams").unwrap().value.is_nan());
        let cases = [
            (
                "noise.range_sigma",
                "there is no numeric parameter named \"noise.range_sigma\"; near: noise.range_sigma_m",
            ),
            ("range.mx_m", "there is no numeric parameter named \"range.mx_m\"; near: range.max_m, range.min_m"),
            ("detection.at_m", "there is no numeric parameter named \"detection.at_m\""),
            ("noise.dropout.x", "there is no numeric parameter named \"noise.dropout.x\"; near: noise.dropout"),
            ("pattern.channels", "there is no numeric parameter named \"pattern.channels\""),
            ("", "there is no numeric parameter named \"\""),
            ("kind", "kind is a word; allowed: the keys of numbers, such as range.min_m or pattern.fov_deg[0]"),
            ("beam.divergence_mrad", "beam.divergence_mrad is a list; allowed: the keys of numbers"),
            ("beam", "beam is a section of keys; allowed: the keys of numbers"),
        ];
        for (key, expected) in cases {
            let error = mine.parameter(key).unwrap_err().to_string();
            assert!(error.starts_with(expected), "{key}\n  gives {error}\n  not   {expected}");
        }
    }

    #[test]
    fn written_yaml_reads_back_the_same() {
        for preset in presets::sensors() {
            let sensor = Sensor::preset(preset.name).unwrap();
            let text = sensor.to_yaml().unwrap();
            let again = Sensor::from_yaml(&text, "").unwrap_or_else(|error| panic!("{error}\n{text}"));
            assert_eq!(again.spec, sensor.spec, "{text}");
            assert!(text.lines().all(|line| line.len() <= 120 || line.starts_with("source:")), "{text}");
        }
    }

    /// With every key of detection and noise.
    #[test]
    fn what_noise_needs_is_written_and_has_bounds() {
        let detection = "{model: statistical, reflectance: 0.1, at_m: 90, probability: 0.5, tnr: 5, bandwidth_mhz: 200, \
                         channel_efficiency: [1, 0.9, 1, 1, 1, 1, 1, 1, 1, 1, 0], saturation: 1000, blooming: {weight: 1e-4, width_deg: 0.5}, \
                         sunlight: {pulse_uj: 1, aperture_mm: 20, field_of_view_mrad: [3, 1.5], filter_nm: 20, adaptive: false}}";
        let noise = "{range_table: [{at_m: 2, mean_m: 0.1, sigma_m: 0.01}, {at_m: 9, sigma_m: 0.1}], instrument: 7, \
                     channel_bias_sigma_m: 0.04, dropout_weak: {below: 0.8, at_zero: 0.4}, range_snr_sigma_m: 0.02}";
        let sections =
            format!("range: {{max_m: 200}}\nbeam: {{pulse_ns: 5}}\ndetection: {detection}\nnoise: {noise}\n");
        let mut sensor = Sensor::from_yaml(&format!("{MINIMAL}{sections}"), "").unwrap();
        let text = sensor.to_yaml().unwrap();
        assert_eq!(Sensor::from_yaml(&text, "").unwrap().spec, sensor.spec, "{text}");
        let bounds = |sensor: &Sensor, key: &str| {
            let Parameter { value, min, max } = sensor.parameter(key).unwrap();
            (value, min, max)
        };
        assert_eq!(bounds(&sensor, "noise.range_table[0].at_m"), (2.0, 0.0, 9f64.next_down()));
        assert_eq!(bounds(&sensor, "noise.range_table[1].mean_m"), (0.0, -1e9, 1e9));
        assert_eq!(bounds(&sensor, "noise.dropout_weak.below"), (0.8, ABOVE_ZERO, 1000.0));
        assert_eq!(bounds(&sensor, "noise.instrument"), (7.0, 0.0, f64::from(u32::MAX)));
        assert_eq!(bounds(&sensor, "detection.channel_efficiency[1]"), (0.9, 0.0, 1.0));
        assert_eq!(bounds(&sensor, "detection.saturation"), (1000.0, 1.0, 1e12));
        assert_eq!(bounds(&sensor, "detection.blooming.floor"), (0.0, 0.0, 1.0));
        assert_eq!(bounds(&sensor, "detection.sunlight.incidence_deg"), (45.0, 0.0, 90.0));
        // Another pattern has other channels, another model no sun.
        let error = sensor.set("pattern.elevation.fov_deg", "5").unwrap_err().to_string();
        assert!(
            error.contains("detection.channel_efficiency: is a list of 11; allowed: as many as there are channels (6)")
        );
        assert!(
            sensor.set("range.max_m", "null").unwrap_err().to_string().contains("bandwidth_mhz: is 200; allowed: 0,")
        );
        assert_eq!(sensor.to_yaml().unwrap(), text);
        sensor.set("detection", "{model: radar_equation, reflectance: 0.1, at_m: 9}").unwrap();
        assert!(sensor.parameter("detection.saturation").unwrap().value.is_nan());
        assert!(sensor.parameter("detection.sunlight.incidence_deg").is_err());
    }

    #[test]
    fn sensors_are_made_of_beams() {
        let beams = Sensor::from_yaml(MINIMAL, "").unwrap().beams().clone();
        let mut sensor = Sensor::from_beams("mine", beams.clone()).unwrap();
        sensor.set("range.max_m", "10").unwrap();
        assert_eq!((sensor.name(), sensor.range_max_m, sensor.beams()), ("mine", 10.0, &beams));
        let mut slack = beams.clone();
        slack.dir_x.iter_mut().chain(&mut slack.dir_y).chain(&mut slack.dir_z).for_each(|value| *value *= 1.00009);
        let tight = Sensor::from_beams("tight", slack).unwrap();
        assert!(tight.beams().dir_x.iter().zip(&beams.dir_x).all(|(is, exact)| (is - exact).abs() < 2e-7));
        let mut short = beams.clone();
        short.time.pop();
        let error = Sensor::from_beams("mine", short).unwrap_err().to_string();
        assert_eq!(error, "time is 1000 beams long; allowed: 1001 beams");
        let mut long = beams.clone();
        long.dir_x[3] = 2.0;
        assert!(Sensor::from_beams("mine", long).unwrap_err().to_string().starts_with("direction of beam 3 is (2, "));
        let nan = BeamTable { period: f64::NAN, ..beams };
        assert!(Sensor::from_beams("mine", nan).is_err());
    }

    #[test]
    fn tables_are_found_beside_the_sensor_file() {
        let folder = tempfile::tempdir().unwrap();
        let csv = "channel,elevation_deg,azimuth_deg,time_us,range_max_m\n# two beams\n3,30,0,5,10\n4,0,90,7.5,20\n";
        std::fs::write(folder.path().join("rays.csv"), csv).unwrap();
        let file = folder.path().join("mine.yaml");
        std::fs::write(&file, "name: mine\nkind: lidar\npattern: {type: table, file: rays.csv, rate_hz: 10}\n")
            .unwrap();
        let mut sensor = Sensor::load(&file).unwrap();
        sensor.set("pattern.rate_hz", "20").unwrap();
        let table = sensor.beams();
        assert_eq!((table.rows, table.columns, table.period, table.firing(1)), (1, 2, 0.05, 1));
        assert!((table.dir_z[0] - 0.5).abs() < 1e-7 && (table.dir_y[1] - 1.0).abs() < 1e-7);
        assert_eq!((&table.channel[..], &table.time[..]), (&[3, 4][..], &[5e-6, 7.5e-6][..]));
        assert_eq!((&table.range_max[..], table.range_min.len()), (&[10.0, 20.0][..], 0));
        table.check().unwrap();
        let cases = [
            ("azimuth_deg\n", "line 1: the column elevation_deg is missing"),
            ("azimuth_deg,elevation_deg,colour\n", "line 1: unknown column \"colour\"; allowed: azimuth_deg"),
            ("azimuth_deg,elevation_deg,azimuth_deg\n", "line 1: has two columns of one name"),
            ("azimuth_deg,elevation_deg\n", "has no beams"),
            ("", "is empty; expected a header"),
            ("azimuth_deg,elevation_deg\n0,0\n0,inf\n", "line 3: elevation_deg is \"inf\"; expected a finite number"),
            ("azimuth_deg,elevation_deg\n0,91\n", "line 2: elevation_deg is 91; allowed: -90 to 90"),
            ("azimuth_deg,elevation_deg\n0\n", "line 2: has 1 numbers; the header has 2"),
            ("azimuth_deg,elevation_deg\n0,0,0\n", "line 2: has 3 numbers; the header has 2"),
            ("azimuth_deg,elevation_deg,channel\n0,0,1.5\n", "line 2: channel is 1.5; allowed: whole numbers"),
            ("azimuth_deg,elevation_deg,range_max_m\n0,0,0\n", "line 2: range_max_m is 0; allowed: above range_min_m"),
        ];
        for (csv, expected) in cases {
            std::fs::write(folder.path().join("rays.csv"), csv).unwrap();
            let error = Sensor::load(&file).unwrap_err().to_string();
            assert!(error.contains(&format!("rays.csv: {expected}")), "{csv}  gives {error}");
        }
        std::fs::remove_file(folder.path().join("rays.csv")).unwrap();
        assert!(Sensor::load(&file).unwrap_err().to_string().contains("rays.csv: No such file"));
    }
}
