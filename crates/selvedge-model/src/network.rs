//! The whole network: encoders, processor, decoder (Encode-Process-Decode), forward and backward
//! on one flat array of weights, in `f32` or `f64`.

use crate::connectivity::Connectivity;
use crate::layers::block::{Block, BlockRecord, BlockScratch, Latents};
use crate::layers::encoder::{EncoderEnds, EncoderLayers, EncoderRecord, mlp_tiles};
use crate::layers::mlp::{Mlp, MlpRecord, MlpScratch};
use crate::layers::{TILE, resize, tiles};
use crate::parameters::{LayoutBuilder, Parameter, Start};
use crate::product::Store;
use crate::real::Real;
use crate::spec::{ModelSpec, SpecError};
use rayon::prelude::*;

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
pub enum Pass {
    /// To use the output: activations are not kept.
    Inference,
    /// To learn from it: activations are kept for [`Network::backward`].
    Training(Option<Dropout>),
}

/// Dropout between the layers of the recurrent encoder: a value is zero with probability `rate`,
/// else divided by 1 - `rate`. Which ones follows from `seed` alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout {
    /// Probability of a zero.
    pub rate: f64,
    /// Decides which values.
    pub seed: u64,
}

impl Dropout {
    /// Multiplies `values`, the first of which has number `first`, by their mask.
    pub(crate) fn apply<T: Real>(self, values: &mut [T], first: usize) {
        let scale = T::from_f64(1.0 / (1.0 - self.rate));
        let threshold = (self.rate * (1u64 << 32) as f64) as u64;
        for (number, value) in values.iter_mut().enumerate() {
            let hash = split_mix(self.seed.wrapping_add((first + number) as u64));
            let kept = hash >> 32 >= threshold;
            *value *= if kept { scale } else { T::ZERO };
        }
    }

    /// The mask of the other encoder.
    fn other(self) -> Self {
        Self {
            seed: split_mix(!self.seed),
            ..self
        }
    }
}

/// A hash of 64 bits to 64 bits (Steele, Lea and Flood 2014).
fn split_mix(number: u64) -> u64 {
    let z = number.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Everything that a pass writes: allocated on the first pass of a size, then reused.
#[derive(Default)]
pub struct Workspace<T> {
    nodes: Vec<T>,
    edges: Vec<T>,
    node_encoder: EncoderRecord<T>,
    edge_encoder: EncoderRecord<T>,
    blocks: Vec<BlockRecord<T>>,
    scratch: BlockScratch<T>,
    decoder: MlpRecord<T>,
    /// Latent vertices before the decoder.
    decoded: Vec<T>,
    output: Vec<T>,
    dropout: Option<Dropout>,
    /// Whether the activations are those of a training pass that no backward pass has used up.
    kept: bool,
}

impl<T: Real> Workspace<T> {
    /// An empty workspace.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let encoders = [&self.node_encoder, &self.edge_encoder];
        let blocks = self.blocks.iter().map(BlockRecord::number_count);
        let flat = [&self.nodes, &self.edges, &self.decoded, &self.output];
        encoders.iter().map(|e| e.number_count()).sum::<usize>()
            + blocks.sum::<usize>()
            + self.scratch.number_count()
            + self.decoder.number_count()
            + flat.iter().map(|numbers| numbers.len()).sum::<usize>()
    }
}

