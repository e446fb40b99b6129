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
pub(crate) type Npz<'a> = ZipArchive<Cursor<&'a [u8]>>;

/// The array of this name, if there is one.
pub(crate) fn array(archive: &Npz<'_>, name: &str) -> Result<Option<Array>, String> {
    let number = archive.index_for_name(&format!("{name}.npy"));
    let number = number.or_else(|| archive.index_for_name(name));
    let read = |number| Array::parse(&unpack(archive, number)?);
    number.map(read).transpose()
}

fn unpack(archive: &Npz<'_>, number: usize) -> Result<Vec<u8>, String> {
    // A copy shares the directory.
    let mut archive = archive.clone();
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

#[cfg(test)]
pub(crate) mod tests;
