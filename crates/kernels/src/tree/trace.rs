//! Packets of rays through a tree between two steps.
//!
//! Neighbours that point to the same side (the greatest component of their directions has the same axis and sign)
//! traverse the tree together. All children of a node are tested at once against the bounds of the rays: their slopes
//! against that axis, origins and times. If that test passes, the rays are tested against the box of a leaf, unless it
//! has a single triangle, and then against its triangles.

use super::build::MOST_DEPTH;
use super::{CHILDREN, ChildBoxes, FARTHEST, MeshStep, NODE, Tree, TreeNode, greatest, least};
use crate::level::kernels;

/// Rays of a packet.
pub const RAYS: usize = 16;

/// A number for each ray.
type RayLanes<T = f32> = [T; RAYS];

/// Rays side by side, and what they hit.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct RayPacket {
    /// Origins.
    pub org: [RayLanes; 3],
    /// Directions, of any length.
    pub dir: [RayLanes; 3],
    /// Hits are farther than this, in lengths of `dir`, at least 0.
    pub near: RayLanes,
    /// Hits are not farther than this; afterwards where the hit is.
    pub far: RayLanes,
    /// Time: 0 at the first step, 1 at the second; clamped to these.
    pub part: RayLanes,
    /// Weight of the triangle's second corner.
    pub u: RayLanes,
    /// Weight of the triangle's third corner.
    pub v: RayLanes,
    /// Normal of the triangle at that time, by the right-hand rule; its length is twice the area.
    pub normal: [RayLanes; 3],
    /// Index of the triangle.
    pub triangle: RayLanes<u32>,
}

impl Default for RayPacket {
    fn default() -> Self {
        RayPacket {
            org: [[0.0; RAYS]; 3],
            dir: [[0.0; RAYS]; 3],
            near: [0.0; RAYS],
            far: [f32::INFINITY; RAYS],
            part: [0.0; RAYS],
            u: [0.0; RAYS],
            v: [0.0; RAYS],
            normal: [[0.0; RAYS]; 3],
            triangle: [0; RAYS],
        }
    }
}

/// Whether a hit counts: the lane of the ray, where it is in lengths of the ray's `dir`, the triangle, the weights of
/// its second and third corner.
pub type Accept<'a> = dyn FnMut(usize, f32, u32, [f32; 2]) -> bool + 'a;

kernels! {
    /// Finds the closest hit of each of the rays whose bit in `active` is set, on triangles whose corners move in
    /// straight lines from step `a` to step `b` (which may be the same); returns which rays hit anything. The others
    /// are unchanged.
    ///
    /// Both sides of a triangle are hit, and its edges belong to it. A hit that `accept` refuses does not count: it is
    /// called in any order, and not only for closest hits. A triangle or a ray with a number that is not finite, or
    /// beyond 1e18, hits nothing, nor does anything in a step that has not been fitted.
    pub fn intersect(
        tree: &Tree,
        a: &MeshStep,
        b: &MeshStep,
        packet: &mut RayPacket,
        active: u16,
        accept: Option<&mut Accept>,
    ) -> u16 {
        let mut hits = Hits::default();
        if std::ptr::eq(a, b) {
            trace::<false, false>(tree, [a, b], packet, active, accept, &mut hits);
        } else {
            trace::<false, true>(tree, [a, b], packet, active, accept, &mut hits);
        }
        let is = &hits.is;
        for lane in 0..RAYS {
            packet.far[lane] = if is[lane] != 0 { hits.far[lane] } else { packet.far[lane] };
            packet.u[lane] = if is[lane] != 0 { hits.u[lane] } else { packet.u[lane] };
            packet.v[lane] = if is[lane] != 0 { hits.v[lane] } else { packet.v[lane] };
            packet.triangle[lane] = if is[lane] != 0 { hits.triangle[lane] } else { packet.triangle[lane] };
        }
        for axis in 0..3 {
            let normal = &mut packet.normal[axis];
            for lane in 0..RAYS {
                normal[lane] = if is[lane] != 0 { hits.normal[axis][lane] } else { normal[lane] };
            }
        }
        bits(&hits.is)
    }

    /// Which of the rays hit anything, as found by [`intersect`], but faster.
    pub fn occluded(
        tree: &Tree,
        a: &MeshStep,
        b: &MeshStep,
        packet: &RayPacket,
        active: u16,
        accept: Option<&mut Accept>,
    ) -> u16 {
        let mut hits = Hits::default();
        if std::ptr::eq(a, b) {
            trace::<true, false>(tree, [a, b], packet, active, accept, &mut hits);
        } else {
            trace::<true, true>(tree, [a, b], packet, active, accept, &mut hits);
        }
        bits(&hits.is)
    }
}

