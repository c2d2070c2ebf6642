//! A grid on the map.

use super::Place;
use glam::DVec2;
use ground::error::{Error, Result};

/// Maximum number of pixels of a map.
const MOST_PIXELS: usize = 1 << 24;

/// Squares of the world, seen from above; row 0 has the largest y.
pub(super) struct Grid {
    /// Lower left corner, m; a multiple of the cell.
    corner: DVec2,
    cell: f64,
    pub width: usize,
    pub height: usize,
}

impl Grid {
    /// Squares of `cell` metres from `low` to `high`.
    ///
    /// # Errors
    /// A cell that is not a length or makes more pixels than images may have.
    pub(super) fn new([low, high]: [DVec2; 2], cell: f64) -> Result<Grid> {
        if !(cell.is_finite() && cell > 0.0) {
            return Err(Error::invalid("cell_m", cell, "a length above 0"));
        }
        let corner = (low / cell).floor() * cell;
        let size = ((high - corner) / cell).floor() + 1.0;
        let most = MOST_PIXELS as f64;
        if size.x * size.y > most || !size.is_finite() {
            let extent = high - low;
            let found = format!("{cell}, which makes {} x {} pixels", size.x, size.y);
            // A strip needs cells for its length, a square for its area.
            let least = (extent.x * extent.y / most).sqrt().max(extent.max_element() / most);
            // Three digits, rounded up.
            let digit = 10f64.powf(least.log10().floor() - 2.0);
            let least = (least / digit).ceil() * digit + digit;
            return Err(Error::invalid(
                "cell_m",
                found,
                format!("at most {most} pixels: cells of {least:.4} m or more"),
            ));
        }
        Ok(Grid { corner, cell, width: size.x as usize, height: size.y as usize })
    }

    /// Number of pixels.
    pub(super) fn len(&self) -> usize {
        self.width * self.height
    }

    /// Index of the pixel at `at`, which is within the grid's span.
    pub(super) fn index(&self, at: DVec2) -> usize {
        let steps = (at - self.corner) / self.cell;
        // Casts saturate: rounding at the edge cannot lead outside.
        let column = (steps.x as usize).min(self.width - 1);
        let row = self.height - 1 - (steps.y as usize).min(self.height - 1);
        row * self.width + column
    }

    pub(super) fn place(&self) -> Place {
        let first = self.corner + self.cell * DVec2::new(0.5, self.height as f64 - 0.5);
        Place { first: first.into(), step: [self.cell, -self.cell], axes: ["x, m", "y, m"] }
    }
}

/// The smallest span that holds all `points`.
pub(super) fn span(points: impl Iterator<Item = DVec2>) -> [DVec2; 2] {
    points.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], point| [low.min(point), high.max(point)])
}

/// Cell size for which a map of `low` to `high` fits into `pixels`.
pub(super) fn fitting([low, high]: [DVec2; 2], pixels: [u32; 2]) -> f64 {
    let pixels = DVec2::new(f64::from(pixels[0]), f64::from(pixels[1]));
    // The span may touch one more pixel than its size suggests.
    ((high - low) / (pixels - 1.0).max(DVec2::ONE)).max_element().max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_fine_a_grid_says_which_would_do() {
        let span = [DVec2::ZERO, DVec2::new(10_000.0, 5_000.0)];
        let error = Grid::new(span, 0.1).err().unwrap().to_string();
        assert!(
            error.contains("100001 x 50001 pixels; allowed: at most 16777216 pixels: cells of 1.7400 m"),
            "{error}"
        );
        assert!(Grid::new(span, 1.74).is_ok());
        assert!(Grid::new([DVec2::ZERO, DVec2::X * 1e9], 1.0).is_err());
        for cell in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Grid::new(span, cell).is_err());
        }
    }

    #[test]
    fn y_runs_up() {
        let grid = Grid::new([DVec2::new(0.1, 0.1), DVec2::new(2.9, 1.9)], 1.0).unwrap();
        assert_eq!((grid.width, grid.height), (3, 2));
        assert_eq!((grid.index(DVec2::new(0.5, 1.5)), grid.index(DVec2::new(2.5, 0.5))), (0, 5));
        assert_eq!(grid.place().first, [0.5, 1.5]);
    }
}
