//! What bodies send back that have tubes of their own: of smooth facets in phase, of all else as energies.

use super::parts::{Parts, Scatter};
use super::ping::{Echoes, Insonification, MOST_BINS, NO_RAY, PingEcho};
use crate::emitter::FAINT;
use crate::ground::math::{LOG2_PER_DB, exp2};
use crate::trace::{Arrival, Direct, Stand, TubeHit};
use echocast_kernels::echo;
use glam::Vec3;
use std::f64::consts::{PI, TAU};

/// Number of the way of what tubes find, after those of rays.
const OWN_WAY: u32 = 2;

/// What one tube adds to one cell, or several together.
#[derive(Clone, Copy)]
pub(crate) struct Share {
    /// Who hears it (index of the [`crate::emitter::Hearing`]), and in which bin; of a smooth facet or not.
    hearing: u32,
    bin: u32,
    smooth: bool,
    /// Energy, or an amplitude with its phase.
    energy: f32,
    amplitude: [f32; 2],
    /// The loudest of its tubes, and its energy.
    loudest: u32,
    most: f32,
}

/// Tubes to the sides of what is seen of a body, by half their lengths, m: enough for the law of its surface, or where it
/// is smooth for the phases of its echo.
pub(crate) fn grid(stand: &Stand, wavelength: f64, sides: [f64; 2]) -> [usize; 2] {
    /// Tubes to a body that is not smooth.
    const TUBES: f64 = 100.0;
    let [long, short] = sides.map(|side| side.max(1e-9));
    if !stand.body.mirrors {
        let ratio = (long / short).sqrt();
        let columns = (TUBES.sqrt() * ratio).round().clamp(1.0, TUBES);
        return [columns as usize, (TUBES / columns).round().max(1.0) as usize];
    }
    /// Of the sides of a facet that is seen aslant.
    const LEAST: f64 = 8.0;
    let columns = smooth_columns(stand.radius(), wavelength).max(32.0);
    let rows = smooth_columns(short, wavelength).max((columns * short / long).ceil());
    [columns as usize, rows.clamp(LEAST, columns) as usize]
}

/// Tubes side by side that follow the phase of a sphere of this radius: three in the radius of its Fresnel zone,
/// `sqrt(a wavelength / 2)`.
fn smooth_columns(radius: f64, wavelength: f64) -> f64 {
    (6.0 * (2.0 * radius / wavelength).sqrt()).ceil()
}

/// Whether a smooth body of this radius is small enough to answer in phase.
pub(crate) fn answers_in_phase(radius: f64, wavelength: f64) -> bool {
    /// What a ping can spend on one body.
    const MOST: f64 = 128.0;
    smooth_columns(radius, wavelength) <= MOST
}

