//! Gradients of a run: a recording of its steps, and derivatives of any value of its frames by where
//! it began, where its handles were led, and all numbers of its materials and its air.
//!
//! The steps are differentiated as they were taken, at the converged solution of each: a recording
//! leaves them their bytes. What a comparison decides (a solve that is repeated, an edge that is brought
//! back, compression that is left out of a Jacobian) counts as decided.

use glam::{DVec2, DVec3};
use selvedge_cloth::{
    AirLaw, ElasticLaw, Environment, HandleTargets, Integrator, Rigid, Scene, Snapshot, StepError,
    Stepper,
};
use thiserror::Error;

use super::Simulator;
use crate::active_handles::ActiveHandles;
use crate::contact::ObstacleSlope;
use crate::integrator::{Changes, Pulled, SubstepTape, Tape};
use crate::solver::{MaterialGradient, SolveError};
use crate::state::State;

/// Memory of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GradientSettings {
    /// Bytes that a recording may take. Beyond, the oldest frames keep what their solves found, 24 bytes for each
    /// vertex and solve, by which [`Simulator::backward`] computes them again.
    pub memory: usize,
    /// Frames from one snapshot to the next, which are computed again together.
    pub segment: usize,
}

impl Default for GradientSettings {
    fn default() -> Self {
        Self {
            memory: 96 << 20,
            segment: 8,
        }
    }
}

/// Derivatives of a value by the state after a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateGradient {
    /// By the positions `[1/m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// By the velocities `[s/m]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
}

/// Derivatives of a value of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradient {
    /// By the state where the recording began. Handles count as led from where they were.
    pub start: StateGradient,
    /// By the state one substep before, of a recording that began within a run.
    pub before: Option<StateGradient>,
    /// By the targets of each frame, `[frames][samples * handles]` as [`HandleTargets::sampled`] has
    /// them; 0 of handles that are let go.
    pub targets: Vec<Vec<DVec3>>,
    /// By rigid motions of the obstacles at the start and after each frame, `[frames + 1][obstacles]`.
    pub obstacles: Vec<Vec<ObstacleSlope>>,
    /// By gravity.
    pub gravity: DVec3,
    /// By the constant wind.
    pub wind: DVec3,
    /// By the density of the air.
    pub air_density: f64,
    /// By the drag of the air along a face.
    pub air_drag: f64,
    /// By the numbers of each material, in the order of [`Scene::materials`].
    pub materials: Vec<MaterialGradient>,
    /// By the rest angle of each edge `[1/rad]`, `[edges]`; 0 at the boundary.
    pub rest_angles: Vec<f64>,
    /// By the points of the pattern `[1/m]`, `[points]`, which make rest lengths, areas, masses and how hinges are
    /// evened out. The area on which pressure squeezes the fabric counts as given.
    pub pattern: Vec<DVec2>,
}

/// Why there is no gradient.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum GradientError {
    #[error("scene {scene}: no gradients with {field} {found}: {remedy}")]
    Scene {
        scene: String,
        field: &'static str,
        found: String,
        remedy: &'static str,
    },
    #[error("only the solver has gradients of its steps, and another stepper moves this cloth")]
    NoSolver,
    #[error(
        "nothing is recorded{}: call `record_gradient` before the steps that are to be differentiated, and let nothing else move the cloth between",
        ended_by.map(|call| format!(", for {call} ended the recording")).unwrap_or_default()
    )]
    NotRecorded { ended_by: Option<&'static str> },
    #[error(
        "frame {frame}: the derivatives of the value that were given for {of} {vertex} are not finite: give finite numbers for every vertex"
    )]
    NotFinite {
        frame: usize,
        of: &'static str,
        vertex: usize,
    },
    #[error("frame {frame}: derivatives of {found} vertices for a cloth of {expected}")]
    Count {
        frame: usize,
        expected: usize,
        found: usize,
    },
    #[error("frame {frame}: its adjoint equations could not be solved ({cause})")]
    Solve { frame: usize, cause: String },
    #[error("the gradient of the rest pose: {0}")]
    Rest(String),
    #[error(transparent)]
    Step(#[from] StepError),
}

/// The steps of a simulator since the recording began.
pub(super) struct Recording {
    settings: GradientSettings,
    /// Snapshots before the first frame of each segment.
    snapshots: Vec<Snapshot>,
    frames: Vec<Frame>,
    /// The frames before this one keep no substeps.
    forgotten: usize,
    bytes: usize,
    /// True if the first substep can look back.
    looks_back: bool,
}

