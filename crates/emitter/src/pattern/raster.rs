//! One beam that sweeps row by row.

use super::fan::check_above_zero;
use super::{Fan, check_count};
use crate::beams::direction;
use crate::{BeamTable, FiringOrder};
use ground::error::Result;
use ground::read::bounds::Bounds;
use serde::{Deserialize, Serialize};

/// One beam that sweeps row by row, from the lowest to the highest and within each from right to left; firings are
/// evenly spaced over the period.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Raster {
    /// Azimuths of the columns.
    pub azimuth: Fan,
    /// Elevations of the rows, within -90 to 90 degrees.
    pub elevation: Fan,
    /// Scans per second, above 0; 10 when not given.
    #[serde(default = "super::ten")]
    pub rate_hz: f64,
}

impl Raster {
    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        self.azimuth.check(bounds, "pattern.azimuth", 360.0)?;
        self.elevation.check_elevations(bounds, "pattern.elevation")?;
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)?;
        let keys = "pattern.azimuth.step_deg and pattern.elevation.step_deg";
        check_count(keys, self.elevation.len(), self.azimuth.len())
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        let (rows, columns) = (self.elevation.len() as usize, self.azimuth.len() as usize);
        let period = 1.0 / self.rate_hz;
        let mut table = BeamTable::with_size(rows, columns, FiringOrder::Beams, period)?;
        let interval = period / (rows * columns) as f64;
        for row in 0..rows {
            let elevation = self.elevation.angle_deg(row).to_radians().sin_cos();
            for column in 0..columns {
                let time = (row * columns + column) as f64 * interval;
                table.push(direction(self.azimuth.angle_deg(column), elevation), time, 0);
            }
        }
        Ok(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_follow_each_other_in_time() {
        let raster = Raster {
            azimuth: Fan { fov_deg: 90.0, step_deg: 45.0, centre_deg: 0.0 },
            elevation: Fan { fov_deg: 60.0, step_deg: 60.0, centre_deg: 0.0 },
            rate_hz: 10.0,
        };
        raster.check(&mut Bounds::none()).unwrap();
        let table = raster.beams().unwrap();
        assert_eq!((table.rows, table.columns, table.len(), table.period), (2, 3, 6, 0.1));
        assert_eq!(table.firing(4), 4);
        for beam in 0..6 {
            assert!((table.time[beam] - beam as f64 * 0.1 / 6.0).abs() < 1e-8);
        }
        // Beam 4: second row (30 deg up), middle column.
        assert!((table.dir_z[4] - 0.5).abs() < 1e-7 && table.dir_y[4].abs() < 1e-7);
        // Beam 0: 30 deg down, 45 deg to the right.
        assert!((table.dir_y[0] + 0.612_372_4).abs() < 1e-7);
        table.check().unwrap();
    }
}
