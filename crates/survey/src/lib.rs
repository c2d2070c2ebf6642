//! Laser surveys before they are flown: what a scanner covers, flight lines over an area, and how platforms fly them.
#![forbid(unsafe_code)]

mod altitude;
mod lines;
mod plan;
mod platform;
mod spec;
mod swath;
mod turn;

pub use plan::{Coverage, FlightLine, SurveyPlan};
pub use spec::{AreaBox, CarrierKind, CrossLines, HeightAbove, PlanSpec};
pub use swath::SurveySwath;

/// Height of the ground at x and y, m; `None`: there is none.
pub type GroundHeight<'g> = &'g dyn Fn(f64, f64) -> Option<f64>;
