//! Accessors to numbers; every bound is checked before anything is allocated.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Index, Root, buffer};
use ground::array::Array;
use std::cell::Cell;
use std::collections::HashMap;

/// Decodes the accessors of one file.
pub(super) struct Accessors<'a> {
    json: &'a Root,
    buffers: &'a [&'a [u8]],
    /// Contents of compressed buffer views.
    decoded: &'a HashMap<usize, Vec<u8>>,
    /// Contents of accessors that are compressed themselves.
    unpacked: HashMap<usize, Vec<u8>>,
    /// Bytes that may still be used, see [`Accessors::charge`].
    budget: Cell<usize>,
}

/// Vectors that several parts may use.
pub(super) type SharedVectors<const N: usize> = Array<[f32; N]>;

/// Decoded bytes allowed per byte of the file. Legitimate files stay below 20 (a strip with 8-bit indices); files whose
/// accessors overlap a thousandfold would fill the memory.
const EXPANSION_LIMIT: usize = 64;

/// This many decompressed bytes count as one byte of the file.
const DECODED_SHARE: usize = 4;

/// Elements of an accessor or sparse array, as they are in their buffer.
struct Elements<'a> {
    /// From the first element to the end of the last.
    bytes: &'a [u8],
    /// Bytes from one element to the next.
    stride: usize,
    kind: ComponentType,
    normalized: bool,
}

