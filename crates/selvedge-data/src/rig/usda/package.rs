//! The stage in an archive of USD (.usdz): the first file of a ZIP that is not packed.
//!
//! Format: the USD documentation, "Usdz File Format Specification"; ZIP's APPNOTE, sections 4.3.7
//! and 4.3.16.

use crate::formats::packing::little;

/// First bytes of a ZIP.
pub(super) const ZIP: &[u8] = b"PK\x03\x04";
const HEADER: usize = 30;
/// Length of the end of the directory.
const END: usize = 22;
const LONGEST_COMMENT: usize = 1024;

pub(super) fn first_file(bytes: &[u8]) -> Result<&[u8], String> {
    let number = |at: usize, width: usize| -> Option<usize> {
        Some(little(bytes.get(at..at + width)?) as usize)
    };
    let cut = || "is no whole .usdz: it was cut short or changed".to_owned();
    let flags = number(6, 2).ok_or_else(cut)?;
    let method = number(8, 2).ok_or_else(cut)?;
    if flags & 0b1001 != 0 || method != 0 {
        let problem = "has a first file that is packed or encrypted, which a .usdz must not have";
        return Err(problem.to_owned());
    }
    // The end of the directory, which is the last part, but for a comment.
    let tail = &bytes[bytes.len().saturating_sub(END + LONGEST_COMMENT)..];
    if !tail
        .windows(END)
        .any(|part| part.starts_with(b"PK\x05\x06"))
    {
        return Err(cut());
    }
    let length = number(18, 4).ok_or_else(cut)?;
    let name = number(26, 2).ok_or_else(cut)?;
    let extra = number(28, 2).ok_or_else(cut)?;
    let start = HEADER + name + extra;
    bytes.get(start..start + length).ok_or_else(cut)
}
