//! The encoders of vertices and of arcs: normalised features of a window to latent rows, by a
//! perceptron on the frames side by side, or by a recurrent network of two layers.

use std::ops::Range;

use selvedge_model::{Encoder, ModelSpec};

use super::dropout::drop_out;
use super::record::{EncoderRecord, GruRecord};
use super::{ForwardPass, Keep, Lower, StateArrays};
use crate::kernels::layers::GATES;
use crate::schedule::plan::Region;
use crate::schedule::{Finish, Matrix, Onto};

/// Most sums of gates that steps may have at a time: 256 MiB. More of them make fewer and larger products.
const MOST_SUMS: usize = 64 << 20;

/// How rows of one kind are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowEncoder {
    /// A perceptron on the frames of the window side by side.
    Mlp,
    /// A recurrent network.
    Gru,
}

/// How the vertices and the arcs of a spec are encoded.
#[must_use]
pub fn row_encoders(spec: &ModelSpec) -> [RowEncoder; 2] {
    match spec.encoder {
        Encoder::Mlp { .. } => [RowEncoder::Mlp; 2],
        Encoder::Gru { .. } | Encoder::StreamingGru { .. } => [RowEncoder::Gru; 2],
        Encoder::NodeGru { .. } => [RowEncoder::Gru, RowEncoder::Mlp],
    }
}

/// One of the encoders.
struct Rows<'a> {
    kind: usize,
    path: &'static str,
    rows: usize,
    width: usize,
    steps: usize,
    input: Region,
    out: Region,
    start: Option<&'a [Region; 2]>,
    end: Option<&'a [Region; 2]>,
}

impl Rows<'_> {
    /// The features of frames `steps`, one after the other.
    fn frames(&self, steps: Range<usize>) -> Matrix {
        Matrix::new(self.input.rows(steps, self.rows * self.width), self.width)
    }

    /// How many steps go through a layer at a time: their products with the input are one.
    fn group(&self, latent: usize) -> usize {
        (MOST_SUMS / (self.rows * 3 * latent).max(1)).clamp(1, self.steps)
    }
}

