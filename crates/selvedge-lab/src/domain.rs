//! What of a scene or of a trajectory goes beyond what a model was trained on, known before the
//! first frame.

use anyhow::Result;
use selvedge::domain::checked;
pub use selvedge::domain::{Beyond, of_scene};
use selvedge_data::Trajectory;
use selvedge_model::{Departure, Model};
use selvedge_train::domain_of;

/// Compares a trajectory with what `model` was trained on; none where its file does not say.
pub fn of_trajectory(
    model: &Model,
    motion: &str,
    trajectory: &Trajectory,
) -> Result<Option<Vec<Departure>>> {
    let Some(trained) = model.domain() else {
        return Ok(None);
    };
    Ok(Some(checked(&trained, &domain_of(motion, trajectory)?)?))
}
