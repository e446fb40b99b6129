//! A guard for cloth that a network moves, or anything else that can err. It measures every frame,
//! corrects what cloth cannot do, and replaces lost frames by the physics.
//!
//! [`Guard`] is a [`Stepper`](selvedge_cloth::Stepper) around a
//! [`Correctable`](selvedge_cloth::Correctable) one. Each step ends with a **verdict** on the inner
//! stepper's prediction ([`Verdict`]). A frame that **held** is within all bounds and is passed on
//! bit for bit. A frame that was **corrected** had edges beyond their bounds and was brought back.
//! A **lost** frame is replaced by a step of the physics, or without a scene by the last frame,
//! carried by the handles ([`Replacement`]). [`Trust`] holds the verdict and the measures behind
//! it, [`GuardSummary`] sums them up. [`Correction`] says what a guard does.
//!
//! ```
//! use glam::{DVec3, Vec3};
//! use selvedge_cloth::generate::square;
//! use selvedge_cloth::{Cloth, Correctable, HandleTargets, Handles, StepError, Stepper, Topology};
//! use selvedge_guard::{Guard, Correction, Replacement, Verdict};
//!
//! /// A bad model: whatever the targets are, the cloth grows by a tenth in every frame.
//! struct Growing {
//!     cloth: Cloth,
//!     positions: Vec<Vec3>,
//!     frame: usize,
//! #   undo: Option<Vec<Vec3>>,
//! }
//!
//! impl Stepper for Growing {
//!     fn step(&mut self, _: &HandleTargets) -> Result<(), StepError> {
//! #       self.undo = Some(self.positions.clone());
//!         self.positions.iter_mut().for_each(|p| *p *= 1.1);
//!         self.frame += 1;
//!         Ok(())
//!     }
//!     // ...
//! #   fn topology(&self) -> &Topology { self.cloth.topology() }
//! #   fn handles(&self) -> &Handles { self.cloth.handles() }
//! #   fn positions(&self) -> &[Vec3] { &self.positions }
//! #   fn frame(&self) -> usize { self.frame }
//! }
//!
//! impl Correctable for Growing {
//!     fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
//!         self.positions.copy_from_slice(positions);
//!         Ok(())
//!     }
//!     // ...
//! #   fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
//! #       (self.undo, self.frame) = (None, self.frame + 1);
//! #       self.replace_frame(positions)
//! #   }
//! #   fn undo_step(&mut self) {
//! #       if let Some(before) = self.undo.take() {
//! #           (self.positions, self.frame) = (before, self.frame - 1);
//! #       }
//! #   }
//! }
//!
//! let sheet = square(49, 1.0, 1)?;
//! let handles = Handles::new(&sheet.labels["upper-corners"], 49)?;
//! let cloth = Cloth::of_mesh(&sheet.mesh, 0.2, handles)?;
//! let positions = cloth.rest_positions().to_vec();
//! let held = cloth.handles().select(sheet.mesh.positions());
//! let growing = Growing { cloth: cloth.clone(), positions, frame: 0, /* ... */
//! #   undo: None,
//! };
//!
//! // Edges may stretch to 1.28 of their length in the material. The sheet stretches to 1.1, then
//! // to 1.21; from the third frame on the guard steps in.
//! let mut guard = Guard::new(growing, &cloth, 60.0, None, Correction::default())?;
//! for frame in 1..=10 {
//!     guard.step(&HandleTargets::at_frame_end(held.clone())?)?;
//!     assert_eq!(guard.trust().verdict == Verdict::Held, frame <= 2);
//!     assert!(guard.trust().given.largest_strain < 0.29);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crate knows the simulator and no model: a guarded model comes as a stepper. Positions are
//! f32 `[m]` as steppers hand them on; sums are f64. A guard does not make a wrong motion right: it
//! keeps edges within bounds, and nothing else. It reads no files.

mod carry;
#[cfg(test)]
#[path = "../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
mod gauge;
mod guard;
mod limiter;
mod rescue;
mod trust;

pub use gauge::Measured;
pub use guard::{Correction, Guard, GuardError, PhysicsFailure};
pub use trust::{ContactWord, GuardSummary, Moved, Replacement, Trust, Verdict};
