//! Output files: clouds, pings, pictures, images and boxes.

use crate::bags::BagArgs;
use crate::flight::FlightFiles;
use crate::names::{check_kept, folder, is_numbered, numbered, numbered_as, same_folder};
use crate::picture::{PictureArgs, check_picture};
use crate::pipe::{self, Outgoing};
use crate::radar::{RadarArgs, RadarKeys, RadarWriter};
use crate::{choice, text};
use anyhow::{Context as _, Result, ensure};
use clap::{ArgGroup, Args};
use echocast::emitter::pattern::Pattern;
use echocast::export::{self, AnnotationStyle, FramesFile, GrowingFile, ImageFolder, ImageLayer, ImageOptions};
use echocast::image::LAYERS;
use echocast::messages::BagOptions;
use echocast::preview::{self, ColorBy, PreviewOptions, View};
use echocast::radar::{RadarFrame, RadarRecord};
use echocast::scene::Labels;
use echocast::{
    BoxAxes, FieldSet, InstanceBox, Named as _, Pings, PointCloud, Profile, Report, Sensor, SensorKind, Trajectory,
    shown,
};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

/// Files to write.
#[derive(Args, Default)]
#[command(group = ArgGroup::new("shown").args(["preview", "image"]).multiple(true))]
#[command(group = ArgGroup::new("boxed").args(["boxes", "show"]).multiple(true))]
#[command(group = ArgGroup::new("timed").args(["boxes", "show", "annotations"]).multiple(true))]
pub struct OutputArgs {
    /// Cloud file, repeatable; its ending selects the format (`echocast formats` lists them); `-` with `--format` is
    /// standard output, and the program's messages then go to stderr
    #[arg(short, long, value_name = "FILE", required_unless_present_any = ["preview", "explain", "pings", "image", "images", "boxes", "radar", "polar", "detections", "trajectory_out"], help_heading = "Output")]
    output: Vec<PathBuf>,
    /// Format of the cloud files, whatever their endings
    #[arg(long, value_name = "NAME", requires = "output", help_heading = "Output")]
    format: Option<String>,
    /// One file per frame: `name_0007.las`; for HDF5, one file with one variable-length row per frame and column
    #[arg(long, overrides_with = "_merged", help_heading = "Output")]
    single: bool,
    /// All frames in one cloud (the default)
    #[arg(long = "merged", help_heading = "Output")]
    _merged: bool,
    /// Picture of the cloud: of all frames together, in which moving objects leave a trail, or with `--single` one for
    /// each frame, `name_0007.png`
    #[arg(long, value_name = "FILE.png", help_heading = "Output")]
    preview: Option<PathBuf>,
    /// What the colours of the picture show: `label`, the category or part that was hit; `cause`, why a point is there:
    /// a surface, seen in a mirror or through glass, rain, fog and so on; `velocity`, the speed of moving objects,
    /// while static ones are grey; `radial_velocity` and `doppler`, its component along the beam, true and measured,
    /// blue towards the sensor and orange away from it; `path`, how the wave of a radar detection travelled; `density`, the number of points per square degree of the field
    /// of view; `ground_density`, that per square metre of the map; `strip`, the flight line or station; the others show
    /// values on a colour scale
    #[arg(long, requires = "preview", default_value = "label", value_parser = choice::of::<ColorBy>(), help_heading = "Output")]
    color: ColorBy,
    /// How the picture shows the cloud; `range` shows the last of several frames. For sonars, also `waterfall`, one row
    /// per ping; `track`, a map along the track, from above; `fan`, the last ping by beam and range. For radars, also
    /// `range_doppler` and `range_azimuth`, the power in the cube of the last frame; `polar`, the last polar image of a
    /// rotating radar
    #[arg(long, requires = "shown", default_value = "top", value_parser = choice::of::<View>(), help_heading = "Output")]
    view: View,
    /// What the picture shows in addition: `boxes`, the edges of the boxes around labelled instances that have points,
    /// in the colours of their categories
    #[arg(long, value_name = "WHAT", requires = "preview", value_parser = ["boxes"], help_heading = "Output")]
    show: Option<String>,
    /// Waterfall over ground range, along the bed, instead of slant range
    #[arg(long, requires = "shown", help_heading = "Output")]
    ground: bool,
    /// Pings of a sonar as arrays of beams and range bins, with levels, labels and true positions: .npz, .h5; for
    /// survey software .xtf, for side-scan and swath sonars, and .kmall with water columns, for swath sonars
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pings: Option<PathBuf>,
    /// What `--view waterfall`, `track` or `fan` shows, as numbers and labels: .npz, .h5, or greyscale .png
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    image: Option<PathBuf>,
    /// Folder for images of each frame of a depth camera or a spinning sensor, whose beams form rows and columns:
    /// `depth_0007.png` and so on, and `images.json` with the camera, poses and label names
    #[arg(long, value_name = "FOLDER", help_heading = "Output")]
    images: Option<PathBuf>,
    /// Layers to write of each image: `depth`, a 16-bit PNG in millimetres, 0 where there is no return; `depth32`, a
    /// floating-point TIFF in metres; `category`, `part` and `instance`, a PNG with a palette if all numbers are below
    /// 256, else with 16 bits, as `category16`, `part16` and `instance16` always are; `color`, of the materials;
    /// `intensity`; `normal`; `arrays`, all of these as .npz [default: depth,category,instance,color]
    #[arg(long, value_name = "LIST", requires = "images", value_delimiter = ',', value_parser = choice::of::<ImageLayer>(), hide_possible_values = true, help_heading = "Output")]
    image_layers: Vec<ImageLayer>,
    /// Distances, m, between which `depth` goes from 1 to 65535, instead of millimetres up to 65.535 m
    #[arg(long, value_name = "A,B", requires = "images", value_parser = depth_range, help_heading = "Output")]
    depth_range: Option<DepthRange>,
    /// Annotations of the instances in the images: `coco`, boxes and masks in `coco.json`; `panoptic`, COCO's segments
    /// in `panoptic.json` and images; `voc`, boxes in an XML file for each image
    #[arg(long, value_name = "LIST", requires = "images", value_delimiter = ',', value_parser = choice::of::<AnnotationStyle>(), help_heading = "Output")]
    annotations: Vec<AnnotationStyle>,
    /// Boxes around the labelled instances of all frames, with velocity, number of points and visible fraction: .json,
    /// .csv; clouds in .npz, .h5 and .mcap include them, too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    boxes: Option<PathBuf>,
    #[command(flatten)]
    pub radar: RadarArgs,
    #[command(flatten)]
    pub flight: FlightFiles,
    #[command(flatten)]
    pub bags: BagArgs,
    /// Axes of the boxes: those of each object, or those of the frame of the points (`--frame`)
    #[arg(long, requires = "boxed", default_value = "object", value_parser = choice::of::<BoxAxes>(), help_heading = "Output")]
    box_axes: BoxAxes,
}

