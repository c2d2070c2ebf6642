//! Depth cameras: the section `tof` of a sensor file, and how the light at a pixel becomes a range.

use crate::detect::{DepthCamera, DepthError, DepthNoise};
use crate::echo::{MOST_FREQUENCIES, Modulation, ShotNoise, turns};
use emitter::Pattern;
use ground::error::{Error, Result};
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use serde::{Deserialize, Serialize};

/// `tof`: keys for depth cameras; only sensors of kind `tof` have it. An omitted key means the ideal case. Only the
/// physical profile has these effects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct TofSpec {
    /// Frequencies that its light is modulated at, MHz, up to 3, whole kHz: the range follows from their phases
    /// together. Without any, ranges do not wrap.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frequencies_mhz: Vec<f64>,
    /// Fraction of the error of four-tap sampling of square waves that remains after calibration, 0 to 1.
    pub wiggle_residual: f64,
    /// Pixels are invalid where the ranges from two frequencies differ by more than this, m, above 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inconsistency_m: Option<f64>,
    /// Noise of the phases.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shot_noise: Option<ShotNoiseSpec>,
    /// Pixels that receive more light than from this target are invalid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub saturation: Option<Target>,
    /// How the lens dims the image off its axis.
    pub vignetting: Vignetting,
    /// Emitted light, by angle off the axis; linear in between, constant outside. Without any, it is uniform.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub illumination: Vec<Illumination>,
    /// Random error along the optical axis.
    pub depth_noise: DepthNoise,
    /// Standard deviation of the point that a pixel samples, pixels across and down, 0 to 10.
    pub lateral_sigma_px: f64,
    /// Position of the projector or the other camera, in the sensor frame, m: a pixel whose surface is not visible from
    /// there is invalid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_eye_m: Option<[f64; 3]>,
    /// Rays per pixel that sample light arriving via another surface, 0 to 256; 0 for none.
    pub multipath_rays: u32,
}

impl Default for TofSpec {
    fn default() -> Self {
        TofSpec {
            frequencies_mhz: Vec::new(),
            wiggle_residual: 0.1,
            inconsistency_m: None,
            shot_noise: None,
            saturation: None,
            vignetting: Vignetting::None,
            illumination: Vec::new(),
            depth_noise: DepthNoise::None,
            lateral_sigma_px: 0.0,
            second_eye_m: None,
            multipath_rays: 0,
        }
    }
}

/// A Lambert target at normal incidence on the optical axis that fills the pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Its reflectance, above 0, at most 1.
    pub reflectance: f64,
    /// Its range, m.
    pub at_m: f64,
}

impl Target {
    /// `rho / R^2`, 1/m^2.
    fn power(self) -> f64 {
        self.reflectance / (self.at_m * self.at_m)
    }
}

/// Shot noise, specified by the random error for one [`Target`]: it falls with the square root of the returned light,
/// and with that light itself where background light is stronger.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ShotNoiseSpec {
    /// Standard deviation of its range, m, above 0.
    pub sigma_m: f64,
    /// As [`Target::reflectance`].
    pub reflectance: f64,
    /// As [`Target::at_m`].
    pub at_m: f64,
    /// Background light relative to the light of that target, at least 0.
    #[serde(default)]
    pub ambient: f64,
}

/// How a lens dims the image off its axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Vignetting {
    /// Not at all.
    #[default]
    None,
    /// With the fourth power of the cosine.
    Cos4,
}

/// Light emitted at an angle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Illumination {
    /// Angle off the optical axis, degrees, 0 to 180, rising.
    pub angle_deg: f64,
    /// Light there relative to that on the axis, 0 to 100.
    pub value: f64,
}

