//! Tests of the readers of scene files, by the scenes that they give.

#[cfg(feature = "fbx")]
mod fbx;
mod gltf;
mod gltf_animation;
mod obj;
mod pictures;
mod ply;
mod stl;

use crate::scene::{Object, Scene};
use glam::DVec3;
use ground::error::Result;
use model::material::{TextureBudget, Wrap};
use model::motion::Pull;
use scene_files::read;
use std::fs;
use std::path::Path;

/// World positions of the vertices of a part of an object at `time`.
fn vertices_at(scene: &Scene, object: &Object, part: usize, time: f64) -> Vec<DVec3> {
    let mut positions = object.mesh.parts[part].positions.to_vec();
    let mut world_from_object = object.world_from_object;
    if let Some(motion) = &object.motion {
        world_from_object = scene.timeline.world_from_node(motion.node, time) * motion.node_from_object;
        if let Some(shape) = &motion.shape {
            let Pull { weights, palette } = shape.pull(&scene.timeline, time, &world_from_object);
            shape.vertices.parts[part].pose(&weights, &palette, &mut positions);
        }
    }
    positions.iter().map(|p| world_from_object.transform_point3(DVec3::from(p.map(f64::from)))).collect()
}
