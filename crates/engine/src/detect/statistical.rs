//! Statistical detection: an echo against the noise of the receiver.

use ground::error::Result;
use ground::math::erf;
use ground::read::bounds::Bounds;
use ground::units::SPEED_OF_LIGHT;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, SQRT_2};

/// Planck's constant, J s.
const PLANCK: f64 = 6.626_070_15e-34;

/// A receiver limited by noise: an echo of the signal-to-noise ratio SNR is detected with the probability `Phi(SNR -
/// TNR)`, Phi = the normal distribution. SNR is proportional to the received energy (noise of the amplifier, not of the
/// light itself) and calibrated by one data-sheet line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Statistical {
    /// Reflectance of the data-sheet target, above 0, at most 1: head-on, Lambert, filling the beam, in clear air.
    pub reflectance: f64,
    /// Its range, m.
    pub at_m: f64,
    /// Probability that it is detected there, 0.5 to 0.999.
    #[serde(default = "nine_tenths")]
    pub probability: f64,
    /// Ratio of threshold to noise, TNR, 1 to 100.
    pub tnr: f64,
    /// Bandwidth of the receiver, MHz; it determines false alarms. 0 means none.
    #[serde(default)]
    pub bandwidth_mhz: f64,
    /// The sun, and how the receiver sees it; darkness by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sunlight: Option<Sunlight>,
}

/// Sunlight that a receiver sees in addition to its echoes. What it adds to the noise depends on how many
/// photo-electrons the noise in darkness corresponds to, which follows from the energy of the pulse and the data-sheet
/// line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Sunlight {
    /// Energy of a pulse, uJ, above 0.
    pub pulse_uj: f64,
    /// Diameter of the receiver's aperture, mm, above 0.
    pub aperture_mm: f64,
    /// Field of view of the receiver, full angles of an ellipse, mrad, above 0.
    pub field_of_view_mrad: [f64; 2],
    /// Width of its optical filter, nm, above 0.
    pub filter_nm: f64,
    /// Fraction of the light that its optics transmit, 0 to 1.
    #[serde(default = "optics")]
    pub efficiency: f64,
    /// Photo-electrons per photon, 0 to 1.
    #[serde(default = "silicon")]
    pub quantum_efficiency: f64,
    /// Excess noise factor of the detector, 1 to 100; about 3 for an avalanche photodiode, 1 for photon counting.
    #[serde(default = "avalanche")]
    pub excess_noise: f64,
    /// The sun's irradiance at the wavelength, W/(m^2 nm), perpendicular to its rays: 0.65 at 905 nm at the ground.
    #[serde(default = "sun_at_905_nm")]
    pub irradiance_w_m2_nm: f64,
    /// Reflectance of what the sun shines on, 0 to 1.
    #[serde(default = "half")]
    pub reflectance: f64,
    /// The sun's angle of incidence there, degrees, 0 to 90.
    #[serde(default = "slanting")]
    pub incidence_deg: f64,
    /// Whether the threshold follows the noise: then ranges shrink. Otherwise there are more false alarms.
    #[serde(default = "yes")]
    pub adaptive: bool,
}

fn nine_tenths() -> f64 {
    0.9
}

fn optics() -> f64 {
    0.7
}

fn silicon() -> f64 {
    0.8
}

fn avalanche() -> f64 {
    3.0
}

fn sun_at_905_nm() -> f64 {
    0.65
}

fn half() -> f64 {
    0.5
}

fn slanting() -> f64 {
    45.0
}

fn yes() -> bool {
    true
}

impl Statistical {
    /// Signal-to-noise ratio of the data-sheet target in darkness: `Phi(SNR - TNR)` is its probability.
    pub(super) fn reference_snr(&self) -> f64 {
        self.tnr + normal_quantile(self.probability)
    }

    /// Ratio of the noise in sunlight to that in darkness, for pulses `pulse_ns` long: the variances add, in
    /// photo-electrons of a pulse, and that of light is its number of photo-electrons times the excess noise factor.
    pub(super) fn noise_in_light(&self, wavelength_nm: f64, pulse_ns: f64) -> f64 {
        let Some(sun) = &self.sunlight else { return 1.0 };
        let electrons = |joule: f64| sun.quantum_efficiency * photons(joule, wavelength_nm);
        let dark = electrons(sun.received_j(self.reflectance, self.at_m)) / self.reference_snr();
        let light = sun.excess_noise * electrons(sun.background_w() * pulse_ns * 1e-9);
        if light > 0.0 { (1.0 + light / (dark * dark)).sqrt() } else { 1.0 }
    }
}

impl Sunlight {
    /// Checks that all values, which are below `detection.sunlight`, are within their allowed ranges.
    #[doc(hidden)]
    pub fn check(&self, bounds: &mut Bounds) -> Result<()> {
        let [wide, high] = self.field_of_view_mrad;
        // No real instrument comes near these; the ratio of two of them stays far from the limits of floating-point
        // numbers.
        for (name, value, least, most) in [
            ("pulse_uj", self.pulse_uj, 1e-6, 1e6),
            ("aperture_mm", self.aperture_mm, 0.01, 1e4),
            ("field_of_view_mrad[0]", wide, 1e-3, 1000.0),
            ("field_of_view_mrad[1]", high, 1e-3, 1000.0),
            ("filter_nm", self.filter_nm, 1e-3, 1e4),
            ("efficiency", self.efficiency, 1e-3, 1.0),
            ("quantum_efficiency", self.quantum_efficiency, 1e-3, 1.0),
            ("excess_noise", self.excess_noise, 1.0, 100.0),
            ("irradiance_w_m2_nm", self.irradiance_w_m2_nm, 0.0, 1000.0),
            ("reflectance", self.reflectance, 0.0, 1.0),
            ("incidence_deg", self.incidence_deg, 0.0, 90.0),
        ] {
            bounds.within(format_args!("detection.sunlight.{name}"), value, least, most)?;
        }
        Ok(())
    }
}

