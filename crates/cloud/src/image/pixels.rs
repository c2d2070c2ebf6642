//! Which return of a cloud each pixel of an image shows.

use super::refill;
use crate::PointCloud;
use emitter::ImageGrid;
use ground::error::{Error, Result};

/// Whether row k of `cloud` is that of beam k of a sensor that makes images like `grid`.
pub(super) fn has_every_beam(cloud: &PointCloud, grid: &ImageGrid) -> bool {
    cloud.organised == Some(grid.beams())
}

/// The row of a cloud that each pixel shows.
#[derive(Clone, Debug, Default)]
pub(super) struct PixelRows(Vec<u32>);

/// Stands for no row.
const NONE: u32 = u32::MAX;

impl PixelRows {
    /// Finds the rows, of several returns the nearest, as for [`super::RangeImage::new`].
    pub fn find(&mut self, cloud: &PointCloud, grid: &ImageGrid) -> Result<()> {
        let PixelRows(rows) = self;
        refill(rows, grid.len(), NONE)?;
        if has_every_beam(cloud, grid) {
            for beam in 0..grid.beams().iter().product() {
                if let Some(pixel) = grid.pixel(beam) {
                    rows[pixel] = beam;
                }
            }
            return Ok(());
        }
        let (beams, ranges) = (&cloud.columns.beam, &cloud.columns.range);
        if [beams.len(), ranges.len()] != [cloud.len; 2] || cloud.len >= NONE as usize {
            let allowed = "a scan with the columns beam and range, from which images are made";
            return Err(Error::invalid("cloud", format!("{} points without them", cloud.len), allowed));
        }
        for (row, (&beam, &range)) in beams.iter().zip(ranges).enumerate() {
            if range.is_nan() {
                continue;
            }
            let Some(pixel) = grid.pixel(beam) else {
                let found = format!("with beam {beam}, of another sensor");
                return Err(Error::invalid("cloud", found, format!("beams of {} pixels", grid.len())));
            };
            let known = &mut rows[pixel];
            if *known == NONE || range < ranges[*known as usize] {
                *known = row as u32;
            }
        }
        Ok(())
    }

    /// Sets each pixel to `value` of the values of `columns` in its row, or to `nothing`; `to` becomes empty unless
    /// each column has `len` rows.
    pub fn take<T: Copy, U: Copy, const N: usize>(
        &self,
        len: usize,
        columns: [&[T]; N],
        value: impl Fn([T; N]) -> U,
        nothing: U,
        to: &mut Vec<U>,
    ) -> Result<()> {
        to.clear();
        if columns.iter().any(|column| column.len() != len) {
            return Ok(());
        }
        refill(to, self.0.len(), nothing)?;
        for (pixel, &row) in to.iter_mut().zip(&self.0) {
            // No column has a row NONE.
            let row = row as usize;
            if row < len {
                *pixel = value(columns.map(|column| column[row]));
            }
        }
        Ok(())
    }
}
