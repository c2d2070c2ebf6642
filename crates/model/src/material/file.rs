//! Materials as YAML.

use super::{Alpha, Material, Radio, Reflectance, Sound, change};
use ground::error::{Error, Result};
use ground::read::yaml::Document;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde_json::Value;
use std::fmt::Display;

impl Material {
    /// Reads the text of a material file, whose keys are the fields of this type except the texture. Only `name` is
    /// required; `base_color` may omit alpha, and `reflectance` is a number, a list of [`super::ReflectanceSample`], or
    /// a list of `{t, value}`: its values at times in s.
    ///
    /// # Errors
    /// States the line and key of the fault, with the most similar known key.
    pub fn from_yaml(text: &str) -> Result<Material> {
        Material::read(&Document::parse("YAML text", text)?)
    }

    /// This material with the material-file keys in `keys` applied to it.
    ///
    /// # Errors
    /// As [`Material::from_yaml`]; `key` is where the keys are written.
    #[doc(hidden)]
    pub fn with_keys(&self, key: &str, keys: &Value) -> Result<Material> {
        let mut whole = keys.clone();
        if let Some(whole) = whole.as_object_mut() {
            // Materials of scenes may have no name; this one only lets the keys be read.
            whole.entry("name").or_insert_with(|| "unnamed".into());
        }
        let given = Material::read(&Document::from_value(key, whole))?;
        let mut material = self.clone();
        let has = |name: &str| keys.get(name).is_some();
        macro_rules! take {
            ($($field:ident)*) => {
                $(if has(stringify!($field)) {
                    material.$field = given.$field;
                })*
            };
        }
        if has("reflectance") {
            material.changes = given.changes;
        }
        take!(name source base_color alpha alpha_cutoff reflectance scattering metallic roughness ior transmission
            thickness_m attenuation_distance_m attenuation_color pane_m group_index extinction_index dirt sound radar unlit);
        // A material that becomes glass is a pane, unless the keys say otherwise.
        if has("transmission") && !has("alpha") && material.alpha == Alpha::Coverage && material.is_glass() {
            material.alpha = Alpha::Solid;
        }
        Ok(material)
    }

    /// Turns `document` into a checked material.
    pub(super) fn read(document: &Document) -> Result<Material> {
        let (keys, value) = take_keys(document)?;
        let mut material: Material = document.read_at("", &value)?;
        if !keys.is_empty() {
            check_keys(&keys).map_err(|error| document.locate(error))?;
            material.set_changes(change::reflectance(keys.iter().map(|key| [key.t, key.value])));
        }
        if document.value().get("name").is_none() {
            return Err(document.error("", "the key `name` is missing"));
        }
        material.check().map_err(|error| document.locate(error))?;
        Ok(material)
    }

    /// Checks that all values are within their allowed ranges.
    fn check(&self) -> Result<()> {
        if self.name.is_empty() {
            return Err(Error::invalid("name", "empty", "a word"));
        }
        let colors = [("base_color", &self.base_color[..]), ("attenuation_color", &self.attenuation_color[..])];
        for (key, color) in colors {
            for (index, &value) in color.iter().enumerate() {
                fraction(format_args!("{key}[{index}]"), value)?;
            }
        }
        self.reflectance.as_ref().map_or(Ok(()), |reflectance| reflectance.check("reflectance"))?;
        self.scattering.check(self.greatest_reflectance().as_ref())?;
        self.sound.as_ref().map_or(Ok(()), Sound::check)?;
        self.radar.as_ref().map_or(Ok(()), Radio::check)?;
        let fractions = [
            ("alpha_cutoff", self.alpha_cutoff),
            ("metallic", self.metallic),
            ("roughness", self.roughness),
            ("transmission", self.transmission),
            ("dirt", self.dirt),
        ];
        for (key, value) in fractions {
            fraction(key, value)?;
        }
        let (ior, thickness, distance) = (self.ior, self.thickness_m, self.attenuation_distance_m);
        let refracts = self.extinction_index == 0.0 || self.transmission > 0.0;
        let least = if refracts { "1 or more" } else { "above 0, at most 100" };
        allow("ior", ior, if refracts { ior >= 1.0 && ior.is_finite() } else { ior > 0.0 && ior <= 100.0 }, least)?;
        allow("thickness_m", thickness, thickness >= 0.0 && thickness.is_finite(), "0 or more")?;
        allow("attenuation_distance_m", distance, distance > 0.0, "above 0")?;
        let (pane, group) = (self.pane_m.unwrap_or(0.0), self.group_index.unwrap_or(1.0));
        allow("pane_m", pane, (0.0..=10.0).contains(&pane), "0 to 10")?;
        allow("group_index", group, (1.0..=10.0).contains(&group), "1 to 10")?;
        let k = self.extinction_index;
        allow("extinction_index", k, (0.0..=100.0).contains(&k), "0 to 100")
    }
}

