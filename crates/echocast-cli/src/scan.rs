//! `echocast scan`

use crate::flight::{EarthArgs, NavigationArgs};
use crate::frames::FrameRange;
use crate::input::{self, SceneArgs, SensorArgs};
use crate::output::OutputArgs;
use crate::place::PlaceArgs;
use crate::progress::ProgressLine;
use crate::record::{Nothing, Take, TakeFrame, frame_word};
use crate::report::{RunReport, Seconds, timed};
use crate::text::duration;
use crate::weather::WeatherArgs;
use crate::{choice, formats, interrupt, place, text, usage};
use anyhow::{Context as _, Result, anyhow, ensure};
use clap::ArgGroup;
use echocast::emitter::Navigation;
use echocast::scene::MaterialRules;
use echocast::{
    BoxTime, Engine, Environment, FieldSet, Frame, LabelRules, LiveScene, Order, Pose, Profile, ReflectanceSource,
    Report, ScanOptions, Scene, Sensor, SubRays, Trajectory, read, shown, why_nothing,
};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Scan a scene with one sensor: one or more frames or pings, labelled clouds and pictures
#[derive(clap::Args)]
#[command(group = ArgGroup::new("several").args(["trajectory", "frames"]).multiple(true))]
#[command(after_help = "\
Examples:
  echocast generate street -o street.glb
  echocast scan street.glb --sensor velodyne_vlp32c --camera Corner -o scan.las --preview scan.png
  echocast scan street.glb --sensor velodyne_vlp32c --at 0,0,1.8 --rain 20 --fog 150 -o wet.las
  echocast scan street.glb --sensor velodyne_vlp32c --at 0,0,1.8 --fog 150 --explain 12345
  echocast scan street.glb --sensor vlp16 --at 0,0,1.8 -o scan.npz --boxes boxes.json --preview boxes.png \\
    --view perspective --show boxes
While things move, and with the sensor on a trajectory:
  echocast scan street.glb --sensor vlp16 --camera Lidar --frames 0:19 --fields default,velocity,flow -o drive.las
  echocast scan street.glb --sensor ouster_os1_128 --camera Corner --frames 4:36:8 --preview trail.png --color velocity
  printf '0 -10 0 1.8 0 0 0 1\\n2 10 0 1.8 0 0 0 1\\n' > drive.txt
  echocast scan street.glb --sensor velodyne_hdl64e --trajectory drive.txt --single -o along.las
A bag for ROS 2, with points as of the maker's driver, and a cloud for another program:
  echocast scan street.glb --sensor ouster_os1_128 --at 0,0,1.8 --frames 0:1 -o drive.mcap
  echocast scan street.glb --sensor vlp16 --at 0,0,1.8 --format csv -o - | head -n 3
  echocast scan street.glb --sensor hokuyo_ust10lx --trajectory drive.txt -o laser.mcap --messages scan,imu,odom,clock
A depth camera in a flat, with a row for every pixel:
  echocast generate indoor -o flat.glb
  echocast scan flat.glb --sensor kinect_v2 --camera Camera_1 --organised --fields default,depth -o flat.npz
What it sees as images of depth, labels and colours, with boxes and masks for learners:
  echocast scan flat.glb --sensor kinect_v2 --camera Camera_1 --images flat --annotations coco,voc
An OBJ file whose y axis points up, and what moves it, a file for each tenth of a second:
  printf 'o Flag\\nv 5 0 1\\nv 5 0 -1\\nv 5 3 0\\nf 1 2 3\\n' > flag_0001.obj
  sed 's/v 5/v 6/' flag_0001.obj > flag_0002.obj
  echocast scan flag_0001.obj --up y --cache Flag=flag_0001.obj@10 --sensor vlp16 --at 0,0,1 --frames 2 -o flag.las
