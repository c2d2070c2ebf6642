//! A surface at one frequency.

use super::stack::{Amplitudes, Stack};
use num_complex::{Complex32, Complex64};
use serde::Deserialize;
use std::f32::consts::LN_10;

/// Amplitudes for the two polarisations.
///
/// At normal incidence, where nothing distinguishes them, `s = -p` for reflection: `s` is that of the electric field, `p`
/// that of the magnetic one. A perfect conductor has `s = -1` and `p = 1` at every angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Polarised {
    /// Electric field at right angles to the plane of incidence.
    pub s: Complex32,
    /// Electric field in the plane of incidence.
    pub p: Complex32,
}

impl Polarised {
    /// Power of an unpolarised wave, `(|s|^2 + |p|^2) / 2`.
    pub fn power(self) -> f32 {
        (self.s.norm_sqr() + self.p.norm_sqr()) / 2.0
    }
}

/// Backscatter of a surface besides the glint that its roughness gives: `gamma sin^p(g)` m^2/m^2 at the grazing angle
/// `g`, at the radar's frequency.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clutter {
    /// `10 log gamma`, dB, -100 to 10.
    pub gamma_db: f64,
    /// Exponent `p`, 0 to 10: 1, the default, is the constant-gamma law, 2 Lambert's.
    #[serde(default = "constant_gamma")]
    pub exponent: f64,
}

fn constant_gamma() -> f64 {
    1.0
}

/// A [`super::Radio`] surface at one frequency: made once, asked for every wave.
///
/// Arguments are cosines of the incidence angle, between wave and normal, 0 to 1. Waves vary as `exp(+j omega t)`, so that
/// distance `r` adds the phase `-k r`.
#[derive(Clone, Debug)]
pub struct RadioSurface {
    matter: Matter,
    /// `2 (k h)^2` of the rms height.
    roughness: f32,
    /// Standard deviation of slopes, squared.
    slope2: f32,
    /// Reflected power at normal incidence.
    normal: f32,
    /// `gamma` and its exponent.
    clutter: [f32; 2],
    /// Whether what enters the surface scatters, too.
    volume: bool,
}

/// What reflects and transmits.
#[derive(Clone, Debug)]
enum Matter {
    /// A body of this permittivity.
    Body {
        re: f32,
        im: f32,
    },
    Table(RadioTable),
}

impl RadioSurface {
    /// A body of relative permittivity `eps`. `heights`: the rms height in units of `1 / k`, and the slope.
    pub(super) fn body(eps: Complex64, heights: [f32; 2], clutter: Option<Clutter>) -> RadioSurface {
        RadioSurface::new(Matter::Body { re: eps.re as f32, im: eps.im as f32 }, heights, clutter, false)
    }

    /// Layers, which let waves through if there is no body below.
    pub(super) fn layered(
        stack: &Stack,
        transparent: bool,
        heights: [f32; 2],
        clutter: Option<Clutter>,
    ) -> RadioSurface {
        let table = RadioTable::new(|cos| {
            let [back, through] = stack.at(cos);
            [back, if transparent { through } else { [Complex64::ZERO; 2] }]
        });
        RadioSurface::new(Matter::Table(table), heights, clutter, false)
    }

    /// A volume of scatterers of mean permittivity `eps` that dims a wave by `loss_db` at right angles to its surface, and
    /// by the longer way at others.
    pub(super) fn volume(eps: f64, loss_db: f64, heights: [f32; 2], clutter: Option<Clutter>) -> RadioSurface {
        let surface = Stack { films: Vec::new(), below: eps.into() };
        let table = RadioTable::new(|cos| {
            let through = Complex64::from(10f64.powf(-loss_db / (20.0 * cos.max(1e-6))));
            let [back, _] = surface.at(cos);
            [back, back.map(|back| through * (1.0 - back.norm_sqr()).max(0.0).sqrt())]
        });
        RadioSurface::new(Matter::Table(table), heights, clutter, true)
    }

