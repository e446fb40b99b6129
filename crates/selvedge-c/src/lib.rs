//! Selvedge for C, and for all that calls C: scenes, models and steppers behind handles.
//!
//! `include/selvedge.h` declares what stands here, made by `cargo xtask header`. The program
//! `selvedge` composes the same library functions, so that a stepper has the positions that
//! `selvedge run` and `selvedge run --model` write, to the bit.
//!
//! - A **handle** is a number with a kind, not an address, and is not given out twice: one that was
//!   freed, or that is of another kind, is an error and no crash.
//! - A call answers with a [`status::SelvedgeStatus`];
//!   [`selvedge_last_error`](process::selvedge_last_error) has the words for it.
//! - A panic does not cross the border: it becomes an error, and the handle that was in use can
//!   only be freed from then on. Its message goes to standard error, too, as Rust has it.
//! - Every function may be called from any thread. Calls with one handle wait for one another.
//!
//! Unsafe code is in `border.rs`, and where functions are exported and call it.

#[cfg(panic = "abort")]
compile_error!("selvedge-c turns panics into errors, which panic = \"abort\" does not allow");

mod border;
mod cloth;
mod fault;
pub mod listener;
pub mod models;
pub mod process;
mod registry;
pub mod scenes;
pub mod snapshots;
pub mod status;
pub mod steppers;
pub mod trust;
