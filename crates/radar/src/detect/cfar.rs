//! Detectors with a constant false-alarm rate (CFAR): cells of a map of powers that exceed the level of the cells around
//! them.

use super::law::{CfarLaw, ReferenceLevel};
use echocast_kernels::cfar;
use ground::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Axes that a map may have.
const MOST_AXES: usize = 4;

/// Cells that a map may have: 4 GB of powers.
const MOST_CELLS: usize = 1 << 30;

/// Reference cells that a cell may have: every cell of a map is compared with all of its own.
const MOST_REFERENCES: usize = 4096;

/// Distances of cells of which [`CfarAxis::alike`] tells something.
pub(super) const LAGS: usize = 8;

/// How the level of the noise is estimated from the reference cells (Gandhi and Kassam 1988, "Analysis of CFAR
/// processors in nonhomogeneous background").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CfarMethod {
    /// Their mean: best in even noise; targets among them hide each other.
    #[default]
    Ca,
    /// The greatest of the means of the sides of the cell: fewest false alarms at edges of clutter.
    Go,
    /// The least of these: finds targets close to others.
    So,
    /// A reference cell at a rank: other targets do not raise it as long as they take few cells.
    Os,
}

/// Which reference cells belong together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CfarShape {
    /// A cell must exceed the level along each axis that has reference cells; the false-alarm rate is that of all of
    /// them together.
    #[default]
    Each,
    /// The reference cells along all axes give one level.
    Cross,
    /// The cells of a box around the guard cells give one level.
    Box,
}

/// An axis of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CfarAxis {
    /// Number of cells.
    pub len: usize,
    /// Whether the last cell is next to the first, as those of velocities and of a full turn are.
    pub wraps: bool,
    /// Cells on each side of a cell that are not compared with it, because its target reaches into them.
    pub guard: usize,
    /// Reference cells on each side beyond these; 0: none along this axis.
    pub reference: usize,
    /// How much alike the noise is in cells 1, 2, 3... apart, because windows make lines wider than a cell: squared
    /// magnitudes of correlation coefficients, 0 to 1; 0 without a window.
    pub alike: [f32; LAGS],
}

impl CfarAxis {
    /// Cells on each side that the detector looks at. Along an axis that wraps, no cell is on both sides.
    fn reach(&self) -> usize {
        let most = if self.wraps { self.len.saturating_sub(1) / 2 } else { self.len.saturating_sub(1) };
        self.guard.saturating_add(self.reference).min(most)
    }
}

/// Cells relative to another along each axis: those of a box that are not within another box.
#[derive(Clone, Copy, Debug)]
struct CfarRegion {
    outer: [[isize; 2]; MOST_AXES],
    hole: Option<[[isize; 2]; MOST_AXES]>,
}

impl CfarRegion {
    /// How many of its cells the map has around a cell that `room` cells precede and follow along each axis.
    fn count(&self, room: [[usize; 2]; MOST_AXES]) -> usize {
        let cells = |sides: [[isize; 2]; MOST_AXES]| -> usize {
            let within = |axis: usize| {
                let [before, after] = room[axis].map(|cells| cells as isize);
                (sides[axis][1].min(after) - sides[axis][0].max(-before) + 1).max(0) as usize
            };
            (0..MOST_AXES).map(within).product()
        };
        cells(self.outer) - self.hole.map_or(0, cells)
    }

    /// Calls `each` with its cells.
    fn visit(&self, mut each: impl FnMut([isize; MOST_AXES])) {
        let [a, b, c, d] = self.outer.map(|[first, last]| first..=last);
        for a in a {
            for b in b.clone() {
                for c in c.clone() {
                    for d in d.clone() {
                        let cell = [a, b, c, d];
                        let within = |hole: [[isize; 2]; MOST_AXES]| {
                            hole.iter().zip(cell).all(|([first, last], at)| (*first..=*last).contains(&at))
                        };
                        if !self.hole.is_some_and(within) {
                            each(cell);
                        }
                    }
                }
            }
        }
    }
}

