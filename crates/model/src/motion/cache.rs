//! Vertex caches: positions that another program has computed, sample by sample.
//!
//! MDD (NewTek) is big-endian: int32 samples, int32 vertices, f32 seconds of each sample, then for each sample f32 x,
//! y, z of each vertex. PC2 (3ds Max) is little-endian: "POINTCACHE2\0", int32 version 1, int32 vertices, f32 frame of
//! the first sample, f32 frames from sample to sample, int32 samples, then the positions. The layouts are those that
//! Blender's add-ons `io_shape_mdd` and `io_export_pc2` write.
//!
//! Blender's glTF exporter places frame f at f / fps seconds, and so does [`Cache::open`] for PC2, which counts frames.
//! Blender's MDD exporter counts seconds from the first frame that it exports, whichever that is.

use super::curve::{bends_of, most_bends_of};
use echocast_memory::tried;
use glam::{DVec3, Vec3};
use ground::array::Array;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// Frames per second where nothing says otherwise: Blender's default.
pub const FPS: f64 = 24.0;

/// Where a cache repeats, it jumps within this time, s.
const JUMP_S: f64 = 1e-6;

/// Most samples of a cache: half a day of 24 frames a second.
const MOST_SAMPLES: usize = 1_000_000;

/// Largest magnitude of a coordinate, as in scene files.
const LARGEST: f32 = 1e18;

/// The positions of a mesh's vertices at certain times.
#[derive(Debug)]
pub struct Cache {
    /// Time of each sample, s, rising.
    pub times: Vec<f64>,
    /// After how many seconds it repeats; `None`: it holds its last sample.
    pub period: Option<f64>,
    samples: Samples,
}

/// The positions of each sample of a cache.
#[derive(Debug)]
enum Samples {
    Held(Vec<Array<[f32; 3]>>),
    File(Box<Baked>),
}

/// Samples in a file.
#[derive(Debug)]
struct Baked {
    /// Vertices of each sample.
    vertices: usize,
    /// For each vertex of the mesh, which of the file's it is; `None`: they are the same, in order.
    order: Option<Vec<u32>>,
    /// The mesh's origin in the file's coordinates.
    origin: DVec3,
    path: PathBuf,
    /// Offset of the first sample, bytes.
    start: u64,
    big_endian: bool,
    /// State of the file when its header was read.
    state: FileStamp,
    recent: Mutex<Recent>,
}

/// Length and modification time of a file.
type FileStamp = (u64, Option<SystemTime>);

/// The samples read last: with rising times each is read once.
#[derive(Debug)]
struct Recent {
    file: File,
    samples: [CacheSample; 2],
    /// A sample in the file's order.
    unordered: Vec<[f32; 3]>,
}

#[derive(Debug, Default)]
struct CacheSample {
    /// Its index; `None` before any is read, and after a failure.
    index: Option<usize>,
    positions: Vec<[f32; 3]>,
}

/// Content of a header.
struct CacheHeader {
    times: Vec<f64>,
    points: usize,
    /// Bytes before the first sample.
    start: u64,
}

impl Cache {
    /// Opens the file at `path`; its name says whether it is an MDD or a PC2 file. `fps` turns the frames of PC2 into
    /// seconds, [`FPS`] by default.
    ///
    /// # Errors
    /// A file that cannot be read; a header with other numbers than the file holds, or times that do not rise; an `fps`
    /// with MDD.
    pub fn open(path: &Path, fps: Option<f64>) -> Result<Cache> {
        let big_endian = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mdd"));
        let mut file = read::open(path, Limit::SCENE)?;
        let length = file.limit();
        let CacheHeader { times, points, start } = if big_endian {
            if let Some(fps) = fps {
                let message =
                    format!("an MDD file holds seconds, but {fps} frames per second are given; allowed: none");
                return Err(Error::parse(path, "", message));
            }
            mdd(path, &mut file, length)?
        } else {
            pc2(path, &mut file, length, fps.unwrap_or(FPS))?
        };
        check_times(path, &times)?;
        let file = file.into_inner();
        let state = state(&file).map_err(|source| Error::io(path, source))?;
        let recent = Recent { file, samples: Default::default(), unordered: Vec::new() };
        let baked = Baked {
            vertices: points,
            order: None,
            origin: DVec3::ZERO,
            path: path.to_owned(),
            start,
            big_endian,
            state,
            recent: Mutex::new(recent),
        };
        Ok(Cache { times, period: None, samples: Samples::File(Box::new(baked)) })
    }

