//! What every module is built on: errors, units, poses, blocks of rays, random numbers, work on threads. It knows
//! nothing about sensors or scenes.

pub(crate) mod angle;
pub(crate) mod array;
pub(crate) mod builder;
pub(crate) mod cause;
pub(crate) mod error;
pub(crate) mod kept;
pub(crate) mod lanes;
pub(crate) mod math;
pub(crate) mod named;
pub(crate) mod parallel;
pub(crate) mod pose;
pub(crate) mod profile;
pub(crate) mod report;
pub(crate) mod rng;
pub mod shown;
pub mod units;
