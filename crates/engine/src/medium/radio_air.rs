//! An environment prepared for the waves of one radar.

use super::air::{Precipitation, gases, radio};
use super::{Environment, Extent, Placed, Region};
use glam::{DVec3, Vec3};
use ground::cause::Cause;
use ground::error::Result;
use model::material::{Dielectric, Radio, RadioLaw, RadioLayer};

/// A medium that radar waves pass.
#[derive(Clone, Debug)]
pub struct RadioMedium {
    /// Where it is.
    pub extent: Extent,
    /// Attenuation one way, dB/m.
    pub db_per_m: f64,
    /// The cause of what it returns.
    pub cause: Cause,
    /// What returns echoes.
    pub precipitation: Option<Precipitation>,
}

/// All media in the air. Dust is not among them: its grains are far smaller than the waves.
#[derive(Clone, Debug, Default)]
pub struct RadioAir {
    /// Each with its region.
    pub media: Vec<RadioMedium>,
}

impl RadioAir {
    /// For a radar at `frequency_hz` whose electric field is tilted by `tilt_deg` from the horizontal, 0 (H) to 90 (V), 45 if
    /// circular. `origin`: world position of the rays' (0, 0, 0).
    ///
    /// Oxygen and water vapour attenuate where there is `clear_air`, as of the standard atmosphere at sea level, whatever its
    /// visibility; fog, by its visibility or its droplets, and spray attenuate; rain and snow also return echoes.
    pub fn new(environment: &Environment, frequency_hz: f64, tilt_deg: f64, origin: DVec3) -> RadioAir {
        let ghz = frequency_hz / 1e9;
        let mut air = RadioAir::default();
        let mut add = |region: Region, db_km: f64, cause, precipitation: Option<Precipitation>| {
            if db_km > 0.0 {
                let extent = Extent::new(region, origin);
                air.media.push(RadioMedium { extent, db_per_m: db_km / 1e3, cause, precipitation });
            }
        };
        if environment.clear_air.is_some() {
            add(Region::Everywhere, gases::attenuation_db_km(ghz).iter().sum(), Cause::Fog, None);
        }
        for Placed { what: rain, region } in &environment.rain {
            let echoes = radio::rain_echoes(rain, ghz).map(|found| found.echoes);
            add(*region, radio::rain_db_km(rain.rate_mm_h, ghz, tilt_deg), Cause::Rain, echoes);
        }
        for Placed { what: fog, region } in &environment.fog {
            add(*region, fog.liquid_water_g_m3() * radio::droplets_db_km(ghz), Cause::Fog, None);
        }
        for Placed { what: snow, region } in &environment.snow {
            let found = radio::snow_echoes(snow, ghz);
            let db_km = found.map_or(0.0, |found| found.attenuation_db_km);
            add(*region, db_km, Cause::Snow, found.map(|found| found.echoes));
        }
        for Placed { what: spray, region } in &environment.spray {
            let water = spray.spectrum.liquid_water_g_m3();
            add(*region, water * radio::droplets_db_km(ghz), Cause::Fog, None);
        }
        air
    }

    /// Attenuation one way, dB, of `length` m from `origin` on; `travelled`: the wave's path up to there, m.
    pub fn attenuation_db(&self, origin: Vec3, direction: Vec3, travelled: f32, length: f32) -> f64 {
        let along = |medium: &RadioMedium| {
            let (from, to) = medium.extent.interval(origin, direction, travelled, length);
            medium.db_per_m * f64::from((to - from).max(0.0))
        };
        self.media.iter().map(along).sum()
    }
}

