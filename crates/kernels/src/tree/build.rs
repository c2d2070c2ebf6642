//! Which triangles go into which box: splits that make hits least likely, by the surface area heuristic over bins
//! (Wald 2007, "On fast construction of SAH-based bounding volume hierarchies").

use super::{CHILDREN, NODE, Tree, TreeNode, greatest, least};

/// Most triangles of a leaf.
const LEAF: usize = 8;

/// Runs of no more triangles become one node. Fewer would make more boxes, which take time to fit; more, leaves of too
/// many triangles.
const BOTTOM: usize = 100;

/// Bins along each axis.
const BINS: usize = 16;

/// Nodes below this depth split in halves, whose number is then limited: see [`MOST_DEPTH`].
const DEPTH: usize = 12;

/// Greatest number of nodes above each other: halves of halves of halves of halves of 2^32 triangles, eight times.
pub const MOST_DEPTH: usize = DEPTH + 8;

/// Coordinates beyond it are not distinguished, so that the area of a box is finite.
const FAR: f32 = 1e15;

/// A triangle of the mesh at rest.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    triangle: u32,
}

#[derive(Clone, Copy)]
struct Aabb {
    lower: [f32; 3],
    upper: [f32; 3],
}

impl Aabb {
    const NONE: Aabb = Aabb { lower: [f32::INFINITY; 3], upper: [f32::NEG_INFINITY; 3] };

    fn around(self, other: &Aabb) -> Aabb {
        let mut both = self;
        for axis in 0..3 {
            both.lower[axis] = least(other.lower[axis], both.lower[axis]);
            both.upper[axis] = greatest(other.upper[axis], both.upper[axis]);
        }
        both
    }

    /// Half the surface.
    fn area(&self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.upper[axis] - self.lower[axis]);
        x * y + y * z + z * x
    }

    /// Twice the coordinates of the centre.
    fn centre(&self) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.lower[axis] + self.upper[axis])
    }
}

/// A run of items that is to be a child.
#[derive(Clone, Copy)]
struct ItemRun {
    first: usize,
    end: usize,
    area: f32,
}

impl ItemRun {
    fn len(&self) -> usize {
        self.end - self.first
    }
}

