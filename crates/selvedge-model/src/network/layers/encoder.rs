//! The encoder of vertices or of arcs: normalised features of a window of frames to latent rows,
//! by a perceptron on the frames side by side, or by a recurrent network.

use std::ops::Range;

use crate::graph::partition::{chunks, of_rows};
use crate::kernels::gemm::{Columns, Finish, multiply};
use crate::kernels::real::Real;
use crate::kernels::{Normalised, RowMasks};
use crate::network::layers::gru::{GruEncoder, GruRecord, GruTile, InputRows, States};
use crate::network::layers::mlp::{Mlp, MlpRecord};
use crate::network::layers::{GroupScratch, Scratch};
use crate::network::packed::{LayerWeights, ModuleSize, Packer, Piece};
use crate::network::parameters::{LayoutBuilder, ModuleGradient};

/// How rows of one kind are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowEncoder {
    /// A perceptron on so many frames side by side.
    Mlp(usize),
    /// A recurrent network over any number of frames.
    Gru,
}

/// Where the weights of an encoder lie.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EncoderLayers {
    /// With its first layer's matrix.
    Mlp(Mlp, Piece),
    Gru(GruEncoder),
}

/// Activations kept for the backward pass; only the one that the encoder uses is filled.
#[derive(Default)]
pub(crate) struct EncoderRecord<T> {
    mlp: MlpRecord<T>,
    pub(crate) gru: GruRecord<T>,
}

/// What goes into an encoder: features of all rows `[window, all rows, width]`, and what is dropped.
#[derive(Clone, Copy)]
pub(crate) struct EncoderInput<'a, T> {
    pub(crate) window: usize,
    pub(crate) features: &'a [T],
    pub(crate) width: usize,
    pub(crate) dropout: Option<&'a RowMasks>,
    /// States that are carried over, `[all rows, latent]` each; empty where none are.
    pub(crate) start: States<&'a [T]>,
}

/// The rows of a leaf that an encoder writes.
pub(crate) struct EncoderRows<'a, T> {
    /// `[rows, latent]`.
    pub(crate) out: &'a mut [T],
    /// As [`EncoderRecord::rows`] has them; empty where nothing is kept.
    pub(crate) record: [&'a mut [T]; 7],
    /// The states at the end `[rows, latent]`; empty where nobody asks.
    pub(crate) end: States<&'a mut [T]>,
}

/// The gradients of a leaf's rows at both ends of an encoder.
pub(crate) struct EncoderEnds<'a, T> {
    /// That of the output `[rows, latent]`; overwritten.
    pub(crate) output: &'a mut [T],
    /// That of the input `[rows, window width]`, unless it is empty; set.
    pub(crate) to_input: &'a mut [T],
    /// Those of the states at the end, of all rows; empty for zero.
    pub(crate) end: States<&'a [T]>,
    /// Those of the carried states, unless empty; set.
    pub(crate) start: States<&'a mut [T]>,
}

impl<T: Real> EncoderRecord<T> {
    /// Makes room for `rows` rows and `steps` frames.
    pub(crate) fn fit(
        &mut self,
        layers: &EncoderLayers,
        (rows, steps): (usize, usize),
        dropout: Option<&RowMasks>,
    ) {
        match layers {
            EncoderLayers::Mlp(mlp, ..) => self.mlp.fit(mlp, rows),
            EncoderLayers::Gru(gru) => self.gru.fit(gru, (rows, steps), dropout),
        }
    }

    /// Everything, with the widths of its rows; empty after what the encoder has.
    pub(crate) fn rows(&mut self, layers: &EncoderLayers) -> [(&mut [T], usize); 7] {
        match layers {
            EncoderLayers::Mlp(mlp, ..) => {
                let [a, b, c, d] = self.mlp.rows(mlp);
                let [e, f, g] = <[(&mut [T], usize); 3]>::default();
                [a, b, c, d, e, f, g]
            }
            EncoderLayers::Gru(gru) => self.gru.rows(gru),
        }
    }
}

#[cfg(test)]
impl<T: Real> EncoderRecord<T> {
    /// Numbers held.
    pub(crate) fn number_count(&self) -> usize {
        self.mlp.number_count() + self.gru.number_count()
    }
}

impl EncoderLayers {
    pub(crate) fn new(
        (layout, size): (&mut LayoutBuilder, &mut ModuleSize),
        path: &str,
        sizes: [usize; 2],
        encoder: RowEncoder,
    ) -> Self {
        match encoder {
            RowEncoder::Mlp(window) => {
                let to = (layout, &mut *size);
                let mlp = Mlp::normalised(to, path, window * sizes[0], sizes[1]);
                Self::Mlp(mlp, Piece::whole(size, &mlp.first))
            }
            RowEncoder::Gru => Self::Gru(GruEncoder::new((layout, size), path, sizes)),
        }
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        match self {
            Self::Mlp(mlp, first) => {
                mlp.pack(packer);
                first.pack(packer);
            }
            Self::Gru(gru) => gru.pack(packer),
        }
    }

