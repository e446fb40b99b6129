//! One run: a method along a case, measured against the truth.

use std::ops::ControlFlow;

use anyhow::{Context, Result, bail};
use glam::{DVec3, Vec3};
use selvedge_cloth::Scene;
use selvedge_data::metrics::{self, Character};
use selvedge_data::{Frames, Trajectory};
use selvedge_model::{Departure, Model};

use super::case::{Case, Source};
use super::measures::Gauge;
use super::method::{Kind, Method, Mover};
use super::run::Run;
use super::runner::Runner;
use super::truth::{Prepared, Truth};
use crate::cause::chain;
use crate::domain;
use crate::event::Task;
use crate::physics;
use crate::watched;

/// Ways in which a case goes beyond the training of a model.
pub(super) fn departures(
    model: &Model,
    case: &Case,
    trajectory: Option<&Trajectory>,
) -> Result<Vec<Departure>> {
    let of_scene = |scene: &Scene, frames| {
        let beyond = domain::of_scene(model, scene, frames)?;
        Ok(beyond.map_or_else(Vec::new, |beyond| beyond.departures))
    };
    match (&case.source, trajectory) {
        (Source::Converged(loaded, _) | Source::Random(loaded, ..), _) => {
            let frames = case.span().map_or(0, |[_, last]| last);
            of_scene(&loaded.scene, frames)
        }
        (Source::Recorded(..), Some(trajectory)) => {
            let found = domain::of_trajectory(model, &case.name, trajectory)?;
            Ok(found.unwrap_or_default())
        }
        (Source::Recorded(..), None) => Ok(Vec::new()),
    }
}

/// A case that is run along.
pub(super) struct Course<'a, 't, 'l> {
    pub(super) prepared: &'a Prepared<'a>,
    pub(super) truth: &'a Truth,
    pub(super) gauge: Gauge<'a>,
    pub(super) task: &'a Task<'t, 'l>,
}

impl Course<'_, '_, '_> {
    /// Runs `method` from the true state of frame `start` and measures it so many `frames` after that;
    /// a whole run is measured in all. None where an end is asked for.
    pub(super) fn run(
        &self,
        (method, kind): &(Method, Kind),
        start: usize,
        frames: &[usize],
        is_whole: bool,
    ) -> Option<Run> {
        let case = self.prepared.case;
        let mut run = Run {
            set: case.set.clone(),
            case: case.name.clone(),
            mesh: self.prepared.mesh.clone(),
            method: method.name.clone(),
            kind: *kind,
            start,
            is_whole,
            frame_rate: self.truth.trajectory.frame_rate(),
            frames: Vec::new(),
            diverged_frame: None,
            final_speed: None,
            guarded: None,
            character: None,
            out_of_distribution: Vec::new(),
            failure: None,
        };
        match self.steps(method, frames, &mut run) {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(())) => return None,
            Err(error) => run.failure = Some(chain(error.as_ref())),
        }
        if is_whole {
            let strains: Vec<f64> = run.frames.iter().map(|at| at.largest_strain).collect();
            let errors = run.frames.iter().filter_map(|at| at.errors.as_ref());
            let true_largest = errors.map(|e| e.true_largest_strain).fold(0.0, f64::max);
            let diverged = watched::diverged_frame(&strains, true_largest);
            let lost = (strains.len() < frames.len()).then_some(strains.len() + 1);
            run.diverged_frame = diverged.or(lost);
        }
        Some(run)
    }

    fn steps(&self, method: &Method, measured: &[usize], run: &mut Run) -> Result<ControlFlow<()>> {
        let (case, truth) = (self.prepared.case, self.truth);
        if let (Mover::Model(model, ..), true) = (&method.mover, run.is_whole) {
            run.out_of_distribution = departures(model, case, Some(&truth.trajectory))?;
        }
        let mut runner = Runner::start(method, self.prepared, truth, run.start)?;
        let mut positions: Vec<Vec3> = Vec::new();
        let mut keep = |now: &[DVec3]| {
            if run.is_whole && case.has_truth() {
                positions.extend(physics::rounded(now));
            }
        };
        keep(&runner.positions());
        let frames = measured.last().copied().unwrap_or(0);
        let last_second = frames.min(run.frame_rate.round().max(1.0) as usize);
        let mut second: Vec<Vec3> = Vec::new();
        for frame in 1..=frames {
            if self.task.advance().is_break() {
                return Ok(ControlFlow::Break(()));
            }
            runner
                .step()
                .with_context(|| format!("frame {}", run.start + frame))?;
            run.guarded = runner.guarded();
            if measured.binary_search(&frame).is_ok() {
                let found = runner.positions();
                let expected = truth.positions(run.start + frame);
                let expected = expected.filter(|_| case.has_truth());
                let at = self.gauge.measure(frame, &found, expected.as_deref());
                if !at.is_finite() {
                    bail!("frame {frame} has a measure that is not finite");
                }
                run.frames.push(at);
                keep(&found);
                if frame + last_second >= frames {
                    second.extend(physics::rounded(&found));
                }
            }
        }
        if run.is_whole {
            let second = Frames::new(&second, truth.trajectory.vertex_count())?;
            run.final_speed = metrics::final_speed(second, run.frame_rate).ok();
        }
        if !positions.is_empty() {
            run.character = Some(self.character(run.start, &positions)?);
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The character of a run from frame `start` on, and that of as many frames of the truth.
    fn character(&self, start: usize, positions: &[Vec3]) -> Result<(Character, Character)> {
        let trajectory = &self.truth.trajectory;
        let found = Frames::new(positions, trajectory.vertex_count())?;
        let from = start - self.truth.first;
        let expected = trajectory.frames().last(trajectory.frame_count() - from);
        let of = |frames| Character::of(frames, trajectory.cloth(), trajectory.frame_rate());
        Ok((of(found)?, of(expected.first(found.len()))?))
    }
}
