//! The strip below the picture that explains its colours.

use super::canvas::{Color, DIM, PAGE, Picture, TEXT};
use super::paint::{Legend, LegendEntry};
use super::{Page, font};
use glam::Vec2;

/// Longest name that a legend shows, characters.
const LONGEST: usize = 32;
/// Margin to the left of text, so that the pen is not cut off, pixels.
const INSET: f32 = 2.0;

/// The legend as a picture as wide as the page's inner width.
pub(super) fn draw(legend: &Legend, page: &Page) -> Picture {
    match legend {
        Legend::Names(entries) => names(entries, page),
        Legend::Scale { caption, table, low, high, beside } => {
            let bar = scale(caption, table, [*low, *high], page);
            if beside.is_empty() {
                return bar;
            }
            let (names, top) = (names(beside, page), bar.height + page.px(8.0));
            let mut both = Picture::new(page.inner(), top + names.height, PAGE);
            both.paste(&bar, 0, 0);
            both.paste(&names, 0, top);
            both
        }
    }
}

/// Swatches, names and counts, row by row in equally wide columns.
fn names(entries: &[LegendEntry], page: &Page) -> Picture {
    let (capitals, gap) = (page.text(), page.text());
    let swatch = 1.3 * capitals;
    let labels: Vec<(String, String)> =
        entries.iter().map(|entry| (shortened(&entry.name), thousands(entry.count))).collect();
    let widest = |of: &dyn Fn(&(String, String)) -> &String| {
        labels.iter().map(|label| font::width(of(label), capitals)).fold(0.0, f32::max)
    };
    let (name_width, count_width) = (widest(&|label| &label.0), widest(&|label| &label.1));
    let entry_width = swatch + gap + name_width + gap + count_width;
    let columns = (((page.inner() as f32 + 3.0 * gap) / (entry_width + 3.0 * gap)) as usize).min(labels.len()).max(1);
    let row_height = (2.1 * capitals).ceil();
    let rows = labels.len().div_ceil(columns);
    let mut picture = Picture::new(page.inner(), (rows as f32 * row_height) as u32, PAGE);
    for (index, (entry, (name, count))) in entries.iter().zip(&labels).enumerate() {
        let left = INSET + (index % columns) as f32 * (entry_width + 3.0 * gap);
        let baseline = (index / columns) as f32 * row_height + 1.5 * capitals;
        let middle = baseline - capitals / 2.0;
        let ends = [Vec2::new(left + 0.35 * swatch, middle), Vec2::new(left + 0.75 * swatch, middle)];
        picture.stroke(&[ends], 0.35 * swatch, entry.color, 1.0);
        picture.text(name, Vec2::new(left + swatch + gap, baseline), capitals, TEXT);
        let right = left + entry_width - font::width(count, capitals);
        picture.text(count, Vec2::new(right, baseline), capitals, DIM);
    }
    picture
}

/// A bar of colours with ticks at round values.
fn scale(caption: &str, table: &[Color], [low, high]: [f64; 2], page: &Page) -> Picture {
    let capitals = page.text();
    let (bar_top, bar_height) = (page.px(4.0), page.px(14.0));
    let tick_baseline = (bar_top + bar_height) as f32 + 2.0 * capitals;
    let mut picture = Picture::new(page.inner(), (tick_baseline + 0.5 * capitals).ceil() as u32, PAGE);
    let caption_baseline = bar_top as f32 + (bar_height as f32 + capitals) / 2.0;
    picture.text(caption, Vec2::new(INSET, caption_baseline), capitals, TEXT);
    let left = (INSET + font::width(caption, capitals) + 2.0 * capitals).ceil() as u32;
    let width = page.px(720.0).min(page.inner().saturating_sub(left + 2 * capitals as u32)).max(2);
    for x in 0..width {
        let color = table[(x as usize * (table.len() - 1) + width as usize / 2 - 1) / (width as usize - 1)];
        picture.fill([left + x, bar_top], [1, bar_height], color, 1.0);
    }
    for (value, words) in ticks(low, high) {
        let x = left as f32 + ((value - low) / (high - low)) as f32 * (width - 1) as f32 + 0.5;
        let bottom = (bar_top + bar_height) as f32;
        let line = [Vec2::new(x, bottom), Vec2::new(x, bottom + 0.4 * capitals)];
        picture.stroke(&[line], 0.5 * page.scale, DIM, 1.0);
        let start = x - font::width(&words, capitals) / 2.0;
        picture.text(&words, Vec2::new(start, tick_baseline), capitals, TEXT);
    }
    picture
}

