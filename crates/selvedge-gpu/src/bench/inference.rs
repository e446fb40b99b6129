//! A network's forward pass on a device, on features that somebody else has made: what is compared
//! with the CPU engine, and measured beside other programs.

use selvedge_model::{Connectivity, Extent, Input, Network};

use crate::bench::profile::Work;
use crate::device::{
    Device, DeviceError, Loaded, Precision, Prepared, require_memory, vertices_that_fit,
};
use crate::kernels::layers;
use crate::kernels::{Program, Sizes};
use crate::network::{
    ForwardPass, GraphArrays, InputArrays, Keep, StateArrays, WeightArrays, forward,
};
use crate::schedule::Schedule;
use crate::schedule::plan::{Plan, Region};

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

/// Where everything lies and what is done.
struct Layout {
    plan: Plan,
    program: Program,
    weights: WeightArrays,
    graph: GraphArrays,
    input: InputArrays,
    start: Option<StateArrays>,
    output: Region,
    pack: Schedule,
    forward: Schedule,
}

impl Layout {
    fn new(network: &Network, [vertices, arcs]: [usize; 2], extent: Extent) -> Self {
        let spec = network.spec();
        let mut program = Program::new(Sizes::of(spec));
        program.add(&layers::PART);
        let mut plan = Plan::new();
        let weights = WeightArrays::new(&mut plan, network);
        let graph = GraphArrays::new(&mut plan, vertices, arcs);
        let steps = match extent {
            Extent::Whole => [spec.node_window(), spec.edge_window()],
            Extent::Newest => [1, 1],
        };
        let input = InputArrays::new(&mut plan, network, &graph, steps);
        let states = (extent == Extent::Newest)
            .then(|| [0, 1].map(|_| StateArrays::new(&mut plan, network, &graph)));
        let [start, end] = states.map_or([None, None], |states| states.map(Some));
        let mut schedule = Schedule::new("a forward pass");
        let pass = ForwardPass {
            network,
            weights: &weights,
            graph: &graph,
            input: &input,
            start: start.as_ref(),
            end: end.as_ref(),
            keep: Keep::Output,
        };
        let output = forward(&mut plan, &mut schedule, pass).output;
        let mut pack = Schedule::new("packing the weights");
        weights.pack(&mut pack);
        Self {
            plan,
            program,
            weights,
            graph,
            input,
            start,
            output,
            pack,
            forward: schedule,
        }
    }
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
        for region in layout.start.iter().flat_map(StateArrays::regions) {
            loaded.put(region, &vec![0.0; region.count()])?;
        }
        let packed = loaded.prepare(&layout.pack)?;
        loaded.run(packed)?;
        Ok(Self {
            forward: loaded.prepare(&layout.forward)?,
            commands: layout.forward.len(),
            work: Work::of_all(&layout.forward),
            output: layout.output,
            loaded,
            input: layout.input,
            start: layout.start,
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

    /// As [`Loaded::unrecorded`].
    #[must_use]
    pub fn unrecorded(&self) -> Option<&str> {
        self.loaded.unrecorded()
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
    use crate::test_graphs::{device, numbers, specs, squares, weights};
    use selvedge_model::{EncoderState, PackedWeights, Pass, Purpose, Workspace};

    #[test]
    fn a_stream_goes_on_from_its_states_as_on_the_cpu() {
        let Some(device) = device() else { return };
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
                Inference::new(device, both, &graph, Extent::Newest, precision).expect("a network");
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
