//! tf.train.Example, decoded by hand: a map from names to lists of byte strings, floats or
//! integers, in the wire format of Protocol Buffers.
//!
//! ```text
//! Example  { Features features = 1; }
//! Features { map<string, Feature> feature = 1; }      // entries { key = 1; value = 2 }
//! Feature  { BytesList = 1 | FloatList = 2 | Int64List = 3 }
//! ```
//!
//! Unknown fields are passed over, as the format wants it. Only byte strings are kept: that is all
//! that the data we read have. Of a name given twice the last is taken.

use std::collections::BTreeMap;

/// The features of an example.
#[derive(Debug, PartialEq)]
pub(super) struct Example<'a> {
    pub(super) features: BTreeMap<&'a str, Feature<'a>>,
}

/// One feature.
#[derive(Debug, PartialEq)]
pub(super) enum Feature<'a> {
    /// Byte strings, each with the place where it begins.
    Bytes(Vec<(usize, &'a [u8])>),
    Floats,
    Integers,
    Empty,
}

/// Bytes that are no example.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct ExampleError {
    /// Byte, from the beginning of the example.
    pub(super) at: usize,
    pub(super) problem: String,
}

/// Decodes an example.
pub(super) fn decode(bytes: &[u8]) -> Result<Example<'_>, ExampleError> {
    let mut features = BTreeMap::new();
    for part in messages(Part { at: 0, bytes }, 1)? {
        for entry in messages(part, 1)? {
            let key = messages(entry, 1)?.pop();
            let key = key.map_or(Ok(""), |key| {
                std::str::from_utf8(key.bytes).map_err(|_| ExampleError {
                    at: key.at,
                    problem: "the name of a feature is not UTF-8".to_owned(),
                })
            })?;
            let value = messages(entry, 2)?.pop();
            let feature = value.map_or(Ok(Feature::Empty), feature)?;
            features.insert(key, feature);
        }
    }
    Ok(Example { features })
}

fn feature(part: Part<'_>) -> Result<Feature<'_>, ExampleError> {
    let mut found = Feature::Empty;
    for field in Fields(part) {
        let (number, _, value) = field?;
        found = match (number, value) {
            (1, Some(list)) => {
                let values = messages(list, 1)?;
                Feature::Bytes(values.iter().map(|v| (v.at, v.bytes)).collect())
            }
            (2, Some(_)) => Feature::Floats,
            (3, Some(_)) => Feature::Integers,
            _ => found,
        };
    }
    Ok(found)
}

/// A stretch of the example.
#[derive(Clone, Copy)]
struct Part<'a> {
    /// Offset of the first byte.
    at: usize,
    bytes: &'a [u8],
}

/// The contents of all fields `number` of a message that have contents.
fn messages<'a>(part: Part<'a>, number: u64) -> Result<Vec<Part<'a>>, ExampleError> {
    let mut found = Vec::new();
    for field in Fields(part) {
        match field? {
            (n, _, Some(value)) if n == number => found.push(value),
            (n, at, None) if n == number => {
                let problem = format!("field {n} is a number where a message or text is expected");
                return Err(ExampleError { at, problem });
            }
            _ => (),
        }
    }
    Ok(found)
}

/// The fields of a message: number, place, and contents where they have a length. Ends after an
/// error.
struct Fields<'a>(Part<'a>);

type Field<'a> = (u64, usize, Option<Part<'a>>);

impl<'a> Iterator for Fields<'a> {
    type Item = Result<Field<'a>, ExampleError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.bytes.is_empty() {
            return None;
        }
        let field = self.field();
        if field.is_err() {
            self.0.bytes = &[];
        }
        Some(field)
    }
}

impl<'a> Fields<'a> {
    fn field(&mut self) -> Result<Field<'a>, ExampleError> {
        let at = self.0.at;
        let tag = self.varint()?;
        let value = match tag & 7 {
            0 => self.varint().map(|_| None)?,
            1 => self.take(8).map(|_| None)?,
            2 => {
                let length = self.varint()?;
                Some(self.take(length)?)
            }
            5 => self.take(4).map(|_| None)?,
            kind => {
                let problem = format!("a field of wire type {kind}, known are 0, 1, 2 and 5");
                return Err(ExampleError { at, problem });
            }
        };
        Ok((tag >> 3, at, value))
    }

    fn varint(&mut self) -> Result<u64, ExampleError> {
        let at = self.0.at;
        let mut value = 0;
        for place in 0..10 {
            let byte = self.take(1)?.bytes[0];
            value |= u64::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(ExampleError {
            at,
            problem: "a number of more than ten bytes".to_owned(),
        })
    }

    fn take(&mut self, count: u64) -> Result<Part<'a>, ExampleError> {
        let Part { at, bytes } = self.0;
        let split = usize::try_from(count)
            .ok()
            .and_then(|n| bytes.split_at_checked(n));
        let Some((taken, rest)) = split else {
            let left = bytes.len();
            let problem = format!("needs {count} bytes more, but {left} are left");
            return Err(ExampleError { at, problem });
        };
        self.0 = Part {
            at: at + taken.len(),
            bytes: rest,
        };
        Ok(Part { at, bytes: taken })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Field 1 of length `n` around `inner`.
    fn wrap(number: u8, inner: &[u8]) -> Vec<u8> {
        let mut bytes = vec![number << 3 | 2, inner.len() as u8];
        bytes.extend(inner);
        bytes
    }

    fn small() -> Vec<u8> {
        let value = wrap(1, &wrap(1, b"abc"));
        let entry = [wrap(1, b"x"), wrap(2, &value)].concat();
        let floats = [wrap(1, b"y"), wrap(2, &wrap(2, &[]))].concat();
        // A field 9 with the number 300, which no version of the format knows.
        let unknown = [9 << 3, 0xac, 0x02];
        [
            &unknown[..],
            &wrap(1, &[wrap(1, &entry), wrap(1, &floats)].concat()),
        ]
        .concat()
    }

    #[test]
    fn features_are_found_by_name_with_their_places() {
        let bytes = small();
        let example = decode(&bytes).unwrap();
        let place = bytes.windows(3).position(|w| w == b"abc").unwrap();
        let expected = Feature::Bytes(vec![(place, &b"abc"[..])]);
        assert_eq!(example.features["x"], expected);
        assert_eq!(example.features["y"], Feature::Floats);
        assert_eq!(decode(&[]).unwrap().features.len(), 0);
    }

    #[test]
    fn any_damage_is_an_error_or_another_example_never_a_panic() {
        let bytes = small();
        for end in 0..bytes.len() {
            // Only where the unknown field ends is the rest nothing at all.
            assert_eq!(decode(&bytes[..end]).is_ok(), end == 0 || end == 3, "{end}");
        }
        for at in 0..bytes.len() {
            for value in 0..=u8::MAX {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                if let Err(error) = decode(&damaged) {
                    assert!(error.at <= damaged.len(), "{error:?}");
                }
            }
        }
    }

    #[test]
    fn numbers_without_an_end_and_lengths_beyond_the_end_are_named() {
        let error = decode(&[0xff; 12]).unwrap_err();
        assert_eq!((error.at, error.problem.contains("ten bytes")), (0, true));
        // A length of 2⁶³ bytes.
        let huge = [&[0x0a][..], &[0xff; 8], &[0x7f]].concat();
        let error = decode(&huge).unwrap_err();
        assert!(error.problem.contains("but 0 are left"), "{error:?}");
        let error = decode(&[0x0b]).unwrap_err();
        assert!(error.problem.contains("wire type 3"), "{error:?}");
    }
}
