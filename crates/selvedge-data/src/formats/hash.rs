//! The hash by which files are known: BLAKE3, in hexadecimal.

pub(crate) fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}
