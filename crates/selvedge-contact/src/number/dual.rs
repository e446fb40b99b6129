//! A number with its derivative: code over numbers, evaluated with one, gives the derivative of its
//! result along a direction as well.

use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::DVec3;

use super::{Number, Triple};

/// A number, and its rates along some directions. A root of 0 counts as constant; comparisons are of the
/// values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const K: usize = 1> {
    /// The number.
    pub value: f64,
    /// Its derivatives along the directions.
    pub rates: [f64; K],
}

/// Three of them.
pub type DualVector<const K: usize = 1> = Triple<Dual<K>>;

impl<const K: usize> Dual<K> {
    /// A number whose rates follow from those of this one and another.
    #[inline(always)]
    fn with(self, value: f64, other: Self, rate: impl Fn(f64, f64) -> f64) -> Self {
        let mut rates = self.rates;
        for (rate_of, other) in rates.iter_mut().zip(other.rates) {
            *rate_of = rate(*rate_of, other);
        }
        Self { value, rates }
    }

    /// A number whose rates are this many times those of this one.
    #[inline(always)]
    pub fn scaled(self, value: f64, slope: f64) -> Self {
        self.with(value, self, |rate, _| rate * slope)
    }
}

impl<const K: usize> DualVector<K> {
    /// A vector that changes by these rates.
    #[inline(always)]
    pub fn new(value: DVec3, rates: [DVec3; K]) -> Self {
        Self(std::array::from_fn(|axis| Dual {
            value: value[axis],
            rates: rates.map(|rate| rate[axis]),
        }))
    }

    /// The rates.
    #[inline(always)]
    pub fn rates(self) -> [DVec3; K] {
        std::array::from_fn(|k| DVec3::from_array(self.0.map(|component| component.rates[k])))
    }
}

impl<const K: usize> Number for Dual<K> {
    type Vector = DualVector<K>;
    type Mask = bool;

    #[inline(always)]
    fn same(self, value: f64) -> Self {
        Self {
            value,
            rates: [0.0; K],
        }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        if value > 0.0 {
            self.with(value, self, |rate, _| rate / (value * 2.0))
        } else {
            self.same(value)
        }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        if self.value < 0.0 { -self } else { self }
    }

    #[inline(always)]
    fn below(self, other: Self) -> bool {
        self.value < other.value
    }

    #[inline(always)]
    fn within(self, other: Self) -> bool {
        self.value <= other.value
    }

    #[inline(always)]
    fn both(self, mask: bool, other: bool) -> bool {
        mask & other
    }

    #[inline(always)]
    fn pick(mask: bool, then: Self, otherwise: Self) -> Self {
        if mask { then } else { otherwise }
    }
}

/// An operator of duals: its rate from both sides' values and rates, and from a number by which it goes.
macro_rules! duals {
    ($operator: ident, $method: ident, |$a: ident, $b: ident, $p: ident, $q: ident| $rate: expr, |$r: ident, $by: ident| $scaled: expr) => {
        impl<const K: usize> $operator for Dual<K> {
            type Output = Self;

            #[inline(always)]
            #[allow(clippy::suspicious_arithmetic_impl, reason = "the rate of a product")]
            fn $method(self, other: Self) -> Self {
                let ($a, $b) = (self.value, other.value);
                self.with($a.$method($b), other, |$p, $q| $rate)
            }
        }

        impl<const K: usize> $operator<f64> for Dual<K> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, $by: f64) -> Self {
                self.with(self.value.$method($by), self, |$r, _| $scaled)
            }
        }
    };
}

duals!(Add, add, |_a, _b, p, q| p + q, |r, _by| r);
duals!(Sub, sub, |_a, _b, p, q| p - q, |r, _by| r);
duals!(Mul, mul, |a, b, p, q| p * b + a * q, |r, by| r * by);

#[allow(clippy::suspicious_arithmetic_impl, reason = "the rate of a quotient")]
impl<const K: usize> Div for Dual<K> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        self.with(value, other, |p, q| (p - value * q) / other.value)
    }
}

impl<const K: usize> Neg for Dual<K> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.scaled(-self.value, -1.0)
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
                let at = |value, rate| Dual {
                    value,
                    rates: [rate, -2.0 * rate],
                };
                let found = formula(at(x, a), at(y, b));
                let moved = |s: f64| formula(x + s * a, y + s * b);
                let slope = (moved(step) - moved(-step)) / (2.0 * step);
                assert_eq!(found.value, formula(x, y));
                let [rate, other] = found.rates;
                assert!((rate - slope).abs() < 1e-8 * (1.0 + slope.abs()));
                assert!((other + 2.0 * rate).abs() < 1e-12 * (1.0 + slope.abs()));
            }
        }
    }
}
