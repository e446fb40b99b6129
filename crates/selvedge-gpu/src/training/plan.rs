//! The memory and the schedules of a training, made before anything is allocated.

use selvedge_model::{ModelSpec, Network};
use selvedge_train::TrainConfig;

use super::slot_arrays::union_sizes;
use crate::cloths::ClothArrays;
use crate::cloths::features::{FeatureSources, NormalizerArrays, features};
use crate::cloths::features_backward::FrameBack;
use crate::cloths::frames::FrameArrays;
use crate::cloths::losses::{self, Judged, LossArrays, SlotSizes, TERMS, TripletArrays};
use crate::kernels::{self, Program, Sizes, layers};
use crate::network::{
    BackwardPass, Dropout, DropoutSizes, ForwardPass, InputArrays, Keep, OUTPUTS, Record,
    WeightArrays, backward, forward,
};
use crate::schedule::Schedule;
use crate::schedule::plan::{Plan, Region};
use crate::training::adam::AdamArrays;

/// One of the frames that a step goes through.
pub struct FramePlan {
    /// Sources of its features.
    pub frames: FrameArrays,
    /// Slot of its newest positions.
    pub newest: usize,
    /// Positions that it is judged by.
    pub triplet: TripletArrays,
    /// Its dropout, where the configuration asks for one.
    pub dropout: Option<Dropout>,
    /// Weight of each slot in the loss, `[slots]`.
    pub weights: Region,
    /// Loss terms of each slot, `[slots, 5]`.
    pub terms: Region,
    /// Its prediction, normalised, `[vertices, 3]`.
    pub output: Region,
    /// From positions to terms.
    pub forward: Schedule,
    /// From the terms to the gradient of the weights, and of the positions before.
    pub backward: Schedule,
}

/// Memory and schedules of a training.
pub struct TrainingPlan {
    /// The memory.
    pub plan: Plan,
    /// The kernels.
    pub program: Program,
    /// The weights.
    pub weights: WeightArrays,
    /// Their gradient.
    pub gradient: Region,
    /// Ones, for sums.
    pub ones: Region,
    /// The optimiser.
    pub adam: AdamArrays,
    /// The cloths of the slots.
    pub cloths: ClothArrays,
    /// The arrays of the losses.
    pub losses: LossArrays,
    /// The statistics.
    pub normalizers: NormalizerArrays,
    /// Positions of the ring of frames, `[frames, vertices, 3]`.
    pub positions: Region,
    /// The frames, in order.
    pub frames: Vec<FramePlan>,
    /// To run once, after the weights were written.
    pub pack: Schedule,
    /// To run before the first frame of a step goes back.
    pub begin: Schedule,
    /// To run after all frames have gone back.
    pub update: Schedule,
}

/// Parts that the frames of a step share while they are planned.
struct Shared<'a> {
    network: &'a Network,
    /// The most frames of a step.
    most: usize,
    /// The rate of dropout.
    rate: f64,
    /// The gradient of the ring of positions, where there are several frames.
    by_position: Option<Region>,
}

/// Room of a frame beside the arrays that are written from outside.
struct Room {
    input: InputArrays,
    output_gradient: Region,
}

impl TrainingPlan {
    /// The plan for a configuration, for cloths that fit into slots of one size.
    #[must_use]
    pub fn new(cfg: &TrainConfig, network: &Network, slot: SlotSizes) -> Self {
        let (spec, slots) = (network.spec(), cfg.batch.samples);
        let most = cfg.unroll.most();
        let sizes = union_sizes(slots, slot);
        let mut plan = Plan::new();
        let ring = spec.history() + most;
        let positions = plan.floats("positions", ring * sizes.vertices * 3);
        let weights = WeightArrays::new(&mut plan, network);
        let parameters = network.parameter_count();
        let mut built = Self {
            program: program(spec),
            gradient: plan.floats("gradient", parameters),
            ones: plan.floats("ones", sizes.vertices.max(sizes.arcs)),
            adam: AdamArrays::new(&mut plan, parameters),
            cloths: ClothArrays::new(&mut plan, sizes),
            losses: LossArrays::new(&mut plan, slots, slot),
            normalizers: NormalizerArrays::new(&mut plan, spec),
            weights,
            positions,
            frames: Vec::with_capacity(most),
            pack: Schedule::new("packing the weights"),
            begin: Schedule::new("the beginning of a step"),
            update: Schedule::new("a step of the optimiser"),
            plan,
        };
        if cfg.weight_average.is_some() {
            built.adam = built.adam.with_mean(&mut built.plan);
        }
        built.weights.pack(&mut built.pack);
        built.begin.clear(built.gradient);
        let by_position = (most > 1).then(|| {
            let size = positions.count();
            built.plan.floats("gradient of positions", size)
        });
        if let Some(by_position) = by_position {
            built.begin.clear(by_position);
        }
        built.add_frames(&Shared {
            network,
            most,
            rate: cfg.dropout,
            by_position,
        });
        let (weights, gradient) = (built.weights.flat(), built.gradient);
        built
            .adam
            .step(&mut built.plan, &mut built.update, weights, gradient);
        built.weights.pack(&mut built.update);
        built
    }