/// A recorded frame.
struct Frame {
    targets: HandleTargets,
    holds: Vec<bool>,
    /// Handles that took hold before it, of a vertex where that was.
    caught: Vec<bool>,
    environment: Environment,
    /// Motions by which the obstacles were led, `[obstacles]`.
    leads: Vec<Rigid>,
    substeps: Vec<SubstepTape>,
    /// Δv of its solves, with which it is computed again.
    solves: Vec<Changes>,
    /// Memory of the substeps.
    bytes: usize,
}

impl Recording {
    /// Keeps what `tape` has of frame `k`.
    fn keep(&mut self, k: usize, tape: &mut Tape) {
        let frame = &mut self.frames[k];
        frame.bytes = tape.bytes();
        self.bytes += frame.bytes;
        (frame.substeps, frame.solves) = tape.take();
    }

    /// Drops the substeps of frame `k`.
    fn forget(&mut self, k: usize) {
        self.frames[k].substeps = Vec::new();
        self.bytes -= std::mem::take(&mut self.frames[k].bytes);
    }
}

/// What a step began with.
pub(super) struct Begun {
    snapshot: Option<Snapshot>,
    holds: Vec<bool>,
    leads: Vec<Rigid>,
}

impl Simulator {
    /// Records the steps from here on, for [`Self::backward`]; an earlier recording is dropped. The steps
    /// keep their bytes. Whatever moves the cloth otherwise ends the recording.
    ///
    /// # Errors
    /// [`GradientError::Scene`] for a law or an air that has no derivatives, and for contact with
    /// [`Integrator::Linearised`].
    pub fn record_gradient(&mut self, settings: GradientSettings) -> Result<(), GradientError> {
        check(&self.scene)?;
        self.recording = Some(Box::new(Recording {
            settings,
            snapshots: Vec::new(),
            frames: Vec::new(),
            forgotten: 0,
            bytes: 0,
            looks_back: self.history.last_substep().is_some(),
        }));
        self.active.system.tape = Some(Box::default());
        Ok(())
    }

    /// Ends the recording, if there is one, because of a call of this name.
    pub(super) fn end_recording(&mut self, call: &'static str) {
        if self.recording.take().is_some() {
            self.recording_ended_by = Some(call);
        }
        self.active.system.tape = None;
    }

    /// Frames recorded so far; none where nothing is recorded.
    pub fn recorded_frames(&self) -> Option<usize> {
        Some(self.recording.as_ref()?.frames.len())
    }

    /// Called before a step; hands what it began with to [`Self::end_recorded`].
    pub(super) fn begin_recorded(&mut self) -> Option<Begun> {
        let recording = self.recording.as_ref()?;
        let segment = recording.settings.segment.max(1);
        let is_first = recording.frames.len().is_multiple_of(segment);
        // Without what a step that failed has left.
        self.active.system.tape = Some(Box::default());
        Some(Begun {
            snapshot: if is_first { self.snapshot() } else { None },
            holds: self.active.holds().to_vec(),
            leads: self.obstacle_leads(),
        })
    }

    /// Keeps a step that succeeded.
    pub(super) fn end_recorded(&mut self, begun: Option<Begun>, targets: &HandleTargets) {
        let (Some(begun), Some(recording)) = (begun, &mut self.recording) else {
            return;
        };
        let holds = self.active.holds().to_vec();
        let before = begun.holds.iter().zip(&holds);
        let frame = Frame {
            targets: targets.clone(),
            caught: before.map(|(before, now)| *now && !before).collect(),
            holds,
            leads: begun.leads,
            environment: self
                .scene
                .environment
                .during_step(self.frame - 1, self.scene.frame_rate),
            substeps: Vec::new(),
            solves: Vec::new(),
            bytes: 0,
        };
        recording.snapshots.extend(begun.snapshot);
        recording.frames.push(frame);
        let last = recording.frames.len() - 1;
        if let Some(tape) = &mut self.active.system.tape {
            recording.keep(last, tape);
            let solves = recording.frames[last].solves.iter();
            recording.bytes += solves
                .map(|changes| size_of_val(&changes[..]))
                .sum::<usize>();
        }
        let segment = recording.settings.segment.max(1);
        while recording.bytes > recording.settings.memory && recording.forgotten + segment <= last {
            let from = recording.forgotten;
            (from..from + segment).for_each(|k| recording.forget(k));
            recording.forgotten += segment;
        }
    }

