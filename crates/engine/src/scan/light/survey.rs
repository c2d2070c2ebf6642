//! What laser scanners report of each echo: where in its line it is, how strong and how wide.

use super::block::Block;
use super::plan::{RADIOMETRY, SHAPE, ScanPlan};
use cloud::{Columns, Slices};
use glam::Vec3;
use ground::lanes::LANES;

/// Lines that [`Block::put_survey`] tells apart, until [`mark_edges`] has seen them.
const LINES: u32 = 255;

impl Block {
    /// Step 11 for surveys: the requested columns, row by row.
    #[inline(never)]
    pub fn put_survey(&mut self, scan: &ScanPlan, count: usize, rows: &mut Slices) {
        let beams = scan.aim.beams;
        let Block { lanes, rays, reported, hits, kept, shown, widened, deviation, .. } = self;
        let surface = &hits.surface;
        let reported = reported.as_deref().filter(|_| scan.points_elsewhere()).unwrap_or(rays);
        if !rows.scan_angle.is_empty() {
            let mut angle = [0.0; LANES];
            let left = LeftOfHeading::of(scan, &lanes.beam[..count]);
            for lane in 0..count {
                angle[lane] = scan_angle(reported.direction(lane), left.at(scan, lanes.beam[lane]));
            }
            kept.put_beam(&angle, rows.scan_angle);
        }
        if !rows.scan_direction.is_empty() {
            let mut direction = [0; LANES];
            for lane in (0..count).filter(|_| scan.aim.has_lines) {
                direction[lane] = u8::from(sweeps_right(scan, lanes.beam[lane] as usize));
            }
            kept.put_beam(&direction, rows.scan_direction);
        }
        if !rows.edge_of_line.is_empty() {
            let line = |beam: u32| if scan.aim.has_lines { 1 + (beam / beams.columns) % LINES } else { 0 };
            kept.put(surface, &lanes.beam.map(|beam| line(beam) as u8), rows.edge_of_line);
        }
        if !rows.strip.is_empty() {
            kept.put_beam(&[scan.options.strip; LANES], rows.strip);
        }
        if rows.has(&RADIOMETRY) {
            let [mut reflectance, mut amplitude] = [[f32::NAN; LANES]; 2];
            for lane in 0..count {
                let range = hits.range[lane];
                reflectance[lane] = decibel(shown[lane] / scan.shown_of(lanes.beam[lane]));
                if let Some(least) = scan.receiver.gate.threshold.least(range) {
                    amplitude[lane] = decibel(shown[lane] / least);
                }
            }
            kept.put(surface, &reflectance, rows.reflectance_db);
            kept.put(surface, &amplitude, rows.amplitude_db);
        }
        if rows.has(&SHAPE) {
            kept.put(surface, &widened.map(|times| times * scan.measure.pulse_s), rows.pulse_width);
            kept.put(surface, deviation, rows.deviation);
        }
    }
}

/// Horizontal vectors to the left of the heading while the beams of a block fire.
enum LeftOfHeading {
    /// From the first beam to the last, s, in between linear in time.
    Between { times: [f64; 2], left: [Vec3; 2] },
    /// Beam by beam.
    Each,
}

/// While beams fire within this time, s, the heading is taken to be linear: an aircraft that starts to turn by 20 degrees per
/// second is off by less than the step of angles in LAS.
const SHORT: f64 = 1e-3;

impl LeftOfHeading {
    fn of(scan: &ScanPlan, beams: &[u32]) -> LeftOfHeading {
        let (Some(&first), Some(&last)) = (beams.first(), beams.last()) else { return LeftOfHeading::Each };
        let times = [first, last].map(|beam| scan.aim.beams.time[beam as usize]);
        if !scan.aim.pose.moves() || (times[1] - times[0]).abs() < SHORT {
            let left = [first, last].map(|beam| left_of_heading(scan, beam));
            LeftOfHeading::Between { times, left }
        } else {
            LeftOfHeading::Each
        }
    }

    fn at(&self, scan: &ScanPlan, beam: u32) -> Vec3 {
        match self {
            LeftOfHeading::Between { times: [from, to], left } => {
                let part = (scan.aim.beams.time[beam as usize] - from) / (to - from).max(f64::MIN_POSITIVE);
                left[0].lerp(left[1], part.clamp(0.0, 1.0) as f32)
            }
            LeftOfHeading::Each => left_of_heading(scan, beam),
        }
    }
}

/// The horizontal vector to the left of the heading when a beam fires.
fn left_of_heading(scan: &ScanPlan, beam: u32) -> Vec3 {
    let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, beam as usize);
    let ahead = rotation.x_axis;
    // The heading of a sensor that points straight up or down is that of its side.
    let left = Vec3::new(-ahead.y, ahead.x, 0.0);
    let left = if left.length_squared() > 1e-6 { left } else { rotation.y_axis.with_z(0.0) };
    left.normalize_or_zero()
}

/// Angle of a direction from straight down to the right of the heading, rad, in the plane across that (ASPRS LAS
/// Specification 1.4 R15, 2.6: negative left, roll included). `left`: a horizontal unit vector to the left of the heading.
fn scan_angle(direction: Vec3, left: Vec3) -> f32 {
    // The negative zero of the left side of nadir is zero.
    0.0 + (-direction.dot(left)).atan2(-direction.z)
}

/// Whether the mechanism sweeps to the right at a beam: from this pulse of its line to the next, or to the last one from
/// that before.
fn sweeps_right(scan: &ScanPlan, beam: usize) -> bool {
    let beams = scan.aim.beams;
    let columns = beams.columns as usize;
    let last = beam % columns + 1 == columns;
    let first = if last { beam.saturating_sub(1) } else { beam };
    let angle = |beam: usize| {
        let direction = beams.direction(beam.min(beams.len() - 1));
        (-direction.y).atan2(-direction.z)
    };
    let step = angle(first + 1) - angle(first);
    // The shorter way round.
    (step > 0.0) == (step.abs() < std::f32::consts::PI) && step != 0.0
}

fn decibel(ratio: f32) -> f32 {
    10.0 * ratio.log10()
}

/// Marks the last point of each line among the rows of a scan, in which [`Block::put_survey`] has put the number of the
/// line, with 1, and all others with 0.
pub(super) fn mark_edges(columns: &mut Columns) {
    let mut next = 0;
    for row in columns.edge_of_line.iter_mut().rev().filter(|row| **row != 0) {
        let line = *row;
        *row = u8::from(line != next);
        next = line;
    }
}
