//! Frames of a radar to files: cubes, samples and polar images as arrays, and samples as a capture card stores them.

use super::arrays::{ArrayFile, into_arrays, into_file};
use crate::{Column, PolarImage, RadarFrame, RawSamples};
use ground::error::{Error, Result};
use ground::read::ending;
use ground::report::Report;
use ground::shown;
use ground::write::{Pending, Sink};
use radar::{Axis, RadarCube};
use std::io::{self, Write as _};
use std::path::Path;

/// Endings of files of a frame: of arrays, and of a capture card.
const FRAMES: &[&str] = &["npz", "h5", "hdf5", "bin"];

/// Checks, before a long scan, whether a frame of a radar can be written to `path`.
///
/// # Errors
/// An ending of no format for frames; a missing folder or one that cannot be written to.
pub fn check_radar_frame(path: &Path) -> Result<()> {
    check_ending(path)?;
    Pending::create(path).map(drop)
}

fn check_ending(path: &Path) -> Result<()> {
    super::arrays::check_ending(path, "frames of radars", FRAMES)
}

impl RadarFrame {
    /// Writes the frame to `path`: everything as NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`), or its samples alone in the
    /// layout of TI's capture card DCA1000 for radars with two LVDS lanes, xWR16xx and xWR18xx (`.bin`). The file
    /// appears under its name only when it is complete.
    ///
    /// Arrays are `cube`, complex, channels x velocities x ranges, with the axes `velocity_m_s` (positive: receding)
    /// and `range_m` and the places of the channels in `element_position`; `adc`, 16 bits with a sign, chirps x
    /// transmitters x receivers x samples x 2 (in phase, in quadrature), so that `adc.reshape(chirps, -1, samples, 2)`
    /// is slow time x antenna x fast time as in RaDICaL; and `polar_dbm`, azimuths x ranges, with `polar_azimuth`,
    /// `polar_time` and `polar_range_m`. What the frame does not have is not in the file.
    ///
    /// # Errors
    /// As [`check_radar_frame`] and [`RadarFrame::check`]; a `.bin` without samples, or with an odd number of them in a
    /// chirp; no memory; a full disk.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<Report> {
        let path = path.as_ref();
        check_ending(path)?;
        self.check()?;
        if ending(path) != "bin" {
            return into_arrays(path, |file, _| write_arrays(file, self));
        }
        let samples = self.samples.as_ref().filter(|samples| samples.shape[3] % 2 == 0).ok_or_else(|| {
            let found = self
                .samples
                .as_ref()
                .map_or("without samples".to_owned(), |samples| format!("of {} samples in a chirp", samples.shape[3]));
            Error::invalid(shown::path(path), found, "an even number of samples in a chirp")
        })?;
        into_file(path, |file, _| write_capture(samples, file.path()))
    }
}

fn write_arrays(file: &mut ArrayFile, frame: &RadarFrame) -> io::Result<()> {
    file.add(["number", "", "number of the frame"], &[], Column::U32(&[frame.number]))?;
    file.add(["time", "s", "start of the frame since the start of the run"], &[], Column::F64(&[frame.time]))?;
    let about = ["wavelength_m", "m", "wavelength at the middle of the sampled part of a chirp"];
    file.add(about, &[], Column::F64(&[frame.wavelength]))?;
    let position = frame.pose.position.to_array();
    file.add(["sensor_position", "m", "position of the radar, world"], &[3], Column::F64(&position))?;
    let about = ["sensor_orientation_xyzw", "1", "rotation from radar to world, quaternion"];
    file.add(about, &[4], Column::F64(&frame.pose.orientation.to_array()))?;
    if let Some(cube) = &frame.cube {
        write_cube(file, cube, &frame.elements)?;
    }
    if let Some(RawSamples { shape: [chirps, transmitters, receivers, count], values }) = &frame.samples {
        let about = ["adc", "", "samples: chirp x transmitter x receiver x sample x (in phase, in quadrature)"];
        file.signed(about, &[*chirps, *transmitters, *receivers, *count, 2], values)?;
    }
    frame.polar.as_ref().map_or(Ok(()), |image| write_polar(file, image))
}

