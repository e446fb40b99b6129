//! Rest poses that were found, in a folder: one file each, named by a hash of what decides the
//! pose. Nothing but time is lost with the folder.
//!
//! A file is checked when it is read. The folder is bounded: the poses that were used longest ago
//! make room.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use glam::DVec3;

use crate::formats::arrays::ArrayFile;
use crate::formats::atomic::WriteError;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::hash;
use crate::formats::tensor_file::{TensorOut, TensorValues, write_tensors};

/// The format that a file names in its metadata, with its version.
const FORMAT: &str = "selvedge-rest-pose 1";
const EXTENSION: &str = "safetensors";
const TENSOR: &str = "positions";
/// Size of a folder `[bytes]`: 2,500 poses of 4096 vertices.
const MOST_BYTES: u64 = 256 << 20;

/// A rest pose as a file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptRestPose {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Solves that found it.
    pub solves: u32,
    /// Largest acceleration that is left `[m/s²]`.
    pub residual: f64,
    /// Wall time of the search `[s]`.
    pub seconds: f64,
}

/// A folder of rest poses.
#[derive(Clone, Debug)]
pub struct RestPoseFolder {
    folder: PathBuf,
    most_bytes: u64,
}

impl RestPoseFolder {
    /// The poses in `folder`, which need not be there yet.
    pub fn new(folder: PathBuf) -> Self {
        Self {
            folder,
            most_bytes: MOST_BYTES,
        }
    }

    /// Creates the folder if it is not there, and tries to write a file in it.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn check(&self) -> Result<(), WriteError> {
        let created = fs::create_dir_all(&self.folder);
        let tried = created.and_then(|()| tempfile::tempfile_in(&self.folder));
        tried
            .map(drop)
            .map_err(WriteError::when(&self.folder, "write in the folder"))
    }

    /// The pose of `vertices` vertices that was kept as `content`, any text that tells what decides
    /// it; none if there is none.
    ///
    /// # Errors
    /// A file that cannot be read, or that is damaged.
    pub fn find(
        &self,
        content: &str,
        vertices: usize,
    ) -> Result<Option<KeptRestPose>, FileError<Problem>> {
        let key = hash(content.as_bytes());
        let path = self.file(&key);
        let fail = |problem| FileError::new(&path, problem);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(fail(format!("could not read it: {error}"))),
        };
        let pose = parse(&bytes, &key, vertices).map_err(fail)?;
        // The time of the last use. Where it cannot be set, the pose goes a little sooner.
        if let Ok(file) = File::options().append(true).open(&path) {
            let _ = file.set_modified(SystemTime::now());
        }
        Ok(Some(pose))
    }

    /// Keeps `pose` as that of `content`, and removes others where the folder is too large.
    ///
    /// # Errors
    /// A folder or a file that cannot be written.
    pub fn keep(&self, content: &str, pose: &KeptRestPose) -> Result<(), WriteError> {
        fs::create_dir_all(&self.folder)
            .map_err(WriteError::when(&self.folder, "create the folder"))?;
        let key = hash(content.as_bytes());
        let numbers: Vec<f64> = pose.positions.iter().flat_map(|p| p.to_array()).collect();
        let metadata = BTreeMap::from([
            ("format", FORMAT.to_owned()),
            ("key", key.clone()),
            ("solves", pose.solves.to_string()),
            // Debug formatting is read back to the same bits.
            ("residual", format!("{:?}", pose.residual)),
            ("seconds", format!("{:?}", pose.seconds)),
            ("blake3", checksum(pose)),
        ]);
        let tensor = TensorOut {
            name: TENSOR.into(),
            shape: vec![pose.positions.len(), 3],
            values: TensorValues::F64(numbers.into()),
        };
        let path = self.file(&key);
        write_tensors(&path, &[tensor], &metadata)?;
        self.make_room(&path);
        Ok(())
    }

    fn file(&self, key: &str) -> PathBuf {
        self.folder.join(key).with_extension(EXTENSION)
    }

    /// Removes the poses used longest ago until the folder is small enough; never `newest`. Files
    /// that another process removes first are gone all the same.
    fn make_room(&self, newest: &Path) {
        let Ok(entries) = fs::read_dir(&self.folder) else {
            return;
        };
        let mut files: Vec<(SystemTime, u64, PathBuf)> = entries
            .flatten()
            .map(|entry| entry.path())
            .filter(|path| path.extension().is_some_and(|e| e == EXTENSION))
            .filter_map(|path| {
                let metadata = fs::metadata(&path).ok()?;
                Some((metadata.modified().ok()?, metadata.len(), path))
            })
            .collect();
        files.sort_unstable();
        let mut size: u64 = files.iter().map(|file| file.1).sum();
        for (_, bytes, path) in files {
            if size <= self.most_bytes {
                break;
            }
            if path != newest && fs::remove_file(&path).is_ok() {
                size -= bytes;
            }
        }
    }
}

