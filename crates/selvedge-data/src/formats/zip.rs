//! Records of a ZIP archive whose files are not packed.
//!
//! Every file has the format's first day as its date, so that the same files make the same bytes.
//! Format: ZIP's APPNOTE, sections 4.3.7, 4.3.12 and 4.3.16. No 64-bit extension: at most 4 GiB.

/// Beginnings of the three records: of a file, of an entry of the directory, and of the end.
pub(crate) const LOCAL: u32 = 0x0403_4b50;
pub(crate) const DIRECTORY: u32 = 0x0201_4b50;
pub(crate) const END: u32 = 0x0605_4b50;
/// Sizes of their fixed parts.
pub(crate) const LOCAL_LENGTH: usize = 30;
pub(crate) const DIRECTORY_LENGTH: usize = 46;
pub(crate) const END_LENGTH: usize = 22;
/// 1 January 1980.
const DAY: u16 = 0x21;

/// A file as its records have it.
pub(crate) struct Stored<'a> {
    pub(crate) name: &'a str,
    /// Version of the format, ten times.
    pub(crate) version: u8,
    /// CRC-32 of its bytes.
    pub(crate) checksum: u32,
    pub(crate) length: u32,
}

impl Stored<'_> {
    /// Version, flags, method, time, day, checksum, sizes, length of the name.
    fn common(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for number in [u16::from(self.version), 0, 0, 0, DAY] {
            bytes.extend(number.to_le_bytes());
        }
        for number in [self.checksum, self.length, self.length] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend((self.name.len() as u16).to_le_bytes());
        bytes
    }

    /// What stands before the file, with this extra field.
    pub(crate) fn local(&self, extra: &[u8]) -> Vec<u8> {
        let mut bytes = LOCAL.to_le_bytes().to_vec();
        bytes.extend(self.common());
        bytes.extend((extra.len() as u16).to_le_bytes());
        bytes.extend(self.name.as_bytes());
        bytes.extend(extra);
        bytes
    }

    /// The entry in the directory of a file whose record is at `at`.
    pub(crate) fn directory(&self, at: u32) -> Vec<u8> {
        let mut bytes = DIRECTORY.to_le_bytes().to_vec();
        bytes.extend([self.version, 0]);
        bytes.extend(self.common());
        // No extra field, comment, disk or attributes.
        bytes.extend([0; 12]);
        bytes.extend(at.to_le_bytes());
        bytes.extend(self.name.as_bytes());
        bytes
    }
}

/// The end of an archive of `count` files, whose directory of `length` bytes is at `at`.
pub(crate) fn end(count: u16, length: u32, at: u32) -> Vec<u8> {
    let mut bytes = END.to_le_bytes().to_vec();
    bytes.extend([0; 4]);
    bytes.extend(count.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.extend(length.to_le_bytes());
    bytes.extend(at.to_le_bytes());
    bytes.extend([0; 2]);
    bytes
}
