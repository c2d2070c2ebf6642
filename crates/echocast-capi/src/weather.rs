//! Weather and water of the last scan, kept by a result.

use crate::guard::Outcome;
use echocast::Environment;

/// The environment of a result's last scan and its text.
#[derive(Default)]
pub(crate) struct ResultWeather {
    text: String,
    pub environment: Environment,
}

impl ResultWeather {
    /// Parses `text`, unless it is the one that was parsed last.
    pub fn read(&mut self, text: Option<&str>) -> Outcome {
        let text = text.unwrap_or_default();
        if text != self.text {
            self.environment =
                if text.trim().is_empty() { Environment::default() } else { Environment::from_yaml(text)? };
            text.clone_into(&mut self.text);
        }
        Ok(())
    }
}
