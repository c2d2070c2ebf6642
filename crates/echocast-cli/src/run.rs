//! `echocast run`

use crate::import::{AssetArgs, Imported};
use crate::output::{FilesKeys, OutputArgs};
use crate::picture::PictureArgs;
use crate::progress::ProgressLine;
use crate::record::{Nothing, Take, TakeFrame, frame_word};
use crate::report::{RunReport, Seconds, timed};
use crate::text::{self, counted, duration, thousands};
use crate::{blender, input, interrupt, usage};
use anyhow::{Context as _, Result, anyhow, bail, ensure};
use echocast::scenario::set::{self, Event, Noticed, RunOptions, RunSummary};
use echocast::scenario::{FrameTime, Sample, Scan};
use echocast::{Error, Report, Scenario, Scene, shown};
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;

/// Make a set of samples from a scenario file: a scene, a rig of sensors, and what varies from sample to sample
///
/// Samples are made side by side on all cores. Each is the same alone, in any order, on any machine: its random numbers
/// are addressed by seed, sample, rule and object. A sample that fails is reported at the end; the others are made.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast run examples/scenarios/street.yaml -o street
  echocast run examples/scenarios/street.yaml --set samples=20 --resume -o street
  echocast run --check-output street
  echocast run examples/scenarios/street.yaml --sample 7 --preview sample.png --view perspective
  echocast run examples/scenarios/learn.yaml --set samples=2 -o learn
  echocast run examples/scenarios/street.yaml --samples 0:2 --set environment.fog.visibility_m=80 -o foggy
A set made on two machines:
  echocast run examples/scenarios/street.yaml --shard 0/2 -o shards
  echocast run examples/scenarios/street.yaml --shard 1/2 -o shards
  echocast run --finish shards
A scan repeated:
  echocast generate street -o street.glb
  echocast scan street.glb --sensor velodyne_vlp16 --camera Corner -o scan.las --json > report.json
  echocast run report.json")]
pub struct RunArgs {
    /// Scenario file (docs/scenario.md), the report of `echocast scan --json`, a survey of HELIOS++ (.xml), or `-` for
    /// standard input
    #[arg(value_name = "SCENARIO", required_unless_present_any = ["check_output", "finish"])]
    scenario: Option<PathBuf>,
    /// Samples A to B, both included, every STEPth [default: all]
    #[arg(long, value_name = "A:B[:STEP]", conflicts_with = "sample")]
    samples: Option<Range>,
    /// Only this sample
    #[arg(long, value_name = "N")]
    sample: Option<u64>,
    /// Part K of N of the samples, counted from 0; together the parts are the same files. Parts may be made at the same
    /// time, each by one run
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Continue where a run has stopped: samples whose files are there, with their sizes and digests, are not made
    /// again
    #[arg(long)]
    resume: bool,
    /// Folder of the set [default: that of the scenario, or one named after its file]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Change one key of the scenario by its path; repeatable
    #[arg(long, value_name = "KEY=VALUE", value_parser = input::key_value)]
    set: Vec<(String, String)>,
    /// Check the scenario and make its first sample, but write nothing
    #[arg(long, conflicts_with_all = ["samples", "shard", "resume", "output", "preview"])]
    check: bool,
    /// Check a finished set instead: that no sample is missing, and all files are as they were written
    #[arg(long, value_name = "FOLDER", conflicts_with = "scenario")]
    check_output: Option<PathBuf>,
    /// Complete a set whose shards are all there instead: check that all files are as they were written, and add tables
    /// and archives, manifest and report
    #[arg(long, value_name = "FOLDER", conflicts_with = "scenario")]
    finish: Option<PathBuf>,
    #[command(flatten)]
    assets: AssetArgs,
    #[command(flatten)]
    picture: PictureArgs,
    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print a line of JSON for each sample, and one for the whole run, on stdout
    #[arg(long)]
    json: bool,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
}

/// `A:B[:STEP]`.
#[derive(Clone, Copy)]
struct Range([u64; 3]);

impl FromStr for Range {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Result<Vec<u64>, _> = text.split(':').map(str::parse).collect();
        match numbers.as_deref() {
            Ok(&[first, last]) => Ok(Range([first, last, 1])),
            Ok(&[first, last, step]) => Ok(Range([first, last, step])),
            _ => Err("expected FIRST:LAST or FIRST:LAST:STEP, such as 0:999"),
        }
    }
}

