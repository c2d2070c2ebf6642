//! What a radar records beside its detections: the cube of a frame, the samples of its converters, and the polar image
//! of a rotating one.

use ground::error::{Error, Result};
use ground::pose::Pose;
use radar::{Axis, RadarCube, VirtualArray};

/// dBm of 1 W.
pub(crate) const DBM_OF_WATT: f32 = 30.0;

/// Directions of [`RadarFrame::range_azimuth`], at least.
const DIRECTIONS: usize = 256;

/// A frame of a radar, as files and pictures take it.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RadarFrame {
    /// Its number, from 0.
    pub number: u32,
    /// When it starts, s since the start of the run.
    pub time: f64,
    /// World pose of the radar at that time.
    pub pose: Pose,
    /// Wavelength at the middle of the sampled part of a chirp, m.
    pub wavelength: f64,
    /// Places of the virtual elements, m, one for each channel of the cube: transmitter plus receiver, in the axes of
    /// the radar (x ahead, y left, z up).
    pub elements: Vec<[f64; 3]>,
    /// The cube, if it is wanted.
    pub cube: Option<RadarCube>,
    /// The samples, if they are wanted.
    pub samples: Option<RawSamples>,
    /// The polar image, of a rotating radar.
    pub polar: Option<PolarImage>,
}

/// What the converters of a radar sampled in a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RawSamples {
    /// Numbers of chirps of each transmitter, of transmitters, of receivers, and of samples in a chirp.
    pub shape: [usize; 4],
    /// `[chirp][transmitter][receiver][sample][in phase, in quadrature]`: the order in which a radar sends whose
    /// transmitters take turns. Quadrature is 0 where only one component is sampled.
    pub values: Vec<i16>,
}

/// Levels by azimuth and range: a turn of a rotating radar.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PolarImage {
    /// Ranges of the cells of a row, m.
    pub range: Axis,
    /// Direction of each row, rad, counter-clockwise from ahead; rows are in the order in which they were measured.
    pub azimuths: Vec<f64>,
    /// When each row was measured, s since the start of the run.
    pub times: Vec<f64>,
    /// Power at the receiver, dBm, `[azimuth][range]`.
    pub levels: Vec<f32>,
    /// Level that 8 bits store as 0, dBm.
    pub floor_dbm: f32,
    /// Step of the 8 bits, dB, above 0; 0.5 in Navtech's radars, whose 255 is thus 127.5 dB above the floor.
    pub step_db: f32,
}

impl RadarFrame {
    /// Checks that lengths agree with shapes, and that places and times are finite: they are public, so they may
    /// disagree.
    ///
    /// # Errors
    /// What is wrong, and what is allowed.
    pub fn check(&self) -> Result<()> {
        let finite = self.time.is_finite() && self.pose.position.is_finite() && self.pose.orientation.is_finite();
        if !finite {
            return Err(Error::invalid(
                "radar frame",
                "at a time or pose that is not finite",
                "a finite time and pose",
            ));
        }
        if let Some(RadarCube { axes, channels, cells }) = &self.cube {
            let shape = [*channels, axes.velocity.len, axes.range.len];
            check_axis("range of a cube", axes.range)?;
            check_axis("velocity of a cube", axes.velocity)?;
            check_length("cube", cells.len(), &shape)?;
            check_length("elements of a cube", self.elements.len(), &shape[..1])?;
        }
        if let Some(samples) = &self.samples {
            let [chirps, transmitters, receivers, count] = samples.shape;
            check_length("ADC samples", samples.values.len(), &[chirps, transmitters, receivers, count, 2])?;
        }
        self.polar.as_ref().map_or(Ok(()), PolarImage::check)
    }

