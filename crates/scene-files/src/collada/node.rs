//! The nodes of the scene, and what they place.

use super::library::{ColladaLibrary, name_of};
use super::mesh::{Binding, ColladaMeshes};
use crate::notes::Notes;
use glam::{DAffine3, DMat3, DMat4, DVec3};
use ground::error::Result;
use ground::pose::Pose;
use ground::read::xml::Xml;
use ground::shown;
use model::{Ancestor, Camera, MOST_ANCESTORS, RawObject, RawScene, UpAxis};
use std::path::Path;

/// Most nodes, each counted as often as it is placed: nodes may place others that place others.
const MOST_NODES: usize = 1_000_000;

/// Deepest hierarchy: deeper is a circle.
const DEEPEST: usize = 1000;

/// Goes through the nodes of a scene.
pub(super) struct ColladaNodes<'d, 'a> {
    library: &'a ColladaLibrary<'d>,
    path: &'a Path,
    meshes: ColladaMeshes<'d, 'a>,
    world_from_file: DAffine3,
    scene: RawScene,
    nodes: usize,
}

/// A node that is yet to be placed.
struct OpenNode<'d> {
    element: Xml<'d>,
    file_from_parent: DAffine3,
    ancestors: Vec<Ancestor>,
    depth: usize,
}

impl<'d, 'a> ColladaNodes<'d, 'a> {
    pub fn new(
        library: &'a ColladaLibrary<'d>,
        path: &'a Path,
        meshes: ColladaMeshes<'d, 'a>,
        world_from_file: DAffine3,
    ) -> Self {
        ColladaNodes { library, path, meshes, world_from_file, scene: RawScene::default(), nodes: 0 }
    }

    /// Reads the scene of the file, or, without any, all of its geometries.
    pub fn read(&mut self, root: Xml<'d>, notes: &mut Notes) -> Result<()> {
        let instance = root.child("scene").and_then(|scene| scene.child("instance_visual_scene"));
        let visual = match instance {
            Some(instance) => Some(self.library.referred(instance, "url")?),
            None => root.child("library_visual_scenes").and_then(|library| library.child("visual_scene")),
        };
        let Some(visual) = visual else {
            notes.add("without a scene, all geometries are where they are defined", || "the file".to_owned());
            let geometries: Vec<Xml<'d>> =
                root.children("library_geometries").flat_map(|all| all.children("geometry")).collect();
            for geometry in geometries {
                self.place(geometry, &[], DAffine3::IDENTITY, ("", &[], true), notes)?;
            }
            return Ok(());
        };
        let open =
            |element| OpenNode { element, file_from_parent: DAffine3::IDENTITY, ancestors: Vec::new(), depth: 0 };
        let mut stack: Vec<OpenNode<'d>> = visual.children("node").map(open).collect();
        stack.reverse();
        while let Some(node) = stack.pop() {
            self.node(node, &mut stack, notes)?;
        }
        Ok(())
    }

    /// What was found.
    pub fn finished(mut self) -> RawScene {
        self.scene.degenerate_triangles = self.meshes.degenerate_triangles;
        self.scene.materials = self.meshes.materials.list;
        self.scene
    }

    fn node(&mut self, node: OpenNode<'d>, stack: &mut Vec<OpenNode<'d>>, notes: &mut Notes) -> Result<()> {
        let OpenNode { element, file_from_parent, mut ancestors, depth } = node;
        self.nodes += 1;
        if depth > DEEPEST || self.nodes > MOST_NODES {
            return Err(element.error(format_args!(
                "is one of more than {MOST_NODES} nodes, or below more than {DEEPEST}; allowed: fewer, and no circle of instances"
            )));
        }
        let parent_from_node = transform(element, notes)?;
        let file_from_node = file_from_parent * parent_from_node;
        if !file_from_node.is_finite() {
            return Err(element.error("has a transform that is not finite; allowed: numbers whose products are"));
        }
        let name = name_of(element);
        let placed: Vec<Xml<'d>> = element
            .elements()
            .filter(|inner| ["instance_geometry", "instance_controller"].contains(&inner.name()))
            .collect();
        let is_group = placed.is_empty() && parent_from_node.translation == DVec3::ZERO;
        if ancestors.len() == MOST_ANCESTORS {
            ancestors.remove(0);
        }
        ancestors.push(Ancestor::new(self.nodes as u32, name, None, is_group));
        for instance in &placed {
            let mut target = self.library.referred(*instance, "url")?;
            let mut to_mesh = DAffine3::IDENTITY;
            if instance.name() == "instance_controller" {
                (target, to_mesh) = self.skinned(target, notes)?;
            }
            let bindings = self.bindings(*instance)?;
            let own = (name, &ancestors[..], placed.len() == 1);
            self.place(target, &bindings, file_from_node * to_mesh, own, notes)?;
        }
        for _ in element.children("instance_camera") {
            let pose = Pose::from_camera_node(&(self.world_from_file * file_from_node));
            self.scene.cameras.push(Camera { name: name.to_owned(), pose, node: None });
        }
        let first = stack.len();
        for inner in element.elements() {
            let below = match inner.name() {
                "node" => inner,
                "instance_node" => self.library.referred(inner, "url")?,
                _ => continue,
            };
            stack.push(OpenNode {
                element: below,
                file_from_parent: file_from_node,
                ancestors: ancestors.clone(),
                depth: depth + 1,
            });
        }
        stack[first..].reverse();
        Ok(())
    }

