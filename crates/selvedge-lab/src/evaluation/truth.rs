//! The truth of a case: its frames, its scene, and the path of its handles. A converged run is kept
//! in a file, so that another evaluation of the same scene need not make it again.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, anyhow};
use glam::{DVec3, Vec3};
use selvedge_cloth::{Checkpoint, Cloth, HandlePath, Motion, RecordedMotion, Scene, Stepper};
use selvedge_data::{LoadedScene, SceneSpec, StartSpec, StateRun, Trajectory};
use selvedge_sim::{Simulator, Threads};

use super::case::{Case, Source};
use super::horizons::Starts;
use super::method::PhysicsMethod;
use crate::cause::chain;
use crate::event::{End, Task};
use crate::physics::{self, rounded};
use selvedge::start::simulator_of_run;

/// Frames of a kept run that are made again, to see that the physics still makes it.
const CHECKED: usize = 5;

/// A case ready to be run along.
pub(super) struct Truth {
    /// The true frames from frame `first` on; the rest pose alone where nobody knows them.
    pub(super) trajectory: Trajectory,
    /// The same with velocities, in f64, where they are known.
    states: Option<StateRun>,
    /// Frames of the motion that have passed in the first of them.
    pub(super) first: usize,
    /// The scene with its motion, or why there is none.
    pub(super) scene: Result<Arc<Scene>, String>,
    /// The path of the handles as it was recorded; otherwise it is the scene's.
    pub(super) recorded: Option<HandlePath>,
}

/// A case with what is found before any run.
pub(super) struct Prepared<'a> {
    pub(super) case: &'a Case,
    /// Its runs.
    pub(super) on: Starts,
    /// Its mesh, in words.
    pub(super) mesh: String,
    /// The start of a converged run.
    pub(super) start: Option<Checkpoint>,
}

impl Truth {
    /// True positions in `frame` `[m]`, `[vertices]`.
    pub(super) fn positions(&self, frame: usize) -> Option<Vec<DVec3>> {
        let place = frame.checked_sub(self.first)?;
        if let Some(states) = &self.states {
            return Some(states.states.get(place)?.positions.clone());
        }
        let is_there = place < self.trajectory.frame_count();
        is_there.then(|| widened(self.trajectory.frame(place)))
    }

    /// The true state in `frame`; where velocities are not known, those from the frame before, or
    /// none.
    pub(super) fn state(&self, frame: usize) -> Option<Checkpoint> {
        let positions = self.positions(frame)?;
        let place = frame - self.first;
        if let Some(states) = &self.states {
            let velocities = states.states.get(place)?.velocities.clone();
            return Some(Checkpoint::of(0, positions, velocities));
        }
        let before = self.positions(frame.saturating_sub(1).max(self.first))?;
        let moved = positions.iter().zip(&before).map(|(p, q)| *p - *q);
        let velocities = moved.map(|step| step * self.trajectory.frame_rate());
        let velocities = velocities.collect();
        Some(Checkpoint::of(0, positions, velocities))
    }

    /// At most `count` true frames up to `frame`, the oldest first `[m]`, `[vertices]`.
    pub(super) fn known(&self, frame: usize, count: usize) -> Vec<&[Vec3]> {
        let last = frame - self.first;
        let first = (last + 1).saturating_sub(count);
        (first..=last).map(|at| self.trajectory.frame(at)).collect()
    }

    /// The path of the handles for a method that needs the scene, or for one that does not.
    pub(super) fn path(&self, of_scene: bool) -> Result<HandlePath> {
        match &self.recorded {
            Some(path) if !of_scene => Ok(path.clone()),
            _ => Ok(self.scene()?.handle_path()?),
        }
    }

    /// The scene with its motion.
    pub(super) fn scene(&self) -> Result<&Arc<Scene>> {
        self.scene.as_ref().map_err(|why| anyhow!("{why}"))
    }
}

fn widened(positions: &[Vec3]) -> Vec<DVec3> {
    positions.iter().map(|p| p.as_dvec3()).collect()
}

