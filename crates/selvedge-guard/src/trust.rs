//! Trust in a frame: its measures before and after the guard, and a verdict in one word.

use serde::{Deserialize, Serialize};

use crate::Measured;

/// Share of frames beyond a guard's bounds from which on a motion is not to be trusted.
const MOST_BEYOND: f64 = 0.03;

/// Judgement of a frame in one word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Within all bounds, as it was predicted.
    #[default]
    Held,
    /// Beyond a bound and brought back; without correction, left as it was.
    Corrected,
    /// Not correctable: the prediction failed, is not finite, or is too far off.
    Lost {
        /// Origin of the frame that was given on instead.
        replaced_by: Replacement,
    },
}

/// Origin of the frame that replaces a lost one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Replacement {
    /// None: nothing is corrected, the prediction was given on.
    Nothing,
    /// A step of the physics from the last two frames.
    Physics,
    /// The last frame, carried rigidly by the handles: there is no scene, or the physics failed.
    Carry,
}

impl Verdict {
    /// Name for reports: `held`, `corrected` or `lost`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Corrected => "corrected",
            Self::Lost { .. } => "lost",
        }
    }

    /// Returns true for a lost frame.
    pub fn is_lost(self) -> bool {
        matches!(self, Self::Lost { .. })
    }

    /// Origin of the frame that replaced a lost one; none if the frame was not lost.
    pub fn replaced_by(self) -> Option<Replacement> {
        match self {
            Self::Lost { replaced_by } => Some(replaced_by),
            Self::Held | Self::Corrected => None,
        }
    }
}

/// Contact of a frame with obstacles and with itself, where its scene has some.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactWord {
    /// Nothing met on the way from the last frame, or the scene has no contact.
    #[default]
    Free,
    /// Vertices were pushed apart.
    Pushed,
    /// Pushing did not end: the frame counts as lost.
    Lost,
}

impl ContactWord {
    /// Name for reports: `free`, `pushed` or `lost`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Pushed => "pushed",
            Self::Lost => "lost",
        }
    }
}

impl Replacement {
    /// Name for reports: `nothing`, `physics` or `carry`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Physics => "physics",
            Self::Carry => "carry",
        }
    }
}

/// Distances by which vertices were moved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// √(mean over vertices of the squared distance) `[m]`.
    pub rms: f64,
    /// Largest distance of a vertex `[m]`.
    pub largest: f64,
}

/// Trust in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trust {
    /// Number of the frame, counted from the start.
    pub frame: usize,
    /// Judgement in one word.
    pub verdict: Verdict,
    /// The physics was asked for this frame and failed: the lost frame was carried.
    /// [`crate::Guard::physics_failure`] has the reason.
    pub physics_failed: bool,
    /// The stepper itself brought back edges that were beyond their bounds.
    pub is_strained: bool,
    /// Contact on the way to this frame.
    pub contact: ContactWord,
    /// Measures of the prediction; none if it failed or is not finite.
    pub predicted: Option<Measured>,
    /// Measures of the frame that was given on.
    pub given: Measured,
    /// Moves from the prediction to the frame that was given on; none without a prediction.
    pub correction: Option<Moved>,
}

impl Trust {
    /// The numbers by their names: SI units, strains have none. None without a prediction.
    pub fn numbers(&self) -> [(&'static str, Option<f64>); 8] {
        let (given, moved) = (&self.given, self.correction);
        [
            ("largest_strain", Some(given.largest_strain)),
            ("smallest_strain", Some(given.smallest_strain)),
            ("strain_rms", Some(given.strain_rms)),
            ("kinetic_energy", Some(given.kinetic_energy)),
            ("largest_speed", Some(given.largest_speed)),
            ("predicted_strain", self.predicted.map(|m| m.largest_strain)),
            ("correction_rms", moved.map(|m| m.rms)),
            ("correction_largest", moved.map(|m| m.largest)),
        ]
    }
}

/// Sums over the frames of one or several runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GuardSummary {
    /// Frames that were stepped.
    pub frames: usize,
    /// Frames that were corrected.
    pub corrected: usize,
    /// Frames that were lost.
    pub lost: usize,
    /// Frames within bounds of which the stepper itself brought edges back.
    #[serde(default)]
    pub strained: usize,
    /// Lost frames that were replaced by the physics; the others were carried by the handles.
    #[serde(default)]
    pub lost_to_physics: usize,
    /// Frames for which the physics was asked and failed.
    #[serde(default)]
    pub physics_failures: usize,
    /// Frames in which vertices were pushed apart, because they would have met.
    #[serde(default)]
    pub pushed_apart: usize,
    /// Frames that were lost because pushing did not end.
    #[serde(default)]
    pub lost_to_contact: usize,
    /// The farthest that a vertex was moved in a frame that was not lost `[m]`.
    pub largest_correction: f64,
}

