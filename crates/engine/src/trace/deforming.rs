//! Meshes that deform during a scan.

use super::driving::DrivingMotion;
use crate::scene::Mesh;
use echocast_kernels::skin::{self, Influences, JointMatrix};
use echocast_kernels::tree::{self, MeshStep, RAYS, RayPacket, Tree};
use embree4::{Hit, LocalRays, Query};
use glam::{DAffine3, DMat3, Mat3, Vec3};
use ground::array::Array;
use ground::error::Result;
use model::motion::{Deformation, MeshLayout, Pull, Span, Timeline, Vertices};
use std::sync::Arc;

/// A mesh in a frame of its own, at steps of the scan time, between which its vertices move linearly.
pub(crate) struct Deforming {
    shape: Arc<Deformation>,
    mesh: Arc<Mesh>,
    /// Time of each moment, 0 to 1.
    times: Vec<f32>,
    moments: Vec<Arc<Moment>>,
}

/// A mesh at one time.
#[derive(Default)]
pub(crate) struct Moment {
    /// The shape that it belongs to.
    shape: Option<Arc<Deformation>>,
    /// s.
    time: f64,
    pull: Pull,
    step: MeshStep,
}

/// What is known of a shape from the last scans.
#[derive(Default)]
pub(super) struct Known {
    /// The next scan usually starts where the last ended; it also reuses the memory of other moments.
    pub moments: Vec<Arc<Moment>>,
    /// Memory for vertices.
    memory: Vec<[f32; 3]>,
}

impl Clone for Known {
    fn clone(&self) -> Self {
        Known::from(&*self.moments)
    }
}

impl From<&[Arc<Moment>]> for Known {
    fn from(moments: &[Arc<Moment>]) -> Self {
        Known { moments: moments.to_vec(), memory: Vec::new() }
    }
}

/// A point of a mesh: part, triangle of the part, weights of its second and third corner.
pub(crate) type MeshSpot = (usize, u32, [f32; 2]);

impl Deforming {
    /// The mesh of an object that moves along its timeline with `shape` through `span`; between steps it is accurate to
    /// the tolerance. Moments `known` already are reused, as is the memory of those no longer needed; what is left may
    /// serve the next time. `None`: its moments take more than `most_bytes`.
    ///
    /// # Errors
    /// A vertex cache that can no longer be read.
    pub(super) fn new(
        driving: &DrivingMotion,
        shape: &Arc<Deformation>,
        span: Span,
        known: &mut Known,
        most_bytes: usize,
    ) -> Result<Option<Deforming>> {
        let DrivingMotion { mesh, timeline, tolerance, .. } = driving;
        // Skins are attached to nodes that do not move.
        let world_from_object = driving.world_from_object(span.start);
        let layout = layout(&shape.vertices, mesh);
        let most = most_bytes / (layout.step_bytes() + shape.pull_bytes());
        let Some(steps) = shape.steps(timeline, span, &world_from_object, *tolerance, most) else { return Ok(None) };
        let times: Vec<_> = steps.iter().map(|(time, _)| span.part(*time)).collect();
        let Known { moments: known, memory } = known;
        let needed: Vec<f64> = steps.iter().map(|(time, _)| *time).collect();
        let is_own = |moment: &Moment| moment.shape.as_ref().is_some_and(|of| Arc::ptr_eq(of, shape));
        // Of moments no longer needed only the memory is of use.
        let spare = |known: &mut Vec<Arc<Moment>>| {
            let is_needed = |moment: &Arc<Moment>| is_own(moment) && needed.contains(&moment.time);
            let is_spare = |moment: &Arc<Moment>| Arc::strong_count(moment) == 1 && !is_needed(moment);
            known.iter().position(is_spare).and_then(|index| Arc::into_inner(known.swap_remove(index)))
        };
        let moment = |(time, pull): (f64, Pull)| -> Result<Arc<Moment>> {
            if let Some(index) = known.iter().position(|moment| is_own(moment) && moment.time == time) {
                return Ok(known.swap_remove(index));
            }
            let Moment { mut step, .. } = spare(known).unwrap_or_default();
            step.positions.resize(layout.vertices, [0.0; 4]);
            place(shape, layout, &pull, time, &mut step.positions, memory)?;
            layout.tree.fit(&step.positions, &mut step.boxes);
            Ok(Arc::new(Moment { shape: Some(shape.clone()), time, pull, step }))
        };
        let moments: Vec<_> = steps.into_iter().map(moment).collect::<Result<_>>()?;
        // Those of this scan are in use until after the next.
        known.truncate(2 * moments.len());
        Ok(Some(Deforming { shape: shape.clone(), mesh: mesh.clone(), times, moments }))
    }

