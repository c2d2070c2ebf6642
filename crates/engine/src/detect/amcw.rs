//! Depth cameras: all light of a pixel together becomes one range, by its phase where the light is modulated (AMCW), by
//! matching patterns where it is not.

use super::{DepthError, Detections, Gate, gate::NEAREST};
use crate::echo::{MOST_FREQUENCIES, Modulation, Peak, ShotNoise, natural_vignetting};
use echocast_kernels::camera as kernels;
use glam::Vec3;
use ground::lanes::LANES;
use ground::rng::{Draw, Rng};

/// A depth camera prepared to scan.
#[derive(Clone, Debug)]
pub struct DepthCamera {
    pub modulation: Option<Modulation>,
    pub shot_noise: Option<ShotNoise>,
    /// Greatest difference between the ranges of the frequencies, m.
    pub inconsistency: f32,
    /// Power above which a pixel is invalid, 1/m^2.
    pub saturation: f32,
    /// Whether the lens dims the image off its axis, with the fourth power of the cosine.
    pub vignetting: bool,
    /// Angle off the axis, rad, and light there.
    pub illumination: Vec<[f32; 2]>,
    pub depth: Option<DepthError>,
    /// Standard deviation of the point that a pixel samples, in units of the focal length, across and down; `None`: 0.
    pub aside: Option<[f32; 2]>,
    /// Position of the second eye in the sensor frame, m.
    pub second_eye: Option<Vec3>,
    /// Rays per pixel that sample light arriving via another surface.
    pub multipath_rays: u32,
    /// Half of the width and height of the image in units of the focal length; infinite without an image.
    pub half: [f32; 2],
}

impl DepthCamera {
    /// Whether its ranges wrap, so that surfaces beyond its greatest range count.
    pub(crate) fn wraps(&self) -> bool {
        self.modulation.is_some()
    }

    /// Whether pixels off the axis receive more or less light than others.
    pub(crate) fn dims(&self) -> bool {
        self.vignetting || !self.illumination.is_empty()
    }

    /// Light at a pixel whose ray is `cos` (the cosine) off the axis, relative to that without lens and projector.
    pub fn gain(&self, cos: f32) -> f32 {
        let lens = if self.vignetting { natural_vignetting(cos.max(0.0)) } else { 1.0 };
        lens * self.light(cos)
    }

    /// Light emitted in `direction` (of length 1, in the sensor frame), relative to that on the axis; none outside the
    /// image.
    pub(crate) fn light_along(&self, direction: Vec3) -> f32 {
        let [across, down] = self.half;
        let within = direction.y.abs() <= across * direction.x && direction.z.abs() <= down * direction.x;
        if within || across.is_infinite() { self.light(direction.x) } else { 0.0 }
    }

    /// Light emitted `cos` (the cosine) off the axis, relative to that on it.
    pub fn light(&self, cos: f32) -> f32 {
        let [light] = kernels::light(&self.illumination, &[cos]);
        light
    }

