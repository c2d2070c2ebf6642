//! Output files of radars: cubes, samples, polar images, and detections as in data sets.

use crate::choice;
use crate::names::numbered;
use anyhow::{Context as _, Result, ensure};
use clap::Args;
use echocast::emitter::pattern::Pattern;
use echocast::export::{self, PolarFolder, PolarStyle, RadarPoints, check_radar_points};
use echocast::radar::{RadarFrame, RadarRecord};
use echocast::{FieldSet, Named, PointCloud, Report, Sensor, SensorKind, Trajectory, shown};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Files of radars to write.
#[derive(Args, Default)]
pub struct RadarArgs {
    /// Frame of a radar as arrays: the cube with its axes and antennas, and the polar image of a rotating one: .npz, .h5;
    /// or its samples in the layout of TI's capture card: .bin. With `--single` one for each frame, `name_0007.npz`
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    radar: Option<PathBuf>,
    /// What `--radar` holds: `cube`; `samples`, those of the converters, from which the cube is then made [default: cube,
    /// for .bin samples]
    #[arg(long = "radar-parts", id = "radar_parts", value_name = "LIST", requires = "radar", value_delimiter = ',', value_parser = choice::of::<RadarPart>(), hide_possible_values = true, help_heading = "Output")]
    parts: Vec<RadarPart>,
    /// Folder for the polar images of a rotating radar, in the layout of a data set
    #[arg(long, value_name = "FOLDER", help_heading = "Output")]
    polar: Option<PathBuf>,
    /// The data set
    #[arg(long, requires = "polar", default_value = "oxford", value_parser = choice::of::<PolarStyle>(), help_heading = "Output")]
    polar_style: Option<PolarStyle>,
    /// Detections of a radar as in data sets: .pcd of nuScenes or .bin of View-of-Delft. With `--single` one for each
    /// frame, `name_0007.pcd`
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    detections: Option<PathBuf>,
}

/// What a frame of a radar holds beside its detections.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadarPart {
    Cube,
    Samples,
}

impl Named for RadarPart {
    const NAMES: &'static [(&'static str, RadarPart)] = &[("cube", RadarPart::Cube), ("samples", RadarPart::Samples)];
}

/// The keys of the section `radar` of an output.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RadarKeys {
    frame: Option<PathBuf>,
    parts: Vec<RadarPart>,
    polar: Option<PathBuf>,
    polar_style: Option<PolarStyle>,
    detections: Option<PathBuf>,
}

impl RadarArgs {
    /// From the keys of a scenario; `at`: where a file is.
    pub fn from_keys(keys: RadarKeys, at: impl Fn(PathBuf) -> PathBuf) -> RadarArgs {
        RadarArgs {
            radar: keys.frame.map(&at),
            parts: keys.parts,
            polar: keys.polar.map(&at),
            polar_style: keys.polar_style,
            detections: keys.detections.map(&at),
        }
    }

    /// As the section `radar` of an output, if anything was requested.
    pub fn to_json(&self) -> Option<Value> {
        let named = RadarPart::NAMES.iter().filter(|(_, part)| self.parts.contains(part));
        let parts: Vec<&str> = named.map(|(name, _)| *name).collect();
        self.requested().then(|| {
            json!({
                "frame": self.radar.as_deref().map(shown::path),
                "parts": parts,
                "polar": self.polar.as_deref().map(shown::path),
                "polar_style": self.polar.as_ref().map(|_| self.style().name()),
                "detections": self.detections.as_deref().map(shown::path),
            })
        })
    }

    /// Whether anything was requested.
    pub fn requested(&self) -> bool {
        self.radar.is_some() || self.polar.is_some() || self.detections.is_some()
    }

