//! Geoms, and the meshes and materials that they use.

use super::compiler::MjcfCompiler;
use super::defaults::{Classed, MjcfDefaults};
use crate::folders::ModelFolders;
use crate::robot::{GeometryUse, LinkGeometry, LinkShape};
use crate::shapes::{SIZES, checked_scale, colored, is_size};
use glam::{DAffine3, DQuat, DVec3};
use ground::error::{Error, Result};
use ground::read::xml::Xml;
use ground::report::Report;
use model::material::Material;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Edge of planes without one, metres: they are infinite in MuJoCo.
const ENDLESS_M: f64 = 2000.0;

/// The last group that MuJoCo shows by default (`mjv_defaultOption`).
const LAST_SHOWN: f64 = 2.0;

/// The colour of geoms that say nothing of it.
const GREY: [f64; 4] = [0.5, 0.5, 0.5, 1.0];

/// A mesh of the assets; `None` of a path: one of numbers in the model.
struct MjcfMesh {
    path: Option<PathBuf>,
    from_file: DAffine3,
}

/// Reads geoms.
pub(super) struct GeomReader<'d, 'm> {
    compiler: &'m MjcfCompiler,
    defaults: &'m MjcfDefaults<'d>,
    folders: ModelFolders<'m>,
    main: &'m Path,
    geometry: GeometryUse,
    meshes: HashMap<String, MjcfMesh>,
    materials: HashMap<&'d str, [f64; 4]>,
}

impl<'d, 'm> GeomReader<'d, 'm> {
    pub fn new(
        compiler: &'m MjcfCompiler,
        defaults: &'m MjcfDefaults<'d>,
        folders: ModelFolders<'m>,
        main: &'m Path,
        geometry: GeometryUse,
    ) -> Self {
        let (meshes, materials) = (HashMap::new(), HashMap::new());
        GeomReader { compiler, defaults, folders, main, geometry, meshes, materials }
    }

    /// Takes a mesh or a material of the assets.
    pub fn asset(&mut self, asset: Xml<'d>) -> Result<()> {
        let own = Classed::new(asset, None, self.defaults)?;
        match asset.name() {
            "material" => {
                let rgba = own.numbers::<4>("rgba")?.unwrap_or([1.0; 4]);
                self.materials.insert(asset.required("name")?, rgba);
            }
            "mesh" => {
                let file = asset.attribute("file");
                let stem = file.and_then(|file| Path::new(file).file_stem()?.to_str());
                let Some(name) = asset.attribute("name").or(stem) else {
                    return Err(asset.error("has neither a name nor a file"));
                };
                let path = file.map(|file| self.mesh_file(asset, file)).transpose()?;
                let scale = checked_scale(asset, own.numbers::<3>("scale")?.map(DVec3::from))?;
                let at = own.numbers::<3>("refpos")?.map_or(DVec3::ZERO, DVec3::from);
                let [w, x, y, z] = own.numbers::<4>("refquat")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
                let turned = DQuat::from_xyzw(x, y, z, w);
                if turned.length_squared() == 0.0 {
                    return Err(own.wrong("refquat", "a quaternion, not of length 0"));
                }
                let reference = DAffine3::from_rotation_translation(turned.normalize(), at);
                let from_file = DAffine3::from_scale(scale) * reference.inverse();
                self.meshes.insert(name.to_owned(), MjcfMesh { path, from_file });
            }
            _ => {}
        }
        Ok(())
    }

    fn mesh_file(&self, asset: Xml<'d>, file: &str) -> Result<PathBuf> {
        let file = match file.rsplit_once(['/', '\\']) {
            Some((_, last)) if self.compiler.strips => last,
            _ => file,
        };
        let name = match self.compiler.mesh_folder.as_str() {
            "" => file.to_owned(),
            folder if !Path::new(file).is_absolute() => format!("{}/{file}", folder.trim_end_matches('/')),
            _ => file.to_owned(),
        };
        self.folders.find(self.main, &name).map_err(|why| asset.error(format_args!("file {why}")))
    }

    /// The geometry of a geom; `None`: it does not count, or, with a warning, cannot be read.
    pub fn geom(&mut self, geom: Classed<'d, 'm>, report: &mut Report) -> Result<Option<LinkGeometry>> {
        let counts = match self.geometry {
            GeometryUse::Visual => geom.number("group")?.unwrap_or(0.0) <= LAST_SHOWN,
            GeometryUse::Collision => {
                let [kind, affinity] = [geom.number("contype")?, geom.number("conaffinity")?];
                kind.unwrap_or(1.0) != 0.0 || affinity.unwrap_or(1.0) != 0.0
            }
        };
        if !counts {
            return Ok(None);
        }
        let kind = geom.attribute("type").unwrap_or("sphere");
        let mesh = geom.attribute("mesh");
        let shape = match (kind, mesh) {
            ("mesh", Some(name)) => match self.mesh(geom, name)? {
                Some(shape) => shape,
                None => {
                    report.warn(geom.element.told("is left out: its mesh is not in a file"));
                    return Ok(None);
                }
            },
            ("mesh", None) => return Err(geom.wrong("mesh", "names of meshes")),
            ("hfield" | "sdf", _) | (_, Some(_)) => {
                report
                    .warn(geom.element.told(format_args!("is left out: a geom of type {kind} with a field or a mesh")));
                return Ok(None);
            }
            _ => self.primitive(geom, kind)?,
        };
        let (link_from_geometry, shape) = self.between_points(geom, shape)?;
        let rgba = geom.numbers::<4>("rgba")?;
        let material: Arc<Material> = match geom.attribute("material") {
            // A colour of its own counts more, unless it is the default one.
            Some(name) => {
                let known = self.materials.get(name).copied();
                let known = known.ok_or_else(|| geom.wrong("material", "names of materials"))?;
                colored(name, rgba.filter(|rgba| *rgba != GREY).unwrap_or(known))
            }
            None => colored("", rgba.unwrap_or(GREY)),
        };
        Ok(Some(LinkGeometry { link_from_geometry, shape, material: Some(material), replaces: true }))
    }

