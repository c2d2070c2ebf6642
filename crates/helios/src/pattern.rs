//! The beams of a channel on a leg as a pattern of a sensor file, and how the sensor is mounted for it.

use crate::beams::LegBeams;
use crate::scanner::{HeliosChannel, HeliosOptics, HeliosPrism};
use crate::turning::in_our_axes;
use glam::{DMat3, DQuat, DVec3};
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;

/// What turns the beams besides the mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum HeadPlan {
    /// Nothing: the head always looks this way, degrees.
    Fixed(f64),
    /// The pattern, whose key is `head`.
    OfPattern,
    /// The pattern, which is that of a spinning sensor, as its mirror stands still.
    Spinning,
    /// The trajectory: every other head.
    OfTrajectory,
}

/// Channels that are one sensor: all have one pattern and one place.
#[derive(Clone, Debug)]
pub(crate) struct ChannelGroup<'s> {
    pub channels: Vec<&'s HeliosChannel>,
}

/// `channels` as sensors: emitters of a spinning one, and beams through the same prisms, are lines of one sensor.
pub(crate) fn groups(channels: &[HeliosChannel], plan: HeadPlan) -> Vec<ChannelGroup<'_>> {
    let alike = |a: &HeliosChannel, b: &HeliosChannel| {
        let rest = a.divergence_rad == b.divergence_rad
            && a.wavelength_nm == b.wavelength_nm
            && (a.accuracy_m, a.range_min_m, a.range_max_m) == (b.accuracy_m, b.range_min_m, b.range_max_m)
            && (a.pulse_ns, a.most_returns, &a.sampling) == (b.pulse_ns, b.most_returns, &b.sampling);
        let prisms = match (&a.optics, &b.optics) {
            (HeliosOptics::Risley { prisms: of_a, .. }, HeliosOptics::Risley { prisms: of_b, .. }) => of_a == of_b,
            _ => false,
        };
        let offset = a.origin.offset == b.origin.offset;
        rest && offset && (plan == HeadPlan::Spinning || (prisms && a.origin == b.origin))
    };
    let mut groups: Vec<ChannelGroup> = Vec::new();
    for channel in channels {
        match groups.iter_mut().find(|group| alike(group.channels[0], channel)) {
            Some(group) => group.channels.push(channel),
            None => groups.push(ChannelGroup { channels: vec![channel] }),
        }
    }
    groups
}

/// Angle by which a rotation about the axis to the right raises a beam, degrees; none: it is another rotation.
pub(crate) fn raised_deg(rotation: DQuat) -> Option<f64> {
    let keeps_right = (rotation * DVec3::X).distance(DVec3::X) < 1e-9;
    let ahead = rotation * DVec3::Y;
    keeps_right.then(|| ahead.z.atan2(ahead.y).to_degrees())
}

/// The pattern of one sensor.
pub(crate) struct SensorPattern {
    /// Its keys in a sensor file.
    pub value: Value,
    /// Orientation of the sensor on its carrier, both with our axes.
    pub mount: DQuat,
}

impl SensorPattern {
    /// That of `group` for a scanner mounted with the rotation `mount`, axes of HELIOS++, on a leg that begins at
    /// `start`, s.
    pub fn of(group: &ChannelGroup, mount: DQuat, plan: HeadPlan, beams: &LegBeams, start: f64) -> SensorPattern {
        let channel = group.channels[0];
        let emitter = channel.origin.rotation;
        match plan {
            HeadPlan::Spinning => SensorPattern { value: spinning(group, beams), mount: in_our_axes(mount) },
            HeadPlan::OfPattern => {
                let mut value = lines(channel, beams, raised_deg(emitter).unwrap_or(0.0));
                value["plane"] = "upright".into();
                value["head"] = head(beams, start);
                SensorPattern { value, mount: in_our_axes(mount) }
            }
            HeadPlan::Fixed(_) | HeadPlan::OfTrajectory => {
                let turned = in_our_axes(mount * emitter);
                if let HeliosOptics::Risley { prisms, .. } = &channel.optics {
                    let (value, roll) = risley(group, prisms, beams);
                    return SensorPattern { value, mount: (turned * roll).normalize() };
                }
                let mut value = lines(channel, beams, 0.0);
                let across = (turned * across_from_upright().conjugate()).normalize();
                // Whichever needs the smaller turn is what people would have written.
                let (plane, mount) =
                    if turn(across) <= turn(turned) + 1e-9 { ("across", across) } else { ("upright", turned) };
                value["plane"] = plane.into();
                SensorPattern { value, mount }
            }
        }
    }
}

