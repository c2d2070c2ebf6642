//! LAS, the exchange format of laser scanning: version 1.4 with extra bytes, and the plain record format 2.
//!
//! Layouts: ASPRS LAS Specification 1.4 R15. Header and variable length records are written by the crate `las`, point
//! records by our own code, which is several times faster.

use super::laz::{self, Laz};
use super::{Format, FormatInfo, Growing, labels_json};
use crate::points::offset;
use crate::record::{self, BLOCK_BYTES};
use crate::{Column, ColumnType, Field, FieldInfo, FieldSet, Frame, PointCloud, Record};
use ::las::raw::header::{Evlr, LargeFile};
use ::las::{Builder, GpsTimeType, Header, Transform, Vector, Vlr};
use glam::DVec3;
use ground::pose::Pose;
use ground::report::Report;
use ground::write::Sink;
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

/// LAS 1.4, point format 7, or without colours 6.
pub(super) const LAS: Las = Las {
    info: FormatInfo {
        name: "las",
        extensions: &["las"],
        description: "LAS 1.4, point format 6 or, with colours, 7; 0.1 mm, 16 bit intensity, labels and other columns in extra bytes",
        needs_positions: true,
        holds_label_names: true,
    },
    version: (1, 4),
    point_format: 7,
    flags: 15,
    classification: 16,
    most_class: 255,
    angle: (18, 2),
    size: 36,
    return_bits: 4,
    source_id: 20,
    time: Some(22),
    colour: Some(30),
    scanner_channels: true,
    extra_bytes: true,
    compressed: false,
};

/// The same with points compressed, as by LASzip 3: a third to a sixth of the size.
pub(super) const LAZ: Las = Las {
    info: FormatInfo {
        name: "laz",
        extensions: &["laz"],
        description: "LAS 1.4 as las, compressed by LASzip: smaller, slower to write",
        ..LAS.info
    },
    compressed: true,
    ..LAS
};

/// LAS 1.2, point format 2: position, label, intensity and colour, which most programs read.
pub(super) const LAS2: Las = Las {
    info: FormatInfo {
        name: "las2",
        extensions: &[],
        description: "LAS 1.2, point format 2, category_id in point source id: the simplest LAS with colour",
        holds_label_names: false,
        ..LAS.info
    },
    version: (1, 2),
    point_format: 2,
    flags: 14,
    classification: 15,
    most_class: 31,
    angle: (16, 1),
    size: 26,
    return_bits: 3,
    source_id: 18,
    time: None,
    colour: Some(20),
    scanner_channels: false,
    extra_bytes: false,
    compressed: false,
};

/// One kind of point record: sizes and offsets of its members in bytes, where the kinds differ.
#[derive(Clone, Copy)]
pub(super) struct Las {
    info: FormatInfo,
    version: (u8, u8),
    point_format: u8,
    size: usize,
    /// Bits of the return number and, above them, of the number of returns.
    return_bits: u32,
    /// The byte whose two highest bits are the direction of the scan and the edge of the flight line.
    flags: usize,
    classification: usize,
    /// Highest class that it holds.
    most_class: u8,
    /// First byte of the scan angle and its bytes: two in steps of 0.006 degrees, or one in whole degrees.
    angle: (usize, usize),
    source_id: usize,
    time: Option<usize>,
    colour: Option<usize>,
    /// Whether channels are those of LAS, of which a scanner has four at most; otherwise only the extra dimension has them.
    scanner_channels: bool,
    /// Whether the columns that LAS lacks follow as extra bytes; otherwise the category is the point source id.
    extra_bytes: bool,
    compressed: bool,
}

const INTENSITY: usize = 12;
const RETURNS: usize = 14;

const USER_DATA: usize = 17;

/// Bits of the flags.
const DIRECTION: u32 = 6;
const EDGE: u32 = 7;
/// Shift of the scanner channel above the flags of classification, in the same byte as those of the scan.
const SCANNER_CHANNEL: u32 = 4;