A survey with a side-scan sonar:
  echocast generate seabed -o lake.glb
  printf '0 -25 0 -3 0 0 0 1\\n30 25 0 -3 0 0 0 1\\n' > survey.txt
  echocast scan lake.glb --sensor sss_450 --set range.max_m=25 --trajectory survey.txt -o lake.las \\
    --preview lake.png --view waterfall --color intensity
  echocast scan lake.glb --sensor sss_450 --trajectory survey.txt --explain 20,1
A radar: its detections by path, its cube, and the samples of ten frames as a capture card stores them:
  echocast scan street.glb --sensor ti_awr1843 --at 0,0,0.5 -o radar.las --preview paths.png --color path
  echocast scan street.glb --sensor ti_awr1843 --at 0,0,0.5 --radar cube.npz --preview doppler.png --view range_doppler
  echocast scan street.glb --sensor ti_awr1843 --camera Lidar --frames 0:9 --single --radar adc.bin --detections det.pcd
A rotating radar, as images in the layout of Oxford Radar RobotCar:
  echocast scan street.glb --sensor navtech_cts350x --at 0,0,2 --polar oxford --preview turn.png --view polar")]
pub struct ScanArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Source of the reflectance where the material does not give one [default: library for the profile
    /// physical, luminance for paper, alpha for blainder]
    #[arg(long, value_parser = choice::of::<ReflectanceSource>(), help_heading = "Scene")]
    reflectance_source: Option<ReflectanceSource>,
    #[command(flatten)]
    sensor: SensorArgs,
    /// Set of models: the physical ones, the paper's equations as printed, or as computed by the paper's program
    #[arg(long, default_value = "physical", value_parser = choice::of::<Profile>(), help_heading = "Sensor")]
    profile: Profile,
    /// Seed of all random draws
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true, help_heading = "Sensor")]
    seed: u64,
    #[command(flatten)]
    weather: WeatherArgs,
    #[command(flatten)]
    place: PlaceArgs,
    /// Poses over time: TUM text (`t x y z qx qy qz qw`), CSV with a header, SBET (.sbet, .out) or HELIOS++ (.trj), `-` for text
    /// from standard input; time 0 of the run is the first pose. Without `--frames`, frames are scanned along the whole
    /// trajectory
    #[arg(long, value_name = "FILE", conflicts_with_all = ["at", "rpy", "camera"], help_heading = "Place")]
    trajectory: Option<PathBuf>,
    #[command(flatten)]
    earth: EarthArgs,
    #[command(flatten)]
    navigation: NavigationArgs,
    /// Frames A to B, both included, every STEPth, or frame A alone; frame k starts at k / fps seconds. The frames of a
    /// sonar are its pings [default: the whole --trajectory; without one, only frame 0]
    #[arg(long, value_name = "A[:B[:STEP]]", help_heading = "Place")]
    frames: Option<FrameRange>,
    /// Frames per second [default: the sensor's rate]
    #[arg(long, value_name = "N", value_parser = input::positive, requires = "several", help_heading = "Place")]
    fps: Option<f64>,
    /// Number of the strip, the flight line or station, in the column `strip`; 0: none
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Points")]
    strip: u16,
    /// Freeze the scene during each frame, as it is when the frame starts
    #[arg(long, help_heading = "Place")]
    freeze: bool,
    /// Scan at least as fast as the instrument: beams of as many rays as it takes get no more than fit into the time of
    /// a frame, and the report says how many; `--set 'beam.sub_rays={adaptive: N}'` gives them N at most in any case
    #[arg(long, help_heading = "Sensor")]
    realtime: bool,
    /// Bring points to one time, the start of their frame: moving objects are where they were then, and
    /// `--frame sensor` is the sensor's frame at that time
    #[arg(long, help_heading = "Points")]
    deskew: bool,
    /// Time for which boxes are valid: that at which each object is scanned (the mean time of its points; with
    /// `--deskew` the start), or the start or the end of the frame
    #[arg(long, requires = "timed", default_value = "scan", value_parser = choice::of::<BoxTime>(), help_heading = "Output")]
    box_time: BoxTime,
    /// How far skins, morph targets and baked shapes may deviate from their true position within a frame, metres
    #[arg(long, value_name = "M", default_value = "0.001", value_parser = input::positive, help_heading = "Place")]
    motion_tolerance: f64,
    /// Columns to compute and write: names separated by commas, `default` or `all`; `--help` lists them
    #[arg(long, value_name = "LIST", value_parser = FieldRequest::parse, long_help = formats::column_help(), help_heading = "Points")]
    fields: Option<FieldRequest>,
    /// Coordinates of the points
    #[arg(long = "frame", default_value = "world", value_parser = choice::of::<Frame>(), help_heading = "Points")]
    coordinates: Frame,
    /// Order of the points: by frame, beam and return, or by time
    #[arg(long, default_value = "beam", value_parser = choice::of::<Order>(), help_heading = "Points")]
    order: Order,
    /// Keep beams without a return (as NaN), in the rows and columns of the sensor
    #[arg(long, help_heading = "Points")]
    organised: bool,
    /// Show what happens to one beam of the first frame, or of FRAME, step by step with numbers, and write nothing;
    /// rows and columns count from 0, a beam is row * columns + column; for a sonar, a frame is a ping, and in the
    /// profiles paper and blainder a beam is a ray; for a radar, a beam is a detection
    #[arg(long, value_name = "[FRAME,]BEAM", value_parser = frame_and_beam, conflicts_with_all = ["output", "preview", "images", "boxes", "radar", "polar", "detections", "json"], help_heading = "Output")]
    explain: Option<(Option<u32>, u32)>,
    #[command(flatten)]
    output: OutputArgs,
    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print the run's report as one JSON object on stdout, with `-o -` on stderr
    #[arg(long)]
    json: bool,
    /// Print only errors
    #[arg(short, long, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more: scene, sensor and pose
    #[arg(short, long)]
    verbose: bool,
}