    /// A cache of samples at rising `times`, s, one for each, all with the same number of vertices.
    pub fn held(times: Vec<f64>, samples: Vec<Array<[f32; 3]>>) -> Cache {
        Cache { times, period: None, samples: Samples::Held(samples) }
    }

    /// Whether its samples are in a file.
    pub fn is_read(&self) -> bool {
        matches!(self.samples, Samples::File(_))
    }

    /// Vertices of each sample, in the file if they are in one.
    pub fn vertices(&self) -> usize {
        match &self.samples {
            Samples::Held(samples) => samples[0].len(),
            Samples::File(baked) => baked.vertices,
        }
    }

    /// The same for a mesh whose origin is at `origin` in the file's coordinates, and whose vertices are those of the
    /// file that `order` lists, all below [`Cache::vertices`].
    #[must_use]
    pub fn placed(mut self, order: Option<Vec<u32>>, origin: DVec3) -> Cache {
        if let Samples::File(baked) = &mut self.samples {
            (baked.order, baked.origin) = (order, origin);
        }
        self
    }

    /// Whether it has the same positions at all times from `from` to `to`, s.
    pub fn is_still(&self, from: f64, to: f64) -> bool {
        let (first, last) = (self.times[0], self.times[self.times.len() - 1]);
        self.times.len() == 1 || self.period.is_none() && (to <= first || from >= last)
    }

    /// Adds the times between `from` and `to`, s, at which it has samples or is about to jump, in no particular order.
    pub fn bends(&self, from: f64, to: f64, bends: &mut Vec<f64>) {
        bends_of(&self.times, self.period, from, to, bends);
        if let Some(period) = self.period {
            bends_of(&[period - JUMP_S], self.period, from, to, bends);
        }
    }

    /// Upper bound on the number of times that [`Cache::bends`] adds.
    pub fn most_bends(&self, from: f64, to: f64) -> f64 {
        let jumps = self.period.map_or(0.0, |_| most_bends_of(&[], self.period, from, to));
        most_bends_of(&self.times, self.period, from, to) + jumps
    }

    /// The positions at `time`, s, one for each vertex of the mesh, m, in its frame: linear between samples, those of
    /// the first before it and of the last after it.
    ///
    /// # Errors
    /// A file that has changed or can no longer be read; a coordinate that is not finite or beyond 1e18; out of memory.
    pub fn at(&self, time: f64, positions: &mut Vec<[f32; 3]>) -> Result<()> {
        let time = self.period.map_or(time, |period| time.rem_euclid(period));
        let before = self.times.partition_point(|sample| *sample <= time).saturating_sub(1);
        let after = before + 1;
        let part = match self.times.get(after) {
            Some(next) if time > self.times[before] => {
                Some(((time - self.times[before]) / (next - self.times[before])) as f32)
            }
            _ => None,
        };
        match &self.samples {
            Samples::Held(samples) => {
                let to = part.map(|part| (&*samples[after], part));
                positions.clear();
                positions.extend(blend(&samples[before], to));
                Ok(())
            }
            Samples::File(baked) => baked.at(before, part, positions),
        }
    }
}

