//! What builds and scans scenes: Embree's device, and threads.

use crate::ground::error::{Error, Result};
use crate::ground::parallel::{self, STACK};
use echocast_crew::Crew;
use echocast_kernels::{self as kernels, Level};
use embree4::{CommittedScene, Device, Joint, Pace};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::{fmt, io, mem};

/// Embree's device and the threads that work. Clones share them, as does everything built with it.
#[derive(Clone)]
pub struct Engine(Arc<Parts>);

struct Parts {
    device: Device,
    workers: Workers,
    /// `None`: the calling thread builds alone.
    builders: Option<Arc<Builders>>,
}

enum Workers {
    /// The calling thread alone.
    Caller,
    /// The calling thread with the help of others; on a thread of a rayon pool, that pool instead.
    Crew(Arc<Crew>),
}

/// The crew of engines that work on all cores, started with the first and kept.
static EVERYBODYS_CREW: Mutex<Option<Arc<Crew>>> = Mutex::new(None);

/// Threads that help build scenes, apart from those that scan: a mesh may be built in the background. They sleep until
/// called.
struct Builders {
    calls: Option<Sender<Arc<Joint>>>,
    threads: Vec<JoinHandle<()>>,
}

/// Those of engines that work on all cores, likewise.
static EVERYBODYS_BUILDERS: Mutex<Option<Arc<Builders>>> = Mutex::new(None);

/// Scenes of fewer triangles and instances are built by the calling thread before another wakes up.
const WORTH_HELP: usize = 4096;

impl Engine {
    /// Works on as many threads as rayon's current pool has, which is started if there is none: one per core. The calling
    /// thread is one of them, the others help all engines made so.
    ///
    /// # Errors
    /// Embree's: out of memory, a library that is too old or too new; [`Error::Threads`]; vector instructions that
    /// `ECHOCAST_SIMD` names, but there are not.
    pub fn new() -> Result<Engine> {
        if rayon::current_thread_index().is_none() {
            parallel::start_pool().map_err(|error| no_threads("enough", error))?;
        }
        let device = device()?;
        let count = rayon::current_num_threads();
        let crew = kept(&EVERYBODYS_CREW, || hire(count))?;
        let builders = kept(&EVERYBODYS_BUILDERS, || Builders::for_workers(&device, count))?;
        let workers = crew.map_or(Workers::Caller, Workers::Crew);
        Ok(Engine(Arc::new(Parts { device, workers, builders })))
    }

    /// Works with `threads` threads: the calling one, and others of its own. One fewer help build large scenes, up to one
    /// per core. All end with it. With 1, no thread is started and the calling thread does everything; with 0, there are
    /// as many as the machine has cores. No threads are requested from the system later.
    ///
    /// # Errors
    /// As [`Engine::new`]; more than 1024.
    pub fn with_threads(threads: usize) -> Result<Engine> {
        /// More is a mistake.
        const MOST: usize = 1024;
        let count = match threads {
            0 => thread::available_parallelism().map_or(1, usize::from).min(MOST),
            1..=MOST => threads,
            _ => return Err(Error::invalid("threads", threads, format!("0 to {MOST}"))),
        };
        let device = device()?;
        let workers = hire(count)?.map_or(Workers::Caller, Workers::Crew);
        let builders = Builders::for_workers(&device, count)?;
        Ok(Engine(Arc::new(Parts { device, workers, builders })))
    }

    /// Threads that work.
    pub fn threads(&self) -> usize {
        match &self.0.workers {
            Workers::Caller => 1,
            Workers::Crew(_) if rayon::current_thread_index().is_some() => rayon::current_num_threads(),
            Workers::Crew(crew) => crew.len() + 1,
        }
    }

    /// Major, minor and patch number of the Embree library that runs.
    pub fn embree_version(&self) -> (u32, u32, u32) {
        self.0.device.version()
    }

    /// Rays that Embree traces at a time: 16 with AVX-512, 8 with AVX, 4 with narrower instructions.
    pub fn packet_width(&self) -> usize {
        self.0.device.packet_width()
    }

