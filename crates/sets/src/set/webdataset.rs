//! WebDataset: samples in archives, one after the other.

use super::manifest::{Entry, FileEntry};
use super::names::{file_name, numbered};
use super::style::{Scanned, StripUse, Style, Writer as Write};
use super::whole::{Whole, damaged};
use crate::Sample;
use cloud::export;
use cloud::{FieldSet, Frame};
use ground::error::{Error, Result};
use ground::report::Report;
use ground::write::{self, Sink};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// `webdataset/train-000000.tar` with `000017.top.npz` and `000017.json` of each sample.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct WebDataset {
    /// Name of the format of clouds, as `echocast formats` lists them.
    pub format: String,
    /// Number of samples per archive.
    pub samples: usize,
}

impl Default for WebDataset {
    fn default() -> Self {
        WebDataset { format: "npz".into(), samples: 1000 }
    }
}

const ROOT: &str = "webdataset";

/// Folder of the samples until they are joined.
const PIECES: &str = ".pieces";

/// Block size of archives, bytes (POSIX.1-1988, ustar).
const BLOCK: u64 = 512;

/// Length of the end of an archive: two blocks of zeros.
const END: u64 = 2 * BLOCK;

struct WebDatasetWriter<'w> {
    style: &'w WebDataset,
    number: u64,
    folder: &'w Path,
    path: PathBuf,
    archive: BufWriter<Sink>,
    frames: Vec<Value>,
    labels: Map<String, Value>,
    drawn: Value,
}

impl Style for WebDataset {
    fn check(&self) -> Result<()> {
        if self.samples == 0 {
            return Err(Error::invalid("samples", 0, "1 or more"));
        }
        export::format_for(Path::new(""), Some(&self.format)).map(drop)
    }

    fn root(&self) -> &'static str {
        ROOT
    }

    fn fields(&self, _sample: &Sample) -> FieldSet {
        FieldSet::EMPTY
    }

    fn strips(&self) -> StripUse {
        StripUse::Whole
    }

    fn fits(&self, sample: &Sample) -> Result<()> {
        let names: Vec<String> = sample.scans().iter().map(|scan| member(scan.name())).collect();
        for (index, name) in names.iter().enumerate() {
            if name.len() > 64 || names[..index].contains(name) {
                let found = format!("{name:?} in an archive");
                return Err(Error::invalid("webdataset: sensor", found, "names of up to 64 letters, each once"));
            }
        }
        Ok(())
    }

    fn writer<'w>(&'w self, number: u64, sample: &Sample, folder: &'w Path) -> Result<Box<dyn Write + 'w>> {
        let pieces = folder.join(PIECES);
        std::fs::create_dir(&pieces).map_err(|source| Error::Io { path: pieces.clone(), source })?;
        let path = pieces.join(format!("{}.tar", numbered(number)));
        let archive = Sink::create(&path).map_err(|source| write::failed(&path, source))?;
        Ok(Box::new(WebDatasetWriter {
            style: self,
            number,
            folder,
            path,
            archive: BufWriter::with_capacity(1 << 16, archive),
            frames: Vec::new(),
            labels: Map::new(),
            drawn: sample.drawn().into(),
        }))
    }

    fn join(&self, whole: &mut Whole) -> Result<()> {
        let mut pending = Vec::new();
        for (part, _) in whole.parts() {
            // Failed samples keep their places, so that the others need not move when these are made.
            let numbers = whole.numbers_in(&part);
            for (index, numbers) in numbers.chunks(self.samples).enumerate() {
                let path = Path::new(ROOT).join(format!("{part}-{index:06}.tar"));
                let made = numbers.iter().filter(|number| whole.entries[number].error.is_none());
                let pieces = made.map(|&number| Ok((number, piece(&whole.entries[&number])?.clone())));
                let pieces: Vec<(u64, FileEntry)> = pieces.collect::<Result<_>>()?;
                let mut at = 0;
                let moved = pieces.iter().map(|(number, piece)| {
                    let place = FileEntry { path: ground::shown::path(&path), offset: Some(at), ..piece.clone() };
                    at += piece.bytes;
                    (*number, place)
                });
                let moved: Vec<(u64, FileEntry)> = moved.collect();
                let length = std::fs::metadata(whole.root.join(&path)).map(|file| file.len());
                if moved == pieces && length.is_ok_and(|length| length == at + END) {
                    if let Some(fault) = pieces.iter().find_map(|(_, piece)| piece.fault(whole.root)) {
                        return Err(damaged(fault));
                    }
                    whole.keep(&path);
                } else {
                    let root = whole.root;
                    pending.push(whole.prepare(&path, &mut |out| {
                        for (_, piece) in &pieces {
                            piece.copy(root, out)?;
                        }
                        out.write_all(&[0; END as usize])
                    })?);
                }
                for (number, place) in moved {
                    let files = &mut whole.entries.get_mut(&number).map(|entry| &mut entry.files);
                    if let Some(known) = files.as_mut().and_then(|files| files.iter_mut().find(|file| is_piece(file))) {
                        *known = place;
                    }
                }
            }
        }
        // Only now: archives that are rewritten may have been read for others.
        pending.into_iter().try_for_each(write::Pending::commit)?;
        whole.drop_unlisted(&Path::new(ROOT).join(PIECES))
    }

    fn readme(&self) -> String {
        format!(
            "`webdataset` holds archives of up to {} samples, as the Python package `webdataset` reads them: clouds as \
             `{}`, and in `json` what was drawn, where the sensors were and the names of labels.\n\n\
             ```python\n\
             import webdataset\n\
             for sample in webdataset.WebDataset('webdataset/train-000000.tar', shardshuffle=False):\n    \
                 print(sample['__key__'], [name for name in sample if not name.startswith('_')])\n\
             ```\n",
            self.samples, self.format
        )
    }
}

