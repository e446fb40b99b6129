//! A perceptron: Linear, ReLU, Linear, ReLU, Linear, LayerNorm; in a decoder without the last.

use super::record::MlpRecord;
use super::{Lower, OUTPUTS};
use crate::kernels::layers::NORM;
use crate::schedule::plan::Region;
use crate::schedule::{Finish, Matrix, Onto};

impl Lower<'_> {
    /// Room for the activations of a perceptron of so many rows.
    pub(crate) fn mlp_record(&mut self, name: &str, rows: usize) -> MlpRecord {
        let size = rows * self.latent;
        let [hidden1, hidden2] =
            [1, 2].map(|layer| self.plan.floats(format!("{name}, hidden {layer}"), size));
        let keeps = self.keeps();
        // Where nothing is kept the first hidden layer is done with when the output comes.
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

    /// The bias of a perceptron's first layer, then ReLU.
    pub(crate) fn first_finish(&self, path: &str) -> Finish {
        Finish::BiasRelu(self.weights.get(&format!("{path}.0.bias")))
    }

    /// From the first hidden layer to the output without its bias, in the room for the normalised one.
    pub(crate) fn mlp_rest(&mut self, path: &str, rows: usize, record: &MlpRecord) {
        self.second_layer(path, rows, record);
        let weight = self.weights.matrix(&format!("{path}.4.weight"));
        let pair = (Matrix::new(record.hidden2, self.latent), weight);
        let out = Matrix::new(record.normal.unwrap_or(record.hidden1), self.latent);
        let size = [rows, self.latent, self.latent];
        self.linear(size, pair, out, Onto::Set, Finish::Nothing);
    }

    fn second_layer(&mut self, path: &str, rows: usize, record: &MlpRecord) {
        let finish = Finish::BiasRelu(self.weights.get(&format!("{path}.2.bias")));
        let weight = self.weights.matrix(&format!("{path}.2.weight"));
        let pair = (Matrix::new(record.hidden1, self.latent), weight);
        let out = Matrix::new(record.hidden2, self.latent);
        let size = [rows, self.latent, self.latent];
        self.linear(size, pair, out, Onto::Set, finish);
    }

    /// Layer normalisation of `rows` rows of `x`, whose bias, weight and shift have these names; added to
    /// `before` where there is one.
    pub(crate) fn norm(
        &mut self,
        rows: usize,
        (x, inverse): (Region, Option<Region>),
        names: [String; 2],
        (before, after): (Option<Region>, Region),
    ) {
        let [bias, norm] = names;
        let [weight, shift] =
            ["weight", "bias"].map(|part| self.weights.get(&format!("{norm}.{part}")));
        self.schedule.launch(
            &NORM,
            rows,
            &[
                x.into(),
                self.weights.get(&bias).into(),
                weight.into(),
                shift.into(),
                before.into(),
                after.into(),
                inverse.map(|_| x).into(),
                inverse.into(),
            ],
        );
    }

    /// The normalisation at the end of a perceptron.
    pub(crate) fn mlp_norm(
        &mut self,
        path: &str,
        rows: usize,
        record: &MlpRecord,
        rows_of: (Option<Region>, Region),
    ) {
        let x = record.normal.unwrap_or(record.hidden1);
        let names = [format!("{path}.4.bias"), format!("{path}.5")];
        self.norm(rows, (x, record.inverse), names, rows_of);
    }

    /// Latent vertices to normalised accelerations.
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
        let pair = (Matrix::new(nodes, latent), weight);
        let (out, finish) = (Matrix::new(hidden1, latent), self.first_finish(path));
        self.linear([rows, latent, latent], pair, out, Onto::Set, finish);
        self.second_layer(path, rows, &record);
        let weight = self.weights.matrix("decoder.4.weight");
        let finish = Finish::Bias(self.weights.get("decoder.4.bias"));
        let pair = (Matrix::new(hidden2, latent), weight);
        let out = Matrix::new(output, OUTPUTS);
        self.linear([rows, latent, OUTPUTS], pair, out, Onto::Set, finish);
        record
    }
}