/// `K/N`.
#[derive(Clone, Copy)]
struct Shard([u64; 2]);

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parts = text.split_once('/').and_then(|(part, parts)| Some([part.parse().ok()?, parts.parse().ok()?]));
        parts.map(Shard).ok_or("expected K/N, such as 3/16")
    }
}

/// `arguments` are those of the command line, `scene` what Blender has read.
pub fn run(args: &RunArgs, arguments: &[OsString], scene: Option<Scene>) -> Result<()> {
    if let Some(folder) = &args.check_output {
        let faults = set::check_folder(folder).context("--check-output")?;
        ensure!(faults.is_empty(), "--check-output {}: {}", shown::path(folder), some_of(&faults));
        return text::print(&format!("{}: complete and unchanged\n", shown::path(folder)));
    }
    if let Some(folder) = &args.finish {
        let report = set::finish(folder).context("--finish")?;
        report.warnings.iter().for_each(|warning| text::note(&format!("warning: {warning}")));
        return Ok(());
    }
    let survey = args.scenario.as_deref().filter(|file| has_ending(file, "xml"));
    if survey.is_none() && !args.assets.is_empty() {
        return Err(usage::wrong(anyhow!(
            "--assets: only surveys of HELIOS++ have any; allowed: with a survey (.xml)"
        )));
    }
    let imported = survey.map(|survey| Imported::load(survey, &args.assets, args.quiet)).transpose()?;
    let mut scenario = load(args, imported.as_ref())?;
    for (key, value) in &args.set {
        scenario.set(key, value).map_err(input::wrong_key).context("--set")?;
    }
    if let Some(file) = scenario.blend() {
        match scene {
            Some(scene) => scenario = scenario.with_scene(scene),
            None => return blender::run(&file, arguments),
        }
    }
    let of_files = scenario.output_of::<FilesKeys>("files")?;
    if args.check {
        input::set_threads(args.threads)?;
        let sample = scenario.sample(args.sample.unwrap_or(0))?;
        if of_files.is_none() {
            scenario.check_outputs(&sample)?;
        }
        return text::print(&described(&scenario, &sample));
    }
    if args.picture.preview.is_some() {
        return record(args, scenario, &OutputArgs::picture_only(&args.picture));
    }
    if let Some(keys) = of_files {
        if args.samples.is_some() || args.shard.is_some() || args.resume || args.output.is_some() {
            return Err(usage::wrong(anyhow!(
                "the scenario writes the files of one sample (style: files); allowed without --samples, --shard, --resume \
                 and --output"
            )));
        }
        let output = OutputArgs::from_keys(keys, scenario.folder()).context("outputs")?;
        return record(args, scenario, &output);
    }
    // The folder of an imported survey is temporary: the set is named after the survey.
    let of_survey = survey.map(|survey| survey.with_extension("")).and_then(|path| Some(path.file_name()?.into()));
    make_set(args, scenario, args.output.clone().or(of_survey))
}

fn has_ending(file: &Path, ending: &str) -> bool {
    file.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending))
}

fn load(args: &RunArgs, imported: Option<&Imported>) -> Result<Scenario> {
    if let Some(imported) = imported {
        return Ok(Scenario::load(imported.scenario())?);
    }
    let Some(file) = &args.scenario else { bail!("a scenario file is missing") };
    let parse = |text: &str| Scenario::from_yaml(text, "");
    input::file_or_stdin("SCENARIO", file, Scenario::load, parse)
}

