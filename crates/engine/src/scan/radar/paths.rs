//! All paths of waves from a radar to the surfaces of a scene and back.

use crate::echo::radar::{
    CentreGrid, CentreMemory, ClutterGrid, ClutterMemory, FacetMemory, RadarEchoes, WaveField, scatter_from_facets,
    scatter_from_rough,
};
use crate::trace::{IsPane, Search, SearchLimits, Sight, Sightlines};
use glam::{DVec3, Vec3};
use ground::parallel;
use std::f64::consts::PI;

/// What is traced.
pub(super) struct FrameLimits {
    /// Scene time, s.
    pub time: f64,
    pub mask: u32,
    /// Most mirrors on the way to a surface.
    pub mirrors: usize,
    /// Range resolution, m.
    pub resolution: f64,
    /// Echoes that are joined.
    pub centres: CentreGrid,
    /// How fine clutter is; `None`: there is none.
    pub clutter: Option<ClutterGrid>,
}

/// Echoes of a frame, and where they come from.
#[derive(Default)]
pub(super) struct FramePaths {
    pub search: Search,
    pub echoes: RadarEchoes,
    memory: Vec<TaskMemory>,
    parts: Vec<RadarEchoes>,
}

#[derive(Default)]
struct TaskMemory {
    facets: FacetMemory,
    clutter: ClutterMemory,
    centres: CentreMemory,
}

impl FramePaths {
    /// Finds all of them.
    pub fn find(&mut self, field: &WaveField, limits: &FrameLimits) {
        let sight = Sight::of_shapes(limits.mask);
        let (scene, surfaces) = (field.scene, field.surfaces);
        let (directions, columns, step) = fan(field, field.sector);
        let mirrors = |row: u32| {
            // What reflects less than a thousandth of the power at all angles mirrors nothing.
            [1.0, 0.5, 0.1, 0.02].iter().any(|&cos| surfaces.mirrored(&scene.surfaces, row, cos) > 0.03)
        };
        let is_pane = |row: u32| surfaces.is_pane(&scene.surfaces, row);
        let rows = scene.radar_rows(limits.time, field.time, limits.mask);
        // What returns 20 dB more than a sphere of its size, `pi r^2`, at the middle of the field of view.
        let least = (field.noise() / (5.0 * field.scale() * field.gain_ahead())).powi(2);
        let searched = SearchLimits {
            least,
            looks: &|along, aside| field.looks(along, aside),
            start: field.place,
            directions: &directions,
            columns,
            step,
            reach: 2.0 * field.reach,
            wavelength: field.wavelength,
            most_mirrors: limits.mirrors,
            most_images: most_images(field),
            mirrors: &mirrors,
            passes: &is_pane,
            kept: &|mirrors, image, target| field.kept(mirrors, image, target),
            sight,
            time: field.time,
        };
        self.search = Search::new(scene, rows, &searched);
        let through = |row: u32, cos: f32| surfaces.through(&scene.surfaces, row, cos);
        let panes: Option<IsPane> = if surfaces.has_panes { Some(&is_pane) } else { None };
        let sightlines = Sightlines { scene, sight, time: field.time, panes: &through, is_pane: panes };
        let search = &self.search;
        self.parts.resize_with(search.targets.len(), RadarEchoes::default);
        let tasks = self.parts.iter_mut().enumerate();
        parallel::for_each_with(&mut self.memory, tasks, |memory: &mut TaskMemory, (number, echoes)| {
            echoes.clear();
            scatter_from_facets(
                field,
                &sightlines,
                search,
                number as u32,
                0.5 * limits.resolution,
                &mut memory.facets,
                echoes,
            );
            let direct = search.targets[number].mirrors.is_empty();
            if let Some(grid) = limits.clutter.filter(|_| direct) {
                scatter_from_rough(field, &sightlines, search, number as u32, grid, &mut memory.clutter, echoes);
            }
            limits.centres.join(echoes, &mut memory.centres);
        });
        self.echoes.clear();
        self.parts.iter().for_each(|part| self.echoes.append(part));
    }
}

/// Most images in mirrors: as many as a frame has in a third of a turn, and fewer in less.
fn most_images(field: &WaveField) -> usize {
    const MOST: f64 = 512.0;
    let [left, right] = field.sector[0];
    (MOST * ((right - left) / (2.0 * PI / 3.0)).min(1.0)).ceil() as usize
}

/// Directions over a sector of azimuths and elevations, world, row by row, how many there are in a row, and the angle between
/// them, rad.
fn fan(field: &WaveField, [azimuth, elevation]: [[f64; 2]; 2]) -> (Vec<Vec3>, usize, f64) {
    /// Rays, about.
    const RAYS: f64 = 16_384.0;
    /// Finer steps show no more, rad.
    const FINEST: f64 = 0.003;
    let [wide, high] = [azimuth, elevation].map(|[least, most]| most - least);
    let step = (wide * high / RAYS).sqrt().max(FINEST);
    let [columns, rows] = [wide, high].map(|extent| (extent / step).ceil().max(1.0));
    let at = |[least, most]: [f64; 2], index: f64, count: f64| least + (most - least) * (index + 0.5) / count;
    let mut directions = Vec::with_capacity((columns * rows) as usize);
    for row in 0..rows as usize {
        let (sin, cos) = at(elevation, row as f64, rows).sin_cos();
        for column in 0..columns as usize {
            let (left, ahead) = at(azimuth, column as f64, columns).sin_cos();
            let own = DVec3::new(ahead * cos, left * cos, sin);
            directions.push((field.axes * own).as_vec3());
        }
    }
    (directions, columns as usize, step)
}
