//! The report of a run, as JSON and as text.

use crate::text::{self, counted, duration, thousands};
use echocast::shown;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Instant;

/// Wall-clock seconds, by kind of work.
#[derive(Default)]
pub struct Seconds {
    pub load: f64,
    pub build: f64,
    pub scan: f64,
    pub write: f64,
}

/// Runs `work` and adds the seconds it took to `to`.
pub fn timed<T>(to: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *to += start.elapsed().as_secs_f64();
    result
}

/// The report of a scan.
pub struct RunReport {
    pub beams: usize,
    pub rays: u64,
    /// Most rays that a beam was given, least and greatest of all frames.
    pub most_rays: [u32; 2],
    /// The time that a frame may take, s, if that decided on them.
    pub limit: Option<f64>,
    pub points: usize,
    /// Whether points were requested: pictures of pings need none.
    pub with_points: bool,
    /// Causes of points, and how many points each has; empty if not reported.
    pub causes: Vec<(&'static str, usize)>,
    /// What a frame of the sensor is called.
    pub frame: &'static str,
    pub frames: usize,
    pub threads: usize,
    pub seconds: Seconds,
    pub warnings: Vec<String>,
    pub outputs: Vec<PathBuf>,
    /// Everything needed to repeat the run.
    pub run: Value,
}

impl RunReport {
    /// The object of `--json`.
    pub fn to_json(&self) -> Value {
        let Seconds { load, build, scan, write } = self.seconds;
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "beams": self.beams,
            "rays": self.rays,
            "most_rays": self.most_rays,
            "points": self.points,
            "frames": self.frames,
            "threads": self.threads,
            "seconds": { "load": load, "build": build, "scan": scan, "write": write },
            "warnings": self.warnings,
            "outputs": text::paths(&self.outputs),
            "run": self.run,
        })
    }

    /// A few lines: counts, times, files. `title` says what was scanned.
    pub fn summary(&self, title: &str) -> String {
        let Seconds { load, build, scan, write } = self.seconds;
        let points = if self.with_points { counted(self.points, "point") + " of " } else { String::new() };
        // Where every beam is one ray, the number of rays adds nothing; radars have none that could be counted.
        let rays = if self.rays == self.beams as u64 || self.rays == 0 {
            String::new()
        } else {
            format!(" ({})", counted(self.rays as usize, "ray"))
        };
        let rate = match self.rays {
            0 => String::new(),
            rays => format!("{:.1} M rays/s, ", rays as f64 / scan / 1e6),
        };
        let mut text = format!(
            "{title}: {points}{}{rays}, {}\n  load {}, build {}, scan {} ({rate}{}), write {}\n",
            counted(self.beams, "beam"),
            counted(self.frames, self.frame),
            duration(load),
            duration(build),
            duration(scan),
            counted(self.threads, "thread"),
            duration(write),
        );
        if let Some(limit) = self.limit {
            let [least, most] = self.most_rays;
            let rays = if least == most { most.to_string() } else { format!("{least} to {most}") };
            let (taken, limit) = (duration(scan / self.frames.max(1) as f64), duration(limit));
            text.push_str(&format!("  real time: {rays} rays a beam at most, {taken} a frame that may take {limit}\n"));
        }
        if !self.causes.is_empty() {
            let listed: Vec<String> =
                self.causes.iter().map(|(name, count)| format!("{} {name}", thousands(*count))).collect();
            text.push_str(&format!("  points by cause: {}\n", listed.join(", ")));
        }
        /// If there are more files, only the first and the last are listed.
        const MOST_LINES: usize = 12;
        match self.outputs.as_slice() {
            [first, .., last] if self.outputs.len() > MOST_LINES => {
                let files = counted(self.outputs.len(), "file");
                text.push_str(&format!("  {} ... {} ({files})\n", shown::path(first), shown::path(last)));
            }
            files => files.iter().for_each(|file| text.push_str(&format!("  {}\n", shown::path(file)))),
        }
        text
    }
}
