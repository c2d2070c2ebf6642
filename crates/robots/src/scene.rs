//! A scene from a robot: an object for each link.

use crate::RobotOptions;
use crate::primitive::primitive_mesh;
use crate::robot::{JointKind, LinkGeometry, LinkShape, Robot};
use glam::{DAffine3, Vec3};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::shown;
use model::material::{Material, TextureBudget};
use model::{Ancestor, Camera, Mesh, Part, RawObject, RawScene, UpAxis, beyond_reach, is_degenerate};
use scene_files::FileOptions;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most triangles of all links of a file together: a world may include one model very often.
const MOST_TRIANGLES: usize = 200_000_000;

impl Robot {
    /// The vector of all joint positions in which the joints of `given` have the positions there, and all others are at
    /// rest. Names of joints that this robot does not have do not count: another may have them.
    ///
    /// # Errors
    /// A joint without a position of its own, or with several; a position that is not finite.
    pub fn positions_with(&self, given: &BTreeMap<String, f64>) -> Result<Vec<f64>> {
        let mut all = self.rest_positions();
        for (name, &position) in given {
            let Some(joint) = self.joints.iter().find(|joint| joint.name == *name) else { continue };
            let key = || format!("joints.{}", shown::name(name));
            if joint.mimic.is_some() || joint.kind.positions() != 1 {
                let found = match (joint.mimic, joint.kind) {
                    (Some(_), _) => "given for a joint that follows another",
                    (None, JointKind::Fixed) => "given for a joint that does not move",
                    _ => "one number for a joint that takes several",
                };
                return Err(Error::invalid(key(), found, "positions of joints that turn or slide"));
            }
            if !position.is_finite() {
                return Err(Error::invalid(key(), position, "a finite number"));
            }
            all[joint.first] = position;
        }
        Ok(all)
    }

    /// The scene of this robot, which was read from `path`, with all `positions` of its joints: an object for each link
    /// that has geometry, named after it, and a place for a sensor for each site and each sensor that it declares.
    ///
    /// # Errors
    /// A mesh that cannot be read; as [`Robot::link_poses`].
    pub fn scene(
        &self,
        path: &Path,
        positions: &[f64],
        options: &RobotOptions,
        images: &mut TextureBudget,
    ) -> Result<RawScene> {
        let poses = self.link_poses(positions)?;
        let mut maker = LinkMeshes::new(path, options, images);
        let models: BTreeSet<&str> = self.links.iter().map(|link| link.model.as_str()).collect();
        let numbers: HashMap<&str, u32> = models.into_iter().zip(0..).collect();
        for (link, pose) in self.links.iter().zip(&poses) {
            let Some(mesh) = maker.mesh(&link.name, &link.geometry)? else { continue };
            let model: Vec<Ancestor> = match link.model.as_str() {
                "" => Vec::new(),
                // A group: each link is an instance of its own.
                name => vec![Ancestor::new(numbers[name], name, None, true)],
            };
            maker.scene.objects.push(RawObject {
                name: link.name.clone(),
                mesh,
                world_from_object: *pose,
                up: UpAxis::Z,
                category: None,
                part: None,
                motion: None,
                ancestors: model.into(),
                has_node: false,
            });
        }
        let mut scene = maker.scene;
        for site in &self.sites {
            let world_from_site = site.link.map_or(DAffine3::IDENTITY, |link| poses[link]) * site.link_from_site;
            let (_, orientation, position) = world_from_site.to_scale_rotation_translation();
            let pose = Pose { position, orientation: orientation.normalize() };
            scene.cameras.push(Camera { name: site.name.clone(), pose, node: None });
        }
        scene.joints =
            self.joints.iter().filter(|joint| joint.positions() == 1).map(|joint| joint.name.clone()).collect();
        scene.report.absorb(self.report.clone());
        Ok(scene)
    }
}

/// Makes the meshes of links, each in the frame of its link.
struct LinkMeshes<'a> {
    path: &'a Path,
    options: FileOptions<'a>,
    images: &'a mut TextureBudget,
    /// The contents of files of meshes.
    files: HashMap<PathBuf, RawScene>,
    /// The mesh of the same geometry: wheels, and models of which a world has many.
    known: HashMap<String, Option<Arc<Mesh>>>,
    triangles: usize,
    scene: RawScene,
}

impl<'a> LinkMeshes<'a> {
    fn new(path: &'a Path, options: &RobotOptions, images: &'a mut TextureBudget) -> Self {
        let options = FileOptions {
            scale: 1.0,
            allow_outside_paths: options.allow_outside_paths,
            // As RViz does, which shows meshes of COLLADA as they are.
            ignores_axes: true,
            ..FileOptions::default()
        };
        let (files, known) = (HashMap::new(), HashMap::new());
        LinkMeshes { path, options, images, files, known, triangles: 0, scene: RawScene::default() }
    }

