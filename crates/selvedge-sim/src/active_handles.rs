//! The active handles, those that hold the cloth now, with the system that fits them. A handle that
//! lets go becomes an unknown like any other vertex, which changes the pattern of the system.

use glam::DVec3;
use selvedge_cloth::{HandleTargets, Scene};

use crate::integrator::{History, SecondOrder};
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

    /// Moves `state` by one substep over `dt` `[s]`, active handles to `targets` `[m]`: by the scene's
    /// formula, or without a `history` by one solve of backward Euler, as a cloth on its way to rest.
    /// Returns false if that solve may be far from the solution, and [`Self::go_on`] is to be called.
    /// On an error state and history are unusable, and the caller restores them.
    pub(crate) fn advance(
        &mut self,
        dt: f64,
        state: &mut State,
        history: Option<&mut History>,
        targets: &[DVec3],
    ) -> Result<bool, SolveError> {
        let system = &mut self.system;
        match (&mut self.second_order, history) {
            (Some(second_order), Some(history)) => {
                second_order.advance(system, dt, targets, state, history)?;
            }
            (Some(second_order), None) => {
                return second_order.from_start(system, dt, targets, state);
            }
            (None, _) => system.advance(dt, state, targets)?,
        }
        Ok(true)
    }

    /// Moves `state`, where the last solve of backward Euler over `dt` `[s]` led, by another one that
    /// is linearised there. Returns false as [`Self::advance`].
    pub(crate) fn go_on(
        &mut self,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<bool, SolveError> {
        match &mut self.second_order {
            Some(second_order) => second_order.go_on(&mut self.system, dt, targets, state),
            None => Ok(true),
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
