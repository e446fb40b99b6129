//! What people look at: stills, contact sheets and clips of a cloth in motion, made by a small
//! software raster, so that they need no GPU, no window and no font.
//!
//! A [`Run`] borrows the frames of a motion and checks them once; a [`Panel`] is a run with a label
//! and a colouring. [`still`] and [`contact_sheet`] make an [`Image`], [`write_clip`] an animated
//! GIF whose clock is real. All of them look through one camera that holds the whole run. [`plot`]
//! draws numbers.
//!
//! Conventions: metres and seconds, y up; pixels count from the top left corner, x to the right and
//! y down; colours are sRGB outside and linear light inside. This crate opens no files: images are
//! written to any [`std::io::Write`].
//!
//! ```
//! use glam::Vec3;
//! use selvedge_cloth::{Topology, VertexId};
//! use selvedge_view::{Colouring, Panel, Run, StillSettings, still};
//!
//! let topology = Topology::new(3, &[[0, 1, 2]])?;
//! let frame = [Vec3::ZERO, Vec3::Z, Vec3::Y];
//! let run = Run::new(&topology, [&frame[..]], &[VertexId(2)], 60.0)?;
//! let panel = Panel { label: "", run: &run, colouring: Colouring::Plain };
//! let settings = StillSettings { size: [64, 48], ..StillSettings::default() };
//! let png = still(&panel, 0, &settings)?.to_png()?;
//! assert_eq!(png[1..4], *b"PNG");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod image;
mod motion;
mod page;
pub mod plot;
mod raster;
mod text;

pub use error::ViewError;
pub use image::Image;
pub use image::colour::{ColourMap, Rgb};
pub use motion::field::ScalarField;
pub use motion::run::{Colouring, Panel, Run};
pub use page::clip::{ClipEnd, ClipProgress, ClipSettings, write_clip};
pub use page::moments::Moments;
pub use page::sheet::{SheetSettings, StillSettings, contact_sheet, still};
pub use plot::{HistogramPlot, histogram_page};
pub use raster::camera::{Camera, Orbit, Projected};
pub use raster::renderer::Renderer;
pub use raster::settings::{EdgeLines, Supersampling};
pub use raster::stage::Stage;
pub use text::{Align, TextStyle, draw_text, text_width};
