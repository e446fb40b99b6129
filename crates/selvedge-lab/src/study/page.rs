//! The report of a study: its models, and a section for each question.

use selvedge_view::plot::PlotError;

use super::error::StudyError;
use super::evaluation::Results;
use super::file::{Budget, Question, Show, Study};
use super::training::Record;
use crate::evaluation::Row;
use crate::report::{self, Cells, Contest, Group, Measure, Page, Report, Subject};

/// The report of a study of which everything is there.
///
/// # Errors
/// A question that names nobody, or a value that cannot be drawn.
pub(super) fn report(
    study: &Study,
    trained: &[Record],
    results: &Results,
) -> Result<Report, StudyError> {
    let mut page = Page::new(&study.title);
    page.say(&study.text);
    for (number, question) in study.question.iter().enumerate() {
        page.section(&question.title);
        page.say(&question.text);
        let contest = contest(study, question, &results.rows);
        for show in &question.show {
            answer(&mut page, &contest, *show, number + 1)?;
        }
    }
    let everyone = Contest::of(&results.rows);
    let failures = report::failures(&everyone);
    if !failures.is_empty() {
        page.section("What failed");
        page.say(&failures);
    }
    page.section("Models");
    page.say(&models(study, trained)?);
    page.say(&format!(
        "Measured on {}; motions: {}.",
        everyone.values(|row| &row.data).join(", "),
        everyone.values(|row| &row.motion).len()
    ));
    page.say_of_times(&training_times(study, trained));
    Ok(page.finish(&everyone, &results.timings)?)
}

/// The contestants that a question compares.
fn contest<'a>(study: &'a Study, question: &Question, rows: &'a [Row]) -> Contest<'a> {
    let subject = |name: &String| {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.name == *name).collect();
        Some(Subject {
            label: study.label(name)?.to_owned(),
            who: rows.first()?.who,
            rows,
        })
    };
    let groups = question.groups().into_iter().map(|group| Group {
        subjects: group.models.iter().filter_map(subject).collect(),
        heading: group.heading,
    });
    Contest {
        groups: groups.collect(),
    }
}

fn answer(
    page: &mut Page,
    contest: &Contest<'_>,
    show: Show,
    number: usize,
) -> Result<(), PlotError> {
    let file = |what: &str| format!("question-{number}-{what}.svg");
    let both = [
        (Measure::Position, "position"),
        (Measure::EdgeLength, "edge-length"),
    ];
    match show {
        Show::Table => page.say(&report::summary_table(contest)),
        Show::Ablation => page.say(&report::ablation_table(contest)),
        Show::Motions => page.say(&report::motion_table(contest)),
        Show::Meshes => page.say(&report::mesh_table(contest).unwrap_or_default()),
        Show::Steps => {
            page.say(&report::horizon_table(contest));
            let svg = report::horizons_plot(contest)?;
            page.plot(&file("steps"), "errors by steps", svg);
        }
        Show::Time => {
            for (measure, name) in both {
                let svg = report::over_time(contest, measure, None)?;
                page.plot(&file(&format!("time-{name}")), "errors by time", svg);
            }
        }
        Show::Bars => {
            for (measure, name) in both {
                let svg = report::bars(contest, measure)?;
                page.plot(&file(name), "errors of whole runs", svg);
            }
        }
    }
    Ok(())
}

/// A table of the models and of their trainings.
fn models(study: &Study, trained: &[Record]) -> Result<String, StudyError> {
    let headings = [
        "model",
        "what",
        "learned from",
        "budget",
        "steps",
        "parameters",
    ];
    let mut rows: Vec<Cells> = Vec::new();
    for (entry, record) in study.train.iter().zip(trained) {
        let mut what = vec![entry.config.clone()];
        what.extend(study.settings(entry).cloned());
        if study.scale_schedules {
            what.push("scaled to its budget".to_owned());
        }
        what.extend(entry.after.iter().map(|before| format!("after {before}")));
        rows.push(vec![
            entry.name.clone(),
            what.join("; "),
            study.data_of(entry)?.to_owned(),
            match study.budget(entry)? {
                Budget::Steps(steps) => format!("{steps} steps"),
                Budget::Time(time) => format!("{} s", time.as_secs()),
            },
            record.steps_done.to_string(),
            record.parameters.to_string(),
        ]);
    }
    for entry in &study.model {
        let mut cells = vec![entry.name.clone(), entry.file.display().to_string()];
        cells.extend(vec!["–".to_owned(); 4]);
        rows.push(cells);
    }
    Ok(report::table(&headings.map(str::to_owned), &rows))
}

fn training_times(study: &Study, trained: &[Record]) -> String {
    let headings = ["training", "begun on", "time (s)", "steps per second"].map(str::to_owned);
    let cells = |(entry, record): (&super::file::Training, &Record)| {
        let rate = record.steps_done as f64 / record.seconds.max(1e-9);
        vec![
            entry.name.clone(),
            record.device.clone(),
            format!("{:.0}", record.seconds),
            match entry.after {
                // The time before is not in it.
                Some(_) => "–".to_owned(),
                None => format!("{rate:.1}"),
            },
        ]
    };
    let rows: Vec<Cells> = study.train.iter().zip(trained).map(cells).collect();
    format!("## Training\n\n{}", report::table(&headings, &rows))
}
