//! The page of the live viewer is built with tools that cargo does not know, and its built files
//! are kept. This check compares them with the sources that stand beside them.
//!
//! The build notes the FNV-1a hash (64 bits) of every source in `sources.txt`, a line each.

use std::collections::BTreeMap;

use crate::tree::Tree;
use crate::violation::Violation;

const NOTES: &str = "crates/selvedge-live/page/sources.txt";
const SOURCES: &str = "web/";
const ALSO: [&str; 4] = [
    "build.mjs",
    "package-lock.json",
    "package.json",
    "tsconfig.json",
];
const REMEDY: &str = "build the page: cd web && npm ci && npm run build";

/// Sources of the page that are not those it was built from.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let Some(notes) = tree.text(NOTES) else {
        return vec![Violation::new(NOTES, 0, "is missing", REMEDY)];
    };
    let noted: BTreeMap<&str, &str> = notes
        .text
        .lines()
        .filter_map(|line| line.split_once("  "))
        .map(|(hash, path)| (path, hash))
        .collect();
    let mut found = Vec::new();
    let mut seen = Vec::new();
    for file in &tree.texts {
        let Some(path) = file.path.strip_prefix(SOURCES) else {
            continue;
        };
        if !path.starts_with("src/") && !ALSO.contains(&path) {
            continue;
        }
        seen.push(path);
        let hash = format!("{:016x}", fnv(file.text.as_bytes()));
        if noted.get(path) != Some(&hash.as_str()) {
            let what = "the page was not built from this file as it is";
            found.push(Violation::new(&file.path, 0, what, REMEDY));
        }
    }
    for path in noted.keys().filter(|path| !seen.contains(*path)) {
        let what = format!("the page was built from {path}, which is gone");
        found.push(Violation::new(NOTES, 0, what, REMEDY));
    }
    found
}

/// FNV-1a of 64 bits (Fowler, Noll and Vo).
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    #[test]
    fn fnv_has_its_published_values() {
        assert_eq!(fnv(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv(b"foobar"), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn a_source_that_changed_came_or_went_is_found() {
        let notes = format!("{:016x}  src/main.ts\n", fnv(b"draw()"));
        let built = [(NOTES, notes.as_str()), ("web/src/main.ts", "draw()")];
        assert!(check(&tree_of(&built)).is_empty());
        let changed = [(NOTES, notes.as_str()), ("web/src/main.ts", "draw(1)")];
        assert_eq!(check(&tree_of(&changed)).len(), 1);
        let gone = [(NOTES, notes.as_str()), ("web/src/other.ts", "")];
        assert_eq!(check(&tree_of(&gone)).len(), 2);
        assert_eq!(check(&tree_of(&[])).len(), 1);
        // Tests of the page are no part of it.
        let more = [built[0], built[1], ("web/tests/page.mjs", "")];
        assert!(check(&tree_of(&more)).is_empty());
    }
}