    /// The geometry of a controller in its rest pose, and where it is.
    fn skinned(&self, controller: Xml<'d>, notes: &mut Notes) -> Result<(Xml<'d>, DAffine3)> {
        notes.add("skins and morphs are in their rest pose", || format!("{:?}", shown::name(name_of(controller))));
        let Some(skin) = controller.child("skin").or_else(|| controller.child("morph")) else {
            return Err(controller.error("has neither skin nor morph"));
        };
        let source = self.library.referred(skin, "source")?;
        let bind = match skin.child("bind_shape_matrix") {
            Some(matrix) => of_matrix(matrix)?,
            None => DAffine3::IDENTITY,
        };
        if source.name() == "geometry" {
            return Ok((source, bind));
        }
        // The skin of a morph.
        match source.child("morph").map(|morph| self.library.referred(morph, "source")).transpose()? {
            Some(source) if source.name() == "geometry" => Ok((source, bind)),
            _ => Err(controller.error("refers to no geometry; allowed: a skin or a morph of one")),
        }
    }

    /// The materials that an instance of a geometry binds to its symbols.
    fn bindings(&self, instance: Xml<'d>) -> Result<Vec<Binding<'d>>> {
        let bind = instance.child("bind_material").and_then(|bind| bind.child("technique_common"));
        let mut bindings = Vec::new();
        for material in bind.into_iter().flat_map(|bind| bind.children("instance_material")) {
            let coordinates = material
                .children("bind_vertex_input")
                .find(|bind| bind.attribute("input_semantic") == Some("TEXCOORD"));
            let set = coordinates.map(|bind| bind.number("input_set")).transpose()?.flatten();
            let set = set.map(|set| set.max(0.0) as u32);
            bindings.push((material.required("symbol")?, self.library.referred(material, "target")?, set));
        }
        Ok(bindings)
    }

    /// Places a geometry with its materials; `owner` is the name of its node, the nodes above and its own, and whether
    /// that places nothing else.
    fn place(
        &mut self,
        geometry: Xml<'d>,
        bindings: &[Binding<'d>],
        file_from_mesh: DAffine3,
        (name, ancestors, has_node): (&str, &[Ancestor], bool),
        notes: &mut Notes,
    ) -> Result<()> {
        if geometry.name() != "geometry" {
            return Err(geometry.error("is not a geometry"));
        }
        let Some(found) = self.meshes.get(geometry, bindings, notes)? else { return Ok(()) };
        let stem = || self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let named = [name, name_of(geometry)].into_iter().find(|name| !name.is_empty());
        let world_from_object = self.world_from_file * file_from_mesh * DAffine3::from_translation(found.middle);
        self.scene.objects.push(RawObject {
            name: named.map_or_else(stem, str::to_owned),
            mesh: found.mesh,
            world_from_object,
            up: UpAxis::Z,
            category: None,
            part: None,
            motion: None,
            ancestors: ancestors.into(),
            has_node: has_node && !ancestors.is_empty(),
        });
        Ok(())
    }
}

/// The transform of a node: the product of its transforms in their order.
fn transform(node: Xml<'_>, notes: &mut Notes) -> Result<DAffine3> {
    let mut whole = DAffine3::IDENTITY;
    for step in node.elements() {
        whole *= match step.name() {
            "matrix" => of_matrix(step)?,
            "translate" => DAffine3::from_translation(DVec3::from(step.content_numbers::<3>()?)),
            "scale" => DAffine3::from_scale(DVec3::from(step.content_numbers::<3>()?)),
            "rotate" => {
                let [x, y, z, degrees] = step.content_numbers::<4>()?;
                // Without an axis there is no rotation.
                let turned = DVec3::new(x, y, z).try_normalize();
                turned.map_or(DAffine3::IDENTITY, |axis| DAffine3::from_axis_angle(axis, degrees.to_radians()))
            }
            "lookat" => {
                let [eye, at, up] = {
                    let n = step.content_numbers::<9>()?;
                    [0, 3, 6].map(|k| DVec3::new(n[k], n[k + 1], n[k + 2]))
                };
                let back = (eye - at).normalize_or(DVec3::Z);
                let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
                DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye)
            }
            "skew" => {
                notes.add("skews of nodes are left out", || format!("{:?}", shown::name(name_of(node))));
                DAffine3::IDENTITY
            }
            _ => continue,
        };
    }
    Ok(whole)
}

/// The matrix in an element, which is written row by row.
fn of_matrix(matrix: Xml<'_>) -> Result<DAffine3> {
    let rows = DMat4::from_cols_array(&matrix.content_numbers::<16>()?).transpose();
    if rows.row(3) != glam::DVec4::W {
        return Err(matrix.error("has a last row other than 0 0 0 1"));
    }
    Ok(DAffine3::from_mat4(rows))
}
