//! Pings made by hand: what a sonar over a flat bed would report, for tests of this and other crates.
#![allow(dead_code)] // Not every crate needs all of it.

use cloud::cells::{Layout, SonarView, Sounding};
use cloud::{Columns, Field, FieldSet, Ping, Pings};
use glam::{DVec2, DVec3, Vec3};
use ground::pose::Pose;
use model::{Labels, NameTable};
use std::sync::Arc;

/// Label of the target; the bed has 1.
pub const TARGET: u32 = 2;

/// A side-scan sonar on a straight track over a flat bed with one target and its shadow.
#[derive(Clone)]
pub struct SyntheticSidescan {
    /// Number of pings, 0.1 s apart.
    pub pings: usize,
    /// Range bins of each of its two beams.
    pub bins: usize,
    /// Length of a bin, m of slant range.
    pub bin_m: f64,
    /// Height of the sonar above the bed, m.
    pub altitude: f64,
    /// Metres from ping to ping.
    pub speed: f64,
    /// Direction of the track, rad from x.
    pub course: f64,
    /// x and y of the first ping, m; the bed is at z = 0.
    pub start: DVec2,
    /// Position of its middle, metres along the track and to port; half a metre long, 0.4 m wide, 2 m high.
    pub target: Option<[f64; 2]>,
    /// Whether levels vary like those of sand.
    pub speckle: bool,
}

impl Default for SyntheticSidescan {
    fn default() -> Self {
        SyntheticSidescan {
            pings: 101,
            bins: 600,
            bin_m: 0.05,
            altitude: 8.0,
            speed: 0.1,
            course: 0.0,
            start: DVec2::ZERO,
            target: Some([5.0, 12.0]),
            speckle: false,
        }
    }
}

impl SyntheticSidescan {
    pub(crate) fn target_in_world(&self) -> DVec2 {
        let [along, port] = self.target.unwrap();
        let ahead = DVec2::from_angle(self.course);
        self.start + along * ahead + port * ahead.perp()
    }
}

const NOISE: f32 = 30.0;
const BED: f32 = 130.0;

fn fields() -> FieldSet {
    [Field::Intensity, Field::CategoryId, Field::InstanceId, Field::TrueX, Field::Time].into_iter().collect()
}

fn layout(view: SonarView, axes: Vec<[f32; 2]>, bins: usize, bin_m: f64, gain: f64) -> Arc<Layout> {
    let tvg_db = (0..bins).map(|bin| (gain * ((bin as f64 + 0.5) * bin_m).log10()) as f32).collect();
    let threshold_db = vec![NOISE + 10.0; bins];
    Arc::new(
        Layout::default()
            .view(view)
            .axes(axes)
            .bins(bins)
            .bin_m(bin_m)
            .noise_db(NOISE)
            .threshold_db(threshold_db)
            .tvg_db(tvg_db),
    )
}

fn ping(number: usize, layout: &Arc<Layout>, pose: Pose, mut cell: impl FnMut(usize, f64) -> (f32, u32)) -> Ping {
    let mut cells = Columns::default();
    cells.resize(fields(), layout.cells()).unwrap();
    for beam in 0..layout.beams() {
        for bin in 0..layout.bins {
            let row = layout.cell(beam, 0, bin);
            let (level, label) = cell(beam, layout.range(bin));
            cells.intensity[row] = level;
            cells.category_id[row] = label;
            cells.instance_id[row] = 10 * label;
            cells.true_x[row] = if label > 0 { row as f32 } else { f32::NAN };
            cells.time[row] = number as f64 + layout.range(bin) / 750.0;
        }
    }
    let table = |rows: &[(u32, &str)]| NameTable {
        ids: rows.iter().map(|row| row.0).collect(),
        names: rows.iter().map(|row| row.1.to_owned()).collect(),
    };
    let labels = Labels::default().category(table(&[(1, "seabed"), (TARGET, "boulder")]));
    Ping {
        number: number as u32,
        time: number as f64 * 0.1,
        pose,
        layout: Arc::clone(layout),
        origin: DVec3::new(100.0, 200.0, 0.0),
        cells,
        fields: fields(),
        soundings: Vec::new(),
        labels: Arc::new(labels),
        ..Ping::default()
    }
}

/// The same number for the same `index`, 0 to 1 exclusive.
fn random(index: u64) -> f32 {
    let mut x = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 40) as f32 / (1 << 24) as f32
}

/// Echo of a flat bed, dB re 1 uPa: Lambert's law and 40 log of the range.
fn bed(range: f64, altitude: f64) -> f32 {
    BED - (40.0 * range.log10() - 20.0 * (altitude / range).log10()) as f32
}

