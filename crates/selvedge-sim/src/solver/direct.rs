//! The matrix of a cloth factorised completely: for a direct solver, and with collisions in its pattern
//! what is left where conjugate gradients with them do not converge.
//!
//! Where many collisions lie side by side, stiff against what holds their pairs together, those take
//! hundreds of iterations. The factor of the whole takes no longer, half of it for its new pattern.

use glam::{DMat3, DVec3};
use selvedge_cloth::VertexId;

use crate::contact::Collisions;
use crate::solver::SolveError;
use crate::solver::blocks::{Contributions, Doubles};
use crate::solver::cholesky::Cholesky;
use crate::solver::elements::Elements;
use crate::solver::ordering::Ordering;
use crate::solver::pattern::Pattern;
use crate::threads::Threads;

/// Springs of handles, on the diagonal of A.
#[derive(Clone, Copy)]
pub(super) struct Springs<'a> {
    pub(super) vertices: &'a [VertexId],
    /// dt² k `[kg]`.
    pub(super) stiffness: f64,
}

impl<'a> Springs<'a> {
    /// Each vertex with its spring `[kg]`.
    pub(super) fn stiff(self) -> impl Iterator<Item = (u32, f64)> + 'a {
        let vertices = self.vertices.iter();
        vertices.map(move |v| (v.0, self.stiffness))
    }
}

/// A complete factor, with the room to gather its matrix.
pub(super) struct Direct {
    contributions: Contributions,
    elements: Doubles,
    pub(super) blocks: Vec<DMat3>,
    solution: Vec<DVec3>,
    cholesky: Cholesky,
}

impl Direct {
    /// A factor of matrices of this pattern.
    pub(super) fn new(pattern: &Pattern, elements: &Elements) -> Self {
        Self {
            contributions: Contributions::new(pattern, elements),
            elements: Doubles::new(elements),
            blocks: vec![DMat3::ZERO; pattern.slot_count()],
            solution: vec![DVec3::ZERO; pattern.unknown_count()],
            cholesky: Cholesky::new(pattern),
        }
    }

    /// Gathers the matrix from the evaluated `elements`, with `springs` on its diagonal.
    pub(super) fn gather(
        &mut self,
        threads: Threads,
        pattern: &Pattern,
        elements: &Elements,
        springs: Springs<'_>,
    ) {
        self.contributions
            .gather(threads, elements, &mut self.elements, &mut self.blocks);
        for vertex in springs.vertices {
            let added = DMat3::from_diagonal(DVec3::splat(springs.stiffness));
            self.blocks[pattern.unknown(vertex.0) as usize] += added;
        }
    }

    /// Adds blocks that touches have between two vertices, or on the diagonal, where the pattern has
    /// room for them.
    pub(super) fn add(
        &mut self,
        pattern: &Pattern,
        blocks: impl Iterator<Item = ([u32; 2], DMat3)>,
    ) {
        for ([a, b], block) in blocks {
            if let Some(slot) = pattern.slot(a, b) {
                self.blocks[slot as usize] += block;
            }
        }
    }

    /// Factorises, and solves for `changes`.
    pub(super) fn solve(
        &mut self,
        pattern: &Pattern,
        impulses: &[DVec3],
        changes: &mut [DVec3],
    ) -> Result<(), SolveError> {
        for (entry, &vertex) in self.solution.iter_mut().zip(pattern.vertices()) {
            *entry = impulses[vertex as usize];
        }
        self.cholesky.solve(&self.blocks, &mut self.solution)?;
        for (entry, &vertex) in self.solution.iter().zip(pattern.vertices()) {
            changes[vertex as usize] = *entry;
        }
        Ok(())
    }
}

/// The elements that couple vertices, and the factor of the last collisions.
pub(super) struct Complete {
    held: Vec<bool>,
    triangles: Vec<[u32; 3]>,
    hinges: Vec<[u32; 4]>,
    last: Option<Coupled>,
}

/// A factor whose pattern has collisions.
struct Coupled {
    collisions: Vec<[u32; 4]>,
    pattern: Pattern,
    direct: Direct,
}

/// A linear system with collisions.
pub(super) struct Coupling<'a> {
    pub(super) threads: Threads,
    pub(super) elements: &'a Elements,
    pub(super) springs: Springs<'a>,
    pub(super) collisions: &'a Collisions,
}

impl Complete {
    /// No factor yet, of a cloth whose vertices are unknowns where they are not `held`.
    pub(super) fn new(held: Vec<bool>, triangles: Vec<[u32; 3]>, hinges: Vec<[u32; 4]>) -> Self {
        Self {
            held,
            triangles,
            hinges,
            last: None,
        }
    }

    /// Solves for `changes` `[m/s]`, `[vertices]`.
    pub(super) fn solve(
        &mut self,
        system: &Coupling<'_>,
        impulses: &[DVec3],
        changes: &mut [DVec3],
    ) -> Result<(), SolveError> {
        let collisions: Vec<[u32; 4]> = system.collisions.stencils().collect();
        let coupled = match self.last.take() {
            Some(last) if last.collisions == collisions => last,
            _ => self.analyse(collisions, system.elements),
        };
        let Coupled {
            pattern, direct, ..
        } = self.last.insert(coupled);
        direct.gather(system.threads, pattern, system.elements, system.springs);
        direct.add(pattern, system.collisions.blocks_within());
        direct.add(pattern, system.collisions.couplings_beyond());
        direct.solve(pattern, impulses, changes)
    }

    fn analyse(&self, collisions: Vec<[u32; 4]>, elements: &Elements) -> Coupled {
        let mut stencils = self.hinges.clone();
        stencils.extend(&collisions);
        let order = Ordering::Dissection;
        let pattern = Pattern::new(order, &self.held, &self.triangles, &stencils);
        Coupled {
            direct: Direct::new(&pattern, elements),
            collisions,
            pattern,
        }
    }
}
