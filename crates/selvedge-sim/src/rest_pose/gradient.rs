//! Gradients of a rest pose, by the implicit function theorem: with F(x, θ) = 0 and K = -∂F/∂x, a value
//! g(x) has the derivative λᵀ ∂F/∂θ with K λ = ∂g/∂x.
//!
//! K is the exact derivative of the forces, with what a solve leaves out of its matrix; conjugate
//! gradients with that matrix as their preconditioner solve it.

use glam::{DVec2, DVec3};
use selvedge_cloth::{LinearSolver, Scene};

use super::start::scene_at_start;
use crate::contact::Collisions;
use crate::integrator::SolveTape;
use crate::simulator::{GradientError, check_gradient};
use crate::solver::{ElementSums, MaterialGradient, SolveError, System};
use crate::state::State;

/// Iterations at most, and the residual at which they end, relative to the right side.
const MOST_ITERATIONS: usize = 2000;
const ACCURACY: f64 = 1e-10;

/// Derivatives of a value of a rest pose.
#[derive(Clone, Debug, PartialEq)]
pub struct RestGradient {
    /// By the places of the handles that hold at the start, in their order; those of vertices that
    /// nothing holds follow.
    pub handles: Vec<DVec3>,
    /// By gravity.
    pub gravity: DVec3,
    /// By the numbers of each material, in the order of [`Scene::materials`]; 0 by the damping.
    pub materials: Vec<MaterialGradient>,
    /// By the rest angle of each edge `[1/rad]`, `[edges]`.
    pub rest_angles: Vec<f64>,
    /// By the points of the pattern `[1/m]`, `[points]`, as [`Gradient::pattern`](crate::Gradient::pattern).
    pub pattern: Vec<DVec2>,
}

/// The derivatives of a value of the rest pose of `scene`, from those `by` its `positions` `[m]`,
/// `[vertices]` each. The pose must be converged: an acceleration that is left is an error of the
/// gradient of the same order.
///
/// # Errors
/// A scene whose forces have no derivatives ([`GradientError::Scene`]); a pose that is no stable
/// equilibrium.
///
/// # Panics
/// When there are not as many positions or derivatives as vertices.
pub fn sag_gradient(
    scene: &Scene,
    positions: &[DVec3],
    by: &[DVec3],
) -> Result<RestGradient, GradientError> {
    let vertices = scene.mesh.positions().len();
    assert_eq!([positions.len(), by.len()], [vertices; 2], "vertices");
    let mut scene =
        scene_at_start(scene).map_err(|error| GradientError::Rest(error.to_string()))?;
    scene.physics.least_damping = Some(0.0);
    check_gradient(&scene)?;
    let failed = |error: SolveError| GradientError::Rest(error.to_string());
    let system = System::with_solver(&scene, LinearSolver::Cholesky).map_err(failed)?;
    let zeros = || vec![DVec3::ZERO; vertices];
    let mut equilibrium = Equilibrium {
        targets: scene.handles.select(scene.mesh.positions()),
        pose: SolveTape {
            at: State::at_rest(positions.to_vec()),
            changes: zeros().into(),
            collisions: Collisions::default(),
            came_from: Vec::new(),
        },
        nothing: zeros(),
        sums: system.elements().no_sums(),
        system,
    };
    let mut right = by.to_vec();
    for vertex in scene.handles.vertices() {
        right[vertex.index()] = DVec3::ZERO;
    }
    if equilibrium.is_spring() {
        right.copy_from_slice(by);
    }
    let multipliers = equilibrium.solve(&right)?;
    equilibrium.sums = equilibrium.system.elements().no_sums();
    let (by_places, by_targets) = equilibrium.pull(&multipliers);
    let handles = scene.handles.vertices().iter().zip(by_targets);
    let handles = handles.map(|(vertex, by_target)| {
        if equilibrium.is_spring() {
            by_target
        } else {
            by[vertex.index()] + by_places[vertex.index()]
        }
    });
    let elements = equilibrium.system.elements();
    let mut by_scene = elements.by_scene(&scene, &equilibrium.sums);
    by_scene
        .materials
        .iter_mut()
        .for_each(|by| by.damping = 0.0);
    Ok(RestGradient {
        handles: handles.collect(),
        gravity: equilibrium.sums.gravity,
        materials: by_scene.materials,
        rest_angles: by_scene.rest_angles,
        pattern: by_scene.pattern,
    })
}

/// The forces at a pose.
struct Equilibrium {
    system: System,
    targets: Vec<DVec3>,
    pose: SolveTape,
    nothing: Vec<DVec3>,
    sums: ElementSums,
}

impl Equilibrium {
    fn is_spring(&self) -> bool {
        self.system.constraint() == selvedge_cloth::HandleConstraint::Spring
    }

    /// ∂(λᵀF) by positions and by the targets of spring handles.
    fn pull(&mut self, multipliers: &[DVec3]) -> (Vec<DVec3>, Vec<DVec3>) {
        let mut by = State::at_origin(multipliers.len());
        let mut by_base = self.nothing.clone();
        let by_all = (&mut by, &mut by_base[..], &mut self.sums);
        let (pose, nothing) = (&self.pose, &self.nothing);
        let system = &self.system;
        let stiffness = system.pull_stage(1.0, nothing, pose, multipliers, by_all);
        let pulls = system.handle_vertices().iter().map(|vertex| {
            let pull = multipliers[vertex.index()] * stiffness;
            by.positions[vertex.index()] -= pull;
            pull
        });
        let pulls = pulls.collect();
        (by.positions, pulls)
    }

    /// λ with K λ = `right`, 0 at held vertices.
    fn solve(&mut self, right: &[DVec3]) -> Result<Vec<DVec3>, GradientError> {
        let failed = |error: SolveError| GradientError::Rest(error.to_string());
        let dot =
            |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
        let free = self.system.unknown_vertices().to_vec();
        let (nothing, pose) = (&self.nothing, &self.pose);
        self.system.linearise(1.0, nothing, &pose.at, &self.targets);
        let mut solution = self.nothing.clone();
        let mut residual = right.to_vec();
        let mut direction = self.nothing.clone();
        let mut last = 0.0;
        let goal = ACCURACY * dot(right, right).sqrt();
        for _ in 0..MOST_ITERATIONS {
            if dot(&residual, &residual).sqrt() <= goal {
                return Ok(solution);
            }
            let solved = self.system.solve_adjoint(&residual).map_err(failed)?;
            let size = dot(&residual, &solved);
            let part = if last > 0.0 { size / last } else { 0.0 };
            last = size;
            for (direction, solved) in direction.iter_mut().zip(solved) {
                *direction = solved + *direction * part;
            }
            let (pulled, _) = self.pull(&direction);
            let curvature: f64 = free
                .iter()
                .map(|v| -pulled[*v as usize].dot(direction[*v as usize]))
                .sum();
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let step = size / curvature;
            for &v in &free {
                let v = v as usize;
                solution[v] += direction[v] * step;
                residual[v] += pulled[v] * step;
            }
        }
        Err(GradientError::Rest(
            "its stiffness is not positive: the pose is no stable equilibrium; find it with a smaller sag.tolerance".to_owned(),
        ))
    }
}
