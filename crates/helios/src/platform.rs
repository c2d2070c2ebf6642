//! Platforms as HELIOS++ describes them.

use crate::turning::{Fitting, fitting};
use crate::xml::XmlElement;
use ground::error::Result;

/// What carries a scanner.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosPlatform {
    /// How it moves.
    pub movement: HeliosMovement,
    /// Where the scanner is mounted.
    pub mount: Fitting,
}

/// How a platform moves.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum HeliosMovement {
    /// It stands at the point of each leg.
    Static,
    /// Evenly from point to point.
    LinearPath,
    /// On the ground.
    GroundVehicle,
    /// Driven by rotors.
    Multicopter(HeliosRotors),
    /// Along the rows of files.
    Interpolated,
}

/// What makes a multicopter fast.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct HeliosRotors {
    /// Force over speed; speeds are forces divided by it.
    pub drag: f64,
    /// Greatest force.
    pub force_max: f64,
    /// Growth of the speed, 1/s.
    pub speedup: f64,
    /// Decay of the speed before a point, 1/s.
    pub slowdown: f64,
    /// Rate at which it turns, degrees per second.
    pub yaw_rate_deg_s: f64,
}

const NOISES: [&str; 6] =
    ["positionXNoise", "positionYNoise", "positionZNoise", "attitudeXNoise", "attitudeYNoise", "attitudeZNoise"];

/// Notes that noise of the trajectory, below `element`, has no effect.
pub(crate) fn note_noise(element: XmlElement) {
    for noise in NOISES.into_iter().filter_map(|name| element.child(name)) {
        let why = "white noise of the trajectory is not simulated; errors of trajectories are a key of scenarios";
        noise.not_understood(why);
    }
}

impl HeliosPlatform {
    /// Reads the element `platform`. Defaults are those of XmlAssetsLoader.cpp (3dgeo-heidelberg/helios fd94d1f).
    pub(crate) fn read(element: XmlElement) -> Result<HeliosPlatform> {
        element.text("id");
        element.text("name");
        note_noise(element);
        let movement = match element.text("type").unwrap_or_default().to_ascii_lowercase().as_str() {
            "linearpath" => HeliosMovement::LinearPath,
            "groundvehicle" => {
                if element.number("drag")?.is_some() {
                    let how = "vehicles reach their speed at once";
                    element.notes().approximated(element.place(), "drag", how);
                }
                HeliosMovement::GroundVehicle
            }
            "multicopter" => HeliosMovement::Multicopter(rotors(element)?),
            "static" | "" => HeliosMovement::Static,
            _ => return Err(element.wrong("type", "static, linearpath, groundvehicle or multicopter")),
        };
        Ok(HeliosPlatform { movement, mount: fitting(element.child("scannerMount"))? })
    }
}

fn rotors(element: XmlElement) -> Result<HeliosRotors> {
    // The beam is turned by the yaw alone: getDirectionalAttitude of HelicopterPlatform.h (fd94d1f).
    for key in ["base_pitch_deg", "pitch_speed_deg", "roll_speed_deg", "pitch_offset_deg", "roll_offset_deg"] {
        if element.number(key)?.is_some() {
            let how =
                "as in HELIOS++, pitch and roll of a multicopter do not turn its scanner; the trajectory has none";
            element.notes().approximated(element.place(), key, how);
        }
    }
    if element.number("slowdown_distance")?.is_some() {
        let how = "the distance follows from speed and slowdown_magnitude, as HELIOS++ computes it";
        element.notes().approximated(element.place(), "slowdown_distance", how);
    }
    let above_zero = |key, default| Ok(element.number_within(key, 1e-6, 1e6)?.unwrap_or(default));
    Ok(HeliosRotors {
        drag: above_zero("drag", 1.0)?,
        force_max: above_zero("engine_max_force", 0.1)?,
        speedup: above_zero("speedup_magnitude", 2.0)?,
        slowdown: above_zero("slowdown_magnitude", 2.0)?,
        yaw_rate_deg_s: above_zero("yaw_speed_deg", 85.94)?,
    })
}
