//! The backward pass: from the gradient of the output to the gradients of the weights and, where
//! they are wanted, of the features and of the states that the encoders carry.
//!
//! Gradients of weights are added to one flat array, laid out like the weights. The gradient of a
//! matrix is a product over all rows, that of a bias a product with ones: sums in a fixed order.

mod block;
mod encoder;
mod mlp;

use selvedge_model::Network;

use super::OUTPUTS;
use super::arrays::{GraphArrays, InputArrays};
use super::dropout::Dropout;
use super::linear::Rows;
use super::record::Record;
use super::weights::WeightArrays;
use crate::kernels::backward::{ADD, MASK_RELU};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Epilogue, Matrix, Onto, Product, Schedule, args};

/// A backward pass, after a forward pass that kept its activations.
#[derive(Clone, Copy, Debug)]
pub struct BackwardPass<'a> {
    /// The network.
    pub network: &'a Network,
    /// Its weights.
    pub weights: &'a WeightArrays,
    /// Their gradient, laid out like [`WeightArrays::flat`]; added to.
    pub gradient: Region,
    /// Ones, as many as there are vertices or arcs, whichever is more.
    pub ones: Region,
    /// The arcs.
    pub graph: &'a GraphArrays,
    /// The features.
    pub input: &'a InputArrays,
    /// The arrays that the forward pass left.
    pub record: &'a Record,
    /// The dropout of the forward pass.
    pub dropout: Option<Dropout>,
    /// The gradient of the output, `[vertices, 3]`.
    pub output: Region,
    /// Room for the gradient of the features, if it is wanted.
    pub to_input: Option<&'a InputArrays>,
}

/// Adds a backward pass to a schedule, and its arrays to a plan.
pub fn backward(plan: &mut Plan, schedule: &mut Schedule, pass: &BackwardPass<'_>) {
    let latent = pass.network.spec().latent;
    let (vertices, arcs) = (pass.graph.vertices, pass.graph.arcs);
    let mut back = Back {
        plan,
        schedule,
        pass,
        latent,
    };
    let mark = back.plan.mark();
    let nodes = back
        .plan
        .floats("gradient of latent vertices", vertices * latent);
    let of_arcs = back.plan.floats("gradient of latent arcs", arcs * latent);
    back.decoder(nodes);
    back.schedule.clear(of_arcs);
    for (number, record) in pass.record.blocks.iter().enumerate().rev() {
        back.block(number, record, nodes, of_arcs);
    }
    back.encoders([nodes, of_arcs]);
    back.plan.release(mark);
}

/// A schedule under construction.
struct Back<'a> {
    plan: &'a mut Plan,
    schedule: &'a mut Schedule,
    pass: &'a BackwardPass<'a>,
    latent: usize,
}

impl Back<'_> {
    /// The gradient of a weight.
    fn gradient_of(&self, name: &str) -> Region {
        let (range, _) = self.pass.weights.place(name);
        self.pass.gradient.part(range)
    }

    /// The gradient of a weight as a matrix `[outputs, inputs]`.
    fn matrix_of(&self, name: &str) -> Matrix {
        let (range, columns) = self.pass.weights.place(name);
        Matrix::new(self.pass.gradient.part(range), columns)
    }

    /// Adds gᵀ x, summed over `rows` rows, to the gradient of a matrix.
    fn add_to_weight(&mut self, rows: usize, g: Rows, x: Rows, gradient: Matrix) {
        self.schedule.product(Product {
            size: [g.width, x.width, rows],
            a: g.matrix.transpose(),
            b: x.matrix,
            c: gradient,
            onto: Onto::Add,
            epilogue: Epilogue::Nothing,
        });
    }

    /// Adds the sums of the columns of g to the gradient of a bias.
    fn add_to_bias(&mut self, rows: usize, g: Rows, gradient: Region) {
        self.schedule.product(Product {
            size: [1, g.width, rows],
            a: Matrix::new(self.pass.ones.part(0..rows), rows),
            b: g.matrix,
            c: Matrix::new(gradient, g.width),
            onto: Onto::Add,
            epilogue: Epilogue::Nothing,
        });
    }

    /// Takes the gradient g of a linear layer's output to that of its input: g W.
    fn through(&mut self, rows: usize, g: Rows, weight: Matrix, to: Rows, onto: Onto) {
        self.schedule.product(Product {
            size: [rows, to.width, g.width],
            a: g.matrix,
            b: weight,
            c: to.matrix,
            onto,
            epilogue: Epilogue::Nothing,
        });
    }

    /// Sets the gradient to zero where a ReLU gave zero.
    fn mask(&mut self, gradient: Region, kept: Region) {
        let arguments = args! { gradient, kept };
        self.schedule
            .launch(&MASK_RELU, gradient.count(), arguments);
    }

    /// Adds one array to another.
    fn add(&mut self, to: Region, what: Region) {
        let arguments = args! { to, what };
        self.schedule.launch(&ADD, to.count(), arguments);
    }

    /// From the gradient of the output to that of the latent vertices before the decoder.
    fn decoder(&mut self, nodes: Region) {
        let (rows, latent) = (self.pass.graph.vertices, self.latent);
        let record = &self.pass.record.decoder;
        let mark = self.plan.mark();
        let [hidden, first] = ["hidden", "first"].map(|layer| {
            let name = format!("gradient of the decoder's {layer} sums");
            self.plan.floats(name, rows * latent)
        });
        let output = Rows::new(self.pass.output, OUTPUTS);
        let kept = Rows::new(record.hidden2, latent);
        self.linear(rows, "decoder.4", output, kept);
        let weight = self.pass.weights.matrix("decoder.4.weight");
        let to = Rows::new(hidden, latent);
        self.through(rows, output, weight, to, Onto::Set);
        self.mask(hidden, record.hidden2);
        self.second_layer("decoder", rows, hidden, first, record);
        let before = Rows::new(self.pass.record.nodes, latent);
        let first = Rows::new(first, latent);
        self.add_to_weight(rows, first, before, self.matrix_of("decoder.0.weight"));
        let weight = self.pass.weights.matrix("decoder.0.weight");
        let to = Rows::new(nodes, latent);
        self.through(rows, first, weight, to, Onto::Set);
        self.plan.release(mark);
    }
}

#[cfg(test)]
mod tests;
