//! Sequences of meshes from numbered scene files: for objects whose triangles change, such as water.

use super::{LoadOptions, Scene};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use model::material::{Material, TextureBudget};
use model::motion::FPS;
use model::{Mesh, Part, beyond_reach, is_degenerate};
use scene_files::obj;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of triangles of one file; those that instances repeat count each time.
const MOST_TRIANGLES: usize = 50_000_000;

/// Meshes that replace an object's own one after another, each from a file.
#[derive(Debug)]
pub struct Sequence {
    files: Vec<PathBuf>,
    /// Files per second.
    fps: f64,
    /// Whether the first follows the last.
    looped: bool,
    /// How to read them.
    options: LoadOptions,
    /// The origin of the object's mesh in the files' coordinates.
    origin: DVec3,
    /// Name of the object's mesh.
    name: String,
    /// Material of the first part of the object's mesh.
    material: Option<Arc<Material>>,
    /// The mesh loaded last, with its index.
    last: Mutex<Option<(usize, Arc<Mesh>)>>,
}

impl Sequence {
    /// The files from `first` on, in place of `mesh`; `fps` of them per second, by default [`FPS`].
    ///
    /// # Errors
    /// A name without a number at its end; a file that is not a regular file; a gap in the numbers.
    pub(super) fn open(first: &Path, fps: Option<f64>, mesh: &Mesh, options: &LoadOptions) -> Result<Sequence> {
        Ok(Sequence {
            files: numbered(first)?,
            fps: fps.unwrap_or(FPS),
            looped: options.looped,
            options: LoadOptions {
                texture_limit_mib: options.texture_limit_mib,
                allow_outside_paths: options.allow_outside_paths,
                ..LoadOptions::default()
            },
            origin: mesh.source.as_ref().map_or(DVec3::ZERO, |source| source.origin),
            name: mesh.name.clone(),
            material: mesh.parts.first().and_then(|part| part.material.clone()),
            last: Mutex::default(),
        })
    }

    /// When each mesh appears, s. The first is also present before, the last remains; or they repeat.
    pub fn times(&self) -> impl ExactSizeIterator<Item = f64> {
        (0..self.files.len()).map(|index| index as f64 / self.fps)
    }

    /// Index of the mesh at `time`, s, from 0.
    pub fn at(&self, time: f64) -> usize {
        self.mesh_of(self.turn(time))
    }

    /// Running number of the mesh at `time`, s, counted through all repetitions.
    fn turn(&self, time: f64) -> f64 {
        // Products of times and rates miss whole numbers by the last bit.
        let near = (time * self.fps).round();
        let turn = if near / self.fps <= time { near } else { near - 1.0 };
        if self.looped { turn } else { turn.clamp(0.0, self.files.len() as f64 - 1.0) }
    }

    fn mesh_of(&self, turn: f64) -> usize {
        turn.rem_euclid(self.files.len() as f64) as usize
    }

    /// Whether the mesh is the same at all times from `from` to `to`, s.
    #[doc(hidden)]
    pub fn stays(&self, from: f64, to: f64) -> bool {
        self.files.len() == 1 || self.turn(from) == self.turn(to)
    }

    /// The indices of the meshes from `from` to `to`, s, and when each appears, s.
    #[doc(hidden)]
    pub fn between(&self, from: f64, to: f64) -> impl Iterator<Item = (usize, f64)> {
        let [first, last] = [from, to].map(|time| self.turn(time));
        // Counted, since late numbers may be too large to change when 1 is added.
        let turns = (0..=(last - first) as u64).map(move |number| first + number as f64);
        turns.map(|turn| (self.mesh_of(turn), turn / self.fps))
    }

