//! A cloth: connectivity, handles, rest pose, material coordinates, masses and areas, checked
//! against each other once in [`Cloth::new`].
//!
//! A [`Cloth`] holds everything about a cloth that does not change over a motion. Its numbers are
//! `f32`, as files hold them and as models read them; [`Mesh`] is the description in `f64` that a
//! simulator starts from.

use crate::error::SceneError;
use crate::pattern::{Pattern, Texture, check_corners};
use crate::{Handles, Mesh, MeshError, RestShape, Scene, Topology};
use glam::{DVec2, Vec2, Vec3};

// The bounds are the extremes of the physics itself: on the 31 motions of the paper's kind of the
// data set `first`, edges have stretches of 0.853 to 1.282 (one frame in a thousand of 39,091 has
// one over 1.263). A run counts as diverged above a strain of 30 %.

/// Shortest stretch l/l₀ of an edge, against the material. A goal, not a promise: a fold between
/// vertices shortens edges.
const LEAST_STRETCH: f64 = 0.85;
/// Longest stretch l/l₀ of an edge, against the material.
const MOST_STRETCH: f64 = 1.28;
/// Margin around an edge's length in the rest pose, as a part of that length. Lengths within it are
/// always allowed, whatever the stretch: heavy cloth may hang stretched.
const REST_MARGIN: f64 = 0.005;

/// The arrays of a [`Cloth`], one entry per vertex or per face.
#[derive(Clone, Debug, PartialEq)]
pub struct ClothArrays {
    /// The sagged rest pose in the world `[m]`, `[vertices]`.
    pub rest_positions: Vec<Vec3>,
    /// Points of the pattern, the flat coordinates of the unstrained cloth `[m]`, `[points]`; of
    /// a cloth without seams there is one for each vertex.
    pub material_coordinates: Vec<Vec2>,
    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub vertex_mass: Vec<f32>,
    /// Area of each face in material space `[m²]`, `[faces]`.
    pub face_area: Vec<f32>,
}

/// A cloth, valid by construction: counts agree, positions and coordinates are finite, masses and
/// areas are finite and positive, and every handle is a vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloth {
    topology: Topology,
    handles: Handles,
    arrays: ClothArrays,
    /// Points of the faces' corners, where a vertex has more than one.
    corners: Option<Vec<[u32; 3]>>,
    texture: Texture,
}

impl Cloth {
    /// Makes a cloth of `topology` with `handles` and `arrays`.
    ///
    /// # Errors
    /// [`SceneError`] names the first array, vertex, face or handle that cannot be used.
    pub fn new(
        topology: Topology,
        handles: Handles,
        arrays: ClothArrays,
    ) -> Result<Self, SceneError> {
        Self::with_corners(topology, handles, arrays, None)
    }

    /// Makes a sewn cloth, whose faces have these `corners` among the points of the pattern,
    /// `[faces, 3]`.
    ///
    /// # Errors
    /// As for [`Self::new`], and where the corners do not fit.
    pub fn sewn(
        topology: Topology,
        handles: Handles,
        arrays: ClothArrays,
        corners: Vec<[u32; 3]>,
    ) -> Result<Self, SceneError> {
        check_corners(&topology, arrays.material_coordinates.len(), &corners)?;
        let is_plain = arrays.material_coordinates.len() == topology.vertex_count();
        Self::with_corners(topology, handles, arrays, (!is_plain).then_some(corners))
    }

    fn with_corners(
        topology: Topology,
        handles: Handles,
        arrays: ClothArrays,
        corners: Option<Vec<[u32; 3]>>,
    ) -> Result<Self, SceneError> {
        check_counts(&topology, &arrays, corners.is_some())?;
        check_finite("the rest position", &arrays.rest_positions, |p| *p)?;
        let coordinates = &arrays.material_coordinates;
        check_finite("the material coordinate", coordinates, |c| c.extend(0.0))?;
        check_positive(&arrays)?;
        handles.check_range(topology.vertex_count())?;
        Ok(Self {
            topology,
            handles,
            arrays,
            corners,
            texture: Texture::Pattern,
        })
    }