/// An angle without the rounding errors of its last digits, degrees.
fn tidy(angle: f64) -> f64 {
    (angle * 1e9).round() / 1e9 + 0.0
}

fn turn(rotation: DQuat) -> f64 {
    2.0 * rotation.w.abs().min(1.0).acos()
}

/// Directions of lines across the flight, from straight down to the left, from those of upright lines, from ahead upwards.
fn across_from_upright() -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y)).normalize()
}

/// A pattern of lines; rotating mirrors are turned up by `raised` degrees.
fn lines(channel: &HeliosChannel, beams: &LegBeams, raised: f64) -> Value {
    let LegBeams { pulse_rate_hz, scan_rate_hz, half_deg, window_deg: [from, to], .. } = *beams;
    let mut pulses = pulse_rate_hz;
    let (lines_hz, mechanism) = match &channel.optics {
        // One beam that stands still.
        _ if scan_rate_hz == 0.0 && !matches!(channel.optics, HeliosOptics::Line { .. }) => {
            (pulse_rate_hz, json!({"type": "fibre", "half_deg": 0.001, "fibres": 1}))
        }
        HeliosOptics::Rotating => {
            let sweep = 2.0 * channel.half_deg;
            let turns = (sweep / 360.0).max(1.0);
            // Of a mirror that turns more than once a line, either every turn is a line, or pulses leave in one of them.
            let whole = to - from >= 360.0;
            let window = if whole { [-180.0, 180.0] } else { [from, to] };
            let lines_hz = if whole { scan_rate_hz * turns } else { scan_rate_hz };
            pulses = if whole { pulse_rate_hz } else { pulse_rate_hz / turns };
            let window = window.map(|angle| tidy(angle + raised));
            (lines_hz, json!({"type": "rotating", "window_deg": window, "sweep_deg": sweep.min(360.0)}))
        }
        // The frequency counts periods, of two lines each. Turns take cfg_device_turningPulses, 100 pulses, half of them
        // at each end: OscillatingMirrorBeamDeflector.h (3dgeo-heidelberg/helios fd94d1f).
        HeliosOptics::Oscillating { .. } => {
            let lines_hz = 2.0 * scan_rate_hz;
            let turn = (50.0 * lines_hz / pulse_rate_hz).min(0.4);
            (lines_hz, json!({"type": "oscillating", "half_deg": half_deg.min(89.0), "law": "triangle", "turn": turn}))
        }
        HeliosOptics::Line { fibres } => (
            pulse_rate_hz / f64::from(*fibres),
            json!({"type": "fibre", "half_deg": half_deg.min(89.0), "fibres": fibres}),
        ),
        HeliosOptics::Conic | HeliosOptics::Risley { .. } => {
            (scan_rate_hz, json!({"type": "cone", "half_deg": half_deg.min(89.0)}))
        }
    };
    json!({"type": "line_scan", "pulse_rate_hz": pulses, "lines_hz": lines_hz, "plane": "across", "mechanism": mechanism})
}

