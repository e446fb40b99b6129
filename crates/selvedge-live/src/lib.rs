//! The live viewer: a cloth that moves under a person's hand, and the page in which it is seen.
//!
//! - A **session** ([`start`]) runs on a thread of its own. It moves one cloth at the rate of the
//!   scene, or plays a recording, and leaves the latest frame where every page can take it.
//! - A **workshop** ([`Workshop`]) makes a cloth ready when a page orders it, and a [`ReadyCloth`]
//!   starts its **movers** ([`LiveStepper`]): steppers that can continue under other handles and in
//!   another wind. The program implements these traits.
//! - **Hands** ([`Hands`]) lead the handles to where people drag them, within limits of speed and
//!   acceleration.
//! - A **tape** ([`Tape`]) holds recordings side by side, with one clock.
//! - A **server** ([`serve`]) lets browsers watch a session and drag its cloth. The
//!   [`protocol`] is the form of the messages; the page is built from `web/` and compiled in.
//!
//! ```
//! use std::{ops::ControlFlow, sync::Arc};
//!
//! use selvedge_live::{
//!     Catalogue, LiveError, Mover, NamedTrack, Opening, Order, ReadyCloth, ServerSettings,
//!     Tape, Workshop, serve, start,
//! };
//!
//! /// Makes nothing ready: this program only plays.
//! struct NoWorkshop;
//!
//! impl Workshop for NoWorkshop {
//!     fn catalogue(&self) -> Catalogue {
//!         Catalogue::default()
//!     }
//!
//!     fn prepare(
//!         &mut self,
//!         order: &Order,
//!         _progress: &mut dyn FnMut(String) -> ControlFlow<()>,
//!     ) -> Result<Box<dyn ReadyCloth>, LiveError> {
//!         Err(LiveError::new(format!("there is no scene {:?}", order.scene)))
//!     }
//! }
//!
//! # fn trajectory() -> Result<selvedge_data::Trajectory, Box<dyn std::error::Error>> {
//! #     let corners = [glam::Vec3::ZERO, glam::Vec3::Z, glam::Vec3::Y];
//! #     let arrays = selvedge_cloth::ClothArrays {
//! #         rest_positions: corners.to_vec(),
//! #         material_coordinates: corners.map(|p| glam::Vec2::new(p.z, p.y)).to_vec(),
//! #         vertex_mass: vec![0.1; 3],
//! #         face_area: vec![0.5],
//! #     };
//! #     let topology = selvedge_cloth::Topology::new(3, &[[0, 1, 2]])?;
//! #     let handles = selvedge_cloth::Handles::new(&[2], 3)?;
//! #     let cloth = selvedge_cloth::Cloth::new(topology, handles, arrays)?;
//! #     let provenance = selvedge_data::Provenance {
//! #         frame_rate: 60.0,
//! #         scene: serde_json::Value::Null,
//! #         made_by: "an example".to_owned(),
//! #     };
//! #     Ok(selvedge_data::Trajectory::new(cloth, corners.to_vec(), provenance)?)
//! # }
//! let (name, trajectory) = ("waving".to_owned(), Arc::new(trajectory()?));
//! let tape = Tape::new("a recording", vec![NamedTrack { name, trajectory }])?;
//! let opening = Opening {
//!     order: Order {
//!         scene: "none".to_owned(),
//!         mesh: None,
//!         material: None,
//!         model: String::new(),
//!         touches: false,
//!     },
//!     mover: Mover::Physics,
//!     tape: Some(tape),
//! };
//! let session = start(Box::new(NoWorkshop), opening, "recordings".into())?;
//! let settings = ServerSettings { address: ([127, 0, 0, 1], 0).into(), names: Vec::new() };
//! let server = serve(settings, &session)?;
//! println!("open http://{}", server.address());
//! server.close();
//! session.close();
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! This crate knows neither the physics nor the learned model, opens no scene, and keeps no state
//! on disk but the recordings that a page asks for.

// The test cloth is also compiled into the tests from outside, under the name of this crate.
#[cfg(test)]
extern crate self as selvedge_live;

mod body;
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
pub use mover::{Hold, LiveError, LiveStepper, Mover, MoverKind, Start};
pub use order::{Catalogue, MeshOrder, Order};
pub use player::{NamedTrack, Tape, TapeError};
#[cfg(feature = "server")]
pub use server::{MOST_PAGES, RunningServer, ServerSettings, serve};
pub use session::{EmbeddedSession, Opening};
#[cfg(feature = "server")]
pub use session::{RunningSession, start};
pub use state::{Level, MotionState, Notice, RecordingState, Show, State, TrackState};
pub use workshop::{ReadyCloth, Workshop};
