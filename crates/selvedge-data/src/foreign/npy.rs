//! Reading .npy: a magic number, a version, a header that is a Python dictionary of `descr`,
//! `fortran_order` and `shape`, and the elements.
//!
//! Format: numpy's `numpy/lib/format.py`, versions 1 to 3. Little-endian numbers in C order only.
//! A reader of our own: the ones there are bring a parser generator for this one line of Python.

use std::path::Path;

use super::error::{ForeignError, ForeignProblem, NpyProblem};

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array and its shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array<T> {
    pub(super) shape: Vec<usize>,
    /// Row by row.
    pub(super) values: Vec<T>,
}

/// Reads an array of floating-point numbers, all finite. `shape` has `None` where any length will
/// do.
pub(super) fn read_floats(
    path: &Path,
    shape: &[Option<usize>],
) -> Result<Array<f64>, ForeignError> {
    read(path, shape, parse_floats)
}

/// Reads an array of integers, none negative.
pub(super) fn read_indices(
    path: &Path,
    shape: &[Option<usize>],
) -> Result<Array<u32>, ForeignError> {
    read(path, shape, parse_indices)
}

fn read<T>(
    path: &Path,
    shape: &[Option<usize>],
    parse: impl Fn(&[u8], &[Option<usize>]) -> Result<Array<T>, NpyProblem>,
) -> Result<Array<T>, ForeignError> {
    let bytes = std::fs::read(path).map_err(ForeignProblem::Read);
    bytes
        .and_then(|bytes| Ok(parse(&bytes, shape)?))
        .map_err(|problem| ForeignError {
            path: path.to_owned(),
            problem,
        })
}

fn parse_floats(bytes: &[u8], shape: &[Option<usize>]) -> Result<Array<f64>, NpyProblem> {
    let raw = Raw::new(bytes)?;
    let values: Vec<f64> = match raw.kind.as_str() {
        "<f4" => {
            let words = raw.elements::<4>(shape)?;
            words
                .iter()
                .map(|w| f64::from(f32::from_le_bytes(*w)))
                .collect()
        }
        "<f8" => {
            let words = raw.elements::<8>(shape)?;
            words.iter().map(|w| f64::from_le_bytes(*w)).collect()
        }
        _ => return Err(raw.wrong_type("little-endian floats, <f4 or <f8")),
    };
    if let Some(element) = values.iter().position(|v| !v.is_finite()) {
        return Err(NpyProblem::Value {
            element,
            found: values[element].to_string(),
            why: "every number must be finite",
        });
    }
    let shape = raw.shape;
    Ok(Array { shape, values })
}

fn parse_indices(bytes: &[u8], shape: &[Option<usize>]) -> Result<Array<u32>, NpyProblem> {
    let raw = Raw::new(bytes)?;
    let values: Vec<i64> = match raw.kind.as_str() {
        "<i4" => {
            let words = raw.elements::<4>(shape)?;
            words
                .iter()
                .map(|w| i64::from(i32::from_le_bytes(*w)))
                .collect()
        }
        "<u4" => {
            let words = raw.elements::<4>(shape)?;
            words
                .iter()
                .map(|w| i64::from(u32::from_le_bytes(*w)))
                .collect()
        }
        "<i8" => {
            let words = raw.elements::<8>(shape)?;
            words.iter().map(|w| i64::from_le_bytes(*w)).collect()
        }
        _ => return Err(raw.wrong_type("little-endian integers, <i4, <u4 or <i8")),
    };
    let index = |(element, value): (usize, &i64)| {
        u32::try_from(*value).map_err(|_| NpyProblem::Value {
            element,
            found: value.to_string(),
            why: "a vertex has a number from 0 to 4294967295",
        })
    };
    let values = values
        .iter()
        .enumerate()
        .map(index)
        .collect::<Result<_, _>>()?;
    let shape = raw.shape;
    Ok(Array { shape, values })
}

/// A file with its header understood.
struct Raw<'a> {
    kind: String,
    shape: Vec<usize>,
    data: &'a [u8],
}