    /// Files of a frame.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.radar.iter().chain(&self.detections)
    }

    /// Number of outputs.
    pub fn count(&self) -> usize {
        self.files().count() + usize::from(self.polar.is_some())
    }

    /// What files need of a frame.
    pub fn record(&self) -> RadarRecord {
        let Some(file) = &self.radar else { return RadarRecord::default() };
        let has = |part| self.parts.contains(&part);
        let samples = has(RadarPart::Samples) || is_capture(file);
        RadarRecord { cube: has(RadarPart::Cube) || !samples, samples }
    }

    /// Columns that files of detections need.
    pub fn fields(&self) -> FieldSet {
        if self.detections.is_some() { RadarPoints::fields() } else { FieldSet::EMPTY }
    }

    /// Checks the options, to fail before a long scan rather than after it.
    pub fn check(&self, sensor: &Sensor) -> Result<()> {
        let given = [("--radar", &self.radar), ("--polar", &self.polar), ("--detections", &self.detections)];
        for (option, _) in given.iter().filter(|(_, file)| file.is_some()) {
            let kind = sensor.kind();
            ensure!(kind == SensorKind::Radar, "{option}: the sensor is a {kind}; allowed: with radars only");
        }
        let rotates = matches!(sensor.spec().pattern, Pattern::RadarRotor(_));
        ensure!(
            self.polar.is_none() || rotates,
            "--polar: the radar does not rotate; allowed: with radars of the pattern radar_rotor"
        );
        if let Some(file) = &self.radar {
            ensure!(
                !rotates || self.parts.is_empty() && !is_capture(file),
                "--radar {}: a rotating radar records polar images alone; allowed: .npz and .h5 without --radar-parts",
                shown::path(file)
            );
            export::check_radar_frame(file).context("--radar")?;
            ensure!(
                !is_capture(file) || !self.parts.contains(&RadarPart::Cube),
                "--radar-parts cube: {} holds samples only; allowed: samples, or .npz and .h5",
                shown::path(file)
            );
        }
        if let Some(file) = &self.detections {
            check_radar_points(file).context("--detections")?;
        }
        Ok(())
    }

    /// Checks that files of one frame are not for `frames` frames.
    pub fn check_frames(&self, frames: usize) -> Result<()> {
        for (option, file) in [("--radar", &self.radar), ("--detections", &self.detections)] {
            ensure!(
                file.is_none() || frames <= 1,
                "{option}: a file holds one frame, and {frames} are scanned; allowed: --single, which makes a file for \
                 each"
            );
        }
        Ok(())
    }

    fn style(&self) -> PolarStyle {
        self.polar_style.unwrap_or(PolarStyle::Oxford)
    }
}

/// Whether `file` has the layout of a capture card, which holds samples alone.
fn is_capture(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("bin"))
}

/// Writes the frames of a radar.
pub struct RadarWriter<'a> {
    args: &'a RadarArgs,
    single: bool,
    polar: Option<PolarFolder>,
}

impl<'a> RadarWriter<'a> {
    /// `single`: each frame has files of its own.
    pub fn new(args: &'a RadarArgs, single: bool) -> Result<Self> {
        let begin = |folder: &PathBuf| PolarFolder::create(folder, args.style()).context("--polar");
        Ok(RadarWriter { args, single, polar: args.polar.as_ref().map(begin).transpose()? })
    }

    /// Writes `frame` and the detections of its `cloud`, by a radar on `trajectory`, and lists the files.
    pub fn write(
        &mut self,
        frame: &RadarFrame,
        cloud: &PointCloud,
        trajectory: &Trajectory,
        files: &mut Vec<PathBuf>,
    ) -> Result<Report> {
        let mut report = Report::default();
        let place = |file: &PathBuf| if self.single { numbered(file, frame.number) } else { file.clone() };
        if let Some(file) = self.args.radar.as_ref().map(place) {
            report.absorb(frame.write(&file).context("--radar")?);
            files.push(file);
        }
        if let Some(folder) = &mut self.polar {
            report.absorb(folder.add(frame).context("--polar")?);
        }
        if let Some(file) = self.args.detections.as_ref().map(place) {
            // In the axes of the radar at the start of the scan, as the detections.
            let velocity = cloud.sensor_pose.orientation.inverse() * trajectory.velocity(frame.time);
            cloud.write_radar(&file, RadarPoints::of(&file)?, velocity.as_vec3().to_array()).context("--detections")?;
            files.push(file);
        }
        Ok(report)
    }

    /// Completes the folder of polar images, and lists its files.
    pub fn finish(&mut self, files: &mut Vec<PathBuf>) -> Result<()> {
        if let Some(folder) = self.polar.take() {
            files.extend(folder.finish().context("--polar")?);
        }
        Ok(())
    }
}