impl Lower<'_> {
    /// Features to the latent rows `out` of vertices and arcs.
    pub(super) fn encode(
        &mut self,
        pass: &ForwardPass<'_>,
        out: [Region; 2],
    ) -> [EncoderRecord; 2] {
        let (spec, graph, input) = (pass.network.spec(), pass.graph, pass.input);
        let both = [
            (
                "encoder.nodes",
                graph.vertices,
                spec.node_width(),
                input.nodes,
            ),
            ("encoder.edges", graph.arcs, spec.edge_width(), input.edges),
        ];
        let states = |of: Option<&StateArrays>, kind: usize| {
            of.map(|s| if kind == 0 { s.nodes } else { s.edges })
        };
        [0, 1].map(|kind| {
            let (path, rows, width, features) = both[kind];
            let (start, end) = (states(pass.start, kind), states(pass.end, kind));
            let rows = Rows {
                kind,
                path,
                rows,
                width,
                steps: input.steps[kind],
                input: features,
                out: out[kind],
                start: start.as_ref(),
                end: end.as_ref(),
            };
            let mark = self.plan.mark();
            let record = match row_encoders(spec)[kind] {
                RowEncoder::Mlp => self.encode_mlp(&rows),
                RowEncoder::Gru => EncoderRecord::Gru(self.encode_gru(&rows)),
            };
            if !self.keeps() {
                self.plan.release(mark);
            }
            record
        })
    }

    fn encode_mlp(&mut self, rows: &Rows<'_>) -> EncoderRecord {
        let (latent, path) = (self.latent, rows.path);
        let record = self.mlp_record(path, rows.rows);
        let weight = self.weights.matrix(&format!("{path}.0.weight"));
        let out = Matrix::new(record.hidden1, latent);
        for step in 0..rows.steps {
            let last = step + 1 == rows.steps;
            let finish = if last {
                self.first_finish(path)
            } else {
                Finish::Nothing
            };
            let onto = if step == 0 { Onto::Set } else { Onto::Add };
            let pair = (
                rows.frames(step..step + 1),
                weight.from_column(step * rows.width),
            );
            self.linear([rows.rows, rows.width, latent], pair, out, onto, finish);
        }
        self.mlp_rest(path, rows.rows, &record);
        self.mlp_norm(path, rows.rows, &record, (None, rows.out));
        EncoderRecord::Mlp(record)
    }

    fn encode_gru(&mut self, rows: &Rows<'_>) -> GruRecord {
        let (latent, path) = (self.latent, rows.path);
        let group = rows.group(latent);
        let record = self.gru_record(rows, group);
        let mark = self.plan.mark();
        let sums = [("input", group), ("recurrent", 1)].map(|(what, steps)| {
            let name = format!("{path}, sums of the {what}");
            self.plan.floats(name, steps * rows.rows * 3 * latent)
        });
        if rows.start.is_none() && self.keeps() {
            for states in &record.states {
                self.schedule.clear(states[0]);
            }
        }
        for first in (0..rows.steps).step_by(group) {
            let steps = first..rows.steps.min(first + group);
            let x = rows.frames(steps.clone());
            self.gru_steps((rows, 0, steps.clone()), x, sums, &record);
            for step in steps.clone() {
                self.drop_out(rows, step, &record);
            }
            let seen = record.between[first].up_to(record.between[steps.end - 1]);
            let x = Matrix::new(seen, latent);
            self.gru_steps((rows, 1, steps), x, sums, &record);
        }
        if let Some(end) = rows.end.filter(|_| rows.steps > 1) {
            for (states, &end) in record.states.iter().zip(end) {
                self.schedule.copy(states[rows.steps], end);
            }
        }
        self.plan.release(mark);
        let weight = self.weights.matrix(&format!("{path}.linear.weight"));
        let pair = (Matrix::new(record.states[1][rows.steps], latent), weight);
        let (out, size) = (
            Matrix::new(record.normal, latent),
            [rows.rows, latent, latent],
        );
        self.linear(size, pair, out, Onto::Set, Finish::Nothing);
        let names = [format!("{path}.linear.bias"), format!("{path}.norm")];
        let x = (record.normal, record.inverse);
        self.norm(rows.rows, x, names, (None, rows.out));
        record
    }

    /// Some steps of one layer; `input` is that of all of them, one after the other.
    fn gru_steps(
        &mut self,
        (rows, layer, steps): (&Rows<'_>, usize, Range<usize>),
        input: Matrix,
        [of_input, recurrent]: [Region; 2],
        record: &GruRecord,
    ) {
        let (latent, path) = (self.latent, format!("{}.gru", rows.path));
        let get = |what: &str| self.weights.matrix(&format!("{path}.{what}_l{layer}"));
        let [of_x, of_state] = ["weight_ih", "weight_hh"].map(get);
        let [bias_input, bias_recurrent] = ["bias_ih", "bias_hh"].map(|b| get(b).region);
        let inputs = if layer == 0 { rows.width } else { latent };
        let (size, sums) = ([steps.len() * rows.rows, inputs, 3 * latent], 3 * latent);
        let out = Matrix::new(of_input, sums);
        self.linear(size, (input, of_x), out, Onto::Set, Finish::Nothing);
        let states = &record.states[layer];
        for (number, step) in steps.enumerate() {
            // The state that a window begins with is zero.
            let before = (step > 0 || rows.start.is_some()).then_some(states[step]);
            if let Some(before) = before {
                let (pair, size) = (
                    (Matrix::new(before, latent), of_state),
                    [rows.rows, latent, sums],
                );
                let out = Matrix::new(recurrent, sums);
                self.linear(size, pair, out, Onto::Set, Finish::Nothing);
            }
            let of_input = of_input.rows(number..number + 1, rows.rows * sums);
            self.schedule.launch(
                &GATES,
                rows.rows,
                &[
                    of_input.into(),
                    before.map(|_| recurrent).into(),
                    bias_input.into(),
                    bias_recurrent.into(),
                    before.into(),
                    states[step + 1].into(),
                    record.kept[layer].get(step).copied().into(),
                ],
            );
        }
    }

    /// What the second layer sees of the first one's state after a step, where that differs.
    fn drop_out(&mut self, rows: &Rows<'_>, step: usize, record: &GruRecord) {
        if let Keep::Activations(Some(dropout)) = &self.keep {
            let both = [record.states[0][step + 1], record.between[step]];
            drop_out(self.schedule, dropout, (rows.kind, step), both);
        }
    }

    fn gru_record(&mut self, rows: &Rows<'_>, group: usize) -> GruRecord {
        let (latent, steps, path) = (self.latent, rows.steps, rows.path);
        let size = rows.rows * latent;
        let keeps = self.keeps();
        let states = [0, 1].map(|layer| self.states(rows, layer, group));
        let frames =
            |plan: &mut crate::schedule::plan::Plan, name: &str, width: usize| -> Vec<Region> {
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
            inverse: keeps.then(|| {
                self.plan
                    .floats(format!("{path}, 1 / deviation"), rows.rows)
            }),
        }
    }

    /// Room for the states of a layer: all of them where activations are kept, else those of a group of
    /// steps, which the next group writes over. The states of a group lie side by side. The first one is
    /// that carried, where there is such; so is the last of a single step.
    fn states(&mut self, rows: &Rows<'_>, layer: usize, group: usize) -> Vec<Region> {
        let (size, steps) = (rows.rows * self.latent, rows.steps);
        let count = if self.keeps() { steps + 1 } else { group };
        let name = format!("{}, states of layer {layer}", rows.path);
        let all = self.plan.floats(name, count * size);
        let state = |step: usize| {
            let slot = if self.keeps() {
                step
            } else {
                (step + group - 1) % group
            };
            all.rows(slot..slot + 1, size)
        };
        let mut states: Vec<Region> = (0..=steps).map(state).collect();
        if let Some(start) = rows.start {
            states[0] = start[layer];
        }
        if let Some(end) = rows.end.filter(|_| steps == 1) {
            states[steps] = end[layer];
        }
        states
    }
}
