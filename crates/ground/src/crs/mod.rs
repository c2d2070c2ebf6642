//! Coordinate reference systems: by EPSG code or name, and as well-known text.

mod mercator;
mod wkt;

pub use mercator::{GridPoint, TransverseMercator};

use crate::error::{Error, Result};
use crate::read::{self, Limit};
use crate::shown;
use std::fmt::Write as _;
use std::path::Path;
use wkt::WktEntry;

/// Endings of files with well-known text.
const ENDINGS: [&str; 2] = ["prj", "wkt"];

/// Longest text of a coordinate system, bytes: as long as a variable-length record of LAS may be.
const LONGEST: usize = 65_534;

/// A coordinate reference system: what positions of the world are measured in.
#[derive(Clone, Debug, PartialEq)]
pub struct Crs {
    plane: Plane,
    /// What heights count from; `None`: the ellipsoid.
    heights: Option<&'static HeightSystem>,
}

/// The horizontal part.
#[derive(Clone, Debug, PartialEq)]
enum Plane {
    Utm(UtmZone),
    /// Without a place on the Earth.
    Local,
    /// As somebody else has written it, with its projection if it is one that is known here.
    Text {
        text: String,
        projection: Option<TransverseMercator>,
    },
}

/// A zone of the Universal Transverse Mercator grid.
#[derive(Clone, Copy, Debug, PartialEq)]
struct UtmZone {
    datum: &'static GeodeticDatum,
    /// 1 to 60, eastwards from the antimeridian.
    number: u32,
    south: bool,
}

