//! Handles of a learned cloth, which may let go of it and take hold again.

use glam::Vec3;
use selvedge_cloth::{HandleTargets, Handles};

/// State of the handles after a frame: which of them hold, and where.
#[derive(Clone, Debug)]
pub(super) struct Hands {
    /// True for each handle that holds, `[handles]`.
    holds: Vec<bool>,
    /// Targets of the frame `[m]`, `[handles]`.
    targets: Vec<Vec3>,
    /// From the path of each handle to where it holds `[m]`, `[handles]`: one that took hold again
    /// did so where the cloth then was.
    offsets: Vec<Vec3>,
}

impl Hands {
    /// All `handles` of a cloth at `positions` `[m]`, `[vertices]`, on their paths.
    pub(super) fn on_paths(handles: &Handles, positions: &[Vec3]) -> Self {
        Self {
            holds: vec![true; handles.len()],
            targets: handles.select(positions),
            offsets: vec![Vec3::ZERO; handles.len()],
        }
    }

    /// Returns true if no handle has let go.
    pub(super) fn all_hold(&self) -> bool {
        self.holds.iter().all(|holds| *holds)
    }

    /// Makes this what follows `before` by `targets`, of a cloth whose handle vertices are at
    /// `places` `[m]`, `[handles]`.
    pub(super) fn follow(
        &mut self,
        before: &Self,
        targets: &HandleTargets,
        places: impl Iterator<Item = Vec3>,
    ) {
        for (handle, place) in places.enumerate() {
            let holds = targets.holds(handle);
            self.offsets[handle] = match holds && !before.holds[handle] {
                true => place - before.targets[handle],
                false => before.offsets[handle],
            };
            self.holds[handle] = holds;
            self.targets[handle] = targets.end()[handle].as_vec3();
        }
    }

    /// Takes the places `[m]`, `[handles]`, of handles in a frame that was made elsewhere for those
    /// to which their paths led.
    pub(super) fn take(&mut self, places: impl Iterator<Item = Vec3>) {
        for ((target, place), offset) in self.targets.iter_mut().zip(places).zip(&self.offsets) {
            *target = place - *offset;
        }
    }

    /// Places to which the handles lead what they hold `[m]`, `[handles]`.
    pub(super) fn places(&self) -> impl Iterator<Item = Vec3> {
        let pairs = self.targets.iter().zip(&self.offsets);
        pairs.map(|(target, offset)| *target + *offset)
    }
}
