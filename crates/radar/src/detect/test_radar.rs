//! Cubes with a few targets in noise, for tests.

use super::{CubeGeometry, Detector, RadarDetectionSpec, RadarDetections, WindowResponse};
use crate::cube::{Axis, CubeAxes, RadarCube};
use ground::read::bounds::Bounds;
use ground::rng::{Draw, Rng};
use rustfft::num_complex::Complex32;
use std::f64::consts::TAU;

pub const WAVELENGTH: f64 = 0.0039;
pub const CELLS: [usize; 2] = [64, 32];

/// A radar with Hann windows.
pub struct TestRadar {
    pub responses: [WindowResponse; 2],
    pub axes: CubeAxes,
    pub positions: Vec<[f32; 3]>,
    pub slots: Vec<f32>,
}

/// A target at fractions of cells, in a direction given by its sines.
#[derive(Clone, Copy)]
pub struct TestTarget {
    pub range: f64,
    pub velocity: f64,
    pub sines: [f64; 2],
    pub amplitude: f32,
    pub phase: f32,
}

pub const TARGET: TestTarget =
    TestTarget { range: 20.3, velocity: 17.8, sines: [0.2, 0.0], amplitude: 1.0, phase: 0.7 };

fn hann(len: usize) -> Vec<f64> {
    (0..len).map(|n| 0.5 - 0.5 * (TAU * n as f64 / len as f64).cos()).collect()
}

impl TestRadar {
    /// `transmitters` that take turns, each moved by the whole row of `receivers`, in `rows` rows.
    pub fn new(transmitters: usize, receivers: usize, rows: usize) -> Self {
        let half = 0.5 * WAVELENGTH as f32;
        let period = 60e-6;
        let mut radar = TestRadar {
            responses: CELLS.map(|cells| WindowResponse::new(&hann(cells), cells)),
            axes: CubeAxes::default(),
            positions: Vec::new(),
            slots: Vec::new(),
        };
        for transmitter in 0..transmitters {
            for receiver in 0..receivers * rows {
                let column = transmitter * receivers + receiver % receivers;
                radar.positions.push([0.0, half * column as f32, half * (receiver / receivers) as f32]);
                radar.slots.push((period * transmitter as f64 / transmitters as f64) as f32);
            }
        }
        let step = WAVELENGTH / (2.0 * period * CELLS[1] as f64);
        radar.axes.range = Axis { first: 0.0, step: 0.2, len: CELLS[0] };
        radar.axes.velocity = Axis { first: -step * (CELLS[1] / 2) as f64, step, len: CELLS[1] };
        radar
    }

    pub fn geometry(&self) -> CubeGeometry<'_> {
        CubeGeometry {
            axes: self.axes,
            responses: self.responses.each_ref(),
            positions: &self.positions,
            wavelength: WAVELENGTH,
            slots: &self.slots,
        }
    }

    /// The cube that an FFT of Hann-weighted samples gives, phases as of their middle.
    pub fn cube(&self, targets: &[TestTarget], noise: f32, frame: u32) -> RadarCube {
        let (ranges, velocities) = (CELLS[0], CELLS[1]);
        let mut cube = RadarCube {
            axes: self.axes,
            channels: self.positions.len(),
            cells: vec![Complex32::default(); ranges * velocities * self.positions.len()],
        };
        for (channel, cells) in cube.cells.chunks_exact_mut(ranges * velocities).enumerate() {
            let (mut re, mut im) = (vec![0.0; cells.len()], vec![0.0; cells.len()]);
            Rng::new(4, frame).cell_phasors(channel as u32, Draw::RadarNoise, &mut re, &mut im);
            for (cell, value) in cells.iter_mut().enumerate() {
                *value = noise.sqrt() * Complex32::new(re[cell], im[cell]);
            }
            for target in targets {
                let at = self.positions[channel];
                let speed = self.axes.velocity.at(target.velocity);
                let turns = (f64::from(at[1]) * target.sines[0] + f64::from(at[2]) * target.sines[1]
                    - 2.0 * speed * f64::from(self.slots[channel]))
                    / WAVELENGTH;
                let channel = Complex32::from_polar(target.amplitude, (TAU * turns) as f32 + target.phase);
                let [range, velocity] = [(target.range, ranges), (target.velocity, velocities)]
                    .map(|(at, len)| (0..len).map(|cell| line(cell as f64 - at, len)).collect::<Vec<_>>());
                for (cell, value) in cells.iter_mut().enumerate() {
                    *value += channel * range[cell % ranges] * velocity[cell / ranges];
                }
            }
        }
        cube
    }

    pub fn detect(&self, spec: &RadarDetectionSpec, targets: &[TestTarget], noise: f32, frame: u32) -> RadarDetections {
        spec.check("detection", &mut Bounds::none()).unwrap();
        let mut detections = RadarDetections::default();
        let mut detector = Detector::new(spec, self.geometry()).unwrap();
        detector.run(&self.cube(targets, noise, frame), noise, &mut detections).unwrap();
        detections
    }
}

/// Transform of a Hann window of `len` samples at a distance of `cells`, its phase that of the middle: half of a
/// cosine's weights on both sides of a sum of equal phasors.
pub fn line(cells: f64, len: usize) -> f32 {
    let equal = |cells: f64| {
        let angle = std::f64::consts::PI * cells;
        let sine = (angle / len as f64).sin();
        if sine.abs() < 1e-12 { angle.cos().signum() } else { angle.sin() / (len as f64 * sine) }
    };
    // The neighbours' phases, as of sample len / 2 rather than of the middle, are opposite.
    (equal(cells) + 0.5 * (equal(cells - 1.0) + equal(cells + 1.0))) as f32
}
