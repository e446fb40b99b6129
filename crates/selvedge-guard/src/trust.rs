//! How far a frame can be trusted: what was measured of it, what had to be done to it, and both in one
//! word.

use crate::Measured;

/// A frame in one word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Within all bounds, as it was predicted.
    #[default]
    Held,
    /// Beyond a bound, and brought back (or, where nothing is corrected, left so).
    Corrected,
    /// Not to be corrected: it did not come, or not finite, or too far off. It was replaced by a frame
    /// of the physics or by the frame before, carried by the handles (or, where nothing is corrected,
    /// left so).
    Lost,
}

impl Verdict {
    /// As people read it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Corrected => "corrected",
            Self::Lost => "lost",
        }
    }
}

/// How far vertices were moved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// √(mean over vertices of the squared distance) `[m]`.
    pub rms: f64,
    /// The farthest `[m]`.
    pub largest: f64,
}

/// How far a frame can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trust {
    /// The frame, counted from the start.
    pub frame: usize,
    /// In one word.
    pub verdict: Verdict,
    /// Of the frame as it was predicted; none where none came, or one that is not finite.
    pub predicted: Option<Measured>,
    /// Of the frame as it was given on.
    pub given: Measured,
    /// From the one to the other; none where there is no prediction.
    pub correction: Option<Moved>,
}

/// The frames of a run, or of several, summed up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// How many frames.
    pub frames: usize,
    /// Those that were corrected.
    pub corrected: usize,
    /// Those that were lost.
    pub lost: usize,
    /// The farthest that a vertex was moved in a frame that was not lost `[m]`.
    pub largest_correction: f64,
}

impl Tally {
    /// Counts one more frame.
    pub fn add(&mut self, trust: &Trust) {
        self.frames += 1;
        match trust.verdict {
            Verdict::Lost => self.lost += 1,
            Verdict::Corrected => self.corrected += 1,
            Verdict::Held => {}
        }
        if let (true, Some(moved)) = (trust.verdict != Verdict::Lost, trust.correction) {
            self.largest_correction = self.largest_correction.max(moved.largest);
        }
    }

    /// Both together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            corrected: self.corrected + other.corrected,
            lost: self.lost + other.lost,
            largest_correction: self.largest_correction.max(other.largest_correction),
        }
    }
}
