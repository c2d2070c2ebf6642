//! What cells say of what they hear: each arrival's row once, then each cell that of its strongest.

use super::ping::{Motion, Pinging, RayChunk};
use crate::cloud::{Columns, Field, FieldSet, Slices, Sounding, put};
use crate::echo::{Echoes, NOBODY, PingEcho};
use crate::ground::angle::azimuth_elevation;
use crate::ground::cause::Cause;
use crate::ground::error::Result;
use crate::ground::lanes::MEDIUM;
use crate::ground::parallel;
use crate::trace::{Arrival, Movement};
use std::ops::Range;

/// Columns that say where in its extent what a cell hears is.
const PLACES: [Field; 5] = [Field::TrueX, Field::TrueY, Field::TrueZ, Field::TrueRange, Field::Time];

/// Columns that are no arrival's own.
const OF_CELLS: [Field; 4] = [Field::Intensity, Field::TrueX, Field::TrueY, Field::TrueZ];

/// Rows of all arrivals of a ping, by their numbers; that of [`NOBODY`] says that nothing scatters.
#[derive(Default)]
pub(super) struct Accounts {
    columns: Columns,
    extents: Vec<Extent>,
    /// Range of each bin, m.
    ranges: Vec<f32>,
}

/// Where the surface lies that an arrival stands for.
#[derive(Clone, Copy, Debug)]
struct Extent {
    /// Its middle, m, and how far along the surface a metre of range is.
    place: [f32; 3],
    slide: [f32; 3],
    /// Range at which its middle is reported, and half of the ranges that it covers, m.
    range: f32,
    half: f32,
}

impl Extent {
    const NOTHING: Extent = Extent { place: [f32::NAN; 3], slide: [0.0; 3], range: 0.0, half: 0.0 };

    fn new(arrival: &Arrival, answer: &PingEcho) -> Extent {
        Extent {
            place: arrival.place.into(),
            slide: answer.slide.into(),
            range: answer.range,
            half: 0.5 * answer.reach,
        }
    }

    /// How much farther than the middle that part lies which is heard at a range, m: a cell's own part, and no more, as
    /// head-on the whole is shorter than the cell.
    fn beside(&self, range: f32) -> f32 {
        (range - self.range).max(-self.half).min(self.half)
    }
}

/// One chunk's rows.
struct Account<'a, 'p> {
    pinging: &'a Pinging<'p>,
    echoes: &'a Echoes,
    rows: Slices<'a>,
    extents: &'a mut [Extent],
}

impl Account<'_, '_> {
    fn run(self) {
        let Account { pinging, echoes, mut rows, extents } = self;
        for (extent, (arrival, answer)) in extents.iter_mut().zip(echoes.arrivals.iter().zip(&echoes.answers)) {
            *extent = Extent::new(arrival, answer);
        }
        pinging.tell_arrivals(echoes, 0..echoes.arrivals.len(), &mut rows);
    }
}

/// Copies to each cell what is in the row of the one that it hears; `runs`: the cells that hear nobody, and others.
fn gather<T: Copy>(to: &mut [T], from: &[T], who: &[u32], runs: &[Run]) {
    if to.is_empty() {
        return;
    }
    for Run { cells, silent } in runs {
        let to = &mut to[cells.clone()];
        if *silent {
            to.fill(from[NOBODY as usize]);
        } else {
            to.iter_mut().zip(&who[cells.clone()]).for_each(|(to, &who)| *to = from[who as usize]);
        }
    }
}

/// Neighbouring cells, and whether all of them hear nobody.
pub(super) struct Run {
    cells: Range<usize>,
    silent: bool,
}

/// Finds the `runs` of the cells of `who`, up to all of those of a beam of `bins`.
fn find_runs(who: &[u32], bins: usize, runs: &mut Vec<Run>) {
    /// Cells that are looked at together.
    const BLOCK: usize = 32;
    runs.clear();
    for (first, beam) in (0..).step_by(bins).zip(who.chunks(bins)) {
        for (start, block) in (first..).step_by(BLOCK).zip(beam.chunks(BLOCK)) {
            // No early end, which would keep this from becoming vector instructions.
            let silent = block.iter().fold(true, |silent, &who| silent & (who == NOBODY));
            let end = start + block.len();
            match runs.last_mut().filter(|last| last.silent == silent && start > first) {
                Some(last) => last.cells.end = end,
                None => runs.push(Run { cells: start..end, silent }),
            }
        }
    }
}

/// Fills those of the columns that there are with what each `of` some things has.
macro_rules! each {
    ($rows:expr, $of:expr, $($column:ident: $value:expr),* $(,)?) => {$(
        $rows.$column.iter_mut().zip($of).for_each(|(to, it)| *to = $value(it));
    )*};
}

macro_rules! gather {
    ($rows:expr, $accounts:expr, $who:expr, $runs:expr, $($column:ident)*) => {$(
        gather($rows.$column, &$accounts.$column, $who, $runs);
    )*};
}

