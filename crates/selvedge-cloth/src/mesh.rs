//! A cloth before anything moves it: topology, start positions, pattern, rest angles, and the
//! quantities of its rest shape.

use glam::{DVec2, DVec3, Vec2};
use serde::Serialize;
use thiserror::Error;

use crate::error::{SceneError, must, require};
use crate::geometry::{dihedral_angle, signed_area_2d};
use crate::pattern::{NumberedPattern, Pattern, Texture, check_corners};
use crate::{FaceId, Topology, TopologyError, VertexId};

/// A triangle mesh of one or more sheets, flat or sewn, valid by construction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mesh {
    topology: Topology,
    /// Points of the pattern `[m]`.
    points: Vec<DVec2>,
    /// Points of the faces' corners, where a vertex has more than one.
    corners: Option<Vec<[u32; 3]>>,
    positions: Vec<DVec3>,
    /// Rest angle of each edge `[rad]`; empty where all are flat.
    rest_angles: Vec<f64>,
    seam_stiffness: f64,
    fabrics: FaceFabrics,
    texture: Texture,
}

/// Names of the fabrics of faces, as a file gives them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FaceFabrics {
    /// The names.
    pub names: Vec<String>,
    /// Name of each face by its number, none where it has none, `[faces]`; empty where no face
    /// has one.
    pub of_face: Vec<Option<u32>>,
}

impl FaceFabrics {
    /// Number of the name of a face.
    pub fn of(&self, face: FaceId) -> Option<usize> {
        let number = self.of_face.get(face.index()).copied().flatten();
        number.map(|number| number as usize)
    }
}

/// Topology, coordinates and positions that do not make a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum MeshError {
    #[error(transparent)]
    Topology(#[from] TopologyError),
    #[error(
        "face {face} has no area in material space ({area:e} m²): remove it, or mend its texture coordinates"
    )]
    ZeroArea { face: FaceId, area: f64 },
    #[error("{0}")]
    Unusable(String),
}

impl From<SceneError> for MeshError {
    fn from(error: SceneError) -> Self {
        Self::Unusable(error.to_string())
    }
}

impl Mesh {
    /// Builds a mesh of `faces` (`[faces, 3]`) with `material_coordinates` `[m]` (`[vertices]`;
    /// x = course axis u, y = wale axis v) and start `positions` `[m]` (`[vertices]`). Faces may be
    /// clockwise in material space, as those of a mirrored panel are.
    ///
    /// # Errors
    /// A defect of the topology, a count that does not match, a value that is not finite or beyond
    /// 10¹⁵ m, or a face without area in material space.
    pub fn new(
        faces: &[[u32; 3]],
        material_coordinates: Vec<DVec2>,
        positions: Vec<DVec3>,
    ) -> Result<Self, MeshError> {
        let topology = Topology::new(positions.len(), faces)?;
        let found = material_coordinates.len();
        check_count("the list of material coordinates", positions.len(), found)?;
        Self::checked(topology, material_coordinates, None, positions)
    }

