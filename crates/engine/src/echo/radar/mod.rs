//! Echoes of radar waves: what surfaces return along which paths.

mod centres;
mod clutter;
mod echoes;
mod facets;
mod surfaces;
mod wave;

pub(crate) use centres::{CentreGrid, CentreMemory};
pub(crate) use clutter::{ClutterGrid, ClutterMemory, scatter_from_rough};
pub(crate) use echoes::{RadarEcho, RadarEchoes, RadarRoute};
pub(crate) use facets::{FacetMemory, scatter_from_facets};
pub(crate) use surfaces::RadarSurfaces;
pub(crate) use wave::WaveField;
