//! What the elements of a COLLADA file refer to.

use ground::error::Result;
use ground::read::xml::Xml;
use ground::shown;
use std::collections::HashMap;

/// Every element of a file that has an id.
pub(super) struct ColladaLibrary<'d> {
    ids: HashMap<&'d str, Xml<'d>>,
}

impl<'d> ColladaLibrary<'d> {
    /// Those below `root`; of two with one id the first counts.
    pub fn new(root: Xml<'d>) -> Self {
        let mut ids = HashMap::new();
        let mut open = vec![root];
        while let Some(element) = open.pop() {
            if let Some(id) = element.attribute("id") {
                ids.entry(id).or_insert(element);
            }
            let below: Vec<Xml<'d>> = element.elements().collect();
            open.extend(below.into_iter().rev());
        }
        ColladaLibrary { ids }
    }

    /// The element with an id.
    pub fn with_id(&self, id: &str) -> Option<Xml<'d>> {
        self.ids.get(id).copied()
    }

    /// The element that the URL in an attribute of `element` means: `#id`.
    ///
    /// # Errors
    /// There is none, or it is in another file.
    pub fn referred(&self, element: Xml<'d>, attribute: &str) -> Result<Xml<'d>> {
        let url = element.required(attribute)?;
        let Some(id) = url.strip_prefix('#') else {
            return Err(element.wrong(attribute, "`#id` of an element of the same file"));
        };
        self.with_id(id).ok_or_else(|| {
            let id = shown::name(id).to_string();
            element.error(format_args!("refers to {id:?}, which is no id; allowed: ids of this file"))
        })
    }
}

/// The name of an element: its `name`, else its `id`.
pub(super) fn name_of<'d>(element: Xml<'d>) -> &'d str {
    let named = element.attribute("name").filter(|name| !name.is_empty());
    named.or(element.attribute("id")).unwrap_or_default()
}
