//! A stroke font for the text in pictures: each letter is a few pen strokes, so it is smooth at any size.

use glam::Vec2;

/// Radius of the pen, in heights of a capital letter.
pub(super) const RADIUS: f32 = 0.062;

/// Baseline and height of capitals in the grid of [`GLYPHS`].
const BASELINE: f32 = 4.0;
const CAPITALS: f32 = 14.0;
/// Space between two letters, and width of a blank, in grid units.
const SPACING: f32 = 4.0;
const BLANK: f32 = 3.0;

/// Strokes of the characters from `!` to `~`.
///
/// Strokes are separated by blanks. Each is a row of points, two base-36 digits per point: x to the right, y up with
/// descenders at 0, the baseline at 4, small letters up to 14 and capitals up to 18. A stroke runs straight from point
/// to point; one that begins with `~` is a quadratic B-spline with these control points, closed if the last point is
/// the first, with a corner where a point appears twice.
const GLYPHS: [&str; 94] = [
    "080i 0404",                        // !
    "0e0i 3e3i",                        // "
    "254h 658h 0cac 0898",              // #
    "~9e9g0g0b9b960608 5j53",           // $
    "~4i4e0e0i4i ~a8a46468a8 9i14",     // %
    "~a42f2i7i7d0a04749a",              // &
    "0e0i",                             // '
    "~3j0f0733",                        // (
    "~0j3f3703",                        // )
    "4i4c 1h7d 7h1d",                   // *
    "4d45 0989",                        // +
    "1402",                             // ,
    "0a6a",                             // -
    "0404",                             // .
    "026j",                             // /
    "~9i94040i9i",                      // 0
    "1f5i54",                           // 1
    "~0e0i9i9d0404 0494",               // 2
    "~0f0i8i8b3b ~3b9b940407",          // 3
    "747i0898",                         // 4
    "8i1i0b ~0b2d9d940406",             // 5
    "~8g8i0i0f08 ~9c94040c9c",          // 6
    "0i9i34",                           // 7
    "~8i8b1b1i8i ~9b94040b9b",          // 8
    "~9i9a0a0i9i ~9e97941416",          // 9
    "0404 0c0c",                        // :
    "1c1c 1402",                        // ;
    "7e0a76",                           // <
    "0c8c 0888",                        // =
    "0e7a06",                           // >
    "~0f0i7i7c3b38 3434",               // ?
    "~8d88484d8d ~8d8797c7ci0i04a4",    // @
    "045ia4 2989",                      // A
    "040i ~0i5i9i9b5b0b ~0b5baba45404", // B
    "~afai0i04a4a7",                    // C
    "040i ~0i4iaia44404",               // D
    "9i0i0494 0b7b",                    // E
    "9i0i04 0b7b",                      // F
    "~afai0i04a4aaaa5a",                // G
    "040i a4ai 0bab",                   // H
    "040i",                             // I
    "~7i740408",                        // J
    "040i 9i09 3ca4",                   // K
    "0i0494",                           // L
    "040i68cic4",                       // M
    "040ia4ai",                         // N
    "~aia4040iai",                      // O
    "040i ~0i5iaiaa5a0a",               // P
    "~aia4040iai 67b2",                 // Q
    "040i ~0i5iaiaa5a0a 5aa4",          // R
    "~9f9i0i0baba40407",                // S
    "0iai 5i54",                        // T
    "~0i0904a4a9ai",                    // U
    "0i54ai",                           // V
    "0i347ib4ei",                       // W
    "0ia4 ai04",                        // X
    "0i5bai 5b54",                      // Y
    "0iai04a4",                         // Z
    "3j0j0333",                         // [
    "0j62",                             // \
    "0j3j3303",                         // ]
    "0d3i6d",                           // ^
    "0383",                             // _
    "0i2g",                             // `
    "~8e84040e8e 848e",                 // a
    "040i ~8e84040e8e",                 // b
    "~8b8e0e048487",                    // c
    "848i ~8e84040e8e",                 // d
    "0989 ~898e0e048486",               // e
    "~6i2i2e24 0e5e",                   // f
    "~8e84040e8e ~8e82801011",          // g
    "040i ~0b0e8e8b84",                 // h
    "040e 0i0i",                        // i
    "~3e323000 3i3i",                   // j
    "040i 7e08 3b84",                   // k
    "~0i060434",                        // l
    "040e ~0b0e6e6b64 ~6b6ececbc4",     // m
    "040e ~0b0e8e8b84",                 // n
    "~8e84040e8e",                      // o
    "000e ~8e84040e8e",                 // p
    "808e ~8e84040e8e",                 // q
    "040e ~0a0e5e",                     // r
    "~7c7e0e0989840406",                // s
    "~2i272464 0e6e",                   // t
    "~0e07048487 8e84",                 // u
    "0e448e",                           // v
    "0e346e94ce",                       // w
    "0e84 8e04",                        // x
    "0e44 8e20",                        // y
    "0e8e0484",                         // z
    "~4j2j2c0b ~0b2a2343",              // {
    "030j",                             // |
    "~0j2j2c4b ~4b2a2303",              // }
    "~090c4c49898c",                    // ~
];

/// Line segments of one letter.
pub(super) type Glyph = Vec<[Vec2; 2]>;

/// The letters of `text` in place, y down: `start` is the left end of the baseline, `capitals` the height of a capital
/// letter.
///
/// Letters of western Europe lose their accents, other characters become `?`.
pub(super) fn set(text: &str, start: Vec2, capitals: f32) -> Vec<Glyph> {
    let unit = capitals / CAPITALS;
    let mut x = start.x;
    plain(text)
        .map(|letter| {
            let (mut glyph, advance) = glyph(letter);
            for point in glyph.iter_mut().flatten() {
                *point = Vec2::new(x + point.x * unit, start.y - (point.y - BASELINE) * unit);
            }
            x += advance * unit;
            glyph
        })
        .collect()
}

