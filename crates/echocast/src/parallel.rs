//! Work shared among threads, or done by the calling thread alone where [`crate::Engine`] says so.

use std::cell::Cell;
use std::ops::Range;

thread_local! {
    /// Whether this thread must do all work itself: asking rayon would start its threads.
    static ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work` without help of other threads.
pub(crate) fn alone<R>(work: impl FnOnce() -> R) -> R {
    /// Puts back what was, also when `work` panics.
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            ALONE.set(self.0);
        }
    }
    let _before = Before(ALONE.replace(true));
    work()
}

/// Threads that work here.
pub(crate) fn threads() -> usize {
    if ALONE.get() { 1 } else { rayon::current_num_threads() }
}

/// Does both, perhaps at the same time.
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    if ALONE.get() { (a(), b()) } else { rayon::join(a, b) }
}

/// Does `work` on every item and its index.
pub(crate) fn for_each<T: Send>(items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
    for_each_chunk(items, 1, |index, item| item.iter_mut().for_each(|item| work(index, item)));
}

/// Does `work` on every `size` items, the last of which may be fewer, and the number of the chunk.
pub(crate) fn for_each_chunk<T: Send>(items: &mut [T], size: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    fn part<T: Send>(items: &mut [T], size: usize, first: usize, work: &(impl Fn(usize, &mut [T]) + Sync)) {
        match items.len().div_ceil(size) {
            0 => {}
            1 => work(first, items),
            chunks => {
                let half = chunks / 2;
                let (left, right) = items.split_at_mut(half * size);
                join(|| part(left, size, first, work), || part(right, size, first + half, work));
            }
        }
    }
    part(items, size, 0, &work);
}

/// Does `work` on `0..count` in ranges of `size`, the last of which may be shorter.
pub(crate) fn for_each_range(count: usize, size: usize, work: impl Fn(Range<usize>) + Sync) {
    map_reduce(count, size, work, |(), ()| ());
}

/// [`for_each_range`] that puts the results together in their order; in the same pairs, however many threads there are.
pub(crate) fn map_reduce<R: Send>(
    count: usize,
    size: usize,
    work: impl Fn(Range<usize>) -> R + Sync,
    together: impl Fn(R, R) -> R + Sync,
) -> R {
    fn part<R: Send>(
        range: Range<usize>,
        size: usize,
        work: &(impl Fn(Range<usize>) -> R + Sync),
        together: &(impl Fn(R, R) -> R + Sync),
    ) -> R {
        let chunks = range.len().div_ceil(size);
        if chunks <= 1 {
            return work(range);
        }
        let middle = range.start + chunks / 2 * size;
        let (left, right) =
            join(|| part(range.start..middle, size, work, together), || part(middle..range.end, size, work, together));
        together(left, right)
    }
    part(0..count, size, &work, &together)
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
