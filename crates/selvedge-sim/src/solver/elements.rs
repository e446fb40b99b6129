//! The faces and hinges of a cloth with their impulses and matrix products.
//!
//! Each element is evaluated into a place of its own. Then each vertex (here) or each block of the
//! matrix ([`crate::solver::blocks`]) gathers from the elements around it, in a fixed order. So any
//! number of threads gives the same bytes. Nothing is allocated after construction.

use glam::{DVec2, DVec3};
use selvedge_cloth::{EdgeSide, ElasticLaw, Environment, Material, Mesh, Scene};

use crate::laws::bend::{BendElement, BendResponse, HingeSide};
use crate::laws::external::{AirResistance, AirResponse, air_response};
use crate::laws::stretch::{StretchElement, StretchLaw, StretchResponse};
use crate::laws::stretch_energy::StretchEnergy;
use crate::laws::stretch_table::GridStiffness;
use crate::lists::Lists;
use crate::threads::Threads;

/// A face with its corners.
pub(crate) struct Face {
    pub(crate) corners: [u32; 3],
    element: StretchElement,
    /// Number of its material.
    material: u32,
}

/// An interior edge with its corners in the order of [`BendElement`].
pub(crate) struct Hinge {
    pub(crate) corners: [u32; 4],
    element: BendElement,
    /// Stiffness-proportional damping `[s]`: the mean of its two faces'. `[eq:hinge-damping]`
    damping: f64,
}

/// A law for each material.
enum StretchLaws {
    Energy(Vec<StretchEnergy>),
    Grid(Vec<GridStiffness>),
}

/// Responses of a face at the last evaluation: of its material and of the air.
#[derive(Clone, Copy, Default)]
pub(crate) struct FaceResponse {
    pub(crate) stretch: StretchResponse,
    pub(crate) air: AirResponse,
    /// Factor from its Jacobian to a mass `[s²]`: dt (dt + c), c its damping.
    pub(crate) jacobian: f64,
}

/// Response of a hinge at the last evaluation.
#[derive(Clone, Copy, Default)]
pub(crate) struct HingeResponse {
    pub(crate) bend: BendResponse,
    /// Factor from its Jacobian to a mass `[s²]`: dt (dt + c), c its damping.
    pub(crate) jacobian: f64,
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
    fn jacobian(&self, damping: f64) -> f64 {
        self.dt * (self.dt + damping)
    }

    /// Factor from the Jacobian times `rates` to an impulse `[s²]`, for a damping of c `[s]`.
    #[inline(always)]
    fn rate(&self, damping: f64) -> f64 {
        self.dt * (self.ahead + damping)
    }
}

/// The faces of a cloth, evaluated.
pub(crate) struct Faces {
    pub(crate) faces: Vec<Face>,
    pub(crate) responses: Vec<FaceResponse>,
    /// Impulse on each corner `[N s]`.
    impulses: Vec<[DVec3; 3]>,
    /// Stiffness-proportional damping of each material `[s]`.
    damping: Vec<f64>,
}

/// The hinges of a cloth, evaluated.
pub(crate) struct Hinges {
    pub(crate) hinges: Vec<Hinge>,
    pub(crate) responses: Vec<HingeResponse>,
    /// Impulse of a hinge along its angle's gradient.
    impulses: Vec<f64>,
    law: ElasticLaw,
}

