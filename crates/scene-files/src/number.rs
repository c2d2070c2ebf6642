//! Numbers in the text of scene files, read byte by byte.

/// Signed integer at the start of `bytes`, and its length; without digits, 0 of length 0. Saturates.
#[inline]
pub(super) fn integer(bytes: &[u8]) -> (i64, usize) {
    let (negative, sign) = sign(bytes);
    let mut value = 0i64;
    let mut at = sign;
    while let Some(digit) = digit(bytes, at) {
        value = value.saturating_mul(10).saturating_add(digit as i64);
        at += 1;
    }
    if at == sign {
        return (0, 0);
    }
    (if negative { -value } else { value }, at)
}

/// Whether `bytes` starts with a minus, and the length of its sign.
#[inline]
fn sign(bytes: &[u8]) -> (bool, usize) {
    match bytes.first() {
        Some(b'-') => (true, 1),
        Some(b'+') => (false, 1),
        _ => (false, 0),
    }
}

#[inline]
fn digit(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

/// Decimal number at the start of `bytes`, correctly rounded, and its length.
///
/// Digits are required before or after the point, and after an `e`: `2.`, `+1`, `-.5`, `2.e1`, `1E-7`.
#[inline]
pub(super) fn decimal(bytes: &[u8]) -> Option<(f64, usize)> {
    /// Powers of ten that are exact in `f64`.
    const POWERS: [f64; 23] = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19,
        1e20, 1e21, 1e22,
    ];
    let (negative, start) = sign(bytes);
    let mut at = start;
    let mut mantissa = 0u64;
    while let Some(digit) = digit(bytes, at) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    let mut digits = at - start;
    let mut exponent = 0i64;
    if bytes.get(at) == Some(&b'.') {
        let point = at;
        at += 1;
        while let Some(digit) = digit(bytes, at) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
            at += 1;
        }
        let decimals = at - point - 1;
        digits += decimals;
        exponent = -(decimals as i64);
    }
    if digits == 0 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        let (power, length) = integer(&bytes[at + 1..]);
        if length == 0 {
            return None;
        }
        exponent = exponent.saturating_add(power);
        at += 1 + length;
    }
    // Where mantissa and power of ten are exact, one operation rounds once (Clinger 1990, "How to read floating point
    // numbers accurately"); the rest is rare. 19 digits always fit in 64 bits.
    let exact = digits <= 19 && mantissa <= 1 << 53 && exponent.abs() <= 22;
    let value = if exact {
        let power = POWERS[exponent.unsigned_abs() as usize];
        let magnitude = if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
        if negative { -magnitude } else { magnitude }
    } else {
        std::str::from_utf8(&bytes[..at]).ok()?.parse().ok()?
    };
    Some((value, at))
}
