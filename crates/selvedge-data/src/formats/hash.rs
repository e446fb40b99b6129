//! The hash by which files are known: BLAKE3, in hexadecimal.

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
