//! A picture of a cloud for people: from above, in perspective or as range image, coloured by label,
//! intensity, range or height, with a legend.

mod canvas;
mod cutaway;
mod font;
mod legend;
mod paint;
mod palette;
mod perspective;
mod points;
mod range_image;
mod splat;
mod top;

pub use canvas::Picture;

use super::atomic;
use crate::cloud::PointCloud;
use crate::error::{Error, Result};
use crate::report::Report;
use canvas::{DIM, PAGE, TEXT};
use glam::Vec2;
use paint::Paint;
use points::Points;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::str::FromStr;

/// Widths that a picture may have, pixels.
const WIDTHS: std::ops::RangeInclusive<u32> = 320..=4096;

/// From where a preview looks at the cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum View {
    /// Straight down without perspective: +x to the right, +y up.
    #[default]
    Top,
    /// From behind and above the sensor, along its heading.
    Perspective,
    /// As the sensor sees it: rows and columns of the sensor, or azimuth and elevation.
    Range,
}

impl FromStr for View {
    type Err = Error;

    fn from_str(name: &str) -> Result<View> {
        by_name("view", name, &[("top", View::Top), ("perspective", View::Perspective), ("range", View::Range)])
    }
}

/// What the colours of a preview show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorBy {
    /// Category, or part when there is only one category.
    #[default]
    Label,
    /// Intensity that the instrument reports.
    Intensity,
    /// Slant range.
    Range,
    /// Height, z.
    Height,
}

impl FromStr for ColorBy {
    type Err = Error;

    fn from_str(name: &str) -> Result<ColorBy> {
        by_name(
            "preview colour",
            name,
            &[
                ("label", ColorBy::Label),
                ("intensity", ColorBy::Intensity),
                ("range", ColorBy::Range),
                ("height", ColorBy::Height),
            ],
        )
    }
}

/// The value that `name` has in `table`, or an error that tells the near names and all there are.
fn by_name<T: Copy>(what: &'static str, name: &str, table: &[(&str, T)]) -> Result<T> {
    if let Some((_, value)) = table.iter().find(|(known, _)| *known == name) {
        return Ok(*value);
    }
    // There are so few names that all of them may stand in the message, the near ones first.
    let mut names = crate::error::nearest(name, table.iter().map(|(known, _)| known));
    for (known, _) in table {
        if !names.iter().any(|near| near == known) {
            names.push((*known).to_owned());
        }
    }
    Err(Error::Missing { what, name: name.to_owned(), near: names })
}

/// How a preview looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviewOptions {
    /// From where; default top.
    pub view: View,
    /// What the colours show; default label.
    pub color: ColorBy,
    /// Width of the picture in pixels, 320 to 4096, default 1600; the height follows the content.
    pub width: u32,
}

impl Default for PreviewOptions {
    fn default() -> Self {
        PreviewOptions { view: View::default(), color: ColorBy::default(), width: 1600 }
    }
}

/// Writes a picture of `cloud` to the PNG file `path`, which appears only when it is complete.
///
/// Columns that the colours need and the cloud lacks are replaced by others, which the report says.
///
/// # Errors
/// A width out of bounds, a folder that cannot be written, a full disk.
pub fn write(cloud: &PointCloud, path: &Path, options: &PreviewOptions) -> Result<Report> {
    let mut report = Report::default();
    let picture = render(cloud, options, &mut report)?;
    atomic::replace(path, |temporary| {
        let file = File::create(temporary).map_err(|source| Error::io(path, source))?;
        picture.write_png(BufWriter::new(file)).map_err(|source| Error::io(path, source))
    })?;
    Ok(report)
}

/// The picture of `cloud`; the same cloud and options give the same pixels.
///
/// A cloud without points gives a picture that says so.
///
/// # Errors
/// A width out of bounds.
pub fn render(cloud: &PointCloud, options: &PreviewOptions, report: &mut Report) -> Result<Picture> {
    if !WIDTHS.contains(&options.width) {
        let allowed = format!("{} to {} pixels", WIDTHS.start(), WIDTHS.end());
        return Err(Error::invalid("preview width", options.width, allowed));
    }
    let page = Page::new(options.width);
    let points = Points::new(cloud, report);
    if points.count == 0 {
        return Ok(page.without_points());
    }
    let paint = Paint::new(cloud, &points, options.color, report);
    let mut notes = Vec::new();
    let (view, panel) = match options.view {
        View::Top => ("Top view", top::draw(&points, &paint, &page, &mut notes)),
        View::Perspective => ("Perspective", perspective::draw(&points, &paint, &page, &mut notes)),
        View::Range => ("Range image", range_image::draw(cloud, &points, &paint, &page)),
    };
    let title = format!("{view} of {} by {}", legend::counted(points.count, "point"), paint.name());
    Ok(page.compose(&title, &notes.join("; "), &panel, &legend::draw(paint.legend(), &page)))
}

/// Sizes that grow with the width of the picture.
struct Page {
    width: u32,
    /// Pixels per design pixel of a picture 1600 wide; small pictures keep readable text.
    scale: f32,
}

impl Page {
    fn new(width: u32) -> Page {
        Page { width, scale: (width as f32 / 1600.0).max(0.7) }
    }

    /// `design` pixels of a picture 1600 wide, in pixels of this one.
    fn px(&self, design: f32) -> u32 {
        (design * self.scale).round().max(1.0) as u32
    }

    /// Height of capital letters in small text, pixels.
    fn text(&self) -> f32 {
        11.0 * self.scale
    }

    fn margin(&self) -> u32 {
        self.px(28.0)
    }

    /// Between title, panel and legend.
    fn gap(&self) -> u32 {
        self.px(20.0)
    }

    /// Height of capital letters in the title, pixels.
    fn title(&self) -> f32 {
        16.0 * self.scale
    }

    /// Rows above the panel.
    fn panel_top(&self) -> u32 {
        self.margin() + self.title().ceil() as u32 + self.gap()
    }

    /// Width between the margins, pixels.
    fn inner(&self) -> u32 {
        self.width - 2 * self.margin()
    }

    /// Title and notes above the panel, legend below it.
    fn compose(&self, title: &str, notes: &str, panel: &Picture, legend: &Picture) -> Picture {
        let (margin, gap, capitals) = (self.margin(), self.gap(), self.title());
        let legend_top = self.panel_top() + panel.height + gap;
        let mut page = Picture::new(self.width, legend_top + legend.height + margin, PAGE);
        let baseline = margin as f32 + capitals;
        let (left, right) = (margin as f32, (self.width - margin) as f32);
        page.text(title, Vec2::new(left, baseline), capitals, TEXT);
        let room = right - left - font::width(title, capitals) - gap as f32;
        let notes_width = font::width(notes, self.text());
        if notes_width <= room {
            page.text(notes, Vec2::new(right - notes_width, baseline), self.text(), DIM);
        }
        page.paste(panel, margin + (self.inner() - panel.width) / 2, self.panel_top());
        page.paste(legend, margin, legend_top);
        page
    }

    fn without_points(&self) -> Picture {
        let mut page = Picture::new(self.width, self.width / 4, PAGE);
        let (words, capitals) = ("no points", 24.0 * self.scale);
        let middle = Vec2::new(page.width as f32, page.height as f32) / 2.0;
        let start = middle + Vec2::new(-font::width(words, capitals), capitals) / 2.0;
        page.text(words, start, capitals, DIM);
        page
    }
}
