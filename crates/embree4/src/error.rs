use std::path::PathBuf;

/// First minor version of Embree 4 with the memory layout of 4.3.3, whose header the bindings come from.
pub(crate) const OLDEST_MINOR: u32 = 3;

/// What can go wrong while a scene is set up. Each variant's text is one sentence.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No library of Embree was found.
    #[error(
        "Embree 4.{} or a later 4.x is missing: `apt install libembree4-4` (Debian 13, Ubuntu 24.04) or `pip install \
         --no-deps --target ~/.local/share/echocast embreex` installs it, or ECHOCAST_EMBREE names its file or folder; \
         there is no libembree4.so.4 in {searched}",
        OLDEST_MINOR
    )]
    Library {
        /// The folders that were searched.
        searched: String,
    },
    /// A library of Embree that cannot be opened.
    #[error("{}: cannot be used as Embree: {reason}", .path.display())]
    Unusable {
        /// Its file.
        path: PathBuf,
        /// The loader's reason.
        reason: String,
    },
    /// The library has a version whose memory layout may differ from the one compiled in.
    #[error(
        "{} is Embree {}.{}.{}, but 4.{} or a later 4.x is needed",
        .path.display(), .found.0, .found.1, .found.2, OLDEST_MINOR
    )]
    Version {
        /// Major, minor and patch number of the library.
        found: (u32, u32, u32),
        /// Its file.
        path: PathBuf,
    },
    /// A device configuration with a NUL character in it, which cannot be passed to C.
    #[error("the Embree configuration {config:?} contains a NUL character")]
    Config {
        /// The configuration as it was given.
        config: String,
    },
    /// A mesh without a vertex or without a triangle.
    #[error("a mesh needs vertices and triangles, but this one has {vertices} and {triangles}")]
    EmptyMesh {
        /// Number of vertices given.
        vertices: usize,
        /// Number of triangles given.
        triangles: usize,
    },
    /// More vertices or triangles than 32-bit numbers can index.
    #[error("a mesh can have up to 4294967294 vertices and triangles, but this one has {vertices} and {triangles}")]
    MeshTooLarge {
        /// Number of vertices given.
        vertices: usize,
        /// Number of triangles given.
        triangles: usize,
    },
    /// A triangle with a corner that does not exist.
    #[error("triangle {triangle} refers to vertex {index}, but there are {vertices} vertices, counted from 0")]
    IndexOutOfRange {
        /// Position of the triangle, from 0.
        triangle: usize,
        /// The vertex number found there.
        index: u32,
        /// Number of vertices given.
        vertices: usize,
    },
    /// A mesh or scene of one device attached to a scene of another.
    #[error("a mesh or scene can only be attached to a scene of the device it was made with")]
    OtherDevice,
    /// An instance of a scene that has instances itself.
    #[error("a scene that contains instances cannot be instanced: Embree is used with one level of instances")]
    NestedInstance,
    /// An instance's transform that is not finite or that flattens space.
    #[error("the instance transform {transform:?} (3x4, column by column) is not finite or cannot be inverted")]
    Transform {
        /// The transform as it was given.
        transform: [f32; 12],
    },
    /// Embree itself reported an error.
    #[error("Embree's {call} failed: {reason}")]
    Embree {
        /// The C function that was called.
        call: &'static str,
        /// Embree's error in words.
        reason: &'static str,
    },
}

/// The `reason` of [`Error::Embree`] when memory runs out.
pub const OUT_OF_MEMORY: &str = "out of memory";
