//! XML files, whose errors name the line and the element.

use super::{Limit, bytes};
use crate::error::{Error, Result};
use crate::shown;
use glam::DVec3;
use roxmltree::{Document, Node, ParsingOptions};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// The text of an XML file.
pub struct XmlText {
    path: PathBuf,
    text: String,
    /// Where its lines begin, bytes.
    lines: Vec<usize>,
}

impl XmlText {
    /// Reads the file at `path`, UTF-8, of at most `limit` bytes.
    ///
    /// # Errors
    /// As [`bytes`]; text that is not UTF-8, with its line.
    pub fn load(path: &Path, limit: Limit) -> Result<XmlText> {
        let bytes = bytes(path, limit)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let line = 1 + error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count();
            Error::parse(path, format!("line {line}"), "is not UTF-8; allowed: XML in UTF-8")
        })?;
        let text = text.strip_prefix('\u{feff}').map_or_else(|| text.clone(), str::to_owned);
        let lines = [0].into_iter().chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Ok(XmlText { path: path.to_owned(), text, lines })
    }

    /// Where it was read.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The line of the byte `at`, from 1.
    pub fn line(&self, at: usize) -> u32 {
        self.lines.partition_point(|begin| *begin <= at) as u32
    }

    /// Its elements.
    ///
    /// # Errors
    /// What is not well-formed, with its line; a document type, whose entities could fill the memory.
    pub fn parse(&self) -> Result<Document<'_>> {
        // More elements than any sensible file of the greatest size can have.
        const MOST_NODES: u32 = 2_000_000;
        let options = ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        Document::parse_with_options(&self.text, options).map_err(|error| {
            let line = error.pos().row;
            let message = match error {
                roxmltree::Error::DtdDetected => {
                    // The position of this one is that of the beginning.
                    let at = self.text.find("<!DOCTYPE").unwrap_or(0);
                    let line = 1 + self.text[..at].matches('\n').count();
                    let message =
                        "has a document type (DTD), whose entities may stand for anything; allowed: XML without";
                    return Error::parse(&self.path, format!("line {line}"), message);
                }
                roxmltree::Error::NodesLimitReached => format!("has more than {MOST_NODES} elements, the most allowed"),
                other => format!("is not well-formed XML: {other}"),
            };
            Error::parse(&self.path, format!("line {line}"), message)
        })
    }
}

/// An element of an XML file, whose namespace does not count.
#[derive(Clone, Copy)]
pub struct Xml<'d> {
    /// As the parser has it.
    pub node: Node<'d, 'd>,
    text: &'d XmlText,
}

impl<'d> Xml<'d> {
    /// The outermost element of `document`, which is that of `text`.
    pub fn root(document: &'d Document<'d>, text: &'d XmlText) -> Xml<'d> {
        Xml { node: document.root_element(), text }
    }

    /// Name of the element.
    pub fn name(self) -> &'d str {
        self.node.tag_name().name()
    }

