//! Directions of the plane waves on the virtual elements of an array.
//!
//! A wave from the unit vector d has the phase `k p . d` at the element p, the sum of the positions of transmitter and
//! receiver, k = 2 pi / wavelength: the nearer an element is to the target, the shorter is the path. The elements are in
//! one plane across x, so a direction is given by two sines: u = d_y, w = d_z.

use super::response::vertex;
use echocast_kernels::steer;
use ground::error::{Error, Result};
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlannerScalar};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Points of the search grid per width of a beam, wavelength over length of the array. The maximum is then at most
/// 0.9 dB above the point next to it (scalloping of a quarter of a bin), and less between the null and the maximum.
const FINE: f64 = 2.0;

/// Elements are at the same coordinate if they are closer than this, wavelengths.
const SAME: f64 = 1e-3;

/// Most points of the search grid along one axis, for arrays up to a thousand wavelengths.
const MOST_POINTS: usize = 8192;

/// A wave on the array.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneWave {
    /// Components y and z of the unit vector towards where it comes from.
    pub sines: [f32; 2],
    /// Amplitude in each channel, its phase that of an element in the origin.
    pub amplitude: Complex32,
}

impl PlaneWave {
    /// Azimuth and elevation, rad: positive to the left and up.
    pub fn angles(&self) -> [f32; 2] {
        let [u, w] = self.sines;
        [u.atan2((1.0 - u * u - w * w).max(0.0).sqrt()), w.clamp(-1.0, 1.0).asin()]
    }

    /// Its power in each channel, W.
    pub fn power(&self) -> f32 {
        self.amplitude.norm_sqr()
    }
}

/// Channels at one height.
#[derive(Clone, Debug)]
struct ChannelRow {
    /// Where its channels begin and end among the sorted ones.
    channels: std::ops::Range<usize>,
    /// Height, wavelengths.
    z: f32,
}

/// How the sums of a row over its elements, for all u of the grid, are formed.
#[derive(Clone)]
enum RowSums {
    /// One u: all elements are at the same y.
    One,
    /// The elements are at whole multiples, `places`, of a spacing.
    Fft { transform: Arc<dyn Fft<f32>>, places: Vec<usize> },
    /// They are anywhere: sums towards each u.
    Direct,
}

/// Finds the directions of waves by the maxima of what the array receives from every direction (Bartlett's
/// beamformer), one after another, each without those found before.
#[derive(Clone)]
pub struct DirectionFinder {
    /// Channels by height, then by y.
    order: Vec<u32>,
    rows: Vec<ChannelRow>,
    /// Their positions, wavelengths.
    y: Vec<f32>,
    z: Vec<f32>,
    sums: RowSums,
    /// Grids of the search.
    u: Vec<f32>,
    w: Vec<f32>,
    /// Steps of the grids, 0 if there is one point; how far a maximum may be from it.
    step: [f32; 2],
    /// From the middle of a beam to its first null, in sines; infinite without.
    beam: [f32; 2],
    /// Sines that differ by this look the same; infinite without.
    period: [f32; 2],
    /// Phases of the rows for each w.
    phasors: Vec<[f32; 2]>,
    /// Standard errors of u and w at a signal-to-noise ratio of 1 after the sum over channels.
    spread: [f32; 2],
    memory: WaveMemory,
}

/// Buffers.
#[derive(Clone, Debug, Default)]
struct WaveMemory {
    /// Channels in the finder's order: without the waves found, and the real and imaginary parts.
    re: Vec<f32>,
    im: Vec<f32>,
    row: Vec<Complex32>,
    scratch: Vec<Complex32>,
    rows_re: Vec<f32>,
    rows_im: Vec<f32>,
    power: Vec<f32>,
}

