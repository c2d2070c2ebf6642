//! The section `radar` of a material.

use super::dielectric::{Dielectric, LAWS};
use super::itu::ItuMaterial;
use super::stack::{Film, Stack, wavenumber};
use super::surface::{Clutter, RadioSurface};
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml;
use num_complex::Complex64;
use serde::{Deserialize, Deserializer};
use std::fmt;

/// How a surface reflects, transmits and scatters the waves of a radar: the section `radar` of a material.
///
/// `law` says what reflects; roughness divides it into a mirror image and scattering.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Radio {
    /// What it is made of.
    pub law: RadioLaw,
    /// Standard deviation of its height, mm, 0 to 1000; 0, smooth, by default. Glass and car bodies have less than 0.02,
    /// walls 0.1 to 1, roads 0.3 to 2, gravel 5 to 20.
    pub rms_height_mm: f64,
    /// Distance at which its heights are correlated by 1/e, mm, 0.1 to 1e5; by default ten times `rms_height_mm`: slopes
    /// of 8 degrees. It is the width of the glint around normal incidence.
    pub correlation_mm: Option<f64>,
    /// What it scatters besides; nothing by default.
    pub clutter: Option<Clutter>,
}

/// What a [`Radio`] surface is made of.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RadioLaw {
    /// A body: what enters it does not come back.
    Body(Dielectric),
    /// Layers, from the outside inwards.
    Layers {
        /// 1 to 8 of them.
        layers: Vec<RadioLayer>,
        /// The body beneath; `None`: air, as behind panes, boards and leaves, which let waves through.
        over: Option<Dielectric>,
    },
    /// Many small scatterers in air, such as foliage or snow, seen as the surface of their volume: whatever does not
    /// scatter passes or is absorbed.
    Volume {
        /// Attenuation on the way through, one way, dB/m, 0 to 1000: 0.4 in foliage at 73 GHz (Rappaport and Deng 2015).
        attenuation_db_m: f64,
        /// Depth for which each of its surfaces stands, m, 0 to 100: half the width of a hedge with two faces.
        depth_m: f64,
        /// Mean permittivity, 1 to 10, at which its surface reflects; 1, not at all, by default.
        eps: f64,
    },
}

/// A layer of a [`RadioLaw`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadioLayer {
    /// What it consists of.
    pub of: Dielectric,
    /// Thickness, mm, 0 to 1000.
    pub thickness_mm: f64,
}

/// Most layers of a surface: more are a mistake.
const MOST_LAYERS: usize = 8;

/// Thickest layer, mm.
const THICKEST_MM: f64 = 1e3;

/// Where the laws can be evaluated, GHz.
const FREQUENCIES_GHZ: [f64; 2] = [0.1, 1000.0];

impl Radio {
    /// A smooth surface without clutter.
    pub fn new(law: RadioLaw) -> Radio {
        Radio { law, rms_height_mm: 0.0, correlation_mm: None, clutter: None }
    }

    /// Smooth metal.
    pub(in crate::material) fn metal() -> Radio {
        Radio::new(RadioLaw::Body(Dielectric::Metal))
    }

    /// A window pane, 4 mm of glass: a default. As no user chose it, its law is extrapolated above 100 GHz rather than refused.
    pub(in crate::material) fn pane() -> Radio {
        let of = Dielectric::Itu { material: ItuMaterial::Glass, extrapolate: true };
        Radio::new(RadioLaw::Layers { layers: vec![RadioLayer { of, thickness_mm: 4.0 }], over: None })
    }

    /// A surface of which nothing is known: permittivity 3 - j 0.06, as of plaster, plastics, dry wood and dry soil, which
    /// reflects 7 % at normal incidence, rough by 0.3 mm. Our assumption.
    pub fn unknown() -> Radio {
        let body = Dielectric::Permittivity { eps: 3.0, loss: 0.06, conductivity_s_m: 0.0 };
        Radio { rms_height_mm: 0.3, ..Radio::new(RadioLaw::Body(body)) }
    }

