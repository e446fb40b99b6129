//! The training set: trajectories to learn from, in memory, with their graphs.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::{Environment, HandleSchedule, Material};
use selvedge_data::{Dataset, Problem, Sample, SceneSpec, Section, Split, Trajectory};
use selvedge_model::{ClothGraph, Domain, ModelSpec, Yaw};
use serde::de::DeserializeOwned;
use serde_json::Value;
use thiserror::Error;

/// One trajectory with its graph.
pub(crate) struct Motion {
    /// With all handles, in the first step's air.
    pub(crate) graph: Arc<ClothGraph>,
    /// When handles let go.
    schedule: HandleSchedule,
    /// True where handles, air or bodies change over the motion.
    varies: bool,
    /// The local frame of each frame, as a rollout from the first one has it: handles without a
    /// direction keep the one before.
    yaws: Vec<Yaw>,
    trajectory: Trajectory,
}

impl Motion {
    /// A trajectory with its graph, which those of one cloth share.
    fn new(
        motion: &str,
        graph: ClothGraph,
        trajectory: Trajectory,
        others: &[Self],
    ) -> Result<Self, TrainingSetError> {
        let schedule = schedule_of(motion, &trajectory)?;
        let yaws = yaws(&graph, &schedule, &trajectory);
        let gust = environment_of(motion, &trajectory)?.gust;
        let varies = gust.is_some() || !schedule.is_empty() || graph.has_moving_bodies();
        let mut others = others.iter();
        let same = others.find(|motion| *motion.graph == graph);
        let same = same.map(|motion| Arc::clone(&motion.graph));
        Ok(Self {
            graph: same.unwrap_or_else(|| Arc::new(graph)),
            varies,
            schedule,
            yaws,
            trajectory,
        })
    }

    /// The cloth in the step from `frame` to the next, with the handles that hold it then and the
    /// air of then; none where it is that of every step.
    pub(crate) fn graph_in(&self, frame: usize) -> Option<Arc<ClothGraph>> {
        self.varies.then(|| {
            let mut graph = ClothGraph::clone(&self.graph);
            let (rate, handles) = (graph.frame_rate(), graph.handles().len());
            let released = self.schedule.released(frame, rate, handles);
            graph.hold(|handle| !released[handle]);
            graph.set_step(frame);
            Arc::new(graph)
        })
    }

    /// World positions in `frame` [m]; before the first frame the cloth stood still.
    pub(crate) fn frame(&self, frame: i64) -> &[Vec3] {
        self.trajectory.frame(frame.max(0) as usize)
    }

    /// The local frame of the handles in `frame`.
    pub(crate) fn yaw(&self, frame: usize) -> Yaw {
        self.yaws[frame]
    }
}

/// The local frames of a trajectory, each with the one before to fall back to, which stays while a
/// handle has let go.
fn yaws(graph: &ClothGraph, schedule: &HandleSchedule, trajectory: &Trajectory) -> Vec<Yaw> {
    let mut yaw = graph.frame().rest_yaw();
    let frames = 0..trajectory.frame_count();
    frames
        .map(|frame| {
            let handles = graph.handles().select(trajectory.frame(frame));
            let released = schedule.released(frame, graph.frame_rate(), handles.len());
            if !released.contains(&true) {
                yaw = graph.frame().yaw(&handles, yaw);
            }
            yaw
        })
        .collect()
}

/// The trajectories that a training learns from.
pub(crate) struct TrainingSet {
    motions: Vec<Motion>,
    sections: Vec<Section>,
    /// Samples before each section, and in all.
    first_sample: Vec<usize>,
    /// Of all trajectories.
    domain: Domain,
    /// The name of the data set.
    pub(crate) name: String,
    /// By which a checkpoint knows it.
    pub(crate) fingerprint: String,
}

