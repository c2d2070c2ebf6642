//! Colours for categories and for values.

use super::canvas::Color;
use ground::cause::Cause;
use ground::path_type::PathType;
use model::material::srgb_byte;
use std::f32::consts::TAU;

/// Colours of categories 1, 2, ...: well apart on a dark background for normal, protanopic and deuteranopic eyes,
/// especially the first ones.
///
/// The first seven follow Okabe and Ito, "Color Universal Design" (2008), lightened for the dark background; each
/// further one is the colour farthest from all before it in Oklab, seen with normal eyes (weight 0.65) and through the
/// dichromat matrices of Machado, Oliveira and Fernandes (IEEE TVCG 15, 2009; weight 0.35).
const CATEGORIES: [Color; 24] = [
    [0x56, 0xb4, 0xe9],
    [0xe6, 0x9f, 0x00],
    [0x21, 0xb1, 0x83],
    [0xf0, 0xe4, 0x42],
    [0xec, 0x6a, 0x45],
    [0xd7, 0x86, 0xb8],
    [0x5b, 0x7f, 0xf0],
    [0x6d, 0xfe, 0xe5],
    [0xef, 0xc8, 0xf2],
    [0xa9, 0x50, 0xb2],
    [0x7a, 0x82, 0x01],
    [0xc8, 0x43, 0x6b],
    [0xaf, 0xd1, 0x94],
    [0xf9, 0x9f, 0x90],
    [0x22, 0x84, 0xb1],
    [0xc2, 0x88, 0xfb],
    [0x7e, 0xbd, 0x3e],
    [0x96, 0xfe, 0x96],
    [0x26, 0xd4, 0xd0],
    [0xa6, 0x69, 0x4a],
    [0xaf, 0x91, 0x51],
    [0xfe, 0xdd, 0x9c],
    [0x94, 0x80, 0xbb],
    [0x02, 0x8f, 0x75],
];

/// Colour of points without a label.
const UNLABELLED: Color = [0x84, 0x88, 0x90];
/// Colour of the categories that the legend sums up, and of values that are unknown.
pub(super) const OTHER: Color = [0x52, 0x56, 0x5e];
/// Colour of stationary points, a neutral grey between the colours of moving points.
pub(super) const STANDING: Color = [0x71, 0x72, 0x75];

/// Colour of points with `cause`; the same in every picture.
///
/// Those without a surface are muted, and far from the label colours that they appear beside.
pub(super) fn cause(cause: Cause) -> Color {
    match cause {
        Cause::Surface => [0xda, 0xd8, 0xcc],
        Cause::Mirror => CATEGORIES[1],
        Cause::Glass => CATEGORIES[0],
        Cause::Mixed => CATEGORIES[9],
        Cause::Multipath => CATEGORIES[4],
        Cause::Rain => [0x4a, 0x6c, 0x94],
        Cause::Fog => [0x96, 0xa8, 0xb0],
        Cause::Snow => [0xb4, 0xcc, 0xe0],
        Cause::Dust => [0x8c, 0x7c, 0x5e],
        Cause::FalseAlarm => [0x8a, 0x50, 0x68],
        Cause::SeaSurface => [0x78, 0x7c, 0xc8],
        _ => STANDING,
    }
}

/// Colour of detections by `path`; the same in every picture. Noise is muted.
pub(super) fn path(path: PathType) -> Color {
    match path {
        PathType::Direct => [0xda, 0xd8, 0xcc],
        PathType::Ground => CATEGORIES[7],
        PathType::Wall => CATEGORIES[1],
        PathType::Internal => CATEGORIES[0],
        PathType::SideLobe => CATEGORIES[4],
        PathType::Alias => CATEGORIES[9],
        PathType::Interference => CATEGORIES[5],
        PathType::Noise => [0x8a, 0x50, 0x68],
        _ => STANDING,
    }
}

/// Colour of label number `id`; the same in every picture.
pub(super) fn category(id: u32) -> Color {
    let Some(index) = id.checked_sub(1) else {
        return UNLABELLED;
    };
    let base = CATEGORIES[index as usize % CATEGORIES.len()];
    // Numbers past the table reuse its colours, alternately lighter and darker.
    match (index as usize / CATEGORIES.len()) % 3 {
        0 => base,
        1 => base.map(|value| value / 2 + 0x60),
        _ => base.map(|value| value / 2),
    }
}

/// A scale of colours: lightness rises evenly while the hue turns, in Oklab, so that equal steps of the value look
/// equal and grey prints keep their order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ramp {
    /// Lightness at both ends, 0 black, 1 white.
    lightness: [f32; 2],
    /// Hue at both ends, turns.
    hue: [f32; 2],
    /// Largest chroma at both ends; less where the screen cannot show it.
    chroma: [f32; 2],
}

/// For range: violet through red to yellow.
pub(super) const RANGE: Ramp = Ramp { lightness: [0.42, 0.95], hue: [0.77, 1.28], chroma: [0.155; 2] };
/// For height: violet through blue and green to yellow.
pub(super) const HEIGHT: Ramp = Ramp { lightness: [0.40, 0.93], hue: [0.83, 0.30], chroma: [0.135; 2] };
/// For intensity: ember to pale yellow.
pub(super) const INTENSITY: Ramp = Ramp { lightness: [0.36, 0.97], hue: [0.03, 0.28], chroma: [0.14; 2] };
/// For sonar levels: copper, as on their screens.
pub(super) const LEVEL: Ramp = Ramp { lightness: [0.16, 0.95], hue: [0.13, 0.22], chroma: [0.105; 2] };
/// For the speed of moving points: blue through magenta and orange to pale yellow, all of it brighter than
/// [`STANDING`].
pub(super) const SPEED: Ramp = Ramp { lightness: [0.60, 0.96], hue: [0.74, 1.28], chroma: [0.17; 2] };
/// For radial velocities, from [`STANDING`] outwards: blue towards the sensor, red to orange away from it.
const TOWARDS: Ramp = Ramp { lightness: [0.55, 0.80], hue: [0.67, 0.62], chroma: [0.004, 0.15] };
const AWAY: Ramp = Ramp { lightness: [0.55, 0.80], hue: [0.06, 0.16], chroma: [0.004, 0.16] };

