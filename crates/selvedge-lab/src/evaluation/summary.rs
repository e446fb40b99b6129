//! The runs of each method, summed up: means over starts and cases, and what became of the runs.

use std::collections::BTreeSet;

use indexmap::IndexMap;
use selvedge_data::metrics::Character;
use serde::Serialize;

use super::measures::FrameErrors;
use super::method::Kind;
use super::run::Run;
use crate::watched::GuardSummary;

/// One method over several cases.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The method.
    pub method: String,
    /// Its kind.
    pub kind: Kind,
    /// Whole runs, of one case each.
    pub whole_runs: usize,
    /// Whole runs that diverged.
    pub diverged: usize,
    /// Counts of the guards in all whole runs; none where a run had no guard.
    pub guarded: Option<GuardSummary>,
    /// After each number of frames from true states: means over starts, then over cases. Those that
    /// every case has; a number of frames at which a run failed is not here, because a mean over
    /// the others would flatter.
    pub after: Vec<FrameErrors>,
    /// Of whole runs: means over cases; none where a run failed.
    pub whole: Option<FrameErrors>,
    /// Of whole runs: mean speed in the last second `[m/s]`, mean over cases; none where one failed.
    pub final_speed: Option<f64>,
    /// The character of whole runs, as ratios to their truths in the order of
    /// [`Character::NAMES`]; none where a run failed, or nobody knows the truth.
    pub ratios: Option<[Option<f64>; Character::COUNT]>,
}

/// The methods of `runs`, in the order in which they appear.
pub fn summaries(runs: &[&Run]) -> Vec<Summary> {
    let mut methods: IndexMap<(&str, Kind), Vec<&Run>> = IndexMap::new();
    for run in runs {
        let own = methods.entry((&run.method, run.kind)).or_default();
        own.push(run);
    }
    let methods = methods.into_iter();
    methods
        .map(|((method, kind), own)| summary(method, kind, &own))
        .collect()
}

fn summary(method: &str, kind: Kind, runs: &[&Run]) -> Summary {
    let whole: Vec<&Run> = runs.iter().copied().filter(|run| run.is_whole).collect();
    let started: Vec<&Run> = runs.iter().copied().filter(|run| !run.is_whole).collect();
    let frames = started.iter().flat_map(|run| &run.frames);
    let frames: BTreeSet<usize> = frames.map(|at| at.frame).collect();
    let all = |values: Vec<Option<FrameErrors>>| {
        let values: Option<Vec<FrameErrors>> = values.into_iter().collect();
        FrameErrors::over_runs(&values?)
    };
    let after = frames.iter().filter_map(|frame| {
        let of_case = |own: &Vec<&Run>| {
            let at = own.iter().map(|run| run.at(*frame));
            all(at.collect())
        };
        all(by_case(&started).iter().map(of_case).collect())
    });
    let guarded: Option<Vec<GuardSummary>> = whole.iter().map(|run| run.guarded).collect();
    let characters: Option<Vec<_>> = whole.iter().map(|run| run.character).collect();
    let speeds: Option<Vec<f64>> = whole.iter().map(|run| run.final_speed).collect();
    let speeds = speeds.filter(|all| !all.is_empty());
    let diverged = whole.iter().filter(|run| run.diverged_frame.is_some());
    Summary {
        method: method.to_owned(),
        kind,
        whole_runs: whole.len(),
        diverged: diverged.count(),
        guarded: guarded
            .filter(|all| !all.is_empty())
            .map(|all| GuardSummary::sum(all.into_iter())),
        after: after.collect(),
        whole: all(whole.iter().map(|run| run.over_time()).collect()),
        final_speed: speeds.map(|all| all.iter().sum::<f64>() / all.len() as f64),
        ratios: characters
            .filter(|pairs| !pairs.is_empty())
            .map(|pairs| Character::ratios(&pairs)),
    }
}

fn by_case<'a>(runs: &[&'a Run]) -> Vec<Vec<&'a Run>> {
    let mut cases: IndexMap<_, Vec<&Run>> = IndexMap::new();
    for run in runs {
        cases.entry((&run.set, &run.case)).or_default().push(run);
    }
    cases.into_values().collect()
}

/// The error of a run with steps h/2, from its difference to one with steps h, for a method of this
/// order p: |x_h - x_{h/2}| / (2^p - 1). `[eq:richardson]`
pub fn richardson(difference: f64, order: u32) -> f64 {
    difference / (2_f64.powi(order as i32) - 1.0)
}

/// The time at which a method whose `points` are (time, error) has `error`: a straight line
/// between the two points around it, in logarithms of both. None outside of all of them.
pub fn time_of(points: &[(f64, f64)], error: f64) -> Option<f64> {
    let is_usable = |(time, error): &&(f64, f64)| *time > 0.0 && *error > 0.0;
    let points: Vec<(f64, f64)> = points.iter().filter(is_usable).copied().collect();
    let around = points.windows(2).find(|pair| {
        let (a, b) = (pair[0].1, pair[1].1);
        a != b && a.min(b) <= error && error <= a.max(b)
    })?;
    let [a, b] = [around[0], around[1]].map(|(time, error)| (time.ln(), error.ln()));
    let part = (error.ln() - a.1) / (b.1 - a.1);
    Some((a.0 + part * (b.0 - a.0)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_runs_tell_the_error_of_the_finer() {
        // x(h) = x + c hᵖ: the difference is c hᵖ (1 - 2⁻ᵖ), the error of the finer run c hᵖ 2⁻ᵖ.
        for order in [1, 2] {
            let error = |h: f64| 0.7 * h.powi(order);
            let found = richardson(error(0.1) - error(0.05), order as u32);
            assert!((found - error(0.05)).abs() < 1e-16);
        }
    }

    #[test]
    fn the_time_of_an_error_is_between_those_of_its_neighbours() {
        // An error of 1/time.
        let points = [(1.0, 1.0), (2.0, 0.5), (8.0, 0.125)];
        for error in [1.0, 0.7, 0.5, 0.2, 0.125] {
            let time = time_of(&points, error).unwrap();
            assert!((time * error - 1.0).abs() < 1e-14, "{time}");
        }
        assert_eq!(time_of(&points, 1.1), None);
        assert_eq!(time_of(&points, 0.1), None);
        assert_eq!(time_of(&points[..1], 1.0), None);
    }
}
