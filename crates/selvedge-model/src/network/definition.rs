//! The layers of a network and the places of their weights in one flat array.

use std::ops::Range;

use crate::kernels::real::Real;
use crate::network::layers::block::Block;
use crate::network::layers::encoder::EncoderLayers;
use crate::network::layers::mlp::Mlp;
use crate::network::packed::{ModuleBuilder, ModuleSize, Packer, Piece};
use crate::network::parameters::{Parameter, Start};
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
    pub(super) node_encoder: EncoderLayers,
    pub(super) arc_encoder: EncoderLayers,
    pub(super) blocks: Vec<Block>,
    pub(super) decoder: Mlp,
    pub(super) decoder_first: Piece,
    pub(super) sizes: Vec<ModuleSize>,
    /// First weight of each module, and the end of the last one, `[modules + 1]`.
    ends: Vec<usize>,
}

/// The modules laid out so far.
struct Modules {
    builder: ModuleBuilder,
    sizes: Vec<ModuleSize>,
    ends: Vec<usize>,
}

impl Modules {
    /// Lays out one more module.
    fn add<L>(&mut self, make: impl FnOnce(&mut ModuleBuilder) -> L) -> L {
        self.builder.size = ModuleSize::default();
        let layers = make(&mut self.builder);
        self.sizes.push(self.builder.size);
        self.ends.push(self.builder.layout.length());
        layers
    }
}

impl Network {
    /// Lays out the network of `spec`.
    ///
    /// # Errors
    /// [`SpecError`] for a spec that no network can be built from.
    pub fn new(spec: &ModelSpec) -> Result<Self, SpecError> {
        spec.validate()?;
        let mut modules = Modules {
            builder: ModuleBuilder::default(),
            sizes: Vec::new(),
            ends: vec![0],
        };
        let latent = spec.latent;
        let width = spec.node_width();
        let node_encoder = modules
            .add(|module| EncoderLayers::new(module, "encoder.nodes", spec.encoder, width, latent));
        let width = spec.edge_width();
        let arc_encoder = modules
            .add(|module| EncoderLayers::new(module, "encoder.edges", spec.encoder, width, latent));
        let mut blocks = Vec::with_capacity(spec.blocks);
        for number in 0..spec.blocks {
            let path = format!("processor.{number}");
            blocks.push(modules.add(|module| Block::new(module, &path, spec)));
        }
        let (decoder, decoder_first) = modules.add(|module| {
            let decoder = Mlp::plain(module, "decoder", latent, latent, OUTPUTS);
            let first = Piece::whole(&mut module.size, &decoder.first);
            (decoder, first)
        });
        Ok(Self {
            spec: spec.clone(),
            parameters: modules.builder.layout.finish(),
            node_encoder,
            arc_encoder,
            blocks,
            decoder,
            decoder_first,
            sizes: modules.sizes,
            ends: modules.ends,
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
        match number {
            NODE_ENCODER => self.node_encoder.pack(packer),
            ARC_ENCODER => self.arc_encoder.pack(packer),
            _ => match self.blocks.get(number - FIRST_BLOCK) {
                Some(block) => block.pack(packer),
                None => {
                    self.decoder_first.pack(packer);
                    self.decoder.pack(packer);
                }
            },
        }
    }

    /// Places of the weights of modules `first..=last`.
    pub(super) fn weights_of(&self, first: usize, last: usize) -> Range<usize> {
        self.ends[first]..self.ends[last + 1]
    }
}
