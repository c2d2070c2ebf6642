//! A beam pattern at one wavelength.

use super::array::Factor;
use super::bessel::jinc;
use super::{Array, NOTHING_DB, Row};
use ground::units::amplitude_from_db;
use std::f64::consts::{FRAC_PI_2, PI};

/// The pattern of an aperture in one plane at one wavelength.
///
/// It is a function of `u = sin(psi) - sin(psi0)`, where psi is the angle off the axis in that plane and psi0 the
/// steering angle; sines may be direction cosines along the aperture. Shapes given by angles (Gaussian, box, table)
/// take `asin(u)` as their angle, 90 degrees beyond 1, so that they widen when steered as apertures do. Directions
/// behind the aperture (psi beyond 90 degrees) mirror those in front of it: the caller knows whether there is a baffle
/// between them.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamPattern(PatternShape);

#[derive(Clone, Debug, PartialEq)]
enum PatternShape {
    /// Length, wavelengths.
    Line { length: f64 },
    /// Half of the full width, rad.
    Gaussian { half: f64 },
    /// Likewise.
    Box { half: f64 },
    /// Circumference, wavelengths, which is ka.
    Piston { ka: f64 },
    /// An array and the length of its elements, wavelengths.
    Array { factor: Factor, element: f64 },
    /// Angles, rad, in rising order, and dB.
    Table { rows: Vec<[f64; 2]> },
}

/// Where `sinc(x)^2 = 1/2`, `sinc(x) = sin(pi x) / (pi x)`.
const HALF_SINC: f64 = 0.442_946_470_689_452_2;
/// Where `(2 J1(x) / x)^2 = 1/2`.
const HALF_JINC: f64 = 1.616_339_948_310_703;
/// Steps within a lobe of an aperture when searching for lobes: one is within 1/128 of a lobe's width of its peak.
const STEPS: f64 = 64.0;
/// Part of the power at a peak that is certain to be seen: `sinc(1/128)^2` is 0.9998 (of a Chebyshev lobe 0.9994).
const SEEN: f64 = 0.999;

impl BeamPattern {
    /// A uniform line of `length` wavelengths.
    pub(super) fn line(length: f64) -> BeamPattern {
        BeamPattern(PatternShape::Line { length })
    }

    /// A uniform line whose full width at half the power is `width`, rad.
    pub(super) fn line_of_width(width: f64) -> BeamPattern {
        BeamPattern::line(HALF_SINC / (0.5 * width).sin())
    }

    pub(super) fn gaussian(width: f64) -> BeamPattern {
        BeamPattern(PatternShape::Gaussian { half: 0.5 * width })
    }

    pub(super) fn boxed(width: f64) -> BeamPattern {
        BeamPattern(PatternShape::Box { half: 0.5 * width })
    }

    /// A piston of `diameter` wavelengths.
    pub(super) fn piston(diameter: f64) -> BeamPattern {
        BeamPattern(PatternShape::Piston { ka: PI * diameter })
    }

    /// A piston whose full width at half the power is `width`, rad.
    pub(super) fn piston_of_width(width: f64) -> BeamPattern {
        BeamPattern(PatternShape::Piston { ka: HALF_JINC / (0.5 * width).sin() })
    }

    pub(super) fn array(array: &Array, wavelength_m: f64) -> BeamPattern {
        let element = array.element_m.unwrap_or(0.0) / wavelength_m;
        BeamPattern(PatternShape::Array { factor: Factor::new(array, wavelength_m), element })
    }

    pub(super) fn table(rows: &[Row]) -> BeamPattern {
        let mut own: Vec<[f64; 2]> = rows.iter().map(|row| [row.angle_deg.to_radians(), row.db]).collect();
        if own.first().is_some_and(|&[angle, _]| angle >= 0.0) {
            let mirrored = own.iter().rev().filter(|&&[angle, _]| angle > 0.0).map(|&[angle, db]| [-angle, db]);
            own = mirrored.chain(own.iter().copied()).collect();
        }
        BeamPattern(PatternShape::Table { rows: own })
    }

    /// Signed amplitude at `u`, the sine of the angle off the axis, of an unsteered beam; 1 on the axis (for a table:
    /// in its strongest direction).
    pub fn amplitude(&self, u: f64) -> f64 {
        self.amplitude_steered(u, 0.0)
    }

    /// Signed amplitude in the direction whose sine is `sin`, of a beam steered to the direction whose sine is `sin0`:
    /// a function of their difference, except that the elements of an array do not turn with the beam, so that its
    /// amplitude on its axis is that of the elements there.
    pub fn amplitude_steered(&self, sin: f64, sin0: f64) -> f64 {
        let u = sin - sin0;
        match &self.0 {
            PatternShape::Line { length } => sinc(length * u),
            // Half the power at half the width.
            PatternShape::Gaussian { half } => (-0.5 * (angle(u) / half).powi(2)).exp2(),
            PatternShape::Box { half } => {
                if angle(u).abs() <= *half {
                    1.0
                } else {
                    amplitude_from_db(NOTHING_DB)
                }
            }
            PatternShape::Piston { ka } => jinc(ka * u),
            PatternShape::Array { factor, element } => factor.amplitude(u) * sinc(element * sin),
            PatternShape::Table { rows } => amplitude_from_db(level(rows, angle(u))),
        }
    }

