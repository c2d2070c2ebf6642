//! The columns of a block's returns.

use super::block::Block;
use super::plan::ScanPlan;
use cloud::{Field, FieldSource, Frame, Kept, Slices};
use echocast_kernels::{aim, measure};
use glam::Vec3;
use ground::angle::azimuth_elevation;
use ground::lanes::LANES;
use std::f32::consts::PI;

/// What the columns of other kinds of sensors come from.
const OTHER_SOURCES: [FieldSource; 4] =
    [FieldSource::Sounding, FieldSource::BottomTrack, FieldSource::WaterTrack, FieldSource::Radar];

impl Block {
    /// Step 11: the requested columns, row by row.
    pub fn collect(&mut self, scan: &ScanPlan, count: usize, mut rows: Slices) -> usize {
        let filled = self.kept.choose(&self.hits.surface, count, scan.options.organised);
        rows.fill_absent(&OTHER_SOURCES, filled);
        self.put_truth(scan, count, &mut rows);
        self.put_measured(scan, count, &mut rows);
        self.put_surfaces(scan, &mut rows);
        if scan.options.fields.has_motion() {
            self.put_motion(scan, count, &mut rows);
        }
        self.put_beams(scan, count, &mut rows);
        self.put_survey(scan, count, &mut rows);
        filled
    }

