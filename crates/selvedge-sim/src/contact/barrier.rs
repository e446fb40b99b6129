//! The push of a gap that is too small: a cubic barrier with a stiffness tied to mass over time
//! squared, so that it stays in proportion to the rest of the system.

use super::pressure::Pressure;
use super::real::Real;

/// Least gap to which a pair that meets at speed is let, as a part of the thickness.
pub(super) const LEAST: f64 = 0.25;

/// Part of the barrier that a pair has at least where it meets at speed. With all of it two of 200
/// random scenes stopped for a strained edge; with as little as it has at rest a cloth that lies
/// crumpled took twice as long.
const AT_SPEED: f64 = 0.3;

/// Gap, as a part of the thickness, below which the barrier goes on straight: 7600 κ is as stiff as
/// the linear system bears.
const STEEPEST: f64 = 0.05;

/// The barrier of one pair in one stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Barrier<N = f64> {
    /// ĝ, the gap at which the push begins `[m]`.
    pub(super) thickness: f64,
    /// κ: mean mass of the pair's corners, by the squares of their weights, over dt² `[N/m]`.
    pub(super) base: N,
    /// Part of κ that the pair has, above 0; at least [`AT_SPEED`] where it would go below
    /// [`LEAST`].
    pub(super) share: N,
    /// Mass of the pair's relative motion over γ² `[N/m]`.
    pub(super) inertia: N,
    /// The push of the fabric under pressure.
    pub(super) pressure: Pressure<N>,
    /// Time in which the fabric recovers from pressure, over that of the solve.
    pub(super) recovery: f64,
}

/// A force that falls linearly with the gap.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Tangent<N = f64> {
    /// Gap of the linearisation `[m]`.
    pub(super) gap: N,
    /// Force there `[N]`.
    pub(super) force: N,
    /// Force per gap, not negative `[N/m]`.
    pub(super) stiffness: N,
}

impl<N: Real> Tangent<N> {
    /// Nothing, at `gap`.
    pub(super) fn none(gap: N) -> Self {
        let zero = gap.same(0.0);
        Self {
            gap,
            force: zero,
            stiffness: zero,
        }
    }

    /// The force at `gap` `[N]`; negative where the tangent pulls.
    #[inline]
    pub(super) fn force_at(&self, gap: N) -> N {
        self.force + self.stiffness * (self.gap - gap)
    }
}

impl<N: Real> Barrier<N> {
    /// The tangent of the barrier's force at `gap`: 2κ(ĝ - g)²/ĝ, for gaps below ĝ/2 times
    /// (ĝ/2g)², so that nothing is too heavy. Below [`STEEPEST`] the tangent there serves.
    /// `[eq:contact-barrier]`
    fn tangent(&self, gap: N) -> Tangent<N> {
        let gap = gap.at_least(STEEPEST * self.thickness);
        let thickness = gap.same(self.thickness);
        let half = gap.same(0.5 * self.thickness);
        if half.within(gap) {
            let part = (gap.same(1.0) - gap / thickness).at_least(0.0);
            return Tangent {
                gap,
                force: self.base * 2.0 * part * part * thickness,
                stiffness: self.base * 4.0 * part,
            };
        }
        let ratio = thickness / gap;
        Tangent {
            gap,
            force: self.base * 0.5 * thickness * (ratio - 1.0) * (ratio - 1.0),
            stiffness: self.base * ratio * ratio * (ratio - 1.0),
        }
    }

    /// The gap at which the pair alone would end with this force, if it ended at `expected`
    /// without `[m]`.
    fn alone(&self, tangent: &Tangent<N>, expected: N) -> N {
        let at_zero = tangent.force_at(expected.same(0.0));
        (self.inertia * expected + at_zero) / (self.inertia + tangent.stiffness)
    }

    /// The tangent for a stage that starts at gap `start` and is expected to end at `expected`
    /// without a push `[m]`: at the start, or where the pair parts, at the expected gap. Where that
    /// would let the pair alone below [`LEAST`], it is the tangent there, which does not.
    /// `[eq:contact-impact]`
    pub(super) fn linearise(&self, start: N, expected: N) -> Tangent<N> {
        let rests = start.within(expected);
        if let (Some(firm), true) = (self.pressure.firm(start, self.thickness), rests) {
            return self.recoil(start, firm);
        }
        let ways = [start, expected];
        let rest = start.greater(expected).at_most(self.thickness);
        let usual = self.part(self.share, rest, ways);
        let least = start.same(LEAST * self.thickness).smaller(start);
        if least.within(self.alone(&usual, expected)) {
            usual
        } else {
            self.part(self.share.at_least(AT_SPEED), least, ways)
        }
    }

    /// The tangent of a pair that is pressed firmly at the `start` and rests or parts: a fabric gives back
    /// little of the work that pressed it together. It holds whatever is expected without a push, which does
    /// not know of the body on the other side: a side that it left out would be pressed out by that one.
    fn recoil(&self, start: N, firm: Tangent<N>) -> Tangent<N> {
        let elastic = self.part(self.share, start, [start, start]);
        Tangent {
            stiffness: elastic.stiffness + firm.stiffness * self.recovery,
            ..elastic
        }
    }

