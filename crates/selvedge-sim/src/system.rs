//! One linearised backward Euler solve (Baraff and Witkin 1998, as ARCSim has it):
//! A Δv = b with
//!   A = M - Σ dt (dt + c) J + dt² K_handles,
//!   b = dt f_ext + Σ dt (F + (dt + c) J v) - dt k (x_h - target + dt v_h).
//!
//! Exact handles are eliminated: they are no unknowns, and in the product J v they move with the
//! velocity that takes them to their targets, which is what their column of A would contribute.
//! The pattern of A is made once; assembling and solving allocate nothing.

use glam::{DMat3, DVec3};
use selvedge_cloth::{
    BendingLaw, Environment, HandleConstraint, Handles, Mesh, Scene, StretchLookup, VertexId,
};
use thiserror::Error;

use crate::bend::BendElement;
use crate::cholesky::{Cholesky, FactorError};
use crate::external::air_force;
use crate::pattern::Pattern;
use crate::stretch::StretchElement;
use crate::stretch_table::{ExactStiffness, GridStiffness, StretchStiffness};

/// Stiffness of a spring handle, per axis `[N/m]`.
pub(crate) const HANDLE_STIFFNESS: f64 = 1e3;

/// Positions `[m]` and velocities `[m/s]`, `[vertices]` each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    /// Positions `[m]`.
    pub(crate) positions: Vec<DVec3>,
    /// Velocities `[m/s]`.
    pub(crate) velocities: Vec<DVec3>,
}

/// Why a solve failed.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub(crate) enum SolveError {
    /// A force or a result is not finite.
    #[error("the motion of vertex {vertex} is no longer finite")]
    NonFinite {
        /// The first such vertex.
        vertex: VertexId,
    },
    /// The linear system could not be solved.
    #[error(transparent)]
    Factor(#[from] FactorError),
}

/// A face: corners in descending order of their unknowns, so that block (a, b), a ≤ b, lies in the
/// lower triangle; slots of the blocks 00, 11, 22, 01, 02, 12.
struct Face {
    corners: [u32; 3],
    slots: [u32; 6],
    element: StretchElement,
}

/// An interior edge: its corners in the order of [`BendElement`], which of them comes when in
/// descending order of unknowns, and the slots of the blocks 00, 11, 22, 33, 01, 02, 03, 12, 13, 23
/// in that order.
struct Hinge {
    corners: [u32; 4],
    descending: [u8; 4],
    slots: [u32; 10],
    element: BendElement,
}

enum StretchLaw {
    Exact(ExactStiffness),
    Grid(GridStiffness),
}

/// The system of a cloth, ready to be assembled and solved again and again.
pub(crate) struct System {
    faces: Vec<Face>,
    hinges: Vec<Hinge>,
    stretch_law: StretchLaw,
    bending: BendingLaw,
    environment: Environment,
    damping: f64,
    mass: Vec<f64>,
    handles: Handles,
    constraint: HandleConstraint,
    pattern: Pattern,
    blocks: Vec<DMat3>,
    impulses: Vec<DVec3>,
    driven: Vec<DVec3>,
    cholesky: Cholesky,
    values: Vec<f64>,
    solution: Vec<f64>,
}

/// The factors of one solve.
#[derive(Clone, Copy)]
struct Scales {
    /// dt: what turns a force into an impulse `[s]`.
    force: f64,
    /// dt (dt + c): what turns a Jacobian into a mass `[s²]`.
    jacobian: f64,
}

impl System {
    /// The system of a scene that has been validated.
    pub(crate) fn new(scene: &Scene) -> Result<Self, FactorError> {
        let mesh = &scene.mesh;
        let constraint = scene.physics.handles;
        let vertex_count = mesh.topology().vertex_count();
        let held = match constraint {
            HandleConstraint::Exact => scene.handles.mask(vertex_count),
            HandleConstraint::Spring => vec![false; vertex_count],
        };
        let triangles = mesh.topology().face_indices();
        let stencils = hinge_stencils(mesh);
        let pattern = Pattern::new(&held, &triangles, &stencils)?;
        let (starts, rows) = pattern.scalar_columns();
        let values = vec![0.0; rows.len()];
        let cholesky = Cholesky::new(starts, rows)?;
        let uv = mesh.material_coordinates();
        let table = scene.material.stretch;
        Ok(Self {
            faces: triangles
                .iter()
                .map(|&corners| face(mesh, &pattern, corners))
                .collect(),
            hinges: stencils
                .iter()
                .map(|&corners| {
                    let rest = corners.map(|v| uv[v as usize]);
                    hinge(
                        &pattern,
                        corners,
                        BendElement::new(&scene.material.bend, rest),
                    )
                })
                .collect(),
            stretch_law: match scene.physics.stretch_lookup {
                StretchLookup::Exact => StretchLaw::Exact(ExactStiffness::new(table)),
                StretchLookup::Grid => StretchLaw::Grid(GridStiffness::new(table)),
            },
            bending: scene.physics.bending,
            environment: scene.environment,
            damping: scene.material.damping,
            mass: mesh.rest_shape(scene.material.density).vertex_mass,
            handles: scene.handles.clone(),
            constraint,
            blocks: vec![DMat3::ZERO; pattern.slot_count()],
            impulses: vec![DVec3::ZERO; vertex_count],
            driven: vec![DVec3::ZERO; vertex_count],
            solution: vec![0.0; 3 * pattern.unknown_count()],
            pattern,
            cholesky,
            values,
        })
    }

