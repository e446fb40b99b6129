//! A rollout slot: one place of the batch, which shows the network one sample per frame of a step.
//!
//! A slot starts a run at a random sample of ground truth. After each step, with probability 1 - p,
//! the model's own prediction becomes the current position of the next sample and the frames before
//! it shift along (scheduled sampling). Otherwise the next sample is ground truth again, drawn
//! afresh; so it is after `longest` predictions, at the end of the section, and too far from the
//! truth. With p = 1 this is a plain shuffle of all samples with replacement.
//!
//! Every random number follows from (seed, step, slot) alone.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use selvedge_data::Section;
use selvedge_model::{
    ClothGraph, Frames, InputGradient, LocalAcceleration, ModelSpec, Normalizers, TwoFrames,
    Window, Yaw, advance, advance_backward,
};
use serde::{Deserialize, Serialize};

use crate::config::{NoiseConfig, NoiseUnit, TrainConfig};
use crate::losses::Triplet;
use crate::training_set::TrainingSet;

/// The state of a slot between two steps; a checkpoint keeps all of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Slot {
    pub(crate) section: Section,
    /// The current frame of the next sample, if the run goes on.
    pub(crate) current: usize,
    /// Predictions in a row so far; 0: the next sample is drawn afresh.
    pub(crate) run: u32,
    /// World positions of the frame before the window and of the window, oldest first `[m]`;
    /// empty while `run` is 0. Copies of the slot share them.
    #[serde(skip)]
    pub(crate) history: Vec<Arc<Vec<Vec3>>>,
    /// What the expert makes of the next sample, where it was asked ahead of the step.
    #[serde(skip)]
    pub(crate) labels: Option<Vec<Vec<DVec3>>>,
}

/// A sample as the network and the losses see it.
#[derive(Clone, Debug, Default)]
pub struct ShownSample {
    pub(crate) trajectory: usize,
    /// The cloth in the step that it shows, where handles or air change over the motion.
    pub(crate) cloth: Option<Arc<ClothGraph>>,
    /// The local frame of the current positions.
    pub yaw: Yaw,
    /// World positions of the frame before the window and of the window, noise included `[m]`.
    pub frames: Vec<Vec<Vec3>>,
    /// Positions of the handles one frame later `[m]`, `[handles]`.
    pub next_handles: Vec<Vec3>,
    /// Previous, current and target positions in the local frame of the current ones `[m]`.
    pub local: [Vec<DVec3>; 3],
    /// Seed of the sample's dropout.
    pub dropout_seed: u64,
}

