//! Equation labels: a label in square brackets in a doc comment (and in backticks, or rustdoc takes
//! it for a link), and a section of its own in `docs/src/reference/equations.md` that gives the
//! formula, its source and its files. The two must agree.
//!
//! A section opens with a heading of level three that begins with the label, and ends at the next
//! heading. It has a line `Source:` and a line `File:` that names the files, in backticks.

use std::collections::{BTreeMap, BTreeSet};

use crate::tree::Tree;
use crate::violation::Violation;

const DOCUMENT: &str = "docs/src/reference/equations.md";
const OPENING: &str = concat!("[", "eq:");

/// An entry of the document.
struct Section {
    label: String,
    line: usize,
    files: Vec<String>,
    has_source: bool,
}

/// Labels that only the code or only the document has, that are listed twice, or whose section
/// names no source or the wrong files.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let in_code = labels_in_code(tree);
    let Some(document) = tree.text(DOCUMENT) else {
        return if in_code.is_empty() {
            Vec::new()
        } else {
            vec![Violation::new(DOCUMENT, 0, "missing", "write it")]
        };
    };
    let sections = sections_of(&document.text);
    let mut found = Vec::new();
    let mut listed = BTreeSet::new();
    for section in &sections {
        if !listed.insert(section.label.as_str()) {
            let what = format!("{} is listed twice", shown(&section.label));
            found.push(at(section, what, "merge the two sections"));
        }
        found.extend(check_section(section, tree, &in_code));
    }
    for (label, (path, line)) in &in_code {
        if !is_well_formed(label) {
            let remedy = "use lower-case words joined by hyphens, in backticks";
            let what = format!("{} is no label", shown(label));
            found.push(Violation::new(path, *line, what, remedy));
        }
        if !listed.contains(label.as_str()) {
            let what = format!("{} is not in {DOCUMENT}", shown(label));
            let remedy = format!("add a section `### {}` there", shown(label));
            found.push(Violation::new(path, *line, what, remedy));
        }
    }
    found
}

fn check_section(
    section: &Section,
    tree: &Tree,
    in_code: &BTreeMap<String, (String, usize)>,
) -> Vec<Violation> {
    let label = shown(&section.label);
    let mut found = Vec::new();
    if !in_code.contains_key(&section.label) {
        let remedy = "remove the section, or label the function that implements it";
        found.push(at(section, format!("{label} is in no code"), remedy));
        return found;
    }
    if !section.has_source {
        let what = format!("{label} names no source");
        found.push(at(section, what, "add a line `Source: …`"));
    }
    if section.files.is_empty() {
        let what = format!("{label} names no file");
        found.push(at(section, what, "add a line `File: …`"));
    }
    for path in &section.files {
        let holds = tree
            .text(path)
            .is_some_and(|file| labels_of(&file.text).any(|(found, _)| found == section.label));
        if !holds {
            let what = format!("{label} does not occur in `{path}`");
            found.push(at(section, what, "name the file that has it"));
        }
    }
    found
}

fn at(section: &Section, what: String, remedy: &str) -> Violation {
    Violation::new(DOCUMENT, section.line, what, remedy)
}

fn shown(label: &str) -> String {
    format!("{OPENING}{label}]")
}

fn is_well_formed(label: &str) -> bool {
    let mut words = label.split('-');
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
    words.all(|word| !word.is_empty() && word.chars().all(plain))
}

/// First occurrence of each label in Rust code: (path, line).
fn labels_in_code(tree: &Tree) -> BTreeMap<String, (String, usize)> {
    let mut labels = BTreeMap::new();
    for file in tree.texts.iter().filter(|file| file.path.ends_with(".rs")) {
        for (label, line) in labels_of(&file.text) {
            labels
                .entry(label.to_owned())
                .or_insert_with(|| (file.path.clone(), line));
        }
    }
    labels
}

/// All labels of a text with their lines.
fn labels_of(text: &str) -> impl Iterator<Item = (&str, usize)> {
    text.lines().enumerate().flat_map(|(number, line)| {
        line.split(OPENING)
            .skip(1)
            .filter_map(|rest| rest.split_once(']'))
            .map(move |(label, _)| (label, number + 1))
    })
}

fn sections_of(text: &str) -> Vec<Section> {
    let mut sections: Vec<Section> = Vec::new();
    let mut inside = false;
    for (number, line) in text.lines().enumerate() {
        if line.starts_with('#') {
            let label = line
                .strip_prefix("### ")
                .map(|heading| heading.trim_start_matches('`'))
                .filter(|heading| heading.starts_with(OPENING))
                .and_then(|heading| labels_of(heading).next());
            inside = label.is_some();
            sections.extend(label.map(|(label, _)| Section {
                label: label.to_owned(),
                line: number + 1,
                files: Vec::new(),
                has_source: false,
            }));
        } else if let (true, Some(section)) = (inside, sections.last_mut()) {
            section.has_source |= line.contains("Source:");
            if let Some((_, files)) = line.split_once("File:") {
                let quoted = files.split('`').skip(1).step_by(2);
                section.files.extend(quoted.map(str::to_owned));
            }
        }
    }
    sections
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_of;

    fn whats(code: &str, document: &str) -> Vec<String> {
        // The label's opening is put together here, so that this file has no labels itself.
        let code = code.replace("EQ:", OPENING);
        let document = document.replace("EQ:", OPENING);
        let tree = tree_of(&[("a.rs", &code), (DOCUMENT, &document)]);
        check(&tree).into_iter().map(|v| v.what).collect()
    }

    const GOOD: &str = "### EQ:a-a] A law\nx = y\n\nSource: us. File: `a.rs`\n";

    #[test]
    fn what_does_not_agree_is_named() {
        let no_source = "### EQ:a-a] A law\n## Next\nSource: x File: `a.rs`";
        let cases: [(&str, &str, &[&str]); 8] = [
            ("//! Law.\n/// EQ:a-a] and again EQ:a-a]", GOOD, &[]),
            ("/// EQ:a-a]", &GOOD.replace("EQ:a-a]", "`EQ:a-a]`"), &[]),
            (
                "/// EQ:a-a] EQ:b-b]",
                GOOD,
                &["EQ:b-b] is not in docs/src/reference/equations.md"],
            ),
            ("", GOOD, &["EQ:a-a] is in no code"]),
            ("/// EQ:a-a]", &GOOD.repeat(2), &["EQ:a-a] is listed twice"]),
            (
                "/// EQ:a-a]",
                no_source,
                &["EQ:a-a] names no source", "EQ:a-a] names no file"],
            ),
            (
                "/// EQ:a-a]",
                &GOOD.replace("a.rs", "b.rs"),
                &["EQ:a-a] does not occur in `b.rs`"],
            ),
            (
                "/// EQ:a_a]",
                &GOOD.replace("a-a", "a_a"),
                &["EQ:a_a] is no label"],
            ),
        ];
        for (code, document, expected) in cases {
            let expected: Vec<String> =
                expected.iter().map(|t| t.replace("EQ:", OPENING)).collect();
            assert_eq!(whats(code, document), expected);
        }
        for bad in ["", "layer_norm", "A-b", "a-", "-"] {
            assert!(!is_well_formed(bad), "{bad}");
        }
        assert!(is_well_formed("stretch-force-2"));
    }

    #[test]
    fn code_with_labels_needs_the_document() {
        let code = format!("/// {OPENING}a-a]");
        assert_eq!(check(&tree_of(&[("a.rs", &code)])).len(), 1);
        assert!(check(&tree_of(&[("a.rs", "")])).is_empty());
    }
}
