//! What happens to one beam, as readable text.

use super::block::Block;
use super::gather::Gatherer;
use super::plan::ScanPlan;
use super::rounds::Evidence;
use super::split::Splitter;
use crate::sensor::{Adaptive, Signals};
use cloud::{Columns, FieldSet};
use glam::{DVec3, Vec3};
use ground::angle::azimuth_elevation;
use ground::cause::Cause;
use ground::error::Result;
use ground::lanes::{LANES, MEDIUM, MISS, boxed};
use ground::shown;
use std::fmt::{self, Write};
use std::ops::Range;
use std::sync::Arc;

/// Most surfaces and echoes of one kind that are listed.
const MOST: usize = 12;

impl ScanPlan<'_> {
    /// Explains beam `beam` step by step. `signals`: how echoes become returns.
    pub fn explain(&self, signals: &Arc<Signals>, beam: usize) -> Result<String> {
        // With the beams of its block: these affect whether it is split into several rays.
        let first = beam - beam % LANES;
        let count = LANES.min(self.aim.beams.len() - first);
        let mut block: Box<Block> = boxed();
        block.lanes.start_at(first);
        block.aim(self, first, count);
        let mut gatherer: Box<Gatherer> = boxed();
        gatherer.beams = block.rays.clone();
        let (mut signals, mut factors, mut evidence) = (signals, [1.0; LANES], vec![Evidence::default()]);
        if let Some(Adaptive { one_ray, .. }) = &signals.adaptive {
            let mut splitter: Box<Splitter> = boxed();
            if self.signals.is_some() {
                gatherer.fit(one_ray);
                gatherer.gather(self, &mut block.rays, &block.lanes.beam[..count], &[]);
                splitter.find(self, signals, gatherer.axes(first, count));
            }
            match splitter.found.iter().position(|&lane| usize::from(lane) == beam - first) {
                Some(found) => evidence = vec![splitter.evidence[found]],
                None => (signals, factors) = (one_ray, [splitter.oblique[beam - first]; LANES]),
            }
        }
        gatherer.fit(signals);
        gatherer.log = Some(Vec::new());
        block.aim(self, beam, 1);
        gatherer.beams = block.rays.clone();
        gatherer.gather(self, &mut block.rays, &[beam as u32], &evidence);
        if signals.footprint.is_none() {
            gatherer.lower(&factors);
        }
        gatherer.form(self, 0, beam);
        let mut columns = Columns::default();
        columns.resize(FieldSet::all(), count * self.most_returns())?;
        let all = self.window(first..first + count, 0, &mut columns);
        let of_beam = |other: &u32| *other as usize == beam;
        let from = columns.beam[..all].iter().position(of_beam).unwrap_or(all);
        let rows = from..from + columns.beam[from..all].iter().take_while(|other| of_beam(other)).count();
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_beam(&mut text, signals, &mut gatherer, beam, &columns, rows);
        Ok(text)
    }

    fn write_beam(
        &self,
        text: &mut String,
        signals: &Signals,
        gatherer: &mut Gatherer,
        beam: usize,
        columns: &Columns,
        rows: Range<usize>,
    ) -> fmt::Result {
        let table = self.aim.beams;
        let width = table.columns as usize;
        writeln!(
            text,
            "beam {beam}: row {}, column {}, channel {}, ring {}, fired {:.9} s after the start",
            beam / width,
            beam % width,
            table.channel[beam],
            self.aim.rings[usize::from(table.channel[beam])],
            self.options.start_time + table.time[beam],
        )?;
        let [azimuth, elevation] = azimuth_elevation([table.dir_x[beam], table.dir_y[beam], table.dir_z[beam]]);
        let (from, along) = (gatherer.beams.origin(0), gatherer.beams.direction(0));
        writeln!(text, "aim:")?;
        writeln!(
            text,
            "  azimuth {:.4} deg, elevation {:.4} deg; from {} m along {:.6} {:.6} {:.6} in the world",
            azimuth.to_degrees(),
            elevation.to_degrees(),
            self.place(from),
            along.x,
            along.y,
            along.z
        )?;
        let [low, high] = self.receiver.gate.limits(beam as u32);
        writeln!(text, "  ranges from {low} to {high} m are reported")?;
        self.write_rays(text, signals, gatherer)?;
        self.write_paths(text, gatherer)?;
        self.write_air(text, gatherer)?;
        self.write_halos(text, gatherer)?;
        self.write_echoes(text, signals, gatherer, beam, &columns.true_range[rows.clone()])?;
        self.write_returns(text, columns, rows)
    }

    /// What the rays hit, surface by surface.
    fn write_rays(&self, text: &mut String, signals: &Signals, gatherer: &Gatherer) -> fmt::Result {
        match &signals.footprint {
            None => writeln!(text, "ray: one, along the beam")?,
            Some(footprint) if gatherer.rays.is_patched => {
                let sent = gatherer.rays.patchworks[0].traced();
                writeln!(text, "rays: {sent}, which show what {} points of the footprint hit", footprint.count())?;
            }
            Some(footprint) => writeln!(text, "rays: {} over the footprint", footprint.count())?,
        }
        // Surface, number of rays or points, their ranges, their power, and the index of the first.
        let mut met: Vec<(u32, usize, [f32; 2], f32, u32)> = Vec::new();
        for (index, ray) in gatherer.rays.of_beam(0) {
            let (surface, power, points) = (ray.surface(), ray.power(), ray.points() as usize);
            let [near, far] = ray.ends();
            match met.iter_mut().find(|(known, ..)| *known == surface) {
                Some((_, count, [low, high], sum, _)) => {
                    (*low, *high) = (low.min(near), high.max(far));
                    (*count, *sum) = (*count + points, *sum + power);
                }
                None => met.push((surface, points, [near, far], power, index)),
            }
        }
        for &(surface, count, [low, high], power, first) in met.iter().take(MOST) {
            let meet = if count == 1 { "hits" } else { "hit" };
            if surface == MISS {
                writeln!(text, "  {count} {meet} nothing")?;
                continue;
            }
            let Some(ray) = gatherer.rays.get(first, 0) else { continue };
            let cos = ray.cos_incidence();
            let ranges = if high > low { format!("{low:.4} to {high:.4}") } else { format!("{low:.4}") };
            writeln!(
                text,
                "  {count} {meet} {} at {ranges} m, incidence {:.2} deg",
                self.name(surface),
                cos.acos().to_degrees()
            )?;
            let material = &self.world.scene.surfaces.rows[surface as usize].material;
            let material = &self.world.scene.surfaces.materials[*material as usize];
            let returned = material.returned(self.world.reflectances.wavelength_nm, self.world.reflectances.source);
            let value = if returned.by_image { "by image".into() } else { format!("{:.3}", returned.value) };
            writeln!(
                text,
                "    reflectance {value} at {} nm, {}",
                self.world.reflectances.wavelength_nm, returned.why
            )?;
            let depth = self
                .world
                .air
                .map_or(0.0, |air| air.depth(gatherer.beams.origin(0), gatherer.beams.direction(0), 0.0, ray.range()));
            if depth > 0.0 {
                let two_way = (-2.0 * depth).exp();
                let depth = number(depth);
                writeln!(text, "    weather: optical depth {depth}, two-way transmittance {two_way:.6}")?;
            }
            let send = if count == 1 { "returns" } else { "return" };
            if self.world.paths.is_some() && self.goes_on(surface) {
                writeln!(text, "    light continues from there along the paths below, and returns along them")?;
            } else if power > 0.0 {
                writeln!(text, "    {send} rho_eff T / R^2 = {power:.4e} /m^2 in all")?;
            } else {
                writeln!(text, "    {send} nothing directly")?;
            }
        }
        Ok(())
    }

    /// Where light goes by mirrors and through glass.
    fn write_paths(&self, text: &mut String, gatherer: &Gatherer) -> fmt::Result {
        let log = gatherer.log.as_deref().unwrap_or_default();
        if log.is_empty() {
            return Ok(());
        }
        writeln!(text, "paths by mirrors and through glass, generation by generation:")?;
        for meeting in log.iter().take(4 * MOST) {
            let way = match meeting.cause {
                Cause::Mirror => " in a mirror",
                Cause::Glass => " through glass",
                _ => "",
            };
            let events = if meeting.bounces == 1 { "event" } else { "events" };
            writeln!(
                text,
                "  {:indent$}after {} {events}{way}: {} at {} m, range {:.4} m, incidence {:.2} deg, {:.4} of the light is left",
                "",
                meeting.bounces,
                self.name(meeting.surface),
                self.place(meeting.place),
                meeting.range,
                meeting.cos_incidence.acos().to_degrees(),
                meeting.part * (-meeting.depth).exp(),
                indent = 2 * usize::from(meeting.bounces)
            )?;
        }
        if log.len() > 4 * MOST {
            writeln!(text, "  and {} more", log.len() - 4 * MOST)?;
        }
        Ok(())
    }

    /// Echoes of the air.
    fn write_air(&self, text: &mut String, gatherer: &Gatherer) -> fmt::Result {
        let arrivals = &gatherer.arrivals;
        let mut echoes: Vec<(f32, f32, Cause)> = arrivals
            .all()
            .filter(|(.., from)| from.surface == MEDIUM)
            .map(|(range, power, from)| (range, power, from.cause))
            .collect();
        if echoes.is_empty() {
            return Ok(());
        }
        echoes.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
        writeln!(text, "air:")?;
        for (range, power, cause) in echoes.iter().take(MOST) {
            writeln!(text, "  {} at {range:.4} m returns {power:.4e} /m^2", cause.name())?;
        }
        if echoes.len() > MOST {
            writeln!(text, "  and {} more", echoes.len() - MOST)?;
        }
        Ok(())
    }

    /// Light of bright surfaces beside the beam.
    fn write_halos(&self, text: &mut String, gatherer: &Gatherer) -> fmt::Result {
        let echoes = || gatherer.arrivals.all().filter(|(.., from)| from.cause == Cause::Multipath);
        if echoes().next().is_some() {
            writeln!(text, "blooming:")?;
        }
        for (range, power, from) in echoes() {
            writeln!(text, "  {} at {range:.4} m adds {power:.4e} /m^2", self.name(from.surface))?;
        }
        Ok(())
    }

    /// The maxima of the signal, and which of them are reported: those at the ranges `returns`.
    fn write_echoes(
        &self,
        text: &mut String,
        signals: &Signals,
        gatherer: &mut Gatherer,
        beam: usize,
        returns: &[f32],
    ) -> fmt::Result {
        let [low, high] = self.receiver.gate.limits(beam as u32);
        match self.receiver.gate.threshold.least_power() {
            Some(k) => writeln!(text, "echoes, of which those of {k:.4e} /m^2 and more are detected:")?,
            None => writeln!(text, "echoes:")?,
        }
        let chosen = gatherer.found.chosen.clone();
        let seen = gatherer.found.peaks.clone();
        let all = if self.receiver.camera().is_some() { seen.clone() } else { gatherer.all_peaks(self, 0) };
        if all.is_empty() {
            writeln!(text, "  none")?;
        }
        for peak in all {
            let Some(place) = seen.iter().position(|other| other == &peak) else {
                let because = if (low..=high).contains(&peak.range) { "too weak" } else { "out of range" };
                writeln!(text, "  {:.4} m, {:.4e} /m^2: {because}", peak.range, peak.power)?;
                continue;
            };
            let found = gatherer.trace_back(self, 0, beam, peak);
            let from = &found.provenance;
            let source = if from.surface == MEDIUM { from.cause.name().into() } else { self.name(from.surface) };
            let mixed = if found.mixed { ", mixed with others" } else { "" };
            let reported = match chosen.contains(&place) {
                false => "detected, not selected",
                true if returns.contains(&found.peak.range) => "reported",
                true => "lost: at random, or measured out of range",
            };
            writeln!(
                text,
                "  {:.4} m, {:.4e} /m^2, rho_eff {:.4}, of {source}{mixed}: {reported}",
                peak.range,
                peak.power,
                peak.power * peak.range * peak.range
            )?;
        }
        // As sensor files spell it.
        let mode = serde_json::to_value(signals.rule.mode).unwrap_or_default();
        writeln!(text, "  returns.mode: {}", mode.as_str().unwrap_or_default())
    }

    /// A position in Embree's coordinates, in the world, m.
    fn place(&self, local: Vec3) -> String {
        // A negative 0 has no meaning to readers.
        let DVec3 { x, y, z } = ((self.world.scene.origin + local.as_dvec3()) * 1e4).round() / 1e4 + DVec3::ZERO;
        format!("{x:.4} {y:.4} {z:.4}")
    }

    /// Name of a surface.
    fn name(&self, surface: u32) -> String {
        let surfaces = &self.world.scene.surfaces;
        let Some(row) = surfaces.rows.get(surface as usize) else { return "nothing".into() };
        let labels = &surfaces.labels;
        let category = shown::text(labels.category.name(row.category_id).unwrap_or("an unlabelled object"));
        let material = shown::text(&surfaces.materials[row.material as usize].name);
        match &*material {
            "" => format!("{category} (instance {})", row.instance_id),
            material => format!("{category} (instance {}, material {material})", row.instance_id),
        }
    }

    /// What the instrument reports.
    fn write_returns(&self, text: &mut String, columns: &Columns, rows: Range<usize>) -> fmt::Result {
        writeln!(text, "returns:")?;
        if columns.range[rows.clone()].iter().all(|range| range.is_nan()) {
            return writeln!(text, "  none");
        }
        // 8-bit encodings count in whole numbers.
        let decimals = if self.measure.intensity.full_scale() == Some(255.0) { 0 } else { 4 };
        for row in rows {
            let error = (columns.range[row] - columns.true_range[row]) * 1e3;
            writeln!(
                text,
                "  {} of {}: range {:.4} m ({error:+.1} mm), intensity {:.decimals$}, cause {}, at {:.4} {:.4} {:.4}",
                columns.return_number[row],
                columns.return_count[row],
                columns.range[row],
                columns.intensity[row],
                Cause::from_number(columns.cause[row]).unwrap_or_default().name(),
                columns.x[row],
                columns.y[row],
                columns.z[row]
            )?;
            if self.measure.errors.measures_doppler() {
                writeln!(
                    text,
                    "    doppler {:.4} m/s, true radial velocity {:.4} m/s",
                    columns.doppler[row], columns.radial_velocity[row]
                )?;
            }
        }
        Ok(())
    }
}

/// `value`, 0 or more, with three digits; as a power of ten only where it is very small or large.
fn number(value: f32) -> String {
    if (1e-3..1e3).contains(&value) {
        let decimals = (2 - value.log10().floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_are_written_as_people_do() {
        let words = [0.425_8, 0.001_234, 12.345, 999.0, 1e-4, 1500.0].map(number);
        assert_eq!(words, ["0.426", "0.00123", "12.3", "999", "1.00e-4", "1.50e3"]);
    }
}
