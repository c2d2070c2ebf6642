//! Sonar pings and their images to files.

use super::Instrument;
use super::arrays::{ArrayFile, check_ending, into_arrays, into_file};
use super::pixels::Png;
use super::{kmall, xtf};
use crate::cells::{SonarView, Sounding, Track};
use crate::image::{Image, ImageKind, LAYERS};
use crate::{Column, Field, FieldSet, Ping, Pings};
use echocast_memory::tried;
use emitter::pattern::JANUS_BEAMS;
use ground::error::{Error, Result};
use ground::read::ending;
use ground::report::Report;
use ground::shown;
use ground::units::amplitude_from_db;
use ground::write::{self, Pending, failed};
use model::{Labels, NameTable};
use std::io;
use std::path::{Path, PathBuf};

/// Endings of files of pings: of arrays, and of survey programs.
const PINGS: &[&str] = &["npz", "h5", "hdf5", "xtf", "kmall"];
/// Endings of image files.
const IMAGES: &[&str] = &["png", "npz", "h5", "hdf5"];
/// Fraction of the values at each end of the window of a PNG that shares the grey of that end.
const CLIPPED: f32 = 0.005;

/// Checks, before a long scan, whether pings of `sensor` can be written to `path`.
///
/// # Errors
/// An ending of no format for pings, or of one for pings of other sonars; a missing folder or one that cannot be
/// written to.
pub fn check_pings(path: &Path, sensor: &impl Instrument) -> Result<()> {
    check_ending(path, "pings", PINGS)?;
    check_view(path, sensor.sonar_view())?;
    Pending::create(path).map(drop)
}

/// Checks, before a long scan, whether an image of pings can be written to `path`.
///
/// # Errors
/// An ending of no format for images; a missing folder or one that cannot be written to.
pub fn check_image(path: &Path) -> Result<()> {
    check_ending(path, "images", IMAGES)?;
    Pending::create(path).map(drop)
}

/// Checks that survey programs expect pings of such a sonar in such a file.
fn check_view(path: &Path, view: SonarView) -> Result<()> {
    let (views, allowed): (&[SonarView], _) = match &*ending(path) {
        "xtf" => (&[SonarView::Sidescan, SonarView::Swath], "side-scan and swath sonars; .npz and .h5 hold any"),
        "kmall" => (&[SonarView::Swath], "swath sonars; .npz and .h5 hold any"),
        _ => return Ok(()),
    };
    if !views.contains(&view) {
        return Err(Error::invalid(shown::path(path).to_string(), format!("for a {} sonar", view.name()), allowed));
    }
    Ok(())
}

impl Pings {
    /// Writes the pings to `path`: their whole content as NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`); the samples of a
    /// side-scan sonar or the soundings of a swath sonar as XTF (`.xtf`); soundings and water columns of a swath sonar
    /// as KMALL (`.kmall`). The file appears under its name only when it is complete.
    ///
    /// In NPZ and HDF5, cells are in arrays of pings x beams x bins: `level`, `amplitude` and a column for each field;
    /// `true_x` to `true_z` are relative to `origin`. Soundings are a list in which `sounding_ping` counts the pings of
    /// the file. A Doppler velocity log adds `bottom_track`, and `water_track` if it tracks one.
    ///
    /// # Errors
    /// As [`check_pings`]; no pings, or pings that do not fit together, or not into the format; no memory for one more
    /// column; a full disk.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<Report> {
        let path = path.as_ref();
        check_ending(path, "pings", PINGS)?;
        let layout = self.check()?;
        check_view(path, layout.view)?;
        match &*ending(path) {
            "xtf" => {
                xtf::check(layout)?;
                into_file(path, |file, report| xtf::write(self, layout, file.path(), report))
            }
            "kmall" => {
                kmall::check(self, layout)?;
                into_file(path, |file, report| kmall::write(self, file.path(), report))
            }
            _ => into_arrays(path, |file, report| write_pings(file, self, report)),
        }
    }
}

impl Image {
    /// Writes the image to `path`: NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`) with `values`, an array for each label column
    /// that it has and the coordinates of its pixels, or PNG (`.png`), 8-bit greyscale. The files appear under their
    /// names only when all are complete.
    ///
    /// In a PNG, 0 is no value, and 1 to 255 span the window of values given by its text `window`, which leaves out
    /// half a percent at each end. Labels are in files next to it, `NAME.category_id.png` and so on, 16-bit greyscale,
    /// with the label numbers themselves.
    ///
    /// # Errors
    /// As [`check_image`]; arrays of another size than the image; no memory; a full disk.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<Report> {
        let path = path.as_ref();
        check_ending(path, "images", IMAGES)?;
        self.check()?;
        if ending(path) == "png" {
            return write_pngs(self, path);
        }
        into_arrays(path, |file, report| write_image(file, self, report))
    }
}

