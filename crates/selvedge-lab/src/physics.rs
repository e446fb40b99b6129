//! The reference simulator as commands use it: the sagged rest pose of a scene, a run from there,
//! and what a trajectory says about where it comes from.

use std::ops::ControlFlow;
use std::time::Instant;

use anyhow::Context;
use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, Scene, Stepper};
use selvedge_data::{
    Drive, Provenance, Recording, RecordingEnd, SavedState, SceneSpec, StateRun, Trajectory,
    metrics, record,
};
use selvedge_sim::{SaggedRest, Simulator, Threads, sag_with_progress};

use crate::event::{End, Goal, OnEvent, Reporter};
use crate::state_log::KeepingStates;

/// A run and what it cost.
pub struct Run {
    /// Positions `[m]`, `[frames * vertices]`, the start first.
    pub positions: Vec<Vec3>,
    /// Whether it came to its end.
    pub end: End,
    /// Wall time of a frame `[ms]`.
    pub ms_per_frame: f64,
}

/// The sagged rest pose of a scene.
///
/// # Errors
/// When there is none, or it is not found before an end is asked for.
pub fn rest_pose(scene: &Scene, on_event: &mut OnEvent<'_>) -> anyhow::Result<SaggedRest> {
    find_rest_pose(scene, &Reporter::new(on_event))
}

/// As [`rest_pose`], reporting to one of several listeners.
pub(crate) fn find_rest_pose(scene: &Scene, reporter: &Reporter<'_>) -> anyhow::Result<SaggedRest> {
    let task = reporter.begin("sagging to rest", Goal::Open, "solves");
    let rest = sag_with_progress(scene, &mut |now| {
        let (left, wanted) = (now.residual, now.tolerance);
        task.note(&format!("{left:.1e} m/s² left, to be {wanted:.0e}"));
        task.advance()
    })
    .with_context(|| format!("the rest pose of scene {:?}", scene.name))?;
    tracing::info!(
        solves = rest.solves,
        residual = rest.residual,
        "found the rest pose"
    );
    Ok(rest)
}

/// Simulates `frames` of `scene` from `start` `[m]`, `[vertices]`, at rest, on `threads`. `on_frame`
/// hears of every frame and may stop.
///
/// # Errors
/// When the simulator cannot be made, or a step fails.
pub fn run(
    scene: &Scene,
    start: Vec<DVec3>,
    frames: usize,
    threads: Threads,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> anyhow::Result<Run> {
    let plan = Plan {
        start: SavedState::at_rest(start),
        frames,
        keep: Keep::Positions,
        threads,
    };
    Ok(run_plan(scene, plan, on_frame)?.0)
}

/// What of a run is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// Its positions as a trajectory has them.
    Positions,
    /// Also the states, in f64.
    States,
}

/// A run to be made.
pub struct Plan {
    /// Where it starts.
    pub start: SavedState,
    /// Steps from there.
    pub frames: usize,
    /// What is kept of it.
    pub keep: Keep,
    /// On how many threads it is made; the result is the same on any.
    pub threads: Threads,
}

/// Simulates `scene` as `plan` says; also the states, where they are kept. `on_frame` hears of every
/// frame and may stop.
///
/// # Errors
/// As for [`run`].
pub fn run_plan(
    scene: &Scene,
    plan: Plan,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> anyhow::Result<(Run, Option<StateRun>)> {
    let context = || format!("simulating scene {:?}", scene.name);
    let Plan {
        start,
        frames,
        keep,
        threads,
    } = plan;
    let mut simulator = Simulator::with_state(scene, start.positions, start.velocities)
        .and_then(|simulator| simulator.taken_up_at(start.frame))
        .with_context(context)?;
    simulator.set_threads(threads);
    let path = scene.handle_path().with_context(context)?;
    let drive = Drive {
        path: &path,
        samples_per_frame: scene.physics.substeps as usize,
    };
    let mut simulator = match keep {
        Keep::Positions => Kept::Positions(simulator),
        Keep::States => Kept::States(KeepingStates::new(simulator)),
    };
    let started = Instant::now();
    let recording = record(simulator.stepper(), drive, frames, &mut |_| on_frame());
    let run = timed(recording, scene.mesh.positions().len(), started).with_context(context)?;
    Ok((run, simulator.into_states()))
}

#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
enum Kept {
    Positions(Simulator),
    States(KeepingStates),
}

impl Kept {
    fn stepper(&mut self) -> &mut dyn Stepper {
        match self {
            Self::Positions(simulator) => simulator,
            Self::States(simulator) => simulator,
        }
    }

    fn into_states(self) -> Option<StateRun> {
        match self {
            Self::Positions(_) => None,
            Self::States(simulator) => Some(simulator.into_run()),
        }
    }
}

/// A recording that did not fail, with what it cost since `started`.
///
/// # Errors
/// The step that failed.
pub fn timed(recording: Recording, vertices: usize, started: Instant) -> anyhow::Result<Run> {
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();
    let steps = (recording.positions.len() / vertices).saturating_sub(1);
    let end = match recording.end {
        RecordingEnd::Complete => End::Complete,
        RecordingEnd::Stopped => End::Interrupted,
        RecordingEnd::Failed(error) => return Err(error.into()),
    };
    Ok(Run {
        positions: recording.positions,
        end,
        ms_per_frame: elapsed_ms / steps.max(1) as f64,
    })
}

/// Where a run of `spec` comes from.
///
/// # Errors
/// When the spec cannot be written.
pub fn provenance(spec: &SceneSpec, scene: &Scene) -> anyhow::Result<Provenance> {
    Ok(Provenance {
        frame_rate: scene.frame_rate,
        scene: spec.to_json().context("the resolved scene as JSON")?,
        made_by: concat!("selvedge ", env!("CARGO_PKG_VERSION")).to_owned(),
    })
}

/// The trajectory of a run of `spec`, whose cloth rests at `rest` `[m]`, `[vertices]`.
///
/// # Errors
/// When the parts make no trajectory.
pub fn trajectory(
    spec: &SceneSpec,
    scene: &Scene,
    rest: &[DVec3],
    positions: Vec<Vec3>,
) -> anyhow::Result<Trajectory> {
    let of_scene = || format!("the trajectory of scene {:?}", scene.name);
    let cloth = Cloth::of_scene(scene, rounded(rest)).with_context(of_scene)?;
    Trajectory::new(cloth, positions, provenance(spec, scene)?).with_context(of_scene)
}

/// Positions as files have them.
pub fn rounded(positions: &[DVec3]) -> Vec<Vec3> {
    positions.iter().map(|p| p.as_vec3()).collect()
}

/// The largest strain of an edge over all frames: (l - l₀)/l₀ against the material.
///
/// # Errors
/// When there is nothing to measure.
pub fn largest_strain(trajectory: &Trajectory) -> anyhow::Result<f64> {
    let topology = trajectory.topology();
    let lengths =
        metrics::material_edge_lengths(topology, trajectory.cloth().material_coordinates());
    let strains = metrics::largest_strain(trajectory.frames(), topology, &lengths)
        .context("the largest strain")?;
    Ok(strains.into_iter().fold(f64::NEG_INFINITY, f64::max))
}
