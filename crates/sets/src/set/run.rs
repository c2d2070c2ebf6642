//! Makes samples in parallel, and completes a set.

use super::check::{damages, missing};
use super::lock::Lock;
use super::making::{Making, settle, sweep};
use super::manifest::{self, Entry, FARTHEST_M, FileEntry, ManifestLog, RANGE_STEP_M, drawn_file};
use super::names::numbered;
use super::noticed::{Kinds, Noticed};
use super::origin::{Origin, need_origin};
use super::points::runs;
use super::rig::{SensorClass, kind};
use super::style::{Scanned, StripUse, Style};
use super::whole::{Whole, damaged};
use super::{readme, report, styles};
use crate::sample::BoxScope;
use crate::{Sample, Scenario, lock};
use cloud::{Field, FieldSet, PointCloud};
use engine::trace::Engine;
use glam::Vec3;
use ground::builder;
use ground::error::{Error, Result};
use ground::report::Report;
use ground::write::{self, cancel_flag};
use pictures::{PreviewOptions, View};
use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

builder! {
    /// Which samples are made, and how.
    #[derive(Clone, Debug, Default)]
    pub struct RunOptions {
        /// Folder of the set; `None`: as the scenario specifies.
        pub folder: Option<PathBuf>,
        /// First sample, last sample and step; `None`: all.
        pub samples: Option<[u64; 3]>,
        /// Index, from 0, and number of the shards that the samples are divided into; only this shard is made.
        pub shard: Option<[u64; 2]>,
        /// Resumes where a run has stopped, instead of refusing a set that has samples.
        pub resume: bool,
        /// Threads; 0: all cores.
        pub threads: usize,
    }
}

/// Progress of a run.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event<'e> {
    /// The run begins, with this many samples.
    Begins(u64),
    /// A sample is complete, or has failed.
    Made(&'e Entry),
    /// A sample existed already.
    Found(u64),
}

/// Result of a run.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct RunSummary {
    /// Folder of the set.
    pub folder: PathBuf,
    /// Number of samples made.
    pub made: u64,
    /// Number of samples that existed already.
    pub found: u64,
    /// Samples that have failed, and why.
    pub failed: Vec<(u64, String)>,
    /// Number of points of the samples made.
    pub points: u64,
    /// Duration, s.
    pub seconds: f64,
    /// Warnings, each kind once.
    pub warnings: Vec<Noticed>,
    /// Whether the set is complete: with manifest and report.
    pub complete: bool,
    /// Number of threads that made samples.
    pub threads: usize,
}

/// Number of samples, the first ones of a set, that are shown in its report.
const PICTURES: u64 = 12;

