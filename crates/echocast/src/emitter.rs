//! What is emitted, when and from where.

#[doc(inline)]
pub use emitter::trajectory::{Accuracy, Geographic, Georeference, TrajectoryOptions};
#[doc(inline)]
pub use emitter::{
    AttitudeError, BeamTable, FiringOrder, ImageGrid, Imu, ImuModel, ImuSample, InertialNoise, Intrinsics, Navigation,
    NavigationSolution, OdometrySample, PositionError, RayColumns, STANDARD_GRAVITY,
};
#[doc(inline)]
pub use ground::crs::{Crs, GridPoint, TransverseMercator};

/// Beam patterns: the response of a sonar aperture in directions off its axis, in one plane.
///
/// Amplitudes are signed and 1 on the axis; powers are their squares (one way). An aperture of two planes, such as a
/// rectangular face, has the product of two patterns, each at the direction cosine along its own edge.
pub mod lobe {
    #[doc(inline)]
    pub use emitter::lobe::{
        Array, BeamPattern, Line, Lobe, Piston, Row, Shading, Shape, directivity, equivalent_width, line_directivity,
        piston_directivity, rectangle_directivity,
    };
}

/// Scan patterns: where each beam points and when it fires.
pub mod pattern {
    #[doc(inline)]
    pub use emitter::pattern::{
        Channels, ConeMirror, Direction, Face, Fan, FibreLine, Flat, Imaging, JANUS_BEAMS, Janus, LinePlane, LineScan,
        LineSettings, LineSweep, Multibeam, OscillatingMirror, PalmerMirror, Pattern, Pinhole, Prism, RadarRotor,
        RadarView, Raster, Rays, Risley, RotatingMirror, Sides, Sidescan, SingleBeam, Spacing, Spinning,
        SpinningAzimuth, SwingLaw, Table, TurningHead, WideAxis,
    };
}
