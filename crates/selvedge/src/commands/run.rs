//! `selvedge run`: a scene by the physics, its rest pose alone, or by a model.

use selvedge_lab::machine::DeviceName;

use super::{rollout, sag, simulate};
use crate::cli::RunArgs;
use crate::output::Answer;

/// Runs a scene.
pub(crate) fn run(args: &RunArgs) -> anyhow::Result<Answer> {
    match &args.model {
        Some(model) => rollout::run(args, model),
        None if args.machine.device != DeviceName::Cpu => anyhow::bail!(
            "--device is that of a model, and the physics runs on the processor: add --model, or leave --device out"
        ),
        None if args.rest => sag::run(args),
        None => simulate::run(args),
    }
}
