//! Water, for sonar: how fast sound travels in it, what it absorbs, and what happens at its boundaries.

mod absorption;
mod column;
mod correction;
mod fluid;
mod noise;
mod profile;
mod ray;
mod sea;
mod sound_ray;
mod speed;
mod validity;

pub use absorption::Absorption;
pub(crate) use column::{Slab, WaterColumn, slab_at};
pub use fluid::Fluid;
pub use noise::AmbientNoise;
pub use profile::{Layer, SoundSpeedProfile, SpeedRow, WaterRow};
pub(crate) use ray::{End, RefractedRay};
pub use sea::Sea;
pub use sound_ray::{RayEvent, RayPoint, SoundRay};
pub use speed::{SoundSpeed, pressure_bar, unesco_speed};
pub use validity::Outside;

use echocast_kernels::echo::one_way;
use glam::DVec3;
use ground::builder;
use ground::error::{Error, Result};
use ground::math::log2;
use ground::read::bounds::{ABOVE_ZERO, Bounds};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How sound weakens as it spreads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Spreading {
    /// By the ray tubes of the profile; spherical without one.
    #[default]
    RayTube,
    /// `20 log r` dB one way.
    Spherical,
    /// `15 log r`.
    Practical,
    /// `10 log r`.
    Cylindrical,
    /// `20 log r` up to `spreading_from_m`, and cylindrical from there.
    Hybrid,
}

impl Spreading {
    /// log2 of the energy loss on a path of `2^path` m: none within a metre. `from`: where hybrid spreading becomes
    /// cylindrical, m; ray tubes are treated as those of straight rays.
    pub(crate) fn one_way(self, path: f32, from: f32) -> f32 {
        one_way(path, self.law(from).unwrap_or([2.0, 0.0, f32::INFINITY]))
    }

    /// The law in the terms of [`one_way`]; `None`: ray tubes.
    #[doc(hidden)]
    pub fn law(self, from: f32) -> Option<[f32; 3]> {
        let everywhere = |power: f32| Some([power, 0.0, f32::INFINITY]);
        match self {
            Spreading::RayTube => None,
            Spreading::Spherical => everywhere(2.0),
            Spreading::Practical => everywhere(1.5),
            Spreading::Cylindrical => everywhere(1.0),
            Spreading::Hybrid => Some([2.0, 1.0, log2(from).max(0.0)]),
        }
    }
}

builder! {
    /// The water below a level of the world: the section `environment.water`. It affects sonars only.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Water {
        /// Height of the mean surface in the world, m; depths count down from it; defaults to 0.
        pub surface_z_m: f64 = 0.0,
        /// Temperature where `profile` does not give it, degrees Celsius; defaults to 10.
        pub temperature_c: f64 = 10.0,
        /// Practical salinity where `profile` does not give it, PSU; defaults to 35.
        pub salinity_psu: f64 = 35.0,
        /// Acidity; defaults to 8.
        pub ph: f64 = 8.0,
        /// Latitude, degrees, on which pressure at depth depends; defaults to 45.
        pub latitude_deg: f64 = 45.0,
        /// The formula that derives speeds from temperature and salinity.
        pub sound_speed: SoundSpeed = SoundSpeed::default(),
        /// The law of absorption.
        pub absorption: Absorption = Absorption::default(),
        /// The law of spreading.
        pub spreading: Spreading = Spreading::default(),
        /// Distance from which `hybrid` spreading is cylindrical, m, above 0; only for hybrid.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub spreading_from_m: Option<f64> = None,
        /// How speeds change with depth; without it there is one speed, by temperature, salinity and the depth of the
        /// sonar, at most 12 km.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub profile: Option<SoundSpeedProfile> = None,
        /// Speed of sound that the instrument assumes, m/s; defaults to that at its own depth.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub assumed_speed_m_s: Option<f64> = None,
        /// How speeds change with depth in the cast that depths are corrected with: `corrected_x` to `corrected_z`.
        /// Defaults to the true one.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub assumed_profile: Option<SoundSpeedProfile> = None,
        /// Whether speeds and densities may be anything from 1e-6 to 1e6, as in files with other units.
        pub allow_unphysical: bool = false,
        /// Wind speed over the water, m/s: it causes waves and noise; defaults to 5.
        pub wind_m_s: f64 = 5.0,
        /// Velocity of the water, the same everywhere, in the world, m/s, at most 10 m/s fast; defaults to 0. It moves
        /// the scatterers in the water, and nothing else.
        #[serde(skip_serializing_if = "is_still")]
        pub current_m_s: [f64; 3] = [0.0; 3],
        /// Amount of shipping noise, 0 to 1; defaults to 0.5.
        pub shipping: f64 = 0.5,
        /// Volume backscatter of the water, dB re 1/m; none by default. The open sea has -95 to -70.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub volume_backscatter_db: Option<f64> = None,
    }
}

