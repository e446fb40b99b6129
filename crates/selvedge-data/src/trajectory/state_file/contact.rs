//! What contact leaves for the next substep, in files of states: the entries of all states one
//! after the other, and how many each state has.

use glam::DVec3;
use selvedge_cloth::{
    CaughtPair, ContactMemory, FrictionAnchor, Pushing, ReleasedContact, Touching,
};

use super::SavedState;
use crate::formats::arrays::ArrayFile;
use crate::formats::file_error::Problem;
use crate::formats::tensor_file::{TensorOut, TensorValues};

/// Number of entries of each state in each of [`TABLES`], u32 `[states, 4]`; without the last where
/// that has no entries.
const COUNTS: &str = "contact_counts";
/// Normal and pull `[N]` of each anchor, f64 `[anchors, 6]`.
const PULLS: &str = "contact_pulls";
/// Gap of the tangent of each caught pair `[m]`, 0 for the usual one, f64 `[caught]`.
const GAPS: &str = "contact_gaps";
/// Tables of u32 and their columns: features of anchors; features that push, and 1 where they do so
/// firmly; caught pairs; released contact by vertex, two bodies and two of their parts.
const TABLES: [(&str, usize); 4] = [
    ("contact_anchors", 3),
    ("contact_pushing", 4),
    ("contact_caught", 3),
    ("contact_released", 5),
];
/// Two places `[m]` and the winding number of each released contact, f64 `[released, 7]`.
const PLACES: &str = "contact_places";

/// Largest pull `[N]`, gap or coordinate `[m]` of a state.
const LARGEST: f64 = 1e9;

/// The entries of several states.
#[derive(Default)]
pub(super) struct Tables {
    counts: Vec<[u32; 4]>,
    tables: [Vec<u32>; 4],
    pulls: Vec<f64>,
    gaps: Vec<f64>,
    places: Vec<f64>,
}

impl Tables {
    /// Of all states of a run.
    pub(super) fn of(states: &[SavedState]) -> Self {
        let mut made = Self::default();
        let nothing = ContactMemory::default();
        for state in states {
            let memory = state.contact.as_ref().unwrap_or(&nothing);
            let [anchors, pushing, caught, released] = &mut made.tables;
            let counts = [
                memory.anchors.len(),
                memory.pushing.len(),
                memory.caught.len(),
                memory.released.len(),
            ];
            made.counts.push(counts.map(|count| count as u32));
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
            for one in &memory.released {
                released.extend([one.vertex, one.body, one.against]);
                released.extend(one.parts);
                made.places
                    .extend(one.places.iter().flat_map(|p| p.to_array()));
                made.places.push(one.winding);
            }
        }
        if made.counts.iter().all(|counts| *counts == [0; 4]) {
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
        let reals = [
            real(PULLS, 6, self.pulls),
            real(GAPS, 1, self.gaps),
            real(PLACES, 7, self.places),
        ];
        let kinds = if self.tables[3].is_empty() { 3 } else { 4 };
        let counts: Vec<u32> = self
            .counts
            .iter()
            .flat_map(|c| &c[..kinds])
            .copied()
            .collect();
        let named = [(COUNTS, kinds)].into_iter().chain(TABLES);
        let wholes = named.zip([counts].into_iter().chain(self.tables));
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
    pub(super) fn read(file: &ArrayFile<'_>, states: usize) -> Result<Self, Problem> {
        if !file.has(COUNTS) {
            return Ok(Self::default());
        }
        let counts = file.wholes(COUNTS)?.values;
        let kinds = if counts.len() == 4 * states { 4 } else { 3 };
        check_length(COUNTS, counts.len(), kinds * states)?;
        let rows = counts.chunks_exact(kinds);
        let mut read = Self {
            counts: rows
                .map(|row| std::array::from_fn(|k| row.get(k).copied().unwrap_or(0)))
                .collect(),
            ..Self::default()
        };
        for (kind, (name, columns)) in TABLES.into_iter().enumerate() {
            if file.has(name) {
                read.tables[kind] = file.wholes(name)?.values;
            }
            let counts = read.counts.iter().map(|counts| counts[kind] as usize);
            let total = counts.fold(0_usize, usize::saturating_add);
            check_length(name, read.tables[kind].len(), total.saturating_mul(columns))?;
        }
        let reals = |name: &'static str, expected: usize| {
            let values = match file.has(name) {
                true => file.floats(name)?.values,
                false => Vec::new(),
            };
            check_length(name, values.len(), expected)?;
            let is_usable = |value: &f64| value.abs() <= LARGEST;
            match values.iter().find(|value| !is_usable(value)) {
                None => Ok(values),
                Some(value) => {
                    let expected = format!("finite numbers up to {LARGEST:e}");
                    Err(Problem::array(name, &expected, value))
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
        read.places = reals(PLACES, read.tables[3].len() / 5 * 7)?;
        Ok(read)
    }

    /// The entries of state `index`; none where it has no entry.
    pub(super) fn state(&self, index: usize) -> Result<Option<ContactMemory>, Problem> {
        let Some(own) = self.counts.get(index) else {
            return Ok(None);
        };
        // Each entry with its number.
        let entries = |kind: usize| {
            let before = self.counts[..index].iter();
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
        let released = |(number, row): (usize, &[u32])| {
            let places = &self.places[7 * number..];
            ReleasedContact {
                vertex: row[0],
                body: row[1],
                against: row[2],
                parts: [row[3], row[4]],
                places: [DVec3::from_slice(places), DVec3::from_slice(&places[3..])],
                winding: places[6],
            }
        };
        let memory = ContactMemory {
            anchors: entries(0).map(anchor).collect::<Result<_, Problem>>()?,
            pushing: entries(1).map(pushing).collect::<Result<_, Problem>>()?,
            caught: entries(2).map(caught).collect::<Result<_, Problem>>()?,
            released: entries(3).map(released).collect(),
        };
        Ok((memory != ContactMemory::default()).then_some(memory))
    }
}

fn check_length(name: &str, found: usize, expected: usize) -> Result<(), Problem> {
    if found == expected {
        return Ok(());
    }
    let expected = format!("{expected} numbers, by the states and contact_counts");
    let found = format!("{found} of them");
    Err(Problem::array(name, &expected, found))
}

fn touching(name: &str, numbers: &[u32]) -> Result<Touching, Problem> {
    let numbers = [numbers[0], numbers[1], numbers[2]];
    let expected = "entries that begin with 0 or 1";
    let wrong = || Problem::array(name, expected, format!("{numbers:?}"));
    Touching::of_numbers(numbers).ok_or_else(wrong)
}
