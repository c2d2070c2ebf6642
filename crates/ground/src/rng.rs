//! Random numbers of a scan: each is a function of seed, frame, beam and purpose.
//!
//! Key = seed, counter = (beam, frame, sub-ray, [`Draw`]), see [`echocast_kernels::random`].

use echocast_kernels::random;
use echocast_kernels::tile::TileRows;

/// What a random number is for. Numbers are explicit and never reused, so that a new purpose leaves the draws of the
/// others unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Draw {
    /// Gaussian errors of the measured range, and of the intensity.
    RangeJitter = 1,
    /// Gaussian error of the reported azimuth.
    AzimuthJitter = 2,
    /// Whether a return is lost.
    Dropout = 3,
    /// How many raindrops a beam meets, where, and how large.
    Drops = 4,
    /// Likewise for snowflakes.
    Flakes = 5,
    /// Gaussian error of the range from rain.
    RainRange = 6,
    /// Rotation of a beam's sub-rays about its axis.
    Footprint = 7,
    /// How strong the echo of fog or dust is, and from where.
    SoftEcho = 8,
    /// Whether a partly covered place of a surface stops a ray: sub-ray = origin of the ray, its direction and the
    /// triangle, mixed.
    Coverage = 9,
    /// Noise in which an echo is detected: sub-ray 0 for the surface that a beam meets, the bits of the range for
    /// others.
    Detection = 20,
    /// Noise that looks like an echo.
    FalseAlarm = 21,
    /// Range error of a channel, once per instrument: seed = its number, counter = (channel, 0, 0).
    ChannelBias = 22,
    /// Likewise the relative range error.
    ChannelGain = 23,
    /// True direction of a beam relative to the reported one: sub-rays 0 and 1 for the two directions across it.
    Pointing = 24,
    /// Error of the reported time, by firing.
    TimeJitter = 25,
    /// Whether a weak return is lost.
    WeakDropout = 26,
    /// Gaussian error of the measured radial velocity, or the velocity of a false alarm.
    Doppler = 27,
    /// Gaussian errors of the phases of modulated light, by frequency.
    Phase = 30,
    /// Gaussian error of the measured depth.
    DepthJitter = 31,
    /// Deviation of a pixel's direction from its nominal one.
    PixelDirection = 32,
    /// Where light that reaches a pixel via two surfaces hit the first of them.
    SecondBounce = 33,
    /// Phase and amplitude of the sound that a ray returns in a bin: counter = (place along the array, bin, position of
    /// the sonar, scatterers it belongs to).
    Speckle = 40,
    /// Roughness of a larger patch of a surface.
    Texture = 41,
    /// Noise of a sonar's receiver, by cell.
    PingNoise = 42,
    /// Error of the phase between the halves of a sonar's array, by beam and bin.
    SplitPhase = 43,
    /// Gaussian error of the velocity along a beam of a Doppler velocity log: sub-ray 0 of the bottom, 1 of the water.
    BeamVelocity = 44,
    /// Relative error of its velocities, once per instrument.
    VelocityScale = 45,
    /// Constant error along each of its beams, likewise.
    VelocityBias = 46,
    /// Phase and amplitude of the wave that a patch of a rough surface scatters back to a radar.
    RadarSpeckle = 49,
    /// Which of many weak patches stand for all.
    RadarPatch = 56,
    /// Thermal noise of a radar, by cell.
    RadarNoise = 50,
    /// Likewise by sample.
    RadarSampleNoise = 51,
    /// Echoes of rain in the cells of a radar.
    RadarRain = 52,
    /// Phase noise of a radar's oscillator.
    OscillatorPhase = 53,
    /// When and how the radars around transmit.
    Interference = 54,
    /// Errors of the angle and other measured numbers of a radar's detections.
    RadarJitter = 55,
    /// Error of gain and phase of a channel, once per instrument.
    ArrayError = 60,
    /// Drift of a navigation solution: counter = (time, time, process and time), see `emitter`.
    Navigation = 70,
    /// What is wrong with it throughout, by process.
    NavigationBias = 71,
    /// Noise of an inertial measurement unit: counter = (number of the measurement, axis, the number's upper half).
    ImuNoise = 72,
    /// Drift of its biases: counter as for [`Draw::Navigation`].
    ImuBias = 73,
    /// Shape of generated ground.
    Terrain = 100,
    /// Shape, size and place of generated boulders.
    Boulder = 101,
    /// Likewise wrecks.
    Wreck = 102,
    /// Likewise fish.
    Fish = 103,
    /// Widths, storeys and fronts of generated houses.
    House = 104,
    /// Shape of generated trees.
    Tree = 105,
    /// Makes, colours, speeds of generated cars, and where they are parked.
    Car = 106,
    /// Where generated people walk.
    Person = 120,
    /// Kinds of generated traffic signs.
    Sign = 121,
    /// Sizes of generated rooms, and where their doors and windows are.
    Room = 122,
    /// What is in a generated room, and where.
    Furniture = 123,
    /// Likewise mirrors and glass partitions.
    Glass = 124,
    /// Course of generated pipes.
    Pipe = 125,
    /// Place of generated mines.
    Mine = 126,
    /// Likewise sea grass.
    Seagrass = 127,
    /// Shapes of the trees, bushes and grass of a landscape.
    Plant = 140,
    /// Where the trees of a landscape stand, their kinds and sizes.
    Forest = 141,
    /// Likewise its bushes.
    Bush = 142,
    /// Likewise its grass.
    Grass = 143,
    /// Likewise its rocks, and their shapes.
    Stone = 144,
    /// How far a tripod is off level: counter = (station, 0, axis).
    StationLevel = 160,
    /// Seed of a scan of a sample: counter = (sensor, sample, 0).
    ScanSeed = 200,
    /// Key of what varies from sample to sample.
    Variation = 201,
}

