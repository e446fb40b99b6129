//! An archive of one crate (.usdz): ZIP without packing, whose file begins at a multiple of 64
//! bytes.
//!
//! Format: the USD documentation, "Usdz File Format Specification". No 64-bit extension, which a
//! .usdz must not have: at most 4 GiB.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

use super::super::outcome::Pulse;
use super::crate_file;
use super::stage::Stage;
use crate::formats::zip::{self, LOCAL_LENGTH, Stored};

const ALIGNED: usize = 64;
/// Number of the extra field that pads, as USD's own writer has it.
const PADDING: u16 = 0x1986;

/// Writes the archive; `name` is that of the crate in it.
pub(super) fn write(
    stage: &Stage<'_>,
    name: &str,
    out: &mut BufWriter<&File>,
    pulse: &mut Pulse<'_>,
) -> io::Result<()> {
    let unpadded = LOCAL_LENGTH + name.len() + 4;
    let padding = unpadded.next_multiple_of(ALIGNED) - unpadded;
    let start = unpadded + padding;
    out.write_all(&vec![0; start])?;
    let length = crate_file::write(stage, out, start as u64, pulse)?;
    out.flush()?;
    let sum = checksum(out.get_ref(), start as u64)?;
    let entry = Stored {
        name,
        version: 10,
        checksum: sum,
        length: u32::try_from(length).map_err(io::Error::other)?,
    };
    let mut extra = PADDING.to_le_bytes().to_vec();
    extra.extend((padding as u16).to_le_bytes());
    extra.extend(vec![0; padding]);
    out.seek(SeekFrom::Start(0))?;
    out.write_all(&entry.local(&extra))?;
    out.seek(SeekFrom::Start(start as u64 + length))?;
    let directory = entry.directory(0);
    out.write_all(&directory)?;
    let at = u32::try_from(start as u64 + length).map_err(io::Error::other)?;
    out.write_all(&zip::end(1, directory.len() as u32, at))
}

/// The CRC-32 of all bytes of a file from `start`, whose place is at the end after that.
fn checksum(mut file: &File, start: u64) -> io::Result<u32> {
    file.seek(SeekFrom::Start(start))?;
    let mut hasher = crc32fast::Hasher::new();
    let mut buffer = vec![0; 1 << 18];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok(hasher.finalize()),
            Ok(count) => hasher.update(&buffer[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}
