//! Depth errors of structured light and stereo, and as measured for some cameras.

use echocast_kernels::{LANES, camera};
use ground::read::yaml;
use serde::{Deserialize, Deserializer, Serialize};

/// Random error of the depth z, the distance along the optical axis in m, of a depth camera; points move along their
/// rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "model", rename_all = "snake_case")]
#[non_exhaustive]
pub enum DepthNoise {
    /// None.
    #[default]
    None,
    /// Kinect v1 (Khoshelham and Oude Elberink 2012): sigma = 1.425e-3 z^2 m, in steps of 2.85e-3 z^2 m.
    Khoshelham,
    /// Kinect v1 (Nguyen, Izadi and Lovell 2012): sigma = 0.0012 + 0.0019 (z - 0.4)^2 + 1e-4 z^(-1/2) g m, where g =
    /// t^2 / (pi/2 - t)^2 grows with the incidence t.
    Nguyen,
    /// Kinect v2 (Fankhauser et al. 2015): sigma = 1.5 - 0.5 z + 0.3 z^2 + 0.1 z^(3/2) g mm, with the same g.
    Fankhauser,
    /// Triangulation from two viewpoints `tof.second_eye_m` apart: sigma and steps are those of the disparity times z^2
    /// / (f B) with the focal length f in pixels and the baseline B.
    Disparity {
        /// Standard deviation of the disparity, pixels.
        sigma_px: f64,
        /// Step of the disparity, pixels; 0 for none.
        step_px: f64,
    },
    /// sigma = a + b z + c z^2, from a data sheet.
    Polynomial {
        /// a in m, b in m/m, c in m/m^2.
        sigma_m: [f64; 3],
    },
}

impl<'de> Deserialize<'de> for DepthNoise {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Disparity {
            sigma_px: f64,
            #[serde(default)]
            step_px: f64,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Polynomial {
            sigma_m: [f64; 3],
        }
        let (word, section) = yaml::split_tag(deserializer, "model")?;
        let plain = match word.as_str() {
            "none" => DepthNoise::None,
            "khoshelham" => DepthNoise::Khoshelham,
            "nguyen" => DepthNoise::Nguyen,
            "fankhauser" => DepthNoise::Fankhauser,
            "disparity" => {
                let Disparity { sigma_px, step_px } = section.read()?;
                return Ok(DepthNoise::Disparity { sigma_px, step_px });
            }
            "polynomial" => {
                let Polynomial { sigma_m } = section.read()?;
                return Ok(DepthNoise::Polynomial { sigma_m });
            }
            _ => {
                let known = &["none", "khoshelham", "nguyen", "fankhauser", "disparity", "polynomial"];
                return Err(section.unknown(&word, known));
            }
        };
        section.end()?;
        Ok(plain)
    }
}

/// A law of depth noise prepared for a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthError {
    /// Standard deviation head-on: `a + b z + c z^2`, m.
    terms: [f32; 3],
    /// Additional term of slanted surfaces, m: the first times `z^second t^2 / (pi/2 - t)^2`.
    slanted: (f32, f32),
    /// Step over z^2, 1/m.
    step: f32,
}

impl DepthError {
    /// `per_pixel`: `1 / (f B)`, depth over z^2 per pixel of disparity, 1/m. None without noise.
    pub fn new(noise: DepthNoise, per_pixel: f64) -> Option<DepthError> {
        let law = |terms: [f64; 3], slanted, step| {
            Some(DepthError { terms: terms.map(|term| term as f32), slanted, step: step as f32 })
        };
        match noise {
            DepthNoise::None => None,
            DepthNoise::Khoshelham => law([0.0, 0.0, 1.425e-3], (0.0, 0.0), 2.85e-3),
            // 0.0012 + 0.0019 (z - 0.4)^2, in powers of z.
            DepthNoise::Nguyen => law([0.0012 + 0.0019 * 0.16, -0.0019 * 0.8, 0.0019], (1e-4, -0.5), 0.0),
            DepthNoise::Fankhauser => law([1.5e-3, -0.5e-3, 0.3e-3], (1e-4, 1.5), 0.0),
            DepthNoise::Disparity { sigma_px, step_px } => {
                law([0.0, 0.0, sigma_px * per_pixel], (0.0, 0.0), step_px * per_pixel)
            }
            DepthNoise::Polynomial { sigma_m } => law(sigma_m, (0.0, 0.0), 0.0),
        }
    }

    /// The measured depth, m, for the true `depth`, on a surface with the cosine of incidence `cos`; `normal` is a
    /// standard normal number.
    pub fn measure(&self, depth: f32, cos: f32, normal: f32) -> f32 {
        camera::measured_depth(self.terms, self.slanted, self.step, depth, cos, normal)
    }