    fn new(matter: Matter, [height, slope]: [f32; 2], clutter: Option<Clutter>, volume: bool) -> RadioSurface {
        let clutter = clutter
            .map_or([0.0, 1.0], |clutter| [(clutter.gamma_db as f32 * LN_10 / 10.0).exp(), clutter.exponent as f32]);
        let (roughness, slope2) = (2.0 * height * height, slope * slope);
        let mut surface = RadioSurface { matter, roughness, slope2, normal: 0.0, clutter, volume };
        surface.normal = surface.reflect(1.0).power();
        surface
    }

    /// Amplitude that the surface would reflect if it were smooth: see [`RadioSurface::coherent`]. The phase is that at the
    /// outermost boundary.
    pub fn reflect(&self, cos: f32) -> Polarised {
        let cos = cos.clamp(0.0, 1.0);
        match &self.matter {
            &Matter::Body { re, im } => fresnel(Complex32::new(re, im), cos),
            Matter::Table(table) => table.at(cos).0,
        }
    }

    /// Amplitude that passes a pane, a sheet or a volume as a whole, over that of a wave along the same way in air, so that
    /// the phase is what the layers add; 0 for bodies.
    pub fn transmit(&self, cos: f32) -> Polarised {
        match &self.matter {
            Matter::Body { .. } => Polarised::default(),
            Matter::Table(table) => table.at(cos.clamp(0.0, 1.0)).1,
        }
    }

    /// Factor on the amplitude of a mirror image, 0 to 1, because of roughness: `exp(-2 (k h cos)^2)` (Ament 1953, Proc. IRE
    /// 41, 142), of one reflection.
    pub fn coherent(&self, cos: f32) -> f32 {
        (-self.roughness * cos * cos).exp()
    }

    /// Backscatter `sigma^0`, m^2/m^2, both polarisations together: incoherent, of rough surfaces and of what is inside
    /// volumes.
    ///
    /// Clutter `gamma cos^p` and a glint of facets, `G exp(-tan^2 / 2 m^2) / (2 m^2 cos^4)` at slopes `m` (Ulaby, Moore and
    /// Fung 1982, eq. 12.49), limited to the power that the mirror image leaves: what a bistatic
    /// `gamma (cos cos')^(p/2)` scatters over all directions is at most `R (1 - rho^2)`, for volumes what else does not
    /// pass, too; the glint `G` has the rest of `R (1 - rho^2)`.
    pub fn clutter(&self, cos: f32) -> f32 {
        let cos = cos.clamp(0.0, 1.0);
        let [scattered, glint] = self.shares(cos);
        if cos <= 0.0 {
            return 0.0;
        }
        let [_, p] = self.clutter;
        // gamma cos^p by the power that gamma cos^(p/2 - 1) / (p + 2) scatters.
        let spread = if scattered > 0.0 { scattered * (p + 2.0) * cos.powf(p / 2.0 + 1.0) } else { 0.0 };
        let cos2 = cos * cos;
        let lobe = ((cos2 - 1.0) / (2.0 * self.slope2 * cos2)).exp();
        // Where cos^4 underflows the exponential has long been 0.
        spread + if glint > 0.0 && lobe > 0.0 { glint * lobe / (2.0 * self.slope2 * cos2 * cos2) } else { 0.0 }
    }

    /// Parts of the power of a wave that become clutter and glint.
    fn shares(&self, cos: f32) -> [f32; 2] {
        let [gamma, p] = self.clutter;
        if (gamma == 0.0 && self.roughness == 0.0) || cos <= 0.0 {
            return [0.0, 0.0];
        }
        let reflected = self.reflect(cos).power();
        // 1 - rho^2.
        let spoilt = -(-2.0 * self.roughness * cos * cos).exp_m1();
        let rough = reflected * spoilt;
        let available = if self.volume { 1.0 - reflected + rough - self.transmit(cos).power() } else { rough };
        let wanted = gamma * cos.powf(p / 2.0 - 1.0) / (p + 2.0);
        let scattered = wanted.min(available).max(0.0);
        let facets = self.normal.min(reflected) * spoilt;
        let glint = if self.volume { facets.min(available - scattered) } else { facets - scattered };
        [scattered, if self.slope2 > 0.0 { glint.max(0.0) } else { 0.0 }]
    }
}

