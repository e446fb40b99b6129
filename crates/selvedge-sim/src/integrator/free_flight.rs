//! Free flight `[eq:free-flight]`: gravity alone moves the vertices that no handle holds. Cloth and
//! air have no forces, and nothing is solved. For a throw it is exact, whatever the substep.

use glam::DVec3;

use crate::solver::{SolveError, System};
use crate::state::State;

/// The formula's workspace.
#[derive(Default)]
pub(super) struct FreeFlight {
    /// Velocities of the handles on the way to their targets `[m/s]`, `[handles]`.
    led: Vec<DVec3>,
}

impl FreeFlight {
    /// Moves `state` over `dt` `[s]`: x + dt v + dt² g/2 and v + dt g, and what handles hold to
    /// `targets` `[m]`, at the velocity of the way there. On an error the state is unusable.
    pub(super) fn advance(
        &mut self,
        system: &System,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        let ways = system.handle_positions(state).zip(targets);
        self.led.clear();
        self.led.extend(ways.map(|(from, to)| (*to - from) / dt));
        let change = system.gravity() * dt;
        let fall = change * (0.5 * dt);
        for (position, velocity) in state.positions.iter_mut().zip(&mut state.velocities) {
            *position += *velocity * dt + fall;
            *velocity += change;
        }
        for ((vertex, led), target) in system.held().iter().zip(&self.led).zip(targets) {
            state.positions[vertex.index()] = *target;
            state.velocities[vertex.index()] = *led;
        }
        state.check_finite()
    }
}
