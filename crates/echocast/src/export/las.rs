//! LAS, the exchange format of laser scanning: version 1.4 with extra bytes, and the plain record format 2.
//!
//! Layouts: ASPRS LAS Specification 1.4 R15. Header and variable length records are written by the crate `las`, point
//! records by our own code, which is several times faster.

use super::{Format, Sink, labels_json};
use crate::cloud::record::{self, BLOCK_BYTES};
use crate::cloud::{Column, Field, FieldInfo, PointCloud};
use crate::ground::report::Report;
use ::las::raw::header::{Evlr, LargeFile};
use ::las::{Builder, Transform, Vector, Vlr};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// LAS 1.4, point format 7.
pub(super) static LAS: Las = Las {
    name: "las",
    extensions: &["las"],
    description: "LAS 1.4, point format 7; 0.1 mm, 16 bit intensity, labels and other columns in extra bytes",
    version: (1, 4),
    point_format: 7,
    classification: 16,
    most_class: 255,
    size: 36,
    return_bits: 4,
    source_id: 20,
    time: Some(22),
    colour: 30,
    extra_bytes: true,
};

/// LAS 1.2, point format 2: position, label, intensity and colour, which most programs read.
pub(super) static LAS2: Las = Las {
    name: "las2",
    extensions: &[],
    description: "LAS 1.2, point format 2, category_id in point source id: the simplest LAS with colour",
    version: (1, 2),
    point_format: 2,
    classification: 15,
    most_class: 31,
    size: 26,
    return_bits: 3,
    source_id: 18,
    time: None,
    colour: 20,
    extra_bytes: false,
};

/// One kind of point record: sizes and places of its members in bytes, where the kinds differ.
pub(super) struct Las {
    name: &'static str,
    extensions: &'static [&'static str],
    description: &'static str,
    version: (u8, u8),
    point_format: u8,
    size: usize,
    /// Bits of the return number and, above them, of the number of returns.
    return_bits: u32,
    classification: usize,
    /// Highest class that it holds.
    most_class: u8,
    source_id: usize,
    time: Option<usize>,
    colour: usize,
    /// Whether the columns that LAS lacks follow as extra bytes; otherwise the category is the point source id.
    extra_bytes: bool,
}

const INTENSITY: usize = 12;
const RETURNS: usize = 14;

/// Class of points that are none of the others.
const UNCLASSIFIED: u8 = 1;

/// Finest step of the coordinates, metres, as a power of ten.
const FINEST_STEP: i32 = -4;

impl Format for Las {
    fn name(&self) -> &'static str {
        self.name
    }

    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }

    fn description(&self) -> &'static str {
        self.description
    }

    fn holds(&self, info: &FieldInfo) -> bool {
        match info.las {
            Some("gps_time") => self.time.is_some(),
            Some(_) => true,
            None => self.extra_bytes || info.name == "category_id",
        }
    }

    fn needs_positions(&self) -> bool {
        true
    }

    fn holds_label_names(&self) -> bool {
        self.extra_bytes
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        let extra: Vec<Extra> = if self.extra_bytes { Extra::of(cloud) } else { Vec::new() };
        let survey = Survey::of(cloud, self);
        survey.tell(cloud, self, report);
        // Not buffered: header and records each go in few large pieces.
        let mut file = Sink::create(path)?;
        let evlr = self.write_header(cloud, &extra, &survey, &mut file)?;
        self.write_records(cloud, &extra, &survey, &mut file)?;
        if let Some(labels) = evlr {
            let mut buffered = BufWriter::new(&mut file);
            labels.into_raw(true).and_then(|raw| raw.write_to(&mut buffered)).map_err(io_error)?;
            buffered.flush()?;
            drop(buffered);
        }
        file.finish()
    }
}

