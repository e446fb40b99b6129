//! A method on its way along a case.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use glam::DVec3;
use selvedge_cloth::{HandlePath, Stepper};
use selvedge_guard::{Correction, Guard};
use selvedge_sim::Simulator;

use super::method::{Method, Mover};
use super::truth::{Prepared, Truth, simulator};
use crate::event::Reporter;
use crate::machine;
use crate::rigid::RigidRest;
use crate::watched::GuardSummary;
use selvedge::start::WITHOUT_GUARD;

/// Frames that are timed at most, and the time after which there are enough.
const TIMED: usize = 120;
const PATIENCE: Duration = Duration::from_secs(2);

/// A cloth on its way from a state of its case.
pub(super) struct Runner {
    cloth: Cloth,
    path: HandlePath,
    samples_per_frame: usize,
    frame: usize,
}

enum Cloth {
    Guarded(Box<Guard<machine::Mover>>, GuardSummary),
    Physics(Box<Simulator>),
    Other(Box<dyn Stepper>),
}

impl Runner {
    /// Starts `method` in the true state of `frame`, with the true frames before it.
    pub(super) fn start(
        method: &Method,
        prepared: &Prepared<'_>,
        truth: &Truth,
        frame: usize,
    ) -> Result<Self> {
        let state = || {
            truth
                .state(frame)
                .context("there is no true state to start from")
        };
        let (cloth, of_scene, samples_per_frame) = match &method.mover {
            Mover::Rigid => {
                let rest = RigidRest::new(truth.trajectory.cloth());
                (Cloth::Other(Box::new(rest)), false, 1)
            }
            Mover::Physics(physics) => {
                let scene = physics.scene(truth.scene()?);
                let cloth = simulator(&scene, state()?, frame)?;
                let samples = physics.substeps as usize;
                (Cloth::Physics(Box::new(cloth)), true, samples)
            }
            Mover::Model(model, guard, machine) => {
                let known = truth.known(frame, model.spec().history());
                let graph = selvedge_train::graph_of(&prepared.case.name, &truth.trajectory)?;
                let stepper = machine.start(model, graph.taken_up_at(frame), &known)?;
                let cloth = match guard {
                    Correction::None => Cloth::Other(Box::new(stepper)),
                    _ => {
                        let (cloth, rate) =
                            (truth.trajectory.cloth(), truth.trajectory.frame_rate());
                        let scene = truth.scene.as_ref().ok().map(Arc::clone);
                        let guarded = Guard::new(stepper, cloth, rate, scene, *guard);
                        let guarded = guarded.context(WITHOUT_GUARD)?;
                        Cloth::Guarded(Box::new(guarded), GuardSummary::default())
                    }
                };
                (cloth, false, 1)
            }
        };
        Ok(Self {
            cloth,
            path: truth.path(of_scene)?,
            samples_per_frame,
            frame,
        })
    }

    /// Moves the cloth by a frame.
    pub(super) fn step(&mut self) -> Result<()> {
        let cloth: &mut dyn Stepper = match &mut self.cloth {
            Cloth::Guarded(cloth, _) => &mut **cloth,
            Cloth::Physics(cloth) => &mut **cloth,
            Cloth::Other(cloth) => &mut **cloth,
        };
        // Its own frames may count from where it started.
        self.path.follow(self.frame, &cloth.handle_places());
        let targets = self.path.targets(self.frame, self.samples_per_frame)?;
        cloth.step(&targets)?;
        if let Cloth::Guarded(cloth, summary) = &mut self.cloth {
            summary.add(cloth.trust());
        }
        self.frame += 1;
        Ok(())
    }

    /// Positions now `[m]`, `[vertices]`.
    pub(super) fn positions(&self) -> Vec<DVec3> {
        let of = |stepper: &dyn Stepper| stepper.positions().iter().map(|p| p.as_dvec3()).collect();
        match &self.cloth {
            Cloth::Guarded(cloth, _) => of(&**cloth),
            Cloth::Physics(cloth) => cloth.positions_f64().to_vec(),
            Cloth::Other(cloth) => of(&**cloth),
        }
    }

    /// Counts of the guard so far; none without a guard.
    pub(super) fn guarded(&self) -> Option<GuardSummary> {
        match &self.cloth {
            Cloth::Guarded(_, summary) => Some(*summary),
            Cloth::Physics(_) | Cloth::Other(_) => None,
        }
    }

    /// The median time of the next frames, at most so many `[ms]`; none where there was none, or
    /// an end is asked for.
    pub(super) fn milliseconds(mut self, frames: usize, reporter: &Reporter<'_>) -> Option<f64> {
        let begun = Instant::now();
        let mut times = Vec::with_capacity(TIMED);
        while times.len() < frames.min(TIMED) && begun.elapsed() < PATIENCE {
            if reporter.is_stopped() {
                return None;
            }
            let before = Instant::now();
            if self.step().is_err() {
                break;
            }
            times.push(1e3 * before.elapsed().as_secs_f64());
        }
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied()
    }
}
