//! Cloths of the live viewer: made ready from scenes, and moved by the physics or a model.

mod bodies;
mod movers;
mod scene_cloth;
mod workshop;

pub(crate) use workshop::ViewWorkshop;

#[cfg(test)]
mod tests;
