//! A progress line on stderr for work that takes longer than a second.

use crate::interrupt;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal as _, stderr};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Work shorter than this shows nothing.
const PATIENCE: Duration = Duration::from_secs(1);

/// Time between two turns of the spinner.
const TICK: Duration = Duration::from_millis(100);

/// Shows what is being done; removed from the terminal when dropped.
pub struct ProgressLine {
    bar: ProgressBar,
    /// The thread that draws, and the sender that ends it when dropped.
    drawer: Option<(Sender<()>, JoinHandle<()>)>,
}

impl ProgressLine {
    /// Appears after a while if stderr is a terminal, unless `quiet` is set or no thread can be started for it.
    pub fn new(quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        bar.set_style(style("{spinner} {msg} {elapsed}"));
        let mut drawer = None;
        if !quiet && stderr().is_terminal() {
            let (end, ended) = mpsc::channel();
            let shown = bar.clone();
            let thread = thread::Builder::new().name("progress".into()).spawn(move || draw(&shown, &ended));
            drawer = thread.ok().map(|thread| (end, thread));
        }
        ProgressLine { bar, drawer }
    }

    /// Names the current work.
    pub fn phase(&self, doing: String) {
        self.bar.set_message(doing);
    }

    /// From now on counts `frames`, each of which is called a `noun`.
    pub fn count_frames(&self, frames: usize, noun: &str) {
        if frames > 1 {
            self.bar.set_length(frames as u64);
            let counted = format!("{{spinner}} {{bar:30}} {{pos}}/{{len}} {noun}s, {{msg}} {{elapsed}}, {{eta}} left");
            self.bar.set_style(style(&counted));
        }
    }

    /// One more frame is done.
    pub fn frame_done(&self) {
        self.bar.inc(1);
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        if let Some((end, thread)) = self.drawer.take() {
            drop(end);
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}

/// Draws `bar` until the sender of `ended` is dropped. Stops when the program is interrupted: it may end at any moment.
fn draw(bar: &ProgressBar, ended: &Receiver<()>) {
    let waits = |time| ended.recv_timeout(time) == Err(RecvTimeoutError::Timeout) && interrupt::check().is_ok();
    if waits(PATIENCE) {
        bar.set_draw_target(ProgressDrawTarget::stderr());
        bar.tick();
        while waits(TICK) {
            bar.tick();
        }
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).expect("the templates of this file are well-formed")
}