/// Fresnel's coefficients at a body, as in [`Stack::at`].
fn fresnel(eps: Complex32, cos: f32) -> Polarised {
    let square = eps - (1.0 - cos * cos);
    let size = square.norm();
    let (re, im) = (((size + square.re) / 2.0).max(0.0).sqrt(), ((size - square.re) / 2.0).max(0.0).sqrt());
    let q = Complex32::new(re, -im);
    let over = |a: Complex32, b: Complex32| (a - b) * (a + b).conj() / (a + b).norm_sqr().max(f32::MIN_POSITIVE);
    Polarised { s: over(cos.into(), q), p: over(eps * cos, q) }
}

/// Reflection and transmission at equal steps of the root of the cosine, which resolves the Brewster angle of metals, a
/// thirtieth of a degree from grazing.
#[derive(Clone, Debug)]
struct RadioTable {
    nodes: Vec<TableNode>,
}

/// Amplitudes at one angle.
type TableNode = [Polarised; 2];

impl RadioTable {
    /// Fewest and most steps.
    const STEPS: [usize; 2] = [256, 1 << 15];

    /// Largest error of an amplitude midway between nodes at which no more nodes are added: -74 dB.
    const ERROR: f32 = 2e-4;

    /// A table of `exact`, by as many steps as it takes, within limits.
    fn new(exact: impl Fn(f64) -> Amplitudes) -> RadioTable {
        let node = |root: f64| {
            exact(root * root).map(|[s, p]| {
                let [s, p] = [s, p].map(|value| Complex32::new(value.re as f32, value.im as f32));
                Polarised { s, p }
            })
        };
        let [mut steps, most] = RadioTable::STEPS;
        let at = |step: usize, steps: usize| node(step as f64 / steps as f64);
        let mut nodes: Vec<TableNode> = (0..=steps).map(|step| at(step, steps)).collect();
        loop {
            let halves: Vec<TableNode> = (0..steps).map(|step| at(2 * step + 1, 2 * steps)).collect();
            let off = |step: usize| {
                let middle = between(&nodes[step], &nodes[step + 1], 0.5);
                let pairs = middle.iter().zip(&halves[step]);
                pairs.map(|(a, b)| (a.s - b.s).norm().max((a.p - b.p).norm())).fold(0.0, f32::max)
            };
            if steps >= most || (0..steps).map(off).fold(0.0, f32::max) <= RadioTable::ERROR {
                return RadioTable { nodes };
            }
            let last = nodes[steps];
            nodes = nodes.into_iter().zip(halves).flat_map(|(node, half)| [node, half]).chain([last]).collect();
            steps *= 2;
        }
    }

    /// Linear between nodes.
    fn at(&self, cos: f32) -> (Polarised, Polarised) {
        let steps = self.nodes.len() - 1;
        let place = cos.sqrt() * steps as f32;
        let step = (place as usize).min(steps - 1);
        let [back, through] = between(&self.nodes[step], &self.nodes[step + 1], place - step as f32);
        (back, through)
    }
}

fn between(low: &TableNode, high: &TableNode, part: f32) -> TableNode {
    [0, 1].map(|which| {
        let (low, high): (&Polarised, &Polarised) = (&low[which], &high[which]);
        Polarised { s: low.s + (high.s - low.s) * part, p: low.p + (high.p - low.p) * part }
    })
}

#[cfg(test)]
mod tests {
    use super::super::stack::{Film, wavenumber};
    use super::super::{Dielectric, ItuMaterial, Radio, RadioLaw, RadioLayer};
    use super::*;
    use std::f64::consts::PI;

