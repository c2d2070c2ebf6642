//! Images of a radar: range by Doppler and polar with lines of equal coordinates, and the fan with rings of equal
//! range.

use super::View;
use super::canvas::{GROUND, Picture, TEXT};
use super::legend::{self, round_down};
use super::points::{quantile, wide};
use super::sonar::{FLATTEST, Ink, TALLEST, rings};
use super::top::length;
use super::{Page, font};
use cloud::image::{Image, ImageKind, polar_fan, range_doppler};
use cloud::{PolarImage, RadarFrame};
use glam::Vec2;
use ground::error::{Error, Result};
use std::f64::consts::{FRAC_PI_2, PI};

/// The image of `frame` in this view.
pub(super) fn made(frame: &RadarFrame, view: View, page: &Page) -> Result<Image> {
    let missing = |what: &str| {
        let found = format!("of frame {}, which has no {what}", frame.number);
        Error::invalid(format!("view {}", view.name()), found, format!("a frame with a {what}"))
    };
    match view {
        View::RangeDoppler => range_doppler(frame.cube.as_ref().ok_or_else(|| missing("cube"))?),
        View::RangeAzimuth if frame.cube.is_some() => laid_out(&frame.range_azimuth()?, page),
        View::RangeAzimuth => Err(missing("cube")),
        View::Polar => laid_out(frame.polar.as_ref().ok_or_else(|| missing("polar image"))?, page),
        other => {
            let allowed = "range_doppler, range_azimuth or polar for frames of radars";
            Err(Error::invalid("view", other.name(), allowed))
        }
    }
}

/// `image` around the radar, as large as the page has room for.
fn laid_out(image: &PolarImage, page: &Page) -> Result<Image> {
    // A small one gives the aspect ratio.
    let small = polar_fan(image, 64)?;
    let sides = [small.width, small.height].map(|side| side as f32);
    let room = [page.inner() as f32, TALLEST * page.inner() as f32];
    let fit = (room[0] / sides[0]).min(room[1] / sides[1]);
    polar_fan(image, (fit * sides[0].max(sides[1])) as usize)
}

/// The picture of `image`.
pub(super) fn draw(image: &Image, page: &Page) -> Result<Picture> {
    let [width, height] = [image.width, image.height];
    let (title, notes) = match image.kind {
        ImageKind::RangeDoppler => {
            ("Range by Doppler", format!("{width} x {height} cells; what approaches is on the left"))
        }
        ImageKind::Polar => ("Polar image", format!("{height} azimuths, clockwise from the top, x {width} ranges")),
        ImageKind::PolarFan => ("Range by azimuth", "ahead is up".to_owned()),
        other => {
            let allowed = "range_doppler, polar or polar_fan, which are of radars";
            return Err(Error::invalid("kind of the image", other.name(), allowed));
        }
    };
    let ink = Ink::of_powers(image, span(image));
    let panel = if image.kind == ImageKind::PolarFan { rings(image, &ink, page) } else { grid(image, &ink, page) };
    Ok(page.compose(title, &notes, &panel, &legend::draw(&ink.legend, page)))
}

/// From the noise, of which most cells are, to the strongest.
fn span(image: &Image) -> [f32; 2] {
    let mut known: Vec<f32> = image.values.iter().copied().filter(|value| value.is_finite()).collect();
    wide([0.5, 1.0].map(|q| quantile(&mut known, q)))
}

/// The image at full width, with lines of equal coordinates.
fn grid(image: &Image, ink: &Ink, page: &Page) -> Picture {
    let width = page.inner();
    let rows = match image.kind {
        // Few cells, which differ in length and width.
        ImageKind::RangeDoppler => 0.5 * width as f32,
        _ => (image.height as f32).clamp(FLATTEST * width as f32, TALLEST * width as f32),
    };
    let mut picture = Picture::new(width, rows as u32, GROUND);
    let size = [picture.width, picture.height];
    ink.fill(&mut picture, [0, 0], size);
    let capitals = page.text();
    for axis in [0, 1] {
        let cells = [image.width, image.height][axis] as f64;
        let (step, length) = (image.place.step[axis], f64::from(size[axis]));
        let start = image.place.first[axis] - 0.5 * step;
        let [low, high] = [start, start + cells * step].map(|end| end / step.signum());
        let unit = if is_angle(image, axis) { angle_unit(high - low) } else { round_down((high - low) / 3.0) };
        for line in (low / unit).ceil() as i64..=(high / unit).floor() as i64 {
            let place = line as f64 * unit;
            let at = ((place - low) / (high - low) * length) as u32;
            if at < 1 || at + 1 > size[axis] {
                continue;
            }
            let thickness = page.px(1.0);
            let (corner, extent) = match axis {
                0 => ([at, 0], [thickness, size[1]]),
                _ => ([0, at], [size[0], thickness]),
            };
            picture.fill(corner, extent, TEXT, if line == 0 { 0.45 } else { 0.25 });
            let words = words(image, axis, place * step.signum());
            let shift = Vec2::new(0.5, -0.5) * capitals;
            // Those of rows are at the right, where they do not cross those of columns.
            let from = match axis {
                0 => Vec2::new(at as f32, 2.3 * capitals),
                _ => Vec2::new(size[0] as f32 - font::width(&words, capitals) - 1.5 * capitals, at as f32),
            } + shift;
            if from.x + font::width(&words, capitals) < size[0] as f32 && from.y > capitals {
                picture.text_over(&words, from, capitals, TEXT);
            }
        }
    }
    picture
}

fn is_angle(image: &Image, axis: usize) -> bool {
    image.place.axes[axis].ends_with("rad")
}

/// Between lines of equal azimuth, rad.
fn angle_unit(span: f64) -> f64 {
    if span > PI { FRAC_PI_2 } else { PI / 6.0 }
}

