//! The documents tell the truth about the tree: the code map of `ARCHITECTURE.md` has a section
//! for every workspace member and no other, and a table that names every file and folder at the top
//! of the member's sources and nothing else; every relative link and every path in backticks leads
//! somewhere, a comment in the code refers only to documents that are here, and the README names
//! the test command that `.ci/run` runs first.

use std::collections::BTreeSet;

use super::violation::Violation;
use crate::tree::{TextFile, Tree};

const MAP: &str = "ARCHITECTURE.md";
const README: &str = "README.md";
const STEPS: &str = ".ci/run";

/// Beginnings of a path in backticks that means a file of this repository.
const PATH_STARTS: [&str; 6] = ["crates/", "xtask/", "docs/", "assets/", "web/", ".ci/"];

/// Whatever the documents say that is not so.
pub(crate) fn check(tree: &Tree, members: &BTreeSet<String>) -> Vec<Violation> {
    let mut found = check_code_map(tree, members);
    found.extend(check_tables(tree));
    let documents = tree.texts.iter().filter(|f| f.path.ends_with(".md"));
    found.extend(documents.flat_map(|file| check_paths(tree, file)));
    let sources = tree.texts.iter().filter(|f| f.path.ends_with(".rs"));
    found.extend(sources.flat_map(|file| check_comments(tree, file)));
    found.extend(check_test_command(tree));
    found
}

fn check_code_map(tree: &Tree, members: &BTreeSet<String>) -> Vec<Violation> {
    let Some(file) = tree.text(MAP) else {
        return vec![Violation::new(MAP, 0, "missing", "write it")];
    };
    let mut found = Vec::new();
    let mut mapped = BTreeSet::new();
    let lines = file.text.lines().enumerate();
    let inside = lines
        .skip_while(|(_, line)| *line != "## Code map")
        .skip(1)
        .take_while(|(_, line)| !line.starts_with("## "));
    for (number, line) in inside {
        let Some(heading) = line.strip_prefix("### ") else {
            continue;
        };
        let name = heading.split('`').nth(1).unwrap_or(heading);
        mapped.insert(name);
        if !members.contains(name) {
            let what = format!("the code map has `{name}`, the workspace has not");
            found.push(Violation::new(MAP, number + 1, what, "remove the section"));
        }
    }
    let missing = members
        .iter()
        .filter(|name| !mapped.contains(name.as_str()));
    found.extend(missing.map(|name| {
        let what = format!("the code map lacks the member `{name}`");
        Violation::new(MAP, 0, what, format!("add a section \"### `{name}`\""))
    }));
    found
}

/// The tables of the code map against the sources of each crate.
fn check_tables(tree: &Tree) -> Vec<Violation> {
    let Some(map) = tree.text(MAP) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut tables: Vec<(String, usize, BTreeSet<String>)> = Vec::new();
    for (number, line) in map.text.lines().enumerate() {
        if let Some(heading) = line.strip_prefix("### ") {
            let name = heading.split('`').nth(1).unwrap_or(heading);
            tables.push((format!("crates/{name}/src/"), number + 1, BTreeSet::new()));
        } else if line.starts_with("## ") {
            tables.push((String::new(), number + 1, BTreeSet::new()));
        } else if let (Some(row), Some((sources, _, named))) =
            (line.strip_prefix("| `"), tables.last_mut())
        {
            let first = row.split(" |").next().unwrap_or_default();
            for path in first
                .split('`')
                .step_by(2)
                .filter(|p| !sources.is_empty() && !p.is_empty())
            {
                if !tree.contains(format!("{sources}{path}").trim_end_matches('/')) {
                    let what = format!("there is no `{sources}{path}`");
                    found.push(Violation::new(MAP, number + 1, what, "mend the row"));
                }
                let top = path.split('/').next().unwrap_or_default();
                named.insert(top.to_owned());
            }
        }
    }
    for (sources, line, named) in tables.iter().filter(|(_, _, named)| !named.is_empty()) {
        for entry in top_level(tree, sources) {
            if !named.contains(entry) {
                let what = format!("the table lacks `{sources}{entry}`");
                found.push(Violation::new(MAP, *line, what, "add a row"));
            }
        }
    }
    found
}