    /// The file that it is in.
    pub fn path(self) -> &'d Path {
        &self.text.path
    }

    /// The line where it begins, from 1.
    pub fn line(self) -> u32 {
        self.text.line(self.node.range().start)
    }

    /// An error about it: what was found and what is allowed.
    pub fn error(self, message: impl Display) -> Error {
        let named = match self.attribute("name") {
            Some(name) => format!("{} {:?}", self.name(), shown::name(name)),
            None => self.name().to_owned(),
        };
        Error::parse(self.path(), format!("line {}", self.line()), format!("{named} {message}"))
    }

    /// A sentence about it, for warnings.
    pub fn told(self, message: impl Display) -> String {
        self.error(message).to_string()
    }

    /// An error about one of its attributes: what is allowed.
    pub fn wrong(self, attribute: &str, allowed: impl Display) -> Error {
        let found = self.attribute(attribute).unwrap_or_default();
        self.error(format_args!("has {attribute} {:?}; allowed: {allowed}", shown::name(found)))
    }

    /// The text of an attribute.
    pub fn attribute(self, name: &str) -> Option<&'d str> {
        self.node.attribute(name)
    }

    /// The text of an attribute that there must be.
    ///
    /// # Errors
    /// It is not there.
    pub fn required(self, name: &str) -> Result<&'d str> {
        self.attribute(name).ok_or_else(|| self.error(format_args!("has no attribute {name}")))
    }

    /// The number of an attribute.
    ///
    /// # Errors
    /// Anything but a finite number.
    pub fn number(self, name: &str) -> Result<Option<f64>> {
        Ok(self.numbers::<1>(name)?.map(|[number]| number))
    }

    /// The numbers of an attribute, as many as asked for.
    ///
    /// # Errors
    /// Another count, or anything but finite numbers.
    pub fn numbers<const N: usize>(self, name: &str) -> Result<Option<[f64; N]>> {
        let Some(text) = self.attribute(name) else { return Ok(None) };
        let numbers = finite(text).and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
        let what = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
        numbers.map(Some).ok_or_else(|| self.wrong(name, what))
    }

    /// The vector of an attribute.
    ///
    /// # Errors
    /// As [`Xml::numbers`].
    pub fn vector(self, name: &str) -> Result<Option<DVec3>> {
        Ok(self.numbers::<3>(name)?.map(DVec3::from))
    }

    /// All numbers of an attribute, however many.
    ///
    /// # Errors
    /// Anything but finite numbers.
    pub fn all_numbers(self, name: &str) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.attribute(name) else { return Ok(None) };
        finite(text).map(Some).ok_or_else(|| self.wrong(name, "numbers"))
    }

    /// The elements in it.
    pub fn elements(self) -> impl Iterator<Item = Xml<'d>> {
        self.node.children().filter(Node::is_element).map(move |node| Xml { node, ..self })
    }

    /// The elements called `name` in it.
    pub fn children<'n>(self, name: &'n str) -> impl Iterator<Item = Xml<'d>> + use<'d, 'n> {
        let of_name = self.node.children().filter(move |node| node.is_element() && node.tag_name().name() == name);
        of_name.map(move |node| Xml { node, ..self })
    }

    /// The first element called `name` in it.
    pub fn child(self, name: &str) -> Option<Xml<'d>> {
        self.children(name).next()
    }

    /// The text in it, without blanks around it.
    pub fn content(self) -> &'d str {
        self.node.text().unwrap_or_default().trim()
    }

    /// The text of the first element called `name` in it.
    pub fn content_of(self, name: &str) -> Option<&'d str> {
        self.child(name).map(Xml::content)
    }

    /// The numbers in it, as many as asked for.
    ///
    /// # Errors
    /// Another count, or anything but finite numbers.
    pub fn content_numbers<const N: usize>(self) -> Result<[f64; N]> {
        let numbers = finite(self.content()).and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
        numbers.ok_or_else(|| {
            let what = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
            self.error(format_args!("holds {:?}; allowed: {what}", shown::name(self.content())))
        })
    }

    /// The number of the first element called `name` in it.
    ///
    /// # Errors
    /// As [`Xml::content_numbers`].
    pub fn number_of(self, name: &str) -> Result<Option<f64>> {
        self.child(name).map(|child| child.content_numbers::<1>().map(|[number]| number)).transpose()
    }
}

/// The numbers of a list with blanks between them; `None`: not all are finite numbers.
fn finite(text: &str) -> Option<Vec<f64>> {
    text.split_ascii_whitespace().map(|word| word.parse().ok().filter(|number: &f64| number.is_finite())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn faults(text: &str, look: impl Fn(Xml<'_>) -> Result<()>) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xml");
        fs::write(&path, text).unwrap();
        let read = || {
            let text = XmlText::load(&path, Limit::XML)?;
            let document = text.parse()?;
            look(Xml::root(&document, &text))
        };
        read().unwrap_err().to_string().replace(path.to_str().unwrap(), "FILE")
    }

    #[test]
    fn errors_name_the_line_and_the_element() {
        let text = "<robot>\n\n<joint name='hip' axis='1 0 nan'>1 2</joint></robot>";
        let about = |look: fn(Xml<'_>) -> Result<()>| faults(text, |root| look(root.child("joint").unwrap()));
        let axis = about(|joint| joint.vector("axis").map(drop));
        assert_eq!(axis, "FILE: line 3: joint \"hip\" has axis \"1 0 nan\"; allowed: 3 numbers");
        let content = about(|joint| joint.content_numbers::<3>().map(drop));
        assert_eq!(content, "FILE: line 3: joint \"hip\" holds \"1 2\"; allowed: 3 numbers");
        assert_eq!(
            about(|joint| joint.required("type").map(drop)),
            "FILE: line 3: joint \"hip\" has no attribute type"
        );
    }

    #[test]
    fn what_is_not_well_formed_or_could_fill_the_memory_is_refused() {
        let fault = |text| faults(text, |_| Ok(()));
        assert!(fault("<a>\n<b></a>").starts_with("FILE: line 2: is not well-formed XML: "));
        assert!(fault("\n<!DOCTYPE a [<!ENTITY b 'c'>]><a/>").starts_with("FILE: line 2: has a document type (DTD)"));
    }
}
