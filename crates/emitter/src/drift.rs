//! Errors that drift: first-order Gauss-Markov processes.

use ground::rng::{Draw, Rng};

/// Nodes of a process in its correlation time.
const NODES_PER_TAU: f64 = 128.0;

/// Nodes from anchor to anchor, a power of two: 16 correlation times, after which nothing is left of a value but e^-16, 1e-7 of
/// it. Anchors are drawn each by itself.
const NODES: usize = 2048;

/// A stationary first-order Gauss-Markov process of variance 1, with the autocorrelation exp(-|t| / tau) (A. Gelb, "Applied
/// optimal estimation", 1974, section 3.8), linear between nodes that are tau / 128 apart.
///
/// Its value at a time is a function of that time, a seed and a number alone. A process has the Markov property, so the value
/// in the middle between two known ones, h from each, is normal with the mean (a + b) / (2 cosh(h / tau)) and the variance
/// tanh(h / tau) (from the covariances of the three): all nodes follow from the anchors around them by halving the way between
/// them.
pub(super) struct GaussMarkov {
    seed: u64,
    /// Which of the processes of a seed.
    number: u32,
    /// Correlation time, s.
    tau: f64,
    /// What it is for.
    draw: Draw,
    /// Which anchor is the first of `nodes`.
    block: Option<i64>,
    /// Values from an anchor to the next, both included.
    nodes: Vec<f64>,
}

impl GaussMarkov {
    /// With a correlation time `tau`, s.
    pub fn new(seed: u64, number: u32, tau: f64) -> GaussMarkov {
        GaussMarkov { seed, number, tau, draw: Draw::Navigation, block: None, nodes: vec![0.0; NODES + 1] }
    }

    /// The same with the random numbers of another purpose.
    pub fn drawing(self, draw: Draw) -> GaussMarkov {
        GaussMarkov { draw, ..self }
    }

    /// Time from node to node, s.
    pub fn step(tau: f64) -> f64 {
        tau / NODES_PER_TAU
    }

    /// Its value at `time`, s.
    pub fn at(&mut self, time: f64) -> f64 {
        let place = time / GaussMarkov::step(self.tau);
        let node = place.floor() as i64;
        let (block, inside) = (node.div_euclid(NODES as i64), node.rem_euclid(NODES as i64) as usize);
        if self.block != Some(block) {
            self.fill(block);
        }
        let (from, to) = (self.nodes[inside], self.nodes[inside + 1]);
        from + (to - from) * (place - node as f64)
    }

    /// Sets the nodes from the anchor `block` on.
    fn fill(&mut self, block: i64) {
        (self.nodes[0], self.nodes[NODES]) = (self.drawn(block, 0), self.drawn(block + 1, 0));
        let mut length = NODES;
        while length > 1 {
            let half = length / 2;
            let way = half as f64 / NODES_PER_TAU;
            let (weight, sigma) = (0.5 / way.cosh(), way.tanh().sqrt());
            for low in (0..NODES).step_by(length) {
                let ends = self.nodes[low] + self.nodes[low + length];
                self.nodes[low + half] = weight * ends + sigma * self.drawn(block, low + half);
            }
            length = half;
        }
        self.block = Some(block);
    }

    /// The normal number of a place in the block from an anchor to the next.
    fn drawn(&self, block: i64, place: usize) -> f64 {
        // Words of the address: the block, low and high, and which process and place.
        let rng = Rng::new(self.seed, (block >> 32) as u32);
        rng.normal(block as u32, self.draw, self.number << 16 | place as u32).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean products of values some nodes apart, wherever they are between two anchors and across them: exp(-t / tau), within
    /// five standard errors, which are those of the means of many seeds.
    #[test]
    fn the_autocorrelation_is_that_of_a_gauss_markov_process() {
        let tau = 50.0;
        let step = GaussMarkov::step(tau);
        let lags = [0, 1, 16, 64, 128, 384, 1200];
        let (seeds, mut sums, mut squares) = (200, [0.0; 7], [0.0; 7]);
        for seed in 0..seeds {
            let mut process = GaussMarkov::new(seed, 2, tau);
            let values: Vec<f64> = (0..4100).map(|node| process.at((f64::from(node) + 1e-6) * step)).collect();
            for (index, lag) in lags.into_iter().enumerate() {
                let starts = (0..values.len() - lag).step_by(61);
                let count = starts.len() as f64;
                let mean = starts.map(|start| values[start] * values[start + lag]).sum::<f64>() / count;
                sums[index] += mean;
                squares[index] += mean * mean;
            }
        }
        let n = seeds as f64;
        for (index, lag) in lags.into_iter().enumerate() {
            let (mean, expected) = (sums[index] / n, (-(lag as f64) * step / tau).exp());
            let error = ((squares[index] / n - mean * mean) / n).sqrt();
            assert!((mean - expected).abs() < 5.0 * error, "lag {lag}: {mean}, not {expected}, +- {error}");
            assert!(error < 0.05, "lag {lag}: {error}");
        }
    }

    /// Along one realisation, too, steps have the variance 2 (1 - exp(-t / tau)), and the values variance 1.
    #[test]
    fn one_realisation_has_the_variance_of_all() {
        let mut process = GaussMarkov::new(11, 0, 1.0);
        let step = GaussMarkov::step(1.0);
        let values: Vec<f64> = (0..400_000).map(|node| process.at(f64::from(node) * step)).collect();
        let mean = |of: &dyn Fn(&[f64]) -> f64| values.windows(2).map(of).sum::<f64>() / (values.len() - 1) as f64;
        // 400,000 nodes are 3125 correlation times, of which the variance of the variance is 1 / 3125 each.
        assert!(mean(&|pair| pair[0]).abs() < 5.0 * (2.0f64 / 3125.0).sqrt());
        assert!((mean(&|pair| pair[0] * pair[0]) - 1.0).abs() < 5.0 * (2.0f64 / 3125.0).sqrt());
        let expected = 2.0 * (1.0 - (-step).exp());
        let found = mean(&|pair| (pair[1] - pair[0]).powi(2));
        assert!((found / expected - 1.0).abs() < 5.0 * (2.0f64 / 400_000.0).sqrt(), "{found}, not {expected}");
    }

    #[test]
    fn a_value_is_a_function_of_its_time() {
        let times: Vec<f64> = (0..200).map(|index| f64::from(index) * 0.37 - 30.0).collect();
        let mut forth = GaussMarkov::new(3, 1, 2.0);
        let all: Vec<f64> = times.iter().map(|time| forth.at(*time)).collect();
        let mut back = GaussMarkov::new(3, 1, 2.0);
        assert!(times.iter().zip(&all).rev().all(|(time, value)| back.at(*time) == *value));
        for (seed, number) in [(4, 1), (3, 0)] {
            let mut other = GaussMarkov::new(seed, number, 2.0);
            assert!(times.iter().zip(&all).all(|(time, value)| other.at(*time) != *value));
        }
        // Far from zero, as times since 1970 are.
        let mut far = GaussMarkov::new(3, 1, 0.01);
        assert!(far.at(1.7e9).abs() < 6.0 && far.at(1.7e9) != far.at(1.7e9 + 1.0));
    }
}