/// Reference cells whose powers are added, or ranked together.
#[derive(Clone, Debug)]
struct CfarSide {
    regions: Vec<CfarRegion>,
    /// Numbers of cells with independent noise that tell as much as one of its cells: of their mean, and of ranks.
    worth: [f64; 2],
    /// Places of its cells in the padded map, from the one that precedes a cell by `Cfar::lead`.
    offsets: Vec<usize>,
}

/// What a row of cells is compared with, for each side of each part.
#[derive(Clone, Debug, Default)]
struct CfarRow {
    /// Least threshold: 0, or infinite where there are no reference cells at all.
    least: Vec<f32>,
    /// Threshold over the sum of the reference cells, 0 where there are none; of ranks: one over the factor.
    scale: Vec<Vec<f32>>,
    /// Reference cells that must be below, of ranks only: minus infinity where there are none.
    needed: Vec<Vec<f32>>,
}

/// A detector for maps of one size.
#[derive(Clone, Debug)]
pub struct Cfar {
    /// Missing axes, of one cell, precede those given.
    axes: [CfarAxis; MOST_AXES],
    method: CfarMethod,
    /// A cell must exceed the level of each part; a level is that of the sides together.
    parts: Vec<Vec<CfarSide>>,
    /// Cells of padding before and after those of each axis, and steps from cell to cell in the padded map.
    pad: [usize; MOST_AXES],
    strides: [usize; MOST_AXES],
    lead: usize,
    /// Kinds of rows, and which of them each row is of.
    rows: Vec<CfarRow>,
    row_of: Vec<u32>,
    padded: Vec<f32>,
    memory: RowMemory,
}

/// Buffers of a row.
#[derive(Clone, Debug, Default)]
struct RowMemory {
    thresholds: Vec<f32>,
    lowest: Vec<f32>,
}

impl Cfar {
    /// A detector for maps with `axes`, 1 to 4, whose cells hold the power of `looks` channels, 1 or more, and of which
    /// noise exceeds the threshold with the probability `pfa`, above 0 and below 1. `rank`, above 0 and up to 1: which
    /// part of the reference cells is below the level of [`CfarMethod::Os`].
    ///
    /// Where the map ends, there are fewer reference cells, and the factor is that of their number; cells without any
    /// are never detected. If windows make the noise of cells alike, reference cells count as fewer: the probability is
    /// then within a tenth of `pfa` at 1e-3, of [`CfarMethod::So`] down to half of it. It is not kept if the noise in a cell
    /// is like that in its own reference cells: guard cells should span what is alike.
    ///
    /// # Errors
    /// Numbers outside these ranges; more than 4096 reference cells, none, or sides of a box.
    pub fn new(
        axes: &[CfarAxis],
        (method, shape, rank): (CfarMethod, CfarShape, f64),
        looks: usize,
        pfa: f64,
    ) -> Result<Self> {
        if !(1..=MOST_AXES).contains(&axes.len()) || axes.iter().any(|axis| axis.len == 0) {
            return Err(Error::invalid("axes of the map", axes.len(), "1 to 4, each of one cell or more"));
        }
        if !(pfa > 0.0 && pfa < 1.0) {
            return Err(Error::invalid("pfa", pfa, "above 0 and below 1"));
        }
        if !(rank > 0.0 && rank <= 1.0) {
            return Err(Error::invalid("os_rank", rank, "above 0 to 1"));
        }
        if matches!(method, CfarMethod::Go | CfarMethod::So) && shape == CfarShape::Box {
            return Err(Error::invalid("method", "go or so", "ca or os with a box, which has no sides"));
        }
        let cells = axes.iter().try_fold(1usize, |cells, axis| cells.checked_mul(axis.len));
        if cells.is_none_or(|cells| cells > MOST_CELLS) {
            let found = axes.iter().map(|axis| axis.len.to_string()).collect::<Vec<_>>().join(" x ");
            return Err(Error::invalid("cells of the map", found, format!("up to {MOST_CELLS}")));
        }
        let mut all = [CfarAxis { len: 1, ..CfarAxis::default() }; MOST_AXES];
        all[MOST_AXES - axes.len()..].copy_from_slice(axes);
        let used = |axis: &CfarAxis| shape == CfarShape::Box || axis.reference > 0;
        let pad = all.map(|axis| if used(&axis) { axis.reach() } else { 0 });
        let sides = sides(&all, pad, method, shape);
        let count =
            sides.iter().flatten().flatten().map(|region| region.count([[usize::MAX >> 1; 2]; MOST_AXES])).sum();
        if !(1..=MOST_REFERENCES).contains(&count) {
            let allowed = format!("1 to {MOST_REFERENCES} that the map has around a cell");
            return Err(Error::invalid("number of reference cells", count, allowed));
        }
        let mut strides = [1; MOST_AXES];
        for axis in (0..MOST_AXES - 1).rev() {
            strides[axis] = strides[axis + 1] * (all[axis + 1].len + 2 * pad[axis + 1]);
        }
        let lead: usize = (0..MOST_AXES).map(|axis| pad[axis] * strides[axis]).sum();
        let place = |regions: Vec<CfarRegion>| {
            let (mut offsets, mut cells) = (Vec::new(), Vec::new());
            for region in &regions {
                region.visit(|cell| {
                    let place = |axis: usize| (cell[axis] + pad[axis] as isize) as usize * strides[axis];
                    offsets.push((0..MOST_AXES).map(place).sum());
                    cells.push(cell);
                });
            }
            CfarSide { regions, worth: worth(&all, &cells, rank), offsets }
        };
        let parts = sides.into_iter().map(|sides| sides.into_iter().map(place).collect()).collect();
        let mut detector = Cfar {
            axes: all,
            method,
            parts,
            pad,
            strides,
            lead,
            rows: Vec::new(),
            row_of: Vec::new(),
            padded: vec![0.0; strides[0] * (all[0].len + 2 * pad[0])],
            memory: RowMemory { thresholds: vec![0.0; all[3].len], lowest: vec![0.0; all[3].len] },
        };
        detector.fit(rank, looks, pfa);
        Ok(detector)
    }

