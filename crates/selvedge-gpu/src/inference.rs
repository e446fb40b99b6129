//! A network's forward pass on a device, on features that somebody else has made: what is compared
//! with the CPU engine, and measured beside other programs.

use selvedge_model::{Connectivity, Extent, Input, Network};

use crate::device::{Device, DeviceError, Loaded, Precision, Prepared, require_memory};
use crate::layers;
use crate::network::{
    ForwardPass, GraphArrays, InputArrays, Keep, StateArrays, WeightArrays, forward,
};
use crate::plan::{Plan, Region};
use crate::profile::Work;
use crate::schedule::Schedule;
use crate::source::{Program, Sizes};

/// A network on a graph, ready to be run.
pub struct Inference {
    loaded: Box<dyn Loaded>,
    input: InputArrays,
    start: Option<StateArrays>,
    output: Region,
    forward: Prepared,
    commands: usize,
    work: Work,
}

impl Inference {
    /// A network with its weights on a graph. Of [`Extent::Newest`] it goes on from states, which begin
    /// with zero; those that it leaves are not taken up again.
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
    ) -> Result<Self, DeviceError> {
        let spec = network.spec();
        let mut program = Program::new(Sizes::of(spec));
        program.add(&layers::PART);
        let mut plan = Plan::new();
        let weight_arrays = WeightArrays::new(&mut plan, network);
        let graph_arrays = GraphArrays::new(&mut plan, graph.vertex_count(), graph.arc_count());
        let steps = match extent {
            Extent::Whole => [spec.node_window(), spec.edge_window()],
            Extent::Newest => [1, 1],
        };
        let input = InputArrays::new(&mut plan, network, &graph_arrays, steps);
        let states = (extent == Extent::Newest)
            .then(|| [0, 1].map(|_| StateArrays::new(&mut plan, network, &graph_arrays)));
        let [start, end] = states.map_or([None, None], |states| states.map(Some));
        let mut schedule = Schedule::new("a forward pass");
        let pass = ForwardPass {
            network,
            weights: &weight_arrays,
            graph: &graph_arrays,
            input: &input,
            start: start.as_ref(),
            end: end.as_ref(),
            keep: Keep::Output,
        };
        let record = forward(&mut plan, &mut schedule, pass);
        let mut pack = Schedule::new("packing the weights");
        weight_arrays.pack(&mut pack);
        require_memory(device, "this network", plan.bytes(), |_| {
            "take fewer cloths or vertices at a time".to_owned()
        })?;
        let mut loaded = device.load(&program, &plan, precision)?;
        loaded.put(weight_arrays.flat(), weights)?;
        graph_arrays.upload(&mut *loaded, graph)?;
        for region in start.iter().flat_map(StateArrays::regions) {
            loaded.put(region, &vec![0.0; region.count()])?;
        }
        let packed = loaded.prepare(&pack)?;
        loaded.run(packed)?;
        Ok(Self {
            forward: loaded.prepare(&schedule)?,
            commands: schedule.len(),
            work: Work::of_all(&schedule),
            output: record.output,
            loaded,
            input,
            start,
        })
    }

    /// Kernels, products and copies of a pass.
    #[must_use]
    pub fn commands(&self) -> usize {
        self.commands
    }

    /// What a pass moves and multiplies.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Writes normalised features, of as many frames as the pass takes.
    ///
    /// # Errors
    /// When the device fails.
    pub fn put(&mut self, input: Input<'_, f32>) -> Result<(), DeviceError> {
        self.loaded.put(self.input.nodes, input.nodes)?;
        self.loaded.put(self.input.edges, input.edges)
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

    /// Normalised accelerations `[vertices, 3]` of the last pass.
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
    use crate::test_graphs::{host, numbers, specs, squares, weights};
    use selvedge_model::{EncoderState, PackedWeights, Pass, Purpose, Workspace};

    #[test]
    fn a_stream_goes_on_from_its_states_as_on_the_cpu() {
        let Some(host) = host() else { return };
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
                edges: &edges,
            };
            let using = selvedge_model::Instructions::Detected;
            let packed = PackedWeights::new(&network, &weights, Purpose::Inference, using);
            let state = EncoderState::filled(0.1, counts, spec.latent);
            let mut workspace = Workspace::new();
            let given = (input, &state);
            let pass = Pass::Inference;
            let expected = network.forward_carried(&packed, &graph, given, pass, &mut workspace);
            let both = (&network, &*weights);
            let precision = Precision::Full;
            let mut inference =
                Inference::new(&host, both, &graph, Extent::Newest, precision).expect("a network");
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