fn write_pings(file: &mut ArrayFile, Pings { pings }: &Pings, report: &mut Report) -> io::Result<()> {
    let first = &pings[0];
    let layout = &*first.layout;
    let (beams, bins) = (layout.beams(), layout.bins);
    let cells = [pings.len(), beams, bins];

    file.text("view", layout.view.name())?;
    let angles = |axis: usize| -> Vec<f32> { layout.axes.iter().map(|angles| angles[axis]).collect() };
    file.add(["beam_azimuth", "rad", "azimuth of each beam's axis, sensor frame"], &[beams], Column::F32(&angles(0)))?;
    file.add(["beam_elevation", "rad", "elevation of each beam's axis"], &[beams], Column::F32(&angles(1)))?;
    file.add(["bin_m", "m", "length of a bin; bin k begins at k times this"], &[], Column::F64(&[layout.bin_m]))?;
    let speed = ["believed_speed_m_s", "m/s", "sound speed that ranges are reported with"];
    file.add(speed, &[], Column::F64(&[layout.believed_speed]))?;
    let frequency = ["frequency_hz", "Hz", "centre frequency of the pulse"];
    file.add(frequency, &[], Column::F64(&[layout.frequency]))?;
    let surface = ["surface_z_m", "m", "height of the water surface, world"];
    file.add(surface, &[], Column::F64(&[layout.surface_z]))?;
    file.add(["noise_db", "dB re 1 uPa", "level of the noise in a cell"], &[], Column::F32(&[layout.noise_db]))?;
    let threshold = ["threshold_db", "dB re 1 uPa", "lowest level reported as an echo, by bin"];
    file.add(threshold, &[bins], Column::F32(&layout.threshold_db))?;
    file.add(["tvg_db", "dB", "time-varied gain of images, by bin"], &[bins], Column::F32(&layout.tvg_db))?;
    file.add(
        ["origin", "m", "world position of true_x, true_y, true_z 0"],
        &[3],
        Column::F64(&first.origin.to_array()),
    )?;

    let numbers: Vec<u32> = pings.iter().map(|ping| ping.number).collect();
    file.add(["ping_number", "", "number of each ping"], &[pings.len()], Column::U32(&numbers))?;
    let times: Vec<f64> = pings.iter().map(|ping| ping.time).collect();
    file.add(["ping_time", "s", "time at which each ping was sent"], &[pings.len()], Column::F64(&times))?;
    let positions: Vec<f64> = pings.iter().flat_map(|ping| ping.pose.position.to_array()).collect();
    let about = ["sensor_position", "m", "position of the sonar at each ping, world"];
    file.add(about, &[pings.len(), 3], Column::F64(&positions))?;
    let turns: Vec<f64> = pings.iter().flat_map(|ping| ping.pose.orientation.to_array()).collect();
    let about = ["sensor_orientation_xyzw", "1", "rotation from sensor to world at each ping, quaternion"];
    file.add(about, &[pings.len(), 4], Column::F64(&turns))?;

    let levels = joined(pings, |ping| ping.cells.intensity.iter().copied())?;
    file.add(["level", "dB re 1 uPa", "echo level with noise"], &cells, Column::F32(&levels))?;
    let mut amplitudes = levels;
    amplitudes.iter_mut().for_each(|level| *level = amplitude_from_db((*level).into()) as f32);
    file.add(["amplitude", "uPa", "amplitude of the level"], &cells, Column::F32(&amplitudes))?;
    drop(amplitudes);
    for info in first.fields.iter().filter(|info| info.field != Field::Intensity) {
        let about = [info.name, info.unit, info.meaning];
        macro_rules! add {
            ($kind:ident) => {{
                let column = joined(pings, |ping| match ping.column(info.field) {
                    Column::$kind(column) => column.iter().copied(),
                    _ => [].iter().copied(),
                })?;
                file.add(about, &cells, Column::$kind(&column))?;
            }};
        }
        match first.column(info.field) {
            Column::F32(_) => add!(F32),
            Column::F64(_) => add!(F64),
            Column::U8(_) => add!(U8),
            Column::U16(_) => add!(U16),
            Column::U32(_) => add!(U32),
        }
    }
    write_soundings(file, pings)?;
    write_tracks(file, pings)?;
    file.names(&first.labels, report)
}

