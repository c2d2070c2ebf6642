//! Plans of laser surveys: strips over an area, and how a platform flies them. `trajectory: {plan: …}` of a scenario makes
//! one, see [`Sample::plan`](crate::scenario::Sample::plan).

#[doc(inline)]
pub use ::survey::{
    AreaBox, CarrierKind, Coverage, CrossLines, FlightLine, GroundHeight, HeightAbove, PlanSpec, SurveyPlan,
    SurveySwath,
};
