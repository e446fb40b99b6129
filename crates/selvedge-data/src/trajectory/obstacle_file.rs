//! Obstacles in a trajectory file: the metadata `obstacles`, a JSON list of their names, and of
//! number k in it the tensors `obstacle_k.faces` u32 `[faces, 3]` and `obstacle_k.points` f32
//! `[1, points, 3]`, or `[frames, points, 3]` for one whose points move.
//!
//! A rigid one that moves also has `obstacle_k.poses` f32 `[frames, 7]`: its points are turned by
//! the quaternion x, y, z, w and then moved by x, y, z.

use glam::{Quat, Vec3};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, Metadata};

use super::file::TrajectoryFileError;
use super::obstacles::{ObstacleTrack, Pose, TrackMotion};
use crate::formats::tensor_file::{TensorOut, TensorValues};

/// The metadata entry with the names.
pub(super) const METADATA: &str = "obstacles";
/// Parts of an obstacle.
const PARTS: [&str; 3] = ["faces", "points", "poses"];

/// Obstacles as flat arrays.
pub(super) struct ObstacleTensors {
    names: Vec<String>,
    arrays: Vec<Arrays>,
}

struct Arrays {
    titles: [String; 3],
    faces: Vec<u32>,
    points: Vec<f32>,
    count: usize,
    poses: Vec<f32>,
}

impl ObstacleTensors {
    pub(super) fn of(obstacles: &[ObstacleTrack]) -> Self {
        let arrays = obstacles.iter().enumerate().map(|(number, obstacle)| {
            let flat = |points: &[Vec3]| -> Vec<f32> {
                points.iter().flat_map(|p| p.to_array()).collect()
            };
            let (points, poses) = match &obstacle.motion {
                TrackMotion::Still(points) => (flat(points), Vec::new()),
                TrackMotion::Rigid(points, poses) => {
                    let rows = poses.iter().flat_map(|pose| {
                        let [x, y, z, w] = pose.rotation.to_array();
                        let t = pose.translation;
                        [x, y, z, w, t.x, t.y, t.z]
                    });
                    (flat(points), rows.collect())
                }
                TrackMotion::Points(frames) => (flat(&frames.concat()), Vec::new()),
            };
            Arrays {
                titles: PARTS.map(|part| title(number, part)),
                faces: obstacle.faces.as_flattened().to_vec(),
                points,
                count: obstacle.points,
                poses,
            }
        });
        Self {
            names: obstacles.iter().map(|o| o.name.clone()).collect(),
            arrays: arrays.collect(),
        }
    }

    pub(super) fn tensors(&self) -> Vec<TensorOut<'_>> {
        let mut tensors = Vec::new();
        for arrays in &self.arrays {
            let [faces, points, poses] = &arrays.titles;
            tensors.push(TensorOut {
                name: faces,
                shape: vec![arrays.faces.len() / 3, 3],
                values: TensorValues::U32(&arrays.faces),
            });
            let frames = arrays.points.len() / (3 * arrays.count.max(1));
            tensors.push(TensorOut {
                name: points,
                shape: vec![frames, arrays.count, 3],
                values: TensorValues::F32(&arrays.points),
            });
            if !arrays.poses.is_empty() {
                tensors.push(TensorOut {
                    name: poses,
                    shape: vec![arrays.poses.len() / 7, 7],
                    values: TensorValues::F32(&arrays.poses),
                });
            }
        }
        tensors
    }

    pub(super) fn metadata(&self) -> Option<(&'static str, String)> {
        let names = serde_json::json!(self.names).to_string();
        (!self.names.is_empty()).then_some((METADATA, names))
    }
}

fn title(number: usize, part: &str) -> String {
    format!("obstacle_{number}.{part}")
}

/// The names of the obstacles of a file.
pub(super) fn names_in(header: &Metadata) -> Result<Vec<String>, TrajectoryFileError> {
    let entries = header.metadata().as_ref();
    let Some(text) = entries.and_then(|entries| entries.get(METADATA)) else {
        return Ok(Vec::new());
    };
    serde_json::from_str(text).map_err(|_| TrajectoryFileError::Metadata {
        name: METADATA.to_owned(),
        expected: "a JSON list of names",
        found: text.clone(),
    })
}

/// Returns true for the name of a tensor of one of `count` obstacles.
pub(super) fn is_tensor(name: &str, count: usize) -> bool {
    let parts = name
        .strip_prefix("obstacle_")
        .and_then(|rest| rest.split_once('.'));
    parts.is_some_and(|(number, part)| {
        let number = number.parse::<usize>().ok().filter(|n| *n < count);
        PARTS.contains(&part) && number.is_some_and(|number| title(number, part) == name)
    })
}

/// The obstacles of these names.
pub(super) fn read(
    file: &SafeTensors<'_>,
    names: &[String],
) -> Result<Vec<ObstacleTrack>, TrajectoryFileError> {
    let numbered = names.iter().enumerate();
    numbered.map(|(k, name)| read_one(file, k, name)).collect()
}

fn read_one(
    file: &SafeTensors<'_>,
    number: usize,
    name: &str,
) -> Result<ObstacleTrack, TrajectoryFileError> {
    let tensor = |part: &str, dtype: Dtype, rank: usize, last: usize| {
        let title = title(number, part);
        let expected = format!("{dtype} of {rank} dimensions, the last of {last}");
        let found = match file.tensor(&title) {
            Ok(tensor) => {
                let shape = tensor.shape().to_vec();
                if tensor.dtype() == dtype && shape.len() == rank && shape.last() == Some(&last) {
                    let (words, _) = tensor.data().as_chunks::<4>();
                    return Ok((words, shape));
                }
                format!("{} {shape:?}", tensor.dtype())
            }
            Err(_) => "none of this name".to_owned(),
        };
        Err(TrajectoryFileError::ObstacleTensor {
            name: title,
            expected,
            found,
        })
    };
    let (faces, _) = tensor("faces", Dtype::U32, 2, 3)?;
    let faces: Vec<u32> = faces.iter().copied().map(u32::from_le_bytes).collect();
    let (triples, _) = faces.as_chunks::<3>();
    let (points, shape) = tensor("points", Dtype::F32, 3, 3)?;
    let points: Vec<f32> = points.iter().copied().map(f32::from_le_bytes).collect();
    let all: Vec<Vec3> = points.chunks_exact(3).map(Vec3::from_slice).collect();
    let has_poses = file.tensor(&title(number, "poses")).is_ok();
    let (frames, count) = (shape[0], shape[1]);
    if count == 0 || frames == 0 || has_poses && frames != 1 {
        return Err(TrajectoryFileError::ObstacleTensor {
            name: title(number, "points"),
            expected: "points, in one frame where there are poses".to_owned(),
            found: format!("{frames} frames of {count}"),
        });
    }
    let motion = if has_poses {
        let (poses, _) = tensor("poses", Dtype::F32, 2, 7)?;
        let poses: Vec<f32> = poses.iter().copied().map(f32::from_le_bytes).collect();
        let pose = |row: &[f32]| Pose {
            rotation: Quat::from_slice(&row[..4]),
            translation: Vec3::from_slice(&row[4..]),
        };
        TrackMotion::Rigid(all, poses.chunks_exact(7).map(pose).collect())
    } else if frames == 1 {
        TrackMotion::Still(all)
    } else {
        TrackMotion::Points(all.chunks_exact(count).map(<[_]>::to_vec).collect())
    };
    Ok(ObstacleTrack {
        name: name.to_owned(),
        faces: triples.to_vec(),
        points: count,
        motion,
    })
}