/// Width of `text` with capitals `capitals` high, without the space after the last letter.
pub(super) fn width(text: &str, capitals: f32) -> f32 {
    let advance: f32 = plain(text).map(|letter| glyph(letter).1).sum();
    (advance - SPACING).max(0.0) * capitals / CAPITALS
}

/// `text` in ASCII.
fn plain(text: &str) -> impl Iterator<Item = u8> {
    text.chars().flat_map(|letter| {
        let spelled = match letter {
            'ä' | 'æ' => "ae",
            'ö' | 'ø' | 'œ' => "oe",
            'ü' => "ue",
            'Ä' | 'Æ' => "Ae",
            'Ö' | 'Ø' => "Oe",
            'Ü' => "Ue",
            'ß' => "ss",
            'à' | 'á' | 'â' | 'ã' | 'å' => "a",
            'è' | 'é' | 'ê' | 'ë' => "e",
            'ì' | 'í' | 'î' | 'ï' => "i",
            'ò' | 'ó' | 'ô' | 'õ' => "o",
            'ù' | 'ú' | 'û' => "u",
            'ç' => "c",
            'ñ' => "n",
            'À' | 'Á' | 'Â' | 'Ã' | 'Å' => "A",
            'È' | 'É' | 'Ê' | 'Ë' => "E",
            'Ç' => "C",
            'Ñ' => "N",
            _ => "",
        };
        let other = spelled.is_empty().then(|| u8::try_from(letter).ok().filter(|c| (b' '..=b'~').contains(c)));
        spelled.bytes().chain(other.map(|ascii| ascii.unwrap_or(b'?')))
    })
}

/// Segments of a letter in grid units, y up, and the advance to the next one.
fn glyph(letter: u8) -> (Glyph, f32) {
    let Some(strokes) = usize::from(letter).checked_sub(usize::from(b'!')).and_then(|row| GLYPHS.get(row)) else {
        return (Glyph::new(), BLANK + SPACING);
    };
    let mut glyph = Glyph::new();
    for stroke in strokes.split(' ') {
        let line = match stroke.strip_prefix('~') {
            Some(controls) => spline(&points(controls)),
            None => points(stroke),
        };
        glyph.extend(line.windows(2).map(|pair| [pair[0], pair[1]]));
    }
    // Digits share one width, so that numbers in columns line up.
    let right = glyph.iter().flatten().map(|point| point.x).fold(0.0, f32::max);
    let right = if letter.is_ascii_digit() { 9.0 } else { right };
    (glyph, right + SPACING)
}

fn points(digits: &str) -> Vec<Vec2> {
    let value = |digit: u8| (digit as char).to_digit(36).unwrap_or(0) as f32;
    digits.as_bytes().chunks_exact(2).map(|pair| Vec2::new(value(pair[0]), value(pair[1]))).collect()
}

/// A quadratic B-spline as a polyline.
fn spline(controls: &[Vec2]) -> Vec<Vec2> {
    const STEPS: usize = 6;
    let (first, last) = (controls[0], controls[controls.len() - 1]);
    let mut controls = controls.to_vec();
    let closed = first == last;
    if closed {
        controls.push(controls[1]);
    }
    let mut line = if closed { Vec::new() } else { vec![first] };
    for corner in controls.windows(3) {
        let (start, end) = (corner[0].midpoint(corner[1]), corner[1].midpoint(corner[2]));
        line.extend((0..=STEPS).map(|step| {
            let t = step as f32 / STEPS as f32;
            start.lerp(corner[1], t).lerp(corner[1].lerp(end, t), t)
        }));
    }
    if closed {
        line.push(line[0]);
    } else {
        line.push(last);
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_glyph_is_well_formed_and_no_two_are_alike() {
        for (row, strokes) in GLYPHS.iter().enumerate() {
            for stroke in strokes.split(' ') {
                let digits = stroke.trim_start_matches('~');
                assert!(digits.len() >= 4 && digits.len() % 2 == 0, "glyph {row}: {stroke}");
                assert!(points(digits).iter().all(|p| p.x <= 14.0 && p.y <= 19.0), "glyph {row}: {stroke}");
            }
            let same: Vec<usize> = (0..GLYPHS.len()).filter(|&other| GLYPHS[other] == *strokes).collect();
            let alike = same.iter().map(|&row| (row as u8 + b'!') as char).collect::<String>();
            assert_eq!(alike.len(), 1, "{alike}");
        }
    }

    #[test]
    fn text_is_set_from_left_to_right_within_its_width() {
        let words = "Größe 12 µm";
        assert_eq!(String::from_utf8(plain(words).collect()).unwrap(), "Groesse 12 ?m");
        let glyphs = set(words, Vec2::new(100.0, 50.0), 14.0);
        assert_eq!(glyphs.len(), "Groesse 12 ?m".len());
        let right = glyphs.iter().flatten().flatten().map(|p| p.x).fold(0.0, f32::max);
        assert!((right - 100.0 - width(words, 14.0)).abs() < 1e-3);
        assert_eq!(width("", 14.0), 0.0);
        // Baseline and height of a capital.
        let (low, high) = set("H", Vec2::new(0.0, 50.0), 14.0)[0]
            .iter()
            .flatten()
            .fold((f32::INFINITY, 0f32), |(low, high), p| (low.min(p.y), high.max(p.y)));
        assert_eq!((low, high), (36.0, 50.0));
    }
}
