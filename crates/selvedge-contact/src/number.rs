//! The number of a law: one element's `f64`, or as many elements' side by side as the machine's
//! vectors hold, or either with its derivative. The laws are written once, for all; the results are
//! the same bits, since no product is fused with its sum.
//!
//! Code over numbers has loops and functions that are always inlined, no closures: what is not
//! inlined is compiled without the instructions of the vectors.

use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::{DVec3, Vec3A};
use pulp::Simd;

pub use dual::{Dual, DualVector};

mod dual;

/// A number of a law.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// Three of them.
    type Vector: Vector<Self>;
    /// The answer to a comparison.
    type Mask: Copy;

    /// `value` in every lane that this number has.
    fn same(self, value: f64) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Without its sign.
    fn abs(self) -> Self;
    /// `self` < `other`, false for a NaN.
    fn below(self, other: Self) -> Self::Mask;
    /// `self` ≤ `other`, false for a NaN.
    fn within(self, other: Self) -> Self::Mask;
    /// Both are true.
    fn both(self, mask: Self::Mask, other: Self::Mask) -> Self::Mask;
    /// `then` where `mask` is true, `otherwise` elsewhere.
    fn pick(mask: Self::Mask, then: Self, otherwise: Self) -> Self;

    /// The smaller of the two; the other one where this is a NaN.
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Self::pick(self.below(other), self, other)
    }

    /// The greater of the two; the other one where this is a NaN.
    #[inline(always)]
    fn greater(self, other: Self) -> Self {
        Self::pick(other.below(self), self, other)
    }

    /// The greater of this and `least`; a NaN stays one.
    #[inline(always)]
    fn at_least(self, least: f64) -> Self {
        let least = self.same(least);
        Self::pick(self.below(least), least, self)
    }

    /// The smaller of this and `most`; a NaN stays one.
    #[inline(always)]
    fn at_most(self, most: f64) -> Self {
        let most = self.same(most);
        Self::pick(most.below(self), most, self)
    }
}

/// A vector in space.
pub trait Vector<N>:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<N, Output = Self>
    + Div<N, Output = Self>
{
    /// The vector of these components.
    fn of(components: [N; 3]) -> Self;
    /// Its components.
    fn components(self) -> [N; 3];
    /// Scalar product.
    fn dot(self, other: Self) -> N;
    /// Cross product.
    fn cross(self, other: Self) -> Self;
}

impl Number for f64 {
    type Vector = DVec3;
    type Mask = bool;

