//! From detections to the rows of a cloud.

use super::setup::{RadarMoment, RadarSetup};
use super::truth::FrameTruth;
use crate::echo::radar::RadarEchoes;
use crate::trace::{Later, Search};
use ::radar::{DetectionTruth, RadarCube, RadarDetections, SeenBy};
use cloud::{Columns, Frame, PointCloud, put};
use glam::{DVec3, Vec3};
use ground::angle::direction;
use ground::cause::Cause;
use ground::error::Result;
use ground::lanes::MEDIUM;
use ground::path_type::PathType;
use std::f64::consts::PI;

/// Writes the detections of a moment.
pub(super) struct PointWriter<'a> {
    pub setup: &'a RadarSetup<'a>,
    pub search: &'a Search,
    pub echoes: &'a RadarEchoes,
    pub truth: &'a FrameTruth,
    pub moment: &'a RadarMoment,
    /// Of a rotating radar, the row of the turn, and the azimuth of the antenna, rad; otherwise 0.
    pub beam: (u32, f32),
    /// What phase noise and other radars alone would make of the cube.
    pub disturbance: Option<&'a RadarCube>,
}

/// What a detection is of.
struct SeenScatterer {
    /// Index of the echo.
    echo: usize,
    rcs_db: f32,
}

impl PointWriter<'_> {
    /// Replaces `cloud` by the detections.
    pub fn write(&self, detections: &RadarDetections, seen: &[DetectionTruth], cloud: &mut PointCloud) -> Result<()> {
        let setup = self.setup;
        let options = setup.options;
        let mut columns = std::mem::take(cloud).columns;
        columns.resize(options.fields, detections.len())?;
        let period = options.frame_period.unwrap_or(setup.sensor.beams.period);
        let wants_flow = options.fields.contains_any(&cloud::FLOW);
        let later = if wants_flow { setup.scene.0.later(period)? } else { None };
        for row in 0..detections.len() {
            self.write_row(&mut columns, row, detections, &seen[row], later.as_ref());
        }
        *cloud = PointCloud {
            len: detections.len(),
            fields: options.fields,
            frame: options.coordinates,
            origin: if options.coordinates == Frame::World { setup.scene.origin() } else { DVec3::ZERO },
            sensor_pose: self.moment.carrier,
            start_time: Some(options.start_time),
            intensity_full_scale: None,
            labels: setup.scene.0.surfaces.labels.clone(),
            columns,
            ..PointCloud::default()
        };
        Ok(())
    }

    /// A place or a direction relative to the scene's origin, in the frame of the cloud.
    fn place(&self, place: Vec3) -> Vec3 {
        match self.setup.options.coordinates {
            Frame::World => place,
            Frame::Sensor => {
                let from = place.as_dvec3() + self.setup.scene.origin() - self.moment.carrier.position;
                (self.moment.carrier.rotation().transpose() * from).as_vec3()
            }
        }
    }

    fn write_row(
        &self,
        columns: &mut Columns,
        row: usize,
        detections: &RadarDetections,
        seen: &DetectionTruth,
        later: Option<&Later>,
    ) {
        let (setup, moment) = (self.setup, self.moment);
        let range = detections.range[row];
        let (beam, turned) = self.beam;
        let (azimuth, elevation) = (detections.azimuth[row] + turned, detections.elevation[row]);
        // In the axes of the antenna, and of what carries it.
        let own = direction([detections.azimuth[row], elevation]);
        let reported = direction([azimuth, elevation]) * range;
        let world = (moment.carrier.rotation() * reported.as_dvec3() + moment.carrier.position - setup.scene.origin())
            .as_vec3();
        let place = self.place(world);
        let power = f64::from(detections.power[row]);
        let scatterer = self.scatterer(seen);
        let kind = match (&scatterer, seen.seen) {
            (None, _) | (_, SeenBy::Noise) if self.is_disturbed(detections, row) => PathType::Interference,
            (None, _) | (_, SeenBy::Noise) => PathType::Noise,
            (_, SeenBy::SideLobe) => PathType::SideLobe,
            (_, SeenBy::Alias) => PathType::Alias,
            (Some(_), SeenBy::MainLobe) => seen.group.map_or(PathType::Noise, |group| self.truth.types[group as usize]),
        };
        columns.start_row(row);
        put!(columns, row,
            x: place.x, y: place.y, z: place.z,
            range: range, depth: reported.x,
            intensity: detections.snr_db[row],
            azimuth: azimuth, elevation: elevation,
            doppler: detections.velocity[row],
            rcs: self.cross_section_db(power, range.into(), own),
            snr: detections.snr_db[row],
            power: (10.0 * power.log10() + 30.0) as f32,
            path: kind as u8,
            range_sigma: detections.sigma_range[row],
            velocity_sigma: detections.sigma_velocity[row],
            azimuth_sigma: finite(detections.sigma_azimuth[row]),
            elevation_sigma: finite(detections.sigma_elevation[row]),
            return_number: 1, return_count: 1,
            time: moment.time,
            frame: setup.options.frame,
            strip: setup.options.strip,
            beam: beam, firing: beam,
        );
        match scatterer.filter(|_| !matches!(kind, PathType::Noise | PathType::Interference)) {
            Some(scatterer) => self.write_truth(columns, row, &scatterer, later),
            None => put!(columns, row, cause: Cause::FalseAlarm as u8),
        }
    }

    /// Whether phase noise and other radars have more power in the cell of a detection than thermal noise.
    fn is_disturbed(&self, detections: &RadarDetections, row: usize) -> bool {
        let Some(cube) = self.disturbance else { return false };
        let [rows, cells] = [cube.axes.velocity.len, cube.axes.range.len];
        let at = detections.velocity_cell[row] as usize * cells + detections.range_cell[row] as usize;
        let power: f64 = cube.cells.iter().skip(at).step_by(rows * cells).map(|cell| f64::from(cell.norm_sqr())).sum();
        power > self.setup.noise * cube.channels as f64
    }

    /// Radar cross-section, dBsm, that a radar estimates from the power at an element, W.
    pub(super) fn cross_section_db(&self, power: f64, range: f64, own: Vec3) -> f32 {
        let [tx, rx] = self.setup.plan.patterns.each_ref().map(|pattern| f64::from(pattern.amplitude(own.to_array())));
        let received = power / (tx * rx * self.setup.scale()).powi(2);
        (10.0 * (4.0 * PI * received * range.powi(4)).log10()) as f32
    }

    /// The strongest contributor.
    fn scatterer(&self, seen: &DetectionTruth) -> Option<SeenScatterer> {
        seen.group?;
        let path = seen.path as usize;
        let echo = *self.truth.echo.get(path)? as usize;
        Some(SeenScatterer { echo, rcs_db: self.truth.cross_section_db(self.echoes, path, self.setup.scale()) })
    }

    fn write_truth(&self, columns: &mut Columns, row: usize, scatterer: &SeenScatterer, later: Option<&Later>) {
        let (tables, echoes) = (&self.setup.scene.0, self.echoes);
        let (surface, triangle) = (echoes.row[scatterer.echo], echoes.triangle[scatterer.echo]);
        let world = echoes.place[scatterer.echo];
        let straight = world.as_dvec3() + self.setup.scene.origin() - self.moment.pose.position;
        let place = self.place(world);
        put!(columns, row,
            true_x: place.x, true_y: place.y, true_z: place.z,
            true_range: straight.length() as f32,
            true_rcs: scatterer.rcs_db,
        );
        if surface == MEDIUM {
            // The medium's cause is kept in place of a triangle.
            put!(columns, row, cause: triangle as u8, radial_velocity: echoes.paths.range_rate[scatterer.echo]);
            return;
        }
        let Some(of) = tables.surfaces.rows.get(surface as usize) else { return };
        let uv = [1.0 / 3.0; 2];
        let movement = tables.movement(later, surface, triangle, uv, self.moment.part).unwrap_or_default();
        let along = straight.normalize_or_zero();
        let rate = (movement.velocity.as_dvec3() - self.moment.velocity).dot(along) as f32;
        let [a, b, c] = tables.corners(surface, triangle, self.moment.part);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(along.as_vec3()) > 0.0 { -normal } else { normal };
        let [red, green, blue] = tables.surfaces.rgb(of, triangle, uv);
        let target = self.search.targets.get(echoes.target[scatterer.echo] as usize);
        let bounces = target.map_or(0, |target| target.mirrors.len() as u8);
        let turned = match self.setup.options.coordinates {
            Frame::World => normal,
            Frame::Sensor => (self.moment.carrier.rotation().transpose() * normal.as_dvec3()).as_vec3(),
        };
        put!(columns, row,
            category_id: of.category_id, part_id: of.part_id, instance_id: of.instance_id,
            material_id: of.material_id,
            first_category_id: of.category_id, first_instance_id: of.instance_id,
            track_id: of.instance_id,
            red: red, green: green, blue: blue,
            normal_x: turned.x, normal_y: turned.y, normal_z: turned.z,
            cos_incidence: -normal.dot(along.as_vec3()),
            cause: if bounces > 0 { Cause::Multipath as u8 } else { Cause::Surface as u8 },
            bounces: bounces,
            velocity_x: movement.velocity.x, velocity_y: movement.velocity.y, velocity_z: movement.velocity.z,
            flow_x: movement.flow.x, flow_y: movement.flow.y, flow_z: movement.flow.z,
            radial_velocity: rate,
        );
    }
}

fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { f32::NAN }
}
