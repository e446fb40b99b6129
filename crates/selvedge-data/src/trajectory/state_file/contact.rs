//! What contact leaves for the next substep, in files of states: the entries of all states one
//! after the other, and how many each state has.

use glam::DVec3;
use selvedge_cloth::{ContactMemory, FrictionAnchor, Pushing, Touching};

use super::SavedState;
use crate::formats::arrays::{ArrayError, ArrayFile};
use crate::formats::tensor_file::{TensorOut, TensorValues};

/// Number of entries of each state in each of [`TABLES`], u32 `[states, 3]`.
const COUNTS: &str = "contact_counts";
/// Normal and pull `[N]` of each anchor, f64 `[anchors, 6]`.
const PULLS: &str = "contact_pulls";
/// Tables of u32 and their columns: features of anchors; features that push, and 1 where they do so
/// firmly; caught pairs.
const TABLES: [(&str, usize); 3] = [
    ("contact_anchors", 3),
    ("contact_pushing", 4),
    ("contact_caught", 3),
];

/// Largest pull of a state `[N]`.
const LARGEST_PULL: f64 = 1e9;

/// The entries of several states.
#[derive(Default)]
pub(super) struct Tables {
    counts: Vec<u32>,
    tables: [Vec<u32>; 3],
    pulls: Vec<f64>,
}

impl Tables {
    /// Of all states of a run.
    pub(super) fn of(states: &[SavedState]) -> Self {
        let mut made = Self::default();
        let nothing = ContactMemory::default();
        for state in states {
            let memory = state.contact.as_ref().unwrap_or(&nothing);
            let [anchors, pushing, caught] = &mut made.tables;
            let counts = [
                memory.anchors.len(),
                memory.pushing.len(),
                memory.caught.len(),
            ];
            made.counts.extend(counts.map(|count| count as u32));
            for anchor in &memory.anchors {
                anchors.extend(anchor.of.numbers());
                made.pulls.extend(anchor.normal.to_array());
                made.pulls.extend(anchor.pull.to_array());
            }
            for one in &memory.pushing {
                pushing.extend(one.of.numbers());
                pushing.push(u32::from(one.firmly));
            }
            caught.extend(memory.caught.iter().flat_map(|one| one.numbers()));
        }
        if made.counts.iter().all(|count| *count == 0) {
            made.counts.clear();
        }
        made
    }

    /// The tensors that have entries: those of reals, and those of whole numbers.
    pub(super) fn tensors(self) -> [Vec<TensorOut<'static>>; 2] {
        let shape = |columns: usize, length: usize| [length / columns, columns];
        let pulls = (!self.pulls.is_empty()).then(|| {
            TensorOut::new(
                PULLS,
                &shape(6, self.pulls.len()),
                TensorValues::F64(self.pulls.into()),
            )
        });
        let named = [(COUNTS, 3)].into_iter().chain(TABLES);
        let wholes = named.zip([self.counts].into_iter().chain(self.tables));
        let wholes = wholes.filter(|(_, values)| !values.is_empty());
        let wholes = wholes.map(|((name, columns), values)| {
            TensorOut::new(
                name,
                &shape(columns, values.len()),
                TensorValues::U32(values.into()),
            )
        });
        [pulls.into_iter().collect(), wholes.collect()]
    }

    /// Reads those of `states` states; empty where the file has none.
    pub(super) fn read(file: &ArrayFile<'_>, states: usize) -> Result<Self, ArrayError> {
        if !file.has(COUNTS) {
            return Ok(Self::default());
        }
        let mut read = Self {
            counts: file.wholes(COUNTS)?.values,
            ..Self::default()
        };
        check_length(COUNTS, read.counts.len(), 3 * states)?;
        for (kind, (name, columns)) in TABLES.into_iter().enumerate() {
            if file.has(name) {
                read.tables[kind] = file.wholes(name)?.values;
            }
            let counts = read.counts.iter().skip(kind).step_by(3);
            let total = counts.fold(0_usize, |sum, count| sum.saturating_add(*count as usize));
            check_length(name, read.tables[kind].len(), total.saturating_mul(columns))?;
        }
        if file.has(PULLS) {
            read.pulls = file.floats(PULLS)?.values;
        }
        check_length(PULLS, read.pulls.len(), 2 * read.tables[0].len())?;
        let is_usable = |value: &f64| value.abs() <= LARGEST_PULL;
        match read.pulls.iter().find(|value| !is_usable(value)) {
            None => Ok(read),
            Some(value) => {
                let expected = format!("finite numbers up to {LARGEST_PULL:e}");
                Err(ArrayError::array(PULLS, &expected, value))
            }
        }
    }

    /// The entries of state `index`; none where it has no entry.
    pub(super) fn state(&self, index: usize) -> Result<Option<ContactMemory>, ArrayError> {
        let Some(own) = self.counts.chunks_exact(3).nth(index) else {
            return Ok(None);
        };
        // Each entry with its number.
        let entries = |kind: usize| {
            let before = self.counts.chunks_exact(3).take(index);
            let first: usize = before.map(|counts| counts[kind] as usize).sum();
            let rows = self.tables[kind].chunks_exact(TABLES[kind].1).enumerate();
            rows.skip(first).take(own[kind] as usize)
        };
        let of = |kind: usize, row: &[u32]| touching(TABLES[kind].0, row);
        let anchor = |(number, row): (usize, &[u32])| {
            let pulls = &self.pulls[6 * number..];
            Ok(FrictionAnchor {
                of: of(0, row)?,
                normal: DVec3::from_slice(pulls),
                pull: DVec3::from_slice(&pulls[3..]),
            })
        };
        let pushing = |(_, row): (usize, &[u32])| {
            Ok(Pushing {
                of: of(1, row)?,
                firmly: row[3] > 0,
            })
        };
        let caught = |(_, row): (usize, &[u32])| of(2, row);
        let memory = ContactMemory {
            anchors: entries(0).map(anchor).collect::<Result<_, ArrayError>>()?,
            pushing: entries(1).map(pushing).collect::<Result<_, ArrayError>>()?,
            caught: entries(2).map(caught).collect::<Result<_, ArrayError>>()?,
        };
        Ok((memory != ContactMemory::default()).then_some(memory))
    }
}

fn check_length(name: &str, found: usize, expected: usize) -> Result<(), ArrayError> {
    if found == expected {
        return Ok(());
    }
    let expected = format!("{expected} numbers, by the states and contact_counts");
    let found = format!("{found} of them");
    Err(ArrayError::array(name, &expected, found))
}

fn touching(name: &str, numbers: &[u32]) -> Result<Touching, ArrayError> {
    let numbers = [numbers[0], numbers[1], numbers[2]];
    let expected = "entries that begin with 0 or 1";
    let wrong = || ArrayError::array(name, expected, format!("{numbers:?}"));
    Touching::of_numbers(numbers).ok_or_else(wrong)
}
