//! Lines over an axis, each with its name at its end.

use super::PlotError;
use super::canvas::{
    self, Anchor, Canvas, Dashes, Drawing, FAINT, GREY, INK, LEADING, Point, TEXT, TextStyle,
    colour, text_width,
};
use super::ticks::{self, Ticks};

/// Size of the picture [pixels].
const SIZE: Point = [860.0, 460.0];
/// Left of the values, and under them [pixels].
const LEFT: f64 = 78.0;
const BOTTOM: f64 = 58.0;
const TOP: f64 = 42.0;
/// So few points are marked each.
const FEW: usize = 16;
/// The dashes of rivals.
const RIVAL: Dashes = Dashes {
    dash: 7.0,
    gap: 4.0,
};
/// The widest that names may make the right margin [pixels].
const WIDEST_NAMES: f64 = 260.0;

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

/// A line and its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The text beside its end.
    pub name: String,
    /// The role that decides its look.
    pub role: Role,
    /// (x, y) in the order in which they are joined.
    pub points: Vec<Point>,
}

/// The role of a line or a bar in a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Drawn in a colour of its own.
    Subject,
    /// Drawn grey and dashed: the subjects are compared with it.
    Rival,
}

/// Both axes in the picture.
struct Frame {
    x: PlacedAxis,
    y: PlacedAxis,
}

/// An axis in the picture.
struct PlacedAxis {
    scale: Scale,
    ticks: Ticks,
    /// The places of both ends [pixels].
    start: f64,
    end: f64,
}

/// A line in places of the picture.
struct Placed<'a> {
    line: &'a Line,
    colour: plotters::style::RGBColor,
    points: Vec<Point>,
}

/// A chart that can be drawn.
struct LineDrawing<'a> {
    chart: &'a LineChart,
    frame: Frame,
}

impl Drawing for LineDrawing<'_> {
    fn title(&self) -> &str {
        &self.chart.title
    }

    fn size(&self) -> Point {
        SIZE
    }

    fn draw(&self, canvas: &Canvas<'_>) -> Result<(), PlotError> {
        let frame = &self.frame;
        self.chart.draw_axes(canvas, frame)?;
        let placed = self.chart.place(frame);
        for line in &placed {
            match line.line.role {
                Role::Subject => canvas.path(line.points.clone(), line.colour, 2.0)?,
                Role::Rival => canvas.dashes(line.points.clone(), line.colour, RIVAL)?,
            }
            if line.points.len() <= FEW {
                for &point in &line.points {
                    canvas.dot(point, line.colour)?;
                }
            }
        }
        draw_names(canvas, &placed, frame.x.end)
    }
}

