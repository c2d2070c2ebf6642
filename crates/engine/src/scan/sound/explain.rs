//! One beam of a ping, explained step by step: the ray of its echo layer by layer, and the sonar equation term by term.

use super::contributors::LabelledCells;
use super::ping::PingMemory;
use super::plan::PingPlan;
use crate::echo::{NO_RAY, PingEcho};
use crate::medium::{End, RefractedRay, Spreading};
use crate::scan::ScanOptions;
use crate::sensor::Sensor;
use crate::trace::{Arrival, BuiltScene};
use cloud::cells::Track;
use cloud::{FieldSet, Ping};
use emitter::{ReceivingBeams, Trajectory};
use glam::Vec3;
use ground::error::{Error, Result};
use ground::lanes::MEDIUM;
use ground::math::{LOG2_PER_DB, log2};
use std::fmt::Write as _;

/// Layers that are listed; the others are summarised.
const MOST_LAYERS: usize = 40;

impl BuiltScene {
    /// Explains what one beam of a ping receives, see [`BuiltScene::explain`].
    pub(in crate::scan) fn explain_ping(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        beam: u32,
    ) -> Result<String> {
        let options = ScanOptions { fields: FieldSet::all(), ..options.clone() };
        let mut memory = PingMemory::default();
        let mut ping = Ping::default();
        let plan = memory.plan(&self.0, sensor, trajectory, &options)?;
        let beams = plan.transducer.beams();
        if beam as usize >= beams {
            return Err(Error::invalid("beam", beam, format!("0 to {}", beams - 1)));
        }
        self.0.engine.install(|| plan.run(&options, LabelledCells::All, &mut memory, &mut ping))?;
        let beam = beam as usize;
        let mut text = String::new();
        let written = plan.write_beam(&mut text, sensor, &ping, &memory, beam);
        written.map_err(|error| Error::Internal(error.to_string()))?;
        Ok(text)
    }
}

