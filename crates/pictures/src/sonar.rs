//! Pings of a sonar: waterfall, track and fan, with a scale of ranges.

use super::canvas::{Color, DIM, GROUND, Picture, TEXT};
use super::legend::{self, counted, round_down};
use super::paint::{LISTED, Legend, LegendEntry};
use super::palette::{self, HEIGHT, LEVEL, Ramp};
use super::points::{quantile, robust_span, wide};
use super::top::{length, scale_bar};
use super::{ColorBy, Page, PreviewOptions, View, font};
use cloud::cells::SonarView;
use cloud::image::{self, Image, ImageKind, ImageRange};
use cloud::{Field, Pings};
use engine::scene::NameTable;
use glam::{DVec2, Vec2};
use ground::error::{Error, Result};
use ground::math::{LOG2_PER_DB, exp2};
use ground::report::Report;
use std::collections::{BTreeMap, HashMap};

/// The flattest and the tallest panel, height over width.
pub(super) const FLATTEST: f32 = 0.25;
pub(super) const TALLEST: f32 = 0.68;

/// The content of a picture of `pings`, at least one: its name, notes, and the image.
pub(super) fn made(pings: &Pings, options: &PreviewOptions, page: &Page) -> Result<(String, Vec<String>, Image)> {
    let layout = pings.check()?;
    let view = layout.view;
    let count = counted(pings.pings.len(), "ping");
    Ok(match options.view {
        View::Waterfall => {
            let (range, words) = match options.ground {
                true => (ImageRange::Ground, "ground range, the last ping below"),
                false => (ImageRange::Slant, "slant range, the last ping below"),
            };
            let (image, beams) = (image::waterfall(pings, range, None)?, layout.beams());
            let name = match image::waterfall_beam(layout) {
                Some(beam) if beams > 1 => format!("Waterfall of {count}, beam {beam} of 0 to {}", beams - 1),
                _ => format!("Waterfall of {count}"),
            };
            (name, vec![words.to_owned()], image)
        }
        View::Fan => fan(pings, page)?,
        _ if matches!(view, SonarView::Swath | SonarView::Janus) => {
            let cell = image::fitting_depth_cell(pings, room(page))?;
            (format!("Depths of {count}"), vec![format!("cells of {cell:.2} m")], image::depth_map(pings, cell)?)
        }
        _ => {
            let (range, image) = image::fitting_mosaic(pings, room(page))?;
            let words = if range == ImageRange::Ground { "ground range" } else { "slant range" };
            (format!("Track of {count}"), vec![words.to_owned()], image)
        }
    })
}

/// The picture of `pings`, at least one.
pub(super) fn draw(pings: &Pings, options: &PreviewOptions, page: &Page, report: &mut Report) -> Result<Picture> {
    let (name, mut notes, image) = made(pings, options, page)?;
    let ink = Ink::new(&image, options.color, report)?;
    let panel = match image.kind {
        ImageKind::Waterfall => waterfall(&image, &ink, page),
        ImageKind::Fan => rings(&image, &ink, page),
        _ => track(&image, pings, &ink, page),
    };
    if image.kind != ImageKind::DepthMap && pings.pings[0].layout.tvg_db.iter().any(|gain| *gain != 0.0) {
        notes.push("levels with the sonar's time-varied gain".to_owned());
    }
    let title = format!("{name} by {}", ink.name);
    Ok(page.compose(&title, &notes.join("; "), &panel, &legend::draw(&ink.legend, page)))
}

/// Maximum size of a panel, pixels.
fn room(page: &Page) -> [u32; 2] {
    [page.inner(), (TALLEST * page.inner() as f32) as u32]
}

/// The fan of the last ping, or of all pings of a rotating beam.
fn fan(pings: &Pings, page: &Page) -> Result<(String, Vec<String>, Image)> {
    let last = &pings.pings[pings.pings.len() - 1];
    let make = |pixels| match last.layout.view {
        SonarView::Single => image::turning_fan(pings, pixels),
        _ => image::fan(last, pixels),
    };
    // A small one gives the aspect ratio.
    let small = make(64)?;
    let sides = [small.width, small.height].map(|side| side as f32);
    let fit = (room(page)[0] as f32 / sides[0]).min(room(page)[1] as f32 / sides[1]);
    let image = make((fit * sides[0].max(sides[1])) as usize)?;
    let name = match last.layout.view {
        SonarView::Single => format!("Fan of {}", counted(pings.pings.len(), "ping")),
        SonarView::Swath => format!("Water column of ping {}", last.number),
        _ => format!("Fan of ping {}", last.number),
    };
    Ok((name, vec![format!("to {}", length(last.layout.reach()))], image))
}