    /// Memory that its moments take.
    pub(super) fn bytes(&self) -> usize {
        self.moments.len() * (self.layout().step_bytes() + self.shape.pull_bytes())
    }

    /// Its moments, for the next scan.
    pub(super) fn moments(&self) -> &[Arc<Moment>] {
        &self.moments
    }

    /// Times between which it moves linearly, 0 to 1.
    pub(super) fn times(&self) -> &[f32] {
        &self.times
    }

    fn layout(&self) -> &MeshLayout {
        layout(&self.shape.vertices, &self.mesh)
    }

    /// The moments before and after `time`, 0 to 1, and the fraction of the interval between them that has passed.
    fn between(&self, time: f32) -> (usize, usize, f32) {
        let after = self.times.partition_point(|step| *step <= time);
        let before = after.saturating_sub(1);
        if after == 0 || after == self.times.len() {
            return (before, before, 0.0);
        }
        let [from, to] = [self.times[before], self.times[after]];
        (before, after, (time - from) / (to - from))
    }

    /// Box around it at `time`, 0 to 1.
    pub(super) fn bounds(&self, time: f32) -> [[f32; 3]; 2] {
        let (before, after, part) = self.between(time);
        let [a, b] =
            [before, after].map(|moment| self.layout().tree.bounds(&self.moments[moment].step).map(Vec3::from));
        [a[0].lerp(b[0], part).to_array(), a[1].lerp(b[1], part).to_array()]
    }

