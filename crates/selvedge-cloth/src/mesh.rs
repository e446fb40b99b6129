//! A cloth before anything moves it: topology, start positions, material coordinates, and the
//! quantities of its flat rest shape.

use glam::{DVec2, DVec3};
use thiserror::Error;

use crate::geometry::signed_area_2d;
use crate::{FaceId, Topology, TopologyError, VertexId};

/// A triangle mesh of one or more sheets, valid by construction.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    topology: Topology,
    material_coordinates: Vec<DVec2>,
    positions: Vec<DVec3>,
}

/// Topology, coordinates and positions that do not make a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum MeshError {
    #[error(transparent)]
    Topology(#[from] TopologyError),
    #[error("{what} has {found} entries for {expected} vertices")]
    Count {
        what: &'static str,
        expected: usize,
        found: usize,
    },
    #[error("{what} of vertex {vertex} is not finite: {value}")]
    NonFinite {
        what: &'static str,
        vertex: VertexId,
        value: String,
    },
    #[error(
        "face {face} has no area in material space ({area:e} m²): remove it, or mend its texture coordinates"
    )]
    ZeroArea { face: FaceId, area: f64 },
    #[error(
        "face {face} is clockwise in material space (area {area:e} m²): flip its texture coordinates"
    )]
    Clockwise { face: FaceId, area: f64 },
}

impl Mesh {
    /// Builds a mesh of `faces` (`[faces, 3]`) with `material_coordinates` `[m]` (`[vertices]`;
    /// x = course axis u, y = wale axis v) and start `positions` `[m]` (`[vertices]`).
    ///
    /// # Errors
    /// A defect of the topology, a count that does not match, a value that is not finite, or a
    /// face without area or clockwise in material space.
    pub fn new(
        faces: &[[u32; 3]],
        material_coordinates: Vec<DVec2>,
        positions: Vec<DVec3>,
    ) -> Result<Self, MeshError> {
        let topology = Topology::new(positions.len(), faces)?;
        if material_coordinates.len() != positions.len() {
            return Err(MeshError::Count {
                what: "the list of material coordinates",
                expected: positions.len(),
                found: material_coordinates.len(),
            });
        }
        check_finite("the position", &positions, |p| p.is_finite())?;
        check_finite("the material coordinate", &material_coordinates, |c| {
            c.is_finite()
        })?;
        check_areas(&topology, &material_coordinates)?;
        Ok(Self {
            topology,
            material_coordinates,
            positions,
        })
    }

    /// The connectivity.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// Flat coordinates of the unstrained cloth `[m]`, `[vertices]`.
    #[must_use]
    pub fn material_coordinates(&self) -> &[DVec2] {
        &self.material_coordinates
    }

    /// Start positions in the world `[m]`, `[vertices]`.
    #[must_use]
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// The same mesh at other start positions `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// [`MeshError::Count`] or [`MeshError::NonFinite`].
    pub fn with_positions(self, positions: Vec<DVec3>) -> Result<Self, MeshError> {
        if positions.len() != self.positions.len() {
            return Err(MeshError::Count {
                what: "the list of positions",
                expected: self.positions.len(),
                found: positions.len(),
            });
        }
        check_finite("the position", &positions, |p| p.is_finite())?;
        Ok(Self { positions, ..self })
    }

    /// Areas, lengths and masses of the flat rest shape for a cloth of `density` `[kg/m²]`.
    #[must_use]
    pub fn rest_shape(&self, density: f64) -> RestShape {
        RestShape::of(self, density)
    }
}

fn check_finite<T: std::fmt::Debug>(
    what: &'static str,
    values: &[T],
    is_finite: impl Fn(&T) -> bool,
) -> Result<(), MeshError> {
    match values.iter().position(|value| !is_finite(value)) {
        Some(vertex) => Err(MeshError::NonFinite {
            what,
            vertex: VertexId(vertex as u32),
            value: format!("{:?}", values[vertex]),
        }),
        None => Ok(()),
    }
}

fn check_areas(topology: &Topology, coordinates: &[DVec2]) -> Result<(), MeshError> {
    for (number, face) in topology.faces().iter().enumerate() {
        let [a, b, c] = face.map(|v| coordinates[v.index()]);
        let area = signed_area_2d(a, b, c);
        let longest = (b - a)
            .length_squared()
            .max((c - b).length_squared())
            .max((a - c).length_squared());
        let face = FaceId(number as u32);
        // Also catches slivers whose area is lost in rounding.
        if area.abs() <= 1e-9 * longest {
            return Err(MeshError::ZeroArea { face, area });
        }
        if area < 0.0 {
            return Err(MeshError::Clockwise { face, area });
        }
    }
    Ok(())
}

/// Quantities of the flat rest shape: a vertex carries a third of the mass of each of its faces
/// (Baraff and Witkin 1998, section 2). `[eq:lumped-mass]`
#[derive(Clone, Debug, PartialEq)]
pub struct RestShape {
    /// Area of each face in material space `[m²]`, `[faces]`.
    pub face_area: Vec<f64>,
    /// Length of each edge in material space `[m]`, `[edges]`.
    pub edge_length: Vec<f64>,
    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub vertex_mass: Vec<f64>,
}