/// A sensor's name in archives.
fn member(name: &str) -> String {
    file_name(name).replace('.', "_").chars().map(|letter| if letter.is_ascii() { letter } else { '_' }).collect()
}

fn is_piece(file: &FileEntry) -> bool {
    file.path.strip_prefix(ROOT).is_some_and(|rest| rest.starts_with('/'))
}

/// The file of a sample in the folder of this style.
fn piece(entry: &Entry) -> Result<&FileEntry> {
    let found = entry.files.iter().find(|file| is_piece(file));
    found.ok_or_else(|| damaged(format!("sample {} has no file in {ROOT}", entry.sample)))
}

impl Write for WebDatasetWriter<'_> {
    fn add(&mut self, &Scanned { sample, scan, frame, cloud, .. }: &Scanned) -> Result<Report> {
        let scan = &sample.scans()[scan];
        let mut stem = member(scan.name());
        if scan.frames().len() > 1 || scan.has_strips() {
            stem += &format!("_{:04}", scan.frames()[frame].number);
        }
        let format = export::format_for(Path::new(""), Some(&self.style.format))?;
        let ending = format.info().extensions.first().copied().unwrap_or(format.name());
        let path = self.folder.join(format!("cloud.{ending}"));
        let report = export::write_new(cloud, &path, format)?;
        let key = numbered(self.number);
        let written = self.put(&format!("{key}.{stem}.{ending}"), &path);
        written.map_err(|source| write::failed(&self.path, source))?;
        if !format.info().holds_label_names {
            let _ = std::fs::remove_file(export::labels_path(&path));
        }
        for (stem, table) in cloud.labels.tables() {
            let names = table.iter().map(|(id, name)| (id.to_string(), name.into()));
            self.labels.insert(stem.into(), Value::Object(names.collect()));
        }
        self.frames.push(json!({
            "sensor": scan.name(),
            "file": format!("{stem}.{ending}"),
            "frame": scan.frames()[frame].number,
            "time": scan.frames()[frame].start,
            "points": cloud.len,
            "coordinates": match cloud.frame { Frame::World => "world", Frame::Sensor => "sensor" },
            "sensor_position": cloud.sensor_pose.position.to_array(),
            "sensor_orientation_xyzw": cloud.sensor_pose.orientation.to_array(),
        }));
        Ok(report)
    }

    fn finish(mut self: Box<Self>) -> Result<Report> {
        let text = json!({
            "sample": self.number,
            "drawn": std::mem::take(&mut self.drawn),
            "clouds": std::mem::take(&mut self.frames),
            "labels": std::mem::take(&mut self.labels),
        });
        let text = text.to_string();
        let WebDatasetWriter { path, mut archive, number, .. } = *self;
        let mut write = || -> io::Result<()> {
            archive.write_all(&header(&format!("{}.json", numbered(number)), text.len() as u64)?)?;
            archive.write_all(text.as_bytes())?;
            archive.write_all(&padding(text.len() as u64))
        };
        write().map_err(|source| write::failed(&path, source))?;
        let archive = archive.into_inner().map_err(|error| write::failed(&path, error.into_error()))?;
        archive.finish().map_err(|source| write::failed(&path, source))?;
        Ok(Report::default())
    }
}

impl WebDatasetWriter<'_> {
    /// Moves the file at `path` into the archive as `name`.
    fn put(&mut self, name: &str, path: &Path) -> io::Result<()> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        self.archive.write_all(&header(name, length)?)?;
        io::copy(&mut file, &mut self.archive)?;
        self.archive.write_all(&padding(length))?;
        std::fs::remove_file(path)
    }
}

/// Padding of the last block of a file.
fn padding(length: u64) -> Vec<u8> {
    vec![0; (length.next_multiple_of(BLOCK) - length) as usize]
}

/// The header block of a file in an archive (POSIX.1-1988, ustar), with owner, group and time 0, so that the same files
/// make the same archive.
fn header(name: &str, length: u64) -> io::Result<[u8; BLOCK as usize]> {
    let mut block = [0; BLOCK as usize];
    // Eleven octal digits.
    if name.len() >= 100 || length >= 1 << 33 {
        return Err(io::Error::other(format!("{name} of {length} bytes is too long for a tar file")));
    }
    let mut put = |at: usize, text: &[u8]| block[at..at + text.len()].copy_from_slice(text);
    put(0, name.as_bytes());
    put(100, b"0000644\0");
    put(108, b"0000000\0");
    put(116, b"0000000\0");
    put(124, format!("{length:011o}\0").as_bytes());
    put(136, b"00000000000\0");
    // The checksum is computed with blanks in its place.
    put(148, b"        ");
    put(156, b"0");
    put(257, b"ustar\x0000");
    let sum: u32 = block.iter().map(|byte| u32::from(*byte)).sum();
    block[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    Ok(block)
}
