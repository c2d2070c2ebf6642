//! The face of a sonar: the power with which it transmits in, or receives from, any direction.

use glam::Vec3;
use ground::math::log2;

/// log2 of the least power assigned to a face, 1e-15; also of directions behind it.
pub const FAINT: f32 = -49.8;

/// A side of a face that forms no beam: its pattern and its width, rad.
pub(super) const EVERYWHERE: (fn(f64) -> f64, f64) = (|_| 1.0, std::f64::consts::PI);

/// A face that points along an axis, with tables of its patterns.
#[derive(Clone, Debug, Default)]
pub(crate) struct Aperture {
    /// Unit vectors in the sensor's frame: its axis, its long edge and the one across it.
    frame: [Vec3; 3],
    /// Amplitudes along the long edge, or all round the axis if it is round.
    along: PatternTable,
    across: PatternTable,
    round: bool,
}

impl Aperture {
    /// A face with a pattern and its width (rad) along the long edge, as a function of the sine of the angle off the
    /// axis, and one across it, as a function of the sine of the angle in the plane of the axis and the edge across.
    /// `frame`: see [`Aperture`].
    pub fn new(
        frame: [[f64; 3]; 3],
        along: (impl Fn(f64) -> f64, f64),
        across: (impl Fn(f64) -> f64, f64),
    ) -> Aperture {
        let [along, across] = [PatternTable::new(along.0, along.1), PatternTable::new(across.0, across.1)];
        Aperture { frame: frame.map(vector), along, across, round: false }
    }

    /// A face with one pattern all round its axis.
    pub fn round(frame: [[f64; 3]; 3], lobe: impl Fn(f64) -> f64, width: f64) -> Aperture {
        let (along, across) = (PatternTable::new(lobe, width), PatternTable::default());
        Aperture { frame: frame.map(vector), along, across, round: true }
    }

    /// log2 of the power along a unit `direction` in the sensor's frame; [`FAINT`] behind the face.
    pub fn power(&self, direction: Vec3) -> f32 {
        let [ahead, along, across] = self.frame.map(|axis| axis.dot(direction));
        if ahead <= 0.0 {
            return FAINT;
        }
        let amplitude = if self.round {
            self.along.at((along * along + across * across).sqrt())
        } else {
            self.along.at(along) * self.across.at(across / (across * across + ahead * ahead).sqrt())
        };
        log2((amplitude * amplitude).max(1e-15))
    }
}

fn vector(axis: [f64; 3]) -> Vec3 {
    axis.map(|part| part as f32).into()
}

/// A pattern at even steps of the sine from -1 to 1.
#[derive(Clone, Debug, Default)]
struct PatternTable(Vec<f32>);

impl PatternTable {
    fn new(pattern: impl Fn(f64) -> f64, width: f64) -> PatternTable {
        /// Steps per width: the power of a line is then off by at most 0.003 dB on its main lobe.
        const FINE: f64 = 32.0;
        let half = (FINE / width).ceil().clamp(64.0, 262_144.0) as i32;
        PatternTable((-half..=half).map(|step| pattern(f64::from(step) / f64::from(half)) as f32).collect())
    }

    fn at(&self, sine: f32) -> f32 {
        let steps = self.0.len() - 1;
        let at = (0.5 + 0.5 * sine) * steps as f32;
        let step = (at as usize).min(steps - 1);
        let part = at - step as f32;
        self.0[step] * (1.0 - part) + self.0[step + 1] * part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lobe;

    #[test]
    fn tables_are_the_patterns() {
        let (lobe, tall) = (Lobe::Width(0.5).at(1.0), Lobe::Width(50.0).at(1.0));
        let (sin, cos) = 0.4f64.sin_cos();
        // The axis points to port, 0.4 rad down.
        let frame = [[0.0, cos, -sin], [1.0, 0.0, 0.0], [0.0, sin, cos]];
        let face = Aperture::new(
            frame,
            (|sine| lobe.amplitude(sine), lobe.width()),
            (|sine| tall.amplitude(sine), tall.width()),
        );
        for (forward, angle) in [(0.0f64, 0.0), (0.003, 0.2), (-0.004, -0.3), (0.012, 1.1)] {
            let (sin, cos) = (angle - 0.4f64).sin_cos();
            let level = (1.0 - forward * forward).sqrt();
            let direction = vector([forward, level * cos, level * sin]);
            let expected = 20.0 * (lobe.amplitude(forward) * tall.amplitude(angle.sin())).abs().log10();
            let found = 10.0 * f64::from(face.power(direction)) * 2f64.log10();
            assert!((found - expected).abs() < 0.02, "{forward} {angle}: {found} {expected}");
        }
        assert_eq!(face.power(Vec3::NEG_Y), FAINT);
        let round = Aperture::round(frame, |sine| tall.amplitude(sine), tall.width());
        let aside = vector([0.1f64.sin(), 0.1f64.cos() * cos, -0.1f64.cos() * sin]);
        let expected = tall.amplitude(0.1f64.sin()).powi(2).log2();
        assert!((f64::from(round.power(aside)) - expected).abs() < 1e-3);
    }
}