    /// Makes a cloth of `mesh` with `density` `[kg/m²]`, at rest where the mesh starts.
    ///
    /// # Errors
    /// [`SceneError`] when a handle is no vertex of the mesh, or a mass, an area or a coordinate
    /// cannot be told from zero or infinity in `f32`.
    pub fn of_mesh(mesh: &Mesh, density: f64, handles: Handles) -> Result<Self, SceneError> {
        Self::of_shape(mesh, mesh.rest_shape(density), handles)
    }

    /// As [`Self::of_mesh`], with the masses and areas of this `shape`.
    ///
    /// # Errors
    /// As there.
    pub fn of_shape(mesh: &Mesh, shape: RestShape, handles: Handles) -> Result<Self, SceneError> {
        let coordinates = mesh.material_coordinates().iter();
        let arrays = ClothArrays {
            rest_positions: mesh.positions().iter().map(|p| p.as_vec3()).collect(),
            material_coordinates: coordinates.map(|c| c.as_vec2()).collect(),
            vertex_mass: shape.vertex_mass.iter().map(|&m| m as f32).collect(),
            face_area: shape.face_area.iter().map(|&a| a as f32).collect(),
        };
        let pattern = mesh.pattern();
        let corners = pattern.is_sewn().then(|| pattern.corners());
        let cloth = Self::with_corners(mesh.topology().clone(), handles, arrays, corners)?;
        let texture = mesh.texture().clone();
        Ok(Self { texture, ..cloth })
    }

    /// Makes the cloth of `scene` with its sagged `rest_positions` `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// [`SceneError`] as for [`Self::new`].
    pub fn of_scene(scene: &Scene, rest_positions: Vec<Vec3>) -> Result<Self, SceneError> {
        Self::of_shape(&scene.mesh, scene.rest_shape(), scene.handles.clone())?
            .with_rest_positions(rest_positions)
    }

    /// The same cloth with other `handles`.
    ///
    /// # Errors
    /// [`SceneError`] when a handle is no vertex of the cloth.
    pub fn with_handles(self, handles: Handles) -> Result<Self, SceneError> {
        handles.check_range(self.vertex_count())?;
        Ok(Self { handles, ..self })
    }

    /// The same cloth with other `rest_positions` `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// [`SceneError`] where they are not as many as vertices, or not finite.
    pub fn with_rest_positions(self, rest_positions: Vec<Vec3>) -> Result<Self, SceneError> {
        let arrays = ClothArrays {
            rest_positions,
            ..self.arrays
        };
        let cloth = Self::with_corners(self.topology, self.handles, arrays, self.corners)?;
        let texture = self.texture;
        Ok(Self { texture, ..cloth })
    }

    /// The same cloth with these texture coordinates.
    ///
    /// # Errors
    /// [`SceneError`] where they are not finite, their faces do not fit, or there are no faces and
    /// not one per vertex.
    pub fn with_texture(self, texture: Texture) -> Result<Self, SceneError> {
        if let Texture::Own(own) = &texture {
            check_finite("the texture coordinate", &own.points, |c| c.extend(0.0))?;
            let (expected, found) = (self.vertex_count(), own.points.len());
            match &own.corners {
                Some(corners) => check_corners(&self.topology, found, corners)?,
                None => check_count("the list of texture coordinates", expected, found)?,
            }
        }
        Ok(Self { texture, ..self })
    }

