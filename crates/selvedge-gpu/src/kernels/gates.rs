//! Definitions that name the gates of a recurrent unit: the place of each [`Gate`] in the weights
//! (`WEIGHT_RESET`), among the activations that are kept (`KEPT_RESET`), and among the
//! pre-activation gradients (`GRADIENT_RESET`), in latent vectors.

use selvedge_model::Gate;

/// All definitions: their names and values.
pub(super) fn definitions() -> impl Iterator<Item = (String, usize)> {
    let layouts = [
        ("WEIGHT", Gate::WEIGHTS),
        ("KEPT", Gate::KEPT),
        ("GRADIENT", Gate::GRADIENTS),
    ];
    layouts.into_iter().flat_map(|(name, layout)| {
        Gate::ALL.map(|gate| (format!("{name}_{}", word(gate)), layout.offset(gate)))
    })
}

fn word(gate: Gate) -> &'static str {
    match gate {
        Gate::Reset => "RESET",
        Gate::Update => "UPDATE",
        Gate::New => "NEW",
        Gate::Recurrent => "RECURRENT",
    }
}
