//! Immutable arrays of numbers that are shared.

use std::fmt;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// Numbers of a mesh, immutable and shared by clones: a vector, or memory that something else owns.
pub struct Array<T> {
    owner: Arc<dyn AsRef<[T]> + Send + Sync>,
    range: Range<usize>,
}

impl<T> Array<T> {
    /// The elements that `owner` exposes, which must never change; `owner` is dropped with the last clone, on any
    /// thread.
    pub fn new(owner: impl AsRef<[T]> + Send + Sync + 'static) -> Self {
        Array { range: 0..owner.as_ref().len(), owner: Arc::new(owner) }
    }

    /// Whether both are clones of one array.
    pub fn is(&self, other: &Array<T>) -> bool {
        Arc::ptr_eq(&self.owner, &other.owner) && self.range == other.range
    }

    /// The elements from `range.start` up to, but not including, `range.end`, as far as they exist.
    #[must_use]
    pub fn range(&self, range: Range<usize>) -> Array<T> {
        let end = range.end.min(self.len());
        let start = self.range.start + range.start.min(end);
        Array { owner: self.owner.clone(), range: start..self.range.start + end }
    }
}

impl<T: Send + Sync + 'static> From<Vec<T>> for Array<T> {
    fn from(numbers: Vec<T>) -> Self {
        Array::new(numbers)
    }
}

impl<T: Send + Sync + 'static> Default for Array<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T> Clone for Array<T> {
    fn clone(&self) -> Self {
        Array { owner: self.owner.clone(), range: self.range.clone() }
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &(*self.owner).as_ref()[self.range.clone()]
    }
}

impl<T> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "[{} elements]", self.len())
    }
}
