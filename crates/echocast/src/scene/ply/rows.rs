//! The rows of a PLY file: vertices and faces as programs name their properties.

use super::values::Values;
use crate::ground::error::{Error, Result};
use crate::read::number::Number;
use crate::read::ply::{Element, Header};
use crate::scene::faces::{Corner, Faces, NONE};
use crate::scene::within_reach;
use glam::DVec3;
use std::path::Path;

/// The contents of a PLY file.
#[derive(Default)]
pub(super) struct Rows {
    pub faces: Faces,
    /// Of each position, 0 to 1, as written; empty without.
    pub colors: Vec<[f32; 4]>,
    /// Of each face, what it belongs to; empty if nothing tells them apart.
    pub keys: Vec<Key>,
    /// Faces with fewer than three corners, which were left out.
    pub small: usize,
    /// Labels of the positions, for faces without.
    labels: Vec<Labels>,
    /// Of each corner, its own texture coordinates; empty without.
    wedges: Vec<[f32; 2]>,
}

/// What faces have in common that become one part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Key {
    pub labels: Labels,
    /// Number of the image.
    pub texture: u32,
}

/// Numbers of the file for category and instance.
pub(super) type Labels = [Option<i64>; 2];

/// Which of [`SLOTS`] a property fills.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Color(usize),
    Label(usize),
    Texture,
    /// The vertices of a face, or of strips.
    Corners,
    /// Texture coordinates of the corners of a face.
    Texcoords,
}

/// Names of properties, those that are usual first: of several for the same slot the first counts.
const SLOTS: &[(&str, Slot)] = &[
    ("x", Slot::Position(0)),
    ("y", Slot::Position(1)),
    ("z", Slot::Position(2)),
    ("nx", Slot::Normal(0)),
    ("ny", Slot::Normal(1)),
    ("nz", Slot::Normal(2)),
    ("s", Slot::Uv(0)),
    ("t", Slot::Uv(1)),
    ("u", Slot::Uv(0)),
    ("v", Slot::Uv(1)),
    ("texture_u", Slot::Uv(0)),
    ("texture_v", Slot::Uv(1)),
    ("red", Slot::Color(0)),
    ("green", Slot::Color(1)),
    ("blue", Slot::Color(2)),
    ("alpha", Slot::Color(3)),
    ("r", Slot::Color(0)),
    ("g", Slot::Color(1)),
    ("b", Slot::Color(2)),
    ("diffuse_red", Slot::Color(0)),
    ("diffuse_green", Slot::Color(1)),
    ("diffuse_blue", Slot::Color(2)),
    ("category_id", Slot::Label(0)),
    ("scalar_category_id", Slot::Label(0)),
    ("label", Slot::Label(0)),
    ("scalar_label", Slot::Label(0)),
    ("instance_id", Slot::Label(1)),
    ("scalar_instance_id", Slot::Label(1)),
    ("object_id", Slot::Label(1)),
    ("instance", Slot::Label(1)),
    ("scalar_instance", Slot::Label(1)),
    ("texnumber", Slot::Texture),
    ("vertex_indices", Slot::Corners),
    ("vertex_index", Slot::Corners),
    ("vertex_indexes", Slot::Corners),
    ("texcoord", Slot::Texcoords),
];

/// What each property of `element` is; `None`: it is skipped.
fn slots(element: &Element) -> Vec<Option<Slot>> {
    let mut slots = vec![None; element.properties.len()];
    for (name, slot) in SLOTS {
        let is_list = matches!(slot, Slot::Corners | Slot::Texcoords);
        let found = element.properties.iter().position(|p| p.name == *name && p.length.is_some() == is_list);
        if let Some(found) = found.filter(|_| !slots.contains(&Some(*slot))) {
            slots[found] = Some(*slot);
        }
    }
    slots
}

/// Checks that `element` has what is needed of it.
fn check_properties(element: &Element) -> Result<(), String> {
    let has = |slot: Slot| slots(element).contains(&Some(slot));
    match element.name.as_str() {
        "vertex" if !(0..3).all(|axis| has(Slot::Position(axis))) => {
            Err("the vertices have no position; allowed: the properties x, y and z".into())
        }
        "face" | "tristrips" if !has(Slot::Corners) => {
            Err(format!("{}: no corners; allowed: the list vertex_indices or vertex_index", element.name))
        }
        _ => Ok(()),
    }
}

