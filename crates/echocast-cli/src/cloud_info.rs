//! What `echocast info` reports about a cloud.

use crate::pipe::{self, ColumnArgs};
use crate::strips::Strips;
use crate::text::{self, thousands};
use crate::{names, picture, usage};
use anyhow::{Context as _, Result};
use echocast::cloud::{Column, FieldInfo, Record};
use echocast::preview::{self, ColorBy, PreviewOptions};
use echocast::scene::NameTable;
use echocast::{Field, Frame, PointCloud, Pose, Report, shown};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Bars of a histogram.
const BARS: usize = 12;
/// Characters of the longest bar.
const LONGEST: usize = 50;
/// Most label names that are listed.
const LISTED: usize = 40;

/// Prints what is in the cloud file `file`, and draws how densely it covers the ground to `picture`.
pub fn run(file: &Path, columns: &ColumnArgs, picture: Option<&Path>, as_json: bool) -> Result<()> {
    let options = PreviewOptions::default().color(ColorBy::GroundDensity);
    if let Some(picture) = picture {
        picture::check_picture("--preview", picture, &options).map_err(usage::wrong)?;
        names::check_kept(picture, file).map_err(usage::wrong)?;
    }
    let mut report = Report::default();
    let (cloud, _) = pipe::read_cloud(file, columns, &mut report)?;
    if let Some(picture) = picture {
        report.warnings.extend(preview::write(&cloud, picture, &options).context("--preview")?.warnings);
    }
    if as_json {
        return text::print_json(&to_json(file, &cloud, &report));
    }
    text::print(&describe(file, &cloud, &report)?)
}

/// The lowest and highest number of a column, and how many values are not a number.
struct ColumnSpan {
    low: f64,
    high: f64,
    empty: usize,
}

impl ColumnSpan {
    fn of(column: Column) -> ColumnSpan {
        let mut span = ColumnSpan { low: f64::INFINITY, high: f64::NEG_INFINITY, empty: 0 };
        for value in (0..column.len()).map(|row| column.get_f64(row)) {
            span.empty += usize::from(value.is_nan());
            (span.low, span.high) = (span.low.min(value), span.high.max(value));
        }
        span
    }

    /// `None` if there are no numbers.
    fn some(self) -> Option<ColumnSpan> {
        (self.low <= self.high).then_some(self)
    }
}

/// Offset of the numbers of a column: the origin for positions.
fn offset(cloud: &PointCloud, field: Field) -> f64 {
    match field {
        Field::X | Field::TrueX | Field::CorrectedX => cloud.origin.x,
        Field::Y | Field::TrueY | Field::CorrectedY => cloud.origin.y,
        Field::Z | Field::TrueZ | Field::CorrectedZ => cloud.origin.z,
        _ => 0.0,
    }
}

/// Lowest and highest coordinates, metres.
fn bounds(cloud: &PointCloud) -> Option<[[f64; 3]; 2]> {
    let axes = [Field::X, Field::Y, Field::Z];
    let spans = axes.map(|field| ColumnSpan::of(cloud.column(field)).some());
    let [Some(x), Some(y), Some(z)] = spans else { return None };
    let [a, b, c] = axes.map(|field| offset(cloud, field));
    Some([[x.low + a, y.low + b, z.low + c], [x.high + a, y.high + b, z.high + c]])
}

/// Number of points of each number in a label column.
fn counts(ids: &[u32]) -> BTreeMap<u32, usize> {
    let mut counts = BTreeMap::new();
    for &id in ids {
        *counts.entry(id).or_default() += 1;
    }
    counts
}

/// Number of points in equal intervals of the values of a column.
struct Histogram {
    info: &'static FieldInfo,
    low: f64,
    high: f64,
    bars: [usize; BARS],
}

impl Histogram {
    /// That of the ranges of `cloud`, or else of its intensities or heights.
    fn of(cloud: &PointCloud) -> Option<Histogram> {
        let fields = [Field::Range, Field::Intensity, Field::Z].into_iter();
        let field = fields.into_iter().find(|&field| cloud.fields().contains(field))?;
        let (column, offset) = (cloud.column(field), offset(cloud, field));
        let ColumnSpan { low, high, .. } =
            ColumnSpan::of(column).some().filter(|span| (span.high - span.low).is_finite())?;
        let mut bars = [0; BARS];
        let values = (0..column.len()).map(|row| column.get_f64(row)).filter(|value| !value.is_nan());
        for value in values {
            let part = (value - low) / (high - low).max(f64::MIN_POSITIVE);
            bars[((part * BARS as f64) as usize).min(BARS - 1)] += 1;
        }
        Some(Histogram { info: field.info(), low: low + offset, high: high + offset, bars })
    }