    /// Number of cells of its maps.
    pub fn cells(&self) -> usize {
        self.axes.iter().map(|axis| axis.len).product()
    }

    /// Computes the factors of all kinds of rows.
    fn fit(&mut self, rank: f64, looks: usize, pfa: f64) {
        let mut factors = BTreeMap::new();
        let worth: Vec<Vec<_>> = self.parts.iter().map(|part| part.iter().map(|side| side.worth).collect()).collect();
        let mut kinds = BTreeMap::new();
        let last = self.axes[3];
        let room = |axis: &CfarAxis, at: usize, pad: usize| {
            if axis.wraps { [pad; 2] } else { [at.min(pad), (axis.len - 1 - at).min(pad)] }
        };
        let heads: usize = self.axes[..3].iter().map(|axis| axis.len).product();
        for head in 0..heads {
            let [.., b, c, _] = self.axes.map(|axis| axis.len);
            let at = [head / (b * c), head / c % b, head % c];
            let before = [0, 1, 2].map(|axis| room(&self.axes[axis], at[axis], self.pad[axis]));
            let next = kinds.len() as u32;
            let kind = *kinds.entry(before).or_insert(next);
            self.row_of.push(kind);
            if kind < next {
                continue;
            }
            let sides = self.parts.iter().map(Vec::len).sum();
            let ranks = if self.method == CfarMethod::Os { sides } else { 0 };
            let mut row = CfarRow {
                least: vec![0.0; last.len],
                scale: vec![vec![0.0; last.len]; sides],
                needed: vec![vec![f32::NEG_INFINITY; last.len]; ranks],
            };
            for cell in 0..last.len {
                let room = [before[0], before[1], before[2], room(&last, cell, self.pad[3])];
                let counts: Vec<Vec<usize>> = self
                    .parts
                    .iter()
                    .map(|sides| {
                        sides.iter().map(|side| side.regions.iter().map(|region| region.count(room)).sum()).collect()
                    })
                    .collect();
                let factor = factors.entry(counts.clone()).or_insert_with(|| {
                    let level = level(self.method, rank, &counts, &worth);
                    level.map(|level| CfarLaw::new(looks, &level).factor(pfa))
                });
                let Some(factor) = *factor else {
                    row.least[cell] = f32::INFINITY;
                    continue;
                };
                for (side, &count) in counts.iter().flatten().enumerate().filter(|(_, count)| **count > 0) {
                    if self.method == CfarMethod::Os {
                        row.scale[side][cell] = (1.0 / factor) as f32;
                        row.needed[side][cell] = rank_of(rank, count) as f32;
                    } else {
                        row.scale[side][cell] = (factor / count as f64) as f32;
                    }
                }
            }
            self.rows.push(row);
        }
    }

