//! Conjugate gradients (Hestenes and Stiefel 1952) for the system of a large cloth, preconditioned
//! by [`crate::solver::gauss_seidel`], or where things touch by [`crate::solver::woven`].
//!
//! The iteration runs in f32 on the scaled matrix. From time to time the residual is computed anew
//! in f64, without a matrix, and the iteration continues from it with the same direction (Clark et
//! al. 2010, "reliable updates"). So the solution has the accuracy of f64 at the memory traffic of
//! f32. The first guess is the solution of the last solve.

use glam::{DVec3, Mat3A, Vec3A};
use selvedge_cloth::{ConjugateGradients as Settings, Stop};

use crate::contact::{Collisions, to_single};
use crate::solver::SolveError;
use crate::solver::blocks::{Contributions, Singles};
use crate::solver::elements::Elements;
use crate::solver::gauss_seidel::{GaussSeidel, OVER_RELAXATION, tile_of};
use crate::solver::pattern::Pattern;
use crate::solver::woven::Woven;
use crate::threads::Threads;

/// The solver with its workspaces.
pub(crate) struct ConjugateGradients {
    settings: Settings,
    contributions: Contributions,
    singles: Singles,
    blocks: Vec<Mat3A>,
    /// The same without what touches.
    untouched: Vec<Mat3A>,
    gauss_seidel: GaussSeidel,
    /// False after a matrix whose diagonal has shown that it is not positive definite.
    is_definite: bool,
    /// Factor in the place of `gauss_seidel` where collisions couple vertices that the pattern does not.
    woven: Woven,
    is_woven: bool,
    /// Scale of the matrix in f32: 1 / the mean mass of a vertex `[1/kg]`.
    scale: f64,
    vectors: Vectors,
    residual: Vec<DVec3>,
    iterations: u32,
    stop: Stop,
}

/// Residual's size squared, and the part of the last direction in the first one.
#[derive(Clone, Copy)]
struct Start {
    size: f64,
    part: f64,
    /// Iterations of the solve at most.
    most: u32,
}

/// Vectors of the iteration in the scaled space, `[unknowns]` each.
struct Vectors {
    solution: Vec<Vec3A>,
    residual: Vec<Vec3A>,
    direction: Vec<Vec3A>,
    /// The direction, taken out of the scaled space but for its scale.
    solved: Vec<Vec3A>,
    /// The matrix times the direction.
    product: Vec<Vec3A>,
}

/// Iterations at most where collisions couple vertices. A complete factor is not slower.
const COUPLED_ITERATIONS: u32 = 500;

/// Factor by which the residual falls before it is computed anew. Rounding in f32 is well below.
const CYCLE: f64 = 1e-4;
/// Ratio (squared) of the residual computed anew to its estimate up to which the iteration goes on
/// as one. Beyond, the estimate had lost touch, and the iteration begins anew along the residual.
const TRUSTED: f64 = 4.0;
/// Ratio (squared) of a residual computed anew to the last one above which no more accuracy can be
/// gained.
const STUCK: f64 = 0.25;

/// Sizes (squared) of the residual over the iterations between two that were computed anew.
#[derive(Clone, Copy)]
struct Cycle {
    start: f64,
    /// Estimates before and after the last iteration.
    before_end: f64,
    end: f64,
}

impl ConjugateGradients {
    /// A solver for matrices of this pattern.
    pub(crate) fn new(settings: Settings, pattern: &Pattern, elements: &Elements) -> Self {
        let zeros = || vec![Vec3A::ZERO; pattern.unknown_count()];
        let mass: f64 = elements.mass.iter().sum();
        Self {
            settings,
            contributions: Contributions::new(pattern, elements),
            singles: Singles::new(elements),
            blocks: vec![Mat3A::ZERO; pattern.slot_count()],
            untouched: Vec::new(),
            gauss_seidel: GaussSeidel::new(tile_of(pattern.unknown_count()), pattern),
            is_definite: true,
            scale: elements.mass.len() as f64 / mass,
            vectors: Vectors {
                solution: zeros(),
                residual: zeros(),
                direction: zeros(),
                solved: zeros(),
                product: zeros(),
            },
            residual: vec![DVec3::ZERO; elements.mass.len()],
            woven: Woven::default(),
            is_woven: false,
            iterations: 0,
            stop: Stop::default(),
        }
    }

    /// Lets solves end with an error from when `stop` is wanted.
    pub(crate) fn stop_by(&mut self, stop: Stop) {
        self.stop = stop;
    }

    /// Iterations of the last solve.
    pub(crate) fn iterations(&self) -> u32 {
        self.iterations
    }