impl Reflectance {
    /// Checks that all values at the key `key` are within their allowed ranges.
    #[doc(hidden)]
    pub fn check(&self, key: &str) -> Result<()> {
        let samples = match self {
            Reflectance::Constant(value) => return fraction(key, *value),
            Reflectance::Samples(samples) => samples,
        };
        allow(key, "an empty list", !samples.is_empty(), "a number, or one sample or more")?;
        let mut above = 0.0;
        for (index, sample) in samples.iter().enumerate() {
            let (wavelength, key_of) = (sample.wavelength_nm, |name| format!("{key}[{index}].{name}"));
            allow(
                key_of("wavelength_nm"),
                wavelength,
                wavelength > above,
                format_args!("above {above}, in rising order"),
            )?;
            above = wavelength;
            fraction(key_of("value"), sample.value)?;
        }
        Ok(())
    }
}

fn allow(key: impl Display, found: impl Display, holds: bool, allowed: impl Display) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::invalid(key.to_string(), found, allowed.to_string())) }
}

fn fraction(key: impl Display, value: impl Into<f64> + Display + Copy) -> Result<()> {
    allow(key, value, (0.0..=1.0).contains(&value.into()), "0 to 1")
}

/// Reflectance at one time.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReflectanceKey {
    /// s
    t: f64,
    value: f64,
}

/// The reflectance over time, if `document` gives one, and the rest of the document.
fn take_keys(document: &Document) -> Result<(Vec<ReflectanceKey>, Value)> {
    const KEY: &str = "reflectance";
    let mut value = document.value().clone();
    let timed = |list: &Vec<Value>| list.iter().any(|item| item.get("t").is_some());
    if !value.get(KEY).and_then(Value::as_array).is_some_and(timed) {
        return Ok((Vec::new(), value));
    }
    let keys = value.as_object_mut().and_then(|map| map.shift_remove(KEY)).unwrap_or_default();
    let other = keys.as_array().into_iter().flatten().position(|item| item.get("wavelength_nm").is_some());
    if let Some(other) = other {
        let message = "has a wavelength in a list of times; allowed: {t, value} alone, or {wavelength_nm, value} alone";
        return Err(document.error(&format!("{KEY}[{other}]"), message));
    }
    Ok((document.read_at(KEY, &keys)?, value))
}

fn check_keys(keys: &[ReflectanceKey]) -> Result<()> {
    let mut before = f64::MIN;
    for (index, key) in keys.iter().enumerate() {
        let name = |name| format!("reflectance[{index}].{name}");
        allow(name("t"), key.t, key.t >= before, format_args!("{before} and more, in rising order"))?;
        before = key.t;
        fraction(name("value"), key.value)?;
    }
    Ok(())
}