/// The keys of an entry of the section `outputs` of a scenario whose style is `files`.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilesKeys {
    #[serde(rename = "style")]
    _style: String,
    files: Vec<PathBuf>,
    format: Option<String>,
    single: bool,
    preview: Option<PreviewKeys>,
    pings: Option<PathBuf>,
    image: Option<PathBuf>,
    images: Option<ImagesKeys>,
    boxes: Option<PathBuf>,
    box_axes: Option<String>,
    radar: Option<RadarKeys>,
    trajectory: Option<PathBuf>,
    messages: Vec<String>,
    imu: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ImagesKeys {
    folder: PathBuf,
    #[serde(default)]
    layers: Vec<ImageLayer>,
    depth_range_m: Option<DepthRange>,
    #[serde(default)]
    annotations: Vec<AnnotationStyle>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PreviewKeys {
    file: PathBuf,
    #[serde(default)]
    color: ColorBy,
    #[serde(default)]
    view: View,
    #[serde(default)]
    ground: bool,
    #[serde(default)]
    boxes: bool,
}

impl OutputArgs {
    /// From the entry of the section `outputs` of a scenario whose style is `files`; names of files in it are relative
    /// to `folder`.
    pub fn from_keys(keys: FilesKeys, folder: &Path) -> Result<OutputArgs> {
        let at = |file: PathBuf| if pipe::is_standard(&file) { file } else { folder.join(file) };
        let axes = keys.box_axes.as_deref().unwrap_or("object");
        let axes = BoxAxes::NAMES.iter().find(|(name, _)| *name == axes).map(|(_, axes)| *axes);
        let preview = keys.preview.as_ref();
        let images = keys.images.as_ref();
        Ok(OutputArgs {
            output: keys.files.into_iter().map(at).collect(),
            format: keys.format,
            single: keys.single,
            _merged: false,
            color: preview.map_or_else(ColorBy::default, |preview| preview.color),
            view: preview.map_or_else(View::default, |preview| preview.view),
            show: preview.filter(|preview| preview.boxes).map(|_| "boxes".to_owned()),
            ground: preview.is_some_and(|preview| preview.ground),
            preview: preview.map(|preview| at(preview.file.clone())),
            pings: keys.pings.map(at),
            image: keys.image.map(at),
            image_layers: images.map(|images| images.layers.clone()).unwrap_or_default(),
            depth_range: images.and_then(|images| images.depth_range_m),
            annotations: images.map(|images| images.annotations.clone()).unwrap_or_default(),
            images: images.map(|images| at(images.folder.clone())),
            boxes: keys.boxes.map(at),
            radar: RadarArgs::from_keys(keys.radar.unwrap_or_default(), at),
            flight: FlightFiles::new(keys.trajectory.map(at)),
            bags: BagArgs::from_keys(keys.messages, keys.imu.as_deref())?,
            box_axes: axes.context("box_axes: allowed: object, frame")?,
        })
    }

    /// Only a picture.
    pub fn picture_only(picture: &PictureArgs) -> OutputArgs {
        let PictureArgs { preview, color, view } = picture;
        OutputArgs { preview: preview.clone(), color: *color, view: *view, ..OutputArgs::default() }
    }

    /// Whether every frame is written to its own file.
    pub fn single(&self) -> bool {
        self.single
    }

    /// Files that were requested by name.
    fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.output
            .iter()
            .chain(&self.preview)
            .chain(&self.pings)
            .chain(&self.image)
            .chain(&self.boxes)
            .chain(self.radar.files())
    }

    /// Number of files of clouds, pings and images.
    pub fn clouds(&self) -> usize {
        let folders = usize::from(self.images.is_some()) + self.radar.count() - self.radar.files().count();
        self.files().count() + folders - usize::from(self.preview.is_some())
    }

    /// Contents of the image folder, if there is one.
    fn imaged(&self) -> Option<ImageOptions> {
        self.images.as_ref()?;
        let layers =
            if self.image_layers.is_empty() { ImageOptions::default().layers } else { self.image_layers.clone() };
        Some(
            ImageOptions::default()
                .layers(layers)
                .depth_range_m(self.depth_range)
                .annotations(self.annotations.clone()),
        )
    }

    /// Whether images are annotated, for which boxes are needed.
    pub fn annotates(&self) -> bool {
        self.images.is_some() && !self.annotations.is_empty()
    }

    /// Creates the image folder, if one was requested.
    pub fn begin_images(&self, sensor: &Sensor) -> Result<Option<ImageFolder>> {
        let Some((folder, options)) = self.images.as_ref().zip(self.imaged()) else { return Ok(None) };
        Ok(Some(ImageFolder::create(folder, sensor, &options).context("--images")?))
    }

    /// Whether one picture shows the points of all frames.
    pub fn piles_frames(&self) -> bool {
        self.preview.is_some() && !self.single && matches!(self.view, View::Top | View::Perspective)
    }

    /// Axes of the boxes, if any were requested.
    pub fn boxes(&self) -> Option<BoxAxes> {
        (self.boxes.is_some() || self.show.is_some()).then_some(self.box_axes)
    }

    /// Whether clouds or boxes were requested, as files or pictures.
    pub fn requests_clouds(&self) -> bool {
        let files = !self.output.is_empty() || self.boxes.is_some() || self.images.is_some();
        files || self.preview.is_some() && self.view.shows_points()
    }

    /// What is recorded of the frames of a radar, if anything beside detections was requested.
    pub fn radar_record(&self) -> Option<RadarRecord> {
        let shown = self.preview.is_some() && self.view.shows_frames();
        let mut record = self.radar.record();
        record.cube |= shown && self.view != View::Polar;
        (shown || self.radar.requested()).then_some(record)
    }

    /// The requested columns of pings, including `fields` for files and images of pings; `None`: no pings were
    /// requested.
    pub fn pinged(&self, fields: FieldSet) -> Option<FieldSet> {
        let shown = self.preview.is_some() && self.view.shows_pings() || self.image.is_some();
        let shown = shown.then(|| self.picture().fields());
        let kept = self.pings.as_ref().map(|_| fields);
        // Images have labels of pings, and no other columns.
        let labels = LAYERS.into_iter().filter(|&field| fields.contains(field)).collect();
        let imaged = self.image.as_ref().map(|_| labels);
        shown.into_iter().chain(kept).chain(imaged).reduce(FieldSet::union)
    }

    /// Whether bags are among the clouds.
    fn has_bags(&self) -> bool {
        let format = self.format.as_deref();
        let mut formats = self.output.iter().filter_map(|file| export::format_for(file, format).ok());
        formats.any(|format| format.name().starts_with("mcap"))
    }

    /// The columns that bags need besides those of points.
    pub fn bagged(&self, sensor: &Sensor) -> FieldSet {
        if self.has_bags() { self.bags.columns(sensor) } else { FieldSet::EMPTY }
    }

    /// Checks the options, to fail before a long scan rather than after it.
    pub fn check(&self, fields: FieldSet, sensor: &Sensor, profile: Profile) -> Result<()> {
        let kind = sensor.kind();
        if !kind.makes_pings() {
            for (option, given) in [("--pings", self.pings.is_some()), ("--image", self.image.is_some())] {
                ensure!(!given, "{option}: the sensor is a {kind}; allowed: with sonars only");
            }
            ensure!(
                !self.view.shows_pings(),
                "--view {}: the sensor is a {kind}; allowed: top, perspective, range",
                self.view.name()
            );
        }
        ensure!(
            !self.view.shows_frames() || kind == SensorKind::Radar,
            "--view {}: the sensor is a {kind}; allowed: with radars only",
            self.view.name()
        );
        let rotates = matches!(sensor.spec().pattern, Pattern::RadarRotor(_));
        ensure!(
            !self.view.shows_frames() || rotates == (self.view == View::Polar),
            "--view {}: the radar {}; allowed: {}",
            self.view.name(),
            if rotates { "rotates" } else { "does not rotate" },
            if rotates { "polar" } else { "range_doppler, range_azimuth" }
        );
        self.radar.check(sensor)?;
        self.bags.check(sensor, self.has_bags())?;
        if kind.makes_pings() && profile != Profile::Physical {
            let view = format!("--view {}", self.view.name());
            for (option, given) in
                [("--pings", self.pings.is_some()), ("--image", self.image.is_some()), (&view, self.view.shows_pings())]
            {
                ensure!(
                    !given,
                    "{option}: --profile {} makes points and no pings; allowed: with --profile physical",
                    profile.name()
                );
            }
        }
        let pictured = self.preview.is_some() && !self.view.shows_frames();
        let of_pings = pictured || self.pings.is_some() || self.image.is_some();
        ensure!(
            !(self.single && of_pings && !self.requests_clouds()),
            "--single: files and pictures of pings hold all pings of a run, and no cloud is requested; allowed: with -o, \
             or a --preview of points"
        );
        ensure!(
            !self.ground || self.view == View::Waterfall,
            "--ground: allowed with --view waterfall only; a track uses ground range wherever the bed is detected"
        );
        self.check_view(&sensor.spec().pattern)?;
        self.check_color(sensor)?;
        if let Some(file) = &self.pings {
            export::check_pings(file, sensor).context("--pings")?;
        }
        if let Some(file) = &self.image {
            export::check_image(file).context("--image")?;
            ensure!(
                self.view.shows_pings(),
                "--image: writes the view of --view, which is {}; allowed: waterfall, track, fan",
                self.view.name()
            );
        }
        ensure!(
            self.show.is_none() || self.view.shows_points(),
            "--show boxes: not available with --view {}; allowed: top, perspective, range",
            self.view.name()
        );
        if let Some((folder, options)) = self.images.as_ref().zip(self.imaged()) {
            ensure!(
                kind.is_optical(),
                "--images: the sensor is a {kind}; allowed: with sensors of light; --image and --pings are for sonars"
            );
            export::check_images(folder, sensor, &options).context("--images")?;
        }
        if let Some(file) = &self.boxes {
            ensure!(file != Path::new("-"), "--boxes -: boxes go to files; allowed: a file name");
            export::check_boxes(file).context("--boxes")?;
        }
        for file in &self.output {
            if pipe::is_standard(file) {
                ensure!(
                    !self.single,
                    "-o -: standard output takes one cloud, and --single makes many; allowed: a file name"
                );
                Outgoing::check(self.format.as_deref(), fields)?;
            } else {
                export::check(file, self.format.as_deref(), fields)?;
            }
        }
        if let Some(file) = &self.preview {
            check_picture("--preview", file, &self.picture())?;
        }
        self.check_names(fields)
    }

    /// Checks that the files can hold `frames` frames of `sensor`, whose points have the columns `fields`; a strip has
    /// `longest` of them at most, 1 where there are no strips.
    pub fn check_room(&self, fields: FieldSet, sensor: &Sensor, [frames, longest]: [usize; 2]) -> Result<()> {
        /// Most frames: at 10 a second, those of 11 days.
        const MOST_FRAMES: usize = 10_000_000;
        /// Most beams whose points are in memory at once: some hundred gigabytes.
        const MOST_PILED: u64 = 4_000_000_000;
        let beams = sensor.beams().len() as u64 * if self.single { longest } else { frames } as u64;
        ensure!(
            frames <= MOST_FRAMES,
            "--frames: {frames} frames are too many for a run; allowed: up to {MOST_FRAMES}"
        );
        ensure!(
            !self.piles_frames() || beams <= MOST_PILED,
            "--preview: {frames} frames of {} beams are too many for one picture; allowed: {MOST_PILED} beams, or --single",
            sensor.beams().len()
        );
        if !self.single {
            self.radar.check_frames(frames)?;
        }
        let points = beams.saturating_mul(sensor.most_returns() as u64);
        let room = |file: &PathBuf| export::check_room(file, self.format.as_deref(), fields, points);
        Ok(self.output.iter().try_for_each(room)?)
    }

    /// Prints `text`, a message of the run, to stdout, or to stderr if a cloud goes to stdout.
    pub fn print(&self, text: &str) -> Result<()> {
        if self.output.iter().any(|file| pipe::is_standard(file)) {
            text::print_error(text);
            return Ok(());
        }
        text::print(text)
    }

    /// Checks that `input`, which the run reads, is none of the files that it writes.
    pub fn check_input(&self, input: &Path) -> Result<()> {
        // Of the files of single frames, only the one with the number of `input` can be the same file.
        let framed = |file: &PathBuf| if self.single { numbered_as(input, file) } else { Some(file.clone()) };
        let clouds =
            self.output.iter().filter_map(|file| if self.grows(file) { Some(file.clone()) } else { framed(file) });
        let clouds = clouds.flat_map(|file| [self.labels_of(&file), Some(file)]).flatten();
        let pictures = self
            .preview
            .iter()
            .filter_map(|file| if self.view.shows_pings() { Some(file.clone()) } else { framed(file) });
        let images = self.image.iter().flat_map(|file| export::image_label_paths(file, FieldSet::all()));
        let radar = self.radar.files().filter_map(framed);
        let others = images.chain(self.image.clone()).chain(self.pings.clone()).chain(self.boxes.clone()).chain(radar);
        let files = clouds.chain(pictures).chain(others).chain(self.image_at(input)).chain(self.flight.files());
        files.filter(|file| !pipe::is_standard(file)).try_for_each(|file| check_kept(&file, input))
    }

    /// The file of the image folder, of any frame, that has the name of `file`.
    fn image_at(&self, file: &Path) -> Option<PathBuf> {
        let (images, options) = self.images.as_ref().zip(self.imaged())?;
        let name = file.file_name()?.to_str()?;
        let digits = name.rsplit_once('_').and_then(|(_, rest)| rest.split('.').next()?.parse().ok());
        let names = digits.map(|frame| options.file_names(frame)).into_iter().flatten().chain(options.table_names());
        { names }.find(|known| known == name).map(|known| images.join(known))
    }

    /// Checks that pings of such a sonar can be shown in this view.
    fn check_view(&self, pattern: &Pattern) -> Result<()> {
        if !self.view.shows_pings() {
            return Ok(());
        }
        let sides = matches!(pattern, Pattern::Sidescan(_));
        ensure!(
            !self.ground || sides,
            "--ground: the sonar does not look to the sides; allowed: with side-scan sonars"
        );
        ensure!(
            self.view != View::Fan || !sides,
            "--view fan: the sonar is a side-scan sonar, whose beams look to the sides; allowed: waterfall, track"
        );
        let depths = self.view == View::Track && matches!(pattern, Pattern::Multibeam(_));
        let values = if depths { ColorBy::Height } else { ColorBy::Intensity };
        ensure!(
            self.preview.is_none() || [ColorBy::Label, values].contains(&self.color),
            "--color {}: not available with --view {} of this sonar; allowed: label, {}",
            self.color.name(),
            self.view.name(),
            values.name()
        );
        Ok(())
    }

    /// Checks that such a sensor gives points the values that the picture shows.
    fn check_color(&self, sensor: &Sensor) -> Result<()> {
        let named = format!("--color {}", self.color.name());
        let measures = sensor.spec().doppler.is_some() || sensor.kind() == SensorKind::Radar;
        let measured = self.color != ColorBy::Doppler || measures;
        let way =
            if sensor.kind().is_optical() { "with a section doppler (--set doppler.sigma_m_s=0.05), or " } else { "" };
        ensure!(measured, "{named}: the sensor does not measure velocities; allowed: {way}--color radial_velocity");
        Ok(())
    }

    /// Checks that no file would overwrite another. `fields` are the columns of files of pings.
    fn check_names(&self, fields: FieldSet) -> Result<()> {
        // Files with one stem share their label file, which is the same for all clouds of a run.
        let mut labels = BTreeSet::new();
        labels.extend(self.output.iter().filter_map(|file| self.labels_of(file)));
        let beside = self.beside_image(fields);
        let flight: Vec<PathBuf> = self.flight.files().collect();
        let mut seen = HashSet::new();
        for name in self.files().chain(&labels).chain(&beside).chain(&flight) {
            let place = folder(name).canonicalize().unwrap_or_default().join(name.file_name().unwrap_or_default());
            ensure!(
                seen.insert(place),
                "{}: would be written twice; allowed: another name for each file",
                shown::path(name)
            );
        }
        // The files of images have names of their own.
        for name in self.files().chain(&labels) {
            let image = self.image_at(name).filter(|image| same_folder(image, name));
            ensure!(
                image.is_none(),
                "{}: is the name that --images gives to a file; allowed: another name",
                shown::path(name)
            );
        }
        // Files of single frames have names that were not requested as such.
        let previews = self.preview.iter().filter(|_| !self.view.shows_pings());
        let of_frames = self.output.iter().chain(previews).chain(self.radar.files());
        let whole = self.pings.iter().chain(&self.image).chain(&self.boxes).chain(&beside).chain(&flight);
        for (file, name) in of_frames.flat_map(|file| whole.clone().map(move |name| (file, name))) {
            ensure!(
                !(self.single && is_numbered(name, file)),
                "{}: is the name that --single gives to a frame of {}; allowed: another name",
                shown::path(name),
                shown::path(file)
            );
        }
        Ok(())
    }

    /// The file of label names beside the cloud `file`, if there is one.
    fn labels_of(&self, file: &Path) -> Option<PathBuf> {
        let format = export::format_for(file, self.format.as_deref()).ok()?;
        (!format.info().holds_label_names && !pipe::is_standard(file)).then(|| export::labels_path(file))
    }

    /// Whether all single frames go to `file` itself.
    fn grows(&self, file: &Path) -> bool {
        self.single && export::format_for(file, self.format.as_deref()).is_ok_and(|format| format.name() == "hdf5")
    }

    /// Label files beside the image.
    fn beside_image(&self, fields: FieldSet) -> Vec<PathBuf> {
        let kept = self.pinged(fields).unwrap_or(FieldSet::EMPTY);
        self.image.as_ref().map_or_else(Vec::new, |file| export::image_label_paths(file, kept))
    }

    fn picture(&self) -> PreviewOptions {
        PreviewOptions::default().view(self.view).color(self.color).ground(self.ground).boxes(self.show.is_some())
    }

    /// The columns that picture and images show, whatever the files hold.
    pub fn pictured(&self) -> FieldSet {
        let clouds = self.preview.is_some() && self.view.shows_points();
        let pictured = if clouds { self.picture().fields() } else { FieldSet::EMPTY };
        let pictured = pictured.union(self.radar.fields());
        self.imaged().map_or(pictured, |options| pictured.union(options.fields()))
    }

    /// As an entry of the section `outputs` of a scenario, without its style.
    pub fn to_json(&self) -> Map<String, Value> {
        let preview = self.preview.as_ref().map(|file| {
            json!({
                "file": shown::path(file),
                "color": self.color.name(),
                "view": self.view.name(),
                "ground": self.ground,
                "boxes": self.show.is_some(),
            })
        });
        let images = self.images.as_ref().zip(self.imaged()).map(|(folder, options)| {
            json!({
                "folder": shown::path(folder),
                "layers": options.layers.iter().map(|layer| layer.name()).collect::<Vec<_>>(),
                "depth_range_m": options.depth_range_m,
                "annotations": options.annotations.iter().map(|style| style.name()).collect::<Vec<_>>(),
            })
        });
        let json = json!({
            "files": text::paths(&self.output),
            "format": self.format,
            "single": self.single,
            "preview": preview,
            "pings": self.pings.as_deref().map(shown::path),
            "image": self.image.as_deref().map(shown::path),
            "images": images,
            "boxes": self.boxes.as_deref().map(shown::path),
            "box_axes": self.boxes().map(BoxAxes::name),
            "radar": self.radar.to_json(),
            "trajectory": self.flight.to_json(),
        });
        let mut keys = json.as_object().cloned().unwrap_or_default();
        self.bags.add_to(&mut keys);
        keys
    }
}