    /// Fills `found` with the cells of `map`, powers in the order of the axes, the last one varying fastest, that exceed
    /// their thresholds: places in the map, in its order.
    ///
    /// # Errors
    /// A map of another size.
    pub fn run(&mut self, map: &[f32], found: &mut Vec<u32>) -> Result<()> {
        if map.len() != self.cells() {
            return Err(Error::invalid("length of the map", map.len(), self.cells().to_string()));
        }
        found.clear();
        self.fill_padded(map);
        let len = self.axes[3].len;
        let mut memory = std::mem::take(&mut self.memory);
        for (head, cells) in map.chunks_exact(len).enumerate() {
            let place = self.padded_row(head) - self.lead;
            let row = &self.rows[self.row_of[head] as usize];
            if self.method == CfarMethod::Os {
                self.rank_row(place, row, &mut memory.thresholds);
            } else {
                self.sum_row(place, row, &mut memory);
            }
            let above =
                cells.iter().zip(&memory.thresholds).enumerate().filter(|(_, (cell, threshold))| cell > threshold);
            found.extend(above.map(|(cell, _)| (head * len + cell) as u32));
        }
        self.memory = memory;
        Ok(())
    }

    /// Thresholds of a row by sums: the greatest of those of the parts.
    fn sum_row(&self, place: usize, row: &CfarRow, memory: &mut RowMemory) {
        memory.thresholds.copy_from_slice(&row.least);
        let mut scales = row.scale.iter();
        for part in &self.parts {
            if self.method != CfarMethod::So {
                for (side, scale) in part.iter().zip(&mut scales) {
                    cfar::raise(&self.padded, place, &side.offsets, scale, &mut memory.thresholds);
                }
                continue;
            }
            memory.lowest.fill(f32::INFINITY);
            for (side, scale) in part.iter().zip(&mut scales) {
                cfar::lower(&self.padded, place, &side.offsets, scale, &mut memory.lowest);
            }
            for (threshold, &lowest) in memory.thresholds.iter_mut().zip(&memory.lowest) {
                // Infinite: this part has no cells here.
                *threshold = if lowest < f32::INFINITY { threshold.max(lowest) } else { *threshold };
            }
        }
    }

    /// Thresholds of a row by ranks: minus infinity where enough reference cells of every part are below, otherwise
    /// infinite. That a cell exceeds `factor` times the cell at a rank is the same as that so many cells are below the
    /// cell over `factor`, which needs no sorting.
    fn rank_row(&self, place: usize, row: &CfarRow, thresholds: &mut [f32]) {
        thresholds.fill(f32::INFINITY);
        for ((side, share), needed) in self.parts.iter().flatten().zip(&row.scale).zip(&row.needed) {
            cfar::rank(&self.padded, place, self.lead, &side.offsets, share, needed, thresholds);
        }
        for (threshold, &least) in thresholds.iter_mut().zip(&row.least) {
            *threshold = if *threshold > 0.0 && least == 0.0 { f32::NEG_INFINITY } else { f32::INFINITY };
        }
    }

