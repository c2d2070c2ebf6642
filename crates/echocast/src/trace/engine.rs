//! What builds and scans scenes: Embree's device, and threads.

use crate::ground::error::{Error, Result};
use crate::ground::parallel;
use embree4::{CommittedScene, Device, Joint, Pace};
use rayon::ThreadPool;
use std::error::Error as _;
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
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
    /// The rayon pool that the caller is in, usually the global one.
    Rayon,
    /// Threads of this engine's own.
    Own(Pool),
}

/// A pool whose threads have ended once it is dropped.
struct Pool {
    pool: Option<ThreadPool>,
    threads: Vec<JoinHandle<()>>,
    /// Held by the thread whose work is being done: otherwise a worker that waits for a part of it would take up the
    /// next thread's work, on the same stack, and so on.
    turn: Mutex<()>,
}

/// As [`Pool::turn`], for rayon's global pool.
static RAYONS_TURN: Mutex<()> = Mutex::new(());

/// Threads that help build scenes, apart from those that scan: a mesh may be built in the background. They sleep until
/// called.
struct Builders {
    calls: Option<Sender<Arc<Joint>>>,
    threads: Vec<JoinHandle<()>>,
}

/// Those of engines that work with rayon's threads, started with the first and kept as rayon's are.
static RAYONS_BUILDERS: Mutex<Option<Arc<Builders>>> = Mutex::new(None);

/// Scenes of fewer triangles and instances are built by the calling thread before another wakes up.
const WORTH_HELP: usize = 4096;

/// Stack of the threads started here, whatever the environment says: several times what they use.
const STACK: usize = 2 << 20;

impl Engine {
    /// Works on all cores, with rayon's current pool; starts the global one if there is none yet.
    ///
    /// # Errors
    /// Embree's: out of memory, a library that is too old or too new; [`Error::Threads`].
    pub fn new() -> Result<Engine> {
        if rayon::current_thread_index().is_none() {
            // Later rayon would panic if the system gives no threads.
            match rayon::ThreadPoolBuilder::new().stack_size(STACK).build_global() {
                Err(error) if error.source().is_some() => return Err(no_threads("enough", error)),
                _ => {}
            }
        }
        let device = Device::new()?;
        let mut builders = RAYONS_BUILDERS.lock().unwrap_or_else(PoisonError::into_inner);
        if builders.is_none() {
            *builders = Builders::for_workers(&device, rayon::current_num_threads())?;
        }
        Ok(Engine(Arc::new(Parts { device, workers: Workers::Rayon, builders: builders.clone() })))
    }

    /// Works with `threads` threads of its own, and one fewer that help build large scenes, up to one per core; all end
    /// with it. With 1, no thread is started and the calling thread does everything; with 0, there are as many as the
    /// machine has cores. No threads are requested from the system later.
    ///
    /// # Errors
    /// Embree's: out of memory, a library that is too old or too new; [`Error::Threads`]; more than 1024.
    pub fn with_threads(threads: usize) -> Result<Engine> {
        /// More is a mistake.
        const MOST: usize = 1024;
        let count = match threads {
            0 => thread::available_parallelism().map_or(1, usize::from).min(MOST),
            1..=MOST => threads,
            _ => return Err(Error::invalid("threads", threads, format!("0 to {MOST}"))),
        };
        let device = Device::new()?;
        let workers = if count == 1 { Workers::Caller } else { Workers::Own(Pool::new(count)?) };
        let builders = Builders::for_workers(&device, count)?;
        Ok(Engine(Arc::new(Parts { device, workers, builders })))
    }

    /// Threads that work.
    pub fn threads(&self) -> usize {
        match &self.0.workers {
            Workers::Caller => 1,
            Workers::Rayon => rayon::current_num_threads(),
            Workers::Own(pool) => pool.threads.len(),
        }
    }

    /// Major, minor and patch number of the Embree library that runs.
    pub fn embree_version(&self) -> (u32, u32, u32) {
        self.0.device.version()
    }

    /// Runs `work` with its parallel parts done by this engine's threads; work of several threads runs in turn. On a
    /// thread of a rayon pool, that pool does the work instead, whatever the engine, except for an engine of one
    /// thread, which never asks for another. `work` must not wait for other work of the engine.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.0.workers {
            Workers::Caller => parallel::alone(work),
            // A pool thread takes up other tasks of its pool while it waits, and these may end up here again: it must
            // neither hold a turn nor wait for one.
            _ if rayon::current_thread_index().is_some() => work(),
            Workers::Rayon => {
                let _turn = wait_for(&RAYONS_TURN);
                // On one of the pool's threads, so that work within this work is recognised as such.
                rayon::scope(|_| work())
            }
            Workers::Own(workers) => {
                let _turn = wait_for(&workers.turn);
                workers.pool.as_ref().expect("only dropping takes it away").install(work)
            }
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

/// Waits for the turn, which ends when the returned guard is dropped.
fn wait_for(turn: &Mutex<()>) -> MutexGuard<'_, ()> {
    turn.lock().unwrap_or_else(PoisonError::into_inner)
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Engine").field("device", &self.0.device).field("threads", &self.threads()).finish()
    }
}

impl Pool {
    fn new(count: usize) -> Result<Pool> {
        let threads = Mutex::new(Vec::with_capacity(count));
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .spawn_handler(|worker| {
                let handle = start(format!("echocast {}", worker.index()), || worker.run())?;
                threads.lock().unwrap_or_else(PoisonError::into_inner).push(handle);
                Ok(())
            })
            .build()
            .map_err(|error| no_threads(count, error))?;
        let threads = threads.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Pool { pool: Some(pool), threads, turn: Mutex::new(()) })
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

impl Drop for Pool {
    fn drop(&mut self) {
        // Tells the threads to end.
        self.pool = None;
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
