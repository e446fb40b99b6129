//! The forward pass: normalised features to normalised accelerations.
//!
//! `encoder` takes features to latent rows, `block` passes messages, `mlp` has the perceptrons and
//! the decoder.

mod block;
mod encoder;
mod mlp;

use selvedge_model::{Network, OUTPUTS};

use super::arrays::{GraphArrays, InputArrays};
use super::dropout::Dropout;
use super::linear::Linear;
use super::record::Record;
use super::weights::WeightArrays;
use crate::schedule::Schedule;
use crate::schedule::plan::Plan;

/// The results of a forward pass that later schedules may read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Keep {
    /// The output alone.
    Output,
    /// The activations as well, for a backward pass.
    Activations(Option<Dropout>),
}

/// A forward pass.
#[derive(Clone, Copy, Debug)]
pub struct ForwardPass<'a> {
    /// The network.
    pub network: &'a Network,
    /// Its weights.
    pub weights: &'a WeightArrays,
    /// The arcs.
    pub graph: &'a GraphArrays,
    /// The features.
    pub input: &'a InputArrays,
    /// The results that are kept.
    pub keep: Keep,
}

/// Adds a forward pass to a schedule, and its arrays to a plan. [`WeightArrays::pack`] must have
/// run before.
pub fn forward(plan: &mut Plan, schedule: &mut Schedule, pass: ForwardPass<'_>) -> Record {
    let spec = pass.network.spec();
    let (latent, graph) = (spec.latent, pass.graph);
    let mut lower = Lower {
        plan,
        schedule,
        weights: pass.weights,
        latent,
        keep: pass.keep,
    };
    let output = lower.plan.floats("output", graph.vertices * OUTPUTS);
    let mut nodes = lower
        .plan
        .floats("latent vertices", graph.vertices * latent);
    let mut arcs = lower.plan.floats("latent arcs", graph.arcs * latent);
    let [node_encoder, arc_encoder] = lower.encode(&pass, [nodes, arcs]);
    let mut blocks = Vec::new();
    for number in 0..spec.blocks {
        let record = lower.block(number, graph, [nodes, arcs], blocks.last());
        [nodes, arcs] = record.after;
        blocks.push(record);
    }
    let decoder = lower.decode(graph.vertices, nodes, output);
    Record {
        node_encoder,
        arc_encoder,
        blocks,
        decoder,
        nodes,
        output,
    }
}

/// A schedule under construction.
struct Lower<'a> {
    plan: &'a mut Plan,
    schedule: &'a mut Schedule,
    weights: &'a WeightArrays,
    latent: usize,
    keep: Keep,
}

impl Lower<'_> {
    /// True where activations are kept.
    fn keeps(&self) -> bool {
        matches!(self.keep, Keep::Activations(_))
    }

    /// Adds a linear layer.
    fn linear(&mut self, layer: Linear) {
        self.schedule.product(layer.into());
    }
}

#[cfg(test)]
mod tests;
