//! `echocast bench`

use crate::input::{self, SceneArgs, SensorArgs};
use crate::place::{self, PlaceArgs};
use crate::text::{self, counted, duration};
use crate::usage;
use crate::weather::WeatherArgs;
use anyhow::Result;
use echocast::{BareLoop, PointCloud, ScanOptions, Sensor, Trajectory};
use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Measure how fast a scene is scanned on this machine: a few seconds of warm scans, compared with the bare Embree loop
/// on the same rays, and, for beams with an adaptive number of rays, with one ray a beam
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate street -o street.glb
  echocast bench street.glb --sensor velodyne_vls128 --camera Corner --threads 1
  echocast generate seabed -o lake.glb
  echocast bench lake.glb --sensor sss_450 --camera Sonar")]
pub struct BenchArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    weather: WeatherArgs,
    #[command(flatten)]
    place: PlaceArgs,
    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print the figures as one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// Interleaved rounds of both loops; the machine may be busy with other things.
const ROUNDS: usize = 15;
/// A round of one loop lasts at least this long.
const ROUND: Duration = Duration::from_millis(100);

pub fn run(args: &BenchArgs) -> Result<()> {
    let threads = input::set_threads(args.threads)?;
    let sensor = args.sensor.load()?;
    let environment = args.weather.load(sensor.kind())?;
    let scene = args.scene.load(&args.scene.labels()?, &args.scene.materials()?)?;
    let pose = args.place.path(&scene, 0.0, 0.0).map_err(usage::wrong)?.at(0.0);
    let trajectory = Trajectory::fixed(pose);
    if sensor.kind().is_under_water() {
        place::check_submerged(&trajectory, &environment, [0.0].into_iter())?;
    }
    let built = scene.build()?;

    let mut bare = BareLoop::new(&built, &sensor, pose);
    let options = ScanOptions::default().environment(environment);
    let mut cloud = PointCloud::default();
    let mut scan = |sensor: &Sensor| {
        built.scan_into(sensor, &trajectory, &options, &mut cloud)?;
        anyhow::Ok(cloud.rays)
    };
    // The bare loop has as many rays as a scan with one for each beam.
    let one_ray = if sensor.spec().beam.sub_rays.is_adaptive() {
        let mut one_ray = sensor.clone();
        one_ray.set("beam.sub_rays", "1")?;
        Some(one_ray)
    } else {
        None
    };
    let traced = scan(&sensor)?;
    bare.run();

    let [mut scans, mut bares, mut plains] = [const { Vec::new() }; 3];
    for _ in 0..ROUNDS {
        bares.push(round(|| {
            bare.run();
            Ok(())
        })?);
        scans.push(round(|| scan(&sensor).map(drop))?);
        if let Some(one_ray) = &one_ray {
            plains.push(round(|| scan(one_ray).map(drop))?);
        }
    }
    let makes_pings = sensor.kind().makes_pings();
    let beams = sensor.beams().len();
    // For a sonar those that are sent; the bare loop has as many.
    let rays = if makes_pings { bare.len() } else { traced as usize };
    let wall = Figures::of(scans.iter().map(|time| time.wall));
    let cpu = Figures::of(scans.iter().map(|time| time.cpu));
    let bare_cpu = Figures::of(bares.iter().map(|time| time.cpu));
    let over = |scans: &[Time]| Figures::of(bares.iter().zip(scans).map(|(bare, scan)| bare.cpu / scan.cpu)).median;
    let ratio = over(&scans);
    let plain = one_ray.map(|_| (Figures::of(plains.iter().map(|time| time.cpu)), over(&plains)));
    if args.json {
        let figures = json!({
            "beams": beams,
            "rays": rays,
            "threads": threads,
            "seconds_per_scan": wall.to_json(),
            "cpu_seconds_per_scan": cpu.to_json(),
            "bare_cpu_seconds_per_scan": bare_cpu.to_json(),
            "ratio": ratio,
            "one_ray_cpu_seconds_per_scan": plain.as_ref().map(|(cpu, _)| cpu.to_json()),
            "one_ray_ratio": plain.as_ref().map(|&(_, ratio)| ratio),
        });
        return text::print(&format!("{figures:#}\n"));
    }
    let plain = plain.map_or_else(String::new, |(cpu, ratio)| {
        let (best, median) = (duration(cpu.best), duration(cpu.median));
        format!("one ray, CPU best {best}, median {median}, ratio {ratio:.2} (beam.sub_rays=1)\n")
    });
    text::print(&format!(
        "{} in {}: {}, {}, {}, default columns\n\
         scan, wall  best {}, median {}: {:.1} M {}/s\n\
         scan, CPU   best {}, median {}\n\
         bare, CPU   best {}, median {} (only Embree, {})\n\
         ratio       {ratio:.2} (bare / scan, CPU time, median of {ROUNDS} interleaved rounds)\n\
         {plain}",
        sensor.name(),
        args.scene.names(),
        counted(beams, "beam"),
        counted(rays, "ray"),
        counted(threads, "thread"),
        duration(wall.best),
        duration(wall.median),
        if makes_pings { rays } else { beams } as f64 / wall.median / 1e6,
        if makes_pings { "rays" } else { "beams" },
        duration(cpu.best),
        duration(cpu.median),
        duration(bare_cpu.best),
        duration(bare_cpu.median),
        if makes_pings { "these rays" } else { "one ray a beam" },
    ))
}

/// Seconds per call.
struct Time {
    wall: f64,
    cpu: f64,
}

/// Repeats `work` for a round.
fn round(mut work: impl FnMut() -> Result<()>) -> Result<Time> {
    let (start, cpu) = (Instant::now(), cpu_seconds());
    let mut calls = 0.0;
    while calls == 0.0 || start.elapsed() < ROUND {
        work()?;
        calls += 1.0;
    }
    Ok(Time { wall: start.elapsed().as_secs_f64() / calls, cpu: (cpu_seconds() - cpu) / calls })
}

/// Processor time of all threads of this process, s.
fn cpu_seconds() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

struct Figures {
    best: f64,
    median: f64,
}

impl Figures {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        Figures { best: values[0], median: values[values.len() / 2] }
    }

    fn to_json(&self) -> Value {
        json!({ "best": self.best, "median": self.median })
    }
}