impl Las {
    /// Writes the header and the records before the points; returns the record that must follow them.
    fn write_header(
        &self,
        cloud: &PointCloud,
        extra: &[Extra],
        survey: &Survey,
        file: &mut Sink,
    ) -> io::Result<Option<Vlr>> {
        let mut builder = Builder::from(self.version);
        builder.point_format = ::las::point::Format::new(self.point_format).map_err(io_error)?;
        builder.point_format.extra_bytes = Extra::size(extra) as u16; // at most 32 columns of 8 bytes
        builder.generating_software = concat!("echocast ", env!("CARGO_PKG_VERSION")).into();
        builder.system_identifier = "SIMULATION".into();
        let transform = |offset| Transform { scale: survey.step(), offset };
        builder.transforms =
            Vector { x: transform(cloud.origin.x), y: transform(cloud.origin.y), z: transform(cloud.origin.z) };
        if self.extra_bytes {
            let columns = Vlr {
                user_id: "LASF_Spec".into(),
                record_id: 4,
                description: "extra bytes".into(),
                data: extra.iter().flat_map(Extra::descriptor).collect(),
            };
            let labels = Vlr {
                user_id: "echocast".into(),
                record_id: 1,
                description: "pose and label names, JSON".into(),
                data: labels_json(cloud).into_bytes(),
            };
            builder.vlrs.extend([columns, labels]);
            builder.vlrs.retain(|vlr| !vlr.data.is_empty());
        }
        let header = builder.into_header().map_err(io_error)?;
        let mut raw = header.clone().into_raw().map_err(io_error)?;
        // The day of writing is left out, so that the same run gives the same bytes.
        let [low, high] = [survey.low, survey.high].map(|corner| survey.corner(corner, cloud));
        [raw.min_x, raw.min_y, raw.min_z] = low;
        [raw.max_x, raw.max_y, raw.max_z] = high;
        let points: u64 = survey.by_return.iter().sum();
        if self.version < (1, 4) {
            // Counts of more than five returns have no place here.
            let small =
                |n: u64| u32::try_from(n).map_err(|_| io::Error::other("LAS 1.2 holds 4294967295 points at most"));
            raw.number_of_point_records = small(points)?;
            for (to, &from) in raw.number_of_points_by_return.iter_mut().zip(&survey.by_return) {
                *to = small(from)?;
            }
        } else {
            raw.large_file =
                Some(LargeFile { number_of_point_records: points, number_of_points_by_return: survey.by_return });
        }
        let evlr = header.evlrs().first().cloned();
        if evlr.is_some() {
            let end = u64::from(raw.offset_to_point_data) + points * u64::from(raw.point_data_record_length);
            raw.evlr = Some(Evlr { start_of_first_evlr: end, number_of_evlrs: 1 });
        }
        let mut buffered = BufWriter::new(file);
        raw.write_to(&mut buffered).map_err(io_error)?;
        for vlr in header.vlrs() {
            vlr.clone().into_raw(false).and_then(|raw| raw.write_to(&mut buffered)).map_err(io_error)?;
        }
        buffered.flush()?;
        Ok(evlr)
    }

