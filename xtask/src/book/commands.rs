//! Every `selvedge …` command of README and book is understood by the program.
//!
//! In blocks a command is whole. In the middle of a sentence it may be a part of one, such as
//! `selvedge inspect`. Pages of the notebook have the commands of their day and are left out.

use anyhow::Result;

use super::fault::Fault;
use super::markdown::{self, Block, Line};
use super::places::{NOTEBOOK, PAGES};
use super::program::{Program, Understood};
use crate::tree::{TextFile, Tree};

/// Beginnings of a command.
const CALLS: [&str; 2] = ["selvedge ", "cargo run --release -- "];
/// Languages of blocks that hold commands.
const LANGUAGES: [&str; 2] = ["console", "sh"];
/// Signs of a call's pattern, which is no command.
const PLACEHOLDERS: [char; 3] = ['<', '[', '…'];
/// Attribute of a block whose commands are run.
const QUICK: &str = "quick";

/// A command of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Command {
    /// Page.
    pub(super) path: String,
    /// Line, counted from 1.
    pub(super) line: usize,
    /// Words after the program's name.
    pub(super) words: Vec<String>,
    /// Comment behind it, which says how long it takes.
    pub(super) comment: String,
    /// True where it is run.
    pub(super) is_quick: bool,
    /// True where it stands in a sentence.
    is_span: bool,
}

/// All commands of README and book.
pub(super) fn of(tree: &Tree) -> Vec<Command> {
    let files = tree.texts.iter().filter(|file| is_read(&file.path));
    files.flat_map(of_page).collect()
}

fn is_read(path: &str) -> bool {
    let is_page = path.starts_with(PAGES) && !path.starts_with(NOTEBOOK);
    path.ends_with(".md") && (is_page || path == "README.md")
}

/// The commands of a page: those of its blocks, then those of its sentences.
pub(super) fn of_page(file: &TextFile) -> Vec<Command> {
    let page = markdown::page(&file.text);
    let mut found: Vec<Command> = page
        .blocks
        .iter()
        .filter(|block| {
            block
                .info
                .first()
                .is_some_and(|word| LANGUAGES.contains(word))
        })
        .flat_map(|block| of_block(&file.path, block))
        .collect();
    let spans = markdown::code_spans(&page);
    let spans = spans.iter().filter_map(|line| {
        let mut command = command(&file.path, *line)?;
        command.is_span = true;
        Some(command)
    });
    found.extend(spans);
    found
}

/// The commands of a block, those over several lines (`\` at their ends) put together.
pub(super) fn of_block(path: &str, block: &Block<'_>) -> Vec<Command> {
    let is_quick = block.info.contains(&QUICK);
    let mut found = Vec::new();
    let mut joined = String::new();
    for line in &block.lines {
        joined.push_str(line.text.trim());
        if let Some(begun) = joined.strip_suffix('\\') {
            joined = begun.to_owned();
            continue;
        }
        let text = std::mem::take(&mut joined);
        let whole = Line {
            number: line.number,
            text: &text,
        };
        found.extend(command(path, whole).map(|command| Command {
            is_quick,
            ..command
        }));
    }
    found
}

fn command(path: &str, line: Line<'_>) -> Option<Command> {
    let rest = CALLS.iter().find_map(|call| line.text.strip_prefix(call))?;
    let (call, comment) = rest.split_once(" #").unwrap_or((rest, ""));
    if call.contains(PLACEHOLDERS) {
        return None;
    }
    Some(Command {
        path: path.to_owned(),
        line: line.number,
        words: words(call),
        comment: comment.trim().to_owned(),
        is_quick: false,
        is_span: false,
    })
}

/// Words of a command, as a shell parts them: quotes hold words together.
fn words(call: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let mut quote = None;
    for sign in call.chars() {
        match (sign, quote) {
            ('"' | '\'', None) => quote = Some(sign),
            (_, Some(open)) if sign == open => quote = None,
            (' ', None) => {
                if !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
            }
            _ => word.push(sign),
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

/// Commands that the program does not understand.
///
/// # Errors
/// When the program cannot be started.
pub(super) fn check(commands: &[Command], program: &Program) -> Result<Vec<Fault>> {
    let mut found = Vec::new();
    for command in commands {
        let what = match program.understands(&command.words)? {
            Understood::Yes => continue,
            Understood::InPart if command.is_span => continue,
            Understood::InPart => "it lacks an argument".to_owned(),
            Understood::No(message) => message,
        };
        let call = command.words.join(" ");
        let what = format!("selvedge {call}: {what}");
        found.push(Fault::new(&command.path, command.line, what));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "run `selvedge inspect a` or `other`, `selvedge x <FILE>`\n\n```console quick\n\
        selvedge train x --set \"a = b\" \\\n    --steps 3    # 2 s\nother\n```\n\n\
        ```toml\nselvedge no\n```\n\n```sh\ncargo run --release -- rollout\n```\n";

    fn found() -> Vec<Command> {
        of_page(&TextFile {
            path: "README.md".to_owned(),
            text: PAGE.to_owned(),
        })
    }

    #[test]
    fn commands_of_blocks_and_sentences_are_found() {
        let calls: Vec<String> = found().iter().map(|c| c.words.join("|")).collect();
        assert_eq!(
            calls,
            ["train|x|--set|a = b|--steps|3", "rollout", "inspect|a"]
        );
        let quick: Vec<bool> = found().iter().map(|c| c.is_quick).collect();
        assert_eq!(quick, [true, false, false]);
        assert_eq!(found()[0].comment, "2 s");
        assert_eq!(found()[0].line, 5);
        assert!(found()[2].is_span);
    }

    #[test]
    fn the_notebook_keeps_its_commands() {
        assert!(is_read("README.md") && is_read("docs/src/guides/a.md"));
        assert!(!is_read("docs/src/notebook/a.md") && !is_read("ARCHITECTURE.md"));
    }
}
