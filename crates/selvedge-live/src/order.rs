//! Orders: the cloth that a page asks for, and the catalogue of what can be asked for.

use serde::{Deserialize, Serialize};

/// The cloth to be shown; each part by its name in the [`Catalogue`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// The scene.
    pub scene: String,
    /// Another mesh than the scene's.
    pub mesh: Option<MeshOrder>,
    /// Another material than the scene's.
    pub material: Option<String>,
    /// The model.
    pub model: String,
    /// True where the cloth touches itself, a floor and a ball, also in a scene without contact.
    #[serde(default)]
    pub touches: bool,
}

/// A mesh by the name of its shape and its number of vertices.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshOrder {
    /// The shape.
    pub name: String,
    /// The approximate number of vertices.
    pub vertices: usize,
}

/// The names that an [`Order`] may use.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Catalogue {
    /// Scenes.
    pub scenes: Vec<String>,
    /// Shapes of meshes.
    pub meshes: Vec<String>,
    /// Numbers of vertices to suggest.
    pub vertices: Vec<usize>,
    /// Materials.
    pub materials: Vec<String>,
    /// Models.
    pub models: Vec<String>,
    /// Motions.
    pub motions: Vec<String>,
}
