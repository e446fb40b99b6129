//! Reading of input files: regular files only. A pipe or a device may never end, and a read of it
//! cannot be interrupted.

use std::io;
use std::path::Path;

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
/// As for [`read_file`], and where it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    check(path)?;
    std::fs::read_to_string(path)
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
