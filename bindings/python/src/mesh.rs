//! Meshes given as arrays.

use crate::argument::{self, Argument, class, wrong_type};
use crate::array::{numbers, rows};
use crate::error::{BindingResult, no_pickle};
use crate::material::{MaterialLike, Matter};
use crate::sensor::options_text;
use echocast::scene::{self, CornerMesh, Part, PrimitiveShape};
use glam::DVec3;
use numpy::Element;
use numpy::ndarray::{Ix1, Ix2};
use pyo3::prelude::*;
use pyo3::types::{PySequence, PyString};
use std::sync::Arc;

/// Vertices as they are given, n x 3.
pub enum VertexArray {
    Single(Vec<[f32; 3]>),
    Double(Vec<DVec3>),
}

impl VertexArray {
    pub fn of(array: &Bound<'_, PyAny>) -> BindingResult<VertexArray> {
        if let Ok(single) = array.extract() {
            return Ok(VertexArray::Single(rows("vertices", &single)?));
        }
        let double = rows("vertices", &numbers::<f64, Ix2>("vertices", array, "n x 3")?)?;
        Ok(VertexArray::Double(double.into_iter().map(DVec3::from_array).collect()))
    }

    /// The point that the vertices in their mesh should be relative to: 0, 0, 0 for float32; for float64 `before`, the
    /// present one, unless they are so far from there that float32 would be too coarse: then a point among them.
    pub fn middle(&self, before: DVec3) -> DVec3 {
        /// Farther out, m, float32 is coarser than 0.06 mm.
        const FAR: f64 = 1024.0;
        let VertexArray::Double(places) = self else { return DVec3::ZERO };
        let low = places.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = places.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let far = (low - before).abs().max((high - before).abs()).max_element() > FAR;
        if low.is_finite() && high.is_finite() && far { (low + high) / 2.0 } else { before }
    }

    /// The vertices relative to `middle`.
    pub fn about(self, middle: DVec3) -> Vec<[f32; 3]> {
        match self {
            VertexArray::Single(places) => places,
            VertexArray::Double(places) => {
                places.into_iter().map(|place| (place - middle).as_vec3().to_array()).collect()
            }
        }
    }
}

/// A mesh of `triangles`, n x 3 indices of `positions`, m, with one material.
pub fn mesh(
    name: &str,
    positions: Vec<[f32; 3]>,
    triangles: &Bound<'_, PyAny>,
    material: Option<&Matter>,
) -> BindingResult<Arc<scene::Mesh>> {
    let triangles = table::<u32, 3>("triangles", triangles, "n x 3")?;
    let material = material.map(Matter::material).transpose()?;
    let part = Part::default().positions(positions.into()).triangles(triangles.into()).material(material);
    Ok(Arc::new(scene::Mesh::new(name, vec![part])?))
}

/// The rows of an argument that is an array of `shape`.
fn table<T: Element + Copy, const N: usize>(
    name: &str,
    value: &Bound<'_, PyAny>,
    shape: &str,
) -> BindingResult<Vec<[T; N]>> {
    rows(name, &numbers::<T, Ix2>(name, value, shape)?)
}

/// A mesh that objects may share: triangles, each of one of several materials.
///
/// `vertices`, n x 3, m; `triangles`, m x 3, indices of vertices; as for `LiveScene.add`. `materials`: a list of
/// materials, each as for `Scene.from_arrays`; `material_index`: m numbers, for each triangle the index of its material
/// in that list; None: all have the first. `uvs`: texture coordinates of the corners of the triangles, 3m x 2, v up;
/// used where the material has an image. `normals`: unit normals of the corners, 3m x 3, for shading; None: the
/// triangles are flat. ArgumentError for other shapes, numbers that are not finite, and indices out of range.
///
/// >>> square = np.array([[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2]], dtype=np.float32)
/// >>> door = ec.Mesh(square, [[0, 1, 2], [0, 2, 3]], materials=["wood", "steel"], material_index=[0, 1])
/// >>> live = ec.LiveScene()
/// >>> doors = [live.add_mesh(door, pose=(x, 0, 0), name=f"door {x}") for x in (4, 8)]
/// >>> door
/// <Mesh mesh: 2 triangles, 2 materials>
#[pyclass(frozen, module = "echocast")]
pub struct Mesh {
    pub mesh: Arc<scene::Mesh>,
    /// The point that its vertices are relative to.
    pub middle: DVec3,
    /// For each of its parts, the index of its material in the list.
    pub material_of: Vec<usize>,
    /// Length of that list, at least 1.
    pub materials: usize,
}

class! { Mesh, "a Mesh" }

/// The argument `materials`: a list.
struct MaterialList<'py>(Vec<MaterialLike<'py>>);