/// A datum and the codes of its zones, as the EPSG dataset (v11) lists them.
#[derive(Debug, PartialEq)]
struct GeodeticDatum {
    /// Name and EPSG code of its geographic coordinate system.
    name: &'static str,
    code: u32,
    /// How names of systems begin, without spaces and signs.
    prefixes: &'static [&'static str],
    /// Name and EPSG code of the datum, and of its ellipsoid.
    datum: (&'static str, u32),
    ellipsoid: (&'static str, u32),
    inverse_flattening: f64,
    /// First and last zone of the northern hemisphere, and the EPSG code of zone 1, if there were one.
    north: [u32; 2],
    first_north: u32,
    /// Likewise of zone 1 of the southern one.
    first_south: Option<u32>,
}

const DATUMS: [GeodeticDatum; 4] = [
    GeodeticDatum {
        name: "WGS 84",
        code: 4326,
        prefixes: &["WGS84", "WGS1984", ""],
        datum: ("WGS_1984", 6326),
        ellipsoid: ("WGS 84", 7030),
        inverse_flattening: 298.257_223_563,
        north: [1, 60],
        first_north: 32_601,
        first_south: Some(32_701),
    },
    GeodeticDatum {
        name: "ETRS89",
        code: 4258,
        prefixes: &["ETRS89", "ETRS1989"],
        datum: ("European_Terrestrial_Reference_System_1989", 6258),
        ellipsoid: GRS_80,
        inverse_flattening: 298.257_222_101,
        north: [28, 38],
        first_north: 25_801,
        first_south: None,
    },
    GeodeticDatum {
        name: "NAD83",
        code: 4269,
        prefixes: &["NAD83", "NAD1983"],
        datum: ("North_American_Datum_1983", 6269),
        ellipsoid: GRS_80,
        inverse_flattening: 298.257_222_101,
        north: [1, 23],
        first_north: 26_901,
        first_south: None,
    },
    GeodeticDatum {
        name: "NAD83(2011)",
        code: 6318,
        prefixes: &["NAD83(2011)", "NAD19832011"],
        datum: ("NAD83_National_Spatial_Reference_System_2011", 1116),
        ellipsoid: GRS_80,
        inverse_flattening: 298.257_222_101,
        north: [1, 19],
        first_north: 6330,
        first_south: None,
    },
];

const GRS_80: (&str, u32) = ("GRS 1980", 7019);

/// Codes of zones 59 and 60 of NAD83(2011), which do not follow the others.
const NAD83_2011_WEST: [u32; 2] = [6328, 6329];

/// A system of heights above a geoid or a level, by name and code, with those of its datum (EPSG dataset).
#[derive(Debug, PartialEq)]
struct HeightSystem {
    name: &'static str,
    code: u32,
    datum: (&'static str, u32),
}

const HEIGHTS: [HeightSystem; 11] = [
    HeightSystem { name: "EGM2008 height", code: 3855, datum: ("EGM2008 geoid", 1027) },
    HeightSystem { name: "EGM96 height", code: 5773, datum: ("EGM96 geoid", 5171) },
    HeightSystem { name: "EVRF2007 height", code: 5621, datum: ("European Vertical Reference Frame 2007", 5215) },
    HeightSystem { name: "EVRF2019 height", code: 9389, datum: ("European Vertical Reference Frame 2019", 1274) },
    HeightSystem { name: "NAVD88 height", code: 5703, datum: ("North American Vertical Datum 1988", 5103) },
    HeightSystem { name: "DHHN2016 height", code: 7837, datum: ("Deutsches Haupthoehennetz 2016", 1170) },
    HeightSystem { name: "DHHN92 height", code: 5783, datum: ("Deutsches Haupthoehennetz 1992", 5181) },
    HeightSystem { name: "NAP height", code: 5709, datum: ("Normaal Amsterdams Peil", 5109) },
    HeightSystem { name: "NGF-IGN69 height", code: 5720, datum: ("Nivellement General de la France - IGN69", 5119) },
    HeightSystem { name: "LN02 height", code: 5728, datum: ("Landesnivellement 1902", 5127) },
    HeightSystem { name: "ODN height", code: 5701, datum: ("Ordnance Datum Newlyn", 5101) },
];

/// What [`Crs::parse`] accepts, for errors.
const ALLOWED: &str = "EPSG:25832 and the like (UTM zones of WGS 84, ETRS89, NAD83, NAD83(2011); heights as \
                       EPSG:25832+7837), their names, local, or well-known text";

impl Crs {
    /// The system that `text` names: `EPSG:25832` (UTM zones of WGS 84, 326xx and 327xx, ETRS89, 258xx, NAD83, 269xx, and
    /// NAD83(2011), 6328 to 6348), their names (`ETRS89 / UTM zone 32N`, `UTM 32N` for WGS 84), either with heights after
    /// a `+` (`EPSG:25832+7837`, `UTM 32N + EGM2008 height`), `local` for one without a place on the Earth; or well-known
    /// text of version 1, which is kept as it is.
    ///
    /// # Errors
    /// An unknown code or name; well-known text with mistakes or of another version.
    pub fn parse(text: &str) -> Result<Crs> {
        let text = text.trim().trim_end_matches('\0').trim_end();
        if text.contains(['[', '(']) && !text.to_ascii_uppercase().starts_with("NAD") {
            return Crs::from_wkt(text);
        }
        let unknown = || Error::invalid("crs", format!("{:?}", shown::name(text)), ALLOWED);
        let (plane, heights) = match text.split_once('+') {
            Some((plane, heights)) => (plane, Some(heights)),
            None => (text, None),
        };
        let plane = Plane::named(plane).ok_or_else(unknown)?;
        let heights = match heights.map(plain) {
            None => None,
            Some(name) if name == "ELLIPSOIDALHEIGHT" && plane != Plane::Local => None,
            Some(name) => {
                let of = |known: &&HeightSystem| {
                    code_of(&name) == Some(known.code) || [plain(known.name), short(known.name)].contains(&name)
                };
                let known = HEIGHTS.iter().find(of).filter(|_| plane != Plane::Local);
                Some(known.ok_or_else(|| {
                    let names = HEIGHTS.each_ref().map(|known| format!("{} ({})", short(known.name), known.code));
                    let found = format!("{:?} with heights {:?}", shown::name(text), shown::name(&name));
                    Error::invalid("crs", found, format!("a UTM zone with {}", names.join(", ")))
                })?)
            }
        };
        Ok(Crs { plane, heights })
    }

    /// [`Crs::parse`], or what the file `text` holds if it is the name of one that ends in `.prj` or `.wkt`.
    ///
    /// # Errors
    /// As [`Crs::parse`]; a file that cannot be read, or that is not UTF-8 text.
    pub fn open(text: &str) -> Result<Crs> {
        Crs::open_in(Path::new(""), text)
    }

    /// The system whose well-known text is in the file at `path`.
    fn load(path: &Path) -> Result<Crs> {
        let bytes = read::bytes(path, Limit::YAML)?;
        let content = str::from_utf8(&bytes).map_err(|_| Error::parse(path, "", "is not UTF-8 text"))?;
        Crs::from_wkt(content.trim_start_matches('\u{feff}').trim()).map_err(|error| match error {
            Error::Parse { place, message, .. } => Error::parse(path, place, message),
            other => other,
        })
    }

    /// [`Crs::open`] with names of files relative to `folder`.
    ///
    /// # Errors
    /// As [`Crs::open`].
    pub fn open_in(folder: &Path, text: &str) -> Result<Crs> {
        let path = Path::new(text.trim());
        if ENDINGS.contains(&read::ending(path).as_str()) { Crs::load(&folder.join(path)) } else { Crs::parse(text) }
    }

    /// The UTM zone of WGS 84 at a latitude and longitude, rad: six degrees wide everywhere, without the wider zones that
    /// maps of Norway and Svalbard use.
    ///
    /// # Errors
    /// A latitude beyond 84 degrees north or 80 degrees south, where UTM ends.
    pub fn utm_at(latitude: f64, longitude: f64) -> Result<Crs> {
        let (latitude, longitude) = (latitude.to_degrees(), longitude.to_degrees());
        if !(-80.0..=84.0).contains(&latitude) || !longitude.is_finite() {
            return Err(Error::invalid("latitude", format!("{latitude} degrees"), "-80 to 84 degrees, as UTM has"));
        }
        let number = 1 + (((longitude + 180.0).rem_euclid(360.0) / 6.0) as u32).min(59);
        let zone = UtmZone { datum: &DATUMS[0], number, south: latitude < 0.0 };
        Ok(Crs { plane: Plane::Utm(zone), heights: None })
    }

    fn from_wkt(text: &str) -> Result<Crs> {
        if text.len() > LONGEST {
            return Err(Error::invalid(
                "crs",
                format!("{} bytes long", text.len()),
                format!("{LONGEST} bytes at most"),
            ));
        }
        let entry = WktEntry::parse(text)?;
        match entry.keyword.as_str() {
            "PROJCS" | "GEOGCS" | "GEOCCS" | "COMPD_CS" | "LOCAL_CS" => {}
            "PROJCRS" | "PROJECTEDCRS" | "GEOGCRS" | "GEODCRS" | "COMPOUNDCRS" | "ENGCRS" | "BOUNDCRS" => {
                let allowed = "version 1, as LAS 1.4 has it (with gdalsrsinfo: -o wkt1)";
                return Err(Error::invalid("crs", "well-known text of version 2", allowed));
            }
            other => return Err(Error::invalid("crs", format!("{:?}", shown::name(other)), ALLOWED)),
        }
        Ok(Crs { plane: Plane::Text { text: text.to_owned(), projection: projection_of(&entry) }, heights: None })
    }

    /// Its well-known text, version 1 (OGC 01-009), as LAS 1.4 has it in its record 2112.
    pub fn wkt(&self) -> String {
        let plane = match &self.plane {
            Plane::Utm(zone) => zone.wkt(),
            Plane::Local => concat!(
                r#"LOCAL_CS["local",LOCAL_DATUM["local",32767],UNIT["metre",1,AUTHORITY["EPSG","9001"]],"#,
                r#"AXIS["Easting",EAST],AXIS["Northing",NORTH],AXIS["Height",UP]]"#
            )
            .to_owned(),
            Plane::Text { text, .. } => text.clone(),
        };
        let Some(HeightSystem { name, code, datum: (datum, datum_code) }) = self.heights else { return plane };
        // 2005: heights above a geoid.
        format!(
            r#"COMPD_CS["{}",{plane},VERT_CS["{name}",VERT_DATUM["{datum}",2005,AUTHORITY["EPSG","{datum_code}"]],{METRE},AXIS["Gravity-related height",UP],AUTHORITY["EPSG","{code}"]]]"#,
            self.name()
        )
    }

    /// Its name for people: `ETRS89 / UTM zone 32N`.
    pub fn name(&self) -> String {
        let mut name = match &self.plane {
            Plane::Utm(zone) => zone.name(),
            Plane::Local => "local".to_owned(),
            Plane::Text { text, .. } => WktEntry::parse(text).map(|entry| entry.name).unwrap_or_default(),
        };
        if let Some(heights) = self.heights {
            let _ = write!(name, " + {}", heights.name);
        }
        name
    }

    /// Its EPSG code, as [`Crs::parse`] takes it; none for a local system and for well-known text.
    pub fn code(&self) -> Option<String> {
        let Plane::Utm(zone) = &self.plane else { return None };
        let heights = self.heights.map_or(String::new(), |heights| format!("+{}", heights.code));
        Some(format!("EPSG:{}{heights}", zone.code()))
    }

    /// Its projection between geographic coordinates and its own: of UTM zones, and of well-known text with a transverse
    /// Mercator projection of GRS 80 or WGS 84 in metres. The datum is that of the geographic coordinates: no shift between
    /// WGS 84, ETRS89 and NAD83 is made.
    pub fn projection(&self) -> Option<TransverseMercator> {
        match &self.plane {
            Plane::Utm(zone) => Some(zone.projection()),
            Plane::Local => None,
            Plane::Text { projection, .. } => *projection,
        }
    }
}

/// The unit of all systems.
const METRE: &str = r#"UNIT["metre",1,AUTHORITY["EPSG","9001"]]"#;

impl Plane {
    /// That of a code or name.
    fn named(name: &str) -> Option<Plane> {
        let name = plain(name);
        if name == "LOCAL" {
            return Some(Plane::Local);
        }
        let zone = match code_of(&name) {
            Some(code) => UtmZone::of_code(code)?,
            None => UtmZone::named(&name)?,
        };
        Some(Plane::Utm(zone))
    }
}

/// `text` in capitals, without spaces, underscores and slashes.
fn plain(text: &str) -> String {
    text.chars().filter(|c| !c.is_whitespace() && !matches!(c, '_' | '/')).collect::<String>().to_uppercase()
}

/// The name of a system of heights without the word.
fn short(name: &str) -> String {
    name.trim_end_matches(" height").to_uppercase()
}

/// The number of an EPSG code, with or without the word.
fn code_of(plain: &str) -> Option<u32> {
    let digits = plain.strip_prefix("EPSG:").unwrap_or(plain);
    // A sign would be read, too.
    if digits.bytes().all(|byte| byte.is_ascii_digit()) { digits.parse().ok() } else { None }
}

impl UtmZone {
    fn of_code(code: u32) -> Option<UtmZone> {
        let west = NAD83_2011_WEST.iter().position(|known| *known == code);
        if let Some(index) = west {
            return Some(UtmZone { datum: &DATUMS[3], number: 59 + index as u32, south: false });
        }
        DATUMS.iter().find_map(|datum| {
            let zone = |first: u32, [least, most]: [u32; 2], south| {
                let number = code.checked_sub(first)?.checked_add(1)?;
                (least..=most).contains(&number).then_some(UtmZone { datum, number, south })
            };
            let south = datum.first_south.and_then(|first| zone(first, [1, 60], true));
            zone(datum.first_north, datum.north, false).or(south)
        })
    }

    /// `ETRS89UTMZONE32N`, with or without ZONE.
    fn named(plain: &str) -> Option<UtmZone> {
        let (datum, zone) = plain.split_once("UTM")?;
        let datum = DATUMS.iter().find(|known| known.prefixes.contains(&datum))?;
        let zone = zone.strip_prefix("ZONE").unwrap_or(zone);
        let (number, south) = match (zone.strip_suffix('N'), zone.strip_suffix('S')) {
            (Some(number), _) => (number, false),
            (None, Some(number)) => (number, true),
            (None, None) => return None,
        };
        // Only what has a code exists.
        let number = number.parse().ok().filter(|number| (1..=60).contains(number))?;
        let zone = UtmZone { datum, number, south };
        UtmZone::of_code(zone.code()).filter(|known| *known == zone)
    }

    fn code(self) -> u32 {
        let first = if self.south { self.datum.first_south.unwrap_or_default() } else { self.datum.first_north };
        match self.number.checked_sub(59) {
            Some(index) if self.datum.code == DATUMS[3].code => NAD83_2011_WEST[index as usize % 2],
            _ => first + self.number - 1,
        }
    }

    fn name(self) -> String {
        format!("{} / UTM zone {}{}", self.datum.name, self.number, if self.south { 'S' } else { 'N' })
    }

    /// Degrees east of Greenwich.
    fn central_meridian(self) -> i32 {
        6 * self.number as i32 - 183
    }

    fn false_northing(self) -> u32 {
        if self.south { 10_000_000 } else { 0 }
    }

    /// Of the Universal Transverse Mercator grid: scale 0.9996, false easting 500 km, in the south false northing 10,000 km
    /// (J. P. Snyder, "Map projections: a working manual", USGS Professional Paper 1395, page 57).
    fn projection(self) -> TransverseMercator {
        let origin = [0.0, f64::from(self.central_meridian()).to_radians()];
        let false_origin = [500_000.0, f64::from(self.false_northing())];
        TransverseMercator::new(self.datum.inverse_flattening, origin, 0.9996, false_origin)
    }

    fn wkt(self) -> String {
        let GeodeticDatum { name, code, datum: (datum, datum_code), ellipsoid, inverse_flattening, .. } = self.datum;
        let (ellipsoid, ellipsoid_code) = ellipsoid;
        let mut text = String::new();
        let _ = write!(text, r#"PROJCS["{}",GEOGCS["{name}",DATUM["{datum}","#, self.name());
        let _ = write!(
            text,
            r#"SPHEROID["{ellipsoid}",6378137,{inverse_flattening},AUTHORITY["EPSG","{ellipsoid_code}"]],"#
        );
        let _ = write!(text, r#"AUTHORITY["EPSG","{datum_code}"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],"#);
        let _ =
            write!(text, r#"UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","{code}"]],"#);
        let _ = write!(text, r#"PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],"#);
        let _ = write!(
            text,
            r#"PARAMETER["central_meridian",{}],PARAMETER["scale_factor",0.9996],"#,
            self.central_meridian()
        );
        let _ =
            write!(text, r#"PARAMETER["false_easting",500000],PARAMETER["false_northing",{}],"#, self.false_northing());
        let _ =
            write!(text, r#"{METRE},AXIS["Easting",EAST],AXIS["Northing",NORTH],AUTHORITY["EPSG","{}"]]"#, self.code());
        text
    }
}

/// The projection of well-known text, if it is a transverse Mercator projection in metres, with heights in metres, of
/// degrees on an ellipsoid that is that of GRS 80 or WGS 84 within a tenth of a millimetre.
fn projection_of(entry: &WktEntry) -> Option<TransverseMercator> {
    let projected = entry.find("PROJCS")?;
    let method = projected.inner.iter().find(|inner| inner.keyword == "PROJECTION")?;
    let &[semi_major, inverse_flattening, ..] = projected.find("SPHEROID")?.numbers.as_slice() else { return None };
    let unit_of = |entry: &WktEntry| {
        let unit = entry.inner.iter().find(|inner| inner.keyword == "UNIT")?;
        unit.numbers.first().copied()
    };
    let degrees = projected.find("GEOGCS").and_then(unit_of);
    let heights = entry.find("VERT_CS").map(|vertical| unit_of(vertical).unwrap_or(1.0));
    let meridian = projected.find("PRIMEM").and_then(|prime| prime.numbers.first().copied()).unwrap_or(0.0);
    let is_known = method.name.eq_ignore_ascii_case("Transverse_Mercator")
        && unit_of(projected) == Some(1.0)
        && degrees.is_none_or(|unit| (unit - 1_f64.to_radians()).abs() < 1e-9)
        && heights.is_none_or(|unit| unit == 1.0)
        && meridian == 0.0
        && semi_major == 6_378_137.0
        && (inverse_flattening - 298.257_222_8).abs() < 1e-5;
    let number = |name: &str| projected.parameter(name);
    let latitude = number("latitude_of_origin").unwrap_or(0.0);
    let longitude = number("central_meridian").or(number("longitude_of_center"))?;
    let scale = number("scale_factor").unwrap_or(1.0);
    let (easting, northing) = (number("false_easting").unwrap_or(0.0), number("false_northing").unwrap_or(0.0));
    let is_sane = (-90.0..=90.0).contains(&latitude)
        && (-360.0..=360.0).contains(&longitude)
        && (0.1..10.0).contains(&scale)
        && easting.abs() < 1e9
        && northing.abs() < 1e9;
    (is_known && is_sane).then(|| {
        let origin = [latitude.to_radians(), longitude.to_radians()];
        TransverseMercator::new(inverse_flattening, origin, scale, [easting, northing])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_names_are_the_same_systems() {
        for (code, names) in [
            ("EPSG:32632", &["UTM 32N", "utm zone 32n", "WGS 84 / UTM zone 32N", "WGS_1984_UTM_Zone_32N"][..]),
            ("EPSG:32733", &["UTM 33S", "WGS84 UTM 33S"]),
            ("EPSG:25832", &["ETRS89 / UTM zone 32N", "ETRS89 UTM 32N", "ETRS_1989_UTM_Zone_32N", "25832"]),
            ("EPSG:26910", &["NAD83 / UTM zone 10N", "NAD_1983_UTM_Zone_10N"]),
            ("EPSG:6339", &["NAD83(2011) / UTM zone 10N", "NAD_1983_2011_UTM_Zone_10N"]),
            ("EPSG:6329", &["NAD83(2011) / UTM zone 60N"]),
            ("EPSG:25832+7837", &["ETRS89 / UTM zone 32N + DHHN2016 height", "epsg:25832+DHHN2016"]),
        ] {
            let crs = Crs::parse(code).unwrap();
            assert_eq!(crs.code().as_deref(), Some(code));
            for name in names.iter().copied().chain([crs.name().as_str()]) {
                assert_eq!(Crs::parse(name).unwrap(), crs, "{name}");
            }
        }
    }

    /// First and last codes of each row of the EPSG dataset exist, their neighbours do not.
    #[test]
    fn only_zones_with_a_code_exist() {
        for (first, last) in [(32_601, 32_660), (32_701, 32_760), (25_828, 25_838), (26_901, 26_923), (6328, 6348)] {
            for code in first..=last {
                let crs = Crs::parse(&format!("EPSG:{code}")).unwrap();
                assert_eq!(crs.code(), Some(format!("EPSG:{code}")));
            }
            for code in [first - 1, last + 1] {
                assert!(Crs::parse(&format!("EPSG:{code}")).is_err(), "{code}");
            }
        }
        for name in
            ["ETRS89 / UTM zone 20N", "ETRS89 / UTM zone 32S", "UTM 61N", "UTM 0N", "UTM 32", "NAD83 / UTM zone 30N"]
        {
            let message = Crs::parse(name).unwrap_err().to_string();
            assert!(message.starts_with("crs is ") && message.contains("allowed: EPSG:25832"), "{message}");
        }
    }

    /// What PROJ 9.5.1 gives as `WKT1_GDAL`.
    #[test]
    fn the_text_is_that_of_proj() {
        let plane = r#"PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89",DATUM["European_Terrestrial_Reference_System_1989",SPHEROID["GRS 1980",6378137,298.257222101,AUTHORITY["EPSG","7019"]],AUTHORITY["EPSG","6258"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4258"]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["Easting",EAST],AXIS["Northing",NORTH],AUTHORITY["EPSG","25832"]]"#;
        assert_eq!(Crs::parse("EPSG:25832").unwrap().wkt(), plane);
        let heights = r#"VERT_CS["DHHN2016 height",VERT_DATUM["Deutsches Haupthoehennetz 2016",2005,AUTHORITY["EPSG","1170"]],UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["Gravity-related height",UP],AUTHORITY["EPSG","7837"]]"#;
        let both = format!(r#"COMPD_CS["ETRS89 / UTM zone 32N + DHHN2016 height",{plane},{heights}]"#);
        assert_eq!(Crs::parse("EPSG:25832+7837").unwrap().wkt(), both);
        let south = Crs::parse("UTM 33S").unwrap().wkt();
        assert!(
            south.contains(r#"PARAMETER["false_northing",10000000]"#) && south.contains(r#""central_meridian",15]"#)
        );
    }

    #[test]
    fn well_known_text_is_kept_and_its_projection_understood() {
        for code in ["EPSG:32632", "EPSG:32733", "EPSG:25833", "EPSG:26910", "EPSG:6330", "EPSG:25832+7837"] {
            let crs = Crs::parse(code).unwrap();
            let read = Crs::parse(&crs.wkt()).unwrap();
            assert_eq!(
                (read.wkt(), read.name(), read.projection()),
                (crs.wkt(), crs.name(), crs.projection()),
                "{code}"
            );
        }
        // As ESRI writes them.
        let esri = "PROJCS[\"ETRS_1989_UTM_Zone_32N\",GEOGCS[\"GCS_ETRS_1989\",DATUM[\"D_ETRS_1989\",\
                    SPHEROID[\"GRS_1980\",6378137.0,298.257222101]],PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",\
                    0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"False_Easting\",500000.0],\
                    PARAMETER[\"False_Northing\",0.0],PARAMETER[\"Central_Meridian\",9.0],PARAMETER[\"Scale_Factor\",\
                    0.9996],PARAMETER[\"Latitude_Of_Origin\",0.0],UNIT[\"Meter\",1.0]]";
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("area.prj");
        std::fs::write(&file, format!("{esri}\r\n")).unwrap();
        let crs = Crs::open(file.to_str().unwrap()).unwrap();
        assert_eq!((crs.wkt(), crs.projection()), (esri.to_owned(), Crs::parse("EPSG:25832").unwrap().projection()));
        std::fs::write(&file, "PROJCS[").unwrap();
        let message = Crs::open(file.to_str().unwrap()).unwrap_err().to_string();
        assert!(message.contains("area.prj: line 1: neither a text"), "{message}");
        // On another ellipsoid, coordinates would need a shift of the datum.
        assert_eq!(Crs::parse(&esri.replace("298.257222101", "299.1528128")).unwrap().projection(), None);
        assert!(Crs::parse("PROJCRS[\"a\"]").unwrap_err().to_string().contains("version 2"));
        assert!(Crs::parse("VERT_CS[\"a\"]").unwrap_err().to_string().contains("VERT_CS"));
    }

    #[test]
    fn a_local_system_has_no_projection_and_no_heights() {
        let local = Crs::parse("local").unwrap();
        assert!(
            local.wkt().starts_with("LOCAL_CS[\"local\"") && local.projection().is_none() && local.code().is_none()
        );
        assert!(Crs::parse("local+7837").is_err() && Crs::parse("EPSG:25832+9999").is_err());
    }

    #[test]
    fn zones_are_six_degrees_wide() {
        let code = |latitude: f64, longitude: f64| {
            Crs::utm_at(latitude.to_radians(), longitude.to_radians()).map(|crs| crs.code().unwrap_or_default())
        };
        for (latitude, longitude, expected) in [
            (49.4, 8.7, "EPSG:32632"),
            (-33.9, 18.4, "EPSG:32734"),
            (0.0, -180.0, "EPSG:32601"),
            (-0.1, 179.99, "EPSG:32760"),
            (10.0, 188.7, "EPSG:32602"),
        ] {
            assert_eq!(code(latitude, longitude).unwrap(), expected);
        }
        for latitude in [84.1, -80.1, f64::NAN] {
            assert!(code(latitude, 9.0).is_err());
        }
    }
}
