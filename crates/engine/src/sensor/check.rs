//! Validity of sensor files: bounds of numbers, and keys that depend on each other.

use super::spec::{BeamSpec, IntensitySpec, ReturnsSpec, SensorKind, SensorSpec, SubRays};
use crate::detect::{Detection, DetectionSpec, MultipleTimeAround, Noise, Statistical, Timing};
use emitter::Transducer;
use emitter::pattern::Pattern;
use ground::error::{Error, Result};
use ground::read::bounds::{ABOVE_ZERO, Bounds, FARTHEST_M};
use ground::read::yaml::Document;

/// Finest step of ranges, m.
const FINEST_M: f64 = 1e-6;

impl SensorSpec {
    /// Checks that all values are within their allowed ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the key.
    pub fn check(&self) -> Result<()> {
        self.check_with(&mut Bounds::none())
    }

    /// [`SensorSpec::check`] that also reports all numbers that have bounds to `bounds`.
    pub(super) fn check_with(&self, bounds: &mut Bounds) -> Result<()> {
        if self.name.is_empty() {
            return Err(Error::invalid("name", "empty", "a word"));
        }
        self.pattern.check_with(bounds)?;
        let range = &self.range;
        bounds.within("range.min_m", range.min_m, 0.0, FARTHEST_M)?;
        bounds.number(
            "range.max_m",
            range.max_m,
            [ABOVE_ZERO, FARTHEST_M],
            format_args!("above 0, at most {FARTHEST_M}"),
        )?;
        bounds.rising(("range.min_m", range.min_m), ("range.max_m", range.max_m))?;
        bounds.within("range.blind_m", range.blind_m, 0.0, FARTHEST_M)?;
        if range.multiple_time_around != MultipleTimeAround::Truth && !matches!(self.pattern, Pattern::LineScan(_)) {
            let allowed = "truth, unless pattern.type is line_scan";
            let found = format!("{:?}", range.multiple_time_around).to_lowercase();
            return Err(Error::invalid("range.multiple_time_around", found, allowed));
        }
        match self.kind {
            SensorKind::Sonar => return self.check_sonar(bounds),
            SensorKind::Radar => return self.check_radar(bounds),
            SensorKind::Lidar | SensorKind::Tof => {}
        }
        self.check_kind()?;
        self.check_beam(bounds)?;
        self.check_ranges(bounds)?;
        self.check_detection(bounds)?;
        self.check_pulse(bounds)?;
        if let Some(doppler) = &self.doppler {
            if self.kind != SensorKind::Lidar {
                return Err(Error::invalid("doppler", "given", "with kind: lidar only"));
            }
            doppler.check(bounds)?;
        }
        match &self.tof {
            Some(_) if self.kind != SensorKind::Tof => Err(Error::invalid("tof", "given", "with kind: tof only")),
            Some(tof) => tof.check(&self.pattern, bounds),
            None => Ok(()),
        }
    }

    /// Keys that go with other kinds of sensors.
    fn check_kind(&self) -> Result<()> {
        if self.pattern.is_of_sound() {
            return Err(Error::invalid("pattern.type", "that of a sonar", "with kind: sonar only"));
        }
        if self.pattern.is_of_radar() {
            return Err(Error::invalid("pattern.type", "that of a radar", "with kind: radar only"));
        }
        self.check_sections()?;
        if self.driver.is_some() && self.kind != SensorKind::Lidar {
            return Err(Error::invalid("driver", "given", "with kind: lidar only"));
        }
        Ok(())
    }

    /// Sections that go with one kind of sensor.
    fn check_sections(&self) -> Result<()> {
        for (key, given, kind) in [
            ("acoustics", self.acoustics.is_some(), SensorKind::Sonar),
            ("dvl", self.dvl.is_some(), SensorKind::Sonar),
            ("radar", self.radar.is_some(), SensorKind::Radar),
        ] {
            if given && self.kind != kind {
                return Err(Error::invalid(key, "given", format!("with kind: {kind} only")));
            }
        }
        Ok(())
    }

