//! Buffer views compressed by meshoptimizer: `EXT_meshopt_compression` and `KHR_meshopt_compression`, whose appendices
//! describe the streams and filters.

use super::{GltfDocument, place};
use gltf::json::buffer::View;
use ground::error::Result;
use ground::read::yaml;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;

pub(super) const EXTENSIONS: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Decoded bytes allowed per byte of a file. A byte of a legitimate stream rarely holds more than 20; one of zeros
/// alone holds a thousand.
const EXPANSION_LIMIT: usize = 256;

/// How a view is compressed.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct MeshoptCompression {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: Mode,
    #[serde(default)]
    filter: MeshoptFilter,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum MeshoptFilter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Whether a buffer is only a fallback for data that is compressed elsewhere.
pub(super) fn is_fallback(buffer: &gltf::json::Buffer) -> bool {
    let others = buffer.extensions.as_ref().map(|all| &all.others);
    EXTENSIONS.iter().any(|name| {
        let flag = others.and_then(|others| others.get(*name)).and_then(|value| value.get("fallback"));
        flag == Some(&Value::Bool(true))
    })
}

/// The contents of compressed views, by their number.
///
/// # Errors
/// A description that does not fit, a stream that is damaged; more than a file of this size should hold.
pub(super) fn decode(
    document: &GltfDocument<'_>,
    buffers: &[&[u8]],
    file_bytes: usize,
) -> Result<HashMap<usize, Vec<u8>>> {
    let mut budget = file_bytes.saturating_mul(EXPANSION_LIMIT).saturating_add(1 << 20);
    let mut decoded = HashMap::new();
    for (index, view) in document.json.buffer_views.iter().enumerate() {
        let Some((name, value)) = compression(view) else { continue };
        let bytes = read(value, buffers, view, &mut budget).map_err(|message| {
            document.error(place("buffer view", index, view.name.as_deref()), format!("{name}: {message}"))
        })?;
        decoded.insert(index, bytes);
    }
    Ok(decoded)
}

fn compression(view: &View) -> Option<(&'static str, &Value)> {
    let others = &view.extensions.as_ref()?.others;
    EXTENSIONS.into_iter().find_map(|name| Some((name, others.get(name)?)))
}

/// The bytes of a view that `value` describes.
fn read(value: &Value, buffers: &[&[u8]], view: &View, budget: &mut usize) -> Result<Vec<u8>, String> {
    let MeshoptCompression { buffer, byte_offset, byte_length, byte_stride: stride, count, mode, filter } =
        Deserialize::deserialize(value).map_err(|error: serde_json::Error| yaml::plain(&error.to_string()))?;
    let allowed: (&[usize], &str) = match (mode, filter) {
        (Mode::Attributes, MeshoptFilter::None | MeshoptFilter::Exponential) => (&[], "4 to 256 in steps of 4"),
        (Mode::Attributes, MeshoptFilter::Octahedral | MeshoptFilter::Color) => (&[4, 8], "4, 8"),
        (Mode::Attributes, MeshoptFilter::Quaternion) => (&[8], "8"),
        (Mode::Triangles | Mode::Indices, MeshoptFilter::None) => (&[2, 4], "2, 4"),
        _ => return Err("indices with a filter; allowed: NONE".into()),
    };
    let any = allowed.0.is_empty() && (4..=256).contains(&stride) && stride % 4 == 0;
    if !any && !allowed.0.contains(&stride) {
        return Err(format!("its byteStride is {stride}; allowed: {}", allowed.1));
    }
    if mode == Mode::Triangles && count % 3 != 0 {
        return Err(format!("its count is {count}; allowed: multiples of 3"));
    }
    let size = count.checked_mul(stride).filter(|&size| view.byte_length.0 == size as u64);
    let size = size.ok_or_else(|| {
        format!("{count} elements of {stride} bytes are not the byteLength of the view, {}", view.byte_length.0)
    })?;
    let source = buffers
        .get(buffer)
        .and_then(|bytes| bytes.get(byte_offset..)?.get(..byte_length))
        .ok_or_else(|| format!("{byte_length} bytes from byte {byte_offset} on are not in buffer {buffer}"))?;
    *budget = budget.checked_sub(size).ok_or_else(|| {
        format!("{size} bytes are too much: the file would become more than {EXPANSION_LIMIT} times its size")
    })?;
    let damaged = || "the compressed data is damaged".to_owned();
    match mode {
        Mode::Attributes => {
            let mut data = attributes(source, count, stride).ok_or_else(damaged)?;
            match filter {
                MeshoptFilter::None => {}
                MeshoptFilter::Octahedral if stride == 4 => on_bytes(&mut data, octahedral, 127.0),
                MeshoptFilter::Octahedral => on_shorts(&mut data, octahedral, 32767.0),
                MeshoptFilter::Quaternion => on_shorts(&mut data, quaternion, 32767.0),
                MeshoptFilter::Exponential => exponential(&mut data),
                MeshoptFilter::Color if stride == 4 => on_bytes(&mut data, color, 255.0),
                MeshoptFilter::Color => on_shorts(&mut data, color, 65535.0),
            }
            Ok(data)
        }
        Mode::Triangles => Ok(packed(&triangles(source, count).ok_or_else(damaged)?, stride)),
        Mode::Indices => Ok(packed(&indices(source, count).ok_or_else(damaged)?, stride)),
    }
}

