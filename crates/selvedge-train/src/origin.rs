//! The account of where a training's first weights come from.

use serde::{Deserialize, Serialize};

/// A training whose weights another one began with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// The name of its configuration.
    pub name: String,
    /// Its steps by then.
    pub steps_done: u64,
    /// The name of its data set.
    pub dataset: String,
}