pub fn run(args: &ScanArgs) -> Result<()> {
    let threads = input::set_threads(args.threads)?;
    interrupt::listen().context("cannot listen for signals")?;
    let progress = ProgressLine::new(args.quiet);
    let mut seconds = Seconds::default();
    let mut warnings = Report::default();

    progress.phase(format!("loading {}", args.scene.names()));
    let (loaded, read) = read::noting(|| timed(&mut seconds.load, || load(args)));
    let Loaded { sensor, environment, labels, materials, scene, path, navigation, report } = loaded?;
    warnings.absorb(report);
    read.iter().try_for_each(|input| args.output.check_input(input)).map_err(usage::wrong)?;
    let sonar = sensor.kind().makes_pings();
    if sonar && args.deskew {
        return Err(usage::wrong(anyhow!(
            "--deskew: a ping of a sonar has one pose; allowed: LiDARs and depth cameras"
        )));
    }
    let fields = args.fields.unwrap_or_default().of(&sensor);
    interrupt::check()?;
    warnings.absorb(scene.report.clone());
    let ScanCourse { trajectory, frames, fps } = course(args, &sensor, &environment, &scene, path, &mut warnings)?;
    args.output.check_room(fields, &sensor, [frames.len(), 1]).map_err(usage::wrong)?;
    args.output.flight.check(&trajectory).map_err(usage::wrong)?;
    let span = [f64::from(frames.first) / fps, f64::from(frames.last) / fps + sensor.scan_time()];
    let solve = |errors: &Navigation| errors.solve(args.seed, &trajectory, &Pose::IDENTITY, span);
    let solution = navigation.as_ref().map(solve).transpose()?;

    progress.phase("building".into());
    let mut live = LiveScene::new(&Engine::new()?);
    live.set_motion_tolerance(args.motion_tolerance).context("--motion-tolerance").map_err(usage::wrong)?;
    timed(&mut seconds.build, || live.add_scene(&scene).map(drop))?;
    let moving = scene.is_moving();
    // The scene as the frame that starts at `time`, s, sees it.
    let mut build = |time: f64| {
        if moving {
            live.set_time(time, sensor.scan_time())?;
        }
        live.commit()
    };
    let built = timed(&mut seconds.build, || build(f64::from(frames.first) / fps))?;
    interrupt::check()?;
    warnings.absorb(built.report().clone());

    let times = frames.iter().map(|number| TakeFrame::new(number, f64::from(number) / fps)).collect();
    let take = Take {
        sensor: &sensor,
        trajectory: &trajectory,
        carrier: &trajectory,
        navigation: solution.as_ref(),
        frames: times,
        strips: None,
        options: scan_options(args, fields, f64::from(frames.step) / fps, &environment)
            .estimated_trajectory(solution.as_ref().map(|solution| solution.sensor.clone()))
            .clock_offset(solution.as_ref().map_or(0.0, |solution| solution.clock_offset)),
        output: &args.output,
        skies: scene.skies(),
    };
    if let Some((frame, beam)) = args.explain {
        drop(progress);
        let number = frame.unwrap_or(frames.first);
        let options = take.options_of(&TakeFrame::new(number, f64::from(number) / fps));
        let built = build(options.start_time)?;
        let explained =
            built.explain(&sensor, &trajectory, &options, beam).context("--explain").map_err(usage::wrong)?;
        return text::print(&text::lines(&explained));
    }

    let recorded = take.record(built, moving.then_some(&mut build), &progress, &mut seconds)?;
    drop(progress);
    let most_rays = recorded.one_limit().filter(|_| args.realtime);
    warnings.absorb(recorded.report);
    match recorded.nothing {
        Some(Nothing::Seen) => {
            let why = why_nothing(scene.bounds(), &sensor, trajectory.at(0.0).position, &environment);
            // Where there are several possible reasons.
            let more = if why.contains("perhaps") { "; --explain BEAM shows what happens to one beam" } else { "" };
            warnings.warn(why + more);
        }
        Some(Nothing::ButNoise) => warn_of_noise(recorded.points, &sensor, &mut warnings),
        None => warn_of_sky(&scene, &take.skies, [recorded.sky_points, recorded.points], &mut warnings),
    }

    let report = RunReport {
        beams: recorded.beams,
        rays: recorded.rays,
        most_rays: recorded.most_rays,
        limit: Some(1.0 / fps).filter(|_| args.realtime && sensor.spec().beam.sub_rays.is_adaptive()),
        points: recorded.points,
        with_points: args.output.requests_clouds() || !sonar,
        causes: if args.profile == Profile::Physical { recorded.causes } else { Vec::new() },
        frame: frame_word(&sensor),
        frames: frames.len(),
        threads,
        seconds,
        warnings: warnings.warnings,
        outputs: recorded.files,
        run: {
            let mut run = repeatable(args, (&labels, &materials), &take, (frames, fps), most_rays)?;
            if let Some(errors) = &navigation {
                run["navigation"] =
                    serde_json::to_value(errors).context("the errors of navigation cannot be reported")?;
            }
            run
        },
    };
    if args.verbose {
        print_details(&scene, &sensor, &trajectory);
    }
    if args.json {
        return args.output.print(&text::json(&report.to_json()));
    }
    if !args.quiet {
        report.warnings.iter().for_each(|warning| text::note(&format!("warning: {warning}")));
        args.output.print(&report.summary(&format!("{} in {}", shown::text(sensor.name()), args.scene.names())))?;
    }
    Ok(())
}