    fn mesh(&self, geom: Classed<'d, 'm>, name: &str) -> Result<Option<LinkShape>> {
        let mesh = self.meshes.get(name).ok_or_else(|| {
            let missing = Error::missing("mesh", name, self.meshes.keys());
            geom.element.error(format_args!("has a mesh that is not defined: {missing}"))
        })?;
        let shape = mesh.path.clone().map(|path| LinkShape::Mesh {
            path,
            scale: DVec3::ONE,
            from_mesh: mesh.from_file,
            only: None,
        });
        Ok(shape)
    }

    /// A primitive by its `size`: half its extent.
    fn primitive(&self, geom: Classed<'d, 'm>, kind: &str) -> Result<LinkShape> {
        let sizes = geom.all_numbers("size")?.unwrap_or_default();
        // Between two points, the length is their distance.
        let between = geom.attribute("fromto").is_some();
        let needed = match kind {
            "sphere" => 1,
            "capsule" | "cylinder" if between => 1,
            "box" | "ellipsoid" if between => 1,
            "capsule" | "cylinder" => 2,
            "box" | "ellipsoid" => 3,
            "plane" => 0,
            _ => return Err(geom.wrong("type", "plane, sphere, capsule, ellipsoid, cylinder, box, mesh")),
        };
        let of_plane = |size: &f64| kind == "plane" && *size == 0.0;
        if sizes.len() < needed
            || !sizes
                .iter()
                .take(needed.max(if kind == "plane" { 2 } else { 0 }))
                .all(|size| is_size(*size) || of_plane(size))
        {
            return Err(geom.wrong("size", SIZES));
        }
        let size = |index: usize| sizes.get(index).copied().unwrap_or(sizes.first().copied().unwrap_or(0.0));
        Ok(match kind {
            "sphere" => LinkShape::Sphere { radius: size(0) },
            "capsule" => LinkShape::Capsule { radius: size(0), length: 2.0 * size(1) },
            "cylinder" => LinkShape::Cylinder { radius: size(0), length: 2.0 * size(1) },
            "ellipsoid" => LinkShape::Ellipsoid { radii: DVec3::new(size(0), size(1), size(2)) },
            "box" => LinkShape::Box { size: 2.0 * DVec3::new(size(0), size(1), size(2)) },
            _ => {
                let edge =
                    |index: usize| sizes.get(index).filter(|size| **size > 0.0).map_or(ENDLESS_M, |size| 2.0 * size);
                LinkShape::Plane { size: [edge(0), edge(1)] }
            }
        })
    }

    /// The pose of a geom; one `fromto` two points is in their middle, its z axis along them, and as long.
    fn between_points(&self, geom: Classed<'d, 'm>, shape: LinkShape) -> Result<(DAffine3, LinkShape)> {
        let Some(n) = geom.numbers::<6>("fromto")? else { return Ok((self.compiler.pose(geom)?, shape)) };
        let [from, to] = [DVec3::new(n[0], n[1], n[2]), DVec3::new(n[3], n[4], n[5])];
        let along = from - to;
        let distance = along.length();
        let Some(axis) = along.try_normalize().filter(|_| is_size(distance)) else {
            return Err(geom.wrong("fromto", "two points that are not the same"));
        };
        let shape = match shape {
            LinkShape::Capsule { radius, .. } => LinkShape::Capsule { radius, length: distance },
            LinkShape::Cylinder { radius, .. } => LinkShape::Cylinder { radius, length: distance },
            LinkShape::Box { size } => LinkShape::Box { size: DVec3::new(size.x, size.y, distance) },
            LinkShape::Ellipsoid { radii } => {
                LinkShape::Ellipsoid { radii: DVec3::new(radii.x, radii.y, distance / 2.0) }
            }
            _ => return Err(geom.wrong("fromto", "capsules, cylinders, boxes and ellipsoids between two points")),
        };
        let turned = DQuat::from_rotation_arc(DVec3::Z, axis);
        Ok((DAffine3::from_rotation_translation(turned, (from + to) / 2.0), shape))
    }
}
