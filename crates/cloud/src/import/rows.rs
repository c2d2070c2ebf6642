//! The rows of a cloud while they are read from a file.

use super::about::About;
use super::target::{FARTHEST, FieldTarget, axis};
use crate::{ColumnMut, Columns, Field, FieldSet, Frame, PointCloud};
use echocast_memory::tried;
use glam::DVec3;
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::report::Report;
use std::path::Path;
use std::sync::Arc;

/// Positions that are farther from the origin get another one, metres: f32 resolves 0.06 mm there.
const NEAR: f64 = 1000.0;
/// Positions that are farther from their origin may lose more than [`LOSS`], metres: f32 resolves half a millimetre
/// there.
const COARSE: f64 = 4096.0;
/// Loss up to which there is no warning, metres: half the finest step of other formats.
const LOSS: f64 = 1e-4;
/// Number of first positions that determine the origin.
const FIRST: usize = 4096;

/// Columns that grow.
pub(super) struct Rows {
    columns: Columns,
    fields: FieldSet,
    /// Origin of positions; an axis has none before its first position that is not 0.
    origin: [Option<f64>; 3],
    /// The origin if the first positions are near it.
    usual: [f64; 3],
    /// Integer columns with numbers that are not integers, or too large.
    unfit: FieldSet,
    /// Whether positions were too far away.
    far: bool,
    /// Whether positions lost precision in f32.
    coarse: bool,
    /// Colours as in the file, red, green and blue, where all of them are needed to determine the value of white.
    colours: Option<[Vec<f32>; 3]>,
}

impl Rows {
    /// Rows of `fields`, at least `count` of them. If `about` has an origin, positions are relative to it.
    pub(super) fn new(fields: FieldSet, count: usize, about: Option<&About>) -> Result<Rows> {
        let mut columns = Columns::default();
        columns.make_room(fields, count)?;
        for info in fields.iter() {
            match columns.get_mut(info.field) {
                ColumnMut::F32(c) => c.clear(),
                ColumnMut::F64(c) => c.clear(),
                ColumnMut::U8(c) => c.clear(),
                ColumnMut::U16(c) => c.clear(),
                ColumnMut::U32(c) => c.clear(),
            }
        }
        let origin = about.and_then(|about| about.f32_origin).map_or([None; 3], |origin| origin.map(Some));
        Ok(Rows {
            columns,
            fields,
            origin,
            usual: [0.0; 3],
            unfit: FieldSet::EMPTY,
            far: false,
            coarse: false,
            colours: None,
        })
    }

    /// With the origin `usual`, if positions are near it.
    pub(super) fn near(mut self, usual: [f64; 3]) -> Rows {
        self.usual = usual;
        self
    }

    /// With colours whose white may be 255, 65535 or 1.
    pub(super) fn with_any_colours(mut self) -> Rows {
        self.colours = Some(Default::default());
        self
    }

    /// Appends `values` to the column of `goal`.
    ///
    /// # Errors
    /// No memory.
    pub(super) fn add(&mut self, goal: FieldTarget, values: impl Iterator<Item = f64> + Clone) -> Result<()> {
        let FieldTarget { field, factor, mut shift } = goal;
        let axis = axis(field);
        if let Some(axis) = axis {
            shift -= self.origin_of(axis, values.clone().map(|value| value * factor + goal.shift));
        }
        let more = values.size_hint().0;
        let memory = |_| Error::Memory(format!("{more} more rows of points"));
        let values = values.map(move |value| value * factor + shift);
        let colour = [Field::Red, Field::Green, Field::Blue].iter().position(|colour| *colour == field);
        if let (Some(colours), Some(colour), true) = (&mut self.colours, colour, factor == 1.0) {
            tried(|| colours[colour].try_reserve(more)).map_err(memory)?;
            colours[colour].extend(values.map(|value| value as f32));
            return Ok(());
        }
        let (far, coarse, mut fits) = (&mut self.far, &mut self.coarse, true);
        macro_rules! whole {
            ($column:expr, $t:ty) => {{
                tried(|| $column.try_reserve(more)).map_err(memory)?;
                $column.extend(values.map(|value| {
                    let whole = value.round().clamp(0.0, f64::from(<$t>::MAX));
                    fits &= (value - whole).abs() < 0.501;
                    whole as $t
                }));
            }};
        }
        match self.columns.get_mut(field) {
            ColumnMut::F32(c) => {
                tried(|| c.try_reserve(more)).map_err(memory)?;
                if axis.is_some() {
                    c.extend(values.map(|metres| {
                        if metres.abs() <= FARTHEST {
                            let near = metres as f32;
                            *coarse |= metres.abs() > COARSE && (metres - f64::from(near)).abs() > LOSS;
                            return near;
                        }
                        *far |= !metres.is_nan();
                        f32::NAN
                    }));
                } else {
                    c.extend(values.map(|value| value as f32));
                }
            }
            ColumnMut::F64(c) => {
                tried(|| c.try_reserve(more)).map_err(memory)?;
                c.extend(values);
            }
            ColumnMut::U8(c) => whole!(c, u8),
            ColumnMut::U16(c) => whole!(c, u16),
            ColumnMut::U32(c) => whole!(c, u32),
        }
        if !fits {
            self.unfit = self.unfit.with(field);
        }
        Ok(())
    }

