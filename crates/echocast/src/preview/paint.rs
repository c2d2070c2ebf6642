//! The colour of each point, and what the legend says about it.

use super::canvas::Color;
use super::palette::{self, HEIGHT, INTENSITY, RANGE, Ramp, SPEED, STANDING};
use super::points::{CHUNK, Points, SAMPLE, quantile, wide};
use super::{ColorBy, density};
use crate::cloud::PointCloud;
use crate::ground::cause::Cause;
use crate::ground::parallel;
use crate::ground::report::Report;
use crate::scene::NameTable;
use glam::Vec3;
use std::collections::HashMap;
use std::ops::Range;

/// How many names a legend lists before summing up the rest.
pub(super) const LISTED: usize = 16;
/// Part of the values at each end of a scale that shares the end's colour.
const CLIPPED: f32 = 0.01;
/// What is slower than this stands, m/s.
const STANDS: f32 = 0.05;
/// A scale of radial velocities is that of the points faster than this, if there are any, not that of errors, m/s.
const MOVES: f32 = 0.5;

/// Colours of a cloud's points.
pub(super) struct Paint<'a> {
    name: &'static str,
    source: Source<'a>,
    legend: Legend,
}

/// What the colours mean.
#[derive(Clone)]
pub(super) enum Legend {
    /// Names, labels before causes, the most frequent first.
    Names(Vec<Entry>),
    /// A scale of values.
    Scale {
        /// Quantity and unit.
        caption: String,
        /// Colours at equal steps from `low` to `high`.
        table: Vec<Color>,
        low: f64,
        high: f64,
        /// What has no place on the scale.
        beside: Vec<Entry>,
    },
}

/// A name in the legend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub name: String,
    pub color: Color,
    /// Number of points.
    pub count: usize,
}

enum Source<'a> {
    Groups { groups: Groups<'a>, listed: HashMap<Group, Color> },
    Values { values: Values<'a>, points: &'a Points<'a>, table: Vec<Color>, low: f32, high: f32 },
    Motion { motion: Motion<'a>, table: Vec<Color>, low: f32, high: f32 },
}

/// What points of one colour have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Group {
    Label(u32),
    Cause(Cause),
}

/// The group of each point.
#[derive(Clone, Copy)]
struct Groups<'a> {
    /// Labels of points on surfaces; without them only causes count.
    labels: Option<&'a [u32]>,
    points: &'a Points<'a>,
}

enum Values<'a> {
    Column(&'a [f32]),
    Made(Vec<f32>),
    Distance,
    Height,
}

