//! A number with its derivative: code over numbers, evaluated with one, gives the derivative of its
//! result along a direction as well.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{Number, Triple, Vector};

/// A number, and its rate along a direction. A root of 0 counts as constant; comparisons are of the
/// values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<N = f64> {
    /// The number.
    pub value: N,
    /// Its derivative along the direction.
    pub rate: N,
}

/// Three of them.
pub type DualVector<N = f64> = Triple<Dual<N>>;

impl<N: Number> DualVector<N> {
    /// A vector that changes by `rate`.
    #[inline(always)]
    pub fn new(value: N::Vector, rate: N::Vector) -> Self {
        let ([x, y, z], [a, b, c]) = (value.components(), rate.components());
        let dual = |value, rate| Dual { value, rate };
        Self([dual(x, a), dual(y, b), dual(z, c)])
    }

    /// The rate.
    #[inline(always)]
    pub fn rate(self) -> N::Vector {
        N::Vector::of(self.0.map(|component| component.rate))
    }
}

impl<N: Number> Number for Dual<N> {
    type Vector = DualVector<N>;
    type Mask = N::Mask;

    #[inline(always)]
    fn same(self, value: f64) -> Self {
        Self {
            value: self.value.same(value),
            rate: self.value.same(0.0),
        }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let (value, zero) = (self.value.sqrt(), self.value.same(0.0));
        let rate = N::pick(zero.below(value), self.rate / (value * 2.0), zero);
        Self { value, rate }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        let is_negative = self.value.below(self.value.same(0.0));
        Self {
            value: self.value.abs(),
            rate: N::pick(is_negative, -self.rate, self.rate),
        }
    }

    #[inline(always)]
    fn below(self, other: Self) -> N::Mask {
        self.value.below(other.value)
    }

    #[inline(always)]
    fn within(self, other: Self) -> N::Mask {
        self.value.within(other.value)
    }

    #[inline(always)]
    fn both(self, mask: N::Mask, other: N::Mask) -> N::Mask {
        self.value.both(mask, other)
    }

    #[inline(always)]
    fn pick(mask: N::Mask, then: Self, otherwise: Self) -> Self {
        Self {
            value: N::pick(mask, then.value, otherwise.value),
            rate: N::pick(mask, then.rate, otherwise.rate),
        }
    }
}

/// An operator of duals: its value, and its rate from both sides' values and rates.
macro_rules! duals {
    ($operator: ident, $method: ident, |$a: ident, $b: ident| $rate: expr, |$n: ident, $by: ident| $scaled: expr) => {
        impl<N: Number> $operator for Dual<N> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, $b: Self) -> Self {
                let $a = self;
                Self {
                    value: $a.value.$method($b.value),
                    rate: $rate,
                }
            }
        }
        duals!($operator, $method, |$n, $by| $scaled);
    };
    ($operator: ident, $method: ident, |$n: ident, $by: ident| $scaled: expr) => {
        impl<N: Number> $operator<f64> for Dual<N> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, $by: f64) -> Self {
                let $n = self;
                Self {
                    value: $n.value.$method($by),
                    rate: $scaled,
                }
            }
        }
    };
}

duals!(Add, add, |a, b| a.rate + b.rate, |n, _by| n.rate);
duals!(Sub, sub, |a, b| a.rate - b.rate, |n, _by| n.rate);
duals!(
    Mul,
    mul,
    |a, b| a.rate * b.value + a.value * b.rate,
    |n, by| n.rate * by
);

impl<N: Number> Div for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self {
            value,
            rate: (self.rate - value * other.rate) / other.value,
        }
    }
}

impl<N: Number> Neg for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            rate: -self.rate,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::direction;

    /// Every operation of a number, in one formula.
    fn formula<N: Number>(x: N, y: N) -> N {
        let root = (x * x + y * 2.0 + 1.0).sqrt() / (y - 0.25);
        let turned = direction(root - x, x.abs() * -y + 3.0 * 0.5);
        N::pick(x.below(y), turned, root).at_least(-10.0) - x / y
    }

    #[test]
    fn rates_are_those_of_differences() {
        let step = 1e-5;
        for (x, y) in [(0.3, 0.8), (-1.2, 0.9), (2.0, 0.6), (-0.4, 3.0)] {
            for (a, b) in [(1.0, 0.0), (0.0, 1.0), (0.7, -1.3)] {
                let at = |value, rate| Dual { value, rate };
                let found = formula(at(x, a), at(y, b));
                let moved = |s: f64| formula(x + s * a, y + s * b);
                let slope = (moved(step) - moved(-step)) / (2.0 * step);
                assert_eq!(found.value, formula(x, y));
                assert!((found.rate - slope).abs() < 1e-8 * (1.0 + slope.abs()));
            }
        }
    }
}
