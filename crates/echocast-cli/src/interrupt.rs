//! Ctrl-C, termination, a terminal that closes: the work is cancelled; unfinished files are removed, older ones stay.
//! Out of memory, the program ends at once.

use crate::usage::{self, INTERRUPTED};
use echocast::{Error, export};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::{flag, low_level};
use std::io::{self, Cursor, IsTerminal as _, Write as _, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use std::{fs, thread};

/// How long the work may continue before it checks for a signal.
const PATIENCE: Duration = Duration::from_secs(1);

/// Whether the next signal ends the program in its handler.
static LEAVING: AtomicBool = AtomicBool::new(false);

/// From now on a signal sets [`export::cancel_flag`], which the work checks from time to time; a second signal, or work
/// that does not check in time, ends the program where it is, without destructors, after removing its unfinished files.
/// Signals that are ignored when the program starts (`nohup`) stay ignored.
pub fn listen() -> io::Result<()> {
    listen_for(PATIENCE)
}

/// [`listen`] for work that completes what it has begun, whatever time that takes.
pub fn listen_patiently() -> io::Result<()> {
    listen_for(Duration::MAX)
}

fn listen_for(patience: Duration) -> io::Result<()> {
    let ignored = ignored_signals();
    let handled = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    let handled: Vec<i32> = handled.collect();
    let signals = Signals::new(&handled)?;
    let watcher = thread::Builder::new().name("signals".into()).spawn(move || watch(signals, patience));
    // If no thread can be started, the second signal still ends the program.
    let at_once = if watcher.is_ok() { &LEAVING } else { export::cancel_flag() };
    for signal in handled {
        // In this order: the first signal must not count as the second, too.
        flag::register_conditional_shutdown(signal, INTERRUPTED.into(), at_once)?;
        flag::register(signal, export::cancel_flag())?;
    }
    Ok(())
}

/// Makes a file that reaches its size limit (`ulimit -f`) an error like a full disk; the signal would end the program.
pub fn outlive_full_files() -> io::Result<()> {
    static IGNORED: AtomicBool = AtomicBool::new(false);
    flag::register(SIGXFSZ, &IGNORED).map(drop)
}

/// Fails if the work is to be cancelled.
pub fn check() -> Result<(), Error> {
    if export::cancel_flag().load(Ordering::SeqCst) { Err(Error::Cancelled) } else { Ok(()) }
}

/// Reports to the user what happened to the files.
pub fn report_interruption() {
    static SAID: AtomicBool = AtomicBool::new(false);
    if !SAID.swap(true, Ordering::SeqCst) {
        let _ = writeln!(stderr(), "{}error: interrupted; complete files stay, others are removed", clear());
    }
}

/// The control characters that erase a progress line, which there may be.
fn clear() -> &'static str {
    if stderr().is_terminal() { "\r\x1b[K" } else { "" }
}

/// Waits for a signal, and ends the program if the work does not end.
fn watch(mut signals: Signals, patience: Duration) {
    signals.forever().next();
    export::cancel_flag().store(true, Ordering::SeqCst);
    let start = Instant::now();
    while start.elapsed() < patience && signals.pending().next().is_none() {
        thread::sleep(Duration::from_millis(10));
    }
    export::remove_unfinished();
    // Writing to stderr may block, if nothing reads it.
    LEAVING.store(true, Ordering::SeqCst);
    report_interruption();
    low_level::exit(INTERRUPTED.into());
}

/// Ends the program, which has no memory for `bytes` more, with one line, after removing its unfinished files. Needs no
/// memory for the line.
pub fn without_memory(bytes: usize) -> ! {
    static BEGUN: AtomicBool = AtomicBool::new(false);
    static DONE: AtomicBool = AtomicBool::new(false);
    if BEGUN.swap(true, Ordering::SeqCst) {
        // Another thread is ending the program; or this one, which needs memory for that.
        let start = Instant::now();
        while !DONE.load(Ordering::SeqCst) && start.elapsed() < Duration::from_millis(300) {
            thread::sleep(Duration::from_millis(1));
        }
    } else {
        let mut line = Cursor::new([0; 64]);
        let _ = writeln!(line, "{}error: no memory for {bytes} bytes", clear());
        let length = usize::try_from(line.position()).unwrap_or_default();
        // If stderr is closed, the message is lost.
        let _ = stderr().write_all(&line.get_ref()[..length]);
        export::remove_unfinished();
        DONE.store(true, Ordering::SeqCst);
    }
    low_level::exit(usage::FAILED.into());
}

/// A bit for each signal that is ignored, the lowest for signal 1.
fn ignored_signals() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
