//! The container of a file: GLB chunks, or plain JSON text.

/// The two payloads of a file.
#[derive(Debug)]
pub(super) struct Container<'a> {
    /// JSON text.
    pub json: &'a [u8],
    /// Bytes of the binary chunk (GLB only), padding included.
    pub bin: Option<&'a [u8]>,
}

const MAGIC: &[u8] = b"glTF";
const HEADER_BYTES: usize = 12;
const CHUNK_JSON: &[u8] = b"JSON";
const CHUNK_BIN: &[u8] = b"BIN\0";

/// Finds the payloads in the bytes of a `.glb` or `.gltf` file; the first bytes determine which it is.
pub(super) fn split(bytes: &[u8]) -> Result<Container<'_>, String> {
    if bytes.is_empty() {
        return Err("the file is empty".into());
    }
    if !bytes.starts_with(MAGIC) {
        // Some editors write a byte order mark before the text.
        return Ok(Container { json: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), bin: None });
    }
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err(format!("the file is cut off: {} bytes, a GLB header alone has {HEADER_BYTES}", bytes.len()));
    };
    if version != 2 {
        return Err(format!("GLB version {version}; allowed: 2"));
    }
    if (length as usize) > bytes.len() {
        return Err(format!("the file is cut off: {} bytes, its header says {length}", bytes.len()));
    }
    let mut rest = bytes.get(HEADER_BYTES..length as usize).unwrap_or_default();
    let json = match next_chunk(&mut rest)? {
        Some(GlbChunk { kind: CHUNK_JSON, data }) => data,
        _ => return Err("the first GLB chunk is not JSON".into()),
    };
    let mut bin = None;
    while let Some(GlbChunk { kind, data }) = next_chunk(&mut rest)? {
        // Chunks of other kinds must be skipped (glTF 2.0, 4.4.3).
        if kind == CHUNK_BIN && bin.is_none() {
            bin = Some(data);
        }
    }
    // The text is padded with spaces; some writers pad with zeros.
    let end = json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    Ok(Container { json: &json[..end], bin })
}

struct GlbChunk<'a> {
    kind: &'a [u8],
    data: &'a [u8],
}

/// Takes one chunk from the front of `rest`; `None` at the end.
fn next_chunk<'a>(rest: &mut &'a [u8]) -> Result<Option<GlbChunk<'a>>, String> {
    let (Some(length), Some(kind)) = (u32_at(rest, 0), rest.get(4..8)) else { return Ok(None) };
    let data = rest
        .get(8..)
        .and_then(|data| data.get(..length as usize))
        .ok_or_else(|| format!("the file is cut off: a chunk of {length} bytes has only {} left", rest.len() - 8))?;
    *rest = &rest[8 + data.len()..];
    Ok(Some(GlbChunk { kind, data }))
}

fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    bytes.get(offset..)?.first_chunk().map(|four| u32::from_le_bytes(*four))
}
