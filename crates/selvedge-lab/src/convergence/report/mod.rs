//! The report of a study: a page with tables and plots, and all numbers as CSV.
//!
//! Everything but the times is a pure function of the runs: the same runs, the same bytes. Times
//! stand on the page and in `times.csv`.

mod models;
mod numbers;
mod plots;
mod reading;
mod tables;
mod trust;

use selvedge_view::plot::PlotError;

use self::reading::{own, shown};
use super::order::FAR;
use super::outcome::{Measure, Outcome};
use crate::folder_kind::CONVERGENCE;
use crate::report::{Page, Report};

/// The files of numbers that every report has.
pub const TABLES: [&str; 4] = [CONVERGENCE, "starts.csv", "whole.csv", "times.csv"];

/// The report of a study with a case at least.
///
/// # Errors
/// A value that cannot be drawn.
pub fn report(outcome: &Outcome) -> Result<Report, PlotError> {
    let settings = &outcome.settings;
    let mut page = Page::new("Convergence of the physics");
    page.say(&about(outcome));
    say_in_short(outcome, &mut page);
    say_of_trust(outcome, &mut page)?;
    page.section("Errors from true states");
    page.say("Position RMSE in mm at the k-th frame, and the time of a frame on one thread.");
    page.say(&tables::errors(outcome, Measure::Position));
    page.say(&own_error(outcome));
    for &number in &shown(settings) {
        let k = settings.horizons[number];
        let plot = plots::by_substeps(outcome, number)?;
        page.plot(&format!("substeps-{k}.svg"), "errors by substeps", plot);
    }
    page.section("Errors by the time of a frame");
    for &number in &shown(settings) {
        let k = settings.horizons[number];
        let plot = plots::by_time(outcome, number)?;
        page.plot(&format!("time-{k}.svg"), "errors by time", plot);
    }
    page.say(&tables::prices(outcome));
    say_of_whole_runs(outcome, &mut page)?;
    page.section("Observed order");
    page.say(ORDER);
    page.say(&tables::orders(outcome));
    say_measures(outcome, &mut page)?;
    if outcome.cases.len() > 1 {
        page.section("Case by case");
        page.say(&tables::cases(outcome));
    }
    let failures = tables::failures(outcome);
    if !failures.is_empty() {
        page.section("What failed");
        page.say(&failures);
    }
    page.section("What was measured");
    page.say(NOTES);
    let files = [
        numbers::means,
        numbers::starts,
        numbers::wholes,
        numbers::times,
    ];
    let files = files.map(|file| file(outcome));
    Ok(page.done(TABLES, files))
}

/// Everyone in one table, and models against the physics.
fn say_in_short(outcome: &Outcome, page: &mut Page) {
    page.section("In short");
    page.say(OVERVIEW);
    page.say(&tables::overview(outcome));
    page.say(&models::at_equal_price(outcome));
    let corrections = models::corrections(outcome);
    if !corrections.is_empty() {
        page.section("Corrected physics and the physics that it corrects");
        page.say(&corrections);
    }
}

/// Tables and a plot of whether what models say of themselves is right.
fn say_of_trust(outcome: &Outcome, page: &mut Page) -> Result<(), PlotError> {
    let tables = trust::tables(outcome);
    if !tables.is_empty() {
        page.section("Errors by trust");
        page.say(trust::TRUST);
        page.say(&tables);
        page.plot("trust.svg", "errors by trust", trust::plot(outcome)?);
    }
    Ok(())
}

fn say_of_whole_runs(outcome: &Outcome, page: &mut Page) -> Result<(), PlotError> {
    if outcome.settings.whole {
        page.section("Whole runs");
        page.say(WHOLE);
        page.say(&tables::wholes(outcome));
        let plot = plots::wholes(outcome)?;
        page.plot("whole.svg", "errors of whole runs by time", plot);
    }
    Ok(())
}

