//! What a registry asks of packages: one version for all of them, the Rust that is promised is the
//! Rust that is tested, and every member that is published has a README, words and categories, and
//! compiles in no file from outside its folder, which its package would not have.

use crate::tree::resolve;
use crate::tree::{TextFile, Tree};
use crate::violation::Violation;

const ROOT: &str = "Cargo.toml";
const TOOLCHAIN: &str = "rust-toolchain.toml";

/// Whatever of the packages is missing or does not agree.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let Some(root) = tree.text(ROOT) else {
        return Vec::new();
    };
    let mut found = check_versions(root);
    found.extend(check_rust(root, tree.text(TOOLCHAIN)));
    let members = tree.texts.iter();
    let members = members.filter(|file| file.path.ends_with("/Cargo.toml"));
    found.extend(members.flat_map(|member| check_member(tree, member)));
    found
}

/// Our own packages are asked for in the version that they have.
fn check_versions(root: &TextFile) -> Vec<Violation> {
    let Some(version) = value(root, "version") else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for (number, line) in root.text.lines().enumerate() {
        let is_ours = line.contains("{ path = \"");
        if is_ours && !line.contains(&format!("version = \"{version}\"")) {
            let what = "one of our packages is not asked for in the version of the workspace";
            let remedy = format!("version = \"{version}\"");
            found.push(Violation::new(ROOT, number + 1, what, remedy));
        }
    }
    found
}

/// The oldest Rust that is promised is the one that everything is tested with.
fn check_rust(root: &TextFile, toolchain: Option<&TextFile>) -> Option<Violation> {
    let promised = value(root, "rust-version")?;
    let tested = value(toolchain?, "channel")?;
    let is_same = tested == promised || tested.starts_with(&format!("{promised}."));
    (!is_same).then(|| {
        let what = format!("rust-version promises {promised}, and {tested} is tested");
        Violation::new(ROOT, 0, what, format!("make it that of {TOOLCHAIN}"))
    })
}

fn check_member(tree: &Tree, member: &TextFile) -> Vec<Violation> {
    if !member.text.contains("\npublish.workspace = true\n") {
        return Vec::new();
    }
    let folder = member.path.trim_end_matches("Cargo.toml");
    let mut found = Vec::new();
    if !tree.contains(&format!("{folder}README.md")) {
        let what = "a package that is published has no README.md";
        found.push(Violation::new(&member.path, 0, what, "write it"));
    }
    for key in ["description", "keywords", "categories"] {
        let is_there = member.text.contains(&format!("\n{key} = "));
        if !is_there {
            let what = format!("a package that is published has no {key}");
            found.push(Violation::new(&member.path, 0, what, "say it"));
        }
    }
    let sources = tree.texts.iter();
    let sources = sources.filter(|file| file.path.starts_with(&format!("{folder}src/")));
    found.extend(sources.flat_map(|file| check_includes(folder, file)));
    found
}

/// Files that a source compiles in by a path relative to itself.
fn check_includes(folder: &str, file: &TextFile) -> Vec<Violation> {
    let own = file.path.rsplit_once('/').map_or("", |(own, _)| own);
    let mut found = Vec::new();
    for (number, line) in file.text.lines().enumerate() {
        for call in ["include_str!(\"", "include_bytes!(\"", "#[path = \""] {
            let Some((_, rest)) = line.split_once(call) else {
                continue;
            };
            let target = rest.split('"').next().unwrap_or_default();
            let path = resolve(own, target);
            if !path.is_some_and(|path| path.starts_with(folder)) {
                let what = format!("{target} is not in the package of {folder}");
                let remedy = "take it from selvedge-assets, or move it here";
                found.push(Violation::new(&file.path, number + 1, what, remedy));
            }
        }
    }
    found
}

/// The text of the first `key = "text"` that stands at the beginning of a line.
fn value<'a>(file: &'a TextFile, key: &str) -> Option<&'a str> {
    let beginning = format!("{key} = \"");
    let mut lines = file.text.lines();
    lines.find_map(|line| line.strip_prefix(&beginning)?.strip_suffix('"'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    const WORKSPACE: &str = "[workspace.package]\nversion = \"0.2.0\"\nrust-version = \"1.95\"\n\
        [workspace.dependencies]\nours = { path = \"ours\", version = \"0.2.0\" }\n";
    const MEMBER: &str = "[package]\nname = \"ours\"\ndescription = \"d\"\nkeywords = [\"k\"]\n\
        categories = [\"c\"]\npublish.workspace = true\n";

    fn whats(workspace: &str, member: &str, channel: &str, readme: &str) -> Vec<String> {
        let channel = format!("[toolchain]\nchannel = \"{channel}\"\n");
        let files = [
            (ROOT, workspace),
            (TOOLCHAIN, channel.as_str()),
            ("ours/Cargo.toml", member),
            (readme, "# ours"),
        ];
        let found = check(&tree_of(&files));
        found.into_iter().map(|violation| violation.what).collect()
    }

    #[test]
    fn packages_in_order_pass() {
        let none: [String; 0] = [];
        assert_eq!(whats(WORKSPACE, MEMBER, "1.95.0", "ours/README.md"), none);
    }

    #[test]
    fn each_defect_is_found() {
        let older = WORKSPACE.replace(
            "\"ours\", version = \"0.2.0\"",
            "\"ours\", version = \"0.1.0\"",
        );
        let found = whats(&older, MEMBER, "1.95.0", "ours/README.md");
        assert!(found[0].contains("version of the workspace"), "{found:?}");
        let found = whats(WORKSPACE, MEMBER, "1.96.0", "ours/README.md");
        assert_eq!(found, ["rust-version promises 1.95, and 1.96.0 is tested"]);
        let found = whats(WORKSPACE, MEMBER, "1.95.0", "README.md");
        assert_eq!(found, ["a package that is published has no README.md"]);
        let reached = [
            (ROOT, WORKSPACE),
            ("ours/Cargo.toml", MEMBER),
            ("ours/README.md", "# ours"),
            ("ours/src/a.rs", "include_str!(\"../data.toml\")"),
            ("ours/src/b.rs", "include_bytes!(\"../../data.toml\")"),
        ];
        let found = check(&tree_of(&reached));
        let words: Vec<&str> = found
            .iter()
            .map(|violation| violation.what.as_str())
            .collect();
        assert_eq!(words, ["../../data.toml is not in the package of ours/"]);
        let wordless = MEMBER.replace("keywords", "words");
        let found = whats(WORKSPACE, &wordless, "1.95.0", "ours/README.md");
        assert_eq!(found, ["a package that is published has no keywords"]);
    }
}
