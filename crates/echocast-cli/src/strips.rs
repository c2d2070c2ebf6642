//! What `echocast info` reports about the strips of a survey: points, times, densities and overlap.

use crate::text::thousands;
use echocast::PointCloud;
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt::Write as _;

/// Points in a typical cell: their number is accurate to a sixth.
const IN_CELL: f64 = 36.0;
/// Passes in which the size of cells approaches that.
const PASSES: usize = 3;
/// Finest cells, m.
const FINEST_M: f64 = 0.01;

/// The strips of a cloud, and all of them together.
pub struct Strips {
    each: BTreeMap<u16, StripSummary>,
    all: StripCoverage,
    /// Part of the area that is in several strips.
    overlap: f64,
    /// Side of the cells in which points are counted, m.
    cell_m: f64,
}

/// What is known of a strip.
struct StripSummary {
    points: usize,
    /// First and last time, s; `None`: the cloud has none.
    times: Option<[f64; 2]>,
    coverage: StripCoverage,
}

/// How densely the ground is covered.
#[derive(Clone, Copy, Default)]
struct StripCoverage {
    area_m2: f64,
    returns: usize,
    /// Last returns of their pulses.
    last: usize,
}

/// Points of a cell, and how many of them are last returns.
type CellCounts = HashMap<(i32, i32), [usize; 2]>;

impl StripCoverage {
    fn of(cells: &CellCounts, cell_m: f64) -> StripCoverage {
        let sum = |index: usize| cells.values().map(|counts| counts[index]).sum();
        StripCoverage { area_m2: cells.len() as f64 * cell_m * cell_m, returns: sum(0), last: sum(1) }
    }

    /// Points, and last returns, per square metre.
    fn densities(self) -> [f64; 2] {
        [self.returns, self.last].map(|count| count as f64 / self.area_m2.max(f64::MIN_POSITIVE))
    }
}

