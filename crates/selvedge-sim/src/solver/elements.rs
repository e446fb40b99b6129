//! The faces and hinges of a cloth with their impulses and matrix products.
//!
//! Each element is evaluated into a place of its own. Then each vertex (here) or each block of the
//! matrix ([`crate::solver::blocks`]) gathers from the elements around it, in a fixed order. So any
//! number of threads gives the same bytes. Nothing is allocated after construction.

use glam::{DVec2, DVec3};
use selvedge_cloth::{EdgeSide, ElasticLaw, Environment, Material, Scene};

use crate::laws::bend::BendElement;
use crate::laws::external::AirResistance;
use crate::laws::stretch::StretchElement;
use crate::laws::stretch_energy::StretchEnergy;
use crate::laws::stretch_table::GridStiffness;
use crate::lists::Lists;
use crate::solver::faces::{Faces, Setting};
use crate::solver::hinges::{Hinge, Hinges};
use crate::threads::Threads;

pub(crate) mod backward;

/// A law for each material.
enum StretchLaws {
    Energy(Vec<StretchEnergy>),
    Grid(Vec<GridStiffness>),
}

/// The point of a linearisation and its factors.
#[derive(Clone, Copy)]
pub(crate) struct Linearisation<'a> {
    /// Factor from a force to an impulse `[s]`: dt, or γ of a stage.
    pub(crate) dt: f64,
    /// Time over which `rates` carry the elements on from `positions` `[s]`: dt where these are the
    /// start of a step, 0 where they are its end.
    pub(crate) ahead: f64,
    /// Positions of faces and hinges, also in the air `[m]`, `[vertices]`.
    pub(crate) positions: &'a [DVec3],
    /// Velocities to which the Jacobian is applied `[m/s]`, `[vertices]`.
    pub(crate) rates: &'a [DVec3],
    /// Velocities of the faces in the air `[m/s]`, `[vertices]`.
    pub(crate) air_velocities: &'a [DVec3],
    /// True for a Jacobian that knows how the stiffness grows with strain.
    pub(crate) stiffening: bool,
    /// Part of the air's force that goes into the matrix.
    pub(crate) air_resistance: AirResistance,
}

impl Linearisation<'_> {
    /// dt (dt + c), the factor from a Jacobian to a mass `[s²]`, for a damping of c `[s]`.
    #[inline(always)]
    pub(crate) fn jacobian(&self, damping: f64) -> f64 {
        self.dt * (self.dt + damping)
    }

    /// Factor from the Jacobian times `rates` to an impulse `[s²]`, for a damping of c `[s]`.
    #[inline(always)]
    pub(crate) fn rate(&self, damping: f64) -> f64 {
        self.dt * (self.ahead + damping)
    }
}

/// All elements of a cloth.
pub(crate) struct Elements {
    pub(crate) faces: Faces,
    pub(crate) hinges: Hinges,
    law: ElasticLaw,
    stretch_laws: StretchLaws,
    /// Stiffness-proportional damping of each material `[s]`.
    damping: Vec<f64>,
    environment: Environment,
    /// Mass of each vertex `[kg]`.
    pub(crate) mass: Vec<f64>,
    /// Per vertex, 4 · face + corner.
    faces_of: Lists,
    /// Per vertex, 4 · hinge + corner.
    hinges_of: Lists,
    /// dt of the last evaluation `[s]`.
    dt: f64,
}

impl Elements {
    /// The elements of a scene that has been validated.
    pub(crate) fn new(scene: &Scene) -> Self {
        let mesh = &scene.mesh;
        let (materials, material_of) = scene.materials();
        let corners = mesh.topology().face_indices();
        let elements = mesh.pattern().faces().map(StretchElement::new);
        let faces: Vec<_> = corners.into_iter().zip(elements).collect();
        let faces = Faces::new(&faces, &material_of);
        let damping = materials.iter().map(|m| scene.physics.damping(m.damping));
        let damping: Vec<f64> = damping.collect();
        let hinges = Hinges::new(&hinges(scene, &materials, &material_of, &damping));
        let vertex_count = mesh.topology().vertex_count();
        let tables = materials.iter().map(|material| material.stretch);
        Self {
            faces_of: Lists::group(vertex_count, &incidence(faces.corners())),
            hinges_of: Lists::group(vertex_count, &incidence(hinges.corners())),
            faces,
            hinges,
            law: scene.physics.law,
            damping,
            stretch_laws: match scene.physics.law {
                ElasticLaw::Energy => {
                    StretchLaws::Energy(tables.map(|t| StretchEnergy::new(&t)).collect())
                }
                ElasticLaw::Measured | ElasticLaw::Arcsim => {
                    StretchLaws::Grid(tables.map(GridStiffness::new).collect())
                }
            },
            environment: scene.environment,
            mass: scene.rest_shape().vertex_mass,
            dt: 0.0,
        }
    }

    /// Sets gravity and air for the evaluations that follow.
    pub(crate) fn set_environment(&mut self, environment: Environment) {
        self.environment = environment;
    }

