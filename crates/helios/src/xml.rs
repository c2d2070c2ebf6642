//! XML files, whose every element and attribute is noted.

use crate::notes::{NoteBook, XmlPlace};
use ground::error::{Error, Result};
use ground::read::xml::XmlText;
use ground::shown;
use roxmltree::{Document, Node};

/// An element; what is asked of it is noted as used.
#[derive(Clone, Copy)]
pub(crate) struct XmlElement<'d> {
    node: Node<'d, 'd>,
    text: &'d XmlText,
    file: u32,
    notes: &'d NoteBook,
}

impl<'d> XmlElement<'d> {
    /// The outermost element of `document`, which is that of `text`.
    pub fn root(document: &'d Document<'d>, text: &'d XmlText, notes: &'d NoteBook) -> XmlElement<'d> {
        XmlElement { node: document.root_element(), text, file: notes.file(text.path()), notes }
    }

    /// The outermost element around it.
    pub fn outermost(self) -> XmlElement<'d> {
        XmlElement { node: self.node.document().root_element(), ..self }
    }

    /// The element `kind` in it with this id; all below it is noted.
    ///
    /// # Errors
    /// There is none, with similar ids.
    pub fn asset(self, kind: &'static str, id: &str) -> Result<XmlElement<'d>> {
        let of_kind = || self.node.children().filter(|node| node.tag_name().name() == kind);
        let found = of_kind().find(|node| node.attribute("id") == Some(id));
        let node = found.ok_or_else(|| Error::missing(kind, id, of_kind().filter_map(|node| node.attribute("id"))))?;
        let found = XmlElement { node, ..self };
        found.note_all();
        found.text("id");
        Ok(found)
    }

    /// Name of the element.
    pub fn name(self) -> &'d str {
        self.node.tag_name().name()
    }

    /// Where it is.
    pub fn place(self) -> XmlPlace {
        XmlPlace { file: self.file, node: self.node.id().get(), line: self.text.line(self.node.range().start) }
    }

    /// The notes.
    pub fn notes(self) -> &'d NoteBook {
        self.notes
    }

    /// Notes that it and all below it are there.
    pub fn note_all(self) {
        for node in self.node.descendants().filter(Node::is_element) {
            let element = XmlElement { node, ..self };
            let place = element.place();
            self.notes.found(place, element.name(), None);
            for attribute in node.attributes() {
                self.notes.found(place, element.name(), Some((attribute.name(), attribute.value())));
            }
        }
        self.notes.used(self.place(), "");
    }

    /// Notes that it and all below it have no effect.
    pub fn not_understood(self, why: &str) {
        for node in self.node.descendants().filter(Node::is_element) {
            let place = XmlElement { node, ..self }.place();
            self.notes.not_understood(place, "", why);
            node.attributes().for_each(|attribute| self.notes.not_understood(place, attribute.name(), why));
        }
    }

    /// An error about it: what was found and what is allowed.
    pub fn error(self, message: impl std::fmt::Display) -> Error {
        Error::parse(self.text.path(), format!("line {}", self.place().line), format!("{} {message}", self.name()))
    }

    /// An error about one of its attributes: what is allowed.
    pub fn wrong(self, attribute: &str, allowed: impl std::fmt::Display) -> Error {
        let found = self.node.attribute(attribute).unwrap_or_default();
        self.error(format_args!("{attribute} is {:?}; allowed: {allowed}", shown::name(found)))
    }

    /// The text of an attribute.
    pub fn text(self, attribute: &str) -> Option<&'d str> {
        let value = self.node.attribute(attribute)?;
        self.notes.used(self.place(), attribute);
        Some(value)
    }

    /// The text of an attribute that there must be.
    pub fn required(self, attribute: &str) -> Result<&'d str> {
        self.text(attribute).ok_or_else(|| self.error(format_args!("has no attribute {attribute}")))
    }

    /// The number of an attribute.
    pub fn number(self, attribute: &str) -> Result<Option<f64>> {
        let Some(text) = self.text(attribute) else { return Ok(None) };
        let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.map(Some).ok_or_else(|| self.wrong(attribute, "a number"))
    }

    /// The number of an attribute, `low` to `high`.
    pub fn number_within(self, attribute: &str, low: f64, high: f64) -> Result<Option<f64>> {
        match self.number(attribute)? {
            Some(number) if !(low..=high).contains(&number) => {
                Err(self.wrong(attribute, format_args!("{low} to {high}")))
            }
            number => Ok(number),
        }
    }

    /// The truth of an attribute.
    pub fn flag(self, attribute: &str) -> Result<Option<bool>> {
        match self.text(attribute).map(str::trim) {
            None => Ok(None),
            Some("true" | "1") => Ok(Some(true)),
            Some("false" | "0") => Ok(Some(false)),
            Some(_) => Err(self.wrong(attribute, "true or false")),
        }
    }

    /// The whole number of an attribute, `low` to `high`.
    pub fn count(self, attribute: &str, low: u32, high: u32) -> Result<Option<u32>> {
        let number = self.number_within(attribute, low.into(), high.into())?;
        match number.filter(|number| number.fract() != 0.0) {
            Some(_) => Err(self.wrong(attribute, format_args!("a whole number, {low} to {high}"))),
            None => Ok(number.map(|number| number as u32)),
        }
    }

    /// The elements called `name` in it.
    pub fn children(self, name: &'d str) -> impl Iterator<Item = XmlElement<'d>> {
        let of_name = self.node.children().filter(move |node| node.is_element() && node.tag_name().name() == name);
        of_name.map(move |node| {
            let element = XmlElement { node, ..self };
            self.notes.used(element.place(), "");
            element
        })
    }

    /// The first element called `name` in it.
    pub fn child(self, name: &'d str) -> Option<XmlElement<'d>> {
        self.children(name).next()
    }

    /// The text in it.
    pub fn content(self) -> &'d str {
        self.node.text().unwrap_or_default().trim()
    }
}