    /// Gives it the thickness `pane_m`, m, if it is a sheet of a single layer.
    pub(in crate::material) fn make_pane(&mut self, pane_m: f32) {
        if let RadioLaw::Layers { layers, over: None } = &mut self.law
            && let [layer] = &mut layers[..]
        {
            // To the micrometre: as it was written, not as single precision holds it.
            layer.thickness_mm = ((1e6 * f64::from(pane_m)).round() / 1e3).min(THICKEST_MM);
        }
    }

    /// The surface at `frequency_hz`, 1e8 to 1e12, prepared for many waves.
    ///
    /// # Errors
    /// Another frequency, or one for which a law of ITU-R P.2040 does not hold and may not be extrapolated.
    pub fn at(&self, frequency_hz: f64) -> Result<RadioSurface> {
        let [least, most] = FREQUENCIES_GHZ.map(|ghz| ghz * 1e9);
        Bounds::none().within("frequency_hz", frequency_hz, least, most)?;
        let wavenumber = wavenumber(frequency_hz);
        let roughness = [self.rms_height_mm, self.slope()].map(|value| value as f32);
        let heights = [roughness[0] * 1e-3 * wavenumber as f32, roughness[1]];
        Ok(match &self.law {
            RadioLaw::Body(body) => RadioSurface::body(body.permittivity(frequency_hz)?, heights, self.clutter),
            RadioLaw::Layers { layers, over } => {
                let film = |layer: &RadioLayer| {
                    let eps = layer.of.permittivity(frequency_hz)?;
                    Ok(Film { eps, depth: wavenumber * layer.thickness_mm * 1e-3 })
                };
                let films = layers.iter().map(film).collect::<Result<Vec<Film>>>()?;
                let below = over.map_or(Ok(Complex64::ONE), |body| body.permittivity(frequency_hz))?;
                RadioSurface::layered(&Stack { films, below }, over.is_none(), heights, self.clutter)
            }
            &RadioLaw::Volume { attenuation_db_m, depth_m, eps } => {
                RadioSurface::volume(eps, attenuation_db_m * depth_m, heights, self.clutter)
            }
        })
    }

    /// Standard deviation of the slope along any direction of heights whose correlation is a Gaussian: `sqrt(2) h / l`
    /// (Ulaby, Moore and Fung 1982, Microwave Remote Sensing II, 12-4).
    fn slope(&self) -> f64 {
        let length = self.correlation_mm.unwrap_or(10.0 * self.rms_height_mm);
        if self.rms_height_mm > 0.0 { std::f64::consts::SQRT_2 * self.rms_height_mm / length } else { 0.0 }
    }

    /// What it is made of: layers, then what is beneath.
    fn matter(&self) -> impl Iterator<Item = &Dielectric> {
        let (layers, body) = match &self.law {
            RadioLaw::Body(body) => (&[][..], Some(body)),
            RadioLaw::Layers { layers, over } => (&layers[..], over.as_ref()),
            RadioLaw::Volume { .. } => (&[][..], None),
        };
        layers.iter().map(|layer| &layer.of).chain(body)
    }

    /// Warning for the user about the validity of the law at `frequency_hz`.
    pub fn warning(&self, frequency_hz: f64) -> Option<String> {
        self.matter().find_map(|matter| matter.warning(frequency_hz))
    }

