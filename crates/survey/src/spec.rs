//! The section `plan` of a trajectory.

use glam::DVec2;
use ground::error::{Error, Result};
use ground::read::bounds::Bounds;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

/// What is surveyed, from where, and how. One of `area`, `polygon_m`, `course_m` and `stations_m` says where; in a scenario
/// without any of them it is all of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanSpec {
    /// A box that strips cover.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<AreaBox>,
    /// A polygon that strips cover, x and y of its corners, m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub polygon_m: Vec<[f64; 2]>,
    /// A line that one strip follows, x and y of its corners, m: a road, a river, a power line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub course_m: Vec<[f64; 2]>,
    /// Where a tripod stands, x and y, m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stations_m: Vec<[f64; 2]>,
    /// What carries the scanner.
    #[serde(default)]
    pub platform: CarrierKind,
    /// Height, m, above 0, up to 20000.
    pub height_m: f64,
    /// What the height is above.
    #[serde(default)]
    pub above: HeightAbove,
    /// Speed over ground, m/s, above 0, up to 300; 1 when not given for a tripod, which is carried from station to station.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_m_s: Option<f64>,
    /// Heading of the first strip, or of the scanner on a tripod, degrees clockwise from north, which is +y, -360 to 360;
    /// when not given, that which needs fewest strips, and 90 on a tripod.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading_deg: Option<f64>,
    /// Part of the swath that neighbouring strips share, 0 to 0.95; 0.3 when neither this nor a density is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlap: Option<f64>,
    /// Wanted mean density of pulses in the area, of all strips, 1/m^2, instead of an overlap.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density_per_m2: Option<f64>,
    /// Strips across the others.
    #[serde(default)]
    pub crossing: CrossLines,
    /// Greatest angle from straight down that counts as swath, degrees, 1 to 80; 60, or what the scanner has, if less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_angle_deg: Option<f64>,
    /// Greatest acceleration in turns, m/s^2, 0.1 to 20; when not given, 3.57 of `linear`, a bank of 20 degrees, 2.5 of a
    /// multicopter, 1.5 of a ground vehicle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acceleration_m_s2: Option<f64>,
    /// Standard deviation of a tripod's tilt about each of its level axes, degrees, 0 to 10.
    #[serde(default)]
    pub level_error_deg: f64,
}

/// A box along x and y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AreaBox {
    /// Least x and y, m.
    pub min_m: [f64; 2],
    /// Greatest x and y, m.
    pub max_m: [f64; 2],
}

/// What carries a scanner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CarrierKind {
    /// An aircraft: level and at constant speed on its lines, banked in turns.
    #[default]
    Linear,
    /// It starts and ends hovering, slows down in turns, and tilts as it accelerates.
    Multicopter,
    /// It stands on the ground, and pitches and rolls with it.
    GroundVehicle,
    /// It stands still while it scans.
    Tripod,
}

/// What a height is above.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HeightAbove {
    /// The ground along the strip, smoothed: terrain following.
    #[default]
    Ground,
    /// The mean of the ground below all strips, which are level.
    Flat,
    /// z = 0.
    Sea,
}

/// How many strips cross the others, at right angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CrossLines {
    /// None: `false`.
    #[default]
    None,
    /// As many as cover the area once more: `true`.
    All,
    /// This number, spread evenly.
    Count(u16),
}

impl Serialize for CrossLines {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            CrossLines::None => serializer.serialize_bool(false),
            CrossLines::All => serializer.serialize_bool(true),
            CrossLines::Count(count) => serializer.serialize_u16(*count),
        }
    }
}

impl<'de> Deserialize<'de> for CrossLines {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        match value {
            Value::Bool(false) => Ok(CrossLines::None),
            Value::Bool(true) => Ok(CrossLines::All),
            _ => {
                let count = value.as_u64().and_then(|count| u16::try_from(count).ok());
                let wrong = || D::Error::custom(format!("is {value}; allowed: true, false, or a number of strips"));
                count.map(CrossLines::Count).ok_or_else(wrong)
            }
        }
    }
}

/// Farthest from the origin, m: coordinates of maps.
const FARTHEST: f64 = 1e8;

/// Most corners and stations.
const MOST_PLACES: usize = 10_000;

impl PlanSpec {
    /// A plan with this height, over no place yet.
    pub fn new(height_m: f64) -> PlanSpec {
        PlanSpec {
            area: None,
            polygon_m: Vec::new(),
            course_m: Vec::new(),
            stations_m: Vec::new(),
            platform: CarrierKind::default(),
            height_m,
            above: HeightAbove::default(),
            speed_m_s: None,
            heading_deg: None,
            overlap: None,
            density_per_m2: None,
            crossing: CrossLines::default(),
            half_angle_deg: None,
            acceleration_m_s2: None,
            level_error_deg: 0.0,
        }
    }

