//! Trainings of a study that parts share: those that go on from one another are of one part.
//!
//! Every part writes into the study's folder, which all of them must see.

use selvedge_cluster::Shard;

use super::desk::Desk;
use super::error::{OfPart, StudyError};
use super::file::Study;
use super::training::{self, Record};

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

/// The trainings of a part, one after another, as far as nobody asks for an end.
pub(super) fn train_part(desk: &Desk<'_>, part: Option<Shard>) -> Result<Vec<Record>, StudyError> {
    let mut trained = Vec::new();
    for place in entries_of(desk.study, part) {
        let entry = &desk.study.train[place];
        let context = || format!("training {:?} of the study", entry.name);
        match training::train(desk, entry).of(context)? {
            Some(record) => trained.push(record),
            None => break,
        }
    }
    Ok(trained)
}
