//! Layout of a street or a town of streets, and the timing of the traffic lights.
//!
//! Streets run along x, side streets cross them along y, traffic keeps to the right. One crossing is at the origin.

use super::Street;
use crate::within;
use glam::{DVec2, DVec3};
use ground::error::Result;

/// Distances from the middle of the street to the edge of a lane, to the kerb (cars are parked in between), and to the
/// houses.
pub(super) const LANE: f64 = 3.3;
pub(super) const HALF_ROAD: f64 = 5.5;
pub(super) const FRONT: f64 = 9.0;
/// Distances from the middle of a side street to the kerb and to the houses.
pub(super) const SIDE_HALF_ROAD: f64 = 3.5;
pub(super) const SIDE_FRONT: f64 = 6.0;
/// Radius of the kerbs at the crossing, and their height.
pub(super) const CORNER: f64 = 4.0;
pub(super) const KERB: f64 = 0.12;
/// Distance of trees and posts from the middle of the street.
pub(super) const POSTS: f64 = HALF_ROAD + 0.75;
/// Distance of the middle of a lane from the middle of either street.
pub(super) const LANE_MIDDLE: f64 = LANE / 2.0;
/// Distances of the stop lines from the crossing, in the street and in a side street.
pub(super) const STOP: f64 = 11.0;
pub(super) const SIDE_STOP: f64 = 13.0;

/// Default length of the street and of the animation. A longer animation needs a longer street for the same drives.
const USUAL_LENGTH: f64 = 200.0;
const USUAL_SECONDS: f64 = 10.0;

/// With blocks: distance between crossings along x and y, and how far the streets continue beyond the last.
const PITCH: [f64; 2] = [100.0, 84.0];
const BEYOND: f64 = 45.0;
const MOST_BLOCKS: f64 = 10.0;

pub(super) struct StreetPlan {
    pub seconds: f64,
    /// Length of the animation over the default one, by which the start distances of cars are scaled.
    pub pace: f64,
    /// Whether there are blocks of houses with streets around them, not just one crossing.
    pub is_town: bool,
    /// Centre lines of the side streets (x) and of the streets (y).
    pub middles: [Vec<f64>; 2],
    /// Row by row along x.
    pub crossings: Vec<Crossing>,
}

/// A crossing, with its streets up to halfway to the neighbouring crossings, or to the end of a street.
pub(super) struct Crossing {
    pub at: DVec2,
    /// How far its streets reach: to the west and east, to the south and north.
    pub reach: [[f64; 2]; 2],
    /// Whether its lights are in opposite phase to those at the origin.
    pub is_odd: bool,
    /// From 1; `None` for the crossing at the origin.
    number: Option<usize>,
}

impl Crossing {
    /// World position of a point relative to the crossing.
    pub fn place(&self, x: f64, y: f64, z: f64) -> DVec3 {
        (self.at + DVec2::new(x, y)).extend(z)
    }

    /// The reach along x (0) or y (1): in the negative direction if `side` is negative, else in the positive one.
    pub fn reach(&self, axis: usize, side: f64) -> f64 {
        self.reach[axis][usize::from(side > 0.0)]
    }

    /// Name of an object that every crossing has; at the origin it has no number.
    pub fn name(&self, kind: &str, which: impl std::fmt::Display) -> String {
        match self.number {
            None => format!("{kind}_{which}"),
            Some(number) => format!("{kind}_{number}_{which}"),
        }
    }
}

impl StreetPlan {
    pub fn new(street: &Street) -> Result<Self> {
        within("seconds", street.seconds, 8.0, 30.0)?;
        for blocks in street.blocks.into_iter().flatten() {
            within("blocks", blocks.into(), 1.0, MOST_BLOCKS)?;
        }
        let pace = street.seconds / USUAL_SECONDS;
        let end = USUAL_LENGTH / 2.0 * pace.max(1.0);
        let middles = street.blocks.map_or([vec![0.0], vec![0.0]], |blocks| {
            [0, 1].map(|axis| {
                let first = blocks[axis] / 2;
                (0..=blocks[axis]).map(|line| (f64::from(line) - f64::from(first)) * PITCH[axis]).collect()
            })
        });
        let is_town = street.blocks.is_some();
        let reach = |axis: usize, line: usize| {
            [line > 0, line + 1 < middles[axis].len()].map(|goes_on| match (goes_on, is_town) {
                (true, _) => PITCH[axis] / 2.0,
                (false, true) => BEYOND,
                (false, false) => end / [1.0, 2.0][axis],
            })
        };
        let mut crossings = Vec::new();
        for (row, &y) in middles[1].iter().enumerate() {
            for (column, &x) in middles[0].iter().enumerate() {
                let at = DVec2::new(x, y);
                let is_odd = ((x / PITCH[0]) as i32 + (y / PITCH[1]) as i32) % 2 != 0;
                let number = (at != DVec2::ZERO).then_some(crossings.len() + 1);
                crossings.push(Crossing { at, reach: [reach(0, column), reach(1, row)], is_odd, number });
            }
        }
        Ok(StreetPlan { seconds: street.seconds, pace, is_town, middles, crossings })
    }

    /// Lowest and highest coordinate of the streets along x and y.
    pub fn ends(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|axis| {
            let at =
                |crossing: &Crossing, side: usize| crossing.at[axis] + [-1.0, 1.0][side] * crossing.reach[axis][side];
            let low = self.crossings.iter().map(|crossing| at(crossing, 0)).fold(f64::INFINITY, f64::min);
            let high = self.crossings.iter().map(|crossing| at(crossing, 1)).fold(f64::NEG_INFINITY, f64::max);
            [low, high]
        })
    }

    /// Times at which the lights of a crossing change, and the lamps (red, yellow, green) that are lit from then on:
    /// those of the street, then of the side street; at odd crossings, of the side street, then of the street.
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

    /// Whether the light of the street, or of the side street, is green at a crossing.
    pub fn is_green(&self, side_street: bool, is_odd: bool, time: f64) -> bool {
        let now = self.lights().into_iter().rev().find(|(from, _)| *from <= time);
        now.is_some_and(|(_, lamps)| lamps[usize::from(side_street != is_odd)][2])
    }
}
