//! One cloth that moves, with the physics that is corrected and the teacher beside each other.

use std::error::Error;
use std::sync::Arc;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::{HandlePath, Scene, Stepper, Stop};
use selvedge_corrected::{FrameState, base_scene};
use selvedge_model::{
    ClothGraph, CorrectionColumns, Corrector, FrameSubsteps, HalfTurns, Model, MotionState,
    PhysicsBase, PredictedFrame, Stiffness, Stopped, rough_fields,
};
use selvedge_sim::{Simulator, SimulatorError, Threads};
use selvedge_train::{CorrectionSample, TrainConfig};

use super::scenes::{TeachingScene, TeachingScenes};

/// A cloth whose vertex is farther from the teacher's after one frame has gone astray `[m]`.
const ASTRAY: f64 = 0.05;
/// Frames of the teacher between two runs of the model, at most.
const MOST_TAUGHT: usize = 20;
/// Part of the frames before which the frame before is forgotten, as at the start of a run.
pub(super) const FORGETFUL: f64 = 0.02;

type Problem = Box<dyn Error + Send + Sync>;

/// Parts that all cloths of a frame share.
#[derive(Clone, Copy)]
pub(super) struct Lesson<'a> {
    pub(super) scenes: &'a TeachingScenes,
    pub(super) cfg: &'a TrainConfig,
    /// The model whose own frames cloths may go on from.
    pub(super) model: Option<&'a Arc<Model>>,
    /// Its frames in a row, with the one that the sample is of.
    pub(super) own_frames: usize,
    /// Part of the frames before which the frame before is forgotten.
    pub(super) forgetful: f64,
    pub(super) stop: &'a Stop,
}

/// A cloth that is moved to make samples.
pub(super) struct TaughtCloth {
    rng: ChaCha8Rng,
    /// The motion under way; none before the first.
    run: Option<Run>,
    /// Runs that diverged so far.
    diverged: u64,
}

/// A cloth on its way through a motion.
struct Run {
    scene: usize,
    path: HandlePath,
    cheap: Simulator,
    teacher: Simulator,
    columns: CorrectionColumns,
    corrector: Option<Corrector>,
    stop: Stop,
    base: PhysicsBase,
    /// Solves of the teacher per frame.
    teaching: u32,
    /// Mean distance from the teacher after one frame of the model at which a run ends `[m]`.
    farthest: Option<f64>,
    held: Vec<bool>,
    now: FrameState,
    seen: SeenSubsteps,
    /// Frames until the next motion.
    left: usize,
    /// Frames until the cloth follows the other one, the model or the teacher.
    until_change: usize,
    follows_model: bool,
}

/// The substeps of a frame, where the model sees them.
#[derive(Default)]
struct SeenSubsteps {
    /// The state one substep before the frame, as the physics that is corrected has it.
    earlier: Option<FrameState>,
    /// The state one substep before the end of the predicted frame.
    middle: Option<FrameState>,
    /// Differences of the frame through the matrix of its last solve.
    smoothed: [Vec<DVec3>; 2],
    /// Part of the substeps that fell back to first order.
    fell_back: f32,
}

impl SeenSubsteps {
    /// What the model sees; none where the physics divided the frame otherwise.
    fn of_frame(&self, base: PhysicsBase) -> Option<FrameSubsteps<'_>> {
        Some(FrameSubsteps {
            earlier: self.earlier.as_ref().map(FrameState::as_motion),
            middle: self.middle.as_ref()?.as_motion(),
            part: 1.0 / f64::from(base.substeps),
            smoothed: &self.smoothed,
            fell_back: self.fell_back,
        })
    }
}

