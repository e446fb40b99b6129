//! The push of a fabric under pressure, which does not depend on mesh, mass or time step: the curve of its
//! material, times the area that a pair stands for. The barrier below it is the guarantee.

use glam::DVec3;
use selvedge_cloth::Scene;
use selvedge_contact::{Kind, Pair};

use super::barrier::Tangent;
use super::narrow_phase::ClosePair;
use super::real::Real;

/// Gap, as a part of that at which the push begins, below which it goes on straight.
const CRUSHED: f64 = 0.15;

/// Time in which a fabric that lies still comes to bear what presses it `[s]`.
const SETTLING: f64 = 0.5;

/// The compression of what has not lain still yet: below 0, so that it bears nothing for a while, which is the
/// longer the less it is pressed.
pub(super) const UNPRESSED: f64 = -0.4;

/// Time in which two sides that open would part, from which they count as parting `[s]`. What swings would else
/// come to bear just before it parts, and be pushed off each time.
const PARTS: f64 = 0.25;

/// Speed of two sides from which it does not come to bear more `[m/s]`: what falls or slides presses nothing.
const SLOW: f64 = 0.005;

/// Pressure from which friction holds as firmly as the fabric does `[Pa]`; below, as its inertia asks.
const FIRM: f64 = 15.0;

/// Cosine of two directions from which a vertex between them is squeezed.
const OPPOSITE: f64 = -0.5;

/// Part of a corner in the closest point of a face from which what presses there presses the corner.
const BORNE: f64 = 0.2;

/// Of pairs that stand for no area: the part of the thickness at which they begin to bear, with which
/// pressure over e - 1 of what they are near `[Pa]`, and by which power of e it rises to no gap. They bear
/// where cloth is pulled over a rim or a point, and bear nothing where the vertices around do.
const RIM: f64 = 0.1;
const RIM_PRESSURE: f64 = 500.0;
const RIM_RISE: f64 = 6.0;

/// The push of a pair under pressure: at a gap g it is f₀ (exp(s (1 - g/b)) - 1), b being the gap at which
/// it begins. `[eq:contact-pressure]`
#[derive(Clone, Copy, Debug)]
pub(super) struct Pressure<N = f64> {
    /// f₀ `[N]`.
    least: f64,
    /// s.
    rise: f64,
    /// b, as a part of the thickness.
    begin: f64,
    /// Force from which friction holds firmly `[N]`.
    firm: f64,
    /// True if it bears slowly what lies still, and not what falls: its push does not grow beyond `pressed`.
    pub(super) is_slow: bool,
    /// Compression up to which it bore slowly at the end of the last substep, as a part of b.
    pub(super) pressed: N,
}

impl Pressure {
    /// Of nothing.
    pub(super) const NONE: Self = Self {
        least: 0.0,
        rise: 1.0,
        begin: 0.0,
        firm: f64::INFINITY,
        is_slow: false,
        pressed: 0.0,
    };

    /// That of half the area.
    fn halved(self) -> Self {
        Self {
            least: 0.5 * self.least,
            firm: 0.5 * self.firm,
            ..self
        }
    }

    /// That of cloth which no bodies squeeze.
    fn slow(self) -> Self {
        Self {
            firm: f64::INFINITY,
            is_slow: true,
            ..self
        }
    }

    /// True if what lies still has come to bear.
    pub(super) fn bears_slowly(&self) -> bool {
        self.is_slow && self.pressed > 0.0
    }

    /// The same, with another number for what it has come to bear.
    pub(super) fn with<N>(self, pressed: N) -> Pressure<N> {
        Pressure {
            least: self.least,
            rise: self.rise,
            begin: self.begin,
            firm: self.firm,
            is_slow: self.is_slow,
            pressed,
        }
    }
}

