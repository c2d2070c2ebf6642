//! Materials and their textures.

use super::{FbxDocument, user};
use crate::notes::Notes;
use crate::obj::Files;
use crate::{FileOptions, properties};
use ground::error::Result;
use ground::read::{self, Limit};
use ground::shown;
use model::material::{Channel, Material, Texture, TextureBudget, TextureRef, Wrap};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use ufbx::{MaterialMap, ShaderType, WrapMode};

/// The materials that parts use, each read when first needed.
pub(super) struct FbxMaterials<'a> {
    pub list: Vec<Arc<Material>>,
    pub options: &'a FileOptions<'a>,
    document: &'a FbxDocument<'a>,
    /// By number in the file, with the name of the texture coordinate set that its texture uses.
    known: HashMap<u32, (Arc<Material>, Option<String>)>,
    /// Decoded, by number of the file's images; `None`: not available.
    images: HashMap<u32, Option<Arc<Texture>>>,
    /// Masks, by their images, which live as long.
    masks: HashMap<*const Texture, Arc<Texture>>,
    budget: &'a mut TextureBudget,
}

impl<'a> FbxMaterials<'a> {
    pub fn new(document: &'a FbxDocument<'a>, options: &'a FileOptions<'a>, budget: &'a mut TextureBudget) -> Self {
        let (known, images, masks) = (HashMap::new(), HashMap::new(), HashMap::new());
        FbxMaterials { list: Vec::new(), options, document, known, images, masks, budget }
    }

    /// A material, and the name of the texture coordinate set that its texture uses, if it has one.
    pub fn get(&mut self, source: &ufbx::Material, notes: &mut Notes) -> Result<(Arc<Material>, Option<String>)> {
        let number = source.element.typed_id;
        if let Some(known) = self.known.get(&number) {
            return Ok(known.clone());
        }
        let here = || format!("material {:?}", shown::name(&source.element.name));
        let mut material = surface(source, &mut FbxFactors { place: &here, notes });
        let texture = match texture(source) {
            Some(texture) => self.texture_ref(texture, &here(), notes)?,
            None => None,
        };
        let mut set = texture.as_ref().map(|(_, set)| set.clone());
        if let Some((texture, _)) = texture {
            // A texture connected to a property replaces its value.
            let factor = source.pbr.base_factor.has_value.then_some(source.pbr.base_factor.value_vec4.x);
            let grey = factor.map_or(1.0, |factor| factor.clamp(0.0, 1.0) as f32);
            let [.., alpha] = material.base_color;
            material.base_color = [grey, grey, grey, alpha];
            material.base_color_texture = Some(texture);
        }
        let mask = match opacity_texture(source) {
            Some(texture) => self.mask(texture, &here(), notes)?,
            None => None,
        };
        match mask {
            // A set without a name is the first one of the mesh.
            Some((_, own)) if set.as_ref().is_some_and(|set| ![set, ""].contains(&own.as_str()) && !set.is_empty()) => {
                notes.add("masks with texture coordinates of their own are not used", here);
                material.let_through();
            }
            Some((mask, own)) => {
                set = set.filter(|set| !set.is_empty()).or(Some(own));
                material.base_color[3] = 1.0;
                material.mask(mask);
            }
            None => material.let_through(),
        }
        properties::apply(&mut material, "property ", |key| user::get(&source.element.props, key))
            .map_err(|message| self.document.error(here(), message))?;
        let material = Arc::new(material);
        self.list.push(material.clone());
        self.known.insert(number, (material.clone(), set.clone()));
        Ok((material, set))
    }

