//! Training on a device: an engine of `selvedge-train` whose features, network, losses, gradients and
//! optimiser are on the device.
//!
//! What the lanes draw stays with the trainer, so that a step is the same as on the CPU but for rounding.
//! Up go the positions that the lanes show, and a few numbers per cloth; down come predictions, so that
//! lanes can go on from them, and the terms of their losses. Weights come down for a checkpoint. Cloths go
//! up when a lane shows another one.

pub mod adam;
mod plan;
mod slot_arrays;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use selvedge_model::{ClothGraph, ModelSpec};
use selvedge_train::{
    Batch, Engine, EngineError, Learned, LossTerms, LossWeights, Setup, SlotRun, TrainConfig,
    Update,
};

use crate::cloths::frames::{FrameNumbers, HandleFrames};
use crate::cloths::losses::{TERMS, loss_numbers};
use crate::device::{Device, DeviceError, Loaded, Precision, Prepared, require_memory};
use crate::network::OUTPUTS;
use crate::schedule::plan::Region;

#[cfg(all(test, feature = "cuda"))]
pub(crate) use plan::program;
pub use plan::{FramePlan, TrainingPlan};

/// A training's arithmetic on a device.
pub struct Training {
    plan: TrainingPlan,
    loaded: Box<dyn Loaded>,
    forward: Vec<Prepared>,
    backward: Vec<Prepared>,
    begin: Prepared,
    update: Prepared,
    spec: ModelSpec,
    losses: LossWeights,
    /// What lies in the place of each lane.
    cloths: Vec<Option<Arc<ClothGraph>>>,
}

impl Training {
    /// Loads a training onto a device, as it stands.
    ///
    /// # Errors
    /// When there is not enough memory on it, or it fails.
    pub fn new(
        device: &dyn Device,
        precision: Precision,
        setup: Setup<'_>,
    ) -> Result<Self, DeviceError> {
        let place = slot_arrays::sizes_of(setup.graphs());
        let plan = TrainingPlan::new(setup.cfg, setup.network, place);
        require_memory(device, "this training", plan.plan.bytes(), |free| {
            what_fits(setup, place, free)
        })?;
        let mut loaded = device.load(&plan.program, &plan.plan, precision)?;
        upload(&plan, &mut *loaded, setup)?;
        let mut prepare = |schedule| loaded.prepare(schedule);
        let frames = || plan.frames.iter();
        let forward = frames()
            .map(|f| prepare(&f.forward))
            .collect::<Result<_, _>>()?;
        let backward = frames()
            .map(|f| prepare(&f.backward))
            .collect::<Result<_, _>>()?;
        let [begin, update] = [prepare(&plan.begin)?, prepare(&plan.update)?];
        let pack = prepare(&plan.pack)?;
        loaded.run(pack)?;
        Ok(Self {
            forward,
            backward,
            begin,
            update,
            spec: setup.network.spec().clone(),
            losses: setup.cfg.losses,
            cloths: vec![None; setup.cfg.batch.samples],
            plan,
            loaded,
        })
    }

