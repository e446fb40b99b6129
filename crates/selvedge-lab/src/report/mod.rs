//! Reports of evaluations and trainings: tables in Markdown, all numbers in CSV, plots in SVG and
//! PNG.
//!
//! Everything but the times is a pure function of the rows: the same rows, the same bytes. Times
//! depend on the machine and stand in files of their own.

mod csv;
mod evaluated;
mod markdown;
mod page;
mod plots;
mod training;

use std::io::Write;
use std::path::{Path, PathBuf};

use selvedge_data::{WriteError, write_atomically};
use thiserror::Error;

pub use self::csv::curves_csv;
pub use self::evaluated::{Heading, evaluation_page};
pub use self::markdown::{
    Cells, ablation_table, failures, horizon_table, mesh_table, motion_table, summary_table, table,
};
pub use self::page::{Page, TABLES};
pub(crate) use self::plots::drawn;
pub use self::plots::{Measure, bars, by_cost, horizons_plot, over_time};
pub use self::training::{ReadLogError, TrainingLog, training_chart};

use crate::evaluation::{Row, Who};
use crate::folder::{self, FolderError};

/// Contestants to compare, in groups.
pub struct Contest<'a> {
    /// From top to bottom.
    pub groups: Vec<Group<'a>>,
}

/// Contestants that belong together.
pub struct Group<'a> {
    /// The heading of the group; may be empty.
    pub heading: String,
    /// From top to bottom.
    pub subjects: Vec<Subject<'a>>,
}

/// A contestant with its runs.
pub struct Subject<'a> {
    /// The label beside its numbers.
    pub label: String,
    /// The kind of the contestant.
    pub who: Who,
    /// One per motion.
    pub rows: Vec<&'a Row>,
}

/// A report that cannot be written.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum WriteReportError {
    Folder(#[from] FolderError),
    File(#[from] WriteError),
}

/// The files of a report, in the order in which they are written.
#[derive(Default)]
pub struct Report {
    files: Vec<(String, Vec<u8>)>,
}

impl<'a> Contest<'a> {
    /// All of `rows` in one group, by name in the order in which names appear.
    pub fn of(rows: &'a [Row]) -> Self {
        let mut subjects: Vec<Subject<'a>> = Vec::new();
        for row in rows {
            let is_same =
                |subject: &&mut Subject<'a>| subject.label == row.name && subject.who == row.who;
            match subjects.iter_mut().find(is_same) {
                Some(subject) => subject.rows.push(row),
                None => subjects.push(Subject {
                    label: row.name.clone(),
                    who: row.who,
                    rows: vec![row],
                }),
            }
        }
        let heading = String::new();
        Self {
            groups: vec![Group { heading, subjects }],
        }
    }

    /// Everyone, group after group.
    pub fn subjects(&self) -> impl Iterator<Item = &Subject<'a>> {
        self.groups.iter().flat_map(|group| &group.subjects)
    }

    /// Labels that say the group too, where there are several, in the order of [`Self::subjects`].
    pub fn names(&self) -> Vec<String> {
        let name = |group: &Group<'a>, subject: &Subject<'a>| match group.heading.as_str() {
            "" => subject.label.clone(),
            heading => format!("{}, {heading}", subject.label),
        };
        let groups = self.groups.iter();
        groups
            .flat_map(|group| {
                group
                    .subjects
                    .iter()
                    .map(|s| name(group, s))
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    /// The different values of `of` in the order in which they appear.
    pub fn values(&self, of: impl Fn(&Row) -> &str) -> Vec<String> {
        let mut values: Vec<String> = Vec::new();
        for row in self.subjects().flat_map(|subject| &subject.rows) {
            if !values.iter().any(|value| value == of(row)) {
                values.push(of(row).to_owned());
            }
        }
        values
    }
}

impl Report {
    /// Adds a file.
    pub fn add(&mut self, name: impl Into<String>, content: impl Into<Vec<u8>>) {
        self.files.push((name.into(), content.into()));
    }

    /// Writes every file into `folder`, each whole or not at all, and says where they are.
    ///
    /// # Errors
    /// A folder or a file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, WriteReportError> {
        folder::make_folder(folder)?;
        let mut wrote = Vec::with_capacity(self.files.len());
        for (name, content) in &self.files {
            let path = folder.join(name);
            write_atomically(&path, |out| out.write_all(content))?;
            wrote.push(path);
        }
        Ok(wrote)
    }
}

/// A name that a file may have everywhere.
pub fn slug(text: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() { c } else { '-' };
    text.chars().map(plain).collect()
}

#[cfg(test)]
mod tests;