/// Writes the clouds of a run.
pub struct CloudWriter<'a> {
    args: &'a OutputArgs,
    /// HDF5 files that take frame after frame, in the order of `args.output`.
    growing: Vec<(&'a Path, FramesFile)>,
    /// Files of all frames together, in the order of `args.output`; `None`: the format needs all points at once.
    merged: Vec<Option<GrowingFile>>,
    radar: RadarWriter<'a>,
    /// What bags hold.
    bag: BagOptions,
    /// The cloud for standard output, if there is one, until it is complete.
    stdout: Option<Outgoing>,
    /// Every file written.
    pub files: Vec<PathBuf>,
    /// What formats could not hold.
    pub report: Report,
}

impl<'a> CloudWriter<'a> {
    /// `bag`: what bags hold.
    pub fn new(args: &'a OutputArgs, bag: BagOptions) -> Result<Self> {
        let stdout = args.output.iter().any(|file| pipe::is_standard(file)).then(Outgoing::new).transpose()?;
        Ok(CloudWriter {
            args,
            growing: Vec::new(),
            merged: Vec::new(),
            radar: RadarWriter::new(&args.radar, args.single)?,
            bag,
            stdout,
            files: Vec::new(),
            report: Report::default(),
        })
    }

    /// Adds the cloud of one of many frames to the files of all of them, or to those of their `strip` if each has files
    /// of its own. Returns whether [`CloudWriter::write`] or [`CloudWriter::write_strip`] needs it again.
    pub fn add(&mut self, cloud: &PointCloud, strip: Option<u16>) -> Result<bool> {
        if self.merged.is_empty() {
            let format = self.args.format.as_deref();
            let begin = |file: &PathBuf| match strip {
                // It has one row for each strip.
                Some(_) if self.args.grows(file) => Ok(None),
                Some(strip) => GrowingFile::begin_with(&numbered(file, strip.into()), format, cloud, &self.bag),
                None => GrowingFile::begin_with(&self.place(file), format, cloud, &self.bag),
            };
            self.merged = self.args.output.iter().map(begin).collect::<Result<_, _>>()?;
        }
        self.merged.iter_mut().flatten().try_for_each(|file| file.add(cloud))?;
        let pictured = self.args.preview.is_some() && self.args.view.shows_points();
        let piled = if strip.is_some() { pictured } else { self.args.piles_frames() };
        Ok(piled || self.merged.iter().any(Option::is_none))
    }