/// How fast points are, m/s.
#[derive(Clone, Copy)]
enum Motion<'a> {
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
                let by = |ids: &'a [u32]| (ids.len() >= rows).then_some(Groups { labels: Some(ids), points });
                let (categories, parts) = (by(&columns.category_id), by(&columns.part_id));
                let count = |groups: Option<Groups>| groups.map_or_else(HashMap::new, Groups::count);
                let labels = |counts: &HashMap<Group, usize>| {
                    counts.keys().filter(|group| matches!(group, Group::Label(_))).count()
                };
                let of_categories = count(categories);
                // A single category says nothing; its parts may.
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
                let groups = Groups { labels: None, points };
                Paint::groups("cause", groups, &NameTable::default(), &groups.count())
            }
            ColorBy::Cause => {
                report.warn("preview: the cloud has no column cause; coloured by label instead");
                Paint::new(cloud, points, ColorBy::Label, report)
            }
            ColorBy::Intensity if columns.intensity.len() >= rows => {
                let caption = match cloud.intensity_full_scale {
                    Some(1.0) => "intensity".to_owned(),
                    Some(full) => format!("intensity, full scale {full}"),
                    None => "intensity, no full scale".to_owned(),
                };
                Paint::values("intensity", caption, INTENSITY, Values::Column(&columns.intensity), points, 0.0)
            }
            ColorBy::Intensity => {
                report.warn("preview: the cloud has no column intensity; coloured by range instead");
                Paint::new(cloud, points, ColorBy::Range, report)
            }
            ColorBy::Range => {
                let values =
                    if columns.range.len() >= rows { Values::Column(&columns.range) } else { Values::Distance };
                if matches!(values, Values::Distance) {
                    report.warn(
                        "preview: the cloud has no column range; the distance from the sensor's first position stands for it",
                    );
                }
                Paint::values("range", "range in m".to_owned(), RANGE, values, points, 0.0)
            }
            ColorBy::Height => Paint::height(points),
            ColorBy::Density => {
                let caption = "points per square degree, as the sensor sees them".to_owned();
                let values = Values::Made(density::of(points));
                Paint::values("density", caption, INTENSITY, values, points, 0.0)
            }
            ColorBy::Velocity => {
                let velocity = [&columns.velocity_x, &columns.velocity_y, &columns.velocity_z].map(Vec::as_slice);
                Paint::motion("speed", "speed in m/s", Motion::Speed(velocity), rows, points).unwrap_or_else(|| {
                    report.warn("preview: the cloud has no velocities (velocity_x to _z); coloured by label instead");
                    Paint::new(cloud, points, ColorBy::Label, report)
                })
            }
            ColorBy::RadialVelocity => {
                let caption = "radial velocity in m/s, negative towards the sensor";
                let motion = Motion::Radial(&columns.radial_velocity);
                Paint::motion("radial velocity", caption, motion, rows, points).unwrap_or_else(|| {
                    report.warn("preview: the cloud has no radial_velocity; coloured by label instead");
                    Paint::new(cloud, points, ColorBy::Label, report)
                })
            }
            ColorBy::Doppler => {
                let caption = "measured radial velocity in m/s, negative towards the sensor";
                let motion = Motion::Radial(&columns.doppler);
                Paint::motion("Doppler", caption, motion, rows, points).unwrap_or_else(|| {
                    report.warn("preview: the cloud has no doppler; coloured by radial_velocity instead");
                    Paint::new(cloud, points, ColorBy::RadialVelocity, report)
                })
            }
        }
    }

    fn height(points: &'a Points<'a>) -> Self {
        Paint::values("height", "height in m".to_owned(), HEIGHT, Values::Height, points, points.height_origin)
    }

    fn groups(name: &'static str, groups: Groups<'a>, names: &NameTable, counts: &HashMap<Group, usize>) -> Self {
        let mut frequent: Vec<(Group, usize)> = counts.iter().map(|(&group, &count)| (group, count)).collect();
        frequent.sort_unstable_by_key(|&(group, count)| (std::cmp::Reverse(count), group));
        let (mut listed, causes): (Vec<_>, Vec<_>) =
            frequent.into_iter().partition(|(group, _)| matches!(group, Group::Label(_)));
        // Summing up a single name would hide it without saving space.
        let rest = if listed.len() == LISTED + 1 { Vec::new() } else { listed.split_off(LISTED.min(listed.len())) };
        let entry = |&(group, count): &(Group, usize)| {
            let name = match group {
                Group::Cause(cause) => cause.name().to_owned(),
                Group::Label(id) => match names.name(id) {
                    Some(known) => known.to_owned(),
                    None if id == 0 => "unlabelled".to_owned(),
                    None => format!("{name} {id}"),
                },
            };
            Entry { name, color: group.color(), count }
        };
        let mut entries: Vec<Entry> = listed.iter().map(entry).collect();
        if !rest.is_empty() {
            let count = rest.iter().map(|(_, count)| count).sum();
            entries.push(Entry { name: format!("{} others", rest.len()), color: palette::OTHER, count });
        }
        entries.extend(causes.iter().map(entry));
        let listed = listed.iter().chain(&causes).map(|&(group, _)| (group, group.color())).collect();
        Paint { name, source: Source::Groups { groups, listed }, legend: Legend::Names(entries) }
    }

    /// Colours by `values`, whose numbers in the legend are larger by `offset`.
    fn values(
        name: &'static str,
        caption: String,
        ramp: Ramp,
        values: Values<'a>,
        points: &'a Points<'a>,
        offset: f64,
    ) -> Self {
        let mut sample: Vec<f32> =
            points.sample.iter().map(|&(row, _)| values.get(row, points)).filter(|value| value.is_finite()).collect();
        let [low, high] = wide([quantile(&mut sample, CLIPPED), quantile(&mut sample, 1.0 - CLIPPED)]);
        let (table, ends) = (ramp.table(), [low, high].map(|end| f64::from(end) + offset));
        let legend = Legend::Scale { caption, table: table.clone(), low: ends[0], high: ends[1], beside: Vec::new() };
        Paint { name, source: Source::Values { values, points, table, low, high }, legend }
    }

    /// Colours by `motion`; `None`: it is not known of any of the points.
    fn motion(
        name: &'static str,
        caption: &str,
        motion: Motion<'a>,
        rows: usize,
        points: &'a Points<'a>,
    ) -> Option<Self> {
        if !motion.covers(rows) {
            return None;
        }
        let count = |is: fn(Motion, f32) -> bool| {
            points.count_rows(|row| points.get(row).is_some() && is(motion, motion.get(row)))
        };
        let unknown = count(|_, value| !value.is_finite());
        if unknown == points.count {
            return None;
        }
        let standing = count(|motion, value| motion.stands(value));
        let high = motion.scale(points);
        let (low, table) = match motion {
            Motion::Speed(_) => (0.0, SPEED.table()),
            Motion::Radial(_) => (-high, palette::radial()),
        };
        let entry = |name: &str, color, count| Entry { name: name.to_owned(), color, count };
        let beside = [entry("standing", STANDING, standing), entry("unknown", palette::OTHER, unknown)];
        let legend = Legend::Scale {
            caption: caption.to_owned(),
            table: table.clone(),
            low: f64::from(low),
            high: f64::from(high),
            beside: beside.into_iter().filter(|entry| entry.count > 0).collect(),
        };
        Some(Paint { name, source: Source::Motion { motion, table, low, high }, legend })
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
            Source::Groups { groups, listed } => listed.get(&groups.of(row)).copied().unwrap_or(palette::OTHER),
            Source::Values { values, points, table, low, high } => {
                let t = (values.get(row, points) - low) / (high - low);
                // The cast saturates: below the scale 0, NaN 0.
                table[((t * 255.0).round() as usize).min(table.len() - 1)]
            }
            Source::Motion { motion, table, low, high } => match motion.get(row) {
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

impl Motion<'_> {
    /// Whether it has a value for each of `rows` rows.
    fn covers(self, rows: usize) -> bool {
        match self {
            Motion::Speed(axes) => axes.iter().all(|axis| axis.len() >= rows),
            Motion::Radial(values) => values.len() >= rows,
        }
    }

    /// Of row `row`, m/s; NaN where it is unknown.
    fn get(self, row: u32) -> f32 {
        let row = row as usize;
        match self {
            Motion::Speed([x, y, z]) => Vec3::new(x[row], y[row], z[row]).length(),
            Motion::Radial(values) => values[row],
        }
    }

    /// Whether a point with `value` stands; of a radial velocity this is not known, and 0 is a value like others.
    fn stands(self, value: f32) -> bool {
        matches!(self, Motion::Speed(_)) && value < STANDS
    }

    /// The greatest speed of surfaces, without strays: the end of the scale, m/s.
    fn scale(self, points: &Points<'_>) -> f32 {
        // Of the radial velocities that a driving sensor sees, few are those of others that drive.
        let (least, clipped) = match self {
            Motion::Speed(_) => (STANDS, CLIPPED),
            Motion::Radial(_) => (MOVES, 0.2 * CLIPPED),
        };
        let faster = |than: f32| {
            // Few of many points may move, so it is them that are sampled.
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

impl Values<'_> {
    fn get(&self, row: u32, points: &Points<'_>) -> f32 {
        match self {
            Values::Column(values) => values[row as usize],
            Values::Made(values) => values[row as usize],
            Values::Distance => points.get(row).map_or(f32::NAN, |position| points.distance(position)),
            Values::Height => points.get(row).map_or(f32::NAN, |position| position.z),
        }
    }
}

impl Group {
    fn color(self) -> Color {
        match self {
            Group::Label(id) => palette::category(id),
            Group::Cause(cause) => palette::cause(cause),
        }
    }
}

impl Groups<'_> {
    fn of(&self, row: u32) -> Group {
        let cause = self.points.cause(row);
        match self.labels {
            // After reflections sound may come from the water surface, which has no label.
            Some(ids) if cause.has_surface() && (cause != Cause::Multipath || ids[row as usize] != 0) => {
                Group::Label(ids[row as usize])
            }
            _ => Group::Cause(cause),
        }
    }

    /// Number of points in each.
    fn count(self) -> HashMap<Group, usize> {
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
        let add = |mut sum: HashMap<Group, usize>, part: HashMap<Group, usize>| {
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
    use crate::cloud::FieldSet;
    use crate::scene::Labels;
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
        cloud.labels = Arc::new(Labels {
            category: names(&["chair", "desk"]),
            part: names(&["leg", "seat"]),
            ..Labels::default()
        });
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
    fn the_most_frequent_labels_stand_first() {
        let mut cloud = cloud(vec![1, 2, 2, 0, 9, 2, 1], vec![0; 7]);
        cloud.columns.y[6] = f32::NAN;
        let (name, entries) = names(&cloud, ColorBy::Label, &mut Report::default());
        let wanted = [("desk", 3), ("unlabelled", 1), ("chair", 1), ("category 9", 1)];
        assert_eq!((name, entries), ("category", wanted.map(|(n, c)| (n.to_owned(), c)).to_vec()));
    }

    #[test]
    fn what_the_air_sends_back_is_named_after_the_labels() {
        let mut cloud = cloud(vec![1, 0, 0, 0, 0, 0], vec![1, 0, 0, 0, 0, 2]);
        let causes = [Cause::Surface, Cause::Fog, Cause::Rain, Cause::Fog, Cause::FalseAlarm, Cause::Mixed];
        cloud.columns.cause = causes.map(|cause| cause as u8).to_vec();
        let list = |wanted: &[(&str, usize)]| wanted.iter().map(|&(n, c)| (n.to_owned(), c)).collect::<Vec<_>>();
        let (name, entries) = names(&cloud, ColorBy::Label, &mut Report::default());
        let wanted = [("unlabelled", 1), ("chair", 1), ("fog", 2), ("rain", 1), ("noise", 1)];
        assert_eq!((name, entries), ("category", list(&wanted)));
        let (name, entries) = names(&cloud, ColorBy::Cause, &mut Report::default());
        let wanted = [("fog", 2), ("surface", 1), ("rain", 1), ("noise", 1), ("mixed", 1)];
        assert_eq!((name, entries), ("cause", list(&wanted)));

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
    fn what_a_sonar_hears_besides_the_bed_is_named() {
        let mut cloud = cloud(vec![1, 1, 0, 0, 0], vec![]);
        let causes = [Cause::Surface, Cause::Multipath, Cause::Multipath, Cause::SeaSurface, Cause::FalseAlarm];
        cloud.columns.cause = causes.map(|cause| cause as u8).to_vec();
        let (_, entries) = names(&cloud, ColorBy::Label, &mut Report::default());
        let wanted = [("chair", 2), ("noise", 1), ("multipath", 1), ("sea surface", 1)];
        assert_eq!(entries, wanted.map(|(name, count)| (name.to_owned(), count)));
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
        assert_eq!(entries[LISTED], Entry { name: "4 others".into(), color: palette::OTHER, count: 13 + 12 + 11 + 10 });
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

    /// A floor that stands, a person and a car that move at 1.4 and 10 m/s, and a false alarm without a velocity.
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
        // The person comes nearer, the car goes away.
        c.radial_velocity =
            (0..1000).map(|row| [0.0, -1.4, 10.0, f32::NAN][row / 900 + row / 910 + row / 999]).collect();
        c.cause = vec![Cause::Surface as u8; 999];
        c.cause.push(Cause::FalseAlarm as u8);
        cloud
    }

    #[test]
    fn what_moves_has_the_colour_of_its_speed_and_what_stands_is_grey() {
        let cloud = moving();
        let points = Points::new(&cloud, &mut Report::default());
        let mut report = Report::default();
        let paint = Paint::new(&cloud, &points, ColorBy::Velocity, &mut report);
        let Legend::Scale { caption, low, high, beside, .. } = paint.legend() else { panic!("scale") };
        assert_eq!((caption.as_str(), *low, *high), ("speed in m/s", 0.0, 10.0));
        let told: Vec<_> = beside.iter().map(|entry| (entry.name.as_str(), entry.color, entry.count)).collect();
        assert_eq!(told, [("standing", STANDING, 900), ("unknown", palette::OTHER, 1)]);
        let wanted = [STANDING, SPEED.table()[(0.14f32 * 255.0).round() as usize], SPEED.color(1.0), palette::OTHER];
        assert_eq!([0, 905, 950, 999].map(|row| paint.color(row)), wanted);
        assert!(report.warnings.is_empty());
    }

    #[test]
    fn radial_velocities_are_told_apart_by_their_sign() {
        let mut cloud = moving();
        let radial = palette::radial();
        let wanted = [STANDING, radial[127 - 18], radial[254], palette::OTHER];
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
            assert_eq!([2, 905, 950].map(|row| paint.color(row)), wanted[..3]);
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
            // Not asked for, or of an instrument that does not measure it.
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
        let counts = Groups { labels: Some(&cloud.columns.category_id), points: &points }.count();
        let wanted = [(0, 70_000), (1, 70_000), (2, 70_000), (3, 70_000), (4, 20_000)];
        assert_eq!(counts, wanted.map(|(id, count)| (Group::Label(id), count)).into());
    }
}
