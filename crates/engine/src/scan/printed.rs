//! Sonars as the paper describes them and as its program computes them: one ray per angle, one point per ray.
//!
//! The paper: Reitmann, Neumann, Jung, Sensors 2021, 21, 2144, eqs. 6 to 13 and sections 2.3.3 and 3.3. The program:
//! its `sonar.py` as it was run, oddities and all.

mod explain;

use super::check_flat;
use super::{Profile, ScanOptions};
use crate::medium::{Absorption, Fluid, Slab, SoundSpeed, SoundSpeedProfile, Water, WaterColumn};
use crate::sensor::{AcousticsSpec, Sensor};
use crate::trace::{
    Arrival, BuiltScene, Cover, HitBatch, Launch, ReflectionLoss, Sight, SoundLimits, SoundTracer, Tables, TracerMemory,
};
use cloud::{Columns, Frame, PointCloud, put};
use emitter::pattern::{Flat, Pattern, Sidescan};
use emitter::{BeamTable, FiringOrder, Trajectory};
use glam::{DVec3, Mat3, Vec3};
use ground::angle::azimuth_elevation;
use ground::error::{Error, Result};
use ground::lanes::{CHUNK, LANES, MEDIUM, MISS, RayBatch};
use ground::parallel;
use ground::pose::Pose;
use model::material::{Mirrors, ReflectanceSource, Reflectances};
use std::ops::Range;
use std::sync::Arc;

/// Angle from straight down at which the program's fans begin, degrees.
const PROGRAM_NADIR_DEG: f64 = 1e-3;

/// What is the same for all rays of a scan.
struct Printed<'a> {
    scene: &'a Tables,
    acoustics: &'a AcousticsSpec,
    options: &'a ScanOptions,
    fan: Arc<BeamTable>,
    column: WaterColumn,
    reflectances: Arc<Reflectances>,
    pose: Pose,
    /// Where the sonar starts, m.
    start: DVec3,
    flat: Option<Flat>,
    /// Nearest and farthest path that is reported, m.
    limits: [f64; 2],
}

/// The point of a ray.
#[derive(Clone, Copy, Debug)]
struct PrintedPoint {
    ray: u32,
    /// Length along the ray, m.
    range: f32,
    intensity: f32,
    /// Where the surface is hit, relative to the scene's origin, m, and the unit vector along the ray there.
    place: Vec3,
    direction: Vec3,
    /// Of any length and sign.
    normal: Vec3,
    surface: u32,
    triangle: u32,
    corner: [f32; 2],
}

/// The terms of the sonar equation (6) that differ from ray to ray, dB except for the reflectance.
#[derive(Clone, Copy, Debug)]
struct Terms {
    /// Source level; for the program, after the interfaces on the way.
    source: f64,
    /// Two-way spreading loss.
    spreading: f64,
    /// Loss at interfaces; 0 for the program, which includes it in the source level.
    interfaces: f64,
    /// 0 to 1.
    reflectance: f64,
    /// The echo level.
    level: f64,
}

/// Points of the rays of one task, and the buffers to trace them.
#[derive(Default)]
struct PrintedChunk {
    points: Vec<PrintedPoint>,
    ways: Vec<ProgramRay>,
    tracer: TracerMemory,
    arrivals: Vec<Arrival>,
}

impl BuiltScene {
    /// [`BuiltScene::scan_into`] of a sonar in the profiles of the paper and of its program.
    ///
    /// # Errors
    /// A sensor that is not a sonar; a sonar above the water or outside its profile; for the program, water that is not
    /// in layers, and a source level of 0; no memory.
    pub(super) fn scan_printed(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
    ) -> Result<()> {
        options.check(trajectory)?;
        options.environment.check()?;
        let printed = Printed::new(&self.0, sensor, trajectory, options)?;
        let points = self.0.engine.install(|| printed.points());
        let collected = printed.collect(points, cloud);
        if collected.is_err() {
            *cloud = PointCloud::default();
        }
        collected
    }
}

