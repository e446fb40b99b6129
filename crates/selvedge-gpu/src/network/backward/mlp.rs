//! The way back through a perceptron, from the gradient of its output to that of its first layer's sums.

use super::{Back, Rows};
use crate::kernels::backward::NORM_BACKWARD;
use crate::network::MlpRecord;
use crate::schedule::Onto;
use crate::schedule::plan::Region;

impl Back<'_> {
    /// Adds the gradients of matrix and bias of a linear layer, for the gradient `g` of its sums and its
    /// input `x`.
    pub(super) fn linear(&mut self, rows: usize, path: &str, g: Rows, x: Rows) {
        let weight = self.matrix_of(&format!("{path}.weight"));
        self.add_to_weight(rows, g, x, weight);
        self.add_to_bias(rows, g, self.gradient_of(&format!("{path}.bias")));
    }

    /// Takes the gradient of a layer normalisation's output to that of its input, in place; `other` is
    /// room for as many rows. `of` is the normalised output and 1 / deviation.
    pub(super) fn norm(
        &mut self,
        path: &str,
        rows: usize,
        [gradient, other]: [Region; 2],
        (normal, inverse): (Region, Option<Region>),
    ) {
        let inverse = inverse.unwrap_or(normal);
        let weight = self.pass.weights.get(&format!("{path}.weight"));
        let g = Rows::new(gradient, self.latent);
        self.add_to_bias(rows, g, self.gradient_of(&format!("{path}.bias")));
        self.schedule.launch(
            &NORM_BACKWARD,
            rows,
            &[
                gradient.into(),
                normal.into(),
                inverse.into(),
                weight.into(),
                other.into(),
            ],
        );
        let g = Rows::new(other, self.latent);
        self.add_to_bias(rows, g, self.gradient_of(&format!("{path}.weight")));
    }

    /// From the gradient of the second layer's sums to that of the first one's, with the gradients of
    /// the second layer's weights and of the first one's bias.
    pub(super) fn second_layer(
        &mut self,
        path: &str,
        rows: usize,
        (hidden, first): (Region, Region),
        record: &MlpRecord,
    ) {
        let latent = self.latent;
        let kept = Rows::new(record.hidden1, latent);
        let g = Rows::new(hidden, latent);
        self.linear(rows, &format!("{path}.2"), g, kept);
        let weight = self.pass.weights.matrix(&format!("{path}.2.weight"));
        let to = Rows::new(first, latent);
        self.through(rows, g, weight, (to, Onto::Set));
        self.mask(first, record.hidden1);
        self.add_to_bias(rows, to, self.gradient_of(&format!("{path}.0.bias")));
    }

    /// From the gradient of a perceptron's output to that of its first layer's sums, in place; `other` is
    /// room for as many rows. All gradients are added but that of the first layer's matrix.
    pub(super) fn mlp(
        &mut self,
        path: &str,
        rows: usize,
        [gradient, other]: [Region; 2],
        record: &MlpRecord,
    ) {
        let latent = self.latent;
        let normal = record.normal.unwrap_or(record.hidden1);
        let norm = format!("{path}.5");
        self.norm(&norm, rows, [gradient, other], (normal, record.inverse));
        let (g, kept) = (
            Rows::new(gradient, latent),
            Rows::new(record.hidden2, latent),
        );
        self.linear(rows, &format!("{path}.4"), g, kept);
        let weight = self.pass.weights.matrix(&format!("{path}.4.weight"));
        let to = (Rows::new(other, latent), Onto::Set);
        self.through(rows, g, weight, to);
        self.mask(other, record.hidden2);
        self.second_layer(path, rows, (other, gradient), record);
    }
}
