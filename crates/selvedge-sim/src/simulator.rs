//! The reference physics as a [`Stepper`]: one step is one frame of `substeps` solves.
//!
//! The state is f64; [`Stepper::positions`] gives its f32 copies. The answer depends on nothing but
//! scene, start and targets: one thread does the work of one cloth. The wind is that of the frame, held
//! over its step; handles may let go and take hold again between frames. Contact is not part of it.

use glam::{DVec3, Vec3};
use selvedge_cloth::{
    HandleError, HandleTargets, Handles, Scene, SceneError, StepError, Stepper, Topology, VertexId,
};
use thiserror::Error;

use crate::grip::Grip;
use crate::system::{SolveError, State};

/// Cloth that moves by its measured stiffness, gravity and air.
pub struct Simulator {
    scene: Scene,
    grip: Grip,
    state: State,
    saved: State,
    rounded: Vec<Vec3>,
    frame: usize,
    /// Where the paths of the handles were at the end of the last frame, `[handles]`.
    reached: Vec<DVec3>,
    /// Targets of the handles that hold.
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
        let vertices = scene.mesh.topology().vertex_count();
        check_state("positions", "position", &positions, vertices)?;
        check_state("velocities", "velocity", &velocities, vertices)?;
        let grip = Grip::all(scene).map_err(|cause| SimulatorError::Analysis {
            vertices,
            cause: cause.to_string(),
        })?;
        let state = State {
            positions,
            velocities,
        };
        let mut simulator = Self {
            rounded: state.positions.iter().map(|p| p.as_vec3()).collect(),
            reached: scene.handles.select(&state.positions),
            targets: vec![DVec3::ZERO; scene.handles.len()],
            saved: state.clone(),
            frame: 0,
            scene: scene.clone(),
            grip,
            state,
        };
        simulator.feel_the_wind();
        Ok(simulator)
    }

    /// The same cloth, with frames counted from `frame`: the next step has the targets, the wind and
    /// the releases of that frame of the scene, as where a run is taken up again. All handles are
    /// taken to be where their paths are.
    #[must_use]
    pub fn at_frame(mut self, frame: usize) -> Self {
        self.frame = frame;
        self.feel_the_wind();
        self
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
        self.grip.system.mass()
    }

    /// Kinetic energy Σ m |v|²/2 `[J]`.
    #[must_use]
    pub fn kinetic_energy(&self) -> f64 {
        self.vertex_mass()
            .iter()
            .zip(&self.state.velocities)
            .map(|(mass, velocity)| 0.5 * mass * velocity.length_squared())
            .sum()
    }

    /// One solve over `dt` `[s]`, the handles to `targets` `[m]`, `[handles]`, as far as they hold.
    /// The frame count stays, and with it the wind.
    ///
    /// A Δv = b, v ← v + Δv, x ← x + dt v with A = M - Σ dt (dt + c) J + dt² K_handles and
    /// b = dt f_ext + Σ dt (F + (dt + c) J v) - dt (gradient of the handles' springs at x + dt v);
    /// an exact handle's row is v = (target - x)/dt instead. `[eq:backward-euler]`
    ///
    /// # Errors
    /// As for [`Stepper::step`]; the cloth is then left as it was.
    pub fn substep(&mut self, dt: f64, targets: &[DVec3]) -> Result<(), StepError> {
        check_targets(self.frame, self.scene.handles.len(), targets.len())?;
        self.save();
        self.grip.put_targets(&mut self.targets, |h| targets[h]);
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

    /// The wind of the step from this frame to the next.
    fn feel_the_wind(&mut self) {
        let environment = &self.scene.environment;
        let now = environment.during_step(self.frame, self.scene.frame_rate);
        self.grip.system.set_environment(now);
    }

    /// Lets go and takes hold as `handles` says; what was before, where that is something else.
    fn regrip(&mut self, handles: &HandleTargets) -> Result<Option<Grip>, StepError> {
        if self.grip.fits(handles) {
            return Ok(None);
        }
        let grip = self
            .grip
            .changed(&self.scene, handles, &self.state, &self.reached)
            .map_err(|cause| solve_error(self.frame, cause.into()))?;
        Ok(Some(std::mem::replace(&mut self.grip, grip)))
    }

    /// All solves of a frame.
    fn substeps(&mut self, handles: &HandleTargets) -> Result<(), StepError> {
        let substeps = self.scene.physics.substeps;
        let dt = 1.0 / self.scene.frame_rate / f64::from(substeps);
        for substep in 1..=substeps {
            let fraction = f64::from(substep) / f64::from(substeps);
            let reached = &self.reached;
            let path = |h: usize| handles.at(h, fraction, reached[h]);
            self.grip.put_targets(&mut self.targets, path);
            self.solve(dt)?;
        }
        Ok(())
    }

    /// Solves over `dt` towards `self.targets`; goes back to what was saved when it fails.
    fn solve(&mut self, dt: f64) -> Result<(), StepError> {
        self.grip
            .advance(dt, &mut self.state, &self.targets)
            .map_err(|error| {
                std::mem::swap(&mut self.state, &mut self.saved);
                solve_error(self.frame, error)
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
        self.scene.mesh.topology()
    }

    fn handles(&self) -> &Handles {
        &self.scene.handles
    }

    fn positions(&self) -> &[Vec3] {
        &self.rounded
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, handles: &HandleTargets) -> Result<(), StepError> {
        check_targets(self.frame, self.scene.handles.len(), handles.handle_count())?;
        let before = self.regrip(handles)?;
        self.feel_the_wind();
        self.save();
        if let Err(error) = self.substeps(handles) {
            if let Some(before) = before {
                self.grip = before;
            }
            return Err(error);
        }
        self.reached.copy_from_slice(handles.end());
        self.frame += 1;
        self.round();
        Ok(())
    }
}

fn solve_error(frame: usize, error: SolveError) -> StepError {
    match error {
        SolveError::NonFinite { vertex } => StepError::NonFinite { frame, vertex },
        SolveError::Factor(cause) => StepError::Solve {
            frame,
            cause: cause.to_string(),
        },
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
