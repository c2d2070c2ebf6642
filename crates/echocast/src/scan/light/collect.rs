//! The columns of a block's returns.

use super::block::{BeamLanes, Block};
use super::run::ScanPlan;
use crate::cloud::{BOTTOM_TRACK, Field, Frame, Kept, MOVING, SOUNDING, Slices, WATER_TRACK};
use crate::ground::angle::azimuth_elevation;
use crate::ground::lanes::LANES;
use echocast_kernels::{aim, measure};
use glam::Vec3;
use std::f32::consts::PI;

impl Block {
    /// Step 11: the requested columns, row by row.
    pub fn collect(&mut self, scan: &ScanPlan, count: usize, mut rows: Slices) -> usize {
        let Block { lanes, rays, hits, surfaces, measured, intensity, turn, kept, scratch, reported, .. } = self;
        let surface = &hits.surface;
        let filled = kept.choose(surface, count, scan.options.organised);

        // Positions along the beam, from where it starts.
        let world = scan.options.coordinates == Frame::World;
        let beams = scan.aim.beams;
        let nominal =
            |lanes: &BeamLanes| [&beams.dir_x, &beams.dir_y, &beams.dir_z].map(|axis| lanes.take(axis, count));
        let starts = beams.has_origins().then(|| beams.origin.each_ref().map(|axis| lanes.take(axis, count)));
        let starts = starts.as_ref().map_or([&ZERO; 3], |starts| starts.each_ref());
        let reported = reported.as_deref().filter(|_| scan.points_elsewhere());
        if [&rows.true_x, &rows.true_y, &rows.true_z].iter().any(|column| !column.is_empty()) {
            let to = [&mut *rows.true_x, &mut *rows.true_y, &mut *rows.true_z];
            if world {
                put_positions(kept, surface, rays.origins(), rays.directions(), &hits.range, scratch, to);
            } else {
                let mut directions = nominal(lanes);
                // The true directions of the beams.
                for lane in (0..count).filter(|_| reported.is_some()) {
                    let (rotation, _) = scan.aim.pose.pose(beams, lanes.beam[lane] as usize);
                    let direction = rotation.transpose() * rays.direction(lane);
                    directions.iter_mut().zip(direction.to_array()).for_each(|(axis, value)| axis[lane] = value);
                }
                put_positions(kept, surface, starts, directions.each_ref(), &hits.range, scratch, to);
            }
        }
        // Reported values do not reflect that.
        let reported = reported.unwrap_or(rays);
        let mut directions;
        let (from, mut along) = if world {
            (reported.origins(), reported.directions())
        } else {
            directions = nominal(lanes);
            (starts, directions.each_ref())
        };
        if scan.measure.errors.turn_beams() {
            let mut up = Vec3::Z.to_array().map(|axis| [axis; LANES]);
            for lane in (0..count).filter(|_| world) {
                let (rotation, _) = scan.aim.pose.pose(beams, lanes.beam[lane] as usize);
                up.iter_mut().zip(rotation.z_axis.to_array()).for_each(|(axis, value)| axis[lane] = value);
            }
            let mut turned = along.map(|axis| *axis);
            aim::turn(up.each_ref(), turn, turned.each_mut());
            directions = turned;
            along = directions.each_ref();
        }
        let mut places = scan.deskew.as_ref().map(|_| [[0.0; LANES]; 3]);
        match &mut places {
            None => put_positions(kept, surface, from, along, measured, scratch, [rows.x, rows.y, rows.z]),
            Some(places) => {
                for ((from, along), places) in from.into_iter().zip(along).zip(places) {
                    measure::place(from, along, measured, places);
                }
            }
        }
        kept.put(surface, measured, rows.range);
        kept.put(surface, &hits.range, rows.true_range);
        kept.put(surface, intensity, rows.intensity);
        kept.put(surface, &surfaces.cos_incidence, rows.cos_incidence);
        if !rows.depth.is_empty() {
            let dir_x = lanes.take(&beams.dir_x, count);
            measure::place(starts[0], &dir_x, measured, scratch);
            kept.put(surface, scratch, rows.depth);
        }
        if let (Some(deskew), Some(places)) = (&scan.deskew, &mut places) {
            self.deskew(scan, deskew, count, places);
        } else if !world && scan.options.fields.contains_any(&[Field::NormalX, Field::NormalY, Field::NormalZ]) {
            for lane in 0..count {
                let (rotation, _) = scan.aim.pose.pose(beams, lanes.beam[lane] as usize);
                let normal = hits.normal(lane);
                let normal = rotation.transpose() * normal;
                (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = normal.into();
            }
        }
        let Block { lanes, hits, surfaces, kept, answer, .. } = self;
        let surface = &hits.surface;
        if let Some([x, y, z]) = &places {
            kept.put(surface, x, rows.x);
            kept.put(surface, y, rows.y);
            kept.put(surface, z, rows.z);
        }
        kept.put(surface, &hits.normal_x, rows.normal_x);
        kept.put(surface, &hits.normal_y, rows.normal_y);
        kept.put(surface, &hits.normal_z, rows.normal_z);

        kept.put(surface, &surfaces.category_id, rows.category_id);
        kept.put(surface, &surfaces.part_id, rows.part_id);
        kept.put(surface, &surfaces.instance_id, rows.instance_id);
        kept.put(surface, &surfaces.material_id, rows.material_id);
        kept.put(surface, &surfaces.red, rows.red);
        kept.put(surface, &surfaces.green, rows.green);
        kept.put(surface, &surfaces.blue, rows.blue);
        kept.put(surface, &lanes.return_number, rows.return_number);
        kept.put(surface, &lanes.return_count, rows.return_count);
        kept.put(surface, &answer.cause, rows.cause);
        kept.put(surface, &answer.bounces, rows.bounces);
        if scan.world.paths.is_some() {
            kept.put(surface, &answer.first_category, rows.first_category_id);
            kept.put(surface, &answer.first_instance, rows.first_instance_id);
        } else {
            kept.put(surface, &surfaces.category_id, rows.first_category_id);
            kept.put(surface, &surfaces.instance_id, rows.first_instance_id);
        }

        if !rows.track_id.is_empty() {
            kept.put(surface, &surfaces.instance_id, rows.track_id);
        }
        if scan.options.fields.contains_any(&MOVING) {
            self.fill_motion(scan, count, rows.rows_after(0));
        }
        let Block { lanes, kept, turn, .. } = self;

        // What is known of every beam, return or not.
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
            time.iter_mut().for_each(|time| *time += scan.options.start_time);
            let firings = lanes.beam[..count].iter().map(|&beam| beams.firing(beam));
            scan.measure.errors.delay(&scan.rng, firings, &mut time);
            kept.put_beam(&time, rows.time);
        }
        // Columns of sonars.
        if scan.options.fields.contains_any(&SOUNDING) {
            for column in [rows.quality, rows.corrected_x, rows.corrected_y, rows.corrected_z] {
                kept.put_beam(&[f32::NAN; LANES], column);
            }
        }
        if scan.options.fields.contains_any(&BOTTOM_TRACK) {
            for column in [rows.bottom_track_x, rows.bottom_track_y, rows.bottom_track_z, rows.bottom_track_error] {
                kept.put_beam(&[f32::NAN; LANES], column);
            }
        }
        if scan.options.fields.contains_any(&WATER_TRACK) {
            for column in [rows.water_track_x, rows.water_track_y, rows.water_track_z, rows.water_track_error] {
                kept.put_beam(&[f32::NAN; LANES], column);
            }
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
            let [x, y, z] = nominal(lanes);
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
        filled
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
