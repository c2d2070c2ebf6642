//! The objects of a scene.

use super::{Ancestor, Mesh, Sequence, UpAxis};
use glam::DAffine3;
use ground::builder;
use model::material::Material;
use model::motion::Motion;
use std::sync::Arc;

builder! {
    /// An object: one mesh placed in the world.
    #[derive(Clone, Debug)]
    pub struct Object {
        /// Name in the file.
        pub name: String,
        /// Its shape, which other objects may share.
        pub mesh: Arc<Mesh>,
        /// Placement, metres.
        pub world_from_object: DAffine3,
        /// Axis of its mesh that points up as modelled: boxes are upright along it.
        pub up: UpAxis,
        /// Semantic class number, 0 = unlabelled.
        pub category_id: u32,
        /// Part number of each part of the mesh, in their order.
        pub part_ids: Vec<u32>,
        /// Number of the instance, from 1; all objects of an instance share it.
        pub instance_id: u32,
        /// Scans whose mask shares a bit with this see it.
        pub mask: u32,
        /// Replaces the materials of all parts.
        pub material: Option<Arc<Material>>,
        /// Its motion on the timeline of its scene; `None`: it neither moves nor changes its shape.
        pub motion: Option<Motion>,
        /// Meshes that replace its own one after another; its own is the one at time 0.
        pub sequence: Option<Arc<Sequence>>,
        /// Its ancestor nodes in the file, from the outermost in, then its own if it is the only object there; the
        /// nearest [`MOST_ANCESTORS`](super::MOST_ANCESTORS) of them. Empty in formats without such nodes.
        pub ancestors: Arc<[Ancestor]>,
    }
}

impl Object {
    /// The materials of its parts, or the one that replaces them.
    #[doc(hidden)]
    pub fn materials(&self) -> impl Iterator<Item = &Arc<Material>> {
        let own = self.mesh.parts.iter().filter_map(|part| part.material.as_ref());
        self.material.iter().chain(own.filter(|_| self.material.is_none()))
    }

    /// `mesh` at its own coordinates, without labels, seen by every scan.
    pub fn new(name: impl Into<String>, mesh: Arc<Mesh>) -> Object {
        Object {
            name: name.into(),
            part_ids: vec![0; mesh.parts.len()],
            mesh,
            world_from_object: DAffine3::IDENTITY,
            up: UpAxis::Z,
            category_id: 0,
            instance_id: 0,
            mask: u32::MAX,
            material: None,
            motion: None,
            sequence: None,
            ancestors: Arc::default(),
        }
    }
}
