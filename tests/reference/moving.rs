//! Scenes that move and change their shape: as files to be read, and, computed plainly, as they are at any time.

use super::{Random, Shape};
use echocast::scene::{CacheFile, Mesh, Part};
use echocast::{LoadOptions, Scene};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

/// Values at times, s; linear in between, rotations the short way, the first before and the last after.
pub type Keys<T> = Vec<(f64, T)>;

/// How something turns and drives. Without keys it does not.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Where, m.
    pub places: Keys<DVec3>,
    /// Turned how.
    pub turns: Keys<DQuat>,
}

/// What changes the shape of an actor.
#[derive(Clone, Debug, Default)]
pub enum Change {
    /// Nothing.
    #[default]
    None,
    /// Joints, each of which hangs on the one before; the first follows the actor's own track.
    Skin {
        /// Where each is as modelled, and its track in the one before; that of the first does not count.
        joints: Vec<(DVec3, Track)>,
        /// Which joints move each vertex, and how much, together 1; part by part.
        influences: Vec<Vec<[(u16, f32); 4]>>,
    },
    /// Morph targets.
    Morph {
        /// For each target, part by part, what it adds to the vertices, m.
        targets: Vec<Vec<Vec<[f32; 3]>>>,
        /// Weights of the targets.
        weights: Keys<Vec<f64>>,
    },
    /// Vertices from a file, all parts one after the other.
    Cache {
        /// Positions, m.
        samples: Keys<Vec<[f32; 3]>>,
        /// A PC2 file of so many frames a second, whose samples must be equally far apart; else an MDD file.
        fps: Option<f64>,
    },
}

/// An object of a moving scene.
#[derive(Clone, Debug, Default)]
pub struct Actor {
    /// Its name, and that of its category.
    pub name: String,
    /// Its parts, and which material of the scene each is of.
    pub parts: Vec<(Shape, usize)>,
    /// How it moves as a whole.
    pub track: Track,
    /// What changes its shape.
    pub change: Change,
}

/// A scene that moves.
#[derive(Clone, Debug, Default)]
pub struct Moving {
    /// What is in it.
    pub actors: Vec<Actor>,
    /// Reflectance and colour of its materials.
    pub materials: Vec<(f32, [f32; 3])>,
}

/// A part of an actor at one time, in the world.
#[derive(Clone, Debug, Default)]
pub struct Posed {
    /// Vertices, m.
    pub positions: Vec<DVec3>,
    /// Normals of the vertices, of any length; none: flat.
    pub normals: Option<Vec<DVec3>>,
}

