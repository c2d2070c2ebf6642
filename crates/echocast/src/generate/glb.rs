//! Writing binary glTF 2.0: only what generated scenes need.
//!
//! Callers use echocast's frame (metres, z up); the output is y up.

use crate::scene::count;
use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

/// Component types and buffer targets of the glTF 2.0 specification, 3.6.2.2 and 5.11.5.
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Converts a vector from echocast to glTF: the inverse of (x, y, z) -> (x, -z, y), which readers apply.
fn y_up([x, y, z]: [f32; 3]) -> [f32; 3] {
    // A difference, because a minus sign would turn 0 into -0.
    [x, z, 0.0 - y]
}

fn point(p: DVec3) -> Value {
    json!([p.x, p.z, 0.0 - p.y])
}

fn quaternion(q: DQuat) -> Value {
    json!([q.x, q.z, 0.0 - q.y, q.w])
}

/// Lists of a file under their names there, and its buffer.
#[derive(Default)]
pub(super) struct Glb {
    lists: Map<String, Value>,
    /// Nodes without a parent.
    roots: Vec<usize>,
    buffer: Vec<u8>,
    /// Triangles of each mesh.
    triangles: Vec<usize>,
}

/// A part of a mesh: its triangles and the index of their material.
pub(super) struct Primitive<'a> {
    pub triangles: &'a [[u32; 3]],
    pub material: usize,
}

/// Position and size of a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    pub at: DVec3,
    pub turned: DQuat,
    pub scale: DVec3,
}

impl Placement {
    /// At the parent's origin.
    pub const HERE: Placement = Placement { at: DVec3::ZERO, turned: DQuat::IDENTITY, scale: DVec3::ONE };

    /// Transforms `point` of the placed object to the parent's frame.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.at + self.turned * (self.scale * point)
    }
}

impl Glb {
    fn push(&mut self, list: &str, item: Value) -> usize {
        let Value::Array(items) = self.lists.entry(list).or_insert_with(|| json!([])) else {
            unreachable!("only this function makes lists")
        };
        items.push(item);
        items.len() - 1
    }

    /// A material without gloss, its colour linear; `extras` are custom properties.
    pub fn material(&mut self, name: &str, color: [f32; 3], extras: Value) -> usize {
        let [r, g, b] = color;
        let pbr = json!({ "baseColorFactor": [r, g, b, 1], "metallicFactor": 0, "roughnessFactor": 1 });
        self.push("materials", json!({ "name": name, "pbrMetallicRoughness": pbr, "extras": extras }))
    }

