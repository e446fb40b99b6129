//! Dropout between the layers of the recurrent encoders, the same values as on the CPU.

use selvedge_model::{Connectivity, Dropout as CpuDropout};

use crate::layers::DROPOUT;
use crate::plan::Region;
use crate::schedule::{Argument, Schedule};

/// What is dropped: value `column` of a row in `step` has the number
/// (first + step apart) latent + column, which is added to the row's seed and hashed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout {
    /// Probability of a zero.
    pub rate: f64,
    /// For vertices and for arcs: of each row its first number, and how far those of its steps are
    /// apart, `[rows, 2]`.
    pub numbers: [Region; 2],
    /// For vertices and for arcs: the seed of each row, low half first, `[rows, 2]`.
    pub seeds: [Region; 2],
}

/// Numbers and seeds of the rows of vertices, and of those of arcs, for [`Dropout`]: a graph that goes
/// through the network on the CPU by itself drops these. `steps` are frames of vertices and of arcs.
#[must_use]
pub fn dropout_words(
    graph: &Connectivity,
    steps: [usize; 2],
    dropout: CpuDropout,
) -> [[Vec<u32>; 2]; 2] {
    let [nodes, edges] = graph.dropout_rows(steps);
    let [seed, other] = dropout.seeds();
    [(nodes, seed), (edges, other)].map(|(rows, seed)| {
        let seed = [seed as u32, (seed >> 32) as u32];
        [rows.concat(), seed.repeat(rows.len())]
    })
}

/// Multiplies rows of vertices (`kind` 0) or arcs (1) by their mask of a step, from the first of `rows`
/// to the second.
pub(super) fn drop_out(
    schedule: &mut Schedule,
    dropout: &Dropout,
    (kind, step): (usize, usize),
    rows: [Region; 2],
) {
    // As selvedge_model reckons them.
    let scale = (1.0 / (1.0 - dropout.rate)) as f32;
    let threshold = (dropout.rate * (1_u64 << 32) as f64) as u32;
    schedule.launch(
        &DROPOUT,
        dropout.numbers[kind].count() / 2,
        &[
            rows[0].into(),
            rows[1].into(),
            dropout.numbers[kind].into(),
            dropout.seeds[kind].into(),
            Argument::Count(step as u32),
            Argument::Count(threshold),
            Argument::Number(scale),
        ],
    );
}
