//! The contents of a sensor file.

use super::radar::RadarSpec;
use super::sonar::AcousticsSpec;
use super::tof::TofSpec;
use crate::detect::{DetectionSpec, Doppler, MultipleTimeAround, Noise, ReturnMode, VelocityLog};
use crate::echo::{IntensityEncoding, PulseShape};
use cloud::Driver;
use emitter::pattern::Pattern;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Unexpected, Visitor};
use serde::ser::{SerializeMap, SerializeStruct, Serializer};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A sensor file: what each key of its YAML means. An omitted key means the ideal case. Sonars and radars are written
/// without the sections for light (`beam`, `detection`, `returns`, `noise`, `intensity`, `doppler`), which their files
/// must not contain.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SensorSpec {
    /// Name; for a preset also the name of its file.
    pub name: String,
    /// Name for display.
    #[serde(default)]
    pub title: String,
    /// What it measures with.
    pub kind: SensorKind,
    /// Maker of its ROS driver, which numbers the rings and lays out the points in bags. LiDARs only. Without it, rings
    /// are numbered by rising elevation, and bags have what Velodyne's driver publishes.
    #[serde(default)]
    pub driver: Option<Driver>,
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
    /// Which echoes it detects.
    #[serde(default)]
    pub detection: DetectionSpec,
    /// Which echoes of a beam it reports.
    #[serde(default)]
    pub returns: ReturnsSpec,
    /// Measurement errors.
    #[serde(default)]
    pub noise: Noise,
    /// What it reports as intensity.
    #[serde(default)]
    pub intensity: IntensitySpec,
    /// How it measures radial velocities; without this section it does not. LiDARs only.
    #[serde(default)]
    pub doppler: Option<Doppler>,
    /// Keys for depth cameras only.
    #[serde(default)]
    pub tof: Option<TofSpec>,
    /// Keys for sonars only.
    #[serde(default)]
    pub acoustics: Option<AcousticsSpec>,
    /// Keys for radars only.
    #[serde(default)]
    pub radar: Option<RadarSpec>,
    /// How a Doppler velocity log measures; without this section it tracks the bottom exactly. Pattern `dvl` only.
    #[serde(default)]
    pub dvl: Option<VelocityLog>,
    /// The maker's figures, which the pattern is tested against.
    #[serde(default)]
    pub expect: Option<Expectations>,
}

impl SensorSpec {
    /// An ideal sensor: all other keys of a file are omitted.
    pub fn new(name: impl Into<String>, kind: SensorKind, pattern: Pattern) -> SensorSpec {
        SensorSpec {
            name: name.into(),
            title: String::new(),
            kind,
            driver: None,
            source: String::new(),
            pattern,
            beam: BeamSpec::default(),
            range: RangeSpec::default(),
            detection: DetectionSpec::default(),
            returns: ReturnsSpec::default(),
            noise: Noise::default(),
            intensity: IntensitySpec::default(),
            doppler: None,
            tof: None,
            acoustics: None,
            radar: None,
            dvl: None,
            expect: None,
        }
    }
}

impl Serialize for SensorSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let SensorSpec {
            name,
            title,
            kind,
            driver,
            source,
            pattern,
            beam,
            range,
            detection,
            returns,
            noise,
            intensity,
            doppler,
            tof,
            acoustics,
            radar,
            dvl,
            expect,
        } = self;
        let of_light = kind.is_optical();
        let mut keys = serializer.serialize_struct("SensorSpec", 18)?;
        keys.serialize_field("name", name)?;
        if !title.is_empty() {
            keys.serialize_field("title", title)?;
        }
        keys.serialize_field("kind", kind)?;
        if let Some(driver) = driver {
            keys.serialize_field("driver", driver)?;
        }
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
        if let Some(doppler) = doppler {
            keys.serialize_field("doppler", doppler)?;
        }
        if let Some(tof) = tof {
            keys.serialize_field("tof", tof)?;
        }
        if let Some(acoustics) = acoustics {
            keys.serialize_field("acoustics", acoustics)?;
        }
        if let Some(radar) = radar {
            keys.serialize_field("radar", radar)?;
        }
        if let Some(dvl) = dvl {
            keys.serialize_field("dvl", dvl)?;
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
#[non_exhaustive]
pub enum SensorKind {
    /// Pulses of light, beam by beam.
    Lidar,
    /// A depth camera.
    Tof,
    /// Pings of sound.
    Sonar,
    /// Frames of radio waves.
    Radar,
}

impl SensorKind {
    /// Whether it measures with light: weather in the air, mirrors and glass affect it.
    pub fn is_optical(self) -> bool {
        matches!(self, SensorKind::Lidar | SensorKind::Tof)
    }

    /// Whether a scan is a ping: levels of cells, which its points are made from.
    pub fn makes_pings(self) -> bool {
        self == SensorKind::Sonar
    }

    /// Whether it works under water only.
    pub fn is_under_water(self) -> bool {
        self == SensorKind::Sonar
    }
}

impl fmt::Display for SensorKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            SensorKind::Lidar => "lidar",
            SensorKind::Tof => "tof",
            SensorKind::Sonar => "sonar",
            SensorKind::Radar => "radar",
        })
    }
}