impl DirectionFinder {
    /// For virtual elements at `positions`, m, of waves of `wavelength` m.
    ///
    /// # Errors
    /// No element; elements that are not in one plane across x, or more than a thousand wavelengths apart.
    pub fn new(positions: &[[f32; 3]], wavelength: f64) -> Result<Self> {
        let at = |channel: usize, axis: usize| f64::from(positions[channel][axis]) / wavelength;
        if positions.is_empty()
            || positions.iter().flatten().any(|at| !at.is_finite())
            || wavelength.is_nan()
            || wavelength <= 0.0
        {
            return Err(Error::invalid("virtual elements", positions.len(), "one or more, at finite places"));
        }
        let extent = |axis: usize| {
            let places = (0..positions.len()).map(|channel| at(channel, axis));
            places.clone().fold(f64::MIN, f64::max) - places.fold(f64::MAX, f64::min)
        };
        if extent(0) > 0.125 {
            let found = format!("{:.3} wavelengths deep", extent(0));
            return Err(Error::invalid(
                "array",
                found,
                "up to an eighth of a wavelength: elements in a plane across x",
            ));
        }
        let longest = MOST_POINTS as f64 / FINE / 4.0;
        if extent(1) > longest || extent(2) > longest {
            let found = format!("{:.3} x {:.3} wavelengths", extent(1), extent(2));
            return Err(Error::invalid("array", found, format!("up to {longest} wavelengths in width and height")));
        }
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        let height = |channel: u32| (at(channel as usize, 2) / SAME).round();
        let along = |channel: &u32| at(*channel as usize, 1);
        order.sort_by(|a, b| height(*a).total_cmp(&height(*b)).then(along(a).total_cmp(&along(b))));
        let y: Vec<f64> = order.iter().map(along).collect();
        let z: Vec<f64> = order.iter().map(|&channel| at(channel as usize, 2)).collect();
        let mut rows: Vec<ChannelRow> = Vec::new();
        for channel in 0..order.len() {
            match rows.last_mut() {
                Some(row) if height(order[channel]) == height(order[row.channels.start]) => row.channels.end += 1,
                _ => rows.push(ChannelRow { channels: channel..channel + 1, z: z[channel] as f32 }),
            }
        }
        let (sums, u) = row_sums(&y);
        let w = grid(&rows.iter().map(|row| row.z.into()).collect::<Vec<f64>>());
        let mut sorted = [y.clone(), z.clone()];
        sorted.iter_mut().for_each(|places| places.sort_by(f64::total_cmp));
        let period =
            sorted.each_ref().map(|places| spacing(places).map_or(f32::INFINITY, |spacing| (1.0 / spacing) as f32));
        let beam = beams(positions, wavelength);
        let step = [&u, &w].map(|grid| if grid.len() > 1 { grid[1] - grid[0] } else { 0.0 });
        let phasor = |(w, row): (&f32, &ChannelRow)| steer::phasor(w * row.z);
        let phasors = w.iter().flat_map(|w| rows.iter().map(move |row| (w, row))).map(phasor).collect();
        let (spread, size) = (spread(&y, &z), u.len() * rows.len());
        let memory = WaveMemory {
            rows_re: vec![0.0; size],
            rows_im: vec![0.0; size],
            power: vec![0.0; u.len()],
            ..WaveMemory::default()
        };
        let [y, z] = [y, z].map(|places| places.iter().map(|&place| place as f32).collect());
        Ok(DirectionFinder { order, rows, y, z, sums, u, w, step, beam, period, phasors, spread, memory })
    }

    /// Whether the elements are wide, and high, enough apart to measure y and z of directions.
    pub fn measures(&self) -> [bool; 2] {
        self.step.map(|step| step > 0.0)
    }

    /// Standard errors of the sines of a wave whose signal-to-noise ratio after the sum over all channels is `snr`;
    /// infinite for what the array does not measure.
    ///
    /// The bound of the covariance of both sines is `C^-1 / (2 snr k^2)`, where C is that of the positions (van Trees
    /// 2002, "Optimum array processing", 8.4, for one wave): in beams of a filled row `sqrt(6) / (2 pi) / sqrt(snr)`.
    pub fn error(&self, snr: f32) -> [f32; 2] {
        self.spread.map(|spread| spread / snr.sqrt())
    }

