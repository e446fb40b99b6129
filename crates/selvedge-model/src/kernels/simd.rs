//! Vectors of numbers for the kernels. Their instructions are chosen at run time by `pulp`
//! (AVX-512, AVX2 with FMA, NEON), or are the plain ones that every machine has.
//!
//! [`Lanes`] holds the operations on vectors that the kernels need beside [`crate::Real`], and
//! seals it.

use pulp::{Arch, Scalar, Simd, WithSimd};

/// Instructions that the kernels use. Results differ in the last bits: only the wide ones fuse a
/// multiplication with its addition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The widest vectors that this machine has, detected at run time.
    #[default]
    Detected,
    /// Instructions that every machine of the architecture has.
    Plain,
}

impl Instructions {
    /// Runs a kernel compiled for these instructions.
    #[inline(always)]
    pub(crate) fn run<K: WithSimd>(self, kernel: K) -> K::Output {
        match self {
            Self::Detected => Arch::new().dispatch(kernel),
            // What is detected where there is nothing wide. Not one of `pulp`'s emulated vectors:
            // their fused products are calls of a function.
            Self::Plain => kernel.with_simd(Scalar),
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

/// True where 32 vectors stay in registers. A browser has no more than the processor beneath it,
/// whatever `pulp` says: often 16.
#[inline(always)]
pub(crate) fn has_32_registers<S: Simd>() -> bool {
    S::REGISTER_COUNT >= 32 && !cfg!(target_family = "wasm")
}

/// Numbers in the widest vector of any instruction set, in `f32`. Packed weights are padded to it.
pub(crate) const MOST_LANES: usize = 16;

/// A scalar with vectors.
pub trait Lanes: Copy + 'static {
    /// A vector of the instruction set `S`.
    type Vector<S: Simd>: Copy;

    /// Runs a kernel on numbers of this type, compiled for these instructions; in f64, which proves
    /// derivatives and need not be fast, for the plain ones.
    fn run<K: WithSimd>(instructions: Instructions, kernel: K) -> K::Output;
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
    /// The sum of all lanes.
    fn total<S: Simd>(simd: S, a: Self::Vector<S>) -> Self;
    /// max(a, 0).
    fn relu<S: Simd>(simd: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// 1 / (1 + e^-a).
    fn sigmoids<S: Simd>(simd: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// Hyperbolic tangent.
    fn tanhs<S: Simd>(simd: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// `value` where `test` is positive, else 0.
    fn where_positive<S: Simd>(
        simd: S,
        test: Self::Vector<S>,
        value: Self::Vector<S>,
    ) -> Self::Vector<S>;
}

/// The methods of [`Lanes`] that are the same for every scalar but for the names in `pulp`.
macro_rules! lanes_by {
    (
        $vectors:ident, $count:ident, [$whole:ident, $whole_mut:ident, $load:ident, $store:ident],
        [$splat:ident, $mul_add:ident, $add:ident, $sub:ident, $mul:ident, $sum:ident, $max:ident],
        [$greater:ident, $to_bits:ident, $of_bits:ident, $select:ident]
    ) => {
        type Vector<S: Simd> = S::$vectors;

        #[inline(always)]
        fn lanes<S: Simd>() -> usize {
            S::$count
        }
        #[inline(always)]
        fn splat<S: Simd>(simd: S, value: Self) -> S::$vectors {
            simd.$splat(value)
        }
        #[inline(always)]
        fn vectors<S: Simd>(slice: &[Self]) -> &[S::$vectors] {
            S::$whole(slice).0
        }
        #[inline(always)]
        fn vectors_mut<S: Simd>(slice: &mut [Self]) -> &mut [S::$vectors] {
            S::$whole_mut(slice).0
        }
        #[inline(always)]
        fn load<S: Simd>(simd: S, slice: &[Self]) -> S::$vectors {
            simd.$load(slice)
        }
        #[inline(always)]
        fn store<S: Simd>(simd: S, slice: &mut [Self], value: S::$vectors) {
            simd.$store(slice, value);
        }
        #[inline(always)]
        fn mul_add<S: Simd>(
            simd: S,
            a: S::$vectors,
            b: S::$vectors,
            c: S::$vectors,
        ) -> S::$vectors {
            simd.$mul_add(a, b, c)
        }
        #[inline(always)]
        fn plus<S: Simd>(simd: S, a: S::$vectors, b: S::$vectors) -> S::$vectors {
            simd.$add(a, b)
        }
        #[inline(always)]
        fn minus<S: Simd>(simd: S, a: S::$vectors, b: S::$vectors) -> S::$vectors {
            simd.$sub(a, b)
        }
        #[inline(always)]
        fn times<S: Simd>(simd: S, a: S::$vectors, b: S::$vectors) -> S::$vectors {
            simd.$mul(a, b)
        }
        #[inline(always)]
        fn total<S: Simd>(simd: S, a: S::$vectors) -> Self {
            simd.$sum(a)
        }
        #[inline(always)]
        fn relu<S: Simd>(simd: S, a: S::$vectors) -> S::$vectors {
            simd.$max(a, simd.$splat(0.0))
        }
        #[inline(always)]
        fn where_positive<S: Simd>(simd: S, test: S::$vectors, value: S::$vectors) -> S::$vectors {
            // pulp's own choice between vectors is not always inlined, and then neither are its
            // instructions.
            let zero = simd.$splat(0.0);
            let (value, other) = (simd.$to_bits(value), simd.$to_bits(zero));
            simd.$of_bits(simd.$select(simd.$greater(test, zero), value, other))
        }
    };
}

impl Lanes for f32 {
    lanes_by! {
        f32s, F32_LANES,
        [as_simd_f32s, as_mut_simd_f32s, partial_load_f32s, partial_store_f32s],
        [splat_f32s, mul_add_e_f32s, add_f32s, sub_f32s, mul_f32s, reduce_sum_f32s, max_f32s],
        [greater_than_f32s, transmute_u32s_f32s, transmute_f32s_u32s, select_u32s]
    }

    #[inline(always)]
    fn run<K: WithSimd>(instructions: Instructions, kernel: K) -> K::Output {
        instructions.run(kernel)
    }
    #[inline(always)]
    fn sigmoids<S: Simd>(simd: S, a: S::f32s) -> S::f32s {
        let one = simd.splat_f32s(1.0);
        let below = simd.add_f32s(one, exps(simd, simd.sub_f32s(simd.splat_f32s(0.0), a)));
        simd.div_f32s(one, below)
    }
    #[inline(always)]
    fn tanhs<S: Simd>(simd: S, a: S::f32s) -> S::f32s {
        // Cancels near 0, where the absolute error is that of 1: about 1e-7.
        let one = simd.splat_f32s(1.0);
        let below = simd.add_f32s(one, exps(simd, simd.add_f32s(a, a)));
        simd.sub_f32s(one, simd.div_f32s(simd.splat_f32s(2.0), below))
    }
}

impl Lanes for f64 {
    lanes_by! {
        f64s, F64_LANES,
        [as_simd_f64s, as_mut_simd_f64s, partial_load_f64s, partial_store_f64s],
        [splat_f64s, mul_add_e_f64s, add_f64s, sub_f64s, mul_f64s, reduce_sum_f64s, max_f64s],
        [greater_than_f64s, transmute_u64s_f64s, transmute_f64s_u64s, select_u64s]
    }

    #[inline(always)]
    fn run<K: WithSimd>(_: Instructions, kernel: K) -> K::Output {
        kernel.with_simd(Scalar)
    }
    #[inline(always)]
    fn sigmoids<S: Simd>(simd: S, a: S::f64s) -> S::f64s {
        each_lane(simd, a, |x| 1.0 / (1.0 + (-x).exp()))
    }
    #[inline(always)]
    fn tanhs<S: Simd>(simd: S, a: S::f64s) -> S::f64s {
        each_lane(simd, a, f64::tanh)
    }
}

/// A function of each lane, one after the other.
#[inline(always)]
fn each_lane<S: Simd>(simd: S, a: S::f64s, of: impl Fn(f64) -> f64) -> S::f64s {
    let mut lanes = [0.0; MOST_LANES];
    let lanes = &mut lanes[..S::F64_LANES];
    simd.partial_store_f64s(lanes, a);
    lanes.iter_mut().for_each(|x| *x = of(*x));
    simd.partial_load_f64s(lanes)
}

/// Constants of [`exps`]: bounds of x; log2 e; 1.5 · 2^23, which rounds to an integer when it is
/// added; - ln 2, its high and its low part; the Taylor coefficients from the seventh down.
const EXP: [f32; 14] = [
    87.0,
    -87.0,
    std::f32::consts::LOG2_E,
    12_582_912.0,
    -0.693_359_4,
    2.121_944_4e-4,
    1.0 / 5040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// e^x for |x| ≤ 87, clamped beyond; NaN for NaN. Relative error below 2e-7: 2^n
/// times the Taylor series of e^r, |r| ≤ ln 2 / 2, to the seventh order.
#[inline(always)]
fn exps<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    // Read anew each time: held in registers throughout the loops around this, constants would
    // drive the sums of the products out of them.
    let [
        most,
        least,
        log2_e,
        to_nearest,
        ln_2_high,
        ln_2_low,
        first,
        series @ ..,
    ] = std::hint::black_box(&EXP);
    let most = simd.splat_f32s(*most);
    let x = select(simd, simd.greater_than_f32s(x, most), most, x);
    let least = simd.splat_f32s(*least);
    let x = select(simd, simd.greater_than_f32s(least, x), least, x);
    let to_nearest = simd.splat_f32s(*to_nearest);
    let shifted = simd.mul_add_e_f32s(x, simd.splat_f32s(*log2_e), to_nearest);
    let n = simd.sub_f32s(shifted, to_nearest);
    let r = simd.mul_add_e_f32s(n, simd.splat_f32s(*ln_2_high), x);
    let r = simd.mul_add_e_f32s(n, simd.splat_f32s(*ln_2_low), r);
    let mut sum = simd.splat_f32s(*first);
    for coefficient in series {
        sum = simd.mul_add_e_f32s(sum, r, simd.splat_f32s(*coefficient));
    }
    // The low bits of `shifted` hold n as an integer; moved up they are an exponent.
    let bits = simd.transmute_u32s_f32s(shifted);
    let exponent = simd.wrapping_dyn_shl_u32s(bits, simd.splat_u32s(23));
    let power = simd.add_u32s(exponent, simd.splat_u32s(127 << 23));
    simd.mul_f32s(sum, simd.transmute_f32s_u32s(power))
}

/// `yes` where the mask is set, else `no`: `select_f32s` itself is not always inlined.
#[inline(always)]
fn select<S: Simd>(simd: S, mask: S::m32s, yes: S::f32s, no: S::f32s) -> S::f32s {
    let (yes, no) = (simd.transmute_u32s_f32s(yes), simd.transmute_u32s_f32s(no));
    simd.transmute_f32s_u32s(simd.select_u32s(mask, yes, no))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy)]
    enum Function {
        Exp,
        Sigmoid,
        Tanh,
    }

    use Function::{Exp, Sigmoid, Tanh};

    /// A function of each number.
    struct Each<'a>(&'a [f32], Function);

    impl WithSimd for Each<'_> {
        type Output = Vec<f32>;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Vec<f32> {
            let mut out = self.0.to_vec();
            for chunk in out.chunks_mut(S::F32_LANES) {
                let x = simd.partial_load_f32s(chunk);
                let y = match self.1 {
                    Exp => exps(simd, x),
                    Sigmoid => f32::sigmoids(simd, x),
                    Tanh => f32::tanhs(simd, x),
                };
                simd.partial_store_f32s(chunk, y);
            }
            out
        }
    }

    const BOTH: [Instructions; 2] = [Instructions::Detected, Instructions::Plain];

    /// Hundredths up to `bound` of them on both sides of 0; under Miri, which is slow, every 97th.
    fn numbers(bound: i32) -> Vec<f32> {
        let every = if cfg!(miri) { 97 } else { 1 };
        let hundredths = (-bound..=bound).step_by(every);
        hundredths.map(|k| k as f32 * 0.01).collect()
    }

    #[test]
    fn exp_is_accurate_to_two_roundings() {
        let x = numbers(8700);
        for instructions in BOTH {
            for (&x, y) in x.iter().zip(instructions.run(Each(&x, Exp))) {
                let exact = f64::from(x).exp();
                let relative = (f64::from(y) - exact).abs() / exact;
                assert!(relative < 2e-7, "exp({x}): relative error {relative:e}");
            }
        }
    }

    #[test]
    fn gates_match_their_f64_versions_saturate_and_hide_nothing() {
        let x = numbers(4000);
        for instructions in BOTH {
            let sigmoid = instructions.run(Each(&x, Sigmoid));
            let tanh = instructions.run(Each(&x, Tanh));
            for ((&x, s), t) in x.iter().zip(sigmoid).zip(tanh) {
                let x = f64::from(x);
                assert!((f64::from(s) - 1.0 / (1.0 + (-x).exp())).abs() < 2e-7);
                assert!((f64::from(t) - x.tanh()).abs() < 2.5e-7);
            }
            let ends = [f32::INFINITY, 1e30, -1e30, f32::NEG_INFINITY];
            let sigmoid = instructions.run(Each(&ends, Sigmoid));
            let tanh = instructions.run(Each(&ends, Tanh));
            assert_eq!(sigmoid[..2], [1.0; 2]);
            assert!(sigmoid[2..].iter().all(|x| (0.0..1e-37).contains(x)));
            assert_eq!(tanh, [1.0, 1.0, -1.0, -1.0]);
            let none = [f32::NAN; 3];
            let both = [
                instructions.run(Each(&none, Sigmoid)),
                instructions.run(Each(&none, Tanh)),
            ];
            assert!(both.iter().flatten().all(|x| x.is_nan()));
        }
    }
}