    #[inline(always)]
    fn same(self, value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn below(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn within(self, other: Self) -> bool {
        self <= other
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

impl Vector<f64> for DVec3 {
    #[inline(always)]
    fn of(components: [f64; 3]) -> Self {
        Self::from_array(components)
    }

    #[inline(always)]
    fn components(self) -> [f64; 3] {
        self.to_array()
    }

    #[inline(always)]
    fn dot(self, other: Self) -> f64 {
        self.dot(other)
    }

    #[inline(always)]
    fn cross(self, other: Self) -> Self {
        self.cross(other)
    }
}

/// Elements that are evaluated together: as many as the widest vectors have.
pub const GROUP: usize = 8;

/// One number of each element of a group.
pub type Row = [f64; GROUP];

/// Numbers side by side, of the instruction set `S`.
#[derive(Clone, Copy)]
pub struct Lanes<S: Simd> {
    simd: S,
    values: S::f64s,
}

/// Three numbers as a vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triple<N>(pub [N; 3]);

/// Three numbers side by side.
pub type LanesVector<S> = Triple<Lanes<S>>;

impl<S: Simd> Lanes<S> {
    /// Parts of a row that are loaded one after the other.
    pub const PARTS: usize = GROUP / S::F64_LANES;

    /// Part number `part` of a row.
    #[inline(always)]
    pub fn load(simd: S, row: &Row, part: usize) -> Self {
        Self {
            simd,
            values: S::as_simd_f64s(row).0[part],
        }
    }

    /// Writes part number `part` of a row.
    #[inline(always)]
    pub fn store(self, row: &mut Row, part: usize) {
        S::as_mut_simd_f64s(row).0[part] = self.values;
    }

    /// Part number `part` of several rows.
    #[inline(always)]
    pub fn load_all<const K: usize>(simd: S, rows: &[Row; K], part: usize) -> [Self; K] {
        let mut values = [Self::load(simd, &rows[0], part); K];
        for (value, row) in values.iter_mut().zip(rows) {
            *value = Self::load(simd, row, part);
        }
        values
    }

    /// Part number `part` of vectors by component.
    #[inline(always)]
    pub fn vectors<const K: usize>(
        simd: S,
        rows: &[[Row; 3]; K],
        part: usize,
    ) -> [LanesVector<S>; K] {
        let mut vectors = [Triple(Self::load_all(simd, &rows[0], part)); K];
        for (vector, rows) in vectors.iter_mut().zip(rows) {
            vector.0 = Self::load_all(simd, rows, part);
        }
        vectors
    }

    /// Writes part number `part` of several rows.
    #[inline(always)]
    pub fn store_all<const K: usize>(values: [Self; K], rows: &mut [Row; K], part: usize) {
        for (value, row) in values.into_iter().zip(rows) {
            value.store(row, part);
        }
    }

    #[inline(always)]
    fn with(self, values: S::f64s) -> Self {
        Self { values, ..self }
    }
}

impl<S: Simd> LanesVector<S> {
    /// Writes part number `part` of vectors by component.
    #[inline(always)]
    pub fn store_all<const K: usize>(vectors: [Self; K], rows: &mut [[Row; 3]; K], part: usize) {
        for (vector, rows) in vectors.into_iter().zip(rows) {
            Lanes::store_all(vector.0, rows, part);
        }
    }
}

/// The entries of `vectors` at the corners of a group, by component.
#[inline(always)]
pub fn gather<const K: usize>(vectors: &[DVec3], corners: &[[u32; K]; GROUP]) -> [[Row; 3]; K] {
    let mut rows = [[[0.0; GROUP]; 3]; K];
    for (lane, corners) in corners.iter().enumerate() {
        for ([x, y, z], corner) in rows.iter_mut().zip(corners) {
            let vector = vectors[*corner as usize];
            (x[lane], y[lane], z[lane]) = (vector.x, vector.y, vector.z);
        }
    }
    rows
}

/// The vectors of each element of a group; the inverse of [`gather`].
#[inline(always)]
pub fn scatter<const K: usize>(rows: &[[Row; 3]; K], vectors: &mut [[DVec3; K]; GROUP]) {
    for (lane, vectors) in vectors.iter_mut().enumerate() {
        for ([x, y, z], vector) in rows.iter().zip(vectors) {
            *vector = DVec3::new(x[lane], y[lane], z[lane]);
        }
    }
}

/// The numbers of one element of a group.
#[inline(always)]
pub fn of_lane<const K: usize>(rows: &[Row; K], lane: usize) -> [f64; K] {
    std::array::from_fn(|k| rows[k][lane])
}

/// The vector of one element of a group in f32.
#[inline(always)]
pub fn of_lanes(rows: &[Row; 3], lane: usize) -> Vec3A {
    let [x, y, z] = rows;
    Vec3A::new(x[lane] as f32, y[lane] as f32, z[lane] as f32)
}

/// Sets the numbers of one element of a group.
#[inline(always)]
pub fn set_lane<const K: usize>(rows: &mut [Row; K], lane: usize, values: [f64; K]) {
    for (row, value) in rows.iter_mut().zip(values) {
        row[lane] = value;
    }
}

impl<S: Simd> Number for Lanes<S> {
    type Vector = LanesVector<S>;
    type Mask = S::m64s;

    #[inline(always)]
    fn same(self, value: f64) -> Self {
        self.with(self.simd.splat_f64s(value))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.values))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.simd.abs_f64s(self.values))
    }

    #[inline(always)]
    fn below(self, other: Self) -> S::m64s {
        self.simd.less_than_f64s(self.values, other.values)
    }

    #[inline(always)]
    fn within(self, other: Self) -> S::m64s {
        self.simd.less_than_or_equal_f64s(self.values, other.values)
    }

    #[inline(always)]
    fn both(self, mask: S::m64s, other: S::m64s) -> S::m64s {
        self.simd.and_m64s(mask, other)
    }

    #[inline(always)]
    fn pick(mask: S::m64s, then: Self, otherwise: Self) -> Self {
        let simd = then.simd;
        then.with(simd.select_f64s(mask, then.values, otherwise.values))
    }
}

/// An operator of numbers side by side.
macro_rules! lanes {
    ($operator: ident, $method: ident, $call: ident) => {
        impl<S: Simd> $operator for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(self.simd.$call(self.values, other.values))
            }
        }

        impl<S: Simd> $operator<f64> for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.$method(self.same(other))
            }
        }
    };
}

