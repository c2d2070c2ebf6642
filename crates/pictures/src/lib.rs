//! Pictures of a cloud: from above, in perspective or as range image, coloured by label, cause, intensity, range,
//! height or velocity, with a legend; of a sonar's pings: waterfall, track and fan; and of the images of a radar.
#![forbid(unsafe_code)]

mod boxes;
mod canvas;
mod cutaway;
mod density;
mod font;
mod legend;
mod paint;
mod palette;
mod perspective;
mod plan;
mod points;
mod radar;
mod range_image;
mod sheet;
mod sonar;
mod splat;
mod survey;
mod top;

pub use canvas::Picture;
pub use legend::thousands;
pub use sheet::sheet;

use ::survey::SurveyPlan;
use canvas::{DIM, PAGE, TEXT};
use cloud::image::Image;
use cloud::{Field, FieldSet, Pings, PointCloud, RadarFrame, VELOCITY};
use engine::scene::Scene;
use engine::trace::BuiltScene;
use glam::Vec2;
use ground::builder;
use ground::error::{Error, Result};
use ground::named;
use ground::named::by_name;
use ground::read::yaml;
use ground::report::Report;
use ground::shown;
use ground::write::{self, Pending, failed};
use paint::Paint;
use points::Points;
use serde::Deserialize;
use std::path::Path;
use std::str::FromStr;

/// Allowed widths of a picture, pixels.
const WIDTHS: std::ops::RangeInclusive<u32> = 320..=4096;

/// What a preview shows: the viewpoint for a cloud, or the image made of pings or of the frame of a radar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum View {
    /// Straight down without perspective: +x to the right, +y up.
    #[default]
    Top,
    /// From behind and above the sensor, along its heading.
    Perspective,
    /// As the sensor sees it: rows and columns of the sensor, or azimuth and elevation.
    Range,
    /// Pings of a sonar, one per row, the first at the top: both sides of a side-scan sonar, else the middle beam.
    Waterfall,
    /// Pings of a sonar on the map: the mosaic of side-scan, imaging and single-beam sonars, the depths of swath
    /// sonars.
    Track,
    /// A ping laid out by its beams: the last of an imaging or swath sonar, all of a rotating beam.
    Fan,
    /// Power in the cube of a radar by range and velocity; what approaches is on the left.
    RangeDoppler,
    /// Power in the cube of a radar by range and azimuth, ahead up.
    RangeAzimuth,
    /// The polar image of a rotating radar, laid out around it, ahead up.
    Polar,
}

named! { View: Top "top", Perspective "perspective", Range "range", Waterfall "waterfall", Track "track", Fan "fan",
RangeDoppler "range_doppler", RangeAzimuth "range_azimuth", Polar "polar" }

impl View {
    /// Whether it shows clouds.
    pub fn shows_points(self) -> bool {
        !self.shows_pings() && !self.shows_frames()
    }

    /// Whether it shows pings of a sonar.
    pub fn shows_pings(self) -> bool {
        matches!(self, View::Waterfall | View::Track | View::Fan)
    }

    /// Whether it shows frames of a radar.
    pub fn shows_frames(self) -> bool {
        matches!(self, View::RangeDoppler | View::RangeAzimuth | View::Polar)
    }
}

impl FromStr for View {
    type Err = Error;

    fn from_str(name: &str) -> Result<View> {
        by_name("view", name)
    }
}

/// What the colours of a preview show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ColorBy {
    /// Category, or part if there is only one category; backscatter from the air has its own colours if the cloud has
    /// the column `cause`.
    #[default]
    Label,
    /// Why a point is there: [`Cause`](ground::cause::Cause).
    Cause,
    /// Intensity as reported by the instrument.
    Intensity,
    /// Slant range.
    Range,
    /// Height, z.
    Height,
    /// Speed of the surface in the world, m/s; stationary points are grey.
    Velocity,
    /// Rate of the true range, m/s: one colour towards the sensor, another away from it, grey in between.
    RadialVelocity,
    /// The same as measured by an FMCW LiDAR.
    Doppler,
    /// Points per square degree as seen by the sensor: how densely it has covered the scene.
    Density,
    /// Points per square metre of the map.
    GroundDensity,
    /// Number of the flight line or station.
    Strip,
    /// How the wave of a radar detection travelled: [`PathType`](ground::path_type::PathType).
    Path,
}

