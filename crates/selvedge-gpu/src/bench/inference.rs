//! A network's forward pass on a device, on given features: compared with the processor's engine,
//! and measured beside other programs.

use selvedge_model::{Input, Network};

use crate::bench::case::{GraphSizes, Layout, NetworkArrays, NetworkCase, load};
use crate::device::{Device, DeviceError, Loaded, Precision, Prepared};
use crate::kernels::layers;
use crate::kernels::{Program, Sizes};
use crate::network::{ForwardPass, Keep, forward};
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
    fn new(network: &Network, sizes: GraphSizes) -> Self {
        let mut program = Program::new(Sizes::of(network.spec()));
        program.add(&layers::PART);
        let mut plan = Plan::new();
        let arrays = NetworkArrays::new(&mut plan, network, sizes);
        let mut schedule = Schedule::new("a forward pass");
        let pass = ForwardPass {
            network,
            weights: &arrays.weights,
            graph: &arrays.graph,
            input: &arrays.input,
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
