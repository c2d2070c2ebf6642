//! Echoes along their paths.

use glam::{Mat3, Vec3};
use num_complex::Complex32;
use radar::Paths;

/// How a wave gets to what scatters it, and back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RadarRoute {
    /// Both ways direct.
    Direct,
    /// There by way of the mirrors, back direct.
    Out,
    /// The reverse.
    Back,
    /// Both ways by way of the mirrors.
    Both,
}

/// Echoes, a column for each quantity.
#[derive(Clone, Debug, Default)]
pub(crate) struct RadarEchoes {
    /// What the radar receives.
    pub paths: Paths,
    /// Row of surfaces and triangle that scatter.
    pub row: Vec<u32>,
    pub triangle: Vec<u32>,
    /// Index of the target, with its mirrors, in the list that was searched.
    pub target: Vec<u32>,
    pub route: Vec<RadarRoute>,
    /// Where it is scattered, relative to the scene's origin, m.
    pub place: Vec<Vec3>,
}

/// One echo.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RadarEcho {
    pub range: f64,
    pub range_rate: f32,
    pub amplitude: Complex32,
    /// Directions in the radar's axes, and distances, m, as in [`Paths`].
    pub tx: (Vec3, f32),
    pub rx: (Vec3, f32),
    pub row: u32,
    pub triangle: u32,
    pub target: u32,
    pub route: RadarRoute,
    pub place: Vec3,
}

impl RadarEchoes {
    pub fn push(&mut self, echo: RadarEcho) {
        let RadarEcho { range, range_rate, amplitude, tx, rx, row, triangle, target, route, place } = echo;
        self.paths.range.push(range);
        self.paths.range_rate.push(range_rate);
        self.paths.amplitude.push(amplitude);
        self.paths.tx_direction.push(tx.0.into());
        self.paths.tx_distance.push(tx.1);
        self.paths.rx_direction.push(rx.0.into());
        self.paths.rx_distance.push(rx.1);
        self.row.push(row);
        self.triangle.push(triangle);
        self.target.push(target);
        self.route.push(route);
        self.place.push(place);
    }

    /// Number `at`.
    pub fn one(&self, at: usize) -> RadarEcho {
        let Paths { range, range_rate, amplitude, tx_direction, rx_direction, tx_distance, rx_distance } = &self.paths;
        RadarEcho {
            range: range[at],
            range_rate: range_rate[at],
            amplitude: amplitude[at],
            tx: (tx_direction[at].into(), tx_distance[at]),
            rx: (rx_direction[at].into(), rx_distance[at]),
            row: self.row[at],
            triangle: self.triangle[at],
            target: self.target[at],
            route: self.route[at],
            place: self.place[at],
        }
    }

    /// Those of the numbers `which`, as a radar receives them that is turned by `angle` to the left, rad.
    pub fn turned(&self, which: impl Iterator<Item = usize>, angle: f32) -> RadarEchoes {
        let back = Mat3::from_rotation_z(-angle);
        let mut echoes = RadarEchoes::default();
        for at in which {
            let echo = self.one(at);
            let [tx, rx] = [echo.tx, echo.rx].map(|(direction, distance)| (back * direction, distance));
            echoes.push(RadarEcho { tx, rx, ..echo });
        }
        echoes
    }

    /// Appends `other`.
    pub fn append(&mut self, other: &RadarEchoes) {
        let Paths { range, range_rate, amplitude, tx_direction, rx_direction, tx_distance, rx_distance } = &other.paths;
        self.paths.range.extend_from_slice(range);
        self.paths.range_rate.extend_from_slice(range_rate);
        self.paths.amplitude.extend_from_slice(amplitude);
        self.paths.tx_direction.extend_from_slice(tx_direction);
        self.paths.rx_direction.extend_from_slice(rx_direction);
        self.paths.tx_distance.extend_from_slice(tx_distance);
        self.paths.rx_distance.extend_from_slice(rx_distance);
        self.row.extend_from_slice(&other.row);
        self.triangle.extend_from_slice(&other.triangle);
        self.target.extend_from_slice(&other.target);
        self.route.extend_from_slice(&other.route);
        self.place.extend_from_slice(&other.place);
    }

    pub fn clear(&mut self) {
        let RadarEchoes { paths, row, triangle, target, route, place } = self;
        let Paths { range, range_rate, amplitude, tx_direction, rx_direction, tx_distance, rx_distance } = paths;
        range.clear();
        range_rate.clear();
        amplitude.clear();
        tx_direction.clear();
        rx_direction.clear();
        tx_distance.clear();
        rx_distance.clear();
        row.clear();
        triangle.clear();
        target.clear();
        route.clear();
        place.clear();
    }
}