/// Writes what was requested of one sample.
fn record(args: &RunArgs, scenario: Scenario, output: &OutputArgs) -> Result<()> {
    let threads = input::set_threads(args.threads)?;
    interrupt::listen().context("cannot listen for signals")?;
    let progress = ProgressLine::new(args.quiet);
    let mut seconds = Seconds::default();
    progress.phase("loading".into());
    let mut sample = timed(&mut seconds.load, || scenario.sample(args.sample.unwrap_or(0)))?;
    let mut report = Report::default();
    report.absorb(sample.report().clone());
    ensure!(
        sample.scans().len() == 1 || output.clouds() == 0,
        "outputs: the files of one sensor are written, and there are {}; allowed: the styles of sets",
        sample.scans().len()
    );
    let scan = sample.scans()[0].clone();
    let fields = scan.options(0).fields;
    let frames = take_frames(&scan);
    let longest = (0..scan.frames().len()).map(|frame| scan.pieces(frame)).max().unwrap_or(1);
    let first_piece = scan.piece(0, 0)?.sensor;
    output.check_room(fields, &first_piece, [frames.len(), longest])?;
    output.flight.check(scan.carrier())?;
    output.check(fields, scan.sensor(), scan.options(0).profile).map_err(|error| {
        // Without options for a picture, the scenario defines what is written.
        if args.picture.preview.is_some() { usage::wrong(error) } else { error }
    })?;
    let first = timed(&mut seconds.build, || sample.built(0, 0))?;
    let options = scan.options(0).boxes(output.boxes());
    let take = Take {
        sensor: scan.sensor(),
        trajectory: scan.trajectory(),
        carrier: scan.carrier(),
        navigation: scan.navigation(),
        frames,
        strips: scan.has_strips().then_some(&scan),
        options,
        output,
        // A scenario leaves out a sky explicitly.
        skies: Vec::new(),
    };
    let moving = sample.is_moving();
    // The first piece of each strip is as long as its others, or longer than the last.
    let mut scan_time = scan.sensor().scan_time();
    for frame in 0..scan.frames().len() {
        scan_time = scan_time.max(scan.piece(frame, 0)?.sensor.scan_time());
    }
    let drawn = sample.drawn().to_vec();
    let mut build = |time: f64| sample.built_at(time, scan_time);
    let recorded = take.record(first, moving.then_some(&mut build), &progress, &mut seconds)?;
    drop(progress);
    report.absorb(recorded.report);
    match recorded.nothing {
        Some(Nothing::Seen) => report.warn("no beam has a return"),
        Some(Nothing::ButNoise) => report.warn("nothing but noise is received"),
        None => {}
    }
    let report = RunReport {
        beams: recorded.beams,
        rays: recorded.rays,
        most_rays: recorded.most_rays,
        limit: None,
        points: recorded.points,
        with_points: true,
        causes: recorded.causes,
        frame: if scan.has_strips() { "strip" } else { frame_word(scan.sensor()) },
        frames: scan.frames().len(),
        threads,
        seconds,
        warnings: report.warnings,
        outputs: recorded.files,
        run: scenario.value().clone(),
    };
    if args.json {
        let mut json = report.to_json();
        json["drawn"] = drawn.into();
        return output.print(&text::json(&json));
    }
    if !args.quiet {
        report.warnings.iter().for_each(|warning| text::note(&format!("warning: {warning}")));
        let mut summary = report.summary(&shown::text(scan.name()));
        for entry in &drawn {
            writeln!(summary, "  {}", shown::text(&drawn_line(entry)))?;
        }
        output.print(&summary)?;
    }
    Ok(())
}

/// What is scanned at once, frame by frame and strip by strip.
fn take_frames(scan: &Scan) -> Vec<TakeFrame> {
    let pieces = (0..scan.frames().len()).flat_map(|frame| (0..scan.pieces(frame)).map(move |piece| [frame, piece]));
    let frame = |piece: [usize; 2]| {
        let (FrameTime { number, start }, strip) = scan.piece_time(piece[0], piece[1]);
        TakeFrame { number, start, strip, piece }
    };
    pieces.map(frame).collect()
}

/// Makes samples of a set in `folder`; in that of the scenario without one.
fn make_set(args: &RunArgs, scenario: Scenario, folder: Option<PathBuf>) -> Result<()> {
    interrupt::listen_patiently().context("cannot listen for signals")?;
    let progress = ProgressLine::new(args.quiet || args.json);
    progress.phase("loading".into());
    let options = RunOptions::default()
        .folder(folder)
        .samples(args.samples.map(|Range(range)| range).or(args.sample.map(|sample| [sample, sample, 1])))
        .shard(args.shard.map(|Shard(shard)| shard))
        .resume(args.resume)
        .threads(args.threads.map_or(0, usize::from));
    let failed = Mutex::new(0_u64);
    let watch = |event: Event| match event {
        Event::Begins(count) => {
            progress.phase("making".into());
            progress.count_frames(count as usize, "sample");
        }
        Event::Made(entry) => {
            if args.json {
                let line = json!({
                    "sample": entry.sample, "points": entry.points, "error": entry.error,
                    "files": entry.files.iter().map(|file| &file.path).collect::<Vec<_>>(),
                });
                // The samples are made even if nothing reads the lines.
                let _ = text::print(&format!("{line}\n"));
            }
            if entry.error.is_some() {
                let mut failed = failed.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                *failed += 1;
                progress.phase(format!("{failed} failed,"));
            }
            progress.frame_done();
        }
        Event::Found(_) => progress.frame_done(),
        _ => {}
    };
    let summary = set::run(scenario, &options, &watch).map_err(|error| match &error {
        // Options of this command; the other names are keys of the scenario.
        Error::InvalidParameter { name, .. } if ["samples", "shard"].contains(&name.as_str()) => usage::wrong(error),
        _ => error.into(),
    })?;
    drop(progress);
    if args.json {
        text::print(&format!("{}\n", summary_json(&summary)))?;
    } else if !args.quiet {
        for Noticed { warning, samples, first, .. } in &summary.warnings {
            let whose = match samples {
                0 => String::new(),
                1 => format!(" (sample {first})"),
                _ => format!(" ({samples} samples, the first is {first})"),
            };
            text::note(&format!("warning: {warning}{whose}"));
        }
        text::print(&summarised(&summary)?)?;
    }
    if let Some((sample, error)) = summary.failed.first() {
        let others = summary.failed.len() - 1;
        let more = if others > 0 { format!(" (and {} more)", counted(others, "sample")) } else { String::new() };
        bail!("sample {sample} has failed: {error}{more}");
    }
    Ok(())
}

