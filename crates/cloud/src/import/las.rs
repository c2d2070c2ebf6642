//! LAS and LAZ: header and records before the points by the crate `las`, points and the records after them by our own
//! code.

use super::about::About;
use super::names::{self, NamedColumn};
use super::number::{Member, blocks};
use super::rows::Rows;
use super::target::{self, FieldTarget};
use super::{Source, laz};
use crate::export::{ANGLE_STEP_DEG, RAW_INTENSITY};
use crate::{Field, FieldSet, PointCloud, Record, Records};
use ::las::raw::{Header, Vlr};
use echocast_memory::tried;
use ground::error::{Error, Result};
use ground::read::number::Number;
use ground::report::Report;
use std::collections::BTreeSet;
use std::io::{self, Read as _};

/// Bytes before the data of an extended record.
const EVLR: u64 = 60;
/// Bytes of the description of an extra dimension.
const DESCRIPTION: usize = 192;
/// Factor from 8 to 16 bits.
const WIDE: f64 = 257.0;

/// Classes of the ASPRS (LAS 1.4, table 17) that have a meaning: the names of categories if there are no others.
const CLASSES: &[(u8, &str)] = &[
    (1, "unclassified"),
    (2, "ground"),
    (3, "low vegetation"),
    (4, "medium vegetation"),
    (5, "high vegetation"),
    (6, "building"),
    (7, "low noise"),
    (8, "model key point"),
    (9, "water"),
    (10, "rail"),
    (11, "road surface"),
    (12, "overlap"),
    (13, "wire guard"),
    (14, "wire conductor"),
    (15, "transmission tower"),
    (16, "wire connector"),
    (17, "bridge deck"),
    (18, "high noise"),
    (19, "overhead structure"),
    (20, "ignored ground"),
    (21, "snow"),
    (22, "temporal exclusion"),
];

/// Offsets of the members of a point format, bytes.
struct LasLayout {
    size: usize,
    /// Formats from 6 on have wider members.
    wide: bool,
    time: Option<usize>,
    colour: Option<usize>,
    /// Members that a cloud cannot hold: name, first byte, bytes.
    others: Vec<(&'static str, usize, usize)>,
}

/// The layout of the point format `number`, if there is one.
fn layout(number: u8) -> Option<LasLayout> {
    // Size, time, colour, near infrared, waveform.
    let (size, time, colour, infrared, wave) = match number {
        0 => (20, None, None, None, None),
        1 => (28, Some(20), None, None, None),
        2 => (26, None, Some(20), None, None),
        3 => (34, Some(20), Some(28), None, None),
        4 => (57, Some(20), None, None, Some(28)),
        5 => (63, Some(20), Some(28), None, Some(34)),
        6 => (30, Some(22), None, None, None),
        7 => (36, Some(22), Some(30), None, None),
        8 => (38, Some(22), Some(30), Some(36), None),
        9 => (59, Some(22), None, None, Some(30)),
        10 => (67, Some(22), Some(30), Some(36), Some(38)),
        _ => return None,
    };
    let wide = number >= 6;
    let mut others = vec![("user_data", 17, 1)];
    others.extend(infrared.map(|at| ("nir", at, 2)));
    others.extend(wave.map(|at| ("wavepacket_index", at, 1)));
    Some(LasLayout { size, wide, time, colour, others })
}

impl LasLayout {
    fn classification(&self) -> usize {
        if self.wide { 16 } else { 15 }
    }

    /// The byte whose two highest bits are the direction of the scan and the edge of the flight line.
    fn flags(&self) -> usize {
        if self.wide { 15 } else { 14 }
    }

    /// Number of the scan angle, its first byte and its step, degrees (specification, 2.6 and 2.5).
    fn angle(&self) -> (Number, usize, f64) {
        if self.wide { (Number::I16, 18, ANGLE_STEP_DEG) } else { (Number::I8, 16, 1.0) }
    }

