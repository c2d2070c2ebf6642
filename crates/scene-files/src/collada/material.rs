//! Materials of the common profile and their images.

use super::library::{ColladaLibrary, name_of};
use crate::FileOptions;
use crate::gltf::percent_decoded;
use crate::notes::Notes;
use crate::obj::Files;
use ground::error::Result;
use ground::read::xml::Xml;
use ground::read::{self, Limit};
use ground::shown;
use model::material::{Material, Texture, TextureBudget, TextureRef};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The materials that meshes use, each read when first needed.
pub(super) struct ColladaMaterials<'d, 'a> {
    /// In the order of their use.
    pub list: Vec<Arc<Material>>,
    library: &'a ColladaLibrary<'d>,
    options: &'a FileOptions<'a>,
    budget: &'a mut TextureBudget,
    /// By id.
    known: HashMap<&'d str, Arc<Material>>,
    /// Decoded images by file; `None`: not available.
    images: HashMap<PathBuf, Option<Arc<Texture>>>,
}

impl<'d, 'a> ColladaMaterials<'d, 'a> {
    pub fn new(library: &'a ColladaLibrary<'d>, options: &'a FileOptions<'a>, budget: &'a mut TextureBudget) -> Self {
        let (known, images) = (HashMap::new(), HashMap::new());
        ColladaMaterials { list: Vec::new(), library, options, budget, known, images }
    }

    /// The material that an element defines.
    pub fn get(&mut self, material: Xml<'d>, notes: &mut Notes) -> Result<Arc<Material>> {
        let id = material.attribute("id").unwrap_or_default();
        if let Some(known) = self.known.get(id) {
            return Ok(known.clone());
        }
        let mut made = Material::default().name(name_of(material));
        if let Some(instance) = material.child("instance_effect") {
            let effect = self.library.referred(instance, "url")?;
            if let Some(profile) = effect.child("profile_COMMON") {
                self.apply(&mut made, profile, notes)?;
            }
        }
        let made = Arc::new(made);
        self.list.push(made.clone());
        self.known.insert(id, made.clone());
        Ok(made)
    }

    /// Gives `material` what the common profile says of it.
    fn apply(&mut self, material: &mut Material, profile: Xml<'d>, notes: &mut Notes) -> Result<()> {
        let technique = profile.child("technique");
        let shader = technique
            .into_iter()
            .flat_map(Xml::elements)
            .find(|element| ["phong", "lambert", "blinn", "constant"].contains(&element.name()));
        let Some(shader) = shader else { return Ok(()) };
        // A surface without shading has the colour that it would emit.
        let base = if shader.name() == "constant" { "emission" } else { "diffuse" };
        let mut alpha_of_image = None;
        if let Some(diffuse) = shader.child(base) {
            if let Some(rgba) = color(diffuse)? {
                material.base_color = [rgba[0], rgba[1], rgba[2], 1.0];
            } else if let Some(texture) = diffuse.child("texture") {
                alpha_of_image = self.texture(profile, texture, notes)?;
                material.base_color_texture = alpha_of_image.clone();
            }
        }
        let index = shader.child("index_of_refraction").and_then(|index| index.child("float"));
        if let Some(index) = index.map(Xml::content_numbers::<1>).transpose()? {
            // Exporters write 0 and 1 where they know nothing.
            if index[0] > 1.0 {
                material.ior = index[0].min(100.0) as f32;
            }
        }
        let opacity = opacity(shader)?;
        if opacity == 0.0 {
            notes.add(
                "materials that would be invisible are taken as opaque: exporters differ in what transparency means",
                || format!("{:?}", shown::name(&material.name)),
            );
        } else {
            material.base_color[3] = opacity;
        }
        // An image of transparency that is that of the colour: its alpha is the opacity.
        let masked = shader.child("transparent").and_then(|transparent| transparent.child("texture"));
        match (masked, alpha_of_image) {
            (Some(masked), Some(image)) if !image.texture.opaque => {
                let same = self.texture(profile, masked, notes)?;
                if same.is_some_and(|same| Arc::ptr_eq(&same.texture, &image.texture)) {
                    material.mask(image);
                } else {
                    notes.add("images of transparency other than that of the colour are not used", || {
                        format!("{:?}", shown::name(&material.name))
                    });
                    material.let_through();
                }
            }
            _ => material.let_through(),
        }
        Ok(())
    }

