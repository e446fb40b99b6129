//! A slot: one place of the batch, which shows the network one sample per step.
//!
//! A slot starts a run at a random sample of ground truth. After each step, with probability
//! 1 - p, the model's own prediction becomes the current position of the next sample and the frames
//! before it shift along (scheduled sampling); else, and at the latest after `longest` predictions
//! or at the end of the section, the next sample is ground truth again, drawn afresh. With
//! p = 1 this is a plain shuffle of all samples with replacement.
//!
//! Every random number follows from (seed, step, slot) alone.

use glam::{DVec3, Vec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use selvedge_data::Section;
use selvedge_model::{ClothGraph, Frames, Yaw, integrate};

use crate::config::{NoiseConfig, NoiseUnit, TrainConfig};
use crate::losses::Triplet;
use crate::training_set::TrainingSet;

/// Where a slot stands between two steps; all that a checkpoint keeps of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Slot {
    pub(crate) section: Section,
    /// The current frame of the sample to come, if the run goes on.
    pub(crate) current: usize,
    /// Predictions in a row so far; 0: the next sample is drawn afresh.
    pub(crate) run: u32,
    /// World positions of the frame before the window and of the window, oldest first `[m]`;
    /// empty while `run` is 0.
    pub(crate) history: Vec<Vec<Vec3>>,
}