/// Reads the rows that `values` give of a file with `header`.
///
/// # Errors
/// A file that ends too early; a word that is no number; vertices without position, or that do not exist; no faces.
pub(super) fn read(path: &Path, header: &Header, mut values: impl Values) -> Result<Rows> {
    let mut rows = Rows::default();
    let is_there = |name: &str| header.elements.iter().any(|element| element.name == name && element.count > 0);
    let points = header.elements.iter().find(|element| element.name == "vertex").map_or(0, |element| element.count);
    if !is_there("face") && !is_there("tristrips") {
        let message = format!(
            "the file holds {points} vertices and no face: point clouds are not read as scenes; allowed: meshes, which \
             other programs make of points"
        );
        return Err(Error::parse(path, "", message));
    }
    for element in &header.elements {
        let checked = check_properties(element).and_then(|()| values.check_rows(element));
        checked.map_err(|message| Error::parse(path, "", message))?;
        if element.properties.is_empty() {
            continue;
        }
        let mut row = 0;
        let result = match element.name.as_str() {
            "vertex" => rows.vertices(element, &mut values, &mut row),
            "face" => rows.faces(element, points, &mut values, &mut row),
            "tristrips" => rows.strips(element, points, &mut values, &mut row),
            _ => skip(element, &mut values, &mut row),
        };
        result.map_err(|message| {
            let place = values.line().map_or_else(|| format!("{} {row}", element.name), |line| format!("line {line}"));
            Error::parse(path, place, message)
        })?;
    }
    rows.finish().map_err(|message| Error::parse(path, "", message))?;
    Ok(rows)
}

/// Skips the rows of `element`.
fn skip(element: &Element, values: &mut impl Values, row: &mut u64) -> Result<(), String> {
    for number in 0..element.count {
        *row = number;
        for property in &element.properties {
            skip_one(values, property.kind, property.length)?;
        }
    }
    Ok(())
}

#[inline]
fn skip_one(values: &mut impl Values, kind: Number, length: Option<Number>) -> Result<(), String> {
    let count = length.map_or(Ok(1), |length| values.length(length, kind))?;
    values.skip(kind, count)
}

/// A label; NaN and what is no whole number is none.
fn label(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 9e15).then_some(value as i64)
}

impl Rows {
    fn vertices(&mut self, element: &Element, values: &mut impl Values, row: &mut u64) -> Result<(), String> {
        let slots = slots(element);
        let has = |slot: Slot| slots.contains(&Some(slot));
        let has_normals = (0..3).all(|axis| has(Slot::Normal(axis)));
        let has_uvs = (0..2).all(|axis| has(Slot::Uv(axis)));
        let has_colors = (0..3).all(|axis| has(Slot::Color(axis)));
        let has_labels = has(Slot::Label(0)) || has(Slot::Label(1));
        // Checked against the length of the file.
        self.faces.positions.reserve(element.count as usize);
        for number in 0..element.count {
            *row = number;
            let (mut position, mut normal, mut uv, mut color) = ([0.0; 3], [0.0; 3], [0.0; 2], [0.0, 0.0, 0.0, 1.0]);
            let mut labels = [None; 2];
            for (property, slot) in element.properties.iter().zip(&slots) {
                match *slot {
                    Some(Slot::Position(axis)) => position[axis] = values.number(property.kind)?,
                    Some(Slot::Normal(axis)) => normal[axis] = values.number(property.kind)?,
                    Some(Slot::Uv(axis)) => uv[axis] = values.number(property.kind)? as f32,
                    Some(Slot::Color(channel)) => {
                        let value = values.number(property.kind)? / full(property.kind);
                        color[channel] = value.clamp(0.0, 1.0) as f32;
                    }
                    Some(Slot::Label(which)) => labels[which] = label(values.number(property.kind)?),
                    _ => skip_one(values, property.kind, property.length)?,
                }
            }
            self.faces.positions.push(position);
            if has_normals {
                self.faces.normals.push(unit(normal));
            }
            if has_uvs {
                self.faces.texcoords.push(uv);
            }
            if has_colors {
                self.colors.push(color);
            }
            if has_labels {
                self.labels.push(labels);
            }
        }
        Ok(())
    }

    fn faces(
        &mut self,
        element: &Element,
        vertices: u64,
        values: &mut impl Values,
        row: &mut u64,
    ) -> Result<(), String> {
        let slots = slots(element);
        let has_wedges = slots.contains(&Some(Slot::Texcoords));
        let has_keys = slots.iter().any(|slot| matches!(slot, Some(Slot::Label(_) | Slot::Texture)));
        self.faces.face_ends.reserve(element.count as usize);
        let mut uvs = Vec::new();
        for number in 0..element.count {
            *row = number;
            let start = self.faces.corners.len();
            let mut key = Key::default();
            uvs.clear();
            for (property, slot) in element.properties.iter().zip(&slots) {
                match (*slot, property.length) {
                    (Some(Slot::Corners), Some(length)) => {
                        for _ in 0..values.length(length, property.kind)? {
                            self.faces.corners.push(corner(values.number(property.kind)?, vertices)?);
                        }
                    }
                    (Some(Slot::Texcoords), Some(length)) => {
                        for _ in 0..values.length(length, property.kind)? {
                            uvs.push(values.number(property.kind)? as f32);
                        }
                    }
                    (Some(Slot::Label(which)), _) => key.labels[which] = label(values.number(property.kind)?),
                    (Some(Slot::Texture), _) => key.texture = values.number(property.kind)? as u32,
                    _ => skip_one(values, property.kind, property.length)?,
                }
            }
            let corners = self.faces.corners.len() - start;
            if corners < 3 {
                self.small += 1;
                self.faces.corners.truncate(start);
                continue;
            }
            self.faces.face_ends.push(self.faces.corners.len());
            if has_wedges {
                uvs.resize(2 * corners, 0.0);
                self.wedges.extend(uvs.as_chunks().0);
            }
            if has_keys {
                self.keys.push(key);
            }
        }
        Ok(())
    }

