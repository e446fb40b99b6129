//! The handles of an ARCSim scene and the motions that they follow.

use selvedge_cloth::{HandleSchedule, PoseKeyframe, Release, SplineGroup, SplineMotion};
use serde_json::Value;

use super::super::problem::SceneProblem;
use super::cloth::read_rotation;
use super::object::Object;
use super::shared::Times;

/// Handles of a scene and their motion.
pub(super) struct SceneHandles {
    /// The held vertices.
    pub(super) vertices: Vec<u32>,
    /// When they are let go.
    pub(super) schedule: HandleSchedule,
    /// Motion of the handles: a group for each handle of the file that has a motion.
    pub(super) motion: SplineMotion,
}

/// Reads `handles` and `motions`.
///
/// ARCSim takes hold of a node in its first solve, where the node then is; so the motion is
/// relative to its transform at the end of that solve.
pub(super) fn read(
    scene: &mut Object<'_>,
    times: &Times,
    warnings: &mut Vec<String>,
) -> Result<SceneHandles, SceneProblem> {
    let motions = read_motions(scene, warnings)?;
    let mut vertices = Vec::new();
    let mut groups = Vec::new();
    let mut schedule = HandleSchedule::default();
    for mut handle in scene.objects("handles")? {
        let nodes = read_nodes(&mut handle)?;
        let first = vertices.len();
        vertices.extend(&nodes);
        if let Some(motion) = handle.whole("motion")? {
            let keyframes = motions.get(motion as usize).ok_or_else(|| {
                let must = format!("must be one of the {} motions, from 0", motions.len());
                handle.wrong("motion", &must, &motion)
            })?;
            groups.push(SplineGroup {
                handles: (first..vertices.len()).collect(),
                keyframes: keyframes.clone(),
            });
        }
        let releases = read_releases(&mut handle, times, warnings)?;
        schedule
            .releases
            .extend(releases.into_iter().map(|(from, to)| Release {
                handles: (first..vertices.len()).collect(),
                from,
                to,
            }));
        handle.finish(warnings);
    }
    let motion = SplineMotion {
        duration: times.duration,
        taken: times.frame_time / f64::from(times.substeps),
        groups,
    };
    Ok(SceneHandles {
        vertices,
        schedule,
        motion,
    })
}

fn read_nodes(handle: &mut Object<'_>) -> Result<Vec<u32>, SceneProblem> {
    if let Some(kind) = handle.text("type")?.filter(|kind| *kind != "node") {
        let must = "must be \"node\", the only kind that is supported";
        return Err(handle.wrong("type", must, &format!("{kind:?}")));
    }
    if handle.whole("cloth")?.is_some_and(|cloth| cloth != 0) {
        return Err(handle.wrong("cloth", "must be 0, the only cloth", &"another"));
    }
    let nodes = handle.list("nodes")?;
    if nodes.is_empty() {
        return Err(handle.missing("nodes"));
    }
    nodes
        .iter()
        .map(|node| {
            let number = node.as_u64().and_then(|n| u32::try_from(n).ok());
            number.ok_or_else(|| handle.wrong("nodes", "must be numbers of vertices from 0", node))
        })
        .collect()
}

/// The times over which a handle does not hold `[s]`.
fn read_releases(
    handle: &mut Object<'_>,
    times: &Times,
    warnings: &mut Vec<String>,
) -> Result<Vec<(f64, Option<f64>)>, SceneProblem> {
    let start = handle.number("start_time")?.unwrap_or(0.0);
    let end = handle.number("end_time")?.unwrap_or(f64::INFINITY);
    if end <= start.max(0.0) {
        let must = "must be later than the start, or the handle never holds";
        return Err(handle.wrong("end_time", must, &end));
    }
    let fade = handle.number("fade_time")?.unwrap_or(0.0);
    let mut releases = Vec::new();
    if start > 0.0 {
        releases.push((0.0, Some(start)));
    }
    if end < times.duration {
        releases.push((end, None));
        if fade > 0.0 {
            let place = handle.place("fade_time");
            warnings.push(format!(
                "{place} is not supported: the handle lets go at once"
            ));
        }
    }
    Ok(releases)
}

pub(super) fn read_motions<'a>(
    scene: &mut Object<'a>,
    warnings: &mut Vec<String>,
) -> Result<Vec<Vec<PoseKeyframe>>, SceneProblem> {
    let mut motions = Vec::new();
    for (number, motion) in scene.list("motions")?.iter().enumerate() {
        let place = format!("motions[{number}]");
        let Value::Array(keyframes) = motion else {
            return Err(scene.wrong(&place, "must be a list of keyframes", motion));
        };
        let mut read = Vec::with_capacity(keyframes.len());
        for (k, keyframe) in keyframes.iter().enumerate() {
            let keyframe = Object::new(keyframe, format!("{place}[{k}]"))?;
            read.push(read_keyframe(keyframe, warnings)?);
        }
        motions.push(read);
    }
    Ok(motions)
}

fn read_keyframe(
    mut keyframe: Object<'_>,
    warnings: &mut Vec<String>,
) -> Result<PoseKeyframe, SceneProblem> {
    let time = keyframe.needed_number("time")?;
    let mut pose = PoseKeyframe {
        time,
        ..PoseKeyframe::default()
    };
    if let Some(mut transform) = keyframe.child("transform")? {
        let rotation = read_rotation(&mut transform)?;
        pose = PoseKeyframe {
            scale: transform.number("scale")?.unwrap_or(1.0),
            axis: rotation.axis,
            angle_deg: rotation.angle_deg,
            translation: transform.vector("translate")?.unwrap_or_default(),
            ..pose
        };
        transform.finish(warnings);
    }
    keyframe.finish(warnings);
    Ok(pose)
}