impl Pinging<'_> {
    /// Fills `accounts` with what `fields` say of all arrivals.
    pub fn account(&self, chunks: &[RayChunk], fields: FieldSet, accounts: &mut Accounts) -> Result<()> {
        let counts = || chunks.iter().map(|chunk| chunk.echoes.arrivals.len());
        let all = 1 + counts().sum::<usize>();
        let Accounts { columns, extents, ranges } = accounts;
        ranges.clear();
        ranges.extend((0..self.layout.bins).map(|bin| self.layout.range(bin) as f32));
        // From ping to ping there are some more or less.
        columns.resize(OF_CELLS.into_iter().fold(fields, FieldSet::without), all.next_power_of_two())?;
        extents.resize(all, Extent::NOTHING);
        let (mut nothing, rows) = columns.slices(0, all).split_at(1);
        silence(&mut nothing, NOBODY as usize);
        let mut rest = &mut extents[1..];
        let extents = counts().map(|count| rest.split_off_mut(..count).unwrap_or_default());
        let parts = chunks.iter().zip(rows.parts(counts())).zip(extents);
        let tasks =
            parts.map(|((chunk, rows), extents)| Account { pinging: self, echoes: &chunk.echoes, rows, extents });
        parallel::for_each_of(tasks, Account::run);
        Ok(())
    }

    /// Fills the columns of a tile that say what the strongest scatterer of each cell is; `who`: its number.
    pub fn tell(&self, who: &[u32], accounts: &Accounts, runs: &mut Vec<Run>, mut rows: Slices) {
        let bins = self.layout.bins;
        let Accounts { columns, extents, ranges } = accounts;
        find_runs(who, bins, runs);
        let runs = &runs[..];
        gather!(rows, columns, who, runs,
            category_id part_id instance_id material_id red green blue bounces cause true_range time
            cos_incidence normal_x normal_y normal_z azimuth elevation
            velocity_x velocity_y velocity_z radial_velocity flow_x flow_y flow_z
        );
        if !rows.has(&PLACES) {
            return;
        }
        for Run { cells, silent } in runs {
            if *silent {
                for column in [&mut rows.true_x, &mut rows.true_y, &mut rows.true_z] {
                    column.get_mut(cells.clone()).unwrap_or_default().fill(f32::NAN);
                }
            } else {
                let (who, bin) = (&who[cells.clone()], cells.start % bins);
                let ranges = &ranges[bin..bin + cells.len()];
                self.tell_places(ranges, who, extents, &mut rows, cells.clone());
            }
        }
    }

    /// [`Pinging::tell`] in the cells of the `soundings` alone, of a tile from beam `first` on: all that their points are made from.
    pub fn tell_soundings(
        &self,
        first: usize,
        who: &[u32],
        chunks: &[RayChunk],
        mut rows: Slices,
        soundings: &[Option<Sounding>],
    ) {
        let bins = self.layout.bins;
        for sounding in soundings.iter().flatten() {
            let row = sounding.cell as usize - first * bins;
            let Some((echoes, index)) = strongest(chunks, who[row]) else {
                silence(&mut rows, row);
                continue;
            };
            self.tell_arrivals(echoes, index..index + 1, &mut rows.rows_after(row).split_at(1).0);
            let extent = Extent::new(&echoes.arrivals[index], &echoes.answers[index]);
            let range = self.layout.range(row % bins) as f32;
            self.tell_places(&[range], &[0], &[extent], &mut rows, row..row + 1);
        }
    }

    /// Where in `cells` of neighbouring bins, at `ranges`, m, is what they hear (`who` of the `extents`): each has the part of an
    /// extent that lies in it. `true_range` and `time` hold what they are in its middle.
    fn tell_places(&self, ranges: &[f32], who: &[u32], extents: &[Extent], rows: &mut Slices, cells: Range<usize>) {
        const BLOCK: usize = 64;
        let (mut beside, mut unasked) = ([0.0; BLOCK], [[0.0; BLOCK]; 3]);
        for (first, (ranges, who)) in (0..).step_by(BLOCK).zip(ranges.chunks(BLOCK).zip(who.chunks(BLOCK))) {
            let cells = cells.start + first..cells.start + first + ranges.len();
            let axes = [&mut rows.true_x, &mut rows.true_y, &mut rows.true_z].into_iter().zip(&mut unasked);
            let mut axes = axes.map(|(column, unasked)| column.get_mut(cells.clone()).unwrap_or(unasked));
            let [Some(x), Some(y), Some(z)] = [axes.next(), axes.next(), axes.next()] else { return };
            // Cells beside each other hear the same.
            let mut start = 0;
            for same in who.chunk_by(|a, b| a == b) {
                let Extent { place, slide, .. } = extents[same[0] as usize];
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

    /// What the arrivals `which` are, into as many rows of those of the columns that there are: all but where.
    fn tell_arrivals(&self, echoes: &Echoes, which: Range<usize>, rows: &mut Slices) {
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
        // What several columns are made from is found once for each arrival.
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
        let Some(Motion { later }) = &self.motion else { return };
        for (row, (index, arrival)) in which.zip(arrivals).enumerate() {
            let Movement { velocity, flow } = self.movement(arrival, later.as_ref());
            // How fast the way there grows at both its ends.
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

/// Where the arrival of a number is: what its chunk sends back, and its place there; `None`: [`NOBODY`].
pub(super) fn strongest(chunks: &[RayChunk], who: u32) -> Option<(&Echoes, usize)> {
    if who == NOBODY {
        return None;
    }
    let echoes = &chunks[chunks.partition_point(|chunk| chunk.echoes.first <= who) - 1].echoes;
    Some((echoes, (who - echoes.first) as usize))
}

/// Makes a cell one in which nothing scatters.
fn silence(rows: &mut Slices, row: usize) {
    put!(rows, row,
        category_id: 0, part_id: 0, instance_id: 0, material_id: 0, red: 0, green: 0, blue: 0, bounces: 0,
        cause: Cause::FalseAlarm as u8,
        true_x: f32::NAN, true_y: f32::NAN, true_z: f32::NAN, true_range: f32::NAN, time: f64::NAN,
        cos_incidence: f32::NAN, normal_x: f32::NAN, normal_y: f32::NAN, normal_z: f32::NAN,
        azimuth: f32::NAN, elevation: f32::NAN,
        velocity_x: f32::NAN, velocity_y: f32::NAN, velocity_z: f32::NAN, radial_velocity: f32::NAN,
        flow_x: f32::NAN, flow_y: f32::NAN, flow_z: f32::NAN,
    );
}
