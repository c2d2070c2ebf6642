//! A turn of a rotating radar: a polar image, and what stands out in it.

use super::explain::Explanation;
use super::paths::FramePaths;
use super::points::PointWriter;
use super::setup::{RadarMoment, RadarSetup};
use super::truth::FrameTruth;
use crate::echo::radar::RadarEchoes;
use crate::trace::Search;
use ::radar::{DetectionTruth, RadarDetections};
use cloud::{FieldSet, PointCloud, PolarImage, RadarFrame};
use emitter::pattern::{Pattern, RadarRotor};
use ground::error::{Error, Result};
use ground::rng::Rng;
use std::f64::consts::PI;

/// Sectors of a turn, each of which is traced at its own time and pose.
const SECTORS: u32 = 16;

/// Widths of the beam on each side of which a row receives echoes.
const BEAMS: f64 = 3.0;

/// Decibels of the noise over the level that the image stores as 0, and step of its 8 bits.
const NOISE_DB: f64 = 10.0;
const STEP_DB: f32 = 0.5;

/// What a sector of the turn measured.
struct SectorResult {
    first: u32,
    moment: RadarMoment,
    search: Search,
    rows: Vec<RowResult>,
}

/// What a row of the turn measured.
#[derive(Default)]
struct RowResult {
    detections: RadarDetections,
    seen: Vec<DetectionTruth>,
    truth: Option<FrameTruth>,
    echoes: RadarEchoes,
}

