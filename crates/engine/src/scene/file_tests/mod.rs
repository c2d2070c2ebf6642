//! Tests of the readers of scene files, by the scenes that they give.

#[cfg(feature = "fbx")]
mod fbx;
mod gltf;
mod gltf_animation;
mod obj;
mod pictures;
mod ply;
mod stl;

use glam::DVec3;
use ground::error::Result;
use model::material::{TextureBudget, Wrap};
use scene_files::read;
use std::fs;
use std::path::Path;
