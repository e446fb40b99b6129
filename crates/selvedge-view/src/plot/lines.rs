//! Lines over an axis by `plotters`, with their names beside the picture.
//!
//! `plotters` counts in whole units, which would make curves jagged: everything is drawn [`UNIT`]
//! times too large and the picture is shown so much smaller.

use std::error::Error;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::element::Text;
use plotters::prelude::{
    ChartBuilder, Circle, DashedLineSeries, DrawingArea, FontDesc, FontFamily, FontStyle,
    IntoDrawingArea, LineSeries, PathElement, RGBColor, SVGBackend, TRANSPARENT, WHITE,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, TextStyle};

use super::PlotError;
use super::ticks::{self, Ticks};

/// Units of the drawing in one pixel of the picture.
const UNIT: i32 = 8;
/// `plotters` draws a font of this size as one of size 1.
const FONT_UNIT: f64 = 1.24;
/// Size of the picture `[pixels]`.
const SIZE: [i32; 2] = [860, 460];
/// Left of the values, under them, and around the picture `[pixels]`.
const LEFT: i32 = 66;
const BOTTOM: i32 = 44;
const MARGIN: i32 = 12;
/// From one name to the next, and the line before a name `[pixels]`.
const LEADING: i32 = 17;
const KEY: i32 = 22;
/// Dashes of rivals, and the gaps between them `[pixels]`.
const DASHES: [i32; 2] = [7, 4];
/// So few points are marked each.
const FEW: usize = 16;
/// The most characters that names have room for.
const MOST_CHARACTERS: usize = 34;

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
const GREY: RGBColor = RGBColor(125, 125, 125);
/// The colour of texts and axes.
const INK: RGBColor = RGBColor(51, 51, 51);
/// The colour of lines across the picture.
const FAINT: RGBColor = RGBColor(228, 228, 228);

/// Lines over an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LineChart {
    /// The text above the picture.
    pub title: String,
    /// The varied quantity.
    pub x: Axis,
    /// The measured quantity.
    pub y: Axis,
    /// The lines, in the order of their colours.
    pub lines: Vec<Line>,
}

/// An axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// The quantity with its unit, as "position RMSE (mm)".
    pub label: String,
    /// The scale from values to places.
    pub scale: Scale,
}

/// The scale from values to places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    Linear,
    /// By their logarithm; values that are not positive have no place and are left out.
    Logarithmic,
}

impl Scale {
    fn place(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Logarithmic => value.log10(),
        }
    }
}

/// A line and its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The text beside the picture.
    pub name: String,
    /// The role that decides its look.
    pub role: Role,
    /// (x, y) in the order in which they are joined.
    pub points: Vec<[f64; 2]>,
}

/// The role of a line or a bar in a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Drawn in a colour of its own.
    Subject,
    /// Drawn grey and dashed: the subjects are compared with it.
    Rival,
}

impl Ranged for Ticks {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (place - self.start) / (self.end - self.start);
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.at.clone()
    }

    fn range(&self) -> Range<f64> {
        self.start..self.end
    }
}