/// What the network is shown in one step.
pub struct ShownSample {
    pub(crate) trajectory: usize,
    /// The local frame of the current positions.
    pub yaw: Yaw,
    /// World positions of the frame before the window and of the window, noise included `[m]`.
    pub frames: Vec<Vec<Vec3>>,
    /// Where the handles go `[m]`, `[handles]`.
    pub next_handles: Vec<Vec3>,
    /// Previous, current and target positions in the local frame of the current ones `[m]`.
    pub local: [Vec<DVec3>; 3],
    /// Decides what is dropped of this sample.
    pub dropout_seed: u64,
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
        }
    }

    /// Prepares the sample of this step.
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
        let graph = &*motion.graph;
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
            add_noise(cfg, graph, rng, (&mut self.history[newest], &mut target));
        } else {
            let shift = 1.0 - cfg.scheduled_sampling.correction;
            let newest = &self.history[self.history.len() - 1];
            for ((target, now), truth) in target.iter_mut().zip(newest).zip(truth) {
                *target += shift * (now.as_dvec3() - truth.as_dvec3());
            }
        }
        shown.frames.clone_from(&self.history);
        let next = motion.frame(self.current as i64 + 1);
        shown.next_handles = graph.handles().select(next);
        self.to_local(cfg, set, &target, shown);
    }

    /// Any sample of ground truth.
    fn draw(&mut self, cfg: &TrainConfig, set: &TrainingSet, rng: &mut ChaCha8Rng) {
        let number = rng.random_range(0..set.sample_count());
        let (sample, section) = set.sample(number);
        self.section = *section;
        self.current = sample.current;
        let motion = set.motion(sample.trajectory);
        let first = sample.current as i64 + 1 - cfg.model.history() as i64;
        let frames = first..=sample.current as i64;
        self.history = frames.map(|f| motion.frame(f).to_vec()).collect();
    }

    /// Previous, current and target positions in the local frame of the current ones.
    fn to_local(
        &self,
        cfg: &TrainConfig,
        set: &TrainingSet,
        target: &[DVec3],
        shown: &mut ShownSample,
    ) {
        let graph = &*set.motion(self.section.trajectory).graph;
        let current = &self.history[self.history.len() - 1];
        let handles = graph.handles().select(current);
        let yaw = graph.frame().yaw(&handles, graph.frame().rest_yaw());
        let previous = self.reference(cfg, set, yaw);
        let origin = handles.first().map_or(DVec3::ZERO, |p| p.as_dvec3());
        let local = |p: DVec3| yaw.to_local_f64(p - origin);
        let [to_previous, to_current, to_target] = &mut shown.local;
        to_previous.clear();
        to_previous.extend(previous.iter().map(|p| local(p.as_dvec3())));
        to_current.clear();
        to_current.extend(current.iter().map(|p| local(p.as_dvec3())));
        to_target.clear();
        to_target.extend(target.iter().map(|&p| local(p)));
        shown.yaw = yaw;
    }

    /// The previous positions that the acceleration is added to uniform motion from: the true ones,
    /// or those of another [`selvedge_model::Integration`].
    fn reference(&self, cfg: &TrainConfig, set: &TrainingSet, yaw: Yaw) -> Vec<Vec3> {
        let motion = set.motion(self.section.trajectory);
        let count = self.history.len();
        let frames = [&*self.history[count - 2], &*self.history[count - 1]];
        let next = motion.frame(self.current as i64 + 1);
        let next_handles = motion.graph.handles().select(next);
        let mut reference = Vec::new();
        let integration = cfg.model.integration;
        integration.reference(&motion.graph, frames, &next_handles, yaw, &mut reference);
        reference
    }

    /// How far the current positions are from the truth, in local axes `[m]`, `[vertices]`.
    pub(crate) fn offset(&self, set: &TrainingSet, yaw: Yaw) -> Vec<DVec3> {
        let motion = set.motion(self.section.trajectory);
        let truth = motion.frame(self.current as i64);
        let rows = self.history[self.history.len() - 1].iter().zip(truth);
        rows.map(|(p, q)| yaw.to_local_f64(p.as_dvec3() - q.as_dvec3()))
            .collect()
    }

    /// How much farther from the truth than a frame before, in local axes `[m/frame]`, `[vertices]`; 0
    /// where it is the truth, with or without noise.
    pub(crate) fn offset_velocity(&self, set: &TrainingSet, yaw: Yaw) -> Vec<DVec3> {
        let motion = set.motion(self.section.trajectory);
        if self.run == 0 {
            return vec![DVec3::ZERO; motion.graph.vertex_count()];
        }
        let (count, frame) = (self.history.len(), self.current as i64);
        let apart = |positions: &[Vec3], frame: i64| -> Vec<DVec3> {
            let rows = positions.iter().zip(motion.frame(frame));
            rows.map(|(p, q)| p.as_dvec3() - q.as_dvec3()).collect()
        };
        let now = apart(&self.history[count - 1], frame);
        let before = apart(&self.history[count - 2], frame - 1);
        let rows = now.iter().zip(before);
        rows.map(|(now, before)| yaw.to_local_f64(*now - before))
            .collect()
    }

    /// Makes the truth plus `offset` (local `[m]`) the target of what is shown.
    pub(crate) fn aim(&self, set: &TrainingSet, offset: &[DVec3], shown: &mut ShownSample) {
        let motion = set.motion(self.section.trajectory);
        let current = &self.history[self.history.len() - 1];
        let handles = motion.graph.handles().select(current);
        let origin = handles.first().map_or(DVec3::ZERO, |p| p.as_dvec3());
        let truth = motion.frame(self.current as i64 + 1).iter().zip(offset);
        let yaw = shown.yaw;
        let [_, _, target] = &mut shown.local;
        target.clear();
        target.extend(truth.map(|(p, e)| yaw.to_local_f64(p.as_dvec3() - origin) + *e));
    }

    /// The part of the distance to the truth that the target of the sample to come takes back.
    pub(crate) fn correction(&self, cfg: &TrainConfig) -> f64 {
        match self.run {
            0 => cfg.noise.correction,
            _ => cfg.scheduled_sampling.correction,
        }
    }

    /// Starts afresh with the probability of `step`, or when the run is long enough.
    pub(crate) fn break_off(&mut self, cfg: &TrainConfig, (step, rng): (u64, &mut ChaCha8Rng)) {
        let sampling = &cfg.scheduled_sampling;
        let uses_truth = rng.random::<f64>() < sampling.truth.at(step);
        if uses_truth || self.run >= sampling.longest {
            self.start_afresh();
        }
    }

    fn start_afresh(&mut self) {
        self.run = 0;
        self.history.clear();
    }

    /// Decides how the slot goes on after the network predicted `acceleration` (local, `[m/frame²]`,
    /// `[vertices, 3]`).
    pub(crate) fn advance(
        &mut self,
        cfg: &TrainConfig,
        set: &TrainingSet,
        (step, rng): (u64, &mut ChaCha8Rng),
        yaw: Yaw,
        acceleration: &[f32],
    ) {
        let uses_truth = rng.random::<f64>() < cfg.scheduled_sampling.truth.at(step);
        if uses_truth || self.run >= cfg.scheduled_sampling.longest {
            self.start_afresh();
        } else {
            self.follow(cfg, set, yaw, acceleration);
        }
    }

    /// Goes on with the prediction `acceleration` (local, `[m/frame²]`, `[vertices, 3]`); at the end
    /// of the section or too far from the truth it starts afresh instead. Whether it went on.
    pub(crate) fn follow(
        &mut self,
        cfg: &TrainConfig,
        set: &TrainingSet,
        yaw: Yaw,
        acceleration: &[f32],
    ) -> bool {
        let next = self.current + 1;
        if !TrainingSet::section_has(&self.section, next) {
            self.start_afresh();
            return false;
        }
        let motion = set.motion(self.section.trajectory);
        let truth = motion.frame(next as i64);
        let count = self.history.len();
        let reference = self.reference(cfg, set, yaw);
        let mut predicted = std::mem::take(&mut self.history[0]);
        let last = [&*reference, &*self.history[count - 1]];
        integrate(acceleration, yaw, last, &mut predicted);
        for vertex in motion.graph.handles().vertices() {
            predicted[vertex.index()] = truth[vertex.index()];
        }
        if let Some(limits) = cfg.model.edge_limits {
            limits.apply(&motion.graph, &mut predicted);
        }
        let farthest = cfg.scheduled_sampling.farthest as f32;
        // Also no limit is none for a position that is not finite.
        let close = |(p, q): (&Vec3, &Vec3)| p.is_finite() && p.distance(*q) <= farthest;
        if !predicted.iter().zip(truth).all(close) {
            self.start_afresh();
            return false;
        }
        self.history.rotate_left(1);
        self.history[count - 1] = predicted;
        self.current = next;
        self.run += 1;
        true
    }
}

