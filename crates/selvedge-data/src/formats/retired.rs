//! Formats that are no longer read, and what to export in their place.

use std::path::Path;

/// The words for a file of such a format, by the ending of its name; none for all others.
pub(crate) fn retired(path: &Path) -> Option<&'static str> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    match ending.as_str() {
        "abc" => Some(
            "is an Alembic archive, which is written but not read: export USD (.usdc), .glb, .npz, .pc2 with its mesh as .obj, or an .obj per frame instead",
        ),
        "mdd" => Some(
            "is a cache of LightWave (.mdd), which is not read: export .pc2 with its mesh as .obj, USD (.usdc) or .glb instead",
        ),
        _ => None,
    }
}
