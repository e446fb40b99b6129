//! The encoder of vertices or of arcs: normalised features of a window of frames to latent rows,
//! by a perceptron on the frames side by side, or by a recurrent network.

use rayon::prelude::*;

use crate::layers::gru::{GruEncoder, GruRecord, GruScratch, GruTile, InputRows};
use crate::layers::mlp::{Mlp, MlpRecord, MlpScratch, MlpTile};
use crate::layers::{TILE, tiles};
use crate::network::Dropout;
use crate::parameters::LayoutBuilder;
use crate::product::Store;
use crate::real::Real;
use crate::spec::Encoder;

/// Where the weights of an encoder lie.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EncoderLayers {
    Mlp(Mlp),
    Gru(GruEncoder),
}

/// Activations kept for the backward pass; only the one that the encoder uses is filled.
#[derive(Default)]
pub(crate) struct EncoderRecord<T> {
    mlp: MlpRecord<T>,
    pub(crate) gru: GruRecord<T>,
}

/// The gradients at both ends of an encoder.
pub(crate) struct EncoderEnds<'a, T> {
    /// That of the input `[window, rows, width]`, where asked for; set.
    pub(crate) to_input: Option<&'a mut [T]>,
    /// That of the output `[rows, latent]`; overwritten.
    pub(crate) output: &'a mut [T],
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
        layout: &mut LayoutBuilder,
        path: &str,
        sizes: [usize; 2],
        encoder: Encoder,
    ) -> Self {
        match encoder {
            Encoder::Mlp { window } => {
                let mlp = Mlp::normalised(layout, path, window * sizes[0], sizes[1]);
                Self::Mlp(mlp)
            }
            Encoder::Gru { window } => Self::Gru(GruEncoder::new(layout, path, sizes, window)),
        }
    }

    /// `input` `[window, rows, width]` to `out` `[rows, latent]`.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: &[T],
        (input, width): (&[T], usize),
        dropout: Option<Dropout>,
        record: &mut EncoderRecord<T>,
        out: &mut [T],
    ) {
        match self {
            Self::Mlp(mlp) => {
                let latent = mlp.first.outputs;
                record.mlp.fit(mlp, out.len() / latent);
                (
                    mlp_tiles(&mut record.mlp, latent),
                    out.par_chunks_mut(TILE * latent),
                )
                    .into_par_iter()
                    .enumerate()
                    .for_each(|(number, (tile, out))| {
                        let rows = number * TILE..number * TILE + out.len() / latent;
                        for (columns, input) in frames(mlp, (input, width), &rows) {
                            let store = if columns.0 == 0 {
                                Store::Replace
                            } else {
                                Store::Add
                            };
                            mlp.first_product(weights, columns, (input, store), tile.hidden1);
                        }
                        mlp.finish(weights, tile, out);
                    });
            }
            Self::Gru(gru) => {
                let rows = input.len() / (gru.steps * width);
                let latent = out.len() / rows;
                record.gru.fit(gru, rows);
                (
                    gru_tiles(&mut record.gru, gru.steps, latent),
                    out.par_chunks_mut(TILE * latent),
                )
                    .into_par_iter()
                    .enumerate()
                    .for_each(|(number, (tile, out))| {
                        let input = InputRows {
                            input,
                            all_rows: rows,
                            first: number * TILE,
                            rows: out.len() / latent,
                        };
                        gru.forward(weights, input, dropout, tile, out);
                    });
            }
        }
    }

    /// Adds the gradients of all weights for the gradient of `out`.
    pub(crate) fn backward<T: Real>(
        &self,
        (weights, gradient): (&[T], &mut [T]),
        (input, width): (&[T], usize),
        dropout: Option<Dropout>,
        record: &mut EncoderRecord<T>,
        ends: EncoderEnds<'_, T>,
    ) {
        let EncoderEnds {
            mut to_input,
            output,
        } = ends;
        match self {
            Self::Mlp(mlp) => {
                let latent = mlp.first.outputs;
                let all_rows = output.len() / latent;
                let mut scratch = MlpScratch::new(latent);
                for rows in tiles(output.len() / latent) {
                    let output = &mut output[rows.start * latent..rows.end * latent];
                    let tile = record.mlp.tile(mlp, &rows);
                    mlp.finish_backward(weights, &tile, output, &mut scratch, gradient);
                    let first = &scratch.first[..rows.len() * latent];
                    for (columns, input) in frames(mlp, (input, width), &rows) {
                        let start = columns.0 * all_rows + rows.start * width;
                        let to_input = to_input.as_deref_mut();
                        let to_input = to_input.map(|all| &mut all[start..start + input.len()]);
                        let to_input = to_input.map(|rows| (rows, Store::Replace));
                        mlp.first_backward(weights, columns, (first, input), gradient, to_input);
                    }
                }
            }
            Self::Gru(gru) => {
                let all_rows = input.len() / (gru.steps * width);
                let latent = output.len() / all_rows;
                let mut scratch = GruScratch::new(gru);
                for rows in tiles(all_rows) {
                    let output = &mut output[rows.start * latent..rows.end * latent];
                    let tile = record.gru.tile(gru, &rows);
                    let input = InputRows {
                        input,
                        all_rows,
                        first: rows.start,
                        rows: rows.len(),
                    };
                    let buffers = (&tile, &mut scratch);
                    gru.backward((weights, gradient), input, dropout, buffers, output);
                    let Some(to_input) = to_input.as_deref_mut() else {
                        continue;
                    };
                    for step in 0..gru.steps {
                        let start = (step * all_rows + rows.start) * width;
                        let to_input = &mut to_input[start..start + rows.len() * width];
                        gru.input_backward(weights, &scratch, (step, rows.len()), to_input);
                    }
                }
            }
        }
    }
}

