//! A crew of helper threads that share the work of their callers.
//!
//! A thread that has work does it itself, and calls the crew for help. Work is divided into steps, which any thread may
//! take one after the other until none are left. After every step a helper checks whether smaller work has arrived, and
//! switches to it: a small scan never waits for a large one, and a large one continues at least on the thread that
//! called for help. Memory is allocated only when more work is shared at once than ever before.
//!
//! Rayon, which runs in the pools of hosts, does not fit here: a waiting thread takes up whatever comes first, on its
//! own stack, and a scan would end only when everything above it on the stack has ended.

use std::any::Any;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::process;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

/// Helper threads, until this is dropped.
pub struct Crew {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    /// The process that has the threads. One that it forks has none of them, and its copy of a lock may be held forever.
    process: u32,
}

/// Does one step of some work; `false`: none was left.
type WorkStep<'s> = &'s (dyn Fn() -> bool + Sync + 's);

struct Shared {
    jobs: Mutex<Jobs>,
    /// Signals that there is work, or that the end has come.
    called: Condvar,
    /// Signals that the last helper has left a job.
    left: Condvar,
    /// Number of jobs shared so far.
    calls: AtomicUsize,
}

#[derive(Default)]
struct Jobs {
    open: Vec<Job>,
    /// Number of the next job.
    next: u64,
    ending: bool,
}

struct Job {
    number: u64,
    size: u64,
    step: StepPointer,
    helpers: usize,
    /// Whether all steps are taken, though perhaps not yet done.
    taken: bool,
    /// Why a helper's step panicked.
    panic: Option<Box<dyn Any + Send>>,
}

/// A [`WorkStep`] whose lifetime is guaranteed by [`Open`]: it outlives all helpers of its job.
#[derive(Clone, Copy)]
struct StepPointer(*const (dyn Fn() -> bool + Sync));

// SAFETY: the function pointed to may be called by any thread (`Sync`).
#[allow(unsafe_code)]
unsafe impl Send for StepPointer {}

impl Crew {
    /// Starts `count` threads with `start`, which receives the number of each and what it must run.
    ///
    /// # Errors
    /// Those of `start`; then threads already started end.
    pub fn new(
        count: usize,
        start: impl Fn(usize, Box<dyn FnOnce() + Send>) -> io::Result<JoinHandle<()>>,
    ) -> io::Result<Crew> {
        let shared = Arc::new(Shared {
            jobs: Mutex::default(),
            called: Condvar::new(),
            left: Condvar::new(),
            calls: AtomicUsize::new(0),
        });
        // If dropped on an error, those already started end.
        let mut crew = Crew { shared, threads: Vec::with_capacity(count), process: process::id() };
        for number in 0..count {
            let shared = crew.shared.clone();
            crew.threads.push(start(number, Box::new(move || shared.help()))?);
        }
        Ok(crew)
    }

    /// Number of helpers.
    pub fn len(&self) -> usize {
        self.threads.len()
    }

    /// Whether there are no helpers.
    pub fn is_empty(&self) -> bool {
        self.threads.is_empty()
    }

    fn is_forked(&self) -> bool {
        self.process != process::id()
    }

    /// Calls `step` until it returns that nothing is left, on this thread and on helpers, which prefer work of smaller
    /// `size`. Returns when all steps are done.
    ///
    /// # Panics
    /// When a step does.
    pub fn share(&self, size: u64, step: WorkStep<'_>) {
        if self.threads.is_empty() || self.is_forked() {
            while step() {}
            return;
        }
        let open = Open::new(&self.shared, size, step);
        while step() {}
        if let Some(panic) = open.close() {
            resume_unwind(panic);
        }
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        if self.is_forked() {
            std::mem::forget(std::mem::take(&mut self.threads));
            return;
        }
        self.shared.jobs().ending = true;
        self.shared.called.notify_all();
        for thread in self.threads.drain(..) {
            // A thread cannot wait for itself.
            if thread.thread().id() != thread::current().id() {
                let _ = thread.join();
            }
        }
    }
}

/// A job that is shared. Dropping it waits until no helper works on it any more.
struct Open<'s> {
    shared: &'s Shared,
    number: u64,
}

