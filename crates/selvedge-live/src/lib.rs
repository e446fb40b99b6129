//! The live viewer: a cloth that moves under a person's hand, and the page in which it is seen.
//!
//! - A **session** ([`start`]) runs on a thread of its own. It moves one cloth at the rate of the
//!   scene, or plays a recording, and leaves the latest frame where every page can take it.
//! - A **workshop** ([`Workshop`]) makes a cloth ready ([`ReadyCloth`]) when a page orders it, with
//!   its **movers** ([`Movers`], [`LiveStepper`]): steppers that can continue under other handles
//!   and in another wind. The program implements these traits.
//! - **Hands** ([`Hands`]) lead the handles to where people drag them, within limits of speed and
//!   acceleration.
//! - A **replay** ([`Replay`]) holds recordings side by side, with one clock.
//! - A **server** ([`serve`]) lets browsers watch a session and drag its cloth. The
//!   [`protocol`] is the form of the messages; the page is built from `web/` and compiled in.
//!
//! ```
//! use selvedge_live::{Opening, Workshop, serve, start};
//!
//! /// Serves a session until somebody presses Enter.
//! fn watch(workshop: Box<dyn Workshop>, opening: Opening) -> std::io::Result<()> {
//!     let session = start(workshop, opening, "recordings".into())?;
//!     let server = serve(([127, 0, 0, 1], 0).into(), Vec::new(), &session)?;
//!     println!("open http://{}", server.address());
//!     std::io::stdin().read_line(&mut String::new())?;
//!     server.close();
//!     session.close();
//!     Ok(())
//! }
//! ```
//!
//! This crate knows neither the physics nor the learned model, opens no scene, and keeps no state
//! on disk but the recordings that a page asks for.

// The test cloth is also compiled into the tests from outside, under the name of this crate.
#[cfg(test)]
extern crate self as selvedge_live;

mod body;
#[cfg(test)]
#[path = "../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
mod hand;
mod live_cloth;
mod mover;
mod order;
mod pace;
mod player;
pub mod protocol;
mod recorder;
#[cfg(feature = "server")]
mod server;
mod session;
mod state;
mod strain_gauge;
#[cfg(test)]
mod test_cloth;
mod workshop;

pub use body::{Body, BodyKind, kind_of};
pub use hand::{HandLimits, Hands};
pub use mover::{Influences, LiveError, LiveStepper, Mover, MoverKind, Start};
pub use order::{Catalogue, MeshOrder, Order};
pub use player::{NamedTrack, Replay};
#[cfg(feature = "server")]
pub use server::{MOST_PAGES, RunningServer, serve};
pub use session::{EmbeddedSession, Opening};
#[cfg(feature = "server")]
pub use session::{RunningSession, start};
pub use state::{Level, MotionState, Notice, RecordingState, Show, State, TrackState};
pub use workshop::{Movers, ReadyCloth, Workshop};
