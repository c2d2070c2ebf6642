use super::{LoadOptions, Scene};
use crate::error::Result;
use std::path::Path;

pub(super) fn read(_path: &Path, _options: &LoadOptions) -> Result<Scene> {
    todo!()
}