/// A data set that cannot be learned from.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum TrainingSetError {
    #[error(transparent)]
    Dataset(#[from] Problem),
    #[error("training trajectory {0}")]
    Trajectory(String),
    #[error(
        "the data set has no samples: it has nothing to train on, give one with training trajectories"
    )]
    NoSamples,
    #[error("the sections of the data set: {0}")]
    Sections(#[from] serde_json::Error),
    #[error(
        "training trajectory {0}: the model's features need its fabric: make the data set with `selvedge data generate`, of one material per cloth"
    )]
    NoFabric(String),
}

/// The graph of a trajectory's cloth in the environment and among the bodies of its scene (the default
/// environment and none where it has no scene). Its fabric is known where the scene has one, and no more.
pub fn graph_of(motion: &str, trajectory: &Trajectory) -> Result<ClothGraph, TrainingSetError> {
    let problem =
        |error: &dyn std::fmt::Display| TrainingSetError::Trajectory(format!("{motion}: {error}"));
    let environment = environment_of(motion, trajectory)?;
    let cloth = trajectory.cloth();
    let graph = ClothGraph::new(cloth, environment, trajectory.frame_rate());
    let graph = match &materials_of(trajectory)[..] {
        [material] => {
            let faces = cloth.topology().faces().len();
            graph.and_then(|graph| graph.with_materials(&vec![material; faces]))
        }
        _ => graph,
    };
    let graph = graph.map_err(|error| problem(&error))?;
    let scene = &trajectory.provenance().scene;
    if scene.pointer("/setting/contact").is_none() {
        return Ok(graph);
    }
    let scene = SceneSpec::from_json(scene).and_then(|scene| scene.build("".as_ref()));
    let scene = scene.map_err(|error| problem(&error))?;
    let contact = scene.contact.unwrap_or_default();
    Ok(graph.among(contact, &scene.obstacles))
}

/// The materials of a trajectory's scene, where they are known.
fn materials_of(trajectory: &Trajectory) -> Vec<Material> {
    let scene = &trajectory.provenance().scene;
    let own = scene.pointer("/setting/material").into_iter();
    let others = scene.pointer("/setting/fabrics").and_then(Value::as_object);
    let values = own.chain(others.into_iter().flat_map(|fabrics| fabrics.values()));
    values
        .filter_map(|value| serde_json::from_value(value.clone()).ok())
        .collect()
}

/// The domain of a trajectory: its handles frame by frame, its cloth and, where its scene is known,
/// environment and fabrics. Frames without a scene say nothing of these.
pub fn domain_of(motion: &str, trajectory: &Trajectory) -> Result<Domain, TrainingSetError> {
    let environment = environment_of(motion, trajectory)?;
    let materials = materials_of(trajectory);
    let (schedule, handles) = (schedule_of(motion, trajectory)?, trajectory.handles().len());
    let frames = (0..trajectory.frame_count()).map(|frame| {
        // What a frame's handles hold, they hold in the step that leads to it.
        let step = frame.saturating_sub(1);
        let released = schedule.released(step, trajectory.frame_rate(), handles);
        let held = released.iter().map(|released| !released).collect();
        (trajectory.frame(frame), held)
    });
    Ok(Domain::of_frames(
        trajectory.cloth(),
        &materials,
        &environment,
        trajectory.frame_rate(),
        frames,
    ))
}

fn environment_of(motion: &str, trajectory: &Trajectory) -> Result<Environment, TrainingSetError> {
    setting(motion, trajectory, "environment", "the environment")
}

/// When the handles of a trajectory let go; never where it has no scene.
fn schedule_of(motion: &str, trajectory: &Trajectory) -> Result<HandleSchedule, TrainingSetError> {
    setting(motion, trajectory, "schedule", "the releases")
}