    /// The origin along `axis`, which may be set from the median of those `positions` that are not 0, as many programs
    /// write 0 for what was not measured.
    fn origin_of(&mut self, axis: usize, positions: impl Iterator<Item = f64>) -> f64 {
        let usual = self.usual[axis];
        if self.origin[axis].is_none() {
            let measured = positions.filter(|metres| metres.abs() <= FARTHEST && *metres != 0.0);
            let mut first: Vec<f64> = measured.take(FIRST).collect();
            if !first.is_empty() {
                let middle = first.len() / 2;
                let middle = *first.select_nth_unstable_by(middle, f64::total_cmp).1;
                let far = (middle - usual).abs() > NEAR;
                let origin = if far { (middle / NEAR).round() * NEAR } else { usual };
                self.origin[axis] = Some(origin);
                self.move_back(axis, origin - usual);
            }
        }
        self.origin[axis].unwrap_or(usual)
    }

    /// Subtracts `metres` from the positions so far along an axis that had no origin.
    fn move_back(&mut self, along: usize, metres: f64) {
        let fields: Vec<Field> = self.fields.iter().map(|info| info.field).collect();
        for field in fields.into_iter().filter(|&field| axis(field) == Some(along)) {
            if let ColumnMut::F32(column) = self.columns.get_mut(field) {
                column.iter_mut().for_each(|place| *place = (f64::from(*place) - metres) as f32);
            }
        }
    }

    /// Numbers of the columns so far.
    pub(super) fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Which columns there are.
    #[cfg(feature = "mcap")]
    pub(super) fn fields(&self) -> FieldSet {
        self.fields
    }

    /// Adds `fields` to the columns.
    pub(super) fn also(&mut self, fields: impl IntoIterator<Item = Field>) {
        self.fields = self.fields.union(fields.into_iter().collect());
    }

    /// Removes the column `field`.
    pub(super) fn forget(&mut self, field: Field) {
        self.fields = self.fields.without(field);
        match self.columns.get_mut(field) {
            ColumnMut::F32(c) => *c = Vec::new(),
            ColumnMut::F64(c) => *c = Vec::new(),
            ColumnMut::U8(c) => *c = Vec::new(),
            ColumnMut::U16(c) => *c = Vec::new(),
            ColumnMut::U32(c) => *c = Vec::new(),
        }
    }

