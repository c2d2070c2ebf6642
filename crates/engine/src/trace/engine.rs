//! The engine that builds and scans scenes: Embree's device, and threads.

use echocast_crew::Crew;
use echocast_kernels::{self as kernels, Level};
use embree4::{CommittedScene, Device, Joint, Pace};
use ground::error::{Error, Result};
use ground::parallel::{self, STACK};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::{fmt, io, mem};

/// Embree's device and the worker threads. Clones share them, as does everything built with it.
#[derive(Clone)]
pub struct Engine(Arc<EngineParts>);

struct EngineParts {
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

/// The crew shared by engines that use all cores, started with the first and kept.
static SHARED_CREW: Mutex<Option<Arc<Crew>>> = Mutex::new(None);

/// Threads that help build scenes, apart from those that scan: a mesh may be built in the background. They sleep until
/// called.
struct Builders {
    calls: Option<Sender<Arc<Joint>>>,
    threads: Vec<JoinHandle<()>>,
}

/// The builders shared by engines that use all cores, likewise.
static SHARED_BUILDERS: Mutex<Option<Arc<Builders>>> = Mutex::new(None);

/// Scenes of fewer triangles and instances are built by the calling thread before another wakes up.
const WORTH_HELP: usize = 4096;

impl Engine {
    /// An engine with as many threads as rayon's current pool, which is started with one thread per core if there is
    /// none. The calling thread is one of them; the others are shared by all engines made this way.
    ///
    /// # Errors
    /// Embree's: out of memory, a library that is too old or too new; [`Error::Threads`]; vector instructions that
    /// `ECHOCAST_SIMD` names but the processor lacks.
    pub fn new() -> Result<Engine> {
        if rayon::current_thread_index().is_none() {
            parallel::start_pool().map_err(|error| no_threads("enough", error))?;
        }
        let device = device()?;
        let count = rayon::current_num_threads();
        let crew = kept(&SHARED_CREW, || hire(count))?;
        let builders = kept(&SHARED_BUILDERS, || Builders::for_workers(&device, count))?;
        let workers = crew.map_or(Workers::Caller, Workers::Crew);
        Ok(Engine(Arc::new(EngineParts { device, workers, builders })))
    }

    /// An engine with `threads` threads: the calling one, and others of its own. Further threads, one fewer and at most
    /// one per core, help build large scenes. All end with the engine. With 1, no thread is started and the calling
    /// thread does everything; with 0, there are as many as the machine has cores. No threads are requested from the
    /// system later.
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
        Ok(Engine(Arc::new(EngineParts { device, workers, builders })))
    }

    /// Number of threads that work, including the calling one.
    pub fn threads(&self) -> usize {
        match &self.0.workers {
            Workers::Caller => 1,
            Workers::Crew(_) if rayon::current_thread_index().is_some() => rayon::current_num_threads(),
            Workers::Crew(crew) => crew.len() + 1,
        }
    }

    /// Major, minor and patch number of the Embree library in use.
    pub fn embree_version(&self) -> (u32, u32, u32) {
        self.0.device.version()
    }

    /// Rays that Embree traces at a time: 16 with AVX-512, 8 with AVX, 4 with narrower instructions.
    pub fn packet_width(&self) -> usize {
        self.0.device.packet_width()
    }

    /// Vector instructions of the kernels, the inner loops of this library: `avx512`, `avx2` or `plain`, as set by the
    /// environment variable `ECHOCAST_SIMD` or else the widest that the processor has. Embree uses its own of the same
    /// width.
    pub fn vectors(&self) -> &'static str {
        kernels::level().name()
    }

    /// Runs `work` on this thread, its parallel parts with the help of this engine's other threads, which can help
    /// several callers at once. On a thread of a rayon pool, that pool helps instead, whatever the engine, except for
    /// an engine of one thread, which never uses another.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.install_sized(u64::MAX, work)
    }

    /// [`Engine::install`] for work of a `size`, rays: smaller work is helped first.
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
    #[doc(hidden)]
    pub fn commit(&self, scene: embree4::Scene, primitives: usize, pace: Pace) -> Result<CommittedScene> {
        let builders = self.0.builders.as_ref().filter(|_| primitives >= WORTH_HELP);
        scene
            .commit_with(pace, |joint| builders.into_iter().for_each(|builders| builders.call(joint)))
            .map_err(embree_error)
    }
}

/// Ours for an error of Embree: [`Error::Memory`] if there is none left, otherwise [`Error::Embree`].
pub(super) fn embree_error(error: embree4::Error) -> Error {
    match error {
        embree4::Error::Embree { call, reason: embree4::OUT_OF_MEMORY } => Error::Memory(format!("Embree's {call}")),
        other => Error::Embree(other.to_string()),
    }
}

/// Embree's device, for the vector instructions that were chosen for kernels, or the widest.
fn device() -> Result<Device> {
    let chosen = kernels::chosen_level()
        .map_err(|error| Error::invalid(kernels::VARIABLE, error.found, error.allowed))?
        // On other architectures there is nothing to choose.
        .filter(|_| cfg!(target_arch = "x86_64"));
    let isa = match chosen {
        None => "",
        Some(Level::Avx512) => "isa=avx512",
        Some(Level::Avx2) => "isa=avx2",
        // Available on any processor of the last fifteen years.
        Some(Level::Plain) => "isa=sse4.2",
    };
    Device::with_config(isa).map_err(embree_error)
}

/// Starts the threads that, with the calling one, make `count`; `None`: the calling one alone.
fn hire(count: usize) -> Result<Option<Arc<Crew>>> {
    if count <= 1 {
        return Ok(None);
    }
    let crew = Crew::new(count - 1, |number, work| start(format!("echocast {number}"), work));
    Ok(Some(Arc::new(crew.map_err(|error| no_threads(count, error))?)))
}

/// The content of `place`, created if it is empty.
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
    /// As many as can be of use to a calling thread when `workers` threads scan; `None` if none can.
    fn for_workers(device: &Device, workers: usize) -> Result<Option<Arc<Builders>>> {
        let count = workers.min(device.build_threads()) - 1;
        let (calls, requests) = mpsc::channel::<Arc<Joint>>();
        let requests = Arc::new(Mutex::new(requests));
        // If dropped on an error, those already started end.
        let mut builders = Builders { calls: Some(calls), threads: Vec::with_capacity(count) };
        for number in 0..count {
            let requests = requests.clone();
            let next = move || requests.lock().unwrap_or_else(PoisonError::into_inner).recv();
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

    /// Calls all threads to help with `joint`.
    fn call(&self, joint: &Arc<Joint>) {
        if let Some(calls) = &self.calls {
            // They receive as long as this exists.
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
        // Closing the channel ends the threads.
        self.calls = None;
        end(&mut self.threads);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embree4::{Quality, Scene};

    #[test]
    fn all_builders_are_called() {
        let (calls, requests) = mpsc::channel();
        let builders = Builders { calls: Some(calls), threads: (0..3).map(|_| thread::spawn(|| ())).collect() };
        let scene = Scene::new(&Device::new().unwrap(), Quality::Medium).unwrap();
        scene.commit_with(Pace::Now, |joint| builders.call(joint)).unwrap();
        assert_eq!(requests.try_iter().count(), 3);
    }
}
