//! Boxes around instances, as lines over the points.

use super::canvas::{Color, GROUND, Picture};
use super::{Page, palette};
use cloud::{InstanceBox, PointCloud};
use glam::{Vec2, Vec3};

/// The edges of a box.
pub(super) struct BoxEdges {
    edges: [[Vec3; 2]; 12],
    color: Color,
}

/// The boxes of `cloud` that have points, relative to its origin, in the colours of their categories.
pub(super) fn outlines(cloud: &PointCloud) -> Vec<BoxEdges> {
    let seen = cloud.boxes.iter().flatten().filter(|found| found.points > 0);
    let outline = |found: &InstanceBox| {
        let corners = found.corners().map(|corner| (corner - cloud.origin).as_vec3());
        let edges = InstanceBox::EDGES.map(|ends| ends.map(|end| corners[end]));
        BoxEdges { edges, color: palette::category(found.category_id) }
    };
    seen.map(outline).filter(|outline| outline.edges.as_flattened().iter().all(|end| end.is_finite())).collect()
}

/// Draws `outlines`; `lines` projects an edge into the picture.
pub(super) fn draw<I: IntoIterator<Item = [Vec2; 2]>>(
    picture: &mut Picture,
    outlines: &[BoxEdges],
    page: &Page,
    lines: impl Fn([Vec3; 2]) -> I,
) {
    for BoxEdges { edges, color } in outlines {
        let lines: Vec<[Vec2; 2]> = edges.iter().flat_map(|&edge| lines(edge)).collect();
        // The box may be surrounded by points of the same colour.
        let radius = (0.8 * page.scale).max(0.75);
        for (radius, color) in [(radius + 1.1 * page.scale, GROUND), (radius, *color)] {
            lines.iter().for_each(|line| picture.line(line, radius, color));
        }
    }
}

/// An edge in pieces, each straight enough for pictures in which the edge is curved: their ends projected by `project`,
/// without pieces whose ends have no projection or that reach across half of `width` pixels.
pub(super) fn bent(edge: [Vec3; 2], width: f32, project: impl Fn(Vec3) -> Option<Vec2>) -> Vec<[Vec2; 2]> {
    const PIECES: usize = 48;
    let ends: Vec<Option<Vec2>> =
        (0..=PIECES).map(|k| project(edge[0].lerp(edge[1], k as f32 / PIECES as f32))).collect();
    let pieces = ends.windows(2).filter_map(|ends| Some([ends[0]?, ends[1]?]));
    pieces.filter(|[a, b]| (a.x - b.x).abs() < 0.5 * width).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{PreviewOptions, View, render};
    use super::*;
    use glam::DVec3;
    use ground::pose::Pose;
    use ground::report::Report;

    /// A cube of 1 m at the origin, category 3.
    pub(in super::super) fn unit_box() -> InstanceBox {
        InstanceBox::default()
            .frame(0)
            .time(0.0)
            .track_id(5)
            .instance_id(5)
            .category_id(3)
            .pose(Pose::IDENTITY)
            .size(DVec3::ONE)
            .velocity(DVec3::ZERO)
            .points(1)
            .visible(1.0)
    }

    /// A wall of points of category 1 and a box in front of it, far from the world's origin.
    fn scene(organised: bool) -> PointCloud {
        let (rows, columns) = (40, 60);
        let origin = DVec3::new(5e5, 5.6e6, 100.0);
        let mut cloud = PointCloud { origin, len: rows * columns, ..PointCloud::default() };
        cloud.sensor_pose.position = origin;
        for row in 0..rows {
            for column in 0..columns {
                cloud.columns.x.push(10.0);
                cloud.columns.y.push(6.0 - 0.2 * column as f32);
                cloud.columns.z.push(4.0 - 0.2 * row as f32);
            }
        }
        cloud.columns.category_id = vec![1; cloud.len];
        cloud.organised = organised.then_some([rows as u32, columns as u32]);
        let pose = Pose { position: origin + DVec3::new(8.0, 1.0, 1.0), ..Pose::IDENTITY };
        let seen = unit_box().pose(pose).size(DVec3::new(0.5, 2.0, 1.5));
        let without_points = seen.points(0).category_id(2);
        cloud.boxes = Some(vec![without_points, seen]);
        cloud
    }

    #[test]
    fn boxes_with_points_are_drawn_in_every_view() {
        for (view, organised) in
            [(View::Top, false), (View::Perspective, false), (View::Range, false), (View::Range, true)]
        {
            let cloud = scene(organised);
            let drawn = |boxes: bool| {
                let options = PreviewOptions { view, boxes, width: 800, ..PreviewOptions::default() };
                render(&cloud, &options, &mut Report::default()).unwrap()
            };
            let [with, without] = [drawn(true), drawn(false)];
            let lit = |picture: &Picture, id: u32| {
                picture.pixels.chunks_exact(3).filter(|pixel| *pixel == palette::category(id)).count()
            };
            // Lines are soft where they are between pixels.
            assert!(lit(&with, 3) > 20 && lit(&without, 3) == 0, "{view:?}: {}", lit(&with, 3));
            assert_eq!(lit(&with, 2), 0);
        }
        let mut report = Report::default();
        let options = PreviewOptions { boxes: true, ..PreviewOptions::default() };
        render(&PointCloud { boxes: None, ..scene(false) }, &options, &mut report).unwrap();
        assert!(report.warnings[0].contains("has no boxes"), "{report:?}");
    }

    /// The front face of the box above is at 7.75 m: its corners are where a wall there would have points.
    #[test]
    fn corners_lie_where_the_range_image_has_their_directions() {
        let mut cloud = scene(true);
        cloud.boxes.as_mut().unwrap().remove(0);
        let face = |cloud: &PointCloud| {
            let options = PreviewOptions { view: View::Range, boxes: true, width: 800, ..PreviewOptions::default() };
            let picture = render(cloud, &options, &mut Report::default()).unwrap();
            let lit = |x: u32, y: u32| picture.pixel(x, y) == palette::category(3);
            let page = Page::new(800);
            let panel = page.panel_top()..picture.height - 40;
            let all: Vec<[u32; 2]> =
                panel.flat_map(|y| (0..800).map(move |x| [x, y])).filter(|&[x, y]| lit(x, y)).collect();
            let ends = |axis: usize| {
                let values = || all.iter().map(|at| at[axis]);
                [values().min().unwrap(), values().max().unwrap()]
            };
            [ends(0), ends(1)]
        };
        // The front corners are drawn, in another colour, at the rows and columns in which the sensor sees the wall
        // behind them.
        let [across, down] = face(&cloud);
        let (rows, columns) = (40.0, 60.0);
        let part = |y: f64, z: f64| [(6.1 - y * 10.0 / 7.75) / 0.2 / columns, (4.1 - z * 10.0 / 7.75) / 0.2 / rows];
        let page = Page::new(800);
        let height = 0.62 * f64::from(page.inner());
        let width = height * columns / rows;
        let left = (800.0 - width) / 2.0;
        let top = f64::from(page.panel_top());
        let ([x0, y0], [x1, y1]) = (part(2.0, 1.75), part(0.0, 0.25));
        let expected = [[left + x0 * width, left + x1 * width], [top + y0 * height, top + y1 * height]];
        for (found, expected) in [across, down].as_flattened().iter().zip(expected.as_flattened()) {
            assert!((f64::from(*found) - expected).abs() < 4.0, "{across:?} {down:?} {expected:?}");
        }
    }
}
