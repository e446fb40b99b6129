//! What contact leaves for the next substep, in files of states: the entries of all states one
//! after the other, and how many each state has.

use glam::DVec3;
use selvedge_cloth::{ContactMemory, FrictionAnchor, Pushing, Touching};

use super::SavedState;
use crate::formats::arrays::{ArrayError, ArrayFile};
use crate::formats::tensor_file::{Tensor, Values};

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
    pub(super) fn of(states: &[SavedState]) -> Self {
        let mut tables = Self::default();
        let nothing = ContactMemory::default();
        for state in states {
            let memory = state.contact.as_ref().unwrap_or(&nothing);
            let counts = [
                memory.anchors.len(),
                memory.pushing.len(),
                memory.caught.len(),
            ];
            tables.counts.extend(counts.map(|count| count as u32));
            for anchor in &memory.anchors {
                tables.anchors.extend(anchor.of.numbers());
                tables.pulls.extend(anchor.normal.to_array());
                tables.pulls.extend(anchor.pull.to_array());
            }
            for pushing in &memory.pushing {
                tables.pushing.extend(pushing.of.numbers());
                tables.pushing.push(u32::from(pushing.firmly));
            }
            for caught in &memory.caught {
                tables.caught.extend(caught.numbers());
            }
        }
        if tables.counts.iter().all(|count| *count == 0) {
            tables.counts.clear();
        }
        tables
    }

    /// The tensors that have entries: those of reals, and those of whole numbers.
    pub(super) fn tensors(self) -> [Vec<Tensor>; 2] {
        let wholes = [
            (COUNTS, 3, self.counts),
            (ANCHORS, 3, self.anchors),
            (PUSHING, 4, self.pushing),
            (CAUGHT, 3, self.caught),
        ];
        let shape = |columns: usize, length: usize| [length / columns, columns];
        let pulls = (!self.pulls.is_empty())
            .then(|| Tensor::new(PULLS, &shape(6, self.pulls.len()), Values::F64(self.pulls)));
        let wholes = wholes.into_iter().filter(|table| !table.2.is_empty());
        let wholes = wholes.map(|(name, columns, values)| {
            Tensor::new(name, &shape(columns, values.len()), Values::U32(values))
        });
        [pulls.into_iter().collect(), wholes.collect()]
    }

    /// Reads those of `states` states; empty where the file has none.
    pub(super) fn read(file: &ArrayFile<'_>, states: usize) -> Result<Self, ArrayError> {
        if !file.has(COUNTS) {
            return Ok(Self::default());
        }
        let counts = file.wholes(COUNTS)?.values;
        check_length(COUNTS, counts.len(), 3 * states)?;
        let total = |kind: usize| {
            let own = counts.iter().skip(kind).step_by(3);
            own.fold(0_usize, |sum, count| sum.saturating_add(*count as usize))
        };
        let entries = |name: &'static str, columns: usize, count: usize| {
            let values = match file.has(name) {
                false => Vec::new(),
                true => file.wholes(name)?.values,
            };
            check_length(name, values.len(), count.saturating_mul(columns))?;
            Ok::<_, ArrayError>(values)
        };
        let anchors = entries(ANCHORS, 3, total(0))?;
        let pulls = match file.has(PULLS) {
            false => Vec::new(),
            true => file.floats(PULLS)?.values,
        };
        check_length(PULLS, pulls.len(), 2 * anchors.len())?;
        let is_usable = |value: &f64| value.abs() <= LARGEST_PULL;
        if let Some(value) = pulls.iter().find(|value| !is_usable(value)) {
            return Err(ArrayError::Array {
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
    pub(super) fn state(&self, index: usize) -> Result<Option<ContactMemory>, ArrayError> {
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
            anchors: range(0).map(anchor).collect::<Result<_, ArrayError>>()?,
            pushing: range(1).map(pushing).collect::<Result<_, ArrayError>>()?,
            caught: range(2).map(caught).collect::<Result<_, ArrayError>>()?,
        };
        Ok((memory != ContactMemory::default()).then_some(memory))
    }
}

fn check_length(name: &str, found: usize, expected: usize) -> Result<(), ArrayError> {
    if found == expected {
        return Ok(());
    }
    Err(ArrayError::Array {
        name: name.to_owned(),
        expected: format!("{expected} numbers, by the states and contact_counts"),
        found: format!("{found} of them"),
    })
}

fn touching(name: &str, numbers: &[u32]) -> Result<Touching, ArrayError> {
    let numbers = [numbers[0], numbers[1], numbers[2]];
    Touching::of_numbers(numbers).ok_or_else(|| ArrayError::Array {
        name: name.to_owned(),
        expected: "entries that begin with 0 or 1".to_owned(),
        found: format!("{numbers:?}"),
    })
}
