//! `selvedge model convert`: a model with its weights in another number format.

use std::path::Path;

use anyhow::Context;
use selvedge_model::Model;
use serde_json::json;

use crate::cli::ConvertArgs;
use crate::output::Answer;
use crate::place;

/// Converts the model.
pub(crate) fn convert(args: &ConvertArgs) -> anyhow::Result<Answer> {
    place::check_file(&args.output, "--output", &["safetensors"])?;
    place::check_distinct(&[("the model", &args.model), ("--output", &args.output)])?;
    let model = selvedge::Model::open(Some(&args.model))?.model;
    let bytes = model.to_bytes_as(args.weights);
    let bytes = bytes.with_context(|| args.model.display().to_string())?;
    let converted = Model::from_bytes(&bytes).context("reading back what was written")?;
    let (root_mean_square, largest) = change(model.weights(), converted.weights());
    place::write(&args.output, &bytes)?;
    let before = size(&args.model);
    let is_unchanged = std::fs::read(&args.model).is_ok_and(|was| was == bytes);
    let report = json!({
        "weights": model.weights().len(),
        "bytes": bytes.len(),
        "bytes_before": before,
        "change_rms": root_mean_square,
        "change_largest": largest,
        "unchanged": is_unchanged,
    });
    let already = if is_unchanged { "; the model was like this already, to the byte" } else { "" };
    let text = format!(
        "{} weights, {} bytes (before: {before}); their RMS changed by {root_mean_square:.1e} of itself, one weight by at most {largest:.1e}{already}",
        model.weights().len(),
        bytes.len(),
    );
    Ok(Answer::new(text, report).noting("model", &args.output))
}

fn size(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |metadata| metadata.len())
}

/// The root mean square of the changes, as a part of that of the numbers, and the largest change.
fn change(from: &[f32], to: &[f32]) -> (f64, f64) {
    let (mut squares, mut changes, mut largest) = (0.0, 0.0, 0.0_f64);
    for (&x, &y) in from.iter().zip(to) {
        let (x, change) = (f64::from(x), f64::from(y) - f64::from(x));
        squares += x * x;
        changes += change * change;
        largest = largest.max(change.abs());
    }
    if squares == 0.0 {
        return (0.0, largest);
    }
    (f64::sqrt(changes / squares), largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_a_part_of_the_numbers() {
        assert_eq!(change(&[3.0, 4.0], &[3.0, 4.0]), (0.0, 0.0));
        assert_eq!(change(&[3.0, -4.0], &[3.0, -4.5]), (0.1, 0.5));
        assert_eq!(change(&[], &[]), (0.0, 0.0));
    }
}