    /// The derivatives of a value of the recorded frames. `seed` is asked for each frame, the last one
    /// first, down to 0, the start of the recording, and adds the value's derivatives by the state
    /// there. The run, and its recording, can go on.
    ///
    /// # Errors
    /// [`GradientError`]; the cloth is as it was.
    pub fn backward(
        &mut self,
        seed: &mut dyn FnMut(usize, &mut StateGradient),
    ) -> Result<Gradient, GradientError> {
        let ended_by = self.recording_ended_by;
        let none = GradientError::NotRecorded { ended_by };
        let mut recording = self.recording.take().ok_or(none)?;
        let now = self.snapshot();
        let counts = (self.history.counts, self.divided);
        let made = self.pull_frames(&mut recording, seed);
        if let Some(now) = now {
            self.rewind(&now)?;
        }
        (self.history.counts, self.divided) = counts;
        self.active.system.tape = Some(Box::default());
        self.recording = Some(recording);
        made
    }

    fn pull_frames(
        &mut self,
        recording: &mut Recording,
        seed: &mut dyn FnMut(usize, &mut StateGradient),
    ) -> Result<Gradient, GradientError> {
        let vertices = self.rounded.len();
        let mut state = State::at_origin(vertices);
        let mut before = State::at_origin(vertices);
        let mut anchors = Vec::new();
        let bodies = self.scene.obstacles.len();
        let mut obstacles =
            vec![vec![ObstacleSlope::default(); bodies]; recording.frames.len() + 1];
        let mut ask = |frame: usize, state: &mut State| {
            let mut by = StateGradient {
                positions: std::mem::take(&mut state.positions),
                velocities: std::mem::take(&mut state.velocities),
            };
            seed(frame, &mut by);
            for (of, by) in [("position", &by.positions), ("velocity", &by.velocities)] {
                if by.len() != vertices {
                    return Err(GradientError::Count {
                        frame,
                        expected: vertices,
                        found: by.len(),
                    });
                }
                if let Some(vertex) = by.iter().position(|by| !by.is_finite()) {
                    return Err(GradientError::NotFinite { frame, of, vertex });
                }
            }
            (state.positions, state.velocities) = (by.positions, by.velocities);
            Ok(())
        };
        let handles = self.scene.handles.vertices().to_vec();
        let frames = &recording.frames;
        let room = |frame: &Frame| vec![DVec3::ZERO; frame.targets.sample_count() * handles.len()];
        let mut targets: Vec<Vec<DVec3>> = frames.iter().map(room).collect();
        let mut solver = self.adjoint_solver(self.active.holds())?;
        let mut sums = solver.system.elements().no_sums();
        for k in (0..recording.frames.len()).rev() {
            ask(k + 1, &mut state)?;
            if recording.frames[k].substeps.is_empty() {
                self.record_again(recording, k)?;
            }
            let frame = &recording.frames[k];
            if frame.holds != solver.holds() {
                solver = self.adjoint_solver(&frame.holds)?;
            }
            solver.system.set_environment(frame.environment);
            let active: Vec<usize> = (0..handles.len()).filter(|h| frame.holds[*h]).collect();
            let mut reached = vec![DVec3::ZERO; handles.len()];
            let by_gravity = sums.gravity;
            for substep in frame.substeps.iter().rev() {
                let mut by_targets = vec![DVec3::ZERO; active.len()];
                let mut by_obstacles = vec![[ObstacleSlope::default(); 2]; bodies];
                let mut pulled = Pulled {
                    state: &mut state,
                    before: &mut before,
                    targets: &mut by_targets,
                    anchors: &mut anchors,
                    obstacles: &mut by_obstacles,
                    sums: &mut sums,
                };
                let solved = solver.pull_back(substep, &mut pulled);
                solved.map_err(|error| GradientError::Solve {
                    frame: k + 1,
                    cause: error.to_string(),
                })?;
                for (part, k) in [(0.0, k), (1.0, k + 1)] {
                    for (sum, by) in obstacles[k].iter_mut().zip(&by_obstacles) {
                        for (by, way) in by.iter().zip(substep.way) {
                            sum.add(*by, 1.0 - (way - part).abs());
                        }
                    }
                }
                for (handle, by) in active.iter().zip(by_targets) {
                    let into = &mut targets[k];
                    reached[*handle] +=
                        frame.targets.pull_back(*handle, substep.fraction, by, into);
                }
            }
            // An onset scales what the scene has.
            let [now, whole] = [frame.environment, self.scene.environment];
            if now.gravity != whole.gravity {
                let part = now.gravity.length() / whole.gravity.length();
                sums.gravity = by_gravity + (sums.gravity - by_gravity) * part;
            }
            for (handle, by) in reached.into_iter().enumerate() {
                match k.checked_sub(1) {
                    Some(last) if !frame.caught[handle] => {
                        let end = targets[last].len() - handles.len();
                        targets[last][end + handle] += by;
                    }
                    _ => state.positions[handles[handle].index()] += by,
                }
            }
            if k < recording.forgotten {
                recording.forget(k);
            }
        }
        ask(0, &mut state)?;
        let elements = solver.system.elements();
        let by_scene = elements.by_scene(&self.scene, &sums);
        Ok(Gradient {
            before: recording.looks_back.then_some(StateGradient {
                positions: before.positions,
                velocities: before.velocities,
            }),
            start: StateGradient {
                positions: state.positions,
                velocities: state.velocities,
            },
            targets,
            obstacles,
            gravity: sums.gravity,
            wind: sums.wind,
            air_density: sums.air_density,
            air_drag: sums.air_drag,
            materials: by_scene.materials,
            rest_angles: by_scene.rest_angles,
            pattern: by_scene.pattern,
        })
    }