    /// Finds what the `active` lanes (-1, else 0) of `query` hit, with the origins and directions of `rays`.
    pub(super) fn intersect(&self, query: &mut Query, rays: &mut LocalRays, active: &[i32; RAYS]) {
        let lanes = query.lanes();
        let layout = self.layout();
        let mut packet = RayPacket::default();
        let [org, dir] = {
            let [a, b, c, d, e, f] = rays.rows(lanes);
            [[a, b, c], [d, e, f]]
        };
        for axis in 0..3 {
            packet.org[axis][..lanes].copy_from_slice(org[axis]);
            packet.dir[axis][..lanes].copy_from_slice(dir[axis]);
        }
        packet.near[..lanes].copy_from_slice(query.near());
        packet.far[..lanes].copy_from_slice(query.far());
        let (mut from, mut to) = ([0; RAYS], [0; RAYS]);
        let mut waiting = 0_u16;
        for lane in (0..lanes).filter(|&lane| active[lane] != 0) {
            (from[lane], to[lane], packet.part[lane]) = self.between(query.times()[lane]);
            waiting |= 1 << lane;
        }
        let mut hits = 0;
        while waiting != 0 {
            // Lanes between the same moments are traced together.
            let first = waiting.trailing_zeros() as usize;
            let alike = (0..lanes).filter(|&lane| (from[lane], to[lane]) == (from[first], to[first]));
            let together = waiting & alike.fold(0, |mask, lane| mask | 1 << lane);
            waiting &= !together;
            let [a, b] = [from[first], to[first]].map(|moment| &self.moments[moment].step);
            let mut accept = |lane: usize, far: f32, triangle: u32, uv: [f32; 2]| {
                let (part, triangle) = layout.of(triangle);
                query.counts(lane, far, part as u32, triangle, uv)
            };
            let accept: Option<&mut tree::Accept> = if query.refuses() { Some(&mut accept) } else { None };
            hits |= if query.any_hit() {
                tree::occluded(&layout.tree, a, b, &packet, together, accept)
            } else {
                tree::intersect(&layout.tree, a, b, &mut packet, together, accept)
            };
        }
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            let (part, triangle) = layout.of(packet.triangle[lane]);
            let normal = packet.normal.map(|axis| axis[lane]);
            let uv = [packet.u[lane], packet.v[lane]];
            query.hit(lane, &Hit { far: packet.far[lane], normal, uv, triangle, mesh: part as u32 });
        }
    }

    fn corners(&self, part: usize, triangle: u32) -> [usize; 3] {
        self.mesh.parts[part].triangles[triangle as usize].map(|vertex| vertex as usize)
    }

    /// Passes the positions of the corners of all triangles at `time`, 0 to 1, and their velocities, per length of the
    /// time span, to `visit`.
    pub(super) fn each_corner(&self, time: f32, visit: &mut dyn FnMut(Vec3, Vec3)) {
        let (before, after, way) = self.between(time);
        let [a, b] = [before, after].map(|moment| &self.moments[moment].step.positions);
        let per_time = if after > before { 1.0 / (self.times[after] - self.times[before]) } else { 0.0 };
        for (part, &first) in self.mesh.parts.iter().zip(&self.layout().first_vertex) {
            for &corner in part.triangles.iter().flatten() {
                let [a, b] = [a, b].map(|positions| vertex(&positions[first + corner as usize]));
                visit(a.lerp(b, way), (b - a) * per_time);
            }
        }
    }

    /// Rotation of its skeleton as a whole at `time`, s, from how it was modelled: that of the first of its joints.
    pub(super) fn turned(&self, timeline: &Timeline, time: f64, world_from_object: &DAffine3) -> Option<DMat3> {
        let skin = self.shape.skin.as_ref()?;
        // Parents have lower numbers than their children.
        let (first, _) = skin.joints.iter().enumerate().min_by_key(|(_, node)| **node)?;
        let Pull { palette, .. } = self.shape.pull(timeline, time, world_from_object);
        palette.get(first).map(|joint| joint.matrix3)
    }

    /// A point of it at `time`, 0 to 1, and its velocity, per length of the time span.
    pub(super) fn point(&self, (part, triangle, [u, v]): MeshSpot, time: f32) -> (Vec3, Vec3) {
        let (before, after, way) = self.between(time);
        let first = self.layout().first_vertex[part];
        let corners = self.corners(part, triangle);
        let [a, b] = [before, after].map(|moment| {
            let positions = &self.moments[moment].step.positions;
            let [p, q, r] = corners.map(|corner| vertex(&positions[first + corner]));
            p * (1.0 - u - v) + q * u + r * v
        });
        let rate = if after > before { (b - a) / (self.times[after] - self.times[before]) } else { Vec3::ZERO };
        (a.lerp(b, way), rate)
    }

    /// The normal at a point, of any length, from those of the vertices; `None`: the part is flat.
    pub(super) fn normal(&self, (part, triangle, [u, v]): MeshSpot, time: f32) -> Option<Vec3> {
        let vertices = &self.shape.vertices.parts[part];
        let modelled = vertices.normals.as_deref()?;
        let (before, after, way) = self.between(time);
        let corners = self.corners(part, triangle);
        if self.shape.cache.is_some() {
            // The rotation of the triangle is applied to the normals that it was modelled with.
            let first = self.layout().first_vertex[part];
            let now = corners.map(|corner| {
                let [a, b] = [before, after].map(|at| vertex(&self.moments[at].step.positions[first + corner]));
                a.lerp(b, way)
            });
            let then = corners.map(|vertex| Vec3::from(vertices.positions[vertex]));
            let frame = |[a, b, c]: [Vec3; 3]| {
                let normal = (b - a).cross(c - a).normalize_or_zero();
                Mat3::from_cols(b - a, c - a, normal)
            };
            let turn = (frame(now) * frame(then).inverse()).inverse().transpose();
            let [p, q, r] = corners.map(|vertex| Vec3::from(modelled[vertex]));
            let smooth = turn * (p * (1.0 - u - v) + q * u + r * v);
            return smooth.is_finite().then_some(smooth);
        }
        let [a, b] = [before, after].map(|moment| {
            let Pull { weights, palette } = &self.moments[moment].pull;
            let [p, q, r] = corners.map(|vertex| vertices.normal(vertex, weights, palette));
            p * (1.0 - u - v) + q * u + r * v
        });
        Some(a.lerp(b, way))
    }
}

