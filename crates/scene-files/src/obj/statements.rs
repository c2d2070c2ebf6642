//! The statements of an OBJ file, as written: vertices, faces, names.

use super::text::{Text, quoted};
use crate::faces::{Corner, Faces, NONE};
use glam::DVec3;
use ground::error::{Error, Result};
use ground::shown;
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

/// The contents of an OBJ file.
#[derive(Default)]
pub(super) struct Statements {
    /// `v`, `vt`, `vn` and `f`.
    pub faces: Faces,
    /// Runs of faces with the same object, group and material, in the file's order.
    pub runs: Vec<FaceRun>,
    /// Names of `o`: each statement starts an object, even with a repeated name.
    pub objects: Names,
    /// Names of `g`.
    pub groups: Names,
    /// Names of `usemtl`.
    pub materials: Names,
    /// Arguments of each `mtllib`.
    pub libraries: Names,
    /// Warnings about what was skipped.
    pub warnings: Vec<String>,
}

/// Consecutive faces with the same object, group and material, which are numbers in their [`Names`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FaceRun {
    pub object: usize,
    pub group: usize,
    pub material: usize,
    /// First face.
    pub start: usize,
    /// One past the last face.
    pub end: usize,
}

impl FaceRun {
    pub fn faces(&self) -> Range<usize> {
        self.start..self.end
    }
}

/// Names in the order in which they first occur. Number 0 means no name.
pub(super) struct Names {
    numbers: HashMap<String, usize>,
    pub list: Vec<String>,
}

impl Default for Names {
    fn default() -> Self {
        Names { numbers: HashMap::from([(String::new(), 0)]), list: vec![String::new()] }
    }
}

impl Names {
    /// A new number for a name, which may be a repeated one.
    fn add(&mut self, name: String) -> usize {
        if name.is_empty() {
            return 0;
        }
        self.list.push(name);
        self.list.len() - 1
    }

    fn number(&mut self, name: String) -> usize {
        let next = self.list.len();
        *self.numbers.entry(name).or_insert_with_key(|name| {
            self.list.push(name.clone());
            next
        })
    }

    /// The names, without the empty one.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.list[1..].iter().map(String::as_str)
    }
}

/// The range of the indices of one kind: faces may come before what they refer to, so it can be checked only at the
/// end.
#[derive(Default)]
struct IndexReach {
    highest: i64,
    highest_line: usize,
    before_first: Option<(i64, usize)>,
}

impl IndexReach {
    /// Zero-based index for the file's `index`, which is positive from the first or negative from the last of `count`.
    #[inline]
    fn resolve(&mut self, index: i64, count: usize, line: usize) -> u32 {
        let position = if index > 0 {
            if index > self.highest && index > count as i64 {
                (self.highest, self.highest_line) = (index, line);
            }
            index - 1
        } else {
            count as i64 + index
        };
        u32::try_from(position).unwrap_or_else(|_| {
            if position < 0 {
                self.before_first.get_or_insert((index, line));
            }
            NONE
        })
    }

    /// An index out of range, and its line.
    fn stray(&self, count: usize) -> Option<(i64, usize)> {
        self.before_first.or((self.highest > count as i64).then_some((self.highest, self.highest_line)))
    }
}

/// A kind of skipped statement: how many there are and where the first is.
#[derive(Default)]
struct Skipped {
    count: usize,
    first: Option<(usize, String)>,
}

impl Skipped {
    fn add(&mut self, line: usize, word: &[u8]) {
        self.count += 1;
        self.first.get_or_insert_with(|| (line, quoted(word)));
    }

    fn warning(&self, path: &Path, what: &str) -> Option<String> {
        let (line, word) = self.first.as_ref()?;
        Some(format!("{}: line {line}: {word}: {what} skipped, {} in all", shown::path(path), self.count))
    }
}

