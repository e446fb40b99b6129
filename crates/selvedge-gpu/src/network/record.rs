//! The arrays that a forward pass leaves in the arena. Where no activations are kept, arrays of
//! different layers are the same regions, and arrays that nothing reads later are left out.

use crate::schedule::plan::Region;

/// Activations of a perceptron, `[rows, latent]` each.
#[derive(Clone, Debug)]
pub struct MlpRecord {
    /// After the first ReLU.
    pub hidden1: Region,
    /// After the second.
    pub hidden2: Region,
    /// The normalised output, (x - mean) / deviation; room for the output where nothing is kept.
    /// None in a decoder.
    pub normal: Option<Region>,
    /// 1 / deviation, `[rows]`, where it is kept.
    pub inverse: Option<Region>,
}

/// Activations of a recurrent encoder.
#[derive(Clone, Debug)]
pub struct GruRecord {
    /// States of both layers, the initial one first: `steps + 1` arrays `[rows, latent]`.
    pub states: [Vec<Region>; 2],
    /// Gates r, z, n and the recurrent part of n of both layers, where they are kept: `steps`
    /// arrays `[rows, 4 latent]`.
    pub kept: [Vec<Region>; 2],
    /// Inputs of the second layer: the states of the first, after dropout if there is any; `steps`
    /// arrays `[rows, latent]`.
    pub between: Vec<Region>,
    /// The normalised output `[rows, latent]`; room for the output where nothing is kept.
    pub normal: Region,
    /// 1 / deviation, `[rows]`, where it is kept.
    pub inverse: Option<Region>,
}

/// Activations of an encoder.
#[derive(Clone, Debug)]
pub enum EncoderRecord {
    /// Activations of a perceptron.
    Mlp(MlpRecord),
    /// Activations of a recurrent network.
    Gru(GruRecord),
}

/// Activations of a block.
#[derive(Clone, Debug)]
pub struct BlockRecord {
    /// Latent vertices `[vertices, latent]` and arcs `[arcs, latent]` before the block.
    pub before: [Region; 2],
    /// Latent vertices and arcs after the block.
    pub after: [Region; 2],
    /// Sums of the messages that arrive, `[vertices, latent]`.
    pub incoming: Region,
    /// Activations of the perceptron of arcs.
    pub arc: MlpRecord,
    /// Activations of the perceptron of vertices.
    pub node: MlpRecord,
}

/// Activations of the network.
#[derive(Clone, Debug)]
pub struct Record {
    /// Activations of the encoder of vertices.
    pub node_encoder: EncoderRecord,
    /// Activations of the encoder of arcs.
    pub arc_encoder: EncoderRecord,
    /// Activations of the blocks, in order.
    pub blocks: Vec<BlockRecord>,
    /// Activations of the decoder.
    pub decoder: MlpRecord,
    /// Latent vertices that go into the decoder, `[vertices, latent]`.
    pub nodes: Region,
    /// Normalised accelerations, `[vertices, 3]`.
    pub output: Region,
}