/// Step of scan angles of two bytes, degrees (specification, 2.6).
pub(crate) const ANGLE_STEP_DEG: f64 = 0.006;

/// Greatest scan angle of one byte, degrees (specification, 2.5).
const RANK_DEG: f64 = 90.0;

/// Class of points that belong to no other class.
const UNCLASSIFIED: u8 = 1;

/// Finest step of the coordinates, metres, as a power of ten.
const FINEST_STEP: i32 = -4;

impl Format for Las {
    fn info(&self) -> &FormatInfo {
        &self.info
    }

    fn holds(&self, info: &FieldInfo) -> bool {
        match info.las {
            Some("gps_time") => self.time.is_some(),
            // There it is the category.
            Some("point_source_id") => self.extra_bytes,
            Some(_) => true,
            None => self.extra_bytes || info.name == "category_id",
        }
    }

    fn keeps(&self, record: &Record) -> bool {
        // Larger ones come after the points, from LAS 1.4 on.
        self.version >= (1, 4) || record.data.len() <= u16::MAX.into()
    }

    fn most_points(&self, _: FieldSet) -> Option<u64> {
        // Counts have 32 bits before LAS 1.4.
        (self.version < (1, 4)).then_some(u32::MAX.into())
    }

    fn write(&self, cloud: &PointCloud, path: &Path, report: &mut Report) -> io::Result<()> {
        super::write_alone(LasFile::create(self, cloud, path)?, cloud, report)
    }

    fn begin(&self, first: &PointCloud, path: &Path) -> Option<io::Result<Box<dyn Growing>>> {
        // Without a full scale, that of the intensities depends on the strongest of all points.
        let scaled = first.intensity_full_scale.is_some() || first.columns.intensity.is_empty();
        scaled.then(|| Ok(Box::new(LasFile::create(self, first, path)?) as Box<dyn Growing>))
    }
}

/// A file that is being written.
struct LasFile {
    las: Las,
    file: Sink,
    extra: Vec<Extra>,
    survey: Survey,
    laz: Option<Laz>,
}

impl Growing for LasFile {
    fn add(&mut self, cloud: &PointCloud) -> io::Result<()> {
        self.survey.add(cloud, &self.las);
        self.write_records(cloud)
    }

    fn finish(&mut self, head: &PointCloud, report: &mut Report) -> io::Result<()> {
        self.survey.report_losses(head, &self.las, report);
        self.las.report_system(head, report);
        if let Some(laz) = &mut self.laz {
            laz.finish(&mut self.file)?;
        }
        let end = self.file.stream_position()?;
        let header = self.header(head)?;
        write_buffered(&mut self.file, |file| {
            header.evlrs().iter().try_for_each(|record| record.clone().into_raw(true)?.write_to(&mut *file))
        })?;
        // Now that all points are counted.
        self.file.rewind()?;
        self.write_header(&header, head, end)?;
        self.file.take_error()
    }
}

impl LasFile {
    /// Starts the file for clouds like `first`, whose points are no farther out than those of `first`.
    fn create(las: &Las, first: &PointCloud, path: &Path) -> io::Result<LasFile> {
        // Not buffered: header and records are each written in few large pieces.
        let file = Sink::create(path)?;
        let extra = if las.extra_bytes { Extra::of(first) } else { Vec::new() };
        let survey = Survey::new(first);
        let las = &las.fit(first);
        let laz = las.compressed.then(|| Laz::new(las.point_format, Extra::size(&extra) as u16)).transpose()?;
        let mut file = LasFile { las: *las, file, extra, survey, laz };
        let header = file.header(first)?;
        file.write_header(&header, first, 0)?;
        if let Some(laz) = &mut file.laz {
            laz.begin(&mut file.file)?;
        }
        Ok(file)
    }

