//! Geometries: polygons with the numbers of their sources.

use super::library::{ColladaLibrary, name_of};
use super::material::ColladaMaterials;
use crate::FileOptions;
use crate::faces::{Corner, Faces, NONE, PartMaker};
use crate::notes::Notes;
use glam::DVec3;
use ground::error::Result;
use ground::read::xml::Xml;
use ground::shown;
use model::Mesh;
use model::material::Material;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// A mesh, and where its origin is in the coordinates of its geometry, file units.
#[derive(Clone)]
pub(super) struct ColladaMesh {
    pub mesh: Arc<Mesh>,
    pub middle: DVec3,
}

/// The material of a symbol of a geometry, and the number of the set of texture coordinates that it uses, if it says so.
pub(super) type Binding<'d> = (&'d str, Xml<'d>, Option<u32>);

/// The meshes of geometries, each made when first needed.
pub(super) struct ColladaMeshes<'d, 'a> {
    pub materials: ColladaMaterials<'d, 'a>,
    /// Triangles without area that were left out.
    pub degenerate_triangles: usize,
    library: &'a ColladaLibrary<'d>,
    options: &'a FileOptions<'a>,
    /// By the geometry and its materials.
    known: HashMap<String, Option<ColladaMesh>>,
}

/// What an `<input>` of a primitive is about.
struct Input<'d> {
    semantic: &'d str,
    source: Xml<'d>,
    /// Which of the indices of a corner is its.
    offset: usize,
    set: u32,
}

/// Where the elements of sources are in the arrays of the faces.
#[derive(Default)]
struct Places {
    /// By the id of a source and the kind of its numbers: the first element and how many there are.
    first: HashMap<(String, char), [u32; 2]>,
}

/// The indices of a corner's attributes: which of its numbers, and the elements that it counts.
#[derive(Clone, Copy, Default)]
struct CornerIndex {
    offset: usize,
    elements: [u32; 2],
}

impl CornerIndex {
    /// The index of the corner with these indices; `None`: it is out of range.
    fn index(self, corner: &[u32]) -> Option<u32> {
        let [first, count] = self.elements;
        corner.get(self.offset).filter(|&&index| index < count).map(|index| first + index)
    }
}

impl<'d, 'a> ColladaMeshes<'d, 'a> {
    pub fn new(
        library: &'a ColladaLibrary<'d>,
        options: &'a FileOptions<'a>,
        materials: ColladaMaterials<'d, 'a>,
    ) -> Self {
        ColladaMeshes { materials, degenerate_triangles: 0, library, options, known: HashMap::new() }
    }

