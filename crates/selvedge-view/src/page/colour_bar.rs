//! The key to a field's colours: its name, the map from end to end, and numbers below it.

use crate::image::colour::value_colour;
use crate::text::{Align, TextStyle, draw_text, text_width};
use crate::{Image, Rgb, ScalarField};

const INK: Rgb = [70, 76, 88];

/// The measures of a bar for captions of some height `[pixels]`.
struct Measures {
    number: f32,
    width: u32,
    thickness: u32,
}

impl Measures {
    fn new(caption: f32) -> Self {
        Self {
            number: 0.85 * caption,
            width: (15.0 * caption).round() as u32,
            thickness: (1.1 * caption).round() as u32,
        }
    }
}

/// Width of the bar with its name and numbers `[pixels]`, for captions of `caption` pixels.
pub(crate) fn colour_bar_width(field: &ScalarField, caption: f32) -> u32 {
    let measures = Measures::new(caption);
    let name = text_width(field.name(), caption) + 1.2 * caption;
    let overhang = text_width(&number(field.range()[1]), measures.number);
    name as u32 + measures.width + overhang as u32
}

/// Height of the bar with its numbers `[pixels]`.
pub(crate) fn colour_bar_height(caption: f32) -> u32 {
    (3.2 * caption).ceil() as u32
}

/// Draws the bar with its top left corner at `corner` (x, y) `[pixels]`.
pub(crate) fn draw_colour_bar(
    image: &mut Image,
    field: &ScalarField,
    corner: [u32; 2],
    caption: f32,
) {
    let [left, top] = corner;
    let measures = Measures::new(caption);
    let style = TextStyle {
        height: caption,
        colour: INK,
        align: Align::Left,
    };
    let place = [left as f32, top as f32 + caption];
    draw_text(image, field.name(), place, &style);
    let name = text_width(field.name(), caption) + 1.2 * caption;
    let start = left + name as u32;
    for column in 0..measures.width {
        let share = column as f32 / (measures.width - 1).max(1) as f32;
        let size = [1, measures.thickness];
        image.fill([start + column, top], size, value_colour(share));
    }
    let [low, high] = field.range();
    let base = top as f32 + measures.thickness as f32 + 1.6 * measures.number;
    for share in [0.0, 0.5, 1.0] {
        let x = start as f32 + share * measures.width as f32;
        let style = TextStyle {
            height: measures.number,
            align: Align::Centre,
            ..style
        };
        let text = number(low + share * (high - low));
        draw_text(image, &text, [x, base], &style);
    }
}

/// A number in at most three significant digits, without trailing zeros.
fn number(value: f32) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.1e}");
    }
    let digits = match size {
        s if s >= 100.0 => 0,
        s if s >= 10.0 => 1,
        s if s >= 1.0 => 2,
        s if s >= 0.1 => 3,
        _ => 4,
    };
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (2.5, "2.5"),
            (150.0, "150"),
            (75.0, "75"),
            (0.05, "0.05"),
            (3e-5, "3.0e-5"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn the_bar_shows_the_ends_of_its_map_and_stays_in_its_width() {
        let field = ScalarField::new("error [mm]", vec![vec![0.0, 19.0]]).unwrap();
        let width = colour_bar_width(&field, 10.0);
        let page = [255; 3];
        let mut image = Image::filled(width + 20, 60, page).unwrap();
        draw_colour_bar(&mut image, &field, [5, 5], 10.0);
        for end in [0.0, 1.0] {
            let colour = value_colour(end);
            assert!(image.pixels().contains(&colour), "no {colour:?}");
        }
        let below = 5 + colour_bar_height(10.0);
        let outside = |x: u32, y: u32| x >= 5 + width || y >= below;
        for (k, pixel) in image.pixels().iter().enumerate() {
            let (x, y) = (k as u32 % image.width(), k as u32 / image.width());
            assert!(!outside(x, y) || *pixel == page, "({x}, {y})");
        }
    }
}
