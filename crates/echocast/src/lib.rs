//! echocast simulates depth sensors: it casts the beams of LiDARs, depth cameras and sonars over a 3D
//! scene through Embree and returns what the instrument would have reported, every point labelled.
//!
//! ```no_run
//! use echocast::{Pose, ScanOptions, Scene, Sensor, Trajectory};
//!
//! let scene = Scene::load("street.glb")?.build()?;
//! let sensor = Sensor::preset("velodyne_vlp32c")?;
//! let pose = Pose::at(0.0, 0.0, 1.8);
//! let cloud = scene.scan(&sensor, &Trajectory::fixed(pose), &ScanOptions::default().seed(7))?;
//! cloud.write("street.las")?;
//! # Ok::<(), echocast::Error>(())
//! ```
//!
//! In a loop a [`LiveScene`] changes while what it was is scanned, into the memory of the scan before:
//!
//! ```no_run
//! # use echocast::{Engine, LiveScene, PointCloud, ScanOptions, Scene, Sensor, Trajectory};
//! # let (sensor, drive) = (Sensor::preset("velodyne_vlp16")?, Trajectory::load("drive.csv")?);
//! let mut scene = LiveScene::new(&Engine::new()?);
//! scene.add_scene(&Scene::load("street.glb")?)?;
//! let car = scene.find("Car")?;
//! let mut cloud = PointCloud::default();
//! for frame in 0..100 {
//!     scene.set_pose(car, glam::DAffine3::from_translation(glam::DVec3::X * f64::from(frame)))?;
//!     let options = ScanOptions { frame, start_time: f64::from(frame) * 0.1, ..ScanOptions::default() };
//!     scene.commit()?.scan_into(&sensor, &drive, &options, &mut cloud)?;
//! }
//! # Ok::<(), echocast::Error>(())
//! ```
//!
//! A sonar pings. [`BuiltScene::scan`] gives the points of a ping as of any sensor; [`BuiltScene::ping`] the whole of
//! it, a level and labels for every range bin, of which [`image`] makes what the software of a sonar shows:
//!
//! ```no_run
//! use echocast::{Environment, Field, Pings, ScanOptions, Scene, Sensor, Trajectory, image};
//!
//! let lake = Scene::load("lake.glb")?.build()?;
//! let sonar = Sensor::preset("sss_450")?;
//! let survey = Trajectory::load("survey.csv")?;
//! let environment = Environment::from_yaml("water: {temperature_c: 12, salinity_psu: 0.3, sound_speed: medwin}")?;
//! let mut pings = Pings::default();
//! for frame in 0..200 {
//!     let start_time = f64::from(frame) * sonar.beams().period;
//!     let fields = [Field::CategoryId].into_iter().collect();
//!     let options = ScanOptions { frame, start_time, fields, environment: environment.clone(), ..ScanOptions::default() };
//!     pings.push(lake.ping(&sonar, &survey, &options)?)?;
//! }
//! pings.write("survey.npz")?;
//! image::waterfall(&pings, image::ImageRange::Slant, None)?.write("survey.png")?;
//! # Ok::<(), echocast::Error>(())
//! ```
//!
//! # The path of a scan
//!
//! | step | room | what comes out |
//! |---|---|---|
//! | make | [`generate`] | a lake bed as a file, if there is no scene at hand |
//! | read, resolve | [`scene`] | [`Scene`]: z up, metres, labels and materials attached |
//! | build | `trace` | [`BuiltScene`]: Embree's structure and what its ids mean, shared by threads; a [`LiveScene`] makes one after the other |
//! | aim | [`emitter`] | the beams of a [`Sensor`], each at the pose of its own time |
//! | trace | `trace` | range, normal, surface of every beam |
//! | interact | [`echo`], with [`material`] and [`medium`] | reflectance, incidence, intensity; of sonars a [`Ping`], levels in range bins |
//! | detect | [`detect`] | which echoes are seen, and at which measured range |
//! | collect | [`cloud`] | [`PointCloud`]: a column each, truth beside measurement; [`Pings`] of a sonar |
//! | draw | [`image`] | of [`Pings`]: waterfall, mosaic, fan, depth map |
//! | write | [`export`], [`preview`] | a file and a [`Report`] of what it could not hold; a picture for people |
//!
//! # The path of a ping
//!
//! | step | room | what comes out |
//! |---|---|---|
//! | stretch | [`medium`] | the water as layers in which sound speed, absorption and density are known |
//! | send | [`emitter`] | the rays that stand for what a transducer sends, and how loud each of its beams hears them |
//! | trace | `trace` | arrivals: where rays that bend and are reflected meet the bed, things in the water, its surface |
//! | answer | [`echo`] | of each arrival its energy, divided among range bins, with the phase of its scatterers |
//! | listen | [`echo`] | of each beam the sum over bins, its pulse's response, noise: levels in dB |
//! | sound out | [`detect`] | the depth that each beam reports |
//!
//! # Floors
//!
//! Rooms import from rooms below them in this list and from no other; a test holds them to it.
//!
//! | room | what is in it |
//! |---|---|
//! | `generate` | scenes made up: a lake bed |
//! | `preview` | pictures of clouds and pings, for people |
//! | `export` | files of clouds, pings and images |
//! | `image` | of pings: waterfall, mosaic, fan, depth map |
//! | `scan` | the driver: a scan of light, a ping, the profiles of the paper |
//! | `sensor` | sensor files, presets, what they make of the rooms below |
//! | `echo` | what comes back: contributions, paths, weather, signals; levels of sound |
//! | `detect` | which echoes are seen, with which errors |
//! | `cloud` | columns of points, pings |
//! | `trace` | rays to hits: Embree, and what its ids mean |
//! | `scene` | objects, meshes and labels, read from files |
//! | `material` | what surfaces do with light and sound |
//! | `medium` | air and water |
//! | `emitter` | beams, trajectories, lobes |
//! | `read` | files, YAML and tables, with errors that name the place |
//! | `ground` | errors, units, poses, blocks of rays, random numbers, threads |
//!
//! # Conventions
//!
//! Lengths are metres, angles radians, times seconds; a name with another unit says so (`fov_deg`).
//! Frames are right-handed, z up; sensors look along x, y is left. Azimuth counts counter-clockwise
//! from x, elevation up from the xy plane. `range` is the slant range, `depth` the distance along x.
//!
//! # Words
//!
//! | word | what it means here |
//! |---|---|
//! | beam | what one emitter or transducer sends in one firing; it has a divergence |
//! | ray | a line handed to Embree; several stand for one beam |
//! | firing | one emission: a pulse, an exposure, a ping |
//! | hit | a ray meets a triangle: geometry alone |
//! | echo | a bump of energy in what is received |
//! | return | an echo that the instrument reports |
//! | reflectance | a property of the surface, at the wavelength |
//! | effective reflectance, `rho_eff` | that of a Lambert surface, met head-on, that would send back as much |
//! | intensity | what the instrument reports, in its own scale |
//! | extinction, backscatter | 1/m, and 1/(m sr), of what is in the air |
//! | lane, block, chunk | one of 256 beams side by side; these 256; 2048 beams, the work of one task |
//! | row | of a cloud: a return; of the table of surfaces: a part of an object |
//! | kernel | a loop over the lanes of a block, compiled for every vector level (the crate `echocast-kernels`) |
//!
//! # Promises
//!
//! * Same binary, same machine, same inputs and seed: the same bits, for any number of threads and any vector level.
//! * A random number is a function of its address: the key is the seed, the counter is beam, frame, number of the return
//!   or sub-ray, and purpose. A new noise has a purpose of its own and does not move the draws of the others.
//! * Nothing panics, prints or hangs on input; errors name what was found and what is allowed.
#![forbid(unsafe_code)]