/// The keys around `time` and which part of the way from one to the other has passed.
fn around<T>(keys: &Keys<T>, time: f64) -> (&T, &T, f64) {
    let last = keys.len() - 1;
    let after = keys.iter().position(|(key, _)| *key > time).unwrap_or(last);
    let before = if keys[after].0 > time { after.saturating_sub(1) } else { after };
    let ((t0, a), (t1, b)) = (&keys[before], &keys[after]);
    (a, b, if t1 > t0 { ((time - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { 0.0 })
}

fn double(vector: [f32; 3]) -> DVec3 {
    DVec3::from_array(vector.map(f64::from))
}

impl Change {
    /// Three joints along z that bend at random at these `times`, s.
    fn random_skin(random: &mut Random, parts: &[(Shape, usize)], times: &[f64]) -> Change {
        let step = DVec3::Z * 0.9;
        let joints = (0..3).map(|joint| {
            let bend = |time: &f64| (*time, DQuat::from_axis_angle(random.direction(), 4.0 * random.unit() * time));
            let track = Track { places: vec![(0.0, step)], turns: times.iter().map(bend).collect() };
            (step * f64::from(joint - 1), track)
        });
        let influences = |(shape, _): &(Shape, usize)| -> Vec<_> {
            let of = |place: &[f32; 3]| {
                // How far up the chain, in quarters of the way from one joint to the next.
                let quarters = ((f64::from(place[2]) / step.z + 1.0).clamp(0.0, 1.999) * 4.0).floor();
                let (joint, part) = ((quarters / 4.0) as u16, (quarters % 4.0 / 4.0) as f32);
                [(joint, 1.0 - part), (joint + 1, part), (0, 0.0), (0, 0.0)]
            };
            shape.positions.iter().map(of).collect()
        };
        Change::Skin { joints: joints.collect(), influences: parts.iter().map(influences).collect() }
    }
}

impl Track {
    /// Standing at `place`.
    pub fn still(place: DVec3) -> Track {
        Track { places: vec![(0.0, place)], turns: Vec::new() }
    }

    /// Where it is at `time`, s.
    pub fn at(&self, time: f64) -> DAffine3 {
        let place = if self.places.is_empty() {
            DVec3::ZERO
        } else {
            let (a, b, part) = around(&self.places, time);
            a.lerp(*b, part)
        };
        let turn = if self.turns.is_empty() {
            DQuat::IDENTITY
        } else {
            let (a, b, part) = around(&self.turns, time);
            a.slerp(*b, part)
        };
        DAffine3::from_rotation_translation(turn, place)
    }
}

impl Actor {
    /// Its parts at `time`, s.
    pub fn posed(&self, time: f64) -> Vec<Posed> {
        let own = self.track.at(time);
        let mut parts: Vec<Posed> = Vec::new();
        for (shape, _) in &self.parts {
            parts.push(Posed {
                positions: shape.positions.iter().copied().map(double).collect(),
                normals: shape.normals.as_ref().map(|normals| normals.iter().copied().map(double).collect()),
            });
        }
        match &self.change {
            Change::None => {}
            Change::Skin { joints, influences } => {
                let mut world_from_joint = own;
                let mut palette = Vec::new();
                for (number, (rest, track)) in joints.iter().enumerate() {
                    if number > 0 {
                        world_from_joint *= track.at(time);
                    }
                    palette.push(world_from_joint * DAffine3::from_translation(-*rest));
                }
                for (part, influences) in parts.iter_mut().zip(influences) {
                    for (vertex, influences) in influences.iter().enumerate() {
                        let (mut linear, mut offset) = (DMat3::ZERO, DVec3::ZERO);
                        for (joint, weight) in influences {
                            let joint = palette[usize::from(*joint)];
                            linear += joint.matrix3 * f64::from(*weight);
                            offset += joint.translation * f64::from(*weight);
                        }
                        part.positions[vertex] = linear * part.positions[vertex] + offset;
                        if let Some(normals) = &mut part.normals {
                            let cofactors = linear.inverse().transpose() * linear.determinant();
                            normals[vertex] = cofactors * normals[vertex];
                        }
                    }
                }
                return parts;
            }
            Change::Morph { targets, weights } => {
                let (a, b, way) = around(weights, time);
                for (number, target) in targets.iter().enumerate() {
                    let weight = a[number] + (b[number] - a[number]) * way;
                    for (part, by) in parts.iter_mut().zip(target) {
                        part.positions.iter_mut().zip(by).for_each(|(place, by)| *place += weight * double(*by));
                    }
                }
            }
            Change::Cache { samples, .. } => {
                let (a, b, way) = around(samples, time);
                let mut places = a.iter().zip(b).map(|(a, b)| double(*a).lerp(double(*b), way));
                for part in &mut parts {
                    part.positions.iter_mut().zip(&mut places).for_each(|(to, place)| *to = place);
                    part.normals = None;
                }
            }
        }
        for part in &mut parts {
            part.positions.iter_mut().for_each(|place| *place = own.transform_point3(*place));
            part.normals.iter_mut().flatten().for_each(|normal| *normal = own.transform_vector3(*normal));
        }
        parts
    }

    /// The corners of all its triangles at `time`, s.
    pub fn triangles(&self, time: f64) -> Vec<[DVec3; 3]> {
        let mut all = Vec::new();
        for ((shape, _), posed) in self.parts.iter().zip(self.posed(time)) {
            all.extend(shape.triangles.iter().map(|t| t.map(|vertex| posed.positions[vertex as usize])));
        }
        all
    }
}

impl Moving {
    /// One actor of each kind (stiff, skinned, morphing, from a PC2 and from an MDD file), within 6 m of 0, each of a
    /// smooth ball and a flat box; they drive at a few m/s, turn and bend at a few rad/s for 0.3 s.
    pub fn random(random: &mut Random) -> Moving {
        const TIMES: [f64; 6] = [0.0, 0.031, 0.07, 0.12, 0.2, 0.3];
        let materials = (0..4).map(|_| (random.unit() as f32, [(); 3].map(|()| random.unit() as f32))).collect();
        let mut actors = Vec::new();
        for (number, name) in ["stiff", "skinned", "morphing", "pc2", "mdd"].into_iter().enumerate() {
            let ball = Shape::sphere(random.between(0.7, 1.2), 5);
            let low = DVec3::new(-0.4, -0.3, -1.6);
            let parts =
                vec![(ball, number % 4), (Shape::cuboid(low, low + DVec3::new(0.8, 0.9, 1.3)), (number + 1) % 4)];
            let vertices: Vec<[f32; 3]> = parts.iter().flat_map(|(shape, _)| shape.positions.iter().copied()).collect();
            let moved = |random: &mut Random, by: f64, vertices: &[[f32; 3]]| -> Vec<[f32; 3]> {
                vertices.iter().map(|place| (double(*place) + random.in_cube(by)).as_vec3().to_array()).collect()
            };
            let change = match name {
                "stiff" => Change::None,
                "skinned" => Change::random_skin(random, &parts, &TIMES),
                "morphing" => {
                    let target = |random: &mut Random| -> Vec<_> {
                        let by =
                            |(shape, _): &(Shape, usize)| moved(random, 0.3, &vec![[0.0; 3]; shape.positions.len()]);
                        parts.iter().map(by).collect()
                    };
                    let targets = vec![target(random), target(random)];
                    let weights = TIMES.map(|time| (time, vec![random.between(-0.5, 1.0), random.unit()]));
                    Change::Morph { targets, weights: weights.to_vec() }
                }
                _ => {
                    let samples = (0..7).map(|k| (0.05 * f64::from(k), moved(random, 0.1, &vertices))).collect();
                    Change::Cache { samples, fps: (name == "pc2").then_some(40.0) }
                }
            };
            let (from, axis, speed) = (random.in_cube(6.0), random.direction(), random.in_cube(5.0));
            let turn = random.rotation();
            let drive = |time: f64| from + speed * time + random.in_cube(time);
            let places = TIMES.map(drive).into_iter();
            let turns = TIMES.map(|time| DQuat::from_axis_angle(axis, 3.0 * time) * turn);
            let track = Track {
                places: TIMES.into_iter().zip(places).collect(),
                turns: TIMES.into_iter().zip(turns).collect(),
            };
            actors.push(Actor { name: name.into(), parts, track, change });
        }
        Moving { actors, materials }
    }

    /// Writes it as `moving.glb` and its caches to `folder`, and reads it from there.
    ///
    /// # Panics
    /// On files that cannot be written or read.
    pub fn load(&self, folder: &Path) -> Scene {
        let mut options = LoadOptions::default();
        for (number, actor) in self.actors.iter().enumerate() {
            let Change::Cache { samples, fps } = &actor.change else { continue };
            let (ending, bytes) = match fps {
                Some(fps) => ("pc2", pc2(samples, *fps)),
                None => ("mdd", mdd(samples)),
            };
            let file = folder.join(format!("cache{number}.{ending}"));
            std::fs::write(&file, bytes).expect("a folder to write to");
            options.caches.insert(actor.name.clone(), CacheFile::new(file).fps(*fps));
        }
        let path = folder.join("moving.glb");
        std::fs::write(&path, self.glb()).expect("a folder to write to");
        Scene::load_with(path, &options).expect("sound files")
    }

    /// `scene`, which is this, standing as it is at `time`, s, in meshes of its own.
    ///
    /// # Panics
    /// If it is another scene.
    pub fn still(&self, scene: &Scene, time: f64) -> Scene {
        let mut still = scene.clone();
        for object in &mut still.objects {
            let actor = self.actors.iter().find(|actor| actor.name == object.name).expect("an object of this scene");
            let parts = actor.parts.iter().zip(actor.posed(time)).zip(&object.mesh.parts);
            let single = |vectors: &[DVec3]| vectors.iter().map(|v| v.as_vec3().to_array()).collect::<Vec<_>>();
            let parts = parts.map(|(((shape, _), posed), known)| {
                Part::default()
                    .positions(single(&posed.positions).into())
                    .normals(posed.normals.as_deref().map(|normals| single(normals).into()))
                    .triangles(shape.triangles.clone().into())
                    .material(known.material.clone())
            });
            object.mesh = Arc::new(Mesh::new("posed", parts.collect()).expect("sound parts"));
            object.world_from_object = DAffine3::IDENTITY;
            (object.motion, object.sequence) = (None, None);
        }
        still
    }

    /// It as a GLB file, without its caches.
    pub fn glb(&self) -> Vec<u8> {
        let mut file = File::default();
        // Files are y up: this turns them to where z is.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        file.nodes.push(json!({"rotation": [-half, 0.0, 0.0, half]}));
        let mut children = Vec::new();
        let (mut meshes, mut skins) = (Vec::new(), Vec::new());
        for actor in &self.actors {
            let mut mesh = json!({"primitives": []});
            for (number, (shape, material)) in actor.parts.iter().enumerate() {
                let mut attributes = json!({"POSITION": file.floats("VEC3", shape.positions.as_flattened())});
                if let Some(normals) = &shape.normals {
                    attributes["NORMAL"] = file.floats("VEC3", normals.as_flattened());
                }
                if let Change::Skin { influences, .. } = &actor.change {
                    let joints: Vec<u16> = influences[number].iter().flatten().map(|(joint, _)| *joint).collect();
                    let weights: Vec<f32> = influences[number].iter().flatten().map(|(_, weight)| *weight).collect();
                    let bytes = joints.iter().flat_map(|joint| joint.to_le_bytes()).collect();
                    attributes["JOINTS_0"] = file.accessor("VEC4", 5123, joints.len() / 4, bytes);
                    attributes["WEIGHTS_0"] = file.floats("VEC4", &weights);
                }
                let triangles = shape.triangles.as_flattened();
                let bytes = triangles.iter().flat_map(|corner| corner.to_le_bytes()).collect();
                let indices = file.accessor("SCALAR", 5125, triangles.len(), bytes);
                let mut primitive = json!({"attributes": attributes, "indices": indices, "material": material});
                if let Change::Morph { targets, .. } = &actor.change {
                    let targets = targets.iter().map(|target| file.floats("VEC3", target[number].as_flattened()));
                    primitive["targets"] = targets.map(|by| json!({"POSITION": by})).collect();
                }
                mesh["primitives"].as_array_mut().expect("a list").push(primitive);
            }
            let mut node = json!({"name": actor.name, "mesh": meshes.len()});
            meshes.push(mesh);
            let number = file.nodes.len();
            children.push(number);
            if let Change::Skin { joints, .. } = &actor.change {
                node["skin"] = skins.len().into();
                file.nodes.push(node);
                let first = number + 1;
                children.push(first);
                let mut inverse = Vec::new();
                for (joint, (rest, track)) in joints.iter().enumerate() {
                    file.track(json!({}), if joint == 0 { &actor.track } else { track });
                    if joint > 0 {
                        file.nodes[first + joint - 1]["children"] = json!([first + joint]);
                    }
                    let [x, y, z] = (-*rest).as_vec3().to_array();
                    inverse.extend([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]);
                }
                let matrices = file.floats("MAT4", &inverse);
                let joints: Vec<usize> = (first..first + joints.len()).collect();
                skins.push(json!({"joints": joints, "inverseBindMatrices": matrices}));
                continue;
            }
            file.track(node, &actor.track);
            if let Change::Morph { weights, .. } = &actor.change {
                let values = weights.iter().flat_map(|(_, weights)| weights.iter().map(|weight| *weight as f32));
                let times = weights.iter().map(|(time, _)| *time as f32).collect();
                file.channel(number, "weights", times, "SCALAR", &values.collect::<Vec<_>>());
            }
        }
        file.nodes[0]["children"] = children.into();
        let materials = self.materials.iter().enumerate().map(|(number, (reflectance, [red, green, blue]))| {
            let pbr = json!({"baseColorFactor": [red, green, blue, 1.0], "metallicFactor": 0.0});
            json!({"name": format!("paint {number}"), "pbrMetallicRoughness": pbr,
                "extras": {"reflectance": reflectance}})
        });
        let mut json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": file.nodes, "meshes": meshes,
            "materials": materials.collect::<Value>(), "accessors": file.accessors, "bufferViews": file.views,
            "buffers": [{"byteLength": file.bytes.len()}],
        });
        if !skins.is_empty() {
            json["skins"] = skins.into();
        }
        if !file.channels.is_empty() {
            json["animations"] = json!([{"name": "all", "channels": file.channels, "samplers": file.samplers}]);
        }
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + file.bytes.len();
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        [
            b"glTF".to_vec(),
            words(&[2, total as u32, text.len() as u32]),
            b"JSON".to_vec(),
            text,
            words(&[file.bytes.len() as u32]),
            b"BIN\0".to_vec(),
            file.bytes,
        ]
        .concat()
    }
}

/// A glTF file in the making.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    nodes: Vec<Value>,
    channels: Vec<Value>,
    samplers: Vec<Value>,
}