impl Prepared<'_> {
    /// Opens the truth, or makes it. None where an end is asked for.
    pub(super) fn truth(
        &self,
        with_scene: bool,
        references: Option<&Path>,
        task: &Task<'_, '_>,
    ) -> Result<Option<Truth>> {
        match &self.case.source {
            Source::Recorded(data, entry) => recorded(data.read(entry)?, with_scene).map(Some),
            Source::Random(loaded, rest, _) => {
                let trajectory = physics::trajectory(
                    0,
                    &loaded.spec,
                    &loaded.scene,
                    &rest.positions,
                    rounded(&rest.positions),
                )?;
                Ok(Some(Truth {
                    trajectory,
                    states: None,
                    first: 0,
                    scene: Ok(Arc::new(loaded.scene.clone())),
                    recorded: None,
                }))
            }
            Source::Converged(loaded, method) => {
                let reference = Reference {
                    case: self.case,
                    loaded,
                    method,
                    last: self.on.span[1],
                };
                reference.truth(self.start.as_ref(), references, task)
            }
        }
    }
}

pub(super) fn recorded(trajectory: Trajectory, with_scene: bool) -> Result<Truth> {
    let held = |frame: usize| widened(&trajectory.handles().select(trajectory.frame(frame)));
    let positions = (0..trajectory.frame_count()).map(held).collect();
    let path = Motion::Recorded(RecordedMotion { positions })
        .bind(&held(0), trajectory.frame_rate())
        .context("the recorded path of the handles")?;
    let scene = if with_scene {
        physics::scene_of(&trajectory).map_err(|error| chain(error.as_ref()))
    } else {
        Err("the scene was not asked for".to_owned())
    };
    Ok(Truth {
        states: None,
        first: 0,
        scene: scene.map(Arc::new),
        recorded: Some(path),
        trajectory,
    })
}

/// A converged run, kept or to be made.
pub(super) struct Reference<'a> {
    pub(super) case: &'a Case,
    pub(super) loaded: &'a LoadedScene,
    pub(super) method: &'a PhysicsMethod,
    /// The last frame that is needed.
    pub(super) last: usize,
}