/// Files and folders at the top of a crate's sources, without tests and the root of the crate. A
/// folder of the same name as a file goes with the file.
fn top_level<'a>(tree: &'a Tree, sources: &str) -> BTreeSet<&'a str> {
    let inside = tree
        .sizes
        .keys()
        .filter_map(|path| path.strip_prefix(sources));
    let entries: BTreeSet<&str> = inside.filter_map(|path| path.split('/').next()).collect();
    let of_file = |entry: &str| entries.contains(format!("{entry}.rs").as_str());
    let kept = entries.iter().copied().filter(|entry| {
        let is_root = ["lib.rs", "main.rs"].contains(entry);
        !is_root && !entry.starts_with("test_") && !of_file(entry)
    });
    kept.collect()
}

fn check_paths(tree: &Tree, file: &TextFile) -> Vec<Violation> {
    let folder = file.path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut found = Vec::new();
    let mut in_fence = false;
    for (number, line) in file.text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            in_fence = !in_fence;
        }
        if in_fence {
            continue;
        }
        for target in link_targets(line) {
            if !resolve(folder, target).is_some_and(|path| tree.contains(&path)) {
                let what = format!("the link to {target} leads nowhere");
                found.push(Violation::new(
                    &file.path,
                    number + 1,
                    what,
                    "mend the link",
                ));
            }
        }
        for path in quoted_paths(line) {
            if !tree.contains(path.trim_end_matches('/')) {
                let what = format!("there is no `{path}`");
                found.push(Violation::new(
                    &file.path,
                    number + 1,
                    what,
                    "mend the path",
                ));
            }
        }
    }
    found
}

/// Documents that comments refer to, by their path or by their name alone.
fn check_comments(tree: &Tree, file: &TextFile) -> Vec<Violation> {
    let lines = file.text.lines().enumerate();
    let comments = lines.filter(|(_, line)| line.trim_start().starts_with("//"));
    let mut found = Vec::new();
    for (number, line) in comments {
        let part_of_path = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
        let words = line.split(|c| !part_of_path(c));
        let documents = words.map(|word| word.trim_end_matches('.'));
        for document in documents.filter(|w| w.len() > 3 && w.ends_with(".md")) {
            let ending = format!("/{document}");
            let mut paths = tree.sizes.keys();
            if !paths.any(|path| path == document || path.ends_with(&ending)) {
                let what = format!("there is no document {document}");
                let remedy = "say what is meant, or cite what was published";
                found.push(Violation::new(&file.path, number + 1, what, remedy));
            }
        }
    }
    found
}

/// Targets of the relative links in a line, without their fragments.
fn link_targets(line: &str) -> impl Iterator<Item = &str> {
    let links = line.split("](").skip(1);
    links
        .filter_map(|rest| rest.split([')', ' ']).next())
        .map(|target| target.split('#').next().unwrap_or_default())
        .filter(|target| !target.is_empty() && !target.contains(':'))
}

/// Texts in backticks in a line, each a path of this repository, written out in full.
fn quoted_paths(line: &str) -> impl Iterator<Item = &str> {
    let quoted = line.split('`').skip(1).step_by(2);
    quoted.filter(|text| {
        PATH_STARTS.iter().any(|start| text.starts_with(start))
            && !text.contains(['*', '<', '{', '…', ' ', ':'])
    })
}

/// `target` seen from `folder`, both relative to the root; none when it leads outside.
pub(super) fn resolve(folder: &str, target: &str) -> Option<String> {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in target.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}

