//! The backward pass of a perceptron, from the gradient of its output to the pre-activation
//! gradient of its first layer.

use super::Back;
use crate::kernels::backward::NORM_BACKWARD;
use crate::network::linear::Rows;
use crate::network::record::MlpRecord;
use crate::schedule::plan::Region;
use crate::schedule::{Onto, args};

/// A layer normalisation on its way back.
pub(super) struct NormBack<'a> {
    /// The path of its weights.
    pub(super) path: &'a str,
    /// The number of rows.
    pub(super) rows: usize,
    /// The normalised rows.
    pub(super) normal: Region,
    /// 1 / deviation, `[rows]`.
    pub(super) inverse: Option<Region>,
}

impl Back<'_> {
    /// Adds the gradients of matrix and bias of a linear layer, for the gradient `g` of its output
    /// and its input `x`.
    pub(super) fn linear(&mut self, rows: usize, path: &str, g: Rows, x: Rows) {
        let weight = self.matrix_of(&format!("{path}.weight"));
        self.add_to_weight(rows, g, x, weight);
        self.add_to_bias(rows, g, self.gradient_of(&format!("{path}.bias")));
    }

    /// Takes the gradient of a layer normalisation's output to that of its input, in place; `other`
    /// is room for as many rows.
    pub(super) fn norm(&mut self, of: &NormBack<'_>, gradient: Region, other: Region) {
        let (path, rows) = (of.path, of.rows);
        let weight = self.pass.weights.get(&format!("{path}.weight"));
        let g = Rows::new(gradient, self.latent);
        self.add_to_bias(rows, g, self.gradient_of(&format!("{path}.bias")));
        let arguments = args! {
            gradient,
            normal: of.normal,
            inverse: of.inverse,
            weight,
            by_weight: other,
        };
        self.schedule.launch(&NORM_BACKWARD, rows, arguments);
        let g = Rows::new(other, self.latent);
        self.add_to_bias(rows, g, self.gradient_of(&format!("{path}.weight")));
    }

    /// From the pre-activation gradient of the second layer (`hidden`) to that of the first, with
    /// the gradients of the second layer's weights and of the first layer's bias.
    pub(super) fn second_layer(
        &mut self,
        path: &str,
        rows: usize,
        hidden: Region,
        first: Region,
        record: &MlpRecord,
    ) {
        let latent = self.latent;
        let kept = Rows::new(record.hidden1, latent);
        let g = Rows::new(hidden, latent);
        self.linear(rows, &format!("{path}.2"), g, kept);
        let weight = self.pass.weights.matrix(&format!("{path}.2.weight"));
        let to = Rows::new(first, latent);
        self.through(rows, g, weight, to, Onto::Set);
        self.mask(first, record.hidden1);
        self.add_to_bias(rows, to, self.gradient_of(&format!("{path}.0.bias")));
    }

    /// From the gradient of a perceptron's output to the pre-activation gradient of its first
    /// layer, in place; `other` is room for as many rows. Adds all gradients of weights except that
    /// of the first layer's matrix.
    pub(super) fn mlp(
        &mut self,
        path: &str,
        rows: usize,
        gradient: Region,
        other: Region,
        record: &MlpRecord,
    ) {
        let latent = self.latent;
        let norm = NormBack {
            path: &format!("{path}.5"),
            rows,
            normal: record.normal.unwrap_or(record.hidden1),
            inverse: record.inverse,
        };
        self.norm(&norm, gradient, other);
        let (g, kept) = (
            Rows::new(gradient, latent),
            Rows::new(record.hidden2, latent),
        );
        self.linear(rows, &format!("{path}.4"), g, kept);
        let weight = self.pass.weights.matrix(&format!("{path}.4.weight"));
        let to = Rows::new(other, latent);
        self.through(rows, g, weight, to, Onto::Set);
        self.mask(other, record.hidden2);
        self.second_layer(path, rows, other, gradient, record);
    }
}
