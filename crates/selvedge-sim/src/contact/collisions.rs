//! Pairs that push in a substep, as the linear system sees them.

use glam::{DMat3, DVec3, Mat3A};
use selvedge_cloth::Touching;
use selvedge_contact::Gap;

use super::barrier::{Barrier, Tangent};
use super::friction::{along_surface, drag, outer};
use super::pressure::Pressure;

/// Pull from which a touch is released, as a part of its inertial stiffness times the thickness: it
/// would move the pair alone by a tenth of the thickness.
const PULL: f64 = 0.1;

/// Time in which a fabric recovers from pressure `[s]`. With none, two of 14 falls gained 1 % and 10 % of
/// their energy.
pub(super) const RECOVERY: f64 = 0.01;
/// Stiffness along the surface of a fabric under pressure, as a part of that across it.
pub(super) const SHEAR: f64 = 0.1;
/// Part of the most that friction bears from which it slid in the last substep.
const SLID: f64 = 0.98;
/// By how much friction may differ from what a solve took it to be: a part of it, a part of its inertial
/// stiffness times the thickness, and the cosine of their directions.
const NEARLY: f64 = 0.1;
const SMALL: f64 = 0.03;
const STRAIGHT: f64 = 0.98;

/// Difference of a weight from which a face meets a round body at another place.
const SAME_PLACE: f64 = 0.15;

/// Speed at which a vertex is pushed out of a body `[m/s]`, and acceleration, at most `[m/s²]`.
const OUT_SPEED: f64 = 0.25;
const OUT_PUSH: f64 = 50.0;

/// A pair that pushes, frozen for a substep: its direction and weights stay.
#[derive(Clone, Debug)]
pub(crate) struct Collision {
    /// The pair.
    pub(super) pair: Touching,
    /// Points of the pair; obstacles' are not below the number of the cloth's vertices.
    pub(super) corners: [u32; 4],
    /// Weights of the cloth's corners; 0 for those of obstacles.
    pub(super) weights: [f64; 4],
    /// Unit direction of the gap.
    pub(super) normal: DVec3,
    /// Gap at the start of the substep, along `normal` `[m]`.
    pub(super) gap: f64,
    /// ĝ `[m]`.
    pub(super) thickness: f64,
    pub(super) law: PairLaw,
    pub(super) pressure: Pressure,
    /// Mean mass of the free corners by the squares of their weights `[kg]`.
    pub(super) mean_mass: f64,
    /// Mass of the relative motion `[kg]`.
    pub(super) mass: f64,
    /// Σ w x of the cloth's corners at the start `[m]`.
    pub(super) base: DVec3,
    /// Σ w Δx of obstacles over the substep `[m]`.
    pub(super) drift: DVec3,
    /// Coefficient of friction.
    pub(super) friction: f64,
    /// True if the cloth's corners are of one edge or one face, whose vertices the matrix of the
    /// cloth couples already.
    pub(super) is_within: bool,
    /// True if a face of the cloth meets the core of a round body.
    pub(super) is_of_core: bool,
    /// Feature that has an anchor; none where friction does not hold.
    pub(super) anchored: Option<Touching>,
    /// Pull of the anchor at the start, along the surface `[N]`.
    pub(super) pull: DVec3,
    pub(super) sticking: Sticking,
    pub(super) met: Met,
    /// Gap at which to linearise, because a solve has shown that the usual one pushes too little
    /// `[m]`.
    pub(super) at: Option<f64>,
    /// Response of the last linearisation.
    pub(super) response: Response,
}

/// Law of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) enum PairLaw {
    /// The barrier, with this part of its stiffness.
    Barrier { share: f64 },
    /// A push out of a body that is let through.
    Out,
}

/// Where the direction and the weights of a pair are told.
#[derive(Clone, Copy, Debug)]
pub(super) enum Met {
    /// At the start of the substep.
    Start,
    /// Where it would meet, did the cloth go on at its velocities.
    Ahead,
    /// Where it meets on the way to the end of a solve.
    Solve,
}

/// Whether the friction of a touch sticks.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sticking {
    /// To be found by the next linearisation.
    Unknown,
    /// As the inertia of the pair tells: it is not pressed firmly.
    Light,
    Sticks,
    /// It slides, and at the end has this slip `[m]`, against this friction `[N]`.
    Slides(DVec3, f64),
}

