//! What the recurrent encoders drop, in the places of lanes: the same values as on the CPU, where the lanes
//! of a shard go through the network together.

use selvedge_model::{Connectivity, Dropout as CpuDropout};
use selvedge_train::SlotRun;

use super::plan::{FramePlan, TrainingPlan};
use crate::device::{DeviceError, Loaded};
use crate::network::{dropout_numbers, dropout_seeds};

/// Which numbers of rows are on the device.
#[derive(Default)]
pub(super) struct DropoutSeeds {
    /// For each frame, the lanes that go together in it; 0 for none.
    groups: Vec<usize>,
}

impl DropoutSeeds {
    /// The cloths are others now.
    pub(super) fn forget(&mut self) {
        self.groups.clear();
    }

    /// Writes what frame `number` drops, `group` lanes going together.
    pub(super) fn upload(
        &mut self,
        loaded: &mut dyn Loaded,
        plan: &TrainingPlan,
        (frame, number): (&FramePlan, usize),
        (runs, group): (&[SlotRun<'_>], usize),
    ) -> Result<(), DeviceError> {
        let Some(dropout) = &frame.dropout else {
            return Ok(());
        };
        if self.groups.len() <= number {
            self.groups.resize(number + 1, 0);
        }
        if self.groups[number] != group {
            let numbers = numbers(plan, runs, (frame.steps, group));
            for (region, numbers) in dropout.numbers.into_iter().zip(&numbers) {
                loaded.upload(region, numbers)?;
            }
            self.groups[number] = group;
        }
        let [mut of_vertices, mut of_arcs] = [(); 2].map(|()| Vec::<u32>::new());
        for lanes in runs.chunks(group) {
            let (rate, seed) = (dropout.rate, lanes[0].shown().dropout_seed);
            let seeds = dropout_seeds(CpuDropout { rate, seed });
            let all = [&mut of_vertices, &mut of_arcs].into_iter();
            for ((to, seed), place) in all.zip(seeds).zip(places(plan)) {
                to.extend(seed.repeat(place * lanes.len()));
            }
        }
        loaded.upload(dropout.seeds[0], &of_vertices)?;
        loaded.upload(dropout.seeds[1], &of_arcs)
    }
}

/// Vertices and arcs of the place of a lane.
fn places(plan: &TrainingPlan) -> [usize; 2] {
    [plan.losses.place.vertices, plan.losses.place.arcs]
}

/// The numbers of the rows of all lanes, `group` going together, in their places: 0 where a place is empty.
fn numbers(
    plan: &TrainingPlan,
    runs: &[SlotRun<'_>],
    (steps, group): ([usize; 2], usize),
) -> [Vec<u32>; 2] {
    let mut numbers = [(); 2].map(|()| Vec::<u32>::new());
    for lanes in runs.chunks(group) {
        let union = Connectivity::union(lanes.iter().map(|run| &**run.cloth().1));
        let of_union = dropout_numbers(&union, steps);
        for (kind, place) in places(plan).into_iter().enumerate() {
            let mut first = 0;
            for run in lanes {
                let (graph, _) = run.cloth();
                let rows = [graph.vertex_count(), graph.arc_count()][kind];
                numbers[kind].extend(&of_union[kind][2 * first..2 * (first + rows)]);
                numbers[kind].extend(std::iter::repeat_n(0, 2 * (place - rows)));
                first += rows;
            }
        }
    }
    numbers
}
