//! The learned simulator as a [`Stepper`]: features of the last frames, one pass of the network,
//! and the integration of its acceleration ([`advance`]).
//!
//! Handle vertices never follow the network: after the step they are at their targets.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, Snapshot, StepError, Stepper, Stop, Topology, VertexId,
    check_target_count,
};
use thiserror::Error;

use crate::features::{Frames, Place, Window};
use crate::graph::ClothGraph;
use crate::graph::frame::Yaw;
use crate::kernels::simd::Instructions;
use crate::network::packed::{PackedWeights, Purpose};
use crate::network::workspace::Workspace;
use crate::network::{Pass, Stopped};
use crate::rollout::advance::{LocalAcceleration, NonFinite, TwoFrames, advance, require_finite};
use crate::rollout::model::Model;
use crate::spec::ModelSpec;

/// A cloth that a trained model moves.
pub struct LearnedStepper {
    model: Arc<Model>,
    graph: ClothGraph,
    /// Positions of the frames before the window and of each frame of it, oldest first; the
    /// oldest buffer receives the next frame.
    history: Vec<Vec<Vec3>>,
    next: Vec<Vec3>,
    next_handles: Vec<Vec3>,
    yaw: Yaw,
    /// Yaw before the last step, while that step can be undone: `next` then holds the frame that
    /// left the history.
    yaw_before: Option<Yaw>,
    frame: usize,
    features: Window,
    weights: PackedWeights<f32>,
    workspace: Workspace<f32>,
    acceleration: Vec<f32>,
}

/// Reason why a rollout cannot start.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum RolloutError {
    #[error("the start has {found} positions in a frame, the cloth has {expected} vertices")]
    Count { expected: usize, found: usize },
    #[error("the start needs at least one frame")]
    NoFrame,
    #[error("the start position of vertex {vertex} is not finite")]
    NonFinite { vertex: VertexId },
    #[error(
        "the model needs the fabrics of the cloth: give its graph the material of each face (`ClothGraph::with_materials`)"
    )]
    NoFabric,
}

/// The frames that a rollout of `spec` begins with, oldest first `[m]`, `[history][vertices]`, from
/// the last ones before now: where there are fewer than the model looks at, the cloth is taken to
/// have stood still before the first.
///
/// # Errors
/// [`RolloutError`] when there is no frame, or one that does not fit the cloth, or the model needs
/// fabrics that are not known.
pub fn opening_frames(
    spec: &ModelSpec,
    graph: &ClothGraph,
    start: &[&[Vec3]],
) -> Result<Vec<Vec<Vec3>>, RolloutError> {
    if spec.needs_fabric() && !graph.knows_fabric() {
        return Err(RolloutError::NoFabric);
    }
    let (needed, vertices) = (spec.history(), graph.vertex_count());
    let first = *start.first().ok_or(RolloutError::NoFrame)?;
    for frame in start {
        if frame.len() != vertices {
            let (expected, found) = (vertices, frame.len());
            return Err(RolloutError::Count { expected, found });
        }
        if let Some(vertex) = frame.iter().position(|p| !p.is_finite()) {
            let vertex = VertexId(vertex as u32);
            return Err(RolloutError::NonFinite { vertex });
        }
    }
    let still = std::iter::repeat_n(first, needed.saturating_sub(start.len()));
    let recent = &start[start.len().saturating_sub(needed)..];
    let frames = still.chain(recent.iter().copied());
    Ok(frames.map(<[_]>::to_vec).collect())
}