impl<'s> Open<'s> {
    fn new(shared: &'s Shared, size: u64, step: WorkStep<'s>) -> Open<'s> {
        let step: *const (dyn Fn() -> bool + Sync + 's) = step;
        // SAFETY: only the lifetime changes. `Open::drop`, which runs before `'s` ends, removes the job once no helper
        // uses it any more, and helpers call it only while they are counted.
        #[allow(unsafe_code)]
        let step = StepPointer(unsafe {
            std::mem::transmute::<*const (dyn Fn() -> bool + Sync + 's), *const (dyn Fn() -> bool + Sync)>(step)
        });
        let mut jobs = shared.jobs();
        let number = jobs.next;
        jobs.next += 1;
        jobs.open.push(Job { number, size, step, helpers: 0, taken: false, panic: None });
        shared.calls.fetch_add(1, Ordering::Relaxed);
        drop(jobs);
        shared.called.notify_all();
        Open { shared, number }
    }

    /// Ends it and returns why a helper's step panicked, if one did.
    fn close(self) -> Option<Box<dyn Any + Send>> {
        let panic = self.end();
        std::mem::forget(self);
        panic
    }

    fn end(&self) -> Option<Box<dyn Any + Send>> {
        let mut jobs = self.shared.jobs();
        loop {
            let place = jobs.place(self.number);
            if jobs.open[place].helpers == 0 {
                return jobs.open.swap_remove(place).panic;
            }
            jobs.open[place].taken = true;
            jobs = self.shared.left.wait(jobs).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Drop for Open<'_> {
    fn drop(&mut self) {
        // Reached when a step of this thread has panicked.
        drop(self.end());
    }
}

impl Jobs {
    /// Index of the job in the list, which contains it as long as a thread works on it.
    fn place(&self, number: u64) -> usize {
        let found = self.open.iter().position(|job| job.number == number);
        found.unwrap_or_else(|| unreachable!("job {number} is not open"))
    }

    /// The smallest job that has steps left; of equal ones that with the fewest helpers.
    fn next(&mut self) -> Option<&mut Job> {
        self.open.iter_mut().filter(|job| !job.taken).min_by_key(|job| (job.size, job.helpers))
    }
}

impl Shared {
    fn jobs(&self) -> MutexGuard<'_, Jobs> {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Helps until the end.
    fn help(&self) {
        let mut jobs = self.jobs();
        while !jobs.ending {
            let Some(job) = jobs.next() else {
                jobs = self.called.wait(jobs).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            job.helpers += 1;
            let (number, step) = (job.number, job.step);
            let known = self.calls.load(Ordering::Relaxed);
            drop(jobs);
            let taken = catch_unwind(AssertUnwindSafe(|| {
                // SAFETY: this thread is counted as a helper, so that `Open` keeps the step alive.
                #[allow(unsafe_code)]
                let step = unsafe { &*step.0 };
                loop {
                    if !step() {
                        return true;
                    }
                    // There may be smaller work.
                    if self.calls.load(Ordering::Relaxed) != known {
                        return false;
                    }
                }
            }));
            jobs = self.jobs();
            let place = jobs.place(number);
            let job = &mut jobs.open[place];
            job.helpers -= 1;
            match taken {
                Ok(taken) => job.taken |= taken,
                Err(panic) => (job.taken, job.panic) = (true, Some(panic)),
            }
            if job.helpers == 0 {
                self.left.notify_all();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;
    use std::time::Duration;

    /// Takes one of the steps that are `left`; whether there was one.
    fn take(left: &AtomicUsize) -> bool {
        left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok()
    }

    fn crew(count: usize) -> Crew {
        Crew::new(count, |_, work| thread::Builder::new().spawn(work)).unwrap()
    }

    #[test]
    fn every_step_is_taken_once() {
        for count in [0, 1, 3] {
            let crew = crew(count);
            assert_eq!((crew.len(), crew.is_empty()), (count, count == 0));
            for steps in [0, 1, 1000] {
                let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
                crew.share(1, &|| {
                    let mine = next.fetch_add(1, Ordering::Relaxed);
                    done.fetch_add(usize::from(mine < steps), Ordering::Relaxed);
                    mine < steps
                });
                assert_eq!(done.into_inner(), steps);
            }
        }
    }

    #[test]
    fn many_share_at_once() {
        let crew = crew(2);
        thread::scope(|scope| {
            for size in 0..8 {
                let crew = &crew;
                scope.spawn(move || {
                    for _ in 0..200 {
                        let left = AtomicUsize::new(50);
                        let done = AtomicUsize::new(0);
                        crew.share(size, &|| {
                            let more = take(&left);
                            done.fetch_add(usize::from(more), Ordering::Relaxed);
                            more
                        });
                        assert_eq!(done.into_inner(), 50);
                    }
                });
            }
        });
    }

    #[test]
    fn helpers_go_to_smaller_work() {
        let crew = crew(1);
        let (stop, helped) = (AtomicBool::new(false), AtomicBool::new(false));
        thread::scope(|scope| {
            scope.spawn(|| {
                crew.share(1000, &|| {
                    thread::sleep(Duration::from_millis(1));
                    !stop.load(Ordering::Relaxed)
                });
            });
            thread::sleep(Duration::from_millis(20));
            // The helper is busy with endless work, and comes nevertheless.
            let here = thread::current().id();
            let tries = AtomicUsize::new(0);
            crew.share(1, &|| {
                helped.fetch_or(thread::current().id() != here, Ordering::Relaxed);
                thread::sleep(Duration::from_millis(1));
                !helped.load(Ordering::Relaxed) && tries.fetch_add(1, Ordering::Relaxed) < 5000
            });
            stop.store(true, Ordering::Relaxed);
        });
        assert!(helped.into_inner());
    }

    #[test]
    fn a_forked_process_needs_neither_its_threads_nor_its_locks() {
        let mut crew = crew(2);
        crew.process = 0;
        let done = AtomicUsize::new(0);
        // As if another thread had been sharing work when the process was forked.
        let held = crew.shared.jobs();
        thread::scope(|scope| {
            scope.spawn(|| crew.share(1, &|| done.fetch_add(1, Ordering::Relaxed) < 10));
            let since = std::time::Instant::now();
            while done.load(Ordering::Relaxed) < 10 && since.elapsed() < Duration::from_secs(60) {
                thread::sleep(Duration::from_millis(1));
            }
            let alone = done.load(Ordering::Relaxed);
            drop(held);
            assert!(alone >= 10);
        });
    }

    #[test]
    fn panics_reach_the_thread_that_shared_the_work() {
        let crew = crew(2);
        for only_helpers in [false, true] {
            let here = thread::current().id();
            let left = AtomicUsize::new(1000);
            let shared = catch_unwind(AssertUnwindSafe(|| {
                crew.share(1, &|| {
                    assert!(only_helpers && thread::current().id() == here, "as a test");
                    thread::sleep(Duration::from_millis(1));
                    take(&left)
                });
            }));
            assert!(shared.is_err());
        }
        // The crew still works.
        let left = AtomicUsize::new(10);
        crew.share(1, &|| take(&left));
        assert_eq!(left.into_inner(), 0);
    }
}
