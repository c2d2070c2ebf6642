//! Presets that sections measure.

use crate::Result;
use echocast::Sensor;

/// Those that show most of what all of them do: an elliptic beam, many beams, a prism.
const FEW: [&str; 3] = ["velodyne_vlp32c", "ouster_os1_128", "livox_mid40"];

/// A preset whose beams are one ray each, for comparisons with the bare loop over as many rays.
pub fn of_one_ray(preset: &str) -> Result<Sensor> {
    let mut sensor = Sensor::preset(preset)?;
    sensor.set("beam.sub_rays", "1")?;
    Ok(sensor)
}

/// LiDARs: those of `ECHOCAST_BENCH_SENSORS=a,b`, all if `ECHOCAST_BENCH_ALL` is set, otherwise a few.
pub fn lidars() -> Result<Vec<Sensor>> {
    let names = match listed("ECHOCAST_BENCH_SENSORS") {
        Some(names) => names,
        None if std::env::var_os("ECHOCAST_BENCH_ALL").is_some() => {
            let presets = Sensor::presets().into_iter().filter(|preset| preset.folder == "lidar");
            presets.map(|preset| preset.name).collect()
        }
        None => FEW.map(str::to_owned).into(),
    };
    names.iter().map(|name| Ok(Sensor::preset(name)?)).collect()
}

/// The names in an environment variable, between commas; `None`: it is not set.
pub fn listed(variable: &str) -> Option<Vec<String>> {
    let list = std::env::var(variable).ok()?;
    Some(list.split(',').map(|name| name.trim().to_owned()).collect())
}