impl TaughtCloth {
    /// Cloth `number` of a training that goes on after `first` steps.
    pub(super) fn new(seed: u64, first: u64, number: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ first.rotate_left(32));
        // The trainer's own streams are counted from 0 on.
        rng.set_stream(u64::MAX - number as u64);
        Self {
            rng,
            run: None,
            diverged: 0,
        }
    }

    /// Runs that diverged so far.
    #[cfg(test)]
    pub(super) fn diverged(&self) -> u64 {
        self.diverged
    }

    /// Moves the cloth by a frame. None where that went astray, or a stop is wanted: the next frame
    /// is of another motion.
    pub(super) fn sample(
        &mut self,
        lesson: Lesson<'_>,
    ) -> Result<Option<CorrectionSample>, Problem> {
        if lesson.stop.is_wanted() {
            self.run = None;
            return Ok(None);
        }
        let run = match self.run.take() {
            Some(run) if run.left > 0 => Some(run),
            _ => Run::begin(lesson, &mut self.rng)?,
        };
        let sample = match run {
            Some(run) => self.advance(run, lesson)?,
            None => None,
        };
        if sample.is_none() && !lesson.stop.is_wanted() {
            self.diverged += 1;
        }
        Ok(sample)
    }

    /// Moves the cloth of `run` by a frame, and keeps the run where it goes on.
    fn advance(
        &mut self,
        mut run: Run,
        lesson: Lesson<'_>,
    ) -> Result<Option<CorrectionSample>, Problem> {
        let scene = &lesson.scenes.scenes[run.scene];
        run.left -= 1;
        run.choose(lesson.model, lesson.own_frames, &mut self.rng);
        let sample = run.advance(scene, lesson, &mut self.rng)?;
        if sample.is_some() {
            self.run = Some(run);
        }
        Ok(sample)
    }
}

impl Run {
    /// Begins one of the motions somewhere on its way; physics leads there. None where the physics
    /// cannot: a motion may strain the cloth too much, or a stop is wanted.
    fn begin(lesson: Lesson<'_>, rng: &mut ChaCha8Rng) -> Result<Option<Self>, Problem> {
        let Lesson {
            scenes, cfg, stop, ..
        } = lesson;
        let number = rng.random_range(0..scenes.scenes.len());
        let TeachingScene { scene, graph, rest } = &scenes.scenes[number];
        let path = scene.handle_path()?;
        let lasts = path.frame_count();
        let lead = rng.random_range(0..=cfg.samples.lead.min(lasts));
        let base = cfg.model.base.ok_or("model.base is missing")?;
        let leading = PhysicsBase { substeps: 2 };
        let still = vec![DVec3::ZERO; rest.len()];
        let at_rest = FrameState {
            positions: rest.to_vec(),
            velocities: still,
        };
        let mut leader = simulator(scene, leading, 0, at_rest, stop)?;
        for frame in 0..lead {
            let targets = path.targets(frame, leading.substeps as usize)?;
            if leader.step(&targets).is_err() {
                return Ok(None);
            }
        }
        let now = state_of(&leader);
        let teacher = cfg.teacher.as_ref().ok_or("teacher is missing")?;
        let teacher = PhysicsBase {
            substeps: teacher.substeps,
        };
        Ok(Some(Self {
            scene: number,
            cheap: simulator(scene, base, lead, now.clone(), stop)?,
            teacher: simulator(scene, teacher, lead, now.clone(), stop)?,
            columns: CorrectionColumns::new(
                graph,
                Stiffness::of(&scene.material),
                1.0 / scene.frame_rate,
            ),
            corrector: None,
            stop: stop.clone(),
            base,
            teaching: teacher.substeps,
            farthest: cfg.samples.farthest,
            held: graph.handle_mask().to_vec(),
            path,
            now,
            seen: SeenSubsteps::default(),
            left: rng.random_range(1..=cfg.samples.frames),
            until_change: 0,
            follows_model: false,
        }))
    }

    /// Chooses whom the cloth follows: in turn the teacher for up to [`MOST_TAUGHT`] frames, and
    /// the model for less than `own_frames`.
    fn choose(&mut self, model: Option<&Arc<Model>>, own_frames: usize, rng: &mut ChaCha8Rng) {
        if self.until_change > 0 {
            self.until_change -= 1;
            return;
        }
        self.follows_model = !self.follows_model && model.is_some() && own_frames > 1;
        let most = if self.follows_model {
            own_frames - 1
        } else {
            MOST_TAUGHT
        };
        self.until_change = rng.random_range(0..most);
    }