impl Statements {
    /// Reads `bytes`, the content of the file at `path`.
    ///
    /// # Errors
    /// UTF-16 text, an invalid number, a vertex index out of range, no face at all.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut text = Text::new(path, bytes)?;
        let mut file = Statements::default();
        let mut faces = Faces::default();
        let mut run = FaceRun::default();
        let (mut vertex, mut texcoord, mut normal) =
            (IndexReach::default(), IndexReach::default(), IndexReach::default());
        let (mut small, mut curved, mut unknown) = (Skipped::default(), Skipped::default(), Skipped::default());
        while text.next_statement() {
            let line = text.line();
            match text.word() {
                // What follows (weight, colour) does not affect the shape of a polygon.
                b"v" => faces.positions.push([text.number()?, text.number()?, text.number()?]),
                b"vn" => {
                    let normal = DVec3::new(text.number()?, text.number()?, text.number()?);
                    faces.normals.push(normal.normalize_or_zero().as_vec3().to_array());
                }
                b"vt" => {
                    let u = text.number()? as f32;
                    let v = if text.statement_is_over() { 0.0 } else { text.number()? as f32 };
                    faces.texcoords.push([u, v]);
                }
                word @ (b"f" | b"fo") => {
                    let start = faces.corners.len();
                    while !text.statement_is_over() {
                        let [v, vt, vn] = text.corner()?;
                        let corner = Corner {
                            position: vertex.resolve(v, faces.positions.len(), text.line()),
                            texcoord: if vt == 0 {
                                NONE
                            } else {
                                texcoord.resolve(vt, faces.texcoords.len(), text.line())
                            },
                            normal: if vn == 0 { NONE } else { normal.resolve(vn, faces.normals.len(), text.line()) },
                        };
                        faces.corners.push(corner);
                    }
                    if faces.corners.len() - start < 3 {
                        small.add(line, word);
                        faces.corners.truncate(start);
                    } else {
                        faces.face_ends.push(faces.corners.len());
                    }
                }
                b"o" => {
                    let object = file.objects.add(text.rest());
                    file.start_run(&mut run, faces.face_ends.len(), |run| run.object = object);
                }
                b"g" => {
                    let group = file.groups.number(text.rest());
                    file.start_run(&mut run, faces.face_ends.len(), |run| run.group = group);
                }
                b"usemtl" => {
                    let material = file.materials.number(text.rest());
                    file.start_run(&mut run, faces.face_ends.len(), |run| run.material = material);
                }
                b"mtllib" => {
                    file.libraries.number(text.rest());
                }
                // Points, lines, smoothing groups and drawing hints: nothing that a beam can hit.
                b"p" | b"l" | b"s" | b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj"
                | b"trace_obj" => {}
                word @ (b"vp" | b"cstype" | b"deg" | b"bmat" | b"step" | b"curv" | b"curv2" | b"surf" | b"parm"
                | b"trim" | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"ctech" | b"stech") => {
                    curved.add(line, word)
                }
                word => unknown.add(line, word),
            }
            text.skip_statement();
        }
        file.start_run(&mut run, faces.face_ends.len(), |_| {});

