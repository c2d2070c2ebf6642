//! The wave that a radar sends, and what becomes of it on its way: its polarisation, reflections, losses, and the Doppler
//! shift of what moves.

use super::RadarSurfaces;
use super::echoes::{RadarEcho, RadarRoute};
use crate::medium::RadioAir;
use crate::trace::{MOST_MIRRORS, Mirror, MirrorChain, Sighted, Tables};
use glam::{DMat3, DVec3, Vec3};
use model::material::{Polarised, RadioSurface};
use num_complex::{Complex32, Complex64};
use radar::{LobeTable, Polarisation};
use std::f64::consts::PI;

/// A radar at one moment, in one scene.
pub(crate) struct WaveField<'a> {
    pub scene: &'a Tables,
    pub surfaces: &'a RadarSurfaces,
    /// Place of the radar, relative to the scene's origin, m.
    pub place: DVec3,
    /// World from the radar's axes.
    pub axes: DMat3,
    /// Its velocity, m/s, world.
    pub velocity: DVec3,
    /// 0 to 1 in the scene's time span.
    pub time: f32,
    /// m.
    pub wavelength: f64,
    pub polarisation: Polarisation,
    pub tx: &'a LobeTable,
    pub rx: &'a LobeTable,
    /// Power of a transmitter at its element, W.
    pub power: f64,
    /// What attenuates in the air.
    pub air: &'a RadioAir,
    /// Ranges that the radar receives, m.
    pub reach: f64,
    /// Azimuths and elevations in which it looks, rad.
    pub sector: [[f64; 2]; 2],
    /// Amplitude, sqrt(W), below which all echoes of a cell together do not matter: 10 dB below the noise of all channels.
    pub floor: f64,
}

/// A wave: complex components of its field, world.
#[derive(Clone, Copy, Debug)]
struct ElectricField([Complex32; 3]);

impl ElectricField {
    fn along(direction: Vec3) -> ElectricField {
        ElectricField(direction.to_array().map(Complex32::from))
    }

    fn dot(&self, direction: Vec3) -> Complex32 {
        let [x, y, z] = direction.to_array();
        self.0[0] * x + self.0[1] * y + self.0[2] * z
    }

    /// The field after reflection of a wave along `from`, which goes on along `to`.
    fn reflected(&self, from: Vec3, to: Vec3, reflection: Polarised) -> ElectricField {
        // At right angles to the plane of incidence, and in it before and after.
        let Some(s) = from.cross(to).try_normalize() else {
            // Back the way it came.
            return ElectricField(self.0.map(|value| value * reflection.s));
        };
        let [across, within] = [self.dot(s) * reflection.s, self.dot(s.cross(from)) * reflection.p];
        let (s, p) = (s.to_array(), s.cross(to).to_array());
        ElectricField(std::array::from_fn(|axis| across * s[axis] + within * p[axis]))
    }
}

/// What reflects or scatters an echo, and how strongly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatterer {
    /// Row of surfaces and triangle.
    pub row: u32,
    pub triangle: u32,
    /// m/s, world.
    pub velocity: Vec3,
    /// Relative to the scene's origin, m.
    pub place: DVec3,
    /// As for a perfect reflector, 1/m: see [`radar::optics`].
    pub strength: Complex64,
    /// Whether the strength is all there is to it; otherwise the material reflects.
    pub incoherent: bool,
}

