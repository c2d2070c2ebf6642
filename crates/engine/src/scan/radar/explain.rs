//! One detection explained: the radar equation term by term, and the paths that contribute most to it.

use super::RadarRecord;
use super::points::PointWriter;
use super::setup::RadarSetup;
use crate::echo::radar::{RadarEcho, RadarRoute};
use crate::scan::ScanOptions;
use crate::sensor::Sensor;
use crate::trace::BuiltScene;
use ::radar::{PathPart, RadarDetections, SeenBy};
use cloud::PointCloud;
use emitter::Trajectory;
use emitter::pattern::Pattern;
use ground::angle::{azimuth_elevation, direction};
use ground::error::{Error, Result};
use ground::lanes::MEDIUM;
use std::f64::consts::PI;
use std::fmt::Write as _;

/// Paths that are listed.
const MOST_PATHS: usize = 12;

/// A detection that is to be explained.
pub(super) struct Explanation {
    /// Its number among those of the frame.
    pub number: usize,
    /// What is said of it, once it is found.
    pub text: String,
}

impl BuiltScene {
    /// Explains one detection of a frame, see [`BuiltScene::explain`].
    pub(in crate::scan) fn explain_radar(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        number: u32,
    ) -> Result<String> {
        let setup = RadarSetup::new(self, sensor, trajectory, options)?;
        let mut explanation = Explanation { number: number as usize, text: String::new() };
        let mut cloud = PointCloud::default();
        self.0.engine.install(|| match sensor.spec().pattern {
            Pattern::RadarRotor(_) => setup.turn(&mut cloud, Some(&mut explanation)),
            _ => setup.frame(RadarRecord::default(), &mut cloud, Some(&mut explanation)),
        })?;
        if explanation.number < cloud.len() {
            return Ok(explanation.text);
        }
        let allowed = match cloud.len().checked_sub(1) {
            Some(last) => format!("0 to {last}, a detection of the frame"),
            None => "none: nothing is detected in the frame".to_owned(),
        };
        Err(Error::invalid("detection", number, allowed))
    }
}

impl Explanation {
    /// Explains the detection if it is among `detections`, of which the first has number `first` in the frame.
    pub fn add(&mut self, writer: &PointWriter, detections: &RadarDetections, first: usize) -> Result<()> {
        let Some(row) = self.number.checked_sub(first).filter(|row| *row < detections.len()) else { return Ok(()) };
        let parts = writer.parts(detections, row)?;
        let text = &mut self.text;
        let mut write = || {
            writer.write_detection(text, self.number, detections, row)?;
            writer.write_equation(text, detections, row)?;
            writer.write_paths(text, detections, row, &parts)
        };
        write().map_err(|error| Error::Internal(error.to_string()))
    }
}

