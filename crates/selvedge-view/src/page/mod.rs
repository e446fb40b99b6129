//! Pages: stills and contact sheets as one image, clips as a GIF, and the layout they share.

pub(crate) mod clip;
pub(crate) mod colour_bar;
pub(crate) mod layout;
pub(crate) mod palette;
pub(crate) mod sheet;