impl Insonification<'_> {
    /// Finds what a body sends back to the straight `way` to its middle, by what its tubes meet. `shares` is memory.
    ///
    /// Smooth facets answer by Kirchhoff's integral in the form of shooting and bouncing rays (Ling, Chou and Lee 1989):
    /// each tube of cross-section `A` adds the amplitude `R A / wavelength` to the square root of the target strength,
    /// with the phase of its path, and as the phase changes across what it covers, a `sinc` for each side; where sound
    /// does not leave as from a mirror, times the mean of the sines of the grazing angles over that of arrival. A plate
    /// met head-on has `20 log(A / wavelength)`, a sphere `20 log(a / 2)` (Urick 1983, table 9.1).
    pub fn answer_body(
        &self,
        Direct { way, .. }: &Direct,
        hits: &[TubeHit],
        shares: &mut Vec<Share>,
        echoes: &mut Echoes,
    ) {
        echoes.clear();
        shares.clear();
        let unaimed = self.source_level * LOG2_PER_DB + self.spread_twice(way) - 2.0 * LOG2_PER_DB * way.loss;
        let sensor_from_world = self.rotation.transpose();
        for (number, hit) in (0..).zip(hits) {
            let met = self.met(way, hit);
            let (mut at, heard) = self.seen(met.range, hit.back);
            if let Some(coupling) = &self.coupling {
                at += coupling.shift(&met, hit.launch);
            }
            let at = self.folded(at);
            let smooth = self.backscatter.smooth(self.surfaces, hit.surface);
            let rough = if hit.order == 0 { self.rough(&met, hit, smooth) } else { f32::NEG_INFINITY };
            let [re, im] = if smooth.is_some() { self.mirrored(way, hit) } else { [0.0; 2] };
            for (loud, hearing) in self.transducer.towards(sensor_from_world * hit.launch, heard) {
                if loud <= FAINT {
                    continue;
                }
                let loud = exp2(unaimed + loud);
                let amplitude = loud.sqrt();
                let whole = Share {
                    hearing,
                    bin: 0,
                    smooth: true,
                    energy: 0.0,
                    amplitude: [re * amplitude, im * amplitude],
                    loudest: number,
                    most: (re * re + im * im) * loud,
                };
                if smooth.is_some() && at >= 0.0 {
                    self.share(whole, [at, at], shares);
                }
                if rough > f32::NEG_INFINITY {
                    let energy = loud * exp2(rough);
                    let half = 0.5 * self.reach_of(hit).min(MOST_BINS * self.bin_m);
                    let part = Share { smooth: false, energy, amplitude: [0.0; 2], most: energy, ..whole };
                    self.share(part, [at - half, at + half], shares);
                }
            }
        }
        // In the order of tubes where they are alike: sums must not depend on how they are sorted.
        shares.sort_unstable_by_key(|share| (share.smooth, share.hearing, share.bin, share.loudest));
        shares.dedup_by(|next, sum| {
            let alike = (next.smooth, next.hearing, next.bin) == (sum.smooth, sum.hearing, sum.bin);
            if alike {
                sum.energy += next.energy;
                (0..2).for_each(|part| sum.amplitude[part] += next.amplitude[part]);
                if next.most > sum.most {
                    (sum.most, sum.loudest) = (next.most, next.loudest);
                }
            }
            alike
        });
        if self.speckle.is_none() {
            self.join(shares);
        }
        self.answer_shares(way, hits, shares, echoes);
    }

    /// Gives what answers in phase energies that add up to what its amplitudes do: each the real part of its amplitude with
    /// the sum of all that are heard with it, as far as pulse and beams make them overlap.
    fn join(&self, shares: &mut [Share]) {
        let first = shares.partition_point(|share| !share.smooth);
        for index in first..shares.len() {
            let Share { amplitude: [x, y], .. } = shares[index];
            let overlap = |other: &Share| {
                let bins = self.response.amplitude_at(other.bin.abs_diff(shares[index].bin) as usize);
                if bins == 0.0 { 0.0 } else { bins * self.transducer.overlap(shares[index].hearing, other.hearing) }
            };
            let energy = shares[first..].iter().map(|other| {
                let [re, im] = other.amplitude;
                overlap(other) * (x * re + y * im)
            });
            shares[index].energy = energy.sum::<f32>().max(0.0);
        }
    }

    /// Divides `whole` among the bins from one range to another, m.
    fn share(&self, whole: Share, [from, to]: [f32; 2], shares: &mut Vec<Share>) {
        let [low, high] = [from, to].map(|range| range / self.bin_m);
        if high < 0.0 || low >= self.bins as f32 {
            return;
        }
        let (first, last) = (low.max(0.0) as u32, (high as u32).min(self.bins as u32 - 1));
        let part = 1.0 / (last - first + 1) as f32;
        shares.extend((first..=last).map(|bin| Share { bin, energy: whole.energy * part, ..whole }));
    }

    /// Arrivals and answers of what was shared out.
    fn answer_shares(&self, way: &Arrival, hits: &[TubeHit], shares: &[Share], echoes: &mut Echoes) {
        let Echoes { arrivals, launches, answers, energy, re, im, .. } = echoes;
        let mut parts = Parts::new(energy, re, im);
        for share in shares {
            if share.smooth {
                // Random amplitudes come first.
                parts.finish(self.speckle.as_ref());
            }
            let hit = &hits[share.loudest as usize];
            let range = (share.bin as f32 + 0.5) * self.bin_m;
            launches.push((arrivals.len() as u32, hit.back));
            arrivals.push(self.met(way, hit));
            let first = parts.len();
            answers.push(PingEcho {
                first,
                parts: 1,
                bin: share.bin,
                range,
                reach: 0.0,
                slide: Vec3::ZERO,
                hearing: share.hearing,
            });
            let [x, y] = share.amplitude;
            match &self.speckle {
                None => parts.add(share.energy, [share.energy, 0.0]),
                Some(_) if share.smooth => parts.add(x * x + y * y, [x, y]),
                Some(scatterers) => {
                    let object = self.scatterer(hit.surface, share.hearing, 0, OWN_WAY);
                    let ends = [share.bin as f32, share.bin as f32 + 1.0];
                    let whole = Scatter {
                        bins: [share.bin; 2],
                        ends,
                        share: share.energy * scatterers.roughness(hit.place),
                        least: 0.0,
                        along: hit.place.dot(scatterers.along),
                        slope: 0.0,
                        middle: ends[0],
                        object,
                    };
                    parts.scatter(scatterers, &whole, None);
                }
            }
        }
        parts.finish(self.speckle.as_ref());
    }

    /// What a tube meets near the end of `way`.
    fn met(&self, way: &Arrival, hit: &TubeHit) -> Arrival {
        Arrival {
            ray: NO_RAY,
            surface: hit.surface,
            triangle: hit.triangle,
            corner: hit.corner,
            range: (hit.path * f64::from(way.range) / f64::from(way.path)) as f32,
            path: hit.path as f32,
            loss: way.loss + 0.5 * hit.loss,
            place: hit.place,
            direction: hit.along,
            normal: hit.normal,
            order: hit.order,
            ..*way
        }
    }

    /// log2 of what a tube sends back of what gets to it, m^2, by the law of its surface, without smooth facets.
    fn rough(&self, met: &Arrival, hit: &TubeHit, smooth: Option<f32>) -> f32 {
        let [u, v] = hit.sides;
        let sine = echo::sine(hit.along.into(), hit.normal.into());
        // Of Lambert's law `mu sin^2`, over the sine.
        let law = smooth.map_or_else(|| self.backscatter.log2(self.surfaces, met, sine), |mu| mu + sine.log2());
        law + u.cross(v).length().max(1e-20).log2()
    }

    /// How much the range changes over what a tube covers, m.
    fn reach_of(&self, hit: &TubeHit) -> f32 {
        let towards = echo::towards(hit.along.into(), hit.normal.into());
        hit.sides.map(|side| (side.dot(hit.normal) / towards).powi(2)).iter().sum::<f32>().sqrt()
    }

    /// What a tube adds to the square root of the target strength, m, with its phase.
    fn mirrored(&self, way: &Arrival, hit: &TubeHit) -> [f32; 2] {
        let [u, v] = hit.sides;
        let normal = hit.normal.normalize();
        let towards = hit.along.dot(normal);
        let [arriving, leaving] = [hit.along, hit.straight].map(|direction| direction.dot(normal).abs());
        if arriving < 1e-3 || towards * hit.straight.dot(normal) <= 0.0 {
            return [0.0; 2];
        }
        // Turns of the phase per metre, there and back, by the speed of sound on the way rather than what is believed.
        let per_m = f64::from(self.turns * way.range / way.path);
        // Turns over the sides of what it covers.
        let change = |side: Vec3| {
            let covered = side - hit.along * (side.dot(normal) / towards);
            0.5 * per_m * f64::from(covered.dot(hit.along + hit.straight))
        };
        let sinc = |turns: f64| if turns == 0.0 { 1.0 } else { (PI * turns).sin() / (PI * turns) };
        let last = self.backscatter.reflection_loss(self.surfaces, hit.surface, arriving.into());
        let lost = 10f64.powf(-(f64::from(hit.loss) + last) / 20.0);
        // Half of that is one over the wavelength.
        let amplitude = f64::from(u.cross(v).length())
            * 0.5
            * per_m
            * lost
            * sinc(change(u))
            * sinc(change(v))
            * f64::from(0.5 * (arriving + leaving) / arriving);
        let (sin, cos) = (TAU * (hit.path * per_m).fract()).sin_cos();
        [(amplitude * cos) as f32, (amplitude * sin) as f32]
    }
}