    /// The cloud of the rows, with the metadata `about`. `name` is that of the format, for the report.
    ///
    /// # Errors
    /// Columns of unequal length.
    pub(super) fn finish(mut self, path: &Path, name: &str, about: About, report: &mut Report) -> Result<PointCloud> {
        if let Some(colours) = self.colours.take() {
            self.add_colours(&colours, name, report)?;
        }
        let Rows { columns, fields, origin, usual, unfit, far, coarse, colours: _ } = self;
        let first = fields.iter().next().ok_or_else(|| Error::parse(path, "", "has none of the columns of a cloud"))?;
        let len = columns.get(first.field).len();
        if let Some(other) = fields.iter().find(|info| columns.get(info.field).len() != len) {
            let found = columns.get(other.field).len();
            let message = format!("the column {} is {len} rows long, and {} is {found}", first.name, other.name);
            return Err(Error::parse(path, "", message));
        }
        if unfit != FieldSet::EMPTY {
            let columns: Vec<&str> = unfit.iter().map(|info| info.name).collect();
            let columns = columns.join(", ");
            report.warn(format!("{name}: numbers of {columns} that these columns cannot hold were rounded or clamped"));
        }
        if far {
            report.warn(format!("{name}: positions farther than {FARTHEST:e} m, or infinite, are left empty"));
        }
        if coarse {
            report.warn(format!(
                "{name}: positions farther than {COARSE} m from the origin of the cloud lose precision, as they are f32"
            ));
        }
        let shape = about.shape.filter(|&[rows, columns]| u64::from(rows) * u64::from(columns) == len as u64);
        if about.shape.is_some() && shape.is_none() {
            report.warn(format!("{name}: its shape does not fit its {len} rows and is left out"));
        }
        if shape.is_none() && [&columns.x, &columns.y, &columns.z].into_iter().flatten().any(|x| x.is_nan()) {
            report.warn(format!("{name}: there are rows without a position"));
        }
        let brightest = columns.intensity.iter().fold(0.0, |most: f32, &value| most.max(value));
        // Without a full scale in the file, it is inferred from the numbers.
        let below = columns.intensity.iter().any(|&value| value < 0.0);
        let guessed = [1.0, 255.0].into_iter().find(|&full| brightest <= full && !below);
        Ok(PointCloud {
            origin: DVec3::from_array(std::array::from_fn(|axis| origin[axis].unwrap_or(usual[axis]))),
            columns,
            fields,
            len,
            organised: shape,
            frame: about.frame.unwrap_or(Frame::World),
            sensor_pose: about.sensor_pose.unwrap_or(Pose::IDENTITY),
            start_time: None,
            time_zero: 0.0,
            earth_offset: DVec3::ZERO,
            intensity_full_scale: about.intensity_full_scale.unwrap_or(guessed),
            rays: 0,
            most_rays: 0,
            driver: about.driver,
            scan_line: None,
            boxes: about.boxes,
            labels: Arc::new(about.labels.las_class(about.las_class)),
            records: Arc::new(about.records),
        })
    }
}

impl Rows {
    /// Adds `colours`, of which the brightest determines the value of white.
    fn add_colours(&mut self, colours: &[Vec<f32>; 3], name: &str, report: &mut Report) -> Result<()> {
        let values = || colours.iter().flatten().copied().filter(|value| !value.is_nan());
        let brightest = values().fold(0.0, f32::max);
        let white = if brightest > 255.0 {
            65535.0
        } else if brightest <= 1.0 && values().any(|value| value.fract() != 0.0) {
            1.0
        } else {
            255.0
        };
        if white != 255.0 {
            report.warn(format!("{name}: colours from 0 to {white} are taken as 0 to 255"));
        }
        for (field, values) in [Field::Red, Field::Green, Field::Blue].into_iter().zip(colours) {
            // Those with a known value of white were added before.
            if !values.is_empty() {
                self.add(FieldTarget::scaled(field, 255.0 / white), values.iter().map(|&value| f64::from(value)))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows without a position, however many, do not prevent the choice of an origin.
    #[test]
    fn the_origin_is_where_most_points_are() {
        let x = |blocks: &[&[f64]]| {
            let mut rows = Rows::new(FieldSet::EMPTY.with(Field::X), 0, None).unwrap();
            blocks.iter().for_each(|block| rows.add(Field::X.into(), block.iter().copied()).unwrap());
            let mut report = Report::default();
            let cloud = rows.finish(Path::new("a"), "csv", About::default(), &mut report).unwrap();
            let places: Vec<f64> = cloud.columns.x.iter().map(|&x| f64::from(x) + cloud.origin.x).collect();
            (cloud.origin.x, places, report.warnings.iter().any(|warned| warned.contains("precision")))
        };
        let far = 500_000.123;
        for blocks in [&[&[0.0, far, far][..]][..], &[&[0.0, 0.0], &[f64::NAN], &[0.0, far, far]], &[&[far, 0.0, 0.0]]]
        {
            let (origin, places, warned) = x(blocks);
            assert!(origin == 500_000.0 && !warned, "{blocks:?}: {origin}");
            let expected: Vec<f64> = blocks.concat();
            let off = |(a, b): (&f64, &f64)| b.is_nan() || (a - b).abs() < 1e-4;
            assert!(places.iter().zip(&expected).all(off), "{places:?}");
        }
        assert_eq!(x(&[&[0.0, 7.5]]), (0.0, vec![0.0, 7.5], false));
        // Positions far from most of the others lose precision, with a warning; those that f32 can hold do not.
        assert!(x(&[&[far, far, far, 7.123_456]]).2 && !x(&[&[0.0, far], &[490_000.5]]).2);
    }
}
