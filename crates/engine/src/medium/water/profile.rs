//! How water changes with depth: rows of a cast, in YAML or in a CSV file.

use ground::error::{Error, Result};
use ground::read::csv::CsvReader;
use ground::shown;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Most rows of a profile: those of a probe that measures every centimetre down to the deepest sea.
const MOST_ROWS: usize = 1_000_000;
/// Deepest row, m; the deepest trench is 11 km deep.
pub(super) const DEEPEST: f64 = 12_000.0;
/// Plausible speeds of sound in water, m/s.
pub(super) const PHYSICAL_SPEEDS: [f64; 2] = [1300.0, 1700.0];
/// Plausible densities of water and thin mud, kg/m^3.
const PHYSICAL_DENSITIES: [f64; 2] = [900.0, 1400.0];
/// Allowed speeds and densities in files with other units.
const UNPHYSICAL: [f64; 2] = [1e-6, 1e6];
/// Temperatures of water, degrees Celsius.
pub(super) const TEMPERATURES: [f64; 2] = [-4.0, 45.0];
/// Practical salinities for which formulas still hold.
pub(super) const SALINITIES: [f64; 2] = [0.0, 50.0];

/// How the speed of sound, or temperature and salinity, changes with depth, counted down from the surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum SoundSpeedProfile {
    /// Layers of one speed each, from their depth down to the next one's, the last without end. The water above the
    /// first is unknown.
    Layers(Vec<Layer>),
    /// A cast of speeds, linear in between.
    Cast(Vec<SpeedRow>),
    /// A cast of temperature and salinity, linear in between; the formula derives speeds from them.
    Ts(Vec<WaterRow>),
    /// The same speed everywhere.
    Constant {
        /// Speed of sound, m/s.
        speed_m_s: f64,
    },
    /// A cast in a CSV file with the header `depth_m,speed_m_s` or `depth_m,temperature_c,salinity_psu`, or layers in
    /// one with the header `depth_m,speed_m_s,density_kg_m3`; when the environment is read, the rows replace the name.
    File(PathBuf),
}

/// A layer of water.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// Depth of its top, m.
    pub depth_m: f64,
    /// Speed of sound, m/s.
    pub speed_m_s: f64,
    /// Density, kg/m^3; defaults to 1025.
    #[serde(default = "sea_water")]
    pub density_kg_m3: f64,
}

/// Speed of sound at a depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeedRow {
    /// Depth, m.
    pub depth_m: f64,
    /// Speed of sound, m/s.
    pub speed_m_s: f64,
}

/// Temperature and salinity at a depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaterRow {
    /// Depth, m.
    pub depth_m: f64,
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
    /// Practical salinity, PSU.
    pub salinity_psu: f64,
}

/// Density of sea water where none is given, kg/m^3.
pub(super) const SEA_WATER_KG_M3: f64 = 1025.0;

fn sea_water() -> f64 {
    SEA_WATER_KG_M3
}

