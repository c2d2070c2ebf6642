//! Cameras: one exposure of all pixels.

use super::check_count;
use super::fan::check_above_zero;
use crate::beams::MAX_BEAMS;
use crate::{BeamTable, FiringOrder};
use ground::error::Result;
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use serde::{Deserialize, Serialize};

/// Where a pixel's ray passes through it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rays {
    /// Through the centres of the pixels, which fill the field of view.
    #[default]
    Centres,
    /// Evenly over the image plane with the outermost on the edges of the field of view, as in the paper's system.
    Edges,
}

/// A pinhole camera that looks along x; row 0 is the top one (+z), column 0 the left one (+y). All pixels are
/// exposed at time 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Pinhole {
    /// Pixels: columns, rows.
    pub resolution: [u32; 2],
    /// Full field of view: horizontal, vertical, degrees, above 0 and below 180.
    pub fov_deg: [f64; 2],
    /// Frames per second, above 0.
    #[serde(default = "thirty")]
    pub rate_hz: f64,
    /// Where a pixel's ray passes through it.
    #[serde(default)]
    pub rays: Rays,
}

fn thirty() -> f64 {
    30.0
}

impl Pinhole {
    /// Half of the width and height of the image in units of the focal length.
    pub fn half(&self) -> [f64; 2] {
        self.fov_deg.map(|fov| (0.5 * fov).to_radians().tan())
    }

    /// Width and height of a pixel in units of the focal length.
    pub fn pixel(&self) -> [f64; 2] {
        let half = self.half();
        [0, 1].map(|axis| 2.0 * half[axis] / f64::from(self.resolution[axis]))
    }

    pub(super) fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let pixels = |axis: usize| (format!("pattern.resolution[{axis}]"), f64::from(self.resolution[axis]));
        for axis in 0..2 {
            let (key, count) = pixels(axis);
            bounds.number(key, count, [1.0, u32::MAX.into()], "1 or more")?;
            let key = format_args!("pattern.fov_deg[{axis}]");
            bounds.number(key, self.fov_deg[axis], [ABOVE_ZERO, 180f64.next_down()], "above 0 and below 180")?;
        }
        check_above_zero(bounds, "pattern.rate_hz", self.rate_hz)?;
        check_count("pattern.resolution", self.resolution[1].into(), self.resolution[0].into())?;
        // The number of pixels that each axis leaves for the other.
        for axis in 0..2 {
            let (key, count) = pixels(axis);
            bounds.within(key, count, 1.0, (MAX_BEAMS / u64::from(self.resolution[1 - axis])) as f64)?;
        }
        Ok(())
    }

    pub(super) fn beams(&self) -> Result<BeamTable> {
        let [columns, rows] = self.resolution;
        let mut table = BeamTable::with_size(rows as usize, columns as usize, FiringOrder::Frame, 1.0 / self.rate_hz)?;
        let [half_width, half_height] = self.fov_deg.map(|fov| (0.5 * fov).to_radians().tan());
        for row in 0..rows {
            let z = half_height * self.plane(row, rows);
            for column in 0..columns {
                let y = half_width * self.plane(column, columns);
                let scale = 1.0 / (1.0 + y * y + z * z).sqrt();
                table.push([scale, scale * y, scale * z], 0.0, 0);
            }
        }
        Ok(table)
    }

    /// Place of pixel `index` of `count` across the image, 1 (left, top) to -1.
    fn plane(&self, index: u32, count: u32) -> f64 {
        let (index, count) = (f64::from(index), f64::from(count));
        match self.rays {
            Rays::Centres => 1.0 - (2.0 * index + 1.0) / count,
            Rays::Edges if count > 1.0 => 1.0 - 2.0 * index / (count - 1.0),
            Rays::Edges => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(rays: Rays) -> BeamTable {
        let camera = Pinhole { resolution: [4, 2], fov_deg: [90.0, 60.0], rate_hz: 30.0, rays };
        camera.check(&mut Bounds::none()).unwrap();
        camera.beams().unwrap()
    }

    #[test]
    fn rays_go_through_pixel_centres() {
        let table = camera(Rays::Centres);
        assert_eq!((table.rows, table.columns, table.firing(7)), (2, 4, 0));
        // Tangents of column 0, row 0: 3/4 of tan 45 deg to the left, 1/2 of tan 30 deg up.
        assert!((table.dir_y[0] / table.dir_x[0] - 0.75).abs() < 1e-6);
        assert!((table.dir_z[0] / table.dir_x[0] - 0.5 * 30f32.to_radians().tan()).abs() < 1e-6);
        // The last pixel is the mirror image of the first.
        assert_eq!((table.dir_y[7], table.dir_z[7]), (-table.dir_y[0], -table.dir_z[0]));
        table.check().unwrap();
    }

    #[test]
    fn rays_reach_the_edges() {
        let table = camera(Rays::Edges);
        assert!((table.dir_y[0] / table.dir_x[0] - 1.0).abs() < 1e-6);
        assert!((table.dir_z[0] / table.dir_x[0] - 30f32.to_radians().tan()).abs() < 1e-6);
    }
}