/// Random numbers of one scan.
#[derive(Clone, Copy, Debug)]
pub struct Rng {
    key: [u32; 2],
    frame: u32,
}

impl Rng {
    /// The numbers for `seed` in the scan with the index `frame`.
    pub fn new(seed: u64, frame: u32) -> Self {
        Rng { key: [seed as u32, (seed >> 32) as u32], frame }
    }

    /// Four random words at an address of two words and its purpose.
    pub fn words(&self, [a, b]: [u32; 2], draw: Draw) -> [u32; 4] {
        random::block([a, self.frame, b, draw as u32], self.key)
    }

    /// Four random words for variations between samples, at an address of three words; the frame is the sample.
    pub fn variation(&self, [a, b, c]: [u32; 3]) -> [u32; 4] {
        // The counter has no room for the purpose, so the key is a different one.
        let [low, high, ..] = random::block([0, 0, 0, Draw::Variation as u32], self.key);
        random::block([a, self.frame, b, c], [low, high])
    }

    /// A number that differs from seed to seed.
    pub fn seed_word(&self) -> u32 {
        let [word, ..] = random::block([1, 0, 0, Draw::Variation as u32], self.key);
        word
    }

    /// Standard normal numbers of `beams` at their `sub_rays`, one for each element of `out`.
    pub fn normals(&self, beams: &[u32], sub_rays: &[u32], draw: Draw, out: &mut [f32]) {
        random::normals(self.key, beams, self.frame, sub_rays, draw as u32, out);
    }

    /// [`Rng::normal_pair`] of each of `beams` at their `sub_rays`.
    pub fn normal_pairs(&self, beams: &[u32], sub_rays: &[u32], draw: Draw, a: &mut [f32], b: &mut [f32]) {
        random::normal_pairs(self.key, beams, self.frame, sub_rays, draw as u32, a, b);
    }

    /// Numbers in [0, 1) of `beams` at their `sub_rays`, one for each element of `out`.
    pub fn uniforms(&self, beams: &[u32], sub_rays: &[u32], draw: Draw, out: &mut [f32]) {
        random::uniforms(self.key, beams, self.frame, sub_rays, draw as u32, out);
    }

    /// Two numbers in [0, 1) of `beams` at their `sub_rays`, the first two of [`Rng::four`].
    pub fn uniform_pairs(&self, beams: &[u32], sub_rays: &[u32], draw: Draw, a: &mut [f32], b: &mut [f32]) {
        random::uniform_pairs(self.key, beams, self.frame, sub_rays, draw as u32, a, b);
    }

    /// Complex numbers whose squared magnitude is exponentially distributed with mean 1 and whose phase is uniform: the
    /// sum of many small echoes. Each at its own address of four words.
    pub fn phasors(&self, address: [&[u32]; 4], re: &mut [f32], im: &mut [f32]) {
        random::phasors(self.key, address, re, im);
    }

    /// [`Rng::phasors`] of the cells of `beam`, in order.
    pub fn cell_phasors(&self, beam: u32, draw: Draw, re: &mut [f32], im: &mut [f32]) {
        random::phasor_row(self.key, [self.frame, beam, draw as u32], re, im);
    }

    /// [`Rng::cell_phasors`] of as many beams from `beam` on as a row has, in the rows from `first` on: see
    /// [`random::phasor_rows`].
    pub fn tile_phasors(&self, beam: u32, draw: Draw, first: usize, [re, im]: [&mut TileRows; 2]) {
        random::phasor_rows(self.key, [self.frame, beam, draw as u32], first, re, im);
    }

    /// A number in [0, 1) at an address of three words and its purpose.
    pub fn uniform_at(&self, [a, b, c]: [u32; 3], draw: Draw) -> f32 {
        let [word, ..] = random::block([a, b, c, draw as u32], self.key);
        random::unit(word)
    }

    /// A standard normal number of one beam at `sub_ray`, that of [`Rng::normals`].
    pub fn normal(&self, beam: u32, draw: Draw, sub_ray: u32) -> f32 {
        self.normal_pair(beam, draw, sub_ray)[0]
    }

