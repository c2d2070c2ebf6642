//! Images on surfaces: decoding happens in the readers, sampling here.

use super::decode::ImageHeader;
use echocast_memory::tried;
use ground::builder;
use ground::error::{Error, Result};
use ground::math::floor;
use ground::named;
use std::sync::{Arc, OnceLock};

/// How an image continues beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image again, every second copy mirrored.
    MirroredRepeat,
    /// The edge pixel.
    ClampToEdge,
}

named! { Wrap: Repeat "repeat", MirroredRepeat "mirrored_repeat", ClampToEdge "clamp_to_edge" }

/// How colours between pixel centres are determined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest pixel.
    Nearest,
    /// Bilinear between four pixels, in linear light.
    #[default]
    Linear,
}

named! { Filter: Nearest "nearest", Linear "linear" }

/// An image, 8 bit RGBA, colour channels sRGB-encoded, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Pixels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<[u8; 4]>,
    /// Whether alpha is 255 everywhere.
    #[doc(hidden)]
    pub opaque: bool,
}

/// Bytes that the decoded images of one scene may still use.
pub struct TextureBudget {
    left: u64,
    limit_mib: u64,
}

impl TextureBudget {
    /// For images of up to `limit_mib` MiB in total; none of it is used yet.
    pub fn new(limit_mib: u64) -> Self {
        TextureBudget { left: limit_mib.saturating_mul(1 << 20), limit_mib }
    }

    /// The error message for a budget that is used up.
    fn exceeded(&self) -> String {
        format!(
            "the images of the scene take more than {} MiB decoded; allowed: up to texture_limit_mib (--texture-limit)",
            self.limit_mib
        )
    }
}

/// The channel of an image that gives the opacity of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Red, as encoded.
    Red,
    /// Green, as encoded.
    Green,
    /// Blue, as encoded.
    Blue,
    /// The image's own alpha.
    Alpha,
    /// Luminance of the encoded red, green and blue (Rec. 709 weights).
    Luminance,
}

impl Texture {
    /// A texture of `width * height` pixels, row by row from the top.
    pub fn new(width: u32, height: u32, pixels: Vec<[u8; 4]>) -> Texture {
        let opaque = pixels.iter().all(|pixel| pixel[3] == 255);
        Texture { width, height, pixels, opaque }
    }

    /// An image whose alpha is a channel of this one; luminance is that of the encoded bytes, as masks are not light
    /// (Rec. ITU-R BT.709); `origin` is its source, for errors.
    ///
    /// # Errors
    /// No budget left, or no memory.
    #[doc(hidden)]
    pub fn as_mask(&self, channel: Channel, origin: &str, budget: &mut TextureBudget) -> Result<Texture> {
        let size = 4 * self.pixels.len();
        let fault = || Error::Parse { origin: origin.to_owned(), place: String::new(), message: budget.exceeded() };
        budget.left = budget.left.checked_sub(size as u64).ok_or_else(fault)?;
        let mut pixels = Vec::new();
        tried(|| pixels.try_reserve_exact(self.pixels.len()))
            .map_err(|_| Error::Memory(format!("{size} bytes of the image {origin}")))?;
        let of = |&[r, g, b, alpha]: &[u8; 4]| match channel {
            Channel::Red => r,
            Channel::Green => g,
            Channel::Blue => b,
            Channel::Alpha => alpha,
            Channel::Luminance => {
                ((2126 * u32::from(r) + 7152 * u32::from(g) + 722 * u32::from(b) + 5000) / 10_000) as u8
            }
        };
        pixels.extend(self.pixels.iter().map(|pixel| [255, 255, 255, of(pixel)]));
        Ok(Texture::new(self.width, self.height, pixels))
    }

    /// Whether alpha is close to 0 or to 1 almost everywhere: values in between are edges.
    pub(crate) fn is_black_or_white(&self) -> bool {
        let between = self.pixels.iter().filter(|pixel| (16..240).contains(&pixel[3])).count();
        between * 10 <= self.pixels.len()
    }