    /// Fills `waves` with those that `channels` receive, the strongest first, up to `most`. Each but the first has at
    /// least `fraction` of the power of the strongest and is above `floor` W. Of waves within a beam of each other one
    /// is found.
    pub fn find(&mut self, channels: &[Complex32], most: usize, fraction: f32, floor: f32, waves: &mut Vec<PlaneWave>) {
        waves.clear();
        self.take(channels);
        while waves.len() < most {
            let wave = self.search().0;
            let wave = self.refine(wave);
            let strongest = waves.iter().map(PlaneWave::power).fold(0.0, f32::max);
            let enough = wave.power() >= fraction * strongest && wave.power() > floor;
            if !waves.is_empty() && !enough || !wave.power().is_finite() {
                break;
            }
            waves.push(wave);
            if most == 1 {
                break;
            }
            self.add(wave, -1.0);
            self.relax(waves);
            let strongest = waves.iter().map(PlaneWave::power).fold(0.0, f32::max);
            let weak = |wave: &PlaneWave| wave.power() < fraction * strongest || wave.power() <= floor;
            if waves.len() > 1 && (waves.iter().any(weak) || self.merged(waves)) {
                // Without the others it is none: it was a side lobe, or part of the first.
                waves.pop();
                self.take(channels);
                waves.iter().for_each(|&wave| self.add(wave, -1.0));
                self.relax(waves);
                break;
            }
        }
        waves.sort_by(|a, b| b.power().total_cmp(&a.power()));
    }

    /// Power per channel, W, of the strongest wave, on the grid.
    pub fn strongest(&mut self, channels: &[Complex32]) -> f32 {
        self.take(channels);
        self.search().1
    }

    /// What `channels` receive as if it came from the direction with these `sines`.
    pub fn towards(&mut self, sines: [f32; 2], channels: &[Complex32]) -> PlaneWave {
        self.take(channels);
        self.wave(sines)
    }

    /// Estimates each wave again without the others (RELAX: Li and Stoica 1996, "Efficient mixed-spectrum estimation with
    /// applications to target feature extraction"); what is left of the channels is without any of them.
    fn relax(&mut self, waves: &mut [PlaneWave]) {
        /// Two waves a beam apart then are within a hundredth of a beam of where they converge to.
        const ROUNDS: usize = 8;
        if waves.len() < 2 {
            return;
        }
        for _ in 0..ROUNDS {
            for wave in waves.iter_mut() {
                self.add(*wave, 1.0);
                *wave = self.refine(wave.sines);
                self.add(*wave, -1.0);
            }
        }
    }

    /// Whether the last of `waves` is within a beam of another.
    fn merged(&self, waves: &[PlaneWave]) -> bool {
        let Some((last, others)) = waves.split_last() else { return false };
        let near = |wave: &PlaneWave| {
            let beams = |axis: usize| (wave.sines[axis] - last.sines[axis]).abs() / self.beam[axis];
            beams(0).max(beams(1)) < 0.7
        };
        others.iter().any(near)
    }

    /// Takes over the channels, in the order of rows.
    fn take(&mut self, channels: &[Complex32]) {
        let WaveMemory { re, im, .. } = &mut self.memory;
        re.clear();
        im.clear();
        for &channel in &self.order {
            let value = channels.get(channel as usize).copied().unwrap_or_default();
            re.push(value.re);
            im.push(value.im);
        }
    }

    /// Adds `times` a wave to the channels.
    fn add(&mut self, wave: PlaneWave, times: f32) {
        let [u, w] = wave.sines;
        for channel in 0..self.order.len() {
            let [cosine, sine] = steer::phasor(self.y[channel] * u + self.z[channel] * w);
            let value = times * wave.amplitude * Complex32::new(cosine, sine);
            self.memory.re[channel] += value.re;
            self.memory.im[channel] += value.im;
        }
    }

