//! Text and numbers for display.

use echocast::shown;
use std::io::{self, ErrorKind, Write as _};
use std::path::PathBuf;

/// Writes `text` to stdout. A reader that closes the pipe early (`echocast sensors | head`) is not an error.
pub fn print(text: &str) -> anyhow::Result<()> {
    check_stdout()?;
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(anyhow::Error::new(error).context("stdout")),
        _ => Ok(()),
    }
}

/// Fails if what is written to stdout would be lost.
pub fn check_stdout() -> anyhow::Result<()> {
    anyhow::ensure!(echocast_stdout::is_open(), "standard output is closed; allowed: a terminal, a pipe, a file");
    Ok(())
}

/// Writes `value` to stdout, one key a line, as [`print`] does.
pub fn print_json(value: &serde_json::Value) -> anyhow::Result<()> {
    print(&json(value))
}

/// `value`, one key a line.
pub fn json(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

/// Writes `text` to stderr; if that is closed, it is lost.
pub fn print_error(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// Writes a line to stderr; if that is closed, it is lost.
pub fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{}", shown::text(line));
}

/// `text` of several lines, with control characters escaped.
pub fn lines(text: &str) -> String {
    text.split('\n').map(shown::text).collect::<Vec<_>>().join("\n")
}

/// The names of files for display and JSON.
pub fn paths(files: &[PathBuf]) -> Vec<String> {
    files.iter().map(|file| shown::path(file)).collect()
}

/// `error` and its causes on one line that is not too long; a cause that the line already contains is left out.
pub fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain() {
        let cause = cause.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        if line.is_empty() {
            line = cause;
        } else if !line.contains(&cause) {
            line = format!("{line}: {cause}");
        }
    }
    shown::message(&line)
}

/// `number` with a comma between thousands.
pub fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `count` and its noun: `1 frame`, `1,200 rays`.
pub fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{} {noun}{plural}", thousands(count))
}

/// `seconds` with three digits and a suitable unit.
pub fn duration(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s >= 1.0 => (s, "s"),
        s if s >= 1e-3 => (s * 1e3, "ms"),
        s => (s * 1e6, "us"),
    };
    let decimals = if value >= 100.0 {
        0
    } else if value >= 10.0 {
        1
    } else {
        2
    };
    format!("{value:.decimals$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_people() {
        assert_eq!([0, 999, 1000, 1_234_567].map(thousands), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!(counted(1, "frame") + ", " + &counted(2000, "ray"), "1 frame, 2,000 rays");
        assert_eq!([83.0, 2.0, 0.0123, 0.000_5].map(duration), ["83.0 s", "2.00 s", "12.3 ms", "500 us"]);
    }

    #[test]
    fn each_cause_is_named_once() {
        let cause = anyhow::anyhow!("x.glb: No such file");
        let wrapped = cause.context("x.glb: No such file").context("--sensor\n  x");
        assert_eq!(one_line(&wrapped), "--sensor x: x.glb: No such file");
        let long = anyhow::anyhow!("{}\x1b[31m", "x ".repeat(1000)).context("--camera \x1b]0;a\x07");
        assert!(one_line(&long).starts_with("--camera \\u{1b}]0;a\\u{7}: x x"));
        assert!(one_line(&long).len() < 500);
    }

    #[test]
    fn lines_stay_lines() {
        assert_eq!(lines("a\n  b\x1b[1m\tc\n"), "a\n  b\\u{1b}[1m\\tc\n");
    }
}
