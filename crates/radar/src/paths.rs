//! Paths of waves from the transmitter to the receiver: what scenes hand to waveforms.

use num_complex::Complex32;

/// Paths, a column for each quantity. Directions and distances are those of the image of the scatterer that the first
/// and the last leg unfold to, seen from the radar's reference point: the wave leaves as if to `tx_direction *
/// tx_distance` and arrives as if from `rx_direction * rx_distance`. Axes of the radar: x ahead, y left, z up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Paths {
    /// Half the length of the whole path at the middle of the frame, m.
    pub range: Vec<f64>,
    /// Its rate, m/s, positive if receding.
    pub range_rate: Vec<f32>,
    /// Amplitude at a lone isotropic pair of elements at the reference point, sqrt(W), with its phase
    /// `exp(-2jk range)` at the middle of the frame and the carrier's wavelength.
    pub amplitude: Vec<Complex32>,
    /// Unit vectors in which the wave leaves.
    pub tx_direction: Vec<[f32; 3]>,
    /// Unit vectors towards where the wave comes from.
    pub rx_direction: Vec<[f32; 3]>,
    /// Radius of the wavefront that the elements would send to the scatterer, m.
    pub tx_distance: Vec<f32>,
    /// Radius of the wavefront at the receiver, m.
    pub rx_distance: Vec<f32>,
}

impl Paths {
    /// Number of paths.
    pub fn len(&self) -> usize {
        self.range.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.range.is_empty()
    }
}
