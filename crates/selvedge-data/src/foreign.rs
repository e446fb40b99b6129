//! A trajectory from the parts that data of other projects have.

use glam::{DVec2, DVec3, Vec3};
use selvedge_cloth::geometry::signed_area_2d;
use selvedge_cloth::{Cloth, Handles, Mesh};
use serde_json::Value;

use crate::formats::file_error::Problem;
use crate::formats::polygons::own_shape;
use crate::trajectory::{Provenance, Trajectory};

/// Largest difference of the sum of given areas from that in material space, as a share.
const AREA_TOLERANCE: f64 = 0.01;
/// Largest distance of a cloth from the origin along an axis `[m]`: `f32` steps by 6 cm there.
const FARTHEST: f64 = 1e6;

/// The parts of a trajectory.
#[derive(Clone, Debug)]
pub struct TrajectoryParts {
    /// Corners of the faces, all turned one way in material space.
    pub faces: Vec<[u32; 3]>,
    /// Material coordinates `[m]`; none where each face rests in the shape that it has in the rest pose.
    pub material: Option<Vec<DVec2>>,
    /// Rest positions `[m]`.
    pub rest: Vec<DVec3>,
    /// Positions by frame and vertex `[m]`.
    pub positions: Vec<DVec3>,
    /// Held vertices, in the order of their targets.
    pub handles: Vec<u32>,
    /// Weight of the cloth.
    pub weight: Weight,
    /// Frames per second.
    pub frame_rate: f64,
    /// Where the parts are from, as "imported from a cache".
    pub made_by: String,
}

/// Weight of a cloth.
#[derive(Clone, Debug)]
pub enum Weight {
    /// Mass per area `[kg/m²]`.
    Density(f64),
    /// Mass of each vertex `[kg]` and area of each face `[m²]`.
    Given {
        /// Masses.
        mass: Vec<f32>,
        /// Areas.
        area: Vec<f32>,
    },
}

impl TrajectoryParts {
    /// The trajectory, with every part checked against the others.
    ///
    /// # Errors
    /// [`Problem`] names the face, vertex or frame that does not fit.
    pub fn trajectory(self) -> Result<Trajectory, Problem> {
        self.made().map_err(Problem)
    }

    fn made(self) -> Result<Trajectory, String> {
        self.check()?;
        let handles = Handles::new(&self.handles, self.rest.len());
        let handles = handles.map_err(|error| format!("the handles: {error}"))?;
        let mesh = match self.material {
            Some(material) => {
                let faces = counter_clockwise(self.faces, &material)?;
                Mesh::new(&faces, material, self.rest)
            }
            None => {
                let corner = |v: u32| self.rest[v as usize];
                let faces = self.faces.iter();
                let shapes = faces.map(|face| own_shape(face.map(corner), DVec3::Y));
                let shapes: Vec<_> = shapes.collect();
                Mesh::sewn(&self.faces, &shapes, self.rest)
            }
        };
        let mesh = mesh.map_err(|error| format!("the mesh: {error}"))?;
        let shape = match self.weight {
            Weight::Density(density) => mesh.rest_shape(density),
            Weight::Given { mass, area } => {
                let mut shape = mesh.rest_shape(1.0);
                check_area(&area, shape.face_area.iter().sum())?;
                shape.vertex_mass = mass.into_iter().map(f64::from).collect();
                shape.face_area = area.into_iter().map(f64::from).collect();
                shape
            }
        };
        let cloth = Cloth::of_shape(&mesh, shape, handles).map_err(|error| error.to_string())?;
        let positions: Vec<Vec3> = self.positions.iter().map(|p| p.as_vec3()).collect();
        let program = concat!("selvedge ", env!("CARGO_PKG_VERSION"));
        let provenance = Provenance {
            frame_rate: self.frame_rate,
            scene: Value::Null,
            made_by: format!("{program}, {}", self.made_by),
        };
        Trajectory::new(cloth, positions, provenance).map_err(|error| error.to_string())
    }

    /// Checks that faces name vertices that exist, and that no vertex is beyond all bounds.
    fn check(&self) -> Result<(), String> {
        let vertices = self.rest.len();
        let corners = self.faces.iter().enumerate();
        let mut corners = corners.flat_map(|(face, corners)| corners.map(|vertex| (face, vertex)));
        if let Some((face, vertex)) = corners.find(|(_, vertex)| *vertex as usize >= vertices) {
            return Err(format!(
                "face {face} names vertex {vertex}, but there are {vertices} vertices, numbered from 0"
            ));
        }
        check_near("the rest pose", &self.rest)?;
        let frames = self.positions.chunks(vertices.max(1)).enumerate();
        for (frame, positions) in frames {
            check_near(&format!("frame {frame}"), positions)?;
        }
        Ok(())
    }
}

/// Checks that `positions` `[m]` are near the origin. Positions that are not finite have an error
/// of their own.
fn check_near(place: &str, positions: &[DVec3]) -> Result<(), String> {
    let is_far = |p: &DVec3| p.is_finite() && p.abs().max_element() > FARTHEST;
    match positions.iter().position(is_far) {
        None => Ok(()),
        Some(vertex) => Err(format!(
            "{place}: vertex {vertex} is at {} m, more than {FARTHEST} m from the origin: positions must be in metres",
            positions[vertex]
        )),
    }
}

/// `faces` turned round where all of them are clockwise in material space.
fn counter_clockwise(faces: Vec<[u32; 3]>, material: &[DVec2]) -> Result<Vec<[u32; 3]>, String> {
    let corner = |v: u32| material[v as usize];
    let is_clockwise = |face: &[u32; 3]| {
        let [a, b, c] = face.map(corner);
        signed_area_2d(a, b, c) < 0.0
    };
    let first = faces.first().is_some_and(is_clockwise);
    if let Some(face) = faces.iter().position(|face| is_clockwise(face) != first) {
        return Err(format!(
            "face {face} is clockwise in material space, others are not: turn all one way"
        ));
    }
    let turn = |[a, b, c]: [u32; 3]| if first { [a, c, b] } else { [a, b, c] };
    Ok(faces.into_iter().map(turn).collect())
}

fn check_area(area: &[f32], expected: f64) -> Result<(), String> {
    let found: f64 = area.iter().map(|&a| f64::from(a)).sum();
    if (found - expected).abs() <= AREA_TOLERANCE * expected {
        return Ok(());
    }
    Err(format!(
        "the faces have {found} m² in all, but {expected} m² in material space: texture coordinates must be in metres"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_garment_without_a_pattern_rests_as_it_stands() {
        let (rings, around) = (3, 6);
        let places = (0..rings * around).map(|k: usize| {
            let angle = std::f64::consts::TAU * (k % around) as f64 / around as f64;
            DVec3::new(angle.cos(), (k / around) as f64, angle.sin())
        });
        let rest: Vec<DVec3> = places.collect();
        let faces = (0..(rings - 1) * around).flat_map(|a| {
            let b = a / around * around + (a + 1) % around;
            [[a, a + around, b + around], [a, b + around, b]].map(|f| f.map(|v| v as u32))
        });
        let parts = TrajectoryParts {
            faces: faces.collect(),
            material: None,
            positions: rest.clone(),
            rest,
            handles: vec![0],
            weight: Weight::Density(0.2),
            frame_rate: 30.0,
            made_by: "a test".to_owned(),
        };
        let made = parts.trajectory().unwrap();
        // Each side is as wide as the radius.
        let area: f32 = made.cloth().face_area().iter().sum();
        assert!((area - 12.0).abs() < 1e-5, "{area} m²");
    }
}