/// The key `head` for a leg that begins at `start`, s: the pattern counts time from 0.
fn head(beams: &LegBeams, start: f64) -> Value {
    let head = beams.head;
    let range = head.to_deg - head.from_deg;
    // A range that begins with the leg is written as people write it.
    let turn = head.duration_s();
    let begins = turn > 0.0 && ((start / turn) - (start / turn).round()).abs() < 1e-6;
    let (from, range) = if begins && range <= 360.0 {
        (head.from_deg, range)
    } else {
        (head.from_deg - (head.rate_deg_s * start).rem_euclid(360.0), 360.0)
    };
    let from = if (-720.0..=360.0).contains(&from) { from } else { from.rem_euclid(360.0) };
    json!({"rate_deg_s": head.rate_deg_s, "from_deg": tidy(from), "to_deg": tidy(from + range)})
}

/// A sensor whose emitters turn about the upright axis.
fn spinning(group: &ChannelGroup, beams: &LegBeams) -> Value {
    let rate = beams.head.rate_deg_s;
    let ahead: Vec<DVec3> = group.channels.iter().map(|channel| channel.origin.rotation * DVec3::Y).collect();
    let elevation: Vec<f64> = ahead.iter().map(|beam| tidy(beam.z.clamp(-1.0, 1.0).asin().to_degrees())).collect();
    let azimuth: Vec<f64> = ahead.iter().map(|beam| tidy((-beam.x).atan2(beam.y).to_degrees())).collect();
    let half_turn = 180.0 * rate.signum();
    let centre = (beams.head.from_deg + half_turn + 180.0).rem_euclid(360.0) - 180.0;
    let mut channels = json!({"elevation_deg": elevation});
    if azimuth.iter().any(|offset| *offset != 0.0) {
        channels["azimuth_offset_deg"] = azimuth.into();
    }
    json!({
        "type": "spinning",
        "azimuth": {
            "fov_deg": 360, "rate_hz": rate.abs() / 360.0, "direction": if rate < 0.0 { "cw" } else { "ccw" },
            "centre_deg": centre,
        },
        "cycle_us": 1e6 / beams.pulse_rate_hz,
        "channels": channels,
    })
}

/// A pattern of prisms, and the roll of the sensor with which its lines are side by side.
///
/// There, the normal of the tilted face looks up at time 0 and turns from up to right (RisleyBeamDeflector.h, fd94d1f);
/// here its phase counts from the left upwards.
fn risley(group: &ChannelGroup, prisms: &[HeliosPrism], beams: &LegBeams) -> (Value, DQuat) {
    let incident = group.channels.iter().map(|channel| match channel.optics {
        HeliosOptics::Risley { incident, .. } => incident,
        _ => DVec3::Y,
    });
    let incident: Vec<DVec3> = incident.collect();
    let widest = |axis: fn(&DVec3) -> f64| incident.iter().map(|beam| axis(beam).abs()).fold(0.0, f64::max);
    let sideways = widest(|beam| beam.x) > widest(|beam| beam.z);
    let elevation: Vec<f64> = incident
        .iter()
        .map(|beam| {
            let aside = if sideways { -beam.x } else { beam.z };
            tidy(aside.atan2(beam.y).to_degrees())
        })
        .collect();
    let mut list = Vec::new();
    for prism in prisms {
        let tilted_first = prism.wedge_deg > 0.0;
        let phase = if tilted_first { -90.0 } else { 90.0 } + if sideways { 90.0 } else { 0.0 };
        list.push(json!({
            "wedge_deg": prism.wedge_deg.abs(), "ior": prism.index, "rpm": 60.0 * prism.turns_hz, "phase_deg": phase,
            "first_face": if tilted_first { "tilted" } else { "flat" },
        }));
    }
    let mut value = json!({"type": "risley", "pulse_rate_hz": beams.pulse_rate_hz, "prisms": list});
    if elevation.len() > 1 || elevation[0] != 0.0 {
        value["line_elevation_deg"] = elevation.into();
    }
    let roll = if sideways { DQuat::from_rotation_x(-FRAC_PI_2) } else { DQuat::IDENTITY };
    (value, roll)
}
