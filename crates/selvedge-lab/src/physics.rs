//! Runs and their cost, also of the physics alone, and measures of trajectories.

use std::ops::ControlFlow;
use web_time::Instant;

use crate::event::End;
use anyhow::{Result, bail, ensure};
use glam::Vec3;
use selvedge::Run;
pub use selvedge::start::rest_pose;
pub use selvedge::{provenance, rounded, trajectory};
use selvedge_cloth::Scene;
use selvedge_data::metrics::{self, Comparison};
use selvedge_data::{RecordingEnd, SceneSpec, StateRun, Trajectory};

/// A run and its cost.
pub struct TimedRun {
    /// Positions `[m]`, `[frames * vertices]`, the start first.
    pub positions: Vec<Vec3>,
    /// The end that it came to.
    pub end: End,
    /// Wall time of a frame `[ms]`.
    pub ms_per_frame: f64,
}

/// A run as far as it came.
pub struct Simulated {
    /// The frames; those before the one that failed, if one did.
    pub run: TimedRun,
    /// Their states, where they are kept.
    pub states: Option<StateRun>,
    /// The step that failed, after which nothing was simulated.
    pub failure: Option<anyhow::Error>,
}

impl Simulated {
    /// The run and its states.
    pub fn whole(self) -> Result<(TimedRun, Option<StateRun>)> {
        match self.failure {
            Some(error) => Err(error),
            None => Ok((self.run, self.states)),
        }
    }
}

/// Steps `run` for `frames` along the motion of its scene and times it; of the solver `keeps_states`,
/// in f64, too. `on_frame` sees it after every frame and may stop. A step that fails is in what is
/// returned, with the frames before it. Warnings of the frames are told.
pub fn simulate(
    run: &mut Run,
    frames: usize,
    keeps_states: bool,
    on_frame: &mut dyn FnMut(&Run) -> ControlFlow<()>,
) -> Simulated {
    let state = |run: &Run| Some(run.solver()?.checkpoint());
    let mut states = keeps_states.then(StateRun::default);
    let mut keep = |run: &Run| {
        if let Some(states) = &mut states {
            states.states.extend(state(run));
        }
    };
    keep(run);
    let started = Instant::now();
    let recording = run.record(frames, &mut |now| {
        keep(now);
        on_frame(now)
    });
    let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();
    let steps = (recording.positions.len() / run.positions().len()).saturating_sub(1);
    let (end, failure) = match recording.end {
        RecordingEnd::Complete => (End::Complete, None),
        RecordingEnd::Stopped => (End::Interrupted, None),
        RecordingEnd::Failed(error) => (End::Interrupted, Some(error)),
    };
    let scene = run.scene().built();
    for words in run.frame_warnings() {
        tracing::warn!("{}: {words}", scene.name);
    }
    let failure = failure.map(|error| match run.solver() {
        Some(_) => anyhow::Error::new(error).context(format!("simulating scene {:?}", scene.name)),
        None => error.into(),
    });
    Simulated {
        run: TimedRun {
            positions: recording.positions,
            end,
            ms_per_frame: elapsed_ms / steps.max(1) as f64,
        },
        states,
        failure,
    }
}

/// The scene that a trajectory says it was made from, of its mesh and handles. Mesh files are looked
/// for from the current folder.
pub(crate) fn scene_of(trajectory: &Trajectory) -> Result<Scene> {
    let json = &trajectory.provenance().scene;
    if json.is_null() {
        bail!("the trajectory does not say from which scene it is");
    }
    let scene = SceneSpec::from_json(json)?.build("".as_ref())?;
    let fits = scene.mesh.topology() == trajectory.topology();
    ensure!(
        fits && scene.handles == *trajectory.handles(),
        "the scene's mesh is not that of the trajectory"
    );
    Ok(scene)
}

/// The largest strain of an edge over all frames: (l - l₀)/l₀ against the material.
pub fn largest_strain(trajectory: &Trajectory) -> Result<f64> {
    let topology = trajectory.topology();
    let lengths = trajectory.cloth().pattern().edge_lengths();
    let strains = metrics::largest_strain(trajectory.frames(), topology, &lengths)?;
    Ok(strains.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

/// The measures of a trajectory `b` against `a`, which is of the same mesh and frame rate.
pub fn compare(a: &Trajectory, b: &Trajectory) -> Result<Comparison> {
    let (first, second) = (a.vertex_count(), b.vertex_count());
    ensure!(
        first == second,
        "they are of different meshes: {first} and {second} vertices"
    );
    ensure!(
        a.topology() == b.topology(),
        "they are of different meshes: as many vertices, but other faces"
    );
    let (first, second) = (a.frame_rate(), b.frame_rate());
    ensure!(
        first == second,
        "they have {first} and {second} frames per second: a frame of one is no frame of the other"
    );
    Ok(metrics::compare(a.frames(), b.frames(), a.topology())?)
}

#[cfg(test)]
mod tests {
    use selvedge_sim::ContactGauge;

    use super::*;

    /// The edge by which the cloth is led drives it against the rims of the plates, which stand
    /// still: what is pushed away from the one must not be pushed into the other.
    #[test]
    fn a_cloth_that_is_pinched_between_its_edge_and_plates_goes_on() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/scenes/contact");
        for (name, frames) in [("tablecloth-4", 17), ("tablecloth-8", 12)] {
            let loaded = selvedge_data::open_scene(&format!("{folder}/{name}.toml")).unwrap();
            let scene = loaded.scene;
            let start = scene.mesh.positions().to_vec();
            let mut moving = Run::new(&selvedge::Scene::at(scene.clone(), start)).unwrap();
            let made = simulate(&mut moving, frames, false, &mut |_| {
                ControlFlow::Continue(())
            });
            let (run, _) = made
                .whole()
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            let stats = moving.solver().unwrap().stats();
            let divided = stats.divided.frames;
            assert!(
                divided > 0 && stats.contact.projected > 0,
                "{name}: no pinch"
            );
            let mut gauge = ContactGauge::of(&scene).unwrap();
            let vertices = scene.mesh.positions().len();
            for (frame, positions) in run.positions.chunks(vertices).enumerate() {
                let found = gauge.measure(frame, positions);
                assert_eq!(found.intersections, 0, "{name}, frame {frame}");
            }
        }
    }
}
