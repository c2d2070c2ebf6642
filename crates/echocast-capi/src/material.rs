//! Materials.

use crate::context::{Context, echocast_context};
use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::handle::{self, handles};
use crate::text;
use echocast::scene::{Material, Texture, TextureRef};
use std::ffi::c_char;
use std::ptr;
use std::sync::Arc;

/// What surfaces are made of; immutable.
pub struct echocast_material(());

handles! {
    echocast_material: (Arc<Context>, Arc<Material>), "material", 2;
}

/// An image on a surface: rows from the top, 8 bits per channel, colours sRGB-encoded; ECHOCAST_IMAGE_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_image {
    /// sizeof(echocast_image).
    pub struct_size: usize,
    /// The pixels; copied by the call.
    pub data: *const u8,
    /// Pixels per row, 1 to 16384.
    pub width: u32,
    /// Rows, 1 to 16384.
    pub height: u32,
    /// 3 for RGB, 4 for RGBA.
    pub channels: u32,
    /// 0.
    pub reserved: u32,
    /// Bytes from row to row; 0 for width * channels.
    pub row_stride: usize,
}

impl Default for echocast_image {
    fn default() -> Self {
        echocast_image {
            struct_size: size_of::<Self>(),
            data: ptr::null(),
            width: 0,
            height: 0,
            channels: 3,
            reserved: 0,
            row_stride: 0,
        }
    }
}

text::versioned!(echocast_image { struct_size, data, width, height, channels, reserved, row_stride });

/// Creates a material from YAML text with the keys of a material file: `name`, `base_color`, `reflectance` and so on.
/// `image` multiplies its base colour where the mesh has texture coordinates; NULL for none.
///
/// Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_PARSE (line and key), ECHOCAST_E_MEMORY. Any thread may call this.
///
/// ```c
/// echocast_material *paint;
/// echocast_material_create(context, "{name: paint, base_color: [0.8, 0.1, 0.1], reflectance: 0.6}", NULL, &paint);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_material_create(
    context: *const echocast_context,
    yaml: *const c_char,
    image: *const echocast_image,
    out: *mut *mut echocast_material,
) -> echocast_status {
    guard(|| {
        // SAFETY: `out` is an output (see `text`).
        let out = unsafe { text::output(out, "out") }?.write(ptr::null_mut());
        let context = handle::get(context, "context")?;
        // SAFETY: `yaml` is a string (see `text`).
        let yaml = unsafe { text::required(yaml, "yaml") }?;
        let mut material = Material::from_yaml(yaml)?;
        if !image.is_null() {
            // SAFETY: `image` is a structure whose `data` is an array (see `text`).
            let texture = unsafe { read_image(image) }?;
            material.base_color_texture = Some(TextureRef::plain(Arc::new(texture)));
        }
        *out = handle::create((context, Arc::new(material)))?;
        Ok(())
    })
}

/// # Safety
/// `image` is a structure whose `data` is an array, as [`text`] describes.
unsafe fn read_image(image: *const echocast_image) -> Outcome<Texture> {
    // SAFETY: as the caller promises.
    let image = unsafe { text::structure(image, "image") }?;
    for (name, size) in [("image->width", image.width), ("image->height", image.height)] {
        if !(1..=16384).contains(&size) {
            return Err(Failure::argument(name, size, "1 to 16384"));
        }
    }
    if image.channels != 3 && image.channels != 4 {
        return Err(Failure::argument("image->channels", image.channels, "3 or 4"));
    }
    if image.reserved != 0 {
        return Err(Failure::argument("image->reserved", image.reserved, "0"));
    }
    let row = (image.width * image.channels) as usize;
    let stride = if image.row_stride == 0 { row } else { image.row_stride };
    if stride < row {
        return Err(Failure::argument("image->row_stride", stride, &format!("0, or {row} and more")));
    }
    let bytes = stride.saturating_mul(image.height as usize - 1).saturating_add(row);
    // SAFETY: as the caller promises.
    let bytes = unsafe { text::array(image.data, bytes, "image->data") }?;
    let pixel = |p: &[u8]| [p[0], p[1], p[2], p.get(3).copied().unwrap_or(255)];
    let pixels = bytes.chunks(stride).flat_map(|line| line[..row].chunks_exact(image.channels as usize).map(pixel));
    let pixels = text::collect(pixels, image.width as usize * image.height as usize, "image->data")?;
    Ok(Texture::new(image.width, image.height, pixels))
}

/// Releases a material; meshes and instances that use it keep it. NULL is allowed. Any thread may call this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_material_release(material: *mut echocast_material) {
    guard(|| {
        handle::release(material);
        Ok(())
    });
}
