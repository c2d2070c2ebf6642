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
    /// Nearest range that is reported, m, by channel; empty: the sensor's for all.
    pub channel_range_min: Vec<f32>,
    /// Farthest range that is reported, m, by channel; empty: the sensor's for all.
    pub channel_range_max: Vec<f32>,
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

    /// Firing that beam `beam` belongs to.
    pub fn firing(&self, beam: u32) -> u32 {
        match self.firing_order {
            FiringOrder::Columns => beam % self.columns,
            FiringOrder::Beams => beam,
            FiringOrder::Frame => 0,
        }
    }
}
