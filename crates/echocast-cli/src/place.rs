//! The place of the sensor.

use anyhow::{Result, bail};
use clap::Args;
use echocast::{Environment, Pose, Scene, Trajectory};
use serde_json::{Value, json};

/// A fixed place for the sensor.
#[derive(Args)]
pub struct PlaceArgs {
    /// Position in the world (z up), metres
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_parser = three_numbers,
        allow_hyphen_values = true,
        conflicts_with = "camera",
        help_heading = "Place"
    )]
    at: Option<[f64; 3]>,
    /// Roll, pitch, yaw about the world's x, y, z, degrees; positive pitch looks down, positive yaw left
    #[arg(
        long,
        value_name = "R,P,Y",
        value_parser = three_numbers,
        allow_hyphen_values = true,
        requires = "at",
        help_heading = "Place"
    )]
    rpy: Option<[f64; 3]>,
    /// Camera node of the scene: sensor x = its view direction, z = its up [default: the only one]
    #[arg(long, value_name = "NODE", help_heading = "Place")]
    camera: Option<String>,
}

impl PlaceArgs {
    /// The requested place, or the path of the camera of that name, or of the scene's only one, from time `from` to
    /// `to`, s.
    pub fn path(&self, scene: &Scene, from: f64, to: f64) -> Result<Trajectory> {
        if let Some([x, y, z]) = self.at {
            let [roll, pitch, yaw] = self.rpy.unwrap_or_default();
            return Ok(Trajectory::fixed(Pose::at(x, y, z).with_rpy_deg(roll, pitch, yaw)));
        }
        let names = || scene.cameras.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>().join(", ");
        match (&self.camera, scene.cameras.as_slice()) {
            (None, [camera]) => Ok(scene.camera_path(&camera.name, from, to)?),
            (None, []) => bail!("the scene has no camera node: place the sensor with --at X,Y,Z"),
            (None, cameras) => bail!(
                "the scene has {} camera nodes ({}): choose one with --camera NODE, or a place with --at X,Y,Z",
                cameras.len(),
                names()
            ),
            (Some(name), []) => {
                bail!("--camera {name}: the scene has no camera node; a place can be given with --at X,Y,Z")
            }
            (Some(name), _) => match scene.camera(name) {
                Ok(camera) => Ok(scene.camera_path(&camera.name, from, to)?),
                Err(error) => bail!("--camera {name}: {error}; the scene has {}", names()),
            },
        }
    }
}

impl PlaceArgs {
    /// As the section `trajectory` of a scenario; `path` is that of the run.
    pub fn to_json(&self, path: &Trajectory) -> Value {
        match (self.at, &self.camera) {
            (None, Some(name)) => json!({ "camera": name }),
            // The only camera of the scene.
            (None, None) => Value::Null,
            (Some(_), _) => {
                let Pose { position, orientation } = path.at(0.0);
                json!({ "position_m": position.to_array(), "orientation_xyzw": orientation.to_array() })
            }
        }
    }
}

/// Checks that a sonar on `trajectory` is in the water at all `times`, s.
pub fn check_submerged(
    trajectory: &Trajectory,
    environment: &Environment,
    times: impl Iterator<Item = f64>,
) -> Result<()> {
    let surface = environment.water.as_ref().map_or(0.0, |water| water.surface_z_m);
    for time in times {
        let above = trajectory.at(time).position.z - surface;
        if above > 0.0 {
            let when = if time > 0.0 { format!("at {time:.3} s ") } else { String::new() };
            bail!(
                "{when}the sonar is {above:.3} m above the water, whose surface is at z = {surface} m: lower it with --at, \
                 --camera or --trajectory, or raise the surface with water.surface_z_m in the file of --env"
            );
        }
    }
    Ok(())
}

pub fn three_numbers(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|number: &f64| number.is_finite())).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or("expected three numbers, such as 1.5,-2,0.8".into())
}
