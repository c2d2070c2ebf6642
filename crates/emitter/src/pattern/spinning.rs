//! Emitters that rotate about the z axis.

use super::fan::{check_above_zero, check_fov, samples};
use super::{Fan, check_count};
use crate::beams::direction;
use crate::{BeamTable, FiringOrder};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::units::seconds_from_us;
use serde::{Deserialize, Serialize};

/// Sense of rotation seen from above (+z).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Counter-clockwise: azimuth rises.
    #[default]
    Ccw,
    /// Clockwise: azimuth falls.
    Cw,
}

/// A column of emitters that rotates about the z axis. Rows of the table are channels, columns azimuth steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Spinning {
    /// How it rotates.
    pub azimuth: SpinningAzimuth,
    /// Time between two firings of a channel, us, above 0; the azimuth step is then `360 deg rate cycle`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycle_us: Option<f64>,
    /// The emitters one by one, or use `elevation`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Channels>,
    /// Emitters in an even fan that fire together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation: Option<Fan>,
}

/// How a spinning sensor rotates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SpinningAzimuth {
    /// Angle over which it measures, degrees, above 0, at most 360.
    pub fov_deg: f64,
    /// Turns per second, above 0; 10 when not given.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
    /// Angle from column to column, degrees, above 0; or `cycle_us`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_deg: Option<f64>,
    /// Sense of rotation.
    #[serde(default)]
    pub direction: Direction,
    /// Middle of the field of view, degrees.
    #[serde(default)]
    pub centre_deg: f64,
}

/// The emitters of a spinning sensor; the lists are as long as `elevation_deg`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Channels {
    /// Elevation, degrees, -90 to 90.
    pub elevation_deg: Vec<f64>,
    /// Azimuth relative to the rotor, degrees, counter-clockwise positive; a shorter list repeats, an empty one is 0.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub azimuth_offset_deg: Vec<f64>,
    /// Time of firing in the cycle, us; may be negative; empty: 0.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fire_time_us: Vec<f64>,
    /// Nearest reported range, m; empty: the sensor's.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub range_min_m: Vec<f64>,
    /// Farthest reported range, m; empty: the sensor's.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub range_max_m: Vec<f64>,
}

impl Spinning {
    /// Rotation, degrees per second, positive.
    fn speed_deg_s(&self) -> f64 {
        360.0 * self.azimuth.rate_hz
    }

    /// Angle from column to column, degrees.
    fn step_deg(&self) -> f64 {
        let from_cycle = self.cycle_us.map(|cycle| self.speed_deg_s() * seconds_from_us(cycle));
        from_cycle.or(self.azimuth.step_deg).unwrap_or(self.azimuth.fov_deg)
    }

    fn columns(&self) -> u64 {
        samples(self.azimuth.fov_deg, self.step_deg())
    }

