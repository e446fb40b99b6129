//! A cloth as the features see it: its constant properties, checked once in [`ClothGraph::new`],
//! and the arcs, hinges and rest vectors that are computed from them ahead.
//!
//! Rest vectors are in the local frame of the rest pose, not in world axes: a rest pose that was
//! turned about the vertical has the same ones. The network's own view of the arcs, for one cloth
//! or several, is in `connectivity`.

use glam::{Vec2, Vec3};
use selvedge_cloth::{
    Cloth, ContactSettings, Environment, Handles, Material, Obstacle, Scene, Topology, VertexId,
};
use thiserror::Error;

use crate::graph::connectivity::{Connectivity, edge_arcs};
use crate::graph::frame::LocalFrame;
use crate::graph::surroundings::Surroundings;
use crate::graph::weave::Weave;

/// An edge between two faces. `from` → `to` runs counter-clockwise in the face of `left`, and
/// `from` is the smaller vertex, so that a hinge does not depend on the order of the faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hinge {
    /// The number of the edge.
    pub edge: u32,
    /// The smaller end.
    pub from: u32,
    /// The larger end.
    pub to: u32,
    /// The third vertex of the face to the left of `from` → `to`.
    pub left: u32,
    /// The third vertex of the face to the right.
    pub right: u32,
}

/// A cloth with all that is computed from it ahead of a motion, valid by construction.
#[derive(Clone, Debug, PartialEq)]
pub struct ClothGraph {
    cloth: Cloth,
    /// With its gusts.
    weather: Environment,
    /// In the present step.
    environment: Environment,
    /// The frame of the weather from which steps are counted.
    first_frame: usize,
    frame_rate: f64,
    handle_mask: Vec<bool>,
    frame: LocalFrame,
    connectivity: Connectivity,
    /// Arcs of each edge: the arc that `vertices[0]` sends, then its reverse, `[edges, 2]`.
    pub(crate) edge_arcs: Vec<[u32; 2]>,
    hinges: Vec<Hinge>,
    /// `vertices[0]` - `vertices[1]` of each edge at rest, in the rest pose's local frame `[m]`,
    /// `[edges]`.
    pub(crate) rest_vectors: Vec<Vec3>,
    rest_lengths: Vec<f32>,
    /// Elasticity of the fabrics, where these are known.
    weave: Option<Weave>,
    /// What it could touch, if anything.
    surroundings: Option<Surroundings>,
}

/// An environment or a frame rate that the features cannot express.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{0}")]
pub struct GraphError(String);

impl ClothGraph {
    /// Makes the graph of `cloth` in `environment`, moving by `frame_rate` frames per second.
    ///
    /// # Errors
    /// [`GraphError`] when the environment or the frame rate cannot be used.
    pub fn new(
        cloth: &Cloth,
        environment: Environment,
        frame_rate: f64,
    ) -> Result<Self, GraphError> {
        let valid = environment.validate();
        valid.map_err(|error| GraphError(error.to_string()))?;
        if !(1.0..=1e5).contains(&frame_rate) {
            return Err(GraphError(format!(
                "frame_rate must be between 1 and 100000 frames per second, found {frame_rate}"
            )));
        }
        let (topology, rest) = (cloth.topology(), cloth.rest_positions());
        let frame = LocalFrame::new(&cloth.handles().select(rest));
        let yaw = frame.rest_yaw();
        let rest_vectors: Vec<Vec3> = topology
            .edges()
            .iter()
            .map(|edge| {
                let [a, b] = edge.vertices.map(|v| rest[v.index()]);
                yaw.to_local(a - b)
            })
            .collect();
        Ok(Self {
            handle_mask: cloth.handles().mask(topology.vertex_count()),
            frame,
            connectivity: Connectivity::of(topology),
            edge_arcs: edge_arcs(topology),
            hinges: hinges(topology),
            rest_lengths: rest_vectors.iter().map(|d| d.length()).collect(),
            rest_vectors,
            cloth: cloth.clone(),
            weather: environment,
            environment: environment.during_step(0, frame_rate),
            first_frame: 0,
            frame_rate,
            weave: None,
            surroundings: None,
        })
    }

    /// The same in a run that begins in this frame of its weather.
    pub fn taken_up_at(mut self, frame: usize) -> Self {
        self.first_frame = frame;
        self.set_step(0);
        self
    }

    /// Lets the step from `frame` of the run to the next be the present one: its wind blows, and bodies are
    /// where they are in it.
    pub fn set_step(&mut self, frame: usize) {
        let frame = self.first_frame + frame;
        self.environment = self.weather.during_step(frame, self.frame_rate);
        if let Some(surroundings) = &mut self.surroundings {
            surroundings.set_step(frame, self.frame_rate);
        }
    }

