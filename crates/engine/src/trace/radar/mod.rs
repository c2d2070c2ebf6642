//! What a radar sees: the facets of surfaces at one moment, the planes that mirror it, and lines of sight that these fold.

mod facets;
mod images;
mod planes;
mod search;
mod sightlines;

pub(crate) use facets::{RadarRow, RowFacets};
pub(crate) use images::{MOST_MIRRORS, Mirror, MirrorChain};
pub use planes::PartPlanes;
pub(crate) use search::{ImageTarget, Search, SearchLimits};
pub(crate) use sightlines::{SightMemory, Sighted, Sightlines};
