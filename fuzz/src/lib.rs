//! What is fuzzed: each module takes one input and fails where a promise is broken. libFuzzer runs them (fuzz_targets),
//! and so do tests with inputs made of the seeds.

pub mod cache;
pub mod capi;
pub mod cloud;
mod common;
pub mod fbx;
pub mod gltf;
pub mod hdf5;
pub mod obj;
pub mod ply;
pub mod scenario;
pub mod stl;
pub mod table;
pub mod yaml;
