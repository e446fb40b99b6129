//! The time of a frame: the median over a short run that has the machine for itself, as far as this
//! program is concerned. It is no part of any other number.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::Who;
use super::contestant::Runner;
use crate::event::Reporter;

/// Frames at most, and the time after which there are enough.
const FRAMES: usize = 120;
const PATIENCE: Duration = Duration::from_secs(2);

/// The time of a frame of one contestant on one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// The mesh, in words.
    pub mesh: String,
    /// The contestant's name.
    pub name: String,
    /// The kind of the contestant.
    pub who: Who,
    /// Wall time, median over frames `[ms]`.
    pub ms_per_frame: f64,
}

/// The median time of the frames of `runner`, at most `frames` of them `[ms]`; none where it made
/// none.
pub(super) fn milliseconds(
    runner: &mut Runner,
    frames: usize,
    reporter: &Reporter<'_>,
) -> Option<f64> {
    let started = Instant::now();
    let mut last = started;
    let mut times = Vec::with_capacity(FRAMES);
    runner.run(frames.min(FRAMES), &mut || {
        let now = Instant::now();
        times.push(1e3 * (now - last).as_secs_f64());
        last = now;
        if now - started > PATIENCE || reporter.is_stopped() {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied()
}