fn write_soundings(file: &mut ArrayFile, pings: &[Ping]) -> io::Result<()> {
    let indices: Vec<u32> = (0u32..).zip(pings).flat_map(|(i, ping)| ping.soundings.iter().map(move |_| i)).collect();
    let count = [indices.len()];
    let whole = |of: fn(&Sounding) -> u32| joined(pings, move |ping| ping.soundings.iter().map(of));
    let real = |of: fn(&Sounding) -> f32| joined(pings, move |ping| ping.soundings.iter().map(of));
    file.add(["sounding_ping", "", "index of the ping, from 0"], &count, Column::U32(&indices))?;
    file.add(["sounding_beam", "", "beam that received it"], &count, Column::U32(&whole(|s| s.beam)?))?;
    file.add(["sounding_range", "m", "reported slant range"], &count, Column::F32(&real(|s| s.range)?))?;
    let about = ["sounding_level_db", "dB re 1 uPa", "level of its strongest cell"];
    file.add(about, &count, Column::F32(&real(|s| s.level_db)?))?;
    file.add(["sounding_quality", "1", "confidence, 0 to 1"], &count, Column::F32(&real(|s| s.quality)?))?;
    let places: Vec<f32> = joined(pings, |ping| ping.soundings.iter().map(|s| s.corrected))?
        .iter()
        .flat_map(|place| place.to_array())
        .collect();
    let about = ["sounding_corrected", "m", "position by the ray through the assumed profile, relative to origin"];
    file.add(about, &[indices.len(), 3], Column::F32(&places))?;
    let about = ["sounding_cell", "", "strongest cell in its ping: beam * bins + bin"];
    file.add(about, &count, Column::U32(&whole(|s| s.cell)?))
}

/// The velocities of a Doppler velocity log, ping by ping.
fn write_tracks(file: &mut ArrayFile, pings: &[Ping]) -> io::Result<()> {
    type Of = fn(&Ping) -> Option<Track>;
    let kinds: [(&str, &str, Of); 2] = [
        ("bottom_track", "over ground", |ping| ping.bottom_track),
        ("water_track", "through water", |ping| ping.water_track),
    ];
    for (name, over, of) in kinds {
        let tracks: Vec<Track> = pings.iter().map(|ping| of(ping).unwrap_or_default()).collect();
        if pings.iter().all(|ping| of(ping).is_none()) {
            continue;
        }
        let count = pings.len();
        let velocities: Vec<f32> = tracks.iter().flat_map(|track| track.velocity.to_array()).collect();
        let about = format!("velocity {over} of the sonar in its own frame at each ping, NaN without");
        file.add([name, "m/s", &about], &[count, 3], Column::F32(&velocities))?;
        let errors: Vec<f32> = tracks.iter().map(|track| track.error).collect();
        let about = format!("error velocity {over}, the disagreement of the four beams");
        file.add([&format!("{name}_error"), "m/s", &about], &[count], Column::F32(&errors))?;
        let rates: Vec<f32> = tracks.iter().flat_map(|track| track.radial).collect();
        let about = format!("measured rate of the range along each beam, {over}");
        file.add([&format!("{name}_radial"), "m/s", &about], &[count, JANUS_BEAMS], Column::F32(&rates))?;
    }
    Ok(())
}

/// The elements that `part` returns for each ping, one after the other.
fn joined<'a, T, I: Iterator<Item = T>>(pings: &'a [Ping], part: impl Fn(&'a Ping) -> I) -> io::Result<Vec<T>> {
    let mut all = Vec::new();
    for ping in pings {
        let part = part(ping);
        tried(|| all.try_reserve(part.size_hint().0)).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        all.extend(part);
    }
    Ok(all)
}

/// Name and unit of the values of an image.
fn quantity(kind: ImageKind) -> [&'static str; 2] {
    match kind {
        ImageKind::DepthMap => ["height, world z", "m"],
        ImageKind::RangeDoppler | ImageKind::Polar | ImageKind::PolarFan => ["power at the receiver", "dBm"],
        _ => ["echo level with time-varied gain", "dB re 1 uPa"],
    }
}

