//! The encoders of vertices and of arcs: normalised features to latent rows. An encoder is a
//! perceptron on the current frame, or a recurrent network of two layers on a window.

use std::ops::Range;

use super::mlp::Normed;
use super::{ForwardPass, Keep, Lower};
use crate::kernels::layers::GATES;
use crate::network::dropout::drop_out;
use crate::network::linear::{Linear, Rows};
use crate::network::record::{EncoderRecord, GruRecord};
use crate::schedule::args;
use crate::schedule::plan::{Plan, Region};

/// The most pre-activations of gates that are in memory at a time: 256 MiB. A larger limit makes
/// fewer and larger products.
const MOST_SUMS: usize = 64 << 20;

/// The rows that one encoder takes, vertices or arcs.
struct Encoded {
    /// 0 for vertices, 1 for arcs.
    kind: usize,
    /// The path of the weights.
    path: &'static str,
    /// Rows of a frame.
    rows: usize,
    /// Columns of the features.
    width: usize,
    /// Frames.
    steps: usize,
    /// Features, `[steps, rows, width]`.
    input: Region,
    /// Latent rows, `[rows, latent]`.
    out: Region,
}

impl Encoded {
    /// The features of frames `steps`, one after the other.
    fn frames(&self, steps: Range<usize>) -> Rows {
        Rows::new(self.input.rows(steps, self.rows * self.width), self.width)
    }

    /// The number of steps that pass a layer at a time, with one product of their inputs.
    fn group(&self, latent: usize) -> usize {
        (MOST_SUMS / (self.rows * 3 * latent).max(1)).clamp(1, self.steps)
    }
}

/// Some steps of one layer of a recurrent network.
struct LayerSteps<'a> {
    of: &'a Encoded,
    layer: usize,
    steps: Range<usize>,
    /// The inputs of all steps, one after the other.
    input: Rows,
}

/// Room for the pre-activations of gates.
#[derive(Clone, Copy)]
struct GateSums {
    /// Products of the inputs of a group of steps, `[group, rows, 3 latent]`.
    input: Region,
    /// The product of the state of one step, `[rows, 3 latent]`.
    recurrent: Region,
}

