//! The plots of the paper: errors by steps (figure 3a), by time (figure 3b), and of whole runs side
//! by side (figures 3c and 5). None where there is nothing to show.

use selvedge_view::plot::{Axis, Bar, BarChart, BarGroup, Line, LineChart, PlotError, Role, Scale};

use super::{Contest, Subject};
use crate::evaluation::{Row, Timing, Who, summary};
use crate::numbers::length;

/// Lines that are so many times apart are drawn by their logarithm.
const FAR_APART: f64 = 30.0;

/// The error that a plot shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Of positions.
    Position,
    /// Of the lengths of edges.
    EdgeLength,
}

impl Measure {
    fn name(self) -> &'static str {
        match self {
            Self::Position => "position RMSE",
            Self::EdgeLength => "edge-length RMSE",
        }
    }

    fn curve(self, row: &Row) -> &[f64] {
        match self {
            Self::Position => &row.curves.position_rmse,
            Self::EdgeLength => &row.curves.edge_length_rmse,
        }
    }
}

fn role(who: Who) -> Role {
    match who {
        Who::Model => Role::Subject,
        Who::Rigid | Who::Mirror | Who::Physics | Who::Truth => Role::Rival,
    }
}

fn axis(label: String, scale: Scale) -> Axis {
    Axis { label, scale }
}

/// All but the truth, which has no error, with their names.
fn runners<'a>(contest: &'a Contest<'a>) -> impl Iterator<Item = (&'a Subject<'a>, String)> {
    let all = contest.subjects().zip(contest.names());
    all.filter(|(subject, _)| subject.who != Who::Truth)
}

/// Error over k steps from the truth, by k.
///
/// # Errors
/// A value that is not finite.
pub fn horizons_plot(contest: &Contest<'_>) -> Result<Option<String>, PlotError> {
    let line = |(subject, name): (&Subject<'_>, String)| {
        let horizons = summary(&subject.rows).horizons;
        let point = |h: &crate::evaluation::Horizon| [h.steps as f64, 1e3 * h.position_rmse];
        Line {
            name,
            role: role(subject.who),
            points: horizons.iter().map(point).collect(),
        }
    };
    let chart = LineChart {
        title: "Position error over k steps from the truth".to_owned(),
        x: axis("steps k (frames)".to_owned(), Scale::Logarithmic),
        y: axis("position RMSE (mm)".to_owned(), Scale::Logarithmic),
        lines: runners(contest).map(line).collect(),
    };
    drawn(&chart)
}

/// Error of whole runs by time: along one motion, or √(mean of squares) over all.
///
/// # Errors
/// A value that is not finite.
pub fn over_time(
    contest: &Contest<'_>,
    measure: Measure,
    motion: Option<(&str, &str)>,
) -> Result<Option<String>, PlotError> {
    let is_along = |row: &&&Row| motion.is_none_or(|m| m == (&row.data, &row.motion));
    let line = |(subject, name): (&Subject<'_>, String)| {
        let rows: Vec<&Row> = subject.rows.iter().filter(is_along).copied().collect();
        Line {
            name,
            role: role(subject.who),
            points: pooled(&rows, measure),
        }
    };
    let lines: Vec<Line> = runners(contest).map(line).collect();
    let along = motion.map_or("over all motions", |(_, motion)| motion);
    let chart = LineChart {
        title: format!("{} of whole runs, {along}", capital(measure.name())),
        x: axis("time (s)".to_owned(), Scale::Linear),
        y: axis(format!("{} (mm)", measure.name()), scale_of(&lines)),
        lines,
    };
    drawn(&chart)
}

