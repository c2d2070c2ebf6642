//! One block of beams with one ray and one return each, step by step.

use super::gather::Gatherer;
use super::plan::ScanPlan;
use super::split::Splitter;
use crate::echo::{Contribution, Follower, MirrorImage};
use crate::trace::{HitBatch, traced};
use cloud::Kept;
use emitter::BeamTable;
use ground::cause::Cause;
use ground::lanes::{LANES, RayBatch, boxed};
use std::cell::Cell;
use std::sync::atomic::Ordering;

/// The beam, and which of its returns, of each lane of a block.
#[repr(C, align(64))]
pub(super) struct BeamLanes {
    pub beam: [u32; LANES],
    /// Counted from 0; random draws of a return depend on it.
    pub number: [u32; LANES],
    pub return_number: [u8; LANES],
    pub return_count: [u8; LANES],
    /// The first beam, where lanes are consecutive beams with one return each.
    pub first: Option<usize>,
}

impl BeamLanes {
    fn new() -> Self {
        BeamLanes {
            beam: [0; LANES],
            number: [0; LANES],
            return_number: [1; LANES],
            return_count: [1; LANES],
            first: None,
        }
    }

    /// Sets the lanes to the beams from `first` on, one return each.
    pub fn start_at(&mut self, first: usize) {
        self.first = Some(first);
        for lane in 0..LANES {
            self.beam[lane] = (first + lane) as u32;
        }
    }

    /// Nominal directions of the first `count` lanes, sensor frame.
    pub fn directions(&self, beams: &BeamTable, count: usize) -> [[f32; LANES]; 3] {
        [&beams.dir_x, &beams.dir_y, &beams.dir_z].map(|axis| self.take(axis, count))
    }

    /// Where the beams of the first `count` lanes start, sensor frame, m; `None`: all at its origin.
    pub fn starts(&self, beams: &BeamTable, count: usize) -> Option<[[f32; LANES]; 3]> {
        beams.has_origins().then(|| beams.origin.each_ref().map(|axis| self.take(axis, count)))
    }

    /// The values that the first `count` lanes have in a `column` of the table of beams.
    pub fn take<T: Copy + Default>(&self, column: &[T], count: usize) -> [T; LANES] {
        let mut values = [T::default(); LANES];
        match self.first {
            Some(first) => values[..count].copy_from_slice(&column[first..first + count]),
            None => {
                for lane in 0..count {
                    values[lane] = column[self.beam[lane] as usize];
                }
            }
        }
        values
    }
}

thread_local! {
    /// Working memory of this thread, kept from chunk to chunk and from scan to scan.
    static BLOCK: Cell<Option<Box<Block>>> = const { Cell::new(None) };
}

/// Runs `work`, a chunk of `scan`, in the working memory of this thread.
pub(super) fn with_block<R>(scan: &ScanPlan, work: impl FnOnce(&mut Block) -> R) -> R {
    // A thread that is ending has none any more.
    let mut block = BLOCK.try_with(Cell::take).ok().flatten().unwrap_or_else(boxed);
    block.renew();
    let before = traced();
    let result = work(&mut block);
    scan.rays.fetch_add(traced() - before, Ordering::Relaxed);
    let _ = BLOCK.try_with(|own| own.set(Some(block)));
    result
}

/// As `boxed`, for what is seen directly.
#[cold]
#[inline(never)]
pub(super) fn no_images() -> Box<[MirrorImage; LANES]> {
    Box::new([MirrorImage::DIRECT; LANES])
}

