//! Sensors for tests of this crate, which knows none.

use crate::cells::SonarView;
use crate::export::Instrument;
use emitter::{BeamTable, ImageGrid, Pattern};
use ground::error::Result;

/// A sensor of which there is only the pattern.
pub struct TestSensor {
    pattern: Pattern,
    beams: BeamTable,
}

impl TestSensor {
    /// With the pattern in YAML.
    pub fn new(pattern: &str) -> TestSensor {
        let pattern = Pattern::from_yaml(pattern).unwrap();
        TestSensor { beams: pattern.beams(0.0).unwrap(), pattern }
    }

    /// A camera of 4 x 3 pixels.
    pub fn camera() -> TestSensor {
        TestSensor::new("{type: pinhole, resolution: [4, 3], fov_deg: [90, 60]}")
    }

    pub fn beams(&self) -> &BeamTable {
        &self.beams
    }
}

impl Instrument for TestSensor {
    fn name(&self) -> &str {
        "eye"
    }

    fn image_grid(&self) -> Result<ImageGrid> {
        ImageGrid::of("eye", &self.pattern, &self.beams)
    }

    fn sonar_view(&self) -> SonarView {
        SonarView::of(&self.pattern)
    }
}
