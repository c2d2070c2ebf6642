//! The columns of a block's returns.

use super::block::Block;
use super::run::Scan;
use crate::cloud::{Field, Frame, Kept, Slices};
use crate::emitter::BeamTable;
use crate::trace::{LANES, RayBatch};
use std::f32::consts::PI;
use std::ops::Range;

impl Block {
    /// Step 11: the columns that were asked for, row by row.
    #[inline(always)]
    pub fn collect(&mut self, scan: &Scan, first: usize, count: usize, rows: Slices) -> usize {
        let Block { rays, hits, surfaces, measured, intensity, turn, kept, scratch, answer, .. } = self;
        let surface = &hits.surface;
        let filled = kept.choose(surface, count, scan.options.organised);

        // Positions along the beam: in the world from where the beam starts, in the sensor frame from 0.
        let world = scan.options.coordinates == Frame::World;
        let beams = scan.beams;
        let range = first..first + count;
        let looks_aside = scan.camera.is_some_and(|camera| camera.aside.is_some());
        if !world {
            (rays.org_x, rays.org_y, rays.org_z) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            if looks_aside {
                for lane in 0..count {
                    let (rotation, _) = scan.aim.pose(beams, first + lane);
                    let dir = glam::Vec3::new(rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]);
                    (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = (rotation.transpose() * dir).into();
                }
            } else {
                copy_directions(beams, range.clone(), rays);
            }
        }
        for (org, dir, to) in [
            (&rays.org_x, &rays.dir_x, rows.true_x),
            (&rays.org_y, &rays.dir_y, rows.true_y),
            (&rays.org_z, &rays.dir_z, rows.true_z),
        ] {
            put_positions(kept, surface, [org, dir, &hits.range], scratch, to);
        }
        if looks_aside && world {
            scan.aim.rays(beams, first, count, scan.reach, rays);
        } else if looks_aside {
            copy_directions(beams, range.clone(), rays);
        }
        if scan.azimuth_sigma > 0.0 {
            for lane in 0..count {
                let up = if world { scan.aim.pose(beams, first + lane).0.z_axis } else { glam::Vec3::Z };
                let dir = glam::Vec3::new(rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]);
                let turned = glam::Quat::from_axis_angle(up, turn[lane]) * dir;
                (rays.dir_x[lane], rays.dir_y[lane], rays.dir_z[lane]) = turned.into();
            }
        }
        for (org, dir, to) in
            [(&rays.org_x, &rays.dir_x, rows.x), (&rays.org_y, &rays.dir_y, rows.y), (&rays.org_z, &rays.dir_z, rows.z)]
        {
            put_positions(kept, surface, [org, dir, measured], scratch, to);
        }
        kept.put(surface, measured, rows.range);
        kept.put(surface, &hits.range, rows.true_range);
        kept.put(surface, intensity, rows.intensity);
        kept.put(surface, &surfaces.cos_incidence, rows.cos_incidence);
        if !rows.depth.is_empty() {
            for ((value, dir), range) in scratch.iter_mut().zip(&beams.dir_x[range.clone()]).zip(measured) {
                *value = dir * *range;
            }
            kept.put(surface, scratch, rows.depth);
        }
        if !world && scan.options.fields.contains_any(&[Field::NormalX, Field::NormalY, Field::NormalZ]) {
            for lane in 0..count {
                let (rotation, _) = scan.aim.pose(beams, first + lane);
                let normal = glam::Vec3::new(hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]);
                let normal = rotation.transpose() * normal;
                (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = normal.into();
            }
        }
        let surface = &hits.surface;
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
        kept.put(surface, &[1; LANES], rows.return_number);
        kept.put(surface, &[1; LANES], rows.return_count);
        kept.put(surface, &answer.cause, rows.cause);
        kept.put(surface, &answer.bounces, rows.bounces);
        if scan.paths.is_some() {
            kept.put(surface, &answer.first_category, rows.first_category_id);
            kept.put(surface, &answer.first_instance, rows.first_instance_id);
        } else {
            kept.put(surface, &surfaces.category_id, rows.first_category_id);
            kept.put(surface, &surfaces.instance_id, rows.first_instance_id);
        }

        // What is known of every beam, return or not.
        if !rows.channel.is_empty() {
            let mut channel = [0; LANES];
            channel[..count].copy_from_slice(&beams.channel[range.clone()]);
            kept.put_beam(&channel, rows.channel);
        }
        if !rows.time.is_empty() {
            let mut time = [0.0; LANES];
            for (value, offset) in time.iter_mut().zip(&beams.time[range.clone()]) {
                *value = scan.options.start_time + offset;
            }
            kept.put_beam(&time, rows.time);
        }
        if !rows.frame.is_empty() {
            kept.put_beam(&[scan.options.frame; LANES], rows.frame);
        }
        if !rows.beam.is_empty() || !rows.firing.is_empty() {
            let (mut beam, mut firing) = ([0; LANES], [0; LANES]);
            for lane in 0..LANES {
                beam[lane] = (first + lane) as u32;
                firing[lane] = beams.firing(beam[lane]);
            }
            kept.put_beam(&beam, rows.beam);
            kept.put_beam(&firing, rows.firing);
        }
        if !rows.azimuth.is_empty() || !rows.elevation.is_empty() {
            let (x, y, z) = (&beams.dir_x[range.clone()], &beams.dir_y[range.clone()], &beams.dir_z[range]);
            let (mut azimuth, mut elevation) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..count {
                let reported = y[lane].atan2(x[lane]) + turn[lane];
                // Straight back is -pi, whichever way it is rounded.
                azimuth[lane] = match reported {
                    PI.. => reported - 2.0 * PI,
                    _ if reported < -PI => reported + 2.0 * PI,
                    _ => reported,
                };
                elevation[lane] = z[lane].atan2(x[lane].hypot(y[lane]));
            }
            kept.put_beam(&azimuth, rows.azimuth);
            kept.put_beam(&elevation, rows.elevation);
        }
        filled
    }
}

/// Directions of `beams` in the sensor frame.
#[inline(always)]
fn copy_directions(beams: &BeamTable, range: Range<usize>, rays: &mut RayBatch) {
    let count = range.len();
    rays.dir_x[..count].copy_from_slice(&beams.dir_x[range.clone()]);
    rays.dir_y[..count].copy_from_slice(&beams.dir_y[range.clone()]);
    rays.dir_z[..count].copy_from_slice(&beams.dir_z[range]);
}

/// Writes one coordinate of the points at `ranges` along rays from `org` in the direction `dir`.
#[inline(always)]
fn put_positions(
    kept: &Kept,
    surface: &[u32; LANES],
    [org, dir, ranges]: [&[f32; LANES]; 3],
    scratch: &mut [f32; LANES],
    to: &mut [f32],
) {
    if to.is_empty() {
        return;
    }
    for lane in 0..LANES {
        scratch[lane] = org[lane] + dir[lane] * ranges[lane];
    }
    kept.put(surface, scratch, to);
}