    /// Checks that all values are within their allowed ranges.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] that names the key, as in `radar.eps`.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        let bounds = &mut Bounds::none();
        match &self.law {
            RadioLaw::Body(body) => body.check("radar", bounds)?,
            RadioLaw::Layers { layers, over } => {
                if !(1..=MOST_LAYERS).contains(&layers.len()) {
                    let found = format!("a list of {}", layers.len());
                    return Err(Error::invalid("radar.layers", found, format!("1 to {MOST_LAYERS} layers")));
                }
                for (index, layer) in layers.iter().enumerate() {
                    let key = format!("radar.layers[{index}]");
                    bounds.within(format_args!("{key}.thickness_mm"), layer.thickness_mm, 0.0, THICKEST_MM)?;
                    layer.of.check(&key, bounds)?;
                }
                over.as_ref().map_or(Ok(()), |body| body.check("radar.over", bounds))?;
            }
            &RadioLaw::Volume { attenuation_db_m, depth_m, eps } => {
                bounds.within("radar.attenuation_db_m", attenuation_db_m, 0.0, 1e3)?;
                bounds.within("radar.depth_m", depth_m, 0.0, 100.0)?;
                bounds.within("radar.eps", eps, 1.0, 10.0)?;
            }
        }
        bounds.within("radar.rms_height_mm", self.rms_height_mm, 0.0, 1e3)?;
        bounds.within("radar.correlation_mm", self.correlation_mm, 0.1, 1e5)?;
        if let Some(clutter) = &self.clutter {
            bounds.within("radar.clutter.gamma_db", clutter.gamma_db, -100.0, 10.0)?;
            bounds.within("radar.clutter.exponent", clutter.exponent, 0.0, 10.0)?;
        }
        Ok(())
    }
}

impl<'de> Deserialize<'de> for RadioLayer {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Thickness {
            thickness_mm: f64,
        }
        let (own, rest) = yaml::split_keys(deserializer, &["thickness_mm"])?;
        let Thickness { thickness_mm } = own.read()?;
        Ok(RadioLayer { of: rest.read()?, thickness_mm })
    }
}

impl<'de> Deserialize<'de> for Radio {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Roughness {
            #[serde(default)]
            rms_height_mm: f64,
            correlation_mm: Option<f64>,
            clutter: Option<Clutter>,
        }
        let (own, rest) = yaml::split_keys(deserializer, &["rms_height_mm", "correlation_mm", "clutter"])?;
        let Roughness { rms_height_mm, correlation_mm, clutter } = own.read()?;
        Ok(Radio { law: rest.read()?, rms_height_mm, correlation_mm, clutter })
    }
}

impl<'de> Deserialize<'de> for RadioLaw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Layered {
            layers: Vec<RadioLayer>,
            over: Option<Dielectric>,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct ScatteringVolume {
            attenuation_db_m: f64,
            depth_m: f64,
            #[serde(default = "air")]
            eps: f64,
        }
        fn air() -> f64 {
            1.0
        }
        const ALL: [&str; 9] = {
            let [a, b, c, d, e, f, g] = LAWS;
            [a, b, c, d, e, f, g, "layers", "volume"]
        };
        let (word, section) = yaml::split_tag(deserializer, "law")?;
        Ok(match word.as_str() {
            "layers" => {
                let Layered { layers, over } = section.read()?;
                RadioLaw::Layers { layers, over }
            }
            "volume" => {
                let ScatteringVolume { attenuation_db_m, depth_m, eps } = section.read()?;
                RadioLaw::Volume { attenuation_db_m, depth_m, eps }
            }
            known if LAWS.contains(&known) => match Dielectric::read(known, section)? {
                Some(body) => RadioLaw::Body(body),
                None => unreachable!("every word of the list is read"),
            },
            _ => return Err(section.unknown(&word, &ALL)),
        })
    }
}

impl fmt::Display for Radio {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.law {
            RadioLaw::Body(body) => write!(f, "{body}")?,
            RadioLaw::Layers { layers, over } => {
                for (index, layer) in layers.iter().enumerate() {
                    let on = if index > 0 { " on " } else { "" };
                    write!(f, "{on}{} mm of {}", layer.thickness_mm, layer.of)?;
                }
                over.as_ref().map_or(Ok(()), |body| write!(f, " on {body}"))?;
            }
            RadioLaw::Volume { attenuation_db_m, .. } => write!(f, "a volume of {attenuation_db_m} dB/m")?,
        }
        if self.rms_height_mm > 0.0 { write!(f, ", rough by {} mm", self.rms_height_mm) } else { Ok(()) }
    }
}

