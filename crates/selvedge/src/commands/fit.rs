//! `selvedge fit`: numbers of a scene from what was seen.

use selvedge_lab::fit::{self, Order};
use selvedge_lab::folder::{FolderKind, claim_folder};
use serde_json::json;

use crate::cli::FitArgs;
use crate::output::{Answer, End, Facts, length};
use crate::{place, progress};

/// Fits, and writes what was found.
pub(crate) fn run(args: &FitArgs) -> anyhow::Result<Answer> {
    place::check_new_folder(&args.output)?;
    let order = Order::read(&args.order)?;
    order
        .loaded
        .warnings
        .iter()
        .for_each(|warning| tracing::warn!("{warning}"));
    let _claimed = claim_folder(&args.output, FolderKind::Fit)?;
    let Some(fitted) = fit::fit(&order, &mut progress::listener())? else {
        anyhow::bail!("interrupted before the first run had ended: nothing is written");
    };
    let wrote = fit::write(&args.output, &order, &fitted)?;
    let mut facts = Facts::new();
    facts.tell("scene", &fitted.scene.name);
    facts.add_all("found", &fitted.numbers);
    let (distance, noise) = (length(fitted.rms), length(fitted.noise));
    facts.add(
        "distance",
        format!("{distance} per coordinate, noise {noise}"),
    );
    let ([runs, back], failed) = (fitted.runs, fitted.failed);
    facts.add(
        "runs",
        format!("{runs}, {back} of them also back; {failed} failed"),
    );
    let end = match &fitted.directions {
        None => End::Interrupted,
        Some(directions) => {
            let told = directions.iter().filter(|one| one.is_told).count();
            facts.add(
                "told",
                format!("{told} of {} combinations", directions.len()),
            );
            End::Complete
        }
    };
    facts.add_paths("wrote", &wrote);
    Ok(facts.answer_at(end, json!({ "fit": fitted, "wrote": wrote })))
}