/// Where the sensor is while it scans, and when its frames start.
struct ScanCourse {
    trajectory: Trajectory,
    frames: FrameRange,
    /// Frames per second.
    fps: f64,
}

/// The course of a run; `path`: the poses over time, if they are given.
fn course(
    args: &ScanArgs,
    sensor: &Sensor,
    environment: &Environment,
    scene: &Scene,
    path: Option<Trajectory>,
    warnings: &mut Report,
) -> Result<ScanCourse> {
    let sonar = sensor.kind().makes_pings();
    let fps = frame_rate(args.fps, sensor).map_err(usage::wrong)?;
    let frames = match (args.frames, &path) {
        (Some(frames), _) => frames,
        // A sonar pings from the last pose, too; a sweep that begins there would not move.
        (None, Some(path)) => FrameRange::until(path.span().1, fps, sonar),
        (None, None) => FrameRange::ONE,
    };
    match &path {
        Some(path) => warn_of_end(path, frames, fps, warnings),
        None => warn_of_other_animation(scene, args.frames, fps, warnings),
    }
    let [from, to] = [frames.first, frames.last].map(|frame| f64::from(frame) / fps);
    let trajectory = match path {
        Some(path) => path,
        None => {
            let path = args.place.path(scene, from, to + sensor.scan_time()).map_err(usage::wrong)?;
            args.earth.place(path)?
        }
    };
    if sonar {
        let moves = args.trajectory.is_some();
        let pings = frames.iter().take(if moves { usize::MAX } else { 1 });
        place::check_submerged(&trajectory, environment, pings.map(|ping| f64::from(ping) / fps))?;
    }
    if args.output.piles_frames() && args.coordinates == Frame::Sensor && frames.len() > 1 {
        warn_of_piled_frames(&trajectory, [from, to], warnings);
    }
    Ok(ScanCourse { trajectory, frames, fps })
}

