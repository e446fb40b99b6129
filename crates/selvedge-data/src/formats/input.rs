//! Reading of input files: regular files only. A pipe or a device may never end, and a read of it
//! cannot be interrupted. What a file is by its first bytes or its name, and the hash by which it is
//! known: BLAKE3, in hexadecimal.

use std::io;
use std::path::Path;

/// What the name of a file ends in, in small letters and without the dot; nothing where there is no
/// ending. Windows and cameras write `.OBJ` and `.GLB`.
pub fn ending_of(path: &Path) -> String {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.unwrap_or_default().to_ascii_lowercase()
}

/// Reads a file whole.
///
/// # Errors
/// What the system says; a pipe, a socket or a device is refused at once.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    check(path)?;
    std::fs::read(path)
}

/// Reads a file of text whole.
///
/// # Errors
/// As for [`read_file`], and where it is not UTF-8: it says what else the file is, where that can be
/// told.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_file(path)?).map_err(|error| {
        let problem = match binary_kind(error.as_bytes()) {
            Some(kind) => format!("this is {kind}, not a file of text"),
            None => format!(
                "this is not a file of text: its byte {} is not UTF-8",
                error.utf8_error().valid_up_to()
            ),
        };
        io::Error::new(io::ErrorKind::InvalidData, problem)
    })
}

/// Kind of a binary file by how it begins; none where it begins like none that is known.
pub(crate) fn binary_kind(bytes: &[u8]) -> Option<&'static str> {
    const KINDS: [(&[u8], &str); 9] = [
        (b"glTF", "a .glb"),
        (b"PXR-USDC", "a USD crate"),
        (b"PK\x03\x04", "a zip archive, as .npz and .usdz are"),
        (b"\x93NUMPY", "an array of NumPy"),
        (b"\x89PNG", "a picture"),
        (b"\xff\xd8\xff", "a picture"),
        (b"POINTCACHE2", "a .pc2"),
        (b"Ogawa", "an Alembic archive"),
        (
            b"Kaydara FBX Binary",
            "an FBX: export a .glb, an .obj or USD",
        ),
    ];
    let known = KINDS.iter().find(|(start, _)| bytes.starts_with(start));
    let is_tensors = bytes.len() > 9 && bytes[4..8] == [0; 4] && bytes[8] == b'{';
    let tensors = is_tensors.then_some("a .safetensors: a trajectory, states or a model");
    known.map(|(_, kind)| *kind).or(tensors)
}

/// Checks that the file at `path` has the hash that it had when its scene was resolved.
pub(crate) fn check_hash(path: &str, expected: &str, found: &str) -> Result<(), String> {
    if found == expected {
        return Ok(());
    }
    Err(format!(
        "{path} has changed since the scene was resolved (hash {found}, expected {expected})"
    ))
}

pub(crate) fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Checks that `path` is a file that ends. The system has its own words for a folder.
fn check(path: &Path) -> io::Result<()> {
    let found = std::fs::metadata(path)?.file_type();
    if found.is_file() || found.is_dir() {
        return Ok(());
    }
    Err(io::Error::new(
        io::ErrorKind::InvalidInput,
        "this is a pipe or a device, not a file: write what comes out of it to a file first",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::says;

    #[test]
    fn files_are_read_and_folders_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        std::fs::write(&path, "words").unwrap();
        assert_eq!(read_file(&path).unwrap(), b"words");
        assert_eq!(read_text(&path).unwrap(), "words");
        for (start, kind) in [
            (&b"glTF\xff"[..], "a .glb"),
            (b"\x10\0\0\0\0\0\0\0{\xff", "a trajectory"),
            (b"a\xff", "byte 1"),
        ] {
            std::fs::write(&path, start).unwrap();
            says(read_text(&path).unwrap_err(), &[kind]);
        }
        let missing = read_file(&folder.path().join("none")).unwrap_err();
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
        assert!(read_file(folder.path()).is_err());
    }

    #[test]
    #[cfg(unix)]
    fn a_device_and_a_pipe_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        for path in [pipe.as_path(), Path::new("/dev/zero")] {
            says(read_file(path).unwrap_err(), &["a pipe or a device"]);
            assert!(read_text(path).is_err());
        }
    }
}
