//! A page of histograms: bars over a labelled axis, heights logarithmic, because a cloth that hangs
//! still for half of the time would leave one bar alone to be seen.
//!
//! The height of a bar is ln(1 + count)/ln(1 + largest count).

use crate::text::{Align, TextStyle, draw_text};
use crate::{Image, Rgb, ViewError};

/// One histogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HistogramPlot<'a> {
    /// The counted quantity.
    pub title: &'a str,
    /// The unit of the quantity.
    pub unit: &'a str,
    /// The start of the first bin and the end of the last.
    pub range: [f64; 2],
    /// Numbers in equal bins.
    pub counts: &'a [u64],
}

const PLOT: [u32; 2] = [480, 260];
const COLUMNS: usize = 2;
const MARGIN: u32 = 28;
const HEADING: u32 = 40;
/// Above and below the bars of a plot.
const ABOVE: u32 = 34;
const BELOW: u32 = 24;
const PAPER: Rgb = [255, 255, 255];
const INK: Rgb = [44, 50, 64];
const BAR: Rgb = [70, 92, 150];
const AXIS: Rgb = [190, 194, 202];

/// Draws histograms under a title, two beside each other.
///
/// # Errors
/// [`ViewError::Setting`] where there is no histogram, or one has no bins or no range;
/// [`ViewError::Size`] for a page too large.
pub fn histogram_page(title: &str, plots: &[HistogramPlot<'_>]) -> Result<Image, ViewError> {
    check(plots)?;
    let (columns, rows) = (COLUMNS.min(plots.len()), plots.len().div_ceil(COLUMNS));
    let side = |count: usize, one: u32| -> u32 {
        let all = count as u64 * u64::from(one + MARGIN) + u64::from(MARGIN);
        u32::try_from(all).unwrap_or(u32::MAX)
    };
    let height = side(rows, PLOT[1]).saturating_add(HEADING);
    let mut image = Image::filled(side(columns, PLOT[0]), height, PAPER)?;
    let place = [MARGIN as f32, (MARGIN + 16) as f32];
    draw_text(&mut image, title, place, &style(16.0, Align::Left));
    for (number, plot) in plots.iter().enumerate() {
        let (column, row) = ((number % columns) as u32, (number / columns) as u32);
        let left = MARGIN + column * (PLOT[0] + MARGIN);
        let top = HEADING + MARGIN + row * (PLOT[1] + MARGIN);
        draw(&mut image, plot, [left, top]);
    }
    Ok(image)
}

fn check(plots: &[HistogramPlot<'_>]) -> Result<(), ViewError> {
    let wrong = |field, expected, found: String| {
        Err(ViewError::Setting {
            field,
            expected,
            found,
        })
    };
    if plots.is_empty() {
        return wrong("plots", "at least one histogram", "none".to_owned());
    }
    for plot in plots {
        let [low, high] = plot.range;
        if plot.counts.is_empty() || plot.counts.len() > PLOT[0] as usize {
            let found = plot.counts.len().to_string();
            return wrong("counts", "between 1 and 480 bins", found);
        }
        if !(low.is_finite() && high.is_finite() && low < high) {
            return wrong("range", "finite and rising", format!("{low} to {high}"));
        }
    }
    Ok(())
}

fn draw(image: &mut Image, plot: &HistogramPlot<'_>, corner: [u32; 2]) {
    let [left, top] = corner;
    let title = format!("{} ({})", plot.title, plot.unit);
    let text = style(12.0, Align::Left);
    draw_text(image, &title, [left as f32, (top + 14) as f32], &text);
    let most = plot.counts.iter().copied().max().unwrap_or(0);
    let largest = format!("most in a bin: {most}");
    let right = (left + PLOT[0]) as f32;
    let end = style(10.0, Align::Right);
    draw_text(image, &largest, [right, (top + 14) as f32], &end);
    let (floor, tall) = (top + PLOT[1] - BELOW, PLOT[1] - ABOVE - BELOW);
    let bins = plot.counts.len() as u32;
    let edge = |bin: u32| left + bin * PLOT[0] / bins;
    for (bin, &count) in (0..bins).zip(plot.counts) {
        let height = bar_height(count, most, tall);
        // A pixel between bars.
        let width = (edge(bin + 1) - edge(bin)).saturating_sub(1).max(1);
        image.fill([edge(bin), floor - height], [width, height], BAR);
    }
    image.fill([left, floor], [PLOT[0], 1], AXIS);
    let base = (floor + 16) as f32;
    let [low, high] = plot.range;
    let ticks = [
        (low, Align::Left),
        ((low + high) / 2.0, Align::Centre),
        (high, Align::Right),
    ];
    for (number, (value, align)) in ticks.into_iter().enumerate() {
        let x = left as f32 + PLOT[0] as f32 * number as f32 / 2.0;
        let style = style(10.0, align);
        draw_text(image, &format!("{value}"), [x, base], &style);
    }
}

/// The height of a bar of `count` `[pixels]`, where the tallest bar, of `most`, has `tall`. A count
/// that is not 0 has at least one pixel.
fn bar_height(count: u64, most: u64, tall: u32) -> u32 {
    if count == 0 {
        return 0;
    }
    let share = (1.0 + count as f64).ln() / (1.0 + most as f64).ln();
    ((share * f64::from(tall)).round() as u32).clamp(1, tall)
}

fn style(height: f32, align: Align) -> TextStyle {
    TextStyle {
        height,
        colour: INK,
        align,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(counts: &[u64]) -> HistogramPlot<'_> {
        HistogramPlot {
            title: "speed",
            unit: "m/s",
            range: [0.0, 2.0],
            counts,
        }
    }

    #[test]
    fn bars_are_as_high_as_the_logarithm_says() {
        let counts = [0, 9, 99, 1];
        let image = histogram_page("t", &[plot(&counts)]).unwrap();
        let (left, floor) = (MARGIN, HEADING + MARGIN + PLOT[1] - BELOW);
        let tall = PLOT[1] - ABOVE - BELOW;
        // ln 10 is half of ln 100; ln 2 / ln 100 = 0.1505.
        let expected = [0, tall / 2, tall, (0.1505 * f64::from(tall)).round() as u32];
        for (bin, height) in (0..).zip(expected) {
            let x = left + bin * PLOT[0] / 4 + 20;
            let blue = (0..floor).filter(|&y| image.pixel(x, y) == Some(BAR));
            assert_eq!(blue.count() as u32, height, "{bin}");
        }
        assert_eq!(image.pixel(left, floor), Some(AXIS));
    }

    #[test]
    fn what_cannot_be_drawn_is_named() {
        let message = |plots: &[HistogramPlot<'_>]| {
            let error = histogram_page("", plots).unwrap_err();
            error.to_string()
        };
        assert!(message(&[]).contains("plots"));
        assert!(message(&[plot(&[])]).contains("counts"));
        let range = [f64::NAN, 1.0];
        let bad = HistogramPlot {
            range,
            ..plot(&[1])
        };
        assert!(message(&[bad]).contains("range"));
    }
}
