//! Pictures of a cloth in motion: stills, contact sheets and clips by a small software raster,
//! which needs no GPU, no window and no font of the machine.
//!
//! - A **run** ([`Run`]) borrows the frames of a motion and checks them once.
//! - A **panel** ([`Panel`]) is a run with a label and a colouring: as cloth, or by a number per
//!   vertex ([`ScalarField`]).
//! - A **stage** ([`Stage`]) is the camera that holds whole runs, the floor, and the light. A
//!   **renderer** ([`Renderer`]) draws single frames on a stage as [`Image`]s.
//! - A **still** ([`still`]) is one frame; a **contact sheet** ([`contact_sheet`]) shows
//!   **moments** of one or several panels; a **clip** ([`write_clip`]) is an animated
//!   GIF whose clock is real.
//!
//! Conventions: metres and seconds, y up. Pixels count from the top left corner, x to the right and
//! y down. Colours are sRGB outside and linear light inside. The same values give the same bytes.
//!
//! ```
//! use glam::Vec3;
//! use selvedge_cloth::{Topology, VertexId};
//! use selvedge_view::{Panel, Run, still};
//!
//! let topology = Topology::new(3, &[[0, 1, 2]])?;
//! let frame = [Vec3::ZERO, Vec3::Z, Vec3::Y];
//! let run = Run::new(&topology, [&frame[..]], &[VertexId(2)], 60.0)?;
//! let png = still(&Panel::of(&run), 0, [64, 48])?.to_png()?;
//! assert_eq!(png[1..4], *b"PNG");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! This crate opens no files: images are written to any [`std::io::Write`]. It makes no films; a
//! program can give the pixels of its pictures to an encoder.

mod error;
mod image;
mod motion;
mod page;
mod raster;
mod text;

pub use error::ViewError;
pub use image::Image;
pub use image::colour::Rgb;
pub use motion::body::Body;
pub use motion::field::ScalarField;
pub use motion::panel::Panel;
pub use motion::run::Run;
pub use page::clip::{ClipSettings, pictures_in, write_clip};
pub use page::sheet::{SheetSettings, contact_sheet, still};
pub use raster::camera::View;
pub use raster::renderer::Renderer;
pub use raster::stage::Stage;
