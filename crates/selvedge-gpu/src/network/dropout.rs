//! Dropout between the layers of the recurrent encoders, with the masks of the processor. The mask
//! of a value follows from the seed of its rollout slot, its row in the slot, its frame and its
//! column.

use selvedge_model::Dropout as CpuDropout;

use crate::device::{DeviceError, Loaded};
use crate::kernels::layers::DROPOUT;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Schedule, args};

/// Dropout of a union of rollout slots of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout {
    /// Probability of a zero.
    pub rate: f64,
    /// Vertices and arcs of each slot.
    pub slot: [usize; 2],
    /// Frames that the encoders see.
    pub steps: usize,
    /// The seeds of vertices and of arcs of each slot, low half first, `[slots, 2]`.
    pub seeds: [Region; 2],
}

/// Sizes of a union of rollout slots of one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DropoutSizes {
    /// The number of slots.
    pub slots: usize,
    /// Vertices and arcs of a slot.
    pub slot: [usize; 2],
    /// Frames of the window.
    pub steps: usize,
}

impl Dropout {
    /// Room for the seeds of a union; none where nothing is dropped.
    pub fn new(plan: &mut Plan, rate: f64, sizes: DropoutSizes) -> Option<Self> {
        (rate > 0.0).then(|| Self {
            rate,
            slot: sizes.slot,
            steps: sizes.steps,
            seeds: [(); 2].map(|()| plan.indices("dropout seeds", 2 * sizes.slots)),
        })
    }

    /// Writes the seed of each slot.
    ///
    /// # Errors
    /// When the device fails.
    pub fn upload(&self, loaded: &mut dyn Loaded, seeds: &[u64]) -> Result<(), DeviceError> {
        for (kind, region) in self.seeds.into_iter().enumerate() {
            let of_rows = seeds.iter().map(|&seed| CpuDropout::row_seeds(seed)[kind]);
            let halves: Vec<u32> = of_rows
                .flat_map(|seed| [seed as u32, (seed >> 32) as u32])
                .collect();
            loaded.upload(region, &halves)?;
        }
        Ok(())
    }
}

/// Multiplies rows of vertices (`kind` 0) or arcs (1) by their mask of a step, from the first of
/// `rows` to the second.
pub(super) fn drop_out(
    schedule: &mut Schedule,
    dropout: &Dropout,
    kind: usize,
    step: usize,
    rows: [Region; 2],
) {
    // As selvedge_model rounds them.
    let scale = (1.0 / (1.0 - dropout.rate)) as f32;
    let threshold = (dropout.rate * (1_u64 << 32) as f64) as u32;
    let (seeds, slot_rows) = (dropout.seeds[kind], dropout.slot[kind]);
    let [before, after] = rows;
    let arguments = args! {
        before,
        after,
        seeds,
        slot_rows,
        steps: dropout.steps,
        step,
        threshold,
        scale,
    };
    schedule.launch(&DROPOUT, seeds.count() / 2 * slot_rows, arguments);
}