/// Colours of an image's pixels.
pub(super) struct Ink<'a> {
    name: &'static str,
    image: &'a Image,
    /// Label numbers, and the colours of those in the legend.
    labels: Option<(&'a [u32], HashMap<u32, Color>)>,
    table: Vec<Color>,
    window: [f32; 2],
    pub legend: Legend,
}

impl<'a> Ink<'a> {
    fn new(image: &'a Image, color: ColorBy, report: &mut Report) -> Result<Self> {
        let depths = image.kind == ImageKind::DepthMap;
        let values = if depths { ColorBy::Height } else { ColorBy::Intensity };
        match color {
            ColorBy::Label => {
                if let Some((name, ids, counts)) = labels(image) {
                    return Ok(Ink::labelled(image, name, ids, &counts));
                }
                let instead = if depths { "height" } else { "intensity" };
                report.warn(format!(
                    "preview: the pings have no column category_id or part_id; coloured by {instead} instead"
                ));
            }
            color if color == values => {}
            _ => {
                let allowed = if depths { "label or height, for depths" } else { "label or intensity, for pings" };
                return Err(Error::invalid("preview colour", color.name(), allowed));
            }
        }
        let range = span(image);
        let [low, high] = range;
        let (name, ramp, caption): (_, Ramp, _) = match depths {
            true => ("height", HEIGHT, "height in m".to_owned()),
            false => ("level", LEVEL, format!("level in dB re 1 uPa, {low:.0} to {high:.0}")),
        };
        let (table, [low, high]) = (ramp.table(), range.map(f64::from));
        let legend = Legend::Scale { caption, table: table.clone(), low, high, beside: Vec::new() };
        Ok(Ink { name, image, labels: None, table, window: range, legend })
    }

    /// Of powers in dBm between two: those of a radar.
    pub fn of_powers(image: &'a Image, window: [f32; 2]) -> Self {
        let [low, high] = window.map(f64::from);
        let (table, caption) = (LEVEL.table(), format!("power in dBm, {low:.0} to {high:.0}"));
        let legend = Legend::Scale { caption, table: table.clone(), low, high, beside: Vec::new() };
        Ink { name: "power", image, labels: None, table, window, legend }
    }

    fn labelled(image: &'a Image, name: &'static str, ids: &'a [u32], counts: &BTreeMap<u32, usize>) -> Self {
        let mut frequent: Vec<(u32, usize)> = counts.iter().map(|(&id, &count)| (id, count)).collect();
        frequent.sort_by_key(|&(id, count)| (std::cmp::Reverse(count), id));
        let rest = if frequent.len() > LISTED + 1 { frequent.split_off(LISTED) } else { Vec::new() };
        let names: &NameTable = if name == "part" { &image.labels.part } else { &image.labels.category };
        let mut entries: Vec<LegendEntry> = frequent
            .iter()
            .map(|&(id, count)| {
                let known = names.name(id).map(str::to_owned);
                let name =
                    known.unwrap_or_else(|| if id == 0 { "unlabelled".to_owned() } else { format!("{name} {id}") });
                LegendEntry { name, color: palette::category(id), count }
            })
            .collect();
        if !rest.is_empty() {
            let count = rest.iter().map(|(_, count)| count).sum();
            entries.push(LegendEntry { name: format!("{} others", rest.len()), color: palette::OTHER, count });
        }
        let listed = frequent.iter().map(|&(id, _)| (id, palette::category(id))).collect();
        let window = span(image);
        Ink { name, image, labels: Some((ids, listed)), table: Vec::new(), window, legend: Legend::Names(entries) }
    }