    /// Gathers the matrix from evaluated elements, with springs (vertex, `[kg]`) on its diagonal,
    /// and its preconditioner. Without those it is that of the last time, but for what
    /// collisions; something touched then.
    pub(crate) fn prepare(
        &mut self,
        threads: Threads,
        pattern: &Pattern,
        gathered: Option<(&Elements, impl Iterator<Item = (u32, f64)>)>,
        collisions: &Collisions,
    ) {
        let _span = tracing::trace_span!("preconditioner").entered();
        if let Some((elements, springs)) = gathered {
            self.contributions.gather_single(
                threads,
                elements,
                self.scale,
                &mut self.singles,
                &mut self.blocks,
            );
            for (vertex, stiffness) in springs {
                let added =
                    Mat3A::from_diagonal(glam::Vec3::splat((stiffness * self.scale) as f32));
                self.blocks[pattern.unknown(vertex) as usize] += added;
            }
            if !collisions.is_empty() {
                self.untouched.clear();
                self.untouched.extend_from_slice(&self.blocks);
            }
        } else {
            self.blocks.copy_from_slice(&self.untouched);
        }
        for ([a, b], block) in collisions.blocks_within() {
            if let Some(slot) = pattern.slot(a, b) {
                self.blocks[slot as usize] += to_single(block * self.scale);
            }
        }
        self.is_woven = collisions.couple();
        if self.is_woven {
            let (couplings, scale) = (collisions.couplings_beyond(), self.scale);
            self.woven
                .factorise(pattern, &self.blocks, couplings, scale);
        } else {
            self.is_definite = self.gauss_seidel.take(threads, &self.blocks);
        }
    }

    /// Solves A Δv = b. `changes` `[m/s]`, `[vertices]`, is the first guess of Δv and becomes the
    /// solution; `residual_of` gives r = b - A Δv, `[vertices]`.
    ///
    /// The solve ends at √(rᵀ P⁻¹ r / Σ m) ≤ tolerance, P the preconditioner. P is near A, so this
    /// is the error of Δv in the norm of A; because A ⪰ M, it is no less than the root mean square
    /// of the velocities' error. `[eq:solver-tolerance]`
    pub(crate) fn solve(
        &mut self,
        threads: Threads,
        pattern: &Pattern,
        changes: &mut [DVec3],
        mut residual_of: impl FnMut(&[DVec3], &mut [DVec3]),
    ) -> Result<(), SolveError> {
        let _span = tracing::trace_span!("iterations").entered();
        self.iterations = 0;
        if !(self.is_woven || self.is_definite) {
            return Err(self.indefinite());
        }
        // In the scaled space a residual of this size is an error of 1 m/s everywhere.
        let unit = changes.len() as f64;
        // What is near A is P/(2 - ω).
        let unit = if self.is_woven { unit } else { unit / (2.0 - f64::from(OVER_RELAXATION)) };
        let goal = self.settings.tolerance * self.settings.tolerance * unit;
        let most = if self.is_woven {
            self.settings.max_iterations.min(COUPLED_ITERATIONS)
        } else {
            self.settings.max_iterations
        };
        let mut last: Option<Cycle> = None;
        loop {
            residual_of(changes, &mut self.residual);
            let size = self.take_residual(threads, pattern);
            if size <= goal {
                return Ok(());
            }
            if !size.is_finite() {
                return Err(SolveError::Failed(format!(
                    "the residual is not finite after iteration {}: the targets or the state are too large",
                    self.iterations
                )));
            }
            let is_stuck = last.is_some_and(|last| size > STUCK * last.start);
            if is_stuck || self.iterations >= most {
                return Err(self.not_converged((size / unit).sqrt()));
            }
            let truthful = last.filter(|last| size <= TRUSTED * last.end);
            let part = truthful.map_or(0.0, |last| size / last.before_end);
            let cycle_goal = goal.max(size * CYCLE * CYCLE);
            let start = Start { size, part, most };
            let cycle = self.cycle(threads, start, cycle_goal)?;
            self.give_solution(threads, pattern, changes);
            if cycle.end <= goal {
                return Ok(());
            }
            last = Some(cycle);
        }
    }

    /// The solve needs more iterations than allowed, or more accuracy than f32 gives; `error` is that
    /// of the velocities `[m/s]`.
    fn not_converged(&self, error: f64) -> SolveError {
        let (iterations, tolerance) = (self.iterations, self.settings.tolerance);
        SolveError::Failed(format!(
            "after {iterations} iterations of conjugate gradients velocities are still wrong by {error:.1e} m/s, tolerance is {tolerance:.1e}; raise tolerance or max_iterations in physics.solver, or choose \"cholesky\""
        ))
    }

