//! A progress line on stderr, for people who wait longer than a second.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal as _, stderr};
use std::thread;
use std::time::Duration;

/// Work shorter than this shows nothing.
const PATIENCE: Duration = Duration::from_secs(1);

/// What is being done right now; gone when dropped.
pub struct Progress(ProgressBar);

impl Progress {
    /// Shows itself after a while if stderr is a terminal, unless `quiet`.
    pub fn new(quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        bar.set_style(style("{spinner} {msg} {elapsed}"));
        if !quiet && stderr().is_terminal() {
            let shown = bar.clone();
            thread::spawn(move || {
                thread::sleep(PATIENCE);
                if !shown.is_finished() {
                    shown.set_draw_target(ProgressDrawTarget::stderr());
                    shown.enable_steady_tick(Duration::from_millis(100));
                }
            });
        }
        Progress(bar)
    }

    /// Names what is done now.
    pub fn phase(&self, doing: String) {
        self.0.set_message(doing);
    }

    /// From now on there are `frames` to count, each of which is a `noun`.
    pub fn count_frames(&self, frames: usize, noun: &str) {
        if frames > 1 {
            self.0.set_length(frames as u64);
            let counted = format!("{{spinner}} {{bar:30}} {{pos}}/{{len}} {noun}s, {{msg}} {{elapsed}}, {{eta}} left");
            self.0.set_style(style(&counted));
        }
    }

    /// One more frame is done.
    pub fn frame_done(&self) {
        self.0.inc(1);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).expect("the templates of this file are well-formed")
}