/// What was hit so far.
#[derive(Default)]
#[repr(align(64))]
struct Hits {
    far: RayLanes,
    u: RayLanes,
    v: RayLanes,
    normal: [RayLanes; 3],
    triangle: RayLanes<u32>,
    /// 1 for rays that hit anything.
    is: RayLanes<u32>,
}

/// Rays that point to the same side; the other lanes are copies of one of them that can hit nothing. Axes are in the
/// order in which that side's is the last.
#[repr(align(64))]
struct Beam {
    org: [RayLanes; 3],
    /// Slopes against the last axis.
    slope: [RayLanes; 2],
    /// Ray parameter per length along each axis.
    per: [RayLanes; 3],
    /// Length along the last axis per ray parameter.
    along: RayLanes,
    near: RayLanes,
    far: RayLanes,
    /// Weights of both steps.
    parts: [RayLanes; 2],
}

/// Bounds of a beam.
struct Hull {
    /// Least and greatest origin along each axis.
    org: [[f32; 2]; 3],
    /// Least and greatest change along the first two axes per length forward along the last.
    slope: [[f32; 2]; 2],
    /// Least length and greatest along the last axis.
    reach: [f32; 2],
    /// Weights of both steps for the first of the rays and the last.
    parts: [[f32; 2]; 2],
    /// Whether the beam points down the last axis.
    down: bool,
}

/// Leaves of no more triangles are not worth a test of their box.
const UNTOUCHED: u8 = 1;

/// More than the rounding error of slopes and lengths.
const SLACK: f32 = 1.0 / (1 << 20) as f32;

/// Rays are neighbours if their slopes differ by no more than this,
const BENT: f32 = 0.04;

/// and their origins by no more than this part of the mesh.
const APART: f32 = 0.05;

/// `MOVES`: whether the steps differ. `ANY`: whether one hit of each ray is enough.
#[inline(always)]
fn trace<const ANY: bool, const MOVES: bool>(
    tree: &Tree,
    steps: [&MeshStep; 2],
    packet: &RayPacket,
    active: u16,
    mut accept: Option<&mut Accept>,
    hits: &mut Hits,
) {
    if tree.nodes.is_empty() || !steps.iter().all(|step| tree.fits(step)) {
        return;
    }
    // Twice the axis, plus whether they point down it.
    let mut side = [0; RAYS];
    let mut valid = [0; RAYS];
    let mut slopes = [[0.0; RAYS]; 2];
    for lane in 0..RAYS {
        let (x, y, z) = (packet.dir[0][lane], packet.dir[1][lane], packet.dir[2][lane]);
        let (size_x, size_y, size_z) = (x.abs(), y.abs(), z.abs());
        let most = greatest(greatest(size_x, size_y), size_z);
        let (is_x, is_y) = (most == size_x, most == size_y);
        let (axis, along) = if is_y { (2, y) } else { (4, z) };
        let (axis, along) = if is_x { (0, x) } else { (axis, along) };
        side[lane] = axis + u32::from(along < 0.0);
        slopes[0][lane] = (if is_x { y } else { x }) / along;
        slopes[1][lane] = (if is_x | is_y { z } else { y }) / along;
        let place = packet.org[0][lane].abs() + packet.org[1][lane].abs() + packet.org[2][lane].abs();
        valid[lane] = u32::from(
            (place <= FARTHEST)
                & (size_x + size_y + size_z <= FARTHEST)
                & (most >= 1.0 / FARTHEST)
                & (packet.near[lane] < packet.far[lane])
                & (packet.part[lane].abs() <= FARTHEST),
        );
    }
    let mut left = active & bits(&valid);
    // Rays that are not neighbours of those before them.
    let mut apart = [0; RAYS];
    for lane in 1..RAYS {
        let last = lane - 1;
        let bent = greatest((slopes[0][lane] - slopes[0][last]).abs(), (slopes[1][lane] - slopes[1][last]).abs());
        let moved = (packet.org[0][lane] - packet.org[0][last]).abs()
            + (packet.org[1][lane] - packet.org[1][last]).abs()
            + (packet.org[2][lane] - packet.org[2][last]).abs();
        apart[lane] = u32::from((side[lane] != side[last]) | (bent > BENT) | (moved > tree.size * APART));
    }
    let apart = u32::from(bits(&apart)) | 1 << RAYS;
    while left != 0 {
        let first = left.trailing_zeros() as usize % RAYS;
        let end = (apart >> first & !1).trailing_zeros() as usize + first;
        let group = left & ((1u32 << end) - 1) as u16;
        left &= !group;
        pass::<ANY, MOVES>(tree, steps, packet, group, side[first], &mut accept, hits);
    }
}