/// The options of every frame, one of which starts every `period` s.
fn scan_options(args: &ScanArgs, fields: FieldSet, period: f64, environment: &Environment) -> ScanOptions {
    ScanOptions::default()
        .fields(fields)
        .seed(args.seed)
        .strip(args.strip)
        .freeze(args.freeze)
        .deskew(args.deskew)
        .box_time(args.box_time)
        .frame_period(period)
        .organised(args.organised)
        .coordinates(args.coordinates)
        .order(args.order)
        .boxes(args.output.boxes())
        .time_budget(args.realtime.then_some(period))
        .profile(args.profile)
        .reflectance_source(args.reflectance_source)
        .environment(environment.clone())
}

/// The inputs of a run.
struct Loaded {
    sensor: Sensor,
    environment: Environment,
    labels: LabelRules,
    materials: MaterialRules,
    scene: Scene,
    /// Poses over time from a file.
    path: Option<Trajectory>,
    navigation: Option<Navigation>,
    /// Warnings about these poses.
    report: Report,
}

/// Reads everything a run needs, the scene last: it may take a long time.
fn load(args: &ScanArgs) -> Result<Loaded> {
    let sensor = args.sensor.load()?;
    check_options(args, &sensor).map_err(usage::wrong)?;
    let environment = args.weather.load(sensor.kind())?;
    let mut report = Report::default();
    let trajectory = args.trajectory.as_deref();
    let trajectory = trajectory.map(|file| args.earth.load("--trajectory", file, &mut report)).transpose()?;
    let navigation = args.navigation.load()?;
    if navigation.is_some() {
        let kind = sensor.kind();
        let error = || usage::wrong(anyhow!("--navigation: the sensor is a {kind}; allowed: LiDARs and depth cameras"));
        ensure!(kind.is_optical(), error());
    }
    let labels = args.scene.labels()?;
    let materials = args.scene.materials()?;
    let scene = args.scene.load(&labels, &materials)?;
    let path = trajectory.map(Trajectory::shifted_to_zero);
    Ok(Loaded { sensor, environment, labels, materials, scene, path, navigation, report })
}

/// Checks that the options go with each other and with `sensor`.
fn check_options(args: &ScanArgs, sensor: &Sensor) -> Result<()> {
    ensure!(
        !(args.organised && args.order == Order::Time),
        "--organised: its rows and columns are beams; allowed: --order beam"
    );
    args.output.check(args.fields.unwrap_or_default().of(sensor), sensor, args.profile)
}

