//! One .npy file: a magic word, a header that is a Python dictionary (type, order, shape), and the
//! numbers in row-major order.
//!
//! Read are little-endian f64 and f32, and integers of four and eight bytes; other types are an
//! error only when their numbers are asked for.

use thiserror::Error;

/// An array.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    /// NumPy's name of the type, such as `<f8`.
    descr: String,
    /// Dimensions, slowest first.
    pub(crate) shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// Why bytes are no array, or not one of these numbers.
#[derive(Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum NpyError {
    #[error("it is no .npy file")]
    Magic,
    #[error("its header is damaged: no readable {key}")]
    Header { key: &'static str },
    #[error("it is in column-major order: save it with numpy.ascontiguousarray")]
    Order,
    #[error("it holds {found} bytes, its shape needs {expected}")]
    Length { expected: usize, found: usize },
    #[error("expected {expected}, found NumPy's {found}")]
    Type {
        expected: &'static str,
        found: String,
    },
}

impl Array {
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, NpyError> {
        let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or(NpyError::Magic)?;
        let (length, start) = match rest {
            [1, _, a, b, ..] => (usize::from(u16::from_le_bytes([*a, *b])), 4),
            [2 | 3, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 6),
            _ => return Err(NpyError::Magic),
        };
        let missing = |key| NpyError::Header { key };
        let header = rest.get(start..start + length);
        let header = header.ok_or_else(|| missing("length"))?;
        let header = String::from_utf8_lossy(header);
        let value = |key: &'static str| {
            let at = header.find(&format!("'{key}':"));
            let after = at.map(|at| header[at + key.len() + 3..].trim_start());
            after.ok_or_else(|| missing(key))
        };
        let descr = value("descr")?.trim_start_matches('\'');
        let descr = descr.split('\'').next().unwrap_or_default().to_owned();
        if value("fortran_order")?.starts_with("True") {
            return Err(NpyError::Order);
        }
        let shape = shape(value("shape")?).ok_or_else(|| missing("shape"))?;
        let bytes = rest[start + length..].to_vec();
        Ok(Self {
            descr,
            shape,
            bytes,
        })
    }

    /// The numbers as f64.
    pub(crate) fn floats(&self) -> Result<Vec<f64>, NpyError> {
        match self.descr.as_str() {
            "<f8" => self.entries::<8, _>(f64::from_le_bytes),
            "<f4" => self.entries::<4, _>(|b| f64::from(f32::from_le_bytes(b))),
            _ => Err(self.wrong("numbers of type <f8 or <f4")),
        }
    }

    /// The numbers as integers.
    pub(crate) fn integers(&self) -> Result<Vec<i64>, NpyError> {
        match self.descr.as_str() {
            "<i8" | "<u8" => self.entries::<8, _>(i64::from_le_bytes),
            "<i4" => self.entries::<4, _>(|b| i64::from(i32::from_le_bytes(b))),
            "<u4" => self.entries::<4, _>(|b| i64::from(u32::from_le_bytes(b))),
            _ => Err(self.wrong("integers")),
        }
    }

    fn wrong(&self, expected: &'static str) -> NpyError {
        let found = self.descr.clone();
        NpyError::Type { expected, found }
    }

    fn entries<const N: usize, T>(&self, read: fn([u8; N]) -> T) -> Result<Vec<T>, NpyError> {
        let expected = self
            .shape
            .iter()
            .try_fold(N, |product, n| product.checked_mul(*n))
            .unwrap_or(usize::MAX);
        if self.bytes.len() != expected {
            let found = self.bytes.len();
            return Err(NpyError::Length { expected, found });
        }
        let (entries, _) = self.bytes.as_chunks::<N>();
        Ok(entries.iter().copied().map(read).collect())
    }
}

/// The numbers of `(2, 3, )`.
fn shape(text: &str) -> Option<Vec<usize>> {
    let inner = text.strip_prefix('(')?.split_once(')')?.0;
    let words = inner.split(',').map(str::trim).filter(|w| !w.is_empty());
    words.map(|word| word.parse().ok()).collect()
}