    /// The mesh that starts at the rest positions.
    ///
    /// # Errors
    /// [`MeshError`] where the material coordinates of a foreign file make no flat rest shape.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let faces = self.topology.face_indices();
        let positions = self.rest_positions().iter().map(|p| p.as_dvec3()).collect();
        let pattern = self.pattern();
        if pattern.is_sewn() {
            let corners: Vec<[DVec2; 3]> = pattern.faces().map(|f| f.map(Vec2::as_dvec2)).collect();
            return Mesh::sewn(&faces, &corners, positions);
        }
        let coordinates = pattern.points().iter().map(|c| c.as_dvec2()).collect();
        Mesh::new(&faces, coordinates, positions)
    }

    /// The connectivity.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.topology.vertex_count()
    }

    /// The held vertices, in the order of the handle targets.
    pub fn handles(&self) -> &Handles {
        &self.handles
    }

    /// The arrays, as [`Self::new`] takes them.
    pub fn arrays(&self) -> &ClothArrays {
        &self.arrays
    }

    /// The sagged rest pose in the world `[m]`, `[vertices]`.
    pub fn rest_positions(&self) -> &[Vec3] {
        &self.arrays.rest_positions
    }

    /// The pattern: rest shapes of faces, seams and panels.
    pub fn pattern(&self) -> Pattern<'_, Vec2> {
        let points = &self.arrays.material_coordinates;
        Pattern::new(&self.topology, points, self.corners.as_deref())
    }

    /// Shortest and longest length that a learned frame may give each edge `[m]`, `[edges]`.
    pub fn edge_bounds(&self) -> Vec<[f64; 2]> {
        let lengths = self.pattern().edge_lengths();
        let edges = self.topology.edges().iter().zip(lengths);
        let bounds = edges.map(|(edge, length)| {
            let [a, b] = edge
                .vertices
                .map(|v| self.rest_positions()[v.index()].as_dvec3());
            let rest = a.distance(b);
            let least = (LEAST_STRETCH * length).min((1.0 - REST_MARGIN) * rest);
            [
                least,
                (MOST_STRETCH * length).max((1.0 + REST_MARGIN) * rest),
            ]
        });
        bounds.collect()
    }

    /// The texture coordinates.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// The texture coordinates as points of a plane, each of one vertex; none where there are none.
    pub fn texture_points(&self) -> Option<Pattern<'_, Vec2>> {
        match &self.texture {
            Texture::Pattern => Some(self.pattern()),
            Texture::None => None,
            Texture::Own(own) => {
                let corners = own.corners.as_deref();
                Some(Pattern::new(&self.topology, &own.points, corners))
            }
        }
    }

    /// Points of the pattern `[m]`, `[points]`. The first are those of the vertices, each in its
    /// first face; of a cloth without seams there are no others.
    pub fn material_coordinates(&self) -> &[Vec2] {
        &self.arrays.material_coordinates
    }

    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub fn vertex_mass(&self) -> &[f32] {
        &self.arrays.vertex_mass
    }

    /// Area of each face in material space `[m²]`, `[faces]`.
    pub fn face_area(&self) -> &[f32] {
        &self.arrays.face_area
    }
}

fn check_counts(
    topology: &Topology,
    arrays: &ClothArrays,
    is_sewn: bool,
) -> Result<(), SceneError> {
    let (vertices, faces) = (topology.vertex_count(), topology.faces().len());
    let coordinates = arrays.material_coordinates.len();
    // The points of a sewn cloth are checked against its corners.
    let points = if is_sewn { coordinates } else { vertices };
    for (what, expected, found) in [
        ("rest_positions", vertices, arrays.rest_positions.len()),
        ("material_coordinates", points, coordinates),
        ("vertex_mass", vertices, arrays.vertex_mass.len()),
        ("face_area", faces, arrays.face_area.len()),
    ] {
        check_count(what, expected, found)?;
    }
    Ok(())
}

fn check_count(what: &str, expected: usize, found: usize) -> Result<(), SceneError> {
    if expected == found {
        return Ok(());
    }
    let text = format!("{what} has {found} entries, expected {expected}");
    Err(SceneError(text))
}

fn check_finite<T>(what: &str, values: &[T], point: impl Fn(&T) -> Vec3) -> Result<(), SceneError> {
    match values.iter().position(|value| !point(value).is_finite()) {
        Some(vertex) => Err(SceneError(format!(
            "{what} of vertex {vertex} must be finite, found {}",
            point(&values[vertex])
        ))),
        None => Ok(()),
    }
}

