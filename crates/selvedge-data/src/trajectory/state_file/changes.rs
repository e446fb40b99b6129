//! The last solve of each state, from which the next one of an iterative solver begins.

use glam::DVec3;

use super::container::Container;
use super::error::StateError;
use super::{check_shape, entry, seconds, vectors};

/// Changes of velocity in the last solve.
#[derive(Clone, Debug, PartialEq)]
pub struct LastChanges {
    /// Changes `[m/s]`, `[vertices]`.
    pub velocities: Vec<DVec3>,
    /// Time over which they came about `[s]`.
    pub seconds: f64,
}

/// The last solves of the states of a run. Where a state has none, its seconds are 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunChanges {
    /// Changes of velocity `[m/s]`, `[states * vertices]`.
    pub velocities: Vec<DVec3>,
    /// Times over which they came about `[s]`, `[states]`.
    pub seconds: Vec<f64>,
}

/// Names of the arrays of [`RunChanges`].
pub(super) const CHANGES: [&str; 2] = ["changes", "changes_seconds"];

/// The last solves of states with positions of this `shape`; empty where the file has none.
pub(super) fn changes_of_run(
    container: &Container<'_>,
    shape: &[usize],
) -> Result<RunChanges, StateError> {
    if !CHANGES.iter().all(|name| container.has(name)) {
        return Ok(RunChanges::default());
    }
    let [v, seconds] = CHANGES.map(|name| container.floats(name));
    let (v, seconds) = (v?, seconds?);
    check_shape(CHANGES[0], &v, shape)?;
    check_shape(CHANGES[1], &seconds, &shape[..1])?;
    Ok(RunChanges {
        velocities: vectors(v),
        seconds: seconds.values,
    })
}

/// Last solve of state `index` of `count`; none where the file has none.
pub(super) fn changes(
    container: &Container<'_>,
    index: usize,
    count: usize,
    vertices: usize,
) -> Result<Option<LastChanges>, StateError> {
    if !CHANGES.iter().all(|name| container.has(name)) {
        return Ok(None);
    }
    let Some(seconds) = seconds(container, CHANGES[1], index, count)? else {
        return Ok(None);
    };
    let values = container.floats(CHANGES[0])?;
    Ok(Some(LastChanges {
        velocities: entry(CHANGES[0], &values, index, vertices)?,
        seconds,
    }))
}
