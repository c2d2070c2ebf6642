//! Materials: glTF, its extensions and custom properties to echocast's form.

use super::accessor::Accessors;
use super::animation::{GltfProperty, GltfTracks};
use super::{GltfDocument, Notes, extras, place};
use crate::properties::{self, checked, refraction};
use gltf::json;
use gltf::json::material::AlphaMode;
use gltf::json::texture::{Info, MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use ground::error::Result;
use ground::read::Limit;
use ground::shown;
use model::material::{Alpha, Changes, Filter, Material, Reflectance, Texture, TextureBudget, TextureRef, Wrap};
use serde_json::Value;
use std::collections::HashMap;
use std::sync::Arc;

/// The materials of a file, and those derived from them while meshes are read.
pub(super) struct GltfMaterials<'a> {
    /// The file's materials in order, then tinted ones. They get their textures once they are used.
    list: Vec<Arc<Material>>,
    images: GltfImages<'a>,
    /// Texture coordinate set of the texture of each of the file's materials that has been used.
    sets: HashMap<usize, Option<u32>>,
    /// Materials multiplied by a colour, by material and bits of the colour.
    tinted: HashMap<(Option<usize>, [u32; 4]), usize>,
}

impl<'a> GltfMaterials<'a> {
    pub fn read(
        document: &'a GltfDocument<'a>,
        accessors: &'a Accessors<'a>,
        tracks: &GltfTracks,
        budget: &'a mut TextureBudget,
        notes: &mut Notes,
    ) -> Result<Self> {
        let mut list = Vec::new();
        for (index, source) in document.json.materials.iter().enumerate() {
            let here = || place("material", index, source.name.as_deref());
            let name = source.name.clone().unwrap_or_else(|| format!("material_{index}"));
            let mut factors = GltfFactors { place: &here, notes };
            let material = surface(source, name, &mut factors)
                .and_then(|material| animated(material, index, tracks))
                .map_err(|message| document.error(here(), message))?;
            list.push(Arc::new(material));
        }
        let images = GltfImages { document, accessors, by_image: HashMap::new(), budget };
        Ok(GltfMaterials { list, images, sets: HashMap::new(), tinted: HashMap::new() })
    }

    /// Reads the texture of a material of the file that a part uses; returns the texture coordinate set that it needs.
    pub fn texture_set(&mut self, index: usize, notes: &mut Notes) -> Result<Option<u32>> {
        if let Some(&known) = self.sets.get(&index) {
            return Ok(known);
        }
        let source = &self.images.document.json.materials[index];
        let mut set = None;
        if let Some(info) = base_color_texture(source) {
            let user = place("material", index, source.name.as_deref());
            let texture = self.images.texture_ref(info, &user, notes)?;
            let transform = info.extensions.as_ref().and_then(|all| all.texture_transform.as_ref());
            set = texture.is_some().then(|| transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord));
            // No part has this material yet.
            Arc::make_mut(&mut self.list[index]).base_color_texture = texture;
        }
        self.sets.insert(index, set);
        Ok(set)
    }

    /// A material for a part that uses it.
    pub fn get(&self, index: usize) -> Arc<Material> {
        self.list[index].clone()
    }

    /// All materials.
    pub fn finish(self) -> Vec<Arc<Material>> {
        self.list
    }

    /// The material multiplied by a linear colour.
    pub fn tint(&mut self, material: Option<usize>, color: [f32; 4]) -> usize {
        let key = (material, color.map(f32::to_bits));
        *self.tinted.entry(key).or_insert_with(|| {
            let mut tinted = material.map(|index| (*self.list[index]).clone()).unwrap_or_default();
            tinted.tint(color);
            self.list.push(Arc::new(tinted));
            self.list.len() - 1
        })
    }
}

/// The texture that multiplies the base colour.
fn base_color_texture(source: &json::Material) -> Option<&Info> {
    match source.extensions.as_ref().and_then(|all| all.pbr_specular_glossiness.as_ref()) {
        Some(older) => older.diffuse_texture.as_ref(),
        None => source.pbr_metallic_roughness.base_color_texture.as_ref(),
    }
}