    /// Positions without errors.
    fn put_truth(&mut self, scan: &ScanPlan, count: usize, rows: &mut Slices) {
        let to = [&mut *rows.true_x, &mut *rows.true_y, &mut *rows.true_z];
        if to.iter().all(|column| column.is_empty()) {
            return;
        }
        let (starts, mut along) = (self.lanes.starts(scan.aim.beams, count), [[0.0; LANES]; 3]);
        let is_in_world = scan.options.coordinates == Frame::World;
        if !is_in_world {
            along = self.lanes.directions(scan.aim.beams, count);
            // The true directions of the beams.
            for lane in (0..count).filter(|_| scan.points_elsewhere()) {
                let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, self.lanes.beam[lane] as usize);
                let direction = rotation.transpose() * self.rays.direction(lane);
                along.iter_mut().zip(direction.to_array()).for_each(|(axis, value)| axis[lane] = value);
            }
        }
        let Block { rays, hits, kept, scratch, .. } = self;
        let (from, along) = if is_in_world {
            (rays.origins(), rays.directions())
        } else {
            (starts.as_ref().map_or([&ZERO; 3], |starts| starts.each_ref()), along.each_ref())
        };
        put_positions(kept, &hits.surface, from, along, &hits.range, scratch, to);
    }

    /// Measured ranges, positions and intensities, and the normals there.
    fn put_measured(&mut self, scan: &ScanPlan, count: usize, rows: &mut Slices) {
        let is_in_world = scan.options.coordinates == Frame::World;
        let starts = self.lanes.starts(scan.aim.beams, count);
        let starts = starts.as_ref().map_or([&ZERO; 3], |starts| starts.each_ref());
        let Block { lanes, rays, hits, measured, intensity, surfaces, turn, kept, scratch, reported, .. } = self;
        let surface = &hits.surface;
        let reported = reported.as_deref().filter(|_| scan.points_elsewhere()).unwrap_or(rays);
        let mut directions;
        let (from, mut along) = if is_in_world {
            (reported.origins(), reported.directions())
        } else {
            directions = lanes.directions(scan.aim.beams, count);
            (starts, directions.each_ref())
        };
        if scan.measure.errors.turn_beams() {
            let mut up = Vec3::Z.to_array().map(|axis| [axis; LANES]);
            for lane in (0..count).filter(|_| is_in_world) {
                let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, lanes.beam[lane] as usize);
                up.iter_mut().zip(rotation.z_axis.to_array()).for_each(|(axis, value)| axis[lane] = value);
            }
            let mut turned = along.map(|axis| *axis);
            aim::turn(up.each_ref(), turn, turned.each_mut());
            directions = turned;
            along = directions.each_ref();
        }
        kept.put(surface, measured, rows.range);
        kept.put(surface, &hits.range, rows.true_range);
        kept.put(surface, intensity, rows.intensity);
        kept.put(surface, &surfaces.cos_incidence, rows.cos_incidence);
        if !rows.depth.is_empty() {
            measure::place(starts[0], &lanes.take(&scan.aim.beams.dir_x, count), measured, scratch);
            kept.put(surface, scratch, rows.depth);
        }
        let to = [&mut *rows.x, &mut *rows.y, &mut *rows.z];
        if scan.deskew.is_some() || scan.aim.estimated.is_some() {
            let mut places = [[0.0; LANES]; 3];
            for ((from, along), places) in from.into_iter().zip(along).zip(&mut places) {
                measure::place(from, along, measured, places);
            }
            if let Some(estimated) = scan.aim.estimated {
                self.georeference(scan, estimated, count, &mut places);
            }
            if let Some(deskew) = &scan.deskew {
                self.deskew(scan, deskew, count, &mut places);
            }
            for (axis, to) in places.iter().zip(to) {
                self.kept.put(&self.hits.surface, axis, to);
            }
        } else {
            put_positions(kept, surface, from, along, measured, scratch, to);
            if !is_in_world && rows.has(&[Field::NormalX, Field::NormalY, Field::NormalZ]) {
                self.turn_normals(scan, count);
            }
        }
        let Block { hits, kept, .. } = self;
        kept.put(&hits.surface, &hits.normal_x, rows.normal_x);
        kept.put(&hits.surface, &hits.normal_y, rows.normal_y);
        kept.put(&hits.surface, &hits.normal_z, rows.normal_z);
    }

    /// Turns the normals into the frame that the sensor has when each beam fires.
    fn turn_normals(&mut self, scan: &ScanPlan, count: usize) {
        let Block { lanes, hits, .. } = self;
        for lane in 0..count {
            let (rotation, _) = scan.aim.pose.pose(scan.aim.beams, lanes.beam[lane] as usize);
            let normal = rotation.transpose() * hits.normal(lane);
            (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = normal.into();
        }
    }

    /// Labels of the surfaces, and how their echoes came about.
    fn put_surfaces(&mut self, scan: &ScanPlan, rows: &mut Slices) {
        let Block { lanes, hits, surfaces, kept, cause, bounces, first_category, first_instance, .. } = self;
        let surface = &hits.surface;
        kept.put(surface, &surfaces.category_id, rows.category_id);
        kept.put(surface, &surfaces.part_id, rows.part_id);
        kept.put(surface, &surfaces.instance_id, rows.instance_id);
        kept.put(surface, &surfaces.instance_id, rows.track_id);
        kept.put(surface, &surfaces.material_id, rows.material_id);
        kept.put(surface, &surfaces.red, rows.red);
        kept.put(surface, &surfaces.green, rows.green);
        kept.put(surface, &surfaces.blue, rows.blue);
        kept.put(surface, &lanes.return_number, rows.return_number);
        kept.put(surface, &lanes.return_count, rows.return_count);
        kept.put(surface, cause, rows.cause);
        kept.put(surface, bounces, rows.bounces);
        if scan.world.paths.is_some() {
            kept.put(surface, first_category, rows.first_category_id);
            kept.put(surface, first_instance, rows.first_instance_id);
        } else {
            kept.put(surface, &surfaces.category_id, rows.first_category_id);
            kept.put(surface, &surfaces.instance_id, rows.first_instance_id);
        }
    }

    /// What is known of every beam, return or not.
    fn put_beams(&mut self, scan: &ScanPlan, count: usize, rows: &mut Slices) {
        let beams = scan.aim.beams;
        let Block { lanes, kept, turn, .. } = self;
        if !rows.channel.is_empty() || !rows.ring.is_empty() {
            let mut channel = lanes.take(&beams.channel, count);
            kept.put_beam(&channel, rows.channel);
            if !rows.ring.is_empty() {
                channel.iter_mut().for_each(|channel| *channel = scan.aim.rings[usize::from(*channel)]);
                kept.put_beam(&channel, rows.ring);
            }
        }
        if !rows.time.is_empty() {
            let mut time = lanes.take(&beams.time, count);
            let start = scan.options.start_time + scan.options.clock_offset;
            time.iter_mut().for_each(|time| *time += start);
            let firings = lanes.beam[..count].iter().map(|&beam| beams.firing(beam));
            scan.measure.errors.delay(&scan.rng, firings, &mut time);
            kept.put_beam(&time, rows.time);
        }
        if !rows.frame.is_empty() {
            kept.put_beam(&[scan.options.frame; LANES], rows.frame);
        }
        if !rows.beam.is_empty() || !rows.firing.is_empty() {
            let firing = lanes.beam.map(|beam| beams.firing(beam));
            kept.put_beam(&lanes.beam, rows.beam);
            kept.put_beam(&firing, rows.firing);
        }
        if !rows.azimuth.is_empty() || !rows.elevation.is_empty() {
            let [x, y, z] = lanes.directions(beams, count);
            let (mut azimuth, mut elevation) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..count {
                let [nominal, up] = azimuth_elevation([x[lane], y[lane], z[lane]]);
                elevation[lane] = up;
                let reported = nominal + turn[lane];
                // Straight back is -pi, whichever way it is rounded.
                azimuth[lane] = match reported {
                    PI.. => reported - 2.0 * PI,
                    _ if reported < -PI => reported + 2.0 * PI,
                    _ => reported,
                };
            }
            kept.put_beam(&azimuth, rows.azimuth);
            kept.put_beam(&elevation, rows.elevation);
        }
    }
}