/// `beam`: light and shape of a single beam.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct BeamSpec {
    /// Wavelength, nm, 200 to 20000.
    pub wavelength_nm: f64,
    /// Full divergence at 1/e^2, horizontal and vertical, mrad, at least 0; one number stands for both.
    #[serde(deserialize_with = "number_or_pair")]
    pub divergence_mrad: [f64; 2],
    /// Full width of the pulse at half its peak power, ns, at least 0.
    pub pulse_ns: f64,
    /// Power of the pulse over time.
    pub pulse_shape: PulseShape,
    /// Diameter of the beam where it leaves the instrument, mm, 0 to 1000.
    pub exit_diameter_mm: f64,
    /// Diameter of the receiver's aperture, mm, above 0, at most 1000. With it, smooth surfaces at normal incidence
    /// reflect the instrument's own light back to it; without it, this effect is omitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aperture_mm: Option<f64>,
    /// Range below which the receiver sees nothing of its own beam and range from which it sees all of it, m; linear in
    /// between. This determines how nearby fog appears.
    pub overlap_m: [f64; 2],
    /// Range at which half of the light that reaches the receiver's aperture falls onto its detector, m, 0 to 1000:
    /// about the aperture over the field of view of one beam. Light from nearer is out of focus, so that nearby fog,
    /// rain and dust appear weaker. 0: all light is used.
    pub near_range_m: f64,
    /// Sub-rays of a beam.
    pub sub_rays: SubRays,
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
            near_range_m: 0.0,
            sub_rays: SubRays::Count(1),
        }
    }
}

/// How many sub-rays sample a beam: one along its axis, or several over its footprint (of a depth camera: over the
/// pixel), which resolve edges and slopes as the beam does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SubRays {
    /// This many for every beam, 1 to 1024.
    Count(u32),
    /// Several for beams whose footprint covers more than one surface, one for all others, which accounts for the
    /// footprint: the more oblique the surface, the wider and weaker its echo.
    Adaptive,
    /// The same, but no more than this many for any beam, 1 to [`SubRays::MOST`]; in files `{adaptive: 16}`.
    AdaptiveUpTo(u32),
}

impl SubRays {
    const ADAPTIVE: &str = "adaptive";
    /// Most sub-rays of a beam that has as many as it takes.
    pub const MOST: u32 = 64;

    /// Whether beams have as many as it takes, and more than one if need be.
    pub fn is_adaptive(self) -> bool {
        self.most_adaptive().is_some_and(|most| most > 1)
    }

    /// Most sub-rays of a beam, where they are as many as it takes.
    pub fn most_adaptive(self) -> Option<u32> {
        match self {
            SubRays::Count(_) => None,
            SubRays::Adaptive => Some(SubRays::MOST),
            SubRays::AdaptiveUpTo(most) => Some(most),
        }
    }
}

/// `range`: ranges that are reported.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct RangeSpec {
    /// Nearest, m, at least 0.
    pub min_m: f64,
    /// Farthest, m, above the nearest; without it there is no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_m: Option<f64>,
    /// Step of the reported range, m; 0 for none.
    pub resolution_m: f64,
    /// What becomes of echoes that arrive after the next pulse of a line scanner.
    pub multiple_time_around: MultipleTimeAround,
    /// Echoes that arrive so close to a pulse, before or after it, are lost in the light that this pulse scatters in the
    /// instrument, m of range, at least 0; unless `multiple_time_around` is `truth`.
    pub blind_m: f64,
}

