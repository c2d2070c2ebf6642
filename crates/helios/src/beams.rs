//! What a scanner does on a leg: pulses, lines and the turning of its head.

use crate::notes::NoteBook;
use crate::scanner::{HeliosChannel, HeliosOptics, HeliosScanner};
use crate::survey::HeliosLeg;
use ground::error::{Error, Result};

/// What one channel of a scanner does on a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LegBeams {
    /// Pulses per second.
    pub pulse_rate_hz: f64,
    /// Periods of the mirror per second.
    pub scan_rate_hz: f64,
    /// Half of the angle of a line, degrees.
    pub half_deg: f64,
    /// Angles between which pulses leave a rotating mirror, degrees.
    pub window_deg: [f64; 2],
    /// The head.
    pub head: HeadTurn,
    /// Divergence, if the leg has one of its own, rad.
    pub divergence_rad: Option<f64>,
}

/// How the head of a scanner turns on a leg: `rate` degrees per second from one angle to the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HeadTurn {
    pub rate_deg_s: f64,
    pub from_deg: f64,
    pub to_deg: f64,
}

impl HeadTurn {
    /// How long it turns, s; 0: it stands still.
    pub fn duration_s(self) -> f64 {
        if self.rate_deg_s == 0.0 { 0.0 } else { (self.to_deg - self.from_deg) / self.rate_deg_s }
    }
}

impl LegBeams {
    /// Those of `channel` on `leg`.
    ///
    /// # Errors
    /// A pulse rate or an angle that is missing; a head that turns away from where it shall stop.
    pub fn of(scanner: &HeliosScanner, channel: &HeliosChannel, leg: &HeliosLeg, notes: &NoteBook) -> Result<LegBeams> {
        let settings = &leg.scanner;
        let number = |name| settings.number(name);
        let wrong = |message: String| {
            Error::parse(notes.path(leg.place), format!("line {}", leg.place.line), format!("leg {message}"))
        };
        let note = |name: &str, how: String| {
            if let Some(place) = settings.place(name) {
                notes.approximated(place, name, how);
            }
        };
        let pulse_rate_hz = number("pulseFreq_hz").or(scanner.pulse_rates_hz.first().copied());
        let pulse_rate_hz =
            pulse_rate_hz.ok_or_else(|| wrong("has no pulseFreq_hz; allowed: one there or in its template".into()))?;
        if !scanner.pulse_rates_hz.is_empty() && !scanner.pulse_rates_hz.contains(&pulse_rate_hz) {
            note("pulseFreq_hz", "used as it is, though it is not in the scanner's list; HELIOS++ warns, too".into());
        }
        let half_deg = half_deg(channel, number("scanAngle_deg").unwrap_or(0.0), &note);
        let window_deg =
            window(channel, half_deg, [number("verticalAngleMin_deg"), number("verticalAngleMax_deg")], &note);
        if window_deg[0] >= window_deg[1] && channel.optics == HeliosOptics::Rotating {
            return Err(wrong(format!(
                "measures from {} to {} degrees; allowed: angles that rise",
                window_deg[0], window_deg[1]
            )));
        }
        let mut scan_rate_hz = number("scanFreq_hz").unwrap_or(0.0);
        let mut head_rate = number("headRotatePerSec_deg").unwrap_or(0.0);
        // fitToResolution in ScannerSettings.h (fd94d1f): steps along and across the lines instead of rates.
        let resolution = |name| number(name).filter(|step| *step > 0.0);
        if channel.optics == HeliosOptics::Rotating && channel.half_deg > 0.0 {
            if let Some(step) = resolution("verticalResolution_deg") {
                scan_rate_hz = pulse_rate_hz * step / (2.0 * channel.half_deg);
            }
            if let Some(step) = resolution("horizontalResolution_deg") {
                head_rate = step * scan_rate_hz;
            }
        }
        let [least, most] = channel.scan_rate_hz;
        if scan_rate_hz < least || (most > 0.0 && scan_rate_hz > most) {
            let how = format!("used as it is, though the scanner has {least} to {most} Hz; HELIOS++ refuses it");
            note("scanFreq_hz", how.clone());
            note("verticalResolution_deg", how);
        }
        if let HeliosOptics::Oscillating { product } = channel.optics
            && scan_rate_hz * half_deg > product
        {
            scan_rate_hz = product / half_deg;
            note("scanFreq_hz", format!("as in HELIOS++, at most {product} over the scan angle: {scan_rate_hz} Hz"));
        }
        if channel.optics == HeliosOptics::Conic {
            scan_rate_hz = most;
            note("scanFreq_hz", format!("as in HELIOS++, a cone turns {most} times a second, scanFreqMax_Hz"));
        }
        if head_rate.abs() > scanner.head_rate_max_deg_s {
            head_rate = head_rate.signum() * scanner.head_rate_max_deg_s;
            let how = format!(
                "as in HELIOS++, the head turns by at most headRotatePerSecMax_deg, {}",
                scanner.head_rate_max_deg_s
            );
            note("headRotatePerSec_deg", how.clone());
            note("horizontalResolution_deg", how);
        }
        let from_deg = number("headRotateStart_deg").unwrap_or(0.0);
        let to_deg = number("headRotateStop_deg").unwrap_or(0.0);
        let head = HeadTurn { rate_deg_s: head_rate, from_deg, to_deg };
        if head.duration_s() < 0.0 {
            return Err(wrong(format!(
                "turns its head by {head_rate} degrees a second from {from_deg} to {to_deg}; allowed: a stop that it turns to"
            )));
        }
        for (name, how) in [
            ("trajectoryTimeInterval_s", "the trajectory has the poses that it needs"),
            ("opticsWarmupPhase_s", "mirrors have their speed at once"),
        ] {
            note(name, how.into());
        }
        let divergence_rad = number("beamDivergence_rad").or(number("beamDivergenceRad"));
        Ok(LegBeams { pulse_rate_hz, scan_rate_hz, half_deg, window_deg, head, divergence_rad })
    }
}

/// Half of the angle of a line, degrees: no more than the scanner's, which it also is where none is asked for.
fn half_deg(channel: &HeliosChannel, asked: f64, note: &impl Fn(&str, String)) -> f64 {
    let most = channel.half_deg;
    if asked > most && most > 0.0 {
        note("scanAngle_deg", format!("the scanner has at most {most} degrees to each side, scanAngleMax_deg"));
    }
    if asked <= 0.0 || (asked > most && most > 0.0) { most } else { asked }
}

/// Angles between which pulses leave, degrees; PolygonMirrorBeamDeflector.cpp (fd94d1f).
fn window(channel: &HeliosChannel, half: f64, asked: [Option<f64>; 2], note: &impl Fn(&str, String)) -> [f64; 2] {
    if channel.optics != HeliosOptics::Rotating {
        return [-half, half];
    }
    let (most, sides) = (channel.half_deg, channel.effective_deg.min(half));
    let [from, to] = [asked[0].unwrap_or(-sides), asked[1].unwrap_or(sides)];
    let window = [from.clamp(-most, most), to.clamp(-most, most)];
    let how = if to - from > 2.0 * channel.effective_deg + 1e-9 {
        format!("wider than 2 x {} degrees, scanAngleEffectiveMax_deg, which HELIOS++ refuses", channel.effective_deg)
    } else if window != [from, to] {
        format!("the mirror sweeps from -{most} to {most} degrees, and pulses leave within")
    } else {
        return window;
    };
    note("verticalAngleMin_deg", how.clone());
    note("verticalAngleMax_deg", how);
    window
}