impl PingPlan<'_> {
    fn write_beam(
        &self,
        text: &mut String,
        sensor: &Sensor,
        ping: &Ping,
        memory: &PingMemory,
        beam: usize,
    ) -> std::fmt::Result {
        let layout = &*self.layout;
        let [azimuth, elevation] = layout.axes[beam].map(f32::to_degrees);
        let [x, y, z] = self.pose.position.to_array();
        let depth = self.column.surface_z - z;
        let beams = layout.beams();
        writeln!(
            text,
            "ping {} of {}, transmitted at {:.4} s: beam {beam} of {beams}",
            ping.number,
            sensor.name(),
            ping.time
        )?;
        writeln!(
            text,
            "  points to azimuth {azimuth:.2} deg, elevation {elevation:.2} deg (sensor frame), from {x:.3},{y:.3},{z:.3}"
        )?;
        let (frequency, bandwidth) = (self.acoustics.frequency(), self.acoustics.bandwidth());
        let speed = self.column.speed_at(depth);
        let absorption = self.column.mean_absorption(depth, depth);
        writeln!(text, "water")?;
        writeln!(
            text,
            "  the sonar is {depth:.2} m below the surface; sound speed {speed:.2} m/s there, assumed {:.2} m/s",
            layout.believed_speed
        )?;
        writeln!(
            text,
            "  {:.1} kHz, wavelength {:.3} mm, absorption there {:.2} dB/km",
            frequency * 1e-3,
            1e3 * speed / frequency,
            1e3 * absorption
        )?;
        let resolution = self.acoustics.resolution(layout.believed_speed);
        writeln!(
            text,
            "  bandwidth {:.2} kHz: resolution {resolution:.4} m, bins of {:.4} m",
            bandwidth * 1e-3,
            layout.bin_m
        )?;
        let [length, far] = self.transducer.far_field(speed / frequency);
        writeln!(
            text,
            "  a transducer of {length:.3} m: far-field beams, valid from {far:.2} m on; nearer, modelled as focused"
        )?;

        let found = self.strongest_cell(ping, memory, beam);
        let Some(((cell, bin), (echoes, index))) =
            found.and_then(|found| memory.strongest(found.0).map(|who| (found, who)))
        else {
            return writeln!(text, "echo\n  no ray of this beam hits anything within {:.1} m", layout.reach());
        };
        let (arrival, answer) = (&echoes.arrivals[index], &echoes.answers[index]);
        self.write_ray(text, arrival, self.rotation() * self.launched(echoes, index))?;
        self.write_echo(text, ping, arrival, answer, cell, bin)?;
        self.write_equation(text, ping, memory, arrival, beam, bin)?;
        let Some(Track { radial, velocity: Vec3 { x, y, z }, error, .. }) = ping.bottom_track else { return Ok(()) };
        writeln!(text, "velocity over ground")?;
        writeln!(text, "  the range of this beam grows by {:.4} m/s", radial[beam])?;
        writeln!(text, "  the sonar moves at {x:.4},{y:.4},{z:.4} m/s in its own frame, error velocity {error:.4} m/s")
    }

    /// Cell and bin of what the beam reports, or else of its strongest echo.
    fn strongest_cell(&self, ping: &Ping, memory: &PingMemory, beam: usize) -> Option<(usize, usize)> {
        let bins = self.layout.bins;
        if let Some(sounding) = ping.soundings.iter().find(|sounding| sounding.beam as usize == beam) {
            let cell = sounding.cell as usize;
            let near = (0..8).flat_map(|step| [cell + step, cell.saturating_sub(step)]);
            // The echo's middle may be between two rays.
            let found = near.into_iter().find(|&cell| cell / bins == beam && memory.strongest(cell).is_some());
            if let Some(cell) = found {
                return Some((cell, cell % bins));
            }
        }
        let levels = ping.levels(beam);
        let received =
            (self.layout.first_bin..bins).filter(|&bin| memory.strongest(self.layout.cell(beam, 0, bin)).is_some());
        let bin = received.max_by(|&a, &b| levels[a].total_cmp(&levels[b]))?;
        Some((self.layout.cell(beam, 0, bin), bin))
    }

    /// Whether an arrival is that of a target that scatters as a whole, along a ray of its own.
    fn is_target(&self, arrival: &Arrival) -> bool {
        arrival.order == 0
            && arrival.surface != MEDIUM
            && self.backscatter.is_whole(&self.scene.surfaces, arrival.surface)
    }

    fn write_ray(&self, text: &mut String, arrival: &Arrival, world: Vec3) -> std::fmt::Result {
        let grazing = (-world.z).asin().to_degrees();
        let heading = world.y.atan2(world.x).to_degrees();
        let name = match arrival.ray {
            NO_RAY if self.is_target(arrival) => "ray to a target".to_owned(),
            NO_RAY => "a separate ray to a body".to_owned(),
            ray => format!("ray {ray} of {}", self.transducer.rays()),
        };
        writeln!(
            text,
            "{name}, the strongest here: leaves {grazing:.3} deg below the horizontal, azimuth {heading:.3} deg (world)"
        )?;
        let depth = self.column.surface_z - self.pose.position.z;
        let slabs = &self.column.slabs;
        let direction = world.as_dvec3().normalize();
        let start = [-direction.z, direction.x.hypot(direction.y)];
        let mut ray = RefractedRay::launch(depth, start, slabs, self.column.slab_at(depth));
        let total = f64::from(arrival.path);
        writeln!(
            text,
            "  {:>8} {:>8} {:>10} {:>9} {:>9} {:>10} {:>10} {:>9}",
            "from m", "to m", "speed m/s", "angle deg", "to deg", "length m", "time ms", "loss dB"
        )?;
        let angle = |ray: &RefractedRay| ray.sine.atan2(ray.snell * ray.speed).to_degrees();
        for layer in 0.. {
            let slab = &slabs[ray.slab];
            let (length, end) = ray.exit(slab);
            let (length, end) =
                if ray.path + length >= total { (total - ray.path, End::Inside) } else { (length, end) };
            let after = ray.advanced(slab, length);
            if layer < MOST_LAYERS {
                writeln!(
                    text,
                    "  {:>8.2} {:>8.2} {:>10.2} {:>9.3} {:>9.3} {:>10.3} {:>10.4} {:>9.3}",
                    ray.depth,
                    after.depth,
                    ray.speed,
                    angle(&ray),
                    angle(&after),
                    length,
                    1e3 * (after.time - ray.time),
                    after.loss() - ray.loss()
                )?;
            } else if layer == MOST_LAYERS {
                writeln!(text, "  ...")?;
            }
            ray = after;
            match end {
                End::Inside => break,
                End::Top if ray.slab == 0 => {
                    if arrival.order == 0 {
                        break;
                    }
                    writeln!(text, "  mirrored by the sea surface")?;
                    (ray.depth, ray.sine) = (0.0, -ray.sine.abs());
                    ray.mirror(slab);
                }
                end => {
                    let (before, loss) = (ray.slab, ray.loss());
                    ray.cross(slabs, end);
                    if ray.slab == before {
                        writeln!(text, "  reflected totally at {:.2} m", ray.depth)?;
                    } else if ray.loss() > loss {
                        writeln!(
                            text,
                            "  boundary at {:.2} m: {:.5} dB are not transmitted",
                            ray.depth,
                            ray.loss() - loss
                        )?;
                    }
                }
            }
            // Reflections by the scene turn the ray, which is not followed here.
            if arrival.order > 0 && ray.depth > depth.max(0.0) + total {
                break;
            }
        }
        if arrival.order > 0 {
            writeln!(
                text,
                "  {} reflections on the path; layers are listed up to the first by the scene",
                arrival.order
            )?;
        }
        Ok(())
    }

    fn write_echo(
        &self,
        text: &mut String,
        ping: &Ping,
        arrival: &Arrival,
        answer: &PingEcho,
        cell: usize,
        bin: usize,
    ) -> std::fmt::Result {
        let cells = &ping.cells;
        let place = [cells.true_x[cell], cells.true_y[cell], cells.true_z[cell]].map(f64::from);
        let [x, y, z] = (self.scene.origin + glam::DVec3::from(place)).to_array();
        let labels = &self.scene.surfaces.labels;
        let name = match self.scene.surfaces.rows.get(arrival.surface as usize) {
            None if arrival.surface == MEDIUM => "the surface of the water".to_owned(),
            None => "nothing".to_owned(),
            Some(row) => {
                let category = labels.category.name(row.category_id).unwrap_or("unlabelled");
                let material = &self.scene.surfaces.materials[row.material as usize].name;
                format!("{category} ({material})")
            }
        };
        let one_way = f64::from(arrival.range) / self.layout.believed_speed;
        writeln!(text, "echo")?;
        writeln!(
            text,
            "  hit: {name} at {x:.3},{y:.3},{z:.3}, after {:.3} m and {:.4} ms one way",
            arrival.path,
            1e3 * one_way
        )?;
        let grazing = f64::from(cells.cos_incidence[cell]).asin().to_degrees();
        writeln!(
            text,
            "  grazing angle {grazing:.2} deg, sound speed there {:.5} times that at the sonar",
            arrival.speed
        )?;
        let reported = self.layout.range(bin);
        writeln!(
            text,
            "  reported range {reported:.3} m (bin {bin}), of this ray {:.3} m: travel time times the assumed sound speed",
            answer.range
        )
    }

    fn write_equation(
        &self,
        text: &mut String,
        ping: &Ping,
        memory: &PingMemory,
        arrival: &Arrival,
        beam: usize,
        bin: usize,
    ) -> std::fmt::Result {
        let layout = &*self.layout;
        let acoustics = self.acoustics;
        let source = acoustics.source_level_db;
        let [upright, level] = arrival.tube.map(f64::from);
        let spreading = self.spreading_db(arrival, upright * level);
        let loss = f64::from(arrival.loss);
        let sine = (arrival.direction.dot(arrival.normal).abs() / arrival.normal.length()).clamp(1e-3, 1.0);
        let is_target = self.is_target(arrival);
        let surfaces = &self.scene.surfaces;
        let strength = match is_target {
            true => f64::from(self.backscatter.target_strength(surfaces, arrival.surface) / LOG2_PER_DB),
            false => self.backscatter.strength_db(surfaces, arrival, sine),
        };
        let mean = 10.0 * self.mean_power(memory, beam, bin).max(1e-300).log10();
        let answered = mean - source + 2.0 * (spreading + loss);
        let area = answered - strength;
        let in_phase = arrival.ray == NO_RAY && self.backscatter.smooth(surfaces, arrival.surface).is_some();
        writeln!(text, "sonar equation, dB")?;
        let mut term = |name: &str, value: f64, words: String| writeln!(text, "  {name:<6}{value:>10.2}  {words}");
        term("SL", source, "source level, re 1 uPa at 1 m".into())?;
        term(
            "-2TL",
            -2.0 * (spreading + loss),
            format!("spreading {spreading:.2} and absorption, boundaries, reflections {loss:.2}, one way"),
        )?;
        if is_target {
            term("TS", strength, "target strength, re 1 m2".into())?;
            term("B", area, "transmit and receive patterns in its direction, and echoes received with it".into())?;
            term("EL", mean, "mean echo level: SL - 2TL + TS + B".into())?;
        } else if in_phase {
            let words = "target strength of smooth facets in phase, and the beam's pattern in their direction";
            term("TS+B", answered, words.into())?;
            term("EL", mean, "echo level: SL - 2TL + TS + B".into())?;
        } else {
            term("S", strength, "backscatter of the surface at this angle, per m2".into())?;
            term(
                "A",
                area,
                format!(
                    "{:.2e} m2 that the beam receives in a resolution cell, weighted by its pattern",
                    10f64.powf(area / 10.0)
                ),
            )?;
            term("EL", mean, "mean echo level: SL - 2TL + S + A".into())?;
        }
        let received = f64::from(ping.levels(beam)[bin]);
        term("", received, "level of the cell, with speckle and noise".into())?;
        let directivity = acoustics.directivity_index_db.unwrap_or(self.transducer.directivity_db);
        let gain = acoustics.processing_gain();
        let noise = f64::from(layout.noise_db);
        let window = 10.0 * acoustics.taper.resolutions().log10();
        term("NL", noise + directivity + gain - window, "noise in the bandwidth".into())?;
        term("-DI", -directivity, "directivity index".into())?;
        term("-PG", -gain, "processing gain".into())?;
        if window > 0.0 {
            term("W", window, "additional noise passed by the tapered filter".into())?;
        }
        term("N", noise, "noise in the cell: all of these".into())?;
        if let Some(&volume) = self.volume.get(bin) {
            let level = 10.0 * f64::from(volume * self.transducer.solid_angles[beam]).log10();
            term("RL", level, "volume reverberation of open water, over the beam's whole solid angle".into())?;
        }
        let threshold = f64::from(layout.threshold_db[bin]);
        term("DT", acoustics.detection_threshold_db, format!("detection threshold: reported above {threshold:.2}"))?;
        let excess = received - threshold;
        let words = if excess > 0.0 { "signal excess: it is reported" } else { "signal excess: it is not reported" };
        term("SE", excess, words.into())
    }
}