    /// Moves the cloth by a frame; none where it goes astray.
    fn advance(
        &mut self,
        scene: &TeachingScene,
        lesson: Lesson<'_>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Option<CorrectionSample>, Problem> {
        let frame = self.cheap.frame();
        if rng.random::<f64>() < lesson.forgetful {
            self.cheap.forget_previous();
        }
        let FrameState {
            positions,
            velocities,
        } = &self.now;
        match self.teacher.take_state(positions, velocities) {
            // The teacher has no frame for a cloth that passes through itself or a body.
            Err(SimulatorError::Intersections { .. }) => return Ok(None),
            taken => taken?,
        }
        let targets = self.path.targets(frame, self.base.substeps as usize)?;
        let finely = self.path.targets(frame, self.teaching as usize)?;
        for (handle, vertex) in scene.scene.handles.vertices().iter().enumerate() {
            self.held[vertex.index()] = targets.holds(handle);
        }
        self.seen.earlier = substep_before(&self.cheap);
        let counts = self.cheap.stats().substeps;
        if self.cheap.step(&targets).is_err() || self.teacher.step(&finely).is_err() {
            return Ok(None);
        }
        let after = self.cheap.stats().substeps;
        let all = (after.all - counts.all).max(1) as f32;
        self.seen.fell_back = (after.fell_back - counts.fell_back) as f32 / all;
        let predicted = state_of(&self.cheap);
        self.seen.middle = substep_before(&self.cheap);
        if !self.smooth(scene, &predicted) {
            return Ok(None);
        }
        let turns = HalfTurns {
            along: rng.random(),
            over: rng.random(),
        };
        let sample = self.write(scene, &predicted, turns);
        let next = match lesson.model.filter(|_| self.follows_model) {
            Some(model) => match self.corrected(scene, model, predicted)? {
                Some(next) => next,
                None => return Ok(None),
            },
            None => state_of(&self.teacher),
        };
        if self.is_astray(&next.positions)
            || self
                .cheap
                .correct(&next.positions, &next.velocities)
                .is_err()
        {
            return Ok(None);
        }
        self.now = next;
        Ok(sample)
    }

    /// Finds the differences that are smoothed by the matrix of the last solve. Returns false where
    /// there is no factor of that.
    fn smooth(&mut self, scene: &TeachingScene, predicted: &FrameState) -> bool {
        let start = self.now.as_motion();
        let Some(middle) = self.seen.middle.as_ref().map(FrameState::as_motion) else {
            return false;
        };
        let times = self.base.times(scene.scene.frame_rate);
        rough_fields(
            [start, middle, predicted.as_motion()],
            times,
            &mut self.seen.smoothed,
        );
        let mut fields = self.seen.smoothed.iter_mut();
        fields.all(|field| self.cheap.smooth(field))
    }

    /// Returns true where the cloth at `next` `[m]`, `[vertices]`, is too far from the teacher's
    /// frame to go on: a vertex is, or after a frame of the model the mean over those that no
    /// handle holds.
    fn is_astray(&self, next: &[DVec3]) -> bool {
        let pairs = || next.iter().zip(self.teacher.positions_f64());
        let near = |(p, q): (&DVec3, &DVec3)| p.distance(*q) < ASTRAY;
        if !pairs().all(near) {
            return true;
        }
        let Some(farthest) = self.farthest.filter(|_| self.follows_model) else {
            return false;
        };
        let free = pairs().zip(&self.held).filter(|(_, held)| !**held);
        let (sum, count) = free.fold((0.0, 0_u32), |(sum, count), ((p, q), _)| {
            (sum + p.distance(*q), count + 1)
        });
        sum > farthest * f64::from(count)
    }