impl RadarSetup<'_> {
    /// A turn: its polar image, and detections in `cloud`, of which one may be explained.
    pub fn turn(&self, cloud: &mut PointCloud, mut explanation: Option<&mut Explanation>) -> Result<RadarFrame> {
        let Pattern::RadarRotor(rotor) = &self.sensor.spec().pattern else {
            return Err(Error::Internal("a turn of a radar that does not rotate".into()));
        };
        let period = self.sensor.beams.period;
        self.scene.0.check_time(self.options.start_time, self.sensor.beams.last_time())?;
        let range = self.plan.axes().range;
        let count = rotor.azimuths;
        let mut image = PolarImage::default();
        image.range = range;
        image.floor_dbm = (10.0 * self.noise.log10() + 30.0 - NOISE_DB) as f32;
        image.step_db = STEP_DB;
        let azimuth = |row: u32| rotor.azimuth_deg(row).to_radians();
        image.azimuths = (0..count).map(azimuth).collect();
        image.times = (0..count).map(|row| self.options.start_time + self.row_time(rotor, row)).collect();
        image.levels = Vec::with_capacity(count as usize * range.len);
        *cloud = PointCloud::default();
        let per_sector = count.div_ceil(SECTORS);
        let mut paths = FramePaths::default();
        let mut sectors = Vec::with_capacity(SECTORS as usize);
        for first in (0..count).step_by(per_sector as usize) {
            let last = (first + per_sector).min(count);
            let middle = 0.5 * (azimuth(first) + azimuth(last - 1));
            let after = period * f64::from(first + last - 1) / f64::from(2 * count);
            let moment = self.moment(after, middle);
            let half = PI * f64::from(last - first) / f64::from(count) + BEAMS * self.beam();
            let high = self.elevation();
            self.find(&moment, [[-half, half], [-high, high]], &mut paths)?;
            let azimuths: Vec<f32> = paths.echoes.paths.rx_direction.iter().map(|[x, y, _]| y.atan2(*x)).collect();
            let mut rows = Vec::with_capacity((last - first) as usize);
            for row in first..last {
                let offset = azimuth(row) - middle;
                let near = |&at: &usize| (f64::from(azimuths[at]) - offset).abs() < BEAMS * self.beam();
                let echoes = paths.echoes.turned((0..azimuths.len()).filter(near), offset as f32);
                rows.push(self.row(row, &moment, &paths, echoes, &mut image.levels)?);
            }
            let search = std::mem::take(&mut paths.search);
            sectors.push(SectorResult { first, moment, search, rows });
        }
        for sector in &mut sectors {
            keep_peaks(sector, &image);
            for (row, result) in (sector.first..).zip(&sector.rows) {
                let Some(truth) = &result.truth else { continue };
                let mut own = PointCloud::default();
                let writer = PointWriter {
                    setup: self,
                    search: &sector.search,
                    echoes: &result.echoes,
                    truth,
                    moment: &RadarMoment { time: image.times[row as usize], ..sector.moment },
                    beam: (row, azimuth(row) as f32),
                    disturbance: None,
                };
                writer.write(&result.detections, &result.seen, &mut own)?;
                if let Some(explanation) = &mut explanation {
                    explanation.add(&writer, &result.detections, cloud.len())?;
                }
                if cloud.fields == FieldSet::EMPTY {
                    *cloud = own;
                } else {
                    cloud.columns.append(&own.columns);
                    cloud.len += own.len;
                }
            }
        }
        if cloud.fields == FieldSet::EMPTY {
            self.write_nothing(cloud)?;
        }
        let start = self.moment(0.0, 0.0);
        cloud.sensor_pose = start.carrier;
        let mut frame = RadarFrame::default();
        frame.number = self.options.frame;
        frame.time = self.options.start_time;
        frame.pose = start.carrier;
        frame.wavelength = self.spec.waveform.wavelength();
        frame.polar = Some(image);
        Ok(frame)
    }

    /// When a row is measured, s after the start of the turn.
    fn row_time(&self, rotor: &RadarRotor, row: u32) -> f64 {
        self.sensor.beams.period * f64::from(row) / f64::from(rotor.azimuths)
    }

    /// Half the elevations that the beam illuminates, rad.
    fn elevation(&self) -> f64 {
        let width = self.spec.array.tx_pattern.elevation_deg.unwrap_or(90.0);
        (1.5 * width).clamp(2.0, 60.0).to_radians()
    }

    /// One row: its levels, and what is detected in it.
    fn row(
        &self,
        row: u32,
        moment: &RadarMoment,
        paths: &FramePaths,
        echoes: RadarEchoes,
        levels: &mut Vec<f32>,
    ) -> Result<RowResult> {
        let plan = self.plan;
        let mut streams = plan.silent_streams();
        plan.deposit(&self.received(&echoes), 1e-3 * self.noise, &mut streams);
        // Every row has noise of its own.
        let own = self.rng.words([row, 0], ground::rng::Draw::RadarNoise);
        let rng = Rng::new(u64::from(own[0]) << 32 | u64::from(own[1]), self.options.frame);
        plan.add_noise(self.spec.noise_figure_db, &rng, &mut streams);
        let cube = plan.decode(streams);
        levels.extend(cube.cells.iter().map(|cell| 10.0 * cell.norm_sqr().max(1e-30).log10() + 30.0));
        let detections = self.detect(&cube)?;
        if detections.is_empty() {
            return Ok(RowResult::default());
        }
        let truth = FrameTruth::new(self, moment, &paths.search, &echoes);
        let seen = self.share(&detections, &truth)?;
        Ok(RowResult { detections, seen, truth: Some(truth), echoes })
    }
}

/// Of detections in neighbouring rows, keeps those that are stronger than the cells beside them; the azimuth is that of the
/// peak between rows. The last row is beside the first.
fn keep_peaks(sector: &mut SectorResult, image: &PolarImage) {
    let (cells, rows) = (image.range.len, image.azimuths.len());
    let level = |row: usize, cell: usize| {
        let near = cell.saturating_sub(1)..(cell + 2).min(cells);
        image.levels[row % rows * cells..][near].iter().copied().fold(f32::NEG_INFINITY, f32::max)
    };
    let step = (2.0 * PI / rows as f64) as f32;
    let left = if image.azimuths.get(1).is_some_and(|azimuth| *azimuth < 0.0) { -step } else { step };
    for (row, result) in (sector.first as usize..).zip(&mut sector.rows) {
        let found = &mut result.detections;
        let mut kept = Vec::with_capacity(found.len());
        for at in 0..found.len() {
            let cell = found.range_cell[at] as usize;
            let [before, own, after] = [row + rows - 1, row, row + 1].map(|row| level(row, cell));
            if own < before || own < after {
                continue;
            }
            let bend = before + after - 2.0 * own;
            let aside = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
            found.azimuth[at] = aside * left;
            kept.push(at);
        }
        found.keep(&kept);
        result.seen = kept.iter().map(|&at| result.seen[at]).collect();
    }
}
