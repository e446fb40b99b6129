//! Answers of commands: a text for people or, with `--json`, one JSON object for programs. It is
//! the only thing that goes to standard output; all else goes to standard error.

use std::fmt::{self, Display, Write as _};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use serde_json::{Map, Value, json};

pub(crate) use selvedge::End;
pub(crate) use selvedge::numbers::{length, percent};
use selvedge_sim::DividedFrames;

/// Items of a list that people are shown.
const SHOWN: usize = 12;

/// A list for people: the first items, and how many more there are.
pub(crate) fn folded<T: Display>(items: impl IntoIterator<Item = T>) -> String {
    let mut items = items.into_iter();
    let shown: Vec<String> = items.by_ref().take(SHOWN).map(|i| i.to_string()).collect();
    let text = shown.join(", ");
    match items.count() {
        0 if text.is_empty() => "none".to_owned(),
        0 => text,
        more => format!("{text} and {more} more"),
    }
}

/// Words on frames that took more substeps than asked for; none where none did.
pub(crate) fn divided(frames: DividedFrames) -> Option<String> {
    let DividedFrames {
        frames,
        most_substeps,
    } = frames;
    let unit = if frames == 1 { "frame" } else { "frames" };
    (frames > 0).then(|| {
        format!("{frames} {unit} took more substeps than the scene asks for, up to {most_substeps}")
    })
}

/// The answer of a command at its end.
pub(crate) struct Answer {
    text: String,
    json: Value,
    end: End,
    problem: Option<String>,
}

/// The reader of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reader {
    Person,
    /// A program: JSON.
    Program,
}

impl Answer {
    /// An answer whose JSON is `json`.
    pub(crate) fn new(text: impl Display, json: Value) -> Self {
        Self {
            text: text.to_string(),
            json,
            end: End::Complete,
            problem: None,
        }
    }

    /// The same, ended as `end` says.
    pub(crate) fn ended(self, end: End) -> Self {
        Self { end, ..self }
    }

    /// The same, which is told and then fails: what it says is not as it should be.
    pub(crate) fn failing(self, problem: String) -> Self {
        Self {
            problem: Some(problem),
            ..self
        }
    }

    /// Returns the end of the command, after its answer was printed.
    pub(crate) fn outcome(self) -> anyhow::Result<End> {
        match self.problem {
            Some(problem) => Err(anyhow::Error::msg(problem)),
            None => Ok(self.end),
        }
    }

    /// The same with one more file that was written.
    pub(crate) fn noting(mut self, name: &str, path: &Path) -> Self {
        let text = self.text.trim_end();
        self.text = format!("{text}\n{name}  {}\n", path.display());
        self.json[name] = path.to_string_lossy().into();
        self
    }

    /// Prints the answer to standard output.
    ///
    /// # Errors
    /// When standard output cannot be written. A reader that has gone away (`| head`) is no error.
    pub(crate) fn print(&self, reader: Reader) -> anyhow::Result<()> {
        let text = match reader {
            Reader::Person => self.text.trim_end().to_owned(),
            Reader::Program => self.json.to_string(),
        };
        let mut out = io::stdout().lock();
        match writeln!(out, "{text}").and_then(|()| out.flush()) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            result => result.context("writing to standard output"),
        }
    }
}

/// Rows of text in aligned columns: the first to the left, the others to the right.
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<'a>(headings: impl IntoIterator<Item = &'a str>) -> Self {
        Self {
            rows: vec![headings.into_iter().map(str::to_owned).collect()],
        }
    }

    /// Adds a row.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    fn widths(&self) -> Vec<usize> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        (0..columns).map(width).collect()
    }
}

impl Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        let across = widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1);
        for (number, row) in self.rows.iter().enumerate() {
            if number == 1 {
                writeln!(f, "{}", "-".repeat(across))?;
            }
            let mut line = String::new();
            for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
                match column {
                    0 => write!(line, "{cell:<width$}")?,
                    _ => write!(line, "  {cell:>width$}")?,
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// Named facts under each other for people; for programs some of them, as JSON.
#[derive(Default)]
pub(crate) struct Facts {
    lines: Vec<(&'static str, String)>,
    report: Map<String, Value>,
}

impl Facts {
    /// No facts yet.
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// A fact for people.
    pub(crate) fn add(&mut self, name: &'static str, value: impl Display) {
        self.lines.push((name, value.to_string()));
    }

    /// A fact for people and programs; these have it under its name with `_` for spaces.
    pub(crate) fn tell(&mut self, name: &'static str, value: impl Display + Serialize) {
        self.tell_as(name, &value, &value);
    }

    /// A fact in `words` for people, and as a `value` for programs.
    pub(crate) fn tell_as(
        &mut self,
        name: &'static str,
        words: impl Display,
        value: impl Serialize,
    ) {
        self.note(&name.replace(' ', "_"), value);
        self.add(name, words);
    }

    /// A fact for programs.
    pub(crate) fn note(&mut self, name: &str, value: impl Serialize) {
        self.report.insert(name.to_owned(), json!(value));
    }

    /// A line of this name for each of `values`.
    pub(crate) fn add_all<T: Display>(
        &mut self,
        name: &'static str,
        values: impl IntoIterator<Item = T>,
    ) {
        values.into_iter().for_each(|value| self.add(name, value));
    }

    /// A line of this name for each of `paths`.
    pub(crate) fn add_paths(&mut self, name: &'static str, paths: &[PathBuf]) {
        self.add_all(name, paths.iter().map(|path| path.display()));
    }

    /// The answer with these facts, and with `more` for programs.
    pub(crate) fn answer(mut self, more: Value) -> Answer {
        if let Value::Object(more) = more {
            self.report.extend(more);
        }
        Answer::new(&self, json!(self.report))
    }

    /// The answer of a command that ended so, which programs are told, too.
    pub(crate) fn answer_at(mut self, end: End, more: Value) -> Answer {
        self.note("interrupted", end == End::Interrupted);
        self.answer(more).ended(end)
    }
}

impl Display for Facts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widest = self.lines.iter().map(|(name, _)| name.len()).max();
        let width = widest.unwrap_or(0);
        for (name, value) in &self.lines {
            writeln!(f, "{name:<width$}  {value}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_and_the_rule_is_as_wide_as_the_table() {
        let mut table = Table::new(["motion", "error"]);
        table.row(["forward".to_owned(), "1.50 mm".to_owned()]);
        table.row(["mean".to_owned(), "12.00 mm".to_owned()]);
        let expected =
            "motion      error\n-----------------\nforward   1.50 mm\nmean     12.00 mm\n";
        assert_eq!(table.to_string(), expected);
    }

    #[test]
    fn long_lists_are_folded() {
        assert_eq!(folded([0; 0]), "none");
        assert_eq!(folded([3, 5]), "3, 5");
        assert_eq!(
            folded(0..13),
            "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11 and 1 more"
        );
    }

    #[test]
    fn divided_frames_are_counted_in_words() {
        let words = |frames, most_substeps| {
            divided(DividedFrames {
                frames,
                most_substeps,
            })
        };
        assert_eq!(words(0, 0), None);
        let one = "1 frame took more substeps than the scene asks for, up to 16";
        assert_eq!(words(1, 16).as_deref(), Some(one));
    }

    #[test]
    fn facts_stand_in_two_columns() {
        let mut facts = Facts::new();
        facts.add("frames", 12);
        facts.add("at", "rest");
        assert_eq!(facts.to_string(), "frames  12\nat      rest\n");
    }
}