    /// Vector instructions of the kernels, the loops of this library: `avx512`, `avx2` or `plain`, of the variable
    /// `ECHOCAST_SIMD` or else the widest that the processor has. Embree uses its own of the same width.
    pub fn vectors(&self) -> &'static str {
        kernels::level().name()
    }

    /// Runs `work` on this thread, its parallel parts with the help of this engine's other threads, which help several at
    /// once. On a thread of a rayon pool, that pool helps instead, whatever the engine, except for an engine of one
    /// thread, which never asks for another.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.install_sized(u64::MAX, work)
    }

    /// [`Engine::install`] for work of a `size`, rays: whoever has less is helped first.
    pub(crate) fn install_sized<R: Send>(&self, size: u64, work: impl FnOnce() -> R + Send) -> R {
        match &self.0.workers {
            Workers::Caller => parallel::alone(work),
            Workers::Crew(_) if rayon::current_thread_index().is_some() => work(),
            Workers::Crew(crew) => parallel::with_crew(crew, size, work),
        }
    }

    pub(crate) fn device(&self) -> &Device {
        &self.0.device
    }

    /// Builds `scene`, which has this many triangles or instances.
    pub(crate) fn commit(&self, scene: embree4::Scene, primitives: usize, pace: Pace) -> Result<CommittedScene> {
        let builders = self.0.builders.as_ref().filter(|_| primitives >= WORTH_HELP);
        Ok(scene.commit_with(pace, |joint| builders.into_iter().for_each(|builders| builders.call(joint)))?)
    }
}

/// Embree's device, for the vector instructions that were chosen for kernels, or the widest.
fn device() -> Result<Device> {
    let chosen = kernels::chosen_level()
        .map_err(|error| Error::invalid(kernels::VARIABLE, error.found, error.allowed))?
        // Elsewhere there is nothing to choose.
        .filter(|_| cfg!(target_arch = "x86_64"));
    let isa = match chosen {
        None => "",
        Some(Level::Avx512) => "isa=avx512",
        Some(Level::Avx2) => "isa=avx2",
        // What any processor of the last fifteen years has.
        Some(Level::Plain) => "isa=sse4.2",
    };
    Ok(Device::with_config(isa)?)
}

/// As many threads as help a calling one where `count` work; `None`: nobody.
fn hire(count: usize) -> Result<Option<Arc<Crew>>> {
    if count <= 1 {
        return Ok(None);
    }
    let crew = Crew::new(count - 1, |number, work| start(format!("echocast {number}"), work));
    Ok(Some(Arc::new(crew.map_err(|error| no_threads(count, error))?)))
}

/// What is in `place`, made if there is nothing yet.
fn kept<T>(place: &Mutex<Option<Arc<T>>>, make: impl FnOnce() -> Result<Option<Arc<T>>>) -> Result<Option<Arc<T>>> {
    let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
    if place.is_none() {
        *place = make()?;
    }
    Ok(place.clone())
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Engine").field("device", &self.0.device).field("threads", &self.threads()).finish()
    }
}

impl Builders {
    /// As many as can be of use beside a calling thread when `workers` threads scan; `None` if none can.
    fn for_workers(device: &Device, workers: usize) -> Result<Option<Arc<Builders>>> {
        let count = workers.min(device.build_threads()) - 1;
        let (calls, heard) = mpsc::channel::<Arc<Joint>>();
        let heard = Arc::new(Mutex::new(heard));
        // If dropped on an error, those already started end.
        let mut builders = Builders { calls: Some(calls), threads: Vec::with_capacity(count) };
        for number in 0..count {
            let heard = heard.clone();
            let next = move || heard.lock().unwrap_or_else(PoisonError::into_inner).recv();
            let work = move || {
                while let Ok(joint) = next() {
                    joint.help();
                }
            };
            let thread = start(format!("echocast build {number}"), work);
            builders.threads.push(thread.map_err(|error| no_threads(workers, error))?);
        }
        Ok((count > 0).then(|| Arc::new(builders)))
    }

    /// Calls all for help with `joint`.
    fn call(&self, joint: &Arc<Joint>) {
        if let Some(calls) = &self.calls {
            // They listen as long as this exists.
            self.threads.iter().for_each(|_| drop(calls.send(joint.clone())));
        }
    }
}

fn start(name: String, work: impl FnOnce() + Send + 'static) -> io::Result<JoinHandle<()>> {
    thread::Builder::new().name(name).stack_size(STACK).spawn(work)
}

fn no_threads(wanted: impl ToString, error: impl ToString) -> Error {
    Error::Threads { wanted: wanted.to_string(), reason: error.to_string() }
}

/// Waits until `threads` have ended.
fn end(threads: &mut Vec<JoinHandle<()>>) {
    for thread in mem::take(threads) {
        // A thread cannot wait for itself.
        if thread.thread().id() != thread::current().id() {
            let _ = thread.join();
        }
    }
}

impl Drop for Builders {
    fn drop(&mut self) {
        // Tells the threads to end.
        self.calls = None;
        end(&mut self.threads);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embree4::{Quality, Scene};

    #[test]
    fn all_who_can_help_are_called() {
        let (calls, heard) = mpsc::channel();
        let builders = Builders { calls: Some(calls), threads: (0..3).map(|_| thread::spawn(|| ())).collect() };
        let scene = Scene::new(&Device::new().unwrap(), Quality::Medium).unwrap();
        scene.commit_with(Pace::Now, |joint| builders.call(joint)).unwrap();
        assert_eq!(heard.try_iter().count(), 3);
    }
}