    /// Header and records around the points; those that come after the points are last. `head` is the cloud without its
    /// rows.
    fn header(&self, head: &PointCloud) -> io::Result<Header> {
        let las = &self.las;
        let mut builder = Builder::from(las.version);
        builder.point_format = ::las::point::Format::new(las.point_format).map_err(io_error)?;
        builder.point_format.extra_bytes = Extra::size(&self.extra) as u16; // at most 32 columns of 8 bytes
        builder.generating_software = concat!("echocast ", env!("CARGO_PKG_VERSION")).into();
        builder.system_identifier = "SIMULATION".into();
        let transform = |offset| Transform { scale: self.survey.step(), offset };
        let origin = head.origin + on_earth(head);
        builder.transforms = Vector { x: transform(origin.x), y: transform(origin.y), z: transform(origin.z) };
        if las.extra_bytes {
            let columns = Vlr {
                user_id: "LASF_Spec".into(),
                record_id: 4,
                description: "extra bytes".into(),
                data: self.extra.iter().flat_map(Extra::descriptor).collect(),
            };
            // Beams without a return are left out, and therefore the shape.
            let position = head.sensor_pose.position + on_earth(head);
            let sensor_pose = Pose { position, ..head.sensor_pose };
            let labels = labels_json(&PointCloud { organised: None, sensor_pose, ..head.head() });
            let labels = Vlr {
                user_id: "echocast".into(),
                record_id: 1,
                description: "pose and label names, JSON".into(),
                data: labels.into_bytes(),
            };
            builder.vlrs.extend([columns, labels]);
            builder.vlrs.retain(|vlr| !vlr.data.is_empty());
        }
        let kept = head.records.all.iter().filter(|record| las.keeps(record));
        builder.vlrs.extend(kept.map(|record| Vlr {
            user_id: record.user.clone(),
            record_id: record.id,
            description: record.description.clone(),
            data: record.data.clone(),
        }));
        if head.records.standard_time {
            builder.gps_time_type = GpsTimeType::Standard;
        }
        if let Some(laz) = &self.laz {
            builder.vlrs.push(laz.record()?);
        }
        builder.into_header().map_err(io_error)
    }

