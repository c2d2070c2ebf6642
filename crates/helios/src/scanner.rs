//! Scanners as HELIOS++ describes them.

use crate::notes::XmlPlace;
use crate::turning::{Fitting, fitting, offset};
use crate::xml::XmlElement;
use glam::DVec3;
use ground::error::Result;

/// A scanner, with one entry of `channels` for each of its beams.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosScanner {
    /// Its id.
    pub id: String,
    /// Its name; the id without one.
    pub name: String,
    /// Pulse rates that it has, Hz.
    pub pulse_rates_hz: Vec<f64>,
    /// Fastest rotation of its head, degrees per second.
    pub head_rate_max_deg_s: f64,
    /// Axis of that.
    pub head_axis: DVec3,
    /// Its beams.
    pub channels: Vec<HeliosChannel>,
    /// Visibility of the air that it is made for, m.
    pub visibility_m: Option<f64>,
}

/// A beam of a scanner.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosChannel {
    /// What deflects it.
    pub optics: HeliosOptics,
    /// Least and greatest frequency of that, Hz; the greatest is 0 without one.
    pub scan_rate_hz: [f64; 2],
    /// Half of the angle that the mirror sweeps, degrees.
    pub half_deg: f64,
    /// Half of the angle that is measured at most, degrees.
    pub effective_deg: f64,
    /// Where the beam leaves the head.
    pub origin: Fitting,
    /// Standard deviation of ranges, m.
    pub accuracy_m: f64,
    /// Nearest range, m.
    pub range_min_m: f64,
    /// Farthest range, m.
    pub range_max_m: Option<f64>,
    /// Divergence, rad.
    pub divergence_rad: f64,
    /// Length of a pulse, ns.
    pub pulse_ns: f64,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Most returns of a pulse; 0: any number.
    pub most_returns: u32,
    /// How it is sampled.
    pub sampling: HeliosSampling,
    pub(crate) place: XmlPlace,
}

/// What deflects a beam.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum HeliosOptics {
    /// A polygon.
    Rotating,
    /// A mirror that swings; angle times frequency is at most `product` degrees Hz.
    Oscillating {
        /// See there.
        product: f64,
    },
    /// A mirror whose beam stays on a cone.
    Conic,
    /// Glass fibres.
    Line {
        /// How many.
        fibres: u32,
    },
    /// Wedge prisms, which the beam enters in the direction `incident`.
    Risley {
        /// The prisms.
        prisms: Vec<HeliosPrism>,
        /// Direction, y ahead.
        incident: DVec3,
    },
}

/// A wedge prism.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct HeliosPrism {
    /// Angle between its faces, degrees; the first face is the tilted one if it is positive.
    pub wedge_deg: f64,
    /// Index of refraction, relative to air.
    pub index: f64,
    /// Turns per second.
    pub turns_hz: f64,
}

/// How beams are sampled, and their echoes separated.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct HeliosSampling {
    /// Rings of rays in a beam, the one in the middle included.
    pub quality: u32,
    /// Echoes in such a window are one, ns; none: a quarter of the pulse.
    pub window_ns: Option<f64>,
}

impl HeliosSampling {
    /// Those of the element `FWFSettings` in `parent`, which replace those of `self`.
    pub(crate) fn replaced(self, parent: XmlElement) -> Result<HeliosSampling> {
        let Some(element) = parent.child("FWFSettings") else { return Ok(self) };
        for key in ["binSize_ns", "maxFullwaveRange_ns"] {
            if element.number(key)?.is_some() {
                let how = "waveforms are not cut into bins: echoes are found exactly";
                element.notes().approximated(element.place(), key, how);
            }
        }
        Ok(HeliosSampling {
            quality: element.count("beamSampleQuality", 1, 100)?.unwrap_or(self.quality),
            window_ns: element.number_within("winSize_ns", 0.0, 1e6)?.or(self.window_ns),
        })
    }
}

/// Attributes of energy, which set what HELIOS++ calls intensity.
const ENERGY: [&str; 5] =
    ["averagePower_w", "beamQualityFactor", "opticalEfficiency", "receiverDiameter_m", "receivedEnergyMin_W"];

/// An attribute of a channel, or else of its scanner.
#[derive(Clone, Copy)]
struct ChannelKeys<'d> {
    own: XmlElement<'d>,
    shared: XmlElement<'d>,
}

impl<'d> ChannelKeys<'d> {
    fn number(self, key: &str, [low, high]: [f64; 2]) -> Result<Option<f64>> {
        // Both are read, so that both are checked and noted.
        let shared = self.shared.number_within(key, low, high)?;
        Ok(self.own.number_within(key, low, high)?.or(shared))
    }

    fn text(self, key: &str) -> Option<&'d str> {
        let shared = self.shared.text(key);
        self.own.text(key).or(shared)
    }
}

