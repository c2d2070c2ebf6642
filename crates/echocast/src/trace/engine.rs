//! What builds and scans scenes: Embree's device, and threads.

use crate::error::{Error, Result};
use crate::parallel;
use embree4::Device;
use rayon::ThreadPool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::{fmt, mem};

/// Embree's device and the threads that work. Clones share them, and so does everything built with it.
#[derive(Clone)]
pub struct Engine(Arc<Parts>);

struct Parts {
    device: Device,
    workers: Workers,
}

enum Workers {
    /// The calling thread alone.
    Caller,
    /// The rayon pool that the caller is in, the global one as a rule.
    Rayon,
    /// Threads of this engine's own.
    Own(Pool),
}

/// A pool whose threads are gone once it is dropped.
struct Pool {
    pool: Option<ThreadPool>,
    threads: Vec<JoinHandle<()>>,
    /// Held by the thread whose work is being done: a worker that waits for a part of it would take up the next
    /// thread's work meanwhile, on the same stack, and so on.
    turn: Mutex<()>,
}

/// As [`Pool::turn`], of rayon's global pool.
static RAYONS_TURN: Mutex<()> = Mutex::new(());

impl Engine {
    /// Works on all cores, with rayon's current pool.
    ///
    /// # Errors
    /// Embree's: out of memory, a library that is too old or too new.
    pub fn new() -> Result<Engine> {
        Ok(Engine(Arc::new(Parts { device: Device::new()?, workers: Workers::Rayon })))
    }

    /// Works with `threads` threads of its own, which end with it; with 1, no thread is started at all and the calling
    /// thread does everything; with 0, there are as many as the machine has cores.
    ///
    /// Embree builds with TBB and, while such engines live, allows it no more threads in this process than the largest
    /// of them has; when the last of them ends, TBB may start an idle one.
    ///
    /// # Errors
    /// As [`Engine::new`]; threads that the system does not give; more than 1024.
    pub fn with_threads(threads: usize) -> Result<Engine> {
        /// More is a mistake.
        const MOST: usize = 1024;
        let count = match threads {
            0 => thread::available_parallelism().map_or(1, usize::from).min(MOST),
            1..=MOST => threads,
            _ => return Err(Error::invalid("threads", threads, format!("0 to {MOST}"))),
        };
        let device = Device::with_config(&format!("threads={count}"))?;
        let workers = if count == 1 { Workers::Caller } else { Workers::Own(Pool::new(count)?) };
        Ok(Engine(Arc::new(Parts { device, workers })))
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

    /// Runs `work` so that its parallel parts are done by this engine's threads; work of several threads follows one
    /// another. On a thread of a rayon pool, that pool does the work instead, whatever the engine, except for an engine
    /// of one thread, which never asks for another. `work` must not wait for other work of the engine.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.0.workers {
            Workers::Caller => parallel::alone(work),
            // A thread of a pool takes up other tasks of it while it waits, and these may end up here again: it must
            // hold no turn, nor wait for one.
            _ if rayon::current_thread_index().is_some() => work(),
            Workers::Rayon => {
                let _turn = wait_for(&RAYONS_TURN);
                // On one of the pool's threads, so that work within this work is known as such.
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
}

/// The turn, which ends when what this returns is dropped.
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
                let builder = thread::Builder::new().name(format!("echocast {}", worker.index()));
                let handle = builder.spawn(|| worker.run())?;
                threads.lock().unwrap_or_else(PoisonError::into_inner).push(handle);
                Ok(())
            })
            .build()
            .map_err(|error| Error::Internal(format!("cannot start {count} threads: {error}")))?;
        let threads = threads.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Pool { pool: Some(pool), threads, turn: Mutex::new(()) })
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        // Tells the threads to end.
        self.pool = None;
        for thread in mem::take(&mut self.threads) {
            // One of them cannot wait for itself.
            if thread.thread().id() != thread::current().id() {
                let _ = thread.join();
            }
        }
    }
}