impl RestShape {
    fn of(mesh: &Mesh, density: f64) -> Self {
        let (topology, uv) = (&mesh.topology, &mesh.material_coordinates);
        let mut face_area = Vec::with_capacity(topology.faces().len());
        let mut vertex_mass = vec![0.0; topology.vertex_count()];
        for face in topology.faces() {
            let [a, b, c] = face.map(|v| uv[v.index()]);
            let area = signed_area_2d(a, b, c);
            face_area.push(area);
            for vertex in face {
                vertex_mass[vertex.index()] += density * area / 3.0;
            }
        }
        let edge_length = topology
            .edges()
            .iter()
            .map(|edge| {
                let [a, b] = edge.vertices.map(|v| uv[v.index()]);
                a.distance(b)
            })
            .collect();
        Self {
            face_area,
            edge_length,
            vertex_mass,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{SquareSpec, square};

    /// A quad of two triangles, 2 m wide and 1 m high, flat at z = 0.
    fn quad() -> (Vec<[u32; 3]>, Vec<DVec2>, Vec<DVec3>) {
        let uv: Vec<DVec2> = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]
            .map(|(u, v)| DVec2::new(u, v))
            .to_vec();
        let positions = uv.iter().map(|c| c.extend(0.0)).collect();
        (vec![[0, 1, 2], [0, 2, 3]], uv, positions)
    }

    #[test]
    fn a_quad_has_its_masses_and_lengths() {
        let (faces, uv, positions) = quad();
        let mesh = Mesh::new(&faces, uv, positions).unwrap();
        let rest = mesh.rest_shape(0.3);
        assert_eq!(rest.face_area, [1.0, 1.0]);
        // Edges by (smaller, larger) vertex: 0-1, 0-2, 0-3, 1-2, 2-3.
        let diagonal = 5.0_f64.sqrt();
        assert_eq!(rest.edge_length, [2.0, diagonal, 1.0, 1.0, 2.0]);
        // A third of 0.3 kg per incident face: one or two of them.
        for (mass, faces) in rest.vertex_mass.iter().zip([2.0, 1.0, 2.0, 1.0]) {
            assert!((mass - 0.1 * faces).abs() < 1e-16);
        }
    }

    #[test]
    fn masses_sum_to_density_times_area() {
        for (size, density) in [(1.0, 0.187), (0.4, 2.0)] {
            let spec = SquareSpec {
                vertices: 200,
                size,
                seed: 4,
            };
            let rest = square(&spec).unwrap().mesh.rest_shape(density);
            let mass: f64 = rest.vertex_mass.iter().sum();
            let expected = density * size * size;
            // 600 additions, each rounded to 1e-16 of the sum at most.
            assert!((mass / expected - 1.0).abs() < 1e-13, "{mass}");
            assert!(rest.vertex_mass.iter().all(|&m| m > 0.0));
        }
    }

    #[test]
    fn the_rest_shape_does_not_depend_on_the_pose() {
        let (faces, uv, positions) = quad();
        let mesh = Mesh::new(&faces, uv, positions).unwrap();
        let crumpled = vec![DVec3::ONE; 4];
        let moved = mesh.clone().with_positions(crumpled.clone()).unwrap();
        assert_eq!(moved.positions(), crumpled);
        assert_eq!(moved.rest_shape(1.0), mesh.rest_shape(1.0));
    }

    #[test]
    fn defects_are_named() {
        let build = |spoil: fn(&mut Vec<[u32; 3]>, &mut Vec<DVec2>, &mut Vec<DVec3>)| {
            let (mut faces, mut uv, mut positions) = quad();
            spoil(&mut faces, &mut uv, &mut positions);
            Mesh::new(&faces, uv, positions).unwrap_err()
        };
        let topology = build(|faces, _, _| faces[1] = [0, 2, 2]);
        assert!(matches!(topology, MeshError::Topology(_)));
        assert_eq!(
            build(|_, uv, _| uv.truncate(3)),
            MeshError::Count {
                what: "the list of material coordinates",
                expected: 4,
                found: 3
            }
        );
        let text = build(|_, _, p| p[2].y = f64::NAN).to_string();
        assert!(
            text.starts_with("the position of vertex 2 is not finite"),
            "{text}"
        );
        let text = build(|_, uv, _| uv[3].x = f64::INFINITY).to_string();
        assert!(
            text.starts_with("the material coordinate of vertex 3"),
            "{text}"
        );
        // Vertex 3 on the diagonal 0-2: face 1 has no area.
        let flat = build(|_, uv, _| uv[3] = DVec2::new(1.0, 0.5));
        assert!(
            matches!(
                flat,
                MeshError::ZeroArea {
                    face: FaceId(1),
                    ..
                }
            ),
            "{flat}"
        );
        let flipped = build(|_, uv, _| uv[3] = DVec2::new(1.0, 0.2));
        assert!(
            matches!(
                flipped,
                MeshError::Clockwise {
                    face: FaceId(1),
                    ..
                }
            ),
            "{flipped}"
        );
        let (faces, uv, positions) = quad();
        let mesh = Mesh::new(&faces, uv, positions).unwrap();
        assert!(mesh.clone().with_positions(vec![DVec3::ZERO; 3]).is_err());
        assert!(mesh.with_positions(vec![DVec3::NAN; 4]).is_err());
    }
}
