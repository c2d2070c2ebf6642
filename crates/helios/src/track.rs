//! Trajectory files of interpolated platforms.

use crate::assets::AssetFolders;
use crate::xml::XmlElement;
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};
use ground::pose::Pose;
use ground::read::{self, Limit};
use ground::shown;
use std::path::{Path, PathBuf};

/// The part of a trajectory file along which a platform moves on a leg.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeliosTrack {
    /// The file.
    pub file: PathBuf,
    /// What is between its columns.
    pub separator: String,
    /// Columns of time, roll, pitch, yaw, x, y, z, from 0; none: those that the file names.
    pub columns: Option<[usize; 7]>,
    /// Where the leg begins, s; none: where the file does.
    pub from_s: Option<f64>,
    /// Where it ends, s; none: where the file does.
    pub to_s: Option<f64>,
    /// Whether angles are degrees; radians otherwise.
    pub degrees: bool,
    /// Whether rotations are about x, then y, then z; otherwise they are as in ARINC 705.
    pub canonical: bool,
    /// Whether only positions are taken.
    pub positions_only: bool,
}

const COLUMNS: [&str; 7] = ["tIndex", "rollIndex", "pitchIndex", "yawIndex", "xIndex", "yIndex", "zIndex"];
const NAMES: [&str; 7] = ["t", "roll", "pitch", "yaw", "x", "y", "z"];

impl HeliosTrack {
    /// Reads the element `platformSettings` of a leg.
    pub(crate) fn read(element: XmlElement, assets: &AssetFolders, canonical: bool) -> Result<HeliosTrack> {
        let name = element.required("trajectory")?;
        let file = assets.find(name).map_err(|why| element.error(format_args!("trajectory: {why}")))?;
        let mut columns = [0, 1, 2, 3, 4, 5, 6];
        let mut specified = false;
        for (name, column) in COLUMNS.into_iter().zip(&mut columns) {
            if let Some(index) = element.count(name, 0, 1000)? {
                (*column, specified) = (index as usize, true);
            }
        }
        let (notes, place) = (element.notes(), element.place());
        // The schema and the loader of HELIOS++ spell it differently.
        let spelled = ["trajectory_separator", "trajectory_seperator"].map(|key| element.text(key));
        let separator = spelled.into_iter().flatten().next().unwrap_or(",").to_owned();
        let positions_only = match element.text("interpolationDomain") {
            None | Some("" | "position_and_attitude") => false,
            Some("position") => true,
            Some(_) => return Err(element.wrong("interpolationDomain", "position or position_and_attitude")),
        };
        if element.number("slopeFilterThreshold")?.is_some_and(|threshold| threshold > 0.0) {
            notes.approximated(place, "slopeFilterThreshold", "all rows are kept");
        }
        if element.flag("syncGPSTime")? == Some(true) {
            notes.approximated(place, "syncGPSTime", "times begin at 0, as legs may jump back in time");
        }
        // Legs begin where their rows do, whether that is a jump or not.
        element.flag("teleportToStart")?;
        Ok(HeliosTrack {
            file,
            separator,
            columns: specified.then_some(columns),
            from_s: element.number("tStart")?,
            to_s: element.number("tEnd")?,
            degrees: element.flag("toRadians")?.unwrap_or(true),
            canonical,
            positions_only,
        })
    }

    /// The poses of the platform from the beginning of the leg on, in the axes of HELIOS++: times from 0, s, and poses.
    pub(crate) fn path(&self) -> Result<Vec<(f64, Pose)>> {
        let rows = self.rows()?;
        let (first, last) = (rows[0][0], rows[rows.len() - 1][0]);
        let (from, to) = (self.from_s.unwrap_or(first).max(first), self.to_s.unwrap_or(last).min(last));
        if from >= to {
            let message = format!("has rows from {first} to {last} s, which do not reach from {from} to {to} s, a leg");
            return Err(Error::parse(&self.file, "", message));
        }
        let after = rows.partition_point(|row| row[0] <= from);
        let before = rows.partition_point(|row| row[0] < to);
        let mut own = vec![between(&rows, after, from)];
        own.extend_from_slice(&rows[after..before]);
        own.push(between(&rows, before, to));
        let mut path: Vec<(f64, Pose)> = Vec::with_capacity(own.len());
        for pair in own.windows(2) {
            // Angles are what is interpolated there: poses between them must not be left to others.
            let widest = (1..4).map(|angle| (pair[1][angle] - pair[0][angle]).abs()).fold(0.0, f64::max);
            let steps = if self.positions_only { 1.0 } else { (widest / FINE_RAD).ceil().clamp(1.0, 1e4) };
            if path.len() > MOST_ROWS {
                return Err(Error::Memory(format!("a trajectory of more than {MOST_ROWS} poses")));
            }
            for step in 0..steps as usize {
                self.push(&mut path, from, mixed(&pair[0], &pair[1], step as f64 / steps));
            }
        }
        self.push(&mut path, from, own[own.len() - 1]);
        if self.positions_only {
            let ahead = path[path.len() - 1].1.position - path[0].1.position;
            let yaw = DQuat::from_rotation_z((-ahead.x).atan2(ahead.y));
            path.iter_mut().for_each(|(_, pose)| pose.orientation = yaw);
        }
        Ok(path)
    }

    fn push(&self, path: &mut Vec<(f64, Pose)>, from: f64, [time, roll, pitch, yaw, x, y, z]: [f64; 7]) {
        let about = DQuat::from_axis_angle;
        // calcAttitude in InterpolatedMovingPlatform.cpp (3dgeo-heidelberg/helios fd94d1f).
        let orientation = if self.canonical {
            about(DVec3::X, roll) * about(DVec3::Y, pitch) * about(DVec3::Z, yaw)
        } else {
            about(DVec3::NEG_Z, yaw) * about(DVec3::Y, roll) * about(DVec3::X, pitch)
        };
        // Two rows of one time are a jump.
        let least = path.last().map_or(0.0, |(before, _)| before + JUMP_S);
        path.push(((time - from).max(least), Pose { position: DVec3::new(x, y, z), orientation }));
    }

