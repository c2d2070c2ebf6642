//! Position of an echo received along a beam after a given time, by an assumed cast: how survey software computes a
//! sounding (Lurton 2010, "An introduction to underwater acoustics", section 8.5; Beaudoin, Hughes Clarke and Bartlett
//! 2004, Lighthouse 70).

use super::{RefractedRay, WaterColumn};

impl WaterColumn {
    /// Horizontal distance, m, and depth, m, of sound `time` s after it left `depth` m at this sine and cosine of the
    /// grazing angle (positive down), in water of the sound speed `here`, m/s: that measured at the instrument, which
    /// may differ from the column's. `None`: the ray does not enter the column, or reaches the surface.
    pub fn place_after(&self, time: f64, depth: f64, [sine, cosine]: [f64; 2], here: f64) -> Option<[f64; 2]> {
        // Most slabs that a ray passes; rays caught in a duct would go on for ever.
        let most = 1000 + 8 * self.slabs.len();
        let slab = self.slab_at(depth);
        // Snell's law from the instrument's water into the column.
        let cosine = cosine * self.slabs[slab].speed_at(depth) / here;
        if cosine > 1.0 + 1e-9 {
            return None;
        }
        let cosine = cosine.min(1.0);
        let sine = (1.0 - cosine * cosine).sqrt().copysign(sine);
        let mut ray = RefractedRay::launch(depth, [sine, cosine], &self.slabs, slab);
        for _ in 0..most {
            let slab = &self.slabs[ray.slab];
            let (length, end) = ray.exit(slab);
            if length.is_finite() {
                let next = ray.advanced(slab, length);
                if next.time < time {
                    if ray.slab == 0 && end == super::End::Top {
                        return None;
                    }
                    ray = next;
                    ray.cross(&self.slabs, end);
                    continue;
                }
            }
            // The end is within this slab: speeds hardly differ, so each iteration gains several digits.
            let (mut length, mut near) = (0.0, ray);
            for _ in 0..20 {
                let rest = (time - near.time) * near.speed;
                if rest.abs() < 1e-6 {
                    break;
                }
                length += rest;
                near = ray.advanced(slab, length);
            }
            return Some([near.distance, near.depth]);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::environment::Environment;

    fn column(profile: &str) -> WaterColumn {
        let water = Environment::from_yaml(&format!("water: {{profile: {profile}}}")).unwrap().water.unwrap();
        WaterColumn::new(&water, 100e3, 2.0).unwrap().0
    }

    #[test]
    fn straight_in_uniform_water() {
        let [level, depth] = column("{constant: {speed_m_s: 1500}}").place_after(0.1, 2.0, [0.6, 0.8], 1500.0).unwrap();
        assert!((level - 120.0).abs() < 1e-6 && (depth - 92.0).abs() < 1e-6);
        // The instrument's own water is faster: Snell.
        let [level, depth] = column("{constant: {speed_m_s: 1500}}").place_after(0.1, 2.0, [0.6, 0.8], 1600.0).unwrap();
        assert!((level - 112.5).abs() < 1e-6 && (depth - 2.0 - 150.0 * (1.0f64 - 0.5625).sqrt()).abs() < 1e-6);
        assert!(column("{constant: {speed_m_s: 1500}}").place_after(0.1, 2.0, [0.1, 0.995], 1400.0).is_none());
        assert!(column("{constant: {speed_m_s: 1500}}").place_after(0.1, 2.0, [-0.6, 0.8], 1500.0).is_none());
    }

    /// By hand: with a gradient `g` a ray is a circle, and `t = (artanh(sin a) - artanh(sin b)) / g`.
    #[test]
    fn circles_in_a_gradient_however_it_is_cut() {
        let (gradient, speed, sine, to) = (-0.5f64, 1540.0f64, 0.5f64, 0.53f64);
        let time = (to.atanh() - sine.atanh()) / -gradient;
        let snell = (1.0 - sine * sine).sqrt() / speed;
        let level = (sine - to) / (snell * gradient);
        let fall = ((1.0 - to * to).sqrt() / snell - speed) / gradient;
        for rows in [2, 7, 301] {
            let row = |index: usize| {
                let depth = 250.0 * index as f64 / (rows - 1) as f64;
                format!("{{depth_m: {depth}, speed_m_s: {}}}", speed + gradient * (depth - 2.0))
            };
            let rows: Vec<String> = (0..rows).map(row).collect();
            let column = column(&format!("{{cast: [{}]}}", rows.join(", ")));
            let cosine = (1.0 - sine * sine).sqrt();
            let found = column.place_after(time, 2.0, [sine, cosine], speed).unwrap();
            assert!(
                (found[0] - level).abs() < 1e-5 && (found[1] - 2.0 - fall).abs() < 1e-5,
                "{found:?} {level} {fall}"
            );
        }
    }
}
