//! An environment prepared for the beams of one scan.

use super::{Environment, Extent, Particles, Placed, RainModel, Region};
use glam::{DVec3, Vec3};
use ground::cause::Cause;

/// A medium in the air.
#[derive(Clone, Debug)]
pub(crate) struct Medium {
    pub extent: Extent,
    /// Extinction, 1/m.
    pub extinction: f64,
    /// Backscatter, 1/(m sr).
    pub backscatter: f64,
    pub cause: Cause,
    /// Drops or flakes that may appear individually.
    pub particles: Option<Particles>,
}

impl Medium {
    /// One-way optical depth of `length` m from `origin` on; `travelled`: the beam's path up to there, m.
    pub fn depth(&self, origin: Vec3, direction: Vec3, travelled: f32, length: f32) -> f32 {
        let (from, to) = self.extent.interval(origin, direction, travelled, length);
        self.extinction as f32 * (to - from).max(0.0)
    }
}

/// All media in the air.
#[derive(Clone, Debug, Default)]
pub(crate) struct Weather {
    pub media: Vec<Medium>,
    /// Standard deviation of ranges relative to the range, from rain.
    pub range_noise: f32,
}

impl Weather {
    /// `as_the_paper`: whether the paper's choices apply where the environment makes none. `origin`: world position of
    /// the rays' (0, 0, 0).
    pub fn new(environment: &Environment, wavelength_nm: f64, as_the_paper: bool, origin: DVec3) -> Weather {
        let mut weather = Weather::default();
        let mut add = |region: Region, [extinction, backscatter]: [f64; 2], cause, particles: Option<Particles>| {
            if extinction > 0.0 {
                let extent = Extent::new(region, origin);
                weather.media.push(Medium { extent, extinction, backscatter, cause, particles });
            }
        };
        if let Some(air) = &environment.clear_air {
            add(Region::Everywhere, [air.extinction(wavelength_nm), 0.0], Cause::Fog, None);
        }
        let mut range_noise = 0.0f64;
        for Placed { what: rain, region } in &environment.rain {
            let model = if as_the_paper { RainModel::Paper } else { RainModel::Itu };
            let drops = rain.drop_sizes().filter(|_| rain.drops.unwrap_or(!as_the_paper));
            add(*region, [rain.extinction(model), 0.0], Cause::Rain, drops);
            if rain.range_noise.unwrap_or(as_the_paper) && *region == Region::Everywhere {
                range_noise = range_noise.hypot(rain.range_sigma());
            }
        }
        for Placed { what: fog, region } in &environment.fog {
            add(*region, fog.coefficients(wavelength_nm), Cause::Fog, None);
        }
        for Placed { what: snow, region } in &environment.snow {
            let flakes = snow.flake_sizes().filter(|_| snow.flakes.unwrap_or(!as_the_paper));
            add(*region, [snow.extinction(), 0.0], Cause::Snow, flakes);
        }
        for Placed { what: dust, region } in &environment.dust {
            add(*region, [dust.extinction(), dust.backscatter()], Cause::Dust, None);
        }
        for Placed { what: spray, region } in &environment.spray {
            add(*region, spray.coefficients(wavelength_nm), Cause::Fog, None);
        }
        weather.range_noise = range_noise as f32;
        weather
    }

    /// One-way optical depth of the first `range` m of a beam in the media around the sensor.
    pub(crate) fn depth_around_the_sensor(&self, range: f64) -> f64 {
        self.media
            .iter()
            .map(|medium| match medium.extent {
                Extent::Everywhere => medium.extinction * range,
                Extent::Shell { start, end } => medium.extinction * (range.min(end.into()) - f64::from(start)).max(0.0),
                _ => 0.0,
            })
            .sum()
    }
}
