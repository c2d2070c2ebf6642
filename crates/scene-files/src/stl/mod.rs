//! STL, as text or binary.
//!
//! The format is that of the "StereoLithography Interface Specification" (3D Systems, 1989). It has neither units nor
//! axes, and no shared vertices: corners at the same position are merged.

mod text;
mod weld;

use super::FileOptions;
use glam::DVec3;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::shown;
use model::material::TextureBudget;
use model::{Mesh, Part, RawObject, RawScene, VertexSource, corners, surrounding, within_reach};
use std::path::Path;
use std::sync::Arc;
use weld::Welder;

/// Bytes before the triangles of a binary file: a text, and the triangle count.
const HEAD: usize = 84;
/// Bytes of a triangle: normal, three corners, and two without meaning.
const RECORD: usize = 50;

/// Larger scenes are probably not in metres.
const LARGE_M: f64 = 1000.0;

/// Corners of a triangle, file units.
type Triangle = [[f64; 3]; 3];

/// Reads the STL file at `path`. Each solid of a text file is an object of that name; solids without a name and the
/// contents of binary files are named after the file.
///
/// # Errors
/// A file that cannot be read or ends too early; a number that is not finite; no triangle.
pub(super) fn read(path: &Path, options: &FileOptions, _: &mut TextureBudget) -> Result<RawScene> {
    options.check_units()?;
    let bytes = read::bytes(path, Limit::SCENE)?;
    let mut maker = StlBuilder { path, options, scene: RawScene::default() };
    if is_text(&bytes) {
        let finished = text::read(path, &bytes, |name, triangles| maker.add(name, triangles.iter().copied()))?;
        if !finished {
            maker.warn("the last solid has no \"endsolid\": the file may be cut off");
        }
    } else {
        let records = records(&bytes).map_err(|message| Error::parse(path, "", message))?;
        let read = HEAD + records.len() * RECORD;
        if read < bytes.len() {
            maker.warn(&format!("{} bytes after the last triangle are not read", bytes.len() - read));
        }
        maker.add("", records.iter().map(triangle))?;
    }
    let StlBuilder { mut scene, .. } = maker;
    if scene.degenerate_triangles > 0 {
        let triangles = shown::count(scene.degenerate_triangles, "triangle");
        scene.report.warn(format!("{}: {triangles} without area left out", shown::path(path)));
    }
    warn_about_units(path, options, &mut scene);
    Ok(scene)
}

/// Whether `bytes` are text. Binary files may begin with "solid" too, but then their length fits their triangle count.
fn is_text(bytes: &[u8]) -> bool {
    /// How many bytes are searched for one that text does not contain.
    const LOOK: usize = 1024;
    let fits = count_of(bytes).is_some_and(|count| bytes.len() == HEAD + count * RECORD);
    let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    !fits
        && start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && !bytes[..bytes.len().min(LOOK)].contains(&0)
}

/// Triangle count that a binary file states.
fn count_of(bytes: &[u8]) -> Option<usize> {
    bytes.get(HEAD - 4..)?.first_chunk().map(|four| u32::from_le_bytes(*four) as usize)
}

/// The triangles of a binary file, or what is wrong with it.
fn records(bytes: &[u8]) -> Result<&[[u8; RECORD]], String> {
    let Some(count) = count_of(bytes) else {
        return Err(format!(
            "not an STL file: {} bytes that do not begin with \"solid\"; allowed: {HEAD} and more",
            bytes.len()
        ));
    };
    let records = bytes[HEAD..].as_chunks().0;
    if count == 0 {
        return Err(format!("its header states 0 triangles; {} bytes follow", bytes.len() - HEAD));
    }
    records.get(..count).ok_or_else(|| {
        format!(
            "the file is cut off, or not an STL file: its header states {count} triangles, which take {} bytes, but it has {}",
            HEAD + count * RECORD,
            bytes.len()
        )
    })
}

/// The corners in a record; its normal is redundant.
fn triangle(record: &[u8; RECORD]) -> Triangle {
    let (numbers, _) = record.as_chunks::<4>();
    let number = |at: usize| f64::from(f32::from_le_bytes(numbers[at]));
    [3, 6, 9].map(|at| [number(at), number(at + 1), number(at + 2)])
}

/// Builds objects from triangles.
struct StlBuilder<'a> {
    path: &'a Path,
    options: &'a FileOptions<'a>,
    scene: RawScene,
}

impl StlBuilder<'_> {
    /// Adds an object of `triangles`, if any has area.
    fn add(&mut self, name: &str, triangles: impl ExactSizeIterator<Item = Triangle> + Clone) -> Result<()> {
        let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
        for (number, triangle) in triangles.clone().enumerate() {
            for corner in triangle.map(DVec3::from) {
                if !within_reach(&corner) {
                    let message = format!("a corner is {:?}; allowed: -1e18 to 1e18", corner.to_array());
                    return Err(Error::parse(self.path, format!("triangle {}", number + 1), message));
                }
                (low, high) = (low.min(corner), high.max(corner));
            }
        }
        // Relative to it, single precision preserves the coordinates of text files.
        let middle = ((low + high) / 2.0).round();
        let mut welder = Welder::new(triangles.len());
        for triangle in triangles {
            welder.add(triangle.map(|corner| (DVec3::from(corner) - middle).as_vec3().to_array()));
        }
        self.scene.degenerate_triangles += welder.degenerate;
        if welder.triangles.is_empty() {
            return Ok(());
        }
        let vertices = welder.positions.len();
        let source = self.options.keeps_sources.then(|| {
            Arc::new(VertexSource { vertices: vec![(0..vertices as u32).collect()], count: vertices, origin: middle })
        });
        let part = Part::default().positions(welder.positions.into()).triangles(welder.triangles.into());
        let stem = || self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = if name.is_empty() { stem() } else { name.to_owned() };
        self.scene.objects.push(RawObject {
            name: name.clone(),
            mesh: Arc::new(Mesh::trusted(name, vec![part]).with_source(source)),
            world_from_object: self.options.world_from_mesh(middle),
            up: self.options.up,
            category: None,
            part: None,
            motion: None,
            ancestors: Arc::default(),
            has_node: false,
        });
        Ok(())
    }

    fn warn(&mut self, what: &str) {
        self.scene.report.warn(format!("{}: {what}", shown::path(self.path)));
    }
}

/// Warns about a scene that seems to be in millimetres, but was read as metres.
fn warn_about_units(path: &Path, options: &FileOptions, scene: &mut RawScene) {
    let boxes = scene.objects.iter().filter_map(|object| Some((object.mesh.bounds()?, &object.world_from_object)));
    let bounds = surrounding(boxes.flat_map(|(bounds, place)| corners(bounds, place)));
    let Some((low, high)) = bounds.filter(|_| options.scale == 1.0) else { return };
    let size = (high - low).max_element();
    if size > LARGE_M {
        scene.report.warn(format!(
            "{}: it is {size:.0} m large, as STL has no units and metres are assumed; if they are millimetres, scale \
             it by 0.001 (--scale)",
            shown::path(path)
        ));
    }
}