    /// Full width at half the power of an unsteered beam, rad; pi if its power is above that everywhere. For a table
    /// the width about its strongest row.
    pub fn width(&self) -> f64 {
        let both_sides = |sin: f64| if sin < 1.0 { 2.0 * sin.asin() } else { PI };
        match &self.0 {
            PatternShape::Line { length } => both_sides(HALF_SINC / length),
            PatternShape::Piston { ka } => both_sides(HALF_JINC / ka),
            PatternShape::Gaussian { half } | PatternShape::Box { half } => 2.0 * half,
            PatternShape::Array { factor, .. } => {
                let power = |u: f64| self.amplitude(u).powi(2) - 0.5;
                let step = 1.0 / (STEPS * factor.length());
                let mut outside = step;
                while outside < 1.0 && power(outside) >= 0.0 {
                    outside += step;
                }
                if power(outside.min(1.0)) < 0.0 { both_sides(crossing(power, 0.0, outside.min(1.0))) } else { PI }
            }
            PatternShape::Table { rows } => {
                let peak = rows.iter().enumerate().max_by(|(_, a), (_, b)| a[1].total_cmp(&b[1])).map_or(0, |(i, _)| i);
                let half = 10.0 * 0.5f64.log10();
                let right = rows[peak..].iter().copied();
                let left = rows[..(peak + 1).min(rows.len())].iter().rev().copied();
                (first_below(right, half) - first_below(left, half)).abs()
            }
        }
    }

    /// The u, 0 to 1, beyond which an unsteered beam stays below `power` (of 1 on its axis) on both sides; 1 if it does
    /// not. It may be too large by part of a sidelobe that just stays below; for an array whose elements have a length
    /// it is the smaller of the values for elements and array.
    pub fn extent(&self, power: f64) -> f64 {
        self.extent_within(power, 1.0)
    }

    /// [`BeamPattern::extent`] among u up to `reach`: a beam steered to psi0 reaches u up to `1 + |sin(psi0)|`, where
    /// an array may have grating lobes.
    pub fn extent_within(&self, power: f64, reach: f64) -> f64 {
        if power >= 1.0 {
            return 0.0;
        }
        if power <= 0.0 || power.is_nan() {
            return reach;
        }
        let level_db = 10.0 * power.log10();
        let sine = |angle: f64| if angle < FRAC_PI_2 { angle.sin().min(reach) } else { reach };
        match &self.0 {
            PatternShape::Line { length } => line_extent(*length, power, reach),
            PatternShape::Piston { ka } => {
                // |J1(x)|^2 < 1.3 * 2 / (pi x) where x > 1, which is less than one lobe off.
                let envelope = (8.0 * 1.3 / (PI * power)).cbrt().max(4.0);
                outermost(|x| jinc(x).powi(2), envelope.min(reach * ka), PI, power) / ka
            }
            PatternShape::Array { factor, element } => {
                // Every period has a main lobe.
                let found = outermost(|u| factor.amplitude(u).powi(2), reach, factor.length().recip(), power);
                found.min(line_extent(*element, power, reach))
            }
            PatternShape::Gaussian { half } => sine(half * (-power.log2()).sqrt()),
            _ if level_db <= NOTHING_DB => reach,
            PatternShape::Box { half } => sine(*half),
            PatternShape::Table { rows } => {
                let strong = |i: &usize| rows[*i][1] >= level_db;
                let (Some(first), Some(last)) = ((0..rows.len()).find(strong), (0..rows.len()).rfind(strong)) else {
                    return 0.0;
                };
                let left = first_below(rows[..=first].iter().rev().copied(), level_db);
                let right = first_below(rows[last..].iter().copied(), level_db);
                sine(left.abs().max(right.abs()))
            }
        }
    }

    /// Width of its finest structure in u, 1e-7 to 1.
    pub(super) fn detail(&self) -> f64 {
        let detail = match &self.0 {
            PatternShape::Line { length } => length.recip(),
            PatternShape::Gaussian { half } | PatternShape::Box { half } => *half,
            PatternShape::Piston { ka } => PI / ka,
            PatternShape::Array { factor, element } => factor.length().max(*element).recip(),
            PatternShape::Table { rows } => rows.windows(2).map(|pair| pair[1][0] - pair[0][0]).fold(1.0, f64::min),
        };
        // Returns a number even for values that no check has seen.
        if detail.is_nan() { 1.0 } else { detail.clamp(1e-7, 1.0) }
    }

    /// Whether it is that of an array with so many grating lobes that there is little between them.
    pub(super) fn is_sparse(&self) -> bool {
        const LEAST: f64 = 1.0 / 8.0;
        matches!(&self.0, PatternShape::Array { factor, .. } if factor.spacing() < LEAST)
    }

