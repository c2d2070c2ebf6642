//! Clouds to files: one file per format, one table of formats.

#[doc(inline)]
pub use cloud::export::{
    AnnotationStyle, FORMATS, Format, FormatInfo, FramesFile, Growing, GrowingFile, ImageFolder, ImageLayer,
    ImageOptions, Instrument, PolarFolder, PolarStyle, RadarPoints, cancel_flag, check, check_boxes, check_image,
    check_images, check_pings, check_radar_frame, check_radar_points, check_room, format_for, image_label_paths,
    labels_path, remove_unfinished, write, write_boxes, write_with,
};
