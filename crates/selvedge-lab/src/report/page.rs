//! A report under way: a page of Markdown and the files that it shows.

use selvedge_view::plot::PlotError;

use super::{Contest, Report, by_cost, csv, markdown};
use crate::evaluation::Timing;
use crate::folder_kind::MEANS;

/// The name of the page.
const PAGE: &str = "report.md";

/// The files of numbers that every report has.
pub const TABLES: [&str; 5] = [MEANS, "motions.csv", "steps.csv", "curves.csv", "times.csv"];

/// A report under way.
pub struct Page {
    text: String,
    times: String,
    report: Report,
}

impl Page {
    /// A page with this title.
    pub fn new(title: &str) -> Self {
        Self {
            text: format!("# {title}\n"),
            times: TIMES.to_owned(),
            report: Report::default(),
        }
    }

    /// Begins a section.
    pub fn section(&mut self, heading: &str) {
        self.say(&format!("## {heading}"));
    }

    /// Adds a paragraph or a table; nothing where there is none.
    pub fn say(&mut self, text: &str) {
        if !text.trim().is_empty() {
            self.text.push('\n');
            self.text.push_str(text.trim());
            self.text.push('\n');
        }
    }

    /// Adds to the page of times.
    pub fn say_of_times(&mut self, text: &str) {
        self.times.push_str(&format!("\n{}\n", text.trim()));
    }

    /// Shows a plot, where there is one, which goes to `file` (.svg), with a number where another
    /// has that name.
    pub fn plot(&mut self, file: &str, alternative: &str, plot: Option<String>) {
        if let Some(plot) = plot {
            let stem = self.free_stem(file.strip_suffix(".svg").unwrap_or(file));
            self.say(&format!("![{alternative}]({stem}.svg)"));
            self.report.add(format!("{stem}.svg"), plot);
        }
    }

    /// `stem`, or with the first number that no plot has, in capitals or not.
    fn free_stem(&self, stem: &str) -> String {
        let is_taken = |stem: &String| {
            let file = format!("{stem}.svg");
            let mut files = self.report.files.iter();
            files.any(|(name, _)| name.to_lowercase() == file.to_lowercase())
        };
        let mut own = stem.to_owned();
        let mut number = 1;
        while is_taken(&own) {
            number += 1;
            own = format!("{stem}-{number}");
        }
        own
    }

    /// The report with the files of these names beside the page, which is written last.
    pub(crate) fn done<const N: usize>(self, names: [&str; N], files: [String; N]) -> Report {
        let mut report = self.report;
        for (name, text) in names.into_iter().zip(files) {
            report.add(name, text);
        }
        report.add(PAGE, self.text);
        report
    }

    /// The report with all numbers of `contest` and `timings`. The page is written last, when all
    /// that it shows is there.
    ///
    /// # Errors
    /// A value that cannot be drawn.
    pub fn finish(
        mut self,
        contest: &Contest<'_>,
        timings: &[Timing],
    ) -> Result<Report, PlotError> {
        self.say(NOTES);
        let table = markdown::times_table(timings);
        self.say_of_times(&format!("{PER_FRAME}\n{table}"));
        if let Some(plot) = by_cost(contest, timings)? {
            self.say_of_times("![errors by the time of a frame](times.svg)");
            self.report.add("times.svg", plot);
        }
        let mut report = self.report;
        let tables = [
            csv::means_csv(contest),
            csv::motions_csv(contest),
            csv::steps_csv(contest),
            csv::curves_csv(contest),
            csv::times_csv(timings),
        ];
        for (name, text) in TABLES.into_iter().zip(tables) {
            report.add(name, text);
        }
        report.add("times.md", self.times);
        report.add(PAGE, self.text);
        Ok(report)
    }
}

/// Above all times.
const TIMES: &str = "# Times

They depend on the machine and on what else that was doing.
";

/// Above the table of times.
const PER_FRAME: &str = "## Time per frame

Median over up to 120 frames, each run alone, with all threads.
";

/// An explanation of names and columns.
const NOTES: &str = "## What was measured

Rigid: the rest pose moved with the handles. Mirror: the physics from the other branch of the
buckling. Physics: the simulator itself with so many substeps. Whole runs start at the first frame and are fed with their own output; their measures are
means over motions, and none is given where a run failed. Runs of k steps start at true frames, and
their error is over all k frames; the rivals, who know no truth, and the physics, since a recording
has no velocities, are measured on the same frames of their whole runs. Errors by time over all motions are roots of mean squares. The numbers behind the
tables and plots are in the .csv files, in SI units; the time of a frame, which depends on the
machine, is in [times.md](times.md).";