impl<'a> Printed<'a> {
    fn new(
        scene: &'a Tables,
        sensor: &'a Sensor,
        trajectory: &Trajectory,
        options: &'a ScanOptions,
    ) -> Result<Printed<'a>> {
        let acoustics = sensor.acoustics()?;
        check_flat(options.profile, sensor)?;
        if sensor.flat().is_some() && options.coordinates == Frame::Sensor {
            return Err(Error::invalid(
                "coordinates",
                "sensor",
                "world with pattern.flat, whose points are in world coordinates",
            ));
        }
        scene.check_time(options.start_time, 0.0)?;
        let program = options.profile == Profile::Blainder;
        if program {
            check_for_program(acoustics, options.environment.water.as_ref())?;
        }
        let pose = sensor.turned(trajectory.at(options.start_on_trajectory()), options.frame);
        let water = printed_water(options.environment.water.clone().unwrap_or_default());
        let depth = water.surface_z_m - pose.position.z;
        // Warnings about it are reported by `BuiltScene::check_water`.
        let (column, _) = WaterColumn::new(&water, acoustics.frequency(), depth)?;
        let wavelength = column.speed_at(depth) / acoustics.frequency();
        let source = if program { ReflectanceSource::Alpha } else { ReflectanceSource::Luminance };
        let source = options.reflectance_source.unwrap_or(source).of_sound();
        Ok(Printed {
            scene,
            acoustics,
            options,
            fan: fan(sensor, program, wavelength)?,
            column,
            reflectances: scene.surfaces.reflectances(sensor.wavelength_nm, source, Mirrors::Real),
            pose,
            start: trajectory.at(trajectory.span().0).position,
            flat: sensor.flat(),
            limits: [sensor.range_min_m, sensor.range_max_m],
        })
    }

    /// Points of all rays, in the order of the rays.
    fn points(&self) -> Vec<PrintedPoint> {
        let mut chunks = Vec::new();
        chunks.resize_with(self.fan.len().div_ceil(CHUNK), PrintedChunk::default);
        let no_loss = |_: u32, _: f64| 0.0;
        let tracer = SoundTracer::new(self.scene, &self.column, self.tracer_limits(&no_loss));
        parallel::for_each(&mut chunks, |number, chunk| {
            let rays = number * CHUNK..((number + 1) * CHUNK).min(self.fan.len());
            if self.options.profile == Profile::Blainder {
                self.follow_as_program(rays, chunk, &mut |_, _| {});
            } else {
                self.follow_as_paper(&tracer, rays, chunk);
            }
            // Rays end at different steps.
            chunk.points.sort_unstable_by_key(|point| point.ray);
        });
        chunks.into_iter().flat_map(|chunk| chunk.points).collect()
    }

    /// The tracer ends rays by time; where sound is slowest it takes longest over the maximum range.
    fn tracer_limits<'l>(&self, reflection_loss: ReflectionLoss<'l>) -> SoundLimits<'l> {
        SoundLimits {
            mask: self.options.mask,
            believed: self.column.end_speeds().fold(f64::INFINITY, f64::min),
            reach: self.limits[1],
            bounces: 0,
            reflection_loss,
            clock: self.scene.clock(self.options.start_time, self.options.freeze),
        }
    }

    fn rotation(&self) -> Mat3 {
        self.pose.rotation().as_mat3()
    }

    /// Position of the sonar, relative to the scene's origin, m.
    fn place(&self) -> DVec3 {
        self.pose.position - self.scene.origin
    }

    /// Terms of the sonar equation (6) that are the same for all rays, dB: `- NL`, `DI` and `PG`.
    fn own_terms(&self) -> [f64; 3] {
        let AcousticsSpec { noise_level_db, directivity_index_db, processing_gain_db, .. } = self.acoustics;
        [-noise_level_db.unwrap_or(0.0), directivity_index_db.unwrap_or(0.0), processing_gain_db.unwrap_or(0.0)]
    }

    fn gains(&self) -> f64 {
        let [noise, directivity, gain] = self.own_terms();
        directivity + gain + noise
    }

    /// Reflectance of a `surface`, 0 to 1, at a point of a `triangle`.
    fn reflectance(&self, surface: u32, triangle: u32, corner: [f32; 2]) -> f64 {
        let surfaces = &self.scene.surfaces;
        let surface = &surfaces.rows[surface as usize];
        let known = self.reflectances.by_material[surface.material as usize];
        if known.is_nan() {
            let by_color = &self.reflectances.by_color[surface.material as usize];
            return by_color.of(surfaces.base_color(surface, triangle, corner)).into();
        }
        known.into()
    }

    /// Echoes as printed (paper profile): eq. 6 with spherical spreading over the whole path, `TS = 10
    /// log(reflectance)`, and `-10 log` of eq. 13 at each interface on the way out; rays by Snell's law (11), reflected
    /// where nothing is transmitted.
    fn follow_as_paper(&self, tracer: &SoundTracer, rays: Range<usize>, chunk: &mut PrintedChunk) {
        let launch = Launch {
            directions: self.fan.directions(0, self.fan.len()),
            rotation: self.rotation(),
            place: self.place(),
        };
        let arrivals = &mut chunk.arrivals;
        tracer.trace(&launch, rays, &mut chunk.tracer, arrivals);
        for arrival in &*arrivals {
            let echo = self.echo_as_paper(arrival);
            if let Some((_, point)) = echo.filter(|(terms, _)| terms.level > self.acoustics.detection_threshold_db) {
                chunk.points.push(point);
            }
        }
    }

    /// The echo of an arrival as printed (paper profile); `None`: from the sea surface, which the paper does not treat,
    /// or out of range.
    fn echo_as_paper(&self, arrival: &Arrival) -> Option<(Terms, PrintedPoint)> {
        let path = f64::from(arrival.path);
        if arrival.surface == MEDIUM || !(path >= self.limits[0] && path <= self.limits[1]) {
            return None;
        }
        let reflectance = self.reflectance(arrival.surface, arrival.triangle, arrival.corner);
        // The source level is that at 1 m.
        let spreading = 2.0 * 20.0 * path.max(1.0).log10();
        let (source, interfaces) = (self.acoustics.source_level_db, f64::from(arrival.loss));
        let level = source - spreading - interfaces + 10.0 * reflectance.log10() + self.gains();
        let point = PrintedPoint {
            ray: arrival.ray,
            range: path as f32,
            intensity: level as f32,
            place: arrival.place,
            direction: arrival.direction,
            normal: arrival.normal,
            surface: arrival.surface,
            triangle: arrival.triangle,
            corner: arrival.corner,
        };
        Some((Terms { source, spreading, interfaces, reflectance, level }, point))
    }

    /// Echoes as computed by the paper's program, block by block, all rays of a block through one layer after the
    /// other. `report` is called with everything that is hit, however weak.
    fn follow_as_program(
        &self,
        rays: Range<usize>,
        chunk: &mut PrintedChunk,
        report: &mut impl FnMut(&Terms, &PrintedPoint),
    ) {
        let (mut batch, mut hits) = (RayBatch::default(), HitBatch::new());
        // As in the program, nothing moves during a ping.
        if let Some(clock) = self.scene.clock(self.options.start_time, true) {
            batch.time = [clock.of(0.0); LANES];
        }
        let depth = self.column.surface_z - self.pose.position.z;
        let slabs = &self.column.slabs[self.column.slab_at(depth)..];
        let rotation = self.rotation();
        let ways = &mut chunk.ways;
        // In the program surfaces are solid, whatever their alpha.
        let sight = Sight { mask: self.options.mask, cover: Cover::Reflecting };
        for first in rays.clone().step_by(LANES) {
            ways.clear();
            ways.extend((first..rays.end.min(first + LANES)).map(|ray| {
                let direction = (rotation * self.fan.direction(ray)).as_dvec3().normalize();
                ProgramRay::new(ray as u32, self.place(), direction, self.limits[1], self.acoustics.source_level_db)
            }));
            if slabs.len() > 1 {
                // The program turns rays that do not go down into ones that start behind themselves; here they hit
                // nothing.
                ways.retain(|way| way.fall > 0.0);
            }
            let mut top = depth;
            for (index, slab) in slabs.iter().enumerate() {
                if ways.is_empty() {
                    break;
                }
                let next = slabs.get(index + 1);
                for (lane, way) in ways.iter_mut().enumerate() {
                    way.length = next.map_or(way.left, |_| (slab.bottom - top) / way.fall);
                    (batch.org_x[lane], batch.org_y[lane], batch.org_z[lane]) = way.place.as_vec3().into();
                    (batch.dir_x[lane], batch.dir_y[lane], batch.dir_z[lane]) = way.direction.as_vec3().into();
                    batch.range_max[lane] = way.left.min(way.length) as f32;
                }
                hits.trace(self.scene, &batch, ways.len(), true, sight);
                hits.orient_normals(self.scene, &batch, ways.len());
                let mut lane = 0;
                ways.retain_mut(|way| {
                    let met = self.echo_as_program(way, &hits, lane);
                    lane += 1;
                    if let Some((terms, point)) = &met {
                        report(terms, point);
                    }
                    // On an interface the path in the last layer is 0, and the level not a number.
                    let loud = |terms: &Terms, point: &PrintedPoint| {
                        terms.level > self.acoustics.detection_threshold_db && point.intensity.is_finite()
                    };
                    match met.filter(|(terms, point)| loud(terms, point)) {
                        Some((_, point)) => {
                            if f64::from(point.range) >= self.limits[0] {
                                chunk.points.push(point);
                            }
                            false
                        }
                        None => next.is_some_and(|next| way.enter(slab, next)),
                    }
                });
                top = slab.bottom;
            }
        }
    }

    /// The echo of the hit in `lane` of `hits` as computed by the paper's program: `(SL - 2 TL - NL + DI + PG) R`, with
    /// the reflectance `R` as a factor of the level and `TL = 10 log` of the path in the last layer only; its intensity
    /// is the ratio of the level to that of the source.
    fn echo_as_program(&self, way: &ProgramRay, hits: &HitBatch, lane: usize) -> Option<(Terms, PrintedPoint)> {
        let surface = hits.surface[lane];
        if surface == MISS {
            return None;
        }
        let (triangle, corner) = (hits.triangle[lane], [hits.u[lane], hits.v[lane]]);
        let length = f64::from(hits.range[lane]);
        let (source, spreading) = (way.source_level, 20.0 * length.log10());
        let reflectance = self.reflectance(surface, triangle, corner);
        let level = (source - spreading + self.gains()) * reflectance;
        let terms = Terms { source, spreading, interfaces: 0.0, reflectance, level };
        let point = PrintedPoint {
            ray: way.ray,
            range: (way.path + length) as f32,
            intensity: (level / source) as f32,
            place: (way.place + way.direction * length).as_vec3(),
            direction: way.direction.as_vec3(),
            normal: hits.normal(lane),
            surface,
            triangle,
            corner,
        };
        Some((terms, point))
    }

    /// Makes a cloud from the points.
    fn collect(&self, points: Vec<PrintedPoint>, cloud: &mut PointCloud) -> Result<()> {
        let options = self.options;
        let rows = if options.organised { self.fan.len() } else { points.len() };
        cloud.columns.resize(options.fields, rows)?;
        let mut points = points.into_iter().peekable();
        for row in 0..rows {
            let ray = if options.organised { row } else { points.peek().map_or(row, |point| point.ray as usize) };
            let point = points.next_if(|point| point.ray as usize == ray);
            self.fill(&mut cloud.columns, row, ray, point.as_ref());
        }
        cloud.len = rows;
        cloud.fields = options.fields;
        cloud.frame = options.coordinates;
        cloud.origin = if options.coordinates == Frame::World { self.scene.origin } else { DVec3::ZERO };
        cloud.organised = options.organised.then_some([self.fan.rows, self.fan.columns]);
        cloud.sensor_pose = self.pose;
        cloud.start_time = Some(options.start_time);
        // A level has no full-scale value; that of the program's ratio is 1.
        cloud.intensity_full_scale = (options.profile == Profile::Blainder).then_some(1.0);
        cloud.driver = None;
        cloud.scan_line = None;
        cloud.labels = self.scene.surfaces.labels.clone();
        Ok(())
    }

    /// Writes the row of a `ray`.
    fn fill(&self, columns: &mut Columns, row: usize, ray: usize, point: Option<&PrintedPoint>) {
        let launch = self.fan.direction(ray);
        let [azimuth, elevation] = azimuth_elevation(launch.to_array());
        columns.start_row(row);
        put!(columns, row,
            azimuth: azimuth,
            elevation: elevation,
            channel: self.fan.channel[ray],
            ring: self.fan.channel[ray],
            time: self.options.start_time,
            frame: self.options.frame,
            strip: self.options.strip,
            beam: ray as u32,
            firing: self.options.frame,
            return_number: u8::from(point.is_some()),
            return_count: u8::from(point.is_some()),
        );
        let Some(point) = point else { return };
        let rotation = self.pose.rotation();
        let met = rotation.transpose() * (point.place.as_dvec3() - self.place());
        // The paper's point is in the direction in which the ray left, the program's where the surface is.
        let own = match self.options.profile {
            Profile::Blainder => met,
            _ => launch.as_dvec3().normalize() * f64::from(point.range),
        };
        let normal = point.normal.normalize_or_zero() * -point.direction.dot(point.normal).signum();
        let to_sensor = rotation.transpose().as_mat3();
        let (place, truth, facing) = match (self.options.coordinates, self.options.profile) {
            (Frame::Sensor, _) => (own.as_vec3(), met.as_vec3(), to_sensor * normal),
            (Frame::World, Profile::Blainder) => {
                (self.flattened(launch, point).unwrap_or(point.place), point.place, normal)
            }
            (Frame::World, _) => ((rotation * own + self.place()).as_vec3(), point.place, normal),
        };
        let surface = &self.scene.surfaces.rows[point.surface as usize];
        put!(columns, row,
            x: place.x,
            y: place.y,
            z: place.z,
            range: point.range,
            depth: own.x as f32,
            intensity: point.intensity,
            cos_incidence: (-point.direction.dot(normal)).clamp(0.0, 1.0),
            true_x: truth.x,
            true_y: truth.y,
            true_z: truth.z,
            true_range: point.range,
            normal_x: facing.x,
            normal_y: facing.y,
            normal_z: facing.z,
            category_id: surface.category_id,
            part_id: surface.part_id,
            instance_id: surface.instance_id,
            track_id: surface.instance_id,
            material_id: surface.material_id,
            first_category_id: surface.category_id,
            first_instance_id: surface.instance_id,
        );
        if !(columns.red.is_empty() && columns.green.is_empty() && columns.blue.is_empty()) {
            let [red, green, blue] = self.scene.surfaces.rgb(surface, point.triangle, point.corner);
            put!(columns, row, red: red, green: green, blue: blue);
        }
    }
}

