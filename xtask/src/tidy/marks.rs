//! Marks that unfinished or careless work leaves behind: placeholders in Rust code, notes to
//! oneself, paths of one machine, invisible characters, spaces at the end of a line.
//!
//! The patterns are put together from parts, so that this file does not contain them.

use super::violation::Violation;
use crate::tree::Tree;

/// A piece of text that must not occur where it would stand as a word of its own.
struct Mark {
    text: &'static str,
    remedy: &'static str,
}

/// Placeholders, in Rust files.
const PLACEHOLDERS: [Mark; 4] = [
    Mark {
        text: concat!("to", "do!"),
        remedy: "write the code",
    },
    Mark {
        text: concat!("un", "implemented!"),
        remedy: "write the code, or return an error",
    },
    Mark {
        text: concat!("db", "g!"),
        remedy: "remove it",
    },
    Mark {
        text: concat!("#[", "ignore]"),
        remedy: "give the reason, as in ignore = \"needs a GPU\"",
    },
];

/// Notes to oneself, in every text.
const NOTES: [Mark; 3] = [
    Mark {
        text: concat!("FIX", "ME"),
        remedy: "mend it, or say plainly what is not done",
    },
    Mark {
        text: concat!("XX", "X"),
        remedy: "mend it, or say plainly what is not done",
    },
    Mark {
        text: concat!("TO", "DO"),
        remedy: "do it, or say plainly what is not done",
    },
];

/// Folders of one machine, in every text.
const MACHINE_PATHS: [Mark; 4] = [
    Mark {
        text: concat!("/wo", "rk"),
        remedy: MACHINE_REMEDY,
    },
    Mark {
        text: concat!("/t", "mp"),
        remedy: MACHINE_REMEDY,
    },
    Mark {
        text: concat!("/ho", "me"),
        remedy: MACHINE_REMEDY,
    },
    Mark {
        text: concat!("/ro", "ot"),
        remedy: MACHINE_REMEDY,
    },
];
const MACHINE_REMEDY: &str = "use a path relative to the repository, or one the user gives";

/// Texts that programs write and people do not mend.
const GENERATED: [&str; 2] = ["Cargo.lock", "/dist/"];

/// Every mark in every text file.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let mut found = Vec::new();
    for file in &tree.texts {
        if GENERATED.iter().any(|part| file.path.contains(part)) {
            continue;
        }
        let is_rust = file.path.ends_with(".rs");
        for (number, line) in file.text.split('\n').enumerate() {
            for (what, remedy) in check_line(line, is_rust) {
                found.push(Violation::new(&file.path, number + 1, what, remedy));
            }
        }
    }
    found
}

fn check_line(line: &str, is_rust: bool) -> Vec<(String, &'static str)> {
    let mut found = Vec::new();
    let mut report = |mark: &Mark| found.push((format!("`{}`", mark.text), mark.remedy));
    if is_rust {
        let marks = PLACEHOLDERS.iter();
        marks
            .filter(|mark| stands_alone(line, mark.text))
            .for_each(&mut report);
    }
    for marks in [NOTES.as_slice(), MACHINE_PATHS.as_slice()] {
        let marks = marks.iter();
        marks
            .filter(|mark| stands_alone(line, mark.text))
            .for_each(&mut report);
    }
    if let Some(bad) = line.chars().find(|&c| is_invisible(c)) {
        let what = format!("the invisible character U+{:04X}", u32::from(bad));
        found.push((what, "remove it, or write it as an escape"));
    }
    if line.ends_with([' ', '\t']) {
        found.push(("a space at the end of the line".to_owned(), "remove it"));
    }
    found
}

/// True where `mark` occurs with no letter, digit or other character of a name on the sides on
/// which the mark itself has one.
fn stands_alone(line: &str, mark: &str) -> bool {
    line.match_indices(mark).any(|(start, _)| {
        let before = line[..start].chars().next_back();
        let after = line[start + mark.len()..].chars().next();
        let free = |inner: Option<char>, outer: Option<char>| {
            !(inner.is_some_and(joins) && outer.is_some_and(joins))
        };
        // A slash goes on from a name: `crates/…` is no path of a machine.
        let first = mark.chars().next().map(|c| if c == '/' { 'a' } else { c });
        free(first, before) && free(mark.chars().next_back(), after)
    })
}

fn joins(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '}' | ')')
}

/// Control characters other than a tab, and characters that change how text is shown without
/// being seen (zero width, direction, byte order).
fn is_invisible(c: char) -> bool {
    (c.is_control() && c != '\t')
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}')
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    fn whats(path: &str, text: &str) -> Vec<String> {
        let found = check(&tree_of(&[(path, text)]));
        found.into_iter().map(|v| v.what).collect()
    }

    #[test]
    fn plain_text_passes() {
        let text = "//! A force, λ‖a‖² ≤ 1.\n\tlet x = a / b;\n";
        assert!(whats("a.rs", text).is_empty());
    }

    #[test]
    fn placeholders_fail_in_rust_only() {
        for mark in &PLACEHOLDERS {
            let text = format!("    {}()", mark.text);
            assert_eq!(whats("a.rs", &text), [format!("`{}`", mark.text)]);
            assert!(whats("a.md", &text).is_empty());
            assert!(whats("a.rs", &format!("my_{}", &mark.text[..2])).is_empty());
        }
        assert!(whats("a.rs", concat!("my_to", "do!()")).is_empty());
        assert_eq!(whats("a.rs", concat!("std::to", "do!()")).len(), 1);
    }

    #[test]
    fn notes_to_oneself_fail_as_words() {
        for mark in &NOTES {
            assert_eq!(whats("a.toml", &format!("# {}: later", mark.text)).len(), 1);
            assert!(whats("a.toml", &format!("{}L", mark.text)).is_empty());
        }
    }

    #[test]
    fn paths_of_a_machine_fail() {
        for mark in &MACHINE_PATHS {
            let text = mark.text;
            assert_eq!(whats("a.md", &format!("see `{text}/x`")).len(), 1);
            assert_eq!(whats("a.md", &format!("see {text}")).len(), 1);
            assert!(whats("a.md", &format!("see crates{text}/x")).is_empty());
            assert!(whats("a.md", &format!("see {text}s/x")).is_empty());
        }
    }

    #[test]
    fn what_cannot_be_seen_fails() {
        assert_eq!(whats("a", "x \n"), ["a space at the end of the line"]);
        assert_eq!(whats("a", "x\r\n"), ["the invisible character U+000D"]);
        assert_eq!(whats("a", "x\u{200b}y"), ["the invisible character U+200B"]);
        assert_eq!(whats("a", "\u{85}x"), ["the invisible character U+0085"]);
    }

    #[test]
    fn the_line_is_counted_from_one() {
        assert_eq!(check(&tree_of(&[("a", "x\ny \n")]))[0].line, 2);
    }

    #[test]
    fn generated_texts_are_left_alone() {
        assert!(whats("Cargo.lock", "x ").is_empty());
        assert!(whats("web/dist/page.js", "x ").is_empty());
    }
}
