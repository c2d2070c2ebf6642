//! Individual drops and flakes: the few that a sensor detects.

/// Particles with exponentially distributed diameters, `n(D) = N0 e^(-L D)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Particles {
    /// N0, 1/(m^3 mm).
    pub per_m3_mm: f64,
    /// L, 1/mm.
    pub slope_per_mm: f64,
    /// Diameter below which particles only attenuate the beam, mm.
    pub least_mm: f64,
    /// Reflectance of a Lambert disc of the same size that would return as much.
    pub reflectance: f64,
}

impl Particles {
    /// Particles of a diameter above `least_mm`, 1/m^3.
    pub(crate) fn count_above(&self, least_mm: f64) -> f64 {
        self.per_m3_mm / self.slope_per_mm * (-self.slope_per_mm * least_mm).exp()
    }
}
