//! rapier-cloth-core: by XPBD (edges and hinges), or by its implicit shell.
//!
//! Damping is its own (exponential, of velocities) and left at 0: it has none that is proportional
//! to stiffness. The ball is not a mesh: every vertex near it has a plane of its own.

use anyhow::Result;
use rapier_cloth_core::{
    Cloth, ClothContactSettings, ClothError, ClothMaterial, ClothMesh, CollisionWork, Contact,
    ContactKey, ContactMotion, ContactSource, ContactStage, ImplicitSettings, ShellMaterial,
    Solver, SolverSettings, SurfaceContact, SurfaceContactKey, SurfaceFeature, Vec3,
};

use crate::{Mover, scene::Scene};

/// Distance of the vertices from the ball, m.
const GAP: f64 = 1e-3;
/// Distance beyond the gap at which the implicit barrier acts, m.
const MARGIN: f64 = 1e-3;

pub struct Sheet {
    cloth: Cloth,
    solver: Solver,
    ball: Ball,
    gravity: Vec3,
    rate: f64,
    substeps: usize,
}

impl Sheet {
    pub fn new(scene: &Scene, substeps: usize, implicit: bool) -> Result<Self> {
        let mut cloth = cloth(scene)?;
        for &vertex in &scene.held {
            cloth.pin(vertex, cloth.positions()[vertex as usize])?;
        }
        if implicit {
            cloth.set_contact_settings(Some(ClothContactSettings {
                thickness: GAP,
                activation_margin: MARGIN,
                self_collision: false,
                rigid_surface_collision: true,
                static_friction: scene.friction,
                kinetic_friction: scene.friction,
                ..Default::default()
            }))?;
            cloth.set_implicit_solver(Some(ImplicitSettings {
                material: ShellMaterial {
                    youngs_modulus: scene.youngs_modulus,
                    poisson_ratio: scene.poissons_ratio,
                    thickness: scene.thickness,
                    ..Default::default()
                },
                ..Default::default()
            }))?;
        }
        Ok(Self {
            cloth,
            solver: Solver::new(),
            ball: Ball {
                radius: scene.ball,
                friction: scene.friction,
                implicit,
            },
            gravity: -Vec3::Y * scene.gravity,
            rate: scene.rate,
            substeps,
        })
    }
}

impl Mover for Sheet {
    fn frame(&mut self) -> Result<Vec<[f32; 3]>> {
        let step = 1.0 / (self.rate * self.substeps as f64);
        for _ in 0..self.substeps {
            let settings = SolverSettings::default();
            self.solver.step_with_contacts(
                &mut self.cloth,
                step,
                self.gravity,
                &settings,
                &[],
                &mut self.ball,
            )?;
        }
        let positions = self.cloth.positions().iter();
        Ok(positions.map(|p| p.to_array().map(|x| x as f32)).collect())
    }
}

/// The sheet with springs and hinges of their own compliance each (the implicit shell has its own).
fn cloth(scene: &Scene) -> Result<Cloth> {
    let points = scene.positions.iter().map(|&p| Vec3::from(p)).collect();
    let mut mesh = ClothMesh::new(points, scene.faces.clone())?;
    let edges = scene.edges();
    let of = |[a, b]: [u32; 2]| &edges[&[a.min(b), a.max(b)]];
    mesh.scale_edge_compliance(|edge| 1.0 / scene.spring(of(edge.vertices)))?;
    mesh.scale_hinge_stiffness(|hinge| {
        let [a, b, ..] = hinge.vertices;
        scene.hinge(of([a, b]))
    })?;
    let material = ClothMaterial {
        surface_density: scene.density,
        stretch_compliance: 1.0,
        bend_compliance: 1.0,
        damping: 0.0,
        friction: scene.friction,
        contact_radius: GAP,
        ..Default::default()
    };
    Ok(Cloth::new(mesh, material)?)
}

/// The ball about the origin.
struct Ball {
    radius: Option<f64>,
    friction: f64,
    implicit: bool,
}

impl Ball {
    /// Vertices nearer to the ball than `reach`, and the points of the ball below them.
    fn near(&self, positions: &[Vec3], reach: f64) -> Vec<(u32, Vec3, Vec3)> {
        let Some(radius) = self.radius else {
            return Vec::new();
        };
        let numbered = positions.iter().zip(0..);
        let near = numbered.filter(|(p, _)| p.length() < radius + reach);
        near.map(|(p, vertex)| (vertex, p.normalize(), p.normalize() * radius))
            .collect()
    }
}

impl ContactSource for Ball {
    fn continuous_motion(&self) -> bool {
        self.implicit
    }

    /// The part of the motion before a vertex comes nearer to the ball than nine tenths of the gap.
    fn motion_fraction(
        &mut self,
        motion: ContactMotion<'_>,
        _work: &mut CollisionWork,
    ) -> Result<f64, ClothError> {
        let Some(radius) = self.radius else {
            return Ok(1.0);
        };
        let least = (radius + 0.9 * GAP).powi(2);
        let parts = motion.start.iter().zip(motion.end).map(|(&start, &end)| {
            let way = end - start;
            let (a, b, c) = (way.dot(way), start.dot(way), start.dot(start) - least);
            let discriminant = b * b - a * c;
            if b >= 0.0 || discriminant <= 0.0 {
                return 1.0;
            }
            ((-b - discriminant.sqrt()) / a).clamp(0.0, 1.0)
        });
        let first = parts.fold(1.0, f64::min);
        Ok(if first < 1.0 { 0.9 * first } else { 1.0 })
    }

    fn contacts(
        &mut self,
        _previous: &[Vec3],
        positions: &[Vec3],
        radius: f64,
        _stage: ContactStage,
        out: &mut Vec<Contact>,
    ) -> Result<(), ClothError> {
        if !self.implicit {
            let near = self.near(positions, 2.0 * radius);
            out.extend(near.into_iter().map(|(particle, normal, point)| Contact {
                key: ContactKey {
                    particle,
                    external: 0,
                    feature: 0,
                },
                normal,
                point,
                surface_velocity: Vec3::ZERO,
                friction: self.friction,
            }));
        }
        Ok(())
    }

    fn surface_contacts(
        &mut self,
        _previous: &[Vec3],
        positions: &[Vec3],
        _stage: ContactStage,
        out: &mut Vec<SurfaceContact>,
    ) -> Result<(), ClothError> {
        if self.implicit {
            let near = self.near(positions, GAP + MARGIN);
            out.extend(
                near.into_iter()
                    .map(|(particle, normal, point)| SurfaceContact {
                        key: SurfaceContactKey {
                            other_cloth: None,
                            features: [
                                SurfaceFeature::Vertex(particle),
                                SurfaceFeature::External {
                                    object: 0,
                                    feature: 0,
                                },
                            ],
                        },
                        particles: [particle, 0, 0, 0],
                        weights: [1.0, 0.0, 0.0, 0.0],
                        normal,
                        offset: point,
                        surface_velocity: Vec3::ZERO,
                        separation: GAP,
                        static_friction: self.friction,
                        kinetic_friction: self.friction,
                    }),
            );
        }
        Ok(())
    }
}
