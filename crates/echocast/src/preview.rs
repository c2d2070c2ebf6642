//! Pictures of a cloud: from above, in perspective or as range image, coloured by label, cause, intensity, range,
//! height or velocity, with a legend; of a sonar's pings: waterfall, track and fan; and of the images of a radar.

#[doc(inline)]
pub use pictures::{
    ColorBy, Picture, PreviewOptions, View, check, image_of, image_of_frame, render, render_pings, render_radar, write,
    write_frame, write_pings, write_plan, write_radar, write_survey,
};