/// Reads red, green, blue and optionally alpha.
pub(super) fn color_and_alpha<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f32; 4], D::Error> {
    match Vec::deserialize(deserializer)?[..] {
        [red, green, blue] => Ok([red, green, blue, 1.0]),
        [red, green, blue, alpha] => Ok([red, green, blue, alpha]),
        ref other => Err(D::Error::custom(format!("is a list of {}; allowed: 3 or 4 numbers", other.len()))),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Dielectric, RadioLaw, ReflectanceSample, RetroSample, Scattering};
    use super::*;

    #[test]
    fn a_name_is_enough() {
        let material = Material::from_yaml("name: plain").unwrap();
        assert_eq!(material, Material { name: "plain".into(), ..Material::default() });
    }

    #[test]
    fn every_key_is_read() {
        let text = "
name: tinted glass
source: as a test
base_color: [0.1, 0.2, 0.3, 0.4]
alpha: cutout
alpha_cutoff: 0.25
reflectance: [{wavelength_nm: 905, value: 0.5}, {wavelength_nm: 1550, value: 0.25}]
scattering: {model: phong, specular: 0.25, exponent: 10}
metallic: 0.1
roughness: 0
ior: 1.45
transmission: 0.9
thickness_m: 0.005
attenuation_distance_m: 0.02
attenuation_color: [1, 0.5, 0]
pane_m: 0.004
group_index: 1.52
extinction_index: 6
dirt: 0.02
sound: {law: lambert, mu_db: -17}
radar: {law: metal, rms_height_mm: 0.01}
unlit: true
";
        let sample = |wavelength_nm, value| ReflectanceSample { wavelength_nm, value };
        let expected = Material {
            name: "tinted glass".into(),
            source: "as a test".into(),
            base_color: [0.1, 0.2, 0.3, 0.4],
            base_color_texture: None,
            alpha_texture: None,
            alpha: Alpha::Cutout,
            alpha_cutoff: 0.25,
            reflectance: Some(Reflectance::Samples(vec![sample(905.0, 0.5), sample(1550.0, 0.25)])),
            scattering: Scattering::Phong { specular: 0.25, exponent: 10.0 },
            metallic: 0.1,
            roughness: 0.0,
            ior: 1.45,
            transmission: 0.9,
            thickness_m: 0.005,
            attenuation_distance_m: 0.02,
            attenuation_color: [1.0, 0.5, 0.0],
            pane_m: Some(0.004),
            group_index: Some(1.52),
            extinction_index: 6.0,
            dirt: 0.02,
            sound: Some(Sound::Lambert { mu_db: -17.0 }),
            radar: Some(Radio { rms_height_mm: 0.01, ..Radio::new(RadioLaw::Body(Dielectric::Metal)) }),
            unlit: true,
            double_sided: false,
            part: None,
            changes: None,
        };
        assert_eq!(Material::from_yaml(text).unwrap(), expected);
        let short = Material::from_yaml("{name: a, base_color: [0.5, 0.5, 1], reflectance: 1}").unwrap();
        assert_eq!(short.base_color, [0.5, 0.5, 1.0, 1.0]);
        assert_eq!(short.reflectance, Some(Reflectance::Constant(1.0)));
    }

    #[test]
    fn reflectance_may_change_over_time() {
        let keys = "[{t: 0, value: 0.25}, {t: 4, value: 0.75}, {t: 4, value: 0.5}, {t: 5, value: 0.5}]";
        let material = Material::from_yaml(&format!("{{name: sign, metallic: 0.5, reflectance: {keys}}}")).unwrap();
        assert_eq!((material.reflectance.clone(), material.metallic), (Some(Reflectance::Constant(0.25)), 0.5));
        let at = |time| match material.at(time).unwrap().reflectance {
            Some(Reflectance::Constant(value)) => value,
            other => panic!("{other:?}"),
        };
        assert_eq!([-1.0, 2.0, 3.999_999_999, 4.0, 9.0].map(at), [0.25, 0.5, 0.75, 0.5, 0.5]);
        let still = Material::from_yaml("{name: a, reflectance: [{t: 3, value: 0.5}]}").unwrap();
        assert_eq!((still.reflectance.clone(), still.at(1.0)), (Some(Reflectance::Constant(0.5)), None));
    }

    #[test]
    fn scattering_models_are_read() {
        let read = |section: &str| Material::from_yaml(&format!("name: a\nscattering: {section}")).unwrap().scattering;
        assert_eq!(read("{model: lambert}"), Scattering::Lambert);
        assert_eq!(read("{model: constant}"), Scattering::Constant);
        assert_eq!(read("{model: oren_nayar, slope_sigma_deg: 17}"), Scattering::OrenNayar { slope_sigma_deg: 17.0 });
        assert_eq!(read("{model: ggx, f0: 0.04, alpha: 0.3}"), Scattering::Ggx { f0: 0.04, alpha: 0.3 });
        let samples = [(5.0, 250.0), (30.0, 150.0)].map(|(angle_deg, cd_lx_m2)| RetroSample { angle_deg, cd_lx_m2 });
        let text = "{model: retro_reflector, samples: [{angle_deg: 5, cd_lx_m2: 250}, {angle_deg: 30, cd_lx_m2: 150}]}";
        assert_eq!(read(text), Scattering::RetroReflector { samples: samples.to_vec() });
    }

    #[test]
    fn laws_of_sound_are_read() {
        use super::super::Sediment;
        let read = |section: &str| Material::from_yaml(&format!("name: a\nsound: {section}")).unwrap().sound.unwrap();
        let facet = Sound::Facet { mu_db: -20.0, slope_sigma_deg: 5.0, reflection_loss_db: 6.0 };
        assert_eq!(read("{law: facet, mu_db: -20, slope_sigma_deg: 5, reflection_loss_db: 6}"), facet);
        let smooth = Sound::Facet { mu_db: -35.0, slope_sigma_deg: 0.0, reflection_loss_db: 0.0 };
        assert_eq!(read("{law: facet}"), smooth);
        let gsab = Sound::Gsab { a_db: -10.0, b_deg: 5.0, c_db: -20.0, d: 2.0, e_db: -25.0, f_deg: 20.0 };
        assert_eq!(read("{law: gsab, a_db: -10, b_deg: 5, c_db: -20, d: 2, e_db: -25, f_deg: 20}"), gsab);
        assert_eq!(read("{law: sediment, name: rough_rock}"), Sound::Sediment { name: Sediment::RoughRock });
        assert_eq!(read("{law: target, strength_db: -42}"), Sound::Target { strength_db: -42.0 });
    }

    #[test]
    fn errors_name_line_and_key() {
        let cases = [
            ("reflectence: 0.5", "line 2: reflectence: unknown key \"reflectence\"; near: reflectance; allowed: name,"),
            ("base_color_texture: a.png", "line 2: base_color_texture: unknown key"),
            ("base_color: [1, 1]", "line 2: base_color: is a list of 2; allowed: 3 or 4 numbers"),
            ("base_color: [1, 1,\n  1.1]", "line 3: base_color[2]: is 1.1; allowed: 0 to 1"),
            ("base_color: red", "line 2: base_color: invalid type: string \"red\", expected a list"),
            ("reflectance: -0.1", "line 2: reflectance: is -0.1; allowed: 0 to 1"),
            ("reflectance: 1.2", "line 2: reflectance: is 1.2; allowed: 0 to 1"),
            ("reflectance: high", "line 2: reflectance: invalid type: string \"high\", expected a number or a list of"),
            ("reflectance: []", "line 2: reflectance: is an empty list; allowed: a number, or one sample or more"),
            ("reflectance: [0.1]", "line 2: reflectance[0]: invalid type: floating point `0.1`, expected a section"),
            ("reflectance: [{value: 1}]", "line 2: reflectance[0]: the key `wavelength_nm` is missing"),
            (
                "reflectance:\n- {wavelength_nm: 905, valeu: 1}",
                "line 3: reflectance[0].valeu: unknown key \"valeu\"; near: value; allowed: wavelength_nm, value",
            ),
            (
                "reflectance: [{wavelength_nm: 905, value: 1.5}]",
                "line 2: reflectance[0].value: is 1.5; allowed: 0 to 1",
            ),
            (
                "reflectance:\n- {wavelength_nm: 905, value: 1}\n- {wavelength_nm: 905, value: 1}",
                "line 4: reflectance[1].wavelength_nm: is 905; allowed: above 905, in rising order",
            ),
            (
                "reflectance: [{t: 0, value: 0.2}, {wavelength_nm: 905, value: 1}]",
                "line 2: reflectance[1]: has a wavelength in a list of times; allowed: {t, value} alone, or {wavelength_nm,",
            ),
            (
                "reflectance:\n- {wavelength_nm: 905, value: 1}\n- {t: 1, value: 1}",
                "line 3: reflectance[0]: has a wavelength in a list of times; allowed: {t, value} alone, or {wavelength_nm,",
            ),
            ("reflectance: [{t: 0}]", "line 2: reflectance[0]: the key `value` is missing"),
            (
                "reflectance:\n- {t: 2, value: 1}\n- {t: 1, value: 1}",
                "line 4: reflectance[1].t: is 1; allowed: 2 and more, in rising order",
            ),
            ("reflectance: [{t: 0, value: 1.5}]", "line 2: reflectance[0].value: is 1.5; allowed: 0 to 1"),
            ("reflectance: [{t: .inf, value: 1}]", "line 2: .inf is not a finite number"),
            (
                "reflectance: [{t: 0, value: 0.2}, {t: 1, value: 0.6}]\nscattering: {model: phong, specular: 0.5, exponent: 2}",
                "line 3: scattering.specular: is 0.5; allowed: such that it and the reflectance of 0.6 make at most 1",
            ),
            ("scattering: lambert", "line 2: scattering: invalid type: string \"lambert\", expected a section of keys"),
            ("scattering: {f0: 1}", "line 2: scattering: the key `model` is missing"),
            (
                "scattering:\n  model: oren_nayer",
                "line 3: scattering.model: unknown value \"oren_nayer\"; near: oren_nayar; allowed: lambert, constant,",
            ),
            (
                "scattering:\n  model: oren_nayar\n  slope_sigma: 17",
                "line 4: scattering.slope_sigma: unknown key \"slope_sigma\"; near: slope_sigma_deg; allowed: slope_sigma_deg",
            ),
            ("scattering: {model: ggx, f0: 0.04}", "line 2: scattering: the key `alpha` is missing"),
            (
                "scattering: {model: oren_nayar, slope_sigma_deg: 91}",
                "line 2: scattering.slope_sigma_deg: is 91; allowed: 0 to 90",
            ),
            (
                "scattering: {model: phong, specular: 1.5, exponent: 2}",
                "line 2: scattering.specular: is 1.5; allowed: 0 to 1",
            ),
            (
                "scattering: {model: phong, specular: 0.5, exponent: -2}",
                "line 2: scattering.exponent: is -2; allowed: 0 to 100000",
            ),
            (
                "reflectance: 0.8\nscattering: {model: phong, specular: 0.5, exponent: 2}",
                "line 3: scattering.specular: is 0.5; allowed: such that it and the reflectance of 0.8 make at most 1",
            ),
            (
                "reflectance: [{wavelength_nm: 905, value: 0.97}]\nscattering: {model: ggx, f0: 0.04, alpha: 0.2}",
                "line 3: scattering.f0: is 0.04; allowed: such that it and the reflectance of 0.97 make at most 1",
            ),
            ("scattering: {model: ggx, f0: 0.04, alpha: 0}", "line 2: scattering.alpha: is 0; allowed: 0.001 to 1"),
            (
                "scattering: {model: retro_reflector, samples: []}",
                "line 2: scattering.samples: is an empty list; allowed: one sample or more",
            ),
            (
                "scattering: {model: retro_reflector, samples: [{angle_deg: 5, cd_lx_m2: 7e9}]}",
                "line 2: scattering.samples[0].cd_lx_m2: is 7000000000; allowed: 0 to 10000",
            ),
            (
                "scattering: {model: retro_reflector, samples: [{angle_deg: 90, cd_lx_m2: 7}]}",
                "line 2: scattering.samples[0].angle_deg: is 90; allowed: 0 to 85",
            ),
            (
                "scattering:\n  model: retro_reflector\n  samples:\n  - {angle_deg: 5, cd_lx_m2: 7}\n  - {angle_deg: 5, cd_lx_m2: 7}",
                "line 6: scattering.samples[1].angle_deg: is 5; allowed: above 5, in rising order",
            ),
            ("sound: {mu_db: -20}", "line 2: sound: the key `law` is missing"),
            ("sound: {law: lambert, mu_db: -4}", "line 2: sound.mu_db: is -4; allowed: -100 to -4.9715"),
            (
                "sound:\n  law: sediment\n  name: medium_snad",
                "line 4: sound.name: unknown value \"medium_snad\"; near: medium_sand; allowed: rough_rock, rock, cobble,",
            ),
            (
                "sound: {law: lambret}",
                "line 2: sound.law: unknown value \"lambret\"; near: lambert; allowed: lambert, facet",
            ),
            ("sound: {law: target, strenght_db: 1}", "line 2: sound.strenght_db: unknown key \"strenght_db\"; near:"),
            (
                "sound: {law: facet, mu_db: -20, slope_sigma_deg: 0.05, reflection_loss_db: 6}",
                "line 2: sound.slope_sigma_deg: is 0.05; allowed: 0 (smooth), or 0.1 to 45",
            ),
            (
                "alpha: mask",
                "line 2: alpha: unknown value \"mask\"; allowed: ignore, solid, coverage, cutout, reflectance",
            ),
            ("alpha_cutoff: 1.5", "line 2: alpha_cutoff: is 1.5; allowed: 0 to 1"),
            ("metallic: 2", "line 2: metallic: is 2; allowed: 0 to 1"),
            ("transmission: 1e300", "line 2: transmission: is inf; allowed: 0 to 1"),
            ("ior: 0", "line 2: ior: is 0; allowed: 1 or more"),
            ("ior: 0.99", "line 2: ior: is 0.99; allowed: 1 or more"),
            ("ior: 0\nextinction_index: 3", "line 2: ior: is 0; allowed: above 0, at most 100"),
            ("ior: 0.5\nextinction_index: 3\ntransmission: 0.1", "line 2: ior: is 0.5; allowed: 1 or more"),
            ("thickness_m: -1", "line 2: thickness_m: is -1; allowed: 0 or more"),
            ("attenuation_distance_m: 0", "line 2: attenuation_distance_m: is 0; allowed: above 0"),
            ("attenuation_color: [0, 0, 2]", "line 2: attenuation_color[2]: is 2; allowed: 0 to 1"),
            ("pane_m: 11", "line 2: pane_m: is 11; allowed: 0 to 10"),
            ("group_index: 0.9", "line 2: group_index: is 0.9; allowed: 1 to 10"),
            ("extinction_index: -1", "line 2: extinction_index: is -1; allowed: 0 to 100"),
            ("dirt: 1.1", "line 2: dirt: is 1.1; allowed: 0 to 1"),
            ("unlit: 1", "line 2: unlit: invalid type: integer `1`, expected a"),
            ("name: again", "line 2: duplicate"),
        ];
        for (text, expected) in cases {
            let error = Material::from_yaml(&format!("name: a\n{text}\n")).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("YAML text: {expected}")),
                "{text}\n  gives {error}\n  not   {expected}"
            );
        }
        let message = |text| Material::from_yaml(text).unwrap_err().to_string();
        assert_eq!(message("ior: 1.5"), "YAML text: line 1: the key `name` is missing");
        assert_eq!(message("ior: 1\nname: ''"), "YAML text: line 2: name: is empty; allowed: a word");
        assert_eq!(message(""), "YAML text: line 1: invalid type: null, expected a section of keys");
    }
}