/// What a perceptron sees of a tile: of each frame of the window, its columns of the first layer
/// (the first and how many) and the rows of the tile.
fn frames<'a, T>(
    mlp: &Mlp,
    (input, width): (&'a [T], usize),
    rows: &std::ops::Range<usize>,
) -> impl Iterator<Item = ((usize, usize), &'a [T])> + use<'a, T> {
    let window = mlp.first.inputs / width;
    let size = input.len() / window;
    let range = rows.start * width..rows.end * width;
    let columns = (0..window).map(move |frame| (frame * width, width));
    columns.zip(
        input
            .chunks_exact(size)
            .map(move |frame| &frame[range.clone()]),
    )
}

/// The tiles of a perceptron's record, for threads to share.
pub(crate) fn mlp_tiles<T: Real>(
    record: &mut MlpRecord<T>,
    latent: usize,
) -> impl IndexedParallelIterator<Item = MlpTile<'_, T>> {
    let outputs = record.normal.len() / record.inverse_deviation.len().max(1);
    (
        record.hidden1.par_chunks_mut(TILE * latent),
        record.hidden2.par_chunks_mut(TILE * latent),
        record.normal.par_chunks_mut(TILE * outputs),
        record.inverse_deviation.par_chunks_mut(TILE),
    )
        .into_par_iter()
        .map(|(hidden1, hidden2, normal, inverse_deviation)| MlpTile {
            hidden1,
            hidden2,
            normal,
            inverse_deviation,
        })
}

fn gru_tiles<T: Real>(
    record: &mut GruRecord<T>,
    steps: usize,
    hidden: usize,
) -> impl IndexedParallelIterator<Item = GruTile<'_, T>> {
    let [states0, states1] = &mut record.states;
    let [kept0, kept1] = &mut record.kept;
    (
        states0.par_chunks_mut(TILE * (steps + 1) * hidden),
        states1.par_chunks_mut(TILE * (steps + 1) * hidden),
        kept0.par_chunks_mut(TILE * steps * 4 * hidden),
        kept1.par_chunks_mut(TILE * steps * 4 * hidden),
        record.between.par_chunks_mut(TILE * steps * hidden),
        record.from_input.par_chunks_mut(TILE * steps * 3 * hidden),
        record.from_hidden.par_chunks_mut(TILE * 3 * hidden),
        record.normal.par_chunks_mut(TILE * hidden),
        record.inverse_deviation.par_chunks_mut(TILE),
    )
        .into_par_iter()
        .map(|tile| GruTile {
            states: [tile.0, tile.1],
            kept: [tile.2, tile.3],
            between: tile.4,
            from_input: tile.5,
            from_hidden: tile.6,
            normal: tile.7,
            inverse_deviation: tile.8,
        })
}