impl TofSpec {
    /// Checks that all values are within what is allowed with `pattern`; reports all numbers to `bounds`.
    #[doc(hidden)]
    pub fn check(&self, pattern: &Pattern, bounds: &mut Bounds) -> Result<()> {
        let target = |bounds: &mut Bounds, name: &str, Target { reflectance, at_m }: Target| {
            let key = format!("tof.{name}.reflectance");
            bounds.number(key, reflectance, [ABOVE_ZERO, 1.0], "above 0, at most 1")?;
            bounds.within(format_args!("tof.{name}.at_m"), at_m, 1e-3, 1e9)
        };
        if self.frequencies_mhz.len() > MOST_FREQUENCIES {
            let found = format!("a list of {}", self.frequencies_mhz.len());
            return Err(Error::invalid("tof.frequencies_mhz", found, format!("up to {MOST_FREQUENCIES}")));
        }
        for (index, &mhz) in self.frequencies_mhz.iter().enumerate() {
            let key = format!("tof.frequencies_mhz[{index}]");
            bounds.within(&key, mhz, 0.1, 10_000.0)?;
            if (mhz * 1e3 - (mhz * 1e3).round()).abs() > 1e-6 {
                return Err(Error::invalid(key, mhz, "whole kHz"));
            }
        }
        let together = turns(&self.frequencies_khz());
        if together > MOST_TURNS {
            return Err(Error::invalid(
                "tof.frequencies_mhz",
                format!("{:?}, the highest {together} times their common divisor", self.frequencies_mhz),
                format!("at most {MOST_TURNS} times"),
            ));
        }
        bounds.within("tof.wiggle_residual", self.wiggle_residual, 0.0, 1.0)?;
        bounds.number("tof.inconsistency_m", self.inconsistency_m, [ABOVE_ZERO, 1e9], "above 0, at most 1000000000")?;
        if let Some(ShotNoiseSpec { sigma_m, reflectance, at_m, ambient }) = self.shot_noise {
            bounds.within("tof.shot_noise.sigma_m", sigma_m, 1e-9, 1e3)?;
            target(bounds, "shot_noise", Target { reflectance, at_m })?;
            bounds.within("tof.shot_noise.ambient", ambient, 0.0, 1e9)?;
        }
        if let Some(saturation) = self.saturation {
            target(bounds, "saturation", saturation)?;
        }
        bounds.within("tof.multipath_rays", f64::from(self.multipath_rays), 0.0, 256.0)?;
        let needs = [
            ("inconsistency_m", self.inconsistency_m.is_some()),
            ("shot_noise", self.shot_noise.is_some()),
            ("multipath_rays", self.multipath_rays > 0),
        ];
        for (key, is_given) in needs {
            if is_given && self.frequencies_mhz.is_empty() {
                return Err(Error::invalid(format!("tof.{key}"), "given", "with tof.frequencies_mhz only"));
            }
        }
        for (index, &Illumination { angle_deg, value }) in self.illumination.iter().enumerate() {
            let key = format!("tof.illumination[{index}].angle_deg");
            bounds.within(&key, angle_deg, 0.0, 180.0)?;
            bounds.within(format_args!("tof.illumination[{index}].value"), value, 0.0, 100.0)?;
            if index > 0 {
                let before = format!("tof.illumination[{}].angle_deg", index - 1);
                bounds.rising((before, self.illumination[index - 1].angle_deg), (key, angle_deg))?;
            }
        }
        match self.depth_noise {
            DepthNoise::Disparity { sigma_px, step_px } => {
                bounds.within("tof.depth_noise.sigma_px", sigma_px, 0.0, 100.0)?;
                bounds.within("tof.depth_noise.step_px", step_px, 0.0, 100.0)?;
                if self.second_eye_m.is_none() {
                    return Err(Error::invalid("tof.depth_noise.model", "disparity", "with tof.second_eye_m only"));
                }
            }
            DepthNoise::Polynomial { sigma_m } => {
                for (index, term) in sigma_m.into_iter().enumerate() {
                    bounds.within(format_args!("tof.depth_noise.sigma_m[{index}]"), term, -1000.0, 1000.0)?;
                }
            }
            DepthNoise::None | DepthNoise::Khoshelham | DepthNoise::Nguyen | DepthNoise::Fankhauser => {}
        }
        bounds.within("tof.lateral_sigma_px", self.lateral_sigma_px, 0.0, 10.0)?;
        let is_pinhole = matches!(pattern, Pattern::Pinhole(_));
        let images =
            [("depth_noise", self.depth_noise != DepthNoise::None), ("lateral_sigma_px", self.lateral_sigma_px > 0.0)];
        for (key, is_given) in images {
            if is_given && !is_pinhole {
                return Err(Error::invalid(format!("tof.{key}"), "given", "with pattern.type: pinhole only"));
            }
        }
        if let Some(eye) = self.second_eye_m {
            for (axis, place) in eye.into_iter().enumerate() {
                bounds.within(format_args!("tof.second_eye_m[{axis}]"), place, -1000.0, 1000.0)?;
            }
            if eye.iter().all(|place| place.abs() < 1e-6) {
                return Err(Error::invalid("tof.second_eye_m", "where the camera is", "1e-6 m or more away from it"));
            }
        }
        Ok(())
    }

    /// The camera of an image with `pattern`, which this has been checked with.
    #[doc(hidden)]
    pub fn camera(&self, pattern: &Pattern) -> DepthCamera {
        let frequencies = self.frequencies_khz();
        let modulation = (!frequencies.is_empty()).then(|| Modulation::new(&frequencies, self.wiggle_residual));
        let shot_noise = self.shot_noise.zip(modulation).map(|(noise, modulation)| {
            let ShotNoiseSpec { sigma_m, reflectance, at_m, ambient } = noise;
            ShotNoise::new(modulation.phase_sigma(sigma_m), Target { reflectance, at_m }.power(), ambient)
        });
        let (pixel, half) = match pattern {
            Pattern::Pinhole(pinhole) => (pinhole.pixel(), pinhole.half()),
            _ => ([0.0; 2], [f64::INFINITY; 2]),
        };
        let baseline = self.second_eye_m.map_or(1.0, |eye| glam::DVec3::from(eye).length());
        let aside = pixel.map(|size| (size * self.lateral_sigma_px) as f32);
        DepthCamera {
            modulation,
            shot_noise,
            inconsistency: self.inconsistency_m.map_or(f32::INFINITY, |limit| limit as f32),
            saturation: self.saturation.map_or(f32::INFINITY, |target| target.power() as f32),
            vignetting: self.vignetting == Vignetting::Cos4,
            illumination: (self.illumination.iter())
                .map(|light| [light.angle_deg.to_radians() as f32, light.value as f32])
                .collect(),
            depth: DepthError::new(self.depth_noise, pixel[0] / baseline),
            aside: (self.lateral_sigma_px > 0.0).then_some(aside),
            second_eye: self.second_eye_m.map(|eye| glam::DVec3::from(eye).as_vec3()),
            multipath_rays: self.multipath_rays,
            half: half.map(|size| size as f32),
        }
    }

