//! Handles: the vertices whose motion is given, and where they are to be in a frame.

use glam::DVec3;
use serde::Serialize;
use thiserror::Error;

use crate::{StepError, VertexId};

/// The handle vertices of a cloth: distinct and in range. Their order is the order of every list
/// of handle positions. There may be none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Handles {
    vertices: Vec<VertexId>,
}

/// A list of vertices that cannot be the handles of a mesh, or targets that are not theirs.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum HandleError {
    #[error("expected targets for {expected} handles, found {found}")]
    Count { expected: usize, found: usize },
    #[error("{0}")]
    Unusable(String),
}

impl HandleError {
    /// The error of the step to this frame.
    pub fn at(self, frame: usize) -> StepError {
        let source = self;
        StepError::Handles { frame, source }
    }
}

impl Handles {
    /// Makes `vertices` the handles of a mesh with `vertex_count` vertices.
    ///
    /// # Errors
    /// Names the handle that is out of range or named twice.
    pub fn new(vertices: &[u32], vertex_count: usize) -> Result<Self, HandleError> {
        let vertices: Vec<VertexId> = vertices.iter().copied().map(VertexId).collect();
        let handles = Self { vertices };
        handles.check_range(vertex_count)?;
        let mut seen = std::collections::HashSet::new();
        match handles
            .vertices
            .iter()
            .find(|vertex| !seen.insert(**vertex))
        {
            Some(vertex) => Err(HandleError::Unusable(format!(
                "vertex {vertex} is named twice as a handle"
            ))),
            None => Ok(handles),
        }
    }

    /// Checks that each handle is a vertex of a mesh with `vertex_count` vertices.
    ///
    /// # Errors
    /// Names the first handle that is not.
    pub fn check_range(&self, vertex_count: usize) -> Result<(), HandleError> {
        let mut handles = self.vertices.iter().enumerate();
        match handles.find(|(_, vertex)| vertex.index() >= vertex_count) {
            Some((handle, vertex)) => Err(HandleError::Unusable(format!(
                "handle {handle} is vertex {vertex}, but the mesh has {vertex_count} vertices (0 to {})",
                vertex_count.saturating_sub(1)
            ))),
            None => Ok(()),
        }
    }

    /// The handles for which `keep`, `[handles]`, says so, in the same order.
    pub fn subset(&self, keep: &[bool]) -> Self {
        let kept = self.vertices.iter().zip(keep).filter(|(_, keep)| **keep);
        Self {
            vertices: kept.map(|(vertex, _)| *vertex).collect(),
        }
    }

    /// The handle vertices, in the order they were given, `[handles]`.
    pub fn vertices(&self) -> &[VertexId] {
        &self.vertices
    }

    /// Number of handles.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Returns true when the cloth is free.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Marks the vertices that are handles, `[vertices]`.
    pub fn mask(&self, vertex_count: usize) -> Vec<bool> {
        let mut mask = vec![false; vertex_count];
        for vertex in &self.vertices {
            mask[vertex.index()] = true;
        }
        mask
    }

    /// The entries of `positions` (`[vertices]`) at the handles, one after the other.
    pub fn of<'a, T: Copy>(
        &'a self,
        positions: &'a [T],
    ) -> impl ExactSizeIterator<Item = T> + Clone + 'a {
        self.vertices.iter().map(|v| positions[v.index()])
    }

    /// The entries of `positions` (`[vertices]`) at the handles, `[handles]`.
    pub fn select<T: Copy>(&self, positions: &[T]) -> Vec<T> {
        self.of(positions).collect()
    }
}

/// Targets of the handles for one frame: their positions at equally spaced times, the last
/// of them the end of the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct HandleTargets {
    samples: Vec<DVec3>,
    handle_count: usize,
    /// Marks the handles that are let go, `[handles]`; empty where none is.
    released: Vec<bool>,
}

impl HandleTargets {
    /// Targets at the end of the frame only `[m]`, `[handles]`.
    ///
    /// # Errors
    /// A target that is not finite.
    pub fn at_frame_end(positions: Vec<DVec3>) -> Result<Self, HandleError> {
        let handle_count = positions.len();
        Self::sampled(positions, handle_count)
    }

    /// Targets at `samples.len() / handle_count` equally spaced times `[m]`,
    /// `[samples, handle_count]`, the last at the end of the frame.
    ///
    /// # Errors
    /// [`HandleError::Count`] when the length is no multiple of `handle_count`, or a target that is
    /// not finite.
    pub fn sampled(samples: Vec<DVec3>, handle_count: usize) -> Result<Self, HandleError> {
        let whole = match handle_count {
            0 => samples.is_empty(),
            n => !samples.is_empty() && samples.len().is_multiple_of(n),
        };
        if !whole {
            return Err(HandleError::Count {
                expected: handle_count,
                found: samples.len(),
            });
        }
        if let Some(bad) = samples.iter().position(|p| !p.is_finite()) {
            return Err(HandleError::Unusable(format!(
                "the target of handle {} is not finite: {}",
                bad % handle_count,
                samples[bad]
            )));
        }
        Ok(Self {
            samples,
            handle_count,
            released: Vec::new(),
        })
    }

