//! What is where in the street, and when the traffic lights change.
//!
//! The street runs along x, a side street crosses it at the origin, traffic keeps to the right.

use super::Street;
use crate::generate::within;
use crate::ground::error::Result;

/// Distances from the middle of the street: of the edge of a lane, of the kerb (cars are parked in between), and of the
/// houses.
pub(super) const LANE: f64 = 3.3;
pub(super) const HALF_ROAD: f64 = 5.5;
pub(super) const FRONT: f64 = 9.0;
/// Of the kerb and the houses from the middle of the side street.
pub(super) const SIDE_HALF_ROAD: f64 = 3.5;
pub(super) const SIDE_FRONT: f64 = 6.0;
/// Radius of the kerbs at the crossing, and how high they are.
pub(super) const CORNER: f64 = 4.0;
pub(super) const KERB: f64 = 0.12;
/// Where the trees and posts are.
pub(super) const POSTS: f64 = HALF_ROAD + 0.75;
/// Middle of a lane of either street.
pub(super) const LANE_MIDDLE: f64 = LANE / 2.0;

/// Length of the street and of the usual animation. Longer ones need a longer street for the same drives.
const USUAL_LENGTH: f64 = 200.0;
const USUAL_SECONDS: f64 = 10.0;

/// There is room for so many cars.
pub(super) const MOST_CARS: u32 = 10;

pub(super) struct Plan {
    pub seconds: f64,
    /// How much longer than usual the animation is: what happens later happens as much later.
    pub pace: f64,
    /// Distance of the ends of the streets from the crossing.
    pub end: f64,
    pub side_end: f64,
    /// Distance of the stop lines.
    pub stop: f64,
    pub side_stop: f64,
}

impl Plan {
    pub fn new(street: &Street) -> Result<Self> {
        within("cars", street.cars.into(), 1.0, MOST_CARS.into())?;
        within("seconds", street.seconds, 8.0, 30.0)?;
        let pace = street.seconds / USUAL_SECONDS;
        let end = USUAL_LENGTH / 2.0 * pace.max(1.0);
        Ok(Plan { seconds: street.seconds, pace, end, side_end: end / 2.0, stop: 11.0, side_stop: 13.0 })
    }

    /// When the lights change, and which lamps shine then, red, yellow, green: of the street, of the side street.
    pub fn lights(&self) -> [(f64, [[bool; 3]; 2]); 5] {
        const RED: [bool; 3] = [true, false, false];
        const READY: [bool; 3] = [true, true, false];
        const YELLOW: [bool; 3] = [false, true, false];
        const GREEN: [bool; 3] = [false, false, true];
        let change = 0.48 * self.seconds;
        [
            (0.0, [GREEN, RED]),
            (change, [YELLOW, RED]),
            (change + 1.2, [RED, RED]),
            (change + 1.6, [RED, READY]),
            (change + 2.2, [RED, GREEN]),
        ]
    }

    /// Whether the light of the street, or of the side street, is green.
    pub fn is_green(&self, side_street: bool, time: f64) -> bool {
        let now = self.lights().into_iter().rev().find(|(from, _)| *from <= time);
        now.is_some_and(|(_, [street, side])| if side_street { side[2] } else { street[2] })
    }
}