    /// Completes the files of a strip, whose pieces were added; `cloud` is all of them, if they were needed again, and
    /// `last` the last one.
    pub fn write_strip(&mut self, strip: u16, cloud: &PointCloud, last: &PointCloud) -> Result<()> {
        let number = u32::from(strip);
        let mut merged = std::mem::take(&mut self.merged).into_iter();
        for file in &self.args.output {
            match merged.next().flatten() {
                Some(grown) => {
                    self.report.absorb(grown.finish()?);
                    self.wrote_cloud(&numbered(file, number))?;
                }
                None if self.args.grows(file) => self.add_frame(cloud, file)?,
                None => self.write_cloud(cloud, &numbered(file, number))?,
            }
        }
        let pictured = if self.args.view == View::Range { last } else { cloud };
        self.write_preview(pictured, self.args.preview.as_ref().map(|file| numbered(file, number)))
    }

    /// Writes the single cloud of the run, whose last frame is `last`: a range image shows the view from one place.
    /// Where frames were added, `cloud` is all of them, if they were needed again.
    pub fn write(&mut self, cloud: &PointCloud, last: &PointCloud) -> Result<()> {
        let mut merged = std::mem::take(&mut self.merged).into_iter();
        for file in &self.args.output {
            match merged.next().flatten() {
                Some(grown) => {
                    self.report.absorb(grown.finish()?);
                    self.wrote_cloud(file)?;
                }
                None => self.write_cloud(cloud, file)?,
            }
        }
        let pictured = if self.args.view == View::Range { last } else { cloud };
        self.write_preview(pictured, self.args.preview.clone())
    }

