//! The colour of each point, and the legend that explains it.

use super::canvas::Color;
use super::palette::{self, HEIGHT, INTENSITY, RANGE, Ramp, SPEED, STANDING};
use super::points::{CHUNK, Points, SAMPLE, quantile, wide};
use super::{ColorBy, density};
use cloud::PointCloud;
use engine::scene::NameTable;
use glam::Vec3;
use ground::cause::Cause;
use ground::parallel;
use ground::path_type::PathType;
use ground::report::Report;
use std::collections::HashMap;
use std::ops::Range;

/// How many names a legend lists before summing up the rest.
pub(super) const LISTED: usize = 16;
/// Fraction of the values at each end of a scale that share the end's colour.
const CLIPPED: f32 = 0.01;
/// Points slower than this are stationary, m/s.
const STANDS: f32 = 0.05;
/// The scale of radial velocities is set by the points faster than this, if there are any, not by errors, m/s.
const MOVES: f32 = 0.5;

/// Colours of a cloud's points.
pub(super) struct Paint<'a> {
    name: &'static str,
    source: ColorSource<'a>,
    legend: Legend,
}

/// What the colours mean.
#[derive(Clone)]
pub(super) enum Legend {
    /// Names, labels before causes, the most frequent first.
    Names(Vec<LegendEntry>),
    /// A scale of values.
    Scale {
        /// Quantity and unit.
        caption: String,
        /// Colours at equal steps from `low` to `high`.
        table: Vec<Color>,
        low: f64,
        high: f64,
        /// Entries that are not on the scale.
        beside: Vec<LegendEntry>,
    },
}

/// A name in the legend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LegendEntry {
    pub name: String,
    pub color: Color,
    /// Number of points.
    pub count: usize,
}