/// All elements of a cloth.
pub(crate) struct Elements {
    pub(crate) faces: Faces,
    pub(crate) hinges: Hinges,
    stretch_laws: StretchLaws,
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
        let shapes = mesh.pattern().faces();
        let faces: Vec<Face> = mesh
            .topology()
            .face_indices()
            .into_iter()
            .zip(shapes)
            .zip(&material_of)
            .map(|((corners, shape), &material)| Face {
                corners,
                element: StretchElement::new(shape),
                material: material as u32,
            })
            .collect();
        let damping = materials.iter().map(|m| scene.physics.damping(m.damping));
        let damping: Vec<f64> = damping.collect();
        let hinges = hinges(scene, &materials, &material_of, &damping);
        let vertex_count = mesh.topology().vertex_count();
        let tables = materials.iter().map(|material| material.stretch);
        Self {
            faces_of: Lists::group(vertex_count, &incidence(faces.iter().map(|f| f.corners))),
            hinges_of: Lists::group(vertex_count, &incidence(hinges.iter().map(|h| h.corners))),
            faces: Faces {
                responses: vec![FaceResponse::default(); faces.len()],
                impulses: vec![[DVec3::ZERO; 3]; faces.len()],
                faces,
                damping,
            },
            hinges: Hinges {
                responses: vec![HingeResponse::default(); hinges.len()],
                impulses: vec![0.0; hinges.len()],
                hinges,
                law: scene.physics.law,
            },
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
        let air = &self.environment;
        let faces = &mut self.faces;
        match (&self.stretch_laws, at.stiffening) {
            (StretchLaws::Energy(laws), _) => faces.evaluate::<_, true>(laws, threads, air, at),
            (StretchLaws::Grid(laws), false) => faces.evaluate::<_, false>(laws, threads, air, at),
            (StretchLaws::Grid(laws), true) => faces.evaluate::<_, true>(laws, threads, air, at),
        }
        self.hinges.evaluate(threads, at);
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
            sum += self.faces.impulses[(entry >> 2) as usize][(entry & 3) as usize];
        }
        for &entry in self.hinges_of.of(v) {
            let (hinge, corner) = ((entry >> 2) as usize, (entry & 3) as usize);
            sum += self.hinges.responses[hinge].bend.gradient[corner] * self.hinges.impulses[hinge];
        }
        sum
    }

    /// `product` = (M - dt (dt + c) J + dt D_air) `vector` of the last evaluation, `[vertices]`
    /// each, without a matrix.
    pub(crate) fn multiply(&mut self, threads: Threads, vector: &[DVec3], product: &mut [DVec3]) {
        let dt = self.dt;
        let (faces, responses) = (&self.faces.faces, &self.faces.responses);
        threads.each(&mut self.faces.impulses, |k, pushes| {
            let vectors = select(vector, &faces[k].corners);
            let response = &responses[k];
            let resisting = response.stretch.negative_jacobian_times(vectors);
            let air = response.air.resist(vectors[0] + vectors[1] + vectors[2]) * (dt / 9.0);
            for (push, resisting) in pushes.iter_mut().zip(resisting) {
                *push = resisting * response.jacobian + air;
            }
        });
        let (hinges, bent) = (&self.hinges.hinges, &self.hinges.responses);
        threads.each(&mut self.hinges.impulses, |k, push| {
            let HingeResponse { bend, jacobian } = &bent[k];
            let rate = bend.rate(select(vector, &hinges[k].corners));
            *push = bend.tangent * jacobian * rate;
        });
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
        let stretched = self.faces.faces.iter().map(|face| {
            let strain = face.element.strain(select(positions, &face.corners));
            face.element.area * laws[face.material as usize].energy(strain)
        });
        let hinges = self.hinges.hinges.iter();
        let bent = hinges.map(|hinge| hinge.element.energy(select(positions, &hinge.corners)));
        Some(stretched.sum::<f64>() + bent.sum::<f64>())
    }

    /// dt of the last evaluation `[s]`.
    pub(crate) fn time_step(&self) -> f64 {
        self.dt
    }
}

impl Hinges {
    fn evaluate(&mut self, threads: Threads, at: Linearisation<'_>) {
        let (hinges, law) = (&self.hinges, self.law);
        threads.each_pair(&mut self.responses, &mut self.impulses, |k, bent, push| {
            let Hinge {
                corners,
                element,
                damping,
            } = &hinges[k];
            let bend = element.respond(law, select(at.positions, corners));
            let rate = bend.rate(select(at.rates, corners));
            let damped = at.rate(*damping) * rate;
            *push = -bend.stiffness * (at.dt * bend.angle + damped)
                - (bend.tangent - bend.stiffness) * damped;
            *bent = HingeResponse {
                bend,
                jacobian: at.jacobian(*damping),
            };
        });
    }
}

impl Faces {
    /// Evaluates the faces; with a Jacobian that knows how the stiffness grows if `STIFFENING`.
    fn evaluate<L: StretchLaw + Sync, const STIFFENING: bool>(
        &mut self,
        laws: &[L],
        threads: Threads,
        environment: &Environment,
        at: Linearisation<'_>,
    ) {
        let (faces, damping) = (&self.faces, &self.damping);
        threads.each_pair(
            &mut self.responses,
            &mut self.impulses,
            |k, response, pushes| {
                let Face {
                    corners,
                    element,
                    material,
                } = &faces[k];
                let (law, damping) = (&laws[*material as usize], damping[*material as usize]);
                let places = select(at.positions, corners);
                let stretch = element.respond(law, STIFFENING, places);
                let air = air_response(
                    environment,
                    at.air_resistance,
                    element.area,
                    places,
                    select(at.air_velocities, corners),
                );
                let resisting = stretch.negative_jacobian_times(select(at.rates, corners));
                let third = air.force * (at.dt / 3.0);
                let rate = at.rate(damping);
                let force = stretch.force();
                for (push, (force, resisting)) in pushes.iter_mut().zip(force.iter().zip(resisting))
                {
                    *push = *force * at.dt - resisting * rate + third;
                }
                *response = FaceResponse {
                    stretch,
                    air,
                    jacobian: at.jacobian(damping),
                };
            },
        );
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
    let interior = topology.edges().iter().enumerate();
    interior
        .filter_map(|(number, edge)| {
            let (left, right) = pattern.sides(edge);
            let (right, opposite) = (right?, edge.opposite.1?);
            let is_seam = pattern.is_seam(edge);
            let side = |side: EdgeSide<DVec2>| HingeSide {
                table: &materials[material_of[side.face.index()]].bend,
                along: side.ends[1] - side.ends[0],
                area: side.area(),
            };
            let [one, other] = [&left, &right].map(|s| damping[material_of[s.face.index()]]);
            let element = BendElement::across([side(left), side(right)])
                .resting_at(mesh.rest_angles().get(number).copied().unwrap_or(0.0))
                .stiffened(if is_seam { mesh.seam_stiffness() } else { 1.0 });
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

/// Corners of every interior edge in the order of [`BendElement`].
pub(crate) fn hinge_stencils(mesh: &Mesh) -> Vec<[u32; 4]> {
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