    /// Writes the header and the records before the points, which end at `end`.
    fn write_header(&mut self, header: &Header, head: &PointCloud, end: u64) -> io::Result<()> {
        let mut raw = header.clone().into_raw().map_err(io_error)?;
        if self.laz.is_some() {
            raw.point_data_record_format |= laz::COMPRESSED;
        }
        // The day of writing is left out, so that the same run gives the same bytes.
        let survey = &self.survey;
        let [low, high] = survey.bounds().map(|corner| survey.corner(corner, head));
        [raw.min_x, raw.min_y, raw.min_z] = low;
        [raw.max_x, raw.max_y, raw.max_z] = high;
        let points: u64 = survey.by_return.iter().sum();
        if self.las.version < (1, 4) {
            // There is no room for counts of more than five returns.
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
        if !header.evlrs().is_empty() {
            let number_of_evlrs = header.evlrs().len() as u32;
            raw.evlr = Some(Evlr { start_of_first_evlr: end, number_of_evlrs });
        }
        write_buffered(&mut self.file, |file| {
            raw.write_to(&mut *file)?;
            header.vlrs().iter().try_for_each(|vlr| vlr.clone().into_raw(false)?.write_to(&mut *file))
        })
    }

    fn write_records(&mut self, cloud: &PointCloud) -> io::Result<()> {
        let LasFile { las, file, extra, survey, laz, .. } = self;
        let size = las.size + Extra::size(extra);
        let block = BLOCK_BYTES / size;
        // Members that are not written stay 0.
        let mut buffer = vec![0; block * size];
        let mut rows = Vec::with_capacity(block);
        let (c, classes) = (&cloud.columns, &cloud.labels.las_class);
        let per_metre = 10f64.powi(-survey.exponent);
        let per_full_scale = 65535.0 / f64::from(survey.full_intensity);
        for start in (0..cloud.len).step_by(block) {
            rows.clear();
            rows.extend((start..cloud.len.min(start + block)).filter(|&row| survey.holds(cloud, row)));
            let records = &mut buffer[..rows.len() * size];
            for (axis, column) in [&c.x, &c.y, &c.z].into_iter().enumerate() {
                let steps = |row: usize| ((f64::from(column[row]) * per_metre).round() as i32).to_le_bytes();
                record::put(records, size, axis * 4, rows.iter().copied(), steps);
            }
            if !c.intensity.is_empty() {
                // The conversion of a float to an integer clamps.
                let part = |row: usize| ((f64::from(c.intensity[row]) * per_full_scale).round() as u16).to_le_bytes();
                record::put(records, size, INTENSITY, rows.iter().copied(), part);
            }
            las.put_scan(cloud, records, size, &rows);
            if !classes.is_empty() && !c.category_id.is_empty() {
                let class = |row: usize| {
                    let class = classes.get(&c.category_id[row]).copied().unwrap_or(0);
                    [if class <= las.most_class { class } else { UNCLASSIFIED }]
                };
                record::put(records, size, las.classification, rows.iter().copied(), class);
            }
            if let (Some(time), false) = (las.time, c.time.is_empty()) {
                record::put(records, size, time, rows.iter().copied(), |row| {
                    (cloud.time_zero + c.time[row]).to_le_bytes()
                });
            }
            for (channel, column) in [&c.red, &c.green, &c.blue].into_iter().enumerate() {
                if let (Some(colour), false) = (las.colour, column.is_empty()) {
                    // Colours have 16 bits in LAS and white is 65535 there: 257 = 65535 / 255 repeats the byte.
                    let wide = |row: usize| (u16::from(column[row]) * 257).to_le_bytes();
                    record::put(records, size, colour + channel * 2, rows.iter().copied(), wide);
                }
            }
            for column in &*extra {
                column.put(cloud, records, size, las.size, &rows);
            }
            match laz {
                Some(laz) => laz.add(records, file)?,
                None => file.write_all(records)?,
            }
        }
        Ok(())
    }
}

impl Las {
    /// Warns of what readers may ignore: points of format 6 and above require coordinate systems as text, and LAS
    /// before 1.4 has none (2.5 and table 4).
    fn report_system(&self, head: &PointCloud, report: &mut Report) {
        let name = self.info.name;
        let keys = head.records.all.iter().any(Record::is_keys);
        match head.records.wkt() {
            Some(_) if self.version < (1, 4) => report.warn(format!(
                "{name}: LAS 1.2 has no coordinate systems as text (WKT): it is kept, but programs may ignore it; \
                 las holds it"
            )),
            None if keys && self.point_format >= 6 => report.warn(format!(
                "{name}: points of format {} require the coordinate system as text (WKT): its GeoTIFF keys are kept, but \
                 programs may ignore them; las2 holds them",
                self.point_format
            )),
            _ => {}
        }
    }

    /// As clouds like `first` need it: without colours if they have none.
    fn fit(self, first: &PointCloud) -> Las {
        let scanner_channels = self.scanner_channels && first.columns.channel.iter().all(|&channel| channel < 4);
        let las = Las { scanner_channels, ..self };
        let colours = [Field::Red, Field::Green, Field::Blue];
        match las.colour {
            Some(colour) if las.extra_bytes && !first.fields.contains_any(&colours) => {
                Las { point_format: las.point_format - 1, colour: None, size: colour, ..las }
            }
            _ => las,
        }
    }

