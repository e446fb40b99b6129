//! The way back through a network: from the gradient of its output to those of its weights and, where
//! asked for, of its input and of the states that its encoders carry.
//!
//! Gradients of weights are added to one flat array that is laid out like them. Those of a matrix are
//! products over all rows, those of a bias products with ones: sums in an order that does not change.

mod block;
mod encoder;
mod mlp;

use selvedge_model::Network;

use super::{Dropout, GraphArrays, InputArrays, OUTPUTS, Record, StateArrays, WeightArrays};
use crate::kernels::backward::{ADD, MASK_RELU};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Finish, Matrix, Onto, Product, Schedule};

/// A backward pass, after a forward pass that kept its activations.
#[derive(Clone, Copy, Debug)]
pub struct BackwardPass<'a> {
    /// The network.
    pub network: &'a Network,
    /// Its weights.
    pub weights: &'a WeightArrays,
    /// Their gradient, laid out like [`WeightArrays::flat`]; added to.
    pub gradient: Region,
    /// Ones, as many as there are vertices or arcs, whatever is more.
    pub ones: Region,
    /// The arcs.
    pub graph: &'a GraphArrays,
    /// The features.
    pub input: &'a InputArrays,
    /// What the forward pass left.
    pub record: &'a Record,
    /// What it dropped.
    pub dropout: Option<Dropout>,
    /// The gradient of the output, `[vertices, 3]`.
    pub output: Region,
    /// Where that of the features goes, if wanted.
    pub to_input: Option<&'a InputArrays>,
    /// That of the encoders' last states, as later frames have it; zero without.
    pub end: Option<&'a StateArrays>,
    /// Where that of the states goes that the encoders went on from, if wanted.
    pub start: Option<&'a StateArrays>,
}

/// Adds a backward pass to a schedule, and what it needs to a plan.
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
    let edges = back.plan.floats("gradient of latent arcs", arcs * latent);
    back.decoder(nodes);
    back.schedule.clear(edges);
    for (number, record) in pass.record.blocks.iter().enumerate().rev() {
        back.block(number, record, [nodes, edges]);
    }
    back.encoders([nodes, edges]);
    back.plan.release(mark);
}

/// A schedule under construction.
struct Back<'a> {
    plan: &'a mut Plan,
    schedule: &'a mut Schedule,
    pass: &'a BackwardPass<'a>,
    latent: usize,
}

/// Rows of a matrix, all of them or some of their columns.
#[derive(Clone, Copy)]
struct Rows {
    matrix: Matrix,
    width: usize,
}

impl Rows {
    fn new(region: Region, width: usize) -> Self {
        let matrix = Matrix::new(region, width);
        Self { matrix, width }
    }

    /// `width` of its columns, from number `first` on.
    fn columns(self, first: usize, width: usize) -> Self {
        let matrix = self.matrix.from_column(first);
        Self { matrix, width }
    }
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

    fn product(&mut self, size: [usize; 3], (a, b, c): (Matrix, Matrix, Matrix), onto: Onto) {
        self.schedule.product(Product {
            size,
            a,
            b,
            c,
            onto,
            finish: Finish::Nothing,
        });
    }

    /// Adds to the gradient of a matrix: gᵀ x over `rows` rows.
    fn add_to_weight(&mut self, rows: usize, g: Rows, x: Rows, gradient: Matrix) {
        let operands = (g.matrix.transpose(), x.matrix, gradient);
        self.product([g.width, x.width, rows], operands, Onto::Add);
    }

    /// Adds the sums of the columns of g.
    fn add_to_bias(&mut self, rows: usize, g: Rows, gradient: Region) {
        let ones = Matrix::new(self.pass.ones.part(0..rows), rows);
        let operands = (ones, g.matrix, Matrix::new(gradient, g.width));
        self.product([1, g.width, rows], operands, Onto::Add);
    }

    /// The gradient of the input of a linear layer, from that of its output: g W.
    fn through(&mut self, rows: usize, g: Rows, weight: Matrix, (to, onto): (Rows, Onto)) {
        let operands = (g.matrix, weight, to.matrix);
        self.product([rows, to.width, g.width], operands, onto);
    }

    /// No gradient where a ReLU gave zero.
    fn mask(&mut self, gradient: Region, kept: Region) {
        let arguments = [gradient.into(), kept.into()];
        self.schedule
            .launch(&MASK_RELU, gradient.count(), &arguments);
    }

    /// Adds one array to another.
    fn add(&mut self, to: Region, what: Region) {
        let arguments = [to.into(), what.into()];
        self.schedule.launch(&ADD, to.count(), &arguments);
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
        let to = (Rows::new(hidden, latent), Onto::Set);
        self.through(rows, output, weight, to);
        self.mask(hidden, record.hidden2);
        self.second_layer("decoder", rows, (hidden, first), record);
        let before = Rows::new(self.pass.record.nodes, latent);
        let first = Rows::new(first, latent);
        self.add_to_weight(rows, first, before, self.matrix_of("decoder.0.weight"));
        let weight = self.pass.weights.matrix("decoder.0.weight");
        let to = (Rows::new(nodes, latent), Onto::Set);
        self.through(rows, first, weight, to);
        self.plan.release(mark);
    }
}

#[cfg(test)]
mod tests;
