//! Many runs, moved side by side.

use rayon::prelude::*;
use selvedge_cloth::{HandleTargets, StepError};

use crate::run::Run;

/// Moves every run by a frame, side by side on the threads of rayon's pool: its handles to its own of
/// `targets`, or where that is none, or missing, along the motion of its scene. Frames have the bytes
/// of runs that are moved one by one; a run whose step failed is as it was before.
pub fn step_all(runs: &mut [Run], targets: &[Option<HandleTargets>]) -> Vec<Result<(), StepError>> {
    let step = |(number, run): (usize, &mut Run)| match targets.get(number) {
        Some(Some(targets)) => run.step_to(targets),
        _ => run.step(),
    };
    runs.par_iter_mut().enumerate().map(step).collect()
}
