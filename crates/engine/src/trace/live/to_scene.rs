//! An edited scene as one that others start from.

use super::LiveScene;
use super::object::lives;
use crate::scene::Scene;
use emitter::Trajectory;
use glam::{DAffine3, DMat3};
use ground::error::Result;
use ground::pose::Pose;
use model::Camera;
use model::motion::Timeline;
use std::collections::HashMap;
use std::sync::Arc;

impl LiveScene {
    /// Its objects with their motion and its labels as a scene, with camera nodes of these names that move along these
    /// paths. Objects and cameras are placed as now; cameras of files that move are left where they are at time 0.
    ///
    /// # Errors
    /// None for poses that a trajectory may have.
    pub fn to_scene(&self, cameras: &[(String, Trajectory)]) -> Result<Scene> {
        let mut timeline = Timeline::default();
        // Objects of one file share a timeline.
        let mut shifts = HashMap::new();
        let mut objects: Vec<_> = lives(&self.slots)
            .map(|(_, live)| {
                let mut object = live.object.clone();
                object.motion = match (&live.timeline, object.motion) {
                    (Some(own), Some(motion)) => {
                        let shift = *shifts.entry(Arc::as_ptr(own)).or_insert_with(|| timeline.append((**own).clone()));
                        Some(motion.shifted(shift))
                    }
                    _ => None,
                };
                object
            })
            .collect();
        for object in &mut objects {
            if let Some(motion) = &object.motion {
                object.world_from_object = timeline.world_from_node(motion.node, 0.0) * motion.node_from_object;
            }
        }
        let mut made = Vec::with_capacity(cameras.len() + self.cameras.len());
        for (name, path) in cameras {
            let node = match path.constant() {
                Some(_) => None,
                None => {
                    let keys: Vec<_> =
                        path.clone().into_keys().into_iter().map(|(time, pose)| (time, camera_node(&pose))).collect();
                    Some(timeline.append(Timeline::through(&keys)?))
                }
            };
            made.push(Camera { name: name.clone(), pose: path.at(0.0), node });
        }
        made.extend(self.cameras.iter().map(|camera| Camera { node: None, ..camera.clone() }));
        let mut materials = Vec::new();
        let mut known = HashMap::new();
        for material in objects.iter().flat_map(|object| object.materials()) {
            known.entry(Arc::as_ptr(material)).or_insert_with(|| materials.push(material.clone()));
        }
        Ok(Scene {
            objects,
            materials,
            cameras: made,
            labels: (*self.labels).clone(),
            timeline: Arc::new(timeline),
            ..Scene::default()
        })
    }
}

/// The camera node, which looks along its -z with y up, of a sensor at `pose`.
fn camera_node(pose: &Pose) -> DAffine3 {
    let DMat3 { x_axis, y_axis, z_axis } = pose.rotation();
    DAffine3::from_mat3_translation(DMat3::from_cols(-y_axis, z_axis, -x_axis), pose.position)
}
