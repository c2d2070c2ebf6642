//! Pictures of a cloud: from above, in perspective or as range image, coloured by label, cause, intensity, range,
//! height or velocity, with a legend; and of a sonar's pings: waterfall, track and fan.

#[doc(inline)]
pub use pictures::{
    ColorBy, Picture, PreviewOptions, View, check, image_of, render, render_pings, write, write_pings, write_plan,
};