    /// Strips of triangles, each of which begins at a vertex of the one before and faces the other way; -1 ends a strip.
    fn strips(
        &mut self,
        element: &Element,
        vertices: u64,
        values: &mut impl Values,
        row: &mut u64,
    ) -> Result<(), String> {
        let slots = slots(element);
        for number in 0..element.count {
            *row = number;
            for (property, slot) in element.properties.iter().zip(&slots) {
                let (Some(Slot::Corners), Some(length)) = (*slot, property.length) else {
                    skip_one(values, property.kind, property.length)?;
                    continue;
                };
                let (mut last, mut at) = ([None; 2], 0);
                for _ in 0..values.length(length, property.kind)? {
                    let value = values.number(property.kind)?;
                    if value == -1.0 {
                        (last, at) = ([None; 2], 0);
                        continue;
                    }
                    let newest = corner(value, vertices)?;
                    if let [Some(first), Some(second)] = last {
                        let triangle = if at % 2 == 0 { [first, second, newest] } else { [second, first, newest] };
                        self.faces.corners.extend(triangle);
                        self.faces.face_ends.push(self.faces.corners.len());
                        at += 1;
                    }
                    last = [last[1], Some(newest)];
                }
            }
        }
        Ok(())
    }

    /// Brings together what vertices and faces say, which may come in any order.
    fn finish(&mut self) -> Result<(), String> {
        let Rows { faces, keys, labels, wedges, .. } = self;
        faces.check_size()?;
        if faces.face_ends.is_empty() {
            return Err("the file holds no face with 3 or more corners".into());
        }
        if faces.positions.iter().any(|&position| !within_reach(&DVec3::from(position))) {
            // What no face uses may be anything: scanners write NaN where they saw nothing.
            let is_bad = |corner: &&Corner| !within_reach(&DVec3::from(faces.positions[corner.position as usize]));
            if let Some(Corner { position, .. }) = faces.corners.iter().find(is_bad) {
                let found = faces.positions[*position as usize];
                return Err(format!("vertex {position} is {found:?}; allowed: -1e18 to 1e18"));
            }
        }
        let (has_normals, has_uvs) = (!faces.normals.is_empty(), !faces.texcoords.is_empty());
        for corner in &mut faces.corners {
            if has_normals {
                corner.normal = corner.position;
            }
            if has_uvs {
                corner.texcoord = corner.position;
            }
        }
        // Strips have none.
        if wedges.len() == faces.corners.len() {
            faces.texcoords.clear();
            let mut newest = vec![NONE; faces.positions.len()];
            for (corner, uv) in faces.corners.iter_mut().zip(&*wedges) {
                let known = &mut newest[corner.position as usize];
                if faces.texcoords.get(*known as usize) != Some(uv) {
                    *known = faces.texcoords.len() as u32;
                    faces.texcoords.push(*uv);
                }
                corner.texcoord = *known;
            }
        }
        if !labels.is_empty() && keys.iter().all(|key| key.labels == Labels::default()) {
            keys.resize(faces.face_ends.len(), Key::default());
            let mut start = 0;
            for (key, end) in keys.iter_mut().zip(&faces.face_ends) {
                key.labels = common(faces.corners[start..*end].iter().map(|corner| labels[corner.position as usize]));
                start = *end;
            }
        }
        if keys.len() != faces.face_ends.len() {
            keys.clear();
        }
        Ok(())
    }
}

/// The labels of a face whose corners have `labels`: those of two of them, else those of the first.
fn common(mut labels: impl Iterator<Item = Labels>) -> Labels {
    let (a, b, c) = (labels.next(), labels.next(), labels.next());
    if b == c { b } else { a }.unwrap_or_default()
}

fn unit(normal: [f64; 3]) -> [f32; 3] {
    DVec3::from(normal).normalize_or_zero().as_vec3().to_array()
}

/// The corner at a vertex, of which there are `vertices`.
#[inline]
fn corner(value: f64, vertices: u64) -> Result<Corner, String> {
    let position = value as u32;
    if f64::from(position) != value || u64::from(position) >= vertices {
        return Err(format!("vertex index {value} of {vertices}, which count from 0"));
    }
    Ok(Corner { position, texcoord: NONE, normal: NONE })
}

/// What stands for a full colour channel.
fn full(kind: Number) -> f64 {
    match kind {
        Number::I8 | Number::U8 => 255.0,
        Number::I16 | Number::U16 => 65535.0,
        _ => 1.0,
    }
}