    /// Evaluates every element at `at`, and sums the impulses on each vertex into `impulses` `[N
    /// s]`: dt (m g + F + F_air) + dt (ahead + c) J rates, c the damping of each element.
    pub(crate) fn evaluate(
        &mut self,
        threads: Threads,
        at: Linearisation<'_>,
        impulses: &mut [DVec3],
    ) {
        self.dt = at.dt;
        let setting = Setting {
            at,
            environment: &self.environment,
            damping: &self.damping,
        };
        match &self.stretch_laws {
            StretchLaws::Energy(laws) => self.faces.evaluate_energy(threads, laws, setting),
            StretchLaws::Grid(laws) => self.faces.evaluate(threads, laws, setting),
        }
        self.hinges.evaluate(threads, self.law, at);
        let gravity = self.environment.gravity * at.dt;
        let this = &*self;
        threads.each(impulses, |v, impulse| {
            *impulse = gravity * this.mass[v] + this.gathered(v);
        });
    }

    /// Sum of the impulses of the elements around vertex `v` `[N s]`.
    #[inline]
    fn gathered(&self, v: usize) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for &entry in self.faces_of.of(v) {
            sum += self
                .faces
                .impulse((entry >> 2) as usize, (entry & 3) as usize);
        }
        for &entry in self.hinges_of.of(v) {
            sum += self
                .hinges
                .impulse((entry >> 2) as usize, (entry & 3) as usize);
        }
        sum
    }

    /// `product` = (M - dt (dt + c) J + dt D_air) `vector` of the last evaluation, `[vertices]`
    /// each, without a matrix.
    pub(crate) fn multiply(&mut self, threads: Threads, vector: &[DVec3], product: &mut [DVec3]) {
        self.faces.multiply(threads, self.dt, vector);
        self.hinges.multiply(threads, vector);
        let this = &*self;
        threads.each(product, |v, product| {
            *product = vector[v] * this.mass[v] + this.gathered(v);
        });
    }

    /// Energy of stretching and bending at `positions` `[m]`, `[vertices]`, in J; none if the law
    /// has no energy.
    pub(crate) fn elastic_energy(&self, positions: &[DVec3]) -> Option<f64> {
        let StretchLaws::Energy(laws) = &self.stretch_laws else {
            return None;
        };
        let faces = self.faces.corners().zip(self.faces.elements());
        let stretched = faces.map(|(corners, (element, material))| {
            let strain = element.strain(select(positions, &corners));
            element.area * laws[material as usize].energy(strain)
        });
        let hinges = self.hinges.corners().zip(self.hinges.elements());
        let bent = hinges.map(|(corners, element)| element.energy(select(positions, &corners)));
        Some(stretched.sum::<f64>() + bent.sum::<f64>())
    }

    /// dt of the last evaluation `[s]`.
    pub(crate) fn time_step(&self) -> f64 {
        self.dt
    }
}

/// The entries of `vectors` at these corners. A loop: `array::map` is not always inlined.
#[inline(always)]
fn select<const N: usize>(vectors: &[DVec3], corners: &[u32; N]) -> [DVec3; N] {
    let mut selected = [DVec3::ZERO; N];
    for (entry, corner) in selected.iter_mut().zip(corners) {
        *entry = vectors[*corner as usize];
    }
    selected
}

/// The hinges of a scene's mesh, whose faces have these materials of this damping `[s]`.
fn hinges(
    scene: &Scene,
    materials: &[&Material],
    material_of: &[usize],
    damping: &[f64],
) -> Vec<Hinge> {
    let mesh = &scene.mesh;
    let (topology, pattern) = (mesh.topology(), mesh.pattern());
    let stiffness = super::even::factors(scene);
    let interior = topology.edges().iter().enumerate();
    interior
        .filter_map(|(number, edge)| {
            let (left, right) = pattern.sides(edge);
            let (right, opposite) = (right?, edge.opposite.1?);
            let side = |side: EdgeSide<DVec2>| {
                let material = material_of[side.face.index()];
                (&materials[material].bend, side)
            };
            let [one, other] = [&left, &right].map(|s| damping[material_of[s.face.index()]]);
            let element = BendElement::across([side(left), side(right)])
                .resting_at(mesh.rest_angles().get(number).copied().unwrap_or(0.0))
                .stiffened(stiffness[number]);
            let [from, to] = edge.vertices;
            let corners = [from.0, to.0, edge.opposite.0.0, opposite.0];
            Some(Hinge {
                corners,
                element,
                damping: 0.5 * (one + other),
            })
        })
        .collect()
}

/// Pairs (vertex, 4 · element + corner) of all elements with these corners.
fn incidence<const N: usize>(corners: impl Iterator<Item = [u32; N]>) -> Vec<(u32, u32)> {
    corners
        .zip(0_u32..)
        .flat_map(|(corners, element)| {
            std::array::from_fn::<_, N, _>(|corner| (corners[corner], 4 * element + corner as u32))
        })
        .collect()
}

#[cfg(test)]
mod tests;
