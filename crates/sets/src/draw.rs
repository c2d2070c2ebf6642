//! Random numbers of a sample: each is a function of its address alone, which consists of the seed, the sample, and
//! names that state its purpose. Adding a rule therefore changes no other draw, and a sample is the same whether it is
//! made alone or with others.

use ground::rng::{Draw, Rng};
use rand_core::{Infallible, TryRng};

/// The random numbers of one sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draws {
    rng: Rng,
    sample: u32,
}

/// Purpose of a random number: a rule, an object or the number of a placement, a parameter.
#[derive(Clone, Debug)]
pub(super) struct Address {
    draws: Draws,
    /// Hash of the names so far.
    hash: u64,
}

impl Draws {
    pub fn new(seed: u64, sample: u32) -> Draws {
        Draws { rng: Rng::new(seed, sample), sample }
    }

    /// The address with this name.
    pub fn of(&self, name: &str) -> Address {
        Address { draws: *self, hash: BASIS }.of(name)
    }

    /// The seed of the scan with the `sensor`th sensor; for the first sensor of sample 0, it is the scenario's own
    /// `seed`.
    pub fn scan_seed(&self, seed: u64, sensor: u32) -> u64 {
        if (self.sample, sensor) == (0, 0) {
            return seed;
        }
        let [low, high, ..] = self.rng.words([sensor, 0], Draw::ScanSeed);
        u64::from(low) | u64::from(high) << 32
    }
}

/// Offset basis and prime of the 64-bit FNV-1a hash (Fowler, Noll and Vo; draft-eastlake-fnv).
const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0100_0000_01b3;

impl Address {
    /// This address extended by a name.
    pub fn of(&self, name: &str) -> Address {
        // No byte of UTF-8 text is 255, so "a", "bc" and "ab", "c" differ.
        let hash = name.bytes().chain([255]).fold(self.hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME));
        Address { hash, ..*self }
    }

    /// This address extended by an index.
    pub fn at(&self, index: usize) -> Address {
        self.of(&index.to_string())
    }

    /// An endless stream of random numbers.
    pub fn stream(&self) -> Stream {
        Stream { address: self.clone(), block: 0, words: [0; 4], left: 0 }
    }

    /// The sample number, and a number that all samples share at this address.
    pub fn in_sequence(&self) -> (u32, u32) {
        (self.draws.sample, (self.hash ^ self.hash >> 32) as u32 ^ self.draws.rng.seed_word())
    }

    /// The sample number.
    pub fn sample(&self) -> u32 {
        self.draws.sample
    }
}

/// A sequence of random words at one address.
pub(super) struct Stream {
    address: Address,
    block: u32,
    words: [u32; 4],
    left: usize,
}

impl Stream {
    fn next(&mut self) -> u32 {
        if self.left == 0 {
            let Address { draws, hash } = &self.address;
            // The purpose is in the key, since the counter has no room for it.
            self.words = draws.rng.variation([self.block, *hash as u32, (hash >> 32) as u32]);
            self.block = self.block.wrapping_add(1);
            self.left = self.words.len();
        }
        self.left -= 1;
        self.words[self.words.len() - 1 - self.left]
    }
}

impl TryRng for Stream {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok(self.next())
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        let low = self.next();
        Ok(u64::from(low) | u64::from(self.next()) << 32)
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        for chunk in bytes.chunks_mut(4) {
            chunk.copy_from_slice(&self.next().to_le_bytes()[..chunk.len()]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng as _;

    #[test]
    fn numbers_depend_on_their_address_alone() {
        let first = |seed, sample, names: &[&str]| {
            let (name, others) = names.split_first().unwrap();
            let address = others.iter().fold(Draws::new(seed, sample).of(name), |address, name| address.of(name));
            let mut stream = address.stream();
            [stream.next_u64(), stream.next_u64(), stream.next_u64()]
        };
        let one = first(7, 3, &["move", "Chair"]);
        assert_eq!(one, first(7, 3, &["move", "Chair"]));
        let others = [
            first(8, 3, &["move", "Chair"]),
            first(7, 4, &["move", "Chair"]),
            first(7, 3, &["moveC", "hair"]),
            first(7, 3, &["move", "Chair", ""]),
            first(7 + (1 << 32), 3, &["move", "Chair"]),
        ];
        for (index, other) in others.iter().enumerate() {
            assert!(other.iter().all(|word| !one.contains(word)), "{index}");
        }
        assert_ne!(one[0], one[1]);
        let mut bytes = [0; 10];
        Draws::new(7, 3).of("move").of("Chair").stream().fill_bytes(&mut bytes);
        assert_eq!(bytes[..8], one[0].to_le_bytes());
        assert_eq!(bytes[8..], one[1].to_le_bytes()[..2]);
    }

    #[test]
    fn the_first_scan_has_the_seed_of_the_scenario() {
        assert_eq!(Draws::new(42, 0).scan_seed(42, 0), 42);
        let seeds: Vec<u64> =
            (0..100).flat_map(|sample| [0, 1].map(|sensor| Draws::new(42, sample).scan_seed(42, sensor))).collect();
        assert!(seeds.iter().enumerate().all(|(index, seed)| !seeds[..index].contains(seed)));
    }
}