fn is_still(current: &[f64; 3]) -> bool {
    *current == [0.0; 3]
}

impl Water {
    /// Where hybrid spreading becomes cylindrical, m.
    pub(crate) fn spreading_from(&self) -> f32 {
        self.spreading_from_m.unwrap_or(1.0) as f32
    }

    pub(super) fn check(&self, key: &str, bounds: &mut Bounds) -> Result<()> {
        let mut within = |name: &str, value: Option<f64>, [least, most]: [f64; 2]| {
            bounds.within(format_args!("{key}.{name}"), value, least, most)
        };
        within("surface_z_m", Some(self.surface_z_m), [-1e5, 1e5])?;
        within("temperature_c", Some(self.temperature_c), profile::TEMPERATURES)?;
        within("salinity_psu", Some(self.salinity_psu), profile::SALINITIES)?;
        within("ph", Some(self.ph), [6.0, 9.0])?;
        within("latitude_deg", Some(self.latitude_deg), [-90.0, 90.0])?;
        within("wind_m_s", Some(self.wind_m_s), [0.0, 60.0])?;
        within("shipping", Some(self.shipping), [0.0, 1.0])?;
        within("volume_backscatter_db", self.volume_backscatter_db, [-200.0, 0.0])?;
        self.check_current(key)?;
        let from = format!("{key}.spreading_from_m");
        match (self.spreading, self.spreading_from_m) {
            (Spreading::Hybrid, None) => {
                return Err(Error::invalid(
                    format!("{key}.spreading"),
                    "hybrid",
                    "hybrid together with spreading_from_m",
                ));
            }
            (Spreading::Hybrid, Some(_)) => {}
            (_, Some(found)) => return Err(Error::invalid(from, found, "none, except with spreading: hybrid")),
            (_, None) => {}
        }
        bounds.number(from, self.spreading_from_m, [ABOVE_ZERO, 1e7], "above 0, to 1e7")?;
        if let Some(speed) = self.assumed_speed_m_s {
            profile::check_speed(&format!("{key}.assumed_speed_m_s"), speed, self.allow_unphysical)?;
        }
        let profiles = [("profile", &self.profile), ("assumed_profile", &self.assumed_profile)];
        profiles.into_iter().try_for_each(|(name, profile)| match profile {
            Some(profile) => profile.check(&format!("{key}.{name}"), self.allow_unphysical),
            None => Ok(()),
        })
    }

    fn check_current(&self, key: &str) -> Result<()> {
        /// m/s, beyond the strongest tidal streams.
        const FASTEST: f64 = 10.0;
        let speed = DVec3::from(self.current_m_s).length();
        if speed <= FASTEST {
            return Ok(());
        }
        let found = format!("{:?}, {speed} m/s fast", self.current_m_s);
        Err(Error::invalid(format!("{key}.current_m_s"), found, format!("[x, y, z], at most {FASTEST} m/s fast")))
    }

    /// Reads the files that the profiles may name; relative names are resolved against `folder`.
    pub(super) fn read_files(&mut self, folder: &Path) -> Result<()> {
        let profiles = [&mut self.profile, &mut self.assumed_profile].into_iter().flatten();
        profiles.into_iter().try_for_each(|profile| profile.read_file(folder, self.allow_unphysical))
    }

    /// Its surface.
    pub fn sea(&self) -> Sea {
        Sea { wind_m_s: self.wind_m_s }
    }