    /// The handles that hold, with a system of their own for adjoint solves.
    fn adjoint_solver(&self, holds: &[bool]) -> Result<ActiveHandles, GradientError> {
        let solver = ActiveHandles::new(&self.scene, holds.to_vec());
        let mut solver = solver.map_err(|error: SolveError| GradientError::Solve {
            frame: self.frame,
            cause: error.to_string(),
        })?;
        let threads = self.threads.for_cloth(self.rounded.len());
        solver.system.set_threads(threads);
        Ok(solver)
    }

    /// Computes the segment of frame `k` again, with its substeps.
    fn record_again(&mut self, recording: &mut Recording, k: usize) -> Result<(), GradientError> {
        let segment = recording.settings.segment.max(1);
        let first = k / segment * segment;
        self.rewind(&recording.snapshots[k / segment])?;
        for k in first..=k {
            let mut tape = Box::<Tape>::default();
            tape.known = recording.frames[k].solves.clone().into_iter();
            self.active.system.tape = Some(tape);
            for (number, lead) in recording.frames[k].leads.iter().enumerate() {
                self.lead_obstacle(number, *lead)?;
            }
            self.step(&recording.frames[k].targets.clone())?;
            if let Some(mut tape) = self.active.system.tape.take() {
                recording.keep(k, &mut tape);
            }
        }
        Ok(())
    }
}

/// Refuses a scene whose steps are not differentiated.
pub(crate) fn check(scene: &Scene) -> Result<(), GradientError> {
    let refused = |field, found: &str, remedy| {
        Err(GradientError::Scene {
            scene: scene.name.clone(),
            field,
            found: found.to_owned(),
            remedy,
        })
    };
    if scene.contact.is_some() && scene.physics.integrator == Integrator::Linearised {
        let remedy = "take \"generalised-alpha\", or remove `contact` and the obstacles";
        return refused("physics.integrator", "\"linearised\" with contact", remedy);
    }
    if scene.physics.law != ElasticLaw::Energy {
        let remedy = "write \"energy\", the only law that has an energy";
        return refused("physics.law", "\"measured\" or \"arcsim\"", remedy);
    }
    if scene.physics.air == AirLaw::Explicit {
        return refused("physics.air", "\"explicit\"", "write \"implicit\"");
    }
    Ok(())
}

#[cfg(test)]
impl Simulator {
    /// The substeps that are recorded.
    pub(crate) fn recorded(&self) -> impl Iterator<Item = &SubstepTape> {
        let frames = self
            .recording
            .iter()
            .flat_map(|recording| &recording.frames);
        frames.flat_map(|frame| &frame.substeps)
    }
}
