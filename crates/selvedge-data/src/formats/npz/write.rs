//! Writing NumPy's .npz: .npy arrays of version 1, not packed, in a ZIP archive with a directory.
//!
//! Bytes come piece by piece: no array is held in memory whole. The date is that of the format's
//! beginning, so that the same arrays make the same bytes. The caller sees to it that all is under
//! 4 GiB.

use std::io::{self, Seek, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A file that is not packed, of the format's first day.
pub(crate) const STORED: SimpleFileOptions =
    SimpleFileOptions::DEFAULT.compression_method(CompressionMethod::Stored);

/// An archive under way.
pub(crate) struct NpzOut<W: Write + Seek>(ZipWriter<W>);

impl<W: Write + Seek> NpzOut<W> {
    /// Begins an archive in an empty file.
    pub(crate) fn new(out: W) -> Self {
        Self(ZipWriter::new(out))
    }

    /// Begins an array whose elements NumPy calls `kind`, with these dimensions, slowest first.
    pub(crate) fn array(&mut self, name: &str, kind: &str, shape: &[usize]) -> io::Result<()> {
        let lengths: Vec<String> = shape.iter().map(usize::to_string).collect();
        // A tuple of one number has a comma.
        let shape = match lengths.as_slice() {
            [only] => format!("({only},)"),
            all => format!("({})", all.join(", ")),
        };
        let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
        // Padded to a multiple of 64 bytes.
        let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
        text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
        text.push('\n');
        self.0.start_file(format!("{name}.npy"), STORED)?;
        self.0.write_all(b"\x93NUMPY\x01\x00")?;
        self.0.write_all(&(length as u16).to_le_bytes())?;
        self.0.write_all(text.as_bytes())
    }

    /// Writes the next elements of the array, row by row.
    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    /// Ends the archive.
    pub(crate) fn finish(self) -> io::Result<()> {
        self.0.finish()?;
        Ok(())
    }
}
