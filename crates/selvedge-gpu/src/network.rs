//! The network as launches: forward, and backward with the activations computed anew.
//!
//! A training keeps the features of each frame and the latent rows between its blocks. On the way
//! back every block is computed once more from the rows before it, by the same launches, and leaves
//! its activations in [`Activations`], which all blocks share. So the memory of a training hardly
//! grows with what a block keeps, for a third more of arithmetic.
//!
//! The first layer of an edge update is split: the contribution of a vertex to all its arcs is one
//! product per vertex, gathered by each arc.

use std::collections::HashMap;

use selvedge_model::{Connectivity, ModelSpec, Network, OUTPUTS};

use crate::gpu::{Launch, Plan, Region};
use crate::kernels::{
    Dropout, Epilogue, Gates, Matrix, Messages, Norm, Onto, Pieces, Sizes, ToWeights,
    gates_backward, linear, linear_to_input, messages_backward, part_numbers, sum_ends,
};

/// The arcs of a union, as indices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Graph {
    vertices: usize,
    arcs: usize,
    senders: Region,
    receivers: Region,
    first_arc: Region,
    reverse_arcs: Region,
}

impl Graph {
    pub(crate) fn new(plan: &mut Plan, graph: &Connectivity) -> Self {
        Self {
            vertices: graph.vertex_count(),
            arcs: graph.arc_count(),
            senders: plan.indices(graph.senders()),
            receivers: plan.indices(graph.receivers()),
            first_arc: plan.indices(graph.first_arc()),
            reverse_arcs: plan.indices(graph.reverse_arcs()),
        }
    }
}

/// Arrays of vertices and of arcs.
pub(crate) type Both = [Region; 2];

/// Activations of a perceptron, and room that it works in.
#[derive(Clone, Copy, Debug)]
struct Activations {
    hidden1: Region,
    hidden2: Region,
    /// The output, normalised in place.
    normal: Region,
    inverse: Region,
}

/// Latent rows and features of a frame.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// Features, `[steps, rows, width]`.
    pub(crate) input: Both,
    /// Latent rows before each block and after the last. In a rollout all are the same arrays.
    latent: Vec<Both>,
    /// Normalised accelerations, `[vertices, 3]`.
    pub(crate) output: Region,
    /// Dropout of the rows of vertices and of arcs.
    pub(crate) dropout: Option<[Dropout; 2]>,
}

/// Room for gradients.
#[derive(Clone, Debug)]
pub(crate) struct Gradients {
    /// Of the weights, laid out like them.
    pub(crate) weights: Region,
    /// Of the output, `[vertices, 3]`.
    pub(crate) output: Region,
    /// Of the features.
    pub(crate) input: Both,
    latent: Both,
    /// Of the activations before a layer, and of messages.
    hidden: [Region; 2],
    incoming: Region,
    ends: Region,
    parts: Region,
}

/// A network whose launches are written down.
pub(crate) struct Lowering<'a> {
    pub(crate) plan: &'a mut Plan,
    pub(crate) launches: Vec<Launch>,
    spec: &'a ModelSpec,
    graph: Graph,
    weights: Region,
    places: HashMap<&'a str, u32>,
    activations: [Activations; 2],
    /// Sums of messages, `[vertices, latent]`.
    incoming: Region,
    /// Products of vertices, `[vertices, 2 latent]`.
    ends: Region,
}

/// 0 for vertices, 1 for arcs.
type Kind = usize;

const ENCODERS: [&str; 2] = ["encoder.nodes", "encoder.edges"];

impl<'a> Lowering<'a> {
    /// `weights` is the place of the weights.
    pub(crate) fn new(
        plan: &'a mut Plan,
        network: &'a Network,
        graph: Graph,
        weights: Region,
    ) -> Self {
        let spec = network.spec();
        let (latent, rows) = (spec.latent, [graph.vertices, graph.arcs]);
        let activations = rows.map(|rows| Activations {
            hidden1: plan.numbers(rows * latent),
            hidden2: plan.numbers(rows * latent),
            normal: plan.numbers(rows * latent),
            inverse: plan.numbers(rows),
        });
        let places = network.parameters().iter();
        let places = places.map(|p| (&*p.name, weights.first + p.range.start as u32));
        Self {
            incoming: plan.numbers(graph.vertices * latent),
            ends: plan.numbers(graph.vertices * 2 * latent),
            launches: Vec::new(),
            places: places.collect(),
            plan,
            spec,
            graph,
            weights,
            activations,
        }
    }

