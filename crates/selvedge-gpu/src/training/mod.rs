//! Training on a device: an engine of `selvedge-train` whose features, network, losses, gradients
//! and optimiser are on the device.
//!
//! What the rollout slots draw stays with the trainer, so that a step is the same as on the CPU but
//! for rounding. Up go the positions of the slots' samples, and a few numbers per cloth; down come
//! predictions and the terms of their losses, so that slots can go on. Weights come down for a
//! checkpoint. A cloth goes up when a slot shows another one than before.

pub mod adam;
mod plan;
mod slot_arrays;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_model::ClothGraph;
use selvedge_train::{
    Arithmetic, Batch, Engine, EngineError, EngineMaker, FramePasses, Learned, LossTerms,
    LossWeights, Setup, SlotRun, TrainConfig, Update, run_slots,
};

use crate::cloths::frames::FrameNumbers;
use crate::cloths::losses::{SlotSizes, TERMS, loss_numbers};
use crate::device::{
    Device, DeviceError, Loaded, Precision, Prepared, largest_fit, require_memory,
};
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
    losses: LossWeights,
    /// The cloth that was written to each slot.
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
        let slot = slot_arrays::sizes_of(setup.graphs());
        let plan = TrainingPlan::new(setup.cfg, setup.network, slot);
        require_memory(device, "this training", plan.plan.bytes(), |free| {
            what_fits(setup, slot, free)
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
            losses: setup.cfg.losses,
            cloths: vec![None; setup.cfg.batch.samples],
            plan,
            loaded,
        })
    }

    /// Writes the cloths of samples into slots that hold another one.
    fn place_cloths(&mut self, slots: &[SlotRun<'_>]) -> Result<(), DeviceError> {
        let arrays = slot_arrays::SlotArrays {
            cloths: &self.plan.cloths,
            losses: &self.plan.losses,
        };
        for (number, (slot, placed)) in slots.iter().zip(&mut self.cloths).enumerate() {
            let graph = slot.graph();
            let is_placed = placed
                .as_ref()
                .is_some_and(|placed| Arc::ptr_eq(placed, graph));
            if !is_placed {
                arrays.upload(&mut *self.loaded, number, graph, slot.connectivity())?;
                *placed = Some(Arc::clone(graph));
            }
        }
        Ok(())
    }

    /// Writes the samples of frame `number` of a step.
    fn upload_frame(&mut self, slots: &[SlotRun<'_>], number: usize) -> Result<(), DeviceError> {
        let (frame, loaded) = (&self.plan.frames[number], &mut *self.loaded);
        let vertices = self.plan.losses.slot.vertices;
        let size = OUTPUTS * vertices * slots.len();
        // The first frame brings its whole history, later ones the predicted positions.
        let rows = if number == 0 {
            0..frame.newest + 1
        } else {
            frame.newest..frame.newest + 1
        };
        let positions_in = |row: usize| {
            slots.iter().flat_map(move |slot| {
                let frames = &slot.sample().frames;
                padded(&frames[row - number], vertices, Vec3::to_array)
            })
        };
        let positions: Vec<f32> = rows.clone().flat_map(positions_in).flatten().collect();
        let region = self.plan.positions;
        loaded.put(region.part(rows.start * size..rows.end * size), &positions)?;
        for (part, region) in frame.triplet.regions().into_iter().enumerate() {
            let rows = slots
                .iter()
                .flat_map(|slot| padded(&slot.sample().local[part], vertices, DVec3::to_array));
            loaded.put_doubles(region, &rows.flatten().collect::<Vec<f64>>())?;
        }
        let mut numbers = FrameNumbers::default();
        for slot in slots {
            let sample = slot.sample();
            numbers.add(slot.graph(), sample.yaw, &sample.next_handles);
        }
        numbers.upload_local_frames(loaded, &frame.frames)
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

impl FramePasses for Training {
    type Error = DeviceError;

    fn forward(&mut self, frame: usize, slots: &mut [SlotRun<'_>]) -> Result<(), DeviceError> {
        if frame == 0 {
            self.place_cloths(slots)?;
        }
        self.upload_frame(slots, frame)?;
        if let Some(dropout) = &self.plan.frames[frame].dropout {
            let samples = slots.iter().map(SlotRun::sample);
            let seeds: Vec<u64> = samples.map(|sample| sample.dropout_seed).collect();
            dropout.upload(&mut *self.loaded, &seeds)?;
        }
        self.loaded.run(self.forward[frame])?;
        let (terms, output) = self.judged(frame)?;
        let numbers = OUTPUTS * self.plan.losses.slot.vertices;
        for ((slot, rows), terms) in slots
            .iter_mut()
            .zip(output.chunks_exact(numbers))
            .zip(terms)
        {
            let count = OUTPUTS * slot.graph().vertex_count();
            slot.receive(&rows[..count], terms);
        }
        Ok(())
    }

    /// Begins the way back; the device is still on it afterwards.
    fn backward(&mut self, weights: &[Vec<f64>]) -> Result<(), DeviceError> {
        let frames = weights.iter().map(Vec::len).max().unwrap_or(0);
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
        Ok(())
    }
}

impl Engine for Training {
    fn learn(&mut self, batch: Batch<'_>) -> Result<Vec<LossTerms>, EngineError> {
        run_slots(self, &mut batch.runs()).map_err(failed)
    }

    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError> {
        self.take_step(learned, update).map_err(failed)
    }

    fn add_gradient(&mut self, range: Range<usize>, sum: &mut [f32]) -> Result<(), EngineError> {
        let part = self.loaded.get(self.plan.gradient.part(range));
        let part = part.map_err(failed)?;
        sum.iter_mut().zip(part).for_each(|(s, g)| *s += g);
        Ok(())
    }

    fn set_gradient(&mut self, gradient: &[f32]) -> Result<(), EngineError> {
        self.loaded
            .put(self.plan.gradient, gradient)
            .map_err(failed)
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        self.clipped_gradient().map_err(failed)
    }

    fn collect(&mut self, learned: &mut Learned) -> Result<(), EngineError> {
        self.bring_down(learned).map_err(failed)
    }
}

/// Settings of the engine of a device.
#[derive(Clone, Copy)]
pub struct OnDevice<'a> {
    /// The device.
    pub device: &'a dyn Device,
    /// Rounding of factors before they are multiplied.
    pub precision: Precision,
}

impl EngineMaker for OnDevice<'_> {
    fn arithmetic(&self) -> Arithmetic {
        Arithmetic::OnDevice
    }

    fn make(&self, setup: Setup<'_>) -> Result<Box<dyn Engine>, EngineError> {
        let training = Training::new(self.device, self.precision, setup).map_err(failed)?;
        Ok(Box::new(training))
    }
}

fn failed(error: DeviceError) -> EngineError {
    EngineError(Box::new(error))
}

/// Rows of a cloth, then zeros up to `count` rows.
fn padded<'a, T, V: Copy, const N: usize>(
    rows: &'a [V],
    count: usize,
    array: impl Fn(&V) -> [T; N] + 'a,
) -> impl Iterator<Item = [T; N]> + 'a
where
    T: Copy + Default + 'a,
{
    let left_over = count - rows.len();
    let zeros = std::iter::repeat_n([T::default(); N], left_over);
    rows.iter().map(array).chain(zeros)
}

/// Writes the arrays that a training starts with.
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
fn what_fits(setup: Setup<'_>, slot: SlotSizes, free: usize) -> String {
    let fits = |samples: usize| {
        let mut cfg: TrainConfig = setup.cfg.clone();
        cfg.batch.samples = samples;
        TrainingPlan::new(&cfg, setup.network, slot).plan.bytes() <= free
    };
    match largest_fit(setup.cfg.batch.samples, fits) {
        0 => "not even batch.samples = 1 fits: lower unroll.frames, model.latent, model.blocks or \
              the window"
            .to_owned(),
        samples => format!("batch.samples = {samples} fits; or lower unroll.frames or the model"),
    }
}
