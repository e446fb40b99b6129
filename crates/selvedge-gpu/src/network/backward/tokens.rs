//! The backward pass through the tokens of a block, in place on the gradient of latent vertices.

use super::Back;
use crate::kernels::backward::{SLICE_GRADIENTS, SOFTMAX_BACKWARD, TOKEN_MEANS_BACKWARD};
use crate::kernels::layers::{ADD_MODES, MODE_SUMS};
use crate::network::linear::{Linear, Rows};
use crate::network::record::{BlockRecord, TokenRecord};
use crate::schedule::plan::Region;
use crate::schedule::{Matrix, Onto, args};

/// Gradients of the tokens of a block, `[cloths, tokens, latent]` but for the last.
struct TokenGradients {
    /// The updated tokens in a first layer, as the forward pass had them.
    mixed: Region,
    /// Gradient of `mixed`.
    by_mixed: Region,
    /// Gradient of the tokens, then of the sums that they are the means of.
    by_sums: Region,
    /// Gradient of the update.
    by_update: Region,
    /// Room for as many numbers.
    other: Region,
    /// Gradient of the tokens' sizes, `[cloths, tokens]`.
    by_sizes: Region,
}

impl Back<'_> {
    /// Takes the pre-activation gradient of a node update's first layer through the tokens to the
    /// latent vertices, and adds the gradients of the weights on the way.
    pub(super) fn tokens(
        &mut self,
        number: usize,
        record: &BlockRecord,
        pre_activation: Region,
        nodes: Region,
    ) {
        let Some(tokens) = &record.tokens else {
            return;
        };
        let (count, latent, graph) = (tokens.count, self.latent, self.pass.graph);
        let rows = graph.places.cloths * count;
        let [mixed, by_mixed, by_sums, by_update, other] = [
            "mixed",
            "mixed, gradient",
            "sums",
            "update",
            "update, other",
        ]
        .map(|name| {
            let name = format!("gradient of tokens, {name}");
            self.plan.floats(name, rows * latent)
        });
        let by_sizes = self.plan.floats("gradient of sizes of tokens", rows);
        let of = TokenGradients {
            mixed,
            by_mixed,
            by_sums,
            by_update,
            other,
            by_sizes,
        };
        self.read_tokens(number, tokens, pre_activation, &of);
        self.update_tokens(number, tokens, &of);
        let arguments = args! {
            modes: tokens.weighted,
            of_modes: by_sums,
            cloth_of: graph.places.cloth_of,
            per_cloth: count,
            rows: nodes,
        };
        self.schedule.launch(&ADD_MODES, graph.vertices, arguments);
        self.slices(
            number,
            tokens,
            [pre_activation, record.before[0], nodes],
            &of,
        );
    }

    /// Through the weights of the vertices over the tokens, to the latent vertices. `arrays` are
    /// the pre-activation gradient of the node update's first layer, the latent vertices, and their
    /// gradient.
    fn slices(
        &mut self,
        number: usize,
        tokens: &TokenRecord,
        arrays: [Region; 3],
        of: &TokenGradients,
    ) {
        let [pre_activation, before, nodes] = arrays;
        let (count, latent, graph) = (tokens.count, self.latent, self.pass.graph);
        let by_slices = self
            .plan
            .floats("gradient of slices", graph.vertices * count);
        let arguments = args! {
            pre_activation,
            mixed: of.mixed,
            nodes: before,
            by_sums: of.by_sums,
            by_sizes: of.by_sizes,
            shares: graph.places.shares,
            cloth_of: graph.places.cloth_of,
            tokens: count,
            by_slices,
        };
        self.schedule
            .launch(&SLICE_GRADIENTS, graph.vertices, arguments);
        let arguments = args! {
            softmax: tokens.slices,
            gradient: by_slices,
            width: count,
        };
        self.schedule
            .launch(&SOFTMAX_BACKWARD, graph.vertices, arguments);
        let path = format!("processor.{number}.tokens.slice");
        let (g, x) = (Rows::new(by_slices, count), Rows::new(before, latent));
        self.linear(graph.vertices, &path, g, x);
        let weight = self.pass.weights.matrix(&format!("{path}.weight"));
        self.through(
            graph.vertices,
            g,
            weight,
            Rows::new(nodes, latent),
            Onto::Add,
        );
    }

    /// Through what the vertices read, to the gradient of the updated tokens.
    fn read_tokens(
        &mut self,
        number: usize,
        tokens: &TokenRecord,
        pre_activation: Region,
        of: &TokenGradients,
    ) {
        let (latent, graph) = (self.latent, self.pass.graph);
        let rows = graph.places.cloths * tokens.count;
        let weight = self.pass.weights.last_columns(number, latent);
        let [updated, mixed, by_mixed, by_sums] =
            [tokens.updated, of.mixed, of.by_mixed, of.by_sums]
                .map(|region| Rows::new(region, latent));
        self.schedule
            .product(Linear::new(rows, updated, weight, mixed).into());
        let arguments = args! {
            modes: tokens.slices,
            rows: pre_activation,
            first_vertex: graph.places.first_vertex,
            per_cloth: tokens.count,
            sums: of.by_mixed,
        };
        self.schedule.launch(&MODE_SUMS, rows, arguments);
        let gradient = self.last_columns_of(number);
        self.add_to_weight(rows, by_mixed, updated, gradient);
        self.through(rows, by_mixed, weight, by_sums, Onto::Set);
    }

    /// Through the update of the tokens and the division by their sizes.
    fn update_tokens(&mut self, number: usize, tokens: &TokenRecord, of: &TokenGradients) {
        let latent = self.latent;
        let rows = self.pass.graph.places.cloths * tokens.count;
        let path = format!("processor.{number}.tokens.update");
        self.schedule.copy(of.by_sums, of.by_update);
        self.mlp(&path, rows, of.by_update, of.other, &tokens.update);
        let name = format!("{path}.0.weight");
        let [g, x, to] =
            [of.by_update, tokens.means, of.by_sums].map(|region| Rows::new(region, latent));
        self.add_to_weight(rows, g, x, self.matrix_of(&name));
        let weight = self.pass.weights.matrix(&name);
        self.through(rows, g, weight, to, Onto::Add);
        let arguments = args! {
            gradient: of.by_sums,
            means: tokens.means,
            sizes: tokens.sizes,
            by_sizes: of.by_sizes,
        };
        self.schedule.launch(&TOKEN_MEANS_BACKWARD, rows, arguments);
    }

    /// The gradient of the columns of a node update's first layer for what vertices read.
    fn last_columns_of(&self, number: usize) -> Matrix {
        let name = format!("processor.{number}.node.0.weight");
        let (_, columns) = self.pass.weights.place(&name);
        self.matrix_of(&name).from_column(columns - self.latent)
    }
}