named! { ColorBy: Label "label", Cause "cause", Intensity "intensity", Range "range", Height "height",
Velocity "velocity", RadialVelocity "radial_velocity", Doppler "doppler", Density "density", GroundDensity "ground_density", Strip "strip", Path "path" }

impl FromStr for ColorBy {
    type Err = Error;

    fn from_str(name: &str) -> Result<ColorBy> {
        by_name("preview colour", name)
    }
}

builder! {
    /// How a preview looks.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct PreviewOptions {
        /// Viewpoint; default top.
        pub view: View = View::default(),
        /// What the colours show; default label.
        pub color: ColorBy = ColorBy::default(),
        /// Width of the picture in pixels, 320 to 4096, default 1600; the height follows the content.
        pub width: u32 = 1600,
        /// Whether a waterfall shows ground range, along the bed, instead of slant range; default false.
        pub ground: bool = false,
        /// Whether the boxes of a cloud that have points are drawn, coloured by category; default false.
        pub boxes: bool = false,
    }
}

impl PreviewOptions {
    /// Reads options from YAML: `view`, `color`, `width`, `ground`, `boxes`.
    ///
    /// # Errors
    /// Line and key of the mistake, with the most similar known key.
    pub fn from_yaml(text: &str) -> Result<PreviewOptions> {
        yaml::from_str("preview options", text)
    }

    /// The columns that a picture with these options needs, of a cloud or of pings, depending on the view; none of frames
    /// of radars.
    pub fn fields(&self) -> FieldSet {
        if self.view.shows_pings() {
            return [Field::Intensity, Field::CategoryId, Field::PartId].into_iter().collect();
        }
        if self.view.shows_frames() {
            return FieldSet::EMPTY;
        }
        let shown: &[Field] = match self.color {
            ColorBy::Label => &[Field::CategoryId, Field::PartId],
            ColorBy::Intensity => &[Field::Intensity],
            ColorBy::Range => &[Field::Range],
            ColorBy::Velocity => &VELOCITY,
            ColorBy::RadialVelocity => &[Field::RadialVelocity],
            ColorBy::Doppler => &[Field::Doppler],
            ColorBy::Path => &[Field::Path],
            ColorBy::Strip => &[Field::Strip],
            ColorBy::Cause | ColorBy::Height | ColorBy::Density | ColorBy::GroundDensity => &[],
        };
        let rows: &[Field] = if self.view == View::Range { &[Field::Channel] } else { &[] };
        let always = [Field::X, Field::Y, Field::Z, Field::Cause];
        always.iter().chain(shown).chain(rows).copied().collect()
    }
}

/// Checks before a long scan whether a picture could be written to `path`.
///
/// # Errors
/// A width out of bounds, an ending other than `.png`, a folder that is missing or not writable.
pub fn check(path: &Path, options: &PreviewOptions) -> Result<()> {
    check_width(options.width)?;
    check_ending(path)?;
    Pending::create(path).map(drop)
}

/// Checks that a picture would not replace a file of another kind.
fn check_ending(path: &Path) -> Result<()> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        return Ok(());
    }
    Err(Error::Unsupported {
        what: format!("the ending of the output file {}", shown::path(path)),
        instead: "pictures are written as .png".to_owned(),
    })
}

fn check_width(width: u32) -> Result<()> {
    if !WIDTHS.contains(&width) {
        let allowed = format!("{} to {} pixels", WIDTHS.start(), WIDTHS.end());
        return Err(Error::invalid("preview width", width, allowed));
    }
    Ok(())
}

/// Writes a picture of `cloud` to the PNG file `path`, which appears only when complete.
///
/// Columns that the colours need and the cloud lacks are replaced by others, as the report says.
///
/// # Errors
/// As [`check`], a view that does not show points, and a full disk.
pub fn write(cloud: &PointCloud, path: &Path, options: &PreviewOptions) -> Result<Report> {
    check_ending(path)?;
    let mut report = Report::default();
    let picture = render(cloud, options, &mut report)?;
    write_picture(&picture, path)?;
    Ok(report)
}

/// Checks options by themselves.
///
/// # Errors
/// A width out of bounds, a view that does not show points.
pub fn check_options(options: &PreviewOptions) -> Result<()> {
    check_width(options.width)?;
    if !options.view.shows_points() {
        return Err(not_of_points(options.view));
    }
    Ok(())
}

