//! `selvedge evaluate`: a model and its naive rivals on the trajectories of a data set.
//!
//! The model runs alone, so that its time is its own; the rivals that need the physics then run
//! side by side. A run that fails is a row that says so, and its rival's mean is not given.

use std::io::Write;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use selvedge_data::{Dataset, Entry, Trajectory, write_atomically};
use serde::Serialize;

use super::dataset;
use crate::cli::EvaluateArgs;
use crate::evaluation::{Measures, Mirrors, Who, measure, measure_truth, run_model, run_rigid};
use crate::failure::{self, WrongUsage};
use crate::learned::{self, NamedModel};
use crate::output::{Answer, End, Facts, Table, length, percent};
use crate::progress::Progress;
use crate::{interrupt, place};

#[derive(Serialize)]
struct Report {
    model: String,
    data: PathBuf,
    split: &'static str,
    rows: Vec<Row>,
    means: Vec<Mean>,
    curves: Option<PathBuf>,
    interrupted: bool,
}

/// One motion, one run.
#[derive(Serialize)]
struct Row {
    motion: String,
    who: Who,
    #[serde(flatten)]
    measures: Option<Measures>,
    /// Why there are no measures.
    #[serde(skip_serializing_if = "Option::is_none")]
    failure: Option<String>,
}

/// The means over all motions of one who did not fail.
#[derive(Serialize)]
struct Mean {
    who: Who,
    #[serde(flatten)]
    measures: Measures,
}

/// Evaluates a model.
///
/// # Errors
/// What of the model, the data set or a file went wrong.
pub(crate) fn run(args: &EvaluateArgs) -> anyhow::Result<Answer> {
    if let Some(curves) = &args.curves {
        place::check_file(curves, "--curves", &["csv"])?;
    }
    let model = learned::open(Some(&args.model))?;
    let data = dataset::open(&args.data)?;
    let chosen = choose(&data, args)?;
    let mut rows = Vec::new();
    let complete = run_models(&model, &data, &chosen, &mut rows)?;
    let mirrors = match complete {
        true => run_mirrors(&data, &chosen)?,
        false => Vec::new(),
    };
    let end = if interrupt::requested() {
        End::Interrupted
    } else {
        End::Complete
    };
    rows.extend(mirrors);
    let place_of = |row: &Row| chosen.iter().position(|entry| entry.motion == row.motion);
    rows.sort_by_key(|row| (place_of(row), row.who as u8));
    if let Some(curves) = &args.curves {
        write_curves(curves, &rows)?;
    }
    let report = Report {
        model: model.name,
        data: args.data.clone(),
        split: args.split.name(),
        means: Who::ALL
            .into_iter()
            .filter_map(|who| mean(&rows, who))
            .collect(),
        rows,
        curves: args.curves.clone(),
        interrupted: end == End::Interrupted,
    };
    Ok(Answer::new(text(&report), &report)?.ended(end))
}

/// The trajectories that are asked for, in the order of the data set.
fn choose(data: &Dataset, args: &EvaluateArgs) -> anyhow::Result<Vec<Entry>> {
    let entries = data.entries(args.split.split());
    for motion in &args.motions {
        if !entries.iter().any(|entry| entry.motion == *motion) {
            let known: Vec<&str> = entries.iter().map(|e| e.motion.as_str()).collect();
            let problem = format!(
                "--motions {motion}: the {} split has {}",
                args.split.name(),
                known.join(", ")
            );
            return Err(WrongUsage::new(problem).into());
        }
    }
    let is_chosen =
        |entry: &&Entry| args.motions.is_empty() || args.motions.contains(&entry.motion);
    let chosen: Vec<Entry> = entries.iter().filter(is_chosen).cloned().collect();
    if chosen.is_empty() {
        let problem = format!("{}: the split has no trajectories", args.data.display());
        return Err(WrongUsage::new(problem).into());
    }
    Ok(chosen)
}

/// Runs the model and the rigid rival on every motion, and measures the truth. False where an end
/// was asked for; the rows are those of the motions until then.
fn run_models(
    model: &NamedModel,
    data: &Dataset,
    chosen: &[Entry],
    rows: &mut Vec<Row>,
) -> anyhow::Result<bool> {
    let progress = Progress::new("predicting", steps_in(chosen), "frames");
    for entry in chosen {
        progress.note(&entry.motion);
        let truth = data.read(entry)?;
        let run = run_model(model, &entry.motion, &truth, &mut || {
            progress.advance();
            interrupt::flow()
        });
        if interrupt::requested() {
            return Ok(false);
        }
        let measured = run.and_then(|run| measure(&truth, &run));
        rows.push(Row::new(entry, Who::Model, measured));
        let rigid = run_rigid(&truth).and_then(|run| measure(&truth, &run));
        rows.push(Row::new(entry, Who::Rigid, rigid));
        rows.push(Row::new(entry, Who::Truth, measure_truth(&truth)));
    }
    Ok(true)
}