    fn rows(&self, kind: Kind) -> usize {
        [self.graph.vertices, self.graph.arcs][kind]
    }

    /// Columns of the features.
    fn width(&self, kind: Kind) -> usize {
        [self.spec.node_width(), self.spec.edge_width()][kind]
    }

    /// Room for the features of a window.
    pub(crate) fn input(&mut self) -> Both {
        [0, 1].map(|kind| {
            let count = self.spec.window() * self.rows(kind) * self.width(kind);
            self.plan.numbers(count)
        })
    }

    /// Room for a frame, whose latent rows are kept for the way back or not.
    pub(crate) fn frame(&mut self, keeps: bool, dropout: Option<[Dropout; 2]>) -> Frame {
        let latent = self.spec.latent;
        let rows = [0, 1].map(|kind| self.rows(kind) * latent);
        let room = |plan: &mut Plan| rows.map(|count| plan.numbers(count));
        let blocks = self.spec.blocks;
        let latent = if keeps {
            (0..=blocks).map(|_| room(self.plan)).collect()
        } else {
            vec![room(self.plan); blocks + 1]
        };
        Frame {
            input: self.input(),
            latent,
            output: self.plan.numbers(self.graph.vertices * OUTPUTS),
            dropout,
        }
    }

    /// Room for gradients; that of the weights is given.
    pub(crate) fn gradients(&mut self, weights: Region) -> Gradients {
        let latent = self.spec.latent;
        let [vertices, arcs] = [0, 1].map(|kind| self.rows(kind));
        let most = vertices.max(arcs);
        let parts = [
            (arcs, latent, latent),
            (vertices, 2 * latent, latent),
            (
                most,
                latent.max(self.width(0)).max(self.width(1)),
                3 * latent,
            ),
        ];
        let parts = parts.map(|(rows, inputs, outputs)| part_numbers(rows, inputs, outputs));
        let input = self.input();
        let mut room = |count: usize| self.plan.numbers(count);
        Gradients {
            weights,
            output: room(vertices * OUTPUTS),
            input,
            latent: [vertices, arcs].map(|rows| room(rows * latent)),
            hidden: [(); 2].map(|()| room(most * latent)),
            incoming: room(vertices * latent),
            ends: room(2 * vertices * latent),
            parts: room(parts.into_iter().max().unwrap_or(0)),
        }
    }

    /// The place of a weight.
    fn at(&self, name: &str) -> u32 {
        self.places[name]
    }

    fn matrix(&self, name: &str, ld: usize) -> Matrix {
        let first = self.at(name);
        Matrix { first, ld }
    }

    /// A matrix of latent rows.
    fn latent(&self, rows: Region) -> Matrix {
        Matrix::new(rows, self.spec.latent)
    }

    fn sizes(&self, kind: Kind, columns: usize, k: usize) -> Sizes {
        let rows = self.rows(kind);
        Sizes { rows, columns, k }
    }

    /// The normalisation at the end of a module.
    fn norm(&self, kind: Kind, name: &str) -> Norm {
        let Activations {
            normal, inverse, ..
        } = self.activations[kind];
        Norm {
            rows: self.rows(kind),
            width: self.spec.latent,
            x: normal,
            inverse,
            weight: self.at(&format!("{name}.weight")),
        }
    }

    /// The forward pass of a frame.
    pub(crate) fn forward(&mut self, frame: &Frame) {
        for kind in [0, 1] {
            let mark = self.plan.mark();
            let states = self.states(kind, frame, Keep::Last);
            self.encode(kind, frame, &states);
            self.plan.release(mark);
        }
        for block in 0..self.spec.blocks {
            self.block(block, frame);
        }
        let last = frame.latent[self.spec.blocks];
        self.decode(last[0], frame.output);
    }

