//! Labels of cells: each arrival's row is computed once, then each cell gets that of its strongest contributor.

use super::plan::{MotionSource, PingPlan};
use super::rays::RayChunk;
use crate::echo::{Echoes, NO_CONTRIBUTOR, PingEcho};
use crate::trace::{Arrival, Movement};
use cloud::cells::Sounding;
use cloud::{Columns, Field, FieldSet, FieldSource, Slices, put};
use ground::angle::azimuth_elevation;
use ground::cause::Cause;
use ground::error::Result;
use ground::lanes::MEDIUM;
use ground::parallel;
use std::ops::Range;

/// Columns that depend on where in the extent of its contributor a cell is.
const PLACES: [Field; 5] = [Field::TrueX, Field::TrueY, Field::TrueZ, Field::TrueRange, Field::Time];

/// Columns that do not belong to arrivals.
const OF_CELLS: [Field; 4] = [Field::Intensity, Field::TrueX, Field::TrueY, Field::TrueZ];

/// Cells of a ping that are labelled: those for which all columns are filled.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum LabelledCells {
    All,
    /// Those of soundings; the others are not filled.
    Soundings,
}

/// Rows of all arrivals of a ping, by their numbers; that of [`NO_CONTRIBUTOR`] states that nothing scatters.
#[derive(Default)]
pub(super) struct Accounts {
    columns: Columns,
    extents: Vec<SurfacePatch>,
    /// Range of each bin, m.
    ranges: Vec<f32>,
}

/// The surface that an arrival represents.
#[derive(Clone, Copy, Debug)]
struct SurfacePatch {
    /// Its middle, m, and the displacement along the surface per metre of range.
    place: [f32; 3],
    slide: [f32; 3],
    /// Range at which its middle is reported, and half of its extent in range, m.
    range: f32,
    half: f32,
}

impl SurfacePatch {
    const NOTHING: SurfacePatch = SurfacePatch { place: [f32::NAN; 3], slide: [0.0; 3], range: 0.0, half: 0.0 };

    fn new(arrival: &Arrival, answer: &PingEcho) -> SurfacePatch {
        SurfacePatch {
            place: arrival.place.into(),
            slide: answer.slide.into(),
            range: answer.range,
            half: 0.5 * answer.reach,
        }
    }

    /// How much farther than the middle the part is that is received at a range, m: a cell's own part, and no more, as
    /// at normal incidence the whole is shorter than the cell.
    fn beside(&self, range: f32) -> f32 {
        (range - self.range).max(-self.half).min(self.half)
    }
}

/// One chunk's rows.
struct Account<'a, 'p> {
    plan: &'a PingPlan<'p>,
    echoes: &'a Echoes,
    rows: Slices<'a>,
    extents: &'a mut [SurfacePatch],
}

impl Account<'_, '_> {
    fn run(self) {
        let Account { plan, echoes, mut rows, extents } = self;
        for (extent, (arrival, answer)) in extents.iter_mut().zip(echoes.arrivals.iter().zip(&echoes.answers)) {
            *extent = SurfacePatch::new(arrival, answer);
        }
        plan.label_arrivals(echoes, 0..echoes.arrivals.len(), &mut rows);
    }
}

/// Copies to each cell the row of its contributor; `runs`: the cells without a contributor, and others.
fn gather<T: Copy>(to: &mut [T], from: &[T], contributor: &[u32], runs: &[CellRun]) {
    if to.is_empty() {
        return;
    }
    for CellRun { cells, unlabelled } in runs {
        let to = &mut to[cells.clone()];
        if *unlabelled {
            to.fill(from[NO_CONTRIBUTOR as usize]);
        } else {
            to.iter_mut()
                .zip(&contributor[cells.clone()])
                .for_each(|(to, &contributor)| *to = from[contributor as usize]);
        }
    }
}

/// Neighbouring cells, and whether all of them are without a contributor.
pub(super) struct CellRun {
    cells: Range<usize>,
    unlabelled: bool,
}

/// Finds the `runs` of cells with and without a `contributor`, each at most one beam of `bins` long.
fn find_runs(contributor: &[u32], bins: usize, runs: &mut Vec<CellRun>) {
    /// Cells that are examined together.
    const BLOCK: usize = 32;
    runs.clear();
    for (first, beam) in (0..).step_by(bins).zip(contributor.chunks(bins)) {
        for (start, block) in (first..).step_by(BLOCK).zip(beam.chunks(BLOCK)) {
            // No early exit, which would prevent vectorisation.
            let unlabelled =
                block.iter().fold(true, |unlabelled, &contributor| unlabelled & (contributor == NO_CONTRIBUTOR));
            let end = start + block.len();
            match runs.last_mut().filter(|last| last.unlabelled == unlabelled && start > first) {
                Some(last) => last.cells.end = end,
                None => runs.push(CellRun { cells: start..end, unlabelled }),
            }
        }
    }
}

/// Fills those of the columns that exist with the value of each item.
macro_rules! each {
    ($rows:expr, $of:expr, $($column:ident: $value:expr),* $(,)?) => {$(
        $rows.$column.iter_mut().zip($of).for_each(|(to, it)| *to = $value(it));
    )*};
}