/// Where the law of a material comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadioSource {
    /// It is given.
    Given,
    /// The library material of this name.
    Library(&'static str),
    /// It is metallic or glass.
    Properties,
    /// Nothing is known: [`Radio::unknown`].
    Assumed,
}

impl fmt::Display for RadioSource {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            RadioSource::Given => f.write_str("given"),
            RadioSource::Library(name) => write!(f, "library material {name}"),
            RadioSource::Properties => f.write_str("by its optical properties"),
            RadioSource::Assumed => f.write_str("assumed"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;

    fn read(section: &str) -> Radio {
        Material::from_yaml(&format!("name: a\nradar: {section}")).unwrap().radar.unwrap()
    }

    #[test]
    fn sections_are_read() {
        let concrete = Dielectric::Itu { material: ItuMaterial::Concrete, extrapolate: true };
        let clutter = Some(Clutter { gamma_db: -28.0, exponent: 1.0 });
        assert_eq!(
            read("{law: itu, material: concrete, extrapolate: true, rms_height_mm: 0.2, clutter: {gamma_db: -28}}"),
            Radio { rms_height_mm: 0.2, clutter, ..Radio::new(RadioLaw::Body(concrete)) }
        );
        let paint = Dielectric::Permittivity { eps: 4.0, loss: 0.1, conductivity_s_m: 0.0 };
        let layers = vec![RadioLayer { of: paint, thickness_mm: 0.1 }];
        assert_eq!(
            read(
                "{law: layers, layers: [{thickness_mm: 0.1, law: permittivity, eps: 4, loss: 0.1}], over: {law: metal}}"
            ),
            Radio::new(RadioLaw::Layers { layers, over: Some(Dielectric::Metal) })
        );
        let of = |body| Radio::new(RadioLaw::Body(body));
        assert_eq!(read("{law: water}"), of(Dielectric::Water { temperature_c: 20.0, salinity_g_kg: 0.0 }));
        assert_eq!(read("{law: skin}"), of(Dielectric::Skin));
        let ground = Dielectric::Ground { moisture: 0.2, sand: 51.52, clay: 13.43 };
        assert_eq!(read("{law: ground, moisture: 0.2}"), of(ground));
        assert_eq!(read("{law: vegetation}"), of(Dielectric::Vegetation { moisture: 0.6 }));
        let volume = RadioLaw::Volume { attenuation_db_m: 0.4, depth_m: 2.0, eps: 1.0 };
        assert_eq!(read("{law: volume, attenuation_db_m: 0.4, depth_m: 2}"), Radio::new(volume));
    }

    #[test]
    fn errors_name_line_and_key() {
        for (section, expected) in [
            ("{material: glass}", "radar: the key `law` is missing"),
            ("{law: itu}", "radar: the key `material` is missing"),
            ("{law: metall}", "radar.law: unknown value \"metall\"; near: metal; allowed: itu, permittivity,"),
            ("{law: itu, material: granite}", "radar.material: unknown value \"granite\"; "),
            ("{law: metal, eps: 1}", "radar.eps: unknown key \"eps\""),
            ("{law: metal, rms_height: 1}", "radar.rms_height: unknown key \"rms_height\""),
            ("{law: permittivity, eps: 0.9}", "radar.eps: is 0.9; allowed: 1 to 1000"),
            ("{law: permittivity, eps: 2, loss: -1}", "radar.loss: is -1; allowed: 0 to 1000"),
            ("{law: metal, rms_height_mm: 1e4}", "radar.rms_height_mm: is 10000; allowed: 0 to 1000"),
            ("{law: metal, correlation_mm: 0}", "radar.correlation_mm: is 0; allowed: 0.1 to 100000"),
            ("{law: metal, clutter: {gamma_db: 20}}", "radar.clutter.gamma_db: is 20; allowed: -100 to 10"),
            ("{law: ground, moisture: 0}", "radar.moisture: is 0; allowed: 0.001 to 0.6"),
            ("{law: ground, moisture: 0.1, sand: 90, clay: 20}", "radar.clay: is 20; allowed: 0 to 10"),
            ("{law: layers, layers: []}", "radar.layers: is a list of 0; allowed: 1 to 8 layers"),
            (
                "{law: layers, layers: [{law: skin, thickness_mm: 2e3}]}",
                "radar.layers[0].thickness_mm: is 2000; allowed: 0 to 1000",
            ),
            ("{law: layers, layers: [{law: skin}]}", "radar.layers[0]: the key `thickness_mm` is missing"),
            ("{law: layers, layers: [{law: skn, thickness_mm: 1}]}", "radar.layers[0].law: unknown value \"skn\""),
            ("{law: volume, attenuation_db_m: 1}", "radar: the key `depth_m` is missing"),
        ] {
            let error = Material::from_yaml(&format!("name: a\nradar: {section}")).unwrap_err().to_string();
            let expected = format!("YAML text: line 2: {expected}");
            assert!(error.starts_with(&expected), "{section}\n  gives {error}\n  not   {expected}");
        }
    }

    #[test]
    fn frequencies_have_bounds() {
        let found = |hz| Radio::unknown().at(hz).map(|_| ()).unwrap_err().to_string();
        assert_eq!(found(1e7), "frequency_hz is 10000000; allowed: 100000000 to 1000000000000");
        assert_eq!(found(f64::NAN), "frequency_hz is NaN; allowed: 100000000 to 1000000000000");
        let brick = read("{law: itu, material: brick}");
        let error = brick.at(77e9).unwrap_err().to_string();
        assert_eq!(error, "radar.material is used at 77 GHz; allowed: 1 to 40 GHz, or extrapolate: true");
        assert_eq!(brick.warning(77e9), None);
        let brick = read("{law: itu, material: brick, extrapolate: true}");
        assert!(brick.at(77e9).is_ok() && brick.warning(77e9).is_some() && brick.warning(24e9).is_none());
    }

    #[test]
    fn laws_are_told() {
        for (section, expected) in [
            ("{law: itu, material: ceiling_board}", "ceiling board of ITU-R P.2040"),
            ("{law: ground, moisture: 0.25, rms_height_mm: 3}", "ground with 25 % of water, rough by 3 mm"),
            (
                "{law: layers, layers: [{thickness_mm: 1, law: water}], over: {law: permittivity, eps: 4, loss: 0.1}}",
                "1 mm of water of 20 C on permittivity 4 - j 0.1",
            ),
            ("{law: volume, attenuation_db_m: 0.4, depth_m: 2}", "a volume of 0.4 dB/m"),
        ] {
            assert_eq!(read(section).to_string(), expected);
        }
    }

    #[test]
    fn materials_without_a_section_have_a_law() {
        let law = |material: Material| material.radar_source();
        let plain = || Material { name: "thing".into(), ..Material::default() };
        assert_eq!(law(plain()), (Radio::unknown(), RadioSource::Assumed));
        assert_eq!(law(Material { metallic: 1.0, ..plain() }), (Radio::metal(), RadioSource::Properties));
        let pane = Material { transmission: 0.9, pane_m: Some(0.006), ..plain() };
        let (found, source) = law(pane);
        assert_eq!((found.to_string().as_str(), source), ("6 mm of glass of ITU-R P.2040", RadioSource::Properties));
        let own = Material { radar: Some(Radio::unknown()), metallic: 1.0, ..plain() };
        assert_eq!(law(own), (Radio::unknown(), RadioSource::Given));
    }
}
