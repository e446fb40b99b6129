//! Marks are round and enclose the values; pictures say what they show, in the same bytes each
//! time.

use proptest::prelude::*;

use super::ticks::{label, linear, logarithmic};
use super::*;

fn chart(points: Vec<[f64; 2]>) -> LineChart {
    let axis = |label: &str| Axis {
        label: label.to_owned(),
        scale: Scale::Linear,
    };
    LineChart {
        title: "error <by> time".to_owned(),
        x: axis("time (s)"),
        y: axis("RMSE (mm)"),
        lines: vec![Line {
            name: "ours & theirs".to_owned(),
            role: Role::Subject,
            points,
        }],
    }
}

#[test]
fn marks_are_at_round_numbers() {
    assert_eq!(linear(0.0, 9.3).at, [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
    assert_eq!(linear(0.0, 0.0).at.len(), 6);
    let decades = |low: f64, high: f64| -> Vec<String> {
        let marks = logarithmic(low.log10(), high.log10()).at;
        marks.iter().map(|m| label(10_f64.powf(*m))).collect()
    };
    assert_eq!(decades(1.0, 200.0), ["1", "10", "100", "1000"]);
    assert_eq!(decades(3.0, 40.0), ["2", "5", "10", "20", "50"]);
    let words = [0.0, 1e-17, 0.25, 1000.0, 2e6, 1e-5].map(label);
    assert_eq!(words, ["0", "0", "0.25", "1000", "2e6", "1e-5"]);
}

proptest! {
    #[test]
    fn marks_enclose_the_values(low in -1e6..1e6_f64, span in 0.0..1e6_f64) {
        let high = low + span;
        let ticks = linear(low, high);
        // The step is at least a tenth of the span; the ends may be short of it by 1e-9 of one.
        let slack = 1e-8 * (1.0 + high.abs().max(low.abs()));
        prop_assert!(ticks.start <= low + slack && ticks.end >= high - slack);
        prop_assert!((2..=12).contains(&ticks.at.len()), "{}", ticks.at.len());
    }

    #[test]
    fn logarithmic_marks_enclose_the_values(low in -9.0..9.0_f64, span in 0.0..12.0_f64) {
        let ticks = logarithmic(low, low + span);
        prop_assert!(ticks.start <= low + 1e-8 && ticks.end >= low + span - 1e-8);
        prop_assert!(ticks.start < ticks.end);
        prop_assert!((1..=12).contains(&ticks.at.len()), "{}", ticks.at.len());
    }
}

#[test]
fn a_chart_says_what_it_shows_and_escapes_it() {
    let chart = chart(vec![[0.0, 0.0], [1.0, 4.0]]);
    let svg = chart.to_svg().unwrap();
    assert!(svg.starts_with("<svg width=\"860\" height=\"460\" viewBox=\"0 0 6880 3680\""));
    assert!(svg.trim_end().ends_with("</svg>"));
    for text in [
        "error &lt;by&gt; time",
        "time (s)",
        "RMSE (mm)",
        "ours &amp; theirs",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    assert_eq!(svg, chart.to_svg().unwrap());
}

/// The points of the polylines of this width, in units of the drawing.
fn polyline(svg: &str, width: &str) -> Vec<[f64; 2]> {
    let line = svg.lines().find(|line| {
        line.contains("<polyline") && line.contains(&format!("stroke-width=\"{width}\""))
    });
    let points = line.unwrap().split("points=\"").nth(1).unwrap();
    let points = points.split('"').next().unwrap().split_whitespace();
    let number = |text: &str| text.parse::<f64>().unwrap();
    points
        .map(|point| point.split_once(',').unwrap())
        .map(|(x, y)| [number(x), number(y)])
        .collect()
}

#[test]
fn points_are_where_their_values_say() {
    let chart = chart(vec![[0.0, 0.0], [1.0, 5.0], [2.0, 10.0]]);
    let svg = chart.to_svg().unwrap();
    let [a, b, c] = polyline(&svg, "16")[..] else {
        panic!("three points");
    };
    for axis in 0..2 {
        // Halfway, to half a unit of each of the three roundings.
        assert!((2.0 * b[axis] - a[axis] - c[axis]).abs() <= 2.0);
    }
    assert!(a[0] < c[0] && a[1] > c[1]);
}

#[test]
fn a_logarithmic_axis_leaves_out_what_has_no_place() {
    let mut chart = chart(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 10.0], [3.0, 100.0]]);
    chart.y.scale = Scale::Logarithmic;
    let points = polyline(&chart.to_svg().unwrap(), "16");
    assert_eq!(points.len(), 3);
    let steps = [points[0][1] - points[1][1], points[1][1] - points[2][1]];
    assert!((steps[0] - steps[1]).abs() <= 2.0, "{steps:?}");
    chart.lines[0].points.truncate(1);
    assert!(matches!(chart.to_svg(), Err(PlotError::Empty(_))));
}

#[test]
fn a_value_that_is_not_finite_is_named() {
    let error = chart(vec![[0.0, f64::INFINITY]]).to_svg().unwrap_err();
    assert!(error.to_string().contains("ours & theirs"), "{error}");
}