/// A collision, linearised.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Response {
    pub(super) tangent: Tangent,
    /// Stiffness of an anchor `[N/m]`.
    pub(super) grip: f64,
    /// Mass of the relative motion over the square of the time `[N/m]`.
    inertia: f64,
    /// γ² times the derivative of the force `[kg]`.
    block: DMat3,
    /// γ `[s]`.
    pub(super) gamma: f64,
    /// Displacement of the linearisation `[m]`, and the force there `[N]`.
    displacement: DVec3,
    force: DVec3,
}

/// All collisions of a substep.
#[derive(Clone, Debug, Default)]
pub(crate) struct Collisions {
    pub(super) list: Vec<Collision>,
    /// Collisions at the begin of the list that are in the order of their corners.
    pub(super) sorted: usize,
    /// Places of the cloth's vertices at the end of the stage without a push, as its first estimate has
    /// them `[m]`, `[vertices]`; empty before.
    pub(super) expected: Vec<DVec3>,
    /// Time of the solve, by whose square barriers and anchors are stiff `[s]`: the same whichever
    /// formula serves.
    pub(super) time: f64,
}

impl Collision {
    /// Returns true if a pair with this `gap` is that of the collision and pushes about where it does: a
    /// round body that slides over a face pushes at several places of it.
    pub(super) fn is_same_place(&self, of: Touching, gap: &Gap) -> bool {
        let own = self.weights.iter().zip(gap.weights).skip(1);
        let apart = own.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        self.pair == of && (!self.is_of_core || apart < SAME_PLACE)
    }

    /// Displacement of the first side against the second since the start of the substep `[m]`.
    #[inline]
    pub(super) fn displacement(&self, cloth: impl Fn(usize) -> DVec3) -> DVec3 {
        let mut sum = self.drift - self.base;
        for (corner, weight) in self.corners.iter().zip(self.weights) {
            if weight != 0.0 {
                sum += cloth(*corner as usize) * weight;
            }
        }
        sum
    }

    /// Returns true if the touch pulled in the last solve, at whose end the points are at `place`
    /// `[m]`.
    ///
    /// The tangent of a push goes on below zero. A pair that ends farther apart than it was
    /// expected to would be held like glue, and many of them, as on a body of fine faces, would
    /// strain the cloth without bound.
    pub(super) fn pulls(&self, place: impl Fn(usize) -> DVec3) -> bool {
        if matches!(self.law, PairLaw::Out) {
            return false;
        }
        let gap = self.gap + self.normal.dot(self.displacement(place));
        let least = PULL * self.response.inertia * self.thickness;
        self.response.tangent.force_at(gap) < -least
    }

    /// Sees by the end of the last solve, with the points at `place` `[m]`, whether friction sticks. Returns
    /// true if it does not do as the solve took it to do.
    fn sees_slip(&mut self, place: impl Fn(usize) -> DVec3) -> bool {
        let Response {
            tangent,
            grip,
            inertia,
            ..
        } = self.response;
        let displacement = self.displacement(place);
        let gap = self.gap + self.normal.dot(displacement);
        let most = self.friction * tangent.force_at(gap).max(0.0);
        let small = NEARLY * most + SMALL * inertia * self.thickness;
        let slip = along_surface(self.normal, self.pull / grip + displacement);
        let force = grip * slip.length();
        let turns = |at: DVec3| slip.dot(at) < STRAIGHT * slip.length() * at.length();
        self.sticking = match self.sticking {
            Sticking::Sticks if force > most + small => Sticking::Slides(slip, most),
            Sticking::Slides(at, was) if slip.dot(at) < 0.0 || force < most - small => {
                if was < small {
                    return false;
                }
                Sticking::Sticks
            }
            Sticking::Slides(at, was)
                if (was - most).abs() > small || most > small && turns(at) =>
            {
                Sticking::Slides(slip, most)
            }
            _ => return false,
        };
        self.response = Response::default();
        true
    }

