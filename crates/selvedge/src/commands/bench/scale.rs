//! `selvedge bench scale`: time and memory of a frame of ever larger cloth.
//!
//! The cloth is a sheet of squares with diagonals: an irregular mesh of a million vertices would
//! take longer to make than to measure, and the network sees the same numbers of arcs.

use anyhow::Context;
use selvedge_cloth::Topology;
use selvedge_model::{Connectivity, Encoder, Instructions, ModelSpec};
use serde::Serialize;
use serde_json::json;

use super::variants::Engine;
use super::{median, threads, time};
use crate::cli::ScaleArgs;
use crate::interrupt;
use crate::output::{Answer, End, Table};

/// Blocks of the network: the paper's.
const BLOCKS: usize = 15;

#[derive(Serialize)]
struct Row {
    vertices: usize,
    arcs: usize,
    elapsed_ms: f64,
    microseconds_per_vertex: f64,
    /// Memory that the first frame took, with input and weights.
    bytes_per_vertex: Option<f64>,
}

/// Measures them.
///
/// # Errors
/// When a cloth cannot be made.
pub(crate) fn run(args: &ScaleArgs) -> anyhow::Result<Answer> {
    let (pool, threads) = threads(args.threads)?;
    let spec = ModelSpec::physical(Encoder::MLP, usize::from(args.latent), BLOCKS);
    let mut rows = Vec::new();
    let sizes = std::iter::successors(Some(1000_u32), |n| Some(4 * n));
    let below = sizes.take_while(|&n| n < args.most);
    for vertices in below.chain(Some(args.most)) {
        if interrupt::requested() {
            break;
        }
        rows.push(pool.install(|| measure(&spec, vertices as usize))?);
    }
    let end = if interrupt::requested() {
        End::Interrupted
    } else {
        End::Complete
    };
    let mut table = Table::new(["vertices", "arcs", "ms", "µs/vertex", "bytes/vertex"]);
    for row in &rows {
        table.row([
            row.vertices.to_string(),
            row.arcs.to_string(),
            format!("{:.1}", row.elapsed_ms),
            format!("{:.2}", row.microseconds_per_vertex),
            row.bytes_per_vertex
                .map_or("-".to_owned(), |b| format!("{b:.0}")),
        ]);
    }
    let note = format!(
        "Perceptron encoder, latent {}, {BLOCKS} blocks, {threads} threads; bytes: what the process grew by.",
        args.latent
    );
    let report =
        json!({ "threads": threads, "latent": args.latent, "blocks": BLOCKS, "rows": rows });
    Ok(Answer::new(format!("{table}\n{note}"), &report)?.ended(end))
}

fn measure(spec: &ModelSpec, vertices: usize) -> anyhow::Result<Row> {
    let topology = sheet(vertices)?;
    let graph = Connectivity::of(&topology);
    drop(topology);
    let before = resident();
    let mut engine = Engine::new(spec, graph, Instructions::Detected)?;
    engine.frame();
    let grown = before.zip(resident()).map(|(before, after)| after - before);
    let (vertices, arcs) = engine.counts();
    let runs = (200_000 / vertices).clamp(2, 20);
    let elapsed_ms = median((0..runs).map(|_| time(|| engine.frame())).collect());
    Ok(Row {
        vertices,
        arcs,
        elapsed_ms,
        microseconds_per_vertex: 1e3 * elapsed_ms / vertices as f64,
        bytes_per_vertex: grown.map(|bytes| bytes / vertices as f64),
    })
}

/// A sheet of about so many vertices, as nearly square as can be.
pub(super) fn sheet(vertices: usize) -> anyhow::Result<Topology> {
    let columns = vertices.isqrt().max(2);
    let lines = (vertices / columns).max(2);
    let mut faces = Vec::with_capacity(2 * (columns - 1) * (lines - 1));
    for line in 0..lines - 1 {
        for column in 0..columns - 1 {
            let a = (line * columns + column) as u32;
            let (b, c) = (a + 1, a + columns as u32);
            faces.extend([[a, b, c], [b, c + 1, c]]);
        }
    }
    Topology::new(columns * lines, &faces).context("making a sheet to measure on")
}

/// Memory of this process in bytes, where the system says it.
fn resident() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(1024.0 * kilobytes)
}