    fn rows(&self) -> u64 {
        match (&self.channels, &self.elevation) {
            (Some(channels), _) => channels.elevation_deg.len() as u64,
            (None, Some(fan)) => fan.len(),
            (None, None) => 0,
        }
    }

    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let azimuth = &self.azimuth;
        check_fov(bounds, "pattern.azimuth.fov_deg", azimuth.fov_deg, 360.0)?;
        check_above_zero(bounds, "pattern.azimuth.rate_hz", azimuth.rate_hz)?;
        bounds.within("pattern.azimuth.centre_deg", azimuth.centre_deg, -360.0, 360.0)?;
        check_above_zero(bounds, "pattern.azimuth.step_deg", azimuth.step_deg)?;
        check_above_zero(bounds, "pattern.cycle_us", self.cycle_us)?;
        match (azimuth.step_deg, self.cycle_us) {
            (None, None) => {
                return Err(Error::invalid("pattern.azimuth.step_deg", "missing", "a value here or pattern.cycle_us"));
            }
            (Some(step), Some(cycle)) if (step - self.step_deg()).abs() > 1e-6 * step => {
                return Err(Error::invalid(
                    "pattern.azimuth.step_deg",
                    step,
                    format!("one of this key and pattern.cycle_us ({cycle} us make steps of {} deg)", self.step_deg()),
                ));
            }
            _ => {}
        }
        match (&self.channels, &self.elevation) {
            (Some(channels), None) => channels.check(bounds)?,
            (None, Some(fan)) => fan.check_elevations(bounds, "pattern.elevation")?,
            (Some(_), Some(_)) => {
                return Err(Error::invalid("pattern.elevation", "given together with channels", "one of the two"));
            }
            (None, None) => {
                return Err(Error::invalid("pattern.channels", "missing", "a section here or pattern.elevation"));
            }
        }
        let most = u64::from(u16::MAX) + 1;
        if self.rows() > most {
            return Err(Error::invalid(
                "pattern.elevation.step_deg",
                format!("{} channels", self.rows()),
                format!("at most {most} channels"),
            ));
        }
        check_count("pattern.azimuth", self.rows(), self.columns())
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        let columns = self.columns() as usize;
        let channels = match (&self.channels, &self.elevation) {
            (Some(channels), _) => channels.clone(),
            (None, fan) => {
                let elevation_deg =
                    fan.iter().flat_map(|fan| (0..fan.len() as usize).map(|i| fan.angle_deg(i))).collect();
                Channels { elevation_deg, ..Channels::default() }
            }
        };
        let rows = channels.elevation_deg.len();
        let azimuth = &self.azimuth;
        let mut table = BeamTable::with_size(rows, columns, FiringOrder::Columns, 1.0 / azimuth.rate_hz)?;
        let sense = match azimuth.direction {
            Direction::Ccw => 1.0,
            Direction::Cw => -1.0,
        };
        let (speed, step) = (self.speed_deg_s(), self.step_deg());
        for channel in 0..rows {
            let fire_time = seconds_from_us(cycled(&channels.fire_time_us, channel));
            let offset = cycled(&channels.azimuth_offset_deg, channel);
            let elevation = channels.elevation_deg[channel].to_radians().sin_cos();
            for column in 0..columns {
                let turned = column as f64 * step;
                // The rotor keeps turning while a channel waits to fire.
                let rotor = azimuth.centre_deg + sense * (turned - 0.5 * azimuth.fov_deg + speed * fire_time);
                let time = turned / speed + fire_time;
                table.push(direction(rotor + offset, elevation), time, channel as u16);
            }
        }
        let per_beam =
            |list: &[f64]| list.iter().flat_map(|&range| std::iter::repeat_n(range as f32, columns)).collect();
        table.range_min = per_beam(&channels.range_min_m);
        table.range_max = per_beam(&channels.range_max_m);
        Ok(table)
    }
}

/// Entry `index` of a repeating list; 0 if it is empty.
fn cycled(list: &[f64], index: usize) -> f64 {
    if list.is_empty() { 0.0 } else { list[index % list.len()] }
}

