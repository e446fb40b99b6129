//! How well a model predicts one recorded trajectory, and how well its naive rivals do.
//!
//! Everyone starts from the trajectory's first frame or from a rest pose of its own, and runs to its
//! end with the handles where they were recorded. The rivals: the rest pose moved rigidly with the
//! handles, and the physics itself from the other branch of the buckling: what somebody would
//! predict who knew the physics but not to which side this cloth had buckled.

use anyhow::{Context, anyhow};
use glam::{DVec3, Vec3};
use selvedge_cloth::{HandlePath, Motion, RecordedMotion, Scene};
use selvedge_data::{Frames, SceneSpec, Setting, Trajectory, metrics};
use selvedge_sim::Threads;
use serde::Serialize;

use crate::learned::{self, NamedModel};
use crate::output::End;
use crate::reference::{self, Run};
use crate::rigid::RigidRest;

/// Who makes a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Who {
    /// The model.
    Model,
    /// The rest pose moved rigidly with the handles.
    Rigid,
    /// The physics from the other branch of the buckling.
    Mirror,
    /// The recorded trajectory itself.
    Truth,
}

impl Who {
    /// In the order of a table.
    pub(crate) const ALL: [Self; 4] = [Self::Model, Self::Rigid, Self::Mirror, Self::Truth];

    /// As people call it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Rigid => "rigid",
            Self::Mirror => "mirror",
            Self::Truth => "truth",
        }
    }
}

/// What is measured of a run.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measures {
    /// √(mean over frames and vertices of the squared distance to the truth) `[m]`.
    pub(crate) position_rmse: f64,
    /// √(mean over frames and edges of the squared difference of lengths) `[m]`.
    pub(crate) edge_length_rmse: f64,
    /// The largest (l - l₀)/l₀ against the material.
    pub(crate) largest_strain: f64,
    /// Mean speed of the vertices in the last second `[m/s]`.
    pub(crate) final_speed: f64,
    /// Wall time `[ms]`; none for what was recorded.
    pub(crate) ms_per_frame: Option<f64>,
    /// Position RMSE of each frame `[m]`, `[frames]`.
    #[serde(skip)]
    pub(crate) per_frame: Vec<f64>,
}

/// The path of the handles as it was recorded.
///
/// # Errors
/// When it cannot drive the handles.
pub(crate) fn recorded_path(truth: &Trajectory) -> anyhow::Result<HandlePath> {
    let held = |frame: &[Vec3]| -> Vec<DVec3> {
        let positions = truth.handles().select(frame);
        positions.iter().map(|p| p.as_dvec3()).collect()
    };
    let positions: Vec<Vec<DVec3>> = truth.frames().iter().map(held).collect();
    let start = held(truth.frame(0));
    Motion::Recorded(RecordedMotion { positions })
        .bind(&start, truth.frame_rate())
        .context("the recorded path of the handles")
}

/// The measures of `run` against `truth`.
///
/// # Errors
/// When the run is of another mesh.
pub(crate) fn measure(truth: &Trajectory, run: &Run) -> anyhow::Result<Measures> {
    let frames = Frames::new(&run.positions, truth.vertex_count())?;
    of_frames(truth, frames, Some(run.ms_per_frame))
}

/// The measures of the truth itself.
///
/// # Errors
/// When there is nothing to measure.
pub(crate) fn measure_truth(truth: &Trajectory) -> anyhow::Result<Measures> {
    of_frames(truth, truth.frames(), None)
}

fn of_frames(
    truth: &Trajectory,
    frames: Frames<'_>,
    ms_per_frame: Option<f64>,
) -> anyhow::Result<Measures> {
    let topology = truth.topology();
    let compared = metrics::compare(truth.frames(), frames, topology)?;
    let lengths = metrics::material_edge_lengths(topology, &truth.cloth().material_coordinates);
    let strains = metrics::largest_strain(frames, topology, &lengths)?;
    Ok(Measures {
        position_rmse: compared.position_rmse,
        edge_length_rmse: compared.edge_length_rmse,
        largest_strain: strains.into_iter().fold(f64::NEG_INFINITY, f64::max),
        final_speed: metrics::final_speed(frames, truth.frame_rate())?,
        ms_per_frame,
        per_frame: compared.per_frame_rmse,
    })
}

/// Runs the model along `truth`.
///
/// # Errors
/// A step that fails, as where the prediction has left all bounds.
pub(crate) fn run_model(
    model: &NamedModel,
    motion: &str,
    truth: &Trajectory,
    on_frame: &mut dyn FnMut() -> std::ops::ControlFlow<()>,
) -> anyhow::Result<Run> {
    let graph = selvedge_train::graph_of(motion, truth)?;
    let path = recorded_path(truth)?;
    let frames = truth.frame_count() - 1;
    learned::run(model, graph, truth.frame(0), &path, frames, on_frame)
}

/// Moves the rest pose rigidly along `truth`.
///
/// # Errors
/// When the recorded handles cannot be followed.
pub(crate) fn run_rigid(truth: &Trajectory) -> anyhow::Result<Run> {
    let mut stepper = RigidRest::new(truth.cloth());
    let path = recorded_path(truth)?;
    let go_on = &mut || std::ops::ControlFlow::Continue(());
    learned::drive(&mut stepper, &path, truth.frame_count() - 1, go_on)
}

/// Scenes that buckle to the other side, with their rest poses: one per setting.
#[derive(Default)]
pub(crate) struct Mirrors {
    rests: Vec<(Setting, Vec<DVec3>)>,
}

/// A scene that buckles to the other side, and its rest pose `[m]`, `[vertices]`.
pub(crate) struct Mirror {
    scene: Scene,
    rest: Vec<DVec3>,
}

impl Mirrors {
    /// The scene of `truth` on the other branch of the buckling: with the sign of its bulge
    /// turned, and sagged anew. Mesh files are looked for from the current folder.
    ///
    /// # Errors
    /// When the trajectory has no scene, or the scene cannot be made or does not come to rest.
    pub(crate) fn of(&mut self, truth: &Trajectory) -> anyhow::Result<Mirror> {
        let json = &truth.provenance().scene;
        if json.is_null() {
            return Err(anyhow!("the trajectory has no scene"));
        }
        let mut spec = SceneSpec::from_json(json)?;
        spec.setting.sag.bulge = -spec.setting.sag.bulge;
        let scene = spec.build("".as_ref())?;
        if scene.mesh.topology() != truth.topology() {
            return Err(anyhow!("the scene's mesh is not that of the trajectory"));
        }
        let known = self.rests.iter().find(|rest| rest.0 == spec.setting);
        let rest = match known {
            Some((_, rest)) => rest.clone(),
            None => {
                let rest = reference::rest_pose(&scene)?.positions;
                self.rests.push((spec.setting, rest.clone()));
                rest
            }
        };
        Ok(Mirror { scene, rest })
    }
}

impl Mirror {
    /// Simulates the mirror for as many frames as `truth` has. None where an end was asked for.
    ///
    /// # Errors
    /// A solve that fails.
    pub(crate) fn run(
        self,
        truth: &Trajectory,
        on_frame: &mut dyn FnMut() -> std::ops::ControlFlow<()>,
    ) -> anyhow::Result<Option<Run>> {
        let frames = truth.frame_count() - 1;
        let run = reference::run(&self.scene, self.rest, frames, Threads::One, on_frame)?;
        Ok((run.end == End::Complete).then_some(run))
    }
}