    /// Mass of each vertex `[kg]`, `[vertices]`.
    pub(crate) fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// Gravity and air from now on; its gusts are not for the system.
    pub(crate) fn set_environment(&mut self, environment: Environment) {
        self.environment = environment;
    }

    /// The vertices that are unknowns.
    pub(crate) fn unknown_vertices(&self) -> &[u32] {
        self.pattern.vertices()
    }

    /// Assembles A and b at `state` for a solve over `dt` `[s]`, handles going to `targets` `[m]`.
    pub(crate) fn assemble(&mut self, dt: f64, state: &State, targets: &[DVec3]) {
        self.driven.copy_from_slice(&state.velocities);
        if self.constraint == HandleConstraint::Exact {
            for (vertex, target) in self.handles.vertices().iter().zip(targets) {
                let v = vertex.index();
                self.driven[v] = (*target - state.positions[v]) / dt;
            }
        }
        self.blocks.fill(DMat3::ZERO);
        for (impulse, mass) in self.impulses.iter_mut().zip(&self.mass) {
            *impulse = self.environment.gravity * (mass * dt);
        }
        let unknowns = self.pattern.vertices();
        for (block, &vertex) in self.blocks.iter_mut().zip(unknowns) {
            *block = DMat3::from_diagonal(DVec3::splat(self.mass[vertex as usize]));
        }
        let scales = Scales {
            force: dt,
            jacobian: dt * (dt + self.damping),
        };
        let mut sums = Sums {
            blocks: &mut self.blocks,
            impulses: &mut self.impulses,
            driven: &self.driven,
        };
        match &self.stretch_law {
            StretchLaw::Exact(law) => sums.add_faces(&self.faces, law, state, scales),
            StretchLaw::Grid(law) => sums.add_faces(&self.faces, law, state, scales),
        }
        sums.add_air(&self.faces, &self.environment, state, scales);
        sums.add_hinges(&self.hinges, self.bending, state, scales);
        if self.constraint == HandleConstraint::Spring {
            self.add_springs(dt, state, targets);
        }
    }

    fn add_springs(&mut self, dt: f64, state: &State, targets: &[DVec3]) {
        for (vertex, target) in self.handles.vertices().iter().zip(targets) {
            let v = vertex.index();
            let unknown = self.pattern.unknown(vertex.0) as usize;
            let stiffness = DVec3::splat(dt * dt * HANDLE_STIFFNESS);
            self.blocks[unknown] += DMat3::from_diagonal(stiffness);
            let predicted = state.positions[v] + state.velocities[v] * dt;
            self.impulses[v] -= (predicted - *target) * (dt * HANDLE_STIFFNESS);
        }
    }

    /// The assembled right side b `[N s]`, `[vertices]`; that of held vertices has no use.
    pub(crate) fn impulses(&self) -> &[DVec3] {
        &self.impulses
    }

    /// Solves what was assembled; the answer is read by [`Self::velocity_changes`].
    pub(crate) fn solve(&mut self) -> Result<(), SolveError> {
        for (entry, &vertex) in self
            .solution
            .chunks_exact_mut(3)
            .zip(self.pattern.vertices())
        {
            let impulse = self.impulses[vertex as usize];
            if !impulse.is_finite() {
                return Err(SolveError::NonFinite {
                    vertex: VertexId(vertex),
                });
            }
            entry.copy_from_slice(&impulse.to_array());
        }
        self.pattern.expand(&self.blocks, &mut self.values);
        self.cholesky.solve(&self.values, &mut self.solution)?;
        Ok(())
    }

    /// Each unknown vertex and its Δv `[m/s]` of the last solve.
    pub(crate) fn velocity_changes(&self) -> impl Iterator<Item = (usize, DVec3)> {
        self.pattern
            .vertices()
            .iter()
            .zip(self.solution.chunks_exact(3))
            .map(|(&vertex, change)| (vertex as usize, DVec3::from_slice(change)))
    }

    /// Moves `state` by one solve over `dt` `[s]`, handles to `targets` `[m]`; on an error it is
    /// unusable and the caller restores it.
    pub(crate) fn advance(
        &mut self,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        self.assemble(dt, state, targets);
        self.solve()?;
        for (v, change) in self.velocity_changes() {
            let velocity = state.velocities[v] + change;
            state.velocities[v] = velocity;
            state.positions[v] += velocity * dt;
            if !(velocity.is_finite() && state.positions[v].is_finite()) {
                return Err(SolveError::NonFinite {
                    vertex: VertexId(v as u32),
                });
            }
        }
        if self.constraint == HandleConstraint::Exact {
            for (vertex, target) in self.handles.vertices().iter().zip(targets) {
                state.velocities[vertex.index()] = self.driven[vertex.index()];
                state.positions[vertex.index()] = *target;
            }
        }
        Ok(())
    }
}