/// [`write()`] to a new file in a folder that no other process reads yet.
///
/// # Errors
/// The same.
pub fn write_new(cloud: &PointCloud, path: &Path, options: &PreviewOptions) -> Result<Report> {
    let mut report = Report::default();
    let picture = render(cloud, options, &mut report)?;
    let bytes = picture.to_png().map_err(|source| failed(path, source))?;
    write::whole(path, &bytes)?;
    Ok(report)
}

fn not_of_points(view: View) -> Error {
    let shown = if view.shows_pings() { "pings of a sonar" } else { "frames of a radar" };
    Error::invalid("view", view.name(), format!("top, perspective or range for points; it shows {shown}"))
}

/// Writes a picture of `pings` to the PNG file `path`, which appears only when complete.
///
/// # Errors
/// As [`render_pings`], an ending other than `.png`, a folder that is missing or not writable, and a full disk.
pub fn write_pings(pings: &Pings, path: &Path, options: &PreviewOptions) -> Result<Report> {
    check_ending(path)?;
    let mut report = Report::default();
    let picture = render_pings(pings, options, &mut report)?;
    write_picture(&picture, path)?;
    Ok(report)
}

/// Writes a picture of an image of a radar ([`cloud::image::range_doppler`], [`cloud::image::polar`],
/// [`cloud::image::polar_fan`]) to the PNG file `path`, which appears only when complete; `width` in pixels.
///
/// # Errors
/// As [`render_radar`], an ending other than `.png`, a folder that is missing or not writable, and a full disk.
pub fn write_radar(image: &Image, path: &Path, width: u32) -> Result<()> {
    check_ending(path)?;
    write_picture(&render_radar(image, width)?, path)
}

/// Writes a plan of `scene`, from which `built` is made, to the PNG file `path`, `width` pixels wide: the view from
/// above, in the colours of categories, or of heights if there are no categories, with a grid of coordinates, the
/// heights where its lines cross, and the cameras. A scene whose top is a ceiling is cut open above the tables.
///
/// # Errors
/// A width out of bounds, an ending other than `.png`, a folder that is missing or not writable, and a full disk.
pub fn write_plan(scene: &Scene, built: &BuiltScene, path: &Path, width: u32) -> Result<()> {
    check_width(width)?;
    check_ending(path)?;
    write_picture(&plan::draw(scene, built, &Page::new(width)), path)
}

/// Writes a picture of the survey `plan` over `scene`, from which `built` is made, to the PNG file `path`, `width` pixels
/// wide: the scene from above by height, the area, swaths, strips with their numbers, and the way between them.
///
/// # Errors
/// As [`write_plan`].
pub fn write_survey(scene: &Scene, built: &BuiltScene, plan: &SurveyPlan, path: &Path, width: u32) -> Result<()> {
    check_width(width)?;
    check_ending(path)?;
    write_picture(&survey::draw(scene, built, plan, &Page::new(width)), path)
}

fn write_picture(picture: &Picture, path: &Path) -> Result<()> {
    let pending = Pending::create(path)?;
    let written = picture.to_png().and_then(|bytes| write::bytes(pending.path(), &bytes));
    written.map_err(|source| failed(path, source))?;
    pending.commit()
}

/// The content of the picture of `pings`, as numbers: levels in dB with the sonar's gain over time, or heights in m,
/// and labels.
///
/// # Errors
/// As [`render_pings`]; no pings.
pub fn image_of(pings: &Pings, options: &PreviewOptions) -> Result<Image> {
    check_pinged(options)?;
    if pings.pings.is_empty() {
        return Err(Error::invalid("pings", "none", "at least one"));
    }
    let (.., image) = sonar::made(pings, options, &Page::new(options.width))?;
    Ok(image)
}

/// Checks that the options are for a picture of pings.
fn check_pinged(options: &PreviewOptions) -> Result<()> {
    check_width(options.width)?;
    if !options.view.shows_pings() {
        let shown = if options.view.shows_points() { "points" } else { "frames of a radar" };
        let allowed = format!("waterfall, track or fan for pings; it shows {shown}");
        return Err(Error::invalid("view", options.view.name(), allowed));
    }
    Ok(())
}

