//! Poses over time.

mod accuracy;
mod georeference;
mod key;
mod sbet;
mod text;

pub use accuracy::Accuracy;
pub(crate) use georeference::navigated;
pub use georeference::{Geographic, Georeference};
pub use key::TrajectoryOptions;

use super::{PlatformMotion, Pose};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::pose::on;
use ground::read::csv::Lines;
use ground::read::{self, Limit};
use ground::report::Report;
use ground::shown;
use ground::write::{Pending, Sink, failed};
use key::{KeyReader, check_key};
use std::io::{BufReader, BufWriter, Read as _};
use std::path::Path;

/// The path of a sensor: poses at rising times, linear in position and slerp in orientation between them; before the
/// first and after the last key the sensor stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    keys: Vec<(f64, Pose)>,
    /// See [`Trajectory::time_zero`].
    time_zero: f64,
    /// See [`Trajectory::georeference`].
    georeference: Option<Georeference>,
    /// See [`Trajectory::gps_week`].
    gps_week: Option<u16>,
}

impl Trajectory {
    /// A sensor fixed at `pose`, whose quaternion is normalised.
    pub fn fixed(pose: Pose) -> Self {
        let key = (0.0, Pose { orientation: pose.orientation.normalize(), ..pose });
        Trajectory { keys: vec![key], time_zero: 0.0, georeference: None, gps_week: None }
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
        Ok(Trajectory { keys, time_zero: 0.0, georeference: None, gps_week: None })
    }

