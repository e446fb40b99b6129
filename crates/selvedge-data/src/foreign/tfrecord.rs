//! TFRecord: records one after another, each its length (u64, little-endian), the masked CRC-32C of
//! the length, the data, and the masked CRC-32C of the data. There is no header and no end mark: a
//! file that was cut between two records cannot be told from a shorter one.
//!
//! Format: TensorFlow's `tensorflow/core/lib/io/record_writer.h`. Lengths are never trusted with
//! memory: data are read as far as they go.

use std::io::{Read, Seek, SeekFrom};

use super::crc32c::masked_crc32c;
use super::error::{ForeignProblem, RecordProblem};

const LENGTH_BYTES: u64 = 8;
const CHECKSUM_BYTES: u64 = 4;
const HEAD_BYTES: u64 = LENGTH_BYTES + CHECKSUM_BYTES;

/// Place of a record in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RecordPlace {
    /// Number of the record, from 0.
    pub(super) number: usize,
    /// Byte at which it begins.
    pub(super) offset: u64,
    /// Bytes of data.
    pub(super) length: u64,
}

impl RecordPlace {
    /// Byte at which its data begin.
    pub(super) fn data_offset(&self) -> u64 {
        self.offset + HEAD_BYTES
    }

    pub(super) fn error(&self, offset: u64, problem: RecordProblem) -> ForeignProblem {
        ForeignProblem::Record {
            record: self.number,
            offset,
            problem,
        }
    }
}

/// Finds all records by their lengths, without reading their data.
pub(super) fn scan(file: &mut (impl Read + Seek)) -> Result<Vec<RecordPlace>, ForeignProblem> {
    let size = file.seek(SeekFrom::End(0)).map_err(ForeignProblem::Read)?;
    let mut places = Vec::new();
    let mut offset = 0;
    while offset < size {
        let mut place = RecordPlace {
            number: places.len(),
            offset,
            length: 0,
        };
        if size - offset < HEAD_BYTES {
            let problem = truncated("a record's length", HEAD_BYTES, size - offset);
            return Err(place.error(offset, problem));
        }
        file.seek(SeekFrom::Start(offset))
            .map_err(ForeignProblem::Read)?;
        let length = read_bytes(file, LENGTH_BYTES)?;
        let stored = read_checksum(file)?;
        check("its length", &length, stored).map_err(|problem| place.error(offset, problem))?;
        place.length = length
            .iter()
            .rev()
            .fold(0, |sum, &b| (sum << 8) | u64::from(b));
        let left = size - place.data_offset();
        let needed = place.length.saturating_add(CHECKSUM_BYTES);
        if left < needed {
            let problem = truncated("a record's data and checksum", needed, left);
            return Err(place.error(place.data_offset(), problem));
        }
        offset = place.data_offset() + needed;
        places.push(place);
    }
    Ok(places)
}

/// The data of a record, if they agree with their checksum.
pub(super) fn read(
    file: &mut (impl Read + Seek),
    place: &RecordPlace,
) -> Result<Vec<u8>, ForeignProblem> {
    file.seek(SeekFrom::Start(place.data_offset()))
        .map_err(ForeignProblem::Read)?;
    let data = read_bytes(file, place.length)?;
    let stored = read_checksum(file)?;
    check("its data", &data, stored)
        .map_err(|problem| place.error(place.data_offset(), problem))?;
    Ok(data)
}

/// `count` bytes; an error of the system where the file has shrunk under us.
fn read_bytes(file: &mut impl Read, count: u64) -> Result<Vec<u8>, ForeignProblem> {
    let mut bytes = Vec::new();
    let found = file
        .take(count)
        .read_to_end(&mut bytes)
        .map_err(ForeignProblem::Read)?;
    if (found as u64) < count {
        let error = std::io::Error::from(std::io::ErrorKind::UnexpectedEof);
        return Err(ForeignProblem::Read(error));
    }
    Ok(bytes)
}

fn read_checksum(file: &mut impl Read) -> Result<u32, ForeignProblem> {
    let bytes = read_bytes(file, CHECKSUM_BYTES)?;
    Ok(bytes
        .iter()
        .rev()
        .fold(0, |sum, &b| (sum << 8) | u32::from(b)))
}

fn check(what: &'static str, bytes: &[u8], expected: u32) -> Result<(), RecordProblem> {
    let found = masked_crc32c(bytes);
    if found == expected {
        return Ok(());
    }
    Err(RecordProblem::Checksum {
        what,
        expected,
        found,
    })
}

fn truncated(what: &'static str, expected: u64, found: u64) -> RecordProblem {
    RecordProblem::Truncated {
        what,
        expected,
        found,
    }
}
