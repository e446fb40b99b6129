//! Writing NumPy's .npz: .npy arrays of version 1, not packed, in a ZIP archive with a directory.
//!
//! Bytes come in chunks: no array is held in memory whole. The date is that of the format's
//! beginning, so that the same arrays make the same bytes. The caller sees to it that all is under
//! 4 GiB.

use std::io::{self, Seek, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Bytes of the records of an entry without its name, and of the end.
const RECORDS: u64 = 30 + 46;
const END: u64 = 22;

/// A file that is not packed, of the format's first day.
pub(crate) const STORED: SimpleFileOptions =
    SimpleFileOptions::DEFAULT.compression_method(CompressionMethod::Stored);

/// An array to be written.
pub(crate) struct EntryOut<'a> {
    /// Name of the entry, without `.npy`.
    pub(crate) name: String,
    /// NumPy's name of its type.
    pub(crate) kind: &'a str,
    /// Dimensions, slowest first.
    pub(crate) shape: Vec<usize>,
    /// Number of pieces in which the bytes come.
    pub(crate) chunks: usize,
    /// The bytes of a piece.
    pub(crate) chunk: Box<dyn Fn(usize) -> Vec<u8> + 'a>,
}

impl EntryOut<'_> {
    fn file_name(&self) -> String {
        format!("{}.npy", self.name)
    }

    /// Magic number and dictionary, padded to a multiple of 64 bytes.
    fn header(&self) -> Vec<u8> {
        let lengths: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        // A tuple of one number has a comma.
        let shape = match lengths.as_slice() {
            [only] => format!("({only},)"),
            all => format!("({})", all.join(", ")),
        };
        let mut text = format!(
            "{{'descr': '{}', 'fortran_order': False, 'shape': {shape}, }}",
            self.kind
        );
        let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
        text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
        text.push('\n');
        let mut header = b"\x93NUMPY\x01\x00".to_vec();
        header.extend((length as u16).to_le_bytes());
        header.extend(text.as_bytes());
        header
    }

    fn element_bytes(&self) -> u64 {
        if self.kind.ends_with('8') { 8 } else { 4 }
    }

    fn length(&self) -> u64 {
        let elements: u64 = self.shape.iter().map(|&n| n as u64).product();
        self.header().len() as u64 + elements * self.element_bytes()
    }
}

/// Size of the archive in bytes.
pub(crate) fn archive_bytes(entries: &[EntryOut<'_>]) -> u64 {
    let of = |entry: &EntryOut<'_>| RECORDS + 2 * entry.file_name().len() as u64 + entry.length();
    entries.iter().map(of).sum::<u64>() + END
}

/// Writes an archive; after each piece of an array `beat` is told its name, and may fail.
pub(crate) fn write_archive(
    entries: &[EntryOut<'_>],
    out: &mut (impl Write + Seek),
    beat: &mut dyn FnMut(&str) -> io::Result<()>,
) -> io::Result<()> {
    let mut archive = ZipWriter::new(out);
    for entry in entries {
        archive.start_file(entry.file_name(), STORED)?;
        archive.write_all(&entry.header())?;
        for k in 0..entry.chunks {
            archive.write_all(&(entry.chunk)(k))?;
            beat(&entry.name)?;
        }
    }
    archive.finish()?;
    Ok(())
}
