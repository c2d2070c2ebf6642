//! Work shared among threads, or done by the calling thread alone if `Engine` says so.
//!
//! Threads take parts from one list until it is empty. An engine's threads help the calling thread, see [`Crew`]. In a
//! rayon pool of the host, the work is not halved recursively: a thread waiting for the other half would take up any
//! other job of its pool, on the same stack, and wait again inside that. Here it only finds an empty list, and runs
//! other jobs of the pool without the help of further threads.

use echocast_crew::Crew;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::error::Error as _;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Stack size of the threads started here, regardless of the environment: several times what they use.
pub const STACK: usize = 2 << 20;

thread_local! {
    /// Whether this thread must do all work itself: it is an engine's only thread, or others already share its work.
    static ALONE: Cell<bool> = const { Cell::new(false) };
    /// The crew that helps this thread, and the size of the work.
    static CREW: RefCell<Option<(Arc<Crew>, u64)>> = const { RefCell::new(None) };
}

/// Runs `work`, of size `size`, with the help of `crew`.
pub fn with_crew<R>(crew: &Arc<Crew>, size: u64, work: impl FnOnce() -> R) -> R {
    /// Restores the previous state, even if `work` panics.
    struct CrewGuard(Option<(Arc<Crew>, u64)>);
    impl Drop for CrewGuard {
        fn drop(&mut self) {
            CREW.replace(self.0.take());
        }
    }
    let _before = CrewGuard(CREW.replace(Some((crew.clone(), size))));
    work()
}

/// The crew that helps this thread, and the size of the work.
fn crew() -> Option<(Arc<Crew>, u64)> {
    CREW.with_borrow(Clone::clone)
}

/// Runs `work` without the help of other threads.
pub fn alone<R>(work: impl FnOnce() -> R) -> R {
    /// Restores the previous state, even if `work` panics.
    struct AloneGuard(bool);
    impl Drop for AloneGuard {
        fn drop(&mut self) {
            ALONE.set(self.0);
        }
    }
    let _before = AloneGuard(ALONE.replace(true));
    work()
}

/// Starts rayon's global pool, which helps callers that have no other, with one thread per core, unless it has been
/// started already. Rayon itself would panic if the system cannot start the threads.
///
/// # Errors
/// The system's error; there is then no such pool, now or later.
pub fn start_pool() -> Result<(), &'static str> {
    static STARTED: OnceLock<Result<(), String>> = OnceLock::new();
    let start = || match rayon::ThreadPoolBuilder::new().stack_size(STACK).build_global() {
        Err(error) if error.source().is_some() => Err(error.to_string()),
        _ => Ok(()),
    };
    STARTED.get_or_init(start).as_ref().copied().map_err(String::as_str)
}

/// Number of threads that work here.
pub fn threads() -> usize {
    match crew() {
        _ if ALONE.get() => 1,
        Some((crew, _)) => crew.len() + 1,
        // The work gets done without help, too.
        None if rayon::current_thread_index().is_none() && start_pool().is_err() => 1,
        None => rayon::current_num_threads(),
    }
}

/// Does both, possibly at the same time, on a thread that may have help. Jobs that it takes up while waiting, ours or
/// others', it does alone.
fn both<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    alone(|| rayon::join(a, || alone(b)))
}

/// Does `work` on every one of `items`, each on the first free thread.
pub fn for_each_of<T: Send>(items: impl Iterator<Item = T> + Send, work: impl Fn(T) + Sync) {
    /// `work` on up to `threads` free threads.
    fn team(threads: usize, work: &(impl Fn() + Sync)) {
        let half = threads / 2;
        match half {
            0 => work(),
            _ => drop(both(|| team(threads - half, work), || team(half, work))),
        }
    }
    let items = Mutex::new(items);
    let next = || items.lock().unwrap_or_else(PoisonError::into_inner).next();
    // Each part is done by one thread.
    let step = || match next() {
        Some(item) => {
            alone(|| work(item));
            true
        }
        None => false,
    };
    match crew().filter(|_| !ALONE.get()) {
        Some((crew, size)) => crew.share(size, &step),
        None => team(threads(), &|| while step() {}),
    }
}

