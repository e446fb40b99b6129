//! What a forward pass leaves in the arena. Without activations to keep, arrays of different layers are
//! the same regions, and those that nobody reads later are not there.

use crate::schedule::plan::Region;

/// Activations of a perceptron, `[rows, latent]` each.
#[derive(Clone, Debug)]
pub struct MlpRecord {
    /// After the first ReLU.
    pub hidden1: Region,
    /// After the second.
    pub hidden2: Region,
    /// The normalised output, (x - mean) / deviation; where nothing is kept, room for the output. None
    /// in a decoder.
    pub normal: Option<Region>,
    /// 1 / deviation, `[rows]`, where it is kept.
    pub inverse: Option<Region>,
}

/// Activations of a recurrent encoder.
#[derive(Clone, Debug)]
pub struct GruRecord {
    /// States of both layers, the initial one first: `steps + 1` of `[rows, latent]`.
    pub states: [Vec<Region>; 2],
    /// Gates r, z, n and the recurrent part of n of both layers, where they are kept: `steps` of
    /// `[rows, 4 latent]`.
    pub kept: [Vec<Region>; 2],
    /// What the second layer sees: the first one's states, or these after dropout; `steps` of
    /// `[rows, latent]`.
    pub between: Vec<Region>,
    /// The normalised output `[rows, latent]`; where nothing is kept, room for the output.
    pub normal: Region,
    /// 1 / deviation, `[rows]`, where it is kept.
    pub inverse: Option<Region>,
}

/// Activations of an encoder.
#[derive(Clone, Debug)]
pub enum EncoderRecord {
    /// Of a perceptron.
    Mlp(MlpRecord),
    /// Of a recurrent network.
    Gru(GruRecord),
}

/// Activations of a block.
#[derive(Clone, Debug)]
pub struct BlockRecord {
    /// Latent vertices `[vertices, latent]` and arcs `[arcs, latent]` before it.
    pub before: [Region; 2],
    /// The same after it.
    pub after: [Region; 2],
    /// Sum of the messages that arrive, `[vertices, latent]`.
    pub incoming: Region,
    /// Of the arcs' perceptron.
    pub edge: MlpRecord,
    /// Of the vertices' perceptron.
    pub node: MlpRecord,
}

/// Activations of the network.
#[derive(Clone, Debug)]
pub struct Record {
    /// Of the vertices' encoder.
    pub node_encoder: EncoderRecord,
    /// Of the arcs' encoder.
    pub edge_encoder: EncoderRecord,
    /// Of the blocks, in order.
    pub blocks: Vec<BlockRecord>,
    /// Of the decoder.
    pub decoder: MlpRecord,
    /// Latent vertices that go into the decoder, `[vertices, latent]`.
    pub nodes: Region,
    /// Normalised accelerations, `[vertices, 3]`.
    pub output: Region,
}
