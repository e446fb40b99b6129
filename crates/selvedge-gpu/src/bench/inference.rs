//! A network's forward pass on a device, on given features: compared with the processor's engine,
//! and measured beside other programs.

use selvedge_model::{Extent, Input, Network};

use crate::bench::case::{GraphSizes, Layout, NetworkArrays, NetworkCase, load};
use crate::device::{Device, DeviceError, Loaded, Precision, Prepared};
use crate::kernels::layers;
use crate::kernels::{Program, Sizes};
use crate::network::{ForwardPass, Keep, StateArrays, forward};
use crate::schedule::Schedule;
use crate::schedule::plan::{Plan, Region};

/// A network on a graph, ready to be run.
pub struct Inference {
    loaded: Box<dyn Loaded>,
    arrays: NetworkArrays,
    output: Region,
    forward: Prepared,
    commands: usize,
}

/// The memory, the kernels and the schedule of a pass.
struct PassLayout {
    plan: Plan,
    program: Program,
    arrays: NetworkArrays,
    output: Region,
    forward: Schedule,
}

impl Layout for PassLayout {
    fn new(network: &Network, sizes: GraphSizes, extent: Extent) -> Self {
        let mut program = Program::new(Sizes::of(network.spec()));
        program.add(&layers::PART);
        let mut plan = Plan::new();
        let arrays = NetworkArrays::new(&mut plan, network, sizes, extent);
        let end = arrays
            .start
            .map(|_| StateArrays::new(&mut plan, network, &arrays.graph));
        let mut schedule = Schedule::new("a forward pass");
        let pass = ForwardPass {
            network,
            weights: &arrays.weights,
            graph: &arrays.graph,
            input: &arrays.input,
            start: arrays.start.as_ref(),
            end: end.as_ref(),
            keep: Keep::Output,
        };
        let output = forward(&mut plan, &mut schedule, pass).output;
        Self {
            plan,
            program,
            arrays,
            output,
            forward: schedule,
        }
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

impl Inference {
    /// Loads a network onto a device. The states that a pass of [`Extent::Newest`] leaves are not
    /// those that the next one starts from.
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
    ) -> Result<Self, DeviceError> {
        let (layout, mut loaded) = load::<PassLayout>(device, case, precision)?;
        Ok(Self {
            forward: loaded.prepare(&layout.forward)?,
            commands: layout.forward.len(),
            output: layout.output,
            arrays: layout.arrays,
            loaded,
        })
    }

    /// The number of kernels, products and copies of a pass.
    #[must_use]
    pub fn commands(&self) -> usize {
        self.commands
    }

    /// Writes normalised features, of as many frames as the pass takes.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put(&mut self, input: Input<'_, f32>) -> Result<(), DeviceError> {
        self.arrays.put(&mut *self.loaded, input)
    }

    /// Sets every value of the states that a pass starts from, if it has such states.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put_state(&mut self, value: f32) -> Result<(), DeviceError> {
        self.arrays.put_state(&mut *self.loaded, value)
    }

    /// Starts a pass.
    ///
    /// # Errors
    /// When the device fails.
    pub fn run(&mut self) -> Result<(), DeviceError> {
        self.loaded.run(self.forward)
    }

    /// Waits for the passes that were started.
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

    /// The normalised output of the last pass, `[vertices, outputs]`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn output(&mut self) -> Result<Vec<f32>, DeviceError> {
        self.loaded.get(self.output)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_graphs::{device, numbers, specs, squares, weights};
    use selvedge_model::{Carried, EncoderState, Pass, Purpose, Workspace};

    #[test]
    fn a_stream_goes_on_from_its_states_as_on_the_cpu() {
        let device = device();
        let graph = squares(&[30, 17]);
        let counts = [graph.vertex_count(), graph.arc_count()];
        for spec in specs() {
            let network = Network::new(&spec).expect("a spec");
            if !network.streams() {
                continue;
            }
            let weights = weights(&network, 3);
            let nodes = numbers(counts[0] * spec.node_width(), 1.5, 1);
            let edges = numbers(counts[1] * spec.edge_width(), 1.5, 2);
            let input = Input {
                nodes: &nodes,
                arcs: &edges,
            };
            let using = selvedge_model::Instructions::Detected;
            let packed = network.pack(&weights, Purpose::Inference, using);
            let state = EncoderState::filled(0.1, counts[0], counts[1], spec.latent);
            let mut workspace = Workspace::new();
            let given = Carried {
                input,
                state: &state,
            };
            let pass = Pass::Inference;
            let expected = network.forward_carried(&packed, &graph, given, pass, &mut workspace);
            let expected = expected.expect("nobody stops it");
            let case = NetworkCase {
                network: &network,
                weights: &weights,
                graph: &graph,
                extent: Extent::Newest,
            };
            let mut inference = Inference::new(device, case, Precision::Full).expect("a network");
            inference.put(input).expect("features");
            inference.put_state(0.1).expect("states");
            inference.run().expect("a run");
            let found = inference.output().expect("an output");
            for (x, y) in found.iter().zip(expected) {
                assert!((x - y).abs() < 1e-5, "{x} {y}");
            }
        }
    }
}
