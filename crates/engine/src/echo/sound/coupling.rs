//! How motion shifts the range of an echo of a pulse that sweeps its frequency.
//!
//! The filter that is matched to a linear sweep mistakes a Doppler shift for a delay: an echo that is `f_D` too high is
//! found where the sweep, which rises by the bandwidth `B` in its length `T`, passes its frequency, `f_D T / B` too
//! early. With `f_D = -2 f r' / c`, the range is off by `r' f T / B` for a range rate `r'`: the sonar reports where the
//! scatterer will be that much later, or, if the sweep falls, where it was before (Richards 2014, "Fundamentals of
//! radar signal processing", chapter 4, range-Doppler coupling). Rays of a cell with different rates smear its echo.

use crate::trace::{Arrival, Clock, Movement, Tables};
use glam::Vec3;

/// A pulse that sweeps its frequency, between a sonar and objects that move.
#[derive(Clone, Copy)]
pub(crate) struct Coupling<'a> {
    /// Time `f T / B` by which ranges lead, s; below 0 if the sweep falls.
    pub lead: f32,
    /// Velocity of the sonar, world, m/s.
    pub own: Vec3,
    /// What moves in the scene, and when; `None`: nothing.
    pub moving: Option<(&'a Tables, Clock)>,
    /// Sound speed that the sonar assumes when it reports ranges, m/s.
    pub believed: f64,
}

impl Coupling<'_> {
    /// Range offset, m, of an echo whose sound left along the unit `launch`.
    pub fn shift(&self, arrival: &Arrival, launch: Vec3) -> f32 {
        let movement = self.moving.and_then(|(scene, clock)| {
            let time = clock.of(f64::from(arrival.range) / self.believed);
            scene.movement(None, arrival.surface, arrival.triangle, arrival.corner, time)
        });
        let Movement { velocity, .. } = movement.unwrap_or_default();
        self.lead * (velocity.dot(arrival.direction) - self.own.dot(launch))
    }
}