impl Default for RangeSpec {
    fn default() -> Self {
        RangeSpec {
            min_m: 0.0,
            max_m: None,
            resolution_m: 0.0,
            multiple_time_around: MultipleTimeAround::Truth,
            blind_m: 1.5,
        }
    }
}

/// `returns`: which echoes of a beam are reported.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct ReturnsSpec {
    /// Which echoes.
    pub mode: ReturnMode,
    /// Greatest number of returns in mode `all`, 1 to 255.
    pub max: u8,
    /// Of echoes closer together than this, m, at least 0, only the strongest is reported.
    pub separation_m: f64,
}

impl Default for ReturnsSpec {
    fn default() -> Self {
        ReturnsSpec { mode: ReturnMode::Strongest, max: 5, separation_m: 0.0 }
    }
}

/// `intensity`: what is reported as intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct IntensitySpec {
    /// How received energy becomes a number.
    pub encoding: IntensityEncoding,
    /// Value of `reflectivity8` for a white surface, 1 to 250.
    pub white_count: u8,
}

impl Default for IntensitySpec {
    fn default() -> Self {
        IntensitySpec { encoding: IntensityEncoding::default(), white_count: 100 }
    }
}

/// `expect`: figures that a test compares the pattern with. They do not change a scan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
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
    /// Range at which a radar detects a target of `rcs_m2`, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_m: Option<f64>,
    /// Radar cross-section of a target that a radar detects at `range_m` but no longer at twice the range, m^2; without
    /// it, one of 10 m^2 is detected at `range_m`, and what limits the range is not noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rcs_m2: Option<f64>,
    /// Range resolution of a radar, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_resolution_m: Option<f64>,
    /// Greatest unambiguous range rate of a radar, m/s, after it has been unfolded if the radar does so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_m_s: Option<f64>,
    /// Resolution of range rates, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_resolution_m_s: Option<f64>,
    /// Full width of a radar's beam straight ahead at half the power in azimuth, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_resolution_deg: Option<f64>,
    /// Likewise in elevation, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_resolution_deg: Option<f64>,
    /// Where the figures come from: `data sheet`, or `computed` from the pattern's own numbers.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub source: String,
}

impl Serialize for SubRays {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            SubRays::Count(count) => serializer.serialize_u32(count),
            SubRays::Adaptive => serializer.serialize_str(SubRays::ADAPTIVE),
            SubRays::AdaptiveUpTo(most) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry(SubRays::ADAPTIVE, &most)?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for SubRays {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CountOrWord;

        impl<'de> Visitor<'de> for CountOrWord {
            type Value = SubRays;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a whole number from 1 to 1024, `adaptive` or `{adaptive: N}`")
            }
            fn visit_u64<E: de::Error>(self, value: u64) -> Result<SubRays, E> {
                u32::try_from(value)
                    .map(SubRays::Count)
                    .map_err(|_| E::invalid_value(Unexpected::Unsigned(value), &self))
            }
            fn visit_i64<E: de::Error>(self, value: i64) -> Result<SubRays, E> {
                u32::try_from(value).map(SubRays::Count).map_err(|_| E::invalid_value(Unexpected::Signed(value), &self))
            }
            fn visit_str<E: de::Error>(self, value: &str) -> Result<SubRays, E> {
                if value == SubRays::ADAPTIVE {
                    return Ok(SubRays::Adaptive);
                }
                Err(E::invalid_value(Unexpected::Str(value), &self))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SubRays, A::Error> {
                let Some((key, most)) = map.next_entry::<String, u32>()? else {
                    return Err(de::Error::invalid_value(Unexpected::Map, &self));
                };
                if key != SubRays::ADAPTIVE {
                    return Err(de::Error::unknown_field(&key, &[SubRays::ADAPTIVE]));
                }
                match map.next_key::<String>()? {
                    None => Ok(SubRays::AdaptiveUpTo(most)),
                    Some(other) => Err(de::Error::unknown_field(&other, &[SubRays::ADAPTIVE])),
                }
            }
        }
        deserializer.deserialize_any(CountOrWord)
    }
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
