//! The active handles, those that hold the cloth now, with the system that fits them. A handle that
//! lets go becomes an unknown like any other vertex, which changes the pattern of the system.

use glam::DVec3;
use selvedge_cloth::{HandleTargets, Scene};

use crate::integrator::{History, Pulled, SecondOrder, SubstepTape, pull_euler};
use crate::solver::{SolveError, System};
use crate::state::State;

/// The active handles and the solvers of all other vertices.
pub(crate) struct ActiveHandles {
    /// True for each handle that holds, `[handles]`.
    holds: Vec<bool>,
    /// System of the cloth with the active handles, in their order.
    pub(crate) system: System,
    /// Formula of a substep, where that is not backward Euler.
    second_order: Option<SecondOrder>,
}

impl ActiveHandles {
    /// All handles of `scene` active.
    pub(crate) fn all(scene: &Scene) -> Result<Self, SolveError> {
        Self::new(scene, vec![true; scene.handles.len()])
    }

    /// The handles of `scene` that hold, `[handles]`.
    pub(crate) fn new(scene: &Scene, holds: Vec<bool>) -> Result<Self, SolveError> {
        let part;
        let scene = if holds.iter().all(|holds| *holds) {
            scene
        } else {
            part = Scene {
                handles: scene.handles.subset(&holds),
                ..scene.clone()
            };
            &part
        };
        let system = System::new(scene)?;
        Ok(Self {
            holds,
            second_order: SecondOrder::of(scene),
            system,
        })
    }

    /// True for each handle that holds, `[handles]`.
    pub(crate) fn holds(&self) -> &[bool] {
        &self.holds
    }

    /// Returns true if the active handles are those of `targets`.
    pub(crate) fn fits(&self, targets: &HandleTargets) -> bool {
        let mut holds = self.holds.iter().enumerate();
        holds.all(|(h, holds)| *holds == targets.holds(h))
    }

    /// Moves `state` by one substep over `dt` `[s]` in which nothing touches, active handles to
    /// `targets` `[m]`: by the scene's formula, or without a `history` by backward Euler, as a cloth on
    /// its way to rest. On an error state and history are unusable, and the caller restores them.
    pub(crate) fn advance(
        &mut self,
        dt: f64,
        state: &mut State,
        history: Option<&mut History>,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        let system = &mut self.system;
        match (&mut self.second_order, history) {
            (Some(second_order), Some(history)) => {
                second_order.advance(system, dt, targets, state, history)
            }
            _ => {
                if let Some(tape) = &mut system.tape {
                    tape.begin(dt, state, None, targets);
                }
                system.advance(dt, state, targets)
            }
        }
    }

    /// Takes a recorded substep backwards.
    pub(crate) fn pull_back(
        &mut self,
        substep: &SubstepTape,
        pulled: &mut Pulled<'_>,
    ) -> Result<(), SolveError> {
        match &mut self.second_order {
            Some(formula) => formula.pull_back(&mut self.system, substep, pulled),
            None => pull_euler(&mut self.system, substep, pulled),
        }
    }

    /// Moves `state` by one solve towards the end of a substep in which things touch, otherwise as
    /// [`Self::advance`]. Returns false if the end may be far from the solution; [`Self::go_on`] comes
    /// nearer.
    pub(crate) fn advance_touching(
        &mut self,
        dt: f64,
        state: &mut State,
        history: Option<&History>,
        targets: &[DVec3],
    ) -> Result<bool, SolveError> {
        let system = &mut self.system;
        match &mut self.second_order {
            Some(formula) => formula.advance_touching(system, dt, targets, state, history),
            None => system.advance(dt, state, targets).map(|()| true),
        }
    }

    /// Moves `state`, where the last solve led, by another one with what touches now; `start` is the
    /// start of the substep, otherwise as [`Self::advance_touching`].
    pub(crate) fn go_on(
        &mut self,
        dt: f64,
        start: &State,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<bool, SolveError> {
        match &mut self.second_order {
            Some(formula) => formula.go_on(&mut self.system, state),
            None => {
                state.copy_from(start);
                self.system.repeat_start();
                self.system.advance(dt, state, targets).map(|()| true)
            }
        }
    }

    /// Keeps what the next substep looks back to, after one in which things touched.
    pub(crate) fn keep_touching(&self, history: &mut History, end: &State) {
        if let Some(formula) = &self.second_order {
            formula.keep_touching(history, end);
        }
    }

    /// The point of a substep at which its equations hold, as a part of it.
    pub(crate) fn point(&self, looked_back: bool) -> f64 {
        let formula = self.second_order.as_ref().filter(|_| looked_back);
        formula.map_or(1.0, SecondOrder::point)
    }

    /// The impulse of a `force` `[N]` in a substep over `dt` `[s]`, and what the next one looks back to;
    /// `carried` is what this one looked back to, none where it did not.
    pub(crate) fn impulse(&self, dt: f64, force: DVec3, carried: Option<DVec3>) -> [DVec3; 2] {
        match (&self.second_order, carried) {
            (Some(formula), Some(carried)) => formula.impulse(dt, force, carried),
            _ => [force * dt; 2],
        }
    }

    pub(crate) fn looks_back(&self) -> bool {
        self.second_order.is_some()
    }

    /// Puts the targets of the active handles `[m]` into `targets`; `of` gives that of a handle.
    pub(crate) fn put_targets(&self, targets: &mut Vec<DVec3>, of: impl Fn(usize) -> DVec3) {
        let active = self.holds.iter().enumerate().filter(|(_, holds)| **holds);
        targets.clear();
        targets.extend(active.map(|(handle, _)| of(handle)));
    }
}