impl<'py> Argument<'_, 'py> for MaterialList<'py> {
    fn of(name: &str, value: &Bound<'py, PyAny>) -> BindingResult<Self> {
        let list = value.cast::<PySequence>().ok().filter(|_| !value.is_instance_of::<PyString>());
        let Some(list) = list else { return Err(wrong_type(name, value, "a list of materials")) };
        let items = list.try_iter()?.collect::<PyResult<Vec<_>>>()?;
        let item = |(index, item)| Argument::of(&format!("{name}[{index}]"), item);
        Ok(MaterialList(items.iter().enumerate().map(item).collect::<BindingResult<_>>()?))
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (vertices, triangles, *, name = "mesh", materials = None, material_index = None, uvs = None, normals = None))]
    fn new(
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = argument::name)] name: &str,
        #[pyo3(from_py_with = argument::materials)] materials: Option<MaterialList<'_>>,
        material_index: Option<&Bound<'_, PyAny>>,
        uvs: Option<&Bound<'_, PyAny>>,
        normals: Option<&Bound<'_, PyAny>>,
    ) -> BindingResult<Mesh> {
        let materials = materials.map_or(Vec::new(), |list| list.0);
        let made = |given| BindingResult::Ok(Matter::of(given)?.material()?);
        let index = |value| {
            let array = numbers::<u32, Ix1>("material_index", value, "one for each triangle:")?;
            BindingResult::Ok(array.as_array().to_vec())
        };
        let places = VertexArray::of(vertices)?;
        let middle = places.middle(DVec3::ZERO);
        let given = CornerMesh {
            positions: places.about(middle),
            triangles: table("triangles", triangles, "n x 3")?,
            materials: materials.iter().map(made).collect::<BindingResult<_>>()?,
            material_index: material_index.map(index).transpose()?,
            uvs: uvs.map(|value| table("uvs", value, "n x 2")).transpose()?,
            normals: normals.map(|value| table("normals", value, "n x 3")).transpose()?,
        };
        let materials = materials.len().max(1);
        let (mesh, material_of) = vertices.py().detach(|| given.mesh(name))?;
        Ok(Mesh { mesh: Arc::new(mesh), middle, material_of, materials })
    }

    /// A body given by a few numbers, about the origin: {"plane": {"size_m": [x, y]}}, {"box": {"size_m": [x, y, z]}},
    /// {"sphere": {"radius_m": r}}, {"ellipsoid": {"radii_m": [x, y, z]}}, and, about the z axis, {"capsule": {"radius_m": r,
    /// "length_m": l}}, "cylinder" and "cone" likewise; {"height_field": {"size_m": [x, y], "heights_m": rows}}, from least to
    /// greatest y; {"hull": {"points_m": points}}, a convex hull. Rays meet curved bodies exactly; their outlines are those of
    /// triangles within `tolerance_m` of them, 1e-6 to 1. `material`: as for `Scene.from_arrays`. ArgumentError and FormatError
    /// for other shapes and numbers.
    ///
    /// >>> ball = ec.Mesh.primitive({"sphere": {"radius_m": 0.5}}, material="steel")
    /// >>> live = ec.LiveScene()
    /// >>> _ = live.add_mesh(ball, pose=(4, 0, 0))
    /// >>> scan = live.scan("velodyne_vlp16", profile="ideal")
    /// >>> round(float(scan.range.min()), 4)
    /// 3.5
    #[staticmethod]
    #[pyo3(signature = (shape, *, tolerance_m = 1e-3, name = None, material = None))]
    fn primitive(
        py: Python<'_>,
        shape: &Bound<'_, PyAny>,
        tolerance_m: f64,
        name: Option<&str>,
        #[pyo3(from_py_with = argument::material)] material: Option<MaterialLike<'_>>,
    ) -> BindingResult<Mesh> {
        let text = options_text(shape)?;
        let material = material.as_ref().map(|given| BindingResult::Ok(Matter::of(given)?.material()?)).transpose()?;
        let made = || {
            let shape = PrimitiveShape::from_yaml(&text)?;
            let mut mesh = shape.mesh(name.unwrap_or(shape.name()), tolerance_m)?;
            mesh.parts.iter_mut().for_each(|part| part.material.clone_from(&material));
            Ok::<scene::Mesh, echocast::Error>(mesh)
        };
        let mesh = py.detach(made)?;
        Ok(Mesh { mesh: Arc::new(mesh), middle: DVec3::ZERO, material_of: vec![0], materials: 1 })
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.mesh.name
    }

    /// Number of triangles.
    #[getter]
    fn triangles(&self) -> usize {
        self.mesh.triangle_count()
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("a Mesh", "let each process make it from its arrays")
    }

    fn __repr__(&self) -> String {
        let (triangles, materials) = (self.triangles(), self.material_of.len());
        format!(
            "<Mesh {}: {triangles} triangles, {materials} material{}>",
            self.mesh.name,
            if materials == 1 { "" } else { "s" }
        )
    }
}