    /// The matrix is not positive in some direction.
    fn indefinite(&self) -> SolveError {
        SolveError::Failed(format!(
            "the matrix is not positive definite, as iteration {} has found",
            self.iterations
        ))
    }

    /// Iterates from a residual of size squared `size` until its estimate is at most `goal`, or
    /// until the iterations are used up. The first direction has `part` of the last one.
    fn cycle(&mut self, threads: Threads, start: Start, goal: f64) -> Result<Cycle, SolveError> {
        let Start {
            size,
            mut part,
            most,
        } = start;
        self.vectors.solution.fill(Vec3A::ZERO);
        let (mut before, mut now) = (size, size);
        while now > goal && self.iterations < most {
            if self.stop.is_wanted() {
                let iterations = self.iterations;
                return Err(SolveError::Stopped { iterations });
            }
            self.turn(threads, part);
            before = now;
            now = match self.iterate(threads, now) {
                Some(now) => now,
                None => return Err(self.indefinite()),
            };
            part = now / before;
        }
        Ok(Cycle {
            start: size,
            before_end: before,
            end: now,
        })
    }

    /// Rounds and scales the f64 residual. Gives its size squared.
    fn take_residual(&mut self, threads: Threads, pattern: &Pattern) -> f64 {
        let entries = &mut self.vectors.residual;
        for (entry, vertex) in entries.iter_mut().zip(pattern.vertices()) {
            *entry = (self.residual[*vertex as usize] * self.scale).as_vec3a();
        }
        if self.is_woven {
            self.woven.solve_lower(entries);
        } else {
            for (entry, scaling) in entries.iter_mut().zip(self.gauss_seidel.scaling()) {
                *entry = *scaling * *entry;
            }
            self.gauss_seidel.solve_lower(threads, entries);
        }
        length_squared(entries)
    }

    /// Computes the next direction: residual + `part` · direction. Without a part, a direction that
    /// is not finite is forgotten.
    fn turn(&mut self, threads: Threads, part: f64) {
        let part = part as f32;
        let Vectors {
            residual,
            direction,
            solved,
            ..
        } = &mut self.vectors;
        if part == 0.0 {
            direction.fill(Vec3A::ZERO);
        }
        for ((direction, residual), solved) in direction.iter_mut().zip(residual).zip(&mut *solved)
        {
            *direction = *residual + *direction * part;
            *solved = *direction;
        }
        if self.is_woven {
            self.woven.solve_upper(solved);
        } else {
            self.gauss_seidel.solve_upper(threads, solved);
        }
    }

    /// Does one iteration from a residual of size squared `size`. Gives the next size squared; none
    /// if the matrix is not positive definite or a number is not finite.
    fn iterate(&mut self, threads: Threads, size: f64) -> Option<f64> {
        self.iterations += 1;
        let Vectors {
            solution,
            residual,
            direction,
            solved,
            product,
        } = &mut self.vectors;
        if self.is_woven {
            self.woven.multiply(solved, product);
        } else {
            self.gauss_seidel
                .multiply(threads, direction, solved, product);
        }
        let curvature = dot(direction, product);
        if curvature.is_nan() || curvature <= 0.0 {
            return None;
        }
        let step = (size / curvature) as f32;
        let mut next = 0.0;
        let both = solution.iter_mut().zip(residual).zip(direction);
        for (((solution, residual), direction), product) in both.zip(product) {
            *solution += *direction * step;
            *residual -= *product * step;
            next += f64::from(residual.length_squared());
        }
        next.is_finite().then_some(next)
    }

    /// Adds the solution of the iteration to `changes`.
    fn give_solution(&mut self, threads: Threads, pattern: &Pattern, changes: &mut [DVec3]) {
        let solution = &mut self.vectors.solution;
        if self.is_woven {
            self.woven.solve_upper(solution);
        } else {
            self.gauss_seidel.solve_upper(threads, solution);
            for (entry, scaling) in solution.iter_mut().zip(self.gauss_seidel.scaling()) {
                *entry = scaling.transpose() * *entry;
            }
        }
        for (entry, vertex) in solution.iter().zip(pattern.vertices()) {
            changes[*vertex as usize] += entry.as_dvec3();
        }
    }
}

fn dot(a: &[Vec3A], b: &[Vec3A]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.dot(*b))).sum()
}

fn length_squared(a: &[Vec3A]) -> f64 {
    dot(a, a)
}
