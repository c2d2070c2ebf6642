//! Echoes of rain and snow: a few scatterers in each shell of range that return what all drops in it do.

use super::paths::FramePaths;
use crate::echo::radar::{RadarEcho, RadarRoute, WaveField};
use crate::medium::{Precipitation, RadioMedium};
use glam::{DVec3, Vec3};
use ground::lanes::MEDIUM;
use ground::rng::{Draw, Rng};
use num_complex::Complex32;
use std::f64::consts::PI;

/// Scatterers of a shell.
const SCATTERERS: u32 = 16;

/// Standard deviation of the velocity of air, m/s: turbulence (Doviak and Zrnic 1993, Doppler Radar and Weather
/// Observations, 5.3: 1 to 2 m/s of spectrum width).
const TURBULENCE: f64 = 1.0;

/// Adds the echoes of what falls in a sector of azimuths and elevations, rad, to `paths`: the volume `V` of a shell has the
/// radar cross-section `eta V`.
pub(super) fn add_precipitation(
    field: &WaveField,
    sector: [[f64; 2]; 2],
    resolution: f64,
    rng: &Rng,
    paths: &mut FramePaths,
) {
    let media = field.air.media.iter().filter_map(|medium| Some((medium, medium.precipitation?)));
    for (number, (medium, falling)) in (0..).zip(media) {
        let mut shell = 1;
        // The nearest shell is within the radome.
        while f64::from(shell) * resolution < field.reach {
            let range = f64::from(shell) * resolution;
            let mut any = false;
            for scatterer in 0..SCATTERERS {
                let address = [shell * SCATTERERS + scatterer, number];
                any |= add_scatterer(field, sector, (range, resolution), (medium, falling), address, rng, paths);
            }
            // Weaker than the noise from here on.
            if !any && range > 20.0 * resolution {
                break;
            }
            shell += 1;
        }
    }
}

/// Adds one scatterer; returns whether it could matter.
fn add_scatterer(
    field: &WaveField,
    [azimuth, elevation]: [[f64; 2]; 2],
    (range, resolution): (f64, f64),
    (medium, falling): (&RadioMedium, Precipitation),
    address: [u32; 2],
    rng: &Rng,
    paths: &mut FramePaths,
) -> bool {
    let [a, b, c, d] = rng.words(address, Draw::RadarRain).map(|word| f64::from(word) / 2f64.powi(32));
    let between = |[least, most]: [f64; 2], part: f64| least + (most - least) * part;
    let angle = between(azimuth, a);
    // Even over the solid angle.
    let height = between(elevation.map(f64::sin), b);
    let level = (1.0 - height * height).max(0.0).sqrt();
    let own = Vec3::new((level * angle.cos()) as f32, (level * angle.sin()) as f32, height as f32);
    let along = (field.axes * own.as_dvec3()).as_vec3();
    let solid = (azimuth[1] - azimuth[0]) * (elevation[1].sin() - elevation[0].sin());
    let place = field.place + along.as_dvec3() * range;
    let (from, to) = medium.extent.interval(field.place.as_vec3(), along, 0.0, range as f32);
    if to < from || f64::from(to) < range * 0.999 {
        return true;
    }
    let volume = range * range * resolution * solid / f64::from(SCATTERERS);
    let area = falling.eta_m2_per_m3 * volume;
    let strength = (area / (4.0 * PI)).sqrt() / (range * range);
    let kept = field.air_kept([(along, range), (along, range)]);
    let amplitude = strength * field.scale() * kept;
    if amplitude * field.gain(along, along) < field.floor {
        return false;
    }
    // Exponentially distributed power, and any phase.
    let drawn = (-(1.0 - c).ln()).sqrt();
    let phasor = Complex32::from_polar((amplitude * drawn) as f32, (2.0 * PI * d) as f32);
    let [gust, fall] = rng.normal_pair(address[0], Draw::RadarRain, address[1].wrapping_add(1 << 16)).map(f64::from);
    let speed = falling.fall_m_s + falling.fall_spread_m_s * fall;
    let velocity = DVec3::new(0.0, 0.0, -speed) - field.velocity;
    let rate = velocity.dot(along.as_dvec3()) + TURBULENCE * gust;
    paths.echoes.push(RadarEcho {
        range,
        range_rate: rate as f32,
        amplitude: phasor,
        tx: (own, range as f32),
        rx: (own, range as f32),
        row: MEDIUM,
        triangle: medium.cause as u32,
        target: u32::MAX,
        route: RadarRoute::Direct,
        place: place.as_vec3(),
    });
    true
}
