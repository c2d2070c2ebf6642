//! Pixels, and the few strokes a picture needs.

use super::font;
use glam::Vec2;
use png::{Compression, Filter};
use std::io;

/// Red, green, blue; sRGB.
pub(super) type Color = [u8; 3];

/// Pictures of scales have more colours than this, those of names fewer.
const FEW_COLORS: u32 = 8192;

/// Background of the page.
pub(super) const PAGE: Color = [0x17, 0x19, 0x1d];
/// Background of the points, and misses of range images.
pub(super) const GROUND: Color = [0x0d, 0x0e, 0x11];
/// Lines of the ground grid.
pub(super) const GRID: Color = [0x1c, 0x1f, 0x24];
/// Main text and marks.
pub(super) const TEXT: Color = [0xe8, 0xea, 0xed];
/// Secondary text.
pub(super) const DIM: Color = [0x98, 0x9e, 0xa8];

/// A picture in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row from the top, three sRGB bytes (red, green, blue) a pixel.
    pub pixels: Vec<u8>,
}

impl Picture {
    /// A picture of one colour.
    pub(super) fn new(width: u32, height: u32, color: Color) -> Picture {
        Picture { width, height, pixels: color.repeat(width as usize * height as usize) }
    }

    /// Colour at column `x`, row `y`.
    ///
    /// # Panics
    /// Outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        let at = self.offset(x, y);
        [self.pixels[at], self.pixels[at + 1], self.pixels[at + 2]]
    }

    fn offset(&self, x: u32, y: u32) -> usize {
        assert!(x < self.width && y < self.height, "pixel {x}, {y} is outside of {} x {}", self.width, self.height);
        3 * (y as usize * self.width as usize + x as usize)
    }

    fn blend(&mut self, x: u32, y: u32, color: Color, opacity: f32) {
        let at = self.offset(x, y);
        for (old, new) in self.pixels[at..at + 3].iter_mut().zip(color) {
            *old = (f32::from(*old) + (f32::from(new) - f32::from(*old)) * opacity).round() as u8;
        }
    }

    /// Blends `color` over the rectangle at `left`, `top`, clipped to the picture.
    pub(super) fn fill(&mut self, [left, top]: [u32; 2], [width, height]: [u32; 2], color: Color, opacity: f32) {
        for y in top..top.saturating_add(height).min(self.height) {
            for x in left..left.saturating_add(width).min(self.width) {
                self.blend(x, y, color, opacity);
            }
        }
    }

    /// Draws line segments with round ends as one shape; a segment of zero length is a disc.
    ///
    /// Coordinates are pixels from the top left corner, pixel centres at halves.
    pub(super) fn stroke(&mut self, segments: &[[Vec2; 2]], radius: f32, color: Color, opacity: f32) {
        let (low, high) = segments
            .iter()
            .flatten()
            .fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), &point| (low.min(point), high.max(point)));
        // Saturating casts make strokes outside the picture, and NaN, harmless.
        let first = (low - radius - 1.0).max(Vec2::ZERO);
        let last = (high + radius + 1.0).min(Vec2::new(self.width as f32, self.height as f32));
        for y in first.y as u32..last.y.ceil() as u32 {
            for x in first.x as u32..last.x.ceil() as u32 {
                let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let distance = segments.iter().map(|s| distance(centre, s)).fold(f32::INFINITY, f32::min);
                let cover = (radius + 0.5 - distance).clamp(0.0, 1.0);
                if cover > 0.0 {
                    self.blend(x, y, color, cover * opacity);
                }
            }
        }
    }

    /// Draws a line segment as [`Picture::stroke`] does, however long, visiting only pixels near it.
    pub(super) fn line(&mut self, segment: &[Vec2; 2], radius: f32, color: Color) {
        let [start, end] = *segment;
        let reach = radius + 1.0;
        let along = end - start;
        if !(along.is_finite() && start.is_finite()) {
            return;
        }
        let (low, high) = (start.min(end) - reach, start.max(end) + reach);
        // Casts saturate.
        for y in low.y.max(0.0) as u32..high.y.clamp(0.0, self.height as f32).ceil() as u32 {
            // The part of the segment near this row.
            let (above, below) = (y as f32 + 0.5 - reach, y as f32 + 0.5 + reach);
            let part = |height: f32| ((height - start.y) / along.y).clamp(0.0, 1.0);
            let parts = if along.y.abs() > f32::EPSILON { [part(above), part(below)] } else { [0.0, 1.0] };
            let [a, b] = parts.map(|part| start.x + along.x * part);
            let first = (a.min(b) - reach).max(low.x).max(0.0);
            let last = (a.max(b) + reach).min(high.x).min(self.width as f32);
            for x in first as u32..last.max(0.0).ceil() as u32 {
                let cover = (radius + 0.5 - distance(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), segment)).min(1.0);
                if cover > 0.0 {
                    self.blend(x, y, color, cover);
                }
            }
        }
    }

    /// Writes `words` from `start` (left end of the baseline) with capitals `capitals` pixels high.
    pub(super) fn text(&mut self, words: &str, start: Vec2, capitals: f32, color: Color) {
        for glyph in font::set(words, start, capitals) {
            self.stroke(&glyph, font::RADIUS * capitals, color, 1.0);
        }
    }

    /// [`Picture::text`] on a dark halo, readable over points.
    pub(super) fn text_over(&mut self, words: &str, start: Vec2, capitals: f32, color: Color) {
        for glyph in font::set(words, start, capitals) {
            self.stroke(&glyph, font::RADIUS * capitals + 0.25 * capitals, GROUND, 0.75);
        }
        self.text(words, start, capitals, color);
    }

    /// Marks the sensor: a ring, and a line to `ahead` in its viewing direction.
    pub(super) fn sensor_mark(&mut self, at: Vec2, ahead: Vec2, size: f32) {
        let ring: Vec<[Vec2; 2]> = (0..24)
            .map(|i| [i, i + 1].map(|i| at + size * Vec2::from_angle(i as f32 * std::f32::consts::TAU / 24.0)))
            .collect();
        let direction = (ahead - at).normalize_or_zero();
        let nose = [[at + direction * size, at + direction * (2.4 * size)]];
        for (radius, color, opacity) in [(0.5 * size, GROUND, 0.75), (0.17 * size, TEXT, 1.0)] {
            self.stroke(&ring, radius, color, opacity);
            self.stroke(&nose, radius, color, opacity);
        }
        self.stroke(&[[at, at]], 0.3 * size, TEXT, 1.0);
    }

    /// Copies `other` to `left`, `top`, clipped to the picture.
    pub(super) fn paste(&mut self, other: &Picture, left: u32, top: u32) {
        let width = 3 * other.width.min(self.width.saturating_sub(left)) as usize;
        for y in 0..other.height.min(self.height.saturating_sub(top)) {
            if width > 0 {
                let (to, from) = (self.offset(left, top + y), other.offset(0, y));
                self.pixels[to..to + width].copy_from_slice(&other.pixels[from..from + width]);
            }
        }
    }

    /// The picture as a PNG file, 8-bit RGB.
    ///
    /// Names have few colours, which compress best unfiltered; scales have many, whose differences between neighbours
    /// compress better. The highest level of compression would take twice as long for one hundredth less.
    ///
    /// # Errors
    /// None but those of the PNG writer, which writes to memory.
    pub fn to_png(&self) -> io::Result<Vec<u8>> {
        let filter = if self.colors() > FEW_COLORS { Filter::MinEntropy } else { Filter::NoFilter };
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        // In this order: compression sets a filter of its own.
        encoder.set_compression(Compression::Balanced);
        encoder.set_filter(filter);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.pixels)?;
        writer.finish()?;
        Ok(bytes)
    }

    /// Number of different colours.
    fn colors(&self) -> u32 {
        let mut seen = vec![0_u64; (1 << 24) / 64];
        for color in self.pixels.as_chunks::<3>().0 {
            let number = usize::from(color[0]) << 16 | usize::from(color[1]) << 8 | usize::from(color[2]);
            seen[number / 64] |= 1 << (number % 64);
        }
        seen.iter().map(|word| word.count_ones()).sum()
    }
}