/// What a film of water on a radome takes one way, dB, at right angles to it: reflection and absorption by a layer of water of
/// 20 degrees C (ITU-R P.2040-3 eq. 43, P.840-9). Drops and rivulets, the rule on coatings that repel water, take less.
///
/// # Errors
/// `film_mm` not from 0 to 1000, `frequency_hz` not from 1e8 to 1e12.
pub fn wet_radome_db(film_mm: f64, frequency_hz: f64) -> Result<f64> {
    let of = Dielectric::Water { temperature_c: 20.0, salinity_g_kg: 0.0 };
    let film = Radio::new(RadioLaw::Layers { layers: vec![RadioLayer { of, thickness_mm: film_mm }], over: None });
    film.check()?;
    Ok(-10.0 * f64::from(film.at(frequency_hz)?.transmit(1.0).power()).log10())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::{ClearAir, Fog, Rain, Snow};

    fn air(environment: &Environment, ghz: f64) -> RadioAir {
        RadioAir::new(environment, ghz * 1e9, 0.0, DVec3::ZERO)
    }

    #[test]
    fn weather_adds_up_along_the_way() {
        let region = Region::Box { min_m: [100.0, -50.0, -50.0], max_m: [300.0, 50.0, 50.0] };
        let environment = Environment {
            clear_air: Some(ClearAir { visibility_m: Some(23_000.0), ..ClearAir::default() }),
            rain: vec![Placed { what: Rain::new(25.0), region }],
            fog: vec![Fog { visibility_m: Some(50.0), ..Fog::default() }.into()],
            ..Environment::default()
        };
        let weather = air(&environment, 77.0);
        assert_eq!(weather.media.len(), 3);
        // 11.405 dB/km over 200 m, 0.348 dB/km of air over 500 m (P.676), and the fog.
        let fog = 0.5 * radio::droplets_db_km(77.0) * 0.5;
        let found = weather.attenuation_db(Vec3::ZERO, Vec3::X, 0.0, 500.0);
        assert!((found - (11.405 * 0.2 + 0.348 * 0.5 + fog)).abs() < 1e-3, "{found}");
        let beside = weather.attenuation_db(Vec3::ZERO, Vec3::Y, 0.0, 500.0);
        assert!((found - beside - 11.405 * 0.2).abs() < 1e-4, "{found} {beside}");
        let echoes: Vec<_> = weather.media.iter().filter_map(|medium| medium.precipitation).collect();
        assert!(echoes.len() == 1 && (echoes[0].eta_m2_per_m3 / 1.270_74e-3 - 1.0).abs() < 1e-5, "{echoes:?}");
    }

    /// Nothing attenuates where nothing is; oxygen takes 15 dB/km at 60 GHz.
    #[test]
    fn air_is_there_if_it_is_given() {
        assert!(air(&Environment::default(), 60.0).media.is_empty());
        let clear_air = Some(ClearAir { visibility_m: Some(23_000.0), ..ClearAir::default() });
        let found = air(&Environment { clear_air, ..Environment::default() }, 60.0).media[0].db_per_m;
        assert!((found - 0.014_778).abs() < 1e-5, "{found}");
    }

    #[test]
    fn every_weather_is_finite() {
        let environment = Environment {
            rain: vec![Rain::new(0.0).into(), Rain::new(1e-9).into(), Rain::new(500.0).into()],
            snow: vec![Snow::new(0.0).into(), Snow::new(1e-9).into(), Snow::new(100.0).into()],
            fog: vec![Fog { visibility_m: Some(0.1), ..Fog::default() }.into()],
            ..Environment::default()
        };
        for ghz in [1.0, 9.41, 24.125, 60.0, 79.0, 300.0, 1000.0] {
            for medium in air(&environment, ghz).media {
                assert!(medium.db_per_m > 0.0 && medium.db_per_m.is_finite(), "{ghz}: {medium:?}");
                if let Some(echoes) = medium.precipitation {
                    let all = [echoes.eta_m2_per_m3, echoes.fall_m_s, echoes.fall_spread_m_s];
                    assert!(all.iter().all(|value| value.is_finite() && *value >= 0.0), "{ghz}: {medium:?}");
                }
            }
        }
    }

    #[test]
    fn water_on_a_radome_dims() {
        let mut before = -1e-9;
        for film_mm in [0.0, 0.05, 0.1, 0.2, 0.5] {
            let found = wet_radome_db(film_mm, 77e9).unwrap();
            assert!(found > before, "{film_mm} mm: {found}");
            before = found;
        }
        let tenth = wet_radome_db(0.1, 77e9).unwrap();
        assert!((1.0..15.0).contains(&tenth), "{tenth}");
        assert!(wet_radome_db(-1.0, 77e9).is_err() && wet_radome_db(0.1, 0.0).is_err());
    }
}
