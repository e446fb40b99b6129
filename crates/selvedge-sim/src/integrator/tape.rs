//! What a substep leaves for its derivatives.

use std::{sync::Arc, vec::IntoIter};

use glam::DVec3;

use crate::contact::{CollisionTape, Collisions};
use crate::state::State;

/// The substeps of a frame as they were taken.
#[derive(Debug, Default)]
pub(crate) struct Tape {
    substeps: Vec<SubstepTape>,
    /// Substeps that stay; those after them are dropped when one begins.
    settled: usize,
    /// Δv of all solves of the frame, also of those whose substep was dropped.
    solves: Vec<Changes>,
    /// True if a solve failed.
    has_failed: bool,
    /// Δv of the solves that follow, of a frame that is taken again.
    pub(crate) known: IntoIter<Changes>,
}

/// Δv of a solve `[m/s]`, `[vertices]`.
pub(crate) type Changes = Arc<[DVec3]>;

/// A substep, or the part of one that was safe, as it was taken.
#[derive(Debug)]
pub(crate) struct SubstepTape {
    /// Length `[s]`.
    pub(crate) dt: f64,
    /// γ of its last stage `[s]`, where things touched.
    pub(crate) gamma: f64,
    /// Its start, and its end, to which obstacles go, as parts of the frame, where things touched.
    pub(crate) way: [f64; 2],
    /// Its end, to which handles are led, as a part of the frame.
    pub(crate) fraction: f64,
    pub(crate) start: State,
    /// The state before, of a substep that looked back to one.
    pub(crate) before: Option<State>,
    /// Targets of the active handles at its end `[m]`, `[handles]`.
    pub(crate) targets: Vec<DVec3>,
    /// True if it was left to backward Euler.
    pub(crate) fell_back: bool,
    /// The stages, each with its solves.
    pub(crate) stages: Vec<Vec<SolveTape>>,
    /// What contact did, of a substep in which things touched.
    pub(crate) touching: Option<TouchingTape>,
    /// Moves by which pairs were pushed apart after the last solve `[m]`, `[vertices]`; empty if none was.
    pub(crate) pushed: Vec<DVec3>,
    /// The part of it that was safe, if not all.
    pub(crate) safe: Option<f64>,
}

/// A substep in which things touched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TouchingTape {
    /// False if the prediction strained the cloth, and solves began from the base at rest.
    pub(crate) is_near: bool,
}

/// A solve as it was taken.
#[derive(Debug)]
pub(crate) struct SolveTape {
    /// Where it was linearised.
    pub(crate) at: State,
    /// Δv.
    pub(crate) changes: Changes,
    /// What pushed; where the cloth was expected is left out.
    pub(crate) collisions: Collisions,
    /// What each of those came from, `[collisions]`.
    pub(crate) came_from: Vec<CollisionTape>,
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
        self.substeps.truncate(self.settled);
        self.substeps.push(SubstepTape {
            dt,
            gamma: dt,
            way: [0.0, 1.0],
            fraction: 1.0,
            start: start.clone(),
            before: before.cloned(),
            targets: targets.to_vec(),
            fell_back: false,
            stages: Vec::new(),
            touching: None,
            pushed: Vec::new(),
            safe: None,
        });
    }

    /// The substep under way.
    pub(crate) fn last(&mut self) -> Option<&mut SubstepTape> {
        self.substeps[self.settled..].last_mut()
    }

    /// Keeps the substep under way, which ends at this part of the frame.
    pub(crate) fn settle(&mut self, fraction: f64) {
        if let Some(last) = self.last() {
            last.fraction = fraction;
        }
        self.settled = self.substeps.len();
    }

    /// Substeps that are kept.
    pub(crate) fn settled(&self) -> usize {
        self.settled
    }

    /// Drops all but the first substeps.
    pub(crate) fn truncate(&mut self, substeps: usize) {
        self.substeps.truncate(substeps);
        self.settled = self.substeps.len();
    }

    /// The substeps, and Δv of all solves, none if one failed, which are taken out.
    pub(crate) fn take(&mut self) -> (Vec<SubstepTape>, Vec<Changes>) {
        let taken = std::mem::take(self);
        let solves = if taken.has_failed { Vec::new() } else { taken.solves };
        (taken.substeps, solves)
    }

    /// Keeps the Δv of a solve, none if it failed.
    pub(crate) fn keep(&mut self, changes: Option<Changes>) {
        self.has_failed |= changes.is_none();
        self.solves.extend(changes);
    }

    /// Forgets the stages of the substep under way, which goes on by backward Euler.
    pub(crate) fn fall_back(&mut self) {
        if let Some(last) = self.last() {
            last.fell_back = true;
            last.stages.clear();
        }
    }

    /// Keeps a solve linearised at `at`, the `first` of its stage or a further one.
    pub(crate) fn solved(&mut self, first: bool, at: &State, collisions: &Collisions) {
        let changes = self.solves.last().cloned();
        let (Some(last), Some(changes)) = (self.last(), changes) else {
            return;
        };
        if first {
            last.stages.push(Vec::new());
        }
        if let Some(stage) = last.stages.last_mut() {
            stage.push(SolveTape {
                at: at.clone(),
                changes,
                collisions: collisions.without_places(),
                came_from: Vec::new(),
            });
        }
    }

    /// Memory of the substeps without the Δv of their solves `[bytes]`.
    pub(crate) fn bytes(&self) -> usize {
        let substeps = self.substeps.iter();
        let vectors = substeps.map(|substep| {
            let solves = || substep.stages.iter().flatten();
            let states = 2 + 2 * usize::from(substep.before.is_some()) + 2 * solves().count();
            let vectors = states * substep.start.positions.len() + substep.targets.len();
            let touching = solves().map(|solve| solve.collisions.bytes(&solve.came_from));
            let touching: usize = touching.sum();
            vectors * size_of::<DVec3>() + touching
        });
        vectors.sum()
    }
}
