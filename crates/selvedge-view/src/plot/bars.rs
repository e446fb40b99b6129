//! Bars beside each other, lying, so that long names can be read: one row each, in groups that have
//! a heading. The same name has the same colour in every group.

use super::PlotError;
use super::canvas::{
    self, Anchor, Canvas, Drawing, FAINT, GREY, INK, Point, TextStyle, Weight, colour, text_width,
};
use super::lines::Role;
use super::ticks::{self, Ticks};

/// Width of the picture [pixels].
const WIDTH: f64 = 860.0;
/// Height of a row, of a heading, and of what is above and below all rows [pixels].
const ROW: f64 = 24.0;
const HEADING: f64 = 28.0;
const ABOVE: f64 = 40.0;
const BELOW: f64 = 56.0;
/// The widest that names may make the left margin [pixels].
const WIDEST_NAMES: f64 = 360.0;
/// Room for a number right of the longest bar [pixels].
const NUMBER: f64 = 90.0;

/// Bars in groups.
#[derive(Clone, Debug, PartialEq)]
pub struct BarChart {
    /// The text above the picture.
    pub title: String,
    /// The measured quantity, with its unit.
    pub axis: String,
    /// The groups from top to bottom.
    pub groups: Vec<BarGroup>,
}

/// Bars that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct BarGroup {
    /// The text above them; may be empty.
    pub heading: String,
    /// The bars from top to bottom.
    pub bars: Vec<Bar>,
}

/// A bar, its name and its number.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// The text left of it.
    pub name: String,
    /// The role that decides its colour.
    pub role: Role,
    /// The length from 0; none where there is no value.
    pub value: Option<f64>,
    /// The text right of it.
    pub text: String,
}

/// A chart that can be drawn.
struct BarDrawing<'a> {
    chart: &'a BarChart,
    place: Place,
}

impl Drawing for BarDrawing<'_> {
    fn title(&self) -> &str {
        &self.chart.title
    }

    fn size(&self) -> Point {
        [WIDTH, self.place.bottom + BELOW]
    }

    fn draw(&self, canvas: &Canvas<'_>) -> Result<(), PlotError> {
        self.chart.draw_axis(canvas, &self.place)?;
        self.chart.draw_bars(canvas, &self.place)
    }
}

impl BarChart {
    /// The picture as SVG.
    ///
    /// # Errors
    /// [`PlotError`] where there is no bar, or one that is not finite.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        canvas::svg(&self.drawing()?)
    }

    fn drawing(&self) -> Result<BarDrawing<'_>, PlotError> {
        let bars = || self.groups.iter().flat_map(|group| &group.bars);
        if bars().next().is_none() {
            let title = self.title.clone();
            return Err(PlotError::Empty { title });
        }
        for bar in bars() {
            if let Some(value) = bar.value.filter(|value| !value.is_finite()) {
                return Err(PlotError::NonFinite {
                    title: self.title.clone(),
                    name: bar.name.clone(),
                    value,
                });
            }
        }
        let highest = bars().filter_map(|bar| bar.value).fold(0.0, f64::max);
        let widest = bars().map(|bar| text_width(&bar.name)).fold(0.0, f64::max);
        let left = 24.0 + widest.min(WIDEST_NAMES);
        let heights = self.groups.iter().map(BarGroup::height);
        let place = Place {
            ticks: ticks::linear(0.0, highest),
            ends: [left, WIDTH - NUMBER],
            bottom: ABOVE + heights.sum::<f64>(),
        };
        Ok(BarDrawing { chart: self, place })
    }

    fn draw_axis(&self, canvas: &Canvas<'_>, place: &Place) -> Result<(), PlotError> {
        let bottom = place.bottom;
        for &mark in &place.ticks.at {
            let x = place.of(mark);
            canvas.path([[x, ABOVE], [x, bottom]], FAINT, 1.0)?;
            let at = [x, bottom + 13.0];
            let text = ticks::label(mark);
            canvas.text(&text, at, TextStyle::plain(Anchor::Middle))?;
        }
        let [left, right] = place.ends;
        canvas.path([[left, ABOVE], [left, bottom]], INK, 1.0)?;
        let at = [(left + right) / 2.0, bottom + 38.0];
        canvas.text(&self.axis, at, TextStyle::plain(Anchor::Middle))
    }

    fn draw_bars(&self, canvas: &Canvas<'_>, place: &Place) -> Result<(), PlotError> {
        let mut names: Vec<&str> = Vec::new();
        let mut y = ABOVE;
        for group in &self.groups {
            if !group.heading.is_empty() {
                let style = TextStyle {
                    weight: Weight::Bold,
                    ..TextStyle::plain(Anchor::Left)
                };
                canvas.text(&group.heading, [12.0, y + 0.6 * HEADING], style)?;
                y += HEADING;
            }
            for bar in &group.bars {
                let colour = match bar.role {
                    Role::Rival => GREY,
                    Role::Subject => {
                        let known = names.iter().position(|name| *name == bar.name);
                        colour(known.unwrap_or_else(|| {
                            names.push(&bar.name);
                            names.len() - 1
                        }))
                    }
                };
                let middle = y + ROW / 2.0;
                let left = place.ends[0];
                let at = [left - 8.0, middle];
                canvas.text(&bar.name, at, TextStyle::plain(Anchor::Right))?;
                let end = place.of(bar.value.unwrap_or(0.0));
                let corners: [Point; 2] = [[left, y + 3.0], [end, y + ROW - 3.0]];
                canvas.rectangle(corners, colour)?;
                let at = [end + 6.0, middle];
                canvas.text(&bar.text, at, TextStyle::plain(Anchor::Left))?;
                y += ROW;
            }
        }
        Ok(())
    }
}

impl BarGroup {
    fn height(&self) -> f64 {
        let heading = if self.heading.is_empty() {
            0.0
        } else {
            HEADING
        };
        heading + ROW * self.bars.len() as f64
    }
}

/// The places of values in the picture.
struct Place {
    ticks: Ticks,
    ends: [f64; 2],
    bottom: f64,
}

impl Place {
    fn of(&self, value: f64) -> f64 {
        let [from, to] = self.ends;
        from + (to - from) * value / self.ticks.end
    }
}
