//! Polygons to triangles.

use glam::{DVec2, DVec3};
use std::collections::VecDeque;
use std::iter::successors;

/// Checks of corners and grid cells in one polygon, per corner, after which the polygon counts as crossing itself. A
/// star with 20,000 corners takes 360; polygons that take more pass the same few points over and over.
const CHECKS_PER_CORNER: usize = 4000;

/// Checks that all polygons of a file may take together, plus some for each corner in the file: a few seconds. Files of
/// many small polygons take fewer and never exhaust them.
const CHECKS: usize = 20_000_000;
const MORE_CHECKS_PER_CORNER: usize = 16;

/// [`triangulate`]'s budget for a file whose faces have `corners` corners.
pub(crate) fn check_budget(corners: usize) -> usize {
    CHECKS + MORE_CHECKS_PER_CORNER * corners
}

/// Splits the polygon with corners `points`, at least three, into triangles that keep its winding and passes their
/// corners (positions in `points`) to `add`. The polygon may be concave, may have collinear or repeated corners and
/// need not be exactly planar. Triangles without area can occur.
///
/// Returns false for a polygon that crosses itself or is folded so that it appears to: the triangles may then cover
/// more or less than intended. The same holds once `checks_left`, the file's budget, is used up.
pub(crate) fn triangulate(points: &[DVec3], checks_left: &mut usize, mut add: impl FnMut([usize; 3])) -> bool {
    match *points {
        [_, _, _] => {
            add([0, 1, 2]);
            return true;
        }
        [a, b, c, d] => {
            // A diagonal is inside if its two triangles face the same way; in a convex quad both are.
            let ac_is_inside = (b - a).cross(c - a).dot((c - a).cross(d - a)) > 0.0;
            let bd_may_be = (b - a).cross(d - a).dot((c - b).cross(d - b)) >= 0.0;
            if ac_is_inside || !bd_may_be {
                add([0, 1, 2]);
                add([0, 2, 3]);
            } else {
                add([0, 1, 3]);
                add([1, 2, 3]);
            }
            return ac_is_inside || bd_may_be;
        }
        _ => {}
    }
    // Twice the area vector (Newell's rule), relative to the first corner so that large coordinates keep their digits.
    let origin = points[0];
    let pairs = points.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin));
    let normal: DVec3 = pairs.clone().sum();
    // A fan is correct if all its triangles face the same way as the polygon: true for convex polygons, and others.
    if pairs.skip(1).all(|area| area.dot(normal) > 0.0) {
        for i in 1..points.len() - 1 {
            add([0, i, i + 1]);
        }
        return true;
    }
    // Projected along its main axis the polygon is planar and counter-clockwise; coordinates stay exact.
    let size = normal.abs();
    let (u, v, side) = if size.x >= size.y && size.x >= size.z {
        (DVec3::Y, DVec3::Z, normal.x)
    } else if size.y >= size.z {
        (DVec3::Z, DVec3::X, normal.y)
    } else {
        (DVec3::X, DVec3::Y, normal.z)
    };
    let (u, v) = if side < 0.0 { (v, u) } else { (u, v) };
    let plane: Vec<DVec2> = points.iter().map(|&p| DVec2::new((p - origin).dot(u), (p - origin).dot(v))).collect();
    let mut own_checks = (CHECKS_PER_CORNER * points.len()).min(*checks_left);
    *checks_left -= own_checks;
    let simple = clip_ears(&plane, &mut own_checks, add);
    *checks_left += own_checks;
    simple
}