/// The picture of `pings`; if there are none, it says so.
///
/// Pings without labels are coloured by level instead, as the report says.
///
/// # Errors
/// A width out of bounds, a view that shows clouds or another kind of sonar, a colour that pings lack, pings that do
/// not fit together.
pub fn render_pings(pings: &Pings, options: &PreviewOptions, report: &mut Report) -> Result<Picture> {
    check_pinged(options)?;
    let page = Page::new(options.width);
    if pings.pings.is_empty() {
        return Ok(page.empty("no pings"));
    }
    sonar::draw(pings, options, &page, report)
}

/// The content of the picture of `frame`, as power in dBm: [`View::RangeDoppler`] and [`View::RangeAzimuth`] of its cube,
/// [`View::Polar`] of its polar image.
///
/// # Errors
/// A width out of bounds; a view that does not show frames of radars; a frame without what it shows, or whose lengths
/// disagree.
pub fn image_of_frame(frame: &RadarFrame, options: &PreviewOptions) -> Result<Image> {
    check_width(options.width)?;
    radar::made(frame, options.view, &Page::new(options.width))
}

/// Writes a picture of `frame` to the PNG file `path`, which appears only when complete.
///
/// # Errors
/// As [`image_of_frame`], an ending other than `.png`, a folder that is missing or not writable, and a full disk.
pub fn write_frame(frame: &RadarFrame, path: &Path, options: &PreviewOptions) -> Result<()> {
    check_ending(path)?;
    write_radar(&image_of_frame(frame, options)?, path, options.width)
}

/// The picture of an image of a radar, `width` pixels wide, coloured by power.
///
/// # Errors
/// A width out of bounds, an image of another kind, one whose values do not fit its size.
pub fn render_radar(image: &Image, width: u32) -> Result<Picture> {
    check_width(width)?;
    image.check()?;
    radar::draw(image, &Page::new(width))
}

/// The picture of `cloud`; the same cloud and options give the same pixels.
///
/// A cloud without points yields a picture that says so.
///
/// # Errors
/// A width out of bounds, a view that does not show points.
pub fn render(cloud: &PointCloud, options: &PreviewOptions, report: &mut Report) -> Result<Picture> {
    check_options(options)?;
    let page = Page::new(options.width);
    let points = Points::new(cloud, report);
    if points.count == 0 {
        return Ok(page.empty("no points"));
    }
    let paint = Paint::new(cloud, &points, options.color, report);
    if options.boxes && cloud.boxes.is_none() {
        report.warn("preview: the cloud has no boxes, which are computed if ScanOptions::boxes requests them");
    }
    let outlines = if options.boxes { boxes::outlines(cloud) } else { Vec::new() };
    let mut notes = Vec::new();
    let (view, panel) = match options.view {
        View::Top => ("Top view", top::draw(&points, &paint, &outlines, &page, &mut notes)),
        View::Perspective => ("Perspective view", perspective::draw(&points, &paint, &outlines, &page, &mut notes)),
        View::Range => ("Range image", range_image::draw(cloud, &points, &paint, &outlines, &page)),
        other => return Err(not_of_points(other)),
    };
    let title = format!("{view} of {} by {}", legend::counted(points.count, "point"), paint.name());
    Ok(page.compose(&title, &notes.join("; "), &panel, &legend::draw(paint.legend(), &page)))
}

/// Sizes that scale with the width of the picture.
struct Page {
    width: u32,
    /// Pixels per design pixel of a picture 1600 wide; text stays readable in small pictures.
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

    /// A page that only says `words`.
    fn empty(&self, words: &str) -> Picture {
        let mut page = Picture::new(self.width, self.width / 4, PAGE);
        let capitals = 24.0 * self.scale;
        let middle = Vec2::new(page.width as f32, page.height as f32) / 2.0;
        let start = middle + Vec2::new(-font::width(words, capitals), capitals) / 2.0;
        page.text(words, start, capitals, DIM);
        page
    }
}

/// Those for tests of the crate that defines pings.
#[cfg(test)]
#[path = "../../cloud/src/image/synthetic.rs"]
mod synthetic;

#[cfg(test)]
mod tests {
    use super::*;
    use engine::trace::Engine;
    use glam::DVec3;
    use std::fs::File;

