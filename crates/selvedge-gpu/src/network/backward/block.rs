//! The backward pass of a message-passing block, in place on the gradients of latent vertices and
//! arcs.

use super::Back;
use crate::kernels::backward::{GATHER_INCOMING, SUM_ENDS};
use crate::network::linear::Rows;
use crate::network::record::BlockRecord;
use crate::schedule::plan::Region;
use crate::schedule::{Onto, args};

impl Back<'_> {
    /// Takes the gradients of latent vertices and arcs from after block `number` to before it.
    pub(super) fn block(
        &mut self,
        number: usize,
        record: &BlockRecord,
        nodes: Region,
        arcs: Region,
    ) {
        let (latent, graph) = (self.latent, self.pass.graph);
        let mark = self.plan.mark();
        let incoming = self
            .plan
            .floats("gradient of incoming", graph.vertices * latent);
        let inner = self.plan.mark();
        self.vertices(number, record, nodes, incoming);
        self.plan.release(inner);
        let pre_activation = self
            .plan
            .floats("gradient of messages", graph.arcs * latent);
        self.messages(arcs, incoming, pre_activation);
        self.arcs(number, record, arcs, pre_activation);
        self.endpoints(number, record, nodes, pre_activation);
        self.plan.release(mark);
    }

    fn vertices(&mut self, number: usize, record: &BlockRecord, nodes: Region, incoming: Region) {
        let (latent, rows) = (self.latent, self.pass.graph.vertices);
        let path = format!("processor.{number}.node");
        let [first, other] = ["updates", "updates, other"].map(|name| {
            self.plan
                .floats(format!("gradient of {name}"), rows * latent)
        });
        self.schedule.copy(nodes, first);
        self.mlp(&path, rows, first, other, &record.node);
        let name = format!("{path}.0.weight");
        let (gradient, weight) = (self.matrix_of(&name), self.pass.weights.matrix(&name));
        let first = Rows::new(first, latent);
        for (column, x) in [(0, record.before[0]), (latent, record.incoming)] {
            let (x, gradient) = (Rows::new(x, latent), gradient.from_column(column));
            self.add_to_weight(rows, first, x, gradient);
        }
        let to = Rows::new(nodes, latent);
        self.through(rows, first, weight, to, Onto::Add);
        let to = Rows::new(incoming, latent);
        self.through(rows, first, weight.from_column(latent), to, Onto::Set);
    }

    /// The gradients of the messages, from those of the arcs and of the sums of messages.
    fn messages(&mut self, arcs: Region, incoming: Region, messages: Region) {
        let graph = self.pass.graph;
        let arguments = args! {
            arcs,
            incoming,
            receivers: graph.receivers,
            messages,
        };
        self.schedule
            .launch(&GATHER_INCOMING, graph.arcs, arguments);
    }

    /// Takes the gradient of the messages to the pre-activation gradient of the first layer, in
    /// place.
    fn arcs(&mut self, number: usize, record: &BlockRecord, arcs: Region, pre_activation: Region) {
        let (latent, graph) = (self.latent, self.pass.graph);
        let path = format!("processor.{number}.edge");
        let mark = self.plan.mark();
        let other = self
            .plan
            .floats("gradient of messages, other", graph.arcs * latent);
        self.mlp(&path, graph.arcs, pre_activation, other, &record.arc);
        self.plan.release(mark);
        let name = format!("{path}.0.weight");
        let (gradient, weight) = (self.matrix_of(&name), self.pass.weights.matrix(&name));
        let g = Rows::new(pre_activation, latent);
        let x = Rows::new(record.before[1], latent);
        self.add_to_weight(graph.arcs, g, x, gradient.from_column(2 * latent));
        let to = Rows::new(arcs, latent);
        self.through(graph.arcs, g, weight.from_column(2 * latent), to, Onto::Add);
    }

    /// Adds the gradient of the endpoint products to that of the latent vertices.
    fn endpoints(
        &mut self,
        number: usize,
        record: &BlockRecord,
        nodes: Region,
        pre_activation: Region,
    ) {
        let (latent, graph) = (self.latent, self.pass.graph);
        let sums = self
            .plan
            .floats("gradient of endpoint products", graph.vertices * 2 * latent);
        let arguments = args! {
            pre_activation,
            first_arc: graph.first_arc,
            reverse_arcs: graph.reverse_arcs,
            sums,
        };
        self.schedule.launch(&SUM_ENDS, graph.vertices, arguments);
        let gradient = self.matrix_of(&format!("processor.{number}.edge.0.weight"));
        let both = Rows::new(sums, 2 * latent);
        let before = Rows::new(record.before[0], latent);
        for column in [0, latent] {
            let (g, to) = (both.columns(column, latent), gradient.from_column(column));
            self.add_to_weight(graph.vertices, g, before, to);
        }
        let weight = self.pass.weights.ends(number);
        let to = Rows::new(nodes, latent);
        self.through(graph.vertices, both, weight, to, Onto::Add);
    }
}