    /// Decodes a PNG or JPEG image of a scene with `budget`; `origin` is its source, for errors.
    ///
    /// # Errors
    /// Another format, damaged data, more than 16384 pixels a side; no budget left, or no memory.
    #[doc(hidden)]
    pub fn decode(bytes: &[u8], origin: &str, budget: &mut TextureBudget) -> Result<Texture> {
        /// Most pixels per row, and most rows.
        const LONGEST_SIDE: u32 = 16384;
        /// For the other contents of the file: colour profiles, notes.
        const ASIDE: u64 = 64 << 20;
        let error = |message: String| Error::Parse { origin: origin.to_owned(), place: String::new(), message };
        let fault = |fault: &str| error(format!("the image cannot be decoded: {fault}"));
        // Nothing is decoded yet.
        let header = ImageHeader::read(bytes, budget.left.saturating_add(ASIDE))
            .ok_or_else(|| error("the image is neither PNG nor JPEG".to_owned()))?
            .map_err(fault)?;
        let ImageHeader { width, height, channels, depth, .. } = header;
        if width == 0 || height == 0 {
            return Err(error("the image has no pixel".to_owned()));
        }
        if width.max(height) > LONGEST_SIDE {
            return Err(error(format!("the image has {width} x {height} pixels; allowed: {LONGEST_SIDE} a side")));
        }
        let (stored, size) = (header.size(), 4 * u64::from(width) * u64::from(height));
        // The decoder's output becomes pixels in place: there is no second copy.
        let room = stored.max(size);
        if room > budget.left {
            return Err(error(budget.exceeded()));
        }
        let no_memory = || Error::Memory(format!("{room} bytes of the image {origin}"));
        let mut bytes = Vec::new();
        let capacity = usize::try_from(room).map_err(|_| no_memory())?;
        tried(|| bytes.try_reserve_exact(capacity)).map_err(|_| no_memory())?;
        bytes.resize(room as usize, 0);
        header.decode(&mut bytes[..stored as usize]).map_err(fault)?;
        match (channels, depth) {
            (1, 1) => to_rgba(&mut bytes, size, |[l]| [l, l, l, 255]),
            (2, 1) => to_rgba(&mut bytes, size, |[l, a]| [l, l, l, a]),
            (3, 1) => to_rgba(&mut bytes, size, |[r, g, b]| [r, g, b, 255]),
            (4, 1) => {}
            (1, _) => to_rgba(&mut bytes, size, |[l, m]| {
                let l = rounded([l, m]);
                [l, l, l, 255]
            }),
            (2, _) => to_rgba(&mut bytes, size, |[l, m, a, b]| {
                let l = rounded([l, m]);
                [l, l, l, rounded([a, b])]
            }),
            (3, _) => {
                to_rgba(&mut bytes, size, |[r, s, g, h, b, c]| [rounded([r, s]), rounded([g, h]), rounded([b, c]), 255])
            }
            _ => to_rgba(&mut bytes, size, |[r, s, g, h, b, c, a, d]| {
                [rounded([r, s]), rounded([g, h]), rounded([b, c]), rounded([a, d])]
            }),
        }
        bytes.truncate(size as usize);
        bytes.shrink_to_fit();
        budget.left -= size;
        // No copy, unless the bytes have room for a partial pixel at the end.
        let pixels = bytemuck::allocation::try_cast_vec(bytes);
        Ok(Texture::new(width, height, pixels.unwrap_or_else(|(_, bytes)| bytemuck::cast_slice(&bytes).to_vec())))
    }
}

/// Turns pixels of `N` bytes each into the `size` bytes of RGBA, in place.
fn to_rgba<const N: usize>(bytes: &mut [u8], size: u64, rgba: impl Fn([u8; N]) -> [u8; 4]) {
    let mut turn = |pixel: usize| {
        let from = std::array::from_fn(|i| bytes[N * pixel + i]);
        bytes[4 * pixel..][..4].copy_from_slice(&rgba(from));
    };
    let pixels = 0..size as usize / 4;
    // No pixel is overwritten before it is read.
    if N < 4 { pixels.rev().for_each(&mut turn) } else { pixels.for_each(&mut turn) }
}

/// Rounds 16 bits to 8.
fn rounded(bits: [u8; 2]) -> u8 {
    ((u32::from(u16::from_be_bytes(bits)) + 128) / 257) as u8
}

builder! {
    /// A use of an image by a material.
    #[derive(Clone, Debug, PartialEq)]
    pub struct TextureRef {
        /// The image.
        pub texture: Arc<Texture>,
        /// How the image continues beyond its left and right edges.
        pub wrap_u: Wrap,
        /// How the image continues beyond its top and bottom edges.
        pub wrap_v: Wrap,
        /// How colours between pixel centres are determined.
        pub filter: Filter,
        /// Rows of the 2x3 matrix from a vertex's (u, v, 1) to the image's (u, v), v downwards.
        pub transform: [[f32; 3]; 2],
    }
}

