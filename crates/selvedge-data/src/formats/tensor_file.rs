//! Writing the safetensors container with the same bytes every time.
//!
//! The safetensors crate keeps metadata in a hash map, whose order differs from run to run, and
//! its writer leaves files private; here the metadata are sorted, and the file is written through
//! [`write_atomically`]. Layout: header length as u64 (little-endian), a JSON header padded
//! with spaces to a multiple of eight bytes, then the tensors in the order given, which must be
//! such that each starts aligned (f64 before the rest). Reading is the crate's.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use safetensors::tensor::Metadata;
use safetensors::{SafeTensorError, SafeTensors};
use serde_json::{Map, Value, json};

use crate::formats::atomic::{WriteError, write_atomically};

/// Reads the header of a safetensors file.
///
/// # Errors
/// What the crate refuses.
pub fn read_header(bytes: &[u8]) -> Result<Metadata, SafeTensorError> {
    SafeTensors::read_metadata(bytes).map(|(_, header)| header)
}

const METADATA: &str = "__metadata__";

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
    /// Bytes.
    U8(Cow<'a, [u8]>),
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
            Self::U8(values) => ("U8", values.len()),
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
            Self::U8(values) => out.write_all(values),
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
