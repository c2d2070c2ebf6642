//! Many pictures combined into one.

use super::canvas::{PAGE, Picture};
use png::Transformations;
use std::io::Cursor;

/// Number of pictures side by side.
const ACROSS: usize = 4;

/// The PNG pictures `files` combined into one, row by row; files that are not pictures are left out.
pub fn sheet<'f>(files: impl Iterator<Item = &'f Vec<u8>>) -> Picture {
    let pictures: Vec<Picture> = files.filter_map(|file| decoded(file)).collect();
    let width = pictures.iter().map(|picture| picture.width).max().unwrap_or(1);
    let rows: Vec<&[Picture]> = pictures.chunks(ACROSS).collect();
    let height = |row: &[Picture]| row.iter().map(|picture| picture.height).max().unwrap_or(0);
    let across = pictures.len().clamp(1, ACROSS) as u32;
    let mut sheet = Picture::new(width * across, rows.iter().map(|row| height(row)).sum::<u32>().max(1), PAGE);
    let mut top = 0;
    for row in rows {
        for (column, picture) in row.iter().enumerate() {
            sheet.paste(picture, width * column as u32, top);
        }
        top += height(row);
    }
    sheet
}

/// Decodes a PNG picture in RGB.
fn decoded(file: &[u8]) -> Option<Picture> {
    let mut decoder = png::Decoder::new(Cursor::new(file));
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().ok()?;
    let mut pixels = vec![0; reader.output_buffer_size()?];
    let info = reader.next_frame(&mut pixels).ok()?;
    (info.color_type == png::ColorType::Rgb).then_some(())?;
    pixels.truncate(info.buffer_size());
    Some(Picture { width: info.width, height: info.height, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_lie_in_rows() {
        let file = |width, height, color| Picture::new(width, height, color).to_png().unwrap();
        let files: Vec<Vec<u8>> = (0..6).map(|k| file(10, 5 + u32::from(k), [k * 40; 3])).collect();
        let all = sheet(files.iter());
        assert_eq!((all.width, all.height), (40, 8 + 10));
        for k in 0..6_u32 {
            assert_eq!(all.pixel(10 * (k % 4) + 1, 8 * (k / 4) + 1), [k as u8 * 40; 3]);
        }
        assert_eq!(all.pixel(35, 17), PAGE);
        let one = sheet([b"no picture".to_vec()].iter());
        assert_eq!((one.width, one.height), (1, 1));
    }
}
