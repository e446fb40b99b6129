//! The hinges of a cloth, its interior edges, evaluated in groups of neighbours in the lists: side
//! by side by [`ElasticLaw::Energy`], one by one by the other laws.

use glam::{DMat3, DVec3, Vec3A};
use pulp::{Arch, Simd, WithSimd};
use selvedge_cloth::ElasticLaw;

use crate::laws::bend::{BendElement, BendResponse};
use crate::laws::number::{
    GROUP, Lanes, LanesVector, Number, Row, Vector, gather, of_lane, of_lanes, scatter, set_lane,
};
use crate::solver::elements::Linearisation;
use crate::solver::groups::Groups;
use crate::threads::Threads;

/// An interior edge with its corners in the order of [`BendElement`].
pub(crate) struct Hinge {
    pub(crate) corners: [u32; 4],
    pub(crate) element: BendElement,
    /// Stiffness-proportional damping `[s]`: the mean of its two faces'. `[eq:hinge-damping]`
    pub(crate) damping: f64,
}

/// Hinges that are evaluated together. Those beyond the last are copies of the first.
pub(crate) struct Group {
    corners: [[u32; 4]; GROUP],
    element: [Row; 8],
    damping: Row,
}

/// What the matrix needs of a hinge at the last evaluation.
#[derive(Clone, Copy)]
pub(crate) struct HingeResponse<N: Number = f64> {
    /// ∂θ/∂x of the four corners `[1/m]`.
    pub(crate) gradient: [N::Vector; 4],
    /// The torque's derivative by the angle `[N·m]`.
    pub(crate) tangent: N,
    /// Factor from its Jacobian to a mass `[s²]`: dt (dt + c), c its damping.
    pub(crate) jacobian: N,
}

const NUMBERS: usize = 14;

/// The hinges of a cloth, evaluated.
pub(crate) type Hinges = Groups<Group, 4, NUMBERS>;

impl<N: Number> HingeResponse<N> {
    #[inline(always)]
    fn of(numbers: [N; NUMBERS]) -> Self {
        let mut gradient = [N::Vector::of([numbers[0]; 3]); 4];
        for (k, vector) in gradient.iter_mut().enumerate() {
            *vector = N::Vector::of([numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]]);
        }
        Self {
            gradient,
            tangent: numbers[12],
            jacobian: numbers[13],
        }
    }

    #[inline(always)]
    fn numbers(&self) -> [N; NUMBERS] {
        let mut numbers = [self.jacobian; NUMBERS];
        for (numbers, vector) in numbers.chunks_exact_mut(3).zip(self.gradient) {
            numbers.copy_from_slice(&vector.components());
        }
        numbers[12] = self.tangent;
        numbers
    }

    /// What is kept of a `response`, and the impulses on its corners `[N s]`.
    #[inline(always)]
    fn take(
        bend: BendResponse<N>,
        damping: N,
        at: &Linearisation<'_>,
        rates: [N::Vector; 4],
    ) -> (Self, [N::Vector; 4]) {
        let dt = damping.same(at.dt);
        let damped = dt * (damping + at.ahead) * bend.rate(rates);
        let push =
            -bend.stiffness * (dt * bend.angle + damped) - (bend.tangent - bend.stiffness) * damped;
        let response = Self {
            gradient: bend.gradient,
            tangent: bend.tangent,
            jacobian: dt * (damping + at.dt),
        };
        (response, response.along(push))
    }

    /// dt (dt + c) (-J) times one vector per corner.
    #[inline(always)]
    fn times(&self, vectors: [N::Vector; 4]) -> [N::Vector; 4] {
        let [a, b, c, d] = self.gradient;
        let rate = a.dot(vectors[0]) + b.dot(vectors[1]) + c.dot(vectors[2]) + d.dot(vectors[3]);
        let push = self.tangent * self.jacobian * rate;
        self.along(push)
    }

    #[inline(always)]
    fn along(&self, by: N) -> [N::Vector; 4] {
        let [a, b, c, d] = self.gradient;
        [a * by, b * by, c * by, d * by]
    }
}

impl HingeResponse {
    /// Block (`row`, `column`) of dt (dt + c) (-J) `[kg]`, -J = coeff/2 ∂θ ∂θᵀ. `[eq:bend-jacobian]`
    pub(crate) fn block(&self, row: usize, column: usize) -> DMat3 {
        let left = self.gradient[row] * self.tangent;
        let right = self.gradient[column];
        DMat3::from_cols(left * right.x, left * right.y, left * right.z) * self.jacobian
    }
}

impl Hinges {
    pub(crate) fn new(hinges: &[Hinge]) -> Self {
        let groups: Vec<Group> = hinges
            .chunks(GROUP)
            .map(|hinges| {
                let mut group = Group {
                    corners: [hinges[0].corners; GROUP],
                    element: hinges[0].element.numbers().map(|number| [number; GROUP]),
                    damping: [hinges[0].damping; GROUP],
                };
                for (lane, hinge) in hinges.iter().enumerate() {
                    group.corners[lane] = hinge.corners;
                    set_lane(&mut group.element, lane, hinge.element.numbers());
                    group.damping[lane] = hinge.damping;
                }
                group
            })
            .collect();
        Self::of(hinges.len(), groups)
    }

