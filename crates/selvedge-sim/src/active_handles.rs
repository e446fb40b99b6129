//! The active handles, those that hold the cloth now, with the system that fits them. A handle that
//! lets go becomes an unknown like any other vertex, which changes the pattern of the system.
//!
//! A handle that takes hold again takes its vertex at its present place. From then on its target is
//! offset from its path by that difference, until it lets go again.

use glam::DVec3;
use selvedge_cloth::{HandleTargets, Scene};

use crate::integrator::{History, SecondOrder};
use crate::solver::{SolveError, System};
use crate::state::State;

/// The active handles and the solvers of all other vertices.
pub(crate) struct ActiveHandles {
    /// True for each handle that holds, `[handles]`.
    holds: Vec<bool>,
    /// Offset of each handle's target from its path `[m]`, `[handles]`.
    offsets: Vec<DVec3>,
    /// System of the cloth with the active handles, in their order.
    pub(crate) system: System,
    /// Formula of a substep, where that is not backward Euler.
    second_order: Option<SecondOrder>,
}

impl ActiveHandles {
    /// All handles of `scene` active, on their paths.
    pub(crate) fn all(scene: &Scene) -> Result<Self, SolveError> {
        let count = scene.handles.len();
        Self::new(scene, vec![true; count], vec![DVec3::ZERO; count])
    }

    /// The handles that hold in `targets`. Those that did not hold before take their vertex at its
    /// place in `state`; `paths` are their last places on the paths `[m]`, `[handles]`.
    pub(crate) fn changed(
        &self,
        scene: &Scene,
        targets: &HandleTargets,
        state: &State,
        paths: &[DVec3],
    ) -> Result<Self, SolveError> {
        let holds: Vec<bool> = (0..self.holds.len()).map(|h| targets.holds(h)).collect();
        let mut offsets = self.offsets.clone();
        for (handle, vertex) in scene.handles.vertices().iter().enumerate() {
            if holds[handle] && !self.holds[handle] {
                offsets[handle] = state.positions[vertex.index()] - paths[handle];
            }
        }
        Self::new(scene, holds, offsets)
    }

    /// The handles of `scene` that hold, each with its offset from its path `[m]`, `[handles]`.
    pub(crate) fn new(
        scene: &Scene,
        holds: Vec<bool>,
        offsets: Vec<DVec3>,
    ) -> Result<Self, SolveError> {
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
            offsets,
            second_order: SecondOrder::of(scene),
            system,
        })
    }

    /// Returns true if every handle holds, and without an offset.
    pub(crate) fn holds_all(&self) -> bool {
        let mut pairs = self.holds.iter().zip(&self.offsets);
        pairs.all(|(holds, offset)| *holds && *offset == DVec3::ZERO)
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

    /// Puts the targets of the active handles `[m]` into `targets`; `path` gives the place of a
    /// handle on its path.
    pub(crate) fn put_targets(&self, targets: &mut Vec<DVec3>, path: impl Fn(usize) -> DVec3) {
        targets.clear();
        for (handle, holds) in self.holds.iter().enumerate() {
            if *holds {
                targets.push(path(handle) + self.offsets[handle]);
            }
        }
    }
}