    /// Its ambient noise.
    pub fn noise(&self) -> AmbientNoise {
        AmbientNoise { wind_m_s: self.wind_m_s, shipping: self.shipping }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::environment::Environment;
    use std::fs;

    fn read(text: &str) -> Result<Water> {
        Environment::from_yaml(text).map(|environment| environment.water.unwrap())
    }

    fn message(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn nothing_but_the_section_is_needed() {
        assert_eq!(read("water: {}").unwrap(), Water::default());
        assert_eq!(read("environment: {water: {}}").unwrap(), Water::default());
        assert_eq!(Environment::from_yaml("{}").unwrap().water, None);
        assert!(!Environment::from_yaml("water: {}").unwrap().is_empty());
    }

    #[test]
    fn every_key_is_read_and_written() {
        let text = "
water:
  surface_z_m: 12.5
  temperature_c: 4
  salinity_psu: 7
  ph: 7.9
  latitude_deg: 59
  sound_speed: unesco
  absorption: ainslie_mccolm
  spreading: hybrid
  spreading_from_m: 100
  profile:
    layers:
    - {depth_m: 0, speed_m_s: 1500, density_kg_m3: 1026}
    - {depth_m: 4, speed_m_s: 1480}
  assumed_speed_m_s: 1500
  assumed_profile: {constant: {speed_m_s: 1490}}
  allow_unphysical: false
  wind_m_s: 8
  current_m_s: [0.5, -1, 0.25]
  shipping: 0.25
  volume_backscatter_db: -80
";
        let layer = |depth_m, speed_m_s, density_kg_m3| Layer { depth_m, speed_m_s, density_kg_m3 };
        let expected = Water {
            surface_z_m: 12.5,
            temperature_c: 4.0,
            salinity_psu: 7.0,
            ph: 7.9,
            latitude_deg: 59.0,
            sound_speed: SoundSpeed::Unesco,
            absorption: Absorption::AinslieMccolm,
            spreading: Spreading::Hybrid,
            spreading_from_m: Some(100.0),
            profile: Some(SoundSpeedProfile::Layers(vec![layer(0.0, 1500.0, 1026.0), layer(4.0, 1480.0, 1025.0)])),
            assumed_speed_m_s: Some(1500.0),
            assumed_profile: Some(SoundSpeedProfile::Constant { speed_m_s: 1490.0 }),
            allow_unphysical: false,
            wind_m_s: 8.0,
            current_m_s: [0.5, -1.0, 0.25],
            shipping: 0.25,
            volume_backscatter_db: Some(-80.0),
        };
        assert_eq!(read(text).unwrap(), expected);
        for profile in [
            "{layers: [{depth_m: 0, speed_m_s: 1500}]}",
            "{cast: [{depth_m: 0, speed_m_s: 1500.5}, {depth_m: 40, speed_m_s: 1480}]}",
            "{ts: [{depth_m: 1, temperature_c: 20, salinity_psu: 35}, {depth_m: 40, temperature_c: 4, salinity_psu: 34}]}",
            "{constant: {speed_m_s: 1490}}",
        ] {
            let environment = Environment::from_yaml(&format!("water: {{profile: {profile}}}")).unwrap();
            let text = environment.to_yaml().unwrap();
            assert_eq!(Environment::from_yaml(&text).unwrap(), environment, "{text}");
        }
        let words = "water: {sound_speed: medwin1975, absorption: none, spreading: ray_tube}";
        assert_eq!(read(words).unwrap().sound_speed, SoundSpeed::Medwin);
    }

    #[test]
    fn errors_name_line_key_and_what_is_allowed() {
        let speeds = "allowed: 1300 to 1700, in m/s; with allow_unphysical: true 0.000001 to 1000000";
        let cases = [
            (
                "salinity: 3",
                "line 2: water.salinity: unknown key \"salinity\"; near: salinity_psu; allowed: surface_z_m,",
            ),
            ("temperature_c: 60", "line 2: water.temperature_c: is 60; allowed: -4 to 45"),
            ("salinity_psu: -1", "line 2: water.salinity_psu: is -1; allowed: 0 to 50"),
            ("ph: 14", "line 2: water.ph: is 14; allowed: 6 to 9"),
            ("latitude_deg: 91", "line 2: water.latitude_deg: is 91; allowed: -90 to 90"),
            ("wind_m_s: -3", "line 2: water.wind_m_s: is -3; allowed: 0 to 60"),
            (
                "current_m_s: [0, 30, 0]",
                "line 2: water.current_m_s: is [0.0, 30.0, 0.0], 30 m/s fast; allowed: [x, y, z], at most 10 m/s fast",
            ),
            ("current_m_s: 3", "line 2: water.current_m_s: invalid type: integer `3`, expected a list of 3"),
            ("shipping: 2", "line 2: water.shipping: is 2; allowed: 0 to 1"),
            ("volume_backscatter_db: 3", "line 2: water.volume_backscatter_db: is 3; allowed: -200 to 0"),
            ("sound_speed: makenzie", "line 2: water.sound_speed: unknown value \"makenzie\"; near: mackenzie"),
            ("absorption: torp", "line 2: water.absorption: unknown value \"torp\"; near: thorp; allowed: francois_"),
            ("spreading: hybrid", "line 2: water.spreading: is hybrid; allowed: hybrid together with spreading_from_m"),
            (
                "spreading_from_m: 9",
                "line 2: water.spreading_from_m: is 9; allowed: none, except with spreading: hybrid",
            ),
            (
                "spreading: hybrid\n  spreading_from_m: 0",
                "line 3: water.spreading_from_m: is 0; allowed: above 0, to 1e7",
            ),
            ("assumed_speed_m_s: 1.5", &format!("line 2: water.assumed_speed_m_s: is 1.5; {speeds}")),
            (
                "assumed_profile: {constant: {speed_m_s: 1.5}}",
                &format!("line 2: water.assumed_profile.constant.speed_m_s: is 1.5; {speeds}"),
            ),
            ("profile: {}", "line 2: water.profile: invalid value: map, expected map with a single key"),
            (
                "profile: {constant: {speed_m_s: 1500}, layers: []}",
                "line 2: water.profile: invalid value: map, expected map with a single key",
            ),
            (
                "profile: {layer: []}",
                "line 2: water.profile: unknown value \"layer\"; near: layers; allowed: layers, cast,",
            ),
            ("profile: {layers: []}", "line 2: water.profile.layers: is a list of 0; allowed: 1 to 1000000 rows"),
            (
                "profile: {cast: [{depth_m: 0, speed_m_s: 1500}]}",
                "line 2: water.profile.cast: is a list of 1; allowed: 2 to 1000000 rows",
            ),
            (
                "profile: {layers: [{depth_m: 0, speed_m_s: 1.333}]}",
                &format!("line 2: water.profile.layers[0].speed_m_s: is 1.333; {speeds}"),
            ),
            (
                "profile:\n    layers:\n    - {depth_m: 0, speed_m_s: 1500}\n    - {depth_m: 0, speed_m_s: 1500}",
                "line 5: water.profile.layers[1].depth_m: is 0; allowed: above 0, in rising order, to 12000",
            ),
            (
                "profile: {layers: [{depth_m: -1, speed_m_s: 1500}]}",
                "line 2: water.profile.layers[0].depth_m: is -1; allowed: 0 to 12000",
            ),
            (
                "profile: {layers: [{depth_m: 0, speed_m_s: 1500, density_kg_m3: 1.025}]}",
                "line 2: water.profile.layers[0].density_kg_m3: is 1.025; allowed: 900 to 1400, in kg/m^3; with",
            ),
            (
                "profile: {ts: [{depth_m: 0, temperature_c: 4, salinity_psu: 3}, {depth_m: 1, temperature_c: 99, salinity_psu: 3}]}",
                "line 2: water.profile.ts[1].temperature_c: is 99; allowed: -4 to 45",
            ),
            (
                "profile: {constant: {speed_m_s: 340}}",
                &format!("line 2: water.profile.constant.speed_m_s: is 340; {speeds}"),
            ),
            (
                "allow_unphysical: true\n  profile: {constant: {speed_m_s: 0}}",
                "line 3: water.profile.constant.speed_m_s: is 0; allowed: 0.000001 to 1000000",
            ),
            (
                "allow_unphysical: true\n  profile: {layers: [{depth_m: 0, speed_m_s: 1e7}]}",
                "line 3: water.profile.layers[0].speed_m_s: is 10000000; allowed: 0.000001 to 1000000",
            ),
            (
                "profile: {constant: {speed: 1500}}",
                "line 2: water.profile.constant.speed: unknown key \"speed\"; near:",
            ),
        ];
        for (text, expected) in cases {
            let found = message(&format!("water:\n  {text}\n"));
            assert!(
                found.starts_with(&format!("YAML text: {expected}")),
                "{text}\n  gives {found}\n  not   {expected}"
            );
        }
        let error = message("environment: {water: {ph: 14}}");
        assert_eq!(error, "YAML text: line 1: environment.water.ph: is 14; allowed: 6 to 9");
    }

    #[test]
    fn odd_units_pass_when_they_are_let() {
        let text = "water: {allow_unphysical: true, assumed_speed_m_s: 1, profile: {layers: [{depth_m: 0, speed_m_s: 1.333, \
                    density_kg_m3: 1.5}]}}";
        assert!(read(text).is_ok());
    }

    #[test]
    fn casts_are_read_from_files_beside_the_yaml() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        let load = |csv: &str| {
            write("cast.csv", csv);
            write("env.yaml", "environment:\n  water: {profile: {file: cast.csv}}\n");
            Environment::load(folder.path().join("env.yaml"))
        };
        let speeds = load("# a cast\ndepth_m,speed_m_s\n0,1500\n10.5,1490.25\n").unwrap();
        let row = |depth_m, speed_m_s| SpeedRow { depth_m, speed_m_s };
        let expected = SoundSpeedProfile::Cast(vec![row(0.0, 1500.0), row(10.5, 1490.25)]);
        assert_eq!(speeds.water.as_ref().unwrap().profile, Some(expected));
        // Nothing is read later: the written text holds the rows.
        let text = speeds.to_yaml().unwrap();
        assert_eq!(Environment::from_yaml(&text).unwrap(), speeds);
        let ts = load("salinity_psu,depth_m,temperature_c\n35,0,20\n34,100,4\n").unwrap().water.unwrap();
        let row = |depth_m, temperature_c, salinity_psu| WaterRow { depth_m, temperature_c, salinity_psu };
        assert_eq!(ts.profile, Some(SoundSpeedProfile::Ts(vec![row(0.0, 20.0, 35.0), row(100.0, 4.0, 34.0)])));

        // Layers are recognised by their density; one is enough.
        let layers = load("depth_m,density_kg_m3,speed_m_s\n0,1024,1520\n10,1025,1500\n").unwrap().water.unwrap();
        let row = |depth_m, speed_m_s, density_kg_m3| Layer { depth_m, speed_m_s, density_kg_m3 };
        let expected = SoundSpeedProfile::Layers(vec![row(0.0, 1520.0, 1024.0), row(10.0, 1500.0, 1025.0)]);
        assert_eq!(layers.profile, Some(expected));
        assert!(load("depth_m,density_kg_m3,speed_m_s\n0,1024,1520\n").is_ok());

        let refused = |csv: &str| load(csv).unwrap_err().to_string().split_once("cast.csv: ").unwrap().1.to_owned();
        let speeds = "allowed: 1300 to 1700, in m/s; with allow_unphysical: true 0.000001 to 1000000";
        assert_eq!(refused("depth_m,speed_m_s\n0,1500\n5,1.49\n"), format!("line 3: speed_m_s is 1.49; {speeds}"));
        assert_eq!(
            refused("depth_m,speed_m_s\n5,1500\n5,1500\n"),
            "line 3: depth_m is 5; allowed: above 5, in rising order, to 12000"
        );
        assert_eq!(refused("depth_m,speed_m_s\n5,1500\n"), "has 1 rows; allowed: 2 to 1000000");
        assert!(
            refused("depth_m,speed_m_s,ph\n").starts_with("line 1: unknown column \"ph\"; allowed: depth_m, speed_m_s")
        );
        assert!(
            refused("a,b\n1,2\n").starts_with("line 1: has none of the columns of a profile; expected the header ")
        );
        assert!(refused("depth_m,density_kg_m3\n1,1024\n").starts_with("line 1: the column speed_m_s is missing"));
        assert!(refused("depth_m,salinity_psu\n1,2\n").starts_with("line 1: the column temperature_c is missing"));
        let unread = Water { profile: Some(SoundSpeedProfile::File("a.csv".into())), ..Water::default() };
        let error = unread.check("water", &mut Bounds::none()).unwrap_err().to_string();
        assert!(error.starts_with("water.profile.file is a.csv; allowed: a file whose rows are known"), "{error}");
        assert!(message("water: {profile: {file: no/such.csv}}").starts_with("no/such.csv: "));
    }
}
