//! Plane waves at layers of dielectrics.

use num_complex::Complex64;
use std::f64::consts::TAU;

/// Speed of light in vacuum, m/s (exact in the SI).
const LIGHT_M_S: f64 = 299_792_458.0;

/// Wavenumber in air, `2 pi f / c`, rad/m.
pub(super) fn wavenumber(frequency_hz: f64) -> f64 {
    TAU * frequency_hz / LIGHT_M_S
}

/// The root with an imaginary part of 0 or less: of waves that vary as `exp(+j omega t)`, the one that decays inwards.
fn decaying(square: Complex64) -> Complex64 {
    let size = square.norm();
    let (re, im) = (((size + square.re) / 2.0).max(0.0).sqrt(), ((size - square.re) / 2.0).max(0.0).sqrt());
    Complex64::new(re, -im)
}

/// A layer at one frequency.
#[derive(Clone, Copy, Debug)]
pub(super) struct Film {
    /// Relative permittivity.
    pub eps: Complex64,
    /// Thickness times the wavenumber in air.
    pub depth: f64,
}

/// Amplitudes of a reflected and of a transmitted wave, each for both polarisations, `s` first.
pub(super) type Amplitudes = [[Complex64; 2]; 2];

/// Layers from the outside inwards, over a body that fills the rest of space; air for sheets and panes.
#[derive(Clone, Debug)]
pub(super) struct Stack {
    pub films: Vec<Film>,
    pub below: Complex64,
}

impl Stack {
    /// Reflection and transmission of a plane wave that arrives in air at an incidence of cosine `cos`, 0 to 1.
    ///
    /// Fresnel's coefficients at each boundary, with `q = sqrt(eps - sin^2)`: `(q1 - q2) / (q1 + q2)` of the electric
    /// field for `s`, `(eps2 q1 - eps1 q2) / (eps2 q1 + eps1 q2)` of the magnetic field for `p` (Born and Wolf, Principles
    /// of Optics, 1.5.2). Layers by Parratt's recursion (1954, Phys. Rev. 95, 359) from below, with
    /// `d = exp(-j k q thickness)`:
    /// `R = (r + R' d^2) / (1 + r R' d^2)`, `T = (1 + r) T' d / (1 + r R' d^2)`: ITU-R P.2040-3 eq. 43 for a single slab.
    ///
    /// Transmission is that of the field behind the lowest layer over the one that would be there in air: its phase is what
    /// the layers add.
    pub(super) fn at(&self, cos: f64) -> Amplitudes {
        let sin2 = 1.0 - cos * cos;
        let inside = |eps: Complex64| decaying(eps - sin2);
        let one = Complex64::ONE;
        let (mut back, mut through) = ([Complex64::ZERO; 2], [one; 2]);
        let (mut eps, mut q) = (self.below, inside(self.below));
        for (index, film) in (0..=self.films.len()).rev().map(|index| (index, index.checked_sub(1))) {
            let (above, above_q) = match film {
                Some(film) => (self.films[film].eps, inside(self.films[film].eps)),
                None => (one, Complex64::from(cos)),
            };
            let step = match self.films.get(index) {
                Some(film) => (Complex64::new(0.0, -film.depth) * q).exp(),
                None => one,
            };
            let fresnel = [ratio(above_q, q), ratio(eps * above_q, above * q)];
            for (polarisation, r) in fresnel.into_iter().enumerate() {
                let inner = back[polarisation] * step * step;
                let all = 1.0 + r * inner;
                back[polarisation] = (r + inner) / all;
                through[polarisation] *= (1.0 + r) * step / all;
            }
            (eps, q) = (above, above_q);
        }
        let air = Complex64::from_polar(1.0, cos * self.films.iter().map(|film| film.depth).sum::<f64>());
        [back, through.map(|amplitude| amplitude * air)]
    }
}