impl Channels {
    fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let count = self.elevation_deg.len();
        let most = usize::from(u16::MAX) + 1;
        if count == 0 || count > most {
            let key = "pattern.channels.elevation_deg";
            return Err(Error::invalid(key, format!("a list of {count}"), format!("1 to {most} elevations")));
        }
        let offsets = self.azimuth_offset_deg.len();
        if offsets > count {
            return Err(Error::invalid(
                "pattern.channels.azimuth_offset_deg",
                format!("a list of {offsets}"),
                format!("at most as many as elevation_deg ({count})"),
            ));
        }
        // A firing more than a second from its cycle is a mistake of units.
        let lists = [
            ("elevation_deg", &self.elevation_deg, -90.0, 90.0),
            ("azimuth_offset_deg", &self.azimuth_offset_deg, -360.0, 360.0),
            ("fire_time_us", &self.fire_time_us, -1e6, 1e6),
            ("range_min_m", &self.range_min_m, 0.0, 1e9),
            ("range_max_m", &self.range_max_m, 0.0, 1e9),
        ];
        for (name, list, low, high) in lists {
            if name != "azimuth_offset_deg" && !list.is_empty() && list.len() != count {
                return Err(Error::invalid(
                    format!("pattern.channels.{name}"),
                    format!("a list of {}", list.len()),
                    format!("as many as elevation_deg ({count})"),
                ));
            }
            for (i, &value) in list.iter().enumerate() {
                bounds.within(format_args!("pattern.channels.{name}[{i}]"), value, low, high)?;
            }
        }
        for (i, (&near, &far)) in self.range_min_m.iter().zip(&self.range_max_m).enumerate() {
            let [min, max] = ["min", "max"].map(|end| format!("pattern.channels.range_{end}_m[{i}]"));
            bounds.rising((min, near), (max, far))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn azimuth_deg(table: &BeamTable, beam: usize) -> f64 {
        f64::from(table.dir_y[beam]).atan2(f64::from(table.dir_x[beam])).to_degrees()
    }

    fn two_channels(direction: Direction) -> Spinning {
        Spinning {
            azimuth: SpinningAzimuth { fov_deg: 90.0, rate_hz: 10.0, step_deg: Some(1.0), direction, centre_deg: 20.0 },
            cycle_us: None,
            channels: Some(Channels {
                elevation_deg: vec![-5.0, 5.0],
                azimuth_offset_deg: vec![0.5],
                fire_time_us: vec![0.0, -100.0],
                range_min_m: vec![],
                range_max_m: vec![30.0, 50.0],
            }),
            elevation: None,
        }
    }

    #[test]
    fn columns_turn_counter_clockwise() {
        let spinning = two_channels(Direction::Ccw);
        spinning.check(&mut Bounds::none()).unwrap();
        let table = spinning.beams().unwrap();
        assert_eq!((table.rows, table.columns, table.period), (2, 91, 0.1));
        assert!((azimuth_deg(&table, 0) - (20.0 - 45.0 + 0.5)).abs() < 1e-5);
        assert!((azimuth_deg(&table, 90) - (20.0 + 45.0 + 0.5)).abs() < 1e-5);
        // 100 us early the rotor is 0.36 deg behind.
        assert!((azimuth_deg(&table, 91) - (20.0 - 45.0 + 0.5 - 0.36)).abs() < 1e-5);
        assert!((table.time[91 + 90] - (90.0 / 3600.0 - 1e-4)).abs() < 1e-9);
        assert_eq!((table.channel[90], table.channel[91], table.firing(91 + 7)), (0, 1, 7));
        assert_eq!((table.range_max[90], table.range_max[91], table.range_min.len()), (30.0, 50.0, 0));
        table.check().unwrap();
    }

    #[test]
    fn columns_turn_clockwise() {
        let table = two_channels(Direction::Cw).beams().unwrap();
        assert!((azimuth_deg(&table, 0) - (20.0 + 45.0 + 0.5)).abs() < 1e-5);
        assert!((azimuth_deg(&table, 90) - (20.0 - 45.0 + 0.5)).abs() < 1e-5);
        assert!((azimuth_deg(&table, 91) - (20.0 + 45.0 + 0.5 + 0.36)).abs() < 1e-5);
    }

    #[test]
    fn a_cycle_is_a_step() {
        let mut spinning = two_channels(Direction::Ccw);
        spinning.azimuth.step_deg = None;
        spinning.cycle_us = Some(55.296);
        assert!((spinning.step_deg() - 0.1990656).abs() < 1e-12);
        spinning.azimuth.step_deg = Some(0.1990656);
        spinning.check(&mut Bounds::none()).unwrap();
        spinning.azimuth.step_deg = Some(0.2);
        assert!(
            spinning
                .check(&mut Bounds::none())
                .unwrap_err()
                .to_string()
                .starts_with("pattern.azimuth.step_deg is 0.2; allowed: one of")
        );
    }
}