    /// First byte of the point source id.
    fn source_id(&self) -> usize {
        if self.wide { 20 } else { 18 }
    }

    /// Bits of the return number, and of the number of returns above them.
    fn return_bits(&self) -> u32 {
        if self.wide { 4 } else { 3 }
    }

    /// Bits of the classification byte that are the class.
    fn class_mask(&self) -> u8 {
        if self.wide { 0xff } else { 0x1f }
    }
}

/// The records before and after the points.
#[derive(Default)]
struct LasRecords {
    about: Option<About>,
    extra: Vec<u8>,
    laz: Option<Vec<u8>>,
    others: Vec<Record>,
    /// Records that refer to points or waveforms in this file, and would be wrong in any other.
    lost: Vec<String>,
}

impl LasRecords {
    /// Takes the record of `user` with the number `id`.
    fn take(&mut self, source: &Source, user: &[u8], id: u16, description: &[u8], data: Vec<u8>) -> Result<()> {
        match (user, id) {
            (b"LASF_Spec", 4) => self.extra = data,
            (b"laszip encoded", 22204) => self.laz = Some(data),
            (b"echocast", 1) => self.about = Some(About::parse(source.path, &data)?),
            // Waveform packets and their descriptors; the index of COPC; of LAStools, a tile and its surroundings, the
            // original header, the index.
            (b"LASF_Spec", 100..=354 | 65535) | (b"copc", _) | (b"LAStools", 10 | 20 | 30) => {
                let name = format!("{} {id}", ascii(user));
                self.lost.push(name);
            }
            _ => self.others.push(Record { user: ascii(user), id, description: ascii(description), data }),
        }
        Ok(())
    }
}

/// A text of LAS without its trailing zeros; only ASCII is allowed.
fn ascii(bytes: &[u8]) -> String {
    user(bytes).iter().map(|&byte| if byte.is_ascii() { char::from(byte) } else { '?' }).collect()
}

/// How points are stored.
struct LasPoints {
    layout: LasLayout,
    format: u8,
    compressed: bool,
    /// Bytes of a point.
    size: usize,
    count: u64,
    scale: [f64; 3],
    offset: [f64; 3],
}

impl LasPoints {
    fn of(header: &Header, source: &Source) -> Result<LasPoints> {
        let format = header.point_data_record_format & 0x3f;
        let wrong = || source.error(format!("its points are of format {format}; allowed: 0 to 10"));
        let layout = layout(format).ok_or_else(wrong)?;
        let size = usize::from(header.point_data_record_length);
        if size < layout.size {
            let message = format!("says that a point has {size} bytes; those of format {format} have {}", layout.size);
            return Err(source.error(message));
        }
        let old = u64::from(header.number_of_point_records);
        let count = header.large_file.map_or(old, |large| large.number_of_point_records.max(old));
        let scale = [header.x_scale_factor, header.y_scale_factor, header.z_scale_factor];
        let offset = [header.x_offset, header.y_offset, header.z_offset];
        let sane = |x: &f64| x.is_finite() && x.abs() <= target::FARTHEST;
        if !scale.iter().chain(&offset).all(sane) || scale.contains(&0.0) {
            let found = format!("scales coordinates by {scale:?} from {offset:?}");
            return Err(source.error(format!("{found}; allowed: finite numbers, scales that are not 0")));
        }
        let compressed = header.point_data_record_format >= 0x40;
        Ok(LasPoints { layout, format, compressed, size, count, scale, offset })
    }

    /// Colours and their offsets.
    fn colour(&self) -> Option<[(Field, usize); 3]> {
        self.layout.colour.map(|at| [(Field::Red, at), (Field::Green, at + 2), (Field::Blue, at + 4)])
    }