/// Makes samples of `scenario` and writes them. A failed sample is recorded, and the others continue.
///
/// `watch` is called for each event, on the thread where it occurs.
///
/// # Errors
/// A folder that holds other files; one that another process writes to, unless both make different shards of the same
/// number of shards; existing samples without `resume`; a full disk; [`Error::Cancelled`] once the samples in progress
/// are complete, if [`cancel_flag`] is set.
pub fn run(scenario: Scenario, options: &RunOptions, watch: &(dyn Fn(Event) + Sync)) -> Result<RunSummary> {
    let start = Instant::now();
    let styles = super::styles(&scenario)?;
    let root = options.folder.clone().or_else(|| scenario.set_folder());
    let root = root.filter(|root| !root.as_os_str().is_empty());
    let root =
        root.ok_or_else(|| Error::invalid("set.folder", "missing", "a folder, for a scenario that is no file"))?;
    let selected = selected(&scenario, options)?;
    let cores = Engine::with_threads(options.threads)?.threads();
    // Many samples are made in parallel, with one thread each; few one by one, with all threads.
    let side_by_side = selected.len() >= cores && cores > 1;
    let (workers, threads) = if side_by_side { (cores, 1) } else { (1, cores) };
    let scenario = scenario.with_engine(&Engine::with_threads(threads)?);

    let origin = Origin::of(&scenario, styles.iter().map(|style| style.root().to_owned()).collect())?;
    // What cannot be written is reported before anything is written.
    if let Some(&first) = selected.first() {
        let sample = scenario.sample(first)?;
        styles.iter().try_for_each(|style| check_fit(&**style, &sample))?;
    }
    origin.known(&root)?;
    fs::create_dir_all(&root).map_err(|source| Error::Io { path: root.clone(), source })?;
    let lock_files = match options.shard {
        Some(shard) => Lock::of_shard(&root, shard)?,
        None => Lock::of_set(&root)?,
    };
    // Another run may have written to it in the meantime.
    let claimed = origin.known(&root)?;
    let known = manifest::read(&root)?;
    let there = selected.iter().filter(|sample| known.get(sample).is_some_and(|entry| entry.error.is_none())).count();
    if there > 0 && !options.resume {
        let found = format!("{}, in which {there} of these samples are", ground::shown::path(&root));
        return Err(Error::invalid("set.folder", found, "another folder, or to go on with the set (--resume)"));
    }
    origin.claim(&root, claimed)?;
    if options.shard.is_none() {
        sweep(&root, &origin)?;
    }
    let log_name = options.shard.map_or("manifest.jsonl".to_owned(), |[k, n]| format!("manifest.{k}_of_{n}.jsonl"));
    let log_path = root.join(log_name);
    let log = Mutex::new(ManifestLog::open(&log_path)?);
    watch(Event::Begins(selected.len() as u64));

    let maker = Maker { scenario: &scenario, styles: &styles, root: &root };
    let queue = Mutex::new(selected.iter().copied());
    let summary = Mutex::new(RunSummary { folder: root.clone(), threads: workers * threads, ..RunSummary::default() });
    let noticed = Mutex::new(Kinds::default());
    let lost = Mutex::new(None);
    let work = || {
        let mut cloud = PointCloud::default();
        while !cancel_flag().load(Ordering::SeqCst) && lock(&lost).is_none() {
            let Some(sample) = lock(&queue).next() else { break };
            let old = known.get(&sample).filter(|entry| entry.error.is_none());
            if old.is_some_and(|entry| entry.files.iter().all(|file| file.fault(&root).is_none())) {
                watch(Event::Found(sample));
                lock(&summary).found += 1;
                continue;
            }
            let noted = maker.entry(sample, &mut cloud).and_then(|entry| {
                lock(&log).add(&entry, &log_path)?;
                Ok(entry)
            });
            let entry = match noted {
                Ok(entry) => entry,
                Err(error) => {
                    lock(&lost).get_or_insert(error);
                    break;
                }
            };
            watch(Event::Made(&entry));
            lock(&noticed).add(entry.sample, &entry.warnings);
            lock(&summary).count(entry);
        }
    };
    std::thread::scope(|scope| {
        (1..workers).for_each(|_| drop(scope.spawn(work)));
        work();
    });
    if let Some(error) = lock(&lost).take() {
        return Err(error);
    }
    if cancel_flag().load(Ordering::SeqCst) {
        return Err(Error::Cancelled);
    }
    let mut summary = summary.into_inner().unwrap_or_else(PoisonError::into_inner);
    summary.failed.sort();
    summary.warnings = noticed.into_inner().unwrap_or_else(PoisonError::into_inner).notices();
    let notices = unlocked(&lock_files, &root).warnings.into_iter();
    summary.warnings.extend(notices.map(|warning| Noticed { warning, samples: 0, first: 0 }));
    if options.shard.is_none() {
        let (origin, entries) = (need_origin(&root)?, manifest::read(&root)?);
        if missing(&origin, &entries).is_none() {
            write_whole(&root, &origin, entries)?;
            summary.complete = true;
        }
    }
    drop(lock_files);
    summary.seconds = start.elapsed().as_secs_f64();
    Ok(summary)
}

/// Warning about a file system without locks.
const UNLOCKED: &str = "its file system has no locks: nothing keeps another run from writing there at the same time";

/// Completes the set in `root`, whose samples are all present according to their manifests: writes the files of all
/// samples together, its manifest and its report. Returns the warnings.
///
/// # Errors
/// There is no set, or another process writes to it; samples are missing, or their files have changed; I/O errors.
pub fn finish(root: &Path) -> Result<Report> {
    need_origin(root)?;
    let lock = Lock::of_set(root)?;
    // Another process may have written to it in the meantime.
    let origin = need_origin(root)?;
    let entries = all_entries(root, &origin)?;
    for entry in entries.values() {
        if let Some(fault) = damages(root, &origin, entry).next() {
            return Err(damaged(fault));
        }
    }
    write_whole(root, &origin, entries)?;
    Ok(unlocked(&lock, root))
}