impl LearnedStepper {
    /// Starts from the last frames before now, oldest first `[m]`, `[frames][vertices]`. If the
    /// model needs more frames, the cloth is taken to have stood still before the first.
    ///
    /// # Errors
    /// [`RolloutError`] when there is no frame, or one that does not fit the cloth.
    pub fn new(
        model: Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Self, RolloutError> {
        let vertices = graph.vertex_count();
        let history = opening_frames(model.spec(), &graph, start)?;
        Ok(Self {
            history,
            next: vec![Vec3::ZERO; vertices],
            next_handles: Vec::new(),
            yaw: graph.frame().rest_yaw(),
            yaw_before: None,
            frame: 0,
            features: Window::default(),
            weights: model.network().pack(
                model.weights(),
                Purpose::Inference,
                Instructions::Detected,
            ),
            workspace: Workspace::new(),
            acceleration: Vec::new(),
            model,
            graph,
        })
    }

    /// The model that moves the cloth.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The yaw of the cloth now: it stays while a handle has let go.
    fn yaw_now(&self) -> Yaw {
        let mut held = self.handles().of(self.graph.handle_mask());
        match held.all(|holds| holds) {
            true => {
                let places = self.handles().of(self.positions());
                self.graph.frame().yaw_of(places, self.yaw)
            }
            false => self.yaw,
        }
    }

    /// Sets the acceleration of frame `frame`.
    fn predict(&mut self, frame: usize, yaw: Yaw) -> Result<(), StepError> {
        let (spec, place) = (self.model.spec(), Place::alone(&self.graph));
        let frames = Frames {
            positions: &self.history,
            yaw,
        };
        self.features.write(spec, &self.graph, frames, &place);
        let normalizers = self.model.normalizers();
        self.features
            .normalize(&normalizers.nodes, &normalizers.edges);
        let connectivity = self.graph.connectivity();
        if let Some(vertex) = self.features.first_non_finite(spec, connectivity) {
            return Err(StepError::NonFinite { frame, vertex });
        }
        let out = self.model.network().forward_packed(
            &self.weights,
            connectivity,
            self.features.input(),
            Pass::Inference,
            &mut self.workspace,
        );
        let out = out.map_err(|Stopped| StepError::Stopped { frame })?;
        self.acceleration.clear();
        self.acceleration.extend_from_slice(out);
        normalizers.acceleration.denormalize(&mut self.acceleration);
        Ok(())
    }
}

impl Stepper for LearnedStepper {
    fn topology(&self) -> &Topology {
        self.graph.topology()
    }

    fn handles(&self) -> &Handles {
        self.graph.handles()
    }

    fn positions(&self) -> &[Vec3] {
        &self.history[self.history.len() - 1]
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_target_count(self, targets)?;
        let frame = self.frame + 1;
        self.yaw_before = None;
        self.graph.hold(|handle| targets.holds(handle));
        self.graph.set_step(self.frame);
        let yaw = self.yaw_now();
        self.predict(frame, yaw)?;
        self.next_handles.clear();
        let places = targets.end().iter().map(|p| p.as_vec3());
        self.next_handles.extend(places);
        let newest = self.history.len() - 1;
        let frames = TwoFrames {
            graph: &self.graph,
            previous: &self.history[newest - 1],
            current: &self.history[newest],
        };
        let acceleration = LocalAcceleration {
            yaw,
            rows: &self.acceleration,
        };
        let advanced = advance(&frames, &self.next_handles, acceleration, &mut self.next);
        advanced.map_err(|NonFinite { vertex }| StepError::NonFinite { frame, vertex })?;
        self.history.rotate_left(1);
        std::mem::swap(&mut self.history[newest], &mut self.next);
        self.yaw_before = Some(std::mem::replace(&mut self.yaw, yaw));
        self.frame = frame;
        Ok(())
    }

    /// Heard within the network.
    fn stop_by(&mut self, stop: Stop) {
        self.workspace.stop_by(stop);
    }

    fn snapshot(&self) -> Option<Snapshot> {
        let state: State = (self.history.clone(), self.yaw, self.frame);
        Some(Snapshot::of(state))
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let (count, vertices) = (self.history.len(), self.next.len());
        let state: &State = snapshot.get(self.frame, |(history, ..): &State| {
            history.len() == count && history.iter().all(|frame| frame.len() == vertices)
        })?;
        (self.history, self.yaw, self.frame) = state.clone();
        self.yaw_before = None;
        Ok(())
    }
}

/// The frames of the history, the yaw and the number of the newest frame.
type State = (Vec<Vec<Vec3>>, Yaw, usize);

impl Correctable for LearnedStepper {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        check_frame(self.frame, positions, self.graph.vertex_count())?;
        let newest = self.history.len() - 1;
        self.history[newest].copy_from_slice(positions);
        Ok(())
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        check_frame(self.frame + 1, positions, self.graph.vertex_count())?;
        self.yaw = self.yaw_now();
        self.history.rotate_left(1);
        let newest = self.history.len() - 1;
        self.history[newest].copy_from_slice(positions);
        self.yaw_before = None;
        self.frame += 1;
        Ok(())
    }

    fn undo_step(&mut self) {
        let Some(yaw) = self.yaw_before.take() else {
            return;
        };
        let newest = self.history.len() - 1;
        std::mem::swap(&mut self.history[newest], &mut self.next);
        self.history.rotate_right(1);
        self.yaw = yaw;
        self.frame -= 1;
    }
}

/// Checks the number of positions, and that all of them are finite.
fn check_frame(frame: usize, positions: &[Vec3], vertices: usize) -> Result<(), StepError> {
    assert_eq!(positions.len(), vertices, "positions");
    require_finite(positions).map_err(|NonFinite { vertex }| StepError::NonFinite { frame, vertex })
}

#[cfg(test)]
mod tests;