/// Everything but the texture.
fn surface(source: &json::Material, name: String, factors: &mut GltfFactors<'_>) -> Result<Material, String> {
    let extensions = source.extensions.clone().unwrap_or_default();
    let mut material = Material::default().name(name).unlit(extensions.unlit.is_some());
    if let Some(older) = &extensions.pbr_specular_glossiness {
        material.base_color = factors.units("diffuseFactor", older.diffuse_factor.0);
        material.roughness = 1.0 - factors.unit("glossinessFactor", older.glossiness_factor.0);
    } else {
        let pbr = &source.pbr_metallic_roughness;
        material.base_color = factors.units("baseColorFactor", pbr.base_color_factor.0);
        material.metallic = factors.unit("metallicFactor", pbr.metallic_factor.0);
        material.roughness = factors.unit("roughnessFactor", pbr.roughness_factor.0);
    }
    if let Some(transmission) = &extensions.transmission {
        material.transmission = factors.unit("transmissionFactor", transmission.transmission_factor.0);
    }
    if let Some(ior) = &extensions.ior {
        material.ior = refraction("ior", &Value::from(ior.ior.0))?.unwrap_or(material.ior);
    }
    if let Some(volume) = &extensions.volume {
        let (thickness, distance) = (volume.thickness_factor.0, volume.attenuation_distance.0);
        material.thickness_m = checked("thicknessFactor", f64::from(thickness), "0 or more", |v| v >= 0.0)?;
        material.attenuation_distance_m =
            checked("attenuationDistance", f64::from(distance), "more than 0", |v| v > 0.0)?;
        material.attenuation_color = factors.units("attenuationColor", volume.attenuation_color.0);
    }

    material.double_sided = source.double_sided;
    match source.alpha_mode {
        Checked::Valid(AlphaMode::Mask) => material.alpha = Alpha::Cutout,
        Checked::Valid(AlphaMode::Blend) => material.blend(),
        Checked::Valid(AlphaMode::Opaque) | Checked::Invalid => {}
    }
    if let Some(cutoff) = &source.alpha_cutoff {
        material.alpha_cutoff = factors.unit("alphaCutoff", cutoff.0);
    }

    properties::apply(&mut material, "extras.", |key| extras::get(&source.extras, key))?;
    Ok(material)
}

/// `material`, the file's material `index`, with its animations: its values at time 0, and their changes.
fn animated(mut material: Material, index: usize, tracks: &GltfTracks) -> Result<Material, String> {
    if tracks.is_empty() {
        return Ok(material);
    }
    let mut changes = Changes::default();
    let still;
    (still, changes.base_color) = tracks.split(GltfProperty::BaseColor(index));
    material.base_color = still.map_or(material.base_color, |color: [f64; 4]| color.map(unit));
    let factor = |property, value: &mut f32| {
        let (still, track) = tracks.split(property);
        *value = still.map_or(*value, |[still]| unit(still));
        track
    };
    changes.metallic = factor(GltfProperty::Metallic(index), &mut material.metallic);
    changes.roughness = factor(GltfProperty::Roughness(index), &mut material.roughness);
    let still;
    (still, changes.reflectance) = tracks.split(GltfProperty::Reflectance(index));
    if let Some([still]) = still {
        material.reflectance = Some(Reflectance::Constant(unit(still)));
    }
    material.set_changes(changes);
    let greatest = material.greatest_reflectance();
    let check = material.scattering.check(greatest.as_ref());
    check.map_err(|error| format!("extras.{error}, at all times"))?;
    Ok(material)
}

fn unit(value: f64) -> f32 {
    value.clamp(0.0, 1.0) as f32
}

/// glTF's own factors; every viewer clamps them, so a stray 1.001 is only noted.
struct GltfFactors<'a> {
    place: &'a dyn Fn() -> String,
    notes: &'a mut Notes,
}

