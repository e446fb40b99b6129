//! `selvedge run`: a scene by the physics, its rest pose alone, or by a model.

use super::{rollout, sag, simulate};
use crate::cli::RunArgs;
use crate::output::Answer;

/// Runs a scene.
///
/// # Errors
/// What of the scene, the model, a solve or a file went wrong.
pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Answer> {
    match &args.model {
        _ if args.rest => sag::run(args),
        Some(model) => rollout::run(args, model),
        None => simulate::run(args),
    }
}
