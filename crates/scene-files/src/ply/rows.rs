//! The rows of a PLY file: vertices and faces, by the property names that programs use.

use super::values::Values;
use crate::faces::{Corner, Faces, NONE};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::number::Number;
use ground::read::ply::{PlyElement, PlyHeader};
use model::within_reach;
use std::path::Path;

/// The contents of a PLY file.
#[derive(Default)]
pub(super) struct PlyRows {
    pub faces: Faces,
    /// Colour of each position, 0 to 1, as written; empty if the file has none.
    pub colors: Vec<[f32; 4]>,
    /// Key of each face; empty if nothing distinguishes them.
    pub keys: Vec<Key>,
    /// Faces with fewer than three corners, which were left out.
    pub small: usize,
    /// Labels of the positions, for faces without labels.
    labels: Vec<PlyLabels>,
    /// Texture coordinates of each corner; empty if the file has none.
    wedges: Vec<[f32; 2]>,
}

/// What the faces of one part have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Key {
    pub labels: PlyLabels,
    /// Number of the image.
    pub texture: u32,
}

/// The file's numbers for category and instance.
pub(super) type PlyLabels = [Option<i64>; 2];

/// Which of [`SLOTS`] a property fills.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PropertySlot {
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

/// Property names, the usual ones first: of several for the same slot the first counts.
const SLOTS: &[(&str, PropertySlot)] = &[
    ("x", PropertySlot::Position(0)),
    ("y", PropertySlot::Position(1)),
    ("z", PropertySlot::Position(2)),
    ("nx", PropertySlot::Normal(0)),
    ("ny", PropertySlot::Normal(1)),
    ("nz", PropertySlot::Normal(2)),
    ("s", PropertySlot::Uv(0)),
    ("t", PropertySlot::Uv(1)),
    ("u", PropertySlot::Uv(0)),
    ("v", PropertySlot::Uv(1)),
    ("texture_u", PropertySlot::Uv(0)),
    ("texture_v", PropertySlot::Uv(1)),
    ("red", PropertySlot::Color(0)),
    ("green", PropertySlot::Color(1)),
    ("blue", PropertySlot::Color(2)),
    ("alpha", PropertySlot::Color(3)),
    ("r", PropertySlot::Color(0)),
    ("g", PropertySlot::Color(1)),
    ("b", PropertySlot::Color(2)),
    ("diffuse_red", PropertySlot::Color(0)),
    ("diffuse_green", PropertySlot::Color(1)),
    ("diffuse_blue", PropertySlot::Color(2)),
    ("category_id", PropertySlot::Label(0)),
    ("scalar_category_id", PropertySlot::Label(0)),
    ("label", PropertySlot::Label(0)),
    ("scalar_label", PropertySlot::Label(0)),
    ("instance_id", PropertySlot::Label(1)),
    ("scalar_instance_id", PropertySlot::Label(1)),
    ("object_id", PropertySlot::Label(1)),
    ("instance", PropertySlot::Label(1)),
    ("scalar_instance", PropertySlot::Label(1)),
    ("texnumber", PropertySlot::Texture),
    ("vertex_indices", PropertySlot::Corners),
    ("vertex_index", PropertySlot::Corners),
    ("vertex_indexes", PropertySlot::Corners),
    ("texcoord", PropertySlot::Texcoords),
];

/// The slot of each property of `element`; `None`: it is skipped.
fn slots(element: &PlyElement) -> Vec<Option<PropertySlot>> {
    let mut slots = vec![None; element.properties.len()];
    for (name, slot) in SLOTS {
        let is_list = matches!(slot, PropertySlot::Corners | PropertySlot::Texcoords);
        let found = element.properties.iter().position(|p| p.name == *name && p.length.is_some() == is_list);
        if let Some(found) = found.filter(|_| !slots.contains(&Some(*slot))) {
            slots[found] = Some(*slot);
        }
    }
    slots
}

/// Checks that `element` has the required properties.
fn check_properties(element: &PlyElement) -> Result<(), String> {
    let has = |slot: PropertySlot| slots(element).contains(&Some(slot));
    match element.name.as_str() {
        "vertex" if !(0..3).all(|axis| has(PropertySlot::Position(axis))) => {
            Err("the vertices have no position; allowed: the properties x, y and z".into())
        }
        "face" | "tristrips" if !has(PropertySlot::Corners) => {
            Err(format!("{}: no corners; allowed: the list vertex_indices or vertex_index", element.name))
        }
        _ => Ok(()),
    }
}

