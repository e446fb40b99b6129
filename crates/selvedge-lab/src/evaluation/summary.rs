//! One contestant over several motions: means of its measures, how many runs stayed whole.

use selvedge_data::metrics::Character;
use serde::Serialize;

use super::{Horizon, Measures, Row};
use crate::watched::GuardSummary;

/// One contestant over several motions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Motions.
    pub motions: usize,
    /// Runs in which no edge strained over the limit.
    pub stable: usize,
    /// The earliest frame in which one did.
    pub unstable_frame: Option<usize>,
    /// Runs that diverged.
    pub diverged: usize,
    /// Counts of the guards in all runs; none where a run had no guard.
    pub guarded: Option<GuardSummary>,
    /// Means over the motions; none where one run failed: a mean over the others would flatter.
    pub measures: Option<Measures>,
    /// The character of the motions, as ratios to their truths in the order of
    /// [`Character::NAMES`]; none where one run failed.
    pub ratios: Option<[Option<f64>; Character::COUNT]>,
    /// Means over the motions, for those k that every motion has.
    pub horizons: Vec<Horizon>,
}

/// The rows of one contestant, summed up.
pub fn summary(rows: &[&Row]) -> Summary {
    let measured = || rows.iter().filter_map(|row| row.measures.as_ref());
    let all_measured = measured().count() == rows.len();
    let unstable = || rows.iter().filter_map(|row| row.unstable_frame);
    Summary {
        motions: rows.len(),
        stable: rows.len() - unstable().count(),
        unstable_frame: unstable().min(),
        diverged: rows
            .iter()
            .filter(|row| row.diverged_frame.is_some())
            .count(),
        guarded: {
            let all: Option<Vec<GuardSummary>> = rows.iter().map(|row| row.guarded).collect();
            all.map(|all| GuardSummary::sum(all.into_iter()))
        },
        measures: if all_measured {
            Measures::mean(measured())
        } else {
            None
        },
        ratios: {
            let pairs: Option<Vec<_>> = rows.iter().map(|row| row.character).collect();
            pairs.map(|pairs| Character::ratios(&pairs))
        },
        horizons: horizons(rows),
    }
}

fn horizons(rows: &[&Row]) -> Vec<Horizon> {
    let Some(first) = rows.first() else {
        return Vec::new();
    };
    let mean = |steps: usize| -> Option<Horizon> {
        let of_row = |row: &&Row| row.horizons.iter().find(|h| h.steps == steps).copied();
        let all: Option<Vec<Horizon>> = rows.iter().map(of_row).collect();
        let all = all?;
        let mean = |of: fn(&Horizon) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        Some(Horizon {
            steps,
            position_rmse: mean(|h| h.position_rmse),
            last_position_rmse: mean(|h| h.last_position_rmse),
            edge_length_rmse: mean(|h| h.edge_length_rmse),
        })
    };
    first
        .horizons
        .iter()
        .filter_map(|h| mean(h.steps))
        .collect()
}