    /// Power by azimuth and range in the cube, as a polar image from right to left: by Bartlett's beamformer over the
    /// longest row of the array ([`RadarCube::range_azimuth`]), summed over velocities, mean of a channel. Directions are
    /// equally spaced in the sine of the azimuth, and only those that the spacing of the array tells apart are there.
    /// 8 bits begin at the lowest level.
    ///
    /// # Errors
    /// A frame without a cube, or as [`RadarFrame::check`].
    pub fn range_azimuth(&self) -> Result<PolarImage> {
        self.check()?;
        let without = || Error::invalid(format!("frame {}", self.number), "without a cube", "with a cube");
        let cube = self.cube.as_ref().ok_or_else(without)?;
        let places = self.elements.iter().map(|place| place.map(|part| part as f32)).collect();
        let map = cube.range_azimuth(&VirtualArray { places, wavelength: self.wavelength }, DIRECTIONS);
        let sines = (0..map.sine.len).map(|sine| (sine, map.sine.at(sine as f64)));
        let seen: Vec<(usize, f64)> = sines.filter(|(_, sine)| sine.abs() < 1.0).collect();
        let level = |cell: usize, sine: usize| match map.powers[cell * map.sine.len + sine] {
            power if power > 0.0 => 10.0 * power.log10() + DBM_OF_WATT,
            _ => f32::NAN,
        };
        let cells = seen.iter().flat_map(|&(sine, _)| (0..map.range.len).map(move |cell| (cell, sine)));
        let levels: Vec<f32> = cells.map(|(cell, sine)| level(cell, sine)).collect();
        let floor_dbm = levels.iter().copied().fold(f32::INFINITY, f32::min);
        Ok(PolarImage {
            range: map.range,
            azimuths: seen.iter().map(|(_, sine)| sine.asin()).collect(),
            times: vec![self.time; seen.len()],
            levels,
            floor_dbm: if floor_dbm.is_finite() { floor_dbm } else { 0.0 },
            step_db: 0.5,
        })
    }
}

impl PolarImage {
    /// Checks as [`RadarFrame::check`].
    pub(crate) fn check(&self) -> Result<()> {
        let rows = self.azimuths.len();
        check_axis("range of a polar image", self.range)?;
        check_length("polar image", self.levels.len(), &[rows, self.range.len])?;
        check_length("times of a polar image", self.times.len(), &[rows])?;
        if !self.azimuths.iter().chain(&self.times).all(|number| number.is_finite()) {
            return Err(Error::invalid("polar image", "with azimuths or times that are not finite", "finite ones"));
        }
        if !(self.step_db > 0.0 && self.step_db.is_finite() && self.floor_dbm.is_finite()) {
            let found = format!("{} dB from {} dBm", self.step_db, self.floor_dbm);
            return Err(Error::invalid("steps of a polar image", found, "a step above 0 from a finite level"));
        }
        Ok(())
    }

    /// Levels as 8 bits: 0 at [`PolarImage::floor_dbm`] or below, or where there is none, 255 at 255 steps above or
    /// more.
    pub(crate) fn bytes(&self) -> impl Iterator<Item = u8> {
        // A cast of a float saturates, and makes 0 of NaN.
        self.levels.iter().map(|level| ((level - self.floor_dbm) / self.step_db).round() as u8)
    }
}

fn check_axis(what: &str, Axis { first, step, len }: Axis) -> Result<()> {
    if first.is_finite() && step.is_finite() && step > 0.0 && len > 0 {
        return Ok(());
    }
    let found = format!("{len} cells of {step} from {first}");
    Err(Error::invalid(what, found, "at least one cell, of a length above 0, from a finite place"))
}

fn check_length(what: &str, length: usize, shape: &[usize]) -> Result<()> {
    let cells = shape.iter().try_fold(1_usize, |product, &count| product.checked_mul(count));
    if cells == Some(length) && length > 0 {
        return Ok(());
    }
    let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let allowed = format!("{}, and more than none", shape.join(" x "));
    Err(Error::invalid(what, format!("{length} numbers"), allowed))
}

/// Frames for tests.
#[cfg(test)]
pub mod made {
    use super::*;
    use num_complex::Complex32;
    use radar::CubeAxes;
    use std::f64::consts::TAU;

    /// Of 3 channels, 4 velocities and 8 ranges, with samples and a turn of 6 rows of 10 cells; every number differs.
    pub fn frame() -> RadarFrame {
        let axes = CubeAxes {
            range: Axis { first: 0.0, step: 0.5, len: 8 },
            velocity: Axis { first: -2.0, step: 1.0, len: 4 },
        };
        let cells = (0..96).map(|cell| Complex32::new(cell as f32, -0.5 * cell as f32)).collect();
        RadarFrame {
            number: 7,
            time: 12.25,
            pose: Pose::at(1.0, 2.0, 3.0).with_quaternion(0.0, 0.0, 0.6, 0.8),
            wavelength: 3.893_409e-3,
            elements: vec![[0.0; 3], [0.0, 0.002, 0.0], [0.0, 0.004, 0.001]],
            cube: Some(RadarCube { axes, channels: 3, cells }),
            samples: Some(RawSamples {
                shape: [3, 2, 2, 4],
                values: (0..96).map(|value| value * 300 - 14_000).collect(),
            }),
            polar: Some(turn(6, 10)),
        }
    }