    /// Writes the cloud of one of many frames.
    pub fn write_frame(&mut self, frame: u32, cloud: &PointCloud) -> Result<()> {
        for file in &self.args.output {
            if self.args.grows(file) {
                self.add_frame(cloud, file)?;
            } else {
                self.write_cloud(cloud, &numbered(file, frame))?;
            }
        }
        self.write_preview(cloud, self.args.preview.as_ref().map(|file| numbered(file, frame)))
    }

    /// Writes the files and pictures of all pings of the run.
    pub fn write_pings(&mut self, pings: &Pings) -> Result<()> {
        let args = self.args;
        if let Some(file) = &args.pings {
            self.report.absorb(pings.write(file).context("--pings")?);
            self.files.push(file.clone());
        }
        if let Some(file) = &args.image {
            let image = preview::image_of(pings, &args.picture()).context("--image")?;
            self.report.absorb(image.write(file).context("--image")?);
            self.files.push(file.clone());
            let labels = image.layers.iter().map(|layer| layer.field).collect();
            self.files.extend(export::image_label_paths(file, labels));
        }
        if let Some(file) = args.preview.as_ref().filter(|_| args.view.shows_pings()) {
            self.report.absorb(preview::write_pings(pings, file, &args.picture()).context("--preview")?);
            self.files.push(file.clone());
        }
        Ok(())
    }