    /// The strongest point of the grid that a wave can come from, and its power per channel.
    fn search(&mut self) -> ([f32; 2], f32) {
        let points = self.u.len();
        let memory = &mut self.memory;
        for (row, ChannelRow { channels, .. }) in self.rows.iter().enumerate() {
            let cells = row * points..(row + 1) * points;
            let [re, im] = [&memory.re, &memory.im].map(|part| &part[channels.clone()]);
            let (rows_re, rows_im) = (&mut memory.rows_re[cells.clone()], &mut memory.rows_im[cells]);
            match &self.sums {
                RowSums::One => {
                    rows_re[0] = re.iter().sum();
                    rows_im[0] = im.iter().sum();
                }
                RowSums::Direct => {
                    for (point, &u) in self.u.iter().enumerate() {
                        [rows_re[point], rows_im[point]] = steer::sum_towards(&self.y[channels.clone()], u, re, im);
                    }
                }
                RowSums::Fft { transform, places } => {
                    memory.row.clear();
                    memory.row.resize(points, Complex32::default());
                    for (&place, (&re, &im)) in places[channels.clone()].iter().zip(re.iter().zip(im)) {
                        memory.row[place % points] += Complex32::new(re, im);
                    }
                    memory.scratch.resize(transform.get_inplace_scratch_len(), Complex32::default());
                    transform.process_with_scratch(&mut memory.row, &mut memory.scratch);
                    // From the least u to the greatest.
                    let (positive, negative) = memory.row.split_at(points - points / 2);
                    for (point, value) in negative.iter().chain(positive).enumerate() {
                        (rows_re[point], rows_im[point]) = (value.re, value.im);
                    }
                }
            }
        }
        // The rows of an FFT have phases from its first place on, the same in all rows.
        let mut best = ([0.0; 2], -1.0);
        for (w, phasors) in self.w.iter().zip(self.phasors.chunks(self.rows.len())) {
            steer::add_rows(&memory.rows_re, &memory.rows_im, phasors, &mut memory.power);
            let widest = (1.0 - w * w).max(0.0).sqrt() + 0.5 * self.step[0];
            for (&u, &power) in self.u.iter().zip(&memory.power) {
                if power > best.1 && u.abs() <= widest {
                    best = ([u, *w], power);
                }
            }
        }
        let count = self.order.len() as f32;
        (best.0, best.1 / (count * count))
    }

    /// The maximum near a point of the grid: that of a paraboloid through the logarithms of the powers at nine places,
    /// closer together the second time.
    fn refine(&self, from: [f32; 2]) -> PlaneWave {
        const BESIDE: [f32; 3] = [-1.0, 0.0, 1.0];
        let mut at = from;
        for width in [0.5, 0.125] {
            let [step_u, step_w] = self.step.map(|step| width * step);
            // By u, then w.
            let powers = BESIDE.map(|beside| {
                let mut sums = [Complex32::default(); 3];
                for row in &self.rows {
                    let of_row = self.row_sum(row, at[0] + beside * step_u);
                    for (sum, beside) in sums.iter_mut().zip(BESIDE) {
                        *sum += turned_back(of_row, row.z * (at[1] + beside * step_w));
                    }
                }
                sums.map(|sum| sum.norm_sqr())
            });
            let [along, across] = vertex_of_nine(powers);
            at[0] += step_u * along;
            at[1] += step_w * across;
        }
        // What is found just beyond the sines that the array tells apart is at their other side.
        for axis in 0..2 {
            if at[axis].abs() > 0.5 * self.period[axis] {
                at[axis] -= at[axis].signum() * self.period[axis];
            }
        }
        // A unit vector has no greater components.
        let long = (at[0] * at[0] + at[1] * at[1]).sqrt().max(1.0);
        self.wave(at.map(|sine| sine / long))
    }

