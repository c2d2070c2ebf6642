//! Height maps: PNG, GeoTIFF and ESRI ASCII grids.

use super::HeightMap;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use std::collections::VecDeque;
use std::io::Cursor;
use std::path::Path;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

/// Maximum number of samples of a height map.
pub(super) const MOST_SAMPLES: usize = 25_000_000;
/// Heights beyond this are invalid, m.
const HIGHEST: f32 = 100_000.0;

/// Heights as read from a file.
#[derive(Debug)]
pub(super) struct HeightRaster {
    pub columns: usize,
    /// From south to north, each from west to east, m.
    pub heights: Vec<f32>,
    /// Spacing of samples along x and y, m, if the file gives it.
    pub step: Option<[f64; 2]>,
    /// Number of samples that had no height and took that of a neighbour.
    pub filled: usize,
}

impl HeightRaster {
    /// Reads a height map.
    ///
    /// # Errors
    /// A file that cannot be read, is of another kind or damaged, too large or without heights; a missing range.
    pub fn read(map: &HeightMap) -> Result<HeightRaster> {
        let path = map.file.as_path();
        let bytes = read::bytes(path, Limit::IMAGE)?;
        let fault = |message: String| Error::parse(path, "", message);
        let (raster, ranged) = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            let Some([low, high]) = map.range_m else {
                return Err(Error::invalid(
                    "height_map.range_m",
                    "missing",
                    "the heights of black and white, since a PNG does not contain them",
                ));
            };
            if !(low.is_finite() && high.is_finite() && low.abs().max(high.abs()) <= HIGHEST.into() && low < high) {
                return Err(Error::invalid("height_map.range_m", format!("{low},{high}"), "two numbers that rise"));
            }
            (of_png(&bytes, [low, high]).map_err(fault)?, true)
        } else if bytes.starts_with(b"II") || bytes.starts_with(b"MM") {
            (of_tiff(&bytes).map_err(fault)?, false)
        } else if is_grid(&bytes) {
            (of_grid(&bytes, path)?, false)
        } else {
            let allowed = "a PNG of 16 bits, a GeoTIFF, or an ESRI ASCII grid that begins with ncols";
            return Err(fault(format!("not a height map; allowed: {allowed}")));
        };
        if map.range_m.is_some() && !ranged {
            let kinds = "none, since this file holds heights in metres";
            return Err(Error::invalid("height_map.range_m", "given", kinds));
        }
        raster.checked().map_err(fault)
    }

    pub fn rows(&self) -> usize {
        self.heights.len() / self.columns
    }

    /// Fills samples without a height (NaN), and checks all others.
    fn checked(mut self) -> Result<HeightRaster, String> {
        let (columns, rows) = (self.columns, self.rows());
        if columns < 2 || rows < 2 {
            return Err(format!("{columns} x {rows} samples; allowed: 2 x 2 or more"));
        }
        if let Some([x, y]) = self.step
            && !([x, y].iter().all(|step| (1e-3..=1e5).contains(step)))
        {
            return Err(format!("{x} x {y} m from sample to sample; allowed: 0.001 to 100000"));
        }
        let wrong = |&&height: &&f32| !height.is_nan() && height.abs() > HIGHEST;
        if let Some(height) = self.heights.iter().find(wrong) {
            return Err(format!("a height of {height} m; allowed: -{HIGHEST} to {HIGHEST}"));
        }
        let known = |&sample: &usize| !self.heights[sample].is_nan();
        let mut shore: VecDeque<usize> = (0..self.heights.len()).filter(known).collect();
        if shore.is_empty() {
            return Err("no sample has a height; allowed: at least one".into());
        }
        self.filled = self.heights.len() - shore.len();
        if self.filled > 0 {
            while let Some(sample) = shore.pop_front() {
                let (column, row) = (sample % columns, sample / columns);
                let sides = [
                    (column > 0).then(|| sample - 1),
                    (column + 1 < columns).then_some(sample + 1),
                    (row > 0).then(|| sample - columns),
                    (row + 1 < rows).then_some(sample + columns),
                ];
                for next in sides.into_iter().flatten() {
                    if self.heights[next].is_nan() {
                        self.heights[next] = self.heights[sample];
                        shore.push_back(next);
                    }
                }
            }
        }
        Ok(self)
    }

    /// The height at a position, 0 to 1 along each side, linear between the samples.
    pub fn at(&self, along: [f64; 2]) -> f64 {
        let last = [self.columns - 1, self.rows() - 1];
        let split = |axis: usize| {
            let place = (along[axis] * last[axis] as f64).clamp(0.0, last[axis] as f64);
            // Grid points that rounding has moved slightly off their sample still have its height.
            let place = if (place - place.round()).abs() < 1e-6 { place.round() } else { place };
            let first = (place as usize).min(last[axis] - 1);
            (first, place - first as f64)
        };
        let ((column, across), (row, up)) = (split(0), split(1));
        let sample = |i: usize, j: usize| f64::from(self.heights[(row + j) * self.columns + column + i]);
        let along = |j: usize| sample(0, j) * (1.0 - across) + sample(1, j) * across;
        along(0) * (1.0 - up) + along(1) * up
    }
}

