//! Number types in binary files, and numbers in text.

use crate::SourceErrorKind;

/// Type of one value in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// Order of the bytes of one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Endian {
    Little,
    Big,
}

impl Scalar {
    /// Size in bytes.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(crate) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// Whether `f32` cannot hold every coordinate of this type.
    pub(crate) fn is_wider_than_f32(self) -> bool {
        matches!(
            self,
            Self::I32 | Self::U32 | Self::I64 | Self::U64 | Self::F64
        )
    }

    /// The value at the start of `bytes`, which must hold it.
    #[inline]
    pub(crate) fn decode(self, bytes: &[u8], endian: Endian) -> f64 {
        match self {
            Self::I8 => f64::from(bytes[0] as i8),
            Self::U8 => f64::from(bytes[0]),
            Self::I16 => f64::from(i16::from_le_bytes(endian.little(bytes))),
            Self::U16 => f64::from(u16::from_le_bytes(endian.little(bytes))),
            Self::I32 => f64::from(i32::from_le_bytes(endian.little(bytes))),
            Self::U32 => f64::from(u32::from_le_bytes(endian.little(bytes))),
            Self::I64 => i64::from_le_bytes(endian.little(bytes)) as f64,
            Self::U64 => u64::from_le_bytes(endian.little(bytes)) as f64,
            Self::F32 => f64::from(f32::from_le_bytes(endian.little(bytes))),
            Self::F64 => f64::from_le_bytes(endian.little(bytes)),
        }
    }

    /// The integer at the start of `bytes`; `None` for a `u64` beyond `i64` and for floats.
    #[inline]
    pub(crate) fn decode_integer(self, bytes: &[u8], endian: Endian) -> Option<i64> {
        match self {
            Self::I64 => Some(i64::from_le_bytes(endian.little(bytes))),
            Self::U64 => i64::try_from(u64::from_le_bytes(endian.little(bytes))).ok(),
            Self::F32 | Self::F64 => None,
            // At most 32 bits: exact in f64.
            _ => Some(self.decode(bytes, endian) as i64),
        }
    }
}

impl Endian {
    /// The first `N` bytes, the lowest one first.
    #[inline]
    fn little<const N: usize>(self, bytes: &[u8]) -> [u8; N] {
        let mut first = [0; N];
        first.copy_from_slice(&bytes[..N]);
        if self == Self::Big {
            first.reverse();
        }
        first
    }
}

/// The unsigned integer of these bytes, eight at most, the lowest one first.
pub(crate) fn unsigned(bytes: &[u8]) -> u64 {
    let highest_first = bytes.iter().rev();
    highest_first.fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// A number in text. Everything that C programs print for NaN and infinity is understood.
pub(crate) fn parse_number(token: &[u8]) -> Result<f64, SourceErrorKind> {
    let bad = || SourceErrorKind::value(format!("expected a number, found `{}`", excerpt(token)));
    let text = std::str::from_utf8(token).map_err(|_| bad())?;
    if let Ok(number) = text.parse() {
        return Ok(number);
    }
    // "-nan(ind)", "1.#QNAN", "-1.#IND", "1.#INF"
    let lower = text.to_ascii_lowercase();
    let not_a_number = ["nan", "#qnan", "#snan", "#ind"];
    if lower.trim_start_matches(['-', '+']).starts_with("nan(")
        || not_a_number.iter().any(|mark| lower.contains(mark)) && lower.contains('#')
    {
        return Ok(f64::NAN);
    }
    if lower.contains("#inf") {
        return Ok(if lower.starts_with('-') {
            f64::NEG_INFINITY
        } else {
            f64::INFINITY
        });
    }
    Err(bad())
}

/// An integer in text.
pub(crate) fn parse_integer(token: &[u8]) -> Result<i64, SourceErrorKind> {
    std::str::from_utf8(token)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| {
            SourceErrorKind::value(format!("expected an integer, found `{}`", excerpt(token)))
        })
}

/// The start of `bytes`, fit for a message.
pub(crate) fn excerpt(bytes: &[u8]) -> String {
    const MOST: usize = 40;
    let shown = String::from_utf8_lossy(&bytes[..bytes.len().min(MOST)]);
    let mut shown = shown.escape_debug().to_string();
    if bytes.len() > MOST {
        shown.push('…');
    }
    shown
}
