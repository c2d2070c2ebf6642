//! `echocast plan`

use crate::flight::EarthArgs;
use crate::input::{self, has_ending, key_value, positive};
use crate::text::{self, counted, thousands};
use crate::{interrupt, names, picture, usage};
use anyhow::{Context as _, Result, anyhow, ensure};
use echocast::preview::{self, PreviewOptions};
use echocast::scenario::{Sample, Scan};
use echocast::survey::SurveyPlan;
use echocast::{Field, Scenario, shown};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Plan a laser survey: strips over an area, and what they will measure, before anything is scanned
///
/// Prints swath, spacings, densities, number and length of strips, times, pulses, points and bytes, and what a surveyor
/// would be warned of.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate landscape --size 60,60 -o hills.glb
  echocast plan hills.glb --sensor riegl_vux1uav22 --height 30 --speed 8 --overlap 0.3 --half-angle 45
  echocast plan hills.glb --sensor riegl_vux1uav22 --set pattern.pulse_rate_hz=50000 --height 30 --speed 15 \\
    -o plan.yaml --preview plan.png
  echocast run plan.yaml -o survey
  echocast plan plan.yaml --set trajectory.plan.speed_m_s=12")]
pub struct PlanArgs {
    /// Scene files, with `--sensor` and `--height`; or a scenario with `trajectory: {plan: …}`
    #[arg(required = true, value_name = "SCENE|SCENARIO")]
    files: Vec<PathBuf>,
    /// Scanner: a preset (`echocast sensors` lists them) or a sensor file
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,
    /// Change one parameter of the scanner, or one key of the scenario, by its path; repeatable
    #[arg(long, value_name = "KEY=VALUE", value_parser = key_value)]
    set: Vec<(String, String)>,
    /// Area to cover: least x and y, greatest x and y, m [default: all of the scene]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = area, allow_hyphen_values = true)]
    area: Option<Area>,
    /// Height, m
    #[arg(long, value_name = "M", value_parser = positive)]
    height: Option<f64>,
    /// What the height is above: `ground`, which is followed along each strip, `flat`, the mean of the ground, or `sea`,
    /// z = 0 [default: ground]
    #[arg(long, value_name = "WHAT", value_parser = ["ground", "flat", "sea"])]
    above: Option<String>,
    /// Speed over ground, m/s
    #[arg(long, value_name = "M/S", value_parser = positive)]
    speed: Option<f64>,
    /// Heading of the first strip, degrees clockwise from north (+y) [default: that with the fewest strips]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// Part of the swath that neighbouring strips share [default: 0.3]
    #[arg(long, value_name = "PART", conflicts_with = "density")]
    overlap: Option<f64>,
    /// Wanted mean density of pulses, 1/m^2, instead of an overlap
    #[arg(long, value_name = "N", value_parser = positive)]
    density: Option<f64>,
    /// Strips across the others: as many as cover the area once more, or N
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true)]
    crossing: Option<Option<u16>>,
    /// What carries the scanner [default: linear]
    #[arg(long, value_name = "KIND", value_parser = ["linear", "multicopter", "ground_vehicle"])]
    platform: Option<String>,
    /// Greatest angle from straight down that counts as swath, degrees [default: that of the scanner, at most 60]
    #[arg(long, value_name = "DEG", value_parser = positive)]
    half_angle: Option<f64>,
    #[command(flatten)]
    earth: EarthArgs,
    /// Write a scenario that flies and scans the plan with `echocast run`
    #[arg(short, long, value_name = "FILE.yaml")]
    output: Option<PathBuf>,
    /// Draw the plan over the scene from above
    #[arg(long, value_name = "FILE.png")]
    preview: Option<PathBuf>,
    /// Print one JSON object, with lengths in metres
    #[arg(long)]
    json: bool,
}