/// [`finish`] of a set of which only the files that are joined need to be in `root`, as where the others are in an
/// object store.
///
/// # Errors
/// As [`finish`].
pub fn complete(root: &Path) -> Result<Report> {
    need_origin(root)?;
    let lock = Lock::of_set(root)?;
    let origin = need_origin(root)?;
    write_whole(root, &origin, all_entries(root, &origin)?)?;
    Ok(unlocked(&lock, root))
}

/// Warns if nothing keeps other runs from the set in `root`.
fn unlocked(lock: &Lock, root: &Path) -> Report {
    let mut report = Report::default();
    if lock.unlocked {
        report.warn(format!("{}: {UNLOCKED}", ground::shown::path(root)));
    }
    report
}

/// [`complete`] for the holder of the set's lock, with all `entries` of its manifests.
fn write_whole(root: &Path, origin: &Origin, entries: BTreeMap<u64, Entry>) -> Result<()> {
    sweep(root, origin)?;
    let logs = manifest::logs(root)?;
    let (spec, document) = origin.spec()?;
    let styles = styles::all(&spec.outputs, &document)?;
    let licence = spec.set.licence;
    let mut whole = Whole::new(root, origin, entries, spec.set.splits, spec.seed);
    whole.licence.clone_from(&licence);
    whole.write_splits()?;
    styles.iter().try_for_each(|style| style.join(&mut whole))?;
    let readme = readme::text(origin, &whole, &styles, licence.as_deref());
    whole.write("README.md", &mut |out| out.write_all(readme.as_bytes()))?;
    whole.finish()?;
    manifest::write(root, &whole.entries)?;
    report::write(root, origin, &whole.entries)?;
    for path in logs {
        fs::remove_file(&path).map_err(|source| Error::Io { path, source })?;
    }
    whole.clear()
}

/// The samples of the set in `root`, which must all be present.
fn all_entries(root: &Path, origin: &Origin) -> Result<BTreeMap<u64, Entry>> {
    let entries = manifest::read(root)?;
    match missing(origin, &entries) {
        Some(missing) => {
            let allowed = "a set whose samples are all there; `echocast run --resume` makes them";
            Err(Error::invalid("the set", format!("not complete: {missing}"), allowed))
        }
        None => Ok(entries),
    }
}

/// The samples of a run, in order.
fn selected(scenario: &Scenario, options: &RunOptions) -> Result<Vec<u64>> {
    let last = scenario.samples() - 1;
    let [first, end, step] = options.samples.unwrap_or([0, last, 1]);
    if end > last || first > end || step == 0 {
        let found = format!("{first} to {end}, every {step}");
        return Err(Error::invalid("samples", found, format!("0 to {last}, which the scenario has")));
    }
    let [part, parts] = options.shard.unwrap_or([0, 1]);
    if part >= parts {
        let allowed = format!("0/{parts} to {}/{parts}", parts.saturating_sub(1));
        return Err(Error::invalid("shard", format!("{part}/{parts}"), allowed));
    }
    Ok((first..=end).step_by(step as usize).filter(|sample| sample % parts == part).collect())
}

impl RunSummary {
    fn count(&mut self, entry: Entry) {
        match entry.error {
            Some(error) => self.failed.push((entry.sample, error)),
            None => self.made += 1,
        }
        self.points += entry.points;
    }
}

struct Maker<'m> {
    scenario: &'m Scenario,
    styles: &'m [Box<dyn Style>],
    root: &'m Path,
}

