//! Work shared among threads, or done by the calling thread alone where [`crate::Engine`] says so.

use std::cell::Cell;

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
    fn part<T: Send>(items: &mut [T], first: usize, work: &(impl Fn(usize, &mut T) + Sync)) {
        match items {
            [] => {}
            [item] => work(first, item),
            _ => {
                let half = items.len() / 2;
                let (left, right) = items.split_at_mut(half);
                join(|| part(left, first, work), || part(right, first + half, work));
            }
        }
    }
    part(items, 0, &work);
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
