//! Files that a study keeps: JSON files that are written whole, and hashes that say what they were
//! made from.

use std::io::{ErrorKind, Write};
use std::path::Path;

use selvedge_data::write_atomically;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::{OfPart, StudyError};
use crate::machine::PROCESSOR;

/// The hash of a file, in hexadecimal.
pub(super) fn hash_of(path: &Path) -> Result<String, StudyError> {
    let bytes =
        selvedge_data::read_file(path).of(|| format!("{}: could not be read", path.display()))?;
    Ok(blake3::hash(&bytes).to_hex().to_string())
}

/// Reads what is kept in `path`; none where there is no such file.
pub(super) fn read<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, StudyError> {
    let text = match selvedge_data::read_text(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => {
            let context = format!("{}: could not be read", path.display());
            return Err(error).of(|| context);
        }
    };
    serde_json::from_str(&text).map(Some).of(|| {
        format!(
            "{}: is not what a study keeps: remove it, and it is made again",
            path.display()
        )
    })
}

/// The device of what does not say one.
pub(super) fn processor() -> String {
    PROCESSOR.to_owned()
}

/// Keeps `value` in `path`.
pub(super) fn write(path: &Path, value: &impl Serialize) -> Result<(), StudyError> {
    let text = serde_json::to_string(value).of(|| format!("{}: writing JSON", path.display()))?;
    Ok(write_atomically(path, |out| {
        out.write_all(text.as_bytes())
    })?)
}
