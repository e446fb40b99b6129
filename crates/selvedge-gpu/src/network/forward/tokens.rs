//! Tokens of a block: the weights of vertices over them, their means, their update, and what the
//! vertices read.

use super::Lower;
use crate::kernels::layers::{ADD_MODES, MODE_SUMS, SLICE_WEIGHTS, TOKEN_MEANS};
use crate::network::arrays::GraphArrays;
use crate::network::linear::{Linear, Rows};
use crate::network::record::{BlockRecord, TokenRecord};
use crate::schedule::args;

impl Lower<'_> {
    /// Room for the tokens of a block; none where it has none.
    pub(super) fn token_record(&mut self, name: &str, graph: &GraphArrays) -> Option<TokenRecord> {
        let (count, latent) = (self.tokens, self.latent);
        let rows = graph.places.cloths * count;
        (count > 0).then(|| {
            let [slices, weighted] = ["slices", "slices times areas"].map(|what| {
                self.plan
                    .floats(format!("{name}, {what}"), graph.vertices * count)
            });
            let [means, updated] = ["tokens", "updated tokens"]
                .map(|what| self.plan.floats(format!("{name}, {what}"), rows * latent));
            TokenRecord {
                count,
                slices,
                weighted,
                means,
                sizes: self.plan.floats(format!("{name}, sizes of tokens"), rows),
                update: self.mlp_record(&format!("{name}, update of tokens"), rows),
                updated,
            }
        })
    }

    /// Adds what vertices read of the tokens to the first layer of a node update.
    pub(super) fn tokens(&mut self, number: usize, graph: &GraphArrays, record: &BlockRecord) {
        let Some(tokens) = &record.tokens else {
            return;
        };
        let (count, latent) = (tokens.count, self.latent);
        let (places, vertices) = (&graph.places, graph.vertices);
        let path = format!("processor.{number}.tokens");
        let rows = places.cloths * count;
        let nodes = Rows::new(record.before[0], latent);
        let weight = self.weights.matrix(&format!("{path}.slice.weight"));
        let out = Rows::new(tokens.slices, count);
        self.linear(Linear::new(vertices, nodes, weight, out));
        let arguments = args! {
            slices: tokens.slices,
            bias: self.weights.get(&format!("{path}.slice.bias")),
            shares: places.shares,
            tokens: count,
            weighted: tokens.weighted,
        };
        self.schedule.launch(&SLICE_WEIGHTS, vertices, arguments);
        let arguments = args! {
            modes: tokens.weighted,
            rows: record.before[0],
            first_vertex: places.first_vertex,
            per_cloth: count,
            sums: tokens.means,
        };
        self.schedule.launch(&MODE_SUMS, rows, arguments);
        let arguments = args! {
            means: tokens.means,
            weighted: tokens.weighted,
            first_vertex: places.first_vertex,
            tokens: count,
            sizes: tokens.sizes,
        };
        self.schedule.launch(&TOKEN_MEANS, rows, arguments);
        self.update_tokens(&format!("{path}.update"), rows, tokens);
        let mark = self.plan.mark();
        let of_modes = self.plan.floats("tokens in a first layer", rows * latent);
        let [x, out] = [tokens.updated, of_modes].map(|region| Rows::new(region, latent));
        let weight = self.weights.last_columns(number, latent);
        self.linear(Linear::new(rows, x, weight, out));
        let arguments = args! {
            modes: tokens.slices,
            of_modes,
            cloth_of: places.cloth_of,
            per_cloth: count,
            rows: record.node.hidden1,
        };
        self.schedule.launch(&ADD_MODES, vertices, arguments);
        self.plan.release(mark);
    }

    /// Adds the update of the tokens of all cloths.
    fn update_tokens(&mut self, path: &str, rows: usize, tokens: &TokenRecord) {
        let latent = self.latent;
        let weight = self.weights.matrix(&format!("{path}.0.weight"));
        let (x, out) = (
            Rows::new(tokens.means, latent),
            Rows::new(tokens.update.hidden1, latent),
        );
        let epilogue = self.first_epilogue(path);
        self.linear(Linear::new(rows, x, weight, out).then(epilogue));
        self.mlp_rest(path, rows, &tokens.update);
        let (before, after) = (Some(tokens.means), tokens.updated);
        self.mlp_norm(path, rows, &tokens.update, before, after);
    }
}