fn check_positive(arrays: &ClothArrays) -> Result<(), SceneError> {
    for (what, values) in [
        ("the mass of vertex", &arrays.vertex_mass),
        ("the area of face", &arrays.face_area),
    ] {
        if let Some(bad) = values.iter().position(|x| !(x.is_finite() && *x > 0.0)) {
            return Err(SceneError(format!(
                "{what} {bad} must be finite and positive, found {}",
                values[bad]
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::refuses;
    use crate::generate::square;

    fn cloth() -> Cloth {
        let arrays = ClothArrays {
            rest_positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.5), Vec3::Y],
            material_coordinates: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
            vertex_mass: vec![0.25; 4],
            face_area: vec![0.5; 2],
        };
        let topology = Topology::new(4, &[[0, 1, 2], [0, 2, 3]]).unwrap();
        Cloth::new(topology, Handles::new(&[3, 2], 4).unwrap(), arrays).unwrap()
    }

    #[test]
    fn arrays_that_do_not_fit_are_named() {
        let cloth = cloth();
        let (topology, handles) = (cloth.topology(), cloth.handles());
        refuses(
            cloth.arrays(),
            |arrays| Cloth::new(topology.clone(), handles.clone(), arrays.clone()),
            &[
                ("vertex_mass has 3 entries, expected 4", |a| {
                    a.vertex_mass.truncate(3);
                }),
                ("face_area has 0 entries, expected 2", |a| {
                    a.face_area.clear();
                }),
                ("rest_positions has 2 entries, expected 4", |a| {
                    a.rest_positions.truncate(2);
                }),
                ("material_coordinates has 5 entries, expected 4", |a| {
                    a.material_coordinates.push(Vec2::ZERO);
                }),
                (
                    "the mass of vertex 1 must be finite and positive, found 0",
                    |a| a.vertex_mass[1] = 0.0,
                ),
                (
                    "the area of face 1 must be finite and positive, found NaN",
                    |a| a.face_area[1] = f32::NAN,
                ),
                ("the rest position of vertex 2 must be finite", |a| {
                    a.rest_positions[2].z = f32::INFINITY;
                }),
                ("the material coordinate of vertex 3 must be finite", |a| {
                    a.material_coordinates[3].y = f32::NAN;
                }),
            ],
        );
    }

    #[test]
    fn a_handle_must_be_a_vertex() {
        let beyond = Handles::new(&[9], 10).unwrap();
        let error = cloth().with_handles(beyond).unwrap_err();
        let reason = Handles::new(&[9], 10).unwrap().check_range(4).unwrap_err();
        assert_eq!(error.to_string(), reason.to_string());
        let fewer = Handles::new(&[1], 4).unwrap();
        let held = cloth().with_handles(fewer.clone()).unwrap();
        assert_eq!(held.handles(), &fewer);
        assert_eq!(held.arrays(), cloth().arrays());
    }

    #[test]
    fn a_cloth_of_a_mesh_has_its_masses_and_gives_it_back() {
        let mesh = square(30, 1.0, 0).unwrap().mesh;
        let none = Handles::new(&[], 30).unwrap();
        let cloth = Cloth::of_mesh(&mesh, 0.2, none).unwrap();
        let mass: f64 = cloth.vertex_mass().iter().map(|&m| f64::from(m)).sum();
        // Thirty masses, each rounded to a relative 6e-8.
        assert!((mass - 0.2).abs() < 0.2 * 1e-7, "{mass}");
        assert_eq!(cloth.mesh().unwrap().topology(), mesh.topology());
        let sunk = vec![Vec3::NEG_Y; 30];
        let sunk = cloth.with_rest_positions(sunk.clone()).unwrap();
        assert_eq!(sunk.rest_positions()[7], Vec3::NEG_Y);
        assert!(sunk.with_rest_positions(vec![Vec3::ZERO; 29]).is_err());
    }
}