    /// The encoder of a kind, with room for its states.
    fn encode(&mut self, kind: Kind, frame: &Frame, states: &States) {
        let (path, out) = (ENCODERS[kind], frame.latent[0][kind]);
        let latent = self.spec.latent;
        let norm = if self.spec.encoder.is_recurrent() {
            let last = self.recurrent(kind, frame, states);
            let (x, out) = (self.latent(last).into(), self.activations[kind].normal);
            let name = format!("{path}.linear");
            self.layer(kind, &name, (x, latent), (out, latent), Epilogue::bias);
            self.norm(kind, &format!("{path}.norm"))
        } else {
            let width = self.width(kind);
            let x = Matrix::new(frame.input[kind], width);
            self.first_layer(kind, path, x.into(), width);
            self.later_layers(kind, path, None);
            self.norm(kind, &format!("{path}.5"))
        };
        self.launches.push(norm.launch(None, out, None));
    }

    /// Both recurrent layers, step by step. Returns the last state of the second.
    fn recurrent(&mut self, kind: Kind, frame: &Frame, states: &States) -> Region {
        let (rows, latent, steps) = (self.rows(kind), self.spec.latent, self.spec.window());
        let path = ENCODERS[kind];
        for step in 0..steps {
            let mut input = Matrix::new(frame.input[kind].part(step, steps), self.width(kind));
            for layer in 0..2 {
                let of = &states.layers[layer];
                let weights = ["weight_ih", "weight_hh", "bias_ih", "bias_hh"]
                    .map(|what| self.at(&format!("{path}.gru.{what}_l{layer}")));
                let gates = Gates {
                    rows,
                    hidden: latent,
                    input,
                    before: step.checked_sub(1).map(|before| of.after[before]),
                    after: of.after[step],
                    kept: of.kept.get(step).copied(),
                    weights,
                };
                self.launches.push(gates.launch());
                input = self.latent(of.after[step]);
                if let (0, Some(dropout)) = (layer, &frame.dropout) {
                    let to = states.between[step];
                    let launch = dropout[kind].launch(latent, step, of.after[step], to, Onto::Set);
                    self.launches.push(launch);
                    input = self.latent(to);
                }
            }
        }
        states.layers[1].after[steps - 1]
    }

    /// A linear layer named `name`, from `x` to `out`, each with its columns.
    fn layer(
        &mut self,
        kind: Kind,
        name: &str,
        (x, inputs): (Pieces, usize),
        (out, outputs): (Region, usize),
        with_bias: fn(u32) -> Epilogue,
    ) {
        let weight = self.matrix(&format!("{name}.weight"), inputs);
        let epilogue = with_bias(self.at(&format!("{name}.bias")));
        let (sizes, out) = (self.sizes(kind, outputs, inputs), Matrix::new(out, outputs));
        self.launches
            .push(linear(sizes, x, weight.into(), out, epilogue));
    }

    /// The first layer of a perceptron.
    fn first_layer(&mut self, kind: Kind, path: &str, x: Pieces, inputs: usize) {
        let out = (self.activations[kind].hidden1, self.spec.latent);
        let name = format!("{path}.0");
        self.layer(kind, &name, (x, inputs), out, Epilogue::bias_relu);
    }

    /// The second and third layer of a perceptron; its output is latent where there is no other.
    fn later_layers(&mut self, kind: Kind, path: &str, output: Option<Region>) {
        let (of, latent) = (self.activations[kind], self.spec.latent);
        self.second_layer(kind, path);
        let x = (self.latent(of.hidden2).into(), latent);
        let out = output.map_or((of.normal, latent), |output| (output, OUTPUTS));
        let name = format!("{path}.4");
        self.layer(kind, &name, x, out, Epilogue::bias);
    }

    fn second_layer(&mut self, kind: Kind, path: &str) {
        let (of, latent) = (self.activations[kind], self.spec.latent);
        let (x, out) = (self.latent(of.hidden1).into(), (of.hidden2, latent));
        let name = format!("{path}.2");
        self.layer(kind, &name, (x, latent), out, Epilogue::bias_relu);
    }

