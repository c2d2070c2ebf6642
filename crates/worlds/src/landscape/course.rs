//! Courses over the land: a stream and a path, as lines of stations.

use super::drainage::{HeightField, rank};
use super::terrain::Terrain;
use crate::noise::GradientNoise;
use glam::DVec2;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Distance from its centre line up to which a course is indexed, m.
const REACH: f64 = 12.0;
/// Width of the squares by which the line is indexed, m.
const BUCKET: f64 = 16.0;
/// Distance from station to station, m.
const STATION: f64 = 1.0;
/// Noise field by which the path wanders.
const WANDER: u32 = 35;

/// A line over the land with a width and a height.
pub(super) struct Course {
    pub stations: Vec<Station>,
    /// Numbers of the segments near each square.
    near: HashMap<[i64; 2], Vec<u32>>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    pub at: DVec2,
    pub half_width: f64,
    /// Height of the surface of the water, or of the path.
    pub level: f64,
}

impl Course {
    fn new(stations: Vec<Station>) -> Self {
        let mut near: HashMap<[i64; 2], Vec<u32>> = HashMap::new();
        for (number, pair) in stations.windows(2).enumerate() {
            let [low, high] = [pair[0].at.min(pair[1].at) - REACH, pair[0].at.max(pair[1].at) + REACH];
            let [low, high] = [low, high].map(bucket);
            for column in low[0]..=high[0] {
                for row in low[1]..=high[1] {
                    near.entry([column, row]).or_default().push(number as u32);
                }
            }
        }
        Course { stations, near }
    }

