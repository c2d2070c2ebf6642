//! Writing binary glTF 2.0: only what generated scenes need.
//!
//! Callers use echocast's frame (metres, z up); the output is y up.

use super::GeneratedScene;
use glam::{DQuat, DVec3};
use ground::shown;
use serde_json::{Map, Value, json};
use std::f64::consts::FRAC_1_SQRT_2;

/// Component types and buffer targets of the glTF 2.0 specification, 3.6.2.2 and 5.11.5.
const UNSIGNED_BYTE: u32 = 5121;
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

fn turn(q: DQuat) -> [f32; 4] {
    [q.x, q.z, 0.0 - q.y, q.w].map(|part| part as f32)
}

/// The arrays of a file by their glTF names, and its buffer.
#[derive(Default)]
pub(super) struct Glb {
    lists: Map<String, Value>,
    /// Nodes without a parent.
    roots: Vec<usize>,
    buffer: Vec<u8>,
    /// Triangles of each mesh.
    triangles: Vec<usize>,
    /// Triangles of all objects, and how many objects each category has.
    placed: usize,
    categories: Vec<(&'static str, usize)>,
    /// Samplers and channels of the animation under construction.
    samplers: Vec<Value>,
    channels: Vec<Value>,
    extensions: Vec<&'static str>,
    /// Extensions without which the file would look different.
    required: Vec<&'static str>,
}

/// Appearance of a material apart from its colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Look {
    /// Without gloss.
    Matt,
    /// The same, but a single sheet visible from both sides.
    Sheet,
    /// A thin sheet of glass that transmits light.
    Pane,
    /// A mirror: it shows what is in front of it.
    Mirror,
    /// Emits light.
    Glow,
}

/// A part of a mesh: its triangles and the index of their material.
pub(super) struct Primitive<'a> {
    pub triangles: &'a [[u32; 3]],
    pub material: usize,
}