/// [`for_each_of`] with memory. There are as many `memories` as items being worked on at once, not one for each item,
/// so that they stay in the processor's caches. Each still holds what the previous item left in it.
pub fn for_each_with<M: Default + Send, T: Send>(
    memories: &mut Vec<M>,
    items: impl ExactSizeIterator<Item = T> + Send,
    work: impl Fn(&mut M, T) + Sync,
) {
    let most = threads().min(items.len());
    if memories.len() < most {
        memories.resize_with(most, M::default);
    }
    // First in, first out: each of them gets its full size early.
    let free = Mutex::new(memories.iter_mut().take(most).collect::<VecDeque<_>>());
    let free = || free.lock().unwrap_or_else(PoisonError::into_inner);
    for_each_of(items, |item| {
        let memory = free().pop_front().expect("no more items are worked on at once than there are threads");
        work(memory, item);
        free().push_back(memory);
    });
}

/// Does `work` on every item and its index.
pub fn for_each<T: Send>(items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
    for_each_of(items.iter_mut().enumerate(), |(index, item)| work(index, item));
}

/// Does `work` on every `size` items (the last chunk may be smaller) and the number of the chunk.
pub fn for_each_chunk<T: Send>(items: &mut [T], size: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    for_each_of(items.chunks_mut(size).enumerate(), |(number, chunk)| work(number, chunk));
}

/// Does `work` on `0..count` in ranges of `size`, the last of which may be shorter.
pub fn for_each_range(count: usize, size: usize, work: impl Fn(Range<usize>) + Sync) {
    for_each_of(ranges(count, size), work);
}

fn ranges(count: usize, size: usize) -> impl Iterator<Item = Range<usize>> + Send {
    (0..count).step_by(size).map(move |first| first..(first + size).min(count))
}

/// [`for_each_range`] that combines the results in order; in the same pairs, however many threads there are.
pub fn map_reduce<R: Send>(
    count: usize,
    size: usize,
    work: impl Fn(Range<usize>) -> R + Sync,
    together: impl Fn(R, R) -> R,
) -> R {
    fn pairs<R>(results: &mut [Option<R>], together: &impl Fn(R, R) -> R) -> Option<R> {
        match results {
            [] => None,
            [one] => one.take(),
            _ => {
                let (left, right) = results.split_at_mut(results.len() / 2);
                pairs(left, together).zip(pairs(right, together)).map(|(left, right)| together(left, right))
            }
        }
    }
    let mut results = Vec::new();
    results.resize_with(count.div_ceil(size), || None);
    for_each_of(ranges(count, size).zip(&mut results), |(range, result)| *result = Some(work(range)));
    pairs(&mut results, &together).unwrap_or_else(|| work(0..0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_met_once() {
        let mut items = vec![0; 1000];
        for_each(&mut items, |index, item| *item += index);
        assert!(items.iter().enumerate().all(|(index, item)| index == *item));
    }

    #[test]
    fn as_many_memories_as_threads_are_enough() {
        let mut counts: Vec<usize> = Vec::new();
        for_each_with(&mut counts, 0..1000, |count, _| *count += 1);
        assert_eq!(counts.iter().sum::<usize>(), 1000);
        assert!(counts.len() <= threads());
        alone(|| for_each_with(&mut counts, 0..3, |count, item| *count = item));
        assert_eq!(counts[0], 2);
        let start = |_, work| std::thread::Builder::new().spawn(work);
        let crew = Arc::new(Crew::new(3, start).unwrap());
        let mut counts: Vec<usize> = Vec::new();
        with_crew(&crew, 1, || {
            for items in [2, 1000, 0, 7] {
                for_each_with(&mut counts, 0..items, |count, _| *count += 1);
            }
        });
        assert_eq!((counts.iter().sum::<usize>(), counts.len()), (1009, 4));
    }

    #[test]
    fn chunks_are_whole_up_to_the_last() {
        let mut items = vec![0; 10];
        for_each_chunk(&mut items, 4, |number, chunk| {
            assert_eq!(chunk.len(), if number == 2 { 2 } else { 4 });
            chunk.fill(number);
        });
        assert_eq!(items, [0, 0, 0, 0, 1, 1, 1, 1, 2, 2]);
        for_each_chunk(&mut [0; 0], 4, |_, _| panic!("there is nothing to do"));
    }

    #[test]
    fn results_are_put_together_in_order() {
        let list = |count| map_reduce(count, 3, |r| vec![[r.start, r.end]], |left, right| [left, right].concat());
        assert_eq!(list(8), [[0, 3], [3, 6], [6, 8]]);
        assert_eq!(list(0), [[0, 0]]);
    }

    #[test]
    fn alone_means_this_thread() {
        let here = std::thread::current().id();
        alone(|| {
            assert_eq!(threads(), 1);
            for_each(&mut [(); 100], |_, ()| assert_eq!(std::thread::current().id(), here));
        });
        let _ = std::panic::catch_unwind(|| alone(|| panic!("as a test")));
        assert!(!ALONE.get());
    }
}