    /// A turn to the left, from 30 degrees on the left: levels rise by 0.5 dB from cell to cell.
    pub fn turn(rows: usize, cells: usize) -> PolarImage {
        let turned = |row: usize| TAU * row as f64 / rows as f64;
        PolarImage {
            range: Axis { first: 0.0, step: 0.0432, len: cells },
            azimuths: (0..rows).map(|row| TAU / 12.0 + turned(row)).collect(),
            times: (0..rows).map(|row| 100.0 + 0.25 * row as f64 / rows as f64).collect(),
            levels: (0..rows * cells).map(|cell| -120.0 + 0.5 * (cell % 300) as f32).collect(),
            floor_dbm: -120.0,
            step_db: 0.5,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_whose_lengths_disagree_are_refused() {
        made::frame().check().unwrap();
        RadarFrame::default().check().unwrap();
        let refused = |change: &dyn Fn(&mut RadarFrame)| {
            let mut bad = made::frame();
            change(&mut bad);
            bad.check().unwrap_err().to_string()
        };
        let lost = refused(&|bad| bad.cube.as_mut().unwrap().cells.truncate(95));
        assert_eq!(lost, "cube is 95 numbers; allowed: 3 x 4 x 8, and more than none");
        assert!(refused(&|bad| bad.cube.as_mut().unwrap().channels = usize::MAX).contains("cube is 96 numbers"));
        assert!(
            refused(&|bad| bad.cube.as_mut().unwrap().axes.velocity.step = 0.0).starts_with("velocity of a cube is")
        );
        assert!(refused(&|bad| bad.elements.clear()).starts_with("elements of a cube is 0 numbers"));
        assert!(refused(&|bad| bad.samples.as_mut().unwrap().shape[0] = 2).starts_with("ADC samples is 96 numbers"));
        assert!(refused(&|bad| bad.polar.as_mut().unwrap().times[1] = f64::NAN).contains("finite"));
        assert!(refused(&|bad| bad.polar.as_mut().unwrap().step_db = 0.0).contains("a step above 0"));
        assert!(refused(&|bad| bad.pose.position.z = f64::INFINITY).contains("a finite time and pose"));
    }

    #[test]
    fn power_comes_from_the_direction_of_the_target() {
        use num_complex::Complex32;
        // Eight channels half a wavelength apart, a target 20 degrees to the left, at 1.5 m: e^{j k y sin(azimuth)}.
        let mut frame = made::frame();
        let spacing = 0.5 * frame.wavelength;
        frame.elements = (0..8).map(|channel| [0.0, spacing * f64::from(channel), 0.0]).collect();
        let cube = frame.cube.as_mut().unwrap();
        (cube.channels, cube.cells) = (8, vec![Complex32::ZERO; 8 * 32]);
        for channel in 0..8 {
            let phase = std::f32::consts::PI * channel as f32 * 20_f32.to_radians().sin();
            cube.cells[channel * 32 + 8 + 3] = Complex32::from_polar(1e-6, phase);
        }
        let image = frame.range_azimuth().unwrap();
        image.check().unwrap();
        assert!(image.azimuths.windows(2).all(|pair| pair[0] < pair[1]));
        let strongest = (0..image.levels.len()).filter(|&cell| image.levels[cell].is_finite());
        let strongest = strongest.max_by(|&a, &b| image.levels[a].total_cmp(&image.levels[b])).unwrap();
        assert!((image.azimuths[strongest / 8].to_degrees() - 20.0).abs() < 0.5);
        assert_eq!(image.range.at((strongest % 8) as f64), 1.5);
        // (1e-6)^2 W is -90 dBm.
        assert!((image.levels[strongest] + 90.0).abs() < 0.05, "{}", image.levels[strongest]);
        frame.cube = None;
        assert_eq!(frame.range_azimuth().unwrap_err().to_string(), "frame 7 is without a cube; allowed: with a cube");
    }

    #[test]
    fn levels_beyond_8_bits_are_clamped() {
        let mut image = made::turn(1, 6);
        image.levels = vec![f32::NAN, -200.0, -120.0, -119.8, -60.0, 100.0];
        assert_eq!(image.bytes().collect::<Vec<_>>(), [0, 0, 0, 0, 120, 255]);
    }
}
