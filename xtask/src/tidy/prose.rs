//! Text that people read: a doc of an item begins with a noun or a verb, and lines of comments, in
//! whatever language, and of Markdown are at most 100 columns long.
//!
//! Tables, headings, code blocks and lines that are one image or link are not wrapped, and no code
//! is, with a comment behind it or not.

use super::violation::Violation;
use crate::tree::{TextFile, Tree};

/// Columns of a line of prose.
const COLUMNS: usize = 100;

/// First words of a doc that names no subject.
const QUESTION_WORDS: [&str; 7] = ["What", "Where", "How", "Why", "Who", "Which", "Whether"];

/// Markdown that programs write.
const GENERATED: [&str; 2] = ["/studies/", "docs/src/reference/commands.md"];

/// Beginnings of lines that are comments and nothing else, by the ends of the names of files.
const COMMENTS: [(&str, &[&str]); 8] = [
    (".rs", &["//"]),
    (".cu", C_COMMENTS),
    (".h", C_COMMENTS),
    (".ts", C_COMMENTS),
    (".mjs", C_COMMENTS),
    (".toml", &["#"]),
    (".sh", &["#"]),
    (".ci/run", &["#"]),
];

/// Those of languages like C; lines in the middle of a comment begin with an asterisk.
const C_COMMENTS: &[&str] = &["//", "/*", "* "];

/// Docs with a weak beginning and lines that are too long.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let mut found = Vec::new();
    for file in &tree.texts {
        let mut languages = COMMENTS.iter();
        if let Some((_, marks)) = languages.find(|(end, _)| file.path.ends_with(end)) {
            found.extend(check_comments(file, marks));
            if file.path.ends_with(".rs") {
                found.extend(check_beginnings(file));
            }
        } else if file.path.ends_with(".md") && !GENERATED.iter().any(|g| file.path.contains(g)) {
            found.extend(check_markdown(file));
        }
    }
    found
}

/// Comments that are too long, of a language that begins them with one of `marks`.
fn check_comments(file: &TextFile, marks: &[&str]) -> Vec<Violation> {
    let is_comment = |line: &str| {
        let text = line.trim_start();
        marks.iter().any(|mark| text.starts_with(mark))
    };
    let lines = file.text.lines().enumerate();
    let long = lines.filter(|(_, line)| line.chars().count() > COLUMNS && is_comment(line));
    long.map(|(number, line)| too_long(file, number, line))
        .collect()
}

/// Docs of items that begin with a question.
fn check_beginnings(file: &TextFile) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut in_doc = false;
    for (number, line) in file.text.lines().enumerate() {
        let doc = line.trim_start().strip_prefix("///");
        if let Some(doc) = doc.filter(|_| !in_doc) {
            let word = doc
                .trim_start()
                .split(|c: char| !c.is_alphanumeric())
                .next();
            if let Some(word) = word.filter(|word| QUESTION_WORDS.contains(word)) {
                let what = format!("a doc begins with \"{word}\"");
                let remedy = "begin with a noun or a verb: \"Positions of …\", \"Returns …\"";
                found.push(Violation::new(&file.path, number + 1, what, remedy));
            }
        }
        in_doc = doc.is_some();
    }
    found
}

fn check_markdown(file: &TextFile) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut in_fence = false;
    for (number, line) in file.text.lines().enumerate() {
        let text = line.trim_start();
        if text.starts_with("```") {
            in_fence = !in_fence;
        }
        let kept_whole = in_fence
            || text.starts_with(['|', '#', '<'])
            || line.starts_with("    ")
            || is_one_link(text);
        if !kept_whole && line.chars().count() > COLUMNS {
            found.push(too_long(file, number, line));
        }
    }
    found
}

/// True for a line that is an image or a link and nothing else, perhaps as an item of a list.
fn is_one_link(text: &str) -> bool {
    let text = text.trim_start_matches(['-', '*', ' ']);
    let starts = text.starts_with("![") || text.starts_with('[');
    starts && text.trim_end_matches(['.', ',']).ends_with(')') && text.matches("](").count() == 1
}

fn too_long(file: &TextFile, number: usize, line: &str) -> Violation {
    let what = format!("{} columns, more than {COLUMNS}", line.chars().count());
    Violation::new(&file.path, number + 1, what, "wrap the line")
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
    fn docs_begin_with_a_noun_or_a_verb() {
        assert!(whats("a.rs", "/// Positions.\n/// Where they are.\nfn a() {}\n").is_empty());
        for word in QUESTION_WORDS {
            let text = format!("    /// {word} it is.\n");
            assert_eq!(
                whats("a.rs", &text),
                [format!("a doc begins with \"{word}\"")]
            );
        }
        assert!(whats("a.rs", "/// Whatever.\n").is_empty());
    }

    #[test]
    fn comments_and_prose_are_wrapped() {
        let long = "x ".repeat(51);
        let what = ["102 columns, more than 100"];
        assert_eq!(whats("a.md", &long), what);
        assert!(whats("a.md", &format!("```\n{long}\n```")).is_empty());
        assert!(whats("a.md", &format!("| {long} |")).is_empty());
        assert!(whats("a.md", &format!("![{long}](a.png)")).is_empty());
        assert_eq!(whats("a.rs", &format!("// {}", "x".repeat(98))).len(), 1);
        assert!(whats("a.rs", &format!("// {}", "x".repeat(97))).is_empty());
        assert!(whats("a.rs", &format!("let a = \"{long}\";")).is_empty());
    }

    #[test]
    fn comments_of_other_languages_are_wrapped_and_their_code_is_left() {
        let long = "x".repeat(100);
        for (path, mark) in [
            ("a.cu", "// "),
            ("a.h", "//"),
            ("a.ts", "/** "),
            ("a.ts", " * "),
            ("a.mjs", "    // "),
            ("a.toml", "# "),
            ("a.sh", "    # "),
            (".ci/run", "# "),
        ] {
            assert_eq!(whats(path, &format!("{mark}{long}")).len(), 1, "{path}");
            let short = "x".repeat(100 - mark.len());
            assert!(whats(path, &format!("{mark}{short}")).is_empty(), "{path}");
        }
        for path in ["a.cu", "a.h"] {
            assert!(whats(path, &format!("#define A {long}")).is_empty());
        }
        assert!(whats("a.toml", &format!("a = \"{long}\"  # {long}")).is_empty());
        assert!(whats("a.cu", &format!("    *{long} = 1;")).is_empty());
        assert!(whats("a.css", &format!("/* {long} */")).is_empty());
    }
}
