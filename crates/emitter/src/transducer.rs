//! The fans of a sonar as rays: how much sound each represents, and how strongly each beam receives it.

use super::aperture::{Aperture, EVERYWHERE, FAINT};
use super::lobe::{self, Lobe, Shape};
use super::pattern::{Imaging, Janus, Multibeam, Pattern, Sidescan, SingleBeam};
use echocast_kernels::sound::BEAMS;
use glam::Vec3;
use ground::angle::azimuth_elevation;
use std::f64::consts::{FRAC_PI_2, PI};

/// Power below which a beam of a line array does not receive echoes off its axis one by one, but all together: beyond
/// four sidelobes on each side. See [`Transducer::flanks`].
const FAINTEST: f64 = 5e-3;

/// Equal parts of the sine to a line array by which beams receive from farther off their axes.
pub const FLANK_PARTS: usize = 32;

/// Neighbouring rays that are tested together.
const BOX: usize = 256;

/// Share of the rays spread evenly over a fan, whatever its pattern: they find what the sidelobes receive.
const EVEN: f64 = 0.2;

/// What a sonar transmits and receives, at one wavelength. Rays are ordered from the first beam to the last.
#[derive(Clone, Debug, Default)]
pub struct Transducer {
    /// Unit directions of the rays in the sensor's frame.
    pub direction: [Vec<f32>; 3],
    /// Bounds of these for every [`BOX`] rays.
    boxes: Vec<[Vec3; 2]>,
    /// Unit vectors across each ray along which the cell of directions it represents is `cell` rad long.
    pub tangent: [Vec<f32>; 3],
    /// Length of that cell along the tangent, rad.
    pub cell: Vec<f32>,
    /// Length of the cells across ray and tangent, rad; empty: fans so thin that ranges hardly change in that
    /// direction.
    pub aside: Vec<f32>,
    /// Transmitted power times received power times the solid angle of the cell, sr, as log2; without the beams' own
    /// patterns.
    pub weight: Vec<f32>,
    /// Power of the face in the direction of each ray, one way, as log2.
    pub power: Vec<f32>,
    /// Index of the ray's [`ReceivingBeams`].
    pub receiving: Vec<u32>,
    /// Beams that receive rays, by rising first beam; then those that receive from any direction, at even steps of its
    /// sine to a line array.
    pub receiving_beams: Vec<ReceivingBeams>,
    /// How many of these belong to rays.
    of_rays: usize,
    /// What transmits and receives: for sonars with separate beams, one for each beam.
    faces: Vec<Aperture>,
    /// What receives instead of each face, and its power in the direction of each ray, as log2; empty: the faces do.
    receive_faces: Vec<Aperture>,
    receive_power: Vec<f32>,
    /// Whether the face only transmits: how beams receive from in front of it is given by [`ReceivingBeams`] alone.
    only_transmits: bool,
    /// Receive amplitudes of beams, 1 on the axis; see [`ReceivingBeams`]. Before and after those of each [`ReceivingBeams`] are
    /// [`BEAMS`] zeros, so that as many beams at a time can be looked up from any of its beams on, or from before it.
    pub beam_gain: Vec<f32>,
    /// Mean power with which each beam receives from farther off its axis than its [`ReceivingBeams`]s reach, by the part of
    /// the directions from which sound arrives: beam by beam, [`FLANK_PARTS`] each. Empty: no line array.
    pub flanks: Vec<f32>,
    /// Angles from the beam's axis to the ray, rad, positive to port, for each receive amplitude, and zeros as there;
    /// only for swaths.
    pub beside: Vec<f32>,
    /// Reported azimuth and elevation of each beam's axis, rad.
    pub axes: Vec<[f32; 2]>,
    /// Widths of the beams of a swath as they are steered, or of a single beam, rad.
    pub widths: Vec<f32>,
    /// Full width of its narrowest lobe, rad.
    pub narrowest: f64,
    /// The sensor's axis along which its array is.
    pub array: Vec3,
    /// Two-way power of the array, integrated over all angles to it, rad.
    pub array_width: f64,
    /// Directivity index for reception, dB.
    pub directivity_db: f64,
    /// Two-way solid angle of each beam, sr: the product of both powers over all directions.
    pub solid_angles: Vec<f32>,
}

/// The beams that receive a ray: from `first` on, with the amplitudes `beam_gain[from..to]`.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReceivingBeams {
    /// Index of the first of these beams; the others follow it.
    pub first: u32,
    /// Where the amplitude of the first beam is in [`Transducer::beam_gain`].
    pub from: u32,
    /// One past where that of the last beam is.
    pub to: u32,
    /// In which of the [`FLANK_PARTS`] the directions are.
    pub part: u32,
}

