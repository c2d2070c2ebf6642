//! What survey files contain in addition to their points, and what a cloud keeps from file to file.
//!
//! Coordinate systems are records of LAS (ASPRS LAS Specification 1.4 R15, 2.5 and 3): OGC well-known text, or the keys
//! of GeoTIFF 1.0 (2.4 and 6.3).

use ground::builder;
use ground::crs::Crs;

/// A LAS record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Its owner; at most 16 bytes of ASCII.
    pub user: String,
    /// Its number among the records of its owner.
    pub id: u16,
    /// At most 32 bytes of ASCII.
    pub description: String,
    /// Its content.
    pub data: Vec<u8>,
}

builder! {
    /// All records of a cloud, and the reference of its times.
    #[derive(Clone, Debug, Default, PartialEq, Eq)]
    pub struct Records {
        /// In the order of the file, except those that describe the layout of the file.
        pub all: Vec<Record>,
        /// Whether times count from the GPS epoch, less a billion seconds; otherwise from the start of a week.
        pub standard_time: bool,
    }
}

/// Owner of the records of coordinate systems.
const PROJECTION: &str = "LASF_Projection";
/// Number of the record of a coordinate system as well-known text.
const TEXT: u16 = 2112;
/// And of a coordinate transform as such text.
const TRANSFORM: u16 = 2111;
/// First and last number of the records of GeoTIFF: keys, their numbers, their texts.
const KEYS: u16 = 34735;
const KEY_TEXTS: u16 = 34737;
/// First keywords of the text of a coordinate system, versions 1 and 2.
const SYSTEMS: &[&str] = &[
    "PROJCS",
    "GEOGCS",
    "GEOCCS",
    "COMPD_CS",
    "VERT_CS",
    "LOCAL_CS",
    "PROJCRS",
    "GEOGCRS",
    "GEODCRS",
    "COMPOUNDCRS",
    "VERTCRS",
    "BOUNDCRS",
    "ENGCRS",
    "PROJECTEDCRS",
    "GEOGRAPHICCRS",
    "GEODETICCRS",
    "FITTED_CS",
];

impl Record {
    /// A coordinate system as well-known text; `None`: `text` is not one.
    pub(crate) fn of_text(text: &str) -> Option<Record> {
        let begins = text.trim_start().split('[').next().unwrap_or_default().trim_end();
        let known = SYSTEMS.iter().any(|system| system.eq_ignore_ascii_case(begins));
        let description = "OGC WKT coordinate system".to_owned();
        let data = [text.trim().as_bytes(), b"\0"].concat();
        known.then(|| Record { user: PROJECTION.into(), id: TEXT, description, data })
    }

    /// Its coordinate system as text, if it is one.
    #[doc(hidden)]
    pub fn text(&self) -> Option<&str> {
        if self.id != TEXT || self.user != PROJECTION {
            return None;
        }
        let text = self.data.split(|&byte| byte == 0).next()?;
        str::from_utf8(text).ok().filter(|text| !text.trim().is_empty())
    }

    /// Whether it belongs to a coordinate system.
    pub(crate) fn is_system(&self) -> bool {
        self.user == PROJECTION && (matches!(self.id, TEXT | TRANSFORM) || (KEYS..=KEY_TEXTS).contains(&self.id))
    }

    /// Whether it belongs to the keys of GeoTIFF.
    pub(crate) fn is_keys(&self) -> bool {
        self.is_system() && (KEYS..=KEY_TEXTS).contains(&self.id)
    }
}

impl Records {
    /// The coordinate system `crs` alone, if there is one, and whether times are standard GPS time.
    pub fn of_crs(crs: Option<&Crs>, standard_time: bool) -> Records {
        Records { all: crs.and_then(|crs| Record::of_text(&crs.wkt())).into_iter().collect(), standard_time }
    }

    /// The coordinate system as well-known text.
    pub fn wkt(&self) -> Option<&str> {
        self.all.iter().find_map(Record::text)
    }

    /// The common name of the coordinate system: the name in its text, the citation of its keys, or an EPSG code.
    pub fn system(&self) -> Option<String> {
        let quoted = |text: &str| text.split('"').nth(1).map(str::to_owned);
        if let Some(text) = self.wkt() {
            return Some(quoted(text).unwrap_or_else(|| text.chars().take(60).collect()));
        }
        let of = |id| self.all.iter().find(|record| record.is_system() && record.id == id).map(|record| &*record.data);
        let texts = of(KEY_TEXTS).unwrap_or_default();
        let (numbers, _) = of(KEYS)?.as_chunks();
        let numbers: Vec<u16> = numbers.iter().map(|bytes| u16::from_le_bytes(*bytes)).collect();
        let (keys, _) = numbers.get(4..)?.as_chunks::<4>();
        // A number is in the entry itself, a text where the entry points.
        let find = |key| keys.iter().find(|entry| entry[0] == key);
        let number = |key| find(key).filter(|entry| entry[1] == 0 && entry[3] != 32767).map(|entry| entry[3]);
        let cited = |key| {
            let [.., length, start] = find(key).filter(|entry| entry[1] == KEY_TEXTS)?;
            let text = texts.get(usize::from(*start)..)?.get(..usize::from(*length))?;
            let text = String::from_utf8_lossy(text);
            let text = text.trim_end_matches(['\0', '|']).trim();
            (!text.is_empty()).then(|| text.to_owned())
        };
        // ProjectedCSTypeGeoKey and GeographicTypeGeoKey; PCSCitation, GTCitation and GeogCitation.
        let epsg = [3072, 2048].into_iter().find_map(number).map(|number| format!("EPSG:{number}"));
        let name = [3073, 1026, 2049].into_iter().find_map(cited);
        match (name, epsg) {
            (Some(name), Some(epsg)) => Some(format!("{name} ({epsg})")),
            (name, epsg) => name.or(epsg).or_else(|| Some("user-defined (GeoTIFF keys)".to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinate_systems_have_names() {
        let text = r#"PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84"]]"#;
        let record = Record::of_text(text).unwrap();
        assert_eq!((record.text(), record.data.last()), (Some(text), Some(&0)));
        let records = Records { all: vec![record], ..Records::default() };
        assert_eq!(records.system().unwrap(), "WGS 84 / UTM zone 33N");
        assert!(Record::of_text("EPSG:25832").is_none() && Record::of_text("").is_none());

        let record = |id, data| Record { user: PROJECTION.into(), id, description: String::new(), data };
        let keys = |keys: &[u16]| record(KEYS, keys.iter().flat_map(|key| key.to_le_bytes()).collect());
        let texts = record(KEY_TEXTS, b"UTM 32|ETRS89|\0".to_vec());
        let system = |all| Records { all, ..Records::default() }.system();
        let all = [1, 1, 0, 2, 1026, KEY_TEXTS, 7, 0, 3072, 0, 1, 25832];
        assert_eq!(system(vec![keys(&all), texts.clone()]).unwrap(), "UTM 32 (EPSG:25832)");
        assert_eq!(system(vec![keys(&all)]).unwrap(), "EPSG:25832");
        // An entry that points past the texts, and keys that are cut off.
        assert_eq!(
            system(vec![keys(&[1, 1, 0, 1, 1026, KEY_TEXTS, 99, 3]), texts]).unwrap(),
            "user-defined (GeoTIFF keys)"
        );
        assert_eq!(system(vec![keys(&[1, 1])]), None);
        let transform = record(2111, b"PARAM_MT[\"Affine\"]\0".to_vec());
        assert!(transform.is_system() && !transform.is_keys() && transform.text().is_none());
        assert_eq!(system(Vec::new()), None);
    }
}
