//! The backward pass of the encoders, to the features.

use selvedge_model::Gate;

use super::Back;
use super::mlp::NormBack;
use crate::kernels::backward::{GATE_BIASES, GATES_BACKWARD};
use crate::network::arrays::InputArrays;
use crate::network::dropout::drop_out;
use crate::network::linear::Rows;
use crate::network::record::{EncoderRecord, GruRecord, MlpRecord};
use crate::schedule::plan::Region;
use crate::schedule::{Matrix, Onto, args};

/// Layers of a recurrent encoder.
const LAYERS: [usize; 2] = [0, 1];

/// The rows of one encoder, vertices or arcs.
struct Kind {
    number: usize,
    path: &'static str,
    rows: usize,
    width: usize,
    steps: usize,
    input: Region,
    to_input: Option<Region>,
}

impl Kind {
    /// Frame `step` of an array of features.
    fn frame(&self, features: Region, step: usize) -> Rows {
        let size = self.rows * self.width;
        let region = features.part(step * size..(step + 1) * size);
        Rows::new(region, self.width)
    }
}

/// Gradients of a recurrent encoder on its way back.
struct Buffers {
    /// Gradients of the states of both layers, `[rows, latent]` each.
    states: [Region; 2],
    /// Pre-activation gradients of the gates in one step, `[rows, 4 latent]`.
    sums: Region,
    /// Sums of the pre-activation gradients over rows and steps, for both layers, `[4 latent]`
    /// each.
    biases: [Region; 2],
}

/// One step of one layer on its way back.
struct Step<'a> {
    kind: &'a Kind,
    layer: usize,
    number: usize,
    /// The input of the layer.
    input: Rows,
}

