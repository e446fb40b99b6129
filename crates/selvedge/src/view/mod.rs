//! What the live viewer shows: cloths made ready from scenes, and who moves them, the physics or a
//! model.

mod movers;
mod scene_cloth;
mod workshop;

pub(crate) use workshop::ViewWorkshop;

#[cfg(test)]
mod tests;
