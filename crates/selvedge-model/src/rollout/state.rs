//! A cloth in a rollout: the frames that its model looks at, and how a step goes on from them.

use glam::Vec3;
use selvedge_cloth::{HandleTargets, Snapshot, StepError, VertexId};
use thiserror::Error;

use crate::features::{Frames, Place, Window};
use crate::graph::ClothGraph;
use crate::graph::frame::Yaw;
use crate::rollout::advance::{LocalAcceleration, NonFinite, TwoFrames, advance, require_finite};
use crate::rollout::model::Model;
use crate::spec::ModelSpec;

/// A cloth that a model moves, and its last frames.
///
/// A step has three parts, of which the last cannot fail: [`Self::begin_step`], the network on
/// [`Self::features`], [`Self::predict`], then [`Self::accept`]. A step that ends before it is
/// accepted leaves the cloth as it was.
pub(super) struct RolloutState {
    graph: ClothGraph,
    /// Positions of the frames before the window and of each frame of it, oldest first; the
    /// oldest buffer receives the next frame.
    history: Vec<Vec<Vec3>>,
    next: Vec<Vec3>,
    next_handles: Vec<Vec3>,
    yaw: Yaw,
    /// Yaw of the step that has begun.
    yaw_of_step: Yaw,
    /// Yaw before the last step, while that step can be undone: `next` then holds the frame that
    /// left the history.
    yaw_before: Option<Yaw>,
    /// The last step brought back edges that were beyond their bounds.
    pub(super) is_strained: bool,
    frame: usize,
    features: Window,
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

/// The frames that a rollout of `spec` begins with, oldest first, from the last ones before now.
fn opening_frames(
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
        require_finite(frame).map_err(|NonFinite { vertex }| RolloutError::NonFinite { vertex })?;
    }
    let still = std::iter::repeat_n(first, needed.saturating_sub(start.len()));
    let recent = &start[start.len().saturating_sub(needed)..];
    let frames = still.chain(recent.iter().copied());
    Ok(frames.map(<[_]>::to_vec).collect())
}

impl RolloutState {
    /// Starts from the last frames before now, oldest first `[m]`, `[frames][vertices]`. If the
    /// model needs more frames, the cloth is taken to have stood still before the first.
    ///
    /// # Errors
    /// [`RolloutError`] when there is no frame, or one that does not fit the cloth, or the model
    /// needs fabrics that are not known.
    pub(super) fn new(
        spec: &ModelSpec,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Self, RolloutError> {
        let yaw = graph.frame().rest_yaw();
        Ok(Self {
            history: opening_frames(spec, &graph, start)?,
            next: vec![Vec3::ZERO; graph.vertex_count()],
            next_handles: Vec::new(),
            yaw,
            yaw_of_step: yaw,
            yaw_before: None,
            is_strained: false,
            frame: 0,
            features: Window::default(),
            acceleration: Vec::new(),
            graph,
        })
    }

    /// The cloth.
    pub(super) fn graph(&self) -> &ClothGraph {
        &self.graph
    }

    /// Positions of the newest frame `[m]`, `[vertices]`.
    pub(super) fn positions(&self) -> &[Vec3] {
        &self.history[self.history.len() - 1]
    }

    /// Frames done.
    pub(super) fn frame(&self) -> usize {
        self.frame
    }

    /// The normalised features of the step that has begun.
    pub(super) fn features(&self) -> &Window {
        &self.features
    }

    /// The yaw of the cloth now: it stays while a handle has let go.
    fn yaw_now(&self) -> Yaw {
        let handles = self.graph.handles();
        let mut held = handles.of(self.graph.handle_mask());
        if held.all(|holds| holds) {
            let places = handles.of(self.positions());
            self.graph.frame().yaw_of(places, self.yaw)
        } else {
            self.yaw
        }
    }

    /// Begins the step to `targets`, of which there is one for each handle: makes its features.
    ///
    /// # Errors
    /// [`StepError::NonFinite`] for a feature that is not finite.
    pub(super) fn begin_step(
        &mut self,
        model: &Model,
        targets: &HandleTargets,
    ) -> Result<(), StepError> {
        // `next` is about to be overwritten.
        self.yaw_before = None;
        self.graph.hold(|handle| targets.holds(handle));
        self.graph.set_step(self.frame);
        self.yaw_of_step = self.yaw_now();
        self.next_handles.clear();
        let places = targets.end().iter().map(|p| p.as_vec3());
        self.next_handles.extend(places);
        let (spec, place) = (model.spec(), Place::alone(&self.graph));
        let frames = Frames {
            positions: &self.history,
            next_handles: &self.next_handles,
            yaw: self.yaw_of_step,
        };
        self.features.write(spec, &self.graph, frames, &place);
        let normalizers = model.normalizers();
        self.features
            .normalize(&normalizers.nodes, &normalizers.edges);
        let connectivity = self.graph.connectivity();
        match self.features.first_non_finite(spec, connectivity) {
            Some(vertex) => Err(not_finite(self.frame + 1)(NonFinite { vertex })),
            None => Ok(()),
        }
    }

    /// The next frame of the step that has begun, from the network's output for [`Self::features`].
    ///
    /// # Errors
    /// [`StepError::NonFinite`] for a position that is not finite.
    pub(super) fn predict(&mut self, model: &Model, output: &[f32]) -> Result<(), StepError> {
        self.acceleration.clear();
        self.acceleration.extend_from_slice(output);
        let normalizer = &model.normalizers().acceleration;
        normalizer.denormalize(&mut self.acceleration);
        let newest = self.history.len() - 1;
        let frames = TwoFrames {
            graph: &self.graph,
            previous: &self.history[newest - 1],
            current: &self.history[newest],
        };
        let acceleration = LocalAcceleration {
            yaw: self.yaw_of_step,
            rows: &self.acceleration,
        };
        let advanced = advance(&frames, &self.next_handles, acceleration, &mut self.next);
        self.is_strained = advanced.map_err(not_finite(self.frame + 1))?;
        Ok(())
    }

    /// Takes the predicted frame as the newest.
    pub(super) fn accept(&mut self) {
        self.take_next();
        self.yaw_before = Some(std::mem::replace(&mut self.yaw, self.yaw_of_step));
    }

    /// Exchanges the oldest frame for `next`, as the newest.
    fn take_next(&mut self) {
        self.history.rotate_left(1);
        let newest = self.history.len() - 1;
        std::mem::swap(&mut self.history[newest], &mut self.next);
        self.frame += 1;
    }

    /// As `Correctable::replace_frame` of `selvedge-cloth`.
    ///
    /// # Errors
    /// [`StepError::NonFinite`]; the cloth is left as it was.
    ///
    /// # Panics
    /// When there are not as many positions as vertices.
    pub(super) fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.check(self.frame, positions)?;
        let newest = self.history.len() - 1;
        self.history[newest].copy_from_slice(positions);
        Ok(())
    }