    /// This part of the tangent at `gap`, with the pressure of a pair that starts at the first of these gaps
    /// and is expected at the second.
    fn part(&self, part: N, gap: N, ways: [N; 2]) -> Tangent<N> {
        let whole = self.tangent(gap);
        let barrier = Tangent {
            gap: whole.gap,
            force: whole.force * part,
            stiffness: whole.stiffness * part,
        };
        self.pressed(barrier, ways)
    }

    /// This tangent, and that of the pressure at the same gap, or of what is pressed slowly.
    fn pressed(&self, tangent: Tangent<N>, ways: [N; 2]) -> Tangent<N> {
        let pressure = if self.pressure.is_slow {
            self.pressed_slowly(ways)
        } else {
            self.pressure.tangent(tangent.gap, self.thickness)
        };
        Tangent {
            gap: tangent.gap,
            force: tangent.force + pressure.force_at(tangent.gap),
            stiffness: tangent.stiffness + pressure.stiffness,
        }
    }

    /// The tangent of what is pressed slowly: as [`Self::linearise`] has that of the barrier, and less by what
    /// the fabric loses as it opens from the `start`. Against the expected gap, that would push open what opens,
    /// and a pile would flutter for ever. Nothing, where it would pull.
    fn pressed_slowly(&self, [start, expected]: [N; 2]) -> Tangent<N> {
        let rest = start.greater(expected).at_most(self.thickness);
        let elastic = self.pressure.tangent(rest, self.thickness);
        let lost = elastic.stiffness * self.recovery;
        let tangent = Tangent {
            gap: rest,
            force: elastic.force + lost * (start - rest),
            stiffness: elastic.stiffness + lost,
        };
        let pulls = tangent.force_at(expected).below(rest.same(0.0));
        if pulls { Tangent::none(rest) } else { tangent }
    }

    /// The tangent at `gap`, whatever is expected of a pair that begins at `start`.
    pub(super) fn at(&self, gap: N, start: N) -> Tangent<N> {
        self.pressed(self.tangent(gap.at_most(self.thickness)), [start, start])
    }

    /// The force that a pair on its way from `start` to `expected` is expected to bear `[N]`: what stops it
    /// alone, or the pressure at the start where that is more, as between two bodies.
    pub(super) fn bears(&self, tangent: &Tangent<N>, start: N, expected: N) -> N {
        let most = expected.greater(tangent.gap);
        let end = self.alone(tangent, expected).smaller(most);
        let pressure = self.pressure.tangent(start, self.thickness);
        tangent.force_at(end).greater(pressure.force_at(start))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BARRIER: Barrier = Barrier {
        thickness: 1e-3,
        base: 11.5,
        share: 1.0,
        inertia: 9.0,
        pressure: Pressure::NONE,
        recovery: 0.0,
    };

    impl Barrier {
        /// Energy of a gap `[J]`; `[eq:contact-barrier]`.
        fn energy(&self, gap: f64) -> f64 {
            let (whole, base) = (self.thickness, self.base);
            let depth = (whole - gap).max(0.0);
            if gap >= 0.5 * whole {
                return 2.0 * base / (3.0 * whole) * depth * depth * depth;
            }
            let steep =
                |g: f64| 0.5 * base * whole * (-whole * whole / g - 2.0 * whole * g.ln() + g);
            base * whole * whole / 12.0 + steep(0.5 * whole) - steep(gap)
        }
    }

    #[test]
    fn force_and_stiffness_are_derivatives_of_the_energy() {
        for gap in [6e-5, 1e-4, 3e-4, 6e-4, 9e-4] {
            let at = BARRIER.tangent(gap);
            let step = 1e-5 * gap;
            let force = -(BARRIER.energy(gap + step) - BARRIER.energy(gap - step)) / (2.0 * step);
            assert!((force / at.force - 1.0).abs() < 1e-6, "{gap}");
            let force = |gap| BARRIER.tangent(gap).force;
            let slope = -(force(gap + step) - force(gap - step)) / (2.0 * step);
            assert!((slope / at.stiffness - 1.0).abs() < 1e-6, "{gap}");
        }
        assert_eq!(BARRIER.tangent(2e-3).force, 0.0);
        let half = 5e-4;
        assert!(
            (BARRIER.tangent(half).force / BARRIER.tangent(half - 1e-12).force - 1.0).abs() < 1e-8
        );
        assert!((BARRIER.energy(half) / BARRIER.energy(half - 1e-12) - 1.0).abs() < 1e-8);
    }

    #[test]
    fn a_pair_alone_does_not_meet() {
        for speed in [0.02, 0.004, 1e-4] {
            for start in [5e-3, 9e-4, 3e-4, 5e-5] {
                let tangent = BARRIER.linearise(start, start - speed);
                let end = BARRIER.alone(&tangent, start - speed);
                assert!(end > 0.0, "{start} {speed}: {end}");
            }
        }
    }

    #[test]
    fn parting_is_not_held_back() {
        let gone = BARRIER.linearise(7e-4, 4e-3);
        assert_eq!((gone.force, gone.stiffness), (0.0, 0.0));
        assert_eq!(BARRIER.linearise(7e-4, 8e-4).gap, 8e-4);
        assert_eq!(BARRIER.linearise(7e-4, 6.9e-4).gap, 7e-4);
    }
}
