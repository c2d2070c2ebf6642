//! A safe wrapper of the parts of [Embree](https://www.embree.org) 4 that a sensor simulator needs: triangle meshes,
//! one level of instances, custom shapes, and the closest hit of single rays and of packets of 4, 8 and 16.
//!
//! ```
//! use embree4::{Coherence, Device, Mesh, Packet, Quality, Scene, INVALID};
//!
//! let device = Device::new()?;
//! let corners = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]];
//! let mut scene = Scene::new(&device, Quality::Medium)?;
//! scene.attach_mesh(&Mesh::new(&device, corners.into_iter(), &[[0, 1, 2]], u32::MAX)?)?;
//! let scene = scene.commit()?;
//!
//! let mut rays = Packet::<4>::new();
//! rays.org_x = [0.1, 0.2, 0.3, 9.0];
//! rays.org_y = [0.1; 4];
//! rays.dir_z = [1.0; 4];
//! scene.intersect(&[-1; 4], &mut rays, Coherence::Coherent);
//! assert!((rays.tfar[0] - 5.0).abs() < 1e-5);
//! assert_eq!(rays.geom_id, [0, 0, 0, INVALID]);
//! # Ok::<(), embree4::Error>(())
//! ```
//!
//! What it guarantees on top of Embree:
//!
//! * A library whose version does not fit the memory layout compiled in here is refused ([`Device::new`]).
//! * Every set-up call's error is read and returned; calls that trace rays report none (Embree does not check them).
//! * A [`CommittedScene`] never changes, keeps everything it needs alive, and can be shared between threads.
//! * No thread is started: scenes are built by the threads that commit them ([`Scene::commit_with`]).
//! * The caller's floating-point state (flush to zero, rounding, exceptions) stays as it is.
//!
//! Nothing here panics on input. Units are the caller's.
#![allow(unsafe_code)] // one of the few places that call C; each block says why it is sound

mod device;
mod error;
mod filter;
mod forward;
mod library;
mod mesh;
mod ray;
mod scene;
mod shape;

pub use device::Device;
pub use error::{Error, OUT_OF_MEMORY};
pub use filter::Candidate;
pub use mesh::Mesh;
pub use ray::{Coherence, INVALID, Packet, Ray};
pub use scene::{CommittedScene, Instance, Joint, Pace, Quality, Scene, is_invertible};
pub use shape::{Custom, CustomShape, Hit, LocalRays, Query};
