//! Images of what sensors report: of sonar pings the waterfall, mosaic, fan and depth map, each with its labels; of
//! radars range by Doppler and polar images; of cameras and other optical sensors whose beams form rows the [`RangeImage`], and what it shows of each instance.
//!
//! Images of pings are made only from what a sonar reports, as its own software would make them: the scene is not used.
//! Levels are drawn with the sonar's time-varied gain. The pings are not changed.

#[doc(inline)]
pub use cloud::image::{
    Annotation, Image, ImageKind, ImageRange, LAYERS, LabelLayer, Layer, Layers, Overlap, Place, RangeImage, Runs,
    altitudes, annotations, depth_map, fan, masks, mosaic, polar, polar_fan, range_doppler, runs_text, turning_fan,
    waterfall,
};