    /// A message-passing block, from the latent rows before it to those after.
    fn block(&mut self, number: usize, frame: &Frame) {
        let (latent, graph) = (self.spec.latent, self.graph);
        let [[nodes, arcs], after] = [frame.latent[number], frame.latent[number + 1]];
        let path = format!("processor.{number}.edge");
        let weight = self.matrix(&format!("{path}.0.weight"), 3 * latent);
        let (ends, incoming) = (self.ends, self.incoming);
        self.launches.push(linear(
            self.sizes(0, 2 * latent, latent),
            self.latent(nodes).into(),
            Pieces::new(weight, latent, weight.columns_from(latent)),
            Matrix::new(ends, 2 * latent),
            Epilogue::SET,
        ));
        let epilogue = Epilogue::ends_relu(
            self.at(&format!("{path}.0.bias")),
            [ends, graph.senders, graph.receivers],
        );
        self.launches.push(linear(
            self.sizes(1, latent, latent),
            self.latent(arcs).into(),
            weight.columns_from(2 * latent).into(),
            self.latent(self.activations[1].hidden1),
            epilogue,
        ));
        self.later_layers(1, &path, None);
        let sums = Messages {
            vertices: graph.vertices,
            first_arc: graph.first_arc,
            incoming,
        };
        let norm = self.norm(1, &format!("{path}.5"));
        self.launches
            .push(norm.launch(Some(arcs), after[1], Some(sums)));
        let path = format!("processor.{number}.node");
        let x = Pieces::new(self.latent(nodes), latent, self.latent(incoming));
        self.first_layer(0, &path, x, 2 * latent);
        self.later_layers(0, &path, None);
        let norm = self.norm(0, &format!("{path}.5"));
        self.launches.push(norm.launch(Some(nodes), after[0], None));
    }

    fn decode(&mut self, nodes: Region, output: Region) {
        let (latent, path) = (self.spec.latent, "decoder");
        self.first_layer(0, path, self.latent(nodes).into(), latent);
        self.later_layers(0, path, Some(output));
    }

    /// The way back through a frame, from the gradient of its output to those of the weights, which
    /// are added to, and where wanted of its features.
    pub(crate) fn backward(&mut self, frame: &Frame, to: &Gradients, to_input: bool) {
        self.decode_backward(frame, to);
        self.clear(1, to.latent[1]);
        for block in (0..self.spec.blocks).rev() {
            self.block(block, frame);
            self.node_backward(block, frame, to);
            self.arc_backward(block, frame, to);
        }
        for kind in [0, 1] {
            if self.spec.encoder.is_recurrent() {
                self.recurrent_backward(kind, frame, to, to_input)
            } else {
                self.encode_backward(kind, frame, to, to_input)
            }
        }
    }

    /// Sets latent rows to zero: they become a product without terms.
    fn clear(&mut self, kind: Kind, rows: Region) {
        let rows = self.latent(rows);
        let sizes = self.sizes(kind, self.spec.latent, 0);
        let launch = linear_to_input(sizes, rows.into(), rows, rows, Epilogue::SET);
        self.launches.push(launch);
    }

    /// Where the gradient of a weight lies.
    fn to_weight(&self, to: &Gradients, name: &str) -> u32 {
        self.at(name) - self.weights.first + to.weights.first
    }

    /// Adds the gradients of a linear layer named `name`, from the gradient of its output and its input,
    /// each with its columns.
    fn linear_weights(
        &mut self,
        kind: Kind,
        name: &str,
        (gradient, outputs): (Region, usize),
        (x, inputs): (Pieces, usize),
        to: &Gradients,
    ) {
        let sums = ToWeights {
            rows: self.rows(kind),
            inputs,
            outputs,
            gradient: Matrix::new(gradient, outputs).into(),
            x,
            weight: Matrix {
                first: self.to_weight(to, &format!("{name}.weight")),
                ld: inputs,
            },
            bias: Some(self.to_weight(to, &format!("{name}.bias"))),
            parts: to.parts,
        };
        self.launches.extend(sums.launches());
    }

    /// The gradient of a product's input, from that of its output with its columns, put where
    /// `to` says.
    fn input_gradient(
        &mut self,
        kind: Kind,
        (gradient, outputs): (Pieces, usize),
        (weight, inputs): (Matrix, usize),
        (out, epilogue): (Matrix, Epilogue),
    ) {
        let sizes = self.sizes(kind, inputs, outputs);
        self.launches
            .push(linear_to_input(sizes, gradient, weight, out, epilogue));
    }

