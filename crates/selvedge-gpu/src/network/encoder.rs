//! The encoders of vertices and of arcs: normalised features of a window to latent rows, by a
//! perceptron on the frames side by side, or by a recurrent network of two layers.

use selvedge_model::{Encoder, ModelSpec};

use super::dropout::drop_out;
use super::record::{EncoderRecord, GruRecord};
use super::{ForwardPass, Keep, Lower, StateArrays};
use crate::layers::GATES;
use crate::plan::Region;
use crate::schedule::{Finish, Matrix, Onto};

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
    /// The features of frame `step`.
    fn frame(&self, step: usize) -> Matrix {
        let size = self.rows * self.width;
        let region = self.input.part(step * size..(step + 1) * size);
        Matrix::new(region, self.width)
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
            let pair = (rows.frame(step), weight.from_column(step * rows.width));
            self.linear([rows.rows, rows.width, latent], pair, out, onto, finish);
        }
        self.mlp_rest(path, rows.rows, &record);
        self.mlp_norm(path, rows.rows, &record, (None, rows.out));
        EncoderRecord::Mlp(record)
    }

    fn encode_gru(&mut self, rows: &Rows<'_>) -> GruRecord {
        let (latent, path) = (self.latent, rows.path);
        let record = self.gru_record(rows);
        let mark = self.plan.mark();
        let sums = ["input", "recurrent"].map(|what| {
            let name = format!("{path}, sums of the {what}");
            self.plan.floats(name, rows.rows * 3 * latent)
        });
        if rows.start.is_none() {
            for states in &record.states {
                self.schedule.clear(states[0]);
            }
        }
        for step in 0..rows.steps {
            self.gru_step((rows, 0, step), rows.frame(step), sums, &record);
            self.drop_out(rows, step, &record);
            let seen = Matrix::new(record.between[step], latent);
            self.gru_step((rows, 1, step), seen, sums, &record);
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

    /// One step of one layer.
    fn gru_step(
        &mut self,
        (rows, layer, step): (&Rows<'_>, usize, usize),
        input: Matrix,
        sums: [Region; 2],
        record: &GruRecord,
    ) {
        let (latent, path) = (self.latent, format!("{}.gru", rows.path));
        let inputs = if layer == 0 { rows.width } else { latent };
        let states = &record.states[layer];
        let before = Matrix::new(states[step], latent);
        let operands = [("ih", input, inputs), ("hh", before, latent)];
        for ((suffix, x, inputs), sums) in operands.into_iter().zip(sums) {
            let weight = self
                .weights
                .matrix(&format!("{path}.weight_{suffix}_l{layer}"));
            let (size, out) = (
                [rows.rows, inputs, 3 * latent],
                Matrix::new(sums, 3 * latent),
            );
            self.linear(size, (x, weight), out, Onto::Set, Finish::Nothing);
        }
        let [bias_input, bias_recurrent] =
            ["ih", "hh"].map(|suffix| self.weights.get(&format!("{path}.bias_{suffix}_l{layer}")));
        self.schedule.launch(
            &GATES,
            rows.rows,
            &[
                sums[0].into(),
                sums[1].into(),
                bias_input.into(),
                bias_recurrent.into(),
                states[step].into(),
                states[step + 1].into(),
                record.kept[layer].get(step).copied().into(),
            ],
        );
    }

    /// What the second layer sees of the first one's state after a step, where that differs.
    fn drop_out(&mut self, rows: &Rows<'_>, step: usize, record: &GruRecord) {
        if let Keep::Activations(Some(dropout)) = &self.keep {
            let both = [record.states[0][step + 1], record.between[step]];
            drop_out(self.schedule, dropout, (rows.kind, step), both);
        }
    }

    fn gru_record(&mut self, rows: &Rows<'_>) -> GruRecord {
        let (latent, steps, path) = (self.latent, rows.steps, rows.path);
        let size = rows.rows * latent;
        let keeps = self.keeps();
        let states = [0, 1].map(|layer| self.states(rows, layer));
        let frames = |plan: &mut crate::plan::Plan, name: &str, width: usize| -> Vec<Region> {
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

    /// Room for the states of a layer: all of them where activations are kept, else two in turns. The
    /// first and the last are those carried, where there are such.
    fn states(&mut self, rows: &Rows<'_>, layer: usize) -> Vec<Region> {
        let (size, steps) = (rows.rows * self.latent, rows.steps);
        let count = if self.keeps() {
            steps + 1
        } else {
            2.min(steps + 1)
        };
        let name = format!("{}, states of layer {layer}", rows.path);
        let all = self.plan.floats(name, count * size);
        let state = |step: usize| all.rows(step % count..step % count + 1, size);
        let mut states: Vec<Region> = (0..=steps).map(state).collect();
        if let Some(start) = rows.start {
            states[0] = start[layer];
        }
        if let Some(end) = rows.end {
            states[steps] = end[layer];
        }
        states
    }
}
