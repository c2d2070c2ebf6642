//! Thermal noise, and what transmitters leak straight into receivers.

use crate::adc::AdcSamples;
use crate::correlation::Correlation;
use crate::cube::RadarCube;
use crate::paths::Paths;
use crate::plan::{RadarPlan, noise_density};
use crate::waveform::RadarWaveform;
use echocast_kernels::radar::add_scaled;
use ground::error::Result;
use ground::parallel;
use ground::read::bounds::Bounds;
use ground::rng::{Draw, Rng};
use num_complex::Complex32;
use serde::{Deserialize, Serialize};

/// `leakage`: what the transmitters leak straight into the receivers, a peak at the near end of the range axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Leakage {
    /// Its power in a receiver, dBm, -200 to 50: usually 20 to 40 dB less than a transmitter's.
    pub power_dbm: f64,
    /// Length of its way, m, 0 to 100.
    #[serde(default = "leak_length")]
    pub length_m: f64,
}

fn leak_length() -> f64 {
    0.05
}

impl Leakage {
    /// Checks that its values are within their allowed ranges.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("leakage.power_dbm", self.power_dbm, -200.0, 50.0)?;
        bounds.within("leakage.length_m", self.length_m, 0.0, 100.0)
    }
}

/// A row of white noise, its real and imaginary parts, with cells beyond its ends.
#[derive(Default)]
struct NoiseRow {
    re: Vec<f32>,
    im: Vec<f32>,
}

impl RadarPlan {
    /// Adds thermal noise to `streams`, with the density and the correlations that noise of samples has after windows
    /// and transforms. Its random numbers depend on the seed and the frame of `rng`, stream and cell.
    ///
    /// Next to the ends of the range axis of a receiver without quadrature, where noise of positive frequencies is
    /// correlated with that of negative ones, it is drawn as anywhere else.
    ///
    /// # Panics
    /// If the streams are not those of [`RadarPlan::silent_streams`].
    pub fn add_noise(&self, noise_figure_db: f64, rng: &Rng, streams: &mut RadarCube) {
        let (width, rows) = (self.range.cells, self.velocity.cells);
        assert_eq!(streams.cells.len(), width * rows * self.streams.len(), "the streams are of another radar");
        let (along, across) = (&self.range.correlation, &self.velocity.correlation);
        let amplitude = self.stream_noise(noise_figure_db).sqrt() as f32;
        parallel::for_each_chunk(&mut streams.cells, width * rows, |stream, cells| {
            let (mut white, mut plane) = (NoiseRow::default(), vec![[0.0f32; 2]; width * rows]);
            let (mut re, mut im) = (vec![0.0; width], vec![0.0; width]);
            for (row, line) in plane.chunks_exact_mut(width).enumerate() {
                let address = (stream * rows + row) as u32;
                self.noise_row(rng, address, Draw::RadarNoise, along, &mut white, [&mut re, &mut im]);
                for (cell, (re, im)) in line.iter_mut().zip(re.iter().zip(&im)) {
                    *cell = [*re, *im];
                }
            }
            let cells: &mut [f32] = bytemuck::cast_slice_mut(cells);
            for (row, cells) in cells.chunks_exact_mut(2 * width).enumerate() {
                for (offset, tap) in &across.taps {
                    let from = row as i64 + offset;
                    let sign = if (0..rows as i64).contains(&from) { 1.0 } else { self.velocity.wrap };
                    let from = from.rem_euclid(rows as i64) as usize * width;
                    add_scaled(plane[from..from + width].as_flattened(), amplitude * sign * tap, cells);
                }
            }
        });
    }

    /// Correlated noise of mean power 1 for the cells of a row.
    fn noise_row(
        &self,
        rng: &Rng,
        address: u32,
        draw: Draw,
        along: &Correlation,
        white: &mut NoiseRow,
        out: [&mut Vec<f32>; 2],
    ) {
        let (width, beyond) = (self.range.cells, along.beyond);
        // If all cells of a period are kept, those beyond the ends are those at the other end.
        let whole = self.range.period == width;
        for (from, out) in [&mut white.re, &mut white.im].into_iter().zip(out.iter().map(|out| out.len())) {
            from.resize(out + 2 * beyond, 0.0);
        }
        let drawn = if whole { beyond..beyond + width } else { 0..width + 2 * beyond };
        rng.cell_phasors(address, draw, &mut white.re[drawn.clone()], &mut white.im[drawn]);
        for (white, out) in [&mut white.re, &mut white.im].into_iter().zip(out) {
            if whole {
                for cell in 0..beyond {
                    white[cell] = self.range.wrap * white[cell + width];
                    white[beyond + width + cell] = self.range.wrap * white[beyond + cell];
                }
            }
            out.fill(0.0);
            for (offset, tap) in &along.taps {
                let from = (beyond as i64 + offset) as usize;
                add_scaled(&white[from..from + width], *tap, out);
            }
        }
    }

    /// Adds thermal noise to `samples`: of the density `k T_0 F` within the rate of sampling, half of it without a
    /// quadrature signal. Its random numbers depend on the seed and the frame of `rng` and the sample.
    pub fn add_sample_noise(&self, noise_figure_db: f64, rng: &Rng, samples: &mut AdcSamples) {
        let density = noise_density(noise_figure_db);
        let (power, along) = match &self.waveform {
            RadarWaveform::Fmcw(fmcw) => (density * fmcw.sample_rate(), None),
            RadarWaveform::Pulse(pulse) => (density * 1e6 / pulse.pulse_us, Some(&self.range.correlation)),
        };
        let amplitude = power.sqrt() as f32;
        let count = samples.samples;
        let complex = samples.complex;
        parallel::for_each_chunk(&mut samples.values, count, |line, values| {
            let (mut re, mut im) = (vec![0.0; count], vec![0.0; count]);
            match &along {
                Some(along) => {
                    let mut white = NoiseRow::default();
                    self.noise_row(rng, line as u32, Draw::RadarSampleNoise, along, &mut white, [&mut re, &mut im]);
                }
                None => rng.cell_phasors(line as u32, Draw::RadarSampleNoise, &mut re, &mut im),
            }
            for (value, (re, im)) in values.iter_mut().zip(re.iter().zip(&im)) {
                // The real part alone has half the power.
                *value += Complex32::new(*re, if complex { *im } else { 0.0 }) * amplitude;
            }
        });
    }

    /// Adds what `leakage` gives to `paths`: a path past the reference point.
    pub fn add_leakage(&self, leakage: &Leakage, paths: &mut Paths) {
        let ahead = [1.0, 0.0, 0.0];
        let gain = self.patterns[0].amplitude(ahead) * self.patterns[1].amplitude(ahead);
        // The way between elements leads past lobes.
        let amplitude = (1e-3 * 10f64.powf(0.1 * leakage.power_dbm)).sqrt() as f32 / gain.max(1e-10);
        paths.range.push(0.5 * leakage.length_m);
        paths.range_rate.push(0.0);
        paths.amplitude.push(Complex32::new(amplitude, 0.0));
        paths.tx_direction.push(ahead);
        paths.rx_direction.push(ahead);
        paths.tx_distance.push(0.0);
        paths.rx_distance.push(0.0);
    }
}
