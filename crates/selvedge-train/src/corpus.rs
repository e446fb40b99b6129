//! The trajectories that are learned from, in memory, as the network needs them.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::Environment;
use selvedge_data::{Cloth, Dataset, DatasetError, Sample, Section, Split, Trajectory};
use selvedge_model::{ClothGraph, ClothParts, Connectivity, GraphError};
use thiserror::Error;

/// One trajectory with its graph.
pub(crate) struct Motion {
    pub(crate) graph: Arc<ClothGraph>,
    pub(crate) connectivity: Arc<Connectivity>,
    trajectory: Trajectory,
}

impl Motion {
    /// World positions in `frame` [m]; before the first frame the cloth stood still.
    pub(crate) fn frame(&self, frame: i64) -> &[Vec3] {
        self.trajectory.frame(frame.max(0) as usize)
    }
}

/// All that a training learns from.
pub(crate) struct Corpus {
    motions: Vec<Motion>,
    sections: Vec<Section>,
    /// Samples before each section, and in all.
    first_sample: Vec<usize>,
}

/// A data set that cannot be learned from.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum CorpusError {
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    #[error("training trajectory {motion}: {source}")]
    Graph { motion: String, source: GraphError },
    #[error("training trajectory {motion}: the environment of its scene: {source}")]
    Environment {
        motion: String,
        source: serde_json::Error,
    },
    #[error(
        "the data set has no samples: it has nothing to train on, give one with training trajectories"
    )]
    NoSamples,
}

/// The graph of `cloth` in `environment`, moving by `frame_rate` frames per second.
///
/// # Errors
/// When the parts do not fit.
pub fn cloth_graph(
    cloth: &Cloth,
    environment: Environment,
    frame_rate: f64,
) -> Result<ClothGraph, GraphError> {
    ClothGraph::new(ClothParts {
        topology: cloth.topology.clone(),
        handles: cloth.handles.clone(),
        vertex_mass: cloth.vertex_mass.clone(),
        face_area: cloth.face_area.clone(),
        material_coordinates: cloth.material_coordinates.clone(),
        rest_positions: cloth.rest_positions.clone(),
        environment,
        frame_rate,
    })
}

/// The graph of a trajectory's cloth in the environment of its scene (the default one where it
/// has no scene).
///
/// # Errors
/// [`CorpusError`] when the scene's environment cannot be read, or the parts do not fit.
pub fn graph_of(motion: &str, trajectory: &Trajectory) -> Result<ClothGraph, CorpusError> {
    let scene = &trajectory.provenance().scene;
    let environment = match scene.pointer("/setting/environment") {
        Some(value) => serde_json::from_value(value.clone()).map_err(|source| {
            let motion = motion.to_owned();
            CorpusError::Environment { motion, source }
        })?,
        None => Environment::default(),
    };
    cloth_graph(trajectory.cloth(), environment, trajectory.frame_rate()).map_err(|source| {
        let motion = motion.to_owned();
        CorpusError::Graph { motion, source }
    })
}

impl Corpus {
    /// Reads the training split of `dataset`.
    pub(crate) fn load(dataset: &Dataset) -> Result<Self, CorpusError> {
        let mut motions: Vec<Motion> = Vec::new();
        for entry in dataset.entries(Split::Train) {
            let trajectory = dataset.read(entry)?;
            let graph = Arc::new(graph_of(&entry.motion, &trajectory)?);
            // Trajectories of one cloth share its graph.
            let same = motions.iter().find(|motion| motion.graph == graph);
            motions.push(Motion {
                connectivity: match same {
                    Some(motion) => Arc::clone(&motion.connectivity),
                    None => Arc::new(Connectivity::of(graph.topology())),
                },
                graph: same.map_or(graph, |motion| Arc::clone(&motion.graph)),
                trajectory,
            });
        }
        let sections = dataset.sections().to_vec();
        let mut first_sample = vec![0];
        for section in &sections {
            let before = first_sample[first_sample.len() - 1];
            first_sample.push(before + section.samples().count());
        }
        if first_sample[first_sample.len() - 1] == 0 {
            return Err(CorpusError::NoSamples);
        }
        Ok(Self {
            motions,
            sections,
            first_sample,
        })
    }

    /// The graphs of all trajectories.
    pub(crate) fn graphs(&self) -> impl Iterator<Item = &ClothGraph> {
        self.motions.iter().map(|motion| &*motion.graph)
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

    /// Whether `section` is one of the data set's.
    pub(crate) fn has(&self, section: &Section) -> bool {
        self.sections.contains(section)
    }

    /// Whether `current` is the current frame of a sample of `section`.
    pub(crate) fn section_has(section: &Section, current: usize) -> bool {
        current > section.start && current + 1 < section.end
    }
}

#[cfg(test)]
mod tests;