    /// The same with its fabrics known, which some features are made from
    /// ([`ModelSpec::needs_fabric`](crate::ModelSpec::needs_fabric)): the material of each face, `[faces]`.
    ///
    /// # Errors
    /// [`GraphError`] when there is not one material per face.
    pub fn with_materials(mut self, materials: &[&Material]) -> Result<Self, GraphError> {
        let (faces, found) = (self.topology().faces().len(), materials.len());
        if found != faces {
            return Err(GraphError(format!(
                "materials: the cloth has {faces} faces, found {found} materials"
            )));
        }
        self.weave = Some(Weave::new(&self.cloth, &self.hinges, materials));
        Ok(self)
    }

    /// The same among bodies that it touches, and itself.
    pub fn among(mut self, contact: ContactSettings, obstacles: &[Obstacle]) -> Self {
        let made = Surroundings::new(
            self.topology(),
            self.cloth.edge_bounds(),
            contact,
            obstacles,
            self.frame_rate,
        );
        self.surroundings = Some(made);
        self.set_step(0);
        self
    }

    /// True where it touches bodies or itself.
    pub fn has_contact(&self) -> bool {
        self.surroundings.is_some()
    }

    /// True where a body around it moves.
    pub fn has_moving_bodies(&self) -> bool {
        self.surroundings.as_ref().is_some_and(Surroundings::vary)
    }

    /// What it could touch.
    pub(crate) fn surroundings(&self) -> Option<&Surroundings> {
        self.surroundings.as_ref()
    }

    /// The graph of `cloth` in a scene, with its environment, its fabrics and what it touches.
    ///
    /// # Errors
    /// As of [`Self::new`] and [`Self::with_materials`].
    pub fn of_scene(cloth: &Cloth, scene: &Scene) -> Result<Self, GraphError> {
        let (materials, of_face) = scene.materials();
        let faces: Vec<&Material> = of_face
            .into_iter()
            .map(|number| materials[number])
            .collect();
        let graph = Self::new(cloth, scene.environment, scene.frame_rate)?;
        let graph = graph.with_materials(&faces)?;
        Ok(match scene.contact {
            Some(contact) => graph.among(contact, &scene.obstacles),
            None => graph,
        })
    }

    /// True where the fabrics are known.
    pub fn knows_fabric(&self) -> bool {
        self.weave.is_some()
    }

    /// Elasticity of the fabrics.
    ///
    /// # Panics
    /// Where they are not known.
    pub(crate) fn weave(&self) -> &Weave {
        self.weave.as_ref().expect("the fabrics of the cloth")
    }

    /// The cloth.
    pub fn cloth(&self) -> &Cloth {
        &self.cloth
    }

    /// Faces, edges and arcs of the mesh.
    pub fn topology(&self) -> &Topology {
        self.cloth.topology()
    }

    /// The handles.
    pub fn handles(&self) -> &Handles {
        self.cloth.handles()
    }

    /// Lets the handles for which `holds` says so hold their vertices, and no others.
    pub fn hold(&mut self, holds: impl Fn(usize) -> bool) {
        for (handle, vertex) in self.cloth.handles().vertices().iter().enumerate() {
            self.handle_mask[vertex.index()] = holds(handle);
        }
    }

    /// True for each vertex that a handle holds, `[vertices]`.
    pub fn handle_mask(&self) -> &[bool] {
        &self.handle_mask
    }

    /// Sender minus receiver of the two arcs of each edge in the pattern `[m]`, that which
    /// `vertices[0]` sends first, `[edges, 2]`. An arc lies in the face to its left, so that the two arcs
    /// of a seam see it as either panel does; without a face there, in the other.
    /// `[eq:seam-vector]`
    pub fn material_vectors(&self) -> Vec<[Vec2; 2]> {
        let pattern = self.cloth.pattern();
        let edges = self.topology().edges().iter();
        edges
            .map(|edge| {
                // `vertices[0]` → `vertices[1]` has the first face to its left.
                let (left, right) = pattern.sides(edge);
                let [a, b] = left.ends;
                let [c, d] = right.map_or(left.ends, |right| right.ends);
                [a - b, d - c]
            })
            .collect()
    }

    /// Gravity and air in the present step.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// Frames per second.
    pub fn frame_rate(&self) -> f64 {
        self.frame_rate
    }