fn write_cube(file: &mut ArrayFile, cube: &RadarCube, elements: &[[f64; 3]]) -> io::Result<()> {
    let RadarCube { axes, channels, cells } = cube;
    let about = ["cube", "sqrt(W)", "amplitude at the receiver: channel x velocity x range"];
    file.complex(about, &[*channels, axes.velocity.len, axes.range.len], cells)?;
    let about = ["velocity_m_s", "m/s", "rate of the range of each velocity cell, positive: receding"];
    file.add(about, &[axes.velocity.len], Column::F64(&places(axes.velocity)))?;
    file.add(["range_m", "m", "range of each range cell"], &[axes.range.len], Column::F64(&places(axes.range)))?;
    let about = ["element_position", "m", "virtual element of each channel: x ahead, y left, z up"];
    file.add(about, &[elements.len(), 3], Column::F64(elements.as_flattened()))
}

fn write_polar(file: &mut ArrayFile, image: &PolarImage) -> io::Result<()> {
    let rows = image.azimuths.len();
    let about = ["polar_dbm", "dBm", "power at the receiver: azimuth x range"];
    file.add(about, &[rows, image.range.len], Column::F32(&image.levels))?;
    let about = ["polar_azimuth", "rad", "direction of each row, counter-clockwise from ahead"];
    file.add(about, &[rows], Column::F64(&image.azimuths))?;
    let about = ["polar_time", "s", "when each row was measured, since the start of the run"];
    file.add(about, &[rows], Column::F64(&image.times))?;
    let about = ["polar_range_m", "m", "range of each cell of a row"];
    file.add(about, &[image.range.len], Column::F64(&places(image.range)))
}

/// Places of all cells of `axis`.
fn places(axis: Axis) -> Vec<f64> {
    (0..axis.len).map(|cell| axis.at(cell as f64)).collect()
}

/// Complex samples of radars with two LVDS lanes (TI, SWRA581B, "Mmwave Radar Device ADC Raw Data Capture Using the
/// DCA1000"): chirp after chirp, receiver after receiver; two samples are two in phase, then two in quadrature; 16
/// bits, little endian.
fn write_capture(samples: &RawSamples, path: &Path) -> io::Result<()> {
    /// Numbers that are turned into bytes together.
    const PIECE: usize = 1 << 16;
    let mut file = Sink::create(path)?;
    let mut bytes = Vec::with_capacity(2 * PIECE);
    for piece in samples.values.chunks(PIECE) {
        bytes.clear();
        for pair in piece.chunks_exact(4) {
            bytes.extend([pair[0], pair[2], pair[1], pair[3]].iter().flat_map(|value| value.to_le_bytes()));
        }
        file.write_all(&bytes)?;
    }
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::radar_frame::made;

    #[test]
    fn two_samples_in_phase_precede_two_in_quadrature() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("adc.bin");
        let mut frame = made::frame();
        frame.samples = Some(RawSamples { shape: [1, 1, 2, 2], values: vec![1, -1, 2, -2, 300, -300, 4, -4] });
        frame.write(&path).unwrap();
        let words: Vec<i16> =
            std::fs::read(&path).unwrap().chunks(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]])).collect();
        assert_eq!(words, [1, 2, -1, -2, 300, 4, -300, -4]);
    }

    #[test]
    fn what_a_capture_card_cannot_hold_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |frame: &RadarFrame, name: &str| {
            let error = frame.write(folder.path().join(name)).unwrap_err().to_string();
            error.split(name).nth(1).unwrap_or_default().to_owned()
        };
        let mut odd = made::frame();
        odd.samples = Some(RawSamples { shape: [1, 1, 2, 1], values: vec![0; 4] });
        let allowed = "allowed: an even number of samples in a chirp";
        assert_eq!(refused(&odd, "a.bin"), format!(" is of 1 samples in a chirp; {allowed}"));
        odd.samples = None;
        assert_eq!(refused(&odd, "a.bin"), format!(" is without samples; {allowed}"));
        assert!(refused(&odd, "a.las").ends_with("frames of radars are written as .npz, .h5, .hdf5, .bin"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(check_radar_frame(&folder.path().join("none/a.npz")).is_err());
        check_radar_frame(&folder.path().join("a.NPZ")).unwrap();
    }
}
