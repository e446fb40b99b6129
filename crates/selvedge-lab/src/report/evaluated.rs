//! The page of one evaluation: whole runs, steps, time, motion by motion, mesh by mesh.

use selvedge_view::plot::PlotError;

use super::{Cells, Contest, Measure, Page, bars, horizons_plot, markdown, over_time, slug};

/// The head of a page, above the tables.
pub struct Heading<'a> {
    /// The title.
    pub title: &'a str,
    /// A paragraph under it; empty where there is nothing to say.
    pub note: &'a str,
    /// Name, file and parameters of each model.
    pub models: Vec<Cells>,
}

/// The page of everything about `contest`.
///
/// # Errors
/// A value that cannot be drawn.
pub fn evaluation_page(heading: Heading<'_>, contest: &Contest<'_>) -> Result<Page, PlotError> {
    let mut page = Page::new(heading.title);
    page.say(heading.note);
    let names = ["model", "file", "parameters"].map(str::to_owned);
    page.say(&markdown::table(&names, &heading.models));
    page.say(&format!(
        "Data: {}.",
        contest.values(|row| &row.data).join(", ")
    ));
    page.section("Whole runs");
    page.say(&markdown::summary_table(contest));
    page.plot(
        "position.svg",
        "position errors",
        bars(contest, Measure::Position)?,
    );
    page.plot(
        "edge-length.svg",
        "edge-length errors",
        bars(contest, Measure::EdgeLength)?,
    );
    page.section("What the motions are like");
    page.say(LIKENESS);
    page.say(&markdown::likeness_table(contest));
    page.section("Steps from the truth");
    page.say(&markdown::horizon_table(contest));
    page.plot("steps.svg", "errors by steps", horizons_plot(contest)?);
    page.section("Over time");
    for (measure, file) in [
        (Measure::Position, "time-position.svg"),
        (Measure::EdgeLength, "time-edge-length.svg"),
    ] {
        page.plot(file, "errors by time", over_time(contest, measure, None)?);
    }
    motion_by_motion(&mut page, contest)?;
    if let Some(table) = markdown::mesh_table(contest) {
        page.section("Mesh by mesh");
        page.say(BOTH_ERRORS);
        page.say(&table);
    }
    let failures = markdown::failures(contest);
    if !failures.is_empty() {
        page.section("What failed");
        page.say(&failures);
    }
    Ok(page)
}

const LIKENESS: &str = "Ratios to the truth over whole runs: 1 is as the truth. Folds are the mean size of the bending angles, stretch and compression the strains of which 99 % and 1 % of the edges have less, acceleration and jerk root mean squares over the vertices.";
const BOTH_ERRORS: &str = "Position / edge-length RMSE in mm.";

fn motion_by_motion(page: &mut Page, contest: &Contest<'_>) -> Result<(), PlotError> {
    page.section("Motion by motion");
    page.say(BOTH_ERRORS);
    page.say(&markdown::motion_table(contest));
    let mut drawn: Vec<(&str, &str)> = Vec::new();
    for row in contest.subjects().flat_map(|subject| &subject.rows) {
        let motion = (row.data.as_str(), row.motion.as_str());
        if !drawn.contains(&motion) {
            drawn.push(motion);
            let file = format!("time-{}-{}.svg", slug(motion.0), slug(motion.1));
            let svg = over_time(contest, Measure::Position, Some(motion))?;
            page.plot(&file, motion.1, svg);
        }
    }
    Ok(())
}