impl Reference<'_> {
    fn scene(&self) -> (Scene, SceneSpec) {
        let scene = self.method.scene(&self.loaded.scene);
        let mut spec = self.loaded.spec.clone();
        spec.setting.physics = scene.physics;
        (scene, spec)
    }

    fn truth(
        &self,
        start: Option<&Checkpoint>,
        references: Option<&Path>,
        task: &Task<'_, '_>,
    ) -> Result<Option<Truth>> {
        let (scene, spec) = self.scene();
        let file = references
            .map(|folder| self.file(folder, &spec))
            .transpose()?;
        let states = match file.as_ref().and_then(|file| self.kept(file, &scene)) {
            Some(kept) => kept,
            None => {
                let start = start.cloned().with_context(|| {
                    let case = &self.case.name;
                    format!("{case}: the kept reference has vanished or changed: run it again")
                })?;
                let Some(made) = self.made(&scene, start, task)? else {
                    return Ok(None);
                };
                if let Some(file) = file {
                    made.write(&file, &physics::provenance(&spec, &scene)?)?;
                }
                made
            }
        };
        let start = states.states.first();
        let first = start.map_or(0, |state| state.frame);
        // The rest pose that models compare with.
        let begins_at_rest = self.loaded.state.is_none() && spec.start == StartSpec::Rest;
        let rest = match start {
            Some(start) if begins_at_rest => start.positions.clone(),
            _ => selvedge_sim::sag(&self.loaded.scene)
                .map_or_else(|_| scene.mesh.positions().to_vec(), |rest| rest.positions),
        };
        let all = states.states.iter();
        let positions = all.flat_map(|state| rounded(&state.positions)).collect();
        let own = &self.loaded.scene;
        let trajectory = physics::trajectory(first, &self.loaded.spec, own, &rest, positions)?;
        Ok(Some(Truth {
            trajectory,
            states: Some(states),
            first,
            scene: Ok(Arc::new(own.clone())),
            recorded: None,
        }))
    }

    /// Returns true where the run is kept in `folder`.
    pub(super) fn is_kept(&self, folder: &Path) -> Result<bool> {
        let (scene, spec) = self.scene();
        let file = self.file(folder, &spec)?;
        Ok(self.kept(&file, &scene).is_some())
    }

    /// The file of the run in `folder`. Its name tells the scene and the method apart from others.
    fn file(&self, folder: &Path, spec: &SceneSpec) -> Result<PathBuf> {
        let json = spec.to_json().context("the resolved scene as JSON")?;
        let json = json.to_string();
        let hash = blake3::hash(json.as_bytes()).to_hex();
        Ok(folder.join(format!("{}-{}.safetensors", self.case.slug(), &hash[..16])))
    }

    /// The kept run; none where there is none that fits. One that is there and does not fit is
    /// warned of.
    fn kept(&self, file: &Path, scene: &Scene) -> Option<StateRun> {
        let bytes = selvedge_data::read_file(file).ok()?;
        let unfit = |problem: String| {
            tracing::warn!("{}: {problem}: it is made again", file.display());
            None
        };
        let run = match StateRun::from_bytes(&bytes) {
            Ok(run) => run,
            Err(error) => return unfit(error.to_string()),
        };
        let vertices = scene.mesh.positions().len();
        let states = &run.states;
        if states.iter().any(|state| state.positions.len() != vertices) {
            return unfit("the kept reference is of another mesh".to_owned());
        }
        let first = self.loaded.state.as_ref().map_or(0, |state| state.frame);
        let mut frames = states.iter().zip(first..);
        if states.is_empty() || !frames.all(|(found, expected)| found.frame == expected) {
            return unfit("the kept reference lacks frames".to_owned());
        }
        // A shorter run served an evaluation of an earlier part of the motion.
        if first + states.len() <= self.last {
            return None;
        }
        match made_again(&run, first, scene) {
            Ok(true) => Some(run),
            Ok(false) => unfit("this program makes another reference".to_owned()),
            Err(error) => unfit(chain(error.as_ref())),
        }
    }

    fn made(
        &self,
        scene: &Scene,
        start: Checkpoint,
        task: &Task<'_, '_>,
    ) -> Result<Option<StateRun>> {
        let frames = self.last.saturating_sub(start.frame);
        let scene = selvedge::Scene::in_state(scene.clone(), start);
        let mut run = selvedge::Run::new(&scene).context("the reference run")?;
        let made = physics::simulate(&mut run, frames, true, &mut |_| task.advance());
        let (run, states) = made.whole().context("the reference run")?;
        Ok(states.filter(|_| run.end == End::Complete))
    }
}

/// Makes the first frames of a kept run again and returns true where they are the same.
fn made_again(run: &StateRun, first: usize, scene: &Scene) -> Result<bool> {
    let of = |place: usize| {
        (
            &run.states[place].positions[..],
            &run.states[place].velocities[..],
        )
    };
    let (positions, velocities) = of(0);
    let state = Checkpoint::of(0, positions.to_vec(), velocities.to_vec());
    let mut simulator = simulator(scene, state, first)?;
    let mut path = scene.handle_path()?;
    let substeps = scene.physics.substeps as usize;
    for place in 1..run.states.len().min(CHECKED + 1) {
        let targets = path.next(&simulator, substeps)?;
        simulator.step(&targets)?;
        if of(place) != (simulator.positions_f64(), simulator.velocities_f64()) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The physics of `scene` on one thread, in this state in this frame.
pub(super) fn simulator(scene: &Scene, state: Checkpoint, frame: usize) -> Result<Simulator> {
    let mut simulator = simulator_of_run(scene, &Checkpoint { frame, ..state })?;
    simulator.set_threads(Threads::One);
    Ok(simulator)
}

/// The cloth of a scene where its mesh stands, to tell its mesh by.
pub(super) fn standing(scene: &Scene) -> Option<Cloth> {
    Cloth::of_scene(scene, rounded(scene.mesh.positions())).ok()
}
