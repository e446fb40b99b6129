//! The samples of a picture: a depth buffer and the light at each sample, averaged to pixels in
//! linear light.
//!
//! A sample keeps the light of the nearest surface, by its nearness, 1/depth. Only the rectangle
//! that a picture may cover is cleared and averaged.

use std::ops::Range;

use glam::{Vec2, Vec3A};

use super::backdrop::Backdrop;
use super::triangle::{Triangle, bounds};
use crate::image::colour::{Linear16, encoder, to_linear16};
use crate::{Image, ViewError};

/// The samples of pictures of one size; kept between frames to keep the memory.
#[derive(Clone, Debug)]
pub(crate) struct Samples {
    /// Width and height `[pixels]`.
    size: [u32; 2],
    /// Samples along a side of a pixel.
    factor: u32,
    /// 1/depth of each sample `[1/m]`; 0 where no surface is.
    nearness: Vec<f32>,
    light: Vec<Linear16>,
    /// The columns and rows of samples that the picture may cover.
    touched: [Range<usize>; 2],
}

impl Samples {
    /// Empty samples of pictures of `size` (width, height) `[pixels]`, `factor`² to a pixel.
    pub(crate) fn new(size: [u32; 2], factor: u32) -> Self {
        let count = size[0] as usize * size[1] as usize * (factor * factor) as usize;
        Self {
            size,
            factor,
            nearness: vec![0.0; count],
            light: vec![[0; 3]; count],
            touched: [0..0, 0..0],
        }
    }

    /// Width and height in samples.
    pub(crate) fn extent(&self) -> [usize; 2] {
        self.size.map(|side| (side * self.factor) as usize)
    }

    /// Empties the rectangle of the last picture. The next one covers no more than the box around
    /// `places` `[samples]`, widened by `reach`.
    pub(crate) fn clear(&mut self, places: impl Iterator<Item = Vec2>, reach: f32) {
        let [width, height] = self.extent();
        let [columns, rows] = self.touched.clone();
        for row in rows {
            let line = row * width;
            self.nearness[line + columns.start..line + columns.end].fill(0.0);
        }
        let (low, high) = places.fold((Vec2::MAX, Vec2::MIN), |(low, high), place| {
            (low.min(place), high.max(place))
        });
        self.touched = bounds([low, high, low], reach, width, height).unwrap_or([0..0, 0..0]);
    }

    /// Fills the samples of a triangle that are nearer than the present ones with the light at
    /// their weights and nearness.
    #[inline]
    pub(crate) fn fill(&mut self, triangle: &Triangle, light: impl Fn(Vec3A, f32) -> Vec3A) {
        let [width, height] = self.extent();
        let Some([columns, rows]) = triangle.bounds(width, height) else {
            return;
        };
        for row in rows {
            let line = row * width;
            let start = triangle.weights(Vec2::new(0.5, row as f32 + 0.5));
            for column in triangle.span(start, &columns) {
                let weights = start + triangle.across * column as f32;
                if weights.min_element() < 0.0 {
                    continue;
                }
                let nearness = weights.dot(triangle.nearness);
                let at = line + column;
                if nearness > self.nearness[at] {
                    self.nearness[at] = nearness;
                    self.light[at] = to_linear16(light(weights, nearness));
                }
            }
        }
    }

    /// Sets the samples within `reach` of a triangle for which `sample_at` gives a nearness that
    /// beats the present one.
    pub(crate) fn fill_near(
        &mut self,
        places: [Vec2; 3],
        reach: f32,
        sample_at: impl Fn(Vec2) -> Option<(f32, Linear16)>,
    ) {
        let [width, height] = self.extent();
        let Some([columns, rows]) = bounds(places, reach, width, height) else {
            return;
        };
        for row in rows {
            for column in columns.clone() {
                let sample = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let at = row * width + column;
                if let Some((nearness, light)) = sample_at(sample)
                    && nearness > self.nearness[at]
                {
                    self.nearness[at] = nearness;
                    self.light[at] = light;
                }
            }
        }
    }

    /// Averages the samples of each pixel; the empty ones show the backdrop.
    pub(crate) fn resolve(&self, backdrop: &Backdrop) -> Result<Image, ViewError> {
        let [width, height] = self.size;
        let mut image = Image::filled(width, height, [0; 3])?;
        let (factor, encode) = (self.factor as usize, encoder());
        let [columns, rows] = self
            .touched
            .clone()
            .map(|samples| samples.start / factor..samples.end.div_ceil(factor));
        for (pixel, colour) in image.pixels_mut().iter_mut().enumerate() {
            let (row, column) = (pixel / width as usize, pixel % width as usize);
            let light = if rows.contains(&row) && columns.contains(&column) {
                self.mean(row, column, || backdrop.colour(pixel))
            } else {
                backdrop.colour(pixel)
            };
            *colour = encode(light);
        }
        Ok(image)
    }

    /// The mean light of the samples of a pixel; an empty sample has the light of `behind`.
    fn mean(&self, row: usize, column: usize, behind: impl Fn() -> Linear16) -> Linear16 {
        let factor = self.factor as usize;
        let stride = self.size[0] as usize * factor;
        let first = row * factor * stride + column * factor;
        let (mut sum, mut covered) = ([0_u32; 3], 0_u32);
        for line in 0..factor {
            for at in first + line * stride..first + line * stride + factor {
                if self.nearness[at] > 0.0 {
                    covered += 1;
                    for (total, channel) in sum.iter_mut().zip(self.light[at]) {
                        *total += u32::from(channel);
                    }
                }
            }
        }
        let count = self.factor * self.factor;
        let empty = count - covered;
        let behind = if empty > 0 { behind() } else { [0; 3] };
        let share = 1.0 / count as f32;
        std::array::from_fn(|channel| {
            let total = sum[channel] + empty * u32::from(behind[channel]);
            (total as f32 * share) as u16
        })
    }
}
