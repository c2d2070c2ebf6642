//! The program `echocast`, which the wheel includes.

use pyo3::prelude::*;
use std::ffi::OsString;

/// As in the program itself. In other processes it acts as the system's.
#[global_allocator]
static MEMORY: echocast_memory::Allocator = echocast_memory::Allocator;

/// Runs the command line `arguments`, the first of which is the program's name; returns its exit code. For processes
/// that do nothing else.
#[pyfunction]
pub fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| echocast_cli::run(arguments))
}
