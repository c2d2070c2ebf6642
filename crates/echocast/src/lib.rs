//! echocast simulates depth sensors: it casts the beams of LiDARs, depth cameras, sonars and radars into a 3D
//! scene with Embree and returns what the instrument would have reported, every point labelled.
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
//! In a loop, a [`LiveScene`] is edited while its last snapshot is scanned; each scan reuses the memory of the one
//! before:
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
//!     let options = ScanOptions::default().frame(frame).start_time(f64::from(frame) * 0.1);
//!     scene.commit()?.scan_into(&sensor, &drive, &options, &mut cloud)?;
//! }
//! # Ok::<(), echocast::Error>(())
//! ```
//!
//! A sonar sends pings. [`BuiltScene::scan`] gives the points of a ping, as for any sensor; [`BuiltScene::ping`] gives
//! the whole ping, a level and labels for every range bin, from which [`image`] renders what sonar software displays:
//!
//! ```no_run
//! use echocast::{Environment, Field, Pings, ScanOptions, Scene, Sensor, Trajectory, image};
//!
//! let lake = Scene::load("lake.glb")?.build()?;
//! let sonar = Sensor::preset("sss_450")?;
//! let survey = Trajectory::load("survey.csv")?;
//! let environment = Environment::from_yaml("water: {temperature_c: 12, salinity_psu: 0.3, sound_speed: medwin}")?;
//! let fields = [Field::CategoryId].into_iter().collect();
//! let options = ScanOptions::default().fields(fields).environment(environment);
//! let mut pings = Pings::default();
//! for frame in 0..200 {
//!     let start_time = f64::from(frame) * sonar.beams().period;
//!     let options = options.clone().frame(frame).start_time(start_time);
//!     pings.push(lake.ping(&sonar, &survey, &options)?)?;
//! }
//! pings.write("survey.npz")?;
//! image::waterfall(&pings, image::ImageRange::Slant, None)?.write("survey.png")?;
//! # Ok::<(), echocast::Error>(())
//! ```
//!
//! A scan with a radar gives its detections; [`BuiltScene::radar_frame`] gives what it records besides: the cube, the
//! samples of its converters, or the polar image of a rotating one.
//!
//! ```no_run
//! use echocast::preview::{self, PreviewOptions, View};
//! use echocast::radar::RadarRecord;
//! use echocast::{PointCloud, Pose, ScanOptions, Scene, Sensor, Trajectory};
//!
//! let street = Scene::load("street.glb")?.build()?;
//! let radar = Sensor::preset("ti_awr1843")?;
//! let (place, options) = (Trajectory::fixed(Pose::at(0.0, 0.0, 0.5)), ScanOptions::default().seed(7));
//! let record = RadarRecord { cube: true, samples: true };
//! let mut detections = PointCloud::default();
//! let frame = street.radar_frame(&radar, &place, &options, record, &mut detections)?;
//! frame.write("frame.npz")?;
//! let doppler = PreviewOptions::default().view(View::RangeDoppler);
//! preview::write_frame(&frame, "doppler.png".as_ref(), &doppler)?;
//! # Ok::<(), echocast::Error>(())
//! ```
//!
//! # The path of a scan
//!
//! | step | module | result |
//! |---|---|---|
//! | make | [`generate`] | a lake bed, a street, a town, rooms or a landscape as a file, if you have no scene |
//! | read, resolve | [`scene`] | [`Scene`]: z up, metres, labels and materials attached |
//! | build | `trace` | [`BuiltScene`]: Embree's structure and what its ids mean, shared by threads; a [`LiveScene`] makes one after another |
//! | aim | [`emitter`] | the beams of a [`Sensor`], each at the pose of its emission time |
//! | trace | `trace` | range, normal and surface for every beam |
//! | interact | [`echo`], with [`material`] and [`medium`] | reflectance, incidence, intensity; for sonars a [`Ping`]: levels in range bins |
//! | detect | [`detect`] | which echoes are detected, and at what measured range |
//! | collect | [`cloud`] | [`PointCloud`]: one column per quantity, ground truth alongside measurements; [`Pings`] for a sonar |
//! | draw | [`image`] | from [`Pings`]: waterfall, mosaic, fan, depth map; from a [`PointCloud`]: what a camera saw, pixel by pixel |
//! | write | [`export`], [`preview`] | a file and a [`Report`] of what it could not hold; a picture for viewing |
//! | read back | [`import`] | the [`PointCloud`] of such a file, or of another program's |
//!
//! # The path of a ping
//!
//! | step | module | result |
//! |---|---|---|
//! | layer | [`medium`] | the water as layers in which sound speed, absorption and density are known |
//! | transmit | [`emitter`] | the rays that sample the sound a transducer transmits, and the response of each of its beams to them |
//! | trace | `trace` | arrivals: where rays, refracted and reflected, meet the bed, objects in the water and its surface |
//! | scatter | [`echo`] | for each arrival its energy, divided among range bins, with the phase of its scatterers |
//! | receive | [`echo`] | for each beam the sum over bins, the response to its pulse, and noise: levels in dB |
//! | report | [`detect`] | the sounding of each beam; for a Doppler velocity log its velocity |
//!
//! # Floors
//!
//! The library is eleven crates behind this one, which only names what users need. A module imports only from modules
//! below it in this list, and within a module no files import each other in a circle; Cargo and tests enforce both.
//! Light and sound flow upwards, from `emitter` by `trace`, `echo` and `detect` to the clouds and pings that `scan`
//! fills. Folders have no numbers that would list them in this order: paths in code are read far more often than the
//! list of folders.
//!
//! | crate | module | contents |
//! |---|---|---|
//! | `sets` | `scenario` | scenes, rigs and what varies, from one file; samples, sets |
//! | `worlds` | `generate` | generated scenes: a lake bed, streets, rooms, a landscape |
//! | `pictures` | `preview` | pictures of clouds, pings and images of radars, for people |
//! | `engine` | `scan` | the driver: an optical scan, a ping, the profiles of the paper |
//! | `engine` | `sensor` | sensor files, presets, and what they set up in the modules below |
//! | `engine` | `detect` | receivers: which echoes are detected, and with which errors |
//! | `engine` | `echo` | what arrives: contributions, paths, weather, signals; sound levels |
//! | `engine` | `trace` | rays to hits: Embree, and what its ids mean |
//! | `engine` | `scene` | objects, meshes and labels, with label rules applied |
//! | `engine` | `medium` | air and water |
//! | `cloud` | `import` | clouds from files |
//! | `cloud` | `export` | files of clouds, pings, frames of radars and images |
//! | `cloud` | `messages` | messages of ROS 2, made from clouds and trajectories |
//! | `cloud` | `image` | images of pings: waterfall, mosaic, fan, depth map; images of radars; images of optical scans, and what they show of each instance |
//! | `cloud` | `cloud` | columns of points, pings, frames of radars |
//! | `cloud` | `cells` | the levels of a ping by beam and range bin, and what is read from them |
//! | `robots` | `robots` | robots from URDF, SDF and MJCF: links, joints, geometry, sensors |
//! | `scene-files` | `scene_files` | scenes from files: a module for each format |
//! | `model` | `model` | meshes, and objects and cameras as files place them |
//! | `model` | `material` | how surfaces reflect light and sound |
//! | `model` | `motion` | how objects move: keyframes, nodes, deformation |
//! | `survey` | `survey` | flight plans, and how platforms fly them |
//! | `emitter` | `emitter` | beams, trajectories, lobes |
//! | `ground` | `crs` | coordinate reference systems and their projections |
//! | `ground` | `read` | files, YAML and tables, with errors that say where |
//! | `ground` | `write` | files that appear only once complete |
//! | `ground` | `ground` | errors, units, poses, blocks of rays, random numbers, threads |
//!
//! # Conventions
//!
//! Lengths are metres, angles radians, times seconds; a name with another unit says so (`fov_deg`).
//! Frames are right-handed, z up; sensors look along x, y is left. Azimuth counts counter-clockwise
//! from x, elevation up from the xy plane. `range` is the slant range, `depth` the distance along x.
//!
//! # Words
//!
//! | word | meaning here |
//! |---|---|
//! | beam | what one emitter or transducer sends in one firing; it has a divergence |
//! | ray | a line handed to Embree; several can sample one beam |
//! | firing | one emission: a pulse, an exposure, a ping |
//! | hit | a ray meets a triangle: geometry alone |
//! | echo | a peak of energy in the received signal |
//! | return | an echo that the instrument reports |
//! | reflectance | a property of the surface, at the wavelength |
//! | effective reflectance, `rho_eff` | that of a Lambertian surface that would reflect as much at normal incidence |
//! | intensity | what the instrument reports, in its own scale |
//! | extinction, backscatter | in 1/m and 1/(m sr), of the air and what is suspended in it |
//! | lane, block, chunk | one of 256 beams processed side by side; these 256 beams; 2048 beams, the work of one task |
//! | row | in a cloud: a return; in the table of surfaces: a part of an object |
//! | kernel | a loop over the lanes of a block, compiled for every vector level (the crate `echocast-kernels`) |
//!
//! # Promises
//!
//! * The same binary, machine, inputs and seed give the same bits, for any number of threads and any vector level.
//! * A random number is a function of its address: the key is the seed, the counter is beam, frame, number of the
//!   return or sub-ray, and purpose. A new noise source has its own purpose and does not change the draws of the
//!   others.
//! * No input causes a panic, output to the console or a hang; errors say what was found and what is allowed.
#![forbid(unsafe_code)]

