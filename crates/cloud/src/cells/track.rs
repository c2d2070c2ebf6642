//! What a Doppler velocity log measures with a ping.

use emitter::pattern::JANUS_BEAMS;
use glam::Vec3;
use ground::builder;

builder! {
    /// The velocity of a Doppler velocity log relative to the bottom, or to a layer of water, from one ping.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Track {
        /// Measured rate of the range along each beam, m/s: negative where sonar and scatterers approach each other; NaN:
        /// the beam has none.
        pub radial: [f32; JANUS_BEAMS],
        /// Velocity of the sonar, in its own frame, m/s, that fits the beams best; NaN: fewer than three beams have a rate.
        pub velocity: Vec3,
        /// Error velocity, m/s: by how much four beams disagree, scaled so that noise makes it as large as the errors of
        /// the velocity along x and y; NaN with three beams, which always agree.
        pub error: f32,
    }
}

impl Default for Track {
    /// Nothing is measured.
    fn default() -> Self {
        Track { radial: [f32::NAN; JANUS_BEAMS], velocity: Vec3::NAN, error: f32::NAN }
    }
}
