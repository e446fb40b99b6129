//! A trajectory: the positions of a cloth over time, with everything about the cloth that does not
//! change, checked once in [`Trajectory::new`].
//!
//! Positions are world coordinates `[m]` in `f32`, one row of vertices per frame; frame 0 is the
//! start. The file format is in `trajectory/file.rs`; [`Playback`] makes a trajectory a [`Stepper`].
//!
//! [`Stepper`]: selvedge_cloth::Stepper
//! [`Playback`]: crate::Playback

pub(crate) mod file;
pub(crate) mod frames;
pub(crate) mod playback;
pub(crate) mod record;
pub(crate) mod state_file;

use glam::{Vec2, Vec3};
use selvedge_cloth::{FaceId, Handles, Mesh, MeshError, Scene, Topology, VertexId};
use serde_json::Value;
use thiserror::Error;

use crate::trajectory::frames::Frames;

/// What does not change over a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloth {
    /// The connectivity.
    pub topology: Topology,
    /// The sagged rest pose `[m]`, `[vertices]`.
    pub rest_positions: Vec<Vec3>,
    /// Flat coordinates of the unstrained cloth `[m]`, `[vertices]`.
    pub material_coordinates: Vec<Vec2>,
    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub vertex_mass: Vec<f32>,
    /// Area of each face in material space `[m²]`, `[faces]`.
    pub face_area: Vec<f32>,
    /// The held vertices, in the order of the handle targets.
    pub handles: Handles,
}

/// Where a trajectory comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Provenance {
    /// Frames per second.
    pub frame_rate: f64,
    /// The resolved scene ([`SceneSpec`] as JSON); `null` where there is none.
    ///
    /// [`SceneSpec`]: crate::SceneSpec
    pub scene: Value,
    /// Program and version that made it.
    pub made_by: String,
}

/// The positions of a cloth over time: at least one frame, finite everywhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    cloth: Cloth,
    positions: Vec<Vec3>,
    provenance: Provenance,
}

/// Why arrays do not make a trajectory.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum TrajectoryError {
    #[error("{what} has {found} entries, expected {expected}")]
    Count {
        what: &'static str,
        expected: usize,
        found: usize,
    },
    #[error(
        "positions have {found} entries, which is no whole number of frames of {vertices} vertices"
    )]
    Frames { vertices: usize, found: usize },
    #[error("frame {frame}: the position of vertex {vertex} is not finite: {value}")]
    Position {
        frame: usize,
        vertex: VertexId,
        value: Vec3,
    },
    #[error("{what} of vertex {vertex} must be {expected}, found {value}")]
    Vertex {
        what: &'static str,
        vertex: VertexId,
        expected: &'static str,
        value: String,
    },
    #[error("the area of face {face} must be finite and positive, found {value}")]
    FaceArea { face: FaceId, value: f32 },
    #[error("handle {handle} is vertex {vertex}, but the mesh has {vertex_count} vertices")]
    Handle {
        handle: usize,
        vertex: VertexId,
        vertex_count: usize,
    },
    #[error("the frame rate must be finite and positive, found {found}")]
    FrameRate { found: f64 },
}

impl Cloth {
    /// The cloth of `scene` with its sagged `rest_positions` `[m]`, `[vertices]`.
    #[must_use]
    pub fn of_scene(scene: &Scene, rest_positions: Vec<Vec3>) -> Self {
        let rest = scene.mesh.rest_shape(scene.material.density);
        let coordinates = scene.mesh.material_coordinates();
        Self {
            topology: scene.mesh.topology().clone(),
            rest_positions,
            material_coordinates: coordinates.iter().map(|c| c.as_vec2()).collect(),
            vertex_mass: rest.vertex_mass.iter().map(|&m| m as f32).collect(),
            face_area: rest.face_area.iter().map(|&a| a as f32).collect(),
            handles: scene.handles.clone(),
        }
    }