    /// The mesh of a geometry with the materials of `bindings`; `None`: it has no triangles.
    pub fn get(
        &mut self,
        geometry: Xml<'d>,
        bindings: &[Binding<'d>],
        notes: &mut Notes,
    ) -> Result<Option<ColladaMesh>> {
        let bound: Vec<_> =
            bindings.iter().map(|(symbol, target, set)| (symbol, target.attribute("id"), set)).collect();
        let key = format!("{:?} {bound:?}", geometry.node.id());
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        let mesh = self.make(geometry, bindings, notes)?;
        self.known.insert(key, mesh.clone());
        Ok(mesh)
    }

    fn make(&mut self, geometry: Xml<'d>, bindings: &[Binding<'d>], notes: &mut Notes) -> Result<Option<ColladaMesh>> {
        let name = name_of(geometry);
        let Some(mesh) = geometry.child("mesh") else {
            notes.add("geometries other than meshes are left out", || format!("{:?}", shown::name(name)));
            return Ok(None);
        };
        let mut faces = Faces::default();
        let mut places = Places::default();
        // The faces of each material symbol.
        let mut runs: Vec<(&str, Range<usize>)> = Vec::new();
        for primitive in mesh.elements() {
            let symbol = primitive.attribute("material").unwrap_or_default();
            let first = faces.face_ends.len();
            match primitive.name() {
                "triangles" | "polylist" | "polygons" | "tristrips" | "trifans" => {
                    let set = bindings.iter().find(|binding| binding.0 == symbol).and_then(|binding| binding.2);
                    self.polygons(primitive, set, &mut faces, &mut places, notes)?;
                }
                "lines" | "linestrips" => {
                    notes.add("lines are left out", || format!("{:?}", shown::name(name)));
                }
                _ => {}
            }
            runs.push((symbol, first..faces.face_ends.len()));
        }
        faces.check_size().map_err(|why| geometry.error(why))?;
        runs.retain(|(_, run)| !run.is_empty());
        // Stable: the faces of a material stay in their order.
        runs.sort_by_key(|(symbol, _)| *symbol);
        let mut maker = PartMaker::new(&faces, self.options.keeps_sources);
        let all: Vec<Range<usize>> = runs.iter().map(|(_, run)| run.clone()).collect();
        if all.is_empty() {
            return Ok(None);
        }
        let middle = maker.middle(&all);
        let mut parts = Vec::new();
        for runs in runs.chunk_by(|a, b| a.0 == b.0) {
            let material = self.material(runs[0].0, bindings, notes)?;
            let textured = material.as_ref().is_some_and(|material| material.images().next().is_some());
            let own: Vec<Range<usize>> = runs.iter().map(|(_, run)| run.clone()).collect();
            parts.extend(maker.part(&own, middle, textured).map(|part| part.material(material)));
        }
        self.degenerate_triangles += maker.degenerate_triangles;
        let source = maker.source(middle);
        let made = (!parts.is_empty()).then(|| Mesh::trusted(name.to_owned(), parts).with_source(source));
        Ok(made.map(|mesh| ColladaMesh { mesh: Arc::new(mesh), middle }))
    }

