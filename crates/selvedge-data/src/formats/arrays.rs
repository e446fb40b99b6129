//! Arrays by name, from .safetensors or NumPy's archive (.npz) alike.

use std::collections::HashMap;
use std::fmt::Display;
use std::io::Cursor;

use safetensors::{SafeTensorError, SafeTensors};

use super::file_error::Problem;
use super::npz::{self, Npz};
use super::tensor_file::read_header;

impl Problem {
    pub(crate) fn array(name: &str, expected: &str, found: impl Display) -> Self {
        Self(format!("array {name}: expected {expected}, found {found}"))
    }
}

/// Arrays by their names, in either container.
pub struct ArrayFile<'a>(Container<'a>);

enum Container<'a> {
    Npz(Npz<'a>),
    Safetensors(SafeTensors<'a>),
}

/// An array of a file.
pub struct Array<T> {
    pub(crate) name: String,
    /// Type of its elements in the file.
    kind: String,
    /// Dimensions, slowest first.
    pub(crate) shape: Vec<usize>,
    /// Elements in row-major order.
    pub values: Vec<T>,
}

impl<T> Array<T> {
    /// The array, which must have this shape; `None` is any length.
    ///
    /// # Errors
    /// Another shape.
    pub fn of_shape(self, shape: &[Option<usize>]) -> Result<Self, Problem> {
        let same = |(e, f): (&Option<usize>, &usize)| e.is_none_or(|e| e == *f);
        if self.shape.len() == shape.len() && shape.iter().zip(&self.shape).all(same) {
            return Ok(self);
        }
        let lengths: Vec<String> = shape
            .iter()
            .map(|length| length.map_or_else(|| "any".to_owned(), |length| length.to_string()))
            .collect();
        Err(self.wrong(&format!("{} [{}]", self.kind, lengths.join(", "))))
    }

    /// Its only element: of an array of one, or of one without dimensions, as NumPy has a number.
    pub(crate) fn single(mut self) -> Result<T, Problem> {
        match (self.shape.as_slice(), self.values.pop()) {
            ([] | [1], Some(value)) => Ok(value),
            _ => Err(self.wrong(&format!("one number, {} [1]", self.kind))),
        }
    }

    /// The error that its type and shape are not as `expected`.
    pub(crate) fn wrong(&self, expected: &str) -> Problem {
        let found = format!("{} {:?}", self.kind, self.shape);
        Problem::array(&self.name, expected, found)
    }
}

impl<'a> ArrayFile<'a> {
    /// The arrays and the metadata in the bytes of a .safetensors.
    ///
    /// # Errors
    /// Bytes that are no whole file.
    pub fn safetensors(bytes: &'a [u8]) -> Result<(Self, HashMap<String, String>), Problem> {
        let wrong = |error: SafeTensorError| {
            Problem(format!(
                "is no complete safetensors file ({error}): it may have been cut short, or be another format"
            ))
        };
        let header = read_header(bytes).map_err(wrong)?;
        let file = SafeTensors::deserialize(bytes).map_err(wrong)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        Ok((Self(Container::Safetensors(file)), metadata))
    }

    /// The arrays in the bytes of an .npz.
    pub(crate) fn npz(bytes: &'a [u8]) -> Result<Self, Problem> {
        let archive = Npz::new(Cursor::new(bytes)).map(Container::Npz);
        archive
            .map(Self)
            .map_err(|error| Problem(format!("is no complete .npz archive: {error}")))
    }

    /// The names of all arrays, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = match &self.0 {
            Container::Npz(file) => {
                let names = file.file_names();
                let plain = |name: &str| name.strip_suffix(".npy").unwrap_or(name).to_owned();
                names.map(plain).collect()
            }
            Container::Safetensors(file) => file.names().into_iter().map(str::to_owned).collect(),
        };
        names.sort_unstable();
        names
    }

    /// Returns true if there is an array of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.names().iter().any(|found| found == name)
    }

    /// An array of f64, or of f32, which is widened; in an .npz whole numbers too.
    pub(crate) fn floats(&self, name: &str) -> Result<Array<f64>, Problem> {
        let widened = |word| f64::from(f32::from_le_bytes(word));
        self.read(name, "F64 or F32", |kind, data| match kind {
            "F64" | "<f8" => Some(words(data, f64::from_le_bytes)),
            "F32" | "<f4" => Some(words(data, widened)),
            "<i4" => Some(words(data, |word| f64::from(i32::from_le_bytes(word)))),
            "<i8" => Some(words(data, |word| i64::from_le_bytes(word) as f64)),
            _ => None,
        })
    }

    /// An array of f32; in an .npz f64 are narrowed.
    ///
    /// # Errors
    /// No array of this name, or of another type.
    pub fn singles(&self, name: &str) -> Result<Array<f32>, Problem> {
        let narrowed = |word| f64::from_le_bytes(word) as f32;
        self.read(name, "F32", |kind, data| match kind {
            "F32" | "<f4" => Some(words(data, f32::from_le_bytes)),
            "<f8" => Some(words(data, narrowed)),
            _ => None,
        })
    }

    /// An array of bytes.
    pub(crate) fn bytes(&self, name: &str) -> Result<Array<u8>, Problem> {
        self.read(name, "U8", |kind, data| {
            (kind == "U8").then(|| data.to_vec())
        })
    }

    /// An array of whole numbers that fit u32.
    pub(crate) fn wholes(&self, name: &str) -> Result<Array<u32>, Problem> {
        let read = self.read(name, "U32, I32 or I64", |kind, data| match kind {
            "U32" | "<u4" => Some(words(data, |word| i64::from(u32::from_le_bytes(word)))),
            "I32" | "<i4" => Some(words(data, |word| i64::from(i32::from_le_bytes(word)))),
            "I64" | "<i8" => Some(words(data, i64::from_le_bytes)),
            _ => None,
        })?;
        let whole = |value: i64| {
            let expected = "numbers from 0 to 4294967295";
            u32::try_from(value).map_err(|_| Problem::array(name, expected, value))
        };
        let values = read.values.into_iter().map(whole);
        Ok(Array {
            values: values.collect::<Result<_, _>>()?,
            name: read.name,
            kind: read.kind,
            shape: read.shape,
        })
    }

    /// The elements of an array by `decode`, which is given their type and their bytes and knows
    /// the types that are `expected`.
    fn read<T>(
        &self,
        name: &str,
        expected: &str,
        decode: impl Fn(&str, &[u8]) -> Option<Vec<T>>,
    ) -> Result<Array<T>, Problem> {
        let missing = || {
            let found = self.names().join(", ");
            Problem(format!("has no array named {name} (found {found})"))
        };
        let within = |problem: String| Problem(format!("array {name}: {problem}"));
        let (kind, shape, values) = match &self.0 {
            Container::Npz(file) => {
                let array = npz::array(file, name).map_err(within)?;
                let array = array.ok_or_else(missing)?;
                let values = decode(&array.kind, array.data().map_err(within)?);
                (array.kind, array.shape, values)
            }
            Container::Safetensors(file) => {
                let tensor = file.tensor(name).map_err(|_| missing())?;
                let kind = tensor.dtype().to_string();
                let values = decode(&kind, tensor.data());
                (kind, tensor.shape().to_vec(), values)
            }
        };
        let array = Array {
            name: name.to_owned(),
            kind,
            shape,
            values: Vec::new(),
        };
        match values {
            Some(values) => Ok(Array { values, ..array }),
            None => Err(array.wrong(expected)),
        }
    }
}

fn words<const N: usize, T>(bytes: &[u8], read: impl Fn([u8; N]) -> T) -> Vec<T> {
    bytes.as_chunks::<N>().0.iter().copied().map(read).collect()
}
