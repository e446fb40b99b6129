//! Reading of an Ogawa container in memory. Every offset is checked when it is followed; nothing is
//! copied.

use super::{DATA, MAGIC};

/// A container.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ogawa<'a> {
    bytes: &'a [u8],
}

/// A group: the offsets of its children.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Group<'a> {
    file: Ogawa<'a>,
    offsets: &'a [u8],
}

/// A child of a group.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Child<'a> {
    Group(Group<'a>),
    Data(&'a [u8]),
}

impl<'a> Ogawa<'a> {
    /// The container in the bytes of a file, and its root.
    ///
    /// # Errors
    /// The defect, as the end of a sentence.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Group<'a>, String> {
        if bytes.starts_with(b"\x89HDF") {
            return Err(
                "is an Alembic archive of the old kind (HDF5): convert it to Ogawa (abcconvert -toOgawa in.abc out.abc)"
                    .to_owned(),
            );
        }
        if !bytes.starts_with(b"Ogawa") {
            return Err("is no Alembic archive: it does not begin with Ogawa".to_owned());
        }
        if bytes.get(..8).is_some_and(|head| head[5] != MAGIC[5]) {
            return Err("was not finished by the program that wrote it".to_owned());
        }
        if bytes.get(..8) != Some(MAGIC.as_slice()) {
            return Err("is of another version of Ogawa, known is 1".to_owned());
        }
        let file = Self { bytes };
        let root = file.word(8)?;
        file.group(root)
    }

    fn word(self, at: u64) -> Result<u64, String> {
        let at = usize::try_from(at).unwrap_or(usize::MAX);
        let end = at.checked_add(8);
        let word = end.and_then(|end| self.bytes.get(at..end)?.try_into().ok());
        word.map(u64::from_le_bytes)
            .ok_or_else(|| self.beyond(at as u64))
    }

    fn beyond(self, at: u64) -> String {
        format!(
            "leads to byte {at}, but has {}: it was cut short or changed",
            self.bytes.len()
        )
    }

    /// `length` bytes from `at`.
    fn slice(self, at: u64, length: u64) -> Result<&'a [u8], String> {
        let end = at
            .checked_add(length)
            .filter(|&end| end <= self.bytes.len() as u64);
        let end = end.ok_or_else(|| self.beyond(at.saturating_add(length)))?;
        Ok(&self.bytes[at as usize..end as usize])
    }

    fn group(self, at: u64) -> Result<Group<'a>, String> {
        let offsets = match at {
            0 => &[],
            _ => {
                let length = self.word(at)?.saturating_mul(8);
                self.slice(at + 8, length)?
            }
        };
        Ok(Group {
            file: self,
            offsets,
        })
    }
}

impl<'a> Group<'a> {
    /// Number of children.
    pub(crate) fn len(self) -> usize {
        self.offsets.len() / 8
    }

    /// A child.
    ///
    /// # Errors
    /// The defect, as the end of a sentence: there is none of this number, or it leads beyond the
    /// file.
    pub(crate) fn child(self, number: usize) -> Result<Child<'a>, String> {
        let offset = self.offsets.chunks_exact(8).nth(number);
        let offset = offset.and_then(|eight| eight.try_into().ok());
        let offset = offset
            .map(u64::from_le_bytes)
            .ok_or_else(|| format!("has no child {number} in a group of {}", self.len()))?;
        if offset & DATA == 0 {
            return Ok(Child::Group(self.file.group(offset)?));
        }
        let at = offset & !DATA;
        if at == 0 {
            return Ok(Child::Data(&[]));
        }
        let length = self.file.word(at)?;
        Ok(Child::Data(self.file.slice(at + 8, length)?))
    }

    /// A child that is a group.
    ///
    /// # Errors
    /// As [`Group::child`], and for data.
    pub(crate) fn group(self, number: usize) -> Result<Group<'a>, String> {
        match self.child(number)? {
            Child::Group(group) => Ok(group),
            Child::Data(_) => Err(format!("has data where child {number} must be a group")),
        }
    }

    /// The bytes of a child that is data.
    ///
    /// # Errors
    /// As [`Group::child`], and for a group.
    pub(crate) fn data(self, number: usize) -> Result<&'a [u8], String> {
        match self.child(number)? {
            Child::Data(bytes) => Ok(bytes),
            Child::Group(_) => Err(format!("has a group where child {number} must be data")),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::super::OgawaOut;
    use super::*;

    fn container() -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let mut out = OgawaOut::new(&mut file).unwrap();
        let a = out.data(&[b"ab", b"c"]).unwrap();
        let none = out.data(&[]).unwrap();
        let inner = out.group(&[a, a]).unwrap();
        let empty = out.group(&[]).unwrap();
        let root = out.group(&[inner, none, empty, a]).unwrap();
        out.finish(root).unwrap();
        file.into_inner()
    }

    #[test]
    fn what_is_written_is_read() {
        let bytes = container();
        let root = Ogawa::open(&bytes).unwrap();
        assert_eq!(root.len(), 4);
        assert_eq!(root.group(0).unwrap().data(1).unwrap(), b"abc");
        assert_eq!(root.data(1).unwrap(), b"");
        assert_eq!(root.group(2).unwrap().len(), 0);
        assert_eq!(root.data(3).unwrap(), b"abc");
        assert!(root.data(0).is_err() && root.group(1).is_err());
        assert!(root.child(4).unwrap_err().contains("no child 4"));
    }

    #[test]
    fn what_leads_out_of_the_file_is_refused() {
        let bytes = container();
        for cut in 0..bytes.len() {
            // The root is last.
            assert!(Ogawa::open(&bytes[..cut]).is_err(), "{cut}");
        }
        for word in [u64::MAX, 1 << 62, bytes.len() as u64, DATA - 1] {
            let mut changed = bytes.clone();
            changed[8..16].copy_from_slice(&word.to_le_bytes());
            assert!(Ogawa::open(&changed).is_err(), "{word}");
            let at = bytes.len() - 32;
            let mut changed = bytes.clone();
            changed[at..at + 8].copy_from_slice(&word.to_le_bytes());
            assert!(Ogawa::open(&changed).unwrap().child(0).is_err(), "{word}");
        }
        let unfinished = [b"Ogawa\x00\x00\x01".as_slice(), &bytes[8..]].concat();
        assert!(
            Ogawa::open(&unfinished)
                .unwrap_err()
                .contains("not finished")
        );
        assert!(
            Ogawa::open(b"\x89HDF\r\n")
                .unwrap_err()
                .contains("abcconvert")
        );
    }
}
