//! A sequence of .obj files, one per frame, named by a pattern: `body-{frame}.obj`, or
//! `body-{frame:04}.obj` where numbers have leading zeros.

use std::path::Path;

use glam::DVec3;

use super::super::motion::wrong;
use super::bytes_of;
use crate::formats::input::hash;
use crate::formats::obj::parse_obj_polygons;

const MOST_FRAMES: usize = 100_000;

/// Names of the files of a sequence.
#[derive(Debug, PartialEq)]
pub(in super::super) struct Sequence<'a> {
    before: &'a str,
    width: usize,
    after: &'a str,
}

impl<'a> Sequence<'a> {
    /// The pattern, if `path` is one.
    pub(in super::super) fn of(path: &'a str) -> Result<Option<Self>, String> {
        let Some((before, rest)) = path.split_once("{frame") else {
            return Ok(None);
        };
        let unclear = || {
            wrong(format!(
                "{path}: write {{frame}}, or {{frame:04}} for numbers of four digits"
            ))
        };
        let (form, after) = rest.split_once('}').ok_or_else(unclear)?;
        let width = match form.strip_prefix(":0") {
            None if form.is_empty() => 0,
            None => return Err(unclear()),
            Some(digits) => digits
                .parse()
                .ok()
                .filter(|w| *w <= 20)
                .ok_or_else(unclear)?,
        };
        if !after.to_ascii_lowercase().ends_with(".obj") || after.contains('{') {
            let problem = format!("{path}: a sequence of files must be of .obj");
            return Err(wrong(problem));
        }
        Ok(Some(Self {
            before,
            width,
            after,
        }))
    }

    fn name(&self, frame: usize) -> String {
        let Self {
            before,
            width,
            after,
        } = self;
        format!("{before}{frame:0width$}{after}")
    }

    /// The points in every frame: files from number `first`, or from 0 or 1 where none is given, to
    /// the last one without a gap; and the hash of the hashes of the files.
    pub(in super::super) fn read(
        &self,
        first: Option<usize>,
        folder: &Path,
    ) -> Result<(Vec<Vec<DVec3>>, String), String> {
        let is_there = |frame: usize| folder.join(self.name(frame)).is_file();
        let first = first.unwrap_or(usize::from(!is_there(0)));
        let mut frames: Vec<Vec<DVec3>> = Vec::new();
        let mut hashes = String::new();
        for frame in first.. {
            // The first file must be there: its absence is told by reading it.
            if frame > first && !is_there(frame) {
                break;
            }
            let name = self.name(frame);
            if frames.len() == MOST_FRAMES {
                let problem = format!("{name}: more than {MOST_FRAMES} frames");
                return Err(wrong(problem));
            }
            let bytes = bytes_of("motion", &name, folder)?;
            hashes.push_str(&hash(&bytes));
            let read = parse_obj_polygons(&bytes);
            let read = read
                .map_err(|error| wrong(format!("{name}: {error}")))?
                .positions;
            if let Some(before) = frames.first()
                && before.len() != read.len()
            {
                let problem = format!(
                    "{name} has {} points, but {} has {}: their number must not change",
                    read.len(),
                    self.name(first),
                    before.len()
                );
                return Err(wrong(problem));
            }
            frames.push(read);
        }
        Ok((frames, hash(hashes.as_bytes())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_number_their_files() {
        let of = |path| Sequence::of(path).ok().flatten().map(|s| s.name(7));
        assert_eq!(of("a/b-{frame:04}.obj").unwrap(), "a/b-0007.obj");
        assert_eq!(of("{frame}.obj").unwrap(), "7.obj");
        assert_eq!(of("body.obj"), None);
        for wrong in [
            "{frame:4}.obj",
            "{frame.obj",
            "{frame}.ply",
            "{frame}{frame}.obj",
        ] {
            assert!(Sequence::of(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn files_are_taken_up_to_the_first_gap() {
        let folder = tempfile::tempdir().unwrap();
        for number in [1, 2, 4] {
            let text = format!("v 0 0 0\nv {number} 0 0\n");
            std::fs::write(folder.path().join(format!("b{number}.obj")), text).unwrap();
        }
        let sequence = Sequence::of("b{frame}.obj").unwrap().unwrap();
        let (frames, blake3) = sequence.read(None, folder.path()).unwrap();
        assert_eq!(frames.len(), 2);
        assert_eq!(frames[1][1], DVec3::X * 2.0);
        assert_ne!(sequence.read(Some(4), folder.path()).unwrap().1, blake3);
        assert!(sequence.read(Some(9), folder.path()).is_err());
    }
}