    /// A linear layer backward: the gradients of its weights, then that of its input where it is
    /// wanted.
    fn layer_backward(
        &mut self,
        (kind, name): (Kind, &str),
        (gradient, outputs): (Region, usize),
        (x, inputs): (Pieces, usize),
        to_input: Option<(Matrix, Epilogue)>,
        to: &Gradients,
    ) {
        self.linear_weights(kind, name, (gradient, outputs), (x, inputs), to);
        if let Some(out) = to_input {
            let gradient = Matrix::new(gradient, outputs).into();
            let weight = self.matrix(&format!("{name}.weight"), inputs);
            self.input_gradient(kind, (gradient, outputs), (weight, inputs), out);
        }
    }

    /// From the gradient of the last layer's output, `[rows, outputs]`, to that of the first
    /// layer's before its ReLU, in `to.hidden[1]`. `gradient` may be that array, not the other.
    fn later_layers_backward(
        &mut self,
        kind: Kind,
        path: &str,
        gradient: (Region, usize),
        to: &Gradients,
    ) {
        let (of, latent) = (self.activations[kind], self.spec.latent);
        let [first, second] = to.hidden.map(|room| self.of_rows(kind, room));
        for (layer, gradient, x, out) in [
            ("4", gradient, of.hidden2, first),
            ("2", (first, latent), of.hidden1, second),
        ] {
            let name = format!("{path}.{layer}");
            let out = Some((self.latent(out), Epilogue::mask(x)));
            let x = (self.latent(x).into(), latent);
            self.layer_backward((kind, &name), gradient, x, out, to);
        }
    }

    /// The first numbers of an array, as many as latent rows of a kind have.
    fn of_rows(&self, kind: Kind, room: Region) -> Region {
        let count = self.rows(kind) * self.spec.latent;
        Region { count, ..room }
    }

    fn decode_backward(&mut self, frame: &Frame, to: &Gradients) {
        let latent = self.spec.latent;
        let nodes = frame.latent[self.spec.blocks][0];
        let path = "decoder";
        self.first_layer(0, path, self.latent(nodes).into(), latent);
        self.second_layer(0, path);
        self.later_layers_backward(0, path, (to.output, OUTPUTS), to);
        let gradient = (self.of_rows(0, to.hidden[1]), latent);
        let x = (self.latent(nodes).into(), latent);
        let out = Some((self.latent(to.latent[0]), Epilogue::SET));
        self.layer_backward((0, "decoder.0"), gradient, x, out, to);
    }

    /// The update of vertices: adds to the gradient of their rows, and leaves that of the sums of
    /// messages.
    fn node_backward(&mut self, number: usize, frame: &Frame, to: &Gradients) {
        let (latent, path) = (self.spec.latent, format!("processor.{number}.node"));
        let nodes = frame.latent[number][0];
        self.norm_backward(0, &format!("{path}.5"), to.latent[0], to);
        let gradient = self.of_rows(0, to.hidden[1]);
        self.later_layers_backward(0, &path, (gradient, latent), to);
        let x = Pieces::new(self.latent(nodes), latent, self.latent(self.incoming));
        let name = format!("{path}.0");
        self.linear_weights(0, &name, (gradient, latent), (x, 2 * latent), to);
        let weight = self.matrix(&format!("{name}.weight"), 2 * latent);
        for (weight, out, epilogue) in [
            (weight, to.latent[0], Epilogue::ADD),
            (weight.columns_from(latent), to.incoming, Epilogue::SET),
        ] {
            let gradient = (self.latent(gradient).into(), latent);
            let out = (self.latent(out), epilogue);
            self.input_gradient(0, gradient, (weight, latent), out);
        }
    }

    /// The gradient of a normalisation's rows, in `to.hidden[1]`.
    fn norm_backward(&mut self, kind: Kind, name: &str, gradient: Region, to: &Gradients) {
        let norm = self.norm(kind, name);
        let to_weight = self.to_weight(to, &format!("{name}.weight"));
        let launches = norm.backward(gradient, to.hidden[1], to_weight, to.parts);
        self.launches.extend(launches);
    }