    /// Loads mesh `index`, below the number of [`Sequence::times`]: one part, flat-shaded, with the material of the
    /// object's first part, in the frame of the object's own mesh. The mesh loaded last is kept.
    ///
    /// # Errors
    /// A file that cannot be read or holds no triangle.
    pub fn load(&self, index: usize) -> Result<Arc<Mesh>> {
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, mesh)) = &*last()
            && *known == index
        {
            return Ok(mesh.clone());
        }
        let Some(file) = self.files.get(index) else {
            return Err(Error::invalid("mesh", index, format!("0 to {}", self.files.len() - 1)));
        };
        let mesh = Arc::new(self.read(file)?);
        *last() = Some((index, mesh.clone()));
        Ok(mesh)
    }

    fn read(&self, file: &Path) -> Result<Mesh> {
        let fault = |message: String| Error::parse(file, "", message);
        let is = |known: &str| file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(known));
        let scene = if is("obj") {
            Scene::assemble(obj::read_shapes(file)?, &LoadOptions::default()).checked(file)?
        } else {
            Scene::read(file, &self.options, &mut TextureBudget::new(self.options.texture_limit_mib))?
        };
        let triangles = scene.triangle_count();
        if triangles > MOST_TRIANGLES {
            return Err(fault(format!("it has {triangles} triangles; allowed: {MOST_TRIANGLES}")));
        }
        // glTF files are y up; those without axes were read as they are.
        let turned = is("glb") || is("gltf");
        let file_from_world = |p: DVec3| if turned { DVec3::new(p.x, p.z, -p.y) } else { p };
        let part = merged(&scene, |p| file_from_world(p) - self.origin);
        if let Some(vertex) = beyond_reach(&part.positions) {
            return Err(fault(format!("vertex {vertex} is {:?}; allowed: -1e18 to 1e18", part.positions[vertex])));
        }
        if part.triangles.is_empty() {
            return Err(fault("no triangle to scan: the file holds no mesh with area".into()));
        }
        let mesh = Mesh::trusted(self.name.clone(), vec![part.material(self.material.clone())]);
        Ok(mesh.changing())
    }
}

/// All triangles of `scene`, with the vertices that they use, in the frame that `local_from_world` transforms to.
fn merged(scene: &Scene, local_from_world: impl Fn(DVec3) -> DVec3) -> Part {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for object in &scene.objects {
        let place = &object.world_from_object;
        let mirrored = place.matrix3.determinant() < 0.0;
        for part in &object.mesh.parts {
            // Parts may share more vertices than each of them uses.
            let mut places = vec![u32::MAX; part.positions.len()];
            for &[a, b, c] in part.triangles.iter() {
                let corners = if mirrored { [a, c, b] } else { [a, b, c] };
                let corners = corners.map(|vertex| {
                    let known = &mut places[vertex as usize];
                    if *known == u32::MAX {
                        *known = positions.len() as u32;
                        let position = DVec3::from(part.positions[vertex as usize].map(f64::from));
                        positions.push(local_from_world(place.transform_point3(position)).as_vec3().to_array());
                    }
                    *known
                });
                let [a, b, c] = corners.map(|vertex| positions[vertex as usize]);
                if !is_degenerate(a, b, c) {
                    triangles.push(corners);
                }
            }
        }
    }
    Part::default().positions(positions.into()).triangles(triangles.into())
}

/// `first` and the files that follow it.
fn numbered(first: &Path) -> Result<Vec<PathBuf>> {
    let fault = || {
        let name = first.file_name().unwrap_or_default();
        let found = format!("is named {:?}", shown::name(&shown::path(Path::new(name))));
        Error::parse(first, "", format!("{found}; allowed: a number before the ending, as in water_0001.obj"))
    };
    let stem = first.file_stem().and_then(|stem| stem.to_str()).ok_or_else(fault)?;
    let ending = first.extension().and_then(|ending| ending.to_str()).ok_or_else(fault)?;
    let text = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let digits = &stem[text.len()..];
    let start: u32 = digits.parse().map_err(|_| fault())?;
    let name = |number: u32| format!("{text}{number:0width$}.{ending}", width = digits.len());
    let mut files = Vec::new();
    for number in start..=u32::MAX {
        let file = first.with_file_name(name(number));
        // Opened, so that they are recorded as files of the scene, and to rule out pipes.
        match read::open(&file, Limit::SCENE) {
            Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound && number > start => break,
            opened => drop(opened?),
        }
        files.push(file);
    }
    let missing = start.saturating_add(files.len() as u32);
    let folder = first.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let fault = |source| Error::io(folder, source);
    let mut next = None;
    for file in fs::read_dir(folder).map_err(fault)? {
        let file = file.map_err(fault)?.file_name();
        let digits = file.to_str().and_then(|file| file.strip_prefix(text)?.strip_suffix(ending)?.strip_suffix('.'));
        let number = digits.and_then(|digits| digits.parse().ok()).filter(|number| *number > missing);
        if let Some(number) = number.filter(|number| Some(name(*number).as_str()) == file.to_str()) {
            next = Some(next.map_or(number, |next: u32| next.min(number)));
        }
    }
    match next {
        None => Ok(files),
        Some(next) => {
            let found = format!("is missing, while {:?} is there; allowed: numbers without a gap", name(next));
            Err(Error::parse(first.with_file_name(name(missing)), "", found))
        }
    }
}