impl Printed<'_> {
    /// Where the program puts a `point` of a ray that leaves along `launch` (sensor frame) if it puts them into one
    /// plane, relative to the scene's origin, m; `None`: it does not.
    fn flattened(&self, launch: Vec3, point: &PrintedPoint) -> Option<Vec3> {
        let range = f64::from(point.range);
        let place = match self.flat? {
            // What the program calls the travelled distance is the straight one from the start: it decreases on the way
            // back.
            Flat::Waterfall => {
                let travelled = self.pose.position.distance(self.start);
                let starboard = f64::from(-launch.y.signum());
                DVec3::new(starboard * range, travelled, self.start.z) - self.scene.origin
            }
            Flat::Plan => self.place() + point.direction.truncate().as_dvec2().normalize_or_zero().extend(0.0) * range,
        };
        Some(place.as_vec3())
    }
}

/// `water` as in the paper and its program: eq. 8 gives sound speeds from temperatures, and neither has absorption.
pub(super) fn printed_water(water: Water) -> Water {
    Water { sound_speed: SoundSpeed::Medwin, absorption: Absorption::None, ..water }
}

/// Checks what the program requires beyond what every sonar has.
fn check_for_program(acoustics: &AcousticsSpec, water: Option<&Water>) -> Result<()> {
    if acoustics.source_level_db <= 0.0 {
        let allowed = "above 0 with profile blainder, whose intensities are ratios to it";
        return Err(Error::invalid("acoustics.source_level_db", acoustics.source_level_db, allowed));
    }
    let found = match water.and_then(|water| water.profile.as_ref()) {
        Some(SoundSpeedProfile::Cast(_)) => "cast",
        Some(SoundSpeedProfile::Ts(_)) => "ts",
        _ => return Ok(()),
    };
    Err(Error::invalid("water.profile", found, "layers or constant with profile blainder, which supports no other"))
}

