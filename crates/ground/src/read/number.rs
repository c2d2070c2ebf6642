//! Number types in binary files.

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 64 bits.
    I64,
    /// Unsigned, 64 bits.
    U64,
    /// IEEE float, 32 bits.
    F32,
    /// IEEE float, 64 bits.
    F64,
}

impl Number {
    /// Size of one, bytes.
    pub fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::I64 | Number::U64 | Number::F64 => 8,
        }
    }

    /// The type of `size` bytes: `f`loat, `i`nteger or `u`nsigned.
    pub fn of(kind: char, size: usize) -> Option<Number> {
        Some(match (kind, size) {
            ('f', 4) => Number::F32,
            ('f', 8) => Number::F64,
            ('i', 1) => Number::I8,
            ('i', 2) => Number::I16,
            ('i', 4) => Number::I32,
            ('i', 8) => Number::I64,
            ('u', 1) => Number::U8,
            ('u', 2) => Number::U16,
            ('u', 4) => Number::U32,
            ('u', 8) => Number::U64,
            _ => return None,
        })
    }
}