    fn write_records(&self, cloud: &PointCloud, extra: &[Extra], survey: &Survey, file: &mut Sink) -> io::Result<()> {
        let size = self.size + Extra::size(extra);
        let block = BLOCK_BYTES / size;
        // Members that nothing is put into (flags, user data, scan angle) stay 0.
        let mut buffer = vec![0; block * size];
        let mut rows = Vec::with_capacity(block);
        let (c, classes) = (&cloud.columns, &cloud.labels.las_class);
        let per_metre = 10f64.powi(-survey.exponent);
        let per_full_scale = 65535.0 / f64::from(survey.full_intensity);
        for start in (0..cloud.len).step_by(block) {
            rows.clear();
            rows.extend((start..cloud.len.min(start + block)).filter(|&row| is_point(cloud, row)));
            let records = &mut buffer[..rows.len() * size];
            for (axis, column) in [&c.x, &c.y, &c.z].into_iter().enumerate() {
                let steps = |row: usize| ((f64::from(column[row]) * per_metre).round() as i32).to_le_bytes();
                record::put(records, size, axis * 4, rows.iter().copied(), steps);
            }
            if !c.intensity.is_empty() {
                // A conversion of a float to an integer clamps.
                let part = |row: usize| ((f64::from(c.intensity[row]) * per_full_scale).round() as u16).to_le_bytes();
                record::put(records, size, INTENSITY, rows.iter().copied(), part);
            }
            let returns = |row| [self.return_number(cloud, row) | self.return_count(cloud, row) << self.return_bits];
            record::put(records, size, RETURNS, rows.iter().copied(), returns);
            if !classes.is_empty() && !c.category_id.is_empty() {
                let class = |row: usize| {
                    let class = classes.get(&c.category_id[row]).copied().unwrap_or(0);
                    [if class <= self.most_class { class } else { UNCLASSIFIED }]
                };
                record::put(records, size, self.classification, rows.iter().copied(), class);
            }
            if let (Some(time), false) = (self.time, c.time.is_empty()) {
                record::put(records, size, time, rows.iter().copied(), |row| c.time[row].to_le_bytes());
            }
            for (channel, column) in [&c.red, &c.green, &c.blue].into_iter().enumerate() {
                if !column.is_empty() {
                    // Colours have 16 bits in LAS and white is 65535 there: 257 = 65535 / 255 repeats the byte.
                    let wide = |row: usize| (u16::from(column[row]) * 257).to_le_bytes();
                    record::put(records, size, self.colour + channel * 2, rows.iter().copied(), wide);
                }
            }
            if !self.extra_bytes && !c.category_id.is_empty() {
                let id = |row: usize| u16::try_from(c.category_id[row]).unwrap_or(u16::MAX).to_le_bytes();
                record::put(records, size, self.source_id, rows.iter().copied(), id);
            }
            for column in extra {
                column.put(records, size, self.size, &rows);
            }
            file.write_all(records)?;
        }
        Ok(())
    }

    fn return_number(&self, cloud: &PointCloud, row: usize) -> u8 {
        cloud.columns.return_number.get(row).map_or(1, |&number| number.clamp(1, self.most_returns()))
    }

    fn return_count(&self, cloud: &PointCloud, row: usize) -> u8 {
        cloud.columns.return_count.get(row).map_or(1, |&count| count.clamp(1, self.most_returns()))
    }

    fn most_returns(&self) -> u8 {
        (1 << self.return_bits) - 1
    }
}

/// Whether row `row` has a position; beams without a return have none.
fn is_point(cloud: &PointCloud, row: usize) -> bool {
    let c = &cloud.columns;
    c.x[row].is_finite() && c.y[row].is_finite() && c.z[row].is_finite()
}