enum ColorSource<'a> {
    Groups { groups: Groups<'a>, listed: HashMap<ColorGroup, Color> },
    Values { values: PaintValues<'a>, points: &'a Points<'a>, table: Vec<Color>, low: f32, high: f32 },
    Motion { motion: PointSpeed<'a>, table: Vec<Color>, low: f32, high: f32 },
}

/// What points of one colour have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum ColorGroup {
    Label(u32),
    Cause(Cause),
    Path(PathType),
}

/// What groups points.
#[derive(Clone, Copy)]
enum GroupsBy<'a> {
    /// Labels where they are on surfaces, else causes.
    Labels(&'a [u32]),
    Causes,
    /// The column `path`.
    Paths(&'a [u8]),
    /// The column `strip`.
    Strips(&'a [u16]),
}

/// The group of each point.
#[derive(Clone, Copy)]
struct Groups<'a> {
    by: GroupsBy<'a>,
    points: &'a Points<'a>,
}

enum PaintValues<'a> {
    Column(&'a [f32]),
    Made(Vec<f32>),
    Distance,
    Height,
}

/// How fast points are, m/s.
#[derive(Clone, Copy)]
enum PointSpeed<'a> {
    /// The length of the velocity.
    Speed([&'a [f32]; 3]),
    /// Along the beam, negative towards the sensor.
    Radial(&'a [f32]),
}

impl<'a> Paint<'a> {
    /// Colours by `color`, or by what the cloud can show instead, with a warning.
    pub(super) fn new(cloud: &'a PointCloud, points: &'a Points<'a>, color: ColorBy, report: &mut Report) -> Self {
        let (columns, rows) = (&cloud.columns, cloud.len);
        match color {
            ColorBy::Label => {
                let by = |ids: &'a [u32]| (ids.len() >= rows).then_some(Groups { by: GroupsBy::Labels(ids), points });
                let (categories, parts) = (by(&columns.category_id), by(&columns.part_id));
                let count = |groups: Option<Groups>| groups.map_or_else(HashMap::new, Groups::count);
                let labels = |counts: &HashMap<ColorGroup, usize>| {
                    counts.keys().filter(|group| matches!(group, ColorGroup::Label(_))).count()
                };
                let of_categories = count(categories);
                // A single category carries no information; its parts may.
                let of_parts = if labels(&of_categories) <= 1 { count(parts) } else { HashMap::new() };
                if let Some(parts) = parts
                    && labels(&of_parts) > labels(&of_categories)
                {
                    return Paint::groups("part", parts, &cloud.labels.part, &of_parts);
                }
                if let Some(categories) = categories {
                    return Paint::groups("category", categories, &cloud.labels.category, &of_categories);
                }
                report.warn("preview: the cloud has no column category_id or part_id; coloured by height instead");
                Paint::height(points)
            }
            ColorBy::Cause if points.have_causes() => {
                let groups = Groups { by: GroupsBy::Causes, points };
                Paint::groups("cause", groups, &NameTable::default(), &groups.count())
            }
            ColorBy::Cause => {
                report.warn("preview: the cloud has no column cause; coloured by label instead");
                Paint::new(cloud, points, ColorBy::Label, report)
            }
            ColorBy::Path if columns.path.len() >= rows => {
                let groups = Groups { by: GroupsBy::Paths(&columns.path), points };
                Paint::groups("path", groups, &NameTable::default(), &groups.count())
            }
            ColorBy::Path => {
                report.warn("preview: the cloud has no column path; coloured by label instead");
                Paint::new(cloud, points, ColorBy::Label, report)
            }
            ColorBy::Strip if columns.strip.len() >= rows => {
                let groups = Groups { by: GroupsBy::Strips(&columns.strip), points };
                Paint::groups("strip", groups, &NameTable::default(), &groups.count())
            }
            ColorBy::Strip => {
                report.warn("preview: the cloud has no column strip; coloured by label instead");
                Paint::new(cloud, points, ColorBy::Label, report)
            }
            ColorBy::Intensity if columns.intensity.len() >= rows => {
                let caption = match cloud.intensity_full_scale {
                    Some(1.0) => "intensity".to_owned(),
                    Some(full) => format!("intensity, full scale {full}"),
                    None => "intensity, no full scale".to_owned(),
                };
                Paint::values("intensity", caption, INTENSITY, PaintValues::Column(&columns.intensity), points, 0.0)
            }
            ColorBy::Intensity => {
                report.warn("preview: the cloud has no column intensity; coloured by range instead");
                Paint::new(cloud, points, ColorBy::Range, report)
            }
            ColorBy::Range => {
                let values = if columns.range.len() >= rows {
                    PaintValues::Column(&columns.range)
                } else {
                    PaintValues::Distance
                };
                if matches!(values, PaintValues::Distance) {
                    report.warn(
                        "preview: the cloud has no column range; the distance from the sensor's first position is used instead",
                    );
                }
                Paint::values("range", "range in m".to_owned(), RANGE, values, points, 0.0)
            }
            ColorBy::Height => Paint::height(points),
            ColorBy::Density => {
                let caption = "points per square degree, as the sensor sees them".to_owned();
                let values = PaintValues::Made(density::of(points));
                Paint::values("density", caption, INTENSITY, values, points, 0.0)
            }
            ColorBy::GroundDensity => {
                let values = PaintValues::Made(density::on_ground(points));
                Paint::values("density", "points per square metre".to_owned(), INTENSITY, values, points, 0.0)
            }
            ColorBy::Velocity => {
                let velocity = [&columns.velocity_x, &columns.velocity_y, &columns.velocity_z].map(Vec::as_slice);
                Paint::motion("speed", "speed in m/s", PointSpeed::Speed(velocity), rows, points).unwrap_or_else(|| {
                    report.warn("preview: the cloud has no velocities (velocity_x to _z); coloured by label instead");
                    Paint::new(cloud, points, ColorBy::Label, report)
                })
            }
            ColorBy::RadialVelocity => {
                let caption = "radial velocity in m/s, negative towards the sensor";
                let motion = PointSpeed::Radial(&columns.radial_velocity);
                Paint::motion("radial velocity", caption, motion, rows, points).unwrap_or_else(|| {
                    report.warn("preview: the cloud has no radial_velocity; coloured by label instead");
                    Paint::new(cloud, points, ColorBy::Label, report)
                })
            }
            ColorBy::Doppler => {
                let caption = "measured radial velocity in m/s, negative towards the sensor";
                let motion = PointSpeed::Radial(&columns.doppler);
                Paint::motion("Doppler", caption, motion, rows, points).unwrap_or_else(|| {
                    report.warn("preview: the cloud has no doppler; coloured by radial_velocity instead");
                    Paint::new(cloud, points, ColorBy::RadialVelocity, report)
                })
            }
        }
    }

    fn height(points: &'a Points<'a>) -> Self {
        Paint::values("height", "height in m".to_owned(), HEIGHT, PaintValues::Height, points, points.height_origin)
    }

    fn groups(name: &'static str, groups: Groups<'a>, names: &NameTable, counts: &HashMap<ColorGroup, usize>) -> Self {
        let mut frequent: Vec<(ColorGroup, usize)> = counts.iter().map(|(&group, &count)| (group, count)).collect();
        frequent.sort_unstable_by_key(|&(group, count)| (std::cmp::Reverse(count), group));
        let (mut listed, causes): (Vec<_>, Vec<_>) =
            frequent.into_iter().partition(|(group, _)| matches!(group, ColorGroup::Label(_)));
        // Summing up a single name would hide it without saving space.
        let rest = if listed.len() == LISTED + 1 { Vec::new() } else { listed.split_off(LISTED.min(listed.len())) };
        let entry = |&(group, count): &(ColorGroup, usize)| {
            let name = match group {
                ColorGroup::Cause(cause) => cause.name().to_owned(),
                ColorGroup::Path(path) => path.name().to_owned(),
                ColorGroup::Label(id) => match names.name(id) {
                    Some(known) => known.to_owned(),
                    None if id == 0 => "unlabelled".to_owned(),
                    None => format!("{name} {id}"),
                },
            };
            LegendEntry { name, color: group.color(), count }
        };
        let mut entries: Vec<LegendEntry> = listed.iter().map(entry).collect();
        if !rest.is_empty() {
            let count = rest.iter().map(|(_, count)| count).sum();
            entries.push(LegendEntry { name: format!("{} others", rest.len()), color: palette::OTHER, count });
        }
        entries.extend(causes.iter().map(entry));
        let listed = listed.iter().chain(&causes).map(|&(group, _)| (group, group.color())).collect();
        Paint { name, source: ColorSource::Groups { groups, listed }, legend: Legend::Names(entries) }
    }

    /// Colours by `values`, whose numbers in the legend are larger by `offset`.
    fn values(
        name: &'static str,
        caption: String,
        ramp: Ramp,
        values: PaintValues<'a>,
        points: &'a Points<'a>,
        offset: f64,
    ) -> Self {
        let mut sample: Vec<f32> =
            points.sample.iter().map(|&(row, _)| values.get(row, points)).filter(|value| value.is_finite()).collect();
        let [low, high] = wide([quantile(&mut sample, CLIPPED), quantile(&mut sample, 1.0 - CLIPPED)]);
        let (table, ends) = (ramp.table(), [low, high].map(|end| f64::from(end) + offset));
        let legend = Legend::Scale { caption, table: table.clone(), low: ends[0], high: ends[1], beside: Vec::new() };
        Paint { name, source: ColorSource::Values { values, points, table, low, high }, legend }
    }

    /// Colours by `motion`; `None` if it is unknown for all points.
    fn motion(
        name: &'static str,
        caption: &str,
        motion: PointSpeed<'a>,
        rows: usize,
        points: &'a Points<'a>,
    ) -> Option<Self> {
        if !motion.covers(rows) {
            return None;
        }
        let count = |is: fn(PointSpeed, f32) -> bool| {
            points.count_rows(|row| points.get(row).is_some() && is(motion, motion.get(row)))
        };
        let unknown = count(|_, value| !value.is_finite());
        if unknown == points.count {
            return None;
        }
        let standing = count(|motion, value| motion.stands(value));
        let high = motion.scale(points);
        let (low, table) = match motion {
            PointSpeed::Speed(_) => (0.0, SPEED.table()),
            PointSpeed::Radial(_) => (-high, palette::radial()),
        };
        let entry = |name: &str, color, count| LegendEntry { name: name.to_owned(), color, count };
        let beside = [entry("standing", STANDING, standing), entry("unknown", palette::OTHER, unknown)];
        let legend = Legend::Scale {
            caption: caption.to_owned(),
            table: table.clone(),
            low: f64::from(low),
            high: f64::from(high),
            beside: beside.into_iter().filter(|entry| entry.count > 0).collect(),
        };
        Some(Paint { name, source: ColorSource::Motion { motion, table, low, high }, legend })
    }

    /// What the colours show.
    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    pub(super) fn legend(&self) -> &Legend {
        &self.legend
    }

    /// Colour of row `row`, which has a position.
    pub(super) fn color(&self, row: u32) -> Color {
        match &self.source {
            ColorSource::Groups { groups, listed } => listed.get(&groups.of(row)).copied().unwrap_or(palette::OTHER),
            ColorSource::Values { values, points, table, low, high } => {
                let t = (values.get(row, points) - low) / (high - low);
                // The cast saturates: below the scale 0, NaN 0.
                table[((t * 255.0).round() as usize).min(table.len() - 1)]
            }
            ColorSource::Motion { motion, table, low, high } => match motion.get(row) {
                value if !value.is_finite() => palette::OTHER,
                value if motion.stands(value) => STANDING,
                value => {
                    let last = table.len() - 1;
                    table[(((value - low) / (high - low) * last as f32).round() as usize).min(last)]
                }
            },
        }
    }
}

impl PointSpeed<'_> {
    /// Whether it has a value for each of `rows` rows.
    fn covers(self, rows: usize) -> bool {
        match self {
            PointSpeed::Speed(axes) => axes.iter().all(|axis| axis.len() >= rows),
            PointSpeed::Radial(values) => values.len() >= rows,
        }
    }

    /// Speed of row `row`, m/s; NaN where it is unknown.
    fn get(self, row: u32) -> f32 {
        let row = row as usize;
        match self {
            PointSpeed::Speed([x, y, z]) => Vec3::new(x[row], y[row], z[row]).length(),
            PointSpeed::Radial(values) => values[row],
        }
    }

    /// Whether a point with `value` is stationary; a radial velocity does not show this, and 0 is a value like any
    /// other.
    fn stands(self, value: f32) -> bool {
        matches!(self, PointSpeed::Speed(_)) && value < STANDS
    }

    /// The greatest speed of surfaces, without outliers: the end of the scale, m/s.
    fn scale(self, points: &Points<'_>) -> f32 {
        // Few of the radial velocities that a moving sensor sees are those of other moving objects.
        let (least, clipped) = match self {
            PointSpeed::Speed(_) => (STANDS, CLIPPED),
            PointSpeed::Radial(_) => (MOVES, 0.2 * CLIPPED),
        };
        let faster = |than: f32| {
            // Few of many points may move, so only those are sampled.
            let speed = |row: u32| match points.get(row) {
                Some(_) if points.cause(row).has_surface() => self.get(row).abs(),
                _ => f32::NAN,
            };
            let moves = |row: u32| speed(row) > than && speed(row).is_finite();
            let step = points.count_rows(moves).div_ceil(SAMPLE).max(1);
            let rows = (0..points.len() as u32).filter(|&row| moves(row)).step_by(step);
            let mut speeds: Vec<f32> = rows.map(speed).collect();
            (!speeds.is_empty()).then(|| quantile(&mut speeds, 1.0 - clipped))
        };
        faster(least).or_else(|| faster(0.0)).map_or(1.0, |speed| speed.max(STANDS))
    }
}

impl PaintValues<'_> {
    fn get(&self, row: u32, points: &Points<'_>) -> f32 {
        match self {
            PaintValues::Column(values) => values[row as usize],
            PaintValues::Made(values) => values[row as usize],
            PaintValues::Distance => points.get(row).map_or(f32::NAN, |position| points.distance(position)),
            PaintValues::Height => points.get(row).map_or(f32::NAN, |position| position.z),
        }
    }
}

impl ColorGroup {
    fn color(self) -> Color {
        match self {
            ColorGroup::Label(id) => palette::category(id),
            ColorGroup::Cause(cause) => palette::cause(cause),
            ColorGroup::Path(path) => palette::path(path),
        }
    }
}

impl Groups<'_> {
    fn of(&self, row: u32) -> ColorGroup {
        let cause = self.points.cause(row);
        match self.by {
            // After reflections sound may come from the water surface, which has no label.
            GroupsBy::Labels(ids) if cause.has_surface() && (cause != Cause::Multipath || ids[row as usize] != 0) => {
                ColorGroup::Label(ids[row as usize])
            }
            GroupsBy::Paths(paths) => ColorGroup::Path(PathType::from_number(paths[row as usize]).unwrap_or_default()),
            GroupsBy::Strips(strips) => ColorGroup::Label(strips[row as usize].into()),
            _ => ColorGroup::Cause(cause),
        }
    }

    /// Number of points in each.
    fn count(self) -> HashMap<ColorGroup, usize> {
        let count_rows = |rows: Range<usize>| {
            let mut counts = HashMap::new();
            let mut hits = rows.map(|row| row as u32).filter(|&row| self.points.get(row).is_some()).peekable();
            // Neighbours mostly belong to one group, so runs are counted, not points.
            while let Some(first) = hits.next() {
                let group = self.of(first);
                let mut run = 1;
                while hits.next_if(|&row| self.of(row) == group).is_some() {
                    run += 1;
                }
                *counts.entry(group).or_default() += run;
            }
            counts
        };
        let add = |mut sum: HashMap<ColorGroup, usize>, part: HashMap<ColorGroup, usize>| {
            for (group, count) in part {
                *sum.entry(group).or_default() += count;
            }
            sum
        };
        parallel::map_reduce(self.points.len(), CHUNK, count_rows, add)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloud::FieldSet;
    use engine::scene::Labels;
    use std::collections::BTreeMap;
    use std::sync::Arc;

    fn cloud(categories: Vec<u32>, parts: Vec<u32>) -> PointCloud {
        let mut cloud = PointCloud { len: categories.len(), fields: FieldSet::default(), ..PointCloud::default() };
        cloud.columns.x = vec![0.0; cloud.len];
        cloud.columns.y = vec![0.0; cloud.len];
        cloud.columns.z = (0..cloud.len).map(|row| row as f32).collect();
        cloud.columns.category_id = categories;
        cloud.columns.part_id = parts;
        let names = |names: &[&str]| NameTable::number(names.iter().map(|n| (*n).to_owned()), &BTreeMap::new());
        cloud.labels = Arc::new(Labels::default().category(names(&["chair", "desk"])).part(names(&["leg", "seat"])));
        cloud
    }

    fn names(cloud: &PointCloud, color: ColorBy, report: &mut Report) -> (&'static str, Vec<(String, usize)>) {
        let points = Points::new(cloud, report);
        let paint = Paint::new(cloud, &points, color, report);
        match paint.legend() {
            Legend::Names(entries) => (paint.name(), entries.iter().map(|e| (e.name.clone(), e.count)).collect()),
            Legend::Scale { caption, .. } => (paint.name(), vec![(caption.clone(), 0)]),
        }
    }

    #[test]
    fn paths_have_their_names() {
        let mut cloud = cloud(vec![1; 4], vec![0; 4]);
        cloud.columns.path = vec![0, PathType::Wall as u8, PathType::Noise as u8, PathType::Wall as u8];
        let (name, entries) = names(&cloud, ColorBy::Path, &mut Report::default());
        let expected = [("wall", 2), ("direct", 1), ("noise", 1)];
        assert_eq!((name, entries), ("path", expected.map(|(name, count)| (name.to_owned(), count)).to_vec()));
        cloud.columns.path.clear();
        let mut report = Report::default();
        assert_eq!(names(&cloud, ColorBy::Path, &mut report).0, "category");
        assert!(report.warnings[0].contains("no column path"));
    }

    #[test]
    fn the_most_frequent_labels_stand_first() {
        let mut cloud = cloud(vec![1, 2, 2, 0, 9, 2, 1], vec![0; 7]);
        cloud.columns.y[6] = f32::NAN;
        let (name, entries) = names(&cloud, ColorBy::Label, &mut Report::default());
        let expected = [("desk", 3), ("unlabelled", 1), ("chair", 1), ("category 9", 1)];
        assert_eq!((name, entries), ("category", expected.map(|(n, c)| (n.to_owned(), c)).to_vec()));
    }

    #[test]
    fn backscatter_from_the_air_is_listed_after_the_labels() {
        let mut cloud = cloud(vec![1, 0, 0, 0, 0, 0], vec![1, 0, 0, 0, 0, 2]);
        let causes = [Cause::Surface, Cause::Fog, Cause::Rain, Cause::Fog, Cause::FalseAlarm, Cause::Mixed];
        cloud.columns.cause = causes.map(|cause| cause as u8).to_vec();
        let list = |expected: &[(&str, usize)]| expected.iter().map(|&(n, c)| (n.to_owned(), c)).collect::<Vec<_>>();
        let (name, entries) = names(&cloud, ColorBy::Label, &mut Report::default());
        let expected = [("unlabelled", 1), ("chair", 1), ("fog", 2), ("rain", 1), ("noise", 1)];
        assert_eq!((name, entries), ("category", list(&expected)));
        let (name, entries) = names(&cloud, ColorBy::Cause, &mut Report::default());
        let expected = [("fog", 2), ("surface", 1), ("rain", 1), ("noise", 1), ("mixed", 1)];
        assert_eq!((name, entries), ("cause", list(&expected)));

        let points = Points::new(&cloud, &mut Report::default());
        let paint = |color| Paint::new(&cloud, &points, color, &mut Report::default());
        let (label, cause) = (paint(ColorBy::Label), paint(ColorBy::Cause));
        assert_eq!([0, 1].map(|row| label.color(row)), [palette::category(1), palette::cause(Cause::Fog)]);
        assert_eq!([0, 5].map(|row| cause.color(row)), [Cause::Surface, Cause::Mixed].map(palette::cause));

        // The air is not a category: there is only one.
        cloud.columns.category_id[5] = 1;
        assert_eq!(names(&cloud, ColorBy::Label, &mut Report::default()).0, "part");
        cloud.columns.cause = vec![Cause::Fog as u8; 6];
        let only = names(&cloud, ColorBy::Label, &mut Report::default());
        assert_eq!(only, ("category", list(&[("fog", 6)])));
    }

    #[test]
    fn echoes_of_a_sonar_other_than_the_bed_are_named() {
        let mut cloud = cloud(vec![1, 1, 0, 0, 0], vec![]);
        let causes = [Cause::Surface, Cause::Multipath, Cause::Multipath, Cause::SeaSurface, Cause::FalseAlarm];
        cloud.columns.cause = causes.map(|cause| cause as u8).to_vec();
        let (_, entries) = names(&cloud, ColorBy::Label, &mut Report::default());
        let expected = [("chair", 2), ("noise", 1), ("multipath", 1), ("sea surface", 1)];
        assert_eq!(entries, expected.map(|(name, count)| (name.to_owned(), count)));
    }

    #[test]
    fn parts_stand_in_for_a_single_category() {
        let (name, entries) = names(&cloud(vec![1; 3], vec![1, 2, 2]), ColorBy::Label, &mut Report::default());
        assert_eq!((name, entries), ("part", vec![("seat".to_owned(), 2), ("leg".to_owned(), 1)]));
        let (name, _) = names(&cloud(vec![1; 3], vec![2; 3]), ColorBy::Label, &mut Report::default());
        assert_eq!(name, "category");
    }

    #[test]
    fn rare_labels_are_summed_up_in_one_colour() {
        let ids: Vec<u32> = (1..=20).flat_map(|id| vec![id; 30 - id as usize]).collect();
        let cloud = cloud(ids.clone(), vec![]);
        let points = Points::new(&cloud, &mut Report::default());
        let paint = Paint::new(&cloud, &points, ColorBy::Label, &mut Report::default());
        let Legend::Names(entries) = paint.legend() else { panic!("labels") };
        assert_eq!(entries.len(), LISTED + 1);
        assert_eq!(
            entries[LISTED],
            LegendEntry { name: "4 others".into(), color: palette::OTHER, count: 13 + 12 + 11 + 10 }
        );
        assert_eq!(paint.color(0), palette::category(1));
        assert_eq!(paint.color(ids.len() as u32 - 1), palette::OTHER);
    }

    #[test]
    fn columns_that_are_not_there_are_replaced_with_a_warning() {
        let mut report = Report::default();
        let mut cloud = cloud(vec![1, 2], vec![]);
        assert_eq!(names(&cloud, ColorBy::Intensity, &mut report).0, "range");
        assert_eq!(report.warnings.len(), 2, "{report:?}");
        assert_eq!(names(&cloud, ColorBy::Cause, &mut report).0, "category");
        assert_eq!(report.warnings.len(), 3, "{report:?}");
        cloud.columns.category_id.clear();
        assert_eq!(names(&cloud, ColorBy::Label, &mut report).0, "height");
        assert_eq!(report.warnings.len(), 4, "{report:?}");
    }

    #[test]
    fn intensity_has_a_caption_and_none_is_dark() {
        let mut cloud = cloud(vec![0; 3], vec![]);
        cloud.columns.intensity = vec![1e-5, 1e-3, f32::NAN];
        let captions = [Some(1.0), Some(255.0), None].map(|full| {
            cloud.intensity_full_scale = full;
            names(&cloud, ColorBy::Intensity, &mut Report::default()).1[0].0.clone()
        });
        assert_eq!(captions, ["intensity", "intensity, full scale 255", "intensity, no full scale"]);
        let points = Points::new(&cloud, &mut Report::default());
        let paint = Paint::new(&cloud, &points, ColorBy::Intensity, &mut Report::default());
        assert_eq!([0, 1, 2].map(|row| paint.color(row)), [0.0, 1.0, 0.0].map(|t| INTENSITY.color(t)));
    }

    #[test]
    fn scales_clip_strays_and_show_survey_heights() {
        let mut cloud = cloud(vec![0; 1000], vec![]);
        cloud.columns.z = (0..1000).map(|row| row as f32 / 100.0).collect();
        cloud.columns.z[500] = 1e6;
        cloud.origin.z = 300.0;
        let points = Points::new(&cloud, &mut Report::default());
        let paint = Paint::new(&cloud, &points, ColorBy::Height, &mut Report::default());
        let Legend::Scale { low, high, .. } = paint.legend() else { panic!("scale") };
        assert!((low - 300.1).abs() < 0.02 && (high - 309.9).abs() < 0.02, "{low} {high}");
        assert_eq!(paint.color(0), HEIGHT.color(0.0));
        assert_eq!(paint.color(500), HEIGHT.color(1.0));
    }

    /// A stationary floor, a person and a car that move at 1.4 and 10 m/s, and a false alarm without a velocity.
    fn moving() -> PointCloud {
        let mut cloud = cloud(vec![1; 1000], vec![]);
        let velocity = |row: usize| match row {
            0..900 => [0.0; 3],
            900..910 => [0.0, 1.4, 0.0],
            910..999 => [6.0, 8.0, 0.0],
            _ => [f32::NAN; 3],
        };
        let axis = |axis: usize| (0..1000).map(|row| velocity(row)[axis]).collect::<Vec<_>>();
        let c = &mut cloud.columns;
        [c.velocity_x, c.velocity_y, c.velocity_z] = [0, 1, 2].map(axis);
        // The person approaches, the car recedes.
        c.radial_velocity =
            (0..1000).map(|row| [0.0, -1.4, 10.0, f32::NAN][row / 900 + row / 910 + row / 999]).collect();
        c.cause = vec![Cause::Surface as u8; 999];
        c.cause.push(Cause::FalseAlarm as u8);
        cloud
    }

    #[test]
    fn moving_points_have_the_colour_of_their_speed_and_stationary_ones_are_grey() {
        let cloud = moving();
        let points = Points::new(&cloud, &mut Report::default());
        let mut report = Report::default();
        let paint = Paint::new(&cloud, &points, ColorBy::Velocity, &mut report);
        let Legend::Scale { caption, low, high, beside, .. } = paint.legend() else { panic!("scale") };
        assert_eq!((caption.as_str(), *low, *high), ("speed in m/s", 0.0, 10.0));
        let found: Vec<_> = beside.iter().map(|entry| (entry.name.as_str(), entry.color, entry.count)).collect();
        assert_eq!(found, [("standing", STANDING, 900), ("unknown", palette::OTHER, 1)]);
        let expected = [STANDING, SPEED.table()[(0.14f32 * 255.0).round() as usize], SPEED.color(1.0), palette::OTHER];
        assert_eq!([0, 905, 950, 999].map(|row| paint.color(row)), expected);
        assert!(report.warnings.is_empty());
    }

    #[test]
    fn radial_velocities_are_distinguished_by_their_sign() {
        let mut cloud = moving();
        let radial = palette::radial();
        let expected = [STANDING, radial[127 - 18], radial[254], palette::OTHER];
        // Errors of a measurement neither widen nor narrow the scale, nor does a false alarm.
        cloud.columns.doppler = cloud.columns.radial_velocity.clone();
        cloud.columns.doppler[..900]
            .iter_mut()
            .enumerate()
            .for_each(|(i, value)| *value = 0.03 * (i % 5) as f32 - 0.06);
        cloud.columns.doppler[999] = 60.0;
        let points = Points::new(&cloud, &mut Report::default());
        for (color, name) in
            [(ColorBy::RadialVelocity, "radial velocity in m/s"), (ColorBy::Doppler, "measured radial")]
        {
            let paint = Paint::new(&cloud, &points, color, &mut Report::default());
            let Legend::Scale { caption, low, high, beside, .. } = paint.legend() else { panic!("scale") };
            assert!(caption.starts_with(name) && (*low, *high) == (-10.0, 10.0), "{caption} {low} {high}");
            let unknown = color == ColorBy::RadialVelocity;
            assert_eq!(beside.len(), usize::from(unknown));
            assert_eq!([2, 905, 950].map(|row| paint.color(row)), expected[..3]);
            assert_eq!(paint.color(999), if unknown { palette::OTHER } else { radial[254] });
        }
    }

    #[test]
    fn a_scene_that_stands_has_a_scale_too() {
        let mut cloud = moving();
        let c = &mut cloud.columns;
        [c.velocity_x, c.velocity_y, c.velocity_z] = [(); 3].map(|()| vec![0.0; 1000]);
        c.radial_velocity = vec![0.0; 1000];
        let points = Points::new(&cloud, &mut Report::default());
        for color in [ColorBy::Velocity, ColorBy::RadialVelocity] {
            let paint = Paint::new(&cloud, &points, color, &mut Report::default());
            let Legend::Scale { high, .. } = paint.legend() else { panic!("scale") };
            assert_eq!((*high, paint.color(0)), (1.0, STANDING));
        }
    }

    #[test]
    fn velocities_that_are_not_there_are_replaced_with_a_warning() {
        for (color, warnings, name) in [
            (ColorBy::Velocity, 1, "category"),
            (ColorBy::RadialVelocity, 1, "category"),
            (ColorBy::Doppler, 2, "category"),
        ] {
            let mut cloud = moving();
            let c = &mut cloud.columns;
            // Not requested, or from an instrument that does not measure it.
            (c.velocity_x, c.radial_velocity) = (Vec::new(), vec![f32::NAN; 1000]);
            let mut report = Report::default();
            assert_eq!((names(&cloud, color, &mut report).0, report.warnings.len()), (name, warnings), "{report:?}");
        }
        let mut report = Report::default();
        assert_eq!(names(&moving(), ColorBy::Doppler, &mut report).0, "radial velocity");
        assert_eq!(report.warnings.len(), 1, "{report:?}");
    }

    #[test]
    fn counting_in_parallel_loses_no_run() {
        let ids: Vec<u32> = (0..300_000u32).map(|row| row / 70_000).collect();
        let cloud = cloud(ids, vec![]);
        let points = Points::new(&cloud, &mut Report::default());
        let counts = Groups { by: GroupsBy::Labels(&cloud.columns.category_id), points: &points }.count();
        let expected = [(0, 70_000), (1, 70_000), (2, 70_000), (3, 70_000), (4, 20_000)];
        assert_eq!(counts, expected.map(|(id, count)| (ColorGroup::Label(id), count)).into());
    }
}