impl PingPlan<'_> {
    /// One-way spreading loss of an arrival, dB.
    fn spreading_db(&self, arrival: &Arrival, tube: f64) -> f64 {
        if self.water.spreading == Spreading::RayTube {
            return 10.0 * (tube / f64::from(arrival.speed)).max(1.0).log10();
        }
        f64::from(self.water.spreading.one_way(log2(arrival.path), self.water.spreading_from()) / LOG2_PER_DB)
    }

    /// Mean power that a beam receives in a bin, uPa^2: all parts of all rays, weighted by the response.
    fn mean_power(&self, memory: &PingMemory, beam: usize, bin: usize) -> f64 {
        let mut sum = 0.0;
        for echoes in memory.all_echoes() {
            for answer in &echoes.answers {
                let ReceivingBeams { first, from, to, .. } = self.transducer.receiving_beams[answer.receiving as usize];
                let Some(place) = beam.checked_sub(first as usize).filter(|&place| place < (to - from) as usize) else {
                    continue;
                };
                let loud = f64::from(self.transducer.beam_gain[from as usize + place]);
                for part in 0..answer.parts {
                    let tap = self.response.power_at(bin.abs_diff((answer.bin + part) as usize));
                    sum += loud * loud * f64::from(echoes.energy[(answer.first + part) as usize]) * tap;
                }
            }
        }
        sum
    }
}