impl TextureRef {
    /// The plain use of `texture`: repeated, bilinear, coordinates unchanged.
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
        // Pixel centres are at half-integers.
        let (x, y) = (f64::from(u) * width as f64, f64::from(v) * height as f64);
        if !(x.is_finite() && y.is_finite()) {
            return [0.0; 4];
        }
        // This far out coordinates have no fractions: the colour there does not matter, but integers must hold them.
        const FAR: f64 = (1u64 << 52) as f64;
        let (x, y) = (x.clamp(-FAR, FAR), y.clamp(-FAR, FAR));
        let pixel = |px: i64, py: i64| {
            let column = wrap_index(px, width, self.wrap_u);
            let row = wrap_index(py, height, self.wrap_v);
            linear_rgba(image.pixels[(row * width + column) as usize])
        };
        match self.filter {
            Filter::Nearest => pixel(floor(x), floor(y)),
            Filter::Linear => {
                let (left, top) = (floor(x - 0.5), floor(y - 0.5));
                let (fx, fy) = ((x - 0.5 - left as f64) as f32, (y - 0.5 - top as f64) as f32);
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
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Linear 0..1 to sRGB-encoded 0..1 (IEC 61966-2-1).
pub(crate) fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear 0..1 to an sRGB-encoded byte.
pub fn srgb_byte(linear: f32) -> u8 {
    floor(f64::from(srgb_from_linear(linear) * 255.0) + 0.5).clamp(0, 255) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> TextureRef {
        let image = Texture::new(2, 1, vec![[0, 0, 0, 255], [255, 255, 255, 0]]);
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

    fn png(width: u32, height: u32, color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    #[test]
    fn images_share_one_budget() {
        let rgb = png(512, 256, png::ColorType::Rgb, png::BitDepth::Eight, &[7; 512 * 256 * 3]);
        let mut budget = TextureBudget::new(1);
        let mut decode = || Texture::decode(&rgb, "wood.png", &mut budget);
        assert_eq!(decode().unwrap().pixels, vec![[7, 7, 7, 255]; 512 * 256]);
        decode().unwrap();
        let error = decode().unwrap_err().to_string();
        let expected =
            "wood.png: the images of the scene take more than 1 MiB decoded; allowed: up to texture_limit_mib";
        assert!(error.starts_with(expected), "{error}");
    }

    /// The bytes of a PNG whose header says `width` x `height`, without those pixels.
    fn header(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = png(1, 1, png::ColorType::Grayscale, png::BitDepth::Eight, &[0]);
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        // The checksum of the type and data of the first chunk (PNG, annex D).
        let crc = !bytes[12..29].iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| crc >> 1 ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
        });
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        bytes
    }

    #[test]
    fn huge_images_are_refused_by_their_header() {
        let error = |bytes: &[u8]| Texture::decode(bytes, "a", &mut TextureBudget::new(1024)).unwrap_err().to_string();
        let found = error(&header(60_000, 60_000));
        assert_eq!(found, "a: the image has 60000 x 60000 pixels; allowed: 16384 a side");
        assert!(error(&header(16_384, 16_385)).contains("16384 x 16385"));
        // Room for just that, so that the error is about the missing data.
        assert_eq!(error(&header(16_384, 16_384)), "a: the image cannot be decoded: it is damaged");
        let error = Texture::decode(&header(16_384, 16_384), "a", &mut TextureBudget::new(1023)).unwrap_err();
        assert!(error.to_string().contains("more than 1023 MiB"), "{error}");
    }

    #[test]
    fn pixels_are_those_of_the_decoder_whatever_the_colours() {
        use png::{BitDepth, ColorType};
        for (color, channels) in
            [(ColorType::Grayscale, 1), (ColorType::GrayscaleAlpha, 2), (ColorType::Rgb, 3), (ColorType::Rgba, 4)]
        {
            for (depth, bytes) in [(BitDepth::Eight, 1), (BitDepth::Sixteen, 2)] {
                let data: Vec<u8> = (0..31 * 17 * channels * bytes).map(|i| (i * 167 % 256) as u8).collect();
                let file = png(31, 17, color, depth, &data);
                let number = |pixel: usize, channel: usize| {
                    let at = (pixel * channels + channel) * bytes;
                    match bytes {
                        1 => data[at],
                        _ => (f64::from(u16::from_be_bytes([data[at], data[at + 1]])) / 257.0).round() as u8,
                    }
                };
                let found = Texture::decode(&file, "a", &mut TextureBudget::new(1)).unwrap();
                for (pixel, rgba) in found.pixels.iter().enumerate() {
                    let (color, alpha) = (if channels < 3 { [0; 3] } else { [0, 1, 2] }, [1, 3].contains(&channels));
                    let [r, g, b] = color.map(|channel| number(pixel, channel));
                    let expected = [r, g, b, if alpha { 255 } else { number(pixel, channels - 1) }];
                    assert_eq!(*rgba, expected, "{color:?} {depth:?} {pixel}");
                }
            }
        }
    }

    /// Pixels compared with those that libjpeg decodes from the same files (Pillow 13), which rounds differently.
    #[test]
    fn photographs_are_those_of_another_reader() {
        let files: [(&[u8], &[u8]); 2] = [
            (include_bytes!("../../tests/data/images/rgb.jpg"), include_bytes!("../../tests/data/images/rgb.raw")),
            (include_bytes!("../../tests/data/images/grey.jpg"), include_bytes!("../../tests/data/images/grey.raw")),
        ];
        for (file, expected) in files {
            let found = Texture::decode(file, "a", &mut TextureBudget::new(1)).unwrap();
            assert_eq!((found.width, found.height), (21, 13));
            for (found, expected) in found.pixels.iter().zip(expected.chunks_exact(3)) {
                assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(*b) <= 2), "{found:?} {expected:?}");
            }
            let cut = Texture::decode(&file[..12], "a", &mut TextureBudget::new(1)).unwrap_err().to_string();
            assert!(cut.starts_with("a: the image cannot be decoded: it is "), "{cut}");
        }
    }

    #[test]
    fn srgb_round_trips_every_byte() {
        for byte in 0..=255u8 {
            assert_eq!(srgb_byte(linear_from_srgb(f32::from(byte) / 255.0)), byte);
        }
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-6);
    }
}
