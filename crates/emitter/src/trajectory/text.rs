//! Trajectories as text: TUM, CSV with columns by name, and those of HELIOS++.

use super::georeference::{Geographic, Georeference, navigated, navigation_angles};
use super::key::{KeyReader, TimedPose, fault};
use glam::{DQuat, DVec3};
use ground::error::Result;
use ground::pose::Pose;
use ground::read::csv::{CsvReader, Lines};
use ground::report::Report;
use ground::shown;
use std::f64::consts::FRAC_PI_2;
use std::io::{self, Write};

/// Names of the column of times, s.
const TIMES: [&str; 4] = ["time_s", "t", "time", "gps_time"];

/// Reads the text that `lines` has: TUM, or CSV with a header.
pub(super) fn read(mut lines: Lines, reader: &mut KeyReader, report: &mut Report) -> Result<()> {
    if !lines.advance()? {
        return Err(lines.error_at_all("has no poses; expected TUM text (t x y z qx qy qz qw) or CSV with a header"));
    }
    let has_header = lines.text().starts_with(|c: char| c.is_alphabetic() || c == '"');
    if has_header && !lines.text().contains(',') {
        let expected = "expected CSV with a header, or TUM text (t x y z qx qy qz qw) without one";
        return Err(lines.error(format!("has a header without commas; {expected}")));
    }
    if has_header { read_csv(CsvReader::with_header(lines)?, reader, report) } else { read_tum(lines, reader) }
}

fn read_tum(mut lines: Lines, reader: &mut KeyReader) -> Result<()> {
    loop {
        let numbers: Vec<f64> = lines
            .text()
            .split_ascii_whitespace()
            .map(|word| word.parse().map_err(|_| lines.error(format!("{:?} is not a number", shown::name(word)))))
            .collect::<Result<_>>()?;
        let [time, x, y, z, qx, qy, qz, qw] = numbers[..] else {
            return Err(lines.error(format!("has {} numbers; expected 8: t x y z qx qy qz qw", numbers.len())));
        };
        let pose = Pose { position: DVec3::new(x, y, z), orientation: DQuat::from_xyzw(qx, qy, qz, qw) };
        reader.add(time, pose).map_err(|message| lines.error(message))?;
        if !lines.advance()? {
            return Ok(());
        }
    }
}

/// Which columns a CSV file has for the position, and their numbers.
enum PositionColumns {
    /// `x, y, z`, of the world: m.
    World([usize; 3]),
    /// `easting, northing, height`: m.
    Grid([usize; 3]),
    /// `lat, lon, height`: degrees and m.
    Degrees([usize; 3]),
}

/// Likewise for the orientation.
enum AngleColumns {
    /// `qx, qy, qz, qw`.
    Quaternion([usize; 4]),
    /// `roll_deg, pitch_deg, yaw_deg`, of ROS: pitch nose down, yaw to the left from x.
    Yaw([usize; 3]),
    /// `roll_deg, pitch_deg, heading_deg`, of navigators: pitch nose up, heading clockwise from north.
    Heading([usize; 3]),
}

impl PositionColumns {
    fn of(csv: &CsvReader) -> Result<PositionColumns> {
        if let [Some(x), Some(y), Some(z)] = csv.optional(["x", "y", "z"]) {
            return Ok(PositionColumns::World([x, y, z]));
        }
        let first = |names: [&str; 2]| csv.optional(names).into_iter().flatten().next();
        let has_latitude = first(["lat", "latitude"]).or(first(["lat_deg", "latitude_deg"]));
        let has_easting = first(["easting", "easting_m"]);
        let height = first(["height", "height_m"]).or(first(["altitude", "altitude_m"]));
        let missing = |what: &str| csv.error(format!("the column {what} is missing"));
        if let Some(latitude) = has_latitude {
            let longitude = first(["lon", "longitude"]).or(first(["lon_deg", "longitude_deg"]));
            let longitude = longitude.ok_or_else(|| missing("lon beside lat"))?;
            let height = height.ok_or_else(|| missing("height beside lat"))?;
            return Ok(PositionColumns::Degrees([latitude, longitude, height]));
        }
        if let Some(easting) = has_easting {
            let northing = first(["northing", "northing_m"]).ok_or_else(|| missing("northing beside easting"))?;
            let height = height.ok_or_else(|| missing("height beside easting"))?;
            return Ok(PositionColumns::Grid([easting, northing, height]));
        }
        Ok(PositionColumns::World(csv.required(["x", "y", "z"])?))
    }
}