    /// [`DepthError::measure`] for `ranges` along rays at angles with the cosines `axis` from the optical axis.
    pub(crate) fn measure_all(
        &self,
        axis: &[f32; LANES],
        cos: &[f32; LANES],
        normal: &[f32; LANES],
        ranges: &mut [f32; LANES],
    ) {
        camera::err(self.terms, self.slanted, self.step, axis, cos, normal, ranges);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::rng::{Draw, Rng};

    impl DepthError {
        fn sigma(&self, depth: f32, cos: f32) -> f32 {
            camera::depth_sigma(self.terms, self.slanted, depth, cos)
        }
    }

    fn law(noise: DepthNoise) -> DepthError {
        DepthError::new(noise, 1.0 / (939.0 * 0.05)).unwrap()
    }

    #[track_caller]
    fn assert_near(is: f32, expected: f64, relative: f64) {
        assert!((f64::from(is) / expected - 1.0).abs() < relative, "{is} is not {expected}");
    }

    /// Published laws at some depths, head-on, computed by hand.
    #[test]
    fn laws_have_their_values() {
        let k = law(DepthNoise::Khoshelham);
        assert_near(k.sigma(2.0, 1.0), 5.7e-3, 1e-6);
        assert_near(k.step * 4.0, 1.14e-2, 1e-6);
        assert_near(law(DepthNoise::Nguyen).sigma(2.0, 1.0), 6.064e-3, 1e-6);
        assert_near(law(DepthNoise::Nguyen).sigma(0.4, 1.0), 1.2e-3, 1e-5);
        assert_near(law(DepthNoise::Fankhauser).sigma(4.5, 1.0), 5.325e-3, 1e-6);
        // A D435 at 2 m: 939 pixels of focal length, 50 mm, 0.08 pixels.
        let stereo = law(DepthNoise::Disparity { sigma_px: 0.08, step_px: 0.0 });
        assert_near(stereo.sigma(2.0, 1.0), 4.0 * 0.08 / (939.0 * 0.05), 1e-6);
        let sheet = law(DepthNoise::Polynomial { sigma_m: [0.005, 0.001, 0.0] });
        assert_near(sheet.sigma(9.0, 0.2), 0.014, 1e-6);
    }

    /// At 60 degrees g = (60 / 30)^2 = 4, at 45 it is 1.
    #[test]
    fn slanted_surfaces_are_noisier() {
        let nguyen = law(DepthNoise::Nguyen);
        assert_near(nguyen.sigma(1.0, 0.5) - nguyen.sigma(1.0, 1.0), 4e-4, 1e-4);
        assert_near(nguyen.sigma(4.0, 0.5f32.sqrt()) - nguyen.sigma(4.0, 1.0), 5e-5, 1e-3);
        let fankhauser = law(DepthNoise::Fankhauser);
        assert_near(fankhauser.sigma(4.0, 0.5) - fankhauser.sigma(4.0, 1.0), 8.0 * 4e-4, 1e-4);
        assert_eq!(nguyen.sigma(1.0, 0.0), nguyen.sigma(1.0, 0.05), "finite at the horizon");
        assert_eq!(law(DepthNoise::Khoshelham).sigma(1.0, 0.1), law(DepthNoise::Khoshelham).sigma(1.0, 1.0));
    }

    /// With or without steps, sigma is that of the law: 3 standard errors, sigma / sqrt(2 n).
    #[test]
    fn what_is_measured_has_the_sigma_of_the_law() {
        let rng = Rng::new(9, 0);
        for noise in [DepthNoise::Khoshelham, DepthNoise::Nguyen, DepthNoise::Fankhauser] {
            let law = law(noise);
            let count = 100_000;
            let mut variance = 0.0;
            for beam in 0..count {
                // Over many steps, so that their position does not matter.
                let depth = 2.0 + 0.1 * beam as f32 / count as f32;
                let [normal, _] = rng.normal_pair(beam, Draw::DepthJitter, 0);
                let error = (law.measure(depth, 0.8, normal) - depth) / law.sigma(depth, 0.8);
                variance += f64::from(error * error) / f64::from(count);
            }
            let bound = 3.0 / (2.0 * f64::from(count)).sqrt();
            assert!((variance.sqrt() - 1.0).abs() < bound, "{noise:?}: {}", variance.sqrt());
        }
    }

    /// Steps are uniform in disparity: 2.85e-3 z^2 apart in depth.
    #[test]
    fn depths_are_steps_of_disparity() {
        let law = law(DepthNoise::Khoshelham);
        let mut depths: Vec<f32> = (0..2000).map(|i| law.measure(3.0 + 1e-4 * i as f32, 1.0, 0.0)).collect();
        depths.dedup();
        assert!(depths.len() > 5);
        for pair in depths.windows(2) {
            // The step grows over its own length: its relative error is that of z^2 over one step.
            let middle = 0.5 * (pair[0] + pair[1]);
            assert_near(pair[1] - pair[0], 2.85e-3 * f64::from(middle * middle), 1e-3);
        }
    }

    #[test]
    fn no_depth_is_negative() {
        for noise in [DepthNoise::Khoshelham, DepthNoise::Nguyen, DepthNoise::Polynomial { sigma_m: [9.0; 3] }] {
            assert!(law(noise).measure(0.001, 1.0, -5.7) >= 0.0);
        }
        assert_eq!(law(DepthNoise::Polynomial { sigma_m: [0.0, -1.0, 0.0] }).sigma(3.0, 1.0), 0.0);
        assert_eq!(DepthError::new(DepthNoise::None, 1.0), None);
    }
}