/// Indices as little-endian numbers of `stride` bytes.
fn packed(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

/// A stream, read from the front.
struct MeshoptStream<'a>(&'a [u8]);

impl<'a> MeshoptStream<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|byte| byte[0])
    }

    /// An unsigned LEB128 number; the bits past the 32nd are dropped.
    fn number(&mut self) -> Option<u32> {
        let mut value = 0u32;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }
}

fn unzigzag(value: u32) -> u32 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

/// Mode 0: `count` elements of `stride` bytes; `None` for a damaged stream.
fn attributes(source: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    const GROUP: usize = 16;
    let (&head, rest) = source.split_first()?;
    let version = match head {
        0xa0 => 0,
        0xa1 => 1,
        _ => return None,
    };
    let channels = stride / 4;
    let tail = stride + if version == 1 { channels } else { 0 };
    let padded = tail.max(if version == 1 { 24 } else { 32 });
    let (body, end) = rest.split_at_checked(rest.len().checked_sub(padded)?)?;
    let end = &end[padded - tail..];
    let (mut previous, modes) = (end[..stride].to_vec(), &end[stride..]);
    if modes.iter().any(|mode| mode & 15 > 2 || (mode & 15 < 2 && mode >> 4 != 0)) {
        return None;
    }
    let mut stream = MeshoptStream(body);
    let mut data = vec![0; count * stride];
    let most = ((8192 / stride) & !15).min(256);
    // The deltas of a block, byte position by byte position.
    let mut deltas = vec![[0u8; 256]; stride];
    for block in data.chunks_mut(most * stride) {
        let elements = block.len() / stride;
        let controls = if version == 1 { stream.take(channels)? } else { &[] };
        for (position, deltas) in deltas.iter_mut().enumerate() {
            let control = controls.get(position / 4).map_or(4, |byte| byte >> (position % 4 * 2) & 3);
            let deltas = &mut deltas[..elements.next_multiple_of(GROUP)];
            match control {
                2 => deltas.fill(0),
                3 => deltas[..elements].copy_from_slice(stream.take(elements)?),
                _ => {
                    let bits = match control {
                        0 => [0, 1, 2, 4],
                        1 => [1, 2, 4, 8],
                        _ => [0, 2, 4, 8],
                    };
                    let heads = stream.take(deltas.len().div_ceil(4 * GROUP))?;
                    for (group, deltas) in deltas.as_chunks_mut::<GROUP>().0.iter_mut().enumerate() {
                        let mode = heads[group / 4] >> (group % 4 * 2) & 3;
                        unpack(&mut stream, bits[usize::from(mode)], deltas)?;
                    }
                }
            }
        }
        for (number, element) in block.chunks_exact_mut(stride).enumerate() {
            for (channel, (element, previous)) in
                element.as_chunks_mut::<4>().0.iter_mut().zip(previous.as_chunks_mut::<4>().0).enumerate()
            {
                let delta = std::array::from_fn(|byte| deltas[channel * 4 + byte][number]);
                *previous = apply(modes.get(channel).copied().unwrap_or(0), delta, *previous);
                *element = *previous;
            }
        }
    }
    stream.0.is_empty().then_some(data)
}