    /// Returns true if it pushes where this one of the same pair does.
    pub(super) fn is_shaped_as(&self, other: &Self) -> bool {
        self.normal == other.normal
            && self.weights == other.weights
            && self.anchored == other.anchored
    }

    /// Returns true if its friction slides as that of this one.
    pub(super) fn slides_as(&self, other: &Self) -> bool {
        match (self.sticking, other.sticking) {
            (Sticking::Slides(at, most), Sticking::Slides(own, bound)) => {
                at == own && most == bound
            }
            _ => false,
        }
    }

    /// Returns true if it couples vertices that the matrix of the cloth does not.
    fn reaches_beyond(&self) -> bool {
        !self.is_within && self.weights.iter().filter(|w| **w != 0.0).count() > 1
    }

    /// Each two of its vertices and the block that couples them `[kg]`.
    fn couplings(&self) -> impl Iterator<Item = ([u32; 2], DMat3)> + Clone {
        const TWO: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        TWO.into_iter().filter_map(|two| {
            let [a, b] = two.map(|k| self.weights[k]);
            let block = self.response.block * (a * b);
            (a * b != 0.0).then(|| (two.map(|k| self.corners[k]), block))
        })
    }

    /// Linearises the touch for a stage of γ `[s]` whose estimated end has this `displacement`, as
    /// stiff as `time` `[s]` makes it. Gives the force on the first side `[N]`.
    fn linearise(&mut self, gamma: f64, time: f64, displacement: DVec3) -> DVec3 {
        let share = match self.law {
            PairLaw::Barrier { share } => share,
            PairLaw::Out => return self.linearise_out(gamma, time, displacement),
        };
        let barrier = Barrier {
            thickness: self.thickness,
            base: self.mean_mass / (time * time),
            share,
            inertia: self.mass / (gamma * gamma),
            pressure: self.pressure,
            recovery: RECOVERY / time,
        };
        let estimate = self.gap + self.normal.dot(displacement);
        let tangent = match self.at {
            None => barrier.linearise(self.gap, estimate),
            Some(gap) => barrier.at(gap, self.gap),
        };
        let most = self.friction * barrier.bears(&tangent, self.gap, estimate);
        let inertia = self.mass / (time * time);
        let firm = self.pressure.firm(self.gap, self.thickness);
        let grip = firm.map_or(inertia, |firm| inertia.max(SHEAR * firm.stiffness));
        let slip = along_surface(self.normal, self.pull / grip + displacement);
        if matches!(self.sticking, Sticking::Unknown) {
            let slid = self.pull.length() > SLID * most;
            let needs = inertia * along_surface(self.normal, displacement).length();
            self.sticking = match firm.is_some() && self.friction > 0.0 {
                false => Sticking::Light,
                true if slid || needs > most => Sticking::Slides(slip, most),
                true => Sticking::Sticks,
            };
        }
        let drag = match self.sticking {
            Sticking::Unknown | Sticking::Light => drag(self.normal, slip, grip, most),
            Sticking::Sticks => drag(self.normal, slip, grip, f64::INFINITY),
            Sticking::Slides(at, most) => drag(self.normal, at, grip, most).moved_by(slip - at),
        };
        let block = outer(self.normal, self.normal) * tangent.stiffness + drag.block;
        let force = self.normal * tangent.force_at(estimate) + drag.force;
        self.respond([gamma, grip, inertia], displacement, tangent, block, force)
    }

    /// Keeps a response, of this `block` `[N/m]` and `force` `[N]`, and gives the force.
    fn respond(
        &mut self,
        [gamma, grip, inertia]: [f64; 3],
        displacement: DVec3,
        tangent: Tangent,
        block: DMat3,
        force: DVec3,
    ) -> DVec3 {
        self.response = Response {
            tangent,
            grip,
            inertia,
            block: block * (gamma * gamma),
            gamma,
            displacement,
            force,
        };
        force
    }

    /// The force on the first side at this `displacement` by the last linearisation `[N]`.
    pub(super) fn force_at(&self, displacement: DVec3) -> DVec3 {
        let response = &self.response;
        if response.gamma <= 0.0 {
            return DVec3::ZERO;
        }
        let further = displacement - response.displacement;
        response.force - response.block * further / (response.gamma * response.gamma)
    }

