//! `selvedge fit`: numbers of a scene from what was seen.

use selvedge_lab::fit::Fit;
use selvedge_lab::folder::{FolderKind, claim_folder};

use crate::cli::FitArgs;
use crate::output::{Answer, End};
use crate::{place, progress};

/// Fits, and writes what was found.
pub(crate) fn run(args: &FitArgs) -> anyhow::Result<Answer> {
    place::check_new_folder(&args.output)?;
    let mut fit = Fit::read(&args.config)?;
    for warning in &fit.loaded.warnings {
        tracing::warn!("{warning}");
    }
    let _claimed = claim_folder(&args.output, FolderKind::Fit)?;
    let is_found = fit.search(&mut progress::listener())?;
    let wrote = fit.write(&args.output)?;
    let text = if is_found { fit.report() } else { "nothing was found yet\n".to_owned() };
    let is_whole = fit.directions.is_some();
    let end = if is_whole { End::Complete } else { End::Interrupted };
    let mut answer = Answer::new(text, fit.json()).ended(end);
    for path in wrote {
        answer = answer.noting("wrote", &path);
    }
    Ok(answer)
}