/// Sixteen numbers of `bits` bits; those that do not fit follow as bytes.
fn unpack(stream: &mut MeshoptStream<'_>, bits: usize, deltas: &mut [u8; 16]) -> Option<()> {
    match bits {
        0 => deltas.fill(0),
        8 => deltas.copy_from_slice(stream.take(16)?),
        _ => {
            let packed = stream.take(2 * bits)?;
            let sentinel = (1u8 << bits) - 1;
            for (number, delta) in deltas.iter_mut().enumerate() {
                let bit = number * bits;
                // Single bits count from the lowest up, others from the highest down.
                let shift = if bits == 1 { bit % 8 } else { 8 - bits - bit % 8 };
                let value = packed[bit / 8] >> shift & sentinel;
                *delta = if value == sentinel { stream.byte()? } else { value };
            }
        }
    }
    Some(())
}

/// Four bytes of an element, from their deltas and those of the element before.
fn apply(mode: u8, delta: [u8; 4], previous: [u8; 4]) -> [u8; 4] {
    match mode & 15 {
        0 => std::array::from_fn(|byte| previous[byte].wrapping_add(unzigzag(u32::from(delta[byte])) as u8)),
        1 => {
            let half = |at: usize| {
                let number = |four: [u8; 4]| u16::from_le_bytes([four[at], four[at + 1]]);
                number(previous).wrapping_add(unzigzag(u32::from(number(delta))) as u16).to_le_bytes()
            };
            let ([a, b], [c, d]) = (half(0), half(2));
            [a, b, c, d]
        }
        _ => {
            let turned = u32::from_le_bytes(delta).rotate_left(u32::from(mode >> 4));
            (u32::from_le_bytes(previous) ^ turned).to_le_bytes()
        }
    }
}

/// The newest items, at most sixteen.
struct Fifo<T> {
    newest: [T; 16],
    pushed: usize,
}

impl<T: Copy> Fifo<T> {
    fn new(empty: T) -> Self {
        Fifo { newest: [empty; 16], pushed: 0 }
    }

    fn push(&mut self, value: T) {
        self.newest[self.pushed % 16] = value;
        self.pushed += 1;
    }

    /// The item that was pushed before `back` others.
    fn get(&self, back: usize) -> Option<T> {
        (back < self.pushed.min(16)).then(|| self.newest[(self.pushed - 1 - back) % 16])
    }
}

/// The state of decoding triangles.
struct TriangleDecoder<'a> {
    data: MeshoptStream<'a>,
    next: u32,
    last: u32,
    edges: Fifo<[u32; 2]>,
    vertices: Fifo<u32>,
}

impl TriangleDecoder<'_> {
    fn fresh(&mut self) -> u32 {
        let fresh = self.next;
        self.next = fresh.wrapping_add(1);
        fresh
    }

    fn explicit(&mut self) -> Option<u32> {
        self.last = self.last.wrapping_add(unzigzag(self.data.number()?));
        Some(self.last)
    }

    /// A corner by four bits of a code: a new vertex, a recent one, or one from the data; and whether to keep it as
    /// recent.
    fn corner(&mut self, code: u8) -> Option<(u32, bool)> {
        Some(match code {
            0 => (self.fresh(), true),
            15 => (self.explicit()?, true),
            _ => (self.vertices.get(usize::from(code) - 1)?, false),
        })
    }

    fn next(&mut self, code: u8, table: &[u8]) -> Option<[u32; 3]> {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let [a, b] = self.edges.get(usize::from(high))?;
            let (c, keep) = match low {
                13 | 14 => {
                    self.last = if low == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                    (self.last, true)
                }
                0 => (self.fresh(), true),
                15 => (self.explicit()?, true),
                _ => (self.vertices.get(usize::from(low))?, false),
            };
            self.edges.push([c, b]);
            self.edges.push([a, c]);
            if keep {
                self.vertices.push(c);
            }
            return Some([a, b, c]);
        }
        let corners = match low {
            14 | 15 => self.data.byte()?,
            _ => table[usize::from(low)],
        };
        if low >= 14 && corners == 0 {
            self.next = 0;
        }
        let a = if low == 15 { self.explicit()? } else { self.fresh() };
        let (b, keep_b) = self.corner(corners >> 4)?;
        let (c, keep_c) = self.corner(corners & 15)?;
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        self.vertices.push(a);
        if keep_b {
            self.vertices.push(b);
        }
        if keep_c {
            self.vertices.push(c);
        }
        Some([a, b, c])
    }
}