impl HeliosScanner {
    /// Reads the element `scanner`.
    pub(crate) fn read(element: XmlElement) -> Result<HeliosScanner> {
        let id = element.required("id")?.to_owned();
        let name = element.text("name").unwrap_or(&id).to_owned();
        let mut pulse_rates_hz = Vec::new();
        for rate in element.text("pulseFreqs_Hz").unwrap_or_default().split(',').filter(|rate| !rate.trim().is_empty())
        {
            let rate = rate.trim().parse().ok().filter(|rate: &f64| (1.0..=1e9).contains(rate));
            pulse_rates_hz
                .push(rate.ok_or_else(|| element.wrong("pulseFreqs_Hz", "numbers from 1 to 1e9, with commas"))?);
        }
        let axis = element.child("headRotateAxis").map(offset).transpose()?.filter(|axis| axis.length() > 0.1);
        let own: Vec<XmlElement> =
            element.child("channels").into_iter().flat_map(|all| all.children("channel")).collect();
        let channels = if own.is_empty() { vec![element] } else { own };
        let channels =
            channels.into_iter().map(|own| channel(ChannelKeys { own, shared: element })).collect::<Result<_>>()?;
        let visibility_km = element.number_within("atmosphericVisibility_km", 1e-3, 1e6)?;
        for key in ENERGY {
            if element.number(key)?.is_some() {
                let how = "every echo is detected, and intensities are relative to a white surface";
                element.notes().approximated(element.place(), key, how);
            }
        }
        for error in ["rangeError", "deflectionError", "headError"] {
            if let Some(error) = element.child(error) {
                error.not_understood("errors as formulas are not read: there are none");
            }
        }
        Ok(HeliosScanner {
            id,
            name,
            pulse_rates_hz,
            head_rate_max_deg_s: element.number_within("headRotatePerSecMax_deg", 0.0, 1e6)?.unwrap_or(0.0),
            head_axis: axis.unwrap_or(DVec3::Z).normalize(),
            channels,
            visibility_m: visibility_km.map(|km| km * 1000.0),
        })
    }
}

/// Reads a channel. Defaults are those of XmlAssetsLoader.cpp (3dgeo-heidelberg/helios fd94d1f).
fn channel(keys: ChannelKeys) -> Result<HeliosChannel> {
    const POSITIVE: [f64; 2] = [0.0, 1e9];
    const HALF_TURN: [f64; 2] = [0.0, 360.0];
    let ChannelKeys { own, shared } = keys;
    let number = |key, bounds| keys.number(key, bounds);
    // That of the scanner has no effect where the channel has its own, but it is read all the same, so that it is checked.
    let shared_origin = shared.child("beamOrigin");
    fitting(shared_origin)?;
    let origin = own.child("beamOrigin").or(shared_origin);
    if own.place() != shared.place() {
        own.text("id");
    }
    Ok(HeliosChannel {
        optics: optics(keys)?,
        scan_rate_hz: [
            number("scanFreqMin_Hz", POSITIVE)?.unwrap_or(0.0),
            number("scanFreqMax_Hz", POSITIVE)?.unwrap_or(0.0),
        ],
        half_deg: number("scanAngleMax_deg", HALF_TURN)?.unwrap_or(0.0),
        effective_deg: number("scanAngleEffectiveMax_deg", HALF_TURN)?.unwrap_or(0.0),
        origin: fitting(origin)?,
        accuracy_m: number("accuracy_m", [0.0, 1000.0])?.unwrap_or(0.0),
        range_min_m: number("rangeMin_m", POSITIVE)?.unwrap_or(0.0),
        range_max_m: number("rangeMax_m", POSITIVE)?,
        divergence_rad: number("beamDivergence_rad", [0.0, 1.0])?.unwrap_or(0.0003),
        pulse_ns: number("pulseLength_ns", [1e-3, 1e6])?.unwrap_or(4.0),
        wavelength_nm: number("wavelength_nm", [200.0, 20_000.0])?.unwrap_or(1064.0),
        most_returns: number("maxNOR", [0.0, 1e6])?.unwrap_or(0.0) as u32,
        sampling: HeliosSampling { quality: 3, window_ns: None }.replaced(shared)?.replaced(own)?,
        place: own.place(),
    })
}

fn optics(keys: ChannelKeys) -> Result<HeliosOptics> {
    let Some(word) = keys.text("optics") else { return Err(keys.shared.error("has no attribute optics")) };
    Ok(match word {
        "rotating" => HeliosOptics::Rotating,
        "oscillating" => {
            HeliosOptics::Oscillating { product: keys.number("scanProduct", [1e-3, 1e12])?.unwrap_or(1e6) }
        }
        "conic" => HeliosOptics::Conic,
        "line" => HeliosOptics::Line { fibres: keys.number("numFibers", [1.0, 65_536.0])?.unwrap_or(1.0) as u32 },
        "risley" => {
            let air = keys.number("refrIndex_air", [1.0, 4.0])?.unwrap_or(1.0);
            let mut prisms = Vec::new();
            for number in 1..=3 {
                let wedge_deg = keys.number(&format!("angle{number}_deg"), [-60.0, 60.0])?.unwrap_or(0.0);
                let index = keys.number(&format!("refrIndex{number}"), [1.0, 4.0])?.unwrap_or(1.0) / air;
                let turns_hz = keys.number(&format!("rotorFreq{number}_Hz"), [-1e4, 1e4])?.unwrap_or(0.0);
                // As there: what is that thin is no prism.
                if wedge_deg.abs() > 1e-6 {
                    prisms.push(HeliosPrism { wedge_deg, index, turns_hz });
                }
            }
            if prisms.is_empty() {
                return Err(keys.shared.error("has optics of prisms, but none; allowed: angle1_deg and so on"));
            }
            let incident = keys.own.child("incidentBeam").map(offset).transpose()?.unwrap_or(DVec3::Y);
            let incident = incident.try_normalize().unwrap_or(DVec3::Y);
            HeliosOptics::Risley { prisms, incident }
        }
        _ => {
            let element = if keys.own.text("optics").is_some() { keys.own } else { keys.shared };
            return Err(element.wrong("optics", "rotating, oscillating, conic, line or risley"));
        }
    })
}
