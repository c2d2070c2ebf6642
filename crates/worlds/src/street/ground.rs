//! Roads, parking strips, kerbs, sidewalks, markings, and the gardens behind the houses.

use super::plan::{
    CORNER, Crossing, FRONT, HALF_ROAD, KERB, LANE, SIDE_FRONT, SIDE_HALF_ROAD, SIDE_STOP, STOP, StreetPlan,
};
use crate::glb::Placement;
use crate::model::{Made, Model};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Width of a kerbstone, and how far sidewalks reach below the houses.
const KERBSTONE: f64 = 0.15;
const BELOW: f64 = 0.2;
/// Thickness of the paint of markings.
const THICKNESS: f64 = 0.003;
/// Distance from the crossing at which parking begins, behind the stop line.
pub(super) const PARKING: f64 = STOP + 10.0;

pub(super) fn add(made: &mut Made, plan: &StreetPlan) {
    for (number, crossing) in plan.crossings.iter().enumerate() {
        let place = Placement { at: crossing.place(0.0, 0.0, 0.0), ..Placement::HERE };
        for (kind, category, model) in [
            ("Road", "road", road(crossing)),
            ("Parking", "parking", parking(crossing)),
            ("Markings", "lane-marking", markings(crossing)),
        ] {
            let name = if plan.is_town { format!("{kind}_{}", number + 1) } else { kind.to_owned() };
            let mesh = made.mesh(&name, &model);
            made.put(&name, category, mesh, place);
        }
        for (number, [right, left]) in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].into_iter().enumerate() {
            let reach = [crossing.reach(0, right), crossing.reach(1, left)];
            let (mut sidewalk, mut garden) = (Model::default(), Model::default());
            corner(&mut sidewalk, reach, |x, y, z| DVec3::new(right * x, left * y, z), right * left < 0.0);
            let [x, y] =
                [[SIDE_FRONT + BELOW, reach[0]].map(|x| right * x), [FRONT + BELOW, reach[1]].map(|y| left * y)];
            flat(&mut garden, "grass", [x[0].min(x[1]), y[0].min(y[1])], [x[0].max(x[1]), y[0].max(y[1])], KERB);
            for (kind, category, model) in [("Sidewalk", "sidewalk", sidewalk), ("Garden", "terrain", garden)] {
                let name = crossing.name(kind, number + 1);
                let mesh = made.mesh(&name, &model);
                made.put(&name, category, mesh, place);
            }
        }
    }
}

/// The carriageways, without the parking strips beside them.
fn road(crossing: &Crossing) -> Model {
    let mut road = Model::default();
    let mut piece = |low, high| flat(&mut road, "asphalt_dry", low, high, 0.0);
    let [[west, east], [south, north]] = crossing.reach;
    let (inner, outer) = (FRONT + BELOW, SIDE_FRONT + BELOW);
    piece([-PARKING, -inner], [PARKING, inner]);
    piece([-west, -LANE], [-PARKING, LANE]);
    piece([PARKING, -LANE], [east, LANE]);
    piece([-outer, inner], [outer, north]);
    piece([-outer, -south], [outer, -inner]);
    road
}

fn parking(crossing: &Crossing) -> Model {
    let mut parking = Model::default();
    let [[west, east], _] = crossing.reach;
    for [low, high] in [[-west, -PARKING], [PARKING, east]] {
        flat(&mut parking, "asphalt_dry", [low, LANE], [high, FRONT + BELOW], 0.0);
        flat(&mut parking, "asphalt_dry", [low, -FRONT - BELOW], [high, -LANE], 0.0);
    }
    parking
}

/// The kerb and sidewalk of the quadrant in which x and y are positive, as far as the crossing reaches; `place` maps it
/// to another quadrant. A mirror image has its triangles the other way round.
fn corner(model: &mut Model, reach: [f64; 2], place: impl Fn(f64, f64, f64) -> DVec3, mirrored: bool) {
    /// Segments of the rounded corner.
    const PIECES: usize = 12;
    let [end, side_end] = reach;
    let middle = DVec2::new(SIDE_HALF_ROAD, HALF_ROAD) + CORNER;
    let house = DVec2::new(SIDE_FRONT + BELOW, FRONT + BELOW);
    // Along the main street towards the crossing and round the corner: points of the kerb, of its inner edge, and of
    // the far edge of the sidewalk.
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
    // The end faces, so that no ray passes under a sidewalk.
    face("concrete", [(line[0][0], 0.0), (line[0][2], 0.0), (line[0][2], KERB), (line[0][0], KERB)]);
    let [kerb, _, inner] = line[line.len() - 1];
    face("concrete", [(inner, 0.0), (kerb, 0.0), (kerb, KERB), (inner, KERB)]);
}

fn flat(model: &mut Model, material: &'static str, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], z: f64) {
    model.polygon(material, &[[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| DVec3::new(x, y, z)));
}

/// Centre lines, the edges of the parking strips, zebra crossings and stop lines.
fn markings(crossing: &Crossing) -> Model {
    /// Half the width of a line, the length of a dash, and the distance from one dash to the next.
    const LINE: f64 = 0.06;
    const DASH: f64 = 3.0;
    const PERIOD: f64 = 6.0;
    let mut lines = Model::default();
    let mut paint = |[x0, x1]: [f64; 2], [y0, y1]: [f64; 2]| {
        flat(&mut lines, "lane_marking", [x0.min(x1), y0.min(y1)], [x0.max(x1), y0.max(y1)], THICKNESS);
    };
    for side in [-1.0, 1.0] {
        let [end, side_end] = [crossing.reach(0, side), crossing.reach(1, side)];
        let far = |near: f64, far: f64| [side * near, side * far];
        let dashes =
            |from: f64, to: f64| (0..((to - from - DASH) / PERIOD) as u32).map(move |i| from + PERIOD * f64::from(i));
        for x in dashes(STOP + 1.0, end) {
            paint(far(x, x + DASH), [-LINE, LINE]);
        }
        for y in dashes(SIDE_STOP + 1.0, side_end) {
            paint([-LINE, LINE], far(y, y + DASH));
        }
        for edge in [-LANE, LANE] {
            paint(far(STOP + 2.0, end - 1.0), [edge - LINE, edge + LINE]);
        }
        // Stop lines are before the crossing and on the right, as seen by approaching traffic.
        paint(far(STOP, STOP + 0.4), far(0.15, LANE));
        paint([-side * 0.15, -side * (SIDE_HALF_ROAD - 0.2)], far(SIDE_STOP, SIDE_STOP + 0.4));
        for stripe in -5..5 {
            let y = f64::from(stripe) + 0.25;
            paint(far(STOP - 3.4, STOP - 0.8), [y, y + 0.5]);
        }
        for stripe in -3..3 {
            let x = f64::from(stripe) + 0.25;
            paint([x, x + 0.5], far(SIDE_STOP - 3.2, SIDE_STOP - 0.6));
        }
    }
    lines
}