/// Distance from `point` to a segment.
fn distance(point: Vec2, &[start, end]: &[Vec2; 2]) -> f32 {
    let along = end - start;
    let t = (point - start).dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
    point.distance(start + along * t.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strokes_are_solid_inside_soft_at_the_edge_and_clipped() {
        let mut picture = Picture::new(20, 10, [0; 3]);
        picture.stroke(&[[Vec2::new(5.0, 5.0), Vec2::new(40.0, 5.0)]], 1.5, [200, 100, 50], 1.0);
        assert_eq!(picture.pixel(10, 4), [200, 100, 50]);
        assert_eq!(picture.pixel(10, 3), [100, 50, 25]);
        assert_eq!(picture.pixel(10, 7), [0; 3]);
        assert_eq!(picture.pixel(2, 5), [0; 3]);
        let before = picture.clone();
        picture.stroke(&[[Vec2::NAN, Vec2::NAN]], 1.0, [255; 3], 1.0);
        picture.stroke(&[[Vec2::splat(-1e30), Vec2::splat(-1e30)]], 1.0, [255; 3], 1.0);
        assert_eq!(picture, before);
    }

    #[test]
    fn a_line_is_a_stroke() {
        let ends = [[3.0, 2.0], [17.5, 8.0], [3.0, 2.0], [9.0, 2.0], [-30.0, 4.0], [4.0, 70.0], [1e3, -1e3]];
        for pair in ends.map(Vec2::from).windows(2) {
            let segment = [pair[0], pair[1]];
            let (mut line, mut stroke) = (Picture::new(20, 10, [0; 3]), Picture::new(20, 10, [0; 3]));
            line.line(&segment, 1.2, [200, 100, 50]);
            stroke.stroke(&[segment], 1.2, [200, 100, 50], 1.0);
            assert_eq!(line, stroke, "{segment:?}");
        }
        let mut picture = Picture::new(20, 10, [0; 3]);
        picture.line(&[Vec2::NAN, Vec2::ONE], 1.0, [255; 3]);
        picture.line(&[Vec2::splat(f32::MAX), Vec2::splat(f32::MIN)], 1.0, [255; 3]);
        picture.line(&[Vec2::splat(1e20), Vec2::splat(2e20)], 1.0, [255; 3]);
        assert_eq!(picture, Picture::new(20, 10, [0; 3]));
    }

    #[test]
    fn flat_and_smooth_pictures_are_packed_well() {
        let packed = |pixels: Vec<u8>| Picture { width: 400, height: 300, pixels }.to_png().unwrap().len();
        let at = |i: usize| (i % 400, i / 400);
        let swatches = [[10u8, 200, 30], [240, 20, 90], [0, 0, 0], [90, 90, 250]];
        let flat = (0..400 * 300).map(at).flat_map(|(x, y)| swatches[(x * x + 7 * y * y) / 999 % 4]).collect();
        let smooth = (0..400 * 300).map(at).flat_map(|(x, y)| [x / 2, y / 2, (x + y) / 3].map(|v| v as u8)).collect();
        // Out of 360000 bytes; the other filter takes at least half as much again.
        let (flat, smooth) = (packed(flat), packed(smooth));
        assert!(flat < 20_000 && smooth < 4_000, "{flat} {smooth}");
    }

    #[test]
    fn pasting_clips() {
        let mut picture = Picture::new(4, 4, [0; 3]);
        picture.paste(&Picture::new(4, 4, [9; 3]), 2, 3);
        assert_eq!(picture.pixels.iter().filter(|&&byte| byte == 9).count(), 2 * 3);
        assert_eq!(picture.pixel(3, 3), [9; 3]);
        picture.paste(&Picture::new(4, 4, [7; 3]), 4, 0);
        assert!(!picture.pixels.contains(&7));
    }
}