    const CONCRETE: Dielectric = Dielectric::Itu { material: ItuMaterial::Concrete, extrapolate: false };
    const GLASS: Dielectric = Dielectric::Itu { material: ItuMaterial::Glass, extrapolate: true };

    fn layers(layers: &[(Dielectric, f64)], over: Option<Dielectric>) -> Radio {
        let layers = layers.iter().map(|&(of, thickness_mm)| RadioLayer { of, thickness_mm }).collect();
        Radio::new(RadioLaw::Layers { layers, over })
    }

    fn rough(law: RadioLaw, rms_height_mm: f64, gamma_db: f64, exponent: f64) -> Radio {
        Radio { rms_height_mm, clutter: Some(Clutter { gamma_db, exponent }), ..Radio::new(law) }
    }

    fn cosines() -> impl Iterator<Item = f32> {
        (0..=2000).map(|step| step as f32 / 2000.0)
    }

    /// Computed with numpy: see the tests of the laws, here of what scans use.
    #[test]
    fn surfaces_reflect_as_their_laws() {
        let concrete = Radio::new(RadioLaw::Body(CONCRETE)).at(77e9).unwrap();
        assert!((concrete.reflect(1.0).power() - 0.154_155).abs() < 1e-6);
        let at_60 = concrete.reflect(0.5);
        assert!((at_60.s.norm_sqr() - 0.382_899).abs() < 1e-6 && (at_60.p.norm_sqr() - 0.011_405_5).abs() < 1e-7);
        assert_eq!(concrete.transmit(0.5), Polarised::default());
        let pane = layers(&[(GLASS, 4.0)], None).at(77e9).unwrap();
        assert!(
            (pane.transmit(1.0).power() - 0.348_491).abs() < 1e-6
                && (pane.reflect(1.0).power() - 0.147_124).abs() < 1e-6
        );
        let metal = Radio::new(RadioLaw::Body(Dielectric::Metal)).at(77e9).unwrap();
        assert!((metal.reflect(1.0).power() - 0.998_151).abs() < 1e-6);
    }

    /// 0.1 mm of paint (Born and Wolf's recursion) only turns the phase of steel; a film of water makes a mirror of asphalt.
    #[test]
    fn thin_layers_count() {
        let paint = Dielectric::Permittivity { eps: 4.0, loss: 0.1, conductivity_s_m: 0.0 };
        let body = layers(&[(paint, 0.1)], Some(Dielectric::Metal)).at(77e9).unwrap();
        assert!(body.reflect(1.0).power() > 0.98);
        let asphalt = Dielectric::Permittivity { eps: 4.0, loss: 0.1, conductivity_s_m: 0.0 };
        let water = Dielectric::Water { temperature_c: 20.0, salinity_g_kg: 0.0 };
        let dry = Radio::new(RadioLaw::Body(asphalt)).at(77e9).unwrap().reflect(1.0).power();
        let wet = layers(&[(water, 1.0)], Some(asphalt)).at(77e9).unwrap().reflect(1.0).power();
        assert!((dry - 1.0 / 9.0).abs() < 1e-3 && (wet - 0.446).abs() < 0.05, "{dry} {wet}");
    }