/// Positions on the way from one sample to another, of which the given part has passed.
fn blend<'a>(from: &'a [[f32; 3]], to: Option<(&'a [[f32; 3]], f32)>) -> impl Iterator<Item = [f32; 3]> + 'a {
    let (to, part) = to.unwrap_or((from, 0.0));
    // On the way from a position to itself, rounding changes nothing.
    from.iter().zip(to).map(move |(&from, &to)| Vec3::from(from).lerp(to.into(), part).to_array())
}

impl Baked {
    /// The positions when `part` of the time from sample `before` to the next has passed, or those of sample `before`.
    fn at(&self, before: usize, part: Option<f32>, positions: &mut Vec<[f32; 3]>) -> Result<()> {
        let after = before + 1;
        // After a panic at worst a sample is read again.
        let recent = &mut *self.recent.lock().unwrap_or_else(PoisonError::into_inner);
        let from = self.slot(recent, before, after)?;
        let to = match part {
            Some(part) => Some((self.slot(recent, after, before)?, part)),
            None => None,
        };
        positions.clear();
        reserve(&self.path, positions, recent.samples[from].positions.len())?;
        let to = to.map(|(slot, part)| (recent.samples[slot].positions.as_slice(), part));
        positions.extend(blend(&recent.samples[from].positions, to));
        Ok(())
    }

    /// Where among the recent samples `index` is; it is read if necessary, without replacing `kept`.
    fn slot(&self, recent: &mut Recent, index: usize, kept: usize) -> Result<usize> {
        if let Some(slot) = recent.samples.iter().position(|sample| sample.index == Some(index)) {
            return Ok(slot);
        }
        let slot = usize::from(recent.samples[0].index == Some(kept));
        let Recent { file, samples, unordered } = recent;
        let sample = &mut samples[slot];
        sample.index = None;
        self.fetch(file, unordered, index, &mut sample.positions)?;
        sample.index = Some(index);
        Ok(slot)
    }

    /// Sample `index` of `file`, for the vertices of the mesh; `unordered` is scratch memory.
    fn fetch(
        &self,
        file: &mut File,
        unordered: &mut Vec<[f32; 3]>,
        index: usize,
        positions: &mut Vec<[f32; 3]>,
    ) -> Result<()> {
        let Some(order) = &self.order else {
            self.load(file, index, positions)?;
            if self.origin != DVec3::ZERO {
                positions.iter_mut().for_each(|position| *position = self.local(*position));
            }
            return Ok(());
        };
        self.load(file, index, unordered)?;
        positions.clear();
        reserve(&self.path, positions, order.len())?;
        positions.extend(order.iter().map(|&point| self.local(unordered[point as usize])));
        Ok(())
    }

    /// A position of the file in the frame of the mesh.
    fn local(&self, position: [f32; 3]) -> [f32; 3] {
        (DVec3::from(position.map(f64::from)) - self.origin).as_vec3().to_array()
    }

    /// Sample `index` as it is in `file`.
    fn load(&self, file: &mut File, index: usize, positions: &mut Vec<[f32; 3]>) -> Result<()> {
        let fault = |source| Error::io(&self.path, source);
        if state(file).map_err(fault)? != self.state {
            return Err(Error::parse(&self.path, "", "has changed since the scene was read; allowed: the same file"));
        }
        if positions.len() != self.vertices {
            positions.clear();
            reserve(&self.path, positions, self.vertices)?;
            positions.resize(self.vertices, [0.0; 3]);
        }
        let sample = index as u64 * self.vertices as u64 * size_of::<[f32; 3]>() as u64;
        file.seek(SeekFrom::Start(self.start + sample)).map_err(fault)?;
        file.read_exact(bytemuck::cast_slice_mut(positions)).map_err(fault)?;
        let numbers: &mut [u32] = bytemuck::cast_slice_mut(positions);
        let decoded = if self.big_endian { decode(numbers, u32::from_be) } else { decode(numbers, u32::from_le) };
        if !decoded {
            let beyond = |p: &[f32; 3]| !p.iter().all(|x| x.abs() <= LARGEST);
            let vertex = positions.iter().position(beyond).unwrap_or_default();
            let message = format!("it is {:?}; allowed: -1e18 to 1e18", positions[vertex]);
            return Err(Error::parse(&self.path, format!("sample {index} vertex {vertex}"), message));
        }
        Ok(())
    }
}

/// Turns the bits of `numbers` into those of floats; returns whether none is NaN or beyond [`LARGEST`].
fn decode(numbers: &mut [u32], from: impl Fn(u32) -> u32) -> bool {
    // Floats without their sign are ordered as their bits are, with NaN and infinity last: beyond, the difference is
    // negative. Its sign alone takes fewer instructions than a comparison.
    let mut signs = 0;
    for number in numbers {
        *number = from(*number);
        signs |= LARGEST.to_bits().wrapping_sub(*number & !(1 << 31));
    }
    signs >> 31 == 0
}

/// Reads the header of an MDD file of `length` bytes.
fn mdd(path: &Path, file: &mut impl io::Read, length: u64) -> Result<CacheHeader> {
    let [samples, points] = bytes(path, file, length, "an MDD header")?.map(i32::from_be_bytes);
    let samples = count(path, "samples", samples, MOST_SAMPLES)?;
    let points = count(path, "vertices", points, i32::MAX as usize)?;
    let start = 8 + 4 * samples as u64;
    check_length(path, length, start, samples, points)?;
    let mut times = vec![0; 4 * samples];
    file.read_exact(&mut times).map_err(|source| Error::io(path, source))?;
    let times = times.as_chunks().0.iter().map(|&time| f32::from_be_bytes(time).into()).collect();
    Ok(CacheHeader { times, points, start })
}

/// Reads the header of a PC2 file of `length` bytes.
fn pc2(path: &Path, file: &mut impl io::Read, length: u64, fps: f64) -> Result<CacheHeader> {
    const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
    let words: [[u8; 4]; 8] = bytes(path, file, length, "a PC2 header")?;
    let [magic @ .., version, points, first, step, samples] = words;
    if magic.as_flattened() != MAGIC {
        return Err(Error::parse(path, "", "is not a PC2 file: it does not begin with POINTCACHE2"));
    }
    let version = i32::from_le_bytes(version);
    if version != 1 {
        return Err(Error::parse(path, "", format!("its version is {version}; allowed: 1")));
    }
    let points = count(path, "vertices", i32::from_le_bytes(points), i32::MAX as usize)?;
    let samples = count(path, "samples", i32::from_le_bytes(samples), MOST_SAMPLES)?;
    let [first, step] = [first, step].map(|number| f64::from(f32::from_le_bytes(number)));
    let start = size_of_val(&words) as u64;
    check_length(path, length, start, samples, points)?;
    if samples > 1 && !(step > 0.0 && step.is_finite()) {
        let message = format!("its samples are {step} frames apart; allowed: numbers above 0");
        return Err(Error::parse(path, "", message));
    }
    // With a single sample the step means nothing.
    let step = if samples > 1 { step } else { 0.0 };
    Ok(CacheHeader { times: (0..samples).map(|k| (first + k as f64 * step) / fps).collect(), points, start })
}

/// The first words of a file of `length` bytes.
fn bytes<const N: usize>(path: &Path, file: &mut impl io::Read, length: u64, what: &str) -> Result<[[u8; 4]; N]> {
    let mut words = [[0; 4]; N];
    if length < 4 * N as u64 {
        return Err(Error::parse(path, "", format!("is {length} bytes long, shorter than {what}, {}", 4 * N)));
    }
    file.read_exact(words.as_flattened_mut()).map_err(|source| Error::io(path, source))?;
    Ok(words)
}

/// The number of `what` in a header.
fn count(path: &Path, what: &str, number: i32, most: usize) -> Result<usize> {
    let fault = || Error::parse(path, "", format!("its header says {number} {what}; allowed: 1 to {most}"));
    usize::try_from(number).ok().filter(|number| (1..=most).contains(number)).ok_or_else(fault)
}

/// Checks that a file of `length` bytes holds what its header says.
fn check_length(path: &Path, length: u64, start: u64, samples: usize, points: usize) -> Result<()> {
    // The largest numbers do not fit into 64 bits.
    let wanted = u128::from(start) + 12 * samples as u128 * points as u128;
    if u128::from(length) == wanted {
        return Ok(());
    }
    let message = format!("is {length} bytes long; with {samples} samples of {points} vertices it has {wanted}");
    Err(Error::parse(path, "", message))
}

fn check_times(path: &Path, times: &[f64]) -> Result<()> {
    let fault = |sample: usize, message| Err(Error::parse(path, format!("sample {sample}"), message));
    if let Some(sample) = times.iter().position(|time| !time.is_finite()) {
        return fault(sample, format!("its time is {}; allowed: finite numbers", times[sample]));
    }
    match times.windows(2).position(|pair| pair[0] >= pair[1]) {
        None => Ok(()),
        Some(sample) => {
            let [before, time] = [times[sample], times[sample + 1]];
            fault(sample + 1, format!("its time is {time} s, that of the one before {before} s; allowed: rising times"))
        }
    }
}

fn state(file: &File) -> io::Result<FileStamp> {
    let found = file.metadata()?;
    // Some systems have no modification times.
    Ok((found.len(), found.modified().ok()))
}

fn reserve(path: &Path, positions: &mut Vec<[f32; 3]>, vertices: usize) -> Result<()> {
    let fault = |_| Error::Memory(format!("{vertices} vertices of {}", shown::path(path)));
    tried(|| positions.try_reserve_exact(vertices)).map_err(fault)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// The bytes of an MDD file.
    fn mdd_bytes(times: &[f32], samples: &[&[[f32; 3]]]) -> Vec<u8> {
        let mut bytes = Vec::new();
        bytes.extend((samples.len() as i32).to_be_bytes());
        bytes.extend((samples[0].len() as i32).to_be_bytes());
        let numbers = times.iter().chain(samples.iter().copied().flatten().flatten());
        bytes.extend(numbers.flat_map(|number| number.to_be_bytes()));
        bytes
    }

    /// The bytes of a PC2 file.
    fn pc2_bytes(first: f32, step: f32, samples: &[&[[f32; 3]]]) -> Vec<u8> {
        let mut bytes = b"POINTCACHE2\0".to_vec();
        bytes.extend([1, samples[0].len() as i32].map(i32::to_le_bytes).as_flattened());
        bytes.extend([first, step].map(f32::to_le_bytes).as_flattened());
        bytes.extend((samples.len() as i32).to_le_bytes());
        bytes.extend(samples.iter().copied().flatten().flatten().flat_map(|number| number.to_le_bytes()));
        bytes
    }

    const A: [[f32; 3]; 2] = [[0.0, 1.0, -2.0], [1e18, -0.0, 3.0]];
    const B: [[f32; 3]; 2] = [[4.0, 1.0, 2.0], [-1e18, 8.0, 3.0]];
    const C: [[f32; 3]; 2] = [[4.0, 5.0, 6.0], [7.0, 8.0, 9.0]];

    struct Folder(tempfile::TempDir);

    impl Folder {
        fn new() -> Folder {
            Folder(tempfile::tempdir().unwrap())
        }

        fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
            let path = self.0.path().join(name);
            fs::write(&path, bytes).unwrap();
            path
        }

        /// The error that `bytes` cause.
        fn error(&self, name: &str, bytes: &[u8], fps: Option<f64>) -> String {
            let path = self.write(name, bytes);
            self.plain(Cache::open(&path, fps).unwrap_err())
        }

        fn plain(&self, error: Error) -> String {
            error.to_string().replace(&format!("{}/", self.0.path().display()), "")
        }
    }

    fn at(cache: &Cache, time: f64) -> Vec<[f32; 3]> {
        let mut positions = vec![[9.0; 3]; 5];
        cache.at(time, &mut positions).unwrap();
        positions
    }

    #[test]
    fn mdd_holds_seconds() {
        let folder = Folder::new();
        let cache = Cache::open(&folder.write("a.MDD", &mdd_bytes(&[-0.5, 0.25, 4.0], &[&A, &B, &C])), None).unwrap();
        assert_eq!((cache.times.as_slice(), cache.vertices()), (&[-0.5, 0.25, 4.0][..], 2));
        for (time, sample) in [(-0.5, A), (0.25, B), (4.0, C), (-9.0, A), (1e300, C), (f64::NAN, A)] {
            assert_eq!(at(&cache, time), sample, "{time}");
        }
    }

    #[test]
    fn pc2_counts_frames() {
        let folder = Folder::new();
        let path = folder.write("a.pc2", &pc2_bytes(1.0, 0.5, &[&A, &B, &C]));
        // As Blender's glTF exporter has it, frame 1 is 1 / 24 s after time 0.
        assert_eq!(Cache::open(&path, None).unwrap().times, [1.0 / 24.0, 1.5 / 24.0, 2.0 / 24.0]);
        let cache = Cache::open(&path, Some(10.0)).unwrap();
        assert_eq!((cache.times.as_slice(), cache.vertices()), (&[0.1, 0.15, 0.2][..], 2));
        assert_eq!([at(&cache, 0.0), at(&cache, 0.15), at(&cache, 0.3)], [A, B, C]);
        let one = Cache::open(&folder.write("b.pc2", &pc2_bytes(-3.0, 0.0, &[&C])), None).unwrap();
        assert_eq!((one.times.as_slice(), at(&one, 0.0)), (&[-0.125][..], C.to_vec()));
    }

    #[test]
    fn positions_are_linear_between_samples() {
        let folder = Folder::new();
        let mut cache = Cache::open(&folder.write("a.mdd", &mdd_bytes(&[1.0, 3.0, 4.0], &[&A, &B, &C])), None).unwrap();
        assert_eq!(at(&cache, 1.5)[0], [1.0, 1.0, -1.0]);
        assert_eq!(at(&cache, 3.5)[0], [4.0, 3.0, 4.0]);
        // Backwards, and far.
        assert_eq!([at(&cache, 2.0)[0], at(&cache, 0.0)[0], at(&cache, 4.0)[0]], [[2.0, 1.0, 0.0], A[0], C[0]]);
        cache.period = Some(4.0);
        assert_eq!([at(&cache, 6.0)[0], at(&cache, -3.0)[0], at(&cache, 4.0)[0]], [[2.0, 1.0, 0.0], A[0], A[0]]);
    }

    #[test]
    fn meshes_have_their_own_order_and_origin() {
        let folder = Folder::new();
        let path = folder.write("a.pc2", &pc2_bytes(0.0, 1.0, &[&C, &B]));
        let origin = DVec3::new(4.0, 0.0, 1.0);
        let cache = Cache::open(&path, None).unwrap().placed(Some(vec![1, 0, 1]), origin);
        assert_eq!(at(&cache, 0.0), [[3.0, 8.0, 8.0], [0.0, 5.0, 5.0], [3.0, 8.0, 8.0]]);
        let cache = Cache::open(&path, None).unwrap().placed(None, origin);
        assert_eq!(at(&cache, 0.0), [[0.0, 5.0, 5.0], [3.0, 8.0, 8.0]]);
    }

    #[test]
    fn rising_times_read_each_sample_once() {
        let folder = Folder::new();
        let path = folder.write("a.mdd", &mdd_bytes(&[0.0, 1.0, 2.0], &[&A, &B, &C]));
        let cache = Cache::open(&path, None).unwrap();
        let known = |time| {
            at(&cache, time);
            let Samples::File(baked) = &cache.samples else { unreachable!() };
            let mut known = baked.recent.lock().unwrap().samples.each_ref().map(|sample| sample.index);
            known.sort();
            known
        };
        assert_eq!(known(0.0), [None, Some(0)]);
        assert_eq!([known(0.3), known(0.9), known(1.0)], [[Some(0), Some(1)]; 3]);
        assert_eq!([known(1.1), known(2.0), known(5.0)], [[Some(1), Some(2)]; 3]);
        // Samples in memory need no file.
        fs::write(&path, "").unwrap();
        assert_eq!(known(1.5), [Some(1), Some(2)]);
        let error = folder.plain(cache.at(0.5, &mut Vec::new()).unwrap_err());
        assert_eq!(error, "a.mdd: has changed since the scene was read; allowed: the same file");
        // Its slot is free, and the other sample is still there.
        assert_eq!(at(&cache, 1.0), B);
    }

    #[test]
    fn a_file_that_is_replaced_stays_open() {
        let folder = Folder::new();
        let path = folder.write("a.mdd", &mdd_bytes(&[0.0, 1.0], &[&A, &B]));
        let cache = Cache::open(&path, None).unwrap();
        fs::rename(folder.write("b.mdd", &mdd_bytes(&[0.0, 1.0], &[&C, &C])), &path).unwrap();
        assert_eq!([at(&cache, 0.0), at(&cache, 1.0)], [A, B]);
    }

    #[test]
    fn damage_of_mdd_files_is_distinguished() {
        let folder = Folder::new();
        let good = mdd_bytes(&[0.0, 1.0], &[&A, &B]);
        let error = |bytes: &[u8]| folder.error("a.mdd", bytes, None);
        let with = |at: usize, word: [u8; 4]| {
            let mut bytes = good.clone();
            bytes[at..at + 4].copy_from_slice(&word);
            error(&bytes)
        };
        assert_eq!(error(b""), "a.mdd: is 0 bytes long, shorter than an MDD header, 8");
        assert_eq!(error(&good[..7]), "a.mdd: is 7 bytes long, shorter than an MDD header, 8");
        assert_eq!(error(&good[..8]), "a.mdd: is 8 bytes long; with 2 samples of 2 vertices it has 64");
        assert_eq!(error(&good[..63]), "a.mdd: is 63 bytes long; with 2 samples of 2 vertices it has 64");
        let longer = [good.as_slice(), &[0]].concat();
        assert_eq!(error(&longer), "a.mdd: is 65 bytes long; with 2 samples of 2 vertices it has 64");
        assert_eq!(with(0, [0; 4]), "a.mdd: its header says 0 samples; allowed: 1 to 1000000");
        assert_eq!(with(0, [255; 4]), "a.mdd: its header says -1 samples; allowed: 1 to 1000000");
        assert_eq!(with(0, [127; 4]), "a.mdd: its header says 2139062143 samples; allowed: 1 to 1000000");
        assert_eq!(with(4, [0; 4]), "a.mdd: its header says 0 vertices; allowed: 1 to 2147483647");
        let many = with(4, i32::MAX.to_be_bytes());
        assert_eq!(many, "a.mdd: is 64 bytes long; with 2 samples of 2147483647 vertices it has 51539607544");
        let nan = with(12, f32::NAN.to_be_bytes());
        assert_eq!(nan, "a.mdd: sample 1: its time is NaN; allowed: finite numbers");
        let back = with(12, (-0.0f32).to_be_bytes());
        assert_eq!(back, "a.mdd: sample 1: its time is -0 s, that of the one before 0 s; allowed: rising times");
        assert_eq!(
            folder.error("a.mdd", &good, Some(25.0)),
            "a.mdd: an MDD file holds seconds, but 25 frames per second are given; allowed: none"
        );
        let folder_itself = folder.plain(Cache::open(folder.0.path(), None).unwrap_err());
        assert!(folder_itself.ends_with("is a directory"), "{folder_itself}");
    }

    #[test]
    fn damage_of_pc2_files_is_distinguished() {
        let folder = Folder::new();
        let good = pc2_bytes(1.0, 1.0, &[&A, &B]);
        let error = |bytes: &[u8]| folder.error("a.pc2", bytes, None);
        let with = |at: usize, word: [u8; 4]| {
            let mut bytes = good.clone();
            bytes[at..at + 4].copy_from_slice(&word);
            error(&bytes)
        };
        assert_eq!(error(&good[..31]), "a.pc2: is 31 bytes long, shorter than a PC2 header, 32");
        assert_eq!(with(8, *b"E3\0\0"), "a.pc2: is not a PC2 file: it does not begin with POINTCACHE2");
        assert_eq!(with(12, [2, 0, 0, 0]), "a.pc2: its version is 2; allowed: 1");
        assert_eq!(with(16, [255; 4]), "a.pc2: its header says -1 vertices; allowed: 1 to 2147483647");
        assert_eq!(with(28, [0; 4]), "a.pc2: its header says 0 samples; allowed: 1 to 1000000");
        assert_eq!(error(&good[..79]), "a.pc2: is 79 bytes long; with 2 samples of 2 vertices it has 80");
        let first = with(20, f32::INFINITY.to_le_bytes());
        assert_eq!(first, "a.pc2: sample 0: its time is inf; allowed: finite numbers");
        for step in [0.0, -1.0, f32::NAN] {
            let found = format!("a.pc2: its samples are {step} frames apart; allowed: numbers above 0");
            assert_eq!(with(24, step.to_le_bytes()), found);
        }
        // At such a time, one frame more is no later.
        assert!(with(20, 1e30f32.to_le_bytes()).ends_with("allowed: rising times"));
    }

    #[test]
    fn coordinates_are_within_reach() {
        let folder = Folder::new();
        for (x, shown) in [(f32::NAN, "NaN"), (-f32::INFINITY, "-inf"), (-1.1e18, "-1.1e18")] {
            let bad = [[0.0; 3], [1.0, x, 2.0]];
            let cache = Cache::open(&folder.write("a.pc2", &pc2_bytes(0.0, 24.0, &[&A, &bad])), None).unwrap();
            assert_eq!(at(&cache, -1.0), A);
            let error = folder.plain(cache.at(0.5, &mut Vec::new()).unwrap_err());
            assert_eq!(error, format!("a.pc2: sample 1 vertex 1: it is [1.0, {shown}, 2.0]; allowed: -1e18 to 1e18"));
        }
    }
}
