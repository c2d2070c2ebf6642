//! The extension module of the Python package `echocast`: classes around the types of the Rust crate. What is easier to
//! write in Python is in the folder `echocast`.

// Docstrings are for Python, where >>> begins an example.
#![allow(clippy::doc_lazy_continuation)]

mod argument;
mod array;
mod arrow;
mod boxes;
mod cloud;
mod error;
mod image;
mod live;
mod material;
mod mesh;
mod options;
mod ping;
mod place;
mod program;
mod radar;
mod scenario;
mod scene;
mod sensor;
mod sequence;

use pyo3::prelude::*;

/// What `echocast/__init__.py` assembles into the package.
#[pymodule(gil_used = false)]
mod _echocast {
    #[pymodule_export]
    use super::array::Column;
    #[pymodule_export]
    use super::boxes::PyBox;
    #[pymodule_export]
    use super::cloud::{PointCloud, columns, formats, read_cloud};
    #[pymodule_export]
    use super::image::Image;
    #[pymodule_export]
    use super::live::LiveScene;
    #[pymodule_export]
    use super::material::Material;
    #[pymodule_export]
    use super::mesh::Mesh;
    #[pymodule_export]
    use super::ping::{Ping, Pings};
    #[pymodule_export]
    use super::place::{Pose, Trajectory};
    #[pymodule_export]
    use super::program::program;
    #[pymodule_export]
    use super::radar::RadarFrame;
    #[pymodule_export]
    use super::scenario::{Sample, Scenario, finish, run};
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::sensor::{Environment, Sensor, is_path, presets};

    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