impl AngleColumns {
    /// Of several complete ones, places in degrees need headings; otherwise yaw comes first, then quaternions.
    fn of(csv: &CsvReader, position: &PositionColumns) -> Result<AngleColumns> {
        let heading = || Ok(AngleColumns::Heading(csv.required(["roll_deg", "pitch_deg", "heading_deg"])?));
        let has_heading = csv.optional(["heading_deg"])[0].is_some();
        if has_heading && matches!(position, PositionColumns::Degrees(_)) {
            return heading();
        }
        if let [Some(roll), Some(pitch), Some(yaw)] = csv.optional(["roll_deg", "pitch_deg", "yaw_deg"]) {
            return Ok(AngleColumns::Yaw([roll, pitch, yaw]));
        }
        if let [Some(x), Some(y), Some(z), Some(w)] = csv.optional(["qx", "qy", "qz", "qw"]) {
            return Ok(AngleColumns::Quaternion([x, y, z, w]));
        }
        if has_heading {
            return heading();
        }
        if csv.optional(["roll_deg", "pitch_deg", "yaw_deg"]).iter().any(Option::is_some) {
            return Ok(AngleColumns::Yaw(csv.required(["roll_deg", "pitch_deg", "yaw_deg"])?));
        }
        if csv.optional(["qx", "qy", "qz", "qw"]).iter().all(Option::is_none) {
            let expected = "qx,qy,qz,qw or roll_deg,pitch_deg,yaw_deg or roll_deg,pitch_deg,heading_deg";
            return Err(csv.error(format!("has no orientation; expected {expected}")));
        }
        Ok(AngleColumns::Quaternion(csv.required(["qx", "qy", "qz", "qw"])?))
    }
}

fn read_csv(mut csv: CsvReader, reader: &mut KeyReader, report: &mut Report) -> Result<()> {
    let times = csv.optional(TIMES);
    let position = PositionColumns::of(&csv)?;
    let Some(time) = times.into_iter().flatten().next() else {
        return Err(csv.error("has no column of times; expected time_s, t, time or gps_time".into()));
    };
    let angles = AngleColumns::of(&csv, &position)?;
    while let Some(row) = csv.next_row()? {
        let time = row[time];
        let three = |columns: [usize; 3]| columns.map(|column| row[column]);
        let done = match position {
            PositionColumns::World(columns) | PositionColumns::Grid(columns) => {
                let [x, y, z] = three(columns);
                let at = Pose::at(x, y, z);
                let pose = match angles {
                    AngleColumns::Quaternion([qx, qy, qz, qw]) => {
                        Pose { orientation: DQuat::from_xyzw(row[qx], row[qy], row[qz], row[qw]), ..at }
                    }
                    AngleColumns::Yaw(columns) => {
                        let [roll, pitch, yaw] = three(columns);
                        at.with_rpy_deg(roll, pitch, yaw)
                    }
                    AngleColumns::Heading(columns) => {
                        Pose { orientation: navigated(three(columns).map(f64::to_radians)), ..at }
                    }
                };
                match position {
                    PositionColumns::Grid(_) => reader.add_in_grid(time, pose),
                    _ => reader.add(time, pose),
                }
            }
            PositionColumns::Degrees(columns) => {
                let AngleColumns::Heading(angles) = angles else {
                    return Err(csv.error("has lat and lon without heading_deg, the true heading beside them".into()));
                };
                let [latitude, longitude, height] = three(columns);
                let [roll, pitch, heading] = three(angles).map(f64::to_radians);
                let (latitude, longitude) = (latitude.to_radians(), longitude.to_radians());
                let place = Geographic { latitude, longitude, height, roll, pitch, heading };
                if reader.keys.is_empty() {
                    reader.prepare(&place, report)?;
                }
                reader.add_place(time, &place)
            }
        };
        done.map_err(|message| csv.error(message))?;
    }
    if reader.keys.is_empty() {
        return Err(csv.error_at_all("has no poses below the header"));
    }
    Ok(())
}

/// Columns of a trajectory of HELIOS++, in the order that they have without a header.
const OF_HELIOS: [&str; 7] = ["t", "roll", "pitch", "yaw", "x", "y", "z"];

