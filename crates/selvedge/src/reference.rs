//! The reference simulator as commands use it: the sagged rest pose of a scene, a run from there,
//! and what a trajectory says about where it comes from.

use std::ops::ControlFlow;
use std::time::Instant;

use anyhow::Context;
use glam::{DVec3, Vec3};
use selvedge_cloth::Scene;
use selvedge_data::{
    Cloth, Drive, Provenance, Recording, RecordingEnd, SceneSpec, Trajectory, metrics, record,
};
use selvedge_sim::{SaggedRest, Simulator, Threads, sag_with_progress};

use crate::output::End;
use crate::progress::Progress;

/// A run and what it cost.
pub(crate) struct Run {
    /// Positions `[m]`, `[frames * vertices]`, the start first.
    pub(crate) positions: Vec<Vec3>,
    /// Whether it came to its end.
    pub(crate) end: End,
    /// Wall time of a frame `[ms]`.
    pub(crate) ms_per_frame: f64,
}

/// The sagged rest pose of a scene.
///
/// # Errors
/// When there is none, or it is not found.
pub(crate) fn rest_pose(scene: &Scene) -> anyhow::Result<SaggedRest> {
    let progress = Progress::open_ended("sagging to rest", "solves");
    let rest = sag_with_progress(scene, &mut |now| {
        progress.advance();
        progress.note(format!(
            "{:.1e} m/s² left, to be {:.0e}",
            now.residual, now.tolerance
        ));
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
pub(crate) fn run(
    scene: &Scene,
    start: Vec<DVec3>,
    frames: usize,
    threads: Threads,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> anyhow::Result<Run> {
    let context = || format!("simulating scene {:?}", scene.name);
    let still = vec![DVec3::ZERO; start.len()];
    let mut simulator = Simulator::with_state(scene, start, still).with_context(context)?;
    simulator.set_threads(threads);
    let path = scene.handle_path().with_context(context)?;
    let drive = Drive {
        path: &path,
        samples_per_frame: scene.physics.substeps as usize,
    };
    let started = Instant::now();
    let recording = record(&mut simulator, drive, frames, &mut |_| on_frame());
    timed(recording, scene.mesh.positions().len(), started).with_context(context)
}

/// A recording that did not fail, with what it cost since `started`.
///
/// # Errors
/// The step that failed.
pub(crate) fn timed(
    recording: Recording,
    vertices: usize,
    started: Instant,
) -> anyhow::Result<Run> {
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

/// The trajectory of a run of `spec`, whose cloth rests at `rest` `[m]`, `[vertices]`.
///
/// # Errors
/// When the parts make no trajectory.
pub(crate) fn trajectory(
    spec: &SceneSpec,
    scene: &Scene,
    rest: &[DVec3],
    positions: Vec<Vec3>,
) -> anyhow::Result<Trajectory> {
    let provenance = Provenance {
        frame_rate: scene.frame_rate,
        scene: spec.to_json().context("the resolved scene as JSON")?,
        made_by: concat!("selvedge ", env!("CARGO_PKG_VERSION")).to_owned(),
    };
    let cloth = Cloth::of_scene(scene, rounded(rest));
    Trajectory::new(cloth, positions, provenance)
        .with_context(|| format!("the trajectory of scene {:?}", scene.name))
}

/// Positions as files have them.
pub(crate) fn rounded(positions: &[DVec3]) -> Vec<Vec3> {
    positions.iter().map(|p| p.as_vec3()).collect()
}

/// The largest strain of an edge over all frames: (l - l₀)/l₀ against the material.
///
/// # Errors
/// When there is nothing to measure.
pub(crate) fn largest_strain(trajectory: &Trajectory) -> anyhow::Result<f64> {
    let topology = trajectory.topology();
    let lengths =
        metrics::material_edge_lengths(topology, &trajectory.cloth().material_coordinates);
    let strains = metrics::largest_strain(trajectory.frames(), topology, &lengths)
        .context("the largest strain")?;
    Ok(strains.into_iter().fold(f64::NEG_INFINITY, f64::max))
}