impl PlanArgs {
    /// The first option given of those that describe a plan over scene files.
    fn of_scene_files(&self) -> Option<&'static str> {
        let given = [
            ("--sensor", self.sensor.is_some()),
            ("--area", self.area.is_some()),
            ("--height", self.height.is_some()),
            ("--above", self.above.is_some()),
            ("--speed", self.speed.is_some()),
            ("--heading", self.heading.is_some()),
            ("--overlap", self.overlap.is_some()),
            ("--density", self.density.is_some()),
            ("--crossing", self.crossing.is_some()),
            ("--platform", self.platform.is_some()),
            ("--half-angle", self.half_angle.is_some()),
        ];
        given.into_iter().find_map(|(option, is_given)| is_given.then_some(option)).or(self.earth.first_given())
    }
}

/// Least x and y, greatest x and y, m.
type Area = [f64; 4];

fn area(text: &str) -> Result<Area, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let found = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    found.ok_or_else(|| "expected four numbers in metres, such as 0,0,200,100".to_owned())
}

pub fn run(args: &PlanArgs) -> Result<()> {
    interrupt::listen().context("cannot listen for signals")?;
    let options = PreviewOptions::default();
    if let Some(file) = &args.preview {
        picture::check_picture("--preview", file, &options).map_err(usage::wrong)?;
    }
    if let Some(file) = &args.output {
        ensure!(
            has_ending(file, &["yaml", "yml"]),
            usage::wrong(anyhow!("-o {}: scenarios are written as .yaml", shown::path(file)))
        );
    }
    for file in args.output.iter().chain(&args.preview) {
        let inputs = args.files.iter().map(Path::new).chain(args.sensor.as_deref().map(Path::new));
        inputs.into_iter().try_for_each(|input| names::check_kept(file, input)).map_err(usage::wrong)?;
    }
    let scenario = scenario(args)?;
    let mut sample = scenario.sample(0)?;
    let Some(plan) = sample.plan().cloned() else {
        return Err(usage::wrong(anyhow!(
            "{}: has no plan; allowed: a scenario with trajectory: {{plan: …}}, or scene files with --sensor",
            shown::path(&args.files[0])
        )));
    };
    let scan = sample.scans()[0].clone();
    let mut files = Vec::new();
    if let Some(file) = &args.output {
        scenario.save(file).context("-o")?;
        files.push(file);
    }
    if let Some(file) = &args.preview {
        let built = sample.built(0, 0)?;
        preview::write_survey(sample.loaded(), &built, &plan, file, options.width).context("--preview")?;
        files.push(file);
    }
    if args.json {
        return text::print(&text::json(&to_json(&plan, &scan, &sample)));
    }
    sample.report().warnings.iter().for_each(|warning| text::note(&format!("warning: {warning}")));
    let mut text = summary(&plan, &scan);
    for file in files {
        writeln!(text, "  {}", shown::path(file))?;
    }
    text::print(&text)
}

