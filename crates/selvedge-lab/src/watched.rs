//! A model under a guard, as commands run it: the guard's word on every frame is kept, and summed up.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use selvedge_cloth::{Cloth, HandleTargets, Scene, StepError, Stepper};
use selvedge_data::write_atomically;
use selvedge_guard::{Guard, GuardSettings, Measured, PhysicsFailure, Replacement, Tally, Trust};
use serde::{Deserialize, Serialize};

use crate::machine::Mover;

/// A run diverges where some edge strains more, (l - l₀)/l₀ against the material ...
pub const DIVERGED_STRAIN: f64 = 0.3;
/// ... for more frames in a row.
pub const DIVERGED_FRAMES: usize = 10;

/// A model under a guard.
pub struct Watched {
    guard: Guard<Mover>,
    log: Vec<Trust>,
}

/// What a guard did in a run, or in several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Guarded {
    /// Frames that were stepped.
    pub frames: usize,
    /// Those that were corrected.
    pub corrected: usize,
    /// Those that were lost.
    pub lost: usize,
    /// Lost frames that were replaced by the physics; the others were carried by the handles.
    #[serde(default)]
    pub lost_to_physics: usize,
    /// Frames for which the physics was asked and failed.
    #[serde(default)]
    pub physics_failures: usize,
    /// The farthest that a vertex was moved in a frame that was not lost `[m]`.
    pub largest_correction: f64,
}

impl Watched {
    /// `stepper`, which moves `cloth` at `frame_rate`, watched as `settings` say; with its `scene`, where that
    /// is known.
    ///
    /// # Errors
    /// A cloth that cannot be guarded.
    pub fn new(
        stepper: Mover,
        cloth: &Cloth,
        frame_rate: f64,
        scene: Option<Arc<Scene>>,
        settings: GuardSettings,
    ) -> anyhow::Result<Self> {
        let guard = Guard::new(stepper, cloth, frame_rate, scene, settings);
        Ok(Self {
            guard: guard.context("the guard (--guard none does without)")?,
            log: Vec::new(),
        })
    }

    /// What is known of each frame that was stepped.
    pub fn log(&self) -> &[Trust] {
        &self.log
    }

    /// Reason of the newest failure of the physics beside the model; none if it never failed.
    pub fn physics_failure(&self) -> Option<&PhysicsFailure> {
        self.guard.physics_failure()
    }

    /// The same summed up.
    pub fn summary(&self) -> Guarded {
        let mut tally = Tally::default();
        self.log.iter().for_each(|trust| tally.add(trust));
        Guarded {
            frames: tally.frames,
            corrected: tally.corrected,
            lost: tally.lost,
            lost_to_physics: tally.lost_to_physics,
            physics_failures: tally.physics_failures,
            largest_correction: tally.largest_correction,
        }
    }
}

impl Guarded {
    /// All together.
    pub fn sum(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |a, b| Self {
            frames: a.frames + b.frames,
            corrected: a.corrected + b.corrected,
            lost: a.lost + b.lost,
            lost_to_physics: a.lost_to_physics + b.lost_to_physics,
            physics_failures: a.physics_failures + b.physics_failures,
            largest_correction: a.largest_correction.max(b.largest_correction),
        })
    }

    /// Number of lost frames and, if the physics was needed, its part in them.
    pub fn lost_in_words(&self) -> String {
        let Self {
            lost,
            lost_to_physics,
            physics_failures,
            ..
        } = self;
        let mut text = lost.to_string();
        if *lost_to_physics > 0 {
            text += &format!(" ({lost_to_physics} by the physics)");
        }
        if *physics_failures > 0 {
            text += &format!(", the physics failed in {physics_failures}");
        }
        text
    }

    /// Share of the frames that were corrected or replaced.
    pub fn share(&self) -> f64 {
        (self.corrected + self.lost) as f64 / self.frames.max(1) as f64
    }
}

impl Stepper for Watched {
    selvedge_cloth::delegate_stepper!(guard);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.guard.step(targets)?;
        self.log.push(*self.guard.trust());
        Ok(())
    }
}

/// Writes a line per frame: what the guard found, did and gave on. SI units; strains without one.
///
/// # Errors
/// When the file cannot be written.
pub fn write_trust(path: &Path, log: &[Trust]) -> anyhow::Result<()> {
    write_atomically(path, |out| {
        writeln!(
            out,
            "frame,verdict,largest_strain,smallest_strain,strain_rms,kinetic_energy,largest_speed,predicted_strain,correction_rms,correction_largest,replaced_by,physics_failed"
        )?;
        for trust in log {
            let Measured {
                largest_strain,
                smallest_strain,
                strain_rms,
                kinetic_energy,
                largest_speed,
            } = trust.given;
            let text = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
            let predicted = text(trust.predicted.map(|m| m.largest_strain));
            let rms = text(trust.correction.map(|m| m.rms));
            let largest = text(trust.correction.map(|m| m.largest));
            let verdict = trust.verdict.name();
            let replaced_by = trust.verdict.replaced_by().map_or("", Replacement::name);
            let failed = trust.physics_failed;
            writeln!(
                out,
                "{},{verdict},{largest_strain},{smallest_strain},{strain_rms},{kinetic_energy},{largest_speed},{predicted},{rms},{largest},{replaced_by},{failed}",
                trust.frame
            )?;
        }
        Ok(())
    })?;
    Ok(())
}
