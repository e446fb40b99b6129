//! One .npy array: a magic number, a version, a header that is a Python dictionary of `descr`,
//! `fortran_order` and `shape`, and the elements.
//!
//! Format: numpy's `numpy/lib/format.py`, versions 1 to 3. Read are little-endian floats and
//! integers of four and eight bytes in C order; another type is an error only when its numbers are
//! asked for. A reader of our own: the ones there are bring a parser generator for this one line of
//! Python.

use thiserror::Error;

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array whose header has been understood.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    /// NumPy's name of the type, such as `<f8`.
    kind: String,
    /// Dimensions, slowest first.
    pub(crate) shape: Vec<usize>,
    /// The elements, row by row.
    data: Vec<u8>,
}

/// A problem of an array.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum NpyError {
    #[error("is no .npy file: it does not begin with \\x93NUMPY")]
    Magic,
    #[error("is .npy of version {found}, known are 1, 2 and 3")]
    Version { found: u8 },
    #[error("ends at byte {found}, within its header, which needs {expected}")]
    Header { expected: usize, found: usize },
    #[error("its header cannot be understood: {0}")]
    Dictionary(String),
    #[error("is in Fortran order: save it as numpy.ascontiguousarray(array)")]
    Fortran,
    #[error("has elements of type {found:?}, expected {expected}")]
    Type {
        expected: &'static str,
        found: String,
    },
    #[error("has the shape {found}, expected {expected}")]
    Shape { expected: String, found: String },
    #[error(
        "has {found} bytes of data, but its shape needs {expected}: it was cut short or changed"
    )]
    Length { expected: String, found: usize },
}

impl Array {
    /// The array in the bytes of a file.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, NpyError> {
        let short = |expected| NpyError::Header {
            expected,
            found: bytes.len(),
        };
        let rest = bytes.strip_prefix(MAGIC).ok_or(NpyError::Magic)?;
        let &[version, _, ref rest @ ..] = rest else {
            return Err(short(MAGIC.len() + 2));
        };
        let (length, start) = match (version, rest) {
            (1, &[a, b, ..]) => (usize::from(u16::from_le_bytes([a, b])), 10),
            (2 | 3, &[a, b, c, d, ..]) => (u32::from_le_bytes([a, b, c, d]) as usize, 12),
            (1..=3, _) => return Err(short(12)),
            (found, _) => return Err(NpyError::Version { found }),
        };
        let end = start + length;
        let header = bytes.get(start..end).ok_or_else(|| short(end))?;
        let header = std::str::from_utf8(header)
            .map_err(|_| NpyError::Dictionary("it is no text".to_owned()))?;
        let (kind, shape) = parse_header(header)?;
        let data = bytes[end..].to_vec();
        Ok(Self { kind, shape, data })
    }

    /// An error unless the array has this shape, with `None` where any length will do.
    pub(crate) fn expect_shape(&self, expected: &[Option<usize>]) -> Result<(), NpyError> {
        let same = |(e, &f): (&Option<usize>, &usize)| e.is_none_or(|e| e == f);
        if self.shape.len() == expected.len() && expected.iter().zip(&self.shape).all(same) {
            return Ok(());
        }
        let lengths = expected
            .iter()
            .map(|e| e.map_or_else(|| "any".to_owned(), |e| e.to_string()));
        Err(NpyError::Shape {
            expected: format!("[{}]", lengths.collect::<Vec<_>>().join(", ")),
            found: format!("{:?}", self.shape),
        })
    }

    /// The numbers as f64.
    pub(crate) fn floats(&self) -> Result<Vec<f64>, NpyError> {
        match self.kind.as_str() {
            "<f8" => self.elements::<8, _>(f64::from_le_bytes),
            "<f4" => self.elements::<4, _>(|b| f64::from(f32::from_le_bytes(b))),
            _ => Err(self.wrong_type("little-endian floats, <f4 or <f8")),
        }
    }

    /// The numbers as integers.
    pub(crate) fn integers(&self) -> Result<Vec<i64>, NpyError> {
        match self.kind.as_str() {
            "<i8" => self.elements::<8, _>(i64::from_le_bytes),
            "<i4" => self.elements::<4, _>(|b| i64::from(i32::from_le_bytes(b))),
            "<u4" => self.elements::<4, _>(|b| i64::from(u32::from_le_bytes(b))),
            _ => Err(self.wrong_type("little-endian integers, <i4, <u4 or <i8")),
        }
    }

    fn wrong_type(&self, expected: &'static str) -> NpyError {
        NpyError::Type {
            expected,
            found: self.kind.clone(),
        }
    }

    fn elements<const N: usize, T>(&self, read: fn([u8; N]) -> T) -> Result<Vec<T>, NpyError> {
        let count = self
            .shape
            .iter()
            .try_fold(N, |product, &n| product.checked_mul(n));
        if count != Some(self.data.len()) {
            return Err(NpyError::Length {
                expected: count
                    .map_or_else(|| "more than there can be".to_owned(), |n| n.to_string()),
                found: self.data.len(),
            });
        }
        let (elements, _) = self.data.as_chunks::<N>();
        Ok(elements.iter().copied().map(read).collect())
    }
}