    /// Checks that no section for light is given with `kind: sonar` or `radar`, which have `own` ones.
    pub(super) fn check_no_light(&self, own: &str) -> Result<()> {
        let SensorSpec { beam, detection, returns, noise, intensity, kind, .. } = self;
        for (key, given) in [
            ("driver", self.driver.is_some()),
            ("beam", *beam != BeamSpec::default()),
            ("detection", *detection != DetectionSpec::default()),
            ("returns", *returns != ReturnsSpec::default()),
            ("noise", *noise != Noise::default()),
            ("intensity", *intensity != IntensitySpec::default()),
            ("doppler", self.doppler.is_some()),
            ("tof", self.tof.is_some()),
        ] {
            if given {
                return Err(Error::invalid(key, "given", format!("with other kinds than {kind}; a {kind} has {own}")));
            }
        }
        self.check_sections()
    }

    /// The beam, its sub-rays and its pulse.
    fn check_beam(&self, bounds: &mut Bounds) -> Result<()> {
        let beam = &self.beam;
        bounds.within("beam.wavelength_nm", beam.wavelength_nm, 200.0, 20_000.0)?;
        bounds.within("beam.divergence_mrad[0]", beam.divergence_mrad[0], 0.0, 1000.0)?;
        bounds.within("beam.divergence_mrad[1]", beam.divergence_mrad[1], 0.0, 1000.0)?;
        bounds.within("beam.pulse_ns", beam.pulse_ns, 0.0, 1e9)?;
        bounds.within("beam.exit_diameter_mm", beam.exit_diameter_mm, 0.0, 1000.0)?;
        bounds.number("beam.aperture_mm", beam.aperture_mm, [ABOVE_ZERO, 1000.0], "above 0, at most 1000")?;
        let [near, far] = beam.overlap_m;
        bounds.within("beam.overlap_m[0]", near, 0.0, 1000.0)?;
        bounds.number("beam.overlap_m[1]", far, [ABOVE_ZERO, 1000.0], "above 0, at most 1000")?;
        bounds.rising(("beam.overlap_m[0]", near), ("beam.overlap_m[1]", far))?;
        bounds.within("beam.near_range_m", beam.near_range_m, 0.0, 1000.0)?;
        let (sub_rays, one_ray) = match beam.sub_rays {
            SubRays::Count(count) => {
                bounds.within("beam.sub_rays", f64::from(count), 1.0, 1024.0)?;
                (count.to_string(), count == 1)
            }
            SubRays::Adaptive => ("adaptive".into(), false),
            SubRays::AdaptiveUpTo(most) => {
                bounds.within("beam.sub_rays.adaptive", f64::from(most), 1.0, f64::from(SubRays::MOST))?;
                (format!("{{adaptive: {most}}}"), most == 1)
            }
        };
        let tof = self.tof.as_ref();
        for (key, needs_one_ray) in [
            ("tof.second_eye_m", tof.is_some_and(|tof| tof.second_eye_m.is_some())),
            ("tof.multipath_rays", tof.is_some_and(|tof| tof.multipath_rays > 0)),
        ] {
            if needs_one_ray && !one_ray {
                return Err(Error::invalid("beam.sub_rays", sub_rays, format!("1 with {key}")));
            }
        }
        if beam.pulse_ns == 0.0 && tof.is_none() && (!one_ray || beam.divergence_mrad != [0.0; 2]) {
            let because = if !one_ray { "beam.sub_rays above 1" } else { "a beam.divergence_mrad" };
            let allowed = format!("above 0 with {because}: without a pulse echoes of one beam do not join");
            return Err(Error::invalid("beam.pulse_ns", beam.pulse_ns, allowed));
        }
        Ok(())
    }