    pub(crate) fn corners(&self) -> impl Iterator<Item = [u32; 4]> {
        let corners = self.groups.iter().flat_map(|group| group.corners);
        corners.take(self.count())
    }

    pub(crate) fn elements(&self) -> impl Iterator<Item = BendElement> {
        let lanes = self.groups.iter().flat_map(|group| {
            (0..GROUP).map(|lane| BendElement::of(of_lane(&group.element, lane)))
        });
        lanes.take(self.count())
    }

    /// Damping of a hinge `[s]`.
    pub(crate) fn damping(&self, hinge: usize) -> f64 {
        self.groups[hinge / GROUP].damping[hinge % GROUP]
    }

    pub(crate) fn response(&self, hinge: usize) -> HingeResponse {
        HingeResponse::of(of_lane(&self.responses[hinge / GROUP], hinge % GROUP))
    }

    pub(crate) fn evaluate(&mut self, threads: Threads, law: ElasticLaw, at: Linearisation<'_>) {
        self.each(threads, |group, response, impulses| {
            if law == ElasticLaw::Energy {
                Arch::new().dispatch(Evaluation {
                    group,
                    at,
                    response,
                    impulses,
                });
            } else {
                group.evaluate(law, at, response, impulses);
            }
        });
    }

    /// Sets the impulses to dt (dt + c) (-J) `vector`, `[vertices]`.
    pub(crate) fn multiply(&mut self, threads: Threads, vector: &[DVec3]) {
        self.each(threads, |group, response, impulses| {
            Arch::new().dispatch(Product {
                group,
                vector,
                response,
                impulses,
            });
        });
    }

    /// Gradients of the hinges of a group in f32, times what makes the block of two corners in the
    /// matrix, times `scale`, the product of theirs.
    pub(crate) fn roots(&self, group: usize, scale: f64, roots: &mut [[Vec3A; 4]; GROUP]) {
        Arch::new().dispatch(Roots {
            response: &self.responses[group],
            scale,
            roots,
        });
    }
}

impl Group {
    fn evaluate(
        &self,
        law: ElasticLaw,
        at: Linearisation<'_>,
        response: &mut [Row; NUMBERS],
        impulses: &mut [[DVec3; 4]; GROUP],
    ) {
        for (lane, (corners, impulses)) in self.corners.iter().zip(impulses).enumerate() {
            let select = |from: &[DVec3]| corners.map(|corner| from[corner as usize]);
            let element = BendElement::of(of_lane(&self.element, lane));
            let bend = element.respond(law, select(at.positions));
            let (answer, pushes) =
                HingeResponse::take(bend, self.damping[lane], &at, select(at.rates));
            set_lane(response, lane, answer.numbers());
            *impulses = pushes;
        }
    }
}

struct Evaluation<'a> {
    group: &'a Group,
    at: Linearisation<'a>,
    response: &'a mut [Row; NUMBERS],
    impulses: &'a mut [[DVec3; 4]; GROUP],
}

impl WithSimd for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let places = gather(self.at.positions, &self.group.corners);
        let rates = gather(self.at.rates, &self.group.corners);
        let mut pushes = [[[0.0; GROUP]; 3]; 4];
        for part in 0..Lanes::<S>::PARTS {
            let element = BendElement::of(Lanes::load_all(simd, &self.group.element, part));
            let damping = Lanes::load(simd, &self.group.damping, part);
            let bend = element.respond_by_energy(Lanes::vectors(simd, &places, part));
            let rates = Lanes::vectors(simd, &rates, part);
            let (answer, push) = HingeResponse::take(bend, damping, &self.at, rates);
            Lanes::store_all(answer.numbers(), self.response, part);
            LanesVector::store_all(push, &mut pushes, part);
        }
        scatter(&pushes, self.impulses);
    }
}

struct Product<'a> {
    group: &'a Group,
    vector: &'a [DVec3],
    response: &'a [Row; NUMBERS],
    impulses: &'a mut [[DVec3; 4]; GROUP],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let vectors = gather(self.vector, &self.group.corners);
        let mut pushes = [[[0.0; GROUP]; 3]; 4];
        for part in 0..Lanes::<S>::PARTS {
            let response = HingeResponse::of(Lanes::load_all(simd, self.response, part));
            let push = response.times(Lanes::vectors(simd, &vectors, part));
            LanesVector::store_all(push, &mut pushes, part);
        }
        scatter(&pushes, self.impulses);
    }
}

struct Roots<'a> {
    response: &'a [Row; NUMBERS],
    scale: f64,
    roots: &'a mut [[Vec3A; 4]; GROUP],
}

impl WithSimd for Roots<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut rows = [[[0.0; GROUP]; 3]; 4];
        for part in 0..Lanes::<S>::PARTS {
            let response = HingeResponse::of(Lanes::load_all(simd, self.response, part));
            let root = (response.tangent * (response.jacobian * self.scale)).sqrt();
            LanesVector::store_all(response.along(root), &mut rows, part);
        }
        for (corner, rows) in rows.iter().enumerate() {
            for (lane, roots) in self.roots.iter_mut().enumerate() {
                roots[corner] = of_lanes(rows, lane);
            }
        }
    }
}