    /// The wave from a direction.
    fn wave(&self, sines: [f32; 2]) -> PlaneWave {
        let amplitudes = self.rows.iter().map(|row| turned_back(self.row_sum(row, sines[0]), row.z * sines[1]));
        PlaneWave { sines, amplitude: amplitudes.sum::<Complex32>() / self.order.len() as f32 }
    }

    /// Sum of a row towards `u`.
    fn row_sum(&self, row: &ChannelRow, u: f32) -> [f32; 2] {
        let cells = row.channels.clone();
        steer::sum_towards(&self.y[cells.clone()], u, &self.memory.re[cells.clone()], &self.memory.im[cells])
    }
}

/// Where a paraboloid through the logarithms of nine powers, by u and then w, has its maximum, in steps from the one in
/// the middle. It may be a little beyond the outer ones, no farther.
fn vertex_of_nine(powers: [[f32; 3]; 3]) -> [f32; 2] {
    const FARTHEST: f32 = 1.5;
    let level = powers.map(|of_u| of_u.map(|power| power.max(f32::MIN_POSITIVE).ln()));
    let slope = [0.5 * (level[2][1] - level[0][1]), 0.5 * (level[1][2] - level[1][0])];
    let bend = [level[2][1] + level[0][1] - 2.0 * level[1][1], level[1][2] + level[1][0] - 2.0 * level[1][1]];
    let twist = 0.25 * (level[2][2] + level[0][0] - level[2][0] - level[0][2]);
    let determinant = bend[0] * bend[1] - twist * twist;
    if bend[0] < 0.0 && determinant > 0.0 {
        let along = (twist * slope[1] - bend[1] * slope[0]) / determinant;
        let across = (twist * slope[0] - bend[0] * slope[1]) / determinant;
        return [along, across].map(|steps| steps.clamp(-FARTHEST, FARTHEST));
    }
    // Not a maximum in both, or there is one axis only.
    [vertex(powers.map(|of_u| of_u[1]), FARTHEST), vertex(powers[1], FARTHEST)]
}

/// The sum of a row times the conjugate of its phase.
fn turned_back([re, im]: [f32; 2], turns: f32) -> Complex32 {
    let [cosine, sine] = steer::phasor(turns);
    Complex32::new(re, im) * Complex32::new(cosine, -sine)
}

/// From the middle of a beam to its first null, in sines, of arrays along y and z; infinite for elements at one place.
pub(super) fn beams(positions: &[[f32; 3]], wavelength: f64) -> [f32; 2] {
    [1, 2].map(|axis| {
        let mut places: Vec<f64> = positions.iter().map(|at| f64::from(at[axis]) / wavelength).collect();
        places.sort_by(f64::total_cmp);
        let extent = places.last().zip(places.first()).map_or(0.0, |(last, first)| last - first);
        if extent > SAME { (1.0 / (extent + spacing(&places).unwrap_or(0.0))) as f32 } else { f32::INFINITY }
    })
}

/// The greatest spacing of which all distances of `places`, in rising order, are whole multiples, if there is one of the
/// size of the least of them.
fn spacing(places: &[f64]) -> Option<f64> {
    let apart = |pair: &[f64]| pair[1] - pair[0];
    let least = places.windows(2).map(apart).filter(|apart| *apart > SAME).fold(f64::INFINITY, f64::min);
    let divides = |spacing: &f64| {
        let off = |place: &f64| {
            let steps = (place - places[0]) / spacing;
            (steps - steps.round()).abs() * spacing
        };
        places.iter().all(|place| off(place) < SAME)
    };
    (1..=4).map(|part| least / f64::from(part)).find(divides).filter(|spacing| spacing.is_finite())
}

/// Sines at which arrays with elements at `places`, in rising order, are searched: those that they tell apart.
fn grid(places: &[f64]) -> Vec<f32> {
    let extent = places.last().zip(places.first()).map_or(0.0, |(last, first)| last - first);
    if extent <= SAME {
        return vec![0.0];
    }
    let spacing = spacing(places);
    let widest = spacing.map_or(1.0, |spacing| (0.5 / spacing).min(1.0));
    let points = (widest * FINE * (extent + spacing.unwrap_or(0.0))).ceil();
    (-(points as i64)..=points as i64).map(|point| (widest * point as f64 / points) as f32).collect()
}

