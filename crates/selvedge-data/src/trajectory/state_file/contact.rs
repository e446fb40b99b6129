//! What contact leaves for the next substep, in files of states: the entries of all states one
//! after the other, and how many each state has.

use glam::DVec3;
use selvedge_cloth::{ContactMemory, FrictionAnchor, Pushing, Touching};

use super::container::Container;
use super::error::StateError;

/// Anchors, features that push, and caught pairs of each state, u32 `[states, 3]`.
const COUNTS: &str = "contact_counts";
/// Features of anchors, u32 `[anchors, 3]`.
const ANCHORS: &str = "contact_anchors";
/// Normal and pull `[N]` of each anchor, f64 `[anchors, 6]`.
const PULLS: &str = "contact_pulls";
/// Features that push, and 1 where they do so firmly, u32 `[pushing, 4]`.
const PUSHING: &str = "contact_pushing";
/// Caught pairs, u32 `[caught, 3]`.
const CAUGHT: &str = "contact_caught";

/// Largest pull of a state `[N]`.
const LARGEST_PULL: f64 = 1e9;

/// The entries of several states.
#[derive(Default)]
pub(super) struct Tables {
    counts: Vec<u32>,
    anchors: Vec<u32>,
    pulls: Vec<f64>,
    pushing: Vec<u32>,
    caught: Vec<u32>,
}

impl Tables {
    /// Of all states of a run.
    pub(super) fn of(states: &[ContactMemory]) -> Self {
        let mut tables = Self::default();
        for state in states {
            let counts = [state.anchors.len(), state.pushing.len(), state.caught.len()];
            tables.counts.extend(counts.map(|count| count as u32));
            for anchor in &state.anchors {
                tables.anchors.extend(anchor.of.numbers());
                tables.pulls.extend(anchor.normal.to_array());
                tables.pulls.extend(anchor.pull.to_array());
            }
            for pushing in &state.pushing {
                tables.pushing.extend(pushing.of.numbers());
                tables.pushing.push(u32::from(pushing.firmly));
            }
            for caught in &state.caught {
                tables.caught.extend(caught.numbers());
            }
        }
        tables
    }

    /// Returns true if no state has an entry.
    pub(super) fn is_empty(&self) -> bool {
        self.counts.iter().all(|count| *count == 0)
    }

    /// The array of reals, where it has entries: its name, its columns and its values.
    pub(super) fn reals(&self) -> impl Iterator<Item = (&'static str, usize, &[f64])> {
        let all = [(PULLS, 6, self.pulls.as_slice())];
        all.into_iter().filter(|(.., values)| !values.is_empty())
    }

    /// As [`Self::reals`], of the arrays of whole numbers.
    pub(super) fn wholes(&self) -> impl Iterator<Item = (&'static str, usize, &[u32])> {
        let counts = match self.is_empty() {
            true => &[],
            false => self.counts.as_slice(),
        };
        let all = [
            (COUNTS, 3, counts),
            (ANCHORS, 3, self.anchors.as_slice()),
            (PUSHING, 4, self.pushing.as_slice()),
            (CAUGHT, 3, self.caught.as_slice()),
        ];
        all.into_iter().filter(|(.., values)| !values.is_empty())
    }

    /// Reads those of `states` states; empty where the file has none.
    pub(super) fn read(container: &Container<'_>, states: usize) -> Result<Self, StateError> {
        if !container.has(COUNTS) {
            return Ok(Self::default());
        }
        let counts = wholes(container, COUNTS)?;
        check_length(COUNTS, counts.len(), 3 * states)?;
        let total = |kind: usize| {
            let own = counts.iter().skip(kind).step_by(3);
            own.fold(0_usize, |sum, count| sum.saturating_add(*count as usize))
        };
        let entries = |name: &'static str, columns: usize, count: usize| {
            let values = match container.has(name) {
                false => Vec::new(),
                true => wholes(container, name)?,
            };
            check_length(name, values.len(), count.saturating_mul(columns))?;
            Ok::<_, StateError>(values)
        };
        let anchors = entries(ANCHORS, 3, total(0))?;
        let pulls = match container.has(PULLS) {
            false => Vec::new(),
            true => container.floats(PULLS)?.values,
        };
        check_length(PULLS, pulls.len(), 2 * anchors.len())?;
        let is_usable = |value: &f64| value.abs() <= LARGEST_PULL;
        if let Some(value) = pulls.iter().find(|value| !is_usable(value)) {
            return Err(StateError::Array {
                name: PULLS.to_owned(),
                expected: format!("finite numbers up to {LARGEST_PULL:e}"),
                found: value.to_string(),
            });
        }
        Ok(Self {
            pushing: entries(PUSHING, 4, total(1))?,
            caught: entries(CAUGHT, 3, total(2))?,
            counts,
            anchors,
            pulls,
        })
    }

    /// The entries of state `index`; none where it has no entry.
    pub(super) fn state(&self, index: usize) -> Result<Option<ContactMemory>, StateError> {
        let Some(own) = self.counts.chunks_exact(3).nth(index) else {
            return Ok(None);
        };
        let range = |kind: usize| {
            let before = self.counts.chunks_exact(3).take(index);
            let first: usize = before.map(|counts| counts[kind] as usize).sum();
            first..first + own[kind] as usize
        };
        let anchor = |k: usize| {
            let pulls = &self.pulls[6 * k..6 * (k + 1)];
            Ok(FrictionAnchor {
                of: touching(ANCHORS, &self.anchors[3 * k..3 * (k + 1)])?,
                normal: DVec3::from_slice(&pulls[..3]),
                pull: DVec3::from_slice(&pulls[3..]),
            })
        };
        let pushing = |k: usize| {
            let entry = &self.pushing[4 * k..4 * (k + 1)];
            Ok(Pushing {
                of: touching(PUSHING, &entry[..3])?,
                firmly: entry[3] > 0,
            })
        };
        let caught = |k: usize| touching(CAUGHT, &self.caught[3 * k..3 * (k + 1)]);
        let memory = ContactMemory {
            anchors: range(0).map(anchor).collect::<Result<_, StateError>>()?,
            pushing: range(1).map(pushing).collect::<Result<_, StateError>>()?,
            caught: range(2).map(caught).collect::<Result<_, StateError>>()?,
        };
        Ok((memory != ContactMemory::default()).then_some(memory))
    }
}

fn wholes(container: &Container<'_>, name: &str) -> Result<Vec<u32>, StateError> {
    let whole = |value: i64| {
        u32::try_from(value).map_err(|_| StateError::Array {
            name: name.to_owned(),
            expected: "numbers from 0 to 4294967295".to_owned(),
            found: value.to_string(),
        })
    };
    let values = container.integers(name)?;
    values.into_iter().map(whole).collect()
}

fn check_length(name: &str, found: usize, expected: usize) -> Result<(), StateError> {
    if found == expected {
        return Ok(());
    }
    Err(StateError::Array {
        name: name.to_owned(),
        expected: format!("{expected} numbers, by the states and contact_counts"),
        found: format!("{found} of them"),
    })
}

fn touching(name: &str, numbers: &[u32]) -> Result<Touching, StateError> {
    let numbers = [numbers[0], numbers[1], numbers[2]];
    Touching::of_numbers(numbers).ok_or_else(|| StateError::Array {
        name: name.to_owned(),
        expected: "entries that begin with 0 or 1".to_owned(),
        found: format!("{numbers:?}"),
    })
}