    /// The sample of the cheap frame `predicted`, in columns of the cloth turned by `turns`; none
    /// where there are no substeps to see.
    fn write(
        &mut self,
        scene: &TeachingScene,
        predicted: &FrameState,
        turns: HalfTurns,
    ) -> Option<CorrectionSample> {
        let number = self.cheap.frame() - 1;
        let states = [&self.now, predicted];
        let substeps = self.seen.of_frame(self.base)?;
        let frame = frame_of(scene, number, substeps, states, &self.held);
        self.columns.write(&scene.graph, &frame, turns);
        let truth = MotionState {
            positions: self.teacher.positions_f64(),
            velocities: self.teacher.velocities_f64(),
        };
        let mut target = Vec::new();
        self.columns.target(frame.predicted, truth, &mut target);
        Some(CorrectionSample {
            graph: Arc::clone(&scene.graph),
            nodes: self.columns.nodes.clone(),
            target,
            weights: loss_weights(self.columns.scales(), &self.held),
        })
    }

    /// The state that `model` makes of a predicted one; none where a stop is wanted.
    fn corrected(
        &mut self,
        scene: &TeachingScene,
        model: &Arc<Model>,
        predicted: FrameState,
    ) -> Result<Option<FrameState>, Problem> {
        let corrector = match &mut self.corrector {
            Some(corrector) => corrector,
            none => {
                let corrector = none.insert(Corrector::new(
                    Arc::clone(model),
                    ClothGraph::clone(&scene.graph),
                    Stiffness::of(&scene.scene.material),
                )?);
                corrector.stop_by(self.stop.clone());
                corrector
            }
        };
        corrector.set_model(model)?;
        let mut next = predicted.clone();
        let number = self.cheap.frame() - 1;
        let states = [&self.now, &predicted];
        let Some(substeps) = self.seen.of_frame(self.base) else {
            return Ok(None);
        };
        let frame = frame_of(scene, number, substeps, states, &self.held);
        match corrector.correct(&frame, &mut next.positions, &mut next.velocities) {
            Err(Stopped) => Ok(None),
            Ok(_) => Ok(Some(next)),
        }
    }
}

/// The physics `base` of a scene at a frame, in a state, on one thread, which `stop` ends.
fn simulator(
    scene: &Scene,
    base: PhysicsBase,
    frame: usize,
    state: FrameState,
    stop: &Stop,
) -> Result<Simulator, Problem> {
    let scene = base_scene(scene, base);
    let made = Simulator::with_state(&scene, state.positions, state.velocities)?;
    let mut made = made.taken_up_at(frame)?;
    made.set_threads(Threads::One);
    made.stop_by(stop.clone());
    Ok(made)
}

/// Frame `number` of a scene between two states.
fn frame_of<'a>(
    scene: &TeachingScene,
    number: usize,
    substeps: FrameSubsteps<'a>,
    [last, predicted]: [&'a FrameState; 2],
    held: &'a [bool],
) -> PredictedFrame<'a> {
    let rate = scene.scene.frame_rate;
    let environment = scene.scene.environment.during_step(number, rate);
    PredictedFrame {
        substeps,
        last: last.as_motion(),
        predicted: predicted.as_motion(),
        wind: environment.wind,
        gravity: environment.gravity,
        held,
    }
}

/// Weights of the vertices in the loss, from the scales of their corrections.
fn loss_weights(scales: &[f32], held: &[bool]) -> Vec<f32> {
    let squares = || scales.iter().map(|scale| scale * scale).zip(held);
    let free = squares().filter(|(_, held)| !**held);
    let (sum, count) = free.fold((0.0, 0_u32), |(sum, count), (square, _)| {
        (sum + square, count + 1)
    });
    let mean = if sum > 0.0 { sum / count as f32 } else { 1.0 };
    let weight = |(square, held): (f32, &bool)| if *held { 0.0 } else { square / mean };
    squares().map(weight).collect()
}

/// The state one substep ago, where the next substep looks back to it.
fn substep_before(simulator: &Simulator) -> Option<FrameState> {
    let (positions, velocities) = simulator.substep_before()?;
    Some(FrameState {
        positions: positions.to_vec(),
        velocities: velocities.to_vec(),
    })
}

fn state_of(simulator: &Simulator) -> FrameState {
    FrameState {
        positions: simulator.positions_f64().to_vec(),
        velocities: simulator.velocities_f64().to_vec(),
    }
}
