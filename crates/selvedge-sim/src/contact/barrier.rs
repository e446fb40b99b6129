//! The push of a gap that is too small: a cubic barrier with a stiffness tied to mass over time
//! squared, so that it stays in proportion to the rest of the system.

use super::pressure::Pressure;

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
pub(super) struct Barrier {
    /// ĝ, the gap at which the push begins `[m]`.
    pub(super) thickness: f64,
    /// κ: mean mass of the pair's corners, by the squares of their weights, over dt² `[N/m]`.
    pub(super) base: f64,
    /// Part of κ that the pair has, above 0; at least [`AT_SPEED`] where it would go below
    /// [`LEAST`].
    pub(super) share: f64,
    /// Mass of the pair's relative motion over γ² `[N/m]`.
    pub(super) inertia: f64,
    /// The push of the fabric under pressure.
    pub(super) pressure: Pressure,
    /// Time in which the fabric recovers from pressure, over that of the solve.
    pub(super) recovery: f64,
}

/// A force that falls linearly with the gap.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Tangent {
    /// Gap of the linearisation `[m]`.
    pub(super) gap: f64,
    /// Force there `[N]`.
    pub(super) force: f64,
    /// Force per gap, not negative `[N/m]`.
    pub(super) stiffness: f64,
}

impl Tangent {
    /// The force at `gap` `[N]`; negative where the tangent pulls.
    #[inline]
    pub(super) fn force_at(&self, gap: f64) -> f64 {
        self.force + self.stiffness * (self.gap - gap)
    }
}

impl Barrier {
    /// Energy of a gap `[J]`; `[eq:contact-barrier]`.
    #[cfg(test)]
    fn energy(&self, gap: f64) -> f64 {
        let (whole, base) = (self.thickness, self.base);
        let depth = (whole - gap).max(0.0);
        if gap >= 0.5 * whole {
            return 2.0 * base / (3.0 * whole) * depth * depth * depth;
        }
        let steep = |g: f64| 0.5 * base * whole * (-whole * whole / g - 2.0 * whole * g.ln() + g);
        base * whole * whole / 12.0 + steep(0.5 * whole) - steep(gap)
    }

    /// The tangent of the barrier's force at `gap`: 2κ(ĝ - g)²/ĝ, for gaps below ĝ/2 times
    /// (ĝ/2g)², so that nothing is too heavy. Below [`STEEPEST`] the tangent there serves.
    /// `[eq:contact-barrier]`
    fn tangent(&self, gap: f64) -> Tangent {
        let gap = gap.max(STEEPEST * self.thickness);
        let part = (1.0 - gap / self.thickness).max(0.0);
        if gap >= 0.5 * self.thickness {
            return Tangent {
                gap,
                force: 2.0 * self.base * part * part * self.thickness,
                stiffness: 4.0 * self.base * part,
            };
        }
        let ratio = self.thickness / gap;
        Tangent {
            gap,
            force: 0.5 * self.base * self.thickness * (ratio - 1.0) * (ratio - 1.0),
            stiffness: self.base * ratio * ratio * (ratio - 1.0),
        }
    }

    /// The gap at which the pair alone would end with this force, if it ended at `expected`
    /// without `[m]`.
    fn alone(&self, tangent: &Tangent, expected: f64) -> f64 {
        (self.inertia * expected + tangent.force_at(0.0)) / (self.inertia + tangent.stiffness)
    }

    /// The tangent for a stage that starts at gap `start` and is expected to end at `expected`
    /// without a push `[m]`: at the start, or where the pair parts, at the expected gap. Where that
    /// would let the pair alone below [`LEAST`], it is the tangent there, which does not.
    /// `[eq:contact-impact]`
    pub(super) fn linearise(&self, start: f64, expected: f64) -> Tangent {
        if let (Some(firm), true) = (self.pressure.firm(start, self.thickness), expected >= start) {
            return self.recoil(start, expected, firm);
        }
        let rest = start.max(expected).min(self.thickness);
        let usual = self.part(self.share, rest, rest);
        let least = (LEAST * self.thickness).min(start);
        if self.alone(&usual, expected) >= least {
            usual
        } else {
            self.part(self.share.max(AT_SPEED), least, rest)
        }
    }

    /// The tangent of a pair that is pressed firmly at the `start` and rests or parts: a fabric gives back
    /// little of the work that pressed it together. Nothing, where it parts faster than the fabric recoils;
    /// but of layers, what is expected without a push does not know of what presses them together.
    fn recoil(&self, start: f64, expected: f64, firm: Tangent) -> Tangent {
        let elastic = self.part(self.share, start, start);
        let tangent = Tangent {
            stiffness: elastic.stiffness + self.recovery * firm.stiffness,
            ..elastic
        };
        if tangent.force_at(expected) > 0.0 || self.pressure.is_layered {
            tangent
        } else {
            Tangent {
                gap: expected,
                ..Tangent::default()
            }
        }
    }

    /// This part of the tangent at `gap`, and of what is pressed slowly that at `rest`.
    fn part(&self, part: f64, gap: f64, rest: f64) -> Tangent {
        let whole = self.tangent(gap);
        let barrier = Tangent {
            gap: whole.gap,
            force: whole.force * part,
            stiffness: whole.stiffness * part,
        };
        self.pressed(barrier, rest)
    }

    /// This tangent, and that of the pressure at the same gap; of what is pressed slowly, at the gap `rest`
    /// and with its friction.
    fn pressed(&self, tangent: Tangent, rest: f64) -> Tangent {
        let is_slow = self.pressure.is_slow;
        let gap = if is_slow { rest } else { tangent.gap };
        let mut pressure = self.pressure.tangent(gap, self.thickness);
        if is_slow {
            pressure.gap = gap;
            pressure.stiffness *= 1.0 + self.recovery;
        }
        Tangent {
            gap: tangent.gap,
            force: tangent.force + pressure.force_at(tangent.gap),
            stiffness: tangent.stiffness + pressure.stiffness,
        }
    }

    /// The tangent at `gap`, whatever is expected.
    pub(super) fn at(&self, gap: f64, start: f64) -> Tangent {
        self.pressed(self.tangent(gap.min(self.thickness)), start)
    }

    /// The force that a pair on its way from `start` to `expected` is expected to bear `[N]`: what stops it
    /// alone, or the pressure at the start where that is more, as between two bodies.
    pub(super) fn bears(&self, tangent: &Tangent, start: f64, expected: f64) -> f64 {
        let end = self.alone(tangent, expected).min(expected.max(tangent.gap));
        let pressure = self.pressure.tangent(start, self.thickness);
        tangent.force_at(end).max(pressure.force_at(start))
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
