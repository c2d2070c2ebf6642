//! The echo of one arrival.

use glam::Vec3;

/// In place of a ray's number: an arrival that was not found by any ray, and blocks no water from view.
pub(crate) const NO_RAY: u32 = u32::MAX;

/// What returns from an arrival.
#[derive(Clone, Copy)]
pub(crate) struct PingEcho {
    /// Its parts: from this one on, `parts` of them.
    pub first: u32,
    pub parts: u32,
    /// Bin of the first.
    pub bin: u32,
    /// Reported range, m, folded.
    pub range: f32,
    /// Range covered by its surface, m.
    pub reach: f32,
    /// Displacement along the surface per metre of range.
    pub slide: Vec3,
    /// Which beams receive it: index of the [`ReceivingBeams`](emitter::ReceivingBeams).
    pub receiving: u32,
}

/// How and when an echo is received.
#[derive(Clone, Copy)]
pub(super) struct Received {
    /// Reported range, m.
    pub at: f32,
    /// log2 of the power relative to the direction of the ray that found it.
    pub gain_log2: f32,
    /// Index of the [`ReceivingBeams`](emitter::ReceivingBeams).
    pub receiving: u32,
}

/// An echo to be divided among bins.
pub(super) struct Echo {
    /// Energy; `None`: not received.
    pub power: Option<f32>,
    pub received: Received,
    /// Stretch of range, m, and displacement along the surface per metre of it.
    pub reach: f32,
    pub slide: Vec3,
    /// 0: back along the path out; others: other paths.
    pub way: u32,
}
