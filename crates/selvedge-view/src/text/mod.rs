//! Captions: anti-aliased text in the crate's own line font.
//!
//! Characters that the font lacks show as a hollow box.

pub(crate) mod font;

use glam::Vec2;

use crate::image::stroke::{Segment, between, stroke};
use crate::text::font::{CAPITAL_HEIGHT, SPACING, glyph};
use crate::{Image, Rgb};

/// The side of a text at its place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Align {
    /// The text starts there.
    #[default]
    Left,
    /// The middle of the text is there.
    Centre,
    /// The text ends there.
    Right,
}

/// The look of a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextStyle {
    /// Height of capitals `[pixels]`.
    pub height: f32,
    /// Width of strokes as a part of the height of capitals; 0.12 is regular, 0.17 bold.
    pub weight: f32,
    /// Colour.
    pub colour: Rgb,
    /// Side.
    pub align: Align,
}

/// Width of `text` `[pixels]` with capitals of `height` `[pixels]`.
#[must_use]
pub fn text_width(text: &str, height: f32) -> f32 {
    let units: f32 = text
        .chars()
        .map(|c| f32::from(glyph(c).width) + SPACING)
        .sum();
    (units - SPACING).max(0.0) * height / CAPITAL_HEIGHT
}

/// Draws one line of `text`, its base line at `place` (x, y) `[pixels]`. Parts outside the image
/// are cut off.
pub fn draw_text(image: &mut Image, text: &str, place: [f32; 2], style: &TextStyle) {
    let unit = style.height / CAPITAL_HEIGHT;
    let width = text_width(text, style.height);
    let start = match style.align {
        Align::Left => 0.0,
        Align::Centre => 0.5 * width,
        Align::Right => width,
    };
    let place = Vec2::from_array(place);
    let mut origin = Vec2::new(-start, -style.height);
    let pen = (style.weight * style.height).max(0.9);
    for character in text.chars() {
        let glyph = glyph(character);
        let mut segments = segments(glyph.strokes, origin, unit);
        segments
            .iter_mut()
            .flatten()
            .for_each(|point| *point += place);
        stroke(image, &segments, pen, style.colour);
        origin.x += (f32::from(glyph.width) + SPACING) * unit;
    }
}

fn segments(strokes: &str, origin: Vec2, unit: f32) -> Vec<Segment> {
    let mut segments = Vec::new();
    for stroke in strokes.split_whitespace() {
        let (kind, digits) = match stroke.as_bytes() {
            [kind @ (b'~' | b'@'), digits @ ..] => (*kind, digits),
            digits => (b' ', digits),
        };
        let points: Vec<Vec2> = digits
            .chunks_exact(2)
            .map(|pair| origin + unit * Vec2::new(digit(pair[0]), digit(pair[1])))
            .collect();
        let line = match kind {
            b'~' => open_spline(&points),
            b'@' => closed_spline(&points),
            _ => points,
        };
        segments.extend(between(&line));
    }
    segments
}

fn digit(byte: u8) -> f32 {
    let value = match byte {
        b'0'..=b'9' => byte - b'0',
        _ => byte.wrapping_sub(b'a').wrapping_add(10),
    };
    f32::from(value)
}

/// Pieces per quadratic arc.
const PIECES: usize = 7;

/// From `start` by `control` to `end`, without `start` itself.
fn arc(line: &mut Vec<Vec2>, start: Vec2, control: Vec2, end: Vec2) {
    line.extend((1..=PIECES).map(|piece| {
        let t = piece as f32 / PIECES as f32;
        start.lerp(control, t).lerp(control.lerp(end, t), t)
    }));
}

fn open_spline(points: &[Vec2]) -> Vec<Vec2> {
    let [first, inner @ .., last] = points else {
        return points.to_vec();
    };
    let mut line = vec![*first];
    let mut start = *first;
    for (k, &control) in inner.iter().enumerate() {
        let end = inner
            .get(k + 1)
            .map_or(*last, |&next| control.midpoint(next));
        arc(&mut line, start, control, end);
        start = end;
    }
    line
}

fn closed_spline(points: &[Vec2]) -> Vec<Vec2> {
    let count = points.len();
    let middle = |k: usize| points[k % count].midpoint(points[(k + 1) % count]);
    let mut line: Vec<Vec2> = points
        .first()
        .map(|_| middle(count - 1))
        .into_iter()
        .collect();
    for (k, &control) in points.iter().enumerate() {
        arc(&mut line, middle(k + count - 1), control, middle(k));
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    const STYLE: TextStyle = TextStyle {
        height: 14.0,
        weight: 2.0 / 14.0,
        colour: [0; 3],
        align: Align::Left,
    };

    #[test]
    fn a_vertical_stroke_covers_width_times_height() {
        // "I" from (10, 6) to (10, 20), 2 pixels wide: columns 9 and 10 are full.
        let mut image = Image::filled(20, 30, [255; 3]).unwrap();
        draw_text(&mut image, "I", [10.0, 20.0], &STYLE);
        for y in 6..20 {
            let row: Vec<u8> = (8..12).map(|x| image.pixel(x, y).unwrap()[0]).collect();
            assert_eq!(row, [255, 0, 0, 255], "row {y}");
        }
    }

    #[test]
    fn every_printable_character_has_a_glyph_inside_its_box() {
        let fallback = glyph('\u{1}').strokes;
        for character in (' '..='~').chain("°µ²×→·–".chars()) {
            let glyph = glyph(character);
            assert_ne!(glyph.strokes, fallback, "{character:?}");
            for stroke in glyph.strokes.split_whitespace() {
                let digits = stroke.trim_start_matches(['~', '@']);
                assert!(
                    digits.len() >= 4 && digits.len().is_multiple_of(2),
                    "{character:?}"
                );
            }
            for point in segments(glyph.strokes, Vec2::ZERO, 1.0).iter().flatten() {
                let inside = (0.0..=f32::from(glyph.width)).contains(&point.x);
                assert!(inside && point.y <= 18.0, "{character:?} at {point}");
            }
        }
    }

    #[test]
    fn aligned_text_starts_where_its_width_says() {
        let first_dark = |align, x: f32| {
            let mut image = Image::filled(80, 24, [255; 3]).unwrap();
            draw_text(&mut image, "Hi", [x, 20.0], &TextStyle { align, ..STYLE });
            (0..80)
                .find(|&x| (0..24).any(|y| image.pixel(x, y).unwrap() != [255; 3]))
                .unwrap()
        };
        let width = text_width("Hi", 14.0);
        let left = first_dark(Align::Left, 20.0);
        assert_eq!(first_dark(Align::Right, 20.0 + width), left);
        assert_eq!(first_dark(Align::Centre, 20.0 + 0.5 * width), left);
        assert_eq!(text_width("", 14.0), 0.0);
        // Digits are equally wide.
        assert_eq!(text_width("1.11", 9.0), text_width("0.84", 9.0));
    }

    #[test]
    fn text_outside_the_image_is_cut_off() {
        let mut image = Image::filled(6, 6, [255; 3]).unwrap();
        draw_text(&mut image, "Wide", [-500.0, 3.0], &STYLE);
        draw_text(&mut image, "Wide", [500.0, 900.0], &STYLE);
        assert!(image.pixels().iter().all(|p| *p == [255; 3]));
    }
}
