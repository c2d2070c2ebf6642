//! The sequence of numbers in a PLY file, text or binary.

use crate::number::decimal;
use ground::read::number::Number;
use ground::read::ply::PlyElement;

const CUT_OFF: &str = "the file is cut off";

/// A source of numbers.
pub(super) trait Values {
    /// The next number.
    ///
    /// # Errors
    /// The end of the file; a word that is not a number.
    fn number(&mut self, kind: Number) -> Result<f64, String>;

    /// Skips `count` numbers.
    fn skip(&mut self, kind: Number, count: u64) -> Result<(), String>;

    /// Fewest bytes that a number takes, and the number of bytes left.
    fn room(&self, kind: Number) -> (u64, u64);

    /// Line number of the current position; `None` in binary files.
    fn line(&self) -> Option<usize>;

    /// The length of a list, checked against the bytes left.
    fn length(&mut self, length: Number, kind: Number) -> Result<u64, String> {
        let count = self.number(length)?;
        let (each, left) = self.room(kind);
        if !(count >= 0.0 && count.fract() == 0.0) {
            return Err(format!("a list is {count} long; allowed: 0 and more"));
        }
        if count as u64 > left / each {
            return Err(format!("{CUT_OFF}: a list is {count} long, which takes more than the {left} bytes left"));
        }
        Ok(count as u64)
    }

    /// Checks that the rows of `element` fit into the rest of the file.
    fn check_rows(&self, element: &PlyElement) -> Result<(), String> {
        let mut row = 0;
        for property in &element.properties {
            row += self.room(property.length.unwrap_or(property.kind)).0;
        }
        let (_, left) = self.room(Number::U8);
        if row > 0 && element.count > left / row {
            let PlyElement { name, count, .. } = element;
            return Err(format!(
                "{CUT_OFF}: {count} rows of {name} take {row} bytes or more each, {left} bytes are left"
            ));
        }
        Ok(())
    }
}

/// Binary numbers; `BIG`: the most significant byte first.
pub(super) struct Binary<'a, const BIG: bool> {
    pub bytes: &'a [u8],
}

impl<const BIG: bool> Binary<'_, BIG> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (taken, rest) = self.bytes.split_first_chunk::<N>().ok_or(CUT_OFF)?;
        self.bytes = rest;
        let mut taken = *taken;
        if BIG {
            taken.reverse();
        }
        Ok(taken)
    }
}

impl<const BIG: bool> Values for Binary<'_, BIG> {
    #[inline]
    fn number(&mut self, kind: Number) -> Result<f64, String> {
        Ok(match kind {
            Number::I8 => f64::from(i8::from_le_bytes(self.take()?)),
            Number::U8 => f64::from(u8::from_le_bytes(self.take()?)),
            Number::I16 => f64::from(i16::from_le_bytes(self.take()?)),
            Number::U16 => f64::from(u16::from_le_bytes(self.take()?)),
            Number::I32 => f64::from(i32::from_le_bytes(self.take()?)),
            Number::U32 => f64::from(u32::from_le_bytes(self.take()?)),
            Number::I64 => i64::from_le_bytes(self.take()?) as f64,
            Number::U64 => u64::from_le_bytes(self.take()?) as f64,
            Number::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Number::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn skip(&mut self, kind: Number, count: u64) -> Result<(), String> {
        let length = usize::try_from(count).ok().and_then(|count| count.checked_mul(kind.size()));
        self.bytes = length.and_then(|length| self.bytes.get(length..)).ok_or(CUT_OFF)?;
        Ok(())
    }

    fn room(&self, kind: Number) -> (u64, u64) {
        (kind.size() as u64, self.bytes.len() as u64)
    }

    fn line(&self) -> Option<usize> {
        None
    }
}

/// Numbers as text.
pub(super) struct PlyText<'a> {
    pub bytes: &'a [u8],
    pub at: usize,
    /// Line of the word read last, from 1.
    pub line: usize,
}

impl<'a> PlyText<'a> {
    #[inline]
    fn word(&mut self) -> Result<&'a [u8], String> {
        while let Some(byte) = self.bytes.get(self.at).filter(|byte| byte.is_ascii_whitespace()) {
            // Lines that end with a carriage return alone are not counted.
            self.line += usize::from(*byte == b'\n');
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        if length == 0 {
            return Err(CUT_OFF.into());
        }
        self.at += length;
        Ok(&rest[..length])
    }
}

impl Values for PlyText<'_> {
    #[inline]
    fn number(&mut self, _: Number) -> Result<f64, String> {
        let word = self.word()?;
        match decimal(word) {
            Some((value, length)) if length == word.len() => Ok(value),
            _ => {
                // Infinite, or not a number at all.
                let text = String::from_utf8_lossy(&word[..word.len().min(40)]);
                text.parse().map_err(|_| format!("{text:?} is not a number"))
            }
        }
    }

    fn skip(&mut self, _: Number, count: u64) -> Result<(), String> {
        for _ in 0..count {
            self.word()?;
        }
        Ok(())
    }

    fn room(&self, _: Number) -> (u64, u64) {
        // A digit and a blank, which may be missing after the last.
        (2, (self.bytes.len() - self.at) as u64 + 1)
    }

    fn line(&self) -> Option<usize> {
        Some(self.line)
    }
}