/// Twice the signed area of a triangle, positive when counter-clockwise.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Cuts those corners off a counter-clockwise polygon whose triangle with both neighbours holds no other corner.
///
/// Cutting one affects only the two neighbours (every cut shrinks the polygon), so a queue of candidates sees at most
/// three times the corners; the grid makes each check short. See Eberly, "Triangulation by ear clipping" (Geometric
/// Tools, 2002), for the method.
fn clip_ears(points: &[DVec2], checks_left: &mut usize, mut add: impl FnMut([usize; 3])) -> bool {
    let count = points.len();
    let mut ring = Ring {
        points,
        before: (0..count).map(|i| (i + count - 1) % count).collect(),
        after: (0..count).map(|i| (i + 1) % count).collect(),
    };
    let mut grid = CornerGrid::new(points, (0..count).filter(|&i| ring.turn(i) <= 0.0));
    let mut candidates: VecDeque<usize> = (0..count).collect();
    let mut left = count;
    let mut left_at_refill = usize::MAX;
    let mut simple = true;
    let mut anchor = 0;
    while left > 3 {
        let (tip, forced) = match candidates.pop_front() {
            Some(tip) => (tip, false),
            // A corner on the edge of an ear blocks it and may have been removed as collinear: all get another check.
            None if left < left_at_refill && *checks_left > left => {
                (left_at_refill, *checks_left) = (left, *checks_left - left);
                candidates.extend(successors(Some(anchor), |&i| Some(ring.after[i])).take(left));
                continue;
            }
            // The polygon crosses itself: any convex corner has to do.
            None => {
                simple = false;
                let mut near = successors(Some(anchor), |&i| Some(ring.after[i])).take(64);
                (near.find(|&i| ring.turn(i) > 0.0).unwrap_or(anchor), true)
            }
        };
        if !ring.contains(tip) {
            continue;
        }
        let area = ring.turn(tip);
        let (a, c) = (ring.before[tip], ring.after[tip]);
        if area != 0.0 {
            if !forced && (area < 0.0 || grid.blocks(&ring, tip, checks_left)) {
                continue;
            }
            add([a, tip, c]);
        }
        ring.remove(tip);
        candidates.extend([a, c]);
        anchor = a;
        left -= 1;
    }
    let (a, c) = (ring.before[anchor], ring.after[anchor]);
    if ring.turn(anchor) != 0.0 {
        add([a, anchor, c]);
    }
    simple && *checks_left > 0
}

/// The remaining corners, linked in a ring.
struct Ring<'a> {
    points: &'a [DVec2],
    before: Vec<usize>,
    after: Vec<usize>,
}

impl Ring<'_> {
    fn contains(&self, i: usize) -> bool {
        self.before[i] != usize::MAX
    }

    fn remove(&mut self, i: usize) {
        let (a, c) = (self.before[i], self.after[i]);
        self.after[a] = c;
        self.before[c] = a;
        self.before[i] = usize::MAX;
    }

    /// [`turn`] at a remaining corner: positive where convex.
    fn turn(&self, i: usize) -> f64 {
        turn(self.points[self.before[i]], self.points[i], self.points[self.after[i]])
    }
}

/// The non-convex corners, sorted into about as many square cells: only they can lie in an ear.
struct CornerGrid {
    low: DVec2,
    cells_per_unit: DVec2,
    side: usize,
    cells: Vec<Vec<usize>>,
}

impl CornerGrid {
    fn new(points: &[DVec2], corners: impl Iterator<Item = usize> + Clone) -> Self {
        let side = (corners.clone().count() as f64).sqrt().ceil() as usize;
        let low = points.iter().copied().fold(DVec2::MAX, DVec2::min);
        let high = points.iter().copied().fold(DVec2::MIN, DVec2::max);
        let cells = vec![Vec::new(); side * side];
        let mut grid = CornerGrid { low, cells_per_unit: side as f64 / (high - low), side, cells };
        for i in corners {
            let (column, row) = grid.cell(points[i]);
            grid.cells[row * side + column].push(i);
        }
        grid
    }

    fn cell(&self, p: DVec2) -> (usize, usize) {
        // A float cast saturates and maps NaN (a polygon without width) to 0.
        let at = (p - self.low) * self.cells_per_unit;
        ((at.x as usize).min(self.side - 1), (at.y as usize).min(self.side - 1))
    }

