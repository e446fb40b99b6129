//! All that a run needs to go on bit for bit.

use glam::DVec3;
use selvedge_cloth::{ContactMemory, VertexId};

use super::error::SimulatorError;

/// The state of a run after a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    /// Frames that have passed.
    pub frame: usize,
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// The state one substep ago, which a run of second order looks back to; without it the next
    /// substep starts anew.
    pub previous: Option<PreviousSubstep>,
    /// Changes of velocity of the last solve `[m/s]`, `[vertices]`, and the time over which they
    /// came about `[s]`: conjugate gradients begin from them.
    pub changes: Option<(Vec<DVec3>, f64)>,
    /// What contact left for the next substep.
    pub contact: Option<ContactMemory>,
    /// Distances of the first obstacles from their own paths `[m]`; the others stay where they are.
    pub obstacles: Vec<DVec3>,
}

/// The state of a cloth one substep ago.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviousSubstep {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Velocities `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// Length of the substep that led from there `[s]`.
    pub seconds: f64,
}

impl Checkpoint {
    /// Positions `[m]` and velocities `[m/s]`, `[vertices]`, after `frame` frames, and no more.
    #[must_use]
    pub fn of(frame: usize, positions: Vec<DVec3>, velocities: Vec<DVec3>) -> Self {
        Self {
            frame,
            positions,
            velocities,
            ..Self::default()
        }
    }

    /// Checks that all values are finite in f32, and as many as the cloth has `vertices`.
    pub(super) fn check(&self, vertices: usize) -> Result<(), SimulatorError> {
        check_state("positions", "position", &self.positions, vertices)?;
        check_state("velocities", "velocity", &self.velocities, vertices)?;
        if let Some(before) = &self.previous {
            let (what, one) = ("previous positions", "previous position");
            check_state(what, one, &before.positions, vertices)?;
            let (what, one) = ("previous velocities", "previous velocity");
            check_state(what, one, &before.velocities, vertices)?;
            check_seconds(before.seconds)?;
        }
        if let Some((changes, seconds)) = &self.changes {
            check_state("changes", "change", changes, vertices)?;
            check_seconds(*seconds)?;
        }
        let anchors = self.contact.iter().flat_map(|memory| &memory.anchors);
        for anchor in anchors {
            let vertex = VertexId(anchor.of.numbers()[1]);
            for (what, value) in [
                ("direction of an anchor", anchor.normal),
                ("pull of an anchor", anchor.pull),
            ] {
                if !value.as_vec3().is_finite() {
                    return Err(SimulatorError::NonFinite {
                        what,
                        vertex,
                        value,
                    });
                }
            }
        }
        Ok(())
    }
}

fn check_seconds(seconds: f64) -> Result<(), SimulatorError> {
    match seconds.is_finite() && seconds > 0.0 {
        true => Ok(()),
        false => Err(SimulatorError::PreviousSubstep { seconds }),
    }
}

/// Checks that there is one of `values` per vertex, finite in single precision.
fn check_state(
    what: &'static str,
    one: &'static str,
    values: &[DVec3],
    expected: usize,
) -> Result<(), SimulatorError> {
    if values.len() != expected {
        return Err(SimulatorError::Count {
            what,
            expected,
            found: values.len(),
        });
    }
    match values.iter().position(|value| !value.as_vec3().is_finite()) {
        Some(vertex) => Err(SimulatorError::NonFinite {
            what: one,
            vertex: VertexId(vertex as u32),
            value: values[vertex],
        }),
        None => Ok(()),
    }
}
