//! Echoes of bodies with tubes of their own: coherent for smooth facets, as energies for everything else.

use super::echo::{NO_RAY, PingEcho};
use super::echoes::Echoes;
use super::parts::{Scatter, WaitingParts};
use super::ping::{Insonification, MOST_BINS};
use crate::trace::{Arrival, Direct, Stand, TubeHit};
use echocast_kernels::echo;
use emitter::FAINT;
use glam::Vec3;
use ground::math::{LOG2_PER_DB, exp2};
use std::f64::consts::{PI, TAU};

/// Number of the path of what tubes find, after those of rays.
const OWN_WAY: u32 = 2;

/// Contribution of one tube to one cell, or of several together.
#[derive(Clone, Copy)]
pub(crate) struct TubeShare {
    /// Which beams receive it (index of the [`Hearing`](emitter::Hearing)), and in which bin; whether it is from a smooth
    /// facet.
    receiving: u32,
    bin: u32,
    smooth: bool,
    /// Energy, or an amplitude with its phase.
    energy: f32,
    amplitude: [f32; 2],
    /// The strongest of its tubes, and the energy of that.
    strongest: u32,
    most: f32,
}

/// Tubes along the sides of the visible outline of a body, given half their lengths, m: enough for the law of its
/// surface, or where it is smooth for the phases of its echo.
pub fn grid(stand: &Stand, wavelength: f64, sides: [f64; 2]) -> [usize; 2] {
    /// Number of tubes to a body that is not smooth.
    const TUBES: f64 = 100.0;
    let [long, short] = sides.map(|side| side.max(1e-9));
    if !stand.body.mirrors {
        let ratio = (long / short).sqrt();
        let columns = (TUBES.sqrt() * ratio).round().clamp(1.0, TUBES);
        return [columns as usize, (TUBES / columns).round().max(1.0) as usize];
    }
    /// Least number along the short side of a facet that is seen obliquely.
    const LEAST: f64 = 8.0;
    let columns = smooth_columns(stand.radius(), wavelength).max(32.0);
    let rows = smooth_columns(short, wavelength).max((columns * short / long).ceil());
    [columns as usize, rows.clamp(LEAST, columns) as usize]
}

/// Tubes side by side that resolve the phase of a sphere of this radius: three in the radius of its Fresnel zone,
/// `sqrt(a wavelength / 2)`.
fn smooth_columns(radius: f64, wavelength: f64) -> f64 {
    (6.0 * (2.0 * radius / wavelength).sqrt()).ceil()
}

/// Whether a smooth body of this radius is small enough for a coherent echo.
pub(crate) fn has_coherent_echo(radius: f64, wavelength: f64) -> bool {
    /// Columns of tubes that a ping can spend on one body.
    const MOST: f64 = 128.0;
    smooth_columns(radius, wavelength) <= MOST
}