    /// Checks all values; errors name keys from `key` on, that of the section.
    ///
    /// # Errors
    /// A value out of bounds; none or several places; keys that the platform has no use for.
    pub fn check(&self, key: &str) -> Result<()> {
        Bounds::none().section(key, |bounds| {
            bounds.number("height_m", self.height_m, [1e-3, 20_000.0], "above 0, up to 20000 m")?;
            bounds.number("speed_m_s", self.speed_m_s, [1e-3, 300.0], "above 0, up to 300 m/s")?;
            bounds.within("heading_deg", self.heading_deg, -360.0, 360.0)?;
            bounds.within("overlap", self.overlap, 0.0, 0.95)?;
            bounds.number("density_per_m2", self.density_per_m2, [1e-6, 1e6], "above 0, up to 1e6")?;
            bounds.within("half_angle_deg", self.half_angle_deg, 1.0, 80.0)?;
            bounds.within("acceleration_m_s2", self.acceleration_m_s2, 0.1, 20.0)?;
            bounds.within("level_error_deg", self.level_error_deg, 0.0, 10.0)?;
            self.check_places()?;
            let tripod = self.platform == CarrierKind::Tripod;
            if self.speed_m_s.is_none() && !tripod {
                return Err(Error::invalid("speed_m_s", "missing", "a speed over ground, m/s"));
            }
            if self.overlap.is_some() && self.density_per_m2.is_some() {
                return Err(Error::invalid("density_per_m2", "given beside overlap", "one of the two"));
            }
            if tripod == self.stations_m.is_empty() {
                let allowed = "stations_m with the platform tripod, and area, polygon_m or course_m with the others";
                return Err(Error::invalid("platform", "not one for this place", allowed));
            }
            Ok(())
        })
    }

    fn check_places(&self) -> Result<()> {
        let lists =
            [("polygon_m", &self.polygon_m, 3), ("course_m", &self.course_m, 2), ("stations_m", &self.stations_m, 1)];
        let given = lists.iter().filter(|(_, list, _)| !list.is_empty()).count() + usize::from(self.area.is_some());
        if given > 1 {
            let allowed = "one of area, polygon_m, course_m and stations_m";
            return Err(Error::invalid("area", "given beside another place", allowed));
        }
        let fits = |place: &[f64; 2]| place.iter().all(|value| value.abs() <= FARTHEST);
        let wrong = |key: String, place: &[f64; 2]| {
            Error::invalid(key, format!("{place:?}"), format!("x and y, each -{FARTHEST:e} to {FARTHEST:e}"))
        };
        for (name, list, least) in lists {
            if list.is_empty() {
                continue;
            }
            if !(least..=MOST_PLACES).contains(&list.len()) {
                let found = format!("a list of {}", list.len());
                return Err(Error::invalid(name, found, format!("{least} to {MOST_PLACES} places")));
            }
            if let Some(index) = list.iter().position(|place| !fits(place)) {
                return Err(wrong(format!("{name}[{index}]"), &list[index]));
            }
        }
        if let Some(AreaBox { min_m, max_m }) = &self.area {
            for (name, place) in [("area.min_m", min_m), ("area.max_m", max_m)] {
                if !fits(place) {
                    return Err(wrong(name.to_owned(), place));
                }
            }
            if !(min_m[0] < max_m[0] && min_m[1] < max_m[1]) {
                let allowed = format!("x and y above those of area.min_m, {min_m:?}");
                return Err(Error::invalid("area.max_m", format!("{max_m:?}"), allowed));
            }
        }
        if !self.polygon_m.is_empty() && signed_area(&self.corners()).abs() < 1e-6 {
            return Err(Error::invalid("polygon_m", "without area", "corners around an area"));
        }
        let same = |ends: &[[f64; 2]]| DVec2::from(ends[0]).distance(ends[1].into()) < 1e-6;
        if let Some(index) = self.course_m.windows(2).position(same) {
            return Err(Error::invalid(format!("course_m[{}]", index + 1), "the place before", "another place"));
        }
        Ok(())
    }

    /// Whether it does not say where.
    pub fn is_nowhere(&self) -> bool {
        let PlanSpec { area, polygon_m, course_m, stations_m, .. } = self;
        area.is_none() && polygon_m.is_empty() && course_m.is_empty() && stations_m.is_empty()
    }

    /// Corners of the area, m; empty: there is none.
    pub fn corners(&self) -> Vec<DVec2> {
        match &self.area {
            Some(AreaBox { min_m: [x0, y0], max_m: [x1, y1] }) => {
                [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| DVec2::new(*x, *y)).to_vec()
            }
            None => self.polygon_m.iter().map(|corner| DVec2::from(*corner)).collect(),
        }
    }
}

/// Area of a polygon, m^2, positive if its corners go round to the left.
pub(crate) fn signed_area(corners: &[DVec2]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let first = corners.first().copied().unwrap_or_default();
    0.5 * corners.iter().zip(next).map(|(a, b)| (*a - first).perp_dot(*b - first)).sum::<f64>()
}
