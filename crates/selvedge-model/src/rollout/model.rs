//! A trained model: network, weights and the frozen statistics of its inputs and its output.

use crate::domain::Domain;
use crate::features::normalizer::Normalizer;
use crate::network::Network;
use crate::spec::{ModelSpec, OUTPUTS, SpecError};

/// Frozen statistics of the inputs and the output of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalizers {
    /// Statistics of node features, `[node width]`.
    pub nodes: Normalizer,
    /// Statistics of arc features, `[edge width]`.
    pub edges: Normalizer,
    /// Statistics of accelerations in the local frame [m/frame²], `[3]`.
    pub acceleration: Normalizer,
}

impl Normalizers {
    /// Each with its name in a model file.
    pub(crate) fn named(&self) -> [(&'static str, &Normalizer); 3] {
        [
            ("nodes", &self.nodes),
            ("edges", &self.edges),
            ("acceleration", &self.acceleration),
        ]
    }
}

/// A network with its weights and statistics, ready for rollouts.
#[derive(Clone, Debug)]
pub struct Model {
    network: Network,
    weights: Vec<f32>,
    normalizers: Normalizers,
    /// Account of its training, as JSON; free text for a model that was not trained.
    pub training: String,
}

impl Model {
    /// Puts a model together; `weights` laid out as [`Network::parameters`] says.
    ///
    /// # Errors
    /// [`SpecError`] when the spec is invalid, a count is not the spec's, or a weight is not
    /// finite.
    pub fn new(
        spec: &ModelSpec,
        weights: Vec<f32>,
        normalizers: Normalizers,
        training: String,
    ) -> Result<Self, SpecError> {
        let network = Network::new(spec)?;
        check_counts(&network, &weights, &normalizers)?;
        check_finite(&network, &weights)?;
        Ok(Self {
            network,
            weights,
            normalizers,
            training,
        })
    }

    /// The domain that the model was trained on, if its account of the training says so.
    pub fn domain(&self) -> Option<Domain> {
        Domain::in_account(&self.training).ok().flatten()
    }

    /// The network.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// The spec of the network.
    pub fn spec(&self) -> &ModelSpec {
        self.network.spec()
    }

    /// The weights, laid out as [`Network::parameters`] says.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The statistics.
    pub fn normalizers(&self) -> &Normalizers {
        &self.normalizers
    }
}

fn check_counts(
    network: &Network,
    weights: &[f32],
    normalizers: &Normalizers,
) -> Result<(), SpecError> {
    let spec = network.spec();
    let check = |what: &str, expected: usize, found: usize| {
        if expected == found {
            Ok(())
        } else {
            Err(SpecError(format!(
                "{what} has {found} values, but the spec of the model needs {expected}"
            )))
        }
    };
    check(
        "the array of weights",
        network.parameter_count(),
        weights.len(),
    )?;
    let widths = [spec.node_width(), spec.edge_width(), OUTPUTS];
    for ((of, normalizer), width) in normalizers.named().into_iter().zip(widths) {
        check(&format!("normalizer.{of}"), width, normalizer.width())?;
    }
    Ok(())
}

fn check_finite(network: &Network, weights: &[f32]) -> Result<(), SpecError> {
    for parameter in network.parameters() {
        let values = &weights[parameter.range.clone()];
        if let Some(index) = values.iter().position(|w| !w.is_finite()) {
            let name = &parameter.name;
            return Err(SpecError(format!("weight {name}[{index}] is not finite")));
        }
    }
    Ok(())
}
