//! Prims of a binary USD file (.usdc): a crate of version 0.4 or later.
//!
//! The file begins with "PXR-USDC", its version and the offset of a table of contents, which says
//! where the tables are: tokens, strings, fields (a token and a value), sets of fields, paths as a
//! tree, and specs (a path, a set of fields and a kind). Tables are packed; values are where they
//! are asked for.
//!
//! Bounds: a table has at most four entries per byte of the file and 4096 more, a set 1000 fields;
//! arrays have together at most eight numbers per byte of the file and four million more.
//!
//! Format: the sources of OpenUSD, `pxr/usd/usd/crateFile.h` and `crateFile.cpp`.

mod stage;
mod tables;
mod values;

pub(super) use self::stage::read;

/// First bytes of a crate.
pub(super) const MAGIC: &[u8] = b"PXR-USDC";