impl Network {
    /// Lays out the network of `spec`.
    ///
    /// # Errors
    /// [`SpecError`] for a spec that no network can be built from.
    pub fn new(spec: &ModelSpec) -> Result<Self, SpecError> {
        spec.validate()?;
        let mut layout = LayoutBuilder::default();
        let latent = spec.latent;
        let mut encoder =
            |path, width| EncoderLayers::new(&mut layout, path, [width, latent], spec.encoder);
        let node_encoder = encoder("encoder.nodes", spec.node_width());
        let edge_encoder = encoder("encoder.edges", spec.edge_width());
        let blocks = (0..spec.blocks)
            .map(|number| Block::new(&mut layout, &format!("processor.{number}"), latent))
            .collect();
        let decoder = Mlp::plain(&mut layout, "decoder", latent, [latent, OUTPUTS]);
        Ok(Self {
            spec: spec.clone(),
            parameters: layout.finish(),
            node_encoder,
            edge_encoder,
            blocks,
            decoder,
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

    /// Normalised accelerations `[vertices, 3]` for normalised features.
    ///
    /// # Panics
    /// When the lengths of `weights` or `input` are not those of the spec and the graph.
    pub fn forward<'w, T: Real>(
        &self,
        weights: &[T],
        graph: &Connectivity,
        input: Input<'_, T>,
        pass: Pass,
        workspace: &'w mut Workspace<T>,
    ) -> &'w [T] {
        let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
        let (spec, latent) = (&self.spec, self.spec.latent);
        assert_eq!(weights.len(), self.parameter_count());
        assert_eq!(
            input.nodes.len(),
            spec.window() * vertices * spec.node_width()
        );
        assert_eq!(input.edges.len(), spec.window() * arcs * spec.edge_width());
        let w = workspace;
        let records = match pass {
            Pass::Inference => 1,
            Pass::Training(_) => self.blocks.len(),
        };
        w.blocks.resize_with(records, BlockRecord::default);
        w.kept = matches!(pass, Pass::Training(_));
        w.dropout = match pass {
            Pass::Inference => None,
            Pass::Training(dropout) => dropout.filter(|dropout| dropout.rate > 0.0),
        };
        resize(&mut w.nodes, vertices * latent);
        resize(&mut w.edges, arcs * latent);
        let nodes = (input.nodes, spec.node_width());
        self.node_encoder
            .forward(weights, nodes, w.dropout, &mut w.node_encoder, &mut w.nodes);
        let edges = (input.edges, spec.edge_width());
        let dropout = w.dropout.map(Dropout::other);
        self.edge_encoder
            .forward(weights, edges, dropout, &mut w.edge_encoder, &mut w.edges);
        for (number, block) in self.blocks.iter().enumerate() {
            let mut latents = Latents {
                nodes: &mut w.nodes,
                edges: &mut w.edges,
            };
            let record = &mut w.blocks[number % records];
            block.forward(weights, graph, &mut latents, record, &mut w.scratch);
        }
        self.decode(weights, w);
        &w.output
    }

    fn decode<T: Real>(&self, weights: &[T], w: &mut Workspace<T>) {
        let latent = self.spec.latent;
        let vertices = w.nodes.len() / latent;
        resize(&mut w.output, vertices * OUTPUTS);
        w.decoder.fit(&self.decoder, vertices);
        (
            mlp_tiles(&mut w.decoder, latent),
            w.nodes.par_chunks(TILE * latent),
            w.output.par_chunks_mut(TILE * OUTPUTS),
        )
            .into_par_iter()
            .for_each(|(tile, nodes, out)| {
                let nodes = (nodes, Store::Replace);
                self.decoder
                    .first_product(weights, (0, latent), nodes, tile.hidden1);
                self.decoder.finish(weights, tile, out);
            });
    }

    /// The derivatives of Σ `output` ∘ out, where out is what the last [`Self::forward`] with
    /// [`Pass::Training`] on the same arguments gave; its activations are used up.
    ///
    /// # Panics
    /// When the lengths are not those of the spec and the graph, or the last pass was not a
    /// forward one with [`Pass::Training`].
    pub fn backward<T: Real>(
        &self,
        (weights, gradients): (&[T], Gradients<'_, T>),
        graph: &Connectivity,
        input: Input<'_, T>,
        output: &[T],
        workspace: &mut Workspace<T>,
    ) {
        let w = workspace;
        let (gradient, to_nodes, to_edges) = match gradients.input {
            Some(input) => (gradients.weights, Some(input.nodes), Some(input.edges)),
            None => (gradients.weights, None, None),
        };
        let (spec, latent) = (&self.spec, self.spec.latent);
        assert!(
            std::mem::take(&mut w.kept),
            "a forward pass to learn from comes first"
        );
        assert_eq!(output.len(), graph.vertex_count() * OUTPUTS);
        assert_eq!(gradient.len(), weights.len());
        self.decode_backward((weights, gradient), output, w);
        w.edges.fill(T::ZERO);
        for (block, record) in self.blocks.iter().zip(&mut w.blocks).rev() {
            let mut gradients = Latents {
                nodes: &mut w.nodes,
                edges: &mut w.edges,
            };
            block.backward(
                (weights, gradient),
                graph,
                &mut gradients,
                record,
                &mut w.scratch,
            );
        }
        debug_assert_eq!(w.nodes.len(), graph.vertex_count() * latent);
        let nodes = (input.nodes, spec.node_width());
        let (encoder, record) = (&self.node_encoder, &mut w.node_encoder);
        let ends = EncoderEnds {
            to_input: to_nodes,
            output: &mut w.nodes,
        };
        encoder.backward((weights, gradient), nodes, w.dropout, record, ends);
        let edges = (input.edges, spec.edge_width());
        let dropout = w.dropout.map(Dropout::other);
        let (encoder, record) = (&self.edge_encoder, &mut w.edge_encoder);
        let ends = EncoderEnds {
            to_input: to_edges,
            output: &mut w.edges,
        };
        encoder.backward((weights, gradient), edges, dropout, record, ends);
    }

    /// Leaves the gradient of the latent vertices before the decoder in their place.
    fn decode_backward<T: Real>(
        &self,
        (weights, gradient): (&[T], &mut [T]),
        output: &[T],
        w: &mut Workspace<T>,
    ) {
        let latent = self.spec.latent;
        let mut scratch = MlpScratch::new(latent);
        let mut tile_output = [T::ZERO; TILE * OUTPUTS];
        w.decoded.clone_from(&w.nodes);
        for rows in tiles(output.len() / OUTPUTS) {
            let tile_output = &mut tile_output[..rows.len() * OUTPUTS];
            tile_output.copy_from_slice(&output[rows.start * OUTPUTS..rows.end * OUTPUTS]);
            let tile = w.decoder.tile(&self.decoder, &rows);
            self.decoder
                .finish_backward(weights, &tile, tile_output, &mut scratch, gradient);
            let range = rows.start * latent..rows.end * latent;
            let pair = (&scratch.first[..range.len()], &w.decoded[range.clone()]);
            let to_nodes = Some((&mut w.nodes[range], Store::Replace));
            self.decoder
                .first_backward(weights, (0, latent), pair, gradient, to_nodes);
        }
    }
}
