//! Obstacles of an ARCSim scene, and its settings of contact.
//!
//! Contact is Selvedge's own, not ARCSim's: of the latter's numbers it takes the thickness of
//! repulsion and the coefficients of friction, which a pair has the lesser of, and there is no
//! stiffness to be set.

use std::ops::RangeInclusive;
use std::path::Path;

use selvedge_cloth::{ContactSettings, PoseKeyframe};

use super::super::problem::SceneProblem;
use super::cloth::read_rotation;
use super::drive::read_motions;
use super::object::Object;
use super::parts::Parts;
use super::shared::{Times, find_file};
use crate::obstacle::{BodySpec, ObstacleMotion, ObstacleSpec, Placement};
use crate::scene::SceneSpecError;

/// ARCSim's own values where a scene is silent: friction of cloth on cloth and on obstacles, and
/// thickness `[m]`.
const FRICTION: f64 = 0.6;
const OBSTACLE_FRICTION: f64 = 0.3;
const THICKNESS: f64 = 1e-3;
const FRICTIONS: RangeInclusive<f64> = 0.0..=100.0;
const THICKNESSES: RangeInclusive<f64> = 1e-5..=1.0;

/// Contact of a scene, and the obstacles that take part in it.
#[derive(Default)]
pub(super) struct SceneContact {
    pub(super) settings: Option<ContactSettings>,
    pub(super) obstacles: Vec<ObstacleSpec>,
}

/// Reads `obstacles`, `friction`, `obs_friction` and, of `magic`, the thickness.
pub(super) fn read(
    scene: &mut Object<'_>,
    folder: &Path,
    parts: &Parts,
    times: &Times,
    warnings: &mut Vec<String>,
) -> Result<SceneContact, SceneProblem> {
    let friction = scene.number_within("friction", &FRICTIONS)?;
    let obstacle_friction = scene.number_within("obs_friction", &FRICTIONS)?;
    let thickness = match scene.child("magic")? {
        Some(mut magic) => magic.number_within("repulsion_thickness", &THICKNESSES)?,
        None => None,
    };
    let [proximity, collision] = ["proximity", "collision"].map(|part| parts.disables(part));
    let obstacles = scene.objects("obstacles")?;
    if proximity && collision {
        if !obstacles.is_empty() {
            warnings.push(format!(
                "obstacles are left out, {} of them: proximity and collision are disabled, so that nothing touches them",
                obstacles.len()
            ));
        }
        return Ok(SceneContact::default());
    }
    if proximity || collision {
        let disabled = if proximity { "proximity" } else { "collision" };
        warnings.push(format!(
            "disable: {disabled} has no effect: Selvedge's contact has no such parts, disable proximity and collision to have none"
        ));
    }
    let friction = friction.unwrap_or(FRICTION);
    let obstacle_friction = obstacle_friction.unwrap_or(OBSTACLE_FRICTION);
    if obstacle_friction > friction && !obstacles.is_empty() {
        warnings.push(format!(
            "obs_friction is {obstacle_friction}, but a pair has the lesser of two, which is the cloth's {friction}"
        ));
    }
    // What they have that is not supported was said with the handles.
    let motions = read_motions(scene, &mut Vec::new())?;
    let around = Around {
        folder,
        motions: &motions,
        times,
    };
    let mut specs = Vec::with_capacity(obstacles.len());
    for (number, obstacle) in obstacles.into_iter().enumerate() {
        let mut spec = read_obstacle(obstacle, number, &around, warnings)?;
        spec.friction = Some(obstacle_friction);
        specs.push(spec);
    }
    Ok(SceneContact {
        settings: Some(ContactSettings {
            thickness: thickness.unwrap_or(THICKNESS),
            friction,
            ..ContactSettings::default()
        }),
        obstacles: specs,
    })
}

/// The surroundings of an obstacle: its folder, and the motions that it may follow.
struct Around<'a> {
    folder: &'a Path,
    motions: &'a [Vec<PoseKeyframe>],
    times: &'a Times,
}

/// Reads an obstacle: its mesh, where it stands, and the motion that it follows.
fn read_obstacle(
    mut obstacle: Object<'_>,
    number: usize,
    around: &Around<'_>,
    warnings: &mut Vec<String>,
) -> Result<ObstacleSpec, SceneProblem> {
    let path = obstacle.text("mesh")?;
    let path = path.ok_or_else(|| obstacle.missing("mesh"))?;
    let Some(found) = find_file(path, around.folder) else {
        let must = "must be an OBJ file beside the scene or in the working directory";
        return Err(obstacle.wrong("mesh", must, &path));
    };
    let name = format!("obstacle {number}");
    let body = BodySpec::mesh(found, around.folder, &name).map_err(SceneSpecError::from)?;
    let mut transform = Placement::default();
    if let Some(mut placed) = obstacle.child("transform")? {
        transform = Placement {
            scale: placed.number("scale")?.unwrap_or(1.0),
            rotation: read_rotation(&mut placed)?,
            translation: placed.vector("translate")?.unwrap_or_default(),
        };
        placed.finish(warnings);
    }
    let motion = match obstacle.whole("motion")? {
        None => ObstacleMotion::Still,
        Some(motion) => {
            let motions = around.motions;
            let keyframes = motions.get(motion as usize).ok_or_else(|| {
                let must = format!("must be one of the {} motions, from 0", motions.len());
                obstacle.wrong("motion", &must, &motion)
            })?;
            ObstacleMotion::Splines(keyframes.clone())
        }
    };
    let starts = obstacle.number("start_time")?.unwrap_or(0.0);
    let ends = obstacle.number("end_time")?.unwrap_or(f64::INFINITY);
    if starts > 0.0 || ends < around.times.duration {
        warnings.push(format!(
            "{} and end_time are not supported: the obstacle is there all the time",
            obstacle.place("start_time")
        ));
    }
    obstacle.finish(warnings);
    Ok(ObstacleSpec {
        name,
        body,
        transform,
        motion,
        friction: None,
        thickness: None,
    })
}