fn summarised(summary: &RunSummary) -> Result<String> {
    let made = summary.made + summary.failed.len() as u64;
    let mut text = format!(
        "{} made in {} ({:.1} a second, {}), {} points\n",
        counted(made as usize, "sample"),
        duration(summary.seconds),
        made as f64 / summary.seconds,
        counted(summary.threads, "thread"),
        thousands(summary.points as usize),
    );
    if summary.found > 0 {
        writeln!(text, "  {} were there", counted(summary.found as usize, "sample"))?;
    }
    for (sample, error) in summary.failed.iter().take(10) {
        writeln!(text, "  sample {sample} has failed: {error}")?;
    }
    let folder = shown::path(&summary.folder);
    match summary.complete {
        true => writeln!(text, "  {folder}: complete, see report.html")?,
        false => writeln!(text, "  {folder}: not complete yet")?,
    }
    Ok(text)
}

fn summary_json(summary: &RunSummary) -> Value {
    json!({
        "folder": shown::path(&summary.folder),
        "made": summary.made,
        "found": summary.found,
        "failed": summary.failed.iter().map(|(sample, error)| json!({"sample": sample, "error": error})).collect::<Vec<_>>(),
        "points": summary.points,
        "seconds": summary.seconds,
        "threads": summary.threads,
        "complete": summary.complete,
        "warnings": summary.warnings.iter().map(|noticed| &noticed.warning).collect::<Vec<_>>(),
    })
}

/// A summary of what a scenario would do.
fn described(scenario: &Scenario, sample: &Sample) -> String {
    let mut text =
        format!("{}, {}\n", counted(scenario.samples() as usize, "sample"), counted(sample.scans().len(), "sensor"));
    for scan in sample.scans() {
        let pose = scan.trajectory().at(scan.frames().first().map_or(0.0, |frame| frame.start)).position;
        // Writing to a text does not fail.
        let _ = writeln!(
            text,
            "  {}: {}, {}, starts at {:.3},{:.3},{:.3}",
            shown::text(scan.name()),
            shown::text(scan.sensor().title()),
            counted(scan.frames().len(), if scan.has_strips() { "strip" } else { frame_word(scan.sensor()) }),
            pose.x,
            pose.y,
            pose.z
        );
    }
    for warning in &sample.report().warnings {
        let _ = writeln!(text, "  warning: {}", shown::text(warning));
    }
    for entry in sample.drawn() {
        let _ = writeln!(text, "  {}", shown::text(&drawn_line(entry)));
    }
    text
}

/// The values drawn for a rule, on one line: `move Chair_*, Chair_2: moved_m [0.1, 0, 0]`.
fn drawn_line(entry: &Value) -> String {
    let word = |key: &str| entry[key].as_str().unwrap_or_default().to_owned();
    let values: Vec<String> = entry
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(key, _)| !["rule", "object", "key"].contains(&key.as_str()))
        .map(|(key, value)| format!("{key} {value}"))
        .collect();
    let about = if entry["object"].is_null() { word("key") } else { word("object") };
    format!("{}, {about}: {}", word("rule"), values.join(", "))
}

/// The first of some sentences, and the number of the others.
fn some_of(sentences: &[String]) -> String {
    const SHOWN: usize = 3;
    let first = sentences[..sentences.len().min(SHOWN)].join("; ");
    match sentences.len().saturating_sub(SHOWN) {
        0 => first,
        more => format!("{first}; and {more} more"),
    }
}
