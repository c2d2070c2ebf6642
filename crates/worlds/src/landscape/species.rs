//! Kinds of woody plants: the parameters of Weber & Penn for each.

/// Length of branches by where they leave the trunk (Weber & Penn 1995, section 4.3 and appendix), as a function of the
/// fraction of the crown above them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CrownShape {
    Conical,
    Spherical,
    Hemispherical,
    TaperedCylindrical,
    TendFlame,
}

impl CrownShape {
    pub fn ratio(self, above: f64) -> f64 {
        use std::f64::consts::{FRAC_PI_2, PI};
        match self {
            CrownShape::Conical => 0.2 + 0.8 * above,
            CrownShape::Spherical => 0.2 + 0.8 * (PI * above).sin(),
            CrownShape::Hemispherical => 0.2 + 0.8 * (FRAC_PI_2 * above).sin(),
            CrownShape::TaperedCylindrical => 0.5 + 0.5 * above,
            CrownShape::TendFlame if above <= 0.7 => 0.5 + 0.5 * above / 0.7,
            CrownShape::TendFlame => 0.5 + 0.5 * (1.0 - above) / 0.3,
        }
    }
}

/// A number and how much it varies, up and down.
pub(super) type Varied = [f64; 2];

/// Stems of one order: the trunk, its branches, their twigs. Angles in degrees.
#[derive(Clone, Copy, Debug)]
pub(super) struct StemOrder {
    /// Maximum length over that of the parent; of the trunk, over the height.
    pub length: Varied,
    /// Decrease of the radius towards the end, 0 to 1.
    pub taper: f64,
    /// Number of straight pieces.
    pub pieces: usize,
    /// Bend in its first half, and in its second.
    pub bend: [f64; 2],
    /// Random bend along its length.
    pub waver: f64,
    /// Number of forks per piece, and the angle of the arms.
    pub forks: f64,
    pub fork_angle: Varied,
    /// Angle away from the parent. With a negative variation, it is that much more at the lower end of the crown and
    /// less at the upper.
    pub down: Varied,
    /// Angle about the parent, from one stem to the next.
    pub around: Varied,
    /// Number of these per parent stem; of trunks, per root.
    pub count: u32,
    /// Number of sides of its tube.
    pub sides: usize,
}

/// A kind of tree or bush.
#[derive(Clone, Copy, Debug)]
pub(super) struct Species {
    pub name: &'static str,
    /// Height, m.
    pub height: Varied,
    pub outline: CrownShape,
    /// Fraction of the trunk below the crown.
    pub bare: f64,
    /// Radius of the trunk over its length, and the exponent of the ratio of lengths by which radii decrease from order
    /// to order.
    pub ratio: f64,
    pub ratio_power: f64,
    /// How much wider the trunk is at its foot.
    pub flare: f64,
    /// How much thin stems turn to the light; negative: they hang.
    pub upwards: f64,
    pub orders: [StemOrder; 3],
    /// Leaves per twig; none for a dead tree.
    pub leaves: u32,
    /// Length of a leaf, m, and its width over its length.
    pub leaf: [f64; 2],
    /// Linear colours of trunk, branches and leaves, and their reflectance at 905 nm.
    pub colors: [([f32; 3], f64); 3],
}

const BARK: ([f32; 3], f64) = ([0.09, 0.065, 0.045], 0.3);
const GREEN: f64 = 0.5;

const TRUNK: StemOrder = StemOrder {
    length: [1.0, 0.0],
    taper: 1.0,
    pieces: 8,
    bend: [0.0, 0.0],
    waver: 20.0,
    forks: 0.0,
    fork_angle: [0.0, 0.0],
    down: [0.0, 0.0],
    around: [0.0, 0.0],
    count: 1,
    sides: 9,
};
const BRANCH: StemOrder = StemOrder { pieces: 5, sides: 5, around: [140.0, 0.0], ..TRUNK };
const TWIG: StemOrder = StemOrder { pieces: 2, sides: 3, around: [140.0, 0.0], down: [45.0, 10.0], ..TRUNK };