impl GuardSummary {
    /// Counts one more frame.
    pub fn add(&mut self, trust: &Trust) {
        self.frames += 1;
        self.physics_failures += usize::from(trust.physics_failed);
        self.pushed_apart += usize::from(trust.contact == ContactWord::Pushed);
        self.lost_to_contact += usize::from(trust.contact == ContactWord::Lost);
        match trust.verdict {
            Verdict::Held => self.strained += usize::from(trust.is_strained),
            Verdict::Corrected => self.corrected += 1,
            Verdict::Lost { replaced_by } => {
                self.lost += 1;
                self.lost_to_physics += usize::from(replaced_by == Replacement::Physics);
            }
        }
        if let (false, Some(moved)) = (trust.verdict.is_lost(), trust.correction) {
            self.largest_correction = self.largest_correction.max(moved.largest);
        }
    }

    /// The counts of all together.
    pub fn sum(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |a, b| Self {
            frames: a.frames + b.frames,
            corrected: a.corrected + b.corrected,
            lost: a.lost + b.lost,
            strained: a.strained + b.strained,
            lost_to_physics: a.lost_to_physics + b.lost_to_physics,
            physics_failures: a.physics_failures + b.physics_failures,
            pushed_apart: a.pushed_apart + b.pushed_apart,
            lost_to_contact: a.lost_to_contact + b.lost_to_contact,
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

    /// Frames that were held to contact; none if no frame had to be.
    pub fn contact_in_words(&self) -> Option<String> {
        let Self {
            pushed_apart,
            lost_to_contact,
            ..
        } = self;
        let is_needed = pushed_apart + lost_to_contact > 0;
        is_needed.then(|| {
            format!("{pushed_apart} frames pushed apart where the cloth would have met, {lost_to_contact} lost to it")
        })
    }

    /// Share of the frames that were corrected or replaced.
    pub fn share(&self) -> f64 {
        (self.corrected + self.lost) as f64 / self.frames.max(1) as f64
    }

    /// The reason not to trust the motion: more than 3 % of its frames were beyond the guard's
    /// bounds, by the guard's judgement or before the stepper itself brought edges back; none otherwise.
    pub fn doubt_in_words(&self) -> Option<String> {
        let beyond = self.corrected + self.lost + self.strained;
        let share = beyond as f64 / self.frames.max(1) as f64;
        (share > MOST_BEYOND).then(|| {
            format!(
                "{beyond} of {} frames were beyond the guard's bounds, {:.0} %: the model does not know such motion, and the solver does",
                self.frames,
                100.0 * share
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_three_frames_in_a_hundred_are_a_doubt() {
        let mut summary = GuardSummary {
            frames: 100,
            corrected: 2,
            lost: 1,
            ..GuardSummary::default()
        };
        assert_eq!(summary.doubt_in_words(), None);
        summary.corrected = 3;
        let doubt = summary.doubt_in_words().unwrap();
        assert!(doubt.starts_with("4 of 100 frames"), "{doubt}");
        (summary.corrected, summary.strained) = (2, 1);
        assert_eq!(summary.doubt_in_words(), Some(doubt));
        assert_eq!(GuardSummary::default().doubt_in_words(), None);
    }
}
