//! The cloths of a union in the arena: the arrays that do not change from frame to frame. Features
//! and integration read them.
//!
//! The files beside this one add the arrays that change (`frames`) and the schedules around the
//! network: `features`, `motion`, and for learning `losses` and `features_backward`.

pub mod features;
pub mod features_backward;
pub mod frames;
pub mod losses;
pub mod motion;

use selvedge_model::{ClothGraph, Connectivity};

use crate::device::{DeviceError, Loaded};
use crate::network::GraphArrays;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{NamedArgument, args};

/// The handle number of a vertex that is no handle, as in `kernels/common.h`.
const NO_HANDLE: u32 = u32::MAX;

/// Sizes of cloths side by side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnionSizes {
    /// Cloths.
    pub cloths: usize,
    /// Vertices of all cloths.
    pub vertices: usize,
    /// Arcs of all cloths.
    pub arcs: usize,
    /// Faces of all cloths.
    pub faces: usize,
    /// Handles of all cloths.
    pub handles: usize,
}

impl UnionSizes {
    /// The sizes of some cloths.
    #[must_use]
    pub fn of(graphs: &[&ClothGraph]) -> Self {
        let mut sizes = Self {
            cloths: graphs.len(),
            ..Self::default()
        };
        for graph in graphs {
            sizes.vertices += graph.vertex_count();
            sizes.arcs += graph.arc_count();
            sizes.faces += graph.topology().faces().len();
            sizes.handles += graph.handles().len();
        }
        sizes
    }
}

/// The cloths of a union in the arena.
#[derive(Clone, Copy, Debug)]
pub struct ClothArrays {
    /// Sizes of the union.
    pub sizes: UnionSizes,
    /// The arcs.
    pub graph: GraphArrays,
    /// The number of the cloth of each vertex, `[vertices]`.
    pub cloth_of: Region,
    /// The number of the handle of each vertex in the union, `[vertices]`.
    pub handle_of: Region,
    /// Masses, `[vertices]` `[kg]`.
    pub mass: Region,
    /// Wind, density and drag of each cloth's air, and the rate of three corners, `[cloths, 6]`.
    pub air: Region,
    /// Corners of the faces, `[faces, 3]`.
    pub corners: Region,
    /// Areas of the faces, `[faces]` `[m²]`.
    pub areas: Region,
    /// The offset of the faces of each vertex in `faces`, `[vertices + 1]`.
    pub first_face: Region,
    /// The faces of the vertices, in ascending order for each, `[3 faces]`.
    pub faces: Region,
    /// The rest vector of each arc and its length, `[arcs, 4]` `[m]`.
    pub arc_rest: Region,
    /// The material vector of each arc and its length, `[arcs, 3]` `[m]`.
    pub arc_material: Region,
    /// From, to, left and right of the hinge of each arc; four times 0 at a border, `[arcs, 4]`.
    pub hinges: Region,
}

impl ClothArrays {
    /// Room for a union.
    pub fn new(plan: &mut Plan, sizes: UnionSizes) -> Self {
        let UnionSizes {
            cloths,
            vertices,
            arcs,
            faces,
            ..
        } = sizes;
        Self {
            sizes,
            graph: GraphArrays::new(plan, vertices, arcs),
            cloth_of: plan.indices("cloths of vertices", vertices),
            handle_of: plan.indices("handles of vertices", vertices),
            mass: plan.floats("masses", vertices),
            air: plan.floats("air", 6 * cloths),
            corners: plan.indices("corners", 3 * faces),
            areas: plan.floats("areas", faces),
            first_face: plan.indices("first faces", vertices + 1),
            faces: plan.indices("faces of vertices", 3 * faces),
            arc_rest: plan.floats("rest vectors", 4 * arcs),
            arc_material: plan.floats("material vectors", 3 * arcs),
            hinges: plan.indices("hinges", 4 * arcs),
        }
    }

    /// The arguments `FORCES` of a kernel.
    pub(crate) fn forces(&self) -> Vec<NamedArgument> {
        args! {
            air: self.air,
            mass: self.mass,
            first_face: self.first_face,
            faces: self.faces,
            corners: self.corners,
            areas: self.areas,
        }
    }

    /// The arrays that [`Self::upload`] writes.
    #[must_use]
    pub fn regions(&self) -> Vec<Region> {
        let mut regions = self.graph.regions().to_vec();
        regions.extend(self.indices());
        regions.extend(self.floats());
        regions
    }

    fn indices(&self) -> [Region; 6] {
        [
            self.cloth_of,
            self.handle_of,
            self.corners,
            self.first_face,
            self.faces,
            self.hinges,
        ]
    }

    fn floats(&self) -> [Region; 5] {
        [
            self.mass,
            self.air,
            self.areas,
            self.arc_rest,
            self.arc_material,
        ]
    }

