//! Bodies in the files of rigs (USD, .glb): all meshes together as they move, baked frame
//! by frame into our world.

use glam::DVec3;

use super::error::RigError;
use super::mesh_motion::MeshMotion;
use super::moving_mesh::MovingMesh;
use super::node::Rig;
use super::{RigFormat, glb, usda};

/// Frames at most that something may move.
const MOST_FRAMES: usize = 100_000;

/// A key that is so near to a frame is taken to be at it [frames]: glTF has times in single
/// precision.
const SLACK: f64 = 1e-2;

/// The meshes of a file as one body.
#[derive(Debug)]
pub(crate) struct MovingBody {
    rig: Rig,
    meshes: Vec<MovingMesh>,
}

/// Reads all meshes in the bytes of a file, with one of its animations; with none, as they stand,
/// where `is_still`.
pub(crate) fn read_body(
    bytes: &[u8],
    format: RigFormat,
    animation: Option<&str>,
    is_still: bool,
) -> Result<MovingBody, RigError> {
    let (rig, meshes) = match (format, animation) {
        (RigFormat::Glb, _) => glb::parse_bodies(bytes, animation, is_still)?,
        (RigFormat::Usd, None) => usda::parse_bodies(bytes)?,
        (RigFormat::Usd, Some(name)) => {
            let known = "only a .glb has animations with names";
            return Err(RigError::no_animation(name, known));
        }
    };
    if meshes.is_empty() {
        return Err(RigError::NoMesh(rig.warnings));
    }
    for node in meshes.iter().flat_map(MovingMesh::nodes) {
        rig.check_chain(node)?;
    }
    Ok(MovingBody { rig, meshes })
}

impl MovingBody {
    /// Faces by their points, with the points of all meshes in order.
    pub(crate) fn faces(&self) -> Result<Vec<Vec<u32>>, RigError> {
        let mut faces = Vec::new();
        let mut first = 0;
        for moving in &self.meshes {
            let mesh = &moving.mesh;
            let count = mesh.positions.len() as u32;
            for (number, face) in mesh.faces.iter().enumerate() {
                if let Some(beyond) = face.iter().find(|&&point| point >= count) {
                    let name = &self.rig.nodes[mesh.node].name;
                    let problem =
                        format!("face {number} of its mesh names point {beyond} of {count}");
                    return Err(RigError::node(name, problem));
                }
                faces.push(face.iter().map(|point| first + point).collect());
            }
            first += count;
        }
        Ok(faces)
    }

    /// Warnings of what of the file is not read.
    pub(crate) fn warnings(&self) -> &[String] {
        &self.rig.warnings
    }

    /// Times of the first and the last key that move it `[s]`; none if nothing does.
    pub(crate) fn span(&self) -> Option<[f64; 2]> {
        let spans = self.meshes.iter().filter_map(|mesh| mesh.span(&self.rig));
        spans.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// The times `[s]` at which the points of the mesh that has `point` are known, and not only
    /// between others; none if nothing moves it.
    pub(crate) fn keys_at(&self, point: usize) -> Vec<f64> {
        let mut first = 0;
        let has_point = |mesh: &&MovingMesh| {
            first += mesh.mesh.positions.len();
            point < first
        };
        let mesh = self.meshes.iter().find(has_point);
        mesh.map_or_else(Vec::new, |mesh| mesh.keys(&self.rig))
    }

    /// Name, size and times of each mesh.
    pub(super) fn motions(&self) -> Vec<MeshMotion> {
        let of = |moving: &MovingMesh| MeshMotion {
            name: self.rig.nodes[moving.mesh.node].name.clone(),
            points: moving.mesh.positions.len(),
            faces: moving.mesh.faces.len(),
            times: moving.keys(&self.rig),
        };
        self.meshes.iter().map(of).collect()
    }

    /// Positions of all points at `time` `[s]`, in metres.
    pub(crate) fn positions(&self, time: f64) -> Vec<DVec3> {
        let meshes = self.meshes.iter();
        meshes
            .flat_map(|mesh| mesh.positions(&self.rig, time))
            .collect()
    }

    /// Positions in every frame from `from` `[s]` after the start of the file to the last key,
    /// `frame_rate` a second.
    pub(crate) fn frames(&self, frame_rate: f64, from: f64) -> Result<Vec<Vec<DVec3>>, RigError> {
        let last = self.span().map_or(self.rig.start, |span| span[1]);
        let start = self.rig.start + from;
        let steps = steps((last - start).max(0.0), frame_rate)?;
        let time = |frame: usize| start + frame as f64 / frame_rate;
        Ok((0..=steps)
            .map(|frame| self.positions(time(frame)))
            .collect())
    }
}

/// The frames of a motion that lasts so many `seconds`.
pub(super) fn steps(seconds: f64, frame_rate: f64) -> Result<usize, RigError> {
    let frames = (seconds * frame_rate + SLACK).floor();
    if (0.0..MOST_FRAMES as f64).contains(&frames) {
        return Ok(frames as usize);
    }
    Err(RigError::Content(format!(
        "lasts {frames} frames of the scene, more than {MOST_FRAMES}"
    )))
}
