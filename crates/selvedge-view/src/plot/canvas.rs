//! The canvas of charts: a picture in pixels from the top left corner, with its colours and
//! texts, as SVG by `plotters`.
//!
//! `plotters` counts in whole units, which would make curves jagged: everything is drawn [`UNIT`]
//! times too large and the picture is shown so much smaller.

use plotters::coord::Shift;
use plotters::prelude::{
    Circle, DashedLineSeries, DrawingArea, DrawingAreaErrorKind, FontDesc, FontFamily, FontStyle,
    FontTransform, IntoDrawingArea, PathElement, RGBColor, SVGBackend, WHITE,
};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::PlotError;

/// Units of the drawing in one pixel of the picture.
const UNIT: f64 = 8.0;

/// Width of dashed lines, and radius of marks [pixels].
const DASHED: f64 = 1.5;
const DOT: f64 = 3.0;

/// `plotters` draws a font of this size as one of size 1.
const FONT_UNIT: f64 = 1.24;

/// Told apart by most of the colour-blind too (Okabe and Ito 2008), without the yellow, which is
/// too light for lines.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(112, 72, 152),
];

/// The colour of rivals, with which the others are compared.
pub(super) const GREY: RGBColor = RGBColor(125, 125, 125);
/// The colour of texts and axes.
pub(super) const INK: RGBColor = RGBColor(51, 51, 51);
/// The colour of lines across the picture.
pub(super) const FAINT: RGBColor = RGBColor(228, 228, 228);

/// Height of most texts [pixels].
pub(super) const TEXT: f64 = 13.0;
/// Height of the title [pixels].
pub(super) const TITLE: f64 = 15.0;
/// From one line of text to the next [pixels].
pub(super) const LEADING: f64 = 17.0;

/// The colour of the `number`-th name.
pub(super) fn colour(number: usize) -> RGBColor {
    COLOURS[number % COLOURS.len()]
}

/// About how wide `text` is [pixels], for a font that nobody here knows.
pub(super) fn text_width(text: &str) -> f64 {
    0.56 * TEXT * text.chars().count() as f64
}

/// The look of a text, and its side of the point.
#[derive(Clone, Copy)]
pub(super) struct TextStyle {
    pub(super) size: f64,
    pub(super) colour: RGBColor,
    pub(super) weight: Weight,
    pub(super) anchor: Anchor,
}

/// The thickness of letters.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Weight {
    Normal,
    Bold,
}

/// The side of a text on which its point is, halfway up.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
    /// In the middle of a text that is read from below.
    Upwards,
}

impl TextStyle {
    /// An ordinary text.
    pub(super) fn plain(anchor: Anchor) -> Self {
        Self {
            size: TEXT,
            colour: INK,
            weight: Weight::Normal,
            anchor,
        }
    }
}

/// The lengths of the dashes of a line and of the gaps between them [pixels].
#[derive(Clone, Copy)]
pub(super) struct Dashes {
    pub(super) dash: f64,
    pub(super) gap: f64,
}

/// A point of the picture [pixels].
pub(super) type Point = [f64; 2];

/// A picture under way.
pub(super) struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
    title: &'a str,
}

/// A drawing of some size [pixels].
pub(super) trait Drawing {
    /// Above it.
    fn title(&self) -> &str;
    /// Width and height [pixels].
    fn size(&self) -> Point;
    /// Everything but the title.
    fn draw(&self, canvas: &Canvas<'_>) -> Result<(), PlotError>;
}

/// The SVG of a drawing.
pub(super) fn svg(drawing: &impl Drawing) -> Result<String, PlotError> {
    let size = drawing.size();
    let units = size.map(|pixels| (pixels * UNIT).round() as u32);
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, units.into()).into_drawing_area();
    let canvas = Canvas {
        area,
        title: drawing.title(),
    };
    canvas.check(canvas.area.fill(&WHITE))?;
    canvas.draw(drawing)?;
    canvas.check(canvas.area.present())?;
    drop(canvas);
    let drawn = format!("width=\"{}\" height=\"{}\"", units[0], units[1]);
    let shown = format!("width=\"{}\" height=\"{}\"", size[0], size[1]);
    Ok(svg.replacen(&drawn, &shown, 1))
}

impl Canvas<'_> {
    fn draw(&self, drawing: &impl Drawing) -> Result<(), PlotError> {
        let style = TextStyle {
            size: TITLE,
            weight: Weight::Bold,
            ..TextStyle::plain(Anchor::Left)
        };
        self.text(drawing.title(), [12.0, 20.0], style)?;
        drawing.draw(self)
    }

    /// Writes `text` at `at`.
    pub(super) fn text(&self, text: &str, at: Point, style: TextStyle) -> Result<(), PlotError> {
        let weight = match style.weight {
            Weight::Normal => FontStyle::Normal,
            Weight::Bold => FontStyle::Bold,
        };
        let size = style.size * UNIT * FONT_UNIT;
        let font = FontDesc::new(FontFamily::SansSerif, size, weight);
        let (font, across) = match style.anchor {
            Anchor::Left => (font, HPos::Left),
            Anchor::Middle => (font, HPos::Center),
            Anchor::Right => (font, HPos::Right),
            Anchor::Upwards => (font.transform(FontTransform::Rotate270), HPos::Center),
        };
        let style = plotters::style::TextStyle::from(font)
            .color(&style.colour)
            .pos(Pos::new(across, VPos::Center));
        self.check(self.area.draw_text(text, &style, units(at)))
    }

    /// Draws a line through `points`.
    pub(super) fn path(
        &self,
        points: impl IntoIterator<Item = Point>,
        colour: RGBColor,
        width: f64,
    ) -> Result<(), PlotError> {
        let style = colour.stroke_width((width * UNIT).round() as u32);
        let points: Vec<(i32, i32)> = points.into_iter().map(units).collect();
        self.check(self.area.draw(&PathElement::new(points, style)))
    }

    /// Draws a line of dashes through `points`.
    pub(super) fn dashes(
        &self,
        points: impl IntoIterator<Item = Point>,
        colour: RGBColor,
        pattern: Dashes,
    ) -> Result<(), PlotError> {
        let style = colour.stroke_width((DASHED * UNIT).round() as u32);
        let points: Vec<(i32, i32)> = points.into_iter().map(units).collect();
        let [dash, gap] = [pattern.dash, pattern.gap].map(|pixels| (pixels * UNIT).round() as u32);
        for piece in DashedLineSeries::new(points, dash, gap, style) {
            self.check(self.area.draw(&piece))?;
        }
        Ok(())
    }

    /// Marks a point.
    pub(super) fn dot(&self, at: Point, colour: RGBColor) -> Result<(), PlotError> {
        let radius = (DOT * UNIT).round() as i32;
        self.check(
            self.area
                .draw(&Circle::new(units(at), radius, colour.filled())),
        )
    }

    fn check<E: std::error::Error + Send + Sync>(
        &self,
        result: Result<(), DrawingAreaErrorKind<E>>,
    ) -> Result<(), PlotError> {
        result.map_err(|error| PlotError::Drawing {
            title: self.title.to_owned(),
            problem: error.to_string(),
        })
    }
}

fn units(point: Point) -> (i32, i32) {
    let [x, y] = point.map(|pixels| (pixels * UNIT).round() as i32);
    (x, y)
}
