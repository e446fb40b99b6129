//! The few colours of a clip: 255 that stand for all, chosen once, so that still pixels stay still.
//! No dithering: it would flicker and not compress.

use std::collections::HashMap;

use color_quant::NeuQuant;

use crate::{Image, Rgb};

/// Up to 255 colours, numbered from 1; 0 stays free for "as before".
#[derive(Clone, Debug)]
pub(crate) struct Palette {
    colours: Vec<Rgb>,
    nearest: HashMap<Rgb, u8>,
}

/// The number of a pixel that keeps what is there.
pub(crate) const UNCHANGED: u8 = 0;

/// Colours of a palette: all that a GIF has but one.
const COLOURS: usize = 255;
/// One pixel of so many is learned from.
const EVERY: i32 = 4;

impl Palette {
    /// The colours for `images`, by a self-organising map (Dekker 1994).
    pub(crate) fn of_images(images: &[Image]) -> Self {
        let pixels = images.iter().flat_map(Image::pixels);
        let pixels: Vec<u8> = pixels.flat_map(|&[r, g, b]| [r, g, b, u8::MAX]).collect();
        let map = NeuQuant::new(EVERY, COLOURS, &pixels);
        let mut colours = map.color_map_rgb().as_chunks::<3>().0.to_vec();
        colours.sort_unstable();
        colours.dedup();
        Self {
            colours,
            nearest: HashMap::new(),
        }
    }

    /// The table as GIF wants it: colour 0 is that of no pixel.
    pub(crate) fn table(&self) -> Vec<u8> {
        let mut table = vec![0; 3];
        table.extend_from_slice(self.colours.as_flattened());
        table
    }

    /// The number of the nearest colour.
    pub(crate) fn number(&mut self, colour: Rgb) -> u8 {
        if let Some(&number) = self.nearest.get(&colour) {
            return number;
        }
        let distances = self.colours.iter().map(|&c| distance_squared(c, colour));
        let best = distances.enumerate().min_by_key(|(_, distance)| *distance);
        let number = best.map_or(0, |(at, _)| at + 1) as u8;
        self.nearest.insert(colour, number);
        number
    }

    pub(crate) fn colour(&self, number: u8) -> Option<Rgb> {
        usize::from(number)
            .checked_sub(1)
            .and_then(|at| self.colours.get(at).copied())
    }
}

/// Squared distance; green counts most, as in luminance.
pub(crate) fn distance_squared(a: Rgb, b: Rgb) -> u32 {
    let [red, green, blue] = std::array::from_fn(|k| u32::from(a[k].abs_diff(b[k])).pow(2));
    3 * red + 5 * green + 2 * blue
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_on_white_paper_are_near_their_colours() {
        // A grey ramp and a blue one, each over a quarter of a page.
        let mut page = Image::filled(256, 64, [255; 3]).unwrap();
        for (at, pixel) in page.pixels_mut().iter_mut().enumerate() {
            let (level, row) = ((at % 256) as u8, at / 256);
            match row / 16 {
                0 => *pixel = [level; 3],
                1 => *pixel = [level / 4, level / 2, level],
                _ => {}
            }
        }
        let mut palette = Palette::of_images(std::slice::from_ref(&page));
        assert!(palette.table().len() <= 3 * 256);
        assert_eq!(palette.colour(UNCHANGED), None);
        for &colour in page.pixels() {
            let number = palette.number(colour);
            assert_ne!(number, UNCHANGED);
            let off = distance_squared(palette.colour(number).unwrap(), colour);
            // Two ramps of 256 levels in 255 colours: a few levels in every channel.
            assert!(off < 10 * 8 * 8, "{colour:?} {off}");
        }
    }
}
