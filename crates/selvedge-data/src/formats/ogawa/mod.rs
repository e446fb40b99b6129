//! Ogawa, the container of Alembic archives: groups of children, each a group or data.
//!
//! Little-endian: "Ogawa", 255 where the file is whole, the version 0, 1, and the offset of the
//! root group (u64). A group is the number of its children (u64) and for each its offset, with the
//! highest bit set where it is data; 0 without that bit is an empty group, with it empty data. Data
//! are their length (u64) and their bytes.
//!
//! Format: the sources of Alembic, `lib/Alembic/Ogawa`.

mod read;
mod write;

pub(crate) use self::read::{Group, Ogawa};
pub(crate) use self::write::OgawaOut;

/// Bit of an offset that leads to data.
const DATA: u64 = 1 << 63;
const MAGIC: &[u8; 8] = b"Ogawa\xff\x00\x01";

/// Data of no bytes.
pub(crate) const NO_DATA: u64 = DATA;

/// A group of no children.
pub(crate) const NO_GROUP: u64 = 0;
