//! Warnings for a cloth that starts far from its pattern: by the median over its edges of l/l₀ at
//! the start, and by its worst edges.
//!
//! A median far from 1 means that texture coordinates are in another unit, or that the start is no
//! start of this cloth. A few edges far from 1 are a fault of the mesh, and would fling it about.

use glam::DVec3;
use selvedge_cloth::{Handles, Mesh, VertexId};
use serde::Serialize;

/// Medians beyond these are warned of: no fabric hangs so, no start is folded so by intent.
const SMALLEST: f64 = 0.8;
const LARGEST: f64 = 1.25;

/// Stretch from which single edges are warned of.
const OVERSTRAINED: f64 = 1.5;
/// Stretch from which strain is not said in percent.
const MOST_IN_PERCENT: f64 = 100.0;
/// Stretch of a single edge from which a run is likely to fail at once.
const HOPELESS: f64 = 3.0;
/// Edges that a warning names.
const NAMED: usize = 3;
/// The remedy for texture coordinates of which nothing is said.
pub(super) const PICTURES: &str = "where they are made for pictures take the rest shape from the form in space with mesh.pattern = \"shape\"; where they are a pattern in another unit stretch it with mesh.texture = \"fit\" or mesh.transform.material_scale";

/// An edge with its stretch at the start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StrainedEdge {
    /// The two ends.
    pub vertices: [VertexId; 2],
    /// Panels of its faces, two at a seam; see [`selvedge_cloth::Pattern::panels`].
    pub panels: Vec<u32>,
    /// Fabrics of its faces, where they have names.
    pub fabrics: Vec<String>,
    /// Length over length in the pattern.
    pub stretch: f64,
}

/// A ratio of two lengths, in words. Lengths of a broken file can be too large for a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times(pub f64);

impl std::fmt::Display for Times {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            times if times.is_nan() => f.write_str("an unknown number of times"),
            times if times.is_infinite() => f.write_str("more than 1e308 ×"),
            0.0 => f.write_str("0 ×"),
            times if (1e-3..1e4).contains(&times) => write!(f, "{times:.3} ×"),
            times => write!(f, "{times:.1e} ×"),
        }
    }
}

/// The `count` edges that are longest at `positions` `[m]`, `[vertices]`, by their pattern; but those
/// that `handles` hold at both ends.
pub fn worst_edges(
    mesh: &Mesh,
    handles: &Handles,
    positions: &[DVec3],
    count: usize,
) -> Vec<StrainedEdge> {
    let held = handles.mask(positions.len());
    let edges = mesh.topology().edges();
    let is_free = |edge: usize| edges[edge].vertices.iter().any(|v| !held[v.index()]);
    let mut order: Vec<(usize, f64)> = stretches(mesh, positions).into_iter().enumerate().collect();
    order.retain(|(edge, _)| is_free(*edge));
    order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    order.truncate(count);
    let panels = mesh.pattern().panels();
    let named = |(edge, stretch): (usize, f64)| {
        let edge = &edges[edge];
        let faces = || [Some(edge.faces.0), edge.faces.1].into_iter().flatten();
        let mut on: Vec<u32> = faces().map(|face| panels[face.index()]).collect();
        on.dedup();
        let fabric = |face| Some(mesh.fabrics().names[mesh.fabrics().of(face)?].clone());
        let mut fabrics: Vec<String> = faces().filter_map(fabric).collect();
        fabrics.dedup();
        StrainedEdge {
            vertices: edge.vertices,
            panels: on,
            fabrics,
            stretch,
        }
    };
    order.into_iter().map(named).collect()
}

/// Length over length in the pattern of each panel's edges, the median, `[panels]`; see
/// [`selvedge_cloth::Pattern::panels`].
pub fn panel_stretches(mesh: &Mesh, positions: &[DVec3]) -> Vec<f64> {
    let panels = mesh.pattern().panels();
    let count = panels.iter().max().map_or(0, |last| *last as usize + 1);
    let mut of_panel = vec![Vec::new(); count];
    for edge in mesh.topology().edges() {
        let [a, b] = edge.vertices.map(|v| positions[v.index()]);
        let (left, right) = mesh.pattern().sides(edge);
        for side in [Some(left), right].into_iter().flatten() {
            let panel = panels[side.face.index()] as usize;
            of_panel[panel].push(a.distance(b) / side.length());
        }
    }
    let median = |mut stretches: Vec<f64>| {
        stretches.sort_by(f64::total_cmp);
        stretches.get(stretches.len() / 2).copied().unwrap_or(1.0)
    };
    of_panel.into_iter().map(median).collect()
}

