//! The physics of a data set as the expert of a training: it labels the model's own states.

use anyhow::{Context, Result};
use glam::DVec3;
use selvedge_cloth::{HandlePath, Scene, Stepper};
use selvedge_data::{Dataset, Entry, Split};
use selvedge_sim::{Simulator, Threads};
use selvedge_train::{Expert, ExpertState};

use crate::physics;

/// The physics of the scenes of a data set's training split.
pub struct PhysicsExpert {
    runs: Vec<(Scene, HandlePath)>,
}

impl PhysicsExpert {
    /// The physics of `data`. Mesh files of its scenes are looked for from the current folder.
    pub fn new(data: &Dataset) -> Result<Self> {
        let run = |entry: &Entry| -> Result<(Scene, HandlePath)> {
            let scene = physics::scene_of(&data.read(entry)?);
            let built = scene.and_then(|scene| Ok((scene.handle_path()?, scene)));
            let (path, scene) = built.with_context(|| {
                let remedy = "expert labels need the scene of every trajectory: make the data set with `selvedge data generate`, or set scheduled_sampling.labels to \"recorded\"";
                format!("training trajectory {}: {remedy}", entry.motion)
            })?;
            Ok((scene, path))
        };
        let runs = data.entries(Split::Train).iter().map(run);
        Ok(Self {
            runs: runs.collect::<Result<_>>()?,
        })
    }
}

impl Expert for PhysicsExpert {
    fn label(&self, state: ExpertState<'_>, frames: usize) -> Option<Vec<Vec<DVec3>>> {
        let (scene, path) = self.runs.get(state.trajectory)?;
        let substeps = scene.physics.substeps;
        let [_, now] = state.positions;
        let positions = now.iter().map(|p| p.as_dvec3()).collect();
        let later = match scene.physics.integrator.order() {
            1 => 0.5 * (1.0 - 1.0 / f64::from(substeps)),
            _ => 0.5,
        };
        let velocities = velocities(&state, later, scene.frame_rate);
        let simulator = Simulator::with_state(scene, positions, velocities).ok()?;
        let mut simulator = simulator.taken_up_at(state.frame).ok()?;
        simulator.set_threads(Threads::One);
        let mut path = path.clone();
        let mut labels = Vec::with_capacity(frames);
        for frame in state.frame..state.frame + frames {
            path.follow(frame, &simulator.handle_places());
            let targets = path.targets(frame, substeps as usize).ok()?;
            simulator.step(&targets).ok()?;
            labels.push(simulator.positions_f64().to_vec());
        }
        Some(labels)
    }
}

/// Velocities that the physics goes on with `[m/s]`, `[vertices]`: the mean velocity of the frame,
/// and what it changes by in the recorded motion until it is that of the physics, a part `later` of
/// a frame after the frame's middle. Backward Euler has the mean velocity of the last of n substeps,
/// whose middle is 1/(2n) of a frame before the end; methods of second order that at the end.
/// `[eq:expert-velocity]`
fn velocities(state: &ExpertState<'_>, later: f64, rate: f64) -> Vec<DVec3> {
    // The acceleration halfway between the two middles: of two estimates, each about a frame.
    let newer = 0.5 + 0.5 * later;
    let [before, now] = state.positions;
    let [q0, q1, q2, q3] = state.recorded;
    (0..now.len())
        .map(|v| {
            let p = |frame: &[glam::Vec3]| frame[v].as_dvec3();
            let last = p(q2) - 2.0 * p(q1) + p(q0);
            let next = p(q3) - 2.0 * p(q2) + p(q1);
            let change = later * (newer * next + (1.0 - newer) * last);
            rate * (p(now) - p(before) + change)
        })
        .collect()
}

#[cfg(test)]
mod tests;