    /// Colour of a picture pixel that shows these columns and rows of the image, without their ends: that of the mean
    /// power or mean height, and of the label of the strongest or highest pixel.
    fn color(&self, columns: [usize; 2], rows: [usize; 2]) -> Option<Color> {
        let heights = self.image.kind == ImageKind::DepthMap;
        let [low, high] = self.window;
        let (mut sum, mut count) = (0.0, 0);
        let (mut strongest, mut most) = (None, f32::NEG_INFINITY);
        let width = self.image.width;
        for row in rows[0]..rows[1] {
            for pixel in row * width + columns[0]..row * width + columns[1] {
                let value = self.image.values[pixel];
                if value.is_nan() {
                    continue;
                }
                // Outliers are clamped to the ends of the scale, so that no power overflows.
                sum += if heights { value.clamp(low, high) } else { exp2((value.min(high) - high) * LOG2_PER_DB) };
                count += 1;
                if strongest.is_none() || value > most {
                    (strongest, most) = (Some(pixel), value);
                }
            }
        }
        let strongest = strongest?;
        let mean = sum / count as f32;
        let mean = if heights { mean } else { high + mean.log2() / LOG2_PER_DB };
        let part = ((mean - low) / (high - low)).clamp(0.0, 1.0);
        let Some((ids, listed)) = &self.labels else {
            return Some(self.table[((part * 255.0).round() as usize).min(255)]);
        };
        let color = listed.get(&ids[strongest]).copied().unwrap_or(palette::OTHER);
        // Weak echoes are dark, so that shadows and shapes remain visible; deep ground is slightly darker, too.
        let dark = if heights { 0.4 } else { 0.7 };
        let light = 1.0 - dark * (1.0 - part);
        Some(std::array::from_fn(|i| {
            let ground = f32::from(GROUND[i]);
            (ground + light * (f32::from(color[i]) - ground)).round() as u8
        }))
    }

    /// Draws the image into the rectangle from `left`, `top`.
    pub fn fill(&self, picture: &mut Picture, [left, top]: [u32; 2], [width, height]: [u32; 2]) {
        let part = |at: u32, of: u32, length: usize| {
            let from = (u64::from(at) * length as u64 / u64::from(of)) as usize;
            let to = (u64::from(at + 1) * length as u64 / u64::from(of)) as usize;
            [from, to.max(from + 1)]
        };
        for y in 0..height {
            let rows = part(y, height, self.image.height);
            for x in 0..width {
                if let Some(color) = self.color(part(x, width, self.image.width), rows) {
                    picture.fill([left + x, top + y], [1, 1], color, 1.0);
                }
            }
        }
    }
}

/// How far below the median level a picture extends, dB: shadows and water are dark, the bed uses most of the scale.
const BELOW_MEDIAN: f32 = 30.0;

/// The span of values of an image's colours: without half a percent at each end.
fn span(image: &Image) -> [f32; 2] {
    let mut known: Vec<f32> = image.values.iter().copied().filter(|value| value.is_finite()).collect();
    if image.kind == ImageKind::DepthMap {
        return robust_span(&mut known, 0.005);
    }
    let [low, middle, high] = [0.005, 0.5, 0.995].map(|q| quantile(&mut known, q));
    wide([low.max(middle - BELOW_MEDIAN), high])
}

/// The labels by which an image is coloured, as for clouds: the category, or the part if there is only one category.
fn labels(image: &Image) -> Option<(&'static str, &[u32], BTreeMap<u32, usize>)> {
    let of = |name, field| {
        let ids = image.layer(field)?;
        let mut counts = BTreeMap::new();
        for (&id, _) in ids.iter().zip(&image.values).filter(|(_, value)| !value.is_nan()) {
            *counts.entry(id).or_default() += 1;
        }
        Some((name, ids, counts))
    };
    let kinds = |counts: &BTreeMap<u32, usize>| counts.keys().filter(|&&id| id != 0).count();
    let (category, part) = (of("category", Field::CategoryId), of("part", Field::PartId));
    match (category, part) {
        (Some(category), Some(part)) if kinds(&category.2) <= 1 && kinds(&part.2) > kinds(&category.2) => Some(part),
        (Some(found), _) | (None, Some(found)) => Some(found),
        (None, None) => None,
    }
}

