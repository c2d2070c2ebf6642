//! Surveys as files of a scenario.

use crate::assets::AssetFolders;
use crate::convert::Converted;
use crate::notes::{ImportNote, ImportOutcome, NoteBook};
use crate::survey::HeliosSurvey;
use crate::track::share_columns;
use crate::turning::rpy_deg;
use ground::error::{Error, Result};
use ground::read::yaml;
use ground::write;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A survey of HELIOS++ that has been read and converted.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Import {
    /// The survey as it was read.
    pub survey: HeliosSurvey,
    /// What it becomes.
    pub converted: Converted,
    /// What became of every element and attribute, in the order of the files.
    pub notes: Vec<ImportNote>,
}

impl Import {
    /// Reads the survey in the file `path`. Files that it names are looked for in its folder, then in the folders
    /// `assets`.
    ///
    /// # Errors
    /// A missing file; XML that is not well-formed or has a document type; names that lead out of the folders; numbers
    /// that are none; templates and references to what is not there; a survey in which nothing would be measured.
    pub fn load(path: impl AsRef<Path>, assets: &[PathBuf]) -> Result<Import> {
        let path = path.as_ref();
        let folders = AssetFolders::new(path, assets);
        let notes = NoteBook::default();
        let mut survey = HeliosSurvey::read(path, &folders, &notes)?;
        share_columns(survey.legs.iter_mut().filter_map(|leg| leg.track.as_mut()));
        let mut converted = Converted::of(&survey, &notes)?;
        make_absolute(&mut converted.scenario)?;
        Ok(Import { survey, converted, notes: notes.finish() })
    }

    /// Writes the scenario, `survey.yaml`, its sensors and trajectory, and `report.json`, what became of every element
    /// and attribute, to the new folder `folder`; returns the path of the scenario.
    ///
    /// # Errors
    /// A folder that is there already and not empty; what the system reports.
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<PathBuf> {
        let folder = folder.as_ref();
        let filled = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
        if filled {
            let source = io::Error::new(io::ErrorKind::AlreadyExists, "is there already; allowed: a new folder");
            return Err(Error::io(folder, source));
        }
        fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
        for (name, sensor) in &self.converted.sensors {
            write::whole(&folder.join(format!("{name}.yaml")), yaml::to_string(sensor)?.as_bytes())?;
        }
        write::whole(&folder.join("trajectory.csv"), self.trajectory_csv().as_bytes())?;
        let report =
            serde_json::to_string_pretty(&self.report()).map_err(|error| Error::Internal(error.to_string()))?;
        write::whole(&folder.join("report.json"), (report + "\n").as_bytes())?;
        // Sensors are called as in the survey, perhaps like this.
        let is_free = |name: &&str| self.converted.sensors.iter().all(|(sensor, _)| sensor != name);
        let name = ["survey", "scenario"].into_iter().find(is_free).unwrap_or("imported_survey");
        let scenario = folder.join(format!("{name}.yaml"));
        let title = format!(
            "# {}, a survey of HELIOS++; report.json says what became of its elements\n",
            shown_title(&self.survey.name)
        );
        write::whole(&scenario, (title + &yaml::to_string(&self.converted.scenario)?).as_bytes())?;
        Ok(scenario)
    }

    /// The trajectory as CSV.
    fn trajectory_csv(&self) -> String {
        let mut text = "t,x,y,z,roll_deg,pitch_deg,yaw_deg\n".to_owned();
        for (time, pose) in &self.converted.trajectory {
            let [x, y, z] = pose.position.to_array();
            let [roll, pitch, yaw] = rpy_deg(pose.orientation);
            // Writing to a text does not fail.
            let _ = writeln!(text, "{time},{x},{y},{z},{roll},{pitch},{yaw}");
        }
        text
    }

    /// How many elements and attributes are used, approximated and not understood.
    pub fn counts(&self) -> [usize; 3] {
        let count = |is: fn(&ImportOutcome) -> bool| self.notes.iter().filter(|note| is(&note.outcome)).count();
        [
            count(|outcome| *outcome == ImportOutcome::Used),
            count(|outcome| matches!(outcome, ImportOutcome::Approximated(_))),
            count(|outcome| matches!(outcome, ImportOutcome::NotUnderstood(_))),
        ]
    }

    /// The report: counts, and everything that has a note.
    pub fn report(&self) -> Value {
        let [used, approximated, not_understood] = self.counts();
        json!({
            "survey": self.survey.name, "used": used, "approximated": approximated, "not_understood": not_understood,
            "notes": self.notes,
        })
    }

    /// One line for everything that is approximated or not understood, alike ones together: where the first is, what, why.
    pub fn summary(&self) -> Vec<String> {
        let mut groups: BTreeMap<&ImportOutcome, (usize, &ImportNote)> = BTreeMap::new();
        for note in self.notes.iter().filter(|note| note.outcome != ImportOutcome::Used) {
            groups.entry(&note.outcome).or_insert((0, note)).0 += 1;
        }
        let mut lines = Vec::new();
        for (outcome, (count, first)) in groups {
            let (word, why) = match outcome {
                ImportOutcome::Approximated(how) => ("approximated", how),
                ImportOutcome::NotUnderstood(why) => ("not understood", why),
                ImportOutcome::Used => continue,
            };
            let attribute = first.attribute.as_ref().map_or_else(String::new, |name| format!(" {name}"));
            let others = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
            let file = first.file.file_name().unwrap_or_default().to_string_lossy();
            lines.push(format!("{file}: line {}: <{}{attribute}>{others} {word}: {why}", first.line, first.element));
        }
        lines
    }
}

/// `name` on one line.
fn shown_title(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { ' ' } else { c }).take(200).collect()
}

/// Makes the paths of models absolute: the scenario may be in any folder.
fn make_absolute(scenario: &mut Value) -> Result<()> {
    for model in scenario["scene"]["place"].as_array_mut().into_iter().flatten() {
        if let Some(path) = model["model"].as_str() {
            let absolute = fs::canonicalize(path).map_err(|source| Error::io(path, source))?;
            model["model"] = absolute.to_string_lossy().into();
        }
    }
    Ok(())
}
