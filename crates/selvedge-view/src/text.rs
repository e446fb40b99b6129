//! Captions: anti-aliased text in a font of even width that is compiled in.
//!
//! Characters that the font lacks show as its box.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};

use crate::{Image, Rgb};

static FONT: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR).ok());

/// Height of a line over that of capitals.
const LINE: f32 = 1.597;

/// The side of a text at its place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Align {
    /// The text starts there.
    #[default]
    Left,
    /// The middle of the text is there.
    Centre,
}

/// The look of a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TextStyle {
    /// Height of capitals `[pixels]`.
    pub(crate) height: f32,
    pub(crate) colour: Rgb,
    pub(crate) align: Align,
}

/// Width of `text` `[pixels]` with capitals of `height` `[pixels]`.
pub(crate) fn text_width(text: &str, height: f32) -> f32 {
    let Some(font) = &*FONT else { return 0.0 };
    let font = font.as_scaled(PxScale::from(LINE * height));
    text.chars().map(|c| font.h_advance(font.glyph_id(c))).sum()
}

/// Draws one line of `text`, its base line at `place` (x, y) `[pixels]`. Parts outside the image
/// are cut off.
pub(crate) fn draw_text(image: &mut Image, text: &str, place: [f32; 2], style: &TextStyle) {
    let Some(font) = &*FONT else { return };
    let scale = PxScale::from(LINE * style.height);
    let share = match style.align {
        Align::Left => 0.0,
        Align::Centre => 0.5,
    };
    let mut x = place[0] - share * text_width(text, style.height);
    for character in text.chars() {
        let id = font.glyph_id(character);
        let glyph = id.with_scale_and_position(scale, point(x, place[1]));
        if let Some(outline) = font.outline_glyph(glyph) {
            let corner = outline.px_bounds().min;
            outline.draw(|column, row, cover| {
                let [x, y] = [(corner.x, column), (corner.y, row)]
                    .map(|(start, offset)| start as i32 + offset as i32);
                image.blend(x, y, style.colour, cover);
            });
        }
        x += font.as_scaled(scale).h_advance(id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STYLE: TextStyle = TextStyle {
        height: 14.0,
        colour: [0; 3],
        align: Align::Left,
    };

    #[test]
    fn a_capital_stands_on_the_base_line_and_is_as_high_as_asked() {
        let mut image = Image::filled(20, 30, [255; 3]).unwrap();
        draw_text(&mut image, "I", [5.0, 20.0], &STYLE);
        let is_inked = |y: u32| (0..20).any(|x| image.pixel(x, y).unwrap()[0] < 128);
        let inked: Vec<u32> = (0..30).filter(|&y| is_inked(y)).collect();
        assert_eq!(inked, (6..20).collect::<Vec<u32>>());
    }

    #[test]
    fn every_printable_character_has_a_glyph() {
        let font = FONT.as_ref().unwrap();
        for character in (' '..='~').chain("°µ²×→·–".chars()) {
            assert_ne!(font.glyph_id(character).0, 0, "{character:?}");
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
        assert_eq!(first_dark(Align::Centre, 20.0 + 0.5 * width), left);
        assert_eq!(text_width("", 14.0), 0.0);
    }

    #[test]
    fn text_outside_the_image_is_cut_off() {
        let mut image = Image::filled(6, 6, [255; 3]).unwrap();
        draw_text(&mut image, "Wide", [-500.0, 3.0], &STYLE);
        draw_text(&mut image, "Wide", [500.0, 900.0], &STYLE);
        assert!(image.pixels().iter().all(|p| *p == [255; 3]));
    }
}