    /// A reference to a texture, and its texture coordinate set; `None`, with a note, if there is no readable image.
    fn texture_ref(
        &mut self,
        texture: &ufbx::Texture,
        user: &str,
        notes: &mut Notes,
    ) -> Result<Option<(TextureRef, String)>> {
        let files = texture.file_textures.as_ref();
        if files.len() > 1 {
            notes.add("of textures in layers the first is used", || user.to_owned());
        }
        let Some(file) = files.first().filter(|file| file.has_file) else {
            notes.add("textures without an image are left out", || user.to_owned());
            return Ok(None);
        };
        let Some(image) = self.image(file, user, notes)? else { return Ok(None) };
        let wrap = |mode| if mode == WrapMode::Clamp { Wrap::ClampToEdge } else { Wrap::Repeat };
        let mut use_ = TextureRef::plain(image);
        (use_.wrap_u, use_.wrap_v) = (wrap(file.wrap_u), wrap(file.wrap_v));
        // v is 0 at the bottom of the image in FBX, at the top in echocast.
        let to = &file.uv_to_texture;
        let rows = if file.has_uv_transform {
            [[to.m00, to.m01, to.m03], [-to.m10, -to.m11, 1.0 - to.m13]]
        } else {
            [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]]
        };
        use_.transform = rows.map(|row| row.map(|number| number as f32));
        if use_.transform.iter().flatten().any(|number| !number.is_finite()) {
            return Err(self.document.error(user, "the transform of its texture has numbers that are not finite"));
        }
        Ok(Some((use_, file.uv_set.to_string())))
    }

    /// [`FbxMaterials::texture_ref`] of an opacity mask: the alpha of the image if it has any, else its brightness.
    fn mask(&mut self, texture: &ufbx::Texture, user: &str, notes: &mut Notes) -> Result<Option<(TextureRef, String)>> {
        let Some((image, set)) = self.texture_ref(texture, user, notes)? else { return Ok(None) };
        let key = Arc::as_ptr(&image.texture);
        let texture = match self.masks.get(&key) {
            Some(known) => known.clone(),
            None => {
                let channel = if image.texture.opaque { Channel::Luminance } else { Channel::Alpha };
                let made = Arc::new(image.texture.as_mask(channel, user, self.budget)?);
                self.masks.insert(key, made.clone());
                made
            }
        };
        Ok(Some((image.texture(texture), set)))
    }

    /// The image of a texture, embedded or in a file of its own.
    fn image(&mut self, file: &ufbx::Texture, user: &str, notes: &mut Notes) -> Result<Option<Arc<Texture>>> {
        if let Some(known) = self.images.get(&file.file_index) {
            return Ok(known.clone());
        }
        let loaded;
        let bytes: &[u8] = if file.content.is_empty() {
            match self.find(file) {
                Ok(bytes) => {
                    loaded = bytes;
                    &loaded
                }
                Err(message) => {
                    notes.add("textures that cannot be read are left out", || format!("{user}: {message}"));
                    self.images.insert(file.file_index, None);
                    return Ok(None);
                }
            }
        } else {
            &file.content
        };
        let is_known = [&b"\x89PNG"[..], &b"\xff\xd8"[..]].into_iter().any(|start| bytes.starts_with(start));
        let image = if is_known {
            let origin = format!("{}: {user}: image {:?}", shown::path(self.document.origin), shown::name(&name(file)));
            Some(Arc::new(Texture::decode(bytes, &origin, self.budget)?))
        } else {
            notes.add("textures that are neither PNG nor JPEG are left out", || {
                format!("{user}: {:?}", shown::name(&name(file)))
            });
            None
        };
        self.images.insert(file.file_index, image.clone());
        Ok(image)
    }

    /// The bytes of the image that a texture names: searched for at its path relative to the scene, next to the scene,
    /// and last where it was on the machine that wrote the file.
    fn find(&self, file: &ufbx::Texture) -> Result<Vec<u8>, String> {
        let origin = self.document.origin;
        let folder = origin.parent().unwrap_or(Path::new(""));
        let files = Files { folder, allow_outside: self.options.allow_outside_paths };
        let names = [&file.relative_filename, &file.filename, &file.absolute_filename];
        let mut refused = None;
        for name in names.into_iter().filter(|name| !name.is_empty()) {
            // Of paths of other machines only the last component is searched for.
            let beside = name.rsplit(['/', '\\']).next().unwrap_or(name);
            for name in [name.as_ref(), beside] {
                match files.find(origin, name) {
                    Ok(Some(path)) => return read::bytes(&path, Limit::IMAGE).map_err(|error| error.to_string()),
                    Ok(None) => {}
                    Err(message) => refused = refused.or(Some(message)),
                }
            }
        }
        Err(refused.unwrap_or_else(|| format!("there is no image {:?}", shown::name(&name(file)))))
    }
}

/// File name of a texture.
fn name(file: &ufbx::Texture) -> String {
    let names = [&file.relative_filename, &file.filename];
    names.into_iter().find(|name| !name.is_empty()).map(|name| name.to_string()).unwrap_or_default()
}