        faces.check_size().map_err(|message| Error::parse(path, "", message))?;
        if let Some((index, line)) = vertex.stray(faces.positions.len()) {
            let message = format!("vertex index {index} of {}", faces.positions.len());
            return Err(Error::parse(path, format!("line {line}"), message));
        }
        let stray = |reach: &IndexReach, count: usize, what: &str| {
            let (index, line) = reach.stray(count)?;
            Some(format!(
                "{}: line {line}: {what} index {index} of {count}: such corners have no {what}",
                shown::path(path)
            ))
        };
        file.warnings = [
            stray(&texcoord, faces.texcoords.len(), "texture coordinate"),
            stray(&normal, faces.normals.len(), "normal"),
            small.warning(path, "faces with fewer than 3 corners are"),
            curved.warning(path, "curve and surface statements are"),
            unknown.warning(path, "unknown statements are"),
        ]
        .into_iter()
        .flatten()
        .collect();
        if faces.face_ends.is_empty() {
            let skipped = file.warnings.first().map(|warning| format!("; {warning}")).unwrap_or_default();
            return Err(Error::parse(path, "", format!("the file holds no face (f) with 3 or more corners{skipped}")));
        }
        file.faces = faces;
        Ok(file)
    }

    /// Ends the current run of faces, of which there are `faces` so far, and lets `change` set up the next.
    fn start_run(&mut self, run: &mut FaceRun, faces: usize, change: impl FnOnce(&mut FaceRun)) {
        run.end = faces;
        if run.end > run.start {
            self.runs.push(*run);
        }
        run.start = run.end;
        change(run);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Statements> {
        Statements::parse(Path::new("scene.obj"), text.as_bytes())
    }

    fn error(text: &str) -> String {
        parse(text).err().expect("an error").to_string()
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    #[test]
    fn indices_count_from_either_end() {
        let file = parse(&format!("{TRIANGLE}vt 0 0\nvn 0 0 1\nf -3/-1/-1 2//1 3/1\nv 2 2 2\nf -1 -2 1")).unwrap();
        let corner = |position, texcoord, normal| Corner { position, texcoord, normal };
        assert_eq!(file.faces.corners[..3], [corner(0, 0, 0), corner(1, NONE, 0), corner(2, 0, NONE)]);
        assert_eq!(file.faces.corners[3..], [corner(3, NONE, NONE), corner(2, NONE, NONE), corner(0, NONE, NONE)]);
        assert!(file.warnings.is_empty());
        assert!(parse(&format!("f 1 2 3\n{TRIANGLE}")).is_ok(), "faces may come first");
    }

    #[test]
    fn vertex_indices_out_of_range_are_errors() {
        assert_eq!(error(&format!("{TRIANGLE}f 1 2 3\nf 1 2 9\nf 1 2 7")), "scene.obj: line 5: vertex index 9 of 3");
        assert_eq!(error(&format!("{TRIANGLE}f 1 2 -4")), "scene.obj: line 4: vertex index -4 of 3");
        let huge = error(&format!("{TRIANGLE}f 1 2 99999999999999999999"));
        assert_eq!(huge, "scene.obj: line 4: vertex index 9223372036854775807 of 3");
        let huge = error(&format!("{TRIANGLE}f 1 2 -99999999999999999999"));
        assert_eq!(huge, "scene.obj: line 4: vertex index -9223372036854775807 of 3");
        assert!(error(&format!("{TRIANGLE}f 1 2 0")).starts_with("scene.obj: line 4: \"0\" is not a face corner"));
    }

    #[test]
    fn other_indices_out_of_range_cause_warnings() {
        let file = parse(&format!("{TRIANGLE}vn 0 0 1\nf 1/1/1 2/5/-2 3/2/2")).unwrap();
        assert_eq!(
            file.warnings,
            [
                "scene.obj: line 5: texture coordinate index 5 of 0: such corners have no texture coordinate",
                "scene.obj: line 5: normal index -2 of 1: such corners have no normal"
            ]
        );
    }

    #[test]
    fn bad_numbers_name_the_line() {
        assert_eq!(error("v 0 0 0\nv 1 nan 0"), "scene.obj: line 2: \"nan\" is not a finite number");
        assert_eq!(error("v 0 0"), "scene.obj: line 1: a number is missing");
        assert_eq!(error("v 0 0 \\\n x"), "scene.obj: line 2: \"x\" is not a finite number");
        assert_eq!(error("vn 0 0 1e300"), "scene.obj: line 1: \"1e300\" is too large; allowed: -1e18 to 1e18");
        assert_eq!(error("vt"), "scene.obj: line 1: a number is missing");
    }

    #[test]
    fn what_cannot_be_scanned_is_skipped_with_a_warning() {
        let file =
            parse(&format!("{TRIANGLE}f 1 2\nf 1 2 3\nf\nl 1 2\np 1\ns off\ncurv 0 1 1 2 \\\n3 4\nsurf 0\nhello\n"));
        assert_eq!(
            file.unwrap().warnings,
            [
                "scene.obj: line 4: \"f\": faces with fewer than 3 corners are skipped, 2 in all",
                "scene.obj: line 10: \"curv\": curve and surface statements are skipped, 2 in all",
                "scene.obj: line 13: \"hello\": unknown statements are skipped, 1 in all"
            ]
        );
        assert_eq!(error(TRIANGLE), "scene.obj: the file holds no face (f) with 3 or more corners");
        assert_eq!(error(""), "scene.obj: the file holds no face (f) with 3 or more corners");
        assert!(error("surf 1").contains("no face (f) with 3 or more corners; scene.obj: line 1: \"surf\": curve"));
    }

    #[test]
    fn runs_follow_the_names() {
        let faces = "f 1 2 3\n";
        let text = format!(
            "{TRIANGLE}{faces}o a\ng x\n{faces}{faces}usemtl m n\n{faces}usemtl\no \tb c\t\r\ng\n{faces}o a\n{faces}"
        );
        let file = parse(&text).unwrap();
        let runs: Vec<_> = file.runs.iter().map(|r| (r.object, r.group, r.material, r.start..r.end)).collect();
        assert_eq!(runs, [(0, 0, 0, 0..1), (1, 1, 0, 1..3), (1, 1, 1, 3..4), (2, 0, 0, 4..5), (3, 0, 0, 5..6)]);
        assert_eq!(file.objects.iter().collect::<Vec<_>>(), ["a", "b c", "a"]);
        assert_eq!(file.materials.iter().collect::<Vec<_>>(), ["m n"]);
        assert_eq!(file.faces.of(&file.runs[1].faces()).map(<[_]>::len).collect::<Vec<_>>(), [3, 3]);
    }
}