impl Sunlight {
    /// Area of the aperture, m^2.
    fn aperture_m2(&self) -> f64 {
        PI / 4.0 * (self.aperture_mm * 1e-3).powi(2)
    }

    /// Received energy of the echo of a head-on Lambert target that fills the beam, J:
    /// `E_p eta A rho / (pi R^2)`, the hard-target lidar equation.
    fn received_j(&self, reflectance: f64, range: f64) -> f64 {
        self.pulse_uj * 1e-6 * self.efficiency * self.aperture_m2() * reflectance / (PI * range * range)
    }

    /// Received sunlight, W: `E dlambda rho/pi cos(theta) A Omega eta`, from a Lambert surface that fills the view.
    fn background_w(&self) -> f64 {
        let [wide, high] = self.field_of_view_mrad.map(|mrad| mrad * 1e-3);
        let radiance = self.irradiance_w_m2_nm * self.filter_nm * self.reflectance / PI;
        let cos = self.incidence_deg.to_radians().cos();
        radiance * cos * self.aperture_m2() * PI / 4.0 * wide * high * self.efficiency
    }
}

/// Photons in an energy, J.
fn photons(joule: f64, wavelength_nm: f64) -> f64 {
    joule * wavelength_nm * 1e-9 / (PLANCK * SPEED_OF_LIGHT)
}

/// The normal distribution, for |x| < 7.
fn normal_distribution(x: f64) -> f64 {
    0.5 * (1.0 + erf(x / SQRT_2))
}

/// Where the normal distribution equals `probability`, 1e-6 to 1 - 1e-6, by bisection.
fn normal_quantile(probability: f64) -> f64 {
    let (mut low, mut high) = (-5.0, 5.0);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if normal_distribution(middle) < probability { low = middle } else { high = middle }
    }
    (low + high) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 uJ, aperture 20 mm, optics 0.7; filter 20 nm, view 3 x 1.5 mrad, sun at 45 degrees on reflectance 0.5.
    const SUN: Sunlight = Sunlight {
        pulse_uj: 1.0,
        aperture_mm: 20.0,
        field_of_view_mrad: [3.0, 1.5],
        filter_nm: 20.0,
        efficiency: 0.7,
        quantum_efficiency: 0.8,
        excess_noise: 3.0,
        irradiance_w_m2_nm: 0.65,
        reflectance: 0.5,
        incidence_deg: 45.0,
        adaptive: true,
    };

    /// Values computed with scipy.
    #[test]
    fn known_values_of_the_normal_distribution() {
        for (x, p) in [(0.0, 0.5), (1.0, 0.841_344_746), (2.0, 0.977_249_868), (-3.0, 0.001_349_898)] {
            assert!((normal_distribution(x) - p).abs() < 1e-9);
            assert!((normal_quantile(p) - x).abs() < 1e-6);
        }
        assert!((normal_quantile(0.9) - 1.281_551_566).abs() < 1e-8);
    }

    /// Echoes of 1 uJ in clear air, computed with numpy: reflectance, range, J, photons at 905 nm.
    #[test]
    fn received_energy_follows_the_lidar_equation() {
        for (reflectance, range, joule, count) in [(0.1, 50.0, 2.8e-15, 12_756.5), (0.8 * 0.5, 200.0, 7e-16, 3_189.11)]
        {
            let received = SUN.received_j(reflectance, range);
            assert!((received / joule - 1.0).abs() < 1e-9, "{received}");
            assert!((photons(received, 905.0) / count - 1.0).abs() < 5e-6, "{}", photons(received, 905.0));
        }
    }

    /// Computed with scipy: 1.13710e-9 W, 25.90 photons in 5 ns.
    #[test]
    fn sunlight_that_a_receiver_sees() {
        assert!((SUN.background_w() / 1.137_10e-9 - 1.0).abs() < 5e-6, "{}", SUN.background_w());
        assert!((photons(SUN.background_w() * 5e-9, 905.0) - 25.90).abs() < 5e-3);
    }

    /// By hand: 0.1 at 100 m gives 3189.11 photons, 2551.29 electrons, and the noise is 1/6.28155 of that, 406.15;
    /// 25.90 photons of the sun give 20.72 electrons, and add 62.2 to the variance of 164961.
    #[test]
    fn the_sun_adds_to_the_noise() {
        let receiver = |sunlight| Statistical {
            reflectance: 0.1,
            at_m: 100.0,
            probability: 0.9,
            tnr: 5.0,
            bandwidth_mhz: 0.0,
            sunlight,
        };
        assert!((receiver(None).reference_snr() - 6.281_551_566).abs() < 1e-8);
        assert_eq!(receiver(None).noise_in_light(905.0, 5.0), 1.0);
        let noise = receiver(Some(SUN)).noise_in_light(905.0, 5.0);
        assert!((noise.powi(2) - 1.0 - 62.155 / 164_961.0).abs() < 1e-6, "{noise}");
        // Ten times the noise variance of light, at a tenth of the pulse's energy: a thousand times the share.
        let weak = Sunlight { pulse_uj: 0.1, filter_nm: 200.0, ..SUN };
        let weaker = receiver(Some(weak)).noise_in_light(905.0, 5.0);
        assert!(((weaker.powi(2) - 1.0) / (noise.powi(2) - 1.0) / 1000.0 - 1.0).abs() < 1e-9);
        let night = Sunlight { irradiance_w_m2_nm: 0.0, efficiency: 0.0, ..SUN };
        assert_eq!(receiver(Some(night)).noise_in_light(905.0, 5.0), 1.0);
    }
}
