//! An archive of one crate (.usdz): ZIP without packing, whose file begins at a multiple of 64
//! bytes.
//!
//! Format: the USD documentation, "Usdz File Format Specification"; ZIP's APPNOTE, sections 4.3.7,
//! 4.3.12 and 4.3.16. No 64-bit extension, which a .usdz must not have: at most 4 GiB.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

use super::super::outcome::Pulse;
use super::crate_file;
use super::stage::Stage;

const ALIGNED: usize = 64;
const LOCAL_HEADER: usize = 30;
/// Number of the extra field that pads, as USD's own writer has it.
const PADDING: u16 = 0x1986;
/// 1 January 1980, the first day that ZIP knows: the same bytes whenever they are written.
const DAY: u16 = 0x21;

/// Writes the archive; `name` is that of the crate in it.
pub(super) fn write(
    stage: &Stage<'_>,
    name: &str,
    out: &mut BufWriter<&File>,
    pulse: &mut Pulse<'_>,
) -> io::Result<()> {
    let unpadded = LOCAL_HEADER + name.len() + 4;
    let padding = unpadded.next_multiple_of(ALIGNED) - unpadded;
    let start = unpadded + padding;
    out.write_all(&vec![0; start])?;
    let length = crate_file::write(stage, out, start as u64, pulse)?;
    out.flush()?;
    let sum = checksum(out.get_ref(), start as u64)?;
    let entry = Entry {
        name,
        sum,
        length: u32::try_from(length).map_err(io::Error::other)?,
    };
    out.seek(SeekFrom::Start(0))?;
    out.write_all(&entry.local(padding))?;
    out.seek(SeekFrom::Start(start as u64 + length))?;
    let directory = entry.directory();
    out.write_all(&directory)?;
    let end = [
        b"PK\x05\x06\0\0\0\0\x01\0\x01\0".as_slice(),
        &(directory.len() as u32).to_le_bytes(),
        &u32::try_from(start as u64 + length)
            .map_err(io::Error::other)?
            .to_le_bytes(),
        &[0, 0],
    ];
    out.write_all(&end.concat())
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

/// The only file.
struct Entry<'a> {
    name: &'a str,
    sum: u32,
    length: u32,
}

impl Entry<'_> {
    /// Version, flags, method, time, day, checksum, sizes, length of the name.
    fn common(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for number in [10, 0, 0, 0, DAY] {
            bytes.extend(u16::to_le_bytes(number));
        }
        for number in [self.sum, self.length, self.length] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend((self.name.len() as u16).to_le_bytes());
        bytes
    }

    fn local(&self, padding: usize) -> Vec<u8> {
        let mut bytes = b"PK\x03\x04".to_vec();
        bytes.extend(self.common());
        bytes.extend((padding as u16 + 4).to_le_bytes());
        bytes.extend(self.name.as_bytes());
        bytes.extend(PADDING.to_le_bytes());
        bytes.extend((padding as u16).to_le_bytes());
        bytes.extend(vec![0; padding]);
        bytes
    }

    fn directory(&self) -> Vec<u8> {
        let mut bytes = b"PK\x01\x02\x0a\0".to_vec();
        bytes.extend(self.common());
        // No extra field, comment, disk or attributes; the file is at the beginning.
        bytes.extend([0; 16]);
        bytes.extend(self.name.as_bytes());
        bytes
    }
}
