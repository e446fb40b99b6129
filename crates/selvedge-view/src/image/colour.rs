//! Colours: sRGB bytes outside, linear light inside, and maps from a number to a colour.
//!
//! The transfer curve is that of IEC 61966-2-1. A map interpolates a few control
//! colours, whose luminance rises or falls from end to end, so that it still orders values in grey.

use std::sync::LazyLock;

use glam::{Vec3, Vec3A};

/// A colour as sRGB bytes: red, green, blue.
pub type Rgb = [u8; 3];

/// Linear light in 16 bits per channel, as the sample buffer keeps it.
pub(crate) type Linear16 = [u16; 3];

/// A map from a number in [0, 1] to a colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourMap {
    /// Dark violet over green to yellow (van der Walt and Smith, matplotlib 2015, CC0).
    Viridis,
    /// Black over purple and orange to pale yellow (the same authors).
    Magma,
    /// Pale cream over orange to dark red: shading still shows where the number is small.
    #[default]
    Ember,
}

const VIRIDIS: [Rgb; 10] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 74, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [109, 205, 89],
    [180, 222, 44],
    [253, 231, 37],
];

const MAGMA: [Rgb; 10] = [
    [0, 0, 4],
    [24, 15, 62],
    [69, 16, 119],
    [114, 31, 129],
    [159, 47, 127],
    [205, 64, 113],
    [241, 96, 93],
    [253, 149, 103],
    [254, 201, 141],
    [252, 253, 191],
];

const EMBER: [Rgb; 7] = [
    [246, 240, 228],
    [248, 217, 168],
    [242, 178, 112],
    [226, 128, 78],
    [196, 76, 64],
    [150, 34, 62],
    [92, 12, 52],
];

impl ColourMap {
    /// The colour of `fraction`, clamped to [0, 1]; NaN counts as 0.
    #[must_use]
    pub fn colour(self, fraction: f32) -> Rgb {
        let controls: &[Rgb] = match self {
            Self::Viridis => &VIRIDIS,
            Self::Magma => &MAGMA,
            Self::Ember => &EMBER,
        };
        let place = fraction.clamp(0.0, 1.0) * (controls.len() - 1) as f32;
        // A NaN becomes 0 in the conversion.
        let before = (place as usize).min(controls.len() - 2);
        let share = if place.is_nan() {
            0.0
        } else {
            place - before as f32
        };
        mix(controls[before], controls[before + 1], share)
    }

    /// The map as linear light at 256 even steps.
    pub(crate) fn linear_table(self) -> Vec<Vec3A> {
        (0..256)
            .map(|step| to_linear(self.colour(step as f32 / 255.0)).into())
            .collect()
    }
}

/// The mixture of two colours in sRGB; `share` of the second, in [0, 1].
#[must_use]
pub(crate) fn mix(first: Rgb, second: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|channel| {
        let (a, b) = (f32::from(first[channel]), f32::from(second[channel]));
        (a + (b - a) * share).round() as u8
    })
}

/// sRGB bytes as linear light in [0, 1].
#[must_use]
pub(crate) fn to_linear(colour: Rgb) -> Vec3 {
    Vec3::from_array(colour.map(|byte| {
        let value = f32::from(byte) / 255.0;
        if value <= 0.04045 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        }
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
#[derive(Clone, Copy, Debug)]
pub(crate) struct Encoder(&'static [u8]);

impl Encoder {
    pub(crate) fn new() -> Self {
        Self(&ENCODED)
    }

    #[inline]
    pub(crate) fn encode(self, light: Linear16) -> Rgb {
        light.map(|channel| self.0[usize::from(channel >> 4)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of linear light (Rec. 709 primaries).
    fn luminance(colour: Rgb) -> f32 {
        to_linear(colour).dot(Vec3::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn maps_start_and_end_at_their_control_colours() {
        for (map, first, last) in [
            (ColourMap::Viridis, [68, 1, 84], [253, 231, 37]),
            (ColourMap::Magma, [0, 0, 4], [252, 253, 191]),
            (ColourMap::Ember, [246, 240, 228], [92, 12, 52]),
        ] {
            assert_eq!(map.colour(0.0), first);
            assert_eq!(map.colour(1.0), last);
            assert_eq!(map.colour(-3.0), first);
            assert_eq!(map.colour(f32::INFINITY), last);
            assert_eq!(map.colour(f32::NAN), first);
        }
    }

    #[test]
    fn luminance_of_maps_is_monotonic() {
        for (map, rise) in [
            (ColourMap::Viridis, 1.0),
            (ColourMap::Magma, 1.0),
            (ColourMap::Ember, -1.0),
        ] {
            // Steps of 1/64: wide enough that rounding to bytes cannot turn a rise around.
            let steps: Vec<f32> = (0..=64)
                .map(|k| rise * luminance(map.colour(k as f32 / 64.0)))
                .collect();
            assert!(steps.windows(2).all(|pair| pair[0] < pair[1]), "{map:?}");
        }
    }

    #[test]
    fn encoding_inverts_the_transfer_curve() {
        let encoder = Encoder::new();
        for byte in 0..=255_u8 {
            let back = encoder.encode(to_linear16(to_linear([byte; 3]).into()))[0];
            // Near black a 4096th of light is 0.8 of a byte: one byte off at the most.
            assert!(back.abs_diff(byte) <= 1, "{byte} came back as {back}");
        }
    }
}
