//! Reading NumPy's .npz: a ZIP archive of .npy files, stored or deflated.
//!
//! Each array is unpacked and checked against its checksum when it is asked for. Arrays over 4 GB,
//! encrypted entries and other methods are errors. What is written ([`NpzOut`]) is for other
//! programs: safetensors is our own container.

mod points;
mod write;

use std::io::{Cursor, Read};

use zip::ZipArchive;

use crate::formats::npy::Array;

pub(crate) use self::points::NpzPoints;
pub(crate) use self::write::{NpzOut, STORED};

/// An archive of arrays.
#[derive(Clone, Debug)]
pub(crate) struct Npz<'a>(ZipArchive<Cursor<&'a [u8]>>);

impl<'a> Npz<'a> {
    /// The archive in `bytes`.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        let archive = ZipArchive::new(Cursor::new(bytes)).map(Self);
        archive.map_err(|error| format!("is no complete .npz archive: {error}"))
    }

    /// The names of the arrays.
    pub(crate) fn names(&self) -> Vec<&str> {
        let names = self.0.file_names();
        names
            .map(|name| name.strip_suffix(".npy").unwrap_or(name))
            .collect()
    }

    pub(crate) fn array(&self, name: &str) -> Result<Option<Array>, String> {
        let number = self.0.index_for_name(&format!("{name}.npy"));
        let number = number.or_else(|| self.0.index_for_name(name));
        let read = |number| Array::parse(&self.unpack(number)?);
        number.map(read).transpose()
    }

    fn unpack(&self, number: usize) -> Result<Vec<u8>, String> {
        // A copy shares the directory.
        let mut archive = self.0.clone();
        let entry = archive.by_index(number);
        let entry = entry.map_err(|error| format!("it cannot be unpacked: {error}"))?;
        let length = entry.size();
        if length >= u64::from(u32::MAX) {
            return Err("it is larger than 4 GB".to_owned());
        }
        let mut bytes = Vec::new();
        // One byte more than there may be: the checksum is looked at where the entry ends.
        let read = entry.take(length + 1).read_to_end(&mut bytes);
        match read {
            Ok(count) if count as u64 == length => Ok(bytes),
            Ok(count) => Err(format!("it has {count} bytes, not the {length} it says")),
            Err(error) => Err(format!("it is damaged: {error}")),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