    /// The frequencies, which are in bounds, kHz.
    fn frequencies_khz(&self) -> Vec<u32> {
        self.frequencies_mhz.iter().map(|mhz| (mhz * 1e3).round() as u32).collect()
    }
}

/// Greatest ratio of a frequency to the common divisor: this many wraps are tried for every pixel.
const MOST_TURNS: u32 = 1000;

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use ground::read::yaml;
    use ground::rng::Rng;

    /// A camera of 64 x 48 pixels and 90 x 60 degrees.
    fn camera(tof: &str) -> DepthCamera {
        let pattern = "{type: pinhole, resolution: [64, 48], fov_deg: [90, 60]}";
        let (spec, pattern): (TofSpec, Pattern) =
            (yaml::from_str("tof", tof).unwrap(), yaml::from_str("pattern", pattern).unwrap());
        spec.check(&pattern, &mut Bounds::none()).unwrap();
        spec.camera(&pattern)
    }

    fn form(camera: &DepthCamera, ranges: &[f32], powers: &[f32]) -> Option<(f32, f32)> {
        camera.form(&Rng::new(1, 0), 5, ranges, powers)
    }

    #[test]
    fn what_is_left_out_is_ideal() {
        let ideal = camera("{}");
        assert_eq!(form(&ideal, &[3.5], &[0.2]), Some((3.5, 0.2)));
        assert!(!ideal.wraps() && !ideal.dims());
        assert_eq!((ideal.gain(0.5), ideal.measure(&Rng::new(1, 0), 5, 0.8, None, 0.9, 3.0)), (1.0, 3.0));
    }

    /// Modulated light adds up, a matched pattern is that of the strongest echo.
    #[test]
    fn several_echoes_are_one() {
        assert_eq!(form(&camera("{}"), &[1.0, 4.0, 2.0], &[0.1, 0.3, 0.2]), Some((4.0, 0.6)));
        assert_eq!(form(&camera("{}"), &[], &[]), None);
        let (range, power) =
            form(&camera("{frequencies_mhz: [16], wiggle_residual: 0}"), &[1.0, 4.0], &[0.5, 0.5]).unwrap();
        assert!((range - 2.5).abs() < 1e-6 && power < 0.6, "{range} {power}");
    }

    #[test]
    fn pixels_are_invalid_by_their_light() {
        let bright = camera("{saturation: {reflectance: 0.8, at_m: 2}}");
        assert_eq!(form(&bright, &[1.0, 2.0], &[0.15, 0.06]), None);
        assert_eq!(form(&bright, &[1.0], &[0.19]), Some((1.0, 0.19)));
        let strict = camera("{frequencies_mhz: [16, 80], wiggle_residual: 0, inconsistency_m: 0.01}");
        assert!(form(&strict, &[1.0, 4.0], &[0.3, 0.7]).is_none());
        assert!(form(&strict, &[4.0], &[0.7]).is_some());
        // Without light there is no phase, not even a noisy one.
        let noisy = camera("{frequencies_mhz: [16], shot_noise: {sigma_m: 0.01, reflectance: 0.5, at_m: 1}}");
        assert_eq!(form(&noisy, &[1.0], &[0.0]), None);
    }

    #[test]
    fn light_goes_out_by_its_table_and_into_the_image_alone() {
        let lamp = camera("{illumination: [{angle_deg: 10, value: 1}, {angle_deg: 30, value: 0.5}]}");
        for (angle, expected) in [(0.0f32, 1.0), (10.0, 1.0), (20.0, 0.75), (30.0, 0.5), (44.0, 0.5)] {
            let (sin, cos) = angle.to_radians().sin_cos();
            assert!((lamp.gain(cos) - expected).abs() < 1e-5, "{angle}");
            assert!((lamp.light_along(Vec3::new(cos, sin, 0.0)) - expected).abs() < 1e-5, "{angle}");
        }
        let (sin, cos) = 31f32.to_radians().sin_cos();
        assert_eq!(lamp.light_along(Vec3::new(cos, 0.0, sin)), 0.0, "above the image");
        assert_eq!(lamp.light_along(-Vec3::X), 0.0, "behind");
    }
}
