//! Vectors of numbers for the kernels, and which instructions they are made of: chosen at run time
//! (AVX-512, AVX2 with FMA, NEON) by `pulp`, or the plain ones that every machine has.
//!
//! [`Lanes`] is what the kernels need of a scalar beyond [`crate::Real`], which it seals.

use pulp::{Arch, Scalar256b, Simd, WithSimd};

/// Which instructions the kernels use. Results differ in the last bits: only the wide ones fuse a
/// multiplication with its addition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The widest vectors that this machine has, found out at run time.
    #[default]
    Detected,
    /// Those that every machine of the architecture has.
    Plain,
}

impl Instructions {
    /// Runs a kernel compiled for these instructions.
    #[inline(always)]
    pub(crate) fn run<K: WithSimd>(self, kernel: K) -> K::Output {
        match self {
            Self::Detected => Arch::new().dispatch(kernel),
            Self::Plain => kernel.with_simd(Scalar256b),
        }
    }

    /// Runs a loop compiled for these instructions.
    ///
    /// The loop is an `FnMut`, not an `FnOnce`: the body of an inlined closure is inlined where its
    /// own kind is called, but not through the shim that makes an `FnOnce` of it, and would then be
    /// compiled for the baseline.
    #[inline(always)]
    pub(crate) fn vectorised(self, body: impl FnMut()) {
        self.run(Loop(body));
    }
}

struct Loop<F>(F);

impl<F: FnMut()> WithSimd for Loop<F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        (self.0)();
    }
}

/// Widest vector of any instruction set, in `f32`: what packed weights are padded to.
pub(crate) const MOST_LANES: usize = 16;

/// A scalar of which vectors can be made.
pub trait Lanes: Copy + 'static {
    /// A vector of the instruction set `S`.
    type Vector<S: Simd>: Copy;

    /// Numbers in a vector.
    fn lanes<S: Simd>() -> usize;
    /// The same number in every lane.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;
    /// The whole vectors of a slice.
    fn vectors<S: Simd>(slice: &[Self]) -> &[Self::Vector<S>];
    /// The whole vectors of a slice.
    fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [Self::Vector<S>];
    /// A slice of at most one vector, zeros after its end.
    fn load<S: Simd>(simd: S, slice: &[Self]) -> Self::Vector<S>;
    /// Writes as many lanes as the slice has numbers, at most one vector.
    fn store<S: Simd>(simd: S, slice: &mut [Self], value: Self::Vector<S>);
    /// a b + c, fused where the instruction set does that.
    fn mul_add<S: Simd>(
        simd: S,
        a: Self::Vector<S>,
        b: Self::Vector<S>,
        c: Self::Vector<S>,
    ) -> Self::Vector<S>;
    /// a + b.
    fn plus<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// a - b.
    fn minus<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// a b.
    fn times<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// max(a, 0).
    fn relu<S: Simd>(simd: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// `value` where `test` is positive, else 0.
    fn where_positive<S: Simd>(
        simd: S,
        test: Self::Vector<S>,
        value: Self::Vector<S>,
    ) -> Self::Vector<S>;
}

impl Lanes for f32 {
    type Vector<S: Simd> = S::f32s;

    #[inline(always)]
    fn lanes<S: Simd>() -> usize {
        S::F32_LANES
    }
    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f32s {
        simd.splat_f32s(value)
    }
    #[inline(always)]
    fn vectors<S: Simd>(slice: &[Self]) -> &[S::f32s] {
        S::as_simd_f32s(slice).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::f32s] {
        S::as_mut_simd_f32s(slice).0
    }
    #[inline(always)]
    fn load<S: Simd>(simd: S, slice: &[Self]) -> S::f32s {
        simd.partial_load_f32s(slice)
    }
    #[inline(always)]
    fn store<S: Simd>(simd: S, slice: &mut [Self], value: S::f32s) {
        simd.partial_store_f32s(slice, value);
    }
    #[inline(always)]
    fn mul_add<S: Simd>(simd: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
        simd.mul_add_e_f32s(a, b, c)
    }
    #[inline(always)]
    fn plus<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.add_f32s(a, b)
    }
    #[inline(always)]
    fn minus<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.sub_f32s(a, b)
    }
    #[inline(always)]
    fn times<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.mul_f32s(a, b)
    }
    #[inline(always)]
    fn relu<S: Simd>(simd: S, a: S::f32s) -> S::f32s {
        simd.max_f32s(a, simd.splat_f32s(0.0))
    }
    #[inline(always)]
    fn where_positive<S: Simd>(simd: S, test: S::f32s, value: S::f32s) -> S::f32s {
        // `select_f32s` itself is not always inlined, and then neither are its instructions.
        let zero = simd.splat_f32s(0.0);
        let value = simd.transmute_u32s_f32s(value);
        let other = simd.transmute_u32s_f32s(zero);
        let mask = simd.greater_than_f32s(test, zero);
        simd.transmute_f32s_u32s(simd.select_u32s(mask, value, other))
    }
}

impl Lanes for f64 {
    type Vector<S: Simd> = S::f64s;

    #[inline(always)]
    fn lanes<S: Simd>() -> usize {
        S::F64_LANES
    }
    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f64s {
        simd.splat_f64s(value)
    }
    #[inline(always)]
    fn vectors<S: Simd>(slice: &[Self]) -> &[S::f64s] {
        S::as_simd_f64s(slice).0
    }
    #[inline(always)]
    fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::f64s] {
        S::as_mut_simd_f64s(slice).0
    }
    #[inline(always)]
    fn load<S: Simd>(simd: S, slice: &[Self]) -> S::f64s {
        simd.partial_load_f64s(slice)
    }
    #[inline(always)]
    fn store<S: Simd>(simd: S, slice: &mut [Self], value: S::f64s) {
        simd.partial_store_f64s(slice, value);
    }
    #[inline(always)]
    fn mul_add<S: Simd>(simd: S, a: S::f64s, b: S::f64s, c: S::f64s) -> S::f64s {
        simd.mul_add_e_f64s(a, b, c)
    }
    #[inline(always)]
    fn plus<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.add_f64s(a, b)
    }
    #[inline(always)]
    fn minus<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.sub_f64s(a, b)
    }
    #[inline(always)]
    fn times<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.mul_f64s(a, b)
    }
    #[inline(always)]
    fn relu<S: Simd>(simd: S, a: S::f64s) -> S::f64s {
        simd.max_f64s(a, simd.splat_f64s(0.0))
    }
    #[inline(always)]
    fn where_positive<S: Simd>(simd: S, test: S::f64s, value: S::f64s) -> S::f64s {
        // `select_f64s` itself is not always inlined, and then neither are its instructions.
        let zero = simd.splat_f64s(0.0);
        let value = simd.transmute_u64s_f64s(value);
        let other = simd.transmute_u64s_f64s(zero);
        let mask = simd.greater_than_f64s(test, zero);
        simd.transmute_f64s_u64s(simd.select_u64s(mask, value, other))
    }
}
