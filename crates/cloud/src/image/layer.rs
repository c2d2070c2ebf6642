//! The quantities that an image of a scan holds.

use super::pixels::has_every_beam;
use crate::{Field, PointCloud};
use emitter::ImageGrid;
use ground::error::Result;
use ground::named;
use ground::named::by_name;

/// A quantity that an image holds for each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Layer {
    /// Measured distance along the axis of a camera, for other sensors the slant range, m; NaN where there is no
    /// return.
    Depth,
    /// Measured slant range, m; NaN where there is no return.
    Range,
    /// Semantic class; 0 = unlabelled, or no return.
    Category,
    /// Part of the object; 0 = unlabelled, or no return.
    Part,
    /// Object; 0 = unlabelled, or no return.
    Instance,
    /// Base colour of the surface, sRGB: red, green, blue; black where there is no return.
    Color,
    /// What the instrument reports; NaN where there is no return.
    Intensity,
    /// Unit normal of the surface: right, up and back ([`super::RangeImage::normal`]); NaN where there is no return.
    Normal,
}

named! {
    Layer:
        Depth "depth", Range "range", Category "category", Part "part", Instance "instance", Color "color",
        Intensity "intensity", Normal "normal",
}

impl Layer {
    /// The layer called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`](ground::error::Error::Missing), which lists all of them.
    pub fn from_name(name: &str) -> Result<Layer> {
        by_name("image layer", name)
    }

    /// The layer that it stands for in images like `grid`.
    pub(super) fn of(self, grid: &ImageGrid) -> Layer {
        if self == Layer::Depth && grid.intrinsics.is_none() { Layer::Range } else { self }
    }

    /// The columns that it shows.
    pub(super) fn fields(self) -> &'static [Field] {
        match self {
            Layer::Depth => &[Field::Depth],
            Layer::Range => &[Field::Range],
            Layer::Category => &[Field::CategoryId],
            Layer::Part => &[Field::PartId],
            Layer::Instance => &[Field::InstanceId],
            Layer::Color => &[Field::Red, Field::Green, Field::Blue],
            Layer::Intensity => &[Field::Intensity],
            Layer::Normal => &[Field::NormalX, Field::NormalY, Field::NormalZ],
        }
    }

    /// The columns that it is made from and that `cloud` lacks.
    pub(super) fn missing(self, cloud: &PointCloud, grid: &ImageGrid) -> Vec<&'static str> {
        let places: &[Field] = if has_every_beam(cloud, grid) { &[] } else { &[Field::Beam, Field::Range] };
        let has = |field: Field| cloud.fields.contains(field) && cloud.column(field).len() == cloud.len;
        let more = self.of(grid).fields().iter().filter(|field| !places.contains(field));
        places.iter().chain(more).filter(|field| !has(**field)).map(|field| field.info().name).collect()
    }
}