/// What it records along `track`: beam 0 to port, beam 1 to starboard.
pub fn pings(track: &SyntheticSidescan) -> Pings {
    let axes = [90f32, -90.0].map(|degrees| [degrees.to_radians(), (-30f32).to_radians()]);
    let layout = layout(SonarView::Sidescan, axes.to_vec(), track.bins, track.bin_m, 40.0);
    let mut pings = Pings::default();
    let height = 2.0;
    for number in 0..track.pings {
        let along = number as f64 * track.speed;
        let at = track.start + along * DVec2::from_angle(track.course);
        let pose = Pose::at(at.x, at.y, track.altitude).with_rpy_deg(0.0, 0.0, track.course.to_degrees());
        let mut index = (number * 1_000_000) as u64;
        let made = ping(number, &layout, pose, |beam, range| {
            index += 1;
            // The power of a Rayleigh-distributed amplitude is distributed exponentially.
            let speckle = if track.speckle { 10.0 * (-(random(index) + 1e-6).ln()).log10() } else { 0.0 };
            let (noise, altitude) = (NOISE + speckle, track.altitude);
            if range < altitude {
                return (noise, 0);
            }
            let across = (range * range - altitude * altitude).sqrt();
            if let Some([place, port]) = track.target
                && beam == 0
                && (along - place).abs() <= 0.2501
            {
                if (across - port).abs() <= 0.2 {
                    return (bed(range, altitude) + 20.0 + speckle, TARGET);
                }
                if across > port && across < port * altitude / (altitude - height) {
                    return (noise, 0);
                }
            }
            (bed(range, altitude) + speckle, 1)
        });
        pings.push(made).unwrap();
    }
    pings
}

/// One ping of 60 beams over 120 degrees and 15 m of range, with a target at `degrees` to port.
pub fn imaging(view: SonarView, degrees: f64, range: f64) -> Ping {
    let angles: Vec<f64> = (0..60).map(|beam| f64::from(2 * beam - 59)).collect();
    let axis = |&angle: &f64| match view {
        SonarView::Swath => [90f64.copysign(angle), angle.abs() - 90.0],
        _ => [angle, 0.0],
    };
    let axes = angles.iter().map(|angle| axis(angle).map(|degrees| degrees.to_radians() as f32)).collect();
    ping(0, &layout(view, axes, 300, 0.05, 40.0), Pose::IDENTITY, |beam, at| {
        let hit = (angles[beam] - degrees).abs() < 1.5 && (at - range).abs() < 0.1;
        (if hit { 140.0 } else { bed(at, 2.0) }, if hit { TARGET } else { 1 })
    })
}

/// A single beam that rotates to the left by `step` degrees from ping to ping, with a target at 12 m at the 50th.
pub fn turning(pings: usize, step: f64) -> Pings {
    let layout = layout(SonarView::Single, vec![[0.0; 2]], 300, 0.05, 0.0);
    let mut turned = Pings::default();
    for number in 0..pings {
        let pose = Pose::IDENTITY.with_rpy_deg(0.0, 0.0, number as f64 * step);
        let made = ping(number, &layout, pose, |_, at| {
            let hit = number == 50 && (at - 12.0).abs() < 0.1;
            (if hit { 140.0 } else { bed(at, 2.0) }, if hit { TARGET } else { 1 })
        });
        turned.push(made).unwrap();
    }
    turned
}

/// `track` moved `by` metres.
pub fn moved(mut track: Pings, by: DVec3) -> Pings {
    for ping in &mut track.pings {
        ping.pose.position += by;
        ping.origin += by;
    }
    track
}

/// A swath sonar at z = 0 along x over a bed at -10 m with a block, 1 m high, from 9, 3 to 11, 5.
pub fn swath(pings: usize) -> Pings {
    let angles: Vec<f64> = (0..81).map(|beam| (f64::from(beam) * 1.5 - 60.0).to_radians()).collect();
    let axis = |angle: &f64| [90f64.to_radians().copysign(*angle) as f32, (angle.abs() - 90f64.to_radians()) as f32];
    let layout = layout(SonarView::Swath, angles.iter().map(axis).collect(), 500, 0.05, 40.0);
    let mut track = Pings::default();
    for number in 0..pings {
        let x = number as f64 * 0.35;
        let echo = |beam: usize| {
            let y = 9.0 * angles[beam].tan();
            let block = (9.0..=11.0).contains(&x) && (3.0..=5.0).contains(&y);
            ((if block { 9.0 } else { 10.0 }) / angles[beam].cos(), if block { TARGET } else { 1 })
        };
        let mut made = ping(number, &layout, Pose::at(x, 0.0, 0.0), |beam, at| match echo(beam) {
            (range, label) if (at - range).abs() < 0.3 => (bed(at, 10.0), label),
            _ => (NOISE, 0),
        });
        made.soundings = (0..angles.len())
            .map(|beam| {
                let range = echo(beam).0;
                let cell = layout.cell(beam, 0, (range / layout.bin_m) as usize) as u32;
                Sounding::default()
                    .beam(beam as u32)
                    .range(range as f32)
                    .cell(cell)
                    .level_db(90.0)
                    .quality(0.5)
                    .corrected(Vec3::NAN)
            })
            .collect();
        track.push(made).unwrap();
    }
    track
}