    /// Where the bars begin, and where the last ends.
    fn edges(&self) -> [f64; BARS + 1] {
        std::array::from_fn(|bar| self.low + (self.high - self.low) * bar as f64 / BARS as f64)
    }
}

fn unit(info: &FieldInfo) -> &'static str {
    if info.unit == "1" { "" } else { info.unit }
}

fn describe(file: &Path, cloud: &PointCloud, report: &Report) -> Result<String> {
    let mut text = format!("{}\n", shown::path(file));
    writeln!(text, "points      {}", thousands(cloud.len()))?;
    if let Some([rows, columns]) = cloud.organised() {
        let misses = cloud.columns().x().iter().filter(|x| x.is_nan()).count();
        writeln!(text, "shape       {rows} rows of {columns}, {} without a return", thousands(misses))?;
    }
    if let Some([low, high]) = bounds(cloud) {
        let show = |[x, y, z]: [f64; 3]| format!("[{x:.3}, {y:.3}, {z:.3}]");
        writeln!(text, "bounds      {} to {} m", show(low), show(high))?;
        let size: [f64; 3] = std::array::from_fn(|axis| high[axis] - low[axis]);
        writeln!(text, "size        {:.3} x {:.3} x {:.3} m", size[0], size[1], size[2])?;
    }
    let at = cloud.sensor_pose.position;
    // In clouds without a sensor pose it is at the origin.
    let sensor = if cloud.sensor_pose == Pose::IDENTITY {
        String::new()
    } else {
        format!("; the sensor is at {:.3},{:.3},{:.3}", at.x, at.y, at.z)
    };
    let frame = match cloud.frame {
        Frame::World => "world",
        Frame::Sensor => "sensor: x forward, y left, z up",
    };
    writeln!(text, "coordinates {frame}{sensor}")?;
    if let Some(system) = cloud.records.system() {
        let kind = if cloud.records.wkt().is_some() { "WKT" } else { "GeoTIFF keys" };
        writeln!(text, "system      {}, as {kind}", shown::text(&system))?;
    }
    let others = others(cloud);
    if !others.is_empty() {
        writeln!(text, "records     {}", others.join(", "))?;
    }
    writeln!(text, "columns     {}", cloud.fields().iter().count())?;
    for info in cloud.fields().iter() {
        let span = ColumnSpan::of(cloud.column(info.field));
        let empty = match span.empty {
            0 => String::new(),
            count => format!(", {} empty", thousands(count)),
        };
        let offset = offset(cloud, info.field);
        let values = match span.some() {
            Some(ColumnSpan { low, high, .. }) => format!("{} to {}", number(low + offset), number(high + offset)),
            None => "no numbers".to_owned(),
        };
        writeln!(text, "  {:<18} {values} {}{empty}", info.name, unit(info))?;
    }
    let c = cloud.columns();
    let labels = &cloud.labels;
    for (title, ids, names) in [("categories", c.category_id(), &labels.category), ("parts", c.part_id(), &labels.part)]
    {
        write_labels(&mut text, title, &counts(ids), names)?;
    }
    if !c.instance_id().is_empty() {
        let count = counts(c.instance_id()).keys().filter(|&&id| id != 0).count();
        writeln!(text, "instances   {}", thousands(count))?;
    }
    if let Some(boxes) = &cloud.boxes {
        writeln!(text, "boxes       {}", thousands(boxes.len()))?;
    }
    if let Some(strips) = Strips::of(cloud) {
        text += &strips.describe();
    }
    if let Some(histogram) = Histogram::of(cloud) {
        let edges = histogram.edges();
        let most = histogram.bars.iter().copied().max().unwrap_or(0).max(1);
        writeln!(text, "{:<11} {}", histogram.info.name, unit(histogram.info))?;
        for (bar, count) in histogram.bars.iter().enumerate() {
            let signs = "#".repeat((count * LONGEST).div_ceil(most));
            let from = number(edges[bar]);
            writeln!(text, "  {from:>12} {:>12}  {signs}", thousands(*count))?;
        }
    }
    for warning in &report.warnings {
        writeln!(text, "warning: {warning}")?;
    }
    // Columns without a unit leave a blank at the end.
    Ok(text.lines().map(str::trim_end).fold(String::new(), |text, line| text + line + "\n"))
}

