//! The physics of a data set as the expert of a training: it labels the model's own states.

use anyhow::{Context, Result};
use glam::{DVec3, Vec3};
use selvedge_cloth::{HandlePath, Scene, Stepper};
use selvedge_data::{Dataset, Entry, Split};
use selvedge_sim::{Simulator, Threads};
use selvedge_train::{Expert, ExpertState};

use crate::physics;

/// Recorded frames that are run to find the velocities at their start. Each takes half of the error
/// or more: with two a label of a recorded state is off by a quarter of what it is with none.
const SHOTS: usize = 2;

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
        let run = |from: &[Vec3], velocities: Vec<DVec3>, frames: usize| {
            let positions = from.iter().map(|p| p.as_dvec3()).collect();
            let simulator = Simulator::with_state(scene, positions, velocities).ok()?;
            let mut simulator = simulator.taken_up_at(state.frame).ok()?;
            simulator.set_threads(Threads::One);
            let mut path = path.clone();
            let mut reached = Vec::with_capacity(frames);
            for frame in state.frame..state.frame + frames {
                path.follow(frame, &simulator.handle_places());
                let targets = path.targets(frame, scene.physics.substeps as usize).ok()?;
                simulator.step(&targets).ok()?;
                reached.push(simulator.positions_f64().to_vec());
            }
            Some(reached)
        };
        // [eq:expert-velocity]
        let rate = scene.frame_rate;
        let [q0, q1, q2, q3] = state.recorded;
        let [before, now] = state.positions;
        let at = |frame: &[Vec3], v: usize| frame[v].as_dvec3();
        let vertices = 0..now.len();
        let through = |v| at(q0, v) - 6.0 * at(q1, v) + 3.0 * at(q2, v) + 2.0 * at(q3, v);
        let mut velocities: Vec<DVec3> =
            vertices.clone().map(|v| rate / 6.0 * through(v)).collect();
        for _ in 0..SHOTS {
            let reached = run(q2, velocities.clone(), 1)?;
            for v in vertices.clone() {
                velocities[v] += rate * (at(q3, v) - reached[0][v]);
            }
        }
        for v in vertices {
            let moved = at(now, v) - at(before, v);
            velocities[v] += rate * (moved - (at(q2, v) - at(q1, v)));
        }
        run(now, velocities, frames)
    }
}

#[cfg(test)]
mod tests;