impl Insonification<'_> {
    /// Computes the echoes of a body from the hits of its tubes; `way` is the direct path to its middle, `shares` a
    /// buffer.
    ///
    /// Smooth facets scatter by Kirchhoff's integral in the form of shooting and bouncing rays (Ling, Chou and Lee
    /// 1989): each tube of cross-section `A` adds the amplitude `R A / wavelength` to the square root of the target
    /// strength, with the phase of its path, and as the phase changes across its footprint, a `sinc` for each side;
    /// where sound does not leave specularly, times the mean of the sines of the grazing angles over that of arrival. A
    /// plate at normal incidence has `20 log(A / wavelength)`, a sphere `20 log(a / 2)` (Urick 1983, table 9.1).
    pub fn answer_body(
        &self,
        Direct { way, .. }: &Direct,
        hits: &[TubeHit],
        shares: &mut Vec<TubeShare>,
        echoes: &mut Echoes,
    ) {
        echoes.clear();
        shares.clear();
        let unaimed = self.source_level * LOG2_PER_DB + self.spread_twice(way) - 2.0 * LOG2_PER_DB * way.loss;
        let sensor_from_world = self.rotation.transpose();
        for (number, hit) in (0..).zip(hits) {
            let met = self.met(way, hit);
            let (mut at, received) = self.seen(met.range, hit.back);
            if let Some(coupling) = &self.coupling {
                at += coupling.shift(&met, hit.launch);
            }
            let at = self.folded(at);
            let smooth = self.backscatter.smooth(self.surfaces, hit.surface);
            let rough = if hit.order == 0 { self.rough(&met, hit, smooth) } else { f32::NEG_INFINITY };
            let [re, im] = if smooth.is_some() { self.mirrored(way, hit) } else { [0.0; 2] };
            for (loud, receiving) in self.transducer.towards(sensor_from_world * hit.launch, received) {
                if loud <= FAINT {
                    continue;
                }
                let loud = exp2(unaimed + loud);
                let amplitude = loud.sqrt();
                let whole = TubeShare {
                    receiving,
                    bin: 0,
                    smooth: true,
                    energy: 0.0,
                    amplitude: [re * amplitude, im * amplitude],
                    strongest: number,
                    most: (re * re + im * im) * loud,
                };
                if smooth.is_some() && at >= 0.0 {
                    self.share(whole, [at, at], shares);
                }
                if rough > f32::NEG_INFINITY {
                    let energy = loud * exp2(rough);
                    let half = 0.5 * self.reach_of(hit).min(MOST_BINS * self.bin_m);
                    let part = TubeShare { smooth: false, energy, amplitude: [0.0; 2], most: energy, ..whole };
                    self.share(part, [at - half, at + half], shares);
                }
            }
        }
        // Equal keys in the order of tubes: sums must not depend on how they are sorted.
        shares.sort_unstable_by_key(|share| (share.smooth, share.receiving, share.bin, share.strongest));
        shares.dedup_by(|next, sum| {
            let alike = (next.smooth, next.receiving, next.bin) == (sum.smooth, sum.receiving, sum.bin);
            if alike {
                sum.energy += next.energy;
                (0..2).for_each(|part| sum.amplitude[part] += next.amplitude[part]);
                if next.most > sum.most {
                    (sum.most, sum.strongest) = (next.most, next.strongest);
                }
            }
            alike
        });
        if self.speckle.is_none() {
            self.join(shares);
        }
        self.answer_shares(way, hits, shares, echoes);
    }

    /// Gives coherent shares energies that add up to what their amplitudes do: each is the real part of its product
    /// with the sum of all amplitudes received with it, as far as pulse and beams make them overlap.
    fn join(&self, shares: &mut [TubeShare]) {
        let first = shares.partition_point(|share| !share.smooth);
        for index in first..shares.len() {
            let TubeShare { amplitude: [x, y], .. } = shares[index];
            let overlap = |other: &TubeShare| {
                let bins = self.response.amplitude_at(other.bin.abs_diff(shares[index].bin) as usize);
                if bins == 0.0 { 0.0 } else { bins * self.transducer.overlap(shares[index].receiving, other.receiving) }
            };
            let energy = shares[first..].iter().map(|other| {
                let [re, im] = other.amplitude;
                overlap(other) * (x * re + y * im)
            });
            shares[index].energy = energy.sum::<f32>().max(0.0);
        }
    }

    /// Divides `whole` among the bins from one range to another, m.
    fn share(&self, whole: TubeShare, [from, to]: [f32; 2], shares: &mut Vec<TubeShare>) {
        let [low, high] = [from, to].map(|range| range / self.bin_m);
        if high < 0.0 || low >= self.bins as f32 {
            return;
        }
        let (first, last) = (low.max(0.0) as u32, (high as u32).min(self.bins as u32 - 1));
        let part = 1.0 / (last - first + 1) as f32;
        shares.extend((first..=last).map(|bin| TubeShare { bin, energy: whole.energy * part, ..whole }));
    }

    /// Appends the arrivals and echoes of the `shares`.
    fn answer_shares(&self, way: &Arrival, hits: &[TubeHit], shares: &[TubeShare], echoes: &mut Echoes) {
        let Echoes { arrivals, launches, answers, energy, re, im, .. } = echoes;
        let mut parts = WaitingParts::new(energy, re, im);
        for share in shares {
            if share.smooth {
                // Parts with random amplitudes come first.
                parts.finish(self.speckle.as_ref());
            }
            let hit = &hits[share.strongest as usize];
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
                receiving: share.receiving,
            });
            let [x, y] = share.amplitude;
            match &self.speckle {
                None => parts.add(share.energy, [share.energy, 0.0]),
                Some(_) if share.smooth => parts.add(x * x + y * y, [x, y]),
                Some(scatterers) => {
                    let object = self.scatterer(hit.surface, share.receiving, 0, OWN_WAY);
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

    /// The arrival of a tube that has hit something near the end of `way`.
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

    /// log2 of the backscattering cross-section of a tube's footprint, m^2, by the law of its surface, without smooth
    /// facets.
    fn rough(&self, met: &Arrival, hit: &TubeHit, smooth: Option<f32>) -> f32 {
        let [u, v] = hit.sides;
        let sine = echo::sine(hit.along.into(), hit.normal.into());
        // Lambert's law `mu sin^2`, over the sine.
        let law = smooth.map_or_else(|| self.backscatter.log2(self.surfaces, met, sine), |mu| mu + sine.log2());
        law + u.cross(v).length().max(1e-20).log2()
    }

    /// Change of the range over the footprint of a tube, m.
    fn reach_of(&self, hit: &TubeHit) -> f32 {
        let towards = echo::towards(hit.along.into(), hit.normal.into());
        hit.sides.map(|side| (side.dot(hit.normal) / towards).powi(2)).iter().sum::<f32>().sqrt()
    }

    /// What a tube adds to the square root of the target strength, m: a complex amplitude.
    fn mirrored(&self, way: &Arrival, hit: &TubeHit) -> [f32; 2] {
        let [u, v] = hit.sides;
        let normal = hit.normal.normalize();
        let towards = hit.along.dot(normal);
        let [arriving, leaving] = [hit.along, hit.straight].map(|direction| direction.dot(normal).abs());
        if arriving < 1e-3 || towards * hit.straight.dot(normal) <= 0.0 {
            return [0.0; 2];
        }
        // Turns of the phase per metre, two-way, at the actual sound speed along the path rather than the assumed one.
        let per_m = f64::from(self.turns * way.range / way.path);
        // Turns over the sides of its footprint.
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
