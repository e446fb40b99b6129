//! A stepper that errs on purpose.

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, Scene, StepError, Stepper, Topology, VertexId,
    check_targets_hold,
};

use super::scene;
use crate::carry::carry;

/// Errors of a [`Double`].
#[derive(Clone, Copy, Debug)]
pub(super) enum Error {
    /// None.
    Never,
    /// Every difference of two frames comes back larger, and noise is added.
    Grows,
    /// A vertex is not a number from frame 20 on, and no error is told.
    NotANumber,
    /// The same in every frame.
    Lost,
    /// From frame 20 on every second step fails.
    Fails,
    /// Every tenth frame is nowhere near.
    Jumps,
    /// Noise of 3 cm in every frame.
    Trembles,
    /// Noise, and no frame can be replaced or taken: a device fails.
    Refuses,
}

/// Carries its frame with the handles, and errs.
pub(super) struct Double {
    pub(super) scene: Scene,
    pub(super) errs: Error,
    pub(super) last: [Vec<Vec3>; 2],
    /// The two frames before the last step, while that can be undone.
    undo: Option<([Vec<Vec3>; 2], ChaCha8Rng)>,
    frame: usize,
    rng: ChaCha8Rng,
    /// Frames that were given to it.
    pub(super) given: usize,
}

impl Double {
    pub(super) fn new(errs: Error) -> Self {
        let scene = scene();
        let start: Vec<Vec3> = scene.mesh.positions().iter().map(|p| p.as_vec3()).collect();
        Self {
            scene,
            errs,
            last: [start.clone(), start],
            undo: None,
            frame: 0,
            rng: ChaCha8Rng::seed_from_u64(5),
            given: 0,
        }
    }

    /// Checks a frame that is not the double's own.
    fn check(&self, frame: usize, positions: &[Vec3]) -> Result<(), StepError> {
        if matches!(self.errs, Error::Refuses) {
            let reason = "it is gone".to_owned();
            return Err(StepError::Device { frame, reason });
        }
        match positions.iter().position(|p| !p.is_finite()) {
            Some(vertex) => Err(StepError::NonFinite {
                frame,
                vertex: VertexId(vertex as u32),
            }),
            None => Ok(()),
        }
    }

    fn err(&mut self, next: &mut [Vec3]) {
        let rng = &mut self.rng;
        let mut noise = |size: f32| {
            let mut draw = || size * (2.0 * rng.random::<f32>() - 1.0);
            Vec3::new(draw(), draw(), draw())
        };
        match self.errs {
            Error::Never | Error::Fails => {}
            Error::Grows => {
                let pairs = self.last[1].iter().zip(&self.last[0]);
                for (next, (p, q)) in next.iter_mut().zip(pairs) {
                    *next += 1.3 * (*p - *q) + noise(0.005);
                }
            }
            Error::Lost => next[17].y = f32::NAN,
            Error::NotANumber if self.frame >= 20 => next[17].y = f32::NAN,
            Error::Jumps if self.frame % 10 == 9 => {
                next.iter_mut().for_each(|p| *p += noise(1e20));
            }
            Error::Trembles | Error::Refuses => next.iter_mut().for_each(|p| *p += noise(0.03)),
            Error::NotANumber | Error::Jumps => {}
        }
    }
}

impl Stepper for Double {
    fn topology(&self) -> &Topology {
        self.scene.mesh.topology()
    }

    fn handles(&self) -> &Handles {
        &self.scene.handles
    }

    fn positions(&self) -> &[Vec3] {
        &self.last[1]
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let frame = self.frame + 1;
        check_targets_hold(self, targets)?;
        self.undo = None;
        if matches!(self.errs, Error::Fails) && frame >= 20 && frame.is_multiple_of(2) {
            let vertex = VertexId(3);
            return Err(StepError::NonFinite { frame, vertex });
        }
        let before = (self.last.clone(), self.rng.clone());
        let mut next = Vec::new();
        carry(&self.scene.handles, &self.last[1], targets, &mut next);
        self.err(&mut next);
        for (vertex, target) in self.scene.handles.vertices().iter().zip(targets.end()) {
            next[vertex.index()] = target.as_vec3();
        }
        if matches!(self.errs, Error::Never) {
            self.check(frame, &next)?;
        }
        self.undo = Some(before);
        self.last.swap(0, 1);
        self.last[1] = next;
        self.frame = frame;
        Ok(())
    }
}

impl Correctable for Double {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.check(self.frame, positions)?;
        self.last[1].copy_from_slice(positions);
        self.given += 1;
        Ok(())
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.check(self.frame + 1, positions)?;
        self.undo = None;
        self.last.swap(0, 1);
        self.last[1].copy_from_slice(positions);
        self.given += 1;
        self.frame += 1;
        Ok(())
    }

    fn undo_step(&mut self) {
        if let Some((last, rng)) = self.undo.take() {
            (self.last, self.rng) = (last, rng);
            self.frame -= 1;
        }
    }
}
