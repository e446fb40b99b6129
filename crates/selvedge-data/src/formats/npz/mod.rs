//! Reading NumPy's .npz: a ZIP archive of .npy files, stored or deflated.
//!
//! The archive is read through its central directory; each array is decoded and checked against its
//! checksum when it is asked for. Archives over 4 GB, encrypted entries and other methods are
//! errors. What is written ([`write_archive`]) is for other programs: safetensors is our own
//! container.

mod points;
mod write;

use crate::formats::npy::Array;
use crate::formats::zip::{DIRECTORY, DIRECTORY_LENGTH, END, END_LENGTH, LOCAL, LOCAL_LENGTH};

pub(crate) use self::points::NpzPoints;
pub(crate) use self::write::{EntryOut, archive_bytes, write_archive};

/// An archive of arrays.
#[derive(Clone, Debug)]
pub(crate) struct Npz<'a> {
    bytes: &'a [u8],
    entries: Vec<Entry>,
}

#[derive(Clone, Debug)]
struct Entry {
    /// Without the `.npy`.
    name: String,
    method: u16,
    crc: u32,
    compressed: usize,
    uncompressed: usize,
    header: usize,
}

/// A field of this value is elsewhere, in a record for archives over 4 GB.
const ELSEWHERE: usize = 0xffff_ffff;

impl<'a> Npz<'a> {
    /// The archive in `bytes`.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        let cut = || incomplete("it ends too early");
        // The comment at the end is at most 65535 bytes long.
        let first = bytes.len().saturating_sub(END_LENGTH + 0xffff);
        let end = (first..=bytes.len().saturating_sub(END_LENGTH))
            .rev()
            .find(|&at| number::<4>(bytes, at) == Some(END as usize))
            .ok_or_else(|| incomplete("it has no directory"))?;
        let count = number::<2>(bytes, end + 10).ok_or_else(cut)?;
        let mut at = number::<4>(bytes, end + 16).ok_or_else(cut)?;
        let mut entries = Vec::with_capacity(count);
        for _ in 0..count {
            let (entry, next) = directory_entry(bytes, at)?;
            entries.push(entry);
            at = next;
        }
        Ok(Self { bytes, entries })
    }

    /// The names of the arrays.
    pub(crate) fn names(&self) -> Vec<&str> {
        self.entries.iter().map(|e| e.name.as_str()).collect()
    }

    pub(crate) fn array(&self, name: &str) -> Result<Option<Array>, String> {
        let entry = self.entries.iter().find(|entry| entry.name == name);
        let read = |entry| Array::parse(&self.unpack(entry)?);
        entry.map(read).transpose()
    }

    fn unpack(&self, entry: &Entry) -> Result<Vec<u8>, &'static str> {
        const CUT: &str = "the archive ends in the middle of it";
        if number::<4>(self.bytes, entry.header) != Some(LOCAL as usize) {
            return Err("it is not where the directory says");
        }
        let [name, extra] = [26, 28].map(|at| number::<2>(self.bytes, entry.header + at));
        let start = entry.header + LOCAL_LENGTH + name.ok_or(CUT)? + extra.ok_or(CUT)?;
        let packed = start
            .checked_add(entry.compressed)
            .and_then(|end| self.bytes.get(start..end))
            .ok_or(CUT)?;
        let bytes = match entry.method {
            0 => packed.to_vec(),
            8 => miniz_oxide::inflate::decompress_to_vec_with_limit(packed, entry.uncompressed)
                .map_err(|_| "it cannot be decompressed")?,
            _ => return Err("it is packed by a method other than deflate"),
        };
        if bytes.len() != entry.uncompressed || crc32fast::hash(&bytes) != entry.crc {
            return Err("it is damaged: its checksum differs");
        }
        Ok(bytes)
    }
}

fn incomplete(problem: &str) -> String {
    format!("is no complete .npz archive: {problem}")
}

/// The entry of the directory at `at`, and where the next one begins.
fn directory_entry(bytes: &[u8], at: usize) -> Result<(Entry, usize), String> {
    let cut = || incomplete("its directory ends too early");
    if number::<4>(bytes, at) != Some(DIRECTORY as usize) {
        return Err(incomplete("its directory is damaged"));
    }
    let short = |offset| number::<2>(bytes, at + offset).ok_or_else(cut);
    let long = |offset| number::<4>(bytes, at + offset).ok_or_else(cut);
    let (name_length, extra, comment) = (short(28)?, short(30)?, short(32)?);
    let name = bytes
        .get(at + DIRECTORY_LENGTH..at + DIRECTORY_LENGTH + name_length)
        .ok_or_else(cut)?;
    let name = String::from_utf8_lossy(name);
    let entry = Entry {
        name: name.strip_suffix(".npy").unwrap_or(&name).to_owned(),
        method: short(10)? as u16,
        crc: long(16)? as u32,
        compressed: long(20)?,
        uncompressed: long(24)?,
        header: long(42)?,
    };
    if [entry.compressed, entry.uncompressed, entry.header].contains(&ELSEWHERE) {
        return Err(incomplete("it is larger than 4 GB"));
    }
    let next = at + DIRECTORY_LENGTH + name_length + extra + comment;
    Ok((entry, next))
}

/// The little-endian number of `N` bytes at `at`.
fn number<const N: usize>(bytes: &[u8], at: usize) -> Option<usize> {
    let digits = bytes.get(at..at.checked_add(N)?)?;
    let whole = digits.iter().rev().fold(0, |n, d| n << 8 | u64::from(*d));
    usize::try_from(whole).ok()
}

#[cfg(test)]
pub(crate) mod tests;
