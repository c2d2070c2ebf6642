//! Road, kerbs, pavements and markings.

use super::model::{Made, Model};
use super::plan::{CORNER, FRONT, HALF_ROAD, KERB, LANE, Plan, SIDE_FRONT, SIDE_HALF_ROAD};
use crate::generate::glb::Placement;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Width of a kerbstone, and how far pavements reach below the houses.
const KERBSTONE: f64 = 0.15;
const BELOW: f64 = 0.2;
/// Of the paint of markings.
const THICKNESS: f64 = 0.003;

pub(super) fn add(made: &mut Made, plan: &Plan) {
    let mut road = Model::default();
    let (end, side_end) = (plan.end, plan.side_end);
    let (inner, outer) = (FRONT + BELOW, SIDE_FRONT + BELOW);
    flat(&mut road, "asphalt_dry", [-end, -inner], [end, inner], 0.0);
    flat(&mut road, "asphalt_dry", [-outer, inner], [outer, side_end], 0.0);
    flat(&mut road, "asphalt_dry", [-outer, -side_end], [outer, -inner], 0.0);
    markings(&mut road, plan);
    let mesh = made.mesh("Road", &road);
    made.put("Road", "road", mesh, Placement::HERE);

    for (number, [right, left]) in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].into_iter().enumerate() {
        let mut pavement = Model::default();
        corner(&mut pavement, plan, |x, y, z| DVec3::new(right * x, left * y, z), right * left < 0.0);
        let mesh = made.mesh(&format!("Pavement_{}", number + 1), &pavement);
        made.put(&format!("Pavement_{}", number + 1), "pavement", mesh, Placement::HERE);
    }
}

/// The kerb and pavement of the quarter in which x and y are positive, for `place` to move to another; a mirror image
/// has its triangles the other way round.
fn corner(model: &mut Model, plan: &Plan, place: impl Fn(f64, f64, f64) -> DVec3, mirrored: bool) {
    /// Pieces of the rounded corner.
    const PIECES: usize = 12;
    let (end, side_end) = (plan.end, plan.side_end);
    let middle = DVec2::new(SIDE_HALF_ROAD, HALF_ROAD) + CORNER;
    let house = DVec2::new(SIDE_FRONT + BELOW, FRONT + BELOW);
    // Along the main street towards the crossing and round the corner: places of the kerb, of its inner edge, and of
    // the end of the pavement.
    let mut line = vec![[DVec2::new(end, HALF_ROAD), DVec2::new(end, HALF_ROAD + KERBSTONE), DVec2::new(end, house.y)]];
    for piece in 0..=PIECES {
        let (sin, cos) = (piece as f64 / PIECES as f64 * FRAC_PI_2).sin_cos();
        let out = -DVec2::new(sin, cos);
        line.push([middle + out * CORNER, middle + out * (CORNER - KERBSTONE), house]);
    }
    line[1][2].x = middle.x;
    let last = line.len() - 1;
    line[last][2].y = middle.y;
    let far = [SIDE_HALF_ROAD, SIDE_HALF_ROAD + KERBSTONE, house.x];
    line.push(far.map(|x| DVec2::new(x, side_end)));
    let mut face = |material, corners: [(DVec2, f64); 4]| {
        let mut corners: Vec<DVec3> = corners.iter().map(|&(at, z)| place(at.x, at.y, z)).collect();
        corners.dedup();
        if mirrored {
            corners.reverse();
        }
        model.polygon(material, &corners);
    };
    for pair in line.windows(2) {
        let [[kerb, stone, inner], [next_kerb, next_stone, next_inner]] = [pair[0], pair[1]];
        face("granite", [(next_kerb, 0.0), (kerb, 0.0), (kerb, KERB), (next_kerb, KERB)]);
        face("granite", [(next_kerb, KERB), (kerb, KERB), (stone, KERB), (next_stone, KERB)]);
        face("concrete", [(next_stone, KERB), (stone, KERB), (inner, KERB), (next_inner, KERB)]);
    }
    // The end faces, so that one cannot look under a pavement.
    face("concrete", [(line[0][0], 0.0), (line[0][2], 0.0), (line[0][2], KERB), (line[0][0], KERB)]);
    let [kerb, _, inner] = line[line.len() - 1];
    face("concrete", [(inner, 0.0), (kerb, 0.0), (kerb, KERB), (inner, KERB)]);
}

fn flat(model: &mut Model, material: &'static str, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], z: f64) {
    model.polygon(material, &[[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| DVec3::new(x, y, z)));
}

/// Middle lines, the edges of parking bays, zebra crossings and stop lines.
fn markings(road: &mut Model, plan: &Plan) {
    /// Half the width of a line, the length of a dash and from one to the next.
    const LINE: f64 = 0.06;
    const DASH: f64 = 3.0;
    const PERIOD: f64 = 6.0;
    let Plan { end, side_end, stop, side_stop, .. } = *plan;
    let mut paint = |[x0, x1]: [f64; 2], [y0, y1]: [f64; 2]| {
        flat(road, "white_paint", [x0.min(x1), y0.min(y1)], [x0.max(x1), y0.max(y1)], THICKNESS);
    };
    for side in [-1.0, 1.0] {
        let far = |near: f64, far: f64| [side * near, side * far];
        let dashes =
            |from: f64, to: f64| (0..((to - from - DASH) / PERIOD) as u32).map(move |i| from + PERIOD * f64::from(i));
        for x in dashes(stop + 1.0, end) {
            paint(far(x, x + DASH), [-LINE, LINE]);
        }
        for y in dashes(side_stop + 1.0, side_end) {
            paint([-LINE, LINE], far(y, y + DASH));
        }
        for edge in [-LANE, LANE] {
            paint(far(stop + 2.0, end - 1.0), [edge - LINE, edge + LINE]);
        }
        // Stop lines are before the crossing and on the right, seen from those who come to it.
        paint(far(stop, stop + 0.4), far(0.15, LANE));
        paint([-side * 0.15, -side * (SIDE_HALF_ROAD - 0.2)], far(side_stop, side_stop + 0.4));
        for stripe in -5..5 {
            let y = f64::from(stripe) + 0.25;
            paint(far(stop - 3.4, stop - 0.8), [y, y + 0.5]);
        }
        for stripe in -3..3 {
            let x = f64::from(stripe) + 0.25;
            paint([x, x + 0.5], far(side_stop - 3.2, side_stop - 0.6));
        }
    }
}
