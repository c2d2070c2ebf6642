//! Arrays of transmitting and receiving elements.

use crate::LIGHT_SPEED;
use crate::pattern::ElementPattern;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use ground::read::yaml::inner;
use ground::rng::{Draw, Rng};
use num_complex::Complex32;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use std::f64::consts::TAU;

/// Most elements that transmit, and that receive.
const MOST_ELEMENTS: usize = 1024;

/// `array`: the elements of a radar. Places are `[left, up]` in half wavelengths, seen from behind the radar: along its
/// y and z axes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ArraySpec {
    /// Frequency whose half wavelength places are in, GHz, 1 to 300; without it that of the waveform.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design_ghz: Option<f64>,
    /// Transmitting elements, in the order in which they transmit.
    #[serde(default)]
    pub tx: ArrayElements,
    /// Receiving elements.
    #[serde(default)]
    pub rx: ArrayElements,
    /// Pattern of each transmitting element.
    #[serde(default)]
    pub tx_pattern: ElementPattern,
    /// Pattern of each receiving element.
    #[serde(default)]
    pub rx_pattern: ElementPattern,
    /// Direction of the electric field, of waves transmitted and received.
    #[serde(default)]
    pub polarisation: Polarisation,
    /// Standard deviation of the gain from channel to channel that is left after calibration, dB, 0 to 20.
    #[serde(default = "gain_error")]
    pub gain_error_db: f64,
    /// Likewise of the phase, degrees, 0 to 360.
    #[serde(default = "phase_error")]
    pub phase_error_deg: f64,
}

/// ArrayElements, as written in a file: a list of places, or a section that makes a grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum ArrayElements {
    /// Their places.
    List(Vec<[f64; 2]>),
    /// Rows of elements, one above the other.
    Grid(ElementGrid),
}

/// Rows of equally spaced elements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ElementGrid {
    /// ArrayElements of a row, 1 to 1024.
    pub count: u32,
    /// From one to the next, to the left, half wavelengths, above 0 to 10,000.
    #[serde(default = "one")]
    pub step: f64,
    /// Number of rows, 1 to 1024.
    #[serde(default = "one_row")]
    pub rows: u32,
    /// From one row to the next, upwards, half wavelengths, above 0 to 10,000.
    #[serde(default = "one")]
    pub row_step: f64,
    /// Place of the first element.
    #[serde(default)]
    pub at: [f64; 2],
}

/// Direction of the electric field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarisation {
    /// Upright.
    #[default]
    Vertical,
    /// Level.
    Horizontal,
}

fn gain_error() -> f64 {
    0.5
}

fn phase_error() -> f64 {
    5.0
}

fn one() -> f64 {
    1.0
}

fn one_row() -> u32 {
    1
}

impl Default for ArrayElements {
    /// One, at the reference point.
    fn default() -> Self {
        ArrayElements::List(vec![[0.0; 2]])
    }
}

impl<'de> Deserialize<'de> for ArrayElements {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Value::deserialize(deserializer)? {
            list @ Value::Array(_) => inner(&list).map(ArrayElements::List),
            section => inner(&section).map(ArrayElements::Grid),
        }
    }
}