    /// Resolution of ranges, scale of intensities, and returns.
    fn check_ranges(&self, bounds: &mut Bounds) -> Result<()> {
        let SensorSpec { range, returns, intensity, .. } = self;
        // Finer than a micrometre, single precision overflows.
        let steps = format!("0, or {FINEST_M} to {FARTHEST_M}");
        bounds.number("range.resolution_m", range.resolution_m, [0.0, FARTHEST_M], &steps)?;
        if range.resolution_m > 0.0 && range.resolution_m < FINEST_M {
            return Err(Error::invalid("range.resolution_m", range.resolution_m, steps));
        }
        bounds.within("intensity.white_count", f64::from(intensity.white_count), 1.0, 250.0)?;
        bounds.within("returns.max", f64::from(returns.max), 1.0, u8::MAX.into())?;
        bounds.within("returns.separation_m", returns.separation_m, 0.0, FARTHEST_M)
    }

    /// How echoes are detected, and with which noise.
    fn check_detection(&self, bounds: &mut Bounds) -> Result<()> {
        self.detection.model.check(bounds)?;
        self.noise.check(bounds)?;
        let saturation = self.detection.saturation;
        bounds.within("detection.saturation", saturation, 1.0, 1e12)?;
        let blooming = &self.detection.blooming;
        if let Some(blooming) = blooming {
            bounds.within("detection.blooming.weight", blooming.weight, 0.0, 1.0)?;
            let allowed = "above 0, at most 90";
            bounds.number("detection.blooming.width_deg", blooming.width_deg, [ABOVE_ZERO, 90.0], allowed)?;
            bounds.within("detection.blooming.floor", blooming.floor, 0.0, 1.0)?;
            if self.tof.is_some() {
                return Err(Error::invalid("detection.blooming", "given", "without a tof section only"));
            }
        }
        for (index, &efficiency) in self.detection.channel_efficiency.iter().enumerate() {
            bounds.within(format_args!("detection.channel_efficiency[{index}]"), efficiency, 0.0, 1.0)?;
        }
        if !matches!(self.detection.model, Detection::RadarEquation { .. } | Detection::Statistical(_)) {
            if let Some(saturation) = saturation {
                let allowed = "a value with detection.model: radar_equation or statistical";
                return Err(Error::invalid("detection.saturation", saturation, allowed));
            }
            if blooming.is_some() {
                let allowed = "with detection.model: radar_equation or statistical only";
                return Err(Error::invalid("detection.blooming", "given", allowed));
            }
            if self.detection.timing != Timing::Peak {
                let allowed = "peak, or with detection.model: radar_equation or statistical";
                return Err(Error::invalid("detection.timing", "leading_edge", allowed));
            }
            let allowed = "0, or above with detection.model: radar_equation or statistical";
            bounds.number("noise.range_snr_sigma_m", self.noise.range_snr_sigma_m, [0.0; 2], allowed)?;
        }
        Ok(())
    }

    /// Keys that need a pulse, or a greatest range.
    fn check_pulse(&self, bounds: &mut Bounds) -> Result<()> {
        let SensorSpec { beam, range, detection, .. } = self;
        let needs_pulse = |bounds: &mut Bounds, because: &str| {
            bounds.number("beam.pulse_ns", beam.pulse_ns, [ABOVE_ZERO, 1e9], format_args!("above 0 with {because}"))
        };
        if detection.blooming.is_some() {
            // Light from many bright surfaces merges into one echo only within a pulse.
            needs_pulse(bounds, "detection.blooming")?;
        }
        if detection.timing != Timing::Peak {
            needs_pulse(bounds, "detection.timing: leading_edge")?;
        }
        if let Detection::Statistical(Statistical { bandwidth_mhz, sunlight, .. }) = detection.model {
            if range.max_m.is_none() {
                // False alarms occur anywhere up to there.
                let allowed = "0, or above with range.max_m";
                bounds.number("detection.bandwidth_mhz", bandwidth_mhz, [0.0; 2], allowed)?;
            }
            if sunlight.is_some() {
                needs_pulse(bounds, "detection.sunlight")?;
            }
        }
        Ok(())
    }