    fn add_frames(&mut self, shared: &Shared<'_>) {
        let most = shared.most;
        // Arrays that are written from outside come first: no other array may take their place.
        let mut rooms: Vec<Room> = Vec::with_capacity(most);
        for number in 0..most {
            let (frame, room) = self.room(shared, number);
            self.frames.push(frame);
            rooms.push(room);
        }
        let records: Vec<Record> = rooms
            .iter()
            .enumerate()
            .map(|(number, room)| self.forth(shared, number, room))
            .collect();
        let mark = self.plan.mark();
        for number in (0..most).rev() {
            let (room, record) = (&rooms[number], &records[number]);
            self.frames[number].backward = self.back(shared, number, room, record);
            self.plan.release(mark);
        }
    }

    /// Room for frame `number`.
    fn room(&mut self, shared: &Shared<'_>, number: usize) -> (FramePlan, Room) {
        let (network, spec) = (shared.network, shared.network.spec());
        let (plan, graph, sizes) = (&mut self.plan, self.cloths.graph, self.cloths.sizes);
        let slot = self.losses.slot;
        let dropout = DropoutSizes {
            slots: sizes.cloths,
            slot: [slot.vertices, slot.arcs],
            steps: spec.window(),
        };
        let frame = FramePlan {
            frames: FrameArrays::on(plan, sizes, self.positions),
            newest: spec.history() - 1 + number,
            triplet: TripletArrays::new(plan, sizes.vertices),
            dropout: Dropout::new(plan, shared.rate, dropout),
            weights: plan.floats("weights of slots", sizes.cloths),
            terms: plan.doubles("terms of losses", sizes.cloths * TERMS),
            output: self.positions.part(0..0),
            forward: Schedule::new("a frame forward"),
            backward: Schedule::default(),
        };
        let room = Room {
            input: InputArrays::new(plan, network, &graph),
            output_gradient: plan.floats("gradient of the output", sizes.vertices * OUTPUTS),
        };
        (frame, room)
    }

    /// Frame `number` up to its terms.
    fn forth(&mut self, shared: &Shared<'_>, number: usize, room: &Room) -> Record {
        let (graph, frame) = (self.cloths.graph, &self.frames[number]);
        let mut schedule = Schedule::new("a frame forward");
        features(&mut schedule, self.sources(&frame.frames), &room.input);
        let pass = ForwardPass {
            network: shared.network,
            weights: &self.weights,
            graph: &graph,
            input: &room.input,
            keep: Keep::Activations(frame.dropout),
        };
        let record = forward(&mut self.plan, &mut schedule, pass);
        let what = Judged {
            cloths: &self.cloths,
            triplet: &frame.triplet,
            predicted: record.output,
            gradient: room.output_gradient,
            terms: frame.terms,
        };
        losses::judge(&mut self.plan, &mut schedule, &self.losses, what);
        self.frames[number].output = record.output;
        self.frames[number].forward = schedule;
        record
    }

    fn sources<'a>(&'a self, frames: &'a FrameArrays) -> FeatureSources<'a> {
        FeatureSources {
            cloths: &self.cloths,
            frames,
            normalizers: &self.normalizers,
        }
    }

    /// Frame `number` back.
    fn back(
        &mut self,
        shared: &Shared<'_>,
        number: usize,
        room: &Room,
        record: &Record,
    ) -> Schedule {
        let mut schedule = Schedule::new("a frame backward");
        let (graph, frame) = (self.cloths.graph, &self.frames[number]);
        let (dropout, frames) = (frame.dropout, frame.frames);
        let (gradient, newest) = (room.output_gradient, frame.newest);
        losses::weigh(&mut schedule, &self.losses, gradient, frame.weights);
        let positions = shared.by_position.map(|by_position| (by_position, newest));
        // The positions before the first frame are given: they need no gradient.
        let to_input =
            (number > 0).then(|| InputArrays::new(&mut self.plan, shared.network, &graph));
        let from = FeatureSources {
            cloths: &self.cloths,
            frames: &frames,
            normalizers: &self.normalizers,
        };
        let back = positions.map(|(by_position, newest)| FrameBack {
            from,
            losses: &self.losses,
            by_position,
            newest,
        });
        if let Some(back) = &back {
            back.join(&mut schedule, gradient);
        }
        let pass = BackwardPass {
            network: shared.network,
            weights: &self.weights,
            gradient: self.gradient,
            ones: self.ones,
            graph: &graph,
            input: &room.input,
            record,
            dropout,
            output: gradient,
            to_input: to_input.as_ref(),
        };
        backward(&mut self.plan, &mut schedule, &pass);
        if let (Some(back), Some(to_input)) = (back, to_input) {
            back.to_positions(&mut self.plan, &mut schedule, &to_input);
        }
        schedule
    }

    /// The arrays that are written from outside before a step.
    #[must_use]
    pub fn given(&self) -> Vec<Region> {
        let mut given = vec![self.weights.flat(), self.ones, self.positions];
        given.extend(self.adam.regions());
        given.extend(self.cloths.regions());
        given.extend(self.losses.regions());
        given.extend(self.normalizers.regions());
        for frame in &self.frames {
            given.extend(frame.frames.regions());
            given.extend(frame.triplet.regions());
            given.push(frame.weights);
            if let Some(dropout) = &frame.dropout {
                given.extend(dropout.seeds);
            }
        }
        given
    }
}

/// The kernels of a training.
pub(crate) fn program(spec: &ModelSpec) -> Program {
    let mut program = Program::new(Sizes::of(spec));
    program.add(&layers::PART);
    kernels::features::define(&mut program, spec);
    program.add(&kernels::losses::PART);
    program.add(&kernels::backward::PART);
    program.add(&kernels::features_backward::PART);
    kernels::adam::define(&mut program);
    program
}
