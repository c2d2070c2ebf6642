//! Blocks of rays, one per lane.

pub use echocast_kernels::{LANES, MISS};
use glam::Vec3;

/// Beams per task. A constant, so that results cannot depend on the number of threads; tracing loses no speed at this
/// size.
pub const CHUNK: usize = 2048;

/// Surface index of what is not a surface of the scene: returns of the medium itself such as rain and dust in the air,
/// noise, the sea surface.
pub const MEDIUM: u32 = MISS - 1;

/// Heap memory for what is too large for the stacks of host programs, made here so that the stack used to make it is
/// free again.
#[cold]
#[inline(never)]
pub fn boxed<T: Default>() -> Box<T> {
    Box::default()
}

/// Copies the `lanes` of `from` to the first lanes of `to`.
///
/// Column by column: those of a block are so far apart that going through all of them lane by lane uses a few sets of
/// the cache only.
#[inline]
pub fn gather<T: Copy>(to: &mut [T; LANES], from: &[T; LANES], lanes: &[u8]) {
    for (to, &lane) in to.iter_mut().zip(lanes) {
        *to = from[usize::from(lane)];
    }
}

/// Rays of one block, relative to the scene's local origin; directions have unit length.
///
/// Columns of blocks start at a cache line: the widest vectors fill one, and straddling two costs up to a tenth of a
/// scan's time.
#[derive(Clone)]
#[repr(align(64))]
pub struct RayBatch {
    /// x of the origin, m.
    pub org_x: [f32; LANES],
    /// y of the origin, m.
    pub org_y: [f32; LANES],
    /// z of the origin, m.
    pub org_z: [f32; LANES],
    /// x of the direction.
    pub dir_x: [f32; LANES],
    /// y of the direction.
    pub dir_y: [f32; LANES],
    /// z of the direction.
    pub dir_z: [f32; LANES],
    /// Greatest range, m; nothing is hit beyond it.
    pub range_max: [f32; LANES],
    /// Time, 0 to 1 within the span that the scene is prepared for; not used if nothing moves.
    pub time: [f32; LANES],
    /// Number of the beam: random draws of a ray depend on it in addition to the direction.
    pub beam: [u32; LANES],
}

impl Default for RayBatch {
    fn default() -> Self {
        RayBatch {
            org_x: [0.0; LANES],
            org_y: [0.0; LANES],
            org_z: [0.0; LANES],
            dir_x: [0.0; LANES],
            dir_y: [0.0; LANES],
            dir_z: [0.0; LANES],
            range_max: [0.0; LANES],
            time: [0.0; LANES],
            beam: [0; LANES],
        }
    }
}

impl RayBatch {
    /// Copies lane `other` of `from`, without its greatest range, to `lane`.
    pub fn take(&mut self, lane: usize, from: &RayBatch, other: usize) {
        (self.org_x[lane], self.org_y[lane], self.org_z[lane]) = from.origin(other).into();
        (self.dir_x[lane], self.dir_y[lane], self.dir_z[lane]) = from.direction(other).into();
        self.time[lane] = from.time[other];
        self.beam[lane] = from.beam[other];
    }

    /// Copies `lanes` of `from`, without their greatest ranges, to the first lanes.
    pub fn gather(&mut self, from: &RayBatch, lanes: &[u8]) {
        let RayBatch { org_x, org_y, org_z, dir_x, dir_y, dir_z, range_max: _, time, beam } = from;
        gather(&mut self.org_x, org_x, lanes);
        gather(&mut self.org_y, org_y, lanes);
        gather(&mut self.org_z, org_z, lanes);
        gather(&mut self.dir_x, dir_x, lanes);
        gather(&mut self.dir_y, dir_y, lanes);
        gather(&mut self.dir_z, dir_z, lanes);
        gather(&mut self.time, time, lanes);
        gather(&mut self.beam, beam, lanes);
    }

    /// Copies all of lane `other` of `from` to `lanes`.
    pub fn fill(&mut self, lanes: std::ops::Range<usize>, from: &RayBatch, other: usize) {
        let columns = [
            (&mut self.org_x, from.org_x[other]),
            (&mut self.org_y, from.org_y[other]),
            (&mut self.org_z, from.org_z[other]),
            (&mut self.dir_x, from.dir_x[other]),
            (&mut self.dir_y, from.dir_y[other]),
            (&mut self.dir_z, from.dir_z[other]),
            (&mut self.range_max, from.range_max[other]),
            (&mut self.time, from.time[other]),
        ];
        for (column, value) in columns {
            column[lanes.clone()].fill(value);
        }
        self.beam[lanes].fill(from.beam[other]);
    }

    /// Copies all of lane `from` to `lane`.
    pub fn move_lane(&mut self, lane: usize, from: usize) {
        let RayBatch { org_x, org_y, org_z, dir_x, dir_y, dir_z, range_max, time, beam } = self;
        for column in [org_x, org_y, org_z, dir_x, dir_y, dir_z, range_max, time] {
            column[lane] = column[from];
        }
        beam[lane] = beam[from];
    }

    /// Origins of rays, axis by axis.
    pub fn origins(&self) -> [&[f32; LANES]; 3] {
        [&self.org_x, &self.org_y, &self.org_z]
    }

    /// Unit directions of rays, axis by axis.
    pub fn directions(&self) -> [&[f32; LANES]; 3] {
        [&self.dir_x, &self.dir_y, &self.dir_z]
    }

    /// Origin of the ray of a lane.
    pub fn origin(&self, lane: usize) -> Vec3 {
        Vec3::new(self.org_x[lane], self.org_y[lane], self.org_z[lane])
    }

    /// Unit direction of the ray of a lane.
    pub fn direction(&self, lane: usize) -> Vec3 {
        Vec3::new(self.dir_x[lane], self.dir_y[lane], self.dir_z[lane])
    }
}