    /// Numbers from which columns are made: those of every file, and those of `ours`.
    fn members(&self, full_scale: Option<f32>, ours: Option<Ours>) -> Vec<Member> {
        let mut members = Vec::new();
        let mut take = |field, number, at, factor| {
            members.push(Member { goal: FieldTarget::scaled(field, factor), number, at });
        };
        if let Some(full) = full_scale {
            take(Field::Intensity, Number::U16, 12, f64::from(full) / 65535.0);
        }
        if let Some(at) = self.layout.time {
            take(Field::Time, Number::F64, at, 1.0);
        }
        let source_id = if ours == Some(Ours::Simple) { Field::CategoryId } else { Field::Strip };
        take(source_id, Number::U16, self.layout.source_id(), 1.0);
        let (number, at, step_deg) = self.layout.angle();
        take(Field::ScanAngle, number, at, step_deg.to_radians());
        if ours.is_some() {
            self.colour().into_iter().flatten().for_each(|(field, at)| take(field, Number::U16, at, 1.0 / WIDE));
        }
        for (axis, field) in [Field::X, Field::Y, Field::Z].into_iter().enumerate() {
            let goal = FieldTarget { field, factor: self.scale[axis], shift: self.offset[axis] };
            members.push(Member { goal, number: Number::I32, at: axis * 4 });
        }
        members
    }
}

/// A file of ours.
#[derive(Clone, Copy, PartialEq)]
enum Ours {
    /// A file with all columns.
    Whole,
    /// A file with the category in place of the flight line.
    Simple,
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let (header, mut records) = header(source)?;
    names::lost(records.lost.iter().map(String::as_str), "las", report);
    let points = LasPoints::of(&header, source)?;
    let mut ours = records.about.as_ref().map(|_| Ours::Whole);
    if header.generating_software.starts_with(b"echocast ") && points.format == 2 && ours.is_none() {
        records.about = About::beside(source.path)?;
        ours = records.about.as_ref().map(|_| Ours::Simple);
    }
    let mut about = records.about.unwrap_or_default();
    let full_scale = about.intensity_full_scale.unwrap_or(Some(1.0));
    about.intensity_full_scale = Some(full_scale);
    about.records = Records { all: records.others, standard_time: header.global_encoding & 1 != 0 };
    // Coordinates are relative to it.
    about.f32_origin = ours.map(|_| points.offset);

    let mut members = points.members(full_scale, ours);
    let of = |members: &[Member]| -> FieldSet { members.iter().map(|member| member.goal.field).collect() };
    let bits = [Field::ReturnNumber, Field::ReturnCount, Field::ScanDirection, Field::EdgeOfLine];
    let usual = of(&members).union(bits.into_iter().collect());
    let colours: FieldSet = points.colour().into_iter().flatten().map(|(field, _)| field).collect();
    let mut extra = extra(&records.extra, points.layout.size, points.size, report);
    extra.retain(|member| !usual.union(colours).contains(member.goal.field));
    members.extend(extra);
    let mut columns = usual.union(of(&members));
    let scanner_channels = ours.is_none() && points.layout.wide && !columns.contains(Field::Channel);
    if scanner_channels {
        columns = columns.with(Field::Channel);
    }
    let classes = !columns.contains(Field::CategoryId);
    columns = columns.with(Field::CategoryId);
    if let Some(names) = &about.columns {
        let had = names.iter().filter_map(|name| Field::from_name(name).ok());
        // Positions are present in any case.
        let had: FieldSet = had.chain([Field::X, Field::Y, Field::Z]).collect();
        columns = columns.iter().map(|info| info.field).filter(|&field| had.contains(field)).collect();
    }
    members.retain(|member| columns.contains(member.goal.field));

