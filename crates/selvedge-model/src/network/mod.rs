//! The whole network: encoders, processor, decoder (Encode-Process-Decode), forward and backward
//! on one flat array of weights, in `f32` or `f64`.

mod backward;
pub(crate) mod cost;
mod forward;
pub(crate) mod layers;
pub(crate) mod packed;
pub(crate) mod parameters;
pub(crate) mod passes;
pub mod reference;
pub mod roofline;
pub(crate) mod workspace;

use std::ops::Range;

use crate::kernels::Dropout;
use crate::kernels::real::Real;
use crate::network::layers::block::{Block, BlockRecord};
use crate::network::layers::encoder::EncoderLayers;
use crate::network::layers::mlp::Mlp;
use crate::network::packed::{ModuleSize, Packer, Piece};
use crate::network::parameters::{LayoutBuilder, Parameter, Start};
use crate::network::workspace::Workspace;
use crate::spec::{Encoder, ModelSpec, SpecError};
pub use backward::StateGradients;

/// Modules: both encoders, the blocks, the decoder.
const NODE_ENCODER: usize = 0;
const EDGE_ENCODER: usize = 1;
const FIRST_BLOCK: usize = 2;

/// Columns of the output: an acceleration.
pub(crate) const OUTPUTS: usize = 3;

/// A network without its weights: what lies where in the flat array, and the arithmetic.
#[derive(Clone, Debug)]
pub struct Network {
    spec: ModelSpec,
    parameters: Vec<Parameter>,
    node_encoder: EncoderLayers,
    edge_encoder: EncoderLayers,
    blocks: Vec<Block>,
    decoder: Mlp,
    decoder_first: Piece,
    sizes: Vec<ModuleSize>,
    /// Where the weights of each module begin, and where the last ones end.
    ends: Vec<usize>,
}

/// Normalised features of a window of frames, oldest first.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a, T> {
    /// `[window, vertices, node width]`.
    pub nodes: &'a [T],
    /// `[window, arcs, edge width]`.
    pub edges: &'a [T],
}

/// Where [`Network::backward`] leaves derivatives.
pub struct Gradients<'a, T> {
    /// Laid out like the weights; added to.
    pub weights: &'a mut [T],
    /// Those of the input, where asked for; overwritten.
    pub input: Option<InputGradient<'a, T>>,
}

/// Derivatives with respect to an [`Input`].
pub struct InputGradient<'a, T> {
    /// `[window, vertices, node width]`.
    pub nodes: &'a mut [T],
    /// `[window, arcs, edge width]`.
    pub edges: &'a mut [T],
}

/// What a pass through the network is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pass<'a> {
    /// To use the output: activations are not kept.
    Inference,
    /// To learn from it: activations are kept for [`Network::backward`].
    Training(Option<Dropout<'a>>),
}

impl Network {
    /// Lays out the network of `spec`.
    ///
    /// # Errors
    /// [`SpecError`] for a spec that no network can be built from.
    pub fn new(spec: &ModelSpec) -> Result<Self, SpecError> {
        spec.validate()?;
        let mut layout = LayoutBuilder::default();
        let (mut sizes, mut ends) = (Vec::new(), vec![0]);
        let latent = spec.latent;
        let mut module = |layout: &mut LayoutBuilder, size| {
            sizes.push(size);
            ends.push(layout.length());
        };
        let [nodes, edges] = spec.encoder.rows();
        let mut encoder = |path, width, rows| {
            let mut size = ModuleSize::default();
            let to = (&mut layout, &mut size);
            let layers = EncoderLayers::new(to, path, [width, latent], rows);
            module(&mut layout, size);
            layers
        };
        let node_encoder = encoder("encoder.nodes", spec.node_width(), nodes);
        let edge_encoder = encoder("encoder.edges", spec.edge_width(), edges);
        let mut blocks = Vec::with_capacity(spec.blocks);
        for number in 0..spec.blocks {
            let mut size = ModuleSize::default();
            let path = format!("processor.{number}");
            blocks.push(Block::new((&mut layout, &mut size), &path, latent));
            module(&mut layout, size);
        }
        let mut size = ModuleSize::default();
        let to = (&mut layout, &mut size);
        let decoder = Mlp::plain(to, "decoder", latent, [latent, OUTPUTS]);
        let decoder_first = Piece::whole(&mut size, &decoder.first);
        module(&mut layout, size);
        Ok(Self {
            spec: spec.clone(),
            parameters: layout.finish(),
            node_encoder,
            edge_encoder,
            blocks,
            decoder,
            decoder_first,
            sizes,
            ends,
        })
    }

    /// What the network is made of.
    #[must_use]
    pub fn spec(&self) -> &ModelSpec {
        &self.spec
    }

    /// Names, shapes and places of all weights.
    #[must_use]
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Length of the flat array of weights.
    #[must_use]
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

    /// Whether its encoders carry a state from frame to frame.
    #[must_use]
    pub fn streams(&self) -> bool {
        matches!(self.spec.encoder, Encoder::StreamingGru { .. })
    }

    /// Lengths of the packed matrices of each module: both encoders, the blocks, the decoder.
    pub(crate) fn module_sizes(&self) -> &[ModuleSize] {
        &self.sizes
    }

    /// Packs the matrices of a module.
    pub(crate) fn pack_module<T: Real>(&self, number: usize, packer: &mut Packer<'_, T>) {
        match number {
            NODE_ENCODER => self.node_encoder.pack(packer),
            EDGE_ENCODER => self.edge_encoder.pack(packer),
            _ => match self.blocks.get(number - FIRST_BLOCK) {
                Some(block) => block.pack(packer),
                None => {
                    self.decoder_first.pack(packer);
                    self.decoder.pack(packer);
                }
            },
        }
    }

    /// Where the weights of modules `first..=last` lie.
    fn weights_of(&self, first: usize, last: usize) -> Range<usize> {
        self.ends[first]..self.ends[last + 1]
    }

    /// Widths of the rows of encoders that are put side by side, and of those of their states.
    pub(crate) fn scratch_widths(&self) -> (usize, usize) {
        let spec = &self.spec;
        let joined =
            (spec.node_window() * spec.node_width()).max(spec.edge_window() * spec.edge_width());
        match spec.encoder {
            Encoder::Mlp { .. } => (joined, 0),
            _ => (joined, spec.latent),
        }
    }

    pub(crate) fn fit_records<T: Real>(
        &self,
        w: &mut Workspace<T>,
        [vertices, arcs]: [usize; 2],
        windows: [usize; 2],
    ) {
        w.node_encoder.fit(
            &self.node_encoder,
            (vertices, windows[0]),
            w.dropout[0].active(),
        );
        w.edge_encoder.fit(
            &self.edge_encoder,
            (arcs, windows[1]),
            w.dropout[1].active(),
        );
        w.blocks
            .resize_with(self.blocks.len(), BlockRecord::default);
        for (record, block) in w.blocks.iter_mut().zip(&self.blocks) {
            record.fit(block, vertices, arcs);
        }
        w.decoder.fit(&self.decoder, vertices);
    }
}