    /// The same targets, with the handles let go for which `released`, `[handles]`, says so: their
    /// vertices are free during this frame, and their targets only tell where their paths lead.
    ///
    /// # Errors
    /// [`HandleError::Count`].
    pub fn releasing(mut self, released: Vec<bool>) -> Result<Self, HandleError> {
        if released.len() != self.handle_count {
            return Err(HandleError::Count {
                expected: self.handle_count,
                found: released.len(),
            });
        }
        self.released = released;
        Ok(self)
    }

    /// Returns true when `handle` holds the cloth during this frame.
    pub fn holds(&self, handle: usize) -> bool {
        !self.released.get(handle).copied().unwrap_or(false)
    }

    /// The vertices of `handles` that hold during this frame, with their targets at its end `[m]`.
    pub fn held<'a>(
        &'a self,
        handles: &'a Handles,
    ) -> impl Iterator<Item = (VertexId, DVec3)> + 'a {
        let all = handles.vertices().iter().zip(self.end()).enumerate();
        let held = all.filter(|(handle, _)| self.holds(*handle));
        held.map(|(_, (vertex, target))| (*vertex, *target))
    }

    /// Checks that every handle holds, for a stepper that cannot let go.
    ///
    /// # Errors
    /// Names the first that does not.
    pub fn require_all_hold(&self) -> Result<(), HandleError> {
        match self.released.iter().position(|released| *released) {
            Some(handle) => Err(HandleError::Unusable(format!(
                "handle {handle} is let go, which this model cannot follow: use `selvedge run`, or on the processor a network with inertial integration; or give every handle a motion without releases"
            ))),
            None => Ok(()),
        }
    }

    /// Marks the handles that are let go during this frame, `[handles]`.
    pub fn let_go(&self) -> Vec<bool> {
        (0..self.handle_count).map(|h| !self.holds(h)).collect()
    }

    /// Number of handles.
    pub fn handle_count(&self) -> usize {
        self.handle_count
    }

    /// Targets at the end of the frame `[m]`, `[handles]`.
    pub fn end(&self) -> &[DVec3] {
        &self.samples[self.samples.len() - self.handle_count..]
    }

    /// Returns true if all samples are these places `[m]`, `[handles]`.
    pub fn stay_at(&self, places: &[DVec3]) -> bool {
        let mut samples = self.samples.chunks(self.handle_count.max(1));
        samples.all(|sample| sample == places)
    }

    /// Target of `handle` at `fraction` of the frame, in (0, 1]; linear between the samples, and
    /// from `start` (its position at the start of the frame) to the first.
    ///
    /// # Panics
    /// When `handle` is not below [`Self::handle_count`], as for a slice; so always where there are
    /// no handles.
    pub fn at(&self, handle: usize, fraction: f64, start: DVec3) -> DVec3 {
        let sample = |k: usize| match k {
            0 => start,
            k => self.samples[(k - 1) * self.handle_count + handle],
        };
        match self.place(handle, fraction) {
            (on, 0.0) => sample(on),
            (before, part) => sample(before).lerp(sample(before + 1), part),
        }
    }

    /// The sample before `fraction`, counted from 1, 0 for the start, and the part of the way to the
    /// next.
    fn place(&self, handle: usize, fraction: f64) -> (usize, f64) {
        let handles = self.handle_count;
        assert!(handle < handles, "handle {handle} of {handles} handles");
        let count = self.sample_count() as f64;
        let place = (fraction.clamp(0.0, 1.0) * count).min(count);
        // A substep that falls on a sample reads it without rounding.
        let nearest = place.round();
        if (place - nearest).abs() < 1e-9 {
            (nearest as usize, 0.0)
        } else {
            (place.floor() as usize, place - place.floor())
        }
    }

    /// Number of times in the frame; 0 without handles.
    pub fn sample_count(&self) -> usize {
        self.samples.len() / self.handle_count.max(1)
    }

    /// Adds what a derivative `by` the target of [`Self::at`] is by the samples to `by_samples`,
    /// `[samples, handles]`; returns what it is by the start.
    ///
    /// # Panics
    /// As for [`Self::at`].
    pub fn pull_back(
        &self,
        handle: usize,
        fraction: f64,
        by: DVec3,
        by_samples: &mut [DVec3],
    ) -> DVec3 {
        let (before, part) = self.place(handle, fraction);
        let mut by_start = DVec3::ZERO;
        for (sample, weight) in [(before, 1.0 - part), (before + 1, part)] {
            match sample.checked_sub(1) {
                None => by_start += by * weight,
                Some(k) if weight > 0.0 => {
                    by_samples[k * self.handle_count + handle] += by * weight
                }
                Some(_) => {}
            }
        }
        by_start
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_are_distinct_and_in_range() {
        let handles = Handles::new(&[4, 1], 5).unwrap();
        assert_eq!(handles.vertices(), [VertexId(4), VertexId(1)]);
        assert_eq!(handles.mask(5), [false, true, false, false, true]);
        assert_eq!(handles.select(&['a', 'b', 'c', 'd', 'e']), ['e', 'b']);
        let wrong = |vertices: &[u32]| Handles::new(vertices, 5).unwrap_err().to_string();
        let expected = "handle 1 is vertex 5, but the mesh has 5 vertices (0 to 4)";
        assert_eq!(wrong(&[0, 5]), expected);
        assert_eq!(wrong(&[2, 3, 2]), "vertex 2 is named twice as a handle");
        let last = handles.subset(&[false, true]);
        assert_eq!(last.vertices(), [VertexId(1)]);
        let free = Handles::new(&[], 5).unwrap();
        assert!(free.is_empty() && free.select(&[0.0; 5]).is_empty());
    }

    #[test]
    fn targets_are_counted_and_finite() {
        let count =
            |samples: usize, handles| HandleTargets::sampled(vec![DVec3::ZERO; samples], handles);
        assert_eq!(count(6, 2).unwrap().end().len(), 2);
        for (found, expected) in [(5, 2), (0, 2), (1, 0)] {
            let error = HandleError::Count { expected, found };
            assert_eq!(count(found, expected), Err(error));
        }
        assert!(count(0, 0).unwrap().end().is_empty());
        // The fourth sample is the second handle's, at the second time.
        let mut samples = vec![DVec3::ZERO; 4];
        samples[3].z = f64::NAN;
        let error = HandleTargets::sampled(samples, 2).unwrap_err().to_string();
        let words = "the target of handle 1 is not finite";
        assert!(error.starts_with(words), "{error}");
    }

    #[test]
    #[should_panic(expected = "handle 1 of 1 handles")]
    fn another_time_is_never_read_as_another_handle() {
        let targets = HandleTargets::sampled(vec![DVec3::X, DVec3::Y], 1).unwrap();
        let _ = targets.at(1, 0.5, DVec3::ZERO);
    }

    #[test]
    fn targets_are_linear_between_samples() {
        // Handle 0 and 1 at four times of the frame: k² and -k².
        let sample = |k: i32| [DVec3::X, DVec3::NEG_X].map(|x| x * f64::from(k * k));
        let targets = HandleTargets::sampled((1..=4).flat_map(sample).collect(), 2).unwrap();
        assert_eq!(targets.end(), sample(4));
        for k in 1..=4 {
            let fraction = f64::from(k) / 4.0;
            assert_eq!(targets.at(1, fraction, DVec3::ZERO), sample(k)[1]);
            // Half way from the sample before, or from where the handle was.
            let start = DVec3::Y * 2.0;
            let before = if k == 1 { start } else { sample(k - 1)[0] };
            let middle = (before + sample(k)[0]) / 2.0;
            assert_eq!(targets.at(0, fraction - 0.125, start), middle);
        }
        // Three substeps of a frame that was sampled once: thirds of the way.
        let once = HandleTargets::at_frame_end(vec![DVec3::X * 3.0]).unwrap();
        let third = once.at(0, 1.0 / 3.0, DVec3::ZERO);
        assert!(third.distance(DVec3::X) < 1e-15);
        let end = once.at(0, 2.0 / 3.0 + 1.0 / 3.0, DVec3::ZERO);
        assert_eq!(end, DVec3::X * 3.0);
    }

    #[test]
    fn a_handle_holds_unless_it_is_let_go() {
        let targets = || HandleTargets::at_frame_end(vec![DVec3::X, DVec3::Y]).unwrap();
        assert!(targets().holds(0) && targets().holds(1));
        assert_eq!(targets().require_all_hold(), Ok(()));
        let one = targets().releasing(vec![false, true]).unwrap();
        assert!(one.holds(0) && !one.holds(1));
        let error = one.require_all_hold().unwrap_err().to_string();
        assert!(error.starts_with("handle 1 is let go"), "{error}");
        assert!(targets().releasing(vec![true]).is_err());
        let none = targets().releasing(vec![false; 2]).unwrap();
        assert_eq!(none.require_all_hold(), Ok(()));
    }
}