/// An error if there are too many samples.
fn counted(columns: u64, rows: u64) -> Result<usize, String> {
    match columns.checked_mul(rows).filter(|&samples| samples <= MOST_SAMPLES as u64) {
        Some(samples) => Ok(samples as usize),
        None => Err(format!("{columns} x {rows} samples; allowed: {MOST_SAMPLES} in all")),
    }
}

/// Rows in the order of [`HeightRaster`], from those of a file, which begin in the north.
fn from_north(columns: usize, heights: &[f32]) -> Vec<f32> {
    heights.chunks(columns).rev().flatten().copied().collect()
}

fn of_png(bytes: &[u8], [low, high]: [f64; 2]) -> Result<HeightRaster, String> {
    let damaged = |_| "it is damaged or cut off".to_owned();
    let reader = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: 64 << 20 });
    let mut reader = reader.read_info().map_err(damaged)?;
    let (columns, rows) = reader.info().size();
    let found = reader.output_color_type();
    if found != (png::ColorType::Grayscale, png::BitDepth::Sixteen) {
        let (channels, bits) = (found.0.samples(), found.1 as u8);
        return Err(format!("a PNG of {channels} x {bits} bits a pixel; allowed: 1 x 16 bits, grey"));
    }
    let samples = counted(columns.into(), rows.into())?;
    let mut pixels = vec![0; 2 * samples];
    reader.next_frame(&mut pixels).map_err(damaged)?;
    let height = |pixel: &[u8]| {
        let part = f64::from(u16::from_be_bytes([pixel[0], pixel[1]])) / f64::from(u16::MAX);
        (low + part * (high - low)) as f32
    };
    let heights: Vec<f32> = pixels.chunks_exact(2).map(height).collect();
    let columns = columns as usize;
    Ok(HeightRaster { columns, heights: from_north(columns, &heights), step: None, filled: 0 })
}

fn of_tiff(bytes: &[u8]) -> Result<HeightRaster, String> {
    /// Keys of the directory of a GeoTIFF (OGC 19-008r4): kind of coordinates, and the value for degrees.
    const MODEL_TYPE: u16 = 1024;
    const GEOGRAPHIC: u16 = 2;
    let broken = |error: TiffError| match error {
        TiffError::UnsupportedError(_) => "a TIFF of a kind that is not supported; allowed: one channel of numbers, \
                                           not compressed or with LZW or Deflate"
            .to_owned(),
        TiffError::LimitsExceeded => "a TIFF that needs too much memory".to_owned(),
        _ => "a damaged TIFF".to_owned(),
    };
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(broken)?;
    let (columns, rows) = decoder.dimensions().map_err(broken)?;
    let samples = counted(columns.into(), rows.into())?;
    match decoder.colortype().map_err(broken)? {
        ColorType::Gray(_) | ColorType::Multiband { num_samples: 1, .. } => {}
        ColorType::Palette(_) => return Err("a TIFF with a palette; allowed: one channel of numbers".into()),
        other => {
            return Err(format!("a TIFF of {} channels; allowed: one channel of numbers", other.num_samples()));
        }
    }
    let scale = decoder.find_tag(Tag::ModelPixelScaleTag).map_err(broken)?;
    let scale = scale.map(|value| value.into_f64_vec()).transpose().map_err(broken)?;
    let step = match scale.as_deref() {
        Some(&[x, y, ..]) => Some([x, y]),
        Some(_) => return Err("a ModelPixelScale of less than two numbers; allowed: three".into()),
        None => None,
    };
    let keys = decoder.find_tag(Tag::GeoKeyDirectoryTag).map_err(broken)?;
    let keys = keys.map(|value| value.into_u16_vec()).transpose().map_err(broken)?.unwrap_or_default();
    if keys.chunks_exact(4).skip(1).any(|key| key[0] == MODEL_TYPE && key[1] == 0 && key[3] == GEOGRAPHIC) {
        return Err("its coordinates are in degrees; allowed: metres (gdalwarp can project it)".into());
    }
    let nothing = decoder.find_tag(Tag::GdalNodata).map_err(broken)?.and_then(|value| value.into_string().ok());
    let nothing = nothing.and_then(|text| text.trim_end_matches('\0').trim().parse::<f64>().ok());
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 8 * samples;
    let mut decoder = decoder.with_limits(limits);
    let heights = match decoder.read_image().map_err(broken)? {
        DecodingResult::U8(values) => single(&values),
        DecodingResult::I8(values) => single(&values),
        DecodingResult::U16(values) => single(&values),
        DecodingResult::I16(values) => single(&values),
        DecodingResult::U32(values) => single(&values),
        DecodingResult::I32(values) => single(&values),
        DecodingResult::F32(values) => single(&values),
        DecodingResult::F64(values) => single(&values),
        _ => return Err("numbers of a kind that is not supported; allowed: whole or floating, 8 to 64 bits".into()),
    };
    if heights.len() != samples {
        return Err(format!("{} numbers for {columns} x {rows} samples", heights.len()));
    }
    let height = |value: f64| if Some(value) == nothing || !value.is_finite() { f32::NAN } else { value as f32 };
    let heights: Vec<f32> = heights.into_iter().map(height).collect();
    let columns = columns as usize;
    Ok(HeightRaster { columns, heights: from_north(columns, &heights), step, filled: 0 })
}

