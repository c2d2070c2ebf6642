//! Which colour a point has, and what the legend says of it.

use super::ColorBy;
use super::canvas::Color;
use super::palette::{self, HEIGHT, INTENSITY, RANGE, Ramp};
use super::points::{CHUNK, Points, quantile, wide};
use crate::cloud::PointCloud;
use crate::parallel;
use crate::report::Report;
use crate::scene::NameTable;
use std::collections::HashMap;
use std::ops::Range;

/// How many names a legend lists before it sums up the rest.
const LISTED: usize = 16;
/// Part of the values at each end of a scale that shares the colour of its end.
const CLIPPED: f32 = 0.01;
/// Colours of a cloud's points.
pub(super) struct Paint<'a> {
    name: &'static str,
    source: Source<'a>,
    legend: Legend,
}

/// What the colours mean.
pub(super) enum Legend {
    /// Names, the most frequent first.
    Names(Vec<Entry>),
    /// A scale of values.
    Scale {
        /// Quantity and unit.
        caption: String,
        ramp: Ramp,
        low: f64,
        high: f64,
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
    Labels { ids: &'a [u32], listed: HashMap<u32, Color> },
    Values { values: Values<'a>, points: &'a Points<'a>, table: Vec<Color>, low: f32, high: f32 },
}

enum Values<'a> {
    Column(&'a [f32]),
    Distance,
    Height,
}

impl<'a> Paint<'a> {
    /// Colours by `color`, or by what the cloud can show instead, with a warning.
    pub(super) fn new(cloud: &'a PointCloud, points: &'a Points<'a>, color: ColorBy, report: &mut Report) -> Self {
        let (columns, rows) = (&cloud.columns, cloud.len);
        match color {
            ColorBy::Label => {
                let count = |ids: &[u32]| if ids.len() >= rows { count(ids, points) } else { HashMap::new() };
                let categories = count(&columns.category_id);
                // One category says nothing; its parts may.
                let parts = if categories.len() <= 1 { count(&columns.part_id) } else { HashMap::new() };
                if parts.len() > categories.len() {
                    return Paint::labels("part", &columns.part_id, &cloud.labels.part, &parts);
                }
                if !categories.is_empty() {
                    return Paint::labels("category", &columns.category_id, &cloud.labels.category, &categories);
                }
                report.warn("preview: the cloud has no column category_id or part_id; coloured by height instead");
                Paint::height(points)
            }
            ColorBy::Intensity if columns.intensity.len() >= rows => {
                let caption = match cloud.intensity_full_scale {
                    Some(1.0) => "intensity".to_owned(),
                    Some(full) => format!("intensity, full scale {full}"),
                    None => "intensity, relative energy".to_owned(),
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
        }
    }

    fn height(points: &'a Points<'a>) -> Self {
        Paint::values("height", "height in m".to_owned(), HEIGHT, Values::Height, points, points.height_origin)
    }

    fn labels(name: &'static str, ids: &'a [u32], names: &NameTable, counts: &HashMap<u32, usize>) -> Self {
        let mut frequent: Vec<(u32, usize)> = counts.iter().map(|(&id, &count)| (id, count)).collect();
        frequent.sort_unstable_by_key(|&(id, count)| (std::cmp::Reverse(count), id));
        // Summing up a single name would hide it without saving room.
        let listed = if frequent.len() == LISTED + 1 { LISTED + 1 } else { LISTED.min(frequent.len()) };
        let (listed, rest) = frequent.split_at(listed);
        let mut entries: Vec<Entry> = listed
            .iter()
            .map(|&(id, count)| {
                let known = names.name(id).map(str::to_owned);
                let name = known.unwrap_or_else(|| if id == 0 { "unlabelled".into() } else { format!("{name} {id}") });
                Entry { name, color: palette::category(id), count }
            })
            .collect();
        if !rest.is_empty() {
            let count = rest.iter().map(|(_, count)| count).sum();
            entries.push(Entry { name: format!("{} others", rest.len()), color: palette::OTHER, count });
        }
        let listed = listed.iter().map(|&(id, _)| (id, palette::category(id))).collect();
        Paint { name, source: Source::Labels { ids, listed }, legend: Legend::Names(entries) }
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
        let legend = Legend::Scale { caption, ramp, low: f64::from(low) + offset, high: f64::from(high) + offset };
        Paint { name, source: Source::Values { values, points, table: ramp.table(), low, high }, legend }
    }

    /// What is coloured by.
    pub(super) fn name(&self) -> &'static str {
        self.name
    }

    pub(super) fn legend(&self) -> &Legend {
        &self.legend
    }

    /// Colour of row `row`, which has a position.
    pub(super) fn color(&self, row: u32) -> Color {
        match &self.source {
            Source::Labels { ids, listed } => listed.get(&ids[row as usize]).copied().unwrap_or(palette::OTHER),
            Source::Values { values, points, table, low, high } => {
                let t = (values.get(row, points) - low) / (high - low);
                // The cast saturates: below the scale 0, NaN 0.
                table[((t * 255.0).round() as usize).min(table.len() - 1)]
            }
        }
    }
}

impl Values<'_> {
    fn get(&self, row: u32, points: &Points<'_>) -> f32 {
        match self {
            Values::Column(values) => values[row as usize],
            Values::Distance => points.get(row).map_or(f32::NAN, |position| points.distance(position)),
            Values::Height => points.get(row).map_or(f32::NAN, |position| position.z),
        }
    }
}

/// How many points have each of `ids`.
fn count(ids: &[u32], points: &Points<'_>) -> HashMap<u32, usize> {
    let count_rows = |rows: Range<usize>| {
        let mut counts = HashMap::new();
        let mut row = rows.start;
        // Neighbours mostly share their label, so runs are counted, not points.
        for run in ids[rows].chunk_by(|a, b| a == b) {
            let hits = (row..row + run.len()).filter(|&row| points.get(row as u32).is_some()).count();
            if hits > 0 {
                *counts.entry(run[0]).or_default() += hits;
            }
            row += run.len();
        }
        counts
    };
    let add = |mut sum: HashMap<u32, usize>, part: HashMap<u32, usize>| {
        for (id, count) in part {
            *sum.entry(id).or_default() += count;
        }
        sum
    };
    parallel::map_reduce(points.len(), CHUNK, count_rows, add)
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
        cloud.columns.category_id.clear();
        assert_eq!(names(&cloud, ColorBy::Label, &mut report).0, "height");
        assert_eq!(report.warnings.len(), 3, "{report:?}");
    }

    #[test]
    fn intensity_has_a_caption_and_none_is_dark() {
        let mut cloud = cloud(vec![0; 3], vec![]);
        cloud.columns.intensity = vec![1e-5, 1e-3, f32::NAN];
        let captions = [Some(1.0), Some(255.0), None].map(|full| {
            cloud.intensity_full_scale = full;
            names(&cloud, ColorBy::Intensity, &mut Report::default()).1[0].0.clone()
        });
        assert_eq!(captions, ["intensity", "intensity, full scale 255", "intensity, relative energy"]);
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

    #[test]
    fn counting_in_parallel_loses_no_run() {
        let ids: Vec<u32> = (0..300_000u32).map(|row| row / 70_000).collect();
        let cloud = cloud(ids, vec![]);
        let points = Points::new(&cloud, &mut Report::default());
        let counts = count(&cloud.columns.category_id, &points);
        assert_eq!(counts, HashMap::from([(0, 70_000), (1, 70_000), (2, 70_000), (3, 70_000), (4, 20_000)]));
    }
}