/// A ray of the program while it is traced.
#[derive(Clone, Copy, Debug)]
struct ProgramRay {
    ray: u32,
    /// Where it enters the layer, relative to the scene's origin, m, and its unit direction there.
    place: DVec3,
    direction: DVec3,
    /// Depth per metre of path at launch.
    fall: f64,
    /// Length to the end of the layer, as computed by the program, m.
    length: f64,
    /// Length up to the layer, and what is left of the maximum range, m.
    path: f64,
    left: f64,
    /// Source level after the interfaces on the way, dB.
    source_level: f64,
}

impl ProgramRay {
    fn new(ray: u32, place: DVec3, direction: DVec3, reach: f64, source_level: f64) -> ProgramRay {
        ProgramRay { ray, place, direction, fall: -direction.z, length: 0.0, path: 0.0, left: reach, source_level }
    }

    /// Passes into the `next` layer, at the end of the `length` that results from the layer's thickness and the
    /// direction at launch, whatever the direction is by now; returns whether it continues. The source level is
    /// multiplied by the transmitted fraction of the power (eq. 13), although it is in dB. On total reflection the
    /// direction is not a number in the program, and the ray is lost.
    fn enter(&mut self, slab: &Slab, next: &Slab) -> bool {
        self.left -= self.length;
        self.path += self.length;
        self.place += self.direction * self.length;
        let fluid = |slab: &Slab| Fluid::new(slab.density, slab.speed);
        self.source_level *= fluid(slab).transmittance(&fluid(next), -self.direction.z);
        let ratio = next.speed / slab.speed;
        let [x, y] = [ratio * self.direction.x, ratio * self.direction.y];
        self.direction = DVec3::new(x, y, -(1.0 - x * x - y * y).sqrt());
        self.left >= 0.0 && self.direction.is_finite()
    }
}

