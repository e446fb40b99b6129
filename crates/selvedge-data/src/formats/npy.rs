//! One .npy array: a magic number, a version, a header that is a Python dictionary of `descr`,
//! `fortran_order` and `shape`, and the elements.
//!
//! Format: numpy's `numpy/lib/format.py`, versions 1 to 3, in C order. A reader of our own: the ones there are bring a parser generator for this one line of
//! Python.

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array whose header has been understood.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    /// NumPy's name of the type, such as `<f8`.
    pub(crate) kind: String,
    /// Dimensions, slowest first.
    pub(crate) shape: Vec<usize>,
    /// The elements, row by row.
    data: Vec<u8>,
}

impl Array {
    /// The array in the bytes of a file.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let short = |expected: usize| {
            let found = bytes.len();
            format!("ends at byte {found}, within its header, which needs {expected}")
        };
        let rest = bytes.strip_prefix(MAGIC);
        let rest = rest.ok_or("is no .npy file: it does not begin with \\x93NUMPY")?;
        let &[version, _, ref rest @ ..] = rest else {
            return Err(short(MAGIC.len() + 2));
        };
        let (length, start) = match (version, rest) {
            (1, &[a, b, ..]) => (usize::from(u16::from_le_bytes([a, b])), 10),
            (2 | 3, &[a, b, c, d, ..]) => (u32::from_le_bytes([a, b, c, d]) as usize, 12),
            (1..=3, _) => return Err(short(12)),
            (found, _) => {
                return Err(format!("is .npy of version {found}, known are 1, 2 and 3"));
            }
        };
        let end = start + length;
        let header = bytes.get(start..end).ok_or_else(|| short(end))?;
        let header = std::str::from_utf8(header).map_err(|_| unclear("it is no text"))?;
        let (kind, shape) = parse_header(header)?;
        let data = bytes[end..].to_vec();
        Ok(Self { kind, shape, data })
    }

    /// The bytes of the elements, which must be as many as the shape needs. The size of an element
    /// is known of the types that are read.
    pub(crate) fn data(&self) -> Result<&[u8], String> {
        let size = match self.kind.as_str() {
            "<f8" | "<i8" => 8,
            "<f4" | "<i4" | "<u4" => 4,
            _ => return Ok(&self.data),
        };
        let mut lengths = self.shape.iter();
        let count = lengths.try_fold(size, |product: usize, &n| product.checked_mul(n));
        if count == Some(self.data.len()) {
            return Ok(&self.data);
        }
        Err(format!(
            "has {} bytes of data, but its shape needs {}: it was cut short or changed",
            self.data.len(),
            count.map_or_else(|| "more than there can be".to_owned(), |n| n.to_string())
        ))
    }
}

fn unclear(problem: impl std::fmt::Display) -> String {
    format!("its header cannot be understood: {problem}")
}

/// Element type and shape of `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }`.
fn parse_header(text: &str) -> Result<(String, Vec<usize>), String> {
    let missing = |key: &str| unclear(format!("{key} is missing in {text:?}"));
    let after = |key: &str| {
        let at = text.find(&format!("'{key}'"))?;
        text[at + key.len() + 2..].trim_start().strip_prefix(':')
    };
    let kind = after("descr").ok_or_else(|| missing("'descr'"))?;
    let kind = kind
        .trim_start()
        .strip_prefix('\'')
        .and_then(|k| k.split_once('\''));
    let (kind, _) = kind.ok_or_else(|| unclear("its 'descr' is no single type of number"))?;
    let order = after("fortran_order").ok_or_else(|| missing("'fortran_order'"))?;
    if order.trim_start().starts_with("True") {
        let problem = "is in Fortran order: save it as numpy.ascontiguousarray(array)";
        return Err(problem.to_owned());
    }
    let shape = after("shape").ok_or_else(|| missing("'shape'"))?;
    let shape = shape
        .trim_start()
        .strip_prefix('(')
        .and_then(|s| s.split_once(')'));
    let (shape, _) = shape.ok_or_else(|| missing("a tuple for 'shape'"))?;
    let lengths = shape.split(',').map(str::trim).filter(|s| !s.is_empty());
    let lengths: Result<Vec<usize>, _> = lengths.map(str::parse).collect();
    let lengths = lengths.map_err(|_| unclear(format!("'shape' is ({shape})")))?;
    Ok((kind.to_owned(), lengths))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::{says, table};

    /// A file of version 1 with this header.
    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [MAGIC, &[1, 0], &length, header.as_bytes(), data].concat()
    }

    const HEADER: &str = "{'descr': '<i4', 'fortran_order': False, 'shape': (2, 1), }";

    /// The number of bytes of an array.
    fn read(bytes: &[u8]) -> Result<usize, String> {
        Ok(Array::parse(bytes)?.data()?.len())
    }

    #[test]
    fn mistakes_are_named() {
        let cases = r#"
            False | True | Fortran order
            2, 1 | 99999999999999999999999, 1 | 'shape' is
            2, 1 | 4611686018427387905, 1 | more than there can be
            2, 1 | 3, 1 | has 8 bytes of data, but its shape needs 12
            'descr' | 'desc' | 'descr' is missing
            '<i4' | [('a', '<i4')] | no single type
        "#;
        for [from, to, expected] in table(cases) {
            let bytes = file(&HEADER.replace(from, to), &[0; 8]);
            says(read(&bytes).unwrap_err(), &[expected]);
        }
        says(read(b"").unwrap_err(), &["does not begin with \\x93NUMPY"]);
        let version = [MAGIC, &[9, 0]].concat();
        says(read(&version).unwrap_err(), &["is .npy of version 9"]);
    }

    #[test]
    fn any_truncation_is_an_error_and_any_flipped_byte_no_panic() {
        let bytes = file(HEADER, &[0; 8]);
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end]).is_err(), "{end}");
        }
        for at in 0..bytes.len() {
            for value in 0..=u8::MAX {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                let _ = read(&damaged);
            }
        }
    }
}
