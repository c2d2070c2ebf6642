//! One frame of a radar, step by step: paths, streams, noise, cube, detections.

use super::RadarRecord;
use super::explain::Explanation;
use super::paths::FramePaths;
use super::points::PointWriter;
use super::setup::RadarSetup;
use super::truth::FrameTruth;
use ::radar::{
    AdcSamples, AdcSpec, DetectionTruth, Multiplex, Paths, RadarCube, RadarDetections, RadarWaveform, noise_density,
};
use cloud::{PointCloud, RadarFrame, RawSamples};
use ground::error::Result;

impl RadarSetup<'_> {
    /// A frame with what `record` requests; one of its detections may be explained.
    pub fn frame(
        &self,
        record: RadarRecord,
        cloud: &mut PointCloud,
        explanation: Option<&mut Explanation>,
    ) -> Result<RadarFrame> {
        let plan = self.plan;
        let duration = self.spec.waveform.duration(self.spec.array.tx.len());
        self.scene.0.check_time(self.options.start_time, duration)?;
        let moment = self.moment(0.5 * duration, 0.0);
        let mut paths = FramePaths::default();
        self.find(&moment, self.sector(), &mut paths)?;
        let truth = FrameTruth::new(self, &moment, &paths.search, &paths.echoes);
        let received = self.received(&paths.echoes);
        let disturbance = self.disturbance(&received);
        let mut samples = None;
        let streams = if record.samples {
            let mut sampled = plan.samples(&received);
            if let Some(disturbance) = &disturbance {
                sampled.values.iter_mut().zip(&disturbance.values).for_each(|(value, more)| *value += more);
            }
            plan.add_sample_noise(self.spec.noise_figure_db, &self.rng, &mut sampled);
            let values = AdcSpec::default().convert(&mut sampled);
            samples = Some(self.raw(values));
            plan.streams_of(&sampled)
        } else {
            let mut streams = plan.silent_streams();
            plan.deposit(&received, 1e-3 * self.noise, &mut streams);
            plan.add_noise(self.spec.noise_figure_db, &self.rng, &mut streams);
            if let Some(disturbance) = &disturbance {
                plan.add_samples(disturbance, &mut streams);
            }
            streams
        };
        let disturbance = disturbance.map(|samples| plan.decode(plan.streams_of(&samples)));
        let cube = plan.decode(streams);
        let detections = self.detect(&cube)?;
        let seen = self.share(&detections, &truth)?;
        let writer = PointWriter {
            setup: self,
            search: &paths.search,
            echoes: &paths.echoes,
            truth: &truth,
            moment: &moment,
            beam: (0, 0.0),
            disturbance: disturbance.as_ref(),
        };
        writer.write(&detections, &seen, cloud)?;
        if let Some(explanation) = explanation {
            explanation.add(&writer, &detections, 0)?;
        }
        let mut frame = RadarFrame::default();
        frame.number = self.options.frame;
        frame.time = self.options.start_time;
        frame.pose = moment.pose;
        frame.wavelength = self.spec.waveform.wavelength();
        frame.elements = plan.array().places.iter().map(|place| place.map(f64::from)).collect();
        frame.cube = record.cube.then_some(cube);
        frame.samples = samples;
        Ok(frame)
    }

    /// What phase noise and other radars add to the samples.
    fn disturbance(&self, received: &Paths) -> Option<AdcSamples> {
        if self.spec.phase_noise.is_none() && self.spec.interferers.is_empty() {
            return None;
        }
        let mut samples = self.plan.silent_samples();
        if let Some(noise) = &self.spec.phase_noise {
            let floor = 0.1 * noise_density(self.spec.noise_figure_db);
            self.plan.add_phase_noise(noise, received, floor, &self.rng, &mut samples);
        }
        self.plan.add_interference(&self.spec.interferers, &self.rng, &mut samples);
        Some(samples)
    }

    /// What is detected in a cube.
    pub fn detect(&self, cube: &RadarCube) -> Result<RadarDetections> {
        let (_, parts) = self.sensor.radar()?;
        let mut own = parts.detector();
        let mut detections = RadarDetections::default();
        own.detector.run(cube, self.noise as f32, &mut detections)?;
        parts.keep(own);
        Ok(detections)
    }

    /// What the detections are of.
    pub fn share(&self, detections: &RadarDetections, truth: &FrameTruth) -> Result<Vec<DetectionTruth>> {
        let (_, parts) = self.sensor.radar()?;
        let mut own = parts.detector();
        let mut seen = Vec::new();
        own.sharing.run(detections, &truth.paths(), self.noise as f32, &mut seen)?;
        parts.keep(own);
        Ok(seen)
    }

    /// Samples as they are recorded.
    fn raw(&self, values: Vec<i16>) -> RawSamples {
        let RadarWaveform::Fmcw(fmcw) = &self.spec.waveform else { return RawSamples::default() };
        let [transmitters, receivers] = [&self.spec.array.tx, &self.spec.array.rx].map(|it| it.len());
        let slots = if fmcw.multiplex == Multiplex::Ddm { 1 } else { fmcw.slots(transmitters) };
        let shape = [fmcw.chirps as usize, slots, receivers, fmcw.samples as usize];
        let values = if fmcw.complex { values } else { values.into_iter().flat_map(|value| [value, 0]).collect() };
        RawSamples { shape, values }
    }

    /// A cloud without points.
    pub fn write_nothing(&self, cloud: &mut PointCloud) -> Result<()> {
        let moment = self.moment(0.0, 0.0);
        let (search, echoes) = Default::default();
        let truth = FrameTruth::new(self, &moment, &search, &echoes);
        let writer = PointWriter {
            setup: self,
            search: &search,
            echoes: &echoes,
            truth: &truth,
            moment: &moment,
            beam: (0, 0.0),
            disturbance: None,
        };
        writer.write(&RadarDetections::default(), &[], cloud)
    }
}
