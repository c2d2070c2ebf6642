//! Deskew: points where they were when the scan started, whenever they were hit.

use super::block::Block;
use super::plan::{Deskew, ScanPlan};
use crate::trace::Return;
use glam::{Mat3, Vec3};
use ground::lanes::LANES;

impl Block {
    /// Transforms the `places` of the first `count` lanes, and the normals, from the times of their beams to the start
    /// of the scan: points stay where they are on their surfaces, in the world or in the frame that the sensor had at
    /// the start.
    #[inline(never)]
    pub fn deskew(&mut self, scan: &ScanPlan, deskew: &Deskew, count: usize, places: &mut [[f32; LANES]; 3]) {
        let Block { lanes, rays, hits, bounces, images, .. } = self;
        for lane in 0..count {
            let mut place = Vec3::from(places.each_ref().map(|axis| axis[lane]));
            let mut normal = hits.normal(lane);
            let back = deskew.start.and_then(|(start, length)| {
                let seen = images.as_ref().filter(|_| bounces[lane] > 0).map(|images| &images[lane]);
                let uv = [hits.u[lane], hits.v[lane]];
                let back =
                    scan.world.scene.return_to(hits.surface[lane], hits.triangle[lane], uv, rays.time[lane], start);
                match (back, seen) {
                    (back, None) => back,
                    // What is seen in a mirror is where the mirror shows it.
                    (back, Some(image)) => {
                        let way = back.map_or(Vec3::ZERO, |back| back.way);
                        let way = image.way(way, (start - rays.time[lane]) * length);
                        Some(Return { way, normal: Mat3::IDENTITY })
                    }
                }
            });
            let back = back.unwrap_or(Return { way: Vec3::ZERO, normal: Mat3::IDENTITY });
            match &deskew.sensor {
                None => {
                    place += back.way;
                    normal = back.normal * normal;
                }
                Some((rotation, origin)) => {
                    let into = rotation.transpose();
                    if scan.aim.pose.moves() {
                        let (turned, from) = scan.aim.pose.pose(scan.aim.beams, lanes.beam[lane] as usize);
                        place = into * (turned * place + (from - *origin) + back.way);
                    } else {
                        place += into * back.way;
                    }
                    normal = into * (back.normal * normal);
                }
            }
            (places[0][lane], places[1][lane], places[2][lane]) = place.into();
            (hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]) = normal.normalize_or_zero().into();
        }
    }
}