impl WaveField<'_> {
    /// Whether the radar looks in a direction, a unit vector, world, or within `aside` rad of it.
    pub fn looks(&self, along: DVec3, aside: f64) -> bool {
        let [azimuth, elevation] = self.sector;
        let own = self.axes.transpose() * along;
        let up = own.z.clamp(-1.0, 1.0).asin();
        // Azimuths span more the nearer a direction is to the zenith.
        let level = (1.0 - own.z * own.z).max(0.0).sqrt();
        let sine = aside.min(0.5 * PI).sin();
        let aside_left = if level > sine { (sine / level).asin() } else { PI };
        let left = own.y.atan2(own.x);
        let within = |[least, most]: [f64; 2], angle: f64, aside: f64| angle + aside >= least && angle - aside <= most;
        let around = [-2.0 * PI, 0.0, 2.0 * PI].into_iter().any(|turn| within(azimuth, left + turn, aside_left));
        around && within(elevation, up, aside)
    }

    /// Amplitude of the noise of all channels together, sqrt(W).
    pub fn noise(&self) -> f64 {
        self.floor * 10f64.sqrt()
    }

    /// Gain of amplitudes in the middle of the field of view, both ways.
    pub fn gain_ahead(&self) -> f64 {
        let ahead = [1.0, 0.0, 0.0];
        f64::from(self.tx.amplitude(ahead)) * f64::from(self.rx.amplitude(ahead))
    }

    /// Wave number, rad/m.
    pub fn k(&self) -> f64 {
        2.0 * PI / self.wavelength
    }

    /// Received amplitude per strength of an echo, without the gains of elements, sqrt(W) m.
    pub fn scale(&self) -> f64 {
        self.power.sqrt() * self.wavelength / (4.0 * PI)
    }

    /// A direction in the radar's axes.
    pub fn own(&self, direction: Vec3) -> Vec3 {
        (self.axes.transpose() * direction.as_dvec3()).as_vec3()
    }

    /// Gain of amplitudes, both ways, of waves that leave along `out` and come from `back`, world.
    pub fn gain(&self, out: Vec3, back: Vec3) -> f64 {
        let [out, back] = [self.own(out).to_array(), self.own(back).to_array()];
        f64::from(self.tx.amplitude(out)) * f64::from(self.rx.amplitude(back))
    }

    /// Direction of the electric field of waves along a direction, world.
    fn polarised(&self, direction: Vec3) -> Vec3 {
        let axis = match self.polarisation {
            Polarisation::Vertical => self.axes.z_axis,
            Polarisation::Horizontal => self.axes.y_axis,
        };
        let axis = axis.as_vec3();
        (axis - direction * axis.dot(direction)).try_normalize().unwrap_or_else(|| direction.any_orthonormal_vector())
    }

    /// Part of the amplitude of a wave to `target` that `mirrors` leave, about at most; `image` is the radar's in them.
    pub fn kept(&self, mirrors: impl Iterator<Item = Mirror>, image: DVec3, target: DVec3) -> f64 {
        let along = (target - image).normalize_or_zero();
        let one = |mirror: Mirror| {
            let cos = mirror.normal.dot(along).abs() as f32;
            // Waves to other parts of a target are met at other angles.
            let at = |part: f32| self.surfaces.mirrored(&self.scene.surfaces, mirror.row, part * cos);
            f64::from(at(0.8).max(at(1.0)).max(at(1.25)))
        };
        mirrors.map(one).product()
    }

    fn reflection(&self, surface: &RadioSurface, cos: f32) -> Polarised {
        let Polarised { s, p } = surface.reflect(cos);
        let kept = surface.coherent(cos);
        Polarised { s: s * kept, p: p * kept }
    }

    /// Fraction of the amplitude that air leaves along ways in these directions, m.
    pub fn air_kept(&self, ways: [(Vec3, f64); 2]) -> f64 {
        if self.air.media.is_empty() {
            return 1.0;
        }
        let lost =
            |(along, length): (Vec3, f64)| self.air.attenuation_db(self.place.as_vec3(), along, 0.0, length as f32);
        10f64.powf(-0.05 * ways.into_iter().map(lost).sum::<f64>())
    }

    /// The echo of `scattering` along `route` by way of `mirrors`, as `sighted` found them; number `target` of the list of
    /// targets.
    pub(super) fn echo(
        &self,
        scattering: &Scatterer,
        mirrors: &MirrorChain,
        sighted: &Sighted,
        route: RadarRoute,
        target: u32,
    ) -> Option<RadarEcho> {
        let Scatterer { row, triangle, velocity, place, strength, incoherent } = *scattering;
        let bends = mirrors.bends(place)?;
        let directions = mirrors.directions(place, &bends);
        let count = mirrors.all().len();
        let straight = place - self.place;
        let (direct, distance) = (straight.normalize().as_vec3(), straight.length());
        let folded = (place - mirrors.image()).length();
        let (there, back) = (directions[count], if route == RadarRoute::Both { -directions[count] } else { -direct });
        let arrives = if route == RadarRoute::Both { directions[0] } else { direct };
        let mut field = ElectricField::along(self.polarised(directions[0]));
        let mirror = |number: usize| {
            let surface = self.surfaces.of(&self.scene.surfaces, sighted.mirrors[number].row);
            let cos = mirrors.all()[number].normal.as_vec3().dot(directions[number]).abs();
            self.reflection(surface, cos)
        };
        for number in 0..count {
            field = field.reflected(directions[number], directions[number + 1], mirror(number));
        }
        if !incoherent {
            // As a mirror that turned the wave there would.
            let cos = (0.5 * (1.0 - there.dot(back))).max(0.0).sqrt();
            let surface = self.surfaces.of(&self.scene.surfaces, row);
            field = field.reflected(there, back, self.reflection(surface, cos));
        }
        if route == RadarRoute::Both {
            for number in (0..count).rev() {
                field = field.reflected(-directions[number + 1], -directions[number], mirror(number));
            }
        }
        let received = field.dot(self.polarised(arrives));
        let length = folded + if route == RadarRoute::Both { folded } else { distance };
        let kept = f64::from(sighted.through) * self.scale();
        let kept = kept * self.air_kept([(directions[0], folded), (arrives, length - folded)]);
        let amplitude = strength * Complex64::new(received.re.into(), received.im.into()) * kept;
        let twice = if route == RadarRoute::Both { 2.0 } else { 1.0 };
        let mut rate = -self.velocity.as_vec3().dot(directions[0] + arrives) + velocity.dot(there - back);
        for (number, hit) in sighted.mirrors.iter().enumerate().take(count.min(MOST_MIRRORS)) {
            if let Some(movement) = self.scene.movement(None, hit.row, hit.triangle, hit.uv, self.time) {
                rate += twice * movement.velocity.dot(directions[number] - directions[number + 1]);
            }
        }
        let tx = (self.own(directions[0]), folded as f32);
        let rx = (self.own(arrives), if route == RadarRoute::Both { folded } else { distance } as f32);
        Some(RadarEcho {
            range: 0.5 * length,
            range_rate: 0.5 * rate,
            amplitude: Complex32::new(amplitude.re as f32, amplitude.im as f32),
            tx,
            rx,
            row,
            triangle,
            target,
            route,
            place: place.as_vec3(),
        })
    }
}