    /// As `Correctable::take_frame` of `selvedge-cloth`.
    ///
    /// # Errors
    /// As [`Self::replace_frame`].
    ///
    /// # Panics
    /// As [`Self::replace_frame`].
    pub(super) fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.check(self.frame + 1, positions)?;
        self.yaw = self.yaw_now();
        self.yaw_before = None;
        self.next.copy_from_slice(positions);
        self.take_next();
        Ok(())
    }

    /// As `Correctable::undo_step` of `selvedge-cloth`.
    pub(super) fn undo_step(&mut self) {
        let Some(yaw) = self.yaw_before.take() else {
            return;
        };
        let newest = self.history.len() - 1;
        std::mem::swap(&mut self.history[newest], &mut self.next);
        self.history.rotate_right(1);
        self.yaw = yaw;
        self.frame -= 1;
    }

    /// As `Stepper::snapshot` of `selvedge-cloth`.
    pub(super) fn snapshot(&self) -> Snapshot {
        let kept: Kept = (self.history.clone(), self.yaw, self.frame);
        Snapshot::of(kept)
    }

    /// As `Stepper::rewind` of `selvedge-cloth`.
    ///
    /// # Errors
    /// [`StepError`] for what is no snapshot of this cloth.
    pub(super) fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let (count, vertices) = (self.history.len(), self.next.len());
        let kept: &Kept = snapshot.get(self.frame, |(history, ..): &Kept| {
            history.len() == count && history.iter().all(|frame| frame.len() == vertices)
        })?;
        (self.history, self.yaw, self.frame) = kept.clone();
        self.yaw_before = None;
        Ok(())
    }

    /// Checks the number of positions, and that all of them are finite.
    fn check(&self, frame: usize, positions: &[Vec3]) -> Result<(), StepError> {
        assert_eq!(positions.len(), self.next.len(), "positions");
        require_finite(positions).map_err(not_finite(frame))
    }
}

/// The frames of the history, the yaw and the number of the newest frame.
type Kept = (Vec<Vec<Vec3>>, Yaw, usize);

fn not_finite(frame: usize) -> impl Fn(NonFinite) -> StepError {
    move |NonFinite { vertex }| StepError::NonFinite { frame, vertex }
}