    /// The local frame, which follows the handles.
    pub fn frame(&self) -> &LocalFrame {
        &self.frame
    }

    /// All arcs, as the network takes them.
    pub fn connectivity(&self) -> &Connectivity {
        &self.connectivity
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.cloth.topology().vertex_count()
    }

    /// Number of arcs, two per edge.
    pub fn arc_count(&self) -> usize {
        self.connectivity.arc_count()
    }

    /// The edges between two faces, in the order of the edges.
    pub fn hinges(&self) -> &[Hinge] {
        &self.hinges
    }

    /// Length of each edge in the sagged rest pose `[m]`, `[edges]`.
    pub fn rest_lengths(&self) -> &[f32] {
        &self.rest_lengths
    }
}

fn hinges(topology: &Topology) -> Vec<Hinge> {
    let hinge = |(number, edge): (usize, &selvedge_cloth::Edge)| {
        let [mut from, mut to] = edge.vertices.map(|v: VertexId| v.0);
        let (mut left, mut right) = (edge.opposite.0.0, edge.opposite.1?.0);
        if from > to {
            (from, to, left, right) = (to, from, right, left);
        }
        Some(Hinge {
            edge: number as u32,
            from,
            to,
            left,
            right,
        })
    };
    topology
        .edges()
        .iter()
        .enumerate()
        .filter_map(hinge)
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use selvedge_cloth::{Gust, Handles, Mesh};

    use super::*;
    use crate::test_cloth::parts;

    #[test]
    fn what_a_graph_cannot_be_made_in_is_named() {
        let calm = Environment::default();
        let thick = Environment {
            air_drag: -1.0,
            ..calm
        };
        for (environment, frame_rate, expected) in [
            (calm, 0.0, "frame_rate must be between"),
            (thick, 60.0, "environment.air_drag"),
        ] {
            let made = ClothGraph::new(&parts(3, 1).cloth, environment, frame_rate);
            let found = made.expect_err(expected).to_string();
            assert!(found.contains(expected), "{found}");
        }
    }

    #[test]
    fn a_gust_blows_in_each_step_as_in_that_of_its_run() {
        let weather = Environment {
            gust: Some(Gust {
                speed: DVec3::X,
                period: 1.0,
                seed: 1,
            }),
            ..Environment::default()
        };
        let graph = ClothGraph::new(&parts(3, 1).cloth, weather, 60.0).expect("a graph");
        let mut graph = graph.taken_up_at(7);
        assert_eq!(*graph.environment(), weather.during_step(7, 60.0));
        graph.set_step(5);
        assert_eq!(*graph.environment(), weather.during_step(12, 60.0));
        assert_ne!(weather.during_step(12, 60.0), weather.during_step(7, 60.0));
    }

    #[test]
    fn each_arc_of_a_seam_lies_in_the_face_to_its_left() {
        // Two faces sewn along 1-2; the second is turned by a quarter and a tenth larger.
        let (faces, turn) = (
            [[0, 1, 2], [1, 3, 2]],
            glam::DVec2::from_angle(std::f64::consts::FRAC_PI_2),
        );
        let at = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 0.5)].map(glam::DVec2::from);
        let shapes = [0, 1].map(|face| {
            let place = |v: u32| match face {
                0 => at[v as usize],
                _ => 1.1 * turn.rotate(at[v as usize]) + 4.0,
            };
            faces[face].map(place)
        });
        let positions = at.map(|p| DVec3::new(p.x, p.y, 0.0)).to_vec();
        let mesh = Mesh::sewn(&faces, &shapes, positions).expect("a mesh");
        let handles = Handles::new(&[0, 3], 4).expect("handles");
        let cloth = Cloth::of_mesh(&mesh, 0.2, handles).expect("a cloth");
        let graph = ClothGraph::new(&cloth, Environment::default(), 60.0).expect("a graph");
        let edges = graph.topology().edges();
        let seam = edges
            .iter()
            .position(|edge| !edge.is_boundary())
            .expect("a seam");
        assert_eq!(edges[seam].vertices.map(|v| v.0), [1, 2]);
        let [along, back] = graph.material_vectors()[seam];
        // Arc 1 → 2 has face 0 to its left: (0, -1). Arc 2 → 1 has face 1: 1.1 turned (0, 1).
        assert!(along.distance(Vec2::new(0.0, -1.0)) < 1e-6, "{along}");
        assert!(back.distance(Vec2::new(-1.1, 0.0)) < 1e-5, "{back}");
        for (number, [there, again]) in graph.material_vectors().into_iter().enumerate() {
            assert!(number == seam || there == -again);
        }
    }
}