fn check_test_command(tree: &Tree) -> Vec<Violation> {
    let (Some(steps), Some(readme)) = (tree.text(STEPS), tree.text(README)) else {
        let missing = [STEPS, README]
            .into_iter()
            .filter(|path| tree.text(path).is_none());
        return missing
            .map(|path| Violation::new(path, 0, "missing", "write it"))
            .collect();
    };
    let first = steps
        .text
        .lines()
        .find_map(|line| line.strip_prefix("step "))
        .and_then(|step| step.split_once(' '));
    match first {
        Some(("tests", command)) if readme.text.lines().any(|l| l.trim() == command) => Vec::new(),
        Some(("tests", command)) => {
            let remedy = "put it on a line of its own in a code block";
            let what = format!("the test command of {STEPS} is missing: {command}");
            vec![Violation::new(README, 0, what, remedy)]
        }
        _ => {
            let what = "the first step is not \"tests\"";
            vec![Violation::new(STEPS, 0, what, "run the tests first")]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    const GOOD_MAP: &str = "# A\n## Code map\n### `one`\ntext\n### `two`: it\n## Next\n### three\n";

    fn whats(files: &[(&str, &str)]) -> Vec<String> {
        let mut all = vec![
            (MAP, GOOD_MAP),
            (README, "    cargo test\n"),
            (STEPS, "step tests cargo test\nstep lints x\n"),
        ];
        all.retain(|(path, _)| !files.iter().any(|(other, _)| other == path));
        all.extend(files);
        let members = ["one", "two"].map(str::to_owned).into();
        let found = check(&tree_of(&all), &members);
        found.into_iter().map(|v| v.what).collect()
    }

    #[test]
    fn a_true_map_passes() {
        assert!(whats(&[]).is_empty());
    }

    #[test]
    fn the_map_has_each_member_and_no_other() {
        let lacking = GOOD_MAP.replace("### `two`: it\n", "");
        let found = whats(&[(MAP, &lacking)]);
        assert_eq!(found, ["the code map lacks the member `two`"]);
        let extra = GOOD_MAP.replace("text", "### `four`");
        let found = whats(&[(MAP, &extra)]);
        assert_eq!(found, ["the code map has `four`, the workspace has not"]);
    }

    #[test]
    fn the_tables_name_the_top_of_each_crate_and_nothing_else() {
        let map = "# A\n## Code map\n### `one`\n| file | what |\n|---|---|\n\
                   | `a.rs` `b/` | x `c.rs` |\n### `two`: it\n## Next\n| `none.rs` | y |\n";
        let files = [
            ("crates/one/src/lib.rs", ""),
            ("crates/one/src/a.rs", ""),
            ("crates/one/src/a/inner.rs", ""),
            ("crates/one/src/b/mod.rs", ""),
            ("crates/one/src/test_helper.rs", ""),
        ];
        let with = |more: &[(&'static str, &'static str)]| {
            whats(&[&[(MAP, map)], files.as_slice(), more].concat())
        };
        assert!(with(&[]).is_empty());
        let found = with(&[("crates/one/src/d.rs", "")]);
        assert_eq!(found, ["the table lacks `crates/one/src/d.rs`"]);
        let extra = map.replace("`b/`", "`b/` `e.rs`");
        let found = whats(&[&[(MAP, &*extra)], files.as_slice()].concat());
        assert_eq!(found, ["there is no `crates/one/src/e.rs`"]);
    }

    #[test]
    fn links_lead_somewhere() {
        let good = "[a](b.md#x) [b](../ARCHITECTURE.md) [c](https://x.org) [d](#here) [e](..)";
        assert!(whats(&[("docs/a.md", good), ("docs/b.md", "")]).is_empty());
        for bad in [
            "[a](c.md)",
            "![a](../b.png \"title\")",
            "[a](../../README.md)",
        ] {
            assert_eq!(whats(&[("docs/a.md", bad)]).len(), 1, "{bad}");
        }
        assert!(whats(&[("docs/a.md", "```\n[a](c.md)\n```\n")]).is_empty());
    }

    #[test]
    fn paths_in_backticks_exist() {
        let good = "`docs/a.md` `docs/` `docs/*.md` `crates/<name>` `other/x`";
        assert!(whats(&[("docs/a.md", good)]).is_empty());
        let found = whats(&[("docs/a.md", "see `crates/x/src/y.rs`")]);
        assert_eq!(found, ["there is no `crates/x/src/y.rs`"]);
    }

    #[test]
    fn comments_refer_to_documents_that_are_here() {
        let good = "//! See docs/a.md, a.md and *.md.\nlet x = \"c.md\";\n";
        assert!(whats(&[("x.rs", good), ("docs/a.md", "")]).is_empty());
        let found = whats(&[("x.rs", "/// As in spec.md §2.")]);
        assert_eq!(found, ["there is no document spec.md"]);
    }

    #[test]
    fn the_readme_names_the_test_command() {
        let found = whats(&[(README, "cargo check")]);
        assert_eq!(
            found,
            ["the test command of .ci/run is missing: cargo test"]
        );
        let found = whats(&[(STEPS, "step lints x\nstep tests cargo test\n")]);
        assert_eq!(found, ["the first step is not \"tests\""]);
    }
}
