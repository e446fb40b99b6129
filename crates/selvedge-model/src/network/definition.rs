//! The layers of a network and the places of their weights in one flat array.

use std::ops::Range;
use std::slice::from_ref;

use crate::kernels::real::Real;
use crate::network::layers::block::Block;
use crate::network::layers::encoder::EncoderLayers;
use crate::network::layers::mlp::Mlp;
use crate::network::packed::{ModuleSize, Packer};
use crate::network::parameters::{Layout, Parameter, Start};
use crate::spec::{ModelSpec, OUTPUTS, SpecError};

/// Numbers of the modules: both encoders, the blocks, the decoder.
pub(super) const NODE_ENCODER: usize = 0;
pub(super) const ARC_ENCODER: usize = 1;
pub(super) const FIRST_BLOCK: usize = 2;

/// A network without its weights: the layout of the flat array, and the arithmetic.
#[derive(Clone, Debug)]
pub struct Network {
    pub(super) spec: ModelSpec,
    parameters: Vec<Parameter>,
    /// Of nodes and of arcs.
    pub(super) encoders: [EncoderLayers; 2],
    pub(super) blocks: Vec<Block>,
    pub(super) decoder: Mlp,
    /// Lengths of the packed matrices of each module, and the places of its weights.
    pub(crate) modules: Vec<(ModuleSize, Range<usize>)>,
}

impl Network {
    /// Lays out the network of `spec`.
    ///
    /// # Errors
    /// [`SpecError`] for a spec that no network can be built from.
    pub fn new(spec: &ModelSpec) -> Result<Self, SpecError> {
        spec.validate()?;
        let (latent, mut layout) = (spec.latent, Layout::default());
        let widths = [
            ("encoder.nodes", spec.node_width()),
            ("encoder.edges", spec.edge_width()),
        ];
        let encoders = widths.map(|(path, width)| {
            layout.module(|layout| EncoderLayers::new(layout, path, spec.encoder, width, latent))
        });
        let blocks = (0..spec.blocks).map(|number| {
            let path = format!("processor.{number}");
            layout.module(|layout| Block::new(layout, &path, latent))
        });
        let blocks = blocks.collect();
        let all = 0..latent;
        let decoder =
            layout.module(|layout| Mlp::plain(layout, "decoder", from_ref(&all), latent, OUTPUTS));
        Ok(Self {
            spec: spec.clone(),
            parameters: layout.parameters,
            encoders,
            blocks,
            decoder,
            modules: layout.modules,
        })
    }

    /// The spec that the network is built from.
    pub fn spec(&self) -> &ModelSpec {
        &self.spec
    }

    /// Names, shapes and places of all weights.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Length of the flat array of weights.
    pub fn parameter_count(&self) -> usize {
        self.parameters.last().map_or(0, |last| last.range.end)
    }

    /// Fresh weights; `uniform` gives numbers in [0, 1).
    pub fn initialise(&self, uniform: &mut dyn FnMut() -> f64) -> Vec<f32> {
        let mut weights = Vec::with_capacity(self.parameter_count());
        for parameter in &self.parameters {
            weights.extend(parameter.range.clone().map(|_| match parameter.start {
                Start::Uniform { bound } => (bound * (2.0 * uniform() - 1.0)) as f32,
                Start::Constant { value } => value as f32,
            }));
        }
        weights
    }

    /// Packs the matrices of a module.
    pub(super) fn pack_module<T: Real>(&self, number: usize, packer: &mut Packer<'_, T>) {
        if let Some(encoder) = self.encoders.get(number) {
            encoder.pack(packer);
        } else if let Some(block) = self.blocks.get(number - FIRST_BLOCK) {
            block.pack(packer);
        } else {
            self.decoder.pack(packer);
        }
    }

    /// Numbers in a row of the features of a vertex and of an arc.
    pub(super) fn input_widths(&self) -> [usize; 2] {
        [self.spec.node_width(), self.spec.edge_width()]
    }
}
