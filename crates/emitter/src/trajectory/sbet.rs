//! SBET, smoothed best estimate of trajectory: what post-processing of GNSS and inertial measurements gives.
//!
//! Records of 17 little-endian numbers in double precision, 136 bytes: time, s; latitude and longitude, rad; height above the
//! ellipsoid, m; velocity along x, y, z of the wander frame, m/s; roll, pitch, platform heading and wander angle, rad;
//! acceleration, m/s^2, and angular rate, rad/s, about the body's axes: ahead, to starboard, down. The true heading is the
//! platform heading less the wander angle (order and units as PDAL documents its reader of SBET).

use super::georeference::{Geographic, Georeference};
use super::key::{KeyReader, TimedPose, fault};
use echocast_memory::tried;
use glam::DVec3;
use ground::error::{Error, Result};
use ground::report::Report;
use std::io::{self, Read, Write};

/// Numbers of a record.
const NUMBERS: usize = 17;

/// Bytes of a record.
pub(super) const RECORD: usize = 8 * NUMBERS;

/// Seconds of a GPS week.
const WEEK_S: f64 = 604_800.0;

/// Longest pause after which a time that falls by a week is taken to go on in the next one, s.
const LONGEST_PAUSE_S: f64 = 43_200.0;

/// Reads `length` bytes of records from `from`, which is called `origin`.
pub(super) fn read(
    origin: &str,
    mut from: impl Read,
    length: u64,
    reader: &mut KeyReader,
    report: &mut Report,
) -> Result<()> {
    if length == 0 {
        return Err(fault(origin, "", "is empty; expected records of 136 bytes (SBET)"));
    }
    if !length.is_multiple_of(RECORD as u64) {
        let message = format!("has {length} bytes; expected a multiple of {RECORD}, the length of an SBET record");
        return Err(fault(origin, "", message));
    }
    let count = usize::try_from(length).unwrap_or(usize::MAX) / RECORD;
    tried(|| reader.keys.try_reserve_exact(count))
        .map_err(|_| Error::Memory(format!("the {count} poses of {origin}")))?;
    let mut later = 0.0;
    for number in 0..count {
        let mut bytes = [0; RECORD];
        from.read_exact(&mut bytes).map_err(|source| Error::io(origin, source))?;
        let mut values = [0.0; NUMBERS];
        for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(8)) {
            let mut number = [0; 8];
            number.copy_from_slice(bytes);
            *value = f64::from_le_bytes(number);
        }
        let at = || format!("record {}", number + 1);
        let [time, latitude, longitude, height, _, _, _, roll, pitch, platform_heading, wander, ..] = values;
        let place = Geographic { latitude, longitude, height, roll, pitch, heading: platform_heading - wander };
        if number == 0 {
            reader.prepare(&place, report).map_err(|error| fault(origin, at(), error.to_string()))?;
        }
        if let Some(last) = reader.last_time() {
            let next_week = time + later + WEEK_S;
            if time + later < last && next_week > last && next_week - last < LONGEST_PAUSE_S {
                later += WEEK_S;
                report.warn(format!(
                    "{origin}: {}: time goes back from {} s to {time} s, the start of the next GPS week: 604800 s are \
                     added from there on",
                    at(),
                    last - later + WEEK_S
                ));
            }
        }
        reader.add_place(time + later, &place).map_err(|message| fault(origin, at(), message))?;
    }
    Ok(())
}

/// Writes `keys` as records, their times `later`, s, with the wander angle 0, so that velocities are to the north, to the
/// east and down. Velocities, accelerations (of the motion, without gravity) and rates are those of the poses before and
/// after each.
pub(super) fn write(
    keys: &[TimedPose],
    later: f64,
    georeference: &Georeference,
    to: &mut impl Write,
) -> Result<io::Result<()>> {
    let projection = georeference.projection()?;
    for index in 0..keys.len() {
        let (time, pose) = keys[index];
        let (place, [convergence, scale]) = georeference.place(&projection, &pose);
        let KeyMotion { velocity, acceleration, rate } = KeyMotion::at(keys, index);
        // Ahead, to starboard, down.
        let body = |vector: DVec3| {
            let DVec3 { x, y, z } = pose.orientation.inverse() * vector;
            [x, -y, -z]
        };
        let (sin, cos) = convergence.sin_cos();
        let [east, north] = [velocity.x / scale, velocity.y / scale];
        let speeds = [north * cos - east * sin, east * cos + north * sin, -velocity.z];
        let head = [time + later, place.latitude, place.longitude, place.height];
        let angles = [place.roll, place.pitch, place.heading, 0.0];
        let all = head.into_iter().chain(speeds).chain(angles).chain(body(acceleration)).chain(body(rate));
        let mut record = [0; RECORD];
        for (bytes, value) in record.chunks_exact_mut(8).zip(all) {
            bytes.copy_from_slice(&value.to_le_bytes());
        }
        if let Err(error) = to.write_all(&record) {
            return Ok(Err(error));
        }
    }
    Ok(Ok(()))
}

/// How a trajectory moves at one of its keys, in the world: m/s, m/s^2, rad/s.
struct KeyMotion {
    velocity: DVec3,
    acceleration: DVec3,
    rate: DVec3,
}

impl KeyMotion {
    /// From the keys before and after; of the first and the last one, from their only neighbour, without acceleration.
    fn at(keys: &[TimedPose], index: usize) -> KeyMotion {
        let (before, after) = (&keys[index.saturating_sub(1)], &keys[(index + 1).min(keys.len() - 1)]);
        let duration = after.0 - before.0;
        if duration <= 0.0 {
            return KeyMotion { velocity: DVec3::ZERO, acceleration: DVec3::ZERO, rate: DVec3::ZERO };
        }
        let turn = before.1.orientation.conjugate() * after.1.orientation;
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let (time, pose) = keys[index];
        let [earlier, later] = [time - before.0, after.0 - time];
        let acceleration = if earlier > 0.0 && later > 0.0 {
            let [in_, out] =
                [(pose.position - before.1.position) / earlier, (after.1.position - pose.position) / later];
            2.0 * (out - in_) / duration
        } else {
            DVec3::ZERO
        };
        KeyMotion {
            velocity: (after.1.position - before.1.position) / duration,
            acceleration,
            rate: before.1.orientation * turn.to_scaled_axis() / duration,
        }
    }
}