impl ArrayElements {
    /// Number of elements.
    pub fn len(&self) -> usize {
        match self {
            ArrayElements::List(places) => places.len(),
            ArrayElements::Grid(grid) => (grid.count as usize).saturating_mul(grid.rows as usize),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Places of all, `[left, up]`, half wavelengths; those of a grid row by row.
    pub fn places(&self) -> Vec<[f64; 2]> {
        match self {
            ArrayElements::List(places) => places.clone(),
            ArrayElements::Grid(grid) => {
                let row = |row: u32| {
                    let up = grid.at[1] + f64::from(row) * grid.row_step;
                    (0..grid.count).map(move |index| [grid.at[0] + f64::from(index) * grid.step, up])
                };
                (0..grid.rows).flat_map(row).collect()
            }
        }
    }

    fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        if let ArrayElements::Grid(grid) = self {
            bounds.within(format_args!("{key}.count"), f64::from(grid.count), 1.0, MOST_ELEMENTS as f64)?;
            bounds.within(format_args!("{key}.rows"), f64::from(grid.rows), 1.0, MOST_ELEMENTS as f64)?;
            let step = |name: &str| format!("{key}.{name}");
            bounds.number(step("step"), grid.step, [1e-6, 1e4], "above 0 to 10000")?;
            bounds.number(step("row_step"), grid.row_step, [1e-6, 1e4], "above 0 to 10000")?;
        }
        let count = self.len();
        if !(1..=MOST_ELEMENTS).contains(&count) {
            return Err(Error::invalid(key, format!("{count} elements"), format!("1 to {MOST_ELEMENTS}")));
        }
        let places = self.places();
        match self {
            ArrayElements::Grid(grid) => {
                bounds.within(format_args!("{key}.at[0]"), grid.at[0], -1e5, 1e5)?;
                bounds.within(format_args!("{key}.at[1]"), grid.at[1], -1e5, 1e5)?;
            }
            ArrayElements::List(places) => {
                for (index, place) in places.iter().enumerate() {
                    for (axis, value) in place.iter().enumerate() {
                        bounds.within(format_args!("{key}[{index}][{axis}]"), *value, -1e5, 1e5)?;
                    }
                }
            }
        }
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| places[a][0].total_cmp(&places[b][0]).then(places[a][1].total_cmp(&places[b][1])));
        match order.windows(2).find(|pair| places[pair[0]] == places[pair[1]]) {
            Some(pair) => {
                let found = format!("at [{}, {}] twice", places[pair[0]][0], places[pair[0]][1]);
                let (first, second) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
                Err(Error::invalid(format!("{key}[{second}]"), found, format!("a place other than that of [{first}]")))
            }
            None => Ok(()),
        }
    }
}

impl ArraySpec {
    /// Checks that all values are within their allowed ranges, and that no two elements coincide.
    ///
    /// # Errors
    /// Names the first value that is not allowed.
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        bounds.within("array.design_ghz", self.design_ghz, 1.0, 300.0)?;
        self.tx.check("array.tx", bounds)?;
        self.rx.check("array.rx", bounds)?;
        self.tx_pattern.check("array.tx_pattern", bounds)?;
        self.rx_pattern.check("array.rx_pattern", bounds)?;
        bounds.within("array.gain_error_db", self.gain_error_db, 0.0, 20.0)?;
        bounds.within("array.phase_error_deg", self.phase_error_deg, 0.0, 360.0)
    }

    /// Places of the transmitting and of the receiving elements, m along x, y and z from the reference point, of a radar
    /// of `wavelength` m.
    pub fn places(&self, wavelength: f64) -> [Vec<[f32; 3]>; 2] {
        let half = 0.5 * self.design_ghz.map_or(wavelength, |ghz| LIGHT_SPEED / (1e9 * ghz));
        [&self.tx, &self.rx].map(|elements| {
            elements.places().into_iter().map(|[left, up]| [0.0, (left * half) as f32, (up * half) as f32]).collect()
        })
    }

    /// The virtual array of a radar of `wavelength` m.
    pub fn virtual_array(&self, wavelength: f64) -> VirtualArray {
        let [tx, rx] = self.places(wavelength);
        let sum = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|axis| a[axis] + b[axis]);
        VirtualArray { places: tx.iter().flat_map(|&tx| rx.iter().map(move |&rx| sum(tx, rx))).collect(), wavelength }
    }

    /// What amplitudes of the channels are multiplied by, as calibration left them in the instrument number `seed`.
    pub fn errors(&self, seed: u64) -> Vec<Complex32> {
        let rng = Rng::new(seed, 0);
        let error = |channel: u32| {
            let [gain, phase] = rng.normal_pair(channel, Draw::ArrayError, 0).map(f64::from);
            let amplitude = 10f64.powf(gain * self.gain_error_db / 20.0);
            let (sine, cosine) = (phase * self.phase_error_deg.to_radians()).sin_cos();
            Complex32::new((amplitude * cosine) as f32, (amplitude * sine) as f32)
        };
        (0..(self.tx.len() * self.rx.len()) as u32).map(error).collect()
    }
}

/// The array whose every element, a virtual channel, is a pair of a transmitting and a receiving one: to far targets it
/// looks like an array with elements at the sums of their places that receives waves of twice the path.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VirtualArray {
    /// Places of the channels, m; channel `t * receivers + r` is that of transmitter `t` and receiver `r`.
    pub places: Vec<[f32; 3]>,
    /// Wavelength, m.
    pub wavelength: f64,
}