/// The scenario that is given, or that the options describe.
fn scenario(args: &PlanArgs) -> Result<Scenario> {
    if let [file] = &args.files[..]
        && has_ending(file, &["yaml", "yml", "json"])
    {
        if let Some(option) = args.of_scene_files() {
            let message = format!("{option}: is for scene files; allowed: --set of keys of the scenario");
            return Err(usage::wrong(anyhow!(message)));
        }
        let mut scenario = Scenario::load(file)?;
        for (key, value) in &args.set {
            scenario.set(key, value).map_err(input::wrong_key).context("--set")?;
        }
        return Ok(scenario);
    }
    let missing = |option: &str| usage::wrong(anyhow!("{option}: is missing; allowed: with scene files"));
    let sensor = args.sensor.as_ref().ok_or_else(|| missing("--sensor"))?;
    let height = args.height.ok_or_else(|| missing("--height"))?;
    let speed = args.speed.ok_or_else(|| missing("--speed"))?;
    let mut plan = json!({ "height_m": height, "speed_m_s": speed });
    let mut put = |key: &str, value: Option<Value>| {
        if let Some(value) = value {
            plan[key] = value;
        }
    };
    put("area", args.area.map(|[x0, y0, x1, y1]| json!({ "min_m": [x0, y0], "max_m": [x1, y1] })));
    put("above", args.above.as_deref().map(Value::from));
    put("heading_deg", args.heading.map(Value::from));
    put("overlap", args.overlap.map(Value::from));
    put("density_per_m2", args.density.map(Value::from));
    put("crossing", args.crossing.map(|count| count.map_or(Value::Bool(true), Value::from)));
    put("platform", args.platform.as_deref().map(Value::from));
    put("half_angle_deg", args.half_angle.map(Value::from));
    let set: Map<String, Value> = args.set.iter().map(|(key, value)| (key.clone(), yaml_value(value))).collect();
    let mut entry = json!({ "sensor": sensor });
    if !set.is_empty() {
        entry["set"] = set.into();
    }
    let mut keys = Map::new();
    keys.insert("scene".into(), json!({ "files": text::paths(&args.files) }));
    keys.insert("sensors".into(), json!([entry]));
    keys.insert("trajectory".into(), json!({ "plan": plan }));
    keys.extend(args.earth.to_json().map(|section| ("georeference".to_owned(), section)));
    keys.insert("outputs".into(), json!([{ "style": "plain", "format": "laz" }]));
    Ok(Scenario::from_yaml(&Value::Object(keys).to_string(), "")?)
}

/// A value as YAML reads it: numbers, truth values, lists and sections, otherwise text.
fn yaml_value(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|_| text.into())
}

/// Bytes of a point in LAS files with the columns of `scan`.
fn las_bytes(scan: &Scan) -> usize {
    /// Of point format 6 (LAS 1.4 R15, table 11), and what colours add in format 7.
    const RECORD: usize = 30;
    const COLOURS: usize = 6;
    let has_colours = scan.options(0).fields.contains_any(&[Field::Red, Field::Green, Field::Blue]);
    let record = RECORD + if has_colours { COLOURS } else { 0 };
    let extra = scan.options(0).fields.iter().filter(|info| info.las.is_none()).map(|info| info.kind.size());
    record + extra.sum::<usize>()
}

/// Roll for which the safe width of a swath is given, degrees.
const ROLL_DEG: f64 = 2.0;

fn summary(plan: &SurveyPlan, scan: &Scan) -> String {
    let mut text = format!("{}: {} m, {} m/s\n", shown::text(scan.sensor().title()), plan.height_m, plan.speed_m_s);
    let mut line = |words: String| {
        text.push_str("  ");
        text.push_str(&words);
        text.push('\n');
    };
    if plan.swath_m > 0.0 {
        let safe = plan.swath.safe_width_m(plan.height_m, ROLL_DEG.to_radians());
        let spacing = plan.spacing_m.map_or(String::new(), |spacing| {
            format!(", strips every {spacing:.1} m, overlap {:.0} %", 100.0 * (1.0 - spacing / plan.swath_m))
        });
        line(format!("swath {:.1} m, {safe:.1} m with a roll of {ROLL_DEG} degrees{spacing}", plan.swath_m));
        let edge = plan.swath.edges_rad.map(f64::abs).into_iter().fold(0.0, f64::max);
        let across = [0.0, edge].map(|angle| plan.swath.spacing_m(angle, plan.height_m));
        if let (Some(along), [Some(nadir), Some(edge)]) = (plan.line_spacing_m(), across) {
            line(format!("points {along:.3} m along, {nadir:.3} m across below, {edge:.3} m at the edges"));
        }
        let [nadir, mean] = plan.densities();
        line(format!("density {nadir:.1} per m2 below, {mean:.1} mean of a swath"));
        if let Some(found) = &plan.coverage {
            line(format!(
                "area {} m2, {:.1} % covered, density {:.1} per m2 mean, {:.1} or more in nine tenths of it",
                thousands(found.area_m2 as usize),
                100.0 * found.covered,
                found.mean_per_m2,
                found.least_per_m2
            ));
        }
        let ([near, far], zone) = plan.zones();
        let zones = if near == far { format!("zone {near}") } else { format!("zones {near} to {far}") };
        line(format!("multiple time around: {zones} of {zone:.1} m"));
    }
    if let Some(([pulse, step], _)) = plan.swath.panorama {
        let steps = [10.0, 50.0, 100.0]
            .map(|range| format!("{:.1} x {:.1} mm at {range} m", 1e3 * pulse * range, 1e3 * step * range));
        line(format!("points every {}", steps.join(", ")));
    }
    let length: f64 = plan.strips.iter().map(|strip| strip.length_m).sum();
    line(format!(
        "{}, {:.0} m, {} on them, {} in all",
        counted(plan.strips.len(), "strip"),
        length,
        clock(plan.on_line_s()),
        clock(plan.total_s())
    ));
    let bytes = plan.points * las_bytes(scan) as f64;
    line(format!(
        "{} pulses, {} points, {} of LAS, a third to a sixth of it of LAZ",
        thousands(plan.pulses as usize),
        thousands(plan.points as usize),
        size(bytes)
    ));
    text
}

