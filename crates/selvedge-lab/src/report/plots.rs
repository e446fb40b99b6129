//! Plots: errors by frames from true states, of whole runs by time, and by the time of a frame. None
//! where there is nothing to show.

use selvedge_view::plot::{Axis, Line, LineChart, PlotError, Role, Scale};

use super::tables::named;
use super::{Measure, ms_per_frame};
use crate::evaluation::{FrameErrors, Kind, Run, Summary, Timing, summaries};

/// Lines that are so many times apart are drawn by their logarithm.
const FAR_APART: f64 = 30.0;

impl Measure {
    fn name(self) -> &'static str {
        match self {
            Self::Position => "position RMSE",
            Self::EdgeLength => "edge-length RMSE",
        }
    }

    /// `[mm]`
    fn of(self, at: &FrameErrors) -> Option<f64> {
        let errors = at.errors?;
        Some(match self {
            Self::Position => 1e3 * errors.position_rmse,
            Self::EdgeLength => 1e3 * errors.edge_length_rmse,
        })
    }
}

fn role(kind: Kind) -> Role {
    match kind {
        Kind::Model => Role::Subject,
        Kind::Physics | Kind::Baseline | Kind::Reference => Role::Rival,
    }
}

/// An axis of this label.
pub(super) fn axis(label: &str, scale: Scale) -> Axis {
    Axis {
        label: label.to_owned(),
        scale,
    }
}

/// Position errors after k frames, by k.
pub(super) fn by_frames(summaries: &[Summary]) -> Result<Option<String>, PlotError> {
    let line = |summary: &Summary| {
        let points = summary.after.iter();
        let points = points.filter_map(|at| Some([at.frame as f64, Measure::Position.of(at)?]));
        Line {
            name: named(summary),
            role: role(summary.kind),
            // There is no logarithm of an exact run's error.
            points: points.filter(|point| point[1] > 0.0).collect(),
        }
    };
    drawn(&LineChart {
        title: "Position error after k frames from true states".to_owned(),
        x: axis("frames k", Scale::Logarithmic),
        y: axis("position RMSE (mm)", Scale::Logarithmic),
        lines: summaries.iter().map(line).collect(),
    })
}

/// Errors of whole runs by time: √(mean of squares) over cases.
pub(super) fn over_time(runs: &[&Run], measure: Measure) -> Result<Option<String>, PlotError> {
    let whole: Vec<&Run> = runs.iter().copied().filter(|run| run.is_whole).collect();
    let line = |summary: Summary| {
        let own = whole.iter().copied();
        let own = own.filter(|run| run.method == summary.method && run.kind == summary.kind);
        Line {
            name: named(&summary),
            role: role(summary.kind),
            points: pooled(&own.collect::<Vec<_>>(), measure),
        }
    };
    let lines: Vec<Line> = summaries(&whole).into_iter().map(line).collect();
    let name = measure.name();
    drawn(&LineChart {
        title: format!("Whole runs: {name} over all cases"),
        x: axis("time (s)", Scale::Linear),
        y: axis(&format!("{name} (mm)"), scale_of(&lines)),
        lines,
    })
}

/// (time, √(mean of squares over the runs that got so far)) of each frame `[s, mm]`.
fn pooled(runs: &[&Run], measure: Measure) -> Vec<[f64; 2]> {
    let Some(rate) = runs.first().map(|run| run.frame_rate) else {
        return Vec::new();
    };
    // Frames are of the first one's rate; others may have another.
    let last = |run: &&Run| (run.frames.len() as f64 * rate / run.frame_rate + 1e-9) as usize;
    let longest = runs.iter().map(last).max().unwrap_or(0);
    let at = |frame: usize| {
        let nearest = |run: &Run| (frame as f64 * run.frame_rate / rate).round() as usize;
        let errors = runs.iter().filter_map(|run| {
            let at = run.frames.get(nearest(run).checked_sub(1)?)?;
            measure.of(at)
        });
        let errors: Vec<f64> = errors.collect();
        let squares: f64 = errors.iter().map(|error| error * error).sum();
        let error = (squares / errors.len() as f64).sqrt();
        (!errors.is_empty()).then_some([frame as f64 / rate, error])
    };
    (1..=longest).filter_map(at).collect()
}

/// Position errors after the most frames, or of whole runs where there are none, by the time that a
/// frame takes: a point for each model, a line through the physics with more and more substeps. None
/// where nothing was timed.
pub(super) fn by_time(
    summaries: &[Summary],
    timings: &[Timing],
) -> Result<Option<String>, PlotError> {
    let longest = summaries.iter().flat_map(|summary| &summary.after);
    let longest = longest.map(|at| at.frame).max();
    let point = |summary: &Summary| {
        let at = match longest {
            Some(k) => *summary.after.iter().find(|at| at.frame == k)?,
            None => summary.whole?,
        };
        let error = Measure::Position.of(&at)?;
        (error > 0.0).then_some([ms_per_frame(summary, timings)?, error])
    };
    let of_kind = |kind| summaries.iter().filter(move |summary| summary.kind == kind);
    let model = |summary: &Summary| Line {
        name: named(summary),
        role: Role::Subject,
        points: point(summary).into_iter().collect(),
    };
    let mut lines: Vec<Line> = of_kind(Kind::Model).map(model).collect();
    // The integrator is what stands before the substeps.
    let family = |summary: &Summary| {
        let name = summary.method.split(',').next();
        name.unwrap_or_default().to_owned()
    };
    for summary in of_kind(Kind::Physics) {
        let name = family(summary);
        match lines
            .iter_mut()
            .find(|line| line.role == Role::Rival && line.name == name)
        {
            Some(line) => line.points.extend(point(summary)),
            None => lines.push(Line {
                name,
                role: Role::Rival,
                points: point(summary).into_iter().collect(),
            }),
        }
    }
    lines.retain(|line| !line.points.is_empty());
    let what = match longest {
        Some(k) => format!("after {k} frames"),
        None => "of whole runs".to_owned(),
    };
    drawn(&LineChart {
        title: format!("Position error {what} by the time of a frame"),
        x: axis("time of a frame (ms)", Scale::Logarithmic),
        y: axis("position RMSE (mm)", Scale::Logarithmic),
        lines,
    })
}

/// Logarithmic where the highest points of the lines are far apart.
fn scale_of(lines: &[Line]) -> Scale {
    let highest = |line: &Line| line.points.iter().map(|p| p[1]).fold(0.0, f64::max);
    let all = || lines.iter().map(highest).filter(|high| *high > 0.0);
    let (low, high) = (
        all().fold(f64::INFINITY, f64::min),
        all().fold(0.0, f64::max),
    );
    if high > FAR_APART * low { Scale::Logarithmic } else { Scale::Linear }
}

/// Lines over an axis; none where there is nothing to show.
fn drawn(chart: &LineChart) -> Result<Option<String>, PlotError> {
    match chart.to_svg() {
        Err(PlotError::Empty { .. }) => Ok(None),
        result => result.map(Some),
    }
}
