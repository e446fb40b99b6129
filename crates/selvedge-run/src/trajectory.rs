//! Trajectories of runs, with their origin.

use glam::{DVec3, Vec3};
use selvedge_cloth::{Cloth, Scene};
use selvedge_data::{ObstacleTrack, Problem, Provenance, SceneSpec, Trajectory};

use crate::{Error, MADE_BY, rounded};

/// Returns the origin of a run of `spec`, or of a scene that has none.
///
/// # Errors
/// As for [`SceneSpec::to_json`].
pub fn provenance<'a>(
    spec: impl Into<Option<&'a SceneSpec>>,
    scene: &Scene,
) -> Result<Provenance, Problem> {
    let spec = spec.into();
    let json = spec.map(SceneSpec::to_json).transpose()?;
    Ok(Provenance {
        frame_rate: scene.frame_rate,
        scene: json.unwrap_or_default(),
        made_by: MADE_BY.to_owned(),
    })
}

/// Makes the trajectory of a run of `spec` that begins with frame `first` of its motion, and whose
/// cloth rests at `rest` `[m]`, `[vertices]`. Obstacles stand where they are then.
///
/// # Errors
/// [`Error::Trajectory`] for positions that are no frames of this cloth.
pub fn trajectory<'a>(
    first: usize,
    spec: impl Into<Option<&'a SceneSpec>>,
    scene: &Scene,
    rest: &[DVec3],
    positions: Vec<Vec3>,
) -> Result<Trajectory, Error> {
    let failed = |source: Box<dyn std::error::Error + Send + Sync>| Error::Trajectory {
        scene: scene.name.clone(),
        source,
    };
    let cloth = Cloth::of_scene(scene, rounded(rest)).map_err(|error| failed(error.into()))?;
    let frames = positions.len() / cloth.vertex_count().max(1);
    let track = |obstacle| ObstacleTrack::of(obstacle, scene.frame_rate, first, frames);
    let obstacles = scene.obstacles.iter().map(track).collect();
    let origin = provenance(spec, scene).map_err(|error| failed(error.into()))?;
    Trajectory::new(cloth, positions, origin)
        .and_then(|trajectory| trajectory.with_obstacles(obstacles))
        .map_err(|error| failed(error.into()))
}
