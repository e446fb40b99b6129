//! The live viewer: a cloth that moves under a person's hand, and the page in which it is seen.
//!
//! [`start`] runs a session on a thread of its own: it drives [`Stepper`](selvedge_cloth::Stepper)s at
//! the rate of the scene, or plays recordings, whoever watches. [`serve`] lets browsers watch it and
//! take hold of the cloth. Who moves the cloth comes from outside, through [`Workshop`], [`Bench`] and
//! [`LiveStepper`]: this crate knows neither the physics nor the learned model, and opens no scene.
//! [`protocol`] is what goes over the socket; the page itself is in `web/`, and what is built from it is
//! compiled in.

mod gate;
mod hand;
mod listener;
mod order;
mod pace;
mod page;
mod player;
pub mod protocol;
mod recorder;
mod server;
mod session;
mod socket;
mod stage;
mod state;
#[cfg(test)]
mod test_bench;
#[cfg(test)]
mod test_cloth;

pub use hand::{Hands, Limits};
pub use order::{
    Bench, Catalogue, Hold, LiveStepper, MeshOrder, Mover, MoverKind, Order, Start, Workshop,
};
pub use player::{NamedTrack, Tape, TapeError};
pub use server::{MOST_PAGES, RunningServer, ServerSettings, serve};
pub use session::{Opening, RunningSession, start};
pub use state::{Level, MotionState, Notice, RecordingState, Show, State, Track};