    /// Writes the cloths.
    ///
    /// # Errors
    /// When the device fails.
    ///
    /// # Panics
    /// When the cloths have other sizes.
    pub fn upload(
        &self,
        loaded: &mut dyn Loaded,
        graphs: &[&ClothGraph],
    ) -> Result<(), DeviceError> {
        assert_eq!(UnionSizes::of(graphs), self.sizes, "sizes of the cloths");
        let parts: Vec<Connectivity> = graphs
            .iter()
            .map(|graph| graph.connectivity().clone())
            .collect();
        self.graph.upload(loaded, &Connectivity::union(&parts))?;
        let mut statics = Statics::default();
        for (number, graph) in graphs.iter().enumerate() {
            statics.add(number as u32, graph);
        }
        statics.first_face.push(statics.faces.len() as u32);
        for (region, words) in self.indices().into_iter().zip(statics.indices()) {
            loaded.upload(region, words)?;
        }
        for (region, values) in self.floats().into_iter().zip(statics.floats()) {
            loaded.put(region, values)?;
        }
        Ok(())
    }
}

/// The contents of [`ClothArrays`].
#[derive(Default)]
pub(crate) struct Statics {
    pub(crate) cloth_of: Vec<u32>,
    pub(crate) handle_of: Vec<u32>,
    pub(crate) mass: Vec<f32>,
    pub(crate) air: Vec<f32>,
    pub(crate) corners: Vec<u32>,
    pub(crate) areas: Vec<f32>,
    pub(crate) first_face: Vec<u32>,
    pub(crate) faces: Vec<u32>,
    pub(crate) arc_rest: Vec<f32>,
    pub(crate) arc_material: Vec<f32>,
    pub(crate) hinges: Vec<u32>,
    handles: u32,
}

impl Statics {
    fn indices(&self) -> [&[u32]; 6] {
        [
            &self.cloth_of,
            &self.handle_of,
            &self.corners,
            &self.first_face,
            &self.faces,
            &self.hinges,
        ]
    }

    fn floats(&self) -> [&[f32]; 5] {
        [
            &self.mass,
            &self.air,
            &self.areas,
            &self.arc_rest,
            &self.arc_material,
        ]
    }

    fn add(&mut self, number: u32, graph: &ClothGraph) {
        let first_vertex = self.cloth_of.len() as u32;
        self.add_vertices(number, graph);
        self.add_faces(first_vertex, graph);
        self.add_arcs(first_vertex, graph);
    }

    pub(crate) fn add_vertices(&mut self, number: u32, graph: &ClothGraph) {
        let vertices = graph.vertex_count();
        self.cloth_of.extend(std::iter::repeat_n(number, vertices));
        let first = self.handle_of.len();
        self.handle_of.resize(first + vertices, NO_HANDLE);
        for vertex in graph.handles().vertices() {
            self.handle_of[first + vertex.index()] = self.handles;
            self.handles += 1;
        }
        self.mass.extend(graph.vertex_mass());
        let environment = graph.environment();
        self.air.extend(environment.wind.as_vec3().to_array());
        self.air.extend([
            environment.air_density as f32,
            environment.air_drag as f32,
            graph.frame_rate() as f32 / 3.0,
        ]);
    }

    pub(crate) fn add_faces(&mut self, first_vertex: u32, graph: &ClothGraph) {
        let first_face = self.areas.len() as u32;
        let mut of_vertex = vec![Vec::new(); graph.vertex_count()];
        for (number, face) in graph.topology().faces().iter().enumerate() {
            for v in face {
                self.corners.push(first_vertex + v.0);
                of_vertex[v.index()].push(first_face + number as u32);
            }
        }
        self.areas.extend(graph.face_area());
        for faces in of_vertex {
            self.first_face.push(self.faces.len() as u32);
            self.faces.extend(faces);
        }
    }

    pub(crate) fn add_arcs(&mut self, first_vertex: u32, graph: &ClothGraph) {
        let arcs = graph.arc_count();
        let first = self.arc_rest.len() / 4;
        self.arc_rest.resize(4 * (first + arcs), 0.0);
        self.arc_material.resize(3 * (first + arcs), 0.0);
        self.hinges.resize(4 * (first + arcs), 0);
        for (number, flat) in graph.material_vectors().into_iter().enumerate() {
            let (rest, length) = (graph.rest_vectors()[number], graph.rest_lengths()[number]);
            let sides = [1.0, -1.0].into_iter().zip(flat);
            for (arc, (sign, flat)) in graph.edge_arcs()[number].into_iter().zip(sides) {
                let arc = first + arc as usize;
                let rest = sign * rest;
                self.arc_rest[4 * arc..][..4].copy_from_slice(&[rest.x, rest.y, rest.z, length]);
                let material = [flat.x, flat.y, flat.length()];
                self.arc_material[3 * arc..][..3].copy_from_slice(&material);
            }
        }
        for hinge in graph.hinges() {
            let corners = [hinge.from, hinge.to, hinge.left, hinge.right];
            for arc in graph.edge_arcs()[hinge.edge as usize] {
                let arc = first + arc as usize;
                self.hinges[4 * arc..][..4].copy_from_slice(&corners.map(|v| v + first_vertex));
            }
        }
    }
}
