//! Obstacles as people write them (docs/src/guides/obstacles.md).

use std::path::Path;

use glam::DVec3;
use selvedge_cloth::Keyframe;
use serde::Deserialize;

use super::body::{BodySpec, Cuboid, Plane, Sphere, Tube, problem_of};
use super::motion::{FramesFile, NodeFile, ObstacleKeyframes, ObstacleMotion, wrong};
use super::read;
use super::spec::{ObstacleSpec, Placement};
use crate::formats::file_error::Problem;
use crate::formats::input::hash;

/// An obstacle in the file's own words.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObstacleFile {
    pub(super) name: String,
    plane: Option<Plane>,
    sphere: Option<Sphere>,
    capsule: Option<Tube>,
    cylinder: Option<Tube>,
    #[serde(rename = "box")]
    cuboid: Option<Cuboid>,
    mesh: Option<String>,
    #[serde(default)]
    transform: Placement,
    motion: Option<MotionFile>,
    friction: Option<f64>,
    thickness: Option<f64>,
}

/// A file of points, or a table.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a file, or a table with keyframes, file, animation or node"
)]
enum MotionFile {
    Path(String),
    Table(Box<MotionTable>),
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct MotionTable {
    keyframes: Option<Vec<Keyframe>>,
    axis: Option<DVec3>,
    centre: Option<DVec3>,
    file: Option<String>,
    node: Option<String>,
    animation: Option<String>,
    rate: Option<f64>,
    #[serde(default)]
    from: f64,
}

impl ObstacleFile {
    /// Looks for files from `folder`.
    pub(crate) fn resolve(self, folder: &Path) -> Result<ObstacleSpec, Problem> {
        let name = self.name.clone();
        self.resolved(folder).map_err(problem_of(&name))
    }

    fn resolved(self, folder: &Path) -> Result<ObstacleSpec, String> {
        if self.name.is_empty() {
            return Err("name: is empty: give the obstacle a name".to_owned());
        }
        let mesh = self.mesh.map(|path| BodySpec::mesh_now(path, folder));
        let bodies = [
            self.plane.map(BodySpec::Plane),
            self.sphere.map(BodySpec::Sphere),
            self.capsule.map(BodySpec::Capsule),
            self.cylinder.map(BodySpec::Cylinder),
            self.cuboid.map(BodySpec::Box),
            mesh.transpose()?,
        ];
        let mut bodies = bodies.into_iter().flatten();
        let (Some(body), None) = (bodies.next(), bodies.next()) else {
            let problem = "body: must be one of plane, sphere, capsule, cylinder, box and mesh";
            return Err(problem.to_owned());
        };
        let motion = match self.motion {
            None => ObstacleMotion::Still,
            Some(MotionFile::Path(path)) => {
                let file = Some(path);
                let table = MotionTable {
                    file,
                    ..MotionTable::default()
                };
                table.resolve(&body, folder)?
            }
            Some(MotionFile::Table(table)) => table.resolve(&body, folder)?,
        };
        Ok(ObstacleSpec {
            name: self.name,
            body,
            transform: self.transform,
            motion,
            friction: self.friction,
            thickness: self.thickness,
        })
    }
}

impl MotionTable {
    fn resolve(self, body: &BodySpec, folder: &Path) -> Result<ObstacleMotion, String> {
        let of_points = self.rate.is_some() || self.from != 0.0 || self.animation.is_some();
        if let Some(keyframes) = self.keyframes {
            if of_points || self.file.is_some() || self.node.is_some() {
                return Err(wrong("has keyframes and a file: keep one"));
            }
            return Ok(ObstacleMotion::Keyframes(ObstacleKeyframes {
                axis: self.axis.unwrap_or(DVec3::Y),
                centre: self.centre,
                keyframes,
            }));
        }
        if self.axis.is_some() || self.centre.is_some() {
            return Err(wrong("axis and centre are for keyframes"));
        }
        if let Some(node) = self.node {
            let Some(path) = self.file else {
                return Err(wrong("names a node but no file that has it"));
            };
            if of_points {
                let problem = "follows a node: rate, from and animation are for points";
                return Err(wrong(problem));
            }
            let blake3 = hash(&read::bytes_of("motion", &path, folder)?);
            return Ok(ObstacleMotion::Node(NodeFile { path, blake3, node }));
        }
        // An animation without a file is one of the mesh's own.
        let own = match (body, &self.animation) {
            (BodySpec::Mesh { path, .. }, Some(_)) => Some(path.clone()),
            _ => None,
        };
        let Some(path) = self.file.or(own) else {
            let problem = "needs keyframes, a file, or an animation of the mesh's own file";
            return Err(wrong(problem));
        };
        Ok(ObstacleMotion::Points(FramesFile {
            blake3: hash(&read::bytes_of("motion", &path, folder)?),
            path,
            rate: self.rate,
            animation: self.animation,
            from: self.from,
        }))
    }
}
