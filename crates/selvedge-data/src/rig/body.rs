//! All meshes of a rig together: as a body that moves, baked frame by frame into our world, and as
//! polygons where the nodes stand at the start.
//!
//! glTF, and some writers of USD, split vertices along seams; [`Rig::polygons`] leaves them so, and
//! the caller welds them. Names of nodes become labels, names of materials (in USD of
//! `GeomSubset`s) become fabrics.

use std::path::Path;

use glam::DVec3;

use super::mesh::RigMesh;
use super::node::{Rig, RigError, Wanted, frame_times};
use super::track::ends;
use crate::formats::file_error::FileError;
use crate::formats::polygons::{Corner, Place, Polygon, Polygons};

/// Largest difference of the time between two frames from the others that is taken for rounding, as
/// a share: files have times in single precision.
const ROUNDING: f64 = 1e-3;

/// A mesh in the file of another program, and when it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMotion {
    /// Name of the node that has it.
    pub name: String,
    /// Number of its points.
    pub points: usize,
    /// Number of its faces.
    pub faces: usize,
    /// Times at which its points are given `[s]`, ascending; none if it does not move.
    pub times: Vec<f64>,
}

impl MeshMotion {
    /// Frames per second, if they are evenly spaced.
    pub fn frame_rate(&self) -> Option<f64> {
        let [first, .., last] = self.times.as_slice() else {
            return None;
        };
        let step = (last - first) / (self.times.len() - 1) as f64;
        let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= ROUNDING * step;
        self.times.windows(2).all(is_even).then_some(1.0 / step)
    }
}

impl Rig {
    /// The meshes in a .glb or USD (.usda, .usdc, .usdz) file, and when they move; a .glb
    /// with several animations has its meshes as they stand.
    ///
    /// # Errors
    /// [`FileError`] names the file, and what in it cannot be understood.
    pub fn read_meshes(path: &Path) -> Result<Vec<MeshMotion>, FileError<RigError>> {
        let rig = Self::of_file(path, |bytes, format| {
            match Self::parse(bytes, format, Wanted::Motion(None)) {
                Err(RigError::Animations { .. }) => Self::parse(bytes, format, Wanted::Still),
                read => read,
            }
        })?;
        let of = |mesh: &RigMesh| MeshMotion {
            name: rig.nodes[mesh.node].name.clone(),
            points: mesh.positions.len(),
            faces: mesh.faces.len(),
            times: mesh.keys(&rig),
        };
        Ok(rig.meshes.iter().map(of).collect())
    }

    /// The polygons of all meshes, with the points of all in order.
    pub(crate) fn polygons(&self) -> Result<Polygons, RigError> {
        let mut polygons = Polygons {
            warnings: self.warnings.clone(),
            ..Polygons::default()
        };
        for (part, mesh) in self.meshes.iter().enumerate() {
            let name = &self.nodes[mesh.node].name;
            let placement = self.placement(mesh.node, 0.0);
            let placed = mesh.positions.iter();
            let placed = placed.map(|p| placement.transform_point3(*p));
            let first = polygons.positions.len() as u32;
            polygons.positions.extend(placed);
            let label = polygons.labels.entry(name.clone()).or_default();
            label.extend(first..polygons.positions.len() as u32);
            polygons.parts.push(vec![name.clone()]);
            let count = mesh.positions.len() as u32;
            for (number, face) in mesh.faces.iter().enumerate() {
                if let Some(beyond) = face.corners.iter().find(|&&point| point >= count) {
                    let problem =
                        format!("face {number} of its mesh names vertex {beyond} of {count}");
                    return Err(RigError::node(name, problem));
                }
                let corners = face.corners.iter().enumerate().map(|(k, &vertex)| Corner {
                    vertex: first + vertex,
                    texture: face.texture.get(k).map(|uv| {
                        polygons.texture.push(*uv);
                        polygons.texture.len() - 1
                    }),
                    loose: None,
                });
                let corners = corners.collect();
                let fabric = face.fabric.as_deref();
                let fabric = fabric.map(|name| polygons.fabric_of(name));
                polygons.polygons.push(Polygon {
                    place: Place::Face(polygons.polygons.len()),
                    corners,
                    fabric,
                    part,
                });
            }
        }
        polygons.numbers = (0..polygons.positions.len()).collect();
        Ok(polygons)
    }

    /// Times of the first and the last key that move the meshes `[s]`; none if nothing does.
    pub(crate) fn span_of_meshes(&self) -> Option<[f64; 2]> {
        let meshes = self.meshes.iter();
        ends(meshes.flat_map(|mesh| mesh.own_keys().chain(mesh.keys_of_nodes(self))))
    }

    /// Positions of all points at `time` `[s]`, in metres.
    pub(crate) fn positions(&self, time: f64) -> Vec<DVec3> {
        let meshes = self.meshes.iter();
        meshes.flat_map(|mesh| mesh.positions(self, time)).collect()
    }

    /// Positions in every frame from `from` `[s]` after the start of the file to the last key,
    /// `frame_rate` a second.
    pub(crate) fn frames(&self, frame_rate: f64, from: f64) -> Result<Vec<Vec<DVec3>>, RigError> {
        let last = self.span_of_meshes().map_or(self.start, |span| span[1]);
        let times = frame_times(self.start + from, last, frame_rate)?;
        Ok(times.map(|time| self.positions(time)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uneven_times_have_no_rate() {
        let motion = |times: &[f64]| MeshMotion {
            name: "sheet".to_owned(),
            points: 4,
            faces: 2,
            times: times.to_vec(),
        };
        for uneven in [&[][..], &[0.0], &[0.0, 0.1, 0.3]] {
            assert_eq!(motion(uneven).frame_rate(), None);
        }
    }
}