/// How sums of rows with elements at `y` are formed, and the grid on which they are.
fn row_sums(y: &[f64]) -> (RowSums, Vec<f32>) {
    let mut sorted = y.to_vec();
    sorted.sort_by(f64::total_cmp);
    let extent = sorted[sorted.len() - 1] - sorted[0];
    if extent <= SAME {
        return (RowSums::One, vec![0.0]);
    }
    let on_grid = spacing(&sorted).map(|spacing| (spacing, FINE * (extent / spacing + 1.0)));
    let Some((spacing, cells)) = on_grid.filter(|(_, cells)| *cells <= MOST_POINTS as f64) else {
        return (RowSums::Direct, grid(&sorted));
    };
    let points = (cells.ceil() as usize).next_power_of_two();
    let places = y.iter().map(|y| ((y - sorted[0]) / spacing).round() as usize).collect();
    let sine = |point: usize| ((point as f64 - (points / 2) as f64) / (points as f64 * spacing)) as f32;
    // The same on every processor, unlike the planner that chooses vector instructions.
    let transform = FftPlannerScalar::new().plan_fft_forward(points);
    (RowSums::Fft { transform, places }, (0..points).map(sine).collect())
}

/// Standard errors of both sines at a signal-to-noise ratio of 1, from positions in wavelengths.
fn spread(y: &[f64], z: &[f64]) -> [f32; 2] {
    let count = y.len() as f64;
    let middle = |places: &[f64]| places.iter().sum::<f64>() / count;
    let (middle_y, middle_z) = (middle(y), middle(z));
    let covariance = |value: &dyn Fn(f64, f64) -> f64| {
        y.iter().zip(z).map(|(y, z)| value(y - middle_y, z - middle_z)).sum::<f64>() / count
    };
    let [yy, yz, zz] = [covariance(&|y, _| y * y), covariance(&|y, z| y * z), covariance(&|_, z| z * z)];
    // What is known of one sine without the other, if the other is measured.
    let left = |own: f64, other: f64| if other > SAME * SAME { own - yz * yz / other } else { own };
    [left(yy, zz), left(zz, yy)]
        .map(|left| if left > SAME * SAME { ((0.5 / left).sqrt() / TAU) as f32 } else { f32::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::rng::{Draw, Rng};

    const WAVELENGTH: f64 = 0.004;

    /// Elements half a wavelength apart, `rows` rows one above the other.
    fn array(columns: usize, rows: usize) -> Vec<[f32; 3]> {
        let half = 0.5 * WAVELENGTH as f32;
        (0..rows * columns).map(|n| [0.0, half * (n % columns) as f32 - 0.1, half * (n / columns) as f32]).collect()
    }

    /// 86 columns in one row, and 3 higher ones with gaps, as the cascade of TI's four chips has them.
    fn cascade() -> Vec<[f32; 3]> {
        let half = 0.5 * WAVELENGTH as f32;
        let higher = [1, 4, 6].into_iter().flat_map(|row| (0..32).map(move |column| (column, row)));
        (0..86).map(|column| (column, 0)).chain(higher).map(|(y, z)| [0.0, half * y as f32, half * z as f32]).collect()
    }

    fn wave(positions: &[[f32; 3]], [u, w]: [f64; 2], amplitude: Complex32) -> Vec<Complex32> {
        let phase = |at: &[f32; 3]| (TAU * (f64::from(at[1]) * u + f64::from(at[2]) * w) / WAVELENGTH) as f32;
        positions.iter().map(|at| amplitude * Complex32::from_polar(1.0, phase(at))).collect()
    }

    fn add(to: &mut [Complex32], other: &[Complex32]) {
        to.iter_mut().zip(other).for_each(|(to, other)| *to += other);
    }

    fn noise(rng: &Rng, power: f32, to: &mut [Complex32]) {
        let (mut re, mut im) = (vec![0.0; to.len()], vec![0.0; to.len()]);
        rng.cell_phasors(0, Draw::RadarNoise, &mut re, &mut im);
        let scale = power.sqrt();
        to.iter_mut().zip(re.iter().zip(im)).for_each(|(to, (re, im))| *to += scale * Complex32::new(*re, im));
    }

    #[test]
    fn one_wave_is_found_wherever_it_comes_from() {
        let mut waves = Vec::new();
        // Irregular gaps, and one above the other.
        let sparse: Vec<_> = [0.0, 0.5, 1.23, 2.9, 4.1].map(|y| [0.0, (y * WAVELENGTH) as f32, 0.0]).to_vec();
        let mast: Vec<_> = array(8, 1).iter().map(|at| [0.0, 0.0, at[1]]).collect();
        let wide: Vec<_> = array(6, 1).iter().map(|at| at.map(|place| 2.0 * place)).collect();
        for (positions, unambiguous, axes) in [
            (array(12, 1), 0.99, [true, false]),
            (array(86, 1), 0.99, [true, false]),
            (array(8, 2), 0.7, [true, true]),
            (cascade(), 0.7, [true, true]),
            (sparse, 0.7, [true, false]),
            (mast, 0.99, [false, true]),
            (wide, 0.49, [true, false]),
            (array(1, 1), 1.0, [false, false]),
        ] {
            let mut finder = DirectionFinder::new(&positions, WAVELENGTH).unwrap();
            assert_eq!(finder.measures(), axes);
            let (mut worst, amplitude) = (0.0f32, Complex32::new(-0.3, 0.4));
            for step in -50..50 {
                let sine = |used: bool, at: f64| if used { unambiguous * at } else { 0.0 };
                let sines = [sine(axes[0], f64::from(step) / 50.0), sine(axes[1], (f64::from(step) * 0.618).fract())];
                finder.find(&wave(&positions, sines, amplitude), 1, 0.5, 0.0, &mut waves);
                let beam = finder.beam.map(|beam| if beam.is_finite() { beam } else { 1.0 });
                for axis in 0..2 {
                    let off = (waves[0].sines[axis] - sines[axis] as f32).abs();
                    worst = worst.max(off / beam[axis]);
                }
                assert!((waves[0].amplitude - amplitude).norm() < 0.01, "{:?} at {sines:?}", waves[0]);
            }
            println!("{} elements: within {worst:.5} beams", positions.len());
            assert!(worst < 2e-3, "{worst} beams off with {} elements", positions.len());
        }
    }

    #[test]
    fn angles_are_positive_to_the_left_and_up() {
        let sines = |azimuth: f32, elevation: f32| {
            let wave = PlaneWave {
                sines: [elevation.cos() * azimuth.sin(), elevation.sin()],
                amplitude: Complex32::new(1.0, 0.0),
            };
            wave.angles()
        };
        let [azimuth, elevation] = sines(0.5, -0.2);
        assert!((azimuth - 0.5).abs() < 1e-6 && (elevation + 0.2).abs() < 1e-6);
    }

    /// In noise, errors are those of the bound: 12 and 86 elements have [7] beams of 9.5 and 1.3 degrees.
    #[test]
    fn errors_are_near_the_bound() {
        let mut waves = Vec::new();
        for (positions, beam) in [(array(12, 1), 9.54930f32), (array(86, 1), 1.33246), (array(8, 2), 14.3239)] {
            let mut finder = DirectionFinder::new(&positions, WAVELENGTH).unwrap();
            let (count, snr) = (positions.len() as f32, 100.0);
            let bound = finder.error(snr);
            if positions.len() < 90 && finder.rows.len() == 1 {
                // sqrt(6) / (2 pi) beams, up to the finite number of elements.
                let beams = bound[0].to_degrees() / beam;
                assert!((beams / (0.38985 / 10.0) - 1.0).abs() < 0.01, "{beams} beams");
            }
            let (mut sums, draws) = ([0.0f32; 2], 500);
            for draw in 0..draws {
                let rng = Rng::new(8, draw);
                let at = [0.6, 0.6]
                    .map(|widest| widest * (f64::from(rng.uniform_at([draw, 0, 0], Draw::RadarJitter)) - 0.5));
                let at = if finder.measures()[1] { at } else { [at[0], 0.0] };
                let mut channels = wave(&positions, at, Complex32::new(0.0, 1.0));
                noise(&rng, count / snr, &mut channels);
                finder.find(&channels, 1, 0.5, 0.0, &mut waves);
                for axis in 0..2 {
                    sums[axis] += (waves[0].sines[axis] - at[axis] as f32).powi(2);
                }
            }
            for axis in (0..2).filter(|&axis| finder.measures()[axis]) {
                let ratio = (sums[axis] / draws as f32).sqrt() / bound[axis];
                println!(
                    "{count} elements, axis {axis}: {ratio:.3} times the bound of {:.3} deg",
                    bound[axis].to_degrees()
                );
                assert!((0.9..1.15).contains(&ratio), "{count} elements, axis {axis}: {ratio} times the bound");
            }
        }
    }

    #[test]
    fn two_waves_are_told_apart_and_side_lobes_are_no_waves() {
        let mut waves = Vec::new();
        for positions in [array(12, 1), array(86, 1), cascade()] {
            let mut finder = DirectionFinder::new(&positions, WAVELENGTH).unwrap();
            let beam = f64::from(finder.beam[0]);
            for step in 0..20 {
                let at = 0.04 * f64::from(step) - 0.3;
                let strong = wave(&positions, [at, 0.0], Complex32::new(1.0, 0.0));
                // Its side lobes are at -13 dB: above the fraction.
                finder.find(&strong, 3, 0.03, 1e-6, &mut waves);
                assert_eq!(waves.len(), 1, "{waves:?}");
                for (apart, power) in [(1.5, 0.8f32), (2.5, 0.1), (-3.2, 0.06)] {
                    let mut channels = strong.clone();
                    let phase = Complex32::from_polar(power.sqrt(), 2.3 * f64::from(step) as f32);
                    add(&mut channels, &wave(&positions, [at + apart * beam, 0.0], phase));
                    finder.find(&channels, 3, 0.03, 1e-6, &mut waves);
                    assert_eq!(waves.len(), 2, "{apart} beams: {waves:?}");
                    let off = |wave: usize, at: f64| (waves[wave].sines[0] - at as f32).abs() / beam as f32;
                    let off = [off(0, at), off(1, at + apart * beam)];
                    assert!(off[0] < 0.1 && off[1] < 0.15, "{apart} beams, {power}: off by {off:?} beams: {waves:?}");
                    assert!((waves[1].power() / power - 1.0).abs() < 0.5, "{waves:?}");
                    // A second wave below the fraction is none.
                    finder.find(&channels, 3, 0.9, 1e-6, &mut waves);
                    assert_eq!(waves.len(), 1, "{waves:?}");
                }
            }
        }
    }

    #[test]
    fn arrays_that_cannot_be_searched_are_refused() {
        let refused = |positions: &[[f32; 3]]| DirectionFinder::new(positions, WAVELENGTH).err().unwrap().to_string();
        assert_eq!(refused(&[]), "virtual elements is 0; allowed: one or more, at finite places");
        assert!(refused(&[[f32::NAN, 0.0, 0.0]]).contains("finite"));
        let deep = refused(&[[0.0; 3], [0.004, 0.0, 0.0]]);
        assert!(deep.starts_with("array is 1.000 wavelengths deep; allowed: up to an eighth"), "{deep}");
        assert!(refused(&[[0.0; 3], [0.0, 1e5, 0.0]]).contains("up to 1024 wavelengths"));
    }
}
