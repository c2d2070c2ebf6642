//! The rooms of a floor, the walls between them, and the zones that must stay free.

use super::Indoor;
use crate::noise::Dice;
use crate::within;
use glam::{DVec2, DVec3};
use ground::error::Result;
use ground::rng::Draw;

/// Thickness of walls.
pub(super) const WALL: f64 = 0.14;
/// Width and height of the opening of a door.
pub(super) const DOOR: [f64; 2] = [0.9, 2.05];
/// Lower and upper edge of windows.
const WINDOW: [f64; 2] = [0.9, 2.1];
/// Height of the cameras.
pub(super) const EYE: f64 = 1.5;

pub(super) struct FloorPlan {
    pub height: f64,
    pub walls: Vec<Wall>,
    pub rooms: Vec<Room>,
}

/// A wall with at most one opening.
pub(super) struct Wall {
    /// The axis along which it runs, and its ends there.
    pub axis: usize,
    pub ends: [f64; 2],
    /// Position of its middle on the other axis.
    pub at: f64,
    pub opening: Option<Opening>,
}

#[derive(Clone, Copy)]
pub(super) struct Opening {
    /// Along the wall, and above the floor.
    pub along: [f64; 2],
    pub up: [f64; 2],
    pub leads_outside: bool,
}

impl Opening {
    pub fn is_door(&self) -> bool {
        self.up[0] == 0.0
    }
}

impl Wall {
    /// A position: along the wall, to the side of higher coordinates, and above the floor.
    pub fn place(&self, along: f64, aside: f64, up: f64) -> DVec3 {
        let across = self.at + aside;
        if self.axis == 0 { DVec3::new(along, across, up) } else { DVec3::new(across, along, up) }
    }
}

pub(super) struct Room {
    /// Corners between the faces of its walls; `outer`: between the centre lines of its walls.
    pub low: DVec2,
    pub high: DVec2,
    pub outer: [DVec2; 2],
    pub zones: Vec<Zone>,
}

/// A rectangle in which no object may be higher than `below`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Zone {
    pub low: DVec2,
    pub high: DVec2,
    pub below: f64,
}

impl Zone {
    /// A zone with this centre and size.
    pub fn about(middle: DVec2, size: DVec2, below: f64) -> Self {
        Zone { low: middle - size / 2.0, high: middle + size / 2.0, below }
    }

    fn meets(&self, other: &Zone) -> bool {
        self.low.cmplt(other.high).all() && other.low.cmplt(self.high).all()
    }
}

impl Room {
    /// Whether an object of this height fits there.
    pub fn fits(&self, there: &Zone, height: f64) -> bool {
        let inside = there.low.cmpge(self.low).all() && there.high.cmple(self.high).all();
        inside && !self.zones.iter().any(|zone| height > zone.below && zone.meets(there))
    }

    pub fn middle(&self) -> DVec2 {
        (self.low + self.high) / 2.0
    }
}

impl FloorPlan {
    pub fn new(indoor: &Indoor, seed: u64) -> Result<Self> {
        let Indoor { rooms, room_m, height_m, furniture, mirrors, panes, .. } = *indoor;
        for axis in 0..2 {
            within("rooms", rooms[axis].into(), 1.0, 10.0)?;
            within("room_m", room_m[axis], 3.0, 20.0)?;
        }
        within("height_m", height_m, 2.3, 6.0)?;
        within("furniture", furniture, 0.0, 1.0)?;
        within("mirrors", mirrors.into(), 0.0, 100.0)?;
        within("panes", panes.into(), 0.0, 100.0)?;

        let mut dice = Dice::new(seed, Draw::Room, 0);
        // Centre lines of the walls.
        let lines = [0, 1].map(|axis| {
            let shares: Vec<f64> = (0..rooms[axis]).map(|_| dice.between(0.9, 1.1)).collect();
            let total = room_m[axis] * f64::from(rooms[axis]);
            let part = total / shares.iter().sum::<f64>();
            let mut lines = vec![-total / 2.0];
            lines.extend(shares.iter().scan(-total / 2.0, |at, share| {
                *at += share * part;
                Some(*at)
            }));
            lines
        });
        let mut plan = FloorPlan { height: height_m, walls: Vec::new(), rooms: Vec::new() };
        for y in lines[1].windows(2) {
            for x in lines[0].windows(2) {
                let outer = [DVec2::new(x[0], y[0]), DVec2::new(x[1], y[1])];
                let half = DVec2::splat(WALL / 2.0);
                plan.rooms.push(Room { low: outer[0] + half, high: outer[1] - half, outer, zones: Vec::new() });
            }
        }
        let [columns, rows] = [0, 1].map(|axis| rooms[axis] as usize);
        for axis in 0..2 {
            let [along, across] = [&lines[axis], &lines[1 - axis]];
            for (line, &at) in across.iter().enumerate() {
                for place in 0..along.len() - 1 {
                    let is_outer = line == 0 || line + 1 == across.len();
                    let inner = [along[place] + WALL / 2.0, along[place + 1] - WALL / 2.0];
                    // Walls along y reach through the corners, those along x end between them.
                    let mut ends = inner;
                    if axis == 1 {
                        ends = [along[place], along[place + 1]];
                        ends[0] -= if place == 0 { WALL / 2.0 } else { 0.0 };
                        ends[1] += if place + 2 == along.len() { WALL / 2.0 } else { 0.0 };
                    }
                    // There are doors between all rooms of a row, and between all rows in the first column.
                    let dark = dice.unit() < 0.4;
                    let has_door =
                        if is_outer { axis == 0 && line == 0 && place == 0 } else { axis == 1 || place == 0 || !dark };
                    let window = (0.5 * (inner[1] - inner[0])).min(1.8);
                    let width = if has_door { DOOR[0] } else { window };
                    let from = dice.between(inner[0] + 0.3, inner[1] - 0.3 - width);
                    let up = if has_door { [0.0, DOOR[1]] } else { [WINDOW[0], WINDOW[1].min(height_m - 0.15)] };
                    let opening = Opening { along: [from, from + width], up, leads_outside: is_outer };
                    let opening = (has_door || is_outer).then_some(opening);
                    let wall = Wall { axis, ends, at, opening };
                    for side in [-1.0, 1.0] {
                        let beside = if side > 0.0 { line } else { line.wrapping_sub(1) };
                        let (column, row) = if axis == 0 { (place, beside) } else { (beside, place) };
                        if let Some(opening) = opening
                            && column < columns
                            && row < rows
                        {
                            plan.rooms[row * columns + column].zones.push(wall.zone(&opening, side));
                        }
                    }
                    plan.walls.push(wall);
                }
            }
        }
        Ok(plan)
    }
}

impl Wall {
    /// The zone that an opening needs on one side: a door at all heights, a window above its lower edge.
    fn zone(&self, opening: &Opening, side: f64) -> Zone {
        /// Depth of the free zone at a door, and at a window.
        const THROUGH: f64 = 1.0;
        const BEFORE: f64 = 0.6;
        let deep = WALL / 2.0 + if opening.is_door() { THROUGH } else { BEFORE };
        let corners = [opening.along[0] - 0.1, opening.along[1] + 0.1]
            .map(|along| [0.0, side * deep].map(|aside| self.place(along, aside, 0.0).truncate()));
        let all = || corners.iter().flatten();
        Zone {
            low: all().fold(DVec2::INFINITY, |low, at| low.min(*at)),
            high: all().fold(DVec2::NEG_INFINITY, |high, at| high.max(*at)),
            below: opening.up[0],
        }
    }
}
