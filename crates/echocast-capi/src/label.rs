//! Names and numbers of labels.

use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::text;
use echocast::scene::{Labels, NameTable};
use std::collections::HashMap;
use std::ffi::{CString, c_char};
use std::ptr;
use std::sync::Arc;

/// The stem and the names of one of the tables of `labels`.
pub(crate) fn label_table<'a>(labels: &'a Labels, table: &str) -> Outcome<(&'static str, &'a NameTable)> {
    let tables = labels.tables();
    let found = tables.into_iter().find(|(stem, _)| *stem == table);
    found.ok_or_else(|| Failure::argument("table", format!("{table:?}"), "category, part, material, instance"))
}

/// Writes the number of `name` in a table of the labels that `with_labels` passes.
///
/// # Safety
/// `table` and `name` are strings and `number` an output, as [`text`] describes.
pub(crate) unsafe fn put_label_number(
    table: *const c_char,
    name: *const c_char,
    number: *mut u32,
    with_labels: impl FnOnce(&mut dyn FnMut(&Labels) -> Outcome<()>) -> Outcome<()>,
) -> echocast_status {
    guard(|| {
        // SAFETY: as the caller promises.
        let number = unsafe { text::output(number, "number") }?.write(0);
        // SAFETY: as the caller promises.
        let (table, name) = unsafe { (text::required(table, "table")?, text::required(name, "name")?) };
        with_labels(&mut |labels| {
            let (_, names) = label_table(labels, table)?;
            *number = match names.id(name) {
                0 => return Err(echocast::Error::missing("label", name, names.names()).into()),
                known => known,
            };
            Ok(())
        })
    })
}

/// Label names that were requested, as C strings.
#[derive(Default)]
pub(crate) struct LabelStrings {
    /// The labels that they belong to.
    labels: Arc<Labels>,
    /// By table and number.
    texts: HashMap<(&'static str, u32), CString>,
}

impl LabelStrings {
    /// Name of a number in a table of `labels`, valid as long as these names belong to the same labels; NULL if there
    /// is none.
    pub fn get(&mut self, labels: &Arc<Labels>, table: &str, number: u32) -> Outcome<*const c_char> {
        let (stem, names) = label_table(labels, table)?;
        let Some(name) = names.name(number) else { return Ok(ptr::null()) };
        if !Arc::ptr_eq(&self.labels, labels) {
            // The names of earlier scenes are no longer valid.
            *self = LabelStrings { labels: labels.clone(), ..LabelStrings::default() };
        }
        let made = || CString::new(name.replace('\0', "?")).unwrap_or_default();
        Ok(self.texts.entry((stem, number)).or_insert_with(made).as_ptr())
    }
}
