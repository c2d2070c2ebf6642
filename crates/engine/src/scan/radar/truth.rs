//! What the echoes of a frame are of: groups of paths with the same label and type.

use super::setup::{RadarMoment, RadarSetup};
use crate::echo::radar::RadarEchoes;
use crate::trace::Search;
use ::radar::TruthPaths;
use ground::lanes::MEDIUM;
use ground::path_type::PathType;
use std::collections::BTreeMap;

/// Paths of a frame in the order of their ranges, as the radar sees them.
pub(super) struct FrameTruth {
    /// Index of the echo.
    pub echo: Vec<u32>,
    range_cell: Vec<f32>,
    velocity_cell: Vec<f32>,
    direction: Vec<[f32; 3]>,
    power: Vec<f32>,
    pub group: Vec<u32>,
    /// Type of the paths of each group.
    pub types: Vec<PathType>,
}

impl FrameTruth {
    pub fn new(setup: &RadarSetup, moment: &RadarMoment, search: &Search, echoes: &RadarEchoes) -> FrameTruth {
        let (plan, axes) = (setup.plan, setup.plan.axes());
        let ranges = &echoes.paths.range;
        let cell = |index: usize| plan.range_of(ranges[index], echoes.paths.range_rate[index].into()) as f32;
        let cells: Vec<f32> = (0..ranges.len()).map(cell).collect();
        let mut echo: Vec<u32> = (0..ranges.len() as u32).collect();
        echo.sort_by(|&a, &b| cells[a as usize].total_cmp(&cells[b as usize]).then(a.cmp(&b)));
        let mut truth = FrameTruth {
            range_cell: echo.iter().map(|&index| cells[index as usize]).collect(),
            velocity_cell: Vec::with_capacity(echo.len()),
            direction: Vec::with_capacity(echo.len()),
            power: Vec::with_capacity(echo.len()),
            group: Vec::with_capacity(echo.len()),
            types: Vec::new(),
            echo,
        };
        let mut groups: BTreeMap<(u32, u32, PathType), u32> = BTreeMap::new();
        let rows = &setup.scene.0.surfaces.rows;
        for &index in &truth.echo {
            let at = index as usize;
            let kind = path_type(setup, moment, (search, echoes), at);
            // An instance with all its parts; what has no instance, by row.
            let key = match rows.get(echoes.row[at] as usize) {
                Some(row) if row.instance_id != 0 => (row.instance_id, 0, kind),
                _ => (0, echoes.row[at].wrapping_add(1), kind),
            };
            let types = &mut truth.types;
            let group = *groups.entry(key).or_insert_with(|| {
                types.push(kind);
                types.len() as u32 - 1
            });
            let rate = f64::from(echoes.paths.range_rate[at]);
            let gain = plan.element_gain(&echoes.paths, at);
            truth.velocity_cell.push(axes.velocity.cells(rate) as f32);
            truth.direction.push(echoes.paths.rx_direction[at]);
            truth.power.push(echoes.paths.amplitude[at].norm_sqr() * gain * gain);
            truth.group.push(group);
        }
        truth
    }

    /// As detectors take them.
    pub fn paths(&self) -> TruthPaths<'_> {
        TruthPaths {
            range_cell: &self.range_cell,
            velocity_cell: &self.velocity_cell,
            direction: &self.direction,
            power: &self.power,
            group: &self.group,
        }
    }

    /// Radar cross-section, dBsm, of what the path number `path` is of: the sum of the amplitudes of all paths of its group
    /// within a cell.
    pub fn cross_section_db(&self, echoes: &RadarEchoes, path: usize, scale: f64) -> f32 {
        let [range, rate] = [self.range_cell[path], self.velocity_cell[path]];
        let first = self.range_cell.partition_point(|&cell| cell < range - 1.0);
        let near = (first..self.range_cell.len()).take_while(|&at| self.range_cell[at] <= range + 1.0);
        let of_group =
            near.filter(|&at| self.group[at] == self.group[path] && (self.velocity_cell[at] - rate).abs() <= 1.0);
        let sum: num_complex::Complex32 = of_group.map(|at| echoes.paths.amplitude[self.echo[at] as usize]).sum();
        let distance = echoes.paths.range[self.echo[path] as usize];
        let strength = f64::from(sum.norm()) / scale;
        (10.0 * (4.0 * std::f64::consts::PI * (strength * distance * distance).powi(2)).log10()) as f32
    }
}

/// The type of the path of echo `at`.
fn path_type(
    setup: &RadarSetup,
    moment: &RadarMoment,
    (search, echoes): (&Search, &RadarEchoes),
    at: usize,
) -> PathType {
    /// Cosine of the tilt of grounds.
    const LEVEL: f64 = 0.8;
    let row = echoes.row[at];
    let Some(target) = search.targets.get(echoes.target[at] as usize).filter(|_| row != MEDIUM) else {
        return PathType::Direct;
    };
    let Some(own) = setup.scene.0.surfaces.rows.get(row as usize).map(|row| row.object) else {
        return PathType::Direct;
    };
    let mirrors = || target.mirrors.iter().map(|&mirror| &search.mirrors[mirror]);
    let place = moment.pose.position - setup.scene.origin();
    if target.mirrors.is_empty() {
        PathType::Direct
    } else if mirrors().all(|mirror| mirror.object == own) {
        PathType::Internal
    } else if mirrors().any(|mirror| mirror.normal.z.abs() < LEVEL || mirror.point.z > place.z) {
        PathType::Wall
    } else {
        PathType::Ground
    }
}
