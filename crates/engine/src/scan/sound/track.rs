//! What a Doppler velocity log derives from a ping: how fast the bottom, or a layer of water, approaches along each
//! beam.
//!
//! Sound that a sonar transmits at the frequency `f` and receives back from what approaches at `v` is shifted by `2 f v
//! / c`, where `c` is the speed of sound at the sonar, so that the instrument measures `v` times the sound speed that
//! it assumes over `c` (Gordon 1996, "Acoustic Doppler current profiler: principles of operation", RD Instruments). The
//! motion of the water in between cancels: what it adds on the way out it takes away on the way back. A bed across the
//! whole width of a beam has many shifts; the instrument measures their mean, weighted by the energy of the echoes.

use super::plan::{Log, PingPlan};
use crate::detect::{BeamRate, Tracked, WaterLayer, bins_about};
use crate::echo::{Echoes, PingEcho};
use crate::trace::{Arrival, Movement};
use cloud::cells::{Layout, Sounding, Track};
use emitter::pattern::JANUS_BEAMS;
use glam::{DVec3, Vec3};
use ground::math::{LOG2_PER_DB, exp2};

/// Weighted sums over what a beam receives.
#[derive(Clone, Copy, Default)]
struct Sums {
    weight: f64,
    /// Range rate by the Doppler shift, m/s.
    rate: f64,
    /// Velocity relative to the sonar, world, m/s.
    relative: DVec3,
}

impl Sums {
    fn add(&mut self, weight: f32, rate: f64, relative: Vec3) {
        let weight = f64::from(weight);
        self.weight += weight;
        self.rate += weight * rate;
        self.relative += weight * relative.as_dvec3();
    }

    /// The means, if anything was received.
    fn received(&self, snr: f64) -> Option<BeamRate> {
        let Sums { weight, rate, relative } = *self;
        (weight > 0.0).then(|| BeamRate { rate: rate / weight, speed: relative.length() / weight, snr })
    }
}

impl PingPlan<'_> {
    /// Velocities relative to the bottom, where beams have `soundings`, and to a layer of water, if it is tracked.
    pub(super) fn tracks<'e>(
        &self,
        log: &Log,
        echoes: impl Iterator<Item = &'e Echoes>,
        soundings: &[Sounding],
    ) -> (Track, Option<Track>) {
        let locks: [Option<&Sounding>; JANUS_BEAMS] =
            std::array::from_fn(|beam| soundings.iter().find(|sounding| sounding.beam as usize == beam));
        let axes = std::array::from_fn(|beam| self.layout.axis(beam));
        let received = self.receive_bottom(echoes, &locks);
        let bottom = log.spec.track(&self.rng, Tracked::Bottom, &axes, &received);
        let water = log.spec.water.map(|layer| {
            // Noise that looks like an echo has no velocity, and hides no water.
            let nearest = |beam: usize| received[beam].and(locks[beam]).map(|sounding| sounding.range);
            let received = std::array::from_fn(|beam| self.receive_water(log, &layer, beam, axes[beam], nearest(beam)));
            log.spec.track(&self.rng, Tracked::Water, &axes, &received)
        });
        (bottom, water)
    }

    /// What each beam receives from the bottom, around its sounding.
    fn receive_bottom<'e>(
        &self,
        all: impl Iterator<Item = &'e Echoes>,
        locks: &[Option<&Sounding>; JANUS_BEAMS],
    ) -> [Option<BeamRate>; JANUS_BEAMS] {
        let gates = locks.map(|lock| {
            let Sounding { beam, range, .. } = *lock?;
            let about = bins_about(&self.layout, beam as usize, self.transducer.widths[beam as usize], range);
            Some((range, (about as f64 * self.layout.bin_m) as f32))
        });
        let mut sums = [Sums::default(); JANUS_BEAMS];
        for echoes in all {
            for (index, (arrival, answer)) in echoes.arrivals.iter().zip(&echoes.answers).enumerate() {
                let beam = self.transducer.receiving_beams[answer.receiving as usize].first as usize;
                if gates[beam].is_some_and(|(range, about)| (answer.range - range).abs() <= about) {
                    self.add_echo(echoes, index, (arrival, answer), &mut sums[beam]);
                }
            }
        }
        let Layout { bins, noise_db, threshold_db, .. } = &*self.layout;
        std::array::from_fn(|beam| {
            let Sounding { level_db, cell, .. } = *locks[beam]?;
            // A sounding of noise alone is not one of the bottom, whatever the side lobes may receive there.
            let least = f64::from(exp2(threshold_db[cell as usize % bins] * LOG2_PER_DB));
            let above = f64::from(exp2((level_db - noise_db) * LOG2_PER_DB));
            sums[beam].received((above - 1.0).max(0.1)).filter(|_| sums[beam].weight > least)
        })
    }

    /// Adds arrival `index` to what its beam receives.
    fn add_echo(&self, echoes: &Echoes, index: usize, (arrival, answer): (&Arrival, &PingEcho), sums: &mut Sums) {
        let parts = answer.first as usize..(answer.first + answer.parts) as usize;
        let energy: f32 = echoes.energy[parts].iter().sum();
        let Movement { velocity, .. } = self.movement(arrival, None);
        let launch = self.rotation() * self.launched(echoes, index);
        // Each end with the speed of sound there.
        let rate = velocity.dot(arrival.direction) / arrival.speed - self.own.dot(launch);
        sums.add(energy, f64::from(rate) * self.scale(), velocity - self.own);
    }

    /// What a beam receives from a layer of water, if that is strong enough and free of the `bottom`, m along the beam:
    /// nearer than where the side lobe that points straight down receives it (Gordon 1996).
    fn receive_water(
        &self,
        log: &Log,
        layer: &WaterLayer,
        beam: usize,
        axis: DVec3,
        bottom: Option<f32>,
    ) -> Option<BeamRate> {
        let [from, to] = [layer.from_m, layer.to_m].map(|down| down / -axis.z);
        if bottom.is_some_and(|range| f64::from(range) * -axis.z < to) {
            return None;
        }
        let bin = (0.5 * (from + to) / self.layout.bin_m) as usize;
        let power = self.volume.get(bin)? * self.transducer.solid_angles[beam];
        let snr = f64::from(power / exp2(self.layout.noise_db * LOG2_PER_DB));
        if 10.0 * snr.log10() < self.acoustics.detection_threshold_db {
            return None;
        }
        let relative = log.current - self.own;
        let mut sums = Sums::default();
        let transducer = &*self.transducer;
        for ray in 0..transducer.rays() {
            if transducer.receiving_beams[transducer.receiving[ray] as usize].first as usize == beam {
                let direction = self.rotation() * Vec3::from(transducer.direction.each_ref().map(|axis| axis[ray]));
                let rate = f64::from(relative.dot(direction)) * self.scale();
                sums.add(transducer.weight[ray].exp2(), rate, relative);
            }
        }
        sums.received(snr)
    }

    /// Sound speed that the instrument assumes over that at the sonar.
    fn scale(&self) -> f64 {
        self.layout.believed_speed / self.column.speed_at(self.column.surface_z - self.pose.position.z)
    }
}
