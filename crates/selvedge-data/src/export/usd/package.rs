//! An archive of one crate (.usdz): ZIP without packing, whose file begins at a multiple of 64
//! bytes.
//!
//! Format: the USD documentation, "Usdz File Format Specification". No 64-bit extension, which a
//! .usdz must not have: at most 4 GiB.

use std::io::{self, Cursor, Seek, Write};

use zip::ZipWriter;

use super::super::outcome::Pulse;
use super::crate_file;
use super::stage::Stage;
use crate::formats::npz::STORED;

const ALIGNED: u16 = 64;

/// Writes the archive; `name` is that of the crate in it.
pub(super) fn write(
    stage: &Stage<'_>,
    name: &str,
    out: &mut (impl Write + Seek),
    pulse: &mut Pulse<'_>,
) -> io::Result<()> {
    let mut inside = Cursor::new(Vec::new());
    crate_file::write(stage, &mut inside, pulse)?;
    let mut archive = ZipWriter::new(out);
    archive.start_file(name, STORED.with_alignment(ALIGNED))?;
    archive.write_all(inside.get_ref())?;
    archive.finish()?;
    Ok(())
}
