//! Variation of surface materials from sample to sample.

use super::RuleTarget;
use crate::draw::Address;
use crate::random::Random;
use model::material::{Material, Reflectance, TextureRef};
use serde::Deserialize;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LookRule {
    /// Material name pattern.
    pub look: String,
    /// Objects that each get a draw of their own; without them, all surfaces of a material share one draw.
    #[serde(default)]
    pub of: Option<RuleTarget>,
    #[serde(default)]
    pub reflectance: Option<Random>,
    /// Linear, red, green and blue.
    #[serde(default)]
    pub color: Option<Random>,
    /// Image files that replace the image of the base colour.
    #[serde(default)]
    pub texture: Option<Random>,
    /// Fraction of the surface that is covered by a film of water.
    #[serde(default)]
    pub wetness: Option<Random>,
    /// Fraction of the surface that is covered by dust.
    #[serde(default)]
    pub dirt: Option<Random>,
}

/// Reflectance of the dust on surfaces: assumed to be that of light dry soil.
const DUST: f32 = 0.4;

impl LookRule {
    pub fn randoms(&mut self) -> Vec<(&'static str, &mut Random)> {
        let all = [
            ("reflectance", &mut self.reflectance),
            ("color", &mut self.color),
            ("texture", &mut self.texture),
            ("wetness", &mut self.wetness),
            ("dirt", &mut self.dirt),
        ];
        all.into_iter().filter_map(|(key, random)| Some((key, random.as_mut()?))).collect()
    }

    /// `material` as it is drawn at `address`; what was drawn is added to `drawn`. `open` returns the image of a file.
    pub fn of_material<E>(
        &self,
        material: &Material,
        address: &Address,
        open: impl FnOnce(&str) -> Result<TextureRef, E>,
        drawn: &mut Vec<(&'static str, serde_json::Value)>,
    ) -> Result<Material, E> {
        let mut look = material.clone();
        let mut draw = |key: &'static str, random: &Random| {
            let value = random.draw(&address.of(key));
            drawn.push((key, value.clone()));
            value
        };
        let mut fraction = |key, random: &Option<Random>| {
            let value = random.as_ref().map(|random| draw(key, random).as_f64().unwrap_or(0.0));
            value.map(|value| value.clamp(0.0, 1.0) as f32)
        };
        if let Some(reflectance) = fraction("reflectance", &self.reflectance) {
            look.reflectance = Some(Reflectance::Constant(reflectance));
            look.changes = None;
        }
        let (wetness, dirt) = (fraction("wetness", &self.wetness), fraction("dirt", &self.dirt));
        if let Some(random) = &self.color {
            let value = draw("color", random);
            for channel in 0..3 {
                let share = value.get(channel).and_then(serde_json::Value::as_f64).unwrap_or(0.0);
                look.base_color[channel] = share.clamp(0.0, 1.0) as f32;
            }
        }
        if let Some(random) = &self.texture {
            let value = draw("texture", random);
            look.base_color_texture = value.as_str().map(open).transpose()?;
        }
        // Water is on top of the dust.
        if let Some(dirt) = dirt {
            change(&mut look, |reflectance| reflectance + dirt * (DUST - reflectance));
            // On surfaces that transmit or mirror light, dust is visible by itself.
            look.dirt += dirt * (DUST - look.dirt).max(0.0);
        }
        if let Some(wetness) = wetness {
            change(&mut look, |reflectance| reflectance + wetness * (wet(reflectance) - reflectance));
        }
        Ok(look)
    }
}

/// Changes all reflectances of `look`, including the one known for its name, and the colours that stand in for them.
fn change(look: &mut Material, changed: impl Fn(f32) -> f32) {
    look.reflectance = look.known_reflectance().map(|known| known.map(&changed));
    look.base_color[..3].iter_mut().for_each(|channel| *channel = changed(*channel));
}

/// Diffuse reflectance under a film of water of a rough surface whose reflectance is `dry` without it: light is
/// reflected internally at the film's surface and hits the rough surface again (Ångström 1925, Geografiska Annaler 7;
/// Lekner and Dorf 1988, Applied Optics 27, 1278). That the rough surface absorbs differently in water is neglected.
fn wet(dry: f32) -> f32 {
    /// Index of refraction of water; it is 1.33 to 1.32 from 532 to 1550 nm.
    const INDEX: f32 = 1.33;
    /// Reflectance of its surface for diffuse light from outside: the mean Fresnel reflectance over the hemisphere.
    const DIFFUSE: f32 = 0.066;
    let normal = ((INDEX - 1.0) / (INDEX + 1.0)).powi(2);
    let within = 1.0 - (1.0 - DIFFUSE) / (INDEX * INDEX);
    (1.0 - normal) * (1.0 - within) * dry / (1.0 - within * dry)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draws;
    use ground::read::yaml;
    use std::convert::Infallible;

    fn look(rule: &str, material: &Material) -> Material {
        let rule: LookRule = yaml::from_str("rule", rule).unwrap();
        let none = |_: &str| -> Result<TextureRef, Infallible> { unreachable!("no image is requested") };
        rule.of_material(material, &Draws::new(1, 1).of("rule"), none, &mut Vec::new()).unwrap()
    }

    /// White stays nearly white, black stays black, and in between wet surfaces are darker.
    #[test]
    fn wet_surfaces_are_darker() {
        // The constant that is used for the mean Fresnel reflectance.
        let fresnel = |cosine: f64| {
            let refracted = (1.0 - (1.0 - cosine * cosine) / (1.33 * 1.33)).sqrt();
            let across = (cosine - 1.33 * refracted) / (cosine + 1.33 * refracted);
            let along = (1.33 * cosine - refracted) / (1.33 * cosine + refracted);
            0.5 * (across * across + along * along)
        };
        let steps = (0..10_000).map(|k| (f64::from(k) + 0.5) / 10_000.0);
        let mean = steps.map(|cosine| 2.0 * cosine * fresnel(cosine)).sum::<f64>() / 10_000.0;
        assert!((mean - 0.066).abs() < 1e-3, "{mean}");
        assert_eq!(wet(0.0), 0.0);
        assert!((wet(1.0) - 0.98).abs() < 1e-3);
        let steps = (0..100).map(|k| k as f32 / 100.0);
        assert!(steps.clone().skip(1).all(|dry| wet(dry) < dry && wet(dry + 0.01) > wet(dry)));
        assert!((wet(0.3) - 0.18).abs() < 0.01, "{}", wet(0.3));
    }

    #[test]
    fn looks_change_what_they_name() {
        let material = Material::default().reflectance(Some(Reflectance::Constant(0.2)));
        let of = |rule: &str| look(rule, &material);
        assert_eq!(of("{look: a}"), material);
        assert_eq!(of("{look: a, reflectance: 0.7}").reflectance, Some(Reflectance::Constant(0.7)));
        assert_eq!(of("{look: a, color: [0.1, 0.2, 0.3]}").base_color[..3], [0.1, 0.2, 0.3]);
        let Some(Reflectance::Constant(half)) = of("{look: a, wetness: 0.5}").reflectance else { panic!() };
        assert!((half - (0.2 + wet(0.2)) / 2.0).abs() < 1e-6);
        let Some(Reflectance::Constant(dusty)) = of("{look: a, dirt: 1}").reflectance else { panic!() };
        assert!((dusty - DUST).abs() < 1e-6);
    }
}
