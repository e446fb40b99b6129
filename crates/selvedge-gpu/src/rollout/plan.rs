//! The memory and the schedules of a rollout, made before anything is allocated.

use selvedge_model::{ClothGraph, Model, Network};

use crate::cloths::features::{FeatureSources, NormalizerArrays, features};
use crate::cloths::frames::FrameArrays;
use crate::cloths::motion;
use crate::cloths::{ClothArrays, UnionSizes};
use crate::device::{DeviceError, Loaded, largest_fit};
use crate::kernels::{self, Program, Sizes};
use crate::network::{ForwardPass, InputArrays, Keep, WeightArrays, forward};
use crate::schedule::Schedule;
use crate::schedule::plan::{Plan, Region};

/// The memory, the kernels and the schedules of a rollout of a network on a union.
pub struct RolloutPlan {
    /// The memory.
    pub plan: Plan,
    /// The kernels.
    pub program: Program,
    /// The weights.
    pub weights: WeightArrays,
    /// The cloths.
    pub cloths: ClothArrays,
    /// The arrays that change from frame to frame.
    pub frames: FrameArrays,
    /// The statistics.
    pub normalizers: NormalizerArrays,
    /// To run once, after the weights were written.
    pub pack: Schedule,
    /// A frame.
    pub frame: Schedule,
}

impl RolloutPlan {
    /// The plan for a network on cloths of these sizes.
    #[must_use]
    pub fn new(network: &Network, sizes: UnionSizes) -> Self {
        let spec = network.spec();
        let mut program = Program::new(Sizes::of(spec));
        program.add(&kernels::layers::PART);
        kernels::features::define(&mut program, spec);
        program.add(&kernels::motion::PART);
        let mut plan = Plan::new();
        let weights = WeightArrays::new(&mut plan, network);
        let cloths = ClothArrays::new(&mut plan, sizes);
        let mut built = Self {
            frames: FrameArrays::new(&mut plan, spec, sizes),
            normalizers: NormalizerArrays::new(&mut plan, spec),
            pack: Schedule::new("packing the weights"),
            frame: Schedule::new("a frame"),
            plan,
            program,
            weights,
            cloths,
        };
        built.weights.pack(&mut built.pack);
        built.add_frame(network);
        built
    }

    /// Adds the schedule of a frame.
    fn add_frame(&mut self, network: &Network) {
        let schedule = &mut self.frame;
        let mark = self.plan.mark();
        let graph = &self.cloths.graph;
        let input = InputArrays::new(&mut self.plan, network, graph);
        let sources = FeatureSources {
            cloths: &self.cloths,
            frames: &self.frames,
            normalizers: &self.normalizers,
        };
        features(schedule, sources, &input);
        let pass = ForwardPass {
            network,
            weights: &self.weights,
            graph,
            input: &input,
            keep: Keep::Output,
        };
        let record = forward(&mut self.plan, schedule, pass);
        motion::advance(schedule, sources, record.output);
        self.plan.release(mark);
    }

    /// Writes the arrays that do not change.
    ///
    /// # Errors
    /// When the device fails.
    ///
    /// # Panics
    /// When the cloths have other sizes.
    pub fn upload(
        &self,
        loaded: &mut dyn Loaded,
        model: &Model,
        graphs: &[&ClothGraph],
    ) -> Result<(), DeviceError> {
        loaded.put(self.weights.flat(), model.weights())?;
        self.normalizers.upload(loaded, model.normalizers())?;
        self.cloths.upload(loaded, graphs)
    }

    /// The arrays that are written from outside before a frame.
    #[must_use]
    pub fn given(&self) -> Vec<Region> {
        let mut given = vec![self.weights.flat()];
        given.extend(self.cloths.regions());
        given.extend(self.frames.regions());
        given.extend(self.normalizers.regions());
        given
    }
}

/// The part of a union that fits into `free` bytes, in words.
pub(super) fn what_fits(network: &Network, sizes: UnionSizes, free: usize) -> String {
    let part = |thousandths: usize| {
        let of = |count: usize| (count * thousandths).div_ceil(1000);
        UnionSizes {
            vertices: of(sizes.vertices),
            arcs: of(sizes.arcs),
            faces: of(sizes.faces),
            handles: of(sizes.handles),
            ..sizes
        }
    };
    let fits =
        |thousandths: usize| RolloutPlan::new(network, part(thousandths)).plan.bytes() <= free;
    match largest_fit(1000, fits) {
        0 => "not even a thousandth of it would fit".to_owned(),
        low => format!(
            "about {} vertices would fit, instead of {}",
            sizes.vertices * low / 1000,
            sizes.vertices
        ),
    }
}
