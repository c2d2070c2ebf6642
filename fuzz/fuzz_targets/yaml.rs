//! Sensor files and weather: any text is read or refused, and what is read is sound and can be written and read again.
#![no_main]

use echocast::{Environment, Sensor};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(environment) = Environment::from_yaml(text) {
        let written = environment.to_yaml().expect("weather can be written");
        let again = Environment::from_yaml(&written).expect("what was written can be read");
        assert_eq!(again, environment);
    }
    // The text may name a table; there is none to find here.
    if let Ok(mut sensor) = Sensor::from_yaml(text, "/nowhere") {
        sensor.beams().check().expect("beams of an accepted file are sound");
        let written = sensor.to_yaml().expect("a sensor can be written");
        let again = Sensor::from_yaml(&written, "/nowhere").expect("what was written can be read");
        assert_eq!(again.spec(), sensor.spec());
        // The last line as a setting.
        if let Some((key, value)) = text.lines().next_back().and_then(|line| line.split_once('=')) {
            let _ = sensor.parameter(key);
            let _ = sensor.set(key, value);
        }
    }
});