pub mod cloud;
pub mod detect;
pub mod echo;
pub mod emitter;
pub mod export;
pub mod generate;
pub mod image;
pub mod import;
pub mod material;
pub mod medium;
pub mod messages;
pub mod preview;
pub mod radar;
pub mod read;
pub mod robot;
pub mod scenario;
pub mod scene;
pub mod survey;

/// Compiles the examples of that page.
#[cfg(doctest)]
#[doc = include_str!("../docs/motion.md")]
mod page_of_motion {}

/// Compiles the example of that page.
#[cfg(doctest)]
#[doc = include_str!("../docs/robots.md")]
mod page_of_robots {}

#[doc(inline)]
pub use ::cloud::cells::{Layout, SonarView, Sounding, Track};
#[doc(inline)]
pub use ::cloud::{
    BoxAxes, BoxTime, CELL_FIELDS, Driver, Field, FieldSet, Frame, InstanceBox, PackItem, PackType, Ping, Pings,
    PointCloud,
};
#[doc(inline)]
pub use ::emitter::Trajectory;
#[doc(inline)]
pub use engine::detect::ReturnMode;
#[doc(inline)]
pub use engine::echo::Taper;
#[doc(inline)]
pub use engine::medium::Environment;
#[doc(inline)]
pub use engine::scan::{Order, Progress, ScanOptions, why_nothing};
#[doc(inline)]
pub use engine::scene::{LabelRules, LoadOptions, Scene};
#[doc(inline)]
pub use engine::sensor::{
    AcousticsSpec, BeamSpec, Expectations, Illumination, IntensitySpec, PresetInfo, RangeSpec, ReturnsSpec, Sensor,
    SensorKind, SensorSpec, ShotNoiseSpec, Speckle, SubRays, Sweep, Target, TofSpec, Tvg, Vignetting,
};
#[doc(inline)]
pub use engine::trace::{BareLoop, BuiltScene, Enclosure, Engine, LiveScene, ObjectId};
pub use glam;
#[doc(inline)]
pub use ground::cause::Cause;
#[doc(inline)]
pub use ground::error::{Error, Result, nearest};
#[doc(inline)]
pub use ground::named::Named;
#[doc(inline)]
pub use ground::path_type::PathType;
#[doc(inline)]
pub use ground::pose::Pose;
#[doc(inline)]
pub use ground::profile::Profile;
#[doc(inline)]
pub use ground::read::bounds::Parameter;
#[doc(inline)]
pub use ground::report::Report;
#[doc(inline)]
pub use ground::{shown, units};
#[doc(inline)]
pub use model::material::ReflectanceSource;
#[doc(inline)]
pub use model::motion::{Motion, Timeline};
#[doc(inline)]
pub use sets::Scenario;