/// Colours of radial velocities at 255 equal steps, from towards the sensor to away from it; the middle one is 0.
pub(super) fn radial() -> Vec<Color> {
    let half = |ramp: Ramp| (1..=127).map(move |step| ramp.color(step as f32 / 127.0));
    half(TOWARDS).rev().chain([STANDING]).chain(half(AWAY)).collect()
}

impl Ramp {
    /// Colour at `t` from 0 to 1.
    pub(super) fn color(&self, t: f32) -> Color {
        let mix = |[from, to]: [f32; 2]| from + (to - from) * t.clamp(0.0, 1.0);
        let (lightness, hue, chroma) = (mix(self.lightness), mix(self.hue) * TAU, mix(self.chroma));
        let at = |chroma: f32| linear_srgb_from_oklab(lightness, chroma * hue.cos(), chroma * hue.sin());
        // The most chroma that the screen can show, up to the scale's own; grey always works.
        let (mut low, mut high) = (0.0f32, chroma);
        for _ in 0..16 {
            let middle = low.midpoint(high);
            let shown = at(middle).iter().all(|value| (-0.001..=1.001).contains(value));
            if shown { low = middle } else { high = middle }
        }
        at(low).map(srgb_byte)
    }

    /// [`Ramp::color`] at 256 equal steps.
    pub(super) fn table(&self) -> Vec<Color> {
        (0..256).map(|step| self.color(step as f32 / 255.0)).collect()
    }
}

/// Björn Ottosson, "A perceptual color space for image processing" (2020), linear sRGB from Oklab.
fn linear_srgb_from_oklab(lightness: f32, a: f32, b: f32) -> [f32; 3] {
    let l = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let m = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let s = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_38 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(a: Color, b: Color) -> i32 {
        (0..3).map(|i| i32::from(a[i].abs_diff(b[i])).pow(2)).sum()
    }

    #[test]
    fn categories_keep_apart() {
        for id in 0..72 {
            for other in 0..id {
                assert!(distance(category(id), category(other)) > 400, "{id} and {other}");
            }
            assert!(distance(category(id), OTHER) > 400, "{id}");
        }
        category(u32::MAX);
    }

    #[test]
    fn causes_keep_apart_and_those_of_the_air_from_labels_too() {
        for one in Cause::ALL {
            assert!(Cause::ALL.into_iter().all(|other| other == one || distance(cause(one), cause(other)) > 1600));
        }
        for air in Cause::ALL.into_iter().filter(|cause| !cause.has_surface()) {
            let color = cause(air);
            assert!((0..72).all(|id| distance(color, category(id)) > 400), "{air:?}");
            assert!(distance(color, UNLABELLED) > 1600 && distance(color, OTHER) > 1600, "{air:?}");
            // Muted: nearer to grey than any of the first category colours.
            let spread = |color: Color| color.iter().max().unwrap() - color.iter().min().unwrap();
            assert!(CATEGORIES[..7].iter().all(|&strong| spread(color) < spread(strong)), "{air:?}");
        }
    }

    #[test]
    fn paths_keep_apart() {
        for one in PathType::ALL {
            assert!(PathType::ALL.into_iter().all(|other| other == one || distance(path(one), path(other)) > 1600));
        }
    }

    #[test]
    fn ramps_rise_in_luminance() {
        for ramp in [RANGE, HEIGHT, INTENSITY, LEVEL, SPEED, TOWARDS, AWAY] {
            let luminance: Vec<f32> = ramp.table().into_iter().map(luminance).collect();
            assert!(luminance.windows(9).all(|w| w[0] < w[8]), "{ramp:?}");
        }
    }

    fn luminance([red, green, blue]: Color) -> f32 {
        let linear = |value: u8| f32::from(value).powf(2.2);
        0.2126 * linear(red) + 0.7152 * linear(green) + 0.0722 * linear(blue)
    }

    #[test]
    fn moving_points_stand_out_from_stationary_ones() {
        assert!(SPEED.table().into_iter().all(|color| distance(color, STANDING) > 1600));
        let radial = radial();
        assert_eq!((radial.len(), radial[127]), (255, STANDING));
        // Two hues from near the middle on, equally bright.
        for step in 20..=127 {
            let [towards, away] = [radial[127 - step], radial[127 + step]];
            assert!(towards[2] > towards[0] + 8 && away[0] > away[2] + 8, "{step}: {towards:?} {away:?}");
            assert!((luminance(towards) / luminance(away) - 1.0).abs() < 0.25, "{step}: {towards:?} {away:?}");
        }
        assert!(radial.windows(2).all(|pair| distance(pair[0], pair[1]) < 100));
    }

    #[test]
    fn oklab_gives_srgb_corners() {
        // White is L 1 without chroma; red is L 0.628, a 0.2249, b 0.1258 (Ottosson's tables).
        let white = linear_srgb_from_oklab(1.0, 0.0, 0.0);
        assert!(white.iter().all(|v| (v - 1.0).abs() < 1e-3), "{white:?}");
        let red = linear_srgb_from_oklab(0.627_955, 0.224_863, 0.125_846);
        assert!((red[0] - 1.0).abs() < 1e-3 && red[1].abs() < 1e-3 && red[2].abs() < 1e-3, "{red:?}");
    }
}
