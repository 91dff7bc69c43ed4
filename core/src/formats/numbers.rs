//! Numbers in binary files, of the types that PLY and NRRD have in common.

/// The type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    /// By the names that the two formats use.
    pub(super) fn named(name: &str) -> Option<Self> {
        let name = name.strip_suffix("_t").unwrap_or(name);
        Some(match name {
            "char" | "signed char" | "int8" => Self::I8,
            "uchar" | "unsigned char" | "uint8" => Self::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" => Self::I16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" => Self::U16,
            "int" | "signed int" | "int32" => Self::I32,
            "uint" | "unsigned int" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// The bytes that a number has.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number at the start of some bytes; `None` where they are too few.
    pub(super) fn read(self, bytes: &[u8], big_endian: bool) -> Option<f64> {
        let mut b = [0u8; 8];
        let own = &mut b[..self.size()];
        own.copy_from_slice(bytes.get(..self.size())?);
        if big_endian {
            own.reverse();
        }
        let [b0, b1, b2, b3, ..] = b;
        Some(match self {
            Self::I8 => f64::from(b0.cast_signed()),
            Self::U8 => f64::from(b0),
            Self::I16 => f64::from(i16::from_le_bytes([b0, b1])),
            Self::U16 => f64::from(u16::from_le_bytes([b0, b1])),
            Self::I32 => f64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            Self::U32 => f64::from(u32::from_le_bytes([b0, b1, b2, b3])),
            Self::F32 => f64::from(f32::from_le_bytes([b0, b1, b2, b3])),
            Self::F64 => f64::from_le_bytes(b),
        })
    }
}
