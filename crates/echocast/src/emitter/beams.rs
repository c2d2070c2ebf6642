//! The beams of one scan, direction by direction: what every pattern compiles to.

/// How beams share firings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FiringOrder {
    /// All beams of a column belong to one firing (spinning sensors).
    Columns,
    /// Every beam is a firing of its own (raster, table).
    Beams,
    /// The whole frame is one exposure (pinhole).
    Frame,
}

/// The beams of one scan in beam order, a column each; directions are unit vectors in the sensor
/// frame (x forward, y left, z up).
///
/// Beam `row * columns + column`; neighbours in a row are neighbours in angle, so that packets are
/// coherent.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamTable {
    /// Rows of the range image: channels of a spinning sensor, pixel rows of a camera.
    pub rows: u32,
    /// Columns of the range image.
    pub columns: u32,
    /// x of the direction.
    pub dir_x: Vec<f32>,
    /// y of the direction.
    pub dir_y: Vec<f32>,
    /// z of the direction.
    pub dir_z: Vec<f32>,
    /// Time of the firing since the start of the scan, s.
    pub time: Vec<f32>,
    /// Emitter index.
    pub channel: Vec<u16>,
    /// Nearest range that is reported, m; empty: the sensor's for all beams.
    pub range_min: Vec<f32>,
    /// Farthest range that is reported, m; empty: the sensor's for all beams.
    pub range_max: Vec<f32>,
    /// How beams share firings.
    pub firing_order: FiringOrder,
    /// Time from the start of one scan to the start of the next, s.
    pub period: f64,
}

impl BeamTable {
    /// Number of beams.
    pub fn len(&self) -> usize {
        self.dir_x.len()
    }

    /// Whether there are no beams.
    pub fn is_empty(&self) -> bool {
        self.dir_x.is_empty()
    }

    /// Whether neighbours in beam order are neighbours in angle: then rays are traced in coherent packets.
    pub(crate) fn is_coherent(&self) -> bool {
        /// A packet of 16 beams of 1 degree apart still gains from being traced together.
        const WIDEST_PACKET: usize = 16;
        const COS_LIMIT: f32 = 0.94;
        /// One packet in so many is looked at.
        const STRIDE: usize = 61 * WIDEST_PACKET;
        let dot = |a: usize, b: usize| {
            self.dir_x[a] * self.dir_x[b] + self.dir_y[a] * self.dir_y[b] + self.dir_z[a] * self.dir_z[b]
        };
        let (mut seen, mut close) = (0, 0);
        for first in (0..self.len()).step_by(STRIDE) {
            let last = (first + WIDEST_PACKET).min(self.len());
            seen += 1;
            close += usize::from((first..last).all(|beam| dot(first, beam) > COS_LIMIT));
        }
        2 * close > seen
    }

    /// Firing that beam `beam` belongs to.
    pub fn firing(&self, beam: u32) -> u32 {
        match self.firing_order {
            FiringOrder::Columns => beam % self.columns,
            FiringOrder::Beams => beam,
            FiringOrder::Frame => 0,
        }
    }
}
