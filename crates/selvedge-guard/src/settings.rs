//! Settings of a guard: bounds, and the correction of frames beyond them.

use selvedge_cloth::{SettingError, require};

/// Correction of a frame that is beyond its bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Correction {
    /// None: frames are measured, errors are passed on.
    None,
    /// Edges are brought back within their bounds.
    #[default]
    Limit,
}

/// Settings of a guard. The default bounds are the extremes of the physics itself: on the 31
/// motions of the paper's kind of the data set `first`, edges have stretches of 0.853 to 1.282 (one
/// frame in a thousand of 39,091 has one over 1.263). A run counts as diverged above a strain of 30
/// %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardSettings {
    /// Correction of a frame that is beyond its bounds.
    pub correction: Correction,
    /// Shortest stretch l/l₀ of an edge, against the material. A goal, not a promise: a fold
    /// between vertices shortens edges.
    pub least_stretch: f64,
    /// Longest stretch l/l₀ of an edge, against the material.
    pub most_stretch: f64,
    /// Margin around an edge's length in the rest pose, as a part of that length. Lengths within it
    /// are always allowed, whatever the stretch: heavy cloth may hang stretched.
    pub rest_margin: f64,
    /// Strain (l - l₀)/l₀ of an edge above which a frame is lost: replaced, not corrected.
    pub lost_strain: f64,
    /// Move of a vertex above which a frame is lost, in mean lengths of an edge.
    pub lost_correction: f64,
    /// Largest number of sweeps over all edges.
    pub sweeps: u32,
}

impl Default for GuardSettings {
    fn default() -> Self {
        Self {
            correction: Correction::default(),
            least_stretch: 0.85,
            most_stretch: 1.28,
            rest_margin: 0.005,
            lost_strain: 1.0,
            lost_correction: 1.0,
            sweeps: 1000,
        }
    }
}

impl GuardSettings {
    /// The defaults with `correction`.
    pub fn with(correction: Correction) -> Self {
        Self {
            correction,
            ..Self::default()
        }
    }

    /// Checks every number.
    pub fn validate(&self) -> Result<(), SettingError> {
        let strain = self.most_stretch - 1.0;
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let holds = (0.0..1.0).contains(&self.least_stretch);
        let expected = "at least 0 and below 1";
        require(holds, "guard.least_stretch", expected, self.least_stretch)?;
        let expected = "finite and above 1";
        require(
            positive(strain),
            "guard.most_stretch",
            expected,
            self.most_stretch,
        )?;
        let holds = positive(self.rest_margin) && self.rest_margin < 1.0;
        require(
            holds,
            "guard.rest_margin",
            "between 0 and 1",
            self.rest_margin,
        )?;
        let holds = self.lost_strain >= strain;
        let expected = "at least most_stretch - 1";
        require(holds, "guard.lost_strain", expected, self.lost_strain)?;
        let holds = self.lost_correction > 0.0;
        require(
            holds,
            "guard.lost_correction",
            "positive",
            self.lost_correction,
        )?;
        require(self.sweeps > 0, "guard.sweeps", "at least 1", self.sweeps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_checked() {
        assert_eq!(GuardSettings::default().validate(), Ok(()));
        let spoils: [fn(&mut GuardSettings); 7] = [
            |s| s.least_stretch = 1.0,
            |s| s.most_stretch = 1.0,
            |s| s.most_stretch = f64::NAN,
            |s| s.rest_margin = 0.0,
            |s| s.lost_strain = 0.1,
            |s| s.lost_correction = f64::NAN,
            |s| s.sweeps = 0,
        ];
        for (number, spoil) in spoils.into_iter().enumerate() {
            let mut settings = GuardSettings::default();
            spoil(&mut settings);
            assert!(settings.validate().is_err(), "{number}");
        }
    }
}