/// After the parameters that Weber & Penn (1995, "Creation and Rendering of Realistic Trees", SIGGRAPH '95) give for a
/// black oak and a quaking aspen, with fewer and larger leaves, as they do for distant trees; the spruce, the dead tree
/// and the bush are our own. Colours and reflectances are our own plausible choices.
pub(super) const TREES: [Species; 4] = [
    Species {
        name: "Oak",
        height: [11.0, 2.0],
        outline: CrownShape::Hemispherical,
        bare: 0.18,
        ratio: 0.022,
        ratio_power: 1.3,
        flare: 1.0,
        upwards: 0.6,
        orders: [
            StemOrder { taper: 0.95, waver: 40.0, forks: 0.15, fork_angle: [18.0, 6.0], ..TRUNK },
            StemOrder {
                length: [0.62, 0.08],
                pieces: 6,
                bend: [30.0, -45.0],
                waver: 90.0,
                forks: 0.12,
                fork_angle: [18.0, 8.0],
                down: [45.0, -30.0],
                around: [80.0, 15.0],
                count: 34,
                ..BRANCH
            },
            StemOrder { length: [0.26, 0.06], waver: 30.0, count: 30, ..TWIG },
        ],
        leaves: 13,
        leaf: [0.26, 0.62],
        colors: [BARK, BARK, ([0.05, 0.13, 0.02], GREEN)],
    },
    Species {
        name: "Birch",
        height: [12.0, 2.0],
        outline: CrownShape::TendFlame,
        bare: 0.3,
        ratio: 0.012,
        ratio_power: 1.2,
        flare: 0.6,
        upwards: -0.4,
        orders: [
            StemOrder { waver: 25.0, ..TRUNK },
            StemOrder {
                length: [0.28, 0.04],
                bend: [-30.0, 40.0],
                waver: 50.0,
                down: [55.0, -30.0],
                around: [140.0, 10.0],
                count: 42,
                ..BRANCH
            },
            StemOrder { length: [0.5, 0.1], bend: [-20.0, -20.0], waver: 40.0, count: 18, ..TWIG },
        ],
        leaves: 11,
        leaf: [0.15, 0.8],
        colors: [([0.62, 0.6, 0.56], 0.55), ([0.16, 0.11, 0.08], 0.35), ([0.1, 0.19, 0.03], GREEN)],
    },
    Species {
        name: "Spruce",
        height: [15.0, 3.0],
        outline: CrownShape::Conical,
        bare: 0.05,
        ratio: 0.011,
        ratio_power: 1.3,
        flare: 0.5,
        upwards: 0.25,
        orders: [
            StemOrder { waver: 4.0, pieces: 10, ..TRUNK },
            StemOrder {
                length: [0.26, 0.03],
                bend: [-14.0, 24.0],
                waver: 12.0,
                down: [88.0, -25.0],
                around: [137.5, 15.0],
                count: 95,
                sides: 4,
                pieces: 4,
                ..BRANCH
            },
            StemOrder { length: [0.4, 0.05], down: [55.0, 8.0], around: [180.0, 25.0], count: 14, ..TWIG },
        ],
        leaves: 14,
        leaf: [0.36, 0.3],
        colors: [([0.12, 0.07, 0.045], 0.3), BARK, ([0.016, 0.055, 0.022], 0.45)],
    },
    Species {
        name: "Dead",
        height: [9.0, 2.0],
        outline: CrownShape::Spherical,
        bare: 0.25,
        ratio: 0.02,
        ratio_power: 1.5,
        flare: 0.8,
        upwards: 0.3,
        orders: [
            StemOrder { taper: 0.8, waver: 45.0, forks: 0.1, fork_angle: [16.0, 6.0], ..TRUNK },
            StemOrder {
                length: [0.42, 0.12],
                pieces: 6,
                bend: [20.0, -40.0],
                waver: 110.0,
                forks: 0.12,
                fork_angle: [24.0, 8.0],
                down: [55.0, -25.0],
                around: [120.0, 25.0],
                count: 18,
                ..BRANCH
            },
            StemOrder { length: [0.3, 0.1], waver: 60.0, pieces: 3, count: 12, ..TWIG },
        ],
        leaves: 0,
        leaf: [0.0, 0.0],
        colors: [([0.26, 0.24, 0.21], 0.4), ([0.26, 0.24, 0.21], 0.4), ([0.0; 3], GREEN)],
    },
];

pub(super) const BUSH: Species = Species {
    name: "Bush",
    height: [1.4, 0.3],
    outline: CrownShape::TaperedCylindrical,
    bare: 0.1,
    ratio: 0.014,
    ratio_power: 1.1,
    flare: 0.2,
    upwards: 0.5,
    orders: [
        StemOrder { pieces: 5, waver: 40.0, down: [28.0, 14.0], around: [137.5, 25.0], count: 7, sides: 5, ..TRUNK },
        StemOrder {
            length: [0.5, 0.08],
            pieces: 3,
            sides: 3,
            waver: 40.0,
            down: [50.0, 12.0],
            around: [140.0, 20.0],
            count: 9,
            ..BRANCH
        },
        StemOrder { length: [0.45, 0.1], waver: 30.0, count: 4, ..TWIG },
    ],
    leaves: 9,
    leaf: [0.08, 0.6],
    colors: [BARK, BARK, ([0.06, 0.12, 0.025], GREEN)],
};
