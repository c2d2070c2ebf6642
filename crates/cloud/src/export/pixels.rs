//! Pixels as PNG and TIFF.

use ground::write::Sink;
use std::io::{self, BufWriter};
use std::path::Path;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray32Float;
use tiff::tags::Tag;

/// Properties of a PNG. Samples of 16 bits are big-endian.
pub(super) struct Png<'p> {
    /// Columns and rows.
    pub size: [usize; 2],
    pub color: png::ColorType,
    pub depth: png::BitDepth,
    /// Red, green and blue of each value of an indexed image.
    pub palette: Option<&'p [u8]>,
    /// Keywords and texts.
    pub texts: Vec<(String, String)>,
    /// Whether it is compressed in a tenth of the time, to a larger file.
    pub fast: bool,
}

impl Png<'_> {
    /// Writes the file `path`.
    pub fn write(self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut to = BufWriter::new(Sink::create(path)?);
        let mut encoder = png::Encoder::new(&mut to, self.size[0] as u32, self.size[1] as u32);
        encoder.set_color(self.color);
        encoder.set_depth(self.depth);
        if let Some(palette) = self.palette {
            encoder.set_palette(palette);
        }
        if self.fast {
            // Pixels like those above become zeros, which fdeflate encodes as runs.
            encoder.set_deflate_compression(png::DeflateCompression::FdeflateUltraFast);
            encoder.set_filter(png::Filter::Up);
        }
        for (keyword, text) in self.texts {
            // Plain text chunks are Latin-1, label names may be any text.
            if text.is_ascii() {
                encoder.add_text_chunk(keyword, text)?;
            } else {
                encoder.add_itxt_chunk(keyword, text)?;
            }
        }
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()?;
        to.into_inner().map_err(io::IntoInnerError::into_error)?.finish()
    }
}

/// Writes `values`, row by row, to the TIFF `path`, with a `description`.
pub(super) fn write_tiff(
    path: &Path,
    [width, height]: [usize; 2],
    values: &[f32],
    description: &str,
) -> io::Result<()> {
    let mut to = BufWriter::new(Sink::create(path)?);
    let mut written = || {
        let mut encoder = TiffEncoder::new(&mut to)?;
        let mut image = encoder.new_image::<Gray32Float>(width as u32, height as u32)?;
        image.encoder().write_tag(Tag::ImageDescription, description)?;
        image.write_data(values)
    };
    let done: tiff::TiffResult<()> = written();
    done.map_err(io::Error::other)?;
    to.into_inner().map_err(io::IntoInnerError::into_error)?.finish()
}

/// Colours of the numbers 0 to 255 in masks, as in Pascal VOC: the bits of a number, three at a time from the lowest,
/// are bits of red, green and blue from the highest (VOCdevkit, VOClabelcolormap.m).
pub(super) fn palette() -> Vec<u8> {
    let color = |number: u8| {
        let mut color = [0; 3];
        for bit in 0..8 {
            color[bit % 3] |= (number >> bit & 1) << (7 - bit / 3);
        }
        color
    };
    (0..=255).flat_map(color).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_pascal_voc() {
        let palette = palette();
        let color = |number: usize| &palette[3 * number..3 * number + 3];
        // Aeroplane, person, train, TV monitor, void.
        assert_eq!(
            [color(0), color(1), color(15), color(19)],
            [[0, 0, 0], [128, 0, 0], [192, 128, 128], [128, 192, 0]]
        );
        assert_eq!([color(20), color(255)], [[0, 64, 128], [224, 224, 192]]);
    }
}