/// The numbers of slot `slot` in step `step`.
pub(crate) fn rng_of(seed: u64, step: u64, slot: usize, slots: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Stream 0 is for the weights.
    rng.set_stream(1 + step * slots as u64 + slot as u64);
    rng
}

/// Mean length of the edges at rest `[m]`.
fn mean_edge(graph: &ClothGraph) -> f64 {
    let lengths = graph.rest_lengths();
    let sum: f64 = lengths.iter().map(|&length| f64::from(length)).sum();
    sum / lengths.len().max(1) as f64
}

/// n on the newest positions of free vertices, (1 - γ) n on their targets.
fn add_noise(
    cfg: &TrainConfig,
    graph: &ClothGraph,
    rng: &mut impl Rng,
    (newest, target): (&mut [Vec3], &mut [DVec3]),
) {
    let NoiseConfig {
        deviation,
        unit,
        correction,
    } = cfg.noise;
    if deviation == 0.0 {
        return;
    }
    let deviation = match unit {
        NoiseUnit::Metre => deviation,
        NoiseUnit::Edge => deviation * mean_edge(graph),
    };
    let rows = newest.iter_mut().zip(target).zip(graph.handle_mask());
    for ((now, target), _) in rows.filter(|(_, handle)| !**handle) {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let noise = deviation * DVec3::new(normal(), normal(), normal());
        *now = (now.as_dvec3() + noise).as_vec3();
        *target += (1.0 - correction) * noise;
    }
}

impl Default for ShownSample {
    fn default() -> Self {
        Self {
            trajectory: 0,
            yaw: Yaw::WORLD,
            frames: Vec::new(),
            next_handles: Vec::new(),
            local: Default::default(),
            dropout_seed: 0,
        }
    }
}

impl ShownSample {
    /// The sample for the features.
    pub(crate) fn window(&self) -> Frames<'_, Vec<Vec3>> {
        Frames {
            positions: &self.frames,
            next_handles: &self.next_handles,
            yaw: self.yaw,
        }
    }

    /// The sample for the losses.
    pub(crate) fn triplet<'a>(&'a self, graph: &'a ClothGraph) -> Triplet<'a> {
        let [previous, current, target] = &self.local;
        Triplet {
            graph,
            previous,
            current,
            target,
        }
    }
}

#[cfg(test)]
mod tests;
