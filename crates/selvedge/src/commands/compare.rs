//! `selvedge compare`: how far two trajectories of one mesh are apart.

use anyhow::Context;
use selvedge_data::Trajectory;
use selvedge_data::metrics::Comparison;
use selvedge_lab::physics::compare;
use serde_json::json;

use crate::cli::CompareArgs;
use crate::output::{Answer, Facts, length, percent};

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
    let [frames_a, frames_b] = [&a, &b].map(Trajectory::frame_count);
    let mut report = serde_json::to_value(&comparison)?;
    report["a"] = json!(args.a);
    report["b"] = json!(args.b);
    report["frames_a"] = json!(frames_a);
    report["frames_b"] = json!(frames_b);
    Ok(text(&comparison, [frames_a, frames_b]).answer(report))
}

fn text(measures: &Comparison, [a, b]: [usize; 2]) -> Facts {
    let mut facts = Facts::new();
    let compared = measures.frames;
    let frames = if a == b {
        compared.to_string()
    } else {
        format!("{compared} (the first has {a}, the second {b})")
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
        let worst = format!("{worst}, position RMSE {}", length(per_frame[worst]));
        facts.add("worst frame", worst);
        facts.add("last frame", format!("position RMSE {}", length(last)));
    }
    facts
}
