//! `sensor_msgs/LaserScan` and `MultiEchoLaserScan`: the ranges of a scanner with a single ring, beam by beam.
//!
//! Special values are those of ROS enhancement proposal 117 ("Informational Distance Measurements"): +inf where a beam has no
//! return.

use super::ScanMessage;
use super::cdr::{CdrWriter, Stamp};
use crate::{PointCloud, ScanLine};
use glam::Vec3;
use ground::error::{Error, Result};
use std::io;

/// A return of a beam.
struct LineReturn {
    beam: u32,
    /// Which of the beam, from 1; 0: unknown.
    number: u8,
    /// m.
    range: f32,
    intensity: f32,
}

/// A scan, beam by beam.
pub(super) struct LaserMessage {
    line: ScanLine,
    /// By beam and number.
    returns: Vec<LineReturn>,
    has_intensity: bool,
    /// When the first beam fires.
    pub stamp: Stamp,
}

impl LaserMessage {
    /// # Errors
    /// A cloud that is not of a scanner with a single ring; several frames; a beam that the scanner does not have.
    pub fn of(cloud: &PointCloud) -> Result<LaserMessage> {
        let Some(line) = cloud.scan_line else {
            let allowed = "clouds of a LiDAR with a single ring, whose beams lie in one plane";
            return Err(Error::invalid("the cloud", "of another sensor", allowed));
        };
        let c = &cloud.columns;
        let to_sensor = cloud.to_frame(&cloud.sensor_pose);
        let place = |row: usize| Vec3::from(to_sensor([c.x[row], c.y[row], c.z[row]]));
        let placed = [&c.x, &c.y, &c.z].into_iter().all(|axis| axis.len() == cloud.len);
        if c.range.is_empty() && !placed {
            return Err(Error::invalid("the cloud", "without range", "clouds with range, or with x, y and z"));
        }
        let width = cloud.organised.map(|[_, columns]| columns as usize).filter(|&width| width > 0);
        let beam_of = |row: usize| match (c.beam.get(row), width, c.azimuth.get(row)) {
            (Some(&beam), ..) => Some(beam),
            (None, Some(width), _) => Some((row % width) as u32),
            (None, None, Some(&azimuth)) => Some(line.nearest(azimuth.into())),
            (None, None, None) if placed => Some(line.nearest(f64::from(place(row).y).atan2(place(row).x.into()))),
            _ => None,
        };
        let mut returns = Vec::new();
        for row in 0..cloud.len {
            let range = c.range.get(row).copied().unwrap_or_else(|| place(row).length());
            if !range.is_finite() {
                continue;
            }
            let Some(beam) = beam_of(row) else {
                return Err(Error::invalid("the cloud", "without beam", "clouds with beam, azimuth, or x, y and z"));
            };
            if beam >= line.beams {
                let allowed = format!("below {}, the number of beams of the scanner", line.beams);
                return Err(Error::invalid(format!("beam of row {row}"), beam, allowed));
            }
            let number = c.return_number.get(row).copied().unwrap_or(0);
            returns.push(LineReturn { beam, number, range, intensity: c.intensity.get(row).copied().unwrap_or(0.0) });
        }
        returns.sort_by_key(|it| (it.beam, it.number));
        // Where beams are found by their angles, two may be nearest to one.
        let known = !c.beam.is_empty() || width.is_some();
        let twice = |pair: &[LineReturn]| pair[0].beam == pair[1].beam && pair[0].number == pair[1].number;
        if let Some(pair) = returns.windows(2).find(|pair| known && pair[0].number > 0 && twice(pair)) {
            let found = format!("with return {} of beam {} twice", pair[0].number, pair[0].beam);
            return Err(Error::invalid("the cloud", found, "the points of one frame"));
        }
        let stamp = Stamp::of(cloud.begins() + line.first_time);
        Ok(LaserMessage { line, returns, has_intensity: !c.intensity.is_empty(), stamp })
    }

    pub fn write(&self, message: &mut CdrWriter, kind: ScanMessage, frame: &str) -> io::Result<()> {
        let ScanLine { beams, start, step, beam_time, period, range_m: [nearest, farthest], .. } = self.line;
        let end = start + f64::from(beams - 1) * step;
        message.header(self.stamp, frame)?;
        message.f32s(&[start, end, step, beam_time, period, nearest, farthest].map(|number| number as f32));
        if kind == ScanMessage::LaserScan {
            return self.write_first(message);
        }
        let all: Vec<&[LineReturn]> = self.of_beams().collect();
        let none = LineReturn { beam: 0, number: 0, range: f32::INFINITY, intensity: 0.0 };
        let echoes = |of: fn(&LineReturn) -> f32, message: &mut CdrWriter| -> io::Result<()> {
            message.count(all.len())?;
            for returns in &all {
                message.count(returns.len().max(1))?;
                returns.iter().for_each(|it| message.f32s(&[of(it)]));
                if returns.is_empty() {
                    message.f32s(&[of(&none)]);
                }
            }
            Ok(())
        };
        echoes(|it| it.range, message)?;
        if self.has_intensity {
            return echoes(|it| it.intensity, message);
        }
        message.count(0)
    }

    /// The ranges and intensities of the first return of each beam.
    fn write_first(&self, message: &mut CdrWriter) -> io::Result<()> {
        let firsts = || self.of_beams().map(|returns| returns.first());
        let ranges: Vec<f32> = firsts().map(|first| first.map_or(f32::INFINITY, |it| it.range)).collect();
        message.count(ranges.len())?;
        message.f32s(&ranges);
        let intensities: Vec<f32> = firsts().map(|first| first.map_or(0.0, |it| it.intensity)).collect();
        let intensities = if self.has_intensity { &intensities[..] } else { &[] };
        message.count(intensities.len())?;
        message.f32s(intensities);
        Ok(())
    }

    /// The returns of each beam.
    fn of_beams(&self) -> impl Iterator<Item = &[LineReturn]> {
        let mut rest = &self.returns[..];
        (0..self.line.beams).map(move |beam| {
            let count = rest.iter().take_while(|it| it.beam == beam).count();
            let (own, after) = rest.split_at(count);
            rest = after;
            own
        })
    }
}