/// Records of other programs, whose meaning is not known here.
fn others(cloud: &PointCloud) -> Vec<String> {
    let others = cloud.records.all.iter().filter(|record| record.user != "LASF_Projection");
    let of = |record: &Record| format!("{} {} ({} bytes)", shown::text(&record.user), record.id, record.data.len());
    others.map(of).collect()
}

/// `value` with a readable number of digits.
fn number(value: f64) -> String {
    let text = if value != 0.0 && (value.abs() < 1e-3 || value.abs() >= 1e12) {
        format!("{value:.3e}")
    } else {
        format!("{value:.4}")
    };
    if text.contains(['e', 'i', 'N']) || !text.contains('.') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn write_labels(text: &mut String, title: &str, counts: &BTreeMap<u32, usize>, names: &NameTable) -> Result<()> {
    if counts.keys().all(|&id| id == 0) {
        return Ok(());
    }
    writeln!(text, "{title:<11} {}", counts.keys().filter(|&&id| id != 0).count())?;
    let mut listed: Vec<(u32, usize)> = counts.iter().map(|(&id, &count)| (id, count)).collect();
    listed.sort_by_key(|&(id, count)| (std::cmp::Reverse(count), id));
    for &(id, count) in listed.iter().take(LISTED) {
        let name = if id == 0 { "unlabelled" } else { names.name(id).unwrap_or("") };
        writeln!(text, "  {id:>4} {:<23} {}", shown::text(name), text::counted(count, "point"))?;
    }
    if listed.len() > LISTED {
        writeln!(text, "  and {} more", thousands(listed.len() - LISTED))?;
    }
    Ok(())
}

/// The content of [`describe`] as JSON.
fn to_json(file: &Path, cloud: &PointCloud, report: &Report) -> Value {
    let c = cloud.columns();
    let labels = |ids: &[u32], names: &NameTable| -> Value {
        let label = |(&id, &points): (&u32, &usize)| json!({ "id": id, "name": names.name(id), "points": points });
        counts(ids).iter().map(label).collect()
    };
    let columns = cloud.fields().iter().map(|info| {
        let span = ColumnSpan::of(cloud.column(info.field));
        let offset = offset(cloud, info.field);
        let empty = span.empty;
        let span = span.some();
        let of = |value: fn(&ColumnSpan) -> f64| span.as_ref().map(|span| value(span) + offset);
        json!({ "name": info.name, "unit": info.unit, "low": of(|s| s.low), "high": of(|s| s.high), "empty": empty })
    });
    let histogram = Histogram::of(cloud).map(
        |histogram| json!({ "column": histogram.info.name, "edges": histogram.edges(), "points": histogram.bars }),
    );
    json!({
        "file": shown::path(file),
        "points": cloud.len(),
        "shape": cloud.organised(),
        "bounds": bounds(cloud).map(|[low, high]| json!({ "low": low, "high": high })),
        "coordinates": cloud.frame.name(),
        "origin": cloud.origin.to_array(),
        "sensor_position": cloud.sensor_pose.position.to_array(),
        "sensor_orientation_xyzw": cloud.sensor_pose.orientation.to_array(),
        "intensity_full_scale": cloud.intensity_full_scale,
        "coordinate_system": cloud.records.system(),
        "wkt": cloud.records.wkt(),
        "records": others(cloud),
        "columns": columns.collect::<Vec<_>>(),
        "categories": labels(c.category_id(), &cloud.labels.category),
        "parts": labels(c.part_id(), &cloud.labels.part),
        "instances": counts(c.instance_id()).keys().filter(|&&id| id != 0).count(),
        "boxes": cloud.boxes.as_ref().map(Vec::len),
        "survey": Strips::of(cloud).map(|strips| strips.to_json()),
        "histogram": histogram,
        "warnings": report.warnings,
    })
}
