//! Poses over time.

use super::{PlatformMotion, Pose};
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};
use ground::read::csv::{CsvReader, Lines};
use ground::shown;
use std::path::Path;

/// The path of a sensor: poses at rising times, linear in position and slerp in orientation between them; before the
/// first and after the last key the sensor stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    keys: Vec<(f64, Pose)>,
    /// See [`Trajectory::time_zero`].
    time_zero: f64,
}

impl Trajectory {
    /// A sensor fixed at `pose`, whose quaternion is normalised.
    pub fn fixed(pose: Pose) -> Self {
        Trajectory { keys: vec![(0.0, Pose { orientation: pose.orientation.normalize(), ..pose })], time_zero: 0.0 }
    }

    /// A sensor that passes through `keys`: (time in s, pose), times strictly rising. Quaternions are normalised.
    ///
    /// # Errors
    /// No key, times that do not rise, non-finite numbers, a quaternion of length 0.
    pub fn new(mut keys: Vec<(f64, Pose)>) -> Result<Self> {
        if keys.is_empty() {
            return Err(Error::invalid("trajectory", "empty", "at least one pose"));
        }
        let mut before = None;
        for (index, (time, pose)) in keys.iter_mut().enumerate() {
            *pose = check_key(before, *time, *pose).map_err(|message| {
                Error::invalid(format!("trajectory key {index}"), message, "rising times, finite poses")
            })?;
            before = Some(*time);
        }
        Ok(Trajectory { keys, time_zero: 0.0 })
    }

    /// Reads TUM text (`t x y z qx qy qz qw`, `#` comments) or CSV with a header: the time `time_s`, `t` or `time` in
    /// seconds, `x,y,z` in metres, and `qx,qy,qz,qw` or `roll_deg,pitch_deg,yaw_deg` ([`Pose::with_rpy_deg`]).
    ///
    /// Times stay as in the file, even when they count from 1970: see [`Trajectory::shifted_to_zero`].
    ///
    /// # Errors
    /// A missing file, or the line and what is wrong with it.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        Trajectory::read(Lines::open(path.as_ref())?)
    }

    /// [`Trajectory::load`] from the text of a file.
    ///
    /// # Errors
    /// The line and what is wrong with it.
    pub fn from_text(text: &str) -> Result<Self> {
        Trajectory::read(Lines::of("trajectory text", text.to_owned()))
    }

    fn read(mut lines: Lines) -> Result<Self> {
        if !lines.advance()? {
            return Err(
                lines.error_at_all("has no poses; expected TUM text (t x y z qx qy qz qw) or CSV with a header")
            );
        }
        let has_header = lines.text().starts_with(|c: char| c.is_alphabetic() || c == '"');
        if has_header && !lines.text().contains(',') {
            let expected = "expected CSV with a header, or TUM text (t x y z qx qy qz qw) without one";
            return Err(lines.error(format!("has a header without commas; {expected}")));
        }
        let keys = if has_header { read_csv(CsvReader::with_header(lines)?)? } else { read_tum(lines)? };
        Ok(Trajectory { keys, time_zero: 0.0 })
    }

    /// The same with the first key at time 0, as a scan that starts at time 0 needs it.
    #[must_use]
    pub fn shifted_to_zero(mut self) -> Self {
        let start = self.keys[0].0;
        for (time, _) in &mut self.keys {
            *time -= start;
        }
        self.time_zero += start;
        self
    }

    /// Clock time of its file at its time 0, s: what [`Trajectory::shifted_to_zero`] subtracted. Formats that store
    /// clock times, such as LAS, add it again.
    pub fn time_zero(&self) -> f64 {
        self.time_zero
    }

    /// The keys, times in s.
    pub fn into_keys(self) -> Vec<(f64, Pose)> {
        self.keys
    }

    /// The pose, if it never changes.
    pub fn constant(&self) -> Option<Pose> {
        let (_, first) = self.keys[0];
        self.keys.iter().all(|(_, pose)| *pose == first).then_some(first)
    }

    /// Times of the first and the last key, s.
    pub fn span(&self) -> (f64, f64) {
        (self.keys[0].0, self.keys[self.keys.len() - 1].0)
    }

    /// The uniform motion of the sensor at `time`, s; `None`: it stands still.
    pub(super) fn motion(&self, time: f64) -> Option<PlatformMotion> {
        let after = self.keys.partition_point(|(key, _)| *key <= time);
        let from = *self.keys.get(after.checked_sub(1)?)?;
        Some(PlatformMotion::new(from, *self.keys.get(after)?))
    }

    /// Velocity at `time`, s, in m/s.
    #[doc(hidden)]
    pub fn velocity(&self, time: f64) -> DVec3 {
        let after = self.keys.partition_point(|(key, _)| *key <= time);
        let ends = after.checked_sub(1).zip(self.keys.get(after));
        ends.map_or(DVec3::ZERO, |(before, (t1, b))| {
            let (t0, a) = self.keys[before];
            (b.position - a.position) / (t1 - t0)
        })
    }

    /// Angular velocity in the world at `time`, s, in rad/s.
    #[doc(hidden)]
    pub fn turning(&self, time: f64) -> DVec3 {
        let after = self.keys.partition_point(|(key, _)| *key <= time);
        let ends = after.checked_sub(1).zip(self.keys.get(after));
        ends.map_or(DVec3::ZERO, |(before, (t1, b))| {
            let (t0, a) = self.keys[before];
            let turn = a.orientation.conjugate() * b.orientation;
            // The shorter way.
            let turn = if turn.w < 0.0 { -turn } else { turn };
            a.orientation * turn.to_scaled_axis() / (t1 - t0)
        })
    }

    /// Pose at `time`, s.
    pub fn at(&self, time: f64) -> Pose {
        let after = self.keys.partition_point(|(key, _)| *key <= time);
        if after == 0 {
            return self.keys[0].1;
        }
        let (t0, a) = self.keys[after - 1];
        let Some(&(t1, b)) = self.keys.get(after) else { return a };
        let part = (time - t0) / (t1 - t0);
        Pose {
            position: a.position.lerp(b.position, part),
            // glam takes the shorter way.
            orientation: a.orientation.slerp(b.orientation, part).normalize(),
        }
    }
}

