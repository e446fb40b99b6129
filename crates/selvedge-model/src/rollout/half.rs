//! Weights in half precision, for files: IEEE 754 binary16 (11 bits of precision, up to 65504) and
//! bfloat16 (8 bits, the range of f32). Rounded to nearest, ties to even.

/// Number type of the weights in a model file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WeightType {
    /// `f32`, exact.
    #[default]
    F32,
    /// Half the size, a relative error of up to 2⁻¹¹; nothing beyond 65504.
    F16,
    /// Half the size, a relative error of up to 2⁻⁸.
    Bf16,
}

/// Bits of the binary16 nearest to `value`; `None` if it is too large.
pub(crate) fn f16_bits(value: f32) -> Option<u16> {
    let size = f64::from(value.abs());
    let sign = if value.is_sign_negative() { 0x8000 } else { 0 };
    // From halfway to the next exponent on it would be rounded to infinity.
    if size.is_nan() || size >= 65520.0 {
        return None;
    }
    // Below 2^-14 the distance of neighbours stays 2^-24. All of this is exact in f64.
    let exponent = ilog2(size).max(-14);
    let steps = (size * 2f64.powi(10 - exponent)).round_ties_even() as u16;
    // 1024 steps are the first of the next exponent, and those below have none.
    let above = ((exponent + 14) as u16) << 10;
    Some(sign | (above + steps))
}

/// Exponent of a number that f32 can hold; for 0 that of the least number.
fn ilog2(size: f64) -> i32 {
    ((size.to_bits() >> 52) as i32 - 1023).max(-149)
}

/// The number with these bits.
pub(crate) fn f16_value(bits: u16) -> f32 {
    let (exponent, rest) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023));
    let size = match exponent {
        0 => rest * 2f32.powi(-24),
        31 if rest == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1024.0 + rest) * 2f32.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// Bits of the bfloat16 nearest to `value`; `None` if it is not finite.
pub(crate) fn bf16_bits(value: f32) -> Option<u16> {
    let bits = value.to_bits();
    let rounded = bits.wrapping_add(0x7FFF + (bits >> 16 & 1)) >> 16;
    let nearest = rounded as u16;
    (value.is_finite() && bf16_value(nearest).is_finite()).then_some(nearest)
}

/// The number with these bits.
pub(crate) fn bf16_value(bits: u16) -> f32 {
    f32::from_bits(u32::from(bits) << 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_comes_back_and_what_lies_between_goes_to_the_nearer_even_one() {
        type Format = (fn(f32) -> Option<u16>, fn(u16) -> f32);
        let formats: [Format; 2] = [(f16_bits, f16_value), (bf16_bits, bf16_value)];
        for (to, from) in formats {
            for bits in 0..=u16::MAX {
                let value = from(bits);
                if !value.is_finite() {
                    assert_eq!(to(value), None, "{bits:x}");
                    continue;
                }
                assert_eq!(to(value), Some(bits), "{value}");
                let next = from(bits.wrapping_add(1));
                if !next.is_finite() || value.is_sign_negative() != next.is_sign_negative() {
                    continue;
                }
                // Halves of both formats are f32 again, but for the smallest bfloat16.
                let middle = ((f64::from(value) + f64::from(next)) / 2.0) as f32;
                if middle != value && middle != next {
                    assert_eq!(to(middle), Some(bits + (bits & 1)), "{middle}");
                }
            }
        }
        assert_eq!(f16_bits(65519.0), Some(0x7BFF));
        assert_eq!(f16_bits(65520.0), None);
        assert_eq!(f16_bits(1e-9), Some(0));
    }
}
