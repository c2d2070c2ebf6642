//! A scan of a radar: one frame, or one turn.

mod paths;
#[cfg(test)]
mod tests;
