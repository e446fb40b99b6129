//! Rapier's soft bodies: edges and hinges, by constraints or by its implicit solver (`fem`).
//!
//! Rapier gives a spring by its frequency f at the effective mass m of its ends: k = m (2π f)². A
//! frequency of its own has every edge; hinges have one for all, that of the mean hinge. Its cells
//! are tetrahedra, so a sheet has no membrane of triangles. One step per frame; a substep is one
//! of its solver iterations, and contact is found once per step.

use std::f64::consts::TAU;

use anyhow::Result;
use rapier3d::prelude::*;

use crate::{Mover, scene::Scene};

/// Skin of the sheet, m.
const RADIUS: f32 = 1e-3;

pub struct Sheet {
    world: PhysicsWorld,
    handle: SoftBodyHandle,
}

impl Sheet {
    pub fn new(scene: &Scene, substeps: usize, fem: bool) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(0.0, -scene.gravity as f32, 0.0);
        world.integration_parameters.dt = (1.0 / scene.rate) as f32;
        world.integration_parameters.num_solver_iterations = substeps;
        world.integration_parameters.soft_bodies.max_extra_substeps = 0;
        world
            .integration_parameters
            .soft_bodies
            .fem
            .max_linear_iterations = 300;
        if let Some(radius) = scene.ball {
            world.insert(
                RigidBodyBuilder::fixed(),
                ColliderBuilder::ball(radius as f32).friction(scene.friction as f32),
            );
        }
        let handle = world.insert_soft_body(body(scene, fem));
        Self { world, handle }
    }
}

impl Mover for Sheet {
    fn frame(&mut self) -> Result<Vec<[f32; 3]>> {
        self.world.step();
        let body = &self.world.soft_bodies[self.handle];
        Ok(body.particle_positions().map(|p| [p.x, p.y, p.z]).collect())
    }
}

fn body(scene: &Scene, fem: bool) -> SoftBodyBuilder {
    let (edges, masses) = (scene.edges(), scene.masses());
    let inverse = |vertex: u32| {
        let held = scene.held.contains(&vertex);
        if held {
            0.0
        } else {
            1.0 / masses[vertex as usize]
        }
    };
    let points = |p: &[f64; 3]| Vector::new(p[0] as f32, p[1] as f32, p[2] as f32);
    let mut builder = SoftBodyBuilder::new(scene.positions.iter().map(points).collect())
        .masses(masses.iter().map(|&m| m as f32).collect())
        .pinned_particles(scene.held.iter().copied())
        .edges(edges.keys().copied().collect())
        .surface(scene.faces.clone())
        .particle_radius(RADIUS)
        .surface_collider(ColliderBuilder::ball(0.1).friction(scene.friction as f32))
        .self_contacts(false)
        .can_sleep(false)
        .solver(if fem {
            SoftBodySolver::Fem
        } else {
            SoftBodySolver::Constraints
        });
    let dihedrals = builder.surface_dihedrals();
    builder.edge_softness = edges
        .iter()
        .zip(0..)
        .map(|((&[a, b], edge), index)| {
            (
                index,
                softness(scene.spring(edge), inverse(a) + inverse(b), scene.damping),
            )
        })
        .collect();
    // The gradient of a hinge's angle is about 1/height at the two tips, and as much at its edge.
    let hinges: Vec<SpringCoefficients<f32>> = dihedrals
        .iter()
        .map(|&[a, b, c, d]| {
            let edge = &edges[&[a.min(b), a.max(b)]];
            let height = edge.area / edge.length;
            let inverse = [a, b, c, d].map(inverse).iter().sum::<f64>() / height.powi(2);
            softness(scene.hinge(edge), inverse, scene.damping)
        })
        .collect();
    let count = hinges.len() as f32;
    builder.material.bend_softness = SpringCoefficients::new(
        hinges.iter().map(|h| h.natural_frequency).sum::<f32>() / count,
        hinges.iter().map(|h| h.damping_ratio).sum::<f32>() / count,
    );
    builder.dihedrals(dihedrals)
}

/// The spring of stiffness k whose ends have the inverse effective mass `inverse`, damped by
/// `damping` k.
fn softness(stiffness: f64, inverse: f64, damping: f64) -> SpringCoefficients<f32> {
    let frequency = (stiffness * inverse).sqrt();
    SpringCoefficients::new((frequency / TAU) as f32, (damping * frequency / 2.0) as f32)
}
