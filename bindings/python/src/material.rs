//! Materials of surfaces.

use crate::argument::{self, Argument, class, one_of, wrong_type};
use crate::error::{BindingError, BindingResult, no_pickle};
use crate::sensor::{SpecSource, named};
use echocast::scene::{Texture, TextureRef};
use numpy::ndarray::{ArrayView1, Dimension, Ix2, Ix3};
use numpy::{PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// What a surface is made of: how much light and sound it returns, how much of them passes.
///
/// `material`: the name of a library material, or keys as a dict or YAML text. `image`: height x width x 3 or 4, uint8,
/// sRGB, from the top row down, which multiplies the base colour where the mesh has texture coordinates; its fourth
/// channel is alpha. `alpha_image`: height x width, uint8, alpha instead of that of the image. `image_matrix`: 3 x 3,
/// from texture coordinates (u, v, 1), v up, to those of both images. `wrap`: beyond its edges the image is repeated
/// ("repeat"), mirrored ("mirrored_repeat") or continued with its edge ("clamp_to_edge"). `filter`: "linear" or "nearest". `blend`: True
/// lets light through by its alpha, unless it is glass: the key `alpha` as "coverage". ArgumentError
/// for unknown names, with the nearest ones, and for images without pixels or with more than 16384 a side; FormatError
/// for wrong keys.
///
/// One Material may be used by any number of meshes.
///
/// >>> paint = ec.Material({"name": "red paint", "base_color": [0.8, 0.1, 0.1], "roughness": 0.4})
/// >>> checker = np.array([[[255, 255, 255], [0, 0, 0]], [[0, 0, 0], [255, 255, 255]]], dtype=np.uint8)
/// >>> ec.Material({"name": "chess board"}, image=checker, filter="nearest")
/// <Material chess board>
#[pyclass(frozen, module = "echocast")]
pub struct Material(Arc<echocast::scene::Material>);

class! { Material, "a Material" }

/// Most pixels per row, and most rows.
const LONGEST_SIDE: usize = 16384;

/// An argument that is an image: height x width, then channels if it has any.
struct Pixels<'py, D: Dimension>(PyReadonlyArray<'py, u8, D>);

impl<'py, D: Dimension> Argument<'_, 'py> for Pixels<'py, D> {
    fn of(name: &str, value: &Bound<'py, PyAny>) -> BindingResult<Self> {
        let shape = if D::NDIM == Some(2) { "height x width" } else { "height x width x 3 or 4" };
        let array: PyReadonlyArray<'py, u8, D> =
            value.extract().map_err(|_| wrong_type(name, value, &format!("an array of uint8, {shape}")))?;
        let size = array.shape();
        let sides = size[..2].iter().all(|side| (1..=LONGEST_SIDE).contains(side));
        if !sides || size.len() == 3 && !(3..=4).contains(&size[2]) {
            let found = size.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ");
            return Err(BindingError::argument(name, found, format!("{shape}, each side 1 to {LONGEST_SIDE}")));
        }
        Ok(Pixels(array))
    }
}

impl Pixels<'_, Ix3> {
    fn texture(&self) -> Texture {
        let image = self.0.as_array();
        let pixel = |row: ArrayView1<'_, u8>| [row[0], row[1], row[2], row.get(3).copied().unwrap_or(255)];
        texture(image.dim().1, image.dim().0, image.rows().into_iter().map(pixel).collect())
    }
}

impl Pixels<'_, Ix2> {
    fn texture(&self) -> Texture {
        let image = self.0.as_array();
        texture(image.ncols(), image.nrows(), image.iter().map(|&alpha| [255, 255, 255, alpha]).collect())
    }
}

fn texture(width: usize, height: usize, pixels: Vec<[u8; 4]>) -> Texture {
    Texture::new(width as u32, height as u32, pixels)
}

#[pymethods]
impl Material {
    #[new]
    #[pyo3(signature = (material, *, image = None, alpha_image = None, image_matrix = None, wrap = "repeat", filter = "linear", blend = false))]
    fn new(
        #[pyo3(from_py_with = argument::material)] material: SpecSource<'_>,
        #[pyo3(from_py_with = argument::image)] image: Option<Pixels<'_, Ix3>>,
        #[pyo3(from_py_with = argument::alpha_image)] alpha_image: Option<Pixels<'_, Ix2>>,
        #[pyo3(from_py_with = argument::image_matrix)] image_matrix: Option<[[f64; 3]; 3]>,
        #[pyo3(from_py_with = argument::wrap)] wrap: &str,
        #[pyo3(from_py_with = argument::filter)] filter: &str,
        #[pyo3(from_py_with = argument::blend)] blend: bool,
    ) -> BindingResult<Material> {
        let mut made = Matter::of_source(&material)?.material()?.as_ref().clone();
        let (wrap, filter) = (named("wrap", wrap)?, named("filter", filter)?);
        // v points up, the rows of images count downwards.
        let [u, v, _] = image_matrix.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let transform = [u, [-v[0], -v[1], 1.0 - v[2]]].map(|row| row.map(|number| number as f32));
        let used = |texture| {
            TextureRef::plain(Arc::new(texture)).wrap_u(wrap).wrap_v(wrap).filter(filter).transform(transform)
        };
        made.base_color_texture = image.map(|image| used(image.texture()));
        made.alpha_texture = alpha_image.map(|image| used(image.texture()));
        if blend {
            made.blend();
        }
        Ok(Material(Arc::new(made)))
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle("a Material", "let each process make it from its keys and images")
    }

    fn __repr__(&self) -> String {
        format!("<Material {}>", self.0.name)
    }
}

/// A material, or what one can be made from.
pub enum MaterialLike<'py> {
    Made(Bound<'py, Material>),
    Source(SpecSource<'py>),
}

one_of! {
    MaterialLike<'py>: Made | Source;
    "a Material, the name of a material of the library, keys as a dict, or YAML text"
}

/// A material that an argument states: YAML, its name in the library, or one that was made before.
#[derive(Clone, PartialEq, Eq, Hash)]
pub enum Matter {
    Yaml(String),
    Name(String),
    Made(Same),
}

/// A material that equals only itself.
#[derive(Clone)]
pub struct Same(Arc<echocast::scene::Material>);

impl PartialEq for Same {
    fn eq(&self, other: &Same) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Same {}

impl Hash for Same {
    fn hash<H: Hasher>(&self, state: &mut H) {
        Arc::as_ptr(&self.0).hash(state);
    }
}

impl Matter {
    pub fn of(given: &MaterialLike<'_>) -> PyResult<Matter> {
        match given {
            MaterialLike::Made(made) => Ok(Matter::Made(Same(made.get().0.clone()))),
            MaterialLike::Source(source) => Matter::of_source(source),
        }
    }

    fn of_source(source: &SpecSource<'_>) -> PyResult<Matter> {
        let name = || Matter::Name(source.path().to_string_lossy().into_owned());
        Ok(source.yaml()?.map_or_else(name, Matter::Yaml))
    }

    pub fn material(&self) -> echocast::Result<Arc<echocast::scene::Material>> {
        Ok(match self {
            Matter::Yaml(text) => Arc::new(echocast::scene::Material::from_yaml(text)?),
            Matter::Name(name) => Arc::new(echocast::scene::Material::library(name)?),
            Matter::Made(made) => made.0.clone(),
        })
    }
}