impl Transducer {
    /// The transducer for `pattern` at `wavelength`, m, where the true sound speed is `ratio` times what the beamformer
    /// assumes; `None` for patterns of light.
    pub fn new(pattern: &Pattern, wavelength: f64, ratio: f64) -> Option<Transducer> {
        let mut transducer = match pattern {
            Pattern::Sidescan(sidescan) => Transducer::sidescan(sidescan, wavelength),
            Pattern::Multibeam(swath) => Transducer::multibeam(swath, wavelength, ratio),
            Pattern::Imaging(array) => Transducer::imaging(array, wavelength, ratio),
            Pattern::SingleBeam(beam) => Transducer::single(beam, wavelength),
            Pattern::Dvl(janus) => Transducer::janus(janus, wavelength),
            _ => return None,
        };
        transducer.axes = axes(pattern);
        if transducer.of_rays == 0 {
            transducer.of_rays = transducer.receiving_beams.len();
        }
        transducer.find_solid_angles();
        transducer.find_receive_powers();
        transducer.find_boxes();
        Some(transducer)
    }

    /// Approximate number of receive amplitudes of beams, for rays or directions, that a transducer for `pattern`
    /// holds: its memory grows with this.
    pub fn receive_amplitudes_of(pattern: &Pattern, wavelength: f64) -> f64 {
        let (rays, sines, received): (u32, Vec<f64>, _) = match pattern {
            Pattern::Multibeam(swath) => {
                (swath.beams * swath.rays, swath.angles_deg().map(sine_deg).collect(), &swath.across_deg)
            }
            // One `ReceivingBeams` for each column of rays.
            Pattern::Imaging(array) => {
                (64 * array.beams, array.bearings_deg().map(sine_deg).collect(), &array.beam_deg)
            }
            _ => return 0.0,
        };
        let received = received.at(wavelength);
        let extent = received.extent_within(FAINTEST, 1.0 + sines[0].abs());
        let within = |&sine: &f64| {
            let first = sines.partition_point(|&axis| axis > sine + extent);
            sines.partition_point(|&axis| axis >= sine - extent) - first
        };
        let received_of_each = sines.iter().map(within).sum::<usize>() as f64 / sines.len() as f64;
        (f64::from(rays) + directions_of(&received) as f64) * (received_of_each + BEAMS as f64)
    }

    /// Length of its longest side, m, and the range from which its beams have its patterns, `L^2 / wavelength` (Lurton
    /// 2010, section 3.3): nearer, they are those of an array that focuses.
    pub fn far_field(&self, wavelength: f64) -> [f64; 2] {
        // From a line's width at -3 dB.
        let length = 0.886 * wavelength / self.narrowest;
        [length, length * length / wavelength]
    }

    /// How far it moves along its array until speckle has decorrelated, m.
    ///
    /// The phase of sound that many scatterers return at the sine `u` to the array changes by `4 pi u d / wavelength`
    /// while it moves by `d`. So the pressures of two pings have the correlation `rho(d)`, the Fourier transform of the
    /// two-way power `b(u)`: the van Cittert-Zernike theorem for echoes (Mallart and Fink, J. Acoust. Soc. Am. 90,
    /// 2718, 1991; for sonars Bellettini and Pinto, IEEE J. Ocean. Eng. 27, 780, 2002). For a uniform line of the
    /// length `L` that transmits and receives, it is, with `t = d / L`, `1 - 6 t^2 + 6 t^3` up to `t = 1/2`,
    /// `2 (1 - t)^3` up to 1, then 0; for one that only transmits, or only receives, `1 - 2 t` up to `t = 1/2`. Its
    /// integral over `d >= 0` is a quarter of `wavelength / (integral of b)`, half of what this returns; that of the
    /// triangle `1 - d / length` is the same.
    pub fn coherence(&self, wavelength: f64) -> f64 {
        0.5 * wavelength / self.array_width
    }

    /// Whether fewer than `enough` rays start within `size` of the unit vector `aim` (sensor frame), as distances
    /// between the ends of unit vectors.
    pub fn has_fewer_rays(&self, enough: f32, aim: Vec3, size: f32) -> bool {
        let [x, y, z] = &self.direction;
        let square = size * size;
        let mut near = 0;
        for (index, [low, high]) in self.boxes.iter().enumerate() {
            if aim.distance_squared(aim.clamp(*low, *high)) >= square {
                continue;
            }
            let rays = index * BOX..((index + 1) * BOX).min(x.len());
            // Without branches inside.
            let within = |((x, y), z): ((&f32, &f32), &f32)| {
                let (x, y, z) = (x - aim.x, y - aim.y, z - aim.z);
                u32::from(x * x + y * y + z * z < square)
            };
            near += x[rays.clone()].iter().zip(&y[rays.clone()]).zip(&z[rays]).map(within).sum::<u32>();
            if near as f32 >= enough {
                return false;
            }
        }
        true
    }