/// The waterfall at full width, with lines of equal range.
fn waterfall(image: &Image, ink: &Ink, page: &Page) -> Picture {
    let width = page.inner();
    let rows = (image.height as f32).clamp(FLATTEST * width as f32, TALLEST * width as f32);
    let mut picture = Picture::new(width, rows as u32, GROUND);
    let size = [picture.width, picture.height];
    ink.fill(&mut picture, [0, 0], size);
    let (left, step) = (image.place.first[0] - 0.5 * image.place.step[0], image.place.step[0]);
    let right = left + image.width as f64 * step;
    let unit = round_down(right.max(-left) / 3.0);
    let capitals = page.text();
    for i in (left / unit).ceil() as i32..=(right / unit).floor() as i32 {
        let x = ((f64::from(i) * unit - left) / (right - left) * f64::from(width)) as f32;
        if x < 1.0 || x + 1.0 > width as f32 {
            continue;
        }
        let thickness = page.px(1.0);
        picture.fill([x as u32, 0], [thickness, size[1]], TEXT, if i == 0 { 0.45 } else { 0.25 });
        let words = length(f64::from(i.abs()) * unit);
        let start = x + 0.5 * capitals;
        if i != 0 && start + font::width(&words, capitals) < width as f32 {
            picture.text_over(&words, Vec2::new(start, 1.8 * capitals), capitals, TEXT);
        }
    }
    if left < 0.0 {
        let baseline = size[1] as f32 - capitals;
        picture.text_over("port", Vec2::new(capitals, baseline), capitals, DIM);
        let start = width as f32 - font::width("starboard", capitals) - capitals;
        picture.text_over("starboard", Vec2::new(start, baseline), capitals, DIM);
    }
    picture
}

/// A dark panel with the image as large as possible, and the image's top left corner and pixels per column in it.
fn fitted(image: &Image, ink: &Ink, page: &Page) -> (Picture, Vec2, f32) {
    let [width, tallest] = room(page);
    let sides = [image.width, image.height].map(|side| side as f32);
    let zoom = (width as f32 / sides[0]).min(tallest as f32 / sides[1]);
    let size = sides.map(|side| ((zoom * side).round() as u32).max(1));
    let height = size[1].max((FLATTEST * width as f32) as u32);
    let mut picture = Picture::new(width, height, GROUND);
    let corner = [(width.saturating_sub(size[0])) / 2, (height - size[1]) / 2];
    ink.fill(&mut picture, corner, size);
    (picture, Vec2::new(corner[0] as f32, corner[1] as f32), zoom)
}

/// The fan with rings of equal range.
pub(super) fn rings(image: &Image, ink: &Ink, page: &Page) -> Picture {
    let (mut picture, corner, zoom) = fitted(image, ink, page);
    let metres = image.place.step[0] / f64::from(zoom);
    // From the top left corner of the panel to the sonar, pixels.
    let pixels = |at: DVec2| {
        let [x, y] = [0, 1].map(|axis| ((at[axis] - image.place.first[axis]) / image.place.step[axis] + 0.5) as f32);
        corner + zoom * Vec2::new(x, y)
    };
    let sonar = pixels(DVec2::ZERO);
    let shown = |at: DVec2| image.index(at.into()).is_some_and(|pixel| !image.values[pixel].is_nan());
    let reach = (0..image.width * image.height)
        .filter(|&pixel| !image.values[pixel].is_nan())
        .map(|pixel| DVec2::from(image.coordinates(pixel % image.width, pixel / image.width)).length())
        .fold(0.0, f64::max);
    let unit = round_down(reach.max(metres) / 3.0);
    for y in 0..picture.height {
        for x in 0..picture.width {
            let away = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - sonar;
            let range = f64::from(away.length()) * metres;
            let ring = (range / unit).round().max(1.0) * unit;
            let cover = 0.5 + 0.5 * page.scale - ((range - ring) / metres).abs() as f32;
            if cover > 0.0 && shown(DVec2::new(f64::from(away.x), -f64::from(away.y)) * metres) {
                picture.fill([x, y], [1, 1], TEXT, 0.3 * cover.min(1.0));
            }
        }
    }
    let capitals = page.text();
    for i in 1..=(reach / unit) as u32 {
        let range = f64::from(i) * unit;
        let directions = [DVec2::Y, DVec2::NEG_Y, DVec2::X, DVec2::NEG_X];
        if let Some(at) = directions.map(|direction| range * direction).into_iter().find(|&at| shown(at)) {
            let words = length(range);
            picture.text_over(&words, pixels(at) + Vec2::new(0.6, -0.6) * capitals, capitals, TEXT);
        }
    }
    picture
}