impl<'a> Accessors<'a> {
    /// `file_bytes` is the size of the file with its buffers.
    pub fn new(
        json: &'a Root,
        buffers: &'a [&'a [u8]],
        decoded: &'a HashMap<usize, Vec<u8>>,
        file_bytes: usize,
    ) -> Self {
        let bytes = decoded.values().fold(file_bytes, |sum, view| sum.saturating_add(view.len() / DECODED_SHARE));
        let budget = Cell::new(bytes.saturating_mul(EXPANSION_LIMIT).saturating_add(1 << 20));
        Accessors { json, buffers, decoded, unpacked: HashMap::new(), budget }
    }

    /// Sets the contents of accessors that do not have them in a buffer view.
    pub fn unpack(&mut self, unpacked: HashMap<usize, Vec<u8>>) {
        let bytes: usize = unpacked.values().map(Vec::len).sum();
        let more = (bytes / DECODED_SHARE).saturating_mul(EXPANSION_LIMIT);
        self.budget.set(self.budget.get().saturating_add(more));
        self.unpacked = unpacked;
    }

    /// Takes `bytes` of memory from the budget; fails when the file has become far larger in memory than on disk.
    pub fn charge(&self, bytes: usize) -> Result<(), String> {
        let left = self.budget.get().checked_sub(bytes).ok_or_else(|| {
            format!("is too much: the file would take more than {EXPANSION_LIMIT} times its size in memory")
        })?;
        self.budget.set(left);
        Ok(())
    }

    /// The accessor's description.
    pub fn describe(&self, index: Index<Accessor>) -> Result<&'a Accessor, String> {
        let known = &self.json.accessors;
        known.get(index.value()).ok_or_else(|| format!("accessor {index} does not exist: the file has {}", known.len()))
    }

    /// Vectors of `N` numbers; integers become 0..1 or -1..1 where the accessor is normalised.
    pub fn vectors<const N: usize>(&self, index: Index<Accessor>) -> Result<Vec<[f32; N]>, String> {
        let expected = [Type::Scalar, Type::Vec2, Type::Vec3, Type::Vec4][N - 1];
        self.numbers(index, expected)
    }

    /// Matrices, column by column.
    pub fn matrices(&self, index: Index<Accessor>) -> Result<Vec<[f32; 16]>, String> {
        if !matches!(self.describe(index)?.component_type, Checked::Valid(component) if component.0 == ComponentType::F32)
        {
            return Err(format!("accessor {index} holds no single-precision numbers; allowed: componentType 5126"));
        }
        self.numbers(index, Type::Mat4)
    }

    fn numbers<const N: usize>(&self, index: Index<Accessor>, expected: Type) -> Result<Vec<[f32; N]>, String> {
        self.read(index, expected, |elements| {
            // Normalised integers: glTF 2.0, 3.6.2.2 and 3.11.
            Ok(match (elements.kind, elements.normalized) {
                (ComponentType::F32, _) => elements.decode(f32::from_le_bytes),
                (ComponentType::U8, false) => elements.decode(|[byte]| f32::from(byte)),
                (ComponentType::U8, true) => elements.decode(|[byte]| f32::from(byte) / 255.0),
                (ComponentType::I8, false) => elements.decode(|byte| f32::from(i8::from_le_bytes(byte))),
                (ComponentType::I8, true) => {
                    elements.decode(|byte| (f32::from(i8::from_le_bytes(byte)) / 127.0).max(-1.0))
                }
                (ComponentType::U16, false) => elements.decode(|two| f32::from(u16::from_le_bytes(two))),
                (ComponentType::U16, true) => elements.decode(|two| f32::from(u16::from_le_bytes(two)) / 65535.0),
                (ComponentType::I16, false) => elements.decode(|two| f32::from(i16::from_le_bytes(two))),
                (ComponentType::I16, true) => {
                    elements.decode(|two| (f32::from(i16::from_le_bytes(two)) / 32767.0).max(-1.0))
                }
                (ComponentType::U32, _) => return Err("holds 32-bit integers; allowed: other numbers".into()),
            })
        })
    }

    /// Quadruples of 8-bit or 16-bit numbers.
    pub fn quadruples(&self, index: Index<Accessor>) -> Result<Vec<[u16; 4]>, String> {
        self.read(index, Type::Vec4, |elements| match elements.kind {
            ComponentType::U8 => Ok(elements.decode(|[byte]| u16::from(byte))),
            ComponentType::U16 => Ok(elements.decode(u16::from_le_bytes)),
            _ => Err("does not hold joint numbers; allowed: componentType 5121, 5123".into()),
        })
    }

    /// Vertex indices.
    pub fn indices(&self, index: Index<Accessor>) -> Result<Vec<u32>, String> {
        let indices = self.read(index, Type::Scalar, |elements| elements.decode_indices())?;
        Ok(indices.into_iter().map(|[index]| index).collect())
    }

    /// Elements of an accessor: its own, or zeros, overlaid by the sparse ones.
    fn read<T: Copy + Default, const N: usize>(
        &self,
        index: Index<Accessor>,
        expected: Type,
        decode: impl Fn(Elements<'_>) -> Result<Vec<[T; N]>, String>,
    ) -> Result<Vec<[T; N]>, String> {
        let accessor = self.describe(index)?;
        let fault = |message: String| format!("accessor {index} {message}");
        let Checked::Valid(component) = accessor.component_type else {
            return Err(fault("has an unknown componentType; allowed: 5120 to 5123, 5125, 5126".into()));
        };
        if accessor.type_ != Checked::Valid(expected) {
            return Err(fault(format!("is not of type {}", format!("{expected:?}").to_uppercase())));
        }
        let unpacked = self.unpacked.get(&index.value());
        let count = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
        let elements = |view, offset: Option<USize64>, count, kind| {
            self.elements(view, offset.map_or(0, |o| o.0), count, N, kind, accessor.normalized)
        };
        let own = match (accessor.buffer_view, unpacked) {
            (_, Some(bytes)) => {
                let stride = component.0.size() * N;
                if bytes.len() != count.saturating_mul(stride) {
                    let found = bytes.len() / stride;
                    return Err(fault(format!("has {count} elements, but its compressed data {found}")));
                }
                Some(Elements { bytes, stride, kind: component.0, normalized: accessor.normalized })
            }
            (Some(view), None) => Some(elements(view, accessor.byte_offset, count, component.0).map_err(fault)?),
            (None, None) => None,
        };
        self.charge(count.saturating_mul(size_of::<[T; N]>())).map_err(fault)?;
        let mut values = match own {
            Some(elements) => decode(elements).map_err(fault)?,
            // glTF 2.0, 3.6.2.1: an accessor without a buffer view is zeros.
            None => vec![[T::default(); N]; count],
        };
        let Some(sparse) = &accessor.sparse else { return Ok(values) };

        let fault = |message: String| format!("accessor {index} sparse data {message}");
        let sparse_count = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
        let Checked::Valid(index_kind) = sparse.indices.component_type else {
            return Err(fault("has an unknown componentType; allowed: 5121, 5123, 5125".into()));
        };
        let places = self
            .elements(sparse.indices.buffer_view, sparse.indices.byte_offset.0, sparse_count, 1, index_kind.0, false)
            .and_then(|indices| indices.decode_indices())
            .map_err(fault)?;
        let replacements =
            elements(sparse.values.buffer_view, Some(sparse.values.byte_offset), sparse_count, component.0)
                .and_then(&decode)
                .map_err(fault)?;
        for ([place], replacement) in places.into_iter().zip(replacements) {
            *values.get_mut(place as usize).ok_or_else(|| fault(format!("replaces element {place} of {count}")))? =
                replacement;
        }
        Ok(values)
    }

    /// Finds `count` elements of `width` numbers in a buffer view.
    fn elements(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: usize,
        width: usize,
        kind: ComponentType,
        normalized: bool,
    ) -> Result<Elements<'a>, String> {
        let size = kind.size() * width;
        let bytes = self.view(view)?;
        let stride = match self.json.buffer_views[view.value()].byte_stride {
            Some(stride) if stride.0 != 0 => stride.0,
            _ => size,
        };
        if stride < size {
            return Err(format!("has elements of {size} bytes, but buffer view {view} a byteStride of {stride}"));
        }
        let length = match count.checked_sub(1) {
            Some(last) => last.saturating_mul(stride).saturating_add(size),
            None => 0,
        };
        let bytes = usize::try_from(offset)
            .ok()
            .and_then(|offset| bytes.get(offset..))
            .and_then(|rest| rest.get(..length))
            .ok_or_else(|| {
                format!(
                    "ends beyond buffer view {view}: {count} elements {stride} bytes apart from byte {offset} on, \
                     the view has {} bytes",
                    bytes.len()
                )
            })?;
        Ok(Elements { bytes, stride, kind, normalized })
    }

    /// The elements of `all` that are `used`; `None`: all.
    pub fn pick<T: Copy + Send + Sync + 'static>(
        &self,
        all: &Array<T>,
        used: Option<&Vec<u32>>,
    ) -> Result<Array<T>, String> {
        let Some(used) = used else { return Ok(all.clone()) };
        self.charge(used.len() * size_of::<T>())?;
        Ok(used.iter().map(|&vertex| all[vertex as usize]).collect::<Vec<_>>().into())
    }

    /// Bytes of a buffer view.
    pub fn view(&self, index: Index<buffer::View>) -> Result<&'a [u8], String> {
        let known = &self.json.buffer_views;
        let view = known
            .get(index.value())
            .ok_or_else(|| format!("refers to buffer view {index}, the file has {}", known.len()))?;
        if let Some(decoded) = self.decoded.get(&index.value()) {
            return Ok(decoded);
        }
        let buffer = self
            .buffers
            .get(view.buffer.value())
            .ok_or_else(|| format!("refers to buffer {}, the file has {}", view.buffer, self.buffers.len()))?;
        let (offset, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let range = usize::try_from(offset).ok().zip(usize::try_from(length).ok());
        range.and_then(|(offset, length)| buffer.get(offset..)?.get(..length)).ok_or_else(|| {
            format!(
                "refers to buffer view {index}, which ends beyond buffer {}: {length} bytes from byte {offset} on, \
                 the buffer has {} bytes",
                view.buffer,
                buffer.len()
            )
        })
    }
}