impl<'a> Raw<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, NpyProblem> {
        let short = |expected| NpyProblem::Header {
            expected,
            found: bytes.len(),
        };
        let rest = bytes.strip_prefix(MAGIC).ok_or(NpyProblem::Magic)?;
        let &[version, _, ref rest @ ..] = rest else {
            return Err(short(MAGIC.len() + 2));
        };
        let (length, start) = match (version, rest) {
            (1, &[a, b, ..]) => (usize::from(u16::from_le_bytes([a, b])), 10),
            (2 | 3, &[a, b, c, d, ..]) => (u32::from_le_bytes([a, b, c, d]) as usize, 12),
            (1..=3, _) => return Err(short(12)),
            (found, _) => return Err(NpyProblem::Version { found }),
        };
        let end = start + length;
        let header = bytes.get(start..end).ok_or_else(|| short(end))?;
        let header = std::str::from_utf8(header)
            .map_err(|_| NpyProblem::Dictionary("it is no text".to_owned()))?;
        let (kind, shape) = parse_header(header)?;
        Ok(Self {
            kind,
            shape,
            data: &bytes[end..],
        })
    }

    /// The elements, each of `N` bytes, if the array has the shape `expected`.
    fn elements<const N: usize>(
        &self,
        expected: &[Option<usize>],
    ) -> Result<&'a [[u8; N]], NpyProblem> {
        let same = |(e, &f): (&Option<usize>, &usize)| e.is_none_or(|e| e == f);
        let fits = self.shape.len() == expected.len() && expected.iter().zip(&self.shape).all(same);
        if !fits {
            let expected = expected.iter();
            let lengths: Vec<String> = expected
                .map(|e| e.map_or_else(|| "any".to_owned(), |e| e.to_string()))
                .collect();
            return Err(NpyProblem::Shape {
                expected: format!("[{}]", lengths.join(", ")),
                found: format!("{:?}", self.shape),
            });
        }
        let count = self
            .shape
            .iter()
            .try_fold(N, |product, &n| product.checked_mul(n));
        if count != Some(self.data.len()) {
            return Err(NpyProblem::Length {
                expected: count
                    .map_or_else(|| "more than there can be".to_owned(), |n| n.to_string()),
                found: self.data.len(),
            });
        }
        Ok(self.data.as_chunks::<N>().0)
    }

    fn wrong_type(&self, expected: &'static str) -> NpyProblem {
        NpyProblem::Type {
            expected,
            found: self.kind.clone(),
        }
    }
}

/// Element type and shape of `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 2), }`.
fn parse_header(text: &str) -> Result<(String, Vec<usize>), NpyProblem> {
    let missing = |key: &str| NpyProblem::Dictionary(format!("{key} is missing in {text:?}"));
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
        NpyProblem::Dictionary("its 'descr' is no single type of number".to_owned())
    })?;
    let order = after("fortran_order").ok_or_else(|| missing("'fortran_order'"))?;
    if order.trim_start().starts_with("True") {
        return Err(NpyProblem::Fortran);
    }
    let shape = after("shape").ok_or_else(|| missing("'shape'"))?;
    let shape = shape
        .trim_start()
        .strip_prefix('(')
        .and_then(|s| s.split_once(')'));
    let (shape, _) = shape.ok_or_else(|| missing("a tuple for 'shape'"))?;
    let lengths = shape.split(',').map(str::trim).filter(|s| !s.is_empty());
    let lengths: Result<Vec<usize>, _> = lengths.map(str::parse).collect();
    let lengths = lengths.map_err(|_| NpyProblem::Dictionary(format!("'shape' is ({shape})")))?;
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

    #[test]
    fn an_array_is_read_as_it_was_written() {
        let bytes = file(HEADER, &[1, 0, 0, 0, 0, 1, 0, 0]);
        let array = parse_indices(&bytes, &[Some(2), None]).unwrap();
        assert_eq!((array.shape, array.values), (vec![2, 1], vec![1, 256]));
    }

    #[test]
    fn mistakes_are_named() {
        let data = [1, 0, 0, 0, 2, 0, 0, 0];
        let error = |from: &str, to: &str, data: &[u8]| {
            let bytes = file(&HEADER.replace(from, to), data);
            parse_indices(&bytes, &[None, Some(1)])
                .unwrap_err()
                .to_string()
        };
        for (from, to, expected) in [
            ("False", "True", "Fortran order"),
            ("<i4", ">i4", "elements of type \">i4\""),
            (
                "(2, 1)",
                "(2, 3)",
                "has the shape [2, 3], expected [any, 1]",
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
            let found = error(from, to, &data);
            assert!(found.contains(expected), "{found} lacks {expected}");
        }
        let negative = [0xff; 8];
        assert!(error("", "", &negative).contains("element 0 is -1"));
        assert_eq!(parse_indices(b"", &[]), Err(NpyProblem::Magic));
        let version = [MAGIC, &[9, 0]].concat();
        assert_eq!(
            parse_floats(&version, &[]),
            Err(NpyProblem::Version { found: 9 })
        );
    }

    #[test]
    fn any_truncation_is_an_error_and_any_flipped_byte_no_panic() {
        let bytes = file(&HEADER.replace("<i4", "<f4"), &[0, 0, 128, 63, 0, 0, 0, 64]);
        let shape = [None, Some(1)];
        assert_eq!(parse_floats(&bytes, &shape).unwrap().values, [1.0, 2.0]);
        for end in 0..bytes.len() {
            assert!(parse_floats(&bytes[..end], &shape).is_err(), "{end}");
        }
        for at in 0..bytes.len() {
            for value in 0..=u8::MAX {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                let _ = parse_floats(&damaged, &shape);
            }
        }
    }
}