    /// Writes what was requested of the frame of a radar on `trajectory`, whose detections are in `cloud`; `last`: no frame
    /// follows.
    pub fn write_radar(
        &mut self,
        frame: &RadarFrame,
        cloud: &PointCloud,
        trajectory: &Trajectory,
        last: bool,
    ) -> Result<()> {
        let report = self.radar.write(frame, cloud, trajectory, &mut self.files)?;
        self.report.absorb(report);
        let shown = self.args.preview.as_ref().filter(|_| self.args.view.shows_frames() && (last || self.args.single));
        if let Some(file) = shown {
            let file = if self.args.single { numbered(file, frame.number) } else { file.clone() };
            preview::write_frame(frame, &file, &self.args.picture()).context("--preview")?;
            self.files.push(file);
        }
        if last { self.radar.finish(&mut self.files) } else { Ok(()) }
    }

    /// Writes the boxes of all frames.
    pub fn write_boxes(&mut self, boxes: &[InstanceBox], labels: &Labels) -> Result<()> {
        let Some(file) = &self.args.boxes else { return Ok(()) };
        export::write_boxes(boxes, labels, file).context("--boxes")?;
        self.files.push(file.clone());
        Ok(())
    }

    /// Completes the files that grew frame by frame, which then get their names.
    pub fn finish(&mut self) -> Result<()> {
        for (file, frames) in self.growing.drain(..) {
            self.report.absorb(frames.finish()?);
            self.files.push(file.to_owned());
        }
        Ok(())
    }