/// The accessor of an attribute.
pub(super) fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<Index<Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
}

/// Checks that an accessor called `what` has an element for each of the `vertices`.
pub(super) fn same_count(what: &str, accessor: &Accessor, vertices: usize) -> Result<(), String> {
    let found = accessor.count.0;
    if found == vertices as u64 { Ok(()) } else { Err(format!("{what} has {found} elements for {vertices} vertices")) }
}

impl Elements<'_> {
    /// `N` numbers of `W` bytes from each element.
    fn decode<T: Copy + Default, const N: usize, const W: usize>(&self, number: impl Fn([u8; W]) -> T) -> Vec<[T; N]> {
        let elements = self.bytes.chunks(self.stride);
        let mut vectors = vec![[T::default(); N]; elements.len()];
        for (vector, bytes) in vectors.iter_mut().zip(elements) {
            let (numbers, _) = bytes.as_chunks::<W>();
            vector.iter_mut().zip(numbers).for_each(|(value, &bytes)| *value = number(bytes));
        }
        vectors
    }

    fn decode_indices(&self) -> Result<Vec<[u32; 1]>, String> {
        match self.kind {
            ComponentType::U8 => Ok(self.decode(|[byte]| u32::from(byte))),
            ComponentType::U16 => Ok(self.decode(|two| u32::from(u16::from_le_bytes(two)))),
            ComponentType::U32 => Ok(self.decode(u32::from_le_bytes)),
            ComponentType::I8 | ComponentType::I16 | ComponentType::F32 => {
                Err("holds no indices; allowed: unsigned integers (componentType 5121, 5123, 5125)".into())
            }
        }
    }
}