fn io_error(error: ::las::Error) -> io::Error {
    match error {
        ::las::Error::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Greatest intensity of the points, never 0, which nothing can be divided by.
fn strongest(cloud: &PointCloud) -> f32 {
    let finite = |&(row, intensity): &(usize, &f32)| intensity.is_finite() && is_point(cloud, row);
    cloud.columns.intensity.iter().enumerate().filter(finite).fold(f32::MIN_POSITIVE, |most, (_, &i)| most.max(i))
}

/// What the header must say of the points, and what they lose.
struct Survey {
    /// Least and greatest coordinates relative to the origin, metres.
    low: [f32; 3],
    high: [f32; 3],
    by_return: [u64; 15],
    /// Power of ten of the coordinates' step.
    exponent: i32,
    /// Intensity that is stored as 65535.
    full_intensity: f32,
    misses: usize,
    /// Points too far away for the numbers to hold.
    infinite: usize,
    clamped_intensities: bool,
    clamped_returns: bool,
    clamped_categories: bool,
}

impl Survey {
    fn of(cloud: &PointCloud, las: &Las) -> Self {
        let c = &cloud.columns;
        let mut survey = Survey {
            low: [f32::INFINITY; 3],
            high: [f32::NEG_INFINITY; 3],
            by_return: [0; 15],
            exponent: FINEST_STEP,
            full_intensity: cloud.intensity_full_scale.unwrap_or_else(|| strongest(cloud)),
            misses: 0,
            infinite: 0,
            clamped_intensities: false,
            clamped_returns: false,
            clamped_categories: false,
        };
        let intensities = 0.0..=survey.full_intensity;
        let returns = 1..=las.most_returns();
        for row in 0..cloud.len {
            if !is_point(cloud, row) {
                let infinite = [c.x[row], c.y[row], c.z[row]].iter().any(|x| x.is_infinite());
                *if infinite { &mut survey.infinite } else { &mut survey.misses } += 1;
                continue;
            }
            for (axis, value) in [c.x[row], c.y[row], c.z[row]].into_iter().enumerate() {
                survey.low[axis] = survey.low[axis].min(value);
                survey.high[axis] = survey.high[axis].max(value);
            }
            survey.by_return[usize::from(las.return_number(cloud, row)) - 1] += 1;
            let inside = |column: &[u8]| column.get(row).is_none_or(|number| returns.contains(number));
            survey.clamped_returns |= !inside(&c.return_number) || !inside(&c.return_count);
            survey.clamped_intensities |= c.intensity.get(row).is_some_and(|i| !intensities.contains(i));
            survey.clamped_categories |= c.category_id.get(row).is_some_and(|&id| id > u32::from(u16::MAX));
        }
        if survey.misses + survey.infinite == cloud.len {
            (survey.low, survey.high) = ([0.0; 3], [0.0; 3]);
        }
        let farthest = f64::from(survey.low.iter().chain(&survey.high).fold(0.0f32, |m, v| m.max(v.abs())));
        while farthest / survey.step() >= f64::from(i32::MAX) {
            survey.exponent += 1;
        }
        survey
    }

    /// Step of the coordinates, metres.
    fn step(&self) -> f64 {
        10f64.powi(self.exponent)
    }

    /// A corner of the bounds as readers compute it from the steps in the records.
    fn corner(&self, corner: [f32; 3], cloud: &PointCloud) -> [f64; 3] {
        let origin = cloud.origin.to_array();
        std::array::from_fn(|axis| {
            (f64::from(corner[axis]) * 10f64.powi(-self.exponent)).round() * self.step() + origin[axis]
        })
    }

    /// Without counts of what is usual, so that the files of a sequence say the same.
    fn tell(&self, cloud: &PointCloud, las: &Las, report: &mut Report) {
        let name = las.name;
        if self.misses > 0 {
            report.warn(format!("{name}: rows without a position left out"));
        }
        if self.infinite > 0 {
            let points = cloud.len - self.misses;
            report.warn(format!(
                "{name}: {} of {points} points left out: their coordinates are infinite, farther than LAS can say",
                self.infinite
            ));
        }
        if self.exponent != FINEST_STEP {
            report.warn(format!(
                "{name}: the cloud reaches too far from its origin for steps of 0.0001 m; coordinates rounded to {} m",
                self.step()
            ));
        }
        if self.clamped_intensities {
            report.warn(format!("{name}: intensities below 0, above full scale or without a value clamped"));
        }
        if cloud.intensity_full_scale.is_none() && !cloud.columns.intensity.is_empty() {
            let kept = if las.extra_bytes { format!("; {RAW_INTENSITY} holds it as it is") } else { String::new() };
            report.warn(format!(
                "{name}: the intensity of this sensor has no full scale; 65535 is the strongest point of the file{kept}"
            ));
        }
        if self.clamped_returns {
            let most = las.most_returns();
            report.warn(format!("{name}: return numbers clamped to 1 to {most}"));
        }
        if !las.extra_bytes && self.clamped_categories {
            report.warn(format!("{name}: category ids above 65535 written as 65535"));
        }
    }
}

/// The extra dimension of intensities without a full scale, which are another number in each file's own dimension:
/// levels of sonars, and relative energy.
const RAW_INTENSITY: &str = "raw_intensity";

/// A column for which LAS has no dimension, or only part of one, behind the members of each record.
struct Extra<'a> {
    info: &'static FieldInfo,
    name: &'static str,
    /// At most 31 bytes.
    meaning: String,
    column: Column<'a>,
    /// What makes positions f64 world coordinates.
    offset: Option<f64>,
    /// First byte behind the members.
    at: usize,
}

impl<'a> Extra<'a> {
    fn of(cloud: &'a PointCloud) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        let unscaled = cloud.intensity_full_scale.is_none();
        for info in cloud.fields.iter() {
            let (name, meaning) = match info.field {
                Field::Intensity if unscaled => (RAW_INTENSITY, "not scaled; of sonars in dB".to_owned()),
                _ if info.las.is_none() => (info.name, description(info)),
                _ => continue,
            };
            let (column, offset) = (cloud.column(info.field), cloud.offset(info.field));
            all.push(Extra { info, name, meaning, column, offset, at: Extra::size(&all) });
        }
        all
    }

    /// Bytes that all of `extra` take in a record.
    fn size(extra: &[Self]) -> usize {
        extra.iter().map(|e| if e.offset.is_some() { 8 } else { e.info.kind.size() }).sum()
    }

    fn put(&self, records: &mut [u8], size: usize, behind: usize, rows: &[usize]) {
        let at = behind + self.at;
        let rows = rows.iter().copied();
        match (self.column, self.offset) {
            (Column::F32(c), Some(offset)) => {
                record::put(records, size, at, rows, |row| (f64::from(c[row]) + offset).to_le_bytes());
            }
            (Column::F32(c), None) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            (Column::F64(c), _) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            (Column::U8(c), _) => record::put(records, size, at, rows, |row| [c[row]]),
            (Column::U16(c), _) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
            (Column::U32(c), _) => record::put(records, size, at, rows, |row| c[row].to_le_bytes()),
        }
    }

    /// Its entry of the record `LASF_Spec` 4 (specification, tables 24 and 25).
    fn descriptor(&self) -> [u8; 192] {
        let mut bytes = [0; 192];
        bytes[2] = match (self.column, self.offset) {
            (Column::U8(_), _) => 1,
            (Column::U16(_), _) => 3,
            (Column::U32(_), _) => 5,
            (Column::F32(_), None) => 9,
            (Column::F32(_), Some(_)) | (Column::F64(_), _) => 10,
        };
        bytes[4..4 + self.name.len()].copy_from_slice(self.name.as_bytes());
        bytes[160..160 + self.meaning.len()].copy_from_slice(self.meaning.as_bytes());
        bytes
    }
}

/// The short form of a column's meaning, at most 31 bytes.
fn description(info: &FieldInfo) -> String {
    let unit = if matches!(info.unit, "" | "1") { String::new() } else { format!("[{}] ", info.unit) };
    let short = info.meaning.split([',', ':', '(']).next().unwrap_or_default();
    unit + short.trim_end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::FIELDS;

    #[test]
    fn points_out_of_reach_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = PointCloud { len: 4, ..PointCloud::default() };
        cloud.fields = [Field::X, Field::Y, Field::Z].into_iter().collect();
        cloud.columns.resize(cloud.fields, 4).unwrap();
        cloud.columns.x = vec![1e17, f32::INFINITY, f32::NAN, 0.0];
        let report = crate::export::write(&cloud, &folder.path().join("a.las"), None).unwrap();
        let told = "las: 1 of 3 points left out: their coordinates are infinite, farther than LAS can say";
        assert!(report.warnings.iter().any(|warning| warning == told), "{report:?}");
        assert!(report.warnings.iter().any(|warning| warning.contains("rounded to 100000000 m")), "{report:?}");
    }

    #[test]
    fn descriptions_of_extra_bytes_fit_whole() {
        for info in FIELDS.iter().filter(|info| info.las.is_none()) {
            assert!((3..32).contains(&description(info).len()) && info.name.len() < 32, "{}", description(info));
        }
        assert_eq!(description(Field::TrueX.info()), "[m] position without errors");
        assert_eq!(description(Field::Channel.info()), "emitter index");
    }
}