    /// The material of a symbol: that which is bound to it, or, as some exporters write it, that of its name.
    fn material(&mut self, symbol: &str, bindings: &[Binding<'d>], notes: &mut Notes) -> Result<Option<Arc<Material>>> {
        let bound = bindings.iter().find(|binding| binding.0 == symbol).map(|binding| binding.1);
        let named = || self.library.with_id(symbol).filter(|element| element.name() == "material");
        match bound.or_else(named) {
            Some(material) => self.materials.get(material, notes).map(Some),
            None => Ok(None),
        }
    }

    /// Adds the polygons of a primitive to `faces`.
    fn polygons(
        &self,
        primitive: Xml<'d>,
        set: Option<u32>,
        faces: &mut Faces,
        places: &mut Places,
        notes: &mut Notes,
    ) -> Result<()> {
        let inputs = self.inputs(primitive)?;
        let width = 1 + inputs.iter().map(|input| input.offset).max().unwrap_or(0);
        let of = |semantic: &'static str| inputs.iter().filter(move |input| input.semantic == semantic);
        let Some(input) = of("POSITION").next() else { return Err(primitive.error("has no positions")) };
        let position = CornerIndex { offset: input.offset, elements: places.positions(input.source, faces)? };
        let normal = match of("NORMAL").next() {
            Some(input) => CornerIndex { offset: input.offset, elements: places.normals(input.source, faces)? },
            None => CornerIndex::default(),
        };
        let wanted = of("TEXCOORD")
            .find(|input| Some(input.set) == set)
            .or_else(|| of("TEXCOORD").min_by_key(|input| input.set));
        let texcoord = match wanted {
            Some(input) => CornerIndex { offset: input.offset, elements: places.texcoords(input.source, faces)? },
            None => CornerIndex::default(),
        };
        let mut add = |corners: &mut dyn Iterator<Item = &[u32]>| -> Result<()> {
            let before = faces.corners.len();
            for corner in corners {
                let Some(at) = position.index(corner) else {
                    let (found, count) =
                        (corner.get(position.offset).copied().unwrap_or_default(), position.elements[1]);
                    return Err(primitive.error(format_args!(
                        "has the index {found}; allowed: below {count}, the number of positions"
                    )));
                };
                let [texcoord, normal] = [texcoord, normal].map(|attribute| attribute.index(corner).unwrap_or(NONE));
                faces.corners.push(Corner { position: at, texcoord, normal });
            }
            if faces.corners.len() - before < 3 {
                faces.corners.truncate(before);
                notes.add("polygons of fewer than three corners are left out", || format!("line {}", primitive.line()));
            } else {
                faces.face_ends.push(faces.corners.len());
            }
            Ok(())
        };
        let lists = primitive.children("p").map(|list| indices(list, width));
        let holes = primitive.children("ph").count();
        match primitive.name() {
            "triangles" => {
                for list in lists {
                    list?.chunks_exact(3 * width).try_for_each(|face| add(&mut face.chunks_exact(width)))?;
                }
            }
            "polylist" => {
                let counts =
                    primitive.child("vcount").map(|counts| indices(counts, 1)).transpose()?.unwrap_or_default();
                let list = primitive.child("p").map(|list| indices(list, width)).transpose()?.unwrap_or_default();
                let mut rest = &list[..];
                for count in counts {
                    let Some((face, after)) = rest.split_at_checked((count as usize).saturating_mul(width)) else {
                        return Err(primitive.error("has fewer indices in p than vcount says"));
                    };
                    add(&mut face.chunks_exact(width))?;
                    rest = after;
                }
            }
            "polygons" => {
                for list in lists {
                    add(&mut list?.chunks_exact(width))?;
                }
            }
            kind => {
                for list in lists {
                    let list = list?;
                    let corners: Vec<&[u32]> = list.chunks_exact(width).collect();
                    for index in 2..corners.len() {
                        // Every other triangle of a strip turns the other way.
                        let face = match (kind, index % 2) {
                            ("trifans", _) => [corners[0], corners[index - 1], corners[index]],
                            (_, 0) => [corners[index - 2], corners[index - 1], corners[index]],
                            _ => [corners[index - 1], corners[index - 2], corners[index]],
                        };
                        add(&mut face.into_iter())?;
                    }
                }
            }
        }
        if holes > 0 {
            notes.add("polygons with holes are left out", || format!("line {}", primitive.line()));
        }
        Ok(())
    }

    /// The inputs of a primitive; those of its `<vertices>` have the index of these.
    fn inputs(&self, primitive: Xml<'d>) -> Result<Vec<Input<'d>>> {
        let mut inputs = Vec::new();
        for input in primitive.children("input") {
            let offset = input.number("offset")?.unwrap_or(0.0);
            // More than any exporter writes.
            if !(0.0..=255.0).contains(&offset) || offset.fract() != 0.0 {
                return Err(input.wrong("offset", "whole numbers, 0 to 255"));
            }
            let set = input.number("set")?.unwrap_or(0.0).max(0.0) as u32;
            let (semantic, source) = (input.required("semantic")?, self.library.referred(input, "source")?);
            if semantic != "VERTEX" {
                inputs.push(Input { semantic, source, offset: offset as usize, set });
                continue;
            }
            for inner in source.children("input") {
                let source = self.library.referred(inner, "source")?;
                inputs.push(Input { semantic: inner.required("semantic")?, source, offset: offset as usize, set });
            }
        }
        Ok(inputs)
    }
}

impl Places {
    /// The place of what `add` adds for a source, unless it is there already.
    fn of(&mut self, source: Xml<'_>, kind: char, add: impl FnOnce() -> Result<[usize; 2]>) -> Result<[u32; 2]> {
        // Ids are unique; sources without one are told apart by their nodes.
        let key = (format!("{:?}", source.node.id()), kind);
        if let Some(known) = self.first.get(&key) {
            return Ok(*known);
        }
        let [first, count] = add()?;
        let fits = |number: usize| u32::try_from(number).map_err(|_| source.error("has more numbers than fit"));
        let place = [fits(first)?, fits(count)?];
        self.first.insert(key, place);
        Ok(place)
    }

    fn positions(&mut self, source: Xml<'_>, faces: &mut Faces) -> Result<[u32; 2]> {
        self.of(source, 'p', || {
            let first = faces.positions.len();
            faces.positions.extend(elements::<3>(source)?);
            Ok([first, faces.positions.len() - first])
        })
    }

    fn normals(&mut self, source: Xml<'_>, faces: &mut Faces) -> Result<[u32; 2]> {
        self.of(source, 'n', || {
            let first = faces.normals.len();
            let unit = |normal: [f64; 3]| DVec3::from(normal).normalize_or_zero().as_vec3().to_array();
            faces.normals.extend(elements::<3>(source)?.into_iter().map(unit));
            Ok([first, faces.normals.len() - first])
        })
    }

    fn texcoords(&mut self, source: Xml<'_>, faces: &mut Faces) -> Result<[u32; 2]> {
        self.of(source, 't', || {
            let first = faces.texcoords.len();
            faces.texcoords.extend(elements::<2>(source)?.into_iter().map(|uv| uv.map(|number| number as f32)));
            Ok([first, faces.texcoords.len() - first])
        })
    }
}

/// The elements of a source, of each the first `N` numbers, as its accessor says.
fn elements<const N: usize>(source: Xml<'_>) -> Result<Vec<[f64; N]>> {
    let Some(array) = source.child("float_array") else { return Err(source.error("has no float_array")) };
    let mut numbers = Vec::new();
    for word in array.content().split_ascii_whitespace() {
        let number = word.parse().ok().filter(|number: &f64| number.abs() <= model::LARGEST);
        let number = number.ok_or_else(|| {
            let word = shown::name(word).to_string();
            array.error(format_args!("holds {word:?}; allowed: numbers, -1e18 to 1e18"))
        })?;
        numbers.push(number);
    }
    let accessor = source.child("technique_common").and_then(|technique| technique.child("accessor"));
    let of_accessor = |name: &str| accessor.map(|accessor| accessor.number(name)).transpose().map(Option::flatten);
    let whole = |name: &str, missing: f64| -> Result<usize> {
        let number = of_accessor(name)?.unwrap_or(missing);
        if (0.0..=1e9).contains(&number) && number.fract() == 0.0 {
            return Ok(number as usize);
        }
        Err(source.error(format_args!("has an accessor of {name} {number}; allowed: whole numbers")))
    };
    let (stride, offset) = (whole("stride", N as f64)?, whole("offset", 0.0)?);
    if stride < N {
        return Err(source.error(format_args!("has the stride {stride}; allowed: {N} and more")));
    }
    let rest = numbers.get(offset..).unwrap_or_default();
    let count = whole("count", (rest.len() / stride) as f64)?;
    let found: Vec<[f64; N]> =
        rest.chunks(stride).filter_map(|element| element.first_chunk::<N>().copied()).take(count).collect();
    if found.len() < count {
        let there = found.len();
        return Err(source.error(format_args!("has {there} elements; allowed: the {count} that its accessor says")));
    }
    Ok(found)
}

/// The indices in an element, as many as a multiple of `width`.
fn indices(list: Xml<'_>, width: usize) -> Result<Vec<u32>> {
    let parsed: Option<Vec<u32>> = list.content().split_ascii_whitespace().map(|word| word.parse().ok()).collect();
    let Some(indices) = parsed else {
        return Err(list.error("holds other things than indices; allowed: whole numbers from 0"));
    };
    if indices.len() % width != 0 {
        let found = indices.len();
        return Err(
            list.error(format_args!("holds {found} indices; allowed: a multiple of {width}, as many as a corner has"))
        );
    }
    Ok(indices)
}
