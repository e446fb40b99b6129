//! `selvedge presets`: the shipped training configurations, each network's size and arithmetic.

use anyhow::Context;
use selvedge_lab::assets;
use selvedge_model::{Encoder, Network};
use selvedge_train::{CorrectionConfig, TrainConfig};
use serde::Serialize;
use serde_json::json;

use super::flops::{FirstEdgeLayer, Flops, flops};
use crate::output::{Answer, Table};

/// The cloth that a frame is counted for: the paper's, 2949 edges.
const VERTICES: usize = 1024;
const ARCS: usize = 5898;

#[derive(Serialize)]
struct Row {
    name: &'static str,
    parameters: usize,
    encoder: Encoder,
    vertex_columns: usize,
    arc_columns: usize,
    steps: u64,
    flops_per_vertex: u64,
    flops_per_arc: u64,
    flops_per_frame: u64,
    /// With the first layer of an edge update as it is written rather than split.
    flops_per_frame_unsplit: u64,
}

/// Lists them.
///
/// # Errors
/// When one of them cannot be read, which a test rules out.
pub(crate) fn run() -> anyhow::Result<Answer> {
    let rows = assets::TRAININGS
        .iter()
        .map(|&(name, text)| row(name, text));
    let rows: Vec<Row> = rows.collect::<anyhow::Result<_>>()?;
    let mut table = Table::new([
        "preset",
        "encoder",
        "columns",
        "parameters",
        "steps",
        "FLOP/vertex",
        "FLOP/arc",
        "GFLOP/frame",
        "unsplit",
    ]);
    for row in &rows {
        let encoder = match row.encoder {
            Encoder::Mlp { .. } => "mlp".to_owned(),
            Encoder::Gru { window } => format!("gru {window}"),
            Encoder::StreamingGru { window } => format!("streaming-gru {window}"),
        };
        table.row([
            row.name.to_owned(),
            encoder,
            format!("{} + {}", row.vertex_columns, row.arc_columns),
            row.parameters.to_string(),
            row.steps.to_string(),
            row.flops_per_vertex.to_string(),
            row.flops_per_arc.to_string(),
            format!("{:.2}", row.flops_per_frame as f64 / 1e9),
            format!("{:.2}", row.flops_per_frame_unsplit as f64 / 1e9),
        ]);
    }
    let report = json!({ "vertices": VERTICES, "arcs": ARCS, "presets": rows });
    let note = format!(
        "A frame is one of a cloth of {VERTICES} vertices and {ARCS} arcs; \"unsplit\" counts the first layer of an edge update as it is written."
    );
    Answer::new(format!("{table}\n{note}"), &report)
}

fn row(name: &'static str, text: &str) -> anyhow::Result<Row> {
    let (spec, steps) = if CorrectionConfig::is_meant(text) {
        let cfg = CorrectionConfig::parse_with(text, name.as_ref(), &[])?;
        (cfg.model, cfg.steps)
    } else {
        let cfg = TrainConfig::parse(text, name.as_ref())?;
        (cfg.model, cfg.steps)
    };
    let spec = &spec;
    let network = Network::new(spec).with_context(|| name.to_owned())?;
    let Flops { vertex, arc } = flops(spec, FirstEdgeLayer::Split);
    Ok(Row {
        name,
        parameters: network.parameter_count(),
        encoder: spec.encoder,
        vertex_columns: spec.node_width(),
        arc_columns: spec.edge_width(),
        steps,
        flops_per_vertex: vertex,
        flops_per_arc: arc,
        flops_per_frame: flops(spec, FirstEdgeLayer::Split).per_frame(VERTICES, ARCS),
        flops_per_frame_unsplit: flops(spec, FirstEdgeLayer::Whole).per_frame(VERTICES, ARCS),
    })
}