/// `BEAM` or `FRAME,BEAM`.
fn frame_and_beam(text: &str) -> Result<(Option<u32>, u32), String> {
    let number = |text: &str| text.trim().parse().map_err(|_| "expected BEAM or FRAME,BEAM, such as 12,345".to_owned());
    match text.split_once(',') {
        None => Ok((None, number(text)?)),
        Some((frame, beam)) => Ok((Some(number(frame)?), number(beam)?)),
    }
}

/// The requested columns.
#[derive(Clone, Copy)]
struct FieldRequest {
    fields: FieldSet,
    /// Whether the default columns are among them.
    by_default: bool,
}

impl FieldRequest {
    fn parse(list: &str) -> echocast::Result<FieldRequest> {
        let by_default = list.split(',').any(|name| name.trim() == "default");
        Ok(FieldRequest { fields: FieldSet::parse(list)?, by_default })
    }

    /// The columns for a sensor.
    fn of(self, sensor: &Sensor) -> FieldSet {
        if self.by_default { self.fields.union(sensor.default_fields()) } else { self.fields }
    }
}

impl Default for FieldRequest {
    fn default() -> Self {
        FieldRequest { fields: FieldSet::default(), by_default: true }
    }
}

/// Frames per second: as requested, or else the sensor's rate.
fn frame_rate(requested: Option<f64>, sensor: &Sensor) -> Result<f64> {
    let period = sensor.beams().period;
    let fps = requested.unwrap_or(1.0 / period);
    ensure!(fps.is_finite() && fps > 0.0, "the sensor's period is {period} s: set the frames per second with --fps N");
    Ok(fps)
}

/// Warns if frames start after the last pose.
fn warn_of_end(trajectory: &Trajectory, frames: FrameRange, fps: f64, warnings: &mut Report) {
    let (_, end) = trajectory.span();
    let last_start = f64::from(frames.last) / fps;
    if last_start > end {
        warnings.warn(format!(
            "the last frame starts at {last_start:.3} s, but the trajectory ends at {end:.3} s: the sensor stays there"
        ));
    }
}

/// Warns if the points of several frames are shown in the frame of a sensor that has moved between the first and the
/// last one, at times `from` and `to`.
fn warn_of_piled_frames(trajectory: &Trajectory, [from, to]: [f64; 2], warnings: &mut Report) {
    if trajectory.at(from) != trajectory.at(to) {
        warnings.warn(
            "--preview: with --frame sensor, the frames of a moving sensor overlap; --frame world shows them in their \
             places",
        );
    }
}

/// Warns if no frames were requested although the scene moves.
fn warn_of_other_animation(scene: &Scene, requested: Option<FrameRange>, fps: f64, warnings: &mut Report) {
    let end = scene.timeline.end();
    let last = (end * fps).ceil() - 1.0;
    if requested.is_none() && last >= 1.0 {
        warnings.warn(format!(
            "the scene moves for {end:.3} s, one frame of {:.3} s is scanned: --frames 0:{last} scans all of it",
            1.0 / fps
        ));
    }
}

/// Warns if many of the points are on what seems to be a sky: it reflects like a wall.
fn warn_of_sky(scene: &Scene, skies: &[u32], [on_sky, points]: [usize; 2], warnings: &mut Report) {
    /// Fraction of all points.
    const MANY: f64 = 0.1;
    if on_sky as f64 <= MANY * points as f64 {
        return;
    }
    let names = skies.iter().filter_map(|&sky| scene.labels.instance.name(sky));
    let names: Vec<String> = names.take(3).map(|name| shown::text(name).into_owned()).collect();
    warnings.warn(format!(
        "{:.0} % of the points are on {}, which seems to be a sky: --hide {:?} leaves it out",
        100.0 * on_sky as f64 / points as f64,
        names.join(", "),
        names.first().map_or("", String::as_str)
    ));
}

