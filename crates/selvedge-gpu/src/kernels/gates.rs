//! Definitions that name the gates of a recurrent unit: the place of each gate in the weights
//! (`WEIGHT_R`), among the activations that are kept (`KEPT_R`), and among the pre-activation
//! gradients (`SUM_R`), in latent vectors.

/// All definitions: their names and values.
pub(super) fn definitions() -> impl Iterator<Item = (String, usize)> {
    let layouts = [
        ("WEIGHT", &["R", "Z", "N"][..]),
        ("KEPT", &["R", "Z", "N", "RECURRENT"]),
        ("SUM", &["N", "R", "Z", "RECURRENT"]),
    ];
    layouts.into_iter().flat_map(|(layout, gates)| {
        let gates = gates.iter().enumerate();
        gates.map(move |(place, gate)| (format!("{layout}_{gate}"), place))
    })
}