    /// Copies the map, with what is around it: the cells of the other end along axes that wrap, elsewhere cells that
    /// add nothing to sums and are never below another.
    fn fill_padded(&mut self, map: &[f32]) {
        let outside = if self.method == CfarMethod::Os { f32::INFINITY } else { 0.0 };
        let (axes, pad) = (self.axes, self.pad);
        let from = |axis: usize, at: usize| {
            let CfarAxis { len, wraps, .. } = axes[axis];
            let inside = (pad[axis]..pad[axis] + len).contains(&at);
            (inside || wraps).then(|| (at + len - pad[axis]) % len)
        };
        let padded = |axis: usize| axes[axis].len + 2 * pad[axis];
        let (len, rows) = (axes[3].len, padded(1) * padded(2));
        for (row, cells) in self.padded.chunks_exact_mut(padded(3)).enumerate() {
            let source = [row / rows, row / padded(2) % padded(1), row % padded(2)];
            let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(|axis| from(axis, source[axis])) else {
                cells.fill(outside);
                continue;
            };
            let source = &map[((a * axes[1].len + b) * axes[2].len + c) * len..][..len];
            let (before, rest) = cells.split_at_mut(pad[3]);
            let (inside, after) = rest.split_at_mut(len);
            inside.copy_from_slice(source);
            if axes[3].wraps {
                before.copy_from_slice(&source[len - pad[3]..]);
                after.copy_from_slice(&source[..pad[3]]);
            } else {
                before.fill(outside);
                after.fill(outside);
            }
        }
    }

    /// Place in the padded map of the first cell of a row.
    fn padded_row(&self, head: usize) -> usize {
        let [_, b, c, _] = self.axes.map(|axis| axis.len);
        let at = [head / (b * c), head / c % b, head % c, 0];
        (0..MOST_AXES).map(|axis| (at[axis] + self.pad[axis]) * self.strides[axis]).sum()
    }
}

/// The regions of the sides of each part.
fn sides(
    axes: &[CfarAxis; MOST_AXES],
    pad: [usize; MOST_AXES],
    method: CfarMethod,
    shape: CfarShape,
) -> Vec<Vec<Vec<CfarRegion>>> {
    let beside = |cells: [usize; MOST_AXES]| cells.map(|cells| [-(cells as isize), cells as isize]);
    if shape == CfarShape::Box {
        let guards = [0, 1, 2, 3].map(|axis| axes[axis].guard.min(pad[axis]));
        return vec![vec![vec![CfarRegion { outer: beside(pad), hole: Some(beside(guards)) }]]];
    }
    let arms = |axis: usize| {
        let (far, guard) = (pad[axis] as isize, axes[axis].guard as isize);
        let arm = |sides: [isize; 2]| {
            let mut outer = [[0; 2]; MOST_AXES];
            outer[axis] = sides;
            CfarRegion { outer, hole: None }
        };
        if far > guard { vec![arm([-far, -guard - 1]), arm([guard + 1, far])] } else { Vec::new() }
    };
    let together = |arms: Vec<CfarRegion>| match method {
        CfarMethod::Ca | CfarMethod::Os => vec![arms],
        CfarMethod::Go | CfarMethod::So => arms.into_iter().map(|arm| vec![arm]).collect(),
    };
    let arms = (0..MOST_AXES).map(arms).filter(|arms| !arms.is_empty());
    if shape == CfarShape::Cross { vec![together(arms.flatten().collect())] } else { arms.map(together).collect() }
}

/// The level that sides with so many cells form, part by part; `None` if there are no cells. `worth`: of each side.
fn level(method: CfarMethod, rank: f64, counts: &[Vec<usize>], worth: &[Vec<[f64; 2]>]) -> Option<ReferenceLevel> {
    let joined = |join: fn(Vec<ReferenceLevel>) -> ReferenceLevel, mut levels: Vec<ReferenceLevel>| {
        if levels.len() > 1 { Some(join(levels)) } else { levels.pop() }
    };
    let of_side = |(&count, worth): (&usize, &[f64; 2])| {
        if method != CfarMethod::Os {
            return ReferenceLevel::Mean((count as f64 * worth[0]).max(1.0));
        }
        // The part of all cells that is below a rank has the mean k / (N + 1) and a variance with N + 2 in the
        // denominator (David and Nagaraja 2003, 3.1): alike cells change the variance only.
        let below = rank_of(rank, count) as f64 / (count as f64 + 1.0);
        let cells = ((count as f64 + 2.0) * worth[1] - 2.0).max(1.0);
        ReferenceLevel::Ranked { cells, rank: below * (cells + 1.0) }
    };
    let of_part = |(counts, worth): (&Vec<usize>, &Vec<[f64; 2]>)| {
        let join = if method == CfarMethod::So { ReferenceLevel::Least } else { ReferenceLevel::Greatest };
        joined(join, counts.iter().zip(worth).filter(|(count, _)| **count > 0).map(of_side).collect())
    };
    joined(ReferenceLevel::Greatest, counts.iter().zip(worth).filter_map(of_part).collect())
}