    /// Edges in u, rising from -1 to 1, of panels to integrate over: one for each lobe about the main one and, for
    /// arrays, about each grating lobe; increasingly wide away from these.
    pub(super) fn panels(&self) -> Vec<f64> {
        /// Panels of one lobe each on either side of a main lobe.
        const NARROW: u32 = 64;
        /// Width over that of the previous panel.
        const WIDER: f64 = 1.05;
        const WIDEST: f64 = 0.125;
        const EVEN: u32 = 2048;
        let spacing = match &self.0 {
            PatternShape::Array { factor, .. } => factor.spacing(),
            PatternShape::Table { rows } => {
                let rows = rows.iter().map(|row| row[0].clamp(-FRAC_PI_2, FRAC_PI_2).sin());
                let mut edges: Vec<f64> = rows.chain([-1.0, 0.0, 1.0]).collect();
                edges.sort_by(f64::total_cmp);
                return edges;
            }
            _ => f64::INFINITY,
        };
        if self.is_sparse() {
            return (0..=EVEN).map(|edge| 2.0 * f64::from(edge) / f64::from(EVEN) - 1.0).collect();
        }
        // On one side of a main lobe, half way to the next.
        let (mut side, mut width) = (vec![0.0], self.detail());
        let end = (0.5 * spacing).min(2.0);
        while let Some(&last) = side.last().filter(|&&last| last < end) {
            side.push(f64::min(last + width, end));
            if side.len() > NARROW as usize {
                width = (width * WIDER).min(WIDEST);
            }
        }
        let reach = if spacing.is_finite() { (1.0 / spacing).ceil() as i32 } else { 0 };
        let about = |lobe: i32| if lobe == 0 { 0.0 } else { f64::from(lobe) * spacing };
        let left = |lobe: i32| side.iter().rev().map(move |off| about(lobe) - off);
        let right = |lobe: i32| side.iter().map(move |off| about(lobe) + off);
        let all = (-reach..=reach).flat_map(|lobe| left(lobe).chain(right(lobe)));
        let inner: Vec<f64> = all.filter(|u| u.abs() < 1.0).collect();
        [-1.0].into_iter().chain(inner).chain([1.0]).collect()
    }
}

/// `sin(pi x) / (pi x)`.
fn sinc(x: f64) -> f64 {
    let x = PI * x;
    if x.abs() < 1e-8 { 1.0 } else { x.sin() / x }
}

/// Angle whose sine is `u`, rad, 90 degrees beyond 1.
fn angle(u: f64) -> f64 {
    u.clamp(-1.0, 1.0).asin()
}

/// Level at `angle` by rows of angle and dB, linear between them.
fn level(rows: &[[f64; 2]], angle: f64) -> f64 {
    let (below, above) = rows.split_at(rows.partition_point(|row| row[0] < angle));
    match (below.last(), above.first()) {
        (Some(low), Some(high)) => low[1] + (high[1] - low[1]) * (angle - low[0]) / (high[0] - low[0]),
        (None, Some(&[first, db])) if first == angle => db,
        _ => NOTHING_DB,
    }
}

/// Angle at which the level, along rows that start at `db` or above, first falls below it; that of the last row if it
/// does not.
fn first_below(rows: impl Iterator<Item = [f64; 2]>, db: f64) -> f64 {
    let mut last: Option<[f64; 2]> = None;
    for row in rows {
        match last {
            Some([angle, level]) if row[1] < db => {
                return angle + (row[0] - angle) * (level - db) / (level - row[1]);
            }
            _ => last = Some(row),
        }
    }
    last.map_or(0.0, |[angle, _]| angle)
}

/// [`BeamPattern::extent_within`] of a uniform line of `length` wavelengths.
fn line_extent(length: f64, power: f64, reach: f64) -> f64 {
    if length == 0.0 {
        return reach;
    }
    // |sinc(x)| <= 1 / (pi x).
    let envelope = (PI * power.sqrt()).recip().max(1.0);
    outermost(|x| sinc(x).powi(2), envelope.min(reach * length), 1.0, power) / length
}

/// The greatest x up to `top` where `f`, 1 at 0 and with lobes `lobe` wide, comes within a step of `power`; `top` if it
/// does so there.
fn outermost(f: impl Fn(f64) -> f64, top: f64, lobe: f64, power: f64) -> f64 {
    let seen = SEEN * power;
    let step = lobe / STEPS;
    let mut above = top;
    if f(top) >= seen {
        return top;
    }
    loop {
        let below = (above - step).max(0.0);
        if below == 0.0 || f(below) >= seen {
            return crossing(|x| f(x) - seen, below, above);
        }
        above = below;
    }
}

/// Where `f` changes from at least 0 at `from` to below 0 at `to`.
fn crossing(f: impl Fn(f64) -> f64, mut from: f64, mut to: f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (from + to);
        if f(middle) >= 0.0 {
            from = middle;
        } else {
            to = middle;
        }
    }
    to
}