    /// Whether a remaining, non-convex corner lies in the triangle that would be cut off at `tip`.
    ///
    /// Every check takes one from `checks_left`; once none are left nothing blocks, so that a polygon that passes the
    /// same few points a million times terminates too.
    fn blocks(&mut self, ring: &Ring, tip: usize, checks_left: &mut usize) -> bool {
        if self.side == 0 || *checks_left == 0 {
            return false;
        }
        let [a, b, c] = [ring.before[tip], tip, ring.after[tip]].map(|i| ring.points[i]);
        let (first, last) = (self.cell(a.min(b).min(c)), self.cell(a.max(b).max(c)));
        for row in first.1..=last.1 {
            for cell in &mut self.cells[row * self.side + first.0..=row * self.side + last.0] {
                let mut place = 0;
                while *checks_left > 0 && place < cell.len() {
                    *checks_left -= 1;
                    let i = cell[place];
                    // A corner that was cut off or became convex stays so.
                    if !ring.contains(i) || ring.turn(i) > 0.0 {
                        cell.swap_remove(place);
                        continue;
                    }
                    place += 1;
                    let p = ring.points[i];
                    // Bridges to holes pass the same point twice: a point that coincides with a corner is not inside.
                    let apart = p != a && p != b && p != c;
                    if apart && turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0 {
                        return true;
                    }
                }
                *checks_left = checks_left.saturating_sub(1);
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// Area vector of a polygon (Newell).
    fn area_vector(points: &[DVec3]) -> DVec3 {
        (1..points.len() - 1).map(|i| (points[i] - points[0]).cross(points[i + 1] - points[0])).sum::<DVec3>() / 2.0
    }

    /// Checks that the triangles have the polygon's winding and its total area: none overlap, none stick out.
    fn check(points: &[DVec3]) {
        let whole = area_vector(points);
        let (mut sum, mut absolute) = (0.0, 0.0);
        let simple = triangulate(points, &mut check_budget(points.len()), |corners| {
            let area = area_vector(&corners.map(|i| points[i]));
            sum += area.dot(whole.normalize());
            absolute += area.length();
        });
        assert!(simple);
        let tolerance = 1e-9 * whole.length();
        assert!((sum - whole.length()).abs() < tolerance, "{sum} {}", whole.length());
        assert!((absolute - whole.length()).abs() < tolerance, "{absolute} {}", whole.length());
    }

    fn flat(points: &[[f64; 2]]) -> Vec<DVec3> {
        points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect()
    }

    /// Checks the polygon as it is, rotated, and moved to survey coordinates, from every starting corner, in both
    /// windings.
    fn check_all_ways(points: &[DVec3]) {
        let turned = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
        let mut points = points.to_vec();
        for _ in 0..2 {
            for _ in 0..points.len().min(40) {
                points.rotate_left(1);
                check(&points);
                check(&points.iter().map(|&p| turned * p).collect::<Vec<_>>());
                check(&points.iter().map(|&p| DVec3::new(p.z + 4096.0, p.x, -p.y)).collect::<Vec<_>>());
            }
            points.reverse();
        }
    }

    #[test]
    fn quads_are_split_along_the_inner_diagonal() {
        check_all_ways(&flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]));
        // An arrow head: only one diagonal lies inside.
        check_all_ways(&flat(&[[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]]));
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        let l = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        check_all_ways(&flat(&l));
        // Collinear and repeated corners.
        let u = [
            [0., 0.],
            [1., 0.],
            [3., 0.],
            [3., 2.],
            [2., 2.],
            [2., 1.],
            [2., 1.],
            [1., 1.],
            [1., 1.5],
            [1., 2.],
            [0., 2.],
        ];
        check_all_ways(&flat(&u));
        // A square with a square hole, reached over a bridge and back.
        let hole = [[0., 0.], [4., 0.], [4., 4.], [0., 4.], [0., 0.], [1., 1.], [1., 3.], [3., 3.], [3., 1.], [1., 1.]];
        check_all_ways(&flat(&hole));
    }

    #[test]
    fn long_polygons_are_fast_and_right() {
        // A star with 20,000 corners, a comb with 20,000 and a spiral with 4,000.
        let star: Vec<DVec3> = (0..20_000)
            .map(|i| DVec2::from_angle(i as f64 / 20_000.0 * TAU) * if i % 2 == 0 { 1.0 } else { 0.5 })
            .map(|p| p.extend(0.0))
            .collect();
        check(&star);
        let mut comb: Vec<DVec3> =
            (0..20_000).map(|i| DVec3::new(f64::from(i / 2), if i % 4 < 2 { 1.0 } else { 100.0 }, 0.0)).collect();
        comb.extend([DVec3::new(10_000.0, 0.0, 0.0), DVec3::ZERO]);
        comb.reverse();
        check(&comb);
        let arm = |i: u32, r: f64| (DVec2::from_angle(f64::from(i) * 0.05) * (f64::from(i) * 0.01 + r)).extend(0.0);
        let spiral: Vec<DVec3> = (0..2000).map(|i| arm(i, 1.5)).chain((0..2000).rev().map(|i| arm(i, 1.0))).collect();
        check(&spiral);
    }

    #[test]
    fn small_polygons_take_few_checks() {
        for corners in [6, 8, 12, 16] {
            let step = TAU / f64::from(corners);
            let radius = |i: u32| if i.is_multiple_of(2) { 1.0 } else { 0.4 };
            let star: Vec<DVec3> =
                (0..corners).map(|i| (DVec2::from_angle(f64::from(i) * step) * radius(i)).extend(0.0)).collect();
            let mut checks_left = check_budget(star.len());
            assert!(triangulate(&star, &mut checks_left, |_| ()));
            let taken = check_budget(star.len()) - checks_left;
            assert!(taken <= MORE_CHECKS_PER_CORNER * star.len(), "{taken} for {corners} corners");
        }
    }

    #[test]
    fn tangled_polygons_terminate() {
        let bow = flat(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        assert!(!triangulate(&bow, &mut check_budget(4), |_| {}));
        let line: Vec<DVec3> = (0..1000).map(|i| DVec3::X * f64::from(i % 7)).collect();
        triangulate(&line, &mut check_budget(1000), |_| {});
        // A million corners at nine points, or at a million, in an almost non-repeating order.
        let scatter = |i: u64| i.wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(17) as f64;
        for different in [9.0, 1e6] {
            let angle = |i: u64| scatter(i) % different * (9.0 / different);
            let tangle: Vec<DVec3> = (0..1_000_000).map(|i| DVec2::from_angle(angle(i)).extend(0.0)).collect();
            let (mut count, mut checks_left) = (0, check_budget(tangle.len()));
            assert!(!triangulate(&tangle, &mut checks_left, |_| count += 1));
            assert!(count <= tangle.len() - 2);
            // No budget is left for a second one.
            assert_eq!(checks_left, 0);
            assert!(!triangulate(&tangle, &mut checks_left, |_| ()));
        }
    }

    proptest! {
        #[test]
        fn stars_keep_their_area(radii in prop::collection::vec(0.05..1.0f64, 5..80)) {
            let step = TAU / radii.len() as f64;
            let points: Vec<DVec3> =
                radii.iter().enumerate().map(|(i, &r)| (DVec2::from_angle(i as f64 * step) * r).extend(0.0)).collect();
            check(&points);
        }

        #[test]
        fn any_points_terminate(points in prop::collection::vec((0..4i32, 0..4i32), 3..40)) {
            let points: Vec<DVec3> = points.iter().map(|&(x, y)| DVec3::new(f64::from(x), f64::from(y), 0.0)).collect();
            let mut count = 0;
            triangulate(&points, &mut check_budget(points.len()), |corners| {
                count += 1;
                assert!(corners.iter().all(|&i| i < points.len()));
            });
            prop_assert!(count <= points.len() - 2);
        }
    }
}
