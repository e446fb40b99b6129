//! The features of vertices and arcs on the device: their statistics, and the schedule that fills a
//! normalised window of them.
//!
//! Columns and their order are those of `selvedge_model`.

use selvedge_model::{ModelSpec, Normalizers};

use crate::cloths::frames::FrameArrays;
use crate::cloths::{ClothArrays, UnionSizes};
use crate::device::{DeviceError, Loaded};
use crate::kernels::features::{EDGE_FEATURES, NODE_FEATURES};
use crate::network::InputArrays;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{NamedArgument, Schedule, args};

/// Frozen statistics of some columns in the arena.
#[derive(Clone, Copy, Debug)]
pub struct ColumnArrays {
    /// The means, which are subtracted.
    pub shift: Region,
    /// The factors that follow: 1 / deviation for features, the deviation for accelerations.
    pub scale: Region,
}

impl ColumnArrays {
    fn new(plan: &mut Plan, name: &str, width: usize) -> Self {
        let [shift, scale] =
            ["shift", "scale"].map(|what| plan.floats(format!("{what} of {name}"), width));
        Self { shift, scale }
    }

    fn upload(
        &self,
        loaded: &mut dyn Loaded,
        shift: &[f32],
        scale: &[f32],
    ) -> Result<(), DeviceError> {
        loaded.put(self.shift, shift)?;
        loaded.put(self.scale, scale)
    }
}

/// Frozen statistics of features and accelerations in the arena.
#[derive(Clone, Copy, Debug)]
pub struct NormalizerArrays {
    /// The columns of vertices, `[node width]`.
    pub nodes: ColumnArrays,
    /// The columns of arcs, `[edge width]`.
    pub arcs: ColumnArrays,
    /// The accelerations, `[3]`.
    pub acceleration: ColumnArrays,
}

impl NormalizerArrays {
    /// Room for the statistics of a spec.
    pub fn new(plan: &mut Plan, spec: &ModelSpec) -> Self {
        Self {
            nodes: ColumnArrays::new(plan, "vertices", spec.node_width()),
            arcs: ColumnArrays::new(plan, "arcs", spec.edge_width()),
            acceleration: ColumnArrays::new(plan, "accelerations", 3),
        }
    }

    /// The arrays that [`Self::upload`] writes.
    #[must_use]
    pub fn regions(&self) -> Vec<Region> {
        let all = [self.nodes, self.arcs, self.acceleration];
        all.iter().flat_map(|c| [c.shift, c.scale]).collect()
    }

    /// Writes statistics there.
    ///
    /// # Errors
    /// When the device fails.
    pub fn upload(
        &self,
        loaded: &mut dyn Loaded,
        normalizers: &Normalizers,
    ) -> Result<(), DeviceError> {
        let [shift, scale, _] = normalizers.nodes.factors();
        self.nodes.upload(loaded, shift, scale)?;
        let [shift, scale, _] = normalizers.edges.factors();
        self.arcs.upload(loaded, shift, scale)?;
        let [shift, _, deviation] = normalizers.acceleration.factors();
        self.acceleration.upload(loaded, shift, deviation)
    }
}

/// The sources of features.
#[derive(Clone, Copy, Debug)]
pub struct FeatureSources<'a> {
    /// The cloths.
    pub cloths: &'a ClothArrays,
    /// Positions and local frames.
    pub frames: &'a FrameArrays,
    /// The statistics.
    pub normalizers: &'a NormalizerArrays,
}

impl FeatureSources<'_> {
    /// The arguments `FRAME` of a kernel.
    pub(crate) fn frame(&self) -> Vec<NamedArgument> {
        args! {
            ..self.frames.ring(),
            cloth_of: self.cloths.cloth_of,
            numbers: self.frames.numbers,
        }
    }
}

/// Adds the filling of a window of normalised features to a schedule.
pub fn features(schedule: &mut Schedule, from: FeatureSources<'_>, input: &InputArrays) {
    let FeatureSources {
        cloths,
        frames,
        normalizers,
    } = from;
    let steps = input.steps;
    let UnionSizes { vertices, arcs, .. } = cloths.sizes;
    let arguments = args! {
        ..from.frame(),
        ..cloths.forces(),
        steps,
        handle_of: cloths.handle_of,
        shift: normalizers.nodes.shift,
        scale: normalizers.nodes.scale,
        out: input.nodes,
    };
    schedule.launch(&NODE_FEATURES, steps * vertices, arguments);
    let arguments = args! {
        ..frames.ring(),
        arcs,
        steps,
        cloth_of: cloths.cloth_of,
        numbers: frames.numbers,
        senders: cloths.graph.senders,
        receivers: cloths.graph.receivers,
        arc_rest: cloths.arc_rest,
        arc_material: cloths.arc_material,
        hinges: cloths.hinges,
        shift: normalizers.arcs.shift,
        scale: normalizers.arcs.scale,
        out: input.arcs,
    };
    schedule.launch(&EDGE_FEATURES, steps * arcs, arguments);
}

#[cfg(test)]
mod tests;
