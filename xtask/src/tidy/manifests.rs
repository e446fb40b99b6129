//! Nothing is carried along unused: every dependency of the workspace is named by a member, and
//! every dependency of a member by its code.
//!
//! Manifests are read by line: in this repository a member's dependency is always `name.workspace`,
//! in a table of its own. Code names a dependency by its name with `_` for `-`, as a word.

use crate::tree::{TextFile, Tree};
use crate::violation::Violation;

const ROOT: &str = "Cargo.toml";

/// Dependencies that nobody uses.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let members = || {
        let files = tree.texts.iter();
        files.filter(|file| file.path.ends_with("/Cargo.toml"))
    };
    let mut found = Vec::new();
    if let Some(root) = tree.text(ROOT) {
        for (name, line) in dependencies(root, &["workspace.dependencies"]) {
            let used = members().any(|member| {
                dependencies(member, &["dependencies", "dev-dependencies"])
                    .iter()
                    .any(|(other, _)| *other == name)
            });
            if !used {
                found.push(unused(root, line, name, "by any member"));
            }
        }
    }
    for member in members() {
        let folder = member.path.trim_end_matches("Cargo.toml");
        for (name, line) in dependencies(member, &["dependencies"]) {
            let inside = format!("{folder}src/");
            if !is_named(tree, &inside, name) {
                found.push(unused(member, line, name, &format!("in {inside}")));
            }
        }
        for (name, line) in dependencies(member, &["dev-dependencies"]) {
            if !is_named(tree, folder, name) {
                found.push(unused(member, line, name, &format!("in {folder}")));
            }
        }
    }
    found
}

fn unused(file: &TextFile, line: usize, name: &str, by: &str) -> Violation {
    let what = format!("the dependency {name} is not used {by}");
    Violation::new(&file.path, line, what, "remove it")
}

/// Names and lines of the dependencies in these tables of a manifest.
fn dependencies<'a>(manifest: &'a TextFile, tables: &[&str]) -> Vec<(&'a str, usize)> {
    let mut inside = false;
    let mut found = Vec::new();
    for (number, line) in manifest.text.lines().enumerate() {
        if let Some(table) = line.strip_prefix('[') {
            inside = tables.contains(&table.trim_end_matches(']'));
        } else if inside && line.starts_with(|c: char| c.is_ascii_alphanumeric()) {
            let name = line.split(['.', ' ', '=']).next().unwrap_or_default();
            found.push((name, number + 1));
        }
    }
    found
}

/// True where a Rust file under `folder` has the dependency's name as a word, outside comments.
fn is_named(tree: &Tree, folder: &str, dependency: &str) -> bool {
    let word = dependency.replace('-', "_");
    let joins = |c: char| c.is_alphanumeric() || c == '_';
    let files = tree.texts.iter();
    files
        .filter(|file| file.path.starts_with(folder) && file.path.ends_with(".rs"))
        .flat_map(|file| file.text.lines())
        .filter(|line| !line.trim_start().starts_with("//"))
        .any(|line| line.split(|c| !joins(c)).any(|part| part == word))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    const WORKSPACE: &str =
        "[workspace.dependencies]\nglam = \"1\"\nrand-chacha = { version = \"1\" }\n";
    const MEMBER: &str = "[package]\nname = \"a\"\n\n[dependencies]\nglam.workspace = true\n\n\
                          [dev-dependencies]\nrand-chacha.workspace = true\n";

    fn whats(files: &[(&str, &str)]) -> Vec<String> {
        let found = check(&tree_of(files));
        found.into_iter().map(|v| v.what).collect()
    }

    #[test]
    fn what_is_used_passes() {
        let files = [
            ("Cargo.toml", WORKSPACE),
            ("crates/a/Cargo.toml", MEMBER),
            ("crates/a/src/lib.rs", "use glam::Vec3;"),
            ("crates/a/tests/x.rs", "    rand_chacha::ChaCha8Rng::new()"),
        ];
        assert!(whats(&files).is_empty());
    }

    #[test]
    fn what_no_member_names_fails() {
        let member = MEMBER.replace("glam.workspace = true\n", "");
        let files = [
            ("Cargo.toml", WORKSPACE),
            ("crates/a/Cargo.toml", &member),
            ("crates/a/src/lib.rs", "use rand_chacha;"),
        ];
        let expected = "the dependency glam is not used by any member";
        assert_eq!(whats(&files), [expected]);
    }

    #[test]
    fn what_no_code_names_fails() {
        let files = [
            ("Cargo.toml", WORKSPACE),
            ("crates/a/Cargo.toml", MEMBER),
            ("crates/a/src/lib.rs", "//! use glam::Vec3;\nuse my_glam;"),
            ("crates/b/src/lib.rs", "use {glam, rand_chacha};"),
        ];
        let expected = [
            "the dependency glam is not used in crates/a/src/",
            "the dependency rand-chacha is not used in crates/a/",
        ];
        assert_eq!(whats(&files), expected);
    }
}