    /// The body's formula in single precision, and tables: the largest error of an amplitude between nodes.
    #[test]
    fn single_precision_and_tables_follow_the_formula() {
        let worst = |radio: &Radio, stack: &Stack| {
            let surface = radio.at(77e9).unwrap();
            let mut worst: [f64; 2] = [0.0; 2];
            for step in 0..=20_000 {
                let cos = (f64::from(step) / 20_000.0).powi(2);
                let found = [surface.reflect(cos as f32), surface.transmit(cos as f32)];
                let exact = stack.at(f64::from(cos as f32));
                for which in 0..2 {
                    for (found, exact) in [found[which].s, found[which].p].into_iter().zip(exact[which]) {
                        let found = Complex64::new(found.re.into(), found.im.into());
                        worst[which] = worst[which].max((found - exact).norm());
                    }
                }
            }
            worst
        };
        for law in [CONCRETE, Dielectric::Metal, Dielectric::Skin] {
            let stack = Stack { films: Vec::new(), below: law.permittivity(77e9).unwrap() };
            let [back, _] = worst(&Radio::new(RadioLaw::Body(law)), &stack);
            assert!(back < 2e-6, "{law:?}: {back}");
        }
        let board = Dielectric::Itu { material: ItuMaterial::Plasterboard, extrapolate: false };
        let paint = Dielectric::Permittivity { eps: 4.0, loss: 0.1, conductivity_s_m: 0.0 };
        for (radio, below, films) in [
            (layers(&[(GLASS, 4.0)], None), None, vec![(GLASS, 4.0)]),
            (layers(&[(board, 12.5)], None), None, vec![(board, 12.5)]),
            (layers(&[(paint, 0.1)], Some(Dielectric::Metal)), Some(Dielectric::Metal), vec![(paint, 0.1)]),
        ] {
            let films = films
                .into_iter()
                .map(|(of, mm)| Film { eps: of.permittivity(77e9).unwrap(), depth: wavenumber(77e9) * mm * 1e-3 });
            let eps = below.map_or(Complex64::ONE, |law: Dielectric| law.permittivity(77e9).unwrap());
            let found = worst(&radio, &Stack { films: films.collect(), below: eps });
            let parts = if below.is_some() { 1 } else { 2 };
            assert!(found[..parts].iter().all(|off| *off < 2.2e-4), "{radio}: {found:?}");
        }
    }

    /// Computed with numpy: power that roughness takes from a mirror image at 77 GHz, dB.
    #[test]
    fn mirrors_are_lost_by_roughness() {
        for (mm, grazing_deg, db) in [
            (0.5, 90.0, -11.311),
            (0.5, 30.0, -2.8276),
            (0.5, 10.0, -0.341_06),
            (0.5, 2.0, -0.013_776),
            (1.0, 30.0, -11.311),
        ] {
            let surface = rough(RadioLaw::Body(CONCRETE), mm, -30.0, 1.0).at(77e9).unwrap();
            let found = 20.0 * f64::from(surface.coherent(f64::to_radians(grazing_deg).sin() as f32)).log10();
            assert!((found / db - 1.0).abs() < 5e-5, "{mm} mm, {grazing_deg} deg: {found}");
        }
        let smooth = Radio::new(RadioLaw::Body(CONCRETE)).at(77e9).unwrap();
        assert_eq!([smooth.coherent(0.3), smooth.clutter(1.0), smooth.clutter(0.3)], [1.0, 0.0, 0.0]);
    }

    fn all_kinds() -> Vec<Radio> {
        let ground = Dielectric::Ground { moisture: 0.3, sand: 50.0, clay: 10.0 };
        let leaf = Dielectric::Vegetation { moisture: 0.6 };
        let foliage = RadioLaw::Volume { attenuation_db_m: 3.0, depth_m: 1.0, eps: 1.0 };
        let snow = RadioLaw::Volume { attenuation_db_m: 30.0, depth_m: 1.0, eps: 1.4 };
        let mut all = vec![layers(&[(leaf, 0.2)], None), layers(&[(GLASS, 4.0), (GLASS, 3.0)], Some(ground))];
        for (mm, gamma_db, exponent) in
            [(0.02, -30.0, 1.0), (0.5, -20.0, 1.0), (1.0, 10.0, 0.0), (5.0, -10.0, 2.0), (20.0, 10.0, 10.0)]
        {
            for law in [&RadioLaw::Body(ground), &RadioLaw::Body(Dielectric::Metal), &foliage, &snow] {
                all.push(rough(law.clone(), mm, gamma_db, exponent));
            }
        }
        all
    }

