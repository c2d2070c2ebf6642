//! The encoder that measures scan angles.

use ground::lanes::LANES;

/// The scale error of an encoder: it reports angles larger by a fraction than they are. Line scanners that look across the flight
/// count them from straight down, about their x axis; all others count azimuths, about z.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EncoderScale {
    /// The true angle less the reported one, over the reported one.
    excess: f32,
    /// Whether the axis is x.
    across: bool,
}

impl EncoderScale {
    /// Of an encoder with a scale error of `ppm`, parts per million; `None`: it has none.
    pub fn new(ppm: f64, across: bool) -> Option<EncoderScale> {
        // Reported = (1 + scale) true.
        let scale = 1e-6 * ppm;
        (scale != 0.0).then_some(EncoderScale { excess: (-scale / (1.0 + scale)) as f32, across })
    }

    /// Turns the first `count` of the reported directions (x, y, z in the sensor frame) into true ones.
    pub fn correct(&self, count: usize, [x, y, z]: &mut [[f32; LANES]; 3]) {
        for lane in 0..count {
            // The plane in which the angle is counted, from the first of its axes to the second.
            let (from, to) = if self.across { (-z[lane], y[lane]) } else { (x[lane], y[lane]) };
            let (sin, cos) = (self.excess * to.atan2(from)).sin_cos();
            let (from, to) = (from * cos - to * sin, from * sin + to * cos);
            y[lane] = to;
            if self.across {
                z[lane] = -from;
            } else {
                x[lane] = from;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reported_angles_are_a_fraction_more_than_true_ones() {
        for across in [true, false] {
            let encoder = EncoderScale::new(2000.0, across).unwrap();
            let reported = [-170.0f32, -60.0, -1.0, 0.0, 30.0, 90.0, 179.0].map(f32::to_radians);
            let mut directions = [[0.0; LANES]; 3];
            for (lane, angle) in reported.iter().enumerate() {
                let (sin, cos) = angle.sin_cos();
                let [x, y, z] = if across { [0.6, 0.8 * sin, -0.8 * cos] } else { [0.8 * cos, 0.8 * sin, 0.6] };
                (directions[0][lane], directions[1][lane], directions[2][lane]) = (x, y, z);
            }
            encoder.correct(reported.len(), &mut directions);
            for (lane, angle) in reported.iter().enumerate() {
                let [x, y, z] = directions.map(|axis| axis[lane]);
                let (found, along) = if across { (y.atan2(-z), x) } else { (y.atan2(x), z) };
                assert!((found * 1.002 - angle).abs() < 1e-6 && along == 0.6, "{found} of {angle}");
                assert!((x * x + y * y + z * z - 1.0).abs() < 1e-6);
            }
        }
        assert!(EncoderScale::new(0.0, true).is_none());
    }
}
