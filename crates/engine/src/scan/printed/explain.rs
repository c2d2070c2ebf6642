//! Explanation of one ray of a sonar in the profiles of the paper and its program: what it hits, and the sonar equation
//! term by term.

use super::{Printed, PrintedChunk, PrintedPoint, Profile, SoundTracer, Terms};
use crate::scan::ScanOptions;
use crate::sensor::Sensor;
use crate::trace::{BuiltScene, Launch};
use emitter::Trajectory;
use ground::angle::azimuth_elevation;
use ground::error::{Error, Result};
use std::fmt::Write as _;

impl BuiltScene {
    /// Explains one ray, see [`BuiltScene::explain`].
    pub(in crate::scan) fn explain_printed(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        ray: u32,
    ) -> Result<String> {
        let printed = Printed::new(&self.0, sensor, trajectory, options)?;
        let rays = printed.fan.len();
        if ray as usize >= rays {
            return Err(Error::invalid("beam", ray, format!("0 to {}, a ray of the profile's fan", rays - 1)));
        }
        let mut text = String::new();
        let written = self.0.engine.install(|| printed.write_ray(&mut text, sensor, ray as usize));
        written.map_err(|error| Error::Internal(error.to_string()))?;
        Ok(text)
    }
}

impl Printed<'_> {
    fn write_ray(&self, text: &mut String, sensor: &Sensor, ray: usize) -> std::fmt::Result {
        let (profile, name) = (self.options.profile, self.options.profile.name());
        let launch = self.fan.direction(ray);
        let [azimuth, elevation] = azimuth_elevation(launch.to_array()).map(f32::to_degrees);
        let [x, y, z] = self.pose.position.to_array();
        let depth = self.column.surface_z - z;
        writeln!(
            text,
            "ray {ray} of {} of {} in the profile {name}, sent from {x:.3},{y:.3},{z:.3}",
            self.fan.len(),
            sensor.name()
        )?;
        writeln!(text, "  leaves towards azimuth {azimuth:.2} deg, elevation {elevation:.2} deg (sensor frame)")?;
        writeln!(
            text,
            "  the sonar is {depth:.2} m below the surface; sound speed {:.2} m/s there, {} layers of water",
            self.column.speed_at(depth),
            self.column.slabs.len()
        )?;
        let mut met = Vec::new();
        let mut chunk = PrintedChunk::default();
        if profile == Profile::Blainder {
            self.follow_as_program(ray..ray + 1, &mut chunk, &mut |terms, point| met.push((*terms, *point)));
        } else {
            let no_loss = |_: u32, _: f64| 0.0;
            let tracer = SoundTracer::new(self.scene, &self.column, self.tracer_limits(&no_loss));
            let directions = self.fan.directions(0, self.fan.len());
            let launch = Launch { directions, rotation: self.rotation(), place: self.place() };
            tracer.trace(&launch, ray..ray + 1, &mut chunk.tracer, &mut chunk.arrivals);
            met.extend(chunk.arrivals.iter().filter_map(|arrival| self.echo_as_paper(arrival)));
        }
        if met.is_empty() {
            let [near, far] = self.limits;
            return writeln!(text, "echo\n  it hits nothing from {near} to {far} m");
        }
        met.iter().try_for_each(|(terms, point)| self.write_echo(text, terms, point))
    }

    fn write_echo(&self, text: &mut String, terms: &Terms, point: &PrintedPoint) -> std::fmt::Result {
        let Terms { source, spreading, interfaces, reflectance, level } = *terms;
        let [noise, directivity, gain] = self.own_terms();
        let surfaces = &self.scene.surfaces;
        let row = &surfaces.rows[point.surface as usize];
        let material = &surfaces.materials[row.material as usize].name;
        let category = surfaces.labels.category.name(row.category_id).unwrap_or("unlabelled");
        let [x, y, z] = (point.place.as_dvec3() + self.scene.origin).to_array();
        let cosine = (point.direction.dot(point.normal) / point.normal.length().max(f32::MIN_POSITIVE)).abs();
        writeln!(
            text,
            "hit: {category} of the material {material:?} at {x:.3},{y:.3},{z:.3}, after {:.3} m",
            point.range
        )?;
        writeln!(text, "  cosine of incidence {cosine:.3}, which has no effect in this profile")?;
        let program = self.options.profile == Profile::Blainder;
        let how = if program { "as the program computes it" } else { "eq. 6 of the paper" };
        writeln!(text, "sonar equation, {how}, dB")?;
        writeln!(
            text,
            "  source level          {source:>9.2}{}",
            if program { "   after the interfaces" } else { "" }
        )?;
        let way = if program { "20 log of the path in the last layer" } else { "40 log of the path" };
        writeln!(text, "  spreading             {:>9.2}   {way}", -spreading)?;
        if !program {
            writeln!(text, "  interfaces (eq. 13)   {:>9.2}", -interfaces)?;
            writeln!(
                text,
                "  target strength       {:>9.2}   10 log of the reflectance {reflectance:.4}",
                10.0 * reflectance.log10()
            )?;
        }
        writeln!(text, "  noise level           {noise:>9.2}")?;
        writeln!(text, "  directivity index     {directivity:>9.2}")?;
        writeln!(text, "  processing gain       {gain:>9.2}")?;
        if program {
            writeln!(text, "  times the reflectance {reflectance:>9.4}")?;
        }
        let threshold = self.acoustics.detection_threshold_db;
        let found = if level > threshold { "above" } else { "not above" };
        writeln!(text, "  echo level            {level:>9.2}   {found} the threshold of {threshold} dB")
    }
}
