//! The schedule by which handles let go of the cloth and take hold of it again.
//!
//! A handle holds unless a release says otherwise. Times are in seconds from the start of the
//! motion; what counts is the start of a frame's step: a handle is free over every step that begins
//! within a release. A handle that takes hold again does so of the cloth where it then is, and from
//! there moves by as much as its path does.

use serde::{Deserialize, Serialize};

use crate::error::{SceneError, require};

/// A span of time in which some handles are let go.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Release {
    /// Numbers in the list of handles, from 0.
    pub handles: Vec<usize>,
    /// When they let go `[s]`.
    pub from: f64,
    /// When they take hold again `[s]`; never, if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<f64>,
}

/// All releases of a scene's handles; none by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct HandleSchedule {
    /// Releases in any order. Spans of one handle may touch, but not overlap.
    pub releases: Vec<Release>,
}

/// Frames: a time such as 0.1 s is meant to be a whole number of frames though it is none in
/// binary.
const ROUNDING: f64 = 1e-6;

impl HandleSchedule {
    /// Returns true when all handles hold all the time.
    pub fn is_empty(&self) -> bool {
        self.releases.is_empty()
    }

    /// Checks the releases of `handle_count` handles.
    ///
    /// # Errors
    /// Names the release, the field and what was found.
    pub fn validate(&self, handle_count: usize) -> Result<(), SceneError> {
        for (release, span) in self.releases.iter().enumerate() {
            if let Some(&handle) = span.handles.iter().find(|h| **h >= handle_count) {
                return Err(SceneError(format!(
                    "released[{release}] names handle {handle}, but the scene has {handle_count} handles (numbered from 0)"
                )));
            }
            let field = |key: &str| format!("released[{release}].{key}");
            let holds = span.from.is_finite() && span.from >= 0.0;
            require(holds, field("from"), "finite and not negative", span.from)?;
            if let Some(to) = span.to {
                let holds = to.is_finite() && to > span.from;
                require(holds, field("to"), "finite and later than from", to)?;
            }
        }
        self.check_overlaps()
    }

    fn check_overlaps(&self) -> Result<(), SceneError> {
        let mut spans: Vec<(usize, usize)> = Vec::new();
        for (release, span) in self.releases.iter().enumerate() {
            spans.extend(span.handles.iter().map(|&handle| (handle, release)));
        }
        let from = |release: usize| self.releases[release].from;
        spans.sort_by(|a, b| a.0.cmp(&b.0).then(from(a.1).total_cmp(&from(b.1))));
        for pair in spans.windows(2) {
            let [(handle, earlier), (same, later)] = [pair[0], pair[1]];
            let end = self.releases[earlier].to.unwrap_or(f64::INFINITY);
            if handle == same && from(later) < end {
                return Err(SceneError(format!(
                    "released[{later}].from is {}, before released[{earlier}] of the same handle {handle} has ended: make one span of them, or let one end before the other begins",
                    from(later)
                )));
            }
        }
        Ok(())
    }

    /// Marks which of `handle_count` handles have been let go in the step from `frame` to the next
    /// or in one before it, at `frame_rate` frames per second, `[handles]`; it may have taken hold
    /// again.
    pub fn let_go_by(&self, frame: usize, frame_rate: f64, handle_count: usize) -> Vec<bool> {
        self.marked(handle_count, |span| {
            let first = (span.from * frame_rate - ROUNDING).ceil();
            first <= frame as f64 && first + ROUNDING < end(span, frame_rate)
        })
    }

    /// Marks which of `handle_count` handles are let go during the step from `frame` to the next at
    /// `frame_rate` frames per second, `[handles]`.
    pub fn released(&self, frame: usize, frame_rate: f64, handle_count: usize) -> Vec<bool> {
        let now = frame as f64 + ROUNDING;
        self.marked(handle_count, |span| {
            (span.from * frame_rate..end(span, frame_rate)).contains(&now)
        })
    }

    /// Marks the handles of the spans that count.
    fn marked(&self, handle_count: usize, counts: impl Fn(&Release) -> bool) -> Vec<bool> {
        let mut marked = vec![false; handle_count];
        for span in self.releases.iter().filter(|span| counts(span)) {
            for &handle in span.handles.iter().filter(|h| **h < handle_count) {
                marked[handle] = true;
            }
        }
        marked
    }
}

/// The end of a span in frames.
fn end(span: &Release, frame_rate: f64) -> f64 {
    span.to.map_or(f64::INFINITY, |to| to * frame_rate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::refuses;

    fn schedule() -> HandleSchedule {
        let release = |handles: &[usize], from, to| Release {
            handles: handles.to_vec(),
            from,
            to,
        };
        HandleSchedule {
            releases: vec![release(&[0, 2], 0.1, Some(0.3)), release(&[1], 0.2, None)],
        }
    }

    #[test]
    fn steps_that_begin_within_a_release_are_free() {
        let schedule = schedule();
        schedule.validate(3).unwrap();
        let free: Vec<Vec<bool>> = (0..5).map(|f| schedule.released(f, 10.0, 3)).collect();
        assert_eq!(free[0], [false; 3]);
        assert_eq!(free[1], [true, false, true]);
        assert_eq!(free[2], [true; 3]);
        assert_eq!(free[3], [false, true, false]);
        assert_eq!(free[4], [false, true, false]);
        // 0.1 s is frame 6 of 60 per second, and 0.3 s frame 18, though neither is exact.
        let sixty: Vec<bool> = (0..20).map(|f| schedule.released(f, 60.0, 3)[0]).collect();
        let expected: Vec<bool> = (0..20).map(|f| (6..18).contains(&f)).collect();
        assert_eq!(sixty, expected);
    }

    #[test]
    fn a_handle_has_let_go_from_its_first_free_step_on() {
        for (rate, frames) in [(10.0, 6), (60.0, 30), (7.0, 9)] {
            let mut ever = vec![false; 3];
            for frame in 0..frames {
                for (ever, now) in ever.iter_mut().zip(schedule().released(frame, rate, 3)) {
                    *ever |= now;
                }
                assert_eq!(schedule().let_go_by(frame, rate, 3), ever, "{frame}");
            }
        }
        // No step begins in so short a time.
        let mut short = schedule();
        short.releases[0].from = 0.11;
        short.releases[0].to = Some(0.19);
        assert_eq!(short.let_go_by(9, 10.0, 3), [false, true, false]);
    }

    #[test]
    fn spans_of_a_handle_may_touch() {
        let mut schedule = schedule();
        schedule.releases[0].to = Some(0.2);
        schedule.releases[1].handles = vec![0];
        schedule.validate(3).unwrap();
        schedule.releases.reverse();
        schedule.validate(3).unwrap();
    }

    #[test]
    fn wrong_releases_are_named() {
        assert!(schedule().validate(2).is_err());
        let validate = |s: &HandleSchedule| s.validate(3);
        refuses(
            &schedule(),
            validate,
            &[
                ("released[0] names handle 3, but the scene has 3", |s| {
                    s.releases[0].handles = vec![3];
                }),
                ("released[1].from must be", |s| s.releases[1].from = -1.0),
                ("released[0].to must be", |s| s.releases[0].to = Some(0.1)),
                ("released[0].to must", |s| s.releases[0].to = Some(f64::NAN)),
                (
                    "released[1].from is 0.2, before released[0] of the same handle 2 has ended",
                    |s| s.releases[1].handles = vec![1, 2],
                ),
            ],
        );
    }
}