    /// The part of [`SensorSpec::check_with`] for sonars.
    fn check_sonar(&self, bounds: &mut Bounds) -> Result<()> {
        let Some(acoustics) = &self.acoustics else {
            return Err(Error::invalid("acoustics", "missing", "a section with kind: sonar"));
        };
        if !self.pattern.is_of_sound() {
            let allowed = "sidescan, multibeam, imaging, single_beam or dvl with kind: sonar";
            return Err(Error::invalid("pattern.type", "that of another kind of sensor", allowed));
        }
        self.check_no_light("acoustics")?;
        let range = &self.range;
        let allowed = "0 with kind: sonar, whose range bins are acoustics.bin_m long";
        bounds.number("range.resolution_m", range.resolution_m, [0.0; 2], allowed)?;
        if range.max_m.is_none() {
            return Err(Error::invalid("range.max_m", "missing", "a value with kind: sonar: how long it listens"));
        }
        let steers = matches!(self.pattern, Pattern::Multibeam(_) | Pattern::Imaging(_));
        if acoustics.array_speed_m_s.is_some() && !steers {
            let allowed = "with pattern.type: multibeam or imaging only, which steer beams";
            return Err(Error::invalid("acoustics.array_speed_m_s", "given", allowed));
        }
        acoustics.check(bounds)?;
        // The resolution in water of 1500 m/s is 0.75 m for 1 kHz, or for a tone of 1 ms. If it were coarser than the
        // greatest range, its only bin would be beyond that.
        let farthest = range.max_m.unwrap_or(FARTHEST_M);
        let within = format!("of a resolution within range.max_m ({farthest})");
        match (acoustics.bandwidth_khz, acoustics.pulse_ms) {
            (Some(bandwidth), _) => {
                let least = 0.75 / farthest;
                let allowed = format!("at least {least}, {within}");
                bounds.number("acoustics.bandwidth_khz", bandwidth, [least, f64::INFINITY], allowed)?;
            }
            (None, pulse) => {
                let most = farthest / 0.75;
                bounds.number("acoustics.pulse_ms", pulse, [0.0, most], format!("at most {most}, {within}"))?;
            }
        }
        match (&self.dvl, &self.pattern) {
            (Some(log), Pattern::Dvl(janus)) => {
                log.check(bounds, janus.janus_deg.to_radians(), range.max_m.unwrap_or(0.0))?;
            }
            (Some(_), _) => return Err(Error::invalid("dvl", "given", "with pattern.type: dvl only")),
            (None, _) => {}
        }
        /// Eight bytes each.
        const MOST_HEARINGS: f64 = 2e8;
        let receiving_beams = Transducer::receive_amplitudes_of(&self.pattern, 1500.0 / acoustics.frequency());
        if receiving_beams > MOST_HEARINGS {
            let found = format!(
                "too many for these beams, which overlap: {receiving_beams:.1e} beams that receive a ray, over all rays"
            );
            let allowed = format!("{MOST_HEARINGS:.0e} with fewer rays or beams, or narrower ones");
            return Err(Error::invalid("pattern.rays", found, allowed));
        }
        Ok(())
    }

    /// The part of [`SensorSpec::check_with`] for radars.
    fn check_radar(&self, bounds: &mut Bounds) -> Result<()> {
        let Some(radar) = &self.radar else {
            return Err(Error::invalid("radar", "missing", "a section with kind: radar"));
        };
        if !self.pattern.is_of_radar() {
            let allowed = "radar or radar_rotor with kind: radar";
            return Err(Error::invalid("pattern.type", "that of another kind of sensor", allowed));
        }
        self.check_no_light("radar")?;
        let allowed = "0 with kind: radar, whose range cells follow from radar.waveform";
        bounds.number("range.resolution_m", self.range.resolution_m, [0.0; 2], allowed)?;
        radar.check(bounds, &self.pattern)
    }

    /// Turns `document` into a checked description.
    pub(super) fn read(document: &Document) -> Result<SensorSpec> {
        let spec: SensorSpec = document.read()?;
        spec.check().map_err(|error| document.locate(error))?;
        Ok(spec)
    }
}
