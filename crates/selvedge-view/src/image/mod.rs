//! An image of sRGB bytes, the few operations that compose a page, and PNG.

pub(crate) mod colour;

use std::io::Write;

use crate::image::colour::mix;
use crate::{Rgb, ViewError};

/// An RGB image of 8 bits per channel, rows from top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<Rgb>,
}

/// The most pixels of a side: the limit of GIF.
pub(crate) const LARGEST_SIDE: u32 = 65_535;
/// The most pixels, or samples, that an image may have: 16384 × 16384.
const MOST_PIXELS: u64 = 1 << 28;

impl Image {
    /// An image of one colour.
    pub fn filled(width: u32, height: u32, colour: Rgb) -> Result<Self, ViewError> {
        check_size("image", [width, height])?;
        Ok(Self {
            width,
            height,
            pixels: vec![colour; width as usize * height as usize],
        })
    }

    /// Pixels per row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row by row, `[height * width]`.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    pub(crate) fn pixels_mut(&mut self) -> &mut [Rgb] {
        &mut self.pixels
    }

    /// The pixel in column `x` of row `y`, or `None` outside the image.
    #[cfg(test)]
    pub(crate) fn pixel(&self, x: u32, y: u32) -> Option<Rgb> {
        (x < self.width && y < self.height)
            .then(|| self.pixels[y as usize * self.width as usize + x as usize])
    }

    /// Mixes `share` (in [0, 1]) of `colour` into a pixel; outside the image nothing happens.
    pub(crate) fn blend(&mut self, x: i32, y: i32, colour: Rgb, share: f32) {
        let inside = (0..self.width as i32).contains(&x) && (0..self.height as i32).contains(&y);
        if inside && share > 0.0 {
            let at = y as usize * self.width as usize + x as usize;
            self.pixels[at] = mix(self.pixels[at], colour, share.min(1.0));
        }
    }

    /// Fills the part of a rectangle that lies in the image, from its top left `corner`.
    pub(crate) fn fill(&mut self, corner: [u32; 2], size: [u32; 2], colour: Rgb) {
        let ([left, top], [width, height]) = (corner, size);
        let right = left.saturating_add(width).min(self.width) as usize;
        let left = (left as usize).min(right);
        for y in top..top.saturating_add(height).min(self.height) {
            let row = y as usize * self.width as usize;
            self.pixels[row + left..row + right].fill(colour);
        }
    }

    /// Copies the part of `source` that fits, its top left corner to `corner` (x, y).
    pub(crate) fn paste(&mut self, source: &Self, corner: [u32; 2]) {
        let [left, top] = corner;
        let columns = source.width.min(self.width.saturating_sub(left)) as usize;
        let rows = source.height.min(self.height.saturating_sub(top));
        for y in 0..rows {
            let from = y as usize * source.width as usize;
            let to = (top + y) as usize * self.width as usize + left as usize;
            self.pixels[to..to + columns].copy_from_slice(&source.pixels[from..from + columns]);
        }
    }

    /// Writes the image as PNG (8-bit RGB, marked as sRGB).
    pub fn write_png(&self, out: &mut dyn Write) -> Result<(), ViewError> {
        let mut encoder = png::Encoder::new(out, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(())
    }

    /// The image as the bytes of a PNG file.
    pub fn to_png(&self) -> Result<Vec<u8>, ViewError> {
        let mut bytes = Vec::new();
        self.write_png(&mut bytes)?;
        Ok(bytes)
    }
}

/// Checks that both sides are between 1 and [`LARGEST_SIDE`], and the area at most
/// [`MOST_PIXELS`].
pub(crate) fn check_size(field: &'static str, size: [u32; 2]) -> Result<(), ViewError> {
    let [width, height] = size;
    let fits = 1..=LARGEST_SIDE;
    if !(fits.contains(&width) && fits.contains(&height)) {
        return Err(ViewError::Invalid(format!(
            "{field} is {width} x {height} pixels: both must be between 1 and {LARGEST_SIDE}"
        )));
    }
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(ViewError::Invalid(format!(
            "{field} is {width} x {height} pixels: together at most {MOST_PIXELS} are allowed"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_decodes_to_the_same_pixels() {
        let mut image = Image::filled(7, 5, [9, 8, 7]).unwrap();
        for (k, pixel) in image.pixels_mut().iter_mut().enumerate() {
            *pixel = [k as u8, 3 * k as u8, 255 - k as u8];
        }
        let bytes = image.to_png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut decoded = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut decoded).unwrap();
        assert_eq!((info.width, info.height), (7, 5));
        assert_eq!(info.color_type, png::ColorType::Rgb);
        assert_eq!(decoded, image.pixels().as_flattened());
    }

    #[test]
    fn no_pixels_or_more_than_fit_in_memory_are_an_error() {
        for ([width, height], words) in [
            ([0, 5], "0 x 5 pixels: both must be between 1 and 65535"),
            (
                [60_000; 2],
                "60000 x 60000 pixels: together at most 268435456 are allowed",
            ),
        ] {
            let error = Image::filled(width, height, [0; 3]).unwrap_err();
            assert_eq!(error.to_string(), format!("image is {words}"));
        }
    }

    #[test]
    fn paste_and_fill_stay_inside() {
        let mut page = Image::filled(4, 4, [0; 3]).unwrap();
        let stamp = Image::filled(3, 3, [1; 3]).unwrap();
        page.paste(&stamp, [2, 2]);
        page.fill([3, 0], [9, 1], [2; 3]);
        page.paste(&stamp, [9, 9]);
        let count = |colour: Rgb| page.pixels().iter().filter(|p| **p == colour).count();
        assert_eq!((count([1; 3]), count([2; 3])), (4, 1));
    }
}
