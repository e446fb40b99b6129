//! Colours: sRGB bytes outside, linear light inside, and the colours of values.
//!
//! The transfer curve is that of IEC 61966-2-1. The colours of values are interpolated between a
//! few, whose luminance falls from end to end, so that they still order values in grey.

use std::sync::LazyLock;

use glam::{Vec3, Vec3A};

/// A colour as sRGB bytes: red, green, blue.
pub type Rgb = [u8; 3];

/// Linear light in 16 bits per channel, as the sample buffer keeps it.
pub(crate) type Linear16 = [u16; 3];

/// The colours of values: pale cream over orange to dark red, so that shading still shows where the
/// number is small.
const EMBER: [Rgb; 7] = [
    [246, 240, 228],
    [248, 217, 168],
    [242, 178, 112],
    [226, 128, 78],
    [196, 76, 64],
    [150, 34, 62],
    [92, 12, 52],
];

/// The colour of `fraction` of the largest value, clamped to [0, 1]; NaN counts as 0.
pub(crate) fn value_colour(fraction: f32) -> Rgb {
    let place = fraction.clamp(0.0, 1.0) * (EMBER.len() - 1) as f32;
    // A NaN becomes 0 in the conversion.
    let before = (place as usize).min(EMBER.len() - 2);
    let share = if place.is_nan() { 0.0 } else { place - before as f32 };
    mix(EMBER[before], EMBER[before + 1], share)
}

/// The colours of values as linear light at 256 even steps.
pub(crate) fn value_table() -> Vec<Vec3A> {
    (0..256)
        .map(|step| to_linear(value_colour(step as f32 / 255.0)).into())
        .collect()
}

/// The mixture of two colours in sRGB; `share` of the second, in [0, 1].
pub(crate) fn mix(first: Rgb, second: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|channel| {
        let (a, b) = (f32::from(first[channel]), f32::from(second[channel]));
        (a + (b - a) * share).round() as u8
    })
}

/// sRGB bytes as linear light in [0, 1].
pub(crate) fn to_linear(colour: Rgb) -> Vec3 {
    Vec3::from_array(colour.map(|byte| {
        let value = f32::from(byte) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    }))
}

/// Linear light, clamped to [0, 1], in 16 bits.
#[inline]
pub(crate) fn to_linear16(light: Vec3A) -> Linear16 {
    (light.clamp(Vec3A::ZERO, Vec3A::ONE) * 65535.0)
        .to_array()
        .map(|channel| channel as u16)
}

/// The sRGB bytes of the middle of each 1/4096 of linear light.
static ENCODED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    (0..4096)
        .map(|step| {
            let light = (step as f32 + 0.5) / 4096.0;
            let value = if light <= 0.003_130_8 {
                12.92 * light
            } else {
                1.055 * light.powf(1.0 / 2.4) - 0.055
            };
            (255.0 * value).round() as u8
        })
        .collect()
});

/// From linear light to sRGB bytes, by a table.
pub(crate) fn encoder() -> impl Fn(Linear16) -> Rgb {
    let table: &[u8] = &ENCODED;
    |light| light.map(|channel| table[usize::from(channel >> 4)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of linear light (Rec. 709 primaries).
    fn luminance(colour: Rgb) -> f32 {
        to_linear(colour).dot(Vec3::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn the_colours_of_values_start_and_end_at_their_control_colours() {
        let (first, last) = ([246, 240, 228], [92, 12, 52]);
        assert_eq!([0.0, -3.0, f32::NAN].map(value_colour), [first; 3]);
        assert_eq!([1.0, f32::INFINITY].map(value_colour), [last; 2]);
    }

    #[test]
    fn luminance_falls_from_small_to_large_values() {
        // Steps of 1/64: wide enough that rounding to bytes cannot turn a fall around.
        let steps: Vec<f32> = (0..=64)
            .map(|k| luminance(value_colour(k as f32 / 64.0)))
            .collect();
        assert!(steps.windows(2).all(|pair| pair[0] > pair[1]));
    }

    #[test]
    fn encoding_inverts_the_transfer_curve() {
        let encode = encoder();
        for byte in 0..=255_u8 {
            let back = encode(to_linear16(to_linear([byte; 3]).into()))[0];
            // Near black a 4096th of light is 0.8 of a byte: one byte off at the most.
            assert!(back.abs_diff(byte) <= 1, "{byte} came back as {back}");
        }
    }
}
