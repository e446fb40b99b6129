//! The whole matrix, its pattern with all that touches, factorised completely: for a direct solver,
//! and what is left where conjugate gradients with touches do not converge.
//!
//! Where many touches lie side by side, stiff against what holds their pairs together, those take
//! hundreds of iterations. The factor of the whole takes as long as about sixty, most of it for its
//! new pattern.

use glam::DVec3;

use crate::contact::Touches;
use crate::solver::SolveError;
use crate::solver::direct::{Direct, Springs};
use crate::solver::elements::Elements;
use crate::solver::ordering::Ordering;
use crate::solver::pattern::Pattern;
use crate::threads::Threads;

/// The elements that couple vertices, and the factor of the last touches.
pub(super) struct Complete {
    held: Vec<bool>,
    triangles: Vec<[u32; 3]>,
    hinges: Vec<[u32; 4]>,
    last: Option<Coupled>,
}

/// A factor whose pattern has touches.
struct Coupled {
    touches: Vec<[u32; 4]>,
    pattern: Pattern,
    direct: Direct,
}

/// A linear system with touches.
pub(super) struct Coupling<'a> {
    pub(super) threads: Threads,
    pub(super) elements: &'a Elements,
    pub(super) springs: Springs<'a>,
    pub(super) touches: &'a Touches,
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
        let touches: Vec<[u32; 4]> = system.touches.stencils().collect();
        let coupled = match self.last.take() {
            Some(last) if last.touches == touches => last,
            _ => self.analyse(touches, system.elements)?,
        };
        let Coupled {
            pattern, direct, ..
        } = self.last.insert(coupled);
        direct.gather(system.threads, pattern, system.elements, system.springs);
        direct.add(pattern, system.touches);
        direct.add_beyond(pattern, system.touches);
        direct.solve(pattern, impulses, changes)
    }

    fn analyse(&self, touches: Vec<[u32; 4]>, elements: &Elements) -> Result<Coupled, SolveError> {
        let mut stencils = self.hinges.clone();
        stencils.extend(&touches);
        let order = Ordering::MinimumDegree;
        let pattern = Pattern::new(order, &self.held, &self.triangles, &stencils)?;
        Ok(Coupled {
            direct: Direct::new(&pattern, elements)?,
            touches,
            pattern,
        })
    }
}