impl Strips {
    /// Those of `cloud`; `None`: it has none, or no positions.
    pub fn of(cloud: &PointCloud) -> Option<Strips> {
        let c = cloud.columns();
        let is_point = |&row: &usize| c.x()[row].is_finite() && c.y()[row].is_finite();
        if c.strip().is_empty() || c.x().is_empty() || c.y().is_empty() || c.strip().iter().all(|&strip| strip == 0) {
            return None;
        }
        let rows = || (0..cloud.len()).filter(is_point);
        let span = |column: &[f32]| {
            let ends = rows().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], row| {
                [low.min(column[row]), high.max(column[row])]
            });
            f64::from(ends[1]) - f64::from(ends[0])
        };
        let count = rows().count();
        if count == 0 {
            return None;
        }
        let cell = |row: usize, cell_m: f64| [c.x()[row], c.y()[row]].map(|x| (f64::from(x) / cell_m).floor() as i32);
        let mut cell_m = (IN_CELL * span(c.x()) * span(c.y()) / count as f64).sqrt().max(FINEST_M);
        // Strips may cover little of the rectangle around them.
        for _ in 0..PASSES {
            let covered = rows().map(|row| cell(row, cell_m)).collect::<HashSet<_>>().len();
            cell_m = (IN_CELL * covered as f64 * cell_m * cell_m / count as f64).sqrt().max(FINEST_M);
        }
        let mut cells = BTreeMap::<u16, CellCounts>::new();
        let mut each = BTreeMap::<u16, StripSummary>::new();
        for row in rows() {
            let strip = c.strip()[row];
            let [x, y] = cell(row, cell_m);
            let number = |column: &[u8]| column.get(row).copied().unwrap_or(1);
            let is_last = number(c.return_number()) == number(c.return_count());
            let counts = cells.entry(strip).or_default().entry((x, y)).or_default();
            counts[0] += 1;
            counts[1] += usize::from(is_last);
            let summary = each.entry(strip).or_insert(StripSummary {
                points: 0,
                times: None,
                coverage: StripCoverage::default(),
            });
            summary.points += 1;
            if let Some(&time) = c.time().get(row) {
                let [first, last] = summary.times.unwrap_or([time; 2]);
                summary.times = Some([first.min(time), last.max(time)]);
            }
        }
        let mut together = CellCounts::new();
        let mut strips_there = HashMap::<(i32, i32), usize>::new();
        for (strip, cells) in &cells {
            for (&place, counts) in cells {
                let sum = together.entry(place).or_default();
                sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
                *strips_there.entry(place).or_default() += 1;
            }
            if let Some(summary) = each.get_mut(strip) {
                summary.coverage = StripCoverage::of(cells, cell_m);
            }
        }
        let shared = strips_there.values().filter(|&&strips| strips > 1).count();
        let overlap = shared as f64 / strips_there.len().max(1) as f64;
        Some(Strips { each, all: StripCoverage::of(&together, cell_m), overlap, cell_m })
    }

    /// As lines of text.
    pub fn describe(&self) -> String {
        let mut text = format!("strips      {}\n", self.each.len());
        let densities = |coverage: StripCoverage| {
            let [all, last] = coverage.densities();
            format!("{all:.4} points/m^2, {last:.4} of last returns")
        };
        for (strip, summary) in &self.each {
            let times = summary.times.map_or_else(String::new, |[from, to]| format!(", {from:.3} to {to:.3} s"));
            let points = thousands(summary.points);
            let _ = writeln!(text, "  {strip:<6} {points:>13} points{times}, {}", densities(summary.coverage));
        }
        let _ = writeln!(
            text,
            "density     {} over {:.0} m^2, in cells of {:.2} m",
            densities(self.all),
            self.all.area_m2,
            self.cell_m
        );
        let _ = writeln!(text, "overlap     {:.1} % of the area is in several strips", 100.0 * self.overlap);
        text
    }

    /// As JSON, with densities per square metre.
    pub fn to_json(&self) -> Value {
        let coverage = |coverage: StripCoverage| {
            let [density, last] = coverage.densities();
            json!({"area_m2": coverage.area_m2, "density": density, "density_of_last_returns": last})
        };
        let strip = |(number, summary): (&u16, &StripSummary)| {
            json!({"strip": number, "points": summary.points, "time_s": summary.times,
                "coverage": coverage(summary.coverage)})
        };
        json!({"strips": self.each.iter().map(strip).collect::<Vec<_>>(), "coverage": coverage(self.all),
            "overlap": self.overlap, "cell_m": self.cell_m})
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echocast::FieldSet;

    /// Two strips of 16 points per square metre, 70 m long, of which 40 m are common, and half of whose points are last
    /// returns.
    #[test]
    fn densities_and_overlap_are_those_of_the_points() {
        let fields = FieldSet::parse("x,y,z,time,return_number,return_count,strip").unwrap();
        let rows: Vec<(u16, f32, f32)> = [(3, -50, 20), (4, -20, 50)]
            .into_iter()
            .flat_map(|(strip, from, to)| {
                (from * 4..to * 4).flat_map(move |x| (0..400).map(move |y| (strip, x as f32 / 4.0, y as f32 / 4.0)))
            })
            .collect();
        let mut cloud = PointCloud::new(fields, rows.len()).unwrap();
        let columns = cloud.columns_mut();
        for (row, &(strip, x, y)) in rows.iter().enumerate() {
            (columns.strip[row], columns.x[row], columns.y[row]) = (strip, x + 0.125, y + 0.125);
            (columns.return_number[row], columns.return_count[row]) = (1 + (row % 2) as u8, 2);
            columns.time[row] = f64::from(strip) * 100.0 + row as f64 * 1e-5;
        }
        let strips = Strips::of(&cloud).unwrap();
        assert_eq!(strips.each.keys().copied().collect::<Vec<_>>(), [3, 4]);
        let [density, last] = strips.each[&3].coverage.densities();
        assert!((density / 16.0 - 1.0).abs() < 0.06 && (last / density - 0.5).abs() < 1e-3, "{density} {last}");
        let [density, _] = strips.all.densities();
        assert!((density / 22.4 - 1.0).abs() < 0.06, "{density}");
        assert!((strips.overlap - 0.4).abs() < 0.04, "{}", strips.overlap);
        assert!(
            strips.describe().contains("strips      2\n  3            112,000 points, 300.000 to"),
            "{}",
            strips.describe()
        );
        cloud.columns_mut().strip.fill(0);
        assert!(Strips::of(&cloud).is_none());
    }
}
