//! Perceptrons: Linear, ReLU, Linear, ReLU, Linear, LayerNorm; a decoder is one without the last.

use super::Lower;
use crate::kernels::layers::NORM;
use crate::network::linear::{Linear, Rows};
use crate::network::record::MlpRecord;
use crate::schedule::plan::Region;
use crate::schedule::{Epilogue, args};

/// Rows to normalise, with the names of the parameters.
pub(super) struct Normed<'a> {
    /// The number of rows.
    pub(super) rows: usize,
    /// The rows without their bias, and room for the normalised ones where these are kept.
    pub(super) x: Region,
    /// Room for 1 / deviation, where it is kept.
    pub(super) inverse: Option<Region>,
    /// The name of the bias of `x`.
    pub(super) bias: String,
    /// The path of weight and shift.
    pub(super) norm: &'a str,
}

impl Lower<'_> {
    /// Room for the activations of a perceptron of `rows` rows.
    pub(super) fn mlp_record(&mut self, name: &str, rows: usize) -> MlpRecord {
        let size = rows * self.latent;
        let [hidden1, hidden2] =
            [1, 2].map(|layer| self.plan.floats(format!("{name}, hidden {layer}"), size));
        let keeps = self.keeps();
        // Where nothing is kept the output takes the place of the first hidden layer.
        let normal = if keeps {
            self.plan.floats(format!("{name}, normalised"), size)
        } else {
            hidden1
        };
        MlpRecord {
            hidden1,
            hidden2,
            normal: Some(normal),
            inverse: keeps.then(|| self.plan.floats(format!("{name}, 1 / deviation"), rows)),
        }
    }

    /// Bias and ReLU of a perceptron's first layer.
    pub(super) fn first_epilogue(&self, path: &str) -> Epilogue {
        Epilogue::BiasRelu(self.weights.get(&format!("{path}.0.bias")))
    }

    /// From the first hidden layer to the output without its bias, in the room for the normalised
    /// one.
    pub(super) fn mlp_rest(&mut self, path: &str, rows: usize, record: &MlpRecord) {
        self.second_layer(path, rows, record);
        let weight = self.weights.matrix(&format!("{path}.4.weight"));
        let x = Rows::new(record.hidden2, self.latent);
        let out = Rows::new(record.normal.unwrap_or(record.hidden1), self.latent);
        self.linear(Linear::new(rows, x, weight, out));
    }

    fn second_layer(&mut self, path: &str, rows: usize, record: &MlpRecord) {
        let epilogue = Epilogue::BiasRelu(self.weights.get(&format!("{path}.2.bias")));
        let weight = self.weights.matrix(&format!("{path}.2.weight"));
        let x = Rows::new(record.hidden1, self.latent);
        let out = Rows::new(record.hidden2, self.latent);
        self.linear(Linear::new(rows, x, weight, out).then(epilogue));
    }

    /// Layer normalisation of rows, added to `before` where that is given.
    pub(super) fn norm(&mut self, of: &Normed<'_>, before: Option<Region>, after: Region) {
        let get = |part: &str| self.weights.get(&format!("{}.{part}", of.norm));
        let arguments = args! {
            x: of.x,
            bias: self.weights.get(&of.bias),
            weight: get("weight"),
            shift: get("bias"),
            before,
            after,
            normal: of.inverse.map(|_| of.x),
            inverse: of.inverse,
        };
        self.schedule.launch(&NORM, of.rows, arguments);
    }

    /// The normalisation at the end of a perceptron.
    pub(super) fn mlp_norm(
        &mut self,
        path: &str,
        rows: usize,
        record: &MlpRecord,
        before: Option<Region>,
        after: Region,
    ) {
        let normed = Normed {
            rows,
            x: record.normal.unwrap_or(record.hidden1),
            inverse: record.inverse,
            bias: format!("{path}.4.bias"),
            norm: &format!("{path}.5"),
        };
        self.norm(&normed, before, after);
    }

    /// Latent vertices to the normalised output.
    pub(super) fn decode(&mut self, rows: usize, nodes: Region, output: Region) -> MlpRecord {
        let (latent, path) = (self.latent, "decoder");
        let size = rows * latent;
        let [hidden1, hidden2] =
            [1, 2].map(|layer| self.plan.floats(format!("decoder, hidden {layer}"), size));
        let record = MlpRecord {
            hidden1,
            hidden2,
            normal: None,
            inverse: None,
        };
        let weight = self.weights.matrix("decoder.0.weight");
        let (x, out) = (Rows::new(nodes, latent), Rows::new(hidden1, latent));
        let epilogue = self.first_epilogue(path);
        self.linear(Linear::new(rows, x, weight, out).then(epilogue));
        self.second_layer(path, rows, &record);
        let weight = self.weights.matrix("decoder.4.weight");
        let (x, out) = (
            Rows::new(hidden2, latent),
            Rows::new(output, output.count() / rows),
        );
        let epilogue = Epilogue::Bias(self.weights.get("decoder.4.bias"));
        self.linear(Linear::new(rows, x, weight, out).then(epilogue));
        record
    }
}