    /// Builds a mesh of `faces` (`[faces, 3]`) whose corners have these material coordinates `[m]`
    /// (`[faces, 3]`), over start `positions` `[m]` (`[vertices]`). Faces that see a vertex at
    /// different coordinates are sewn together there.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn sewn(
        faces: &[[u32; 3]],
        corner_coordinates: &[[DVec2; 3]],
        positions: Vec<DVec3>,
    ) -> Result<Self, MeshError> {
        let topology = Topology::new(positions.len(), faces)?;
        let (what, found) = (
            "the list of corners' material coordinates",
            corner_coordinates.len(),
        );
        check_count(what, faces.len(), found)?;
        let NumberedPattern { points, corners } =
            NumberedPattern::new(&topology, corner_coordinates);
        Self::checked(topology, points, corners, positions)
    }

    fn checked(
        topology: Topology,
        points: Vec<DVec2>,
        corners: Option<Vec<[u32; 3]>>,
        positions: Vec<DVec3>,
    ) -> Result<Self, MeshError> {
        check_positions(&positions)?;
        if let Some(corners) = &corners {
            check_corners(&topology, points.len(), corners)?;
        }
        let pattern = Pattern::new(&topology, &points, corners.as_deref());
        check_points(pattern)?;
        check_areas(pattern)?;
        Ok(Self {
            topology,
            points,
            corners,
            positions,
            rest_angles: Vec::new(),
            seam_stiffness: 1.0,
            fabrics: FaceFabrics::default(),
            texture: Texture::Pattern,
        })
    }

    /// The connectivity.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// The pattern: rest shapes of faces, seams and panels.
    pub fn pattern(&self) -> Pattern<'_, DVec2> {
        Pattern::new(&self.topology, &self.points, self.corners.as_deref())
    }

    /// Points of the pattern `[m]`, `[points]`. The first are those of the vertices, each in its
    /// first face; of a mesh without seams there are no others.
    pub fn material_coordinates(&self) -> &[DVec2] {
        &self.points
    }

    /// Start positions in the world `[m]`, `[vertices]`.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// Dihedral angle of each edge at which its hinge has no torque `[rad]`, `[edges]`; empty where
    /// all are 0.
    pub fn rest_angles(&self) -> &[f64] {
        &self.rest_angles
    }

    /// Bending stiffness of a seam in units of that of the cloth beside it.
    pub fn seam_stiffness(&self) -> f64 {
        self.seam_stiffness
    }

    /// The texture coordinates.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// The same mesh with these texture coordinates of its faces' corners, `[faces, 3]`, v upwards,
    /// or with none.
    pub fn with_texture(self, corners: Option<&[[Vec2; 3]]>) -> Self {
        let own = |corners| Texture::Own(NumberedPattern::new(&self.topology, corners));
        let texture = corners.map_or(Texture::None, own);
        Self { texture, ..self }
    }

    /// Names of the faces' fabrics.
    pub fn fabrics(&self) -> &FaceFabrics {
        &self.fabrics
    }

    /// The same mesh at other start positions `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// Another number of positions, or one that [`Self::new`] refuses.
    pub fn with_positions(self, positions: Vec<DVec3>) -> Result<Self, MeshError> {
        let expected = self.positions.len();
        check_count("the list of positions", expected, positions.len())?;
        check_positions(&positions)?;
        Ok(Self { positions, ..self })
    }

    /// The same mesh with its pattern `scale` times as large.
    ///
    /// # Errors
    /// A point that [`Self::new`] refuses, or [`MeshError::ZeroArea`] where a number is lost.
    pub fn with_pattern_scaled(mut self, scale: f64) -> Result<Self, MeshError> {
        self.points.iter_mut().for_each(|point| *point *= scale);
        check_points(self.pattern())?;
        check_areas(self.pattern())?;
        Ok(self)
    }

    /// The same mesh with these rest angles `[rad]`, `[edges]`; those of boundary edges mean
    /// nothing.
    ///
    /// # Errors
    /// Another number of angles, or one that is none.
    pub fn with_rest_angles(self, angles: Vec<f64>) -> Result<Self, MeshError> {
        let edges = self.topology.edges();
        check_count("the list of rest angles", edges.len(), angles.len())?;
        let is_angle = |angle: &f64| angle.abs() <= std::f64::consts::PI;
        if let Some(bad) = angles.iter().position(|angle| !is_angle(angle)) {
            let ([a, b], found) = (edges[bad].vertices, angles[bad]);
            let field = format!("the rest angle of edge {a}-{b}");
            return Err(must(field, "between -π and π", found).into());
        }
        let rest_angles =
            if angles.iter().all(|angle| *angle == 0.0) { Vec::new() } else { angles };
        Ok(Self {
            rest_angles,
            ..self
        })
    }

    /// The same mesh whose rest angles are those of its start positions. `[eq:rest-angle]`
    pub fn with_rest_angles_of_start(self) -> Self {
        let at = |vertex: VertexId| self.positions[vertex.index()];
        let edges = self.topology.edges().iter();
        let rest_angles = edges
            .map(|edge| {
                let [from, to] = edge.vertices.map(at);
                let (left, right) = edge.opposite;
                right.map_or(0.0, |right| dihedral_angle(from, to, at(left), at(right)))
            })
            .collect();
        Self {
            rest_angles,
            ..self
        }
    }

    /// The same mesh with seams that bend `factor` times as stiffly as the cloth beside them.
    ///
    /// # Errors
    /// A factor that is negative or not finite.
    pub fn with_seam_stiffness(self, factor: f64) -> Result<Self, MeshError> {
        let holds = factor.is_finite() && factor >= 0.0;
        let field = "the stiffness of seams";
        require(holds, field, "finite and not negative", factor)?;
        Ok(Self {
            seam_stiffness: factor,
            ..self
        })
    }

    /// The same mesh with these names of its faces' fabrics.
    ///
    /// # Errors
    /// Where not every face has an entry, or one has the number of a name that there is not.
    pub fn with_fabrics(self, fabrics: FaceFabrics) -> Result<Self, MeshError> {
        let (expected, found) = (self.topology.faces().len(), fabrics.of_face.len());
        if found != 0 {
            check_count("the list of faces' fabrics", expected, found)?;
        }
        let names = fabrics.names.len();
        for (face, number) in fabrics.of_face.iter().enumerate() {
            if let Some(number) = number.filter(|number| *number as usize >= names) {
                return Err(MeshError::Unusable(format!(
                    "face {face} has fabric {number} of {names} (from 0): name it, or give the face none"
                )));
            }
        }
        Ok(Self { fabrics, ..self })
    }

    /// Areas, lengths and masses of the rest shape for a cloth of `density` `[kg/m²]`.
    pub fn rest_shape(&self, density: f64) -> RestShape {
        self.rest_shape_of(|_| density)
    }

    /// Areas, lengths and masses of the rest shape where each face has a density of its own
    /// `[kg/m²]`.
    pub fn rest_shape_of(&self, density: impl Fn(FaceId) -> f64) -> RestShape {
        let (topology, pattern) = (&self.topology, self.pattern());
        let mut face_area = Vec::with_capacity(topology.faces().len());
        let mut vertex_mass = vec![0.0; topology.vertex_count()];
        for (number, [a, b, c]) in (0_u32..).zip(pattern.faces()) {
            let face = FaceId(number);
            let area = signed_area_2d(a, b, c).abs();
            face_area.push(area);
            for vertex in topology.faces()[face.index()] {
                vertex_mass[vertex.index()] += density(face) * area / 3.0;
            }
        }
        RestShape {
            face_area,
            edge_length: pattern.edge_lengths(),
            vertex_mass,
        }
    }
}

