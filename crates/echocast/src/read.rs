//! Reading files: all files, named by a user or by another file, are opened here.

#[doc(inline)]
pub use ground::read::noting;
