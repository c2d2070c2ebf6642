//! Pixels of PNG and JPEG files.

use png::{BitDepth, ColorType, DecodingError, Transformations};
use std::io::{Cursor, ErrorKind};
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Why an image cannot be decoded, without the decoder's wording.
pub(super) type Fault = &'static str;

const DAMAGED: Fault = "it is damaged";
const CUT_OFF: Fault = "it is cut off";
const UNSUPPORTED: Fault = "it is of a kind that is not supported";

/// An image whose header has been read.
pub(super) struct ImageHeader<'a> {
    pub width: u32,
    pub height: u32,
    /// Numbers per pixel, 1 to 4: grey or colours, and alpha.
    pub channels: usize,
    /// Bytes per number, 1 or 2, most significant first.
    pub depth: usize,
    rest: PixelDecoder<'a>,
}

enum PixelDecoder<'a> {
    Png(Box<png::Reader<Cursor<&'a [u8]>>>),
    Jpeg(Box<JpegDecoder<ZCursor<&'a [u8]>>>),
}

impl<'a> ImageHeader<'a> {
    /// Reads the header of the file `bytes`; `None`: it is neither PNG nor JPEG. A PNG may use `aside` bytes for its
    /// other contents.
    pub fn read(bytes: &'a [u8], aside: u64) -> Option<Result<ImageHeader<'a>, Fault>> {
        if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            Some(ImageHeader::of_png(bytes, aside))
        } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
            Some(ImageHeader::of_jpeg(bytes))
        } else {
            None
        }
    }

    fn of_png(bytes: &'a [u8], aside: u64) -> Result<ImageHeader<'a>, Fault> {
        let limits = png::Limits { bytes: usize::try_from(aside).unwrap_or(usize::MAX) };
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
        // Expands palettes, low bit depths and transparent colours to plain numbers.
        decoder.set_transformations(Transformations::EXPAND);
        let reader = decoder.read_info().map_err(|error| of_png(&error))?;
        let (width, height) = reader.info().size();
        let (color, bits) = reader.output_color_type();
        let channels = match color {
            ColorType::Grayscale => 1,
            ColorType::GrayscaleAlpha => 2,
            ColorType::Rgb => 3,
            ColorType::Rgba => 4,
            ColorType::Indexed => return Err(UNSUPPORTED),
        };
        let depth = match bits {
            BitDepth::Eight => 1,
            BitDepth::Sixteen => 2,
            _ => return Err(UNSUPPORTED),
        };
        Ok(ImageHeader { width, height, channels, depth, rest: PixelDecoder::Png(Box::new(reader)) })
    }

    fn of_jpeg(bytes: &'a [u8]) -> Result<ImageHeader<'a>, Fault> {
        // The caller checks the dimensions.
        let options =
            DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
        decoder.decode_headers().map_err(|error| of_jpeg(&error))?;
        let ((width, height), Some(color)) = (decoder.dimensions().unwrap_or_default(), decoder.input_colorspace())
        else {
            return Err(DAMAGED);
        };
        let (color, channels) = if color == ColorSpace::Luma { (color, 1) } else { (ColorSpace::RGB, 3) };
        decoder.set_options(options.jpeg_set_out_colorspace(color));
        // A side fits in two bytes.
        let (width, height) = (width as u32, height as u32);
        Ok(ImageHeader { width, height, channels, depth: 1, rest: PixelDecoder::Jpeg(Box::new(decoder)) })
    }

    /// Bytes of all pixels.
    pub fn size(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height) * (self.channels * self.depth) as u64
    }

    /// Decodes the pixels, row by row from the top, into `to`, which is [`ImageHeader::size`] long.
    pub fn decode(self, to: &mut [u8]) -> Result<(), Fault> {
        match self.rest {
            PixelDecoder::Png(mut reader) => reader.next_frame(to).map(drop).map_err(|error| of_png(&error)),
            PixelDecoder::Jpeg(mut decoder) => decoder.decode_into(to).map_err(|error| of_jpeg(&error)),
        }
    }
}

fn of_png(error: &DecodingError) -> Fault {
    match error {
        DecodingError::LimitsExceeded => "it needs too much memory",
        DecodingError::IoError(source) if source.kind() == ErrorKind::UnexpectedEof => CUT_OFF,
        _ => DAMAGED,
    }
}

fn of_jpeg(error: &DecodeErrors) -> Fault {
    match error {
        DecodeErrors::Unsupported(_) => UNSUPPORTED,
        DecodeErrors::ExhaustedData => CUT_OFF,
        _ => DAMAGED,
    }
}
