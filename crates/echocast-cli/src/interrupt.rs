//! Ctrl-C, termination, a terminal that closes: the work is told to end; unfinished files go, older files stay.

use echocast::{Error, export};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::{flag, low_level};
use std::io::{self, IsTerminal as _, Write as _, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use std::{fs, thread};

/// The exit code: what shells report of a program that SIGINT has ended, 128 + 2.
pub const INTERRUPTED: u8 = 130;

/// How long the work may go on before it looks up.
const PATIENCE: Duration = Duration::from_secs(1);

/// Whether the next signal ends the program in its handler.
static LEAVING: AtomicBool = AtomicBool::new(false);

/// From now on a signal sets [`export::cancel_flag`], at which the work looks from time to time; a second one, or work
/// that does not look in time, ends the program where it is, without destructors, but for its unfinished files. Signals
/// that whoever started the program has it ignore (`nohup`) stay ignored.
pub fn listen() -> io::Result<()> {
    let ignored = ignored_signals();
    let heard = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    let heard: Vec<i32> = heard.collect();
    let signals = Signals::new(&heard)?;
    let watcher = thread::Builder::new().name("signals".into()).spawn(|| watch(signals));
    // Where the system gives no thread, the second signal ends the program all the same.
    let at_once = if watcher.is_ok() { &LEAVING } else { export::cancel_flag() };
    for signal in heard {
        // In this order: the first must not be its own second.
        flag::register_conditional_shutdown(signal, INTERRUPTED.into(), at_once)?;
        flag::register(signal, export::cancel_flag())?;
    }
    Ok(())
}

/// Makes a file that may grow no more (`ulimit -f`) an error like a full disk; the signal would end the program.
pub fn outlive_full_files() -> io::Result<()> {
    static IGNORED: AtomicBool = AtomicBool::new(false);
    flag::register(SIGXFSZ, &IGNORED).map(drop)
}

/// That the work is wanted.
pub fn check() -> Result<(), Error> {
    if export::cancel_flag().load(Ordering::SeqCst) { Err(Error::Cancelled) } else { Ok(()) }
}

/// Tells people what became of their files.
pub fn say() {
    static SAID: AtomicBool = AtomicBool::new(false);
    if !SAID.swap(true, Ordering::SeqCst) {
        // A progress line may stand there.
        let clear = if stderr().is_terminal() { "\r\x1b[K" } else { "" };
        let _ = writeln!(stderr(), "{clear}error: interrupted; files that were complete stay, others are gone");
    }
}

/// Waits for a signal, and ends the program when the work does not.
fn watch(mut signals: Signals) {
    signals.forever().next();
    export::cancel_flag().store(true, Ordering::SeqCst);
    let start = Instant::now();
    while start.elapsed() < PATIENCE && signals.pending().next().is_none() {
        thread::sleep(Duration::from_millis(10));
    }
    export::remove_unfinished();
    // Nobody may read stderr.
    LEAVING.store(true, Ordering::SeqCst);
    say();
    low_level::exit(INTERRUPTED.into());
}

/// A bit for each signal that is ignored, the lowest for signal 1.
fn ignored_signals() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