    #[test]
    fn pictures_replace_pictures_only() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.glb");
        std::fs::write(&scene, "a scene").unwrap();
        let pings = crate::synthetic::pings(&crate::synthetic::SyntheticSidescan::default());
        let options = PreviewOptions { view: View::Waterfall, color: ColorBy::Intensity, ..PreviewOptions::default() };
        let refused = |done: Result<Report>| {
            let error = done.unwrap_err().to_string();
            assert!(error.contains("scene.glb") && error.contains("pictures are written as .png"), "{error}");
        };
        refused(write_pings(&pings, &scene, &options));
        refused(write(&cloud(&[[1.0; 3]]), &scene, &PreviewOptions::default()));
        refused(check(&scene, &options).map(|()| Report::default()));
        assert_eq!(std::fs::read(&scene).unwrap(), b"a scene");
        write_pings(&pings, &folder.path().join("a.PNG"), &options).unwrap();
    }

    const VIEWS: [View; 3] = [View::Top, View::Perspective, View::Range];
    const COLORS: [ColorBy; 12] = [
        ColorBy::Label,
        ColorBy::Cause,
        ColorBy::Path,
        ColorBy::Intensity,
        ColorBy::Range,
        ColorBy::Height,
        ColorBy::Velocity,
        ColorBy::RadialVelocity,
        ColorBy::Doppler,
        ColorBy::Density,
        ColorBy::GroundDensity,
        ColorBy::Strip,
    ];

    fn cloud(positions: &[[f32; 3]]) -> PointCloud {
        let mut cloud = PointCloud { len: positions.len(), ..PointCloud::default() };
        let c = &mut cloud.columns;
        for [x, y, z] in positions {
            c.x.push(*x);
            c.y.push(*y);
            c.z.push(*z);
        }
        c.range = vec![f32::NAN; cloud.len];
        c.intensity = (0..cloud.len).map(|row| [0.5, f32::INFINITY, f32::NAN][row % 3]).collect();
        c.category_id = (0..cloud.len as u32).collect();
        c.channel = vec![0; cloud.len];
        c.cause = (0..cloud.len).map(|row| (row % 12) as u8).collect();
        let speeds =
            |from: usize| (0..cloud.len).map(move |row| [0.0, f32::NAN, 1e30, f32::INFINITY][(from + row) % 4]);
        [c.velocity_x, c.velocity_y, c.velocity_z] = [0, 1, 2].map(|axis| speeds(axis).collect());
        (c.radial_velocity, c.doppler) = (speeds(0).map(|speed| -speed).collect(), speeds(2).collect());
        cloud
    }

    #[test]
    fn names_are_read_and_wrong_ones_are_explained() {
        assert_eq!("perspective".parse::<View>().unwrap(), View::Perspective);
        assert_eq!("height".parse::<ColorBy>().unwrap(), ColorBy::Height);
        let error = "prespective".parse::<View>().unwrap_err().to_string();
        assert_eq!(
            error,
            "there is no view named \"prespective\"; near: perspective, top, range, waterfall, track, fan, range_doppler, range_azimuth, polar"
        );
        let error = "hieght".parse::<ColorBy>().unwrap_err().to_string();
        assert_eq!(
            error,
            "there is no preview colour named \"hieght\"; near: height, label, cause, intensity, range, velocity, \
             radial_velocity, doppler, density, ground_density, strip, path"
        );
    }

    #[test]
    fn views_of_pings_are_not_for_clouds() {
        let options = PreviewOptions { view: View::Track, ..PreviewOptions::default() };
        let error = render(&cloud(&[[1.0; 3]]), &options, &mut Report::default()).unwrap_err().to_string();
        assert_eq!(error, "view is track; allowed: top, perspective or range for points; it shows pings of a sonar");
        assert!(options.fields().contains(Field::Intensity) && !options.fields().contains(Field::X));
    }

    #[test]
    fn strange_clouds_give_pictures() {
        let mut strange = vec![
            cloud(&[]),
            cloud(&[[f32::NAN; 3], [0.0, f32::INFINITY, 0.0]]),
            cloud(&[[1.0, 2.0, 3.0]]),
            cloud(&[[0.0; 3]]),
            cloud(&[[4.0, 5.0, 6.0]; 1000]),
            cloud(&[[1e14, -1e14, 1e14], [-1e14; 3], [0.0; 3]]),
            cloud(&[[3e38; 3], [1.0; 3]]),
            cloud(&[[1e-30, 0.0, 0.0], [0.0; 3]]),
            cloud(&[[0.0, 0.0, -5.0], [0.0, 0.0, 5.0], [0.0, 0.0, 1.0]]),
            PointCloud { len: 5, ..PointCloud::default() },
        ];
        for index in 0..strange.len() {
            let rows = strange[index].len as u32;
            strange.push(PointCloud { organised: Some([rows, 1]), ..strange[index].clone() });
            strange.push(PointCloud { organised: Some([1, rows]), ..strange[index].clone() });
            // A shape that does not match the cloud, and a sensor far from it.
            strange.push(PointCloud { organised: Some([rows, 7]), ..strange[index].clone() });
            strange.push(PointCloud {
                sensor_pose: ground::pose::Pose { position: DVec3::splat(1e300), ..ground::pose::Pose::IDENTITY },
                ..strange[index].clone()
            });
        }
        let sizes = [0.0, 1.0, 1e18, f64::NAN, f64::INFINITY];
        for (index, cloud) in strange.iter_mut().enumerate() {
            let boxes = sizes.map(|size| boxes::tests::unit_box().size(DVec3::splat(size)));
            cloud.boxes = Some(boxes.into());
            for (turn, view) in VIEWS.into_iter().enumerate() {
                let color = COLORS[(index + turn) % COLORS.len()];
                let options = PreviewOptions { view, color, width: 320, boxes: true, ..PreviewOptions::default() };
                let picture = render(cloud, &options, &mut Report::default()).unwrap();
                assert_eq!(picture.pixels.len(), 3 * 320 * picture.height as usize, "{index} {options:?}");
                assert!(picture.height < 600, "{index} {options:?}");
            }
        }
    }

    #[test]
    fn a_point_leaves_its_colour_in_every_view() {
        for view in VIEWS {
            let mut one = cloud(&[[3.0, 1.0, 1.0]]);
            one.columns.category_id = vec![4];
            let options = PreviewOptions { view, ..PreviewOptions::default() };
            let picture = render(&one, &options, &mut Report::default()).unwrap();
            let page = Page::new(options.width);
            // The panel, without the swatch in the legend.
            let panel = (page.panel_top()..picture.height - page.margin() - 3 * page.text() as u32)
                .flat_map(|y| (0..picture.width).map(move |x| (x, y)));
            let lit = panel.filter(|&(x, y)| picture.pixel(x, y) == palette::category(4)).count();
            assert!(lit > 0, "{view:?}");
        }
    }

    #[test]
    fn the_same_cloud_gives_the_same_pixels() {
        let positions: Vec<[f32; 3]> = (0..200_000u32)
            .map(|i| [i.wrapping_mul(2_654_435_761), i.wrapping_mul(40_503), i % 7].map(|v| (v % 1000) as f32 / 100.0))
            .collect();
        let mut cloud = cloud(&positions);
        cloud.columns.category_id.iter_mut().for_each(|id| *id %= 5);
        for view in VIEWS {
            let options = PreviewOptions { view, ..PreviewOptions::default() };
            let draw = |threads: usize| {
                let engine = Engine::with_threads(threads).unwrap();
                engine.install(|| render(&cloud, &options, &mut Report::default()).unwrap())
            };
            assert!(draw(1) == draw(3), "{view:?}");
        }
    }

    #[test]
    fn files_are_png_and_appear_only_when_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("preview.png");
        let mut cloud = cloud(&[[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]);
        cloud.columns.intensity.clear();
        let options = PreviewOptions { color: ColorBy::Intensity, width: 400, ..PreviewOptions::default() };
        let report = write(&cloud, &path, &options).unwrap();
        assert_eq!(report.warnings.len(), 1, "{report:?}");
        let mut reader = png::Decoder::new(std::io::BufReader::new(File::open(&path).unwrap())).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, render(&cloud, &options, &mut Report::default()).unwrap().pixels);

        let missing = folder.path().join("none/preview.png");
        assert!(write(&cloud, &missing, &options).is_err() && check(&missing, &options).is_err());
        check(&path, &options).unwrap();
        let wide = PreviewOptions { width: 100_000, ..options };
        let error = write(&cloud, &path, &wide).unwrap_err().to_string();
        assert_eq!(error, "preview width is 100000; allowed: 320 to 4096 pixels");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