    /// The update of arcs: adds to the gradients of their rows and of those of vertices.
    fn arc_backward(&mut self, number: usize, frame: &Frame, to: &Gradients) {
        let (latent, path) = (self.spec.latent, format!("processor.{number}.edge"));
        let (graph, [nodes, arcs]) = (self.graph, frame.latent[number]);
        let messages = self.of_rows(1, to.hidden[0]);
        self.launches.push(messages_backward(
            to.latent[1],
            latent,
            to.incoming,
            graph.receivers,
            messages,
        ));
        self.norm_backward(1, &format!("{path}.5"), messages, to);
        let gradient = self.of_rows(1, to.hidden[1]);
        self.later_layers_backward(1, &path, (gradient, latent), to);
        let ends = to.ends;
        self.launches.push(sum_ends(
            gradient,
            latent,
            graph.first_arc,
            graph.reverse_arcs,
            ends,
        ));
        let name = format!("{path}.0.weight");
        let weight = self.matrix(&name, 3 * latent);
        let to_weight = Matrix {
            first: self.to_weight(to, &name),
            ld: 3 * latent,
        };
        let to_bias = self.to_weight(to, &format!("{path}.0.bias"));
        // Sender, receiver and the arc itself: the gradient, the input, the gradient of the input.
        let of_ends = Matrix::new(ends, 2 * latent);
        let parts = [
            (0, of_ends, nodes, to.latent[0]),
            (0, of_ends.columns_from(latent), nodes, to.latent[0]),
            (1, self.latent(gradient), arcs, to.latent[1]),
        ];
        for (part, (kind, gradient, x, out)) in parts.into_iter().enumerate() {
            let sums = ToWeights {
                rows: self.rows(kind),
                inputs: latent,
                outputs: latent,
                gradient: gradient.into(),
                x: self.latent(x).into(),
                weight: to_weight.columns_from(part * latent),
                bias: (part == 2).then_some(to_bias),
                parts: to.parts,
            };
            self.launches.extend(sums.launches());
            let weight = weight.columns_from(part * latent);
            let out = (self.latent(out), Epilogue::ADD);
            self.input_gradient(kind, (gradient.into(), latent), (weight, latent), out);
        }
    }

    fn encode_backward(&mut self, kind: Kind, frame: &Frame, to: &Gradients, to_input: bool) {
        let (latent, path, width) = (self.spec.latent, ENCODERS[kind], self.width(kind));
        self.encode(kind, frame, &States::default());
        self.norm_backward(kind, &format!("{path}.5"), to.latent[kind], to);
        let gradient = self.of_rows(kind, to.hidden[1]);
        self.later_layers_backward(kind, path, (gradient, latent), to);
        let x = (Matrix::new(frame.input[kind], width).into(), width);
        let out = (Matrix::new(to.input[kind], width), Epilogue::SET);
        let (name, out) = (format!("{path}.0"), to_input.then_some(out));
        self.layer_backward((kind, &name), (gradient, latent), x, out, to);
    }

    fn recurrent_backward(&mut self, kind: Kind, frame: &Frame, to: &Gradients, to_input: bool) {
        let (latent, path, steps) = (self.spec.latent, ENCODERS[kind], self.spec.window());
        let count = self.rows(kind) * latent;
        let mark = self.plan.mark();
        let states = self.states(kind, frame, Keep::All);
        let by_state = [(); 2].map(|()| self.plan.numbers(count));
        let by_between = self.plan.numbers(count);
        let sums = self.plan.numbers(4 * count);
        self.plan.release(mark);
        self.encode(kind, frame, &states);
        self.norm_backward(kind, &format!("{path}.norm"), to.latent[kind], to);
        let gradient = self.of_rows(kind, to.hidden[1]);
        let name = format!("{path}.linear");
        let x = (
            self.latent(states.layers[1].after[steps - 1]).into(),
            latent,
        );
        let out = Some((self.latent(by_state[1]), Epilogue::SET));
        self.layer_backward((kind, &name), (gradient, latent), x, out, to);
        self.clear(kind, by_state[0]);
        for step in (0..steps).rev() {
            let back = |layer: usize, x, to_x| StepBack {
                kind,
                layer,
                step,
                of: &states.layers[layer],
                by_state: by_state[layer],
                sums,
                x,
                to_x,
            };
            let first = states.layers[0].after[step];
            match &frame.dropout {
                None => {
                    let to_x = (self.latent(by_state[0]), Epilogue::ADD);
                    self.step_backward(back(1, self.latent(first), Some(to_x)), to);
                }
                Some(dropout) => {
                    let to_x = (self.latent(by_between), Epilogue::SET);
                    let x = self.latent(states.between[step]);
                    self.step_backward(back(1, x, Some(to_x)), to);
                    let dropout = dropout[kind];
                    let launch = dropout.launch(latent, step, by_between, by_state[0], Onto::Add);
                    self.launches.push(launch);
                }
            }
            let [x, input] = [frame.input[kind], to.input[kind]]
                .map(|all| Matrix::new(all.part(step, steps), self.width(kind)));
            let to_x = to_input.then_some((input, Epilogue::SET));
            self.step_backward(back(0, x, to_x), to);
        }
    }

