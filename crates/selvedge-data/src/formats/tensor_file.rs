//! Writing the safetensors container with the same bytes every time.
//!
//! The safetensors crate keeps metadata in a hash map, whose order differs from run to run, and
//! its writer leaves files private; here the metadata are sorted, and the file is written through
//! [`write_atomically`]. Layout: header length as u64 (little-endian), a JSON header padded
//! with spaces to a multiple of eight bytes, then the tensors in the order given, which must be
//! such that each starts aligned (f64 before the rest). Reading is the crate's, except that
//! [`read_header`] refuses names that stand twice, of which the crate takes the last.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::Write;
use std::path::Path;

use safetensors::tensor::Metadata;
use safetensors::{SafeTensorError, SafeTensors};
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, Visitor};
use serde_json::{Map, Value, json};

use crate::formats::atomic::{WriteError, write_atomically};

/// Reads the header of a safetensors file.
///
/// # Errors
/// What the crate refuses, and a name of a tensor or a key of the metadata that stands twice.
pub fn read_header(bytes: &[u8]) -> Result<Metadata, SafeTensorError> {
    let (length, header) = SafeTensors::read_metadata(bytes)?;
    let text = bytes.get(8..8 + length).unwrap_or_default();
    let checked = Keys.deserialize(&mut serde_json::Deserializer::from_slice(text));
    checked.map_err(SafeTensorError::InvalidHeaderDeserialization)?;
    Ok(header)
}

const METADATA: &str = "__metadata__";

/// The keys of an object, and of that of the metadata in it: none may stand twice.
struct Keys;

impl<'de> DeserializeSeed<'de> for Keys {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Keys {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut known = BTreeSet::new();
        while let Some(key) = map.next_key::<String>()? {
            if known.contains(&key) {
                let problem = format!("the key {key:?} stands twice in one object: keep one");
                return Err(A::Error::custom(problem));
            }
            if key == METADATA {
                map.next_value_seed(Self)?;
            } else {
                map.next_value::<IgnoredAny>()?;
            }
            known.insert(key);
        }
        Ok(())
    }
}

/// A tensor to be written.
#[derive(Clone, Debug)]
pub struct TensorOut<'a> {
    /// Name of the tensor in the file.
    pub name: Cow<'a, str>,
    /// Dimensions, slowest first.
    pub shape: Vec<usize>,
    /// Elements in row-major order.
    pub values: TensorValues<'a>,
}

/// Elements of a tensor.
#[derive(Clone, Debug)]
pub enum TensorValues<'a> {
    /// 64-bit floating point.
    F64(Cow<'a, [f64]>),
    /// 32-bit floating point.
    F32(Cow<'a, [f32]>),
    /// 32-bit unsigned integers.
    U32(Cow<'a, [u32]>),
}

impl<'a> TensorOut<'a> {
    /// A tensor of this name, shape and values.
    pub fn new(name: impl Into<Cow<'a, str>>, shape: &[usize], values: TensorValues<'a>) -> Self {
        Self {
            name: name.into(),
            shape: shape.to_vec(),
            values,
        }
    }
}

impl TensorValues<'_> {
    /// Type and size in bytes.
    fn kind(&self) -> (&'static str, usize) {
        match self {
            Self::F64(values) => ("F64", 8 * values.len()),
            Self::F32(values) => ("F32", 4 * values.len()),
            Self::U32(values) => ("U32", 4 * values.len()),
        }
    }

    fn write(&self, out: &mut impl Write) -> std::io::Result<()> {
        match self {
            Self::F64(values) => values
                .iter()
                .try_for_each(|v| out.write_all(&v.to_le_bytes())),
            Self::F32(values) => values
                .iter()
                .try_for_each(|v| out.write_all(&v.to_le_bytes())),
            Self::U32(values) => values
                .iter()
                .try_for_each(|v| out.write_all(&v.to_le_bytes())),
        }
    }
}

/// Writes `tensors` and `metadata` as a safetensors file, all or nothing.
pub fn write_tensors(
    path: &Path,
    tensors: &[TensorOut<'_>],
    metadata: &BTreeMap<&str, String>,
) -> Result<(), WriteError> {
    write_atomically(path, |writer| put_tensors(writer, tensors, metadata))
}

/// Writes the bytes of such a file.
pub(crate) fn put_tensors(
    writer: &mut impl Write,
    tensors: &[TensorOut<'_>],
    metadata: &BTreeMap<&str, String>,
) -> std::io::Result<()> {
    let header = header(tensors, metadata);
    writer.write_all(&(header.len() as u64).to_le_bytes())?;
    writer.write_all(&header)?;
    tensors.iter().try_for_each(|t| t.values.write(writer))
}

fn header(tensors: &[TensorOut<'_>], metadata: &BTreeMap<&str, String>) -> Vec<u8> {
    let mut entries = Map::new();
    entries.insert(METADATA.to_owned(), json!(metadata));
    let mut start = 0;
    for tensor in tensors {
        let (kind, length) = tensor.values.kind();
        let end = start + length;
        let entry = json!({
            "dtype": kind,
            "shape": tensor.shape,
            "data_offsets": [start, end],
        });
        entries.insert(tensor.name.to_string(), entry);
        start = end;
    }
    let mut header = Value::Object(entries).to_string().into_bytes();
    header.resize(header.len().next_multiple_of(8), b' ');
    header
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::says;

    /// A file with this header and a number.
    fn file(header: &str) -> Vec<u8> {
        let length = (header.len() as u64).to_le_bytes();
        [&length[..], header.as_bytes(), &[0; 4]].concat()
    }

    #[test]
    fn a_name_that_stands_twice_is_named() {
        let a = r#""a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}"#;
        let whole = file(&format!(r#"{{"__metadata__":{{"k":"1"}},{a}}}"#));
        assert_eq!(read_header(&whole).unwrap().tensors().len(), 1);
        let twice = [
            ("\"a\"", format!("{{{a},{a}}}")),
            (
                "\"k\"",
                format!(r#"{{"__metadata__":{{"k":"1","k":"2"}},{a}}}"#),
            ),
        ];
        for (name, header) in twice {
            says(
                read_header(&file(&header)).unwrap_err(),
                &["stands twice", name],
            );
        }
    }
}