    /// Mirror image, scattering and what passes are no more than what arrives; of a body, no more than it reflects.
    #[test]
    fn energy_is_kept() {
        for radio in all_kinds() {
            for frequency in [9.4e9, 24e9, 77e9] {
                let surface = radio.at(frequency).unwrap();
                for cos in cosines().skip(1) {
                    let reflected = surface.reflect(cos).power();
                    let mirrored = reflected * surface.coherent(cos).powi(2);
                    let [scattered, glint] = surface.shares(cos);
                    assert!(scattered >= 0.0 && glint >= 0.0 && reflected >= 0.0, "{radio} {cos}");
                    let all = mirrored + scattered + glint;
                    let most = if surface.volume { 1.0 - surface.transmit(cos).power() } else { reflected };
                    assert!(all <= most + 1e-6, "{radio} {cos}: {all} of {most}");
                }
            }
        }
    }

    /// Where nothing limits it, clutter is its law; and the part that it scatters is the integral of the bistatic
    /// `gamma (cos cos')^(p/2)` over the hemisphere, over `4 pi cos`.
    #[test]
    fn clutter_is_its_law() {
        for p in [0.5, 1.0, 2.0] {
            let radio = rough(RadioLaw::Volume { attenuation_db_m: 100.0, depth_m: 1.0, eps: 1.0 }, 0.0, -20.0, p);
            let surface = radio.at(77e9).unwrap();
            for cos in [0.05f32, 0.3, 1.0] {
                let law = 0.01 * f64::from(cos).powf(p);
                assert!((f64::from(surface.clutter(cos)) / law - 1.0).abs() < 1e-5, "{p} {cos}");
                let steps = 20_000;
                let sum: f64 = (0..steps).map(|step| ((f64::from(step) + 0.5) / f64::from(steps)).powf(p / 2.0)).sum();
                let bistatic = 0.01 * f64::from(cos).powf(p / 2.0) * 2.0 * PI * sum / f64::from(steps);
                let expected = bistatic / (4.0 * PI * f64::from(cos));
                assert!((f64::from(surface.shares(cos)[0]) / expected - 1.0).abs() < 1e-4, "{p} {cos}");
            }
        }
    }

    /// All facets of a very rough conductor: `sigma^0 = pi R p / cos^4` of the density `p` of their slopes (Barrick 1968, Proc.
    /// IEEE 56, 1728), which makes 1: `int 2 sigma^0(theta) cos d cos = R`.
    #[test]
    fn every_facet_glints() {
        let radio = Radio { correlation_mm: Some(50.0), rms_height_mm: 10.0, ..Radio::metal() };
        let surface = radio.at(77e9).unwrap();
        let steps = 40_000;
        let width = 1.0 / f64::from(steps);
        let cosines = (0..steps).map(|step| (f64::from(step) + 0.5) * width);
        let sum: f64 = cosines.map(|cos| 2.0 * f64::from(surface.clutter(cos as f32)) * cos * width).sum();
        assert!((sum / 0.998_151 - 1.0).abs() < 1e-3, "{sum}");
    }

    #[test]
    fn nothing_is_negative_or_infinite() {
        for radio in all_kinds() {
            for frequency in [1e8, 9.4e9, 77e9, 1e12] {
                let surface = radio.at(frequency).unwrap();
                for cos in cosines().chain([1e-30, 1e-38, -0.0, -1.0, 1.000_001]) {
                    let found = surface.clutter(cos);
                    assert!(found >= 0.0 && found.is_finite(), "{radio} {cos}: {found}");
                    let [back, through] = [surface.reflect(cos), surface.transmit(cos)].map(|pair| pair.power());
                    assert!(back + through <= 1.0 + 1e-3 && back.is_finite(), "{radio} {cos}: {back} {through}");
                }
                assert_eq!(surface.clutter(0.0), 0.0);
            }
        }
    }
}
