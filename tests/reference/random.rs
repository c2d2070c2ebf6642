//! Random numbers for test scenes: the same on every machine and in every run.

use glam::{DMat3, DQuat, DVec3};

/// The first number in [0, 1) of a Philox 4x32-10 block (Salmon et al. 2011), of 24 bits.
pub fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> f64 {
    for _ in 0..10 {
        let [a, b] = [(counter[0], 0xD251_1F53_u64), (counter[2], 0xCD9E_8D57)].map(|(x, m)| u64::from(x) * m);
        let high = |product: u64| (product >> 32) as u32;
        counter = [high(b) ^ counter[1] ^ key[0], b as u32, high(a) ^ counter[3] ^ key[1], a as u32];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    f64::from(counter[0] >> 8) / f64::from(1 << 24)
}

/// A stream of random numbers (splitmix64; Steele, Lea, Flood 2014).
pub struct Random(u64);

impl Random {
    /// The stream number `seed`.
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// 0 to `count` - 1.
    pub fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// In the cube of half width `half`.
    pub fn in_cube(&mut self, half: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.between(-half, half)))
    }

    /// A direction, all alike.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.between(-1.0, 1.0);
        let (sin, cos) = self.between(0.0, std::f64::consts::TAU).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }

    /// A rotation.
    pub fn rotation(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction(), self.between(0.0, std::f64::consts::TAU))
    }

    /// A linear map that turns, scales each axis by 0.4 to 2.5, shears and, every second time, mirrors.
    pub fn linear_map(&mut self) -> DMat3 {
        let mut scale = DVec3::from_array(std::array::from_fn(|_| self.between(-0.9, 0.9).exp()));
        if self.unit() < 0.5 {
            scale.y = -scale.y;
        }
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(self.between(-0.5, 0.5), 1.0, 0.0), DVec3::Z);
        DMat3::from_quat(self.rotation()) * DMat3::from_diagonal(scale) * shear * DMat3::from_quat(self.rotation())
    }
}
