//! Obstacles in a trajectory file: the metadata `obstacles`, a JSON list of their names, and tensors
//! of each by its number in it (docs/src/reference/files.md).

use std::collections::HashMap;

use glam::{Quat, Vec3};

use super::file::{flat3, wrong};
use super::obstacles::{ObstacleTrack, Pose, TrackMotion};
use crate::formats::arrays::ArrayFile;
use crate::formats::file_error::Problem;
use crate::formats::tensor_file::{TensorOut, TensorValues};

/// The metadata entry with the names.
pub(super) const METADATA: &str = "obstacles";
/// Parts of an obstacle.
const PARTS: [&str; 3] = ["faces", "points", "poses"];

pub(super) fn tensors(obstacles: &[ObstacleTrack]) -> Vec<TensorOut<'_>> {
    let mut tensors = Vec::new();
    for (number, obstacle) in obstacles.iter().enumerate() {
        let mut add = |part: &str, shape: &[usize], values| {
            tensors.push(TensorOut::new(title(number, part), shape, values));
        };
        let faces = TensorValues::U32(obstacle.faces.as_flattened().into());
        add("faces", &[obstacle.faces.len(), 3], faces);
        let count = obstacle.point_count();
        match &obstacle.motion {
            TrackMotion::Points(frames) => {
                add("points", &[frames.len(), count, 3], flat3(&frames.concat()));
            }
            TrackMotion::Rigid(points, poses) => {
                add("points", &[1, count, 3], flat3(points));
                let row = |pose: &Pose| {
                    let [x, y, z, w] = pose.rotation.to_array();
                    let t = pose.translation;
                    [x, y, z, w, t.x, t.y, t.z]
                };
                let rows = poses.iter().flat_map(row).collect();
                add("poses", &[poses.len(), 7], TensorValues::F32(rows));
            }
        }
    }
    tensors
}

/// The entry with the names of `obstacles`; none where there are none.
pub(super) fn metadata(obstacles: &[ObstacleTrack]) -> Option<(&'static str, String)> {
    let names: Vec<&str> = obstacles.iter().map(|o| o.name.as_str()).collect();
    (!names.is_empty()).then(|| (METADATA, serde_json::json!(names).to_string()))
}

fn title(number: usize, part: &str) -> String {
    format!("obstacle_{number}.{part}")
}

/// The names of the obstacles of a file.
pub(super) fn names_in(metadata: &HashMap<String, String>) -> Result<Vec<String>, Problem> {
    let Some(text) = metadata.get(METADATA) else {
        return Ok(Vec::new());
    };
    serde_json::from_str(text).map_err(|_| wrong(METADATA, "a JSON list of names", text))
}

/// Returns true for the name of a tensor of one of `count` obstacles.
pub(super) fn is_tensor(name: &str, count: usize) -> bool {
    let parts = name.strip_prefix("obstacle_");
    let parts = parts.and_then(|rest| rest.split_once('.'));
    parts.is_some_and(|(number, part)| {
        let number = number.parse::<usize>().ok().filter(|n| *n < count);
        PARTS.contains(&part) && number.is_some_and(|number| title(number, part) == name)
    })
}

pub(super) fn read(file: &ArrayFile<'_>, names: &[String]) -> Result<Vec<ObstacleTrack>, Problem> {
    let numbered = names.iter().enumerate();
    numbered.map(|(k, name)| read_one(file, k, name)).collect()
}

fn read_one(file: &ArrayFile<'_>, number: usize, name: &str) -> Result<ObstacleTrack, Problem> {
    let title = |part| title(number, part);
    let faces = file.wholes(&title("faces"))?.of_shape(&[None, Some(3)])?;
    let points = file.singles(&title("points"))?;
    let points = points.of_shape(&[None, None, Some(3)])?;
    let all = points.values.chunks_exact(3).map(Vec3::from_slice);
    let all: Vec<Vec3> = all.collect();
    let has_poses = file.has(&title("poses"));
    let (frames, count) = (points.shape[0], points.shape[1]);
    if count == 0 || frames == 0 || has_poses && frames != 1 {
        return Err(points.wrong("points, in one frame where there are poses"));
    }
    let motion = if has_poses {
        let poses = file.singles(&title("poses"))?.of_shape(&[None, Some(7)])?;
        let pose = |row: &[f32]| Pose {
            rotation: Quat::from_slice(&row[..4]),
            translation: Vec3::from_slice(&row[4..]),
        };
        TrackMotion::Rigid(all, poses.values.chunks_exact(7).map(pose).collect())
    } else {
        TrackMotion::Points(all.chunks_exact(count).map(<[_]>::to_vec).collect())
    };
    Ok(ObstacleTrack {
        name: name.to_owned(),
        faces: faces.values.as_chunks::<3>().0.to_vec(),
        motion,
    })
}
