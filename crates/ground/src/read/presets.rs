//! The preset files that ship inside the library.

/// `(path below presets/, text)` of every embedded file whose path starts with `folder`.
pub fn embedded(folder: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    EMBEDDED.iter().copied().filter(move |(path, _)| path.starts_with(folder))
}

/// An embedded sensor file.
pub struct SensorFile {
    /// Path below `presets/`, such as `tof/kinect_v2.yaml`.
    pub path: &'static str,
    /// First folder of that path: `lidar`, `survey`, `tof`, `sonar`, `radar` or `paper`.
    pub folder: &'static str,
    /// The file's name without `.yaml`.
    pub name: &'static str,
    /// Content of the file.
    pub text: &'static str,
}

/// All embedded sensor files, by folder and name.
pub fn sensors() -> impl Iterator<Item = SensorFile> {
    embedded("").filter_map(|(path, text)| {
        let (folder, file) = path.split_once('/')?;
        let name = file.strip_suffix(".yaml")?;
        // The other folders hold surfaces and media.
        ["lidar", "survey", "tof", "sonar", "radar", "paper"].contains(&folder).then_some(SensorFile {
            path,
            folder,
            name,
            text,
        })
    })
}

include!(concat!(env!("OUT_DIR"), "/presets.rs"));
