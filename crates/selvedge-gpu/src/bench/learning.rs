//! A network's step of learning on a device, on features and a target that lie ready: forward, the mean
//! square error, backward, Adam. What is compared with the CPU engine, and measured beside other programs;
//! trainings are in `training`.

use selvedge_model::{Connectivity, Extent, Input, Network};
use selvedge_train::{Adam, AdamError, AdamSettings};

use crate::bench::profile::{Spent, profile};
use crate::cloths::losses::{self, SQUARE_ERROR};
use crate::device::{
    Device, DeviceError, Loaded, Precision, Prepared, require_memory, vertices_that_fit,
};
use crate::kernels::{Program, Sizes};
use crate::kernels::{backward as backward_kernels, layers};
use crate::network::{
    BackwardPass, ForwardPass, GraphArrays, InputArrays, Keep, OUTPUTS, StateArrays, WeightArrays,
    backward, forward,
};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Argument, Command, Schedule};
use crate::training::adam::{self, AdamArrays};

/// A network on a graph, ready to learn.
pub struct Learning {
    loaded: Box<dyn Loaded>,
    input: InputArrays,
    target: Region,
    gradient: Region,
    weights: Region,
    start: Option<StateArrays>,
    adam: AdamArrays,
    optimizer: Adam,
    learn: Prepared,
    update: Prepared,
    /// Both, as they were prepared.
    commands: Vec<Command>,
}

/// Where everything lies and what is done.
struct Layout {
    plan: Plan,
    program: Program,
    weights: WeightArrays,
    graph: GraphArrays,
    input: InputArrays,
    target: Region,
    gradient: Region,
    ones: Region,
    start: Option<StateArrays>,
    adam: AdamArrays,
    pack: Schedule,
    learn: Schedule,
    update: Schedule,
}

impl Layout {
    fn new(network: &Network, [vertices, arcs]: [usize; 2], extent: Extent) -> Self {
        let spec = network.spec();
        let mut program = Program::new(Sizes::of(spec));
        let parts = [&layers::PART, &losses::PART, &backward_kernels::PART];
        parts.into_iter().for_each(|part| program.add(part));
        adam::define(&mut program);
        let (mut plan, parameters) = (Plan::new(), network.parameter_count());
        let graph = GraphArrays::new(&mut plan, vertices, arcs);
        let steps = match extent {
            Extent::Whole => [spec.node_window(), spec.edge_window()],
            Extent::Newest => [1, 1],
        };
        let start =
            (extent == Extent::Newest).then(|| StateArrays::new(&mut plan, network, &graph));
        let mut layout = Self {
            weights: WeightArrays::new(&mut plan, network),
            input: InputArrays::new(&mut plan, network, &graph, steps),
            target: plan.floats("target", vertices * OUTPUTS),
            gradient: plan.floats("gradient", parameters),
            ones: plan.floats("ones", vertices.max(arcs)),
            adam: AdamArrays::new(&mut plan, parameters, None),
            pack: Schedule::new("packing the weights"),
            learn: Schedule::new("a step of learning"),
            update: Schedule::new("a step of the optimiser"),
            graph,
            start,
            program,
            plan,
        };
        layout.weights.pack(&mut layout.pack);
        layout.lower(network);
        let both = (layout.weights.flat(), layout.gradient);
        layout.adam.step(&mut layout.plan, &mut layout.update, both);
        layout.weights.pack(&mut layout.update);
        layout
    }

    fn lower(&mut self, network: &Network) {
        let (plan, schedule) = (&mut self.plan, &mut self.learn);
        let pass = ForwardPass {
            network,
            weights: &self.weights,
            graph: &self.graph,
            input: &self.input,
            start: self.start.as_ref(),
            end: None,
            keep: Keep::Activations(None),
        };
        let record = forward(plan, schedule, pass);
        let count = record.output.count();
        let output = plan.floats("gradient of the output", count);
        let share = Argument::Number(1.0 / count as f32);
        let arguments = [
            record.output.into(),
            self.target.into(),
            share,
            output.into(),
        ];
        schedule.launch(&SQUARE_ERROR, count, &arguments);
        schedule.clear(self.gradient);
        let pass = BackwardPass {
            network,
            weights: &self.weights,
            gradient: self.gradient,
            ones: self.ones,
            graph: &self.graph,
            input: &self.input,
            record: &record,
            dropout: None,
            output,
            to_input: None,
            end: None,
            start: None,
        };
        backward(plan, schedule, &pass);
    }
}