/// `(a - b) / (a + b)`, and 0 where nothing differs.
fn ratio(a: Complex64, b: Complex64) -> Complex64 {
    if a == b { Complex64::ZERO } else { (a - b) / (a + b) }
}

#[cfg(test)]
mod tests {
    use super::super::{Dielectric, ItuMaterial};
    use super::*;

    fn eps(material: ItuMaterial, ghz: f64) -> Complex64 {
        Dielectric::Itu { material, extrapolate: true }.permittivity(ghz * 1e9).unwrap()
    }

    fn sheet(material: ItuMaterial, ghz: f64, mm: f64) -> Stack {
        let film = Film { eps: eps(material, ghz), depth: wavenumber(ghz * 1e9) * mm * 1e-3 };
        Stack { films: vec![film], below: Complex64::ONE }
    }

    fn powers(stack: &Stack, cos: f64) -> [[f64; 2]; 2] {
        stack.at(cos).map(|pair| pair.map(|amplitude| amplitude.norm_sqr()))
    }

    fn near(found: f64, expected: f64, digits: f64) {
        assert!((found / expected - 1.0).abs() < digits, "{found}, not {expected}");
    }

    /// Computed with numpy from ITU-R P.2040-3: reflected power at normal incidence, at 24.125, 60 and 77 GHz.
    #[test]
    fn bodies_reflect_at_normal_incidence() {
        use ItuMaterial::{
            Brick, CeilingBoard, Chipboard, Concrete, Floorboard, Glass, Marble, Metal, Plasterboard, Plywood, Wood,
        };
        let gap = f64::NAN;
        for (material, expected) in [
            (Concrete, [0.154_511, 0.154_217, 0.154_155]),
            (Brick, [0.107_767, 0.107_761, 0.107_760]),
            (Plasterboard, [0.060_736_8, 0.060_710_1, 0.060_703_3]),
            (Wood, [0.029_316_4, 0.029_357_6, 0.029_369_9]),
            (Glass, [0.185_482, 0.185_597, 0.185_644]),
            (CeilingBoard, [0.009_569_82, 0.009_573_47, 0.009_574_56]),
            (Chipboard, [0.054_766_7, 0.054_549_4, 0.054_503_5]),
            (Plywood, [0.060_615_8, gap, gap]),
            (Marble, [0.205_687, 0.205_685, 0.205_684]),
            (Floorboard, [gap, 0.099_346_8, 0.099_555_9]),
            (Metal, [0.998_964, 0.998_367, 0.998_151]),
        ] {
            for (ghz, expected) in [24.125, 60.0, 77.0].into_iter().zip(expected) {
                if expected.is_nan() {
                    continue;
                }
                let body = Stack { films: Vec::new(), below: eps(material, ghz) };
                let [s, p] = powers(&body, 1.0)[0];
                near(s, expected, 4e-6);
                near(p, expected, 4e-6);
            }
        }
        for (law, expected) in [
            (Dielectric::Skin, [0.475_265, 0.377_696, 0.340_526]),
            (Dielectric::Water { temperature_c: 20.0, salinity_g_kg: 0.0 }, [0.585_716, 0.484_231, 0.446_060]),
        ] {
            for (ghz, expected) in [24.125, 60.0, 77.0].into_iter().zip(expected) {
                let body = Stack { films: Vec::new(), below: law.permittivity(ghz * 1e9).unwrap() };
                near(powers(&body, 1.0)[0][0], expected, 3e-6);
            }
        }
    }

    /// Computed with numpy: concrete at 77 GHz.
    #[test]
    fn concrete_depends_on_the_angle() {
        let body = Stack { films: Vec::new(), below: eps(ItuMaterial::Concrete, 77.0) };
        for (degrees, s, p) in [
            (30.0, 0.195_320, 0.116_239),
            (60.0, 0.382_899, 0.011_405_5),
            (80.0, 0.714_479, 0.150_970),
            (88.0, 0.934_592, 0.700_338),
        ] {
            let found = powers(&body, f64::to_radians(degrees).cos())[0];
            near(found[0], s, 3e-6);
            near(found[1], p, 5e-6);
        }
        let p = |degrees: f64| powers(&body, degrees.to_radians().cos())[0][1];
        let least = (0..9000).map(|step| f64::from(step) / 100.0).min_by(|a, b| p(*a).total_cmp(&p(*b))).unwrap();
        // Without loss it would be Brewster's angle, 66.40 degrees.
        assert!((least - 66.40).abs() < 0.025, "{least}");
    }

