//! The transverse Mercator projection of UTM and of most national grids.
//!
//! Krüger's series to the sixth order in the third flattening n, with the coefficients and the convergence of C. F. F.
//! Karney, "Transverse Mercator with an accuracy of a few nanometers", Journal of Geodesy 85 (2011), 475-485; numbers of
//! equations are those of that paper. Within 35 degrees of the central meridian it is exact to nanometres.

/// Greatest order of the series.
const ORDER: usize = 6;

/// Semi-major axis of GRS 80 and of WGS 84, m.
const SEMI_MAJOR_M: f64 = 6_378_137.0;

/// A transverse Mercator projection: between geographic coordinates, rad, and those of a grid, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransverseMercator {
    /// First eccentricity of the ellipsoid, squared.
    eccentricity_squared: f64,
    /// Longitude of the central meridian, rad.
    central_meridian: f64,
    /// Scale on the central meridian times the radius of the rectifying sphere, m.
    radius: f64,
    /// Scale on the central meridian.
    scale: f64,
    /// Easting of the central meridian and northing of the equator, m.
    false_origin: [f64; 2],
    /// Coefficients of the series, from the conformal sphere to the grid and back (35, 36).
    alpha: [f64; ORDER],
    beta: [f64; ORDER],
}

/// A place in a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPoint {
    /// Easting, m.
    pub easting: f64,
    /// Northing, m.
    pub northing: f64,
    /// Meridian convergence, rad: the bearing of grid north, clockwise from true north. A heading in the grid is the true
    /// heading less this.
    pub convergence: f64,
    /// Length in the grid over length on the ellipsoid.
    pub scale: f64,
}

impl TransverseMercator {
    /// With the `inverse_flattening` of an ellipsoid of the semi-major axis of GRS 80; `origin`: latitude and longitude of
    /// the natural origin, rad, where the grid has the coordinates `false_origin`, m, and the scale `scale`.
    pub(super) fn new(inverse_flattening: f64, origin: [f64; 2], scale: f64, false_origin: [f64; 2]) -> Self {
        let flattening = 1.0 / inverse_flattening;
        let n = flattening / (2.0 - flattening);
        let powers: [f64; ORDER] = std::array::from_fn(|power| n.powi(power as i32 + 1));
        let [n1, n2, n3, n4, n5, n6] = powers;
        // (35)
        let alpha = [
            n1 / 2.0 - 2.0 * n2 / 3.0 + 5.0 * n3 / 16.0 + 41.0 * n4 / 180.0 - 127.0 * n5 / 288.0
                + 7891.0 * n6 / 37800.0,
            13.0 * n2 / 48.0 - 3.0 * n3 / 5.0 + 557.0 * n4 / 1440.0 + 281.0 * n5 / 630.0
                - 1_983_433.0 * n6 / 1_935_360.0,
            61.0 * n3 / 240.0 - 103.0 * n4 / 140.0 + 15061.0 * n5 / 26880.0 + 167_603.0 * n6 / 181_440.0,
            49561.0 * n4 / 161_280.0 - 179.0 * n5 / 168.0 + 6_601_661.0 * n6 / 7_257_600.0,
            34729.0 * n5 / 80640.0 - 3_418_889.0 * n6 / 1_995_840.0,
            212_378_941.0 * n6 / 319_334_400.0,
        ];
        // (36)
        let beta = [
            n1 / 2.0 - 2.0 * n2 / 3.0 + 37.0 * n3 / 96.0 - n4 / 360.0 - 81.0 * n5 / 512.0 + 96199.0 * n6 / 604_800.0,
            n2 / 48.0 + n3 / 15.0 - 437.0 * n4 / 1440.0 + 46.0 * n5 / 105.0 - 1_118_711.0 * n6 / 3_870_720.0,
            17.0 * n3 / 480.0 - 37.0 * n4 / 840.0 - 209.0 * n5 / 4480.0 + 5569.0 * n6 / 90720.0,
            4397.0 * n4 / 161_280.0 - 11.0 * n5 / 504.0 - 830_251.0 * n6 / 7_257_600.0,
            4583.0 * n5 / 161_280.0 - 108_847.0 * n6 / 3_991_680.0,
            20_648_693.0 * n6 / 638_668_800.0,
        ];
        // (14)
        let rectifying = SEMI_MAJOR_M / (1.0 + n1) * (1.0 + n2 / 4.0 + n4 / 64.0 + n6 / 256.0);
        let [latitude, central_meridian] = origin;
        let [easting, northing] = false_origin;
        let mut projection = TransverseMercator {
            eccentricity_squared: flattening * (2.0 - flattening),
            central_meridian,
            radius: scale * rectifying,
            scale,
            false_origin: [easting, 0.0],
            alpha,
            beta,
        };
        projection.false_origin[1] = northing - projection.forward(latitude, central_meridian).northing;
        projection
    }