/// As how many cells of independent noise each of `cells` counts: for their mean, by its variance, and for the part of
/// them below a level of which the part `rank` of all is below.
///
/// The correlation of the powers of two cells is the squared magnitude r of that of their amplitudes; that of being
/// below a level t is the sum of `r^n e^(-2t) (L_n(t) - L_(n-1)(t))^2 / (rank (1 - rank))` with the Laguerre polynomials L
/// (Downton 1970, "Bivariate exponential distributions in reliability theory", by their orthogonality).
fn worth(axes: &[CfarAxis; MOST_AXES], cells: &[[isize; MOST_AXES]], rank: f64) -> [f64; 2] {
    if axes.iter().all(|axis| axis.alike == [0.0; LAGS]) {
        return [1.0; 2];
    }
    let rank = rank.clamp(0.01, 0.99);
    let level = -(-rank).ln_1p();
    let mut below = [0.0; 60];
    let (mut before, mut at) = (1.0, 1.0 - level);
    for (n, term) in (1..).zip(&mut below) {
        *term = (at - before).powi(2) * (1.0 - rank) / rank;
        (before, at) = (at, ((2.0 * f64::from(n) + 1.0 - level) * at - f64::from(n) * before) / (f64::from(n) + 1.0));
    }
    let mut sums = [0.0; 2];
    for one in cells {
        for other in cells {
            let lag = |axis: usize| match one[axis].abs_diff(other[axis]) {
                0 => 1.0,
                lag => f64::from(axes[axis].alike.get(lag - 1).copied().unwrap_or_default()),
            };
            let alike: f64 = (0..MOST_AXES).map(lag).product();
            sums[0] += alike;
            sums[1] += match alike {
                0.0 => 0.0,
                1.0 => 1.0,
                _ => below.iter().rev().fold(0.0, |sum, term| (sum + term) * alike),
            };
        }
    }
    sums.map(|sum| cells.len() as f64 / sum)
}

