//! The line that a scanner with a single ring draws around itself.

use emitter::{BeamTable, FiringOrder};
use std::f64::consts::{PI, TAU};

/// Beams in the plane z = 0 of the sensor, evenly spaced: what a `sensor_msgs/LaserScan` describes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ScanLine {
    /// Number of beams of a scan.
    pub beams: u32,
    /// Azimuth of the first, rad, counter-clockwise from x.
    pub start: f64,
    /// Angle from one to the next, rad; negative: clockwise.
    pub step: f64,
    /// When the first fires, s since the start of the scan.
    pub first_time: f64,
    /// Time from one to the next, s.
    pub beam_time: f64,
    /// Time from scan to scan, s.
    pub period: f64,
    /// Nearest and farthest range that is reported, m; the farthest may be infinite.
    pub range_m: [f64; 2],
    /// Most returns of a beam.
    pub returns: u8,
}

impl ScanLine {
    /// The line of the `beams` of a sensor that reports ranges of `range_m`, m, and up to `returns` for each beam; `None`:
    /// they are no such line.
    pub fn of(beams: &BeamTable, range_m: [f64; 2], returns: u8) -> Option<ScanLine> {
        /// Tolerated deviation from the plane, as f32 is rounded.
        const FLAT: f32 = 1e-5;
        /// Tolerated deviation from even steps, relative to one.
        const UNEVEN: f64 = 0.05;
        let count = beams.dir_x.len();
        let apart = beams.origin.iter().any(|origin| !origin.is_empty());
        let is_flat = || beams.dir_z.iter().all(|z| z.abs() < FLAT);
        if count < 2 || beams.firing_order == FiringOrder::Frame || apart || !is_flat() {
            return None;
        }
        let azimuth = |beam: usize| f64::from(beams.dir_y[beam]).atan2(beams.dir_x[beam].into());
        let turned = |from: f64, to: f64| (to - from + PI).rem_euclid(TAU) - PI;
        let start = azimuth(0);
        let (mut end, mut before) = (start, start);
        for beam in 1..count {
            let here = azimuth(beam);
            end += turned(before, here);
            before = here;
        }
        let step = (end - start) / (count - 1) as f64;
        // A second turn would meet the same angles again.
        if step == 0.0 || step.abs() * (count - 1) as f64 >= TAU {
            return None;
        }
        let off = |beam: usize| turned(start + beam as f64 * step, azimuth(beam)).abs();
        if (0..count).any(|beam| off(beam) > UNEVEN * step.abs()) {
            return None;
        }
        let [first_time, last_time] = [beams.time[0], beams.time[count - 1]];
        Some(ScanLine {
            beams: u32::try_from(count).ok()?,
            start,
            step,
            first_time,
            beam_time: (last_time - first_time) / (count - 1) as f64,
            period: beams.period,
            range_m,
            returns,
        })
    }

    /// The beam nearest to an azimuth, rad.
    pub(crate) fn nearest(&self, azimuth: f64) -> u32 {
        let (turn, middle) = (TAU / self.step.abs(), 0.5 * f64::from(self.beams - 1));
        let off = (azimuth - self.start) / self.step - middle;
        let beam = (off - turn * (off / turn).round() + middle).round();
        // The cast saturates and turns NaN into 0.
        (beam as u32).min(self.beams - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_sensor::TestSensor;

    fn line_of(pattern: &str) -> Option<ScanLine> {
        ScanLine::of(TestSensor::new(pattern).beams(), [0.1, 30.0], 1)
    }

    #[test]
    fn a_single_ring_is_a_line() {
        let line = line_of(
            "{type: spinning, azimuth: {fov_deg: 270, step_deg: 0.25, rate_hz: 40, direction: ccw}, channels: {elevation_deg: [0]}}",
        )
        .unwrap();
        let [start, step] = [line.start, line.step].map(f64::to_degrees);
        assert_eq!(line.beams, 1081);
        assert!((start + 135.0).abs() < 1e-4 && (step - 0.25).abs() < 1e-7, "{line:?}");
        assert!((line.period - 0.025).abs() < 1e-12 && line.beam_time > 0.0);
        for beam in [0, 1, 539, 1080] {
            let angle = line.start + f64::from(beam) * line.step;
            for off in [-0.4, 0.0, 0.4] {
                assert_eq!(line.nearest(angle + off * line.step + TAU), beam);
            }
        }
        let turn = line_of(
            "{type: spinning, azimuth: {fov_deg: 360, step_deg: 1, rate_hz: 10, direction: cw}, channels: {elevation_deg: [0]}}",
        )
        .unwrap();
        assert!(turn.step < 0.0 && turn.beams == 360, "{turn:?}");
        assert_eq!(turn.nearest(turn.start - turn.step), 359);
    }

    #[test]
    fn what_looks_up_or_has_more_rings_is_none() {
        for channels in ["[0, 1]", "[3]", "[0, 0]"] {
            let pattern = format!(
                "{{type: spinning, azimuth: {{fov_deg: 90, step_deg: 1, rate_hz: 10}}, channels: {{elevation_deg: {channels}}}}}"
            );
            assert_eq!(line_of(&pattern), None, "{channels}");
        }
        assert_eq!(line_of("{type: pinhole, resolution: [80, 1], fov_deg: [90, 1]}"), None);
    }
}