/// The pose with a unit quaternion, or what is wrong with a key after the one at time `before`.
fn check_key(before: Option<f64>, time: f64, pose: Pose) -> Result<Pose, String> {
    if !(time.is_finite() && pose.position.is_finite() && pose.orientation.is_finite()) {
        return Err("a number that is not finite".into());
    }
    if let Some(before) = before.filter(|before| *before >= time) {
        return Err(format!("time {time} s after {before} s: times must rise"));
    }
    let length = pose.orientation.length();
    if !(1e-6..1e6).contains(&length) {
        return Err(format!("a quaternion of length {length}: it must be near 1"));
    }
    Ok(Pose { orientation: pose.orientation.normalize(), ..pose })
}

fn read_tum(mut lines: Lines) -> Result<Vec<(f64, Pose)>> {
    let mut keys: Vec<(f64, Pose)> = Vec::new();
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
        let before = keys.last().map(|key| key.0);
        keys.push((time, check_key(before, time, pose).map_err(|message| lines.error(message))?));
        if !lines.advance()? {
            return Ok(keys);
        }
    }
}

fn read_csv(mut csv: CsvReader) -> Result<Vec<(f64, Pose)>> {
    let times = csv.optional(["time_s", "t", "time"]);
    let [x, y, z] = csv.required(["x", "y", "z"])?;
    let Some(time) = times.into_iter().flatten().next() else {
        return Err(csv.error("has no column of times; expected time_s, t or time".into()));
    };
    let angles = csv.optional(["roll_deg", "pitch_deg", "yaw_deg"]);
    let with_angles = angles.iter().any(Option::is_some);
    if !with_angles && csv.optional(["qx", "qy", "qz", "qw"]).iter().all(Option::is_none) {
        return Err(csv.error("has no orientation; expected qx,qy,qz,qw or roll_deg,pitch_deg,yaw_deg".into()));
    }
    let [roll, pitch, yaw] = if with_angles { csv.required(["roll_deg", "pitch_deg", "yaw_deg"])? } else { [0; 3] };
    let [qx, qy, qz, qw] = if with_angles { [0; 4] } else { csv.required(["qx", "qy", "qz", "qw"])? };
    let mut keys: Vec<(f64, Pose)> = Vec::new();
    while let Some(row) = csv.next_row()? {
        let (time, at) = (row[time], Pose::at(row[x], row[y], row[z]));
        let pose = if with_angles {
            at.with_rpy_deg(row[roll], row[pitch], row[yaw])
        } else {
            Pose { orientation: DQuat::from_xyzw(row[qx], row[qy], row[qz], row[qw]), ..at }
        };
        let before = keys.last().map(|key| key.0);
        keys.push((time, check_key(before, time, pose).map_err(|message| csv.error(message))?));
    }
    if keys.is_empty() {
        return Err(csv.error_at_all("has no poses below the header"));
    }
    Ok(keys)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn load(text: &str) -> Result<Trajectory> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        Trajectory::load(file.path())
    }

    fn message(text: &str) -> String {
        let text = load(text).unwrap_err().to_string();
        // Without the name of the temporary file.
        text.split_once(": ").unwrap().1.to_owned()
    }

    #[test]
    fn poses_between_keys_are_linear_and_turn_the_short_way() {
        let a = Pose::at(0.0, 0.0, 1.0).with_rpy_deg(0.0, 0.0, 170.0);
        let mut b = Pose::at(2.0, 4.0, 1.0).with_rpy_deg(0.0, 0.0, -170.0);
        // The same orientation, expressed by the opposite quaternion.
        b.orientation = -b.orientation;
        let path = Trajectory::new(vec![(1.0, a), (3.0, b)]).unwrap();
        let middle = path.at(1.5);
        assert!((middle.position - DVec3::new(0.5, 1.0, 1.0)).length() < 1e-12);
        let expected = Pose::IDENTITY.with_rpy_deg(0.0, 0.0, 175.0);
        assert!(middle.orientation.angle_between(expected.orientation) < 1e-7);
        assert_eq!(path.at(-1.0), a);
        assert_eq!(path.at(3.0).position, b.position);
        assert_eq!(path.at(1e9).position, b.position);
        assert_eq!(path.span(), (1.0, 3.0));
        assert_eq!(path.shifted_to_zero().span(), (0.0, 2.0));
    }

    #[test]
    fn a_path_is_constant_where_nothing_moves() {
        let pose = Pose::at(1.0, 2.0, 3.0);
        assert_eq!(Trajectory::fixed(pose).constant(), Some(pose));
        assert_eq!(Trajectory::new(vec![(0.0, pose), (1.0, pose)]).unwrap().constant(), Some(pose));
        assert_eq!(Trajectory::new(vec![(0.0, pose), (1.0, Pose::IDENTITY)]).unwrap().constant(), None);
    }

    #[test]
    fn tum_and_csv_say_the_same() {
        let tum = load("# a comment\n1305031098.5 1 2 3 0 0 0.6 0.8\n\n1305031099.5 2 2 3 0 0 0 1\n").unwrap();
        let csv =
            load("x,y,z,time_s,qx,qy,qz,qw,comment\n1,2,3,1305031098.5,0,0,0.6,0.8,0\r\n2,2,3,1305031099.5,0,0,0,1,0");
        assert_eq!(tum, csv.unwrap());
        assert_eq!(tum.span(), (1_305_031_098.5, 1_305_031_099.5));
        let angles = load("t,x,y,z,roll_deg,pitch_deg,yaw_deg\n0,1,2,3,10,20,30\n").unwrap();
        let expected = Pose::at(1.0, 2.0, 3.0).with_rpy_deg(10.0, 20.0, 30.0);
        assert!(angles.at(0.0).orientation.abs_diff_eq(expected.orientation, 1e-12));
    }

    #[test]
    fn errors_name_the_line() {
        assert_eq!(message("0 1 2 3 0 0 0 1\n1 1 2 3\n"), "line 2: has 4 numbers; expected 8: t x y z qx qy qz qw");
        assert_eq!(message("0 1 2 3 0 0 0 1\n\n0 1 2 3 0 0 0 1\n"), "line 3: time 0 s after 0 s: times must rise");
        assert_eq!(message("0 1 2 3 0 0 0 0\n"), "line 1: a quaternion of length 0: it must be near 1");
        assert_eq!(message("0 1 2 nan 0 0 0 1\n"), "line 1: a number that is not finite");
        assert_eq!(message("0,1,2,3,0,0,0,1\n"), "line 1: \"0,1,2,3,0,0,0,1\" is not a number");
        assert!(message("t x y z qx qy qz qw\n0 0 0 0 0 0 0 1\n").starts_with("line 1: has a header without commas"));
        assert!(message("t,x,y,z,roll,pitch,yaw\n").starts_with("line 1: has no orientation; expected qx,qy,qz,qw or"));
        assert!(message("x,y,z,qx,qy,qz,qw\n").starts_with("line 1: has no column of times"));
        assert!(message("t,x,y,z,yaw_deg\n").starts_with("line 1: the column roll_deg is missing"));
        assert_eq!(message("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,x\n"), "line 2: qw is \"x\"; expected a finite number");
        assert_eq!(message("t,x,y,z,qx,qy,qz,qw\n"), "has no poses below the header");
        assert!(message("").starts_with("has no poses"));
        assert!(Trajectory::new(vec![]).is_err());
        assert!(Trajectory::new(vec![(f64::NAN, Pose::IDENTITY)]).is_err());
    }
}
