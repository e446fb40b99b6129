//! An evaluation to be made, checked before any work.

use std::path::PathBuf;

use selvedge_data::LoadedScene;

use super::ChoiceError;
use super::case::{Case, Source};
use super::course::departures;
use super::horizons::Horizons;
use super::method::{Method, Mover, PhysicsMethod};

/// An evaluation to be made.
pub struct EvaluationPlan<'a> {
    /// In the order of tables.
    pub cases: &'a [Case],
    /// In the order of tables.
    pub methods: &'a [Method],
    /// The runs.
    pub horizons: &'a Horizons,
    /// The folder in which converged runs are kept; without it they are made anew.
    pub references: Option<PathBuf>,
    /// Threads that share the cases; by default one per processor.
    pub threads: Option<usize>,
}

/// Checks that a plan makes sense before any work; horizons that nobody asked for (the usual ones)
/// need not fit.
pub fn check(plan: &EvaluationPlan<'_>, are_asked: bool) -> Result<(), ChoiceError> {
    let wrong = |problem: String| Err(ChoiceError(problem));
    let horizons = plan.horizons;
    if plan.methods.is_empty() {
        return wrong("there is nothing to measure: name a model or physics".to_owned());
    }
    if horizons.starts == 0 || horizons.frames.first() == Some(&0) {
        return wrong("horizons, starts: give numbers of 1 at least".to_owned());
    }
    let mut longest = None;
    for (number, case) in plan.cases.iter().enumerate() {
        if plan.cases[..number]
            .iter()
            .any(|other| (&other.set, &other.name) == (&case.set, &case.name))
        {
            return wrong(format!(
                "two cases are called {:?}: give each a name",
                case.name
            ));
        }
        let starts = horizons.on(case)?;
        if case.has_truth() {
            let span = starts.span[1] - horizons.from.unwrap_or(starts.span[0]).min(starts.span[1]);
            longest = longest.max(Some(span));
        }
        if let Source::Converged(loaded, reference) = &case.source {
            check_reference(case, loaded, reference, plan.methods)?;
        }
        // Random motions are of one frame rate.
        let is_looked_at = number == 0 || case.has_truth();
        for method in plan.methods.iter().filter(|_| is_looked_at) {
            if let Mover::Model(model, ..) = &method.mover {
                let checked = departures(model, case, None);
                checked.map_err(|error| {
                    ChoiceError(format!("{:?} by {}: {error:#}", case.name, method.name))
                })?;
            }
        }
    }
    let does_not_fit = |k: &&usize| longest.is_some_and(|longest| **k > longest);
    match horizons.frames.iter().find(does_not_fit) {
        Some(k) if are_asked => wrong(format!(
            "horizons: {k} frames fit into no case: the longest has {}",
            longest.unwrap_or(0)
        )),
        _ => Ok(()),
    }
}

fn check_reference(
    case: &Case,
    loaded: &LoadedScene,
    reference: &PhysicsMethod,
    methods: &[Method],
) -> Result<(), ChoiceError> {
    let substeps = reference.substeps;
    if substeps < 2 || substeps % 2 == 1 {
        return Err(ChoiceError(format!(
            "reference: a second run has half as many substeps, so that the number must be even, found {substeps}"
        )));
    }
    let own = reference.scene(&loaded.scene).physics;
    for method in methods {
        let Mover::Physics(physics) = &method.mover else {
            continue;
        };
        let its = physics.scene(&loaded.scene).physics;
        its.validate()
            .map_err(|error| ChoiceError(format!("scene {:?} by {physics}: {error}", case.name)))?;
        if its.integrator == own.integrator && its.substeps >= substeps {
            return Err(ChoiceError(format!(
                "reference: {physics} is no coarser than the reference, {reference}: ask for more substeps of the reference"
            )));
        }
    }
    Ok(())
}