lanes!(Add, add, add_f64s);
lanes!(Sub, sub, sub_f64s);
lanes!(Mul, mul, mul_f64s);
lanes!(Div, div, div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.neg_f64s(self.values))
    }
}

/// An operator of vectors by component.
macro_rules! triples {
    ($operator: ident, $method: ident, $other: ty, $by: ident => $components: expr) => {
        impl<N: Number> $operator<$other> for Triple<N> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, $by: $other) -> Self {
                let ([x, y, z], [a, b, c]) = (self.0, $components);
                Self([x.$method(a), y.$method(b), z.$method(c)])
            }
        }
    };
}

triples!(Add, add, Self, other => other.0);
triples!(Sub, sub, Self, other => other.0);
triples!(Mul, mul, N, by => [by; 3]);
triples!(Div, div, N, by => [by; 3]);

impl<N: Number> Neg for Triple<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        let [x, y, z] = self.0;
        Self([-x, -y, -z])
    }
}

impl<N: Number> Vector<N> for Triple<N> {
    #[inline(always)]
    fn of(components: [N; 3]) -> Self {
        Self(components)
    }

    #[inline(always)]
    fn components(self) -> [N; 3] {
        self.0
    }

    #[inline(always)]
    fn dot(self, other: Self) -> N {
        let ([x, y, z], [a, b, c]) = (self.0, other.0);
        x * a + y * b + z * c
    }

    #[inline(always)]
    fn cross(self, other: Self) -> Self {
        let ([x, y, z], [a, b, c]) = (self.0, other.0);
        Self([y * c - b * z, z * a - c * x, x * b - a * y])
    }
}

/// tan(π/8), up to which the arc tangent's fraction holds.
const EIGHTH: f64 = 0.414_213_562_373_095_05;

/// Numerator and denominator of (arctan(x) - x)/x³ in x², highest powers first, that meet it up to
/// [`EIGHTH`] at eight Chebyshev nodes: within 2e-17 of the angle.
const ARC_TANGENT: [&[f64]; 2] = [
    &[
        -0.019_126_504_807_624_355,
        -0.199_914_807_961_426_1,
        -0.492_334_684_349_981_3,
        -0.333_333_333_333_333_26,
    ],
    &[
        0.022_756_936_581_320_18,
        0.350_993_508_595_052,
        1.417_375_427_169_618_6,
        2.077_004_053_049_728,
        1.0,
    ],
];

/// The polynomial of these coefficients, highest powers first.
#[inline(always)]
fn polynomial<N: Number>(coefficients: &[f64], at: N) -> N {
    let mut sum = at.same(0.0);
    for coefficient in coefficients {
        sum = sum * at + *coefficient;
    }
    sum
}

/// The angle of the direction (`cosine`, `sine`) in (-π, π], 0 for none; within 4e-16 of itself.
#[inline(always)]
pub fn direction<N: Number>(sine: N, cosine: N) -> N {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let (y, x) = (sine.abs(), cosine.abs());
    let is_steep = x.below(y);
    let (small, large) = (N::pick(is_steep, x, y), N::pick(is_steep, y, x));
    // From small/large, or π/4 more than from (small - large)/(small + large).
    let is_beyond = (large * EIGHTH).below(small);
    let zero = y.same(0.0);
    let up = N::pick(is_beyond, small - large, small);
    let down = N::pick(is_beyond, small + large, large);
    let ratio = N::pick(zero.below(down), up / down, zero);
    let square = ratio * ratio;
    let [above, below] = ARC_TANGENT;
    let fraction = polynomial(above, square) / polynomial(below, square);
    let arc = ratio + ratio * square * fraction;
    let arc = arc + N::pick(is_beyond, y.same(FRAC_PI_4), zero);
    let arc = N::pick(is_steep, -arc + FRAC_PI_2, arc);
    let arc = N::pick(cosine.below(zero), -arc + PI, arc);
    N::pick(sine.below(zero), -arc, arc)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn direction_is_the_angle_of_its_sine_and_cosine() {
        assert_eq!(direction(0.0, 0.0), 0.0);
        assert_eq!(direction(0.0, -2.0), PI);
        for k in 0..100_000 {
            let t = f64::from(k) * 1e-4;
            let (sine, cosine) = ((3.0 * t).sin() * t.exp(), (2.0 * t).cos() * (5.0 * t).sin());
            let (found, expected) = (direction(sine, cosine), sine.atan2(cosine));
            assert!(
                (found - expected).abs() <= 4e-16 * expected.abs(),
                "{sine} {cosine}"
            );
        }
    }
}
