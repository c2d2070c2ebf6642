//! stub
use crate::folders::ModelFolders;
use crate::robot::{GeometryUse, Robot};
use ground::error::Result;
use ground::read::xml::Xml;
pub(crate) fn read(root: Xml<'_>, _folders: ModelFolders<'_>, _geometry: GeometryUse) -> Result<Robot> {
    Err(root.error("stub"))
}