impl LineChart {
    /// The picture as SVG.
    ///
    /// # Errors
    /// [`PlotError`] where there is no point that can be shown, or one that is not finite.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        canvas::svg(&self.drawing()?)
    }

    fn drawing(&self) -> Result<LineDrawing<'_>, PlotError> {
        for line in &self.lines {
            let values = line.points.iter().flatten();
            if let Some(&value) = values.into_iter().find(|value| !value.is_finite()) {
                return Err(PlotError::NonFinite {
                    title: self.title.clone(),
                    name: line.name.clone(),
                    value,
                });
            }
        }
        let frame = self.frame().ok_or_else(|| PlotError::Empty {
            title: self.title.clone(),
        })?;
        Ok(LineDrawing { chart: self, frame })
    }

    /// None where no point can be shown.
    fn frame(&self) -> Option<Frame> {
        let widest = self.lines.iter().map(|line| text_width(&line.name));
        let names = widest.fold(0.0, f64::max).min(WIDEST_NAMES);
        let shown = || {
            let all = self.lines.iter().flat_map(|line| &line.points);
            all.filter(|point| self.has_place(**point))
        };
        let ticks = |axis: usize, scale| {
            let values = || shown().map(move |point| point[axis]);
            let low = values().fold(f64::INFINITY, f64::min);
            let high = values().fold(f64::NEG_INFINITY, f64::max);
            (low <= high).then(|| match scale {
                // What is measured in proportion is seen in proportion only from 0.
                Scale::Linear => ticks::linear(low.min(0.0), high),
                Scale::Logarithmic => ticks::logarithmic(low, high),
            })
        };
        let right = SIZE[0] - names - 34.0;
        Some(Frame {
            x: PlacedAxis {
                scale: self.x.scale,
                ticks: ticks(0, self.x.scale)?,
                start: LEFT,
                end: right,
            },
            y: PlacedAxis {
                scale: self.y.scale,
                ticks: ticks(1, self.y.scale)?,
                start: SIZE[1] - BOTTOM,
                end: TOP,
            },
        })
    }

    fn has_place(&self, point: Point) -> bool {
        let [x, y] = point;
        let fits = |scale, value| scale == Scale::Linear || value > 0.0;
        fits(self.x.scale, x) && fits(self.y.scale, y)
    }

    fn place(&self, frame: &Frame) -> Vec<Placed<'_>> {
        let mut subjects = 0..;
        let mut placed = Vec::with_capacity(self.lines.len());
        for line in &self.lines {
            let shown = line.points.iter().filter(|point| self.has_place(**point));
            let points: Vec<Point> = shown.map(|point| frame.place(*point)).collect();
            let colour = match line.role {
                Role::Subject => colour(subjects.next().unwrap_or(0)),
                Role::Rival => GREY,
            };
            if !points.is_empty() {
                placed.push(Placed {
                    line,
                    colour,
                    points,
                });
            }
        }
        placed
    }

    fn draw_axes(&self, canvas: &Canvas<'_>, frame: &Frame) -> Result<(), PlotError> {
        let (left, right) = (frame.x.start, frame.x.end);
        let (bottom, top) = (frame.y.start, frame.y.end);
        for &mark in &frame.y.ticks.at {
            let y = frame.y.place_of_mark(mark);
            canvas.path([[left, y], [right, y]], FAINT, 1.0)?;
            let text = ticks::label(value_at(mark, frame.y.scale));
            canvas.text(&text, [left - 8.0, y], TextStyle::plain(Anchor::Right))?;
        }
        for &mark in &frame.x.ticks.at {
            let x = frame.x.place_of_mark(mark);
            canvas.path([[x, bottom], [x, bottom + 5.0]], INK, 1.0)?;
            let text = ticks::label(value_at(mark, frame.x.scale));
            let at = [x, bottom + 15.0];
            canvas.text(&text, at, TextStyle::plain(Anchor::Middle))?;
        }
        canvas.path([[left, bottom], [right, bottom]], INK, 1.0)?;
        let at = [(left + right) / 2.0, SIZE[1] - 18.0];
        canvas.text(&self.x.label, at, TextStyle::plain(Anchor::Middle))?;
        let at = [18.0, (top + bottom) / 2.0];
        canvas.text(&self.y.label, at, TextStyle::plain(Anchor::Upwards))
    }
}

impl Frame {
    fn place(&self, point: Point) -> Point {
        [self.x.place(point[0]), self.y.place(point[1])]
    }
}

impl PlacedAxis {
    /// The place of a value [pixels].
    fn place(&self, value: f64) -> f64 {
        self.place_of_mark(match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic => value.log10(),
        })
    }

    /// The place of a mark, on a logarithmic axis a power of ten [pixels].
    fn place_of_mark(&self, mark: f64) -> f64 {
        let Ticks { start, end, .. } = self.ticks;
        self.start + (self.end - self.start) * (mark - start) / (end - start)
    }
}

fn value_at(mark: f64, scale: Scale) -> f64 {
    match scale {
        Scale::Linear => mark,
        Scale::Logarithmic => 10_f64.powf(mark),
    }
}

/// The names beside the ends of their lines, moved apart where they would cover each other, each
/// tied to its end.
fn draw_names(canvas: &Canvas<'_>, placed: &[Placed<'_>], right: f64) -> Result<(), PlotError> {
    let mut names: Vec<(&Placed<'_>, Point)> = placed
        .iter()
        .filter_map(|line| Some((line, *line.points.last()?)))
        .collect();
    names.sort_by(|a, b| a.1[1].total_cmp(&b.1[1]));
    let ends: Vec<f64> = names.iter().map(|name| name.1[1]).collect();
    let heights = apart(&ends, TOP, SIZE[1] - BOTTOM);
    for ((line, end), y) in names.into_iter().zip(heights) {
        let bend = [right + 4.0, end[1]];
        canvas.path([end, bend, [right + 14.0, y]], line.colour, 0.75)?;
        let style = TextStyle {
            size: TEXT,
            colour: line.colour,
            ..TextStyle::plain(Anchor::Left)
        };
        canvas.text(&line.line.name, [right + 18.0, y], style)?;
    }
    Ok(())
}

/// Heights in the same order, a line of text apart, as near to the wanted ones (ascending) as going
/// down once and up once brings them, and between `low` and `high` where there is room.
fn apart(wanted: &[f64], low: f64, high: f64) -> Vec<f64> {
    let mut heights: Vec<f64> = Vec::with_capacity(wanted.len());
    for &height in wanted {
        let least = heights.last().map_or(low, |above| above + LEADING);
        heights.push(height.max(least));
    }
    let mut most = high;
    for height in heights.iter_mut().rev() {
        *height = height.min(most);
        most = *height - LEADING;
    }
    heights
}