    /// Writes the cloths that the lanes show where others lie.
    fn place_cloths(&mut self, runs: &[SlotRun<'_>]) -> Result<(), DeviceError> {
        let places = slot_arrays::SlotArrays {
            cloths: &self.plan.cloths,
            losses: &self.plan.losses,
        };
        for (lane, (run, there)) in runs.iter().zip(&mut self.cloths).enumerate() {
            let (graph, connectivity) = run.cloth();
            if there
                .as_ref()
                .is_some_and(|there| Arc::ptr_eq(there, graph))
            {
                continue;
            }
            places.upload(&mut *self.loaded, lane, (graph, connectivity))?;
            *there = Some(Arc::clone(graph));
        }
        Ok(())
    }

    /// Writes what the lanes show in frame `number` of a step.
    fn upload_frame(&mut self, runs: &[SlotRun<'_>], number: usize) -> Result<(), DeviceError> {
        let (frame, loaded) = (&self.plan.frames[number], &mut *self.loaded);
        let place = self.plan.losses.place.vertices;
        let size = OUTPUTS * place * runs.len();
        // The first frame brings its whole history, later ones what was predicted.
        let slots = if number == 0 {
            0..frame.newest + 1
        } else {
            frame.newest..frame.newest + 1
        };
        let shown = |slot: usize| {
            runs.iter().flat_map(move |run| {
                in_place(&run.shown().frames[slot - number], place, Vec3::to_array)
            })
        };
        let positions: Vec<f32> = slots.clone().flat_map(shown).flatten().collect();
        let region = self
            .plan
            .positions
            .part(slots.start * size..slots.end * size);
        loaded.put(region, &positions)?;
        for (part, region) in frame.triplet.regions().into_iter().enumerate() {
            let rows = runs
                .iter()
                .flat_map(|run| in_place(&run.shown().local[part], place, DVec3::to_array));
            loaded.put_doubles(region, &rows.flatten().collect::<Vec<f64>>())?;
        }
        let mut numbers = FrameNumbers::default();
        for run in runs {
            let (graph, shown) = (run.cloth().0, run.shown());
            let past: Vec<Vec<Vec3>> = shown
                .frames
                .iter()
                .map(|f| graph.handles().select(f))
                .collect();
            let handles = HandleFrames {
                past: &past,
                next: &shown.next_handles,
                yaw: shown.yaw,
            };
            numbers.add(&self.spec, graph, handles, frame.steps[0]);
        }
        numbers.upload_motions(loaded, &frame.frames)
    }

    /// The terms and the predictions of a frame.
    fn judged(&mut self, number: usize) -> Result<(Vec<LossTerms>, Vec<f32>), DeviceError> {
        let frame = &self.plan.frames[number];
        let terms = self.loaded.get_doubles(frame.terms)?;
        let output = self.loaded.get(frame.output)?;
        let rows = terms.as_chunks::<TERMS>().0.iter();
        let terms = rows.map(|row| LossTerms::weighted(&self.losses, *row));
        Ok((terms.collect(), output))
    }

    /// Takes the lanes through their frames and back.
    fn run_lanes(&mut self, batch: Batch<'_>) -> Result<Vec<LossTerms>, DeviceError> {
        let frames = batch.frames();
        let mut runs = batch.runs();
        let mut terms: Vec<Vec<LossTerms>> = vec![Vec::new(); runs.len()];
        let mut going = vec![true; runs.len()];
        let mut output = Vec::new();
        let mut done = 0;
        while done < frames && going.contains(&true) {
            if done > 0 {
                self.go_on(&mut runs, &mut going, &output);
                if !going.contains(&true) {
                    break;
                }
            }
            let lanes = runs.par_iter_mut().zip(&going);
            lanes.filter(|(_, going)| **going).for_each(|(run, _)| {
                run.show();
            });
            if done == 0 {
                self.place_cloths(&runs)?;
            }
            self.upload_frame(&runs, done)?;
            if let Some(dropout) = &self.plan.frames[done].dropout {
                let seeds: Vec<u64> = runs.iter().map(|run| run.shown().dropout_seed).collect();
                dropout.upload(&mut *self.loaded, &seeds)?;
            }
            self.loaded.run(self.forward[done])?;
            let found;
            (found, output) = self.judged(done)?;
            let lanes = terms.iter_mut().zip(&going).zip(found);
            for ((terms, _), found) in lanes.filter(|((_, going), _)| **going) {
                terms.push(found);
            }
            done += 1;
        }
        let means = self.back(&runs, &terms, done)?;
        // While the device goes back.
        if going.contains(&true) {
            self.go_on(&mut runs, &mut going, &output);
        }
        Ok(means)
    }

    /// Lets the lanes that are on their way go on from their predictions.
    fn go_on(&self, runs: &mut [SlotRun<'_>], going: &mut [bool], output: &[f32]) {
        let place = OUTPUTS * self.plan.losses.place.vertices;
        let lanes = runs
            .par_iter_mut()
            .zip(going)
            .zip(output.par_chunks_exact(place));
        lanes
            .filter(|((_, going), _)| **going)
            .for_each(|((run, going), rows)| {
                let count = OUTPUTS * run.cloth().0.vertex_count();
                *going = run.go_on(&rows[..count]);
            });
    }

    /// From the terms of the frames of every lane to their means; the way back is begun.
    fn back(
        &mut self,
        runs: &[SlotRun<'_>],
        terms: &[Vec<LossTerms>],
        frames: usize,
    ) -> Result<Vec<LossTerms>, DeviceError> {
        let weighed = runs.iter().zip(terms).map(|(run, terms)| run.weigh(terms));
        let (means, weights): (Vec<LossTerms>, Vec<Vec<f64>>) = weighed.unzip();
        for (number, frame) in self.plan.frames[..frames].iter().enumerate() {
            let of_frame = weights
                .iter()
                .map(|w| w.get(number).copied().unwrap_or(0.0) as f32);
            self.loaded
                .put(frame.weights, &of_frame.collect::<Vec<f32>>())?;
        }
        self.loaded.run(self.begin)?;
        for &schedule in self.backward[..frames].iter().rev() {
            self.loaded.run(schedule)?;
        }
        Ok(means)
    }

    fn take_step(&mut self, learned: &mut Learned, update: Update) -> Result<f64, DeviceError> {
        let (adam, loaded) = (&self.plan.adam, &mut *self.loaded);
        let rates = learned.adam.next_rates(update.learning_rate);
        let steps = learned.adam.steps() + 1;
        let part = update
            .average
            .map_or(0.0, |part| Learned::averaging(steps, part));
        adam.upload(loaded, update.clip, rates, part)?;
        loaded.run(self.update)?;
        let norm = loaded.get_doubles(adam.norm)?[0];
        if norm.is_finite() {
            learned.adam.count_step();
        }
        Ok(norm)
    }

    fn clipped_gradient(&mut self) -> Result<Vec<f32>, DeviceError> {
        let scale = self.loaded.get_doubles(self.plan.adam.norm)?[1];
        let mut gradient = self.loaded.get(self.plan.gradient)?;
        if scale < 1.0 {
            gradient.iter_mut().for_each(|g| *g *= scale as f32);
        }
        Ok(gradient)
    }

    fn bring_down(&mut self, learned: &mut Learned) -> Result<(), DeviceError> {
        let (adam, loaded) = (&self.plan.adam, &mut *self.loaded);
        learned.weights = loaded.get(self.plan.weights.flat())?;
        if let (Some(region), Some(averaged)) = (adam.averaged, &mut learned.averaged) {
            *averaged = loaded.get(region)?;
        }
        let moments = learned.adam.moments_mut();
        for (region, moment) in [adam.first, adam.second].into_iter().zip(moments) {
            moment.copy_from_slice(&loaded.get(region)?);
        }
        Ok(())
    }
}

impl Engine for Training {
    fn learn(&mut self, batch: Batch<'_>) -> Result<Vec<LossTerms>, EngineError> {
        self.run_lanes(batch).map_err(failed)
    }

    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError> {
        self.take_step(learned, update).map_err(failed)
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        self.clipped_gradient().map_err(failed)
    }

    fn collect(&mut self, learned: &mut Learned) -> Result<(), EngineError> {
        self.bring_down(learned).map_err(failed)
    }
}

/// An engine for [`selvedge_train::Trainer::run_on`].
///
/// # Errors
/// As [`Training::new`].
pub fn engine(
    device: &dyn Device,
    precision: Precision,
    setup: Setup<'_>,
) -> Result<Box<dyn Engine>, EngineError> {
    let training = Training::new(device, precision, setup).map_err(failed)?;
    Ok(Box::new(training))
}

fn failed(error: DeviceError) -> EngineError {
    EngineError(Box::new(error))
}

/// Rows of a cloth, then zeros up to the size of its place.
fn in_place<'a, T, V: Copy, const N: usize>(
    rows: &'a [V],
    place: usize,
    array: impl Fn(&V) -> [T; N] + 'a,
) -> impl Iterator<Item = [T; N]> + 'a
where
    T: Copy + Default + 'a,
{
    let left_over = place - rows.len();
    let zeros = std::iter::repeat_n([T::default(); N], left_over);
    rows.iter().map(array).chain(zeros)
}

/// Writes what a training starts with.
fn upload(
    plan: &TrainingPlan,
    loaded: &mut dyn Loaded,
    setup: Setup<'_>,
) -> Result<(), DeviceError> {
    let Learned {
        weights,
        averaged,
        adam,
    } = setup.learned;
    loaded.put(plan.weights.flat(), weights)?;
    loaded.put(plan.ones, &vec![1.0; plan.ones.count()])?;
    loaded.put(plan.adam.first, adam.first_moment())?;
    loaded.put(plan.adam.second, adam.second_moment())?;
    if let (Some(region), Some(averaged)) = (plan.adam.averaged, averaged) {
        loaded.put(region, averaged)?;
    }
    plan.normalizers.upload(loaded, setup.normalizers)?;
    let numbers = loss_numbers(setup.statistics, &setup.cfg.losses);
    loaded.put_doubles(plan.losses.numbers, &numbers)?;
    for frame in &plan.frames {
        let newest: Region = frame.frames.newest;
        loaded.upload(newest, &[frame.newest as u32])?;
    }
    Ok(())
}

/// The most samples per step for which there is room.
fn what_fits(setup: Setup<'_>, place: crate::cloths::losses::PlaceSizes, free: usize) -> String {
    let fits = |samples: usize| {
        let mut cfg: TrainConfig = setup.cfg.clone();
        cfg.batch.samples = samples;
        TrainingPlan::new(&cfg, setup.network, place).plan.bytes() <= free
    };
    let (mut least, mut most) = (0, setup.cfg.batch.samples);
    while most - least > 1 {
        let middle = least.midpoint(most);
        if fits(middle) {
            least = middle;
        } else {
            most = middle;
        }
    }
    match least {
        0 => "not even batch.samples = 1 fits: lower unroll.frames, model.latent, model.blocks or \
              the window"
            .to_owned(),
        samples => format!("batch.samples = {samples} fits; or lower unroll.frames or the model"),
    }
}