/// Error of whole runs by the time that a frame takes: a point for each model, a line through the
/// physics with more and more substeps. None where nothing was timed, or there is nobody to compare
/// with.
///
/// # Errors
/// A value that is not finite.
pub fn by_cost(contest: &Contest<'_>, timings: &[Timing]) -> Result<Option<String>, PlotError> {
    let mut lines: Vec<Line> = Vec::new();
    let mut physics: Vec<[f64; 2]> = Vec::new();
    for subject in contest.subjects() {
        let mine = timings.iter().filter(|timing| timing.name == subject.label);
        let times: Vec<f64> = mine.map(|timing| timing.ms_per_frame).collect();
        let Some(measures) = summary(&subject.rows)
            .measures
            .filter(|_| !times.is_empty())
        else {
            continue;
        };
        let milliseconds = times.iter().sum::<f64>() / times.len() as f64;
        let point = [milliseconds, 1e3 * measures.position_rmse];
        match subject.who {
            Who::Physics => physics.push(point),
            Who::Model => lines.push(Line {
                name: subject.label.clone(),
                role: Role::Subject,
                points: vec![point],
            }),
            Who::Rigid | Who::Mirror | Who::Truth => {}
        }
    }
    if physics.is_empty() {
        return Ok(None);
    }
    lines.push(Line {
        name: "physics".to_owned(),
        role: Role::Rival,
        points: physics,
    });
    drawn(&LineChart {
        title: "Position error of whole runs by the time of a frame".to_owned(),
        x: axis("time of a frame (ms)".to_owned(), Scale::Linear),
        y: axis("position RMSE (mm)".to_owned(), Scale::Linear),
        lines,
    })
}

/// (time, √(mean of squares over the runs that got so far)) of each frame `[s, mm]`.
fn pooled(rows: &[&Row], measure: Measure) -> Vec<[f64; 2]> {
    let Some(rate) = rows.first().map(|row| row.frame_rate) else {
        return Vec::new();
    };
    // Frames are of the first one's rate; others may have another.
    let last = |row: &&Row| {
        let last = measure.curve(row).len().checked_sub(1)?;
        Some((last as f64 * rate / row.frame_rate + 1e-9) as usize)
    };
    let longest = rows
        .iter()
        .filter_map(last)
        .max()
        .map_or(0, |last| last + 1);
    let at = |frame: usize| {
        let nearest = |row: &Row| (frame as f64 * row.frame_rate / rate).round() as usize;
        let errors = || {
            let curves = rows.iter();
            curves.filter_map(|row| measure.curve(row).get(nearest(row)))
        };
        let squares: f64 = errors().map(|error| error * error).sum();
        (squares / errors().count() as f64).sqrt()
    };
    (0..longest)
        .map(|frame| [frame as f64 / rate, 1e3 * at(frame)])
        .collect()
}

/// Logarithmic where the highest points of the lines are far apart.
fn scale_of(lines: &[Line]) -> Scale {
    let highest = |line: &Line| line.points.iter().map(|p| p[1]).fold(0.0, f64::max);
    let all = || lines.iter().map(highest).filter(|high| *high > 0.0);
    let (low, high) = (
        all().fold(f64::INFINITY, f64::min),
        all().fold(0.0, f64::max),
    );
    if high > FAR_APART * low {
        Scale::Logarithmic
    } else {
        Scale::Linear
    }
}

/// Errors of whole runs, a bar for everyone who did not fail.
///
/// # Errors
/// A value that is not finite.
pub fn bars(contest: &Contest<'_>, measure: Measure) -> Result<Option<String>, PlotError> {
    let bar = |subject: &Subject<'_>| {
        let value = summary(&subject.rows).measures.map(|m| match measure {
            Measure::Position => m.position_rmse,
            Measure::EdgeLength => m.edge_length_rmse,
        });
        Bar {
            name: subject.label.clone(),
            role: role(subject.who),
            value: value.map(|metres| 1e3 * metres),
            text: value.map_or_else(|| "failed".to_owned(), length),
        }
    };
    let is_shown = |subject: &&Subject<'_>| subject.who != Who::Truth;
    let groups = contest.groups.iter().map(|group| BarGroup {
        heading: group.heading.clone(),
        bars: group.subjects.iter().filter(is_shown).map(bar).collect(),
    });
    let chart = BarChart {
        title: format!(
            "{} of whole runs, mean over motions",
            capital(measure.name())
        ),
        axis: format!("{} (mm)", measure.name()),
        groups: groups.collect(),
    };
    unless_empty(chart.to_svg())
}

/// The plot; none where there is nothing to show.
fn unless_empty(svg: Result<String, PlotError>) -> Result<Option<String>, PlotError> {
    match svg {
        Err(PlotError::Empty { .. }) => Ok(None),
        result => result.map(Some),
    }
}

/// Lines over an axis; none where there is nothing to show.
///
/// # Errors
/// A value that is not finite.
pub(crate) fn drawn(chart: &LineChart) -> Result<Option<String>, PlotError> {
    unless_empty(chart.to_svg())
}

fn capital(text: &str) -> String {
    let mut characters = text.chars();
    let first = characters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + characters.as_str()
}
