//! The guard of a cloth that a network moves, or anything else that can err: it measures every frame
//! ([`Trust`]), corrects what cloth cannot do ([`Correction`]), and where nothing is left to correct
//! goes on by the physics. [`Guard`] is a [`selvedge_cloth::Stepper`] around a
//! [`selvedge_cloth::Correctable`] one.
//!
//! It knows the simulator, but no model: what it guards comes to it as a stepper. Positions are f32
//! `[m]` as steppers hand them on, sums are f64. It reads no files.

mod carry;
mod gauge;
mod guard;
mod limiter;
mod rescue;
mod settings;
mod trust;

pub use gauge::Measured;
pub use guard::{Guard, GuardError, PhysicsFailure};
pub use settings::{Correction, GuardSettings, SettingsError, When};
pub use trust::{Moved, Replacement, Tally, Trust, Verdict};