impl Maker<'_> {
    /// Makes a sample and writes it; any error of the sample is in the entry.
    ///
    /// # Errors
    /// Errors other than those of the sample: the folder of the set cannot be written to, or the run is cancelled.
    fn entry(&self, sample: u64, cloud: &mut PointCloud) -> Result<Entry> {
        let made = catch_unwind(AssertUnwindSafe(|| self.make(sample, cloud)));
        let made = made.unwrap_or_else(|_| Err(Error::Internal("a defect of the program stopped it".into())));
        let mut entry = match made {
            Ok(entry) => entry,
            Err(error) => {
                for half in [picture_file(sample), drawn_file(sample).into()] {
                    let _ = fs::remove_file(self.root.join(half));
                }
                match &error {
                    Error::Cancelled => return Err(error),
                    Error::Io { path, .. } if self.holds(path) => return Err(error),
                    _ => Entry::failed(sample, &error),
                }
            }
        };
        // Independent of where the scenario is.
        let folder = format!("{}/", ground::shown::path(self.scenario.folder()));
        if folder != "/" {
            let texts = entry.warnings.iter_mut().chain(&mut entry.error);
            texts.for_each(|text| *text = text.replace(&folder, ""));
        }
        Ok(entry)
    }

    /// Whether `path` is in the folder of the set; files are written with all links in their paths resolved.
    fn holds(&self, path: &Path) -> bool {
        path.starts_with(self.root) || self.root.canonicalize().is_ok_and(|root| path.starts_with(root))
    }

    fn make(&self, number: u64, cloud: &mut PointCloud) -> Result<Entry> {
        let mut sample = self.scenario.sample(number)?;
        let engine = sample.scene().engine().clone();
        engine.install(|| self.write(number, &mut sample, cloud))
    }

    fn write(&self, number: u64, sample: &mut Sample, cloud: &mut PointCloud) -> Result<Entry> {
        self.styles.iter().try_for_each(|style| check_fit(&**style, sample))?;
        let begun = self.styles.iter().map(|style| Making::begin(self.root, style.root(), number));
        let folders = begun.collect::<Result<Vec<_>>>()?;
        let shown = number < PICTURES;
        let mut needed = self.styles.iter().fold(FieldSet::EMPTY, |all, style| all.union(style.fields(sample)));
        needed = [Field::X, Field::Y, Field::Z, Field::CategoryId].into_iter().fold(needed, FieldSet::with);
        if shown {
            needed = needed.union(picture_options().fields());
        }
        let mut writers = self
            .styles
            .iter()
            .zip(&folders)
            .map(|(style, folder)| style.writer(number, sample, folder.path()))
            .collect::<Result<Vec<_>>>()?;
        let mut report = sample.report().clone();
        let mut counts = Counts::default();
        let mut picture = shown.then(|| SamplePicture { path: picture_file(number), cloud: PointCloud::default() });
        // Strips are scanned piece by piece; they are put together where a style needs all of one.
        let in_pieces = self.styles.iter().all(|style| style.strips() == StripUse::Pieces);
        for scan in 0..sample.scans().len() {
            for frame in 0..sample.scans()[scan].frames().len() {
                let requested_fields = sample.scans()[scan].options(frame).fields;
                let boxes = self.styles.iter().map(|style| style.boxes(sample, scan, frame)).max();
                let boxes = boxes.unwrap_or(BoxScope::None);
                let before = counts.points;
                let (pieces, mut whole) = (sample.scans()[scan].pieces(frame), PointCloud::default());
                for piece in 0..pieces {
                    let last = piece + 1 == pieces;
                    sample.piece_into(scan, [frame, piece], requested_fields.union(needed), boxes, cloud)?;
                    counts.add(cloud);
                    if (scan, frame) == (0, 0)
                        && let Some(picture) = &mut picture
                    {
                        picture.add(cloud)?;
                    }
                    if pieces > 1 && !in_pieces {
                        whole.append(cloud)?;
                        if !last {
                            continue;
                        }
                        std::mem::swap(cloud, &mut whole);
                    }
                    // Files hold the requested columns.
                    cloud.fields = requested_fields;
                    let boxes = cloud.boxes.take().unwrap_or_default();
                    let scanned = Scanned { sample, scan, frame, last, cloud, boxes: &boxes };
                    for writer in &mut writers {
                        report.absorb(writer.add(&scanned)?);
                    }
                }
                if counts.points == before {
                    let scan = &sample.scans()[scan];
                    let what = if kind(scan) == SensorClass::Camera {
                        "an image in which nothing is seen"
                    } else {
                        "a cloud without points"
                    };
                    report.warn(format!("{}: {what}", scan.name()));
                    *counts.empty.entry(scan.name().to_owned()).or_default() += 1;
                }
            }
        }
        let pictured = picture.map(|picture| picture.write(self.root)).transpose()?;
        for writer in writers {
            report.absorb(writer.finish()?);
        }

        let drawn = Path::new(&drawn_file(number)).to_owned();
        let text = serde_json::json!({ "sample": number, "drawn": sample.drawn() });
        let text = serde_json::to_string_pretty(&text).map_err(|error| Error::Internal(error.to_string()))? + "\n";
        write::whole(&self.root.join(&drawn), text.as_bytes())?;
        let mut files = vec![FileEntry::of(self.root, &drawn)?];
        files.extend(pictured.iter().map(|path| FileEntry::of(self.root, path)).collect::<Result<Vec<_>>>()?);
        for (style, folder) in self.styles.iter().zip(folders) {
            for path in settle(self.root, &**style, number, folder)? {
                files.push(FileEntry::of(self.root, &path)?);
            }
        }
        files.sort();
        Ok(Entry {
            sample: number,
            files,
            error: None,
            points: counts.points,
            categories: counts.categories,
            empty: counts.empty,
            ranges: counts.ranges,
            warnings: report.warnings,
        })
    }
}