/// The texture connected to the base colour.
fn texture(source: &ufbx::Material) -> Option<&ufbx::Texture> {
    let maps = [&source.pbr.base_color, &source.fbx.diffuse_color];
    maps.into_iter().find_map(|map| map.texture.as_deref().filter(|_| map.texture_enabled))
}

/// The texture connected to the opacity.
fn opacity_texture(source: &ufbx::Material) -> Option<&ufbx::Texture> {
    let maps = [&source.pbr.opacity, &source.fbx.transparency_color, &source.fbx.transparency_factor];
    maps.into_iter().find_map(|map| map.texture.as_deref().filter(|_| map.texture_enabled))
}

/// Opacity of the older materials of FBX.
///
/// Their transparency is `TransparentColor` times `TransparencyFactor` (FBX SDK, FbxSurfaceLambert). Some programs
/// write both as 1 for opaque surfaces, but also `Opacity`, which then takes precedence.
fn opacity(source: &ufbx::Material) -> Option<f64> {
    let given = |map: &MaterialMap| map.has_value.then_some(map.value_vec4);
    let color = given(&source.fbx.transparency_color);
    let factor = given(&source.fbx.transparency_factor).map(|factor| factor.x);
    let whole = source.element.props.find_prop("Opacity").map(|prop| prop.value_vec4.x);
    let left = (color.is_some() || factor.is_some()).then(|| {
        let color = color.map_or(1.0, |color| (color.x + color.y + color.z) / 3.0);
        1.0 - factor.unwrap_or(1.0) * color
    });
    match (whole, left) {
        (Some(whole), _) if whole > 0.0 && whole < 1.0 => Some(whole),
        (Some(whole), Some(left)) if left <= 0.0 => Some(whole),
        (whole, left) => left.or(whole),
    }
}

/// Everything but the textures and the user properties.
fn surface(source: &ufbx::Material, factors: &mut FbxFactors<'_>) -> Material {
    let (pbr, features) = (&source.pbr, &source.features);
    let name = source.element.name.to_string();
    let name = if name.is_empty() { format!("material_{}", source.element.typed_id) } else { name };
    let mut material = Material::default().name(name).unlit(features.unlit.enabled);
    let number = |map: &MaterialMap| map.has_value.then_some(map.value_vec4.x);
    if pbr.base_color.has_value {
        let (color, factor) = (pbr.base_color.value_vec4, number(&pbr.base_factor).unwrap_or(1.0));
        let [r, g, b] = [color.x, color.y, color.z].map(|channel| factors.unit("base colour", channel * factor));
        material.base_color = [r, g, b, 1.0];
    }
    let older = matches!(source.shader_type, ShaderType::FbxLambert | ShaderType::FbxPhong);
    if let Some(opacity) = if older { opacity(source) } else { number(&pbr.opacity) } {
        material.base_color[3] = factors.unit("opacity", opacity);
    }
    match number(&pbr.roughness) {
        Some(roughness) => material.roughness = factors.unit("roughness", roughness),
        None => {
            let glossiness = number(&pbr.glossiness).map(|glossiness| factors.unit("glossiness", glossiness));
            material.roughness = glossiness.map_or(material.roughness, |glossiness| 1.0 - glossiness);
        }
    }
    if let Some(metalness) = number(&pbr.metalness) {
        material.metallic = factors.unit("metalness", metalness);
    }
    if let Some(transmission) = number(&pbr.transmission_factor).filter(|_| features.transmission.enabled && !older) {
        material.transmission = factors.unit("transmission", transmission);
    }
    if let Some(ior) = number(&pbr.specular_ior).filter(|ior| ior.is_finite()) {
        material.ior = ior.clamp(1.0, 100.0) as f32;
    }
    material.double_sided = features.double_sided.enabled;
    material
}

/// Factors from 0 to 1; every program clamps them, so a stray 1.001 is only noted.
struct FbxFactors<'a> {
    place: &'a dyn Fn() -> String,
    notes: &'a mut Notes,
}

impl FbxFactors<'_> {
    fn unit(&mut self, name: &str, value: f64) -> f32 {
        if !(0.0..=1.0).contains(&value) {
            self.notes.add("factors outside 0..1 are clamped", || format!("{} {name} {value}", (self.place)()));
        }
        // NaN counts as 0.
        if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) as f32 }
    }
}
