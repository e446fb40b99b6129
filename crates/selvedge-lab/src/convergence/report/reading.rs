//! An outcome as tables and plots read it: errors beside the reference's own, rivals by integrator,
//! and the horizons that have plots.

use super::super::method::{Method, NamedIntegrator};
use super::super::order::{FAR, richardson};
use super::super::outcome::{Measure, Outcome};
use super::super::settings::Settings;

/// The reference's own error at the horizon of this number; none where the second run failed.
pub(super) fn own(outcome: &Outcome, number: usize, measure: Measure) -> Option<f64> {
    let difference = measure.of(&outcome.half(number)?);
    Some(richardson(difference, outcome.settings.reference.order()))
}

/// An error of a rival, and how far it can be relied on.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub(super) error: f64,
    /// It is far from the reference's own.
    pub(super) is_its_own: bool,
}

/// The error of the rival of this number at the horizon of this number; none where a run failed.
pub(super) fn found(
    outcome: &Outcome,
    rival: usize,
    number: usize,
    measure: Measure,
) -> Option<Found> {
    let error = measure.of(&outcome.mean(rival, number)?);
    let own = own(outcome, number, measure);
    Some(Found {
        error,
        is_its_own: own.is_some_and(|own| error >= FAR * own),
    })
}

/// Rivals of one integrator, by their numbers, in the order of the settings.
pub(super) struct Family<'a> {
    pub(super) integrator: &'a NamedIntegrator,
    pub(super) rivals: Vec<usize>,
}

pub(super) fn families(rivals: &[Method]) -> Vec<Family<'_>> {
    let mut families: Vec<Family<'_>> = Vec::new();
    for (number, method) in rivals.iter().enumerate() {
        let integrator = &method.integrator;
        match families
            .iter_mut()
            .find(|family| family.integrator == integrator)
        {
            Some(family) => family.rivals.push(number),
            None => families.push(Family {
                integrator,
                rivals: vec![number],
            }),
        }
    }
    families
}

/// Numbers of the horizons that have plots: the first, the middle and the last.
pub(super) fn shown(settings: &Settings) -> Vec<usize> {
    let last = settings.horizons.len().saturating_sub(1);
    let mut shown = vec![0, last.div_ceil(2), last];
    shown.dedup();
    shown
}