fn parse(bytes: &[u8], key: &str, vertices: usize) -> Result<KeptRestPose, String> {
    let damaged = |error: Problem| format!("it is damaged: {error}");
    let unusable = |name: &str| format!("it has no usable {name:?} in its metadata");
    let (file, metadata) = ArrayFile::safetensors(bytes).map_err(damaged)?;
    let text = |name: &'static str| {
        let value = metadata.get(name);
        value.map(String::as_str).ok_or_else(|| unusable(name))
    };
    for (name, expected) in [("format", FORMAT), ("key", key)] {
        if text(name)? != expected {
            return Err(unusable(name));
        }
    }
    let number = |name: &'static str| {
        let value = text(name)?.parse::<f64>().ok();
        let value = value.filter(|value| value.is_finite() && *value >= 0.0);
        value.ok_or_else(|| unusable(name))
    };
    let positions = file.floats(TENSOR).map_err(damaged)?;
    let positions = positions.of_shape(&[Some(vertices), Some(3)]);
    let numbers = positions.map_err(damaged)?.values;
    if !numbers.iter().all(|number| number.is_finite()) {
        return Err("it is damaged: a position is not finite".to_owned());
    }
    let pose = KeptRestPose {
        positions: numbers.chunks_exact(3).map(DVec3::from_slice).collect(),
        solves: text("solves")?.parse().map_err(|_| unusable("solves"))?,
        residual: number("residual")?,
        seconds: number("seconds")?,
    };
    if text("blake3")? != checksum(&pose) {
        return Err("it is damaged: its numbers have another hash".to_owned());
    }
    Ok(pose)
}

/// Hash of every number of a pose.
fn checksum(pose: &KeptRestPose) -> String {
    let positions = pose.positions.iter().flat_map(|p| p.to_array());
    let numbers = [f64::from(pose.solves), pose.residual, pose.seconds];
    let numbers = positions.chain(numbers);
    let bytes: Vec<u8> = numbers.flat_map(f64::to_le_bytes).collect();
    hash(&bytes)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::test_help::says;

    fn pose(vertices: usize) -> KeptRestPose {
        let place = |v: usize| DVec3::new(1.0 / (v as f64 + 3.0), -0.1, v as f64);
        KeptRestPose {
            positions: (0..vertices).map(place).collect(),
            solves: 17,
            residual: 0.1 + 0.2,
            seconds: 12.5,
        }
    }

    fn folder() -> (tempfile::TempDir, RestPoseFolder) {
        let place = tempfile::tempdir().unwrap();
        let folder = RestPoseFolder::new(place.path().join("new/rest-poses"));
        (place, folder)
    }

    fn files(folder: &RestPoseFolder) -> Vec<PathBuf> {
        let entries = fs::read_dir(&folder.folder).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn a_pose_is_found_again_bit_for_bit_and_only_as_what_it_was_kept() {
        let (_place, folder) = folder();
        assert_eq!(folder.find("a", 5).unwrap(), None);
        folder.keep("a", &pose(5)).unwrap();
        assert_eq!(folder.find("a", 5).unwrap(), Some(pose(5)));
        assert_eq!(folder.find("b", 5).unwrap(), None);
        assert!(folder.find("a", 6).is_err());
    }

    #[test]
    fn a_damaged_file_is_an_error_wherever_the_damage_is() {
        let (_place, folder) = folder();
        folder.keep("a", &pose(5)).unwrap();
        let path = &files(&folder)[0];
        let whole = fs::read(path).unwrap();
        for place in (0..whole.len()).step_by(3) {
            let mut damaged = whole.clone();
            damaged[place] ^= 1;
            fs::write(path, &damaged).unwrap();
            // A space of the header may be another one.
            if let Ok(found) = folder.find("a", 5) {
                assert_eq!(found, Some(pose(5)));
            }
        }
        for end in [0, 7, 100, whole.len() - 1] {
            fs::write(path, &whole[..end]).unwrap();
            says(folder.find("a", 5).unwrap_err(), &[path.to_str().unwrap()]);
        }
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_said() {
        let (place, folder) = folder();
        folder.check().unwrap();
        assert!(files(&folder).is_empty());
        // A file is where the folder would be.
        let path = place.path().join("file");
        fs::write(&path, "").unwrap();
        let error = RestPoseFolder::new(path.join("rest-poses")).check();
        says(error.unwrap_err(), &["rest-poses", "write in the folder"]);
    }

    #[test]
    fn the_poses_used_longest_ago_make_room() {
        let (_place, mut folder) = folder();
        folder.keep("a", &pose(100)).unwrap();
        let size = fs::metadata(&files(&folder)[0]).unwrap().len();
        folder.most_bytes = 2 * size + 100;
        let age = |content: &str, seconds: u64| {
            let path = folder.file(&hash(content.as_bytes()));
            let file = File::options().append(true).open(path).unwrap();
            let time = SystemTime::now() - Duration::from_secs(seconds);
            file.set_modified(time).unwrap();
        };
        folder.keep("b", &pose(100)).unwrap();
        age("a", 200);
        age("b", 100);
        // Used now, "a" is the newer one.
        assert!(folder.find("a", 100).unwrap().is_some());
        folder.keep("c", &pose(100)).unwrap();
        let kept = |content: &str| folder.find(content, 100).unwrap().is_some();
        assert_eq!(["a", "b", "c"].map(kept), [true, false, true]);
        // One that is larger than the folder may be stays until the next.
        folder.keep("d", &pose(1000)).unwrap();
        assert_eq!(files(&folder).len(), 1);
    }
}
