//! The depth that a beam reports.

use glam::Vec3;
use ground::builder;

builder! {
    /// An echo that a sonar reports as the depth of a beam.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Sounding {
        /// Beam that received it.
        pub beam: u32,
        /// Reported slant range, m.
        pub range: f32,
        /// Cell at that range, or the nearest one with an echo: `beam * bins + bin`.
        pub cell: u32,
        /// Level of the strongest cell of the echo, dB re 1 uPa.
        pub level_db: f32,
        /// Confidence, 0 to 1: `1 / (1 + (e / 0.25 %)^2)`, with the relative standard error `e` of the range given by the
        /// echo's shape and noise.
        pub quality: f32,
        /// Where it is according to a ray through the assumed profile of the water, m, relative to [`Ping::origin`](crate::ping::Ping::origin);
        /// NaN where the ray does not stay in the water.
        pub corrected: Vec3,
    }
}