    fn find_boxes(&mut self) {
        let [x, y, z] = &self.direction;
        let blocks = x.chunks(BOX).zip(y.chunks(BOX)).zip(z.chunks(BOX));
        let boxes = blocks.map(|((x, y), z)| {
            let rays = x.iter().zip(y).zip(z).map(|((x, y), z)| Vec3::new(*x, *y, *z));
            rays.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], ray| [low.min(ray), high.max(ray)])
        });
        self.boxes = boxes.collect();
    }

    /// Number of rays, over all directions.
    pub fn rays(&self) -> usize {
        self.weight.len()
    }

    /// Number of beams, one for each of its `axes`.
    pub fn beams(&self) -> usize {
        self.axes.len()
    }

    /// Whether every ray is received by one beam only: those of line arrays are not.
    pub fn beams_are_apart(&self) -> bool {
        self.flanks.is_empty()
    }

    /// Index of the face from which a ray starts.
    fn face(&self, ray: usize) -> usize {
        // For sonars with several faces, each `ReceivingBeams` is a beam.
        (self.receiving[ray] as usize).min(self.faces.len() - 1)
    }

    /// What receives instead of a face, or the face itself.
    fn receive_face(&self, face: usize) -> &Aperture {
        self.receive_faces.get(face).unwrap_or(&self.faces[face])
    }

    /// log2 of the power transmitted along the unit `direction` (sensor frame) over that along a ray.
    pub fn sent_beside(&self, ray: usize, direction: Vec3) -> f32 {
        self.faces[self.face(ray)].power(direction) - self.power[ray]
    }

    /// log2 of the power received from the unit `direction` (sensor frame) over that from the direction of a ray,
    /// without the beams' own pattern; and the index of the [`ReceivingBeams`] that gives that.
    pub fn received_beside(&self, ray: usize, direction: Vec3) -> (f32, u32) {
        let power = self.receive_face(self.face(ray)).power(direction);
        let ratio_log2 = match self.only_transmits {
            true if power <= FAINT => FAINT,
            true => 0.0,
            false => power - self.receive_power.get(ray).unwrap_or(&self.power[ray]),
        };
        let anywhere = self.receiving_beams.len() > self.of_rays;
        (ratio_log2, if anywhere { self.receiving_at(direction) } else { self.receiving[ray] })
    }

    /// log2 of the two-way power when transmitting along the unit `sent` and receiving from `received` (sensor frame),
    /// without the beams' own pattern, and the index of the [`ReceivingBeams`] that gives that; for each face.
    pub fn towards(&self, sent: Vec3, received: Vec3) -> impl Iterator<Item = (f32, u32)> {
        let steps = self.receiving_beams.len() - self.of_rays;
        self.faces.iter().enumerate().map(move |(face, aperture)| {
            let back = self.receive_face(face).power(received);
            let strength = aperture.power(sent) + if self.only_transmits && back > FAINT { 0.0 } else { back };
            (strength, if steps == 0 { face as u32 } else { self.receiving_at(received) })
        })
    }

    /// Correlation of what two [`ReceivingBeams`]s receive: 1 for the same, 0 where no beam receives both.
    pub fn overlap(&self, receiving: u32, other: u32) -> f32 {
        let [one, two] = [receiving, other].map(|index| self.receiving_beams[index as usize]);
        let end = |receiving: &ReceivingBeams| receiving.first + receiving.to - receiving.from;
        let (first, last) = (one.first.max(two.first), end(&one).min(end(&two)));
        let received =
            |receiving: &ReceivingBeams, beam: u32| self.beam_gain[(receiving.from + beam - receiving.first) as usize];
        let both = (first..last).map(|beam| received(&one, beam) * received(&two, beam)).sum::<f32>();
        let alone = |receiving: &ReceivingBeams| {
            self.beam_gain[receiving.from as usize..receiving.to as usize]
                .iter()
                .map(|strength| strength * strength)
                .sum::<f32>()
        };
        both / (alone(&one) * alone(&two)).sqrt().max(f32::MIN_POSITIVE)
    }

    /// The [`ReceivingBeams`] of the unit `direction` (sensor frame), by its sine to a line array.
    fn receiving_at(&self, direction: Vec3) -> u32 {
        let steps = self.receiving_beams.len() - self.of_rays;
        let step = ((0.5 + 0.5 * direction.y) * steps as f32) as usize;
        (self.of_rays + step.min(steps - 1)) as u32
    }

    fn find_receive_powers(&mut self) {
        if self.receive_faces.is_empty() {
            return;
        }
        let direction = |ray: usize| Vec3::from(self.direction.each_ref().map(|axis| axis[ray]));
        self.receive_power =
            (0..self.rays()).map(|ray| self.receive_face(self.face(ray)).power(direction(ray))).collect();
    }

    fn find_solid_angles(&mut self) {
        self.solid_angles = vec![0.0; self.beams()];
        for (weight, &receiving) in self.weight.iter().zip(&self.receiving) {
            let ReceivingBeams { first, from, to, .. } = self.receiving_beams[receiving as usize];
            let received = &self.beam_gain[from as usize..to as usize];
            for (sum, beam_gain) in self.solid_angles[first as usize..].iter_mut().zip(received) {
                *sum += weight.exp2() * beam_gain * beam_gain;
            }
        }
    }

    fn push(&mut self, direction: [f64; 3], tangent: [f64; 3], cell: f64, power: f64, one_way: f64) {
        for axis in 0..3 {
            self.direction[axis].push(direction[axis] as f32);
            self.tangent[axis].push(tangent[axis] as f32);
        }
        self.cell.push(cell as f32);
        self.weight.push(power.max(1e-30).log2() as f32);
        self.power.push((one_way.log2() as f32).max(FAINT));
        self.receiving.push(self.receiving_beams.len() as u32 - 1);
    }

    /// Adds a [`ReceivingBeams`] by the beams from `first` on, with the amplitudes `received`.
    fn add_receiving(&mut self, first: usize, part: u32, received: impl Iterator<Item = f32>) {
        if self.receiving_beams.is_empty() {
            self.beam_gain.resize(BEAMS, 0.0);
        }
        let from = self.beam_gain.len() as u32;
        self.beam_gain.extend(received);
        let to = self.beam_gain.len() as u32;
        self.beam_gain.resize(to as usize + BEAMS, 0.0);
        self.receiving_beams.push(ReceivingBeams { first: first as u32, from, to, part });
    }

    /// All rays from here on are received by one beam.
    fn received_by(&mut self, beam: usize) {
        self.add_receiving(beam, 0, std::iter::once(1.0));
    }

    /// Finds which beams receive from any direction, by its sine to a line array.
    fn received_anywhere(&mut self, sines: &[f64], lobe: &lobe::BeamPattern, extent: f64, with_angles: bool) {
        self.of_rays = self.receiving_beams.len();
        let steps = directions_of(lobe);
        for step in 0..steps {
            let sine = (2 * step + 1) as f64 / steps as f64 - 1.0;
            self.received_from(sine, sines, lobe, extent, with_angles);
        }
    }

    /// Finds how beams at the `sines` receive from farther than `extent` off their axes.
    fn find_flanks(&mut self, sines: &[f64], lobe: &lobe::BeamPattern, extent: f64) {
        /// Steps of the sine for each width of the lobe: sidelobes are about as wide.
        const FINE: f64 = 4.0;
        let part = 2.0 / FLANK_PARTS as f64;
        let steps = (FINE * part / lobe.width()).ceil().clamp(16.0, 256.0) as usize;
        for &axis in sines {
            self.flanks.extend((0..FLANK_PARTS).map(|index| {
                let sine = |step: usize| -1.0 + part * (index as f64 + (step as f64 + 0.5) / steps as f64);
                let far = (0..steps).map(sine).filter(|sine| (sine - axis).abs() > extent);
                (far.map(|sine| lobe.amplitude_steered(sine, axis).powi(2)).sum::<f64>() / steps as f64) as f32
            }));
        }
    }

    /// All rays from here on, `sine` from broadside of a line array, are received by beams at the `sines`, falling.
    fn received_from(&mut self, sine: f64, sines: &[f64], lobe: &lobe::BeamPattern, extent: f64, with_angles: bool) {
        let first = sines.partition_point(|&axis| axis > sine + extent);
        let end = sines.partition_point(|&axis| axis >= sine - extent).max(first);
        let part = ((0.5 + 0.5 * sine) * FLANK_PARTS as f64).clamp(0.0, FLANK_PARTS as f64 - 1.0) as u32;
        self.add_receiving(
            first,
            part,
            sines[first..end].iter().map(|&axis| lobe.amplitude_steered(sine, axis) as f32),
        );
        if with_angles {
            let angle = |sine: f64| sine.clamp(-1.0, 1.0).asin();
            self.beside.resize(self.beam_gain.len(), 0.0);
            let from = self.beam_gain.len() - BEAMS - (end - first);
            for (beside, &axis) in self.beside[from..].iter_mut().zip(&sines[first..end]) {
                *beside = (angle(sine) - angle(axis)) as f32;
            }
        }
    }

    fn sidescan(sonar: &Sidescan, wavelength: f64) -> Transducer {
        let lobe = sonar.along_deg.at(wavelength);
        let received = sonar.heard_along_deg.as_ref().unwrap_or(&sonar.along_deg).at(wavelength);
        let along = ThinSide::between(&lobe, &received);
        // Half a fan from nadir receives all of it equally.
        let half_fan = sonar.down_fov_deg.map(|fov| Lobe::Shape(Shape::Box { width_deg: 0.5 * fov }));
        let vertical = half_fan.as_ref().unwrap_or(&sonar.vertical_deg).at(wavelength);
        let axis = sonar.axis_deg().to_radians();
        let strata = match sonar.down_fov_deg.zip(sonar.step_deg) {
            Some((fov, step)) => {
                // One ray at each end of the fan, as in the paper's system.
                let count = (0.5 * fov / step + 1e-6).floor() as usize + 1;
                let step = step.to_radians();
                let stratum = |index| Stratum { at: -FRAC_PI_2 + index as f64 * step, size: step, power: 1.0 };
                (0..count).map(stratum).collect()
            }
            None => {
                let (low, high) = ((axis - FRAC_PI_2).max(-FRAC_PI_2), (axis + FRAC_PI_2).min(FRAC_PI_2));
                strata(
                    sonar.rays as usize,
                    (&vertical, axis),
                    [low, high],
                    |angle| vertical.amplitude((angle - axis).sin()).powi(4),
                    |_| 1.0,
                )
            }
        };
        let mut transducer = Transducer::default();
        for (beam, azimuth) in sonar.azimuths_deg().iter().enumerate() {
            let side = azimuth.signum();
            transducer.received_by(beam);
            for (index, Stratum { at, size, power }) in strata.iter().enumerate() {
                let (sin, cos) = at.sin_cos();
                let ([forward, level], tangent) = (along.sine_cosine(index), [0.0, -side * sin, cos]);
                let direction = [forward, side * cos * level, sin * level];
                let one_way = power.sqrt() * lobe.amplitude(forward).powi(2);
                transducer.push(direction, tangent, *size, power * size * along.width, one_way);
            }
            let (sin, cos) = axis.sin_cos();
            let frame = [[0.0, side * cos, sin], [1.0, 0.0, 0.0], [0.0, -side * sin, cos]];
            let across = (|sine| vertical.amplitude(sine), vertical.width());
            transducer.faces.push(Aperture::new(frame, (|sine| lobe.amplitude(sine), lobe.width()), across));
            if sonar.heard_along_deg.is_some() {
                transducer.receive_faces.push(Aperture::new(
                    frame,
                    (|sine| received.amplitude(sine), received.width()),
                    across,
                ));
            }
        }
        transducer.narrowest = lobe.width().min(received.width()).min(vertical.width());
        (transducer.array, transducer.array_width) = (Vec3::X, along.width);
        transducer.directivity_db = lobe::directivity(&received, &vertical);
        transducer
    }

    fn multibeam(swath: &Multibeam, wavelength: f64, ratio: f64) -> Transducer {
        let (sent, received) = (swath.along_deg.at(wavelength), swath.across_deg.at(wavelength));
        let along = ThinSide::new(|sine| sent.amplitude(sine).powi(2), sent.extent(1e-3));
        let sines: Vec<f64> = swath.angles_deg().map(|angle| sine_deg(angle) * ratio).collect();
        let extent = received.extent_within(FAINTEST, 1.0 + sines[0].abs());
        let widest = (0.5 * swath.swath_deg).to_radians();
        // Rays extend as far beyond the outermost beams as these receive, but not upwards.
        let most = (widest.sin() * ratio.max(1.0) + extent).min(88f64.to_radians().sin()).asin().max(widest);
        let count = swath.beams as usize * swath.rays as usize;
        let mut transducer = Transducer::default();
        for index in 0..count {
            let at = most * (1.0 - (2 * index + 1) as f64 / count as f64);
            let size = 2.0 * most / count as f64;
            let (sin, cos) = at.sin_cos();
            let [forward, level] = along.sine_cosine(index);
            transducer.received_from(sin * level, &sines, &received, extent, true);
            let one_way = sent.amplitude(forward).powi(2);
            transducer.push([forward, sin * level, -cos * level], [0.0, cos, sin], size, size * along.width, one_way);
            transducer.aside.push(along.size(index) as f32);
        }
        transducer.received_anywhere(&sines, &received, extent, true);
        transducer.find_flanks(&sines, &received, extent);
        let frame = [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        transducer.faces = vec![Aperture::new(frame, (|sine| sent.amplitude(sine), sent.width()), EVERYWHERE)];
        transducer.only_transmits = true;
        // Seen off broadside, the array is shorter.
        let steered = |sine: &f64| received.width() / (1.0 - sine * sine).max(1e-4).sqrt();
        transducer.widths = sines.iter().map(|sine| steered(sine) as f32).collect();
        transducer.narrowest = sent.width().min(received.width());
        (transducer.array, transducer.array_width) = (Vec3::X, along.width);
        transducer.directivity_db = lobe::wall_directivity(&received);
        transducer
    }

    /// Beams of a line array are cones about it: rays of one [`ReceivingBeams`] are at one angle to the array.
    fn imaging(array: &Imaging, wavelength: f64, ratio: f64) -> Transducer {
        /// [`ReceivingBeams`]s within the width of a beam, at least.
        const WITHIN: f64 = 2.2;
        let (received, vertical) = (array.beam_deg.at(wavelength), array.vertical_deg.at(wavelength));
        let sines: Vec<f64> = array.bearings_deg().map(|bearing| sine_deg(bearing) * ratio).collect();
        let extent = received.extent_within(FAINTEST, 1.0 + sines[0].abs());
        let widest = 0.5 * array.fov_deg.to_radians();
        let most = (widest.sin() * ratio.max(1.0) + 0.5 * extent).min(1.0);
        let spacing = 2.0 * widest / f64::from(array.beams - 1);
        let fine = (WITHIN * spacing / received.width()).ceil().clamp(1.0, 64.0) as usize;
        let (columns, rows) = (fine * array.beams as usize, (array.rays as usize).div_ceil(fine).max(4));
        let power = |angle: f64| vertical.amplitude(angle.sin()).powi(4);
        let rows = strata(rows, (&vertical, 0.0), [-FRAC_PI_2, FRAC_PI_2], power, |_| 1.0);
        let tilt = array.tilt_deg.to_radians().sin_cos();
        let tilted = |[x, y, z]: [f64; 3]| [x * tilt.1 + z * tilt.0, y, z * tilt.1 - x * tilt.0];
        let mut transducer = Transducer::default();
        for column in 0..columns {
            let at = most.asin() * (1.0 - (2 * column + 1) as f64 / columns as f64);
            let (sine, cosine) = at.sin_cos();
            let size = 2.0 * most.asin() / columns as f64 * cosine;
            transducer.received_from(sine, &sines, &received, extent, false);
            let shift = golden(column) - 0.5;
            for row in &rows {
                let angle = row.at + shift * row.size;
                let (sin, cos) = angle.sin_cos();
                let direction = tilted([cosine * cos, sine, cosine * sin]);
                let tangent = tilted([-sin, 0.0, cos]);
                // Solid angle about the array's axis: d(sine) d(angle).
                let power = power(angle);
                transducer.push(direction, tangent, row.size * cosine, power * row.size * size, power.sqrt());
            }
        }
        transducer.received_anywhere(&sines, &received, extent, false);
        transducer.find_flanks(&sines, &received, extent);
        let frame = [tilted([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], tilted([0.0, 0.0, 1.0])];
        let up = |sine: f64| vertical.amplitude(sine);
        transducer.faces = vec![Aperture::new(frame, EVERYWHERE, (up, vertical.width()))];
        transducer.narrowest = received.width().min(vertical.width());
        let aside = ThinSide::new(|sine| received.amplitude(sine).powi(2), received.extent(1e-3));
        (transducer.array, transducer.array_width) = (Vec3::Y, aside.width);
        transducer.directivity_db = lobe::directivity(&received, &vertical);
        transducer
    }

    fn single(sonar: &SingleBeam, wavelength: f64) -> Transducer {
        let count = sonar.rays as usize;
        let tilt = sonar.tilt_deg.to_radians().sin_cos();
        let tilted = |[x, y, z]: [f64; 3]| [x * tilt.1 + z * tilt.0, y, z * tilt.1 - x * tilt.0];
        let frame = [tilted([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], tilted([0.0, 0.0, 1.0])];
        let mut transducer = Transducer::default();
        transducer.received_by(0);
        let [lobe, received] = sonar.lobes().map(|lobe| lobe.at(wavelength));
        let apart = sonar.heard_deg.is_some();
        transducer.narrowest = lobe.width().min(received.width());
        let both = ThinSide::between(&lobe, &received);
        (transducer.array, transducer.array_width) = (Vec3::Y, both.width);
        if let Some(vertical) = &sonar.vertical_deg {
            let vertical = vertical.at(wavelength);
            let power = |angle: f64| vertical.amplitude(angle.sin()).powi(4);
            let power_aside = |angle: f64| (lobe.amplitude(angle.sin()) * received.amplitude(angle.sin())).powi(2);
            // Cells about as high as they are wide.
            let columns = (count as f64 * lobe.width() / vertical.width()).sqrt().round();
            let columns = (columns as usize).clamp(1, count / 4);
            let most = ThinSide::extent(&lobe, &received).min(1.0).asin();
            let columns = strata(columns, (&lobe, 0.0), [-most, most], power_aside, |_| 1.0);
            // A single column is as wide as the beam, not as its sidelobes.
            let half = [-FRAC_PI_2, FRAC_PI_2];
            let rows = strata(count / columns.len(), (&vertical, 0.0), half, power, |_| 1.0);
            for (index, column) in columns.iter().enumerate() {
                // On average no column is higher than the others.
                let shift = golden(index) - 0.5 + 0.5 / columns.len() as f64;
                for (index, row) in rows.iter().enumerate() {
                    let angle = row.at + shift * row.size;
                    let angle_aside = column.at + (golden(index) - 0.5) * column.size;
                    let ((sin, cos), (aside, level)) = (angle.sin_cos(), angle_aside.sin_cos());
                    let direction = tilted([cos * level, aside, sin * level]);
                    let (up, power_aside) = (power(angle), power_aside(angle_aside));
                    // The sideways angle is a latitude: a step of the other angle is shorter there by its cosine.
                    let size = row.size * level;
                    transducer.push(
                        direction,
                        tilted([-sin, 0.0, cos]),
                        size,
                        up * power_aside * size * column.size,
                        up.sqrt() * lobe.amplitude(aside).powi(2),
                    );
                    transducer.aside.push(column.size.min(both.width) as f32);
                }
            }
            let face = |lobe: &lobe::BeamPattern| {
                let (aside, up) = (|sine: f64| lobe.amplitude(sine), |sine: f64| vertical.amplitude(sine));
                Aperture::new(frame, (aside, lobe.width()), (up, vertical.width()))
            };
            transducer.faces = vec![face(&lobe)];
            transducer.receive_faces = if apart { vec![face(&received)] } else { Vec::new() };
            transducer.widths = vec![vertical.width() as f32];
            transducer.narrowest = transducer.narrowest.min(vertical.width());
            transducer.directivity_db = lobe::directivity(&received, &vertical);
        } else {
            transducer.round(frame, [&lobe, &received], apart, count);
            transducer.widths = vec![lobe.width().min(received.width()) as f32];
            transducer.directivity_db = lobe::round_directivity(&received);
        }
        transducer
    }

    fn janus(sonar: &Janus, wavelength: f64) -> Transducer {
        let lobe = sonar.lobe().at(wavelength);
        let mut transducer = Transducer::default();
        for (beam, [x, y, z]) in sonar.axes().into_iter().enumerate() {
            let level = x.hypot(y);
            // The axis, the horizontal to its left, and up across both.
            let frame = [[x, y, z], [-y / level, x / level, 0.0], [-x * z / level, -y * z / level, level]];
            transducer.received_by(beam);
            transducer.round(frame, [&lobe, &lobe], false, sonar.rays as usize);
            transducer.widths.push(lobe.width() as f32);
        }
        transducer.narrowest = lobe.width();
        transducer.directivity_db = lobe::round_directivity(&lobe);
        transducer
    }

    /// Adds `count` rays of a round beam, transmitted and received with the `lobes`, and its face; `apart`: another
    /// face receives. `frame`: its axis and two directions across it.
    fn round(&mut self, frame: [[f64; 3]; 3], lobes: [&lobe::BeamPattern; 2], apart: bool, count: usize) {
        let [sent, received] = lobes;
        let turned = |[ahead, left, up]: [f64; 3]| {
            std::array::from_fn(|axis| ahead * frame[0][axis] + left * frame[1][axis] + up * frame[2][axis])
        };
        let two_way = |angle: f64| (sent.amplitude(angle.sin()) * received.amplitude(angle.sin())).powi(2);
        for (index, ring) in strata(count, (sent, 0.0), [0.0, FRAC_PI_2], two_way, f64::sin).iter().enumerate() {
            let ((sin, cos), (left, up)) = (ring.at.sin_cos(), (2.0 * PI * golden(index)).sin_cos());
            let direction = turned([cos, sin * left, sin * up]);
            let tangent = turned([-sin, cos * left, cos * up]);
            let solid = 2.0 * PI * ((ring.at - 0.5 * ring.size).cos() - (ring.at + 0.5 * ring.size).cos());
            let one_way = sent.amplitude(ring.at.sin()).powi(2);
            self.push(direction, tangent, solid.sqrt(), ring.power * solid, one_way);
            self.aside.push(solid.sqrt() as f32);
        }
        let face = |lobe: &lobe::BeamPattern| Aperture::round(frame, |sine| lobe.amplitude(sine), lobe.width());
        self.faces.push(face(sent));
        if apart {
            self.receive_faces.push(face(received));
        }
    }
}

/// Number of steps of the sine in reception from any direction.
fn directions_of(lobe: &lobe::BeamPattern) -> usize {
    /// Steps for each width of a beam.
    const FINE: f64 = 16.0;
    (2.0 * FINE / lobe.width()).ceil().clamp(64.0, 65_536.0) as usize
}

fn sine_deg(angle: f64) -> f64 {
    angle.to_radians().sin()
}

/// Azimuth and elevation of the beams, rad.
fn axes(pattern: &Pattern) -> Vec<[f32; 2]> {
    let table = pattern.beams(0.0).expect("the pattern of a sensor has been drawn before");
    let axis = |beam: usize| azimuth_elevation([table.dir_x[beam], table.dir_y[beam], table.dir_z[beam]]);
    (0..table.len()).map(axis).collect()
}

/// `index` times the golden ratio, without its whole part: evenly distributed, and never repeating.
fn golden(index: usize) -> f64 {
    (index as f64 * 0.618_033_988_749_894_9).fract()
}

/// A part of a fan that one ray represents.
#[derive(Clone, Copy, Debug)]
struct Stratum {
    /// Its middle and size, rad.
    at: f64,
    size: f64,
    /// Power at its middle.
    power: f64,
}

/// `count` parts of a fan of a `lobe` about an axis, rad: small where it is strong, but some everywhere. `measure`:
/// solid angle of a ring by angle.
fn strata(
    count: usize,
    (lobe, axis): (&lobe::BeamPattern, f64),
    [low, high]: [f64; 2],
    power: impl Fn(f64) -> f64,
    measure: impl Fn(f64) -> f64,
) -> Vec<Stratum> {
    /// Steps for summing the density, over all and again about the axis.
    const STEPS: usize = 8192;
    /// Widths of the lobe to each side that have steps of their own.
    const WIDTHS: f64 = 20.0;
    let about = [axis - WIDTHS * lobe.width(), axis + WIDTHS * lobe.width()].map(|angle| angle.clamp(low, high));
    let even = |[low, high]: [f64; 2]| (0..=STEPS).map(move |k| low + (high - low) * k as f64 / STEPS as f64);
    let mut steps: Vec<f64> = even([low, high]).chain(even(about)).collect();
    steps.sort_by(f64::total_cmp);
    let steps: Vec<[f64; 2]> = steps.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    // Rays in proportion to amplitude: a compromise between power, which is noisy, and even sampling.
    let ring = |[from, to]: &[f64; 2]| {
        let at = 0.5 * (from + to);
        let even = measure(at) * (to - from);
        [power(at).sqrt() * even, even]
    };
    let rings: Vec<[f64; 2]> = steps.iter().map(ring).collect();
    let sums = [0, 1].map(|of| rings.iter().map(|ring| ring[of]).sum::<f64>().max(1e-300));
    let mut rays = 0.0;
    let mut edges = vec![low];
    for ([from, to], [strength, even]) in steps.into_iter().zip(rings) {
        let density = count as f64 * ((1.0 - EVEN) * strength / sums[0] + EVEN * even / sums[1]);
        while edges.len() < count && rays + density >= edges.len() as f64 {
            let part = (edges.len() as f64 - rays) / density;
            edges.push(from + (to - from) * part);
        }
        rays += density;
    }
    edges.resize(count, high);
    edges.push(high);
    let stratum = |pair: &[f64]| {
        let at = 0.5 * (pair[0] + pair[1]);
        Stratum { at, size: pair[1] - pair[0], power: power(at) }
    };
    edges.windows(2).map(stratum).collect()
}

/// The thin side of a fan: the angles of rays across it such that all have the same weight.
struct ThinSide {
    /// Its power over all angles, rad.
    width: f64,
    /// Angles with equal power between them, rad.
    angles: Vec<f64>,
}

impl ThinSide {
    /// The thin side for lobes that transmit and receive.
    fn between(sent: &lobe::BeamPattern, received: &lobe::BeamPattern) -> ThinSide {
        let power = |sine| (sent.amplitude(sine) * received.amplitude(sine)).powi(2);
        ThinSide::new(power, ThinSide::extent(sent, received))
    }

    /// Sine up to which both together count: down to 1e-4 of their power where they are alike.
    fn extent(sent: &lobe::BeamPattern, received: &lobe::BeamPattern) -> f64 {
        sent.extent(1e-2).max(received.extent(1e-2)).min(sent.extent(1e-4)).min(received.extent(1e-4))
    }

    /// The thin side for a lobe with `power` at a sine, up to `extent`.
    fn new(power: impl Fn(f64) -> f64, extent: f64) -> ThinSide {
        const STEPS: usize = 4096;
        const ANGLES: usize = 1024;
        let most = extent.min(1.0).asin();
        let step = 2.0 * most / STEPS as f64;
        let middle = |index: usize| -most + (index as f64 + 0.5) * step;
        let part = |index: usize| power(middle(index).sin()) * middle(index).cos() * step;
        let parts: Vec<f64> = (0..STEPS).map(part).collect();
        let width = parts.iter().sum::<f64>();
        let mut angles = Vec::with_capacity(ANGLES);
        let mut sum = 0.0;
        for (index, part) in parts.iter().enumerate() {
            while angles.len() < ANGLES && (angles.len() as f64 + 0.5) / ANGLES as f64 * width <= sum + part {
                angles.push(middle(index));
            }
            sum += part;
        }
        angles.resize(ANGLES, most);
        ThinSide { width, angles }
    }

    /// Sine and cosine of the angle of ray `index`.
    fn sine_cosine(&self, index: usize) -> [f64; 2] {
        self.angles[(golden(index) * self.angles.len() as f64) as usize].sin_cos().into()
    }

    /// Extent of the angles that ray `index` represents among its neighbours, rad: in the sidelobes, where rays are
    /// few, it is wide; without it, what they hit would be as strong as a point.
    fn size(&self, index: usize) -> f64 {
        /// Neighbouring rays that together have covered all of the lobe.
        const NEIGHBOURS: f64 = 16.0;
        let at = |part: f64| self.angles[(part.clamp(0.0, 1.0) * (self.angles.len() - 1) as f64) as usize];
        at(golden(index) + 0.5 / NEIGHBOURS) - at(golden(index) - 0.5 / NEIGHBOURS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_near_a_direction_are_those_within_its_distance() {
        let angles = (0..3000).map(|index| (0.001 * f64::from(index) - 1.0, 1.5 * golden(index as usize)));
        let rays: Vec<Vec3> = angles
            .map(|(a, b)| Vec3::new((a.cos() * b.cos()) as f32, a.sin() as f32, (a.cos() * b.sin()) as f32))
            .collect();
        let mut transducer = Transducer {
            direction: [0, 1, 2].map(|axis| rays.iter().map(|ray| ray[axis]).collect()),
            ..Transducer::default()
        };
        transducer.find_boxes();
        for aim in rays.iter().step_by(301).copied().chain([Vec3::NEG_X]) {
            for size in [0.0, 0.003, 0.1, 0.7, 3.0] {
                let near = rays.iter().filter(|ray| ray.distance_squared(aim) < size * size).count();
                assert!(transducer.has_fewer_rays(near as f32 + 1.0, aim, size), "{aim} {size}");
                assert!(near == 0 || !transducer.has_fewer_rays(near as f32, aim, size), "{aim} {size}");
            }
        }
    }
}
