//! Images for the tests of several formats.

/// A PNG of 1 x 2 pixels: red above, blue below.
pub(crate) fn red_above_blue() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 2);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&[255, 0, 0, 255, 0, 0, 255, 255]).unwrap();
    bytes
}
