//! What contact leaves for the next substep, in files of states: the entries of all states one
//! after the other, and how many each state has.

use glam::DVec3;
use selvedge_cloth::{CaughtPair, ContactMemory, FrictionAnchor, Pushing, Touching};

use super::SavedState;
use crate::formats::arrays::{ArrayError, ArrayFile};
use crate::formats::tensor_file::{TensorOut, TensorValues};

/// Number of entries of each state in each of [`TABLES`], u32 `[states, 3]`.
const COUNTS: &str = "contact_counts";
/// Normal and pull `[N]` of each anchor, f64 `[anchors, 6]`.
const PULLS: &str = "contact_pulls";
/// Gap of the tangent of each caught pair `[m]`, 0 for the usual one, f64 `[caught]`.
const GAPS: &str = "contact_gaps";
/// Tables of u32 and their columns: features of anchors; features that push, and 1 where they do so
/// firmly; caught pairs.
const TABLES: [(&str, usize); 3] = [
    ("contact_anchors", 3),
    ("contact_pushing", 4),
    ("contact_caught", 3),
];

/// Largest pull of a state `[N]`, and largest gap `[m]`.
const LARGEST: f64 = 1e9;

/// The entries of several states.
#[derive(Default)]
pub(super) struct Tables {
    counts: Vec<u32>,
    tables: [Vec<u32>; 3],
    pulls: Vec<f64>,
    gaps: Vec<f64>,
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
            for one in &memory.caught {
                caught.extend(one.of.numbers());
                made.gaps.push(one.gap.unwrap_or(0.0));
            }
        }
        if made.counts.iter().all(|count| *count == 0) {
            made.counts.clear();
        }
        made
    }

    /// The tensors that have entries: those of reals, and those of whole numbers.
    pub(super) fn tensors(self) -> [Vec<TensorOut<'static>>; 2] {
        let shape = |columns: usize, length: usize| [length / columns, columns];
        let real = |name: &'static str, columns: usize, values: Vec<f64>| {
            let shape = match columns {
                1 => vec![values.len()],
                _ => shape(columns, values.len()).to_vec(),
            };
            (!values.is_empty())
                .then(|| TensorOut::new(name, &shape, TensorValues::F64(values.into())))
        };
        let reals = [real(PULLS, 6, self.pulls), real(GAPS, 1, self.gaps)];
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
        [reals.into_iter().flatten().collect(), wholes.collect()]
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
        let reals = |name: &str, expected: usize| {
            let mut values = Vec::new();
            if file.has(name) {
                values = file.floats(name)?.values;
            }
            check_length(name, values.len(), expected)?;
            match values
                .iter()
                .find(|value| value.is_nan() || value.abs() > LARGEST)
            {
                None => Ok(values),
                Some(value) => {
                    let expected = format!("finite numbers up to {LARGEST:e}");
                    Err(ArrayError::array(name, &expected, value))
                }
            }
        };
        read.pulls = reals(PULLS, 2 * read.tables[0].len())?;
        let caught = read.tables[2].len() / 3;
        // Files from before there was a gap have none.
        read.gaps = match file.has(GAPS) {
            true => reals(GAPS, caught)?,
            false => vec![0.0; caught],
        };
        Ok(read)
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
        let caught = |(number, row): (usize, &[u32])| {
            let gap = self.gaps[number];
            Ok(CaughtPair {
                of: of(2, row)?,
                gap: (gap > 0.0).then_some(gap),
            })
        };
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