impl GltfFactors<'_> {
    fn unit(&mut self, name: &str, value: f32) -> f32 {
        if !(0.0..=1.0).contains(&value) {
            self.notes.add("factors outside 0..1 are clamped", || format!("{} {name} {value}", (self.place)()));
        }
        value.clamp(0.0, 1.0)
    }

    fn units<const N: usize>(&mut self, name: &str, values: [f32; N]) -> [f32; N] {
        values.map(|value| self.unit(name, value))
    }
}

/// Images, decoded when a material in use first needs them.
struct GltfImages<'a> {
    document: &'a GltfDocument<'a>,
    accessors: &'a Accessors<'a>,
    /// Decoded, by index of the image.
    by_image: HashMap<usize, Arc<Texture>>,
    budget: &'a mut TextureBudget,
}

impl GltfImages<'_> {
    /// The texture reference that `info` describes; `None`, with a note, if the file only has the image in the format
    /// of an extension.
    fn texture_ref(&mut self, info: &Info, user: &str, notes: &mut Notes) -> Result<Option<TextureRef>> {
        let document = self.document;
        let json = &document.json;
        let missing = |what: &str, index: usize| {
            Err(document.error(user, format!("its {what} {index} does not exist in the file")))
        };
        let Some(texture) = json.textures.get(info.index.value()) else {
            return missing("texture", info.index.value());
        };
        let sampler = match texture.sampler {
            None => None,
            Some(index) => match json.samplers.get(index.value()) {
                None => return missing("sampler", index.value()),
                sampler => sampler,
            },
        };
        // The crate's marker for a texture without `source`.
        if texture.source.value() == u32::MAX as usize {
            notes.add("textures without a PNG or JPEG image are left out", || user.to_owned());
            return Ok(None);
        }
        let mut use_ = TextureRef::plain(self.image(texture.source.value(), user)?);
        if let Some(sampler) = sampler {
            use_.wrap_u = wrap(sampler.wrap_s);
            use_.wrap_v = wrap(sampler.wrap_t);
            if sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest)) {
                use_.filter = Filter::Nearest;
            }
        }
        if let Some(transform) = info.extensions.as_ref().and_then(|all| all.texture_transform.as_ref()) {
            // KHR_texture_transform: scale first, then rotate, then move. The rotation is
            // counter-clockwise as seen in the image, whose v points down.
            let ([su, sv], [tu, tv]) = (transform.scale.0, transform.offset.0);
            let (sin, cos) = transform.rotation.0.sin_cos();
            use_.transform = [[cos * su, sin * sv, tu], [-sin * su, cos * sv, tv]];
            if use_.transform.iter().flatten().any(|number| !number.is_finite()) {
                return Err(self.document.error(user, "its KHR_texture_transform has numbers that are not finite"));
            }
        }
        Ok(Some(use_))
    }

    /// The decoded image `index`.
    fn image(&mut self, index: usize, user: &str) -> Result<Arc<Texture>> {
        if let Some(known) = self.by_image.get(&index) {
            return Ok(known.clone());
        }
        let document = self.document;
        let Some(image) = document.json.images.get(index) else {
            return Err(document.error(user, format!("its image {index} does not exist in the file")));
        };
        let here = place("image", index, image.name.as_deref());
        let fault = |message: String| document.error(&here, message);
        let loaded;
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                loaded = document.files.load(uri, Limit::IMAGE).map_err(fault)?;
                &loaded
            }
            (None, Some(view)) => self.accessors.view(view).map_err(|message| fault(format!("it {message}")))?,
            (None, None) => return Err(fault("it has neither uri nor bufferView".into())),
        };
        let origin = format!("{}: {here}", shown::path(document.origin));
        let texture = Arc::new(Texture::decode(bytes, &origin, self.budget)?);
        self.by_image.insert(index, texture.clone());
        Ok(texture)
    }
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::ClampToEdge,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::MirroredRepeat,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}
