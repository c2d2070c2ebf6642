//! Attributes of elements with the defaults of their classes.

use ground::error::{Error, Result};
use ground::read::xml::Xml;
use ground::shown;
use std::collections::HashMap;

/// The name of the outermost class.
const MAIN: &str = "main";

/// A class of defaults.
struct DefaultClass<'d> {
    above: Option<&'d str>,
    /// Its elements, such as `<geom>`, that hold defaults.
    elements: Vec<Xml<'d>>,
}

/// All classes of defaults of a model.
#[derive(Default)]
pub(super) struct MjcfDefaults<'d>(HashMap<&'d str, DefaultClass<'d>>);

impl<'d> MjcfDefaults<'d> {
    /// Adds a `<default>` of the model and those in it; `children` are the elements in an element.
    pub fn add(&mut self, top: Xml<'d>, children: &impl Fn(Xml<'d>) -> Vec<Xml<'d>>) -> Result<()> {
        let mut open = vec![(top, None)];
        while let Some((element, above)) = open.pop() {
            let class = match (element.attribute("class"), above) {
                (Some(class), _) => class,
                (None, None) => MAIN,
                (None, Some(_)) => return Err(element.error("has no attribute class; allowed: classes with names")),
            };
            let own = self.0.entry(class).or_insert(DefaultClass { above, elements: Vec::new() });
            for inner in children(element) {
                match inner.name() {
                    "default" => open.push((inner, Some(class))),
                    // What is said later counts.
                    _ => own.elements.insert(0, inner),
                }
            }
        }
        // The outermost class is the one called main, whatever it is called.
        if let Some(class) = top.attribute("class").filter(|class| *class != MAIN) {
            self.0.entry(MAIN).or_insert(DefaultClass { above: Some(class), elements: Vec::new() });
        }
        Ok(())
    }

    /// The element of a class, or of those above it, that says something of `attribute` of elements called `kind`.
    fn find(&self, class: &str, kind: &str, attribute: &str) -> Option<Xml<'d>> {
        let mut next = Some(class);
        // Classes are a tree, but a name may come twice.
        for _ in 0..=self.0.len() {
            let own = self.0.get(next?)?;
            let says = |element: &&Xml<'d>| element.name() == kind && element.attribute(attribute).is_some();
            if let Some(found) = own.elements.iter().find(says) {
                return Some(*found);
            }
            next = own.above;
        }
        None
    }
}

/// An element with what its class says of it.
#[derive(Clone, Copy)]
pub(super) struct Classed<'d, 'm> {
    pub element: Xml<'d>,
    defaults: &'m MjcfDefaults<'d>,
    class: &'d str,
}

impl<'d, 'm> Classed<'d, 'm> {
    /// `element` with the class that it names, or else that of the bodies around it.
    ///
    /// # Errors
    /// A class that there is not.
    pub fn new(element: Xml<'d>, around: Option<&'d str>, defaults: &'m MjcfDefaults<'d>) -> Result<Self> {
        let class = element.attribute("class").or(around).unwrap_or(MAIN);
        if class != MAIN && !defaults.0.contains_key(class) {
            let missing = Error::missing("class", class, defaults.0.keys());
            return Err(element.error(format_args!("is of a class that is not defined: {missing}")));
        }
        Ok(Classed { element, defaults, class })
    }

    /// The element that has an attribute: itself, or one of its class.
    fn holder(self, attribute: &str) -> Xml<'d> {
        if self.element.attribute(attribute).is_some() {
            return self.element;
        }
        self.defaults.find(self.class, self.element.name(), attribute).unwrap_or(self.element)
    }

    /// The text of an attribute.
    pub fn attribute(self, name: &str) -> Option<&'d str> {
        self.holder(name).attribute(name)
    }

    /// The number of an attribute.
    pub fn number(self, name: &str) -> Result<Option<f64>> {
        self.holder(name).number(name)
    }

    /// The numbers of an attribute.
    pub fn numbers<const N: usize>(self, name: &str) -> Result<Option<[f64; N]>> {
        self.holder(name).numbers(name)
    }

    /// All numbers of an attribute.
    pub fn all_numbers(self, name: &str) -> Result<Option<Vec<f64>>> {
        self.holder(name).all_numbers(name)
    }

    /// An error about an attribute: what is allowed.
    pub fn wrong(self, attribute: &str, allowed: &str) -> Error {
        let holder = self.holder(attribute);
        if holder.attribute(attribute).is_some() {
            return holder.wrong(attribute, allowed);
        }
        self.element.error(format_args!("has no attribute {}; allowed: {allowed}", shown::name(attribute)))
    }
}
