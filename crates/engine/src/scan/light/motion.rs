//! Motion of what was hit, true and as measured by Doppler.

use super::block::Block;
use super::plan::ScanPlan;
use crate::detect::Returns;
use crate::trace::Movement;
use cloud::Slices;
use glam::Vec3;
use ground::cause::Cause;
use ground::lanes::LANES;

impl Block {
    /// Step 11 for motion: the requested columns, row by row.
    #[inline(never)]
    pub fn put_motion(&mut self, scan: &ScanPlan, count: usize, rows: &mut Slices) {
        let Block { lanes, rays, hits, rho_eff, kept, bounces, cause, images, .. } = self;
        let (scene, surface) = (scan.world.scene, &hits.surface);
        let mut velocity = [[0.0; LANES]; 3];
        let mut flow = [[0.0; LANES]; 3];
        if scan.world.motion {
            let (later, period) = (scan.world.later.as_ref(), scan.frame_period as f32);
            for lane in 0..count {
                let seen = images.as_ref().filter(|_| bounces[lane] > 0).map(|images| &images[lane]);
                let uv = [hits.u[lane], hits.v[lane]];
                let own = scene.movement(later, surface[lane], hits.triangle[lane], uv, rays.time[lane]);
                let Some(own) = own.or(seen.map(|_| Movement::default())) else { continue };
                let set = |columns: &mut [[f32; LANES]; 3], value: Vec3| {
                    columns.iter_mut().zip(value.to_array()).for_each(|(column, value)| column[lane] = value);
                };
                set(&mut velocity, seen.map_or(own.velocity, |image| image.velocity(own.velocity)));
                if later.is_some() {
                    set(&mut flow, seen.map_or(own.flow, |image| image.way(own.flow, period)));
                }
            }
        }
        if !rows.radial_velocity.is_empty() || !rows.doppler.is_empty() {
            // Along the beam, relative to the sensor.
            let mut radial = [0.0; LANES];
            let [x, y, z] = rays.directions();
            for lane in 0..count {
                radial[lane] = velocity[0][lane] * x[lane] + velocity[1][lane] * y[lane] + velocity[2][lane] * z[lane];
            }
            if scan.aim.pose.moves() {
                for lane in 0..count {
                    let own = scan.aim.pose.velocity(scan.aim.beams, lanes.beam[lane] as usize);
                    radial[lane] -= own.dot(rays.direction(lane));
                }
            }
            kept.put(surface, &radial, rows.radial_velocity);
            if !rows.doppler.is_empty() {
                let channels = lanes.take(&scan.aim.beams.channel, count);
                let returns = Returns {
                    beams: &lanes.beam[..count],
                    numbers: &lanes.number[..count],
                    channels: &channels[..count],
                    rho_eff,
                    range: &hits.range,
                };
                let false_alarm = |lane: usize| cause[lane] == Cause::FalseAlarm as u8;
                scan.measure.errors.shift(&scan.rng, &returns, false_alarm, &mut radial);
                kept.put(surface, &radial, rows.doppler);
            }
        }
        let [velocity_x, velocity_y, velocity_z] = &velocity;
        kept.put(surface, velocity_x, rows.velocity_x);
        kept.put(surface, velocity_y, rows.velocity_y);
        kept.put(surface, velocity_z, rows.velocity_z);
        let [flow_x, flow_y, flow_z] = &flow;
        kept.put(surface, flow_x, rows.flow_x);
        kept.put(surface, flow_y, rows.flow_y);
        kept.put(surface, flow_z, rows.flow_z);
    }
}
