//! A cloth's graph with all that a network of a spec sees of the cloth.

use crate::graph::cloth_graph::ClothGraph;
use crate::spec::ModelSpec;

impl ClothGraph {
    /// The same cloth with the modes of networks of this spec.
    #[must_use]
    pub fn for_spec(self, spec: &ModelSpec) -> Self {
        self.with_modes(spec.filter_modes)
    }
}
