//! A network's step of learning on a device, on given features and a given target: forward pass,
//! mean square error, backward pass, Adam. Compared with the processor's engine, and measured
//! beside other programs; trainings are in `training`.

use selvedge_model::{Input, Network};
use selvedge_train::{Adam, AdamError, AdamSettings};

use crate::bench::case::{GraphSizes, Layout, NetworkArrays, NetworkCase, load};
use crate::device::{Device, DeviceError, Loaded, Precision, Prepared};
use crate::kernels::losses::{self, SQUARE_ERROR};
use crate::kernels::{Program, Sizes, adam, backward as backward_kernels, layers};
use crate::network::{BackwardPass, ForwardPass, Keep, OUTPUTS, backward, forward};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Command, Schedule, args};
use crate::training::adam::AdamArrays;

/// A network on a graph, ready to learn.
pub struct Learning {
    loaded: Box<dyn Loaded>,
    arrays: NetworkArrays,
    target: Region,
    gradient: Region,
    adam: AdamArrays,
    optimizer: Adam,
    learn: Prepared,
    update: Prepared,
    /// The commands of both.
    commands: Vec<Command>,
}

/// The memory, the kernels and the schedules of a step.
struct StepLayout {
    plan: Plan,
    program: Program,
    arrays: NetworkArrays,
    target: Region,
    gradient: Region,
    ones: Region,
    adam: AdamArrays,
    learn: Schedule,
    update: Schedule,
}

impl Layout for StepLayout {
    fn new(network: &Network, sizes: GraphSizes) -> Self {
        let mut program = Program::new(Sizes::of(network.spec()));
        let parts = [&layers::PART, &losses::PART, &backward_kernels::PART];
        parts.into_iter().for_each(|part| program.add(part));
        adam::define(&mut program);
        let (mut plan, parameters) = (Plan::new(), network.parameter_count());
        let mut layout = Self {
            arrays: NetworkArrays::new(&mut plan, network, sizes),
            target: plan.floats("target", sizes.vertices * OUTPUTS),
            gradient: plan.floats("gradient", parameters),
            ones: plan.floats("ones", sizes.vertices.max(sizes.arcs)),
            adam: AdamArrays::new(&mut plan, parameters),
            learn: Schedule::new("a step of learning"),
            update: Schedule::new("a step of the optimiser"),
            program,
            plan,
        };
        layout.lower(network);
        let weights = &layout.arrays.weights;
        let (plan, update) = (&mut layout.plan, &mut layout.update);
        layout
            .adam
            .step(plan, update, weights.flat(), layout.gradient);
        weights.pack(update);
        layout
    }

    fn plan(&self) -> &Plan {
        &self.plan
    }

    fn program(&self) -> &Program {
        &self.program
    }

    fn arrays(&self) -> &NetworkArrays {
        &self.arrays
    }
}

impl StepLayout {
    /// Adds the passes, with the error between them.
    fn lower(&mut self, network: &Network) {
        let (plan, schedule, arrays) = (&mut self.plan, &mut self.learn, &self.arrays);
        let pass = ForwardPass {
            network,
            weights: &arrays.weights,
            graph: &arrays.graph,
            input: &arrays.input,
            keep: Keep::Activations(None),
        };
        let record = forward(plan, schedule, pass);
        let count = record.output.count();
        let output = plan.floats("gradient of the output", count);
        let arguments = args! {
            found: record.output,
            target: self.target,
            share: 1.0 / count as f32,
            gradient: output,
        };
        schedule.launch(&SQUARE_ERROR, count, arguments);
        schedule.clear(self.gradient);
        let pass = BackwardPass {
            network,
            weights: &arrays.weights,
            gradient: self.gradient,
            ones: self.ones,
            graph: &arrays.graph,
            input: &arrays.input,
            record: &record,
            dropout: None,
            output,
            to_input: None,
        };
        backward(plan, schedule, &pass);
    }
}

impl Learning {
    /// Loads a network onto a device.
    ///
    /// # Errors
    /// Too little memory, or a device that fails.
    ///
    /// # Panics
    /// When the number of weights is not that of the network.
    pub fn new(
        device: &dyn Device,
        case: NetworkCase<'_>,
        precision: Precision,
    ) -> Result<Self, LearningError> {
        let optimizer = Adam::new(AdamSettings::default(), case.weights.len())?;
        let (layout, mut loaded) = load::<StepLayout>(device, case, precision)?;
        loaded.put(layout.ones, &vec![1.0; layout.ones.count()])?;
        for moment in [layout.adam.first, layout.adam.second] {
            loaded.put(moment, &vec![0.0; moment.count()])?;
        }
        Ok(Self {
            learn: loaded.prepare(&layout.learn)?,
            update: loaded.prepare(&layout.update)?,
            commands: [layout.learn.commands, layout.update.commands].concat(),
            loaded,
            arrays: layout.arrays,
            target: layout.target,
            gradient: layout.gradient,
            adam: layout.adam,
            optimizer,
        })
    }