    /// Reads the file at `path` as [`Trajectory::load_with`] does with its defaults, without its warnings.
    ///
    /// # Errors
    /// As [`Trajectory::load_with`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        Trajectory::load_with(path, &TrajectoryOptions::default(), &mut Report::default())
    }

    /// Reads a trajectory:
    ///
    /// * TUM text: `t x y z qx qy qz qw`, `#` comments.
    /// * CSV with a header: the time `time_s`, `t`, `time` or `gps_time` in seconds; `x,y,z` or `easting,northing,height`
    ///   in metres, or `lat,lon` in degrees and `height` in metres; `qx,qy,qz,qw`, `roll_deg,pitch_deg,yaw_deg`
    ///   ([`Pose::with_rpy_deg`]), or `roll_deg,pitch_deg,heading_deg`: starboard down, nose up, clockwise from north, that of
    ///   the grid beside eastings and true north beside latitudes.
    /// * SBET, in files that end in `.sbet` or `.out`, or that are not text.
    /// * HELIOS++, in files that end in `.trj`.
    ///
    /// Latitudes and longitudes become eastings and northings in the coordinate system of `options`, and headings relative
    /// to its grid; `report` says which system was taken if none is given. Times stay as in the file, even when they count
    /// from 1970: see [`Trajectory::shifted_to_zero`]; those of an SBET that pass the end of a GPS week go on counting, which
    /// `report` says.
    ///
    /// # Errors
    /// A missing file, or the line or record and what is wrong with it: times that do not rise, numbers that are not finite,
    /// an SBET whose length is no multiple of 136 bytes, places beyond the projection; a coordinate system without a known
    /// projection for latitudes and longitudes.
    pub fn load_with(path: impl AsRef<Path>, options: &TrajectoryOptions, report: &mut Report) -> Result<Self> {
        let path = path.as_ref();
        let mut reader = KeyReader::new(options)?;
        match read::ending(path).as_str() {
            "trj" => {
                let bytes = read::bytes(path, Limit::TABLE)?;
                let text = String::from_utf8(bytes).map_err(|_| Error::parse(path, "", "is not UTF-8 text"))?;
                text::read_helios(&shown::path(path), text, &mut reader)?;
            }
            ending => {
                let mut file = read::open(path, Limit::TABLE)?;
                let length = file.limit();
                let mut begin = Vec::new();
                file.by_ref().take(sbet::RECORD as u64).read_to_end(&mut begin).map_err(|e| Error::io(path, e))?;
                if SBET_ENDINGS.contains(&ending) || is_binary(&begin) {
                    let rest = BufReader::with_capacity(1 << 18, file);
                    sbet::read(&shown::path(path), begin.as_slice().chain(rest), length, &mut reader, report)?;
                } else {
                    text::read(Lines::open(path)?, &mut reader, report)?;
                }
            }
        }
        Ok(Trajectory::of(reader, options))
    }

    /// [`Trajectory::load_with`] from the text of a file: TUM or CSV.
    ///
    /// # Errors
    /// The line and what is wrong with it.
    pub fn from_text_with(text: &str, options: &TrajectoryOptions, report: &mut Report) -> Result<Self> {
        let mut reader = KeyReader::new(options)?;
        text::read(Lines::of("trajectory text", text.to_owned()), &mut reader, report)?;
        Ok(Trajectory::of(reader, options))
    }

    /// [`Trajectory::load`] from the text of a file.
    ///
    /// # Errors
    /// The line and what is wrong with it.
    pub fn from_text(text: &str) -> Result<Self> {
        Trajectory::from_text_with(text, &TrajectoryOptions::default(), &mut Report::default())
    }

    fn of(reader: KeyReader, options: &TrajectoryOptions) -> Trajectory {
        let (keys, georeference) = reader.finish();
        Trajectory { keys, time_zero: 0.0, georeference, gps_week: options.gps_week }
    }

    /// Writes it as the file at `path`, whose ending selects the format: `.sbet` or `.out` for SBET, `.csv`, or `.txt` for
    /// TUM text; times are those of its clock ([`Trajectory::time_zero`]). CSV has eastings, northings and headings if the
    /// trajectory is georeferenced, otherwise the coordinates of the world and quaternions, as TUM text has.
    ///
    /// # Errors
    /// Another ending; an SBET of a trajectory without a georeference, or with one that has no projection; the system's
    /// errors.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let ending = read::ending(path);
        let georeference = self.georeference.as_ref();
        let of_sbet = SBET_ENDINGS.contains(&ending.as_str());
        if of_sbet && georeference.is_none() {
            let allowed = "one with a coordinate system (crs), from which an SBET has its latitudes and longitudes";
            return Err(Error::invalid("trajectory", "one of the world's coordinates", allowed));
        }
        if !of_sbet && !["csv", "txt"].contains(&ending.as_str()) {
            let name = path.file_name().map(|name| shown::path(Path::new(name))).unwrap_or_default();
            return Err(Error::invalid(
                "trajectory file",
                format!("{name:?}"),
                "a name ending in .sbet, .out, .csv or .txt",
            ));
        }
        let pending = Pending::create(path)?;
        let fault = |source| failed(path, source);
        let mut to = BufWriter::with_capacity(1 << 18, Sink::create(pending.path()).map_err(fault)?);
        let written = match georeference.filter(|_| of_sbet) {
            Some(georeference) => sbet::write(&self.keys, self.time_zero, georeference, &mut to)?,
            None if ending == "csv" => text::write_csv(&self.keys, self.time_zero, georeference, &mut to),
            None => text::write_tum(&self.keys, self.time_zero, &mut to),
        };
        written.map_err(fault)?;
        let file = to.into_inner().map_err(std::io::IntoInnerError::into_error).map_err(fault)?;
        file.finish().map_err(fault)?;
        pending.commit()
    }

    /// The same in a world that lies on the Earth, and with a clock, as `options` say; its poses and times stay as they are.
    ///
    /// # Errors
    /// As [`Georeference::new`].
    pub fn on_earth(self, options: &TrajectoryOptions) -> Result<Self> {
        Ok(Trajectory { georeference: options.georeference()?, gps_week: options.gps_week, ..self })
    }

    /// How the world lies on the Earth, if the trajectory was read with a coordinate system or from latitudes and longitudes.
    pub fn georeference(&self) -> Option<&Georeference> {
        self.georeference.as_ref()
    }

    /// The GPS week from whose start its clock counts, if that is known: formats of surveys then store standard GPS time.
    pub fn gps_week(&self) -> Option<u16> {
        self.gps_week
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
    pub fn keys(&self) -> &[(f64, Pose)] {
        &self.keys
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

    /// The same clock and georeference as `other`.
    pub(super) fn alongside(self, other: &Trajectory) -> Trajectory {
        Trajectory {
            time_zero: other.time_zero,
            georeference: other.georeference.clone(),
            gps_week: other.gps_week,
            ..self
        }
    }

    /// The trajectory of what is mounted at `mount` on this carrier: poses are added where the carrier turns, so that the
    /// straight line from one to the next is less than a tenth of a millimetre from the arc.
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn mounted(&self, mount: &Pose) -> Result<Trajectory> {
        const TOLERANCE_M: f64 = 1e-4;
        /// Maximum number of poses added between two.
        const MOST: f64 = 1000.0;
        if *mount == Pose::IDENTITY {
            return Ok(self.clone());
        }
        let mut all = Vec::with_capacity(self.keys.len());
        for ends in self.keys.windows(2) {
            let [(from, a), (to, b)] = [ends[0], ends[1]];
            // Height above its chord of the arc that a lever arm of this length describes.
            let angle = a.orientation.angle_between(b.orientation);
            let parts = (angle * (mount.position.length() / (8.0 * TOLERANCE_M)).sqrt()).ceil().clamp(1.0, MOST);
            for part in 0..parts as u32 {
                let time = from + (to - from) * f64::from(part) / parts;
                all.push((time, on(&self.at(time), mount)));
            }
        }
        all.extend(self.keys.last().map(|(time, pose)| (*time, on(pose, mount))));
        all.dedup_by(|later, before| later.0 <= before.0);
        Ok(Trajectory::new(all)?.alongside(self))
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

/// Endings of files of SBET; POSPac calls them `sbet_name.out`.
const SBET_ENDINGS: [&str; 2] = ["sbet", "out"];

/// Whether a file that begins with these bytes is not text.
fn is_binary(begin: &[u8]) -> bool {
    begin.iter().any(|&byte| byte < b' ' && !byte.is_ascii_whitespace())
}

#[cfg(test)]
mod format_tests;

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