    let start = u64::from(header.offset_to_point_data);
    // Memory is allocated for points that the file holds, not for the number of compressed ones that it claims.
    let room = if points.compressed { 0 } else { source.check_count(points.count, points.size, start)? };
    let rows = Rows::new(columns, room, Some(&about))?.near(points.offset);
    let (size, count, compressed) = (points.size, points.count, points.compressed);
    let mut pass = Pass::new(points, rows, members, columns, [classes, scanner_channels], ours);
    match &records.laz {
        Some(record) if compressed => laz::read(source, record, start, count, size, |records| pass.take(records))?,
        None if compressed => {
            return Err(source.error("is compressed, and its record of LASzip, which says how, is missing"));
        }
        _ => blocks(source, source.from(start)?, size, room, |records| pass.take(records))?,
    }
    pass.finish(source, about, report)
}

/// One pass over the points.
struct Pass {
    points: LasPoints,
    rows: Rows,
    members: Vec<Member>,
    columns: FieldSet,
    /// Whether categories are the classes.
    classes: bool,
    /// Whether channels are those of LAS.
    scanner_channels: bool,
    ours: Option<Ours>,
    /// Colours of other programs; all of them are needed to decide whether they have 8 bits.
    colours: [Vec<u16>; 3],
    /// Pairs of a category and a class.
    seen: BTreeSet<(u32, u8)>,
    /// Members that are not 0 and that a cloud cannot hold.
    lost: BTreeSet<&'static str>,
}

impl Pass {
    fn new(
        points: LasPoints,
        rows: Rows,
        members: Vec<Member>,
        columns: FieldSet,
        [classes, scanner_channels]: [bool; 2],
        ours: Option<Ours>,
    ) -> Pass {
        let (colours, seen, lost) = Default::default();
        Pass { points, rows, members, columns, classes, scanner_channels, ours, colours, seen, lost }
    }

    fn take(&mut self, records: &[u8]) -> Result<()> {
        let Pass { points: LasPoints { layout, size, .. }, rows, columns, .. } = self;
        let size = *size;
        let before = rows.columns().x.len();
        self.members.iter().try_for_each(|member| member.take(records, size, false, rows))?;
        let all = |at: usize| records.chunks_exact(size).map(move |record| record[at]);
        let (bits, mask) = (layout.return_bits(), (1 << layout.return_bits()) - 1);
        if columns.contains(Field::ReturnNumber) {
            rows.add(Field::ReturnNumber.into(), all(14).map(|byte| f64::from(byte & mask)))?;
        }
        if columns.contains(Field::ReturnCount) {
            rows.add(Field::ReturnCount.into(), all(14).map(|byte| f64::from(byte >> bits & mask)))?;
        }
        for (field, bit) in [(Field::ScanDirection, 6), (Field::EdgeOfLine, 7)] {
            if columns.contains(field) {
                rows.add(field.into(), all(layout.flags()).map(|byte| f64::from(byte >> bit & 1)))?;
            }
        }
        if self.scanner_channels {
            rows.add(Field::Channel.into(), all(layout.flags()).map(|byte| f64::from(byte >> 4 & 3)))?;
        }
        let class_mask = layout.class_mask();
        let classes = all(layout.classification()).map(|byte| byte & class_mask);
        if self.classes && columns.contains(Field::CategoryId) {
            rows.add(Field::CategoryId.into(), classes.clone().map(f64::from))?;
        }
        let categories = rows.columns().category_id.get(before..).unwrap_or_default();
        let mut last = (0, 0);
        for pair in categories.iter().copied().zip(classes) {
            // There are few, except in a damaged file.
            if pair != last && pair.1 != 0 && self.seen.len() < 1 << 16 {
                self.seen.insert(pair);
                last = pair;
            }
        }
        self.take_others(records)
    }

    /// Takes colours of other programs, and records members that a cloud cannot hold.
    fn take_others(&mut self, records: &[u8]) -> Result<()> {
        let Pass { points, ours, .. } = self;
        let size = points.size;
        if let (Some(colour), None) = (points.colour(), *ours) {
            for ((_, at), colours) in colour.iter().zip(&mut self.colours) {
                let values = records.chunks_exact(size).map(|record| record[*at..].first_chunk().copied());
                tried(|| colours.try_reserve(records.len() / size))
                    .map_err(|_| Error::Memory("colours of points".into()))?;
                colours.extend(values.map(|bytes| bytes.map_or(0, u16::from_le_bytes)));
            }
        }
        for &(name, at, bytes) in &points.layout.others {
            // User data is the cause in files of ours, which hold it once more.
            let known = self.lost.contains(name) || ours.is_some() && name == "user_data";
            if !known && records.chunks_exact(size).any(|record| record[at..at + bytes].iter().any(|&b| b != 0)) {
                self.lost.insert(name);
            }
        }
        Ok(())
    }

