//! One message-passing block, its first edge layer split: what a vertex adds to all its arcs is one
//! product per vertex, gathered per arc.

use super::record::BlockRecord;
use super::{GraphArrays, Lower};
use crate::kernels::layers::{GATHER_ENDS, NORM_MESSAGES};
use crate::schedule::plan::Region;
use crate::schedule::{Finish, Matrix, Onto};

impl Lower<'_> {
    /// Adds block `number` on latent vertices and arcs. Where nothing is kept it works in the arrays of
    /// the block before.
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
        self.edge_update(number, graph, &record);
        self.node_update(number, graph.vertices, &record);
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
            edge: self.mlp_record(&format!("{name}, arcs"), graph.arcs),
            node: self.mlp_record(&format!("{name}, vertices"), graph.vertices),
        }
    }

    fn edge_update(&mut self, number: usize, graph: &GraphArrays, record: &BlockRecord) {
        let (latent, path) = (self.latent, format!("processor.{number}.edge"));
        let ([nodes, edges], [_, edges_after]) = (record.before, record.after);
        let mark = self.plan.mark();
        let ends = self.plan.floats("both ends", graph.vertices * 2 * latent);
        let pair = (Matrix::new(nodes, latent), self.weights.ends(number));
        let out = Matrix::new(ends, 2 * latent);
        let size = [graph.vertices, latent, 2 * latent];
        self.linear(size, pair, out, Onto::Set, Finish::Nothing);
        let weight = self.weights.matrix(&format!("{path}.0.weight"));
        let pair = (Matrix::new(edges, latent), weight.from_column(2 * latent));
        let out = Matrix::new(record.edge.hidden1, latent);
        let size = [graph.arcs, latent, latent];
        self.linear(size, pair, out, Onto::Set, Finish::Nothing);
        self.schedule.launch(
            &GATHER_ENDS,
            graph.arcs,
            &[
                record.edge.hidden1.into(),
                ends.into(),
                self.weights.get(&format!("{path}.0.bias")).into(),
                graph.senders.into(),
                graph.receivers.into(),
            ],
        );
        self.plan.release(mark);
        self.mlp_rest(&path, graph.arcs, &record.edge);
        let x = record.edge.normal.unwrap_or(record.edge.hidden1);
        let get = |name: &str| self.weights.get(&format!("{path}.{name}"));
        self.schedule.launch(
            &NORM_MESSAGES,
            graph.vertices,
            &[
                x.into(),
                get("4.bias").into(),
                get("5.weight").into(),
                get("5.bias").into(),
                graph.first_arc.into(),
                edges.into(),
                edges_after.into(),
                record.incoming.into(),
                record.edge.inverse.map(|_| x).into(),
                record.edge.inverse.into(),
            ],
        );
    }

    fn node_update(&mut self, number: usize, rows: usize, record: &BlockRecord) {
        let (latent, path) = (self.latent, format!("processor.{number}.node"));
        let ([nodes, _], [after, _]) = (record.before, record.after);
        let weight = self.weights.matrix(&format!("{path}.0.weight"));
        let out = Matrix::new(record.node.hidden1, latent);
        let size = [rows, latent, latent];
        let pair = (Matrix::new(nodes, latent), weight);
        self.linear(size, pair, out, Onto::Set, Finish::Nothing);
        let pair = (
            Matrix::new(record.incoming, latent),
            weight.from_column(latent),
        );
        let finish = self.first_finish(&path);
        self.linear(size, pair, out, Onto::Add, finish);
        self.mlp_rest(&path, rows, &record.node);
        self.mlp_norm(&path, rows, &record.node, (Some(nodes), after));
    }
}
