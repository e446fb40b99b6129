//! Trust in a frame: its measures before and after the guard, and a verdict in one word.

use crate::Measured;

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
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Corrected => "corrected",
            Self::Lost { .. } => "lost",
        }
    }

    /// Returns true for a lost frame.
    #[must_use]
    pub fn is_lost(self) -> bool {
        matches!(self, Self::Lost { .. })
    }

    /// Origin of the frame that replaced a lost one; none if the frame was not lost.
    #[must_use]
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
    #[must_use]
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
    #[must_use]
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
    /// The physics was asked for this frame and failed. A correction then went without relaxation,
    /// a lost frame was carried. [`crate::Guard::physics_failure`] has the reason.
    pub physics_failed: bool,
    /// Contact on the way to this frame.
    pub contact: ContactWord,
    /// Measures of the prediction; none if it failed or is not finite.
    pub predicted: Option<Measured>,
    /// Measures of the frame that was given on.
    pub given: Measured,
    /// Moves from the prediction to the frame that was given on; none without a prediction.
    pub correction: Option<Moved>,
}

/// Sums over the frames of one or several runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Number of frames.
    pub frames: usize,
    /// Frames that were corrected.
    pub corrected: usize,
    /// Frames that were lost.
    pub lost: usize,
    /// Lost frames that were replaced by the physics.
    pub lost_to_physics: usize,
    /// Frames for which the physics was asked and failed.
    pub physics_failures: usize,
    /// Frames in which vertices were pushed apart, because they would have met.
    pub pushed_apart: usize,
    /// Frames that were lost because pushing did not end.
    pub lost_to_contact: usize,
    /// Largest move of a vertex in a frame that was not lost `[m]`.
    pub largest_correction: f64,
}

impl Tally {
    /// Counts one more frame.
    pub fn add(&mut self, trust: &Trust) {
        self.frames += 1;
        self.physics_failures += usize::from(trust.physics_failed);
        self.pushed_apart += usize::from(trust.contact == ContactWord::Pushed);
        self.lost_to_contact += usize::from(trust.contact == ContactWord::Lost);
        match trust.verdict {
            Verdict::Held => {}
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

    /// Sum of two tallies.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            corrected: self.corrected + other.corrected,
            lost: self.lost + other.lost,
            lost_to_physics: self.lost_to_physics + other.lost_to_physics,
            physics_failures: self.physics_failures + other.physics_failures,
            pushed_apart: self.pushed_apart + other.pushed_apart,
            lost_to_contact: self.lost_to_contact + other.lost_to_contact,
            largest_correction: self.largest_correction.max(other.largest_correction),
        }
    }
}
