//! The C ABI of echocast. It is described in `include/echocast.h`, which is generated from the comments of this crate,
//! and in `docs/embedding.md`.
//!
//! * Every exported function is one call of `guard::guard` (or one that cannot fail), which catches panics and turns
//!   errors into numbers and a text.
//! * A handle is a number dressed up as a pointer: nothing is ever read through it, so a stale, foreign or invented one
//!   is detected (`handle`).
//! * Nothing is decided here: every function translates its arguments, calls the Rust API and translates the result.
#![allow(unsafe_code)] // C's pointers; each block says what the caller promises
#![allow(non_camel_case_types)] // the names are C's
#![allow(clippy::missing_safety_doc)] // the header says what each function requires of its pointers

mod boxes;
mod column;
mod context;
mod driver;
mod file;
mod guard;
mod handle;
mod image;
mod instance;
mod label;
mod library;
mod material;
mod mesh;
mod message;
mod pack;
mod ping;
mod pose;
mod radar;
mod result;
mod reuse;
mod scan;
mod scenario;
mod scene;
mod sensor;
mod text;
mod time;

pub use boxes::*;
pub use column::*;
pub use context::*;
pub use driver::*;
pub use file::*;
pub use guard::*;
pub use image::*;
pub use instance::*;
pub use library::*;
pub use material::*;
pub use mesh::*;
pub use message::*;
pub use ping::*;
pub use pose::*;
pub use radar::*;
pub use result::*;
pub use scan::*;
pub use scenario::*;
pub use scene::*;
pub use sensor::*;
