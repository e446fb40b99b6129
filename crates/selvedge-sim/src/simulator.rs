//! The reference physics as a [`Stepper`]: one step is one frame of `substeps` solves.
//!
//! The state is f64; [`Stepper::positions`] gives its f32 copies. The answer depends on nothing but
//! scene, start and targets: one thread does the work of one cloth. Contact and strain limiting are
//! not part of it.

use glam::{DVec3, Vec3};
use selvedge_cloth::{
    HandleError, HandleTargets, Handles, Scene, SceneError, StepError, Stepper, Topology, VertexId,
};
use thiserror::Error;

use crate::system::{SolveError, State, System};

/// Cloth that moves by its measured stiffness, gravity and air.
pub struct Simulator {
    topology: Topology,
    handles: Handles,
    system: System,
    state: State,
    saved: State,
    rounded: Vec<Vec3>,
    frame: usize,
    frame_duration: f64,
    substeps: u32,
    /// Where the handles were told to be at the end of the last frame.
    reached: Vec<DVec3>,
    targets: Vec<DVec3>,
}

/// Why a simulator cannot be made.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SimulatorError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("expected {what} of {expected} vertices, found {found}")]
    Count {
        what: &'static str,
        expected: usize,
        found: usize,
    },
    #[error("the {what} of vertex {vertex} is not finite: {value}")]
    NonFinite {
        what: &'static str,
        vertex: VertexId,
        value: DVec3,
    },
    #[error("the system of {vertices} vertices cannot be set up ({cause}): use a smaller mesh")]
    Analysis { vertices: usize, cause: String },
}

impl Simulator {
    /// A simulator of `scene` from its mesh's positions, at rest.
    ///
    /// # Errors
    /// A scene that does not validate, or a system that does not fit in memory.
    pub fn new(scene: &Scene) -> Result<Self, SimulatorError> {
        let positions = scene.mesh.positions().to_vec();
        let velocities = vec![DVec3::ZERO; positions.len()];
        Self::with_state(scene, positions, velocities)
    }

    /// A simulator of `scene` that starts at `positions` `[m]` with `velocities` `[m/s]`, `[vertices]`.
    ///
    /// # Errors
    /// As for [`Self::new`]; also a count that does not match, or a value that is not finite.
    pub fn with_state(
        scene: &Scene,
        positions: Vec<DVec3>,
        velocities: Vec<DVec3>,
    ) -> Result<Self, SimulatorError> {
        scene.validate()?;
        let topology = scene.mesh.topology().clone();
        check_state("positions", "position", &positions, topology.vertex_count())?;
        check_state(
            "velocities",
            "velocity",
            &velocities,
            topology.vertex_count(),
        )?;
        let system = System::new(scene).map_err(|cause| SimulatorError::Analysis {
            vertices: topology.vertex_count(),
            cause: cause.to_string(),
        })?;
        let state = State {
            positions,
            velocities,
        };
        Ok(Self {
            rounded: state.positions.iter().map(|p| p.as_vec3()).collect(),
            reached: scene.handles.select(&state.positions),
            targets: vec![DVec3::ZERO; scene.handles.len()],
            saved: state.clone(),
            handles: scene.handles.clone(),
            frame: 0,
            frame_duration: 1.0 / scene.frame_rate,
            substeps: scene.physics.substeps,
            topology,
            system,
            state,
        })
    }

    /// Positions now `[m]`, `[vertices]`.
    #[must_use]
    pub fn positions_f64(&self) -> &[DVec3] {
        &self.state.positions
    }

    /// Velocities now `[m/s]`, `[vertices]`.
    #[must_use]
    pub fn velocities_f64(&self) -> &[DVec3] {
        &self.state.velocities
    }

    /// Mass of each vertex `[kg]`, `[vertices]`.
    #[must_use]
    pub fn vertex_mass(&self) -> &[f64] {
        self.system.mass()
    }

    /// Kinetic energy Σ m |v|²/2 `[J]`.
    #[must_use]
    pub fn kinetic_energy(&self) -> f64 {
        self.system
            .mass()
            .iter()
            .zip(&self.state.velocities)
            .map(|(mass, velocity)| 0.5 * mass * velocity.length_squared())
            .sum()
    }

    /// One solve over `dt` `[s]`, the handles to `targets` `[m]`, `[handles]`. The frame count stays.
    ///
    /// A Δv = b, v ← v + Δv, x ← x + dt v with A = M - Σ dt (dt + c) J + dt² K_handles and
    /// b = dt f_ext + Σ dt (F + (dt + c) J v) - dt (gradient of the handles' springs at x + dt v);
    /// an exact handle's row is v = (target - x)/dt instead. `[eq:backward-euler]`
    ///
    /// # Errors
    /// As for [`Stepper::step`]; the cloth is then left as it was.
    pub fn substep(&mut self, dt: f64, targets: &[DVec3]) -> Result<(), StepError> {
        check_targets(self.frame, self.handles.len(), targets.len())?;
        self.save();
        self.targets.copy_from_slice(targets);
        self.solve(dt)?;
        self.reached.copy_from_slice(targets);
        self.round();
        Ok(())
    }

    fn save(&mut self) {
        self.saved.positions.copy_from_slice(&self.state.positions);
        self.saved
            .velocities
            .copy_from_slice(&self.state.velocities);
    }

    /// Solves over `dt` towards `self.targets`; goes back to what was saved when it fails.
    fn solve(&mut self, dt: f64) -> Result<(), StepError> {
        let frame = self.frame;
        self.system
            .advance(dt, &mut self.state, &self.targets)
            .map_err(|error| {
                std::mem::swap(&mut self.state, &mut self.saved);
                match error {
                    SolveError::NonFinite { vertex } => StepError::NonFinite { frame, vertex },
                    SolveError::Factor(cause) => StepError::Solve {
                        frame,
                        cause: cause.to_string(),
                    },
                }
            })
    }

    fn round(&mut self) {
        for (rounded, position) in self.rounded.iter_mut().zip(&self.state.positions) {
            *rounded = position.as_vec3();
        }
    }
}

impl Stepper for Simulator {
    fn topology(&self) -> &Topology {
        &self.topology
    }

    fn handles(&self) -> &Handles {
        &self.handles
    }

    fn positions(&self) -> &[Vec3] {
        &self.rounded
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, handles: &HandleTargets) -> Result<(), StepError> {
        check_targets(self.frame, self.handles.len(), handles.handle_count())?;
        self.save();
        let dt = self.frame_duration / f64::from(self.substeps);
        for substep in 1..=self.substeps {
            let fraction = f64::from(substep) / f64::from(self.substeps);
            for (handle, target) in self.targets.iter_mut().enumerate() {
                *target = handles.at(handle, fraction, self.reached[handle]);
            }
            self.solve(dt)?;
        }
        self.reached.copy_from_slice(&self.targets);
        self.frame += 1;
        self.round();
        Ok(())
    }
}

fn check_targets(frame: usize, expected: usize, found: usize) -> Result<(), StepError> {
    if expected == found {
        return Ok(());
    }
    Err(StepError::Handles {
        frame,
        source: HandleError::Count { expected, found },
    })
}

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
    match values.iter().position(|value| !value.is_finite()) {
        Some(vertex) => Err(SimulatorError::NonFinite {
            what: one,
            vertex: VertexId(vertex as u32),
            value: values[vertex],
        }),
        None => Ok(()),
    }
}