/// Runs the physics on the other branch, motions side by side.
fn run_mirrors(data: &Dataset, chosen: &[Entry]) -> anyhow::Result<Vec<Row>> {
    let mut mirrors = Mirrors::default();
    let mut jobs = Vec::with_capacity(chosen.len());
    for entry in chosen {
        // Read here for its scene, and again where it is compared: all at once may not fit.
        let mirror = mirrors.of(&data.read(entry)?);
        jobs.push((entry, mirror));
    }
    let progress = Progress::new("simulating the mirror branch", steps_in(chosen), "frames");
    let rows = jobs.into_par_iter().with_max_len(1).map(|(entry, mirror)| {
        let truth: Trajectory = data.read(entry)?;
        let run = mirror.and_then(|mirror| {
            mirror.run(&truth, &mut || {
                progress.advance();
                interrupt::flow()
            })
        });
        Ok(match run {
            Ok(Some(run)) => Some(Row::new(entry, Who::Mirror, measure(&truth, &run))),
            Ok(None) => None,
            Err(error) => Some(Row::new(entry, Who::Mirror, Err(error))),
        })
    });
    let rows: anyhow::Result<Vec<Option<Row>>> = rows.collect();
    Ok(rows?.into_iter().flatten().collect())
}

fn steps_in(entries: &[Entry]) -> usize {
    entries
        .iter()
        .map(|entry| entry.frames.saturating_sub(1))
        .sum()
}

impl Row {
    fn new(entry: &Entry, who: Who, result: anyhow::Result<Measures>) -> Self {
        let (measures, failure) = match result {
            Ok(measures) => (Some(measures), None),
            Err(error) => (None, Some(failure::chain(&error))),
        };
        Self {
            motion: entry.motion.clone(),
            who,
            measures,
            failure,
        }
    }
}

fn mean(rows: &[Row], who: Who) -> Option<Mean> {
    let of_who = rows.iter().filter(|row| row.who == who);
    let measures: Option<Vec<&Measures>> = of_who.map(|row| row.measures.as_ref()).collect();
    let measures = measures.filter(|measures| !measures.is_empty())?;
    let count = measures.len() as f64;
    let mean = |of: fn(&Measures) -> f64| measures.iter().map(|m| of(m)).sum::<f64>() / count;
    let time: Option<f64> = measures.iter().map(|m| m.ms_per_frame).sum();
    Some(Mean {
        who,
        measures: Measures {
            position_rmse: mean(|m| m.position_rmse),
            edge_length_rmse: mean(|m| m.edge_length_rmse),
            largest_strain: mean(|m| m.largest_strain),
            final_speed: mean(|m| m.final_speed),
            ms_per_frame: time.map(|sum| sum / count),
            per_frame: Vec::new(),
        },
    })
}

/// One line per motion, run and frame.
fn write_curves(path: &Path, rows: &[Row]) -> anyhow::Result<()> {
    write_atomically(path, |out| {
        writeln!(out, "motion,who,frame,position_rmse")?;
        for row in rows {
            let Some(measures) = &row.measures else {
                continue;
            };
            for (frame, rmse) in measures.per_frame.iter().enumerate() {
                writeln!(out, "{},{},{frame},{rmse:e}", row.motion, row.who.name())?;
            }
        }
        Ok(())
    })?;
    Ok(())
}

fn text(report: &Report) -> String {
    let mut facts = Facts::new();
    facts.add("model", &report.model);
    facts.add(
        "data",
        format!("{}, {} split", report.data.display(), report.split),
    );
    if report.interrupted {
        facts.add("interrupted", "only the motions until then are here");
    }
    if let Some(curves) = &report.curves {
        facts.add("wrote", curves.display());
    }
    let mut table = Table::new([
        "motion",
        "who",
        "position RMSE",
        "edge-length RMSE",
        "largest strain",
        "last second",
        "per frame",
    ]);
    for row in &report.rows {
        table.row(cells(&row.motion, row.who, row.measures.as_ref()));
    }
    table.rule();
    for mean in &report.means {
        table.row(cells("mean", mean.who, Some(&mean.measures)));
    }
    let failures = report.rows.iter().filter_map(|row| {
        let failure = row.failure.as_ref()?;
        Some(format!("{}, {}: {failure}\n", row.motion, row.who.name()))
    });
    let failures: String = failures.collect();
    let notes = "rigid: the rest pose moved with the handles; mirror: the physics from the other branch of the buckling";
    format!("{facts}\n{table}\n{notes}\n{failures}")
}

fn cells(motion: &str, who: Who, measures: Option<&Measures>) -> Vec<String> {
    let mut cells = vec![motion.to_owned(), who.name().to_owned()];
    let Some(m) = measures else {
        cells.push("failed".to_owned());
        return cells;
    };
    cells.extend([
        length(m.position_rmse),
        length(m.edge_length_rmse),
        percent(m.largest_strain),
        format!("{:.3} m/s", m.final_speed),
        m.ms_per_frame
            .map_or_else(|| "-".to_owned(), |ms| format!("{ms:.2} ms")),
    ]);
    cells
}