/// Mode 1: `count` corners of triangles; `None` for a damaged stream.
fn triangles(source: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut stream = MeshoptStream(source);
    // The extension never used version 0.
    if stream.byte()? != 0xe1 {
        return None;
    }
    let codes = stream.take(count / 3)?;
    let data = stream.take(stream.0.len().checked_sub(16)?)?;
    let table = stream.0;
    if table[14..] != [0, 0] || table.iter().any(|entry| entry >> 4 == 15 || entry & 15 == 15) {
        return None;
    }
    let mut state = TriangleDecoder {
        data: MeshoptStream(data),
        next: 0,
        last: 0,
        edges: Fifo::new([0; 2]),
        vertices: Fifo::new(0),
    };
    let mut corners = Vec::with_capacity(count);
    for code in codes {
        corners.extend(state.next(*code, table)?);
    }
    state.data.0.is_empty().then_some(corners)
}

/// Mode 2: `count` indices; `None` for a damaged stream.
fn indices(source: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut stream = MeshoptStream(source);
    if stream.byte()? != 0xd1 {
        return None;
    }
    let mut stream = MeshoptStream(stream.take(stream.0.len().checked_sub(4)?)?);
    // Each index takes a byte or more.
    if count > stream.0.len() {
        return None;
    }
    let mut last = [0u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let code = stream.number()?;
        let last = &mut last[(code & 1) as usize];
        *last = last.wrapping_add(unzigzag(code >> 1));
        indices.push(*last);
    }
    stream.0.is_empty().then_some(indices)
}

/// Maps four signed numbers, with the greatest possible value, to four others.
type FourFilter = fn([i32; 4], f32) -> [i32; 4];

fn on_bytes(data: &mut [u8], filter: FourFilter, greatest: f32) {
    for four in data.as_chunks_mut::<4>().0 {
        *four = filter(four.map(|byte| i32::from(byte as i8)), greatest).map(|value| value as u8);
    }
}

fn on_shorts(data: &mut [u8], filter: FourFilter, greatest: f32) {
    for eight in data.as_chunks_mut::<8>().0 {
        let shorts = std::array::from_fn(|at| i32::from(i16::from_le_bytes([eight[2 * at], eight[2 * at + 1]])));
        for (bytes, value) in eight.as_chunks_mut::<2>().0.iter_mut().zip(filter(shorts, greatest)) {
            *bytes = (value as u16).to_le_bytes();
        }
    }
}

/// Filter 1: a unit vector from its octahedral encoding; the fourth number is not part of it.
fn octahedral([x, y, one, fourth]: [i32; 4], greatest: f32) -> [i32; 4] {
    let [mut x, mut y] = [x, y].map(|value| value as f32 / one as f32);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    x -= fold.copysign(x);
    y -= fold.copysign(y);
    let scale = greatest / (x * x + y * y + z * z).sqrt();
    let [x, y, z] = [x, y, z].map(|value| (value * scale).round() as i32);
    [x, y, z, fourth]
}