/// `12:34 min`.
fn clock(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole / 3600 {
        0 => format!("{}:{:02} min", whole / 60, whole % 60),
        hours => format!("{hours}:{:02}:{:02} h", whole / 60 % 60, whole % 60),
    }
}

/// Bytes with a suitable unit.
fn size(bytes: f64) -> String {
    match bytes {
        b if b >= 1e9 => format!("{:.1} GB", b / 1e9),
        b if b >= 1e6 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.1} kB", b / 1e3),
    }
}

fn to_json(plan: &SurveyPlan, scan: &Scan, sample: &Sample) -> Value {
    let [nadir, mean] = plan.densities();
    let moving = plan.swath_m > 0.0;
    let edge = plan.swath.edges_rad.map(f64::abs).into_iter().fold(0.0, f64::max);
    let ([near, far], zone) = plan.zones();
    let strips: Vec<Value> = plan
        .strips
        .iter()
        .map(|strip| {
            json!({
                "strip": strip.strip, "from_s": strip.from_s, "to_s": strip.to_s, "length_m": strip.length_m,
                "start_m": strip.start_m.to_array(), "end_m": strip.end_m.to_array(),
            })
        })
        .collect();
    json!({
        "sensor": scan.sensor().name(),
        "height_m": plan.height_m,
        "speed_m_s": plan.speed_m_s,
        "swath_m": moving.then_some(plan.swath_m),
        "safe_width_m": moving.then(|| plan.swath.safe_width_m(plan.height_m, ROLL_DEG.to_radians())),
        "strip_spacing_m": plan.spacing_m,
        "along_m": plan.line_spacing_m(),
        "across_below_m": plan.swath.spacing_m(0.0, plan.height_m).filter(|_| moving),
        "across_edge_m": plan.swath.spacing_m(edge, plan.height_m).filter(|_| moving),
        "density_below_per_m2": moving.then_some(nadir),
        "density_swath_per_m2": moving.then_some(mean),
        "area": plan.coverage.as_ref().map(|found| json!({
            "area_m2": found.area_m2, "covered": found.covered, "density_per_m2": found.mean_per_m2,
            "least_density_per_m2": found.least_per_m2,
        })),
        "zones": moving.then_some([near, far]),
        "zone_m": moving.then_some(zone),
        "steps_rad": plan.swath.panorama.map(|(steps, _)| steps),
        "strips": strips,
        "on_line_s": plan.on_line_s(),
        "total_s": plan.total_s(),
        "pulses": plan.pulses.round(),
        "points": plan.points.round(),
        "las_bytes": (plan.points * las_bytes(scan) as f64).round(),
        "warnings": sample.report().warnings,
    })
}
