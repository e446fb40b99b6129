//! What contact leaves for the next substep, in files of states: the entries of all states one
//! after the other, and how many each state has.

use glam::DVec3;
use selvedge_cloth::{
    CaughtPair, Checkpoint, ContactMemory, FrictionAnchor, Pushing, ReleasedContact, Still,
    Touching,
};

use crate::formats::arrays::ArrayFile;
use crate::formats::file_error::Problem;
use crate::formats::tensor_file::{TensorOut, TensorValues};

/// Number of entries of each state of each kind, u32 `[states, kinds]`; the last kinds are left out where
/// they have no entries, but for the first three.
const COUNTS: &str = "contact_counts";
const KINDS: usize = 5;
/// Tables of u32 and their columns: features of anchors; features that push, and 1 where they do so
/// firmly; caught pairs; released contact by vertex, two bodies and two of their parts; the frame since
/// which each vertex is still.
const WHOLES: [(&str, usize); KINDS] = [
    ("contact_anchors", 3),
    ("contact_pushing", 4),
    ("contact_caught", 3),
    ("contact_released", 5),
    ("contact_still", 1),
];
/// Tables of f64 beside them: normal and pull `[N]` of each anchor; none; the gap of the tangent of
/// each caught pair `[m]`, 0 for the usual one; two places `[m]` and the winding number of each
/// released contact; the place of each still vertex `[m]`.
const REALS: [(&str, usize); KINDS] = [
    ("contact_pulls", 6),
    ("", 0),
    (GAPS, 1),
    ("contact_places", 7),
    ("contact_still_places", 3),
];
const GAPS: &str = "contact_gaps";

/// Largest pull `[N]`, gap or coordinate `[m]` of a state.
const LARGEST: f64 = 1e9;

/// The entries of several states, by kind.
#[derive(Default)]
pub(super) struct Tables {
    counts: Vec<[u32; KINDS]>,
    wholes: [Vec<u32>; KINDS],
    reals: [Vec<f64>; KINDS],
}

impl Tables {
    /// Of all states of a run.
    pub(super) fn of(states: &[Checkpoint]) -> Self {
        let mut made = Self::default();
        let nothing = ContactMemory::default();
        for state in states {
            let memory = state.contact.as_ref().unwrap_or(&nothing);
            let [anchors, pushing, caught, released, still] = &mut made.wholes;
            let [pulls, _, gaps, places, still_places] = &mut made.reals;
            let counts = [
                memory.anchors.len(),
                memory.pushing.len(),
                memory.caught.len(),
                memory.released.len(),
                memory.still.len(),
            ];
            made.counts.push(counts.map(|count| count as u32));
            for anchor in &memory.anchors {
                anchors.extend(anchor.of.numbers());
                pulls.extend(anchor.normal.to_array());
                pulls.extend(anchor.pull.to_array());
            }
            for one in &memory.pushing {
                pushing.extend(one.of.numbers());
                pushing.push(u32::from(one.firmly));
            }
            for one in &memory.caught {
                caught.extend(one.of.numbers());
                gaps.push(one.gap.unwrap_or(0.0));
            }
            for one in &memory.released {
                released.extend([one.vertex, one.body, one.against]);
                released.extend(one.parts);
                places.extend(one.places.iter().flat_map(|p| p.to_array()));
                places.push(one.winding);
            }
            for one in &memory.still {
                still.push(one.since);
                still_places.extend(one.place.to_array());
            }
        }
        if made.counts.iter().all(|counts| *counts == [0; KINDS]) {
            made.counts.clear();
        }
        made
    }

    /// The tensors that have entries: those of reals, and those of whole numbers.
    pub(super) fn tensors(self) -> [Vec<TensorOut<'static>>; 2] {
        let shape = |columns: usize, length: usize| match columns {
            1 => vec![length],
            _ => vec![length / columns, columns],
        };
        let reals = REALS.into_iter().zip(self.reals);
        let reals = reals.filter(|(_, values)| !values.is_empty());
        let reals = reals.map(|((name, columns), values)| {
            let shape = shape(columns, values.len());
            TensorOut::new(name, &shape, TensorValues::F64(values.into()))
        });
        let kinds = (4..=KINDS).rev().find(|k| !self.wholes[k - 1].is_empty());
        let kinds = kinds.unwrap_or(3);
        let counts = self.counts.iter().flat_map(|c| &c[..kinds]).copied();
        let named = [(COUNTS, kinds)].into_iter().chain(WHOLES);
        let wholes = named.zip([counts.collect()].into_iter().chain(self.wholes));
        let wholes = wholes.filter(|(_, values): &(_, Vec<u32>)| !values.is_empty());
        let wholes = wholes.map(|((name, columns), values)| {
            let shape = shape(columns, values.len());
            TensorOut::new(name, &shape, TensorValues::U32(values.into()))
        });
        [reals.collect(), wholes.collect()]
    }