    /// The number of kernels, products and copies of a step.
    #[must_use]
    pub fn commands(&self) -> usize {
        self.commands.len()
    }

    /// Writes normalised features, of as many frames as the pass takes, and the target of its
    /// prediction, `[vertices, 3]`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put(&mut self, input: Input<'_, f32>, target: &[f32]) -> Result<(), DeviceError> {
        self.arrays.put(&mut *self.loaded, input)?;
        self.loaded.put(self.target, target)
    }

    /// Starts a step at a learning rate.
    ///
    /// # Errors
    /// When the device fails.
    pub fn step(&mut self, learning_rate: f64) -> Result<(), DeviceError> {
        self.loaded.run(self.learn)?;
        let rates = self.optimizer.next_rates(learning_rate);
        self.optimizer.count_step();
        let loaded = &mut *self.loaded;
        self.adam.upload(loaded, f64::INFINITY, rates, 0.0)?;
        loaded.run(self.update)
    }

    /// Waits for the steps that were started.
    ///
    /// # Errors
    /// When one has failed.
    pub fn wait(&mut self) -> Result<(), DeviceError> {
        self.loaded.wait()
    }

    /// As [`Loaded::unrecorded`].
    #[must_use]
    pub fn unrecorded(&self) -> Option<&str> {
        self.loaded.unrecorded()
    }

    /// The gradient of the last step, laid out like the weights.
    ///
    /// # Errors
    /// When the device fails.
    pub fn gradient(&mut self) -> Result<Vec<f32>, DeviceError> {
        self.loaded.get(self.gradient)
    }

    /// The weights after the last step.
    ///
    /// # Errors
    /// When the device fails.
    pub fn weights(&mut self) -> Result<Vec<f32>, DeviceError> {
        self.loaded.get(self.arrays.weights.flat())
    }
}

/// A network that cannot learn on a device.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "each message is its source's")]
pub enum LearningError {
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error(transparent)]
    Optimizer(#[from] AdamError),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_graphs::{device, numbers, specs, squares, weights};
    use selvedge_model::{Gradients, Pass, Workspace};

    #[test]
    fn two_steps_are_those_of_the_cpu() {
        let device = device();
        let graph = squares(&[30]);
        let counts = [graph.vertex_count(), graph.arc_count()];
        let spec = &specs()[5];
        let network = Network::new(spec).expect("a spec");
        let mut expected = weights(&network, 3);
        let nodes = numbers(spec.window() * counts[0] * spec.node_width(), 1.5, 1);
        let edges = numbers(spec.window() * counts[1] * spec.edge_width(), 1.5, 2);
        let target = numbers(counts[0] * OUTPUTS, 1.0, 4);
        let input = Input {
            nodes: &nodes,
            arcs: &edges,
        };
        let case = NetworkCase {
            network: &network,
            weights: &expected,
            graph: &graph,
        };
        let mut learning = Learning::new(device, case, Precision::Full).expect("a network");
        learning.put(input, &target).expect("features");
        let mut adam = Adam::new(AdamSettings::default(), expected.len()).expect("settings");
        let mut workspace = Workspace::new();
        for _ in 0..2 {
            learning.step(1e-3).expect("a step");
            let pass = Pass::Training(None);
            let out = network.forward(&expected, &graph, input, pass, &mut workspace);
            let share = 2.0 / out.len() as f32;
            let by_output: Vec<f32> = out
                .iter()
                .zip(&target)
                .map(|(x, y)| share * (x - y))
                .collect();
            let mut gradient = vec![0.0; expected.len()];
            let gradients = Gradients::new(&by_output, &mut gradient);
            network.backward(&expected, &graph, input, gradients, &mut workspace);
            let found = learning.gradient().expect("a gradient");
            let largest = gradient.iter().fold(0.0_f32, |most, g| most.max(g.abs()));
            for (x, y) in found.iter().zip(&gradient) {
                assert!((x - y).abs() < 1e-4 * largest, "{x} {y}");
            }
            adam.step(&mut expected, &gradient, 1e-3);
        }
        // Adam moves by the whole rate even where a gradient is so small that rounding decides its
        // sign: few weights may differ by that.
        let found = learning.weights().expect("weights");
        let off = |bound: f32| {
            let pairs = found.iter().zip(&expected);
            pairs.filter(|(x, y)| (*x - *y).abs() > bound).count()
        };
        assert_eq!(off(4.1e-3), 0);
        assert!(
            off(1e-5) < expected.len() / 100,
            "{} of {}",
            off(1e-5),
            expected.len()
        );
    }
}