impl LineChart {
    /// The picture as SVG.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let (title, lines) = (&self.title, &self.lines);
        for Line { name, points, .. } in lines {
            if let Some(value) = points.iter().flatten().find(|value| !value.is_finite()) {
                return Err(PlotError::Invalid(format!(
                    "{title:?}: a value of {name:?} is {value}: values must be finite"
                )));
            }
        }
        let (Some(x), Some(y)) = (self.ticks(0), self.ticks(1)) else {
            return Err(PlotError::Empty(title.clone()));
        };
        let [width, height] = SIZE.map(|pixels| (UNIT * pixels) as u32);
        let mut svg = String::new();
        let area = SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area();
        let drawn = self.draw(&area, x, y);
        drop(area);
        drawn.map_err(|problem| {
            PlotError::Invalid(format!("{title:?} could not be drawn: {problem}"))
        })?;
        let drawn = format!("width=\"{width}\" height=\"{height}\"");
        let shown = format!("width=\"{}\" height=\"{}\"", SIZE[0], SIZE[1]);
        Ok(svg.replacen(&drawn, &shown, 1))
    }

    /// The points of a line that have a place, at their places.
    fn places(&self, line: &Line) -> Vec<(f64, f64)> {
        let points = line.points.iter();
        let places = points.map(|&[x, y]| (self.x.scale.place(x), self.y.scale.place(y)));
        places
            .filter(|place| place.0.is_finite() && place.1.is_finite())
            .collect()
    }

    /// The marks of the axis x (0) or y (1); none where no point can be shown.
    fn ticks(&self, axis: usize) -> Option<Ticks> {
        let places = self.lines.iter().flat_map(|line| self.places(line));
        let places = places.map(|(x, y)| [x, y][axis]);
        let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
            (low.min(place), high.max(place))
        });
        (low <= high).then(|| match [&self.x, &self.y][axis].scale {
            // What is measured in proportion is seen in proportion only from 0.
            Scale::Linear => ticks::linear(low.min(0.0), high),
            Scale::Logarithmic => ticks::logarithmic(low, high),
        })
    }

    fn draw(
        &self,
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        x: Ticks,
        y: Ticks,
    ) -> Result<(), Box<dyn Error>> {
        area.fill(&WHITE)?;
        let names = self.lines.iter().map(|line| line.name.chars().count());
        let names = names.max().unwrap_or(0).min(MOST_CHARACTERS) as i32;
        let right = KEY + 8 * names + 2 * MARGIN;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, text(15, FontStyle::Bold))
            .margin(MARGIN * UNIT)
            .margin_right(right * UNIT)
            .x_label_area_size(BOTTOM * UNIT)
            .y_label_area_size(LEFT * UNIT)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .bold_line_style(stroke(FAINT, 1))
            .light_line_style(TRANSPARENT)
            .axis_style(stroke(INK, 1))
            .set_all_tick_mark_size(5 * UNIT)
            .label_style(text(13, FontStyle::Normal))
            .x_label_formatter(&|place| ticks::label(value_at(*place, self.x.scale)))
            .y_label_formatter(&|place| ticks::label(value_at(*place, self.y.scale)))
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .draw()?;
        let mut colours = COLOURS.into_iter().cycle();
        let mut name_at = [SIZE[0] - right + MARGIN, 4 * MARGIN].map(|pixels| pixels * UNIT);
        for line in &self.lines {
            let colour = match line.role {
                Role::Subject => colours.next().unwrap_or(INK),
                Role::Rival => GREY,
            };
            let places = self.places(line);
            if places.is_empty() {
                continue;
            }
            if places.len() <= FEW {
                let mark = |&place| Circle::new(place, 3 * UNIT, colour.filled());
                chart.draw_series(places.iter().map(mark))?;
            }
            let [left, y] = name_at;
            let key = [(left, y), (left + (KEY - 4) * UNIT, y)];
            let style = stroke(colour, 2);
            let [dash, gap] = DASHES.map(|pixels| pixels * UNIT);
            match line.role {
                Role::Subject => {
                    chart.draw_series(LineSeries::new(places, style))?;
                    area.draw(&PathElement::new(key, style))?;
                }
                Role::Rival => {
                    chart.draw_series(DashedLineSeries::new(places, dash, gap, style))?;
                    for piece in DashedLineSeries::new(key, dash, gap, style) {
                        area.draw(&piece)?;
                    }
                }
            }
            let name = text(13, FontStyle::Normal).color(&colour);
            let name = name.pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(line.name.as_str(), (left + KEY * UNIT, y), name))?;
            name_at[1] += LEADING * UNIT;
        }
        Ok(area.present()?)
    }
}

fn value_at(place: f64, scale: Scale) -> f64 {
    match scale {
        Scale::Linear => place,
        Scale::Logarithmic => 10_f64.powf(place),
    }
}

/// A text of so many pixels; the reader's browser has the font.
fn text(pixels: i32, weight: FontStyle) -> TextStyle<'static> {
    let size = f64::from(pixels * UNIT) * FONT_UNIT;
    TextStyle::from(FontDesc::new(FontFamily::SansSerif, size, weight)).color(&INK)
}

fn stroke(colour: RGBColor, pixels: i32) -> plotters::style::ShapeStyle {
    colour.stroke_width((pixels * UNIT) as u32)
}