    /// Reads those of `states` states; empty where the file has none.
    pub(super) fn read(file: &ArrayFile<'_>, states: usize) -> Result<Self, Problem> {
        if !file.has(COUNTS) {
            return Ok(Self::default());
        }
        let counts = file.wholes(COUNTS)?.values;
        let kinds = (3..=KINDS).rev().find(|k| counts.len() == k * states);
        let kinds = kinds.unwrap_or(3);
        check_length(COUNTS, counts.len(), kinds * states)?;
        let rows = counts.chunks_exact(kinds);
        let mut read = Self {
            counts: rows
                .map(|row| std::array::from_fn(|k| row.get(k).copied().unwrap_or(0)))
                .collect(),
            ..Self::default()
        };
        for (kind, (name, columns)) in WHOLES.into_iter().enumerate() {
            let wholes = &mut read.wholes[kind];
            if file.has(name) {
                *wholes = file.wholes(name)?.values;
            }
            let counts = read.counts.iter().map(|counts| counts[kind] as usize);
            let total = counts.fold(0_usize, usize::saturating_add);
            check_length(name, wholes.len(), total.saturating_mul(columns))?;
            let (name, columns) = REALS[kind];
            let reals = match file.has(name) {
                true => file.floats(name)?.values,
                // Files from before there was a gap have none.
                false if name == GAPS => vec![0.0; total],
                false => Vec::new(),
            };
            check_length(name, reals.len(), total * columns)?;
            let is_usable = |value: &f64| value.abs() <= LARGEST;
            if let Some(value) = reals.iter().find(|value| !is_usable(value)) {
                let expected = format!("finite numbers up to {LARGEST:e}");
                return Err(Problem::array(name, &expected, value));
            }
            read.reals[kind] = reals;
        }
        Ok(read)
    }

    /// The entries of state `index`; none where it has no entry.
    pub(super) fn state(&self, index: usize) -> Result<Option<ContactMemory>, Problem> {
        let Some(own) = self.counts.get(index) else {
            return Ok(None);
        };
        // The numbers of each entry.
        let entries = |kind: usize| {
            let before = self.counts[..index].iter();
            let first: usize = before.map(|counts| counts[kind] as usize).sum();
            let (wholes, reals) = (WHOLES[kind].1, REALS[kind].1);
            (first..first + own[kind] as usize).map(move |number| {
                let row = &self.wholes[kind][wholes * number..][..wholes];
                (row, &self.reals[kind][reals * number..][..reals])
            })
        };
        let of = |kind: usize, row: &[u32]| touching(WHOLES[kind].0, row);
        let anchor = |(row, pulls): (&[u32], &[f64])| {
            Ok(FrictionAnchor {
                of: of(0, row)?,
                normal: DVec3::from_slice(pulls),
                pull: DVec3::from_slice(&pulls[3..]),
            })
        };
        let pushing = |(row, _): (&[u32], _)| {
            Ok(Pushing {
                of: of(1, row)?,
                firmly: row[3] > 0,
            })
        };
        let caught = |(row, gaps): (&[u32], &[f64])| {
            Ok(CaughtPair {
                of: of(2, row)?,
                gap: (gaps[0] > 0.0).then_some(gaps[0]),
            })
        };
        let released = |(row, places): (&[u32], &[f64])| ReleasedContact {
            vertex: row[0],
            body: row[1],
            against: row[2],
            parts: [row[3], row[4]],
            places: [DVec3::from_slice(places), DVec3::from_slice(&places[3..])],
            winding: places[6],
        };
        let still = |(row, place): (&[u32], &[f64])| Still {
            since: row[0],
            place: DVec3::from_slice(place),
        };
        let memory = ContactMemory {
            anchors: entries(0).map(anchor).collect::<Result<_, Problem>>()?,
            pushing: entries(1).map(pushing).collect::<Result<_, Problem>>()?,
            caught: entries(2).map(caught).collect::<Result<_, Problem>>()?,
            released: entries(3).map(released).collect(),
            still: entries(4).map(still).collect(),
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
