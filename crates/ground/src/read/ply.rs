//! The header of a PLY file, of a mesh or a point cloud: which numbers follow, in which order.

use crate::read::number::Number;

/// Content of a header.
#[derive(Debug)]
pub struct PlyHeader {
    /// How the rows are written.
    pub encoding: Encoding,
    /// Groups of rows, in the order of the file.
    pub elements: Vec<PlyElement>,
    /// Images that comments name (`TextureFile`, as MeshLab and Metashape write it).
    pub textures: Vec<String>,
    /// Rows and columns of an organised cloud.
    pub grid: [Option<u32>; 2],
    /// Offset of the first row, bytes.
    pub length: usize,
    /// Lines before the rows.
    pub lines: usize,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// As text, with white space between numbers.
    Text,
    /// Binary, least significant byte first.
    Little,
    /// Binary, most significant byte first.
    Big,
}

/// Rows with the same properties.
#[derive(Debug)]
pub struct PlyElement {
    /// As in the header: `vertex`, `face` or whatever the file has.
    pub name: String,
    /// Number of rows.
    pub count: u64,
    /// What each row holds, in this order.
    pub properties: Vec<PlyProperty>,
}

/// A number of each row, or a list of them.
#[derive(Debug)]
pub struct PlyProperty {
    /// As in the header, such as `x` or `vertex_indices`.
    pub name: String,
    /// Type of the number, or of those in the list.
    pub kind: Number,
    /// For a list: the type of its length.
    pub length: Option<Number>,
}

/// The type with this name: those of the format, and further names that other programs use.
fn named(name: &str) -> Option<Number> {
    Some(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "long" | "int64" => Number::I64,
        "ulong" | "uint64" => Number::U64,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}

impl PlyHeader {
    /// Reads the header at the start of `bytes`; on failure, the line and what is wrong with it.
    pub fn parse(bytes: &[u8]) -> Result<PlyHeader, (usize, String)> {
        let Some(rest) = bytes.strip_prefix(b"ply") else {
            return Err((1, "not a PLY file: it does not begin with \"ply\"".into()));
        };
        // Old programs end lines with a carriage return alone.
        let end = if rest.first() == Some(&b'\r') && rest.get(1) != Some(&b'\n') { b'\r' } else { b'\n' };
        let mut header = PlyHeader {
            encoding: Encoding::Text,
            elements: Vec::new(),
            textures: Vec::new(),
            grid: [None; 2],
            length: 0,
            lines: 0,
        };
        let mut encoding = None;
        for (number, line) in bytes.split(|&byte| byte == end).enumerate() {
            header.length += line.len() + 1;
            let text = String::from_utf8_lossy(line);
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            let fault = |message: String| (number + 1, message);
            match words[..] {
                ["obj_info", "num_rows", rows] => header.grid[0] = rows.parse().ok(),
                ["obj_info", "num_cols", columns] => header.grid[1] = columns.parse().ok(),
                [] | ["obj_info", ..] => {}
                ["ply"] if number == 0 => {}
                ["comment", "TextureFile", ..] => {
                    let name = text.trim_start().trim_start_matches("comment").trim_start();
                    header.textures.push(name.trim_start_matches("TextureFile").trim().to_owned());
                }
                ["comment", ..] => {}
                ["format", name, ..] => {
                    encoding = Some(match name {
                        "ascii" => Encoding::Text,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        other => {
                            let allowed = "ascii, binary_little_endian, binary_big_endian";
                            return Err(fault(format!("format {other:?}; allowed: {allowed}")));
                        }
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| fault(format!("{count:?} is not a number of elements")))?;
                    header.elements.push(PlyElement { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", "list", length, kind, name] => {
                    let length = known(length).map_err(fault)?;
                    header.property(name, kind, Some(length)).map_err(fault)?;
                }
                ["property", kind, name] => header.property(name, kind, None).map_err(fault)?,
                ["end_header"] => {
                    header.encoding = encoding.ok_or_else(|| fault("the header has no line \"format\"".into()))?;
                    header.lines = number + 1;
                    header.length = header.length.min(bytes.len());
                    return Ok(header);
                }
                _ => {
                    let allowed = "format, comment, obj_info, element NAME COUNT, property TYPE NAME, \
                                   property list TYPE TYPE NAME, end_header";
                    let text: String = text.chars().take(40).collect();
                    return Err(fault(format!("{text:?} is not a line of a PLY header; allowed: {allowed}")));
                }
            }
        }
        Err((
            bytes.split(|&byte| byte == end).count(),
            "the file is cut off: its header has no line \"end_header\"".into(),
        ))
    }

    fn property(&mut self, name: &str, kind: &str, length: Option<Number>) -> Result<(), String> {
        let kind = known(kind)?;
        let element = self.elements.last_mut().ok_or("a property comes before the first element")?;
        element.properties.push(PlyProperty { name: name.to_owned(), kind, length });
        Ok(())
    }
}

fn known(kind: &str) -> Result<Number, String> {
    const ALLOWED: &str = "char, uchar, short, ushort, int, uint, float, double, int8 to int64, uint8 to uint64, \
                           float32, float64";
    named(kind).ok_or_else(|| format!("{kind:?} is not a number type; allowed: {ALLOWED}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ply\nformat binary_little_endian 1.0\ncomment made by hand\ncomment TextureFile my wall.png\n\
        element vertex 3\nproperty float x\nproperty double y\nobj_info x\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";

    #[test]
    fn headers_are_read_with_all_line_ends() {
        for end in ["\n", "\r\n", "\r"] {
            let text = HEADER.replace('\n', end) + "rows";
            let header = PlyHeader::parse(text.as_bytes()).unwrap();
            assert_eq!((header.encoding, header.lines), (Encoding::Little, 11), "{end:?}");
            assert_eq!(&text[header.length..], "rows");
            assert_eq!(header.textures, ["my wall.png"]);
            let counts: Vec<_> =
                header.elements.iter().map(|e| (e.name.as_str(), e.count, e.properties.len())).collect();
            assert_eq!(counts, [("vertex", 3, 2), ("face", 1, 1)]);
            let faces = &header.elements[1].properties[0];
            assert_eq!((faces.kind, faces.length), (Number::I32, Some(Number::U8)));
        }
        assert_eq!(PlyHeader::parse(HEADER.trim_end().as_bytes()).unwrap().length, HEADER.len() - 1);
    }

    #[test]
    fn errors_name_their_line() {
        let error = |from: &str, to: &str| PlyHeader::parse(HEADER.replace(from, to).as_bytes()).unwrap_err();
        assert_eq!(error("ply", "obj").0, 1);
        assert_eq!(
            error("end_header", "comment"),
            (12, "the file is cut off: its header has no line \"end_header\"".into())
        );
        assert!(error("format binary_little_endian 1.0", "").1.contains("no line \"format\""));
        for (from, to, line, part) in [
            ("binary_little_endian", "binary", 2, "\"binary\"; allowed: ascii"),
            ("vertex 3", "vertex -3", 5, "\"-3\" is not a number"),
            ("vertex 3", "vertex 99999999999999999999999", 5, "is not a number"),
            ("float", "half", 6, "\"half\" is not a number type"),
            ("uchar int", "uchar bit", 10, "\"bit\" is not a number type"),
            ("element vertex 3", "", 6, "before the first element"),
            ("obj_info", "info", 8, "\"info x\" is not a line"),
        ] {
            let (found, message) = error(from, to);
            assert!(found == line && message.contains(part), "{found}: {message}");
        }
    }
}