/// Magnitude up to which a coordinate is taken `[m]`: areas of cloths of such a size are far from
/// overflow, in f32 too.
const FARTHEST: f64 = 1e15;

fn check_count(what: &str, expected: usize, found: usize) -> Result<(), MeshError> {
    if expected == found {
        Ok(())
    } else {
        Err(MeshError::Unusable(format!(
            "{what} has {found} entries for {expected} vertices"
        )))
    }
}

fn check_positions(positions: &[DVec3]) -> Result<(), MeshError> {
    let mut numbered = (0_u32..).zip(positions);
    numbered.try_for_each(|(vertex, position)| {
        check_coordinate("the position", vertex, &position.to_array(), position)
    })
}

fn check_points(pattern: Pattern<'_, DVec2>) -> Result<(), MeshError> {
    let mut owned = pattern.points().iter().zip(pattern.vertices());
    owned.try_for_each(|(point, vertex)| {
        check_coordinate("the material coordinate", vertex, &point.to_array(), point)
    })
}

/// Checks the `coordinates` of a vertex, which are those of `found`.
fn check_coordinate(
    what: &str,
    vertex: u32,
    coordinates: &[f64],
    found: &dyn std::fmt::Debug,
) -> Result<(), MeshError> {
    if coordinates.iter().all(|x| x.abs() <= FARTHEST) {
        return Ok(());
    }
    Err(MeshError::Unusable(
        if coordinates.iter().all(|x| x.is_finite()) {
            format!(
                "{what} of vertex {vertex} is {found:?}, farther from the origin than 1e15 m, as no cloth is: check the unit of length, and the factors of the mesh"
            )
        } else {
            format!("{what} of vertex {vertex} is not finite: {found:?}")
        },
    ))
}

fn check_areas(pattern: Pattern<'_, DVec2>) -> Result<(), MeshError> {
    for (number, [a, b, c]) in pattern.faces().enumerate() {
        let area = signed_area_2d(a, b, c);
        let longest = (b - a)
            .length_squared()
            .max((c - b).length_squared())
            .max((a - c).length_squared());
        // Also catches slivers whose area is lost in rounding.
        if area.abs() <= 1e-9 * longest {
            let face = FaceId(number as u32);
            return Err(MeshError::ZeroArea { face, area });
        }
    }
    Ok(())
}

/// Quantities of the rest shape: a vertex carries a third of the mass of each of its faces
/// (Baraff and Witkin 1998, section 2). `[eq:lumped-mass]`
#[derive(Clone, Debug, PartialEq)]
pub struct RestShape {
    /// Area of each face in material space `[m²]`, `[faces]`.
    pub face_area: Vec<f64>,
    /// Length of each edge in material space `[m]`, `[edges]`; see [`Pattern::edge_lengths`].
    pub edge_length: Vec<f64>,
    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub vertex_mass: Vec<f64>,
}

#[cfg(test)]
mod tests;