/// The map with the sonar's track and a scale.
fn track(image: &Image, pings: &Pings, ink: &Ink, page: &Page) -> Picture {
    let (mut picture, corner, zoom) = fitted(image, ink, page);
    let pixels = |at: DVec2| {
        let [x, y] = [0, 1].map(|axis| ((at[axis] - image.place.first[axis]) / image.place.step[axis] + 0.5) as f32);
        corner + zoom * Vec2::new(x, y)
    };
    let way: Vec<Vec2> = pings.pings.iter().map(|ping| pixels(ping.pose.position.truncate())).collect();
    for (radius, color) in [(1.4, GROUND), (0.6, TEXT)] {
        let mut from = way[0];
        for &to in &way {
            // Pings closer together than that are joined in one step.
            if from.distance(to) >= 4.0 {
                picture.stroke(&[[from, to]], radius * page.scale, color, 0.8);
                from = to;
            }
        }
    }
    let ahead = image::heading(&pings.pings[way.len() - 1].pose).as_vec2();
    let last = way[way.len() - 1];
    picture.sensor_mark(last, last + Vec2::new(ahead.x, -ahead.y), 6.0 * page.scale);
    let metres = image.place.step[0] / f64::from(zoom);
    let unit = round_down(f64::from(picture.width) * metres / 6.0);
    scale_bar(&mut picture, (1.0 / metres) as f32, unit, page);
    picture
}

#[cfg(test)]
mod tests {
    use super::super::render_pings;
    use super::*;
    use crate::synthetic::{self, SyntheticSidescan, TARGET};

    fn render(pings: &Pings, view: View, color: ColorBy) -> Picture {
        let options = PreviewOptions { view, color, width: 800, ..PreviewOptions::default() };
        let mut report = Report::default();
        let picture = render_pings(pings, &options, &mut report).unwrap();
        assert_eq!(report.warnings, Vec::<String>::new());
        picture
    }

    fn count(picture: &Picture, is: impl Fn(Color) -> bool) -> usize {
        let page = Page::new(picture.width);
        (page.panel_top()..picture.height - 60)
            .flat_map(|y| (0..picture.width).map(move |x| (x, y)))
            .filter(|&(x, y)| is(picture.pixel(x, y)))
            .count()
    }

    #[test]
    fn a_target_has_its_colour_in_every_view() {
        let side = synthetic::pings(&SyntheticSidescan::default());
        let ahead = Pings { pings: vec![synthetic::imaging(SonarView::Fan, 20.0, 12.0)] };
        let down = Pings { pings: vec![synthetic::imaging(SonarView::Swath, 20.0, 12.0)] };
        let round = synthetic::turning(200, 1.8);
        let views = [(&side, View::Waterfall), (&side, View::Track), (&ahead, View::Fan), (&down, View::Fan)];
        let more = [(&round, View::Fan), (&round, View::Track), (&ahead, View::Track), (&down, View::Waterfall)];
        for (pings, view) in views.into_iter().chain(more) {
            let expected = palette::category(TARGET);
            // The target is strongest, so it is not darkened.
            let found = count(&render(pings, view, ColorBy::Label), |color| color == expected);
            assert!(found > 5 || pings.pings.len() == 1 && view == View::Waterfall, "{view:?}: {found}");
            render(pings, view, ColorBy::Intensity);
        }
        let swath = synthetic::swath(60);
        let picture = render(&swath, View::Track, ColorBy::Height);
        let (top, low) = (HEIGHT.color(1.0), HEIGHT.color(0.0));
        assert!(count(&picture, |color| color == top) > 100 && count(&picture, |color| color == low) > 1000);
    }

