//! The program `echocast`, which the wheel includes.

use crate::argument;
use crate::scene::Scene;
use pyo3::prelude::*;
use std::ffi::OsString;

/// As in the program itself. In other processes it acts as the system's.
#[global_allocator]
static MEMORY: echocast_memory::Allocator = echocast_memory::Allocator;

/// Runs the command line `arguments`, the first of which is the program's name; returns its exit code. For processes
/// that do nothing else. `scene`: that of scenarios whose scene is a file of Blender.
#[pyfunction]
#[pyo3(signature = (arguments, scene = None))]
pub fn program(
    py: Python<'_>,
    arguments: Vec<OsString>,
    #[pyo3(from_py_with = argument::scene)] scene: Option<Bound<'_, Scene>>,
) -> u8 {
    let scene = scene.map(|scene| scene.get().scene.clone());
    py.detach(|| echocast_cli::run_with(arguments, scene))
}