/// The lanes that are 1, as bits.
#[inline(always)]
fn bits(is: &RayLanes<u32>) -> u16 {
    let mut bits = 0;
    for lane in 0..RAYS {
        bits |= is[lane] << lane;
    }
    bits as u16
}

/// Traces the rays of a `group` that point to the same `side`.
#[inline(always)]
fn pass<const ANY: bool, const MOVES: bool>(
    tree: &Tree,
    [a, b]: [&MeshStep; 2],
    packet: &RayPacket,
    group: u16,
    side: u32,
    accept: &mut Option<&mut Accept>,
    hits: &mut Hits,
) {
    let axes = match side / 2 {
        0 => [1, 2, 0],
        1 => [2, 0, 1],
        _ => [0, 1, 2],
    };
    let (mut beam, hull) = prepare(packet, group, axes, side % 2 == 1);
    let mut reach = hull.reach[1];
    // Children of nodes that are still to be visited, each with the least length to it along the last axis.
    let mut stack = [(0u32, 0.0f32); MOST_DEPTH * (CHILDREN - 1) + 1];
    let mut open = 0;
    let mut node = 0;
    loop {
        let (mut entered, lengths) = enter::<MOVES>(&a.boxes[node], &b.boxes[node], &hull, reach, axes);
        let bottom = open;
        while entered != 0 {
            let child = entered.trailing_zeros();
            entered &= entered - 1;
            let length = lengths[child as usize % CHILDREN];
            // The nearest on top.
            let mut at = open;
            while at > bottom && stack[at - 1].1 < length {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = (node as u32 * CHILDREN as u32 + child, length);
            open += 1;
        }
        node = loop {
            if open == 0 {
                return;
            }
            open -= 1;
            let (place, length) = stack[open];
            if length > reach {
                continue;
            }
            let (node, child) = (place as usize / CHILDREN, place as usize % CHILDREN);
            let TreeNode { first, count, .. } = &tree.nodes[node];
            let (first, count) = (first[child] as usize, count[child]);
            if count == NODE {
                break first;
            }
            if count > UNTOUCHED && !touches::<MOVES>(&a.boxes[node], &b.boxes[node], child, &beam, axes) {
                continue;
            }
            let mut found = false;
            for &[i, j, k, triangle] in &tree.triangles[first..first + usize::from(count)] {
                let corners = [
                    [&a.positions[i as usize], &b.positions[i as usize]],
                    [&a.positions[j as usize], &b.positions[j as usize]],
                    [&a.positions[k as usize], &b.positions[k as usize]],
                ];
                found |= meet::<ANY, MOVES>(corners, triangle, &mut beam, axes, accept, hits);
            }
            if found {
                if ANY && bits(&hits.is) & group == group {
                    return;
                }
                let mut lengths = [0.0; RAYS];
                for lane in 0..RAYS {
                    lengths[lane] = beam.far[lane] * beam.along[lane];
                }
                reach = span(&lengths)[1];
                reach += reach * SLACK;
            }
        };
    }
}

/// The rays of a `group`, and their bounds.
#[inline(always)]
fn prepare(packet: &RayPacket, group: u16, axes: [usize; 3], down: bool) -> (Beam, Hull) {
    let any = group.trailing_zeros() as usize % RAYS;
    let mut is = [0; RAYS];
    for lane in 0..RAYS {
        is[lane] = u32::from(group) >> lane & 1;
    }
    let mut beam = Beam {
        org: [[0.0; RAYS]; 3],
        slope: [[0.0; RAYS]; 2],
        per: [[0.0; RAYS]; 3],
        along: [0.0; RAYS],
        near: [0.0; RAYS],
        far: [0.0; RAYS],
        parts: [[0.0; RAYS]; 2],
    };
    let mut dir = [[0.0; RAYS]; 3];
    for axis in 0..3 {
        let (from_org, from_dir) = (&packet.org[axes[axis]], &packet.dir[axes[axis]]);
        for lane in 0..RAYS {
            beam.org[axis][lane] = if is[lane] != 0 { from_org[lane] } else { from_org[any] };
            dir[axis][lane] = if is[lane] != 0 { from_dir[lane] } else { from_dir[any] };
        }
    }
    let mut lengths = [[0.0; RAYS]; 2];
    for lane in 0..RAYS {
        let is = is[lane] != 0;
        let near = if is { packet.near[lane] } else { packet.near[any] };
        beam.near[lane] = greatest(near, 0.0);
        beam.far[lane] = if is { packet.far[lane] } else { f32::NEG_INFINITY };
        // The weights sum to 1 and are no less than 0.
        let part = if is { packet.part[lane] } else { packet.part[any] };
        let part = least(greatest(part, 0.0), 1.0);
        beam.parts[0][lane] = 1.0 - part;
        beam.parts[1][lane] = part;
        beam.per[2][lane] = 1.0 / dir[2][lane];
        beam.along[lane] = dir[2][lane].abs();
        lengths[0][lane] = beam.near[lane] * beam.along[lane];
        lengths[1][lane] = beam.far[lane] * beam.along[lane];
    }
    for axis in 0..2 {
        for lane in 0..RAYS {
            let (across, along) = (dir[axis][lane], dir[2][lane]);
            beam.slope[axis][lane] = across / along;
            // Never 0, so that products with the reciprocal are numbers.
            let least = along.abs() * (1.0 / FARTHEST);
            beam.per[axis][lane] = 1.0 / if across.abs() > least { across } else { least };
        }
    }
    let (near, far) = (span(&lengths[0])[0], span(&lengths[1])[1]);
    let [first, last] = span(&beam.parts[1]);
    let mut hull = Hull {
        org: [span(&beam.org[0]), span(&beam.org[1]), span(&beam.org[2])],
        slope: [span(&beam.slope[0]), span(&beam.slope[1])],
        reach: [near - near * SLACK, far + far * SLACK],
        parts: [[1.0 - first, first], [1.0 - last, last]],
        down,
    };
    for [low, high] in &mut hull.slope {
        (*low, *high) = (*low - low.abs() * SLACK, *high + high.abs() * SLACK);
        if down {
            (*low, *high) = (-*high, -*low);
        }
    }
    (beam, hull)
}

/// The least and the greatest of the numbers.
#[inline(always)]
fn span(values: &RayLanes) -> [f32; 2] {
    // By halves, as vector instructions do it.
    let (mut low, mut high) = (*values, *values);
    for half in [8, 4, 2, 1] {
        for lane in 0..half {
            low[lane] = least(low[lane], low[lane + half]);
            high[lane] = greatest(high[lane], high[lane + half]);
        }
    }
    [low[0], high[0]]
}

/// Which children of a node the beam may enter, and the least length to each along the last axis.
#[inline(always)]
fn enter<const MOVES: bool>(
    a: &ChildBoxes,
    b: &ChildBoxes,
    hull: &Hull,
    reach: f32,
    axes: [usize; 3],
) -> (u16, [f32; CHILDREN]) {
    // Bounds at all times of the rays.
    let mut low = [[0.0; CHILDREN]; 3];
    let mut high = [[0.0; CHILDREN]; 3];
    for axis in 0..3 {
        let (a_low, a_high) = (&a.bounds[0][axes[axis]], &a.bounds[1][axes[axis]]);
        let (b_low, b_high) = (&b.bounds[0][axes[axis]], &b.bounds[1][axes[axis]]);
        for child in 0..CHILDREN {
            if MOVES {
                let [[a_first, b_first], [a_last, b_last]] = hull.parts;
                let first = a_first * a_low[child] + b_first * b_low[child];
                let last = a_last * a_low[child] + b_last * b_low[child];
                low[axis][child] = least(first, last);
                let first = a_first * a_high[child] + b_first * b_high[child];
                let last = a_last * a_high[child] + b_last * b_high[child];
                high[axis][child] = greatest(first, last);
            } else {
                low[axis][child] = a_low[child];
                high[axis][child] = a_high[child];
            }
        }
    }
    let mut start = [0.0; CHILDREN];
    let mut end = [0.0; CHILDREN];
    let [least_org, greatest_org] = hull.org[2];
    if hull.down {
        for child in 0..CHILDREN {
            start[child] = least_org - high[2][child];
            end[child] = greatest_org - low[2][child];
        }
    } else {
        for child in 0..CHILDREN {
            start[child] = low[2][child] - greatest_org;
            end[child] = high[2][child] - least_org;
        }
    }
    // Whether the beam may enter, as integers: registers hold masks of that width.
    let mut enters = [0; CHILDREN];
    for child in 0..CHILDREN {
        start[child] = greatest(start[child], hull.reach[0]);
        end[child] = least(end[child], reach);
        enters[child] = u32::from(start[child] <= end[child]);
    }
    for axis in 0..2 {
        let ([least_slope, greatest_slope], [least_org, greatest_org]) = (hull.slope[axis], hull.org[axis]);
        for child in 0..CHILDREN {
            let lowest = least(least_slope * start[child], least_slope * end[child]);
            let highest = greatest(greatest_slope * start[child], greatest_slope * end[child]);
            enters[child] &= u32::from(low[axis][child] - greatest_org <= highest);
            enters[child] &= u32::from(high[axis][child] - least_org >= lowest);
        }
    }
    (bits(&enters), start)
}

/// Whether any ray hits the box of a child.
#[inline(always)]
fn touches<const MOVES: bool>(a: &ChildBoxes, b: &ChildBoxes, child: usize, beam: &Beam, axes: [usize; 3]) -> bool {
    let mut near = beam.near;
    let mut far = beam.far;
    for axis in 0..3 {
        let (a_low, a_high) = (a.bounds[0][axes[axis]][child], a.bounds[1][axes[axis]][child]);
        let (b_low, b_high) = (b.bounds[0][axes[axis]][child], b.bounds[1][axes[axis]][child]);
        for lane in 0..RAYS {
            let (mut low, mut high) = (a_low, a_high);
            if MOVES {
                let (of_a, of_b) = (beam.parts[0][lane], beam.parts[1][lane]);
                (low, high) = (of_a * a_low + of_b * b_low, of_a * a_high + of_b * b_high);
            }
            let low = (low - beam.org[axis][lane]) * beam.per[axis][lane];
            let high = (high - beam.org[axis][lane]) * beam.per[axis][lane];
            near[lane] = greatest(least(low, high), near[lane]);
            far[lane] = least(greatest(low, high), far[lane]);
        }
    }
    let mut any = false;
    for lane in 0..RAYS {
        any |= near[lane] <= far[lane] + far[lane] * SLACK;
    }
    any
}

/// Intersects the beam with a triangle, given the positions of each corner at both steps; returns whether any ray now
/// has a closer hit.
///
/// Corners are sheared along the rays (Woop, Benthin and Wald 2013, "Watertight ray/triangle intersection"): two
/// triangles have exactly opposite signs at their common edge, so that no ray passes between them. Rounded products are
/// in the order of the exact ones, so a difference that is not 0 has the right sign; what is 0 is computed again.
#[inline(always)]
fn meet<const ANY: bool, const MOVES: bool>(
    corners: [[&[f32; 4]; 2]; 3],
    triangle: u32,
    beam: &mut Beam,
    axes: [usize; 3],
    accept: &mut Option<&mut Accept>,
    hits: &mut Hits,
) -> bool {
    // Positions of the corners relative to the rays: across and along the last axis.
    let mut across = [[[0.0; RAYS]; 2]; 3];
    let mut along = [[0.0; RAYS]; 3];
    for corner in 0..3 {
        let [a, b] = corners[corner];
        for lane in 0..RAYS {
            along[corner][lane] = at::<MOVES>(a[axes[2]], b[axes[2]], beam, lane) - beam.org[2][lane];
        }
        for axis in 0..2 {
            for lane in 0..RAYS {
                let place = at::<MOVES>(a[axes[axis]], b[axes[axis]], beam, lane) - beam.org[axis][lane];
                across[corner][axis][lane] = place - beam.slope[axis][lane] * along[corner][lane];
            }
        }
    }
    // Twice the areas opposite each corner.
    let mut areas = [[0.0; RAYS]; 3];
    for corner in 0..3 {
        let (of, to) = (&across[(corner + 2) % 3], &across[(corner + 1) % 3]);
        for lane in 0..RAYS {
            areas[corner][lane] = of[0][lane] * to[1][lane] - of[1][lane] * to[0][lane];
        }
    }
    let (mut any, mut on_edge) = (false, false);
    for lane in 0..RAYS {
        let low = least(least(areas[0][lane], areas[1][lane]), areas[2][lane]);
        let high = greatest(greatest(areas[0][lane], areas[1][lane]), areas[2][lane]);
        any |= (low >= 0.0) | (high <= 0.0);
        on_edge |= (low == 0.0) | (high == 0.0);
    }
    if !any {
        return false;
    }
    if on_edge {
        weigh_exactly(&across, &mut areas);
    }
    let mut is = [0; RAYS];
    let mut far = [0.0; RAYS];
    let mut weights = [[0.0; RAYS]; 2];
    for lane in 0..RAYS {
        let (a, b, c) = (areas[0][lane], areas[1][lane], areas[2][lane]);
        let inside = ((a >= 0.0) & (b >= 0.0) & (c >= 0.0)) | ((a <= 0.0) & (b <= 0.0) & (c <= 0.0));
        // 0 for a triangle seen edge-on: then everything below is NaN.
        let whole = a + b + c;
        let (a, b, c) = (a / whole, b / whole, c / whole);
        let at = (a * along[0][lane] + b * along[1][lane] + c * along[2][lane]) * beam.per[2][lane];
        weights[0][lane] = b;
        weights[1][lane] = c;
        far[lane] = at;
        is[lane] = u32::from(inside & (at > beam.near[lane]) & (at <= beam.far[lane]) & (at < f32::INFINITY));
    }
    if let Some(accept) = accept {
        for lane in 0..RAYS {
            if is[lane] != 0 {
                is[lane] = u32::from(accept(lane, far[lane], triangle, [weights[0][lane], weights[1][lane]]));
            }
        }
    }
    let mut any = false;
    for lane in 0..RAYS {
        hits.is[lane] |= is[lane];
        any |= is[lane] != 0;
    }
    if !any {
        return false;
    }
    if ANY {
        for lane in 0..RAYS {
            beam.far[lane] = if is[lane] != 0 { f32::NEG_INFINITY } else { beam.far[lane] };
        }
        return true;
    }
    let mut edges = [[[0.0; RAYS]; 3]; 2];
    for axis in 0..3 {
        let [[a0, a1], [b0, b1], [c0, c1]] = corners;
        for lane in 0..RAYS {
            let a = at::<MOVES>(a0[axis], a1[axis], beam, lane);
            edges[0][axis][lane] = at::<MOVES>(b0[axis], b1[axis], beam, lane) - a;
            edges[1][axis][lane] = at::<MOVES>(c0[axis], c1[axis], beam, lane) - a;
        }
    }
    let [e, f] = &edges;
    for axis in 0..3 {
        let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
        for lane in 0..RAYS {
            let normal = e[y][lane] * f[z][lane] - e[z][lane] * f[y][lane];
            hits.normal[axis][lane] = if is[lane] != 0 { normal } else { hits.normal[axis][lane] };
        }
    }
    for lane in 0..RAYS {
        let is = is[lane] != 0;
        beam.far[lane] = if is { far[lane] } else { beam.far[lane] };
        hits.far[lane] = if is { far[lane] } else { hits.far[lane] };
        hits.u[lane] = if is { weights[0][lane] } else { hits.u[lane] };
        hits.v[lane] = if is { weights[1][lane] } else { hits.v[lane] };
        hits.triangle[lane] = if is { triangle } else { hits.triangle[lane] };
    }
    true
}

/// Recomputes the areas for rays that are on an edge in single precision, up to a common factor: in double precision
/// products are exact, and their differences have the right sign.
#[cold]
#[inline(never)]
fn weigh_exactly(across: &[[RayLanes; 2]; 3], areas: &mut [RayLanes; 3]) {
    for lane in 0..RAYS {
        if areas.iter().all(|area| area[lane] != 0.0) {
            continue;
        }
        let place = |corner: usize| [0, 1].map(|axis| f64::from(across[corner % 3][axis][lane]));
        let exact: [f64; 3] = std::array::from_fn(|corner| {
            let (of, to) = (place(corner + 2), place(corner + 1));
            of[0] * to[1] - of[1] * to[0]
        });
        let whole: f64 = exact.iter().sum();
        let inside = exact.iter().all(|area| *area >= 0.0) || exact.iter().all(|area| *area <= 0.0);
        for (area, exact) in areas.iter_mut().zip(exact) {
            // Outside: all of them are NaN.
            area[lane] = if inside { (exact / whole) as f32 } else { f32::NAN };
        }
    }
}

/// A coordinate at the time of a ray.
#[inline(always)]
fn at<const MOVES: bool>(a: f32, b: f32, beam: &Beam, lane: usize) -> f32 {
    if MOVES { beam.parts[0][lane] * a + beam.parts[1][lane] * b } else { a }
}