/// Measures other than positions.
fn say_measures(outcome: &Outcome, page: &mut Page) -> Result<(), PlotError> {
    page.section("Velocities");
    page.say("Velocity RMSE in mm/s at the k-th frame.");
    page.say(&tables::errors(outcome, Measure::Velocity));
    page.section("Folds");
    page.say("RMS difference of the dihedral angles in degrees at the k-th frame.");
    page.say(&tables::errors(outcome, Measure::Fold));
    page.say("Mean size of the dihedral angles as a part of the truth's.");
    page.say(&tables::ratios(outcome, |d| d.fold_ratio()));
    page.plot("folds.svg", "folds by time", plots::folds(outcome)?);
    let plot = plots::whole_folds(outcome)?;
    page.plot("whole-folds.svg", "folds of whole runs by time", plot);
    page.section("Edges");
    page.say("Edge-length RMSE in mm at the k-th frame.");
    page.say(&tables::errors(outcome, Measure::EdgeLength));
    page.say("The largest strain of an edge up to the k-th frame, as a part of the truth's.");
    page.say(&tables::ratios(outcome, |d| d.strain_ratio()));
    page.section("Energy");
    page.say("Kinetic and gravitational energy less the truth's, in mJ at the k-th frame.");
    page.say(&tables::energies(outcome));
    Ok(())
}

/// The setting of the study, in words.
fn about(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let mut text = String::new();
    for case in &outcome.cases {
        let starts: Vec<String> = case.starts.iter().map(usize::to_string).collect();
        let lost = settings.starts - case.starts.len();
        let cut = match lost {
            0 => String::new(),
            lost => format!(" (interrupted: {lost} more were to be)"),
        };
        text.push_str(&format!(
            "- {}: {} vertices; starts in frames {}{cut}; compared up to frame {}\n",
            case.name,
            case.vertices,
            starts.join(", "),
            case.last
        ));
    }
    format!(
        "The truth is a run by {}; each run begins in one of its states.\n\n{text}",
        settings.reference
    )
}

/// The reference's own error, in words.
fn own_error(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let of = |(number, k): (usize, &usize)| {
        let error = own(outcome, number, Measure::Position)?;
        Some(format!(
            "{} mm at k = {k}",
            tables::significant(1e3 * error)
        ))
    };
    let errors: Vec<String> = settings
        .horizons
        .iter()
        .enumerate()
        .filter_map(of)
        .collect();
    if errors.is_empty() {
        return "The error of the reference is unknown: a run with half its substeps failed."
            .into();
    }
    format!(
        "The reference's own error is about {}: its difference from a run by {} from the same \
         starts, over 2ᵖ - 1 with p = {} (Richardson). Errors less than {FAR} times that are \
         marked *: they are partly the reference's.",
        errors.join(", "),
        settings.half(),
        settings.reference.order(),
    )
}

const OVERVIEW: &str = "Position RMSE in mm at the k-th frame from true states, and folds: the mean size of the dihedral
angles as a part of the truth's. Whole runs go from the first frame to the last; their RMSE is over
all frames.";

const WHOLE: &str = "From the first frame that is compared to the last, over all frames together. A few folds that fall
one way or the other decide errors of whole runs: those from true states tell methods apart.";

const ORDER: &str = "Slope of ln(error) over ln(h), h the length of a substep, by least squares over the substeps whose
errors are not marked. \"–\" where there are fewer than two.";

const NOTES: &str = "Errors are root mean squares over vertices (or edges) at the k-th frame after the start, then means
over starts, then over cases; none is given where a run failed, because a mean over the others would
flatter. Strains are the largest of all starts and cases. Velocities, positions and angles are
compared in double precision. All integrators solve the same equations: where the scene does not say
otherwise, each has the least damping that the second order needs. Integrators that look back at
earlier states begin each run without them. A scene with adaptive substeps is run with a fixed number. Times are medians over the frames
of a run from the middle start on one thread, which has the machine for itself as far as this
program is concerned; all else is the same for any number of threads. The numbers behind the tables
are in convergence.csv (by case, and \"all\"), starts.csv (every run), whole.csv (whole runs) and
times.csv, in SI units.";