impl File {
    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: Vec<u8>) -> Value {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = self.views.len() - 1;
        self.accessors.push(json!({"bufferView": view, "componentType": component, "type": kind, "count": count}));
        (self.accessors.len() - 1).into()
    }

    fn floats(&mut self, kind: &str, numbers: &[f32]) -> Value {
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.accessor(kind, 5126, numbers.len() / width, bytes)
    }

    /// Adds `node`, which follows `track`.
    fn track(&mut self, mut node: Value, track: &Track) {
        let number = self.nodes.len();
        let places: Vec<f32> = track.places.iter().flat_map(|(_, place)| place.as_vec3().to_array()).collect();
        let turns: Vec<f32> = track.turns.iter().flat_map(|(_, turn)| turn.as_quat().to_array()).collect();
        for (path, kind, width, values, times) in [
            ("translation", "VEC3", 3, places, track.places.iter().map(|(time, _)| *time as f32).collect::<Vec<_>>()),
            ("rotation", "VEC4", 4, turns, track.turns.iter().map(|(time, _)| *time as f32).collect()),
        ] {
            if values.len() == width {
                node[path] = json!(values);
            } else if !values.is_empty() {
                self.channel(number, path, times, kind, &values);
            }
        }
        self.nodes.push(node);
    }

    fn channel(&mut self, node: usize, path: &str, times: Vec<f32>, kind: &str, values: &[f32]) {
        let (input, output) = (self.floats("SCALAR", &times), self.floats(kind, values));
        self.channels.push(json!({"sampler": self.samplers.len(), "target": {"node": node, "path": path}}));
        self.samplers.push(json!({"input": input, "output": output}));
    }
}

/// An MDD file.
pub fn mdd(samples: &Keys<Vec<[f32; 3]>>) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [samples.len(), samples[0].1.len()].iter().flat_map(|n| (*n as i32).to_be_bytes()).collect();
    bytes.extend(samples.iter().flat_map(|(time, _)| (*time as f32).to_be_bytes()));
    bytes.extend(samples.iter().flat_map(|(_, all)| all.as_flattened()).flat_map(|number| number.to_be_bytes()));
    bytes
}

/// A PC2 file of `fps` frames a second.
pub fn pc2(samples: &Keys<Vec<[f32; 3]>>, fps: f64) -> Vec<u8> {
    let (first, step) = (samples[0].0 * fps, (samples[1].0 - samples[0].0) * fps);
    let mut bytes = b"POINTCACHE2\0".to_vec();
    bytes.extend([1, samples[0].1.len() as i32].map(i32::to_le_bytes).as_flattened());
    bytes.extend([first as f32, step as f32].map(f32::to_le_bytes).as_flattened());
    bytes.extend((samples.len() as i32).to_le_bytes());
    bytes.extend(samples.iter().flat_map(|(_, all)| all.as_flattened()).flat_map(|number| number.to_le_bytes()));
    bytes
}
