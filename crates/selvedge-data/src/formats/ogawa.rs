//! Writing of Ogawa, the container of Alembic archives: groups of children, each a group or data.
//! Children come before their group, the root last.
//!
//! Little-endian: "Ogawa", 255 where the file is whole, the version 0, 1, and the offset of the
//! root group (u64). A group is the number of its children (u64) and for each its offset, with the
//! highest bit set where it is data; 0 without that bit is an empty group, with it empty data. Data
//! are their length (u64) and their bytes.
//!
//! Format: the sources of Alembic, `lib/Alembic/Ogawa`.

use std::io::{self, Seek, SeekFrom, Write};

/// Bit of an offset that leads to data.
const DATA: u64 = 1 << 63;
const MAGIC: &[u8; 8] = b"Ogawa\xff\x00\x01";

/// Data of no bytes.
pub(crate) const NO_DATA: u64 = DATA;

/// A group of no children.
pub(crate) const NO_GROUP: u64 = 0;

/// A file that is written.
pub(crate) trait Sink: Write + Seek {}

impl<W: Write + Seek> Sink for W {}

/// A container under way.
pub(crate) struct OgawaOut<'a> {
    out: &'a mut dyn Sink,
    at: u64,
}

impl<'a> OgawaOut<'a> {
    /// Begins a container in an empty file.
    pub(crate) fn new(out: &'a mut dyn Sink) -> io::Result<Self> {
        out.write_all(MAGIC)?;
        out.write_all(&[0; 8])?;
        Ok(Self { out, at: 16 })
    }

    /// Writes the bytes of all `parts` as one piece of data; returns what a group has of it.
    pub(crate) fn data(&mut self, parts: &[&[u8]]) -> io::Result<u64> {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        if length == 0 {
            return Ok(NO_DATA);
        }
        let place = self.at;
        self.out.write_all(&(length as u64).to_le_bytes())?;
        for part in parts {
            self.out.write_all(part)?;
        }
        self.at += 8 + length as u64;
        Ok(place | DATA)
    }

    /// Writes a group; returns what the group above has of it.
    pub(crate) fn group(&mut self, children: &[u64]) -> io::Result<u64> {
        if children.is_empty() {
            return Ok(NO_GROUP);
        }
        let place = self.at;
        self.out.write_all(&(children.len() as u64).to_le_bytes())?;
        for child in children {
            self.out.write_all(&child.to_le_bytes())?;
        }
        self.at += 8 + 8 * children.len() as u64;
        Ok(place)
    }

    /// Ends the container; `root` is its first group.
    pub(crate) fn finish(self, root: u64) -> io::Result<()> {
        self.out.seek(SeekFrom::Start(MAGIC.len() as u64))?;
        self.out.write_all(&root.to_le_bytes())?;
        self.out.seek(SeekFrom::End(0)).map(drop)
    }
}
