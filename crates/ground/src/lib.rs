//! What every module is built on: errors, units, poses, blocks of rays, random numbers, work on threads. It knows
//! nothing about sensors or scenes.
#![forbid(unsafe_code)]

pub mod angle;
pub mod array;
pub mod builder;
pub mod cause;
pub mod crs;
pub mod error;
pub mod kept;
pub mod lanes;
pub mod math;
pub mod named;
pub mod parallel;
pub mod path_type;
pub mod pose;
pub mod profile;
pub mod read;
pub mod report;
pub mod rng;
pub mod shown;
pub mod units;
pub mod write;