    /// Range, m, and power, 1/m^2, that pixel `beam` derives from its echoes at `ranges`, m, with the `powers`
    /// `rho_eff / R^2`, 1/m^2, attenuated by [`DepthCamera::gain`] and weighted by their part of the pixel; `None`
    /// where it is invalid.
    pub fn form(&self, rng: &Rng, beam: u32, ranges: &[f32], powers: &[f32]) -> Option<(f32, f32)> {
        let light: f32 = powers.iter().sum();
        if light > self.saturation {
            return None;
        }
        let Some(modulation) = &self.modulation else {
            // Patterns are matched, not summed: the strongest echo wins.
            let echoes = ranges.iter().copied().zip(powers.iter().copied());
            return echoes.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(range, _)| (range, light));
        };
        if self.shot_noise.is_some() && light <= 0.0 {
            return None;
        }
        let formed = modulation.form(ranges, powers, |index, amplitude, offset| match &self.shot_noise {
            Some(noise) => {
                let [normal, _] = rng.normal_pair(beam, Draw::Phase, index as u32);
                noise.sigma(amplitude, offset) * f64::from(normal)
            }
            None => 0.0,
        });
        (formed.disagreement <= self.inconsistency).then_some((formed.range, formed.power))
    }

    /// Detects the one echo of pixel `beam`, of all the light in `found.received`; range limits apply to the range that it
    /// forms.
    pub(super) fn detect(&self, gate: &Gate, beam: u32, found: &mut Detections) {
        let Detections { received, peaks, chosen, .. } = found;
        if received.is_empty() {
            return;
        }
        let [ranges, powers] = received.pulses();
        let (light, moment) = received
            .pieces
            .iter()
            .fold((0.0, 0.0), |(light, moment), piece| (light + piece.power, moment + piece.power * piece.range));
        let truth = moment / light;
        if let Some((range, power)) = self.form(&gate.rng, beam, ranges, powers)
            && gate.detects(beam, NEAREST, power * truth * truth, truth)
        {
            peaks.push(Peak { range, power });
            chosen.push(0);
        }
    }

    /// [`DepthCamera::form`] of pixels with one echo each: `formed` receives ranges, m, `valid` whether there is one.
    pub(crate) fn form_all(
        &self,
        rng: &Rng,
        beams: &[u32],
        [ranges, powers]: [&[f32; LANES]; 2],
        formed: &mut [f32; LANES],
        valid: &mut [bool; LANES],
    ) {
        for lane in 0..LANES {
            let dark = self.shot_noise.is_some() && powers[lane] <= 0.0 && self.modulation.is_some();
            valid[lane] = (powers[lane] <= self.saturation || powers[lane].is_nan()) && !dark;
        }
        let Some(modulation) = &self.modulation else {
            *formed = *ranges;
            return;
        };
        let mut normals;
        let noise = if let Some(noise) = self.shot_noise {
            normals = [[0.0; LANES]; MOST_FREQUENCIES];
            for (index, normals) in (0..).zip(&mut normals[..modulation.0.wraps().len()]) {
                rng.normals(beams, &[index; LANES][..beams.len()], Draw::Phase, &mut normals[..beams.len()]);
            }
            Some((noise, &normals))
        } else {
            None
        };
        let mut disagreement = [0.0; LANES];
        kernels::form(&modulation.0, noise, ranges, powers, formed, &mut disagreement);
        for lane in 0..LANES {
            valid[lane] &= disagreement[lane] <= self.inconsistency;
        }
    }

    /// [`DepthCamera::measure`] of each lane; `axis`: cosines of the pixels' angles off the optical axis.
    pub(crate) fn measure_all(
        &self,
        rng: &Rng,
        beams: &[u32],
        axis: &[f32; LANES],
        seen: Option<&[f32; LANES]>,
        cos: &[f32; LANES],
        ranges: &mut [f32; LANES],
    ) {
        if let Some(seen) = seen {
            for lane in 0..beams.len() {
                ranges[lane] *= seen[lane] / axis[lane];
            }
        }
        if let Some(depth) = &self.depth {
            let mut normal = [0.0; LANES];
            rng.normals(beams, &[0; LANES][..beams.len()], Draw::DepthJitter, &mut normal[..beams.len()]);
            depth.measure_all(axis, cos, &normal, ranges);
        }
    }

    /// Multiplies `values` by [`DepthCamera::gain`] of pixels whose rays are `cos` off the axis.
    pub fn dim(&self, cos: &[f32; LANES], values: &mut [f32; LANES]) {
        if self.vignetting {
            kernels::vignette(cos, values);
        }
        kernels::illuminate(&self.illumination, cos, values);
    }

    /// Actual directions of pixels with the nominal directions `from`; both are unit vectors in the sensor frame.
    ///
    /// Published lateral noise grows with the incidence angle, which is not known before the ray is traced: the number
    /// is that at normal incidence.
    pub(crate) fn jitter_directions(&self, rng: &Rng, beams: &[u32], from: [&[f32]; 3], to: &mut [[f32; LANES]; 3]) {
        let [across, down] = self.aside.unwrap_or_default();
        let (mut y, mut z) = ([0.0; LANES], [0.0; LANES]);
        let count = beams.len();
        rng.normal_pairs(beams, &[0; LANES][..count], Draw::PixelDirection, &mut y[..count], &mut z[..count]);
        kernels::jitter_directions(from, across, down, [&y, &z], to);
    }

    /// The measured range, m, of pixel `beam`, whose ray is `axis` (the cosine) off the optical axis and meets its
    /// surface at an incidence angle of cosine `cos`, where the range would be `range` without depth errors. A depth
    /// image holds depths: the depth of the point that a pixel really sees, with the cosine `seen`, is reported in its
    /// nominal direction.
    pub fn measure(&self, rng: &Rng, beam: u32, axis: f32, seen: Option<f32>, cos: f32, range: f32) -> f32 {
        let range = seen.map_or(range, |seen| range * (seen / axis));
        let Some(depth) = &self.depth else { return range };
        let [normal, _] = rng.normal_pair(beam, Draw::DepthJitter, 0);
        depth.measure(range * axis, cos, normal) / axis
    }
}