/// Origin of rays in the sensor frame, where the table gives none.
static ZERO: [f32; LANES] = [0.0; LANES];

/// Writes the positions at `ranges` along rays from `from` in the directions `along`.
fn put_positions(
    kept: &Kept,
    surface: &[u32; LANES],
    from: [&[f32; LANES]; 3],
    along: [&[f32; LANES]; 3],
    ranges: &[f32; LANES],
    scratch: &mut [f32; LANES],
    to: [&mut [f32]; 3],
) {
    for ((from, along), to) in from.into_iter().zip(along).zip(to) {
        if to.is_empty() {
            continue;
        }
        if kept.are_first_lanes() {
            let rows = kept.rows();
            measure::place(&from[..rows], &along[..rows], &ranges[..rows], &mut to[..rows]);
        } else {
            measure::place(from, along, ranges, scratch);
            kept.put(surface, scratch, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::ScanPlan;
    use crate::scan::ScanOptions;
    use crate::scene::{Mesh, Object, Part};
    use crate::sensor::Sensor;
    use crate::trace::Engine;
    use crate::trace::LiveScene;
    use cloud::{ColumnMut, Columns, FIELDS, FieldSet};
    use emitter::Trajectory;
    use ground::pose::Pose;
    use std::sync::Arc;

    /// A forgotten column would hold what an earlier scan left in its memory.
    #[test]
    fn every_column_is_written() {
        let corners = [[5.0, -2.0, -2.0], [5.0, 2.0, -2.0], [5.0, 2.0, 2.0], [5.0, -2.0, 2.0]];
        let positions = corners.to_vec().into();
        let part = Part::default().positions(positions).triangles(vec![[0, 1, 2], [0, 2, 3]].into());
        let mut scene = LiveScene::new(&Engine::new().unwrap());
        scene.add(Object::new("wall", Arc::new(Mesh::new("wall", vec![part]).unwrap()))).unwrap();
        let scene = scene.commit().unwrap();
        let sensor = Sensor::preset("velodyne_vlp16").unwrap();
        let (beams, trajectory) = (sensor.beams_at(0.0).unwrap(), Trajectory::fixed(Pose::IDENTITY));
        for organised in [false, true] {
            let options = ScanOptions { fields: FieldSet::all(), organised, ..ScanOptions::default() };
            let reception = sensor.reception(&options.environment, scene.0.origin, options.profile).unwrap();
            let plan = ScanPlan::new(&scene.0, &sensor, &beams, &reception, &trajectory, &options).unwrap();
            let mut columns = Columns::default();
            columns.resize(options.fields, beams.len()).unwrap();
            for info in FIELDS {
                match columns.get_mut(info.field) {
                    ColumnMut::F32(column) => column.fill(-7e30),
                    ColumnMut::F64(column) => column.fill(-7e30),
                    ColumnMut::U8(column) => column.fill(251),
                    ColumnMut::U16(column) => column.fill(0xbeef),
                    ColumnMut::U32(column) => column.fill(0xdead_beef),
                }
            }
            let rows = plan.window(0..beams.len(), 0, &mut columns);
            assert!(rows > 100 && (rows == beams.len()) == organised, "{rows}");
            for info in FIELDS {
                let column = columns.get(info.field);
                let left = [-7e30f32 as f64, -7e30, 251.0, 48879.0, 3_735_928_559.0];
                let of_type = left[info.kind as usize];
                assert!((0..rows).all(|row| column.get_f64(row) != of_type), "{} is not written", info.name);
            }
        }
    }
}