/// Channels of a [`VirtualArray`] at one height.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayRow {
    /// Their height, m.
    pub up: f32,
    /// Their indices, one for each place, from right to left; of channels that coincide, the first.
    pub channels: Vec<u32>,
}

impl VirtualArray {
    /// Its rows, from the lowest one up.
    pub fn rows(&self) -> Vec<ArrayRow> {
        // Sums of the same places differ by rounding.
        let near = 1e-3 * self.wavelength as f32;
        let mut order: Vec<u32> = (0..self.places.len() as u32).collect();
        let place = |channel: u32| self.places[channel as usize];
        let (left, up) = (|channel: u32| place(channel)[1], |channel: u32| place(channel)[2]);
        order.sort_by(|&a, &b| up(a).total_cmp(&up(b)).then(a.cmp(&b)));
        order
            .chunk_by(|&a, &b| up(b) - up(a) < near)
            .map(|row| {
                let mut channels = row.to_vec();
                channels.sort_by(|&a, &b| left(a).total_cmp(&left(b)).then(a.cmp(&b)));
                let groups = channels.chunk_by(|&a, &b| left(b) - left(a) < near);
                let channels = groups.filter_map(|group| group.iter().min().copied()).collect();
                ArrayRow { up: up(row[0]), channels }
            })
            .collect()
    }

    /// The row with the most places, the lowest of several; empty if there are no channels.
    pub fn azimuth_row(&self) -> ArrayRow {
        let none = ArrayRow { up: 0.0, channels: Vec::new() };
        let longer = |best: ArrayRow, row: ArrayRow| if row.channels.len() > best.channels.len() { row } else { best };
        self.rows().into_iter().fold(none, longer)
    }

