//! `selvedge run`: a scene by the physics, its rest pose alone, or by a model.

use super::{rollout, sag, simulate};
use crate::cli::RunArgs;
use crate::output::Answer;

/// Runs a scene.
pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Answer> {
    match &args.model {
        _ if args.rest => sag::run(args),
        Some(model) => rollout::run(args, model),
        None => simulate::run(args),
    }
}