fn write_image(file: &mut ArrayFile, image: &Image, report: &mut Report) -> io::Result<()> {
    let shape = [image.height, image.width];
    file.text("kind", image.kind.name())?;
    let [quantity, unit] = quantity(image.kind);
    file.add(["values", unit, quantity], &shape, Column::F32(&image.values))?;
    for layer in &image.layers {
        let info = layer.field.info();
        file.add([info.name, info.unit, info.meaning], &shape, Column::U32(&layer.ids))?;
    }
    let place = &image.place;
    let about = ["first", "", "coordinates of the middle of the upper left pixel"];
    file.add(about, &[2], Column::F64(&place.first))?;
    file.add(["step", "", "from column to column and from row to row"], &[2], Column::F64(&place.step))?;
    file.text("column_axis", place.axes[0])?;
    file.text("row_axis", place.axes[1])?;
    file.names(&image.labels, report)
}

/// Writes the picture and its labels.
fn write_pngs(image: &Image, path: &Path) -> Result<Report> {
    let mut report = Report::default();
    if image.width == 0 || image.height == 0 || image.width.max(image.height) > i32::MAX as usize {
        let found = format!("{} x {} pixels large", image.width, image.height);
        return Err(Error::invalid("image", found, "at least one pixel, and 2147483647 along a side, for a PNG"));
    }
    let mut pending = vec![(Pending::create(path)?, path.to_owned())];
    for layer in &image.layers {
        let path = layer_path(path, layer.field);
        pending.push((Pending::create(&path)?, path));
    }
    let mut texts = vec![("kind".to_owned(), image.kind.name().to_owned())];
    for axis in 0..2 {
        let side = ["column", "row"][axis];
        let (first, step, name) = (image.place.first[axis], image.place.step[axis], image.place.axes[axis]);
        texts.push((format!("{side}_axis"), format!("{first} + {step} * {side} ({name})")));
    }
    let pings = [quantity(image.kind)[0], ", ", quantity(image.kind)[1]].concat();
    for (index, (file, named)) in pending.iter().enumerate() {
        let mut texts = texts.clone();
        let bytes: Vec<u8> = if index == 0 {
            let [low, high] = window(&image.values);
            texts.push(("quantity".to_owned(), pings.clone()));
            texts.push(("window".to_owned(), format!("0 = nothing; 1 to 255 = {low} to {high}")));
            image.values.iter().map(|&value| grey(value, [low, high])).collect()
        } else {
            let layer = &image.layers[index - 1];
            if layer.ids.iter().any(|&id| id > u32::from(u16::MAX)) {
                report.warn(format!("png: numbers of {} above 65535 clamped", layer.field.info().name));
            }
            texts.push(("quantity".to_owned(), layer.field.info().name.to_owned()));
            texts.push(("names".to_owned(), names(&image.labels, layer.field)));
            layer.ids.iter().flat_map(|&id| (id.min(u32::from(u16::MAX)) as u16).to_be_bytes()).collect()
        };
        let depth = if index == 0 { png::BitDepth::Eight } else { png::BitDepth::Sixteen };
        let size = [image.width, image.height];
        let png = Png { size, color: png::ColorType::Grayscale, depth, palette: None, texts, fast: false };
        png.write(file.path(), &bytes).map_err(|source| failed(named, source))?;
    }
    // The picture comes last, after its labels.
    write::commit_all(pending.into_iter().map(|(file, _)| file).rev().collect())?;
    Ok(report)
}

/// Where the label image of `field` is for the image at `path`: `fan.category_id.png` for `fan.png`.
fn layer_path(path: &Path, field: Field) -> PathBuf {
    path.with_extension(format!("{}.png", field.info().name))
}

/// The files that [`Image::write`] writes in addition to the image at `path`, of pings with the columns `fields`: one
/// for each label column for a PNG, none for other formats.
pub fn image_label_paths(path: &Path, fields: FieldSet) -> Vec<PathBuf> {
    let layers = LAYERS.into_iter().filter(|&field| ending(path) == "png" && fields.contains(field));
    layers.map(|field| layer_path(path, field)).collect()
}

/// The range of values that the greys of an image span.
fn window(values: &[f32]) -> [f32; 2] {
    let mut known: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let mut quantile = |q: f32| {
        let rank = (q * known.len().saturating_sub(1) as f32).round() as usize;
        if known.is_empty() { 0.0 } else { *known.select_nth_unstable_by(rank, f32::total_cmp).1 }
    };
    let [low, high] = [quantile(CLIPPED), quantile(1.0 - CLIPPED)];
    if high > low { [low, high] } else { [low - 0.5, low + 0.5] }
}

