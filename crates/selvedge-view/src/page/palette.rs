//! The few colours of a clip: 255 that stand for all, chosen once, so that still pixels stay still.
//!
//! Colours are counted in cells of 1/64 per channel; cells are split by median cut (Heckbert 1982)
//! where the squared error is greatest, at the mean, and the means are then improved by a few
//! rounds of Lloyd's algorithm. A cell weighs the square root of its count: the wide backdrop must
//! not take the colours of the cloth. No dithering: it would flicker and not compress.

use std::collections::HashMap;

use glam::Vec3;

use crate::{Image, Rgb};

/// Up to 255 colours, numbered from 1; 0 stays free for "as before".
#[derive(Clone, Debug)]
pub(crate) struct Palette {
    colours: Vec<Rgb>,
    nearest: HashMap<Rgb, u8>,
}

/// A cell of colours: their mean and their weight.
#[derive(Clone, Copy, Debug)]
struct Cell {
    mean: Vec3,
    weight: f32,
}

/// The number of a pixel that keeps what is there.
pub(crate) const UNCHANGED: u8 = 0;

const LLOYD_ROUNDS: usize = 3;
const WEIGHT_POWER: f32 = 0.75;

impl Palette {
    /// At most `size` colours (1 to 255) for `images`.
    pub(crate) fn of_images(images: &[Image], size: usize) -> Self {
        let cells = count_cells(images);
        let mut means = split(cells.clone(), size.clamp(1, 255));
        for _ in 0..LLOYD_ROUNDS {
            improve(&cells, &mut means);
        }
        let mut colours: Vec<Rgb> = means
            .into_iter()
            .map(|mean| mean.to_array().map(|c| c.round().clamp(0.0, 255.0) as u8))
            .collect();
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

fn count_cells(images: &[Image]) -> Vec<Cell> {
    let mut counts: HashMap<Rgb, u32> = HashMap::new();
    for &pixel in images.iter().flat_map(Image::pixels) {
        *counts.entry(pixel).or_insert(0) += 1;
    }
    let mut counts: Vec<(Rgb, u32)> = counts.into_iter().collect();
    // The order of a hash map is random: the same frames must make the same file.
    counts.sort_unstable();
    let cell = |(colour, count): (Rgb, u32)| Cell {
        mean: Vec3::from_array(colour.map(f32::from)),
        weight: (count as f32).powf(WEIGHT_POWER),
    };
    counts.into_iter().map(cell).collect()
}

/// A box of cells with its weighted mean, the axis of its largest spread, and its squared error.
struct Block {
    cells: Vec<Cell>,
    mean: Vec3,
    axis: usize,
    error: f32,
}

impl Block {
    fn new(cells: Vec<Cell>) -> Self {
        let weight: f32 = cells.iter().map(|cell| cell.weight).sum();
        let sum: Vec3 = cells.iter().map(|cell| cell.mean * cell.weight).sum();
        let mean = sum / weight.max(f32::MIN_POSITIVE);
        let spread: Vec3 = cells
            .iter()
            .map(|cell| (cell.mean - mean).powf(2.0) * cell.weight)
            .sum();
        let axis = spread.max_position();
        Self {
            cells,
            mean,
            axis,
            error: spread[axis],
        }
    }

    fn split(self) -> [Self; 2] {
        let (axis, at) = (self.axis, self.mean[self.axis]);
        let (low, high) = self.cells.into_iter().partition(|c| c.mean[axis] <= at);
        [Self::new(low), Self::new(high)]
    }
}

/// The means of at most `size` boxes.
fn split(cells: Vec<Cell>, size: usize) -> Vec<Vec3> {
    let mut blocks = vec![Block::new(cells)];
    while blocks.len() < size {
        let widest = (0..blocks.len())
            .max_by(|&a, &b| blocks[a].error.total_cmp(&blocks[b].error))
            .filter(|&k| blocks[k].cells.len() > 1 && blocks[k].error > 0.0);
        let Some(widest) = widest else { break };
        let [low, high] = blocks.swap_remove(widest).split();
        let halves = [low, high].into_iter().filter(|b| !b.cells.is_empty());
        let before = blocks.len();
        blocks.extend(halves);
        if blocks.len() == before + 1 {
            break;
        }
    }
    blocks.into_iter().map(|block| block.mean).collect()
}

/// One round of Lloyd's algorithm: every mean moves to the middle of the cells nearest to it.
fn improve(cells: &[Cell], means: &mut [Vec3]) {
    let mut sums = vec![(Vec3::ZERO, 0.0_f32); means.len()];
    for cell in cells {
        let distances = means.iter().map(|mean| mean.distance_squared(cell.mean));
        let best = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((nearest, _)) = best {
            sums[nearest].0 += cell.mean * cell.weight;
            sums[nearest].1 += cell.weight;
        }
    }
    for (mean, (sum, weight)) in means.iter_mut().zip(sums) {
        if weight > 0.0 {
            *mean = sum / weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image_of(colours: &[Rgb]) -> Image {
        let mut image = Image::filled(colours.len() as u32, 1, [0; 3]).unwrap();
        image.pixels_mut().copy_from_slice(colours);
        image
    }

    #[test]
    fn few_colours_are_kept_exactly() {
        let colours: Vec<Rgb> = (0..40).map(|k| [6 * k, 255 - 5 * k, 3 * k]).collect();
        let mut palette = Palette::of_images(&[image_of(&colours)], 255);
        for &colour in &colours {
            let number = palette.number(colour);
            assert_ne!(number, UNCHANGED);
            assert_eq!(palette.colour(number), Some(colour));
        }
        assert_eq!(palette.colour(UNCHANGED), None);
    }

    #[test]
    fn a_grey_ramp_in_sixteen_colours_is_near_its_best() {
        let colours: Vec<Rgb> = (0..=255).map(|k| [k; 3]).collect();
        let mut palette = Palette::of_images(&[image_of(&colours)], 16);
        let mean_square: f32 = (0..=255_u8)
            .map(|k| {
                let number = palette.number([k; 3]);
                let off = f32::from(k) - f32::from(palette.colour(number).unwrap()[0]);
                off * off / 256.0
            })
            .sum();
        // Sixteen even intervals of 16 levels have (16² - 1) / 12 = 21.25; the cells of 4 levels
        // and the uneven cuts may cost half as much again.
        assert!(mean_square < 32.0, "{mean_square}");
        assert!(palette.table().len() <= 3 * 17);
    }
}
