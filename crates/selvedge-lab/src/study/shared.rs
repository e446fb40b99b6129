//! Trainings of a study that ranks or parts share: those that go on from one another stay together,
//! each group is the work of one rank.
//!
//! Every rank writes into the study's folder, which all of them must see.

use selvedge_cluster::{Done, HandOut, HandOutError, Shard, hand_out};

use super::desk::Desk;
use super::error::{OfPart, StudyError};
use super::file::{Study, Training};
use super::training::{self, Record};
use crate::cause::chain;
use crate::generation::of_first;

/// Trainings that go on from one another, by their places in the study.
fn groups(study: &Study) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (place, entry) in study.train.iter().enumerate() {
        let before =
            |other: &usize| entry.after.as_deref() == Some(study.train[*other].name.as_str());
        match groups.iter_mut().find(|group| group.iter().any(before)) {
            Some(group) => group.push(place),
            None => groups.push(vec![place]),
        }
    }
    groups
}

/// The trainings of a part, by their places in the study.
pub(super) fn entries_of(study: &Study, part: Option<Shard>) -> Vec<usize> {
    let groups = groups(study).into_iter().enumerate();
    let own = groups.filter(|(number, _)| part.is_none_or(|part| part.has(*number)));
    let mut places: Vec<usize> = own.flat_map(|(_, group)| group).collect();
    places.sort_unstable();
    places
}

fn train_one(desk: &Desk<'_>, entry: &Training) -> Result<Option<Record>, StudyError> {
    training::train(desk, entry).of(|| format!("training {:?} of the study", entry.name))
}

/// The trainings of a part, one after another, as far as nobody asks for an end.
pub(super) fn train_part(desk: &Desk<'_>, part: Option<Shard>) -> Result<Vec<Record>, StudyError> {
    let mut trained = Vec::new();
    for place in entries_of(desk.study, part) {
        match train_one(desk, &desk.study.train[place])? {
            Some(record) => trained.push(record),
            None => break,
        }
    }
    Ok(trained)
}

/// All trainings, handed out over the ranks; fewer where an end was asked for.
pub(super) fn train_over_ranks(desk: &Desk<'_>) -> Result<Vec<Record>, StudyError> {
    let groups = groups(desk.study);
    let work = |group: usize| {
        let mut records = Vec::new();
        for place in &groups[group] {
            match train_one(desk, &desk.study.train[*place]) {
                Ok(Some(record)) => records.push((*place, record)),
                Ok(None) => return Done::Stopped,
                Err(error) => return Done::Failed(chain(&error)),
            }
        }
        Done::Answer(serde_json::to_vec(&records).unwrap_or_default())
    };
    let plan = HandOut {
        ranks: &desk.crew.ranks,
        // A training takes all threads.
        workers: 1,
        jobs: groups.len(),
    };
    let mut trained: Vec<(usize, Record)> = Vec::new();
    let handed = hand_out(plan, &work, &mut |_, bytes| {
        trained.extend(serde_json::from_slice::<Vec<(usize, Record)>>(&bytes)?);
        Ok::<(), serde_json::Error>(())
    });
    handed.map_err(|error| match error {
        HandOutError::Cluster(error) => StudyError::new(chain(&error)),
        HandOutError::Take(error) => StudyError::from(error),
    })?;
    trained.sort_by_key(|(place, _)| *place);
    let trained: Vec<Record> = trained.into_iter().map(|(_, record)| record).collect();
    Ok(of_first(desk.crew, &trained)?)
}
