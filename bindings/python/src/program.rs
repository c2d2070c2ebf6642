//! The program `echocast`, which the wheel brings too.

use pyo3::prelude::*;
use std::ffi::OsString;

/// As in the program itself. In other processes it is the system's.
#[global_allocator]
static MEMORY: echocast_memory::Allocator = echocast_memory::Allocator;

/// Does what the command line `arguments` asks for, the first of which is the program's name; returns its exit code. For
/// processes that do nothing else.
#[pyfunction]
pub fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| echocast_cli::run(arguments))
}
