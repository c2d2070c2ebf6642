//! Options with a few named values.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use echocast::preview::{ColorBy, View};
use echocast::scene::UpAxis;
use echocast::{Frame, Order, Profile, ReflectanceSource, ReturnMode};

/// Names and what they stand for.
pub type Choices<T> = &'static [(&'static str, T)];

pub const UP: Choices<UpAxis> = &[("y", UpAxis::Y), ("z", UpAxis::Z)];
pub const PROFILE: Choices<Profile> =
    &[("physical", Profile::Physical), ("paper", Profile::Paper), ("blainder", Profile::Blainder)];
pub const REFLECTANCE_SOURCE: Choices<ReflectanceSource> =
    &[("luminance", ReflectanceSource::Luminance), ("alpha", ReflectanceSource::Alpha)];
pub const RETURNS: Choices<ReturnMode> = &[
    ("strongest", ReturnMode::Strongest),
    ("first", ReturnMode::First),
    ("last", ReturnMode::Last),
    ("second", ReturnMode::Second),
    ("dual", ReturnMode::Dual),
    ("all", ReturnMode::All),
];
pub const FRAME: Choices<Frame> = &[("world", Frame::World), ("sensor", Frame::Sensor)];
pub const ORDER: Choices<Order> = &[("beam", Order::Beam), ("time", Order::Time)];
pub const VIEW: Choices<View> = &[
    ("top", View::Top),
    ("perspective", View::Perspective),
    ("range", View::Range),
    ("waterfall", View::Waterfall),
    ("track", View::Track),
    ("fan", View::Fan),
];
pub const COLOR: Choices<ColorBy> = &[
    ("label", ColorBy::Label),
    ("cause", ColorBy::Cause),
    ("intensity", ColorBy::Intensity),
    ("range", ColorBy::Range),
    ("height", ColorBy::Height),
];

/// Takes one of the names of `choices`.
pub fn of<T: Copy + Send + Sync>(choices: Choices<T>) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(choices.iter().map(|(name, _)| *name)).map(|given| {
        let (_, value) = choices.iter().find(|(name, _)| *name == given).expect("the parser lets no other through");
        *value
    })
}

/// Name of `value`.
pub fn name<T: PartialEq>(choices: Choices<T>, value: T) -> &'static str {
    choices.iter().find(|(_, known)| *known == value).map_or("", |(name, _)| name)
}