    /// The mesh of a link; `None`: it has no triangles.
    fn mesh(&mut self, link: &str, geometry: &[LinkGeometry]) -> Result<Option<Arc<Mesh>>> {
        let key = format!("{geometry:?}");
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let mut parts = Vec::new();
        for piece in geometry {
            let first = parts.len();
            match &piece.shape {
                LinkShape::Mesh { path, scale, from_mesh, only } => {
                    let link_from_file = piece.link_from_geometry * *from_mesh * DAffine3::from_scale(*scale);
                    self.add_file(path, only.as_deref(), &link_from_file, &mut parts)?;
                }
                primitive => {
                    parts.extend(primitive_mesh(primitive).map(|part| moved(&part, &piece.link_from_geometry).0));
                }
            }
            for part in &mut parts[first..] {
                if piece.replaces || part.material.is_none() {
                    part.material = piece.material.clone().or(part.material.take());
                }
            }
        }
        for part in &parts {
            self.triangles += part.triangles.len();
            if let Some(vertex) = beyond_reach(&part.positions) {
                let message = format!("it reaches to {:?}; allowed: -1e18 to 1e18", part.positions[vertex]);
                return Err(Error::parse(self.path, format!("link {:?}", shown::name(link)), message));
            }
            if let Some(material) = &part.material {
                self.note(material.clone());
            }
        }
        if self.triangles > MOST_TRIANGLES {
            let message = format!("its links have more than {MOST_TRIANGLES} triangles, the most allowed");
            return Err(Error::parse(self.path, "", message));
        }
        let mesh = (!parts.is_empty()).then(|| Arc::new(Mesh::trusted(link.to_owned(), parts)));
        self.known.insert(key, mesh.clone());
        Ok(mesh)
    }

    /// Adds the triangles of a file, or of one object of it.
    fn add_file(
        &mut self,
        path: &Path,
        only: Option<&str>,
        link_from_file: &DAffine3,
        parts: &mut Vec<Part>,
    ) -> Result<()> {
        if !self.files.contains_key(path) {
            let mut file = scene_files::read(path, &self.options, self.images)?;
            self.scene.report.absorb(std::mem::take(&mut file.report));
            self.scene.degenerate_triangles += file.degenerate_triangles;
            self.files.insert(path.to_owned(), file);
        }
        let file = &self.files[path];
        let is_meant = |object: &&RawObject| only.is_none_or(|name| object.name == name || object.mesh.name == name);
        if let Some(name) = only.filter(|_| !file.objects.iter().any(|object| is_meant(&object))) {
            let names = file.objects.iter().map(|object| object.name.clone()).collect::<Vec<_>>();
            let near = shown::some_of(&names);
            let message = format!("has no submesh {:?}; allowed: {near}", shown::name(name));
            return Err(Error::parse(path, "", message));
        }
        for object in file.objects.iter().filter(is_meant) {
            let link_from_mesh = *link_from_file * object.world_from_object;
            for part in &object.mesh.parts {
                let (part, lost) = moved(part, &link_from_mesh);
                self.scene.degenerate_triangles += lost;
                if !part.triangles.is_empty() {
                    parts.push(part);
                }
            }
        }
        Ok(())
    }

    /// Adds a material to those of the scene.
    fn note(&mut self, material: Arc<Material>) {
        if !self.scene.materials.iter().any(|known| Arc::ptr_eq(known, &material)) {
            self.scene.materials.push(material);
        }
    }
}

/// A part in another frame, and how many of its triangles have no area there.
fn moved(part: &Part, to: &DAffine3) -> (Part, usize) {
    let positions: Vec<[f32; 3]> =
        part.positions.iter().map(|&p| to.transform_point3(Vec3::from(p).as_dvec3()).as_vec3().to_array()).collect();
    // Normals go by the inverse transpose; a mirror turns triangles inside out.
    let turned = to.matrix3.inverse().transpose();
    let mirrored = to.matrix3.determinant() < 0.0;
    let normals = part.normals.as_ref().map(|normals| {
        let turn =
            |&normal: &[f32; 3]| (turned * Vec3::from(normal).as_dvec3()).normalize_or_zero().as_vec3().to_array();
        normals.iter().map(turn).collect::<Vec<_>>().into()
    });
    let has_area =
        |&[a, b, c]: &[u32; 3]| !is_degenerate(positions[a as usize], positions[b as usize], positions[c as usize]);
    let kept = part.triangles.iter().map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] });
    let triangles: Vec<[u32; 3]> = kept.filter(has_area).collect();
    let lost = part.triangles.len() - triangles.len();
    (part.clone().positions(positions.into()).normals(normals).triangles(triangles.into()), lost)
}