impl<N: Real> Pressure<N> {
    /// Compression up to which the fabric bears after `time` `[s]` at the end of which a pair of this
    /// `thickness` has this `gap` `[m]`, having moved by `way` and opened by `opened` `[m]`. `[eq:contact-pressed]`
    pub(super) fn pressed_after(
        &self,
        time: f64,
        [way, opened]: [N; 2],
        gap: N,
        thickness: f64,
    ) -> N {
        let [zero, one] = [0.0, 1.0].map(|value| gap.same(value));
        let now = (one - gap / gap.same(thickness)).at_least(0.0);
        let slow = (one - way / gap.same(SLOW * time)).at_least(0.0);
        let parts = (now * (thickness * time / PARTS)).below(opened);
        let waits = self.pressed.below(zero) && (slow.within(zero) || parts);
        if self.begin < 1.0 || waits {
            return gap.same(UNPRESSED);
        }
        let more = slow * (now - self.pressed).at_least(0.0) * (time / SETTLING);
        now.smaller(self.pressed + more)
    }

    /// The tangent of the force at `gap` `[m]` of a pair of this `thickness` `[m]`.
    pub(super) fn tangent(&self, gap: N, thickness: f64) -> Tangent<N> {
        let begin = gap.same(self.begin * thickness);
        if begin.within(gap) || self.is_slow && self.pressed.within(gap.same(0.0)) {
            return Tangent::none(gap);
        }
        let mut at = gap.at_least(CRUSHED * self.begin * thickness);
        if self.is_slow {
            at = at.greater((gap.same(1.0) - self.pressed) * begin);
        }
        let grown = ((gap.same(1.0) - at / begin) * self.rise).exp() * self.least;
        let force = grown - self.least;
        // What is pressed slowly resists no further before it has come to.
        let (gap, firm) = if self.is_slow { (gap, force) } else { (at, grown) };
        Tangent {
            gap,
            force,
            stiffness: firm * self.rise / begin,
        }
    }

    /// The same of a pair that begins at `gap` `[m]`, if it is pressed firmly there.
    pub(super) fn firm(&self, gap: N, thickness: f64) -> Option<Tangent<N>> {
        let tangent = self.tangent(gap, thickness);
        let is_firm = gap.same(self.firm).below(tangent.force);
        is_firm.then_some(tangent)
    }
}

/// Cloth that bodies squeeze.
pub(super) struct Squeeze {
    /// Push of each vertex, `[vertices]`.
    pressures: Vec<Pressure>,
    /// Mean mass per area of the cloth `[kg/m²]`.
    density: f64,
    /// Which are squeezed between bodies, and a side from which one pushes, `[vertices]`.
    squeezed: Vec<bool>,
    sides: Vec<DVec3>,
}

impl Squeeze {
    /// None yet, of a scene whose vertices have this `mass` `[kg]`.
    pub(super) fn of(scene: &Scene, mass: &[f64]) -> Self {
        let (materials, of_face) = scene.materials();
        let constants: Vec<_> = materials
            .iter()
            .map(|material| material.compression.constants())
            .collect();
        let mut sums = vec![[0.0; 3]; mass.len()];
        let faces = scene.mesh.topology().faces().iter();
        for ((face, shape), number) in faces.zip(scene.mesh.pattern().faces()).zip(of_face) {
            let [a, b, c] = shape;
            let third = (b - a).perp_dot(c - a).abs() / 6.0;
            let [least, rise] = constants[number];
            for vertex in face {
                let sum = &mut sums[vertex.index()];
                for (sum, part) in sum.iter_mut().zip([1.0, least, rise]) {
                    *sum += third * part;
                }
            }
        }
        let all: f64 = sums.iter().map(|[area, ..]| area).sum();
        let pressures = sums.iter().map(|[area, least, rise]| Pressure {
            least: *least,
            rise: rise / area,
            begin: 1.0,
            firm: FIRM * area,
            ..Pressure::NONE
        });
        Self {
            pressures: pressures.collect(),
            density: mass.iter().sum::<f64>() / all,
            squeezed: vec![false; mass.len()],
            sides: vec![DVec3::ZERO; mass.len()],
        }
    }