impl Back<'_> {
    /// Takes the gradients of the latent rows of vertices and arcs, which are overwritten.
    pub(super) fn encoders(&mut self, gradients: [Region; 2]) {
        let pass = self.pass;
        let spec = pass.network.spec();
        let of_input = |arrays: &InputArrays| [arrays.nodes, arrays.arcs];
        let paths = ["encoder.nodes", "encoder.edges"];
        let rows = [pass.graph.vertices, pass.graph.arcs];
        let widths = [spec.node_width(), spec.edge_width()];
        let records = [&pass.record.node_encoder, &pass.record.arc_encoder];
        for (number, record) in records.into_iter().enumerate() {
            let kind = Kind {
                number,
                path: paths[number],
                rows: rows[number],
                width: widths[number],
                steps: pass.input.steps,
                input: of_input(pass.input)[number],
                to_input: pass.to_input.map(|to| of_input(to)[number]),
            };
            let mark = self.plan.mark();
            match record {
                EncoderRecord::Mlp(record) => self.mlp_encoder(&kind, record, gradients[number]),
                EncoderRecord::Gru(record) => self.gru_encoder(&kind, record, gradients[number]),
            }
            self.plan.release(mark);
        }
    }

    fn mlp_encoder(&mut self, kind: &Kind, record: &MlpRecord, gradient: Region) {
        let (latent, rows) = (self.latent, kind.rows);
        let name = format!("gradient of {}, other", kind.path);
        let other = self.plan.floats(name, rows * latent);
        self.mlp(kind.path, rows, gradient, other, record);
        let name = format!("{}.0.weight", kind.path);
        let (to_weight, weight) = (self.matrix_of(&name), self.pass.weights.matrix(&name));
        let first = Rows::new(gradient, latent);
        self.add_to_weight(rows, first, kind.frame(kind.input, 0), to_weight);
        if let Some(to) = kind.to_input {
            self.through(rows, first, weight, kind.frame(to, 0), Onto::Set);
        }
    }

    fn gru_buffers(&mut self, kind: &Kind) -> Buffers {
        let (latent, path) = (self.latent, kind.path);
        let size = kind.rows * latent;
        Buffers {
            states: LAYERS.map(|layer| {
                let name = format!("gradient of states of {path}, layer {layer}");
                self.plan.floats(name, size)
            }),
            sums: self
                .plan
                .floats(format!("gradient of gates of {path}"), 4 * size),
            biases: LAYERS.map(|layer| {
                let name = format!("gradient of biases of {path}, layer {layer}");
                self.plan.floats(name, 4 * latent)
            }),
        }
    }

    fn gru_encoder(&mut self, kind: &Kind, record: &GruRecord, gradient: Region) {
        let buffers = self.gru_buffers(kind);
        self.gru_output(kind, record, gradient, &buffers);
        for sums in buffers.biases {
            self.schedule.clear(sums);
        }
        // The gradient of the output is not needed any more: its room takes that between the
        // layers.
        let between = gradient;
        for number in (0..kind.steps).rev() {
            self.gru_step(kind, number, between, &buffers, record);
        }
        for layer in LAYERS {
            self.gru_biases(kind.path, layer, buffers.biases[layer]);
        }
    }

    /// From the gradient of the latent rows to that of the last states.
    fn gru_output(&mut self, kind: &Kind, record: &GruRecord, gradient: Region, to: &Buffers) {
        let (latent, rows, path) = (self.latent, kind.rows, kind.path);
        let [first, second] = to.states;
        let norm = NormBack {
            path: &format!("{path}.norm"),
            rows,
            normal: record.normal,
            inverse: record.inverse,
        };
        // `second` is room for other rows until its own gradient is computed below.
        self.norm(&norm, gradient, second);
        let g = Rows::new(gradient, latent);
        let last = Rows::new(record.states[1][kind.steps], latent);
        self.linear(rows, &format!("{path}.linear"), g, last);
        let weight = self.pass.weights.matrix(&format!("{path}.linear.weight"));
        let to = Rows::new(second, latent);
        self.through(rows, g, weight, to, Onto::Set);
        self.schedule.clear(first);
    }

    /// One step of both layers; `between` is room for the gradient of the second layer's input.
    fn gru_step(
        &mut self,
        kind: &Kind,
        number: usize,
        between: Region,
        buffers: &Buffers,
        record: &GruRecord,
    ) {
        let step = |layer, input| Step {
            kind,
            layer,
            number,
            input,
        };
        let seen = Rows::new(record.between[number], self.latent);
        let second = step(1, seen);
        self.layer_step(&second, buffers, record);
        self.gates_through(&second, buffers, Rows::new(between, self.latent));
        if let Some(dropout) = &self.pass.dropout {
            drop_out(self.schedule, dropout, kind.number, number, [between; 2]);
        }
        self.add(buffers.states[0], between);
        let first = step(0, kind.frame(kind.input, number));
        self.layer_step(&first, buffers, record);
        if let Some(to) = kind.to_input {
            self.gates_through(&first, buffers, kind.frame(to, number));
        }
    }

    /// One step of one layer: from the gradient of the state after to that of the state before,
    /// with the pre-activation gradients of the gates.
    fn layer_step(&mut self, step: &Step<'_>, buffers: &Buffers, record: &GruRecord) {
        let (latent, rows, layer) = (self.latent, step.kind.rows, step.layer);
        let (state, before) = (buffers.states[layer], record.states[layer][step.number]);
        let arguments = args! {
            kept: record.kept[layer][step.number],
            before,
            state,
            sums: buffers.sums,
        };
        self.schedule.launch(&GATES_BACKWARD, rows, arguments);
        let gates = Rows::new(buffers.sums, 4 * latent);
        self.add_to_bias(rows, gates, buffers.biases[layer]);
        let name = |suffix| format!("{}.gru.weight_{suffix}_l{layer}", step.kind.path);
        let recurrent = of_recurrent(gates, latent);
        let to = self.matrix_of(&name("hh"));
        self.add_to_weight(rows, recurrent, Rows::new(before, latent), to);
        let weight = self.pass.weights.matrix(&name("hh"));
        let to = Rows::new(state, latent);
        self.through(rows, recurrent, weight, to, Onto::Add);
        let all = self.matrix_of(&name("ih"));
        for (gates, part) in of_input(gates, latent, all) {
            self.add_to_weight(rows, gates, step.input, part);
        }
    }

    /// The gradient of a layer's input, from the pre-activation gradients of the gates.
    fn gates_through(&mut self, step: &Step<'_>, buffers: &Buffers, to: Rows) {
        let name = format!("{}.gru.weight_ih_l{}", step.kind.path, step.layer);
        let weight = self.pass.weights.matrix(&name);
        let gates = Rows::new(buffers.sums, 4 * self.latent);
        let parts = of_input(gates, self.latent, weight);
        for ((gates, part), onto) in parts.into_iter().zip([Onto::Set, Onto::Add]) {
            self.through(step.kind.rows, gates, part, to, onto);
        }
    }

    fn gru_biases(&mut self, path: &str, layer: usize, sums: Region) {
        let [to_input, to_recurrent] = ["ih", "hh"]
            .map(|suffix| self.gradient_of(&format!("{path}.gru.bias_{suffix}_l{layer}")));
        let arguments = args! { sums, to_input, to_recurrent };
        self.schedule
            .launch(&GATE_BIASES, to_input.count(), arguments);
    }
}

/// The pre-activation gradients of `count` gates from `first` on, in the order of
/// [`Gate::GRADIENTS`].
fn part(gates: Rows, latent: usize, first: Gate, count: usize) -> Rows {
    gates.columns(Gate::GRADIENTS.offset(first) * latent, count * latent)
}

/// The pre-activation gradients of the gates that the state enters, in the order of the weights.
fn of_recurrent(gates: Rows, latent: usize) -> Rows {
    part(gates, latent, Gate::Reset, 3)
}

/// The pre-activation gradients of the gates that the input enters, with the rows of a matrix
/// `[3 latent, inputs]` that belong to them: reset and update, then new.
fn of_input(gates: Rows, latent: usize, matrix: Matrix) -> [(Rows, Matrix); 2] {
    let both = |first: Gate, count: usize| {
        let row = Gate::WEIGHTS.offset(first) * latent;
        let rows = Matrix {
            region: matrix
                .region
                .rows(row..row + count * latent, matrix.leading),
            ..matrix
        };
        (part(gates, latent, first, count), rows)
    };
    [both(Gate::Reset, 2), both(Gate::New, 1)]
}