fn single<T: Copy + Into<f64>>(values: &[T]) -> Vec<f64> {
    values.iter().map(|&value| value.into()).collect()
}

fn is_grid(bytes: &[u8]) -> bool {
    let start = bytes.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(0);
    bytes.get(start..start + 5).is_some_and(|word| word.eq_ignore_ascii_case(b"ncols"))
}

/// An ESRI ASCII grid: lines of a key and a number, then the heights from the north-west corner on.
fn of_grid(bytes: &[u8], path: &Path) -> Result<HeightRaster> {
    let fault = |place: &str, message: String| Error::parse(path, place, message);
    let word = |word: &[u8]| shown::name(&String::from_utf8_lossy(word)).into_owned();
    let mut words = bytes.split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty()).peekable();
    let (mut columns, mut rows, mut cell, mut nothing) = (None, None, [None; 2], -9999.0);
    while let Some(key) = words.next_if(|word| word[0].is_ascii_alphabetic()) {
        let key = word(key).to_ascii_lowercase();
        let token = words.next().map(word).unwrap_or_default();
        let number = token.parse::<f64>().ok().filter(|number| number.is_finite());
        let Some(number) = number else {
            return Err(fault(&key, format!("{token:?}; allowed: a number")));
        };
        let whole = || {
            let allowed = || fault(&key, format!("{token}; allowed: 2 to {MOST_SAMPLES}"));
            token.parse::<u64>().ok().filter(|count| (2..=MOST_SAMPLES as u64).contains(count)).ok_or_else(allowed)
        };
        match key.as_str() {
            "ncols" => columns = Some(whole()?),
            "nrows" => rows = Some(whole()?),
            "cellsize" => cell = [Some(number); 2],
            "dx" => cell[0] = Some(number),
            "dy" => cell[1] = Some(number),
            "nodata_value" => nothing = number,
            "xllcorner" | "yllcorner" | "xllcenter" | "yllcenter" => {}
            _ => {
                let known = "ncols, nrows, xllcorner, yllcorner, xllcenter, yllcenter, cellsize, dx, dy, NODATA_value";
                return Err(fault(&key, format!("unknown key; allowed: {known}")));
            }
        }
    }
    let needed = |key: &str| fault("", format!("{key} is missing; an ESRI ASCII grid has ncols, nrows and cellsize"));
    let (columns, rows) = (columns.ok_or_else(|| needed("ncols"))?, rows.ok_or_else(|| needed("nrows"))?);
    let [Some(x), Some(y)] = cell else { return Err(needed("cellsize")) };
    let samples = counted(columns, rows).map_err(|message| fault("", message))?;
    // At least two bytes each: a header alone causes no large allocation.
    let mut heights: Vec<f32> = Vec::with_capacity(samples.min(bytes.len() / 2 + 1));
    for text in words {
        let number = std::str::from_utf8(text).ok().and_then(|text| text.parse::<f64>().ok());
        let Some(number) = number.filter(|_| heights.len() < samples) else {
            let at = format!("row {} column {}", heights.len() / columns as usize, heights.len() % columns as usize);
            let message = match number {
                Some(_) => format!("more than {columns} x {rows} heights"),
                None => format!("{:?}; allowed: a number", word(text)),
            };
            return Err(fault(&at, message));
        };
        heights.push(if number == nothing || !number.is_finite() { f32::NAN } else { number as f32 });
    }
    if heights.len() != samples {
        return Err(fault("", format!("{} heights; allowed: {samples}, {columns} x {rows}", heights.len())));
    }
    let columns = columns as usize;
    Ok(HeightRaster { columns, heights: from_north(columns, &heights), step: Some([x, y]), filled: 0 })
}
