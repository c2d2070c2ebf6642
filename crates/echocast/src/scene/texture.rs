//! Images on surfaces: decoding happens in the readers, sampling here.

use crate::error::{Error, Result};
use image::{ImageReader, Limits};
use std::io::Cursor;
use std::sync::{Arc, OnceLock};

/// What lies beyond the edge of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image again, every second one mirrored.
    MirroredRepeat,
    /// The edge pixel.
    ClampToEdge,
}

/// How colours between pixel centres are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest pixel.
    Nearest,
    /// Bilinear between four pixels, in linear light.
    #[default]
    Linear,
}

/// An image, 8 bit RGBA, colour channels sRGB-encoded, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Pixels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<[u8; 4]>,
}

/// Bytes that the decoded images of one file may still take.
pub(crate) struct TextureBudget(usize);

impl TextureBudget {
    /// More is a mistake or an attack.
    const GIB: usize = 4;
}

impl Default for TextureBudget {
    fn default() -> Self {
        TextureBudget(TextureBudget::GIB << 30)
    }
}

impl Texture {
    /// Decodes a PNG or JPEG image of a file with `budget`; `origin` is where it comes from, for errors.
    ///
    /// # Errors
    /// Another format, damaged data, more than 16384 pixels a side or 512 MiB of memory, no budget left.
    pub(crate) fn decode(bytes: &[u8], origin: &str, budget: &mut TextureBudget) -> Result<Texture> {
        let error = |message: String| Error::Parse { origin: origin.to_owned(), place: String::new(), message };
        let mut reader = ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|source| error(format!("the image cannot be read: {source}")))?;
        if reader.format().is_none() {
            return Err(error("the image is neither PNG nor JPEG".to_owned()));
        }
        let mut limits = Limits::default();
        (limits.max_image_width, limits.max_image_height) = (Some(16384), Some(16384));
        limits.max_alloc = Some(512 << 20);
        reader.limits(limits);
        let image = reader.decode().map_err(|source| error(format!("the image cannot be decoded: {source}")))?;
        let image = image.into_rgba8();
        let (width, height) = image.dimensions();
        if width == 0 || height == 0 {
            return Err(error("the image has no pixel".to_owned()));
        }
        let size = image.as_raw().len();
        let Some(left) = budget.0.checked_sub(size) else {
            return Err(error(format!("the images of the file take more than {} GiB decoded", TextureBudget::GIB)));
        };
        budget.0 = left;
        // No copy, unless the bytes have room for a broken pixel behind them.
        let pixels = bytemuck::allocation::try_cast_vec(image.into_raw());
        Ok(Texture { width, height, pixels: pixels.unwrap_or_else(|(_, bytes)| bytemuck::cast_slice(&bytes).to_vec()) })
    }
}

/// A use of an image by a material.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// The image.
    pub texture: Arc<Texture>,
    /// Beyond the left and right edges.
    pub wrap_u: Wrap,
    /// Beyond the top and bottom edges.
    pub wrap_v: Wrap,
    /// Between pixel centres.
    pub filter: Filter,
    /// Rows of the 2x3 matrix that takes a vertex's (u, v, 1) to the image's (u, v), v downwards.
    pub transform: [[f32; 3]; 2],
}

impl TextureRef {
    /// The plain use of `texture`: repeated, bilinear, coordinates as they are.
    pub fn plain(texture: Arc<Texture>) -> Self {
        TextureRef {
            texture,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            filter: Filter::Linear,
            transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        }
    }

    /// Linear RGBA at the vertex coordinates `uv`.
    pub fn sample(&self, uv: [f32; 2]) -> [f32; 4] {
        let image = &*self.texture;
        let [u, v] = self.transform.map(|row| row[0] * uv[0] + row[1] * uv[1] + row[2]);
        let (width, height) = (image.width as i64, image.height as i64);
        // Pixel centres lie at half-integers.
        let (x, y) = (f64::from(u) * width as f64, f64::from(v) * height as f64);
        if !(x.is_finite() && y.is_finite()) {
            return [0.0; 4];
        }
        // So far out pixels have no fractions: what colour is there does not matter, but whole numbers must hold it.
        const FAR: f64 = (1u64 << 52) as f64;
        let (x, y) = (x.clamp(-FAR, FAR), y.clamp(-FAR, FAR));
        let pixel = |px: i64, py: i64| {
            let column = wrap_index(px, width, self.wrap_u);
            let row = wrap_index(py, height, self.wrap_v);
            linear_rgba(image.pixels[(row * width + column) as usize])
        };
        match self.filter {
            Filter::Nearest => pixel(x.floor() as i64, y.floor() as i64),
            Filter::Linear => {
                let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
                let (fx, fy) = ((x - 0.5 - left) as f32, (y - 0.5 - top) as f32);
                let (left, top) = (left as i64, top as i64);
                let corners = [pixel(left, top), pixel(left + 1, top), pixel(left, top + 1), pixel(left + 1, top + 1)];
                std::array::from_fn(|c| {
                    let upper = corners[0][c] + (corners[1][c] - corners[0][c]) * fx;
                    let lower = corners[2][c] + (corners[3][c] - corners[2][c]) * fx;
                    upper + (lower - upper) * fy
                })
            }
        }
    }
}