/// What elements add to.
struct Sums<'a> {
    blocks: &'a mut [DMat3],
    impulses: &'a mut [DVec3],
    driven: &'a [DVec3],
}

impl Sums<'_> {
    fn add_faces(
        &mut self,
        faces: &[Face],
        law: &impl StretchStiffness,
        state: &State,
        scales: Scales,
    ) {
        const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        for face in faces {
            let corners = face.corners.map(|v| state.positions[v as usize]);
            let response = face.element.respond(law, corners);
            let rates = face.corners.map(|v| self.driven[v as usize]);
            let resisting = response.negative_jacobian_times(rates);
            for ((vertex, force), resisting) in
                face.corners.iter().zip(response.force()).zip(resisting)
            {
                self.impulses[*vertex as usize] +=
                    force * scales.force - resisting * scales.jacobian;
            }
            for (slot, (row, column)) in face.slots.iter().zip(PAIRS) {
                self.blocks[*slot as usize] +=
                    response.negative_jacobian(row, column) * scales.jacobian;
            }
        }
    }

    fn add_air(
        &mut self,
        faces: &[Face],
        environment: &Environment,
        state: &State,
        scales: Scales,
    ) {
        for face in faces {
            let positions = face.corners.map(|v| state.positions[v as usize]);
            let velocities = face.corners.map(|v| state.velocities[v as usize]);
            let third = air_force(environment, face.element.area, positions, velocities)
                * (scales.force / 3.0);
            for vertex in face.corners {
                self.impulses[vertex as usize] += third;
            }
        }
    }

    fn add_hinges(&mut self, hinges: &[Hinge], law: BendingLaw, state: &State, scales: Scales) {
        const PAIRS: [(usize, usize); 10] = [
            (0, 0),
            (1, 1),
            (2, 2),
            (3, 3),
            (0, 1),
            (0, 2),
            (0, 3),
            (1, 2),
            (1, 3),
            (2, 3),
        ];
        for hinge in hinges {
            let corners = hinge.corners.map(|v| state.positions[v as usize]);
            let mut response = hinge.element.respond(law, corners);
            let rates = hinge.corners.map(|v| self.driven[v as usize]);
            let resisting = response.negative_jacobian_times(rates);
            for ((vertex, force), resisting) in
                hinge.corners.iter().zip(response.force()).zip(resisting)
            {
                self.impulses[*vertex as usize] +=
                    force * scales.force - resisting * scales.jacobian;
            }
            let gradient = response.gradient;
            response.gradient = hinge.descending.map(|k| gradient[usize::from(k)]);
            response.stiffness *= scales.jacobian;
            for (slot, (row, column)) in hinge.slots.iter().zip(PAIRS) {
                self.blocks[*slot as usize] += response.negative_jacobian(row, column);
            }
        }
    }
}

/// Corners of every interior edge in the order of [`BendElement`].
fn hinge_stencils(mesh: &Mesh) -> Vec<[u32; 4]> {
    mesh.topology()
        .edges()
        .iter()
        .filter_map(|edge| {
            let right = edge.opposite.1?;
            let [from, to] = edge.vertices;
            Some([from.0, to.0, edge.opposite.0.0, right.0])
        })
        .collect()
}

fn face(mesh: &Mesh, pattern: &Pattern, mut corners: [u32; 3]) -> Face {
    corners.sort_by_key(|&v| std::cmp::Reverse(pattern.unknown(v)));
    let [a, b, c] = corners;
    let rest = corners.map(|v| mesh.material_coordinates()[v as usize]);
    Face {
        corners,
        slots: [(a, a), (b, b), (c, c), (a, b), (a, c), (b, c)].map(|(a, b)| pattern.slot(a, b)),
        element: StretchElement::new(rest),
    }
}

fn hinge(pattern: &Pattern, corners: [u32; 4], element: BendElement) -> Hinge {
    let mut descending = [0_u8, 1, 2, 3];
    descending.sort_by_key(|&k| std::cmp::Reverse(pattern.unknown(corners[usize::from(k)])));
    let [a, b, c, d] = descending.map(|k| corners[usize::from(k)]);
    let pairs = [
        (a, a),
        (b, b),
        (c, c),
        (d, d),
        (a, b),
        (a, c),
        (a, d),
        (b, c),
        (b, d),
        (c, d),
    ];
    Hinge {
        corners,
        descending,
        slots: pairs.map(|(a, b)| pattern.slot(a, b)),
        element,
    }
}

#[cfg(test)]
mod tests;