    /// One step of a recurrent layer backward: the gradient of the state after it becomes that of
    /// the state before.
    fn step_backward(&mut self, back: StepBack<'_>, to: &Gradients) {
        let StepBack {
            kind,
            layer,
            step,
            of,
            by_state,
            sums,
            x,
            to_x,
        } = back;
        let latent = self.spec.latent;
        let before = step.checked_sub(1).map(|before| of.after[before]);
        let kept = of.kept[step];
        self.launches
            .push(gates_backward(latent, kept, before, by_state, sums));
        let sums = Matrix::new(sums, 4 * latent);
        // The third gate's sums of the input lie before those of the state.
        let of_state = Pieces::new(sums, 2 * latent, sums.columns_from(3 * latent));
        let path = format!("{}.gru", ENCODERS[kind]);
        let state = before.map(|before| self.latent(before));
        for (what, gradient, input) in [("ih", sums.into(), Some(x)), ("hh", of_state, state)] {
            let inputs = input.map_or(0, |input| input.ld);
            let name = format!("{path}.weight_{what}_l{layer}");
            let weights = ToWeights {
                rows: self.rows(kind),
                inputs,
                outputs: 3 * latent,
                gradient,
                x: input.unwrap_or(x).into(),
                weight: Matrix {
                    first: self.to_weight(to, &name),
                    ld: inputs,
                },
                bias: Some(self.to_weight(to, &format!("{path}.bias_{what}_l{layer}"))),
                parts: to.parts,
            };
            self.launches.extend(weights.launches());
            let to_input = match what {
                "ih" => to_x,
                _ => state.map(|_| (self.latent(by_state), Epilogue::ADD)),
            };
            if let Some(out) = to_input {
                let weight = self.matrix(&name, inputs);
                self.input_gradient(kind, (gradient, 3 * latent), (weight, inputs), out);
            }
        }
    }

    /// Room for the states of an encoder of a kind.
    fn states(&mut self, kind: Kind, frame: &Frame, keep: Keep) -> States {
        let steps = if self.spec.encoder.is_recurrent() { self.spec.window() } else { 0 };
        let count = self.rows(kind) * self.spec.latent;
        let mut of_steps = |rooms: usize, size: usize| -> Vec<Region> {
            let rooms = rooms.min(steps);
            let rooms: Vec<Region> = (0..rooms)
                .map(|_| self.plan.numbers(size * count))
                .collect();
            rooms.iter().copied().cycle().take(steps).collect()
        };
        // A state and the one before it are in memory at a time, or all of them.
        let (rooms, kept) = match keep {
            Keep::Last => (2, 0),
            Keep::All => (steps, steps),
        };
        let layers = [(); 2].map(|()| LayerStates {
            after: of_steps(rooms, 1),
            kept: of_steps(kept, 4),
        });
        let between = frame.dropout.map_or(0, |_| rooms);
        let between = of_steps(between, 1);
        States { layers, between }
    }
}

/// The states that are in memory after an encoder.
#[derive(Clone, Copy)]
enum Keep {
    Last,
    All,
}

/// States of a recurrent encoder in each step.
#[derive(Default)]
struct States {
    layers: [LayerStates; 2],
    /// The input of the second layer, where dropout changes the state of the first.
    between: Vec<Region>,
}

#[derive(Default)]
struct LayerStates {
    /// The state after each step.
    after: Vec<Region>,
    /// Gates of each step, where they are kept.
    kept: Vec<Region>,
}

/// One step of a recurrent layer on the way back.
struct StepBack<'a> {
    kind: Kind,
    layer: usize,
    step: usize,
    of: &'a LayerStates,
    /// The gradient of the state after the step.
    by_state: Region,
    /// Room for the gradients of gates.
    sums: Region,
    /// The input.
    x: Matrix,
    /// Where its gradient goes, if it is wanted.
    to_x: Option<(Matrix, Epilogue)>,
}