/// About six round values from `low` to `high`, with their text.
fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let step = round_down((high - low) / 4.0);
    let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    let first = (low / step).ceil();
    // Counting, rather than adding up, terminates even if the step is lost against the value.
    (0..=10)
        .map(|i| (first + f64::from(i)) * step)
        .filter(|value| (low..=high).contains(value))
        // Adding zero turns -0 into 0.
        .map(|value| {
            (value, if value.abs() < 1e7 { format!("{:.decimals$}", value + 0.0) } else { format!("{value:.3e}") })
        })
        .collect()
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `value`, a positive number.
pub(super) fn round_down(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0].map(|digit| digit * power).into_iter().find(|&round| round <= value).unwrap_or(power)
}

/// `1,234,567`.
pub fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let mut words = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            words.push(',');
        }
        words.push(digit);
    }
    words
}

/// `1 point`, `2,000 points`.
pub(super) fn counted(number: usize, thing: &str) -> String {
    format!("{} {thing}{}", thousands(number), if number == 1 { "" } else { "s" })
}

fn shortened(name: &str) -> String {
    if name.chars().count() <= LONGEST {
        return name.to_owned();
    }
    format!("{}...", name.chars().take(LONGEST - 3).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::super::palette;
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let words = |low, high| ticks(low, high).into_iter().map(|(_, words)| words).collect::<Vec<_>>();
        assert_eq!(words(0.03, 1.02), ["0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(words(-3.0, 11.0), ["-2", "0", "2", "4", "6", "8", "10"]);
        assert_eq!(
            words(299.99, 300.02),
            ["299.990", "299.995", "300.000", "300.005", "300.010", "300.015", "300.020"]
        );
        assert_eq!(words(0.0, 255.0), ["0", "50", "100", "150", "200", "250"]);
        assert!(!words(0.0, 1e30).is_empty());
        // No resolution left between the ends: no hang, no panic.
        assert!(words(1e15, 1e15 + 0.125).len() <= 11);
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!(counted(1, "point"), "1 point");
        assert_eq!(counted(159_488, "point"), "159,488 points");
        assert_eq!(
            (thousands(0), thousands(999), thousands(1_000_000)),
            ("0".into(), "999".into(), "1,000,000".into())
        );
        assert_eq!((round_down(7.3), round_down(0.21), round_down(1000.0)), (5.0, 0.2, 1000.0));
        assert_eq!(shortened(&"x".repeat(40)).len(), LONGEST);
    }

    /// Every name puts its swatch and its letters into the picture.
    #[test]
    fn names_are_drawn_with_their_colours() {
        let page = Page::new(1600);
        let entry = |id: u32| LegendEntry { name: format!("name {id}"), color: palette::category(id), count: 10 };
        let entries: Vec<LegendEntry> = (0..17).map(entry).collect();
        let picture = draw(&Legend::Names(entries.clone()), &page);
        let lit = |picture: &Picture, color| {
            (0..picture.height)
                .flat_map(|y| (0..picture.width).map(move |x| (x, y)))
                .filter(|&(x, y)| picture.pixel(x, y) == color)
                .count()
        };
        for entry in &entries {
            assert!(lit(&picture, entry.color) > 50, "{entry:?}");
        }
        let fewer = draw(&Legend::Names(entries[..16].to_vec()), &page);
        assert!(lit(&picture, TEXT) > lit(&fewer, TEXT));
        let long = LegendEntry { name: "w".repeat(500), color: [0; 3], count: usize::MAX };
        assert_eq!(draw(&Legend::Names(vec![long]), &Page::new(320)).width, Page::new(320).inner());
    }
}