/// The intermediate results of one block of beams: the table in the crate's documentation, column by column.
#[repr(C, align(64))]
pub(super) struct Block {
    pub rays: RayBatch,
    pub hits: HitBatch,
    pub surfaces: Contribution,
    pub rho_eff: [f32; LANES],
    pub cause: [u8; LANES],
    /// Mirrors and faces of glass on the path.
    pub bounces: [u8; LANES],
    /// Labels of the first surface that the beam hits.
    pub first_category: [u32; LANES],
    pub first_instance: [u32; LANES],
    /// Whether the echo has been detected already, with the weather on its path: those of mirrors and glass.
    pub settled: [bool; LANES],
    /// Range at which the first surface ends a beam's view of the air, m, whether it is detected or not.
    pub view_end: [f32; LANES],
    /// Fraction of an echo's light that the channel of each beam uses.
    pub efficiency: [f32; LANES],
    /// Ranges that a depth camera forms from its light, before errors, m.
    pub formed: [f32; LANES],
    pub measured: [f32; LANES],
    pub intensity: [f32; LANES],
    /// Effective reflectance as measured, with its errors, if it is requested.
    pub shown: [f32; LANES],
    /// Width of the echo over that of the emitted pulse, and its deviation from the shape of that.
    pub widened: [f32; LANES],
    pub deviation: [f32; LANES],
    /// Angle by which a beam is reported rotated counter-clockwise, rad.
    pub turn: [f32; LANES],
    pub scratch: [f32; LANES],
    pub lanes: BeamLanes,
    pub kept: Kept,
    /// The rays of the beams as reported, where they differ from `rays`.
    pub reported: Option<Box<RayBatch>>,
    /// Apparent motion of what lanes see, where mirrors or glass are on the path, if requested.
    pub images: Option<Box<[MirrorImage; LANES]>>,
    /// Buffers to trace light, where a scene has mirrors or glass.
    pub paths: Option<Box<Follower>>,
    /// Buffers for beams of several rays or returns.
    pub gatherer: Option<Box<Gatherer>>,
    /// Buffers for beams that are several rays where others are one.
    pub parts: Option<Box<Gatherer>>,
    pub splitter: Option<Box<Splitter>>,
    /// Buffers of a depth camera for rays from other points.
    pub looks: Option<Box<LookMemory>>,
}

impl Default for Block {
    fn default() -> Self {
        Block {
            lanes: BeamLanes::new(),
            rays: RayBatch::default(),
            hits: HitBatch::new(),
            surfaces: Contribution::new(),
            rho_eff: [0.0; LANES],
            formed: [0.0; LANES],
            measured: [0.0; LANES],
            intensity: [0.0; LANES],
            shown: [0.0; LANES],
            widened: [1.0; LANES],
            deviation: [0.0; LANES],
            turn: [0.0; LANES],
            kept: Kept::default(),
            scratch: [0.0; LANES],
            cause: [Cause::Surface as u8; LANES],
            bounces: [0; LANES],
            first_category: [0; LANES],
            first_instance: [0; LANES],
            settled: [false; LANES],
            view_end: [0.0; LANES],
            efficiency: [1.0; LANES],
            reported: None,
            images: None,
            paths: None,
            gatherer: None,
            parts: None,
            splitter: None,
            looks: None,
        }
    }
}

impl Block {
    /// Resets all that a scan does not set itself, whatever scan the block was used for.
    #[inline(never)]
    fn renew(&mut self) {
        self.lanes = BeamLanes::new();
        self.surfaces = Contribution::new();
        self.turn = [0.0; LANES];
        self.efficiency = [1.0; LANES];
        (self.first_category, self.first_instance) = ([0; LANES], [0; LANES]);
        self.reset_causes();
    }

    /// Resets all lanes to surfaces that are hit directly, by all of a beam.
    pub fn reset_causes(&mut self) {
        (self.widened, self.deviation) = ([1.0; LANES], [0.0; LANES]);
        self.cause = [Cause::Surface as u8; LANES];
        (self.bounces, self.settled) = ([0; LANES], [false; LANES]);
    }
}

/// Buffers of a block for rays from other points: from a second viewpoint, or for light that comes via other surfaces.
pub(super) struct LookMemory {
    pub rays: RayBatch,
    /// The surfaces that light comes via.
    pub first: HitBatch,
    pub surfaces: Contribution,
    /// Ranges, m, and powers, 1/m^2, of the echoes of each lane, the direct one first.
    pub ranges: Vec<f32>,
    pub powers: Vec<f32>,
}

impl Default for LookMemory {
    fn default() -> Self {
        LookMemory {
            rays: RayBatch::default(),
            first: HitBatch::new(),
            surfaces: Contribution::new(),
            ranges: Vec::new(),
            powers: Vec::new(),
        }
    }
}