/// Checks that `style` can hold the scans of `sample`.
///
/// # Errors
/// As [`Style::fits`]; strips in a style that has none.
pub(super) fn check_fit(style: &dyn Style, sample: &Sample) -> Result<()> {
    if style.strips() == StripUse::Refused && sample.scans().iter().any(crate::Scan::has_strips) {
        return Err(Error::invalid("outputs", "a style without strips", "plain, webdataset or files"));
    }
    style.fits(sample)
}

/// Name of the picture of a sample.
fn picture_file(sample: u64) -> PathBuf {
    Path::new("pictures").join(format!("{}.png", numbered(sample)))
}

fn picture_options() -> PreviewOptions {
    PreviewOptions::default().view(View::Perspective).width(640)
}

/// The picture of a sample: its first frame.
struct SamplePicture {
    /// Relative to the folder of the set.
    path: PathBuf,
    cloud: PointCloud,
}

impl SamplePicture {
    /// Adds a piece of the frame, if the picture does not have enough points yet.
    fn add(&mut self, cloud: &PointCloud) -> Result<()> {
        /// More points than the picture has pixels.
        const ENOUGH: usize = 4_000_000;
        if self.cloud.len < ENOUGH { self.cloud.append(cloud) } else { Ok(()) }
    }

    /// Writes it to the set in `root`; returns its path there.
    fn write(self, root: &Path) -> Result<PathBuf> {
        pictures::write_new(&self.cloud, &root.join(&self.path), &picture_options())?;
        Ok(self.path)
    }
}

/// Points by category and by range.
#[derive(Default)]
struct Counts {
    points: u64,
    categories: BTreeMap<String, u64>,
    empty: BTreeMap<String, u64>,
    ranges: Vec<u64>,
}

impl Counts {
    /// Adds the points of `cloud`.
    fn add(&mut self, cloud: &PointCloud) {
        let columns = &cloud.columns;
        let mut numbers: BTreeMap<u32, u64> = BTreeMap::new();
        let from = (cloud.sensor_pose.position - cloud.origin).as_vec3();
        let from = if cloud.frame == cloud::Frame::World { from } else { Vec3::ZERO };
        for (category, rows) in runs(&columns.category_id) {
            let before = self.points;
            for row in rows {
                let range = Vec3::new(columns.x[row], columns.y[row], columns.z[row]).distance(from);
                // Misses of organised clouds.
                if !range.is_finite() {
                    continue;
                }
                self.points += 1;
                let step = (f64::from(range).min(FARTHEST_M) / RANGE_STEP_M) as usize;
                if self.ranges.len() <= step {
                    self.ranges.resize(step + 1, 0);
                }
                self.ranges[step] += 1;
            }
            *numbers.entry(category).or_default() += self.points - before;
        }
        for (number, count) in numbers.into_iter().filter(|(_, count)| *count > 0) {
            let name = cloud.labels.category.name(number).unwrap_or("unlabelled");
            *self.categories.entry(name.to_owned()).or_default() += count;
        }
    }
}
