//! The configuration of a data set as its index keeps it: setting, cloths and motions, resolved.

use selvedge_cloth::Motion;
use serde::{Deserialize, Serialize};

use crate::dataset::sections::SectionRule;
use crate::scene::{MeshSpec, Setting};

/// A mesh, its handles and its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedCloth {
    /// Name of the cloth.
    pub name: String,
    /// Source of the mesh.
    pub mesh: MeshSpec,
    /// The held vertices, in the order of the handle targets.
    pub handles: Vec<u32>,
}

/// The configuration of a data set, as its index keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetConfig {
    /// Name of the data set.
    pub name: String,
    /// Rule for the sections to learn from.
    pub sections: SectionRule,
    /// All of the scenes but their motions.
    pub setting: Setting,
    /// Cloths beside the setting's own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cloths: Vec<NamedCloth>,
    /// Motions of the training split, in order.
    pub train: Vec<NamedMotion>,
    /// Motions of the test split, in order.
    pub test: Vec<NamedMotion>,
}

/// A motion and its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedMotion {
    /// Name of the motion and of its file.
    pub name: String,
    /// Motion of the handles.
    pub motion: Motion,
    /// The cloth that they move; the setting's own where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloth: Option<String>,
}