    /// Sees which vertices of the cloth are squeezed: bodies push them from two opposite sides, as the
    /// fingers of a hand do, themselves or through layers of cloth. What lies, hangs or falls on one bears
    /// softly, with the barrier alone.
    pub(super) fn see<'a>(&mut self, near: impl Iterator<Item = &'a ClosePair>) {
        self.squeezed.fill(false);
        self.sides.fill(DVec3::ZERO);
        let mut layers = Vec::new();
        for near in near.filter(|near| near.pair.kind == Kind::VertexFace) {
            if near.body == 0 {
                layers.push(near);
                continue;
            }
            for (corner, weight) in near.pair.corners.iter().zip(near.gap.weights) {
                self.press(*corner, near.gap.normal * weight.signum());
            }
        }
        let mut goes_on = true;
        while std::mem::take(&mut goes_on) {
            for near in &layers {
                let (vertex, face) = (near.pair.corners[0], &near.pair.corners[1..]);
                let weights = &near.gap.weights[1..];
                let borne = || face.iter().zip(weights).filter(|(_, w)| w.abs() >= BORNE);
                for side in self.pushes(vertex, -near.gap.normal).into_iter().flatten() {
                    for (corner, _) in borne() {
                        goes_on |= self.press(*corner, side);
                    }
                }
                for (corner, _) in borne() {
                    for side in self.pushes(*corner, near.gap.normal).into_iter().flatten() {
                        goes_on |= self.press(vertex, side);
                    }
                }
            }
        }
    }

    /// Notes that a body pushes a vertex of the cloth from this side. Returns true if that is new.
    fn press(&mut self, vertex: u32, side: DVec3) -> bool {
        let vertex = vertex as usize;
        match self.sides.get_mut(vertex) {
            Some(first) if *first == DVec3::ZERO => *first = side,
            Some(first) if first.dot(side) < OPPOSITE && !self.squeezed[vertex] => {
                self.squeezed[vertex] = true;
            }
            _ => return false,
        }
        true
    }

    /// The pushes of bodies on a vertex that go on along this direction: those of its sides.
    fn pushes(&self, vertex: u32, along: DVec3) -> [Option<DVec3>; 2] {
        let first = self.sides[vertex as usize];
        let second = if self.squeezed[vertex as usize] { -first } else { DVec3::ZERO };
        [first, second].map(|side| (side.dot(along) > -OPPOSITE).then_some(side))
    }

    /// The push of a pair of this mean mass `[kg]` and direction under pressure, before any of it has come to bear
    /// slowly: each vertex bears for its own area. Of two layers each bears on the other, by half.
    pub(super) fn push(
        &self,
        pair: &Pair,
        body: usize,
        is_of_core: bool,
        mean_mass: f64,
        normal: DVec3,
    ) -> Pressure {
        let is_squeezed = |corner: &u32| self.squeezed.get(*corner as usize) == Some(&true);
        let own = pair.corners[0] as usize;
        if body == 0 {
            let is_across = || self.sides[own].dot(normal).abs() > -OPPOSITE;
            let is_between = || pair.corners[1..].iter().any(is_squeezed) && is_across();
            return match pair.kind {
                Kind::VertexFace if self.squeezed[own] && is_between() => {
                    self.pressures[own].halved()
                }
                Kind::VertexFace => self.pressures[own].slow().halved(),
                Kind::EdgeEdge => Pressure::NONE,
            };
        }
        if !pair.corners.iter().any(is_squeezed) {
            return match pair.kind {
                Kind::VertexFace if own < self.pressures.len() => self.pressures[own].slow(),
                // There are two faces to a vertex.
                Kind::VertexFace if is_of_core => {
                    self.pressures[pair.corners[1] as usize].slow().halved()
                }
                _ => Pressure::NONE,
            };
        }
        match pair.kind {
            Kind::VertexFace if own < self.pressures.len() => self.pressures[own],
            _ => Pressure {
                least: RIM_PRESSURE * mean_mass / self.density,
                rise: RIM_RISE,
                begin: RIM,
                ..Pressure::NONE
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::barrier::Barrier;
    use super::*;

    const LYING: Pressure = Pressure {
        least: 2e-4,
        rise: 13.8,
        begin: 1.0,
        firm: f64::INFINITY,
        is_slow: true,
        pressed: 0.2,
    };

    const SQUEEZED: Pressure = Pressure {
        firm: 1e-2,
        is_slow: false,
        pressed: 0.0,
        ..LYING
    };

    /// What is expected without a push does not know of the other body. A side that was left out for that let
    /// cloth be pressed out, by 72 µm across and 2.9 mm along.
    #[test]
    fn what_two_bodies_squeeze_is_borne_by_both_whatever_is_expected() {
        let barrier = Barrier {
            thickness: 1e-3,
            base: 1.3,
            share: 1.0,
            inertia: 1.3,
            pressure: SQUEEZED,
            recovery: 2.4,
        };
        let start = 3e-4;
        let [still, parting] = [start, 2e-3].map(|expected| barrier.linearise(start, expected));
        assert_eq!(still, parting);
        assert!(still.force_at(start) > SQUEEZED.tangent(start, 1e-3).force);
    }

    #[test]
    fn what_lies_still_comes_to_bear_and_what_moves_does_not() {
        let (time, gap, thickness) = (1.0 / 60.0, 5e-4, 1e-3);
        let after = |way: f64, gap: f64| LYING.pressed_after(time, [way, 0.0], gap, thickness);
        let more = (1.0 - gap / thickness - 0.2) * time / SETTLING;
        assert!((after(0.0, gap) - 0.2 - more).abs() < 1e-15);
        assert!((after(0.5 * SLOW * time, gap) - 0.2 - 0.5 * more).abs() < 1e-15);
        assert_eq!(after(1e-3, gap), 0.2, "it slides");
        assert!(
            (after(0.0, 9e-4) - 0.1).abs() < 1e-15,
            "it bears no more than there is"
        );
        assert_eq!(after(0.0, 2e-3), 0.0);
        let waits = Pressure {
            pressed: -0.05,
            ..LYING
        };
        let waits =
            |way: f64, opened: f64| waits.pressed_after(time, [way, opened], gap, thickness);
        let parting = 0.5 * thickness * time / PARTS;
        assert!(waits(0.0, 0.0) > -0.05 && waits(0.0, 0.9 * parting) > -0.05);
        assert_eq!(waits(0.0, 1.1 * parting), UNPRESSED, "it is about to part");
        assert_eq!(waits(1e-3, 0.0), UNPRESSED);
        let none = Pressure::NONE.pressed_after(time, [0.0; 2], gap, thickness);
        assert_eq!(none, UNPRESSED);
    }

    #[test]
    fn what_lies_deep_bears_as_much_as_it_has_come_to() {
        let thickness = 1e-3;
        let curve = 2e-4 * ((13.8_f64 * 0.2).exp() - 1.0);
        for gap in [1e-4, 5e-4, 8e-4] {
            let at = LYING.tangent(gap, thickness);
            assert!((at.force / curve - 1.0).abs() < 1e-12, "{gap}");
        }
        assert!(LYING.tangent(9e-4, thickness).force < 0.3 * curve);
        let falls = Pressure {
            pressed: 0.0,
            ..LYING
        };
        assert_eq!(falls.tangent(1e-4, thickness).stiffness, 0.0);
    }

    #[test]
    fn the_tangent_is_that_of_the_curve() {
        let (thickness, pressure) = (1e-3, SQUEEZED);
        let curve = |gap: f64| 2e-4 * ((13.8 * (1.0 - gap / thickness)).exp() - 1.0);
        for gap in [2e-4, 5e-4, 9e-4] {
            let at = pressure.tangent(gap, thickness);
            assert!((at.force / curve(gap) - 1.0).abs() < 1e-12);
            let slope = (curve(gap - 1e-9) - curve(gap + 1e-9)) / 2e-9;
            assert!((at.stiffness / slope - 1.0).abs() < 1e-6, "{gap}");
            assert_eq!(
                pressure.firm(gap, thickness).is_some(),
                curve(gap) > 1e-2,
                "{gap}"
            );
        }
        assert_eq!(pressure.tangent(1.1e-3, thickness).stiffness, 0.0);
        assert_eq!(Pressure::NONE.tangent(0.0, thickness).force, 0.0);
    }
}