/// The rays of a sonar. For a side-scan sonar a row for each side, from the lowest ray up: the fans of the paper, or
/// rays spread evenly over the vertical width; for others the axes of the beams.
fn fan(sensor: &Sensor, program: bool, wavelength: f64) -> Result<Arc<BeamTable>> {
    let Pattern::Sidescan(sonar) = &sensor.spec().pattern else { return Ok(sensor.beams.clone()) };
    let sides = sonar.azimuths_deg();
    let (count, [low, high]) = elevations(sonar, program, wavelength);
    let mut fan = BeamTable::with_size(sides.len(), count, FiringOrder::Frame, sensor.beams.period)?;
    for (channel, azimuth) in (0..).zip(sides) {
        let side = azimuth.signum();
        for index in 0..count {
            let part = if count > 1 { index as f64 / (count - 1) as f64 } else { 0.0 };
            let (sin, cos) = (low + (high - low) * part).to_radians().sin_cos();
            fan.push([0.0, side * cos, sin], 0.0, channel);
        }
    }
    Ok(Arc::new(fan))
}

/// Number of rays of each side, and the elevations of the lowest and the highest, degrees.
fn elevations(sonar: &Sidescan, program: bool, wavelength: f64) -> (usize, [f64; 2]) {
    match sonar.down_fov_deg.zip(sonar.step_deg) {
        // The program truncates the count and then spreads the rays over the whole angle.
        Some((fov, step)) if program => {
            ((0.5 * fov / step + 1.0) as usize, [-90.0 + PROGRAM_NADIR_DEG, -90.0 + 0.5 * fov])
        }
        Some((fov, step)) => {
            let steps = (0.5 * fov / step + 1e-6).floor();
            (steps as usize + 1, [-90.0, -90.0 + steps * step])
        }
        None => {
            let (axis, half) = (sonar.axis_deg(), 0.5 * sonar.vertical_deg.at(wavelength).width().to_degrees());
            (sonar.rays as usize, [(axis - half).max(-90.0), (axis + half).min(90.0)])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sonar(keys: &str) -> Sensor {
        let text = format!(
            "name: side\nkind: sonar\npattern: {{{keys}}}\nacoustics: {{frequency_khz: 450, pulse_ms: 1}}\nrange: {{max_m: 100}}"
        );
        Sensor::from_yaml(&text, "").unwrap()
    }

    fn elevations_deg(keys: &str, program: bool) -> Vec<f64> {
        let fan = fan(&sonar(keys), program, 1500.0 / 450e3).unwrap();
        let row = (0..fan.columns as usize).map(|ray| fan.direction(ray));
        row.map(|direction| f64::from(direction.z.atan2(direction.y.abs())).to_degrees()).collect()
    }

    #[track_caller]
    fn assert_all_near(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
    }

    #[test]
    fn fans_begin_straight_down() {
        let keys = "type: sidescan, down_fov_deg: 90, step_deg: 20";
        assert_all_near(&elevations_deg(keys, false), &[-90.0, -70.0, -50.0]);
        // 45 / 20 + 1 is 3 after truncation, and the angle is divided in two: 22.5 degrees.
        assert_all_near(&elevations_deg(keys, true), &[-89.999, -67.4995, -45.0]);
        assert_all_near(&elevations_deg("type: sidescan, down_fov_deg: 20, step_deg: 30", true), &[-89.999]);
        let fan = fan(&sonar(keys), true, 1.0).unwrap();
        assert_eq!((fan.rows, fan.columns, &fan.channel[..]), (2, 3, &[0, 0, 0, 1, 1, 1][..]));
        assert!(fan.dir_y[..3].iter().all(|&y| y > 0.0) && fan.dir_y[3..].iter().all(|&y| y < 0.0));
    }

    #[test]
    fn other_fans_are_even_over_their_width() {
        let keys = "type: sidescan, tilt_deg: 30, vertical_deg: 40, rays: 9, sides: starboard";
        let expected: Vec<f64> = (0..9).map(|ray| -50.0 + 5.0 * f64::from(ray)).collect();
        assert_all_near(&elevations_deg(keys, false), &expected);
        // Not beyond straight down.
        let keys = "type: sidescan, tilt_deg: 80, vertical_deg: 60, rays: 9";
        assert_all_near(&elevations_deg(keys, true)[..1], &[-90.0]);
        assert_eq!(fan(&sonar("type: multibeam, beams: 7, swath_deg: 90"), true, 1.0).unwrap().columns, 7);
    }

    /// By hand: at 30 degrees from the vertical 10 m of depth are 11.547 m of path, and Snell's sine goes from 0.5 to
    /// 0.6.
    #[test]
    fn the_program_takes_the_first_direction_for_lengths() {
        let slab = |speed, density| Slab {
            top: 0.0,
            bottom: 10.0,
            speed,
            gradient: 0.0,
            density,
            absorption: 0.0,
            absorption_slope: 0.0,
        };
        let (upper, lower) = (slab(1500.0, 1000.0), slab(1800.0, 1000.0));
        let (sin, cos) = 30f64.to_radians().sin_cos();
        let mut way = ProgramRay::new(0, DVec3::ZERO, DVec3::new(0.0, sin, -cos), 100.0, 200.0);
        way.length = 10.0 / way.fall;
        assert!(way.enter(&upper, &lower));
        assert!((way.path - 11.547_005).abs() < 1e-6 && (way.left - 88.452_995).abs() < 1e-6);
        assert!((way.place - DVec3::new(0.0, 5.773_503, -10.0)).length() < 1e-6);
        assert!((way.direction - DVec3::new(0.0, 0.6, -0.8)).length() < 1e-12);
        assert!((way.fall - cos).abs() < 1e-12);
        // 4 a b / (a + b)^2 with a = 1500 x 0.8 and b = 1800 cos 30 deg.
        let (a, b) = (1200.0, 1800.0 * cos);
        assert!((way.source_level - 200.0 * 4.0 * a * b / ((a + b) * (a + b))).abs() < 1e-9);
        // sin 60 deg x 1.2 is more than 1.
        let mut flat = ProgramRay::new(0, DVec3::ZERO, DVec3::new(cos, 0.0, -sin), 100.0, 200.0);
        assert!(!flat.enter(&upper, &lower));
        let mut far = ProgramRay::new(0, DVec3::ZERO, DVec3::NEG_Z, 5.0, 200.0);
        far.length = 10.0;
        assert!(!far.enter(&upper, &upper));
    }

    #[test]
    fn what_the_program_does_not_know_is_refused() {
        let water = |profile: &str| {
            let text = format!("water: {{profile: {{{profile}}}}}");
            crate::medium::environment::Environment::from_yaml(&text).unwrap().water
        };
        let acoustics = sonar("type: sidescan").acoustics().unwrap().clone();
        let cast = water("cast: [{depth_m: 0, speed_m_s: 1500}, {depth_m: 9, speed_m_s: 1490}]");
        assert_eq!(
            check_for_program(&acoustics, cast.as_ref()).unwrap_err().to_string(),
            "water.profile is cast; allowed: layers or constant with profile blainder, which supports no other"
        );
        check_for_program(&acoustics, None).unwrap();
        check_for_program(&acoustics, water("constant: {speed_m_s: 1500}").as_ref()).unwrap();
        let silent = AcousticsSpec { source_level_db: 0.0, ..acoustics };
        let message = check_for_program(&silent, None).unwrap_err().to_string();
        assert!(message.starts_with("acoustics.source_level_db is 0; allowed: above 0"), "{message}");
    }
}