fn wrap_index(index: i64, size: i64, wrap: Wrap) -> i64 {
    match wrap {
        Wrap::Repeat => index.rem_euclid(size),
        Wrap::ClampToEdge => index.clamp(0, size - 1),
        Wrap::MirroredRepeat => {
            let period = index.rem_euclid(2 * size);
            if period < size { period } else { 2 * size - 1 - period }
        }
    }
}

fn linear_rgba(pixel: [u8; 4]) -> [f32; 4] {
    let table = srgb_table();
    [table[pixel[0] as usize], table[pixel[1] as usize], table[pixel[2] as usize], f32::from(pixel[3]) / 255.0]
}

fn srgb_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0)))
}

/// sRGB-encoded 0..1 to linear 0..1 (IEC 61966-2-1).
pub(crate) fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Linear 0..1 to sRGB-encoded 0..1 (IEC 61966-2-1).
pub(crate) fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear 0..1 to an sRGB-encoded byte.
pub(crate) fn srgb_byte(linear: f32) -> u8 {
    (srgb_from_linear(linear) * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> TextureRef {
        let image = Texture { width: 2, height: 1, pixels: vec![[0, 0, 0, 255], [255, 255, 255, 0]] };
        TextureRef::plain(Arc::new(image))
    }

    #[test]
    fn wrap_modes_continue_the_image() {
        let at = |wrap, index| wrap_index(index, 3, wrap);
        assert_eq!((-4..5).map(|i| at(Wrap::Repeat, i)).collect::<Vec<_>>(), [2, 0, 1, 2, 0, 1, 2, 0, 1]);
        assert_eq!((-4..5).map(|i| at(Wrap::ClampToEdge, i)).collect::<Vec<_>>(), [0, 0, 0, 0, 0, 1, 2, 2, 2]);
        assert_eq!((-4..5).map(|i| at(Wrap::MirroredRepeat, i)).collect::<Vec<_>>(), [2, 2, 1, 0, 0, 1, 2, 2, 1]);
    }

    #[test]
    fn filters_hit_pixel_centres_and_mix_between_them() {
        let mut use_ = checker();
        assert_eq!(use_.sample([0.25, 0.5]), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(use_.sample([0.75, 0.5]), [1.0, 1.0, 1.0, 0.0]);
        let middle = use_.sample([0.5, 0.5]);
        assert!((middle[0] - 0.5).abs() < 1e-6, "the mean is taken in linear light");
        use_.filter = Filter::Nearest;
        assert_eq!(use_.sample([0.51, 0.5])[0], 1.0);
        use_.transform = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]];
        assert_eq!(use_.sample([0.25, 0.5])[0], 1.0);
    }

    #[test]
    fn coordinates_from_anywhere_are_sampled() {
        for wrap in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge] {
            for filter in [Filter::Nearest, Filter::Linear] {
                let use_ = TextureRef { wrap_u: wrap, wrap_v: wrap, filter, ..checker() };
                for far in [3e38, -3e38, 1e18, 1e-45] {
                    for uv in [[far, 0.0], [0.0, far]] {
                        assert!(use_.sample(uv).iter().all(|x| (0.0..=1.0).contains(x)), "{uv:?}");
                    }
                }
                for none in [f32::NAN, f32::INFINITY] {
                    assert_eq!(use_.sample([none, 0.5]), [0.0; 4]);
                }
            }
        }
        let clamped = TextureRef { wrap_u: Wrap::ClampToEdge, ..checker() };
        assert_eq!(clamped.sample([3e38, 0.5]), [1.0, 1.0, 1.0, 0.0]);
    }

    #[test]
    fn images_share_one_budget() {
        let mut png = Cursor::new(Vec::new());
        let image = image::RgbImage::from_raw(2, 1, vec![1, 2, 3, 4, 5, 6]).unwrap();
        image.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let mut budget = TextureBudget(15);
        let mut decode = || Texture::decode(png.get_ref(), "wood.png", &mut budget);
        assert_eq!(decode().unwrap().pixels, [[1, 2, 3, 255], [4, 5, 6, 255]]);
        let error = decode().unwrap_err().to_string();
        assert_eq!(error, "wood.png: the images of the file take more than 4 GiB decoded");
    }

    #[test]
    fn srgb_round_trips_every_byte() {
        for byte in 0..=255u8 {
            assert_eq!(srgb_byte(linear_from_srgb(f32::from(byte) / 255.0)), byte);
        }
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-6);
    }
}
