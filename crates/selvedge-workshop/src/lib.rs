//! The cloths of the live viewer: made ready from scenes, and moved by the physics or a model.
//!
//! [`SceneWorkshop`] is the workshop that `selvedge view` and the page without a program give to a
//! session of `selvedge-live`, which knows neither scenes nor physics nor models.

mod bodies;
mod cloth;
#[cfg(test)]
#[path = "../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
mod movers;
mod workshop;

pub use workshop::SceneWorkshop;

#[cfg(test)]
mod tests;
