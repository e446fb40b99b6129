//! The guard's word on a frame, as C has it.

use selvedge_guard::{ContactWord, Correction, Moved, Replacement, Trust, Verdict};

use crate::fault::Fault;

/// Correction of frames that no cloth could have. `SELVEDGE_GUARD_LIMIT` is that of the command
/// line where nothing else is said.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelvedgeGuard {
    /// Edges are brought back within bounds; what is lost is replaced by the physics.
    Limit = 0,
    /// No correction: frames are measured.
    None = 1,
}

/// Judgement of a frame in one word.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelvedgeVerdict {
    /// Within all bounds, as it was predicted.
    Held = 0,
    /// Beyond a bound and brought back; without correction, left as it was.
    Corrected = 1,
    /// Not correctable, and replaced.
    Lost = 2,
}

/// Origin of the frame that was given on in the place of a lost one.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelvedgeReplacement {
    /// None: the frame was not lost, or nothing is corrected.
    Nothing = 0,
    /// A step of the physics.
    Physics = 1,
    /// The last frame, carried rigidly by the handles.
    Carry = 2,
}

/// Contact on the way to a frame.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelvedgeContact {
    /// Nothing met, or the scene has no contact.
    Free = 0,
    /// Vertices were pushed apart.
    Pushed = 1,
    /// Pushing did not end: the frame counts as lost.
    Lost = 2,
}

/// Word of the guard on the newest frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelvedgeTrust {
    /// Number of the frame, counted from the start.
    pub frame: u64,
    /// A `SelvedgeVerdict`.
    pub verdict: i32,
    /// A `SelvedgeReplacement`.
    pub replaced_by: i32,
    /// A `SelvedgeContact`.
    pub contact: i32,
    /// 1 where the physics was asked for this frame and failed, otherwise 0.
    pub physics_failed: i32,
    /// Largest strain (l - l0)/l0 of an edge of the frame that was given on.
    pub largest_strain: f64,
    /// Smallest strain of an edge.
    pub smallest_strain: f64,
    /// Root of the mean squared strain over all edges.
    pub strain_rms: f64,
    /// Kinetic energy over mass `[J/kg]`.
    pub kinetic_energy: f64,
    /// Largest speed of a vertex `[m/s]`.
    pub largest_speed: f64,
    /// Largest strain of the prediction; not a number where there is none.
    pub predicted_strain: f64,
    /// Root of the mean squared move of a vertex from the prediction `[m]`; not a number without
    /// one.
    pub correction_rms: f64,
    /// Largest move of a vertex from the prediction `[m]`; not a number without one.
    pub correction_largest: f64,
}

impl From<&Trust> for SelvedgeTrust {
    fn from(trust: &Trust) -> Self {
        let verdict = match trust.verdict {
            Verdict::Held => SelvedgeVerdict::Held,
            Verdict::Corrected => SelvedgeVerdict::Corrected,
            Verdict::Lost { .. } => SelvedgeVerdict::Lost,
        };
        let replaced_by = match trust.verdict.replaced_by() {
            None | Some(Replacement::Nothing) => SelvedgeReplacement::Nothing,
            Some(Replacement::Physics) => SelvedgeReplacement::Physics,
            Some(Replacement::Carry) => SelvedgeReplacement::Carry,
        };
        let contact = match trust.contact {
            ContactWord::Free => SelvedgeContact::Free,
            ContactWord::Pushed => SelvedgeContact::Pushed,
            ContactWord::Lost => SelvedgeContact::Lost,
        };
        let none = Moved {
            rms: f64::NAN,
            largest: f64::NAN,
        };
        let moved = trust.correction.unwrap_or(none);
        Self {
            frame: trust.frame as u64,
            verdict: verdict as i32,
            replaced_by: replaced_by as i32,
            contact: contact as i32,
            physics_failed: i32::from(trust.physics_failed),
            largest_strain: trust.given.largest_strain,
            smallest_strain: trust.given.smallest_strain,
            strain_rms: trust.given.strain_rms,
            kinetic_energy: trust.given.kinetic_energy,
            largest_speed: trust.given.largest_speed,
            predicted_strain: trust.predicted.map_or(f64::NAN, |m| m.largest_strain),
            correction_rms: moved.rms,
            correction_largest: moved.largest,
        }
    }
}

/// The settings of the guard of this number.
pub(crate) fn settings(guard: i32) -> Result<Correction, Fault> {
    const NONE: i32 = SelvedgeGuard::None as i32;
    const LIMIT: i32 = SelvedgeGuard::Limit as i32;
    match guard {
        NONE => Ok(Correction::None),
        LIMIT => Ok(Correction::Limit),
        found => {
            let text = format!("guard: expected a SelvedgeGuard, 0 or 1, found {found}");
            Err(Fault::argument(text))
        }
    }
}