/// Filter 2: a rotation stored without its largest component, whose index is in the last two bits.
fn quaternion([x, y, z, last]: [i32; 4], greatest: f32) -> [i32; 4] {
    let scale = std::f32::consts::FRAC_1_SQRT_2 / (last | 3) as f32;
    let [x, y, z] = [x, y, z].map(|value| value as f32 * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let mut turned = [w, x, y, z].map(|value| (value * greatest).round() as i32);
    turned.rotate_right((last & 3) as usize);
    turned
}

/// Filter 3: floats of a mantissa of 24 bits and an exponent of 8.
fn exponential(data: &mut [u8]) {
    for four in data.as_chunks_mut::<4>().0 {
        let value = i32::from_le_bytes(*four);
        let (exponent, mantissa) = ((value >> 24).clamp(-100, 100), (value << 8) >> 8);
        let power = f32::from_bits(((exponent + 127) as u32) << 23);
        *four = (mantissa as f32 * power).to_le_bytes();
    }
}

/// Filter 4: red, green and blue from brightness and two differences, all with as many bits as the highest bit of alpha
/// indicates.
fn color([y, orange, green, alpha]: [i32; 4], greatest: f32) -> [i32; 4] {
    let [y, alpha] = [y, alpha].map(|value| value & greatest as i32);
    let full = (1 << (32 - alpha.leading_zeros())) - 1;
    let low = alpha & (full >> 1);
    let values = [y + orange - green, y + green, y - orange - green, low << 1 | low & 1];
    values.map(|value| (value as f32 * (greatest / full.max(1) as f32)).round() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use sha2::{Digest, Sha256};

    fn bytes(hex: &str) -> Vec<u8> {
        (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
    }

    fn hex(bytes: &[u8]) -> String {
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Streams of meshoptimizer's encoder: mode, filter, stride, count, stream, and the output of its decoder, verbatim
    /// or, without a filter, as SHA-256.
    fn streams() -> impl Iterator<Item = [&'static str; 6]> {
        let text = include_str!("../../tests/data/scenes/compressed/streams.txt");
        text.lines().map(|line| line.split(' ').collect::<Vec<_>>().try_into().unwrap())
    }

    fn decoded(stream: &[u8], mode: &str, filter: &str, stride: usize, count: usize) -> Result<Vec<u8>, String> {
        let value = json!({"buffer": 0, "byteLength": stream.len(), "byteStride": stride, "count": count, "mode": mode,
            "filter": filter});
        let view = serde_json::from_value(json!({"buffer": 0, "byteLength": count * stride})).unwrap();
        read(&value, &[stream], &view, &mut (1 << 20))
    }

    #[test]
    fn streams_are_what_meshoptimizer_makes_of_them() {
        for [mode, filter, stride, count, stream, expected] in streams() {
            let (stride, count) = (stride.parse().unwrap(), count.parse().unwrap());
            let found = decoded(&bytes(stream), mode, filter, stride, count).unwrap();
            if filter == "NONE" {
                assert_eq!(hex(&Sha256::digest(&found)), expected, "{mode} {stride} {count}");
                continue;
            }
            let expected = bytes(expected);
            assert_eq!(found.len(), expected.len());
            // Rounding may differ in the last place (the extension's appendix B), but not that of floats.
            let near = |a: &[u8], b: &[u8]| match (filter, stride) {
                ("EXPONENTIAL", _) => a == b,
                (_, 4) => a.iter().zip(b).all(|(a, b)| a.wrapping_sub(*b).wrapping_add(1) < 3),
                _ => a
                    .as_chunks()
                    .0
                    .iter()
                    .zip(b.as_chunks().0)
                    .all(|(a, b)| u16::from_le_bytes(*a).wrapping_sub(u16::from_le_bytes(*b)).wrapping_add(1) < 3),
            };
            assert!(near(&found, &expected), "{filter} {stride}: {found:?} {expected:?}");
        }
    }

    #[test]
    fn damaged_streams_are_refused_or_give_as_much() {
        for [mode, filter, stride, count, stream, _] in streams() {
            let (stride, count) = (stride.parse().unwrap(), count.parse().unwrap());
            let whole = bytes(stream);
            for length in (0..whole.len()).step_by(whole.len().div_ceil(100)) {
                assert!(decoded(&whole[..length], mode, filter, stride, count).is_err(), "{mode} {filter} {length}");
            }
            for at in (0..whole.len()).step_by(whole.len().div_ceil(50)) {
                for bit in 0..8 {
                    let mut changed = whole.clone();
                    changed[at] ^= 1 << bit;
                    if let Ok(found) = decoded(&changed, mode, filter, stride, count) {
                        assert_eq!(found.len(), count * stride);
                    }
                }
            }
        }
    }

    #[test]
    fn descriptions_that_do_not_fit_are_refused() {
        let stream = bytes(streams().nth(1).unwrap()[4]);
        let error = |mode, filter, stride, count| decoded(&stream, mode, filter, stride, count).unwrap_err();
        assert_eq!(error("ATTRIBUTES", "NONE", 6, 40), "its byteStride is 6; allowed: 4 to 256 in steps of 4");
        assert_eq!(error("ATTRIBUTES", "OCTAHEDRAL", 12, 40), "its byteStride is 12; allowed: 4, 8");
        assert_eq!(error("TRIANGLES", "NONE", 4, 40), "its count is 40; allowed: multiples of 3");
        assert_eq!(error("INDICES", "COLOR", 4, 40), "indices with a filter; allowed: NONE");
        assert!(error("ATTRIBUTES", "NONE", 256, 1 << 20).contains("more than 256 times its size"));
        assert!(error("ATTRIBUTES", "NONE", 4, 80).contains("damaged"));
        assert!(error("LINES", "NONE", 4, 40).contains("LINES"));
    }
}