/// A number that is not allowed: its key, the number, and what would be allowed.
struct CastFault(&'static str, f64, String);

/// A row of any of the tables.
trait ProfileRow {
    fn depth(&self) -> f64;
    fn fault(&self, allow_unphysical: bool) -> Option<CastFault>;
}

impl ProfileRow for Layer {
    fn depth(&self) -> f64 {
        self.depth_m
    }
    fn fault(&self, allow_unphysical: bool) -> Option<CastFault> {
        let density = || physical("density_kg_m3", self.density_kg_m3, PHYSICAL_DENSITIES, "kg/m^3", allow_unphysical);
        speed_fault(self.speed_m_s, allow_unphysical).or_else(density)
    }
}

impl ProfileRow for SpeedRow {
    fn depth(&self) -> f64 {
        self.depth_m
    }
    fn fault(&self, allow_unphysical: bool) -> Option<CastFault> {
        speed_fault(self.speed_m_s, allow_unphysical)
    }
}

impl ProfileRow for WaterRow {
    fn depth(&self) -> f64 {
        self.depth_m
    }
    fn fault(&self, _: bool) -> Option<CastFault> {
        within("temperature_c", self.temperature_c, TEMPERATURES)
            .or_else(|| within("salinity_psu", self.salinity_psu, SALINITIES))
    }
}

fn within(key: &'static str, value: f64, [least, most]: [f64; 2]) -> Option<CastFault> {
    (!(least..=most).contains(&value)).then(|| CastFault(key, value, format!("{least} to {most}")))
}

/// A speed in km/s, or an index of refraction, is a common mistake.
fn speed_fault(speed: f64, allow_unphysical: bool) -> Option<CastFault> {
    physical("speed_m_s", speed, PHYSICAL_SPEEDS, "m/s", allow_unphysical)
}

fn physical(
    key: &'static str,
    value: f64,
    [least, most]: [f64; 2],
    unit: &str,
    allow_unphysical: bool,
) -> Option<CastFault> {
    if allow_unphysical {
        return within(key, value, UNPHYSICAL);
    }
    let [tiny, huge] = UNPHYSICAL;
    let allowed = format!("{least} to {most}, in {unit}; with allow_unphysical: true {tiny} to {huge}");
    if (least..=most).contains(&value) { None } else { Some(CastFault(key, value, allowed)) }
}

/// Checks that a speed outside a table is plausible.
pub(super) fn check_speed(key: &str, speed: f64, allow_unphysical: bool) -> Result<()> {
    match speed_fault(speed, allow_unphysical) {
        None => Ok(()),
        Some(CastFault(_, value, allowed)) => Err(Error::invalid(key, value, allowed)),
    }
}

/// The fault of a row below one at the depth `above`, if any.
fn row_fault(row: &impl ProfileRow, above: Option<f64>, allow_unphysical: bool) -> Option<CastFault> {
    let depth = row.depth();
    match above {
        Some(above) if !(depth > above && depth <= DEEPEST) => {
            Some(CastFault("depth_m", depth, format!("above {above}, in rising order, to {DEEPEST}")))
        }
        None if !(0.0..=DEEPEST).contains(&depth) => Some(CastFault("depth_m", depth, format!("0 to {DEEPEST}"))),
        _ => row.fault(allow_unphysical),
    }
}

fn check_rows(key: &str, rows: &[impl ProfileRow], least: usize, allow_unphysical: bool) -> Result<()> {
    let count = rows.len();
    if !(least..=MOST_ROWS).contains(&count) {
        return Err(Error::invalid(key, format!("a list of {count}"), format!("{least} to {MOST_ROWS} rows")));
    }
    let mut above = None;
    for (index, row) in rows.iter().enumerate() {
        if let Some(CastFault(name, value, allowed)) = row_fault(row, above, allow_unphysical) {
            return Err(Error::invalid(format!("{key}[{index}].{name}"), value, allowed));
        }
        above = Some(row.depth());
    }
    Ok(())
}

impl SoundSpeedProfile {
    /// Checks that all values are within their allowed ranges; errors name keys below `key`.
    pub(super) fn check(&self, key: &str, allow_unphysical: bool) -> Result<()> {
        match self {
            SoundSpeedProfile::Layers(rows) => check_rows(&format!("{key}.layers"), rows, 1, allow_unphysical),
            // A single row would cover no depth.
            SoundSpeedProfile::Cast(rows) => check_rows(&format!("{key}.cast"), rows, 2, allow_unphysical),
            SoundSpeedProfile::Ts(rows) => check_rows(&format!("{key}.ts"), rows, 2, allow_unphysical),
            SoundSpeedProfile::Constant { speed_m_s } => {
                check_speed(&format!("{key}.constant.speed_m_s"), *speed_m_s, allow_unphysical)
            }
            SoundSpeedProfile::File(file) => Err(unread(key, file)),
        }
    }

    /// Reads the file that it may name; a relative name is resolved against `folder`.
    pub(super) fn read_file(&mut self, folder: &Path, allow_unphysical: bool) -> Result<()> {
        if let SoundSpeedProfile::File(file) = self {
            *self = read(&folder.join(file), allow_unphysical)?;
        }
        Ok(())
    }
}

/// The error for a `file` whose rows have not been read.
pub(super) fn unread(key: &str, file: &Path) -> Error {
    let allowed = "a file whose rows are known, as after Environment::load or Environment::from_yaml";
    Error::invalid(format!("{key}.file"), shown::path(file), allowed)
}

fn read(path: &Path, allow_unphysical: bool) -> Result<SoundSpeedProfile> {
    let csv = CsvReader::open(path)?;
    if csv.optional(["density_kg_m3"])[0].is_some() {
        let names = ["depth_m", "speed_m_s", "density_kg_m3"];
        csv.only(&names)?;
        let [depth, speed, density] = csv.required(names)?;
        let row = |row: &[f64]| Layer { depth_m: row[depth], speed_m_s: row[speed], density_kg_m3: row[density] };
        return Ok(SoundSpeedProfile::Layers(read_rows(path, csv, 1, allow_unphysical, row)?));
    }
    if csv.optional(["speed_m_s"])[0].is_some() {
        csv.only(&["depth_m", "speed_m_s"])?;
        let [depth, speed] = csv.required(["depth_m", "speed_m_s"])?;
        let row = |row: &[f64]| SpeedRow { depth_m: row[depth], speed_m_s: row[speed] };
        return Ok(SoundSpeedProfile::Cast(read_rows(path, csv, 2, allow_unphysical, row)?));
    }
    let names = ["depth_m", "temperature_c", "salinity_psu"];
    if csv.optional(names).iter().all(Option::is_none) {
        let expected = "depth_m,speed_m_s or depth_m,temperature_c,salinity_psu or depth_m,speed_m_s,density_kg_m3";
        return Err(csv.error(format!("has none of the columns of a profile; expected the header {expected}")));
    }
    let [depth, temperature, salinity] = csv.required(names)?;
    csv.only(&names)?;
    let row =
        |row: &[f64]| WaterRow { depth_m: row[depth], temperature_c: row[temperature], salinity_psu: row[salinity] };
    Ok(SoundSpeedProfile::Ts(read_rows(path, csv, 2, allow_unphysical, row)?))
}

fn read_rows<R: ProfileRow>(
    path: &Path,
    mut csv: CsvReader,
    least: usize,
    allow_unphysical: bool,
    to_row: impl Fn(&[f64]) -> R,
) -> Result<Vec<R>> {
    let mut rows: Vec<R> = Vec::new();
    while let Some(numbers) = csv.next_row()? {
        let row = to_row(numbers);
        if rows.len() == MOST_ROWS {
            return Err(csv.error(format!("is row {}; allowed: {least} to {MOST_ROWS} rows", MOST_ROWS + 1)));
        }
        if let Some(CastFault(name, value, allowed)) =
            row_fault(&row, rows.last().map(ProfileRow::depth), allow_unphysical)
        {
            return Err(csv.error(format!("{name} is {value}; allowed: {allowed}")));
        }
        rows.push(row);
    }
    if rows.len() < least {
        return Err(Error::parse(path, "", format!("has {} rows; allowed: {least} to {MOST_ROWS}", rows.len())));
    }
    Ok(rows)
}
