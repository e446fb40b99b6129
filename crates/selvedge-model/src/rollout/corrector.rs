//! A model that corrects physics, at work on one cloth: columns of a predicted frame, one pass of
//! the network, and its corrections of positions and velocities.
//!
//! Where the input is unlike what the model was trained on, its corrections fade to nothing, and
//! the frame stays the physics' own.

use std::sync::Arc;

use glam::DVec3;
use selvedge_cloth::{FaceId, Stop};
use thiserror::Error;

use crate::features::correction::{
    CorrectionColumns, HalfTurns, NODE_COLUMNS, PredictedFrame, Stiffness,
};
use crate::graph::ClothGraph;
use crate::kernels::simd::Instructions;
use crate::network::packed::{PackedWeights, Purpose};
use crate::network::workspace::Workspace;
use crate::network::{Carried, EncoderState, Input, Pass, Stopped};
use crate::rollout::model::Model;
use crate::spec::{MOST_DEVIATIONS, PhysicsBase};

/// Deviations from the mean within which training has seen a column often.
const FAMILIAR: f32 = 6.0;
/// Deviations beyond which a column counts as never seen.
const UNLIKE: f32 = 12.0;

/// A model that moves cloth by itself where one that corrects physics is needed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the model moves the cloth by itself: it corrects no physics")]
pub struct NoBase;

/// A model that corrects the frames of one cloth.
pub struct Corrector {
    model: Arc<Model>,
    base: PhysicsBase,
    graph: ClothGraph,
    columns: CorrectionColumns,
    weights: PackedWeights<f32>,
    workspace: Workspace<f32>,
    rows: Vec<f32>,
    /// Part of the correction that each vertex gets, `[vertices]`.
    shares: Vec<f32>,
}

/// The share of a frame that was corrected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Familiarity {
    /// Part of the vertices whose input is like what was trained on.
    pub familiar: f64,
    /// The farthest that a vertex was moved `[m]`.
    pub largest: f64,
}

impl Corrector {
    /// A corrector of the cloth of `graph`, whose material has `stiffness`.
    ///
    /// # Errors
    /// [`NoBase`].
    pub fn new(model: Arc<Model>, graph: ClothGraph, stiffness: Stiffness) -> Result<Self, NoBase> {
        Self::of_faces(model, graph, |_| stiffness)
    }

    /// A corrector of the cloth of `graph`, whose faces have a `stiffness` each.
    ///
    /// # Errors
    /// [`NoBase`].
    pub fn of_faces(
        model: Arc<Model>,
        graph: ClothGraph,
        stiffness: impl Fn(FaceId) -> Stiffness,
    ) -> Result<Self, NoBase> {
        let base = model.spec().base.ok_or(NoBase)?;
        let columns = CorrectionColumns::of_faces(&graph, stiffness, 1.0 / graph.frame_rate());
        let (purpose, using) = (Purpose::Inference, Instructions::Detected);
        Ok(Self {
            columns,
            weights: model.network().pack(model.weights(), purpose, using),
            workspace: Workspace::new(),
            rows: Vec::new(),
            shares: vec![1.0; graph.vertex_count()],
            model,
            base,
            graph,
        })
    }

    /// Lets [`Self::correct`] end early, with an error, from when `stop` is wanted.
    pub fn stop_by(&mut self, stop: Stop) {
        self.workspace.stop_by(stop);
    }

    /// Corrects with another model from now on, of the same network.
    ///
    /// # Errors
    /// [`NoBase`].
    ///
    /// # Panics
    /// When its network is another one.
    pub fn set_model(&mut self, model: &Arc<Model>) -> Result<(), NoBase> {
        if Arc::ptr_eq(&self.model, model) {
            return Ok(());
        }
        if model.spec().base.is_none() {
            return Err(NoBase);
        }
        assert_eq!(model.spec(), self.model.spec(), "network");
        self.model = Arc::clone(model);
        let network = self.model.network();
        network.repack(self.model.weights(), &mut self.weights);
        Ok(())
    }

    /// The cloth.
    #[must_use]
    pub fn graph(&self) -> &ClothGraph {
        &self.graph
    }

    /// The physics that the model corrects.
    #[must_use]
    pub fn base(&self) -> PhysicsBase {
        self.base
    }

    /// Corrects `positions` `[m]` and `velocities` `[m/s]`, `[vertices]` each, which begin as the
    /// predicted ones of `frame`.
    ///
    /// # Errors
    /// [`Stopped`]; positions and velocities stay.
    ///
    /// # Panics
    /// When a slice does not have the size of the cloth.
    pub fn correct(
        &mut self,
        frame: &PredictedFrame<'_>,
        positions: &mut [DVec3],
        velocities: &mut [DVec3],
    ) -> Result<Familiarity, Stopped> {
        let columns = &mut self.columns;
        columns.write(&self.graph, frame, HalfTurns::default());
        let normalizers = self.model.normalizers();
        normalizers.nodes.normalize(&mut columns.nodes);
        find_shares(&columns.nodes, &mut self.shares);
        cut(&mut columns.nodes, MOST_DEVIATIONS);
        self.run_network()?;
        cut(&mut self.rows, MOST_DEVIATIONS);
        let normalizers = self.model.normalizers();
        normalizers.acceleration.denormalize(&mut self.rows);
        self.columns.to_metres(&mut self.rows);
        let mut result = Familiarity::default();
        let rows = self.rows.as_chunks_mut::<6>().0.iter_mut();
        for ((row, &share), &held) in rows.zip(&self.shares).zip(frame.held) {
            // What is dropped need not be a number.
            let part = |x: f32| if share == 0.0 || held { 0.0 } else { share * x };
            row.iter_mut().for_each(|x| *x = part(*x));
            let moved = row[..3].iter().map(|x| x * x).sum::<f32>().sqrt();
            result.largest = result.largest.max(moved.into());
            result.familiar += f64::from(u8::from(share == 1.0));
        }
        result.familiar /= self.shares.len().max(1) as f64;
        self.columns
            .apply(&self.rows, frame.held, positions, velocities);
        Ok(result)
    }

    /// Takes the columns to normalised corrections in `rows`.
    fn run_network(&mut self) -> Result<(), Stopped> {
        let out = self.model.network().forward_carried(
            &self.weights,
            self.graph.connectivity(),
            Carried {
                input: Input {
                    nodes: &self.columns.nodes,
                    arcs: &[],
                },
                state: &EncoderState::new(),
            },
            Pass::Inference,
            &mut self.workspace,
        )?;
        self.rows.clear();
        self.rows.extend_from_slice(out);
        Ok(())
    }
}

/// The part of its correction that each vertex gets: all of it where its normalised columns are
/// within [`FAMILIAR`] deviations, none beyond [`UNLIKE`] `[eq:familiar]`.
fn find_shares(nodes: &[f32], shares: &mut [f32]) {
    // Of two numbers `max` gives the one that is a number: those that are none are the farthest.
    let size = |x: &f32| if x.is_nan() { f32::INFINITY } else { x.abs() };
    for (row, share) in nodes.chunks_exact(NODE_COLUMNS).zip(shares) {
        let far = row.iter().map(size).fold(0.0, f32::max);
        let far = (far - FAMILIAR) / (UNLIKE - FAMILIAR);
        *share = 1.0 - far.clamp(0.0, 1.0);
    }
}

/// Cuts normalised values to `most` deviations, as training shows them.
pub fn cut(rows: &mut [f32], most: f32) {
    for value in rows {
        *value = value.clamp(-most, most);
    }
}

#[cfg(test)]
mod tests;