impl Learning {
    /// A network with its weights on a graph. Of [`Extent::Newest`] it goes on from states, which begin
    /// with zero.
    ///
    /// # Errors
    /// Too little memory, or a device that fails.
    ///
    /// # Panics
    /// When there are not as many weights as the network has.
    pub fn new(
        device: &dyn Device,
        (network, weights): (&Network, &[f32]),
        graph: &Connectivity,
        extent: Extent,
        precision: Precision,
    ) -> Result<Self, LearningError> {
        let optimizer = Adam::new(AdamSettings::default(), weights.len())?;
        let counts = [graph.vertex_count(), graph.arc_count()];
        let layout = Layout::new(network, counts, extent);
        require_memory(device, "this network", layout.plan.bytes(), |free| {
            vertices_that_fit(counts, free, |counts| {
                Layout::new(network, counts, extent).plan.bytes()
            })
        })?;
        let mut loaded = device.load(&layout.program, &layout.plan, precision)?;
        loaded.put(layout.weights.flat(), weights)?;
        layout.graph.upload(&mut *loaded, graph)?;
        loaded.put(layout.ones, &vec![1.0; layout.ones.count()])?;
        for region in layout.start.iter().flat_map(StateArrays::regions) {
            loaded.put(region, &vec![0.0; region.count()])?;
        }
        for moment in [layout.adam.first, layout.adam.second] {
            loaded.put(moment, &vec![0.0; moment.count()])?;
        }
        let pack = loaded.prepare(&layout.pack)?;
        loaded.run(pack)?;
        Ok(Self {
            learn: loaded.prepare(&layout.learn)?,
            update: loaded.prepare(&layout.update)?,
            commands: [layout.learn.commands, layout.update.commands].concat(),
            loaded,
            input: layout.input,
            target: layout.target,
            gradient: layout.gradient,
            weights: layout.weights.flat(),
            start: layout.start,
            adam: layout.adam,
            optimizer,
        })
    }

    /// Kernels, products and copies of a step.
    #[must_use]
    pub fn commands(&self) -> usize {
        self.commands.len()
    }

    /// What every command of a step takes by itself. Nothing can be learned afterwards.
    ///
    /// # Errors
    /// When the device fails.
    pub fn profile(mut self) -> Result<Vec<Spent>, DeviceError> {
        self.step(0.0)?;
        let schedule = Schedule {
            name: "a step of learning",
            commands: self.commands,
        };
        profile(&mut *self.loaded, &schedule)
    }

    /// Writes normalised features, of as many frames as the pass takes, and what it should predict,
    /// `[vertices, 3]`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put(&mut self, input: Input<'_, f32>, target: &[f32]) -> Result<(), DeviceError> {
        self.loaded.put(self.input.nodes, input.nodes)?;
        self.loaded.put(self.input.edges, input.edges)?;
        self.loaded.put(self.target, target)
    }

    /// Sets every value of the states that it goes on from; nothing where it begins with none.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put_state(&mut self, value: f32) -> Result<(), DeviceError> {
        for region in self.start.iter().flat_map(StateArrays::regions) {
            self.loaded.put(region, &vec![value; region.count()])?;
        }
        Ok(())
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
        self.loaded.get(self.weights)
    }
}

/// Why a network cannot learn on a device.
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
        let Some(device) = device() else { return };
        let graph = squares(&[30]);
        let counts = [graph.vertex_count(), graph.arc_count()];
        let spec = &specs()[5];
        let network = Network::new(spec).expect("a spec");
        let mut expected = weights(&network, 3);
        let nodes = numbers(spec.node_window() * counts[0] * spec.node_width(), 1.5, 1);
        let edges = numbers(spec.edge_window() * counts[1] * spec.edge_width(), 1.5, 2);
        let target = numbers(counts[0] * OUTPUTS, 1.0, 4);
        let input = Input {
            nodes: &nodes,
            edges: &edges,
        };
        let both = (&network, &*expected);
        let learning = Learning::new(device, both, &graph, Extent::Whole, Precision::Full);
        let mut learning = learning.expect("a network");
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
            let gradients = Gradients {
                weights: &mut gradient,
                input: None,
            };
            let given = (&*expected, gradients);
            network.backward(given, &graph, input, &by_output, &mut workspace);
            let found = learning.gradient().expect("a gradient");
            let largest = gradient.iter().fold(0.0_f32, |most, g| most.max(g.abs()));
            for (x, y) in found.iter().zip(&gradient) {
                assert!((x - y).abs() < 1e-4 * largest, "{x} {y}");
            }
            adam.step(&mut expected, &gradient, 1e-3);
        }
        // Where a gradient is so small that rounding makes its sign, Adam moves by the whole rate all the
        // same: few weights may differ by that.
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