/// Position, rotation and scale of a node.
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

    /// Records that the file uses an extension, which readers may ignore.
    fn extension(&mut self, name: &'static str) {
        if !self.extensions.contains(&name) {
            self.extensions.push(name);
        }
    }

    /// Adds a material; its colour is linear, `extras` are custom properties or null.
    pub fn material(&mut self, name: &str, look: Look, color: [f32; 3], extras: Value) -> usize {
        let [r, g, b] = color;
        let rough = i32::from(!matches!(look, Look::Pane | Look::Mirror));
        let metal = i32::from(look == Look::Mirror);
        let pbr = json!({ "baseColorFactor": [r, g, b, 1], "metallicFactor": metal, "roughnessFactor": rough });
        let mut material = json!({ "name": name, "pbrMetallicRoughness": pbr });
        if extras != Value::Null {
            material["extras"] = extras;
        }
        match look {
            Look::Matt | Look::Mirror => {}
            Look::Sheet => material["doubleSided"] = json!(true),
            Look::Pane => {
                self.extension("KHR_materials_ior");
                self.extension("KHR_materials_transmission");
                material["doubleSided"] = json!(true);
                material["extensions"] = json!({
                    "KHR_materials_ior": { "ior": 1.5 },
                    "KHR_materials_transmission": { "transmissionFactor": 1 },
                });
            }
            Look::Glow => material["emissiveFactor"] = json!(color),
        }
        self.push("materials", material)
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

    /// Values of several components, without conversion of axes; `kind` is the accessor's `type`.
    fn numbers<const N: usize>(&mut self, kind: &str, numbers: &[[f32; N]], target: Option<u32>) -> usize {
        let start = self.buffer.len();
        self.buffer.extend(numbers.as_flattened().iter().flat_map(|number| number.to_le_bytes()));
        let description = json!({ "componentType": FLOAT, "count": numbers.len(), "type": kind });
        self.accessor(start, target, description)
    }

    fn indices(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        let start = self.buffer.len();
        let corners = triangles.as_flattened();
        // The largest value of a component type is not a valid index (3.7.2.1).
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

    /// A mesh whose parts share their vertices; parts without triangles are left out.
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

    /// The same mesh under another name, with the material `to` instead of `from`.
    pub fn repainted(&mut self, mesh: usize, name: &str, from: usize, to: usize) -> usize {
        let mut copy = self.lists["meshes"][mesh].clone();
        copy["name"] = json!(name);
        for primitive in copy["primitives"].as_array_mut().into_iter().flatten() {
            if primitive["material"] == from {
                primitive["material"] = json!(to);
            }
        }
        self.triangles.push(self.triangles[mesh]);
        self.push("meshes", copy)
    }

    /// Adds joints, as their numbers in a skin, and their weights to the vertices of a mesh.
    pub fn joints(&mut self, mesh: usize, joints: &[[u8; 4]], weights: &[[f32; 4]]) {
        let start = self.buffer.len();
        self.buffer.extend(joints.as_flattened());
        let description = json!({ "componentType": UNSIGNED_BYTE, "count": joints.len(), "type": "VEC4" });
        let joints = self.accessor(start, Some(ARRAY_BUFFER), description);
        let weights = self.numbers("VEC4", weights, Some(ARRAY_BUFFER));
        for primitive in self.primitives(mesh) {
            primitive["attributes"]["JOINTS_0"] = json!(joints);
            primitive["attributes"]["WEIGHTS_0"] = json!(weights);
        }
    }

    /// Adds morph targets to a mesh: for each, the displacements of vertices and normals, and its weight at rest.
    pub fn morphs(&mut self, mesh: usize, shapes: &[[Vec<[f32; 3]>; 2]], weights: &[f64]) {
        let mut targets = Vec::new();
        for [moves, turns] in shapes {
            let [moves, turns] = [moves, turns].map(|vectors| self.vectors(vectors, Some(ARRAY_BUFFER)));
            targets.push(json!({ "POSITION": moves, "NORMAL": turns }));
        }
        for primitive in self.primitives(mesh) {
            primitive["targets"] = json!(targets);
        }
        self.lists["meshes"][mesh]["weights"] = json!(weights);
    }

    fn primitives(&mut self, mesh: usize) -> impl Iterator<Item = &mut Value> {
        self.lists["meshes"][mesh]["primitives"].as_array_mut().into_iter().flatten()
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
            // Axes swap as for points; scales have no sign.
            node["scale"] = json!([place.scale.x, place.scale.z, place.scale.y]);
        }
        node
    }

    /// A node with `mesh`; [`Glb::root`], [`Glb::group`] or [`Glb::adopt`] puts it into the scene.
    pub fn object(&mut self, name: &str, category: &'static str, mesh: usize, place: Placement) -> usize {
        self.placed += self.triangles[mesh];
        match self.categories.iter_mut().find(|(known, _)| *known == category) {
            Some((_, objects)) => *objects += 1,
            None => self.categories.push((category, 1)),
        }
        let mut node = Glb::node(name, place);
        node["mesh"] = json!(mesh);
        node["extras"] = json!({ "categoryID": category });
        self.push("nodes", node)
    }

    /// A node with `mesh` at each of `places`, each time as a separate object (EXT_mesh_gpu_instancing).
    pub fn objects(&mut self, name: &str, category: &'static str, mesh: usize, places: &[Placement]) -> usize {
        const INSTANCING: &str = "EXT_mesh_gpu_instancing";
        self.extension(INSTANCING);
        if !self.required.contains(&INSTANCING) {
            self.required.push(INSTANCING);
        }
        let node = self.object(name, category, mesh, Placement::HERE);
        self.placed += self.triangles[mesh] * places.len().saturating_sub(1);
        if let Some((_, objects)) = self.categories.iter_mut().find(|(known, _)| *known == category) {
            *objects += places.len().saturating_sub(1);
        }
        let single = |vector: DVec3| vector.as_vec3().to_array();
        let at: Vec<[f32; 3]> = places.iter().map(|place| single(place.at)).collect();
        let turned: Vec<[f32; 4]> = places.iter().map(|place| turn(place.turned)).collect();
        // Axes swap as for points; scales have no sign.
        let scale: Vec<[f32; 3]> =
            places.iter().map(|Placement { scale, .. }| single(DVec3::new(scale.x, scale.z, scale.y))).collect();
        let (at, turned) = (self.vectors(&at, None), self.numbers("VEC4", &turned, None));
        let scale = self.numbers("VEC3", &scale, None);
        let attributes = json!({ "TRANSLATION": at, "ROTATION": turned, "SCALE": scale });
        self.lists["nodes"][node]["extensions"] = json!({ INSTANCING: { "attributes": attributes } });
        node
    }

    /// A node without a mesh: the parent of others, or a joint of a skeleton.
    pub fn frame(&mut self, name: &str, place: Placement) -> usize {
        self.push("nodes", Glb::node(name, place))
    }

    /// Gives a node without children its children. Descendants of the same category, also below groups, lose their
    /// category: they are parts of the node, not instances of their own.
    pub fn adopt(&mut self, node: usize, children: &[usize]) {
        let nodes = &mut self.lists["nodes"];
        nodes[node]["children"] = json!(children);
        let category = nodes[node].get("extras").cloned();
        let mut below = children.to_vec();
        while let (Some(category), Some(child)) = (&category, below.pop()) {
            let child = &mut nodes[child];
            match child.get("extras") {
                Some(own) if own != category => continue,
                _ => child.as_object_mut().map(|child| child.remove("extras")),
            };
            let more = child.get("children").and_then(Value::as_array).into_iter().flatten();
            below.extend(more.filter_map(|child| child.as_u64().map(|child| child as usize)));
        }
    }

    /// Shows or hides a node and everything below it (KHR_node_visibility).
    pub fn visible(&mut self, node: usize, visible: bool) {
        self.extension("KHR_node_visibility");
        self.lists["nodes"][node]["extensions"] = json!({ "KHR_node_visibility": { "visible": visible } });
    }

    /// Binds the mesh of a node to joints, nodes under `root`. `bound` are the positions of the joints in the bind
    /// pose, in which none is rotated. The transform of the node itself is then ignored (3.7.3.3).
    pub fn skin(&mut self, node: usize, root: usize, joints: &[usize], bound: &[DVec3]) {
        let inverse: Vec<[f32; 16]> = bound
            .iter()
            .map(|&joint| {
                let [x, y, z] = y_up((-joint).as_vec3().to_array());
                [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
            })
            .collect();
        let matrices = self.numbers("MAT4", &inverse, None);
        let skin = self.push("skins", json!({ "inverseBindMatrices": matrices, "joints": joints, "skeleton": root }));
        self.lists["nodes"][node]["skin"] = json!(skin);
    }

    /// A node with children.
    pub fn group(&mut self, name: &str, place: Placement, children: &[usize]) -> usize {
        let node = self.frame(name, place);
        self.adopt(node, children);
        node
    }

    /// A camera node; without rotation it looks along x, z up.
    pub fn camera(&mut self, name: &str, place: Placement) -> usize {
        let lens = json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } });
        let camera = self.push("cameras", lens);
        // glTF's cameras look along -z, y up: first a quarter turn to the right, about our z.
        let ahead = DQuat::from_xyzw(0.0, 0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2);
        let mut node = Glb::node(name, Placement { turned: place.turned * ahead, ..place });
        node["camera"] = json!(camera);
        self.push("nodes", node)
    }

    /// Puts a node into the scene.
    pub fn root(&mut self, node: usize) {
        self.roots.push(node);
    }

    /// Keyframe times, which rise from 0.
    pub fn times(&mut self, seconds: &[f64]) -> usize {
        let start = self.buffer.len();
        let seconds: Vec<f32> = seconds.iter().map(|&time| time as f32).collect();
        self.buffer.extend(seconds.iter().flat_map(|time| time.to_le_bytes()));
        let (low, high) = (seconds.first(), seconds.last());
        let description = json!({
            "componentType": FLOAT, "count": seconds.len(), "type": "SCALAR", "min": [low], "max": [high]
        });
        self.accessor(start, None, description)
    }

    fn sampler(&mut self, times: usize, interpolation: &str, output: usize) -> usize {
        self.samplers.push(json!({ "input": times, "interpolation": interpolation, "output": output }));
        self.samplers.len() - 1
    }

    /// Positions at keyframes, interpolated linearly.
    pub fn places(&mut self, times: usize, places: &[DVec3]) -> usize {
        let places: Vec<[f32; 3]> = places.iter().map(|place| place.as_vec3().to_array()).collect();
        let output = self.vectors(&places, None);
        self.sampler(times, "LINEAR", output)
    }

    /// Positions and velocities at keyframes, interpolated by cubic splines.
    pub fn curve(&mut self, times: usize, keys: &[[DVec3; 2]]) -> usize {
        let rows = keys.iter().flat_map(|&[place, velocity]| [velocity, place, velocity]);
        let rows: Vec<[f32; 3]> = rows.map(|row| row.as_vec3().to_array()).collect();
        let output = self.vectors(&rows, None);
        self.sampler(times, "CUBICSPLINE", output)
    }

    /// Rotations at keyframes, interpolated evenly: less than half a turn from key to key.
    pub fn turns(&mut self, times: usize, turns: &[DQuat]) -> usize {
        let turns: Vec<[f32; 4]> = turns.iter().map(|&q| turn(q)).collect();
        let output = self.numbers("VEC4", &turns, None);
        self.sampler(times, "LINEAR", output)
    }

    /// Weights of the morph targets of a mesh at keyframes, interpolated linearly.
    pub fn weights<const N: usize>(&mut self, times: usize, weights: &[[f64; N]]) -> usize {
        let weights: Vec<[f32; 1]> = weights.as_flattened().iter().map(|&weight| [weight as f32]).collect();
        let output = self.numbers("SCALAR", &weights, None);
        self.sampler(times, "LINEAR", output)
    }

    /// On or off from each keyframe to the next.
    pub fn switches(&mut self, times: usize, on: &[bool]) -> usize {
        let start = self.buffer.len();
        self.buffer.extend(on.iter().map(|&on| u8::from(on)));
        let description = json!({ "componentType": UNSIGNED_BYTE, "count": on.len(), "type": "SCALAR" });
        let output = self.accessor(start, None, description);
        self.sampler(times, "STEP", output)
    }

    /// Animates the property `path` of a node by a sampler.
    pub fn animate(&mut self, node: usize, path: &str, sampler: usize) {
        self.channels.push(json!({ "sampler": sampler, "target": { "node": node, "path": path } }));
    }

    /// Animates the visibility of a node (see [`Glb::visible`]) by a sampler of switches (KHR_animation_pointer).
    pub fn animate_visible(&mut self, node: usize, sampler: usize) {
        self.extension("KHR_animation_pointer");
        let pointer = format!("/nodes/{node}/extensions/KHR_node_visibility/visible");
        let extensions = json!({ "KHR_animation_pointer": { "pointer": pointer } });
        self.channels.push(json!({ "sampler": sampler, "target": { "path": "pointer", "extensions": extensions } }));
    }

    /// Collects everything animated since the last animation into a new one.
    pub fn animation(&mut self, name: &str) {
        let [channels, samplers] = [&mut self.channels, &mut self.samplers].map(std::mem::take);
        self.push("animations", json!({ "name": name, "channels": channels, "samplers": samplers }));
    }

    /// The file (glTF 2.0, 4.4), described by `details`; an error if it exceeds the size limit of a GLB.
    pub fn finish(self, details: Vec<String>) -> Result<GeneratedScene, String> {
        let (triangles, categories) = (self.placed, self.categories.clone());
        Ok(GeneratedScene { triangles, categories, details, glb: self.bytes()? })
    }

    fn bytes(mut self) -> Result<Vec<u8>, String> {
        let generator = concat!("echocast ", env!("CARGO_PKG_VERSION"));
        let mut file = json!({
            "asset": { "version": "2.0", "generator": generator },
            "scene": 0,
            "scenes": [{ "nodes": self.roots }],
            "buffers": [{ "byteLength": self.buffer.len() }],
        });
        if !self.extensions.is_empty() {
            file["extensionsUsed"] = json!(self.extensions);
        }
        if !self.required.is_empty() {
            file["extensionsRequired"] = json!(self.required);
        }
        if let Value::Object(members) = &mut file {
            members.append(&mut self.lists);
        }
        let mut text = file.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.buffer.len();
        let too_long = |_| format!("{}; allowed: {}", shown::count(length, "byte"), u32::MAX);
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