/// The rank among `cells` cells that is the part `rank` of them.
fn rank_of(rank: f64, cells: usize) -> usize {
    // Less than a rounding error above a whole number is that number.
    ((rank * cells as f64 - 1e-9).ceil() as usize).clamp(1, cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::rng::{Draw, Rng};

    const METHODS: [CfarMethod; 4] = [CfarMethod::Ca, CfarMethod::Go, CfarMethod::So, CfarMethod::Os];

    fn axis(len: usize, wraps: bool, guard: usize, reference: usize) -> CfarAxis {
        CfarAxis { len, wraps, guard, reference, ..CfarAxis::default() }
    }

    /// Adds noise of the channel `look`.
    fn add_noise(rng: &Rng, look: u32, map: &mut [f32]) {
        let (mut re, mut im) = (vec![0.0; map.len()], vec![0.0; map.len()]);
        rng.cell_phasors(look, Draw::RadarNoise, &mut re, &mut im);
        map.iter_mut().zip(re.iter().zip(&im)).for_each(|(sum, (re, im))| *sum += re * re + im * im);
    }

    /// Likewise of 100 x 250 cells as under Hann windows: each cell less half of its neighbours, of mean power 1.
    fn add_hann_noise(rng: &Rng, look: u32, map: &mut [f32]) {
        let (rows, columns) = (100, 250);
        let [mut re, mut im] = [vec![0.0; map.len()], vec![0.0; map.len()]];
        rng.cell_phasors(look, Draw::RadarNoise, &mut re, &mut im);
        let windowed = |part: &[f32]| -> Vec<f32> {
            let row = |at: usize, column: usize| part[at % rows * columns + column % columns];
            let along = |at: usize, column: usize| {
                row(at, column) - 0.5 * (row(at, column + columns - 1) + row(at, column + 1))
            };
            let both = |at: usize, column: usize| {
                along(at, column) - 0.5 * (along(at + rows - 1, column) + along(at + 1, column))
            };
            (0..part.len()).map(|cell| both(cell / columns, cell % columns) / 1.5).collect()
        };
        let (re, im) = (windowed(&re), windowed(&im));
        map.iter_mut().zip(re.iter().zip(&im)).for_each(|(sum, (re, im))| *sum += re * re + im * im);
    }

    struct Trial {
        looks: u32,
        method: CfarMethod,
        shape: CfarShape,
        detector: Cfar,
        count: usize,
    }

    /// Of all methods and shapes, for 1, 4 and 12 channels.
    fn detectors(axes: &[CfarAxis], pfa: f64) -> Vec<Trial> {
        let mut trials = Vec::new();
        for looks in [1, 4, 12] {
            for method in METHODS {
                for shape in [CfarShape::Each, CfarShape::Cross, CfarShape::Box] {
                    if let Ok(detector) = Cfar::new(axes, (method, shape, 0.75), looks as usize, pfa) {
                        trials.push(Trial { looks, method, shape, detector, count: 0 });
                    }
                }
            }
        }
        assert_eq!(trials.len(), 30);
        trials
    }

    /// The same by the definitions, cell by cell, in double precision.
    fn oracle(
        axes: [CfarAxis; 2],
        method: CfarMethod,
        shape: CfarShape,
        pfa: f64,
        looks: usize,
        map: &[f32],
    ) -> Vec<u32> {
        let at = |cell: usize| [cell / axes[1].len, cell % axes[1].len];
        let mut found = Vec::new();
        for cell in 0..map.len() {
            // The arms of the cross, before and after along each axis, or the ring of the box.
            let mut arms: [Vec<f64>; 4] = Default::default();
            for (other, &power) in map.iter().enumerate() {
                let away = [0, 1].map(|axis| {
                    let len = axes[axis].len as isize;
                    let away = at(other)[axis] as isize - at(cell)[axis] as isize;
                    if axes[axis].wraps { (away + len / 2).rem_euclid(len) - len / 2 } else { away }
                });
                let far = [0, 1].map(|axis| away[axis].unsigned_abs());
                let reach = axes.map(|axis| axis.guard + axis.reference);
                if shape == CfarShape::Box {
                    if far[0] <= reach[0] && far[1] <= reach[1] && (far[0] > axes[0].guard || far[1] > axes[1].guard) {
                        arms[0].push(power.into());
                    }
                    continue;
                }
                for axis in 0..2 {
                    if far[1 - axis] == 0 && far[axis] > axes[axis].guard && far[axis] <= reach[axis] {
                        arms[2 * axis + usize::from(away[axis] > 0)].push(power.into());
                    }
                }
            }
            let parts: Vec<Vec<Vec<f64>>> = match (shape, method) {
                (CfarShape::Each, CfarMethod::Ca | CfarMethod::Os) => {
                    arms.chunks(2).map(|arms| vec![arms.concat()]).collect()
                }
                (CfarShape::Each, _) => arms.chunks(2).map(<[_]>::to_vec).collect(),
                (_, CfarMethod::Ca | CfarMethod::Os) => vec![vec![arms.concat()]],
                _ => vec![arms.to_vec()],
            };
            let counts: Vec<Vec<usize>> = parts.iter().map(|sides| sides.iter().map(Vec::len).collect()).collect();
            let worth: Vec<_> = counts.iter().map(|counts| vec![[1.0; 2]; counts.len()]).collect();
            let Some(law) = level(method, 0.75, &counts, &worth) else { continue };
            let factor = CfarLaw::new(looks, &law).factor(pfa);
            let levels = parts.iter().filter_map(|sides| {
                let of_side = |side: &Vec<f64>| {
                    let mut side = side.clone();
                    side.sort_by(f64::total_cmp);
                    if method == CfarMethod::Os {
                        side[rank_of(0.75, side.len()) - 1]
                    } else {
                        side.iter().sum::<f64>() / side.len() as f64
                    }
                };
                let levels = sides.iter().filter(|side| !side.is_empty()).map(of_side);
                if method == CfarMethod::So { levels.reduce(f64::min) } else { levels.reduce(f64::max) }
            });
            if levels.reduce(f64::max).is_some_and(|level| f64::from(map[cell]) > factor * level) {
                found.push(cell as u32);
            }
        }
        found
    }

    #[test]
    fn detections_are_those_of_the_definitions() {
        let mut found = Vec::new();
        for (velocities, ranges) in [((9, true), 14), ((2, true), 40), ((12, false), 9), ((1, true), 33)] {
            let axes = [axis(velocities.0, velocities.1, 1, 3), axis(ranges, false, 2, 4)];
            let mut map = vec![0.0; velocities.0 * ranges];
            add_noise(&Rng::new(3, 0), 0, &mut map);
            add_noise(&Rng::new(3, 0), 1, &mut map);
            for shape in [CfarShape::Each, CfarShape::Cross, CfarShape::Box] {
                for method in METHODS {
                    if shape == CfarShape::Box && matches!(method, CfarMethod::Go | CfarMethod::So) {
                        continue;
                    }
                    // The oracle knows reaches that do not go all around only.
                    let limited = axes.map(|axis| CfarAxis {
                        reference: axis.reach().saturating_sub(axis.guard),
                        guard: axis.guard.min(axis.reach()),
                        ..axis
                    });
                    let mut detector = Cfar::new(&axes, (method, shape, 0.75), 2, 0.1).unwrap();
                    detector.run(&map, &mut found).unwrap();
                    assert_eq!(found, oracle(limited, method, shape, 0.1, 2, &map), "{method:?} {shape:?} {axes:?}");
                    assert!(!found.is_empty());
                }
            }
        }
    }

    /// Noise exceeds the threshold as often as asked for, within three standard deviations of the count. Cells that
    /// share reference cells are not independent; their detections hardly are correlated.
    #[test]
    fn noise_is_detected_with_the_asked_probability() {
        let axes = [axis(100, true, 2, 8), axis(250, false, 2, 12)];
        let frames = 400;
        let mut detectors = detectors(&axes, 1e-3);
        let mut found = Vec::new();
        for frame in 0..frames {
            let mut map = vec![0.0; 25_000];
            for look in 1..=12 {
                add_noise(&Rng::new(1, frame), look, &mut map);
                for trial in detectors.iter_mut().filter(|trial| trial.looks == look) {
                    trial.detector.run(&map, &mut found).unwrap();
                    trial.count += found.len();
                }
            }
        }
        let expected = f64::from(frames) * 25_000.0 * 1e-3;
        for Trial { looks, method, shape, count, .. } in detectors {
            let off = (count as f64 - expected) / expected.sqrt();
            assert!(off.abs() < 3.0, "{method:?} {shape:?} of {looks} channels: {count}, not {expected}");
        }
    }

    /// A window makes the noise of neighbouring cells alike. The threshold knows that: without, noise would exceed it two
    /// to three times as often.
    #[test]
    fn noise_under_a_window_is_detected_nearly_as_often() {
        // Hann: amplitudes correlate by -2/3 and 1/6.
        let alike = [4.0 / 9.0, 1.0 / 36.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let axes = [axis(100, true, 2, 8), axis(250, false, 2, 12)].map(|axis| CfarAxis { alike, ..axis });
        let frames = 60;
        let mut trials = detectors(&axes, 1e-3);
        let mut found = Vec::new();
        for frame in 0..frames {
            let mut map = vec![0.0; 25_000];
            for look in 1..=12 {
                add_hann_noise(&Rng::new(2, frame), look, &mut map);
                for trial in trials.iter_mut().filter(|trial| trial.looks == look) {
                    trial.detector.run(&map, &mut found).unwrap();
                    trial.count += found.len();
                }
            }
        }
        let expected = f64::from(frames) * 25_000.0 * 1e-3;
        for Trial { looks, method, shape, count, .. } in trials {
            let ratio = count as f64 / expected;
            // The least of several short arms depends most on how seldom they are all weak, which is more seldom than for
            // the independent cells that they count as.
            let least = if method == CfarMethod::So { 0.4 } else { 0.87 };
            assert!((least..1.15).contains(&ratio), "{method:?} {shape:?} of {looks} channels: {ratio} times");
        }
    }
}