    /// Longitude of its central meridian, rad.
    pub fn central_meridian(&self) -> f64 {
        self.central_meridian
    }

    /// The place in the grid of a latitude and a longitude, rad.
    pub fn forward(&self, latitude: f64, longitude: f64) -> GridPoint {
        let from_meridian = longitude - self.central_meridian;
        let (sin_lon, cos_lon) = from_meridian.sin_cos();
        let tau = latitude.tan();
        let conformal = self.conformal(tau);
        // (10)
        let across = conformal.hypot(cos_lon);
        let (north, east) = (conformal.atan2(cos_lon), (sin_lon / across).asinh());
        // (11), (24): the series and its derivative.
        let (mut xi, mut eta) = (north, east);
        let (mut real, mut imaginary) = (1.0, 0.0);
        for (order, alpha) in (1..).zip(self.alpha) {
            let double = 2.0 * f64::from(order);
            let ((sin, cos), (sinh, cosh)) = ((double * north).sin_cos(), sinh_cosh(double * east));
            xi += alpha * sin * cosh;
            eta += alpha * cos * sinh;
            real += double * alpha * cos * cosh;
            imaginary += double * alpha * sin * sinh;
        }
        // (23), (25)
        let convergence = (conformal / 1f64.hypot(conformal) * from_meridian.tan()).atan() + (imaginary / real).atan();
        let sin_lat = latitude.sin();
        let on_sphere =
            (1.0 - self.eccentricity_squared * sin_lat * sin_lat).sqrt() * 1f64.hypot(tau) / conformal.hypot(cos_lon);
        let [easting, northing] = self.false_origin;
        GridPoint {
            easting: easting + self.radius * eta,
            northing: northing + self.radius * xi,
            convergence,
            scale: self.radius / SEMI_MAJOR_M * real.hypot(imaginary) * on_sphere,
        }
    }

    /// The latitude and the longitude, rad, of an easting and a northing, m.
    pub fn inverse(&self, easting: f64, northing: f64) -> [f64; 2] {
        let [false_easting, false_northing] = self.false_origin;
        let (xi, eta) = ((northing - false_northing) / self.radius, (easting - false_easting) / self.radius);
        // (15)
        let (mut north, mut east) = (xi, eta);
        for (order, beta) in (1..).zip(self.beta) {
            let double = 2.0 * f64::from(order);
            let ((sin, cos), (sinh, cosh)) = ((double * xi).sin_cos(), sinh_cosh(double * eta));
            north -= beta * sin * cosh;
            east -= beta * cos * sinh;
        }
        // (18)
        let (sin, cos) = north.sin_cos();
        let sinh = east.sinh();
        let conformal = sin / sinh.hypot(cos);
        let longitude = self.central_meridian + sinh.atan2(cos);
        // (19) to (21): Newton's method; three steps are exact.
        let rest = 1.0 - self.eccentricity_squared;
        let mut tau = conformal / rest;
        for _ in 0..4 {
            let found = self.conformal(tau);
            tau += (conformal - found) / 1f64.hypot(found) * (1.0 + rest * tau * tau) / (rest * 1f64.hypot(tau));
        }
        [tau.atan(), longitude]
    }

    /// Tangent of the conformal latitude, from that of the geographic one (7, 8, 9).
    fn conformal(&self, tau: f64) -> f64 {
        let eccentricity = self.eccentricity_squared.sqrt();
        let sigma = (eccentricity * (eccentricity * tau / 1f64.hypot(tau)).atanh()).sinh();
        tau * 1f64.hypot(sigma) - sigma * 1f64.hypot(tau)
    }
}

