//! Polar images of rotating radars in the layouts of data sets: PNG of 8 bits.
//!
//! Oxford Radar RobotCar (Barnes et al. 2020; `python/radar.py` of its SDK) and Boreas (Burnett et al. 2023;
//! `pyboreas/utils/radar.py`): a row for each azimuth, which begins with bytes 0 to 7, the time in us, 8 and 9, the
//! encoder, both little endian, and 10, 255 if the row was measured; levels follow. MulRan (Kim et al. 2020; its file
//! player, and RadaRays, which shows its own images beside them): levels alone, a column for each azimuth, the nearest
//! range at the top. All count azimuths clockwise from ahead.

use super::pixels::Png;
use crate::{PolarImage, RadarFrame};
use ground::error::{Error, Result};
use ground::named;
use ground::report::Report;
use ground::write::{self, Pending, failed};
use serde::Deserialize;
use std::f64::consts::TAU;
use std::fs;
use std::path::PathBuf;

/// A data set whose layout polar images have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum PolarStyle {
    /// Oxford Radar RobotCar: `radar/TIME.png` and `radar.timestamps`, in us; the time is that of the first row
    /// measured.
    Oxford,
    /// Boreas: `radar/TIME.png`, in us; of M rows measured the time is that of number `M / 2 - 1`, from 0.
    Boreas,
    /// `MulRan`: `sensor_data/radar/polar/TIME.png` and `sensor_data/data_stamp.csv`, in ns; the time is that of the
    /// first row measured.
    Mulran,
}

named! { PolarStyle: Oxford "oxford", Boreas "boreas", Mulran "mulran" }

/// Counts of the encoder in a turn of Navtech's radars.
const ENCODER: f64 = 5600.0;

/// Bytes in front of the levels of a row: time, encoder, and whether it was measured.
const HEAD: usize = 8 + 2 + 1;

/// Tolerated difference between the length of cells and that which readers assume, as a fraction.
const SAME_LENGTH: f64 = 1e-3;

impl PolarStyle {
    /// Folder of the images.
    fn folder(self) -> &'static str {
        match self {
            PolarStyle::Oxford | PolarStyle::Boreas => "radar",
            PolarStyle::Mulran => "sensor_data/radar/polar",
        }
    }

    /// Units of time in a second.
    fn units(self) -> f64 {
        match self {
            PolarStyle::Oxford | PolarStyle::Boreas => 1e6,
            PolarStyle::Mulran => 1e9,
        }
    }

    /// Length of cells that readers assume, m: the files do not say it. Boreas changed it in September 2021; times of
    /// runs are before that.
    fn cell_m(self) -> Option<f64> {
        match self {
            PolarStyle::Oxford => Some(0.0432),
            PolarStyle::Boreas => Some(0.0596),
            PolarStyle::Mulran => None,
        }
    }

    /// The time that names an image.
    fn stamp(self, image: &PolarImage) -> i64 {
        let row = match self {
            PolarStyle::Boreas => (image.times.len() / 2).saturating_sub(1),
            PolarStyle::Oxford | PolarStyle::Mulran => 0,
        };
        (image.times[row] * self.units()).round() as i64
    }
}

/// A folder of polar images in the layout of a data set.
#[derive(Debug)]
pub struct PolarFolder {
    folder: PathBuf,
    style: PolarStyle,
    stamps: Vec<i64>,
    files: Vec<PathBuf>,
}

impl PolarFolder {
    /// Begins a folder, which is made if it does not exist.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn create(folder: impl Into<PathBuf>, style: PolarStyle) -> Result<PolarFolder> {
        let folder = folder.into();
        let images = folder.join(style.folder());
        fs::create_dir_all(&images).map_err(|source| Error::io(&images, source))?;
        Ok(PolarFolder { folder, style, stamps: Vec::new(), files: Vec::new() })
    }

    /// Adds the polar image of `frame`. It is reported if readers of the data set assume cells of another length.
    ///
    /// # Errors
    /// A frame without a polar image, or as [`RadarFrame::check`]; one that is not after the last, or before the run
    /// starts; a full disk.
    pub fn add(&mut self, frame: &RadarFrame) -> Result<Report> {
        let mut report = Report::default();
        frame.check()?;
        let image = frame.polar.as_ref().ok_or_else(|| {
            Error::invalid("polar image", format!("missing in frame {}", frame.number), "frames of a rotating radar")
        })?;
        let stamp = self.style.stamp(image);
        let least = self.stamps.last().map_or(0, |last| last + 1);
        if stamp < least {
            let units = self.style.units();
            let allowed = format!("{} s or later, after the image before", least as f64 / units);
            return Err(Error::invalid("time of a polar image", format!("{} s", stamp as f64 / units), allowed));
        }
        if let Some(assumed) = self.style.cell_m()
            && (image.range.step / assumed - 1.0).abs() > SAME_LENGTH
        {
            report.warn(format!(
                "{}: cells are {} m long, and readers of the data set assume {assumed} m",
                self.style.name(),
                image.range.step
            ));
        }
        let path = self.folder.join(self.style.folder()).join(format!("{stamp}.png"));
        let (size, bytes) = match self.style {
            PolarStyle::Oxford | PolarStyle::Boreas => rows(image),
            PolarStyle::Mulran => columns(image),
        };
        let texts = vec![
            ("quantity".to_owned(), "power at the receiver".to_owned()),
            ("levels".to_owned(), format!("0 = {} dBm or less, {} dB a step", image.floor_dbm, image.step_db)),
            ("range".to_owned(), format!("{} + {} * cell (m)", image.range.first, image.range.step)),
        ];
        let (color, depth) = (png::ColorType::Grayscale, png::BitDepth::Eight);
        let file = Pending::create(&path)?;
        let png = Png { size, color, depth, palette: None, texts, fast: false };
        png.write(file.path(), &bytes).map_err(|source| failed(&path, source))?;
        file.commit()?;
        self.stamps.push(stamp);
        self.files.push(path);
        Ok(report)
    }

    /// Writes the list of images, if the data set has one. Returns every file of the folder that was written.
    ///
    /// # Errors
    /// A full disk.
    pub fn finish(mut self) -> Result<Vec<PathBuf>> {
        let (name, after) = match self.style {
            // All images are in chunk 1.
            PolarStyle::Oxford => ("radar.timestamps", " 1\n"),
            PolarStyle::Mulran => ("sensor_data/data_stamp.csv", ",radar\n"),
            PolarStyle::Boreas => return Ok(self.files),
        };
        let text: String = self.stamps.iter().map(|stamp| format!("{stamp}{after}")).collect();
        let path = self.folder.join(name);
        write::whole(&path, text.as_bytes())?;
        self.files.push(path);
        Ok(self.files)
    }
}