    /// Two standard normal numbers of one beam at `sub_ray`; the first is that of [`Rng::normals`].
    pub fn normal_pair(&self, beam: u32, draw: Draw, sub_ray: u32) -> [f32; 2] {
        let [a, b, c, d] = random::block([beam, self.frame, sub_ray, draw as u32], self.key);
        [random::normal(a, b), random::normal(c, d)]
    }

    /// Four numbers in [0, 1) of one beam at `sub_ray`; the first is that of [`Rng::uniforms`].
    pub fn four(&self, beam: u32, draw: Draw, sub_ray: u32) -> [f32; 4] {
        random::block([beam, self.frame, sub_ray, draw as u32], self.key).map(random::unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_depends_on_its_address_only() {
        let rng = Rng::new(7, 3);
        let beams: [u32; 100] = std::array::from_fn(|lane| 1000 + lane as u32);
        let mut long = [0.0; 100];
        rng.normals(&beams, &[0; 100], Draw::RangeJitter, &mut long);
        for start in [0, 1, 15, 16, 37] {
            let mut short = [0.0; 21];
            rng.normals(&beams[start..start + 21], &[0; 21], Draw::RangeJitter, &mut short);
            assert_eq!(short, long[start..start + 21]);
        }
        assert_eq!(rng.normal(1042, Draw::RangeJitter, 0), long[42]);
        let (mut a, mut b) = ([0.0; 100], [0.0; 100]);
        rng.uniform_pairs(&beams, &[5; 100], Draw::Drops, &mut a, &mut b);
        for lane in 0..100 {
            assert_eq!([a[lane], b[lane]], rng.four(beams[lane], Draw::Drops, 5)[..2]);
        }
        for (rng, sub_ray) in [(Rng::new(7, 4), 0), (rng, 1)] {
            let mut other = [0.0; 100];
            rng.normals(&beams, &[sub_ray; 100], Draw::RangeJitter, &mut other);
            assert_ne!(long, other);
            assert_eq!(rng.normal(1039, Draw::RangeJitter, sub_ray), other[39]);
        }
    }

    #[test]
    fn phasors_have_exponential_power_and_any_phase() {
        let n = 200_000;
        let words: Vec<u32> = (0..n).collect();
        let zeros = vec![0; n as usize];
        let (mut re, mut im) = (vec![0.0f32; n as usize], vec![0.0f32; n as usize]);
        let rng = Rng::new(5, 0);
        rng.phasors([&words, &zeros, &zeros, &zeros], &mut re, &mut im);
        let mean = |value: &dyn Fn(f64, f64) -> f64| {
            re.iter().zip(&im).map(|(&x, &y)| value(x.into(), y.into())).sum::<f64>() / f64::from(n)
        };
        let tolerance = 5.0 / f64::from(n).sqrt();
        assert!((mean(&|x, y| x * x + y * y) - 1.0).abs() < tolerance);
        assert!((mean(&|x, y| (x * x + y * y).powi(2)) - 2.0).abs() < 5.0 * tolerance);
        assert!(mean(&|x, _| x).abs() < tolerance && mean(&|_, y| y).abs() < tolerance);
        assert!(mean(&|x, y| x * y).abs() < tolerance && mean(&|x, y| x * x - y * y).abs() < 2.0 * tolerance);
        let (mut short_re, mut short_im) = (vec![0.0; 41], vec![0.0; 41]);
        rng.cell_phasors(7, Draw::PingNoise, &mut short_re, &mut short_im);
        let (mut long_re, mut long_im) = (vec![0.0; 100], vec![0.0; 100]);
        rng.cell_phasors(7, Draw::PingNoise, &mut long_re, &mut long_im);
        assert_eq!((&short_re[..], &short_im[..]), (&long_re[..41], &long_im[..41]));
        assert!(long_re.iter().enumerate().all(|(cell, value)| !long_re[..cell].contains(value)));
        rng.cell_phasors(8, Draw::PingNoise, &mut short_re, &mut short_im);
        assert!(short_re.iter().zip(&long_re).all(|(one, other)| one != other));
    }

    #[test]
    fn moments_are_those_of_a_normal() {
        let mut sample = vec![0.0f32; 1_000_000];
        let beams: Vec<u32> = (0..1_000_000).collect();
        Rng::new(1, 0).normals(&beams, &vec![0; beams.len()], Draw::RangeJitter, &mut sample);
        let n = sample.len() as f64;
        let moment = |power: i32| sample.iter().map(|&x| f64::from(x).powi(power)).sum::<f64>() / n;
        // Standard errors of the first four moments of N(0, 1): 1, sqrt 2, sqrt 15, sqrt 96 over sqrt n.
        for (power, expected, spread) in
            [(1, 0.0, 1.0), (2, 1.0, 2f64.sqrt()), (3, 0.0, 15f64.sqrt()), (4, 3.0, 96f64.sqrt())]
        {
            let error = (moment(power) - expected).abs() / (spread / n.sqrt());
            assert!(error < 5.0, "moment {power} is off by {error} standard errors");
        }
    }
}
