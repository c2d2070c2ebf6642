//! Custom properties of nodes and materials, which files carry beyond their format (glTF `extras`, FBX user
//! properties).

use ground::read::yaml;
use model::material::{Material, Radio, Reflectance, Sound};
use serde::de::DeserializeOwned;
use serde_json::Value;

/// A string, or a number as a string: exporters turn "7" into 7 or 7.0.
pub(super) fn text(value: Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text),
        Value::Number(number) => Some(match number.as_f64() {
            Some(whole) if number.is_f64() && whole.fract() == 0.0 => format!("{whole}"),
            _ => number.to_string(),
        }),
        _ => None,
    }
}

/// Applies the custom properties of a material; errors name them by `prefix` and their key.
pub(super) fn apply(
    material: &mut Material,
    prefix: &str,
    property: impl Fn(&str) -> Option<Value>,
) -> Result<(), String> {
    let named = |key: &str| format!("{prefix}{key}");
    let zero_to_one = |v: f64| (0.0..=1.0).contains(&v);
    if let Some(value) = property("reflectance") {
        let reflectance: Reflectance = section(&named("reflectance"), value)?;
        reflectance.check(&named("reflectance")).map_err(|error| error.to_string())?;
        material.reflectance = Some(reflectance);
    } else if let Some(value) = property("blainder_rgba") {
        let fourth = value.get(3).unwrap_or(&Value::Null);
        let value = number(&named("blainder_rgba[3]"), fourth, "a number from 0 to 1", zero_to_one)?;
        material.reflectance = Some(Reflectance::Constant(value));
    }
    if let Some(value) = property("scattering") {
        material.scattering = section(&named("scattering"), value)?;
        let check = material.scattering.check(material.reflectance.as_ref());
        check.map_err(|error| format!("{prefix}{error}"))?;
    }
    // A `sound` or `radar` of another type has another purpose, perhaps the name of a noise that the object makes.
    if let Some(value) = property("sound").filter(Value::is_object) {
        let sound: Sound = section(&named("sound"), value)?;
        sound.check().map_err(|error| format!("{prefix}{error}"))?;
        material.sound = Some(sound);
    }
    if let Some(value) = property("radar").filter(Value::is_object) {
        let radar: Radio = section(&named("radar"), value)?;
        radar.check().map_err(|error| format!("{prefix}{error}"))?;
        material.radar = Some(radar);
    }
    // A numeric `alpha` has another purpose.
    if let Some(value) = property("alpha").filter(Value::is_string) {
        material.alpha = section(&named("alpha"), value)?;
    }
    if let Some(value) = property("alpha_cutoff") {
        material.alpha_cutoff = number(&named("alpha_cutoff"), &value, "a number from 0 to 1", zero_to_one)?;
    }
    material.part = property("partID").and_then(text);
    if let Some(value) = property("dirt") {
        material.dirt = number(&named("dirt"), &value, "a number from 0 to 1", zero_to_one)?;
    }
    if let Some(value) = property("pane_m") {
        material.pane_m = Some(number(&named("pane_m"), &value, "0 to 10", |v| (0.0..=10.0).contains(&v))?);
    }
    if let Some(value) = property("group_index") {
        material.group_index = Some(number(&named("group_index"), &value, "1 to 10", |v| (1.0..=10.0).contains(&v))?);
    }
    if let Some(value) = property("extinction_index") {
        material.extinction_index =
            number(&named("extinction_index"), &value, "0 to 100", |v| (0.0..=100.0).contains(&v))?;
    }
    if let Some(value) = property("ior") {
        // It is below 1 for silver, gold and copper, which glTF's own key does not allow.
        let metal = material.extinction_index > 0.0 && material.transmission == 0.0;
        let (least, allowed) =
            if metal { (1e-3, "0.001 to 100") } else { (1.0, "1 to 100, or less with an extinction_index") };
        material.ior = number(&named("ior"), &value, allowed, |v| (least..=100.0).contains(&v))?;
    }
    if let Some(value) = property("blainder_metallic") {
        material.metallic = number(&named("blainder_metallic"), &value, "a number from 0 to 1", zero_to_one)?;
    }
    if let Some(value) = property("blainder_ior") {
        material.ior = refraction(&named("blainder_ior"), &value)?.unwrap_or(material.ior);
    }
    Ok(())
}

/// An index of refraction; both glTF's extension and the paper's system write 0 for "does not refract".
pub(super) fn refraction(name: &str, value: &Value) -> Result<Option<f32>, String> {
    let ior = number(name, value, "0 for none, or 1 and more", |ior| ior == 0.0 || ior >= 1.0)?;
    Ok((ior != 0.0).then_some(ior))
}

/// Parses `value` with the keys of a material file.
fn section<T: DeserializeOwned>(name: &str, value: Value) -> Result<T, String> {
    yaml::Document::from_value(name, value).read().map_err(|error| error.to_string())
}

/// `value` if `allows` permits it.
pub(super) fn checked(name: &str, value: f64, allowed: &str, allows: impl Fn(f64) -> bool) -> Result<f32, String> {
    if allows(value) { Ok(value as f32) } else { Err(format!("{name} is {value}; allowed: {allowed}")) }
}

/// The number in `value` if `allows` permits it.
fn number(name: &str, value: &Value, allowed: &str, allows: impl Fn(f64) -> bool) -> Result<f32, String> {
    let number = value.as_f64().ok_or_else(|| format!("{name} is not a number; allowed: {allowed}"))?;
    checked(name, number, allowed, allows)
}