/// Warns that a sonar receives nothing but noise, which accounts for all `points`, with possible reasons.
fn warn_of_noise(points: usize, sensor: &Sensor, warnings: &mut Report) {
    let finding = match points {
        0 => "nothing but noise is received".to_owned(),
        1 => "the only point is noise".to_owned(),
        _ => format!("all {} points are noise", text::thousands(points)),
    };
    let reach = sensor.spec().range.max_m.unwrap_or(f64::INFINITY);
    warnings.warn(format!(
        "{finding}; perhaps the sonar is below the bed or looks past the scene, or all of the scene is farther away than \
         range.max_m, {reach} m; --explain BEAM shows what happens to one beam"
    ));
}

/// The scenario that repeats this run; `most_rays`: most rays of a beam, if a time limit
/// decided on the same for all frames.
fn repeatable(
    args: &ScanArgs,
    (labels, materials): (&LabelRules, &MaterialRules),
    take: &Take,
    (frames, fps): (FrameRange, f64),
    most_rays: Option<u32>,
) -> Result<Value> {
    let place = match (&args.trajectory, args.place.to_json(take.trajectory)) {
        (Some(file), _) if file.as_os_str() != "-" => json!({ "file": shown::path(file) }),
        (Some(_), _) => {
            let row = |(time, pose): (f64, Pose)| {
                let (place, turned) = (pose.position.to_array(), pose.orientation.to_array());
                [&[time][..], &place, &turned].concat()
            };
            json!({ "poses": take.trajectory.clone().into_keys().into_iter().map(row).collect::<Vec<_>>() })
        }
        (None, place) => place,
    };
    let mut spec = take.sensor.spec().clone();
    if let Some(most) = most_rays.filter(|_| spec.beam.sub_rays.is_adaptive()) {
        spec.beam.sub_rays = SubRays::AdaptiveUpTo(most);
    }
    let spec = serde_json::to_value(spec).context("the sensor cannot be reported")?;
    let mut outputs = args.output.to_json();
    outputs.insert("style".into(), "files".into());
    Ok(json!({
        "folder": std::env::current_dir().ok().as_deref().map(shown::path),
        "scene": args.scene.to_json(labels, materials)?,
        "sensors": [{ "sensor": spec }],
        "environment": serde_json::to_value(&take.options.environment).context("the weather cannot be reported")?,
        "trajectory": place,
        "georeference": args.earth.to_json(),
        "frames": { "first": frames.first, "last": frames.last, "step": frames.step, "fps": fps },
        "profile": args.profile.name(),
        "reflectance_source": args.reflectance_source.map(|source| source.name()),
        "seed": args.seed,
        "fields": take.options.fields.iter().map(|info| info.name).collect::<Vec<_>>(),
        "frame": args.coordinates.name(),
        "order": args.order.name(),
        "freeze": args.freeze,
        "deskew": args.deskew,
        "boxes": args.box_time.name(),
        "motion_tolerance_m": args.motion_tolerance,
        "organised": args.organised,
        "outputs": [outputs],
    }))
}

/// What `--verbose` adds, on stderr: stdout belongs to the summary or the report.
fn print_details(scene: &Scene, sensor: &Sensor, trajectory: &Trajectory) {
    let beams = sensor.beams();
    let pose = trajectory.at(0.0);
    let [x, y, z] = pose.position.to_array();
    text::note(&format!(
        "scene: {} in {}, {}, {}",
        text::counted(scene.triangle_count(), "triangle"),
        text::counted(scene.objects.len(), "object"),
        text::counted(scene.materials.len(), "material"),
        text::counted(scene.textures().len(), "texture"),
    ));
    text::note(&format!(
        "sensor: {} ({}), {} x {} beams, a scan takes {}",
        sensor.name(),
        sensor.title(),
        text::thousands(beams.rows as usize),
        text::thousands(beams.columns as usize),
        duration(beams.period),
    ));
    let forward = pose.rotation().x_axis;
    text::note(&format!(
        "start: at {x:.3},{y:.3},{z:.3}, looking along {:.3},{:.3},{:.3}",
        forward.x, forward.y, forward.z
    ));
}
