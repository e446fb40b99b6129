//! Cloths of scenes: made ready from the scene's file, and moved by the physics or a model.

mod bodies;
mod cloth;
mod movers;
mod workshop;

pub use workshop::SceneWorkshop;

#[cfg(test)]
mod tests;
