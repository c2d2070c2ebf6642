//! Building materials of ITU-R P.2040.

use num_complex::Complex64;
use serde::Deserialize;

/// Materials of Recommendation ITU-R P.2040-3 (2023), table 3: permittivity `a f^b`, conductivity `c f^d` S/m, `f` in
/// GHz. Each holds within a range of frequencies: see [`ItuMaterial::range_ghz`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ItuMaterial {
    /// Concrete, 1 to 100 GHz.
    Concrete,
    /// Brick, 1 to 40 GHz.
    Brick,
    /// Plasterboard, 1 to 100 GHz.
    Plasterboard,
    /// Wood, 0.001 to 100 GHz.
    Wood,
    /// Glass, 0.1 to 100 GHz.
    Glass,
    /// Ceiling board, 1 to 100 GHz.
    CeilingBoard,
    /// Chipboard, 1 to 100 GHz.
    Chipboard,
    /// Plywood, 1 to 40 GHz.
    Plywood,
    /// Marble, 1 to 60 GHz.
    Marble,
    /// Floorboard, 50 to 100 GHz.
    Floorboard,
    /// Metal, 1 to 100 GHz.
    Metal,
    /// Very dry ground, 1 to 10 GHz.
    VeryDryGround,
    /// Medium dry ground, 1 to 10 GHz.
    MediumDryGround,
    /// Wet ground, 1 to 10 GHz.
    WetGround,
}

/// Conductivity to loss: `1 / (2 pi epsilon_0)`, GHz m/S (CODATA 2018), which ITU-R P.2040-3 rounds to 17.98 in its eq. 14.
pub(super) const LOSS_PER_CONDUCTIVITY: f64 = 17.975_103_584_5;

impl ItuMaterial {
    /// All of them, in the order of the table.
    pub const ALL: [ItuMaterial; 14] = [
        ItuMaterial::Concrete,
        ItuMaterial::Brick,
        ItuMaterial::Plasterboard,
        ItuMaterial::Wood,
        ItuMaterial::Glass,
        ItuMaterial::CeilingBoard,
        ItuMaterial::Chipboard,
        ItuMaterial::Plywood,
        ItuMaterial::Marble,
        ItuMaterial::Floorboard,
        ItuMaterial::Metal,
        ItuMaterial::VeryDryGround,
        ItuMaterial::MediumDryGround,
        ItuMaterial::WetGround,
    ];

    /// `a`, `b`, `c`, `d` and the least and greatest frequency, GHz.
    fn row(self) -> [f64; 6] {
        match self {
            ItuMaterial::Concrete => [5.24, 0.0, 0.0462, 0.7822, 1.0, 100.0],
            ItuMaterial::Brick => [3.91, 0.0, 0.0238, 0.16, 1.0, 40.0],
            ItuMaterial::Plasterboard => [2.73, 0.0, 0.0085, 0.9395, 1.0, 100.0],
            ItuMaterial::Wood => [1.99, 0.0, 0.0047, 1.0718, 0.001, 100.0],
            ItuMaterial::Glass => [6.31, 0.0, 0.0036, 1.3394, 0.1, 100.0],
            ItuMaterial::CeilingBoard => [1.48, 0.0, 0.0011, 1.0750, 1.0, 100.0],
            ItuMaterial::Chipboard => [2.58, 0.0, 0.0217, 0.7800, 1.0, 100.0],
            ItuMaterial::Plywood => [2.71, 0.0, 0.33, 0.0, 1.0, 40.0],
            ItuMaterial::Marble => [7.074, 0.0, 0.0055, 0.9262, 1.0, 60.0],
            ItuMaterial::Floorboard => [3.66, 0.0, 0.0044, 1.3515, 50.0, 100.0],
            ItuMaterial::Metal => [1.0, 0.0, 1e7, 0.0, 1.0, 100.0],
            ItuMaterial::VeryDryGround => [3.0, 0.0, 0.000_15, 2.52, 1.0, 10.0],
            ItuMaterial::MediumDryGround => [15.0, -0.1, 0.035, 1.63, 1.0, 10.0],
            ItuMaterial::WetGround => [30.0, -0.4, 0.15, 1.30, 1.0, 10.0],
        }
    }

    /// The frequencies for which the table is valid, GHz.
    pub fn range_ghz(self) -> [f64; 2] {
        let [.., least, most] = self.row();
        [least, most]
    }

    /// Relative permittivity `eps' - j eps''` at `frequency_hz`, whether or not the table is valid there: `eps' = a f^b`,
    /// `eps'' = c f^d / (2 pi epsilon_0 f)`.
    pub fn permittivity(self, frequency_hz: f64) -> Complex64 {
        let [a, b, c, d, ..] = self.row();
        let ghz = frequency_hz / 1e9;
        Complex64::new(a * ghz.powf(b), -LOSS_PER_CONDUCTIVITY * c * ghz.powf(d) / ghz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The losses that the formula gives, computed with numpy, at 24.125, 60 and 77 GHz.
    #[test]
    fn losses_follow_the_recommendation() {
        for (material, real, losses) in [
            (ItuMaterial::Concrete, 5.24, [0.415_16, 0.340_43, 0.322_43]),
            (ItuMaterial::Brick, 3.91, [0.029_51, 0.013_728, 0.011_133]),
            (ItuMaterial::Plasterboard, 2.73, [0.126_02, 0.119_26, 0.117_48]),
            (ItuMaterial::Wood, 1.99, [0.106_18, 0.113_35, 0.115_40]),
            (ItuMaterial::Glass, 6.31, [0.190_63, 0.259_70, 0.282_65]),
            (ItuMaterial::CeilingBoard, 1.48, [0.025_104, 0.026_88, 0.027_387]),
            (ItuMaterial::Chipboard, 2.58, [0.193_64, 0.158_47, 0.150_00]),
            (ItuMaterial::Marble, 7.074, [0.078_164, 0.073_081, f64::NAN]),
            (ItuMaterial::Plywood, 2.71, [0.245_88, f64::NAN, 0.077]),
            (ItuMaterial::Floorboard, 3.66, [f64::NAN, 0.333_54, 0.364_10]),
            (ItuMaterial::Metal, 1.0, [f64::NAN, f64::NAN, 2.3344e6]),
        ] {
            for (ghz, loss) in [24.125, 60.0, 77.0].into_iter().zip(losses) {
                let found = material.permittivity(ghz * 1e9);
                assert_eq!(found.re, real);
                // To the digits printed: five, of the plywood's last two.
                let digits = if loss == 0.077 { 1e-3 } else { 1e-4 };
                let near = (-found.im / loss - 1.0).abs() < digits;
                assert!(loss.is_nan() || near, "{material:?} {ghz} GHz: {found}");
            }
        }
        assert_eq!(ItuMaterial::Floorboard.range_ghz(), [50.0, 100.0]);
        assert!((ItuMaterial::WetGround.permittivity(1e9) - Complex64::new(30.0, -2.696_266)).norm() < 1e-6);
    }
}
