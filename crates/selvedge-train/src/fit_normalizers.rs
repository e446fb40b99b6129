//! Fits the normalisers: statistics of inputs and targets over samples drawn as in training, before
//! the first step.

use std::ops::ControlFlow;

use selvedge_model::{Place, RunningStatistics, Window, edge_groups, node_groups};

use crate::config::TrainConfig;
use crate::losses::RunningLossStatistics;
use crate::slot::{ShownSample, Slot, rng_of};
use crate::training_set::TrainingSet;

/// Statistics of inputs and targets.
pub(crate) struct Statistics {
    /// Features of vertices and of arcs.
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
}

/// The statistics of as many samples as the configuration says; none where `observe`, which is
/// called after each, stops the fit.
pub(crate) fn fit(
    cfg: &TrainConfig,
    set: &TrainingSet,
    observe: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Statistics> {
    let spec = &cfg.model;
    let [mut nodes, mut edges] =
        [node_groups(spec), edge_groups(spec)].map(|groups| RunningStatistics::new(&groups));
    let mut targets = RunningLossStatistics::default();
    let (mut shown, mut window) = (ShownSample::default(), Window::default());
    // The last streams: no training reaches them. The bounds of both counts leave room.
    let last = u64::MAX / cfg.batch.samples as u64 - 1;
    for stream in last - cfg.statistics_samples as u64..last {
        let mut rng = rng_of(cfg.seed, stream, 0, cfg.batch.samples);
        Slot::new().show(cfg, set, &mut rng, &mut shown);
        let graph = &*set.motion(shown.trajectory).graph;
        let place = Place::alone(graph);
        window.fit(spec, &place);
        window.write(spec, graph, shown.window(), &place);
        nodes.add(&window.nodes);
        edges.add(&window.arcs);
        targets.add(&shown.triplet(graph));
        if observe().is_break() {
            return None;
        }
    }
    let inputs = [nodes, edges];
    Some(Statistics { inputs, targets })
}