    fn write_cloud(&mut self, cloud: &PointCloud, file: &Path) -> Result<()> {
        let format = self.args.format.as_deref();
        self.report.absorb(export::write_with(cloud, &self.place(file), format, &self.bag)?);
        self.wrote_cloud(file)
    }

    /// Where the cloud `file` is written.
    fn place(&self, file: &Path) -> PathBuf {
        self.stdout.as_ref().filter(|_| pipe::is_standard(file)).map_or_else(|| file.to_owned(), Outgoing::place)
    }

    /// Lists the cloud file `file` among those written, and the file of label names beside it.
    fn wrote_cloud(&mut self, file: &Path) -> Result<()> {
        if let Some(cloud) = self.stdout.take_if(|_| pipe::is_standard(file)) {
            cloud.pour(self.args.format.as_deref().unwrap_or_default(), &mut self.report)?;
        }
        self.files.push(file.to_owned());
        let labels = self.args.labels_of(file).filter(|labels| !self.files.contains(labels));
        self.files.extend(labels);
        Ok(())
    }

    fn add_frame(&mut self, cloud: &PointCloud, file: &'a Path) -> Result<()> {
        let index = match self.growing.iter().position(|(known, _)| *known == file) {
            Some(index) => index,
            None => {
                self.growing.push((file, FramesFile::create(file)?));
                self.growing.len() - 1
            }
        };
        Ok(self.growing[index].1.add(cloud)?)
    }

    fn write_preview(&mut self, cloud: &PointCloud, file: Option<PathBuf>) -> Result<()> {
        let Some(file) = file.filter(|_| self.args.view.shows_points()) else { return Ok(()) };
        self.report.absorb(preview::write(cloud, &file, &self.args.picture()).context("--preview")?);
        self.files.push(file);
        Ok(())
    }
}

/// Two distances, m.
type DepthRange = [f64; 2];

/// `A,B`.
fn depth_range(text: &str) -> Result<DepthRange, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let both = text.split_once(',').and_then(|(low, high)| Some([number(low)?, number(high)?]));
    both.ok_or_else(|| "expected two distances in metres, such as 0.5,20".to_owned())
}