/// The triangles of `mesh`, which has these vertices, laid out for rays.
fn layout<'a>(vertices: &'a Vertices, mesh: &Mesh) -> &'a MeshLayout {
    vertices.layout.get_or_init(|| {
        let (mut first_vertex, mut first_triangle) = (Vec::<usize>::new(), Vec::new());
        let (mut all, mut positions, mut triangles) = (0, Vec::new(), Vec::new());
        for (number, (part, of)) in mesh.parts.iter().zip(&vertices.parts).enumerate() {
            // Parts may share vertices; those then move alike.
            let shared = (0..number).find(|&other| vertices.parts[other].moves_as(of));
            let first = shared.map_or(all, |other| first_vertex[other]);
            if shared.is_none() {
                positions.extend_from_slice(&of.positions);
                all += of.positions.len();
            }
            first_triangle.push(triangles.len() as u32);
            triangles.extend(part.triangles.iter().map(|corners| corners.map(|corner| corner + first as u32)));
            first_vertex.push(first);
        }
        MeshLayout { tree: Tree::new(&positions, &triangles), first_vertex, first_triangle, vertices: all }
    })
}

/// Computes the positions of all vertices of `shape` at `time`, s, as moved by `pull`; `memory` is reused.
fn place(
    shape: &Deformation,
    layout: &MeshLayout,
    pull: &Pull,
    time: f64,
    positions: &mut [[f32; 4]],
    memory: &mut Vec<[f32; 3]>,
) -> Result<()> {
    if let Some(cache) = &shape.cache {
        cache.at(time, memory)?;
        // Its vertices are those that the parts share.
        widen(memory, positions);
        return Ok(());
    }
    let palette: Vec<JointMatrix> = pull.palette.iter().map(joint).collect();
    let mut done = 0;
    for (part, &first) in shape.vertices.parts.iter().zip(&layout.first_vertex) {
        if first < done {
            continue;
        }
        let to = &mut positions[first..first + part.positions.len()];
        done = first + to.len();
        let morphs = part.targets.iter().zip(&pull.weights).filter(|(_, weight)| **weight != 0.0);
        let morphs = morphs.filter_map(|(target, &weight)| Some((target.positions.as_deref()?, weight as f32)));
        let sets: Vec<_> =
            part.joints.iter().zip(&part.weights).map(|(joints, weights)| Influences { joints, weights }).collect();
        let rest: &Array<[f32; 3]> = &part.positions;
        let mut morphs = morphs.peekable();
        let mut morphed: &[[f32; 3]] = rest;
        if morphs.peek().is_some() {
            memory.clear();
            memory.extend_from_slice(rest);
            morphs.for_each(|(way, weight)| skin::add_scaled(memory, way, weight));
            morphed = memory;
        }
        if sets.is_empty() {
            widen(morphed, to);
        } else {
            skin::skin(morphed, &sets, &palette, to);
        }
    }
    Ok(())
}

/// Copies as many as both have.
fn widen(from: &[[f32; 3]], to: &mut [[f32; 4]]) {
    for (to, &[x, y, z]) in to.iter_mut().zip(from) {
        *to = [x, y, z, 0.0];
    }
}

fn vertex(&[x, y, z, _]: &[f32; 4]) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A joint's matrix in the kernels' form.
fn joint(place: &DAffine3) -> JointMatrix {
    let DAffine3 { matrix3, translation } = place;
    let columns = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis, *translation];
    std::array::from_fn(|k| if k % 4 == 3 { 0.0 } else { columns[k / 4][k % 4] as f32 })
}