    /// Writes what a scanner says of its points: returns, direction of the scan, edge, channel, angle and strip.
    fn put_scan(&self, cloud: &PointCloud, records: &mut [u8], size: usize, rows: &[usize]) {
        let c = &cloud.columns;
        let rows = || rows.iter().copied();
        let flag = |column: &[u8], row: usize, bit: u32| column.get(row).map_or(0, |&flag| u8::from(flag != 0) << bit);
        let scan = |row| flag(&c.scan_direction, row, DIRECTION) | flag(&c.edge_of_line, row, EDGE);
        let returns = |row| self.return_number(cloud, row) | self.return_count(cloud, row) << self.return_bits;
        if self.flags == RETURNS {
            record::put(records, size, RETURNS, rows(), |row| [returns(row) | scan(row)]);
        } else {
            record::put(records, size, RETURNS, rows(), |row| [returns(row)]);
            let channel = |row| match c.channel.get(row) {
                Some(&channel @ 0..4) if self.scanner_channels => (channel as u8) << SCANNER_CHANNEL,
                _ => 0,
            };
            record::put(records, size, self.flags, rows(), |row| [scan(row) | channel(row)]);
        }
        if !c.scan_angle.is_empty() {
            // The conversion of a float to an integer clamps, and makes 0 of NaN.
            let degrees = |row: usize| f64::from(c.scan_angle[row]).to_degrees();
            match self.angle {
                (at, 1) => record::put(records, size, at, rows(), |row| {
                    (degrees(row).round().clamp(-RANK_DEG, RANK_DEG) as i8).to_le_bytes()
                }),
                (at, _) => record::put(records, size, at, rows(), |row| {
                    ((degrees(row) / ANGLE_STEP_DEG).round() as i16).to_le_bytes()
                }),
            }
        }
        if self.extra_bytes && !c.cause.is_empty() {
            record::put(records, size, USER_DATA, rows(), |row| [c.cause[row]]);
        }
        if self.extra_bytes {
            if !c.strip.is_empty() {
                record::put(records, size, self.source_id, rows(), |row| c.strip[row].to_le_bytes());
            }
        } else if !c.category_id.is_empty() {
            let id = |row: usize| u16::try_from(c.category_id[row]).unwrap_or(u16::MAX).to_le_bytes();
            record::put(records, size, self.source_id, rows(), id);
        }
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

/// Writes the output of `write`, which is in many pieces, in few.
fn write_buffered(
    file: &mut Sink,
    write: impl FnOnce(&mut BufWriter<&mut Sink>) -> ::las::Result<()>,
) -> io::Result<()> {
    let mut buffered = BufWriter::new(file);
    write(&mut buffered).map_err(io_error)?;
    buffered.flush()
}

/// What to add to coordinates of the cloud's frame for those of its coordinate system, metres.
fn on_earth(cloud: &PointCloud) -> DVec3 {
    if cloud.frame == Frame::World { cloud.earth_offset } else { DVec3::ZERO }
}

/// Coordinates of row `row` relative to the origin, metres; NaN without a return.
fn place(cloud: &PointCloud, row: usize) -> [f32; 3] {
    let c = &cloud.columns;
    [c.x[row], c.y[row], c.z[row]]
}

fn io_error(error: ::las::Error) -> io::Error {
    match error {
        ::las::Error::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Greatest intensity of the points, never 0, because it is a divisor.
fn strongest(cloud: &PointCloud) -> f32 {
    let finite =
        |&(row, intensity): &(usize, &f32)| intensity.is_finite() && place(cloud, row).iter().all(|x| x.is_finite());
    cloud.columns.intensity.iter().enumerate().filter(finite).fold(f32::MIN_POSITIVE, |most, (_, &i)| most.max(i))
}

/// What the header must state of the points, and what they lose.
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
    far: usize,
    clamped_intensities: bool,
    clamped_returns: bool,
    clamped_categories: bool,
    clamped_angles: bool,
}

impl Survey {
    /// Without points yet; the step is large enough to represent those of `first`.
    fn new(first: &PointCloud) -> Self {
        let axes = [&first.columns.x, &first.columns.y, &first.columns.z].into_iter();
        let farthest = axes.flatten().filter(|x| x.is_finite()).fold(0.0_f32, |most, x| most.max(x.abs()));
        let mut survey = Survey {
            low: [f32::INFINITY; 3],
            high: [f32::NEG_INFINITY; 3],
            by_return: [0; 15],
            exponent: FINEST_STEP,
            full_intensity: first.intensity_full_scale.unwrap_or_else(|| strongest(first)),
            misses: 0,
            far: 0,
            clamped_intensities: false,
            clamped_returns: false,
            clamped_categories: false,
            clamped_angles: false,
        };
        while f64::from(farthest) >= survey.reach() {
            survey.exponent += 1;
        }
        survey
    }

    /// Coordinates below this can be represented, metres.
    fn reach(&self) -> f64 {
        f64::from(i32::MAX) * self.step()
    }

    /// Whether row `row` is a point that can be represented.
    fn holds(&self, cloud: &PointCloud, row: usize) -> bool {
        let reach = self.reach();
        place(cloud, row).iter().all(|&x| f64::from(x).abs() < reach)
    }

    /// Counts the points of `cloud`.
    fn add(&mut self, cloud: &PointCloud, las: &Las) {
        let c = &cloud.columns;
        let intensities = 0.0..=self.full_intensity;
        let returns = 1..=las.most_returns();
        for row in 0..cloud.len {
            let place = place(cloud, row);
            if !self.holds(cloud, row) {
                let miss = place.iter().any(|x| x.is_nan());
                *if miss { &mut self.misses } else { &mut self.far } += 1;
                continue;
            }
            for (axis, value) in place.into_iter().enumerate() {
                self.low[axis] = self.low[axis].min(value);
                self.high[axis] = self.high[axis].max(value);
            }
            self.by_return[usize::from(las.return_number(cloud, row)) - 1] += 1;
            let inside = |column: &[u8]| column.get(row).is_none_or(|number| returns.contains(number));
            self.clamped_returns |= !inside(&c.return_number) || !inside(&c.return_count);
            self.clamped_intensities |= c.intensity.get(row).is_some_and(|i| !intensities.contains(i));
            self.clamped_angles |=
                c.scan_angle.get(row).is_some_and(|angle| f64::from(angle.abs()).to_degrees() > RANK_DEG + 0.5);
            self.clamped_categories |= c.category_id.get(row).is_some_and(|&id| id > u32::from(u16::MAX));
        }
    }

    /// Least and greatest coordinates, metres; 0 without points.
    fn bounds(&self) -> [[f32; 3]; 2] {
        if self.by_return == [0; 15] { [[0.0; 3]; 2] } else { [self.low, self.high] }
    }

    /// Step of the coordinates, metres.
    fn step(&self) -> f64 {
        10f64.powi(self.exponent)
    }

    /// A corner of the bounds as readers compute it from the steps in the records.
    fn corner(&self, corner: [f32; 3], cloud: &PointCloud) -> [f64; 3] {
        let origin = (cloud.origin + on_earth(cloud)).to_array();
        std::array::from_fn(|axis| {
            (f64::from(corner[axis]) * 10f64.powi(-self.exponent)).round() * self.step() + origin[axis]
        })
    }

    /// Reports losses, without counts of usual ones, so that the files of a sequence give the same warnings. `head` is
    /// the cloud without its rows.
    fn report_losses(&self, head: &PointCloud, las: &Las, report: &mut Report) {
        let name = las.info.name;
        if self.misses > 0 {
            report.warn(format!("{name}: rows without a position left out"));
        }
        if self.far > 0 {
            let points = head.len - self.misses;
            report.warn(format!(
                "{name}: {} of {points} points left out: their coordinates are out of the range of LAS",
                self.far
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
        if head.intensity_full_scale.is_none() && head.fields.contains(Field::Intensity) {
            let kept = if las.extra_bytes { format!("; {RAW_INTENSITY} holds it as it is") } else { String::new() };
            report.warn(format!(
                "{name}: the intensity of this sensor has no full scale; 65535 is the strongest point of the file{kept}"
            ));
        }
        if self.clamped_returns {
            let most = las.most_returns();
            report.warn(format!("{name}: return numbers clamped to 1 to {most}"));
        }
        if las.angle.1 == 1 && self.clamped_angles {
            report.warn(format!("{name}: scan angles beyond {RANK_DEG} degrees written as that"));
        }
        if !las.extra_bytes && self.clamped_categories {
            report.warn(format!("{name}: category ids above 65535 written as 65535"));
        }
    }
}

/// The extra dimension of intensities without a full scale (levels of sonars, and relative energy), which are scaled
/// differently in each file in the dimension of LAS.
pub const RAW_INTENSITY: &str = "raw_intensity";

/// A column for which LAS has no dimension, or only part of one, after the members of each record.
struct Extra {
    info: &'static FieldInfo,
    name: &'static str,
    /// At most 31 bytes.
    meaning: String,
    /// Whether it is a position, which has 64 bits as it includes the origin.
    positions: bool,
    /// First byte, counted from the end of the members.
    at: usize,
}

impl Extra {
    fn of(cloud: &PointCloud) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        let unscaled = cloud.intensity_full_scale.is_none();
        for info in cloud.fields.iter() {
            let (name, meaning) = match info.field {
                Field::Intensity if unscaled => (RAW_INTENSITY, "not scaled; dB for sonars".to_owned()),
                _ if info.las.is_none() => (info.name, description(info)),
                _ => continue,
            };
            let positions = cloud.offset(info.field).is_some();
            all.push(Extra { info, name, meaning, positions, at: Extra::size(&all) });
        }
        all
    }

    /// Bytes that all of `extra` take in a record.
    fn size(extra: &[Self]) -> usize {
        extra.iter().map(|e| if e.positions { 8 } else { e.info.kind.size() }).sum()
    }

    fn put(&self, cloud: &PointCloud, records: &mut [u8], size: usize, behind: usize, rows: &[usize]) {
        let at = behind + self.at;
        let rows = rows.iter().copied();
        match (cloud.column(self.info.field), offset(cloud.origin + on_earth(cloud), self.info.field)) {
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
        bytes[2] = match self.info.kind {
            _ if self.positions => 10,
            ColumnType::U8 => 1,
            ColumnType::U16 => 3,
            ColumnType::U32 => 5,
            ColumnType::F32 => 9,
            ColumnType::F64 => 10,
        };
        bytes[4..4 + self.name.len()].copy_from_slice(self.name.as_bytes());
        bytes[160..160 + self.meaning.len()].copy_from_slice(self.meaning.as_bytes());
        bytes
    }
}

/// The short form of a column's meaning, at most 31 bytes.
fn description(info: &FieldInfo) -> String {
    let unit = if matches!(info.unit, "" | "1") { String::new() } else { format!("[{}] ", info.unit) };
    let short = info.meaning.split([',', ':', ';', '(']).next().unwrap_or_default();
    unit + short.trim_end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FIELDS;

    #[test]
    fn points_out_of_reach_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let mut cloud = PointCloud { len: 4, ..PointCloud::default() };
        cloud.fields = [Field::X, Field::Y, Field::Z].into_iter().collect();
        cloud.columns.resize(cloud.fields, 4).unwrap();
        cloud.columns.x = vec![1e17, f32::INFINITY, f32::NAN, 0.0];
        let report = crate::export::write(&cloud, &folder.path().join("a.las"), None).unwrap();
        let expected = "las: 1 of 3 points left out: their coordinates are out of the range of LAS";
        assert!(report.warnings.iter().any(|warning| warning == expected), "{report:?}");
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