    /// An accessor for the bytes appended since the buffer had `start` of them.
    fn accessor(&mut self, start: usize, target: Option<u32>, mut description: Value) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": self.buffer.len() - start });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        // Every view begins at a multiple of the largest component (3.6.2.4).
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        description["bufferView"] = json!(self.push("bufferViews", view));
        self.push("accessors", description)
    }

    /// Vectors of a vertex attribute, or of an animation if there is no `target`.
    fn vectors(&mut self, vectors: &[[f32; 3]], target: Option<u32>) -> usize {
        let start = self.buffer.len();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for vector in vectors {
            for (axis, value) in y_up(*vector).into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
                self.buffer.extend(value.to_le_bytes());
            }
        }
        let description = json!({
            "componentType": FLOAT, "count": vectors.len(), "type": "VEC3", "min": low, "max": high
        });
        self.accessor(start, target, description)
    }

    fn indices(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        let start = self.buffer.len();
        let corners = triangles.as_flattened();
        // The largest number of a type is not an index (3.7.2.1).
        let short = vertices <= usize::from(u16::MAX);
        for &corner in corners {
            match short {
                true => self.buffer.extend((corner as u16).to_le_bytes()),
                false => self.buffer.extend(corner.to_le_bytes()),
            }
        }
        let component = if short { UNSIGNED_SHORT } else { UNSIGNED_INT };
        let description = json!({ "componentType": component, "count": corners.len(), "type": "SCALAR" });
        self.accessor(start, Some(ELEMENT_ARRAY_BUFFER), description)
    }

    /// A mesh whose parts share their vertices; those without a triangle are left out.
    pub fn mesh(
        &mut self,
        name: &str,
        positions: &[[f32; 3]],
        normals: Option<&[[f32; 3]]>,
        parts: &[Primitive<'_>],
    ) -> usize {
        let mut attributes = json!({ "POSITION": self.vectors(positions, Some(ARRAY_BUFFER)) });
        if let Some(normals) = normals {
            attributes["NORMAL"] = json!(self.vectors(normals, Some(ARRAY_BUFFER)));
        }
        let mut primitives = Vec::new();
        for part in parts.iter().filter(|part| !part.triangles.is_empty()) {
            let indices = self.indices(part.triangles, positions.len());
            primitives.push(json!({ "attributes": attributes, "indices": indices, "material": part.material }));
        }
        self.triangles.push(parts.iter().map(|part| part.triangles.len()).sum());
        self.push("meshes", json!({ "name": name, "primitives": primitives }))
    }

    fn node(name: &str, place: Placement) -> Value {
        let mut node = json!({ "name": name });
        if place.at != DVec3::ZERO {
            node["translation"] = point(place.at);
        }
        if place.turned != DQuat::IDENTITY {
            node["rotation"] = quaternion(place.turned);
        }
        if place.scale != DVec3::ONE {
            // Axes swap as for points, sizes have no sign.
            node["scale"] = json!([place.scale.x, place.scale.z, place.scale.y]);
        }
        node
    }

    /// A node that shows `mesh`; [`Glb::root`] or [`Glb::group`] puts it into the world.
    pub fn object(&mut self, name: &str, category: &str, mesh: usize, place: Placement) -> usize {
        let mut node = Glb::node(name, place);
        node["mesh"] = json!(mesh);
        node["extras"] = json!({ "categoryID": category });
        self.push("nodes", node)
    }

    /// A node with children.
    pub fn group(&mut self, name: &str, place: Placement, children: &[usize]) -> usize {
        let mut node = Glb::node(name, place);
        node["children"] = json!(children);
        self.push("nodes", node)
    }

    /// A camera node at `at` that looks along x, z up.
    pub fn camera(&mut self, name: &str, at: DVec3) -> usize {
        let lens = json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } });
        let camera = self.push("cameras", lens);
        let mut node = Glb::node(name, Placement { at, ..Placement::HERE });
        // glTF's cameras look along -z, y up: a quarter turn to the right about y.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        node["rotation"] = json!([0, -half, 0, half]);
        node["camera"] = json!(camera);
        self.push("nodes", node)
    }

    /// Puts a node into the scene.
    pub fn root(&mut self, node: usize) {
        self.roots.push(node);
    }

    /// An animation that moves `node` uniformly from place to place in its parent, from time 0 to `seconds`.
    pub fn movement(&mut self, name: &str, node: usize, seconds: f32, [from, to]: [DVec3; 2]) {
        let start = self.buffer.len();
        self.buffer.extend([0.0, seconds].iter().flat_map(|time: &f32| time.to_le_bytes()));
        let times = json!({ "componentType": FLOAT, "count": 2, "type": "SCALAR", "min": [0], "max": [seconds] });
        let input = self.accessor(start, None, times);
        let output = self.vectors(&[from, to].map(|place| place.as_vec3().to_array()), None);
        self.push(
            "animations",
            json!({
                "name": name,
                "channels": [{ "sampler": 0, "target": { "node": node, "path": "translation" } }],
                "samplers": [{ "input": input, "interpolation": "LINEAR", "output": output }],
            }),
        );
    }

    /// Triangles of a mesh.
    pub fn triangle_count(&self, mesh: usize) -> usize {
        self.triangles[mesh]
    }

    /// The bytes of the file (glTF 2.0, 4.4); an error if they exceed the limit of a GLB.
    pub fn finish(mut self) -> Result<Vec<u8>, String> {
        let generator = concat!("echocast ", env!("CARGO_PKG_VERSION"));
        let mut file = json!({
            "asset": { "version": "2.0", "generator": generator },
            "scene": 0,
            "scenes": [{ "nodes": self.roots }],
            "buffers": [{ "byteLength": self.buffer.len() }],
        });
        if let Value::Object(members) = &mut file {
            members.append(&mut self.lists);
        }
        let mut text = file.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.buffer.len();
        let too_long = |_| format!("{}; allowed: {}", count(length, "byte"), u32::MAX);
        let length = u32::try_from(length).map_err(too_long)?;
        let mut bytes = Vec::with_capacity(length as usize);
        bytes.extend(b"glTF");
        bytes.extend([2, length].iter().flat_map(|word: &u32| word.to_le_bytes()));
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.buffer)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        Ok(bytes)
    }
}