/// What the setting of a trajectory's scene has under `key`, and the usual where it has none.
fn setting<T: DeserializeOwned + Default>(
    motion: &str,
    trajectory: &Trajectory,
    key: &str,
    what: &str,
) -> Result<T, TrainingSetError> {
    let value = trajectory.provenance().scene["setting"].get(key);
    let value = value.map(T::deserialize).transpose();
    let problem = |error| format!("{motion}: {what} of its scene: {error}");
    let value = value.map_err(|error| TrainingSetError::Trajectory(problem(error)));
    value.map(Option::unwrap_or_default)
}

/// The fingerprint of a data set: its name and the hashes of its training trajectories.
fn fingerprint(dataset: &Dataset) -> Result<String, serde_json::Error> {
    let index = dataset.index();
    let mut text = index.name.clone();
    for entry in &index.splits.train {
        text.push(' ');
        text.push_str(&entry.blake3);
    }
    text.push_str(&format!(" {}", serde_json::to_string(&index.sections)?));
    Ok(text)
}

impl TrainingSet {
    /// Reads the training split of `dataset`.
    pub(crate) fn load(dataset: &Dataset) -> Result<Self, TrainingSetError> {
        let mut motions: Vec<Motion> = Vec::new();
        let mut domain: Option<Domain> = None;
        for entry in dataset.entries(Split::Train) {
            let trajectory = dataset.read(entry)?;
            Domain::widen(&mut domain, domain_of(&entry.motion, &trajectory)?);
            let graph = graph_of(&entry.motion, &trajectory)?;
            let motion = Motion::new(&entry.motion, graph, trajectory, &motions)?;
            motions.push(motion);
        }
        let sections = dataset.sections().to_vec();
        let mut first_sample = vec![0];
        for section in &sections {
            let before = first_sample[first_sample.len() - 1];
            first_sample.push(before + section.samples().count());
        }
        let Some(mut domain) = domain.filter(|_| first_sample[first_sample.len() - 1] > 0) else {
            return Err(TrainingSetError::NoSamples);
        };
        domain.contact = motions.iter().any(|motion| motion.graph.has_contact());
        Ok(Self {
            motions,
            sections,
            first_sample,
            domain,
            name: dataset.index().name.clone(),
            fingerprint: fingerprint(dataset)?,
        })
    }

    /// Checks that the features of `spec` can be made.
    pub(crate) fn check_features(
        &self,
        spec: &ModelSpec,
        dataset: &Dataset,
    ) -> Result<(), TrainingSetError> {
        let entries = dataset.entries(Split::Train).iter().zip(&self.motions);
        let mut unknown = entries.filter(|(_, motion)| !motion.graph.knows_fabric());
        match unknown.next() {
            Some((entry, _)) if spec.needs_fabric() => {
                Err(TrainingSetError::NoFabric(entry.motion.clone()))
            }
            _ => Ok(()),
        }
    }

    /// The domain of what is learned from.
    pub(crate) fn domain(&self) -> &Domain {
        &self.domain
    }

    pub(crate) fn motions(&self) -> impl Iterator<Item = &Motion> {
        self.motions.iter()
    }

    pub(crate) fn motion(&self, trajectory: usize) -> &Motion {
        &self.motions[trajectory]
    }

    /// Number of samples in all sections.
    pub(crate) fn sample_count(&self) -> usize {
        self.first_sample[self.first_sample.len() - 1]
    }

    /// Sample `number` of all sections in order, and its section.
    pub(crate) fn sample(&self, number: usize) -> (Sample, &Section) {
        let index = self.first_sample.partition_point(|&first| first <= number) - 1;
        let section = &self.sections[index];
        let current = section.start + 1 + (number - self.first_sample[index]);
        let trajectory = section.trajectory;
        (
            Sample {
                trajectory,
                current,
            },
            section,
        )
    }

    /// True if `section` is one of the data set's.
    pub(crate) fn has(&self, section: &Section) -> bool {
        self.sections.contains(section)
    }

    /// True if `current` is the current frame of a sample of `section`.
    pub(crate) fn section_has(section: &Section, current: usize) -> bool {
        current > section.start && current + 1 < section.end
    }
}

#[cfg(test)]
mod tests;