    #[test]
    fn pixels_show_the_mean_power_and_the_label_of_the_strongest() {
        let mut image =
            image::waterfall(&synthetic::pings(&SyntheticSidescan::default()), ImageRange::Slant, None).unwrap();
        (image.width, image.height) = (4, 2);
        // By hand: nine tenths at 1e8 uPa^2 and one tenth at 1e10 would be 90.4 dB; here it is seven eighths and one
        // eighth.
        image.values = [80.0, 80.0, 80.0, 80.0, 80.0, 100.0, 80.0, 80.0].to_vec();
        image.layers.truncate(1);
        image.layers[0].ids = vec![1, 1, 1, 1, 1, 2, 1, 1];
        let ink = |color| Ink { window: [70.0, 110.0], ..Ink::new(&image, color, &mut Report::default()).unwrap() };
        let mean = 10.0 * ((7.0 * 1e8 + 1e10f32) / 8.0).log10();
        assert!((mean - 91.26).abs() < 0.01, "{mean}");
        let found = ink(ColorBy::Intensity).color([0, 4], [0, 2]);
        assert_eq!(found, Some(LEVEL.table()[((mean - 70.0) / 40.0 * 255.0).round() as usize]));
        assert_eq!(ink(ColorBy::Intensity).color([0, 1], [0, 1]), Some(LEVEL.table()[64]));
        // The second category, as bright as the mean.
        let light = 1.0 - 0.7 * (1.0 - (mean - 70.0) / 40.0);
        let expected: Color = std::array::from_fn(|i| {
            let ground = f32::from(GROUND[i]);
            (ground + light * (f32::from(palette::category(2)[i]) - ground)).round() as u8
        });
        assert_eq!(ink(ColorBy::Label).color([0, 4], [0, 2]), Some(expected));
    }

    #[test]
    fn waterfalls_of_many_beams_name_the_beam() {
        let name = |pings: &Pings| {
            let options = PreviewOptions { view: View::Waterfall, ..PreviewOptions::default() };
            made(pings, &options, &Page::new(800)).unwrap().0
        };
        assert_eq!(name(&synthetic::swath(3)), "Waterfall of 3 pings, beam 40 of 0 to 80");
        assert_eq!(name(&synthetic::turning(3, 1.8)), "Waterfall of 3 pings");
        assert_eq!(name(&synthetic::pings(&SyntheticSidescan::default())), "Waterfall of 101 pings");
    }

    #[test]
    fn views_and_colours_that_do_not_fit_are_rejected() {
        let side = synthetic::pings(&SyntheticSidescan::default());
        let error = |pings: &Pings, view, color| {
            let options = PreviewOptions { view, color, ..PreviewOptions::default() };
            render_pings(pings, &options, &mut Report::default()).unwrap_err().to_string()
        };
        let found = error(&side, View::Top, ColorBy::Label);
        assert_eq!(found, "view is top; allowed: waterfall, track or fan for pings; it shows points");
        let found = error(&side, View::Waterfall, ColorBy::Cause);
        assert_eq!(found, "preview colour is cause; allowed: label or intensity, for pings");
        assert!(error(&synthetic::swath(3), View::Track, ColorBy::Intensity).contains("label or height"));
        assert!(error(&side, View::Fan, ColorBy::Label).contains("requested for a sidescan sonar"));
        let mut none = side.clone();
        for ping in &mut none.pings {
            ping.fields = ping.fields.without(Field::CategoryId);
        }
        let mut report = Report::default();
        let options = PreviewOptions { view: View::Track, ..PreviewOptions::default() };
        render_pings(&none, &options, &mut report).unwrap();
        assert_eq!(report.warnings.len(), 1, "{report:?}");
    }

    #[test]
    fn strange_pings_give_pictures() {
        let mut strange = vec![Pings::default()];
        for level in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX] {
            let mut pings = synthetic::pings(&SyntheticSidescan { pings: 3, ..SyntheticSidescan::default() });
            pings.pings.iter_mut().for_each(|ping| ping.cells.intensity.fill(level));
            strange.push(pings);
        }
        strange.push(synthetic::pings(&SyntheticSidescan { pings: 1, ..SyntheticSidescan::default() }));
        strange.push(synthetic::pings(&SyntheticSidescan { start: DVec2::splat(1e9), ..SyntheticSidescan::default() }));
        for pings in &strange {
            for view in [View::Waterfall, View::Track] {
                for color in [ColorBy::Label, ColorBy::Intensity] {
                    let options = PreviewOptions { view, color, width: 320, ..PreviewOptions::default() };
                    let picture = render_pings(pings, &options, &mut Report::default()).unwrap();
                    assert!(picture.height < 600);
                }
            }
        }
    }
}