/// Hyperbolic sine and cosine.
fn sinh_cosh(value: f64) -> (f64, f64) {
    (value.sinh(), value.cosh())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::Crs;

    /// EPSG code, latitude and longitude, deg; easting and northing, m, convergence, deg, and scale of PROJ 9.5.1 (pyproj
    /// 3.7.2, `Proj` and `get_factors`).
    const OF_PROJ: [(u32, f64, f64, [f64; 4]); 8] = [
        (
            32632,
            49.4,
            8.7,
            [478_233.510_080_112_96, 5_471_966.698_121_564, -0.227_782_281_345_584_5, 0.999_605_819_580_276_7],
        ),
        (32632, 0.0, 9.0, [500_000.0, 0.0, 0.0, 0.999_600_000_050_651_3]),
        (
            32632,
            84.0,
            11.9,
            [533_829.157_938_203_2, 9_328_945.450_188_22, 2.884_140_398_974_354_4, 0.999_613_979_265_287_1],
        ),
        (
            32632,
            47.0,
            3.1,
            [51_504.568_729_340_27, 5_222_081.374_716_181, -4.322_153_446_075_823, 1.002_073_085_979_231_7],
        ),
        (
            32733,
            -33.9,
            18.4,
            [814_420.330_951_301_1, 6_243_724.840_074_809, -1.897_889_446_822_623, 1.000_818_903_018_12],
        ),
        (
            32733,
            -79.9,
            12.01,
            [441_488.077_185_196_4, 1_128_072.242_745_639_8, 2.943_746_697_040_882, 0.999_641_832_090_331],
        ),
        (
            25832,
            53.5,
            14.9,
            [891_159.037_083_253, 5_944_107.727_040_245, 4.748_729_806_679_32, 1.001_478_180_883_831_1],
        ),
        (
            32632,
            60.0,
            19.0,
            [1_056_351.259_575_269_2, 6_693_618.350_508_65, 8.682_313_434_914_71, 1.003_395_267_177_881_9],
        ),
    ];

    #[test]
    fn coordinates_are_those_of_proj() {
        for (code, latitude, longitude, [easting, northing, convergence, scale]) in OF_PROJ {
            let projection = Crs::parse(&format!("EPSG:{code}")).unwrap().projection().unwrap();
            let found = projection.forward(latitude.to_radians(), longitude.to_radians());
            assert!((found.easting - easting).abs() < 1e-6 && (found.northing - northing).abs() < 1e-6, "{found:?}");
            // Derivatives of PROJ are numerical.
            assert!((found.convergence.to_degrees() - convergence).abs() < 1e-7, "{code}: {found:?}");
            assert!((found.scale - scale).abs() < 1e-9, "{code}: {found:?}");
            let [back, along] = projection.inverse(easting, northing);
            assert!((back.to_degrees() - latitude).abs() < 1e-11 && (along.to_degrees() - longitude).abs() < 1e-11);
        }
    }

    /// A grid whose natural origin is not on the equator, as the British one.
    #[test]
    fn the_natural_origin_has_the_false_coordinates() {
        let origin = [49f64.to_radians(), -2f64.to_radians()];
        let projection = TransverseMercator::new(298.257_222_101, origin, 0.9996, [400_000.0, -100_000.0]);
        let there = projection.forward(origin[0], origin[1]);
        assert!((there.easting - 400_000.0).abs() < 1e-8 && (there.northing + 100_000.0).abs() < 1e-8);
        assert!((there.scale - 0.9996).abs() < 1e-12 && there.convergence.abs() < 1e-15);
    }

    /// Angles are kept, and the heading of a short way in the grid is its bearing less the convergence.
    #[test]
    fn headings_differ_by_the_convergence() {
        let projection = Crs::parse("EPSG:32632").unwrap().projection().unwrap();
        let (latitude, longitude) = (52f64.to_radians(), 11.5f64.to_radians());
        let at = projection.forward(latitude, longitude);
        let north = projection.forward(latitude + 1e-7, longitude);
        let heading = (north.easting - at.easting).atan2(north.northing - at.northing);
        assert!((heading + at.convergence).abs() < 1e-6 && at.convergence > 0.03);
    }
}