    /// As [`Self::linearise`], of a push out of a body: what is slower than [`OUT_SPEED`] is
    /// accelerated, by no more than [`OUT_PUSH`], until it is as far as the thickness outside.
    fn linearise_out(&mut self, gamma: f64, time: f64, displacement: DVec3) -> DVec3 {
        let stiffness = self.mass / (time * time);
        let along = self.normal.dot(displacement);
        let lack = (self.thickness - self.gap).clamp(0.0, OUT_SPEED * time) - along;
        let most = OUT_PUSH * time * time;
        let tangent = Tangent {
            gap: self.gap + along,
            force: stiffness * lack.clamp(0.0, most),
            stiffness: if (0.0..most).contains(&lack) { stiffness } else { 0.0 },
        };
        let force = self.normal * tangent.force;
        let block = outer(self.normal, self.normal) * tangent.stiffness;
        self.respond([gamma, 0.0, 0.0], displacement, tangent, block, force)
    }
}

impl Collisions {
    /// Returns true if nothing touches.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Returns true if a touch couples vertices.
    pub(crate) fn couple_at_all(&self) -> bool {
        let mut collisions = self.list.iter();
        collisions.any(|collision| collision.couplings().next().is_some())
    }

    /// Returns true if a touch couples vertices that the matrix of the cloth does not.
    pub(crate) fn couple(&self) -> bool {
        self.list.iter().any(Collision::reaches_beyond)
    }

    /// Sees at the end of the last solve, where the points are at `place` `[m]`, which firm collisions stick.
    /// Returns true if some do not do as the solve took them to do; the next one will.
    pub(super) fn see_slips(&mut self, place: impl Fn(usize) -> DVec3) -> bool {
        let collisions = self.list.iter_mut();
        let slipped = collisions.filter_map(|collision| collision.sees_slip(&place).then_some(()));
        slipped.count() > 0
    }

    /// Begins a stage: what is expected of its end without a push is the next estimate.
    pub(crate) fn begin_stage(&mut self) {
        self.expected.clear();
        for collision in &mut self.list {
            collision.response = Response::default();
        }
    }

    /// The same, without the places that [`Self::expect`] takes.
    pub(crate) fn without_places(&self) -> Self {
        Self {
            list: self.list.clone(),
            expected: Vec::new(),
            ..*self
        }
    }

    /// Takes what is expected of the end of the stage without a push: the places of the cloth's vertices
    /// `[m]`.
    pub(crate) fn expect(&mut self, places: impl Iterator<Item = DVec3>) {
        self.expected.extend(places);
    }

    /// Linearises the collisions for a stage of γ `[s]` whose estimated end has the cloth's `vertices` at
    /// `place` `[m]`, and adds their impulses `[N s]`. Only the first estimate tells where a pair would
    /// go without a push: tangents of the stage stay as they were made for that.
    pub(crate) fn linearise(
        &mut self,
        gamma: f64,
        vertices: usize,
        place: impl Fn(usize) -> DVec3,
        impulses: &mut [DVec3],
    ) {
        if self.expected.is_empty() {
            self.expected.extend((0..vertices).map(&place));
        }
        for collision in &mut self.list {
            if collision.response.gamma == 0.0 {
                let expected = collision.displacement(|v| self.expected[v]);
                collision.linearise(gamma, self.time, expected);
            }
            let impulse = collision.force_at(collision.displacement(&place)) * gamma;
            for (corner, weight) in collision.corners.iter().zip(collision.weights) {
                if weight != 0.0 {
                    impulses[*corner as usize] += impulse * weight;
                }
            }
        }
    }

    /// Adds `sign` times the collisions' part of the matrix times `vector` to `product`.
    pub(crate) fn multiply(&self, sign: f64, vector: &[DVec3], product: &mut [DVec3]) {
        for collision in &self.list {
            let mut sum = DVec3::ZERO;
            for (corner, weight) in collision.corners.iter().zip(collision.weights) {
                if weight != 0.0 {
                    sum += vector[*corner as usize] * weight;
                }
            }
            let resisting = collision.response.block * sum * sign;
            for (corner, weight) in collision.corners.iter().zip(collision.weights) {
                if weight != 0.0 {
                    product[*corner as usize] += resisting * weight;
                }
            }
        }
    }