    fn finish(self, source: &Source, mut about: About, report: &mut Report) -> Result<PointCloud> {
        let Pass { points, mut rows, colours, seen, lost, ours, classes, scanner_channels, .. } = self;
        if ours.is_some() {
            about.las_class = seen.into_iter().collect();
        } else {
            if let Some(colour) = points.colour() {
                add_colours(&mut rows, colour.map(|(field, _)| field), &colours)?;
            }
            forget_empty(&mut rows, classes, scanner_channels);
            if classes {
                seen.into_iter().for_each(|(_, class)| name_class(&mut about, class));
            }
        }
        names::lost(lost.into_iter(), "las", report);
        rows.finish(source.path, "las", about, report)
    }
}

/// Adds the colours of another program, if there are any; white is 65535 there, or 255.
fn add_colours(rows: &mut Rows, fields: [Field; 3], colours: &[Vec<u16>; 3]) -> Result<()> {
    let brightest = colours.iter().flatten().max().copied().unwrap_or(0);
    if brightest == 0 {
        return Ok(());
    }
    rows.also(fields);
    for (field, values) in fields.into_iter().zip(colours) {
        let goal = FieldTarget::scaled(field, if brightest < 256 { 1.0 } else { 1.0 / WIDE });
        rows.add(goal, values.iter().map(|&value| f64::from(value)))?;
    }
    Ok(())
}

/// Removes columns that are 0 everywhere: they were not measured.
fn forget_empty(rows: &mut Rows, classes: bool, scanner_channels: bool) {
    let c = rows.columns();
    if c.x.is_empty() {
        return;
    }
    let empty = [
        (Field::Intensity, c.intensity.iter().all(|&value| value == 0.0)),
        (Field::Time, c.time.iter().all(|&value| value == 0.0)),
        (Field::CategoryId, classes && c.category_id.iter().all(|&id| id == 0)),
        (Field::ReturnNumber, c.return_number.iter().all(|&number| number == 0)),
        (Field::ReturnCount, c.return_count.iter().all(|&count| count == 0)),
        (Field::Channel, scanner_channels && c.channel.iter().all(|&channel| channel == 0)),
        (Field::ScanAngle, c.scan_angle.iter().all(|&angle| angle == 0.0)),
        (Field::ScanDirection, c.scan_direction.iter().all(|&flag| flag == 0)),
        (Field::EdgeOfLine, c.edge_of_line.iter().all(|&flag| flag == 0)),
        (Field::Strip, c.strip.iter().all(|&strip| strip == 0)),
    ];
    empty.into_iter().filter(|(_, empty)| *empty).for_each(|(field, _)| rows.forget(field));
}

/// Adds a category for `class`, which is higher than those before.
fn name_class(about: &mut About, class: u8) {
    let known = CLASSES.iter().find(|(number, _)| *number == class);
    let category = &mut about.labels.category;
    category.ids.push(class.into());
    category.names.push(known.map_or_else(|| format!("class {class}"), |(_, name)| (*name).to_owned()));
    about.las_class.insert(class.into(), class);
}

/// The header, and the records that concern the cloud.
fn header(source: &Source) -> Result<(Header, LasRecords)> {
    let failed = |error: ::las::Error, place: &str| match error {
        ::las::Error::Io(error) => source.failed(error, place),
        other => source.failed(io::Error::other(other), place),
    };
    let header = Header::read_from(source.from(0)?).map_err(|error| failed(error, "its header"))?;
    let mut around = LasRecords::default();
    let mut file = source.from(header.header_size.into())?;
    for _ in 0..header.number_of_variable_length_records {
        let record = Vlr::read_from(&mut file, false);
        let record = record.map_err(|error| failed(error, "the records before its points"))?;
        around.take(source, user(&record.user_id), record.record_id, &record.description, record.data)?;
    }
    // Not by the crate, which allocates memory for any length that they claim.
    let behind = |error| source.failed(error, "the records behind its points");
    let mut at = header.evlr.map_or(0, |evlr| evlr.start_of_first_evlr);
    for _ in 0..header.evlr.map_or(0, |evlr| evlr.number_of_evlrs) {
        let mut file = source.from(at)?;
        let mut head = [0; EVLR as usize];
        file.read_exact(&mut head).map_err(behind)?;
        let bytes = head[20..].first_chunk().copied().map_or(0, u64::from_le_bytes);
        at = at.saturating_add(EVLR).saturating_add(bytes);
        if at > source.length {
            return Err(behind(io::ErrorKind::UnexpectedEof.into()));
        }
        let id = u16::from_le_bytes([head[18], head[19]]);
        let mut data = Vec::new();
        file.take(bytes).read_to_end(&mut data).map_err(behind)?;
        around.take(source, user(&head[2..18]), id, &head[28..], data)?;
    }
    Ok((header, around))
}

/// The owner of a record, without trailing zeros.
fn user(id: &[u8]) -> &[u8] {
    id.split(|&byte| byte == 0).next().unwrap_or_default()
}

/// Extra dimensions in `descriptions` that a cloud can hold; they start at byte `at` of records of `size` bytes.
fn extra(descriptions: &[u8], mut at: usize, size: usize, report: &mut Report) -> Vec<Member> {
    let mut columns = Vec::new();
    let mut places = Vec::new();
    let mut left = Vec::new();
    for entry in descriptions.chunks_exact(DESCRIPTION) {
        let name = String::from_utf8_lossy(user(&entry[4..36])).into_owned();
        let (kind, options) = (entry[2], entry[3]);
        // Types 11 to 30 are two and three numbers of the types 1 to 10.
        let (number, numbers) = match kind {
            0 => (None, usize::from(options)),
            1..=30 => {
                let number = [
                    Number::U8,
                    Number::I8,
                    Number::U16,
                    Number::I16,
                    Number::U32,
                    Number::I32,
                    Number::U64,
                    Number::I64,
                    Number::F32,
                    Number::F64,
                ][usize::from(kind - 1) % 10];
                (Some(number), usize::from(kind - 1) / 10 + 1)
            }
            _ => break,
        };
        let bytes = number.map_or(1, Number::size) * numbers;
        if at + bytes > size {
            break;
        }
        match number {
            Some(number) if numbers == 1 => {
                let float = |at: usize| entry[at..].first_chunk().copied().map_or(0.0, f64::from_le_bytes);
                let scale = if kind > 0 && options & 8 != 0 { float(112) } else { 1.0 };
                let offset = if kind > 0 && options & 16 != 0 { float(136) } else { -0.0 };
                let name = if name == RAW_INTENSITY { Field::Intensity.info().name.to_owned() } else { name };
                columns.push(NamedColumn { name, number });
                places.push((at, scale, offset));
            }
            _ => left.push(name),
        }
        at += bytes;
    }
    names::lost(left.iter().map(String::as_str), "las", report);
    let goals = names::goals(&columns, "las", report);
    let member = |(goal, column): (FieldTarget, &NamedColumn), (at, scale, offset): (usize, f64, f64)| Member {
        goal: FieldTarget { factor: goal.factor * scale, shift: offset, ..goal },
        number: column.number,
        at,
    };
    let members = goals.into_iter().zip(&columns).zip(places);
    members.filter_map(|((goal, column), place)| goal.map(|goal| member((goal, column), place))).collect()
}