/// The encoder at `azimuth`, rad, counter-clockwise: it counts clockwise from ahead.
fn encoder(azimuth: f64) -> u16 {
    ((-azimuth / TAU).rem_euclid(1.0) * ENCODER).round() as u16 % ENCODER as u16
}

/// Rows of `image` by ascending encoder, as readers expect them, each with its encoder.
fn clockwise(image: &PolarImage) -> Vec<(u16, usize)> {
    let mut order: Vec<(u16, usize)> =
        (0..).zip(&image.azimuths).map(|(row, &azimuth)| (encoder(azimuth), row)).collect();
    order.sort_unstable();
    order
}

/// Width, height and pixels of an image with a row for each azimuth.
fn rows(image: &PolarImage) -> ([usize; 2], Vec<u8>) {
    let (levels, cells) = (image.bytes().collect::<Vec<u8>>(), image.range.len);
    let width = HEAD + cells;
    let mut bytes = Vec::with_capacity(width * image.azimuths.len());
    for (encoder, row) in clockwise(image) {
        bytes.extend(((image.times[row] * 1e6).round() as i64).to_le_bytes());
        bytes.extend(encoder.to_le_bytes());
        bytes.push(u8::MAX);
        bytes.extend(&levels[row * cells..][..cells]);
    }
    ([width, image.azimuths.len()], bytes)
}

/// Width, height and pixels of an image with a column for each azimuth.
fn columns(image: &PolarImage) -> ([usize; 2], Vec<u8>) {
    let (levels, cells) = (image.bytes().collect::<Vec<u8>>(), image.range.len);
    let order = clockwise(image);
    let bytes = (0..cells).flat_map(|cell| order.iter().map(move |(_, row)| (cell, *row)));
    ([order.len(), cells], bytes.map(|(cell, row)| levels[row * cells + cell]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::radar_frame::made;

    fn frame(image: PolarImage) -> RadarFrame {
        RadarFrame { polar: Some(image), ..RadarFrame::default() }
    }

    #[test]
    fn the_encoder_counts_clockwise() {
        let at = |degrees: f64| encoder(degrees.to_radians());
        assert_eq!([at(0.0), at(-0.9), at(-90.0), at(90.0), at(360.0), at(1e-9)], [0, 14, 1400, 4200, 0, 0]);
    }

    #[test]
    fn images_are_in_the_order_of_their_times() {
        let folder = tempfile::tempdir().unwrap();
        let mut polar = PolarFolder::create(folder.path(), PolarStyle::Boreas).unwrap();
        let mut image = made::turn(6, 10);
        let report = polar.add(&frame(image.clone())).unwrap();
        let expected = "boreas: cells are 0.0432 m long, and readers of the data set assume 0.0596 m";
        assert_eq!(report.warnings, [expected]);
        let error = polar.add(&frame(image.clone())).unwrap_err().to_string();
        assert!(error.starts_with("time of a polar image is 100.083333 s; allowed: 100.083334 s or later"), "{error}");
        image.times.iter_mut().for_each(|time| *time += 0.25);
        image.range.step = 0.0596;
        assert!(polar.add(&frame(image.clone())).unwrap().warnings.is_empty());
        assert!(polar.add(&RadarFrame::default()).unwrap_err().to_string().contains("missing in frame 0"));
        image.levels.pop();
        assert!(polar.add(&frame(image)).is_err());
        let names = ["radar/100083333.png", "radar/100333333.png"].map(|name| folder.path().join(name));
        assert_eq!(polar.finish().unwrap(), names);
    }
}