impl Lower<'_> {
    /// Adds the encoding of features to the latent rows `out` of vertices and arcs.
    pub(super) fn encode(
        &mut self,
        pass: &ForwardPass<'_>,
        out: [Region; 2],
    ) -> [EncoderRecord; 2] {
        let (spec, graph, input) = (pass.network.spec(), pass.graph, pass.input);
        let paths = ["encoder.nodes", "encoder.edges"];
        let rows = [graph.vertices, graph.arcs];
        let widths = [spec.node_width(), spec.edge_width()];
        let features = [input.nodes, input.arcs];
        [0, 1].map(|kind| {
            let of = Encoded {
                kind,
                path: paths[kind],
                rows: rows[kind],
                width: widths[kind],
                steps: input.steps,
                input: features[kind],
                out: out[kind],
            };
            let mark = self.plan.mark();
            let record = match spec.encoder.is_recurrent() {
                false => self.encode_mlp(&of),
                true => EncoderRecord::Gru(self.encode_gru(&of)),
            };
            if !self.keeps() {
                self.plan.release(mark);
            }
            record
        })
    }

    fn encode_mlp(&mut self, of: &Encoded) -> EncoderRecord {
        let (latent, path) = (self.latent, of.path);
        let record = self.mlp_record(path, of.rows);
        let weight = self.weights.matrix(&format!("{path}.0.weight"));
        let out = Rows::new(record.hidden1, latent);
        let layer = Linear::new(of.rows, of.frames(0..1), weight, out);
        let epilogue = self.first_epilogue(path);
        self.linear(layer.then(epilogue));
        self.mlp_rest(path, of.rows, &record);
        self.mlp_norm(path, of.rows, &record, None, of.out);
        EncoderRecord::Mlp(record)
    }

    fn encode_gru(&mut self, of: &Encoded) -> GruRecord {
        let (latent, path) = (self.latent, of.path);
        let group = of.group(latent);
        let record = self.gru_record(of, group);
        let mark = self.plan.mark();
        let [input, recurrent] = [("input", group), ("recurrent", 1)].map(|(what, steps)| {
            let name = format!("{path}, sums of the {what}");
            self.plan.floats(name, steps * of.rows * 3 * latent)
        });
        let sums = GateSums { input, recurrent };
        if self.keeps() {
            for states in &record.states {
                self.schedule.clear(states[0]);
            }
        }
        for first in (0..of.steps).step_by(group) {
            let steps = first..of.steps.min(first + group);
            self.gru_group(of, steps, sums, &record);
        }
        self.plan.release(mark);
        self.gru_output(of, &record);
        record
    }

    /// A group of steps through both layers.
    fn gru_group(&mut self, of: &Encoded, steps: Range<usize>, sums: GateSums, record: &GruRecord) {
        let first = LayerSteps {
            of,
            layer: 0,
            steps: steps.clone(),
            input: of.frames(steps.clone()),
        };
        self.gru_steps(&first, sums, record);
        for step in steps.clone() {
            self.drop_out(of, step, record);
        }
        let seen = record.between[steps.start].up_to(record.between[steps.end - 1]);
        let second = LayerSteps {
            of,
            layer: 1,
            steps,
            input: Rows::new(seen, self.latent),
        };
        self.gru_steps(&second, sums, record);
    }

    /// From the last state of the second layer to the latent rows.
    fn gru_output(&mut self, of: &Encoded, record: &GruRecord) {
        let (latent, path) = (self.latent, of.path);
        let weight = self.weights.matrix(&format!("{path}.linear.weight"));
        let x = Rows::new(record.states[1][of.steps], latent);
        let out = Rows::new(record.normal, latent);
        self.linear(Linear::new(of.rows, x, weight, out));
        let normed = Normed {
            rows: of.rows,
            x: record.normal,
            inverse: record.inverse,
            bias: format!("{path}.linear.bias"),
            norm: &format!("{path}.norm"),
        };
        self.norm(&normed, None, of.out);
    }

    fn gru_steps(&mut self, of: &LayerSteps<'_>, sums: GateSums, record: &GruRecord) {
        let (latent, rows, layer) = (self.latent, of.of.rows, of.layer);
        let path = format!("{}.gru", of.of.path);
        let get = |what: &str| self.weights.matrix(&format!("{path}.{what}_l{layer}"));
        let [of_x, of_state] = ["weight_ih", "weight_hh"].map(get);
        let [bias_input, bias_recurrent] = ["bias_ih", "bias_hh"].map(|b| get(b).region);
        let width = 3 * latent;
        let out = Rows::new(sums.input, width);
        self.linear(Linear::new(of.steps.len() * rows, of.input, of_x, out));
        let states = &record.states[layer];
        for (number, step) in of.steps.clone().enumerate() {
            // The state that a window begins with is zero.
            let before = (step > 0).then_some(states[step]);
            if let Some(before) = before {
                let (x, out) = (Rows::new(before, latent), Rows::new(sums.recurrent, width));
                self.linear(Linear::new(rows, x, of_state, out));
            }
            let arguments = args! {
                input: sums.input.rows(number..number + 1, rows * width),
                recurrent: before.map(|_| sums.recurrent),
                bias_input,
                bias_recurrent,
                before,
                after: states[step + 1],
                kept: record.kept[layer].get(step).copied(),
            };
            self.schedule.launch(&GATES, rows, arguments);
        }
    }

    /// The inputs of the second layer in a step, where dropout changes the state of the first.
    fn drop_out(&mut self, of: &Encoded, step: usize, record: &GruRecord) {
        if let Keep::Activations(Some(dropout)) = &self.keep {
            let both = [record.states[0][step + 1], record.between[step]];
            drop_out(self.schedule, dropout, of.kind, step, both);
        }
    }

    fn gru_record(&mut self, of: &Encoded, group: usize) -> GruRecord {
        let (latent, steps, path) = (self.latent, of.steps, of.path);
        let size = of.rows * latent;
        let keeps = self.keeps();
        let states = [0, 1].map(|layer| self.states(of, layer, group));
        let frames = |plan: &mut Plan, name: &str, width: usize| -> Vec<Region> {
            let all = plan.floats(format!("{path}, {name}"), steps * width * size);
            (0..steps)
                .map(|step| all.rows(step..step + 1, width * size))
                .collect()
        };
        let kept = [0, 1].map(|_| {
            if keeps {
                frames(self.plan, "gates", 4)
            } else {
                Vec::new()
            }
        });
        let between = match self.keep {
            Keep::Activations(Some(_)) => frames(self.plan, "between the layers", 1),
            _ => states[0][1..].to_vec(),
        };
        GruRecord {
            states,
            kept,
            between,
            normal: self.plan.floats(format!("{path}, normalised"), size),
            inverse: keeps.then(|| self.plan.floats(format!("{path}, 1 / deviation"), of.rows)),
        }
    }

    /// The states of a layer before and after each step. All of them have room of their own where
    /// activations are kept; otherwise the states of a group of steps, which lie side by side, are
    /// overwritten by the next group.
    fn states(&mut self, of: &Encoded, layer: usize, group: usize) -> Vec<Region> {
        let (size, steps) = (of.rows * self.latent, of.steps);
        let count = if self.keeps() { steps + 1 } else { group };
        let name = format!("{}, states of layer {layer}", of.path);
        let all = self.plan.floats(name, count * size);
        let state = |step: usize| {
            let slot = if self.keeps() {
                step
            } else {
                (step + group - 1) % group
            };
            all.rows(slot..slot + 1, size)
        };
        (0..=steps).map(state).collect()
    }
}
