//! The runs of an evaluation: from true states, for so many frames, and over whole cases.

use serde::{Deserialize, Serialize};

use super::ChoiceError;
use super::case::Case;

/// Runs from true states, and whole runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Horizons {
    /// Frames k after the start at which errors are taken, rising; those that do not fit into a case
    /// are left out there.
    pub frames: Vec<usize>,
    /// True states per case from which runs start, spread evenly.
    pub starts: usize,
    /// Each method also runs from the first frame to the last.
    pub whole: bool,
    /// Frame of the first start; by default the first of the case.
    pub from: Option<usize>,
    /// Frame in which the last run ends; by default the last of the case.
    pub to: Option<usize>,
}

impl Horizons {
    /// Frames k where nobody asks for others.
    pub const USUAL: [usize; 7] = [1, 5, 10, 20, 50, 100, 200];

    /// Runs of `frames` from so many true states per case, and whole runs.
    pub fn new(frames: impl IntoIterator<Item = usize>, starts: usize) -> Self {
        let mut frames: Vec<usize> = frames.into_iter().collect();
        frames.sort_unstable();
        frames.dedup();
        Self {
            frames,
            starts,
            whole: true,
            from: None,
            to: None,
        }
    }

    /// The runs on a case.
    pub(super) fn on(&self, case: &Case) -> Result<Starts, ChoiceError> {
        let [first, all] = case.span()?;
        let about = |problem: String| Err(ChoiceError(format!("{}: {problem}", case.name)));
        if !case.has_truth() {
            return Ok(Starts {
                starts: Vec::new(),
                frames: Vec::new(),
                span: [first, all],
            });
        }
        let (from, last) = (self.from.unwrap_or(first), self.to.unwrap_or(all));
        if from < first {
            return about(format!(
                "from: the run begins in frame {first}, after {from}: choose a later frame"
            ));
        }
        if last > all {
            return about(format!(
                "to: the motion has {all} frames, fewer than {last}: choose an earlier frame"
            ));
        }
        let fits = |k: &&usize| from + **k <= last;
        let frames: Vec<usize> = self.frames.iter().filter(fits).copied().collect();
        let starts = frames.last().map_or_else(Vec::new, |longest| {
            let room = last - from - longest;
            spread(room, self.starts.min(room + 1))
        });
        Ok(Starts {
            starts: starts.into_iter().map(|start| from + start).collect(),
            frames,
            span: [first, last],
        })
    }
}

/// The runs on a case.
pub(super) struct Starts {
    /// Frames of the starts, rising.
    pub(super) starts: Vec<usize>,
    /// Frames after them at which errors are taken.
    pub(super) frames: Vec<usize>,
    /// The first frame and the last of whole runs.
    pub(super) span: [usize; 2],
}

/// `count` numbers from 0 to `last`, spread evenly; the middle where there is one.
fn spread(last: usize, count: usize) -> Vec<usize> {
    match count {
        0 => Vec::new(),
        1 => vec![last / 2],
        count => (0..count).map(|k| k * last / (count - 1)).collect(),
    }
}