    /// The image that a `<texture>` uses; `None`, with a note: it cannot be used.
    fn texture(&mut self, profile: Xml<'d>, texture: Xml<'d>, notes: &mut Notes) -> Result<Option<TextureRef>> {
        let sampler = texture.required("texture")?;
        let Some(file) = image_file(self.library, profile, sampler) else {
            notes.add("textures without an image are left out", || format!("{:?}", shown::name(sampler)));
            return Ok(None);
        };
        let path = texture.path();
        let name = file.strip_prefix("file:///").or(file.strip_prefix("file://")).unwrap_or(file);
        let name = percent_decoded(name);
        let folder = path.parent().unwrap_or(Path::new(""));
        let files = Files { folder, allow_outside: self.options.allow_outside_paths };
        let found = match files.find(path, &name) {
            Ok(Some(found)) => found,
            Ok(None) => {
                notes.add("images that are not there are left out", || format!("{:?}", shown::name(&name)));
                return Ok(None);
            }
            Err(why) => {
                notes.add("images that are elsewhere are left out", || why);
                return Ok(None);
            }
        };
        let image = match self.images.get(&found) {
            Some(known) => known.clone(),
            None => {
                let bytes = read::bytes(&found, Limit::IMAGE)?;
                let image = match Texture::decode(&bytes, &shown::path(&found), self.budget) {
                    Ok(image) => Some(Arc::new(image)),
                    Err(error) => {
                        notes.add("images that cannot be read are left out", || error.to_string());
                        None
                    }
                };
                self.images.insert(found, image.clone());
                image
            }
        };
        // v is 0 at the bottom of the image in COLLADA, at the top in echocast.
        Ok(image.map(|image| TextureRef::plain(image).transform([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]])))
    }
}

/// The file of the image behind a sampler: by its surface (1.4), by its image (1.5), or, as some exporters write it, the
/// image itself.
fn image_file<'d>(library: &ColladaLibrary<'d>, profile: Xml<'d>, sampler: &'d str) -> Option<&'d str> {
    let parameter = |sid: &str| {
        let all = profile
            .children("newparam")
            .chain(profile.child("technique").into_iter().flat_map(|t| t.children("newparam")));
        all.into_iter().find(|parameter| parameter.attribute("sid") == Some(sid))
    };
    let image = match parameter(sampler).and_then(|parameter| parameter.child("sampler2D")) {
        Some(sampler) => match sampler.child("instance_image") {
            Some(instance) => library.with_id(instance.attribute("url")?.strip_prefix('#')?)?,
            None => {
                let surface = parameter(sampler.content_of("source")?)?.child("surface")?;
                library.with_id(surface.content_of("init_from")?)?
            }
        },
        None => library.with_id(sampler).filter(|image| image.name() == "image")?,
    };
    let from = image.child("init_from")?;
    Some(from.content_of("ref").unwrap_or_else(|| from.content())).filter(|file| !file.is_empty())
}

/// The colour in an element, 0 to 1.
fn color(holder: Xml<'_>) -> Result<Option<[f32; 4]>> {
    let Some(color) = holder.child("color") else { return Ok(None) };
    let [red, green, blue, alpha] = match color.content().split_ascii_whitespace().count() {
        3 => {
            let [red, green, blue] = color.content_numbers::<3>()?;
            [red, green, blue, 1.0]
        }
        _ => color.content_numbers::<4>()?,
    };
    Ok(Some([red, green, blue, alpha].map(|channel| channel.clamp(0.0, 1.0) as f32)))
}

/// The opacity that `<transparent>` and `<transparency>` give a surface, 0 to 1 (specification 1.4.1, chapter 7,
/// "Determining Transparency"): by A_ONE it is alpha times transparency, by RGB_ZERO 1 less the luminance of the colour
/// (weights of ITU-R BT.709) times transparency.
fn opacity(shader: Xml<'_>) -> Result<f32> {
    let factor = match shader.child("transparency").and_then(|transparency| transparency.child("float")) {
        Some(float) => float.content_numbers::<1>()?[0].clamp(0.0, 1.0) as f32,
        None => 1.0,
    };
    let Some(transparent) = shader.child("transparent") else {
        // Without a colour it is opaque black: alpha is 1.
        return Ok(factor);
    };
    let Some([red, green, blue, alpha]) = color(transparent)? else { return Ok(1.0) };
    let luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    Ok(match transparent.attribute("opaque").unwrap_or("A_ONE") {
        "RGB_ZERO" => 1.0 - luminance * factor,
        "RGB_ONE" => luminance * factor,
        "A_ZERO" => 1.0 - alpha * factor,
        _ => alpha * factor,
    })
}