/// Reads the rows of a file with `header` from `values`.
///
/// # Errors
/// A file that ends too early; a word that is not a number; vertices without position, or that do not exist; no faces.
pub(super) fn read(path: &Path, header: &PlyHeader, mut values: impl Values) -> Result<PlyRows> {
    let mut rows = PlyRows::default();
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
fn skip(element: &PlyElement, values: &mut impl Values, row: &mut u64) -> Result<(), String> {
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

/// A label; `None` for NaN and numbers that are not whole.
fn label(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 9e15).then_some(value as i64)
}

impl PlyRows {
    fn vertices(&mut self, element: &PlyElement, values: &mut impl Values, row: &mut u64) -> Result<(), String> {
        let slots = slots(element);
        let has = |slot: PropertySlot| slots.contains(&Some(slot));
        let has_normals = (0..3).all(|axis| has(PropertySlot::Normal(axis)));
        let has_uvs = (0..2).all(|axis| has(PropertySlot::Uv(axis)));
        let has_colors = (0..3).all(|axis| has(PropertySlot::Color(axis)));
        let has_labels = has(PropertySlot::Label(0)) || has(PropertySlot::Label(1));
        // Checked against the length of the file.
        self.faces.positions.reserve(element.count as usize);
        for number in 0..element.count {
            *row = number;
            let (mut position, mut normal, mut uv, mut color) = ([0.0; 3], [0.0; 3], [0.0; 2], [0.0, 0.0, 0.0, 1.0]);
            let mut labels = [None; 2];
            for (property, slot) in element.properties.iter().zip(&slots) {
                match *slot {
                    Some(PropertySlot::Position(axis)) => position[axis] = values.number(property.kind)?,
                    Some(PropertySlot::Normal(axis)) => normal[axis] = values.number(property.kind)?,
                    Some(PropertySlot::Uv(axis)) => uv[axis] = values.number(property.kind)? as f32,
                    Some(PropertySlot::Color(channel)) => {
                        let value = values.number(property.kind)? / full(property.kind);
                        color[channel] = value.clamp(0.0, 1.0) as f32;
                    }
                    Some(PropertySlot::Label(which)) => labels[which] = label(values.number(property.kind)?),
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
        element: &PlyElement,
        vertices: u64,
        values: &mut impl Values,
        row: &mut u64,
    ) -> Result<(), String> {
        let slots = slots(element);
        let has_wedges = slots.contains(&Some(PropertySlot::Texcoords));
        let has_keys = slots.iter().any(|slot| matches!(slot, Some(PropertySlot::Label(_) | PropertySlot::Texture)));
        self.faces.face_ends.reserve(element.count as usize);
        let mut uvs = Vec::new();
        for number in 0..element.count {
            *row = number;
            let start = self.faces.corners.len();
            let mut key = Key::default();
            uvs.clear();
            for (property, slot) in element.properties.iter().zip(&slots) {
                match (*slot, property.length) {
                    (Some(PropertySlot::Corners), Some(length)) => {
                        for _ in 0..values.length(length, property.kind)? {
                            self.faces.corners.push(corner(values.number(property.kind)?, vertices)?);
                        }
                    }
                    (Some(PropertySlot::Texcoords), Some(length)) => {
                        for _ in 0..values.length(length, property.kind)? {
                            uvs.push(values.number(property.kind)? as f32);
                        }
                    }
                    (Some(PropertySlot::Label(which)), _) => key.labels[which] = label(values.number(property.kind)?),
                    (Some(PropertySlot::Texture), _) => key.texture = values.number(property.kind)? as u32,
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

    /// Triangle strips, in which each triangle starts one vertex after the one before, with opposite winding; -1 ends a
    /// strip.
    fn strips(
        &mut self,
        element: &PlyElement,
        vertices: u64,
        values: &mut impl Values,
        row: &mut u64,
    ) -> Result<(), String> {
        let slots = slots(element);
        for number in 0..element.count {
            *row = number;
            for (property, slot) in element.properties.iter().zip(&slots) {
                let (Some(PropertySlot::Corners), Some(length)) = (*slot, property.length) else {
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

    /// Combines the data of vertices and faces, which may come in any order.
    fn finish(&mut self) -> Result<(), String> {
        let PlyRows { faces, keys, labels, wedges, .. } = self;
        faces.check_size()?;
        if faces.face_ends.is_empty() {
            return Err("the file holds no face with 3 or more corners".into());
        }
        if faces.positions.iter().any(|&position| !within_reach(&DVec3::from(position))) {
            // Vertices that no face uses may have any value: scanners write NaN where they measured nothing.
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
        // Strips have no texture coordinates of corners.
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
        if !labels.is_empty() && keys.iter().all(|key| key.labels == PlyLabels::default()) {
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

/// The labels of a face whose corners have `labels`: those that two of the first three share, else those of the first.
fn common(mut labels: impl Iterator<Item = PlyLabels>) -> PlyLabels {
    let (a, b, c) = (labels.next(), labels.next(), labels.next());
    if b == c { b } else { a }.unwrap_or_default()
}

fn unit(normal: [f64; 3]) -> [f32; 3] {
    DVec3::from(normal).normalize_or_zero().as_vec3().to_array()
}

/// The corner at vertex `value` of `vertices`.
#[inline]
fn corner(value: f64, vertices: u64) -> Result<Corner, String> {
    let position = value as u32;
    if f64::from(position) != value || u64::from(position) >= vertices {
        return Err(format!("vertex index {value} of {vertices}, which count from 0"));
    }
    Ok(Corner { position, texcoord: NONE, normal: NONE })
}

/// Full scale of a colour channel.
fn full(kind: Number) -> f64 {
    match kind {
        Number::I8 | Number::U8 => 255.0,
        Number::I16 | Number::U16 => 65535.0,
        _ => 1.0,
    }
}