    /// The rows of the file by time: s, rad, m.
    fn rows(&self) -> Result<Vec<[f64; 7]>> {
        let bytes = read::bytes(&self.file, Limit::TABLE)?;
        let text = String::from_utf8_lossy(&bytes);
        let (mut names, mut time_column) = (None, None);
        let mut rows: Vec<[f64; 7]> = Vec::new();
        let mut columns = self.columns;
        for (index, line) in text.lines().enumerate() {
            let wrong = |message: String| Error::parse(&self.file, format!("line {}", index + 1), message);
            let line = line.trim();
            if let Some(list) = line.strip_prefix("#HEADER:") {
                let list = list.split(',').map(|name| name.trim().trim_matches('"').to_ascii_lowercase());
                names = Some(list.collect::<Vec<String>>());
            } else if let Some(column) = line.strip_prefix("#TIME_COLUMN:") {
                time_column = Some(column.trim().parse().map_err(|_| wrong("has no number of a column".into()))?);
            } else if !line.is_empty() && !line.starts_with('#') {
                let columns = match columns {
                    Some(columns) => columns,
                    None => *columns.insert(self.named(names.as_deref(), time_column).map_err(wrong)?),
                };
                rows.push(self.row(line, &columns).map_err(wrong)?);
                if rows.len() > MOST_ROWS {
                    return Err(wrong(format!("is beyond {MOST_ROWS} rows, the most allowed")));
                }
            }
        }
        if rows.len() < 2 {
            return Err(Error::parse(&self.file, "", "has fewer than two rows; allowed: a time and a pose each"));
        }
        rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
        shorten(&mut rows);
        Ok(rows)
    }

    /// The columns that the file names.
    fn named(&self, names: Option<&[String]>, time: Option<usize>) -> Result<[usize; 7], String> {
        let Some(names) = names else { return Ok([0, 1, 2, 3, 4, 5, 6]) };
        let mut columns = [usize::MAX; 7];
        for (index, (name, column)) in NAMES.into_iter().zip(&mut columns).enumerate() {
            let found = names.iter().position(|known| known == name).or(time.filter(|_| index == 0));
            let needed = index == 0 || index > 3 || !self.positions_only;
            *column = match found {
                Some(found) => found,
                None if needed => {
                    return Err(format!("comes after a header without {name}; allowed: {}", NAMES.join(", ")));
                }
                None => usize::MAX,
            };
        }
        Ok(columns)
    }

    fn row(&self, line: &str, columns: &[usize; 7]) -> Result<[f64; 7], String> {
        let cells: Vec<&str> = match self.separator.trim() {
            "" => line.split_whitespace().collect(),
            separator => line.split(separator).map(str::trim).collect(),
        };
        let mut row = [0.0; 7];
        for (index, (&column, value)) in columns.iter().zip(&mut row).enumerate() {
            let is_angle = (1..4).contains(&index);
            if self.positions_only && is_angle {
                continue;
            }
            let cell = cells
                .get(column)
                .ok_or_else(|| format!("has {} columns; allowed: {} or more", cells.len(), column + 1))?;
            let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
            *value = number.ok_or_else(|| format!("{:?} is not a number", shown::name(cell)))?;
            if is_angle && self.degrees {
                *value = value.to_radians();
            }
        }
        Ok(row)
    }
}

/// Angle between poses of which the shortest turn from one to the next is the same as turning by their angles, rad.
const FINE_RAD: f64 = 0.02;

/// More rows than any trajectory needs.
const MOST_ROWS: usize = 5_000_000;

/// Time that a jump takes, s.
const JUMP_S: f64 = 1e-6;

/// Turns angles by whole turns so that each row follows the last one the short way.
fn shorten(rows: &mut [[f64; 7]]) {
    use std::f64::consts::TAU;
    for index in 1..rows.len() {
        for angle in 1..4 {
            let turned = rows[index][angle] - rows[index - 1][angle];
            rows[index][angle] -= (turned / TAU).round() * TAU;
        }
    }
}

/// The row at `time`, before the one numbered `after`.
fn between(rows: &[[f64; 7]], after: usize, time: f64) -> [f64; 7] {
    match (after.checked_sub(1).map(|before| rows[before]), rows.get(after)) {
        (Some(a), Some(b)) if b[0] > a[0] => mixed(&a, b, (time - a[0]) / (b[0] - a[0])),
        (_, Some(b)) => *b,
        (a, None) => a.unwrap_or_default(),
    }
}

fn mixed(a: &[f64; 7], b: &[f64; 7], part: f64) -> [f64; 7] {
    std::array::from_fn(|index| a[index] + (b[index] - a[index]) * part)
}

/// The columns of `tracks` that only some of them specify: HELIOS++ reads a file once.
pub(crate) fn share_columns<'t>(tracks: impl Iterator<Item = &'t mut HeliosTrack>) {
    let mut tracks: Vec<&mut HeliosTrack> = tracks.collect();
    let known: Vec<(PathBuf, [usize; 7])> =
        tracks.iter().filter_map(|track| Some((track.file.clone(), track.columns?))).collect();
    let degrees = tracks.iter().all(|track| track.degrees);
    let of = |file: &Path| known.iter().find(|(path, _)| path == file).map(|(_, columns)| *columns);
    for track in &mut tracks {
        track.columns = track.columns.or_else(|| of(&track.file));
        track.degrees = degrees;
    }
}