/// Element type and shape of `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }`.
fn parse_header(text: &str) -> Result<(String, Vec<usize>), NpyError> {
    let missing = |key: &str| NpyError::Dictionary(format!("{key} is missing in {text:?}"));
    let after = |key: &str| {
        let at = text.find(&format!("'{key}'"))?;
        text[at + key.len() + 2..].trim_start().strip_prefix(':')
    };
    let kind = after("descr").ok_or_else(|| missing("'descr'"))?;
    let kind = kind
        .trim_start()
        .strip_prefix('\'')
        .and_then(|k| k.split_once('\''));
    let (kind, _) = kind.ok_or_else(|| {
        NpyError::Dictionary("its 'descr' is no single type of number".to_owned())
    })?;
    let order = after("fortran_order").ok_or_else(|| missing("'fortran_order'"))?;
    if order.trim_start().starts_with("True") {
        return Err(NpyError::Fortran);
    }
    let shape = after("shape").ok_or_else(|| missing("'shape'"))?;
    let shape = shape
        .trim_start()
        .strip_prefix('(')
        .and_then(|s| s.split_once(')'));
    let (shape, _) = shape.ok_or_else(|| missing("a tuple for 'shape'"))?;
    let lengths = shape.split(',').map(str::trim).filter(|s| !s.is_empty());
    let lengths: Result<Vec<usize>, _> = lengths.map(str::parse).collect();
    let lengths = lengths.map_err(|_| NpyError::Dictionary(format!("'shape' is ({shape})")))?;
    Ok((kind.to_owned(), lengths))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of version 1 with this header.
    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [MAGIC, &[1, 0], &length, header.as_bytes(), data].concat()
    }

    const HEADER: &str = "{'descr': '<i4', 'fortran_order': False, 'shape': (2, 1), }";

    fn integers(bytes: &[u8]) -> Result<Vec<i64>, NpyError> {
        let array = Array::parse(bytes)?;
        let integers = array.integers()?;
        array.expect_shape(&[None, Some(1)])?;
        Ok(integers)
    }

    #[test]
    fn an_array_is_read_as_it_was_written() {
        let bytes = file(HEADER, &[1, 0, 0, 0, 0, 1, 0, 0]);
        let array = Array::parse(&bytes).unwrap();
        assert_eq!(array.shape, [2, 1]);
        assert_eq!(integers(&bytes), Ok(vec![1, 256]));
    }

    #[test]
    fn mistakes_are_named() {
        let data = [1, 0, 0, 0, 2, 0, 0, 0];
        let error = |from: &str, to: &str| {
            let bytes = file(&HEADER.replace(from, to), &data);
            integers(&bytes).unwrap_err().to_string()
        };
        for (from, to, expected) in [
            ("False", "True", "Fortran order"),
            ("<i4", ">i4", "elements of type \">i4\""),
            (
                "(2, 1)",
                "(1, 2)",
                "has the shape [1, 2], expected [any, 1]",
            ),
            ("(2, 1)", "(2,)", "has the shape [2]"),
            ("(2, 1)", "(99999999999999999999999, 1)", "'shape' is"),
            (
                "(2, 1)",
                "(4611686018427387905, 1)",
                "more than there can be",
            ),
            (
                "(2, 1)",
                "(3, 1)",
                "has 8 bytes of data, but its shape needs 12",
            ),
            ("'descr'", "'desc'", "'descr' is missing"),
            ("'<i4'", "[('a', '<i4')]", "no single type"),
        ] {
            let found = error(from, to);
            assert!(found.contains(expected), "{found} lacks {expected}");
        }
        assert_eq!(Array::parse(b""), Err(NpyError::Magic));
        let version = [MAGIC, &[9, 0]].concat();
        assert_eq!(Array::parse(&version), Err(NpyError::Version { found: 9 }));
    }

    #[test]
    fn any_truncation_is_an_error_and_any_flipped_byte_no_panic() {
        let bytes = file(&HEADER.replace("<i4", "<f4"), &[0, 0, 128, 63, 0, 0, 0, 64]);
        let floats = |bytes: &[u8]| Array::parse(bytes)?.floats();
        assert_eq!(floats(&bytes), Ok(vec![1.0, 2.0]));
        for end in 0..bytes.len() {
            assert!(floats(&bytes[..end]).is_err(), "{end}");
        }
        for at in 0..bytes.len() {
            for value in 0..=u8::MAX {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                let _ = floats(&damaged);
            }
        }
    }
}
