//! Accuracy of a trajectory over time, as post-processing states it beside an SBET: the file `smrmsg`.
//!
//! Records of 10 little-endian numbers in double precision, 80 bytes: time, s; standard deviations of the position to the
//! north, to the east and down, m; of the velocity likewise, m/s; of roll, pitch and heading, minutes of arc (the layout as
//! users of POSPac give it; not compared with a document of its maker).

use super::key::fault;
use echocast_memory::tried;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use ground::write::{Pending, Sink, failed};
use std::io::{BufReader, BufWriter, Read as _, Write as _};
use std::path::Path;

/// Numbers of a record.
const NUMBERS: usize = 10;

/// Bytes of a record.
const RECORD: usize = 8 * NUMBERS;

/// Standard deviations at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Time, s, on the clock of the trajectory.
    pub time: f64,
    /// Of the position to the north, to the east and down, m.
    pub position_m: [f64; 3],
    /// Of the velocity to the north, to the east and down, m/s.
    pub velocity_m_s: [f64; 3],
    /// Of roll, pitch and heading, minutes of arc.
    pub attitude_arcmin: [f64; 3],
}

impl Accuracy {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// A file that cannot be read or does not consist of records; numbers that are not finite, negative deviations, times
    /// that do not rise.
    pub fn load(path: impl AsRef<Path>) -> Result<Vec<Accuracy>> {
        let path = path.as_ref();
        let file = read::open(path, Limit::TABLE)?;
        let (origin, length) = (shown::path(path), file.limit());
        if length == 0 || !length.is_multiple_of(RECORD as u64) {
            let message =
                format!("has {length} bytes; expected a multiple of {RECORD}, the length of a record of accuracy");
            return Err(fault(&origin, "", message));
        }
        let count = usize::try_from(length).unwrap_or(usize::MAX) / RECORD;
        let mut all: Vec<Accuracy> = Vec::new();
        tried(|| all.try_reserve_exact(count))
            .map_err(|_| Error::Memory(format!("the {count} records of {origin}")))?;
        let mut file = BufReader::with_capacity(1 << 18, file);
        for number in 1..=count {
            let mut values = [0.0; NUMBERS];
            for value in &mut values {
                let mut bytes = [0; 8];
                file.read_exact(&mut bytes).map_err(|source| Error::io(path, source))?;
                *value = f64::from_le_bytes(bytes);
            }
            let [time, north, east, down, v_north, v_east, v_down, roll, pitch, heading] = values;
            let is_sound =
                values.iter().all(|value| value.is_finite()) && values[1..].iter().all(|value| *value >= 0.0);
            if !is_sound {
                let message = "holds a number that is not finite or a negative deviation; allowed: 0 or more";
                return Err(fault(&origin, format!("record {number}"), message));
            }
            if let Some(last) = all.last().filter(|last| last.time >= time) {
                let message = format!("time {time} s after {} s: times must rise", last.time);
                return Err(fault(&origin, format!("record {number}"), message));
            }
            all.push(Accuracy {
                time,
                position_m: [north, east, down],
                velocity_m_s: [v_north, v_east, v_down],
                attitude_arcmin: [roll, pitch, heading],
            });
        }
        Ok(all)
    }

    /// Writes `records` as the file at `path`.
    ///
    /// # Errors
    /// The system's errors.
    pub fn save(records: &[Accuracy], path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let pending = Pending::create(path)?;
        let write = || {
            let mut to = BufWriter::with_capacity(1 << 18, Sink::create(pending.path())?);
            for Accuracy { time, position_m, velocity_m_s, attitude_arcmin } in records {
                for value in [*time].iter().chain(position_m).chain(velocity_m_s).chain(attitude_arcmin) {
                    to.write_all(&value.to_le_bytes())?;
                }
            }
            to.into_inner().map_err(std::io::IntoInnerError::into_error)?.finish()
        };
        write().map_err(|source| failed(path, source))?;
        pending.commit()
    }
}
