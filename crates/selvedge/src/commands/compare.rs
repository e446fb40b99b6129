//! `selvedge compare`: how far two trajectories of one mesh are apart.

use std::path::PathBuf;

use anyhow::Context;
use selvedge_data::Trajectory;
use selvedge_data::metrics::Comparison;
use selvedge_lab::comparison::compare;
use serde::Serialize;

use crate::cli::CompareArgs;
use crate::output::{Answer, Facts, length, percent};

#[derive(Serialize)]
struct Report {
    a: PathBuf,
    b: PathBuf,
    frames_a: usize,
    frames_b: usize,
    #[serde(flatten)]
    comparison: Comparison,
}

/// Compares two trajectories.
pub(crate) fn run(args: &CompareArgs) -> anyhow::Result<Answer> {
    let a = Trajectory::read(&args.a)?;
    let b = Trajectory::read(&args.b)?;
    let comparison = compare(&a, &b).with_context(|| {
        format!(
            "{} and {} cannot be compared",
            args.a.display(),
            args.b.display()
        )
    })?;
    let report = Report {
        a: args.a.clone(),
        b: args.b.clone(),
        frames_a: a.frame_count(),
        frames_b: b.frame_count(),
        comparison,
    };
    Answer::new(text(&report), &report)
}

fn text(report: &Report) -> Facts {
    let measures = &report.comparison;
    let mut facts = Facts::new();
    let frames = if report.frames_a == report.frames_b {
        measures.frames.to_string()
    } else {
        format!(
            "{} (the first has {}, the second {})",
            measures.frames, report.frames_a, report.frames_b
        )
    };
    facts.add("frames compared", frames);
    facts.add("position RMSE", length(measures.position_rmse));
    facts.add("mean distance", length(measures.mean_vertex_error));
    facts.add("largest distance", length(measures.position_max));
    let relative = measures.edge_length_rmse / measures.edge_length_mean;
    facts.add(
        "edge-length RMSE",
        format!(
            "{}, {} of the mean edge",
            length(measures.edge_length_rmse),
            percent(relative)
        ),
    );
    let per_frame = &measures.per_frame_rmse;
    let worst = (0..per_frame.len()).max_by(|&i, &j| per_frame[i].total_cmp(&per_frame[j]));
    if let (Some(worst), Some(&last)) = (worst, per_frame.last()) {
        facts.add(
            "worst frame",
            format!("{worst}, position RMSE {}", length(per_frame[worst])),
        );
        facts.add("last frame", format!("position RMSE {}", length(last)));
    }
    facts
}