impl PointWriter<'_> {
    /// What paths contribute to a detection, the strongest first.
    fn parts(&self, detections: &RadarDetections, row: usize) -> Result<Vec<PathPart>> {
        let (_, parts) = self.setup.sensor.radar()?;
        let own = parts.detector();
        let mut found = Vec::new();
        own.sharing.parts(detections, row, &self.truth.paths(), &mut found);
        parts.keep(own);
        found.sort_by(|a, b| b.power.total_cmp(&a.power).then(a.path.cmp(&b.path)));
        Ok(found)
    }

    fn write_detection(
        &self,
        text: &mut String,
        number: usize,
        detections: &RadarDetections,
        row: usize,
    ) -> std::fmt::Result {
        let (setup, moment) = (self.setup, self.moment);
        let [x, y, z] = moment.pose.position.to_array();
        let (name, frame) = (setup.sensor.name(), setup.options.frame);
        writeln!(
            text,
            "detection {number} of frame {frame} of {name}, at {:.4} s from {x:.3},{y:.3},{z:.3}",
            moment.time
        )?;
        let (beam, turned) = self.beam;
        if matches!(setup.sensor.spec().pattern, Pattern::RadarRotor(_)) {
            writeln!(text, "  row {beam} of the turn, at azimuth {:.2} deg", turned.to_degrees())?;
        }
        let [azimuth, elevation] = [detections.azimuth[row] + turned, detections.elevation[row]].map(f32::to_degrees);
        writeln!(
            text,
            "  reported: range {:.3} m, azimuth {azimuth:.2} deg, elevation {elevation:.2} deg (sensor frame), range rate \
             {:.3} m/s",
            detections.range[row], detections.velocity[row]
        )?;
        let [sigma_range, sigma_rate] = [detections.sigma_range[row], detections.sigma_velocity[row]];
        writeln!(
            text,
            "  noise alone makes range err by {sigma_range:.4} m, range rate by {sigma_rate:.4} m/s (1 sigma)"
        )?;
        let axes = setup.plan.axes();
        writeln!(
            text,
            "  cell {} of {} in range ({:.4} m each), {} of {} in range rate ({:.4} m/s each)",
            detections.range_cell[row],
            axes.range.len,
            axes.range.step,
            detections.velocity_cell[row],
            axes.velocity.len,
            axes.velocity.step
        )
    }

    fn write_equation(&self, text: &mut String, detections: &RadarDetections, row: usize) -> std::fmt::Result {
        let (setup, spec) = (self.setup, self.setup.spec);
        let (range, power) = (f64::from(detections.range[row]), f64::from(detections.power[row]));
        let own = direction([detections.azimuth[row], detections.elevation[row]]);
        let gain = |which: usize| 20.0 * f64::from(setup.plan.patterns[which].amplitude(own.to_array())).log10();
        let db = |value: f64| 10.0 * value.log10();
        let wavelength = spec.waveform.wavelength();
        writeln!(text, "radar equation, dB")?;
        let mut term = |name: &str, value: f64, words: &str| writeln!(text, "  {name:<6}{value:>10.2}  {words}");
        term("Pt", spec.power_dbm, "power of a transmitter, dBm")?;
        let lost = spec.power_dbm - db(setup.power) - 30.0;
        term("-L", -lost, "losses, of radome and water on it, too")?;
        term("Gt", gain(0), "gain of a transmitting element in that direction")?;
        term("Gr", gain(1), "gain of a receiving element")?;
        term("", db(wavelength * wavelength / (4.0 * PI).powi(3)), "lambda^2 / (4 pi)^3")?;
        term("", -db(range.powi(4)), "1 / R^4")?;
        term("RCS", self.cross_section_db(power, range, own).into(), "radar cross-section that follows, dBsm")?;
        term("Pr", db(power) + 30.0, "power in one channel, dBm")?;
        term("N", db(setup.noise) + 30.0, "noise in a cell of one channel, dBm")?;
        term("SNR", detections.snr_db[row].into(), "of the cell, all channels together")
    }

    fn write_paths(
        &self,
        text: &mut String,
        detections: &RadarDetections,
        row: usize,
        parts: &[PathPart],
    ) -> std::fmt::Result {
        let whole = detections.power[row];
        if parts.is_empty() {
            return writeln!(text, "paths\n  none contributes: noise, leakage or other radars");
        }
        let channels = self.setup.plan.array().places.len();
        let noise = self.setup.noise / channels as f64;
        let sum: f64 = parts.iter().map(|part| f64::from(part.power)).sum();
        writeln!(
            text,
            "paths\n  {} contribute, {:.2} dB of the measured power if their phases are random{}",
            parts.len(),
            10.0 * (sum / f64::from(whole)).log10(),
            if sum < noise { ", less than the noise does" } else { "" }
        )?;
        writeln!(
            text,
            "  {:>9} {:>9} {:>9} {:>9} {:>8} {:>8} {:>7}  what",
            "power dBm", "phase deg", "range m", "rate m/s", "azimuth", "elevat.", "bounces"
        )?;
        for part in parts.iter().take(MOST_PATHS) {
            let echo = self.echoes.one(self.truth.echo[part.path as usize] as usize);
            let [azimuth, elevation] = azimuth_elevation(echo.rx.0.to_array()).map(f32::to_degrees);
            writeln!(
                text,
                "  {:>9.2} {:>9.1} {:>9.3} {:>9.3} {azimuth:>8.2} {elevation:>8.2} {:>7}  {}",
                10.0 * part.power.log10() + 30.0,
                echo.amplitude.arg().to_degrees(),
                echo.range,
                echo.range_rate,
                self.bounces(&echo),
                self.what(&echo, part)
            )?;
        }
        if parts.len() > MOST_PATHS {
            writeln!(text, "  ...")?;
        }
        Ok(())
    }

    /// Reflections on a path, that of the target included.
    fn bounces(&self, echo: &RadarEcho) -> usize {
        let mirrors = self.search.targets.get(echo.target as usize).map_or(0, |target| target.mirrors.len());
        1 + if echo.route == RadarRoute::Both { 2 * mirrors } else { mirrors }
    }

    /// The surface of a path, the mirrors on it, and how it is seen.
    fn what(&self, echo: &RadarEcho, part: &PathPart) -> String {
        let seen = match part.seen {
            SeenBy::MainLobe => "",
            SeenBy::SideLobe => "; in a side lobe",
            SeenBy::Alias => "; folded",
            SeenBy::Noise => "; below the noise",
        };
        if echo.row == MEDIUM {
            return format!("rain or snow{seen}");
        }
        let kind = self.truth.types[part.group as usize].name();
        let mirrors = self.search.targets.get(echo.target as usize).map_or(&[][..], |target| &target.mirrors);
        let by: Vec<String> = mirrors.iter().map(|&mirror| self.surface(self.search.mirrors[mirror].row)).collect();
        let way = match (echo.route, by.is_empty()) {
            (_, true) => String::new(),
            (RadarRoute::Both, _) => format!(", both ways by {}", by.join(", ")),
            _ => format!(", one way by {}", by.join(", ")),
        };
        format!("{kind}: {}, triangle {}{way}{seen}", self.surface(echo.row), echo.triangle)
    }

    /// Category, material and instance of a row of surfaces.
    fn surface(&self, row: u32) -> String {
        let surfaces = &self.setup.scene.0.surfaces;
        let Some(of) = surfaces.rows.get(row as usize) else { return "nothing".to_owned() };
        let category = surfaces.labels.category.name(of.category_id).unwrap_or("unlabelled");
        format!("{category} {} ({})", of.instance_id, surfaces.materials[of.material as usize].name)
    }
}
