//! What receivers detect: echoes side by side, one per beam, or beam by beam, and the returns that they become.

use crate::echo::{BeamSignal, Peak, Share, Waveform};
use emitter::SubRayFan;
use ground::lanes::LANES;

/// The echoes of beams of one ray each, one per lane.
pub(crate) struct LaneEchoes<'a> {
    pub beams: &'a [u32],
    pub range: &'a mut [f32; LANES],
    pub rho_eff: &'a mut [f32; LANES],
    /// [`MISS`] where none is detected, [`MEDIUM`] where it is not that of a surface.
    pub surface: &'a mut [u32; LANES],
    pub cause: &'a mut [u8; LANES],
}

/// What a beam receives, apart from its signal.
pub(crate) struct ReceivedBeam<'a> {
    pub beam: u32,
    /// The only echo of a beam whose rays hit one plane and nothing else.
    pub plain: Option<Peak>,
    /// Range of the nearest surface that a ray hits directly, m; infinite if there is none.
    pub straight: f32,
    /// Noise that looks like echoes, nearest first.
    pub alarms: &'a [(usize, Peak)],
}

/// The detections of one beam, with the working memory to find them.
pub(crate) struct Detections {
    pub waveform: Waveform,
    /// Its signal, in pieces whose sources are its arrivals; none if it is plain.
    pub received: BeamSignal,
    /// Its echoes that are detected, nearest first.
    pub peaks: Vec<Peak>,
    /// Indices of those that are reported, in the order of reporting.
    pub chosen: Vec<usize>,
    pub(super) order: Vec<usize>,
    pub shares: Vec<Share>,
}

impl Default for Detections {
    /// With memory for as many echoes as a footprint has points, so that it hardly ever grows.
    fn default() -> Self {
        Detections {
            waveform: Waveform::default(),
            received: BeamSignal::default(),
            peaks: Vec::with_capacity(SubRayFan::MOST),
            chosen: Vec::with_capacity(SubRayFan::MOST),
            order: Vec::with_capacity(SubRayFan::MOST),
            shares: Vec::with_capacity(SubRayFan::MOST),
        }
    }
}

/// Returns, side by side.
pub struct Returns<'a> {
    /// The beam of each, and which of the beam's returns it is, from 0: the address of random numbers.
    pub beams: &'a [u32],
    pub numbers: &'a [u32],
    pub channels: &'a [u16],
    pub rho_eff: &'a [f32; LANES],
    /// True ranges, m.
    pub range: &'a [f32; LANES],
}