/// The physics behind a data set, for expert labels on the model's own states (`DAgger`, Ross et al.
/// 2011): the frames that it makes of a cloth that a rollout has led off the recorded motion.
pub trait Expert: Send + Sync {
    /// World positions after each of the next `frames` frames from `state` `[m]`, `[frames,
    /// vertices]`; none where the physics cannot go on from there.
    fn label(&self, state: ExpertState<'_>, frames: usize) -> Option<Vec<Vec<DVec3>>>;
}

/// A state to be labelled.
///
/// Two frames give the mean velocity between them. What the velocity has become at the end of the
/// second is taken from the recorded motion, whose frames about it are known.
#[derive(Clone, Copy, Debug)]
pub struct ExpertState<'a> {
    /// The number of the training trajectory.
    pub trajectory: usize,
    /// The number of its frame.
    pub frame: usize,
    /// World positions in the frame before and in this one `[m]`, `[vertices]`.
    pub positions: [&'a [Vec3]; 2],
    /// Recorded world positions two frames ago, in the frame before, in this one and one frame
    /// later `[m]`, `[vertices]`.
    pub recorded: [&'a [Vec3]; 4],
}

impl Slot {
    /// A slot that draws its first sample.
    pub(crate) fn new() -> Self {
        Self {
            section: Section {
                trajectory: 0,
                start: 0,
                end: 0,
            },
            current: 0,
            run: 0,
            history: Vec::new(),
            labels: None,
        }
    }

    /// Prepares the next sample.
    pub(crate) fn show(
        &mut self,
        cfg: &TrainConfig,
        set: &TrainingSet,
        rng: &mut ChaCha8Rng,
        shown: &mut ShownSample,
    ) {
        if self.run == 0 {
            self.draw(cfg, set, rng);
        }
        let motion = set.motion(self.section.trajectory);
        shown.cloth = motion.graph_in(self.current);
        let cloth = shown.cloth.clone();
        let graph = cloth.as_ref().unwrap_or(&motion.graph);
        shown.trajectory = self.section.trajectory;
        shown.dropout_seed = rng.next_u64();
        let truth = motion.frame(self.current as i64);
        let mut target: Vec<DVec3> = motion
            .frame(self.current as i64 + 1)
            .iter()
            .map(|p| p.as_dvec3())
            .collect();
        if self.run == 0 {
            let newest = self.history.len() - 1;
            let newest = Arc::make_mut(&mut self.history[newest]);
            add_noise(cfg, graph, rng, newest, &mut target);
        } else {
            let shift = 1.0 - cfg.scheduled_sampling.correction;
            let newest = &self.history[self.history.len() - 1];
            for ((target, now), truth) in target.iter_mut().zip(newest.iter()).zip(truth) {
                *target += shift * (now.as_dvec3() - truth.as_dvec3());
            }
        }
        shown.frames.resize_with(self.history.len(), Vec::new);
        for (to, frame) in shown.frames.iter_mut().zip(&self.history) {
            to.clone_from(frame);
        }
        let next = motion.frame(self.current as i64 + 1);
        shown.next_handles = graph.handles().select(next);
        shown.yaw = motion.yaw(self.current);
        self.to_local(graph, &target, shown);
    }

    /// Draws a sample of ground truth.
    fn draw(&mut self, cfg: &TrainConfig, set: &TrainingSet, rng: &mut ChaCha8Rng) {
        let number = rng.random_range(0..set.sample_count());
        let (sample, section) = set.sample(number);
        self.section = *section;
        self.current = sample.current;
        let motion = set.motion(sample.trajectory);
        let first = sample.current as i64 + 1 - cfg.model.history() as i64;
        let frames = first..=sample.current as i64;
        self.history = frames.map(|f| Arc::new(motion.frame(f).to_vec())).collect();
    }

    /// The first handle in the current positions, where local axes begin `[m]`.
    fn origin(&self, graph: &ClothGraph) -> DVec3 {
        let mut handles = graph.handles().of(&self.history[self.history.len() - 1]);
        handles.next().map_or(DVec3::ZERO, |p| p.as_dvec3())
    }

    /// Sets previous, current and target positions, in the local frame of the current ones.
    fn to_local(&self, graph: &ClothGraph, target: &[DVec3], shown: &mut ShownSample) {
        let newest = self.history.len() - 1;
        let (yaw, origin) = (shown.yaw, self.origin(graph));
        for (to, from) in shown.local.iter_mut().zip(&self.history[newest - 1..]) {
            let local = |p: &Vec3| yaw.to_local_f64(p.as_dvec3() - origin);
            to.clear();
            to.extend(from.iter().map(local));
        }
        let target = target.iter().map(|&p| yaw.to_local_f64(p - origin));
        shown.set_target(target);
    }

    /// Offset of the current positions from the truth, in local axes `[m]`, `[vertices]`.
    pub(crate) fn offset(&self, set: &TrainingSet, yaw: Yaw) -> Vec<DVec3> {
        let motion = set.motion(self.section.trajectory);
        let truth = motion.frame(self.current as i64);
        let rows = self.history[self.history.len() - 1].iter().zip(truth);
        rows.map(|(p, q)| yaw.to_local_f64(p.as_dvec3() - q.as_dvec3()))
            .collect()
    }

    /// Makes the truth plus `offset` (local `[m]`) the target of the sample.
    pub(crate) fn show_shifted(
        &self,
        set: &TrainingSet,
        offset: &[DVec3],
        shown: &mut ShownSample,
    ) {
        let motion = set.motion(self.section.trajectory);
        let truth = motion.frame(self.current as i64 + 1).iter().zip(offset);
        let (yaw, origin) = (shown.yaw, self.origin(&motion.graph));
        shown.set_target(truth.map(|(p, e)| yaw.to_local_f64(p.as_dvec3() - origin) + *e));
    }

    /// True where the sample is off the recorded motion: led there by the model, or by noise.
    pub(crate) fn is_off(&self, cfg: &TrainConfig) -> bool {
        self.run > 0 || cfg.noise.deviation > 0.0
    }

    /// The state of the sample, for the physics.
    pub(crate) fn expert_state<'a>(&'a self, set: &'a TrainingSet) -> ExpertState<'a> {
        let motion = set.motion(self.section.trajectory);
        let count = self.history.len();
        let frame = self.current as i64;
        ExpertState {
            trajectory: self.section.trajectory,
            frame: self.current,
            positions: [&self.history[count - 2], &self.history[count - 1]],
            recorded: [-2, -1, 0, 1].map(|after| motion.frame(frame + after)),
        }
    }

    /// Makes `label` (world positions `[m]`) the target of the sample.
    pub(crate) fn show_label(&self, set: &TrainingSet, label: &[DVec3], shown: &mut ShownSample) {
        let origin = self.origin(&set.motion(self.section.trajectory).graph);
        let yaw = shown.yaw;
        shown.set_target(label.iter().map(|&p| yaw.to_local_f64(p - origin)));
    }

    /// The part of the distance to the truth that the target of the sample takes back.
    pub(crate) fn correction(&self, cfg: &TrainConfig) -> f64 {
        match self.run {
            0 => cfg.noise.correction,
            _ => cfg.scheduled_sampling.correction,
        }
    }

    /// Draws whether the next sample is ground truth again: with the probability of the step, and
    /// always when the run is long enough.
    pub(crate) fn returns_to_truth(
        &self,
        cfg: &TrainConfig,
        step: u64,
        rng: &mut ChaCha8Rng,
    ) -> bool {
        let sampling = &cfg.scheduled_sampling;
        let is_drawn = rng.random::<f64>() < sampling.truth.at(step);
        is_drawn || self.run >= sampling.longest
    }

    /// Makes the next sample ground truth, drawn afresh.
    pub(crate) fn start_afresh(&mut self) {
        self.run = 0;
        self.history.clear();
    }

    /// Goes on from `sample` with the prediction `acceleration` (local, `[m/frame²]`,
    /// `[vertices, 3]`). At the end of the section, or too far from `label` (world positions `[m]`)
    /// or where there is none from the recorded motion, the slot starts afresh instead. Returns
    /// whether it went on.
    pub(crate) fn follow(
        &mut self,
        cfg: &TrainConfig,
        set: &TrainingSet,
        sample: &ShownSample,
        acceleration: &[f32],
        label: Option<&[DVec3]>,
    ) -> bool {
        let next = self.current + 1;
        if !TrainingSet::section_has(&self.section, next) {
            self.start_afresh();
            return false;
        }
        let motion = set.motion(self.section.trajectory);
        let newest = self.history.len() - 1;
        let mut predicted = vec![Vec3::ZERO; motion.graph.vertex_count()];
        let frames = TwoFrames {
            graph: sample.graph(&motion.graph),
            previous: &self.history[newest - 1],
            current: &self.history[newest],
        };
        let acceleration = LocalAcceleration {
            yaw: sample.yaw,
            rows: acceleration,
        };
        let handles = &sample.next_handles;
        let is_finite = advance(&frames, handles, acceleration, &mut predicted).is_ok();
        let farthest = cfg.scheduled_sampling.farthest as f32;
        let is_near = match label {
            Some(label) => {
                (predicted.iter().zip(label)).all(|(p, q)| p.distance(q.as_vec3()) <= farthest)
            }
            None => (predicted.iter().zip(motion.frame(next as i64)))
                .all(|(p, q)| p.distance(*q) <= farthest),
        };
        if !is_finite || !is_near {
            self.start_afresh();
            return false;
        }
        self.history.rotate_left(1);
        self.history[newest] = Arc::new(predicted);
        self.current = next;
        self.run += 1;
        true
    }
}

/// Slots as bytes, to travel from the rank that moves them to the one that writes checkpoints.
pub(crate) fn pack_slots(slots: &[Slot]) -> Vec<u8> {
    let with_history = |slot: &Slot| -> (Slot, Vec<Vec<Vec3>>) {
        let history = slot.history.iter().map(|frame| frame.to_vec());
        (slot.clone(), history.collect())
    };
    let slots: Vec<_> = slots.iter().map(with_history).collect();
    // Finite numbers always have a text; whoever reads no slots says so.
    serde_json::to_vec(&slots).unwrap_or_default()
}

/// Slots from their bytes; none where these are of something else.
pub(crate) fn unpack_slots(bytes: &[u8]) -> Option<Vec<Slot>> {
    let slots: Vec<(Slot, Vec<Vec<Vec3>>)> = serde_json::from_slice(bytes).ok()?;
    let whole = |(slot, history): (Slot, Vec<Vec<Vec3>>)| Slot {
        history: history.into_iter().map(Arc::new).collect(),
        ..slot
    };
    Some(slots.into_iter().map(whole).collect())
}

/// The random stream of slot `slot` of `slots` in step `step`.
pub(crate) fn rng_of(seed: u64, step: u64, slot: usize, slots: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Stream 0 is for the weights.
    rng.set_stream(1 + step * slots as u64 + slot as u64);
    rng
}

/// Adds noise n to the newest positions of free vertices and (1 - γ) n to their targets.
fn add_noise(
    cfg: &TrainConfig,
    graph: &ClothGraph,
    rng: &mut impl Rng,
    newest: &mut [Vec3],
    target: &mut [DVec3],
) {
    let NoiseConfig {
        deviation,
        unit: NoiseUnit::Metre,
        correction,
    } = cfg.noise;
    if deviation == 0.0 {
        return;
    }
    let rows = newest.iter_mut().zip(target).zip(graph.handle_mask());
    for ((now, target), _) in rows.filter(|(_, handle)| !**handle) {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let noise = deviation * DVec3::new(normal(), normal(), normal());
        *now = (now.as_dvec3() + noise).as_vec3();
        *target += (1.0 - correction) * noise;
    }
}

impl ShownSample {
    /// Sets the target, in the local frame of the current positions `[m]`.
    fn set_target(&mut self, positions: impl Iterator<Item = DVec3>) {
        let [_, _, target] = &mut self.local;
        target.clear();
        target.extend(positions);
    }

    /// The cloth in the step that it shows; `whole` is that of its trajectory.
    pub fn graph<'a>(&'a self, whole: &'a ClothGraph) -> &'a ClothGraph {
        self.cloth.as_deref().unwrap_or(whole)
    }

    /// The sample for the features.
    pub fn window(&self) -> Frames<'_, Vec<Vec3>> {
        Frames {
            positions: &self.frames,
            next_handles: &self.next_handles,
            yaw: self.yaw,
        }
    }

    /// The sample for the losses.
    pub fn triplet<'a>(&'a self, graph: &'a ClothGraph) -> Triplet<'a> {
        let [previous, current, target] = &self.local;
        Triplet {
            graph,
            previous,
            current,
            target,
        }
    }

    /// Joins the gradient `rows` (`[vertices, 3]`) of this frame's own loss, times `weight`, with
    /// the gradient `by_next` of the predicted positions in later frames. Afterwards `rows` are the
    /// whole gradient of the prediction, and `by_next` that of the predicted positions.
    pub fn join_gradient(
        &self,
        graph: &ClothGraph,
        normalizers: &Normalizers,
        weight: f32,
        rows: &mut [f32],
        by_next: &mut [Vec3],
    ) {
        let deviation = DVec3::from_slice(normalizers.acceleration.deviation()).as_vec3();
        let inverse = deviation.map(|d| if d > 0.0 { 1.0 / d } else { 0.0 });
        let rows = rows.as_chunks_mut::<3>().0.iter_mut();
        for ((row, by_next), &handle) in rows.zip(by_next).zip(graph.handle_mask()) {
            if handle {
                *by_next = Vec3::ZERO;
            }
            let own = weight * Vec3::from_array(*row);
            *row = (own + deviation * self.yaw.to_local(*by_next)).to_array();
            *by_next += self.yaw.to_world(own * inverse);
        }
    }

    /// Adds to the gradients of the positions that the prediction was made from: through the
    /// integration, from that of the predicted ones, which is the last of `positions`, and through
    /// the features, from that of the normalised features, which is scaled on the way.
    pub fn positions_backward(
        &self,
        spec: &ModelSpec,
        graph: &ClothGraph,
        normalizers: &Normalizers,
        features: InputGradient<'_, f32>,
        positions: &mut [Vec<Vec3>],
    ) {
        normalizers.nodes.scale_gradient(features.nodes);
        normalizers.edges.scale_gradient(features.arcs);
        let (by_history, by_next) = positions.split_at_mut(spec.history());
        Window::backward(spec, graph, self.window(), &features, by_history);
        let newest = by_history.len() - 1;
        let (earlier, current) = by_history.split_at_mut(newest);
        advance_backward(&by_next[0], &mut earlier[newest - 1], &mut current[0]);
    }
}

#[cfg(test)]
mod tests;
