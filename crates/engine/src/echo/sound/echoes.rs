//! The echoes of a chunk of rays.

use super::blocks::Gathered;
use super::echo::PingEcho;
use crate::trace::{Arrival, Direct};
use emitter::{ReceivingBeams, Transducer};
use glam::Vec3;

/// Echoes of a chunk of rays: arrivals in order, and their parts in bins.
#[derive(Clone, Default)]
pub(crate) struct Echoes {
    pub arrivals: Vec<Arrival>,
    /// Number of the first of them among those of the ping, from 1.
    pub first: u32,
    /// Direct paths to the positions of arrivals, each of which adds two more arrivals with the echoes; or to targets.
    pub direct: Vec<Direct>,
    /// Directions (unit, world) in which arrivals left that did not leave, or do not return, along their ray: each with
    /// the index of its arrival, ascending.
    pub launches: Vec<(u32, Vec3)>,
    /// The echo of each arrival, in order.
    pub answers: Vec<PingEcho>,
    /// Beams that receive any of it: from the first to before the second.
    pub beams: (usize, usize),
    /// Parts: energies, and amplitudes with random phases, or energies again.
    pub energy: Vec<f32>,
    pub re: Vec<f32>,
    pub im: Vec<f32>,
    /// Sums of what beams receive alike.
    pub gathered: Gathered,
}

impl Echoes {
    /// Clears all but the direct paths.
    pub fn clear(&mut self) {
        let Echoes { arrivals, launches, answers, energy, re, im, .. } = self;
        arrivals.clear();
        launches.clear();
        answers.clear();
        [energy, re, im].into_iter().for_each(Vec::clear);
    }

    /// Determines which beams receive any of it, or have water blocked by it, and sums what several of them receive in
    /// `bins`.
    pub fn gather(&mut self, transducer: &Transducer, bins: usize) {
        let Echoes { arrivals, answers, energy, re, im, gathered, .. } = self;
        let of_rays = arrivals.iter().filter(|arrival| arrival.order == 0);
        let of_rays = of_rays.filter_map(|arrival| transducer.receiving.get(arrival.ray as usize));
        let all = of_rays.copied().chain(answers.iter().map(|answer| answer.receiving));
        self.beams = all.fold((usize::MAX, 0), |(least, most), receiving| {
            let ReceivingBeams { first, from, to, .. } = transducer.receiving_beams[receiving as usize];
            (least.min(first as usize), most.max((first + to - from) as usize))
        });
        if !transducer.beams_are_apart() {
            gathered.gather(answers, [re, im], energy, bins);
        }
    }

    /// Direction (unit, world) in which arrival `index` left or returns, if that is not along its ray.
    pub fn launch(&self, index: usize) -> Option<Vec3> {
        let place = self.launches.binary_search_by_key(&(index as u32), |(arrival, _)| *arrival);
        Some(self.launches[place.ok()?].1)
    }
}