pub mod cloud;
pub mod detect;
pub mod echo;
pub mod emitter;
pub mod export;
#[cfg(test)]
mod floors;
pub mod generate;
mod ground;
pub mod image;
pub mod material;
pub mod medium;
pub mod preview;
pub mod read;
mod scan;
pub mod scene;
mod sensor;
mod trace;

pub use cloud::{
    CELL_FIELDS, Field, FieldSet, Frame, Layout, PackItem, PackType, Ping, Pings, PointCloud, SonarView, Sounding,
};
pub use detect::ReturnMode;
pub use echo::Taper;
pub use emitter::Trajectory;
pub use ground::cause::Cause;
pub use ground::error::{Error, Result};
pub use ground::named::Named;
pub use ground::pose::Pose;
pub use ground::report::Report;
pub use ground::{error, report, shown, units};
pub use material::ReflectanceSource;
pub use medium::Environment;
pub use read::bounds::Parameter;
pub use scan::{Order, Profile, Progress, ScanOptions};
pub use scene::{LabelRules, LoadOptions, Scene};
pub use sensor::{
    AcousticsSpec, BeamSpec, Expectations, Illumination, IntensitySpec, PresetInfo, RangeSpec, ReturnsSpec, Sensor,
    SensorKind, SensorSpec, ShotNoiseSpec, Speckle, Target, TofSpec, Tvg, Vignetting,
};
pub use trace::{BareLoop, BuiltScene, Engine, LiveScene, ObjectId};