    /// Amplitudes of the channels for a wave of amplitude 1 that is scattered from far away in the unit vector
    /// `direction`: `exp(j 2 pi d . p / lambda)`, for the wave is ahead at an element that is nearer.
    pub fn steering(&self, direction: [f64; 3]) -> Vec<Complex32> {
        let amplitude = |place: &[f32; 3]| {
            let along: f64 = (0..3).map(|axis| direction[axis] * f64::from(place[axis])).sum();
            let (sine, cosine) = (TAU * along / self.wavelength).sin_cos();
            Complex32::new(cosine as f32, sine as f32)
        };
        self.places.iter().map(amplitude).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::read::yaml::from_str;

    const WAVELENGTH: f64 = LIGHT_SPEED / 77e9;

    /// Power that a row of `count` elements half a wavelength apart, steered to `to`, receives from the sine `sine`.
    fn power(count: u32, to: f64, sine: f64) -> f64 {
        let array = ArraySpec { rx: from_str("text", &format!("{{count: {count}}}")).unwrap(), ..ArraySpec::default() };
        let array = array.virtual_array(WAVELENGTH);
        let at = |sine: f64| array.steering([(1.0 - sine * sine).sqrt(), sine, 0.0]);
        let sum: Complex32 = at(sine).iter().zip(at(to)).map(|(a, b)| a * b.conj()).sum();
        f64::from(sum.norm_sqr()) / f64::from(count).powi(2)
    }

    /// First null and full width at half power of rows of 12, 86 and 192, degrees: `2/N` rad and `0.8859 2/N` (Van
    /// Trees 2002, 2.4.1), times `1 / cos` of the direction to which they are steered.
    #[test]
    fn beams_are_as_wide_as_their_arrays() {
        for (count, null, width) in [(12, 9.549_30, 8.459_72), (86, 1.332_46, 1.180_43), (192, 0.596_831, 0.528_7)] {
            let degrees = |sine: f64| sine.to_degrees();
            let sine = 2.0 / f64::from(count);
            assert!((degrees(sine) - null).abs() < 1e-4, "{count}");
            assert!(power(count, 0.0, sine) < 1e-9, "{count}: no null there");
            for to in [0.0, 0.5] {
                // In the sine, a beam is the same wherever it is steered to.
                let half: f64 = 0.5 * f64::to_radians(width);
                let level = power(count, to, to + half);
                assert!((level - 0.5).abs() < 4e-3, "{count}, steered to {to}: {level}");
            }
        }
        // Half a wavelength apart: nothing is ambiguous; one whole: 30 degrees are straight ahead again.
        assert!(power(12, -1.0, 0.7) < 0.05);
        let wide = ArraySpec { rx: from_str("text", "{count: 12, step: 2}").unwrap(), ..ArraySpec::default() };
        let wide = wide.virtual_array(WAVELENGTH);
        let sum: Complex32 = wide.steering([0.0, 1.0, 0.0]).iter().sum();
        assert!((sum.norm() - 12.0).abs() < 1e-3);
    }

    /// Places of a public cascade (TI MMWCAS-RF-EVM: 12 TX of which 9 in a row, 16 RX in four groups), which its design
    /// guide (TIDUEN5A) counts 86 azimuth places of.
    #[test]
    fn a_cascade_has_86_places_in_azimuth() {
        let cascade: ArraySpec = from_str(
            "text",
            "{design_ghz: 76.8, tx: [[11, 6], [10, 4], [9, 1], [32, 0], [28, 0], [24, 0], [20, 0], [16, 0], [12, 0], \
             [8, 0], [4, 0], [0, 0]], rx: [[11, 0], [12, 0], [13, 0], [14, 0], [50, 0], [51, 0], [52, 0], [53, 0], \
             [46, 0], [47, 0], [48, 0], [49, 0], [0, 0], [1, 0], [2, 0], [3, 0]]}",
        )
        .unwrap();
        cascade.check(&mut Bounds::none()).unwrap();
        let array = cascade.virtual_array(WAVELENGTH);
        assert_eq!((array.places.len(), array.azimuth_row().channels.len()), (192, 86));
        assert_eq!(array.rows().len(), 4);
        let lefts: Vec<f32> = array.azimuth_row().channels.iter().map(|&c| array.places[c as usize][1]).collect();
        assert!(lefts.is_sorted());
    }

    #[test]
    fn a_target_to_the_left_is_ahead_in_channels_to_the_left() {
        let array = ArraySpec { rx: from_str("text", "{count: 2}").unwrap(), ..ArraySpec::default() };
        let steering = array.virtual_array(WAVELENGTH).steering([0.8, 0.6, 0.0]);
        // Half a wavelength of path times the sine: 0.6 pi.
        assert!((steering[1] / steering[0] - Complex32::from_polar(1.0, 0.6 * std::f32::consts::PI)).norm() < 1e-5);
    }

    #[test]
    fn elements_that_coincide_are_refused() {
        let error = |text: &str| {
            let array: ArraySpec = from_str("text", text).unwrap();
            array.check(&mut Bounds::none()).unwrap_err().to_string()
        };
        assert_eq!(
            error("rx: [[0, 0], [1, 0], [0, 0]]"),
            "array.rx[2] is at [0, 0] twice; allowed: a place other than that of [0]"
        );
        assert_eq!(error("tx: []"), "array.tx is 0 elements; allowed: 1 to 1024");
        assert!(error("rx: {count: 1000, rows: 1000}").contains("allowed: 1 to 1024"));
        assert!(error("rx: {count: 4, step: 0}").contains("array.rx.step"));
        assert!(error("{rx: {count: 4}, phase_error_deg: -1}").contains("array.phase_error_deg"));
        let unknown = from_str::<ArraySpec>("text", "rx: {count: 4, steps: 1}").unwrap_err().to_string();
        assert!(unknown.contains("steps"), "{unknown}");
    }

    #[test]
    fn errors_are_those_of_the_instrument() {
        let array = ArraySpec { rx: from_str("text", "{count: 1000}").unwrap(), ..from_str("text", "{}").unwrap() };
        let errors = array.errors(7);
        assert_eq!(errors, array.errors(7));
        assert_ne!(errors, array.errors(8));
        let spread = |value: &dyn Fn(&Complex32) -> f64| {
            (errors.iter().map(|error| value(error).powi(2)).sum::<f64>() / 1000.0).sqrt()
        };
        // Of a thousand: the deviation of the standard deviation is 2.2 percent.
        assert!((spread(&|error| 20.0 * f64::from(error.norm()).log10()) / 0.5 - 1.0).abs() < 0.1);
        assert!((spread(&|error| f64::from(error.arg()).to_degrees()) / 5.0 - 1.0).abs() < 0.1);
        let perfect = ArraySpec { gain_error_db: 0.0, phase_error_deg: 0.0, ..array };
        assert!(perfect.errors(7).iter().all(|&error| error == Complex32::ONE));
    }
}