    /// The mesh that starts at the rest positions.
    ///
    /// # Errors
    /// [`MeshError`] where the material coordinates of a foreign file make no flat rest shape.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        Mesh::new(
            &self.topology.face_indices(),
            self.material_coordinates
                .iter()
                .map(|c| c.as_dvec2())
                .collect(),
            self.rest_positions.iter().map(|p| p.as_dvec3()).collect(),
        )
    }

    fn validate(&self) -> Result<(), TrajectoryError> {
        let vertices = self.topology.vertex_count();
        let faces = self.topology.faces().len();
        check_count("rest_positions", vertices, self.rest_positions.len())?;
        let coordinates = &self.material_coordinates;
        check_count("material_coordinates", vertices, coordinates.len())?;
        check_count("vertex_mass", vertices, self.vertex_mass.len())?;
        check_count("face_area", faces, self.face_area.len())?;
        check_vertices("the rest position", &self.rest_positions, |p| p.is_finite())?;
        check_vertices("the material coordinate", coordinates, |c| c.is_finite())?;
        self.check_positive()?;
        for (handle, &vertex) in self.handles.vertices().iter().enumerate() {
            if vertex.index() >= vertices {
                return Err(TrajectoryError::Handle {
                    handle,
                    vertex,
                    vertex_count: vertices,
                });
            }
        }
        Ok(())
    }

    fn check_positive(&self) -> Result<(), TrajectoryError> {
        let positive = |value: f32| value.is_finite() && value > 0.0;
        if let Some(bad) = self.vertex_mass.iter().position(|&m| !positive(m)) {
            return Err(TrajectoryError::Vertex {
                what: "the mass",
                vertex: VertexId(bad as u32),
                expected: "finite and positive",
                value: self.vertex_mass[bad].to_string(),
            });
        }
        match self.face_area.iter().position(|&a| !positive(a)) {
            Some(bad) => Err(TrajectoryError::FaceArea {
                face: FaceId(bad as u32),
                value: self.face_area[bad],
            }),
            None => Ok(()),
        }
    }
}

impl Trajectory {
    /// Makes a trajectory of `positions` `[m]`, `[frames * vertices]`, one frame after another.
    ///
    /// # Errors
    /// [`TrajectoryError`] names the first array, frame and vertex that cannot be used.
    pub fn new(
        cloth: Cloth,
        positions: Vec<Vec3>,
        provenance: Provenance,
    ) -> Result<Self, TrajectoryError> {
        cloth.validate()?;
        let vertices = cloth.topology.vertex_count();
        if positions.is_empty() || !positions.len().is_multiple_of(vertices) {
            return Err(TrajectoryError::Frames {
                vertices,
                found: positions.len(),
            });
        }
        if let Some(bad) = positions.iter().position(|p| !p.is_finite()) {
            return Err(TrajectoryError::Position {
                frame: bad / vertices,
                vertex: VertexId((bad % vertices) as u32),
                value: positions[bad],
            });
        }
        let frame_rate = provenance.frame_rate;
        if !(frame_rate.is_finite() && frame_rate > 0.0) {
            return Err(TrajectoryError::FrameRate { found: frame_rate });
        }
        Ok(Self {
            cloth,
            positions,
            provenance,
        })
    }

    /// Its image in a mirror at z = 0: cloth that bends alike to both sides moves so under mirrored
    /// handles and wind. The scene it comes from is still that of the original.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mirrored = |p: &Vec3| Vec3::new(p.x, p.y, -p.z);
        Self {
            cloth: Cloth {
                rest_positions: self.cloth.rest_positions.iter().map(mirrored).collect(),
                ..self.cloth.clone()
            },
            positions: self.positions.iter().map(mirrored).collect(),
            provenance: self.provenance.clone(),
        }
    }

    /// Number of frames, the start included.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.positions.len() / self.vertex_count()
    }

    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.cloth.topology.vertex_count()
    }

    /// Positions in frame `index` `[m]`, `[vertices]`.
    ///
    /// # Panics
    /// When `index` is not below [`Self::frame_count`], as for a slice.
    #[must_use]
    pub fn frame(&self, index: usize) -> &[Vec3] {
        self.frames().frame(index)
    }

    /// All frames, as metrics and exporters take them.
    #[must_use]
    pub fn frames(&self) -> Frames<'_> {
        Frames::of_whole(&self.positions, self.vertex_count())
    }

    /// All positions `[m]`, `[frames * vertices]`, one frame after another.
    #[must_use]
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// What does not change.
    #[must_use]
    pub fn cloth(&self) -> &Cloth {
        &self.cloth
    }

    /// The connectivity.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.cloth.topology
    }

    /// The held vertices.
    #[must_use]
    pub fn handles(&self) -> &Handles {
        &self.cloth.handles
    }

    /// Frames per second.
    #[must_use]
    pub fn frame_rate(&self) -> f64 {
        self.provenance.frame_rate
    }

    /// Where it comes from.
    #[must_use]
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }
}

fn check_count(what: &'static str, expected: usize, found: usize) -> Result<(), TrajectoryError> {
    if found == expected {
        return Ok(());
    }
    Err(TrajectoryError::Count {
        what,
        expected,
        found,
    })
}

fn check_vertices<T: std::fmt::Display>(
    what: &'static str,
    values: &[T],
    is_good: impl Fn(&T) -> bool,
) -> Result<(), TrajectoryError> {
    match values.iter().position(|value| !is_good(value)) {
        Some(vertex) => Err(TrajectoryError::Vertex {
            what,
            vertex: VertexId(vertex as u32),
            expected: "finite",
            value: values[vertex].to_string(),
        }),
        None => Ok(()),
    }
}