    /// Computed with numpy from ITU-R P.2040-3 eq. 43.
    #[test]
    fn panes_and_boards_let_waves_through() {
        use ItuMaterial::{Glass, Plasterboard, Wood};
        for (material, mm, ghz, reflected, transmitted) in [
            (Glass, 4.0, 24.125, 0.444_342, 0.453_654),
            (Glass, 4.0, 60.0, 0.041_209_2, 0.496_164),
            (Glass, 4.0, 77.0, 0.147_124, 0.348_491),
            (Plasterboard, 12.5, 60.0, 0.071_066_2, 0.281_575),
        ] {
            let [back, through] = powers(&sheet(material, ghz, mm), 1.0);
            for polarisation in 0..2 {
                near(back[polarisation], reflected, 3e-6);
                near(through[polarisation], transmitted, 3e-6);
            }
        }
        for (material, mm, db) in [(Plasterboard, 12.5, -6.858), (Wood, 30.0, -17.448)] {
            let found = 10.0 * powers(&sheet(material, 77.0, mm), 1.0)[1][0].log10();
            assert!((found - db).abs() < 6e-4, "{found}, not {db}");
        }
    }

    /// A pane without loss passes what it does not reflect; one of half a wavelength reflects nothing.
    #[test]
    fn nothing_is_lost_without_loss() {
        let eps = Complex64::new(4.0, 0.0);
        for cos in [1.0, 0.7, 0.3, 0.01] {
            for depth in [0.1, 1.0, 7.0] {
                let films = vec![Film { eps, depth }, Film { eps: Complex64::new(2.3, 0.0), depth: 0.6 }];
                let [back, through] = powers(&Stack { films, below: Complex64::ONE }, cos);
                for polarisation in 0..2 {
                    near(back[polarisation] + through[polarisation], 1.0, 1e-12);
                }
            }
        }
        let half = Stack { films: vec![Film { eps, depth: TAU / 4.0 }], below: Complex64::ONE };
        assert!(powers(&half, 1.0)[0][0] < 1e-24);
        // The wave is half a wavelength late, as if it had passed twice the pane's air.
        let late = half.at(1.0)[1][0];
        assert!((late - Complex64::from_polar(1.0, -TAU / 2.0 + TAU / 4.0)).norm() < 1e-12, "{late}");
    }

    /// A layer of the substrate's own matter, however it is cut, is no layer; one of no thickness neither.
    #[test]
    fn layers_of_the_same_matter_vanish() {
        let below = eps(ItuMaterial::Concrete, 60.0);
        let bare = Stack { films: Vec::new(), below };
        let films = vec![Film { eps: below, depth: 3.0 }, Film { eps: below, depth: 0.2 }];
        let thin = vec![Film { eps: Complex64::new(9.0, -3.0), depth: 0.0 }];
        for cos in [1.0, 0.5, 0.1] {
            for other in [&films, &thin] {
                let other = Stack { films: other.clone(), below };
                for polarisation in 0..2 {
                    let off = bare.at(cos)[0][polarisation] - other.at(cos)[0][polarisation];
                    assert!(off.norm() < 1e-12, "{off}");
                }
            }
        }
        let metal = eps(ItuMaterial::Metal, 77.0);
        let [s, p] = Stack { films: Vec::new(), below: metal }.at(1.0)[0];
        assert!((s + 1.0).norm() < 2e-3 && (p - 1.0).norm() < 2e-3, "{s} {p}");
    }
}