    /// The nearest point of the line, and its distance; `None` if that may be more than [`REACH`].
    pub fn nearest(&self, at: DVec2) -> Option<(Station, f64)> {
        let segments = self.near.get(&bucket(at))?;
        let place = |&number: &u32| {
            let [a, b] = [self.stations[number as usize], self.stations[number as usize + 1]];
            let along = b.at - a.at;
            let part = ((at - a.at).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            let between = |a: f64, b: f64| a + part * (b - a);
            let station = Station {
                at: a.at + along * part,
                half_width: between(a.half_width, b.half_width),
                level: between(a.level, b.level),
            };
            (station, station.at.distance(at))
        };
        segments.iter().map(place).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Distance of a point from the edge of the course, negative on the course; infinite if it is far away.
    pub fn clearance(&self, at: DVec2) -> f64 {
        self.nearest(at).map_or(f64::INFINITY, |(station, distance)| distance - station.half_width)
    }

    pub fn length(&self) -> f64 {
        self.stations.windows(2).map(|pair| pair[0].at.distance(pair[1].at)).sum()
    }
}

fn bucket(at: DVec2) -> [i64; 2] {
    [at.x, at.y].map(|along| (along / BUCKET).floor() as i64)
}

/// The terrain on a grid of about `points` points along the longer side, no finer than its own.
fn coarse(terrain: &Terrain, points: f64) -> HeightField {
    let step = (terrain.size[0].max(terrain.size[1]) / points).max(terrain.widest());
    let counts = terrain.size.map(|length| (length / step).round().max(2.0) as usize);
    let step = std::array::from_fn(|axis| terrain.size[axis] / counts[axis] as f64);
    let columns = counts[0] + 1;
    let place = |point: usize| [point % columns, point / columns];
    let heights = (0..columns * (counts[1] + 1)).map(|point| {
        let at: [f64; 2] =
            std::array::from_fn(|axis| place(point)[axis] as f64 * step[axis] - terrain.size[axis] / 2.0);
        terrain.height(at[0], at[1])
    });
    HeightField { columns, step, heights: heights.collect() }
}

/// A smooth line of stations along points of a field.
fn line(terrain: &Terrain, field: &HeightField, points: &[u32], passes: usize) -> Vec<DVec2> {
    let [x, y] = terrain.size;
    let place = |&point: &u32| {
        let (column, row) = (point as usize % field.columns, point as usize / field.columns);
        DVec2::new(column as f64 * field.step[0] - x / 2.0, row as f64 * field.step[1] - y / 2.0)
    };
    let mut line: Vec<DVec2> = points.iter().map(place).collect();
    for _ in 0..passes {
        smooth(&mut line, |a, b, c| (a + 2.0 * b + c) / 4.0);
    }
    // Evenly spaced stations.
    let mut stations = vec![line[0]];
    let mut left = STATION;
    for pair in line.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        while from.distance(to) > left {
            from += (to - from).normalize() * left;
            stations.push(from);
            left = STATION;
        }
        left -= from.distance(to);
    }
    let end = line[line.len() - 1];
    match stations.last_mut() {
        Some(last) if last.distance(end) < STATION / 2.0 && points.len() > 1 => *last = end,
        _ => stations.push(end),
    }
    stations
}

/// Replaces each value but the ends by `mean` of the value before it, itself and the value after it.
fn smooth<T: Copy>(values: &mut [T], mean: impl Fn(T, T, T) -> T) {
    let before = values.to_vec();
    for i in 1..values.len().saturating_sub(1) {
        values[i] = mean(before[i - 1], before[i], before[i + 1]);
    }
}

/// The stream that drains most of the land, from its spring down; `None` if there is none of sufficient length.
pub(super) fn stream(terrain: &Terrain) -> Option<Course> {
    /// Fraction of the land that must drain through its spring.
    const SPRING: f64 = 0.003;
    /// Half its width at the spring and where it leaves, m.
    const HALF_WIDTHS: [f64; 2] = [0.6, 1.4];
    /// Depth of the water surface below the lowest ground beside it, m.
    const BELOW: f64 = 0.12;
    let field = coarse(terrain, 256.0);
    let drainage = field.drainage((0..field.heights.len()).filter(|&point| field.is_edge(point)));
    let least = (SPRING * field.heights.len() as f64).max(4.0) as u32;
    let points = drainage.main_stream(least);
    if points.len() < 8 {
        return None;
    }
    let line = line(terrain, &field, &points, 12);
    let last = (line.len() - 1) as f64;
    let mut level = f64::INFINITY;
    let stations = line.iter().enumerate().map(|(number, &at)| {
        let part = number as f64 / last;
        let usual = HALF_WIDTHS[0] + part * (HALF_WIDTHS[1] - HALF_WIDTHS[0]);
        let half_width = usual.max(1.2 * terrain.widest());
        let ahead = line[(number + 1).min(line.len() - 1)] - line[number.saturating_sub(1)];
        let side = ahead.perp().normalize_or(DVec2::Y) * (half_width + 1.0);
        let across = (-2..=2).map(|step| at + side * f64::from(step) / 2.0);
        let ground = across.map(|at| terrain.height(at.x, at.y)).fold(f64::INFINITY, f64::min);
        // Water does not run uphill.
        level = level.min(ground - BELOW);
        Station { at, half_width, level }
    });
    Some(Course::new(stations.collect()))
}

/// A path from one end of x to the other that avoids slopes, and the stream where it can.
pub(super) fn path(terrain: &Terrain, stream: Option<&Course>, seed: u64) -> Course {
    /// Slope at which a metre costs as much as two metres of level ground.
    const STEEP: f64 = 0.1;
    /// Additional cost of wading.
    const WADING: f64 = 30.0;
    const HALF_WIDTH: f64 = 1.2;
    /// Number of stations on each side over which heights are averaged.
    const EVEN: usize = 5;
    let field = coarse(terrain, 160.0);
    let [x, y] = terrain.size;
    let wander = GradientNoise::new(seed, WANDER, terrain.size, [0.25 * x.min(y), 4.0 * terrain.widest()], 2, 0.5);
    let place = |point: usize| {
        DVec2::new((point % field.columns) as f64 * field.step[0], (point / field.columns) as f64 * field.step[1])
    };
    let toll: Vec<f64> = (0..field.heights.len())
        .map(|point| {
            let at = place(point);
            let wet = stream.is_some_and(|stream| stream.clearance(at - DVec2::new(x, y) / 2.0) < 3.0);
            let side = (at.y / y - 0.5).abs();
            let border = if side > 0.42 { 4.0 } else { 0.0 };
            1.0 + 2.5 * (wander.at(at.x, at.y) + 0.3).max(0.0) + border + if wet { WADING } else { 0.0 }
        })
        .collect();
    // The cheapest way (Dijkstra 1959).
    let mut costs = vec![f64::INFINITY; field.heights.len()];
    let mut from = vec![u32::MAX; field.heights.len()];
    let mut open = BinaryHeap::new();
    for row in 0..field.rows() {
        costs[row * field.columns] = 0.0;
        open.push(Reverse((rank(0.0), (row * field.columns) as u32)));
    }
    let mut end = 0;
    while let Some(Reverse((cost, point))) = open.pop() {
        let point = point as usize;
        if cost != rank(costs[point]) {
            continue;
        }
        if point % field.columns == field.columns - 1 {
            end = point;
            break;
        }
        for (next, run) in field.around(point) {
            let slope = (field.heights[next] - field.heights[point]).abs() / run;
            let price = run * (1.0 + (slope / STEEP).powi(2)) * (toll[point] + toll[next]) / 2.0;
            if costs[point] + price < costs[next] {
                costs[next] = costs[point] + price;
                from[next] = point as u32;
                open.push(Reverse((rank(costs[next]), next as u32)));
            }
        }
    }
    let mut points = vec![end as u32];
    while let Some(&before) = points.last().map(|&point| &from[point as usize]).filter(|&&before| before != u32::MAX) {
        points.push(before);
    }
    points.reverse();
    let line = line(terrain, &field, &points, 10);
    let heights: Vec<f64> = line.iter().map(|at| terrain.height(at.x, at.y)).collect();
    let half_width = HALF_WIDTH.max(0.8 * terrain.widest());
    let stations = line.iter().enumerate().map(|(number, &at)| {
        let near = &heights[number.saturating_sub(EVEN)..(number + EVEN + 1).min(heights.len())];
        Station { at, half_width, level: near.iter().sum::<f64>() / near.len() as f64 }
    });
    Course::new(stations.collect())
}

/// Levels the ground across the path, and blends it into the original ground beside it.
pub(super) fn level(terrain: &mut Terrain, path: &Course) {
    /// How far beside the path the ground is changed, m.
    const SHOULDER: f64 = 3.0;
    each_near(terrain, path, |station, distance, height| {
        // A little more than its width, so that the triangles at its edge are level too.
        let out = ((distance - station.half_width - 0.3) / SHOULDER).clamp(0.0, 1.0);
        let kept = out * out * (3.0 - 2.0 * out);
        station.level + kept * (height - station.level)
    });
}

/// Cuts the bed and the banks of the stream into the ground.
pub(super) fn carve(terrain: &mut Terrain, stream: &Course) {
    /// Slope of the banks.
    const BANK: f64 = 0.6;
    each_near(terrain, stream, |station, distance, height| {
        let Station { half_width, level, .. } = station;
        let depth = 0.1 + 0.15 * half_width;
        let cut = match distance < half_width {
            true => level - depth * (1.0 - (distance / half_width).powi(2)),
            false => level + BANK * (distance - half_width),
        };
        height.min(cut)
    });
}

fn each_near(terrain: &mut Terrain, course: &Course, change: impl Fn(Station, f64, f64) -> f64) {
    let columns = terrain.columns();
    for index in 0..terrain.heights.len() {
        let at = DVec2::from(terrain.place(index % columns, index / columns));
        if let Some((station, distance)) = course.nearest(at).filter(|(_, distance)| *distance < REACH) {
            terrain.heights[index] = change(station, distance, terrain.heights[index].into()) as f32;
        }
    }
}