/// The coordinate `place` of an axis in words; none for a range of 0.
fn words(image: &Image, axis: usize, place: f64) -> String {
    match image.place.axes[axis] {
        _ if is_angle(image, axis) => format!("{:.0} deg", place.to_degrees()),
        name if name.ends_with("m/s") => format!("{place} m/s"),
        _ if place == 0.0 => String::new(),
        _ => length(place),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Page, render_radar, write_radar};
    use super::*;
    use cloud::PolarImage;
    use cloud::image::{polar, polar_fan, range_doppler};
    use radar::{Axis, CubeAxes, RadarCube};
    use std::f64::consts::TAU;

    /// A cube of noise with one target at -10 m/s and 40 m.
    fn cube() -> RadarCube {
        let axes = CubeAxes {
            range: Axis { first: 0.0, step: 0.2, len: 256 },
            velocity: Axis { first: -16.0, step: 0.25, len: 128 },
        };
        let mut random = 1_u32;
        let mut noise = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) as f32 / 8_388_608.0 - 1.0
        };
        let mut cells: Vec<_> = (0..256 * 128).map(|_| num_complex::Complex32::new(noise(), noise()) * 1e-8).collect();
        cells[24 * 256 + 200] = num_complex::Complex32::new(1e-5, 0.0);
        RadarCube { axes, channels: 1, cells }
    }

    /// A turn with one target 90 degrees to the right.
    fn turn() -> PolarImage {
        let mut image = PolarImage::default();
        image.range = Axis { first: 0.0, step: 0.0432, len: 1000 };
        image.azimuths = (0..400).map(|row| -TAU * f64::from(row) / 400.0).collect();
        image.times = vec![0.0; 400];
        image.levels = (0..400_000).map(|cell| -110.0 + (cell % 1301 * 7919 % 13) as f32 * 0.5).collect();
        (300..310).for_each(|cell| image.levels[100 * 1000 + cell] = -60.0);
        (image.floor_dbm, image.step_db) = (-120.0, 0.5);
        image
    }

    fn images() -> Vec<Image> {
        let made: Result<Vec<Image>> =
            [range_doppler(&cube()), polar(&turn()), polar_fan(&turn(), 700)].into_iter().collect();
        made.unwrap()
    }

    #[test]
    fn strong_echoes_are_where_they_are() {
        // To the right of the left edge and below the top of the panel, as parts of it.
        let [top, margin] = [Page::new(800).panel_top(), Page::new(800).margin()];
        let side = (800 - 2 * margin) as f32;
        // The fan is as high as it may be, and in the middle.
        let fan = [0.5 + 0.305 * 0.5 * TALLEST, 0.5 * TALLEST];
        let polar = [0.305, 0.25 * (400.0 / side)];
        let doppler = [24.5 / 128.0, 0.5 * 55.5 / 256.0];
        for (image, place) in images().iter().zip([doppler, polar, fan]) {
            let picture = render_radar(image, 800).unwrap();
            let [x, y] = [margin + (place[0] * side) as u32, top + (place[1] * side) as u32];
            let light = |x: u32, y: u32| picture.pixel(x, y).iter().map(|&part| u32::from(part)).sum::<u32>();
            let near =
                |x: u32, y: u32| (x - 4..x + 5).flat_map(|x| (y - 4..y + 5).map(move |y| light(x, y))).max().unwrap();
            let other = near(x - 60, y + 30);
            assert!(near(x, y) > 600 && other < 450, "{:?} {x} {y}: {} {other}", image.kind, near(x, y));
        }
    }

    #[test]
    fn views_show_what_the_frame_has() {
        let page = Page::new(640);
        let mut frame = RadarFrame::default();
        let error = |frame: &RadarFrame, view| made(frame, view, &page).unwrap_err().to_string();
        for (view, missing) in
            [(View::RangeDoppler, "cube"), (View::RangeAzimuth, "cube"), (View::Polar, "polar image")]
        {
            let found = format!("of frame 0, which has no {missing}; allowed: a frame with a {missing}");
            assert_eq!(error(&frame, view), format!("view {} is {found}", view.name()));
        }
        assert!(error(&frame, View::Top).starts_with("view is top; allowed: range_doppler"));
        frame.wavelength = 3.9e-3;
        frame.elements = vec![[0.0; 3]];
        (frame.cube, frame.polar) = (Some(cube()), Some(turn()));
        assert_eq!(made(&frame, View::RangeDoppler, &page).unwrap(), range_doppler(&cube()).unwrap());
        // A half turn ahead, and a whole one, each as large as the page has room for.
        let [half, whole] = [View::RangeAzimuth, View::Polar].map(|view| made(&frame, view, &page).unwrap());
        let room = (TALLEST * page.inner() as f32) as usize;
        assert!(half.width > whole.width && whole.height.abs_diff(room) < 3 && half.width <= page.inner() as usize + 1);
    }

    #[test]
    fn images_of_sonars_are_refused() {
        let mut image = images().remove(0);
        image.kind = cloud::image::ImageKind::Fan;
        let error = render_radar(&image, 800).unwrap_err().to_string();
        assert_eq!(error, "kind of the image is fan; allowed: range_doppler, polar or polar_fan, which are of radars");
        image.values.pop();
        assert!(render_radar(&image, 800).is_err() && render_radar(&image, 8).is_err());
        let folder = tempfile::tempdir().unwrap();
        assert!(write_radar(&image, &folder.path().join("a.jpg"), 800).is_err());
        for (name, image) in ["range_doppler", "polar", "polar_fan"].into_iter().zip(images()) {
            write_radar(&image, &folder.path().join(format!("{name}.png")), 800).unwrap();
        }
    }
}
