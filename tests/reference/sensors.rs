//! Sensors for tests.

use echocast::Sensor;
use echocast::emitter::{BeamTable, FiringOrder};
use glam::DVec3;

/// One row of beams along `directions` (sensor frame), all at time 0.
pub fn beams(directions: &[DVec3]) -> BeamTable {
    let column = |axis: usize| directions.iter().map(|d| d.normalize()[axis] as f32).collect::<Vec<f32>>();
    let mut table = BeamTable::default();
    (table.rows, table.columns) = (1, directions.len() as u32);
    (table.firing_order, table.period) = (FiringOrder::Beams, 1.0);
    [table.dir_x, table.dir_y, table.dir_z] = [0, 1, 2].map(column);
    table.time = vec![0.0; directions.len()];
    table.channel = vec![0; directions.len()];
    table
}

/// An ideal sensor with beams along `directions` (sensor frame).
pub fn sensor(directions: &[DVec3]) -> Sensor {
    Sensor::from_beams("test", beams(directions)).expect("unit directions")
}

/// Directions of a raster of `rows` x `columns` beams, `fov` rad wide and high, around x: neighbours are near.
pub fn raster(rows: usize, columns: usize, fov: f64) -> Vec<DVec3> {
    let angle = |index: usize, count: usize| fov * (index as f64 / (count - 1) as f64 - 0.5);
    let mut directions = Vec::with_capacity(rows * columns);
    for row in 0..rows {
        for column in 0..columns {
            let ((sin_az, cos_az), (sin_el, cos_el)) = (angle(column, columns).sin_cos(), angle(row, rows).sin_cos());
            directions.push(DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el));
        }
    }
    directions
}

/// A sensor with one beam along x; `sections` is the rest of its YAML.
pub fn one_beam(sections: &str) -> Sensor {
    let pattern = "name: one_beam\nkind: lidar\npattern: {type: pinhole, resolution: [1, 1], fov_deg: [1, 1]}\n";
    Sensor::from_yaml(&format!("{pattern}{sections}\n"), "").expect("a sound sensor")
}