    /// Each two vertices that the matrix of the cloth couples already, first each vertex with itself,
    /// and the block that touches add there `[kg]`.
    pub(crate) fn blocks_within(&self) -> impl Iterator<Item = ([u32; 2], DMat3)> {
        let diagonal = self.list.iter().flat_map(|collision| {
            let parts = collision.corners.iter().zip(collision.weights);
            parts
                .filter(|(_, weight)| *weight != 0.0)
                .map(|(corner, weight)| {
                    ([*corner; 2], collision.response.block * (weight * weight))
                })
        });
        let within = self.list.iter().filter(|collision| collision.is_within);
        diagonal.chain(within.flat_map(Collision::couplings))
    }

    /// Vertices of each touch that couples some that the matrix of the cloth does not; in the place
    /// of a corner without weight stands the first of them.
    pub(crate) fn stencils(&self) -> impl Iterator<Item = [u32; 4]> {
        let beyond = self
            .list
            .iter()
            .filter(|collision| collision.reaches_beyond());
        beyond.filter_map(|collision| {
            let has_weight = collision.weights.map(|weight| weight != 0.0);
            let first = has_weight.iter().position(|has| *has)?;
            let own = |k: usize| collision.corners[if has_weight[k] { k } else { first }];
            Some([own(0), own(1), own(2), own(3)])
        })
    }

    /// Each two vertices of a touch that the matrix of the cloth does not couple, and the block
    /// that does `[kg]`.
    pub(crate) fn couplings_beyond(&self) -> impl Iterator<Item = ([u32; 2], DMat3)> + Clone {
        let beyond = self
            .list
            .iter()
            .filter(|collision| collision.reaches_beyond());
        beyond.flat_map(Collision::couplings)
    }
}

/// `matrix`, rounded.
pub(crate) fn to_single(matrix: DMat3) -> Mat3A {
    Mat3A::from_cols(
        matrix.x_axis.as_vec3a(),
        matrix.y_axis.as_vec3a(),
        matrix.z_axis.as_vec3a(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A touch of four vertices of the cloth that slides while it comes nearer.
    fn collision(law: PairLaw, friction: f64) -> Collision {
        Collision {
            pair: Touching::Vertex {
                vertex: 0,
                other: 0,
            },
            corners: [0, 1, 2, 3],
            weights: [1.0, -0.2, -0.3, -0.5],
            normal: DVec3::new(0.3, 0.9, -0.2).normalize(),
            gap: 6e-4,
            thickness: 1e-3,
            law,
            pressure: Pressure::NONE,
            mean_mass: 2e-4,
            mass: 1.4e-4,
            base: DVec3::ZERO,
            drift: DVec3::ZERO,
            friction,
            is_within: false,
            is_of_core: false,
            anchored: None,
            pull: DVec3::ZERO,
            sticking: Sticking::Unknown,
            met: Met::Start,
            at: None,
            response: Response::default(),
        }
    }

    const LAWS: [PairLaw; 2] = [
        PairLaw::Barrier { share: 1.0 },
        PairLaw::Barrier { share: 0.3 },
    ];

    #[test]
    fn blocks_are_symmetric_and_never_push_along() {
        let gamma = 1.0 / 240.0;
        for law in LAWS {
            for friction in [0.0, 0.1, 0.6] {
                for slide in [1e-7, 1e-5, 2e-4] {
                    let mut collision = collision(law, friction);
                    collision.linearise(gamma, gamma, DVec3::new(slide, -1e-5, 0.5 * slide));
                    let block = collision.response.block;
                    let most = block.to_cols_array().into_iter().fold(0.0, f64::max);
                    let skew = block - block.transpose();
                    assert!(skew.to_cols_array().iter().all(|v| v.abs() < 1e-12 * most));
                    for k in 0..40_u32 {
                        let (a, b) = (f64::from(k), 1.7 * f64::from(k));
                        let v = DVec3::new(a.sin(), b.cos(), (a + b).sin());
                        assert!(v.dot(block * v) >= -1e-12 * most * v.length_squared());
                    }
                }
            }
        }
    }
}
