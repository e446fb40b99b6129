//! The way back through a message-passing block, in place on the gradients of latent vertices and arcs.

use super::{Back, Rows};
use crate::kernels::backward::{GATHER_INCOMING, SUM_ENDS};
use crate::network::BlockRecord;
use crate::schedule::Onto;
use crate::schedule::plan::Region;

impl Back<'_> {
    /// Takes the gradients of latent vertices and arcs from after block `number` to before it.
    pub(super) fn block(&mut self, number: usize, record: &BlockRecord, rows: [Region; 2]) {
        let [nodes, edges] = rows;
        let (latent, graph) = (self.latent, self.pass.graph);
        let mark = self.plan.mark();
        let incoming = self
            .plan
            .floats("gradient of incoming", graph.vertices * latent);
        let inner = self.plan.mark();
        self.vertices(number, record, nodes, incoming);
        self.plan.release(inner);
        let first = self
            .plan
            .floats("gradient of messages", graph.arcs * latent);
        self.arcs(number, record, edges, (incoming, first));
        self.ends(number, record, nodes, first);
        self.plan.release(mark);
    }

    fn vertices(&mut self, number: usize, record: &BlockRecord, nodes: Region, incoming: Region) {
        let (latent, rows) = (self.latent, self.pass.graph.vertices);
        let path = format!("processor.{number}.node");
        let both = ["updates", "updates, other"].map(|name| {
            self.plan
                .floats(format!("gradient of {name}"), rows * latent)
        });
        let [first, _] = both;
        self.schedule.copy(nodes, first);
        self.mlp(&path, rows, both, &record.node);
        let name = format!("{path}.0.weight");
        let (gradient, weight) = (self.matrix_of(&name), self.pass.weights.matrix(&name));
        let first = Rows::new(first, latent);
        for (column, x) in [(0, record.before[0]), (latent, record.incoming)] {
            let (x, gradient) = (Rows::new(x, latent), gradient.from_column(column));
            self.add_to_weight(rows, first, x, gradient);
        }
        let to = (Rows::new(nodes, latent), Onto::Add);
        self.through(rows, first, weight, to);
        let to = (Rows::new(incoming, latent), Onto::Set);
        self.through(rows, first, weight.from_column(latent), to);
    }

    /// Leaves the gradient of the first layer's sums in `first`.
    fn arcs(
        &mut self,
        number: usize,
        record: &BlockRecord,
        edges: Region,
        (incoming, first): (Region, Region),
    ) {
        let (latent, graph) = (self.latent, self.pass.graph);
        let path = format!("processor.{number}.edge");
        self.schedule.launch(
            &GATHER_INCOMING,
            graph.arcs,
            &[
                edges.into(),
                incoming.into(),
                graph.receivers.into(),
                first.into(),
            ],
        );
        let mark = self.plan.mark();
        let other = self
            .plan
            .floats("gradient of messages, other", graph.arcs * latent);
        self.mlp(&path, graph.arcs, [first, other], &record.edge);
        self.plan.release(mark);
        let name = format!("{path}.0.weight");
        let (gradient, weight) = (self.matrix_of(&name), self.pass.weights.matrix(&name));
        let (g, x) = (
            Rows::new(first, latent),
            Rows::new(record.before[1], latent),
        );
        self.add_to_weight(graph.arcs, g, x, gradient.from_column(2 * latent));
        let to = (Rows::new(edges, latent), Onto::Add);
        self.through(graph.arcs, g, weight.from_column(2 * latent), to);
    }

    /// What comes through the products of the vertices.
    fn ends(&mut self, number: usize, record: &BlockRecord, nodes: Region, first: Region) {
        let (latent, graph) = (self.latent, self.pass.graph);
        let sums = self
            .plan
            .floats("gradient of both ends", graph.vertices * 2 * latent);
        self.schedule.launch(
            &SUM_ENDS,
            graph.vertices,
            &[
                first.into(),
                graph.first_arc.into(),
                graph.twins.into(),
                sums.into(),
            ],
        );
        let gradient = self.matrix_of(&format!("processor.{number}.edge.0.weight"));
        let both = Rows::new(sums, 2 * latent);
        let before = Rows::new(record.before[0], latent);
        for column in [0, latent] {
            let (g, to) = (both.columns(column, latent), gradient.from_column(column));
            self.add_to_weight(graph.vertices, g, before, to);
        }
        let weight = self.pass.weights.ends(number);
        let to = (Rows::new(nodes, latent), Onto::Add);
        self.through(graph.vertices, both, weight, to);
    }
}