/// Grey of `value`: 0 for NaN, else 1 to 255.
fn grey(value: f32, [low, high]: [f32; 2]) -> u8 {
    if value.is_nan() { 0 } else { (1.0 + 254.0 * (value - low) / (high - low)).round().clamp(1.0, 255.0) as u8 }
}

/// Numbers and names of the labels of `field`, JSON.
fn names(labels: &Labels, field: Field) -> String {
    let stem = field.info().name.trim_end_matches("_id");
    let table = labels.tables().into_iter().find(|(name, _)| *name == stem);
    let rows = table.map(|(_, table)| NameTable::iter(table).map(|(id, name)| (id.to_string(), name.into())).collect());
    serde_json::Value::Object(rows.unwrap_or_default()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::SonarView;
    use crate::image::synthetic::{SyntheticSidescan, TARGET, imaging, pings, swath};
    use crate::image::{ImageRange, Overlap, mosaic, waterfall};
    use crate::test_sensor::TestSensor;
    use std::fs::File;

    #[test]
    fn endings_are_checked_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let [sides, swath, fan, single] = [
            "{type: sidescan, tilt_deg: 25, vertical_deg: 50, along_deg: 0.3, rays: 64, rate_hz: 4}",
            "{type: multibeam, beams: 3, swath_deg: 90, across_deg: 1, along_deg: 1, rays: 8, rate_hz: 4}",
            "{type: imaging, beams: 3, fov_deg: 90, beam_deg: 1, vertical_deg: 20, rays: 8, rate_hz: 4}",
            "{type: single_beam, beam_deg: 7, rate_hz: 3}",
        ]
        .map(TestSensor::new);
        check_pings(&at("a.npz"), &sides).unwrap();
        check_image(&at("a.PNG")).unwrap();
        let error = check_pings(&at("a.png"), &sides).unwrap_err().to_string();
        assert!(error.ends_with("is not supported: pings are written as .npz, .h5, .hdf5, .xtf, .kmall"), "{error}");
        assert!(check_image(&at("a.las")).is_err());
        assert!(check_pings(&at("none/a.npz"), &sides).is_err() && check_image(&at("none/a.npz")).is_err());
        assert_eq!(check_pings(&at("a.h5"), &sides).is_ok(), cfg!(feature = "hdf5"));
        for (name, sonars) in [("a.XTF", vec![&sides, &swath]), ("a.kmall", vec![&swath])] {
            for sonar in [&sides, &swath, &fan, &single] {
                let allowed = sonars.iter().any(|allowed| allowed.sonar_view() == sonar.sonar_view());
                assert_eq!(check_pings(&at(name), sonar).is_ok(), allowed, "{name}: {:?}", sonar.sonar_view());
            }
        }
        let error = check_pings(&at("a.xtf"), &fan).unwrap_err().to_string();
        let reason = "a.xtf is for a fan sonar; allowed: side-scan and swath sonars; .npz and .h5 hold any";
        assert!(error.ends_with(reason), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn files_beside_an_image_are_known_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.png");
        let image = waterfall(&pings(&SyntheticSidescan::default()), ImageRange::Slant, None).unwrap();
        image.write(&path).unwrap();
        let known = image_label_paths(&path, [Field::CategoryId, Field::InstanceId, Field::Time].into_iter().collect());
        assert_eq!(known, ["category_id", "instance_id"].map(|name| folder.path().join(format!("map.{name}.png"))));
        assert!(known.iter().all(|file| file.exists()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
        assert!(image_label_paths(Path::new("map.npz"), FieldSet::all()).is_empty());
    }

    #[test]
    fn pings_that_do_not_fit_together_are_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        std::fs::write(&path, "old").unwrap();
        let good = swath(3);
        let spoil = |change: &dyn Fn(&mut Pings)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.write(&path).unwrap_err().to_string()
        };
        assert!(spoil(&|bad| bad.pings.clear()).contains("at least one"));
        assert!(spoil(&|bad| bad.pings[2].labels = Default::default()).starts_with("ping 2 is of another"));
        assert!(spoil(&|bad| bad.pings[0].pose.position.x = f64::NAN).contains("finite poses"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        good.write(&path).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn pings_that_a_format_cannot_hold_are_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |pings: &Pings, name: &str| pings.write(folder.path().join(name)).unwrap_err().to_string();
        let fan = Pings { pings: vec![imaging(SonarView::Fan, 0.0, 5.0)] };
        assert!(
            refused(&fan, "a.xtf")
                .ends_with("a.xtf is for a fan sonar; allowed: side-scan and swath sonars; .npz and .h5 hold any")
        );
        let sides = pings(&SyntheticSidescan { pings: 1, ..SyntheticSidescan::default() });
        assert!(refused(&sides, "a.kmall").contains("a.kmall is for a sidescan sonar; allowed: swath sonars"));
        let mut far = swath(2);
        far.pings[1].pose.position.y = 1e7;
        let reason =
            "kmall: position of ping 1 is 0.35, 10000000; allowed: x within 20037508 m and y within 9951685 m of 0";
        assert!(refused(&far, "a.kmall").starts_with(reason), "{}", refused(&far, "a.kmall"));
        far.write(folder.path().join("a.xtf")).unwrap();
        let many = SonarView::Sidescan;
        let many = Pings { pings: vec![imaging(many, 0.0, 5.0)] };
        assert_eq!(refused(&many, "b.xtf"), "xtf: number of beams is 60; allowed: 1 to 6, one channel each");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_disk_that_is_full_at_any_write_leaves_nothing() {
        use ground::write::sink::full_disk::WRITES;
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.xtf", "a.kmall"] {
            let written = |writes| {
                WRITES.set(writes);
                let written = swath(3).write(folder.path().join(name));
                WRITES.set(usize::MAX);
                written
            };
            let count = (0..100).take_while(|&writes| written(writes).is_err()).count();
            assert!((3..100).contains(&count), "{name}: {count}");
            std::fs::remove_file(folder.path().join(name)).unwrap();
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    fn read(path: &Path) -> (png::OutputInfo, Vec<u8>, Vec<(String, String)>) {
        let mut reader = png::Decoder::new(io::BufReader::new(File::open(path).unwrap())).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        let texts = &reader.info().uncompressed_latin1_text;
        (info, pixels, texts.iter().map(|text| (text.keyword.clone(), text.text.clone())).collect())
    }

    #[test]
    fn a_png_describes_its_greys_and_labels_are_next_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("track.png");
        let track = SyntheticSidescan::default();
        let image = mosaic(&pings(&track), ImageRange::Ground, 0.1, Overlap::Mean).unwrap();
        image.write(&path).unwrap();
        let (info, pixels, texts) = read(&path);
        assert_eq!((info.width as usize, info.height as usize), (image.width, image.height));
        let text = |name: &str| &texts.iter().find(|(keyword, _)| keyword == name).unwrap().1;
        assert_eq!(text("quantity"), "echo level with time-varied gain, dB re 1 uPa");
        assert!(text("column_axis").ends_with("+ 0.1 * column (x, m)"), "{}", text("column_axis"));
        let window: Vec<f32> =
            text("window").split("= ").nth(2).unwrap().split(" to ").map(|number| number.parse().unwrap()).collect();
        for (&grey, &value) in pixels.iter().zip(&image.values) {
            assert_eq!(grey == 0, value.is_nan());
            let read = window[0] + f32::from(grey.max(1) - 1) / 254.0 * (window[1] - window[0]);
            let half = 0.5001 * (window[1] - window[0]) / 254.0;
            assert!(value.is_nan() || (read - value.clamp(window[0], window[1])).abs() <= half, "{read} {value}");
        }
        let (info, pixels, texts) = read(&layer_path(&path, Field::CategoryId));
        assert_eq!(info.bit_depth, png::BitDepth::Sixteen);
        let ids: Vec<u32> = pixels.chunks(2).map(|pair| u32::from(u16::from_be_bytes([pair[0], pair[1]]))).collect();
        assert_eq!(ids, image.layer(Field::CategoryId).unwrap());
        let place = image.index(track.target_in_world().into()).unwrap();
        assert_eq!(ids[place], TARGET);
        assert!(texts.contains(&("names".to_owned(), r#"{"1":"seabed","2":"boulder"}"#.to_owned())), "{texts:?}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn images_of_the_wrong_size_are_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let mut image = waterfall(&pings(&SyntheticSidescan::default()), ImageRange::Slant, None).unwrap();
        image.layers[0].ids.pop();
        for name in ["a.png", "a.npz"] {
            let error = image.write(folder.path().join(name)).unwrap_err().to_string();
            assert!(error.starts_with("image is made of 121199 values; allowed: a value for each of its"), "{error}");
        }
        let empty = Image { width: 0, height: 0, values: Vec::new(), layers: Vec::new(), ..image };
        assert!(empty.write(folder.path().join("a.png")).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let fan = crate::image::fan(&imaging(SonarView::Fan, 0.0, 5.0), 100).unwrap();
        fan.write(folder.path().join("a.npz")).unwrap();
    }
}