impl std::fmt::Display for StrainedEdge {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [a, b] = self.vertices;
        let panels: Vec<String> = self.panels.iter().map(ToString::to_string).collect();
        let word = if panels.len() > 1 { "between panels" } else { "in panel" };
        write!(
            f,
            "{a}-{b} at {} {word} {}",
            Times(self.stretch),
            panels.join(" and ")
        )?;
        if !self.fabrics.is_empty() {
            write!(f, " ({})", self.fabrics.join(", "))?;
        }
        Ok(())
    }
}

/// Warnings for a cloth that starts where its mesh stands, far from its pattern.
pub fn strain_warnings(mesh: &Mesh) -> Vec<String> {
    warnings(mesh, mesh.positions(), PICTURES)
}

/// Warnings for a cloth that starts at `positions` `[m]`, `[vertices]`, far from its pattern;
/// `remedy` says how the units of its file can be mended.
pub(super) fn warnings(mesh: &Mesh, positions: &[DVec3], remedy: &str) -> Vec<String> {
    let mut stretches = stretches(mesh, positions);
    stretches.sort_by(f64::total_cmp);
    let median = stretches[stretches.len() / 2];
    if !(SMALLEST..=LARGEST).contains(&median) {
        return vec![format!(
            "mesh: half of the edges start at {} their material length or {}{}: texture coordinates are material coordinates in metres; {remedy}",
            Times(median),
            if median < 1.0 { "less" } else { "more" },
            if median < MOST_IN_PERCENT {
                format!(", a strain of {:.0} %", 100.0 * (median - 1.0))
            } else {
                String::new()
            }
        )];
    }
    let over = stretches.iter().filter(|stretch| **stretch > OVERSTRAINED);
    let over = over.count();
    if over == 0 {
        return Vec::new();
    }
    let worst = worst_edges(mesh, &Handles::default(), positions, NAMED);
    let named: Vec<String> = worst.iter().map(ToString::to_string).collect();
    vec![format!(
        "mesh: {over} edges start at more than {OVERSTRAINED} × their length in the pattern, the worst are {}{}: mend them, or {remedy}, or let the cloth relax before it moves with start = \"fit\"",
        named.join(", "),
        if worst[0].stretch > HOPELESS {
            "; a run from there is likely to fail in its first frame"
        } else {
            ""
        }
    )]
}

/// Length over length in the pattern of each edge, `[edges]`.
fn stretches(mesh: &Mesh, positions: &[DVec3]) -> Vec<f64> {
    let edges = mesh.topology().edges().iter();
    edges
        .zip(mesh.pattern().edge_lengths())
        .map(|(edge, rest)| {
            let [a, b] = edge.vertices.map(|v| v.index());
            positions[a].distance(positions[b]) / rest
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::says;
    use selvedge_cloth::generate::square;

    #[test]
    fn what_starts_far_from_its_size_is_warned_of() {
        let mesh = square(40, 1.0, 3).unwrap().mesh;
        let scaled = |by: f64| -> Vec<DVec3> { mesh.positions().iter().map(|p| *p * by).collect() };
        for by in [1.0, 0.81, 1.24] {
            assert!(warnings(&mesh, &scaled(by), "mend it").is_empty(), "{by}");
        }
        for (by, words) in [
            (0.79, ["0.790 × their material length or less", "-21 %"]),
            (2.0, ["2.000 × their material length or more", "100 %"]),
        ] {
            let text = warnings(&mesh, &scaled(by), "mend it").remove(0);
            says(&text, &words);
            assert!(text.ends_with("in metres; mend it"), "{text}");
        }
    }

    #[test]
    fn ratios_are_said_in_words_however_large() {
        for (times, words) in [
            (1.25, "1.250 ×"),
            (0.0, "0 ×"),
            (2e-7, "2.0e-7 ×"),
            (3.2e300, "3.2e300 ×"),
            (f64::INFINITY, "more than 1e308 ×"),
            (f64::NAN, "an unknown number of times"),
        ] {
            assert_eq!(Times(times).to_string(), words);
        }
        let mesh = square(40, 1.0, 3).unwrap().mesh;
        let far: Vec<DVec3> = mesh.positions().iter().map(|p| *p * 1e200).collect();
        let text = warnings(&mesh, &far, "mend it").remove(0);
        let words = ["more than 1e308 × their material length or more: texture"];
        says(&text, &words);
    }

    #[test]
    fn single_edges_that_are_far_too_long_are_named() {
        let mesh = square(100, 1.0, 3).unwrap().mesh;
        let mut positions = mesh.positions().to_vec();
        positions[70].x += 3.0;
        let text = warnings(&mesh, &positions, "mend it").remove(0);
        says(&text, &["70", "in panel 0", "start = \"fit\""]);
        let worst = worst_edges(&mesh, &Handles::default(), &positions, 2);
        let is_at = |edge: &StrainedEdge| edge.vertices.contains(&VertexId(70));
        assert!(worst.iter().all(is_at));
        assert!(worst[0].stretch >= worst[1].stretch && worst[1].stretch > 10.0);
    }
}
