//! Streams to channels: which part of what a receiver hears is whose.

use crate::cube::RadarCube;
use crate::plan::{RadarPlan, hadamard};
use crate::waveform::{Multiplex, RadarWaveform};
use ground::parallel;
use num_complex::Complex32;
use std::f64::consts::TAU;

/// By how many standard deviations of the noise the bands of all transmitters must stand out from those that are left
/// over before the velocity of an echo is taken as resolved.
const STANDS_OUT: f32 = 4.0;

impl RadarPlan {
    /// The channels of `streams`.
    ///
    /// `tdm`: they are the streams. `bpm`: phases by which the Doppler shift of a row turns from code word to code word
    /// are undone, then the codes. `ddm`: rows are moved back, so that an echo is in the row of its velocity in all
    /// channels. It is then also in other rows, where each channel has the signal of another transmitter, or none. Where
    /// the bands that are left over show which of these rows is right, the others are attenuated to the level in the
    /// former.
    ///
    /// # Panics
    /// If the streams are not those of [`RadarPlan::silent_streams`].
    pub fn decode(&self, streams: RadarCube) -> RadarCube {
        assert_eq!(streams.channels, self.streams.len(), "the streams are of another radar");
        match &self.waveform {
            RadarWaveform::Fmcw(fmcw) if !self.one_each() => match (fmcw.multiplex, fmcw.bands) {
                (Multiplex::Bpm, _) => self.decode_words(&streams),
                (Multiplex::Ddm, Some(bands)) => self.decode_bands(&streams, bands as usize),
                _ => streams,
            },
            _ => streams,
        }
    }

    fn channels(&self) -> RadarCube {
        let channels = self.array.places.len();
        let cells = vec![Complex32::ZERO; channels * self.range.cells * self.velocity.cells];
        RadarCube { axes: self.axes, channels, cells }
    }

    fn decode_words(&self, streams: &RadarCube) -> RadarCube {
        let (receivers, width, rows) = (self.receivers.len(), self.range.cells, self.velocity.cells);
        let words = streams.channels / receivers;
        let mut channels = self.channels();
        parallel::for_each_chunk(&mut channels.cells, width * rows, |channel, cells| {
            let (transmitter, receiver) = (channel / receivers, channel % receivers);
            for word in 0..words {
                let code = hadamard(word, transmitter) / words as f32;
                // All launches of a word are at its time.
                let time = self.launches[self.streams[word * receivers][0].launch].time;
                let from = &streams.cells[(word * receivers + receiver) * width * rows..][..width * rows];
                let lines = cells.chunks_exact_mut(width).zip(from.chunks_exact(width));
                for (row, (cells, from)) in lines.enumerate() {
                    let shift = (row as f64 - (rows / 2) as f64) / (rows as f64 * self.repetition);
                    let (sine, cosine) = (TAU * shift * time).sin_cos();
                    let factor = Complex32::new(cosine as f32, sine as f32) * code;
                    for (cell, from) in cells.iter_mut().zip(from) {
                        *cell += factor * from;
                    }
                }
            }
        });
        channels
    }

    fn decode_bands(&self, streams: &RadarCube, bands: usize) -> RadarCube {
        let (receivers, width, rows) = (self.receivers.len(), self.range.cells, self.velocity.cells);
        let (transmitters, slab, band) = (self.transmitters.len(), width * rows, rows / bands);
        let gains = self.band_gains(streams, bands);
        let mut channels = self.channels();
        parallel::for_each_chunk(&mut channels.cells, slab, |channel, cells| {
            let (transmitter, receiver) = (channel / receivers, channel % receivers);
            let from = &streams.cells[receiver * slab..(receiver + 1) * slab];
            for (row, cells) in cells.chunks_exact_mut(width).enumerate() {
                let (found, sign) = match row + transmitter * band {
                    found if found >= rows => (found - rows, self.velocity.wrap),
                    found => (found, 1.0),
                };
                for (cell, value) in cells.iter_mut().enumerate() {
                    let at = found * width + cell;
                    let (right, gain) = gains[(row % band) * width + cell];
                    // Its band is one of the right row's transmitters.
                    let heard = (found / band + bands - right as usize % bands) % bands < transmitters;
                    let wrong = right != UNRESOLVED && row / band != right as usize && heard;
                    let powers = if wrong { gain / self.power(streams, at).max(f32::MIN_POSITIVE) } else { 1.0 };
                    *value = from[at] * (sign * powers.min(1.0).sqrt());
                }
            }
        });
        channels
    }

    /// Power of all receivers in a cell.
    fn power(&self, streams: &RadarCube, at: usize) -> f32 {
        let slab = self.range.cells * self.velocity.cells;
        (0..self.receivers.len()).map(|receiver| streams.cells[receiver * slab + at].norm_sqr()).sum()
    }

    /// For each row of a band and each cell: the band in which the strongest echo is that of the first transmitter, or
    /// [`UNRESOLVED`], and the mean power in the bands that are left over.
    fn band_gains(&self, streams: &RadarCube, bands: usize) -> Vec<(u32, f32)> {
        let (width, band, transmitters) = (self.range.cells, self.velocity.cells / bands, self.transmitters.len());
        let empty = bands - transmitters;
        let mut gains = vec![(UNRESOLVED, 0.0); band * width];
        if empty == 0 {
            return gains;
        }
        let looks = self.receivers.len() as f32;
        let deviation = (1.0 / (looks * transmitters as f32) + 1.0 / (looks * empty as f32)).sqrt();
        let least = 1.0 + STANDS_OUT * deviation;
        parallel::for_each_chunk(&mut gains, width, |row, gains| {
            let mut powers = vec![0.0; bands];
            for (cell, gain) in gains.iter_mut().enumerate() {
                for (index, power) in powers.iter_mut().enumerate() {
                    *power = self.power(streams, (index * band + row) * width + cell);
                }
                let total: f32 = powers.iter().sum();
                let sum = |first: usize| (0..transmitters).map(|index| powers[(first + index) % bands]).sum::<f32>();
                let (mut best, mut most) = (0, f32::NEG_INFINITY);
                for first in 0..bands {
                    let sum = sum(first);
                    if sum > most {
                        (best, most) = (first, sum);
                    }
                }
                let left = (total - most).max(0.0) / empty as f32;
                if most / transmitters as f32 > least * left {
                    *gain = (best as u32, left);
                }
            }
        });
        gains
    }
}

/// In place of a band: the velocity is not resolved.
const UNRESOLVED: u32 = u32::MAX;
