//! The way back through the encoders, to the features and to the states that they went on from.

use super::{Back, Rows};
use crate::kernels::backward::{GATE_BIASES, GATES_BACKWARD};
use crate::network::{EncoderRecord, GruRecord, InputArrays, MlpRecord, StateArrays, drop_out};
use crate::schedule::plan::Region;
use crate::schedule::{Matrix, Onto};

/// Layers of a recurrent encoder.
const LAYERS: [usize; 2] = [0, 1];

/// One of the encoders.
struct Kind {
    number: usize,
    path: &'static str,
    rows: usize,
    width: usize,
    steps: usize,
    input: Region,
    to_input: Option<Region>,
    end: Option<[Region; 2]>,
    start: Option<[Region; 2]>,
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
    /// Of the states of both layers, `[rows, latent]`.
    states: [Region; 2],
    /// Of the gates' sums, `[rows, 4 latent]`.
    sums: Region,
    /// The sums of those of both layers over rows and steps, `[4 latent]`.
    biases: [Region; 2],
}

impl Back<'_> {
    /// From the gradients of the latent rows of vertices and arcs, which are overwritten.
    pub(super) fn encoders(&mut self, gradients: [Region; 2]) {
        let pass = self.pass;
        let spec = pass.network.spec();
        let of_input = |arrays: &InputArrays| [arrays.nodes, arrays.edges];
        let of_states = |arrays: &StateArrays| [arrays.nodes, arrays.edges];
        let paths = ["encoder.nodes", "encoder.edges"];
        let rows = [pass.graph.vertices, pass.graph.arcs];
        let widths = [spec.node_width(), spec.edge_width()];
        let records = [&pass.record.node_encoder, &pass.record.edge_encoder];
        for (number, record) in records.into_iter().enumerate() {
            let kind = Kind {
                number,
                path: paths[number],
                rows: rows[number],
                width: widths[number],
                steps: pass.input.steps[number],
                input: of_input(pass.input)[number],
                to_input: pass.to_input.map(|to| of_input(to)[number]),
                end: pass.end.map(|states| of_states(states)[number]),
                start: pass.start.map(|states| of_states(states)[number]),
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
        self.mlp(kind.path, rows, [gradient, other], record);
        let name = format!("{}.0.weight", kind.path);
        let (to_weight, weight) = (self.matrix_of(&name), self.pass.weights.matrix(&name));
        let first = Rows::new(gradient, latent);
        for step in 0..kind.steps {
            let (x, column) = (kind.frame(kind.input, step), step * kind.width);
            self.add_to_weight(rows, first, x, to_weight.from_column(column));
            if let Some(to) = kind.to_input {
                let to = (kind.frame(to, step), Onto::Set);
                self.through(rows, first, weight.from_column(column), to);
            }
        }
    }

    fn gru_encoder(&mut self, kind: &Kind, record: &GruRecord, gradient: Region) {
        let (latent, rows, path) = (self.latent, kind.rows, kind.path);
        let size = rows * latent;
        let buffers = Buffers {
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
        };
        self.gru_output(kind, record, gradient, &buffers);
        for sums in buffers.biases {
            self.schedule.clear(sums);
        }
        // The rows of the output are done with.
        let between = gradient;
        for step in (0..kind.steps).rev() {
            let seen = Rows::new(record.between[step], latent);
            self.gru_step((kind, 1, step), seen, &buffers, record);
            self.gates_through((path, 1), rows, &buffers, Rows::new(between, latent));
            if let Some(dropout) = &self.pass.dropout {
                drop_out(self.schedule, dropout, (kind.number, step), [between; 2]);
            }
            self.add(buffers.states[0], between);
            self.gru_step(
                (kind, 0, step),
                kind.frame(kind.input, step),
                &buffers,
                record,
            );
            if let Some(to) = kind.to_input {
                self.gates_through((path, 0), rows, &buffers, kind.frame(to, step));
            }
        }
        for layer in LAYERS {
            self.gru_biases(path, layer, buffers.biases[layer]);
            if let Some(start) = kind.start {
                self.schedule.copy(buffers.states[layer], start[layer]);
            }
        }
    }

    /// From the gradient of the latent rows to those of the last states.
    fn gru_output(&mut self, kind: &Kind, record: &GruRecord, gradient: Region, to: &Buffers) {
        let (latent, rows, path) = (self.latent, kind.rows, kind.path);
        let [first, second] = to.states;
        // The second state's gradient comes into it only afterwards.
        let norm = (record.normal, record.inverse);
        self.norm(&format!("{path}.norm"), rows, [gradient, second], norm);
        let g = Rows::new(gradient, latent);
        let last = Rows::new(record.states[1][kind.steps], latent);
        self.linear(rows, &format!("{path}.linear"), g, last);
        let weight = self.pass.weights.matrix(&format!("{path}.linear.weight"));
        let to = (Rows::new(second, latent), Onto::Set);
        self.through(rows, g, weight, to);
        match kind.end {
            Some(end) => {
                self.schedule.copy(end[0], first);
                self.add(second, end[1]);
            }
            None => self.schedule.clear(first),
        }
    }

    /// One step of one layer: from the gradient of the state after to that of the state before, leaving
    /// those of the gates' sums.
    fn gru_step(
        &mut self,
        (kind, layer, step): (&Kind, usize, usize),
        input: Rows,
        buffers: &Buffers,
        record: &GruRecord,
    ) {
        let (latent, rows) = (self.latent, kind.rows);
        let (state, before) = (buffers.states[layer], record.states[layer][step]);
        self.schedule.launch(
            &GATES_BACKWARD,
            rows,
            &[
                record.kept[layer][step].into(),
                before.into(),
                state.into(),
                buffers.sums.into(),
            ],
        );
        let gates = Rows::new(buffers.sums, 4 * latent);
        self.add_to_bias(rows, gates, buffers.biases[layer]);
        let name = |suffix| format!("{}.gru.weight_{suffix}_l{layer}", kind.path);
        let recurrent = gates.columns(latent, 3 * latent);
        let to = self.matrix_of(&name("hh"));
        self.add_to_weight(rows, recurrent, Rows::new(before, latent), to);
        let weight = self.pass.weights.matrix(&name("hh"));
        let to = (Rows::new(state, latent), Onto::Add);
        self.through(rows, recurrent, weight, to);
        let all = self.matrix_of(&name("ih"));
        for (gates, part) in of_input(gates, latent, all) {
            self.add_to_weight(rows, gates, input, part);
        }
    }

    /// The gradient of a layer's input from those of the gates' sums.
    fn gates_through(
        &mut self,
        (path, layer): (&str, usize),
        rows: usize,
        buffers: &Buffers,
        to: Rows,
    ) {
        let name = format!("{path}.gru.weight_ih_l{layer}");
        let weight = self.pass.weights.matrix(&name);
        let gates = Rows::new(buffers.sums, 4 * self.latent);
        let parts = of_input(gates, self.latent, weight);
        for ((gates, part), onto) in parts.into_iter().zip([Onto::Set, Onto::Add]) {
            self.through(rows, gates, part, (to, onto));
        }
    }

    fn gru_biases(&mut self, path: &str, layer: usize, sums: Region) {
        let [to_input, to_recurrent] = ["ih", "hh"]
            .map(|suffix| self.gradient_of(&format!("{path}.gru.bias_{suffix}_l{layer}")));
        let arguments = [sums.into(), to_input.into(), to_recurrent.into()];
        self.schedule
            .launch(&GATE_BIASES, to_input.count(), &arguments);
    }
}

/// The parts of the gates' sums that the input goes into, with the rows of a matrix `[3 latent, inputs]`
/// that belong to them: r and z, then n.
fn of_input(gates: Rows, latent: usize, matrix: Matrix) -> [(Rows, Matrix); 2] {
    let rows = |range: std::ops::Range<usize>| Matrix {
        region: matrix.region.rows(range, matrix.leading),
        ..matrix
    };
    [
        (gates.columns(latent, 2 * latent), rows(0..2 * latent)),
        (gates.columns(0, latent), rows(2 * latent..3 * latent)),
    ]
}
