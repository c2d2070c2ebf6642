//! What is between sensor and scene, as a result remembers it.

use crate::guard::Outcome;
use echocast::Environment;

/// The environment of a result's last scan and its text.
#[derive(Default)]
pub(crate) struct Weather {
    text: String,
    pub environment: Environment,
}

impl Weather {
    /// Reads `text`, unless it is the one that was read last.
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
