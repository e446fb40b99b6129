//! What the recurrent encoders drop, in the places of lanes: the same values as on the CPU, where the lanes
//! of a shard go through the network together.

use selvedge_model::{Connectivity, Dropout as CpuDropout};
use selvedge_train::LaneRun;

use super::plan::{FramePlan, TrainingPlan};
use crate::device::{DeviceError, Loaded};
use crate::network::dropout_words;

/// Which numbers of rows are on the device.
#[derive(Default)]
pub(super) struct Drops {
    /// For each frame, the lanes that go together in it; 0 for none.
    groups: Vec<usize>,
}

impl Drops {
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
        (runs, group): (&[LaneRun<'_>], usize),
    ) -> Result<(), DeviceError> {
        let Some(dropout) = &frame.dropout else {
            return Ok(());
        };
        if self.groups.len() <= number {
            self.groups.resize(number + 1, 0);
        }
        let known = self.groups[number] == group;
        self.groups[number] = group;
        let place = [plan.losses.place.vertices, plan.losses.place.arcs];
        let [mut numbers, mut seeds] = [(); 2].map(|()| [(); 2].map(|()| Vec::<u32>::new()));
        for lanes in runs.chunks(group) {
            let seed = lanes[0].shown().dropout_seed;
            let parts = lanes.iter().map(|run| &**run.cloth().1);
            let union = Connectivity::union(parts);
            let rate = dropout.rate;
            let words = dropout_words(&union, frame.steps, CpuDropout { rate, seed });
            for (kind, [of_rows, of_seeds]) in words.iter().enumerate() {
                let mut first = 0;
                for run in lanes {
                    let (graph, _) = run.cloth();
                    let rows = [graph.vertex_count(), graph.arc_count()][kind];
                    for (to, from) in [(&mut numbers[kind], of_rows), (&mut seeds[kind], of_seeds)]
                    {
                        to.extend(&from[2 * first..2 * (first + rows)]);
                        to.extend(std::iter::repeat_n(0, 2 * (place[kind] - rows)));
                    }
                    first += rows;
                }
            }
        }
        for kind in [0, 1] {
            if !known {
                loaded.upload(dropout.numbers[kind], &numbers[kind])?;
            }
            loaded.upload(dropout.seeds[kind], &seeds[kind])?;
        }
        Ok(())
    }
}