impl Tree {
    /// Sorts the triangles of a mesh at rest. Those that refer to a missing vertex are omitted.
    pub fn new(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Tree {
        let mut items = Vec::with_capacity(triangles.len());
        let mut all = Aabb::NONE;
        let mut vertices = 0;
        for (triangle, corners) in (0..u32::MAX).zip(triangles) {
            let [Some(a), Some(b), Some(c)] = corners.map(|corner| positions.get(corner as usize)) else { continue };
            let mut bounds = Aabb::NONE;
            for corner in [a, b, c] {
                // NaN is beyond all numbers.
                let place = corner.map(|at| if at.abs() < FAR { at } else { FAR.copysign(at) });
                bounds = bounds.around(&Aabb { lower: place, upper: place });
            }
            all = all.around(&bounds);
            items.push(Item { bounds, triangle });
            vertices = corners.iter().fold(vertices, |most, &corner| most.max(corner as usize + 1));
        }
        let size = (0..3).map(|axis| all.upper[axis] - all.lower[axis]).sum::<f32>().max(0.0);
        let (nodes, corners) = (Vec::new(), Vec::new());
        let mut tree = Tree { nodes, triangles: Vec::with_capacity(items.len()), corners, vertices, size };
        // Runs that become nodes, with the child of a node that each is, and their depth.
        let mut open = Vec::new();
        if !items.is_empty() {
            open.push((ItemRun { first: 0, end: items.len(), area: 0.0 }, None, 0));
        }
        while let Some((run, parent, depth)) = open.pop() {
            let (mut children, count) = divide(&mut items, run, depth >= DEPTH);
            let index = tree.nodes.len();
            if let Some((node, child)) = parent {
                let node: &mut TreeNode = &mut tree.nodes[node];
                node.first[child] = index as u32;
            }
            // Similar children are next to each other, which helps branch prediction.
            children[..count].sort_by_key(|run| (run.len() > LEAF, usize::MAX - run.len()));
            let first_corner = tree.corners.len() as u32;
            let mut node =
                TreeNode { first: [0; CHILDREN], count: [0; CHILDREN], first_corner, corners: [0; CHILDREN] };
            for (child, run) in children[..count].iter().enumerate() {
                if run.len() > LEAF {
                    node.count[child] = NODE;
                    open.push((*run, Some((index, child)), depth + 1));
                    continue;
                }
                (node.first[child], node.count[child]) = (tree.triangles.len() as u32, run.len() as u8);
                for item in &items[run.first..run.end] {
                    let [a, b, c] = triangles[item.triangle as usize];
                    tree.triangles.push([a, b, c, item.triangle]);
                    for corner in [a, b, c] {
                        let known = tree.corners.len() - usize::from(node.corners[child]);
                        if !tree.corners[known..].contains(&corner) {
                            tree.corners.push(corner);
                            node.corners[child] += 1;
                        }
                    }
                }
            }
            tree.nodes.push(node);
        }
        tree
    }
}

/// Splits `run` until there are enough children, always the one with the greatest area, or with `halves` the longest;
/// if it takes more than one node, until each child is small enough for one. Returns them and how many there are.
fn divide(items: &mut [Item], run: ItemRun, halves: bool) -> ([ItemRun; CHILDREN], usize) {
    let mut children = [run; CHILDREN];
    let mut count = 1;
    let most = if run.len() > BOTTOM { BOTTOM } else { LEAF };
    let is_small = |run: &ItemRun| run.len() <= most;
    while count < CHILDREN && !(most == BOTTOM && children[..count].iter().all(is_small)) {
        // Runs that are too large come first; single triangles are not split.
        let size = |run: &ItemRun| if halves { run.len() as f32 } else { run.area };
        let rank = |run: &ItemRun| (!is_small(run), if run.len() > 1 { size(run) } else { -1.0 });
        let by =
            |a: &&mut ItemRun, b: &&mut ItemRun| rank(a).partial_cmp(&rank(b)).unwrap_or(std::cmp::Ordering::Equal);
        let Some(largest) = children[..count].iter_mut().max_by(by).filter(|run| run.len() > 1) else { break };
        let [left, right] = split(items, *largest, halves);
        *largest = left;
        children[count] = right;
        count += 1;
    }
    (children, count)
}

/// Two parts of a run of at least two items, neither of them empty.
fn split(items: &mut [Item], run: ItemRun, halves: bool) -> [ItemRun; 2] {
    let items = &mut items[run.first..run.end];
    let mut middle = items.len() / 2;
    if let Some((axis, bin, scale, first)) = best(items).filter(|_| !halves) {
        // As in `best`.
        let is_left = |item: &Item| ((item.bounds.centre()[axis] - first) * scale) as usize <= bin;
        let (mut left, mut right) = (0, items.len());
        while left < right {
            if is_left(&items[left]) {
                left += 1;
            } else {
                right -= 1;
                items.swap(left, right);
            }
        }
        if left > 0 && left < items.len() {
            middle = left;
        }
    }
    let area = |items: &[Item]| items.iter().fold(Aabb::NONE, |all, item| all.around(&item.bounds)).area();
    let at = run.first + middle;
    let [left, right] = [&items[..middle], &items[middle..]].map(area);
    [ItemRun { first: run.first, end: at, area: left }, ItemRun { first: at, end: run.end, area: right }]
}

/// Axis, last bin on the left, bins per length and where they begin, of the split with the least cost; `None` if all
/// items are in one place.
fn best(items: &[Item]) -> Option<(usize, usize, f32, f32)> {
    let mut centres = Aabb::NONE;
    for item in items {
        let centre = item.bounds.centre();
        centres = centres.around(&Aabb { lower: centre, upper: centre });
    }
    let scale = [0, 1, 2].map(|axis| {
        // A little less, so that the last is in the last bin.
        let scale = BINS as f32 * (1.0 - 1e-6) / (centres.upper[axis] - centres.lower[axis]);
        if scale.is_finite() { scale } else { 0.0 }
    });
    let mut bins = [[(Aabb::NONE, 0u32); BINS]; 3];
    for item in items {
        let centre = item.bounds.centre();
        for axis in 0..3 {
            let bin = ((centre[axis] - centres.lower[axis]) * scale[axis]) as usize;
            let (bounds, count) = &mut bins[axis][bin.min(BINS - 1)];
            *bounds = bounds.around(&item.bounds);
            *count += 1;
        }
    }
    let mut found = None;
    let mut least = f32::INFINITY;
    for axis in 0..3 {
        if scale[axis] == 0.0 {
            continue;
        }
        let mut cost = [0.0; BINS];
        let (mut all, mut sum) = (Aabb::NONE, 0);
        for bin in (1..BINS).rev() {
            let (bounds, count) = &bins[axis][bin];
            (all, sum) = (all.around(bounds), sum + count);
            cost[bin - 1] = if sum > 0 { all.area() * sum as f32 } else { f32::INFINITY };
        }
        (all, sum) = (Aabb::NONE, 0);
        for bin in 0..BINS - 1 {
            let (bounds, count) = &bins[axis][bin];
            (all, sum) = (all.around(bounds), sum + count);
            let cost = cost[bin] + if sum > 0 { all.area() * sum as f32 } else { f32::INFINITY };
            if cost < least {
                least = cost;
                found = Some((axis, bin, scale[axis], centres.lower[axis]));
            }
        }
    }
    found
}
