//! The weights of a network in the arena: the flat array of the weight file, addressed by name, and
//! the packed parts of the first edge layers for the two endpoints of an arc.

use std::collections::HashMap;
use std::ops::Range;

use selvedge_model::Network;

use crate::kernels::layers::PACK_ENDS;
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Matrix, Schedule, args};

/// The arrays of the weights.
#[derive(Clone, Debug)]
pub struct WeightArrays {
    flat: Region,
    /// The packed parts, `[blocks, 2 latent, latent]`.
    ends: Region,
    places: HashMap<String, (Range<usize>, usize)>,
    blocks: usize,
    latent: usize,
}

impl WeightArrays {
    /// Room for the weights of a network.
    pub fn new(plan: &mut Plan, network: &Network) -> Self {
        let spec = network.spec();
        let place = |p: &selvedge_model::Parameter| {
            let columns = p.shape.last().copied().unwrap_or(1);
            (p.name.clone(), (p.range.clone(), columns))
        };
        Self {
            flat: plan.floats("weights", network.parameter_count()),
            ends: plan.floats(
                "weights of both ends",
                spec.blocks * 2 * spec.latent * spec.latent,
            ),
            places: network.parameters().iter().map(place).collect(),
            blocks: spec.blocks,
            latent: spec.latent,
        }
    }

    /// All weights, as [`Network::parameters`] lays them out.
    #[must_use]
    pub fn flat(&self) -> Region {
        self.flat
    }

    /// The place of a weight in an array laid out like the weights, and the width of its rows.
    ///
    /// # Panics
    /// When the network has no weight of this name.
    #[must_use]
    pub fn place(&self, name: &str) -> (Range<usize>, usize) {
        let found = self.places.get(name);
        assert!(found.is_some(), "the network has no weight {name}");
        found.cloned().unwrap_or_default()
    }

    /// A weight by its name.
    ///
    /// # Panics
    /// As [`Self::place`].
    #[must_use]
    pub fn get(&self, name: &str) -> Region {
        self.flat.part(self.place(name).0)
    }

    /// A weight as a matrix `[outputs, inputs]`.
    ///
    /// # Panics
    /// As [`Self::place`].
    #[must_use]
    pub fn matrix(&self, name: &str) -> Matrix {
        let (range, columns) = self.place(name);
        Matrix::new(self.flat.part(range), columns)
    }

    /// The packed first edge layer of a block, for sender and receiver, `[2 latent, latent]`.
    #[must_use]
    pub fn ends(&self, block: usize) -> Matrix {
        let size = 2 * self.latent;
        let region = self
            .ends
            .rows(block * size..(block + 1) * size, self.latent);
        Matrix::new(region, self.latent)
    }

    /// Adds the packing of the weights to a schedule. It must run after every change of the
    /// weights.
    pub fn pack(&self, schedule: &mut Schedule) {
        let first = |block: usize| {
            let name = format!("processor.{block}.edge.0.weight");
            self.place(&name).0.start
        };
        let apart = if self.blocks > 1 {
            first(1) - first(0)
        } else {
            0
        };
        // The weights of a network are fewer than 2^32: a layer has 3 · 4096² of them at most, and
        // 256 blocks would not fit into any memory at that size.
        let arguments = args! {
            weights: self.flat,
            first: first(0),
            apart,
            packed: self.ends,
        };
        schedule.launch(&PACK_ENDS, self.ends.count(), arguments);
    }
}