    /// Takes rows `leaf` of the input to their latent rows.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        leaf: Range<usize>,
        rows: EncoderRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let all_rows = input.features.len() / (input.window * input.width);
        let latent = rows.out.len() / leaf.len().max(1);
        let EncoderRows {
            out,
            mut record,
            mut end,
        } = rows;
        for chunk in chunks(leaf.clone()) {
            let local = chunk.start - leaf.start..chunk.end - leaf.start;
            let out = &mut out[of_rows(&local, latent)];
            match self {
                Self::Mlp(mlp, first) => {
                    let features = join(input, &chunk, &mut scratch.joined);
                    let record = record.each_mut().map(|record| &mut **record);
                    let [a, b, c, d, ..] = record;
                    let mut tile = scratch.tiles.tile([a, b, c, d], &local, latent);
                    let terms = &[first.times(weights, features)];
                    mlp.first_layer(weights, terms, mlp.first_finish(weights), &mut tile);
                    mlp.forward(weights, tile, Normalised::Set(out));
                }
                Self::Gru(gru) => {
                    let window = InputRows {
                        input: input.features,
                        all_rows,
                        steps: input.window,
                        first: chunk.start,
                        rows: chunk.len(),
                    };
                    let start = input.start.map(|s| part(s, &chunk, latent));
                    let end = end.each_mut().map(|s| part_mut(s, &local, latent));
                    let tile = gru_tile(&mut record, leaf.len(), &local);
                    let given = (window, input.dropout);
                    gru.forward(weights, given, (start, end), (tile, &mut *scratch), out);
                }
            }
        }
    }

    /// Adds the gradients of all weights for the gradient of the latent rows `leaf`.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        (leaf, record): (Range<usize>, &EncoderRecord<T>),
        ends: EncoderEnds<'_, T>,
        group: (&mut GroupScratch<T>, &mut ModuleGradient<'_, T>),
    ) {
        let (scratch, gradient) = group;
        let window = input.window;
        let all_rows = input.features.len() / (window * input.width);
        let latent = ends.output.len() / leaf.len().max(1);
        let EncoderEnds {
            output,
            to_input,
            end,
            mut start,
        } = ends;
        for chunk in chunks(leaf.clone()) {
            let local = chunk.start - leaf.start..chunk.end - leaf.start;
            let output = &mut output[of_rows(&local, latent)];
            let to_input = part_mut(to_input, &local, window * input.width);
            match self {
                Self::Mlp(mlp, piece) => {
                    let kept = record.mlp.tile(mlp, &chunk);
                    let first = &mut scratch.first[..output.len()];
                    let buffers = (&mut scratch.hidden[..output.len()], &mut *first);
                    mlp.backward(weights, kept, output, buffers, gradient);
                    let features = join(input, &chunk, &mut scratch.joined);
                    let width = window * input.width;
                    let pair = (Columns::all(first, latent), Columns::all(features, width));
                    mlp.first_backward(weights, 0, pair, gradient);
                    if !to_input.is_empty() {
                        let terms = &[piece.back(weights, first)];
                        multiply(weights.instructions, terms, width, Finish::Set, to_input);
                    }
                }
                Self::Gru(gru) => {
                    let rows = InputRows {
                        input: input.features,
                        all_rows,
                        steps: input.window,
                        first: chunk.start,
                        rows: chunk.len(),
                    };
                    let given = (rows, input.dropout);
                    let ends = EncoderEnds {
                        output,
                        to_input,
                        end: end.map(|s| part(s, &chunk, latent)),
                        start: start.each_mut().map(|s| part_mut(s, &local, latent)),
                    };
                    let group = (&mut *scratch, &mut *gradient);
                    gru.backward(weights, given, &record.gru, ends, group);
                }
            }
        }
    }
}

/// Rows `rows` of an array, or nothing of an empty one.
fn part<'a, T>(array: &'a [T], rows: &Range<usize>, width: usize) -> &'a [T] {
    array.get(of_rows(rows, width)).unwrap_or_default()
}

/// Rows `rows` of an array, or nothing of an empty one.
fn part_mut<'a, T>(array: &'a mut [T], rows: &Range<usize>, width: usize) -> &'a mut [T] {
    array.get_mut(of_rows(rows, width)).unwrap_or_default()
}

/// What a perceptron sees of a chunk: the frames of the window side by side, `[rows, window width]`.
fn join<'a, T: Real>(
    input: EncoderInput<'a, T>,
    rows: &Range<usize>,
    room: &'a mut [T],
) -> &'a [T] {
    let (features, window, width) = (input.features, input.window, input.width);
    if window == 1 {
        return &features[of_rows(rows, width)];
    }
    let size = features.len() / window;
    let room = &mut room[..rows.len() * window * width];
    for (frame, features) in features.chunks_exact(size).enumerate() {
        let from = features[of_rows(rows, width)].chunks_exact(width);
        for (to, from) in room.chunks_exact_mut(window * width).zip(from) {
            to[frame * width..(frame + 1) * width].copy_from_slice(from);
        }
    }
    room
}

/// The rows `local` of a leaf of `rows` rows in a record.
fn gru_tile<'a, T>(
    record: &'a mut [&mut [T]; 7],
    rows: usize,
    local: &Range<usize>,
) -> GruTile<'a, T> {
    let part = |array: &'a mut [T]| {
        let width = array.len() / rows.max(1);
        &mut array[of_rows(local, width)]
    };
    let [s0, s1, k0, k1, between, normal, inverse_deviation] = record.each_mut().map(|a| &mut **a);
    GruTile {
        states: [part(s0), part(s1)],
        kept: [part(k0), part(k1)],
        between: part(between),
        normal: part(normal),
        inverse_deviation: part(inverse_deviation),
    }
}
