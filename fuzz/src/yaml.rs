//! Sensor files, weather and water: any text is read or refused, and what is read is sound and can be written and read
//! again. Sonars ping, and water is pinged in, with few rays and bins.

use echocast::emitter::pattern::Pattern;
use echocast::generate::Seabed;
use echocast::{
    BuiltScene, Engine, Environment, FieldSet, LoadOptions, Pose, ScanOptions, Scene, Sensor, SensorKind, Trajectory,
};
use std::sync::LazyLock;

/// A bed of 18 triangles with a boulder, 4 m deep, for one thread.
static LAKE: LazyLock<BuiltScene> = LazyLock::new(|| {
    let bed = Seabed::default().size_m([9.0; 2]).depth_m(4.0).cell_m(3.0).boulders(1).wrecks(0).fish(0);
    let lake = bed.scene(1).expect("the bed can be made");
    let scene = Scene::from_glb_bytes(lake.bytes(), &LoadOptions::default()).expect("it can be read");
    scene.build_with(&Engine::with_threads(1).expect("Embree starts")).expect("it can be built")
});

static SONAR: LazyLock<Sensor> = LazyLock::new(|| Sensor::preset("fls_900").and_then(small).expect("a small sonar"));

/// What stays of a sonar when its rays, beams and bins are few; an error where its other keys do not go with that.
fn small(mut sonar: Sensor) -> echocast::Result<Sensor> {
    let pattern = sonar.spec().pattern.clone();
    match &pattern {
        Pattern::Sidescan(sides) if sides.step_deg.is_some() => sonar.set("pattern.step_deg", "10")?,
        _ => sonar.set("pattern.rays", "8")?,
    }
    if matches!(pattern, Pattern::Multibeam(_) | Pattern::Imaging(_)) {
        sonar.set("pattern.beams", "3")?;
    }
    for (key, value) in [("pattern.rate_hz", "10"), ("range", "{max_m: 8}"), ("acoustics.bin_m", "0.5")] {
        sonar.set(key, value)?;
    }
    Ok(sonar)
}

/// A ping and its points; water, range and place may not go together, but nothing else fails.
fn ping(sonar: &Sensor, environment: Environment) {
    let surface = environment.water.as_ref().map_or(0.0, |water| water.surface_z_m);
    // The bed stays where it is: above, below and within it are sonars too.
    let way = Trajectory::fixed(Pose::at(0.0, 0.0, surface - 2.0));
    let options = ScanOptions::default().environment(environment).fields(FieldSet::all());
    if let Ok(ping) = LAKE.ping(sonar, &way, &options) {
        let cells = ping.layout().cells();
        assert!(
            ping.cells().intensity().len() == cells && !ping.cells().intensity().iter().any(|level| level.is_nan())
        );
        let cloud = ping.cloud(&options).expect("all columns are there");
        assert!(cloud.columns().range().iter().all(|range| (0.0..=8.5).contains(range)));
    }
}

/// Runs it with one input.
pub fn run(text: &str) {
    if let Ok(environment) = Environment::from_yaml(text) {
        let written = environment.to_yaml().expect("weather can be written");
        let again = Environment::from_yaml(&written).expect("what was written can be read");
        assert_eq!(again, environment);
        if environment.water.is_some() {
            ping(&SONAR, environment);
        }
    }
    // The text may name a table; there is none to find here.
    if let Ok(mut sensor) = Sensor::from_yaml(text, "/nowhere") {
        sensor.beams().check().expect("beams of an accepted file are sound");
        let written = sensor.to_yaml().expect("a sensor can be written");
        let again = Sensor::from_yaml(&written, "/nowhere").expect("what was written can be read");
        assert_eq!(again.spec(), sensor.spec());
        if sensor.kind() == SensorKind::Sonar
            && let Ok(sonar) = small(sensor.clone())
        {
            ping(&sonar, Environment::default());
        }
        // The last line as a setting.
        if let Some((key, value)) = text.lines().next_back().and_then(|line| line.split_once('=')) {
            let _ = sensor.parameter(key);
            let _ = sensor.set(key, value);
        }
    }
}
