//! The two scalars that the network is written for: `f32` runs it, `f64` proves its derivatives.
//!
//! The `f32` transcendental functions are branch-free polynomials that vectorise; they use no
//! fused multiply-add, so that they give the same bits on every machine.

use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::lanes::Lanes;
use crate::network::passes::Passes;

/// A floating-point type that the network can be evaluated in.
pub trait Real:
    Lanes
    + Passes
    + Copy
    + Debug
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + SubAssign
    + Mul<Output = Self>
    + MulAssign
    + Div<Output = Self>
    + Neg<Output = Self>
    + Sum
    + 'static
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Rounds from `f64`.
    fn from_f64(value: f64) -> Self;
    /// Widens to `f64`.
    fn to_f64(self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// 1 / (1 + e^-x).
    fn sigmoid(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// The larger of the two; `self` where `other` is NaN.
    fn larger(self, other: Self) -> Self;
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;

    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    fn sigmoid(self) -> Self {
        1.0 / (1.0 + (-self).exp())
    }
    fn tanh(self) -> Self {
        self.tanh()
    }
    fn larger(self, other: Self) -> Self {
        self.max(other)
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as Self
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn sigmoid(self) -> Self {
        1.0 / (1.0 + exp(-self))
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        // Cancels near 0, where the absolute error is that of 1: about 1e-7.
        1.0 - 2.0 / (exp(2.0 * self) + 1.0)
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

/// e^x for |x| ≤ 87 (clamped beyond), relative error below 2e-7: 2^n times the Taylor series of
/// e^r, |r| ≤ ln 2 / 2, to the seventh order.
#[inline(always)]
fn exp(x: f32) -> f32 {
    const TO_NEAREST: f32 = 12_582_912.0; // 1.5 · 2^23: adding it rounds to an integer
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(-87.0, 87.0);
    let shifted = x * std::f32::consts::LOG2_E + TO_NEAREST;
    let n = shifted - TO_NEAREST;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    // Written out: a loop over the coefficients would keep the loops around it from vectorising.
    let series = (1.0 / 5040.0) * r + 1.0 / 720.0;
    let series = series * r + 1.0 / 120.0;
    let series = series * r + 1.0 / 24.0;
    let series = series * r + 1.0 / 6.0;
    let series = (series * r + 0.5) * r + 1.0;
    let series = series * r + 1.0;
    // The low bits of `shifted` hold n as an integer; moved up they are an exponent.
    let exponent = (shifted.to_bits() << 23).wrapping_add(127 << 23);
    series * f32::from_bits(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_accurate_to_two_roundings() {
        for k in -8700..=8700 {
            let x = k as f32 * 0.01;
            let exact = f64::from(x).exp();
            let relative = (f64::from(exp(x)) - exact).abs() / exact;
            assert!(relative < 2e-7, "exp({x}): relative error {relative:e}");
        }
    }

    #[test]
    fn gates_match_their_f64_versions_and_saturate() {
        for k in -4000..=4000 {
            let x = k as f32 * 0.01;
            let sigmoid = Real::sigmoid(f64::from(x));
            assert!((f64::from(Real::sigmoid(x)) - sigmoid).abs() < 2e-7);
            assert!((f64::from(Real::tanh(x)) - f64::from(x).tanh()).abs() < 2.5e-7);
        }
        assert_eq!(Real::sigmoid(f32::INFINITY), 1.0);
        assert_eq!(Real::tanh(1e30_f32), 1.0);
        assert_eq!(Real::tanh(-1e30_f32), -1.0);
    }
}