macro_rules! gather {
    ($rows:expr, $accounts:expr, $contributor:expr, $runs:expr, $($column:ident)*) => {$(
        gather($rows.$column, &$accounts.$column, $contributor, $runs);
    )*};
}

impl PingPlan<'_> {
    /// Fills `accounts` with the `fields` of all arrivals.
    pub fn account(&self, chunks: &[RayChunk], fields: FieldSet, accounts: &mut Accounts) -> Result<()> {
        let counts = || chunks.iter().map(|chunk| chunk.echoes.arrivals.len());
        let all = 1 + counts().sum::<usize>();
        let Accounts { columns, extents, ranges } = accounts;
        ranges.clear();
        ranges.extend((0..self.layout.bins).map(|bin| self.layout.range(bin) as f32));
        // Their number varies a little from ping to ping.
        columns.resize(OF_CELLS.into_iter().fold(fields, FieldSet::without), all.next_power_of_two())?;
        extents.resize(all, SurfacePatch::NOTHING);
        let (mut nothing, rows) = columns.slices(0, all).split_at(1);
        mark_empty(&mut nothing, NO_CONTRIBUTOR as usize);
        let mut rest = &mut extents[1..];
        let extents = counts().map(|count| rest.split_off_mut(..count).unwrap_or_default());
        let parts = chunks.iter().zip(rows.parts(counts())).zip(extents);
        let tasks = parts.map(|((chunk, rows), extents)| Account { plan: self, echoes: &chunk.echoes, rows, extents });
        parallel::for_each_of(tasks, Account::run);
        Ok(())
    }

    /// Fills the columns of a tile that describe the strongest contributor of each cell; `contributor`: its number.
    pub fn label_cells(&self, contributor: &[u32], accounts: &Accounts, runs: &mut Vec<CellRun>, mut rows: Slices) {
        let bins = self.layout.bins;
        let Accounts { columns, extents, ranges } = accounts;
        find_runs(contributor, bins, runs);
        let runs = &runs[..];
        gather!(rows, columns, contributor, runs,
            category_id part_id instance_id material_id red green blue bounces cause true_range time
            cos_incidence normal_x normal_y normal_z azimuth elevation
            velocity_x velocity_y velocity_z radial_velocity flow_x flow_y flow_z
        );
        if !rows.has(&PLACES) {
            return;
        }
        for CellRun { cells, unlabelled } in runs {
            if *unlabelled {
                for column in [&mut rows.true_x, &mut rows.true_y, &mut rows.true_z] {
                    column.get_mut(cells.clone()).unwrap_or_default().fill(f32::NAN);
                }
            } else {
                let (contributor, bin) = (&contributor[cells.clone()], cells.start % bins);
                let ranges = &ranges[bin..bin + cells.len()];
                self.fill_places(ranges, contributor, extents, &mut rows, cells.clone());
            }
        }
    }

    /// [`PingPlan::label_cells`] only for the cells of the `soundings`, of a tile from beam `first` on: all that their
    /// points are made from.
    pub fn label_soundings(
        &self,
        first: usize,
        contributor: &[u32],
        chunks: &[RayChunk],
        mut rows: Slices,
        soundings: &[Option<Sounding>],
    ) {
        let bins = self.layout.bins;
        for sounding in soundings.iter().flatten() {
            let row = sounding.cell as usize - first * bins;
            let Some((echoes, index)) = strongest(chunks, contributor[row]) else {
                mark_empty(&mut rows, row);
                continue;
            };
            self.label_arrivals(echoes, index..index + 1, &mut rows.rows_after(row).split_at(1).0);
            let extent = SurfacePatch::new(&echoes.arrivals[index], &echoes.answers[index]);
            let range = self.layout.range(row % bins) as f32;
            self.fill_places(&[range], &[0], &[extent], &mut rows, row..row + 1);
        }
    }

    /// Fills in where the contributors of `cells` of neighbouring bins are, at `ranges`, m (`contributor`: which of the
    /// `extents`): each cell has the part of an extent that is in it. On entry `true_range` and `time` hold the values
    /// at the middle of the extent.
    fn fill_places(
        &self,
        ranges: &[f32],
        contributor: &[u32],
        extents: &[SurfacePatch],
        rows: &mut Slices,
        cells: Range<usize>,
    ) {
        const BLOCK: usize = 64;
        let (mut beside, mut unrequested) = ([0.0; BLOCK], [[0.0; BLOCK]; 3]);
        for (first, (ranges, contributor)) in
            (0..).step_by(BLOCK).zip(ranges.chunks(BLOCK).zip(contributor.chunks(BLOCK)))
        {
            let cells = cells.start + first..cells.start + first + ranges.len();
            let axes = [&mut rows.true_x, &mut rows.true_y, &mut rows.true_z].into_iter().zip(&mut unrequested);
            let mut axes = axes.map(|(column, unrequested)| column.get_mut(cells.clone()).unwrap_or(unrequested));
            let [Some(x), Some(y), Some(z)] = [axes.next(), axes.next(), axes.next()] else { return };
            // Adjacent cells have the same contributor.
            let mut start = 0;
            for same in contributor.chunk_by(|a, b| a == b) {
                let SurfacePatch { place, slide, .. } = extents[same[0] as usize];
                for step in start..start + same.len() {
                    beside[step] = extents[same[0] as usize].beside(ranges[step]);
                    x[step] = place[0] + slide[0] * beside[step];
                    y[step] = place[1] + slide[1] * beside[step];
                    z[step] = place[2] + slide[2] * beside[step];
                }
                start += same.len();
            }
            let column = rows.true_range.get_mut(cells.clone()).unwrap_or_default();
            column.iter_mut().zip(&beside).for_each(|(range, beside)| *range += beside);
            let column = rows.time.get_mut(cells).unwrap_or_default();
            let per_metre = 2.0 / self.layout.believed_speed;
            column.iter_mut().zip(&beside).for_each(|(time, beside)| *time += f64::from(*beside) * per_metre);
        }
    }

    /// Writes all properties but the positions of the arrivals `which` into as many rows of the columns that exist.
    fn label_arrivals(&self, echoes: &Echoes, which: Range<usize>, rows: &mut Slices) {
        let (arrivals, answers) = (&echoes.arrivals[which.clone()], &echoes.answers[which.clone()]);
        let surfaces = &self.scene.surfaces;
        let surface = |it: &Arrival| surfaces.rows.get(it.surface as usize);
        each!(rows, arrivals,
            category_id: |it| surface(it).map_or(0, |row| row.category_id),
            part_id: |it| surface(it).map_or(0, |row| row.part_id),
            instance_id: |it| surface(it).map_or(0, |row| row.instance_id),
            material_id: |it| surface(it).map_or(0, |row| row.material_id),
            true_range: |it: &Arrival| it.path,
            bounces: |it: &Arrival| it.order,
            cause: |it: &Arrival| match (it.order, it.surface) {
                (0, MEDIUM) => Cause::SeaSurface as u8,
                (0, _) => Cause::Surface as u8,
                _ => Cause::Multipath as u8,
            },
        );
        let time = |(arrival, answer): (&Arrival, &PingEcho)| {
            let folded = if arrival.range > answer.range + 0.5 * self.fold as f32 { self.fold } else { 0.0 };
            self.time + 2.0 * (f64::from(answer.range) + folded) / self.layout.believed_speed
        };
        each!(rows, arrivals.iter().zip(answers), time: time);
        // What several columns share is computed once for each arrival.
        if rows.has(&[Field::Red, Field::Green, Field::Blue]) {
            for (row, it) in arrivals.iter().enumerate() {
                let [red, green, blue] = surface(it).map_or([0; 3], |row| surfaces.rgb(row, it.triangle, it.corner));
                put!(rows, row, red: red, green: green, blue: blue);
            }
        }
        if rows.has(&[Field::CosIncidence, Field::NormalX, Field::NormalY, Field::NormalZ]) {
            for (row, Arrival { direction, normal, .. }) in arrivals.iter().enumerate() {
                let along = direction.dot(*normal);
                let normal = *normal * (-along.signum() / normal.length());
                let cosine = (-direction.dot(normal)).clamp(0.0, 1.0);
                put!(rows, row, cos_incidence: cosine, normal_x: normal.x, normal_y: normal.y, normal_z: normal.z);
            }
        }
        if rows.has(&[Field::Azimuth, Field::Elevation]) {
            for (row, index) in which.clone().enumerate() {
                let [azimuth, elevation] = azimuth_elevation(self.launched(echoes, index).into());
                put!(rows, row, azimuth: azimuth, elevation: elevation);
            }
        }
        let Some(MotionSource { later }) = &self.motion else { return };
        for (row, (index, arrival)) in which.zip(arrivals).enumerate() {
            let Movement { velocity, flow } = self.movement(arrival, later.as_ref());
            // How fast the path grows at both its ends.
            let own = self.own.dot(self.rotation() * self.launched(echoes, index));
            put!(rows, row,
                velocity_x: velocity.x,
                velocity_y: velocity.y,
                velocity_z: velocity.z,
                radial_velocity: velocity.dot(arrival.direction) - own,
                flow_x: flow.x,
                flow_y: flow.y,
                flow_z: flow.z,
            );
        }
    }
}

/// Finds the arrival with a number: the echoes of its chunk, and its index there; `None`: [`NO_CONTRIBUTOR`].
pub(super) fn strongest(chunks: &[RayChunk], contributor: u32) -> Option<(&Echoes, usize)> {
    if contributor == NO_CONTRIBUTOR {
        return None;
    }
    let echoes = &chunks[chunks.partition_point(|chunk| chunk.echoes.first <= contributor) - 1].echoes;
    Some((echoes, (contributor - echoes.first) as usize))
}

/// Marks a cell, whose level is known, as one in which nothing scatters.
fn mark_empty(rows: &mut Slices, row: usize) {
    let unknown = [FieldSource::Beam, FieldSource::Surface, FieldSource::Motion];
    rows.rows_after(row).fill_absent(&unknown, 1);
    put!(rows, row, bounces: 0, cause: Cause::FalseAlarm as u8);
}