/// Reads a trajectory of HELIOS++ from `text`, which came from `origin`: lines of seven numbers, and a comment
/// `#HEADER: "t", "roll", "pitch", "yaw", "x", "y", "z"` that gives their order. Angles are in degrees and those of
/// ARINC 705, its default: yaw clockwise from y, then roll, starboard down, then pitch, nose up; its platforms look along
/// their y axis (`Directions.cpp`, `InterpolatedMovingPlatform.cpp` of HELIOS++ 2).
pub(super) fn read_helios(origin: &str, text: String, reader: &mut KeyReader) -> Result<()> {
    let mut columns = [0, 1, 2, 3, 4, 5, 6];
    let header = text.lines().enumerate().find_map(|(at, line)| Some((at, line.trim().strip_prefix("#HEADER:")?)));
    let mut width = OF_HELIOS.len();
    if let Some((at, header)) = header {
        let names: Vec<&str> = header.split(',').map(|name| name.trim().trim_matches('"')).collect();
        width = names.len();
        for (column, wanted) in columns.iter_mut().zip(OF_HELIOS) {
            *column = names.iter().position(|name| name.eq_ignore_ascii_case(wanted)).ok_or_else(|| {
                let expected = OF_HELIOS.join(", ");
                fault(
                    origin,
                    format!("line {}", at + 1),
                    format!("the column {wanted} is missing; expected {expected}"),
                )
            })?;
        }
    }
    let mut lines = Lines::of(origin, text);
    let mut numbers = Vec::with_capacity(width);
    while lines.advance()? {
        numbers.clear();
        let is_between = |c: char| c == ',' || c == ';' || c.is_ascii_whitespace();
        for word in lines.text().split(is_between).filter(|word| !word.is_empty()) {
            let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
            numbers.push(number.ok_or_else(|| lines.error(format!("{:?} is not a finite number", shown::name(word))))?);
        }
        if numbers.len() != width {
            return Err(lines.error(format!(
                "has {} numbers; expected {width}: {}",
                numbers.len(),
                OF_HELIOS.join(", ")
            )));
        }
        let [time, roll, pitch, yaw, x, y, z] = columns.map(|column| numbers[column]);
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_radians);
        let turned = DQuat::from_rotation_z(-yaw) * DQuat::from_rotation_y(roll) * DQuat::from_rotation_x(pitch);
        // Its y axis is ours ahead.
        let pose = Pose { orientation: turned * DQuat::from_rotation_z(FRAC_PI_2), ..Pose::at(x, y, z) };
        reader.add_in_grid(time, pose).map_err(|message| lines.error(message))?;
    }
    if reader.keys.is_empty() {
        return Err(lines.error_at_all("has no poses; expected lines of t, roll, pitch, yaw, x, y, z"));
    }
    Ok(())
}

/// Writes `keys` as TUM text, their times `later`, s.
pub(super) fn write_tum(keys: &[TimedPose], later: f64, to: &mut impl Write) -> io::Result<()> {
    for (time, pose) in keys {
        let ([x, y, z], [qx, qy, qz, qw]) = (pose.position.to_array(), pose.orientation.to_array());
        writeln!(to, "{} {x} {y} {z} {qx} {qy} {qz} {qw}", time + later)?;
    }
    Ok(())
}

/// Writes `keys` as CSV, their times `later`, s: with a georeference, eastings, northings and heights in its system and
/// the angles of navigators relative to the grid; without one, positions and quaternions of the world.
pub(super) fn write_csv(
    keys: &[TimedPose],
    later: f64,
    georeference: Option<&Georeference>,
    to: &mut impl Write,
) -> io::Result<()> {
    let Some(georeference) = georeference else {
        writeln!(to, "time_s,x,y,z,qx,qy,qz,qw")?;
        for (time, pose) in keys {
            let ([x, y, z], [qx, qy, qz, qw]) = (pose.position.to_array(), pose.orientation.to_array());
            writeln!(to, "{},{x},{y},{z},{qx},{qy},{qz},{qw}", time + later)?;
        }
        return Ok(());
    };
    writeln!(to, "time_s,easting,northing,height,roll_deg,pitch_deg,heading_deg")?;
    for (time, pose) in keys {
        let [x, y, z] = (pose.position + georeference.offset()).to_array();
        let [roll, pitch, heading] = navigation_angles(pose.orientation).map(f64::to_degrees);
        writeln!(to, "{},{x},{y},{z},{roll},{pitch},{}", time + later, heading.rem_euclid(360.0))?;
    }
    Ok(())
}
