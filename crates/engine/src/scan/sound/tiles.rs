//! What the beams of a ping receive, tile by tile: levels, labels, soundings.

use super::contributors::{Accounts, CellRun, LabelledCells};
use super::plan::PingPlan;
use super::rays::RayChunk;
use crate::detect::{BeamLevels, Beside, SoundingMemory, sounding};
use crate::echo::{Background, Flanks, LevelMemory, Tile, TileQuantities};
use cloud::Slices;
use cloud::cells::{Layout, Sounding};
use ground::math::LOG2_PER_DB;
use ground::parallel;

/// Buffers to receive one tile after the other.
#[derive(Default)]
pub(super) struct TileReceiver {
    tile: Tile,
    levels: LevelMemory,
    /// For the echo of the current beam.
    stretch: SoundingMemory,
    runs: Vec<CellRun>,
}

/// What all tiles receive.
#[derive(Clone, Copy)]
pub(super) struct TileInput<'a, 'p> {
    pub plan: &'a PingPlan<'p>,
    pub chunks: &'a [RayChunk],
    pub flanks: &'a Flanks,
    pub accounts: &'a Accounts,
    pub quantities: TileQuantities,
    pub labelled: Option<LabelledCells>,
    /// Beams per tile.
    pub width: usize,
}

/// One tile: its columns, the strongest contributors of its cells, and what its beams report.
struct TileTask<'a, 'p> {
    input: TileInput<'a, 'p>,
    first: usize,
    rows: Slices<'a>,
    contributors: &'a mut [u32],
    soundings: &'a mut [Option<Sounding>],
}

impl TileInput<'_, '_> {
    /// Fills the `rows` of all cells, their strongest `contributors`, and the `soundings` of beams, tile by tile.
    pub fn tiles(
        self,
        receivers: &mut Vec<TileReceiver>,
        rows: Slices,
        contributors: &mut [u32],
        soundings: &mut [Option<Sounding>],
    ) {
        let TileInput { width, plan, .. } = self;
        let (bins, beams) = (plan.layout.bins, soundings.len());
        let firsts = (0..beams).step_by(width);
        let rows = rows.parts(firsts.clone().map(|first| width.min(beams - first) * bins));
        let cells = contributors.chunks_mut(width * bins).zip(rows);
        let tasks = firsts.zip(soundings.chunks_mut(width)).zip(cells);
        parallel::for_each_with(receivers, tasks, |receiver, ((first, soundings), (contributors, rows))| {
            TileTask { input: self, first, rows, contributors, soundings }.run(receiver);
        });
    }
}

impl TileTask<'_, '_> {
    fn run(self, receiver: &mut TileReceiver) {
        let TileTask { input, first, rows, contributors, soundings } = self;
        let TileInput { plan, chunks, flanks, accounts, quantities, labelled, width } = input;
        let TileReceiver { tile, levels, .. } = receiver;
        let Layout { bins, bin_m, .. } = *plan.layout;
        tile.clear((first, first + soundings.len()), width, bins, quantities);
        for chunk in chunks {
            tile.receive(&plan.transducer, &chunk.echoes, bin_m as f32);
        }
        let background = Background {
            rng: plan.rng,
            noise: (plan.layout.noise_db * LOG2_PER_DB).exp2(),
            volume: &plan.volume,
            flanks,
            transducer: &plan.transducer,
        };
        tile.levels(&plan.response, &background, levels, rows.intensity, contributors);
        receiver.sound_out(plan, rows.intensity, soundings);
        match labelled {
            None => {}
            Some(LabelledCells::All) => plan.label_cells(contributors, accounts, &mut receiver.runs, rows),
            Some(LabelledCells::Soundings) => plan.label_soundings(first, contributors, chunks, rows, soundings),
        }
    }
}

impl TileReceiver {
    /// Computes the `soundings` of beams from the levels of all cells, for sonars that report them.
    fn sound_out(&mut self, plan: &PingPlan, levels: &[f32], soundings: &mut [Option<Sounding>]) {
        let TileReceiver { tile, stretch, .. } = self;
        let Layout { bins, bin_m, believed_speed, .. } = *plan.layout;
        let resolution = (plan.acoustics.resolution(believed_speed) / bin_m) as f32;
        if plan.assumed.is_none() {
            return;
        }
        for ((beam, levels), to) in (tile.beams.0..).zip(levels.chunks_exact(bins)).zip(soundings) {
            let (moment, total) = (&tile.moment[..], &tile.total[..]);
            let received = (tile.received.start, tile.received.end);
            let beside = Beside { moment, total, width: tile.width, beam: beam - tile.beams.0, received };
            let width = plan.transducer.widths[beam];
            let received = BeamLevels { beam, levels, beside, width, resolution, rng: &plan.rng };
            *to = sounding(&plan.layout, &received, stretch).map(|found| {
                let first = plan.layout.cell(beam, 0, 0);
                let cell = first + source_bin(plan, tile, beam, found.cell as usize - first);
                found.cell(cell as u32).corrected(plan.corrected(beam, found.range))
            });
        }
    }
}

/// The bin nearest to `bin` that has energy which the response spreads to there; itself if there is none.
fn source_bin(plan: &PingPlan, tile: &Tile, beam: usize, bin: usize) -> usize {
    let has_energy = |bin: usize| {
        let cell = bin * tile.width + beam - tile.beams.0;
        tile.re.get(cell).is_some_and(|&re| re != 0.0) || tile.im.get(cell).is_some_and(|&im| im != 0.0)
    };
    let beside = |step: usize| [bin.checked_sub(step), Some(bin + step)].into_iter().flatten();
    (0..=plan.response.reach()).flat_map(beside).find(|&bin| has_energy(bin)).unwrap_or(bin)
}
