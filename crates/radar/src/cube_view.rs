//! Pictures of cubes as maps of power.

use crate::array::VirtualArray;
use crate::cube::{Axis, RadarCube};
use ground::parallel;
use num_complex::Complex32;
use rustfft::FftPlannerScalar;

/// Power over range and the sine of the azimuth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AzimuthMap {
    /// Range, m.
    pub range: Axis,
    /// Sine of the azimuth, positive to the left; beyond -1 to 1, for arrays closer than half a wavelength, nothing is
    /// seen.
    pub sine: Axis,
    /// Mean power per channel, summed over velocities, W, `[range][sine]`.
    pub powers: Vec<f32>,
}

impl RadarCube {
    /// Mean power of all channels in each cell, W, `[velocity][range]`.
    pub fn range_doppler(&self) -> Vec<f32> {
        let (width, rows) = (self.axes.range.len, self.axes.velocity.len);
        let mut powers = vec![0.0; width * rows];
        let share = 1.0 / self.channels.max(1) as f32;
        parallel::for_each_chunk(&mut powers, width.max(1), |row, powers| {
            for cells in self.cells.chunks_exact(width * rows) {
                for (power, cell) in powers.iter_mut().zip(&cells[row * width..(row + 1) * width]) {
                    *power += cell.norm_sqr();
                }
            }
            powers.iter_mut().for_each(|power| *power *= share);
        });
        powers
    }

    /// Power over range and azimuth by Bartlett's beamformer over the longest row of `array`, with at least `sines`
    /// directions, at most 65,536, and at least two per beam. Places are taken to be multiples of the smallest spacing
    /// of the row.
    ///
    /// # Panics
    /// If the channels of the array are not those of the cube.
    pub fn range_azimuth(&self, array: &VirtualArray, sines: usize) -> AzimuthMap {
        /// Places are at most so many spacings apart.
        const MOST: f32 = 32_768.0;
        assert_eq!(array.places.len(), self.channels, "the array is of another cube");
        let row = array.azimuth_row().channels;
        let left = |channel: u32| array.places[channel as usize][1];
        let gaps = row.windows(2).map(|pair| left(pair[1]) - left(pair[0]));
        let span = row.last().map_or(0.0, |&last| left(last) - left(row[0]));
        let spacing = match gaps.fold(f32::INFINITY, f32::min) {
            // A single channel sees all directions alike.
            gap if gap.is_infinite() => 0.5 * array.wavelength as f32,
            gap => gap.max(span / MOST),
        };
        let slots: Vec<usize> =
            row.iter().map(|&channel| ((left(channel) - left(row[0])) / spacing).round() as usize).collect();
        let places = slots.last().map_or(1, |last| last + 1);
        let count = sines.clamp(1, 1 << 16).max(2 * places).next_power_of_two();
        let fft = FftPlannerScalar::new().plan_fft_forward(count);
        let (width, rows) = (self.axes.range.len, self.axes.velocity.len);
        let mut powers = vec![0.0; width * count];
        let share = 1.0 / (row.len().max(1) as f32).powi(2);
        parallel::for_each_chunk(&mut powers, count, |cell, powers| {
            let mut line = vec![Complex32::ZERO; count];
            for velocity in 0..rows {
                line.fill(Complex32::ZERO);
                for (&channel, &slot) in row.iter().zip(&slots) {
                    line[slot] = self.cells[(channel as usize * rows + velocity) * width + cell];
                }
                fft.process(&mut line);
                for (sine, power) in powers.iter_mut().enumerate() {
                    *power += share * line[(sine + count / 2) % count].norm_sqr();
                }
            }
        });
        let step = array.wavelength / (count as f64 * f64::from(spacing));
        let sine = Axis { first: -step * (count / 2) as f64, step, len: count };
        AzimuthMap { range: self.axes.range, sine, powers }
    }
}
