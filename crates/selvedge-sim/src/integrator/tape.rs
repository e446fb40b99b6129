//! What a substep leaves for its derivatives.

use glam::DVec3;

use crate::state::State;

/// The substeps of a frame as they were taken.
#[derive(Debug, Default)]
pub(crate) struct Tape {
    pub(crate) substeps: Vec<SubstepTape>,
}

/// A substep as it was taken.
#[derive(Debug)]
pub(crate) struct SubstepTape {
    /// Length `[s]`.
    pub(crate) dt: f64,
    pub(crate) start: State,
    /// The state before, of a substep that looked back to one.
    pub(crate) before: Option<State>,
    /// Targets of the active handles at its end `[m]`, `[handles]`.
    pub(crate) targets: Vec<DVec3>,
    /// True if it was left to backward Euler.
    pub(crate) fell_back: bool,
    /// The stages, each with its solves.
    pub(crate) stages: Vec<Vec<SolveTape>>,
}

/// A solve as it was taken.
#[derive(Debug)]
pub(crate) struct SolveTape {
    /// Where it was linearised.
    pub(crate) at: State,
    /// Δv `[m/s]`, `[vertices]`.
    pub(crate) changes: Vec<DVec3>,
}

impl Tape {
    /// Begins a substep over `dt` `[s]`, which looks back to `before` or has none.
    pub(crate) fn begin(
        &mut self,
        dt: f64,
        start: &State,
        before: Option<&State>,
        targets: &[DVec3],
    ) {
        self.substeps.push(SubstepTape {
            dt,
            start: start.clone(),
            before: before.cloned(),
            targets: targets.to_vec(),
            fell_back: false,
            stages: Vec::new(),
        });
    }

    /// Forgets the stages of the substep under way, which goes on by backward Euler.
    pub(crate) fn fall_back(&mut self) {
        if let Some(last) = self.substeps.last_mut() {
            last.fell_back = true;
            last.stages.clear();
        }
    }

    /// Keeps a solve linearised at `at`, the `first` of its stage or a further one.
    pub(crate) fn solved(&mut self, first: bool, at: &State, changes: &[DVec3]) {
        let Some(last) = self.substeps.last_mut() else {
            return;
        };
        if first {
            last.stages.push(Vec::new());
        }
        if let Some(stage) = last.stages.last_mut() {
            stage.push(SolveTape {
                at: at.clone(),
                changes: changes.to_vec(),
            });
        }
    }

    /// Memory of the vectors `[bytes]`.
    pub(crate) fn bytes(&self) -> usize {
        let substeps = self.substeps.iter();
        let vectors = substeps.map(|substep| {
            let solves: usize = substep.stages.iter().map(Vec::len).sum();
            let states = 2 + 2 * usize::from(substep.before.is_some()) + 3 * solves;
            states * substep.start.positions.len() + substep.targets.len()
        });
        vectors.sum::<usize>() * size_of::<DVec3>()
    }
}
