//! One message-passing block, with its first edge layer split: the contribution of a vertex to all
//! its arcs is one product per vertex, the *endpoint products*, gathered per arc.

use super::Lower;
use crate::kernels::layers::{GATHER_ENDS, NORM_MESSAGES};
use crate::network::arrays::GraphArrays;
use crate::network::linear::{Linear, Rows};
use crate::network::record::BlockRecord;
use crate::schedule::plan::Region;
use crate::schedule::{Onto, args};

impl Lower<'_> {
    /// Adds block `number` on latent vertices and arcs. It works in the arrays of the block before
    /// where nothing is kept.
    pub(super) fn block(
        &mut self,
        number: usize,
        graph: &GraphArrays,
        before: [Region; 2],
        earlier: Option<&BlockRecord>,
    ) -> BlockRecord {
        let record = match earlier {
            Some(earlier) if !self.keeps() => earlier.clone(),
            _ => self.block_record(number, graph, before),
        };
        self.arc_update(number, graph, &record);
        self.node_update(number, graph, &record);
        record
    }

    fn block_record(
        &mut self,
        number: usize,
        graph: &GraphArrays,
        before: [Region; 2],
    ) -> BlockRecord {
        let name = format!("block {number}");
        let after = if self.keeps() {
            before.map(|rows| self.plan.floats(format!("{name}, latent"), rows.count()))
        } else {
            before
        };
        BlockRecord {
            before,
            after,
            incoming: self
                .plan
                .floats(format!("{name}, incoming"), graph.vertices * self.latent),
            arc: self.mlp_record(&format!("{name}, arcs"), graph.arcs),
            node: self.mlp_record(&format!("{name}, vertices"), graph.vertices),
        }
    }

    fn arc_update(&mut self, number: usize, graph: &GraphArrays, record: &BlockRecord) {
        let (latent, path) = (self.latent, format!("processor.{number}.edge"));
        let ([nodes, before], [_, after]) = (record.before, record.after);
        let mark = self.plan.mark();
        let endpoint_products = self
            .plan
            .floats("endpoint products", graph.vertices * 2 * latent);
        let out = Rows::new(endpoint_products, 2 * latent);
        let (x, weight) = (Rows::new(nodes, latent), self.weights.ends(number));
        self.linear(Linear::new(graph.vertices, x, weight, out));
        let weight = self.weights.matrix(&format!("{path}.0.weight"));
        let own = weight.from_column(2 * latent);
        let (x, out) = (
            Rows::new(before, latent),
            Rows::new(record.arc.hidden1, latent),
        );
        self.linear(Linear::new(graph.arcs, x, own, out));
        let arguments = args! {
            hidden: record.arc.hidden1,
            endpoint_products,
            bias: self.weights.get(&format!("{path}.0.bias")),
            senders: graph.senders,
            receivers: graph.receivers,
        };
        self.schedule.launch(&GATHER_ENDS, graph.arcs, arguments);
        self.plan.release(mark);
        self.mlp_rest(&path, graph.arcs, &record.arc);
        let x = record.arc.normal.unwrap_or(record.arc.hidden1);
        let get = |name: &str| self.weights.get(&format!("{path}.{name}"));
        let arguments = args! {
            x,
            bias: get("4.bias"),
            weight: get("5.weight"),
            shift: get("5.bias"),
            first_arc: graph.first_arc,
            before,
            after,
            incoming: record.incoming,
            normal: record.arc.inverse.map(|_| x),
            inverse: record.arc.inverse,
        };
        self.schedule
            .launch(&NORM_MESSAGES, graph.vertices, arguments);
    }

    fn node_update(&mut self, number: usize, graph: &GraphArrays, record: &BlockRecord) {
        let rows = graph.vertices;
        let (latent, path) = (self.latent, format!("processor.{number}.node"));
        let ([before, _], [after, _]) = (record.before, record.after);
        let weight = self.weights.matrix(&format!("{path}.0.weight"));
        let out = Rows::new(record.node.hidden1, latent);
        let x = Rows::new(before, latent);
        self.linear(Linear::new(rows, x, weight, out));
        let x = Rows::new(record.incoming, latent);
        let epilogue = self.first_epilogue(&path);
        let incoming = Linear::new(rows, x, weight.from_column(latent), out);
        self.linear(incoming.onto(Onto::Add).then(epilogue));
        self.mlp_rest(&path, rows, &record.node);
        self.mlp_norm(&path, rows, &record.node, Some(before), after);
    }
}
